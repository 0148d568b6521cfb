"""Recordings of random gearboxes, for crack severity and its check, and for the population of the gap diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import cos, radians, sin
from typing import Any

import numpy as np

from gearsig.recording import Recording
from sims.cracked import NAME as CRACKED
from sims.cracked import CrackedPair, default_step_s, simulate_with_motion
from sims.effects import EffectSetting, with_effects
from sims.gear_pair import MeasuredRun, ReadyPair, build_rig, draw_roughness
from sims.machine import Machine, Operation, log_uniform
from sims.measure import MeasuredChannel, ModalPath, PathMode
from sims.mesh import GearGeometry, deepest_crack_mm
from sims.reduced_fe import (
    TWIN_STEP_S,
    PreparedPair,
    ReducedPair,
    simulate_pair,
    twin_parameters,
)
from sims.simulator import ParameterValue, SimulationSetup

CALIBRATION_MODULES_MM = (1.5, 2.0, 2.5, 3.0, 4.0)
OTHER_MODULES_MM = (1.75, 2.25, 2.75, 3.5)
"""Modules of the rigs for the check; the calibration uses none of them."""

DEPTHS_MM = (0.3, 4.0)
DEPTHS_OF_THE_CHECK_MM = (0.5, 4.0)
DEEPEST_SHARE = 0.9
"""Maximum depth, as a share of the deepest crack that the tooth model allows."""

MESH_HZ = (180.0, 1600.0)
MIN_REVOLUTIONS = 15
"""Minimum number of revolutions of the slower shaft."""

HEALTHY_SHARE, HEALTHY_SHARE_OF_THE_CHECK = 0.2, 0.3
"""Shares of rigs without a crack."""


@dataclass(frozen=True)
class DrawnHousingMode:
    """One mode between bearings and sensors: shape at bearings 1 and 3, where the sensors are, and at all four.

    The bearings excite it along `direction_deg` from the x axis, across the line of action; None: along the sensors.
    """

    frequency_hz: float
    damping_ratio: float
    gain: float
    shape: tuple[float, float, float, float]
    direction_deg: float | None = None


@dataclass(frozen=True)
class DrawnRig:
    """A random gearbox with its operating point and its crack.

    Parameters
    ----------
    parameters : mapping
        Parameters of the simulator "cracked", without the crack.
    modes : tuple of DrawnHousingMode
    sensor_gain : float
        Gain of everything between bearing and recording, which the estimator must not need.
    speed_rpm, torque_nm : float
    duration_s : float
    gear : str
        The cracked gear, "driver" or "driven".
    tooth : int
        Number from 0, as the simulator counts.
    depth_mm : float
        Depth of the crack; 0: none.
    seed : int
        Seed of roughness and noise.
    """

    parameters: Mapping[str, ParameterValue]
    modes: tuple[DrawnHousingMode, ...]
    sensor_gain: float
    speed_rpm: float
    torque_nm: float
    duration_s: float
    gear: str
    tooth: int
    depth_mm: float
    seed: int

    @property
    def teeth(self) -> tuple[int, int]:
        """Tooth counts of driver and driven gear."""
        return int(self.parameters["teeth_driver"]), int(self.parameters["teeth_driven"])


def is_for_the_check(teeth: tuple[int, int]) -> bool:
    """Return whether a pair of tooth counts belongs to the rigs of the check, which the calibration never sees."""
    return sum(teeth) % 3 == 0


def draw_rig(rng: np.random.Generator, *, for_the_check: bool, even: bool = False) -> DrawnRig:
    """Draw a gearbox; tooth counts and modules of the check differ from those of the calibration.

    Parameters
    ----------
    rng : numpy.random.Generator
    for_the_check : bool
    even : bool
        Teeth that hardly differ, like those of demonstration machines and master gears, and lower loads.
    """
    teeth = _teeth(rng, for_the_check)
    module = float(rng.choice(OTHER_MODULES_MM if for_the_check else CALIBRATION_MODULES_MM))
    width = module * rng.uniform(6.0, 12.0)
    pitch_radius_m = 0.5e-3 * module * teeth[0]
    load = log_uniform(rng, 20.0, 120.0)  # N/mm², force per face width and module
    torque = load * width * module * pitch_radius_m
    speed = _speed_rpm(rng, teeth)
    gear = str(rng.choice(("driver", "driven")))
    z = teeth[0] if gear == "driver" else teeth[1]
    shallowest, deepest = DEPTHS_OF_THE_CHECK_MM if for_the_check else DEPTHS_MM
    depth = rng.uniform(shallowest, min(deepest, DEEPEST_SHARE * deepest_crack_mm(GearGeometry(z, module))))
    healthy = rng.uniform() < (HEALTHY_SHARE_OF_THE_CHECK if for_the_check else HEALTHY_SHARE)
    parameters = _gears(rng, teeth, module, width, load) | _further_parameters(rng, module, teeth)
    if even:
        parameters |= _even_teeth(rng)
        torque *= rng.uniform(0.4, 1.0)
    return DrawnRig(
        parameters,
        _modes(rng),
        log_uniform(rng, 0.3, 3.0),
        speed,
        torque,
        MIN_REVOLUTIONS * max(1.0, teeth[1] / teeth[0]) * 60.0 / speed,
        gear,
        int(rng.integers(z)),
        0.0 if healthy else float(depth),
        int(rng.integers(2**31)),
    )


def _teeth(rng: np.random.Generator, for_the_check: bool) -> tuple[int, int]:
    while True:
        first = int(rng.integers(18, 56))
        second = round(first * rng.uniform(0.8, 2.6))
        if 18 <= second <= 100 and is_for_the_check((first, second)) == for_the_check:
            return first, second


def _speed_rpm(rng: np.random.Generator, teeth: tuple[int, int]) -> float:
    while True:
        speed = log_uniform(rng, 500.0, 3000.0)
        if MESH_HZ[0] <= speed / 60.0 * teeth[0] <= MESH_HZ[1]:
            return speed


def _gears(
    rng: np.random.Generator, teeth: tuple[int, int], module: float, width: float, load: float
) -> dict[str, ParameterValue]:
    deflection_um = load * module / 14.0  # 14 N/(mm µm): typical stiffness of a pair of steel gears
    relief = 0.0 if rng.uniform() < 0.25 else deflection_um * rng.uniform(0.2, 1.4)
    return {
        "teeth_driver": teeth[0],
        "teeth_driven": teeth[1],
        "module_mm": module,
        "face_width_mm": width,
        "bore_radius_driver_mm": 0.35 * module * (0.5 * teeth[0] - 1.25),
        "bore_radius_driven_mm": 0.35 * module * (0.5 * teeth[1] - 1.25),
        "contact_law": str(rng.choice(("linear", "load-dependent"))),
        "mesh_damping_ratio": rng.uniform(0.03, 0.10),
        "half_backlash_um": rng.uniform(20.0, 80.0),
        "tip_relief_um": relief,
        "tip_relief_length_mm": module * rng.uniform(0.7, 1.5),
        "pitch_deviation_um": log_uniform(rng, 0.1, 1.0),
        "tolerance_seed": int(rng.integers(10**6)),
        "roughness_um": log_uniform(rng, 0.03, 0.25),
        "viscosity_cp": rng.uniform(10.0, 40.0),
        "runout_driver_um": rng.uniform(0.0, 8.0),
        "runout_driven_um": rng.uniform(0.0, 8.0),
        "runout_angle_driver_deg": rng.uniform(0.0, 360.0),
        "runout_angle_driven_deg": rng.uniform(0.0, 360.0),
        "unbalance_driver_g_mm": rng.uniform(0.0, 30.0),
        "unbalance_driven_g_mm": rng.uniform(0.0, 50.0),
        "unbalance_angle_driver_deg": rng.uniform(0.0, 360.0),
        "unbalance_angle_driven_deg": rng.uniform(0.0, 360.0),
    }


def _even_teeth(rng: np.random.Generator) -> dict[str, ParameterValue]:
    locked_to = str(rng.choice(("time", "flank")))
    return {
        "pitch_deviation_um": log_uniform(rng, 0.01, 0.1),
        "roughness_locked_to": locked_to,
        "roughness_um": log_uniform(rng, 0.05, 0.5) if locked_to == "time" else log_uniform(rng, 0.005, 0.05),
        "runout_driver_um": rng.uniform(0.0, 2.0),
        "runout_driven_um": rng.uniform(0.0, 2.0),
    }


def _further_parameters(rng: np.random.Generator, module: float, teeth: tuple[int, int]) -> dict[str, ParameterValue]:
    """Draw bearings, shafts and rotors; larger gears belong to larger machines."""
    size = module / 2.0
    inertia = 2e-3 * size**4 * (sum(teeth) / 80.0) ** 3
    return {
        "bearing_stiffness_n_per_m": size * log_uniform(rng, 7e7, 6e8),
        "bearing_damping_n_s_per_m": size * log_uniform(rng, 500.0, 3000.0),
        "bearing_mass_kg": size**2 * log_uniform(rng, 0.3, 1.5),
        "bending_stiffness_n_per_m": size * log_uniform(rng, 7e7, 1e9),
        "bending_damping_n_s_per_m": size * log_uniform(rng, 200.0, 2000.0),
        "torsional_stiffness_nm_per_rad": size**3 * log_uniform(rng, 2e3, 6e4),
        "torsional_damping_nm_s_per_rad": size**3 * log_uniform(rng, 0.4, 6.0),
        "rotor_inertia_input_kg_m2": inertia * log_uniform(rng, 0.5, 10.0),
        "rotor_inertia_output_kg_m2": inertia * log_uniform(rng, 0.5, 10.0),
        "governor_nm_s_per_rad": 1.0 * size**4 * log_uniform(rng, 0.5, 5.0),
        "noise_mps2": log_uniform(rng, 0.02, 0.5),
        "noise_slope": rng.uniform(0.0, 1.0),
        "sensor_range_mps2": 5000.0,
    }


def _modes(rng: np.random.Generator) -> tuple[DrawnHousingMode, ...]:
    n = int(rng.integers(2, 6))
    return tuple(
        DrawnHousingMode(
            log_uniform(rng, 600.0, 8000.0),
            log_uniform(rng, 0.01, 0.05),
            rng.uniform(0.02, 0.08),
            tuple(float(s) for s in rng.uniform(-1.0, 1.0, 4)),  # type: ignore[arg-type]  # four of them
        )
        for _ in range(n)
    )


# --------------------
# Recording of a random gearbox, healthy or with its crack.
# --------------------


SAMPLING_RATE_HZ = 20480.0
MAX_LEAD_REV = 8


def simulate_rig(
    drawn: DrawnRig,
    *,
    effect: str = "root_crack",
    severity: float | None = None,
    run: int = 0,
    speed_factor: float = 1.0,
    torque_factor: float = 1.0,
    flanks: int = 0,
    options: Mapping[str, float | str] | None = None,
    further: Sequence[EffectSetting] = (),
    step_angle_rad: float | None = None,
    model: str = CRACKED,
) -> Recording:
    """Simulate one recording.

    Parameters
    ----------
    drawn : DrawnRig
    effect : str
    severity : float or None
        None: the drawn depth of the crack; 0: a healthy gearbox.
    run : int
        Another run has different noise and starts at another angle of the driven shaft, with the same flanks.
    speed_factor, torque_factor : float
    flanks : int
        Another number draws different flank profiles.
    options : mapping or None
        Options of the effect, in addition to or instead of the drawn gear and tooth.
    further : sequence of EffectSetting
        Additional effects.
    step_angle_rad : float or None
        For "cracked": time step times the maximum angular eigenfrequency; None: the simulator's default, finer than
        needed for floors.
    model : str
        "cracked" or "reduced-fe".
    """
    operation = Operation.steady(drawn.speed_rpm * speed_factor, drawn.torque_nm * torque_factor)
    size = drawn.depth_mm if severity is None else severity
    chosen = {"gear": drawn.gear, "tooth": drawn.tooth + 1.0, **(options or {})}
    settings = [EffectSetting(effect, size, chosen)] if size > 0 else []
    draws = np.random.default_rng(drawn.seed)
    ready = _prepared(model, drawn, operation, draws)
    machine = with_effects(_with_path(ready.machine, drawn), [*settings, *further], draws)
    machine = _with_fixed_flanks(machine, [drawn.seed, 77 + flanks])
    rng, lead_rev = _random_start(drawn, run)
    lead_s = lead_rev * 60.0 / drawn.speed_rpm
    measured: MeasuredRun[Any] = MeasuredRun(
        rng,
        SAMPLING_RATE_HZ,
        drawn.duration_s + (lead_s if run else 0.0),
        build_rig(machine, operation, name="drawn"),
        {"depth_mm": size, "effect": effect if size else "", **chosen},
    )
    if isinstance(ready, PreparedPair):
        pair = replace(ready.pair, machine=machine)
        recording, _ = simulate_pair(pair, operation, replace(measured, step_s=TWIN_STEP_S))
    else:
        step_s = None if step_angle_rad is None else default_step_s(machine, operation, step_angle_rad)
        recording, _ = simulate_with_motion(machine, operation, replace(measured, step_s=step_s))
    return _cut(recording, round(lead_s * SAMPLING_RATE_HZ)) if run else recording


def _prepared(model: str, drawn: DrawnRig, operation: Operation, rng: np.random.Generator) -> ReadyPair | PreparedPair:
    """Return the healthy machine; finite-element gears are full discs with the mesh used for a twin."""
    if model == CRACKED:
        setup = SimulationSetup("", drawn.parameters, (), operation)
        return CrackedPair().prepare(setup, rng, sampling_rate_hz=SAMPLING_RATE_HZ)
    values = twin_parameters(drawn.parameters, drawn.teeth) | {"roughness_locked_to": "flank"}
    return ReducedPair().prepare(SimulationSetup("", values, (), operation), rng, sampling_rate_hz=SAMPLING_RATE_HZ)


def turns_before(drawn: DrawnRig, run: int) -> int:
    """Return the whole revolutions of the driver that a recording omits at its beginning."""
    return _random_start(drawn, run)[1] if run else 0


def _random_start(drawn: DrawnRig, run: int) -> tuple[np.random.Generator, int]:
    """Return a run's random generator and its first draw: the whole revolutions before the recording."""
    rng = np.random.default_rng([drawn.seed, run])
    return rng, int(rng.integers(0, MAX_LEAD_REV))


def _with_fixed_flanks(machine: Machine, seed: list[int]) -> Machine:
    """Draw the flank profiles now: they belong to the gears and are the same in each run."""
    if machine.roughness.locked_to != "flank":
        return machine
    machine, _ = draw_roughness(machine, np.random.default_rng(seed))
    return replace(machine, roughness=replace(machine.roughness, locked_to="none"))


def _with_path(machine: Machine, drawn: DrawnRig) -> Machine:
    """Replace the housing modes by the drawn ones; the sensors stay at bearings 1 and 3."""
    channels = tuple(
        _with_modes(channel, bearing, drawn) for channel, bearing in zip(machine.chain.channels, (1, 3), strict=True)
    )
    return replace(machine, chain=replace(machine.chain, channels=channels))


def _with_modes(channel: MeasuredChannel, bearing: int, drawn: DrawnRig) -> MeasuredChannel:
    gain = drawn.sensor_gain
    channel_direct = tuple(channel.path.direct[f"bearing {bearing} {axis}"] for axis in "xy")
    modes = tuple(
        PathMode(
            mode.frequency_hz,
            mode.damping_ratio,
            {
                f"bearing {i + 1} {axis} yield": gain * mode.gain * mode.shape[bearing - 1] * mode.shape[i] * direction
                for i in range(4)
                for axis, direction in zip("xy", _direction(mode, channel_direct), strict=True)
            },
        )
        for mode in drawn.modes
    )
    direct = {name: gain * value for name, value in channel.path.direct.items()}
    return replace(channel, path=ModalPath(direct, modes))


def _direction(mode: DrawnHousingMode, of_the_sensor: tuple[float, ...]) -> tuple[float, ...]:
    """Return the components of a bearing's x and y that excite a mode."""
    if mode.direction_deg is None:
        return of_the_sensor
    phi = radians(mode.direction_deg)
    return cos(phi), sin(phi)


def _cut(recording: Recording, first: int) -> Recording:
    return replace(recording, samples=recording.samples[:, first:])
