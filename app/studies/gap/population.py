"""Make the population of the gap diagnosis: `python -m app.studies.gap.population --to FILE`.

Each drawn gearbox is recorded sound as the reference, sound again on other days, with each effect, with foreign
vibration, and with each effect's signature by hand; what differs goes into the table, with its label. Gearboxes are
those of both models of a pair, of the quasi-static simulator, and the independent rig's with development gears.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import typer

from app.studies.gap.quasi_static.record import QUASI_STATIC, one_static
from app.studies.gap.rows import CRACKED, REDUCED, PopulationSample, one_case, one_rig, write
from gearsig.gap import INDEPENDENT

MACHINES = {CRACKED.name: 80, REDUCED.name: 45, INDEPENDENT: 400, QUASI_STATIC: 150}
"""Of each simulator, unless asked for otherwise."""

_SAMPLES_OF: dict[str, Callable[[int], list[PopulationSample]]] = {
    CRACKED.name: partial(one_rig, CRACKED),
    REDUCED.name: partial(one_rig, REDUCED),
    INDEPENDENT: one_case,
    QUASI_STATIC: one_static,
}
"""What a machine's number makes, by simulator."""


def main() -> None:
    """Simulate, reduce, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, n in MACHINES.items():
        parser.add_argument(f"--{name}", type=int, default=n, help=f"machines of this simulator (default: {n})")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--to", type=Path, required=True)
    given = vars(parser.parse_args())
    jobs = [(name, i) for name in MACHINES for i in range(given[name.replace("-", "_")])]
    samples: list[PopulationSample] = []
    with ProcessPoolExecutor(given["processes"]) as pool:
        for done, found in enumerate(pool.map(_one, jobs), start=1):
            samples += found
            if samples and (done % 10 == 0 or done == len(jobs)):
                write(given["to"], samples)
            typer.echo(f"{done} of {len(jobs)} machines, {len(samples)} recordings")


def _one(job: tuple[str, int]) -> list[PopulationSample]:
    name, index = job
    return _SAMPLES_OF[name](index)


if __name__ == "__main__":
    main()
