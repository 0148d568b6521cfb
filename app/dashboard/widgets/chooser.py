"""Choose a recording: a sample, or a file of one's own with its rig."""

from __future__ import annotations

from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.cached import sha256_of_upload
from app.dashboard.state import AnalysisRequest, Chosen, Upload
from app.dashboard.theme import as_typed
from app.samples import SampleRecording, samples
from gearsig.errors import InputError

if TYPE_CHECKING:
    from streamlit.runtime.uploaded_file_manager import UploadedFile


# --------------------
# What the recording is compared with: the same machine when it was sound, and the torque that depths rest on.
# --------------------


NOTHING, OWN = "None", "Own file"


@dataclass(frozen=True)
class ReferenceAndTorque:
    """A reference, without a name where there is none, and a torque that the rig does not state."""

    name: str = ""
    sha256: str = ""
    content: Path | memoryview | None = None
    torque_nm: float | None = None


def choose_comparison(name: str, source: str) -> ReferenceAndTorque:
    """Let the user give a reference and the torque; `source` stands for the recording called `name`."""
    with st.expander("Reference (sound machine)", icon=":material/compare:"):
        offered = {sample_name(s): s for s in samples() if s.recording.name != name}
        of = st.selectbox(
            "Compared with",
            [NOTHING, OWN, *offered],
            key=state.source_key("reference", source),
            persist_state="session",
            help="The same machine when it was sound: same sensors, speed and load. Cracks of a millimetre show "
            "against it, and every indicator is compared. It is read with the rig and the numbers stated above.",
        )
        name, digest, content = _own(source) if of == OWN else _sample(offered.get(of))
        torque = st.number_input(
            "Torque (N·m)",
            min_value=0.0,
            value=None,
            placeholder="from the rig",
            key=state.source_key("torque", source),
            persist_state="session",
            help="For the depth of a crack, instead of the rig's: of the shaft that its operating point names, else of "
            "the reference shaft.",
        )
    return ReferenceAndTorque(name, digest, content, torque or None)


def sample_name(sample: SampleRecording) -> str:
    """Return a sample's name for people."""
    return sample.rig.stem.replace("_", " ").capitalize()


def _sample(sample: SampleRecording | None) -> tuple[str, str, Path | None]:
    from gearsig.recording import sha256_of

    return ("", "", None) if sample is None else (sample.recording.name, sha256_of(sample.recording), sample.recording)


def _own(source: str) -> tuple[str, str, memoryview | None]:
    from gearsig.recording import FORMAT_OF_EXTENSION

    file = st.file_uploader(
        "Recording of the sound machine",
        type=[*FORMAT_OF_EXTENSION, ".gz"],
        key=state.source_key("reference file", source),
        on_change=state.keep_reference,
        args=(source, None),
    )
    kept = state.kept_reference(source)
    if file is not None:
        content = file.getbuffer()
        kept = Upload(file.name, sha256_of_upload(file.file_id, content), content)
        state.keep_reference(source, kept)
    elif kept is not None:
        st.caption(f"Still open: {as_typed(kept.name)}")
    return ("", "", None) if kept is None else (kept.name, kept.sha256, kept.content)


EXAMPLE_RIG = Path(__file__).parents[2] / "cli" / "example_rig.toml"
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
    from gearsig.recording import sha256_of

    found = samples()
    first = next((sample for sample in found if sample.rig.stem == "damaged_tooth"), found[0])
    state.carry_over(state.SAMPLE, first)
    sample: SampleRecording = st.selectbox(
        "Sample", found, format_func=sample_name, key=state.SAMPLE, persist_state="session"
    )
    st.caption("Simulated, not measured: what is in it is known.")
    name, digest = sample.recording.name, sha256_of(sample.recording)
    return _described(name, digest, sample.rig.name, sample.rig.read_text("utf-8"), sample.recording, with_reference)


def _choose_file(with_reference: bool) -> Chosen | None:
    from gearsig.recording import FORMAT_OF_EXTENSION

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
    then = choose_comparison(name, digest) if with_reference else ReferenceAndTorque()
    request = AnalysisRequest(name, digest, rig_name, rig_text, rate, speed, then.name, then.sha256, then.torque_nm)
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
