"""Which cause explains a change: its severity, the evidence for it, and how far it shrinks what was not fitted."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap._posterior import GapCalibration, score_of
from gearsig.gap._types import NONE, UNKNOWN, Interval, Shrinkage
from gearsig.gap.start_stop._features import NAMES

# --------------------
# How far healthy drives lie from what they are compared with: the structural floor of start–stop changes.
# --------------------


FLOORS_FILE = Path(__file__).with_name("floors.json")
MIN_DB, MIN_SIGNED_DB = 0.15, 0.87
"""Of a scale: 2 % of a level; a fifth of the step of what is ordinarily near zero."""
LEVELS = ("play", "deflection", "inertia", "load_friction", "impact", "contact_scatter", "load_scatter")
FLOOR = 1.96
"""Scales of the middle of the distribution: 19 of 20 healthy machines stay below."""
TAIL = 4.0
"""Degrees of freedom: a feature lies far off oftener than a normal one."""
SUM_POWER = 4.0
INNER, NORMAL_80 = 0.8, 1.2816
N_BISECTIONS = 40


@dataclass(frozen=True)
class DriveFloor:
    """Middle and scale of each change of healthy drives.

    Parameters
    ----------
    centre, scale : array, (n,) by `NAMES`
        dB.
    whole : float
        Size of the whole change that one healthy drive in twenty exceeds.
    """

    centre: FloatArray
    scale: FloatArray
    whole: float

    @classmethod
    def of_healthy(cls, rows: FloatArray, scatters: FloatArray | None = None) -> DriveFloor:
        """Return the floor of a table of changes of healthy drives, (n_drives, n); nan where a change is not known.

        The scale is the half width of the middle 80 % over 1.28: what lies far off is the tail's, see `log_density`.
        What a recording's own cycles scatter by is taken out of it: coarse encoders are no property of other drives.

        Parameters
        ----------
        rows : array, (n_drives, n)
        scatters : array or None, (n_drives, n)
            Standard errors of the changes; None: none.
        """
        table = np.asarray(rows, dtype=np.float64)
        errors = np.zeros_like(table) if scatters is None else np.nan_to_num(scatters)
        known = np.isfinite(table)
        centre, scale = np.zeros(table.shape[1]), np.full(table.shape[1], 6.0)
        for i in range(table.shape[1]):
            values, own = table[known[:, i], i], errors[known[:, i], i]
            if len(values) >= 5:
                least = MIN_DB if NAMES[i] in LEVELS else MIN_SIGNED_DB
                centre[i], scale[i] = _centre(values, own), least
                scale[i] = max(_scale(values - centre[i], own), least)
        sizes = [_soft((r - centre) / (FLOOR * np.hypot(scale, e))) for r, e in zip(table, errors, strict=True)]
        return cls(centre, scale, float(np.quantile(sizes, 0.95)))

    def widened(self, scatter: FloatArray) -> DriveFloor:
        """Return the floor of a recording whose changes have standard errors of their own, (n,)."""
        return replace(self, scale=np.hypot(self.scale, np.nan_to_num(scatter)))

    def size(self, change: FloatArray) -> float:
        """Return the size of a whole change; 1: one healthy drive in twenty is that far."""
        return _soft((change - self.centre) / (FLOOR * self.scale)) / self.whole

    def log_density(self, change: FloatArray, predicted: FloatArray, widen: FloatArray | float = 0.0) -> FloatArray:
        """Return the logarithm of Student's density of each change around centre + predicted, (n,); 0 where unknown.

        Parameters
        ----------
        change, predicted : array, (n,)
        widen : array or float
            dB that the scale is widened by: an error of the prediction.
        """
        scale = np.hypot(self.scale, widen)
        z = np.nan_to_num((change - self.centre - predicted) / scale)
        logs: FloatArray = np.where(
            np.isfinite(change), -0.5 * (TAIL + 1.0) * np.log1p(z * z / TAIL) - np.log(scale / self.scale), 0.0
        )
        return logs

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values by name."""
        return {
            "centre_db": dict(zip(NAMES, (round(float(v), 4) for v in self.centre), strict=True)),
            "scale_db": dict(zip(NAMES, (round(float(v), 4) for v in self.scale), strict=True)),
            "whole": round(self.whole, 4),
        }

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> DriveFloor:
        """Return what `to_dict` made."""
        centre, scale = (np.array([float(found[key][name]) for name in NAMES]) for key in ("centre_db", "scale_db"))
        return cls(centre, scale, float(found["whole"]))


def _centre(values: FloatArray, errors: FloatArray) -> float:
    """Return the median, precise values counting more."""
    order = np.argsort(values)
    spread = 1.4826 * float(np.median(np.abs(values - np.median(values))))
    weights = np.cumsum(1.0 / (spread**2 + errors[order] ** 2 + 1e-6))
    return float(values[order][np.searchsorted(weights, 0.5 * weights[-1])])


def _scale(distances: FloatArray, errors: FloatArray) -> float:
    """Return the s at which four of five distances are below 1.28 √(s² + e²); 0 where the errors alone are enough."""
    low, high = 0.0, float(np.max(np.abs(distances))) + 1e-9
    for _ in range(N_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = np.quantile(np.abs(distances) / np.hypot(middle, errors + 1e-12), INNER)
        low, high = (middle, high) if inside > NORMAL_80 else (low, middle)
    return high


def _soft(normalised: FloatArray) -> float:
    z = np.abs(normalised[np.isfinite(normalised)])
    return float(np.sum(z**SUM_POWER) ** (1.0 / SUM_POWER)) if len(z) else 0.0


@cache
def load_floors() -> Mapping[str, Any]:
    """Return the file that comes with this version."""
    found: dict[str, Any] = json.loads(FLOORS_FILE.read_text(encoding="utf-8"))
    return found


def load_floor(*, with_reference: bool, part: str = "whole") -> DriveFloor:
    """Return the floor of whole recordings, or of the "half" of their cycles."""
    return DriveFloor.from_dict(load_floors()["with_reference" if with_reference else "without_reference"][part])


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
class FittedDriveCause:
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


def fit(cause: Predicted, change: FloatArray, floor: DriveFloor) -> FittedDriveCause:
    """Fit a cause's severity to a change; what would change less than healthy machines differ by is none, not a cause.

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
    return FittedDriveCause(
        cause.name,
        Interval(float(grid[best]), float(inside.min()), float(inside.max())),
        predicted[best],
        evidence,
        bool(best == len(grid) - 1),
    )


def evidences(change: FloatArray, floor: DriveFloor, fits: Sequence[FittedDriveCause]) -> dict[str, float]:
    """Return the logarithm of the evidence of every cause, of none and of unknown.

    Unknown: one change, whichever, is far wider than healthy machines', or two, or all of them.
    """
    healthy = floor.log_density(change, np.zeros(len(change)))
    known = np.flatnonzero(np.isfinite(change))
    wide = floor.log_density(change, np.zeros(len(change)), WIDE * floor.scale)
    gains = (wide - healthy)[known]
    total = float(np.sum(healthy))
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


# --------------------
# Causes against each other: evidence on all cycles, and shrink on those that a severity was not fitted to.
# --------------------


HALF = float(np.sqrt(2.0))
"""By which half of the cycles scatter more."""
HELD_OUT = "starts and stops that it was not fitted to"
PLACED = ("root_crack", "torque_ripple")
"""Causes that sit somewhere: a placebo is the same cause elsewhere."""
N_PLACEBOS = 4
NORMAL_90 = 1.645


@dataclass(frozen=True)
class CycleFold:
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
class DriveEvidence:
    """All that weighing needs of one recording.

    Parameters
    ----------
    whole : array
        Change of all cycles.
    folds : tuple of CycleFold
    predicted : mapping
        Cause → what the simulator predicts.
    with_reference : bool
    scatter : array
        Standard errors of `whole`.
    """

    whole: FloatArray
    folds: tuple[CycleFold, ...]
    predicted: Mapping[str, Predicted]
    with_reference: bool
    scatter: FloatArray

    def floors(self, whole: DriveFloor, half: DriveFloor) -> tuple[DriveFloor, DriveFloor]:
        """Return the floors of this recording, of its whole and of its halves: wider where its cycles scatter."""
        return whole.widened(self.scatter), half.widened(HALF * self.scatter)


@dataclass(frozen=True)
class DriveAttribution:
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

    fits: Mapping[str, FittedDriveCause]
    shares: Mapping[str, float]
    shrinkages: Mapping[str, Shrinkage]

    @property
    def scores(self) -> dict[str, float]:
        """Held-out shrink beyond that of placebos."""
        return {name: score_of(s.shrink.value, s.placebo) for name, s in self.shrinkages.items()}


def attribute_drive(every: Sequence[DriveEvidence], floors: tuple[DriveFloor, DriveFloor]) -> DriveAttribution:
    """Weigh the causes on one or several recordings of one machine.

    Several recordings share a machine and its tolerances: their evidence is averaged, not added.

    Parameters
    ----------
    every : sequence of DriveEvidence
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
    return DriveAttribution(best, shares(mean), found)


def _shrinkage(name: str, folds: Sequence[tuple[DriveEvidence, CycleFold, DriveFloor]]) -> Shrinkage:
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


def _placebo(name: str, fold: CycleFold, floor: DriveFloor, own: NDArray[np.intp], predicted: FloatArray) -> float:
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


# --------------------
# From evidence and held-out shrink to calibrated probabilities of start–stop causes.
# --------------------


def load_drive_calibration(*, with_reference: bool) -> GapCalibration:
    """Return the calibration that comes with this version; its first shares are those of the evidence."""
    return GapCalibration.from_mapping(load_floors()["with_reference" if with_reference else "without_reference"])


def is_drive_calibrated() -> bool:
    """Whether it was fitted to blind cases."""
    return int(load_floors()["provenance"]["n_cases"]) > 0
