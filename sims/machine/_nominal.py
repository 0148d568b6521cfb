"""What a rig says of its gear pair, completed by what is usual for its size, and the tolerances of such gears."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np

from gearsig.errors import RefusalError
from gearsig.rig import Rig

USUAL_LOAD_N_PER_MM2 = 50.0
"""Force per face width and module of a pair whose torque is not known; rated gears carry 20 to 120."""
LARGEST_LOAD_N_PER_MM2 = 500.0
"""Bends a tooth's root, with a form factor of 3, by 1500 N/mm²: more than hardened steel stands."""
USUAL_WIDTH_MODULES = 10.0
USUAL_MESH_HZ = 540.0
"""Mesh frequency of a pair whose speed is not known."""
STIFFNESS_N_PER_MM_UM = 14.0
"""Usual stiffness of a pair of steel gears per face width."""


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
    stated = {
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
        tuple(name for name, value in stated.items() if not value),
    )


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
