"""How far the synchrosqueezed plane rises at high orders near the tooth."""

from __future__ import annotations

import numpy as np

from gearsig.severity.event import ToothEvent, n_bands, sliding_mean
from gearsig.severity.shaft_lines import ShaftLines
from gearsig.severity.shape import band_signal

LOWEST_HARMONIC = 3.5
"""High orders: from between the third and fourth mesh harmonic on."""

WINDOW_PITCHES = 2.0
_STEP = 4


def squeezed_rise_db(searched: ShaftLines, event: ToothEvent) -> float:
    """Return 10 log₁₀ of the squeezed energy near the tooth over that in the middling window, mean over channels.

    E = Σ |T(o, θ)|² over orders o above 3.5 mesh harmonics and the two pitches about the event. It grows with a crack's
    depth on one machine. Between machines it says no more of the depth than the energies that `features` holds: the
    squeezing moves energy between orders, not between angles.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the sound gear's.
    event : ToothEvent
    """
    from gearsig.timefreq.squeezed_cwt import squeezed_cwt
    from gearsig.timefreq.uniform import UniformSignal

    z, highest = searched.teeth, n_bands(searched) + 0.5
    rises = []
    for values in band_signal(searched, LOWEST_HARMONIC, highest, event.centre_rev):
        largest = float(np.abs(values).max())
        if largest == 0.0:
            continue
        signal = UniformSignal(values / largest, len(values), "order", highest=highest * z)
        plane = squeezed_cwt(signal, lowest=LOWEST_HARMONIC * z, highest=highest * z, step=_STEP).values
        energy = np.sum(np.abs(plane).astype(np.float64) ** 2, axis=0)
        width = round(WINDOW_PITCHES * len(energy) / z)
        windows = sliding_mean(energy, width)
        rises.append(windows[len(energy) // 2 - width // 2] / np.median(windows))
    return 10.0 * float(np.mean(np.log10(rises))) if rises else 0.0
