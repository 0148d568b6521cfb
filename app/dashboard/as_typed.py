"""Text from strangers, shown as it was typed: file, channel and machine names are never markup."""

from __future__ import annotations

import re

_MARKUP = re.compile(r"([!-/:-@\[-`{-~])")  # ASCII punctuation, all of which Markdown lets a backslash escape
# Streamlit and its Markdown dialect replace these after the escapes are gone: emoji and icons (:name:), arrows (->),
# addresses (http:, www., a@b). A word joiner, which has no width, breaks the pattern and leaves the looks.
_REPLACED = re.compile(r"(?<=[:@])(?=\S)|(?<=[-<>~=])(?=[-<>~=])|(?<=www)(?=\.)|(?<=www\.)", re.IGNORECASE)
_JOINER = "\u2060"
# Marks that turn the direction of the text around them, and invisible ones, may make a name look like another.
_INVISIBLE = re.compile(r"[\u200b-\u200f\u202a-\u202e\u2060-\u2069\ufeff]")


def as_typed(text: object) -> str:
    r"""Return Markdown that shows `text` letter by letter, on one line.

    Examples
    --------
    >>> print(as_typed("*a1*"))
    \*a1\*
    """
    return _MARKUP.sub(r"\\\1", _REPLACED.sub(_JOINER, one_line(text)))


def as_plot_text(text: object) -> str:
    """Return text for a figure of plotly, which reads a small part of HTML."""
    return one_line(text).replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def one_line(text: object) -> str:
    """Return `text` on one line without control characters."""
    line = "".join(c if c.isprintable() else " " for c in _INVISIBLE.sub(" ", str(text)))
    return " ".join(line.split())
