"""The views of one channel: which spectrum, which cursors, which stretch."""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.spectrum import show_spectrum
from app.dashboard.widgets.speed import show_unknown_speed
from gearsig.diagnosis.types import Analysis, CannotTell, ChannelAnalysis
from gearsig.report.lines import (
    bearing_cursors,
    highest_order_of_interest,
    line_cursors,
    marked_positions,
    speed_is_constant,
)

STARTS_AND_STOPS = (
    "The machine starts and stops: spectra, orders and averages want a speed that lasts. Backlash, impacts and forces "
    "stand on the tab Starts and stops, where the motion of both gears was recorded."
)
ChannelView = Callable[[Analysis, ChannelAnalysis], None]


def show_of_channel(analysis: Analysis, view: ChannelView) -> None:
    """Show a view of the channel that the user chooses; the first is the one with the most important finding."""
    channels = {channel.channel: channel for channel in analysis.channels}
    if not channels:
        is_unsteady = any(finding.code == "start-stop" for finding in analysis.findings)
        st.info(STARTS_AND_STOPS if is_unsteady else "There is no vibration channel with a signal.")
        return
    named = [name for finding in analysis.findings for name in finding.where.channels if name in channels]
    names = list(dict.fromkeys([*named, *channels]))
    name = names[0]
    if len(names) > 1:
        column = st.columns(3)[0]
        name = column.selectbox("Channel", list(channels), index=list(channels).index(name), key=_channel_key(analysis))
    view(analysis, channels[name])


def _channel_key(analysis: Analysis) -> str:
    return state.view_key(state.CHANNEL, analysis)


def show_frequency_spectrum(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the amplitude spectrum over frequency."""
    spectrum = channel.spectrum
    cursors = line_cursors(analysis, spectrum) if speed_is_constant(analysis) else ()
    marked = marked_positions(analysis, spectrum, channel.channel)
    show_spectrum(analysis, spectrum, cursors, f"spectrum of {channel.channel}", marked=marked)
    if not cursors and not isinstance(analysis.shaft_angle, CannotTell):
        st.caption("The speed changes, so lines that follow it are smeared over frequency: see the order spectrum.")


def show_order_spectrum(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the spectrum over orders of the reference shaft."""
    spectrum = channel.order_spectrum
    if spectrum is None:
        _say_why_no_orders(analysis)
        return
    show_spectrum(
        analysis,
        spectrum,
        line_cursors(analysis, spectrum),
        f"orders of {channel.channel}",
        marked=marked_positions(analysis, spectrum, channel.channel),
        shown=(0.0, highest_order_of_interest(analysis, spectrum)),
    )


def show_envelope(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the envelope spectrum, where impacts of bearings and teeth show as lines."""
    spectrum = channel.envelope_spectrum
    if spectrum is None:
        st.info("There is no envelope spectrum: no frequency band carries enough of the signal.")
        return
    cursors = bearing_cursors(analysis, spectrum)
    bearings = [cursor.position for cursor in cursors if cursor.kind == "bearing"]
    end = float(spectrum.positions[-1])
    shown = (0.0, min(end, 1.08 * max(bearings))) if bearings and spectrum.resolution < max(bearings) else None
    if channel.envelope_band_hz is not None:
        low, high = channel.envelope_band_hz
        st.markdown(f"Envelope of {as_typed(channel.channel)} in the band **{low:.0f} to {high:.0f} Hz**")
    marked = marked_positions(analysis, spectrum, channel.channel, of_bearings=True)
    name = f"envelope of {channel.channel}"
    show_spectrum(analysis, spectrum, cursors, name, marked=marked, shown=shown, scale="Linear")


def _say_why_no_orders(analysis: Analysis) -> None:
    if isinstance(analysis.shaft_angle, CannotTell):
        show_unknown_speed(analysis.shaft_angle)
    else:
        st.info("There are too few revolutions for an order spectrum.")
