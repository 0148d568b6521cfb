"""Natural frequencies and modes of a gear by cyclic symmetry."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from gearsig.checks import FloatArray, count
from sims.reduced_fe.cyclic import CyclicGear, Held, Solver, factorised
from sims.reduced_fe.hub import ComplexArray
from sims.reduced_fe.sector_plane import IntArray

RIGID_HZ = 10.0
"""Below it a mode of the free gear is rigid; those computed lie below 0.1 Hz, elastic ones far above."""


@dataclass(frozen=True)
class CyclicModes:
    """Modes of a gear, ascending in frequency; those with 0 < n < z/2 stand once here and are pairs.

    Parameters
    ----------
    frequencies_hz : array, (n_shapes,)
    nodal_diameters : array of int, (n_shapes,)
    shapes : array, (n_own_dof, n_shapes)
        Complex U of sector 0, in cylindrical components: the motion of sector k is Re or Im of U e^{2πink/z}. The modal
        mass of each real mode over the whole gear is 1 kg.
    """

    frequencies_hz: FloatArray
    nodal_diameters: IntArray
    shapes: ComplexArray

    def multiplicity(self, n_sectors: int) -> IntArray:
        """2 for pairs, 1 for single modes."""
        single = (self.nodal_diameters == 0) | (2 * self.nodal_diameters == n_sectors)
        return np.where(single, 1, 2)


def cyclic_modes(gear: CyclicGear, n_modes: int = 20, held: Held = "free", *, elastic: bool = False) -> CyclicModes:
    """Return the lowest modes; a pair counts as two, and is never cut.

    Nodal diameters are taken in turn until two running have nothing below the highest frequency kept.

    Parameters
    ----------
    gear : CyclicGear
    n_modes : int
        At least so many are returned.
    held : str
        "free" or "bore".
    elastic : bool
        Leave out the rigid motions of a free gear.

    Source: D. L. Thomas, Dynamics of rotationally periodic structures, International Journal for Numerical Methods in
    Engineering 14 (1979).
    """
    wanted = count(n_modes, "n_modes")
    found: list[tuple[float, int, ComplexArray]] = []
    empty = 0
    for n in gear.diameters:
        # With too few yet, as many as are wanted are looked for: the limit comes down with each nodal diameter.
        limit = _limit(found, wanted, gear.n_sectors)
        new = _below(gear, n, held, wanted, limit, elastic)
        found += new
        empty = 0 if new else empty + 1
        if empty == 2 and np.isfinite(limit):
            break
    found.sort(key=lambda mode: mode[:2])
    kept, total = 0, 0
    while kept < len(found) and total < wanted:
        total += _multiplicity(found[kept][1], gear.n_sectors)
        kept += 1
    chosen = found[:kept]
    shapes = np.column_stack([shape for *_, shape in chosen])
    return CyclicModes(np.array([m[0] for m in chosen]), np.array([m[1] for m in chosen]), shapes)


def modes_of_diameter(gear: CyclicGear, n: int, n_shapes: int, held: Held = "free") -> tuple[FloatArray, ComplexArray]:
    """Lowest `n_shapes` frequencies (Hz) and shapes of one nodal diameter, with unit modal mass over the whole gear.

    Shift-and-invert Lanczos in real coordinates, then a Rayleigh–Ritz step, which sharpens the vectors.
    """
    return _lowest(_problem(gear, n, held), n_shapes)


def lowest_with_static(
    gear: CyclicGear, n: int, n_shapes: int, loads: ComplexArray
) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """Frequencies and shapes as `modes_of_diameter`, of a gear on springs, and its static answers to loads."""
    problem = _problem(gear, n, "sprung")
    frequencies, shapes = _lowest(problem, n_shapes)
    return frequencies, shapes, problem.static(loads)


class _Problem(NamedTuple):
    """Real matrices of one nodal diameter, factorised for shift-and-invert."""

    stiffness: sparse.csc_array
    mass: sparse.csc_array
    kept: IntArray
    n_own: int
    shift: float
    solve: Solver
    basis: sparse.csc_array
    scale: float

    def static(self, loads: ComplexArray) -> ComplexArray:
        """K⁻¹ loads; without a shift and with nothing held only."""
        solved: ComplexArray = self.basis @ self.solve(np.asarray(self.basis.conj().T @ loads))
        return solved


def _problem(gear: CyclicGear, n: int, held: Held) -> _Problem:
    stiffness, mass, basis = gear.system(n)
    n_own = stiffness.shape[0]
    kept = np.arange(n_own)
    if held == "bore":
        kept = np.setdiff1d(kept, gear.bore_dof)
        stiffness, mass = stiffness[kept][:, kept], mass[kept][:, kept]
    # A shift below zero makes the matrix definite where the gear floats; it costs a few more steps elsewhere.
    shift = -((2.0 * pi * 300.0) ** 2) if held == "free" and n <= 1 else 0.0
    solve = factorised(sparse.csc_array(stiffness - shift * mass) if shift else stiffness)
    scale = _multiplicity(n, gear.n_sectors) / gear.n_sectors
    return _Problem(stiffness, mass, kept, n_own, shift, solve, basis, scale)


def _lowest(problem: _Problem, n_shapes: int) -> tuple[FloatArray, ComplexArray]:
    from scipy.sparse.linalg import LinearOperator, eigsh

    stiffness, mass = problem.stiffness, problem.mass
    inverse = LinearOperator(stiffness.shape, matvec=problem.solve, dtype=stiffness.dtype)
    start = np.random.default_rng(1).standard_normal(len(problem.kept)).astype(stiffness.dtype)
    _, vectors = eigsh(stiffness, n_shapes, M=mass, sigma=problem.shift, OPinv=inverse, v0=start, tol=1e-11)
    values, shapes = _rayleigh_ritz(stiffness, mass, vectors)
    full = np.zeros((problem.n_own, n_shapes), dtype=np.complex128)
    full[problem.kept] = shapes * np.sqrt(problem.scale)
    return np.sqrt(np.maximum(values, 0.0)) / (2.0 * pi), _phased(np.asarray(problem.basis @ full))


def _below(
    gear: CyclicGear, n: int, held: Held, wanted: int, limit_hz: float, elastic: bool
) -> list[tuple[float, int, ComplexArray]]:
    """Modes of one nodal diameter below a limit."""
    problem = _problem(gear, n, held)
    n_shapes = min(6, 2 + wanted // 2) if n < 2 else 3
    while True:
        frequencies, shapes = _lowest(problem, n_shapes)
        # Without a limit, more shapes than are wanted in all cannot be needed.
        if frequencies[-1] > limit_hz or n_shapes >= wanted + 2 or n_shapes > shapes.shape[0] // 4:
            break
        n_shapes = 2 * n_shapes
    own = range(len(frequencies))
    least = RIGID_HZ if elastic else -1.0
    return [(float(frequencies[k]), n, shapes[:, k]) for k in own if least < frequencies[k] <= limit_hz]


def _limit(found: list[tuple[float, int, ComplexArray]], wanted: int, n_sectors: int) -> float:
    """Frequency of the last wanted mode so far; infinite while there are too few."""
    repeated = sorted(f for f, n, _ in found for _ in range(_multiplicity(n, n_sectors)))
    return repeated[wanted - 1] if len(repeated) >= wanted else np.inf


def _multiplicity(n: int, n_sectors: int) -> int:
    return 1 if n == 0 or 2 * n == n_sectors else 2


def _rayleigh_ritz(
    stiffness: sparse.csc_array, mass: sparse.csc_array, vectors: np.ndarray[Any, Any]
) -> tuple[FloatArray, np.ndarray[Any, Any]]:
    from scipy.linalg import eigh

    small_k = vectors.conj().T @ (stiffness @ vectors)
    small_m = vectors.conj().T @ (mass @ vectors)
    values, turn = eigh(small_k, small_m)
    return values, vectors @ turn


def _phased(shapes: ComplexArray) -> ComplexArray:
    """Turn each shape so that its largest component is real and positive: the same gear gives the same numbers."""
    top = shapes[np.argmax(np.abs(shapes), axis=0), np.arange(shapes.shape[1])]
    phased: ComplexArray = shapes * (np.abs(top) / top)
    return phased
