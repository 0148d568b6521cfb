"""Display units: decibels, degrees, and units written as people read them."""

from __future__ import annotations

from functools import cache
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray
from gearsig.spectra.types import Scaling

Scale = Literal["log", "decibel", "linear"]
"""How values are drawn: on a logarithmic axis, in decibels on a linear one, or as they are."""

_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
LOWEST_RATIO = 1e-10
"""Values below this share of the largest one are drawn there: a logarithm needs a bottom."""


def decibels(values: FloatArray, scaling: Scaling) -> FloatArray:
    """Return values in dB re one unit: 20 lg of amplitudes, 10 lg of powers.

    Zeros are drawn 200 dB (amplitudes) or 100 dB (powers) below the largest value.
    """
    factor = 10.0 if scaling in ("power", "power density") else 20.0
    result: FloatArray = factor * np.log10(above_zero(values))
    return result


def above_zero(values: FloatArray) -> FloatArray:
    """Return values lifted to a tiny share of the largest one, so that they have a logarithm."""
    largest = float(np.max(values, initial=0.0))
    lowest = largest * LOWEST_RATIO if largest > 0 else LOWEST_RATIO
    return np.maximum(np.asarray(values, dtype=np.float64), max(lowest, float(np.finfo(np.float64).tiny)))


def unit_text(unit: str) -> str:
    """Write a unit with superscripts.

    Examples
    --------
    >>> unit_text("(m/s^2)^2/Hz")
    '(m/s²)²/Hz'
    """
    parts = unit.split("^")
    text = parts[0]
    for part in parts[1:]:
        digits = len(part) - len(part.lstrip("-0123456789"))
        text += part[:digits].translate(_SUPERSCRIPTS) + part[digits:] if digits else "^" + part
    return text


def with_unit(name: str, unit: str) -> str:
    """Write a quantity with its unit in brackets, or alone where the unit is not known."""
    return f"{name} ({unit_text(unit)})" if unit else name


def plain(text: str, n_max: int = 60) -> str:
    """Return one line that the figures' font can draw, cut in its middle to `n_max` characters.

    Names come from files: control characters become spaces, and signs the font lacks become "?".
    """
    drawable = _drawable_code_points()
    line = " ".join("".join(c if c.isprintable() else " " for c in text).split())
    line = "".join(c if ord(c) in drawable else "?" for c in line)
    if len(line) <= n_max:
        return line
    tail = n_max // 3
    return f"{line[: n_max - tail - 1]}…{line[-tail:]}"


@cache
def _drawable_code_points() -> frozenset[int]:
    from matplotlib.font_manager import FontProperties, findfont, get_font

    return frozenset(get_font(findfont(FontProperties(family=["DejaVu Sans"]))).get_charmap())
