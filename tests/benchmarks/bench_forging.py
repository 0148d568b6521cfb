"""One minute of the forging manipulator at work: seconds, steps, contacts."""

from time import perf_counter

from sims.forging import ForgingManipulator, respond
from sims.simulator import SimulationSetup


def main() -> None:
    for name in ("manipulator_formula", "manipulator_table"):
        for mode in ("start-stop", "continuous"):
            ready = ForgingManipulator().prepare(SimulationSetup(name, {"mode": mode}))
            respond(ready.drive, ready.profiles(3.0), duration_s=3.0)  # compiles
            times = []
            for _ in range(3):
                start = perf_counter()
                run = respond(ready.drive, ready.profiles(60.0), duration_s=60.0)
                times.append(perf_counter() - start)
            print(f"{name:20} {mode:10} 60 s in {min(times):.2f} s, {run.n_steps} steps, {len(run.contacts)} contacts")


if __name__ == "__main__":
    main()
