"""Processor seconds of the forging drive, of the pair of finite-element gears and of the blind rig.

`python tests/benchmarks/bench_simulators.py`, or with the names of some: forging, reduced-fe, blind. Of the pair also
how far a smaller step changes the rms values of its sweep of six million steps.
"""

import os
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from interleaved import best_of

from sims.blind import RunCondition, draw_case, draw_rig, measure, record_case, run, scene_of, write_visible
from sims.forging import ForgingManipulator
from sims.forging import respond as respond_drive
from sims.reduced_fe import FlexiblePair, ReducedPair, SpeedSweep, speed_sweep
from sims.simulator import SimulationSetup

SWEEP_S = 15.0
N_ROUNDS = 6


def forging() -> None:
    """One minute of work: seconds, steps, contacts."""
    for name in ("manipulator_formula", "manipulator_table"):
        for mode in ("start-stop", "continuous"):
            ready = ForgingManipulator().prepare(SimulationSetup(name, {"mode": mode}))
            respond_drive(ready.drive, ready.profiles(3.0), duration_s=3.0)  # compiles
            ((took, found),) = best_of(
                3, lambda ready=ready: respond_drive(ready.drive, ready.profiles(60.0), duration_s=60.0)
            )
            print(f"{name:20} {mode:10} 60 s in {took:.2f} s, {found.n_steps} steps, {len(found.contacts)} contacts")


def _pair(name: str, **parameters: float) -> FlexiblePair:
    return ReducedPair().prepare(SimulationSetup(name, parameters), np.random.default_rng(0)).pair


def _sweeps(pair: FlexiblePair, **options: float) -> list[SpeedSweep]:
    return [speed_sweep(pair, 170.0, *ends, SWEEP_S, **options) for ends in ((900.0, 4100.0), (4100.0, 900.0))]


def reduced_fe() -> None:
    """The sweep there and back: seconds and the machine's load, then the rms at half the step."""
    speed_sweep(_pair("flexible_50_50"), 170.0, 900.0, 950.0, 0.05, n_parts=5)  # compiles
    pair, lead = _pair("light_damping_50_50"), _pair("light_damping_50_50", lead_error_um=1e-9)
    (quick_s, coarse), (whole_s, whole) = best_of(1, lambda: _sweeps(pair), lambda: _sweeps(lead))
    for words, took, sweeps in (("mirrored slices (3 for 5)", quick_s, coarse), ("all five slices", whole_s, whole)):
        steps = sum(s.n_steps for s in sweeps)
        print(f"{words}: {steps:.1e} steps in {took:.1f} s of processor time, load {os.getloadavg()[0]:.1f}")
    for way, one, two in zip(("up", "down"), coarse, _sweeps(pair, step_s=2.5e-6), strict=True):
        off = np.abs(one.rms_m / two.rms_m - 1.0)
        print(
            f"sweep {way}: rms at 5 µs against 2.5 µs: median {np.median(off):.2%}, 95 % {np.quantile(off, 0.95):.2%}, "
            f"parts off by more than 5 %: {np.count_nonzero(off > 0.05)} of {len(off)}"
        )


def blind() -> None:
    """6 s at 20 kHz, and whole cases written to disk, twins included."""
    times, cases = [], []
    for seed in range(N_ROUNDS + 1):
        rig = replace(draw_rig(np.random.default_rng(seed), "development"), sampling_rate_hz=20000.0)
        nm = 0.6 * rig.rated_nm
        scene = scene_of(rig, RunCondition(1500.0, nm, 1500.0, nm, 6.0, seed, seed))
        ((marched, motion),) = best_of(1, lambda scene=scene: run(scene))
        ((measured, _),) = best_of(1, lambda scene=scene, motion=motion: measure(scene, motion))
        times.append((marched, measured))
    march, measuring = np.median(times[1:], axis=0)  # the first compiles
    print(f"6 s at 20 kHz: march {march:.2f} s, measuring {measuring:.2f} s of CPU")
    for seed in range(N_ROUNDS):
        case = draw_case(
            np.random.default_rng(seed), "development", effect="root_crack", n_conditions=2, with_reference=True
        )
        with tempfile.TemporaryDirectory() as folder:
            ((spent, _),) = best_of(1, lambda case=case, to=folder: write_visible(record_case(case), Path(to)))
        cases.append((spent, sum(c.duration_s for c in (*case.conditions, *case.conditions, *case.references))))
    spent, recorded = np.median(cases, axis=0)
    print(f"case of two conditions with references and twins: {spent:.1f} s of CPU for {recorded:.0f} s of recording")


ALL = {"forging": forging, "reduced-fe": reduced_fe, "blind": blind}

if __name__ == "__main__":
    for chosen in sys.argv[1:] or ALL:
        ALL[chosen]()
