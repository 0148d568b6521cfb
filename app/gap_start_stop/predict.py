"""What the simulated drive predicts of every cause: how far what its cycles tell would change."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from app.gap_start_stop.twin import DriveTwin, worn_curve_um
from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.gap import (
    NAMES,
    DriveFloor,
    FittedDriveCause,
    GapEffect,
    Interval,
    LocatedDriveChange,
    Predicted,
    PreparedCycles,
    Shrinkage,
    Told,
    change_of,
    evidences,
    fit,
    halves,
    load_floor,
    own_features,
    score_of,
    shares,
    shrink,
    spot_of,
)
from sims.effects import EffectSetting, effect
from sims.forging import PARAMETERS, WITH_MEANING, with_effects
from sims.simulator import complete_values

# --------------------
# The causes that a start–stop gap may have, and what each does to the simulated drive.
# --------------------


LOAD_INERTIA, LOAD_FRICTION, TORQUE_GAIN = "load_inertia", "load_friction", "torque_gain"


@dataclass(frozen=True)
class SeverityGrid:
    """Severities that are simulated.

    Parameters
    ----------
    severities : tuple of float
        Rising, in the effect's unit.
    shows_in : tuple of str
        Changes (`gearsig.gap.NAMES`) that it is expected in: what it moves of the others is the
        simulated run's own chance.
    may_move : tuple of str
        Changes that it moves on real teeth and not in the simulated drive: they speak neither for nor against it.
    direct : tuple of str
        Changes that measure the severity itself.
    needs : str
        Channel without which it cannot be told: "torque", or empty.
    needs_reference : bool
        Whether the sound value stands in no drawing.
    """

    severities: tuple[float, ...]
    shows_in: tuple[str, ...]
    may_move: tuple[str, ...] = ()
    needs: str = ""
    needs_reference: bool = False
    direct: tuple[str, ...] = ()


_ROUGH = ("contact_scatter", "load_scatter")
TRIED: Mapping[str, SeverityGrid] = {
    "backlash": SeverityGrid((60.0, 180.0, 500.0), ("play", "impact"), direct=("play",)),
    "tooth_wear": SeverityGrid(
        (12.0, 25.0, 50.0, 100.0, 200.0), ("play", "curve"), ("deflection", "flank_friction", "impact", *_ROUGH)
    ),
    "sliding_friction": SeverityGrid((0.03, 0.09, 0.2), ("flank_friction",), ("curve", *_ROUGH), "torque"),
    LOAD_FRICTION: SeverityGrid(
        (8.0, 20.0, 45.0), ("load_friction",), (), "torque", needs_reference=True, direct=("load_friction",)
    ),
    "root_crack": SeverityGrid((1.0, 2.0, 4.0, 6.0, 8.0, 10.0), ("tooth",), (), "torque"),
    LOAD_INERTIA: SeverityGrid(
        (-50.0, -25.0, 40.0, 120.0), ("inertia",), ("load_scatter",), "torque", direct=("inertia",)
    ),
    TORQUE_GAIN: SeverityGrid(
        (-40.0, -20.0, 25.0, 60.0), ("inertia", "load_friction", "deflection"), ("flank_friction", *_ROUGH), "torque"
    ),
    "torque_ripple": SeverityGrid((1.5, 5.0, 15.0), ("ripple",), ("next_ripple", *_ROUGH), "torque"),
}
"""Of each cause."""

OF_PARAMETERS = {
    LOAD_INERTIA: GapEffect(
        LOAD_INERTIA,
        "drive and load",
        "another inertia of the load",
        "added_percent",
        "%",
        "torque against acceleration of the driven gear, in starts and stops",
        TRIED[LOAD_INERTIA].shows_in,
    ),
    LOAD_FRICTION: GapEffect(
        LOAD_FRICTION,
        "drive and load",
        "more friction of the load's bearings",
        "added_percent",
        "%",
        "torque that turns the load without accelerating it",
        TRIED[LOAD_FRICTION].shows_in,
    ),
    TORQUE_GAIN: GapEffect(
        TORQUE_GAIN,
        "measurement",
        "a torque sensor that reads too much or too little",
        "added_percent",
        "%",
        "inertia and friction of the load seem to change alike",
        TRIED[TORQUE_GAIN].shows_in,
    ),
}
"""What no effect of the catalogue is: parameters of the drive or of its sensors that may be wrong."""


def drive_effects() -> dict[str, GapEffect]:
    """Return every cause as the diagnosis sees it."""
    found = {name: _of_catalogue(name) for name in TRIED if name in WITH_MEANING}
    return {name: found.get(name) or OF_PARAMETERS[name] for name in TRIED}


def parameters_with(name: str, severity: float, parameters: Mapping[str, float | str]) -> dict[str, float | str]:
    """Return a drive's parameters with a cause that is a parameter's wrong value; others leave them as they are."""
    factor = 1.0 + 0.01 * severity
    if name == LOAD_INERTIA:
        return {**parameters, "wheel_inertia_kg_m2": float(parameters["wheel_inertia_kg_m2"]) * factor}
    if name == LOAD_FRICTION:
        both = ("load_friction_nm", "load_viscous_nm_s_per_rad")
        return {**parameters, **{key: float(parameters[key]) * factor for key in both}}
    if name == TORQUE_GAIN:  # what was read off the recording was misread as well
        read = ("brake_nm", "drag_nm", "drag_viscous_nm_s_per_rad")
        return {**parameters, **{key: float(parameters[key]) / factor for key in read}, "torque_gain": factor}
    return dict(parameters)


def setting_of(name: str, severity: float, options: Mapping[str, float | str]) -> tuple[EffectSetting, ...]:
    """Return the catalogue's setting of a cause; none where it is a parameter's value."""
    return () if name in OF_PARAMETERS else (EffectSetting(name, severity, dict(options)),)


def _of_catalogue(name: str) -> GapEffect:
    found = effect(name)
    return GapEffect(
        found.name, found.group, found.title, found.severity.name, found.severity.unit, "", TRIED[name].shows_in
    )


Tell = Callable[[str, float], object]


@dataclass(frozen=True)
class Predictions:
    """All causes, and the shape of worn flanks that their changes were measured with."""

    causes: dict[str, Predicted]
    shape: FloatArray
    options: dict[str, dict[str, float | str]]


def curve_shape(twin: DriveTwin) -> FloatArray:
    """Return the course of the compression over the mesh cycle that flanks worn by 50 µm give, its mean taken off."""
    curve = worn_curve_um(twin.parameters, twin.sound.contact.deflection_um, 50.0)
    shape: FloatArray = curve - np.mean(curve)
    return shape


def predict(
    twin: DriveTwin,
    spot: LocatedDriveChange,
    order: int,
    names: tuple[str, ...],
    tell: Tell = lambda *_: None,
    *,
    with_reference: bool = True,
) -> Predictions:
    """Simulate every cause at some severities.

    Worn flanks and a cracked tooth move the gears against each other by hundredths of a millimetre; that is added to
    what the sound drive tells, without the noise of a run: the play by the mean depth over the mesh cycle, the curve by
    its shape (the drive in motion agrees, see the tests), a tooth by what its lost stiffness lets it yield. A sensor
    that misreads changes no motion. All others are run.

    Parameters
    ----------
    twin : DriveTwin
    spot : Spot
        Where the recording changed most: the tooth that is cracked, and the place of the ripple's order.
    order : int
        Of the ripple.
    names : tuple of str
        Causes that the recording can tell.
    tell : callable
        Is told the cause and the share that is done.
    with_reference : bool
        Whether a sound recording is compared with, and not the simulated drive.
    """
    shape = curve_shape(twin)
    options: dict[str, dict[str, float | str]] = {
        "root_crack": {"gear": "driver", "tooth": float(spot.tooth + 1)},
        "torque_ripple": {"order": float(order)},
    }
    causes = {}
    for i, name in enumerate(names):
        tell(name, i / len(names))
        rows, kept = [], []
        shown = np.isin(NAMES, TRIED[name].shows_in)
        for severity in TRIED[name].severities:
            told = (
                _misread(twin, severity, with_reference=with_reference)
                if name == TORQUE_GAIN
                else _told(twin, name, severity, options.get(name, {}), spot)
            )
            change = None if told is None else change_of(told, twin.sound, shape, spot)
            if change is not None and np.isfinite(change[shown]).any():  # else it stands still
                rows.append(change)
                kept.append(severity)
        if rows:
            changes = np.where(shown, np.nan_to_num(np.array(rows)), 0.0)
            free, direct = (np.isin(NAMES, which) for which in (TRIED[name].may_move, TRIED[name].direct))
            causes[name] = Predicted(name, np.array(kept), changes, free, direct)
    return Predictions(causes, shape, {name: options.get(name, {}) for name in causes})


def _told(
    twin: DriveTwin, name: str, severity: float, options: dict[str, float | str], spot: LocatedDriveChange
) -> Told | None:
    """Return what a drive with a cause tells; None where it cannot run: a load that cannot be moved, say."""
    if name == "tooth_wear":
        return _worn(twin, severity)
    try:
        settings = setting_of(name, severity, options)
        if name == "root_crack":
            return _cracked(twin, settings[0], spot)
        return twin.tell(parameters_with(name, severity, twin.parameters), settings)
    except GearsigError:
        return None


def _worn(twin: DriveTwin, depth_um: float) -> Told:
    sound = twin.sound
    curve = worn_curve_um(twin.parameters, sound.contact.deflection_um, depth_um)
    mean = float(np.mean(curve))
    contact = replace(
        sound.contact,
        play_um=sound.contact.play_um + mean,
        curve_um=sound.contact.curve_um + curve - mean,
    )
    return replace(sound, contact=contact)


def _misread(twin: DriveTwin, percent: float, *, with_reference: bool) -> Told:
    """Return what a torque sensor of another gain makes of the same motion.

    Inertia and friction of the load follow from the torque, and grow with the reading. What the teeth yield does not:
    it stays as in a sound recording, and falls behind a simulated drive, which is driven by the torque that was read.
    That one also takes the friction of its load from the recording.
    """
    gain, sound = 1.0 + 0.01 * percent, twin.sound
    load = replace(sound.load, inertia_kg_m2=gain * sound.load.inertia_kg_m2)
    if with_reference:
        return replace(sound, load=replace(load, friction_nm=gain * sound.load.friction_nm))
    yielding = sound.contact.deflection_um * gain ** (-1.0 / float(twin.parameters["exponent"]))
    return replace(sound, load=load, contact=replace(sound.contact, deflection_um=yielding))


def _cracked(twin: DriveTwin, setting: EffectSetting, spot: LocatedDriveChange) -> Told:
    """Let one tooth yield more, g grows as (1 − loss)^{−1/λ}, among teeth that differ as the recording's do."""
    values = complete_values(PARAMETERS, twin.parameters)
    _, weak = with_effects(values, (setting,))
    assert weak is not None  # noqa: S101  a crack of some depth makes a tooth weak
    sound = twin.sound
    extra = sound.contact.deflection_um * ((1.0 - weak.loss) ** (-1.0 / float(twin.parameters["exponent"])) - 1.0)
    teeth = sound.contact.teeth_um.copy()
    teeth[(spot.tooth + len(teeth) // 2) % len(teeth)] += spot.next_tooth_um
    teeth[spot.tooth] += max(extra, spot.next_tooth_um)
    return replace(sound, contact=replace(sound.contact, teeth_um=teeth))


# --------------------
# A start–stop recording against what it should be: changes of the whole, of either half, and without each cycle.
# --------------------


MOST_BLOCKS = 8
HALF = float(np.sqrt(2.0))
"""By which half of the cycles scatter more."""


@dataclass(frozen=True)
class DriveComparison:
    """One recording beside its sound reference, or beside the simulated drive.

    Parameters
    ----------
    name : str
    now : Examined
    reference : Examined or None
    twin : DriveTwin
    """

    name: str
    now: PreparedCycles
    reference: PreparedCycles | None
    twin: DriveTwin

    @cached_property
    def other(self) -> Told:
        """What it is compared with."""
        return self.twin.sound if self.reference is None else self.reference.tell(self.reference.every)

    @cached_property
    def sound_run(self) -> PreparedCycles:
        """A run of the sound simulated drive."""
        return self.twin.examine(self.twin.parameters)

    @cached_property
    def told(self) -> Told:
        """What all cycles tell."""
        return self.now.tell(self.now.every)

    @cached_property
    def shape(self) -> FloatArray:
        """Of worn flanks."""
        return curve_shape(self.twin)

    @cached_property
    def spot(self) -> LocatedDriveChange:
        """Tooth and order that changed most."""
        return spot_of(self.told, self.other)

    @cached_property
    def change(self) -> FloatArray:
        """Of all cycles."""
        return change_of(self.told, self.other, self.shape)

    def change_in(self, cycles: tuple[int, ...], at: LocatedDriveChange | None = None) -> FloatArray:
        """Return the change of some cycles."""
        return change_of(self.now.tell(cycles), self.other, self.shape, at)

    @property
    def halves(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Every second cycle, and the others."""
        return halves(self.now.cycles)

    @cached_property
    def without(self) -> FloatArray:
        """Changes without each cycle (or each of eight blocks of them), (n_blocks, n): the tooth and order stay."""
        return np.array([self.change_in(kept, self.spot) for kept in _but_each(self.now.every)])

    @cached_property
    def scatter(self) -> FloatArray:
        """Standard errors of the change, from the cycles of the recording and of its reference (jackknife)."""
        spread: FloatArray = np.hypot(_jackknife(self.without), _jackknife(self._without_of_reference))
        return spread

    @property
    def _without_of_reference(self) -> FloatArray:
        """Changes against the reference without each of its cycles; a simulated drive has no noise."""
        if self.reference is None:
            return np.zeros((1, len(NAMES)))
        kept = _but_each(self.reference.every)
        return np.array([change_of(self.told, self.reference.tell(one), self.shape, self.spot) for one in kept])

    def floor(self, part: str = "whole") -> DriveFloor:
        """Return how far sound drives lie from what this is compared with, as far as it can be told of this one."""
        floor = load_floor(with_reference=self.reference is not None, part=part)
        return floor.widened(self.scatter * (1.0 if part == "whole" else HALF))


def _but_each(every: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return all cycles but one, for each; or but one of eight blocks."""
    blocks = np.array_split(np.array(every), min(len(every), MOST_BLOCKS))
    return [tuple(c for c in every if c not in block) for block in blocks]


def _jackknife(rows: FloatArray) -> FloatArray:
    """Return the standard error by leaving out each block, (n,)."""
    n = len(rows)
    spread: FloatArray = np.sqrt((n - 1.0) * np.nanvar(np.nan_to_num(rows), axis=0))
    return spread


# --------------------
# Causes weighed against each other: evidence on all cycles, and shrink on those that a severity was not fitted to.
# --------------------


HELD_OUT = "starts and stops that it was not fitted to"
PLACED = {"root_crack": "tooth", "torque_ripple": "order"}
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
    folds : tuple of Fold
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


def seen_of(compared: DriveComparison, predicted: Mapping[str, Predicted]) -> DriveEvidence:
    """Reduce a recording to its changes."""
    first, second = compared.halves
    folds = tuple(_fold(compared, a, b) for a, b in ((first, second), (second, first)))
    return DriveEvidence(compared.change, folds, predicted, compared.reference is not None, compared.scatter)


def _fold(compared: DriveComparison, ours: tuple[int, ...], theirs: tuple[int, ...]) -> CycleFold:
    here = compared.now.tell(ours)
    spot = spot_of(here, compared.other)
    blocks = [tuple(c for c in theirs if c != one) for one in theirs] if len(theirs) > 1 else [theirs]
    n_teeth, n_orders = len(here.contact.teeth_um), len(here.ripple)
    steps = [1 + i * max(1, n_teeth // (N_PLACEBOS + 1)) for i in range(N_PLACEBOS)]
    teeth = [replace(spot, tooth=(spot.tooth + step) % n_teeth) for step in steps]
    orders = [replace(spot, order=(spot.order + 3 + 4 * i) % n_orders) for i in range(N_PLACEBOS)]
    return CycleFold(
        compared.change_in(ours, spot),
        compared.change_in(theirs, spot),
        np.array([compared.change_in(kept, spot) for kept in blocks]),
        {
            "root_crack": np.array([compared.change_in(theirs, s) for s in teeth]),
            "torque_ripple": np.array([compared.change_in(theirs, s) for s in orders]),
        },
    )


def weigh(every: Sequence[DriveEvidence], floors: tuple[DriveFloor, DriveFloor]) -> DriveAttribution:
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
