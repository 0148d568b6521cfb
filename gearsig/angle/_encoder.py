"""Shaft angle from an encoder or a speed channel: local parabolas through noisy, dense samples."""

from __future__ import annotations

import numpy as np

from gearsig.angle._types import ShaftAngle, limited_slopes
from gearsig.checks import FloatArray, frozen_array, positive
from gearsig.errors import InputError, RefusalError


def noise_of(x: FloatArray) -> float:
    """Return the standard deviation of the noise in a smooth quantity, from its third differences.

    A third difference of independent errors has 1 + 9 + 9 + 1 = 20 times their variance; a smooth profile has almost
    none.
    """
    if len(x) < 8:
        return 0.0
    third = np.diff(x, 3)
    # The root mean square as well: in a staircase most differences are zero, so the median is not informative.
    spread = max(float(np.median(np.abs(third))) / 0.6745, float(np.sqrt(np.mean(np.square(third)))))
    return float(spread / np.sqrt(20.0))


def local_parabolas(x: FloatArray, half_width: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit parabolas over 2·half_width + 1 samples around knots every half_width samples.

    Returns
    -------
    positions, values, slopes : arrays, (n_knots,)
        In samples, in the unit of x, and in the unit of x per sample. The first and last knot are the first and last
        sample, evaluated from the nearest parabola.

    Notes
    -----
    Source: A. Savitzky, M. J. E. Golay, *Smoothing and differentiation of data by simplified least squares
    procedures*, Anal. Chem. 36 (1964).
    """
    n, m = len(x), min(half_width, (len(x) - 1) // 2)
    j = np.arange(-m, m + 1, dtype=np.float64)
    basis = np.linalg.pinv(np.stack([np.ones_like(j), j, j * j], axis=1))
    centres = np.append(np.arange(m, n - m - 1, m), n - m - 1)
    # Values relative to the centre: an angle of thousands of revolutions would lose digits otherwise.
    windows = np.lib.stride_tricks.sliding_window_view(x, 2 * m + 1)[centres - m] - x[centres][:, None]
    a, b, c = basis @ windows.T
    # Parabolas are evaluated at their middles, the outermost ones also at the ends.
    at = np.concatenate([[0], np.arange(len(centres)), [len(centres) - 1]])
    off = np.concatenate([[-m], np.zeros(len(centres)), [m]])
    a, b, c, middles = a[at], b[at], c[at], x[centres][at]
    return centres[at] + off, middles + a + b * off + c * off**2, b + 2 * c * off


# From an encoder's angle channel to shaft angle.


def encoder_angle(
    values: FloatArray, sampling_rate_hz: float, units_per_revolution: float = 360.0, *, wraps: bool = True
) -> ShaftAngle:
    """Convert an angle channel, wrapped or continuous, to shaft angle.

    Jumps of a whole revolution are unwrapped; parabolas over a few samples, or more if the angle is noisy or coarse,
    give angle and speed at knots.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
        More than two samples per revolution.
    units_per_revolution : float
        360 for degrees, 2π for radians, the line count for counts.
    wraps : bool
        Whether the angle starts again after each revolution.

    Returns
    -------
    ShaftAngle
        Counts up, even if the shaft turns backwards.

    Raises
    ------
    InputError
        On fewer than 8 samples, or non-finite values.
    RefusalError
        If the shaft is at rest or reverses.
    """
    x = frozen_array(values, "encoder channel", ndim=1)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    positive(units_per_revolution, "units_per_revolution")
    if len(x) < 8:
        raise InputError(f"the encoder channel has {len(x)} samples", allowed="at least 8")
    revolutions = np.asarray(x, dtype=np.float64) / units_per_revolution
    if wraps:
        revolutions = np.unwrap(revolutions, period=1.0)
    notes: tuple[str, ...] = ()
    if revolutions[-1] < revolutions[0]:
        revolutions = -revolutions
        notes = ("the encoder counts down; the angle is counted up",)
    noise = noise_of(revolutions)
    _check_motion(revolutions, noise)
    half_width, note = _half_width(revolutions, noise)
    positions, angle, slopes = local_parabolas(revolutions, half_width)
    angle = np.maximum.accumulate(angle)
    return ShaftAngle(
        "",
        positions / sampling_rate_hz,
        angle,
        np.maximum(slopes, 0.0) * sampling_rate_hz,
        "encoder",
        relative_speed_uncertainty=float(np.sqrt(2.0 / half_width) * noise / abs(angle[-1] - angle[0])),
        notes=notes + note,
    )


def _check_motion(revolutions: FloatArray, noise: float) -> None:
    turned = float(revolutions[-1] - revolutions[0])
    if turned < max(0.01, 10 * noise):
        raise RefusalError(
            f"the encoder turns by only {turned:.3g} revolutions in the whole recording: the machine is at rest",
            remedy="check the channel and units_per_revolution",
        )
    backwards = float(np.max(np.maximum.accumulate(revolutions) - revolutions))
    if backwards > 0.05 + 6 * noise:  # a machine that reverses, not noise
        raise RefusalError(
            f"the shaft turns back by {backwards:.3g} revolutions",
            remedy="cut the recording where the direction changes; check units_per_revolution and wraps",
        )


def _half_width(revolutions: FloatArray, noise: float) -> tuple[int, tuple[str, ...]]:
    """Return the samples on each side of a knot, and a note if noise requires more than the shortest parabola."""
    n = len(revolutions)
    per_sample = float(revolutions[-1] - revolutions[0]) / (n - 1)
    # The slope of a line over 2m + 1 samples has a standard deviation of nearly noise·√(3/(2m³)). Knots have a speed
    # error of at most a thousandth if the noise allows, but average over at most a sixteenth of a revolution, so that
    # torsional vibration of low order is kept.
    m = (1.5 * (noise / (1e-3 * per_sample)) ** 2) ** (1 / 3)
    longest = max(2, int(0.5 / 16.0 / per_sample))
    half_width = int(np.clip(np.ceil(m), 2, min(longest, (n - 1) // 2)))
    if half_width <= 2:
        return half_width, ()
    return half_width, (
        f"the angle scatters by {360 * noise:.2g}° and is smoothed over {360 * per_sample * 2 * half_width:.2g}°",
    )


# From a speed channel to shaft angle.


def speed_channel_angle(values: FloatArray, sampling_rate_hz: float, rpm_per_unit: float = 1.0) -> ShaftAngle:
    """Integrate a speed channel to shaft angle, zero at the first sample.

    revolutions(t) = ∫ rpm/60 dt, by trapezoids over all samples, with knots every 0.05 s; the speed at a knot comes
    from a parabola over ±0.05 s (±2 samples for a slowly sampled channel).

    Parameters
    ----------
    values : array, (n_samples,)
        rpm after multiplying by `rpm_per_unit`; negative throughout for a shaft that turns backwards.
    sampling_rate_hz : float
    rpm_per_unit : float

    Returns
    -------
    ShaftAngle
        Any error of the scale makes the phase drift, so synchronous averages over many revolutions may smear.

    Raises
    ------
    InputError
        On fewer than 8 samples, or non-finite values.
    RefusalError
        If the channel shows that the machine is at rest or reverses.
    """
    from scipy.integrate import cumulative_trapezoid

    x = frozen_array(values, "speed channel", ndim=1)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    positive(rpm_per_unit, "rpm_per_unit")
    if len(x) < 8:
        raise InputError(f"the speed channel has {len(x)} samples", allowed="at least 8")
    speed, notes = _forwards(np.asarray(x, dtype=np.float64) * (rpm_per_unit / 60.0))
    # Noisy or stepped speeds are averaged over ±0.05 s: speed channels seldom respond faster.
    half_width = max(2, round(0.05 * sampling_rate_hz))
    positions, smooth, _ = local_parabolas(speed, half_width)
    cumulative = cumulative_trapezoid(speed, dx=1.0 / sampling_rate_hz, initial=0)
    angle = np.maximum.accumulate(cumulative[np.round(positions).astype(int)])
    noise = noise_of(speed)
    if noise > 0:
        notes += (
            f"the speed scatters by {60 * noise:.2g} rpm and is smoothed over ±{half_width / sampling_rate_hz:.2g} s",
        )
    return ShaftAngle(
        "",
        positions / sampling_rate_hz,
        angle,
        limited_slopes(positions / sampling_rate_hz, angle, smooth),
        "speed channel",
        notes=(*notes, "the angle is integrated from a speed: its phase is relative"),
    )


def _forwards(speed: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the speed made positive, with noise below zero removed, and notes."""
    top = float(np.max(np.abs(speed)))
    if top * 60.0 < 1.0:
        raise RefusalError(
            f"the speed channel stays within ±{60 * top:.3g} rpm: the machine is at rest",
            remedy="check the channel and rpm_per_unit",
        )
    notes: tuple[str, ...] = ()
    if speed.mean() < 0:
        speed, notes = -speed, ("the speed is negative; the angle is counted up",)
    if speed.min() < -0.05 * top:
        raise RefusalError(
            f"the speed channel runs from {60 * speed.min():.4g} to {60 * speed.max():.4g} rpm: the shaft reverses",
            remedy="cut the recording where the direction changes",
        )
    if speed.min() < 0:
        notes += ("speeds slightly below zero are taken as zero",)
    return np.maximum(speed, 0.0), notes
