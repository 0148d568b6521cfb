"""What an event looks like in its tooth's engagement: by this a crack is told from a chipped or spalled tooth."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.severity.event import ToothEvent, band_envelopes, n_bands, sliding_mean, without_regular_lines
from gearsig.severity.shaft_lines import ShaftLines

SHAPE = ("lead", "tail", "duration", "kurtosis", "peak", "window_slope")
"""Order of the entries of `event_shape`."""

REACH_LEVEL = 4.0
"""Energy over that at the middling tooth down to which an event lasts: sound teeth reach it now and then."""

_STEPS_PER_TOOTH = 64
_NEAR_PITCHES = 2.5
_MOST_HARMONICS = 8
_LEAST = 1e-12


def event_shape(searched: ShaftLines, event: ToothEvent) -> FloatArray:
    """Return the numbers in the order of `SHAPE`.

    - lead, tail: ln of the energy one to three pitches before and after the event over its largest.
    - duration: ln of the energy's standard deviation about its middle, in pitches; kurtosis: ln of it; peak: ln of the
      largest energy density. A spall is short, a crack lasts as long as its tooth is in mesh.
    - window_slope: change of the window's ln energy per mesh harmonic.

    The event's phase against the mesh is left out: it tells chips apart on machines like those of the calibration, and
    misleads where the mesh harmonics pass a resonance.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the sound gear's.
    event : ToothEvent
    """
    levels = np.log(np.maximum(event.window, _LEAST * event.window.max())).mean(axis=1)
    slope = float(np.polyfit(np.arange(len(levels)), levels, 1)[0])
    return np.array([*_around(searched, event), *_durations(searched, event), slope])


def reach_cycles(searched: ShaftLines, event: ToothEvent) -> float:
    """Return for how many mesh cycles after its middle the event has four times the energy of a middling other tooth.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the sound gear's.
    event : ToothEvent
    """
    energy = _relative_energy(searched, event)
    after = energy[len(energy) // 2 :]
    below = np.flatnonzero(after < REACH_LEVEL)
    steps = len(energy) / searched.teeth
    return float((below[0] if len(below) else len(after)) / steps)


def _relative_energy(searched: ShaftLines, event: ToothEvent) -> FloatArray:
    """Return the energy in windows of one pitch over the middling one, the event in the middle."""
    envelopes = band_envelopes(searched)
    median = np.median(envelopes, axis=-1, keepdims=True)
    relative = np.divide(envelopes, median, out=np.ones_like(envelopes), where=median > 0).mean(axis=(0, 1))
    width = round(len(relative) / searched.teeth)
    energy = sliding_mean(relative, width)
    shift = len(energy) // 2 - round(event.centre_rev * len(energy)) + width // 2
    relative_energy: FloatArray = np.roll(energy, shift) / np.median(energy)
    return relative_energy


def _around(searched: ShaftLines, event: ToothEvent) -> tuple[float, float]:
    energy = _relative_energy(searched, event)
    middle, pitch = len(energy) // 2, round(len(energy) / searched.teeth)
    largest = energy[middle - 3 * pitch // 4 : middle + 3 * pitch // 4].max()
    before, after = energy[middle - 3 * pitch : middle - pitch], energy[middle + pitch : middle + 3 * pitch]
    return float(np.log(before.mean() / largest)), float(np.log(after.mean() / largest))


def _durations(searched: ShaftLines, event: ToothEvent) -> tuple[float, float, float]:
    """Return the logarithms of width, kurtosis and peak of the energy near the event."""
    z, highest = searched.teeth, min(n_bands(searched), _MOST_HARMONICS) + 0.5
    energy = band_signal(searched, 0.5, highest, event.centre_rev) ** 2
    level = np.median(sliding_mean(energy, _STEPS_PER_TOOTH), axis=1)
    relative = np.divide(energy, level[:, None], out=np.zeros_like(energy), where=level[:, None] > 0).mean(axis=0)
    pitches = (np.arange(len(relative)) - len(relative) // 2) / _STEPS_PER_TOOTH
    near = np.abs(pitches) < min(_NEAR_PITCHES, z / 4)
    density = np.maximum(relative[near] - np.median(relative[~near]), 0.0) + _LEAST
    density /= density.sum()
    off = pitches[near] - density @ pitches[near]
    variance = max(float(density @ off**2), _LEAST)
    kurtosis = max(float(density @ off**4) / variance**2, _LEAST)
    return 0.5 * float(np.log(variance)), float(np.log(kurtosis)), float(np.log(density.max() * _STEPS_PER_TOOTH))


def band_signal(searched: ShaftLines, lowest: float, highest: float, centre_rev: float) -> FloatArray:
    """Return one revolution of what tells teeth apart, between two mesh harmonics, `centre_rev` in its middle.

    Returns
    -------
    array, (n_channels, 64 z)
    """
    z, n = searched.teeth, _STEPS_PER_TOOTH * searched.teeth
    lines = without_regular_lines(searched)
    orders = np.arange(lines.shape[1])
    spectrum = np.zeros((len(lines), n // 2 + 1), dtype=complex)
    used = orders[(orders >= lowest * z) & (orders <= highest * z) & (orders < n // 2)]
    spectrum[:, used] = lines[:, used]
    signal: FloatArray = np.roll(np.fft.irfft(spectrum, n, axis=1) * n / 2, n // 2 - round(centre_rev * n), axis=1)
    return signal
