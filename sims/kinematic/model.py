"""The kinematic model: everything that is put into a signal, as plain numbers.

What it represents: vibration that is a known function of shaft angle (mesh harmonics with modulation, a damaged tooth,
bearing knocks, shaft orders), passed through fixed filters, with noise.

What it does not represent: dynamics. Nothing here follows from masses, stiffness or load: amplitudes do not change with
torque, damage does not change stiffness, backlash and friction do not exist, resonances are excited only through the
fixed path and the ring-downs, and shaft angles are free of transmission error. Use it to test analyses against closed
forms and for samples, not to learn how large the signature of a fault is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.rig.types import Rig
from sims.kinematic.bearing import BearingFault
from sims.kinematic.channel import SensorChannel
from sims.kinematic.mesh import MeshHarmonics, Modulation, ToothVariation
from sims.kinematic.shaft import ShaftOrder
from sims.kinematic.speed import SpeedProfile
from sims.kinematic.tooth import ToothDamage
from sims.measure.tachometer import Tachometer


@dataclass(frozen=True)
class KinematicModel:
    """Parts of a signal; each may be left out.

    Parameters
    ----------
    speed : SpeedProfile
        Of the rig's reference shaft, or of its first shaft where the rig names none.
    meshes, modulations, tooth_variations, tooth_damages
        Per pair and gear, see their own classes.
    bearing_faults, shaft_orders
    channels : tuple of SensorChannel
        At least one; all see the same machine through their own path, with independent noise.
    tachometer : Tachometer or None
    """

    speed: SpeedProfile
    meshes: tuple[MeshHarmonics, ...] = ()
    modulations: tuple[Modulation, ...] = ()
    tooth_variations: tuple[ToothVariation, ...] = ()
    tooth_damages: tuple[ToothDamage, ...] = ()
    bearing_faults: tuple[BearingFault, ...] = ()
    shaft_orders: tuple[ShaftOrder, ...] = ()
    channels: tuple[SensorChannel, ...] = (SensorChannel(),)
    tachometer: Tachometer | None = None

    def __post_init__(self) -> None:
        if not self.channels:
            raise InputError("the model has no channels", remedy="give at least one SensorChannel")

    def shaft_revolutions(self, rig: Rig, shaft: str, time_s: FloatArray) -> FloatArray:
        """Return the exact angle of `shaft` in revolutions at `time_s` (0 at time 0); empty: the reference shaft."""
        return known_ratio(rig, shaft) * self.speed.revolutions(np.asarray(time_s, dtype=np.float64))

    def shaft_speed_rpm(self, rig: Rig, shaft: str, time_s: FloatArray) -> FloatArray:
        """Return the exact speed of `shaft` in rpm at `time_s`; empty: the reference shaft."""
        return known_ratio(rig, shaft) * self.speed.speed_rpm(np.asarray(time_s, dtype=np.float64))


def known_ratio(rig: Rig, shaft: str) -> float:
    """Revolutions of `shaft` per revolution of the reference shaft; an `InputError` where the rig does not tell."""
    if not shaft or shaft == rig.reference_shaft:
        return 1.0
    ratio = rig.ratio(shaft)
    if ratio is None:
        raise InputError(f"the speed of shaft {shaft!r} does not follow from the rig", remedy="give the teeth")
    return ratio


def known_teeth(rig: Rig, pair: str, shaft: str) -> int:
    """Teeth of a gear; an `InputError` where the rig does not tell."""
    teeth = rig.pair(pair).teeth(shaft)
    if teeth is None:
        raise InputError(f"the teeth of pair {pair!r} on shaft {shaft!r} are not given", remedy="give the teeth")
    return teeth


def known_mesh_order(rig: Rig, pair: str) -> float:
    """Mesh cycles per revolution of the reference shaft; an `InputError` where the rig does not tell."""
    order = rig.mesh_order(rig.pair(pair))
    if order is None:
        raise InputError(f"the mesh order of pair {pair!r} does not follow from the rig", remedy="give the teeth")
    return order
