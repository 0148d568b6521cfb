"""The cracked spur pair as a simulator: preset and values → machine → effects → recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import within
from gearsig.recording.types import Recording
from sims.cracked.installed_table import installed_of
from sims.cracked.parameters import PARAMETERS
from sims.effects import EffectSetting, completed, effects, with_effects
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.model import Model
from sims.pair_limits import DURATION_RANGE_S, check_load, check_run
from sims.presets import Preset, preset
from sims.simulator import Parameter, ParameterValue
from sims.truth import truth_of
from sims.values import Values, complete_values

if TYPE_CHECKING:
    from sims.cracked.convergence import Convergence

NAME = "cracked"


@dataclass(frozen=True)
class Prepared:
    """A machine with its effects switched on, ready to run.

    Parameters
    ----------
    machine : Machine
    operation : Operation
    preset : str
    values : mapping
        Every parameter; None where it follows from the others.
    effects : tuple of EffectSetting
        With every option.
    """

    machine: Machine
    operation: Operation
    preset: str
    values: Values
    effects: tuple[EffectSetting, ...]

    def truth(self) -> dict[str, Any]:
        """What was put in, as plain values."""
        return truth_of(NAME, self.preset, self.values, self.effects, self.operation)


@dataclass(frozen=True)
class CrackedPair(Model):
    """Spur gear pair on four bearings between two rotors, 16 degrees of freedom; see `sims.cracked`."""

    name: str = NAME
    title: str = "spur gear pair with root crack: 16 degrees of freedom, friction, backlash, roughness"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default_factory=lambda: tuple(effects()), repr=False)

    def prepare(
        self,
        parameters: Mapping[str, ParameterValue],
        settings: Sequence[EffectSetting],
        operation: Operation | None,
        rng: np.random.Generator,
        *,
        preset_name: str = "",
        sampling_rate_hz: float = 20480.0,
    ) -> Prepared:
        """Build the machine and switch its effects on; one number is drawn from `rng`, with and without effects."""
        chosen = preset(NAME, preset_name)
        return prepare_preset(chosen, parameters, settings, operation, rng, sampling_rate_hz=sampling_rate_hz)

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
        """Make a recording with rig and truth; see `sims.simulator.Simulator.simulate`.

        Raises
        ------
        InputError
            If a name does not exist, a value is out of its range, or the values do not fit each other.
        """
        from sims.cracked.build import build_rig
        from sims.cracked.simulate import simulate_machine

        within(duration_s, "duration_s", *DURATION_RANGE_S, "s")
        ready = self.prepare(parameters, effects, operation, rng, preset_name=preset, sampling_rate_hz=sampling_rate_hz)
        rig = build_rig(
            ready.machine,
            ready.operation,
            name=self.rig_name(ready.preset),
            sources=self.rig_sources(ready.preset),
        )
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
    from sims.cracked.build import build_machine

    values = complete_values(PARAMETERS, chosen.parameters, parameters)
    run = operation or chosen.operation
    check_run(run, sampling_rate_hz)
    wanted = (*chosen.effects, *settings)
    complete = completed(wanted)
    installed = installed_of(chosen.installed) if chosen.installed else None
    sound = build_machine(values, sampling_rate_hz=sampling_rate_hz, installed=installed)
    check_load(sound, run)
    return Prepared(with_effects(sound, complete, rng), run, chosen.name, values, complete)
