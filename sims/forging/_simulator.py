"""The forging manipulator's drive as a simulator: preset and values → drive → recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import closest_match_hint, within
from gearsig.errors import InputError
from gearsig.recording import Recording
from sims.effects import EffectSetting, completed, effect, effects
from sims.forging._drive import (
    PARAMETERS,
    Cycle,
    ForgingDrive,
    Schedule,
    build_cycle,
    build_drive,
    build_rig,
    gear_pair,
    schedule,
)
from sims.machine import Operation, Profile, WeakTooth
from sims.mesh import PairGeometry
from sims.simulator import (
    Parameter,
    ParameterValues,
    SimulationSetup,
    Simulator,
    Values,
    complete_values,
    parameter,
    truth_of,
)

if TYPE_CHECKING:
    from sims.forging._respond import ForgingConvergence


WITH_MEANING = tuple(name for name, each in effects().items() if each.on_drive)
"""Effects that the drive can have; a wrong load inertia is `piece_mass_kg` or `wheel_inertia_kg_m2`."""


class _DriveValues(ParameterValues):
    """Complete parameters as effects read them: see `sims.effects.DriveParameters`."""

    def highest(self, name: str) -> float:
        return float(parameter(PARAMETERS, name).high or 0.0)

    def gear_pair(self) -> PairGeometry:
        return gear_pair(self)


def with_effects(values: Values, settings: Sequence[EffectSetting]) -> tuple[Values, WeakTooth | None]:
    """Return the parameters with the effects in them, and the tooth that a crack makes weak.

    Raises
    ------
    InputError
        If an effect has no meaning here, is given twice, or its severity or options do not fit.
    """
    changed = dict(values)
    weak_tooth: WeakTooth | None = None
    names = [setting.name for setting in settings]
    for setting in settings:
        chosen = effect(setting.name) if setting.name in effects() else None
        if chosen is None or chosen.on_drive is None:
            raise InputError(
                f"effect {setting.name!r} has no meaning for the model forging",
                allowed=", ".join(WITH_MEANING),
                remedy=closest_match_hint(setting.name, WITH_MEANING),
            )
        if names.count(setting.name) > 1:
            raise InputError(f"effect {setting.name!r} is given {names.count(setting.name)} times", allowed="once")
        severity, options = chosen.check_severity(setting.severity), chosen.complete(setting.options)
        change = chosen.on_drive(_DriveValues(changed), severity, options)
        changed |= change.values
        weak_tooth = change.weak_tooth or weak_tooth
    return changed, weak_tooth


NAME = "forging"
SAMPLING_RATE_RANGE_HZ = (100.0, 200000.0)
DURATION_RANGE_S = (0.05, 3600.0)
MAX_SAMPLES = 12_000_000
SPEED_RANGE_RPM = (0.0, 5000.0)
TORQUE_RANGE_NM = (0.0, 1e6)


@dataclass(frozen=True)
class PreparedDrive:
    """A drive with its cycle, ready to run.

    Parameters
    ----------
    drive : ForgingDrive
        With its effects.
    cycle : Cycle
    operation : Operation
    preset : str
    values, healthy_values : mapping
        Every parameter, with the effects and without.
    effects : tuple of EffectSetting
        With every option.
    """

    drive: ForgingDrive
    cycle: Cycle
    operation: Operation
    preset: str
    values: Values
    healthy_values: Values
    effects: tuple[EffectSetting, ...] = ()

    def profiles(self, duration_s: float) -> Schedule:
        """Torque, brake and press over a run."""
        return schedule(self.cycle, self.operation.torque_nm, duration_s)

    def truth(self) -> dict[str, Any]:
        """What was put in, as plain values."""
        return {
            **truth_of(NAME, self.preset, self.healthy_values, self.effects, self.operation),
            "backlash_um": 2.0 * self.drive.contact.half_backlash_um,
            "stiffness_n_per_m_lambda": self.drive.contact.stiffness_n_per_m_lambda,
            "reduced_mass_kg": self.drive.reduced_mass_kg,
        }


@dataclass(frozen=True)
class ForgingManipulator(Simulator):
    """Pinion and wheel of a forging manipulator: start–stop, backlash, impact; see `sims.forging`."""

    name: str = NAME
    title: str = "forging manipulator's drive: start–stop, backlash, impact on both flanks, stick–slip"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default=WITH_MEANING, repr=False)
    usual_sampling_rate_hz: float = field(default=1000.0, repr=False)  # a motion controller's, 1 ms

    def prepare(self, setup: SimulationSetup) -> PreparedDrive:
        """Build the drive and its cycle, with its effects."""
        chosen = setup.preset_of(NAME)
        healthy = complete_values(PARAMETERS, chosen.parameters, setup.parameters)
        effects = (*chosen.effects, *setup.effects)
        values, weak = with_effects(healthy, effects)
        run = setup.operation or chosen.operation
        within(run.torque_nm.largest, "torque_nm", *TORQUE_RANGE_NM, "N m")
        read = ParameterValues(values)
        drive = build_drive(read, _constant(run.speed_rpm), weak)
        return PreparedDrive(drive, build_cycle(read), run, chosen.name, values, healthy, completed(effects))

    def simulate(
        self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        """Make a recording with rig and truth, from rest on; see `sims.simulator.Simulator.simulate`.

        The operation's torque is that of the open valve, its speed the pinion's that the flow allows (0: no limit).
        Vibration is recorded from 5 kHz on. A stop that is longer than the record is an error.
        """
        from sims.forging._measure import record, sensors

        within(duration_s, "duration_s", *DURATION_RANGE_S, "s")
        within(sampling_rate_hz, "sampling_rate_hz", *SAMPLING_RATE_RANGE_HZ, "Hz")
        if sampling_rate_hz * duration_s > MAX_SAMPLES:
            raise InputError(f"{sampling_rate_hz * duration_s:.3g} samples are wanted", allowed=f"up to {MAX_SAMPLES}")
        ready = self.prepare(setup)
        rig = build_rig(
            ready.drive,
            ParameterValues(ready.healthy_values),
            ready.operation,
            sensors(sampling_rate_hz),
            name=self.rig_name(ready.preset),
            sources=self.rig_sources(ready.preset),
        )
        ready.profiles(duration_s)  # says so where a stop does not fit, before anything is run
        return record(
            ready.drive,
            ready.profiles(duration_s + 1.0),
            ParameterValues(ready.values),
            rig=rig,
            rng=rng,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s,
            truth=ready.truth(),
        )

    def check_convergence(self, setup: SimulationSetup, rng: np.random.Generator) -> ForgingConvergence:
        """Tell how far shorter steps change the motion of this very drive, which nothing random enters."""
        from sims.forging._respond import check_convergence

        del rng
        ready = self.prepare(setup)
        return check_convergence(ready.drive, ready.cycle, ready.operation.torque_nm)


def _constant(speed_rpm: Profile) -> float:
    """Return the speed limit: one number, as a valve is set once."""
    if len(speed_rpm.values) > 1 and float(speed_rpm.values.max() - speed_rpm.values.min()) > 0.0:
        raise InputError("speed_rpm varies", allowed="one speed that the flow allows", remedy="vary --torque instead")
    return within(float(speed_rpm.values[0]), "speed_rpm", *SPEED_RANGE_RPM, "rpm")
