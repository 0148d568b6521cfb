"""Kurtogram, the band that it chooses or the user, and the envelope spectrum there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.methods.signals import (
    SignalSegment,
    Waveforms,
    choose_one,
    choose_stretch,
    highest_of_interest,
    modulation_cursors,
    of_stretch,
    offer_downloads,
    show_notes,
)
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import choose_range, show_picture
from app.dashboard.widgets.spectrum import FOUND_SHARE, show_spectrum
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import InputError
from gearsig.report import marked_positions, speed_is_constant

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.plot import Cursor
    from gearsig.spectra import ChosenBand, EnhancedEnvelope, Kurtogram, Preparation, SpectralCoherence, Spectrum


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


def _choose_settings(analysis: Analysis, stretch: SignalSegment) -> BandSettings:
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
def band_of(key: str, settings: BandSettings, _stretch: SignalSegment) -> ChosenBand:
    """Return band, kurtogram and envelope; `key` stands for the stretch. It is frozen: sessions may share it."""
    from gearsig.spectra import kurtogram_envelope

    del key
    return kurtogram_envelope(
        _stretch.recording,
        _stretch.channel,
        n_levels=settings.n_levels,
        preparation=settings.preparation,
        highest_modulation_hz=settings.highest_modulation_hz,
        band_hz=settings.band_hz,
    )


def _show_choice(found: ChosenBand, settings: BandSettings, stretch: SignalSegment, *, varies: bool) -> None:
    from gearsig.plot import kurtogram_figure

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
    analysis: Analysis, channel: ChannelAnalysis, stretch: SignalSegment, found: ChosenBand, settings: BandSettings
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


def order_spectrum_of(found: ChosenBand, stretch: SignalSegment, highest_hz: float) -> Spectrum:
    """Return the spectrum of an envelope over orders, up to what the highest modulation is at the mean speed."""
    from gearsig.angle import resample_to_angle
    from gearsig.orders import order_spectrum
    from gearsig.recording import Channel, Recording

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


# --------------------
# Cyclic coherence: which carriers are modulated at which frequency or order, and the mean over the carriers.
# --------------------


COHERENCE_VIEW = "coherence"
COHERENCE_N_FIRST, COHERENCE_N_MOST = 262_144, 4_000_000
COHERENCE_BANDS = (8, 16, 32, 64, 128, 256)
PROBABILITIES = {"1 line in 20": 0.05, "1 line in 100": 0.01, "1 line in 1000": 1e-3, "1 line in 10 000": 1e-4}
MOST_CELLS = 1 << 22
"""100 MB of results."""
COHERENCE_N_KEPT = 3
COHERENCE_HEIGHT_IN = 5.0
MARKED_KINDS = ("bearing", "shaft")


@dataclass(frozen=True)
class CoherenceSettings:
    """What the coherence is told; `highest` in Hz, or orders where it runs over them."""

    over_orders: bool
    highest: float
    n_bands: int
    preparation: Preparation


def show_coherence(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the coherence of one channel as a map, and its mean over the carriers."""
    stretch = choose_stretch(analysis, channel, COHERENCE_VIEW, n_first=COHERENCE_N_FIRST, n_most=COHERENCE_N_MOST)
    settings = _choose_settings_coherence(analysis, stretch)
    _check_size(stretch, settings)
    with st.spinner("Computing the coherence …", show_time=True):
        found = coherence_of(stretch.key, settings, stretch)
    mean = _choose_mean(analysis, found)
    cursors = modulation_cursors(analysis, stretch, mean.spectrum)
    marked = marked_positions(of_stretch(analysis, stretch), mean.spectrum, channel.channel, of_bearings=True)
    name = f"{COHERENCE_VIEW} {found.alpha_axis}"
    limits = show_spectrum(
        analysis, mean.spectrum, cursors, name, marked=marked, scale="Linear", quantity="mean squared coherence"
    )
    st.caption(
        f"Mean squared coherence over the carriers from {mean.band_hz[0]:.5g} to {mean.band_hz[1]:.5g} Hz. "
        f"Stationary noise exceeds **{mean.level:.3g}** in 1 line of {1 / mean.probability:.5g}."
    )
    _show_map(found, mean, _standing_out(cursors, mean), _of_shafts(cursors, mean), limits)
    offer_downloads(analysis, COHERENCE_VIEW, tables={"Enhanced spectrum": lambda: spectrum_columns(mean.spectrum)})


def _choose_settings_coherence(analysis: Analysis, stretch: SignalSegment) -> CoherenceSettings:
    one, two = st.columns(2)
    three, four = st.columns(2)
    over_orders = False
    if stretch.angle is not None:
        about = "Over orders, modulation that is locked to the shaft stays on one line when the speed changes."
        names = ("Cyclic frequency", "Cyclic order")
        first = names[0] if speed_is_constant(of_stretch(analysis, stretch)) else names[1]
        with one:
            over_orders = (
                choose_one("Over", names, _key_coherence("over", analysis), default=first, about=about) == names[1]
            )
    prepared = next(iter(PREPARATIONS))
    if not over_orders:
        about = "Steady tones are coherent with each other: remove them, or mesh harmonics fill the picture."
        key = _key_coherence("preparation", analysis)
        with two:
            prepared = choose_one("Signal", list(PREPARATIONS), key, default="Tones removed", about=about)
    usual = float(f"{highest_of_interest(analysis, stretch, of_orders=over_orders):.3g}")
    highest = three.number_input(
        f"Highest cyclic {'order' if over_orders else 'frequency (Hz)'}",
        value=usual,
        step=usual / 10.0,
        format="%g",
        key=_key_coherence(f"highest {over_orders} {usual!r}", analysis),
        help="The fastest rhythm sought. Carriers below half of it are left out.",
        persist_state="session",
    )
    about = "Fewer bands average more and find weaker modulation; more show better where its carrier is."
    key = _key_coherence("bands", analysis)
    n_bands = four.select_slider(
        "Carrier bands", COHERENCE_BANDS, value=64, key=key, help=about, persist_state="session"
    )
    preparation = cast("Preparation", PREPARATIONS[prepared])
    return CoherenceSettings(over_orders, float(highest), int(n_bands), preparation)


def _check_size(stretch: SignalSegment, settings: CoherenceSettings) -> None:
    """Refuse results that a browser session should not hold."""
    length = stretch.recording.duration_s
    if settings.over_orders and stretch.angle is not None:
        length = stretch.angle.n_revolutions
    n_cells = settings.highest * length * settings.n_bands
    if n_cells > MOST_CELLS:
        raise InputError(
            f"{settings.highest * length:.0f} cyclic frequencies × {settings.n_bands} bands are too many cells",
            allowed=f"at most {MOST_CELLS} on this page",
            remedy="lower the highest cyclic frequency or order, take fewer bands or a shorter stretch",
        )


@st.cache_resource(max_entries=COHERENCE_N_KEPT, show_spinner=False)
def coherence_of(key: str, settings: CoherenceSettings, _stretch: SignalSegment) -> SpectralCoherence:
    """Return the coherence; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    del key
    recording, name, highest, n_bands = _stretch.recording, _stretch.channel, settings.highest, settings.n_bands
    if settings.over_orders and _stretch.angle is not None:
        from gearsig.spectra import order_coherence

        return order_coherence(recording, name, _stretch.angle, highest_order=highest, n_bands=n_bands)
    from gearsig.spectra import spectral_coherence

    return spectral_coherence(
        recording, name, highest_alpha_hz=highest, n_bands=n_bands, preparation=settings.preparation
    )


def _choose_mean(analysis: Analysis, found: SpectralCoherence) -> EnhancedEnvelope:
    from gearsig.spectra import enhanced_envelope

    left, right = st.columns((2, 1))
    carriers = found.frequency_hz
    with left:
        band = (
            choose_range(
                "Carriers averaged (Hz)", analysis, float(carriers[-1]), start=float(carriers[0]), name=COHERENCE_VIEW
            )
            if len(carriers) > 1
            else (float(carriers[0]), float(carriers[0]))
        )
    key = _key_coherence("probability", analysis)
    about = "How often noise alone passes the dashed line."
    odds = right.selectbox(
        "Noise passes the level in", list(PROBABILITIES), index=2, key=key, help=about, persist_state="session"
    )
    return enhanced_envelope(found, band, probability=PROBABILITIES[odds])


def _standing_out(cursors: Sequence[Cursor], mean: EnhancedEnvelope) -> list[Cursor]:
    """Return the lines of shafts and bearings at which the mean is above noise's level, within a bearing's slip."""
    end = float(mean.spectrum.positions[-1])
    inside = [c for c in cursors if c.kind in MARKED_KINDS and float(mean.spectrum.positions[0]) <= c.position <= end]
    return [c for c in inside if _peak(c, mean)[1] > mean.level]


def _peak(cursor: Cursor, mean: EnhancedEnvelope) -> tuple[float, float]:
    """Return place and height of the largest value at a line, a bearing's within its slip."""
    slack = FOUND_SHARE * cursor.position if cursor.kind == "bearing" else 0.0
    return mean.spectrum.largest_near(cursor.position, slack + mean.spectrum.resolution)


def _of_shafts(cursors: Sequence[Cursor], mean: EnhancedEnvelope) -> set[Cursor]:
    """Return the bearing lines whose peak lies on a multiple of a shaft's speed, as meshes and their sidebands do."""
    speeds = [c.position / c.number for c in cursors if c.kind == "shaft"]
    peaks = {c: _peak(c, mean)[0] for c in _standing_out(cursors, mean) if c.kind == "bearing"}
    near = mean.spectrum.resolution
    return {c for c, at in peaks.items() if any(abs(at - max(1, round(at / f)) * f) <= near for f in speeds)}


def _show_map(
    found: SpectralCoherence,
    mean: EnhancedEnvelope,
    marked: Sequence[Cursor],
    of_shafts: set[Cursor],
    limits: tuple[float, float],
) -> None:
    from gearsig.plot import coherence_figure

    low, high = limits
    inside = [cursor for cursor in marked if low <= cursor.position <= high]
    step = found.alpha_resolution
    around = (min(low, high - 2.5 * step), max(high, float(found.alpha[0]) + 2.5 * step))
    positions = [cursor.position for cursor in inside]
    figure = coherence_figure(found, mean, marked=positions, limits=around, height_in=COHERENCE_HEIGHT_IN)
    show_picture(figure, f"Squared coherence of {found.source} over {found.alpha_label} and carrier frequency")
    st.caption(_in_words(inside, of_shafts) if inside else "No line of a shaft or bearing stands above noise's level.")


def _in_words(inside: Sequence[Cursor], of_shafts: set[Cursor]) -> str:
    """Name the lines that stand out, those that gears may cause as well last."""
    own, shared = ([c for c in inside if (c in of_shafts) == either] for either in (False, True))
    text = "Above noise's level means that there is modulation, not that there is damage: sound gears modulate too. "
    if own:
        text += (
            "Dotted, lines that stand above noise's level, bearings' within 1 % for their slip: " + _names(own) + ". "
        )
    if shared:
        text += (
            "Bearing lines whose peak lies on a multiple of a shaft's speed, which meshes and shafts cause as well: "
        )
        text += _names(shared) + "."
    return text


def _names(cursors: Sequence[Cursor]) -> str:
    return as_typed(", ".join(dict.fromkeys(f"{cursor.label} ({cursor.position:.5g})" for cursor in cursors)))


def _key_coherence(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{COHERENCE_VIEW} {name}", analysis)
