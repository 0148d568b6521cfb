"""Local noise floor of a spectrum, robust against its lines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.spectra.types import Spectrum

FEWEST_LINES = 16
"""Fewer lines than that per block make the quantile too uncertain (35 % with one average)."""


def noise_floor(spectrum: Spectrum, *, width: float | None = None, quantile: float = 0.5) -> Spectrum:
    """Return the mean noise at each line of a spectrum, estimated from a quantile of its neighbourhood.

    Under Gaussian noise of smooth density, the power of a line averaged K times follows a gamma distribution of
    shape K (K = 1: exponential; the amplitude's is Rayleigh). Its quantile q is mean · G⁻¹(q; K)/K, so that
    floor = Q_q / (G⁻¹(q; K)/K) is the mean noise power; for K = 1 and the median the divisor is ln 2. Lines of tones
    only shift the quantile by their share of the neighbourhood, whatever their height. Block quantiles every half
    width are joined by straight lines over log power; towards either end the blocks get shorter.

    Parameters
    ----------
    spectrum : Spectrum
        Of any scaling but "dimensionless".
    width : float or None
        Of the neighbourhood, in the axis' unit; at least 16 lines. It should hold many more noise lines than
        tones, and the density should change little over it. None takes 1/200 of the lines, but at least 256 lines
        (fewer, down to 48, where the spectrum is an average).
    quantile : float
        0.05 to 0.95. Lower ones bear more tones (at 0.25, three in four lines may be tones) but scatter more.

    Returns
    -------
    Spectrum
        Same axis and scaling. For amplitudes, it is the root of the mean squared amplitude, so that
        20 lg(amplitude/floor) = 10 lg(power/mean noise power).

    Raises
    ------
    RefusalError
        With fewer than 16 lines.
    InputError
        On a cepstrum, or a width below 16 lines.

    Notes
    -----
    Not for a spectrum without noise (a simulation's): the floor is then its rounding or leakage. DC and the window's
    leakage around it count as lines do.

    References
    ----------
    A. Leon-Garcia, *Probability, Statistics, and Random Processes for Electrical Engineering*, 3rd ed. (gamma
    distribution of averaged periodograms); the quantile's correction follows from it.
    """
    if spectrum.scaling == "dimensionless":
        raise InputError("a cepstrum has no noise floor", allowed="an amplitude or power spectrum")
    n_lines = len(spectrum.values)
    if n_lines < FEWEST_LINES:
        raise RefusalError(f"{n_lines} lines are too few for a floor", remedy="take a longer block")
    q = within(quantile, "quantile", 0.05, 0.95)
    block = _block_lines(spectrum, width)
    power = line_powers(spectrum)
    floor = _running_quantile(power, block, q) / gamma_quantile(q, spectrum.n_averages)
    is_amplitude = spectrum.scaling in ("amplitude peak", "amplitude rms")
    return replace(
        spectrum,
        values=np.sqrt(floor) if is_amplitude else floor,
        source=f"noise floor of {spectrum.source or 'spectrum'}",
    )


def line_powers(spectrum: Spectrum) -> FloatArray:
    """Return the values, squared if they are amplitudes."""
    values: FloatArray = np.asarray(spectrum.values, dtype=np.float64)
    return values**2 if spectrum.scaling in ("amplitude peak", "amplitude rms") else values


def gamma_quantile(q: float, n_averages: int) -> float:
    """Return the quantile q of a line's power over its mean, for n independent averages; ln 2 for the median and one.

    Examples
    --------
    >>> round(gamma_quantile(0.5, 1), 6)
    0.693147
    """
    from scipy.special import gammaincinv

    return float(gammaincinv(n_averages, q)) / n_averages


def _block_lines(spectrum: Spectrum, width: float | None) -> int:
    n_lines = len(spectrum.values)
    if width is None:
        # The floor's own scatter multiplies the false-alarm rate of a search above it; so many lines keep that small.
        return min(n_lines, max(48, 256 // spectrum.n_averages, n_lines // 200))
    block = round(positive(width, "width") / spectrum.resolution)
    if block < FEWEST_LINES:
        raise InputError(
            f"width {width:g} holds {block} lines of {spectrum.resolution:g}",
            allowed=f"at least {FEWEST_LINES * spectrum.resolution:g}",
            remedy="widen it, or take a longer block",
        )
    return min(block, n_lines)


def _running_quantile(power: FloatArray, block: int, q: float) -> FloatArray:
    """Return block quantiles every half block, interpolated over log power at every line."""
    n = len(power)
    half = block // 2
    blocks = np.lib.stride_tricks.sliding_window_view(power, block)[::half]
    centres = np.arange(len(blocks)) * half + (block - 1) / 2
    levels = np.quantile(blocks, q, axis=1)
    short = [s for s in (half, half // 2) if s >= FEWEST_LINES // 2]
    left = [(float(np.quantile(power[:s], q)), (s - 1) / 2) for s in reversed(short)]
    right = [(float(np.quantile(power[-s:], q)), n - (s + 1) / 2) for s in short]
    last = float(np.quantile(power[-block:], q)), n - (block + 1) / 2
    if last[1] > centres[-1]:
        right.insert(0, last)
    x = np.concatenate([[c for _, c in left], centres, [c for _, c in right]])
    y = np.concatenate([[v for v, _ in left], levels, [v for v, _ in right]])
    # Zeros (a dead stretch of a simulated spectrum) have no logarithm; the least positive double stands for them.
    logs = np.log(np.maximum(y, np.finfo(np.float64).tiny))
    order = np.argsort(x, kind="stable")
    result: FloatArray = np.exp(np.interp(np.arange(n), x[order], logs[order]))
    return result
