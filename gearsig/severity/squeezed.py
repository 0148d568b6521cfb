"""How far the synchrosqueezed plane rises at high orders near the tooth."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.severity.event import ToothEvent, n_bands, sliding_mean
from gearsig.severity.shaft_lines import ShaftLines
from gearsig.severity.shape import band_signal

LOWEST_HARMONIC = 3.5
"""High orders: from between the third and fourth mesh harmonic on."""

WINDOW_PITCHES = 2.0
_STEP = 4


def squeezed_rise_db(searched: ShaftLines, sound: ShaftLines, event: ToothEvent) -> float:
    """Return 10 log₁₀ of the squeezed energy near the tooth over that of a middling sound tooth, mean over channels.

    E = Σ |T(o, θ)|² over orders o above 3.5 mesh harmonics and the two pitches about the event. It grows with a crack's
    depth on one machine. Between machines it says no more of the depth than the energies that `features` holds: the
    squeezing moves energy between orders, not between angles.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the sound gear's.
    sound : ShaftLines
        The sound gear's average, or the average itself: whose middling tooth is compared with.
    event : ToothEvent
    """
    highest = min(n_bands(searched), n_bands(sound)) + 0.5
    near = [windows[len(windows) // 2] for windows in _windows(searched, highest, event)]
    middling = [np.median(windows) for windows in _windows(sound, highest, event)]
    return 10.0 * float(np.mean(np.log10(np.divide(near, middling))))


def _windows(shaft: ShaftLines, highest: float, event: ToothEvent) -> list[FloatArray]:
    """Return the mean energy in the window about each angle, the event in the middle, one array per channel."""
    from gearsig.timefreq.squeezed_cwt import squeezed_cwt
    from gearsig.timefreq.uniform import UniformSignal

    found = []
    for values in band_signal(shaft, LOWEST_HARMONIC, highest, event.centre_rev):
        largest = float(np.abs(values).max())
        signal = UniformSignal(values / largest, len(values), "order", highest=highest * shaft.teeth)
        lowest = LOWEST_HARMONIC * shaft.teeth
        plane = squeezed_cwt(signal, lowest=lowest, highest=highest * shaft.teeth, step=_STEP).values
        energy = largest**2 * np.sum(np.abs(plane).astype(np.float64) ** 2, axis=0)
        width = round(WINDOW_PITCHES * len(energy) / shaft.teeth)
        found.append(np.roll(sliding_mean(energy, width), width // 2))
    return found
