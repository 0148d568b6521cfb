"""Angle channels that wrap or jump: told, not repaired."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError

LEAST_JUMP_RAD = 2e-3 * pi
"""A thousandth of a revolution: no gear with its load gets there and stays within one sample."""
SCATTER = 50.0
"""Of the ordinary change of the angle's increments: an impact reaches a tenth of that."""
QUANTA = 4.0
"""Of a coarse encoder's step."""
NEARLY = 0.1
"""Of a revolution, by which a step may differ from a whole one that is an encoder's new beginning."""


def check_angle(angle_rad: FloatArray, sampling_rate_hz: float, name: str, where: str = "") -> None:
    """Raise where an angle that should run on does not.

    Parameters
    ----------
    angle_rad : array, (n,)
    sampling_rate_hz : float
    name, where : str
        Of the channel and of its recording, for the error.

    Raises
    ------
    InputError
        At the first step by nearly a whole revolution (an encoder that wraps), or at a jump.
    """
    check_wrap(angle_rad, sampling_rate_hz, name, where)
    steps, beyond = _steps(angle_rad)
    moving = np.abs(steps[steps != 0.0])
    quantum = float(moving.min()) if len(moving) else 0.0
    limit = max(LEAST_JUMP_RAD, SCATTER * 1.4826 * float(np.median(beyond)), QUANTA * quantum)
    found = np.flatnonzero(beyond > limit)
    if len(found):
        i = int(found[0])
        raise InputError(
            f"channel {name!r} jumps by {abs(steps[i]):.4g} rad {_when(i, sampling_rate_hz)} "
            f"({len(found)} such jump(s))",
            where=where,
            allowed="an angle that runs on",
            remedy="cut the recording there; lost counts make all later forces wrong",
        )


def check_wrap(angle_rad: FloatArray, sampling_rate_hz: float, name: str, where: str = "") -> None:
    """Raise where an angle steps by nearly a whole revolution: an encoder that starts again after each.

    Parameters
    ----------
    angle_rad : array, (n,)
    sampling_rate_hz : float
    name, where : str
        Of the channel and of its recording, for the error.

    Raises
    ------
    InputError
        At the first such step, or if there are fewer than 4 samples.
    """
    if len(angle_rad) < 4:
        raise InputError(f"channel {name!r} has {len(angle_rad)} samples", where=where, allowed="at least 4")
    turns = _steps(angle_rad)[1] / (2.0 * pi)
    found = np.flatnonzero(np.abs(turns - 1.0) < NEARLY)
    if len(found):
        i = int(found[0])
        raise InputError(
            f"channel {name!r} steps by {turns[i]:.3g} revolutions {_when(i, sampling_rate_hz)}: the encoder starts "
            "again after each revolution",
            where=where,
            allowed="an angle that runs on",
            remedy=f"give wraps = true in the rig file, in [speed] or in the [[sensor]] table of {name!r} (force, "
            "start-stop and identify also take --unwrap)",
        )


def _steps(angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angle's steps, and what each has beyond the steps around it."""
    steps = np.diff(angle_rad)
    # Around it: the middle one of three, so that a jump does not hide itself.
    around = np.sort(np.stack([np.roll(steps, 1), steps, np.roll(steps, -1)]), axis=0)[1]
    around[0], around[-1] = steps[1], steps[-2]
    return steps, np.abs(steps - around)


def _when(step: int, sampling_rate_hz: float) -> str:
    return f"from {step / sampling_rate_hz:.6g} to {(step + 1) / sampling_rate_hz:.6g} s"
