"""What a file reader hands over: columns as they stand in the file, nothing judged yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from gearsig.rig.speed import SpeedSource

NumberArray = NDArray[Any]


def sample_place(row: int) -> str:
    """Name a row of a file that has no lines."""
    return f"sample {row}"


@dataclass(frozen=True)
class RawColumn:
    """One column of a file.

    Parameters
    ----------
    name : str
    values : array, (n_samples,)
        Numbers in the file's own type.
    unit, quantity, position : str
        Empty where the file does not say.
    """

    name: str
    values: NumberArray
    unit: str = ""
    quantity: str = ""
    position: str = ""


@dataclass(frozen=True)
class RawTable:
    """The columns of one file and what the file says about them.

    Parameters
    ----------
    columns : tuple of RawColumn
    reader : str
        Name of the reader, for the provenance.
    sampling_rate_hz : float or None
        As the file states it.
    time : RawColumn or None
        The time column where the reader already knows it.
    is_own_layout : bool
        Whether gearsig wrote the file: then nothing is guessed from names.
    warnings : tuple of str
    speed : SpeedSource or None
    truth : mapping or None
    history : tuple of str
        Processing steps that were done before the file was written.
    row_place : callable
        Turns a row number into words that find it in the file, e.g. "line 17".
    """

    columns: tuple[RawColumn, ...]
    reader: str
    sampling_rate_hz: float | None = None
    time: RawColumn | None = None
    is_own_layout: bool = False
    warnings: tuple[str, ...] = ()
    speed: SpeedSource | None = None
    truth: Mapping[str, Any] | None = None
    history: tuple[str, ...] = ()
    row_place: Callable[[int], str] = sample_place
