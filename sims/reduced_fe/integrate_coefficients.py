"""One step of each mode as fixed numbers: (q, v) at the end from (q, v) and the forces at either end.

    q₁ = a_qq q₀ + a_qv v₀ + b_q0 f₀ + b_q1 f₁,   v₁ = a_vq q₀ + a_vv v₀ + b_v0 f₀ + b_v1 f₁

for q̈ + 2ζω q̇ + ω² q = f. Both integrators are of this form; they differ in the numbers.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, one_of, positive

Method = Literal["exponential", "newmark"]
METHODS: tuple[Method, ...] = ("exponential", "newmark")
NAMES = ("a_qq", "a_qv", "a_vq", "a_vv", "b_q0", "b_q1", "b_v0", "b_v1")
BETA, GAMMA = 0.25, 0.5
"""Newmark's constants of the average acceleration: second order, without numerical damping."""


def step_coefficients(
    omega_rad_s: FloatArray, damping_rate: FloatArray, step_s: float, method: Method = "exponential"
) -> FloatArray:
    """Return the eight numbers of each mode, (8, n_modes), in the order of `NAMES`.

    Parameters
    ----------
    omega_rad_s : array, (n_modes,)
        0 for rigid motion.
    damping_rate : array, (n_modes,)
        2ζω in 1/s.
    step_s : float
    method : str
        "exponential": exact for a force that runs straight from step to step, however stiff the mode. "newmark": the
        average acceleration, β = ¼, γ = ½.

    Source: N. M. Newmark, A method of computation for structural dynamics, Journal of the Engineering Mechanics
    Division ASCE 85 (1959); G. F. Franklin, J. D. Powell, M. L. Workman, *Digital Control of Dynamic Systems*, 3rd ed.,
    1998, for the first-order hold.
    """
    one_of(method, "method", METHODS)
    h = positive(step_s, "step_s", "s")
    made = [
        _exponential(w, c, h) if method == "exponential" else _newmark(w, c, h)
        for w, c in _pairs(omega_rad_s, damping_rate)
    ]
    return np.ascontiguousarray(np.array(made).reshape(-1, 8).T)


def _pairs(omega: FloatArray, rate: FloatArray) -> list[tuple[float, float]]:
    return [(float(w), float(c)) for w, c in zip(omega, rate, strict=True)]


def _exponential(w: float, c: float, h: float) -> tuple[float, ...]:
    from scipy.linalg import expm

    # Scaled to v·h and f·h², so that the matrix's entries are of one size.
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
