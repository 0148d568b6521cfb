"""The cracked spur pair as a simulator: preset and values → machine → effects → recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from sims.effects import EffectSetting, effects, with_effects
from sims.gear_pair.parameters import PARAMETERS
from sims.gear_pair.simulator import Asked, PairModel, ReadyPair
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.pair_limits import check_load
from sims.presets import Preset
from sims.simulator import Parameter, ParameterValue

if TYPE_CHECKING:
    from sims.cracked.convergence import Convergence

NAME = "cracked"


@dataclass(frozen=True)
class Prepared(ReadyPair):
    """A machine with its effects switched on, ready to run.

    Parameters
    ----------
    asked : Asked
    made : Machine
        With its effects.
    """

    made: Machine

    @property
    def machine(self) -> Machine:
        """The machine, effects included."""
        return self.made


@dataclass(frozen=True)
class CrackedPair(PairModel[Prepared]):
    """Spur gear pair on four bearings between two rotors, 16 degrees of freedom; see `sims.cracked`."""

    name: str = NAME
    title: str = "spur gear pair with root crack: 16 degrees of freedom, friction, backlash, roughness"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default_factory=lambda: tuple(effects()), repr=False)

    def _built(self, asked: Asked, rng: np.random.Generator, sampling_rate_hz: float) -> Prepared:
        return _prepared(asked, rng, sampling_rate_hz)

    def _recorded(
        self, ready: Prepared, rig: Rig, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        from sims.cracked.simulate import simulate_machine

        return simulate_machine(
            ready.machine,
            ready.operation,
            rng=rng,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s,
            rig=rig,
            truth=ready.truth(),
        )

    def check_convergence(
        self,
        parameters: Mapping[str, ParameterValue],
        effects: Sequence[EffectSetting],
        operation: Operation | None,
        rng: np.random.Generator,
        *,
        preset: str = "",
    ) -> Convergence:
        """Tell how far a smaller step of the integrator changes the result of this very machine."""
        from sims.cracked.convergence import check_convergence

        ready = self.prepare(parameters, effects, operation, rng, preset_name=preset)
        return check_convergence(ready.machine, ready.operation, rng)


def prepare_preset(
    chosen: Preset,
    parameters: Mapping[str, ParameterValue],
    settings: Sequence[EffectSetting],
    operation: Operation | None,
    rng: np.random.Generator,
    *,
    sampling_rate_hz: float = 20480.0,
) -> Prepared:
    """Build a preset's machine and switch on its effects and `settings`; one number is drawn from `rng`."""
    return _prepared(
        Asked.of(chosen, PARAMETERS, parameters, settings, operation, sampling_rate_hz), rng, sampling_rate_hz
    )


def _prepared(asked: Asked, rng: np.random.Generator, sampling_rate_hz: float) -> Prepared:
    from sims.gear_pair.build import build_machine

    sound = build_machine(asked.values, sampling_rate_hz=sampling_rate_hz, installed=asked.installed)
    check_load(sound, asked.operation)
    return Prepared(asked, with_effects(sound, asked.effects, rng))
