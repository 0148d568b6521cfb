"""Time columns: how they are recognised, and whether they are uniform enough to stand for a sampling rate."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.recording.raw_table import NumberArray

TIME_NAMES = frozenset(
    (
        *("time", "t", "zeit", "temps", "tiempo", "tempo", "seconds", "sec", "timestamp", "elapsed_time"),
        *("time_s", "t_s", "zeit_s", "temps_s", "time_ms", "t_ms"),
    )
)
SECONDS_PER_UNIT = {
    "": 1.0,
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "sek": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
}
MAX_JITTER = 0.01
"""Largest deviation of a time stamp from the uniform grid, in sampling steps."""


def seconds_per_unit(name: str, unit: str) -> float | None:
    """Return the factor to seconds if name and unit are those of a time column, else None.

    Examples
    --------
    >>> seconds_per_unit("Zeit", "ms"), seconds_per_unit("T", "°C"), seconds_per_unit("acc", "s")
    (0.001, None, None)
    """
    plain = re.sub(r"[\s\-]+", "_", name.strip().casefold())
    if plain not in TIME_NAMES or (name.strip() == "T" and not unit):  # a bare capital T is rather a temperature
        return None
    suffix = plain.rpartition("_")[2] if "_" in plain else ""
    return SECONDS_PER_UNIT.get(unit.strip().casefold() or (suffix if suffix in SECONDS_PER_UNIT else ""))


def rate_of_time(values: NumberArray, scale_s: float, where: str, row_place: Callable[[int], str]) -> float:
    r"""Return the sampling rate of a uniform time column.

    .. math:: f_s = (N - 1) / (t_{N-1} - t_0)

    Parameters
    ----------
    values : array, (n_samples,)
        Times in the file's unit.
    scale_s : float
        Seconds per unit.
    where : str
        File and column, for the error.
    row_place : callable
        Row number to words.

    Returns
    -------
    float
        In Hz, from the mean step.

    Raises
    ------
    InputError
        If time does not increase, jumps, or leaves the uniform grid by more than 1 % of a step and by more than
        the column's own rounding.
    """
    t: FloatArray = np.asarray(values, dtype=np.float64)
    _check_usable(t, where, row_place)
    step = (t[-1] - t[0]) / (len(t) - 1)
    steps = np.diff(t)
    worst = int(np.argmin(steps))
    if steps[worst] <= 0:
        raise InputError(
            f"time does not increase at {row_place(worst + 1)}: {t[worst]:.9g} is followed by {t[worst + 1]:.9g}",
            where=where,
            allowed="strictly increasing time",
            remedy="remove doubled rows, export time with more digits, or drop the column and give --fs",
        )
    allowed = max(MAX_JITTER * step, 0.51 * _resolution(values, t))
    if _worst_deviation(t) > allowed:
        _raise_not_uniform(t, steps, where, row_place)
    return float(1.0 / (step * scale_s))


def _check_usable(t: FloatArray, where: str, row_place: Callable[[int], str]) -> None:
    if len(t) < 2:
        raise InputError(
            f"the time column has {len(t)} value(s)",
            where=where,
            allowed="at least two",
            remedy="the file was cut off; copy or export it again",
        )
    bad = np.flatnonzero(~np.isfinite(t))
    if len(bad):
        raise InputError(
            f"time is {t[bad[0]]} at {row_place(int(bad[0]))}",
            where=where,
            allowed="finite numbers",
            remedy="cut the file there or export it again",
        )


def _worst_deviation(t: FloatArray) -> float:
    """Largest distance of the times from the straight line fitted to them."""
    k = np.arange(len(t)) - (len(t) - 1) / 2
    centred = t - t.mean()
    slope = (k @ centred) / (k @ k)
    return float(np.abs(centred - slope * k).max())


def _resolution(values: NumberArray, t: FloatArray) -> float:
    """Step of the rounding that the times went through: decimal digits in text, or float32.

    Times printed with too few digits jitter by half a digit about a grid that was uniform when it was sampled.
    """
    if np.asarray(values).dtype == np.float32:
        return float(np.spacing(np.float32(np.abs(t).max())))
    some = t[:: max(1, len(t) // 2000)]
    for digits in range(13):
        scaled = some * 10.0**digits
        if np.abs(scaled - np.round(scaled)).max() < 1e-5:
            return float(10.0**-digits)
    return 0.0


def _raise_not_uniform(t: FloatArray, steps: FloatArray, where: str, row_place: Callable[[int], str]) -> None:
    median = float(np.median(steps))
    worst = int(np.argmax(np.abs(steps - median)))
    place = row_place(worst + 1)
    if steps[worst] > 1.5 * median:
        raise InputError(
            f"a gap of {steps[worst]:.6g} before {place} (time {t[worst]:.9g} to {t[worst + 1]:.9g}); "
            f"the usual step is {median:.6g}",
            where=where,
            allowed="time without gaps",
            remedy="cut the file at the gap and read the parts",
        )
    raise InputError(
        f"time is not uniform: the worst step, {steps[worst]:.6g}, ends at {place}; the usual step is {median:.6g}",
        where=where,
        allowed="time stamps within 1 % of a step of a uniform grid",
        remedy="resample to a uniform rate knowingly, or drop the time column and give --fs",
    )
