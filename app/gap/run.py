"""From files to a gap report: the same for the command line and the dashboard."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from app.gap.inputs import Asked, read_inputs

if TYPE_CHECKING:
    from gearsig.gap.types import GapReport

READING = 0.03
"""Share of the progress that is reading."""
Stage = Callable[[str, float], None]


def run_gap(
    asked: Asked, model: str, *, cache: Path | None, fresh: bool = False, on_stage: Stage = lambda *_: None
) -> GapReport:
    """Read the files and diagnose the gap.

    Parameters
    ----------
    asked : Asked
    model : str
        Name of the simulator.
    cache : Path or None
        Folder that keeps what is prepared once per rig; None: nothing is kept, nor taken from before.
    fresh : bool
        Prepare anew what the folder holds already, and keep that.
    on_stage : callable
        Is told what is being done, and which share of the whole is complete.

    Raises
    ------
    InputError, RefusalError
    """
    from app.gap.diagnose import diagnose_gap
    from sims.registry import gap_simulator

    simulator = gap_simulator(model)
    inputs = read_inputs(asked, lambda name: on_stage(f"reading {name}", 0.0))
    return diagnose_gap(
        inputs.recordings,
        simulator,
        rigs=inputs.rigs,
        references=inputs.references,
        reference_rigs=inputs.reference_rigs,
        names=inputs.names,
        reference_names=inputs.reference_names,
        cache=cache,
        fresh=fresh,
        on_stage=lambda stage, done: on_stage(stage, READING + (1 - READING) * done),
    )
