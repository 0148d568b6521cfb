"""Resonances: frequencies at which several orders peak as the speed runs through."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis._lines import mesh_is_confirmed
from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._types import Finding, Kind, OrderLevel, Strength, Where, from_p_value, p_text
from gearsig.errors import InputError, RefusalError
from gearsig.orders import SeparatedOrder
from gearsig.prepared import LineExcess

PROMINENCE_DB = 6.0
"""A peak of a level over speed stands out by so much on both sides: twice the amplitude."""

NARROWEST = 0.01
"""Relative width within which peaks count as together: steps of speed and filters move them by as much."""

WIDEST = 0.05

LARGEST_P_VALUE = 0.1
PRIOR = 0.8
"""Every structure has resonances: who looks at one frequency in a run-up finds one more often than not."""

MAX_RESONANCES = 3


@dataclass(frozen=True)
class _Peak:
    level: OrderLevel
    i: int
    prominence_db: float

    @property
    def frequency_hz(self) -> float:
        return float(self.level.frequency_hz[self.i])

    @property
    def speed_rpm(self) -> float:
        return float(self.level.speed_rpm[self.i])


@dataclass(frozen=True)
class _Cluster:
    channel: str
    peaks: tuple[_Peak, ...]
    p_value: float

    @property
    def frequency_hz(self) -> float:
        """Mean of the peaks', more prominent ones counting more."""
        weights = [peak.prominence_db for peak in self.peaks]
        return float(np.average([peak.frequency_hz for peak in self.peaks], weights=weights))


def detect_resonances(levels: Mapping[str, Sequence[OrderLevel]]) -> list[Finding]:
    """Report frequencies at which several orders peak, each at its own speed: the structure answers there.

    An order's level may rise and fall with speed for other reasons. If it did so by chance, peaks of two orders would
    rarely lie at one frequency: the chance follows from the number of peaks and the range of frequencies they pass.
    """
    clusters = sorted((c for name in levels for c in _clusters(name, levels[name])), key=lambda c: c.p_value)
    kept: list[_Cluster] = []
    for cluster in clusters:
        if all(abs(cluster.frequency_hz / other.frequency_hz - 1) > WIDEST for other in kept):
            kept.append(cluster)
    significant = [c for c in kept if c.p_value * len(levels) <= LARGEST_P_VALUE]
    found = [replace(c, p_value=c.p_value * len(levels)) for c in significant]
    return [_finding(cluster, clusters) for cluster in found[:MAX_RESONANCES]]


def _clusters(channel: str, levels: Sequence[OrderLevel]) -> list[_Cluster]:
    peaks = [peak for level in levels for peak in _peaks(level)]
    found = [_around(channel, peak, peaks, levels) for peak in peaks]
    return [cluster for cluster in found if cluster is not None]


def _peaks(level: OrderLevel) -> list[_Peak]:
    """Return the peaks of a level that stand out on both sides; the ends of the run are none."""
    from scipy.signal import find_peaks

    decibels = 20 * np.log10(np.maximum(level.amplitude, 1e-300))
    at, properties = find_peaks(decibels, prominence=PROMINENCE_DB)
    return [_Peak(level, int(i), float(p)) for i, p in zip(at, properties["prominences"], strict=True)]


def _around(channel: str, centre: _Peak, peaks: Sequence[_Peak], levels: Sequence[OrderLevel]) -> _Cluster | None:
    """Return the peaks of other orders nearest to one, as many as make their coincidence least likely."""
    nearest: list[tuple[float, _Peak]] = []
    chances = []
    for level in levels:
        if level is centre.level or not level.frequency_hz[0] < centre.frequency_hz < level.frequency_hz[-1]:
            continue
        own = [p for p in peaks if p.level is level]
        chances.append((len(own), log(level.frequency_hz[-1] / max(level.frequency_hz[0], 1e-9))))
        if own:
            close = min(own, key=lambda p: abs(log(p.frequency_hz / centre.frequency_hz)))
            nearest.append((abs(log(close.frequency_hz / centre.frequency_hz)), close))
    best: _Cluster | None = None
    for n, (distance, _) in enumerate(sorted(nearest, key=lambda pair: pair[0]), start=1):
        width = max(distance, NARROWEST)
        if width > WIDEST:
            break
        # Every set of n + 1 peaks is looked at from each of them: so many fewer are the sets.
        n_sets = len(peaks) / (n + 1)
        p_value = min(1.0, n_sets * _at_least(n, [_chance(m, width, span) for m, span in chances]))
        members = tuple(p for d, p in nearest if d <= distance)
        if best is None or p_value < best.p_value:
            best = _Cluster(channel, (centre, *members), p_value)
    return best


def _chance(n_peaks: int, width: float, span: float) -> float:
    """Return the probability that any of an order's peaks lies within ± width by chance."""
    return 1.0 - max(0.0, 1.0 - 2.0 * width / span) ** n_peaks


def _at_least(n: int, chances: Sequence[float]) -> float:
    """Return the probability that at least n of independent events happen."""
    distribution = np.array([1.0])
    for chance in chances:
        distribution = np.convolve(distribution, [1.0 - chance, chance])
    return float(distribution[n:].sum())


def _finding(cluster: _Cluster, every: Sequence[_Cluster]) -> Finding:
    hertz = cluster.frequency_hz
    near = [c.channel for c in every if abs(c.frequency_hz / hertz - 1) <= WIDEST]
    peaks = sorted(cluster.peaks, key=lambda p: p.speed_rpm)
    strongest = max(peaks, key=lambda p: p.level.amplitude[p.i])
    largest = float(strongest.level.amplitude[strongest.i])
    beside = largest / 10 ** (strongest.prominence_db / 20)
    speeds = ", ".join(f"{p.level.name} at {p.speed_rpm:.0f} rpm" for p in peaks)
    return Finding(
        "resonance",
        Kind.NOTICE,
        f"A resonance at about {hertz:.4g} Hz: {speeds} peak there.",
        Where(tuple(dict.fromkeys([cluster.channel, *near])), frequency_hz=hertz),
        Strength(largest, strongest.level.unit, beside, "level beside the peak", strongest.prominence_db),
        confidence=from_p_value(cluster.p_value, prior=PRIOR, limit=0.95),
        confidence_basis=f"chance that peaks of {len(peaks)} orders meet at one frequency {p_text(cluster.p_value)}",
        evidence=("Levels measured there are the structure's as much as the gears': compare them at the same speed.",),
        surer="A slower run-up, or a run-down: a resonance stays at its frequency.",
    )


# --------------------
# Levels of mesh harmonics and other orders over speed, where the speed runs through a range.
# --------------------


MIN_SPEED_RATIO = 1.2
"""Highest over lowest speed from which levels over speed say something."""

N_MESH_HARMONICS = 4
MAX_PAIRS = 2
MAX_ORDERS = 6
BELOW_MESH = 0.5
"""Of the lowest mesh order: other orders above it are of teeth that differ, or sidebands."""

MAX_MULTIPLES = 48
"""Of half a shaft order: those above are seldom a shaft's own."""

CLEAR_DB = 15.0
"""Of a line of the order spectrum over its floor, for an order that is no mesh's."""

STRONG = 10 ** (-30 / 20)
"""Against the strongest line of the spectrum: what is weaker does not rule the vibration at any speed."""

WITHIN_ORDERS = 0.02
AROUND_ORDERS = 0.1
"""A line is the highest of its surroundings; a level that changes with speed makes it broad."""

WIDEST_ORDERS, NARROWEST_ORDERS = 0.5, 0.1
N_POLES = 2
SHARE_OF_DISTANCE = 0.5
"""Of the distance to the nearest order: two poles then leave a hundredth of its amplitude."""

N_SPEEDS = 160
MIN_SPEEDS = 20
MIN_SHARE_OF_RANGE = 0.4
"""Of the speed range that an order must lie below half the sampling rate."""


@dataclass(frozen=True)
class _OrderRequest:
    name: str
    order: float
    bandwidth: float
    pair: str = ""
    harmonic: int = 0


def runs_up(signals: AnalysisSignals) -> bool:
    """Whether the speed runs through a range wide enough."""
    if signals.angle is None or not signals.order_excess:
        return False
    low, high = signals.angle.speed_range_rpm
    return high >= MIN_SPEED_RATIO * max(low, 0.0) > 0 or (low <= 0 < high)


def order_levels(signals: AnalysisSignals) -> dict[str, tuple[OrderLevel, ...]]:
    """Return the levels of each channel's orders over speed; empty at a steady speed.

    Mesh harmonics where the mesh is confirmed, and the strongest multiples of half a shaft order. Each is taken out by
    a Vold–Kalman filter of two poles, as wide as its neighbours allow: a narrower one smooths resonances.
    """
    if not runs_up(signals):
        return {}
    return {name: tuple(_levels(signals, name)) for name in signals.order_excess}


def _levels(signals: AnalysisSignals, channel: str) -> Iterator[OrderLevel]:
    from gearsig.orders import track_vold_kalman

    for request in _orders_to_track(signals, channel):
        try:
            separated = track_vold_kalman(
                signals.recording,
                channel,
                [request.order],
                bandwidth_orders=request.bandwidth,
                n_poles=N_POLES,
                shaft_angle=signals.angle,
            )
        except (InputError, RefusalError):
            continue  # above half the sampling rate all the time, or the record is too short for the band
        speed, amplitude = _over_speed(separated.orders[0])
        if len(speed) >= MIN_SPEEDS:
            unit = separated.orders[0].unit
            yield OrderLevel(
                request.name, request.order, speed, amplitude, unit, request.bandwidth, request.pair, request.harmonic
            )


def _over_speed(order: SeparatedOrder) -> tuple[FloatArray, FloatArray]:
    """Return the root mean square of the amplitude in equal steps of speed, those that never occurred left out."""
    at = np.flatnonzero(order.valid)
    if len(at) == 0:
        return np.zeros(0), np.zeros(0)
    rpm = 60.0 * order.frequency_hz[at] / order.order
    edges = np.linspace(rpm.min(), rpm.max(), N_SPEEDS + 1)
    step = np.clip(np.searchsorted(edges, rpm, side="right") - 1, 0, N_SPEEDS - 1)
    n = np.bincount(step, minlength=N_SPEEDS)
    power = np.bincount(step, weights=np.abs(order.envelope[at]) ** 2, minlength=N_SPEEDS)
    there = n > 0
    middles = (edges[:-1] + edges[1:]) / 2
    return middles[there], np.sqrt(power[there] / n[there])


def _orders_to_track(signals: AnalysisSignals, channel: str) -> list[_OrderRequest]:
    """Return the orders to follow, mesh harmonics first, each with its bandwidth."""
    assert signals.angle is not None  # noqa: S101 - `runs_up` has seen to it; narrows the type
    low, high = (max(rpm, 0.0) / 60.0 for rpm in signals.angle.speed_range_rpm)
    highest = 0.5 * signals.recording.sampling_rate_hz / (low + MIN_SHARE_OF_RANGE * (high - low))
    meshes = [
        (f"{h}× mesh of {pair.name}", h * mesh, pair.name, h)
        for pair in signals.rig.pairs[:MAX_PAIRS]
        if (mesh := signals.rig.mesh_order(pair)) is not None and mesh_is_confirmed(signals, pair)
        for h in range(1, N_MESH_HARMONICS + 1)
        if h * mesh < highest
    ]
    below = min(highest, min((BELOW_MESH * order for _, order, _, _ in meshes), default=highest))
    others = _strongest(signals, signals.order_excess[channel], below)[: max(0, MAX_ORDERS - len(meshes))]
    shafts = signals.known_shaft_orders.values()
    sidebands = [order + side * shaft for _, order, _, _ in meshes for shaft in shafts for side in (-1, 1)]
    every = [*(order for _, order, _, _ in meshes), *others, *sidebands]
    return [_OrderRequest(name, order, _bandwidth(order, every), pair, h) for name, order, pair, h in meshes] + [
        _OrderRequest(f"order {order:g}", order, _bandwidth(order, every)) for order in sorted(others)
    ]


def _bandwidth(order: float, others: list[float]) -> float:
    nearest = min((abs(order - other) for other in others if other != order), default=order)
    nearest = min(nearest, order)  # its own mirror image at negative orders
    return float(np.clip(SHARE_OF_DISTANCE * nearest, NARROWEST_ORDERS, WIDEST_ORDERS))


def _strongest(signals: AnalysisSignals, excess: LineExcess, highest: float) -> list[float]:
    """Return the multiples of half a shaft order at which a clear line stands, the strongest first.

    Half orders are those of four-stroke engines. Lines elsewhere are noise of a fixed frequency, smeared by the speed,
    or belong to what is not described.
    """
    spectrum = excess.spectrum
    lines: dict[float, float] = {}
    strongest = float(spectrum.values.max())
    for shaft in signals.known_shaft_orders.values():
        n_orders = min(MAX_MULTIPLES, int(min(highest, spectrum.positions[-1]) / (shaft / 2)))
        for order in np.arange(1, n_orders + 1) * shaft / 2:
            found, amplitude = spectrum.largest_near(order, max(WITHIN_ORDERS, 1.5 * spectrum.resolution))
            around = spectrum.largest_near(order, max(AROUND_ORDERS, 6 * spectrum.resolution))[1]
            least = max(excess.floor[spectrum.index_of(found)] * 10 ** (CLEAR_DB / 20), STRONG * strongest)
            clear = amplitude > least
            if clear and amplitude >= around and all(abs(order - other) > NARROWEST_ORDERS for other in lines):
                lines[float(order)] = amplitude
    return sorted(lines, key=lambda order: -lines[order])
