"""Make the population of the gap diagnosis, and the part of it that comes with the library.

`python -m app.studies.gap.population make` runs all steps, in some hours: `… simulate --to RAW` draws and records
machines; `… pack RAW…` packs one or several such tables into the population, at the path given by
`gearsig.gap.population_file`; `… learn` writes what a diagnosis needs from it into the library's own file.

Each random gearbox is recorded healthy as the reference, healthy again on other days, with each effect, with foreign
vibration, and with synthetic signatures of the effects; the differences go into the table, with their labels. The
gearboxes come from both models of a pair, the quasi-static simulator, the lumped rig, and the independent rig with
development gears.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray

from app.studies import answers_of, run_study
from app.studies.gap.gearboxes import CRACKED, REDUCED, PopulationSample, one_case, one_rig, write
from app.studies.gap.lumped import LUMPED, lumped_samples
from app.studies.gap.quasi_static import QUASI_STATIC, static_samples
from gearsig.cache import write_whole
from gearsig.gap import BY_HAND, INDEPENDENT, LEARNED_FILE, load_population, population_file, write_learned
from gearsig.gap import learn as learned_of

_SAMPLES_OF: dict[str, Callable[[int], list[PopulationSample]]] = {
    CRACKED.name: partial(one_rig, CRACKED),
    REDUCED.name: partial(one_rig, REDUCED),
    INDEPENDENT: one_case,
    QUASI_STATIC: static_samples,
    LUMPED: lumped_samples,
}
"""Functions that make the samples of a machine from its number, by simulator."""


def make(processes: int = 2) -> None:
    """Simulate, pack and learn."""
    with TemporaryDirectory() as folder:
        raw = Path(folder) / "raw.npz"
        simulate(raw, processes=processes)
        pack([raw])
    learn()


def simulate(
    to: Annotated[Path, typer.Option()],
    cracked: int = 36,
    reduced_fe: int = 21,
    independent: int = 195,
    quasi_static: int = 122,
    lumped: int = 46,
    processes: int = 2,
) -> None:
    """Record the given number of machines of each simulator and reduce them to a raw table, written at intervals."""
    numbers = (cracked, reduced_fe, independent, quasi_static, lumped)
    jobs, samples = jobs_of(dict(zip(_SAMPLES_OF, numbers, strict=True))), list[PopulationSample]()
    for n_done, (_, of_machine) in enumerate(answers_of(samples_of_job, jobs, processes), start=1):
        samples += of_machine
        if samples and (n_done % 10 == 0 or n_done == len(jobs)):
            write(to, samples)


def learn(to: Path = LEARNED_FILE) -> None:
    """Write what a diagnosis needs from the population."""
    write_learned(learned_of(load_population()), to)
    typer.echo(f"{to.stat().st_size / 1e6:.2f} MB")


def jobs_of(machines: Mapping[str, int]) -> list[tuple[str, int]]:
    """Return simulator and number of each machine, evenly mixed, so that any part is a smaller population."""
    paced = [((i + 0.5) / n, name, i) for name, n in machines.items() for i in range(n)]
    return [(name, i) for _, name, i in sorted(paced)]


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


def pack(raw_tables: list[Path], to: Path = population_file()) -> None:  # noqa: B008 - an option's default
    """Read raw tables and write one packed table."""
    raw = [np.load(path, allow_pickle=False) for path in raw_tables]
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
    """Return the table rounded to 1/16 dB, which compresses well and is finer than the accuracy of any feature."""
    return (np.round(16.0 * table) / 16.0).astype(np.float16)


if __name__ == "__main__":
    run_study(make, simulate, pack, learn)
