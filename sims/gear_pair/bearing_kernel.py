"""Compiled: where the foot of a bearing's spring stands, and the spring's force with clearance."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import cos, exp, floor, log1p, pi, sin, sqrt

from numba import njit

LEAST_LOAD = 1e-12
EDGE_M = 5e-5
"""Length over which an edge is rounded: a contact is some 0.2 mm wide."""
FAR = 12.0
"""Edge lengths outside a spall beyond which nothing is felt."""


@njit(cache=True, nogil=True, error_model="numpy")
def foot(k, row, theta, x, y):
    """(d_x, d_y) in m: sinking over a race defect, and the sway of a bearing with clearance.

    `theta`: shaft angle. `x`, `y`: place of the shaft in the bearing, whose direction is that of the load now.
    """
    dx, dy = 0.0, 0.0
    if k.race[row] > 0:
        # At angle 0 the defect lies half way between two elements: nothing starts with a blow.
        passed = k.race_order[row] * theta / (2.0 * pi) + 0.5
        element = floor(passed + 0.5)
        along = passed - element - k.places[row, int(element) % k.places.shape[1]]
        inside = (0.5 * k.race_length[row] - abs(along)) * k.race_spacing[row]
        if inside > -FAR * EDGE_M:
            # The rounded corner of the far edge is taken off: a gap of no length is none.
            across = k.race_length[row] * k.race_spacing[row]
            reach = EDGE_M * (_softplus(inside / EDGE_M) - _softplus((inside - across) / EDGE_M))
            depth = reach * reach / (2.0 * k.race_radius[row])
            direction = k.race_angle[row] + (k.load_angle[row] if k.race[row] == 1 else theta)
            # The driven shaft turns clockwise: its angle counts the other way in the frame.
            if k.race[row] == 2 and row >= 2:
                direction = -direction
            r = sqrt(x * x + y * y)
            carried = r - k.clearance[row]
            facing = (x * cos(direction) + y * sin(direction)) / r if carried > 0.0 else 0.0
            if facing > 0.0:
                share = k.race_share[row] * carried
                sink = share * (1.0 - exp(-depth / share)) * facing * sqrt(facing)
                dx += sink * cos(direction)
                dy += sink * sin(direction)
    if k.clearance[row] > 0.0:
        phase = k.pass_order[row] * theta
        for n in range(k.sway.shape[2]):
            c, s = cos((n + 1) * phase), sin((n + 1) * phase)
            dx += k.sway[row, 0, n, 0] * c + k.sway[row, 0, n, 1] * s
            dy += k.sway[row, 1, n, 0] * c + k.sway[row, 1, n, 1] * s
    return dx, dy


@njit(cache=True, nogil=True, error_model="numpy")
def carried_part(k, row, x, y):
    """(1 − c/r) beyond the clearance c, 0 within: the spring's force is that times k r. Smooth at the edge."""
    clearance = k.clearance[row]
    if clearance <= 0.0:
        return 1.0
    r = sqrt(x * x + y * y)
    if r <= LEAST_LOAD:
        return 0.0
    # A soft edge of a tenth of the clearance: roughness and oil carry a little before the metal does.
    width = 0.1 * clearance
    over = (r - clearance) / width
    if over < -20.0:
        return 0.0
    depth = r - clearance if over > 20.0 else width * _softplus(over)
    return depth / r


@njit(cache=True, nogil=True, error_model="numpy")
def _softplus(x):

    return x + log1p(exp(-x)) if x > 0.0 else log1p(exp(x))
