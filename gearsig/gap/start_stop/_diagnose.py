"""The gap between start–stop recordings and a simulated drive: where, which cause, how far it shrinks, what next.

Orders and sidebands have no meaning where the speed crosses zero. The evidence of a start–stop machine is in its
equations: play and deflection of the flanks, tooth by tooth and over the mesh cycle, under a measured torque; inertia
and friction of the load, from torque against acceleration; ripple of the torque over the pinion's angle; impacts. They
hold whatever the valve and the brake do, so a simulated drive need not repeat the same motion.

1. These equations are fitted to the cycles of a recording, and to those of its baseline: a healthy recording, or a run
   of the drive simulated from the rig's drawing (with valve, brake and load friction taken from the recording:
   nuisances).
2. Each cause is simulated at some severities, with linear interpolation between them. The predicted change is compared
   with the observed one, relative to the floor: the differences between healthy drives (`floors.json`).
3. Severity and evidence come from all cycles. The shrink comes from every second cycle, checked on the others and vice
   versa, against the same cause at wrong teeth and orders. Both enter probabilities calibrated on blind cases.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import GearsigError, RefusalError
from gearsig.formatting import readable
from gearsig.gap._conditions import Stage
from gearsig.gap._evidence import MIN_SIGN_FLOORS, evidence_of_feature
from gearsig.gap._features import jackknife_variance
from gearsig.gap._floors import FLOOR_IN_DEVIATIONS
from gearsig.gap._report import (
    NAMING,
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
    fitted_text,
    in_order,
    most_probable_two,
    named_cause,
    severity_unit,
)
from gearsig.gap._simulator import AddedEffect, DriveSimulator, GapEffect, OperatingCondition
from gearsig.gap.start_stop._attribution import (
    RIPPLE,
    DriveEvidence,
    FittedDriveCause,
    attribute_drive,
    fit,
)
from gearsig.gap.start_stop._comparison import (
    TORQUE_GAIN,
    TRIED,
    WEAR,
    DriveComparison,
    SimulatedDrive,
    compare_drive,
    predict,
    read_cycles,
    tellable,
)
from gearsig.gap.start_stop._cycles import COMPRESSION, FEATURES, NAMES, UNITS, change_of, prediction_errors
from gearsig.motion import is_start_stop, measure_motion, motion_segments
from gearsig.recording import Recording
from gearsig.severity import CRACK


def diagnose_start_stop(
    recordings: Sequence[Recording],
    references: Sequence[Recording],
    simulator: DriveSimulator,
    effects: Mapping[str, GapEffect],
    tell: Stage,
) -> GapReport:
    """Diagnose the gap between start–stop recordings of one machine and its simulated drive; see `diagnose_gap`.

    Parameters
    ----------
    recordings, references : sequence of Recording
        With the angles (or speeds) of pinion and wheel, and preferably the torque between motor and pinion. Each is
        compared with the reference at the nearest torque. Each carries its rig, with a [contact] table.
    simulator : DriveSimulator
    effects : mapping
        Effects that may be named.
    tell : callable

    Returns
    -------
    GapReport
        Places, curves and steps are those of the recording with the largest difference.

    Raises
    ------
    RefusalError
        If a recording has no start and stop, or no motion of both gears, or the rig has no contact.
    """
    tell("reading the motion", 0.02)
    healthy = [read_cycles(reference) for reference in references]
    every = [compare_drive(read_cycles(now), healthy, simulator, now.name) for now in recordings]
    evidences = []
    for i, comparison in enumerate(every):

        def simulating(name: str, done: float, i: int = i) -> None:
            tell(f"simulating {name.replace('_', ' ')}", 0.1 + 0.7 * (i + done) / len(every))

        evidences.append(comparison.evidence(predict(comparison, effects, simulating)))
    tell("weighing", 0.85)
    attribution = attribute_drive(evidences, with_reference=bool(references))
    probabilities, fits = attribution.probabilities(), attribution.tried
    outcome = attribution.calibration.outcome(probabilities)
    compared, evidence = max(zip(every, evidences, strict=True), key=lambda both: both[0].floor().size(both[0].change))
    found = [_cause(name, p, effects, fits.get(name), compared, evidence) for name, p in probabilities.items()]
    causes = in_order(found, outcome)
    first, pair, is_named = causes[0], most_probable_two(causes), outcome in NAMING
    fitted = first.fitted if is_named else None
    repeated = compared.change / _repeatability_limit(compared)
    note = () if fitted is None else (fitted_text(first, fitted.severity, compared.name),)
    return GapReport(
        rig="" if recordings[0].rig is None else recordings[0].rig.name,
        simulator=simulator.name,
        conditions=tuple(_facts(c) for c in every),
        references=tuple(reference.name for reference in references),
        outcome=outcome,
        size=compared.floor().size_interval([compared.change], [compared.without]),
        repeatability=float(np.sqrt(np.nanmean(repeated**2))),
        places=drive_places(compared),
        causes=causes,
        steps=_steps(compared, evidence, first) if is_named else (),
        next_recordings=_next_recordings(compared, evidence, fits, pair, effects)
        if pair and outcome is not GapOutcome.NO_GAP
        else (),
        spectra=_torque_curves(compared, fitted),
        angles=_tooth_curves(compared, fitted, fits),
        notes=tuple(_messages(effects, every, compared, evidence)),
        twin_toml="" if fitted is None else compared.drive.twin.preset_toml(fitted, note),
    )


def _repeatability_limit(compared: DriveComparison) -> FloatArray:
    """Return the limit of the scatter between the recording's own cycles, for 19 of 20, in dB, (n,)."""
    return FLOOR_IN_DEVIATIONS * np.maximum(compared.scatter, 0.05)


def _facts(compared: DriveComparison) -> ConditionFacts:
    m = compared.now.motion
    top_rpm = float(np.quantile(np.abs(m.driver_speed_rad_s), 0.98)) * 30.0 / np.pi
    torque_nm = float("nan") if m.torque_nm is None else compared.drive.twin.point.torque_nm
    return ConditionFacts(
        compared.name,
        OperatingCondition(top_rpm, torque_nm),
        float(np.ptp(m.driver_angle_rad)) / (2.0 * np.pi),
        len(m.driver_angle_rad) / m.sampling_rate_hz,
        m.sampling_rate_hz,
    )


def _cause(
    name: str,
    probability: float,
    effects: Mapping[str, GapEffect],
    fitted: FittedDriveCause | None,
    compared: DriveComparison,
    evidence: DriveEvidence,
) -> GapCause:
    base = named_cause(name, probability, effects)
    if fitted is None:
        return base
    places = {CRACK: f"tooth {compared.spot.tooth + 1} of the pinion", RIPPLE: f"order {compared.order} of the pinion"}
    return replace(
        base,
        severity=fitted.severity,
        fitted=AddedEffect(name, float(f"{fitted.severity.value:.4g}"), evidence.predicted[name].options),
        place=places.get(name, ""),
        shrinkage=fitted.shrinkage,
        evidence=_evidence(fitted, compared),
    )


def _evidence(fitted: FittedDriveCause, compared: DriveComparison) -> tuple[Evidence, ...]:
    """Return predicted and observed changes: the cause's own, and those that it leaves unexplained."""
    floor, change, predicted = compared.floor(), compared.change, fitted.predicted
    limit, observed = floor.limit, np.nan_to_num(change - floor.centre)
    free = np.isin(NAMES, TRIED[fitted.name].may_move)
    size = np.maximum(np.abs(predicted) / limit, np.where(free, 0.0, np.abs(observed) / limit))
    known = [i for i in np.argsort(-size) if np.isfinite(change[i])]
    kept = [i for i in known if abs(predicted[i]) > MIN_SIGN_FLOORS * limit[i] or size[i] > 1.0][:6]
    return tuple(
        evidence_of_feature(
            FEATURES[NAMES[i]].words,
            float(predicted[i]),
            float(observed[i]),
            float(limit[i]),
            min_floors=MIN_SIGN_FLOORS,
        )
        for i in kept
    )


def _steps(compared: DriveComparison, evidence: DriveEvidence, cause: GapCause) -> tuple[GapStep, ...]:
    """Return what remains of the whole gap: before, and with an effect fitted to the other half of the cycles."""
    floor, predicted = compared.floor(of_half=True), evidence.predicted[cause.name]
    fitted = [fit(predicted, fold.fitted, floor).predicted for fold in evidence.folds]

    def remaining(predictions: Sequence[FloatArray]) -> Interval:
        pairs = list(zip(evidence.folds, predictions, strict=True))
        return floor.size_interval([fold.scored - t for fold, t in pairs], [fold.again - t for fold, t in pairs])

    return GapStep("before", remaining([0.0 * change for change in fitted])), GapStep(cause.title, remaining(fitted))


def _messages(
    effects: Mapping[str, GapEffect],
    every: Sequence[DriveComparison],
    clearest: DriveComparison,
    evidence: DriveEvidence,
) -> Iterator[str]:
    """Yield messages about causes not considered, assumptions made, and effects too small for the recording to show."""
    known = set.intersection(*(set(tellable(c, effects)) for c in every))
    missing = [effects[name].title for name in TRIED if name in effects and name not in known]
    if missing:
        lacking = [c.name for c in every if c.now.motion.torque_nm is None]
        why = "only a healthy reference shows what is normal"
        if lacking:
            why = f"no torque was recorded in {', '.join(lacking)}"
        yield f"Not considered, because {why}: {', '.join(missing)}. Such a cause would appear as none or unknown."
    if every[0].reference is not None:
        yield (
            "Tooth and order count from the zero of the pinion's encoder, which must be the same in both recordings. "
            "In the figures of torque and teeth, the healthy reference takes the place of the simulation before."
        )
    for c in every:
        if c.now.n_cycles < 4:
            yield f"{c.name} has {c.now.n_cycles} starts: how far the gap shrinks rests on few cycles."
        if not c.features.play_um > 0.0:
            yield f"{c.name} loads one flank only: its play is not known; record a stop with the brake."
    hidden = []
    for name, cause in evidence.predicted.items():
        min_severity = cause.minimum_severity(clearest.floor())
        unit, title = severity_unit(effects[name].unit), effects[name].title
        if np.isfinite(min_severity):
            hidden.append(f"{title} below {readable(min_severity, 2)} {unit}".rstrip())
        else:
            max_severity = f"{readable(float(cause.severities[-1]), 2)} {unit}".rstrip()
            hidden.append(f"{title} at all (up to {max_severity} were tried)")
    if hidden:
        yield f"This recording would not show: {'; '.join(hidden)}."


def drive_places(compared: DriveComparison) -> tuple[GapPlace, ...]:
    """Return where a recording differs, largest share first; then the phases of motion with the worst predictions.

    With z a change over its floor, the share is max(z² − 1, 0)/Σ max(z² − 1, 0); places with more than 1 % are
    returned.
    """
    floor, spot, m = compared.floor(), compared.spot, compared.now.motion
    distance = compared.change - floor.centre
    z = np.nan_to_num(np.abs(distance) / floor.limit)
    repeated = np.abs(np.nan_to_num(compared.change)) / _repeatability_limit(compared)
    energies = np.maximum(z**2 - 1.0, 0.0)
    shares = energies / max(float(np.sum(energies)), 1e-300)
    titles = _titles(compared)
    shafts = dict.fromkeys(("tooth", "ripple", "driver_wave"), "pinion")
    shafts |= dict.fromkeys(("driven_wave", "off_centre"), "wheel")
    n_teeth, n_driven = m.path.teeth
    orders = {"ripple": float(compared.order), "driver_wave": 1.0, "driven_wave": n_teeth / n_driven}
    places = []
    for i in np.argsort(-energies):
        name, is_tooth = NAMES[i], NAMES[i] == "tooth"
        if shares[i] > 0.01:
            places.append(
                GapPlace(
                    FEATURES[name].kind,
                    titles.get(name, FEATURES[name].words),
                    float(distance[i]),
                    float(repeated[i]),
                    float(z[i]),
                    float(shares[i]),
                    shaft=shafts.get(name, ""),
                    orders=(orders[name],) if name in orders else (),
                    angle_deg=360.0 * (spot.tooth + 0.5) / n_teeth if is_tooth else None,
                    tooth=spot.tooth + 1 if is_tooth else None,
                    follows=FEATURES[name].follows,
                )
            )
    return (*places, *_phases(compared))


def _titles(compared: DriveComparison) -> dict[str, str]:
    """Return each change as a phrase with its values."""
    now, baseline, spot = compared.features, compared.baseline, compared.spot

    def pair(name: str, unit: str) -> str:
        return beside(getattr(now, name), getattr(baseline, name), unit)

    def beside(a: float, b: float, unit: str) -> str:
        return f"{readable(float(a), 3)}{' ' if unit else ''}{unit} against {readable(float(b), 3)}"

    def size(difference: FloatArray, unit: str) -> str:
        return f"{readable(float(np.hypot(*difference)), 2)} {unit}"

    curve, waves = now.curve_um - baseline.curve_um, now.waves_um - baseline.waves_um
    span = f"{readable(float(np.nanmax(curve) - np.nanmin(curve)), 2)} µm" if np.any(np.isfinite(curve)) else "– µm"
    extra_um = readable(float((now.teeth_um - baseline.teeth_um)[spot.tooth]), 2)
    ripple = beside(100 * now.ripple[spot.order], 100 * baseline.ripple[spot.order], "% of its mean")
    return {
        "play": f"where the drive stops and the back flank takes over: play {pair('play_um', 'µm')}",
        "deflection": f"under load: teeth yield by {pair('deflection_um', 'µm')}",
        "curve": f"drive flank, over each mesh cycle: its curve differs by {span}",
        "inertia": f"in starts and stops, torque per acceleration of the load: {pair('inertia_kg_m2', 'kg·m²')}",
        "load_friction": f"while the load turns, torque that does not accelerate it: {pair('friction_nm', 'N·m')}",
        "flank_friction": f"loaded flanks, friction coefficient {pair('flank_friction', '')}",
        "tooth": f"drive flank, tooth {spot.tooth + 1} of the pinion yields {extra_um} µm more than the median tooth",
        "ripple": f"torque while running, order {compared.order} of the pinion: {ripple}",
        "driver_wave": f"compression once per revolution of the pinion: a wave of {size(waves[:2], 'µm')}",
        "driven_wave": f"compression once per revolution of the wheel: a wave of {size(waves[2:], 'µm')}",
        "off_centre": "load once per revolution of the wheel: a torque of "
        f"{size(now.off_centre_nm - baseline.off_centre_nm, 'N·m')}",
        "impact": f"hardest impact of the flanks: {pair('impact_mps', 'm/s')}",
    }


def _phases(compared: DriveComparison) -> list[GapPlace]:
    """Return the phases whose motion or torque is predicted worse, by 3 dB, than for the healthy machine itself."""
    healthy = compared.drive.healthy_run if compared.reference is None else compared.reference
    now, baseline = (prediction_errors(cycles, compared.baseline) for cycles in (compared.now, healthy))
    nothing = float("nan")
    places = []
    for (quantity, phase, flank), rms in now.items():
        usual = baseline.get((quantity, phase, flank), nothing)
        change_db = float(20.0 * np.log10(max(rms, 1e-9) / max(usual, 1e-9)))
        if np.isfinite(change_db) and change_db > 3.0:
            title = (
                f"{phase}{f', {flank} flank' if flank else ''}: measured {quantity} is {readable(rms, 2)} "
                f"{UNITS[quantity]} off its prediction, normally {readable(usual, 2)}"
            )
            channel = "" if quantity == COMPRESSION else quantity
            kind = PlaceKind.SPEED
            places.append(GapPlace(kind, title, change_db, channel=channel, follows=True))
    return sorted(places, key=lambda place: -place.change_db)[:3]


def _torque_curves(compared: DriveComparison, fitted: AddedEffect | None) -> tuple[SpectrumCurves, ...]:
    """Return the torque by order of the pinion while running; empty without torque."""
    cycles, now, baseline = compared.now, compared.features.ripple, compared.baseline.ripple
    if cycles.motion.torque_nm is None or not np.all(np.isfinite(now)) or not np.all(np.isfinite(baseline)):
        return ()
    mean_nm = float(np.quantile(np.abs(cycles.motion.torque_nm), 0.9))
    every = cycles.every
    rows = np.array([cycles.features(tuple(c for c in every if c != cycle)).ripple for cycle in every])
    scatter = np.sqrt(jackknife_variance(rows))
    after = baseline.copy() if fitted is not None else np.zeros(0)
    if fitted is not None and fitted.name == RIPPLE:
        after[compared.spot.order] = np.hypot(after[compared.spot.order], 0.01 * fitted.severity)
    # The limit for a line of healthy drives: the floor of the ripple, converted to a fraction of the mean torque.
    limit = float(compared.floor().limit[NAMES.index("ripple")])
    part = 2.0 * compared.spot.ripple_step * float(np.sinh(limit * np.log(10.0) / 20.0))
    return (
        SpectrumCurves(
            "torque while running, over the pinion's revolution",
            "N m",
            cycles.orders.astype(np.float64),
            mean_nm * now,
            mean_nm * baseline,
            mean_nm * after,
            mean_nm * FLOOR_IN_DEVIATIONS * np.maximum(scatter, 1e-5),
            20.0 * np.log10(1.0 + part / np.maximum(baseline, 1e-5)),
        ),
    )


def _tooth_curves(
    compared: DriveComparison, fitted: AddedEffect | None, fits: Mapping[str, FittedDriveCause]
) -> tuple[AngleCurves, ...]:
    """Return each tooth's yield beyond the median tooth as 1 + (extra/floor)², which is 1 for healthy teeth."""
    now, baseline, spot = compared.features.teeth_um, compared.baseline.teeth_um, compared.spot
    n = len(now)
    if np.sum(np.isfinite(now)) < 0.8 * n:
        return ()

    def energy(extra_um: FloatArray) -> FloatArray:
        return 1.0 + (np.maximum(np.nan_to_num(extra_um), 0.0) / spot.tooth_step_um) ** 2

    after: FloatArray = np.zeros(0)
    if fitted is not None:
        teeth = np.nan_to_num(baseline)
        if fitted.name == CRACK:  # from the predicted change back to µm
            over = float(fits[CRACK].predicted[NAMES.index("tooth")]) * np.log(10.0) / 20.0
            over += np.arcsinh(0.5 * spot.next_tooth_um / spot.tooth_step_um)
            teeth[spot.tooth] += 2.0 * spot.tooth_step_um * np.sinh(over)
        after = energy(teeth)
    angle = 360.0 * (np.arange(n) + 0.5) / n
    return (AngleCurves("pinion", "µm²", n, True, angle, energy(now), energy(baseline), after),)


def _next_recordings(
    compared: DriveComparison,
    evidence: DriveEvidence,
    fits: Mapping[str, FittedDriveCause],
    pair: tuple[str, str],
    effects: Mapping[str, GapEffect],
) -> tuple[NextRecording, ...]:
    """Return starts and stops at other torques that put the predictions of two causes further apart, best first."""
    limit = compared.floor().limit
    healthy_friction_nm = compared.drive.healthy.friction_nm

    def predicted(name: str, drive: SimulatedDrive) -> FloatArray:
        """Return the change predicted for another drive, where the cause is expected to show."""
        if name in (WEAR, CRACK, TORQUE_GAIN):
            return fits[name].predicted
        added = AddedEffect(name, fits[name].severity.value, evidence.predicted[name].options)
        change = change_of(drive.features(added), drive.healthy, compared.drive.shape, compared.spot)
        return np.where(np.isin(NAMES, effects[name].shows_in), np.nan_to_num(change), 0.0)

    def apart(first: FloatArray, second: FloatArray) -> float:
        return float(np.sqrt(np.sum(((first - second) / limit) ** 2)))

    now = apart(*(fits[name].predicted for name in pair))
    recordings = []
    for factor in (0.7, 1.5):
        drive = compared.drive.at_torque(factor)
        # The features are comparable only if the healthy drive gives the same load friction at the other torque.
        if not abs(drive.healthy.friction_nm - healthy_friction_nm) < 0.1 * healthy_friction_nm:
            continue
        try:
            distance = apart(*(predicted(name, drive) for name in pair))
        except GearsigError:
            continue
        if distance > 1.1 * now:
            titles = " and ".join(effects[name].title for name in pair)
            text = (
                f"starts and stops at {drive.twin.point.torque_nm:.3g} N·m; {titles} are then "
                f"{distance:.2g} structural floors apart instead of {now:.2g}."
            )
            recordings.append(NextRecording(drive.twin.point, pair, distance, now, text))
    return tuple(sorted(recordings, key=lambda recording: -recording.standard_deviations))


def refuse_start_stop(recordings: Sequence[Recording], model: str) -> None:
    """Refuse recordings of starts and stops for a model of continuous running.

    Raises
    ------
    RefusalError
        It names the model to use instead.
    """
    for recording in recordings:
        if recording.rig is None or recording.rig.contact is None:
            continue
        try:
            motion = measure_motion(recording, recording.rig)
            starts = is_start_stop(motion_segments(motion.driver_angle_rad, motion.sampling_rate_hz))
        except GearsigError:
            continue
        if starts:
            raise RefusalError(
                f"{recording.name} starts and stops: the model {model} is compared by orders, which need a shaft that "
                "turns continuously",
                remedy="--model forging",
            )
