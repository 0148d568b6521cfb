"""Speed and acceleration channels whose scale is wrong: told by the angle, which a counter cannot misread."""

from __future__ import annotations

from math import sqrt

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError

WINDOW_S = 0.05
"""Over which changes are compared: longer than flanks ring, shorter than a start."""
FEWEST_WINDOWS = 8
MOST_OF_ONE = 0.5
"""Of the sum of squares that a single window may have."""
ALLOWED = {1: 0.03, 2: 0.06}
"""Parts by which scales of speeds and of accelerations may differ."""
LEAST_RATE_HZ = {1: 0.0, 2: 4000.0}
"""Sampling rates from which on they are compared: slower, an acceleration that rings is folded down, alike in each
start, so that its sum is off and its scatter does not say so."""
CERTAIN = 5.0
"""Standard errors of the scale."""


def channel_scale(
    angle_rad: FloatArray, rate: FloatArray, sampling_rate_hz: float, order: int = 1
) -> tuple[float, float]:
    """Return the scale of a speed or acceleration against the angle, and its standard error.

    Speed: ∫ ω dt = s Δθ over windows of a twentieth of a second. Acceleration: the second difference of ∬ α dt² is s
    times that of θ. Least squares, in which the angle, which a counter gives nearly without noise, explains the
    rate; the error by leaving out each window (jackknife), as blows between samples spoil single ones.

    Parameters
    ----------
    angle_rad : array, (n,)
    rate : array, (n,)
        In rad/s or rad/s².
    sampling_rate_hz : float
    order : int
        1: speed, 2: acceleration.

    Returns
    -------
    scale, standard_error : float
        1 where both agree; nan and nan where hardly anything moved, or in one window alone.
    """
    step = max(2, round(WINDOW_S * sampling_rate_hz))
    edges = np.arange(0, len(angle_rad), step)
    if len(edges) <= FEWEST_WINDOWS:
        return float("nan"), float("nan")
    summed = rate
    for _ in range(order):
        summed = np.concatenate([[0.0], np.cumsum(0.5 * (summed[1:] + summed[:-1]))]) / sampling_rate_hz
    x, y = np.diff(angle_rad[edges], order), np.diff(summed[edges], order)
    powers, products = x * x, x * y
    total = float(np.sum(powers))
    if float(np.max(powers)) >= MOST_OF_ONE * total:
        return float("nan"), float("nan")
    without = (np.sum(products) - products) / (total - powers)
    error = sqrt((len(x) - 1.0) * float(np.var(without)))
    return float(np.sum(products)) / total, error


def check_scale(
    angle_rad: FloatArray, rate: FloatArray, sampling_rate_hz: float, *, order: int, names: tuple[str, str], where: str
) -> None:
    """Refuse a speed or acceleration that does not go with the angle.

    Parameters
    ----------
    angle_rad, rate : array, (n,)
    sampling_rate_hz : float
    order : int
        1: speed, 2: acceleration.
    names : (str, str)
        Of both channels.
    where : str
        Recording, for the error.

    Raises
    ------
    InputError
        If the scale is off by more than 3 % (speeds) or 6 % (accelerations, from 4 kHz on), and by five of its standard
        errors.
    """
    if sampling_rate_hz < LEAST_RATE_HZ[order]:
        return
    scale, error = channel_scale(angle_rad, rate, sampling_rate_hz, order)
    if not abs(scale - 1.0) > max(ALLOWED[order], CERTAIN * error):
        return
    raise InputError(
        f"channel {names[1]!r} reads {scale:.3g} times what {names[0]!r} says",
        where=where,
        allowed=f"1 ± {ALLOWED[order]:g}",
        remedy=f"correct unit or scale of {names[1]!r} in its [[sensor]] table, or leave that channel out of the file",
    )
