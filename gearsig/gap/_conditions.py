"""Recordings, references and the twin, reduced and paired for comparison."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import cos, inf, radians
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import percent
from gearsig.gap._change import (
    as_mounted,
    change_features,
    change_relative_to_mesh,
    difference_features,
    lines_of_shaft,
    turned_difference,
)
from gearsig.gap._classifier import EffectClassifier, Learned
from gearsig.gap._features import STEPS_PER_TOOTH, Features, decibel, tooth_energy
from gearsig.gap._floors import FLOOR_IN_DEVIATIONS, GapSize, StructuralFloor, gap_size, pooled_scatter
from gearsig.gap._path import MeasuredPath, measured_path
from gearsig.gap._population import load_learned
from gearsig.gap._prediction import ObservedChange
from gearsig.gap._reduction import (
    DRIVEN,
    DRIVER,
    NOMINAL_REVOLUTIONS,
    ReducedRecording,
    reduce_recording,
    shaft_text,
)
from gearsig.gap._report import ConditionFacts
from gearsig.gap._simulator import AddedEffect, OperatingCondition, Twin, as_tried
from gearsig.gap._waveform import gain_scatter
from gearsig.prepared import PreparedRecording
from gearsig.recording import metres_per_second_squared
from gearsig.rig import GearPair, Rig
from gearsig.severity import (
    LARGEST_SPEED_DIFFERENCE,
    ShaftLines,
    load_calibration,
    orders_from_mesh,
    reversed_text,
    tooth_distinguishing_orders,
)

# --------------------
# The recordings of a gap diagnosis, reduced, each with its baseline.
# --------------------


SEED = 0
"""Seed of the twin's specimen, whose flanks and housing differ from the machine's in any case."""

LARGEST_TORQUE_DIFFERENCE = 0.25
"""Relative difference between the stated torques of a recording and its reference."""

LONGEST_RUN_S, MAX_REVOLUTIONS = 5.0, 24.0
"""Length of a simulation: longer ones add nothing, but the slower shaft must make at least this many revolutions."""
LEAD = 2.0
"""Revolutions that a record loses before its first pulse and after its last."""
TRIAL_S, TRIAL_REVOLUTIONS = 1.0, 10.0
"""Length of a trial run: it differs from the healthy run by the effect alone, not by noise."""


@dataclass(frozen=True)
class Condition:
    """One recording and its baseline.

    Parameters
    ----------
    facts : ConditionFacts
    now, simulated : ReducedRecording
        The recording, and the healthy twin at its operating point.
    reference : ReducedRecording or None
    learned : Learned
        What was learned from known machines, by which distances are judged.
    path : MeasuredPath or None
        Path to the sensors, where a run-up of the healthy machine was recorded.
    """

    facts: ConditionFacts
    now: ReducedRecording
    simulated: ReducedRecording
    reference: ReducedRecording | None
    learned: Learned = field(repr=False)
    path: MeasuredPath | None = field(default=None, repr=False)

    @property
    def has_reference(self) -> bool:
        """Whether the baseline is a healthy recording of the same machine, not the twin."""
        return self.reference is not None

    @property
    def baseline(self) -> ReducedRecording:
        """The reference, or the healthy twin where there is none."""
        return self.simulated if self.reference is None else self.reference

    def change_of(self, part: ReducedRecording) -> Features:
        """Return the change of the recording, or of some of its blocks, against the baseline.

        The baseline is the reference. Without one the change is x − c y: x the features, y those of the healthy twin, c
        the credibility of each feature, 0 to 1, learned from machines whose twin is known.
        """
        if self.reference is not None:
            return change_features(part, self.reference)
        return difference_features(part, self.simulated, self.learned.credibility)

    @cached_property
    def change(self) -> Features:
        """Change against the reference, otherwise against the twin as far as it is credible."""
        return self.change_of(self.now)

    @cached_property
    def floor(self) -> StructuralFloor:
        """Distances of healthy machines from the baseline."""
        return self.classifier.floor

    @cached_property
    def size(self) -> GapSize:
        """Size of the whole gap."""
        return gap_size(self.change, self.floor)

    @property
    def classifier(self) -> EffectClassifier:
        """The classifier for this kind of baseline."""
        return self.learned.classifiers[self.has_reference]

    @property
    def tooth_load_n_per_mm(self) -> float:
        """See `tooth_load_n_per_mm`."""
        return tooth_load_n_per_mm(self.now.frame.pair, self.facts.point.torque_nm)

    @property
    def trial_s(self) -> float:
        """Length of a simulation that tries an effect at this point."""
        return trial_length_s(self.now)

    @property
    def gain_scatter(self) -> float:
        """α, the error of the twin's mesh harmonics relative to each other, against the reference; see `_waveform`."""
        unknown = gain_scatter(self.baseline, self.simulated)
        return unknown if self.path is None else self.path.gain_scatter(unknown)

    @cached_property
    def change_db(self) -> dict[str, float]:
        """Feature → distance from that of healthy machines, in dB.

        With a reference, a level relative to the mesh counts only as far as it changed by itself.
        """
        names, distances = self.change.names, self.floor.from_centre(self.change.names, self.change.values)
        held = change_relative_to_mesh(names, distances) if self.has_reference else distances
        return dict(zip(names, held.tolist(), strict=True))

    @cached_property
    def floors(self) -> tuple[FloatArray, FloatArray]:
        """Structural and repeatability floor of each feature in dB, (n,) each."""
        return self.floor.of(self.change.names), FLOOR_IN_DEVIATIONS * pooled_scatter(self.change)

    @cached_property
    def over_floors(self) -> dict[str, float]:
        """Feature → signed distance over the larger of the two floors."""
        # Differences between healthy machines include their scatter; that of a shorter record may be larger.
        ratios = np.array([*self.change_db.values()]) / np.maximum(*self.floors)
        return dict(zip(self.change.names, ratios.tolist(), strict=True))

    def strongest(self, *beginnings: str) -> str:
        """Return the feature with the largest change over the floors, of those whose names begin with `beginnings`."""
        sizes = self.over_floors
        return max((name for name in sizes if name.startswith(beginnings)), key=lambda name: abs(sizes[name]))


USUAL_PRESSURE_ANGLE_DEG = 20.0

LIGHT_LOAD_N_PER_MM = 50.0
"""Tooth load up to which flanks may separate and backlash shows: dynamic loads are then of the order of the static
one."""


def tooth_load_n_per_mm(pair: GearPair, torque_nm: float) -> float:
    """Return the tooth force per face width, T/(r_b b), in N/mm; nan where module or width is not known.

    Parameters
    ----------
    pair : GearPair
    torque_nm : float
        Torque of the driver.
    """
    if pair.driver_teeth is None or pair.module_mm is None or pair.face_width_mm is None:
        return float("nan")
    angle = radians(pair.pressure_angle_deg or USUAL_PRESSURE_ANGLE_DEG)
    base_radius_mm = pair.driver_teeth * pair.module_mm * cos(angle) / 2.0
    return 1e3 * abs(torque_nm) / (base_radius_mm * pair.face_width_mm)


def trial_length_s(now: ReducedRecording) -> float:
    """Return the length in s of a simulation that tries an effect on the machine of a recording."""
    return max(TRIAL_S, TRIAL_REVOLUTIONS / _slower_hz(now))


def run_length_s(now: ReducedRecording) -> float:
    """Return the length in s of a simulation from which features are computed.

    It covers `MAX_REVOLUTIONS` of the slower shaft; if the recording has fewer, as many as it has, plus `LEAD` for the
    run to settle.

    Parameters
    ----------
    now : ReducedRecording
        The recording with which the simulation is compared.
    """
    if now.fewest_revolutions < MAX_REVOLUTIONS:
        return (now.fewest_revolutions + LEAD) / _slower_hz(now)
    return max(LONGEST_RUN_S, MAX_REVOLUTIONS / _slower_hz(now))


def _slower_hz(now: ReducedRecording) -> float:
    return min(now.frame.shaft_orders) * now.speed_hz


def simulated(
    twin: Twin, facts: ConditionFacts, now: ReducedRecording, added: Sequence[AddedEffect] = ()
) -> ReducedRecording:
    """Return the twin's run at a recording's operating point, reduced."""
    recording = twin.run(
        facts.point,
        added,
        seed=SEED,
        duration_s=run_length_s(now),
        sampling_rate_hz=facts.sampling_rate_hz,
    )
    if recording.rig is None:
        raise InputError("the simulator's recording has no rig", remedy="a twin's recordings must carry the rig")
    return with_channels_of(reduce_recording(recording, recording.rig), now)


def with_channels_of(simulation: ReducedRecording, now: ReducedRecording) -> ReducedRecording:
    """Return a simulation with the recording's channels: those of the same name, otherwise in order."""
    if set(now.channels) <= set(simulation.channels):
        return simulation.of_channels(now.channels)
    simulated_channels = list(simulation.channels.values())
    return simulation.with_channels(
        {name: simulated_channels[i % len(simulated_channels)] for i, name in enumerate(now.channels)}
    )


def facts_of(prepared: PreparedRecording, now: ReducedRecording, twin: Twin) -> ConditionFacts:
    """Return a recording's operating point and length: measured speed, stated (or usual) torque.

    Raises
    ------
    RefusalError
        If the stated torque is 0.
    """
    recording, stated_nm = prepared.recording, _torque_nm(prepared.rig)
    if stated_nm == 0.0:
        raise RefusalError(
            "the rig file states a torque of 0, at which nothing presses the simulated teeth together",
            remedy="give the drag torque of the driven side, a few percent of the rated torque; without torque_nm a "
            "usual torque is assumed",
        )
    return ConditionFacts(
        recording.name,
        OperatingCondition(60.0 * now.speed_hz, twin.point.torque_nm if stated_nm is None else stated_nm),
        now.n_revolutions,
        recording.duration_s,
        recording.sampling_rate_hz,
    )


@dataclass(frozen=True)
class HealthyReference:
    """A recording of the healthy machine, and its reduction to the channels that are compared."""

    reduced: ReducedRecording
    recording: PreparedRecording = field(compare=False, repr=False)

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.recording.name


def matching_reference(
    now: ReducedRecording, rig: Rig, references: Sequence[HealthyReference]
) -> tuple[HealthyReference | None, str]:
    """Return the reference at the recording's operating point, reduced to common channels, or None and the reason."""
    if not references:
        return None, ""
    nearest = min(references, key=lambda candidate: _distance(now, rig, candidate))
    reference = nearest.reduced
    change = now.speed_hz / reference.speed_hz - 1.0
    if abs(change) > LARGEST_SPEED_DIFFERENCE:
        return None, f"no reference within {percent(LARGEST_SPEED_DIFFERENCE)} of its speed"
    if _torque_difference(rig, nearest.recording.rig) > LARGEST_TORQUE_DIFFERENCE:
        torque_nm, reference_nm = _torque_nm(rig), _torque_nm(nearest.recording.rig)
        return None, f"the reference at its speed has {reference_nm:.3g} N m, the recording {torque_nm:.3g} N m"
    reference = as_long_as(nearest.recording, reference, now)
    named = _with_names_of(reference, now)
    if named is None:
        return None, f"the reference has the channels {', '.join(reference.channels)}"
    return replace(nearest, reduced=named), ""


MUCH_LONGER = 1.25
"""Ratio of the revolutions of two recordings from which one counts as longer."""


def as_long_as(recording: PreparedRecording, reduced: ReducedRecording, shorter: ReducedRecording) -> ReducedRecording:
    """Return a recording reduced over as many revolutions as another one has, where those are few.

    An average over few revolutions contains more of the other shaft and of noise, and its lines are wider: for a
    healthy machine, 8 revolutions differ from 60 by 1.0 structural floors and from 8 by 0.5. From `NOMINAL_REVOLUTIONS`
    on, `ShaftAverage.power` corrects for this.
    """
    fewest = shorter.fewest_revolutions
    if fewest >= NOMINAL_REVOLUTIONS or reduced.fewest_revolutions <= MUCH_LONGER * fewest:
        return reduced
    part = recording.recording.between(0.0, (shorter.n_revolutions + LEAD) / reduced.speed_hz)
    return reduce_recording(part, channels=tuple(reduced.channels))


def _with_names_of(reference: ReducedRecording, now: ReducedRecording) -> ReducedRecording | None:
    """Return the reference with the channels it has in common with the recording, or the only one of each, or None."""
    if common := [name for name in now.channels if name in reference.channels]:
        return reference.of_channels(common)
    if len(reference.channels) == len(now.channels) == 1:
        return reference.with_channels(dict(zip(now.channels, reference.channels.values(), strict=True)))
    return None


def _distance(now: ReducedRecording, rig: Rig, reference: HealthyReference) -> float:
    speed = abs(now.speed_hz / reference.reduced.speed_hz - 1.0)
    return 10.0 * speed + _torque_difference(rig, reference.recording.rig)


def _torque_difference(rig: Rig, reference: Rig) -> float:
    """Return the torque difference relative to the reference's torque; 0 where either is not stated."""
    recording_nm, reference_nm = _torque_nm(rig), _torque_nm(reference)
    if recording_nm is None or reference_nm is None:
        return 0.0
    return abs(recording_nm / reference_nm - 1.0) if reference_nm else inf


def _torque_nm(rig: Rig) -> float | None:
    return rig.nominal_torque_nm(rig.pairs[0].driver)


def observed(condition: Condition, index: int, n: int, change: Features | None = None) -> ObservedChange:
    """Return distances and floors of a condition's first `n` features; `change` replaces its own change."""
    used = change or condition.change
    structural = condition.floor
    floors = (structural.of(used.names) ** 2 + (FLOOR_IN_DEVIATIONS * pooled_scatter(used)) ** 2) ** 0.5
    return ObservedChange(index, structural.from_centre(used.names, used.values)[:n], floors[:n])


# --------------------
# Signs that recordings are not of the machine that they are said to be of.
# --------------------


NEAR_MESH, SLOW = 2, 5
"""Orders of a shaft on either side of a mesh harmonic that belong to it; low orders that belong to the shaft itself."""

MIN_MESH_SHARE = 0.5
"""Share of the power synchronous with either shaft that lies near mesh harmonics. Simulated machines have 0.7 and more,
even with the heaviest damage; a pair of 55/75 teeth taken for one of 29/47 has 0.45."""

MIN_PATTERN = 3.0
"""Power of the lines in which teeth differ relative to the noise in them: below it any two patterns differ."""

MIN_AGREEMENT = 0.6
"""Agreement of both gears' patterns. One damaged gear lowers its own agreement to 0.2, and leaves the other's at 0.8
and more; another specimen of the same drawing has 0.2 and 0.5, and so have two heavily worn gears."""


WELL_EXPLAINED, HARDLY_EXPLAINED = 0.5, 0.15
"""Share of the shaft-synchronous power near mesh harmonics, beyond that by chance. In the sample recordings, including
damaged ones, the right number of teeth has 0.35 and more (0.08 with the heaviest damage, when no other number has
much); most wrong numbers have less than 0, a few 0.2 to 0.6."""

MIN_TEETH, MAX_TEETH = 12, 200

LOST_DB, OWN_DB = 10.0, 6.0
"""Decrease of one tooth's burst since the reference, and its level above the reference's median tooth: healthy teeth
reach up to 7 dB by chance, and lose nothing from one day to the next."""

CLEAR_CHANGE, ALONE = 10.0, 4.0
"""Energy of the change at one tooth relative to the median tooth, and to the largest value more than a tooth away: worn
flanks and a different path to the sensor change all teeth, some of them much."""


def warnings_of(condition: Condition) -> list[str]:
    """Return strong evidence of a wrong rig file, or of recording and reference exchanged."""
    name, reference = condition.facts.name, condition.reference
    texts = tooth_count_mismatch_text(condition.now, name, reference)
    if reference is None or texts:
        return texts
    return tooth_count_mismatch_text(reference, f"The reference of {name}") or swapped_recordings_text(
        condition.now, reference, name
    )


def tooth_count_mismatch_text(now: ReducedRecording, name: str, reference: ReducedRecording | None = None) -> list[str]:
    """Return a message if a shaft's own mark shows that its gear has another number of teeth than the rig file states.

    With a mark on the shaft itself, its average is valid for any number of teeth. Hardly any of its power must lie at
    the mesh harmonics of the stated number, and most of it at those of another; multiples and divisors of the right
    number are not detected. Where the healthy reference fits the stated number, the difference is due to a damaged
    tooth, and nothing is returned.
    """
    for side in (DRIVER, DRIVEN):
        if not now.marks[side] or (reference is not None and _fits(reference, side)):
            continue
        stated, shares = now.frame.teeth[side], _explained(now, side)
        best = max(shares, key=shares.__getitem__, default=stated)
        if shares.get(stated, 1.0) < HARDLY_EXPLAINED and shares.get(best, 0.0) > WELL_EXPLAINED:
            shaft = shaft_text(now.frame, side)
            message = (
                f"{name}: the teeth do not fit. What repeats with {shaft} does so {best} times per revolution, but the "
                f"rig file gives its gear {stated} teeth. Unless the recording is of another machine, the rig file is "
                "wrong; until this is settled, nothing here is reliable."
            )
            return [message]
    return []


def _fits(now: ReducedRecording, side: int) -> bool:
    """Return whether a gear's mesh harmonics account for as much of its average as with the right number of teeth."""
    return _explained(now, side).get(now.frame.teeth[side], 0.0) >= HARDLY_EXPLAINED


def _explained(now: ReducedRecording, side: int) -> dict[int, float]:
    """Return number of teeth → (s − c)/(1 − c), s: share of a shaft's average near mesh harmonics, c: that by chance.

    Only numbers with at least two visible harmonics are included.
    """
    whole = []
    for average in now.averages(side):
        power = np.abs(average.lines[: average.highest + 1]) ** 2
        power[: SLOW + 1] = 0.0
        whole.append(power / max(float(power.sum()), 1e-300))
    shares = np.mean(whole, axis=0)
    orders = np.arange(len(shares))
    explained = {}
    for teeth in range(MIN_TEETH, min(MAX_TEETH, len(shares) // 2) + 1):
        near = orders_from_mesh(orders, teeth) <= NEAR_MESH
        by_chance = float(near[SLOW + 1 :].mean())
        explained[teeth] = (float(shares[near].sum()) - by_chance) / (1.0 - by_chance)
    return explained


def swapped_recordings_text(now: ReducedRecording, reference: ReducedRecording, name: str) -> list[str]:
    """Return a message if one tooth stands out in the reference, but not in the recording.

    Damage adds a burst to one tooth and never removes one, so the sign of the change is evidence where its size is not.
    """
    for side in (DRIVER, DRIVEN):
        try:
            difference, _ = turned_difference(now, reference, side)
        except RefusalError:
            return []
        recorded = lines_of_shaft(now, side).lines[:, : difference.lines.shape[1]]
        changed, now_energy, reference_energy = (
            _energy(now, side, difference, lines) for lines in (difference.lines, recorded, recorded - difference.lines)
        )
        at = int(np.argmax(changed))
        lost_db, prominence_db = (
            decibel(reference_energy[at] / now_energy[at]),
            decibel(reference_energy[at] / float(np.median(reference_energy))),
        )
        elsewhere = np.roll(changed, -at)[2 * STEPS_PER_TOOTH : -2 * STEPS_PER_TOOTH]
        is_one_tooth = changed[at] >= max(CLEAR_CHANGE * float(np.median(changed)), ALONE * float(elsewhere.max()))
        if is_one_tooth and lost_db >= LOST_DB and prominence_db >= OWN_DB:
            place = (at / len(changed) + (0.5 - load_calibration().lag_pitches) / difference.teeth) % 1.0
            tooth = f"Tooth {int(place * difference.teeth) + 1}" if now.marks[side] else "One tooth"
            message = (
                f"{name}: recording and reference may have been exchanged. {tooth} of {shaft_text(now.frame, side)} "
                f"(at {360.0 * place:.0f}°) stands {prominence_db:.0f} dB above the median tooth in the reference, "
                f"and is {lost_db:.0f} dB weaker in the recording; damage adds such a burst but never removes "
                "one. If so, the answer describes the reference: swap the two."
            )
            return [message]
    return []


def _energy(now: ReducedRecording, side: int, difference: ShaftLines, lines: NDArray[np.complex128]) -> FloatArray:
    """Return the energy within one pitch of the part that differs between teeth, mean over channels."""
    rows = [
        tooth_energy(average.residual(row) / np.sqrt(average.mesh_power), difference.teeth)
        for row, average in zip(lines, now.averages(side), strict=True)
    ]
    energy: FloatArray = np.maximum(np.mean(rows, axis=0), 1e-300)
    return energy


def teeth_mismatch_text(now: ReducedRecording, name: str) -> list[str]:
    """Return a message if little of the shaft-synchronous power lies at the mesh harmonics of the stated teeth.

    Gears of fewer than about 15 teeth escape detection, since any order is near one of their harmonics.
    """
    share = max(_mesh_share(now, side) for side in (DRIVER, DRIVEN))
    if share >= MIN_MESH_SHARE or tooth_count_mismatch_text(now, name):  # which has its own message
        return []
    message = (
        f"{name}: only {percent(share)} of what repeats with a shaft is at mesh harmonics of the rig's "
        f"{'/'.join(map(str, now.frame.teeth))} teeth. Is it a recording of this machine?"
    )
    return [message]


def pattern_mismatch_text(now: ReducedRecording, reference: ReducedRecording, name: str) -> list[str]:
    """Return a message if neither gear's tooth pattern matches the reference; flawless gears have none."""
    if not all(_has_pattern(recording, side) for recording in (now, reference) for side in (DRIVER, DRIVEN)):
        return []
    try:
        agreements = [turned_difference(now, reference, side)[1] for side in (DRIVER, DRIVEN)]
    except RefusalError:
        return []
    if max(agreements) >= MIN_AGREEMENT:
        return []
    by = " and ".join(f"{max(a, 0.0):.2f}" for a in agreements)
    message = (
        f"{name}: the tooth patterns of the two gears agree with the reference by only {by}, where 1 means the same "
        "gears. The reference is of another machine, all teeth have changed since, or flanks separate at a light load."
    )
    return [message]


def _has_pattern(reduced: ReducedRecording, side: int) -> bool:
    """Return whether the part that differs between a gear's teeth exceeds the noise in its clearest channel."""
    clearest = 0.0
    for average in reduced.averages(side):
        used = tooth_distinguishing_orders(np.arange(len(average.lines)), average.teeth)
        clearest = max(clearest, float(np.sum(np.abs(average.lines[used]) ** 2) / np.sum(average.noise[used])))
    return clearest >= MIN_PATTERN


def _mesh_share(now: ReducedRecording, side: int) -> float:
    """Return the share of the average's power near mesh harmonics, mean over channels."""
    teeth = now.frame.teeth[side]
    shares = []
    for average in now.averages(side):
        power = np.abs(average.lines) ** 2
        orders = np.arange(len(power))
        above = orders > SLOW
        total = float(power[above].sum())
        shares.append(
            float(power[above & (orders_from_mesh(orders, teeth) <= NEAR_MESH)].sum()) / total if total > 0 else 1.0
        )
    return float(np.mean(shares))


CLEAR_WITHOUT = 3.0
"""Structural floors between reference and simulator from which a message is given."""

LARGEST_DRIFT = 0.4
"""Relative change of speed over a record: more is a run-up; effects that make the speed wander remain far below."""

Stage = Callable[[str, float], object]


def conditions_of(
    recordings: Sequence[PreparedRecording],
    references: Sequence[PreparedRecording],
    twin: Twin,
    *,
    run_up: PreparedRecording | None = None,
    tell: Stage = lambda _what, _done: None,
    learned: Learned | None = None,
    on_read: Callable[[ConditionFacts, ReducedRecording], object] = lambda _facts, _now: None,
) -> tuple[list[Condition], list[str]]:
    """Return the conditions, and messages about them.

    Parameters
    ----------
    recordings, references : sequence of PreparedRecording
        Each carries its rig and its display name.
    twin : Twin
    run_up : PreparedRecording or None
        Run-up of the healthy machine, which measures the path to the sensors.
    tell : callable
        Called with the current stage and the fraction completed.
    learned : Learned or None
        Default: the data shipped with this version.
    on_read : callable
        Called with a recording's facts and reduction before its healthy twin is simulated.

    Raises
    ------
    InputError
        If the speed of the run-up hardly varies.
    RefusalError
        If no recording, or no reference, has a known speed and enough revolutions; or if the run-up measures no path,
        see `measured_path`.
    """
    learned = load_learned() if learned is None else learned
    messages: list[str] = []
    healthy = readable(references, read_healthy, "reference", messages)
    path = None
    if run_up is not None:
        tell(f"measuring the path by {run_up.recording.name}", 0.03)
        path = _path_of(run_up, healthy, twin, messages)
    done = iter(range(len(recordings)))

    def condition_of(recording: PreparedRecording) -> tuple[Condition, list[str]]:
        name = recording.recording.name
        tell(f"simulating the healthy machine at the point of {name}", 0.05 + 0.15 * next(done) / len(recordings))
        return _condition(recording, healthy, twin, learned, path, on_read)

    conditions = readable(recordings, condition_of, "recording", messages)
    if not references:
        messages.append(
            "No healthy reference: a recording of the same rig when it was healthy would make it much more certain."
        )
    return conditions, messages


MAX_MISSED_DB = 2.0
"""Difference of mesh harmonics, relative to each other, between two healthy runs at one speed and load: about 1 dB
between days, several decibels between machines."""


def _path_of(
    run_up: PreparedRecording, healthy: Sequence[HealthyReference], twin: Twin, messages: list[str]
) -> MeasuredPath | None:
    """Return the path that a run-up measures; None, with a message, where it is not of the references' machine."""
    path = measured_path(run_up, as_tried(twin), seed=SEED)
    missed_db = [db for reference in healthy if np.isfinite(db := path.missed_db(reference.reduced))]
    if min(missed_db, default=0.0) <= MAX_MISSED_DB:
        return path
    messages.append(
        f"{path.name} is not used: relative to each other, its mesh harmonics differ from those of the healthy "
        f"reference at the same speed by {min(missed_db):.1f} dB. Is it of the same machine, sensors and load?"
    )
    return None


ReadT = TypeVar("ReadT")


def readable(
    recordings: Sequence[PreparedRecording],
    read: Callable[[PreparedRecording], tuple[ReadT, list[str]]],
    kind: str,
    messages: list[str],
) -> list[ReadT]:
    """Return the result of `read` for each recording; if some of several are refused, they are omitted with a message.

    Parameters
    ----------
    recordings : sequence of PreparedRecording
    read : callable
        Returns the result for a recording, and messages.
    kind : str
        Name for the kind of recordings in messages.
    messages : list of str
        Messages and refusals are appended to it.

    Raises
    ------
    RefusalError
        If none can be read; it states the reason of the first.
    """
    read_recordings, refused = [], list[RefusalError]()
    for recording in recordings:
        try:
            content, new_messages = read(recording)
        except RefusalError as refusal:
            refused.append(RefusalError(f"{recording.recording.name}: {refusal.reason}", remedy=refusal.remedy))
        else:
            read_recordings.append(content)
            messages += new_messages
    if refused and not read_recordings:
        raise refused[0]
    messages += [f"{refusal.reason}; this {kind} is left out." for refusal in refused]
    return read_recordings


def read_healthy(recording: PreparedRecording) -> tuple[HealthyReference, list[str]]:
    """Return a healthy recording reduced, and messages about it."""
    reduced, messages = _reduced(recording)
    return HealthyReference(reduced, recording), [*messages, *teeth_mismatch_text(reduced, recording.recording.name)]


def _condition(
    recording: PreparedRecording,
    healthy: Sequence[HealthyReference],
    twin: Twin,
    learned: Learned,
    path: MeasuredPath | None,
    on_read: Callable[[ConditionFacts, ReducedRecording], object],
) -> tuple[Condition, list[str]]:
    """Return a recording with its reference and the healthy twin at its operating point, and messages."""
    name, (now, messages) = recording.recording.name, _reduced(recording)
    facts = facts_of(recording, now, twin)
    messages += _messages_of_recording(recording, facts)
    match, why = matching_reference(now, recording.rig, healthy)
    if match is None or teeth_mismatch_text(match.reduced, match.name):  # if a healthy one fits, the cause is damage
        messages += teeth_mismatch_text(now, name)
    if why:
        messages.append(f"{name} is compared with the simulation: {why}.")
    if match is not None:
        facts = replace(facts, reference=match.name)
        now = as_long_as(recording, now, match.reduced)
        now = with_common_channels(now, match.reduced, healthy, name, messages)
    reference = None
    if match is not None:
        reference, turned = as_mounted(now, match.reduced)
        messages += [f"{name}: {reversed_text(turned)}"] if turned else []
    check_steady(now, reference)
    on_read(facts, now)
    condition = Condition(facts, now, simulated(twin, facts, now), reference, learned, path)
    if reference is not None:
        messages += pattern_mismatch_text(now, reference, name)
        messages += _mismatched_reference(condition)
    return condition, messages


def with_common_channels(
    now: ReducedRecording,
    reference: ReducedRecording,
    healthy: Sequence[HealthyReference],
    name: str,
    messages: list[str],
) -> ReducedRecording:
    """Return a recording with the channels that its reference has as well, with messages about the others."""
    if not any(set(reference.channels) & set(candidate.reduced.channels) for candidate in healthy):
        messages.append(f"{name}: its only channel is taken for the reference's only one, which has another name.")
    left_out = [channel for channel in now.channels if channel not in reference.channels]
    if left_out:
        messages.append(f"{name}: {', '.join(left_out)} is left out, because the reference has no such channel.")
    return now.of_channels(reference.channels)


def check_steady(now: ReducedRecording, reference: ReducedRecording | None) -> None:
    """Refuse a run-up, except with one as the reference: the simulation is at one speed."""
    drift, usual = now.speed.drift, 0.0 if reference is None else reference.speed.drift
    if abs(drift - usual) > LARGEST_DRIFT:
        start, end = (60.0 * now.speed_hz * (1.0 + half * drift) for half in (-0.5, 0.5))
        raise RefusalError(
            f"the speed goes from about {start:.0f} to {end:.0f} rpm; the simulation it is compared with is at "
            "one speed",
            remedy="cut out parts at steady speed and give them as operating conditions, or give a reference of the "
            "same run",
        )


def _reduced(prepared: PreparedRecording) -> tuple[ReducedRecording, list[str]]:
    """Return a recording reduced without its dead channels, and messages."""
    recording, name, messages = prepared.recording, prepared.recording.name, list[str]()
    dead = {p.channel: p for p in prepared.problems if p.kind == "dead"}
    live = [channel for channel in recording.vibration_names() if channel not in dead]
    if not live:
        why = "; ".join(f"{p.channel}: {p.evidence}" for p in dead.values()) or "there is none"
        raise RefusalError(f"no vibration channel is live ({why})", remedy="check sensors, cables and inputs")
    unknown = [c.name for c in recording.channels if c.name in live and metres_per_second_squared(c) is None]
    if unknown:
        messages.append(
            f"{name}: {', '.join(unknown)} is not an acceleration in a known unit; it is compared as if it were in "
            "m/s², so without a reference its level means nothing."
        )
    reduced = reduce_recording(prepared, channels=live)
    messages += [f"{name}: channel {p.channel} is dead ({p.evidence}) and left out." for p in dead.values()]
    grave = prepared.grave_problems(live)
    messages += [f"{name}: {p.text}; this alone may explain the difference." for p in grave]
    return reduced, messages


def _messages_of_recording(prepared: PreparedRecording, facts: ConditionFacts) -> list[str]:
    """Return warnings about a recording, and which parts of its operating point were not given."""
    recording = prepared.recording
    texts = [f"{facts.name}: {warning}." for warning in recording.warnings]
    if recording.speed_source is None:
        texts.append(
            f"{facts.name}: no tachometer and no known speed; {facts.point.speed_rpm:.4g} rpm were found in the"
            " vibration."
        )
    if _torque_nm(prepared.rig) is None:
        texts.append(
            f"{facts.name}: the torque is not given; {facts.point.torque_nm:.3g} N·m, usual for such gears, is assumed."
        )
    return texts


def _mismatched_reference(condition: Condition) -> list[str]:
    """Return a message if the reference itself is far from the simulation of a healthy machine."""
    change = difference_features(condition.baseline, condition.simulated, condition.learned.credibility)
    size = gap_size(change, condition.learned.floor(with_reference=False)).structural.value
    if size < CLEAR_WITHOUT:
        return []
    message = (
        f"The reference of {condition.facts.name} is itself {size:.1f} structural floors from the simulation of a "
        "healthy machine: if it was not healthy, only changes since then are seen."
    )
    return [message]
