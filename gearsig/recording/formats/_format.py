"""A file format as the rest of the program sees it, and the metadata that gearsig writes in each."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.errors import InputError
from gearsig.recording._table import NumberArray, RawColumn, RawTable, sample_place
from gearsig.recording._types import Recording
from gearsig.rig import ConstantSpeed, EncoderChannel, PulseTimes, SpeedChannel, SpeedSource, TachometerChannel

OWN_NAME = "gearsig_recording"
"""Dataset, variable or key with the description of a recording that gearsig wrote."""


@dataclass(frozen=True)
class FileFormat:
    """A file format: how it is recognised, read and written.

    Format libraries are heavy: `read` and `write` import them when called.

    Parameters
    ----------
    name : str
        As shown to users.
    endings : tuple of str
        Of files that can be read; lower case, with the dot.
    sniff : callable
        A file's first bytes → the kind of content, e.g. "MAT v5"; empty if it is of another format.
    read : callable
        Path → `RawTable`; raises `InputError` if the file is damaged.
    read_part : callable, optional
        Path and a slice of samples → `RawTable` of these alone; None: files can only be read whole.
    length : callable, optional
        Path → samples per channel, without decoding them; given along with `read_part`.
    write : callable, optional
        Writes a recording to a path as a complete file, so that `read` returns the same.
    written_endings : tuple of str
        Endings with which recordings can be written.
    """

    name: str
    endings: tuple[str, ...]
    sniff: Callable[[bytes], str]
    read: Callable[[Path], RawTable]
    write: Callable[[Recording, Path], None] | None = None
    written_endings: tuple[str, ...] = ()
    read_part: Callable[[Path, slice], RawTable] | None = None
    length: Callable[[Path], int] | None = None


def begins(kind: str, *marks: bytes) -> Callable[[bytes], str]:
    """Return the `sniff` of a format whose files begin with one of the given marks."""
    return lambda head: kind if head.startswith(marks) else ""


# --------------------
# The metadata that gearsig writes beside the samples, as one JSON text that every format can hold.
# --------------------


LAYOUT = "gearsig recording 1"
OWN_TEXT_MARK = "# gearsig: "
_SPEED_KINDS: dict[str, Any] = {
    "constant": ConstantSpeed,
    "pulse_times": PulseTimes,
    "tachometer_channel": TachometerChannel,
    "encoder_channel": EncoderChannel,
    "speed_channel": SpeedChannel,
}


def metadata_json(recording: Recording) -> str:
    """Return rate, channels, speed source, truth, warnings and history as JSON in ASCII.

    The rig is not included: it is a separate file.
    """
    speed = recording.speed
    kind = next((kind for kind, source in _SPEED_KINDS.items() if isinstance(speed, source)), "")
    return json.dumps(
        {
            "layout": LAYOUT,
            "sampling_rate_hz": float(recording.sampling_rate_hz),
            "dtype": recording.samples.dtype.name,
            "channels": [asdict(channel) for channel in recording.channels],
            "speed": None if speed is None else {"kind": kind, **asdict(speed)},
            "truth": None if recording.truth is None else dict(recording.truth),
            "warnings": list(recording.warnings),
            "history": list(recording.provenance.history),
        },
        default=_plain_value,
    )


def table_from_metadata(
    text: str, values: Sequence[NumberArray], reader: str, where: str, row_place: Callable[[int], str] = sample_place
) -> RawTable:
    """Return the table of a file in gearsig's own layout, from its JSON text and its columns in order."""
    try:
        facts = json.loads(text)
        channels = facts["channels"]
        _check_own(str(facts["layout"]), len(channels), len(values), where)
        if facts["dtype"] == "float32":  # text has no types
            values = [np.asarray(v, dtype=np.float32) for v in values]
        columns = tuple(
            RawColumn(str(c["name"]), v, str(c["unit"]), str(c["quantity"]), str(c["position"]))
            for c, v in zip(channels, values, strict=True)
        )
        speed: SpeedSource | None = None
        if (source := facts["speed"]) is not None:
            speed = _SPEED_KINDS[source["kind"]](**{key: part for key, part in source.items() if key != "kind"})
        return RawTable(
            columns,
            reader,
            sampling_rate_hz=float(facts["sampling_rate_hz"]),
            is_own_layout=True,
            warnings=tuple(map(str, facts["warnings"])),
            speed=speed,
            truth=None if facts["truth"] is None else dict(facts["truth"]),
            history=tuple(map(str, facts["history"])),
            row_place=row_place,
        )
    except InputError:
        raise
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"gearsig's description in the file is damaged ({type(error).__name__}: {error})",
            where=where,
            allowed="what write_recording writes",
            remedy="write the file again, or remove the description",
        ) from error


def _check_own(layout: str, n_described: int, n_held: int, where: str) -> None:
    if layout != LAYOUT:
        raise InputError(
            f"layout {layout[:60]!r} is not known", where=where, allowed=LAYOUT, remedy="use the gearsig that wrote it"
        )
    if n_described != n_held:
        raise InputError(
            f"describes {n_described} channels but holds {n_held}",
            where=where,
            allowed="as many columns as are described",
            remedy="the columns were changed after writing: remove the description",
        )


def _plain_value(value: Any) -> Any:
    """Return NumPy values, which a truth may hold, as JSON values."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return dict(value)
    raise InputError(
        f"the truth of the recording holds a {type(value).__name__}",
        allowed="numbers, texts, lists and mappings of them",
        remedy="convert it before writing",
    )
