"""How long the sweep of six million steps takes, and how far a smaller step changes its rms values.

`python tests/benchmarks/bench_reduced_fe.py` prints processor seconds of one core and the machine's load beside them.
"""

import os
import time

import numpy as np

from sims.reduced_fe import FlexiblePair, ReducedPair, speed_sweep
from sims.simulator import SimulationSetup

SWEEP_S = 15.0


def pair_of(name: str, **parameters: float) -> FlexiblePair:
    return ReducedPair().prepare(SimulationSetup(name, parameters), np.random.default_rng(0)).pair


def main() -> None:
    speed_sweep(pair_of("flexible_50_50"), 170.0, 900.0, 950.0, 0.05, n_parts=5)  # compiles
    kinds = {"mirrored slices (3 for 5)": {}, "all five slices": {"lead_error_um": 1e-9}}
    for words, extra in kinds.items():
        pair = pair_of("light_damping_50_50", **extra)
        steps, used = 0, time.process_time()
        sweeps = [speed_sweep(pair, 170.0, *ends, SWEEP_S) for ends in ((900.0, 4100.0), (4100.0, 900.0))]
        steps, used = sum(s.n_steps for s in sweeps), time.process_time() - used
        print(f"{words}: {steps:.1e} steps in {used:.1f} s of processor time, load {os.getloadavg()[0]:.1f}")
    fine = [
        speed_sweep(pair_of("light_damping_50_50"), 170.0, *e, SWEEP_S, step_s=2.5e-6)
        for e in ((900.0, 4100.0), (4100.0, 900.0))
    ]
    coarse = [
        speed_sweep(pair_of("light_damping_50_50"), 170.0, *e, SWEEP_S) for e in ((900.0, 4100.0), (4100.0, 900.0))
    ]
    for way, one, two in zip(("up", "down"), coarse, fine, strict=True):
        off = np.abs(one.rms_m / two.rms_m - 1.0)
        print(
            f"sweep {way}: rms at 5 µs against 2.5 µs: median {np.median(off):.2%}, 95 % {np.quantile(off, 0.95):.2%}, "
            f"parts off by more than 5 %: {np.count_nonzero(off > 0.05)} of {len(off)}"
        )


if __name__ == "__main__":
    main()
