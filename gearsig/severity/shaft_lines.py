"""Synchronous averages of the two shafts of a gear pair, as spectra over the order of each shaft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.angle.types import ShaftAngle
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.speed import PulseTimes, TachometerChannel
from gearsig.rig.types import GearPair, Rig

LEAST_REVOLUTIONS = 13
"""Of either shaft: fewer leave the other shaft's orders in its average, and the calibration has no fewer."""


@dataclass(frozen=True)
class ShaftLines:
    """The lines of a shaft's synchronous average.

    Parameters
    ----------
    shaft : str
    teeth, other_teeth : int
        Of the gear on it, and of its mate.
    lines : complex array, (n_channels, n_orders)
        lines[c, n] is the complex amplitude (peak) of order n of this shaft.
    n_revolutions : int
    highest_order : int
    order_hz : float
        Mean frequency of the shaft.
    channels : tuple of str
    has_mark : bool
        Whether order phases count from a mark on this very shaft.
    """

    shaft: str
    teeth: int
    other_teeth: int
    lines: NDArray[np.complex128]
    n_revolutions: int
    highest_order: int
    order_hz: float
    channels: tuple[str, ...]
    has_mark: bool = False


def shaft_lines(
    recording: Recording, rig: Rig, pair: GearPair, shaft: str, angle: ShaftAngle, channels: Sequence[str]
) -> ShaftLines:
    """Return the lines of the shaft's average for each channel.

    Raises
    ------
    RefusalError
        If there are too few revolutions.
    """
    from gearsig.angle.resample import resample_to_angle
    from gearsig.orders.average import synchronous_average

    ratio = rig.ratio(shaft)
    own, other = pair.teeth(shaft), pair.teeth(pair.driven if shaft == pair.driver else pair.driver)
    if ratio is None or own is None or other is None:
        raise RefusalError("the teeth of both gears are not known", remedy="state them in the rig file")
    turned = angle if ratio == 1.0 else angle.of_shaft(shaft, ratio)
    if turned.n_revolutions < LEAST_REVOLUTIONS:
        raise RefusalError(
            f"the record holds {turned.n_revolutions:.3g} revolutions of shaft {shaft!r}, "
            f"{LEAST_REVOLUTIONS} are needed",
            remedy="record longer",
        )
    signal = resample_to_angle(recording, turned, channels=list(channels))
    averages = [synchronous_average(signal, name) for name in channels]
    n = len(averages[0].values)
    highest = min(int(averages[0].highest_order), (n - 1) // 2)
    lines = np.stack([2.0 * np.fft.rfft(a.values)[: highest + 1] / n for a in averages])
    return ShaftLines(
        shaft,
        own,
        other,
        lines,
        averages[0].n_revolutions,
        highest,
        turned.mean_speed_rpm / 60.0,
        tuple(channels),
        has_mark(recording, rig, shaft),
    )


def orders_from_mesh(orders: NDArray[np.intp], teeth: int) -> NDArray[np.intp]:
    """Return how many orders of a shaft lie between each order and the nearest mesh harmonic."""
    distance: NDArray[np.intp] = np.abs((orders + teeth // 2) % teeth - teeth // 2)
    return distance


def has_mark(recording: Recording, rig: Rig, shaft: str) -> bool:
    """Say whether angle 0 of a shaft is a mark on that very shaft: one pulse per revolution."""
    source = recording.speed_source
    if not isinstance(source, PulseTimes | TachometerChannel) or source.pulses_per_revolution != 1:
        return False
    return (source.shaft or rig.reference_shaft) == shaft
