"""How heavily teeth are loaded: what parts at light load does not at full load."""

from __future__ import annotations

from math import cos, radians

from gearsig.rig.types import GearPair

USUAL_PRESSURE_ANGLE_DEG = 20.0

LIGHT_LOAD_N_PER_MM = 50.0
"""Up to which flanks may part and the backlash shows: where dynamic loads can reach the static one, by order."""


def tooth_load_n_per_mm(pair: GearPair, torque_nm: float) -> float:
    """Return the tooth force over the face width, T/(r_b b), N/mm; nan where module or width are not known.

    Parameters
    ----------
    pair : GearPair
    torque_nm : float
        Of the driver.
    """
    if pair.driver_teeth is None or pair.module_mm is None or pair.face_width_mm is None:
        return float("nan")
    angle = radians(pair.pressure_angle_deg or USUAL_PRESSURE_ANGLE_DEG)
    base_radius_mm = pair.driver_teeth * pair.module_mm * cos(angle) / 2.0
    return 1e3 * abs(torque_nm) / (base_radius_mm * pair.face_width_mm)
