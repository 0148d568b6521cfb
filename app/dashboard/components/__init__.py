"""Components in plain JavaScript, one file each with its style: what Streamlit has no widget for."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from streamlit.components.v2 import component

if TYPE_CHECKING:
    from streamlit.components.v2.types import ComponentRenderer


def component_of(name: str) -> ComponentRenderer:
    """Return the component of `name`.js and `name`.css, which draws into an element of that class."""
    folder = Path(__file__).parent
    css, js = ((folder / f"{name}.{ending}").read_text("utf-8") for ending in ("css", "js"))
    return component(f"gearsig.{name}", html=f'<div class="{name}"></div>', css=css, js=js)
