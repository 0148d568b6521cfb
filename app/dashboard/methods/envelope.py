"""Rhythms in noise: the kurtogram with the envelope of its band, and the cyclic coherence."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import (
    MethodPage,
    SignalSegment,
    Waveforms,
    cached,
    highest_of_interest,
    modulation_cursors,
    of_segment,
)
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import choose_range, show_picture
from app.dashboard.widgets.messages import show_warnings
from app.dashboard.widgets.spectrum import SLIP_SHARE, show_spectrum
from gearsig.angle import resample_to_angle
from gearsig.errors import InputError
from gearsig.orders import order_spectrum
from gearsig.plot import Cursor, coherence_figure, kurtogram_figure
from gearsig.recording import Channel, Recording
from gearsig.report import marked_positions, speed_is_constant
from gearsig.spectra import (
    ChosenBand,
    EnhancedEnvelope,
    Kurtogram,
    Preparation,
    SpectralCoherence,
    Spectrum,
    enhanced_envelope,
    kurtogram_envelope,
    order_coherence,
    spectral_coherence,
)

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

PREPARATIONS = {"As recorded": "none", "Tones removed": "tones removed", "Whitened": "whitened"}


def _choose_over(
    page: MethodPage, place: Any, label: str, names: tuple[str, str], segment: SignalSegment, about: str
) -> bool:
    """Return whether orders are chosen, at first where the speed varies; never where it is not known."""
    if segment.angle is None:
        return False
    first = names[0] if speed_is_constant(of_segment(page.analysis, segment)) else names[1]
    return page.choose(place, label, names, default=first, about=about) == names[1]


def _choose_highest(
    page: MethodPage, place: Any, label: str, segment: SignalSegment, about: str, *, of_orders: bool = False
) -> float:
    usual = float(f"{highest_of_interest(page.analysis, segment, of_orders=of_orders):.3g}")
    key = f"{label} {usual!r}"
    highest = page.ask(place.number_input, label, value=usual, step=usual / 10.0, format="%g", key=key, about=about)
    return float(highest)


# --------------------
# Kurtogram, the band that it chooses or the user, and the envelope spectrum there.
# --------------------


@dataclass(frozen=True)
class BandSettings:
    """Settings of kurtogram and envelope; `band_hz` None is the kurtogram's own choice."""

    preparation: Preparation
    n_levels: int
    highest_modulation_hz: float
    band_hz: tuple[float, float] | None


def show_kurtogram(page: MethodPage) -> None:
    """Show the kurtogram of one channel, the chosen band and its envelope spectrum."""
    segment = page.segment(n_first=1_000_000, n_max=10_000_000)
    settings = _choose_band(page, segment)
    chosen = band_of(segment, settings)
    figure = kurtogram_figure(chosen.kurtogram, chosen.band, height_in=3.8)
    show_picture(figure, f"Kurtogram of {segment.channel} with the band of the envelope")
    band, who = chosen.band, "The kurtogram's band" if settings.band_hz is None else "Your band"
    st.markdown(
        f"{who}: **{band.low_hz:.5g} to {band.high_hz:.5g} Hz**, spectral kurtosis **{band.kurtosis:.3g}** "
        f"(of noise alone: 0 ± {band.standard_error:.2g})"
    )
    caption = f"{chosen.reason} " if chosen.reason else ""
    if segment.angle is not None and not speed_is_constant(of_segment(page.analysis, segment)):
        caption += (
            "The speed changes in this segment: mesh harmonics that pass resonances raise the kurtosis too, without "
            "any impact. Trust a rhythm in the envelope over order, or choose a segment of even speed."
        )
    if caption:
        st.caption(caption)
    show_warnings(chosen.warnings)
    spectrum = _show_envelope_spectrum(page, segment, chosen, settings)
    envelope = chosen.envelope
    step = f"{envelope.source} from {segment.start_s:.6g} to {segment.end_s:.6g} s, {settings.preparation}"
    columns = {envelope.source: envelope.values}
    page.offer(
        Waveforms(columns, envelope.sampling_rate_hz, segment.start_s, envelope.unit, "unknown", step),
        {
            "Envelope spectrum": lambda: _spectrum_columns(spectrum),
            "Kurtogram": lambda: _kurtogram_columns(chosen.kurtogram),
        },
    )


def _choose_band(page: MethodPage, segment: SignalSegment) -> BandSettings:
    one, two = st.columns(2)
    three, four = st.columns(2)
    about = (
        "Tones removed: steady lines, such as mesh harmonics, are cut down to the floor. Whitened: every line is made "
        "equally strong, which takes out resonances as well."
    )
    preparation = PREPARATIONS[page.choose(one, "Signal", list(PREPARATIONS), about=about)]
    max_levels = max(1, int(np.log2(max(segment.recording.n_samples / 512.0, 2.0))))
    about = "The spectrum is cut into up to 2 to the power of it bands, and into thirds of these."
    n_levels, key = max_levels, f"levels {max_levels}"
    if max_levels > 1:
        n_levels = page.ask(three.slider, "Levels", 1, max_levels, min(7, max_levels), key=key, about=about)
    about = "The fastest rhythm sought. Bands must be three times as wide, and the envelope's spectrum ends there."
    highest = _choose_highest(page, four, "Highest modulation (Hz)", segment, about)
    band = None
    if page.choose(two, "Band", ("The kurtogram's", "My own")) == "My own":
        top = segment.recording.sampling_rate_hz / 2.0
        label = "Band of the envelope (Hz)"
        band = choose_range(label, page.analysis, top, shown=(0.5 * top, 0.75 * top), name=page.name)
    return BandSettings(cast("Preparation", preparation), n_levels, highest, band)


@cached(4, "Computing the kurtogram …")
def band_of(segment: SignalSegment, settings: BandSettings) -> ChosenBand:
    """Return band, kurtogram and envelope."""
    return kurtogram_envelope(
        segment.recording,
        segment.channel,
        n_levels=settings.n_levels,
        preparation=settings.preparation,
        highest_modulation_hz=settings.highest_modulation_hz,
        band_hz=settings.band_hz,
    )


def _show_envelope_spectrum(
    page: MethodPage, segment: SignalSegment, chosen: ChosenBand, settings: BandSettings
) -> Spectrum:
    """Show the envelope spectrum over frequency, or over order where the speed is known, and return it."""
    about = "Over orders, a change of speed does not smear the lines that follow it."
    names = ("Modulation frequency", "Modulation order")
    over_orders = _choose_over(page, st, "Envelope spectrum over", names, segment, about)
    spectrum = chosen.spectrum
    if over_orders:
        spectrum = _envelope_orders(chosen, segment, settings.highest_modulation_hz)
    cursors = modulation_cursors(page.analysis, segment, spectrum)
    here = of_segment(page.analysis, segment)
    marked = marked_positions(here, spectrum, segment.channel, of_bearings=True)
    show_spectrum(page.analysis, spectrum, cursors, f"{page.name} {spectrum.axis}", marked=marked, scale="Linear")
    if segment.angle is not None and spectrum.axis == "frequency" and not cursors:
        st.caption("The speed changes, so lines that follow it are smeared over frequency: look over order.")
    return spectrum


def _envelope_orders(chosen: ChosenBand, segment: SignalSegment, highest_hz: float) -> Spectrum:
    """Return the spectrum of an envelope over orders, up to what the highest modulation is at the mean speed."""
    envelope, angle = chosen.envelope, segment.angle
    assert angle is not None  # noqa: S101 - the caller's condition, said to the type checker
    values = envelope.values - envelope.values.mean()
    alone = Recording(values[None, :], envelope.sampling_rate_hz, (Channel(envelope.source, "unknown", envelope.unit),))
    # A narrow band's envelope has a low sampling rate, and resampling needs some room below half of it.
    highest_hz = min(highest_hz, 0.4 * envelope.sampling_rate_hz)
    highest = 60.0 * highest_hz / max(angle.mean_speed_rpm, 1e-9)
    signal = resample_to_angle(alone, angle, channels=[envelope.source], highest_order=highest)
    return order_spectrum(signal, envelope.source)


def _spectrum_columns(spectrum: Spectrum) -> Mapping[str, ArrayLike]:
    name = "value" if spectrum.scaling == "dimensionless" else spectrum.scaling
    return {spectrum.axis_label: spectrum.positions, f"{name} ({spectrum.unit or 1})": spectrum.values}


def _kurtogram_columns(grid: Kurtogram) -> Mapping[str, ArrayLike]:
    return {
        "bands": np.round(2.0**grid.level).astype(int),
        "from (Hz)": grid.low_hz,
        "to (Hz)": grid.high_hz,
        "spectral kurtosis": grid.kurtosis,
        "standard error": grid.standard_error,
        "noise's limit": grid.noise_limit,
    }


# --------------------
# Cyclic coherence: which carriers are modulated at which frequency or order, and the mean over the carriers.
# --------------------

PROBABILITIES = {"1 line in 20": 0.05, "1 line in 100": 0.01, "1 line in 1000": 1e-3, "1 line in 10 000": 1e-4}
MAX_CELLS = 1 << 22
"""100 MB of results."""


@dataclass(frozen=True)
class CoherenceSettings:
    """Settings of the coherence; `highest` in Hz, or orders where it runs over them."""

    over_orders: bool
    highest: float
    n_bands: int
    preparation: Preparation


def show_coherence(page: MethodPage) -> None:
    """Show the coherence of one channel as a map, and its mean over the carriers."""
    segment = page.segment(n_first=262_144, n_max=4_000_000)
    settings = _choose_coherence(page, segment)
    _check_size(segment, settings)
    coherence = coherence_of(segment, settings)
    mean = _choose_mean(page, coherence)
    cursors = modulation_cursors(page.analysis, segment, mean.spectrum)
    here = of_segment(page.analysis, segment)
    limits = show_spectrum(
        page.analysis,
        mean.spectrum,
        cursors,
        f"{page.name} {coherence.alpha_axis}",
        marked=marked_positions(here, mean.spectrum, segment.channel, of_bearings=True),
        scale="Linear",
        quantity="mean squared coherence",
    )
    st.caption(
        f"Mean squared coherence over the carriers from {mean.band_hz[0]:.5g} to {mean.band_hz[1]:.5g} Hz. "
        f"Stationary noise exceeds **{mean.level:.3g}** in 1 line of {1 / mean.probability:.5g}."
    )
    _show_coherence_map(coherence, mean, cursors, limits)
    page.offer(None, {"Enhanced spectrum": lambda: _spectrum_columns(mean.spectrum)})


def _choose_coherence(page: MethodPage, segment: SignalSegment) -> CoherenceSettings:
    one, two = st.columns(2)
    three, four = st.columns(2)
    about = "Over orders, modulation that is locked to the shaft stays on one line when the speed changes."
    over_orders = _choose_over(page, one, "Over", ("Cyclic frequency", "Cyclic order"), segment, about)
    preparation = "none"
    if not over_orders:
        about = "Steady tones are coherent with each other: remove them, or mesh harmonics fill the picture."
        name = page.choose(two, "Signal", list(PREPARATIONS), default="Tones removed", about=about)
        preparation = PREPARATIONS[name]
    label = f"Highest cyclic {'order' if over_orders else 'frequency (Hz)'}"
    about = "The fastest rhythm sought. Carriers below half of it are left out."
    highest = _choose_highest(page, three, label, segment, about, of_orders=over_orders)
    about = "Fewer bands average more and find weaker modulation; more show better where its carrier is."
    n_bands = page.ask(four.select_slider, "Carrier bands", (8, 16, 32, 64, 128, 256), value=64, about=about)
    return CoherenceSettings(over_orders, highest, n_bands, cast("Preparation", preparation))


def _check_size(segment: SignalSegment, settings: CoherenceSettings) -> None:
    """Refuse results that a browser session should not hold."""
    length = segment.recording.duration_s
    if settings.over_orders and segment.angle is not None:
        length = segment.angle.n_revolutions
    if settings.highest * length * settings.n_bands > MAX_CELLS:
        raise InputError(
            f"{settings.highest * length:.0f} cyclic frequencies × {settings.n_bands} bands are too many cells",
            allowed=f"at most {MAX_CELLS} on this page",
            remedy="lower the highest cyclic frequency or order, take fewer bands or a shorter segment",
        )


@cached(3, "Computing the coherence …")
def coherence_of(segment: SignalSegment, settings: CoherenceSettings) -> SpectralCoherence:
    """Return the coherence over frequency or order."""
    recording, name, highest, n_bands = segment.recording, segment.channel, settings.highest, settings.n_bands
    if settings.over_orders and segment.angle is not None:
        return order_coherence(recording, name, segment.angle, highest_order=highest, n_bands=n_bands)
    return spectral_coherence(
        recording, name, highest_alpha_hz=highest, n_bands=n_bands, preparation=settings.preparation
    )


def _choose_mean(page: MethodPage, coherence: SpectralCoherence) -> EnhancedEnvelope:
    left, right = st.columns((2, 1))
    low, high = float(coherence.frequency_hz[0]), float(coherence.frequency_hz[-1])
    band = (low, high)
    if low < high:
        with left:
            band = choose_range("Carriers averaged (Hz)", page.analysis, high, start=low, name=page.name)
    about = "How often noise alone passes the dashed line."
    odds = page.ask(right.selectbox, "Noise passes the level in", list(PROBABILITIES), index=2, about=about)
    return enhanced_envelope(coherence, band, probability=PROBABILITIES[odds])


def _show_coherence_map(
    coherence: SpectralCoherence, mean: EnhancedEnvelope, cursors: Sequence[Cursor], limits: tuple[float, float]
) -> None:
    low, high = limits
    shown = [c for c in _above_noise(cursors, mean) if low <= c.position <= high]
    step = coherence.alpha_resolution
    around = (min(low, high - 2.5 * step), max(high, float(coherence.alpha[0]) + 2.5 * step))
    figure = coherence_figure(coherence, mean, marked=[c.position for c in shown], limits=around, height_in=5.0)
    show_picture(figure, f"Squared coherence of {coherence.source} over {coherence.alpha_label} and carrier frequency")
    if not shown:
        st.caption("No line of a shaft or bearing stands above noise's level.")
        return
    shared = _on_shaft_multiples(cursors, mean)
    text = "Above noise's level means that there is modulation, not that there is damage: healthy gears modulate too. "
    if names := _names([c for c in shown if c not in shared]):
        text += f"Dotted, lines that stand above noise's level, bearings' within 1 % for their slip: {names}. "
    if names := _names([c for c in shown if c in shared]):
        text += (
            f"Bearing lines whose peak lies on a multiple of a shaft's speed, which meshes and shafts cause as well: "
            f"{names}."
        )
    st.caption(text)


def _above_noise(cursors: Sequence[Cursor], mean: EnhancedEnvelope) -> list[Cursor]:
    """Return the lines of shafts and bearings at which the mean is above noise's level, within a bearing's slip."""
    first, end = float(mean.spectrum.positions[0]), float(mean.spectrum.positions[-1])
    inside = [c for c in cursors if c.kind in ("bearing", "shaft") and first <= c.position <= end]
    return [c for c in inside if _peak(c, mean)[1] > mean.level]


def _peak(cursor: Cursor, mean: EnhancedEnvelope) -> tuple[float, float]:
    """Return place and height of the largest value at a line, a bearing's within its slip."""
    slack = SLIP_SHARE * cursor.position if cursor.kind == "bearing" else 0.0
    return mean.spectrum.largest_near(cursor.position, slack + mean.spectrum.resolution)


def _on_shaft_multiples(cursors: Sequence[Cursor], mean: EnhancedEnvelope) -> set[Cursor]:
    """Return the bearing lines whose peak lies on a multiple of a shaft's speed, as meshes and their sidebands do."""
    speeds = [c.position / c.number for c in cursors if c.kind == "shaft"]
    peaks = {c: _peak(c, mean)[0] for c in _above_noise(cursors, mean) if c.kind == "bearing"}
    near = mean.spectrum.resolution
    return {c for c, at in peaks.items() if any(abs(at - max(1, round(at / f)) * f) <= near for f in speeds)}


def _names(cursors: Sequence[Cursor]) -> str:
    return as_typed(", ".join(dict.fromkeys(f"{cursor.label} ({cursor.position:.5g})" for cursor in cursors)))
