"""Units that files use, in SI units."""

from __future__ import annotations

from gearsig.recording.types import Channel

SI_FACTORS = {
    "acceleration": {"m/s^2": 1.0, "m/s²": 1.0, "m/s2": 1.0, "mm/s^2": 1e-3, "mm/s²": 1e-3, "g": 9.80665},
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "displacement": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "transmission_error": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    "sound_pressure": {"Pa": 1.0},
    "force": {"N": 1.0, "kN": 1e3},
    "torque": {"N m": 1.0, "Nm": 1.0, "N·m": 1.0, "kN m": 1e3},
}
"""Quantity → unit → SI unit."""


def metres_per_second_squared(channel: Channel) -> float | None:
    """Return what a channel's values are multiplied by to be m/s²; None where it is no acceleration in a known unit."""
    return SI_FACTORS["acceleration"].get(channel.unit) if channel.quantity in ("acceleration", "unknown") else None
