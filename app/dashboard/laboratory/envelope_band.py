"""The band whose envelope shows expected lines best: the answer is known here, so the choice may use it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording

N_BANDS = 16
"""Equal parts of the spectrum, and all runs of one, two and four of them."""
WIDTHS = (1, 2, 4)
LINES_PER_BAND = 4.0
"""A band must be wider than so many times the lowest expected line."""


def telling_band_hz(recording: Recording, channel: str, wanted_hz: Sequence[float]) -> tuple[float, float]:
    """Return the band in whose envelope the wanted lines stand highest above the median of the lines about them.

    Parameters
    ----------
    recording : Recording
    channel : str
    wanted_hz : sequence of float
        Expected lines; those that the recording is too short for do not count.

    Raises
    ------
    RefusalError
        If no line is expected, or the signal is too short to tell them apart.
    """
    values, rate = recording.values(channel), recording.sampling_rate_hz
    lines = np.array([f for f in wanted_hz if f * recording.duration_s >= 3.0])
    if not len(lines):
        raise RefusalError("the signal is too short for the lines of shafts", remedy="show a longer one")
    width = rate / 2.0 / N_BANDS
    bands = [
        (i * width, (i + n) * width)
        for n in WIDTHS
        for i in range(N_BANDS - n + 1)
        if n * width > LINES_PER_BAND * lines.min()
    ] or [(0.0, rate / 2.0)]
    heights = [_height(values, rate, band, lines) for band in bands]
    return bands[int(np.argmax(heights))]


def _height(values: FloatArray, rate_hz: float, band_hz: tuple[float, float], lines_hz: FloatArray) -> float:
    """Sum of the lines' amplitudes over the median amplitude, in the envelope of a band."""
    from gearsig.spectra.envelope import band_envelope, envelope_spectrum

    spectrum = envelope_spectrum(band_envelope(values, rate_hz, band_hz))
    inside = spectrum.values[: spectrum.index_of(1.2 * float(lines_hz.max())) + 1]
    floor = float(np.median(inside))
    if floor <= 0.0:
        return 0.0
    slack = 2.0 * spectrum.resolution
    found = [spectrum.largest_near(f, slack)[1] for f in lines_hz if f < float(spectrum.positions[-1])]
    return sum(found) / floor
