"""Variational mode decomposition: exact, in one real cosine spectrum."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from gearsig.checks import FloatArray
from gearsig.decompose._types import Modes, VmdSettings, check_supported, mode_notes
from gearsig.engines import engine_module
from gearsig.errors import InputError, RefusalError
from gearsig.spectra import Spectrum, amplitude_spectrum
from gearsig.timefreq import UniformSignal


def first_centres(
    settings: VmdSettings, sampling_rate: float, spectrum: FloatArray, rng: np.random.Generator | None
) -> FloatArray:
    """Return the first centre frequencies in cycles per sample, (n_modes,).

    "uniform": k/2K; "random": one draw per mode, uniform over the logarithm from 1/n to 1/2, ascending; "peaks": see
    `peak_centres`. `spectrum` is the signal's cosine transform, (n_samples,).

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
        if rng is None:
            remedy = "give numpy's default_rng(seed)"
            raise InputError('start is "random" without a generator', where="rng", remedy=remedy)
        n = len(spectrum) - len(spectrum) % 2  # as the reference program, which drops the last sample of an odd length
        low = np.log(1.0 / n)
        centres = np.sort(np.exp(low + (np.log(0.5) - low) * rng.random(K)))
    elif settings.start == "peaks":
        centres = peak_centres(np.square(spectrum), settings.penalty, K)
    elif settings.start != "zero":
        centres = np.array(settings.start, dtype=np.float64) / sampling_rate
        if not ((centres >= 0.0) & (centres <= 0.5)).all():  # written so that NaN fails too
            raise InputError(
                f"start is {settings.start}", allowed=f"0 to {sampling_rate / 2:g}, half the sampling rate"
            )
    if settings.zero_mode:
        centres[0] = 0.0
    return centres


def peak_centres(power: FloatArray, penalty: float, n_modes: int) -> FloatArray:
    """Return where modes of this penalty would each take most energy, one after the other, (n_modes,), ascending.

    Each takes the place ω of largest Σ P(q) g²(q - ω), g = 1/(1 + penalty (q - ω)²), goes to the centroid of that
    product, and leaves P (1 - g)² to the next.

    Parameters
    ----------
    power : array, (n_lines,)
        Power at q/2n cycles per sample.
    penalty : float
    n_modes : int
    """
    # Cells of a quarter of the half-gain distance, but no more of them than lines or than a matrix can have.
    n_cells = int(min(len(power), max(16, np.ceil(2.0 * np.sqrt(penalty))), 2000))
    edges = np.arange(n_cells) * len(power) // n_cells
    frequency = np.arange(len(power)) * (0.5 / len(power))
    energy = np.add.reduceat(power, edges)
    place = np.add.reduceat(power * frequency, edges) / np.where(energy > 0.0, energy, 1.0)
    middle = (np.arange(n_cells) + 0.5) * (0.5 / n_cells)
    remaining = energy.copy()
    centres = np.zeros(n_modes)
    for k in range(n_modes):
        best = middle[int(np.argmax(_gain(middle[:, None] - middle, penalty) ** 2 @ remaining))]
        for _ in range(3):  # the centroid moves the filter, which moves the centroid: a few steps settle it
            taken = remaining * _gain(place - best, penalty) ** 2
            best = float(taken @ place / taken.sum()) if taken.sum() > 0.0 else best
        centres[k] = best
        remaining *= (1.0 - _gain(place - best, penalty)) ** 2
    return np.sort(centres)


def _gain(distance: FloatArray, penalty: float) -> FloatArray:
    return np.asarray(1.0 / (1.0 + penalty * distance * distance))


RELATIVE_TOLERANCE = 1e-9
"""Of the signal's energy; where `VmdSettings.tolerance` is None."""
_MUCH_MEMORY = 2**23


def modes_of_whole(signal: UniformSignal, settings: VmdSettings, rng: np.random.Generator | None) -> Modes:
    """Return the modes of a signal, all of it at once; see `vmd`."""
    x, fs, axis = signal.values, signal.rate, signal.axis
    check_supported(x, settings.n_modes)
    solution = _solve(x.astype(np.float64), fs, settings, rng)
    centres, bandwidths = fs * solution.history[-1], fs * _bandwidths(solution)
    waveforms = solution.waveforms()
    return Modes(
        waveforms=waveforms,
        residual=np.asarray(x - waveforms.sum(axis=0)),
        centres=centres,
        bandwidths=bandwidths,
        axis=axis,
        sampling_rate=fs,
        n_iterations=len(solution.history),
        converged=solution.converged,
        last_change=solution.relative_change,
        centre_history=fs * solution.history,
        settings=settings,
        unit=signal.unit,
        source=f"{signal.source} over angle" if axis == "order" else signal.source,
        shaft=signal.shaft,
        notes=mode_notes(centres, fs, settings, converged=solution.converged, axis=axis),
    )


@dataclass(frozen=True)
class _Solution:
    """Real spectra (n_modes, n_lines) and centres before each iteration, in cycles per sample."""

    lines: FloatArray
    history: FloatArray
    relative_change: float
    converged: bool

    def waveforms(self) -> FloatArray:
        """Transform each mode back; even lengths get the reference programs' line at half the sampling rate."""
        from scipy.fft import idct

        n = self.lines.shape[1]
        # The line's phase there is (-1)^m cos(π/2n) after the mirrored part is cut off; odd lengths have none.
        alternating = self.lines[:, -1:] * (np.cos(0.5 * np.pi / n) / (2 * n) if n % 2 == 0 else 0.0)
        # In place is quicker, but the result then holds on to the solver's memory, which only matters for long signals.
        u: FloatArray = idct(self.lines, type=2, axis=1, overwrite_x=self.lines.nbytes < _MUCH_MEMORY, workers=1)
        u[:, ::2] -= alternating
        u[:, 1::2] += alternating
        return u


@dataclass(frozen=True)
class _VmdpySolution(_Solution):
    """The same from vmdpy, which returns waveforms; `lines` is their cosine transform."""

    u: FloatArray

    def waveforms(self) -> FloatArray:
        """Return the modes as vmdpy computed them."""
        return self.u


def _solve(x: FloatArray, fs: float, settings: VmdSettings, rng: np.random.Generator | None) -> _Solution:
    # A power of two leaves every digit as it is, and keeps squares of very small or large values in range.
    scale = 2.0 ** np.floor(np.log2(np.abs(x).max()))
    energy = float(np.square(x / scale).sum())  # no scalar product: threads of BLAS cost more than they save here
    threshold = RELATIVE_TOLERANCE * energy
    if settings.tolerance is not None:  # the reference program starts its sum of changes at one unit in the last place
        threshold = float((settings.tolerance - np.spacing(1.0)) / scale / scale)
    if settings.engine == "vmdpy":
        solution = _solve_with_vmdpy(x / scale, scale, settings, threshold)
    else:
        solution = _solve_here(x / scale, scale, fs, settings, rng, threshold, energy)
    if len(solution.history) < 2:
        raise InputError(
            f"tolerance is {settings.tolerance:g}, more than the modes' energy changes in the first iteration",
            allowed=f"well below the signal's energy, which is {energy * scale * scale:.3g}",
            remedy="leave tolerance out: it is then taken relative to the signal's energy",
        )
    if not np.isfinite(solution.history).all():
        raise RefusalError("a mode stayed empty: it has no centre frequency", remedy="ask for fewer modes")
    return solution


def _solve_here(
    x: FloatArray,
    scale: float,
    fs: float,
    settings: VmdSettings,
    rng: np.random.Generator | None,
    threshold: float,
    energy: float,
) -> _Solution:
    from scipy.fft import dct

    spectrum = dct(x, type=2, workers=1)
    start = first_centres(settings, fs, spectrum, rng)
    history = np.empty((settings.max_iterations + 1, settings.n_modes))
    grid, space = _grid(len(x)), working_space(settings.n_modes, len(x))
    # Floats: whole numbers would have the kernel compiled once more.
    constants = (float(settings.penalty), float(settings.dual_step), settings.zero_mode)
    lines, n_done, change = iterate(spectrum, grid, space, start, *constants, threshold, len(history) - 1, history)
    lines *= scale
    if not np.isfinite(history[n_done]).all():  # the centres after the last iteration, which no row returned shows
        history[0] = np.nan
    return _Solution(lines, history[:n_done], change / energy, bool(change <= threshold))


def _solve_with_vmdpy(x: FloatArray, scale: float, settings: VmdSettings, threshold: float) -> _Solution:
    """Let vmdpy 0.2 do it; it drops the last sample of an odd length, so the signal is mirrored by one sample first."""
    from scipy.fft import dct

    even = np.append(x, x[-1]) if len(x) % 2 else x
    tolerance = threshold + np.spacing(1.0)  # its sum of changes starts there
    init = {"zero": 0, "uniform": 1}[str(settings.start)]
    with engine_module("vmdpy") as vmdpy, np.errstate(all="ignore"):
        u, _, history = vmdpy.VMD(
            even, settings.penalty, settings.dual_step, settings.n_modes, settings.zero_mode, init, tolerance
        )
        u = np.asarray(u)[:, : len(x)] * scale
    return _VmdpySolution(dct(u, type=2, axis=1), history, float("nan"), len(history) < settings.max_iterations, u)


def _grid(n: int) -> FloatArray:
    """Return the lines' frequencies q/2n in cycles per sample, (n,).

    Rounded as in the reference programs: where the multiplier amplifies rounding, the last digit shows in the modes.
    """
    return np.arange(n + 1, 2 * n + 1) / (2 * n) - 0.5 - 0.5 / n


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


# Iterations of variational mode decomposition in one real cosine spectrum.
#
# The signal f is mirrored at both ends, period 2n. The mirrored signal's spectrum at line q is a cosine transform C[q]
# times a phase that depends on q alone; since every update multiplies by real gains and subtracts, all modes and the
# multiplier keep that phase. Only their real factors on the n non-negative lines are computed.
#
# Memory traffic decides the speed. Lines lie in blocks, all modes of a block together, and are updated in place.


# Reordering sums lets the compiler use vector instructions; divisions stay exact.
_REORDER = {"contract", "reassoc", "nsz"}
_BLOCK = 512
"""Lines per block: a block of a few modes stays in the processor's nearest cache."""
_NEARLY = 4.0
"""From this multiple of the tolerance on, the modes before an iteration are kept: it may be the last one."""


def working_space(n_modes: int, n_lines: int) -> FloatArray:
    """Return memory for `iterate`; numpy asks the system for large pages, which fresh memory is quicker in."""
    return np.empty((2, -(-n_lines // _BLOCK), n_modes, _BLOCK))


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def iterate(C, grid, space, omega, alpha, tau, fixed_zero, tolerance, max_iterations, history):  # type: ignore[no-untyped-def]
    """Iterate until the modes' energy changes by no more than `tolerance`.

    Returns the modes' real spectra before the last iteration (see `vmd`), the number of iterations and
    the last change of energy. Row m of `history` (max_iterations + 1, K) receives the centres after m iterations.
    The spectra lie in `space`, which comes from `working_space`.
    """
    n_limit = max_iterations
    modes, before = space[0], space[1]
    nearly = _NEARLY * tolerance
    while True:
        modes[:] = 0.0
        dual = np.zeros(len(C) if tau != 0.0 else 0)
        for k in range(len(omega)):
            history[0, k] = omega[k]
        n_done, change, kept = 0, np.inf, False
        while n_done < n_limit and (change > tolerance or n_done == 0):
            kept = change <= nearly or n_done + 1 == n_limit
            now, after = history[n_done], history[n_done + 1]
            change = _update(C, grid, modes, before, kept, dual, alpha, tau, fixed_zero, now, after)
            n_done += 1
        if kept:
            return _rows(before, len(C), modes), n_done, change
        n_limit = n_done  # it stopped all of a sudden: once more, with the last iteration known


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _update(C, grid, modes, before, keep, dual, alpha, tau, fixed_zero, omega, omega_next):  # type: ignore[no-untyped-def]
    """One iteration: û_k = (Ĉ - Σ_{i<k} û_i - Σ_{i>k} û_i(old) - λ/2) / (1 + α (ω - ω_k)²), ω_k = centroid of û_k².

    Returns Σ_k ‖û_k - û_k(old)‖² / 2n, which is the change of energy of the mirrored signal's positive lines.
    """
    n, K = len(C), modes.shape[1]
    energy, moment = np.zeros(K), np.zeros(K)
    rest = np.empty(_BLOCK)
    change = 0.0
    for b in range(modes.shape[0]):
        start = b * _BLOCK
        m = min(_BLOCK, n - start)
        frequency = grid[start : start + m]
        if keep:  # element by element: assigning arrays takes seconds to compile, for the text of its error
            for k in range(K):
                for i in range(m):
                    before[b, k, i] = modes[b, k, i]
        _remainder(C[start : start + m], modes[b], dual[start : start + m], rest)
        for k in range(K):
            mode, centre = modes[b, k], omega[k]
            block_change, block_energy, block_moment = 0.0, 0.0, 0.0
            for i in range(m):
                distance = frequency[i] - centre
                u = rest[i] / (1.0 + alpha * distance * distance)
                difference = u - mode[i]
                block_change += difference * difference
                block_energy += u * u
                block_moment += frequency[i] * (u * u)
                mode[i] = u
                rest[i] -= u
            if k + 1 < K:
                following = modes[b, k + 1]
                for i in range(m):
                    rest[i] += following[i]
            change += block_change
            energy[k] += block_energy
            moment[k] += block_moment
        for i in range(min(m, len(dual))):  # the rest is now C - λ/2 - Σ û
            dual[start + i] -= tau * (rest[i] + 0.5 * dual[start + i])
    for k in range(K):
        omega_next[k] = 0.0 if fixed_zero and k == 0 else moment[k] / energy[k]
    return change * (0.5 / n)


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _remainder(C, modes, dual, rest):  # type: ignore[no-untyped-def]
    """Ĉ - λ/2 - Σ_{i>0} û_i(old) of one block: what the first mode may take."""
    m = len(C)
    for i in range(m):
        rest[i] = C[i]
    for i in range(len(dual)):
        rest[i] -= 0.5 * dual[i]
    for k in range(1, modes.shape[0]):
        part = modes[k]
        for i in range(m):
            rest[i] -= part[i]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _rows(blocks, n, space):  # type: ignore[no-untyped-def]
    """Lay the lines of each mode in one row, (K, n), in the memory of `space`: fresh memory costs time."""
    rows = space.reshape(-1)[: blocks.shape[1] * n].reshape(blocks.shape[1], n)
    for b in range(blocks.shape[0]):
        start = b * _BLOCK
        m = min(_BLOCK, n - start)
        for k in range(blocks.shape[1]):
            for i in range(m):
                rows[k, start + i] = blocks[b, k, i]
    return rows


def mode_spectra(modes: Modes) -> tuple[Spectrum, ...]:
    """Return the amplitude spectrum (peak, Hann window) of each mode in its order, and of the residual last.

    Over frequency or order, as the modes are.
    """
    names = [*(f"mode {k + 1}" for k in range(modes.n_modes)), "residual"]
    spectra = (
        amplitude_spectrum(x, modes.sampling_rate, unit=modes.unit, source=f"{name} of {modes.source or 'signal'}")
        for name, x in zip(names, [*modes.waveforms, modes.residual], strict=True)
    )
    return tuple(replace(spectrum, axis=modes.axis, shaft=modes.shaft) for spectrum in spectra)
