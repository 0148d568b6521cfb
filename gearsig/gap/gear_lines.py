"""Features of the two synchronous averages' lines: mesh harmonics, sidebands, shaft orders."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVEN, DRIVER
from gearsig.gap.gathered import ChannelSums, Gathered

N_MESH_HARMONICS = 6
N_SIDEBAND_HARMONICS = 5
SIDEBANDS = {"1": (1, 1), "2": (2, 2), "3to5": (3, 5), "6to12": (6, 12)}
MOST_SHAFT_ORDERS = 30
NOMINAL_REVOLUTIONS = 64.0
BY_CHANCE = 1e-3
"""Lines of noise that pass for a shaft's own."""
SIDES = ("driver", "driven")

Feature = tuple[str, float]


def average_lines(sums: ChannelSums, side: int) -> tuple[NDArray[np.complex128], FloatArray]:
    """Return the complex amplitudes (peak) of a shaft's average and the power that noise leaves on each of them.

    The noise is estimated from how the blocks' averages differ.
    """
    counts, blocks = sums.counts[side], sums.lines[side]
    weights = counts / counts.sum()
    lines = weights @ blocks
    scatter = (np.abs(blocks - lines) ** 2 * counts[:, None]).sum(axis=0) / max(len(counts) - 1, 1)
    noise = scatter / counts.sum()
    # A line's own scatter is that of few blocks: its neighbourhood says it better.
    return lines, np.maximum(smooth_power(noise), 1e-300)


def smooth_power(power: FloatArray) -> FloatArray:
    """Return the mean of each line and its four neighbours on either side."""
    smooth: FloatArray = np.convolve(np.pad(power, 4, mode="edge"), np.ones(9) / 9.0, mode="valid")
    return smooth


def is_synchronous(sums: ChannelSums, side: int) -> NDArray[np.bool_]:
    """Return which lines keep their phase from block to block: a shaft's own do, what leaks into its average does not.

    |a|² against the power that the same line's scatter over the blocks leaves of it, an F test with 2 and 2(B − 1)
    degrees of freedom.
    """
    counts, blocks = sums.counts[side], sums.lines[side]
    lines = (counts / counts.sum()) @ blocks
    degrees = max(len(counts) - 1, 1)
    scatter = (np.abs(blocks - lines) ** 2 * counts[:, None]).sum(axis=0) / degrees / counts.sum()
    # The F distribution with 2 and 2m degrees has P(F > f) = (1 + f/m)^(−m).
    least = degrees * (BY_CHANCE ** (-1.0 / degrees) - 1.0)
    held: NDArray[np.bool_] = np.abs(lines) ** 2 > least * scatter
    return held


def line_power(sums: ChannelSums, side: int) -> FloatArray:
    """Return the lines' power over a floor that does not depend on the record's length.

    |a|² holds the noise; what exceeds it counts, and the noise of `NOMINAL_REVOLUTIONS` is put under it. A line that is
    not there reads alike in records of any length from there on.
    """
    lines, noise = average_lines(sums, side)
    longer = max(1.0, float(sums.counts[side].sum()) / NOMINAL_REVOLUTIONS)
    power: FloatArray = np.maximum(np.abs(lines) ** 2 - noise, 0.0) + longer * noise
    return power


def visible_orders(gathered: Gathered, side: int, n_lines: int) -> int:
    """Highest whole order of a shaft whose line is true."""
    return int(min(gathered.highest_order / gathered.frame.shaft_orders[side], n_lines - 1))


def mesh_lines(power: FloatArray, teeth: int, highest: int) -> FloatArray:
    """Return those of the first mesh harmonics that can be seen, of a shaft's lines."""
    return power[teeth : N_MESH_HARMONICS * teeth + 1 : teeth][: highest // teeth]


def line_features(gathered: Gathered, sums: ChannelSums) -> Iterator[Feature]:
    """Yield name and value, in dB, of one channel's mesh, sideband and shaft-order features."""
    total = 0.0
    for side in (DRIVER, DRIVEN):
        power = line_power(sums, side)
        highest = visible_orders(gathered, side, len(power))
        teeth = gathered.frame.teeth[side]
        if side == DRIVER:
            total = float(mesh_lines(power, teeth, highest).sum())
            yield from _mesh(power, teeth, highest, total)
        yield from _sidebands(power, teeth, highest, total, SIDES[side])
        yield from _shaft_orders(power, teeth, highest, total, SIDES[side])


def decibel(power: float) -> float:
    """Return 10 lg of a power."""
    return float(10.0 * np.log10(max(power, 1e-300)))


def _mesh(power: FloatArray, teeth: int, highest: int, total: float) -> Iterator[Feature]:
    yield "mesh.total", decibel(total)
    for k in range(1, N_MESH_HARMONICS + 1):
        line = k * teeth
        level = decibel(power[line]) if line <= highest else decibel(1e-6 * total)
        yield f"mesh.share.{k}", max(level - decibel(total), -60.0)
    half = [(2 * k - 1) * teeth / 2 for k in range(1, 4)]
    visible = [order for order in half if order <= highest - 1 and order == int(order)]
    if visible:
        yield "mesh.half", decibel(float(np.mean([power[int(o)] for o in visible])) / total)
    else:
        yield "mesh.half", -60.0


def _sidebands(power: FloatArray, teeth: int, highest: int, total: float, side: str) -> Iterator[Feature]:
    carriers = [k * teeth for k in range(1, N_SIDEBAND_HARMONICS + 1) if k * teeth + 12 <= highest]
    if not carriers:
        carriers = [teeth]
    for label, (first, last) in SIDEBANDS.items():
        orders = [c + sign * n for c in carriers for n in range(first, last + 1) for sign in (-1, 1)]
        orders = [o for o in orders if 0 < o <= highest and o % teeth]
        lines = float(np.mean(power[orders])) if orders else 1e-300
        yield f"sideband.{side}.{label}", decibel(lines / total)
    own = [decibel(float(power[c - 1] + power[c + 1]) / max(float(power[c]), 1e-300)) for c in carriers]
    yield f"sideband.{side}.own", float(np.median(own))
    far = [
        o for c in carriers for o in (*range(c - 12, c - 2), *range(c + 3, c + 13)) if 0 < o <= highest and o % teeth
    ]
    if far:
        values = power[far]
        yield f"sideband.{side}.strongest", decibel(float(values.max() / np.median(values)))
    else:
        yield f"sideband.{side}.strongest", 0.0


def _shaft_orders(power: FloatArray, teeth: int, highest: int, total: float, side: str) -> Iterator[Feature]:
    for n in (1, 2, 3):
        level = decibel(power[n])
        yield f"shaft.{side}.{n}", level
        yield f"shaft.{side}.{n}.to_mesh", level - decibel(total)
    last = min(MOST_SHAFT_ORDERS, teeth - 3, highest)
    rest = power[4 : last + 1]
    strongest = int(np.argmax(rest))
    yield f"shaft.{side}.strongest", decibel(float(rest[strongest] / np.median(rest)))
    yield f"shaft.{side}.strongest.to_mesh", decibel(float(rest[strongest]) / total)
    yield f"shaft.{side}.low", decibel(float(rest.mean()) / total)
