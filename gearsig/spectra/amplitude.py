"""Amplitude and power spectra over frequency."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray, one_of, positive
from gearsig.recording.types import Recording
from gearsig.spectra.blocks import checked_signal, mean_power, plan_blocks, scaled, scaled_unit
from gearsig.spectra.types import Scaling, Spectrum

AMPLITUDE_SCALINGS = ("amplitude peak", "amplitude rms", "power")


def amplitude_spectrum(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    unit: str = "",
    source: str = "",
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    n_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return the amplitude or power spectrum of a signal, of one block or as the rms mean over blocks.

    A_k = 2 |Σ x[n] w[n] exp(-2πi k n/N)| / Σ w[n]; half of that at DC and at Nyquist.

    Parameters
    ----------
    values : array, (n_samples,)
        The mean is not removed: it stands at line 0.
    sampling_rate_hz : float
    unit, source : str
        Of the signal.
    window : str
        See `make_window`.
    scaling : str
        "amplitude peak" (a bin-centred sine of amplitude 1 reads 1), "amplitude rms" (1/√2) or "power" (1/2).
    n_per_block : int or None
        Block length; None takes the whole signal as one block, with the finest resolution and no averaging.
    overlap : float
        0 to 0.95, the part of a block that the next one repeats.

    Returns
    -------
    Spectrum
        Over frequency. Parseval: with a rectangular window and one block, the sum of "power" is the mean square;
        with another window, the sum over the noise bandwidth in lines is the mean square of x·w over that of w.

    Raises
    ------
    InputError
        On a wrong shape, rate, window, scaling or block length.

    Notes
    -----
    Not for noise levels: they depend on the window and the block length here. Use `power_density`.
    Not for a speed that changes by more than a line over the block: use an order spectrum.

    Examples
    --------
    >>> t = np.arange(1000) / 1000
    >>> spectrum = amplitude_spectrum(3 * np.sin(2 * np.pi * 50 * t), 1000.0)
    >>> round(float(spectrum.values[50]), 9)
    3.0
    """
    x = checked_signal(values)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    one_of(scaling, "scaling", AMPLITUDE_SCALINGS)
    plan = plan_blocks(len(x), n_per_block, overlap, window)
    resolution = fs / plan.n_per_block
    bandwidth = plan.window.noise_bandwidth_bins * resolution
    power = mean_power(x, plan)
    return Spectrum(
        values=scaled(power, scaling, bandwidth, plan.n_per_block),
        positions=np.arange(len(power)) * resolution,
        axis="frequency",
        scaling=scaling,
        unit=scaled_unit(unit, scaling),
        resolution=resolution,
        noise_bandwidth=bandwidth,
        window=plan.window.name,
        n_averages=plan.n_averages,
        source=source,
    )


def channel_spectrum(
    recording: Recording,
    channel: str,
    *,
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    n_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return `amplitude_spectrum` of one channel of a recording, with its unit and name."""
    row = recording.channels[recording.index(channel)]
    return amplitude_spectrum(
        recording.values(channel),
        recording.sampling_rate_hz,
        unit=row.unit,
        source=row.name,
        window=window,
        scaling=scaling,
        n_per_block=n_per_block,
        overlap=overlap,
    )
