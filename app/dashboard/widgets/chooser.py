"""Choose recordings: samples, or the user's own files with their rigs."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import streamlit as st

from app.dashboard import address, state
from app.dashboard.cached import kept_file, remember_file, sha256_of_upload
from app.dashboard.state import Chosen, ChosenFile
from app.dashboard.widgets.machine import describe, machine_text, stated, stated_pulses, text_as_stated, text_of
from app.dashboard.widgets.texts import as_typed
from app.samples import SampleRecording, samples
from gearsig.errors import InputError
from gearsig.recording import FORMAT_NAMES, sha256_of

if TYPE_CHECKING:
    from streamlit.runtime.uploaded_file_manager import UploadedFile

KINDS = f"{FORMAT_NAMES}; text also as .gz."
SIMULATED = "Simulated, not measured: what they contain is known."

# --------------------
# One file or several.
# --------------------


def sample_file(sample: SampleRecording) -> ChosenFile:
    """Return a sample with its rig."""
    path, rig = sample.recording, sample.rig
    return ChosenFile(path.name, sha256_of(path), path, rig.name, rig.read_text("utf-8"))


def choose_sample(label: str, key: str, *, first: str = "", name: str = "") -> ChosenFile:
    """Let the user choose a sample.

    Parameters
    ----------
    label, key : str
        Of the widget.
    first : str
        Stem of the sample that is chosen at first.
    name : str
        In the address; empty if the address is updated elsewhere.
    """
    offered = samples()
    at_first = next((sample for sample in offered if sample.rig.stem == first), offered[0])
    if name:
        address.begin(key, name, at_first, address.one_of({sample.rig.stem: sample for sample in offered}))
    state.carry_over(key, at_first)
    sample: SampleRecording = st.selectbox(
        label, offered, format_func=lambda sample: sample.title, key=key, persist_state="session"
    )
    if name:
        address.keep(name, sample.rig.stem, at_first.rig.stem)
    return sample_file(sample)


def choose_files(
    label: str, key: str, *, about: str = KINDS, of_rigs: bool = False, several: bool = True, name: str = ""
) -> tuple[ChosenFile, ...]:
    """Let the user give files; they stay open while other pages are shown, until the user closes them.

    Parameters
    ----------
    label, key : str
        Of the uploader.
    about : str
    of_rigs : bool
        Rig files instead of recordings.
    several : bool
    name : str
        In the address, which names them by tokens of this session; empty if the address is updated elsewhere.

    Raises
    ------
    InputError
        If a rig file is not text.
    """
    if name:
        _open_named(key, name)
    given = st.file_uploader(
        label,
        type=["toml"] if of_rigs else None,  # a recording's name need not have an ending
        accept_multiple_files=several,
        key=state.uploader_key(key),
        help=about,
        on_change=state.keep_files,
        args=(key, ()),
    )
    files = given if isinstance(given, list) else [] if given is None else [given]
    if files:
        state.keep_files(key, tuple(_chosen_file(file, is_rig=of_rigs) for file in files))
    kept = state.kept_files(key)
    if kept and not files:
        st.caption(f"Still open: {as_typed(', '.join(file.name for file in kept))}")
        st.button("Close", on_click=state.keep_files, args=(key, ()), key=f"close {key}")
    if name:
        _name_in_address(key, name, kept)
    return kept


def choose_file(
    label: str, key: str, *, about: str = KINDS, rig: str = "", about_rig: str = "", name: str = ""
) -> ChosenFile | None:
    """Let the user give one recording and, if `rig` labels an uploader for it, its rig file; see `choose_files`.

    Raises
    ------
    InputError
        If the rig file is not text.
    """
    files = choose_files(label, key, about=about, several=False, name=name)
    if rig:
        rig_key = f"{state.uploader_key(key)} rig"
        given = st.file_uploader(rig, type=["toml"], key=rig_key, max_upload_size=1, help=about_rig)
        if files and given is not None:
            files = (replace(files[0], rig_name=given.name, rig_text=text_of(given.name, given.getvalue())),)
            state.keep_files(key, files)
            if name:
                _name_in_address(key, name, files)
    return files[0] if files else None


def choose_with_rig(label: str, key: str, *, about: str = KINDS) -> tuple[ChosenFile | None, bool]:
    """Let the user give one recording and its rig file at once; return it, and whether its rig file was given.

    Raises
    ------
    InputError
        If there are several of either, or the rig file is not text.
    """
    given = st.file_uploader(label, accept_multiple_files=True, key=key, help=about)
    rigs = [file for file in given if file.name.lower().endswith(".toml")]
    recordings = [file for file in given if file not in rigs]
    for files, kind in ((recordings, "recordings"), (rigs, "rig files")):
        if len(files) > 1:
            raise InputError(
                f"{len(files)} {kind} are given: {', '.join(file.name for file in files)}",
                allowed="one recording, and one rig file that describes its machine",
                remedy="remove the others; add tachometer pulse times afterwards, under Machine; for reports on many "
                "recordings use `gearsig report FOLDER`",
            )
    if not recordings:
        return None, bool(rigs)
    recording = _chosen_file(recordings[0], is_rig=False)
    if not rigs:
        return recording, False
    return replace(recording, rig_name=rigs[0].name, rig_text=text_of(rigs[0].name, rigs[0].getvalue())), True


def _open_named(key: str, name: str) -> None:
    """Open the files that the page's address names, if this session holds none or Back asks for them."""
    tokens = address.all_asked(name)
    if not address.follows(key) and state.kept_files(key):
        return
    named = {token: file for token in tokens if (file := kept_file(token)) is not None}
    if named:
        for token, file in named.items():
            state.token_of(key, file.sha256, token)
        state.open_files(key, tuple(named.values()))


def _name_in_address(key: str, name: str, files: tuple[ChosenFile, ...]) -> None:
    """Name files in the page's address by tokens of this session, and keep them for a reload."""
    address.put(name, *(_kept_token(key, file) for file in files))


def _kept_token(key: str, file: ChosenFile) -> str:
    token = state.token_of(key, file.sha256)
    remember_file(token, file)
    return token


def _chosen_file(file: UploadedFile, *, is_rig: bool) -> ChosenFile:
    content = file.getbuffer()
    digest = sha256_of_upload(file.file_id, content)
    return (
        ChosenFile(file.name, digest, content, file.name, text_of(file.name, file.getvalue()))
        if is_rig
        else ChosenFile(file.name, digest, content)
    )


def choose_reference_rate(key: str = "", *, of_several: bool = False, name: str = "reference_rate") -> float | None:
    """Return the sampling rate in Hz that the user states for healthy references, None if the field is empty."""
    label = "Sampling rate of the references (Hz)" if of_several else "Its sampling rate (Hz)"
    about = "For files that do not state it, if it differs from the recording's."
    looks: dict[str, Any] = {"placeholder": "as the recording's", "help": about, "key": key}
    return address.ask_number(st, label, 0.0, name=name, **looks) or None


# --------------------
# The recording of the analysis page, with its machine, its reference, and what its file does not state.
# --------------------

SAMPLE, FILE, NO_REFERENCE = "Sample", "Your file", "None"
MACHINE = "described"
"""In the address: the machine of a sample, as the user has changed it."""


def choose_recording(*, with_reference: bool = True) -> tuple[ChosenFile, Chosen] | None:
    """Return the file that the user chose in the sidebar, with its request; None while there is nothing to open.

    Parameters
    ----------
    with_reference : bool
        Whether to ask for a recording of the healthy machine as well.

    Raises
    ------
    InputError
        If the rig file is not text.
    """
    with st.sidebar:
        made = state.simulated()
        _follow_address()
        state.carry_over(state.ORIGIN)
        origins = (SAMPLE, FILE) if made is None else (SAMPLE, FILE, state.OF_LABORATORY)
        origin = st.radio("Recording", origins, horizontal=True, key=state.ORIGIN, persist_state="session")
        if origin == state.OF_LABORATORY and made is not None:
            file: ChosenFile | None = simulated_file(made)
        elif origin == SAMPLE:
            file = choose_sample("Sample", state.SAMPLE)
            st.caption(SIMULATED)
        else:
            file = choose_file(
                "Recording file",
                state.RECORDING_FILE,
                about=f"{KINDS} It stays on this computer.",
                rig="Rig file (TOML), if you have one",
                about_rig="What is known about the machine. Without a rig file, fill in the form under Machine.",
            )
        if file is None:
            return None
        _keep_address(file, origin)
        return file, _described(file, with_reference)


def _follow_address() -> None:
    """Open what the page's address names, if this session has nothing open yet or Back asks for it."""
    is_open = state.ORIGIN in st.session_state or state.SAMPLE in st.session_state
    if not address.follows(state.ORIGIN) and is_open:
        return
    named = {sample.rig.stem: sample for sample in samples()}.get(address.asked("sample"))
    if named is not None:
        st.session_state[state.SAMPLE], st.session_state[state.ORIGIN] = named, SAMPLE
        changed = kept_file(address.asked(MACHINE))
        if changed is not None and changed.content == named.recording:
            state.token_of(MACHINE, changed.sha256, address.asked(MACHINE))
            describe(sample_file(named), changed.rig_text, changed.pulses)
    token = address.asked("file")
    kept = kept_file(token)
    if kept is not None:
        state.token_of(state.RECORDING_FILE, kept.sha256, token)
        open_file(kept)


def _keep_address(file: ChosenFile, origin: str) -> None:
    """Write what is open to the page's address, with the machine as it stands in this session.

    A sample is named as such, and so is its machine if it was changed; a user's file, or one of the laboratory, is
    named by a token of this session.
    """
    described = replace(file, rig_text=text_as_stated(file), pulses=stated_pulses(file))
    named = {"sample": file.rig_name.removesuffix(".toml")} if origin == SAMPLE else {}
    if origin in (FILE, state.OF_LABORATORY):
        named = {"file": _kept_token(state.RECORDING_FILE, described)}
    elif described != file:
        named[MACHINE] = _kept_token(MACHINE, described)
    for name in ("sample", "file"):
        text = named.get(name, "")
        if address.asked(name) not in ("", text):  # what was asked for is not open, nor are its channels
            address.forget_asked()
    for name in ("sample", "file", MACHINE):
        address.put(name, *([named[name]] if name in named else []))


def open_file(file: ChosenFile) -> None:
    """Let the analysis page open a user's file."""
    state.open_files(state.RECORDING_FILE, (file,))
    st.session_state[state.ORIGIN] = FILE


def open_sample(stem: str) -> None:
    """Let the analysis page open a sample, in the view that shows it best."""
    st.session_state[state.SAMPLE] = next(sample for sample in samples() if sample.rig.stem == stem)
    st.session_state[state.ORIGIN] = SAMPLE
    st.session_state.pop(state.TAB, None)


def simulated_file(made: Chosen) -> ChosenFile:
    """Show which recording the laboratory made, and return it."""
    request = made.request
    st.caption(f"{as_typed(request.name)}, from the fault laboratory.")
    return ChosenFile(request.name, request.sha256, made.content, request.rig_name, request.rig_text)


def _described(file: ChosenFile, with_reference: bool) -> Chosen:
    """Add the machine as it stands in this session, what the file does not state, and a reference."""
    text = machine_text(file)
    request = replace(file, rig_text=text, pulses=stated_pulses(file)).request(
        sampling_rate_hz=stated(file, "rate"), speed_rpm=stated(file, "speed")
    )
    if not with_reference:
        return Chosen(request, file.content)
    reference, rate_hz = _choose_reference(file)
    torque_nm = address.ask_number(
        st,
        "Torque (N·m)",
        0.0,
        name="torque",
        key=state.source_key("torque", file.sha256),
        placeholder="from the machine",
        help="For the depth of a crack, instead of the rig's torque: on the shaft that the rig's operating point "
        "names, or else on the reference shaft.",
    )
    request = replace(request, torque_nm=torque_nm or None)
    if reference is None:
        return Chosen(request, file.content)
    request = replace(
        request, reference_name=reference.name, reference_sha256=reference.sha256, reference_rate_hz=rate_hz
    )
    return Chosen(request, file.content, reference.content)


def _choose_reference(file: ChosenFile) -> tuple[ChosenFile | None, float | None]:
    """Return a recording of the healthy machine, and the sampling rate in Hz that the user states for their file."""
    source = file.sha256
    offered = {s.title: s for s in samples() if s.recording.name != file.name}
    sample_reference = next((s.reference for s in samples() if s.recording == file.content), None)
    first = next((name for name, s in offered.items() if s.recording == sample_reference), NO_REFERENCE)
    names = [NO_REFERENCE, FILE, *offered]
    name = address.ask_one(
        st.selectbox,
        "Compared with (healthy machine)",
        names,
        first=first,
        name="reference",
        key=state.source_key("reference", source),
        help="The same machine when it was healthy: same sensors, speed and load. Cracks of a millimetre show "
        "against it, and every level is compared. It is read with the machine and numbers stated for the recording.",
    )
    reference = sample_file(offered[name]) if name in offered else None
    if name == FILE:
        key = state.source_key("reference file", source)
        reference = choose_file("Recording of the healthy machine", key, name="reference_file")
    if reference is None or name != FILE:
        return reference, None
    return reference, choose_reference_rate(state.source_key("reference rate", reference.sha256))
