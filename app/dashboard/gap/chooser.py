"""Choose recordings, healthy references, rig and simulator in the sidebar."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.cached import sha256_of_upload
from app.dashboard.gap.choice import Choice, Source
from app.dashboard.state import Upload
from app.dashboard.widgets.chooser import text_of_upload
from app.dashboard.widgets.comparison import sample_name
from app.samples import Sample, samples

if TYPE_CHECKING:
    from streamlit.runtime.uploaded_file_manager import UploadedFile

SAMPLES, OWN = "Samples", "Own files"
FIRST_SAMPLE, FIRST_REFERENCE = "root_crack_3mm", "root_crack_0mm"
Chosen = tuple[tuple[Source, ...], tuple[Source, ...], tuple[Upload, ...]]
"""Recordings, references, rig files."""
RECORDINGS, REFERENCES, RIGS = "gap recordings", "gap references", "gap rigs"


def choose() -> Choice:
    """Return what the user chose; there may be no recording in it yet."""
    from app.gap.models import gap_models

    with st.sidebar:
        origin = st.radio("Recordings", (SAMPLES, OWN), horizontal=True, key="gap origin", persist_state="session")
        chosen = _choose_samples() if origin == SAMPLES else _choose_files()
        model = st.selectbox("Simulator", gap_models(), key="gap simulator", persist_state="session")
        with st.expander("Not in the files?", icon=":material/tune:"):
            torque = st.number_input(
                "Torque (N·m)",
                min_value=0.0,
                value=None,
                placeholder="from the rig",
                key="gap torque",
                persist_state="session",
                help="Of the input shaft, for all recordings.",
            )
            rate = st.number_input(
                "Sampling rate (Hz)",
                min_value=0.0,
                value=None,
                placeholder="from the files or the rig",
                key="gap rate",
                persist_state="session",
            )
    recordings, references, rigs = chosen
    return Choice(recordings, references, rigs, model, torque or None, rate or None)


def _choose_samples() -> Chosen:
    found = {sample.rig.stem: sample for sample in samples()}
    names = list(found)

    def title(name: str) -> str:
        return sample_name(found[name])

    recordings = st.multiselect(
        "Recordings of one rig",
        names,
        default=[FIRST_SAMPLE] if FIRST_SAMPLE in found else [],
        format_func=title,
        key="gap samples",
        persist_state="session",
        help="Several operating conditions (speeds, loads) of one rig tell more than one.",
    )
    references = st.multiselect(
        "Healthy references",
        [name for name in names if name not in recordings],
        default=[FIRST_REFERENCE] if FIRST_REFERENCE in found and FIRST_REFERENCE not in recordings else [],
        format_func=title,
        key="gap sample references",
        persist_state="session",
        help="The same rig when it was healthy. The answer becomes much surer.",
    )
    st.caption("Simulated, not measured: what is in them is known.")
    return _paths(found, recordings), _paths(found, references), ()


def _paths(found: dict[str, Sample], names: list[str]) -> tuple[Path, ...]:
    return tuple(found[name].recording for name in names)


def _choose_files() -> Chosen:
    from gearsig.recording.identify import FORMAT_OF_EXTENSION

    endings = [*FORMAT_OF_EXTENSION, ".gz"]
    recordings = _uploads(
        "Recordings of one rig", RECORDINGS, endings, "Several operating conditions (speeds, loads) tell more than one."
    )
    rigs = _uploads(
        "Rig file (TOML)",
        RIGS,
        ["toml"],
        "What is known of the machine: teeth, bearings, speed source. A rig file named as a recording overrides speed "
        "and torque of that recording.",
    )
    references = _uploads(
        "Healthy references",
        REFERENCES,
        endings,
        "The same rig when it was healthy. The answer becomes much surer.",
    )
    return recordings, references, rigs


def _uploads(label: str, kind: str, endings: list[str], words: str) -> tuple[Upload, ...]:
    """Return the files of one kind: those in the uploader, else those from before another page was shown."""
    files = st.file_uploader(
        label,
        type=endings,
        accept_multiple_files=True,
        key=kind,
        help=words,
        on_change=state.keep_files,
        args=(kind, ()),
    )
    if files:
        state.keep_files(kind, tuple(_upload(file, is_rig=kind == RIGS) for file in files))
        return state.kept_files(kind)
    kept = state.kept_files(kind)
    if kept:
        st.caption(f"Still open: {as_typed(', '.join(file.name for file in kept))}")
        st.button("Close", on_click=state.keep_files, args=(kind, ()), key=f"close {kind}")
    return kept


def _upload(file: UploadedFile, *, is_rig: bool) -> Upload:
    content = file.getbuffer()
    text = text_of_upload(file) if is_rig else ""
    return Upload(file.name, sha256_of_upload(file.file_id, content), content, file.name, text)
