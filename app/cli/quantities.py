"""Numbers with units as people type them: "2mm", "500 rpm", "300..1500rpm"."""

from __future__ import annotations

import csv
import re
from math import isfinite, pi
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from gearsig.errors import InputError

if TYPE_CHECKING:
    from sims.machine import Profile

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
"""Interchangeable units with their conversion factors, spelt as `_normalised_unit` returns them."""

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_QUANTITY = re.compile(rf"\s*({_NUMBER})\s*(.*?)\s*", re.DOTALL)


def quantity(text: str, unit: str, name: str) -> float:
    """Parse a number and convert it to `unit`, which is also assumed if the text states no unit.

    Parameters
    ----------
    text : str
        E.g. "2", "2mm", "0.002 m".
    unit : str
        Target unit; empty for a plain number.
    name : str
        Name of the quantity, for error messages.

    Raises
    ------
    InputError
        If the text is not a number, or its unit has another dimension.

    Examples
    --------
    >>> quantity("0.5mm", "um", "backlash"), quantity("50 rad/s", "rpm", "speed") > 477.4
    (500.0, True)
    """
    value, stated = split_quantity(text, unit, name)
    return value if not stated else value * _scale_of_unit(stated, unit, text, name)


def span(text: str, unit: str, name: str, *, example: str = "2..4") -> tuple[float, float]:
    """Parse both ends of "300..1500rpm"; a unit after the second number applies to both."""
    first, dots, second = text.partition("..")
    if not dots:
        raise InputError(f"{name} is {text!r}", allowed="FROM..TO", remedy=f"write for example {example}{unit}")
    if not first.strip() or not second.strip():
        raise InputError(
            f"{name} is {text!r}", allowed=f"two numbers, as in {f'1..2 {unit}'.strip()}", remedy="give both ends"
        )
    first_unit = split_quantity(first, unit, name)[1]
    later = split_quantity(second, unit, name)[1]
    return quantity(first if first_unit or not later else f"{first}{later}", unit, name), quantity(second, unit, name)


def split_quantity(text: str, unit: str, name: str) -> tuple[float, str]:
    """Split a quantity into its number and its unit text."""
    match = _QUANTITY.fullmatch(text)
    if match is None or not isfinite(float(match[1])):
        example = f"a number in {unit}, e.g. 2 {unit}" if unit else "a number"
        raise InputError(f"{name} is {text!r}", allowed=example)
    return float(match[1]), match[2]


def _scale_of_unit(stated: str, unit: str, text: str, name: str) -> float:
    """Return the factor that converts the stated unit to `unit`."""
    stated_unit, target_unit = _normalised_unit(stated), _normalised_unit(unit)
    if stated_unit == target_unit:
        return 1.0
    fitting = [kind for kind in _KINDS if target_unit in kind]
    for kind in fitting:
        if stated_unit in kind:
            return float(f"{kind[stated_unit] / kind[target_unit]:.15g}")  # 1000 mm in a m, not 1000.0000000000001
    if not unit:
        raise InputError(f"{name} is {text!r}", allowed="a number without a unit")
    fitting_units = [u for kind in fitting for u in kind if u != target_unit]
    also = f" (or {', '.join(fitting_units)})" if fitting_units else ""
    raise InputError(f"{name} is {text!r}, in {stated!r}", remedy=f"give it in {unit}{also}")


def _normalised_unit(unit: str) -> str:
    """Normalise the spelling: no blanks, dots or carets, u for µ, deg for °, sqrt for √."""
    for sign, plain in (("µ", "u"), ("μ", "u"), ("°", "deg"), ("√", "sqrt"), ("²", "2"), ("³", "3")):
        unit = unit.replace(sign, plain)
    return re.sub(r"[\s·*^]", "", unit)


MAX_PROFILE_BYTES = 50_000_000


def read_profile(text: str, name: str, unit: str, duration_s: float) -> Profile:
    """Return a profile from "500rpm", "300..1500rpm" (linear over the duration) or a CSV file.

    Parameters
    ----------
    text : str
    name : str
        Column of the CSV file, with its unit: "speed_rpm".
    unit : str
    duration_s : float
    """
    from sims.machine import Profile

    if text.strip().lower().endswith(".csv"):
        path = Path(text.strip())
        profile = read_profile_file(path, name)
        for held in _span_messages(profile, duration_s):
            typer.echo(f"Note: {path.name}: {held}", err=True)
        return profile
    if ".." in text:
        return Profile.of([0.0, duration_s], span(text, unit, name))
    return Profile.constant(quantity(text, unit, name))


def _span_messages(profile: Profile, duration_s: float) -> list[str]:
    """Return messages about a profile that does not span the recording."""
    first_s, last_s = float(profile.times_s[0]), float(profile.times_s[-1])
    begins = f"begins at {first_s:g} s; its first value is held from 0 s"
    ends = f"ends at {last_s:g} s of {duration_s:g} s; its last value is held"
    return [begins] * (first_s > 0.0) + [ends] * (last_s < duration_s)


def read_profile_file(path: Path, name: str) -> Profile:
    """Read a profile from a CSV file with the columns time_s and `name`."""
    from sims.machine import Profile

    try:
        if path.stat().st_size > MAX_PROFILE_BYTES:
            raise InputError("is too long for a profile", where=path.name, allowed="up to 50 MB")
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [(n, row) for n, row in enumerate(csv.reader(file), 1) if any(cell.strip() for cell in row)]
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the path") from None
    except (UnicodeDecodeError, csv.Error):
        raise InputError("is not a CSV file in UTF-8", where=path.name) from None
    titles = [cell.strip() for cell in rows[0][1]] if rows else []
    if titles != ["time_s", name] or len(rows) < 2:
        raise InputError(
            f"starts with {', '.join(titles) or 'nothing'}" if titles != ["time_s", name] else "holds no points",
            where=path.name,
            allowed=f"a line 'time_s,{name}' and a line for each point",
        )
    points = [_point(row, f"{path.name}: line {number}") for number, row in rows[1:]]
    try:
        return Profile.of([p[0] for p in points], [p[1] for p in points])
    except InputError as error:
        raise InputError(error.what, where=path.name, allowed=error.allowed) from None


def _point(row: list[str], where: str) -> tuple[float, float]:
    try:
        time_s, value = (float(cell) for cell in row)
    except ValueError:
        raise InputError(f"holds {', '.join(row)[:60]!r}", where=where, allowed="two numbers") from None
    if not (isfinite(time_s) and isfinite(value)):
        raise InputError(f"holds {', '.join(row)[:60]!r}", where=where, allowed="finite numbers")
    return time_s, value
