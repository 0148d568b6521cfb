"""Spectra of both machines over each other: amplitude with mesh and sideband marks, envelope with bearing marks."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import streamlit as st

from app.dashboard.laboratory.envelope_band import telling_band_hz
from app.dashboard.laboratory.expected import envelope_cursors, shaft_lines_hz, spectrum_cursors
from app.dashboard.laboratory.run import Run
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from gearsig.errors import RefusalError
from gearsig.plot.cursors import Cursor
from gearsig.plot.display import above_zero, with_unit
from gearsig.plot.thin import envelope
from gearsig.recording.types import Recording
from gearsig.spectra.types import Spectrum

N_COLUMNS = 1500
KIND_NAMES = {
    "mesh": "mesh",
    "sideband": "sidebands",
    "shaft": "shafts",
    "bearing": "bearings",
    "finding": "mains",
}
ENVELOPE_SHAFTS = 12.0
"""Envelope spectra first show so many revolutions of the input shaft, or all marked bearing lines."""


def show_amplitude(healthy: Run, faulty: Run | None, channel: str) -> None:
    """Show the amplitude spectra of a channel."""
    from gearsig.spectra.amplitude import channel_spectrum

    runs = _runs(healthy, faulty)
    spectra = [channel_spectrum(run.recording, channel) for run in runs]
    cursors = spectrum_cursors(runs[-1])
    mesh = max((c.position for c in cursors if c.kind == "mesh"), default=0.0)
    _show(spectra, cursors, "spectrum", logarithmic=True, first_end=1.04 * mesh)


def show_envelope(healthy: Run, faulty: Run | None, channel: str) -> None:
    """Show the spectra of the envelope about the band in which the marked lines stand out most."""
    runs = _runs(healthy, faulty)
    cursors = envelope_cursors(runs[-1])
    marked = [c.position for c in cursors if c.kind == "bearing"]
    wanted = marked or shaft_lines_hz(runs[-1])
    try:
        band = telling_band_hz(runs[-1].recording, channel, wanted)
    except RefusalError as error:
        st.info(f"There is no envelope spectrum: {error}")
        return
    spectra = [_envelope_spectrum(run.recording, channel, band) for run in runs]
    lines = "defect" if marked else "shaft"
    st.markdown(
        f"Squared envelope of {channel} in the band **{band[0]:.0f} to {band[1]:.0f} Hz**, "
        f"where the lines of the {lines} stand out most."
    )
    end = max([ENVELOPE_SHAFTS * healthy.setup.revolutions_per_s, *(1.08 * f for f in marked)])
    _show(spectra, cursors, "envelope", logarithmic=False, first_end=end)


def _runs(healthy: Run, faulty: Run | None) -> list[Run]:
    return [healthy] if faulty is None else [healthy, faulty]


def _envelope_spectrum(recording: Recording, channel: str, band_hz: tuple[float, float]) -> Spectrum:
    from gearsig.spectra.envelope import band_envelope, envelope_spectrum

    values, rate = recording.values(channel), recording.sampling_rate_hz
    return envelope_spectrum(band_envelope(values, rate, band_hz, unit="m/s^2", source=channel))


def _show(
    spectra: Sequence[Spectrum], cursors: Sequence[Cursor], name: str, *, logarithmic: bool, first_end: float
) -> None:
    kinds = [kind for kind in KIND_NAMES if any(c.kind == kind for c in cursors)]
    left, right = st.columns(2)
    chosen = left.pills(
        "Marked",
        kinds,
        default=kinds,
        selection_mode="multi",
        format_func=KIND_NAMES.__getitem__,
        key=f"{name} marks {kinds} of the laboratory",
    )
    end = float(spectra[0].positions[-1])
    limits = right.slider(
        "Frequency shown (Hz)",
        0.0,
        end,
        (0.0, min(first_end, end) or end),
        step=end / 1000.0,
        format="%.5g",
        key=f"{name} range to {end:g}, first {first_end:.4g}",
    )
    if limits[1] <= limits[0]:
        limits = (0.0, end)
    lines = [_line(s, limits, i, logarithmic=logarithmic) for i, s in enumerate(spectra)]
    highest = max(float(line.y.max()) for line in lines)
    lowest = min(float(np.percentile(line.y, 2)) for line in lines) if logarithmic else 0.0
    axes = Axes(
        "frequency (Hz)",
        with_unit("amplitude" if logarithmic else "squared envelope", spectra[0].unit),
        limits,
        (max(lowest, 1e-7 * highest) / 2, 2 * highest) if logarithmic else (0.0, 1.06 * highest or 1.0),
        logarithmic=logarithmic,
    )
    # The faulty machine lies behind: it shows where it stands above the healthy one.
    show_lines(lines[::-1], axes, f"{name} of the laboratory", cursors=[c for c in cursors if c.kind in chosen])
    resolution = spectra[0].resolution
    st.caption(f"Resolution {resolution:.3g} Hz, {spectra[0].window} window. A longer signal refines it.")


def _line(spectrum: Spectrum, limits: tuple[float, float], place: int, *, logarithmic: bool) -> Line:
    start, stop = spectrum.index_of(limits[0]), spectrum.index_of(limits[1]) + 1
    start = max(start, 2)  # an offset is no vibration
    stop = max(stop, start + 4)
    values = above_zero(spectrum.values) if logarithmic else spectrum.values
    at, _, top = envelope(spectrum.positions[start:stop], values[start:stop], N_COLUMNS)
    return Line(at, top, ("healthy", "faulty")[place], colour="fault" if place else "measured")
