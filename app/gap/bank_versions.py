"""Which state of the code made the features of a bank."""

from __future__ import annotations

from functools import cache

from gearsig.cache import modules_digest

_MODULES = (
    *(f"gearsig.gap.{name}" for name in ("averages", "broadband", "change", "channels", "cyclic", "features", "frame")),
    *(f"gearsig.gap.{name}" for name in ("gather", "gathered", "gear_lines", "hum", "speed", "tooth")),
    "gearsig.severity.reference",
    "gearsig.severity.shaft_lines",
    "gearsig.angle.pulse_train",
    "gearsig.angle.resample",
)
"""Those whose code changes a feature."""


@cache
def features_digest() -> str:
    """Return a short hash of the code that makes features of a recording."""
    return modules_digest(_MODULES)
