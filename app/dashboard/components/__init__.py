"""Components in plain JavaScript, one script and one style each, for what Streamlit has no widget for.

They share `numbers.js`.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from streamlit.components.v2 import component


def component_of(name: str) -> Callable[..., object]:
    """Return the component of `name`.js and `name`.css, which draws into an element of that class, given a key."""
    folder = Path(__file__).parent
    css, numbers, js = ((folder / file).read_text("utf-8") for file in (f"{name}.css", "numbers.js", f"{name}.js"))
    shown = component(f"gearsig.{name}", html=f'<div class="{name}"></div>', css=css, js=numbers + js)

    def show(*, key: str, **looks: Any) -> object:
        return shown(key=element_key(key), **looks)

    return show


def element_key(key: str) -> str:
    """Return the key of a component for Streamlit, which refuses two successive underscores, as file names may have.

    Examples
    --------
    >>> element_key("order spectrum of run__1")
    'order spectrum of run_-_-1'
    """
    return key.replace("_", "_-")
