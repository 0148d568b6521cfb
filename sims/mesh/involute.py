"""The involute function and its inverse."""

from __future__ import annotations

from math import acos, pi, tan

import numpy as np

from gearsig.checks import FloatArray, within


def involute(pressure_angle_rad: FloatArray | float) -> FloatArray:
    """Involute function inv α = tan α − α.

    Parameters
    ----------
    pressure_angle_rad : float or array
        α, −π/2 to π/2.

    Returns
    -------
    array
        The polar angle of the involute's point whose pressure angle is α, in rad, from the involute's start.

    Source: ISO 21771, *Gears – Cylindrical involute gears and gear pairs* (2007).
    """
    angle: FloatArray = np.asarray(pressure_angle_rad, dtype=np.float64)
    result: FloatArray = np.tan(angle) - angle
    return result


def inverse_involute(value_rad: float) -> float:
    """Pressure angle α ≥ 0 with tan α − α = `value_rad`, by Newton's method.

    Parameters
    ----------
    value_rad : float
        0 to 10 rad; angles of gears stay below 1.

    Examples
    --------
    >>> from math import radians, degrees, tan
    >>> round(degrees(inverse_involute(tan(radians(20)) - radians(20))), 9)
    20.0
    """
    value = within(value_rad, "value_rad", 0.0, 10.0, "rad")
    if value == 0.0:
        return 0.0
    # inv α is about α³/3 for small α and convex: starting beyond the root, Newton's method only comes down.
    angle = min((3.0 * value) ** (1.0 / 3.0), acos(1.0 / (1.0 + (value + pi / 2) ** 2) ** 0.5))
    for _ in range(60):
        step = (tan(angle) - angle - value) / tan(angle) ** 2
        angle -= step
        if abs(step) < 1e-15 * angle:
            break
    return float(angle)
