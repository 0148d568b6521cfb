"""From weighed causes to the gap report of a start–stop machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from app.gap.start_stop.causes import TORQUE_GAIN, TRIED, drive_effects, parameters_with, setting_of
from app.gap.start_stop.compare import Compared
from app.gap.start_stop.curves import CRACK, tooth_curves, torque_curves
from app.gap.start_stop.least import least_seen
from app.gap.start_stop.next_recording import next_drive_recordings
from app.gap.start_stop.places import FEATURES, drive_places
from app.gap.start_stop.predict import Predictions
from app.gap.start_stop.weighing import Fold, Seen, Weighed
from gearsig.checks import FloatArray
from gearsig.gap.evidence import weighed_evidence
from gearsig.gap.simulator import Added, GapEffect, Point
from gearsig.gap.start_stop.floors import FLOOR, DriveFloor
from gearsig.gap.start_stop.told import NAMES
from gearsig.gap.start_stop.weigh import Fitted, fit
from gearsig.gap.types import (
    NAMING,
    NONE,
    UNKNOWN,
    ConditionFacts,
    Evidence,
    GapCause,
    GapOutcome,
    GapReport,
    GapStep,
    Interval,
    group_probabilities,
)
from gearsig.gap.verdict import rivals
from gearsig.gap.words import fitted_words

NORMAL_90 = 1.645
MOST_EVIDENCE = 6
SMALLEST = 0.3
"""Floors from which a predicted change is worth a line."""
TITLES = {NONE: "nothing beyond what sound drives differ by", UNKNOWN: "nothing in the catalogue"}


@dataclass(frozen=True)
class Diagnosis:
    """Everything that a report is made of.

    Parameters
    ----------
    rig : str
    compared : tuple of Compared
        The recording that differs most is `clearest`.
    seen : tuple of Seen
    predictions : tuple of Predictions
    weighed : Weighed
    probabilities : mapping
    outcome : GapOutcome
    references : tuple of str
    notices : tuple of str
    """

    rig: str
    compared: tuple[Compared, ...]
    seen: tuple[Seen, ...]
    predictions: tuple[Predictions, ...]
    weighed: Weighed
    probabilities: Mapping[str, float]
    outcome: GapOutcome
    references: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()

    @property
    def clearest(self) -> int:
        """Number of the recording that differs most."""
        return int(np.argmax([c.floor().size(c.change) for c in self.compared]))


def report_of(found: Diagnosis) -> GapReport:
    """Return the report."""
    k = found.clearest
    compared, floor = found.compared[k], found.compared[k].floor()
    causes = _ordered([_cause(found, name, p) for name, p in found.probabilities.items()], found.outcome)
    first = causes[0]
    fitted = first.fitted if found.outcome in NAMING else None
    named = [c.name for c in causes if c.name not in (NONE, UNKNOWN)]
    pair = (named[0], named[1]) if len(named) > 1 else None
    is_gap = found.outcome is not GapOutcome.NO_GAP
    titles = {c.name: c.title for c in causes}
    extra_um = _extra_um(found.weighed.fits.get(CRACK), compared)
    return GapReport(
        rig=found.rig,
        simulator="forging",
        conditions=tuple(_facts(c) for c in found.compared),
        references=found.references,
        outcome=found.outcome,
        size=_size(compared, floor),
        repeatability=_repeatability(compared),
        places=drive_places(compared),
        causes=causes,
        groups=group_probabilities(causes),
        inseparable=rivals(causes) if found.outcome is GapOutcome.CANNOT_SEPARATE else None,
        steps=_steps(found, first) if found.outcome in NAMING else (),
        next_recordings=next_drive_recordings(compared, found.predictions[k], found.weighed.fits, pair, titles)
        if pair and is_gap
        else (),
        spectra=torque_curves(compared, fitted),
        angles=tooth_curves(compared, fitted, extra_um),
        notices=(*found.notices, *least_seen(compared, found.predictions[k])),
        twin_toml="" if fitted is None else _preset(compared, first, fitted),
    )


def _ordered(causes: list[GapCause], outcome: GapOutcome) -> tuple[GapCause, ...]:
    """Put first what the outcome says; the rest by probability."""
    ranked = sorted(causes, key=lambda cause: -cause.probability)
    if outcome is GapOutcome.UNDECIDED:
        return tuple(ranked)
    wanted = {GapOutcome.NO_GAP: NONE, GapOutcome.UNKNOWN: UNKNOWN}.get(outcome)
    first = next(c for c in ranked if (c.name == wanted if wanted else c.name not in (NONE, UNKNOWN)))
    return (first, *(c for c in ranked if c is not first))


def _cause(found: Diagnosis, name: str, probability: float) -> GapCause:
    if name in (NONE, UNKNOWN):
        return GapCause(name, name, TITLES[name], "", probability)
    effect: GapEffect = drive_effects()[name]
    base = GapCause(name, effect.group, effect.title, effect.unit, probability)
    if name not in found.weighed.fits:
        return base
    fitted, k = found.weighed.fits[name], found.clearest
    compared = found.compared[k]
    return replace(
        base,
        severity=fitted.severity,
        fitted=Added(name, float(f"{fitted.severity.value:.4g}"), found.predictions[k].options.get(name, {})),
        place=_place(name, compared),
        shrinkage=found.weighed.shrinkages[name],
        evidence=_evidence(fitted, compared.change, compared.floor()),
    )


def _place(name: str, compared: Compared) -> str:
    if name == CRACK:
        return f"tooth {compared.spot.tooth + 1} of the pinion"
    return f"order {int(compared.now.orders[compared.spot.order])} of the pinion" if name == "torque_ripple" else ""


def _evidence(fitted: Fitted, change: np.ndarray, floor: DriveFloor) -> tuple[Evidence, ...]:
    """Return what it predicts and what was observed: its own changes, and those that it leaves unexplained."""
    limit = FLOOR * floor.scale
    observed, predicted = np.nan_to_num(change - floor.centre), fitted.predicted
    free = np.isin(NAMES, TRIED[fitted.name].may_move)
    size = np.maximum(np.abs(predicted) / limit, np.where(free, 0.0, np.abs(observed) / limit))
    told = [i for i in np.argsort(-size) if np.isfinite(change[i])]
    kept = [i for i in told if abs(predicted[i]) > SMALLEST * limit[i] or size[i] > 1.0][:MOST_EVIDENCE]
    return tuple(
        weighed_evidence(FEATURES[NAMES[i]], float(predicted[i]), float(observed[i]), float(limit[i]), least=SMALLEST)
        for i in kept
    )


def _size(compared: Compared, floor: DriveFloor) -> Interval:
    value = floor.size(compared.change)
    rows = np.array([floor.size(row) for row in compared.without])
    half = NORMAL_90 * float(np.sqrt((len(rows) - 1.0) * np.var(rows)))
    return Interval(value, max(0.0, value - half), value + half)


def _repeatability(compared: Compared) -> float:
    """Size in standard errors of the recording's own cycles, root mean square over what can be told."""
    z = compared.change / (FLOOR * np.maximum(compared.scatter, 0.05))
    return float(np.sqrt(np.nanmean(z**2)))


def _steps(found: Diagnosis, cause: GapCause) -> tuple[GapStep, ...]:
    """Return what is left of the whole gap: before, and with an effect, fitted to the other half of the cycles."""
    seen, floor = found.seen[found.clearest], found.compared[found.clearest].floor("half")
    fitted = [fit(seen.predicted[cause.name], fold.fitted_to, floor).predicted for fold in seen.folds]
    nothing = [np.zeros_like(predicted) for predicted in fitted]
    return (
        GapStep("before", _left(seen.folds, nothing, floor)),
        GapStep(cause.title, _left(seen.folds, fitted, floor)),
    )


def _left(folds: Sequence[Fold], taken: Sequence[FloatArray], floor: DriveFloor) -> Interval:
    """Return the size of what is left on the held-out half once something is taken off, mean over the folds."""
    pairs = list(zip(folds, taken, strict=True))
    value = float(np.mean([floor.size(fold.held_out - off) for fold, off in pairs]))
    spread = [np.array([floor.size(row - off) for row in fold.without]) for fold, off in pairs]
    half = NORMAL_90 * float(np.sqrt(sum((len(s) - 1.0) * np.var(s) for s in spread))) / len(folds)
    return Interval(value, max(0.0, value - half), value + half)


def _facts(compared: Compared) -> ConditionFacts:
    m = compared.now.cycles.motion
    top = float(np.quantile(np.abs(m.driver_speed_rad_s), 0.98)) * 30.0 / np.pi
    torque = float("nan") if m.torque_nm is None else compared.twin.torque_nm
    return ConditionFacts(
        compared.name,
        Point(top, torque),
        float(np.ptp(m.driver_angle_rad)) / (2.0 * np.pi),
        len(m.driver_angle_rad) / m.sampling_rate_hz,
        m.sampling_rate_hz,
    )


def _extra_um(fitted: Fitted | None, compared: Compared) -> float:
    """Return how much more a cracked tooth yields at the fitted severity: from the change back to µm."""
    if fitted is None:
        return 0.0
    spot, per_db = compared.spot, np.log(10.0) / 20.0
    over = fitted.predicted[NAMES.index("tooth")] * per_db + np.arcsinh(0.5 * spot.next_tooth_um / spot.tooth_step_um)
    return float(2.0 * spot.tooth_step_um * np.sinh(over))


def _preset(compared: Compared, cause: GapCause, fitted: Added) -> str:
    note = fitted_words(cause, fitted.severity, compared.name)
    twin = compared.twin
    parameters = parameters_with(cause.name, fitted.severity, twin.parameters)
    if cause.name == TORQUE_GAIN:
        twin = twin.at_torque(1.0 / (1.0 + 0.01 * fitted.severity))
    return twin.preset(setting_of(cause.name, fitted.severity, fitted.options), parameters, (note,))
