"""Groups of orders solved for in turn, each on what the others leave of the signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.orders.vold_kalman_groups import Group
from gearsig.orders.vold_kalman_solve import envelopes_of_waveforms, solve_envelopes, solve_waveforms
from gearsig.orders.vold_kalman_splines import BoolArray, ComplexArray
from gearsig.orders.vold_kalman_types import Generation

Rows = Group | slice
MOST_SWEEPS = 20
ENOUGH = 2e-7
"""Change of any waveform by a further sweep, as a share of the signal's largest value, that is not worth it."""


@dataclass(frozen=True)
class Problem:
    """All orders: phase in cycles, where they are data, -3 dB bandwidth in cycles per sample; (n_orders, n)."""

    cycles: FloatArray
    valid: BoolArray
    bandwidths: FloatArray
    p: int
    generation: Generation
    mirror: bool


def solve_groups(
    y: FloatArray, problem: Problem, groups: Sequence[Group], *, share: bool
) -> tuple[ComplexArray, FloatArray, float]:
    """Return envelopes (nan where not valid), waveforms (0 there), and the error that is left relative to the signal.

    Without `share`, each group sees the whole signal, and takes what leaks through its bands of the others: near the
    ends, that is some percent even of far ones. With it, each sees the signal less the others' waveforms, in several
    sweeps (Gauss–Seidel by groups), which lead to the solution for all orders together.
    """
    solutions: NDArray[Any] = np.empty(
        problem.cycles.shape, np.complex128 if problem.generation == "second" else np.float64
    )
    waveforms = np.zeros(problem.cycles.shape)
    rows = [_rows(group) for group in groups]
    if len(groups) == 1 or not share:
        for g in rows:
            solutions[g], waveforms[g] = _solved(y, problem, g)
        return _envelopes(solutions, problem), waveforms, 0.0
    rest = y.astype(np.float64)
    largest = float(np.abs(rest).max()) or 1.0
    before, left = 1.0, 1.0
    for _ in range(MOST_SWEEPS):
        change = 0.0
        for g in rows:
            rest += waveforms[g].sum(axis=0)
            solutions[g], new = _solved(rest, problem, g)
            change = max(change, float(np.abs(new - waveforms[g]).max()) / largest)
            waveforms[g] = new
            rest -= new.sum(axis=0)
        # Each sweep changes the waveforms by the same fraction of what the last one did.
        left = change * min(1.0, change / before)
        before = change
        if left < ENOUGH:
            break
    return _envelopes(solutions, problem), waveforms, left


def _rows(group: Group) -> Rows:
    """Return neighbours as a slice, which takes no copy."""
    return slice(int(group[0]), int(group[-1]) + 1) if np.all(np.diff(group) == 1) else group


def _solved(y: FloatArray, problem: Problem, g: Rows) -> tuple[NDArray[Any], FloatArray]:
    """Return the solution of one group (envelopes, or waveforms of the first generation), and its waveforms.

    Where an order is not valid, the solution goes on all the same, and the waveform is 0.
    """
    cycles, valid, widths = problem.cycles[g], problem.valid[g], problem.bandwidths[g]
    active = None if valid.all() else valid
    if problem.generation == "first":
        continued = solve_waveforms(y, cycles, active, widths)
        return continued, continued if active is None else np.where(valid, continued, 0.0)
    from gearsig.orders.vold_kalman_phasor import write_modulated

    envelopes = solve_envelopes(y, cycles, active, widths, problem.p, mirror=problem.mirror)
    waveforms = np.empty(cycles.shape)
    for envelope, angle, out in zip(envelopes, cycles, waveforms, strict=True):
        write_modulated(envelope, angle, out)
    if active is not None:
        waveforms *= valid
    return envelopes, waveforms


def _envelopes(solutions: NDArray[Any], problem: Problem) -> ComplexArray:
    """Return the envelopes, nan where not valid."""
    envelopes = (
        envelopes_of_waveforms(solutions, problem.cycles) if problem.generation == "first" else solutions
    ).astype(np.complex128, copy=False)
    if not problem.valid.all():
        envelopes[~problem.valid] = np.nan
    return envelopes
