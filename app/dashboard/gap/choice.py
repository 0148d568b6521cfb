"""What is to be diagnosed, as it was chosen on the page, and how it becomes files that the diagnosis reads."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.cached import safe_file_name, sha256_of_upload
from app.dashboard.state import Upload
from app.dashboard.theme import as_typed
from app.dashboard.widgets.chooser import sample_name, text_of_upload
from app.gap.run import GapRequest
from app.samples import SampleRecording, samples
from gearsig.errors import InputError
from gearsig.rig import recording_stem

if TYPE_CHECKING:
    from streamlit.runtime.uploaded_file_manager import UploadedFile


Source = Path | Upload


@dataclass(frozen=True)
class Choice:
    """Recordings, references and rig files, on this machine (samples) or in memory (uploads).

    Parameters
    ----------
    recordings, references : tuple of Path or Upload
    rigs : tuple of Upload
        Rig files; one named as a recording is that recording's own, the other one is everybody's.
    model : str
    torque_nm, sampling_rate_hz : float or None
        What the files do not state.
    """

    recordings: tuple[Source, ...]
    references: tuple[Source, ...] = ()
    rigs: tuple[Upload, ...] = ()
    model: str = "cracked"
    torque_nm: float | None = None
    sampling_rate_hz: float | None = None

    @property
    def key(self) -> str:
        """Equal for choices with equal answers."""
        sources = [[_key(one) for one in group] for group in (self.recordings, self.references, self.rigs)]
        return repr((sources, self.model, self.torque_nm, self.sampling_rate_hz))

    @property
    def command(self) -> str:
        """The command that gives the same answer outside the dashboard."""
        words = ["gearsig", "gap", *(name_of(one) for one in self.recordings)]
        common = common_rig(self)
        words += ["--rig", common.name] if common is not None else []
        for one in self.references:
            words += ["--reference", name_of(one)]
        words += ["--torque", f"{self.torque_nm:.15g}Nm"] if self.torque_nm is not None else []
        words += ["--fs", f"{self.sampling_rate_hz:.15g}"] if self.sampling_rate_hz is not None else []
        return shlex.join([*words, "--model", self.model, "-o", "gap"])


def name_of(source: Source) -> str:
    """Return the name of a file as the user knows it."""
    return source.name


def common_rig(choice: Choice) -> Upload | None:
    """Return the rig file that is no recording's own, or the only one there is; None where there is none.

    Raises
    ------
    InputError
        If there are several, or several that are one recording's own.
    """
    if len(choice.rigs) == 1:  # all recordings are of one rig, whatever its file is called
        return choice.rigs[0]
    own = [own_rig(one, choice.rigs) for one in (*choice.recordings, *choice.references)]
    others = [rig for rig in choice.rigs if rig not in own]
    if len(others) > 1:
        raise InputError(
            f"{len(others)} rig files are named as no recording: {', '.join(rig.name for rig in others)}",
            allowed="one for all recordings, and one named as each recording",
        )
    return others[0] if others else None


def own_rig(source: Source, rigs: tuple[Upload, ...]) -> Upload | None:
    """Return the rig file that is named as a recording (`run.5Nm.csv.gz`: `run.5Nm.toml`), None if there is none.

    Raises
    ------
    InputError
        If there are several.
    """
    found = [rig for rig in rigs if recording_stem(rig.name) == recording_stem(name_of(source))]
    if len(found) > 1:
        raise InputError(
            f"{len(found)} rig files are named as this recording: {', '.join(rig.name for rig in found)}",
            where=name_of(source),
            allowed="one",
            remedy="remove all but one of them",
        )
    return found[0] if found else None


def files_of(choice: Choice, folder: Path) -> GapRequest:
    """Write the uploads into a folder and return what the diagnosis is asked.

    Raises
    ------
    InputError
        If there is more than one rig file for all, or for one recording.
    """
    common = common_rig(choice)
    rig = None
    if common is not None:
        rig = folder / "rig.toml"
        rig.write_text(common.rig_text, encoding="utf-8")
    numbered = enumerate((*choice.recordings, *choice.references), 1)
    paths = [_written(one, folder / str(i), choice.rigs) for i, one in numbered]
    n = len(choice.recordings)
    return GapRequest(
        tuple(paths[:n]),
        tuple(paths[n:]),
        rig,
        () if choice.torque_nm is None else (choice.torque_nm,),
        choice.sampling_rate_hz,
        tuple(name_of(one) for one in choice.recordings),
        tuple(name_of(one) for one in choice.references),
    )


def _written(source: Source, folder: Path, rigs: tuple[Upload, ...]) -> Path:
    """Return the file of a source; an upload gets a folder of its own, with its own rig file beside it."""
    if isinstance(source, Path):
        return source
    folder.mkdir()
    path = folder / safe_file_name(source.name)
    path.write_bytes(source.content)
    rig = own_rig(source, rigs)
    if rig is not None:
        path.with_name(f"{recording_stem(path.name)}.toml").write_text(rig.rig_text, encoding="utf-8")
    return path


def _key(source: Source) -> str:
    return str(source) if isinstance(source, Path) else f"{source.name} {source.sha256}"


# --------------------
# Choose recordings, healthy references, rig and simulator in the sidebar.
# --------------------


SAMPLES, OWN = "Samples", "Own files"
FIRST_SAMPLE, FIRST_REFERENCE = "root_crack_3mm", "root_crack_0mm"
Chosen = tuple[tuple[Source, ...], tuple[Source, ...], tuple[Upload, ...]]
"""Recordings, references, rig files."""
RECORDINGS, REFERENCES, RIGS = "gap recordings", "gap references", "gap rigs"


def choose() -> Choice:
    """Return what the user chose; there may be no recording in it yet."""
    from app.gap.run import gap_models

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


def _paths(found: dict[str, SampleRecording], names: list[str]) -> tuple[Path, ...]:
    return tuple(found[name].recording for name in names)


def _choose_files() -> Chosen:
    from gearsig.recording import FORMAT_OF_EXTENSION

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
