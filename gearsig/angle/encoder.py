"""From an encoder's angle channel to shaft angle."""

from __future__ import annotations

import numpy as np

from gearsig.angle.smooth_samples import local_parabolas, noise_of
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, frozen_array, positive
from gearsig.errors import InputError, RefusalError

# Knots carry a speed error of a thousandth at most where the noise allows, ...
_WANTED_SPEED_ERROR = 1e-3
# ... but average over no more than this part of a revolution, so that torsional vibration of low order is kept.
_LONGEST_AVERAGE_REV = 1.0 / 16.0
# More than this backwards is a machine that reverses, not noise.
_MOST_BACKWARDS_REV = 0.05


def encoder_angle(
    values: FloatArray,
    sampling_rate_hz: float,
    units_per_revolution: float = 360.0,
    *,
    wraps: bool = True,
    shaft: str = "",
) -> ShaftAngle:
    """Turn an angle channel, wrapping or running on, into shaft angle.

    Jumps of a whole revolution are undone; parabolas over a few samples, longer where the angle is noisy or coarse,
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
    shaft : str

    Returns
    -------
    ShaftAngle
        Counting up, also for a shaft that turns backwards.

    Raises
    ------
    RefusalError
        If the shaft stands still, or turns one way and then the other.
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
    duration = (len(x) - 1) / sampling_rate_hz
    return ShaftAngle(
        shaft,
        positions / sampling_rate_hz,
        angle,
        np.maximum(slopes, 0.0) * sampling_rate_hz,
        "encoder",
        relative_speed_uncertainty=float(
            np.sqrt(2.0 / half_width) * noise / (duration * abs(angle[-1] - angle[0]) / duration)
        ),
        notes=notes + note,
    )


def _check_motion(revolutions: FloatArray, noise: float) -> None:
    turned = float(revolutions[-1] - revolutions[0])
    if turned < max(0.01, 10 * noise):
        raise RefusalError(
            f"the encoder turns by {turned:.3g} revolutions in the whole recording: the machine is at rest",
            remedy="check the channel and units_per_revolution",
        )
    backwards = float(np.max(np.maximum.accumulate(revolutions) - revolutions))
    if backwards > _MOST_BACKWARDS_REV + 6 * noise:
        raise RefusalError(
            f"the shaft turns back by {backwards:.3g} revolutions",
            remedy="cut the recording where the direction changes; check units_per_revolution and wraps",
        )


def _half_width(revolutions: FloatArray, noise: float) -> tuple[int, tuple[str, ...]]:
    """Samples on each side of a knot, and a note where the noise asks for more than the shortest parabola."""
    n = len(revolutions)
    per_sample = float(revolutions[-1] - revolutions[0]) / (n - 1)
    # The slope of a line over 2m + 1 samples has the standard deviation noise·√(3/(2m³)), nearly.
    m = (1.5 * (noise / (_WANTED_SPEED_ERROR * per_sample)) ** 2) ** (1 / 3)
    longest = max(2, int(0.5 * _LONGEST_AVERAGE_REV / per_sample))
    half_width = int(np.clip(np.ceil(m), 2, min(longest, (n - 1) // 2)))
    if half_width <= 2:
        return half_width, ()
    return half_width, (
        f"the angle scatters by {360 * noise:.2g}° and is smoothed over {360 * per_sample * 2 * half_width:.2g}°",
    )
