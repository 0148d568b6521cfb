"""A kinematic signal model of gear vibration: closed form, no dynamics; see `tests.kinematic.model`."""

from sims.measure import ColouredNoise, MainsHum, Tachometer
from tests.kinematic.model import (
    BearingFault,
    KinematicModel,
    MeshHarmonics,
    MeshModulation,
    PathResonance,
    SensorChannel,
    ShaftOrder,
    ToothDamage,
    ToothVariation,
    TransferPath,
)
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import ConstantProfile, LinearRamp, SpeedProfile, Wander

__all__ = [
    "BearingFault",
    "ColouredNoise",
    "ConstantProfile",
    "KinematicModel",
    "LinearRamp",
    "MainsHum",
    "MeshHarmonics",
    "MeshModulation",
    "PathResonance",
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
