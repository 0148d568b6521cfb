"""Causes weighed against each other: evidence on all cycles, and shrink on those that a severity was not fitted to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.gap.start_stop.compare import HALF, Compared
from gearsig.checks import FloatArray
from gearsig.gap.posterior import score_of
from gearsig.gap.start_stop.floors import DriveFloor
from gearsig.gap.start_stop.told import spot_of
from gearsig.gap.start_stop.weigh import Fitted, Predicted, evidences, fit, own_features, shares, shrink
from gearsig.gap.types import Interval, Shrinkage

HELD_OUT = "starts and stops that it was not fitted to"
PLACED = {"root_crack": "tooth", "torque_ripple": "order"}
"""Causes that sit somewhere: a placebo is the same cause elsewhere."""
N_PLACEBOS = 4
NORMAL_90 = 1.645


@dataclass(frozen=True)
class Fold:
    """One half of the cycles to fit to, and the other to check on.

    Parameters
    ----------
    fitted_to : array
        Change of one half, where it is largest.
    held_out : array
        Change of the other half, at the same tooth and order.
    without : array, (n_blocks, n)
        The same without each of its cycles.
    elsewhere : mapping
        Placed cause → changes of the other half at other places, (k, n).
    """

    fitted_to: FloatArray
    held_out: FloatArray
    without: FloatArray
    elsewhere: Mapping[str, FloatArray]


@dataclass(frozen=True)
class Seen:
    """All that weighing needs of one recording.

    Parameters
    ----------
    whole : array
        Change of all cycles.
    folds : tuple of Fold
    predicted : mapping
        Cause → what the simulator predicts.
    with_reference : bool
    scatter : array
        Standard errors of `whole`.
    """

    whole: FloatArray
    folds: tuple[Fold, ...]
    predicted: Mapping[str, Predicted]
    with_reference: bool
    scatter: FloatArray

    def floors(self, whole: DriveFloor, half: DriveFloor) -> tuple[DriveFloor, DriveFloor]:
        """Return the floors of this recording, of its whole and of its halves: wider where its cycles scatter."""
        return whole.widened(self.scatter), half.widened(HALF * self.scatter)


@dataclass(frozen=True)
class Weighed:
    """What came of it.

    Parameters
    ----------
    fits : mapping
        Cause → severity and evidence, on all cycles.
    shares : mapping
        Cause, none, unknown → share of the evidence.
    shrinkages : mapping
        Cause → held-out check.
    """

    fits: Mapping[str, Fitted]
    shares: Mapping[str, float]
    shrinkages: Mapping[str, Shrinkage]

    @property
    def scores(self) -> dict[str, float]:
        """Held-out shrink beyond that of placebos."""
        return {name: score_of(s.shrink.value, s.placebo) for name, s in self.shrinkages.items()}


def seen_of(compared: Compared, predicted: Mapping[str, Predicted]) -> Seen:
    """Reduce a recording to its changes."""
    first, second = compared.halves
    folds = tuple(_fold(compared, a, b) for a, b in ((first, second), (second, first)))
    return Seen(compared.change, folds, predicted, compared.reference is not None, compared.scatter)


def _fold(compared: Compared, ours: tuple[int, ...], theirs: tuple[int, ...]) -> Fold:
    here = compared.now.tell(ours)
    spot = spot_of(here, compared.other)
    blocks = [tuple(c for c in theirs if c != one) for one in theirs] if len(theirs) > 1 else [theirs]
    n_teeth, n_orders = len(here.contact.teeth_um), len(here.ripple)
    steps = [1 + i * max(1, n_teeth // (N_PLACEBOS + 1)) for i in range(N_PLACEBOS)]
    teeth = [replace(spot, tooth=(spot.tooth + step) % n_teeth) for step in steps]
    orders = [replace(spot, order=(spot.order + 3 + 4 * i) % n_orders) for i in range(N_PLACEBOS)]
    return Fold(
        compared.change_in(ours, spot),
        compared.change_in(theirs, spot),
        np.array([compared.change_in(kept, spot) for kept in blocks]),
        {
            "root_crack": np.array([compared.change_in(theirs, s) for s in teeth]),
            "torque_ripple": np.array([compared.change_in(theirs, s) for s in orders]),
        },
    )


def weigh(every: Sequence[Seen], floors: tuple[DriveFloor, DriveFloor]) -> Weighed:
    """Weigh the causes on one or several recordings of one machine.

    Several recordings share a machine and its tolerances: their evidence is averaged, not added.

    Parameters
    ----------
    every : sequence of Seen
    floors : (DriveFloor, DriveFloor)
        Of other drives' whole recordings and halves.
    """
    own = [seen.floors(*floors) for seen in every]
    names = [name for name in every[0].predicted if all(name in seen.predicted for seen in every)]
    pairs = [(seen, whole) for seen, (whole, _) in zip(every, own, strict=True)]
    fits = {name: [fit(seen.predicted[name], seen.whole, whole) for seen, whole in pairs] for name in names}
    logs = [evidences(seen.whole, whole, [fits[n][i] for n in names]) for i, (seen, whole) in enumerate(pairs)]
    mean = {name: float(np.mean([log[name] for log in logs])) for name in logs[0]}
    folds = [(seen, fold, half) for seen, (_, half) in zip(every, own, strict=True) for fold in seen.folds]
    found = {name: _shrinkage(name, folds) for name in names}
    best = {name: max(fits[name], key=lambda one: one.log_evidence) for name in names}
    return Weighed(best, shares(mean), found)


def _shrinkage(name: str, folds: Sequence[tuple[Seen, Fold, DriveFloor]]) -> Shrinkage:
    """Fit to one half, check on the other, and the other way round; the mean of both."""
    values, placebos, spread = [], [], []
    for seen, fold, floor in folds:
        fitted = fit(seen.predicted[name], fold.fitted_to, floor)
        own = own_features(fitted.predicted, fold.held_out, floor)
        values.append(shrink(fold.held_out, fitted.predicted, floor, own))
        spread.append([shrink(row, fitted.predicted, floor, own) for row in fold.without])
        placebos.append(_placebo(name, fold, floor, own, fitted.predicted))
    before, after, taken, slope = (_mean([v[i] for v in values]) for i in range(4))
    half = [NORMAL_90 * _error(spread, i) for i in range(3)]
    return Shrinkage(
        Interval(before, max(0.0, before - half[0]), before + half[0]),
        Interval(after, max(0.0, after - half[1]), after + half[1]),
        Interval(taken, taken - half[2], min(1.0, taken + half[2])),
        slope,
        float(np.mean(placebos)),
        HELD_OUT,
        N_PLACEBOS if name in PLACED else 0,
    )


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")


def _placebo(name: str, fold: Fold, floor: DriveFloor, own: NDArray[np.intp], predicted: FloatArray) -> float:
    """Return the largest shrink of the same cause elsewhere; 0 where it sits nowhere."""
    if name not in PLACED:
        return 0.0
    return max(float(shrink(row, predicted, floor, own)[2]) for row in fold.elsewhere[name])


def _error(spread: Sequence[Sequence[tuple[float, ...]]], i: int) -> float:
    """Return the standard error of the mean over the folds, by the jackknife within each."""
    variances = []
    for rows in spread:
        values = np.array([row[i] for row in rows])
        n = len(values)
        variances.append((n - 1.0) * float(np.var(values)) if n > 1 else 0.25)
    return float(np.sqrt(np.sum(variances)) / len(spread))
