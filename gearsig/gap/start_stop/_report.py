"""From weighed causes to the gap report of a start–stop machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.formatting import readable
from gearsig.gap._evidence import weighed_evidence
from gearsig.gap._simulator import Added, GapEffect, OperatingCondition
from gearsig.gap._types import (
    NAMING,
    NONE,
    UNKNOWN,
    AngleCurves,
    ConditionFacts,
    Evidence,
    GapCause,
    GapOutcome,
    GapPlace,
    GapReport,
    GapStep,
    Interval,
    NextRecording,
    PlaceKind,
    SpectrumCurves,
    group_probabilities,
)
from gearsig.gap._verdict import in_order, likeliest_two, rivals
from gearsig.gap._words import fitted_words, severity_unit
from gearsig.gap.start_stop._attribution import (
    FLOOR,
    NORMAL_90,
    CycleFold,
    DriveAttribution,
    DriveEvidence,
    DriveFloor,
    FittedDriveCause,
    Predicted,
    fit,
)
from gearsig.gap.start_stop._comparison import (
    CRACK,
    RIPPLE,
    TORQUE_GAIN,
    TRIED,
    WEAR,
    DriveComparison,
    Predictions,
    SimulatedDrive,
)
from gearsig.gap.start_stop._features import COMPRESSION, NAMES, UNITS, change_of, prediction_errors

# --------------------
# Curves of a start–stop gap: the torque by order of the pinion, and what its teeth yield, one by one.
# --------------------


def torque_curves(compared: DriveComparison, fitted: Added | None) -> tuple[SpectrumCurves, ...]:
    """Return the torque by order of the pinion while running; none without torque."""
    m, now, other = compared.now.cycles.motion, compared.features.ripple, compared.other.ripple
    if m.torque_nm is None or not np.all(np.isfinite(now)) or not np.all(np.isfinite(other)):
        return ()
    mean_nm = float(np.quantile(np.abs(m.torque_nm), 0.9))
    every = compared.now.every
    rows = np.array([compared.now.features(tuple(c for c in every if c != one)).ripple for one in every])
    scatter = np.sqrt((len(rows) - 1.0) * np.var(rows, axis=0))
    after = other.copy() if fitted is not None else np.zeros(0)
    if fitted is not None and fitted.name == RIPPLE:
        after[compared.spot.order] = np.hypot(after[compared.spot.order], 0.01 * fitted.severity)
    return (
        SpectrumCurves(
            "torque while running, over the pinion's revolution",
            "N m",
            compared.now.orders.astype(np.float64),
            mean_nm * now,
            mean_nm * other,
            mean_nm * after,
            mean_nm * FLOOR * np.maximum(scatter, 1e-5),
            _ripple_floor_db(compared, other),
        ),
    )


def _ripple_floor_db(compared: DriveComparison, other: FloatArray) -> FloatArray:
    """Return how far a line of healthy drives may rise, in dB: the floor of the ripple, from its scale to a part."""
    floor = compared.floor()
    limit = FLOOR * float(floor.scale[NAMES.index("ripple")])
    part = 2.0 * compared.spot.ripple_step * float(np.sinh(limit * np.log(10.0) / 20.0))
    found: FloatArray = 20.0 * np.log10(1.0 + part / np.maximum(other, 1e-5))
    return found


def tooth_curves(compared: DriveComparison, fitted: Added | None, predicted_um: float) -> tuple[AngleCurves, ...]:
    """Return what each tooth of the pinion yields beyond the middling one, 1 + (extra/floor)²: healthy ones are 1."""
    now, other = compared.features.contact, compared.other.contact
    if np.sum(np.isfinite(now.teeth_um)) < 0.8 * len(now.teeth_um):
        return ()
    step = compared.spot.tooth_step_um

    def energy(extra_um: FloatArray) -> FloatArray:
        found: FloatArray = 1.0 + (np.maximum(np.nan_to_num(extra_um), 0.0) / step) ** 2
        return found

    after: FloatArray = np.zeros(0)
    if fitted is not None:
        teeth = np.nan_to_num(other.teeth_um)
        if fitted.name == CRACK:
            teeth[compared.spot.tooth] += predicted_um
        after = energy(teeth)
    n = len(now.teeth_um)
    angle = 360.0 * (np.arange(n) + 0.5) / n
    return (AngleCurves("pinion", "µm²", n, True, angle, energy(now.teeth_um), energy(other.teeth_um), after),)


# --------------------
# How much of each cause a start–stop recording would show: below it, saying nothing means nothing.
# --------------------


def hidden_severities(
    compared: DriveComparison, predictions: Predictions, effects: Mapping[str, GapEffect]
) -> tuple[str, ...]:
    """Return one sentence with the least severity of every cause that would exceed the floor of this recording."""
    floor = compared.floor()
    hidden = []
    for name, cause in predictions.causes.items():
        least = minimum_severity(cause, floor)
        unit, title = severity_unit(effects[name].unit), effects[name].title
        if np.isfinite(least):
            hidden.append(f"{title} below {readable(least, 2)} {unit}".rstrip())
        else:
            most = f"{readable(float(cause.severities[-1]), 2)} {unit}".rstrip()
            hidden.append(f"{title} at all (up to {most} were tried)")
    return (f"This recording would not show: {'; '.join(hidden)}.",) if hidden else ()


def minimum_severity(cause: Predicted, floor: DriveFloor) -> float:
    """Return the least severity above 0 whose change exceeds the floor; infinite where none that was tried does."""
    severities, changes = cause.fine()
    sizes = np.max(np.abs(changes) / (FLOOR * floor.scale), axis=1, initial=0.0)
    seen = severities[(sizes >= 1.0) & (severities > 0.0)]
    return float(seen.min()) if len(seen) else float("inf")


# --------------------
# Which further start–stop recording would tell the two likeliest causes apart.
# --------------------


FACTORS = (0.7, 1.5)
"""Torques that are tried, over the present one."""
ANALYTIC = (WEAR, CRACK, TORQUE_GAIN)
MIN_GAIN, SAME = 1.1, 0.1


def next_drive_recordings(
    compared: DriveComparison,
    predictions: Predictions,
    fits: Mapping[str, FittedDriveCause],
    pair: tuple[str, str],
    effects: Mapping[str, GapEffect],
) -> tuple[NextRecording, ...]:
    """Return starts and stops at other torques that put the predictions of two causes further apart, best first."""
    floor = compared.floor()
    now = _distance(fits[pair[0]].predicted, fits[pair[1]].predicted, floor.scale)
    found = []
    for factor in FACTORS:
        drive = compared.drive.at_torque(factor)
        if not _turns(compared, drive):
            continue
        try:
            first, second = (_change(compared, predictions, fits[name], drive, effects) for name in pair)
            apart = _distance(first, second, floor.scale)
        except GearsigError:
            continue
        if apart > MIN_GAIN * now:
            point = drive.point
            titles = " and ".join(effects[name].title for name in pair)
            text = (
                f"starts and stops at {point.torque_nm:.3g} N·m; {titles} are then "
                f"{apart:.2g} structural floors apart instead of {now:.2g}."
            )
            found.append(NextRecording(point, pair, apart, now, text))
    return tuple(sorted(found, key=lambda one: -one.standard_deviations))


def _change(
    compared: DriveComparison,
    predictions: Predictions,
    fitted: FittedDriveCause,
    drive: SimulatedDrive,
    effects: Mapping[str, GapEffect],
) -> FloatArray:
    """Return the predicted change of another drive, where the cause is expected to show."""
    name = fitted.name
    if name in ANALYTIC:
        return fitted.predicted
    added = Added(name, fitted.severity.value, predictions.options.get(name, {}))
    change = change_of(drive.features(added), drive.healthy, compared.drive.shape, compared.spot)
    return np.where(np.isin(NAMES, effects[name].shows_in), np.nan_to_num(change), 0.0)


def _turns(compared: DriveComparison, drive: SimulatedDrive) -> bool:
    """Whether the healthy drive turns its load at another torque: what its cycles tell is then the same."""
    now, there = compared.drive.healthy.load.friction_nm, drive.healthy.load.friction_nm
    return bool(abs(there - now) < SAME * now)


def _distance(first: FloatArray, second: FloatArray, scale: FloatArray) -> float:
    return float(np.sqrt(np.sum(((first - second) / (FLOOR * scale)) ** 2)))


# --------------------
# Where a start–stop gap lies: which part of the motion, which flank, which tooth, which order.
# --------------------


MIN_SHARE = 0.01
MIN_CHANGE_DB = 3.0
"""Of a prediction error, to be shown."""
MAX_PHASES = 3

KINDS = {
    "curve": PlaceKind.MESH,
    "flank_friction": PlaceKind.MESH,
    "tooth": PlaceKind.TOOTH,
    "next_tooth": PlaceKind.TOOTH,
    "ripple": PlaceKind.SHAFT,
    "next_ripple": PlaceKind.SHAFT,
    "driver_wave": PlaceKind.SHAFT,
    "driven_wave": PlaceKind.SHAFT,
    "off_centre": PlaceKind.SHAFT,
}
"""Of a change; all others lie in time and speed."""

FEATURES = {
    "play": "play, from drive to back flank",
    "deflection": "deflection of the loaded teeth",
    "curve": "course of the drive flank over the mesh cycle",
    "inertia": "torque per acceleration of the load",
    "load_friction": "torque that turns the load without accelerating it",
    "flank_friction": "friction of the flanks",
    "tooth": "one tooth that yields more than all others",
    "next_tooth": "teeth that differ, drive flank",
    "ripple": "one order of the torque over all others",
    "next_ripple": "other orders of the torque",
    "driver_wave": "wave of the compression once per revolution of the driver",
    "driven_wave": "wave of the compression once per revolution of the driven gear",
    "off_centre": "torque of the load once per revolution",
    "impact": "hardest impact of the flanks in a cycle",
    "contact_scatter": "what the loaded flanks' equation leaves over",
    "load_scatter": "what the load's equation of motion leaves over",
}
"""In words, for evidence."""


def drive_places(compared: DriveComparison) -> tuple[GapPlace, ...]:
    """Return where a recording differs, largest share first; then the phases of motion that are predicted worst.

    Size of a change over its floor z; share max(z² − 1, 0)/Σ max(z² − 1, 0).
    """
    floor = compared.floor()
    distance = compared.change - floor.centre
    z = np.nan_to_num(np.abs(distance) / (FLOOR * floor.scale))
    repeated = np.abs(np.nan_to_num(compared.change)) / (FLOOR * np.maximum(compared.scatter, 0.05))
    energies = np.maximum(z**2 - 1.0, 0.0)
    total = float(np.sum(energies))
    order = np.argsort(-energies)
    shares = energies / total if total > 0.0 else energies
    found = [
        _place_of_change(compared, int(i), float(distance[i]), float(repeated[i]), float(z[i]), float(shares[i]))
        for i in order
        if shares[i] > MIN_SHARE
    ]
    return (*found, *_phases(compared))


def _place_of_change(
    compared: DriveComparison, i: int, change_db: float, repeated: float, structural: float, share: float
) -> GapPlace:
    name = NAMES[i]
    spot, m = compared.spot, compared.now.cycles.motion
    n_teeth = m.path.teeth[0]
    is_tooth = name == "tooth"
    shafts = {"driver_wave": "pinion", "driven_wave": "wheel", "off_centre": "wheel"}
    orders = {"driver_wave": 1.0, "driven_wave": m.path.teeth[0] / m.path.teeth[1]}
    order = float(compared.now.orders[spot.order]) if name == "ripple" else orders.get(name)
    shaft = "pinion" if name in ("tooth", "ripple") else shafts.get(name, "")
    return GapPlace(
        KINDS.get(name, PlaceKind.SPEED),
        title_of(compared, name),
        change_db,
        repeated,
        structural,
        share,
        shaft=shaft,
        orders=(order,) if order is not None else (),
        angle_deg=360.0 * (spot.tooth + 0.5) / n_teeth if is_tooth else None,
        tooth=spot.tooth + 1 if is_tooth else None,
        follows=name in ("contact_scatter", "load_scatter", "impact", "next_tooth", "next_ripple"),
    )


def title_of(compared: DriveComparison, name: str) -> str:
    """Return a change in one sentence, with its numbers."""
    now, other, spot = compared.features, compared.other, compared.spot
    c, d, a, b = now.contact, other.contact, now.load, other.load
    extra = (c.teeth_um - d.teeth_um)[spot.tooth]
    texts = {
        "play": f"where the drive stops and the back flank takes over: play {_pair(c.play_um, d.play_um, 'µm')}",
        "deflection": f"under load: teeth yield by {_pair(c.deflection_um, d.deflection_um, 'µm')}",
        "curve": "drive flank, over each mesh cycle: its course differs by "
        f"{readable(float(np.nanmax(c.curve_um - d.curve_um) - np.nanmin(c.curve_um - d.curve_um)), 2)} µm",
        "inertia": "in starts and stops, torque per acceleration of the load: "
        f"{_pair(a.inertia_kg_m2, b.inertia_kg_m2, 'kg·m²')}",
        "load_friction": "while the load turns, torque that does not accelerate it: "
        f"{_pair(a.friction_nm, b.friction_nm, 'N·m')}",
        "flank_friction": f"loaded flanks, friction coefficient {_pair(a.flank_friction, b.flank_friction, '')}",
        "tooth": f"drive flank, tooth {spot.tooth + 1} of the pinion yields {readable(float(extra), 2)} µm more than "
        "the middling tooth",
        "ripple": f"torque while running, order {int(compared.now.orders[spot.order])} of the pinion: "
        f"{_pair(100 * now.ripple[spot.order], 100 * other.ripple[spot.order], '% of its mean')}",
        "driver_wave": "compression once per revolution of the pinion: a wave of "
        f"{readable(float(np.hypot(*(c.waves_um[:2] - d.waves_um[:2]))), 2)} µm",
        "driven_wave": "compression once per revolution of the wheel: a wave of "
        f"{readable(float(np.hypot(*(c.waves_um[2:] - d.waves_um[2:]))), 2)} µm",
        "off_centre": "load once per revolution of the wheel: a torque of "
        f"{readable(float(np.hypot(*(a.off_centre_nm - b.off_centre_nm))), 2)} N·m",
        "impact": f"hardest impact of the flanks: {_pair(now.impact_mps, other.impact_mps, 'm/s')}",
    }
    return texts.get(name, FEATURES[name])


def _pair(now: float, other: float, unit: str) -> str:
    return f"{readable(float(now), 3)}{' ' if unit else ''}{unit} against {readable(float(other), 3)}"


def _phases(compared: DriveComparison) -> list[GapPlace]:
    """Return the phases in which motion or torque are predicted worse than the healthy machine's own."""
    healthy = compared.drive.healthy_run if compared.reference is None else compared.reference
    now, other = (prediction_errors(one, compared.other) for one in (compared.now, healthy))
    rows = []
    for key, rms in now.items():
        change = 20.0 * np.log10(max(rms, 1e-9) / max(other.get(key, np.nan), 1e-9))
        if np.isfinite(change) and change > MIN_CHANGE_DB:
            quantity, phase, flank = key
            where = f"{phase}{f', {flank} flank' if flank else ''}"
            rows.append(
                GapPlace(
                    PlaceKind.SPEED,
                    f"{where}: measured {quantity} is {readable(rms, 2)} {UNITS[quantity]} off its prediction, "
                    f"{readable(other[key], 2)} ordinarily",
                    float(change),
                    float("nan"),
                    float("nan"),
                    float("nan"),
                    channel="" if quantity == COMPRESSION else quantity,
                    follows=True,
                )
            )
    return sorted(rows, key=lambda place: -place.change_db)[:MAX_PHASES]


MAX_EVIDENCE = 6
SMALLEST = 0.3
"""Floors from which a predicted change is worth a line."""
TITLES = {NONE: "nothing beyond what healthy drives differ by", UNKNOWN: "nothing in the catalogue"}


@dataclass(frozen=True)
class DriveDiagnosis:
    """Everything that a report is made of.

    Parameters
    ----------
    rig, simulator : str
    effects : mapping
        Those of the simulator.
    compared : tuple of DriveComparison
        The recording that differs most is `clearest`.
    seen : tuple of DriveEvidence
    predictions : tuple of Predictions
    weighed : DriveAttribution
    probabilities : mapping
    outcome : GapOutcome
    references : tuple of str
    notices : tuple of str
    """

    rig: str
    simulator: str
    effects: Mapping[str, GapEffect]
    compared: tuple[DriveComparison, ...]
    seen: tuple[DriveEvidence, ...]
    predictions: tuple[Predictions, ...]
    weighed: DriveAttribution
    probabilities: Mapping[str, float]
    outcome: GapOutcome
    references: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()

    @property
    def clearest(self) -> int:
        """Number of the recording that differs most."""
        return int(np.argmax([c.floor().size(c.change) for c in self.compared]))


def drive_report(found: DriveDiagnosis) -> GapReport:
    """Return the report."""
    k = found.clearest
    compared, floor = found.compared[k], found.compared[k].floor()
    causes = in_order([_cause(found, name, p) for name, p in found.probabilities.items()], found.outcome)
    first = causes[0]
    fitted = first.fitted if found.outcome in NAMING else None
    pair = likeliest_two(causes)
    is_gap = found.outcome is not GapOutcome.NO_GAP
    extra_um = _extra_um(found.weighed.fits.get(CRACK), compared)
    return GapReport(
        rig=found.rig,
        simulator=found.simulator,
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
        next_recordings=next_drive_recordings(compared, found.predictions[k], found.weighed.fits, pair, found.effects)
        if pair and is_gap
        else (),
        spectra=torque_curves(compared, fitted),
        angles=tooth_curves(compared, fitted, extra_um),
        notices=(*found.notices, *hidden_severities(compared, found.predictions[k], found.effects)),
        twin_toml="" if fitted is None else _preset(compared, first, fitted),
    )


def _cause(found: DriveDiagnosis, name: str, probability: float) -> GapCause:
    if name in (NONE, UNKNOWN):
        return GapCause(name, name, TITLES[name], "", probability)
    effect = found.effects[name]
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


def _place(name: str, compared: DriveComparison) -> str:
    if name == CRACK:
        return f"tooth {compared.spot.tooth + 1} of the pinion"
    return f"order {int(compared.now.orders[compared.spot.order])} of the pinion" if name == RIPPLE else ""


def _evidence(fitted: FittedDriveCause, change: np.ndarray, floor: DriveFloor) -> tuple[Evidence, ...]:
    """Return what it predicts and what was observed: its own changes, and those that it leaves unexplained."""
    limit = FLOOR * floor.scale
    observed, predicted = np.nan_to_num(change - floor.centre), fitted.predicted
    free = np.isin(NAMES, TRIED[fitted.name].may_move)
    size = np.maximum(np.abs(predicted) / limit, np.where(free, 0.0, np.abs(observed) / limit))
    known = [i for i in np.argsort(-size) if np.isfinite(change[i])]
    kept = [i for i in known if abs(predicted[i]) > SMALLEST * limit[i] or size[i] > 1.0][:MAX_EVIDENCE]
    return tuple(
        weighed_evidence(FEATURES[NAMES[i]], float(predicted[i]), float(observed[i]), float(limit[i]), least=SMALLEST)
        for i in kept
    )


def _size(compared: DriveComparison, floor: DriveFloor) -> Interval:
    value = floor.size(compared.change)
    rows = np.array([floor.size(row) for row in compared.without])
    half = NORMAL_90 * float(np.sqrt((len(rows) - 1.0) * np.var(rows)))
    return Interval(value, max(0.0, value - half), value + half)


def _repeatability(compared: DriveComparison) -> float:
    """Size in standard errors of the recording's own cycles, root mean square over what can be told."""
    z = compared.change / (FLOOR * np.maximum(compared.scatter, 0.05))
    return float(np.sqrt(np.nanmean(z**2)))


def _steps(found: DriveDiagnosis, cause: GapCause) -> tuple[GapStep, ...]:
    """Return what is left of the whole gap: before, and with an effect, fitted to the other half of the cycles."""
    seen, floor = found.seen[found.clearest], found.compared[found.clearest].floor("half")
    fitted = [fit(seen.predicted[cause.name], fold.fitted_to, floor).predicted for fold in seen.folds]
    nothing = [np.zeros_like(predicted) for predicted in fitted]
    return (
        GapStep("before", _left(seen.folds, nothing, floor)),
        GapStep(cause.title, _left(seen.folds, fitted, floor)),
    )


def _left(folds: Sequence[CycleFold], taken: Sequence[FloatArray], floor: DriveFloor) -> Interval:
    """Return the size of what is left on the held-out half once something is taken off, mean over the folds."""
    pairs = list(zip(folds, taken, strict=True))
    value = float(np.mean([floor.size(fold.held_out - off) for fold, off in pairs]))
    spread = [np.array([floor.size(row - off) for row in fold.without]) for fold, off in pairs]
    half = NORMAL_90 * float(np.sqrt(sum((len(s) - 1.0) * np.var(s) for s in spread))) / len(folds)
    return Interval(value, max(0.0, value - half), value + half)


def _facts(compared: DriveComparison) -> ConditionFacts:
    m = compared.now.cycles.motion
    top = float(np.quantile(np.abs(m.driver_speed_rad_s), 0.98)) * 30.0 / np.pi
    torque = float("nan") if m.torque_nm is None else compared.drive.point.torque_nm
    return ConditionFacts(
        compared.name,
        OperatingCondition(top, torque),
        float(np.ptp(m.driver_angle_rad)) / (2.0 * np.pi),
        len(m.driver_angle_rad) / m.sampling_rate_hz,
        m.sampling_rate_hz,
    )


def _extra_um(fitted: FittedDriveCause | None, compared: DriveComparison) -> float:
    """Return how much more a cracked tooth yields at the fitted severity: from the change back to µm."""
    if fitted is None:
        return 0.0
    spot, per_db = compared.spot, np.log(10.0) / 20.0
    over = fitted.predicted[NAMES.index("tooth")] * per_db + np.arcsinh(0.5 * spot.next_tooth_um / spot.tooth_step_um)
    return float(2.0 * spot.tooth_step_um * np.sinh(over))


def _preset(compared: DriveComparison, cause: GapCause, fitted: Added) -> str:
    note = fitted_words(cause, fitted.severity, compared.name)
    return compared.drive.twin.preset_toml(fitted, (note,))
