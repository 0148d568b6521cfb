"""Choose a recording: a sample, or a file of one's own with its rig."""

from __future__ import annotations

from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.cached import sha256_of_upload
from app.dashboard.state import Chosen, Request, Upload
from app.dashboard.widgets.comparison import Comparison, choose_comparison, sample_name
from app.samples import Sample, samples
from gearsig.errors import InputError

if TYPE_CHECKING:
    from streamlit.runtime.uploaded_file_manager import UploadedFile

EXAMPLE_RIG = Path(__file__).parents[2] / "commands" / "example_rig.toml"
ORIGINS = ("Sample", "Own file")


def choose_recording(*, with_reference: bool = True) -> Chosen | None:
    """Return what the user chose in the sidebar, None while there is nothing to open.

    Parameters
    ----------
    with_reference : bool
        Whether to ask for a recording of the sound machine as well.

    Raises
    ------
    InputError
        If the rig file is no text.
    """
    with st.sidebar:
        made = state.simulated()
        state.carry_over(state.ORIGIN)
        origins = ORIGINS if made is None else (*ORIGINS, state.OF_LABORATORY)
        origin = st.radio("Recording", origins, horizontal=True, key=state.ORIGIN, persist_state="session")
        if origin == state.OF_LABORATORY and made is not None:
            return _choose_simulated(made, with_reference)
        return _choose_sample(with_reference) if origin == ORIGINS[0] else _choose_file(with_reference)


def _choose_simulated(made: Chosen, with_reference: bool) -> Chosen:
    st.caption(f"{as_typed(made.request.name)}, from the fault laboratory.")
    request = made.request
    return _described(request.name, request.sha256, request.rig_name, request.rig_text, made.content, with_reference)


def _choose_sample(with_reference: bool) -> Chosen:
    from gearsig.recording.read import sha256_of

    found = samples()
    first = next((sample for sample in found if sample.rig.stem == "damaged_tooth"), found[0])
    state.carry_over(state.SAMPLE, first)
    sample: Sample = st.selectbox("Sample", found, format_func=sample_name, key=state.SAMPLE, persist_state="session")
    st.caption("Simulated, not measured: what is in it is known.")
    name, digest = sample.recording.name, sha256_of(sample.recording)
    return _described(name, digest, sample.rig.name, sample.rig.read_text("utf-8"), sample.recording, with_reference)


def _choose_file(with_reference: bool) -> Chosen | None:
    from gearsig.recording.identify import FORMAT_OF_EXTENSION

    endings = [*FORMAT_OF_EXTENSION, ".gz"]
    kinds = "CSV (also .gz), MAT, WAV, HDF5, Parquet, TDMS or UFF58. It stays on this machine."
    file = st.file_uploader(
        "Recording file", type=endings, key=state.RECORDING_FILE, help=kinds, on_change=state.keep_upload, args=(None,)
    )
    rig_file = st.file_uploader(
        "Rig file (TOML), if you have one",
        type=["toml"],
        key=state.RIG_FILE,
        max_upload_size=1,
        help="What is known of the machine: shafts, teeth, bearings, sensors, speed source. Teeth add mesh orders and "
        "sidebands, bearings their orders.",
    )
    upload = _from_before()
    if file is not None:
        content = file.getbuffer()
        upload = Upload(file.name, sha256_of_upload(file.file_id, content), content)
    if upload is None:
        return None
    if rig_file is not None:
        upload = replace(upload, rig_name=rig_file.name, rig_text=text_of_upload(rig_file))
    state.keep_upload(upload)
    return _described(upload.name, upload.sha256, upload.rig_name, upload.rig_text, upload.content, with_reference)


def _from_before() -> Upload | None:
    """Return the upload that was open before the user looked at another page; it can be closed."""
    kept = state.kept_upload()
    if kept is None or st.session_state.get(state.RECORDING_FILE) is not None:
        return None
    st.caption(f"Still open: {as_typed(kept.name)}")
    st.button("Close it", on_click=state.keep_upload, args=(None,), key="close the upload")
    return kept


def text_of_upload(file: UploadedFile) -> str:
    """Return the text of an uploaded file.

    Raises
    ------
    InputError
        If it is not in UTF-8.
    """
    try:
        return file.getvalue().decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not text in UTF-8", where=file.name, remedy="save the rig file as UTF-8") from None


def _described(
    name: str, digest: str, rig_name: str, rig_text: str, content: Path | memoryview, with_reference: bool
) -> Chosen:
    """Let the user change the rig, state what the file does not, and give a reference."""
    source = f"{digest} {sha256(rig_text.encode()).hexdigest()}"
    with st.expander("Rig", icon=":material/account_tree:"):
        rig_text = _edit_rig(rig_name, rig_text, source)
    for number in ("rate", "speed"):
        state.carry_over(state.source_key(number, source))
    with st.expander("Not in the file?", icon=":material/tune:"):
        rate = st.number_input(
            "Sampling rate (Hz)",
            value=None,
            placeholder="from the file or the rig",
            key=state.source_key("rate", source),
            persist_state="session",
            help="Overrides what the file states.",
        )
        speed = st.number_input(
            "Constant speed (rpm)",
            value=None,
            placeholder="from the file or the rig",
            key=state.source_key("speed", source),
            persist_state="session",
            help="Of the reference shaft, if it held still and is known well. It is refined where the signal shows it.",
        )
    then = choose_comparison(name, digest) if with_reference else Comparison()
    request = Request(name, digest, rig_name, rig_text, rate, speed, then.name, then.sha256, then.torque_nm)
    return Chosen(request, content, then.content)


def _edit_rig(name: str, text: str, source: str) -> str:
    key = state.source_key("rig text", source)
    state.carry_over(key, text)
    edited = st.text_area(
        f"Edit {as_typed(name)} for this session",
        key=key,
        height=320,
        persist_state="session",
        help="TOML. Every table is optional. Ctrl+Enter takes it over.",
    )
    if not (edited or "").strip():
        st.button("Insert an example", on_click=_insert_example, args=(key,), key=state.source_key("example", source))
    return edited or ""


def _insert_example(key: str) -> None:
    st.session_state[key] = EXAMPLE_RIG.read_text(encoding="utf-8")
