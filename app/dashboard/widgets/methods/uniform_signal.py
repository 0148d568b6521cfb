"""What transforms work on: the stretch over time, or resampled over the shaft's angle."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.stretch import Stretch
from app.dashboard.widgets.methods.waveforms import Waveforms
from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.types import Analysis
from gearsig.errors import RefusalError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gearsig.checks import FloatArray
    from gearsig.timefreq.uniform import UniformSignal


def choose_over_angle(analysis: Analysis, view: str, *, first: str = "Time") -> bool:
    """Return whether a view runs over the shaft's angle; only where the speed is known is there a choice.

    Parameters
    ----------
    analysis : Analysis
    view : str
        For the key.
    first : str
        "Time" or "Shaft angle", chosen at first.
    """
    if not isinstance(analysis.shaft_angle, ShaftAngle):
        st.caption("Over time: there is no shaft angle, as the speed is not known.")
        return False
    about = "Over the shaft's angle, lines are orders: a change of speed does not smear them."
    key = state.view_key(f"{view} over", analysis)
    return choose_one("Over", ("Time", "Shaft angle"), key, default=first, about=about) == "Shaft angle"


def signal_of(stretch: Stretch, *, over_angle: bool) -> UniformSignal:
    """Return the samples over time, or resampled over the shaft's angle.

    Raises
    ------
    RefusalError
        If the angle is asked for and not known in the stretch.
    """
    from gearsig.timefreq.uniform import UniformSignal

    if over_angle:
        return _over_angle(f"{stretch.key} angle", stretch)
    recording = stretch.recording
    return UniformSignal(
        recording.values(stretch.channel),
        recording.sampling_rate_hz,
        start=stretch.start_s,
        unit=stretch.unit,
        source=stretch.channel,
    )


@st.cache_resource(max_entries=2, show_spinner=False)
def _over_angle(key: str, _stretch: Stretch) -> UniformSignal:
    """Resample once; the answer is frozen, so that sessions may share it."""
    from gearsig.angle.interpolation import PASSBAND
    from gearsig.angle.resample import resample_to_angle
    from gearsig.timefreq.uniform import uniform

    del key
    if _stretch.angle is None:
        raise RefusalError(
            "the shaft's angle is not known in this stretch", remedy="choose another stretch, or look over time"
        )
    # As many samples as there are at the highest speed: what goes beyond at lower ones is not valid at all speeds.
    fastest = max(_stretch.angle.speed_range_rpm[1] / 60.0, 1e-9)
    highest = PASSBAND * _stretch.recording.sampling_rate_hz / fastest
    signal = resample_to_angle(_stretch.recording, _stretch.angle, channels=[_stretch.channel], highest_order=highest)
    return uniform(signal, _stretch.channel)


def waveforms_over(signal: UniformSignal, stretch: Stretch, columns: Mapping[str, FloatArray], step: str) -> Waveforms:
    """Return waveforms on the axis of a signal."""
    return Waveforms(
        columns,
        signal.rate,
        signal.start,
        signal.unit,
        stretch.recording.channels[0].quantity,
        f"{step}, of {stretch.channel} from {stretch.start_s:.6g} to {stretch.end_s:.6g} s",
        signal.axis,
        signal.shaft,
    )
