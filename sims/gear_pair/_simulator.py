"""Simulator of a gear pair: preset and values → machine with effects → recording."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from math import cos, pi, radians, sin, sqrt, tan
from types import MappingProxyType
from typing import Any, Generic, Self, TypeVar

import numpy as np

from gearsig.checks import count, within
from gearsig.errors import InputError, RefusalError
from gearsig.gap import AddedEffect, GapEffect, OperatingCondition
from gearsig.recording import Recording
from gearsig.rig import OperatingPoint, Rig, rig_to_dict
from sims.effects import GEARS, EffectSetting, MachineFacts, Options, as_gap_effect, effect, effects, with_effects
from sims.gear_pair._build import build_machine, build_rig
from sims.gear_pair._installed import (
    HousingMode,
    Installed,
    SensorSeat,
    completed_bearing,
    further_seats,
    installed_of,
    installed_of_rig,
    table_of,
)
from sims.gear_pair._run import MeasuredRun
from sims.machine import (
    Machine,
    Nominal,
    Operation,
    Profile,
    log_uniform,
    nominal_of,
    pitch_tolerance_um,
    runout_tolerance_um,
    usual_mass_kg,
)
from sims.mesh import PairGeometry
from sims.presets import Preset, preset_text
from sims.simulator import (
    HasText,
    ParameterValue,
    SimulationRequest,
    SimulationSetup,
    Simulator,
    Values,
    sources_digest,
)

# Limits for a simulated gear pair: speeds, loads, sampling rates, durations.

SPEED_RANGE_RPM = (0.0, 30000.0)
BREAKING_STRESS_PA = 2e9
"""F/(b m) beyond which any steel tooth breaks; rated gears stay below a quarter of it."""
SAMPLING_RATE_RANGE_HZ = (100.0, 250000.0)
DURATION_RANGE_S = (0.01, 120.0)
"""The motion is held in memory, about 30 MB per second."""


def check_run(operation: Operation, sampling_rate_hz: float) -> None:
    """Reject speeds and sampling rates outside their ranges."""
    for value in (operation.speed_rpm.values.min(), operation.speed_rpm.values.max()):
        within(value, "speed_rpm", *SPEED_RANGE_RPM, "rpm")
    within(sampling_rate_hz, "sampling_rate_hz", *SAMPLING_RATE_RANGE_HZ, "Hz")


def check_load(machine: Machine, operation: Operation) -> None:
    """Reject a torque that would break the teeth, where the linear model is meaningless."""
    pair = machine.mesh.pair
    section_m2 = pair.face_width_mm * pair.driver.module_mm * 1e-6
    breaking_nm = BREAKING_STRESS_PA * section_m2 * pair.driver.pitch_radius_mm * 1e-3
    within(operation.torque_nm.largest, "torque_nm", 0.0, float(f"{breaking_nm:.2g}"), "N m")


@dataclass(frozen=True)
class ReadyPair(SimulationRequest):
    """A pair with its effects switched on, ready to run.

    Parameters
    ----------
    machine : Machine
        Effects included.
    """

    machine: Machine


Ready = TypeVar("Ready", bound=ReadyPair)


@dataclass(frozen=True)
class PairModel(Simulator, Generic[Ready]):
    """Base of the simulators of a gear pair."""

    def prepare(self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float = 20480.0) -> Ready:
        """Build the pair and switch on its effects; one number is drawn from `rng`, with or without effects."""
        request = SimulationRequest.of(self.name, self.parameters, setup)
        check_run(request.operation, sampling_rate_hz)
        installed = setup.preset_of(self.name).installed
        healthy = self._healthy(request.values, sampling_rate_hz, installed_of(installed) if installed else None)
        check_load(healthy, request.operation)
        return self._ready(request, with_effects(healthy, request.effects, rng))

    def simulate(
        self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        """Make a recording with rig and truth; see `sims.simulator.Simulator.simulate`."""
        within(duration_s, "duration_s", *DURATION_RANGE_S, "s")
        ready = self.prepare(setup, rng, sampling_rate_hz=sampling_rate_hz)
        rig = build_rig(
            ready.machine,
            ready.operation,
            name=self.rig_name(ready.preset),
            sources=self.rig_sources(ready.preset),
        )
        return self.record(ready, MeasuredRun(rng, sampling_rate_hz, duration_s, rig))

    def _healthy(self, values: Values, sampling_rate_hz: float, installed: Installed | None) -> Machine:
        """Build the machine without effects."""
        return build_machine(values, sampling_rate_hz=sampling_rate_hz, installed=installed)

    @abstractmethod
    def _ready(self, request: SimulationRequest, machine: Machine) -> Ready:
        """Add the machine to the request."""

    @abstractmethod
    def _run(self, ready: Ready, run: MeasuredRun[Any]) -> Recording:
        """Run a prepared pair and measure it."""

    @abstractmethod
    def _converges(self, ready: Ready, rng: np.random.Generator) -> HasText:
        """Compare a prepared pair's motion with that at smaller steps."""

    def record(self, ready: Ready, run: MeasuredRun[Any]) -> Recording:
        """Run a prepared pair and measure it; the inputs go into the truth."""
        return self._run(ready, replace(run, truth=ready.truth()))

    def check_convergence(self, setup: SimulationSetup, rng: np.random.Generator) -> HasText:
        """Report how much a smaller integration step changes the result for this machine."""
        return self._converges(self.prepare(setup, rng), rng)

    # The interface of the gap diagnosis, see `gearsig.gap.GapSimulator`.

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return all effects of the catalogue: each has a meaning for a gear pair."""
        return {name: as_gap_effect(e) for name, e in effects().items()}

    def twin_of(self, rig: Rig) -> PairTwin:
        """Return a twin of the rig, after checking that its gears can be built.

        Raises
        ------
        RefusalError
            If there is not exactly one pair, its teeth or module are not known, or the model cannot have such gears.
        """
        twin = self._twin(rig, nominal_of(rig))
        try:
            twin.pair_geometry()
        except InputError as error:
            raise RefusalError(f"the model {self.name!r} cannot be adapted to this rig: {error}") from None
        return twin

    @abstractmethod
    def _twin(self, rig: Rig, nominal: Nominal) -> PairTwin:
        """Return the twin of a rig with the nominal data of its pair."""


# --------------------
# A model adapted to a rig, for the gap diagnosis: see `gearsig.gap`.
# --------------------

# Parameters of a pair of which only the rig's data are known: the rest is usual for its size.
#
# The values are the middles of the ranges from which gearboxes for calibrations are drawn: plausible, not measured.

RELIEF_SHARE, RELIEF_LENGTH_MODULES = 0.8, 1.1
"""Tip relief over the deflection under the nominal load; its length along the line of action."""
PITCH_RMS_SHARE, RUNOUT_SHARE = 0.1, 0.3
"""A ground gear's rms pitch deviation over f_pt, and eccentricity over F_r: tolerances of class 5 of ISO 1328."""
BODY_KG, MOUNTS_HZ, MOUNTS_DAMPING = 40.0, 6.0, 0.3
"""Housing with its bed, for a machine of size 1; all shaft speeds are above the frequency of its mounts."""
BODY_SHAPES = ((1.0, 1.0, 1.0, 1.0), (1.0, -1.0, 1.0, -1.0))
"""Heave and pitch of that housing at bearings 1 to 4, the first two at the ends of one shaft."""
UNBALANCE_UM = 30.0
"""Offset of the centre of mass; 40 um is balance grade G 6.3 at 1500 rpm."""
COUPLING_BENDING_SHARE = 0.01
"""Bending stiffness of a coupling over the torsional stiffness of shaft and coupling: catalogues have 0.002 (steel
discs) to 0.05 (elastomer)."""


def usual_parameters(nominal: Nominal) -> dict[str, ParameterValue]:
    """Return the parameters of the model "cracked" that are common to all specimens."""
    m, z, size = nominal.module_mm, nominal.teeth, nominal.size
    shifts = [_shift(teeth, nominal.pressure_angle_deg) for teeth in z]
    rotor = 4.5e-3 * size**4 * (sum(z) / 80.0) ** 3
    torsional = 1.1e4 * size**3
    return {
        "teeth_driver": z[0],
        "teeth_driven": z[1],
        "module_mm": m,
        "pressure_angle_deg": nominal.pressure_angle_deg,
        "face_width_mm": nominal.face_width_mm,
        "tool_tip_radius": _tool_tip_radius(nominal.pressure_angle_deg),
        "profile_shift_driver": shifts[0],
        "profile_shift_driven": shifts[1],
        "contact_law": "load-dependent",
        "mesh_damping_ratio": 0.06,
        "half_backlash_um": 40.0 * sqrt(size),
        "tip_relief_um": RELIEF_SHARE * nominal.deflection_um,
        "tip_relief_length_mm": RELIEF_LENGTH_MODULES * m,
        "roughness_um": 0.1,
        "roughness_locked_to": "flank",
        "viscosity_cp": 20.0,
        "bearing_stiffness_n_per_m": 2e8 * size,
        "bearing_damping_n_s_per_m": 1200.0 * size,
        "bearing_mass_kg": 0.7 * size**2,
        "bending_stiffness_n_per_m": 2.6e8 * size,
        "bending_damping_n_s_per_m": 630.0 * size,
        "torsional_stiffness_nm_per_rad": torsional,
        "torsional_damping_nm_s_per_rad": 1.5 * size**3,
        "coupling_bending_nm_per_rad": COUPLING_BENDING_SHARE * torsional,
        "rotor_inertia_input_kg_m2": rotor,
        "rotor_inertia_output_kg_m2": rotor,
        "governor_nm_s_per_rad": 1.6 * size**4,
        "bearing_distance_mm": 50.0 * m,
        "noise_mps2": 0.1,
        "noise_slope": 0.5,
        "sensor_range_mps2": 5000.0,
        "sensor_resonance_hz": 0.0,
    }


def specimen_parameters(nominal: Nominal, rng: np.random.Generator) -> dict[str, ParameterValue]:
    """Draw what differs between machines of one drawing: tolerances, half to twice the usual, and their angles."""
    parameters: dict[str, ParameterValue] = {"tolerance_seed": int(rng.integers(10**6))}
    widest = max(nominal.pitch_diameters_mm)
    parameters["pitch_deviation_um"] = PITCH_RMS_SHARE * pitch_tolerance_um(nominal.module_mm, widest) * _spread(rng)
    for side, name in enumerate(("driver", "driven")):
        diameter = nominal.pitch_diameters_mm[side]
        parameters[f"runout_{name}_um"] = RUNOUT_SHARE * runout_tolerance_um(nominal.module_mm, diameter) * _spread(rng)
        parameters[f"unbalance_{name}_g_mm"] = UNBALANCE_UM * usual_mass_kg(nominal, side) * _spread(rng)
        for quantity in ("runout", "unbalance"):
            parameters[f"{quantity}_angle_{name}_deg"] = float(rng.uniform(0.0, 360.0))
    return parameters


def usual_housing(rng: np.random.Generator) -> tuple[HousingMode, ...]:
    """Draw the modes of an unmeasured housing."""
    return tuple(
        HousingMode(
            _rounded(log_uniform(rng, 600.0, 8000.0)),
            _rounded(log_uniform(rng, 0.01, 0.05)),
            _rounded(rng.uniform(0.02, 0.08)),
            tuple(_rounded(s) for s in rng.uniform(-1.0, 1.0, 4)),  # type: ignore[arg-type]  # four of them
        )
        for _ in range(int(rng.integers(2, 6)))
    )


def body_on_mounts(nominal: Nominal) -> tuple[HousingMode, ...]:
    """Return heave and pitch of the housing as a rigid body on soft mounts, its response to a shaft's low orders.

    Above the mounts' frequency a = Σ F/M; with F = k x, the force of a bearing whose acceleration is −ω² x, that is a
    mode of static gain k/(M ω₀²). On rigid ground a machine vibrates about 50 dB less at 25 Hz. Opposite forces on a
    shaft's two bearings, as from a bending moment, have zero sum and rotate the body: at arms ±l/2,
    a = ±(l/2) Σ ±F (l/2)/J with J = M i². A block 1.5 l long and l high has i = 0.52 l, here l/2: the same gain.

    Source: H. Himelblau and S. Rubin, Vibration of a resiliently supported rigid body, in *Harris' Shock and Vibration
    Handbook*.
    """
    stiffness = float(usual_parameters(nominal)["bearing_stiffness_n_per_m"])
    gain = body_gain(stiffness, BODY_KG * nominal.size**2, MOUNTS_HZ)
    return tuple(HousingMode(MOUNTS_HZ, MOUNTS_DAMPING, gain, shape) for shape in BODY_SHAPES)


def body_gain(bearing_stiffness_n_per_m: float, mass_kg: float, mounts_hz: float) -> float:
    """Return the static gain k/(M ω₀²) of a body on mounts; see `body_on_mounts`."""
    return bearing_stiffness_n_per_m / (mass_kg * (2.0 * pi * mounts_hz) ** 2)


def _shift(teeth: int, pressure_angle_deg: float) -> float:
    """Minimum profile shift without undercut, in modules: (z_min − z)/z_min, z_min = 2/sin²α of the rack."""
    min_teeth = 2.0 / sin(radians(pressure_angle_deg)) ** 2
    return max(0.0, (min_teeth - teeth) / min_teeth)


def _tool_tip_radius(pressure_angle_deg: float) -> float:
    """0.38 modules, or 95 % of the limit at a dedendum of 1.25 modules: (π/4 − 1.25 tan α)/(sec α − tan α)."""
    alpha = radians(pressure_angle_deg)
    return min(0.38, 0.95 * (pi / 4.0 - 1.25 * tan(alpha)) / (1.0 / cos(alpha) - tan(alpha)))


def _spread(rng: np.random.Generator) -> float:
    return float(2.0 ** rng.uniform(-1.0, 1.0))


def _rounded(value: float) -> float:
    """Round to six digits, so that the simulated values are those in the preset file."""
    return float(f"{value:.6g}")


LONGEST_LEAD_REV = 8.0
"""Maximum delay of the start of another run, in revolutions of the driver."""
EVEN = 0.01
"""Fraction of the tolerances in a quiet machine; none at all would leave lines of zero power."""
_UNEVEN = (
    "pitch_deviation_um",
    *(f"{what}_{gear}_{unit}" for what, unit in (("runout", "um"), ("unbalance", "g_mm")) for gear in GEARS),
)
_NOISES = ("noise_mps2", "sensor_noise_mps2_per_sqrt_hz")
RUN_UP_POINTS = 32
"""Points between which the set speed of a run-up is linear."""
VIBRATION_S = 0.5
"""Duration of the run that gives the healthy machine's vibration level."""


@dataclass(frozen=True)
class PairTwin:
    """A rig's twin for any of the models: the rig's geometry, the rest usual for its size.

    Each seed is one specimen with its housing.

    Parameters
    ----------
    rig : Rig
    nominal : Nominal
    further : tuple of SensorSeat
        Sensors in addition to the rig's.
    is_quiet : bool
        Rigid on soft mounts, without ambient vibration, with almost perfect gears.
    """

    rig: Rig
    nominal: Nominal
    further: tuple[SensorSeat, ...] = ()
    is_quiet: bool = False

    @property
    def key(self) -> str:
        """Key of the twin: model, version of its code, and the rig's data."""
        known = {name: value for name, value in rig_to_dict(self.rig).items() if name not in ("name", "sources")}
        text = repr(known) + (repr(self.further) if self.further else "") + ("quiet" if self.is_quiet else "")
        return f"{self.model} {sources_digest()} {sha256(text.encode()).hexdigest()[:16]}"

    @property
    def pair_model(self) -> PairModel[Any]:
        """The model that runs the twin."""
        raise NotImplementedError

    @property
    def model(self) -> str:
        """Name of the model that the twin's preset is for."""
        return self.pair_model.name

    @property
    def point(self) -> OperatingCondition:
        """The rig's nominal operating point, usual for its size where the rig does not state it."""
        return OperatingCondition(self.nominal.speed_rpm, self.nominal.torque_nm)

    def run(
        self,
        point: OperatingCondition,
        added: Sequence[AddedEffect] = (),
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
        noise: int = 0,
    ) -> Recording:
        """Return a recording with its rig; each value of `noise` is another run of the same machine.

        Flanks, tolerances and housing follow from `seed` alone. Sensor noise, tachometer jitter and the start of the
        run follow from seed and noise; run 0 starts at the driver's first tooth.
        """
        run_rng = np.random.default_rng([count(seed, "seed", minimum=0), count(noise, "noise", minimum=0)])
        skipped = 0
        if noise:
            skipped = round(run_rng.uniform(0.0, LONGEST_LEAD_REV) * 60.0 / point.speed_rpm * sampling_rate_hz)
        ready, run = self._planned(point, added, seed, sampling_rate_hz)
        run = replace(run, duration_s=duration_s + skipped / sampling_rate_hz, noise_rng=run_rng if noise else None)
        recording = self.pair_model.record(ready, run)
        recording = replace(recording, truth={**(recording.truth or {}), "seed": seed, "noise": noise})
        return replace(recording, samples=recording.samples[:, skipped:]) if skipped else recording

    def _planned(
        self, point: OperatingCondition, added: Sequence[AddedEffect], seed: int, sampling_rate_hz: float
    ) -> tuple[ReadyPair, MeasuredRun[Any]]:
        """Return a specimen with its effects, and a run of it with a duration of one sample."""
        rng = np.random.default_rng(seed)
        ready = self._prepared(self.preset(point, added, seed=seed), rng, sampling_rate_hz)
        step_s = self._step_s(point, seed)
        return ready, MeasuredRun(rng, sampling_rate_hz, 1.0 / sampling_rate_hz, self._rig_at(point), step_s=step_s)

    def run_up(
        self,
        from_rpm: float,
        to_rpm: float,
        torque_nm: float,
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
    ) -> Recording:
        """Return a recording of the healthy machine with a speed that rises by equal factors in equal times."""
        ready, run = self._planned(OperatingCondition(to_rpm, torque_nm), (), seed, sampling_rate_hz)
        part = np.linspace(0.0, 1.0, RUN_UP_POINTS)
        speed_rpm = Profile.of(duration_s * part, from_rpm * (to_rpm / from_rpm) ** part)
        operation = Operation(speed_rpm, Profile.constant(torque_nm))
        return self.pair_model.record(replace(ready, operation=operation), replace(run, duration_s=duration_s))

    def quiet(self) -> Self:
        """Return the machine on soft mounts, without ambient vibration and with hardly any from its own gears.

        The effect of a fault is then neither lost in noise nor combined with what the specimen happens to have, as a
        second unbalance would be. The housing is rigid: drawn resonances are those of another machine, and would
        distort the profile of a tooth fault in a way that the real ones do not.
        """
        return replace(self, is_quiet=True)

    def candidates(self, name: str) -> Sequence[AddedEffect]:
        """Return the settings of an effect to try, from barely noticeable to strong, for each relevant option."""
        plausible = effect(name).plausible_range
        indices = range(plausible.n_severities)
        return self._settings(name, [(options, indices) for options in plausible.choices(self._facts)])

    def further_settings(self, name: str) -> Sequence[AddedEffect]:
        """Return further settings, for which a tooth fault has another profile over the engagement."""
        return self._settings(name, effect(name).plausible_range.further_settings(self._facts))

    def _settings(self, name: str, chosen: Sequence[tuple[Options, Sequence[float]]]) -> list[AddedEffect]:
        """Return each set of options with some of its severities, counted from 0; 0.5 is between the first two."""
        last, settings = effect(name).plausible_range.n_severities - 1, []
        for options, places in chosen:
            low, high = effect(name).plausible_severities(self._facts, options)
            severities = [low * (high / low) ** (place / last) for place in places]
            settings += [AddedEffect(name, float(f"{severity:.4g}"), options) for severity in severities]
        return settings

    def with_further_sensors(self) -> tuple[Self, Mapping[str, str]]:
        """Return the machine with a vertical sensor over each bearing that has none, and those channels' positions."""
        further = further_seats(installed_of_rig(self.rig, self.nominal.size, ()))
        return replace(self, further=further), {seat.channel: seat.position for seat in further}

    def draw(self, name: str, rng: np.random.Generator, *, above: float = 0.0) -> AddedEffect:
        """Draw a setting from the range of the candidates, with random options.

        Parameters
        ----------
        name : str
        rng : numpy.random.Generator
        above : float
            Fraction of the logarithmic range that is excluded at its lower end.

        Raises
        ------
        RefusalError
            If the rig lacks what the effect needs: a bearing.
        """
        plausible, machine = effect(name).plausible_range, self._facts
        if not plausible.choices(machine):
            raise RefusalError(f"the rig describes no part that {name} could affect", remedy="describe its bearings")
        options = plausible.drawn(machine, rng)
        low, high = effect(name).plausible_severities(machine, options)
        return AddedEffect(name, log_uniform(rng, low * (high / low) ** above, high), options)

    def preset(
        self, point: OperatingCondition, added: Sequence[AddedEffect] = (), *, seed: int = 0, notes: Sequence[str] = ()
    ) -> Preset:
        """Return the specimen `seed` with its effects as a preset."""
        drawn = np.random.default_rng([seed, 1])
        values = usual_parameters(self.nominal) | specimen_parameters(self.nominal, drawn)
        if self.is_quiet:
            values |= dict.fromkeys(_NOISES, 0.0) | {name: EVEN * float(values[name]) for name in _UNEVEN}
        housing = body_on_mounts(self.nominal) if self.is_quiet else usual_housing(drawn)
        used = [str(a.options["bearing"]) for a in added if "bearing" in a.options]
        installed = installed_of_rig(self.rig, self.nominal.size, housing, used)
        installed = replace(installed, sensors=(*installed.sensors, *self.further))
        title = f"Twin of {self.rig.name}" if self.rig.name else "Twin of a rig"
        return Preset(
            name="twin",
            model=self.model,
            title=f"{title}: {self.nominal.teeth[0]}/{self.nominal.teeth[1]}, module {self.nominal.module_mm:g}",
            sources=(*self.rig.sources, *notes),
            assumed=(
                "usual for its size: masses, inertias, shafts, stiffness and damping, tip relief, tolerances, oil",
                "transfer path: drawn",
                f"flank profiles, and angles of effects: those of seed {seed}",
                *(f"{name}: usual value, as the rig does not state it" for name in self.nominal.assumed),
            ),
            does_not_represent=("the real machine's own flanks, tolerances and housing",),
            parameters=MappingProxyType(
                {name: _rounded(v) if isinstance(v, float) else v for name, v in self._model_parameters(values).items()}
            ),
            speed_rpm=point.speed_rpm,
            torque_nm=point.torque_nm,
            effects=tuple(EffectSetting(a.name, a.severity, dict(a.options)) for a in added),
            installed=table_of(installed),
        )

    def preset_toml(
        self, point: OperatingCondition, added: Sequence[AddedEffect], notes: Sequence[str], *, seed: int = 0
    ) -> str:
        """Return the machine with the effects as a preset file for `gearsig simulate MODEL --preset FILE`."""
        comments = [f"The flanks' profiles are not in this file: simulate with --seed {seed} for those of the twin."]
        return preset_text(self.preset(point, added, seed=seed, notes=notes), comments)

    def pair_geometry(self) -> PairGeometry:
        """Return the geometry of the pair.

        Raises
        ------
        InputError
            If the model cannot have such gears.
        """
        return self._prepared(self.preset(self.point), np.random.default_rng(0)).machine.mesh.pair

    @cached_property
    def _facts(self) -> MachineFacts:
        machine = self._prepared(self.preset(self.point), np.random.default_rng(0)).machine
        pair = machine.mesh.pair
        shafts = (self.rig.pairs[0].driver, self.rig.pairs[0].driven)
        bearings = tuple(completed_bearing(b, self.nominal.size) for b in self.rig.bearings if b.shaft in shafts)
        healthy = self.run(self.point, seed=0, duration_s=VIBRATION_S, sampling_rate_hz=20480.0)
        rms = np.mean([np.std(healthy.values(name)) for name in healthy.vibration_names()])
        play_um = 2.0 * machine.half_backlash_um
        return MachineFacts(self.nominal, (pair.driver, pair.driven), bearings, float(rms), play_um)

    def _prepared(self, preset: Preset, rng: np.random.Generator, sampling_rate_hz: float = 20480.0) -> ReadyPair:
        ready: ReadyPair = self.pair_model.prepare(SimulationSetup(preset), rng, sampling_rate_hz=sampling_rate_hz)
        return ready

    def _step_s(self, point: OperatingCondition, seed: int) -> float:
        """Maximum integration step for a specimen, with or without effects."""
        raise NotImplementedError

    def _model_parameters(self, values: dict[str, ParameterValue]) -> dict[str, ParameterValue]:
        """Convert the usual parameters to those of the model."""
        return values

    def _rig_at(self, point: OperatingCondition) -> Rig:
        operating_point = OperatingPoint(self.rig.pairs[0].driver, point.speed_rpm, torque_nm=point.torque_nm)
        return replace(self.rig, operating_point=operating_point)
