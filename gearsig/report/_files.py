"""Names of report files, and what is checked before they are written."""

from __future__ import annotations

import re
import secrets
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gearsig.errors import InputError

if TYPE_CHECKING:
    from jinja2 import Environment


LONGEST_NAME = 50  # a letter may take four bytes, and file systems stop at 255
_RESERVED = {"index", "con", "prn", "aux", "nul"} | {f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10)}


def page_names(sources: Iterable[str | Path]) -> tuple[str, ...]:
    """Return a safe and unique file name, without ending, for each source, in their order.

    Letters, digits, "-", "_" and "." stay; what else may steer a path or a link becomes "-". Two sources that would
    share a name, also when only case tells them apart, get a number.

    Examples
    --------
    >>> page_names(["a/run 1.csv", "b/run 1.csv", "../../etc/passwd", "index.mat", "…"])
    ('run-1', 'run-1-2', 'passwd', 'index-2', 'recording')
    """
    taken = set(_RESERVED)
    return tuple(_unique(_safe(str(source)), taken) for source in sources)


def check_writable(folder: Path) -> None:
    """Check, before long work, that files can be written into a folder, which need not exist yet.

    Raises
    ------
    InputError
        If it is a file or cannot be written.
    """
    probe = f".{secrets.token_hex(4)}"
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError("is a file", where=str(folder), remedy="choose a folder with -o")
        existing = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
        (existing / probe).mkdir()  # permissions alone do not tell: there are folders that nothing can be made in
        (existing / probe).rmdir()
    except OSError as error:
        raise _unwritable(folder, error) from None


def made_folder(folder: Path) -> Path:
    """Make a folder where there is none, and return it.

    Raises
    ------
    InputError
        If it cannot be made: a file of that name, a place that may not be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"the folder cannot be made ({error.strerror or error})", where=str(folder), remedy="choose another with -o"
        ) from error
    return folder


def _unwritable(path: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot be written ({error.strerror or error})", where=str(path), remedy="choose another folder with -o"
    )


def _safe(source: str) -> str:
    stem = Path(source.replace("\\", "/")).name
    for ending in (".gz", Path(stem.removesuffix(".gz")).suffix):
        stem = stem.removesuffix(ending) or stem
    return re.sub(r"[^\w.-]+", "-", stem).strip(".-_")[:LONGEST_NAME].strip(".-_") or "recording"


def _unique(name: str, taken: set[str]) -> str:
    choice, number = name, 1
    while choice.lower() in taken:
        number += 1
        choice = f"{name}-{number}"
    taken.add(choice.lower())
    return choice


def render(template: str, **values: Any) -> str:
    """Return the page that a template makes of `values`."""
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    from gearsig.plot import unit_text

    environment = Environment(
        loader=PackageLoader("gearsig.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["unit"] = unit_text
    return environment
