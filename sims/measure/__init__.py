"""The measurement chain: from a machine's motion to a recording; see `sims.measure.chain`."""

from sims.measure.accelerometer import Accelerometer, Converter
from sims.measure.chain import MeasuredChannel, MeasurementChain
from sims.measure.counter import Encoder, PulseCounter
from sims.measure.hum import MainsHum
from sims.measure.motion import Motion
from sims.measure.noise import ColouredNoise
from sims.measure.path import ModalPath, PathMode
from sims.measure.sampling import AntiAlias
from sims.measure.tachometer import Tachometer

__all__ = [
    "Accelerometer",
    "AntiAlias",
    "ColouredNoise",
    "Converter",
    "Encoder",
    "MainsHum",
    "MeasuredChannel",
    "MeasurementChain",
    "ModalPath",
    "Motion",
    "PathMode",
    "PulseCounter",
    "Tachometer",
]
