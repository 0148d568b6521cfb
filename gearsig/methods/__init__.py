"""The methods by name, from which the command line and the dashboard build commands and pages.

A method is a function of a prepared recording, a channel and its options. Its row in a table defines the options, with
texts, limits and the choices that a recording offers.

>>> from gearsig.methods import apply_method
>>> answer = apply_method("envelope", recording, band_hz=(2000.0, 4000.0))  # doctest: +SKIP
"""

from __future__ import annotations

from gearsig.methods._apply import METHODS, apply_method, apply_method_to_file
from gearsig.methods._decompose import by_centre
from gearsig.methods._spectra import suggested_rate_hz
from gearsig.methods._table import Kind, Method, MethodAnswer, MethodOption, Waveforms, angle_or_none, part_of
from gearsig.methods._timefreq import TRANSFORMS

__all__ = [
    "METHODS",
    "TRANSFORMS",
    "Kind",
    "Method",
    "MethodAnswer",
    "MethodOption",
    "Waveforms",
    "angle_or_none",
    "apply_method",
    "apply_method_to_file",
    "by_centre",
    "part_of",
    "suggested_rate_hz",
]
