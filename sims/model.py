"""What a simulator states of itself: name, parameters, machines, effects, and where its recordings come from."""

from __future__ import annotations

from dataclasses import dataclass, field

from sims.presets import presets
from sims.simulator import Parameter


@dataclass(frozen=True)
class Model:
    """Base of the simulators, which give these fields values of their own.

    Parameters
    ----------
    name : str
        Short, as on the command line.
    title : str
        One line for people.
    parameters : tuple of Parameter
        All of them.
    effects : tuple of str
        Names of the effects that have a meaning.
    meaningless : tuple of str
        What of them has none, and why, one sentence each.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...] = field(repr=False)
    effects: tuple[str, ...] = field(repr=False)
    meaningless: tuple[str, ...] = field(default=(), repr=False)

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the machines."""
        return tuple(presets(self.name))

    def rig_name(self, preset_name: str) -> str:
        """Return the name of a simulated recording's rig."""
        return f"simulated: {preset_name}"

    def rig_sources(self, preset_name: str) -> list[str]:
        """Return what such a rig says of where it comes from."""
        return [f"simulated with the model {self.name!r}, preset {preset_name!r}; the truth stands in the recording"]
