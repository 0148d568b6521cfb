"""The pair of reduced finite-element gears as a simulator: preset and values → machine → effects → recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from gearsig.errors import InputError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from sims.effects import EffectSetting, effects, with_effects
from sims.gear_pair.simulator import Asked, PairModel, ReadyPair
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.pair_limits import check_load
from sims.presets import Preset
from sims.reduced_fe.parameters import PARAMETERS
from sims.simulator import Parameter, ParameterValue

if TYPE_CHECKING:
    from sims.reduced_fe.dynamics_constants import FlexiblePair
    from sims.reduced_fe.dynamics_convergence import FlexConvergence

NAME = "reduced-fe"


@dataclass(frozen=True)
class PreparedPair(ReadyPair):
    """A flexible pair with its effects switched on, ready to run.

    Parameters
    ----------
    asked : Asked
    pair : FlexiblePair
    """

    pair: FlexiblePair

    @property
    def machine(self) -> Machine:
        """The machine, effects included."""
        return self.pair.machine

    @property
    def step_s(self) -> float:
        """Longest step of the integrator."""
        return 1e-6 * float(self.values["step_us"] or 0.0)


@dataclass(frozen=True)
class ReducedPair(PairModel[PreparedPair]):
    """Spur pair of reduced finite-element gears between two rotors; see `sims.reduced_fe`.

    Does not represent: gyroscopic and centrifugal terms, tilting of the gears, oil churning, heating, teeth bent by
    friction, a shaft that lifts in its bearings or vibrates within their clearance, a change of the gears' modes by a
    crack, contact off the line of action at corners.
    """

    name: str = NAME
    title: str = "spur pair of finite-element gears, reduced: elastic bodies, contact of slices, contact loss"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default_factory=lambda: tuple(effects()), repr=False)
    meaningless: tuple[str, ...] = (
        "surface_roughness with locked_to=time: flanks are shapes here, which return with their teeth.",
    )

    def _built(self, asked: Asked, rng: np.random.Generator, sampling_rate_hz: float) -> PreparedPair:
        return _prepared(asked, rng, sampling_rate_hz)

    def _recorded(
        self, ready: PreparedPair, rig: Rig, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        from sims.reduced_fe.simulate import simulate_pair

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
    return _prepared(
        Asked.of(chosen, PARAMETERS, parameters, settings, operation, sampling_rate_hz), rng, sampling_rate_hz
    )


def _prepared(asked: Asked, rng: np.random.Generator, sampling_rate_hz: float) -> PreparedPair:
    from sims.reduced_fe.build import flexible_pair, reduced_gears, sound_machine

    gears = reduced_gears(asked.values)
    sound = sound_machine(asked.values, gears, sampling_rate_hz=sampling_rate_hz, installed=asked.installed)
    check_load(sound, asked.operation)
    machine = with_effects(sound, asked.effects, rng)
    if machine.roughness.locked_to == "time" and machine.roughness.rms_um > 0.0:
        raise InputError(
            "a roughness that is locked to time has no meaning here: flanks are shapes that return with their teeth",
            where="locked_to of surface_roughness",
            allowed="'flank'",
        )
    return PreparedPair(asked, flexible_pair(asked.values, machine, gears))
