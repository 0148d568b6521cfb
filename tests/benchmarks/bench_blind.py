"""Blind rig: CPU time of 6 s at 20 kHz, and of whole cases written to disk."""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from sims.blind import RunCondition, draw_case, draw_rig, measure, record_case, run, scene_of, write_visible

N_ROUNDS = 6


def one_run(seed: int) -> tuple[float, float]:
    """CPU seconds of the march and of the measuring."""
    rig = replace(draw_rig(np.random.default_rng(seed), "development"), sampling_rate_hz=20000.0)
    nm = 0.6 * rig.rated_nm
    scene = scene_of(rig, RunCondition(1500.0, nm, 1500.0, nm, 6.0, seed, seed))
    began = time.process_time()
    motion = run(scene)
    marched = time.process_time()
    measure(scene, motion)
    return marched - began, time.process_time() - marched


def one_case(seed: int) -> tuple[float, float]:
    """CPU seconds of a written case, and seconds of recording in it, twins included."""
    case = draw_case(
        np.random.default_rng(seed), "development", effect="root_crack", n_conditions=2, with_reference=True
    )
    with tempfile.TemporaryDirectory() as folder:
        began = time.process_time()
        write_visible(record_case(case), Path(folder))
        spent = time.process_time() - began
    return spent, 2 * sum(c.duration_s for c in case.conditions) + sum(c.duration_s for c in case.references)


def main() -> None:
    """Print the table."""
    one_run(0)
    runs = np.array([one_run(seed) for seed in range(1, N_ROUNDS + 1)])
    print(f"6 s at 20 kHz: march {np.median(runs[:, 0]):.2f} s, measuring {np.median(runs[:, 1]):.2f} s of CPU")
    cases = np.array([one_case(seed) for seed in range(N_ROUNDS)])
    print(f"case of two conditions with references and twins: {np.median(cases[:, 0]):.1f} s of CPU", end=" ")
    print(f"for {np.median(cases[:, 1]):.0f} s of recording")


if __name__ == "__main__":
    main()
