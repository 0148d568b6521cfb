"""Tables of results that are sorted and searched: numbers with the minus sign that axes and texts have."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from math import isnan
from typing import TYPE_CHECKING, Any

import streamlit as st

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
    """Show a table; it is sorted by its numbers, however they are written.

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
