"""All methods in one table, and how one of them is applied."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError
from gearsig.methods._decompose import PARTS
from gearsig.methods._orders import ALONG
from gearsig.methods._phase import IN_PHASE
from gearsig.methods._spectra import RHYTHMS, WHOLE
from gearsig.methods._table import Method, MethodAnswer, part_of, usual_channel
from gearsig.methods._timefreq import MAPS
from gearsig.prepared import PreparedRecording, prepare
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
    if name not in METHODS:
        raise InputError(
            f"there is no method {name!r}", allowed=", ".join(METHODS), remedy=closest_match_hint(name, list(METHODS))
        )
    method = METHODS[name]
    taken = {option.name: option for option in method.options}
    for key, value in options.items():
        if key not in taken:
            fitting = [n for n, m in METHODS.items() if key in (o.name for o in m.options)]
            remedy = f"it is an option of {', '.join(fitting)}" if fitting else f"it takes {', '.join(taken) or 'none'}"
            raise InputError(f"{name} takes no {key.replace('_', ' ')}", remedy=remedy)
        taken[key].check(value)
    prepared = prepare(recording)
    if start_s is not None or end_s is not None:
        end = prepared.recording.duration_s if end_s is None else end_s
        prepared = part_of(prepared, start_s or 0.0, end)
    settings = {key: option.default for key, option in taken.items()} | options
    answer = method.answer(prepared, usual_channel(prepared.recording, channel), **settings)
    return replace(answer, method=name)
