"""The teeth's patterns of a recording and of the healthy reference, for a picture of both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.change import lines_of_shaft, turned_difference
from gearsig.gap.curve_types import AverageCurves
from gearsig.gap.frame import DRIVEN, DRIVER
from gearsig.gap.gathered import Gathered
from gearsig.gap.tooth import mesh_power, residual_lines
from gearsig.severity.calibration import load_calibration

POINTS_PER_PERIOD = 4
"""Of the highest order: the picture's lines are then smooth."""


def average_curves(now: Gathered, reference: Gathered, *, unit: str = "") -> tuple[AverageCurves, ...]:
    """Return what tells the teeth apart in both shafts' averages, of a recording and of its reference.

    Of the channel on which most has changed, over its mesh harmonics. The angle is that at which a tooth engages: the
    answer's usual lag is taken off, as in `gearsig.gap.curves.angle_curves`.

    Parameters
    ----------
    now, reference : Gathered
        With the same channels.
    unit : str
        Of the channels.

    Raises
    ------
    RefusalError
        If the reference was taken at another speed.
    """
    return tuple(_of_side(now, reference, side, unit) for side in (DRIVER, DRIVEN))


def _of_side(now: Gathered, reference: Gathered, side: int, unit: str) -> AverageCurves:
    difference, _ = turned_difference(now, reference, side)
    n = difference.lines.shape[1]
    own = lines_of_shaft(now, side).lines[:, :n]

    def pattern(lines: NDArray[np.complex128]) -> NDArray[np.complex128]:
        return residual_lines(lines, difference.teeth, difference.highest_order, difference.other_teeth)

    scales = [mesh_power(now, sums, side) for sums in now.channels.values()]
    changed = [np.sum(np.abs(pattern(row)) ** 2) / scale for row, scale in zip(difference.lines, scales, strict=True)]
    row = int(np.argmax(changed))
    measured = pattern(own[row])
    lag = load_calibration().lag_pitches / difference.teeth
    waves = [_wave(lines, lag) for lines in (measured, measured - pattern(difference.lines[row]))]
    return AverageCurves(
        now.frame.shafts[side],
        unit,
        list(now.channels)[row],
        now.frame.teeth[side],
        now.marks[side],
        np.arange(len(waves[0])) * 360.0 / len(waves[0]),
        *waves,
    )


def _wave(lines: NDArray[np.complex128], lag_rev: float) -> FloatArray:
    """Return one revolution of peak amplitudes, moved back by the answer's lag."""
    n = POINTS_PER_PERIOD * (len(lines) - 1)
    turned = lines * np.exp(2j * np.pi * np.arange(len(lines)) * lag_rev)
    wave: FloatArray = np.fft.irfft(turned, n) * (n / 2.0)
    return wave
