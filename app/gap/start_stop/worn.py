"""How worn flanks move the gears against each other over a mesh cycle."""

from __future__ import annotations

from math import radians

import numpy as np

from app.gap.start_stop.twin import Parameters
from gearsig.checks import FloatArray
from gearsig.gap.start_stop.contact_part import N_PLACES
from gearsig.rig.tooth_pairs import standard_path
from sims.mesh import GearGeometry, PairGeometry, wear_profile

N_BISECTIONS = 40


def worn_curve_um(parameters: Parameters, deflection_um: float, depth_um: float) -> FloatArray:
    """Return how much further the driver turns, at each place of the mesh cycle, with worn teeth, (N_PLACES,).

    A pair whose flank has lost h touches later: Σ (δ − h_i)₊^λ = n g^λ at an equal load, g the deflection of n sound
    pairs. Where two pairs share the load, the less worn one decides. Wear is that of the driver's teeth, by Archard's
    law (`sims.mesh.wear_profile`).

    Parameters
    ----------
    parameters : mapping
        Of the drive.
    deflection_um : float
        Of one pair under the ordinary load.
    depth_um : float
        Where the wear is greatest.
    """
    module = float(parameters["module_mm"])
    teeth = int(float(parameters["teeth_driver"])), int(float(parameters["teeth_driven"]))
    driver, driven = (GearGeometry(z, module, 20.0, face_width_mm=16.0 * module) for z in teeth)
    pair = PairGeometry(driver, driven)
    path = standard_path(teeth, 1e-3 * module, radians(20.0))
    u = (np.arange(N_PLACES) + 0.5) / N_PLACES
    positions = np.stack([u, u + 1.0])
    touches = positions < path.contact_ratio
    worn = depth_um * np.stack([wear_profile(pair, 1, 1e3 * path.driver_lever_m(row)) for row in positions])
    exponent = float(parameters["exponent"])
    g = deflection_um if np.isfinite(deflection_um) and deflection_um > 0.0 else 20.0
    n = np.sum(touches, axis=0)
    wanted = g**exponent * np.ones(N_PLACES)  # the load of one pair: with two the compression is less
    sound = g / n ** (1.0 / exponent)
    low, high = np.zeros(N_PLACES), sound + depth_um
    for _ in range(N_BISECTIONS):
        middle = 0.5 * (low + high)
        carried = np.sum(np.where(touches, np.maximum(middle - worn, 0.0) ** exponent, 0.0), axis=0)
        low, high = np.where(carried < wanted, middle, low), np.where(carried < wanted, high, middle)
    curve: FloatArray = 0.5 * (low + high) - sound
    return curve
