"""Compiled: one step of the Dormand–Prince pair 5(4), its error, and the motion within the step.

Source of the coefficients: `scipy.integrate.RK45` (J. R. Dormand, P. J. Prince, A family of embedded Runge-Kutta
formulae, 1980; dense output by L. F. Shampine, Some practical Runge-Kutta formulas, 1986).
"""

# mypy: allow-untyped-defs, allow-untyped-calls
from __future__ import annotations

import numpy as np
from numba import njit
from scipy.integrate import RK45

from sims.forging.motion_kernel import rates

N_STAGES = 7
NODES = np.append(RK45.C, 1.0)
STAGES = np.zeros((N_STAGES, N_STAGES - 1))
STAGES[: N_STAGES - 1, : N_STAGES - 2] = RK45.A
STAGES[N_STAGES - 1] = RK45.B
ERROR = np.asarray(RK45.E)
DENSE = np.asarray(RK45.P)


@njit(cache=True, nogil=True, error_model="numpy")
def step(k, y, t, h, mode, course, stages, end, out):
    """Step from y (first stage already in `stages[0]`) to `end`; `out` is that of the step's end.

    mode : flank, younger pair, damping.
    course : time 0 and values of torque, brake, press with their slopes.
    """
    n = y.shape[0]
    for s in range(1, N_STAGES):
        for i in range(n):
            total = 0.0
            for j in range(s):
                total += STAGES[s, j] * stages[j, i]
            end[i] = y[i] + h * total
        evaluate(k, end, t + NODES[s] * h, mode, course, stages[s], out)


@njit(cache=True, nogil=True, error_model="numpy")
def evaluate(k, y, t, mode, course, dy, out):
    """Fill the rates at time t."""
    since = t - course[0]
    rates(
        k, y, mode[0], mode[1], mode[2],
        course[1] + course[2] * since, course[3] + course[4] * since, course[5] + course[6] * since, dy, out,
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
