"""Modes of a signal: narrow-band parts that sum to it, with centre frequencies and how they were found."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from gearsig.checks import FloatArray, count, freeze, not_negative, one_of, positive, within
from gearsig.errors import InputError
from gearsig.formatting import axis_unit
from gearsig.results import Result
from gearsig.timefreq import UniformSignal

StartName = Literal["uniform", "zero", "random", "peaks"]
STARTS = get_args(StartName)
ModeAxis = Literal["frequency", "order"]
VmdEngine = Literal["gearsig", "vmdpy"]

REFERENCE_ITERATIONS = 499
"""The limit built into the reference programs, whose count of 500 includes the start."""


@dataclass(frozen=True)
class VmdSettings:
    """What variational mode decomposition is told; names of the reference programs in brackets.

    Parameters
    ----------
    n_modes : int
        Number of modes [K].
    penalty : float
        Weight of the modes' bandwidth against their sum's fit [alpha], above zero. A mode's gain at a distance d from
        its centre is 1 / (1 + penalty (d / sampling rate)²): one half at sampling rate / √penalty, which for 2000 is
        0.022 of the sampling rate. 2000 as in the source.
    dual_step : float
        Step of the Lagrange multiplier that makes the modes sum to the signal [tau]; 0 leaves noise in the residual.
    zero_mode : bool
        Whether the first mode's centre is kept at zero, so that it takes the mean and slow drift [DC].
    start : str or tuple of float
        First centre frequencies [init]: "uniform" over the spectrum [1], "zero" [0], "random" on a logarithmic scale
        [2], at the "peaks" of the spectrum (no such thing there), or one per mode, in the result's axis (Hz or orders).
        The modes found depend on it: from a uniform start, two modes may settle on one component and miss another.
    tolerance : float or None
        Iterations end when the modes' energy (sum over samples of the squared change) moves by less than this [tol].
        It carries the signal's unit squared and grows with its length. None: `RELATIVE_TOLERANCE` of the signal's own
        energy, which gives the same modes in any unit.
    max_iterations : int
        At least 2.
    engine : str
        "gearsig", or "vmdpy": the reference program in Python, much slower and with up to 16 kB of memory per sample
        and mode; it starts "uniform" or "zero" and always iterates up to 499 times.

    Raises
    ------
    InputError
        On a value out of range, or one that the engine cannot take.
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
        """Raise on what vmdpy cannot be told; its random start would draw from numpy's global state."""
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
        In `unit`. In the order of the first centre frequencies; `by_centre` sorts them.
    residual : array, (n_samples,)
        Signal less `offset` less the modes' sum.
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
        Change of the modes' energy in the last iteration over the signal's energy; nan where the engine keeps it.
    centre_history : array, (n_iterations, n_modes)
        Centres before each iteration; the last row holds `centres`.
    settings : VmdSettings
    unit, source, shaft : str
    offset : float
        A constant taken out of the signal before; 0 unless `source` says so.
    notes : tuple of str
        What the reader must know: no convergence, modes that overlap.
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
        """How many modes there are."""
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
        """Return the modes' indices by rising centre."""
        return tuple(int(i) for i in np.argsort(self.centres, kind="stable"))

    def signal(self, mode: int, *, start: float = 0.0) -> UniformSignal:
        """Return one mode as a signal that every transform takes, e.g. `squeezed_cwt_map(modes.signal(2))`.

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
    """Divide by the largest value first: squares of very small or large values leave the range of numbers."""
    largest = float(np.abs(x).max(initial=0.0))
    return largest * float(np.sqrt(np.mean(np.square(x / largest)))) if largest > 0.0 else 0.0


SAMPLES_PER_MODE = 4
"""A signal of n samples has n lines; with fewer than four each, a mode has no bandwidth to speak of."""


def check_supported(x: FloatArray, n_modes: int) -> None:
    """Raise where `x` is constant or too short for `n_modes`."""
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
    """Return what the reader must know: no convergence, modes that share the same lines."""
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
