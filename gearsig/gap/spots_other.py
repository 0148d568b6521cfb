"""Which band, what of the speed, what of the amplitudes."""

from __future__ import annotations

import numpy as np

from gearsig.gap.spots import Comparison, Spot, band_words, by_decibels
from gearsig.gap.spots_cyclic import line_within

LEAST_SPEED_CHANGE = 3e-4
"""Relative; a steadier speed is as good as constant."""
PILED_UP = 1e-3
"""Share of samples within half a percent of the extreme; of a vibration with random peaks, some 1e-5 lie there."""


def band_spot(comparison: Comparison) -> Spot:
    """Return the band of the residual that changed most: its level, or how impulsive it is."""
    name = comparison.strongest("floor.band", "floor.kurtosis")
    _, kind, number = name.split(".")
    band = comparison.now.bands_hz[int(number) - 1]
    change = comparison.change_db[name]
    tone = line_within(comparison, band, change) if kind == "band" else None
    if tone is not None:
        return tone
    what = "noise" if kind == "band" else "kurtosis of the noise"
    title = f"{what} between {band_words(band).replace(' to ', ' and ')}, {by_decibels(change)}"
    channel = _loudest(comparison, int(number) - 1, kurtosis=kind != "band")
    return Spot(title, change, band_hz=band, channel=channel, follows=kind != "band")


def _loudest(comparison: Comparison, band: int, *, kurtosis: bool) -> str:
    """Return the channel on which the band changed most."""

    def change(name: str) -> float:
        both = [g.channels[name].moments.mean(axis=0)[band] for g in (comparison.now, comparison.other)]
        figures = [fourth / max(square**2, 1e-300) if kurtosis else square for square, fourth in both]
        return abs(float(np.log(max(figures[0], 1e-300) / max(figures[1], 1e-300))))

    return max(comparison.now.channels, key=change)


def speed_spot(comparison: Comparison) -> Spot | None:
    """Return what the speed does otherwise; None where it hardly does anything."""
    name = comparison.strongest("speed.")
    change = comparison.change_db[name]
    drift, swing, _, frequency_hz = comparison.now.speed
    if max(abs(drift), swing, *(abs(figure) for figure in comparison.other.speed[:2])) < LEAST_SPEED_CHANGE:
        return None
    if name == "speed.drift":
        return Spot(f"speed drifts by {100 * drift:.2g} % along the record", change)
    orders = (frequency_hz / comparison.now.speed_hz,)
    return Spot(f"speed swings by {100 * swing:.2g} % rms, most at {frequency_hz:.2g} Hz", change, orders)


def tail_spot(comparison: Comparison) -> Spot:
    """Return how the amplitudes are distributed otherwise."""
    name = comparison.strongest("raw.near", "raw.kurtosis")
    change = comparison.change_db[name]
    channel = max(comparison.now.channels, key=lambda c: float(comparison.now.channels[c].tail[:, 2].mean()))
    if name == "raw.near_the_extreme":
        piled = float(comparison.now.channels[channel].tail[:, 2].mean()) > PILED_UP
        clipping = ", as clipping makes them" if change > 0 and piled else ""
        title = f"samples close to the largest amplitude{clipping}, {by_decibels(change)}"
        return Spot(title, change, channel=channel, follows=not clipping)
    tails = "heavier" if change > 0 else "lighter"
    title = f"{tails} tails of the amplitudes (kurtosis {by_decibels(change)})"
    return Spot(title, change, channel=channel, follows=True)
