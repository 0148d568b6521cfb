"""The tooth at which a shaft's vibration differs most from that at the other teeth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.severity.shaft_lines import ShaftLines, orders_from_mesh

MOST_BANDS = 10
"""One band about each mesh harmonic. A band's ratio to its mesh line scatters by some 8 dB, for the line is one number
that hangs on tip relief and resonances: many bands average it out."""

WINDOW_PITCHES = 1.5
"""A tooth is in mesh for as long as the contact ratio says, and the answer rings on a little."""

_SIDEBANDS = 2
"""Lines this near to a mesh harmonic are run-out, not a tooth."""

_LOWEST_ORDER = 4
"""Below: unbalance, misalignment, run-out."""

_STEPS_PER_TOOTH = 32


@dataclass(frozen=True)
class ToothEvent:
    """The window with the most energy.

    Parameters
    ----------
    centre_rev : float
        Middle of the window, 0 to 1.
    prominence : float
        Its energy over the median window's, mean over bands and channels; 1: nothing stands out.
    window, background : arrays, (n_bands, n_channels)
        Mean square envelope of each band in the window and in the median window. Band 0 lies below the first mesh
        harmonic, band k about the k-th.
    """

    centre_rev: float
    prominence: float
    window: FloatArray
    background: FloatArray


def n_bands(shaft: ShaftLines) -> int:
    """Return how many mesh harmonics have a whole band below the highest order, 10 at most."""
    return min(MOST_BANDS, int((shaft.highest_order - shaft.teeth // 2) / shaft.teeth))


def find_event(shaft: ShaftLines) -> ToothEvent:
    """Find the window of 1.5 tooth pitches with the most energy.

    Each band's mean square envelope is divided by its median over the revolution before bands and channels are added:
    what a resonance or a gain multiplies, it multiplies at all teeth.
    """
    envelopes = band_envelopes(shaft)
    n = envelopes.shape[-1]
    width = round(WINDOW_PITCHES * n / shaft.teeth)
    energy = sliding_mean(envelopes, width)
    median = np.median(energy, axis=-1, keepdims=True)
    relative = np.divide(energy, median, out=np.ones_like(energy), where=median > 0).mean(axis=(0, 1))
    start = int(np.argmax(relative))
    return ToothEvent(
        centre_rev=float((start + width / 2) / n % 1.0),
        prominence=float(relative[start] / np.median(relative)),
        window=energy[:, :, start],
        background=median[:, :, 0],
    )


def event_windows(shaft: ShaftLines, event: ToothEvent) -> tuple[FloatArray, FloatArray]:
    """Return each band's mean square envelope in the event's window and the median one, (n_bands + 1, n_channels)."""
    envelopes = band_envelopes(shaft)
    n = envelopes.shape[-1]
    width = round(WINDOW_PITCHES * n / shaft.teeth)
    energy = sliding_mean(envelopes, width)
    return energy[:, :, round(event.centre_rev * n - width / 2) % n], np.median(energy, axis=-1)


def band_envelopes(shaft: ShaftLines) -> FloatArray:
    """Return squared envelopes over one revolution, (n_bands + 1, n_channels, 32 z).

    e_k(θ) = |Σ_n x[kz + n] e^{2πi nθ}|², |n| <= z/2, without mesh lines, their nearest sidebands and the lowest orders.
    """
    z = shaft.teeth
    n = _STEPS_PER_TOOTH * z
    lines = without_regular_lines(shaft)
    bands = []
    for k in range(n_bands(shaft) + 1):
        orders = np.arange(max(_LOWEST_ORDER, k * z - z // 2), k * z + z // 2 + 1)
        shifted = np.zeros((len(lines), n), dtype=complex)
        shifted[:, (orders - k * z) % n] = lines[:, orders]
        bands.append(np.abs(np.fft.ifft(shifted, axis=1) * n) ** 2)
    return np.stack(bands)


def without_regular_lines(shaft: ShaftLines) -> np.ndarray:
    """Return the lines with those set to 0 that belong to all teeth alike: shaft orders, mesh, nearest sidebands."""
    lines = shaft.lines.copy()
    orders = np.arange(lines.shape[1])
    z = shaft.teeth
    near_mesh = orders_from_mesh(orders, z) <= _SIDEBANDS
    lines[:, (orders < _LOWEST_ORDER) | near_mesh] = 0.0
    return lines


def sliding_mean(values: FloatArray, width: int) -> FloatArray:
    """Return the mean over the window that starts at each sample of a periodic signal."""
    doubled = np.concatenate([np.zeros((*values.shape[:-1], 1)), values, values[..., :width]], axis=-1).cumsum(axis=-1)
    mean: FloatArray = (doubled[..., width:-1] - doubled[..., : values.shape[-1]]) / width
    return mean
