"""Pack the simulated population for the library: `python -m app.studies.gap.pack RAW…`."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import typer
from numpy.typing import NDArray

from gearsig.gap import BY_HAND, POPULATION_FILE

TABLES = {
    "changes": "change",
    "change_scatter": "change_scatter",
    "features": "features",
    "feature_scatter": "feature_scatter",
}
"""Name in the library → name in the raw tables."""


def main() -> None:
    """Read raw tables, write one packed table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("raw", type=Path, nargs="+")
    parser.add_argument("--to", type=Path, default=POPULATION_FILE)
    given = parser.parse_args()
    raw = [np.load(path, allow_pickle=False) for path in given.raw]
    tables = {name: _rounded(np.concatenate([one[key] for one in raw])) for name, key in TABLES.items()}
    rigs = np.concatenate([one["rig"] for one in raw]).astype(np.int64)
    simulated_rigs, first = np.unique(rigs, return_index=True)  # one twin for all recordings of a machine
    for name in ("simulated", "simulated_scatter"):
        tables[name] = _rounded(np.concatenate([one[name] for one in raw])[first])
    np.savez_compressed(
        given.to,
        allow_pickle=False,
        rigs=rigs,
        simulated_rigs=simulated_rigs,
        simulators=np.concatenate([one["simulator"] for one in raw]),
        causes=np.concatenate([one["label"] for one in raw]),
        by_hand=np.concatenate([one["detail"] for one in raw]) == BY_HAND,
        loads_n_per_mm=np.concatenate([one["load_n_per_mm"] for one in raw]).astype(np.float32),
        change_names=raw[0]["change_names"],
        feature_names=raw[0]["feature_names"],
        **tables,
    )
    typer.echo(f"{len(tables['changes'])} recordings; {given.to.stat().st_size / 1e6:.1f} MB")


def _rounded(table: NDArray[np.float32]) -> NDArray[np.float16]:
    """Return a table that packs well: to 1/16 dB, which no feature is known to."""
    return (np.round(16.0 * table) / 16.0).astype(np.float16)


if __name__ == "__main__":
    main()
