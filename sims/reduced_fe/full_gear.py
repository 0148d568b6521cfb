"""The matrices of the whole gear: what cyclic symmetry saves, kept to check it and for gears whose sectors differ."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from gearsig.checks import FloatArray, count
from sims.reduced_fe.cyclic import CyclicGear, Folded, factorised
from sims.reduced_fe.memory import check_memory, full_bytes


def full_matrices(gear: CyclicGear) -> tuple[sparse.csc_array, sparse.csc_array]:
    """Stiffness and mass of all sectors, in cylindrical components; sector k has the degrees of freedom from k·n_own.

    Springs at the hub are not in them.
    """
    return _circulant(gear.stiffness, gear.n_sectors), _circulant(gear.mass, gear.n_sectors)


def full_modes(gear: CyclicGear, n_modes: int = 20) -> tuple[FloatArray, FloatArray]:
    """Lowest frequencies (Hz) and mass-normalised modes (n_dof, n_modes) of the free gear from its whole matrices.

    Raises
    ------
    InputError
        If the memory does not suffice; `cyclic_modes` needs a hundredth of it.
    """
    from scipy.sparse.linalg import LinearOperator, eigsh

    wanted = count(n_modes, "n_modes")
    check_memory(full_bytes(gear.mesh.n_dof))
    stiffness, mass = full_matrices(gear)
    shift = -((2.0 * np.pi * 300.0) ** 2)
    inverse = LinearOperator(stiffness.shape, matvec=factorised(sparse.csc_array(stiffness - shift * mass)))
    start = np.random.default_rng(1).standard_normal(stiffness.shape[0])
    _, found = eigsh(stiffness, wanted, M=mass, sigma=shift, OPinv=inverse, v0=start, tol=1e-12)
    small = found.T @ (stiffness @ found)
    from scipy.linalg import eigh

    values, turn = eigh(small, found.T @ (mass @ found))
    return np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi), found @ turn


def _circulant(folded: Folded, n_sectors: int) -> sparse.csc_array:
    around = sparse.csr_array(np.roll(np.eye(n_sectors), 1, axis=1))  # row k, column k + 1
    one = sparse.eye_array(n_sectors, format="csr")
    coupled = sparse.kron(around, folded.next, format="csr")
    return sparse.csc_array(sparse.kron(one, folded.own, format="csr") + coupled + coupled.T)
