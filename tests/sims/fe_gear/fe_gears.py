"""Small gears for tests of the finite elements."""

from functools import cache

import numpy as np
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse.linalg import LinearOperator, eigsh

from gearsig.checks import FloatArray
from sims.fe_gear import (
    CyclicGear,
    GearBlank,
    MeshSize,
    ReducedGear,
    ReductionPlan,
    factorised,
    reduce_gear,
    sector_mesh,
)
from sims.mesh import GearGeometry

SMALL = GearBlank(GearGeometry(12, 3.0, profile_shift=0.4, face_width_mm=12.0, bore_radius_mm=6.0))
COARSE = MeshSize(2, 1, 3, 1, 1, 1)
PAPER = GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0))
"""The 50-tooth gear of the published pair."""


@cache
def small_cyclic() -> CyclicGear:
    return CyclicGear(sector_mesh(SMALL, COARSE))


@cache
def small_reduced() -> ReducedGear:
    return reduce_gear(SMALL, ReductionPlan(COARSE, n_modes=24, n_heights=4, n_slices=3, n_offsets=3))


def full_matrices(gear: CyclicGear) -> tuple[sparse.csc_array, sparse.csc_array]:
    """Stiffness and mass of all sectors without springs at the hub; sector k's degrees of freedom begin at k·n_own."""
    around = sparse.csr_array(np.roll(np.eye(gear.n_sectors), 1, axis=1))  # row k, column k + 1
    one = sparse.eye_array(gear.n_sectors, format="csr")
    matrices = []
    for folded in (gear.stiffness, gear.mass):
        coupled = sparse.kron(around, folded.next, format="csr")
        matrices.append(sparse.csc_array(sparse.kron(one, folded.own, format="csr") + coupled + coupled.T))
    return matrices[0], matrices[1]


def full_modes(gear: CyclicGear, n_modes: int = 20) -> tuple[FloatArray, FloatArray]:
    """Lowest frequencies (Hz) and mass-normalised modes (n_dof, n_modes) of the free gear from its whole matrices."""
    stiffness, mass = full_matrices(gear)
    shift = -((2.0 * np.pi * 300.0) ** 2)
    inverse = LinearOperator(stiffness.shape, matvec=factorised(sparse.csc_array(stiffness - shift * mass)))
    start = np.random.default_rng(1).standard_normal(stiffness.shape[0])
    _, shapes = eigsh(stiffness, n_modes, M=mass, sigma=shift, OPinv=inverse, v0=start, tol=1e-12)
    values, turn = eigh(shapes.T @ (stiffness @ shapes), shapes.T @ (mass @ shapes))
    return np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), shapes @ turn
