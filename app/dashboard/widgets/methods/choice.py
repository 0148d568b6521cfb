"""A choice of one among few, always made and kept while another view is shown."""

from __future__ import annotations

from collections.abc import Sequence

import streamlit as st


def choose_one(
    label: str, options: Sequence[str], key: str, *, default: str = "", about: str = "", named: bool = True
) -> str:
    """Return the chosen option, `default` or else the first one at first.

    Parameters
    ----------
    label : str
    options : sequence of str
    key : str
        Of the widget.
    default : str
    about : str
        Shown on demand.
    named : bool
        Whether the label is shown; screen readers get it in any case.
    """
    first = default or options[0]
    chosen = st.segmented_control(
        label,
        list(options),
        default=first,
        format_func=_capitalised,
        key=key,
        help=about or None,
        label_visibility="visible" if named else "collapsed",
        persist_state="session",
        required=True,
    )
    return str(chosen or first)


def _capitalised(text: str) -> str:
    return text[:1].upper() + text[1:]
