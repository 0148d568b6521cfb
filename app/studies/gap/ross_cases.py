"""Cases from machines that ROSS makes, for studies only: nothing is learned from them.

`ROSS_PYTHON=… python -m app.studies.gap.ross_cases simulate --to RAW`, then `score RAW`; `compare` shows how far apart
ROSS's own runs and those of `ross_rotors` are. At two operating points each machine is recorded healthy, with every
effect, and with something outside the catalogue, and compared with a healthy reference of another day.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from math import pi, sqrt
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from scipy import signal

from app.studies import run_study
from app.studies.gap.calibrate import attributed_case
from app.studies.gap.calibrate import table as table_of
from app.studies.gap.gearboxes import (
    Made,
    PopulationSample,
    Recorded,
    put_in_by_hand,
    reduced_twin,
    samples_of,
    write,
)
from app.studies.gap.ross_rotors import (
    N_PATH,
    N_SEVERITIES,
    SEED,
    TOOTH_FAULTS,
    RossFault,
    RossMachine,
    apart_from_ross,
    record,
    severity,
    with_ross,
)
from gearsig.gap import NONE, UNKNOWN, Features, load_gap_calibration, load_learned
from sims.effects import ONE_TOOTH_SHARE
from sims.machine import log_uniform

# --------------------
# The effects: by ROSS where it has them, else from the literature; severities from hardly visible to strong.
# --------------------


def effects_of(machine: RossMachine, i: int, rng: np.random.Generator) -> dict[str, RossFault]:
    """Draw one fault of each effect; `i` numbers those that ROSS has made.

    ROSS makes the forces of a misaligned coupling (`MisalignmentFlex`) and, by its integrals over the sections of a
    tooth, the compliance of cracked, spalled and chipped teeth. The others are the textbook's: wear by Archard's law,
    zero at the pitch point; races as pulses of one ball's share of the load; all else as its name says.
    """
    teeth, sizes = machine.asked["teeth"], machine.asked["teeth_faults"]

    def log(low: float, high: float) -> float:
        return severity(rng, i, low, high)

    def phasor(size: float) -> complex:
        return complex(size * np.exp(2j * pi * rng.uniform()))

    side = int(rng.integers(2))
    z = teeth[side]
    faults: dict[str, RossFault] = {}
    for k, kind in enumerate(TOOTH_FAULTS):
        number = N_SEVERITIES * k + i
        hit = sizes[number][1]
        faults[kind] = RossFault(softer=[(hit, int(rng.integers(teeth[hit])), machine.ross["softer"][number])])
    path = np.linspace(0.0, 1.0, N_PATH)
    worn, uneven = log(10e-6, 150e-6) * np.abs(path - 0.5) / 0.5, rng.uniform(0.02, 0.2)
    faults["tooth_wear"] = RossFault(
        gaps=[(s, None, 0.5 * worn * (1.0 + uneven * rng.standard_normal((teeth[s], 1)))) for s in range(2)]
    )
    error = log(8e-6, 120e-6)
    if rng.uniform() < ONE_TOOTH_SHARE:
        gap = np.full(N_PATH, error * rng.choice([-1.0, 1.0]))
        faults["pitch_error"] = RossFault(gaps=[(side, int(rng.integers(z)), gap)])
    else:
        single = 0.5 * error * rng.standard_normal((z, 1))
        faults["pitch_error"] = RossFault(gaps=[(side, None, np.tile(single - single.mean(), N_PATH))])
    rough = [
        signal.lfilter([0.6], [1.0, -0.8], rng.standard_normal((t, 4 * N_PATH)), axis=1)[:, -N_PATH:] for t in teeth
    ]
    size = log(0.5e-6, 8e-6)
    faults["surface_roughness"] = RossFault(gaps=[(s, None, size * rough[s]) for s in range(2)], friction=1.2)
    faults["sliding_friction"] = RossFault(friction=log(1.5, 8.0))
    runout = phasor(log(30e-6, 400e-6))
    nominal = machine.points[0][0] * pi / 30.0 * (1.0, teeth[0] / teeth[1])[side]
    faults["eccentricity"] = RossFault(runout_m={side: runout}, unbalance_mps={side: runout * nominal})
    faults["unbalance"] = RossFault(unbalance_mps={side: phasor(log(0.05, 1.5))})
    faults["misalignment"] = RossFault(
        turning=(machine.asked["misalignments"][i][0], machine.ross["pushed"][i].T),
    )
    faults["torque_ripple"] = RossFault(ripple=(log(0.08, 0.6), float(rng.choice([2, 3, 4, 6]))))
    faults["speed_fluctuation"] = RossFault(wander=(log(0.006, 0.05), rng.uniform(0.5, 3.0)))
    for name, inner in (("bearing_outer_race", False), ("bearing_inner_race", True)):
        bearing = int(rng.integers(4))
        shown = machine.rig(0).bearings[bearing]
        order = shown.orders()["BPFI" if inner else "BPFO"] * (1.0, teeth[0] / teeth[1])[bearing // 2]
        _, ball_mm, pitch_mm = machine.drawn["balls"][bearing // 2]
        width_mm = log(0.6, 4.0)
        depth = 1e-3 * min(ball_mm / 2.0 - sqrt((ball_mm / 2.0) ** 2 - (width_mm / 2.0) ** 2), 0.1)
        radius_mm = 0.5 * (pitch_mm - ball_mm if inner else pitch_mm + ball_mm)
        turn = width_mm / (2 * pi * radius_mm) * machine.drawn["balls"][bearing // 2, 0]
        faults[name] = RossFault(race=(bearing, order * (1.0 - rng.uniform(0.0, 0.01)), depth, turn, inner))
    softened, n_modes = log(0.08, 0.4), len(machine.drawn["mode_hz"])
    moved = 1.0 - softened * rng.uniform(-0.5, 1.0, n_modes)
    faults["transfer_path"] = RossFault(moved=moved, damped=1.0 + 3.0 * softened)
    faults["mains_hum"] = RossFault(hum=log(0.08, 1.5))
    faults["clipping"] = RossFault(clipped=(int(rng.integers(3)), 1.0 - log(0.1, 0.7)))
    return faults


def outside(rng: np.random.Generator) -> dict[str, RossFault]:
    """Draw what is outside the catalogue, by ROSS's models: shafts that rub lightly and hard, and a cracked shaft."""
    return {
        "light rub": RossFault(rub=(int(rng.integers(2)), rng.uniform(0.97, 1.02), log_uniform(rng, 1e6, 5e6), 0.15)),
        "hard rub": RossFault(rub=(int(rng.integers(2)), rng.uniform(0.5, 0.9), log_uniform(rng, 5e6, 5e7), 0.25)),
        "cracked shaft": RossFault(shaft_crack=0),
    }


# --------------------
# The study.
# --------------------


ROSS = "ross"
FIRST_RIG = 500_000
"""Number of the first machine's first point; its second point has the next number."""
N_HEALTHY, N_FOREIGN = 3, 1
CLEAR = 2.0
"""Structural floors from which an effect is listed."""


def simulate(to: Annotated[Path, typer.Option()], machines: int = 8) -> None:
    """Record machines at two operating points, compare them with a reference of another day, and write the samples."""
    samples: list[PopulationSample] = []
    drawn = with_ross([RossMachine.draw(np.random.default_rng([SEED, i])) for i in range(machines)])
    for i, machine in enumerate(drawn):
        rng = np.random.default_rng([SEED, i, 1])
        faults = [(NONE, "", RossFault())] * N_HEALTHY
        for k in range(N_SEVERITIES):
            faults += [(name, "", fault) for name, fault in effects_of(machine, k, rng).items()]
        faults += [(UNKNOWN, name, fault) for name, fault in outside(rng).items()]
        for point in range(2):
            made = partial(_at, machine, point, faults, FIRST_RIG + 2 * i + point)
            samples += samples_of(ROSS, FIRST_RIG + 2 * i + point, made)
        write(to, samples)


def _at(machine: RossMachine, point: int, faults: list[tuple[str, str, RossFault]], number: int) -> Made:
    """Return the reference at a point, the twin there, and the recordings to compare."""
    rng, torque_nm = np.random.default_rng([SEED, number]), machine.torque_nm(point)
    levels = record(machine, point, RossFault(), rng, None).samples[:-1].std(axis=1).astype(np.float64)
    reference = record(machine, point, RossFault(), rng, levels)

    def compared() -> Iterator[Recorded]:
        for i, (cause, words, fault) in enumerate(faults):
            recording = record(machine, point, fault, rng, levels)
            yield cause, f"{i} {words}", 0.0, recording, torque_nm
            if cause == NONE:
                healthy = recording
        yield from put_in_by_hand([healthy], N_FOREIGN, 0, torque_nm, rng)

    return reference, reduced_twin(reference, number, torque_nm), compared()


def score(raw: Path) -> None:
    """Print how well the shipped forests diagnose the machines, as for the simulators left out of learning."""
    table = np.load(raw, allow_pickle=False)
    classifier, calibration = load_learned().classifiers[True], load_gap_calibration(with_reference=True)
    changes = [
        Features(classifier.floor.names, values.astype(np.float64), scatter.astype(np.float64))
        for values, scatter in zip(table["change"], table["change_scatter"], strict=True)
    ]
    loads, causes, details, rigs = table["load_n_per_mm"], table["label"].astype(str), table["detail"], table["rig"]
    single = [
        attributed_case(cause, [change], [float(load)], classifier, ROSS)
        for cause, change, load in zip(causes, changes, loads, strict=True)
    ]
    typer.echo("one condition:\n" + table_of(calibration, single)[0])
    shown = [
        (case.truths[0], case.size, list(case.by(calibration).items())[:3])
        for case in single
        if case.size >= CLEAR and case.truths[0] not in (NONE, UNKNOWN)
    ]
    first = [answer[0][0] == truth for truth, _, answer in shown]
    two = [truth in dict(answer[:2]) for truth, _, answer in shown]
    typer.echo(f"from {CLEAR:g} floors {len(shown)}: likeliest {np.mean(first):.2f}, two {np.mean(two):.2f}")
    for truth, size, answer in sorted(shown):
        typer.echo(f"  {truth}, {size:.1f} floors: {', '.join(f'{name} {p:.2f}' for name, p in answer)}")
    second = {(rig - 1, detail): row for row, (rig, detail) in enumerate(zip(rigs, details, strict=True))}
    pairs = [(row, second[rigs[row], details[row]]) for row in range(len(rigs)) if (rigs[row], details[row]) in second]
    several = [
        attributed_case(causes[a], [changes[a], changes[b]], [float(loads[a]), float(loads[b])], classifier, ROSS)
        for a, b in pairs
    ]
    typer.echo("two conditions:\n" + table_of(calibration, several)[0])


def compare(steps: int = 1600, step_s: float = 2.5e-6) -> None:
    """Print how far `march` and a run by ROSS itself are apart, on the same rotors without housing, noise or drive."""
    typer.echo(f"approach of the flanks, rms difference over rms: {apart_from_ross(steps, step_s):.4f}")


if __name__ == "__main__":
    run_study(simulate, score, compare)
