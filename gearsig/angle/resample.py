"""From equal steps of time to equal steps of shaft angle, with anti-aliasing that follows the speed."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from gearsig.angle.antialias import LOWEST_SCALE, interpolate_coarse, kernel_side
from gearsig.angle.interpolation import HALF_BAND, PASSBAND, REACH, delay_table, doubling_filter, interpolate
from gearsig.angle.inversion import scales_at, times_at
from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording

_CHUNK = 1 << 15  # angles at a time: positions and a stretch of the signal stay in the cache
_MOST_VALUES = 1 << 28  # 2 GB of results; beyond it a typing error is likelier than a wish
_SLOW_SHARE = 0.05  # revolutions that may lose bandwidth to the default number of samples per revolution


def resample_to_angle(
    recording: Recording,
    shaft_angle: ShaftAngle,
    *,
    channels: Sequence[str] | None = None,
    samples_per_revolution: int | None = None,
    highest_order: float | None = None,
) -> AngleSignal:
    """Sample channels at equal steps of a shaft's angle.

    The times of the equal angles come from the angle's cubic, inverted exactly; values between samples from a
    pair of filters that doubles the rate and then delays by a fraction, y(t) = Σ x[k] h(t·fs - k). Where the angle
    grid is coarser than the time grid, the sinc is stretched
    to cut off at half the angle grid's momentary sampling rate.

    Parameters
    ----------
    recording : Recording
    shaft_angle : ShaftAngle
        On the recording's time axis; what lies outside of it is left out.
    channels : sequence of str, optional
        Default: the vibration channels.
    samples_per_revolution : int, optional
        Default: enough to keep the whole bandwidth on 95 % of the revolutions (sampling rate over the speed that 5 % of
        them fall below, at most four times as many samples as before), or enough for `highest_order`; rounded up to
        a good FFT length.
    highest_order : float, optional
        Highest order wanted.

    Returns
    -------
    AngleSignal
        Same unit as the channels. Sample i lies at start_revolution + i / samples_per_revolution; the start is a
        whole step,
        so that revolution 0 of the shaft angle falls on the grid. The first and last 24 samples of the recording
        (more where
        the grid is coarse) have no complete kernel and are left out. Error below 5e-6 of full scale up to 0.4 of the
        lower of both sampling rates.

    Raises
    ------
    InputError
        On a channel that is not there, or a grid that is too coarse for `highest_order` or too large.
    RefusalError
        If the angle covers no part of the recording, or less than one revolution of it.

    Notes
    -----
    Not for statistics of amplitudes at a standstill: a standing shaft has no samples here.
    """
    names = tuple(channels) if channels is not None else recording.vibration_names()
    rows = [recording.index(name) for name in names]
    if not rows:
        raise InputError("there is no vibration channel to resample", allowed=", ".join(recording.channel_names))
    covered = _covered_speeds(recording, shaft_angle)
    n_per_rev = _grid(recording, covered, samples_per_revolution, highest_order)
    begin, end = _covered_revolutions(recording, shaft_angle, n_per_rev)
    first = math.ceil(begin * n_per_rev - 1e-9)
    n = math.floor(end * n_per_rev + 1e-9) - first + 1
    if n * len(rows) > _MOST_VALUES:
        raise InputError(
            f"{n_per_rev} samples per revolution make {n * len(rows):.3g} values",
            where="samples_per_revolution",
            allowed=f"at most {_MOST_VALUES:.3g} values in all",
            remedy="lower it or cut the recording",
        )
    samples = np.empty((len(rows), n))
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
    """Times between which angle and complete kernels exist; kernels are longer where the grid of angles is coarse."""
    rate, last_s = recording.sampling_rate_hz, (recording.n_samples - 1) / recording.sampling_rate_hz
    begin, end = max(angle.start_s, REACH / rate), min(angle.end_s, last_s - REACH / rate)
    if n_per_rev is not None and end > begin:
        t = np.linspace(begin, end, 4096)
        scale = np.maximum(n_per_rev * angle.speed_rpm_at(t) / 60.0 / rate, LOWEST_SCALE)
        margin = np.where(scale < 1.0, 1.02 * (REACH + HALF_BAND) / scale, REACH) / rate
        complete = t[(t >= margin) & (t <= last_s - margin)]
        begin, end = (complete[0], complete[-1]) if len(complete) else (begin, begin)
    if end <= begin:
        raise RefusalError(
            f"the shaft angle is known from {angle.start_s:.4g} to {angle.end_s:.4g} s, the recording lasts from 0 to "
            f"{recording.duration_s:.4g} s: there is nothing to resample",
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
    """Speeds in rev/s at 1024 equal steps of angle through the covered part, lowest first."""
    begin, end = _covered_times(recording, angle)
    t = np.linspace(begin, end, 4096)
    revolutions = angle.revolutions_at(t)
    speeds = angle.speed_rpm_at(t) / 60.0
    steps = np.linspace(revolutions[0], revolutions[-1], 1024)
    return np.sort(np.interp(steps, revolutions, speeds))


def _grid(recording: Recording, covered: FloatArray, wanted: int | None, highest_order: float | None) -> int:
    """Samples per revolution, as wanted, as the highest order needs, or keeping the bandwidth on most revolutions."""
    from scipy.fft import next_fast_len

    if highest_order is not None:
        positive(highest_order, "highest_order")
    if wanted is not None:
        count(wanted, "samples_per_revolution", minimum=2)
        if highest_order is not None and highest_order > PASSBAND * wanted:
            raise InputError(
                f"samples_per_revolution is {wanted}, too few for order {highest_order:g}",
                allowed=f"at least {math.ceil(highest_order / PASSBAND)}",
                remedy="leave samples_per_revolution out",
            )
        return wanted
    if highest_order is not None:
        return int(next_fast_len(math.ceil(highest_order / PASSBAND), real=True))
    # No more than four times the samples there are at the mean speed: a nearly standing shaft asks for endless ones.
    typical = max(float(covered[int(_SLOW_SHARE * len(covered))]), float(covered.mean()) / 4.0)
    return max(2, int(next_fast_len(math.ceil(recording.sampling_rate_hz / typical - 1e-9), real=True)))


def _fill(
    recording: Recording, rows: list[int], angle: ShaftAngle, first: int, n_per_rev: int, samples: FloatArray
) -> None:
    """Fill `samples` chunk by chunk; the kernels release the interpreter, so plain threads share the work."""
    knots, revolutions, speeds = (
        np.ascontiguousarray(a, dtype=np.float64) for a in (angle.time_s, angle.revolutions, angle.speed_rev_per_s)
    )
    rate, n = recording.sampling_rate_hz, samples.shape[1]
    half_band, table, side = doubling_filter(), delay_table(), kernel_side()
    signals = [np.ascontiguousarray(recording.samples[i]) for i in rows]

    def fill_chunk(start: int) -> None:
        stop = min(n, start + _CHUNK)
        begin = (first + start) / n_per_rev
        times = np.empty(stop - start)
        knot = min(max(0, int(np.searchsorted(revolutions, begin)) - 1), len(knots) - 2)
        times_at(knots, revolutions, speeds, knot, begin, 1.0 / n_per_rev, times)
        around = slice(knot, min(len(knots), int(np.searchsorted(knots, times[-1])) + 1))
        # The speed is linear between knots here: if none of them is slow, no time between them is.
        coarse = float(speeds[around].min()) * n_per_rev / rate < 1.0 - 1e-6
        scale = np.empty(stop - start if coarse else 0)
        if coarse:
            coarse = scales_at(knots[around], speeds[around], times, n_per_rev / rate, LOWEST_SCALE, scale) < 1.0 - 1e-6
        times *= rate
        positions = np.clip(times, REACH, recording.n_samples - 1 - REACH, out=times)
        for signal, out in zip(signals, samples, strict=True):
            if coarse:
                interpolate_coarse(signal, positions, scale, side, table, out[start:stop])
            else:
                interpolate(signal, positions, half_band, table, out[start:stop])

    starts = range(0, n, _CHUNK)
    if len(starts) == 1:
        fill_chunk(0)
        return
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as pool:
        list(pool.map(fill_chunk, starts))


def _with_notes(angle: ShaftAngle, recording: Recording, covered: FloatArray, n_per_rev: int) -> ShaftAngle:
    """Add to the angle's notes where the grid is coarser than the samples, or the shaft nearly stands still."""
    scale = covered * n_per_rev / recording.sampling_rate_hz
    notes = list(angle.notes)
    if scale[0] < 0.99:
        share = 100.0 * float(np.mean(scale < 0.99))
        notes.append(
            f"on {share:.0f} % of the revolutions the angle grid is coarser than the samples; there, frequencies above "
            f"{PASSBAND * n_per_rev:.4g} times the speed are filtered out"
        )
    if scale[0] < LOWEST_SCALE:
        notes.append("while the shaft nearly stands still, the anti-aliasing filter stops short of its speed")
    return replace(angle, notes=tuple(notes))
