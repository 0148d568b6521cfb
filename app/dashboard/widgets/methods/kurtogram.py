"""Kurtogram, the band that it chooses or the user, and the envelope spectrum there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.modulation_lines import highest_of_interest, modulation_cursors, of_stretch
from app.dashboard.widgets.methods.notes import show_notes
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.methods.waveforms import Waveforms
from app.dashboard.widgets.picture import show_picture
from app.dashboard.widgets.range_slider import choose_range
from app.dashboard.widgets.spectrum import show_spectrum
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.report.lines import marked_positions, speed_is_constant

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.spectra.kurtogram import ChosenBand
    from gearsig.spectra.kurtogram_preparation import Preparation
    from gearsig.spectra.kurtogram_types import Kurtogram
    from gearsig.spectra.types import Spectrum

VIEW = "kurtogram"
N_FIRST, N_MOST = 1_000_000, 10_000_000
PREPARATIONS = {"As recorded": "none", "Tones removed": "tones removed", "Whitened": "whitened"}
BANDS = ("The kurtogram's", "My own")
N_KEPT = 4
HEIGHT_IN = 3.8
OF_ENVELOPE_RATE = 0.4
"""A narrow band's envelope has a low sampling rate, and resampling needs some room below half of it."""


@dataclass(frozen=True)
class BandSettings:
    """What the kurtogram and the envelope are told; `band_hz` None is the kurtogram's own choice."""

    preparation: Preparation
    n_levels: int
    highest_modulation_hz: float
    band_hz: tuple[float, float] | None


def show_kurtogram(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the kurtogram of one channel, the chosen band and its envelope spectrum."""
    stretch = choose_stretch(analysis, channel, VIEW, n_first=N_FIRST, n_most=N_MOST)
    settings = _choose_settings(analysis, stretch)
    with st.spinner("Computing the kurtogram …", show_time=True):
        found = band_of(stretch.key, settings, stretch)
    varies = stretch.angle is not None and not speed_is_constant(of_stretch(analysis, stretch))
    _show_choice(found, settings, stretch, varies=varies)
    spectrum = _show_envelope(analysis, channel, stretch, found, settings)
    envelope = Waveforms(
        {found.envelope.source: found.envelope.values},
        found.envelope.sampling_rate_hz,
        stretch.start_s,
        found.envelope.unit,
        "unknown",
        f"{found.envelope.source} from {stretch.start_s:.6g} to {stretch.end_s:.6g} s, {settings.preparation}",
    )
    tables = {
        "Envelope spectrum": lambda: spectrum_columns(spectrum),
        "Kurtogram": lambda: kurtogram_columns(found.kurtogram),
    }
    offer_downloads(analysis, VIEW, envelope, tables=tables)


def _choose_settings(analysis: Analysis, stretch: Stretch) -> BandSettings:
    about = (
        "Tones removed: steady lines, such as mesh harmonics, are cut down to the floor. Whitened: every line is made "
        "equally strong, which takes out resonances as well."
    )
    one, two = st.columns(2)
    three, four = st.columns(2)
    with one:
        prepared = choose_one("Signal", list(PREPARATIONS), _key("preparation", analysis), about=about)
    most = max(1, int(np.log2(max(stretch.recording.n_samples / 512.0, 2.0))))
    about = "The spectrum is cut into up to 2 to the power of it bands, and into thirds of these."
    key = _key(f"levels {most}", analysis)
    n_levels = most
    if most > 1:
        n_levels = three.slider("Levels", 1, most, min(7, most), key=key, help=about, persist_state="session")
    usual = float(f"{highest_of_interest(analysis, stretch, of_orders=False):.3g}")
    highest = four.number_input(
        "Highest modulation (Hz)",
        value=usual,
        step=usual / 10.0,
        format="%g",
        key=_key(f"highest {usual!r}", analysis),
        help="The fastest rhythm sought. Bands must be three times as wide, and the envelope's spectrum ends there.",
        persist_state="session",
    )
    with two:
        band = choose_one("Band", BANDS, _key("band", analysis))
    own = None
    if band == BANDS[1]:
        top = stretch.recording.sampling_rate_hz / 2.0
        own = choose_range("Band of the envelope (Hz)", analysis, top, shown=(0.5 * top, 0.75 * top), name=VIEW)
    return BandSettings(cast("Preparation", PREPARATIONS[prepared]), int(n_levels), float(highest), own)


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def band_of(key: str, settings: BandSettings, _stretch: Stretch) -> ChosenBand:
    """Return band, kurtogram and envelope; `key` stands for the stretch. It is frozen: sessions may share it."""
    from gearsig.spectra.kurtogram import kurtogram_envelope

    del key
    return kurtogram_envelope(
        _stretch.recording,
        _stretch.channel,
        n_levels=settings.n_levels,
        preparation=settings.preparation,
        highest_modulation_hz=settings.highest_modulation_hz,
        band_hz=settings.band_hz,
    )


def _show_choice(found: ChosenBand, settings: BandSettings, stretch: Stretch, *, varies: bool) -> None:
    from gearsig.plot.kurtogram import kurtogram_figure

    figure = kurtogram_figure(found.kurtogram, found.band, height_in=HEIGHT_IN)
    show_picture(figure, f"Kurtogram of {stretch.channel} with the band of the envelope")
    band, who = found.band, "The kurtogram's band" if settings.band_hz is None else "Your band"
    st.markdown(
        f"{who}: **{band.low_hz:.5g} to {band.high_hz:.5g} Hz**, spectral kurtosis **{band.kurtosis:.3g}** "
        f"(of noise alone: 0 ± {band.standard_error:.2g})"
    )
    caption = f"{found.reason} " if found.reason else ""
    if varies:
        caption += (
            "The speed changes in this stretch: mesh harmonics that pass resonances raise the kurtosis too, without "
            "any impact. Trust a rhythm in the envelope over order, or choose a stretch of even speed."
        )
    if caption:
        st.caption(caption)
    show_notes(found.remarks)


def _show_envelope(
    analysis: Analysis, channel: ChannelAnalysis, stretch: Stretch, found: ChosenBand, settings: BandSettings
) -> Spectrum:
    """Show the envelope spectrum over frequency, or over order where the speed is known, and return it."""
    here = of_stretch(analysis, stretch)
    over = "Modulation frequency"
    if stretch.angle is not None:
        about = "Over orders, a change of speed does not smear the lines that follow it."
        names = (over, "Modulation order")
        first = names[0] if speed_is_constant(here) else names[1]
        over = choose_one("Envelope spectrum over", names, _key("over", analysis), default=first, about=about)
    spectrum = found.spectrum
    if over == "Modulation order":
        spectrum = order_spectrum_of(found, stretch, settings.highest_modulation_hz)
    cursors = modulation_cursors(analysis, stretch, spectrum)
    marked = marked_positions(here, spectrum, channel.channel, of_bearings=True)
    show_spectrum(analysis, spectrum, cursors, f"{VIEW} {spectrum.axis}", marked=marked, scale="Linear")
    if stretch.angle is not None and spectrum.axis == "frequency" and not cursors:
        st.caption("The speed changes, so lines that follow it are smeared over frequency: look over order.")
    return spectrum


def order_spectrum_of(found: ChosenBand, stretch: Stretch, highest_hz: float) -> Spectrum:
    """Return the spectrum of an envelope over orders, up to what the highest modulation is at the mean speed."""
    from gearsig.angle.resample import resample_to_angle
    from gearsig.orders.spectrum import order_spectrum
    from gearsig.recording.types import Channel, Recording

    envelope, angle = found.envelope, stretch.angle
    assert angle is not None  # noqa: S101 - the caller's condition, said to the type checker
    values = envelope.values - envelope.values.mean()
    alone = Recording(values[None, :], envelope.sampling_rate_hz, (Channel(envelope.source, "unknown", envelope.unit),))
    highest_hz = min(highest_hz, OF_ENVELOPE_RATE * envelope.sampling_rate_hz)
    highest = 60.0 * highest_hz / max(angle.mean_speed_rpm, 1e-9)
    signal = resample_to_angle(alone, angle, channels=[envelope.source], highest_order=highest)
    return order_spectrum(signal, envelope.source)


def spectrum_columns(spectrum: Spectrum) -> Mapping[str, ArrayLike]:
    """Return a spectrum's axis and values."""
    name = "value" if spectrum.scaling == "dimensionless" else spectrum.scaling
    return {spectrum.axis_label: spectrum.positions, f"{name} ({spectrum.unit or 1})": spectrum.values}


def kurtogram_columns(grid: Kurtogram) -> Mapping[str, ArrayLike]:
    """Return the bands of a kurtogram with their kurtosis."""
    return {
        "bands": np.round(2.0**grid.level).astype(int),
        "from (Hz)": grid.low_hz,
        "to (Hz)": grid.high_hz,
        "spectral kurtosis": grid.kurtosis,
        "standard error": grid.standard_error,
        "noise's limit": grid.noise_limit,
    }


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
