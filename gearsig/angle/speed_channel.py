"""From a speed channel to shaft angle."""

from __future__ import annotations

import numpy as np

from gearsig.angle.smooth_samples import local_parabolas, noise_of
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, frozen_array, positive
from gearsig.errors import InputError, RefusalError

# Half the length that a noisy or stepped speed is averaged over: speed channels seldom follow faster than 0.1 s.
_SMOOTHING_S = 0.05


def speed_channel_angle(
    values: FloatArray, sampling_rate_hz: float, rpm_per_unit: float = 1.0, *, shaft: str = ""
) -> ShaftAngle:
    """Integrate a speed channel to shaft angle, zero at the first sample.

    revolutions(t) = ∫ rpm/60 dt, by trapezoids over all samples, knots every 0.05 s; the speed at a knot is a
    parabola's over ±0.05 s (±2 samples for a slowly sampled channel).

    Parameters
    ----------
    values : array, (n_samples,)
        rpm after multiplying by `rpm_per_unit`; negative throughout for a shaft that turns backwards.
    sampling_rate_hz : float
    rpm_per_unit : float
    shaft : str

    Returns
    -------
    ShaftAngle
        Phase between revolutions drifts with any error of the scale, so synchronous averages over many revolutions
        may smear.

    Raises
    ------
    RefusalError
        If the channel says that the machine is at rest, or that it reverses.
    """
    x = frozen_array(values, "speed channel", ndim=1)
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    positive(rpm_per_unit, "rpm_per_unit")
    if len(x) < 8:
        raise InputError(f"the speed channel has {len(x)} samples", allowed="at least 8")
    speed, notes = _forwards(np.asarray(x, dtype=np.float64) * (rpm_per_unit / 60.0))
    half_width = max(2, round(_SMOOTHING_S * sampling_rate_hz))
    positions, smooth, _ = local_parabolas(speed, half_width)
    cumulative = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) / sampling_rate_hz
    angle = np.maximum.accumulate(cumulative[np.round(positions).astype(int)])
    noise = noise_of(speed)
    if noise > 0:
        notes += (
            f"the speed scatters by {60 * noise:.2g} rpm and is smoothed over ±{half_width / sampling_rate_hz:.2g} s",
        )
    return ShaftAngle(
        shaft,
        positions / sampling_rate_hz,
        angle,
        _monotone(positions / sampling_rate_hz, angle, np.maximum(smooth, 0.0)),
        "speed channel",
        notes=(*notes, "the angle is integrated from a speed: its phase is relative"),
    )


def _forwards(speed: FloatArray) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the speed counting up, without noise below zero."""
    top = float(np.max(np.abs(speed)))
    if top * 60.0 < 1.0 or float(np.mean(np.abs(speed))) * len(speed) == 0.0:
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


def _monotone(t: FloatArray, angle: FloatArray, slopes: FloatArray) -> FloatArray:
    """Limit slopes to three times the smaller adjacent secant, so that the cubic does not decrease."""
    secants = np.diff(angle) / np.diff(t)
    limit = 3.0 * np.minimum(np.append(secants, secants[-1]), np.insert(secants, 0, secants[0]))
    limited: FloatArray = np.minimum(slopes, limit)
    return limited
