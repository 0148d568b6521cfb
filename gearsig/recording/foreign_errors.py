"""Turns the many exceptions of file-format libraries into one-line input errors."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gearsig.errors import GearsigError, InputError


@contextmanager
def foreign_errors(where: str, file_format: str) -> Iterator[None]:
    """Raise `InputError` where a library fails inside the block; gearsig's own errors pass."""
    try:
        yield
    except GearsigError:
        raise
    except Exception as error:  # parsers raise anything on damaged bytes, one of them bare Exception
        reason = str(error)[:200] or type(error).__name__
        raise InputError(
            f"cannot be read as {file_format} ({reason})",
            where=where,
            allowed=f"a complete {file_format} file",
            remedy="the file is damaged or was cut off: copy or export it again",
        ) from error
