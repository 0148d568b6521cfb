"""Checks at the public functions: each raises an `InputError` that names the parameter."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.errors import InputError

FloatArray = NDArray[np.floating[Any]]


def positive(value: float, name: str, unit: str = "", *, remedy: str = "") -> float:
    """Return `value` as float if it is finite and above zero."""
    return _number(value, name, unit, minimum=0.0, exclusive=True, remedy=remedy)


def not_negative(value: float, name: str, unit: str = "", *, remedy: str = "") -> float:
    """Return `value` as float if it is finite and not below zero."""
    return _number(value, name, unit, minimum=0.0, exclusive=False, remedy=remedy)


def within(value: float, name: str, low: float, high: float, unit: str = "", *, remedy: str = "") -> float:
    """Return `value` as float if low <= value <= high."""
    number = _number(value, name, unit, remedy=remedy)
    if not low <= number <= high:
        allowed = f"{low:g} to {high:g} {unit}".strip()
        raise InputError(f"{name} is {number:g} {unit}".strip(), allowed=allowed, remedy=remedy)
    return number


def count(value: int, name: str, *, minimum: int = 1, remedy: str = "") -> int:
    """Return `value` as int if it is a whole number of at least `minimum`."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or value < minimum:
        raise InputError(f"{name} is {short(value)}", allowed=f"a whole number of at least {minimum}", remedy=remedy)
    return int(value)


def one_of(value: str, name: str, allowed: Iterable[str]) -> str:
    """Return `value` if it is among `allowed`; name the closest match if it is not."""
    return known_name(value, tuple(allowed), f"{name} is {short(value)}")


def known_name(name: str, names: Iterable[str], complaint: str, *, where: str = "", remedy: str = "") -> str:
    """Return `name` if it is among `names`; else raise with the complaint, all names, and the closest or the remedy."""
    choices = tuple(names)
    if name not in choices:
        shown = choices if len(choices) <= 30 else (*choices[:30], "…")
        hint = closest_match_hint(name, choices) or remedy
        raise InputError(complaint, where=where, allowed=", ".join(shown) or "none", remedy=hint)
    return name


def short(value: object) -> str:
    """Return a value as an error shows it, whoever wrote it: 80 characters at most.

    Examples
    --------
    >>> short(5), len(short("x" * 5000)), short(10**5000)
    ('5', 80, 'a number of thousands of digits')
    """
    try:
        text = repr(value)
    except ValueError:
        return "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:79]}…"


def closest_match_hint(value: object, choices: Iterable[str]) -> str:
    """Return "did you mean …?" for a misspelt name, or nothing.

    Examples
    --------
    >>> closest_match_hint("teth", ["teeth", "module_mm"])
    'did you mean teeth?'
    """
    from difflib import get_close_matches

    matches = get_close_matches(str(value)[:200], list(choices), n=1)
    return f"did you mean {matches[0]}?" if matches else ""


def frozen_array(values: Any, name: str, *, ndim: int, finite: bool = True) -> FloatArray:
    """Return a read-only float array of `ndim` dimensions; float32 and float64 are kept, others become float64."""
    array: FloatArray = np.asarray(values)
    if array.dtype not in (np.float32, np.float64):
        try:
            array = array.astype(np.float64)
        except (TypeError, ValueError) as error:
            raise InputError(f"{name} does not hold numbers ({error})", allowed="an array of numbers") from error
    if array.ndim != ndim:
        raise InputError(f"{name} has shape {array.shape}", allowed=f"an array of {ndim} dimension(s)")
    if finite and not _is_finite(array):
        bad = int(np.size(array) - np.isfinite(array).sum())
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"{name} holds {bad} NaN or infinite value(s), the first at index {first}",
            allowed="finite numbers",
            remedy="cut out the gap or interpolate it before the analysis, knowingly",
        )
    return read_only(array)


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view: a kernel that is given no other arrays is compiled for one kind only."""
    view = array.view()
    view.flags.writeable = False
    return view


def freeze(result: object, *names: str, ndim: int | None = 1) -> None:
    """Make array fields of a frozen dataclass read-only, as `frozen_array` does.

    Parameters
    ----------
    result : dataclass
    names : str
        Its fields.
    ndim : int or None
        Dimensions; None: arrays of any shape and type, such as complex or bool, which are kept as they are.
    """
    for name in names:
        value = getattr(result, name)
        array = read_only(np.asarray(value)) if ndim is None else frozen_array(value, name, ndim=ndim)
        object.__setattr__(result, name, array)


def _is_finite(array: FloatArray) -> bool:
    """Whether all values are finite; a finite sum proves it at once, and costs a third of looking at each."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(array.sum())) or bool(np.isfinite(array).all())


def _number(
    value: float,
    name: str,
    unit: str,
    *,
    minimum: float = -np.inf,
    exclusive: bool = False,
    remedy: str = "",
) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} is {short(value)}", allowed="a number", remedy=remedy) from None
    if not np.isfinite(number) or number < minimum or (exclusive and number == minimum):
        sign = ">" if exclusive else ">="
        allowed = f"a finite number {sign} {minimum:g}" if minimum > -np.inf else "a finite number"
        raise InputError(f"{name} is {number:g} {unit}".strip(), allowed=f"{allowed} {unit}".strip(), remedy=remedy)
    return number
