"""Components in plain JavaScript, one file each with its style: what Streamlit has no widget for.

They share `numbers.js`.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from streamlit.components.v2 import component

if TYPE_CHECKING:
    from streamlit.components.v2.types import ComponentRenderer


def component_of(name: str) -> ComponentRenderer:
    """Return the component of `name`.js and `name`.css, which draws into an element of that class."""
    folder = Path(__file__).parent
    css, numbers, js = ((folder / file).read_text("utf-8") for file in (f"{name}.css", "numbers.js", f"{name}.js"))
    return component(f"gearsig.{name}", html=f'<div class="{name}"></div>', css=css, js=numbers + js)
