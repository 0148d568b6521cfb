"""A kinematic signal model of gear vibration: closed form, no dynamics; see `sims.kinematic.model`."""

from sims.kinematic.bearing import BearingFault
from sims.kinematic.channel import ColouredNoise, MainsHum, SensorChannel
from sims.kinematic.mesh import MeshHarmonics, Modulation, ToothVariation
from sims.kinematic.model import KinematicModel
from sims.kinematic.path import Resonance, TransferPath
from sims.kinematic.shaft import ShaftOrder
from sims.kinematic.simulate import simulate_kinematic
from sims.kinematic.speed import CoastDown, ConstantProfile, LinearRamp, SpeedProfile, Wander
from sims.kinematic.tachometer import Tachometer
from sims.kinematic.tooth import ToothDamage

__all__ = [
    "BearingFault",
    "CoastDown",
    "ColouredNoise",
    "ConstantProfile",
    "KinematicModel",
    "LinearRamp",
    "MainsHum",
    "MeshHarmonics",
    "Modulation",
    "Resonance",
    "SensorChannel",
    "ShaftOrder",
    "SpeedProfile",
    "Tachometer",
    "ToothDamage",
    "ToothVariation",
    "TransferPath",
    "Wander",
    "simulate_kinematic",
]
