"""Where the modes' centre frequencies start."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.decompose.types import VmdSettings
from gearsig.errors import InputError


def first_centres(
    settings: VmdSettings, sampling_rate: float, n_samples: int, rng: np.random.Generator | None
) -> FloatArray:
    """Return the first centre frequencies in cycles per sample, (n_modes,).

    "uniform": k/2K; "random": one draw per mode, uniform over the logarithm from 1/n to 1/2, ascending.

    Raises
    ------
    InputError
        On given frequencies outside 0 to half the sampling rate, or "random" without a generator.
    """
    K = settings.n_modes
    centres: FloatArray = np.zeros(K)
    if settings.start == "uniform":
        centres = 0.5 / K * np.arange(K)
    elif settings.start == "random":
        centres = _random(K, n_samples, rng)
    elif settings.start != "zero":
        centres = np.array(settings.start, dtype=np.float64) / sampling_rate
        if not ((centres >= 0.0) & (centres <= 0.5)).all():  # written so that NaN fails too
            raise InputError(
                f"start is {settings.start}", allowed=f"0 to {sampling_rate / 2:g}, half the sampling rate"
            )
    if settings.zero_mode:
        centres[0] = 0.0
    return centres


def _random(K: int, n_samples: int, rng: np.random.Generator | None) -> FloatArray:
    if rng is None:
        raise InputError('start is "random" without a generator', where="rng", remedy="give numpy's default_rng(seed)")
    n = n_samples - n_samples % 2  # as the reference program, which drops the last sample of an odd length
    low = np.log(1.0 / n)
    return np.sort(np.exp(low + (np.log(0.5) - low) * rng.random(K)))
