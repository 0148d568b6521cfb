"""Depth of a crack in a tooth root, with its interval and reasons, against a reference if there is one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.charts import show_figure, show_lines
from app.dashboard.widgets.method import MethodPage, cached
from app.dashboard.widgets.texts import as_typed, show_error, show_facts, show_table
from gearsig.angle import find_shaft_angle, resample_to_angle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis
from gearsig.errors import GearsigError, RefusalError
from gearsig.formatting import percent, signed
from gearsig.orders import separate, synchronous_average
from gearsig.plot import crack_comparison_figure, search_panels
from gearsig.recording import Recording, metres_per_second_squared
from gearsig.severity import CrackEstimate, NoCrackSeen, ToothSearch, estimate_crack

if TYPE_CHECKING:
    from matplotlib.figure import Figure

severity = cached(8, "Examining every tooth …")(estimate_crack)


def show_crack(page: MethodPage) -> None:
    """Show the depth of a crack, or how deep an undetected one may be, or why neither can be estimated."""
    st.caption(
        "The depth of a crack in a tooth root, in mm with an interval; best against a recording of the healthy gears."
    )
    recording, then = page.analysis.recording, page.analysis.reference
    reference = None if then is None else then.recording
    channels: tuple[str, ...] = ()
    if sum(c.quantity == "acceleration" for c in recording.channels) > 1:
        which = {"All accelerations": False, "The chosen channel": True}
        channels = (page.channel.channel,) if page.choose(st, "Channels", which, name="one_channel") else ()
    chosen = state.chosen()
    torque_nm = chosen.request.torque_nm if chosen is not None else None
    torque = _torque_text(page.analysis, torque_nm)
    beside = "Without a reference only deep cracks show: choose the healthy machine in the sidebar"
    if reference is not None:
        beside = f"Compared with {as_typed(reference.provenance.source)}"
    st.caption(f"Analysed: 0 to {recording.duration_s:.4g} s, the whole recording. {torque}. {beside}.")
    try:
        estimate = severity(recording, reference=reference, torque_nm=torque_nm, channels=channels)
    except RefusalError as refusal:  # a refusal is also an answer
        remedy = f"\n\nWhat would help: {as_typed(refusal.remedy)}." if refusal.remedy else ""
        text = f"**The depth cannot be estimated**: {as_typed(refusal.reason)}.{remedy}"
        st.info(text, icon=":material/help:")
        if isinstance(refusal.looked_at, tuple):
            _show_search(page, refusal.looked_at)
        return
    _show_answer(estimate)
    if isinstance(estimate, NoCrackSeen):
        _show_search(page, estimate.searched)
    else:
        _show_figure(recording, reference, estimate, page.channel.channel)
    with st.expander("What the answer is based on"):
        show_table({"feature": list(estimate.features), "value": list(estimate.features.values())})


def _show_search(page: MethodPage, searched: Sequence[ToothSearch]) -> None:
    """Show what was examined, tooth by tooth, and the level from which a crack would be seen."""
    panels = search_panels(searched)
    places = st.container(key="panels of the search for a crack").columns(max(len(panels), 1))
    for place, panel in zip(places, panels, strict=True):
        with place:
            st.markdown(f"**{as_typed(panel.title)}**")
            show_lines(panel, page.key(f"search {panel.x}"), height_px=260, legend=True)
    if panels:
        st.caption(
            "How far each place stands out from the others, over all bands and channels. At the dotted level, the "
            "gear's clearest event would be seen as a crack; an event above it that is unlike a crack gets no depth."
        )


def _torque_text(analysis: Analysis, stated_nm: float | None) -> str:
    """Return in words the torque that the depth is based on, and where to change it."""
    known = analysis.rig.operating_point.torque_nm if analysis.rig is not None else None
    place = "in the sidebar"
    if stated_nm is not None:
        return f"Torque {stated_nm:g} N·m, as stated {place}"
    return f"Torque {known:g} N·m, from the rig; state another one {place}" if known else f"State the torque {place}"


def _show_answer(estimate: CrackEstimate | NoCrackSeen) -> None:
    if isinstance(estimate, NoCrackSeen):
        st.success(as_typed(estimate.text), icon=":material/check_circle:")
        st.caption(
            "In 95 of 100 cases a deeper crack would have been seen. On healthy gears, the chance of an event as clear "
            f"as the clearest one here is {estimate.p_value:.2g}."
        )
    else:
        st.error(as_typed(estimate.text), icon=":material/error:")
        low, high = estimate.interval_mm
        tooth = f"tooth {estimate.tooth}" if estimate.tooth is not None else "not known"
        gear = f"{estimate.gear}{'' if estimate.gear_is_certain else ' or its mate'}"
        kinds = ", ".join(f"{kind} {percent(share)}" for kind, share in estimate.kind_probabilities.items())
        numbers = {
            "Depth of a crack": f"{estimate.depth_mm:.2f} mm, {estimate.depth_percent:.0f} % of the root",
            "90 % interval": f"{low:.2f} to {high:.2f} mm",
            "Place": f"{tooth}, {estimate.angle_deg:.0f}°, {gear}",
            "Looks like": kinds or estimate.kind,
            "Chance of as much on healthy gears": f"{estimate.p_value:.2g}",
        }
        if estimate.reach_cycles is not None and estimate.squeezed_rise_db is not None:
            rise = f"{signed(estimate.squeezed_rise_db)} dB over a healthy tooth"
            numbers["Event"] = f"{estimate.reach_cycles:.1f} mesh cycles; {rise}"
        show_facts((*st.columns(3), *st.columns(3)), numbers)
    st.markdown("\n".join(f"- {as_typed(reason)}" for reason in estimate.reasons))


def _show_figure(recording: Recording, reference: Recording | None, estimate: CrackEstimate, channel: str) -> None:
    compared = reference if estimate.tooth is not None else None
    try:
        figure = crack_figure(recording, compared, estimate, channel)
    except GearsigError as error:
        show_error(error)
        return
    show_figure(figure, f"Mean revolution of {estimate.shaft}, with the cracked tooth", f"crack {channel}")
    text = f"The mean revolution of shaft {as_typed(estimate.shaft)} without mesh harmonics, shown three times; "
    text += f"channel {as_typed(channel)}."
    if compared is not None:
        text += " The change is what differs from the reference at the same angle."
    st.caption(text)


def crack_figure(recording: Recording, reference: Recording | None, estimate: CrackEstimate, channel: str) -> Figure:
    """Return the figure of an estimate.

    Parameters
    ----------
    recording : Recording
    reference : Recording or None
        Only with an estimate that names a tooth: angles then count from a mark in both.
    estimate : CrackEstimate
    channel : str
        An acceleration.

    Raises
    ------
    RefusalError
        If the channel's unit is not an acceleration, or the rig lacks what the average needs.
    """
    n_teeth = _teeth(recording, estimate)
    mean = _mean_residual(recording, estimate, channel)
    cases, change = {"recording": mean}, {}
    if reference is not None:
        healthy = _mean_residual(reference, estimate, channel, n_angles=len(mean))
        cases, change = {"reference": healthy, "recording": mean}, {"recording": mean - healthy}
    # 0.8 pitches from a tooth's entry to the middle of its engagement, at a contact ratio of 1.6
    entry = (estimate.angle_deg / 360.0 - 0.8 / n_teeth) % 1.0
    n_turns = 3  # so that the tooth in the middle has a whole neighbourhood
    return crack_comparison_figure(
        np.arange(n_turns * len(mean)) / len(mean),
        {name: np.tile(values, n_turns) for name, values in cases.items()},
        impacts_rev=[turn + entry for turn in range(n_turns)],
        n_teeth=n_teeth,
        change_mps2={name: np.tile(values, n_turns) for name, values in change.items()} or None,
    )


def _mean_residual(
    recording: Recording, estimate: CrackEstimate, channel: str, *, n_angles: int | None = None
) -> FloatArray:
    """Return one mean revolution of the gear's shaft without mesh harmonics, in m/s²."""
    scale = metres_per_second_squared(recording.channels[recording.index(channel)])
    rig = recording.rig
    ratio = rig.ratio(estimate.shaft) if rig is not None else None
    if scale is None or ratio is None:
        raise RefusalError(
            f"there is no figure: the unit of channel {channel!r} is not an acceleration",
            remedy="state the unit in the rig's [[sensor]] table",
        )
    angle = find_shaft_angle(recording, rig).between(0.0, recording.duration_s)
    turned = angle if ratio == 1.0 else angle.of_shaft(estimate.shaft, ratio)
    signal = resample_to_angle(recording, turned, channels=[channel], samples_per_revolution=n_angles)
    parts = separate(synchronous_average(signal, channel), _teeth(recording, estimate))
    return parts.residual.values * scale


def _teeth(recording: Recording, estimate: CrackEstimate) -> int:
    teeth = recording.rig.teeth_of(estimate.gear) if recording.rig is not None else None
    if teeth is None:
        raise RefusalError("there is no figure: the teeth of the gear are not known", remedy="complete the rig file")
    return teeth
