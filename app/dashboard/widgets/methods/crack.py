"""Depth of a crack in a tooth root, with its interval and reasons, against a reference where there is one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.errors import show_error
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.crack_view import crack_figure
from app.dashboard.widgets.methods.reference_choice import choose_reference
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import GearsigError, RefusalError
from gearsig.severity.types import CrackEstimate, NoCrackSeen

if TYPE_CHECKING:
    from gearsig.recording.types import Recording

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
    from gearsig.severity.estimate import estimate_crack

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
