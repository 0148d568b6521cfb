"""Fast kurtogram and the choice of a band from it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from gearsig.checks import FloatArray, count, freeze, not_negative
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import percent
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra._amplitude import Preparation, prepared_signal
from gearsig.spectra._types import named_signal

OVERLAP = 1.66
"""Envelope samples per independent one: Σ|ρ(m)|⁴ over the lags for the tree's filters (1.60 to 1.75 by path)."""


def kurtosis_error(n_bands: int, n_samples: int) -> float:
    """Return the standard error of the kurtosis of white Gaussian noise.

    The influence function of ⟨|z|⁴⟩/⟨|z|²⟩² is 2 L₂(|z|²), a Laguerre polynomial, whose covariance is 4|ρ(m)|⁴, hence
    Var K = (4/n) Σ|ρ(m)|⁴. For the whole real band it is the Hermite polynomial H₄: Var K = 24/n.
    """
    return float(np.sqrt((24.0 if n_bands == 1 else 4.0 * OVERLAP) / n_samples))


@dataclass(frozen=True)
class BandCandidate:
    """A frequency band and how impulsive it is.

    Parameters
    ----------
    low_hz, high_hz : float
    level : float
        The spectrum is cut into 2^level bands; thirds are at log2(3), 1 + log2(3), …
    kurtosis : float
        Of the complex envelope, E|z|⁴/(E|z|²)² - 2: 0 for Gaussian noise, -1 for a tone.
    standard_error : float
        Of the kurtosis under Gaussian noise.
    """

    low_hz: float
    high_hz: float
    level: float
    kurtosis: float
    standard_error: float

    @property
    def band_hz(self) -> tuple[float, float]:
        """Lower and upper limit."""
        return self.low_hz, self.high_hz


@dataclass(frozen=True)
class Kurtogram(Result):
    """Spectral kurtosis over the bands of a tree of halves and thirds.

    K = ⟨|z|⁴⟩/⟨|z|²⟩² - 2 of a band's complex envelope z; 0 for stationary Gaussian noise, -1 for a steady sine. For
    the whole band (level 0), which is real, K = ⟨x⁴⟩/⟨x²⟩² - 3.

    Parameters
    ----------
    low_hz, high_hz : arrays, (n_bands,)
    level : array, (n_bands,)
        log2 of the number of bands that the spectrum is cut into: 0, 1, log2 3, 2, 1 + log2 3, …; ascending.
    kurtosis : array, (n_bands,)
    standard_error : array, (n_bands,)
        Of the kurtosis under Gaussian noise, white within the band.
    largest_share : array, (n_bands,)
        Share of the largest envelope sample in Σ|z|⁴: 1 if a single event makes up the whole kurtosis.
    n_envelope_samples : array, (n_bands,)
        Samples of z used for the kurtosis, about twice the number of independent ones.
    preparation : str
        Preparation of the signal before the analysis.
    source : str
    """

    low_hz: FloatArray
    high_hz: FloatArray
    level: FloatArray
    kurtosis: FloatArray
    standard_error: FloatArray
    largest_share: FloatArray
    n_envelope_samples: FloatArray
    preparation: str = "none"
    source: str = field(default="")

    def __post_init__(self) -> None:
        arrays = ("low_hz", "high_hz", "level", "kurtosis", "standard_error", "largest_share", "n_envelope_samples")
        freeze(self, *arrays)
        if len({len(getattr(self, name)) for name in arrays}) != 1:
            raise InputError("the arrays of a kurtogram differ in length")

    @property
    def bandwidth_hz(self) -> FloatArray:
        """Width of each band."""
        return self.high_hz - self.low_hz

    @property
    def noise_limit(self) -> FloatArray:
        """Kurtosis that stationary Gaussian noise exceeds in at least one band in one of 20 kurtograms.

        Bonferroni quantile q of the normal distribution, corrected for the third and fourth moments of 2 L₂: skewness
        10/√m and excess kurtosis 294/m for m independent samples (Cornish–Fisher expansion).
        """
        from scipy.special import ndtri

        n = self.n_envelope_samples
        q, m = float(-ndtri(0.05 / len(n))), n / OVERLAP
        skewness = 10.0 / np.sqrt(m)
        bent = q + skewness * (q**2 - 1) / 6 + 294.0 / m * (q**3 - 3 * q) / 24 - skewness**2 * (2 * q**3 - 5 * q) / 36
        # A real signal's bands next to 0 and Nyquist show a little more: the mirror image is close.
        return np.asarray(bent * self.standard_error + 0.01)

    @property
    def levels(self) -> FloatArray:
        """Distinct levels, ascending."""
        return np.unique(self.level)

    def best_band(
        self,
        *,
        narrowest_hz: float = 0.0,
        lowest_hz: float = 0.0,
        highest_hz: float | None = None,
        with_whole: bool = True,
    ) -> BandCandidate:
        """Return the allowed band with the largest kurtosis; among equals, the widest.

        Parameters
        ----------
        narrowest_hz : float
            Minimum bandwidth: three times the highest modulation frequency of interest, or more.
        lowest_hz, highest_hz : float
            Bands lie between these; None is half the sampling rate.
        with_whole : bool
            Whether the whole spectrum (level 0) is allowed as a band.

        Raises
        ------
        RefusalError
            If no band fits.
        """
        top = float(self.high_hz.max()) if highest_hz is None else not_negative(highest_hz, "highest_hz", "Hz")
        rounding = 1e-9 * float(self.high_hz.max())
        allowed = (
            (self.bandwidth_hz >= not_negative(narrowest_hz, "narrowest_hz", "Hz") - rounding)
            & (self.low_hz >= not_negative(lowest_hz, "lowest_hz", "Hz") - rounding)
            & (self.high_hz <= top + rounding)
            & (with_whole | (self.level > 0))
        )
        if not allowed.any():
            raise RefusalError(
                f"no band of the kurtogram lies from {lowest_hz:g} to {top:g} Hz and is {narrowest_hz:g} Hz wide",
                remedy="widen the range or allow narrower bands",
            )
        i = int(np.argmax(np.where(allowed, self.kurtosis, -np.inf)))
        numbers = (float(a[i]) for a in (self.low_hz, self.high_hz, self.level, self.kurtosis, self.standard_error))
        return BandCandidate(*numbers)

    def warnings(self, band: BandCandidate) -> tuple[str, ...]:
        """Return reasons to distrust a band's kurtosis: chance, few samples, a single event."""
        i = int(np.argmin(np.abs(self.low_hz - band.low_hz) + np.abs(self.high_hz - band.high_hz)))
        n, share = int(self.n_envelope_samples[i]), float(self.largest_share[i])
        warnings = []
        limit = float(self.noise_limit[i])
        if band.kurtosis <= limit:
            warnings.append(
                f"kurtosis {band.kurtosis:.2g} is what noise alone reaches ({limit:.2g} in one kurtogram of 20): "
                "no band stands out"
            )
        elif band.kurtosis <= max(2.0 * limit, 0.3):  # slow level changes in long signals reach as much
            warnings.append(f"kurtosis {band.kurtosis:.2g} is small: the band hardly stands out from noise")
        if band.standard_error > 0.1:
            warnings.append(
                f"rests on {n} envelope samples: noise alone scatters by {band.standard_error:.2g}; record longer or "
                "allow wider bands only"
            )
        if share > 0.2:
            warnings.append(
                f"one envelope sample carries {percent(share)} of the fourth moment: a single event, not a train "
                "of impulses, may have chosen the band"
            )
        return tuple(warnings)


@dataclass(frozen=True)
class Splitter:
    """A low-pass filter shifted to the centre of each part of the band 0 to 1/2 (cycles per sample).

    The centres of the parts lie symmetrically about 1/4, so that the products with the cosines and sines of the first
    part serve the last one too, with the signs of the odd taps reversed. The middle of three parts is centred on 1/4.

    Parameters
    ----------
    n_parts : int
        2 or 3; also the decimation factor.
    cosine, sine : arrays, (n_side + 1,)
        Taps 0 … n_side of the first part's filter; for negative indices the cosine is even, the sine odd.
    middle : array, (n_side + 1,)
        Taps of the middle part: even ones real, odd ones imaginary. Zero for halves.
    """

    n_parts: int
    cosine: FloatArray
    sine: FloatArray
    middle: FloatArray

    @property
    def n_taps(self) -> int:
        """Length of the filters."""
        return 2 * len(self.cosine) - 1


@lru_cache(maxsize=2)
def splitting_filters(n_parts: int) -> Splitter:
    """Return the filters that split a band into halves or thirds.

    h(k) = w(k) sin(2π f_c k)/(πk), f_c = 1/(4 n_parts), with w a Hamming window up to the sine's third zero on either
    side. The response is 1/2 at a part's borders and below 0.3 % from 0.35 of its width beyond them; sampled at twice
    its width, it does not alias.
    """
    n_side = 6 * n_parts - 1  # the next tap is a zero of the sine
    k = np.arange(n_side + 1)
    window = 0.54 + 0.46 * np.cos(np.pi * k / (n_side + 1))
    h = window * np.sinc(k / (2.0 * n_parts)) / (2.0 * n_parts)
    h[2 * n_parts :: 2 * n_parts] = 0.0
    h /= h[0] + 2.0 * h[1:].sum()
    turn = np.pi * k / (2 * n_parts)
    quarter = np.where(k % 4 < 2, 1.0, -1.0) * (n_parts == 3)  # cos(πk/2) of even, sin(πk/2) of odd taps
    return Splitter(n_parts, h * np.cos(turn), h * np.sin(turn), h * quarter)


class Stage:
    """All bands of one level, each split into parts; keeps the samples that the next piece's filters still need."""

    def __init__(self, n_bands: int, n_parts: int, *, keep: bool) -> None:
        self.split: Splitter = splitting_filters(n_parts)
        self.moments = np.zeros((n_bands * n_parts, 3))
        self.n_outputs = 0
        self._tail: FloatArray = np.empty((n_bands, 2, 0))
        self._keep = keep

    def push(self, x: FloatArray) -> FloatArray:
        """Filter a piece of the bands, (n_bands, 2, n), into the parts, (n_bands·n_parts, 2, n_out)."""
        s = self.split
        joined: FloatArray = np.concatenate([self._tail, x], axis=2, dtype=x.dtype)
        n_out = max(0, (joined.shape[2] - s.n_taps) // s.n_parts + 1)
        parts = np.empty((len(self.moments) if self._keep else 0, 2, n_out), x.dtype)
        odd = self.n_outputs % 2 == 1
        taps = (a.astype(x.dtype) for a in (s.cosine, s.sine, s.middle))
        split(joined, *taps, s.n_parts, n_out, odd, parts, self.moments)
        self._tail = joined[:, :, n_out * s.n_parts :].copy()
        self.n_outputs += n_out
        return parts


def tree_moments(x: FloatArray, n_levels: int, mean: float, scale: float) -> list[tuple[int, FloatArray, int]]:
    """Return (number of bands, their moments Σ|z|², Σ|z|⁴, max|z|², number of samples) for each row of the tree.

    Row 0 is the real signal itself, followed by 2, 3, 4, 6 … 2^L, 3·2^(L-1) bands. Outputs are used only if the whole
    filter lies within the signal. The moments are those of (x - mean)/scale. Computed in the signal's precision: single
    changes a kurtosis by some 1e-6.
    """
    halves = [Stage(2**k, 2, keep=k < n_levels - 1) for k in range(n_levels)]
    thirds = [Stage(2**k, 3, keep=False) for k in range(n_levels)]
    whole = np.zeros(3)
    for start in range(0, len(x), 1 << 16):  # a level's bands stay near the caches, whatever the signal's length
        piece = x[start : start + (1 << 16)].astype(np.float64)
        piece -= mean
        piece /= scale
        power = piece * piece
        whole += (power.sum(), float(np.dot(power, power)), 0.0)
        whole[2] = max(whole[2], float(power.max()))
        band: FloatArray = np.zeros((1, 2, len(piece)), np.result_type(x.dtype, np.float32))
        band[0, 0] = piece
        for half, third in zip(halves, thirds, strict=True):
            third.push(band)
            band = half.push(band)
    rows: list[tuple[int, FloatArray, int]] = [(1, whole[None, :], len(x))]
    for half, third in zip(halves, thirds, strict=True):
        rows += [(len(stage.moments), stage.moments, stage.n_outputs) for stage in (half, third)]
    return rows


MIN_SAMPLES = 512
"""Minimum envelope samples in the finest band: with fewer, the kurtosis of noise alone scatters by more than 0.1."""


def kurtogram(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    n_levels: int | None = None,
    narrowest_hz: float = 0.0,
    preparation: Preparation = "none",
    source: str = "",
) -> Kurtogram:
    """Return the fast kurtogram: the spectral kurtosis of 1, 2, 3, 4, 6 … 2^L, 3·2^(L-1) bands.

    K = ⟨|z|⁴⟩/⟨|z|²⟩² - 2, with z the complex envelope from a tree of filters that halve the band and the rate; each
    node is also split into thirds. The mean is removed first.

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    n_levels : int or None
        L, the number of halvings. None is 7 (128 and 192 bands), or as many as the length allows with at least 512
        samples per envelope.
    narrowest_hz : float
        Minimum width of the halved bands; used only if `n_levels` is None.
    preparation : str
        "none", "tones removed" or "whitened", see `prepared_signal`.
    source : str
        Default: the channel's name.

    Returns
    -------
    Kurtogram

    Raises
    ------
    InputError
        On a wrong shape, rate or number of levels.
    RefusalError
        On a signal that is constant or too short for two bands.

    Notes
    -----
    Not for a few strong shocks among many small impulses: the shocks determine the band. Read `warnings`.
    Borders between bands are the half-amplitude points of filters whose skirts extend a third of a band on either
    side. Memory use does not grow with the signal's length unless the signal is prepared.

    References
    ----------
    J. Antoni, "The spectral kurtosis: a useful tool for characterising non-stationary signals", 2006.
    J. Antoni, "Fast computation of the kurtogram for the detection of transient faults", 2007. The filters are longer
    than there (23 and 35 taps) and cut off at the bands' borders.

    Examples
    --------
    >>> t = np.arange(40000) / 10000.0
    >>> impacts = np.exp(-400 * (t % 0.05)) * np.sin(2 * np.pi * 3000 * (t % 0.05))
    >>> x = impacts + 0.1 * np.random.default_rng(0).normal(size=len(t))
    >>> low, high = kurtogram(x, 10000.0).best_band(narrowest_hz=300).band_hz
    >>> low <= 3000 <= high
    True
    """
    x, fs, _, source = named_signal(signal, channel_or_rate_hz, "", source, minimum=64)
    levels = _checked_levels(len(x), n_levels)
    if n_levels is None and not_negative(narrowest_hz, "narrowest_hz", "Hz") > 0.0:
        levels = max(1, min(levels, int(np.log2(max(fs / 2.0 / narrowest_hz * (1.0 + 1e-9), 1.0)))))
    x = prepared_signal(x, fs, preparation)
    low, high, mean = float(x.min()), float(x.max()), float(np.mean(x, dtype=np.float64))
    spread = max(high - mean, mean - low)
    if spread <= 1e-7 * max(-low, high) or spread == 0.0:
        raise RefusalError("the signal is constant: it has no impulses", remedy="check the channel")
    rows = [_row_of_bands(fs, *row) for row in tree_moments(x, levels, mean, spread)]
    lows, highs, level, kurtosis, error, share, n = (np.concatenate(column) for column in zip(*rows, strict=True))
    return Kurtogram(lows, highs, level, kurtosis, error, share, n, preparation, source or "signal")


def _checked_levels(n_samples: int, n_levels: int | None) -> int:
    n_max = int(np.floor(np.log2(n_samples / MIN_SAMPLES))) if n_samples >= MIN_SAMPLES else 0
    if n_max < 1:
        raise RefusalError(
            f"{n_samples} samples are too few for a kurtogram", remedy=f"record at least {2 * MIN_SAMPLES} samples"
        )
    if n_levels is None:
        return min(7, n_max)
    remedy = f"L levels take {MIN_SAMPLES} · 2^L samples, and there are {n_samples}"
    return count(n_levels, "n_levels", maximum=n_max, remedy=remedy)


def _row_of_bands(fs: float, n_bands: int, moments: FloatArray, n: int) -> tuple[FloatArray, ...]:
    """Return low, high, level, kurtosis, standard error, share of the largest sample, samples; each (n_bands,)."""
    second, fourth, largest = moments.T
    gaussian = 3.0 if n_bands == 1 else 2.0
    nothing = second <= 0.0
    ratio = np.divide(n * fourth, second**2, out=np.full(n_bands, gaussian), where=~nothing)
    share = np.divide(largest**2, fourth, out=np.zeros(n_bands), where=~nothing)
    edges = np.arange(n_bands + 1) * (fs / 2 / n_bands)
    full = [np.full(n_bands, value) for value in (np.log2(n_bands), kurtosis_error(n_bands, n), float(n))]
    return edges[:-1], edges[1:], full[0], ratio - gaussian, full[1], share, full[2]


# Reordering sums lets the compiler use vector instructions.
_REORDER = {"contract", "reassoc", "nsz"}
_TILE = 512
"""Outputs at a time: all sums of a tile in single precision stay in the L1 cache."""


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def split(x, cosine, sine, middle, n_parts, n_out, first_is_odd, parts, moments):  # type: ignore[no-untyped-def]
    """Filter each row of x into its parts and add up their moments.

    Row r of `x` (n_rows, 2, n: real and imaginary parts) gives rows n_parts·r … of `parts`, lowest band first, each
    again a signal on 0 to 1/2 of its own rate; `parts` of no rows keeps nothing. `moments` (n_rows·n_parts, 3)
    accumulates Σ|z|², Σ|z|⁴ and the largest |z|². `first_is_odd` is the parity of the first output's index.
    """
    n_side = len(cosine) - 1
    turned = np.empty((n_parts, 2, _TILE + (2 * n_side) // n_parts + 1), x.dtype)
    sums = np.empty((6, 2, _TILE), x.dtype)
    z = np.empty((3, 2, _TILE), x.dtype)
    for row in range(x.shape[0]):
        for start in range(0, n_out, _TILE):
            n = min(_TILE, n_out - start)
            _take_phases(x[row], start * n_parts, n * n_parts + 2 * n_side + 1, n_parts, turned)
            _filter(turned, cosine, sine, middle, n_parts, n, sums)
            _combine(sums, n_parts, n, z)
            for part in range(n_parts):
                _add_moments(z[part], n, moments[row * n_parts + part])
            if parts.shape[0] > 0:
                for part in range(n_parts):
                    sign = part % 2 == 1  # bands that start at odd multiples of half the new rate
                    _store(z[part], n, sign, (start % 2 == 1) != first_is_odd, parts[row * n_parts + part], start)


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _take_phases(x, start, n, n_parts, turned):  # type: ignore[no-untyped-def]
    """Split the samples from `start` on into n_parts phases, so that adjacent outputs read adjacent samples."""
    available = min(n, x.shape[1] - start)
    for component in range(2):
        for phase in range(n_parts):
            for m in range((available - phase + n_parts - 1) // n_parts):
                turned[phase, component, m] = x[component, start + phase + m * n_parts]


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _filter(turned, cosine, sine, middle, n_parts, n, sums):  # type: ignore[no-untyped-def]
    """Sum the products with cosine and sine taps, separately for even and odd (0 to 3), and the middle's (4, 5)."""
    n_side, nothing = len(cosine) - 1, cosine.dtype.type(0.0)  # a constant would be in double precision
    sums[:, :, :n] = 0.0
    for component in range(2):
        centre = turned[n_side % n_parts, component, n_side // n_parts :]
        for m in range(n):
            sums[0, component, m] = cosine[0] * centre[m]
            sums[4, component, m] = middle[0] * centre[m]
        for k in range(1, n_side + 1):
            a, b, c = cosine[k], sine[k], middle[k]
            if a == 0.0 and b == 0.0:
                continue
            before = turned[(n_side - k) % n_parts, component, (n_side - k) // n_parts :]
            after = turned[(n_side + k) % n_parts, component, (n_side + k) // n_parts :]
            odd = k % 2
            even_sum, odd_sum = sums[odd, component], sums[2 + odd, component]
            if n_parts == 2:
                _add_pair(before, after, a, b, n, even_sum, odd_sum)
            elif odd == 0:
                _add_three(before, after, a, b, c, nothing, n, even_sum, odd_sum, sums[4, component])
            else:
                _add_three(before, after, a, b, nothing, c, n, even_sum, odd_sum, sums[5, component])


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _add_pair(before, after, a, b, n, even_sum, odd_sum):  # type: ignore[no-untyped-def]
    for m in range(n):
        even_sum[m] += a * (after[m] + before[m])
        odd_sum[m] += b * (after[m] - before[m])


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _add_three(before, after, a, b, c, d, n, even_sum, odd_sum, middle_sum):  # type: ignore[no-untyped-def]
    for m in range(n):
        s, t = after[m] + before[m], after[m] - before[m]
        even_sum[m] += a * s
        odd_sum[m] += b * t
        middle_sum[m] += c * s + d * t


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _combine(sums, n_parts, n, z):  # type: ignore[no-untyped-def]
    """Form the parts: first = C - iS; last likewise with the odd taps of C and the even taps of S reversed."""
    last = n_parts - 1
    for component in range(2):
        sign = z.dtype.type(1 - 2 * component)  # -i(p + iq) = q - ip
        even_c, odd_c, middle_even = sums[0, component], sums[1, component], sums[4, component]
        even_s, odd_s, middle_odd = sums[2, 1 - component], sums[3, 1 - component], sums[5, 1 - component]
        for m in range(n):
            z[0, component, m] = even_c[m] + odd_c[m] + sign * (even_s[m] + odd_s[m])
            z[last, component, m] = even_c[m] - odd_c[m] - sign * (even_s[m] - odd_s[m])
        if n_parts == 3:
            for m in range(n):
                z[1, component, m] = middle_even[m] + sign * middle_odd[m]


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _add_moments(z, n, moments):  # type: ignore[no-untyped-def]
    real, imaginary = z[0], z[1]
    second = fourth = largest = z.dtype.type(0.0)
    for m in range(n):
        power = real[m] * real[m] + imaginary[m] * imaginary[m]
        second += power
        fourth += power * power
    for m in range(n):  # apart, as a maximum keeps the sums from vector instructions
        largest = max(largest, real[m] * real[m] + imaginary[m] * imaginary[m])
    moments[0] += second
    moments[1] += fourth
    moments[2] = max(moments[2], largest)


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _store(z, n, alternating, starts_odd, part, start):  # type: ignore[no-untyped-def]
    """Write z, times (-1)^m if alternating, which shifts the band by half the rate to 0."""
    for component in range(2):
        if not alternating:
            for m in range(n):
                part[component, start + m] = z[component, m]
            continue
        sign = part.dtype.type(-1.0 if starts_odd else 1.0)
        for m in range(n):
            part[component, start + m] = sign * z[component, m]
            sign = -sign
