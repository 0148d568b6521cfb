"""Motion in phase space, its sections, and what is measured on it: results with what is needed to read them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import ceil, floor
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, freeze, frozen_array, instance_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.results import Result

BoolArray = NDArray[np.bool_]
ChaosVerdict = Literal["regular", "irregular", "undecided"]
PortraitKind = Literal["phase plane", "delay embedding", "states"]


@dataclass(frozen=True)
class PhasePortrait(Result, matrix=("points", "times_s", "axis_names")):
    """A path through phase space, sampled at a constant rate.

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Sample i lies at `start_s` + i / `sampling_rate_hz` of the recording's time.
    sampling_rate_hz : float
    axis_names, units : tuples of str
        One per axis.
    kind : str
        "phase plane": displacement and velocity; "delay embedding": x(t), x(t + τ), …; "states": as a model gave them.
    source : str
        Channel, and what was done to it.
    start_s : float
    band_hz : (float, float)
        Frequencies that the axes hold in full; (0, half the sampling rate) where nothing was filtered.
    delay_samples : int
        Of a delay embedding; 0 otherwise.
    """

    points: FloatArray
    sampling_rate_hz: float
    axis_names: tuple[str, ...]
    units: tuple[str, ...]
    kind: PortraitKind
    source: str
    start_s: float = 0.0
    band_hz: tuple[float, float] = (0.0, float("inf"))
    delay_samples: int = 0

    def __post_init__(self) -> None:
        freeze(self, "points", ndim=2)
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")
        if not self.points.shape[1] == len(self.axis_names) == len(self.units):
            raise InputError(
                f"{len(self.axis_names)} axis names and {len(self.units)} units for {self.points.shape[1]} axes"
            )

    @property
    def n_points(self) -> int:
        """Samples of the path."""
        return int(self.points.shape[0])

    @property
    def n_axes(self) -> int:
        """Dimension of the space."""
        return int(self.points.shape[1])

    @property
    def times_s(self) -> FloatArray:
        """Time of each sample, (n_points,)."""
        return self.start_s + np.arange(self.n_points) / self.sampling_rate_hz

    @property
    def end_s(self) -> float:
        """Time of the last sample."""
        return self.start_s + (self.n_points - 1) / self.sampling_rate_hz

    @property
    def extent(self) -> FloatArray:
        """Standard deviation along each axis, (n_axes,): the size that distances are compared with."""
        deviation: FloatArray = np.std(self.points, axis=0, dtype=np.float64)
        return deviation

    def between(self, start_s: float, end_s: float) -> PhasePortrait:
        """Return the samples from `start_s` to `end_s`, both included.

        Raises
        ------
        InputError
            If fewer than two lie there.
        """
        first = max(0, ceil((start_s - self.start_s) * self.sampling_rate_hz - 1e-6))
        last = min(self.n_points - 1, floor((end_s - self.start_s) * self.sampling_rate_hz + 1e-6))
        if last <= first:
            raise InputError(
                f"there are no samples from {start_s:g} to {end_s:g} s", allowed=f"{self.start_s:g} to {self.end_s:g} s"
            )
        start = self.start_s + first / self.sampling_rate_hz
        return replace(self, points=self.points[first : last + 1], start_s=start)


@dataclass(frozen=True)
class PoincareSection(Result, matrix=("points", "times_s", "axis_names")):
    """Points at which a path meets its section.

    Parameters
    ----------
    points : array, (n_points, n_axes)
        Interpolated between the samples, in the order of time.
    times_s : array, (n_points,)
    axis_names, units : tuples of str
    extent : array, (n_axes,)
        Standard deviation of the whole path along each axis.
    kind : str
        "locked": once per cycle of a mesh or a shaft; "geometric": where the path crosses a plane.
    section : str
        What it is locked to, or the plane.
    source : str
    """

    points: FloatArray
    times_s: FloatArray
    axis_names: tuple[str, ...]
    units: tuple[str, ...]
    extent: FloatArray
    kind: Literal["locked", "geometric"]
    section: str
    source: str

    def __post_init__(self) -> None:
        freeze(self, "points", ndim=2)
        freeze(self, "times_s", "extent")
        if len(self.points) != len(self.times_s) or self.points.shape[1] != len(self.extent):
            raise InputError(f"points of shape {self.points.shape} for {len(self.times_s)} times")

    @property
    def n_points(self) -> int:
        """Crossings."""
        return int(self.points.shape[0])


@dataclass(frozen=True)
class BifurcationDiagram(Result, columns=("parameter", "points")):
    """One coordinate of the Poincaré points over a parameter.

    Parameters
    ----------
    parameter : array, (n_points,)
        Value of the parameter for each point, ascending.
    points : array, (n_points,)
    parameter_name, parameter_unit, axis_name, unit : str
    values : array, (n_values,)
        The parameter values that have points, ascending.
    periods : tuple of int, (n_values,)
        Cycles after which the section repeats at each value; 0 where it does not repeat within the longest looked for.
    section : str
    extents : array, (n_values,)
        Standard deviation of the whole path along the drawn axis at each value; empty where it is not known.
    """

    parameter: FloatArray
    points: FloatArray
    parameter_name: str
    parameter_unit: str
    axis_name: str
    unit: str
    values: FloatArray
    periods: tuple[int, ...]
    section: str
    extents: FloatArray = field(default_factory=lambda: np.empty(0))

    def __post_init__(self) -> None:
        freeze(self, "parameter", "points", "values", "extents")
        if len(self.parameter) != len(self.points) or len(self.values) != len(self.periods):
            raise InputError(f"{len(self.parameter)} parameter values for {len(self.points)} points")
        if len(self.extents) not in (0, len(self.values)):
            raise InputError(f"{len(self.extents)} extents for {len(self.values)} values")


@dataclass(frozen=True)
class MutualInformation(Result, columns=("delays_s", "information_nats")):
    """Average mutual information of a signal and its delayed self, and the delay chosen from it.

    Parameters
    ----------
    information_nats : array, (n_delays,)
        At delays of 0, 1, 2, … × `step_samples`.
    step_samples : int
    sampling_rate_hz : float
    delay_samples : int
        The delay chosen.
    rule : str
        How: "first minimum", or what stood in for it.
    n_bins : int
        Of the histogram, per axis.
    source : str
    """

    information_nats: FloatArray
    step_samples: int
    sampling_rate_hz: float
    delay_samples: int
    rule: str
    n_bins: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "information_nats")

    @property
    def delays_s(self) -> FloatArray:
        """Delays, (n_delays,)."""
        return np.arange(len(self.information_nats)) * (self.step_samples / self.sampling_rate_hz)

    @property
    def delay_s(self) -> float:
        """The delay chosen."""
        return self.delay_samples / self.sampling_rate_hz


@dataclass(frozen=True)
class EmbeddingDimension(Result):
    """How many delayed values unfold a signal's path.

    Parameters
    ----------
    dimensions : tuple of int
        1, 2, …
    false_fraction : array, (n_dimensions,)
        Share of nearest neighbours that are false at each dimension (Kennel).
    growth : array, (n_dimensions - 1,)
        Cao's E1(d): reaches 1 where the path is unfolded.
    determinism : array, (n_dimensions - 1,)
        Cao's E2(d): 1 at every d for a random signal.
    dimension : int
        The one chosen; 0 where no dimension unfolds the path.
    verdict : str
        "deterministic", or "stochastic": no dimension up to the largest tried unfolds it.
    threshold : float
        Share of false neighbours that still counts as unfolded.
    delay_samples : int
    source : str
    """

    dimensions: tuple[int, ...]
    false_fraction: FloatArray
    growth: FloatArray
    determinism: FloatArray
    dimension: int
    verdict: Literal["deterministic", "stochastic"]
    threshold: float
    delay_samples: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "false_fraction", "growth", "determinism")


@dataclass(frozen=True)
class LyapunovExponent(Result, columns=("times_s", "log_distance")):
    """Largest Lyapunov exponent, with the divergence curve it was read from.

    Parameters
    ----------
    exponent_per_s, uncertainty_per_s : float
        Slope of the curve and one standard deviation of it: scatter between segments of the signal, and dependence on
        where the line is fitted. Not numbers in what a `RefusalError` looked at.
    log_distance : array, (n_steps,)
        Mean logarithm of the distance of neighbours after 0, 1, 2, … steps of `step_s`.
    step_s : float
    fit_s : (float, float)
        Segment of the curve that was fitted.
    saturation_log_distance : float
        Mean logarithm of the distance of points that have nothing to do with each other.
    verdict : str
        "diverging": the exponent is above twice its uncertainty and distances grow by e or more; "not diverging": they
        do not, although there was room; "undecided".
    method : str
        "rosenstein", "transverse" or "kantz".
    n_references, theiler_samples : int
    source : str
    """

    exponent_per_s: float
    uncertainty_per_s: float
    log_distance: FloatArray
    step_s: float
    fit_s: tuple[float, float]
    saturation_log_distance: float
    verdict: Literal["diverging", "not diverging", "undecided"]
    method: str
    n_references: int
    theiler_samples: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "log_distance")

    @property
    def times_s(self) -> FloatArray:
        """Times of the divergence curve, (n_steps,)."""
        return np.arange(len(self.log_distance)) * self.step_s


@dataclass(frozen=True)
class ChaosTest(Result, columns=("c_rad", "k_of_c")):
    """Result of the 0–1 test.

    Parameters
    ----------
    k : float
        Median of `k_of_c`: near 0 for regular motion, near 1 for chaos (and for noise: the test presumes determinism).
    k_of_c, c_rad : arrays, (n_frequencies,)
    damping : float
        Weight of the term that keeps weak noise from being read as chaos; 0: the plain modified test.
    n_values : int
    verdict : str
        "regular" (k < 0.2), "irregular" (k > 0.8), "undecided" between and where the values are oversampled.
    oversampled : bool
        Whether neighbouring values are so close that the test would read chaos as regular motion.
    source : str
    every : int
        Every so-many-th value was used.
    reason : str
        Why it is undecided; empty otherwise.
    """

    k: float
    k_of_c: FloatArray
    c_rad: FloatArray
    damping: float
    n_values: int
    verdict: ChaosVerdict
    oversampled: bool
    source: str
    every: int = 1
    reason: str = ""

    def __post_init__(self) -> None:
        freeze(self, "k_of_c", "c_rad")


@dataclass(frozen=True)
class RecurrencePlot(Result, matrix=("recurrent", "times_s", "times_s")):
    """Which points of a path lie close to which.

    Parameters
    ----------
    recurrent : array of bool, (n, n)
        Symmetric; read-only.
    times_s : array, (n,)
    radius : float
        Points closer than this are recurrent; in standard deviations of the axes.
    stride : int
        Every so-many-th point of the portrait was taken.
    source : str
    """

    recurrent: BoolArray
    times_s: FloatArray
    radius: float
    stride: int
    source: str

    def __post_init__(self) -> None:
        freeze(self, "recurrent", ndim=None)
        freeze(self, "times_s")


@dataclass(frozen=True)
class RecurrenceMeasures(Result):
    """Recurrence quantification; lengths in seconds, shares from 0 to 1.

    Parameters
    ----------
    recurrence_rate : float
        RR: share of recurrent pairs.
    determinism : float
        DET: share of the recurrent points that lie on diagonal lines of `shortest_line` points or more.
    mean_line_s, longest_line_s : float
        L and Lmax of these lines.
    entropy_nats : float
        ENTR: Shannon entropy of their lengths.
    laminarity : float
        LAM: share of the recurrent points on vertical lines of `shortest_line` points or more.
    trapping_time_s : float
        TT: mean length of these.
    radius : float
        In standard deviations of the axes.
    shortest_line, theiler_points, stride, n_points : int
        In points taken; every `stride`-th sample was.
    duration_s : float
        Length of the segment.
    source : str
    """

    recurrence_rate: float
    determinism: float
    mean_line_s: float
    longest_line_s: float
    entropy_nats: float
    laminarity: float
    trapping_time_s: float
    radius: float
    shortest_line: int
    theiler_points: int
    stride: int
    n_points: int
    duration_s: float
    source: str


def check_portrait(value: object) -> None:
    """Raise unless the value is a path in phase space."""
    remedy = "gearsig.phase_plane and gearsig.delay_embedding(recording, channel) make one"
    instance_of(value, PhasePortrait, "portrait", remedy=remedy)


def checked_series(values: FloatArray, *, minimum: int, name: str = "values") -> FloatArray:
    """Return a finite float64 series of at least `minimum` samples that is not constant.

    Raises
    ------
    InputError
        On NaN, a wrong shape, or too few samples.
    RefusalError
        If the series is constant: there is no motion to look at.
    """
    x = frozen_array(values, name, ndim=1)
    if len(x) < minimum:
        raise InputError(
            f"{name} has {counted(len(x), 'sample')}",
            allowed=f"at least {minimum}",
            remedy="record longer or ask for less",
        )
    low, high = float(x.min()), float(x.max())
    if high - low <= 8.0 * np.finfo(x.dtype).eps * max(abs(low), abs(high)):
        raise RefusalError(
            f"{name} is constant at {low:g}: nothing moves, so there is nothing to embed",
            remedy="check the sensor, or take a channel or a segment that vibrates",
        )
    return np.asarray(x, dtype=np.float64)


def mean_period_samples(x: FloatArray) -> float:
    """Return one over the mean frequency of the power spectrum, in samples; at least 2.

    T = Σ|X(f)|² / Σ f |X(f)|², the mean taken off before.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, *A practical method for calculating largest Lyapunov
    exponents from small data sets*, Physica D 65 (1993).
    """
    from scipy import fft

    part = x[: 1 << 20]
    lines = fft.rfft(part - part.mean(), fft.next_fast_len(len(part), real=True))
    power = np.square(lines.real) + np.square(lines.imag)
    frequency = np.arange(len(power)) / (2.0 * (len(power) - 1))
    return max(2.0, float(power.sum() / np.dot(frequency, power)))
