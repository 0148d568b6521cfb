"""Diagnosers by name: the gap diagnosis, the baselines, or any function ``module:name`` of the same form."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

from app.benchmark.seen import Seen
from gearsig.errors import InputError
from gearsig.gap.types import GapReport

Diagnoser = Callable[[Seen], GapReport]

GAP, FOREST, MAJORITY, RULES = "gap", "forest", "majority", "rules"
GAP_UNSEEN, FOREST_UNSEEN = "gap-unseen", "forest-unseen"
"""The same without what was learned from the independent rig's development gears."""
START_STOP = "start-stop"
"""Of machines that start and stop, by the model forging."""
BASELINES = (MAJORITY, RULES)
MAIN = "__main__"
"""A module that is another one in every process: the diagnosing process finds nothing of the caller's there."""
_HOMES = {
    GAP: "app.benchmark.diagnosers:diagnose",
    FOREST: "app.benchmark.forest:diagnose",
    MAJORITY: "app.benchmark.majority:diagnose",
    RULES: "app.benchmark.rules:diagnose",
    GAP_UNSEEN: "app.benchmark.unseen:diagnose",
    FOREST_UNSEEN: "app.benchmark.unseen:recognise",
    START_STOP: "app.benchmark.diagnosers:diagnose_drive",
}


def diagnoser(name: str) -> Diagnoser:
    """Return the diagnoser of a name or of ``module:function``.

    Raises
    ------
    InputError
        If there is none.
    """
    module, sign, function = _HOMES.get(name, name).partition(":")
    is_shared = sign and module != MAIN
    try:
        found = getattr(import_module(module), function) if is_shared else None
    except (ImportError, AttributeError):
        found = None
    if not callable(found):
        raise InputError(f"there is no diagnoser {name!r}", allowed=f"{', '.join(_HOMES)} or MODULE:FUNCTION")
    return found  # type: ignore[no-any-return]  # what a user's function returns shows when it is called


def folders_of(name: str) -> tuple[Path, ...]:
    """Return the folders that a diagnoser's module is imported from; none where there is no file of it."""
    top = _HOMES.get(name, name).partition(":")[0].partition(".")[0]
    spec = None if top == MAIN else find_spec(top)
    if spec is None:
        return ()
    origin = [spec.origin] if spec.has_location and spec.origin else []
    return tuple(Path(place).absolute().parent for place in spec.submodule_search_locations or origin)


def diagnose(seen: Seen) -> GapReport:
    """Diagnose a case with the product itself; what is kept for its rig lies with the case and goes with it."""
    from app.gap.diagnose import diagnose_gap
    from sims.registry import gap_simulator

    return diagnose_gap(
        seen.recordings,
        gap_simulator("cracked"),
        rigs=seen.rigs,
        references=seen.references,
        reference_rigs=seen.reference_rigs,
        names=seen.names,
        cache=Path.cwd() / "kept",
    )


def diagnose_drive(seen: Seen) -> GapReport:
    """Diagnose a case of starts and stops with the product itself."""
    from app.gap.start_stop.diagnose import diagnose_start_stop

    return diagnose_start_stop(
        seen.recordings,
        rigs=seen.rigs,
        references=seen.references,
        reference_rigs=seen.reference_rigs,
        names=seen.names,
    )
