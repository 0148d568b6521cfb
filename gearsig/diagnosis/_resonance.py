"""Resonances: frequencies at which several orders peak during a sweep of speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis._lines import mesh_is_confirmed
from gearsig.diagnosis._signals import AnalysisSignals, line_at
from gearsig.diagnosis._types import Finding, Kind, OrderLevel, Strength, Where, from_p_value, p_text
from gearsig.errors import InputError, RefusalError
from gearsig.orders import SeparatedOrder
from gearsig.prepared import LinesOverFloor

NARROWEST, WIDEST = 0.01, 0.05
"""Relative width within which peaks count as coincident: steps of speed and filters shift them by at least as much."""


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
        """Mean frequency of the peaks, weighted by prominence, in Hz."""
        weights = [peak.prominence_db for peak in self.peaks]
        return float(np.average([peak.frequency_hz for peak in self.peaks], weights=weights))


def detect_resonances(levels: Mapping[str, Sequence[OrderLevel]]) -> list[Finding]:
    """Report frequencies at which several orders peak, each at its own speed, because the structure resonates there.

    An order's level may rise and fall with speed for other reasons. Peaks of two orders would then rarely lie at one
    frequency: the probability follows from the number of peaks and the range of frequencies they sweep.
    """
    clusters = sorted((c for name in levels for c in _clusters(name, levels[name])), key=lambda c: c.p_value)
    kept: list[_Cluster] = []
    for cluster in clusters:
        if all(abs(cluster.frequency_hz / other.frequency_hz - 1) > WIDEST for other in kept):
            kept.append(cluster)
    corrected = [replace(c, p_value=c.p_value * len(levels)) for c in kept]
    return [_finding(c, clusters) for c in corrected if c.p_value <= 0.1][:3]


def _clusters(channel: str, levels: Sequence[OrderLevel]) -> list[_Cluster]:
    peaks = [peak for level in levels for peak in _peaks(level)]
    return [c for peak in peaks if (c := _around(channel, peak, peaks, levels)) is not None]


def _peaks(level: OrderLevel) -> list[_Peak]:
    """Return the peaks with at least twice the amplitude of the level on both sides, excluding the ends of the run."""
    from scipy.signal import find_peaks

    decibels = 20 * np.log10(np.maximum(level.amplitude, 1e-300))
    at, properties = find_peaks(decibels, prominence=6.0)
    return [_Peak(level, int(i), float(p)) for i, p in zip(at, properties["prominences"], strict=True)]


def _around(channel: str, centre: _Peak, peaks: Sequence[_Peak], levels: Sequence[OrderLevel]) -> _Cluster | None:
    """Return the peaks of other orders nearest to one, in the number that makes their coincidence least likely."""
    nearest: list[tuple[float, _Peak]] = []
    chances = []
    for level in levels:
        if level is centre.level or not level.frequency_hz[0] < centre.frequency_hz < level.frequency_hz[-1]:
            continue
        of_level = [p for p in peaks if p.level is level]
        chances.append((len(of_level), log(level.frequency_hz[-1] / max(level.frequency_hz[0], 1e-9))))
        if of_level:
            close = min(of_level, key=lambda p: abs(log(p.frequency_hz / centre.frequency_hz)))
            nearest.append((abs(log(close.frequency_hz / centre.frequency_hz)), close))
    best: _Cluster | None = None
    for n, (distance, _) in enumerate(sorted(nearest, key=lambda pair: pair[0]), start=1):
        width = max(distance, NARROWEST)
        if width > WIDEST:
            break
        # Every set of n + 1 peaks is examined from each of them, so that there are fewer sets.
        n_sets = len(peaks) / (n + 1)
        # Any peak of an order lies within ± width by chance; find the probability that at least n orders have one.
        distribution = np.array([1.0])
        for n_own, span in chances:
            by_chance = 1.0 - max(0.0, 1.0 - 2.0 * width / span) ** n_own
            distribution = np.convolve(distribution, [1.0 - by_chance, by_chance])
        p_value = min(1.0, n_sets * float(distribution[n:].sum()))
        members = tuple(p for d, p in nearest if d <= distance)
        if best is None or p_value < best.p_value:
            best = _Cluster(channel, (centre, *members), p_value)
    return best


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
        # Every structure has resonances: a frequency examined in a run-up is more likely than not to have one.
        confidence=from_p_value(cluster.p_value, prior=0.8, limit=0.95),
        confidence_basis=f"chance that peaks of {len(peaks)} orders meet at one frequency {p_text(cluster.p_value)}",
        evidence=("Levels measured there are the structure's as much as the gears': compare them at the same speed.",),
        surer="A slower run-up, or a run-down: a resonance stays at its frequency.",
    )


# Levels of mesh harmonics and other orders over speed, where the speed sweeps a range.


def order_levels(signals: AnalysisSignals) -> dict[str, tuple[OrderLevel, ...]]:
    """Return the levels of each channel's orders over speed; empty if the speed changes by less than a fifth.

    These are mesh harmonics where the mesh is confirmed, and the strongest multiples of half a shaft order. Each is
    extracted by a two-pole Vold–Kalman filter, as wide as neighbouring orders allow: a narrower one smooths resonances.
    """
    low, high = signals.angle.speed_range_rpm if signals.angle is not None else (0.0, 0.0)
    if not (high >= 1.2 * max(low, 0.0) > 0 or (low <= 0 < high)):
        return {}
    return {name: tuple(_levels(signals, name)) for name in signals.order_excess}


def _levels(signals: AnalysisSignals, channel: str) -> Iterator[OrderLevel]:
    from gearsig.orders import track_vold_kalman

    orders = _orders_to_track(signals, channel)
    shafts = signals.known_shaft_orders.values()
    meshes = [order for _, order, pair, _ in orders if pair]
    sidebands = [order + side * shaft for order in meshes for shaft in shafts for side in (-1, 1)]
    others = [*(order for _, order, _, _ in orders), *sidebands]
    for name, order, pair, harmonic in orders:
        # Half of the distance to the nearest order, or to its own mirror image at negative orders: two poles then leave
        # a hundredth of the neighbour's amplitude.
        nearest = min([order, *(abs(order - other) for other in others if other != order)])
        bandwidth = float(np.clip(0.5 * nearest, 0.1, 0.5))
        try:
            separated = track_vold_kalman(
                signals.recording, channel, [order], bandwidth_orders=bandwidth, n_poles=2, shaft_angle=signals.angle
            ).orders[0]
        except (InputError, RefusalError):
            continue  # above half the sampling rate all the time, or the record is too short for the band
        speed, amplitude = _over_speed(separated)
        if len(speed) >= 20:
            yield OrderLevel(name, order, speed, amplitude, separated.unit, bandwidth, pair, harmonic)


def _over_speed(order: SeparatedOrder) -> tuple[FloatArray, FloatArray]:
    """Return the rms amplitude in 160 equal steps of speed, leaving out speeds that never occurred."""
    at = np.flatnonzero(order.valid)
    if len(at) == 0:
        return np.zeros(0), np.zeros(0)
    rpm, n_speeds = 60.0 * order.frequency_hz[at] / order.order, 160
    edges = np.linspace(rpm.min(), rpm.max(), n_speeds + 1)
    step = np.clip(np.searchsorted(edges, rpm, side="right") - 1, 0, n_speeds - 1)
    n = np.bincount(step, minlength=n_speeds)
    power = np.bincount(step, weights=np.abs(order.envelope[at]) ** 2, minlength=n_speeds)
    there = n > 0
    middles = (edges[:-1] + edges[1:]) / 2
    return middles[there], np.sqrt(power[there] / n[there])


def _orders_to_track(signals: AnalysisSignals, channel: str) -> list[tuple[str, float, str, int]]:
    """Return name, order, pair and harmonic of the orders to follow, mesh harmonics of two pairs first."""
    assert signals.angle is not None  # noqa: S101 - `order_levels` has checked it; narrows the type
    low, high = (max(rpm, 0.0) / 60.0 for rpm in signals.angle.speed_range_rpm)
    # Orders that lie below half the sampling rate in at least two fifths of the speed range.
    highest = 0.5 * signals.recording.sampling_rate_hz / (low + 0.4 * (high - low))
    meshes = [
        (f"{h}× mesh of {pair.name}", h * mesh, pair.name, h)
        for pair in signals.rig.pairs[:2]
        if (mesh := signals.rig.mesh_order(pair)) is not None and mesh_is_confirmed(signals, pair)
        for h in range(1, 5)
        if h * mesh < highest
    ]
    # Other orders above half the lowest mesh order come from unequal teeth, or are sidebands.
    below = min(highest, min((0.5 * order for _, order, _, _ in meshes), default=highest))
    others = _strongest(signals, signals.order_excess[channel], below)[: max(0, 6 - len(meshes))]
    return meshes + [(f"order {order:g}", order, "", 0) for order in sorted(others)]


def _strongest(signals: AnalysisSignals, excess: LinesOverFloor, highest: float) -> list[float]:
    """Return the multiples of half a shaft order at which a clear line stands, the strongest first.

    Half orders are those of four-stroke engines. Other lines are noise of a fixed frequency, smeared by the speed, or
    belong to parts that are not described.
    """
    spectrum = excess.spectrum
    lines: dict[float, float] = {}
    strongest = float(spectrum.values.max())
    for shaft in signals.known_shaft_orders.values():
        # Multiples above 48 seldom belong to a shaft itself.
        n_orders = min(48, int(min(highest, spectrum.positions[-1]) / (shaft / 2)))
        for order in (float(o) for o in np.arange(1, n_orders + 1) * shaft / 2):
            # A level that changes with speed broadens a line.
            line = line_at(excess, order, max(0.02, 1.5 * spectrum.resolution), max(0.1, 6 * spectrum.resolution))
            if line is None or not line.is_highest or any(abs(order - other) <= 0.1 for other in lines):
                continue
            # 15 dB over the floor; a line 30 dB below the strongest dominates the vibration at no speed.
            if line.amplitude > max(line.floor * 10 ** (15.0 / 20), strongest * 10 ** (-30 / 20)):
                lines[order] = line.amplitude
    return sorted(lines, key=lambda order: -lines[order])
