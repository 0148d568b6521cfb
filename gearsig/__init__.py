"""gearsig: signal processing and diagnostics for gear vibration, simulated and measured.

The main job in three lines:

>>> import gearsig
>>> result = gearsig.analyze(gearsig.read_recording("gearbox.csv", rig=gearsig.read_rig("rig.toml")))  # doctest: +SKIP
>>> print(gearsig.analysis_text(result))  # doctest: +SKIP

Everything else is imported from its room, e.g. `from gearsig.orders import synchronous_average`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gearsig.diagnosis import AnalysisSettings, analyze
    from gearsig.errors import GearsigError, InputError, RefusalError
    from gearsig.recording import Channel, Recording, read_recording, write_recording
    from gearsig.report import analysis_text
    from gearsig.rig import (
        Bearing,
        ConstantSpeed,
        EncoderChannel,
        GearPair,
        OperatingPoint,
        PulseTimes,
        Rig,
        Sensor,
        Shaft,
        SpeedChannel,
        TachometerChannel,
        read_rig,
    )

__version__ = "0.1.0"

_HOMES = {
    "AnalysisSettings": "gearsig.diagnosis",
    "analyze": "gearsig.diagnosis",
    "analysis_text": "gearsig.report",
    "GearsigError": "gearsig.errors",
    "InputError": "gearsig.errors",
    "RefusalError": "gearsig.errors",
    "read_recording": "gearsig.recording",
    "write_recording": "gearsig.recording",
    "Channel": "gearsig.recording",
    "Recording": "gearsig.recording",
    "read_rig": "gearsig.rig",
    **dict.fromkeys(
        ("ConstantSpeed", "EncoderChannel", "PulseTimes", "SpeedChannel", "TachometerChannel"), "gearsig.rig"
    ),
    **dict.fromkeys(("Bearing", "GearPair", "OperatingPoint", "Rig", "Sensor", "Shaft"), "gearsig.rig"),
}

__all__ = [
    "AnalysisSettings",
    "Bearing",
    "Channel",
    "ConstantSpeed",
    "EncoderChannel",
    "GearPair",
    "GearsigError",
    "InputError",
    "OperatingPoint",
    "PulseTimes",
    "Recording",
    "RefusalError",
    "Rig",
    "Sensor",
    "Shaft",
    "SpeedChannel",
    "TachometerChannel",
    "analysis_text",
    "analyze",
    "read_recording",
    "read_rig",
    "write_recording",
]


def __getattr__(name: str) -> Any:
    """Load a public name from its room when it is first used, so that `import gearsig` stays light."""
    if name not in _HOMES:
        raise AttributeError(f"module 'gearsig' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
