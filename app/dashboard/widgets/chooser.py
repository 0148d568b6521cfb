"""Choose a recording: a sample, or a file of one's own with its rig."""

from __future__ import annotations

from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.cached import sha256_of_upload
from app.dashboard.state import Chosen, Request
from app.samples import Sample, samples
from gearsig.errors import InputError

if TYPE_CHECKING:
    from streamlit.runtime.uploaded_file_manager import UploadedFile

EXAMPLE_RIG = Path(__file__).parents[2] / "commands" / "example_rig.toml"
ORIGINS = ("Sample", "Own file")


def choose_recording() -> Chosen | None:
    """Return what the user chose in the sidebar, None while there is nothing to open.

    Raises
    ------
    InputError
        If the rig file is no text.
    """
    with st.sidebar:
        origin = st.radio("Recording", ORIGINS, horizontal=True, key=state.ORIGIN)
        return _choose_sample() if origin == ORIGINS[0] else _choose_file()


def _choose_sample() -> Chosen:
    from gearsig.recording.read import sha256_of

    found = samples()
    first = next((i for i, s in enumerate(found) if s.rig.stem == "damaged_tooth"), 0)
    sample: Sample = st.selectbox("Sample", found, index=first, format_func=_sample_name, key=state.SAMPLE)
    st.caption("Simulated, with a known answer: made by a signal model, not measured.")
    name, digest = sample.recording.name, sha256_of(sample.recording)
    return Chosen(_request(name, digest, sample.rig.name, sample.rig.read_text("utf-8")), sample.recording)


def _sample_name(sample: Sample) -> str:
    return sample.rig.stem.replace("_", " ").capitalize()


def _choose_file() -> Chosen | None:
    from gearsig.recording.identify import FORMAT_OF_EXTENSION

    endings = [*FORMAT_OF_EXTENSION, ".gz"]
    kinds = "CSV (also .gz), MAT, WAV, HDF5, Parquet, TDMS or UFF58. It stays on this machine."
    file = st.file_uploader("Recording file", type=endings, key=state.RECORDING_FILE, help=kinds)
    rig_file = st.file_uploader(
        "Rig file (TOML), if you have one",
        type=["toml"],
        key=state.RIG_FILE,
        max_upload_size=1,
        help="What is known of the machine: shafts, teeth, bearings, sensors, speed source. Teeth add mesh orders and "
        "sidebands, bearings their orders.",
    )
    if file is None:
        return None
    content = file.getbuffer()
    digest = sha256_of_upload(file.file_id, content)
    rig_name, rig_text = (rig_file.name, _text_of(rig_file)) if rig_file is not None else ("rig.toml", "")
    return Chosen(_request(file.name, digest, rig_name, rig_text), content)


def _text_of(file: UploadedFile) -> str:
    try:
        return file.getvalue().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not text in UTF-8", where=file.name, remedy="save the rig file as UTF-8") from None


def _request(name: str, digest: str, rig_name: str, rig_text: str) -> Request:
    """Let the user change the rig and state what the file does not."""
    source = f"{digest} {sha256(rig_text.encode()).hexdigest()}"
    with st.expander("Rig", icon=":material/account_tree:"):
        rig_text = _edit_rig(rig_name, rig_text, source)
    with st.expander("Not in the file?", icon=":material/tune:"):
        rate = st.number_input(
            "Sampling rate (Hz)",
            value=None,
            placeholder="from the file or the rig",
            key=state.source_key("rate", source),
            help="Overrides what the file states.",
        )
        speed = st.number_input(
            "Constant speed (rpm)",
            value=None,
            placeholder="from the file or the rig",
            key=state.source_key("speed", source),
            help="Of the reference shaft, if it held still and is known well. It is refined where the signal shows it.",
        )
    return Request(name, digest, rig_name, rig_text, rate, speed)


def _edit_rig(name: str, text: str, source: str) -> str:
    key = state.source_key("rig text", source)
    st.session_state.setdefault(key, text)
    edited = st.text_area(
        f"Edit {as_typed(name)} for this session",
        key=key,
        height=320,
        help="TOML. Every table is optional. Ctrl+Enter takes it over.",
    )
    if not (edited or "").strip():
        st.button("Insert an example", on_click=_insert_example, args=(key,), key=state.source_key("example", source))
    return edited or ""


def _insert_example(key: str) -> None:
    st.session_state[key] = EXAMPLE_RIG.read_text(encoding="utf-8")
