"""Depth of a crack in a tooth root, with its interval and reasons, against a reference where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.cached import read_recording_bytes, read_recording_file, sha256_of_upload
from app.dashboard.methods.signals import choose_one
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import show_picture
from app.dashboard.widgets.verdict import show_error
from app.samples import samples
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import GearsigError, RefusalError
from gearsig.plot import crack_comparison_figure
from gearsig.severity import CrackEstimate, NoCrackSeen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gearsig.checks import FloatArray
    from gearsig.recording import Recording
    from gearsig.rig import Rig


# --------------------
# The mean revolution of the gear with the crack, beside that of the sound gear where both count from a mark.
# --------------------


TO_MPS2 = {"m/s^2": 1.0, "mm/s^2": 1e-3, "g": 9.80665}
HALF_CONTACT = 0.8
"""Pitches from a tooth's entry to the middle of its engagement, at a contact ratio of 1.6."""
N_TURNS = 3
"""The mean revolution is repeated, so that the tooth in the middle has a whole neighbourhood."""
SOUND, NOW = "reference", "recording"


def crack_figure(recording: Recording, reference: Recording | None, found: CrackEstimate, channel: str) -> Figure:
    """Return the figure of an estimate.

    Parameters
    ----------
    recording, reference : Recording
        The reference is shown where the estimate names a tooth: angles then count from a mark in both.
    found : CrackEstimate
    channel : str
        An acceleration.

    Raises
    ------
    RefusalError
        If the channel's unit is no acceleration, or the rig lacks what the average needs.
    """
    mean = mean_residual(recording, found, channel)
    cases, change = {NOW: mean}, {}
    if reference is not None and found.tooth is not None:
        sound = mean_residual(reference, found, channel, n_angles=len(mean))
        cases, change = {SOUND: sound, NOW: mean}, {NOW: mean - sound}
    n_teeth = _teeth(recording, found)
    entry = (found.angle_deg / 360.0 - HALF_CONTACT / n_teeth) % 1.0
    return crack_comparison_figure(
        np.arange(N_TURNS * len(mean)) / len(mean),
        {name: np.tile(values, N_TURNS) for name, values in cases.items()},
        impacts_rev=[turn + entry for turn in range(N_TURNS)],
        n_teeth=n_teeth,
        change_mps2={name: np.tile(values, N_TURNS) for name, values in change.items()} or None,
    )


def mean_residual(
    recording: Recording, found: CrackEstimate, channel: str, *, n_angles: int | None = None
) -> FloatArray:
    """Return one mean revolution of the gear's shaft without mesh harmonics, in m/s²."""
    from gearsig.angle import find_shaft_angle, resample_to_angle
    from gearsig.orders import separate, synchronous_average

    scale = TO_MPS2.get(recording.channels[recording.index(channel)].unit)
    rig = recording.rig
    ratio = rig.ratio(found.shaft) if rig is not None else None
    if scale is None or ratio is None:
        raise RefusalError(
            f"there is no figure: the unit of channel {channel!r} is no acceleration",
            remedy="state the unit in the rig's [[sensor]] table",
        )
    angle = find_shaft_angle(recording, rig).between(0.0, recording.duration_s)
    turned = angle if ratio == 1.0 else angle.of_shaft(found.shaft, ratio)
    signal = resample_to_angle(recording, turned, channels=[channel], samples_per_revolution=n_angles)
    parts = separate(synchronous_average(signal, channel), _teeth(recording, found))
    return parts.residual.values * scale


def _teeth(recording: Recording, found: CrackEstimate) -> int:
    name = found.gear.rpartition("/")[0]
    pairs = recording.rig.pairs if recording.rig is not None else ()
    teeth = next((pair.teeth(found.shaft) for pair in pairs if pair.name == name), None)
    if teeth is None:
        raise RefusalError("there is no figure: the teeth of the gear are not known", remedy="complete the rig file")
    return teeth


# --------------------
# A recording of the sound machine to compare with: a file of the user's, or one of the samples.
# --------------------


NONE, OWN, SAMPLE, SIDEBAR = "None", "Own file", "Sample", "As in the sidebar"
REFERENCE_CHOICE_N_KEPT = 2


@dataclass(frozen=True)
class Reference:
    """A recording, None where there is none; `key` stands for it in caches."""

    recording: Recording | None
    key: str


def choose_reference(analysis: Analysis) -> Reference:
    """Let the user give a reference; it is read with the rig of the recording that is analysed.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    left, right = st.columns(2, vertical_alignment="bottom")
    with left:
        about = "The same gears, sensors, speed and load when they were sound. Without it only deep cracks show."
        given = () if analysis.reference is None else (SIDEBAR,)
        origin = choose_one(
            "Reference", (*given, NONE, OWN, SAMPLE), state.view_key("reference origin", analysis), about=about
        )
    if origin == SIDEBAR and analysis.reference is not None:
        recording = analysis.reference.recording
        return Reference(recording, f"{recording.provenance.sha256} {recording.sampling_rate_hz!r} {analysis.rig!r}")
    with right:
        if origin == OWN:
            return _own(analysis)
        if origin == SAMPLE:
            return _sample(analysis)
    return Reference(None, "")


def _own(analysis: Analysis) -> Reference:
    from gearsig.recording import FORMAT_OF_EXTENSION

    file = st.file_uploader(
        "Recording of the sound gears",
        type=[*FORMAT_OF_EXTENSION, ".gz"],
        key=state.view_key("reference file", analysis),
        help="Read with the rig, and the sampling rate and speed, of the recording that is analysed.",
    )
    if file is None:
        st.caption("Without a reference until a file is given.")
        return Reference(None, "")
    content = file.getbuffer()
    digest = sha256_of_upload(file.file_id, content)
    return _read(analysis, file.name, digest, content)


def _sample(analysis: Analysis) -> Reference:
    from gearsig.recording import sha256_of

    names = {sample.recording: sample.rig.stem.replace("_", " ").capitalize() for sample in samples()}
    open_now = analysis.recording.provenance.source
    paths = [path for path in names if path.name != open_now]
    first = next((i for i, path in enumerate(paths) if path.name.startswith("root_crack_0")), 0)
    key = state.view_key("reference sample", analysis)
    path = st.selectbox("Sample of the sound gears", paths, index=first, format_func=names.__getitem__, key=key)
    return _read(analysis, path.name, sha256_of(path), path)


def _read(analysis: Analysis, name: str, digest: str, content: Path | memoryview) -> Reference:
    chosen = state.chosen()
    rate, speed = (None, None)
    if chosen is not None:
        rate, speed = chosen.request.sampling_rate_hz, chosen.request.speed_rpm
    key = f"{digest} {rate!r} {speed!r} {analysis.rig!r}"
    return Reference(_recording(key, name, content, analysis.rig, rate, speed), key)


@st.cache_resource(max_entries=REFERENCE_CHOICE_N_KEPT, show_spinner="Reading the reference …")
def _recording(
    key: str, _name: str, _content: Path | memoryview, _rig: Rig | None, _rate: float | None, _speed: float | None
) -> Recording:
    """Read once; `key` stands for content, rig and what was stated. The recording is frozen, and may be shared."""
    del key
    if isinstance(_content, Path):
        return read_recording_file(_content, rig=_rig, sampling_rate_hz=_rate, speed_rpm=_speed)
    return read_recording_bytes(_content, _name, rig=_rig, sampling_rate_hz=_rate, speed_rpm=_speed)


N_KEPT = 8
EVERY_CHANNEL = "All accelerations"


def show_crack(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the depth of a crack, or how deep one may be that does not show, or why neither can be told."""
    reference = choose_reference(analysis)
    channels = _choose_channels(analysis, channel)
    chosen = state.chosen()
    torque_nm = chosen.request.torque_nm if chosen is not None else None
    recording = analysis.recording
    torque = _torque_text(analysis, torque_nm)
    st.caption(f"Analysed: 0 to {recording.duration_s:.4g} s, the whole recording. {torque}.")
    try:
        with st.spinner("Looking at every tooth …", show_time=True):
            found = severity(_key_of(analysis), reference.key, torque_nm, channels, recording, reference.recording)
    except RefusalError as refusal:
        _show_refusal(refusal)
        return
    _show_answer(found)
    if isinstance(found, CrackEstimate):
        _show_figure(recording, reference.recording, found, channel.channel)
    _show_features(found)


def _choose_channels(analysis: Analysis, channel: ChannelAnalysis) -> tuple[str, ...]:
    """Return the accelerations that are looked at; none for all of them."""
    if sum(c.quantity == "acceleration" for c in analysis.recording.channels) < 2:
        return ()
    names = (EVERY_CHANNEL, "The chosen channel")
    chosen = choose_one("Channels", names, state.view_key("crack channels", analysis))
    return () if chosen == EVERY_CHANNEL else (channel.channel,)


def _torque_text(analysis: Analysis, stated_nm: float | None) -> str:
    """Return the torque that the depth rests on, and where to change it."""
    known = analysis.rig.operating_point.torque_nm if analysis.rig is not None else None
    place = "in the sidebar under “Reference (sound machine)”"
    if stated_nm is not None:
        return f"Torque {stated_nm:g} N·m, as stated {place}"
    return f"Torque {known:g} N·m, of the rig; another one is stated {place}" if known else f"State the torque {place}"


def _key_of(analysis: Analysis) -> str:
    """Return what stands for the recording with all that the user may have changed about it."""
    chosen = state.chosen()
    return repr(chosen.request) if chosen is not None else repr(id(analysis))


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def severity(
    key: str,
    reference_key: str,
    torque_nm: float | None,
    channels: tuple[str, ...],
    _recording: Recording,
    _reference: Recording | None,
) -> CrackEstimate | NoCrackSeen:
    """Return the estimate; the keys stand for both recordings.

    Raises
    ------
    GearsigError
        See `estimate_crack`.
    """
    from gearsig.severity import estimate_crack

    del key, reference_key
    return estimate_crack(_recording, reference=_reference, torque_nm=torque_nm, channels=channels)


def _show_refusal(refusal: RefusalError) -> None:
    """Say why there is no answer, which is one."""
    remedy = f"\n\nWhat would help: {as_typed(refusal.remedy)}." if refusal.remedy else ""
    st.info(f"**The depth cannot be told**: {as_typed(refusal.reason)}.{remedy}", icon=":material/help:")


def _show_answer(found: CrackEstimate | NoCrackSeen) -> None:
    if isinstance(found, NoCrackSeen):
        st.success(as_typed(found.text), icon=":material/check_circle:")
        st.caption(
            "In 95 of 100 cases a deeper crack would have been seen. The chance of as clear an event as the clearest "
            f"one here is {found.p_value:.2g} on sound gears."
        )
    else:
        st.error(as_typed(found.text), icon=":material/error:")
        _show_numbers(found)
    st.markdown("\n".join(f"- {as_typed(reason)}" for reason in found.reasons))


def _show_numbers(found: CrackEstimate) -> None:
    low, high = found.interval_mm
    place = f"tooth {found.tooth}" if found.tooth is not None else "not known"
    kinds = ", ".join(f"{kind} {100.0 * share:.0f} %" for kind, share in found.kind_probabilities.items())
    _show_row(
        ("Depth of a crack", f"{found.depth_mm:.2f} mm, {found.depth_percent:.0f} % of the root"),
        ("90 % interval", f"{low:.2f} to {high:.2f} mm"),
        ("Place", f"{place}, {found.angle_deg:.0f}°, {found.gear}{'' if found.gear_is_certain else ' or its mate'}"),
    )
    _show_row(
        ("Looks like", kinds or found.kind),
        ("Chance of as much on sound gears", f"{found.p_value:.2g}"),
        ("Felt for; squeezed energy there", f"{found.reach_cycles:.1f} mesh cycles; {found.squeezed_rise_db:+.1f} dB"),
    )


def _show_row(*numbers: tuple[str, str]) -> None:
    for column, (name, text) in zip(st.columns(len(numbers)), numbers, strict=True):
        column.caption(name)
        column.markdown(f"**{as_typed(text)}**")


def _show_figure(recording: Recording, reference: Recording | None, found: CrackEstimate, channel: str) -> None:
    try:
        figure = crack_figure(recording, reference, found, channel)
    except GearsigError as error:
        show_error(error)
        return
    show_picture(figure, f"Mean revolution of {found.shaft} without mesh harmonics, with the cracked tooth")
    st.caption(
        f"The mean revolution of shaft {as_typed(found.shaft)} without mesh harmonics, three times in a row; channel "
        f"{as_typed(channel)}. The change is what differs from the reference at the same angle."
        if reference is not None and found.tooth is not None
        else f"The mean revolution of shaft {as_typed(found.shaft)} without mesh harmonics, three times in a row; "
        f"channel {as_typed(channel)}."
    )


def _show_features(found: CrackEstimate | NoCrackSeen) -> None:
    with st.expander("What the answer rests on"):
        columns = {"feature": list(found.features), "value": list(found.features.values())}
        number = st.column_config.NumberColumn(format="%.4g")
        st.dataframe(columns, hide_index=True, column_config={"value": number})
