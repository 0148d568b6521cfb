"""The forging manipulator's drive as a simulator: preset and values → drive → measured motion → recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, pi, radians
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint, within
from gearsig.errors import InputError
from gearsig.gap import AddedEffect, DriveFacts, GapEffect, OperatingCondition
from gearsig.recording import Channel, Provenance, Recording
from gearsig.rig import EncoderChannel, Rig, Sensor, standard_path
from sims.effects import EffectSetting, effect, effects
from sims.forging._drive import (
    CONTINUOUS,
    MESH_RAMP_RANGE,
    PARAMETERS,
    SAMPLINGS,
    Cycle,
    ForgingDrive,
    Schedule,
    build_cycle,
    build_drive,
    build_rig,
    gear_pair,
    schedule,
)
from sims.forging._respond import CONTACT_COLUMNS, DriveResponse, ForgingConvergence, check_convergence, respond
from sims.machine import Operation, Profile, WeakTooth
from sims.measure import (
    Accelerometer,
    AntiAlias,
    ColouredNoise,
    MeasuredChannel,
    MeasurementChain,
    ModalPath,
    Motion,
    apply,
    discrete,
)
from sims.mesh import GearGeometry, PairGeometry, wear_profile
from sims.presets import Preset, preset_text
from sims.simulator import (
    Parameter,
    ParameterValue,
    ParameterValues,
    SimulationRequest,
    SimulationSetup,
    Simulator,
    Values,
    complete_values,
    parameter,
)

# --------------------
# From the drive's motion to a recording: encoders, torque sensor, and an accelerometer if the rate allows.
# --------------------


# Slow channels as stored by a data logger: through an anti-alias filter, not as instantaneous values.

SLOW_FINE_POINTS = 8
"""Points of the motion per sample: tooth forces above seven times the sampling rate are below a millinewton."""
MAX_VALUES = 40_000_000
"""Maximum number of values of the fine motion held at a time: a third of a gigabyte."""


def filtered_signals(
    drive: ForgingDrive, profiles: Schedule, names: Sequence[str], *, sampling_rate_hz: float, n_samples: int
) -> dict[str, FloatArray]:
    """Return signals of the drive, low-pass filtered and sampled, each (n_samples,).

    The filter has no delay: a sine up to 0.4 of the sampling rate keeps its amplitude and phase, one above half of it
    is attenuated by 90 dB. Before the run, all values are those at its start. The profiles must last 30 samples longer.

    Parameters
    ----------
    drive : ForgingDrive
    profiles : Schedule
    names : sequence of str
        From `SIGNALS`.
    sampling_rate_hz : float
    n_samples : int
    """
    chain = AntiAlias()
    step_s = 1.0 / (SLOW_FINE_POINTS * sampling_rate_hz)
    reach = ceil(chain.reach_s(sampling_rate_hz) * sampling_rate_hz) + 1
    lasts_s = (n_samples + reach) / sampling_rate_hz
    together = max(1, MAX_VALUES // ((n_samples + 2 * reach) * SLOW_FINE_POINTS))
    signals: dict[str, FloatArray] = {}
    for first in range(0, len(names), together):
        chosen = names[first : first + together]
        run = respond(drive, profiles, duration_s=lasts_s, interval_s=step_s, signals=chosen)
        fine = np.pad(np.stack([run[name] for name in chosen]), ((0, 0), (reach * SLOW_FINE_POINTS, 0)), mode="edge")
        signals |= zip(chosen, chain.sample(fine, step_s, sampling_rate_hz, reach, n_samples), strict=True)
    return signals


MIN_VIBRATION_HZ = 5000.0
"""Minimum sampling rate for recording vibration: flanks in contact ring at about 400 Hz, housings above that."""
FINE_POINTS = 4
"""Points of the motion per sample of the accelerometer."""
PLACE = "pinion bearing"
FOLDS = (
    "torque, force, speeds and accelerations are instantaneous samples: content above {:g} Hz is aliased, so lines in "
    "their spectra may not be from the machine (slow_channels=filtered avoids this)"
)

CHANNELS = (
    Channel("torque", "torque", "N m", "between motor and pinion"),
    Channel("pinion angle", "angle", "rad", "pinion"),
    Channel("wheel angle", "angle", "rad", "wheel"),
    Channel("pinion speed", "rotational_speed", "rad/s", "pinion"),
    Channel("wheel speed", "rotational_speed", "rad/s", "wheel"),
    Channel("pinion acceleration", "angular_acceleration", "rad/s^2", "pinion"),
    Channel("wheel acceleration", "angular_acceleration", "rad/s^2", "wheel"),
    Channel("interaction force", "force", "N", "tooth flanks, from the model: no sensor measures it"),
)
"""Channels of a recording of the motion."""
FILTERED = SAMPLINGS[1]
FILTERED_SLOW = "torque, force, speeds and accelerations low-pass filtered below {:g} Hz before sampling"
INSTANTS = "torque, force, speeds and accelerations sampled as instantaneous values, without a filter"
VIBRATION = Channel("vibration", "acceleration", "m/s^2", "pinion bearing, along the line of action")


def sensors(sampling_rate_hz: float) -> tuple[Sensor, ...]:
    """Return the sensors of a recording at a sampling rate, for its rig file."""
    channels = (*CHANNELS, VIBRATION) if sampling_rate_hz >= MIN_VIBRATION_HZ else CHANNELS
    return tuple(Sensor(c.name, c.quantity, c.unit, c.position) for c in channels)


def record(
    drive: ForgingDrive,
    profiles: Schedule,
    values: ParameterValues,
    *,
    rig: Rig,
    rng: np.random.Generator,
    sampling_rate_hz: float,
    duration_s: float,
    truth: Mapping[str, Any],
) -> Recording:
    """Run the drive and measure it.

    Angles are rounded down to encoder counts after noise is added, as counters store instantaneous values. Speeds and
    accelerations have independent noise, as from separate sensors. Like torque and force they are instantaneous values,
    or filtered (`slow_channels`). Instantaneous values in continuous rotation carry a warning at slow rates: their
    spectra contain lines from above half the sampling rate.
    """
    motion_rng, vibration_rng = rng.spawn(2)
    motion = respond(drive, profiles, duration_s=duration_s, interval_s=1.0 / sampling_rate_hz)
    is_filtered = values.word("slow_channels") == FILTERED
    folds = not is_filtered and values.word("mode") == CONTINUOUS and sampling_rate_hz < MIN_VIBRATION_HZ
    true = {c.name: motion[c.name] for c in CHANNELS}
    if is_filtered:
        slow = [c.name for c in CHANNELS if c.quantity != "angle"]
        n = len(true[slow[0]])
        true |= filtered_signals(drive, profiles, slow, sampling_rate_hz=sampling_rate_hz, n_samples=n)
    rows = list(_readings(true, values, motion_rng))
    channels = list(CHANNELS)
    if sampling_rate_hz >= MIN_VIBRATION_HZ:
        rows.append(_vibration(drive, profiles, values, vibration_rng, sampling_rate_hz, len(rows[0])))
        channels.append(VIBRATION)
    return Recording(
        np.vstack(rows),
        sampling_rate_hz,
        tuple(channels),
        speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft="pinion"),
        rig=rig,
        provenance=Provenance(
            source="simulation: forging manipulator drive",
            reader="sims.forging",
            history=((FILTERED_SLOW if is_filtered else INSTANTS).format(0.5 * sampling_rate_hz),),
        ),
        truth={**truth, **_truth(motion)},
        warnings=(FOLDS.format(0.5 * sampling_rate_hz),) if folds else (),
    )


def _readings(
    true: Mapping[str, FloatArray], parameters: ParameterValues, rng: np.random.Generator
) -> list[FloatArray]:
    noise = {
        "torque": parameters.number("torque_noise_nm"),
        "angle": parameters.number("angle_noise_urad") * 1e-6,
        "rotational_speed": parameters.number("speed_noise_mrad_per_s") * 1e-3,
        "angular_acceleration": parameters.number("acceleration_noise_rad_per_s2"),
        "force": 0.0,
    }
    counts = parameters.whole("encoder_counts")
    rows = []
    for channel in CHANNELS:
        values = true[channel.name]
        gain = parameters.number("torque_gain") if channel.quantity == "torque" else 1.0
        reading: FloatArray = gain * values + noise[channel.quantity] * rng.standard_normal(len(values))
        if channel.quantity == "angle" and counts:
            step = 2.0 * pi / counts
            reading = np.floor(reading / step) * step
        rows.append(reading)
    return rows


def _vibration(
    drive: ForgingDrive,
    profiles: Schedule,
    values: ParameterValues,
    rng: np.random.Generator,
    rate_hz: float,
    n_samples: int,
) -> FloatArray:
    """Acceleration of the housing's mass under the tooth force, without reaction on the drive."""
    fine_s = 1.0 / (FINE_POINTS * rate_hz)
    chain = MeasurementChain(rate_hz, (_channel(values),), AntiAlias())
    lead = ceil(chain.lead_in_s * rate_hz) * FINE_POINTS
    lasts_s = n_samples / rate_hz + chain.anti_alias.reach_s(rate_hz) + 4.0 / rate_hz
    force = respond(drive, profiles, duration_s=lasts_s, interval_s=fine_s, signals=("interaction force",))
    shaken = _housing(np.concatenate([np.zeros(lead), force["interaction force"]]), values, fine_s)
    motion = Motion(fine_s, (PLACE,), shaken[:, None])
    measured = chain.record(motion, rng=rng, duration_s=n_samples / rate_hz, lead_in_s=lead * fine_s)
    return measured.values(VIBRATION.name)


def _housing(force_n: FloatArray, values: ParameterValues, step_s: float) -> FloatArray:
    """Apply s²/(s² + 2ζωs + ω²)/m, exact for a force that is linear between steps."""
    w, zeta = 2.0 * pi * values.number("housing_frequency_hz"), values.number("housing_damping_ratio")
    section = discrete((1.0, 0.0, 0.0), (1.0, 2.0 * zeta * w, w * w), step_s)
    return apply(section, force_n / values.number("housing_mass_kg"))


def _channel(values: ParameterValues) -> MeasuredChannel:
    return MeasuredChannel(
        VIBRATION.name,
        ModalPath({PLACE: 1.0}),
        Accelerometer(lower_limit_hz=0.5),
        background=ColouredNoise(values.number("vibration_noise_mps2")),
        position=VIBRATION.position,
    )


def _truth(motion: DriveResponse) -> dict[str, Any]:
    rows = [[None if np.isnan(value) else float(value) for value in row] for row in motion.contacts]
    return {"contacts": {"columns": list(CONTACT_COLUMNS), "rows": rows}, "solver": {"n_steps": motion.n_steps}}


# --------------------
# The simulator and the twin of a drive.
# --------------------


WITH_MEANING = tuple(name for name, each in effects().items() if each.on_drive)
"""Effects that the drive supports; for a changed load inertia set `piece_mass_kg` or `wheel_inertia_kg_m2`."""


class _DriveValues(ParameterValues):
    """Complete parameters in the form that effects read: see `sims.effects.DriveParameters`."""

    def highest(self, name: str) -> float:
        return float(parameter(PARAMETERS, name).high or 0.0)

    def gear_pair(self) -> PairGeometry:
        return gear_pair(self)


def with_effects(values: Values, settings: Sequence[EffectSetting]) -> tuple[Values, WeakTooth | None]:
    """Return the parameters with the effects applied, and the tooth weakened by a crack, if any.

    Raises
    ------
    InputError
        If an effect has no meaning here, is given twice, or its severity or options are not allowed.
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
class PreparedDrive(SimulationRequest):
    """A drive with its cycle, ready to run; its `values` are those of the healthy drive.

    Parameters
    ----------
    drive : ForgingDrive
        With its effects.
    cycle : Cycle
    changed : mapping
        Every parameter, with the effects applied.
    """

    drive: ForgingDrive
    cycle: Cycle
    changed: Values

    def profiles(self, duration_s: float) -> Schedule:
        """Profiles of torque, brake and press over a run."""
        return schedule(self.cycle, self.operation.torque_nm, duration_s)

    def truth(self) -> dict[str, Any]:
        """All inputs as plain values."""
        return {
            **super().truth(),
            "backlash_um": 2.0 * self.drive.contact.half_backlash_um,
            "stiffness_n_per_m_lambda": self.drive.contact.stiffness_n_per_m_lambda,
            "reduced_mass_kg": self.drive.reduced_mass_kg,
        }


@dataclass(frozen=True)
class ForgingManipulator(Simulator):
    """Pinion and wheel of a forging manipulator: start–stop, backlash, impacts; see `sims.forging`."""

    name: str = NAME
    title: str = "forging manipulator's drive: start–stop, backlash, impact on both flanks, stick–slip"
    parameters: tuple[Parameter, ...] = field(default=PARAMETERS, repr=False)
    effects: tuple[str, ...] = field(default=WITH_MEANING, repr=False)
    usual_sampling_rate_hz: float = field(default=1000.0, repr=False)  # a motion controller's, 1 ms

    def prepare(self, setup: SimulationSetup) -> PreparedDrive:
        """Build the drive with its effects, and its cycle."""
        request = SimulationRequest.of(NAME, PARAMETERS, setup)
        changed, weak = with_effects(request.values, request.effects)
        within(request.operation.torque_nm.largest, "torque_nm", *TORQUE_RANGE_NM, "N m")
        values = ParameterValues(changed)
        drive = build_drive(values, _constant(request.operation.speed_rpm), weak)
        return PreparedDrive(**vars(request), drive=drive, cycle=build_cycle(values), changed=changed)

    def simulate(
        self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        """Make a recording with rig and truth, starting at rest; see `sims.simulator.Simulator.simulate`.

        The operation's torque is that with the open valve, its speed the pinion speed that the flow allows (0: no
        limit). Vibration is recorded at sampling rates from 5 kHz. A stop longer than the record is an error.
        """
        within(duration_s, "duration_s", *DURATION_RANGE_S, "s")
        within(sampling_rate_hz, "sampling_rate_hz", *SAMPLING_RATE_RANGE_HZ, "Hz")
        if sampling_rate_hz * duration_s > MAX_SAMPLES:
            raise InputError(
                f"{sampling_rate_hz * duration_s:.3g} samples are too many", allowed=f"up to {MAX_SAMPLES}"
            )
        ready = self.prepare(setup)
        rig = build_rig(
            ready.drive,
            ParameterValues(ready.values),
            ready.operation,
            sensors(sampling_rate_hz),
            name=self.rig_name(ready.preset),
            sources=self.rig_sources(ready.preset),
        )
        ready.profiles(duration_s)  # raises if a stop does not fit, before anything is run
        return record(
            ready.drive,
            ready.profiles(duration_s + 1.0),
            ParameterValues(ready.changed),
            rig=rig,
            rng=rng,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s,
            truth=ready.truth(),
        )

    def check_convergence(self, setup: SimulationSetup, rng: np.random.Generator) -> ForgingConvergence:
        """Report how much shorter steps change the motion of this drive, which has no random parts."""
        del rng
        ready = self.prepare(setup)
        return check_convergence(ready.drive, ready.cycle, ready.operation.torque_nm)

    # The interface of the gap diagnosis, see `gearsig.gap.DriveSimulator`.

    def gap_effects(self) -> dict[str, GapEffect]:
        """Return the effects that have a meaning for this model."""
        known = [(effect(name), shows_in) for name, shows_in in _SHOWS_IN.items()]
        return {
            known_effect.name: GapEffect(
                known_effect.name,
                known_effect.group,
                known_effect.title,
                known_effect.severity.name,
                known_effect.severity.unit,
                shows_in=shows_in,
            )
            for known_effect, shows_in in known
        } | _WRONG_VALUES

    def drive_twin_of(self, facts: DriveFacts) -> ForgingTwin:
        """Return the drive with the rig's contact; what neither rig nor recording states is usual for its size."""
        contact, path = facts.contact, facts.path
        ratio = path.teeth[1] / path.teeth[0]
        torque_nm, friction_nm, top_rad_s = facts.motor_torque_nm, facts.load_friction_nm, facts.top_speed_rad_s
        drag_nm = 0.05 * torque_nm
        needed = min((drag_nm + friction_nm / ratio) / torque_nm, 0.95)
        limit_rpm = top_rad_s / (1.0 - SPEED_BAND * needed) * 30.0 / pi
        parameters: dict[str, ParameterValue] = {
            "teeth_driver": path.teeth[0],
            "teeth_driven": path.teeth[1],
            "module_mm": facts.module_mm,
            "contact_ratio": min(path.contact_ratio, 1.84),
            "mesh_phase": contact.mesh_phase,
            "mesh_ramp": min(max(contact.mesh_ramp, MESH_RAMP_RANGE[0]), MESH_RAMP_RANGE[1]),
            "stiffness_n_per_m_lambda": contact.stiffness_n_per_m_lambda,
            "exponent": contact.exponent,
            "restitution": max(contact.restitution, 0.05),
            "damping_law": contact.damping_law,
            "impact_speed_floor_mps": contact.impact_speed_floor_mps,
            "half_backlash_um": contact.half_backlash_um,
            "friction_coefficient": contact.friction_coefficient,
            "motor_inertia_kg_m2": contact.motor_inertia_kg_m2,
            "pinion_inertia_kg_m2": max(contact.driver_inertia_kg_m2, 1e-4),
            "wheel_inertia_kg_m2": contact.driven_inertia_kg_m2 or 0.0,
            "piece_mass_kg": 0.0,
            "on_s": facts.on_s,
            "off_s": facts.off_s,
            "valve_rise_s": 0.02,
            "brake_nm": facts.brake_torque_nm,
            "press_nm": 0.0,
            "motor_speed_band": SPEED_BAND,
            "drag_nm": drag_nm,
            **NOISE_FREE,
            "drag_viscous_nm_s_per_rad": 0.002 * torque_nm,
            "load_friction_nm": 0.95 * friction_nm,
            "load_viscous_nm_s_per_rad": 0.1 * friction_nm / (top_rad_s / ratio),
        }
        rounded = {k: v if isinstance(v, str) else float(f"{v:.6g}") for k, v in parameters.items()}
        return ForgingTwin(rounded, OperatingCondition(limit_rpm, torque_nm))


def _constant(speed_rpm: Profile) -> float:
    """Return the speed limit, a single number, as a valve is set once."""
    if len(speed_rpm.values) > 1 and float(speed_rpm.values.max() - speed_rpm.values.min()) > 0.0:
        raise InputError("speed_rpm varies", allowed="one speed that the flow allows", remedy="vary --torque instead")
    return within(float(speed_rpm.values[0]), "speed_rpm", *SPEED_RANGE_RPM, "rpm")


# --------------------
# The twin for the gap diagnosis of start–stop machines: a drive adapted to a rig and its operation.
# --------------------


N_CYCLES = 2
SAMPLING_RATE_HZ = 1000.0
SEED = 11
SPEED_BAND = 0.3
NOISE_FREE: dict[str, ParameterValue] = {
    "encoder_counts": 0,
    "angle_noise_urad": 0.0,
    "speed_noise_mrad_per_s": 0.0,
    "acceleration_noise_rad_per_s2": 0.0,
    "torque_noise_nm": 0.0,
}
"""The change due to an effect is needed without noise."""

Parameters = Mapping[str, ParameterValue]

_SHOWS_IN = {
    "backlash": ("play", "impact"),
    "tooth_wear": ("play", "curve"),
    "sliding_friction": ("flank_friction",),
    "root_crack": ("tooth",),
    "torque_ripple": ("ripple",),
}
"""Where effects of the catalogue show in starts and stops (`gearsig.gap.start_stop.NAMES`); `shows_in` of an effect
refers to vibration."""

_WRONG_VALUES = {
    name: GapEffect(name, group, title, "added_percent", "%", signature, shows_in)
    for name, group, title, signature, shows_in in (
        (
            "load_inertia",
            "drive and load",
            "changed inertia of the load",
            "torque against acceleration of the driven gear, in starts and stops",
            ("inertia",),
        ),
        (
            "load_friction",
            "drive and load",
            "more friction in the load's bearings",
            "torque that turns the load without accelerating it",
            ("load_friction",),
        ),
        (
            "torque_gain",
            "measurement",
            "a torque sensor that reads too high or too low",
            "inertia and friction of the load seem to change by the same factor",
            ("inertia", "load_friction", "deflection"),
        ),
    )
}
"""Effects that are a wrong value of a parameter and not in the catalogue."""


@dataclass(frozen=True)
class ForgingTwin:
    """A simulated drive built from a rig and operated as in a recording; see `gearsig.gap.DriveTwin`.

    Parameters
    ----------
    parameters : mapping
        Of `sims.forging`.
    point : OperatingCondition
        Motor torque with the open valve; the speed that the flow allows.
    """

    parameters: Parameters
    point: OperatingCondition

    def run(self, added: Sequence[AddedEffect] = ()) -> Recording:
        """Return a recording of `N_CYCLES` cycles."""
        parameters = self.parameters
        for setting in added:
            parameters = _with_wrong_value(setting, parameters)
        operation = Operation.steady(self.point.speed_rpm, self.point.torque_nm)
        return ForgingManipulator().simulate(
            SimulationSetup("", parameters, _settings(added), operation),
            np.random.default_rng(SEED),
            sampling_rate_hz=SAMPLING_RATE_HZ,
            duration_s=N_CYCLES * (float(parameters["on_s"]) + float(parameters["off_s"])) - 1e-6,
        )

    def at_torque(self, factor: float) -> ForgingTwin:
        """Return the drive with the motor torque multiplied by `factor`, which also changes its top speed."""
        return replace(self, point=replace(self.point, torque_nm=self.point.torque_nm * factor))

    def worn_curve_um(self, deflection_um: float, depth_um: float, n_places: int) -> FloatArray:
        """Return how much further the driver turns with worn teeth over the mesh cycle, in µm, (n_places,).

        A pair whose flank has lost h comes into contact later: Σ (δ − h_i)₊^λ = n g^λ at equal load, g the deflection
        of n healthy pairs. Where two pairs share the load, the less worn one dominates. Wear is that of the driver's
        teeth, by Archard's law (`sims.mesh.wear_profile`).

        Parameters
        ----------
        deflection_um : float
            Of one pair under the usual load; 20 µm if unknown.
        depth_um : float
            Maximum depth of wear.
        n_places : int
        """
        module = float(self.parameters["module_mm"])
        teeth = int(float(self.parameters["teeth_driver"])), int(float(self.parameters["teeth_driven"]))
        driver, driven = (GearGeometry(z, module, 20.0, face_width_mm=16.0 * module) for z in teeth)
        pair = PairGeometry(driver, driven)
        path = standard_path(teeth, 1e-3 * module, radians(20.0))
        u = (np.arange(n_places) + 0.5) / n_places
        positions = np.stack([u, u + 1.0])
        touches = positions < path.contact_ratio
        worn = depth_um * np.stack([wear_profile(pair, 1, 1e3 * path.driver_lever_m(row)) for row in positions])
        exponent = float(self.parameters["exponent"])
        g = deflection_um if np.isfinite(deflection_um) and deflection_um > 0.0 else 20.0
        n = np.sum(touches, axis=0)
        load = g**exponent  # of one pair; with two the compression is less
        healthy = g / n ** (1.0 / exponent)
        low, high = np.zeros(n_places), healthy + depth_um
        for _ in range(40):  # bisections: 1e-12 of the first interval
            middle = 0.5 * (low + high)
            carried = np.sum(np.where(touches, np.maximum(middle - worn, 0.0) ** exponent, 0.0), axis=0)
            low, high = np.where(carried < load, middle, low), np.where(carried < load, high, middle)
        curve: FloatArray = 0.5 * (low + high) - healthy
        return curve

    def crack_stiffness_loss(self, crack: AddedEffect) -> float:
        """Return the fraction of its stiffness that a cracked tooth loses."""
        _, weak = with_effects(complete_values(PARAMETERS, self.parameters), _settings((crack,)))
        assert weak is not None  # noqa: S101 - a crack of some depth makes a tooth weak
        return float(weak.loss)

    def preset_toml(self, added: AddedEffect, notes: Sequence[str]) -> str:
        """Return the drive as a preset file that `gearsig simulate forging --preset FILE` runs."""
        torque_nm = self.point.torque_nm
        if added.name == "torque_gain":  # the motor torque was measured with the same wrong gain
            torque_nm /= 1.0 + 0.01 * added.severity
        preset = Preset(
            "",
            NAME,
            "Forging drive adapted to a rig and to its starts and stops",
            ("the rig file, and the torque and motion of the recording",),
            ("times of valve and brake, friction of the load, noise: from the recording, or usual values",),
            ("press blows, elastic shafts, pitch errors",),
            dict(_with_wrong_value(added, self.parameters)),  # type: ignore[arg-type]  # read only
            round(self.point.speed_rpm, 2),
            round(torque_nm, 3),
            _settings((added,)),
        )
        return preset_text(preset, notes)


def _settings(added: Sequence[AddedEffect]) -> tuple[EffectSetting, ...]:
    """Return the settings of catalogue effects, without those that are a wrong value of a parameter."""
    return tuple(
        EffectSetting(setting.name, setting.severity, dict(setting.options))
        for setting in added
        if setting.name not in _WRONG_VALUES
    )


def _with_wrong_value(added: AddedEffect, parameters: Parameters) -> Parameters:
    """Return the parameters with one wrong value; effects of the catalogue leave them unchanged."""
    factor = 1.0 + 0.01 * added.severity
    if added.name == "load_inertia":
        return {**parameters, "wheel_inertia_kg_m2": float(parameters["wheel_inertia_kg_m2"]) * factor}
    if added.name == "load_friction":
        names = ("load_friction_nm", "load_viscous_nm_s_per_rad")
        return {**parameters, **{key: float(parameters[key]) * factor for key in names}}
    if added.name == "torque_gain":  # values taken from the recording are wrong as well
        read = ("brake_nm", "drag_nm", "drag_viscous_nm_s_per_rad")
        return {**parameters, **{key: float(parameters[key]) / factor for key in read}, "torque_gain": factor}
    return parameters
