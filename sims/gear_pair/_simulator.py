"""What simulators of a gear pair have in common: preset and values → machine with effects → recording."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Any, Generic, TypeVar

import numpy as np

from gearsig.checks import within
from gearsig.recording import Recording
from sims.effects import EffectSetting, completed
from sims.gear_pair._installed import Installed, installed_of
from sims.gear_pair._measurement import MeasuredRun
from sims.machine import Machine, Operation
from sims.simulator import HasText, Parameter, SimulationSetup, Simulator, Values, complete_values, truth_of

# What a simulated gear pair can be asked for: speeds, loads, sampling rates, durations.

SPEED_RANGE_RPM = (0.0, 30000.0)
BREAKING_STRESS_PA = 2e9
"""F/(b m) beyond which any steel tooth would break; rated gears stay below a quarter of it."""
SAMPLING_RATE_RANGE_HZ = (100.0, 250000.0)
DURATION_RANGE_S = (0.01, 120.0)
"""The motion is held in memory: some 30 MB a second."""


def check_run(operation: Operation, sampling_rate_hz: float) -> None:
    """Refuse speeds and sampling rates that no gear pair has."""
    for value in (operation.speed_rpm.values.min(), operation.speed_rpm.values.max()):
        within(value, "speed_rpm", *SPEED_RANGE_RPM, "rpm")
    within(sampling_rate_hz, "sampling_rate_hz", *SAMPLING_RATE_RANGE_HZ, "Hz")


def check_load(machine: Machine, operation: Operation) -> None:
    """Refuse a torque that would break the teeth: far beyond, the linear model means nothing."""
    pair = machine.mesh.pair
    section_m2 = pair.face_width_mm * pair.driver.module_mm * 1e-6
    breaking_nm = BREAKING_STRESS_PA * section_m2 * pair.driver.pitch_radius_mm * 1e-3
    within(operation.torque_nm.largest, "torque_nm", 0.0, float(f"{breaking_nm:.2g}"), "N m")


@dataclass(frozen=True)
class SimulationRequest:
    """What a model is to simulate, complete.

    Parameters
    ----------
    model, preset : str
    operation : Operation
    values : mapping
        Every parameter; None where it follows from the others.
    effects : tuple of EffectSetting
        With every option.
    installed : Installed or None
    """

    model: str
    preset: str
    operation: Operation
    values: Values
    effects: tuple[EffectSetting, ...]
    installed: Installed | None = None

    @classmethod
    def of(
        cls, model: str, known: tuple[Parameter, ...], setup: SimulationSetup, sampling_rate_hz: float
    ) -> SimulationRequest:
        """Complete a preset's values and effects by those of the setup.

        Raises
        ------
        InputError
            If a name does not exist, or a value, speed or sampling rate is out of its range.
        """
        chosen = setup.preset_of(model)
        operation = setup.operation or chosen.operation
        check_run(operation, sampling_rate_hz)
        return cls(
            chosen.model,
            chosen.name,
            operation,
            complete_values(known, chosen.parameters, setup.parameters),
            completed((*chosen.effects, *setup.effects)),
            installed_of(chosen.installed) if chosen.installed else None,
        )


@dataclass(frozen=True)
class ReadyPair:
    """A pair with its effects switched on, ready to run.

    Parameters
    ----------
    request : SimulationRequest
    machine : Machine
        Effects included.
    """

    request: SimulationRequest
    machine: Machine

    @property
    def operation(self) -> Operation:
        """Speed and torque."""
        return self.request.operation

    @property
    def preset(self) -> str:
        """Name of the preset."""
        return self.request.preset

    @property
    def values(self) -> Values:
        """Every parameter; None where it follows from the others."""
        return self.request.values

    @property
    def effects(self) -> tuple[EffectSetting, ...]:
        """With every option."""
        return self.request.effects

    def truth(self) -> dict[str, Any]:
        """What was put in, as plain values."""
        return truth_of(self.request.model, self.preset, self.values, self.effects, self.operation)


Ready = TypeVar("Ready", bound=ReadyPair)


@dataclass(frozen=True)
class PairModel(Simulator, Generic[Ready]):
    """Base of the simulators of a gear pair."""

    def prepare(self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float = 20480.0) -> Ready:
        """Build the pair and switch its effects on; one number is drawn from `rng`, with and without effects."""
        request = SimulationRequest.of(self.name, self.parameters, setup, sampling_rate_hz)
        return self._built(request, rng, sampling_rate_hz)

    def simulate(
        self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        """Make a recording with rig and truth; see `sims.simulator.Simulator.simulate`."""
        from sims.gear_pair._build import build_rig

        within(duration_s, "duration_s", *DURATION_RANGE_S, "s")
        ready = self.prepare(setup, rng, sampling_rate_hz=sampling_rate_hz)
        rig = build_rig(
            ready.machine,
            ready.operation,
            name=self.rig_name(ready.preset),
            sources=self.rig_sources(ready.preset),
        )
        return self.record(ready, MeasuredRun(rng, sampling_rate_hz, duration_s, rig))

    @abstractmethod
    def _built(self, request: SimulationRequest, rng: np.random.Generator, sampling_rate_hz: float) -> Ready:
        """Build what is asked for."""

    @abstractmethod
    def _run(self, ready: Ready, run: MeasuredRun[Any]) -> Recording:
        """Run a prepared pair and measure it."""

    @abstractmethod
    def _converges(self, ready: Ready, rng: np.random.Generator) -> HasText:
        """Compare a prepared pair's motion with that of smaller steps."""

    def record(self, ready: Ready, run: MeasuredRun[Any]) -> Recording:
        """Run a prepared pair and measure it; what was put in goes into the truth."""
        return self._run(ready, replace(run, truth=ready.truth()))

    def check_convergence(self, setup: SimulationSetup, rng: np.random.Generator) -> HasText:
        """Tell how far a smaller step of the integrator changes the result of this very machine."""
        return self._converges(self.prepare(setup, rng), rng)
