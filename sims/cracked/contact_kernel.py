"""Compiled contact of the gear pair: forces of all tooth pairs that touch, on either flank.

Each pair k with progress ζ = c − k, c = z1 θ1/2π, has the energy U = w(ζ) u(d; C(ζ)), d = δ − E(ζ) − Δb(t), and the
normal force N = w n(d; C) from d = C n + B(n). Its forces on the coordinates are −∂U/∂q; besides N along the line of
action that gives the driver a torque −∂U/∂c · ∂c/∂θ1, as stiffness and flank shape move past under load. Without it a
pair would take energy from the drive that appears nowhere (Oh, Grosh, Barber 2005). ∂u/∂C at constant d is −n²/2
whatever the contact's law is.

Gears that move apart by Δa stretch the line between their base circles by Δa/sin α_w: a pair enters late by that, as
the path of contact begins at the driven gear's tip. The line also turns, by Δx/(a sin α_w) where Δx is how far the
driven gear has moved off the line of action, and with it all contacts shift by r_b1 times that. So run-out changes
contact ratio and phase once per revolution. The forces −∂U/∂(Δx, Δy) are left out: they would follow from the width
that is assumed for the ramp, where the geometry of a corner contact gives a tenth of it, and they work over the run-out
alone.
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit

from sims.mesh.friction_kernel import contact_friction_n
from sims.mesh.load_sharing_kernel import cubic, engagement_and_slope, pair_force

MOST_CYCLES = 1e12
"""Mesh cycles beyond which a run has burst; until then, single cycles are resolved to 1e-4."""
MOST_LATE = 0.12
"""Base pitches by which an entry may be late or early; the places of gears that move further count as that far."""


@njit(cache=True, nogil=True, error_model="numpy")
def late_entry(k, dx, dy):
    """Base pitches by which pairs enter late, from the driver's centre less the driven gear's."""
    late = -(k.late_x * dx + k.late_y * dy)
    return min(max(late, -MOST_LATE), MOST_LATE)


@njit(cache=True, nogil=True, error_model="numpy")
def contact_forces(  # noqa: PLR0915  one pass over the pairs: no part of it stands alone
    k, curves, rows, pitch, delta, delta_rate, late, cycles, cycle_rate, omega_1, omega_2, slip_x, rough, rough_rate
):
    """(ΣN, torque −∂U/∂c, Σf, Σfρ1, Σfρ2) of the driving flanks.

    `k` … `pitch`: see `sims.cracked.constants`. `late`: base pitches by which a pair enters late.
    `slip_x`: ẋ1 − ẋ2. `rough`, `rough_rate`: Δb and its rate.
    """
    normal, along_cycles, friction, moment_1, moment_2 = 0.0, 0.0, 0.0, 0.0, 0.0
    if not abs(cycles) < MOST_CYCLES:  # a solution that bursts, or NaN, must not be taken for a tooth's number
        return np.nan, np.nan, np.nan, np.nan, np.nan
    newest = np.floor(cycles + 0.5 * k.ramp + MOST_LATE)
    z1, z2 = float(k.teeth[0]), float(k.teeth[1])
    columns = curves.shape[1]
    for slot in range(k.n_slots):
        pair = newest - slot
        progress = cycles - pair
        weight, weight_slope = engagement_and_slope(progress, late, k.contact_ratio, k.ramp)
        if weight <= 0.0:
            continue
        # By floats: the remainder of whole numbers takes several times as long.
        tooth_1, tooth_2 = int(pair - z1 * np.floor(pair / z1)), int(pair - z2 * np.floor(pair / z2))
        # An early entry lies ahead of the table: its first cubic ends there.
        place = max((progress - k.table_start) / k.table_step, 1.0)
        i = min(max(int(place), 1), columns - 3)
        t = place - i
        # Lagrange's cubic through four columns, and its slope.
        wa, wb = -t * (t - 1.0) * (t - 2.0) / 6.0, (t * t - 1.0) * (t - 2.0) / 2.0
        wc, wd = -t * (t + 1.0) * (t - 2.0) / 2.0, t * (t * t - 1.0) / 6.0
        step = 1.0 / k.table_step
        sa, sb = -(3.0 * t * t - 6.0 * t + 2.0) / 6.0 * step, (3.0 * t * t - 4.0 * t - 1.0) / 2.0 * step
        sc, sd = -(3.0 * t * t - 2.0 * t - 2.0) / 2.0 * step, (3.0 * t * t - 1.0) / 6.0 * step
        row_1, row_2 = rows[0, tooth_1], rows[1, tooth_2]
        a, b = curves[row_1, i - 1] + curves[row_2, i - 1], curves[row_1, i] + curves[row_2, i]
        c, d = (
            curves[row_1, i + 1] + curves[row_2, i + 1],
            curves[row_1, i + 2] + curves[row_2, i + 2],
        )
        compliance = wa * a + wb * b + wc * c + wd * d
        compliance_slope = sa * a + sb * b + sc * c + sd * d
        row_1, row_2 = rows[2, tooth_1], rows[3, tooth_2]
        a, b = curves[row_1, i - 1] + curves[row_2, i - 1], curves[row_1, i] + curves[row_2, i]
        c, d = (
            curves[row_1, i + 1] + curves[row_2, i + 1],
            curves[row_1, i + 2] + curves[row_2, i + 2],
        )
        depth = delta - rough - (wa * a + wb * b + wc * c + wd * d) - pitch[0, tooth_1] - pitch[1, tooth_2]
        if depth <= 0.0:
            continue
        shape_slope = sa * a + sb * b + sc * c + sd * d
        force, stiffness = pair_force(depth, compliance, k.contact_coefficient, k.load_dependent, 1.0)
        gate = 1.0
        if depth < k.damping_ramp:
            u = depth / k.damping_ramp
            gate = u * u * (3.0 - 2.0 * u)
        depth_rate = delta_rate - rough_rate - shape_slope * cycle_rate
        total = weight * (force + k.damping_time * gate * stiffness * depth_rate)
        total = max(total, 0.0)
        normal += total
        along_cycles += total * shape_slope + weight * 0.5 * force * force * compliance_slope
        if weight_slope != 0.0:
            along_cycles -= weight_slope * energy_of_pair(depth, compliance, force, k.load_dependent)
        if k.friction and total > 0.0:
            rho_1 = k.start_radius + progress * k.base_pitch
            rho_2 = k.action_length - rho_1
            rubbing = contact_friction_n(
                total,
                omega_1 * rho_1,
                omega_2 * rho_2,
                slip_x,
                rho_1 * rho_2 / k.action_length,
                k.width,
                k.reduced_modulus,
                k.log10_oil,
                k.oil_constant,
                k.sign_threshold,
                k.friction_factor,
                k.dry_friction,
            )
            friction += rubbing
            moment_1 += rubbing * rho_1
            moment_2 += rubbing * rho_2
    return normal, along_cycles, friction, moment_1, moment_2


@njit(cache=True, nogil=True, error_model="numpy")
def energy_of_pair(depth, compliance, force, load_dependent):
    """U = n d − C n²/2 − ∫B, without the engagement weight."""
    if load_dependent:
        return force * (0.5 * compliance * force + (depth - compliance * force) * 0.9 / 1.9)
    return 0.5 * force * depth


@njit(cache=True, nogil=True, error_model="numpy")
def stored_energy(k, curves, rows, pitch, delta, late, cycles, rough):
    """ΣU of the driving flanks, in J; for checks."""
    total = 0.0
    newest = int(np.floor(cycles + 0.5 * k.ramp + MOST_LATE))
    for slot in range(k.n_slots):
        pair = newest - slot
        progress = cycles - pair
        weight = engagement_and_slope(progress, late, k.contact_ratio, k.ramp)[0]
        one, two = pair % k.teeth[0], pair % k.teeth[1]
        compliance = cubic(curves[rows[0, one]], k.table_start, k.table_step, progress)
        compliance += cubic(curves[rows[1, two]], k.table_start, k.table_step, progress)
        shape = cubic(curves[rows[2, one]], k.table_start, k.table_step, progress) + pitch[0, one]
        shape += cubic(curves[rows[3, two]], k.table_start, k.table_step, progress) + pitch[1, two]
        depth = delta - rough - shape
        if weight > 0.0 and depth > 0.0:
            force, _ = pair_force(depth, compliance, k.contact_coefficient, k.load_dependent, 1.0)
            total += weight * energy_of_pair(depth, compliance, force, k.load_dependent)
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def back_flank_force(k, depth, rate):
    """(N', U') of the flanks behind, pressed by `depth`: one constant stiffness, its damping as on the driving side."""
    if depth <= 0.0:
        return 0.0, 0.0
    gate = 1.0
    if depth < k.damping_ramp:
        u = depth / k.damping_ramp
        gate = u * u * (3.0 - 2.0 * u)
    force = k.back_stiffness * (depth + k.damping_time * gate * rate)
    return max(force, 0.0), 0.5 * k.back_stiffness * depth * depth
