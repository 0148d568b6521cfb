"""The page's colours in the terms of Streamlit's settings; imports nothing, so that the command line stays quick."""

from __future__ import annotations

import re
from dataclasses import dataclass

import streamlit as st

from gearsig.plot import CURSOR_COLOURS, FAULT, MEASURED, QUIET

DARK_PAPER = "#15171B"
"""Ground of the dark page; figures that are turned over end on it."""

THEME_OPTIONS = (
    "theme.light.primaryColor=#0072B2",
    "theme.dark.primaryColor=#2B86C5",
    f"theme.dark.backgroundColor={DARK_PAPER}",
    "theme.dark.secondaryBackgroundColor=#22262C",
)

# --------------------
# Colours of the page's own figures: those of the reports, and lighter ones of the same hues on dark ground.
# --------------------


@dataclass(frozen=True)
class Palette:
    """Colours by meaning."""

    measured: str
    fault: str
    quiet: str
    cursors: dict[str, str]


_CURSORS_ON_DARK = {
    "mesh": "#3FC79D",
    "sideband": "#3FC79D",
    "shaft": "#E3B341",
    "bearing": "#E3A3CB",
    "hunting": "#A2A8B1",
    "finding": "#FF9A57",
}
LIGHT = Palette(MEASURED, FAULT, QUIET, CURSOR_COLOURS | {"finding": FAULT})
DARK = Palette("#6CB8F0", "#FF9A57", "#A2A8B1", _CURSORS_ON_DARK)
DASHES = {"mesh": "solid", "sideband": "dot", "shaft": "dash", "bearing": "dashdot", "finding": "dash"}


def is_dark() -> bool:
    """Whether the user's page is dark."""
    return st.context.theme.type == "dark"


def palette() -> Palette:
    """Return the colours for the user's page."""
    return DARK if is_dark() else LIGHT


# --------------------
# Text from strangers, shown as it was typed: file, channel and machine names are never markup.
# --------------------


_MARKUP = re.compile(r"([!-/:-@\[-`{-~])")  # ASCII punctuation, all of which Markdown lets a backslash escape
# Streamlit and its Markdown dialect replace these after the escapes are gone: emoji and icons (:name:), arrows (->),
# addresses (http:, www., a@b). A word joiner, which has no width, breaks the pattern and leaves the looks.
_REPLACED = re.compile(r"(?<=[:@])(?=\S)|(?<=[-<>~=])(?=[-<>~=])|(?<=www)(?=\.)|(?<=www\.)", re.IGNORECASE)
_JOINER = "\u2060"
# Marks that turn the direction of the text around them, and invisible ones, may make a name look like another.
_INVISIBLE = re.compile(r"[\u200b-\u200f\u202a-\u202e\u2060-\u2069\ufeff]")
_UNIT = re.compile(r"(?<=\d) (?=(?:%|dB|k?Hz|rpm|[mµ]?m|m/s|N·m|k?N|m?s|J|g|of)(?![\w·]))")


def as_typed(text: object) -> str:
    r"""Return Markdown that shows `text` letter by letter; where it wraps, numbers stay with their units.

    Examples
    --------
    >>> as_typed("*a1*: 2.3 mm (34 %) at 1500 rpm, 12 of 29")
    '\\*a1\\*\\: 2\\.3\xa0mm \\(34\xa0\\%\\) at 1500\xa0rpm\\, 12\xa0of 29'
    """
    return _MARKUP.sub(r"\\\1", _REPLACED.sub(_JOINER, _UNIT.sub("\u00a0", one_line(text))))


def one_line(text: object) -> str:
    """Return `text` on one line without control characters."""
    line = "".join(c if c.isprintable() else " " for c in _INVISIBLE.sub(" ", str(text)))
    return " ".join(line.split())


def capitalised(text: str) -> str:
    """Return `text` with a capital first letter, the others as they are."""
    return text[:1].upper() + text[1:]
