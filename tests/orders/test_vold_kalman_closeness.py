"""Orders closer than the filter is wide: the joint problem is worse conditioned, and still solved."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from gearsig.checks import FloatArray
from gearsig.orders.vold_kalman import (
    accuracy_of,
    envelope_weight,
    rounding_growth,
    solve_envelopes,
)

RATE_HZ, N = 20000.0, 3000
TIME_S = np.arange(N) / RATE_HZ


def refined_waveforms(y: FloatArray, cycles: FloatArray, bandwidth: float, p: int) -> FloatArray:
    """Solve [1 A; Aᵀ 0] [ρ x] = [b 0] with residuals in extended precision: no normal equations, no lost digits."""
    n_unknowns = 2 * len(cycles)
    difference = sp.eye(N, format="csr")
    for _ in range(p):
        difference = difference[1:] - difference[:-1]
    r = float(envelope_weight(np.full((1, 1), bandwidth), p)[0, 0]) / np.sqrt(2.0)
    turns = np.exp(2j * np.pi * cycles)
    data = [sp.diags(part) for turn in turns for part in (turn.real, -turn.imag)]
    smooth: list[Any] = [[r * difference if i == j else None for j in range(n_unknowns)] for i in range(n_unknowns)]
    rows: list[Any] = [data, *smooth]
    a: Any = sp.bmat(rows)
    m = sp.bmat([[sp.eye(a.shape[0]), a], [a.T, None]]).tocoo()
    solver = splu(m.tocsc())
    right = np.zeros(m.shape[0], np.longdouble)
    right[:N] = y
    x = np.zeros_like(right)
    for _ in range(6):
        residual = right.copy()
        np.subtract.at(residual, m.row, m.data.astype(np.longdouble) * x[m.col])
        x += solver.solve(residual.astype(np.float64))
    parts = x[a.shape[0] :].astype(np.float64).reshape(len(cycles), 2, N)
    return np.asarray(parts[:, 0] * turns.real - parts[:, 1] * turns.imag)


@pytest.mark.parametrize("p", [2, 3])
@pytest.mark.parametrize(("bandwidth_hz", "gap_hz"), [(100.0, 15.0), (200.0, 25.0), (400.0, 40.0)])
def test_close_orders_are_solved_as_exactly_as_stated(p: int, bandwidth_hz: float, gap_hz: float) -> None:
    cycles = np.stack([300.0 * TIME_S, (300.0 + gap_hz) * TIME_S])
    noise = 0.01 * np.random.default_rng(1).standard_normal(N)
    y = np.cos(2 * np.pi * cycles[0]) + 0.5 * np.cos(2 * np.pi * cycles[1] + 1.0) + noise
    widths = np.full((2, 1), bandwidth_hz / RATE_HZ)
    found = solve_envelopes(y, cycles, None, widths, p)
    error = np.abs((found * np.exp(2j * np.pi * cycles)).real - refined_waveforms(y, cycles, widths[0, 0], p)).max()
    assert error < 1e-7
    assert error < 3.0 * accuracy_of(cycles, None, widths, p) < 1e-5


def test_orders_that_cross_swiftly_or_lie_apart_are_not_close() -> None:
    widths = np.full((2, 1), 10.0 / RATE_HZ)
    apart = np.stack([300.0 * TIME_S, 315.0 * TIME_S])
    crossing = np.stack([300.0 * TIME_S, 100.0 * TIME_S + 0.5 * 2700.0 * TIME_S**2])
    assert rounding_growth(apart, None, widths, 2) == 1.0
    assert rounding_growth(crossing, None, widths, 2) == 1.0
    long_s = np.arange(20 * N) / RATE_HZ
    assert rounding_growth(np.stack([300.0 * long_s, 302.0 * long_s]), None, widths, 2) == pytest.approx(
        5.0**4, rel=1e-3
    )


@pytest.mark.parametrize(("bandwidth_hz", "slope_hz_per_s"), [(60.0, 40.0), (200.0, 200.0)])
def test_slow_crossings_are_solved_as_exactly_as_stated(bandwidth_hz: float, slope_hz_per_s: float) -> None:
    second = 300.0 * TIME_S + 0.5 * slope_hz_per_s * (TIME_S - TIME_S[N // 2]) ** 2
    cycles = np.stack([300.0 * TIME_S, second])
    y = np.cos(2 * np.pi * cycles[0]) + 0.5 * np.cos(2 * np.pi * cycles[1] + 1.0)
    widths = np.full((2, 1), bandwidth_hz / RATE_HZ)
    found = solve_envelopes(y, cycles, None, widths, 3)
    error = np.abs((found * np.exp(2j * np.pi * cycles)).real - refined_waveforms(y, cycles, widths[0, 0], 3)).max()
    assert error < 3.0 * accuracy_of(cycles, None, widths, 3) < 1e-5
