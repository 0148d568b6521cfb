"""A start–stop recording compared with its reference or its simulated drive: observed and predicted changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import GearsigError, RefusalError
from gearsig.gap._features import jackknife_variance
from gearsig.gap._simulator import AddedEffect, DriveFacts, DriveSimulator, DriveTwin, GapEffect
from gearsig.gap.start_stop._attribution import (
    HALF,
    N_PLACEBOS,
    RIPPLE,
    CycleFold,
    DriveEvidence,
    DriveFloor,
    PredictedCause,
    load_floors,
)
from gearsig.gap.start_stop._cycles import (
    N_PLACES,
    NAMES,
    PHASES,
    CycleFeatures,
    LocatedDriveChange,
    PreparedCycles,
    change_of,
    cut_cycles,
    spot_of,
)
from gearsig.motion import PairMotion, check_turns, find_roles, measure_motion
from gearsig.recording import Recording
from gearsig.rig import contact_pair
from gearsig.severity import CRACK

TORQUE_GAIN, WEAR = "torque_gain", "tooth_wear"


class SeverityGrid(NamedTuple):
    """Simulated severities of a cause.

    Parameters
    ----------
    severities : tuple of float
        Ascending, in the effect's unit.
    may_move : tuple of str
        Changes that it causes on real teeth but not in the simulated drive: they count neither for nor against it.
    direct : tuple of str
        Changes that measure the severity itself.
    needs_torque : bool
        Whether it cannot be identified without a torque channel.
    needs_reference : bool
        Whether the healthy value is not in the drawing.
    """

    severities: tuple[float, ...]
    may_move: tuple[str, ...] = ()
    direct: tuple[str, ...] = ()
    needs_torque: bool = True
    needs_reference: bool = False


_ROUGH = ("contact_scatter", "load_scatter")
TRIED: Mapping[str, SeverityGrid] = {
    "backlash": SeverityGrid((60.0, 180.0, 500.0), direct=("play",), needs_torque=False),
    WEAR: SeverityGrid(
        (12.0, 25.0, 50.0, 100.0, 200.0), ("deflection", "flank_friction", "impact", *_ROUGH), needs_torque=False
    ),
    "sliding_friction": SeverityGrid((0.03, 0.09, 0.2), ("curve", *_ROUGH)),
    "load_friction": SeverityGrid((8.0, 20.0, 45.0), direct=("load_friction",), needs_reference=True),
    CRACK: SeverityGrid((1.0, 2.0, 4.0, 6.0, 8.0, 10.0)),
    "load_inertia": SeverityGrid((-50.0, -25.0, 40.0, 120.0), ("load_scatter",), direct=("inertia",)),
    TORQUE_GAIN: SeverityGrid((-40.0, -20.0, 25.0, 60.0), ("flank_friction", *_ROUGH)),
    RIPPLE: SeverityGrid((1.5, 5.0, 15.0), ("next_ripple", *_ROUGH)),
}
"""Settings of each cause. The changes in which it is expected are in its `GapEffect.shows_in`, as names of
`gearsig.gap.start_stop.NAMES`: other changes are accidents of the simulated run."""


@dataclass(frozen=True)
class SimulatedDrive:
    """A drive's twin with the features of its runs; the healthy run is simulated once.

    Parameters
    ----------
    twin : DriveTwin
    exponent : float
        λ of the contact law.
    """

    twin: DriveTwin
    exponent: float

    @cached_property
    def healthy_run(self) -> PreparedCycles:
        """A run without any effect."""
        return self._cycles(())

    @cached_property
    def healthy(self) -> CycleFeatures:
        """Features of the healthy drive's cycles."""
        return _of_all(self.healthy_run)

    @cached_property
    def shape(self) -> FloatArray:
        """Profile of the compression over the mesh cycle with flanks worn by 50 µm, with its mean removed."""
        curve = self.worn_curve_um(50.0)
        return curve - np.mean(curve)

    def worn_curve_um(self, depth_um: float) -> FloatArray:
        """See `DriveTwin.worn_curve_um`."""
        return self.twin.worn_curve_um(self.healthy.deflection_um, depth_um, N_PLACES)

    def features(self, *added: AddedEffect) -> CycleFeatures:
        """Run the drive with effects and return the features of its cycles."""
        return _of_all(self._cycles(added))

    def at_torque(self, factor: float) -> SimulatedDrive:
        """Return the drive with another motor torque."""
        return replace(self, twin=self.twin.at_torque(factor))

    def _cycles(self, added: Sequence[AddedEffect]) -> PreparedCycles:
        return cut_cycles(measure_motion(self.twin.run(added), use={"force": ""}))


def _of_all(run: PreparedCycles) -> CycleFeatures:
    """Return the features of all cycles of a run; teeth that a short run does not pass are taken as average."""
    features = run.features()
    return replace(features, teeth_um=np.nan_to_num(features.teeth_um))


def simulated_drive(simulator: DriveSimulator, cycles: PreparedCycles, healthy: CycleFeatures | None) -> SimulatedDrive:
    """Set a simulated drive to a rig and a recording.

    Geometry, inertias, contact, flank friction and play are the rig's; play, inertia and load friction are taken from a
    healthy recording where it shows them. Times of valve and brake, the speed limited by the flow and, without a
    healthy recording, the load friction are the recording's own, since the way the machine is driven is not a gap.
    """
    m = cycles.motion
    contact, ratio = m.contact, m.path.teeth[1] / m.path.teeth[0]
    inertia = contact.driven_inertia_kg_m2 or 45.0  # usual value where the rig states none
    if m.torque_nm is None:  # usual torques for the load's inertia
        fastest = float(np.quantile(m.driven_acceleration_rad_s2, 0.98))
        torque_nm = 2.0 * inertia * max(fastest, 1.0) / ratio
        brake_nm = 0.6 * torque_nm
    else:  # the play shows only if the back flanks are loaded in a stop
        forward, backward = np.quantile(m.torque_nm, [0.97, 0.01])
        torque_nm = max(float(forward), 1e-3)
        brake_nm = float(np.clip(-backward, 0.5 * torque_nm, 3.0 * torque_nm))
    friction_nm = (healthy or cycles.features()).friction_nm
    if not 0.0 < friction_nm < 0.9 * torque_nm * ratio:
        friction_nm = 0.5 * torque_nm * ratio
    play_um = 2.0 * contact.half_backlash_um
    if healthy is not None:
        inertia = healthy.inertia_kg_m2 if healthy.inertia_kg_m2 > 0.0 else inertia
        play_um = healthy.play_um if healthy.play_um > 0.0 else play_um
    contact = replace(contact, driven_inertia_kg_m2=inertia, half_backlash_um=0.5 * play_um)
    top_speed = float(np.quantile(np.abs(m.driver_speed_rad_s), 0.98))
    facts = DriveFacts(
        m.path, contact, _module_mm(m), torque_nm, brake_nm, friction_nm, top_speed, *_on_and_off_s(cycles)
    )
    return SimulatedDrive(simulator.drive_twin_of(facts), contact.exponent)


def _module_mm(m: PairMotion) -> float:
    """Return the module from the base pitch; the path has a pressure angle of 20° unless the rig states another."""
    r1 = m.path.base_radii_m[0]
    pitch_radius = m.path.length_m * r1 / sum(m.path.base_radii_m)  # tan α times the base radius
    return round(2e3 * float(np.hypot(r1, pitch_radius)) / m.path.teeth[0], 6)


def _on_and_off_s(cycles: PreparedCycles) -> tuple[float, float]:
    """Return how long the drive is on and off in a cycle."""
    driven = np.isin(cycles.phase, (PHASES.index("start"), PHASES.index("run")))
    on = [np.sum(driven & (cycles.number == i)) / cycles.motion.sampling_rate_hz for i in cycles.every]
    on_s = float(max(np.median(on), 0.2))
    period_s = float(np.median(np.diff([segment.start_s for segment in cycles.segments.moving])))
    return round(on_s, 3), round(max(period_s - on_s, 0.3), 3)


@dataclass(frozen=True)
class DriveComparison:
    """One recording with its healthy reference, or with the simulated drive.

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

    @property
    def baseline(self) -> CycleFeatures:
        """Features of the baseline."""
        return self.drive.healthy if self.reference is None else self.reference.features()

    @property
    def features(self) -> CycleFeatures:
        """Features of all cycles."""
        return self.now.features()

    @cached_property
    def spot(self) -> LocatedDriveChange:
        """Tooth and order that changed most."""
        return spot_of(self.features, self.baseline)

    @property
    def order(self) -> int:
        """Order of the pinion at which the torque's ripple changed most."""
        return int(self.now.orders[self.spot.order])

    def change_in(self, cycles: tuple[int, ...] | None = None, at: LocatedDriveChange | None = None) -> FloatArray:
        """Return the change of some cycles, or of all."""
        return change_of(self.now.features(cycles), self.baseline, self.drive.shape, at)

    @cached_property
    def change(self) -> FloatArray:
        """Change of all cycles."""
        return self.change_in()

    @cached_property
    def without(self) -> FloatArray:
        """Changes with each cycle (or each of eight blocks) left out, (n_blocks, n), at the same tooth and order."""
        return np.array([self.change_in(kept, self.spot) for kept in _leave_one_out(self.now.every)])

    @cached_property
    def scatter(self) -> FloatArray:
        """Standard errors of the change, from the cycles of the recording and of its reference (jackknife).

        A simulated drive has no noise.
        """
        scatter: FloatArray = np.sqrt(jackknife_variance(np.nan_to_num(self.without)))
        if self.reference is not None:
            kept = [self.reference.features(cycles) for cycles in _leave_one_out(self.reference.every)]
            rows = [change_of(self.features, baseline, self.drive.shape, self.spot) for baseline in kept]
            scatter = np.hypot(scatter, np.sqrt(jackknife_variance(np.nan_to_num(np.array(rows)))))
        return scatter

    def floor(self, *, of_half: bool = False) -> DriveFloor:
        """Return the structural floor of this comparison, widened by the scatter of the recording."""
        (whole, half), _ = load_floors(with_reference=self.reference is not None)
        return half.widened(HALF * self.scatter) if of_half else whole.widened(self.scatter)

    def evidence(self, predicted: Mapping[str, PredictedCause]) -> DriveEvidence:
        """Return the recording's changes together with the predicted ones."""
        first, second = self.now.halves
        folds = (self._fold(first, second), self._fold(second, first))
        return DriveEvidence(self.change, self.scatter, folds, predicted)

    def _fold(self, ours: tuple[int, ...], theirs: tuple[int, ...]) -> CycleFold:
        features = self.now.features(ours)
        spot, n_teeth, n_orders = spot_of(features, self.baseline), len(features.teeth_um), len(features.ripple)
        blocks = [tuple(c for c in theirs if c != left_out) for left_out in theirs] if len(theirs) > 1 else [theirs]
        steps = [1 + i * max(1, n_teeth // (N_PLACEBOS + 1)) for i in range(N_PLACEBOS)]
        elsewhere = {
            CRACK: [replace(spot, tooth=(spot.tooth + step) % n_teeth) for step in steps],
            RIPPLE: [replace(spot, order=(spot.order + 3 + 4 * i) % n_orders) for i in range(N_PLACEBOS)],
        }
        return CycleFold(
            self.change_in(ours, spot),
            self.change_in(theirs, spot),
            np.array([self.change_in(kept, spot) for kept in blocks]),
            {name: np.array([self.change_in(theirs, at) for at in places]) for name, places in elsewhere.items()},
        )


def _leave_one_out(every: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return all cycles with each one left out in turn, or each of at most eight blocks."""
    blocks = np.array_split(np.array(every), min(len(every), 8))
    return [tuple(c for c in every if c not in block) for block in blocks]


def read_cycles(recording: Recording) -> PreparedCycles:
    """Measure a recording's motion with the rig that it carries, and cut it into cycles.

    Raises
    ------
    RefusalError
        If neither gear's motion was recorded, only vibration.
    """
    rig = recording.rig
    if rig is not None and rig.pairs:
        roles = find_roles(recording, contact_pair(rig)) if rig.contact or len(rig.pairs) == 1 else {}
        if not any(role.endswith((" angle", " speed")) for role in roles):
            raise RefusalError(
                f"{recording.name} has no angle or speed of pinion and wheel, but "
                "the model forging compares their starts and stops",
                remedy="compare vibration of stationary running with --model cracked; otherwise name the channels' "
                "shafts in the rig file's [[sensor]] tables",
            )
    motion = measure_motion(recording, rig)
    check_turns(motion)
    return cut_cycles(motion)


def compare_drive(
    now: PreparedCycles, references: Sequence[PreparedCycles], simulator: DriveSimulator, name: str = "recording"
) -> DriveComparison:
    """Compare a recording with the healthy one at the nearest torque, or with the drive simulated from its rig."""

    def apart(reference: PreparedCycles) -> float:
        """Return the difference of the largest torques or, where one is missing, of the top speeds."""
        a, b = now.motion, reference.motion
        first, second = a.torque_nm, b.torque_nm
        if first is None or second is None:
            first, second = a.driver_speed_rad_s, b.driver_speed_rad_s
        return float(abs(abs(first).max() - abs(second).max()))

    nearest = min(references, key=apart, default=None)
    healthy = None if nearest is None else nearest.features()
    return DriveComparison(name, now, nearest, simulated_drive(simulator, now, healthy))


def tellable(compared: DriveComparison, effects: Mapping[str, GapEffect]) -> tuple[str, ...]:
    """Return the causes that can be identified with the available channels and reference."""
    has_torque = compared.now.motion.torque_nm is not None
    return tuple(
        name
        for name, tried in TRIED.items()
        if name in effects
        and (has_torque or not tried.needs_torque)
        and (compared.reference is not None or not tried.needs_reference)
    )


def predict(
    compared: DriveComparison,
    effects: Mapping[str, GapEffect],
    on_stage: Callable[[str, float], object] = lambda *_: None,
) -> dict[str, PredictedCause]:
    """Simulate every cause that the recording can identify at some severities.

    Worn flanks and a cracked tooth move the gears relative to each other by hundredths of a millimetre. This is added
    to the features of the healthy drive, without the noise of a run: to the play by the mean depth over the mesh cycle,
    to the curve by its shape (which agrees with the drive in motion, see the tests), to a tooth by the deflection due
    to its lost stiffness. A sensor with a wrong gain changes no motion. All other causes are simulated.

    Parameters
    ----------
    compared : DriveComparison
        It determines where a crack or a ripple is placed: where the recording changed most.
    effects : mapping
    on_stage : callable
        Called with the cause and the fraction completed.
    """
    drive, spot, names = compared.drive, compared.spot, tellable(compared, effects)
    places: dict[str, dict[str, float | str]] = {
        CRACK: {"gear": "driver", "tooth": float(spot.tooth + 1)},
        RIPPLE: {"order": float(compared.order)},
    }
    causes = {}
    for i, name in enumerate(names):
        on_stage(name, i / len(names))
        grid, options = TRIED[name], places.get(name, {})
        shown, free, direct = (np.isin(NAMES, ns) for ns in (effects[name].shows_in, grid.may_move, grid.direct))
        changes = {}
        for severity in grid.severities:
            try:
                features = _features_with(compared, AddedEffect(name, severity, options))
            except GearsigError:  # it cannot run, for example because the load cannot be moved
                continue
            change = change_of(features, drive.healthy, drive.shape, spot)
            if np.isfinite(change[shown]).any():  # otherwise it stands still
                changes[severity] = change
        if changes:
            table = np.where(shown, np.nan_to_num(np.array(list(changes.values()))), 0.0)
            causes[name] = PredictedCause(name, np.array(list(changes)), table, free, direct, options)
    return causes


def _features_with(compared: DriveComparison, added: AddedEffect) -> CycleFeatures:
    """Return the features of a drive with a cause."""
    drive, spot = compared.drive, compared.spot
    healthy, teeth = drive.healthy, drive.healthy.teeth_um.copy()
    if added.name == WEAR:
        curve = drive.worn_curve_um(added.severity)
        mean = float(np.mean(curve))
        return replace(healthy, play_um=healthy.play_um + mean, curve_um=healthy.curve_um + curve - mean)
    if added.name == CRACK:  # g grows as (1 − loss)^{−1/λ}; teeth differ as in the recording
        softer = (1.0 - drive.twin.crack_stiffness_loss(added)) ** (-1.0 / drive.exponent) - 1.0
        teeth[(spot.tooth + len(teeth) // 2) % len(teeth)] += spot.next_tooth_um
        teeth[spot.tooth] += max(healthy.deflection_um * softer, spot.next_tooth_um)
        return replace(healthy, teeth_um=teeth)
    if added.name == TORQUE_GAIN:
        # Inertia and friction of the load follow from the torque, and scale with its reading. The deflection of the
        # teeth does not: it stays as in a healthy recording, but is smaller than in a simulated drive, which is driven
        # by the torque as read. That drive also takes its load friction from the recording.
        gain = 1.0 + 0.01 * added.severity
        misread = replace(healthy, inertia_kg_m2=gain * healthy.inertia_kg_m2)
        if compared.reference is not None:
            return replace(misread, friction_nm=gain * healthy.friction_nm)
        return replace(misread, deflection_um=healthy.deflection_um * gain ** (-1.0 / drive.exponent))
    return drive.features(added)
