"""What every simulator offers: parameters with units and ranges, presets, effects, and recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gearsig.recording.types import Recording
from sims.effects.effect import EffectSetting
from sims.machine.operation import Operation

ParameterValue = float | str


@dataclass(frozen=True)
class Parameter:
    """A number (or word) that a model is made of.

    Parameters
    ----------
    name : str
        Ends in its unit where it has one.
    unit, meaning : str
    low, high : float or None
        Range of a number.
    default : float, str or None
        Where neither preset nor user gives it. None: derived from the others, as `meaning` says.
    choices : tuple of str
        Allowed words; empty for a number.
    whole : bool
    """

    name: str
    unit: str
    meaning: str
    low: float | None = None
    high: float | None = None
    default: ParameterValue | None = None
    choices: tuple[str, ...] = ()
    whole: bool = False


class Simulator(Protocol):
    """A model that makes recordings."""

    @property
    def name(self) -> str:
        """Short name, as on the command line."""
        ...

    @property
    def title(self) -> str:
        """One line for people."""
        ...

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters."""
        ...

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the published or demonstration machines."""
        ...

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that have a meaning here."""
        ...

    @property
    def meaningless(self) -> tuple[str, ...]:
        """What of these effects has none, and why, one sentence each."""
        ...

    def simulate(
        self,
        parameters: Mapping[str, ParameterValue],
        effects: Sequence[EffectSetting],
        operation: Operation | None,
        rng: np.random.Generator,
        *,
        preset: str = "",
        sampling_rate_hz: float = 20480.0,
        duration_s: float = 5.0,
    ) -> Recording:
        """Make a recording with rig and truth.

        Parameters
        ----------
        parameters : mapping
            Name → value; what is not given is the preset's.
        effects : sequence of EffectSetting
        operation : Operation or None
            None: the preset's own speed and torque.
        rng : numpy.random.Generator
        preset : str
            Empty: the simulator's first.
        sampling_rate_hz, duration_s : float
        """
        ...
