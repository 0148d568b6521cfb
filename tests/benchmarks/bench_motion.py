"""How good forces, backlash, impacts and parameters from motion are, on simulated start–stop recordings.

Prints: error of each force model over noise with the crossing; error of the backlash over encoder counts; impacts found
or missed, and false ones, over sampling rate; how often the 95 % intervals of fitted parameters hold the truth.
"""

import numpy as np

from gearsig.motion import (
    HUNT_CROSSLEY,
    PIECEWISE,
    estimate_backlash,
    find_impacts,
    identify,
    measure_motion,
    noise_study,
)
from gearsig.recording import Recording
from sims import simulate

PRESETS = ("manipulator_formula", "manipulator_table")
TRUE = {
    "half_backlash_um": 150.0,
    "restitution": 0.95,
    "driver_inertia_kg_m2": 0.01,
    "friction_coefficient": 0.05,
    "driven_inertia_kg_m2": 42.0 + 0.5 * 290.0 * 0.15**2,
    "load_friction_nm": 300.0,
    "load_viscous_nm_s_per_rad": 20.0,
}


def recorded(preset: str, rate_hz: float = 1000.0, seed: int = 0, **parameters: float | str) -> Recording:
    return simulate(
        "forging", preset=preset, parameters=parameters, duration_s=12.0, sampling_rate_hz=rate_hz, seed=seed
    )


def forces() -> None:
    print("force against torque / base radius: rms error in N over noise added to the compression")
    for preset in PRESETS:
        for mode in ("start-stop", "continuous"):
            study = noise_study(recorded(preset, mode=mode), rng=np.random.default_rng(1))
            crossing = "none" if study.crossover_um is None else f"{study.crossover_um:.1f} µm"
            print(f"  {preset:20} {mode:10} crossing {crossing}")
            for model in (PIECEWISE, HUNT_CROSSLEY):
                row = " ".join(
                    f"{level:g}: {rms:.0f}" for level, rms in zip(study.levels_um, study.rms_n[model], strict=True)
                )
                print(f"    {model:16} {row}")


def backlash() -> None:
    print("backlash: error in % of 300 µm over encoder counts, 5 seeds")
    for preset in PRESETS:
        for counts in (2**20, 2**16, 2**13, 2**12, 2**11, 2**10):
            found = [
                estimate_backlash(measure_motion(recorded(preset, seed=s, encoder_counts=counts))).backlash_um
                for s in range(5)
            ]
            errors = 100.0 * (np.array(found) / 300.0 - 1.0)
            print(f"  {preset:20} {counts:>8} {errors.mean():+6.2f} (worst {np.abs(errors).max():.2f})")


def impacts() -> None:
    print("impacts above 0.02 m/s: found of all, false; median errors of time, energy, restitution")
    for preset in PRESETS:
        for rate_hz in (1000.0, 4000.0, 10_000.0):
            recording = recorded(preset, rate_hz)
            motion = measure_motion(recording)
            play = estimate_backlash(motion)
            found = find_impacts(motion, play.datum_m, half_backlash_m=0.5e-6 * play.backlash_um)
            assert recording.truth is not None
            rows = [[np.nan if v is None else v for v in row] for row in recording.truth["contacts"]["rows"]]
            true = np.array(rows)
            hard = true[true[:, 2] > 0.02]
            pairs = [(r, i) for r in hard for i in found if abs(i.time_s - r[0]) < 5e-4 and i.flank == r[1]]
            false = sum(np.min(np.abs(true[:, 0] - i.time_s)) > 1e-3 for i in found)
            time = np.median([abs(i.time_s - r[0]) for r, i in pairs])
            energy = np.median([abs(i.speed_mps**2 / r[2] ** 2 - 1.0) for r, i in pairs])
            bounce = np.median([abs(i.restitution - r[6] / r[2]) for r, i in pairs if i.restitution == i.restitution])
            print(
                f"  {preset:20} {rate_hz:>7g} Hz {len(pairs)}/{len(hard)}, {false} false; {1e6 * time:.0f} µs, "
                f"{100 * energy:.1f} %, {bounce:.3f}"
            )


def intervals() -> None:
    print("95 % intervals of fitted parameters: part that holds the truth, mean error in %, 10 seeds")
    for preset, stiffness in zip(PRESETS, (1.8366e10, 1.72e9), strict=True):
        wanted = TRUE | {"stiffness_n_per_m_lambda": stiffness}
        fitted = [identify(measure_motion(recorded(preset, seed=s))) for s in range(10)]
        for name, true in wanted.items():
            found = [f.parameter(name) for f in fitted]
            inside = np.mean([p.interval[0] <= true <= p.interval[1] for p in found])
            error = 100.0 * (np.mean([p.value for p in found]) / true - 1.0)
            print(f"  {preset:20} {name:26} {inside:.1f} {error:+.2f}")


if __name__ == "__main__":
    forces()
    backlash()
    impacts()
    intervals()
