"""Learn the changes of transmission error by which encoders distinguish tooth faults.

`python -m app.studies.gap.tooth_errors` draws static contacts of three simulators that model teeth and faults
differently – load sharing of rack-shaped teeth, the quasi-static machines, finite-element gears whose face slices touch
independently – and writes the descriptors of the change caused by each fault. It prints how often the faults of each
simulator are identified after learning from the others. `--blind N` records faults on the independent rig, with
encoders, and identifies them after learning from all.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from math import exp, floor, nan, pi
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.special import softmax

from app.studies import run_study
from app.studies.gap.quasi_static import (
    EFFECTS,
    OUT_OF_REACH_M,
    QuasiStaticState,
    StaticMachine,
    at_places,
    is_in_reach,
    meeting,
    static_contact,
)
from gearsig.cache import write_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError, answer_or_none
from gearsig.severity import (
    OTHER,
    TOOTH_ERRORS_FILE,
    TOOTH_FAULTS,
    KnownToothErrors,
    ToothErrorChange,
    ToothErrorEvidence,
    depth_terms,
    event_rms_um,
    percent_per_mm,
    tooth_error_descriptors,
    tooth_error_evidence,
)
from sims.blind import draw_case, record_case
from sims.effects import ONE_TOOTH_SHARE, cumulative_pitch
from sims.fe_gear import GearBlank, MeshSize, ReducedGear, ReductionPlan, reduce_gear
from sims.machine import log_uniform
from sims.mesh import (
    HEALTHY,
    FlankDeviation,
    GearGeometry,
    GearMesh,
    MeshTable,
    PairGeometry,
    RootCrack,
    ToothChip,
    ToothRows,
    ToothSpall,
    chip_separation_m,
    corner_separation_m,
    deepest_crack_mm,
    mesh_table,
    separation_table,
    share_torque,
    tooth_rows,
)
from sims.reduced_fe import mesh_maps, static_table

SEED = 5501
STEPS = 32
"""Steps per pitch, as in the diagnosis."""
MIN_CHANGE_UM = 0.3
LOAD_N_PER_MM2 = (15.0, 120.0)
"""Force per face width and module."""
MIN_LOAD_N_PER_MM = 15.0
"""Minimum load of quasi-static machines; below it, teeth hardly deflect."""
NOISE, TORSION = (0.002, 0.05), (0.002, 0.08)
"""Relative to the peak-to-peak change: noise of the resolution, and drift by torsion of the drive over many pitches."""
OTHER_NOISE = 0.3
"""The same upper limit where no tooth is damaged: there noise may be most of the change."""
WEAR_UM, RUN_OUT_UM, LOAD_CHANGE = (1.0, 20.0), (2.0, 40.0), 0.2
"""Other changes: wear of all teeth, run-out, and the natural logarithm of the ratio of both loads."""
FAULTY_TOOTH = 5


class DrawnChange(NamedTuple):
    """A change of transmission error; the load, and a crack's depth in percent of the root, where they are known."""

    change: ToothErrorChange
    load_n_per_mm: float = nan
    depth_percent: float = nan


Drawn = Callable[[str, np.random.Generator], DrawnChange]


# --------------------
# Load sharing of rack-shaped teeth and of finite-element gears, both with corner contact.
# --------------------


def shared_load(fault: str, rng: np.random.Generator) -> DrawnChange:
    """Return the change by a fault if rack-shaped teeth share the load.

    Raises
    ------
    InputError
        If the random gears or fault are impossible.
    """
    first = int(rng.integers(18, 56))
    teeth = first, int(np.clip(round(first * rng.uniform(0.8, 2.6)), 18, 100))
    module = float(rng.choice((1.5, 2.0, 2.5, 3.0, 4.0)))
    width = module * rng.uniform(6.0, 12.0)
    driver, driven = (GearGeometry(z, module, face_width_mm=width) for z in teeth)
    healthy, load = _loaded(PairGeometry(driver, driven), rng)
    side = int(rng.integers(2))
    healthy, faulty, load_now = _states(fault, healthy, side, load, rng)

    def error_um(mesh: GearMesh, load: float) -> FloatArray:
        table, cycles = table_with_corners(mesh), _cycles(teeth[side]) + CORNERS
        return 1e6 * share_torque(mesh, _torque_nm(mesh, load), cycles, table=table).transmission_error_m

    change = _change(fault, side, error_um(faulty, load_now), error_um(healthy, load), rng)
    return DrawnChange(change, load, _depth_percent(faulty, side))


def finite_elements(fault: str, rng: np.random.Generator) -> DrawnChange:
    """Return the change by a fault if finite-element gears share the load, with independent slices of the face.

    A crack adds the compliance of the finite elements. At spalls and chips, slices are recessed; the neighbouring ones
    carry more load.

    Raises
    ------
    InputError
        If the random fault is impossible.
    RefusalError
        If no contact is found.
    """
    gears = element_gear(int(rng.choice(ELEMENT_TEETH))), element_gear(int(rng.choice(ELEMENT_TEETH)))
    driver, driven = (gear.blank.geometry for gear in gears)
    healthy, load = _loaded(PairGeometry(driver, driven), rng)
    side = int(rng.integers(2))
    healthy, faulty, load_now = _states(fault, healthy, side, load, rng)
    in_slice = np.ones(len(gears[0].grid.z_m), dtype=bool)
    for name in (f"spalls_{side + 1}", f"chips_{side + 1}"):
        for damage in getattr(faulty, name):
            n_lost = max(1, round(len(in_slice) * (damage.width_mm or 0.0) / driver.face_width_mm))
            first = int(rng.integers(len(in_slice) - n_lost + 1)) if name.startswith("spalls") else 0
            in_slice = np.isin(np.arange(len(in_slice)), np.arange(first, first + n_lost))
            whole: dict[str, Any] = {name: (replace(damage, width_mm=driver.face_width_mm),)}
            faulty = replace(faulty, **whole)

    def error_um(mesh: GearMesh, load: float) -> FloatArray:
        # Only a crack changes the compliance of the elements.
        cracked = replace(mesh.healthy, cracks_1=mesh.cracks_1, cracks_2=mesh.cracks_2)
        table = static_table(gears, cracked)
        missing = separations_with_corners(mesh, table.progress)
        rows = [
            np.where(in_slice, of_gear[:, :, None], of_gear[:1, :, None])
            for of_gear in (missing.gear(1), missing.gear(2))
        ]
        separation = missing._replace(rows=np.concatenate(rows))
        table = replace(table, separation=separation, corner_m=np.zeros_like(table.corner_m))
        torque, cycles = np.array([_torque_nm(mesh, load)]), _cycles(mesh.side(side + 1).gear.teeth)
        return 1e6 * mesh_maps(gears, mesh, torque, cycles, table=table).transmission_error_m[:, 0]

    change = _change(fault, side, error_um(faulty, load_now), error_um(healthy, load), rng)
    return DrawnChange(change, load, _depth_percent(faulty, side))


ELEMENT_TEETH = (19, 22, 26, 31, 37, 44, 52, 62, 74)


@cache
def element_gear(teeth: int) -> ReducedGear:
    """Return a finite-element gear of 2 mm module, coarse except at its flanks."""
    geometry = GearGeometry(teeth, 2.0, bore_radius_mm=0.4 * teeth)
    size = MeshSize(n_across=2, n_gap=1, n_up=6, n_rim=1, n_body=2, n_along=4)
    return reduce_gear(GearBlank(geometry), ReductionPlan(size, n_modes=4))


def _loaded(pair: PairGeometry, rng: np.random.Generator) -> tuple[GearMesh, float]:
    """Draw a load, in N/mm, and the tip relief of gears designed for it."""
    module = pair.driver.module_mm
    load = log_uniform(rng, *LOAD_N_PER_MM2) * module
    relief = 0.0 if rng.uniform() < 0.25 else load / 14.0 * rng.uniform(0.2, 1.4)
    flank = FlankDeviation(tip_relief_um=relief, tip_relief_length_mm=module * rng.uniform(0.7, 1.5))
    return GearMesh(pair, flank_1=flank, flank_2=flank, contact_law="load-dependent"), load


def _torque_nm(mesh: GearMesh, load_n_per_mm: float) -> float:
    return load_n_per_mm * mesh.pair.face_width_mm * mesh.pair.driver.base_radius_mm * 1e-3


def _states(
    fault: str, mesh: GearMesh, side: int, load_n_per_mm: float, rng: np.random.Generator
) -> tuple[GearMesh, GearMesh, float]:
    """Return the mesh before and after, and the load after, in N/mm.

    Only a fault of a tooth comes alone. Any other change is one of teeth with tolerances, which another load, wear and
    run-out show in another way.
    """
    if fault != OTHER:
        return mesh, replace(mesh, **_fault(fault, mesh, side, rng)), load_n_per_mm
    name, flank, teeth = f"flank_{side + 1}", mesh.side(side + 1).flank, mesh.side(side + 1).gear.teeth
    pitch = rng.uniform(0.5, 8.0) * cumulative_pitch(teeth, rng)
    wear, run_out = (log_uniform(rng, *span) * (rng.uniform() < 0.5) for span in (WEAR_UM, RUN_OUT_UM))
    turned = pitch + run_out * np.cos(2.0 * pi * (np.arange(teeth) / teeth + rng.uniform()))
    before: dict[str, Any] = {name: replace(flank, pitch_um=tuple(pitch.tolist()))}
    after: dict[str, Any] = {name: replace(flank, pitch_um=tuple(turned.tolist()), wear_um=wear)}
    load_now = load_n_per_mm * exp(rng.uniform(-LOAD_CHANGE, LOAD_CHANGE))
    return replace(mesh, **before), replace(mesh, **after), load_now


def _fault(name: str, mesh: GearMesh, side: int, rng: np.random.Generator) -> dict[str, Any]:
    """Return the fields of a mesh that a fault changes."""
    number, pair = side + 1, mesh.pair
    gear, flank = mesh.side(number).gear, mesh.side(number).flank
    module, width = gear.module_mm, gear.face_width_mm
    if name == "root_crack":
        depth = rng.uniform(0.15, 0.85) * deepest_crack_mm(gear)
        return {f"cracks_{number}": (RootCrack(depth, tooth=FAULTY_TOOTH),)}
    if name == "tooth_spall":
        part = 1.0 if rng.uniform() < 0.3 else rng.uniform(0.15, 0.85)
        at = (pair.pitch_point_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm + rng.uniform(-0.3, 0.3)
        centre = float(np.clip(at / pair.contact_ratio, 0.0, 1.0))
        centre = centre if side == 0 else 1.0 - centre
        spall = ToothSpall(module * log_uniform(rng, 0.2, 1.0), width * part, 100.0, FAULTY_TOOTH, centre)
        return {f"spalls_{number}": (spall,)}
    if name == "chipped_tooth":
        part = float(rng.choice((0.3, 0.6, 0.85, 1.0)))
        return {f"chips_{number}": (ToothChip(module * rng.uniform(0.2, 0.9), width * part, FAULTY_TOOTH),)}
    if rng.uniform() < ONE_TOOTH_SHARE:
        pitch = rng.uniform(3.0, 30.0) * float(rng.choice((-1.0, 1.0))) * np.eye(gear.teeth)[FAULTY_TOOTH]
    else:
        pitch = rng.uniform(3.0, 20.0) * cumulative_pitch(gear.teeth, rng)
    return {f"flank_{number}": replace(flank, pitch_um=tuple(pitch.tolist()))}


CORNERS = 0.35
"""Range of corner contact before and after the path of contact, in base pitches."""


def table_with_corners(mesh: GearMesh) -> MeshTable:
    """Return the table of a mesh with corner contact before and after the path; cycles begin `CORNERS` late.

    In `sims.mesh` a pair engages and disengages within a twentieth of a pitch. But a tooth that lags by some µm leaves
    the load to its neighbours' corners: without corner contact, a pitch error of one tooth looks like a crack.
    """
    table = mesh_table(mesh)
    low, high = -CORNERS - mesh.ramp, mesh.pair.contact_ratio + CORNERS + mesh.ramp
    progress = np.linspace(low, high, 512)
    inside = np.clip(progress, 0.0, mesh.pair.contact_ratio)
    compliance = []
    for number in (1, 2):
        side = mesh.side(number)
        faults = [side.faults_of(tooth) for tooth in side.faulty_teeth]
        rows = [mesh.gear_compliance(number, inside, of_tooth) for of_tooth in (HEALTHY, *faults)]
        compliance.append((np.array(rows), _row_of_teeth(mesh, number)))
    return replace(
        table,
        start=low + CORNERS,
        step=progress[1] - progress[0],
        compliance=tooth_rows(*compliance),
        separation=separations_with_corners(mesh, progress),
        contact_ratio=mesh.pair.contact_ratio + 2.0 * CORNERS,
        n_slots=floor(mesh.pair.contact_ratio + 2.0 * CORNERS + mesh.ramp) + 1,
    )


def separations_with_corners(mesh: GearMesh, progress: FloatArray) -> ToothRows:
    """Return the separation between the flanks of each tooth and its mate, including that of their corners.

    On a tooth chipped over the whole face, the corner is at the edge of the chip.
    """
    inside = np.clip(progress, 0.0, mesh.pair.contact_ratio)
    ordinary, _ = separation_table(mesh.healthy, inside)
    spalled, _ = separation_table(replace(mesh, chips_1=(), chips_2=()), inside)
    corner = corner_separation_m(mesh.pair, progress)
    gears = []
    for number in (1, 2):
        side, of = mesh.side(number), _row_of_teeth(mesh, number)
        rows = [ordinary.gear(number)[0]]
        for tooth in side.faulty_teeth:
            _, spall, chip = side.faults_of(tooth)
            row = ordinary.gear(number)[0] if spall is None else spalled.gear(number)[1]
            rows.append(row if chip is None else row + chip_separation_m(mesh.pair, number, chip, progress))
        gears.append((np.array(rows) + (corner if number == 1 else 0.0), of))
    return tooth_rows(*gears)


def _row_of_teeth(mesh: GearMesh, number: int) -> NDArray[np.int64]:
    """Return 0 for each healthy tooth, and the index of each faulty tooth among the faulty ones, from 1."""
    side = mesh.side(number)
    of = np.zeros(side.gear.teeth, dtype=np.int64)
    of[list(side.faulty_teeth)] = np.arange(1, 1 + len(side.faulty_teeth))
    return of


# --------------------
# The quasi-static machines, and functions for all simulators.
# --------------------


def quasi_static(fault: str, rng: np.random.Generator) -> DrawnChange:
    """Return the change by a fault on a random quasi-static machine whose other gear has identical teeth.

    Raises
    ------
    InputError
        If the random machine is impossible or carries almost no load.
    """
    machine = StaticMachine.of(rng)
    if machine.load_n < MIN_LOAD_N_PER_MM * machine.nominal.face_width_mm:
        raise InputError("the teeth carry almost no load")
    healthy, faulty = machine.healthy(), machine.healthy()
    load_now = machine.load_n
    if fault != OTHER:
        EFFECTS[fault](machine, faulty, rng)
    else:
        load_now *= exp(rng.uniform(-LOAD_CHANGE, LOAD_CHANGE))
        if rng.uniform() < 0.5:
            EFFECTS["tooth_wear"](machine, faulty, rng)
    moved = [
        float(np.abs(faulty.gaps_m[s] - healthy.gaps_m[s]).sum() + np.abs(faulty.weak[s] - healthy.weak[s]).sum())
        for s in (0, 1)
    ]
    side = int(np.argmax(moved))
    cycles, path = _cycles(machine.drawn.teeth[side]), machine.path
    reached = is_in_reach(cycles, path)
    pair_stiffness = at_places(cycles, path, machine.stiffness_n_per_m)

    def error_um(state: QuasiStaticState, load_n: float) -> FloatArray:
        def met(tables: Sequence[FloatArray]) -> FloatArray:
            only = tuple(table if s == side else np.zeros_like(table) for s, table in enumerate(tables))
            return meeting(cycles, path, only, (0, 0))  # type: ignore[arg-type]  # two of them

        stiffness = np.where(reached, pair_stiffness / (1.0 + met(state.weak)), 1e-3)
        gaps = np.where(reached, met(state.gaps_m), OUT_OF_REACH_M)
        return 1e6 * static_contact(stiffness, gaps, np.full(len(cycles), load_n))[0]

    return DrawnChange(_change(fault, side, error_um(faulty, load_now), error_um(healthy, machine.load_n), rng))


def _cycles(teeth: int) -> FloatArray:
    return (np.arange(teeth * STEPS) + 0.5) / STEPS


def _change(
    fault: str, side: int, faulty_um: FloatArray, healthy_um: FloatArray, rng: np.random.Generator
) -> ToothErrorChange:
    """Return the change as measured by encoders: starting at a random angle, with noise."""
    change, start = faulty_um - healthy_um, int(rng.integers(STEPS))
    size = float(np.ptp(change))
    if size < MIN_CHANGE_UM:
        raise InputError("the fault changes almost nothing")
    white = rng.standard_normal((2, len(change)))
    lines = np.fft.rfft(white[1])
    slow = np.fft.irfft(lines / np.maximum(np.arange(len(lines)) * STEPS / len(change), 0.05), len(change))
    most_noise = OTHER_NOISE if fault == OTHER else NOISE[1]
    noise, torsion = log_uniform(rng, NOISE[0], most_noise), log_uniform(rng, *TORSION)
    change = change + size * (noise * white[0] + torsion * slow / slow.std())
    pattern, mesh = np.roll(change, start).reshape(-1, STEPS), healthy_um.reshape(-1, STEPS).mean(axis=0)
    return ToothErrorChange(side, pattern, np.roll(mesh, start), event_rms_um(pattern), 0.0)


def _depth_percent(mesh: GearMesh, side: int) -> float:
    """Return the depth of the gear's crack in percent of the root; nan without one."""
    cracks, gear = (mesh.cracks_1, mesh.cracks_2)[side], mesh.side(side + 1).gear
    return cracks[0].depth_mm * percent_per_mm(gear.teeth, gear.module_mm) if cracks else nan


def _reach_of(drawn: Sequence[DrawnChange]) -> FloatArray:
    """Return `KnownToothErrors.reach`: the drawn loads and, of the cracks, teeth and depths; nan without cracks."""
    cracks = [one for one in drawn if one.depth_percent == one.depth_percent]
    if not cracks:
        return np.full((3, 2), nan)
    teeth, depths = [len(one.change.pattern_um) for one in cracks], [one.depth_percent for one in cracks]
    return np.array([LOAD_N_PER_MM2, (min(teeth), max(teeth)), (min(depths), max(depths))])


TYPICAL_CRACK = (-5.4, 1.0 / 40.0)
"""ln(change in µm per N/mm) and 1/z in the middle of the drawn cracks."""

SIMULATORS: dict[str, Drawn] = {
    "shared load": shared_load,
    "quasi-static": quasi_static,
    "finite elements": finite_elements,
}


def known_tooth_errors_of(simulator: str, n_each: int) -> KnownToothErrors:
    """Return the changes of transmission error by `n_each` faults of each kind, and of as many other changes."""
    rng = np.random.default_rng([SEED, [*SIMULATORS].index(simulator)])
    drawn: list[DrawnChange] = []
    for fault in (*TOOTH_FAULTS, OTHER):
        n_rows = len(drawn) + n_each
        while len(drawn) < n_rows:
            try:
                drawn.append(SIMULATORS[simulator](fault, rng))
            except (InputError, RefusalError):
                continue
    rows = np.array([tooth_error_descriptors(one.change) for one in drawn])
    return KnownToothErrors(rows, np.repeat([*TOOTH_FAULTS, OTHER], n_each), _depth_of(drawn), _reach_of(drawn))


def _depth_of(drawn: Sequence[DrawnChange]) -> FloatArray:
    """Return `KnownToothErrors.depth` by least squares over the cracks; nan where there are none."""
    cracks = [one for one in drawn if one.depth_percent == one.depth_percent]
    if not cracks:
        return np.full(4, nan)
    terms = np.array([depth_terms(c.change.rms_um, c.load_n_per_mm, len(c.change.pattern_um)) for c in cracks])
    log_percent = np.log([c.depth_percent for c in cracks])
    fitted = np.linalg.lstsq(terms, log_percent, rcond=None)[0]
    return np.array([*fitted, np.std(log_percent - terms @ fitted)])


def together(several: Sequence[KnownToothErrors]) -> KnownToothErrors:
    """Return the combined changes of several simulators.

    Numbers of the depth are means; their differences count as uncertainty, at the mean change of a crack.
    """
    descriptors = np.concatenate([known.descriptors for known in several])
    depths = np.array([known.depth for known in several if np.isfinite(known.depth).all()])
    at = np.array([1.0, *TYPICAL_CRACK])
    apart = float(np.std(depths[:, :3] @ at))
    depth = [*depths[:, :3].mean(axis=0), np.hypot(apart, np.sqrt(np.mean(depths[:, 3] ** 2)))]
    causes, reaches = np.concatenate([known.causes for known in several]), [known.reach for known in several]
    reach = np.stack([np.nanmin(reaches, axis=0)[:, 0], np.nanmax(reaches, axis=0)[:, 1]], axis=1)
    return KnownToothErrors(descriptors, causes, np.array(depth), reach)


def evidence_on(known: KnownToothErrors, rows: FloatArray) -> list[ToothErrorEvidence]:
    """Return the evidence that rows of descriptors are; their size and gear do not matter."""
    return [ToothErrorEvidence(known.log_likelihoods(row), 1.0, nan, {}) for row in rows]


def named(evidence: Sequence[ToothErrorEvidence]) -> tuple[NDArray[np.str_], FloatArray]:
    """Return the most probable fault of each and its probability, with equal priors for all four."""
    levels = np.array([[one.log_likelihoods[name] for name in TOOTH_FAULTS] for one in evidence])
    shares = softmax(levels, axis=1)
    return np.array(TOOTH_FAULTS)[shares.argmax(axis=1)], shares.max(axis=1)


def _print_accuracy(
    title: str, truth: NDArray[np.str_], named_fault: NDArray[np.str_], probability: FloatArray
) -> None:
    right, sure = truth == named_fault, probability >= 0.9
    is_single = truth != "pitch_error"
    of_each = ", ".join(f"{name} {np.mean(right[truth == name]):.2f}" for name in TOOTH_FAULTS if (truth == name).any())
    typer.echo(
        f"{title}: right {right.mean():.2f} of {len(right)} ({of_each}; of one tooth {right[is_single].mean():.2f}); "
        f"probability ≥ 0.9: {sure.sum()}, right {right[sure].mean() if sure.any() else float('nan'):.2f}"
    )


def _print_odds(causes: NDArray[np.str_], evidence: Sequence[ToothErrorEvidence]) -> None:
    """Print how often encoders' odds of a damaged tooth are high, for damaged teeth and for other changes."""
    odds = np.array([one.odds_of_a_tooth for one in evidence])
    for name in dict.fromkeys(causes.tolist()):
        of_it = odds[causes == name]
        shares = ", ".join(f"≥ {limit} {np.mean(of_it >= limit):.3f}" for limit in (3, 20, 100))
        typer.echo(f"  {name}: {len(of_it)}, odds of a damaged tooth {shares}")


ENCODER_COUNTS = 200_000
OTHER_EFFECTS = ("eccentricity", "misalignment", "tooth_wear")
"""Effects of the independent rig that change the transmission error without a fault of a tooth."""


def name_blindly(n_each: int) -> None:
    """Identify faults of the independent rig's development gears by its encoders; print the share of right answers.

    Changes without a fault of a tooth are among them, to compare the odds.
    """
    rng = np.random.default_rng([SEED, 9])
    causes: list[str] = []
    evidence: list[ToothErrorEvidence] = []
    for cause in [name for name in (*TOOTH_FAULTS, *OTHER_EFFECTS) for _ in range(n_each)]:
        level = float(rng.uniform(0.5, 1.0))
        case = draw_case(rng, "development", kind="single", effect=cause, level=level, with_reference=True)
        recorded = record_case(case, encoder_counts=ENCODER_COUNTS)
        for now, reference in zip(recorded.conditions, recorded.references, strict=True):
            said = answer_or_none(partial(tooth_error_evidence, now, reference), now.name, [])
            if said is not None and said.is_seen:
                causes.append(cause)
                evidence.append(said)
    told = [i for i, cause in enumerate(causes) if cause in TOOTH_FAULTS]
    truth = np.array(causes)
    title = f"independent rig, {2 * n_each * len((*TOOTH_FAULTS, *OTHER_EFFECTS)) - len(evidence)} not seen"
    _print_accuracy(title, truth[told], *named([evidence[i] for i in told]))
    _print_odds(truth, evidence)


def main(
    each: Annotated[int, typer.Option(help="faults of each kind and simulator")] = 600,
    blind: Annotated[int, typer.Option(help="faults of each kind on the independent rig")] = 0,
    to: Path = TOOTH_ERRORS_FILE,
) -> None:
    """Draw faults, print the accuracy and write what was learned."""
    by_simulator = {name: known_tooth_errors_of(name, each) for name in SIMULATORS}
    for name, held_out in by_simulator.items():
        taught = together([known for title, known in by_simulator.items() if title != name])
        evidence = evidence_on(taught, held_out.descriptors)
        of_faults = [one for one, cause in zip(evidence, held_out.causes, strict=True) if cause != OTHER]
        _print_accuracy(f"{name} left out", held_out.causes[held_out.causes != OTHER], *named(of_faults))
        _print_odds(held_out.causes, evidence)
    everything = together([*by_simulator.values()])
    typer.echo(f"depth of cracks: {everything.depth.round(3).tolist()}")
    rows = everything.descriptors.astype(np.float16)
    numbers = {"depth": everything.depth, "reach": everything.reach}
    write_arrays(to, {"descriptors": rows, "causes": everything.causes, **numbers})
    if blind:
        name_blindly(blind)


if __name__ == "__main__":
    run_study(main)
