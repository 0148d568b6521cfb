"""What sliding has worn off the drive flanks, over the path of contact."""

from __future__ import annotations

import numpy as np

from gearsig.rig.tooth_pairs import PathOfContact
from sims.mesh import GearGeometry, PairGeometry, wear_profile
from sims.wanted import Wanted

SIDES = ("driver", "driven")
N_PLACES = 65


def gear_pair(wanted: Wanted) -> PairGeometry:
    """Return the teeth of both gears as `sims.mesh` knows them."""
    module, angle, width = (wanted.number(n) for n in ("module_mm", "pressure_angle_deg", "face_width_mm"))
    gears = [GearGeometry(wanted.whole(f"teeth_{side}"), module, angle, face_width_mm=width) for side in SIDES]
    return PairGeometry(gears[0], gears[1])


def worn_um(wanted: Wanted, path: PathOfContact) -> tuple[float, ...]:
    """Return the depth that both drive flanks of a pair lost together, from where it enters to where it leaves.

    Each gear's share has the shape of Archard's law, see `sims.mesh.wear_profile`: greatest at the ends of the path,
    nothing at the pitch point. Empty where nothing is worn.
    """
    deepest = [wanted.number(f"sliding_wear_{side}_um") for side in SIDES]
    if not any(deepest):
        return ()
    pair = gear_pair(wanted)
    driver_mm = 1e3 * path.driver_lever_m(np.linspace(0.0, path.contact_ratio, N_PLACES))
    rolls = (driver_mm, 1e3 * path.length_m - driver_mm)
    shares = [
        depth * wear_profile(pair, side, roll)
        for side, depth, roll in zip((1, 2), deepest, rolls, strict=True)
        if depth
    ]
    return tuple(float(depth) for depth in np.sum(shares, axis=0))
