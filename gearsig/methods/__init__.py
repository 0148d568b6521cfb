"""The methods by name, from which the command line and the dashboard make commands and pages.

A method is a function of a prepared recording, a channel and its options; its row in a table names the options once,
with text, limits and what a recording offers for them.

>>> from gearsig.methods import apply_method
>>> answer = apply_method("envelope", recording, band_hz=(2000.0, 4000.0))  # doctest: +SKIP
"""

from __future__ import annotations

from typing import Any

from gearsig.methods._decompose import PARTS, by_centre
from gearsig.methods._orders import ALONG
from gearsig.methods._phase import IN_PHASE, N_IN_SPACE
from gearsig.methods._spectra import RHYTHMS, WHOLE
from gearsig.methods._table import (
    Kind,
    Method,
    MethodAnswer,
    MethodOption,
    Waveforms,
    angle_or_none,
    part_of,
    usual_channel,
)
from gearsig.methods._table import apply_method as _apply
from gearsig.methods._timefreq import MAPS, TRANSFORMS
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording

METHODS: dict[str, Method] = {**WHOLE, **ALONG, **RHYTHMS, **MAPS, **PARTS, **IN_PHASE}
"""The methods by the names that command line and reports know them by."""


def apply_method(
    name: str,
    recording: Recording | PreparedRecording,
    channel: str = "",
    *,
    start_s: float | None = None,
    end_s: float | None = None,
    **options: Any,
) -> MethodAnswer:
    """Apply a method to one channel of a recording.

    Parameters
    ----------
    name : str
        One of `METHODS`.
    recording : Recording or PreparedRecording
    channel : str
        Empty: the first acceleration, else the first channel that is not a tachometer's.
    start_s, end_s : float or None
        Part of the recording; None: all.
    **options
        Those of the method.

    Raises
    ------
    InputError
        If there is no such method or channel, or the method does not take an option or its value.
    RefusalError
        If the recording does not allow it: no speed, too short.
    """
    return _apply(METHODS, name, recording, channel, start_s=start_s, end_s=end_s, **options)


__all__ = [
    "METHODS",
    "N_IN_SPACE",
    "TRANSFORMS",
    "Kind",
    "Method",
    "MethodAnswer",
    "MethodOption",
    "Waveforms",
    "angle_or_none",
    "apply_method",
    "by_centre",
    "part_of",
    "usual_channel",
]
