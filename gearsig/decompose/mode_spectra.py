"""Amplitude spectra of modes and of what they leave."""

from __future__ import annotations

from dataclasses import replace

from gearsig.decompose.types import Modes
from gearsig.spectra.amplitude import amplitude_spectrum
from gearsig.spectra.types import Spectrum


def mode_spectra(modes: Modes) -> tuple[Spectrum, ...]:
    """Return the amplitude spectrum (peak, Hann window) of each mode in its order, and of the residual last.

    Over frequency or order, as the modes are.
    """
    names = [*(f"mode {k + 1}" for k in range(modes.n_modes)), "residual"]
    spectra = (
        amplitude_spectrum(x, modes.sampling_rate, unit=modes.unit, source=f"{name} of {modes.source or 'signal'}")
        for name, x in zip(names, [*modes.waveforms, modes.residual], strict=True)
    )
    return tuple(replace(spectrum, axis=modes.axis, shaft=modes.shaft) for spectrum in spectra)
