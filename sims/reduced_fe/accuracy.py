"""How well a reduced gear keeps the modes of the full model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

SAME_HZ = 1e-3
"""Relative: modes of the full model this close are one subspace; within it errors of this size turn the vectors."""


@dataclass(frozen=True)
class ReductionAccuracy:
    """Elastic modes of the full and of the reduced model, side by side.

    Parameters
    ----------
    full_hz, reduced_hz : array, (n,)
    subspace_mac : array, (n,)
        Least squared cosine, weighted by mass, between the subspace of equal frequencies (to 0.1 %) that a full mode
        belongs to and the reduced modes of that frequency: 1 where the reduced model holds it.
    rigid_hz : array, (6,)
        Of the reduced model; 0 if nothing holds the gear.
    """

    full_hz: FloatArray
    reduced_hz: FloatArray
    subspace_mac: FloatArray
    rigid_hz: FloatArray

    @property
    def errors(self) -> FloatArray:
        """Relative errors of the frequencies."""
        relative: FloatArray = self.reduced_hz / self.full_hz - 1.0
        return relative

    @property
    def worst_error(self) -> float:
        """Largest of them without sign."""
        return float(np.abs(self.errors).max())

    @property
    def least_mac(self) -> float:
        """Of all modes compared."""
        return float(self.subspace_mac.min())

    def table(self) -> str:
        """Return the comparison as text, a line for each mode."""
        head = f"{'full Hz':>12} {'reduced Hz':>12} {'error %':>10} {'subspace MAC':>14}"
        rows = zip(self.full_hz, self.reduced_hz, 100.0 * self.errors, self.subspace_mac, strict=True)
        return "\n".join([head, *(f"{f:12.3f} {r:12.3f} {e:10.5f} {m:14.9f}" for f, r, e, m in rows)])


def matched(
    full_hz: FloatArray, reduced_hz: FloatArray, products: FloatArray, *, rigid_hz: FloatArray
) -> ReductionAccuracy:
    """Compare modes place by place.

    Parameters
    ----------
    full_hz : array, (n,)
        Ascending.
    reduced_hz : array, (m,)
        Elastic ones, ascending, m ≥ n.
    products : array, (n, m)
        Mass products of full and reduced modes, both mass-normalised.
    rigid_hz : array

    Source: R. J. Allemang, The modal assurance criterion – twenty years of use and abuse, Sound and Vibration (2003),
    for the criterion; for subspaces, the squared cosines of their principal angles.
    """
    n = len(full_hz)
    mac = np.empty(n)
    start = 0
    while start < n:
        end = start + 1
        while end < n and full_hz[end] <= full_hz[start] * (1.0 + SAME_HZ):
            end += 1
        near = np.abs(reduced_hz / np.mean(full_hz[start:end]) - 1.0) < SAME_HZ
        near[start:end] = True
        cosines = np.linalg.svd(products[start:end, near], compute_uv=False)
        mac[start:end] = cosines[-1] ** 2
        start = end
    return ReductionAccuracy(full_hz, reduced_hz[:n], mac, rigid_hz)
