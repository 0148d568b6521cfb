"""Numbers with units as people type them: "2mm", "500 rpm", "300..1500rpm"."""

from __future__ import annotations

import re
from math import isfinite, pi

from gearsig.errors import InputError

_RADIAN_RPM = 30.0 / pi

_KINDS: tuple[dict[str, float], ...] = (
    {"nm": 1e-9, "um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0},
    {"rpm": 1.0, "1/min": 1.0, "rad/s": _RADIAN_RPM, "1/s": 60.0, "rev/s": 60.0},
    {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6},
    {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0},
    {"Nm": 1.0, "mNm": 1e-3, "kNm": 1e3},
    {"deg": 1.0, "rad": 180.0 / pi},
    {"gmm": 1.0, "gcm": 10.0, "kgmm": 1e3, "kgm": 1e6},
    {"g": 1e-3, "kg": 1.0},
    {"kgm2": 1.0, "kgmm2": 1e-6, "kgcm2": 1e-4, "gmm2": 1e-9},
    {"Pa": 1e-9, "MPa": 1e-3, "GPa": 1.0},
    {"cP": 1.0, "mPas": 1.0, "Pas": 1e3},
    {"kg/m3": 1.0, "g/cm3": 1e3},
    {"N/m": 1.0, "N/mm": 1e3, "N/um": 1e6, "kN/mm": 1e6},
    {"Ns/m": 1.0, "kNs/m": 1e3},
    {"Nm/rad": 1.0, "kNm/rad": 1e3},
    {"Nms/rad": 1.0},
    {"m/s2": 1.0, "mm/s2": 1e-3, "g": 9.80665},
    {"m/s2/sqrtHz": 1.0, "g/sqrtHz": 9.80665},
    {"%": 1.0},
)
"""Units that can stand for each other, by what one is worth; spelt as `_spelt` leaves them."""

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*", re.DOTALL)


def quantity(text: str, unit: str, name: str) -> float:
    """Return a number in `unit`; without a unit of its own it is taken to be in it.

    Parameters
    ----------
    text : str
        E.g. "2", "2mm", "0.002 m".
    unit : str
        The unit wanted; empty for a plain number.
    name : str
        For the error.

    Raises
    ------
    InputError
        If it is no number, or its unit measures something else.

    Examples
    --------
    >>> quantity("0.5mm", "um", "backlash"), quantity("50 rad/s", "rpm", "speed") > 477.4
    (500.0, True)
    """
    value, given = split_quantity(text, unit, name)
    return value if not given else value * _worth(given, unit, text, name)


def span(text: str, unit: str, name: str) -> tuple[float, float]:
    """Return both ends of "300..1500rpm"; a unit after the second number holds for both."""
    first, second = text.split("..", 1)
    if not first.strip() or not second.strip():
        raise InputError(
            f"{name} is {text!r}", allowed=f"two numbers, as in {f'1..2 {unit}'.strip()}", remedy="give both ends"
        )
    own = split_quantity(first, unit, name)[1]
    later = split_quantity(second, unit, name)[1]
    return quantity(first if own or not later else f"{first}{later}", unit, name), quantity(second, unit, name)


def split_quantity(text: str, unit: str, name: str) -> tuple[float, str]:
    """Return the number and what stands behind it."""
    found = _QUANTITY.fullmatch(text)
    if found is None or not isfinite(float(found[1])):
        example = f"a number in {unit}, e.g. 2 {unit}" if unit else "a number"
        raise InputError(f"{name} is {text!r}", allowed=example)
    return float(found[1]), found[2]


def _worth(given: str, unit: str, text: str, name: str) -> float:
    """How many of `unit` the given unit is worth."""
    own, wanted = _spelt(given), _spelt(unit)
    if own == wanted:
        return 1.0
    fitting = [kind for kind in _KINDS if wanted in kind]
    for kind in fitting:
        if own in kind:
            return float(f"{kind[own] / kind[wanted]:.15g}")  # 1000 mm in a m, not 1000.0000000000001
    if not unit:
        raise InputError(f"{name} is {text!r}", allowed="a number without unit")
    others = [u for kind in fitting for u in kind if u != wanted]
    also = f" (or {', '.join(others)})" if others else ""
    raise InputError(f"{name} is {text!r}, in {given!r}", remedy=f"give it in {unit}{also}")


def _spelt(unit: str) -> str:
    """One spelling for all: no blanks, dots or carets, u for µ, deg for °, sqrt for √."""
    for sign, plain in (("µ", "u"), ("μ", "u"), ("°", "deg"), ("√", "sqrt"), ("²", "2"), ("³", "3")):
        unit = unit.replace(sign, plain)
    return re.sub(r"[\s·*^]", "", unit)
