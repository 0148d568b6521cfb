"""Variational mode decomposition, exact in one real cosine spectrum; block by block for signals of any length."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, freeze, not_negative, one_of, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError, engine_module
from gearsig.formatting import axis_unit, percent
from gearsig.results import Result
from gearsig.spectra import Spectrum, amplitude_spectrum
from gearsig.timefreq import Source, UniformSignal, uniform

StartName = Literal["uniform", "zero", "random", "peaks"]
STARTS = get_args(StartName)
ModeAxis = Literal["frequency", "order"]
VmdEngine = Literal["gearsig", "vmdpy"]

REFERENCE_ITERATIONS = 499
"""The limit built into the reference programs, whose count of 500 includes the start."""


@dataclass(frozen=True)
class VmdSettings:
    """Settings of variational mode decomposition; names of the reference programs in brackets.

    Parameters
    ----------
    n_modes : int
        Number of modes [K].
    penalty : float
        Weight of the modes' bandwidth relative to the fit of their sum [alpha], above zero. A mode's gain at a distance
        d from its centre is 1 / (1 + penalty (d / sampling rate)²): one half at sampling rate / √penalty, which for
        2000 is 0.022 of the sampling rate. 2000 is the value in the source.
    dual_step : float
        Step of the Lagrange multiplier that makes the modes sum to the signal [tau]; 0 leaves noise in the residual.
    zero_mode : bool
        Whether to keep the first mode's centre at zero, so that it takes the mean and slow drift [DC].
    start : str or tuple of float
        Initial centre frequencies [init]: "uniform" over the spectrum [1], "zero" [0], "random" on a logarithmic scale
        [2], at the "peaks" of the spectrum (not in the references), or one per mode, in the result's axis (Hz or
        orders). The modes found depend on it: from a uniform start, two modes may converge to one component and miss
        another.
    tolerance : float or None
        Iterations end when the change of the modes (sum over samples of the squared change) is below this [tol]. It
        has the signal's unit squared and grows with its length. None: `RELATIVE_TOLERANCE` of the signal's energy,
        which gives the same modes in any unit.
    max_iterations : int
        At least 2.
    engine : str
        "gearsig", or "vmdpy": the reference program in Python, much slower and with up to 16 kB of memory per sample
        and mode; it starts "uniform" or "zero" and always allows 499 iterations.

    Raises
    ------
    InputError
        On a value out of range, or one that the engine does not support.
    """

    n_modes: int
    penalty: float = 2000.0
    dual_step: float = 0.0
    zero_mode: bool = False
    start: StartName | tuple[float, ...] = "uniform"
    tolerance: float | None = None
    max_iterations: int = REFERENCE_ITERATIONS
    engine: VmdEngine = "gearsig"

    def __post_init__(self) -> None:
        count(self.n_modes, "n_modes")
        positive(self.penalty, "penalty")
        not_negative(self.dual_step, "dual_step")
        count(self.max_iterations, "max_iterations", minimum=2)
        if self.tolerance is not None:
            not_negative(self.tolerance, "tolerance")
        one_of(self.engine, "engine", get_args(VmdEngine))
        if self.engine == "vmdpy":
            self._check_vmdpy()
        if isinstance(self.start, str):
            one_of(self.start, "start", STARTS)
            return
        object.__setattr__(self, "start", tuple(float(f) for f in self.start))
        if len(self.start) != self.n_modes:
            raise InputError(f"start has {len(self.start)} frequencies", allowed=f"{self.n_modes}, one per mode")

    def _check_vmdpy(self) -> None:
        """Raise on settings that vmdpy does not support; its random start would draw from numpy's global state."""
        remedy = 'choose engine="gearsig"'
        if self.start not in ("uniform", "zero"):
            raise InputError(f"start is {self.start!r} with the engine vmdpy", allowed="uniform, zero", remedy=remedy)
        if self.max_iterations != REFERENCE_ITERATIONS:
            raise InputError(
                f"max_iterations is {self.max_iterations} with the engine vmdpy",
                allowed=f"{REFERENCE_ITERATIONS}, which is built into it",
                remedy=remedy,
            )


@dataclass(frozen=True)
class Modes(Result, columns=("centres", "bandwidths", "rms")):
    """A signal as a sum of modes and a residual.

    Parameters
    ----------
    waveforms : array, (n_modes, n_samples)
        In `unit`, in the order of the initial centre frequencies; `by_centre` sorts them.
    residual : array, (n_samples,)
        Signal minus `offset` minus the sum of the modes.
    centres : array, (n_modes,)
        Centroid of each mode's power spectrum, in Hz or orders (see `axis`).
    bandwidths : array, (n_modes,)
        Root mean square distance of each mode's power spectrum from its centre, in the same axis.
    axis : str
        "frequency" or "order".
    sampling_rate : float
        Samples per second, or per revolution of `shaft`.
    n_iterations : int
    converged : bool
        Whether the tolerance was reached within the iterations allowed.
    last_change : float
        Squared change of the modes in the last iteration over the signal's energy; nan if the engine does not report
        it.
    centre_history : array, (n_iterations, n_modes)
        Centres before each iteration; the last row holds `centres`.
    settings : VmdSettings
    unit, source, shaft : str
    offset : float
        A constant removed from the signal before the decomposition; 0 unless `source` says so.
    notes : tuple of str
        Warnings for the reader: no convergence, overlapping modes.
    """

    waveforms: FloatArray
    residual: FloatArray
    centres: FloatArray
    bandwidths: FloatArray
    axis: ModeAxis
    sampling_rate: float
    n_iterations: int
    converged: bool
    last_change: float
    centre_history: FloatArray
    settings: VmdSettings
    unit: str
    source: str
    shaft: str = ""
    offset: float = 0.0
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "waveforms", "centre_history", ndim=2)
        freeze(self, "residual", "centres", "bandwidths")
        expected = (len(self.centres), len(self.residual))
        if self.waveforms.shape != expected or len(self.bandwidths) != len(self.centres):
            raise InputError(f"waveforms of shape {self.waveforms.shape} for (modes, samples) of {expected}")

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.centres)

    @property
    def positions(self) -> FloatArray:
        """Time in s or angle in revolutions of each sample from the first, (n_samples,)."""
        return np.arange(len(self.residual)) / self.sampling_rate

    @property
    def rms(self) -> FloatArray:
        """Root mean square of each mode, (n_modes,)."""
        return np.array([_root_mean_square(waveform) for waveform in self.waveforms])

    @property
    def reconstruction_error(self) -> float:
        """Root mean square of the residual over that of the signal (without `offset`)."""
        signal = self.waveforms.sum(axis=0) + self.residual
        return _root_mean_square(self.residual) / _root_mean_square(signal)

    def by_centre(self) -> tuple[int, ...]:
        """Return the modes' indices in ascending order of their centres."""
        return tuple(int(i) for i in np.argsort(self.centres, kind="stable"))

    def signal(self, mode: int, *, start: float = 0.0) -> UniformSignal:
        """Return one mode as a signal for any transform, e.g. `squeezed_cwt_map(modes.signal(2))`.

        Parameters
        ----------
        mode : int
            From 0, in the order of `waveforms`.
        start : float
            Time or angle of the first sample.
        """
        place = int(within(mode, "mode", 0, self.n_modes - 1))
        return UniformSignal(
            self.waveforms[place],
            self.sampling_rate,
            axis=self.axis,
            start=start,
            unit=self.unit,
            source=f"mode at {self.centres[place]:.5g} of {self.source or 'the signal'}",
            shaft=self.shaft,
        )


def _root_mean_square(x: FloatArray) -> float:
    """Return the rms, scaled by the largest value so that squares of very small or large values stay in range."""
    largest = float(np.abs(x).max(initial=0.0))
    return largest * float(np.sqrt(np.mean(np.square(x / largest)))) if largest > 0.0 else 0.0


SAMPLES_PER_MODE = 4
"""Minimum samples per mode: n samples have n lines, and with fewer than four lines a mode has no real bandwidth."""


def check_supported(x: FloatArray, n_modes: int) -> None:
    """Raise InputError if `x` is constant or too short for `n_modes`."""
    if len(x) < SAMPLES_PER_MODE * n_modes:
        raise InputError(
            f"n_modes is {n_modes} for {len(x)} samples",
            allowed=f"1 to {len(x) // SAMPLES_PER_MODE}",
            remedy="ask for fewer modes or take a longer signal",
        )
    if float(x.min()) == float(x.max()):
        raise InputError(
            f"the signal is constant ({float(x[0]):g})",
            where="values",
            allowed="a signal that varies",
            remedy="check the channel: it may be dead or not connected",
        )


def half_gain_distance(penalty: float, sampling_rate: float) -> float:
    """Return the distance from its centre at which a mode's gain is one half: sampling rate / √penalty."""
    return float(sampling_rate / np.sqrt(penalty))


def mode_notes(
    centres: FloatArray, sampling_rate: float, settings: VmdSettings, *, converged: bool, axis: ModeAxis
) -> tuple[str, ...]:
    """Return warnings for the reader: no convergence, modes that share the same lines."""
    notes = []
    if not converged:
        notes.append(
            f"Not converged in {settings.max_iterations} iterations: raise max_iterations, or choose fewer modes or a "
            "larger tolerance."
        )
    reach = half_gain_distance(settings.penalty, sampling_rate)
    order = np.argsort(centres, kind="stable")
    unit = axis_unit(axis)
    for i, j in pairwise(order):
        gap = float(centres[j] - centres[i])
        if gap < reach:
            notes.append(
                f"Modes {i + 1} and {j + 1} share the same lines: their centres are {gap:.3g} {unit} apart, and each "
                f"has half its gain at {reach:.3g} {unit}. Take fewer modes or a larger penalty."
            )
    return tuple(notes)


def first_centres(
    settings: VmdSettings, sampling_rate: float, spectrum: FloatArray, rng: np.random.Generator | None
) -> FloatArray:
    """Return the initial centre frequencies in cycles per sample, (n_modes,).

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
        n = len(spectrum) - len(spectrum) % 2  # like the reference program, which drops an odd last sample
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
    """Return the centres at which modes of this penalty, one after another, take most energy, (n_modes,), ascending.

    Each mode starts at the ω of largest Σ P(q) g²(q - ω), g = 1/(1 + penalty (q - ω)²), moves to the centroid of that
    product, and leaves P (1 - g)² to the next.

    Parameters
    ----------
    power : array, (n_lines,)
        Power at line q, i.e. q/2n cycles per sample.
    penalty : float
    n_modes : int
    """
    # Cells of a quarter of the half-gain distance, but at most as many as there are lines or a matrix can hold.
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
        for _ in range(3):  # the centroid moves the filter, which moves the centroid: a few steps converge
            taken = remaining * _gain(place - best, penalty) ** 2
            best = float(taken @ place / taken.sum()) if taken.sum() > 0.0 else best
        centres[k] = best
        remaining *= (1.0 - _gain(place - best, penalty)) ** 2
    return np.sort(centres)


def _gain(distance: FloatArray, penalty: float) -> FloatArray:
    return np.asarray(1.0 / (1.0 + penalty * distance * distance))


RELATIVE_TOLERANCE = 1e-9
"""Tolerance relative to the signal's energy, used if `VmdSettings.tolerance` is None."""
_MUCH_MEMORY = 2**23


def modes_of_whole(signal: UniformSignal, settings: VmdSettings, rng: np.random.Generator | None) -> Modes:
    """Return the modes of a signal, decomposed as a whole; see `vmd`."""
    x, fs = signal.values, float(signal.rate)
    check_supported(x, settings.n_modes)
    solution = _solve(x.astype(np.float64), fs, settings, rng)
    centres, bandwidths = fs * solution.history[-1], fs * _bandwidths(solution)
    return _modes(
        signal,
        settings,
        solution.waveforms(),
        centres=centres,
        bandwidths=bandwidths,
        n_iterations=len(solution.history),
        converged=solution.converged,
        last_change=solution.relative_change,
        centre_history=fs * solution.history,
        notes=mode_notes(centres, fs, settings, converged=solution.converged, axis=signal.axis),
    )


def _modes(x: UniformSignal, settings: VmdSettings, waveforms: FloatArray, **fitted: Any) -> Modes:
    return Modes(
        waveforms=waveforms,
        residual=np.asarray(x.values - waveforms.sum(axis=0)),
        axis=x.axis,
        sampling_rate=float(x.rate),
        settings=settings,
        unit=x.unit,
        source=f"{x.source} over angle" if x.axis == "order" else x.source,
        shaft=x.shaft,
        **fitted,
    )


@dataclass(frozen=True)
class _Solution:
    """Real spectra (n_modes, n_lines) and centres before each iteration, in cycles per sample."""

    lines: FloatArray
    history: FloatArray
    relative_change: float
    converged: bool

    def waveforms(self) -> FloatArray:
        """Transform each mode back to time; even lengths include the reference programs' line at Nyquist."""
        from scipy.fft import idct

        n = self.lines.shape[1]
        # That line's phase is (-1)^m cos(π/2n) after the mirrored part is cut off; odd lengths have no such line.
        alternating = self.lines[:, -1:] * (np.cos(0.5 * np.pi / n) / (2 * n) if n % 2 == 0 else 0.0)
        # In place is faster, but the result then keeps the solver's memory alive, which matters only for long signals.
        u: FloatArray = idct(self.lines, type=2, axis=1, overwrite_x=self.lines.nbytes < _MUCH_MEMORY, workers=1)
        u[:, ::2] -= alternating
        u[:, 1::2] += alternating
        return u


@dataclass(frozen=True)
class _VmdpySolution(_Solution):
    """Solution from vmdpy, which returns waveforms; `lines` is their cosine transform."""

    u: FloatArray

    def waveforms(self) -> FloatArray:
        """Return the modes as vmdpy computed them."""
        return self.u


def _solve(x: FloatArray, fs: float, settings: VmdSettings, rng: np.random.Generator | None) -> _Solution:
    # Scaling by a power of two changes no digit, and keeps squares of very small or large values in range.
    scale = 2.0 ** np.floor(np.log2(np.abs(x).max()))
    energy = float(np.square(x / scale).sum())  # not a dot product: BLAS threads cost more than they save here
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
    # Floats: integers would make numba compile the kernel again.
    constants = (float(settings.penalty), float(settings.dual_step), settings.zero_mode)
    lines, n_done, change = iterate(spectrum, grid, space, start, *constants, threshold, len(history) - 1, history)
    lines *= scale
    if not np.isfinite(history[n_done]).all():  # centres after the last iteration, not in the rows returned
        history[0] = np.nan
    return _Solution(lines, history[:n_done], change / energy, bool(change <= threshold))


def _solve_with_vmdpy(x: FloatArray, scale: float, settings: VmdSettings, threshold: float) -> _Solution:
    """Solve with vmdpy 0.2, which drops the last sample of an odd length, so the last sample is repeated first."""
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

    Rounded as in the reference programs: where the multiplier amplifies rounding, the last digit affects the modes.
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
# The signal f is mirrored at both ends, with period 2n. The mirrored signal's spectrum at line q is a cosine transform
# C[q] times a phase that depends on q alone; since every update only multiplies by real gains and subtracts, all modes
# and the multiplier keep that phase. Only their real factors on the n non-negative lines are computed.
#
# Memory traffic limits the speed. Lines are stored in blocks, all modes of a block together, and updated in place.


# Reordering sums lets the compiler use vector instructions; divisions stay exact.
_REORDER = {"contract", "reassoc", "nsz"}
_BLOCK = 512
"""Lines per block: a block of a few modes stays in the L1 cache."""
_NEARLY = 4.0
"""Below this multiple of the tolerance, the modes before each iteration are kept, as it may be the last one."""


def working_space(n_modes: int, n_lines: int) -> FloatArray:
    """Return memory for `iterate`; numpy requests large pages, in which new memory is faster."""
    return np.empty((2, -(-n_lines // _BLOCK), n_modes, _BLOCK))


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def iterate(C, grid, space, omega, alpha, tau, fixed_zero, tolerance, max_iterations, history):  # type: ignore[no-untyped-def]
    """Iterate until the modes' squared change is at most `tolerance`.

    Returns the modes' real spectra before the last iteration (see `vmd`), the number of iterations and the last change.
    Row m of `history` (max_iterations + 1, K) receives the centres after m iterations. The spectra are stored in
    `space`, which comes from `working_space`.
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
        n_limit = n_done  # it stopped unexpectedly: repeat with the last iteration known


@njit(cache=True, nogil=True, fastmath=_REORDER, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def _update(C, grid, modes, before, keep, dual, alpha, tau, fixed_zero, omega, omega_next):  # type: ignore[no-untyped-def]
    """Iterate once: û_k = (Ĉ - Σ_{i<k} û_i - Σ_{i>k} û_i(old) - λ/2) / (1 + α (ω - ω_k)²), ω_k = centroid of û_k².

    Returns Σ_k ‖û_k - û_k(old)‖² / 2n, the squared change over the mirrored signal's positive lines.
    """
    n, K = len(C), modes.shape[1]
    energy, moment = np.zeros(K), np.zeros(K)
    rest = np.empty(_BLOCK)
    change = 0.0
    for b in range(modes.shape[0]):
        start = b * _BLOCK
        m = min(_BLOCK, n - start)
        frequency = grid[start : start + m]
        if keep:  # element by element: array assignment takes seconds to compile, because of its error message
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
    """Compute Ĉ - λ/2 - Σ_{i>0} û_i(old) of one block: what is left for the first mode."""
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
    """Copy the lines of each mode to one row, (K, n), in the memory of `space`, since new memory costs time."""
    rows = space.reshape(-1)[: blocks.shape[1] * n].reshape(blocks.shape[1], n)
    for b in range(blocks.shape[0]):
        start = b * _BLOCK
        m = min(_BLOCK, n - start)
        for k in range(blocks.shape[1]):
            for i in range(m):
                rows[k, start + i] = blocks[b, k, i]
    return rows


def mode_spectra(modes: Modes) -> tuple[Spectrum, ...]:
    """Return the amplitude spectrum (peak, Hann window) of each mode, in order, and of the residual last.

    The spectra are over frequency or order, like the modes.
    """
    names = [*(f"mode {k + 1}" for k in range(modes.n_modes)), "residual"]
    spectra = (
        amplitude_spectrum(x, modes.sampling_rate, unit=modes.unit, source=f"{name} of {modes.source or 'signal'}")
        for name, x in zip(names, [*modes.waveforms, modes.residual], strict=True)
    )
    return tuple(replace(spectrum, axis=modes.axis, shaft=modes.shaft) for spectrum in spectra)


# --------------------
# Signals of any length: as a whole, or block by block with joined seams and notes on them.
# --------------------

IndexArray = NDArray[np.intp]

N_PER_BLOCK = 2**18
_LARGE_MISMATCH = 0.5
"""Mismatch of a mode at a seam above which a note is given."""


def vmd(
    signal: Source,
    channel: str | float | None,
    settings: VmdSettings | int,
    *,
    engine: VmdEngine | None = None,
    n_per_block: int = N_PER_BLOCK,
    rng: np.random.Generator | None = None,
) -> Modes:
    """Return the variational modes of a signal, each compact around a centre frequency and with a sum that fits it.

    min Σ_k α ‖∂_t [(δ + j/πt) * u_k] e^(-jω_k t)‖² + ‖f - Σ_k u_k‖², solved by alternating Wiener filters
    û_k = (f̂ - Σ_{i≠k} û_i - λ̂/2) / (1 + α (ω - ω_k)²) and centroids ω_k of |û_k|².

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        Not constant; at least 4 samples per mode. Over angle, centres and bandwidths are in orders: at variable speed,
        an order remains one narrow mode, whereas over time it would be smeared.
    channel : str, float or None
        None: the only channel. For an array, its sampling rate in Hz.
    settings : VmdSettings or int
        An int is the number of modes, with all other settings at their defaults; `suggest_modes` finds it.
    engine : str or None
        "gearsig" or "vmdpy"; overrides the settings.
    n_per_block : int
        A longer signal is decomposed block by block, see `modes_by_block`.
    rng : numpy.random.Generator or None
        Needed only for `start="random"`.

    Returns
    -------
    Modes
        In the signal's unit; always computed in double precision. For several blocks, with E_i a mode's energy in
        block i, centres are c = Σ E_i c_i / Σ E_i and bandwidths √(Σ E_i (b_i² + (c_i - c)²) / Σ E_i), so that drift of
        a mode counts as width; `n_iterations` is the sum, `last_change` is nan, and `centre_history` has one row per
        block, then the centres. The notes say where a mode does not continue across a seam.

    Raises
    ------
    InputError
        On NaN, a constant, too few samples for the number of modes, or start frequencies outside the spectrum.
    RefusalError
        If a mode stays empty: the signal does not contain that many.

    Notes
    -----
    The signal is mirrored at both ends, by half its length in the reference programs; the length does not matter, as
    mirroring makes the signal periodic. For even lengths the result equals that of vmdpy 0.2 within rounding, with two
    of its peculiarities: it returns the modes before the last iteration, and it fills the line at half the sampling
    rate, which is empty for a mirrored signal, with its neighbour's value (an alternating ±|û|/2n, mostly invisible).
    vmdpy drops the last sample of an odd length; here all samples are kept, and that line stays empty.

    Memory is 8 bytes per sample and mode, plus about four times that for one block.

    When not to use it: for broad-band impulses, whose spectrum is not a narrow band (use their envelope, or a band);
    for speeds that vary by more than a mode's width (resample over angle first).

    References
    ----------
    K. Dragomiretskiy and D. Zosso, "Variational mode decomposition", 2014.

    Examples
    --------
    >>> t = np.arange(2000) / 1000.0
    >>> x = np.cos(2 * np.pi * 50 * t) + 0.5 * np.cos(2 * np.pi * 200 * t)
    >>> vmd(x, 1000.0, 2, engine="vmdpy").centres.round(1)
    array([ 50., 200.])
    """
    x = uniform(signal, channel)
    chosen = settings if isinstance(settings, VmdSettings) else VmdSettings(settings)
    if engine is not None:
        chosen = replace(chosen, engine=engine)
    if x.n_samples <= count(n_per_block, "n_per_block"):
        return modes_of_whole(x, chosen, rng)
    waveforms: FloatArray = np.empty((chosen.n_modes, x.n_samples))
    segments: list[ModeSegment] = []
    energies = []
    for segment in modes_by_block(x, None, chosen, n_per_block=n_per_block, rng=rng):
        waveforms[:, segment.start : segment.start + segment.waveforms.shape[1]] = segment.waveforms
        energies.append(np.square(segment.waveforms).sum(axis=1))
        segments.append(replace(segment, waveforms=segment.waveforms[:, :0].copy()))
    centres, bandwidths = _together(segments, np.array(energies))
    converged = all(segment.converged for segment in segments)
    notes = mode_notes(centres, x.rate, chosen, converged=converged, axis=x.axis)
    return _modes(
        x,
        chosen,
        waveforms,
        centres=centres,
        bandwidths=bandwidths,
        n_iterations=sum(segment.n_iterations for segment in segments),
        converged=converged,
        last_change=float("nan"),
        centre_history=np.array([segment.centres for segment in segments] + [centres]),
        notes=(*notes, *_seam_notes(segments, x)),
    )


@dataclass(frozen=True)
class ModeSegment:
    """A finished segment of all modes.

    Parameters
    ----------
    start : int
        Index of its first sample in the signal.
    waveforms : array, (n_modes, n_samples)
        Mode k continues mode k of the segment before.
    centres, bandwidths : arrays, (n_modes,)
        Of the block it comes from, in Hz or orders.
    n_fade : int
        Length of the seam: samples at its start over which it is cross-faded with the previous block.
    seam_mismatch : array, (n_modes,)
        Rms difference of the two blocks' modes over the common samples, relative to the rms of the modes there; 0 for
        the first segment. If small, the mode continues; if near 1 or above, it is a different mode from here on.
    converged : bool
    n_iterations : int
    """

    start: int
    waveforms: FloatArray
    centres: FloatArray
    bandwidths: FloatArray
    n_fade: int
    seam_mismatch: FloatArray
    converged: bool
    n_iterations: int = 0


def modes_by_block(
    signal: Source,
    channel: str | float | None,
    settings: VmdSettings,
    *,
    n_per_block: int = N_PER_BLOCK,
    overlap: float = 0.125,
    rng: np.random.Generator | None = None,
) -> Iterator[ModeSegment]:
    """Yield the modes of a long signal segment by segment; the block length bounds the memory.

    Equal blocks cover the signal. Each starts from the centres of the previous block, its modes are paired with the
    previous ones by least squares over the common samples, and a raised cosine in the middle of these cross-fades the
    two blocks. Segments join without gaps; the residual is the signal minus their sum.

    Parameters
    ----------
    signal, channel, settings, rng
        As in `vmd`; an array may be a memory map.
    n_per_block : int
        Block length; a shorter signal is one block. Modes may follow slow changes of frequency from block to block.
    overlap : float
        Length of the seam relative to the block, 0.001 to 1/3.

    Raises
    ------
    InputError
        As in `vmd`, for each block: a block over which the signal is constant has no modes.

    Notes
    -----
    The result differs from that of the whole signal, as each block has its own centres.
    """
    x = uniform(signal, channel)
    n_block = min(count(n_per_block, "n_per_block", minimum=64), x.n_samples)
    n_fade = max(1, int(within(overlap, "overlap", 1e-3, 1 / 3) * n_block))
    starts = _starts(x.n_samples, n_block, n_fade)
    return _segments(x, settings, starts, n_block, n_fade, rng)


def _starts(n: int, n_block: int, n_fade: int) -> list[int]:
    """Return the first sample of each block, at equal steps; the last block ends with the signal."""
    n_blocks = 1 + -(-(n - n_block) // (n_block - n_fade))
    return [round(i * (n - n_block) / max(1, n_blocks - 1)) for i in range(n_blocks)]


def _segments(
    x: UniformSignal,
    settings: VmdSettings,
    starts: list[int],
    n_block: int,
    n_fade: int,
    rng: np.random.Generator | None,
) -> Iterator[ModeSegment]:
    rising = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_fade) + 0.5) / n_fade)
    previous: FloatArray = np.zeros((settings.n_modes, 0))
    mismatch: FloatArray = np.zeros(settings.n_modes)
    done = 0
    for start, following in zip(starts, [*starts[1:], None], strict=True):
        modes = modes_of_whole(replace(x, values=x.values[start : start + n_block]), settings, rng)
        order = _continuation(previous, modes.waveforms, fixed_first=settings.zero_mode)
        waveforms, centres = modes.waveforms[order], modes.centres[order]
        if start:
            mismatch = _mismatch(previous, waveforms[:, : previous.shape[1]])
            seam = slice(done - start, done - start + n_fade)
            waveforms[:, seam] = rising * waveforms[:, seam] + (1.0 - rising) * previous[:, seam]
        stop = start + n_block
        # The seam lies in the middle of the overlap; from its start on, samples belong to the next segment.
        end = stop if following is None else (following + stop - n_fade) // 2
        yield ModeSegment(
            start=done,
            waveforms=waveforms[:, done - start : end - start],
            centres=centres,
            bandwidths=modes.bandwidths[order],
            n_fade=n_fade if start else 0,
            seam_mismatch=mismatch,
            converged=modes.converged,
            n_iterations=modes.n_iterations,
        )
        if following is not None:
            previous, done = waveforms[:, following - start :].copy(), end
            settings = replace(settings, start=tuple(centres.tolist()))


def _continuation(previous: FloatArray, waveforms: FloatArray, *, fixed_first: bool) -> IndexArray:
    """Return the order of modes in which they best continue the previous block's modes over the common samples."""
    from scipy.optimize import linear_sum_assignment

    # The minimum sum of squared differences is the maximum sum of products, as the squares do not depend on the order.
    likeness = previous @ waveforms[:, : previous.shape[1]].T
    if fixed_first:
        likeness[0, 1:] = likeness[1:, 0] = -np.inf
    return np.asarray(linear_sum_assignment(likeness, maximize=True)[1])


def _mismatch(previous: FloatArray, following: FloatArray) -> FloatArray:
    difference = np.linalg.norm(previous - following, axis=1)
    level = np.sqrt(0.5 * (np.square(previous).sum(axis=1) + np.square(following).sum(axis=1)))
    return np.asarray(difference / np.where(level > 0.0, level, 1.0))


def _together(segments: list[ModeSegment], energies: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return centres and bandwidths over all blocks, (n_modes,) each, weighted by each mode's energy per block."""
    share = energies / np.maximum(energies.sum(axis=0), np.finfo(np.float64).tiny)
    centres_of = np.array([segment.centres for segment in segments])
    widths = np.array([segment.bandwidths for segment in segments])
    centres: FloatArray = (share * centres_of).sum(axis=0)
    return centres, np.sqrt((share * (widths**2 + (centres_of - centres) ** 2)).sum(axis=0))


def _seam_notes(segments: list[ModeSegment], x: UniformSignal) -> tuple[str, ...]:
    mismatch = np.array([segment.seam_mismatch for segment in segments])
    notes = []
    for k in np.flatnonzero(mismatch.max(axis=0) > _LARGE_MISMATCH):
        i = int(np.argmax(mismatch[:, k]))
        notes.append(
            f"Mode {k + 1} does not continue across the seam at {segments[i].start / x.rate:.4g} {x.length_unit}: both "
            f"blocks' modes differ there by {percent(mismatch[i, k])} of their rms."
        )
    return tuple(notes)
