"""Levels of bands: third octaves over frequency, and bands around the mesh harmonics over order."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil, floor, log10

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.agreement import agreement
from gearsig.compare.averages import HalvedLines
from gearsig.compare.levels import power_levels
from gearsig.compare.types import BandLevel
from gearsig.spectra.density import power_density
from gearsig.spectra.types import Spectrum

OCTAVE_RATIO = 10.0**0.3
HIGHEST_SHARE = 0.45
"""Of the sampling rate: above it, anti-aliasing filters have taken over."""
LONGEST_BLOCK_S = 4.0
LINES_PER_BAND = 4
MOST_ORDER_BANDS = 10
_NOMINAL = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)


def third_octave_limits(low_hz: float, high_hz: float) -> tuple[tuple[float, float, float], ...]:
    """Return (nominal, low, high) in Hz of the third-octave bands that lie between two frequencies.

    f_m = 1000 G^{x/3}, edges f_m G^{±1/6}, G = 10^{3/10}.

    References
    ----------
    IEC 61260-1:2014, "Electroacoustics – Octave-band and fractional-octave-band filters – Part 1: Specifications".

    Examples
    --------
    >>> [nominal for nominal, _, _ in third_octave_limits(880.0, 2300.0)]
    [1000.0, 1250.0, 1600.0, 2000.0]
    """
    per_step = log10(OCTAVE_RATIO) / 3.0
    first = ceil(log10(low_hz / 1000.0) / per_step + 0.5 - 1e-9)
    last = floor(log10(high_hz / 1000.0) / per_step - 0.5 + 1e-9)
    half = OCTAVE_RATIO ** (1.0 / 6.0)
    bands = []
    for x in range(first, last + 1):
        middle = 1000.0 * OCTAVE_RATIO ** (x / 3.0)
        bands.append((_NOMINAL[x % 10] * 10.0 ** (x // 10) * 1000.0, middle / half, middle * half))
    return tuple(bands)


def third_octaves(
    simulated: tuple[FloatArray, FloatArray],
    simulated_rate_hz: float,
    recorded: tuple[FloatArray, FloatArray],
    recorded_rate_hz: float,
) -> tuple[BandLevel, ...]:
    """Return third-octave levels of one channel, from both halves of either record.

    Power densities of equally long blocks are summed over each band; lines on an edge count by their share.
    """
    shortest_s = min(len(simulated[0]) / simulated_rate_hz, len(recorded[0]) / recorded_rate_hz)
    block_s = min(LONGEST_BLOCK_S, shortest_s / 2.0)
    lowest = LINES_PER_BAND / block_s / (OCTAVE_RATIO ** (1 / 6) - OCTAVE_RATIO ** (-1 / 6))
    limits = third_octave_limits(lowest, HIGHEST_SHARE * min(simulated_rate_hz, recorded_rate_hz))
    if not limits:
        return ()
    powers = []
    for halves, rate in ((simulated, simulated_rate_hz), (recorded, recorded_rate_hz)):
        densities = [power_density(half, rate, n_per_block=max(2, round(block_s * rate))) for half in halves]
        powers.append(np.stack([band_powers(d, [(low, high) for _, low, high in limits]) for d in densities]))
    levels = power_levels(*powers)
    return tuple(
        BandLevel(_hertz(nominal), low, high, "frequency", level)
        for (nominal, low, high), level in zip(limits, levels, strict=True)
    )


def band_powers(density: Spectrum, limits: Sequence[tuple[float, float]]) -> FloatArray:
    """Return the mean square in each band of a power density; a line covers half a step to either side."""
    edges = np.concatenate([[0.0], density.positions + density.resolution / 2.0])
    total = np.concatenate([[0.0], np.cumsum(density.values * density.resolution)])
    powers: FloatArray = np.array([float(np.diff(np.interp(band, edges, total))[0]) for band in limits])
    return powers


def order_band_limits(mesh_order: float | None, name: str, highest: float) -> tuple[tuple[str, float, float], ...]:
    """Return (label, low, high): bands of one mesh order around its harmonics; ten equal bands without a mesh."""
    if mesh_order is not None and 1.5 * mesh_order <= highest:
        n = min(int(highest / mesh_order - 0.5), MOST_ORDER_BANDS)
        around = [(f"around {k}× mesh {name}".rstrip(), (k - 0.5) * mesh_order) for k in range(1, n + 1)]
        return (
            ("below the mesh", 0.5, 0.5 * mesh_order),
            *((label, low, low + mesh_order) for label, low in around),
        )
    edges = np.linspace(0.5, highest, MOST_ORDER_BANDS + 1)
    return tuple((f"orders {a:.4g} to {b:.4g}", float(a), float(b)) for a, b in pairwise(edges))


def order_bands(
    limits: Sequence[tuple[str, float, float]],
    simulated: Sequence[Spectrum],
    recorded: Sequence[Spectrum],
    lines: tuple[HalvedLines, HalvedLines],
    channel: int,
) -> tuple[BandLevel, ...]:
    """Return levels of bands over order, and how alike the reference shaft's lines in each are.

    Parameters
    ----------
    limits : sequence of (label, low, high)
    simulated, recorded : sequence of Spectrum
        Power densities over order, of the halves.
    lines : (HalvedLines, HalvedLines)
        Of the reference shaft, aligned.
    channel : int
    """
    edges = [(low, high) for _, low, high in limits]
    own, other = (np.stack([band_powers(half, edges) for half in halves]) for halves in (simulated, recorded))
    found = []
    for (label, low, high), level in zip(limits, power_levels(own, other), strict=True):
        inside = slice(max(1, ceil(low)), min(ceil(high), lines[0].first.shape[1]))
        alike = agreement(*lines, channel, inside) if inside.stop > inside.start + 1 else None
        found.append(BandLevel(label, low, high, "order", level, alike))
    return tuple(found)


def _hertz(nominal: float) -> str:
    return f"{nominal / 1000:g} kHz" if nominal >= 1000 else f"{nominal:.4g} Hz"
