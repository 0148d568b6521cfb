"""Tables of results that are sorted and searched, tables of words whose cells wrap, and single facts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from math import isnan
from typing import TYPE_CHECKING, Any, Literal

import streamlit as st

from app.dashboard.theme import as_typed
from gearsig.formatting import with_minus

if TYPE_CHECKING:
    from pandas import DataFrame


def show_table(
    columns: DataFrame | Mapping[str, Any] | Sequence[Mapping[str, Any]],
    *,
    formats: Mapping[str, str | Callable[[float], str]] | None = None,
    number: str = ".5g",
    **looks: Any,
) -> None:
    """Show a table that is sorted by its numbers, however they are written: with the minus sign of axes and texts.

    Parameters
    ----------
    columns : DataFrame, mapping of columns, or sequence of rows
    formats : mapping or None
        Format of single columns, or what writes their numbers.
    number : str
        Format of the other numbers.
    **looks
        As `streamlit.dataframe` takes them.
    """
    import pandas as pd

    frame = pd.DataFrame(columns)
    named = {name: number for name in frame if frame[name].dtype.kind in "fiu"} | dict(formats or {})
    written: dict[Any, Any] = {
        name: form if callable(form) else partial(number_text, form=form) for name, form in named.items()
    }
    st.dataframe(frame.style.format(written, na_rep=""), hide_index=True, **looks)


def number_text(value: float, form: str) -> str:
    """Write a number; nothing where it is not known, which the table marks itself.

    Examples
    --------
    >>> number_text(-1.5e-07, ".4g"), number_text(3.0, "+.1f"), number_text(float("nan"), ".3g")
    ('−1.5e−07', '+3.0', '')
    """
    return "" if value is None or isnan(value) else with_minus(format(value, form)).replace("e-", "e−")


def show_words(columns: Mapping[str, Sequence[Any]], *, border: bool | Literal["horizontal"] = True) -> None:
    """Show a short table whose cells wrap; nothing where it has no rows. Texts may come from files."""
    import pandas as pd

    frame = pd.DataFrame({name: [as_typed(text) for text in texts] for name, texts in columns.items()})
    if len(frame):
        st.table(frame, border=border, hide_index=True)


def show_facts(columns: Iterable[Any], facts: Mapping[str, str]) -> None:
    """Show names with what is known of them, one in each column; texts may come from files."""
    for column, (name, text) in zip(columns, facts.items(), strict=True):
        column.caption(name)
        column.markdown(f"**{as_typed(text)}**")
