"""One channel embedded by delays: delay and dimension with their curves, and what can be measured on the path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.phase_measures import (
    show_chaos_test,
    show_divergence,
    show_portrait,
    show_recurrence,
)
from app.dashboard.widgets.methods.phase_motion import show_motion
from app.dashboard.widgets.methods.phase_numbers import frequency_hz, path_key, whole_number
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.picture import show_picture
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.phase.measures import EmbeddingDimension, MutualInformation
    from gearsig.phase.types import PhasePortrait

N_FIRST, N_MOST = 40_000, 200_000
N_KEPT = 6
MOST_DIMENSIONS = 20
VIEWS = {
    "Delay and dimension": None,
    "Portrait and section": show_portrait,
    "Lyapunov exponent": show_divergence,
    "Recurrence": show_recurrence,
    "0–1 test": show_chaos_test,
    "Kind of motion": show_motion,
}


@dataclass(frozen=True)
class Choices:
    """What is embedded, and how; None: the curves decide."""

    low_cut_hz: float | None
    high_cut_hz: float | None
    delay_samples: int | None
    dimension: int | None


def show_embedding(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the parameters, and the chosen view of the path."""
    stretch = choose_stretch(analysis, channel, "embedding", n_first=N_FIRST, n_most=N_MOST)
    with st.expander("Band, delay and dimension", icon=":material/tune:"):
        choices = _choose(analysis, stretch)
    name = choose_one("View", list(VIEWS), path_key("view", analysis), named=False)
    with st.spinner("Looking for delay and dimension …", show_time=True):
        signal = signal_of(stretch.key, choices.low_cut_hz, choices.high_cut_hz, stretch)
        information = information_of(stretch.key, choices, signal)
        delay = choices.delay_samples or information.delay_samples
        dimension = dimension_of(stretch.key, choices, delay, signal)
    show = VIEWS[name]
    if show is None:
        _show_curves(information, dimension, choices)
        return
    size = choices.dimension or dimension.dimension
    if size == 0:
        size = dimension.dimensions[-1]
        st.info(
            f"No dimension up to {size} unfolds the path: the signal looks stochastic. {size} dimensions are taken; a "
            "narrower band or a dimension of your own may say more.",
            icon=":material/help:",
        )
    show(analysis, stretch, embedded(signal, delay, size, stretch))


def _choose(analysis: Analysis, stretch: Stretch) -> Choices:
    half = stretch.recording.sampling_rate_hz / 2.0
    about = f"Up to {half:.5g} Hz. Noise above the motion of interest hides its neighbours."
    first, second, third, fourth = st.columns(4)
    return Choices(
        frequency_hz(first, "Lowest frequency (Hz)", "low", analysis, "all"),
        frequency_hz(second, "Highest frequency (Hz)", "high", analysis, "all", about=about),
        whole_number(
            third,
            "Delay (samples)",
            "delay",
            analysis,
            "from the curve",
            about="None: the first minimum of the mutual information.",
        ),
        whole_number(
            fourth,
            "Dimension",
            "dimension",
            analysis,
            "from the curve",
            most=MOST_DIMENSIONS,
            about="None: the smallest without false neighbours.",
        ),
    )


def _show_curves(information: MutualInformation, dimension: EmbeddingDimension, choices: Choices) -> None:
    from gearsig.plot.phase import embedding_figure

    figure = embedding_figure(information, dimension)
    show_picture(figure, "Mutual information over delay, false neighbours over dimension")
    own = "" if choices.delay_samples is None else f" Neighbours are those at your delay of {dimension.delay_samples}."
    st.caption(
        f"Delay {information.delay_samples} samples by the curve ({information.rule}); a dimension unfolds the path "
        f"where fewer than {dimension.threshold:.0%} of the nearest neighbours are false.{own} E2 near 1 at every "
        "dimension says random."
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def signal_of(key: str, low_cut_hz: float | None, high_cut_hz: float | None, _stretch: Stretch) -> PhasePortrait:
    """Return the channel as it is, or within a band; a path of one axis."""
    import numpy as np

    from gearsig.phase.plane import phase_plane_of
    from gearsig.phase.types import PhasePortrait

    del key
    recording, channel = _stretch.recording, _stretch.channel
    rate, values, unit = recording.sampling_rate_hz, recording.values(channel), _stretch.unit
    if low_cut_hz is None and high_cut_hz is None:
        points = np.asarray(values, dtype=np.float64)[:, None]
        if not np.isfinite(points).all():
            raise InputError(
                f"channel {channel!r} has values that are not numbers here", remedy="choose a stretch without gaps"
            )
        return PhasePortrait(points, rate, (channel,), (unit,), "states", channel)
    plane = phase_plane_of(
        values, rate, quantity="displacement", low_cut_hz=low_cut_hz, high_cut_hz=high_cut_hz, source=channel
    )
    points = np.ascontiguousarray(plane.points[:, :1])
    return PhasePortrait(points, rate, (channel,), (unit,), "states", plane.source, plane.start_s, plane.band_hz)


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def information_of(key: str, choices: Choices, _signal: PhasePortrait) -> MutualInformation:
    """Return the mutual information; the first two stand for the signal."""
    from gearsig.phase.mutual_information import average_mutual_information

    del key, choices
    return average_mutual_information(_signal.points[:, 0], _signal.sampling_rate_hz, source=_signal.source)


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def dimension_of(key: str, choices: Choices, delay: int, _signal: PhasePortrait) -> EmbeddingDimension:
    """Return the false neighbours over dimension."""
    from gearsig.phase.dimension import embedding_dimension

    del key, choices
    return embedding_dimension(
        _signal.points[:, 0], _signal.sampling_rate_hz, delay_samples=delay, source=_signal.source
    )


def embedded(signal: PhasePortrait, delay: int, dimension: int, stretch: Stretch) -> PhasePortrait:
    """Return the path; it takes no memory of its own."""
    from dataclasses import replace

    from gearsig.phase.embedding import delay_embedding

    path = delay_embedding(
        signal.points[:, 0],
        signal.sampling_rate_hz,
        delay_samples=delay,
        dimension=dimension,
        unit=stretch.unit,
        source=signal.source,
    )
    return replace(path, start_s=signal.start_s)
