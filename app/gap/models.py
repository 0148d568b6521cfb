"""The simulators that a gap can be diagnosed with: of running that goes on, and of a drive that starts and stops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from app.gap.start_stop.recognise import MODEL
from gearsig.checks import closest_match_hint
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.gap.simulator import GapEffect


def gap_models() -> tuple[str, ...]:
    """Return their names."""
    from sims.registry import gap_simulators

    return (*gap_simulators(), MODEL)


def checked_model(name: str) -> str:
    """Return a name that is one of them.

    Raises
    ------
    InputError
        If there is none of that name, with the closest.
    """
    names = gap_models()
    if name not in names:
        raise InputError(
            f"there is no model {name!r} with a gap diagnosis",
            allowed=", ".join(names),
            remedy=closest_match_hint(name, names),
        )
    return name


def gap_effects_of(model: str) -> Mapping[str, GapEffect]:
    """Return the effects that are looked for with a model."""
    if checked_model(model) == MODEL:
        from app.gap.start_stop.causes import drive_effects

        return drive_effects()
    from sims.registry import gap_simulator

    return gap_simulator(model).gap_effects()
