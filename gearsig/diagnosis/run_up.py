"""Levels of mesh harmonics and other orders over speed, where the speed runs through a range."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis.comb import LineExcess
from gearsig.diagnosis.confirmation import mesh_is_confirmed
from gearsig.diagnosis.signals import Signals
from gearsig.diagnosis.types import OrderLevel
from gearsig.errors import InputError, RefusalError
from gearsig.orders.vold_kalman_types import SeparatedOrder

LEAST_SPEED_RATIO = 1.2
"""Highest over lowest speed from which levels over speed say something."""

N_MESH_HARMONICS = 4
MOST_PAIRS = 2
MOST_ORDERS = 6
BELOW_MESH = 0.5
"""Of the lowest mesh order: other orders above it are of teeth that differ, or sidebands."""

MOST_MULTIPLES = 48
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
FEWEST_SPEEDS = 20
LEAST_SHARE_OF_RANGE = 0.4
"""Of the speed range that an order must lie below half the sampling rate."""


@dataclass(frozen=True)
class _Wanted:
    name: str
    order: float
    bandwidth: float
    pair: str = ""
    harmonic: int = 0


def runs_up(signals: Signals) -> bool:
    """Whether the speed runs through a range wide enough."""
    if signals.angle is None or not signals.order_excess:
        return False
    low, high = signals.angle.speed_range_rpm
    return high >= LEAST_SPEED_RATIO * max(low, 0.0) > 0 or (low <= 0 < high)


def order_levels(signals: Signals) -> dict[str, tuple[OrderLevel, ...]]:
    """Return the levels of each channel's orders over speed; empty at a steady speed.

    Mesh harmonics where the mesh is confirmed, and the strongest multiples of half a shaft order. Each is taken out by
    a Vold–Kalman filter of two poles, as wide as its neighbours allow: a narrower one smooths resonances.
    """
    if not runs_up(signals):
        return {}
    return {name: tuple(_levels(signals, name)) for name in signals.order_excess}


def _levels(signals: Signals, channel: str) -> Iterator[OrderLevel]:
    from gearsig.orders.vold_kalman import track_vold_kalman

    for wanted in _wanted(signals, channel):
        try:
            separated = track_vold_kalman(
                signals.recording,
                channel,
                [wanted.order],
                bandwidth_orders=wanted.bandwidth,
                n_poles=N_POLES,
                shaft_angle=signals.angle,
            )
        except (InputError, RefusalError):
            continue  # above half the sampling rate all the time, or the record is too short for the band
        speed, amplitude = _over_speed(separated.orders[0])
        if len(speed) >= FEWEST_SPEEDS:
            unit = separated.orders[0].unit
            yield OrderLevel(
                wanted.name, wanted.order, speed, amplitude, unit, wanted.bandwidth, wanted.pair, wanted.harmonic
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


def _wanted(signals: Signals, channel: str) -> list[_Wanted]:
    """Return the orders to follow, mesh harmonics first, each with its bandwidth."""
    assert signals.angle is not None  # noqa: S101 - `runs_up` has seen to it; narrows the type
    low, high = (max(rpm, 0.0) / 60.0 for rpm in signals.angle.speed_range_rpm)
    highest = 0.5 * signals.recording.sampling_rate_hz / (low + LEAST_SHARE_OF_RANGE * (high - low))
    meshes = [
        (f"{h}× mesh of {pair.name}", h * mesh, pair.name, h)
        for pair in signals.rig.pairs[:MOST_PAIRS]
        if (mesh := signals.rig.mesh_order(pair)) is not None and mesh_is_confirmed(signals, pair)
        for h in range(1, N_MESH_HARMONICS + 1)
        if h * mesh < highest
    ]
    below = min(highest, min((BELOW_MESH * order for _, order, _, _ in meshes), default=highest))
    others = _strongest(signals, signals.order_excess[channel], below)[: max(0, MOST_ORDERS - len(meshes))]
    shafts = signals.known_shaft_orders.values()
    sidebands = [order + side * shaft for _, order, _, _ in meshes for shaft in shafts for side in (-1, 1)]
    every = [*(order for _, order, _, _ in meshes), *others, *sidebands]
    return [_Wanted(name, order, _bandwidth(order, every), pair, h) for name, order, pair, h in meshes] + [
        _Wanted(f"order {order:g}", order, _bandwidth(order, every)) for order in sorted(others)
    ]


def _bandwidth(order: float, others: list[float]) -> float:
    nearest = min((abs(order - other) for other in others if other != order), default=order)
    nearest = min(nearest, order)  # its own mirror image at negative orders
    return float(np.clip(SHARE_OF_DISTANCE * nearest, NARROWEST_ORDERS, WIDEST_ORDERS))


def _strongest(signals: Signals, excess: LineExcess, highest: float) -> list[float]:
    """Return the multiples of half a shaft order at which a clear line stands, the strongest first.

    Half orders are those of four-stroke engines. Lines elsewhere are noise of a fixed frequency, smeared by the speed,
    or belong to what is not described.
    """
    spectrum = excess.spectrum
    lines: dict[float, float] = {}
    strongest = float(spectrum.values.max())
    for shaft in signals.known_shaft_orders.values():
        n_orders = min(MOST_MULTIPLES, int(min(highest, spectrum.positions[-1]) / (shaft / 2)))
        for order in np.arange(1, n_orders + 1) * shaft / 2:
            found, amplitude = spectrum.largest_near(order, max(WITHIN_ORDERS, 1.5 * spectrum.resolution))
            around = spectrum.largest_near(order, max(AROUND_ORDERS, 6 * spectrum.resolution))[1]
            least = max(excess.floor[spectrum.index_of(found)] * 10 ** (CLEAR_DB / 20), STRONG * strongest)
            clear = amplitude > least
            if clear and amplitude >= around and all(abs(order - other) > NARROWEST_ORDERS for other in lines):
                lines[float(order)] = amplitude
    return sorted(lines, key=lambda order: -lines[order])
