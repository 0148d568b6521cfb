"""Learn the changes of transmission errors by which encoders tell tooth faults apart.

`python -m app.studies.gap.tooth_errors` draws static contacts of two simulators that describe teeth and faults
otherwise than each other – load shared by teeth of a rack's shape, and the quasi-static machines – and writes the
descriptors of what each fault changes. It prints how often each simulator's faults are named rightly by what the other
has taught. `--blind N` records faults on the independent rig, with encoders, and names them by both.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace
from math import exp, log
from pathlib import Path
from typing import Any

import numpy as np
import typer
from numpy.typing import NDArray

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
from gearsig.cache import write_whole
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap import (
    TOOTH_ERRORS_FILE,
    TOOTH_FAULTS,
    KnownToothErrors,
    ToothErrorChange,
    tooth_error_descriptors,
    tooth_error_evidence,
)
from sims.blind import draw_case, record_case
from sims.effects import ONE_TOOTH_SHARE, cumulative_pitch
from sims.machine import log_uniform
from sims.mesh import (
    FlankDeviation,
    GearGeometry,
    GearMesh,
    PairGeometry,
    RootCrack,
    ToothChip,
    ToothSpall,
    deepest_crack_mm,
    share_torque,
)

SEED = 5501
STEPS = 32
"""Of a pitch, as the diagnosis has them."""
MIN_CHANGE_UM = 0.3
LOAD_N_PER_MM2 = (15.0, 120.0)
"""Force per face width and module."""
MIN_LOAD_N_PER_MM = 15.0
"""Of quasi-static machines: at less, teeth hardly yield."""
NOISE, TORSION = (0.002, 0.05), (0.002, 0.08)
"""Over the change's swing: what resolution leaves, and what the drive's torsion does over many pitches."""
FAULTY_TOOTH = 5

Drawn = Callable[[str, np.random.Generator], ToothErrorChange]


def shared_load(fault: str, rng: np.random.Generator) -> ToothErrorChange:
    """Return what a fault changes where teeth of a rack's shape share the load.

    Raises
    ------
    InputError
        If gears or fault were drawn that cannot be.
    """
    first = int(rng.integers(18, 56))
    teeth = first, int(np.clip(round(first * rng.uniform(0.8, 2.6)), 18, 100))
    module = float(rng.choice((1.5, 2.0, 2.5, 3.0, 4.0)))
    width = module * rng.uniform(6.0, 12.0)
    driver, driven = (GearGeometry(z, module, face_width_mm=width) for z in teeth)
    pair = PairGeometry(driver, driven)
    load = log_uniform(rng, *LOAD_N_PER_MM2) * module
    relief = 0.0 if rng.uniform() < 0.25 else load / 14.0 * rng.uniform(0.2, 1.4)
    flank = FlankDeviation(tip_relief_um=relief, tip_relief_length_mm=module * rng.uniform(0.7, 1.5))
    healthy = GearMesh(pair, flank_1=flank, flank_2=flank, contact_law="load-dependent")
    side = int(rng.integers(2))
    faulty = replace(healthy, **_fault(fault, (driver, driven)[side], flank, side + 1, rng))
    torque = load * width * driver.base_radius_mm * 1e-3

    def error_um(mesh: GearMesh) -> FloatArray:
        return 1e6 * share_torque(mesh, torque, _cycles(teeth[side])).transmission_error_m

    return _change(side, error_um(faulty), error_um(healthy), rng)


def _fault(
    name: str, gear: GearGeometry, flank: FlankDeviation, number: int, rng: np.random.Generator
) -> dict[str, Any]:
    """Return the fields of a mesh that change."""
    module, width = gear.module_mm, gear.face_width_mm
    if name == "root_crack":
        depth = rng.uniform(0.15, 0.85) * deepest_crack_mm(gear)
        return {f"cracks_{number}": (RootCrack(depth, tooth=FAULTY_TOOTH),)}
    if name == "tooth_spall":
        spall = ToothSpall(module * log_uniform(rng, 0.2, 1.0), width * rng.uniform(0.15, 0.85), 100.0, FAULTY_TOOTH)
        return {f"spalls_{number}": (spall,)}
    if name == "chipped_tooth":
        part = float(rng.choice((0.3, 0.6, 0.85, 1.0)))
        return {f"chips_{number}": (ToothChip(module * rng.uniform(0.2, 0.9), width * part, FAULTY_TOOTH),)}
    if rng.uniform() < ONE_TOOTH_SHARE:
        pitch = rng.uniform(3.0, 30.0) * float(rng.choice((-1.0, 1.0))) * np.eye(gear.teeth)[FAULTY_TOOTH]
    else:
        pitch = rng.uniform(3.0, 20.0) * cumulative_pitch(gear.teeth, rng)
    return {f"flank_{number}": replace(flank, pitch_um=tuple(pitch.tolist()))}


def quasi_static(fault: str, rng: np.random.Generator) -> ToothErrorChange:
    """Return what a fault changes on a drawn quasi-static machine, the teeth of the other gear alike.

    Raises
    ------
    InputError
        If a machine was drawn that cannot be, or next to no load.
    """
    machine = StaticMachine.of(rng)
    if machine.load_n < MIN_LOAD_N_PER_MM * machine.nominal.face_width_mm:
        raise InputError("the teeth carry next to nothing")
    healthy, faulty = machine.healthy(), machine.healthy()
    EFFECTS[fault](machine, faulty, rng)
    moved = [
        float(np.abs(faulty.gaps_m[s] - healthy.gaps_m[s]).sum() + np.abs(faulty.weak[s] - healthy.weak[s]).sum())
        for s in (0, 1)
    ]
    side = int(np.argmax(moved))
    cycles, path = _cycles(machine.drawn.teeth[side]), machine.path
    reached = is_in_reach(cycles, path)
    pair_stiffness = at_places(cycles, path, machine.stiffness_n_per_m)

    def error_um(state: QuasiStaticState) -> FloatArray:
        def met(tables: Sequence[FloatArray]) -> FloatArray:
            only = tuple(table if s == side else np.zeros_like(table) for s, table in enumerate(tables))
            return meeting(cycles, path, only, (0, 0))  # type: ignore[arg-type]  # two of them

        stiffness = np.where(reached, pair_stiffness / (1.0 + met(state.weak)), 1e-3)
        gaps = np.where(reached, met(state.gaps_m), OUT_OF_REACH_M)
        return 1e6 * static_contact(stiffness, gaps, np.full(len(cycles), machine.load_n))[0]

    return _change(side, error_um(faulty), error_um(healthy), rng)


def _cycles(teeth: int) -> FloatArray:
    return (np.arange(teeth * STEPS) + 0.5) / STEPS


def _change(side: int, faulty_um: FloatArray, healthy_um: FloatArray, rng: np.random.Generator) -> ToothErrorChange:
    """Return the change as encoders give it: from any angle on, with noise."""
    change, start = faulty_um - healthy_um, int(rng.integers(STEPS))
    size = float(np.ptp(change))
    if size < MIN_CHANGE_UM:
        raise InputError("the fault changes next to nothing")
    white = rng.standard_normal((2, len(change)))
    lines = np.fft.rfft(white[1])
    slow = np.fft.irfft(lines / np.maximum(np.arange(len(lines)) * STEPS / len(change), 0.05), len(change))
    noise, torsion = (exp(rng.uniform(log(low), log(high))) for low, high in (NOISE, TORSION))
    change = change + size * (noise * white[0] + torsion * slow / slow.std())
    mesh = healthy_um.reshape(-1, STEPS).mean(axis=0)
    return ToothErrorChange(side, np.roll(change, start).reshape(-1, STEPS), np.roll(mesh, start), size, 0.0)


SIMULATORS: dict[str, Drawn] = {"shared load": shared_load, "quasi-static": quasi_static}


def known_tooth_errors_of(simulator: str, n_each: int) -> KnownToothErrors:
    """Return the changes of the transmission error by so many faults of each kind."""
    rng = np.random.default_rng([SEED, [*SIMULATORS].index(simulator)])
    rows: list[FloatArray] = []
    for fault in TOOTH_FAULTS:
        n_rows = len(rows) + n_each
        while len(rows) < n_rows:
            try:
                rows.append(tooth_error_descriptors(SIMULATORS[simulator](fault, rng)))
            except (InputError, RefusalError):
                continue
    return KnownToothErrors(np.array(rows), np.repeat(TOOTH_FAULTS, n_each))


def named(known: KnownToothErrors, rows: FloatArray) -> tuple[NDArray[np.str_], FloatArray]:
    """Return the likeliest fault of each row, and its probability where all four are as likely beforehand."""
    levels = np.array([[known.log_likelihoods(row)[name] for name in TOOTH_FAULTS] for row in rows])
    weights = np.exp(levels - levels.max(axis=1, keepdims=True))
    return np.array(TOOTH_FAULTS)[levels.argmax(axis=1)], weights.max(axis=1) / weights.sum(axis=1)


def _print_accuracy(
    title: str, truth: NDArray[np.str_], named_fault: NDArray[np.str_], probability: FloatArray
) -> None:
    right, sure = truth == named_fault, probability >= 0.9
    is_single = truth != "pitch_error"
    of_each = ", ".join(f"{name} {np.mean(right[truth == name]):.2f}" for name in TOOTH_FAULTS if (truth == name).any())
    typer.echo(
        f"{title}: right {right.mean():.2f} of {len(right)} ({of_each}; of one tooth {right[is_single].mean():.2f}); "
        f"said with 0.9 {sure.sum()}, right {right[sure].mean() if sure.any() else float('nan'):.2f}"
    )


ENCODER_COUNTS = 200_000


def blind(n_each: int) -> None:
    """Name faults of the independent rig's development gears by its encoders, and print how often that is right."""
    rng = np.random.default_rng([SEED, 9])
    rows: list[tuple[str, str, float]] = []
    unlike = 0
    for fault in [name for name in TOOTH_FAULTS for _ in range(n_each)]:
        level = float(rng.uniform(0.5, 1.0))
        case = draw_case(rng, "development", kind="single", effect=fault, level=level, with_reference=True)
        recorded = record_case(case, encoder_counts=ENCODER_COUNTS)
        for now, reference in zip(recorded.conditions, recorded.references, strict=True):
            evidence = tooth_error_evidence(now, reference)
            if evidence is None or evidence.is_unlike_any:
                unlike += 1
                continue
            named_fault = max(evidence.log_likelihoods, key=evidence.log_likelihoods.__getitem__)
            rows.append((fault, named_fault, evidence.probabilities[named_fault]))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    _print_accuracy(f"independent rig, {unlike} unlike any or not seen", columns[0], columns[1], columns[2])


def main() -> None:
    """Draw, print, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--each", type=int, default=600, help="faults of each kind and simulator")
    parser.add_argument("--blind", type=int, default=0, help="faults of each kind on the independent rig")
    parser.add_argument("--to", type=Path, default=TOOTH_ERRORS_FILE)
    arguments = parser.parse_args()
    by_simulator = {name: known_tooth_errors_of(name, arguments.each) for name in SIMULATORS}
    for name, held_out in by_simulator.items():
        (fitted_to,) = (known for title, known in by_simulator.items() if title != name)
        _print_accuracy(f"{name} left out", held_out.faults, *named(fitted_to, held_out.descriptors))
    rows = np.concatenate([known.descriptors for known in by_simulator.values()]).astype(np.float16)
    faults = np.concatenate([known.faults for known in by_simulator.values()])
    write_whole(
        arguments.to, lambda file: np.savez_compressed(file, allow_pickle=False, descriptors=rows, faults=faults)
    )
    if arguments.blind:
        blind(arguments.blind)


if __name__ == "__main__":
    main()
