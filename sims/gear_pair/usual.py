"""Parameters of a pair of which only the rig's data are known: the rest is usual for its size.

Middles of the ranges from which gearboxes for calibrations are drawn. They are plausible, not measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt, tan
from typing import Any

import numpy as np

from gearsig.errors import RefusalError
from gearsig.rig.types import Rig
from sims.gear_pair.installed import HousingMode
from sims.simulator import ParameterValue

USUAL_LOAD_N_PER_MM2 = 50.0
"""Force per face width and module of a pair whose torque is not known; rated gears carry 20 to 120."""
LARGEST_LOAD_N_PER_MM2 = 500.0
"""Bends a tooth's root, with a form factor of 3, by 1500 N/mm²: more than hardened steel stands."""
USUAL_WIDTH_MODULES = 10.0
USUAL_MESH_HZ = 540.0
"""Mesh frequency of a pair whose speed is not known."""
STIFFNESS_N_PER_MM_UM = 14.0
"""Usual stiffness of a pair of steel gears per face width."""
RELIEF_SHARE, RELIEF_LENGTH_MODULES = 0.8, 1.1
"""Tip relief over the deflection under the nominal load; its length along the line of action."""
PITCH_RMS_SHARE, RUNOUT_SHARE = 0.1, 0.3
"""A ground gear's rms pitch deviation over f_pt, its eccentricity over F_r: tolerances of class 5 of ISO 1328."""
BODY_KG, MOUNTS_HZ, MOUNTS_DAMPING = 40.0, 6.0, 0.3
"""A housing with its bed, of a machine of size 1; below its mounts' frequency nothing that turns is slow enough."""
BODY_SHAPES = ((1.0, 1.0, 1.0, 1.0), (1.0, -1.0, 1.0, -1.0))
"""Heave and pitch of that housing at bearings 1 to 4, the first two at the ends of one shaft."""
UNBALANCE_UM = 30.0
"""Offset of the centre of mass; 40 um are balance grade G 6.3 at 1500 rpm."""
COUPLING_BENDING_SHARE = 0.01
"""A coupling's bending stiffness over the torsional one of shaft and coupling: catalogues have 0.002 (steel discs) to
0.05 (elastomer)."""


@dataclass(frozen=True)
class Nominal:
    """What a rig says of its pair, completed by what is usual.

    Parameters
    ----------
    teeth : (int, int)
    module_mm, face_width_mm, pressure_angle_deg : float
    speed_rpm, torque_nm : float
        Of the driver.
    assumed : tuple of str
        What the rig does not say.
    """

    teeth: tuple[int, int]
    module_mm: float
    face_width_mm: float
    pressure_angle_deg: float
    speed_rpm: float
    torque_nm: float
    assumed: tuple[str, ...] = ()

    @property
    def size(self) -> float:
        """Of the machine, 1 for module 2."""
        return self.module_mm / 2.0

    @property
    def pitch_diameters_mm(self) -> tuple[float, float]:
        """Of driver and driven gear."""
        return self.module_mm * self.teeth[0], self.module_mm * self.teeth[1]

    @property
    def mesh_force_n(self) -> float:
        """Static force between the teeth, tangential."""
        return 2e3 * self.torque_nm / self.pitch_diameters_mm[0]

    @property
    def deflection_um(self) -> float:
        """Of the teeth under the nominal load."""
        return self.mesh_force_n / self.face_width_mm / STIFFNESS_N_PER_MM_UM

    @property
    def mesh_hz(self) -> float:
        """Tooth passings per second."""
        return self.speed_rpm / 60.0 * self.teeth[0]


def nominal_of(rig: Rig) -> Nominal:
    """Return what a rig says of its only pair.

    Raises
    ------
    RefusalError
        If there is no pair or more than one, or if teeth or module are not known.
    """
    if len(rig.pairs) != 1:
        have = "no gear pair" if not rig.pairs else f"{len(rig.pairs)} gear pairs"
        raise RefusalError(f"the rig has {have}; the model has one", remedy="describe one pair in the rig file")
    pair = rig.pairs[0]
    missing = [name for name in ("driver_teeth", "driven_teeth", "module_mm") if getattr(pair, name) is None]
    if missing or not (pair.driver_teeth and pair.driven_teeth and pair.module_mm):
        raise RefusalError(
            f"{', '.join(missing)} of pair {pair.name!r} must be known for a model of it",
            remedy="complete the rig file",
        )
    teeth, module = (pair.driver_teeth, pair.driven_teeth), pair.module_mm
    width = pair.face_width_mm or USUAL_WIDTH_MODULES * module
    torque, speed = rig.nominal_torque_nm(pair.driver), rig.nominal_speed_rpm(pair.driver)
    largest_nm = LARGEST_LOAD_N_PER_MM2 * width * module * 0.5e-3 * module * teeth[0]
    if torque and abs(torque) > largest_nm:
        raise RefusalError(
            f"{torque:g} N·m on shaft {pair.driver!r} would break teeth of module {module:g} mm, {width:g} mm wide",
            remedy=f"state the torque in N·m; up to {largest_nm:.3g} can be",
        )
    told = {
        "face_width_mm": pair.face_width_mm,
        "pressure_angle_deg": pair.pressure_angle_deg,
        "speed_rpm": speed,
        "torque_nm": torque,
    }
    return Nominal(
        teeth,
        module,
        width,
        pair.pressure_angle_deg or 20.0,
        speed or 60.0 * USUAL_MESH_HZ / teeth[0],
        torque or USUAL_LOAD_N_PER_MM2 * width * module * 0.5e-3 * module * teeth[0],
        tuple(name for name, value in told.items() if not value),
    )


def usual_parameters(nominal: Nominal) -> dict[str, ParameterValue]:
    """Return the parameters of the model "cracked" that do not depend on the specimen."""
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
    """Return what differs between machines of one drawing: tolerances, half to twice the usual, and their places."""
    found: dict[str, ParameterValue] = {"tolerance_seed": int(rng.integers(10**6))}
    widest = max(nominal.pitch_diameters_mm)
    found["pitch_deviation_um"] = PITCH_RMS_SHARE * pitch_tolerance_um(nominal.module_mm, widest) * _spread(rng)
    for side, name in enumerate(("driver", "driven")):
        diameter = nominal.pitch_diameters_mm[side]
        found[f"runout_{name}_um"] = RUNOUT_SHARE * runout_tolerance_um(nominal.module_mm, diameter) * _spread(rng)
        found[f"unbalance_{name}_g_mm"] = UNBALANCE_UM * usual_mass_kg(nominal, side) * _spread(rng)
        for what in ("runout", "unbalance"):
            found[f"{what}_angle_{name}_deg"] = float(rng.uniform(0.0, 360.0))
    return found


def usual_housing(rng: np.random.Generator) -> tuple[HousingMode, ...]:
    """Draw the modes of a housing that nobody has measured."""
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
    """Return the housing as a rigid body on soft mounts, as which it answers to a shaft's low orders: heave and pitch.

    Above the mounts' frequency a = Σ F/M; with F = k x the force of a bearing whose acceleration is −ω² x, that is a
    mode of static gain k/(M ω₀²). On rigid ground a machine shakes some 50 dB less at 25 Hz. A pair of opposite forces
    on a shaft's two bearings, as a bending moment makes, leaves the sum nothing and turns the body: at arms ±l/2,
    a = ±(l/2) Σ ±F (l/2)/J with J = M i². A block 1.5 l long and l high has i = 0.52 l, here l/2: the same gain.

    Source: H. Himelblau and S. Rubin, Vibration of a resiliently supported rigid body, in *Harris' Shock and Vibration
    Handbook*.
    """
    stiffness = float(usual_parameters(nominal)["bearing_stiffness_n_per_m"])
    gain = body_gain(stiffness, BODY_KG * nominal.size**2, MOUNTS_HZ)
    return tuple(HousingMode(MOUNTS_HZ, MOUNTS_DAMPING, gain, shape) for shape in BODY_SHAPES)


def body_gain(bearing_stiffness_n_per_m: float, mass_kg: float, mounts_hz: float) -> float:
    """Return the static gain k/(M ω₀²) of a body on mounts, see `body_on_mounts`."""
    return bearing_stiffness_n_per_m / (mass_kg * (2.0 * pi * mounts_hz) ** 2)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw with even chance per decade."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def pitch_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Single pitch deviation f_pt of class 5, 0.3 (m + 0.4 √d) + 4; each class more is √2 times as much.

    ISO 1328-1:1995, *Cylindrical gears: ISO system of accuracy*.
    """
    return 0.3 * (module_mm + 0.4 * sqrt(diameter_mm)) + 4.0


def runout_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Radial run-out F_r of class 5, 0.8 (0.3 m + 1.25 √d + 7), of which half is the eccentricity; same source."""
    return 0.8 * (0.3 * module_mm + 1.25 * sqrt(diameter_mm) + 7.0)


def profile_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Total profile deviation F_α of class 5, 3.2 √m + 0.22 √d + 0.7; same source."""
    return 3.2 * sqrt(module_mm) + 0.22 * sqrt(diameter_mm) + 0.7


def usual_mass_kg(nominal: Nominal, side: int) -> float:
    """Of a steel disc of the pitch circle's size, with the bore that the model takes where none is given."""
    radius = 0.5 * nominal.pitch_diameters_mm[side]
    bore = 0.35 * (radius - 1.25 * nominal.module_mm)
    return 7850e-9 * pi * (radius**2 - bore**2) * nominal.face_width_mm


def _shift(teeth: int, pressure_angle_deg: float) -> float:
    """Least profile shift without undercut, in modules: (z_min − z)/z_min, z_min = 2/sin²α of the rack."""
    least = 2.0 / sin(radians(pressure_angle_deg)) ** 2
    return max(0.0, (least - teeth) / least)


def _tool_tip_radius(pressure_angle_deg: float) -> float:
    """0.38 modules, or what a rack of 1.25 modules dedendum has room for: (π/4 − 1.25 tan α)/(sec α − tan α)."""
    alpha = radians(pressure_angle_deg)
    return min(0.38, 0.95 * (pi / 4.0 - 1.25 * tan(alpha)) / (1.0 / cos(alpha) - tan(alpha)))


def _spread(rng: np.random.Generator) -> float:
    return float(2.0 ** rng.uniform(-1.0, 1.0))


def as_plain(values: dict[str, Any]) -> dict[str, Any]:
    """Round numbers to six digits: what a preset file holds is what runs."""
    return {name: _rounded(v) if isinstance(v, float) else v for name, v in values.items()}


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")
