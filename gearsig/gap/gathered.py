"""What a recording is reduced to: sums over blocks of revolutions, of which every feature is made."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.frame import GearFrame

ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class ChannelSums:
    """Sums of one channel, one row per block; leaving a row out gives the jackknife's replicate.

    Parameters
    ----------
    lines : (array, array)
        (n_blocks, n_orders) complex amplitudes (peak) of the blocks' averages of driver and driven gear.
    counts : (array, array)
        (n_blocks,) revolutions in each average.
    residual_power : array, (n_blocks, n_orders)
        Power spectrum, over order of the driver, of what neither shaft repeats.
    envelope_power : array, (n_blocks, n_bands, n_cycles)
        Power spectrum of the residual's squared envelope in each band, over its squared mean.
    moments : array, (n_blocks, n_bands, 2)
        Mean square and mean fourth power of the residual in each band.
    tail : array, (n_blocks, 3)
        Of the raw signal: mean square, mean fourth power, share of samples close to the extreme.
    """

    lines: tuple[ComplexArray, ComplexArray]
    counts: tuple[FloatArray, FloatArray]
    residual_power: FloatArray
    envelope_power: FloatArray
    moments: FloatArray
    tail: FloatArray

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.residual_power)

    def without(self, block: int) -> ChannelSums:
        """Return the sums with one block left out."""
        keep = np.arange(self.n_blocks) != block
        return replace(
            self,
            lines=(self.lines[0][keep], self.lines[1][keep]),
            counts=(self.counts[0][keep], self.counts[1][keep]),
            residual_power=self.residual_power[keep],
            envelope_power=self.envelope_power[keep],
            moments=self.moments[keep],
            tail=self.tail[keep],
        )


@dataclass(frozen=True)
class Gathered:
    """One recording, reduced.

    Parameters
    ----------
    frame : GearFrame
    channels : mapping of str to ChannelSums
    order_step : float
        Between the lines of `residual_power`, in orders of the driver.
    cycle_step : float
        Between the lines of `envelope_power`, in orders of the driver.
    bands_hz : tuple of (float, float)
        Of `envelope_power` and `moments`.
    highest_order : float
        Of the driver, up to which lines are true.
    speed_hz : float
        Mean frequency of the driver.
    speed : tuple of float
        What the speed does; see `gearsig.gap.speed`.
    hum : tuple of float
        Mains lines; see `gearsig.gap.hum`.
    marks : (bool, bool)
        Whether angle 0 of driver and driven shaft is a mark on that shaft.
    n_revolutions : float
        Of the driver.
    known : list
        What `gearsig.gap.features.whole_and_parts` found; it is asked for again and again.
    """

    frame: GearFrame
    channels: dict[str, ChannelSums]
    order_step: float
    cycle_step: float
    bands_hz: tuple[tuple[float, float], ...]
    highest_order: float
    speed_hz: float
    speed: tuple[float, ...]
    hum: tuple[float, ...]
    marks: tuple[bool, bool]
    n_revolutions: float
    known: list[tuple[tuple[str, ...], FloatArray]] = field(default_factory=list, compare=False, repr=False)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return next(iter(self.channels.values())).n_blocks

    def without(self, block: int) -> Gathered:
        """Return the recording with one block of revolutions left out."""
        return self.with_channels({name: sums.without(block) for name, sums in self.channels.items()})

    def with_channels(self, channels: dict[str, ChannelSums]) -> Gathered:
        """Return the recording with other sums."""
        return replace(self, channels=channels, known=[])
