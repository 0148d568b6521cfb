"""The errors that gearsig raises: what is wrong, where, what is allowed and what to do; also for optional engines."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TypeVar

T = TypeVar("T")


class GearsigError(Exception):
    """Base class of all errors that gearsig raises on purpose."""


class InputError(GearsigError, ValueError):
    """Something the user gave is wrong.

    Parameters
    ----------
    what : str
        What was received and why it is not acceptable.
    where : str
        File, place in the file, or parameter name.
    allowed : str
        What would be accepted.
    remedy : str
        What the user can do about it.

    Examples
    --------
    >>> print(InputError("sampling rate is 0 Hz", where="rig.toml", allowed="> 0", remedy="give --fs"))
    rig.toml: sampling rate is 0 Hz (allowed: > 0); give --fs
    """

    def __init__(self, what: str, *, where: str = "", allowed: str = "", remedy: str = "") -> None:
        self.what, self.where, self.allowed, self.remedy = what, where, allowed, remedy
        text = f"{where}: {what}" if where else what
        if allowed:
            text += f" (allowed: {allowed})"
        if remedy:
            text += f"; {remedy}"
        super().__init__(_one_line(text))


class RefusalError(GearsigError):
    """The input is well formed, but the data do not allow an answer.

    Parameters
    ----------
    reason : str
        Why there is no answer, with the evidence.
    remedy : str
        Which data or knowledge would allow one.
    looked_at : object
        Intermediate result that explains the refusal, if any; `gearsig.plot.figure_of_refusal` draws it.
    """

    def __init__(self, reason: str, *, remedy: str = "", looked_at: object = None) -> None:
        self.reason, self.remedy, self.looked_at = reason, remedy, looked_at
        super().__init__(_one_line(f"{reason}; {remedy}" if remedy else reason))


def not_written(error: OSError, where: str | Path, remedy: str = "") -> InputError:
    """Return the error for a file or folder that the operating system does not let write.

    Parameters
    ----------
    error : OSError
        Messages of libraries also contain memory addresses; that of its number is said where it has one.
    where : str or Path
    remedy : str
    """
    reason = os.strerror(error.errno) if error.errno else error
    return InputError(f"cannot be written ({reason})", where=str(where), remedy=remedy)


def answer_or_none(
    ask: Callable[[], T], name: str, refusals: list[str], *, let_through: type[GearsigError] | tuple[()] = ()
) -> T | None:
    """Return what `ask` returns; if it raises a `GearsigError`, return None and add "name: error" to the refusals.

    For results of several parts, where one that the data do not allow must not withhold the others. Errors that concern
    all of them are let through.
    """
    try:
        return ask()
    except let_through:
        raise
    except GearsigError as error:
        refusals.append(f"{name}: {error}")
        return None


@contextmanager
def options_named(names: Mapping[str, str]) -> Iterator[None]:
    """Replace option names in the remedies of errors raised inside, for options of another record.

    Parameters
    ----------
    names : mapping
        Command-line option → the option that does the same for the record being read.

    Examples
    --------
    >>> with options_named({"--fs": "--sim-fs"}):
    ...     raise InputError("states no sampling rate", where="model.csv", remedy="give --fs")
    Traceback (most recent call last):
    ...
    gearsig.errors.InputError: model.csv: states no sampling rate; give --sim-fs
    """
    try:
        yield
    except InputError as error:
        raise InputError(
            error.what, where=error.where, allowed=error.allowed, remedy=_with_options(error.remedy, names)
        ) from None
    except RefusalError as error:
        remedy = _with_options(error.remedy, names)
        raise RefusalError(error.reason, remedy=remedy, looked_at=error.looked_at) from None


def _with_options(text: str, names: Mapping[str, str]) -> str:
    return re.sub(r"--[a-z-]*[a-z]", lambda found: names.get(found[0], found[0]), text)


def unexpected_text(error: BaseException) -> str:
    """Return one line that reports a program error on one of many files."""
    return f"unexpected error, please report: {type(error).__name__}: {' '.join(str(error).split())}"


def _one_line(text: str) -> str:
    """Replace line breaks and control characters, which may come from a file, by spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())


# --------------------
# Other packages that compute the same result, loaded only when chosen by `engine=`.
# --------------------


@contextmanager
def engine_module(name: str) -> Iterator[ModuleType]:
    """Load an optional engine and convert whatever it raises to an `InputError`.

    Parameters
    ----------
    name : str
        Name of the package, which is also the engine's name.

    Raises
    ------
    InputError
        If the package cannot be loaded, or fails inside the block; the remedy names gearsig's own engine.
    """
    try:
        module = import_module(name)
    except Exception as error:  # a package may also break on its own dependencies, with any exception
        raise InputError(
            f"the engine {name} cannot be loaded ({error})",
            where="engine",
            remedy=f'install it with "pip install {name}", or choose engine="gearsig"',
        ) from error
    try:
        yield module
    except GearsigError:
        raise
    except Exception as error:
        raise InputError(
            f"the engine {name} failed ({type(error).__name__}: {error})",
            where="engine",
            remedy='choose engine="gearsig", or a shorter signal',
        ) from error
