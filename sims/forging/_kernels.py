"""Compiled: runs the drive through one segment of straight profiles, and finds every contact gained or lost."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import cos, exp, floor, sin

import numpy as np
from scipy.integrate import RK45

from gearsig.compiled import njit
from sims.compiled import copy

# Compiled: which tooth pairs carry, where worn ones touch, and the force of the flanks that do.


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _step(x):
    """Rise from 0 to 1 with two continuous derivatives, and its slope."""
    if x <= 0.0:
        return 0.0, 0.0
    if x >= 1.0:
        return 1.0, 0.0
    return x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * x * x * (1.0 - x) * (1.0 - x)


@njit(cache=True, nogil=True, error_model="numpy")
def weight(k, p):
    """Part of its full stiffness that a pair has p base pitches behind its entry, and the slope over p."""
    rise, up = _step(p / k.ramp + 0.5)
    stay, down = _step((k.contact_ratio - p) / k.ramp + 0.5)
    return rise * stay, (up * stay - rise * down) / k.ramp


@njit(cache=True, nogil=True, error_model="numpy")
def younger_pair(k, angle, flank):
    """Number of the younger of the two pairs that may touch.

    Pairs change hands half-way through single contact, where the pair that goes has left and the one that comes has not
    arrived: no jump whatever the direction.
    """
    x = angle * k.cycles_per_rad - k.phase
    if flank < 0:
        x = k.mirror - x
    return floor(x - 0.5 * k.contact_ratio) + 1.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def position(k, angle, flank, younger):
    """Base pitches of the younger pair behind its entry, and its slope over the pinion's angle."""
    x = angle * k.cycles_per_rad - k.phase
    if flank < 0:
        return k.mirror - x - younger, -k.cycles_per_rad
    return x - younger, k.cycles_per_rad


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def stiffness_share(k, number, flank):
    """Part of its stiffness that a pair has: less than 1 for a weak tooth on its drive flank."""
    if flank > 0 and k.weak_loss > 0.0 and number - floor(number / k.weak_teeth) * k.weak_teeth == k.weak_tooth:
        return 1.0 - k.weak_loss
    return 1.0


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def worn_off(k, p, flank):
    """What wear has taken off a pair p base pitches behind its entry, drive flanks alone, and its slope over p.

    Cubic between the points of the table, with their slopes; beyond the path of contact as at its end.
    """
    if flank < 0 or k.is_worn == 0.0:
        return 0.0, 0.0
    x = p / k.contact_ratio * (k.wear.shape[0] - 1)
    if x <= 0.0:
        return k.wear[0], 0.0
    if x >= k.wear.shape[0] - 1:
        return k.wear[-1], 0.0
    i = int(x)
    u = x - i
    a, b, c, d = k.wear[i], k.wear[i + 1], k.wear_slope[i], k.wear_slope[i + 1]
    depth = a + u * (c + u * (3.0 * (b - a) - 2.0 * c - d + u * (2.0 * (a - b) + c + d)))
    slope = c + u * (2.0 * (3.0 * (b - a) - 2.0 * c - d) + u * 3.0 * (2.0 * (a - b) + c + d))
    return depth, slope * (k.wear.shape[0] - 1) / k.contact_ratio


@njit(cache=True, nogil=True, error_model="numpy")
def reach(k, angle, flank):
    """Compression at which the first pair touches a flank, in the flank's direction; and its slope over the angle."""
    if flank < 0 or k.is_worn == 0.0:
        return k.half_backlash, 0.0
    p, slope = position(k, angle, flank, younger_pair(k, angle, flank))
    smallest, change = 1e9, 0.0
    for i in range(2):
        if -0.5 * k.ramp < p + i < k.contact_ratio + 0.5 * k.ramp:
            depth, over = worn_off(k, p + i, flank)
            if depth < smallest:
                smallest, change = depth, over * slope
    return k.half_backlash + smallest, change


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def one_pair(k, depth, closing, damping):
    """Force of one tooth pair at full stiffness: elastic, and with damping; never tension."""
    if depth <= 0.0:
        return 0.0, 0.0
    elastic = k.stiffness * (depth * depth**0.5 if k.exponent == 1.5 else depth**k.exponent)
    return elastic, max(elastic * (1.0 + damping * closing), 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def stored_energy(k, angle, q, flank, younger):
    """Energy in the teeth that touch: Σ n_i(θ1) k g_i^(λ+1)/(λ+1)."""
    if flank == 0 or flank * q <= k.half_backlash:
        return 0.0
    p, _ = position(k, angle, flank, younger)
    total = 0.0
    for i in range(2):
        depth = flank * q - k.half_backlash - worn_off(k, p + i, flank)[0]
        if depth > 0.0:
            n = weight(k, p + i)[0] * stiffness_share(k, younger - i, flank)
            total += n * k.stiffness * depth ** (k.exponent + 1.0) / (k.exponent + 1.0)
    return total


# Compiled: LuGre friction of a shaft, and of tooth flanks whose normal force varies.


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def bristle(v, z, static_ratio, stribeck, presliding, bristle_time):
    """Force over its sliding level, and dz/dt; see `sims.forging.Bristle`."""
    stribeck_weight = exp(-((v / stribeck) ** 2))
    rate = (v - abs(v) * z / (1.0 + (static_ratio - 1.0) * stribeck_weight)) / presliding
    return z + bristle_time * stribeck_weight * rate, rate


# Compiled: the equations of motion of the drive.


@njit(cache=True, nogil=True, error_model="numpy")
def tooth_friction(k, n, p, z, w1, w2, flank):
    """Friction force of a pair with normal force n, its moment arms times it, loss, and its bristle's rate.

    v_s = −ω1 ρ1 + ω2 ρ2 on the drive flank, mirrored on the back flank; the bristle z runs to ±μ.
    """
    rho_1 = k.start + p * k.base_pitch
    rho_2 = k.length - rho_1
    v = flank * (w2 * rho_2 - w1 * rho_1)
    coefficient = k.tooth_friction * (1.0 + (k.tooth_static_ratio - 1.0) * exp(-((v / k.tooth_stribeck) ** 2)))
    rate = (v * k.tooth_friction - abs(v) * z * k.tooth_friction / coefficient) / k.tooth_presliding
    f = n * z
    return f, f * rho_1, f * rho_2, f * v, rate


@njit(cache=True, nogil=True, error_model="numpy")
def rates(k, y, flank, younger, damping, torque, brake, press, dy, out):
    """Fill `dy` with the rates of the states; `out` with the rest of what is wanted of a moment.

    J1 ω̇1 = T_m − T_1 − rb1 F + Σ f ρ1 − ∂V/∂θ1,  J2 ω̇2 = rb2 F − Σ f ρ2 − T_2 + T_press − T_weight.
    ∂V/∂θ1 is the work that the changing number of pairs does on the rotation (J.-J. Oh, K. Grosh, J. R. Barber, Energy
    conserving equations of motion for gear systems, 2005): without it the mesh would feed or brake the motor. Worn
    flanks give way to the rotation in the same way: δ_i = ±q − a − h(p_i), so that N_i h'(p_i) dp/dθ1 turns the pinion.
    """
    w1, q, q_rate = y[1], y[2], y[3]
    w2 = (k.rb1 * w1 - q_rate) / k.rb2
    force, turn_1, turn_2, loss, friction = 0.0, 0.0, 0.0, 0.0, 0.0
    pairs, damped = 0.0, 0.0
    dy[4], dy[5] = 0.0, 0.0
    if flank != 0 and flank * q > k.half_backlash:
        p, slope = position(k, y[0], flank, younger)
        for i in range(2):
            worn, over = worn_off(k, p + i, flank)
            depth = flank * q - k.half_backlash - worn
            w, dw = weight(k, p + i)
            if depth <= 0.0 or w <= 0.0:
                continue
            share = stiffness_share(k, younger - i, flank)
            w, dw = w * share, dw * share
            closing = flank * q_rate - over * slope * w1
            elastic, pressed = one_pair(k, depth, closing, damping)
            pairs += w
            force += flank * w * pressed
            turn_1 += slope * (over * w * pressed - dw * elastic * depth / (k.exponent + 1.0))
            damped += w * (pressed - elastic) * closing
            if k.tooth_friction > 0.0:
                f, on_1, on_2, lost, rate = tooth_friction(k, w * pressed, p + i, y[4 + i], w1, w2, flank)
                turn_1 += flank * on_1
                turn_2 -= flank * on_2
                loss += lost
                friction += f
                dy[4 + i] = rate
    share_1, dy[6] = bristle(w1, y[6], k.motor_static_ratio, k.motor_stribeck, k.motor_presliding, k.motor_bristle_time)
    share_2, dy[7] = bristle(w2, y[7], k.load_static_ratio, k.load_stribeck, k.load_presliding, k.load_bristle_time)
    drag = (k.drag + brake) * share_1 + k.drag_viscous * w1
    held = k.load_friction * share_2 + k.load_viscous * w2
    motor = torque * (1.0 + k.ripple_fraction * cos(k.ripple_order * y[0]))
    if k.speed_limit > 0.0:
        motor *= min(1.0, max(-1.0, (k.speed_limit - w1) / (k.speed_band * k.speed_limit)))
    angle_2 = (k.rb1 * y[0] - q) / k.rb2
    outside = press - k.unbalance_torque * sin(angle_2 + k.unbalance_angle)
    a1 = (motor - drag - k.rb1 * force + turn_1) / (k.motor_inertia + k.pinion_inertia)
    a2 = (k.rb2 * force + turn_2 - held + outside) / k.wheel_inertia
    dy[0], dy[1], dy[2], dy[3] = w1, a1, q_rate, k.rb1 * a1 - k.rb2 * a2
    dy[8] = motor * w1 + outside * w2
    dy[9] = damped
    dy[10] = loss + drag * w1 + held * w2
    out[0], out[1], out[2] = y[0], w1, a1
    out[3], out[4], out[5] = angle_2, w2, a2
    out[6], out[7] = motor - drag - k.motor_inertia * a1, force
    out[8], out[9], out[10], out[11], out[12] = q, q_rate, pairs, friction, motor


@njit(cache=True, nogil=True, error_model="numpy")
def energy(k, y, flank, younger):
    """Kinetic energy and what is stored in the teeth."""
    w2 = (k.rb1 * y[1] - y[3]) / k.rb2
    kinetic = 0.5 * (k.motor_inertia + k.pinion_inertia) * y[1] ** 2 + 0.5 * k.wheel_inertia * w2**2
    return kinetic + stored_energy(k, y[0], y[2], flank, younger)


# Compiled: one step of the Dormand–Prince pair 5(4), its error, and the motion within the step.
#
# Source of the coefficients: `scipy.integrate.RK45` (J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta
# formulae, 1980; dense output by L. F. Shampine, Some practical Runge-Kutta formulas, 1986).

N_STAGES = 7
NODES = np.append(RK45.C, 1.0)
STAGES = np.zeros((N_STAGES, N_STAGES - 1))
STAGES[: N_STAGES - 1, : N_STAGES - 2] = RK45.A
STAGES[N_STAGES - 1] = RK45.B
ERROR = np.asarray(RK45.E)
DENSE = np.asarray(RK45.P)


@njit(cache=True, nogil=True, error_model="numpy")
def step(k, y, t, h, mode, profile, stages, end, out):
    """Step from y (first stage already in `stages[0]`) to `end`; `out` is that of the step's end.

    mode : flank, younger pair, damping.
    profile : time 0 and values of torque, brake, press with their slopes.
    """
    n = y.shape[0]
    for s in range(1, N_STAGES):
        for i in range(n):
            total = 0.0
            for j in range(s):
                total += STAGES[s, j] * stages[j, i]
            end[i] = y[i] + h * total
        evaluate(k, end, t + NODES[s] * h, mode, profile, stages[s], out)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(k, y, t, mode, profile, dy, out):
    """Fill the rates at time t."""
    since = t - profile[0]
    rates(
        k, y, mode[0], mode[1], mode[2],
        profile[1] + profile[2] * since, profile[3] + profile[4] * since, profile[5] + profile[6] * since, dy, out,
    )  # fmt: skip


@njit(cache=True, nogil=True, error_model="numpy")
def error_norm(y, end, h, stages, absolute, relative):
    """Largest error of a state over what it may have."""
    worst = 0.0
    for i in range(absolute.shape[0]):
        error = 0.0
        for j in range(N_STAGES):
            error += ERROR[j] * stages[j, i]
        allowed = absolute[i] + relative * max(abs(y[i]), abs(end[i]))
        worst = max(worst, abs(h * error) / allowed)
    return worst


@njit(cache=True, nogil=True, error_model="numpy")
def within_step(y, h, stages, x, i):
    """State i at the part x of a step, 0 to 1, of fourth order."""
    total = 0.0
    for j in range(N_STAGES):
        total += stages[j, i] * (x * (DENSE[j, 0] + x * (DENSE[j, 1] + x * (DENSE[j, 2] + x * DENSE[j, 3]))))
    return y[i] + h * total


N_OUT = 13
N_SIGNALS = 17
LONGEST_STEP_S = 1e-3
SHORTEST_STEP_S = 1e-12
MAX_TURN = 0.03
"""Base pitches in one step: pairs then change hands within single contact."""
ROOT_M = 1e-16
DONE, TOO_MANY_CONTACTS, STUCK = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(
    k, y, mode, t, t_end, first_step, profile, absolute, relative, interval, select, counts, output, contacts
):
    """Run from t to `t_end`; fill rows of `output` at multiples of `interval` and rows of `contacts`.

    y : states, left at the end's.
    mode : flank (−1, 0, 1), younger pair, damping of the contact; left at the end's.
    profile : start time, then value and slope of torque, brake and press.
    select : places of the wanted signals in `sims.forging.SIGNALS`.
    counts : rows filled so far in `output` and in `contacts` (an unfinished contact is the last row), steps taken,
        steps refused; continued.
    Returns the last step's length and a status.
    """
    n = y.shape[0]
    stages, end = np.empty((N_STAGES, n)), np.empty(n)
    out, spare = np.empty(N_OUT), np.empty((2, n))
    h = first_step
    evaluate(k, y, t, mode, profile, stages[0], out)
    while t < t_end - 1e-15 * max(1.0, t_end):
        turn = abs(y[1]) * k.cycles_per_rad
        h = min(h, LONGEST_STEP_S, MAX_TURN / turn if turn > 0.0 else LONGEST_STEP_S)
        free = h
        h = min(h, t_end - t)
        step(k, y, t, h, mode, profile, stages, end, out)
        error = error_norm(y, end, h, stages, absolute, relative)
        if not error <= 1.0:
            counts[3] += 1
            h *= max(0.2, 0.9 * error**-0.2) if error < 1e30 else 0.1
            if h < SHORTEST_STEP_S:
                return h, STUCK
            continue
        counts[2] += 1
        next_flank = _flank_after(k, y, end, h, stages, mode[0])
        changes = next_flank != mode[0]
        if changes:
            h = _to_event(k, y, t, h, mode, profile, stages, end, out, next_flank)
        if counts[0] < output.shape[0] and counts[0] * interval <= t + h:
            _fill_rows(k, y, t, h, mode, profile, stages, interval, select, counts, output, spare)
        t += h
        copy(end, y)
        if mode[0] != 0.0:
            contacts[counts[1] - 1, 7] = max(contacts[counts[1] - 1, 7], abs(out[7]))
        if changes:
            if not _change_contact(k, y, t, next_flank, mode, counts, contacts):
                return h, TOO_MANY_CONTACTS
            evaluate(k, y, t, mode, profile, stages[0], out)
            h = min(free, 1e-5)
            continue
        if mode[0] != 0.0 and _hand_over(k, y, mode):
            evaluate(k, y, t, mode, profile, stages[0], out)
        else:
            copy(stages[N_STAGES - 1], stages[0])
        grown = h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        h = max(grown, free) if h < free else grown
    return h, DONE


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_rows(k, y, t, h, mode, profile, stages, interval, select, counts, output, spare):
    """Fill the rows of `output` whose times lie within a step."""
    extra, row = np.empty(N_OUT), np.empty(N_SIGNALS)
    at = spare[0]
    while counts[0] < output.shape[0] and counts[0] * interval <= t + h:
        x = (counts[0] * interval - t) / h
        for i in range(y.shape[0]):
            at[i] = within_step(y, h, stages, x, i)
        evaluate(k, at, t + x * h, mode, profile, spare[1], extra)
        copy(extra, row)
        row[N_OUT] = energy(k, at, mode[0], mode[1])
        row[N_OUT + 1], row[N_OUT + 2], row[N_OUT + 3] = at[8], at[9], at[10]
        for i in range(select.shape[0]):
            output[counts[0], i] = row[select[i]]
        counts[0] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def _change_contact(k, y, t, next_flank, mode, counts, contacts):
    """End the contact there is, begin the next; false where no row is left for it."""
    if mode[0] != 0.0:
        _close(contacts[counts[1] - 1], t, y)
    if next_flank != 0.0:
        if counts[1] == contacts.shape[0]:
            return False
        open_contact(k, y, t, next_flank, mode, contacts[counts[1]])
        counts[1] += 1
    mode[0] = next_flank
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def open_contact(k, y, t, flank, mode, row):
    """Latch the speed at which flanks meet and the damping that follows; the bristles of the flanks begin straight."""
    mode[0] = flank
    mode[1] = younger_pair(k, y[0], flank)
    speed = abs(flank * y[3] - reach(k, y[0], flank)[1] * y[1])
    mode[2] = k.damping_at_1_mps / max(speed, k.speed_floor)
    y[4], y[5] = 0.0, 0.0
    row[0], row[1], row[2] = t, flank, speed
    row[3], row[4] = floor(y[0] * k.cycles_per_rad - k.phase), y[0]
    row[5], row[6], row[7] = np.nan, np.nan, 0.0
    row[8], row[9] = y[9], 1.0 if speed < k.speed_floor else 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _close(row, t, y):
    row[5], row[6], row[8] = t, abs(y[3]), y[9] - row[8]


@njit(cache=True, nogil=True, error_model="numpy")
def _hand_over(k, y, mode):
    """Give the bristles to the next slot where the younger pair is another; say whether it is."""
    younger = younger_pair(k, y[0], mode[0])
    if younger == mode[1]:
        return False
    if younger > mode[1]:
        y[4], y[5] = 0.0, y[4]
    else:
        y[4], y[5] = y[5], 0.0
    mode[1] = younger
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _flank_after(k, y, end, h, stages, flank):
    """Flank that touches when the step ends, or that it touches on the way."""
    if flank != 0.0:
        return 0.0 if flank * end[2] < reach(k, end[0], flank)[0] else flank
    if abs(end[2]) > k.half_backlash:
        side = 1.0 if end[2] > 0.0 else -1.0
        if side * end[2] > reach(k, end[0], side)[0]:
            return side
    if y[3] * end[3] < 0.0:  # it turned round on the way, maybe beyond the flank
        x = y[3] / (y[3] - end[3])
        q = within_step(y, h, stages, x, 2)
        side = 1.0 if q > 0.0 else -1.0
        if side * q > reach(k, within_step(y, h, stages, x, 0), side)[0]:
            return side
    return 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _to_event(k, y, t, h, mode, profile, stages, end, out, next_flank):
    """Shorten the step to the moment at which the flanks meet or part; return its length.

    First on the interpolant by bisection, then with true steps by Newton's rule.
    """
    flank = next_flank if next_flank != 0.0 else mode[0]
    entering = next_flank != 0.0
    low, high = 0.0, 1.0
    if entering and not flank * end[2] > reach(k, end[0], flank)[0]:
        high = y[3] / (y[3] - end[3])
    for _ in range(50):
        middle = 0.5 * (low + high)
        edge = reach(k, within_step(y, h, stages, middle, 0), flank)[0]
        if (flank * within_step(y, h, stages, middle, 2) > edge) == entering:
            high = middle
        else:
            low = middle
    length = high * h
    for _ in range(4):
        length = min(max(length, 1e-15), h)
        step(k, y, t, length, mode, profile, stages, end, out)
        edge, over = reach(k, end[0], flank)
        distance = flank * end[2] - edge
        speed = flank * end[3] - over * end[1]
        if abs(distance) < ROOT_M or speed == 0.0:
            break
        change = distance / speed
        if abs(change) > 0.1 * h:
            break
        length -= change
    return length
