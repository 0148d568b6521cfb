"""Blind deconvolution: filters that undo the path between impacts and a sensor and sharpen the impacts again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, freeze, not_negative, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.spectra._types import named_signal

LOADING = 1e-9
"""Diagonal loading, relative to the correlation matrix's mean diagonal: a signal of few lines leaves it singular."""

CONVERGED = 1e-4
"""Relative change of the kurtosis at which the iteration ends."""


@dataclass(frozen=True)
class Deconvolved:
    """A signal after an inverse filter.

    Parameters
    ----------
    values : array, (n_samples - n_taps + 1,)
        y_n = Σ_l f_l x_{n + n_taps - 1 - l}, only where the whole filter lies within the signal.
    sampling_rate_hz : float
    taps : array, (n_taps,)
        f, of unit norm.
    score : float
        The maximised quantity: the kurtosis Σy⁴ n/(Σy²)² (3 for Gaussian noise), or the multipoint norm (0 to 1).
    unit, source : str
    """

    values: FloatArray
    sampling_rate_hz: float
    taps: FloatArray
    score: float
    unit: str
    source: str

    def __post_init__(self) -> None:
        freeze(self, "values", "taps")

    def __repr__(self) -> str:
        return f"Deconvolved({self.source}: {len(self.values)} samples, {len(self.taps)} taps, score {self.score:.4g})"


def minimum_entropy_deconvolution(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    n_taps: int = 100,
    n_iterations: int = 50,
    unit: str = "",
    source: str = "",
) -> Deconvolved:
    r"""Return the signal filtered to maximum kurtosis, hence most impulsive (MED).

    .. math:: \max_f \; \frac{n \sum y^4}{(\sum y^2)^2}, \qquad
       f \leftarrow (X X^T)^{-1} X y^3 \frac{\sum y^2}{\sum y^4}, \qquad y = X^T f

    X holds the signal at all delays of the filter. Only samples where the whole filter lies within the signal are
    used, so that no jump at the start is mistaken for an impact.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    n_taps : int
        Length of the filter: about the ringing time of an impact, 30 to 500.
    n_iterations : int
        Maximum; the iteration ends when the kurtosis changes by less than 10⁻⁴ of itself.
    unit, source : str
        Default: the channel's.

    Returns
    -------
    Deconvolved
        With the kurtosis as score.

    Raises
    ------
    InputError
        On a wrong shape, or a filter longer than a tenth of the signal.
    RefusalError
        On a constant signal.

    Notes
    -----
    It sharpens whatever is most impulsive: a single shock wins over many small ones. If the period of the impacts is
    known, `multipoint_deconvolution` avoids this. Remove tones first, see `prepared_signal`.

    References
    ----------
    R. A. Wiggins, "Minimum entropy deconvolution", 1978. H. Endo and R. B. Randall, "Enhancement of autoregressive
    model based gear tooth fault detection technique by the use of minimum entropy deconvolution filter", 2007. G. L.
    McDonald and Q. Zhao, "Multipoint optimal minimum entropy deconvolution and convolution fix", 2017 (ends).
    """
    x, fs, unit, source = _checked(signal, channel_or_rate_hz, unit, source, n_taps)
    solve = _Normal(x, n_taps)
    taps: FloatArray = np.zeros(n_taps)
    taps[n_taps // 2] = 1.0  # a delay: the signal itself
    best, best_taps, last = -np.inf, taps, -np.inf
    for _ in range(count(n_iterations, "n_iterations") + 1):
        y = _filtered(x, taps)
        kurtosis = float(len(y) * np.sum(y**4) / np.sum(y**2) ** 2)
        if kurtosis > best:
            best, best_taps = kurtosis, taps
        if abs(kurtosis - last) <= CONVERGED * kurtosis:
            break
        last = kurtosis
        taps = solve(_correlated(x, y**3))
        taps /= np.linalg.norm(taps)
    title = f"{source or 'signal'}, minimum entropy deconvolution"
    return Deconvolved(_filtered(x, best_taps), fs, best_taps, best, unit, title)


def multipoint_deconvolution(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    period_s: float,
    *,
    n_taps: int = 100,
    width_s: float = 0.0,
    unit: str = "",
    source: str = "",
) -> Deconvolved:
    r"""Return the signal filtered to be as close as possible to a train of impacts of known period (MOMEDA).

    .. math:: \max_f \; \frac{t^T y}{\lVert t \rVert \lVert y \rVert}, \qquad f = (X X^T)^{-1} X t

    t is the train. The solution is exact, without iterations, and for the whole train at once, whereas minimum entropy
    or maximum correlated kurtosis deconvolution (McDonald, Zhao and Zuo 2012) converge to one shock or a few periods.

    Parameters
    ----------
    signal, channel_or_rate_hz, n_taps, unit, source
        As in `minimum_entropy_deconvolution`.
    period_s : float
        Time between two impacts; it need not be a whole number of samples.
    width_s : float
        Width of each impact in t: the timing drift of the impacts over the record that is tolerated. 0 is one sample.

    Returns
    -------
    Deconvolved
        With the cosine between y and t as score: about sqrt(n_taps/n_samples) for white noise, 1 for the train itself.

    Raises
    ------
    InputError, RefusalError
        As there; also if the period is shorter than two samples or fits fewer than three times into the signal.

    Notes
    -----
    Any signal has some content at any period: compare the score with those of other periods, see `multipoint_norms`.
    Over long records a bearing's slip puts the train out of step: resample to the angle, take a segment, or set a
    width.

    References
    ----------
    G. L. McDonald and Q. Zhao, "Multipoint optimal minimum entropy deconvolution and convolution fix: application to
    vibration fault detection", 2017.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> x = np.zeros(5000)
    >>> x[::125] = 1.0
    >>> x = np.convolve(x, np.exp(-np.arange(60) / 8) * np.sin(np.arange(60)))[:5000] + 0.2 * rng.normal(size=5000)
    >>> y = multipoint_deconvolution(x, 1000.0, 0.125)
    >>> y.score > 2 * multipoint_deconvolution(x, 1000.0, 0.1037).score
    True
    """
    x, fs, unit, source = _checked(signal, channel_or_rate_hz, unit, source, n_taps)
    train = _train(len(x) - n_taps + 1, period_s, fs, not_negative(width_s, "width_s", "s"))
    taps = _Normal(x, n_taps)(_correlated(x, train))
    taps /= np.linalg.norm(taps)
    y = _filtered(x, taps)
    score = float(train @ y / (np.linalg.norm(train) * np.linalg.norm(y)))
    title = f"{source or 'signal'}, multipoint deconvolution at {1 / period_s:.6g} Hz"
    return Deconvolved(y, fs, taps, score, unit, title)


def multipoint_norms(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    periods_s: FloatArray,
    *,
    n_taps: int = 100,
    width_s: float = 0.0,
) -> FloatArray:
    r"""Return the score of `multipoint_deconvolution` for each of several periods.

    .. math:: \sqrt{b^T (X X^T)^{-1} b} / \lVert t \rVert, \qquad b = X t

    Parameters
    ----------
    signal, channel_or_rate_hz, n_taps, width_s
        As there.
    periods_s : array, (n_periods,)

    Returns
    -------
    array, (n_periods,)
        Cosines, 0 to 1. Multiples of the true period stand out, too; the true one is the shortest that does.
    """
    x, fs, _, _ = _checked(signal, channel_or_rate_hz, "", "", n_taps)
    solve = _Normal(x, n_taps)
    norms = []
    for period_s in np.asarray(periods_s, dtype=np.float64):
        train = _train(len(x) - n_taps + 1, float(period_s), fs, width_s)
        b = _correlated(x, train)
        norms.append(np.sqrt(max(float(b @ solve(b)), 0.0)) / np.linalg.norm(train))
    return np.array(norms)


def _checked(
    signal: FloatArray | Recording, channel_or_rate_hz: str | float, unit: str, source: str, n_taps: int
) -> tuple[FloatArray, float, str, str]:
    x, fs, unit, source = named_signal(signal, channel_or_rate_hz, unit, source, minimum=64)
    count(n_taps, "n_taps", minimum=2, maximum=len(x) // 10, remedy="a tenth of the signal at most")
    x = x.astype(np.float64) - float(np.mean(x))
    if float(np.abs(x).max()) <= 1e-12 * float(np.abs(signal if isinstance(signal, np.ndarray) else x).max()):
        raise RefusalError("the signal is constant: it has no impacts", remedy="check the channel")
    return x, fs, unit, source


class _Normal:
    """Solves (X Xᵀ) f = b for the signal's matrix of delays, (n_taps, n - n_taps + 1)."""

    def __init__(self, x: FloatArray, n_taps: int) -> None:
        from scipy.linalg import cho_factor

        n = len(x)
        first = _correlated(x, x[n_taps - 1 :])  # row 0: delay 0 against all others
        matrix = np.empty((n_taps, n_taps))
        for lag in range(n_taps):
            # Along a diagonal, one product drops out at the signal's end and one enters at its start.
            i = np.arange(1, n_taps - lag)
            change = x[n_taps - 1 - i] * x[n_taps - 1 - i - lag] - x[n - i] * x[n - i - lag]
            diagonal = first[lag] + np.concatenate([[0.0], np.cumsum(change)])
            rows = np.arange(n_taps - lag)
            matrix[rows, rows + lag] = matrix[rows + lag, rows] = diagonal
        matrix[np.diag_indices(n_taps)] += LOADING * np.trace(matrix) / n_taps
        self._factor = cho_factor(matrix)

    def __call__(self, b: FloatArray) -> FloatArray:
        from scipy.linalg import cho_solve

        solution: FloatArray = cho_solve(self._factor, b)
        return solution


def _filtered(x: FloatArray, taps: FloatArray) -> FloatArray:
    """Return Xᵀ f."""
    from scipy.signal import oaconvolve

    y: FloatArray = oaconvolve(x, taps, mode="valid")
    return y


def _correlated(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return X y: Σ_n y_n x_{n + L - 1 - l} for each of the L = len(x) - len(y) + 1 delays l."""
    from scipy.signal import correlate

    b: FloatArray = correlate(x, y, mode="valid", method="fft")[::-1]
    return b


def _train(n: int, period_s: float, fs: float, width_s: float) -> FloatArray:
    """Return impacts of height 1, one per period, each spread over its two adjacent samples or over the width."""
    period = positive(period_s, "period_s", "s") * fs
    if not 2.0 <= period <= n / 3:
        raise InputError(f"period_s is {period_s:g}", allowed=f"{2 / fs:g} to {n / 3 / fs:g} s for this signal")
    places = np.arange(0.0, n - 1.0, period)
    below = places.astype(np.int64)
    train = np.zeros(n)
    train[below] += 1.0 - (places - below)
    train[below + 1] += places - below
    width = round(width_s * fs)
    return np.convolve(train, np.ones(width), mode="same") if width > 1 else train
