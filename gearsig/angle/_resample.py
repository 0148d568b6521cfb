"""Resampling from equal steps of time to equal steps of shaft angle, with anti-aliasing that follows the speed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numba import config

from gearsig.angle._types import AngleSignal, ShaftAngle, check_shaft_angle
from gearsig.checks import FloatArray, count, listed, positive, read_only
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.recording import Recording, check_recording

# Band-limited interpolation at arbitrary times.


PASSBAND = 0.4
"""Upper edge relative to the lower of both sampling rates, up to which the error stays below 5e-6 of full scale."""

HALF_BAND = 20  # taps on each side of the doubling filter
_NEAR = 6  # taps on each side of the fractional delay, at the doubled rate

REACH = HALF_BAND + _NEAR // 2 + 1
"""Number of samples on each side of a point that contribute to its value."""

_N_PHASES = 512
_BLOCK = 512
# -116 dB; with 2 × 20 taps the error is 3e-6 at 0.4 of the sampling rate and below 1e-6 up to 0.2.
_KAISER_BETA = 0.1102 * (116.0 - 8.7)


@lru_cache(maxsize=1)
def doubling_filter() -> FloatArray:
    """Return one side of the half-band filter that interpolates halfway between samples, (HALF_BAND,).

    h(j) = sinc(j + 1/2) · I₀(β√(1 - ((j + 1/2)/H)²)) / I₀(β), scaled to sum one half.

    Source: A. V. Oppenheim, R. W. Schafer, *Discrete-Time Signal Processing*, ch. 7 (Kaiser window).
    """
    side = kaiser_sinc(np.arange(HALF_BAND) + 0.5, HALF_BAND)
    half: FloatArray = side / (2.0 * side.sum())
    return half


@lru_cache(maxsize=1)
def delay_table() -> FloatArray:
    """Return fractional-delay taps for each sub-sample position at the doubled rate, (n_phases, 4·_NEAR).

    A row holds the taps of a position, followed by the differences to those of the next position.

    Least squares over the band |f| < a/2 with a = 0.42 (in cycles per doubled sample, i.e. 0.42 of the original rate):
    Σₘ sinc(a(k - m)) hₘ = sinc(a(k - d)) for delay d. Rows sum to one, so that constants are preserved.

    Source: T. I. Laakso, V. Välimäki, M. Karjalainen, U. K. Laine, *Splitting the unit delay*, IEEE Signal
    Processing Magazine 13 (1996), general least-squares design.
    """
    a = 0.42
    delays = np.arange(_N_PHASES + 1) / _N_PHASES
    taps = np.arange(1 - _NEAR, _NEAR + 1)
    within = np.sinc(a * (taps[:, None] - taps[None, :]))
    across = np.sinc(a * (taps[:, None] - delays[None, :]))
    rows = np.linalg.lstsq(within, across, rcond=1e-15)[0].T
    rows /= rows.sum(axis=1, keepdims=True)
    return np.ascontiguousarray(np.hstack([rows[:-1], np.diff(rows, axis=0)]))


def kaiser_sinc(x: FloatArray, half_width: float) -> FloatArray:
    """Return sinc(x) times a Kaiser window that ends at `half_width`, for x >= 0."""
    inside = np.clip(1.0 - np.square(x / half_width), 0.0, None)
    h = np.sinc(x) * np.i0(_KAISER_BETA * np.sqrt(inside)) / np.i0(_KAISER_BETA)
    return np.where(x < half_width, h, 0.0)


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def interpolate(x, positions, side, table, out):  # type: ignore[no-untyped-def]
    """out[i] = value of x at positions[i] (in samples): the rate is doubled, then a fractional delay is applied.

    Positions are sorted and lie at least REACH samples inside x. Doubling first costs little, as it runs along the
    samples, and reduces the taps needed from forty to twelve.
    """
    first = int(positions[0]) - 3
    doubled = _doubled(x, first, int(positions[-1]) - first + 5, side)
    delay(doubled, first, 2.0, positions, table, out)


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _doubled(x, first, n, side):  # type: ignore[no-untyped-def]
    """Return samples first to first + n of x, each followed by the value halfway to the next, (2n,).

    It works in blocks that stay in the L1 cache while the taps run over them.
    """
    doubled = np.empty(2 * n)
    middle = np.empty(_BLOCK)
    for start in range(0, n, _BLOCK):
        m = min(_BLOCK, n - start)
        at = first + start
        middle[:m] = 0.0
        for j in range(side.shape[0]):
            weight = side[j]
            left = x[at - j : at - j + m]
            right = x[at + j + 1 : at + j + 1 + m]
            for i in range(m):
                middle[i] += weight * (left[i] + right[i])
        for i in range(m):
            doubled[2 * (start + i)] = x[at + i]
            doubled[2 * (start + i) + 1] = middle[i]
    return doubled


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def delay(y, first, per_sample, positions, table, out):  # type: ignore[no-untyped-def]
    """Read y, whose value m lies at first + m / per_sample samples, at arbitrary positions by fractional delays."""
    # The number of taps is read from the table: with a constant, the compiler would unroll the loop into single
    # multiplications and use no vector instructions.
    n_phases, n_taps = table.shape[0], table.shape[1] // 2
    for i in range(positions.shape[0]):
        place = per_sample * (positions[i] - first)
        k = int(place)
        phase = (place - k) * n_phases
        p = int(phase)
        between = phase - p
        # Slices, since an index that might be negative keeps the compiler from using vector instructions.
        segment = y[k - 5 : k - 5 + n_taps]
        taps, rise = table[p, :n_taps], table[p, n_taps:]
        total = 0.0
        for j in range(n_taps):
            total += (taps[j] + between * rise[j]) * segment[j]
        out[i] = total


# Interpolation with a lower cut-off, for angle grids coarser than the recording's samples.


LOWEST_SCALE = 1.0 / 1024.0
"""Lowest cut-off relative to the recording's Nyquist frequency: a shaft at rest would need an infinite filter."""

# Steps of the kernel's table between zero crossings: linear interpolation is then accurate to 1e-7.
_N_STEPS = 2048
# The cut-off follows the speed in steps of 1 %; its filter leaves 0.4 to 0.6 of the sampling rate for the transition.
_STEP = 1.01


@lru_cache(maxsize=1)
def kernel_side() -> FloatArray:
    """Return one side of the kernel, `_N_STEPS` per zero crossing, with zeros after its end."""
    return kaiser_sinc(np.arange(HALF_BAND * _N_STEPS + 2) / _N_STEPS, HALF_BAND)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def interpolate_coarse(x, positions, scale, side, table, out):  # type: ignore[no-untyped-def]
    """out[i] = x at positions[i] (in samples, sorted) after a low-pass with cut-off scale[i] · Nyquist, scale <= 1.

    The signal is low-passed on a grid of at least four points per cycle of the cut-off, then read by fractional delays.

    Source: R. E. Crochiere, L. R. Rabiner, *Interpolation and decimation of digital signals*, Proc. IEEE 69 (1981), on
    changing the rate in stages.
    """
    n = positions.shape[0]
    i = 0
    while i < n:
        lowest = highest = scale[i]
        stop = i + 1
        while stop < n:
            lowest, highest = min(lowest, scale[stop]), max(highest, scale[stop])
            if highest > _STEP * lowest:
                break
            stop += 1
        s = min(1.0, 0.5 * (lowest + highest) if stop > i + 1 else scale[i])
        # The grid's step is a whole number of samples, or half a sample near the full bandwidth.
        step = 0.5 if s > 0.5 else np.floor(0.5 / s)
        first = np.floor(positions[i]) - np.ceil(6 * step)
        n_grid = int((positions[stop - 1] - first) / step) + 8
        delay(
            _lowpassed(x, int(first), step, n_grid, s, side), first, 1.0 / step, positions[i:stop], table, out[i:stop]
        )
        i = stop


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _lowpassed(x, first, step, n, s, side):  # type: ignore[no-untyped-def]
    """Return low-passed x at first + m·step for m < n."""
    reach = int(np.ceil(HALF_BAND / s)) + 1
    y = np.empty(n)
    whole = _taps(reach, 0.0, s, side)
    if step > 0.5:
        for m in range(n):
            y[m] = _dot(x, first + int(m * step) - reach, whole)
        return y
    half = _taps(reach, 0.5, s, side)
    n_whole = (n + 1) // 2
    if first >= reach and first + n_whole + reach + 4 < x.shape[0]:
        even, odd = _along(x, first - reach, n_whole, whole), _along(x, first - reach, n // 2, half)
        for m in range(n_whole):
            y[2 * m] = even[m]
        for m in range(n // 2):
            y[2 * m + 1] = odd[m]
    else:
        for m in range(n_whole):
            y[2 * m] = _dot(x, first + m - reach, whole)
        for m in range(n // 2):
            y[2 * m + 1] = _dot(x, first + m - reach, half)
    return y


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _along(x, start, n, taps):  # type: ignore[no-untyped-def]
    """Return Σⱼ x[start + i + j] taps[j] for each i < n, tap by tap, which suits vector instructions."""
    y = np.zeros(n)
    for block in range(0, n, 2048):
        out = y[block : min(n, block + 2048)]
        length = out.shape[0]
        for j in range(0, taps.shape[0], 4):
            a, b, c, d = taps[j], taps[j + 1], taps[j + 2], taps[j + 3]
            at = start + block + j
            x0, x1, x2, x3 = (
                x[at : at + length],
                x[at + 1 : at + 1 + length],
                x[at + 2 : at + 2 + length],
                x[at + 3 : at + 3 + length],
            )
            for i in range(length):
                out[i] += a * x0[i] + b * x1[i] + c * x2[i] + d * x3[i]
    return y


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _taps(reach, shift, s, side):  # type: ignore[no-untyped-def]
    """Return the kernel at s·(j - shift), j = -reach …, with unit sum, zero-padded to a multiple of four taps."""
    taps = np.empty(4 * ((2 * reach + 4) // 4))
    for j in range(taps.shape[0]):
        place = min(abs(j - reach - shift) * s * _N_STEPS, side.shape[0] - 2.0)
        p = int(place)
        taps[j] = side[p] + (place - p) * (side[p + 1] - side[p])
    return taps / taps.sum()


@njit(cache=True, nogil=True, fastmath=True)  # type: ignore[untyped-decorator,unused-ignore]
def _dot(x, start, taps):  # type: ignore[no-untyped-def]
    """Return Σⱼ x[start + j] taps[j]; if the taps extend beyond x, the remaining ones are renormalised."""
    low, high = max(0, -start), min(taps.shape[0], x.shape[0] - start)
    segment = x[start + low : start + high]
    part = taps[low:high]
    total = 0.0
    for j in range(part.shape[0]):
        total += segment[j] * part[j]
    if part.shape[0] == taps.shape[0]:
        return total
    weight = part.sum()
    return total / weight if weight != 0.0 else 0.0


# Times at which a shaft passes given angles: the inverse of a piecewise cubic, solved exactly.


# Points per block that share one cubic guess; short enough for a good guess, long enough to be worthwhile.
_INVERSION_BLOCK = 32

# Slope of the inverse, relative to the interval, beyond which the shaft is nearly at rest and a cubic guess fails.
_STEEPEST = 1e3


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def times_at(knots, angle, speed, k, first, step, out):  # type: ignore[no-untyped-def]
    """Solve θ(t) = first + i·step for each i, with θ the Hermite cubic of values `angle` and slopes `speed` at `knots`.

    The search starts at interval k, which must not lie beyond the first angle; all angles lie within the knots' range.
    With u = (t - t₀)/h in an interval, θ - θ₀ = ((c u + b) u + a) u. The ends of each block are solved one by one; the
    points between them follow from a cubic guess of the inverse function and two Newton steps, independent of each
    other.
    """
    n, n_knots = out.shape[0], knots.shape[0]
    i = 0
    while i < n:
        while k < n_knots - 2 and angle[k + 1] < first + i * step:
            k += 1
        h, rise = knots[k + 1] - knots[k], angle[k + 1] - angle[k]
        a, m1 = speed[k] * h, speed[k + 1] * h
        c, b = a + m1 - 2.0 * rise, 3.0 * rise - 2.0 * a - m1
        stop = n
        if k < n_knots - 2:
            stop = max(i + 1, min(n, int(np.floor((angle[k + 1] - first) / step)) + 1))
        low = solve_cubic(a, b, c, rise, first + i * step - angle[k], 0.0)
        out[i] = knots[k] + low * h
        i += 1
        while i < stop:
            last = min(i + _INVERSION_BLOCK, stop) - 1
            high = solve_cubic(a, b, c, rise, first + last * step - angle[k], low)
            offset = first - angle[k]
            if last > i and not _between(a, b, c, low, high, offset, step, i, last, knots[k], h, out):
                for j in range(i, last):
                    low = solve_cubic(a, b, c, rise, offset + j * step, low)
                    out[j] = knots[k] + low * h
            out[last] = knots[k] + high * h
            low = high
            i = last + 1


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "arcp"})  # type: ignore[untyped-decorator,unused-ignore]
def _between(a, b, c, low, high, offset, step, start, last, t0, h, out):  # type: ignore[no-untyped-def]
    """Fill out[start:last] between solved points `low` (at start - 1) and `high` (at last); return if it converged."""
    slope_low, slope_high = (3.0 * c * low + 2.0 * b) * low + a, (3.0 * c * high + 2.0 * b) * high + a
    if slope_low <= 0.0 or slope_high <= 0.0:
        return False
    width = (last - start + 1) * step
    m0, m1, rise = width / slope_low, width / slope_high, high - low
    if max(m0, m1) > _STEEPEST:
        return False
    guess_c, guess_b = m0 + m1 - 2.0 * rise, 3.0 * rise - 2.0 * m0 - m1
    per_point = 1.0 / (last - start + 1)
    worst = 0.0
    for j in range(start, last):
        s = (j - start + 1) * per_point
        target = offset + j * step
        u = low + ((guess_c * s + guess_b) * s + m0) * s
        # The slope hardly changes between the two steps: one division serves both.
        per_slope = 1.0 / ((3.0 * c * u + 2.0 * b) * u + a)
        u -= (((c * u + b) * u + a) * u - target) * per_slope
        change = (((c * u + b) * u + a) * u - target) * per_slope
        worst = max(worst, abs(change))
        out[j] = t0 + (u - change) * h
    # Newton's method converges quadratically: after a step of 1e-8 the next one would be below rounding.
    return worst < 1e-8


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def solve_cubic(a, b, c, rise, target, start):  # type: ignore[no-untyped-def]
    """Return u in 0 to 1 with ((c u + b) u + a) u = target for a cubic that rises to `rise`, by bracketed Newton."""
    if target <= 0.0 or rise <= 0.0:
        return 0.0
    if target >= rise:
        return 1.0
    low, high = 0.0, 1.0
    u = start if 0.0 < start < 1.0 else target / rise
    for _ in range(100):
        error = ((c * u + b) * u + a) * u - target
        slope = (3.0 * c * u + 2.0 * b) * u + a
        if error > 0.0:
            high = u
        else:
            low = u
        following = u - error / slope if slope > 0.0 else -1.0
        # Where the speed touches zero, Newton may leave the bracket; bisection does not.
        if not low <= following <= high:
            following = 0.5 * (low + high)
        change = abs(following - u)
        u = following
        if change < 1e-8 or high - low < 1e-15:
            break
    return u


def times_of_revolutions(angle: ShaftAngle, first: float, step: float, n: int) -> FloatArray:
    """Return the times in s, (n,), at which the shaft passes `first`, `first` + `step`, …, all within the angle."""
    knots, revolutions, speeds = _knots(angle)
    out = np.empty(n)
    interval = int(np.searchsorted(revolutions, first, side="right")) - 1
    times_at(knots, revolutions, speeds, min(max(interval, 0), len(knots) - 2), float(first), float(step), out)
    return out


def _knots(angle: ShaftAngle) -> tuple[FloatArray, ...]:
    """Return times, revolutions and speeds of an angle as arrays of the type that the kernels are compiled for."""
    arrays = angle.time_s, angle.revolutions, angle.speed_rev_per_s
    return tuple(read_only(np.ascontiguousarray(a, np.float64)) for a in arrays)


_CHUNK = 1 << 15  # angles at a time: positions and a segment of the signal stay in the cache
_MAX_VALUES = 1 << 28  # 2 GB of results; more is more likely a mistyped parameter than intended
CHUNKS_FOR_THREADS = 8  # fewer take less time than starting threads
_SLOW_SHARE = 0.05  # share of revolutions that may lose bandwidth with the default samples per revolution


def resample_to_angle(
    recording: Recording,
    shaft_angle: ShaftAngle,
    *,
    channels: Sequence[str] | None = None,
    samples_per_revolution: int | None = None,
    highest_order: float | None = None,
) -> AngleSignal:
    """Resample channels to equal steps of a shaft's angle.

    The times of equal angles are found by exact inversion of the angle's cubic; values between samples come from two
    filters, which double the rate and then delay by a fraction, y(t) = Σ x[k] h(t·fs - k). Where the angle grid is
    coarser than the time grid, the sinc is stretched to cut off at half the angle grid's instantaneous sampling rate.

    Parameters
    ----------
    recording : Recording
    shaft_angle : ShaftAngle
        On the recording's time axis; samples outside it are left out.
    channels : sequence of str, optional
        Default: the vibration channels.
    samples_per_revolution : int, optional
        Default: enough for `highest_order` or, without one, to keep the whole bandwidth on 95 % of the revolutions
        (sampling rate over the speed that 5 % of them fall below, with at most four times the original number of
        samples); rounded up to a good FFT length.
    highest_order : float, optional
        Highest order needed.

    Returns
    -------
    AngleSignal
        In the units of the channels and the precision of the samples. Sample i lies at start_revolution
        + i / samples_per_revolution; the start is a whole step, so that revolution 0 of the shaft angle falls on the
        grid. The first and last 24 samples of the recording (more if the grid is coarse) have no complete kernel and
        are left out. The error is below 5e-6 of full scale up to 0.4 of the lower of both sampling rates.

    Raises
    ------
    InputError
        On an unknown channel, or a grid that is too coarse for `highest_order` or too large.
    RefusalError
        If the angle covers no part of the recording, or less than one revolution of it.

    Notes
    -----
    Not for amplitude statistics at standstill: a shaft at rest yields no samples.
    """
    check_recording(recording)
    check_shaft_angle(shaft_angle)
    names = listed(channels, "channels", str) if channels is not None else recording.vibration_names()
    rows = [recording.index(name) for name in names]
    if not rows:
        raise InputError("there is no vibration channel to resample", allowed=", ".join(recording.channel_names))
    covered = _covered_speeds(recording, shaft_angle)
    n_per_rev = _grid(recording, covered, samples_per_revolution, highest_order)
    begin, end = _covered_revolutions(recording, shaft_angle, n_per_rev)
    first = math.ceil(begin * n_per_rev - 1e-9)
    n = math.floor(end * n_per_rev + 1e-9) - first + 1
    if n * len(rows) > _MAX_VALUES:
        raise InputError(
            f"{n_per_rev} samples per revolution make {n * len(rows):.3g} values",
            where="samples_per_revolution",
            allowed=f"at most {_MAX_VALUES:.3g} values in all",
            remedy="lower it or cut the recording",
        )
    samples = np.empty((len(rows), n), np.result_type(recording.samples, np.float32))
    _fill(recording, rows, shaft_angle, first, n_per_rev, samples)
    return AngleSignal(
        samples,
        n_per_rev,
        _with_notes(shaft_angle, recording, covered, n_per_rev),
        first / n_per_rev,
        names,
        tuple(recording.channels[i].unit for i in rows),
        PASSBAND * min(n_per_rev, recording.sampling_rate_hz / float(covered.max())),
    )


def _covered_times(recording: Recording, angle: ShaftAngle, n_per_rev: int | None = None) -> tuple[float, float]:
    """Return the times between which angle and complete kernels exist; a coarse angle grid needs longer kernels."""
    rate, last_s = recording.sampling_rate_hz, (recording.n_samples - 1) / recording.sampling_rate_hz
    begin, end = max(angle.start_s, REACH / rate), min(angle.end_s, last_s - REACH / rate)
    if n_per_rev is not None and end > begin:
        t = np.linspace(begin, end, 4096)
        scale = np.maximum(n_per_rev * angle.speed_rpm_at(t) / 60.0 / rate, LOWEST_SCALE)
        margin = np.where(scale < 1.0, 1.02 * (REACH + HALF_BAND) / scale, REACH) / rate
        complete = t[(t >= margin) & (t <= last_s - margin)]
        begin, end = (complete[0], complete[-1]) if len(complete) else (begin, begin)
    if end <= begin and min(angle.end_s, last_s) > max(angle.start_s, 0.0):
        raise RefusalError(
            f"the signal is too short: {counted(recording.n_samples, 'sample')}, {recording.duration_s:.4g} s, and a "
            f"value between samples needs {REACH} of them on either side, more where the shaft turns slowly",
            remedy="record longer",
        )
    if end <= begin:
        raise RefusalError(
            f"the shaft angle is known from {angle.start_s:.4g} to {angle.end_s:.4g} s, but the recording lasts from 0 "
            f"to {recording.duration_s:.4g} s: there is nothing to resample",
            remedy="check that both use the same time axis",
        )
    return float(begin), float(end)


def _covered_revolutions(recording: Recording, angle: ShaftAngle, n_per_rev: int) -> tuple[float, float]:
    begin, end = angle.revolutions_at(np.array(_covered_times(recording, angle, n_per_rev)))
    if end - begin < 1.0:
        raise RefusalError(
            f"the shaft makes {end - begin:.3g} revolutions within the recording",
            remedy="record at least one revolution, better a hundred",
        )
    return float(begin), float(end)


def _covered_speeds(recording: Recording, angle: ShaftAngle) -> FloatArray:
    """Return the speeds in rev/s at 1024 equal steps of angle over the covered part, sorted ascending."""
    begin, end = _covered_times(recording, angle)
    t = np.linspace(begin, end, 4096)
    revolutions = angle.revolutions_at(t)
    speeds = angle.speed_rpm_at(t) / 60.0
    steps = np.linspace(revolutions[0], revolutions[-1], 1024)
    return np.sort(np.interp(steps, revolutions, speeds))


def _grid(recording: Recording, covered: FloatArray, requested: int | None, highest_order: float | None) -> int:
    """Return the samples per revolution: as requested, as `highest_order` requires, or for most of the bandwidth."""
    from scipy.fft import next_fast_len

    if highest_order is not None:
        positive(highest_order, "highest_order")
    if requested is not None:
        count(requested, "samples_per_revolution", minimum=2)
        if highest_order is not None and highest_order > PASSBAND * requested:
            raise InputError(
                f"samples_per_revolution is {requested}, too few for order {highest_order:g}",
                allowed=f"at least {math.ceil(highest_order / PASSBAND)}",
                remedy="leave samples_per_revolution out",
            )
        return requested
    if highest_order is not None:
        return int(next_fast_len(math.ceil(highest_order / PASSBAND), real=True))
    # At most four times the original samples at the mean speed: a shaft nearly at rest would need infinitely many.
    typical = max(float(covered[int(_SLOW_SHARE * len(covered))]), float(covered.mean()) / 4.0)
    return max(2, int(next_fast_len(math.ceil(recording.sampling_rate_hz / typical - 1e-9), real=True)))


def _fill(
    recording: Recording, rows: list[int], angle: ShaftAngle, first: int, n_per_rev: int, samples: FloatArray
) -> None:
    """Fill `samples` chunk by chunk; the kernels release the interpreter, so plain threads share the work."""
    knots, revolutions, speeds = _knots(angle)
    rate, n = recording.sampling_rate_hz, samples.shape[1]
    half_band, table, side = doubling_filter(), delay_table(), kernel_side()
    signals = [read_only(np.ascontiguousarray(recording.samples[i])) for i in rows]

    def fill_chunk(start: int) -> None:
        stop = min(n, start + _CHUNK)
        begin = (first + start) / n_per_rev
        times = np.empty(stop - start)
        knot = min(max(0, int(np.searchsorted(revolutions, begin)) - 1), len(knots) - 2)
        times_at(knots, revolutions, speeds, knot, begin, 1.0 / n_per_rev, times)
        around = slice(knot, min(len(knots), int(np.searchsorted(knots, times[-1])) + 1))
        # The speed is interpolated linearly between knots: if no knot is slow, no time between them is.
        slowest, fastest = (n_per_rev / rate * float(speed) for speed in (speeds[around].min(), speeds[around].max()))
        coarse = slowest < 1.0 - 1e-6
        if coarse and fastest <= _STEP * slowest:  # one cut-off serves all
            scale = np.full(len(times), max(0.5 * (slowest + fastest), LOWEST_SCALE))
        elif coarse:
            scale = np.clip(n_per_rev / rate * np.interp(times, knots[around], speeds[around]), LOWEST_SCALE, 1.0)
            coarse = float(scale.min()) < 1.0 - 1e-6
        times *= rate
        positions = np.clip(times, REACH, recording.n_samples - 1 - REACH, out=times)
        for signal, out in zip(signals, samples, strict=True):
            if coarse:
                interpolate_coarse(signal, positions, scale, side, table, out[start:stop])
            else:
                interpolate(signal, positions, half_band, table, out[start:stop])

    starts, n_threads = range(0, n, _CHUNK), min(4, config.NUMBA_NUM_THREADS)
    if len(starts) * len(rows) < CHUNKS_FOR_THREADS or n_threads == 1:
        for start in starts:
            fill_chunk(start)
        return
    with ThreadPoolExecutor(n_threads) as pool:
        list(pool.map(fill_chunk, starts))


def _with_notes(angle: ShaftAngle, recording: Recording, covered: FloatArray, n_per_rev: int) -> ShaftAngle:
    """Add notes to the angle if the grid is coarser than the samples or the shaft is nearly at rest."""
    scale = covered * n_per_rev / recording.sampling_rate_hz
    notes = list(angle.notes)
    if scale[0] < 0.99:
        share = 100.0 * float(np.mean(scale < 0.99))
        notes.append(
            f"on {share:.0f} % of the revolutions the angle grid is coarser than the samples; there, frequencies above "
            f"{PASSBAND * n_per_rev:.4g} times the speed are filtered out"
        )
    if scale[0] < LOWEST_SCALE:
        notes.append("while the shaft is nearly at rest, the anti-aliasing filter does not follow its speed that low")
    return replace(angle, notes=tuple(notes))
