"""A sector is its own mirror image: in the right coordinates its Hermitian matrices are real."""

from __future__ import annotations

from functools import cached_property
from math import cos, sin
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.reduced_fe.sector_plane import IntArray


class RealFolded(NamedTuple):
    """A sector's matrix in real coordinates: K₀ + cos(φ/2) K₁ + sin(φ/2) K₂."""

    constant: sparse.csc_array
    cosine: sparse.csc_array
    sine: sparse.csc_array

    def at(self, phase_rad: float) -> sparse.csc_array:
        """Return the matrix for a phase from sector to sector."""
        half = phase_rad / 2.0
        return sparse.csc_array(self.constant + cos(half) * self.cosine + sin(half) * self.sine)


class SectorMirror:
    """Coordinates in which the matrices of every nodal diameter are real and symmetric.

    A mirror at the middle of the tooth turns a motion U of nodal diameter n into one of −n, whose conjugate is one of n
    again: A U = conj(mirror U). K and M commute with A, so that they are real in a basis of motions with A U = U:

    - two nodes that are each other's image: (1, s)/√2 and (i, −is)/√2,
    - a node in the middle plane: 1 for s = 1, i for s = −1,
    - a node on the low side, whose image on the high side moves by e^{iφ} of it: the same times e^{−iφ/2},

    with s = 1 for radial and axial, −1 for tangential motion. Real factors take a third of the time of complex ones.

    Parameters
    ----------
    points_m : array, (n_own, 3)
        Own nodes of the sector.
    low_side : array of int
        Which of them lie on the low side.

    Raises
    ------
    InputError
        If a node has no image: the sector is not symmetric.
    """

    def __init__(self, points_m: FloatArray, low_side: IntArray) -> None:
        self._n = len(points_m)
        self._on_low = np.zeros(self._n, dtype=bool)
        self._on_low[low_side] = True
        found = cKDTree(points_m).query(points_m * np.array([1.0, -1.0, 1.0]))
        distance, image = np.array(found[0], dtype=np.float64), np.array(found[1], dtype=np.int64)
        image[self._on_low] = np.flatnonzero(self._on_low)
        distance[self._on_low] = 0.0
        if distance.max() > 1e-9 or np.any(image[image] != np.arange(self._n)):
            raise InputError("the sector's mesh is not symmetric about the middle of its tooth")
        self._image = image

    @cached_property
    def plain(self) -> sparse.csc_array:
        """T₀: the basis without the phase of the low side."""
        rows, columns, values = [], [], []
        nodes = np.arange(self._n)
        alone = self._image == nodes
        first, second = nodes[nodes < self._image], self._image[nodes < self._image]
        half = np.sqrt(0.5)
        for component, s in enumerate((1.0, -1.0, 1.0)):
            a, b, c = 3 * first + component, 3 * second + component, 3 * nodes[alone] + component
            for row, column, value in (
                (a, a, half),
                (b, a, s * half),
                (a, b, 1j * half),
                (b, b, -1j * s * half),
                (c, c, 1.0 if s > 0.0 else 1j),
            ):
                rows.append(row)
                columns.append(column)
                values.append(np.full(len(row), value, dtype=np.complex128))
        places, size = (np.concatenate(rows), np.concatenate(columns)), 3 * self._n
        return sparse.csc_array(sparse.coo_array((np.concatenate(values), places), shape=(size, size)))

    def basis(self, phase_rad: float) -> sparse.csc_array:
        """T, unitary: U = T x, and Tᴴ K T is real; column k stands for degree of freedom k or its pair."""
        on_low = np.repeat(self._on_low.astype(np.float64), 3)
        return sparse.csc_array(sparse.diags_array(np.exp(-0.5j * phase_rad * on_low)) @ self.plain)

    def real(self, own: sparse.csr_array, following: sparse.csr_array) -> RealFolded:
        """Tᴴ K T of K = A + e^{iφ} B + e^{−iφ} Bᵀ, for all φ at once.

        In the basis, what couples the low side to its own sector gets e^{−iφ/2}, what couples it to the sector before
        e^{iφ/2}, the rest no phase: K̃ = K₀ + cos(φ/2) K₁ + sin(φ/2) K₂.
        """
        low = np.repeat(self._on_low.astype(np.float64), 3)
        on_low, inside = sparse.diags_array(low), sparse.diags_array(1.0 - low)
        to_own, to_previous = inside @ own @ on_low, inside @ following @ on_low
        rest = inside @ own @ inside + on_low @ own @ on_low
        both, apart = to_own + to_previous, 1j * (to_previous - to_own)
        return RealFolded(self._turned(rest), self._turned(both + both.T), self._turned(apart + apart.conj().T))

    def _turned(self, matrix: sparse.csr_array) -> sparse.csc_array:
        turned = sparse.csc_array(self.plain.conj().T @ matrix @ self.plain)
        data = np.ascontiguousarray(turned.data.real)
        data[np.abs(data) < 1e-15 * np.abs(data).max()] = 0.0
        real = sparse.csc_array((data, turned.indices, turned.indptr), shape=turned.shape)
        real.eliminate_zeros()
        return real
