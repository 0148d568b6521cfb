"""The pair of reduced finite-element gears as a simulator: preset and values → machine → effects → recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import within
from gearsig.errors import InputError
from gearsig.recording.types import Recording
from sims.cracked.installed_table import installed_of
from sims.effects import EffectSetting, completed, effects, with_effects
from sims.machine.operation import Operation
from sims.model import Model
from sims.pair_limits import DURATION_RANGE_S, check_load, check_run
from sims.presets import Preset, preset
from sims.reduced_fe.parameters import PARAMETERS
from sims.simulator import Parameter, ParameterValue
from sims.truth import truth_of
from sims.values import Values, complete_values

if TYPE_CHECKING:
    from sims.reduced_fe.dynamics_constants import FlexiblePair
    from sims.reduced_fe.dynamics_convergence import FlexConvergence

NAME = "reduced-fe"


@dataclass(frozen=True)
class PreparedPair:
    """A flexible pair with its effects switched on, ready to run.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
    preset : str
    values : mapping
        Every parameter; None where it follows from the others.
    effects : tuple of EffectSetting
        With every option.
    """

    pair: FlexiblePair
    operation: Operation
    preset: str
    values: Values
    effects: tuple[EffectSetting, ...]

    @property
    def step_s(self) -> float:
        """Longest step of the integrator."""
        return 1e-6 * float(self.values["step_us"] or 0.0)

    def truth(self) -> dict[str, Any]:
        """What was put in, as plain values."""
        return truth_of(NAME, self.preset, self.values, self.effects, self.operation)


@dataclass(frozen=True)
class ReducedPair(Model):
    """Spur pair of reduced finite-element gears between two rotors; see `sims.reduced_fe`.

    Does not represent: gyroscopic and centrifugal terms, tilting of the gears, oil churning, heating, teeth bent by
    friction, a shaft that lifts in its bearings or vibrates within their clearance, a change of the gears' modes by a
    crack, contact off the line of action at corners.
    """

    name: str = NAME
    title: str = "spur pair of finite-element gears, reduced: elastic bodies, contact of slices, contact loss"
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
    ) -> PreparedPair:
        """Build the pair and switch its effects on; one number is drawn from `rng`, with and without effects."""
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
            If a name does not exist, a value is out of its range, the values do not fit each other, or an effect has no
            meaning here.
        """
        from sims.cracked.build import build_rig
        from sims.reduced_fe.simulate import simulate_pair

        within(duration_s, "duration_s", *DURATION_RANGE_S, "s")
        ready = self.prepare(parameters, effects, operation, rng, preset_name=preset, sampling_rate_hz=sampling_rate_hz)
        rig = build_rig(
            ready.pair.machine,
            ready.operation,
            name=self.rig_name(ready.preset),
            sources=self.rig_sources(ready.preset),
        )
        recording, _ = simulate_pair(
            ready.pair,
            ready.operation,
            rng=rng,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s,
            rig=rig,
            truth=ready.truth(),
            step_s=ready.step_s,
        )
        return recording

    def check_convergence(
        self,
        parameters: Mapping[str, ParameterValue],
        effects: Sequence[EffectSetting],
        operation: Operation | None,
        rng: np.random.Generator,
        *,
        preset: str = "",
    ) -> FlexConvergence:
        """Tell how far a smaller step of the integrator changes the result of this very pair."""
        from sims.reduced_fe.dynamics_convergence import check_convergence

        ready = self.prepare(parameters, effects, operation, rng, preset_name=preset)
        return check_convergence(ready.pair, ready.operation, ready.step_s)


def prepare_preset(
    chosen: Preset,
    parameters: Mapping[str, ParameterValue],
    settings: Sequence[EffectSetting],
    operation: Operation | None,
    rng: np.random.Generator,
    *,
    sampling_rate_hz: float = 20480.0,
) -> PreparedPair:
    """Build a preset's pair and switch on its effects and `settings`; one number is drawn from `rng`."""
    from sims.reduced_fe.build import flexible_pair, reduced_gears, sound_machine

    values = complete_values(PARAMETERS, chosen.parameters, parameters)
    run = operation or chosen.operation
    check_run(run, sampling_rate_hz)
    wanted = (*chosen.effects, *settings)
    complete = completed(wanted)
    gears = reduced_gears(values)
    installed = installed_of(chosen.installed) if chosen.installed else None
    sound = sound_machine(values, gears, sampling_rate_hz=sampling_rate_hz, installed=installed)
    check_load(sound, run)
    machine = with_effects(sound, complete, rng)
    if machine.roughness.locked_to == "time" and machine.roughness.rms_um > 0.0:
        raise InputError(
            "a roughness that is locked to time has no meaning here: flanks are shapes that return with their teeth",
            where="locked_to of surface_roughness",
            allowed="'flank'",
        )
    return PreparedPair(flexible_pair(values, machine, gears), run, chosen.name, values, complete)
