"""What a method shows, to take along: whole, not thinned as on the page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.uploads import safe_file_name
from app.dashboard.widgets.methods.waveforms import Waveforms
from gearsig.diagnosis.types import Analysis
from gearsig.recording.types import Channel, Provenance, Recording

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Table = Callable[[], "Mapping[str, ArrayLike]"]
OVER_TIME = (".csv", ".h5", ".wav", ".parquet", ".mat")
"""What recordings are written to; `gearsig.recording.read` reads all of them."""
OVER_ANGLE = (".csv",)
"""A recording runs over time: signals over angle are plain columns."""
MIME = {".csv": "text/csv", ".wav": "audio/wav"}
LARGE_CSV = 2_000_000
"""Numbers beyond which a CSV file takes tens of megabytes."""


def offer_downloads(
    analysis: Analysis, name: str, waveforms: Waveforms | None = None, tables: Mapping[str, Table] | None = None
) -> None:
    """Offer waveforms in a choice of formats, and tables as CSV.

    Parameters
    ----------
    analysis : Analysis
    name : str
        Of the method, for the keys and the names of the files.
    waveforms : Waveforms or None
    tables : mapping or None
        What the table holds → function that returns its columns; called only on download.
    """
    with (
        st.container(horizontal=True, horizontal_alignment="right"),
        st.popover("Download", icon=":material/download:"),
    ):
        if waveforms is not None:
            _offer_waveforms(analysis, name, waveforms)
        for what, table in (tables or {}).items():
            _button(analysis, name, f"{what} (CSV)", partial(_table_file, table), f"{name}-{what}", ".csv")


def _offer_waveforms(analysis: Analysis, name: str, waveforms: Waveforms) -> None:
    endings = OVER_TIME if waveforms.axis == "frequency" else OVER_ANGLE
    key = state.view_key(f"{name} format {endings[-1]}", analysis)
    ending = st.selectbox("Format", endings, key=key, persist_state="session")
    n = len(waveforms.columns) * waveforms.n_samples
    label = f"Waveforms: {len(waveforms.columns)} × {waveforms.n_samples} samples"
    _button(analysis, name, label, lambda: waveforms_file(waveforms, ending), f"{name}-waveforms", ending)
    if ending == ".csv" and n > LARGE_CSV:
        st.caption(f"About {20e-6 * n:.0f} MB as CSV; .h5 is less than half of it.")


def _button(analysis: Analysis, name: str, label: str, content: Callable[[], bytes], stem: str, ending: str) -> None:
    source = safe_file_name(analysis.recording.provenance.source).split(".")[0]
    st.download_button(
        label,
        data=content,
        file_name=f"{source}-{safe_file_name(stem)}{ending}",
        mime=MIME.get(ending, "application/octet-stream"),
        on_click="ignore",
        icon=":material/download:",
        key=state.view_key(f"{name} download {stem}", analysis),
    )


def waveforms_file(waveforms: Waveforms, ending: str) -> bytes:
    """Return a recording of the waveforms in a file's format, or columns over angle.

    Raises
    ------
    InputError
        If the format cannot hold them.
    """
    if waveforms.axis == "order":
        from gearsig.timefreq.types import at_label

        return table_csv({at_label("order", waveforms.shaft): waveforms.at(), **waveforms.columns})
    from gearsig.recording.write import write_recording

    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / f"waveforms{ending}"
        write_recording(recording_of(waveforms), path)
        return path.read_bytes()


def recording_of(waveforms: Waveforms) -> Recording:
    """Return waveforms over time as a recording, one channel each; its time begins at 0."""
    return Recording(
        np.stack(list(waveforms.columns.values())),
        waveforms.rate,
        tuple(Channel(name, waveforms.quantity, waveforms.unit) for name in waveforms.columns),
        provenance=Provenance(history=(waveforms.step,)),
    )


def _table_file(table: Table) -> bytes:
    return table_csv(table())


def table_csv(columns: Mapping[str, ArrayLike]) -> bytes:
    """Return columns of equal length as CSV, numbers with all their digits."""
    import pyarrow as pa
    from pyarrow import csv

    buffer = BytesIO()
    csv.write_csv(pa.table({name: pa.array(np.asarray(values)) for name, values in columns.items()}), buffer)
    return buffer.getvalue()
