"""Order maps, tracked orders and synchronous averages, with axes, scaling and units."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, freeze
from gearsig.errors import InputError
from gearsig.formatting import axis_label
from gearsig.results import Result
from gearsig.spectra import ComplexArray, Scaling

LineScaling = Literal["amplitude peak", "amplitude rms"]


@dataclass(frozen=True)
class OrderMap(Result, matrix=("values", "time_s", "positions")):
    """Spectra along speed or time.

    Parameters
    ----------
    values : array, (n_blocks, n_lines)
    positions : array, (n_lines,)
        Orders or frequencies (Hz), see `axis`.
    time_s, speed_rpm : arrays, (n_blocks,)
        Middle of each block, mean speed in it.
    axis : str
        "order" or "frequency".
    scaling, unit, resolution, source, shaft
        As in `Spectrum`.
    """

    values: FloatArray
    positions: FloatArray
    time_s: FloatArray
    speed_rpm: FloatArray
    axis: Literal["order", "frequency"]
    scaling: Scaling
    unit: str
    resolution: float
    source: str
    shaft: str

    def __post_init__(self) -> None:
        freeze(self, "values", ndim=2)
        freeze(self, "positions", "time_s", "speed_rpm")
        if self.values.shape != (len(self.time_s), len(self.positions)):
            raise InputError(
                f"values of shape {self.values.shape} for {len(self.time_s)} blocks × {len(self.positions)} lines"
            )

    @property
    def axis_label(self) -> str:
        """Name of the axis of lines, with its unit."""
        return axis_label(self.axis, self.shaft)


@dataclass(frozen=True)
class TrackedOrder(Result, columns=("time_s", "speed_rpm", "amplitude", "phase_rad")):
    """Level and phase of one order along speed.

    Parameters
    ----------
    order : float
        Cycles per revolution of `shaft`.
    time_s, speed_rpm : arrays, (n,)
    amplitude : array, (n,)
        Peak amplitude of the order in `unit`.
    phase_rad : array, (n,)
        Of the cosine against the shaft angle, -π to π.
    bandwidth_orders : float
        Width over which the order's energy was collected.
    unit, source, shaft : str
        Of the amplitude; the channel; the shaft that the order counts on.
    """

    order: float
    time_s: FloatArray
    speed_rpm: FloatArray
    amplitude: FloatArray
    phase_rad: FloatArray
    unit: str
    bandwidth_orders: float
    source: str
    shaft: str

    def __post_init__(self) -> None:
        freeze(self, "time_s", "speed_rpm", "amplitude", "phase_rad")


@dataclass(frozen=True)
class SynchronousAverage(Result, columns=("revolutions", "values", "standard_error")):
    """One mean revolution of a shaft, and how well the revolutions agree on it.

    Parameters
    ----------
    values : array, (n_angles,)
        Mean over the revolutions, at equal steps of angle from 0 to just under 1 revolution.
    standard_error : array, (n_angles,)
        Standard deviation of the mean, from the scatter of the revolutions (jackknife over blocks of revolutions).
    n_revolutions : int
        Revolutions averaged.
    shaft, channel, unit : str
    kind : str
        "average"; "residual": without mesh harmonics; "difference": without mesh harmonics and their first-order
        sidebands; "regular": what was taken out for the difference; "band-passed mesh": lines around a mesh harmonic;
        "change": what differs from a reference's average.
    highest_order : float
        Orders above it are not in the average.
    """

    values: FloatArray
    standard_error: FloatArray
    n_revolutions: int
    shaft: str
    channel: str
    unit: str
    kind: Literal["average", "residual", "difference", "regular", "band-passed mesh", "change"]
    highest_order: float

    def __post_init__(self) -> None:
        freeze(self, "values", "standard_error")
        if len(self.values) != len(self.standard_error):
            raise InputError(f"{len(self.values)} values, {len(self.standard_error)} standard errors")

    @property
    def revolutions(self) -> FloatArray:
        """Angle of each value, (n_angles,), from 0 to just under 1."""
        return np.arange(len(self.values)) / len(self.values)

    @property
    def highest_line(self) -> int:
        """Highest whole order that is truly in the average."""
        return min(int(self.highest_order + 1e-9), (len(self.values) - 1) // 2)

    def lines(self, scaling: LineScaling = "amplitude peak") -> ComplexArray:
        """Return the complex amplitudes of the shaft's whole orders, (highest_line + 1,).

        With "amplitude peak", A_o = 2/N Σ_m a[m] exp(-2πi o m/N), and the mean A_0 = 1/N Σ_m a[m]; with "amplitude rms"
        all but the mean are divided by √2. The phase is that of the cosine at shaft angle 0.
        """
        return lines_of_revolution(self.values, scaling)[: self.highest_line + 1]


@dataclass(frozen=True)
class AverageLines(Result):
    """Complex lines of a shaft's synchronous averages: of several channels at once, in consecutive parts of a record.

    Parameters
    ----------
    parts : complex array, (n_parts, n_channels, n_orders)
        parts[i, c, o] is the amplitude of the shaft's order o in channel c, averaged over part i.
    n_revolutions : array, (n_parts,)
        Revolutions in each part.
    shaft : str
    channels, units : tuples of str
    scaling : str
        See `SynchronousAverage.lines`.
    """

    parts: ComplexArray
    n_revolutions: FloatArray
    shaft: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    scaling: LineScaling

    def __post_init__(self) -> None:
        freeze(self, "parts", "n_revolutions", ndim=None)
        if self.parts.shape[:2] != (len(self.n_revolutions), len(self.channels)):
            raise InputError(
                f"parts of shape {self.parts.shape} for {len(self.n_revolutions)} parts, {len(self.channels)} channels"
            )

    @property
    def highest_order(self) -> int:
        """The last line's order."""
        return int(self.parts.shape[2]) - 1

    @property
    def whole(self) -> ComplexArray:
        """Lines of the whole record, (n_channels, n_orders): the parts' mean, by their revolutions."""
        mean: ComplexArray = np.tensordot(self.n_revolutions / self.n_revolutions.sum(), self.parts, axes=1)
        return mean


def lines_of_revolution(revolution: FloatArray, scaling: LineScaling) -> ComplexArray:
    """Return lines 0 … (N - 1)//2 of periodic waveforms of N samples along the last axis."""
    n = revolution.shape[-1]
    lines: ComplexArray = np.fft.rfft(revolution)[..., : (n - 1) // 2 + 1] * (2.0 / n)
    lines[..., 0] *= 0.5
    if scaling == "amplitude rms":
        lines[..., 1:] /= np.sqrt(2.0)
    return lines
