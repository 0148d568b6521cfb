"""Cracked 16-DOF pair: time per step, and the same motion by SciPy's DOP853 at the same error, side by side.

Everything is on: friction, a crack, backlash, roughness (12 lines locked to time), run-out. DOP853 works on the same
compiled right-hand side, called through SciPy as usual. Its tolerance is the loosest of a ladder of decades whose error
is no greater than that of the fixed step. Errors are rms differences of the driver's displacement from a run at a
sixteenth of the step. Tabulating the machine is part of both times.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from interleaved import best_of
from scipy.integrate import solve_ivp

from sims import simulate
from sims.cracked import default_step_s, derivative, prepare, respond
from sims.machine import Machine, Operation, Roughness
from sims.mesh import RootCrack
from tests.sims.machines import spur_pair_machine

OPERATION = Operation.steady(500.0, 110.0)
DURATION_S = 0.5
N_POINTS = 5000
N_ROUNDS = 4


def machine() -> Machine:
    base = spur_pair_machine()
    return replace(
        base,
        mesh=replace(base.mesh, cracks_1=(RootCrack(2.0),)),
        roughness=Roughness(0.45, "time"),
        wheels=(replace(base.wheels[0], runout_um=5.0), base.wheels[1]),
    )


def fixed_step(m: Machine, step_s: float) -> np.ndarray:
    """Displacement of the driver at even times, the integrator's own points."""
    stride = round(DURATION_S / N_POINTS / step_s)
    run = respond(
        m, OPERATION, duration_s=DURATION_S, rng=np.random.default_rng(1), signals=("driver y",), step_s=step_s,
        stride=stride,
    )  # fmt: skip
    return run["driver y"][:N_POINTS]


def adaptive(m: Machine, tolerance: float) -> tuple[np.ndarray, int]:
    ready = prepare(m, OPERATION, np.random.default_rng(1))
    surface, roughness = ready.roughness.surface, ready.roughness
    rough = (surface.amplitudes_m, 2 * np.pi * roughness.frequencies_hz, roughness.phases_rad)
    rate, first = np.empty(32), float(ready.q[0])

    def slope(t: float, state: np.ndarray) -> np.ndarray:
        derivative(*ready.constants.arguments, t, state, ready.speed, ready.torque, first, rough, rate)
        return rate.copy()  # SciPy keeps a reference

    state = np.concatenate((ready.q, ready.v))
    times = np.arange(N_POINTS) * DURATION_S / N_POINTS
    # Displacements are of 1e-5 m where angles are of 1 rad: each coordinate has its own absolute tolerance.
    scale = np.r_[np.ones(4), np.full(12, 1e-5), np.full(4, 50.0), np.full(12, 1e-2)]
    done: Any = solve_ivp(
        slope, (0.0, times[-1]), state, "DOP853", t_eval=times, rtol=tolerance, atol=tolerance * scale
    )
    return done.y[5], int(done.nfev)


def main() -> None:
    m = machine()
    per_point = DURATION_S / N_POINTS
    step = per_point / np.ceil(per_point / default_step_s(m, OPERATION))
    exact = fixed_step(m, step / 16)
    fixed = fixed_step(m, step)
    error = float(np.std(fixed - exact) / np.std(exact))
    for exponent in range(3, 13):
        tolerance = 10.0**-exponent
        found, n_calls = adaptive(m, tolerance)
        its_error = float(np.std(found - exact) / np.std(exact))
        if its_error <= error:
            break
    (fast_s, _), (slow_s, _) = best_of(N_ROUNDS, lambda: fixed_step(m, step), lambda: adaptive(m, tolerance))
    print(f"{DURATION_S} s of motion, step {1e6 * step:.2f} us ({round(DURATION_S / step)} steps)")
    print(f"fixed-step RK4 : error {error:.1e}, {1e3 * fast_s:8.1f} ms")
    print(f"solve_ivp      : error {its_error:.1e}, {1e3 * slow_s:8.1f} ms (rtol {tolerance:.0e}, {n_calls} calls)")
    print(f"ratio          : {slow_s / fast_s:.1f}")
    (long_s, run), (whole_s, _) = best_of(
        N_ROUNDS,
        lambda: respond(m, OPERATION, duration_s=2.0, rng=np.random.default_rng(1), signals=("driver y",), stride=16),
        lambda: simulate("cracked", preset="published_55_75", effects={"root_crack": 2.0}, duration_s=5.0, seed=1),
    )
    print(f"one step       : {1e6 * long_s * run.step_s / 2.0:.2f} us, everything on, one core")
    print(f"recording      : {whole_s:.2f} s for 5 s at 20.48 kHz, two accelerometers and tachometer")


if __name__ == "__main__":
    main()
