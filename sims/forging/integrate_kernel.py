"""Compiled: runs the drive through one stretch of straight courses, and finds every contact gained or lost."""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

from math import floor

import numpy as np
from numba import njit

from sims.forging.contact_kernel import reach, younger_pair
from sims.forging.motion_kernel import energy
from sims.forging.runge_kutta_kernel import N_STAGES, error_norm, evaluate, step, within_step

N_OUT = 13
N_SIGNALS = 17
LONGEST_STEP_S = 1e-3
SHORTEST_STEP_S = 1e-12
MOST_TURN = 0.03
"""Base pitches in one step: pairs then change hands within single contact."""
ROOT_M = 1e-16
DONE, TOO_MANY_CONTACTS, STUCK = 0, 1, 2


@njit(cache=True, nogil=True, error_model="numpy")
def integrate(k, y, mode, t, t_end, first_step, course, absolute, relative, interval, select, counts, found, contacts):
    """Run from t to `t_end`; fill rows of `found` at multiples of `interval` and rows of `contacts`.

    y : states, left at the end's.
    mode : flank (−1, 0, 1), younger pair, damping of the contact; left at the end's.
    course : start time, then value and slope of torque, brake and press.
    select : places of the wanted signals in `sims.forging.numbers.SIGNALS`.
    counts : rows filled so far in `found` and in `contacts` (an unfinished contact is the last row), steps taken,
        steps refused; continued.
    Returns the last step's length and a status.
    """
    n = y.shape[0]
    stages, end = np.empty((N_STAGES, n)), np.empty(n)
    out, spare = np.empty(N_OUT), np.empty((2, n))
    h = first_step
    evaluate(k, y, t, mode, course, stages[0], out)
    while t < t_end - 1e-15 * max(1.0, t_end):
        turn = abs(y[1]) * k.cycles_per_rad
        h = min(h, LONGEST_STEP_S, MOST_TURN / turn if turn > 0.0 else LONGEST_STEP_S)
        free = h
        h = min(h, t_end - t)
        step(k, y, t, h, mode, course, stages, end, out)
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
            h = _to_event(k, y, t, h, mode, course, stages, end, out, next_flank)
        if counts[0] < found.shape[0] and counts[0] * interval <= t + h:
            _fill_rows(k, y, t, h, mode, course, stages, interval, select, counts, found, spare)
        t += h
        y[:] = end
        if mode[0] != 0.0:
            contacts[counts[1] - 1, 7] = max(contacts[counts[1] - 1, 7], abs(out[7]))
        if changes:
            if not _change_contact(k, y, t, next_flank, mode, counts, contacts):
                return h, TOO_MANY_CONTACTS
            evaluate(k, y, t, mode, course, stages[0], out)
            h = min(free, 1e-5)
            continue
        if mode[0] != 0.0 and _hand_over(k, y, mode):
            evaluate(k, y, t, mode, course, stages[0], out)
        else:
            stages[0] = stages[N_STAGES - 1]
        grown = h * min(5.0, 0.9 * max(error, 1e-10) ** -0.2)
        h = max(grown, free) if h < free else grown
    return h, DONE


@njit(cache=True, nogil=True, error_model="numpy")
def _fill_rows(k, y, t, h, mode, course, stages, interval, select, counts, found, spare):
    """Fill the rows of `found` whose times lie within a step."""
    extra, row = np.empty(N_OUT), np.empty(N_SIGNALS)
    at = spare[0]
    while counts[0] < found.shape[0] and counts[0] * interval <= t + h:
        x = (counts[0] * interval - t) / h
        for i in range(y.shape[0]):
            at[i] = within_step(y, h, stages, x, i)
        evaluate(k, at, t + x * h, mode, course, spare[1], extra)
        row[:N_OUT] = extra
        row[N_OUT] = energy(k, at, mode[0], mode[1])
        row[N_OUT + 1 : N_SIGNALS] = at[8:11]
        for i in range(select.shape[0]):
            found[counts[0], i] = row[select[i]]
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
def _to_event(k, y, t, h, mode, course, stages, end, out, next_flank):
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
    found = high * h
    for _ in range(4):
        found = min(max(found, 1e-15), h)
        step(k, y, t, found, mode, course, stages, end, out)
        edge, over = reach(k, end[0], flank)
        left = flank * end[2] - edge
        speed = flank * end[3] - over * end[1]
        if abs(left) < ROOT_M or speed == 0.0:
            break
        change = left / speed
        if abs(change) > 0.1 * h:
            break
        found -= change
    return found
