"""Power spectral density over frequency by Welch's method."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.recording.types import Recording
from gearsig.spectra.blocks import checked_signal, mean_power, plan_blocks, scaled, scaled_unit
from gearsig.spectra.types import Spectrum

DEFAULT_BLOCK = 8192


def power_density(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    unit: str = "",
    source: str = "",
    window: str = "hann",
    n_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return the one-sided power spectral density, averaged over windowed overlapping blocks.

    S_k = c_k mean |Σ x[n] w[n] exp(-2πi k n/N)|² / (fs Σ w[n]²), c_k = 2 but at DC and Nyquist 1.

    Parameters
    ----------
    values : array, (n_samples,)
        The mean is not removed.
    sampling_rate_hz : float
    unit, source : str
        Of the signal.
    window : str
        See `make_window`.
    n_per_block : int or None
        Block length; None takes 8192 samples, or an eighth of a shorter signal.
    overlap : float
        0 to 0.95.

    Returns
    -------
    Spectrum
        Scaling "power density", unit e.g. "(m/s^2)^2/Hz"; its integral over frequency is the mean square.

    Raises
    ------
    InputError
        On a wrong shape, rate, window or block length.

    Notes
    -----
    Not for the level of a tone: its density grows with the block length. Use `amplitude_spectrum`.

    References
    ----------
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", 1967.
    """
    x = checked_signal(values)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    n = n_per_block if n_per_block is not None else min(DEFAULT_BLOCK, max(2, len(x) // 8))
    plan = plan_blocks(len(x), n, overlap, window)
    resolution = fs / plan.n_per_block
    bandwidth = plan.window.noise_bandwidth_bins * resolution
    power = mean_power(x, plan)
    return Spectrum(
        values=scaled(power, "power density", bandwidth, plan.n_per_block),
        positions=np.arange(len(power)) * resolution,
        axis="frequency",
        scaling="power density",
        unit=scaled_unit(unit, "power density"),
        resolution=resolution,
        noise_bandwidth=bandwidth,
        window=plan.window.name,
        n_averages=plan.n_averages,
        source=source,
    )


def channel_density(
    recording: Recording,
    channel: str,
    *,
    window: str = "hann",
    n_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return `power_density` of one channel of a recording, with its unit and name."""
    row = recording.channels[recording.index(channel)]
    return power_density(
        recording.values(channel),
        recording.sampling_rate_hz,
        unit=row.unit,
        source=row.name,
        window=window,
        n_per_block=n_per_block,
        overlap=overlap,
    )
