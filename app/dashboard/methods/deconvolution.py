"""Impacts made sharp again by a filter that undoes their path to the sensor."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import MethodPage, cached, signal_of, waveforms_of
from gearsig import spectra
from gearsig.errors import RefusalError

most_impulsive = cached(2, "Searching the filter …")(spectra.minimum_entropy_deconvolution)
nearest_to_train = cached(2, "Solving for the filter …")(spectra.multipoint_deconvolution)


def show_deconvolution(page: MethodPage) -> None:
    """Show one channel before and after the filter, at equal rms."""
    one, two, three = st.columns(3)
    about = (
        "Multipoint: nearest to a train of impacts of a known rate. Minimum entropy: most impulsive, whatever it is."
    )
    by_rate = page.choose(one, "Filter", {"Multipoint": True, "Minimum entropy": False}, about=about)
    about = "As long as an impact rings."
    n_taps = int(page.ask(two.slider, "Filter length (samples)", 10, 500, 100, about=about))
    rate_hz = 0.0
    if by_rate:
        about = "How often an impact comes, e.g. how often elements pass a race."
        rate_hz = float(page.ask(three.number_input, "Impacts per second (Hz)", 0.0, value=100.0, about=about))
    segment = page.segment(n_first=100_000)
    x, fs = segment.values, segment.recording.sampling_rate_hz
    if not by_rate:
        result = most_impulsive(x, fs, n_taps=n_taps)
        st.markdown(f"Kurtosis **{result.score:.3g}** (3: Gaussian noise).")
    elif rate_hz > 0:
        result = nearest_to_train(x, fs, 1.0 / rate_hz, n_taps=n_taps)
        chance = np.sqrt(n_taps / len(x))
        st.markdown(f"Likeness to a train of {rate_hz:.5g} Hz: **{result.score:.3g}** (white noise: {chance:.2g}).")
    else:
        raise RefusalError("no rate of the impacts is given", remedy="give how often they come, above 0 Hz")
    y = result.values * float(np.std(x) / np.std(result.values))
    columns = {"signal": x, "sharpened": np.concatenate([np.zeros(len(x) - len(y)), y])}
    waveforms = waveforms_of(segment, signal_of(segment), columns, result.source)
    page.draw(waveforms, "sharpened", shown=page.first_length(segment, over_angle=False, of_mesh=False))
    st.caption("It makes something impulsive of any noise: other rates must be less alike. Levels are not kept.")
    page.offer(waveforms)
