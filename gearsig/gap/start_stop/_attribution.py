"""Attribution of a start–stop change: each cause's severity, its evidence, and how far it shrinks the gap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap._attribution import Attribution, GapCalibration, calibration_values
from gearsig.gap._features import jackknife_variance
from gearsig.gap._floors import FLOOR_IN_DEVIATIONS
from gearsig.gap._report import NONE, UNKNOWN, Interval, Shrinkage, shares_of
from gearsig.gap.start_stop._cycles import FEATURES, NAMES
from gearsig.motion import median_deviation
from gearsig.severity import CRACK, NORMAL_90

FLOORS_FILE = Path(__file__).with_name("floors.json")
HALF = float(np.sqrt(2.0))
"""Factor by which the scatter is larger for half of the cycles."""
RIPPLE = "torque_ripple"
"""It is at an order, as a crack is at a tooth: its placebo is the same cause elsewhere."""
N_PLACEBOS = 4


@dataclass(frozen=True)
class DriveFloor:
    """Centre and scale of each change of healthy drives: the structural floor of start–stop changes.

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

    @property
    def limit(self) -> FloatArray:
        """Limit of 19 of 20 healthy drives, in dB from the centre, (n,)."""
        return FLOOR_IN_DEVIATIONS * self.scale

    @classmethod
    def of_healthy(cls, rows: FloatArray, scatters: FloatArray | None = None) -> DriveFloor:
        """Return the floor from a table of changes of healthy drives, (n_drives, n); nan where a change is not known.

        Parameters
        ----------
        rows : array, (n_drives, n)
        scatters : array or None, (n_drives, n)
            Standard errors of the changes; None: zero.
        """
        table = np.asarray(rows, dtype=np.float64)
        errors = np.zeros_like(table) if scatters is None else np.nan_to_num(scatters)
        centre, scale = np.zeros(table.shape[1]), np.full(table.shape[1], 6.0)
        for i, name in enumerate(NAMES):
            known = np.isfinite(table[:, i])
            values, value_errors = table[known, i], errors[known, i]
            if len(values) >= 5:
                # 2 % of a level; a fifth of the step for changes that are normally near zero
                centre[i], min_scale = _centre(values, value_errors), 0.15 if FEATURES[name].is_level else 0.87
                scale[i] = max(_scale(values - centre[i], value_errors), min_scale)
        unscaled = cls(centre, scale, 1.0)
        sizes = [unscaled.widened(e).size(r) for r, e in zip(table, errors, strict=True)]
        return replace(unscaled, whole=float(np.quantile(sizes, 0.95)))

    def widened(self, scatter: FloatArray) -> DriveFloor:
        """Return the floor widened by the standard errors of a recording's changes, (n,)."""
        return replace(self, scale=np.hypot(self.scale, np.nan_to_num(scatter)))

    def size(self, change: FloatArray) -> float:
        """Return the size of a whole change, (Σ z⁴)^(1/4) in floors; one healthy drive in twenty exceeds 1."""
        z = np.abs((change - self.centre) / self.limit)
        return float(np.sum(z[np.isfinite(z)] ** 4.0) ** 0.25) / self.whole

    def size_interval(self, changes: Sequence[FloatArray], left_out: Sequence[FloatArray]) -> Interval:
        """Return the mean size of some changes, with its 90 % interval from the jackknife within each.

        Parameters
        ----------
        changes : sequence of array, (n,)
        left_out : sequence of array, (n_blocks, n)
            Each of the changes with each of its cycles left out.
        """
        value = float(np.mean([self.size(change) for change in changes]))
        variance = sum(float(jackknife_variance(np.array([self.size(row) for row in rows]))) for rows in left_out)
        return Interval.around(value, NORMAL_90 * variance**0.5 / len(changes), low=0.0)

    def log_density(self, change: FloatArray, predicted: FloatArray, widen: FloatArray | float = 0.0) -> FloatArray:
        """Return the logarithm of Student's density of each change around centre + predicted, (n,); 0 where unknown.

        It has four degrees of freedom, since outliers are more frequent than under a normal density.

        Parameters
        ----------
        change, predicted : array, (n,)
        widen : array or float
            Error of the prediction in dB, by which the scale is widened.
        """
        scale, tail = np.hypot(self.scale, widen), 4.0
        z = np.nan_to_num((change - self.centre - predicted) / scale)
        logs = -0.5 * (tail + 1.0) * np.log1p(z * z / tail) - np.log(scale / self.scale)
        return np.where(np.isfinite(change), logs, 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values by name."""
        columns = {"centre_db": self.centre, "scale_db": self.scale}
        tables = {k: {n: round(float(v), 4) for n, v in zip(NAMES, c, strict=True)} for k, c in columns.items()}
        return {**tables, "whole": round(self.whole, 4)}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> DriveFloor:
        """Return the floor from the output of `to_dict`."""
        centre, scale = (np.array([float(content[key][name]) for name in NAMES]) for key in ("centre_db", "scale_db"))
        return cls(centre, scale, float(content["whole"]))


def _centre(values: FloatArray, errors: FloatArray) -> float:
    """Return the median, weighted by precision."""
    order = np.argsort(values)
    spread = median_deviation(values - np.median(values))
    weights = np.cumsum(1.0 / (spread**2 + errors[order] ** 2 + 1e-6))
    return float(values[order][np.searchsorted(weights, 0.5 * weights[-1])])


def _scale(distances: FloatArray, errors: FloatArray) -> float:
    """Return the s for which four of five distances are below 1.28 √(s² + e²); 0 where the errors alone suffice."""
    low, high = 0.0, float(np.max(np.abs(distances))) + 1e-9
    for _ in range(40):
        middle = 0.5 * (low + high)
        inside = np.quantile(np.abs(distances) / np.hypot(middle, errors + 1e-12), 0.8)
        low, high = (middle, high) if inside > 1.2816 else (low, middle)
    return high


@cache
def load_floors(*, with_reference: bool) -> tuple[tuple[DriveFloor, DriveFloor], GapCalibration]:
    """Return the floors of whole recordings and of half their cycles, and the calibration, shipped with this version.

    The calibration's uncalibrated probabilities are the shares of the evidence.
    """
    content = calibration_values(FLOORS_FILE)["with_reference" if with_reference else "without_reference"]
    whole, half = (DriveFloor.from_dict(content[part]) for part in ("whole", "half"))
    return (whole, half), GapCalibration.from_mapping(content)


@dataclass(frozen=True)
class PredictedCause:
    """The simulator's predictions for one cause.

    Parameters
    ----------
    name : str
    severities : array, (k,)
        Ascending, without 0.
    changes : array, (k, n)
        dB by `NAMES`.
    may_move : array of bool, (n,)
        Changes that the cause affects in a way unknown to the simulator.
    direct : array of bool, (n,), or None
        Changes that measure the severity itself, if there are any.
    options : mapping
        Its place: gear and tooth, or order.
    """

    name: str
    severities: FloatArray
    changes: FloatArray
    may_move: NDArray[np.bool_]
    direct: NDArray[np.bool_] | None = None
    options: Mapping[str, float | str] = field(default_factory=dict)

    def fine(self) -> tuple[FloatArray, FloatArray]:
        """Return many severities and their changes, by linear interpolation between those simulated and 0."""
        order = np.argsort(np.append(self.severities, 0.0))
        knots = np.append(self.severities, 0.0)[order]
        values = np.vstack([self.changes, np.zeros(self.changes.shape[1])])[order]
        shares = np.geomspace(0.05, 1.0, 192)
        below = -shares[::-1] * abs(knots[0]) if knots[0] < 0 else np.zeros(0)
        grid = np.concatenate([below, shares * knots[-1]])
        return grid, np.stack([np.interp(grid, knots, column) for column in values.T], axis=1)

    def minimum_severity(self, floor: DriveFloor) -> float:
        """Return the minimum severity above 0 whose change exceeds the floor; infinite where none tried does."""
        severities, changes = self.fine()
        sizes = np.max(np.abs(changes) / floor.limit, axis=1, initial=0.0)
        return float(severities[(sizes >= 1.0) & (severities > 0.0)].min(initial=np.inf))


@dataclass(frozen=True)
class FittedDriveCause:
    """A cause fitted to a change.

    Parameters
    ----------
    name : str
    severity : Interval
        90 %.
    predicted : array, (n,)
        Predicted changes at that severity.
    log_evidence : float
        Logarithm of the likelihood, averaged over severities on a logarithmic scale.
    shrinkage : Shrinkage or None
        On cycles that it was not fitted to; None: not computed.
    """

    name: str
    severity: Interval
    predicted: FloatArray
    log_evidence: float
    shrinkage: Shrinkage | None = None


def fit(cause: PredictedCause, change: FloatArray, floor: DriveFloor) -> FittedDriveCause:
    """Fit a cause's severity to a change; severities with changes below the floor of healthy machines are excluded.

    The severity comes from changes that measure it directly, if there are any. The evidence for the cause comes from
    all changes with the same tolerance, since machines of one drawing respond differently.
    """
    grid, predicted = cause.fine()
    sizes = np.max(np.abs(predicted) / floor.limit, axis=1, initial=0.0)
    clear = sizes >= min(1.0, float(sizes.max(initial=0.0)))
    grid, predicted = grid[clear], predicted[clear]
    # Another machine of the same drawing responds with a quarter more or less. But 100 µm more play are 100 µm on any
    # machine, except for the error of interpolating between the simulated severities. Changes that a cause may affect
    # in an unknown way hardly count.
    model_error, direct_error = 0.25, 0.08
    free = np.where(cause.may_move, 6.0 * floor.scale, 0.0)

    def likelihoods(error: float | FloatArray) -> FloatArray:
        return np.array([float(np.sum(floor.log_density(change, p, error * np.abs(p) + free))) for p in predicted])

    logs = likelihoods(model_error)
    evidence = float(np.logaddexp.reduce(logs) - np.log(len(logs)))
    if cause.direct is not None and np.any(cause.direct & np.isfinite(change)):
        logs = likelihoods(np.where(cause.direct, direct_error, model_error))
    best = int(np.argmax(logs))
    inside = grid[logs > logs[best] - 0.5 * NORMAL_90**2]
    severity = Interval(float(grid[best]), float(inside.min()), float(inside.max()))
    return FittedDriveCause(cause.name, severity, predicted[best], evidence)


def evidences(change: FloatArray, floor: DriveFloor, fits: Sequence[FittedDriveCause]) -> dict[str, float]:
    """Return the logarithm of the evidence for every cause, for "none" and for "unknown".

    Under "unknown", any one change has ten times the scale of healthy machines, or any two have, or all have four
    times.
    """
    nothing = np.zeros(len(change))
    healthy = floor.log_density(change, nothing)
    gains = (floor.log_density(change, nothing, 10.0 * floor.scale) - healthy)[np.isfinite(change)]
    total = float(np.sum(healthy))

    def mean_of(gains: Sequence[float] | FloatArray) -> float:
        return total + float(np.log(np.mean(np.exp(np.minimum(gains, 200.0)))))

    alone = mean_of(gains) if len(gains) else total
    pairs = mean_of([a + b for i, a in enumerate(gains) for b in gains[:i]]) if len(gains) > 1 else alone
    every = float(np.sum(floor.log_density(change, nothing, 4.0 * floor.scale)))
    unknown = float(np.logaddexp.reduce([alone, pairs, every]) - np.log(3.0))
    return {fitted.name: fitted.log_evidence for fitted in fits} | {NONE: total, UNKNOWN: unknown}


def affected_features(predicted: FloatArray, change: FloatArray, floor: DriveFloor) -> NDArray[np.intp]:
    """Return the indices of changes that the effect predicts to exceed the floor; the largest one where none does."""
    sizes = np.where(np.isfinite(change), np.abs(predicted) / floor.limit, -1.0)
    features = np.flatnonzero(sizes >= 1.0)
    return features if len(features) else np.array([int(np.argmax(sizes))], dtype=np.intp)


def shrink(
    change: FloatArray, predicted: FloatArray, floor: DriveFloor, features: NDArray[np.intp]
) -> tuple[float, float, float, float]:
    """Return RMS before and after in floors, 1 − after²/before², and the slope, on an effect's features.

    The shrink is limited to −1, at which the gap doubles in power.

    Parameters
    ----------
    change : array
        Change of cycles that the severity was not fitted to.
    """
    z, p = ((change - floor.centre) / floor.limit)[features], (predicted / floor.limit)[features]
    known = np.isfinite(z)
    z, p = z[known], p[known]
    if not len(z):
        return 0.0, 0.0, 0.0, float("nan")
    before, after = float(np.sqrt(np.mean(z**2))), float(np.sqrt(np.mean((z - p) ** 2)))
    slope = float(np.sum(z * p) / np.sum(p * p)) if np.any(p) else float("nan")
    return before, after, max(1.0 - (after / before) ** 2, -1.0) if before > 0.0 else 0.0, slope


@dataclass(frozen=True)
class CycleFold:
    """One half of the cycles to fit to, and the other to score on; corresponds to `Fold` at constant speed.

    Parameters
    ----------
    fitted : array
        Change of one half, at the tooth and order where it is largest.
    scored : array
        Change of the other half, at the same tooth and order.
    again : array, (n_blocks, n)
        `scored` with each of its cycles left out.
    elsewhere : mapping
        Cause with a place → changes of the other half at other places, (k, n).
    """

    fitted: FloatArray
    scored: FloatArray
    again: FloatArray
    elsewhere: Mapping[str, FloatArray]


@dataclass(frozen=True)
class DriveEvidence:
    """All inputs of the attribution from one recording.

    Parameters
    ----------
    whole : array
        Change of all cycles.
    scatter : array
        Standard errors of `whole`.
    folds : tuple of CycleFold
    predicted : mapping
        Cause → predictions of the simulator.
    """

    whole: FloatArray
    scatter: FloatArray
    folds: tuple[CycleFold, ...]
    predicted: Mapping[str, PredictedCause]


def attribute_drive(
    every: Sequence[DriveEvidence], *, with_reference: bool, floors: tuple[DriveFloor, DriveFloor] | None = None
) -> Attribution[FittedDriveCause]:
    """Compute the probabilities of the causes from one or several recordings of one machine.

    The recordings share a machine and its tolerances, so their evidence is averaged, not added.

    Parameters
    ----------
    every : sequence of DriveEvidence
    with_reference : bool
        Whether the baseline is a healthy recording.
    floors : (DriveFloor, DriveFloor) or None
        Floors of other drives for whole recordings and for halves; None: those shipped with this version.
    """
    shipped, calibration = load_floors(with_reference=with_reference)
    whole, half = floors or shipped
    wholes = [whole.widened(evidence.scatter) for evidence in every]
    folds = [
        (evidence.predicted, half.widened(HALF * evidence.scatter), fold)
        for evidence in every
        for fold in evidence.folds
    ]
    names = [name for name in every[0].predicted if all(name in evidence.predicted for evidence in every)]
    fits = [
        [fit(evidence.predicted[name], evidence.whole, floor) for name in names]
        for evidence, floor in zip(every, wholes, strict=True)
    ]
    logs = [
        evidences(evidence.whole, floor, fitted) for evidence, floor, fitted in zip(every, wholes, fits, strict=True)
    ]
    best = {
        name: max(cause_fits, key=lambda fitted: fitted.log_evidence)
        for name, *cause_fits in zip(names, *fits, strict=True)
    }
    return Attribution(
        shares_of({name: float(np.mean([log[name] for log in logs])) for name in logs[0]}),
        {name: replace(fitted, shrinkage=_shrinkage(name, folds)) for name, fitted in best.items()},
        calibration,
    )


def _shrinkage(name: str, folds: Sequence[tuple[Mapping[str, PredictedCause], DriveFloor, CycleFold]]) -> Shrinkage:
    """Fit to one half, score on the other, and vice versa; return the mean of both."""
    values, placebos, variances = [], [], []
    for predicted, floor, fold in folds:
        guess = fit(predicted[name], fold.fitted, floor).predicted
        features = affected_features(guess, fold.scored, floor)
        values.append(shrink(fold.scored, guess, floor, features))
        rows = np.array([shrink(row, guess, floor, features)[:3] for row in fold.again])
        variances.append(jackknife_variance(rows) if len(rows) > 1 else np.full(3, 0.25))
        placebos.append(
            max((shrink(row, guess, floor, features)[2] for row in fold.elsewhere.get(name, ())), default=0.0)
        )
    before, after, closed, slope = (_mean_of_known(column) for column in zip(*values, strict=True))
    wide = NORMAL_90 * np.sqrt(np.sum(variances, axis=0)) / len(folds)
    return Shrinkage(
        Interval.around(before, float(wide[0]), low=0.0),
        Interval.around(after, float(wide[1]), low=0.0),
        Interval.around(closed, float(wide[2]), high=1.0),
        slope,
        float(np.mean(placebos)),
        "starts and stops that it was not fitted to",
        N_PLACEBOS if name in (CRACK, RIPPLE) else 0,
    )


def _mean_of_known(values: Sequence[float]) -> float:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else float("nan")
