"""A button that saves what a page shows."""

from __future__ import annotations

from typing import Any

import streamlit as st


def download(label: str, data: Any, name: str, mime: str, *, primary: bool = False) -> None:
    """Show a download button; the page is not run again for it.

    Parameters
    ----------
    label : str
    data : bytes, or callable that returns them
        A callable is called at the click.
    name : str
        Of the file.
    mime : str
    primary : bool
        Whether it is the page's main button.
    """
    st.download_button(
        label,
        data,
        file_name=name,
        mime=mime,
        on_click="ignore",
        type="primary" if primary else "secondary",
        icon=":material/download:",
    )
