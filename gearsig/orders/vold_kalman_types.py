"""What the Vold–Kalman filter takes and gives: frequency tracks, separated orders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.errors import InputError, RefusalError
from gearsig.orders.types import TrackedOrder

Generation = Literal["first", "second"]


@dataclass(frozen=True)
class FrequencyTrack:
    """A component known by its frequency over time instead of by shaft and order.

    Parameters
    ----------
    name : str
    frequency_hz : array, (n_samples,)
        At the recording's samples, not negative. Its integral is the phase, zero at the first sample.
    order : float, optional
        Cycles per revolution of `shaft`, where that is known: it tells the shaft's speed, so that a bandwidth in orders
        is one of that shaft, and levels can be read over speed.
    shaft : str, optional
    """

    name: str
    frequency_hz: FloatArray
    order: float = float("nan")
    shaft: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(
            self, "frequency_hz", frozen_array(self.frequency_hz, f"frequency_hz of {self.name!r}", ndim=1)
        )
        if len(self.frequency_hz) == 0 or self.frequency_hz.min() < 0.0:
            raise InputError(f"the frequency of track {self.name!r} is empty or negative", allowed=">= 0 Hz")
        if not np.isnan(self.order):
            positive(self.order, f"order of track {self.name!r}")


@dataclass(frozen=True)
class SeparatedOrder:
    """One order taken out of a signal: waveform, and complex envelope over time.

    Parameters
    ----------
    name : str
    shaft : str
        Empty where not known, for a frequency track.
    order : float
        Cycles per revolution of `shaft`; nan where not known, for a frequency track.
    envelope : array, (n_samples,), complex
        A e^{iφ} of A cos(2π·cycles + φ), A the peak amplitude in `unit`; nan where not `valid`.
    waveform : array, (n_samples,)
        The order's part of the signal; 0 where not `valid`.
    frequency_hz : array, (n_samples,)
    bandwidth_hz : array, (n_samples,) or (1,)
        Between the -3 dB points.
    valid : array of bool, (n_samples,)
        Where the whole band lies between zero and half the sampling rate and the shaft angle is known.
    settled : array of bool, (n_samples,)
        Where, in addition, the order is known for long enough on both sides: at the ends of the recording, and beside
        the parts left out, the filter leans on one side only, passes more noise, and its gain is not the closed form's.
    time_s : array, (n_samples,)
    unit, source : str
    """

    name: str
    shaft: str
    order: float
    envelope: NDArray[np.complex128]
    waveform: FloatArray
    frequency_hz: FloatArray
    bandwidth_hz: FloatArray
    valid: NDArray[np.bool_]
    settled: NDArray[np.bool_]
    time_s: FloatArray
    unit: str
    source: str

    def __post_init__(self) -> None:
        for name in ("waveform", "frequency_hz", "bandwidth_hz", "time_s"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=1))
        for name in ("envelope", "valid", "settled"):
            view = getattr(self, name).view()
            view.flags.writeable = False
            object.__setattr__(self, name, view)
        lengths = {len(getattr(self, name)) for name in ("envelope", "waveform", "frequency_hz", "valid", "time_s")}
        if len(lengths) > 1 or len(self.bandwidth_hz) not in {1, *lengths}:
            raise InputError(f"parts of order {self.name!r} differ in length")

    @property
    def amplitude(self) -> FloatArray:
        """Peak amplitude, (n_samples,); nan where not valid."""
        amplitude: FloatArray = np.abs(self.envelope)
        return amplitude

    @property
    def phase_rad(self) -> FloatArray:
        """Phase of the cosine against the angle, -π to π, (n_samples,); nan where not valid."""
        phase: FloatArray = np.angle(self.envelope)
        return phase

    def tracked(self, *, step: int = 1) -> TrackedOrder:
        """Return amplitude and phase along speed, every `step`-th valid sample, as `track_orders` gives them.

        Raises
        ------
        RefusalError
            For a frequency track of unknown order.
        """
        if not np.isfinite(self.order):
            raise RefusalError(f"{self.name!r} is a frequency track, without a speed", remedy="read it over time")
        at = np.flatnonzero(self.valid)[:: count(step, "step")]
        speed_rev_per_s = self.frequency_hz[at] / self.order
        width = np.broadcast_to(self.bandwidth_hz, self.valid.shape)[at]
        return TrackedOrder(
            order=self.order,
            time_s=self.time_s[at],
            speed_rpm=60.0 * speed_rev_per_s,
            amplitude=np.abs(self.envelope[at]),
            phase_rad=np.angle(self.envelope[at]),
            unit=self.unit,
            bandwidth_orders=float(np.median(width / speed_rev_per_s)),
            source=self.source,
            shaft=self.shaft,
        )


@dataclass(frozen=True)
class OrderSeparation:
    """A signal as the sum of orders and a residual.

    Parameters
    ----------
    orders : tuple of SeparatedOrder
        In the order asked for.
    residual : array, (n_samples,)
        The signal less all waveforms.
    sampling_rate : float
        Of the signal that was separated: in Hz, or samples per revolution for an `AngleSignal`.
    axis : "time" or "angle"
        Along which the samples are equally spaced.
    generation : "first" or "second"
    n_poles : int
        Of the second generation; the first has two.
    groups : tuple of tuples of int
        Positions of the orders that were solved for together.
    expected_error : float
        Of the numerical solution, relative to the signal's largest component.
    notes : tuple of str
        What the reader should know: masked parts, ends, which orders are close and which were solved for together.
    """

    orders: tuple[SeparatedOrder, ...]
    residual: FloatArray
    sampling_rate: float
    axis: Literal["time", "angle"]
    generation: Generation
    n_poles: int
    groups: tuple[tuple[int, ...], ...]
    expected_error: float
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "residual", frozen_array(self.residual, "residual", ndim=1))

    @property
    def coupled(self) -> bool:
        """Whether any orders were solved for together."""
        return any(len(group) > 1 for group in self.groups)

    def time_s(self) -> FloatArray:
        """Sample times of the recording, (n_samples,)."""
        return self.orders[0].time_s
