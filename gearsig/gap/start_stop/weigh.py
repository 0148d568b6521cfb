"""Which cause explains a change: its severity, the evidence for it, and how far it shrinks what was not fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.start_stop.floors import FLOOR, DriveFloor
from gearsig.gap.types import NONE, UNKNOWN, Interval

MODEL_ERROR = 0.25
"""Of a predicted change: another machine of the same drawing answers by that much more or less."""
DIRECT_ERROR = 0.08
"""The same of what the severity itself is measured by: 100 µm more play are 100 µm on any machine, as far as straight
lines between the severities that were simulated follow it."""
CLEAR = 1.0
"""Floors that a change must have for its cause to be one."""
FREE = 6.0
"""Scales by which what a cause may move is widened."""
N_FINE = 192
WIDE, ALL_WIDE = 10.0, 4.0
"""Scales by which something unknown moves one change, or all of them."""
WORST = -1.0
"""Shrink that is not told from a worse one: the gap doubles in power."""
INTERVAL_LOG = 1.353
"""Half of 1.645²: how far the logarithm of the likelihood falls at the ends of a 90 % interval."""
OWN_PART = 1.0
"""Floors that a predicted change must have to be one of the effect's own."""


@dataclass(frozen=True)
class Predicted:
    """What the simulator predicts of one cause.

    Parameters
    ----------
    name : str
    severities : array, (k,)
        Rising; 0 is not in it.
    changes : array, (k, n)
        dB by `NAMES`.
    may_move : array of bool, (n,)
        Changes that the cause moves in a way that the simulator does not know.
    direct : array of bool, (n,), or None
        Changes that measure the severity itself, if there are any.
    """

    name: str
    severities: FloatArray
    changes: FloatArray
    may_move: NDArray[np.bool_]
    direct: NDArray[np.bool_] | None = None

    def fine(self) -> tuple[FloatArray, FloatArray]:
        """Return many severities and their changes: straight lines between those simulated, and to 0."""
        knots = np.concatenate([self.severities, [0.0]])
        order = np.argsort(knots)
        knots = knots[order]
        values = np.concatenate([self.changes, np.zeros((1, self.changes.shape[1]))])[order]
        low, high = knots[0], knots[-1]
        grid = np.concatenate([-np.geomspace(0.05, 1.0, N_FINE)[::-1] * abs(low)] if low < 0 else [np.zeros(0)])
        grid = np.concatenate([grid, np.geomspace(0.05, 1.0, N_FINE) * high])
        found = np.stack([np.interp(grid, knots, values[:, i]) for i in range(values.shape[1])], axis=1)
        return grid, found


@dataclass(frozen=True)
class Fitted:
    """A cause fitted to a change.

    Parameters
    ----------
    name : str
    severity : Interval
        90 %.
    predicted : array, (n,)
        At that severity.
    log_evidence : float
        Logarithm of the likelihood, averaged over severities on a logarithmic scale.
    is_at_end : bool
        Whether the strongest severity that was simulated fits best.
    """

    name: str
    severity: Interval
    predicted: FloatArray
    log_evidence: float
    is_at_end: bool


def fit(cause: Predicted, change: FloatArray, floor: DriveFloor) -> Fitted:
    """Fit a cause's severity to a change; what would change less than sound machines differ by is none, not a cause.

    How much is read from what measures it directly, as far as anything does; whether it is this cause, from all changes
    with the same margin, since machines of one drawing answer differently.
    """
    grid, predicted = cause.fine()
    sizes = np.max(np.abs(predicted) / (FLOOR * floor.scale), axis=1, initial=0.0)
    clear = sizes >= min(CLEAR, float(sizes.max(initial=0.0)))
    grid, predicted = grid[clear], predicted[clear]
    free = np.where(cause.may_move, FREE * floor.scale, 0.0)

    def likelihoods(error: float | FloatArray) -> FloatArray:
        return np.array([float(np.sum(floor.log_density(change, p, error * np.abs(p) + free))) for p in predicted])

    logs = likelihoods(MODEL_ERROR)
    top = float(logs.max())
    evidence = top + float(np.log(np.mean(np.exp(logs - top))))
    if cause.direct is not None and np.any(cause.direct & np.isfinite(change)):
        logs = likelihoods(np.where(cause.direct, DIRECT_ERROR, MODEL_ERROR))
    best = int(np.argmax(logs))
    inside = grid[logs > logs[best] - INTERVAL_LOG]
    return Fitted(
        cause.name,
        Interval(float(grid[best]), float(inside.min()), float(inside.max())),
        predicted[best],
        evidence,
        bool(best == len(grid) - 1),
    )


def evidences(change: FloatArray, floor: DriveFloor, fits: Sequence[Fitted]) -> dict[str, float]:
    """Return the logarithm of the evidence of every cause, of none and of unknown.

    Unknown: one change, whichever, is far wider than sound machines', or two, or all of them.
    """
    sound = floor.log_density(change, np.zeros(len(change)))
    known = np.flatnonzero(np.isfinite(change))
    wide = floor.log_density(change, np.zeros(len(change)), WIDE * floor.scale)
    gains = (wide - sound)[known]
    total = float(np.sum(sound))
    alone = total + float(np.log(np.mean(np.exp(np.minimum(gains, 200.0))))) if len(known) else total
    every = float(np.sum(floor.log_density(change, np.zeros(len(change)), ALL_WIDE * floor.scale)))
    pairs = [a + b for i, a in enumerate(gains) for b in gains[:i]]
    both = total + float(np.log(np.mean(np.exp(np.minimum(pairs, 200.0))))) if pairs else alone
    found = {one.name: one.log_evidence for one in fits}
    return found | {NONE: total, UNKNOWN: float(np.logaddexp.reduce([alone, both, every]) - np.log(3.0))}


def shares(logs: Mapping[str, float]) -> dict[str, float]:
    """Return probabilities in proportion to the evidence."""
    top = max(logs.values())
    weights = {name: float(np.exp(value - top)) for name, value in logs.items()}
    whole = sum(weights.values())
    return {name: w / whole for name, w in weights.items()}


def own_features(predicted: FloatArray, change: FloatArray, floor: DriveFloor) -> NDArray[np.intp]:
    """Return the places of changes that the effect predicts to exceed the floor; its largest where none does."""
    sizes = np.where(np.isfinite(change), np.abs(predicted) / (FLOOR * floor.scale), -1.0)
    own: NDArray[np.intp] = np.flatnonzero(sizes >= OWN_PART)
    return own if len(own) else np.array([int(np.argmax(sizes))], dtype=np.intp)


def shrink(
    change: FloatArray, predicted: FloatArray, floor: DriveFloor, own: NDArray[np.intp]
) -> tuple[float, float, float, float]:
    """Return root mean squares before and after in floors, 1 − after²/before², and the slope, on an effect's features.

    Parameters
    ----------
    change : array
        Of cycles that the severity was not fitted to.
    """
    z = ((change - floor.centre) / (FLOOR * floor.scale))[own]
    p = (predicted / (FLOOR * floor.scale))[own]
    known = np.isfinite(z)
    z, p = z[known], p[known]
    if not len(z):
        return 0.0, 0.0, 0.0, float("nan")
    before, after = float(np.sqrt(np.mean(z**2))), float(np.sqrt(np.mean((z - p) ** 2)))
    slope = float(np.sum(z * p) / np.sum(p * p)) if np.any(p) else float("nan")
    return before, after, max(1.0 - (after / before) ** 2, WORST) if before > 0.0 else 0.0, slope
