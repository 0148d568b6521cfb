"""What a transform works on: one channel at equal steps of time or of shaft angle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.angle.types import AngleSignal
from gearsig.checks import FloatArray, frozen_array, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.timefreq.types import Axis

SMALLEST, LARGEST = 1e-12, 1e15
"""Largest values of a signal, in its unit, between which single precision holds its weak coefficients' squares."""
N_FEWEST = 16
"""Samples below which there is nothing to lay out over time and frequency."""


@dataclass(frozen=True)
class UniformSignal:
    """One channel at equal steps of time or angle.

    Parameters
    ----------
    values : array, (n_samples,)
        Finite; float32 or float64.
    rate : float
        Samples per second, or per revolution.
    axis : str
        "frequency" for a signal over time, "order" for one over angle.
    highest : float or None
        Highest frequency or order that is valid; None: half the rate.
    start : float
        Time or angle of the first sample.
    unit, source, shaft : str

    Raises
    ------
    InputError
        On values that are not finite or beyond 1e-12 to 1e15, a wrong shape or rate.
    RefusalError
        If there are fewer than 16 samples.
    """

    values: FloatArray
    rate: float
    axis: Axis = "frequency"
    highest: float | None = None
    start: float = 0.0
    unit: str = ""
    source: str = ""
    shaft: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen_array(self.values, self.source or "signal", ndim=1))
        positive(self.rate, "rate")
        if len(self.values) < N_FEWEST:
            raise RefusalError(
                f"the signal has {len(self.values)} samples, fewer than {N_FEWEST}", remedy="record longer"
            )
        largest = float(max(abs(self.values.max()), abs(self.values.min())))
        if largest and not SMALLEST <= largest <= LARGEST:
            raise InputError(
                f"the largest value is {largest:.3g} {self.unit}".rstrip(),
                where=self.source or "signal",
                allowed=f"{SMALLEST:g} to {LARGEST:g}, or all zero",
                remedy="give the signal in another unit",
            )

    @property
    def n_samples(self) -> int:
        """Number of samples."""
        return len(self.values)

    @property
    def length(self) -> float:
        """Seconds or revolutions."""
        return self.n_samples / self.rate

    @property
    def highest_valid(self) -> float:
        """Highest frequency or order that the samples carry."""
        return self.rate / 2 if self.highest is None else min(self.highest, self.rate / 2)

    @property
    def position_unit(self) -> str:
        """Unit of frequencies or orders, for messages."""
        return "Hz" if self.axis == "frequency" else "orders"

    def instants(self, step: int) -> FloatArray:
        """Return the instant of every `step`-th sample."""
        return self.start + np.arange(0, self.n_samples, step) / self.rate


Source = Recording | AngleSignal | UniformSignal


def uniform(signal: Source, channel: str | None = None) -> UniformSignal:
    """Return one channel of a recording (over time) or of an angle signal (over revolutions).

    Parameters
    ----------
    signal : Recording, AngleSignal or UniformSignal
        An angle signal makes every transform one over orders and revolutions.
    channel : str or None
        None: the only channel there is.

    Raises
    ------
    InputError
        If the channel is not there, or none is named and there are several.
    """
    if isinstance(signal, UniformSignal):
        return signal
    if not isinstance(signal, (Recording, AngleSignal)):
        raise InputError(
            f"signal is a {type(signal).__name__}",
            allowed="a Recording, an AngleSignal, or UniformSignal(values, sampling_rate_hz)",
        )
    names = signal.channel_names
    if channel is None and len(names) != 1:
        raise InputError("no channel is named", where="channel", allowed=", ".join(names))
    name = names[0] if channel is None else channel
    values = signal.values(name)
    if isinstance(signal, Recording):
        unit = signal.channels[signal.index(name)].unit
        return UniformSignal(values, signal.sampling_rate_hz, unit=unit, source=name)
    return UniformSignal(
        values,
        float(signal.samples_per_revolution),
        axis="order",
        highest=signal.highest_order,
        start=signal.start_revolution,
        unit=signal.units[names.index(name)],
        source=name,
        shaft=signal.shaft_angle.shaft,
    )
