"""What the recording is compared with: the same machine when it was sound, and the torque that depths rest on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.cached import sha256_of_upload
from app.dashboard.state import Upload
from app.samples import Sample, samples

NOTHING, OWN = "None", "Own file"


@dataclass(frozen=True)
class Comparison:
    """A reference, without a name where there is none, and a torque that the rig does not state."""

    name: str = ""
    sha256: str = ""
    content: Path | memoryview | None = None
    torque_nm: float | None = None


def choose_comparison(name: str, source: str) -> Comparison:
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
    return Comparison(name, digest, content, torque or None)


def sample_name(sample: Sample) -> str:
    """Return a sample's name for people."""
    return sample.rig.stem.replace("_", " ").capitalize()


def _sample(sample: Sample | None) -> tuple[str, str, Path | None]:
    from gearsig.recording.read import sha256_of

    return ("", "", None) if sample is None else (sample.recording.name, sha256_of(sample.recording), sample.recording)


def _own(source: str) -> tuple[str, str, memoryview | None]:
    from gearsig.recording.identify import FORMAT_OF_EXTENSION

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
