"""The table of indicators, to filter and to take away."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from gearsig.diagnosis.comparison import Change, changes
from gearsig.diagnosis.types import Analysis
from gearsig.indicators.types import Indicator
from gearsig.plot.display import unit_text

if TYPE_CHECKING:
    from pandas import DataFrame

_FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def show_indicators(analysis: Analysis) -> None:
    """Show the indicators with filters, and offer them as CSV."""
    if not analysis.indicators:
        st.info("There are no indicators: no vibration channel could be analysed.")
        return
    table = indicator_frame(analysis.indicators, changes(analysis) if analysis.reference is not None else ())
    words, channel, place = st.columns(3, vertical_alignment="bottom")
    text = words.text_input("Name contains", key=state.view_key("indicator words", analysis))
    channels = channel.multiselect(
        "Channels", _values(table, "channel"), key=state.view_key("indicator channels", analysis)
    )
    places = place.multiselect(
        "Gear, shaft or band", _values(table, "of"), key=state.view_key("indicator of", analysis)
    )
    kept = table
    if text:
        kept = kept[kept["indicator"].str.contains(text, case=False, regex=False)]
    if channels:
        kept = kept[kept["channel"].isin(channels)]
    if places:
        kept = kept[kept["of"].isin(places)]
    number = st.column_config.NumberColumn(format="%.5g")
    config = {"value": number, "reference": number, "change (dB)": st.column_config.NumberColumn(format="%+.1f")}
    st.dataframe(kept, hide_index=True, width="stretch", height=520, column_config=config)
    left, right = st.columns((3, 1), vertical_alignment="center")
    left.caption(f"{len(kept)} of {len(table)} indicators")
    right.download_button(
        "Download CSV",
        csv_text(kept),
        file_name="indicators.csv",
        mime="text/csv",
        on_click="ignore",
        icon=":material/download:",
        width="stretch",
    )


def indicator_frame(indicators: tuple[Indicator, ...], compared: tuple[Change | None, ...] = ()) -> DataFrame:
    """Return indicators as a table, one per line; with changes also what they were in the reference."""
    from pandas import DataFrame

    rows = [
        {
            "indicator": i.name,
            "value": i.value,
            "unit": unit_text(i.unit),
            "channel": i.channel,
            "of": i.gear or i.bearing or i.shaft or i.band,
            "computed on": i.computed_on,
            "band": i.band,
            "remark": i.note,
        }
        for i in indicators
    ]
    table = DataFrame(rows)
    if compared:
        then = [nan if change is None else change.reference_value for change in compared]
        moved = [nan if change is None or change.change_db is None else change.change_db for change in compared]
        table.insert(2, "reference", then)
        table.insert(3, "change (dB)", moved)
    return table


def csv_text(table: DataFrame) -> str:
    """Return the table as CSV; a name that a spreadsheet would run as a formula gets a quote before it."""
    texts = table.select_dtypes(exclude="number").columns
    safe = table.copy()
    for name in texts:
        safe[name] = [f"'{v}" if str(v).startswith(_FORMULA_STARTS) else v for v in table[name]]
    return safe.to_csv(index=False)


def _values(table: DataFrame, column: str) -> list[str]:
    return [str(value) for value in table[column].unique() if value]
