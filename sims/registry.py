"""All simulators by name, and the definition of one simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import count, known_name
from gearsig.gap import DriveSimulator, GapSimulator
from gearsig.recording import Recording
from sims.effects import EffectSetting, effects
from sims.machine import Operation, Profile
from sims.presets import preset
from sims.simulator import ParameterValue, SimulationSetup

if TYPE_CHECKING:
    from sims.cracked import CrackedPair
    from sims.forging import ForgingManipulator
    from sims.reduced_fe import ReducedPair


def simulators() -> dict[str, CrackedPair | ReducedPair | ForgingManipulator]:
    """Return all simulators by name."""
    return _simulators(tuple(effects()))


@cache
def _simulators(_: tuple[str, ...]) -> dict[str, CrackedPair | ReducedPair | ForgingManipulator]:
    """Return all simulators; the argument only renews them when a user adds an effect."""
    from sims.cracked import CrackedPair
    from sims.forging import ForgingManipulator
    from sims.reduced_fe import ReducedPair

    return {simulator.name: simulator for simulator in (CrackedPair(), ReducedPair(), ForgingManipulator())}


def simulator(name: str) -> CrackedPair | ReducedPair | ForgingManipulator:
    """Return the simulator called `name`."""
    return simulators()[known_name(name, simulators(), f"there is no model {name!r}")]


def gap_simulators() -> Mapping[str, GapSimulator | DriveSimulator]:
    """Return the simulators that the gap diagnosis can use, by name: all of them."""
    return simulators()


def gap_simulator(name: str) -> GapSimulator | DriveSimulator:
    """Return the simulator called `name`, typed as the gap diagnosis's protocol."""
    return simulator(name)


@dataclass(frozen=True)
class Simulation:
    """Everything that determines a recording: equal simulations give equal recordings.

    Parameters
    ----------
    model : str
    preset : str
        Its name or its file; empty: the model's first.
    parameters : mapping
        Name → value; the preset's value for each one not given.
    effects : tuple of EffectSetting
        In addition to the preset's.
    speed_rpm, torque_nm : Profile or None
        Of the input shaft; None: the preset's.
    duration_s, sampling_rate_hz : float
    seed : int
        Of all random draws.
    """

    model: str
    _: KW_ONLY
    preset: str = ""
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    effects: tuple[EffectSetting, ...] = ()
    speed_rpm: Profile | None = None
    torque_nm: Profile | None = None
    duration_s: float = 5.0
    sampling_rate_hz: float = 20480.0
    seed: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        count(self.seed, "seed", minimum=0)

    @property
    def setup(self) -> SimulationSetup:
        """Setup of the model; where only one of speed and torque is given, the other is the preset's."""
        speed, torque, operation = self.speed_rpm, self.torque_nm, None
        if speed is not None or torque is not None:
            of_preset = preset(self.model, self.preset).operation
            operation = Operation(
                of_preset.speed_rpm if speed is None else speed, of_preset.torque_nm if torque is None else torque
            )
        return SimulationSetup(self.preset, self.parameters, self.effects, operation)

    def run(self) -> Recording:
        """Simulate the recording; see `sims.simulate`."""
        recording = simulator(self.model).simulate(
            self.setup,
            np.random.default_rng(self.seed),
            sampling_rate_hz=self.sampling_rate_hz,
            duration_s=self.duration_s,
        )
        return replace(recording, truth={**(recording.truth or {}), "seed": self.seed})
