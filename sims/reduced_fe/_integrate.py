"""Compiled: time integration of the modes of two sides with the moving contact between them.

In a step the modes move freely with the modal force extrapolated, the contact is solved at that position, and the modes
are corrected by the force found. The fast method does this once; the reference repeats it until the forces converge. A
change of force at the end of a step changes a position by h²/6 times the modal mobility, about 1e-4 of the contact
compliance, so that one pass leaves an error of third order.

The contact forces are −∂U/∂η with U(D(η, ζ), ζ); ζ follows the driver, which thus has the torque −∂U/∂ζ ∂ζ/∂θ1 as
stiffness and flank shape move past under load. Without it a pair would take energy from the drive that appears nowhere.

Damping: the elastic law is evaluated at D + τ ∂D/∂η·η̇, to first order a damper parallel to the contact with τ times
its stiffness, which acts on the vibration but not on the flank shape moving past. It never pulls and never adds energy;
teeth that close at 0.1 m/s feel it 1 µm early, as with an oil film. The torque of the moving contact has only the
elastic part.

Friction acts on the bodies as a whole, across the line of action and about their axes; teeth do not bend under it.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import cos, sin
from typing import Any, Literal

import numpy as np

from gearsig.checks import FloatArray, one_of, positive
from gearsig.compiled import UNCOUNTED, njit
from sims.gear_pair import foot, friction_of_pair
from sims.machine import profile_value, set_speed, torque_ripple
from sims.mesh import out_of_place
from sims.reduced_fe._contact import (
    FAST,
    back_substituted,
    compliance_slope_energy,
    fill_compliance,
    hertz_energy,
    near_pairs,
    place_of,
    solve_contacts,
)

# Compiled: modal coordinates seen from a tooth, and generalised forces on them.
#
# Inlined where used, as are the phases of a step: calls with many arrays took a fifth of the time.

# Arrays are passed whole, with indices into them: a slice is a new object, whose references are counted at every use.


@njit(inline="always", error_model="numpy", fastmath=FAST)
def to_tooth(w, side, turn, tooth, n_single, n_pairs, out):
    """Modal coordinates seen from the tooth in contact: pairs rotated by nψ."""
    for j in range(n_single):
        out[j] = w[side, j]
    for p in range(n_pairs):
        c, s = w[side, n_single + p], w[side, n_single + n_pairs + p]
        cosine, sine = turn[side, tooth, 0, p], turn[side, tooth, 1, p]
        out[n_single + p] = cosine * c + sine * s
        out[n_single + n_pairs + p] = cosine * s - sine * c


@njit(inline="always", error_model="numpy", fastmath=FAST)
def add_from_tooth(g, side, turn, tooth, n_single, n_pairs, out):
    """Add forces on a tooth's coordinates to those of the gear: the transpose of `to_tooth`."""
    for j in range(n_single):
        out[side, j] += g[j]
    for p in range(n_pairs):
        c, s = g[n_single + p], g[n_single + n_pairs + p]
        cosine, sine = turn[side, tooth, 0, p], turn[side, tooth, 1, p]
        out[side, n_single + p] += cosine * c - sine * s
        out[side, n_single + n_pairs + p] += sine * c + cosine * s


@njit(inline="always", error_model="numpy", fastmath=FAST)
def dots(rows, side, i, s, t, q, v):
    """∂D/∂η · q in columns i and i + 1, and ∂D/∂η · v at the fraction t between them."""
    a, b, c, d = 0.0, 0.0, 0.0, 0.0
    for j in range(rows.shape[3]):
        low, high = rows[side, i, s, j], rows[side, i + 1, s, j]
        a += low * q[j]
        b += high * q[j]
        c += low * v[j]
        d += high * v[j]
    return a, b, c + t * (d - c)


@njit(inline="always", error_model="numpy", fastmath=FAST)
def on_input(inputs, side, number, w):
    """Displacement at an input, from modal coordinates w."""
    total = 0.0
    for j in range(w.shape[1]):
        total += inputs[side, number, j] * w[side, j]
    return total


@njit(inline="always", error_model="numpy", fastmath=FAST)
def signal_of_modes(factors, line, w):
    """Signal `line` from modal coordinates w of both sides."""
    total = 0.0
    for side in range(2):
        for j in range(w.shape[1]):
            total += factors[line, side, j] * w[side, j]
    return total


@njit(inline="always", error_model="numpy", fastmath=FAST)
def product(a, b):
    """Scalar product over all modes of both sides."""
    total = 0.0
    for side in range(2):
        for j in range(a.shape[1]):
            total += a[side, j] * b[side, j]
    return total


@njit(inline="always", error_model="numpy", fastmath=FAST)
def spread(rows, side, i, s, t, force, g):
    """Subtract force · ∂D/∂η, interpolated between two columns, from g."""
    low, high = force * (1.0 - t), force * t
    for j in range(rows.shape[3]):
        g[j] -= low * rows[side, i, s, j] + high * rows[side, i + 1, s, j]


# Compiled: modal forces on the two sides other than those of the driving flanks.


@njit(inline="always", error_model="numpy")
def outer_forces(k, inputs, q, v, angle, omega, rate, load, out):
    """Fill `out` with the modal forces of drive, load, set speed, unbalance, weight and rolling elements."""
    for side in range(2):
        if side == 0:
            drive = load * torque_ripple(k, angle + on_input(inputs, 0, 0, q)) + k.total_inertia * rate
            drive -= k.governor * on_input(inputs, 0, 0, v) + k.governor_spring * on_input(inputs, 0, 0, q)
        else:
            drive = -load * k.ratio
        for j in range(out.shape[1]):
            out[side, j] = drive * inputs[side, 0, j] + rate * inputs[side, 8, j]
        if k.pushes:
            _push(k, side, inputs, angle, omega, drive, out)
        if k.rolls:
            _roll(k, side, inputs, angle, load, out)


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _push(k, side, inputs, angle, omega, drive, out):
    """Add unbalance, weight and an angled coupling, at the set speed."""
    theta = angle if side == 0 else angle / k.ratio
    rate = omega if side == 0 else omega / k.ratio
    up = 1.0 if side == 0 else -1.0
    phi = theta + k.mass_angle[side]
    fx = k.unbalance[side] * rate * rate * cos(phi) + k.mass[side] * k.gravity_x
    fy = up * k.unbalance[side] * rate * rate * sin(phi) + k.mass[side] * k.gravity_y
    c2, s2 = cos(2.0 * theta), sin(2.0 * theta)
    kink = (
        k.torsional_stiffness[side] * k.hooke[side] * s2 + 2.0 * k.torsional_damping[side] * k.hooke[side] * rate * c2
    )
    on_rotor = -kink - 2.0 * k.hooke[side] * c2 * drive
    bent = k.coupling_bending[side]
    couple_x = k.hooke_force[side] * (drive * (1.0 + c2) - bent * s2)
    couple_y = k.hooke_force[side] * up * (drive * s2 + bent * (1.0 + c2))
    for j in range(out.shape[1]):
        out[side, j] += fx * inputs[side, 2, j] + fy * inputs[side, 3, j]
        out[side, j] += on_rotor * inputs[side, 0, j] + kink * inputs[side, 1, j]
        out[side, j] += couple_x * (inputs[side, 4, j] - inputs[side, 6, j])
        out[side, j] += couple_y * (inputs[side, 5, j] - inputs[side, 7, j])


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _roll(k, side, inputs, angle, load, out):
    """Add the forces of bearing springs whose feet move as rolling elements pass, under the present load."""
    for bearing in range(2):
        row = 2 * side + bearing
        if k.special[row] > 0:
            dx, dy = _foot(k, row, angle, load)
            fx, fy = _sprung(k, row, dx, dy)
            for j in range(out.shape[1]):
                out[side, j] += fx * inputs[side, 4 + 2 * bearing, j] + fy * inputs[side, 5 + 2 * bearing, j]


@njit(inline="always", error_model="numpy")
def _foot(k, row, angle, load):
    """Position of a bearing spring's foot, under the present load."""
    part = load / k.nominal_torque
    x = part * k.bearing_yield[row, 0] + k.bearing_play[row, 0]
    y = part * k.bearing_yield[row, 1] + k.bearing_play[row, 1]
    return foot(k, row, angle if row < 2 else angle / k.ratio, x, y)


@njit(inline="always", error_model="numpy")
def _sprung(k, row, x, y):
    """Return the force of a bearing's spring deflected by x and y."""
    spring = k.bearing_spring
    return spring[row, 0, 0] * x + spring[row, 0, 1] * y, spring[row, 1, 0] * x + spring[row, 1, 1] * y


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def _yields(k, inputs, q, angle, load, extras):
    """Fill the deflections of the bearings, see `sims.gear_pair.DEFLECTIONS`."""
    for row in range(4):
        side, number = row // 2, 4 + 2 * (row % 2)
        x, y = on_input(inputs, side, number, q), on_input(inputs, side, number + 1, q)
        if k.special[row] > 0:
            dx, dy = _foot(k, row, angle, load)
            x, y = x - dx, y - dy
        fx, fy = _sprung(k, row, x, y)
        extras[6 + 2 * row], extras[7 + 2 * row] = fx / k.bearing_stiffness[row], fy / k.bearing_stiffness[row]


START_REACH = 1e-4
"""Initial depth up to which flanks count as near, m."""
REACH_MPS = 4.0
"""Maximum closing speed: flanks further apart than a step at this speed, beyond the present depth, are not near."""
FAST_PART = 0.05
"""Change of a contact force, over the nominal one, up to which the fast method takes no second iteration."""
PRECISE_PART = 1e-11
MAX_PASSES = 50
N_EXTRAS = 14


# Arrays are passed whole, with indices into them: a slice is a new object, whose references are counted at every use.


def room(shape: tuple[int, ...], n_modes: int, n_rows: int) -> tuple[Any, ...]:
    """Return scratch arrays for `march`; `shape` is (n_slots, n_slices)."""
    n_slots, n_max = shape[0], shape[0] * shape[1]
    places = np.empty(n_slots), np.empty(n_slots), np.empty(shape), np.empty(shape)
    integers = np.empty(n_slots, dtype=np.int64), np.empty(n_max, dtype=np.int64)
    squares = np.empty((n_max, n_max)), np.empty((n_max, n_max))
    points = tuple(np.zeros(n_max) for _ in range(8))  # start values for pairs that a later pass finds near
    seen = tuple(np.empty(n_rows) for _ in range(3))
    modes = tuple(np.empty((2, n_modes)) for _ in range(6))
    return places, integers, squares, points, seen, modes, np.zeros(N_EXTRAS + n_slots + n_max)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def march(  # noqa: PLR0912, PLR0915  the phases of a step in turn, with shared scratch
    k, arrays, rows, turn, coefficients, modal, inputs, rigid, back_row, state, speed, torque, time, step, n_steps,
    stride, precise, lines, output, energies, scratch,
):  # fmt: skip
    """Run `n_steps` steps; fill `output` with the requested signals at every `stride`-th step.

    k : record, see `sims.reduced_fe`.
    arrays : see `ContactTable.arrays`.
    rows : (2, n, n_slices, n_rows) ∂D/∂η of both sides.
    turn : (2, z, 2, n_pairs) cosine and sine of the rotation of a tooth's pairs.
    coefficients : (2, 8, n_modes), see `step_coefficients`.
    modal : (2, 2, n_modes) ω² and 2ζω.
    inputs : (2, 9, n_modes). rigid, back_row : (2, n_modes) ∂D/∂η of the rigid gears on each flank.
    state : (q, v, f, f_before: (2, n_modes); force, root: (n_slots, n_slices); pair: (n_slots,); rest: (3,)), left at
        the last step. rest: set angle, whether the flanks were in contact, whether the state already has forces.
    speed, torque : (2, n) profiles in rad/s and N m.
    time : of the first step.
    precise : repeat each step until it converges.
    lines : (kinds (n,), factors (n, 2, n_modes), set factors (n,)): requested signals; kind 0, 1, 2: displacement,
        velocity, acceleration; 3 + i: extra i, in the order of `sims.reduced_fe._respond.EXTRAS`, then the force of
        each slot, then of each of its slices.
    output : (n_out, n). energies : (n_out,) or (0,).
    scratch : see `room`.
    Returns the number of rows filled, fewer if the solution diverges.
    """
    q, v, f, f_before, held, held_root, held_pair, rest = state
    direct, cross, corner, extra, separation, table_rows, pitch, hertz = arrays
    kinds, factors, set_factors = lines
    n_slots, n_s = held.shape
    n_modes = q.shape[1]
    (pairs, parts, apart, slope), (columns, order), (r, a), points, (seen, moving, g), modes, extras = scratch
    approach, along, force, root, x, last_force, viscous, elastic = points
    q1, v1, f1, base, free_q, free_v = modes
    n_out, angle, margin, reach = 0, rest[0], REACH_MPS * step, START_REACH
    enough = (PRECISE_PART if precise else FAST_PART) * k.nominal_force
    passes = MAX_PASSES if precise else 1
    w1, rate1 = set_speed(k, speed, time)
    for number in range(n_steps + 1):
        t = time + number * step
        # The set angle by Simpson's rule over the step; torque and outer forces at its end.
        if number > 0:
            w0 = w1
            wh = set_speed(k, speed, t - 0.5 * step)[0]
            w1, rate1 = set_speed(k, speed, t)
            angle += step / 6.0 * (w0 + 4.0 * wh + w1)
        load = profile_value(torque, t)
        _predict(number, coefficients, q, v, f, f_before, free_q, free_v, f1)
        outer_forces(k, inputs, q, v, angle, w1, rate1, load, base)
        cycles, total, back, along_torque, rubbing, n = 0.0, 0.0, 0.0, 0.0, 0.0, 0
        for one_pass in range(passes):
            # Modes with the force assumed at the step's end, and the pairs near contact there.
            _moved(number, coefficients, free_q, free_v, f1, q, v, q1, v1)
            turned_1, turned_2 = on_input(inputs, 0, 1, q1), on_input(inputs, 1, 1, q1)
            cycles = k.cycles_per_rad * (angle + turned_1)
            phi_1 = angle + turned_1 + k.runout_angle[0]
            phi_2 = angle / k.ratio + turned_2 + k.runout_angle[1]
            off = k.runout[0] * sin(phi_1) + k.runout[1] * sin(phi_2)
            n = near_pairs(
                cycles, k.start, k.column_step, corner, separation, table_rows, pitch, k.teeth, reach + off, pairs,
                columns, parts, apart, slope,
            )  # fmt: skip
            if n < 0:
                return n_out
            if one_pass == 0:
                _taken_up(k, n, pairs, held, held_root, held_pair, force, root)
            # Approach of every slice, elastic law plus damping; then the contact's forces, N ≥ 0.
            deepest = _approaches(
                k, n, rows, turn, q1, v1, pairs, columns, parts, apart, slope, off, seen, moving, approach,
                viscous, along,
            )  # fmt: skip
            fill_compliance(n, pairs, columns, parts, k.teeth, direct, cross, extra, table_rows, r)
            done, m = solve_contacts(r, n * n_s, approach, hertz, k.small, force, root, enough, order, a, x)
            if done < 0:
                return n_out
            _without_damping(k, n * n_s, m, force, viscous, order, a, x, elastic)
            # The torque due to stiffness and flank shape moving past under load, −∂U/∂ζ ∂ζ/∂θ1, and to run-out.
            reach = max(deepest - off, 0.0) + margin
            total, along_cycles = 0.0, 0.0
            for i in range(n * n_s):
                total += force[i]
                along_cycles += elastic[i] * along[i]
            along_cycles -= compliance_slope_energy(
                n, pairs, columns, k.teeth, direct, cross, extra, table_rows, k.column_step, elastic
            )
            along_torque = -k.cycles_per_rad * along_cycles
            off_1, across_1 = k.runout[0] * sin(phi_1), k.runout[0] * cos(phi_1)
            off_2, across_2 = k.runout[1] * sin(phi_2), k.runout[1] * cos(phi_2)
            torque_1 = along_torque - total * across_1
            torque_2 = -total * across_2
            # Friction across the line of action, and the back flanks.
            if k.friction:
                slip_x = on_input(inputs, 0, 2, v1) - on_input(inputs, 1, 2, v1)
                rubbing, moment_1, moment_2 = _rubbing(k, n, n_s, pairs, cycles, force, w1, slip_x)
                torque_1, torque_2 = torque_1 + moment_1, torque_2 + moment_2
            # On the back flanks run-out acts along their own line of action: closer gears have less backlash.
            arm_1 = k.cos_back * across_1 + k.sin_back * off_1
            arm_2 = k.cos_back * across_2 - k.sin_back * off_2
            depth = product(back_row, q1) + k.damping_time * product(back_row, v1) - k.backlash
            depth += k.sin_back * (across_1 - across_2) - k.cos_back * (off_1 + off_2)
            depth -= k.damping_time * (arm_1 + arm_2 / k.ratio) * w1
            # A pitch deviation shifts both flanks of a tooth.
            behind, behind_slope = out_of_place(cycles, 0.5 * k.contact_ratio, k.teeth, pitch)
            depth += behind + k.damping_time * behind_slope * k.cycles_per_rad * w1
            back = k.back_stiffness * depth if depth > 0.0 else 0.0
            torque_1, torque_2 = torque_1 + back * arm_1, torque_2 + back * arm_2
            torque_1 -= back * behind_slope * k.cycles_per_rad
            # All forces as modal forces; the reference repeats the pass until the contact forces converge.
            for side in range(2):
                pull, across = (torque_1, -rubbing) if side == 0 else (torque_2, rubbing)
                for j in range(n_modes):
                    f1[side, j] = base[side, j] + pull * inputs[side, 1, j] + across * inputs[side, 2, j]
                    f1[side, j] -= back * back_row[side, j]
            _contact_on_modes(k, n, n_s, pairs, columns, parts, rows, turn, force, g, f1)
            if one_pass > 0 and _greatest_change(n * n_s, force, last_force) <= enough:
                break
            if precise:
                for i in range(n * n_s):
                    last_force[i] = force[i]
        if not abs(total) < 1e12:
            return n_out
        if number > 0 or rest[2] == 0.0:  # the last state of another run is only evaluated
            _keep(n, n_slots, pairs, force, root, held, held_root)
            _advance(number, coefficients, free_q, free_v, f1, q, v, f, f_before)
        rest[2] = 1.0
        touches = 1.0 if total > 0.0 else 0.0
        if k.restitution >= 0.0 and rest[1] == 0.0 and touches > 0.0:
            _bounce(k, rigid, v)
        rest[1] = touches
        # The requested signals of this step.
        if number % stride == 0 and n_out < output.shape[0]:
            extras[0], extras[1], extras[2], extras[3], extras[4] = total, back, cycles, reach - margin, along_torque
            extras[5] = rubbing
            _yields(k, inputs, q, angle, load, extras)
            _pair_extras(n, n_slots, n_s, pairs, np.floor(cycles - k.start), force, extras)
            _accelerations(q, v, f, modal, q1)  # scratch until the next step
            for line in range(kinds.shape[0]):
                if kinds[line] >= 3:
                    output[n_out, line] = extras[kinds[line] - 3]
                elif kinds[line] == 2:
                    output[n_out, line] = set_factors[line] * rate1 + signal_of_modes(factors, line, q1)
                elif kinds[line] == 1:
                    output[n_out, line] = set_factors[line] * w1 + signal_of_modes(factors, line, v)
                else:
                    output[n_out, line] = set_factors[line] * angle + signal_of_modes(factors, line, q)
            if energies.shape[0] > 0:
                energies[n_out] = _energy(k, q, v, modal, inputs, angle, load, r, n * n_s, force, back, hertz)
            n_out += 1
    rest[0] = angle
    return n_out


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _predict(number, coefficients, q, v, f, f_before, free_q, free_v, f1):
    """Motion of the modes without the force at the step's end, and that force extrapolated."""
    for side in range(2):
        for j in range(q.shape[1]):
            if number > 0:
                a0, a1, b0 = coefficients[side, 0, j], coefficients[side, 1, j], coefficients[side, 4, j]
                free_q[side, j] = a0 * q[side, j] + a1 * v[side, j] + b0 * f[side, j]
                a0, a1, b0 = coefficients[side, 2, j], coefficients[side, 3, j], coefficients[side, 6, j]
                free_v[side, j] = a0 * q[side, j] + a1 * v[side, j] + b0 * f[side, j]
                f1[side, j] = 2.0 * f[side, j] - f_before[side, j]
            else:
                free_q[side, j], free_v[side, j], f1[side, j] = q[side, j], v[side, j], f[side, j]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _moved(number, coefficients, free_q, free_v, f1, q, v, q1, v1):
    """Modes at the step's end with a given force there; at the start, unchanged."""
    for side in range(2):
        for j in range(q.shape[1]):
            if number > 0:
                q1[side, j] = free_q[side, j] + coefficients[side, 5, j] * f1[side, j]
                v1[side, j] = free_v[side, j] + coefficients[side, 7, j] * f1[side, j]
            else:
                q1[side, j], v1[side, j] = q[side, j], v[side, j]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _taken_up(k, n, pairs, held, held_root, held_pair, force, root):
    """Start values of the solution: the pairs' forces at the step before, 0 for new pairs."""
    n_slots, n_s = held.shape
    for p in range(n):
        ring = place_of(pairs[p], n_slots)
        if held_pair[ring] != pairs[p]:
            held_pair[ring] = pairs[p]
            for s in range(n_s):
                held[ring, s], held_root[ring, s] = 0.0, k.small**-0.1
        for s in range(n_s):
            force[p * n_s + s], root[p * n_s + s] = held[ring, s], held_root[ring, s]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _approaches(
    k, n, rows, turn, q1, v1, pairs, columns, parts, apart, slope, off, seen, moving, approach, viscous, along
):  # fmt: skip
    """Fill the approach of each slice, its damping part and its change per mesh cycle; return the maximum."""
    n_s, deepest = apart.shape[1], -1.0
    for p in range(n):
        for s in range(n_s):
            i = p * n_s + s
            approach[i], viscous[i], along[i] = off - apart[p, s], 0.0, -slope[p, s]
        for side in range(2):
            tooth = place_of(pairs[p], k.teeth[side])
            to_tooth(q1, side, turn, tooth, k.n_single, k.n_pairs, seen)
            to_tooth(v1, side, turn, tooth, k.n_single, k.n_pairs, moving)
            for s in range(n_s):
                low, high, rate = dots(rows, side, columns[p], s, parts[p], seen, moving)
                i = p * n_s + s
                approach[i] += low + parts[p] * (high - low)
                viscous[i] += k.damping_time * rate
                along[i] += (high - low) / k.column_step
        for s in range(n_s):
            approach[p * n_s + s] += viscous[p * n_s + s]
            deepest = max(deepest, approach[p * n_s + s] + apart[p, s])
    return deepest


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _without_damping(k, n, m, force, viscous, order, a, x, elastic):
    """Elastic part of the forces: less the contact's stiffness times the damping part of the approach."""
    for i in range(n):
        elastic[i] = force[i]
    if k.damping_time > 0.0:
        for p in range(m):
            x[p] = viscous[order[p]]
        back_substituted(a, m, x)
        for p in range(m):
            elastic[order[p]] -= x[p]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _rubbing(k, n, n_s, pairs, cycles, force, omega, slip_x):
    """Friction force and its moments about both axes, summed over the pairs."""
    rubbing, moment_1, moment_2 = 0.0, 0.0, 0.0
    for p in range(n):
        carried = 0.0
        for s in range(n_s):
            carried += force[p * n_s + s]
        if carried > 0.0:
            progress = min(max(cycles - pairs[p], 0.0), k.contact_ratio)
            force_x, on_1, on_2 = friction_of_pair(k, carried, progress, omega, omega / k.ratio, slip_x, k.width)
            rubbing, moment_1, moment_2 = rubbing + force_x, moment_1 + on_1, moment_2 + on_2
    return rubbing, moment_1, moment_2


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _contact_on_modes(k, n, n_s, pairs, columns, parts, rows, turn, force, g, f1):
    """Add −N ∂D/∂η of every slice."""
    for side in range(2):
        for p in range(n):
            tooth = place_of(pairs[p], k.teeth[side])
            g[:] = 0.0
            for s in range(n_s):
                if force[p * n_s + s] > 0.0:
                    spread(rows, side, columns[p], s, parts[p], force[p * n_s + s], g)
            add_from_tooth(g, side, turn, tooth, k.n_single, k.n_pairs, f1)


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _greatest_change(n, force, last_force):
    change = 0.0
    for i in range(n):
        change = max(change, abs(force[i] - last_force[i]))
    return change


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _keep(n, n_slots, pairs, force, root, held, held_root):
    """Keep the pairs' forces for the next step."""
    n_s = held.shape[1]
    for p in range(n):
        ring = place_of(pairs[p], n_slots)
        for s in range(n_s):
            held[ring, s], held_root[ring, s] = force[p * n_s + s], root[p * n_s + s]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _advance(number, coefficients, free_q, free_v, f1, q, v, f, f_before):
    """Advance the state with the force found; at the start, store only the force."""
    for side in range(2):
        for j in range(q.shape[1]):
            if number > 0:
                q[side, j] = free_q[side, j] + coefficients[side, 5, j] * f1[side, j]
                v[side, j] = free_v[side, j] + coefficients[side, 7, j] * f1[side, j]
                f_before[side, j] = f[side, j]
            else:
                f_before[side, j] = f1[side, j]
            f[side, j] = f1[side, j]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _bounce(k, rigid, v):
    """Reverse the gears' closing speed with the coefficient of restitution."""
    closing = product(rigid, v)
    if closing > 0.0:
        kick = (1.0 + k.restitution) * closing / product(rigid, rigid)
        for side in range(2):
            for j in range(v.shape[1]):
                v[side, j] -= kick * rigid[side, j]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _pair_extras(n, n_slots, n_s, pairs, newest, force, extras):
    """Fill the forces of slots and of their slices."""
    extras[N_EXTRAS:] = 0.0
    for p in range(n):
        slot = int(newest - pairs[p])
        for s in range(n_s):
            extras[N_EXTRAS + slot] += force[p * n_s + s]
            extras[N_EXTRAS + n_slots + slot * n_s + s] = force[p * n_s + s]


@njit(inline="always", error_model="numpy", fastmath=FAST)
def _accelerations(q, v, f, modal, out):
    """Fill the modal accelerations."""
    for side in range(2):
        for j in range(q.shape[1]):
            out[side, j] = f[side, j] - modal[side, 1, j] * v[side, j] - modal[side, 0, j] * q[side, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _energy(k, q, v, modal, inputs, angle, load, r, n, force, back, hertz):
    """Kinetic and elastic energy, and that of constant drive and load torques; for machines whose set speed is 0."""
    total = 0.0
    for side in range(2):
        for j in range(q.shape[1]):
            total += 0.5 * (v[side, j] ** 2 + modal[side, 0, j] * q[side, j] ** 2)
    total -= load * (angle + on_input(inputs, 0, 0, q)) - load * k.ratio * (angle / k.ratio + on_input(inputs, 1, 0, q))
    for i in range(n):
        total += hertz_energy(force[i], hertz[i % hertz.shape[0]], k.small)
        for j in range(n):
            total += 0.5 * force[i] * r[i, j] * force[j]
    if back > 0.0:
        total += 0.5 * back * back / k.back_stiffness
    return total


# One step of each mode as fixed coefficients: (q, v) at the end from (q, v) at the start and the forces at both ends.
#
#     q₁ = a_qq q₀ + a_qv v₀ + b_q0 f₀ + b_q1 f₁,   v₁ = a_vq q₀ + a_vv v₀ + b_v0 f₀ + b_v1 f₁
#
# for q̈ + 2ζω q̇ + ω² q = f. Both integrators have this form and differ in the coefficients.

Method = Literal["exponential", "newmark"]
METHODS: tuple[Method, ...] = ("exponential", "newmark")
NAMES = ("a_qq", "a_qv", "a_vq", "a_vv", "b_q0", "b_q1", "b_v0", "b_v1")
BETA, GAMMA = 0.25, 0.5
"""Newmark's constants for average acceleration: second order, without numerical damping."""


def step_coefficients(
    omega_rad_s: FloatArray, damping_rate: FloatArray, step_s: float, method: Method = "exponential"
) -> FloatArray:
    """Return the eight coefficients of each mode, (8, n_modes), in the order of `NAMES`.

    Parameters
    ----------
    omega_rad_s : array, (n_modes,)
        0 for rigid motion.
    damping_rate : array, (n_modes,)
        2ζω in 1/s.
    step_s : float
    method : str
        "exponential": exact for a force that is linear between steps, however stiff the mode. "newmark": average
        acceleration, β = ¼, γ = ½.

    Source: N. M. Newmark, A method of computation for structural dynamics, Journal of the Engineering Mechanics
    Division ASCE 85 (1959); G. F. Franklin, J. D. Powell, M. L. Workman, *Digital Control of Dynamic Systems*, 3rd ed.,
    1998, for the first-order hold.
    """
    one_of(method, "method", METHODS)
    h = positive(step_s, "step_s", "s")
    made = [
        _exponential(w, c, h) if method == "exponential" else _newmark(w, c, h)
        for w, c in zip(omega_rad_s.tolist(), damping_rate.tolist(), strict=True)
    ]
    return np.ascontiguousarray(np.array(made).reshape(-1, 8).T)


def _exponential(w: float, c: float, h: float) -> tuple[float, ...]:
    from scipy.linalg import expm

    # Scaled to v·h and f·h², so that the matrix's entries have similar magnitude.
    system = np.zeros((4, 4))
    system[0, 1] = 1.0
    system[1, :3] = -((w * h) ** 2), -c * h, 1.0
    system[2, 3] = 1.0
    e = expm(system)
    q0, q1 = h * h * (e[0, 2] - e[0, 3]), h * h * e[0, 3]
    v0, v1 = h * (e[1, 2] - e[1, 3]), h * e[1, 3]
    return float(e[0, 0]), float(h * e[0, 1]), float(e[1, 0] / h), float(e[1, 1]), q0, q1, v0, v1


def _newmark(w: float, c: float, h: float) -> tuple[float, ...]:
    def advanced(q: float, v: float, f0: float, f1: float) -> tuple[float, float]:
        a0 = f0 - c * v - w * w * q
        q_star = q + h * v + h * h * (0.5 - BETA) * a0
        v_star = v + h * (1.0 - GAMMA) * a0
        a1 = (f1 - c * v_star - w * w * q_star) / (1.0 + GAMMA * h * c + BETA * h * h * w * w)
        return q_star + BETA * h * h * a1, v_star + GAMMA * h * a1

    q, v, f0, f1 = (advanced(*unit) for unit in np.eye(4).tolist())
    return q[0], v[0], q[1], v[1], f0[0], f1[0], f0[1], f1[1]
