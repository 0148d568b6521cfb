"""Argument checks of the public functions: each raises an `InputError` that names the parameter."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from os import PathLike
from pathlib import Path, PurePath
from types import UnionType
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from gearsig.errors import InputError
from gearsig.formatting import counted

FloatArray = NDArray[np.floating[Any]]
ComplexArray = NDArray[np.complexfloating[Any, Any]]
T = TypeVar("T")


def number(value: float, name: str, unit: str = "", *, remedy: str = "") -> float:
    """Return `value` as float if it is finite."""
    return _number(value, name, unit, remedy=remedy)


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


def instance_of(value: T, kinds: type | UnionType, name: str, *, remedy: str = "") -> T:
    """Return `value` unchanged if it is an instance of one of the types.

    Parameters
    ----------
    value : object
    kinds : type or union of types
        If None is among them, the value may be left out.
    name : str
    remedy : str

    Examples
    --------
    >>> instance_of(5, int | None, "n"), instance_of(None, int | None, "n")
    (5, None)
    """
    if not isinstance(value, kinds):
        raise InputError(f"{name} is {short(value)}", allowed=", ".join(_names(kinds)), remedy=remedy)
    return value


def _names(kinds: type | UnionType) -> list[str]:
    """Return the names of types as users know them."""
    plain = {type(None): "None", str: "text", np.ndarray: "array", PathLike: "path"}
    return [plain.get(kind, kind.__name__) for kind in get_args(kinds) or (kinds,)]


def check_texts(owner: object, *names: str) -> None:
    """Raise InputError on fields of an object that are not text."""
    for name in names:
        instance_of(getattr(owner, name), str, f"{name} of {short(owner)}")


def listed(values: Iterable[T], name: str, of: type | UnionType, *, remedy: str = "") -> tuple[T, ...]:
    """Return values as a tuple if each is an instance of `of`; a text or a single value raises.

    With `of=object` the caller checks the values.

    Examples
    --------
    >>> listed(["a1", "a2"], "channels", str)
    ('a1', 'a2')
    """
    kinds = "" if of is object else f" of {' or '.join(_names(of))}"
    several = _several(values, name, f"a list or tuple{kinds}", of, remedy)
    for place, value in enumerate(several):
        instance_of(value, of, f"{name}[{place}]", remedy=remedy)
    return several


def listed_numbers(values: Iterable[float], name: str, *, remedy: str = "") -> tuple[float, ...]:
    """Return numbers as floats if each is finite; a text or a single number raises.

    Examples
    --------
    >>> listed_numbers([1, 2.5], "orders")
    (1.0, 2.5)
    """
    several = _several(values, name, "a list, tuple or array of numbers", int | float, remedy)
    return tuple(_number(value, f"{name}[{place}]", "", remedy=remedy) for place, value in enumerate(several))


def limits(values: Iterable[float], name: str, unit: str = "") -> tuple[float, float]:
    """Return a lower and an upper limit as floats if they are two numbers; the caller checks their order.

    Examples
    --------
    >>> limits([1000, 2e3], "band_hz", "Hz")
    (1000.0, 2000.0)
    """
    allowed = f"two numbers, (lower, upper){f' in {unit}' if unit else ''}"
    pair = _several(values, name, allowed, object, "give both") if not isinstance(values, dict) else ()
    if len(pair) != 2:
        raise InputError(f"{name} is {short(values)}", allowed=allowed, remedy="give both")
    low, high = (_number(value, f"{name}[{place}]", "", remedy="") for place, value in enumerate(pair))
    return low, high


def _several(values: Iterable[T], name: str, allowed: str, of: type | UnionType, remedy: str) -> tuple[T, ...]:
    if not isinstance(values, str | bytes):  # which would be taken letter by letter
        with suppress(TypeError):
            return tuple(values)
    if not remedy and isinstance(values, of):
        remedy = f"write [{short(values)}]" if isinstance(values, _SHOWN) else "put it into a list"
    raise InputError(f"{name} is {short(values)}", allowed=allowed, remedy=remedy)


def count(value: int, name: str, *, minimum: int = 1, maximum: int | None = None, remedy: str = "") -> int:
    """Return `value` as int if it is a whole number from `minimum` to `maximum` (None: no upper limit).

    Examples
    --------
    >>> count(13, "level", maximum=12)
    Traceback (most recent call last):
    ...
    gearsig.errors.InputError: level is 13 (allowed: a whole number from 1 to 12)
    """
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    if not whole or value < minimum or (maximum is not None and value > maximum):
        limits = f"of at least {minimum}" if maximum is None else f"from {minimum} to {maximum}"
        raise InputError(f"{name} is {short(value)}", allowed=f"a whole number {limits}", remedy=remedy)
    return int(value)


def one_of(value: str, name: str, allowed: Iterable[str]) -> str:
    """Return `value` if it is among `allowed`; otherwise raise and suggest the closest match."""
    return known_name(value, tuple(allowed), f"{name} is {short(value)}")


def known_name(name: str, names: Iterable[str], complaint: str, *, where: str = "", remedy: str = "") -> str:
    """Return `name` if it is among `names`; else raise with the complaint, all names, and the closest or `remedy`."""
    choices = tuple(names)
    if not isinstance(name, str) or name not in choices:
        shown = choices if len(choices) <= 30 else (*choices[:30], "…")
        hint = closest_match_hint(name, choices) or remedy
        raise InputError(complaint, where=where, allowed=", ".join(shown) or "none", remedy=hint)
    return name


def short(value: object) -> str:
    """Return a value as errors show it, in at most 80 characters; long values and objects are named by their type.

    Examples
    --------
    >>> short(5), len(short("x" * 5000)), short(10**5000)
    ('5', 80, 'a number of thousands of digits')
    >>> short(np.zeros((2, 9))), short([1.0] * 20), short(object())
    ('an array of shape (2, 9)', 'a list of 20', 'an object')
    """
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, PurePath):
        value = str(value)
    if isinstance(value, list | tuple) and len(value) > 8:
        return f"a {type(value).__name__} of {len(value)}"
    if not isinstance(value, _SHOWN):
        kind = type(value).__name__
        return f"{'an' if kind[0] in 'AEIOUaeiou' else 'a'} {kind}"
    try:
        text = repr(value)
    except ValueError:
        return "a number of thousands of digits"
    return text if len(text) <= 80 else f"{text[:79]}…"


_NO_NUMBERS = (str, bytes, bool, np.bool_, np.complexfloating)
_SHOWN = (str, bytes, int, float, complex, np.generic, type(None), list, tuple, dict, type)
"""Types whose `repr` is short and readable."""


def closest_match_hint(value: object, choices: Iterable[str]) -> str:
    """Return "did you mean …?" for a misspelt name, or an empty text; case is ignored.

    Examples
    --------
    >>> closest_match_hint("teth", ["teeth", "module_mm"]), closest_match_hint("RMS", ["rms", "peak"])
    ('did you mean teeth?', 'did you mean rms?')
    """
    from difflib import get_close_matches

    named = {choice.casefold(): choice for choice in choices}
    matches = get_close_matches(str(value)[:200].casefold(), list(named), n=1)
    return f"did you mean {named[matches[0]]}?" if matches else ""


def missing_file_hint(path: Path) -> str:
    """Return the file of a similar name in the folder of a missing one, or else where it was looked for.

    Endings do not count: all recordings of a folder may have the same.
    """
    from difflib import SequenceMatcher, get_close_matches

    folder = path.parent.absolute()
    if not folder.is_dir():
        return f"there is no folder {path.parent}"
    stem = path.stem.casefold()
    with suppress(OSError):  # it may be closed to this user
        for name in get_close_matches(path.name, [sibling.name for sibling in folder.iterdir()], n=10):
            if SequenceMatcher(None, stem, Path(name).stem.casefold()).ratio() > 0.75:
                return f"did you mean {name}? It was looked for in {folder}"
    return f"it was looked for in {folder}"


def frozen_array(values: Any, name: str, *, ndim: int, finite: bool = True) -> FloatArray:
    """Return a read-only float array of `ndim` dimensions; float32 and float64 are kept, others become float64."""
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        masked = int(np.sum(np.ma.getmaskarray(values)))
        remedy = "fill in or cut out the masked values before the analysis"
        raise InputError(
            f"{name} holds {counted(masked, 'masked value')}", allowed="an array of numbers", remedy=remedy
        )
    try:
        array: FloatArray = np.asarray(values)
        if array.dtype not in (np.float32, np.float64):
            _check_real(array, name)
            array = array.astype(np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name} does not hold numbers ({error})", allowed="an array of numbers") from error
    if array.ndim != ndim:
        raise InputError(f"{name} has shape {array.shape}", allowed=f"an array of {counted(ndim, 'dimension')}")
    if finite and not _is_finite(array):
        bad = int(np.size(array) - np.isfinite(array).sum())
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        raise InputError(
            f"{name} holds {counted(bad, 'NaN or infinite value')}, the first at index {first}",
            allowed="finite numbers",
            remedy="cut out the gap or interpolate it before the analysis, knowingly",
        )
    return read_only(array)


def _check_real(array: NDArray[Any], name: str) -> None:
    """Raise on values that NumPy would silently convert to numbers: complex numbers, texts, times."""
    if array.dtype.kind == "c":
        remedy = "take the real part, the magnitude, or each part separately"
        raise InputError(f"{name} holds complex numbers", allowed="real numbers", remedy=remedy)
    if array.dtype.kind in "USmM":
        kind = "times" if array.dtype.kind in "mM" else "text"
        shown = f"{name} is {short(array.item())}" if array.ndim == 0 else f"{name} holds {kind}"
        raise InputError(shown, allowed="an array of numbers", remedy="convert it to numbers first")


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only view: kernels that get only read-only arrays are compiled once."""
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
        Number of dimensions; None: arrays of any shape and type, such as complex or bool, kept as they are.
    """
    for name in names:
        value = getattr(result, name)
        array = read_only(np.asarray(value)) if ndim is None else frozen_array(value, name, ndim=ndim)
        object.__setattr__(result, name, array)


@cache
def type_hints_of(kind: type) -> dict[str, Any]:
    """Return the field types of a dataclass by name, to check a file's values against; cached."""
    return get_type_hints(kind)


def _is_finite(array: FloatArray) -> bool:
    """Whether all values are finite; a finite sum proves it at a third of the cost of checking each value."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(array.sum())) or bool(np.isfinite(array).all())


def _number(
    value: Any, name: str, unit: str, *, minimum: float = -np.inf, exclusive: bool = False, remedy: str
) -> float:
    number = None
    # float() would accept these, too, and lose part of some of them.
    if not isinstance(value, _NO_NUMBERS) and not (isinstance(value, np.ndarray) and value.ndim > 0):
        with suppress(TypeError, ValueError, OverflowError):
            number = float(value)
    if number is None:
        raise InputError(f"{name} is {short(value)}", allowed="a number", remedy=remedy)
    if not np.isfinite(number) or number < minimum or (exclusive and number == minimum):
        sign = ">" if exclusive else ">="
        allowed = f"a finite number {sign} {minimum:g}" if minimum > -np.inf else "a finite number"
        raise InputError(f"{name} is {number:g} {unit}".strip(), allowed=f"{allowed} {unit}".strip(), remedy=remedy)
    return number
