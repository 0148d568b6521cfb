"""Methods of the analysis page with parameters of their own: each under the view of the chain it belongs to."""

from __future__ import annotations

from collections.abc import Callable

import streamlit as st

from app.dashboard.methods.crack import show_crack
from app.dashboard.methods.deconvolution import show_deconvolution
from app.dashboard.methods.envelope import show_coherence, show_kurtogram
from app.dashboard.methods.frame import MethodPage
from app.dashboard.methods.modes import show_modes
from app.dashboard.methods.orders import show_order_tracking
from app.dashboard.methods.phase import show_embedding, show_phase_plane
from app.dashboard.methods.time_frequency import show_ridges, show_time_frequency
from app.dashboard.methods.wavelets import show_denoising, show_packets
from app.dashboard.widgets.messages import show_error
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import GearsigError

METHODS: dict[str, tuple[Callable[[MethodPage], None], str]] = {
    "Time–frequency": (
        show_time_frequency,
        "Levels over time and frequency, or over shaft angle and order: shows what comes and goes, and what sweeps.",
    ),
    "Ridges": (
        show_ridges,
        "Follows components along their momentary frequency or order, and gives each one's waveform.",
    ),
    "Wavelet packets": (
        show_packets,
        "Splits the signal into bands of equal width, says how the energy spreads over them, and gives any of them.",
    ),
    "Kurtogram": (
        show_kurtogram,
        "Finds the band that carries impacts, and what rhythm they have: the spectrum of its envelope.",
    ),
    "Cyclic coherence": (
        show_coherence,
        "Finds rhythms in noise and in which band they are, also where no band stands out: for bearings and wear.",
    ),
    "Deconvolution": (
        show_deconvolution,
        "Undoes the path between impacts and sensor, so that each is sharp again: for bearings that ring long.",
    ),
    "Orders (Vold–Kalman)": (
        show_order_tracking,
        "Takes single orders out of the signal as waveforms, also where they cross or lie close together.",
    ),
    "Modes": (
        show_modes,
        "Takes the signal apart into a few narrow-band parts whose frequencies need not be known (VMD).",
    ),
    "Denoising": (
        show_denoising,
        "Takes out noise by thresholds on wavelet coefficients, and shows what was taken out.",
    ),
    "Phase plane": (
        show_phase_plane,
        "Velocity over displacement, with a point once per mesh cycle or revolution: does the motion repeat?",
    ),
    "Embedding and chaos": (
        show_embedding,
        "The motion's path from this one channel: delay, dimension, section, Lyapunov exponent, recurrences, 0–1 test.",
    ),
    "Crack severity": (
        show_crack,
        "How deep a crack in a tooth root is, in mm with an interval; best beside a recording of the healthy gears.",
    ),
}


def show_method(name: str, analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show a method's parameters and its answer for one channel."""
    show, about = METHODS[name]
    st.caption(about)
    try:
        show(MethodPage(analysis, channel, name.partition(" (")[0].lower()))
    except GearsigError as error:
        show_error(error)
