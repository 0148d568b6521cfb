"""Signal decomposition: variational modes and wavelet denoising."""

from gearsig.decompose._suggestion import ModeSuggestion, ModeTrial, noise_width, suggest_modes
from gearsig.decompose._vmd import (
    ModeAxis,
    Modes,
    StartName,
    VmdEngine,
    VmdSettings,
    mode_spectra,
    modes_by_block,
    peak_centres,
    vmd,
)
from gearsig.decompose._wavelet_denoising import (
    Denoised,
    DenoiseSettings,
    apply,
    bayes,
    denoise,
    noise_level,
    sure,
    universal,
)

__all__ = [
    "DenoiseSettings",
    "Denoised",
    "ModeAxis",
    "ModeSuggestion",
    "ModeTrial",
    "Modes",
    "StartName",
    "VmdEngine",
    "VmdSettings",
    "apply",
    "bayes",
    "denoise",
    "mode_spectra",
    "modes_by_block",
    "noise_level",
    "noise_width",
    "peak_centres",
    "suggest_modes",
    "sure",
    "universal",
    "vmd",
]
