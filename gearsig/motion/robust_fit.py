"""Nonlinear least squares without far samples, with a covariance that knows the noise's colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.backlash import dependence

FAR = 5.0
"""Standard deviations beyond which a sample is left out: flanks that just part, counts that slipped."""
MOST_ROUNDS = 8
ALIKE = 0.9
N_BLOCKS = 8
"""Of the jackknife."""


@dataclass(frozen=True)
class RobustFit:
    """A solved problem.

    Parameters
    ----------
    names : tuple of str
    values : array, (n,)
    covariance : array, (n, n)
        Of the values: residual power times (JᵀJ)⁻¹, times the residuals' dependence on their neighbours; wider where
        leaving out an eighth of the record moves a value by more than that.
    condition : float
        Largest over smallest singular value of the Jacobian, its columns scaled to length 1.
    n_samples : int
        That were kept.
    scatter : float
        Of their residuals.
    """

    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    condition: float
    n_samples: int
    scatter: float

    def value(self, name: str) -> float:
        """Return one value."""
        return float(self.values[self.names.index(name)])

    def deviation(self, name: str) -> float:
        """Return its standard deviation."""
        i = self.names.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))

    def most_like(self, name: str) -> tuple[str, float]:
        """Return the parameter whose estimate nearly goes with this one, and their correlation; no name: none does."""
        i = self.names.index(name)
        deviations = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        if not np.isfinite(deviations[i]):
            return "", 0.0
        correlation = self.covariance[i] / (deviations[i] * deviations)
        correlation[i] = 0.0
        j = int(np.argmax(np.abs(correlation)))
        return (self.names[j], float(correlation[j])) if abs(correlation[j]) > ALIKE else ("", 0.0)


def robust_fit(
    residuals: Callable[[FloatArray], FloatArray],
    first: FloatArray,
    scale: FloatArray,
    wanted: NDArray[np.bool_],
    names: tuple[str, ...],
    *,
    least_scatter: float = 0.0,
    with_jackknife: bool = True,
) -> RobustFit:
    """Minimise the squares of the wanted residuals; leave out what is far off, and again.

    Parameters
    ----------
    residuals : callable
        Values of the parameters, (n,) → (n_samples,).
    first, scale : array, (n,)
        Where to begin, and the parameters' sizes.
    wanted : array of bool, (n_samples,)
    names : tuple of str
    least_scatter : float
        What the equation itself leaves out: a sample nearer than five times that is never left out.
    with_jackknife : bool
        Whether the covariance is widened by it; it costs eight further solutions.

    Raises
    ------
    RefusalError
        If fewer samples are left than five times the parameters.
    """
    keep: NDArray[np.bool_] = wanted
    x: FloatArray = first / scale
    for _ in range(MOST_ROUNDS):
        _check_samples(keep, len(names))
        x, jacobian = _solve(residuals, x, scale, keep)
        left = residuals(x * scale)
        scatter = 1.4826 * float(np.median(np.abs(left[keep])))
        again = wanted & (np.abs(left) <= FAR * max(scatter, least_scatter))
        if np.array_equal(again, keep):
            break
        keep = again
    _check_samples(keep, len(names))
    lengths = np.linalg.norm(jacobian, axis=0)
    singular = np.linalg.svd(jacobian / np.where(lengths > 0.0, lengths, 1.0), compute_uv=False)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    inverse[lengths == 0.0, lengths == 0.0] = np.inf  # nothing depends on it: nothing is known of it
    power = float(np.mean(left[keep] ** 2)) * dependence(left[keep])
    covariance = np.where(inverse == 0.0, 0.0, inverse * power)
    widened: FloatArray = np.ones(len(x))
    if with_jackknife:
        widened = _widening(residuals, x, scale, keep, np.sqrt(np.diag(covariance)))
    return RobustFit(
        names,
        x * scale,
        covariance * np.outer(scale * widened, scale * widened),
        float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf"),
        int(np.sum(keep)),
        scatter,
    )


def _solve(
    residuals: Callable[[FloatArray], FloatArray], x: FloatArray, scale: FloatArray, keep: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Solution and Jacobian for the samples that are kept, parameters in their scales."""
    from scipy.optimize import least_squares

    def kept(values: FloatArray) -> FloatArray:
        left: FloatArray = residuals(values * scale)[keep]
        return left

    found = least_squares(kept, x, method="lm", x_scale="jac")
    return np.asarray(found.x), np.asarray(found.jac)


def _widening(
    residuals: Callable[[FloatArray], FloatArray],
    x: FloatArray,
    scale: FloatArray,
    keep: NDArray[np.bool_],
    deviation: FloatArray,
) -> FloatArray:
    """Factors, 1 or more, by which the values move more than they should when a part of the record is left out.

    Delete-a-block jackknife: an equation that holds here and not there shows, which residuals alone hide.

    Source: H. R. Künsch, The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17
    (1989).
    """
    blocks = np.array_split(np.flatnonzero(keep), N_BLOCKS)
    moved = []
    for block in blocks:
        rows = keep.copy()
        rows[block] = False
        moved.append(_solve(residuals, x, scale, rows)[0])
    spread = np.sqrt((N_BLOCKS - 1) / N_BLOCKS * np.sum((np.array(moved) - np.mean(moved, axis=0)) ** 2, axis=0))
    safe = np.where(np.isfinite(deviation) & (deviation > 0.0), deviation, np.inf)
    factors: FloatArray = np.maximum(1.0, spread / safe)
    return factors


def _check_samples(keep: NDArray[np.bool_], n_parameters: int) -> None:
    if np.sum(keep) < 5 * n_parameters:
        raise RefusalError(
            f"{np.sum(keep)} samples are left for {n_parameters} parameters", remedy="record longer, under load"
        )
