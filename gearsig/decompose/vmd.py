"""Variational mode decomposition: exact, in one real cosine spectrum."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.decompose.mode_checks import check_supported, mode_notes
from gearsig.decompose.start import first_centres
from gearsig.decompose.types import ModeAxis, Modes, VmdSettings
from gearsig.errors import InputError, RefusalError
from gearsig.spectra.blocks import checked_signal

RELATIVE_TOLERANCE = 1e-9
"""Of the signal's energy; where `VmdSettings.tolerance` is None."""
_MUCH_MEMORY = 2**23


def variational_modes(
    values: FloatArray,
    sampling_rate: float,
    settings: VmdSettings,
    *,
    rng: np.random.Generator | None = None,
    axis: ModeAxis = "frequency",
    unit: str = "",
    source: str = "",
    shaft: str = "",
) -> Modes:
    """Return the modes that are each most compact around a centre frequency and together fit the signal.

    min Σ_k α ‖∂_t [(δ + j/πt) * u_k] e^(-jω_k t)‖² + ‖f - Σ_k u_k‖², solved by alternating Wiener filters
    û_k = (f̂ - Σ_{i≠k} û_i - λ̂/2) / (1 + α (ω - ω_k)²) and centroids ω_k of |û_k|².

    Parameters
    ----------
    values : array, (n_samples,)
        Finite, not constant; at least 8 samples, and 4 per mode.
    sampling_rate : float
        Samples per second, or per revolution where `axis` is "order".
    settings : VmdSettings
    rng : Generator or None
        Needed for `start="random"` only.
    axis, unit, source, shaft : str

    Returns
    -------
    Modes
        In the signal's unit; computed in double precision whatever the input's.

    Raises
    ------
    InputError
        On NaN, a constant, too few samples for the number of modes, start frequencies outside the spectrum.
    RefusalError
        If a mode stays empty: the signal does not hold that many.

    Notes
    -----
    The signal is mirrored at both ends, by half its length in the reference programs; that length does not matter, as
    mirroring makes the signal periodic. For even lengths the result is that of vmdpy 0.2 within rounding, with two of
    its habits: it returns the modes before the last iteration, and it fills the line at half the sampling rate, where a
    mirrored signal has nothing, with its neighbour's value (an alternating ±|û|/2n, mostly invisible). vmdpy drops
    the last sample of an odd length; here all samples are kept, and the line at half the sampling rate is empty.

    Memory is about 4 × 8 bytes per sample and mode. For signals beyond that see `modes_by_block`.

    When not to use it: for broad-band impulses, whose spectrum is no narrow band (take their envelope, or a band);
    for speeds that vary by more than a mode's width (resample over angle first).

    References
    ----------
    K. Dragomiretskiy and D. Zosso, "Variational mode decomposition", 2014.

    Examples
    --------
    >>> t = np.arange(2000) / 1000.0
    >>> x = np.cos(2 * np.pi * 50 * t) + 0.5 * np.cos(2 * np.pi * 200 * t)
    >>> variational_modes(x, 1000.0, VmdSettings(2)).centre_frequencies_hz.round(1)
    array([ 50., 200.])
    """
    x = checked_signal(values, minimum=8)
    fs = positive(sampling_rate, "sampling_rate", "Hz" if axis == "frequency" else "per revolution")
    check_supported(x, settings.n_modes)
    solution = _solve(x.astype(np.float64), fs, settings, rng)
    centres, bandwidths = fs * solution.history[-1], fs * _bandwidths(solution)
    waveforms = _waveforms(solution.lines)
    residual = np.asarray(x - waveforms.sum(axis=0))
    return Modes(
        waveforms=waveforms,
        residual=residual,
        centres=centres,
        bandwidths=bandwidths,
        axis=axis,
        sampling_rate=fs,
        n_iterations=len(solution.history),
        converged=solution.converged,
        last_change=solution.relative_change,
        centre_history=fs * solution.history,
        settings=settings,
        unit=unit,
        source=source,
        shaft=shaft,
        notes=mode_notes(centres, fs, settings, converged=solution.converged, axis=axis),
    )


@dataclass(frozen=True)
class _Solution:
    """Real spectra (n_modes, n_lines) and centres before each iteration, in cycles per sample."""

    lines: FloatArray
    history: FloatArray
    relative_change: float
    converged: bool


def _solve(x: FloatArray, fs: float, settings: VmdSettings, rng: np.random.Generator | None) -> _Solution:
    from scipy.fft import dct

    from gearsig.decompose.vmd_kernel import iterate, working_space

    # A power of two leaves every digit as it is, and keeps squares of very small or large values in range.
    scale = 2.0 ** np.floor(np.log2(np.abs(x).max()))
    spectrum = dct(x / scale, type=2, workers=1)
    energy = float(np.square(x / scale).sum())  # no scalar product: threads of BLAS cost more than they save here
    start = first_centres(settings, fs, spectrum, rng)
    threshold = _threshold(settings.tolerance, energy, scale)
    history = np.empty((settings.max_iterations + 1, settings.n_modes))
    grid, space = _grid(len(x)), working_space(settings.n_modes, len(x))
    told = (settings.penalty, settings.dual_step, settings.zero_mode)
    lines, n_done, change = iterate(spectrum, grid, space, start, *told, threshold, len(history) - 1, history)
    if n_done < 2:
        raise InputError(
            f"tolerance is {settings.tolerance:g}, more than the modes' energy changes in the first iteration",
            allowed=f"well below the signal's energy, which is {energy * scale * scale:.3g}",
            remedy="leave tolerance out: it is then taken relative to the signal's energy",
        )
    if not np.isfinite(history[: n_done + 1]).all():
        raise RefusalError("a mode stayed empty: it has no centre frequency", remedy="ask for fewer modes")
    lines *= scale
    return _Solution(lines, history[:n_done], change / energy, bool(change <= threshold))


def _grid(n: int) -> FloatArray:
    """Return the lines' frequencies q/2n in cycles per sample, (n,).

    Rounded as in the reference programs: where the multiplier amplifies rounding, the last digit shows in the modes.
    """
    return np.arange(n + 1, 2 * n + 1) / (2 * n) - 0.5 - 0.5 / n


def _threshold(tolerance: float | None, energy: float, scale: float) -> float:
    """Return the change to stop at; the reference program starts its sum of changes at one unit in the last place."""
    if tolerance is None:
        return RELATIVE_TOLERANCE * energy
    return float((tolerance - np.spacing(1.0)) / scale / scale)


def _waveforms(lines: FloatArray) -> FloatArray:
    """Transform each mode back; even lengths get the reference programs' line at half the sampling rate."""
    from scipy.fft import idct

    n = lines.shape[1]
    # The line's phase there is (-1)^m cos(π/2n) after the mirrored part is cut off; odd lengths have none.
    alternating = lines[:, -1:] * (np.cos(0.5 * np.pi / n) / (2 * n) if n % 2 == 0 else 0.0)
    # In place is quicker, but the result then holds on to the solver's memory, which only matters for long signals.
    u: FloatArray = idct(lines, type=2, axis=1, overwrite_x=lines.nbytes < _MUCH_MEMORY, workers=1)
    u[:, ::2] -= alternating
    u[:, 1::2] += alternating
    return u


def _bandwidths(solution: _Solution) -> FloatArray:
    """Return √(Σ (ω - ω_k)² û_k² / Σ û_k²) in cycles per sample, (n_modes,)."""
    frequency = _grid(solution.lines.shape[1])
    widths = np.empty(len(solution.lines))
    for k, (line, centre) in enumerate(zip(solution.lines, solution.history[-1], strict=True)):
        power = np.square(line)
        total = power.sum()
        power *= np.square(frequency - centre)
        widths[k] = np.sqrt(power.sum() / total)
    return widths
