"""The errors gearsig raises, each saying what is wrong, where, what is allowed and what to do."""

from __future__ import annotations


class GearsigError(Exception):
    """Base of every error that gearsig raises on purpose."""


class InputError(GearsigError, ValueError):
    """Something the user gave is wrong.

    Parameters
    ----------
    what : str
        What was received and why it does not do.
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
    """The data do not allow an answer; the input is well formed all the same.

    Parameters
    ----------
    reason : str
        Why there is no answer, with the evidence.
    remedy : str
        Which data or knowledge would allow one.
    """

    def __init__(self, reason: str, *, remedy: str = "") -> None:
        self.reason, self.remedy = reason, remedy
        super().__init__(_one_line(f"{reason}; {remedy}" if remedy else reason))


def _one_line(text: str) -> str:
    """Fold line breaks and control characters, which may come from a file, into spaces."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
