"""What to do while nothing is open."""

from __future__ import annotations

import streamlit as st

TEXT = """
### Open a recording of your own

1. Drop the **recording** in the sidebar: CSV, MAT, WAV, HDF5, Parquet, TDMS or UFF58.
2. Drop its **rig file**, or write one under *Rig*, which opens with the recording. Only what is known need be given:
   teeth add mesh orders, sidebands and tooth pictures; bearings add their orders; a speed source makes orders out of
   frequencies.
3. If the file does not state its **sampling rate** or the **speed**, give them under *Not in the file?*

No recording at hand? The *fault laboratory* makes one, with the faults you choose.

Files stay on this machine. They are read in a private folder that is removed at once.
"""


def show_welcome() -> None:
    """Say how a recording is opened."""
    st.markdown(TEXT)
