"""A kinematic signal model of gear vibration: closed form, no dynamics; see `sims.kinematic.model`."""

from sims.kinematic.bearing import BearingFault
from sims.kinematic.channel import SensorChannel
from sims.kinematic.mesh import MeshHarmonics, Modulation, ToothVariation
from sims.kinematic.model import KinematicModel
from sims.kinematic.path import Resonance, TransferPath
from sims.kinematic.shaft import ShaftOrder
from sims.kinematic.simulate import simulate_kinematic
from sims.kinematic.speed import CoastDown, ConstantProfile, LinearRamp, SpeedProfile, Wander
from sims.kinematic.tooth import ToothDamage
from sims.measure.hum import MainsHum
from sims.measure.noise import ColouredNoise
from sims.measure.tachometer import Tachometer

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
