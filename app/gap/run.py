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
    from app.gap.models import checked_model
    from app.gap.start_stop.recognise import MODEL, refuse_start_stop
    from sims.registry import gap_simulator

    checked_model(model)

    def tell(stage: str, done: float) -> None:
        on_stage(stage, READING + (1 - READING) * done)

    if model == MODEL:
        return _start_stop(asked, tell)
    simulator = gap_simulator(model)
    inputs = read_inputs(asked, lambda name: on_stage(f"reading {name}", 0.0))
    refuse_start_stop(inputs.recordings, inputs.rigs, inputs.names, model)
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
        on_stage=tell,
    )


def _start_stop(asked: Asked, tell: Stage) -> GapReport:
    """Diagnose a machine that starts and stops; nothing is kept, as nothing takes long."""
    from app.gap.start_stop.diagnose import diagnose_start_stop

    inputs = read_inputs(asked, lambda name: tell(f"reading {name}", 0.0))
    return diagnose_start_stop(
        inputs.recordings,
        rigs=inputs.rigs,
        references=inputs.references,
        reference_rigs=inputs.reference_rigs,
        names=inputs.names,
        reference_names=inputs.reference_names,
        on_stage=tell,
    )
