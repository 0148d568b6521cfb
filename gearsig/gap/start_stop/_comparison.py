"""A start–stop recording beside its reference or its simulated drive: what changed, and what a cause changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.gap._simulator import Added, DriveFacts, DriveSimulator, DriveTwin, GapEffect, OperatingCondition
from gearsig.gap.start_stop._attribution import (
    HALF,
    N_PLACEBOS,
    CycleFold,
    DriveEvidence,
    DriveFloor,
    Predicted,
    load_floor,
)
from gearsig.gap.start_stop._features import (
    N_PLACES,
    NAMES,
    PHASES,
    CycledMotion,
    CycleFeatures,
    LocatedDriveChange,
    PreparedCycles,
    change_of,
    cut_cycles,
    halves,
    spot_of,
)
from gearsig.motion import PairMotion, measure_motion

# --------------------
# The causes that a start–stop gap may have, and which changes show them.
# --------------------


LOAD_INERTIA, LOAD_FRICTION, TORQUE_GAIN = "load_inertia", "load_friction", "torque_gain"
RIPPLE, CRACK, WEAR = "torque_ripple", "root_crack", "tooth_wear"


@dataclass(frozen=True)
class SeverityGrid:
    """Severities that are simulated.

    Parameters
    ----------
    severities : tuple of float
        Rising, in the effect's unit.
    may_move : tuple of str
        Changes that it moves on real teeth and not in the simulated drive: they speak neither for nor against it.
    direct : tuple of str
        Changes that measure the severity itself.
    needs : str
        Channel without which it cannot be told: "torque", or empty.
    needs_reference : bool
        Whether the healthy value stands in no drawing.
    """

    severities: tuple[float, ...]
    may_move: tuple[str, ...] = ()
    needs: str = ""
    needs_reference: bool = False
    direct: tuple[str, ...] = ()


_ROUGH = ("contact_scatter", "load_scatter")
TRIED: Mapping[str, SeverityGrid] = {
    "backlash": SeverityGrid((60.0, 180.0, 500.0), direct=("play",)),
    WEAR: SeverityGrid((12.0, 25.0, 50.0, 100.0, 200.0), ("deflection", "flank_friction", "impact", *_ROUGH)),
    "sliding_friction": SeverityGrid((0.03, 0.09, 0.2), ("curve", *_ROUGH), "torque"),
    LOAD_FRICTION: SeverityGrid((8.0, 20.0, 45.0), needs="torque", needs_reference=True, direct=("load_friction",)),
    CRACK: SeverityGrid((1.0, 2.0, 4.0, 6.0, 8.0, 10.0), needs="torque"),
    LOAD_INERTIA: SeverityGrid((-50.0, -25.0, 40.0, 120.0), ("load_scatter",), "torque", direct=("inertia",)),
    TORQUE_GAIN: SeverityGrid((-40.0, -20.0, 25.0, 60.0), ("flank_friction", *_ROUGH), "torque"),
    RIPPLE: SeverityGrid((1.5, 5.0, 15.0), ("next_ripple", *_ROUGH), "torque"),
}
"""Of each cause. Which changes it is expected in stands in its `GapEffect.shows_in`, names of
`gearsig.gap.start_stop.NAMES`: what it moves of the others is the simulated run's own chance."""

# --------------------
# The simulated drive: how the machine is driven, read off its recording, and what its own cycles tell.
# --------------------


MIN_BRAKE = 0.5
"""Of the motor's torque: in a stop the back flanks must carry, for the play to be told."""
ORDINARY_FRICTION = 0.5
"""Of the drive's torque on the load, where no torque says more."""
USUAL_INERTIA_KG_M2 = 45.0
"""Of the driven gear, where the rig states none."""


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive's twin with what the cycles of its runs tell; the healthy run is simulated once.

    Parameters
    ----------
    twin : DriveTwin
    exponent : float
        λ of the contact law.
    """

    twin: DriveTwin
    exponent: float

    @property
    def point(self) -> OperatingCondition:
        """Torque and speed of the open valve."""
        return self.twin.point

    @cached_property
    def healthy_run(self) -> PreparedCycles:
        """A run without any effect."""
        return self._cycles(())

    @cached_property
    def healthy(self) -> CycleFeatures:
        """What the healthy drive's cycles tell."""
        return _of_all(self.healthy_run)

    @cached_property
    def shape(self) -> FloatArray:
        """Profile of the compression over the mesh cycle that flanks worn by 50 µm give, its mean taken off."""
        curve = self.worn_curve_um(50.0)
        shape: FloatArray = curve - np.mean(curve)
        return shape

    def worn_curve_um(self, depth_um: float) -> FloatArray:
        """See `DriveTwin.worn_curve_um`."""
        return self.twin.worn_curve_um(self.healthy.contact.deflection_um, depth_um, N_PLACES)

    def features(self, *added: Added) -> CycleFeatures:
        """Run the drive with effects and return what its cycles tell."""
        return _of_all(self._cycles(added))

    def at_torque(self, factor: float) -> SimulatedDrive:
        """Return the drive with another torque of the motor."""
        return replace(self, twin=self.twin.at_torque(factor))

    def _cycles(self, added: Sequence[Added]) -> PreparedCycles:
        return PreparedCycles(cut_cycles(measure_motion(self.twin.run(added), use={"force": ""})))


def _of_all(run: PreparedCycles) -> CycleFeatures:
    """Return what all cycles of a run tell; teeth that a short run does not pass are like the others."""
    features = run.features(run.every)
    return replace(features, contact=replace(features.contact, teeth_um=np.nan_to_num(features.contact.teeth_um)))


def simulated_drive(
    simulator: DriveSimulator, cycles: CycledMotion, features: CycleFeatures, healthy: CycleFeatures | None
) -> SimulatedDrive:
    """Set a simulated drive to a rig and a recording.

    Geometry, inertias, contact, friction of the flanks and play are the rig's; where a healthy recording tells play,
    inertia and friction better, they are that recording's. Times of valve and brake, friction of the load and the speed
    that the flow allows are the recording's own: how the machine is driven is no gap.
    """
    m = cycles.motion
    contact, ratio = m.contact, m.path.teeth[1] / m.path.teeth[0]
    torque_nm, brake_nm = _torques(m)
    friction_nm = features.load.friction_nm if healthy is None else healthy.load.friction_nm
    if not 0.0 < friction_nm < 0.9 * torque_nm * ratio:
        friction_nm = ORDINARY_FRICTION * torque_nm * ratio
    inertia = contact.driven_inertia_kg_m2 or USUAL_INERTIA_KG_M2
    contact = replace(contact, driven_inertia_kg_m2=inertia)
    if healthy is not None and healthy.contact.play_um > 0.0:
        contact = replace(contact, half_backlash_um=0.5 * healthy.contact.play_um)
    if healthy is not None and healthy.load.inertia_kg_m2 > 0.0:
        contact = replace(contact, driven_inertia_kg_m2=healthy.load.inertia_kg_m2)
    top_speed = float(np.quantile(np.abs(m.driver_speed_rad_s), 0.98))
    on_s, off_s = _times(cycles)
    facts = DriveFacts(m.path, contact, _module_mm(m), torque_nm, brake_nm, friction_nm, top_speed, on_s, off_s)
    return SimulatedDrive(simulator.drive_twin_of(facts), contact.exponent)


def _module_mm(m: PairMotion) -> float:
    """Module from the base pitch: 20° is what the path was made with, unless the rig says otherwise."""
    r1 = m.path.base_radii_m[0]
    pitch_radius = m.path.length_m * r1 / sum(m.path.base_radii_m)  # tan α times the base radius
    reference = float(np.hypot(r1, pitch_radius))
    return round(2e3 * reference / m.path.teeth[0], 6)


def _torques(m: PairMotion) -> tuple[float, float]:
    """Return the motor's torque and the brake's; without a torque usual ones, which carry the load's inertia."""
    if m.torque_nm is None:
        ratio = m.path.teeth[1] / m.path.teeth[0]
        fastest = float(np.quantile(m.driven_acceleration_rad_s2, 0.98))
        torque = 2.0 * (m.contact.driven_inertia_kg_m2 or 45.0) * max(fastest, 1.0) / ratio
        return torque, 0.6 * torque
    forward, backward = np.quantile(m.torque_nm, [0.97, 0.01])
    torque = max(float(forward), 1e-3)
    return torque, float(np.clip(-backward, MIN_BRAKE * torque, 3.0 * torque))


def _times(cycles: CycledMotion) -> tuple[float, float]:
    """Return how long the drive is on and off in a cycle."""
    rate = cycles.motion.sampling_rate_hz
    driven = np.isin(cycles.phase, (PHASES.index("start"), PHASES.index("run")))
    on = [np.sum(driven & (cycles.number == i)) / rate for i in range(cycles.n_cycles)]
    starts = np.array([s.start_s for s in cycles.course.moving])
    on_s = float(max(np.median(on), 0.2))
    period = float(np.median(np.diff(starts)))
    return round(on_s, 3), round(max(period - on_s, 0.3), 3)


# --------------------
# A start–stop recording against what it should be: changes of the whole, of either half, and without each cycle.
# --------------------


MAX_BLOCKS = 8


@dataclass(frozen=True)
class DriveComparison:
    """One recording beside its healthy reference, or beside the simulated drive.

    Parameters
    ----------
    name : str
    now : PreparedCycles
    reference : PreparedCycles or None
    drive : SimulatedDrive
    """

    name: str
    now: PreparedCycles
    reference: PreparedCycles | None
    drive: SimulatedDrive

    @cached_property
    def other(self) -> CycleFeatures:
        """What it is compared with."""
        return self.drive.healthy if self.reference is None else self.reference.features(self.reference.every)

    @cached_property
    def features(self) -> CycleFeatures:
        """What all cycles tell."""
        return self.now.features(self.now.every)

    @cached_property
    def spot(self) -> LocatedDriveChange:
        """Tooth and order that changed most."""
        return spot_of(self.features, self.other)

    @cached_property
    def change(self) -> FloatArray:
        """Of all cycles."""
        return change_of(self.features, self.other, self.drive.shape)

    def change_in(self, cycles: tuple[int, ...], at: LocatedDriveChange | None = None) -> FloatArray:
        """Return the change of some cycles."""
        return change_of(self.now.features(cycles), self.other, self.drive.shape, at)

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
        return np.array(
            [change_of(self.features, self.reference.features(one), self.drive.shape, self.spot) for one in kept]
        )

    def floor(self, part: str = "whole") -> DriveFloor:
        """Return how far healthy drives lie from what this is compared with, as far as it can be told of this one."""
        floor = load_floor(with_reference=self.reference is not None, part=part)
        return floor.widened(self.scatter * (1.0 if part == "whole" else HALF))


def _but_each(every: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return all cycles but one, for each; or but one of eight blocks."""
    blocks = np.array_split(np.array(every), min(len(every), MAX_BLOCKS))
    return [tuple(c for c in every if c not in block) for block in blocks]


def _jackknife(rows: FloatArray) -> FloatArray:
    """Return the standard error by leaving out each block, (n,)."""
    n = len(rows)
    spread: FloatArray = np.sqrt((n - 1.0) * np.nanvar(np.nan_to_num(rows), axis=0))
    return spread


# --------------------
# What the simulated drive predicts of every cause.
# --------------------


@dataclass(frozen=True)
class Predictions:
    """What would change by each cause, and where it was put: gear and tooth, or order."""

    causes: dict[str, Predicted]
    options: dict[str, dict[str, float | str]]


def predict(
    drive: SimulatedDrive,
    spot: LocatedDriveChange,
    order: int,
    effects: Mapping[str, GapEffect],
    tell: Callable[[str, float], object] = lambda *_: None,
    *,
    with_reference: bool = True,
) -> Predictions:
    """Simulate every cause at some severities.

    Worn flanks and a cracked tooth move the gears against each other by hundredths of a millimetre; that is added to
    what the healthy drive tells, without the noise of a run: the play by the mean depth over the mesh cycle, the curve
    by its shape (the drive in motion agrees, see the tests), a tooth by what its lost stiffness lets it yield. A sensor
    that misreads changes no motion. All others are run.

    Parameters
    ----------
    drive : SimulatedDrive
    spot : LocatedDriveChange
        Where the recording changed most: the tooth that is cracked, and the place of the ripple's order.
    order : int
        Of the ripple.
    effects : mapping
        Causes that the recording can tell.
    tell : callable
        Is told the cause and the share that is done.
    with_reference : bool
        Whether a healthy recording is compared with, and not the simulated drive.
    """
    options: dict[str, dict[str, float | str]] = {
        CRACK: {"gear": "driver", "tooth": float(spot.tooth + 1)},
        RIPPLE: {"order": float(order)},
    }
    causes = {}
    for i, (name, effect) in enumerate(effects.items()):
        tell(name, i / len(effects))
        rows, kept = [], []
        shown = np.isin(NAMES, effect.shows_in)
        for severity in TRIED[name].severities:
            features = (
                _misread(drive, severity, with_reference=with_reference)
                if name == TORQUE_GAIN
                else _features_with(drive, name, severity, options.get(name, {}), spot)
            )
            change = None if features is None else change_of(features, drive.healthy, drive.shape, spot)
            if change is not None and np.isfinite(change[shown]).any():  # else it stands still
                rows.append(change)
                kept.append(severity)
        if rows:
            changes = np.where(shown, np.nan_to_num(np.array(rows)), 0.0)
            free, direct = (np.isin(NAMES, which) for which in (TRIED[name].may_move, TRIED[name].direct))
            causes[name] = Predicted(name, np.array(kept), changes, free, direct)
    return Predictions(causes, {name: options.get(name, {}) for name in causes})


def _features_with(
    drive: SimulatedDrive, name: str, severity: float, options: dict[str, float | str], spot: LocatedDriveChange
) -> CycleFeatures | None:
    """Return what a drive with a cause tells; None where it cannot run: a load that cannot be moved, say."""
    if name == WEAR:
        return _worn(drive, severity)
    added = Added(name, severity, options)
    try:
        return _cracked(drive, added, spot) if name == CRACK else drive.features(added)
    except GearsigError:
        return None


def _worn(drive: SimulatedDrive, depth_um: float) -> CycleFeatures:
    healthy, curve = drive.healthy, drive.worn_curve_um(depth_um)
    mean = float(np.mean(curve))
    contact = replace(
        healthy.contact,
        play_um=healthy.contact.play_um + mean,
        curve_um=healthy.contact.curve_um + curve - mean,
    )
    return replace(healthy, contact=contact)


def _misread(drive: SimulatedDrive, percent: float, *, with_reference: bool) -> CycleFeatures:
    """Return what a torque sensor of another gain makes of the same motion.

    Inertia and friction of the load follow from the torque, and grow with the reading. What the teeth yield does not:
    it stays as in a healthy recording, and falls behind a simulated drive, which is driven by the torque that was read.
    That one also takes the friction of its load from the recording.
    """
    gain, healthy = 1.0 + 0.01 * percent, drive.healthy
    load = replace(healthy.load, inertia_kg_m2=gain * healthy.load.inertia_kg_m2)
    if with_reference:
        return replace(healthy, load=replace(load, friction_nm=gain * healthy.load.friction_nm))
    yielding = healthy.contact.deflection_um * gain ** (-1.0 / drive.exponent)
    return replace(healthy, load=load, contact=replace(healthy.contact, deflection_um=yielding))


def _cracked(drive: SimulatedDrive, crack: Added, spot: LocatedDriveChange) -> CycleFeatures:
    """Let one tooth yield more, g grows as (1 − loss)^{−1/λ}, among teeth that differ as the recording's do."""
    healthy, loss = drive.healthy, drive.twin.crack_stiffness_loss(crack)
    extra = healthy.contact.deflection_um * ((1.0 - loss) ** (-1.0 / drive.exponent) - 1.0)
    teeth = healthy.contact.teeth_um.copy()
    teeth[(spot.tooth + len(teeth) // 2) % len(teeth)] += spot.next_tooth_um
    teeth[spot.tooth] += max(extra, spot.next_tooth_um)
    return replace(healthy, contact=replace(healthy.contact, teeth_um=teeth))


def evidence_of_drive(compared: DriveComparison, predicted: Mapping[str, Predicted]) -> DriveEvidence:
    """Reduce a recording to its changes."""
    first, second = compared.halves
    folds = tuple(_fold(compared, a, b) for a, b in ((first, second), (second, first)))
    return DriveEvidence(compared.change, folds, predicted, compared.reference is not None, compared.scatter)


def _fold(compared: DriveComparison, ours: tuple[int, ...], theirs: tuple[int, ...]) -> CycleFold:
    here = compared.now.features(ours)
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
            CRACK: np.array([compared.change_in(theirs, s) for s in teeth]),
            RIPPLE: np.array([compared.change_in(theirs, s) for s in orders]),
        },
    )
