"""Gearboxes drawn at random for the calibration of crack severity, and for its check."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from sims.mesh import GearGeometry
from sims.mesh.crack import deepest_crack_mm
from sims.simulator import ParameterValue

CALIBRATION_MODULES_MM = (1.5, 2.0, 2.5, 3.0, 4.0)
OTHER_MODULES_MM = (1.75, 2.25, 2.75, 3.5)
"""Modules of the rigs for the check: none is a module of the calibration."""

DEPTHS_MM = (0.3, 4.0)
DEPTHS_OF_THE_CHECK_MM = (0.5, 4.0)
DEEPEST_SHARE = 0.9
"""Of the deepest crack that the tooth model allows."""

MESH_HZ = (180.0, 1600.0)
LEAST_REVOLUTIONS = 15
"""Of the slower shaft."""

SOUND_SHARE, SOUND_SHARE_OF_THE_CHECK = 0.2, 0.3
"""Rigs that get no crack."""


@dataclass(frozen=True)
class HousingMode:
    """One mode between bearings and sensors: shape at bearings 1 and 3, where the sensors sit, and at all four.

    The bearings move it along `direction_deg` from the x axis, across the line of action; None: along the sensors' own.
    """

    frequency_hz: float
    damping_ratio: float
    gain: float
    shape: tuple[float, float, float, float]
    direction_deg: float | None = None


@dataclass(frozen=True)
class DrawnRig:
    """A gearbox with its operation, and the crack that it gets.

    Parameters
    ----------
    parameters : mapping
        Of the simulator "cracked", without the crack.
    modes : tuple of HousingMode
    sensor_gain : float
        Of everything between bearing and recording: the estimator must not need it.
    speed_rpm, torque_nm : float
    duration_s : float
    gear : str
        "driver" or "driven": which gets the crack.
    tooth : int
        From 0, as the simulator counts.
    depth_mm : float
        0: none.
    seed : int
        Of roughness and noise.
    """

    parameters: Mapping[str, ParameterValue]
    modes: tuple[HousingMode, ...]
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
        """Of driver and driven gear."""
        return int(self.parameters["teeth_driver"]), int(self.parameters["teeth_driven"])


def is_for_the_check(teeth: tuple[int, int]) -> bool:
    """Whether a pair of teeth belongs to the rigs of the check; the calibration never sees it."""
    return sum(teeth) % 3 == 0


def draw_rig(rng: np.random.Generator, *, for_the_check: bool, even: bool = False) -> DrawnRig:
    """Draw a gearbox; those of the check have other teeth and modules than those of the calibration.

    Parameters
    ----------
    rng : numpy.random.Generator
    for_the_check : bool
    even : bool
        Teeth that hardly differ, as those of the demonstration machines and of master gears; and lower loads.
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
    least, most = DEPTHS_OF_THE_CHECK_MM if for_the_check else DEPTHS_MM
    depth = rng.uniform(least, min(most, DEEPEST_SHARE * deepest_crack_mm(GearGeometry(z, module))))
    sound = rng.uniform() < (SOUND_SHARE_OF_THE_CHECK if for_the_check else SOUND_SHARE)
    parameters = _gears(rng, teeth, module, width, load) | _rest(rng, module, teeth)
    if even:
        parameters |= _even_teeth(rng)
        torque *= rng.uniform(0.4, 1.0)
    return DrawnRig(
        parameters,
        _modes(rng),
        log_uniform(rng, 0.3, 3.0),
        speed,
        torque,
        LEAST_REVOLUTIONS * max(1.0, teeth[1] / teeth[0]) * 60.0 / speed,
        gear,
        int(rng.integers(z)),
        0.0 if sound else float(depth),
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
    deflection_um = load * module / 14.0  # at 14 N/(mm µm), the usual stiffness of a pair of steel gears
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


def _rest(rng: np.random.Generator, module: float, teeth: tuple[int, int]) -> dict[str, ParameterValue]:
    """Bearings, shafts and rotors; larger gears sit in larger machines."""
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


def _modes(rng: np.random.Generator) -> tuple[HousingMode, ...]:
    n = int(rng.integers(2, 6))
    return tuple(
        HousingMode(
            log_uniform(rng, 600.0, 8000.0),
            log_uniform(rng, 0.01, 0.05),
            rng.uniform(0.02, 0.08),
            tuple(float(s) for s in rng.uniform(-1.0, 1.0, 4)),  # type: ignore[arg-type]  # four of them
        )
        for _ in range(n)
    )


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw with even chance per decade."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))
