"""Rhythms in noise: the kurtogram with the envelope of its band, and the cyclic coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import Columns, MethodPage, SignalSegment, Waveforms, cached, of_segment
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import show_picture
from app.dashboard.widgets.messages import show_warnings
from app.dashboard.widgets.spectrum import SLIP_SHARE, show_spectrum
from gearsig import spectra
from gearsig.angle import resample_to_angle
from gearsig.errors import InputError
from gearsig.orders import order_spectrum
from gearsig.plot import Cursor, coherence_figure, kurtogram_figure
from gearsig.recording import Channel, Recording
from gearsig.report import bearing_cursors, line_cursors, marked_positions, speed_is_constant
from gearsig.rig import order_lines

PREPARATIONS = {"As recorded": "none", "Tones removed": "tones removed", "Whitened": "whitened"}
kurtogram_of = cached(4, "Computing the kurtogram …")(spectra.kurtogram_envelope)
coherence_of = cached(3, "Computing the coherence …")(spectra.spectral_coherence)
order_coherence_of = cached(3, "Computing the coherence …")(spectra.order_coherence)


def show_kurtogram(page: MethodPage) -> None:
    """Show the kurtogram of one channel, the chosen band and its envelope spectrum."""
    segment = page.segment(n_first=1_000_000, n_max=10_000_000)
    settings = _choose_band(page, segment)
    chosen = kurtogram_of(segment.recording, segment.channel, **settings)
    grid, band, envelope = chosen.kurtogram, chosen.band, chosen.envelope
    figure = kurtogram_figure(grid, band, height_in=3.8)
    show_picture(figure, f"Kurtogram of {segment.channel} with the band of the envelope")
    whose = "The kurtogram's" if settings["band_hz"] is None else "Your"
    st.markdown(
        f"{whose} band: **{band.low_hz:.5g} to {band.high_hz:.5g} Hz**, spectral kurtosis **{band.kurtosis:.3g}** "
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

    about = "Over orders, a change of speed does not smear the lines that follow it."
    names = ("Modulation frequency", "Modulation order")
    spectrum = chosen.spectrum
    if _choose_over_orders(page, st, "Envelope spectrum over", names, segment, about):
        spectrum = _envelope_orders(chosen, segment, settings["highest_modulation_hz"])
    cursors, _ = _show_modulation(page, segment, spectrum)
    if segment.angle is not None and spectrum.axis == "frequency" and not cursors:
        st.caption("The speed changes, so lines that follow it are smeared over frequency: look over order.")

    step = f"{envelope.source} from {segment.start_s:.6g} to {segment.end_s:.6g} s, {settings['preparation']}"
    columns = {envelope.source: envelope.values}
    bands = {
        "bands": np.round(2.0**grid.level).astype(int),
        "from (Hz)": grid.low_hz,
        "to (Hz)": grid.high_hz,
        "spectral kurtosis": grid.kurtosis,
        "standard error": grid.standard_error,
        "noise's limit": grid.noise_limit,
    }
    page.offer(
        Waveforms(columns, envelope.sampling_rate_hz, segment.start_s, envelope.unit, "unknown", step),
        {"Envelope spectrum": _spectrum_columns(spectrum), "Kurtogram": bands},
    )


def _choose_band(page: MethodPage, segment: SignalSegment) -> dict[str, Any]:
    """Return the arguments of `kurtogram_envelope`; a band of None is the kurtogram's own choice."""
    one, two = st.columns(2)
    three, four = st.columns(2)
    about = (
        "Tones removed: steady lines, such as mesh harmonics, are cut down to the floor. Whitened: every line is made "
        "equally strong, which takes out resonances as well."
    )
    preparation = page.choose(one, "Signal", PREPARATIONS, about=about)
    max_levels = max(1, int(np.log2(max(segment.recording.n_samples / 512.0, 2.0))))
    about = "The spectrum is cut into up to 2 to the power of it bands, and into thirds of these."
    n_levels, key = max_levels, f"levels {max_levels}"
    if max_levels > 1:
        n_levels = page.ask(three.slider, "Levels", 1, max_levels, min(7, max_levels), key=key, about=about)
    about = "The fastest rhythm sought. Bands must be three times as wide, and the envelope's spectrum ends there."
    highest = _choose_highest(page, four, "Highest modulation (Hz)", segment, about)
    band = None
    if page.choose(two, "Band", {"The kurtogram's": False, "My own": True}):
        top = segment.recording.sampling_rate_hz / 2.0
        band = page.range("Band of the envelope (Hz)", top, shown=(0.5 * top, 0.75 * top))
    return {"preparation": preparation, "n_levels": n_levels, "highest_modulation_hz": highest, "band_hz": band}


def _envelope_orders(chosen: spectra.ChosenBand, segment: SignalSegment, highest_hz: float) -> spectra.Spectrum:
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


def show_coherence(page: MethodPage) -> None:
    """Show the cyclic coherence of one channel: which carriers are modulated at which frequency or order."""
    segment = page.segment(n_first=262_144, n_max=4_000_000)
    one, two = st.columns(2)
    three, four = st.columns(2)
    about = "Over orders, modulation that is locked to the shaft stays on one line when the speed changes."
    over_orders = _choose_over_orders(page, one, "Over", ("Cyclic frequency", "Cyclic order"), segment, about)
    preparation: Any = "none"
    if not over_orders:
        about = "Steady tones are coherent with each other: remove them, or mesh harmonics fill the picture."
        preparation = page.choose(two, "Signal", PREPARATIONS, default="Tones removed", about=about)
    label = f"Highest cyclic {'order' if over_orders else 'frequency (Hz)'}"
    about = "The fastest rhythm sought. Carriers below half of it are left out."
    highest = _choose_highest(page, three, label, segment, about, of_orders=over_orders)
    about = "Fewer bands average more and find weaker modulation; more show better where its carrier is."
    n_bands = page.ask(four.select_slider, "Carrier bands", (8, 16, 32, 64, 128, 256), value=64, about=about)

    recording, angle = segment.recording, segment.angle
    if over_orders and angle is not None:
        _check_size(highest * angle.n_revolutions, n_bands)
        coherence = order_coherence_of(recording, segment.channel, angle, highest_order=highest, n_bands=n_bands)
    else:
        _check_size(highest * recording.duration_s, n_bands)
        coherence = coherence_of(
            recording, segment.channel, highest_alpha_hz=highest, n_bands=n_bands, preparation=preparation
        )
    mean = _choose_mean(page, coherence)
    cursors, limits = _show_modulation(page, segment, mean.spectrum, "mean squared coherence")
    st.caption(
        f"Mean squared coherence over the carriers from {mean.band_hz[0]:.5g} to {mean.band_hz[1]:.5g} Hz. "
        f"Stationary noise exceeds **{mean.level:.3g}** in 1 line of {1 / mean.probability:.5g}."
    )
    _show_coherence_map(coherence, mean, cursors, limits)
    page.offer(None, {"Enhanced spectrum": _spectrum_columns(mean.spectrum)})


def _check_size(n_frequencies: float, n_bands: int) -> None:
    """Refuse results that a browser session should not hold: 100 MB."""
    if n_frequencies * n_bands > 1 << 22:
        raise InputError(
            f"{n_frequencies:.0f} cyclic frequencies × {n_bands} bands are too many cells",
            allowed=f"at most {1 << 22} on this page",
            remedy="lower the highest cyclic frequency or order, take fewer bands or a shorter segment",
        )


def _choose_mean(page: MethodPage, coherence: spectra.SpectralCoherence) -> spectra.EnhancedEnvelope:
    left, right = st.columns((2, 1))
    low, high = float(coherence.frequency_hz[0]), float(coherence.frequency_hz[-1])
    band = (low, high)
    if low < high:
        with left:
            band = page.range("Carriers averaged (Hz)", high, start=low)
    about = "How often noise alone passes the dashed line."
    odds = (20, 100, 1000, 10_000)
    n = page.ask(right.selectbox, "Noise passes the level in", odds, 2, format_func="1 line in {}".format, about=about)
    return spectra.enhanced_envelope(coherence, band, probability=1.0 / n)


def _show_coherence_map(
    coherence: spectra.SpectralCoherence,
    mean: spectra.EnhancedEnvelope,
    cursors: Sequence[Cursor],
    limits: tuple[float, float],
) -> None:
    """Show the map with the lines of shafts and bearings that stand above noise's level, and name these."""
    spectrum, (low, high) = mean.spectrum, limits
    first, end = float(spectrum.positions[0]), float(spectrum.positions[-1])
    peaks: dict[Cursor, float] = {}
    for cursor in cursors:
        if cursor.kind in ("bearing", "shaft") and first <= cursor.position <= end:
            slip = SLIP_SHARE * cursor.position if cursor.kind == "bearing" else 0.0
            at, height = spectrum.largest_near(cursor.position, slip + spectrum.resolution)
            if height > mean.level:
                peaks[cursor] = at
    shown = [c for c in peaks if low <= c.position <= high]
    step = coherence.alpha_resolution
    around = (min(low, high - 2.5 * step), max(high, float(coherence.alpha[0]) + 2.5 * step))
    figure = coherence_figure(coherence, mean, marked=[c.position for c in shown], limits=around, height_in=5.0)
    show_picture(figure, f"Squared coherence of {coherence.source} over {coherence.alpha_label} and carrier frequency")
    if not shown:
        st.caption("No line of a shaft or bearing stands above noise's level.")
        return
    # A bearing line whose peak lies on a multiple of a shaft's speed may be a mesh or its sidebands.
    speeds = [c.position / c.number for c in cursors if c.kind == "shaft"]

    def on_multiple(cursor: Cursor) -> bool:
        distances = (abs(peaks[cursor] - max(1, round(peaks[cursor] / f)) * f) for f in speeds)
        return cursor.kind == "bearing" and any(distance <= spectrum.resolution for distance in distances)

    text = "Above noise's level means that there is modulation, not that there is damage: healthy gears modulate too. "
    if names := _names([c for c in shown if not on_multiple(c)]):
        text += f"Dotted, lines that stand above noise's level, bearings' within 1 % for their slip: {names}. "
    if names := _names([c for c in shown if on_multiple(c)]):
        text += (
            f"Bearing lines whose peak lies on a multiple of a shaft's speed, which meshes and shafts cause as well: "
            f"{names}."
        )
    st.caption(text)


def _names(cursors: Sequence[Cursor]) -> str:
    return as_typed(", ".join(dict.fromkeys(f"{cursor.label} ({cursor.position:.5g})" for cursor in cursors)))


# What both pages ask and show: a choice between frequency and order, the highest modulation, a spectrum over it.


def _choose_over_orders(
    page: MethodPage, place: Any, label: str, names: tuple[str, str], segment: SignalSegment, about: str
) -> bool:
    """Return whether orders are chosen, at first where the speed varies; never where it is not known."""
    if segment.angle is None:
        return False
    first = names[0] if speed_is_constant(of_segment(page.analysis, segment)) else names[1]
    return bool(page.choose(place, label, names, default=first, about=about) == names[1])


def _choose_highest(
    page: MethodPage, place: Any, label: str, segment: SignalSegment, about: str, *, of_orders: bool = False
) -> float:
    """Return the highest modulation frequency in Hz, or order of the reference shaft, that the user chooses.

    At first three harmonics of the fastest bearing line and what slip makes of the last; 12 orders where no bearing is
    known, and 1/128 of the sampling rate where the speed is not.
    """
    rate, rig, highest = segment.recording.sampling_rate_hz, page.analysis.rig, 0.0
    if segment.angle is None:
        highest = rate / 128.0
    else:
        lines = order_lines(rig, n_sidebands=0) if rig is not None and rig.shafts else ()
        order = max((3.3 * line.order for line in lines if line.kind == "bearing"), default=12.0)
        per_order_hz = max(segment.angle.mean_speed_rpm / 60.0, 1e-9)
        order = min(order, rate / 16.0 / per_order_hz)
        highest = order if of_orders else order * per_order_hz
    usual = float(f"{highest:.3g}")
    key = f"{label} {usual!r}"
    return float(page.ask(place.number_input, label, value=usual, step=usual / 10.0, format="%g", key=key, about=about))


def _show_modulation(
    page: MethodPage, segment: SignalSegment, spectrum: spectra.Spectrum, quantity: str = ""
) -> tuple[tuple[Cursor, ...], tuple[float, float]]:
    """Show a spectrum over modulation frequency or order; return the lines of shafts, bearings, meshes and the limits.

    There are no lines where they would smear.
    """
    here, cursors = of_segment(page.analysis, segment), tuple[Cursor, ...]()
    if segment.angle is not None and (spectrum.axis != "frequency" or speed_is_constant(here)):
        meshes = [cursor for cursor in line_cursors(here, spectrum, n_sidebands=0) if cursor.kind == "mesh"]
        cursors = (*bearing_cursors(here, spectrum), *meshes)
    marked = marked_positions(here, spectrum, segment.channel, of_bearings=True)
    name = f"{page.name} {spectrum.axis}"
    limits = show_spectrum(page.analysis, spectrum, cursors, name, marked=marked, scale="Linear", quantity=quantity)
    return cursors, limits


def _spectrum_columns(spectrum: spectra.Spectrum) -> Columns:
    name = "value" if spectrum.scaling == "dimensionless" else spectrum.scaling
    return {spectrum.axis_label: spectrum.positions, f"{name} ({spectrum.unit or 1})": spectrum.values}
