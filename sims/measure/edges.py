"""Where a simulated shaft passes the edges of a pulse disc."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError


def disc_edges(
    revolutions: FloatArray, time_s: FloatArray, pulses_per_revolution: int, duty: float, first_pulse_rev: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Times at which the pulse rises and falls, and whether it is high at the start.

    A window opens at angles (k + offset) and closes `duty` of a pulse period later; turning back, its end opens it.
    Times are interpolated between steps: wrong by at most (acceleration/speed)·Δ²/8.

    Parameters
    ----------
    revolutions, time_s : arrays, (n_steps,)
    pulses_per_revolution : int
    duty : float
    first_pulse_rev : float

    Raises
    ------
    InputError
        If the shaft turns by half a pulse period or more within a step.
    """
    periods = (revolutions - first_pulse_rev) * pulses_per_revolution
    if len(periods) > 1 and np.abs(np.diff(periods)).max() >= 0.5 * min(duty, 1 - duty):
        raise InputError(
            f"the shaft turns by {np.abs(np.diff(periods)).max():.2g} pulse periods within a step",
            where="tachometer",
            allowed=f"below {0.5 * min(duty, 1 - duty):g}: half the shorter part of a pulse",
            remedy="fewer pulses per revolution or a finer step",
        )
    opens, opens_back = _crossings(periods, time_s)
    closes, closes_back = _crossings(periods - duty, time_s)
    high = bool(periods[0] % 1.0 < duty)
    return np.sort(np.concatenate([opens, closes_back])), np.sort(np.concatenate([closes, opens_back])), high


def _crossings(periods: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times of passing whole numbers, forwards and backwards."""
    whole = np.floor(periods)
    step = np.diff(whole)
    found = []
    for direction in (1.0, -1.0):
        i = np.flatnonzero(step == direction)
        target = whole[i + 1] if direction > 0 else whole[i]
        part = (target - periods[i]) / (periods[i + 1] - periods[i])
        found.append(time_s[i] + part * (time_s[i + 1] - time_s[i]))
    return found[0], found[1]
