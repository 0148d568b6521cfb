"""Whether the energy of a periodic signal is gathered at one angle, more than its spectrum alone would make it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

_SURROGATES_AT_ONCE = 256
"""Bounds the memory: 256 × 4 channels × 4096 angles in double precision are 34 MB."""

_ENOUGH_HIGHER = 30
"""Surrogates with as high a ratio after which the p-value is known to a fifth of itself, and is no small one."""


@dataclass(frozen=True)
class Localisation:
    """The window of angle with the most energy.

    Parameters
    ----------
    angle_rev : float
        Where in the window the event sets in, 0 to 1 revolution.
    start_rev : float
        Where the window begins.
    width_rev : float
    ratio_db : float
        Energy in it over the median window's, summed over channels that are each scaled to unit energy.
    p_value : float
        The larger of two: the share of surrogates (same spectra, same relations between the channels, random phases)
        with as high a ratio, and the chance of it among teeth that differ as the teeth of a good gear do.
    repeatability : float
        Correlation of odd and even revolutions within the window, -1 to 1; about 0 for noise, for impacts that are
        not tied to this shaft, and for a single event in one revolution.
    channel_shares : tuple of float
        Energy in the window over the median window's for each channel.
    """

    angle_rev: float
    start_rev: float
    width_rev: float
    ratio_db: float
    p_value: float
    repeatability: float
    channel_shares: tuple[float, ...]


def localise(
    signals: FloatArray, halves: FloatArray, width_rev: float, n_surrogates: int, rng: np.random.Generator
) -> Localisation:
    """Test whether the energy of a synchronous average's difference signal sits at one tooth.

    Phase-randomised surrogates keep the spectrum: a residual of few lines, tooth-to-tooth scatter or coloured noise
    gives windows of unequal energy too, and only what goes beyond them counts. The same random phases are used for all
    channels, which keeps their relations.

    Surrogates know nothing of teeth. On a good gear each tooth is a little stronger or weaker than its neighbours, over
    its whole engagement and in all harmonics at once, so that energies per tooth scatter like the square of one normal
    number (chi-square with one degree of freedom), which is more than surrogates do: that is the second test.

    Parameters
    ----------
    signals : array, (n_channels, n_angles)
        Over one revolution.
    halves : array, (n_channels, 2, n_angles)
        The same of odd and even revolutions by themselves.
    width_rev : float
        Width of the window in revolutions, e.g. one tooth pitch.
    n_surrogates : int
        At most; the drawing stops early once it is plain that nothing is there.
    rng : Generator

    Returns
    -------
    Localisation

    References
    ----------
    J. Theiler, S. Eubank, A. Longtin, B. Galdrikian, J. D. Farmer, "Testing for nonlinearity in time series: the
    method of surrogate data", 1992. J. Besag, P. Clifford, "Sequential Monte Carlo p-values", 1991.
    """
    n = signals.shape[1]
    width = max(2, round(width_rev * n))
    scale = np.sqrt(np.mean(signals**2, axis=1, keepdims=True))
    used = scale[:, 0] > 0
    x = signals[used] / scale[used]
    kernel = np.conj(np.fft.rfft(np.r_[np.ones(width) / width, np.zeros(n - width)]))
    energies = _window_energy(x**2, kernel, n)
    joint = energies.sum(axis=0)
    start = int(np.argmax(joint))
    ratio = float(joint[start] / np.median(joint))
    drawn = np.empty(0)
    for surrogates in _surrogates(x, n_surrogates, rng):
        drawn = np.append(drawn, _ratios(surrogates, kernel, n))
        if np.sum(drawn >= ratio) >= _ENOUGH_HIGHER:
            break
    inside = (start + np.arange(width)) % n
    medians = np.median(energies, axis=1)
    shares = np.zeros(len(signals))
    shares[used] = energies[:, start] / medians
    return Localisation(
        angle_rev=_onset(x, start, width),
        start_rev=start / n,
        width_rev=width / n,
        ratio_db=10 * float(np.log10(ratio)),
        p_value=max(_p_among_surrogates(ratio, drawn), _p_among_teeth(ratio, n / width)),
        repeatability=_agreement(halves[used][:, :, inside] / scale[used][:, None]),
        channel_shares=tuple(float(s) for s in shares),
    )


def _p_among_surrogates(ratio: float, drawn: FloatArray) -> float:
    """Return the share of surrogates with as high a ratio; beyond the highest, the tail of a Gumbel distribution.

    Window energies of Gaussian signals have exponential tails, and the largest of many such is Gumbel distributed; mean
    and standard deviation of the drawn ratios give its parameters (E. J. Gumbel, *Statistics of Extremes*, 1958).
    """
    share = (float(np.sum(drawn >= ratio)) + 1) / (len(drawn) + 1)
    scale = float(drawn.std()) * np.sqrt(6) / np.pi
    if ratio <= drawn.max() or scale == 0:
        return share
    location = float(drawn.mean()) - np.euler_gamma * scale
    return min(share, float(-np.expm1(-np.exp(-(ratio - location) / scale))))


def _p_among_teeth(ratio: float, n_teeth: float) -> float:
    """Return P(largest of n chi-square(1) numbers >= ratio · their median)."""
    from scipy.special import erfc

    median = 0.4549364  # of the chi-square distribution with one degree of freedom
    single = float(erfc(np.sqrt(ratio * median / 2)))
    return float(-np.expm1(n_teeth * np.log1p(-min(single, 1 - 1e-12))))


def _agreement(halves: FloatArray) -> float:
    """Return the correlation between odd and even revolutions, (n_channels, 2, n_angles), over all channels."""
    odd, even = halves[:, 0], halves[:, 1]
    size = float(np.sqrt(np.sum(odd**2) * np.sum(even**2)))
    return float(np.sum(odd * even)) / size if size > 0 else 0.0


def _onset(x: FloatArray, start: int, width: int) -> float:
    """Return the angle within the window at which the energy has risen to half of its highest value.

    A knock rises at once and rings on: its highest energy comes a little after it. Energy is taken over an eighth of
    the window, and a little of what lies before the window is looked at too.
    """
    n, short = x.shape[1], max(1, width // 8)
    inside = (start - short + np.arange(width + short)) % n
    energy = np.convolve((x[:, inside] ** 2).sum(axis=0), np.ones(short), "valid")
    rise = int(np.argmax(energy >= 0.5 * energy.max()))
    return float(((start - short + rise + short / 2) / n) % 1.0)


def _window_energy(square: FloatArray, kernel: np.ndarray, n: int) -> FloatArray:
    """Return the mean square in the window that starts at each angle, by circular correlation."""
    energy: FloatArray = np.fft.irfft(np.fft.rfft(square, axis=-1) * kernel, n, axis=-1)
    return energy


def _surrogates(x: FloatArray, n_surrogates: int, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Yield surrogates of all channels, (n, n_channels, n_angles), in bounded portions."""
    n = x.shape[1]
    lines = np.fft.rfft(x, axis=1)
    done = 0
    while done < n_surrogates:
        m = min(_SURROGATES_AT_ONCE, n_surrogates - done)
        phases = rng.uniform(0, 2 * np.pi, (m, 1, lines.shape[1]))
        phases[..., 0] = 0.0
        yield np.fft.irfft(lines * np.exp(1j * phases), n, axis=-1)
        done += m


def _ratios(surrogates: FloatArray, kernel: np.ndarray, n: int) -> FloatArray:
    joint = _window_energy(surrogates**2, kernel, n).sum(axis=1)
    ratios: FloatArray = joint.max(axis=1) / np.median(joint, axis=1)
    return ratios
