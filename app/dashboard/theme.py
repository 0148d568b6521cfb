"""The page's colours: Streamlit's theme settings, and those of its own figures on light and dark backgrounds."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from gearsig.plot import CURSOR_COLOURS, FAULT, MEASURED, QUIET

DARK_PAPER = "#15171B"
"""Background of the dark page, and of figures inverted for it."""

THEME_OPTIONS = (
    "theme.light.primaryColor=#0072B2",
    "theme.dark.primaryColor=#2B86C5",
    f"theme.dark.backgroundColor={DARK_PAPER}",
    "theme.dark.secondaryBackgroundColor=#22262C",
)

# --------------------
# Colours of the page's own figures: those of the reports, and lighter ones of the same hues on dark backgrounds.
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
