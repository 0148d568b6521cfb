"""Real and power cepstrum, and editing of a cepstrum to keep or remove families of harmonics and sidebands."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gearsig.checks import ComplexArray, FloatArray, count, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Recording
from gearsig.spectra._types import Spectrum, checked_signal, named_signal

LOWEST_RELATIVE_MAGNITUDE = 1e-12
"""Lower limit of magnitudes, relative to the largest: lines of zero have no logarithm."""


def cepstrum(
    signal: FloatArray | Recording,
    channel_or_rate_hz: str | float,
    *,
    kind: Literal["real", "power"] = "real",
    source: str = "",
) -> Spectrum:
    """Return the cepstrum of a signal: the inverse transform of its log spectrum, over quefrency.

    Real: c(τ) = F⁻¹{ln|X(f)|}. Power: |F⁻¹{ln|X(f)|²}|² = 4 c(τ)². A whole family of harmonics or sidebands Δf apart
    appears as peaks at 1/Δf and its multiples (rahmonics).

    Parameters
    ----------
    signal : Recording or array, (n_samples,)
    channel_or_rate_hz : str or float
        A recording's channel, or an array's sampling rate in Hz.
    kind : str
        "real" (signed) or "power".
    source : str

    Returns
    -------
    Spectrum
        Axis "quefrency" in s from 0 to half the signal's length, dimensionless (natural logarithm).

    Raises
    ------
    RefusalError
        On a signal of zeros.
    InputError
        On a wrong shape or rate.

    Notes
    -----
    Not for levels: a transfer path adds only to low quefrencies, but so does any change in the shape of the noise
    floor. At the highest harmonic, the speed must not change by more than one line of the spectrum; otherwise use an
    angle signal (quefrency is then in revolutions).

    References
    ----------
    R. B. Randall, "A history of cepstrum analysis and its application to mechanical problems", 2017.

    Examples
    --------
    >>> x = np.zeros(1000)
    >>> x[::50] = 1.0
    >>> c = cepstrum(x + 1e-3 * np.random.default_rng(0).normal(size=1000), 1000.0)
    >>> round(c.largest_near(0.05, 0.02)[0], 3)
    0.05
    """
    x, fs, _, source = named_signal(signal, channel_or_rate_hz, "", source, minimum=4)
    one_of(kind, "kind", ("real", "power"))
    c = real_cepstrum(_transform(x), len(x))[: len(x) // 2 + 1]
    return Spectrum(
        values=c if kind == "real" else 4.0 * c**2,
        positions=np.arange(len(c)) / fs,
        axis="quefrency",
        scaling="dimensionless",
        unit="",
        resolution=1.0 / fs,
        noise_bandwidth=1.0 / fs,
        window="rectangular",
        n_averages=1,
        source=f"{kind} cepstrum of {source or 'signal'}",
    )


def lifter_families(
    values: FloatArray,
    sampling_rate_hz: float,
    spacing_hz: float,
    *,
    keep: bool,
    n_rahmonics: int | None = None,
    half_width_s: float | None = None,
) -> FloatArray:
    """Keep only, or remove, the families of lines `spacing_hz` apart from a signal.

    The real cepstrum is set to zero at (or, for `keep`, outside) the rahmonics k/Δf ± half width; the edited log
    magnitude is transformed back to time with the original phase. Removal reduces the family's lines to the level of
    their neighbourhood even if they are not exactly periodic.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz, spacing_hz : float
    keep : bool
        True keeps the families (and the mean level, quefrency 0), False removes them.
    n_rahmonics : int or None
        None takes all up to half the signal's length.
    half_width_s : float or None
        Half width around each rahmonic. None is k samples at the k-th, as the uncertainty of the speed grows with k.

    Returns
    -------
    array, (n_samples,)
        In the signal's unit.

    Raises
    ------
    RefusalError, InputError
        As `cepstrum`; also if the spacing does not fit the signal.

    References
    ----------
    R. B. Randall and N. Sawalhi, "A new method for separating discrete components from a signal", 2011.
    """
    x = checked_signal(values, minimum=4)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    period = fs / positive(spacing_hz, "spacing_hz", "Hz")
    if not 2.0 <= period <= len(x) / 2:
        raise InputError(
            f"spacing_hz is {spacing_hz:g}", allowed=f"{2 * fs / len(x):g} to {fs / 2:g} Hz for this signal"
        )
    lines = _transform(x)
    c = real_cepstrum(lines, len(x))
    mask = _rahmonic_mask(len(x), period, n_rahmonics, None if half_width_s is None else half_width_s * fs)
    if keep:
        mask = ~mask
        mask[0] = False
    c[mask] = 0.0
    return _with_magnitude(lines, c, len(x))


def real_cepstrum(lines: ComplexArray, n: int) -> FloatArray:
    """Return the real cepstrum F⁻¹{ln|X|} of a one-sided transform, (n,)."""
    from scipy.fft import irfft

    magnitude = np.abs(lines)
    result: FloatArray = irfft(np.log(np.maximum(magnitude, LOWEST_RELATIVE_MAGNITUDE * magnitude.max())), n)
    return result


def _transform(x: FloatArray) -> ComplexArray:
    from scipy.fft import rfft

    lines: ComplexArray = rfft(x.astype(np.float64))
    if not np.any(lines):
        raise RefusalError("the signal is zero throughout: it has no logarithm", remedy="check the channel")
    return lines


def _rahmonic_mask(
    n: int, period: float, n_rahmonics: int | None, half_width: float | None
) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Mark the rahmonics on both sides of a cepstrum of n samples, symmetric like the cepstrum."""
    n_max = int(n / 2 / period)
    k = np.arange(1, (n_max if n_rahmonics is None else min(n_max, count(n_rahmonics, "n_rahmonics"))) + 1)
    widths = k.astype(np.float64) if half_width is None else np.full(len(k), max(half_width, 0.5))
    widths = np.minimum(widths, period / 4)  # neighbours must not merge
    q = np.arange(n // 2 + 1, dtype=np.float64)
    nearest = np.clip(np.rint(q / period).astype(np.intp), 1, len(k))
    half = np.abs(q - nearest * period) <= widths[nearest - 1]
    mask = np.zeros(n, dtype=np.bool_)
    mask[: n // 2 + 1] = half
    mask[n - n // 2 :] |= half[1:][::-1]
    return mask


def _with_magnitude(lines: ComplexArray, c: FloatArray, n: int) -> FloatArray:
    """Return the signal whose log magnitude has cepstrum c, with the phase of `lines`."""
    from scipy.fft import irfft, rfft

    magnitude = np.abs(lines)
    phase = np.divide(lines, magnitude, out=np.zeros_like(lines), where=magnitude > 0)
    result: FloatArray = irfft(phase * np.exp(rfft(c).real), n)
    return result
