"""Shaft angle at a stated, constant speed."""

from __future__ import annotations

import numpy as np

from gearsig.angle.types import ShaftAngle
from gearsig.checks import not_negative, positive
from gearsig.errors import RefusalError


def constant_speed_angle(speed_rpm: float, duration_s: float, *, shaft: str = "") -> ShaftAngle:
    """Return the angle of a shaft at constant speed, zero at time zero.

    revolutions = speed · time

    Parameters
    ----------
    speed_rpm : float
        Above zero.
    duration_s : float
        Above zero.

    Raises
    ------
    RefusalError
        If the speed is zero: nothing turns, there is no angle to resample over.
    """
    not_negative(speed_rpm, "speed_rpm", "rpm")
    positive(duration_s, "duration_s", "s")
    if speed_rpm == 0.0:
        raise RefusalError(
            "the machine is at rest: the stated speed is 0 rpm",
            remedy="look at spectra over frequency, or state the true speed",
        )
    speed = speed_rpm / 60.0
    return ShaftAngle(
        shaft,
        np.array([0.0, duration_s]),
        np.array([0.0, speed * duration_s]),
        np.array([speed, speed]),
        "constant",
        notes=("the speed is stated, not measured",),
    )
