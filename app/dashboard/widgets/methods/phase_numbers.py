"""Numbers that may be left to the method: an empty field says what it then does."""

from __future__ import annotations

from typing import TYPE_CHECKING

from app.dashboard import state
from gearsig.diagnosis.types import Analysis
from gearsig.errors import InputError

if TYPE_CHECKING:
    from streamlit.delta_generator import DeltaGenerator


def whole_number(
    place: DeltaGenerator,
    label: str,
    name: str,
    analysis: Analysis,
    placeholder: str,
    *,
    most: int | None = None,
    about: str = "",
) -> int | None:
    """Return a whole number from 1 on, None where the field is empty."""
    return place.number_input(
        label,
        min_value=1,
        max_value=most,
        value=None,
        step=1,
        placeholder=placeholder,
        key=path_key(name, analysis),
        help=about or None,
        persist_state="session",
    )


def frequency_hz(
    place: DeltaGenerator, label: str, name: str, analysis: Analysis, placeholder: str, *, about: str = ""
) -> float | None:
    """Return a frequency above 0, None where the field is empty or 0."""
    number = place.number_input(
        label,
        min_value=0.0,
        value=None,
        placeholder=placeholder,
        key=path_key(name, analysis),
        help=about or None,
        persist_state="session",
    )
    return number or None


def two_numbers(text: str | None) -> tuple[float, float] | None:
    """Return the numbers of "0.001, 0.004", None where the field is empty."""
    if not text or not text.strip():
        return None
    try:
        first, second = (float(part) for part in text.replace(";", ",").split(","))
    except ValueError:
        raise InputError(f"fit is {text!r}", allowed="two numbers in s, for example 0.001, 0.004") from None
    return first, second


def path_key(name: str, analysis: Analysis) -> str:
    """Key of a widget of the embedded path."""
    return state.view_key(f"embedded path {name}", analysis)
