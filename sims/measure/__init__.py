"""The measurement chain: from a machine's motion to a recording.

A `MeasurementChain` passes a `Motion` through paths (`ModalPath`), sensors (`Accelerometer`, `Encoder`, `Tachometer`),
`AntiAlias` filter and `Converter`, with `ColouredNoise` and `MainsHum`.
"""

from sims.measure._chain import AntiAlias, MeasuredChannel, MeasurementChain, Motion, plain, ratio_of_rates
from sims.measure._sensors import (
    Accelerometer,
    ColouredNoise,
    Converter,
    Encoder,
    MainsHum,
    ModalPath,
    PathMode,
    Tachometer,
    apply,
    disc_edges,
    discrete,
    pulse_voltage,
)

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
    "Tachometer",
    "apply",
    "disc_edges",
    "discrete",
    "plain",
    "pulse_voltage",
    "ratio_of_rates",
]
