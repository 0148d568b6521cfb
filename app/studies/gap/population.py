"""Make the population of the gap diagnosis, and what of it comes with the library.

`python -m app.studies.gap.population make` does all of it, in some hours. Its steps: `… simulate --to RAW` draws
machines and records them; `… pack RAW…` packs one or several such tables into the population, which is kept where
`gearsig.gap.population_file` says; `… learn` writes what a diagnosis asks of it into the library's own file.

Each drawn gearbox is recorded healthy as the reference, healthy again on other days, with each effect, with foreign
vibration, and with each effect's signature by hand; what differs goes into the table, with its label. Gearboxes are
those of both models of a pair, of the quasi-static simulator, of the lumped rig, and the independent rig's with
development gears.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import typer
from numpy.typing import NDArray

from app.studies import answers_of
from app.studies.gap.gearboxes import CRACKED, REDUCED, PopulationSample, one_case, one_rig, write
from app.studies.gap.lumped import LUMPED, lumped_samples
from app.studies.gap.quasi_static import QUASI_STATIC, static_samples
from gearsig.cache import write_whole
from gearsig.gap import BY_HAND, INDEPENDENT, LEARNED_FILE, learn, load_population, population_file, write_learned

MACHINES = {CRACKED.name: 36, REDUCED.name: 21, INDEPENDENT: 195, QUASI_STATIC: 122, LUMPED: 46}
"""Of each simulator, unless asked for otherwise."""

_SAMPLES_OF: dict[str, Callable[[int], list[PopulationSample]]] = {
    CRACKED.name: partial(one_rig, CRACKED),
    REDUCED.name: partial(one_rig, REDUCED),
    INDEPENDENT: one_case,
    QUASI_STATIC: static_samples,
    LUMPED: lumped_samples,
}
"""What a machine's number makes, by simulator."""


def main() -> None:
    """Simulate machines, or pack what was simulated."""
    parser = argparse.ArgumentParser(description=__doc__)
    steps = parser.add_subparsers(dest="step", required=True)
    simulation = steps.add_parser("simulate", help="record machines and reduce them to a raw table")
    for name, n in MACHINES.items():
        simulation.add_argument(f"--{name}", type=int, default=n, help=f"machines of this simulator (default: {n})")
    simulation.add_argument("--processes", type=int, default=2)
    simulation.add_argument("--to", type=Path, required=True)
    whole = steps.add_parser("make", help="simulate, pack and learn")
    whole.add_argument("--processes", type=int, default=2)
    packing = steps.add_parser("pack", help="pack raw tables for the library")
    packing.add_argument("raw", type=Path, nargs="+")
    packing.add_argument("--to", type=Path, default=population_file())
    learning = steps.add_parser("learn", help="write what a diagnosis asks of the population")
    learning.add_argument("--to", type=Path, default=LEARNED_FILE)
    arguments = vars(parser.parse_args())
    if arguments["step"] == "pack":
        pack(arguments["raw"], arguments["to"])
    elif arguments["step"] == "learn":
        write_learned(learn(load_population()), arguments["to"])
        typer.echo(f"{arguments['to'].stat().st_size / 1e6:.2f} MB")
    elif arguments["step"] == "simulate":
        simulate(
            jobs_of({name: arguments[name.replace("-", "_")] for name in MACHINES}),
            arguments["processes"],
            arguments["to"],
        )
    else:
        with TemporaryDirectory() as folder:
            raw = Path(folder) / "raw.npz"
            simulate(jobs_of(MACHINES), arguments["processes"], raw)
            pack([raw], population_file())
        write_learned(learn(load_population()), LEARNED_FILE)


def jobs_of(machines: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return simulator and number of each machine, all simulators at an even pace: a part is a smaller population."""
    paced = [((i + 0.5) / n, name, i) for name, n in machines.items() for i in range(n)]
    return [(name, i) for _, name, i in sorted(paced)]


def simulate(jobs: Sequence[tuple[str, int]], n_processes: int, to: Path) -> None:
    """Record machines, given by simulator and number, and write the table of their samples now and then."""
    from app.studies.gap.population import samples_of_job

    samples: list[PopulationSample] = []
    for n_done, (_, of_machine) in enumerate(answers_of(samples_of_job, jobs, n_processes), start=1):
        samples += of_machine
        if samples and (n_done % 10 == 0 or n_done == len(jobs)):
            write(to, samples)


def samples_of_job(job: tuple[str, int]) -> list[PopulationSample]:
    """Return the samples of a simulator's machine."""
    name, index = job
    return _SAMPLES_OF[name](index)


TABLES = {
    "changes": "change",
    "change_scatter": "change_scatter",
    "features": "features",
    "feature_scatter": "feature_scatter",
}
"""Name in the library → name in the raw tables."""


def pack(paths: Sequence[Path], to: Path) -> None:
    """Read raw tables, write one packed table."""
    raw = [np.load(path, allow_pickle=False) for path in paths]
    tables = {name: _rounded(np.concatenate([sample[key] for sample in raw])) for name, key in TABLES.items()}
    rigs = np.concatenate([sample["rig"] for sample in raw]).astype(np.int64)
    simulated_rigs, first = np.unique(rigs, return_index=True)  # one twin for all recordings of a machine
    for name in ("simulated", "simulated_scatter"):
        tables[name] = _rounded(np.concatenate([sample[name] for sample in raw])[first])
    arrays: dict[str, Any] = {
        "rigs": rigs,
        "simulated_rigs": simulated_rigs,
        "simulators": np.concatenate([sample["simulator"] for sample in raw]),
        "causes": np.concatenate([sample["label"] for sample in raw]),
        "by_hand": np.concatenate([sample["detail"] for sample in raw]) == BY_HAND,
        "loads_n_per_mm": np.concatenate([sample["load_n_per_mm"] for sample in raw]).astype(np.float32),
        "change_names": raw[0]["change_names"],
        "feature_names": raw[0]["feature_names"],
    }
    write_whole(to, lambda file: np.savez_compressed(file, allow_pickle=False, **arrays, **tables))
    typer.echo(f"{len(tables['changes'])} recordings; {to.stat().st_size / 1e6:.1f} MB")


def _rounded(table: NDArray[np.float32]) -> NDArray[np.float16]:
    """Return a table that packs well: to 1/16 dB, which no feature is known to."""
    return (np.round(16.0 * table) / 16.0).astype(np.float16)


if __name__ == "__main__":
    main()
