"""Shaft angle over time, and signals sampled at equal steps of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, freeze, frozen_array, instance_of, known_name, positive
from gearsig.errors import InputError, RefusalError
from gearsig.results import Result

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

AngleMethod = Literal["constant", "pulses", "encoder", "speed channel", "tachless"]


@dataclass(frozen=True)
class ShaftAngle(Result, columns=("time_s", "revolutions", "speed_rev_per_s")):
    """Angle of a shaft over time, as a piecewise cubic through knots.

    Parameters
    ----------
    shaft : str
    time_s : array, (n_knots,)
        Strictly increasing; at least two.
    revolutions : array, (n_knots,)
        Shaft angle in revolutions, not decreasing. The angle of a shaft that turns backwards also counts up.
    speed_rev_per_s : array, (n_knots,)
        Slope at the knots, not negative; between knots, the angle is the Hermite cubic through values and slopes.
    method : str
        How the angle was found.
    relative_speed_uncertainty : float
        Standard deviation of the mean speed relative to the mean speed, as estimated by the method; nan if not known.
    quality : float
        0 to 1: the method's confidence that this is the true angle and not, e.g., that of another harmonic.
    notes : tuple of str
        Repairs and assumptions (missed pulses, …), for the reader of the report.
    standstills_s : tuple of float
        Times at which the shaft stands still, or nearly so, between two pulses, which the speed at the knots does not
        show.
    """

    shaft: str
    time_s: FloatArray
    revolutions: FloatArray
    speed_rev_per_s: FloatArray
    method: AngleMethod
    relative_speed_uncertainty: float = float("nan")
    quality: float = 1.0
    notes: tuple[str, ...] = ()
    standstills_s: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, "time_s", "revolutions", "speed_rev_per_s")
        if not len(self.time_s) == len(self.revolutions) == len(self.speed_rev_per_s) >= 2:
            raise InputError("time_s, revolutions and speed_rev_per_s differ in length or have fewer than two knots")
        if np.any(np.diff(self.time_s) <= 0):
            raise InputError("time_s of a shaft angle does not increase")
        if np.any(np.diff(self.revolutions) < 0):
            raise InputError("revolutions of a shaft angle decrease")

    @property
    def start_s(self) -> float:
        """First time at which the angle is known, in s."""
        return float(self.time_s[0])

    @property
    def end_s(self) -> float:
        """Last time at which the angle is known, in s."""
        return float(self.time_s[-1])

    @property
    def n_revolutions(self) -> float:
        """Revolutions from the first to the last knot."""
        return float(self.revolutions[-1] - self.revolutions[0])

    @property
    def mean_speed_rpm(self) -> float:
        """Mean speed from the first to the last knot, in rpm."""
        return 60.0 * self.n_revolutions / (self.end_s - self.start_s)

    @property
    def speed_range_rpm(self) -> tuple[float, float]:
        """Lowest and highest speed at the knots, in rpm."""
        return 60.0 * float(self.speed_rev_per_s.min()), 60.0 * float(self.speed_rev_per_s.max())

    def is_steady(self, share: float = 0.01) -> bool:
        """Whether the speed varies by at most `share` of its mean; up to 1 %, lines stay sharp over frequency."""
        low, high = self.speed_range_rpm
        return high - low <= share * self.mean_speed_rpm

    def revolutions_at(self, time_s: FloatArray) -> FloatArray:
        """Return the shaft angle in revolutions at `time_s`; beyond the knots it continues at the end speed."""
        return self._evaluate(time_s, 0)

    def speed_rpm_at(self, time_s: FloatArray) -> FloatArray:
        """Return the speed in rpm at `time_s`; beyond the knots it is constant."""
        return 60.0 * self._evaluate(time_s, 1)

    def of_shaft(self, shaft: str, ratio: float) -> ShaftAngle:
        """Return the angle of another shaft that makes `ratio` revolutions per revolution of this one."""
        positive(ratio, "ratio")
        return replace(
            self, shaft=shaft, revolutions=self.revolutions * ratio, speed_rev_per_s=self.speed_rev_per_s * ratio
        )

    def between(self, start_s: float, end_s: float) -> ShaftAngle:
        """Return the part of the angle from `start_s` to `end_s`.

        Raises
        ------
        RefusalError
            If the angle is not known at any time in this range.
        """
        start, end = max(start_s, self.start_s), min(end_s, self.end_s)
        if start >= end:
            raise RefusalError(
                f"the shaft angle is known from {self.start_s:.4g} to {self.end_s:.4g} s, but the recording lasts from "
                f"{start_s:.4g} to {end_s:.4g} s",
                remedy="check that both use the same time axis",
            )
        if (start, end) == (self.start_s, self.end_s):
            return self
        inside = (self.time_s > start) & (self.time_s < end)
        time = np.concatenate([[start], self.time_s[inside], [end]])
        return replace(
            self,
            time_s=time,
            revolutions=np.maximum.accumulate(self._evaluate(time, 0)),
            speed_rev_per_s=np.maximum(self._evaluate(time, 1), 0.0),
        )

    @cached_property
    def _spline(self) -> CubicHermiteSpline:
        from scipy.interpolate import CubicHermiteSpline

        return CubicHermiteSpline(self.time_s, self.revolutions, self.speed_rev_per_s)

    def _evaluate(self, time_s: FloatArray, derivative: int) -> FloatArray:
        t = np.asarray(time_s, dtype=np.float64)
        inside = np.clip(t, self.time_s[0], self.time_s[-1])
        result: FloatArray = self._spline(inside, derivative)
        if derivative == 0:
            ends = np.where(t < inside, self.speed_rev_per_s[0], self.speed_rev_per_s[-1])
            result = result + (t - inside) * ends
        return result


def check_shaft_angle(value: object, name: str = "shaft_angle") -> None:
    """Raise unless the value is a `ShaftAngle`; for a number, the error suggests `speed_rpm`."""
    is_number = isinstance(value, int | float)
    remedy = "give a constant speed as speed_rpm" if is_number else "gearsig.find_shaft_angle(recording) finds one"
    instance_of(value, ShaftAngle, name, remedy=remedy)


@dataclass(frozen=True)
class AngleSignal(Result, matrix=("samples.T", "revolutions", "channel_names")):
    """Channels sampled at equal steps of a shaft's angle.

    Parameters
    ----------
    samples : array, (n_channels, n_samples)
    samples_per_revolution : int
    shaft_angle : ShaftAngle
        The angle used for resampling; sample 0 lies at `start_revolution`.
    start_revolution : float
    channel_names, units : tuples of str
    highest_order : float
        Orders above this are attenuated by the anti-aliasing filter or were not in the recording.
    """

    samples: FloatArray
    samples_per_revolution: int
    shaft_angle: ShaftAngle
    start_revolution: float
    channel_names: tuple[str, ...]
    units: tuple[str, ...]
    highest_order: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "samples", frozen_array(self.samples, "samples (channel, angle)", ndim=2))

    @property
    def revolutions(self) -> FloatArray:
        """Angle of each sample in revolutions, (n_samples,)."""
        return self.start_revolution + np.arange(self.samples.shape[1]) / self.samples_per_revolution

    @property
    def n_revolutions(self) -> float:
        """Length in revolutions."""
        return float(self.samples.shape[1] / self.samples_per_revolution)

    def values(self, name: str) -> FloatArray:
        """Return the samples of one channel, (n_samples,)."""
        at = self.channel_names.index(known_name(name, self.channel_names, f"there is no channel {name!r}"))
        row: FloatArray = self.samples[at]
        return row


# Slopes of an angle known at knots: local polynomials, limited so that the cubic between the knots never decreases.


def monotone_slopes(t: FloatArray, y: FloatArray) -> FloatArray:
    """Return slopes at the knots of non-decreasing data.

    Each slope is that of the quartic through the knot and two neighbours on each side (fewer at the ends and for short
    data), which is exact for polynomials up to degree four, including constant acceleration. Slopes are then limited to
    three times the smaller adjacent secant, which is sufficient for a monotone Hermite cubic.

    Source: F. N. Fritsch, R. E. Carlson, *Monotone piecewise cubic interpolation*, SIAM J. Numer. Anal. 17 (1980).
    """
    n = len(t)
    secants = np.diff(y) / np.diff(t)
    if n == 2:
        return np.repeat(secants, 2)
    slopes = np.empty(n)
    width = min(5, n)
    middle = width // 2
    inner = np.arange(n - width + 1)
    slopes[inner + middle] = _lagrange_slope(t, y, inner, width, middle)
    # A lower degree at the ends: a one-sided quartic would amplify timing errors several times.
    end = min(4, n)
    for i in range(middle):
        slopes[i] = _lagrange_slope(t, y, np.array([0]), end, i)[0]
    for i in range(n - width + middle + 1, n):
        slopes[i] = _lagrange_slope(t, y, np.array([n - end]), end, i - (n - end))[0]
    return limited_slopes(t, y, slopes)


def limited_slopes(t: FloatArray, y: FloatArray, slopes: FloatArray) -> FloatArray:
    """Limit slopes to between 0 and three times the smaller adjacent secant, so that the cubic does not decrease."""
    secants = np.diff(y) / np.diff(t)
    limit = 3.0 * np.minimum(np.append(secants, secants[-1]), np.insert(secants, 0, secants[0]))
    return np.clip(slopes, 0.0, limit)


def _lagrange_slope(t: FloatArray, y: FloatArray, start: NDArray[np.integer[Any]], width: int, at: int) -> FloatArray:
    """Return the slope at node `at` of the polynomial through `width` nodes from each `start`.

    With nodes t_j: p'(t_a) = Σ_{j≠a} (y_j - y_a) · w_j/w_a / (t_a - t_j), with w the barycentric weights.

    Source: J.-P. Berrut, L. N. Trefethen, *Barycentric Lagrange interpolation*, SIAM Review 46 (2004), eq. 9.4.
    """
    nodes = t[start[:, None] + np.arange(width)]
    values = y[start[:, None] + np.arange(width)]
    gaps = nodes[:, :, None] - nodes[:, None, :]
    gaps[:, np.arange(width), np.arange(width)] = 1.0
    # Scaling by the span keeps the products from under- or overflowing.
    span = (nodes[:, -1] - nodes[:, 0])[:, None]
    weights = 1.0 / np.prod(gaps / span[:, :, None], axis=2)
    slope = np.zeros(len(nodes))
    for j in range(width):
        if j != at:
            step = (values[:, j] - values[:, at]) / (nodes[:, j] - nodes[:, at])
            slope -= weights[:, j] / weights[:, at] * step
    return slope
