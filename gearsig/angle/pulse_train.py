"""From tachometer pulse times to shaft angle and speed."""

from __future__ import annotations

import numpy as np

from gearsig.angle.clock import clock_tick, fit_within_ticks, late_pulses
from gearsig.angle.pulse_faults import PulseCount, count_pulses
from gearsig.angle.slopes import monotone_slopes
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError, RefusalError

# A tenth of the pulses: a 36-1 or 60-2 tooth wheel stays below, and so does an occasional glitch.
_MOST_FAULTY = 0.1

# Pulses are only as good as the recorder's clock, whose scale no pulse can tell: crystals are right to some 50 ppm.
_CLOCK_SCALE = 5e-5


def pulse_train_angle(
    times_s: FloatArray, pulses_per_revolution: int = 1, *, shaft: str = "", tick_s: float | None = None
) -> ShaftAngle:
    """Turn pulse times into shaft angle.

    Pulse k lies at k / pulses_per_revolution revolutions. Spurious pulses are left out and missed ones counted; the
    notes say how many and where. Times on a clock's grid are smoothed within half a tick, others are taken as exact.

    Parameters
    ----------
    times_s : array, (n_pulses,)
        Increasing.
    pulses_per_revolution : int
    shaft : str
    tick_s : float, optional
        Step of the clock; 0: exact times. Default: found from the times.

    Returns
    -------
    ShaftAngle
        Knots at the pulses; speed exact at constant acceleration. The uncertainty is the timing error of two pulses
        (tick/√12 each, or the scatter of the intervals) over the duration, and at least the 5e-5 of a clock.

    Raises
    ------
    InputError
        No pulses, one pulse, or times that do not increase.
    RefusalError
        If more than a tenth of the pulses are spurious or missed, or a gap leaves their number open.

    Notes
    -----
    Pulses are taken as equally spaced around the shaft. A machine that stops between two pulses is kept: the angle
    stands still within that interval.
    """
    t = frozen_array(times_s, "tachometer pulse times", ndim=1).astype(np.float64)
    n_per_rev = count(pulses_per_revolution, "pulses_per_revolution")
    _check_order(t)
    counted = count_pulses(t)
    _check_faults(counted, len(t))
    tick = clock_tick(t) if tick_s is None else float(tick_s)
    kept = counted.times_s
    pulses = counted.counts.astype(np.float64)
    notes = _notes(counted, len(t))
    if tick > 0:
        notes += _clock_notes(tick, kept[late_pulses(kept, pulses, tick)] if len(kept) > 5 else kept[:0])
        breaks = np.searchsorted(kept, counted.pauses_s)
        pulses = np.maximum.accumulate(fit_within_ticks(kept, pulses, tick, breaks))
    revolutions = pulses / n_per_rev
    return ShaftAngle(
        shaft,
        kept,
        revolutions,
        monotone_slopes(kept, revolutions),
        "pulses",
        relative_speed_uncertainty=_uncertainty(kept, tick),
        quality=max(0.0, 1.0 - 5.0 * (len(counted.spurious_s) + counted.n_missed) / len(t)),
        notes=notes,
    )


def _check_order(t: FloatArray) -> None:
    where = "tachometer pulse times"
    if len(t) < 2:
        found = "there are no pulses" if len(t) == 0 else "there is only one pulse"
        raise InputError(
            found, where=where, allowed="at least two pulses", remedy="check the channel, its threshold and its cabling"
        )
    backwards = np.flatnonzero(np.diff(t) <= 0)
    if len(backwards):
        k = int(backwards[0]) + 1
        raise InputError(
            f"pulse {k} (counted from 0) at {t[k]:.9g} s does not come after pulse {k - 1} at {t[k - 1]:.9g} s",
            where=where,
            allowed="increasing times",
            remedy="check the column and the order of the rows",
        )


def _check_faults(counted: PulseCount, n_pulses: int) -> None:
    remedy = "check threshold, hysteresis and pulses_per_revolution, or estimate the speed from the vibration"
    if len(counted.open_gaps_s):
        raise RefusalError(
            f"after {counted.open_gaps_s[0]:.4g} s pulses are missing and their number cannot be told from the "
            f"neighbouring speed ({len(counted.open_gaps_s)} such gap(s))",
            remedy="analyse the parts before and after by themselves; " + remedy,
        )
    n_faulty = len(counted.spurious_s) + counted.n_missed
    if n_faulty > _MOST_FAULTY * n_pulses + 1:
        raise RefusalError(
            f"{len(counted.spurious_s)} spurious and {counted.n_missed} missed pulses among {n_pulses} are too many "
            "to trust the rest",
            remedy=remedy,
        )


def _uncertainty(t: FloatArray, tick_s: float) -> float:
    """Error of first and last pulse over the duration; without a tick, from the times' third differences.

    It is never below the error of the clock's own rate.
    """
    if tick_s > 0:
        timing_s = tick_s / np.sqrt(12.0)
    elif len(t) >= 5:
        # A third difference of independent errors has 1 + 9 + 9 + 1 = 20 times their variance.
        timing_s = float(np.median(np.abs(np.diff(t, 3)))) / 0.6745 / np.sqrt(20.0)
    else:
        return float("nan")
    return max(_CLOCK_SCALE, float(np.sqrt(2.0) * timing_s / (t[-1] - t[0])))


def _notes(counted: PulseCount, n_pulses: int) -> tuple[str, ...]:
    notes = []
    if len(counted.spurious_s):
        notes.append(
            f"{len(counted.spurious_s)} of {n_pulses} pulses were spurious and left out: {_at(counted.spurious_s)}"
        )
    if counted.n_missed:
        notes.append(f"{counted.n_missed} missed pulse(s) were counted in: {_at(counted.missed_s)}")
    if len(counted.pauses_s):
        notes.append(
            f"the machine stands still or nearly so within {len(counted.pauses_s)} interval(s): {_at(counted.pauses_s)}"
        )
    return tuple(notes)


def _clock_notes(tick_s: float, late_s: FloatArray) -> tuple[str, ...]:
    note = f"pulse times are quantised to {tick_s * 1e6:.4g} µs; the angle is smoothed within half of that"
    if not len(late_s):
        return (note,)
    return (
        note,
        f"{len(late_s)} single pulse(s) lie more than that off their neighbours and are bridged: {_at(late_s)}",
    )


def _at(times_s: FloatArray) -> str:
    shown = ", ".join(f"{t:.4g}" for t in times_s[:5])
    return f"at {shown}{' …' if len(times_s) > 5 else ''} s"
