"""Features of single teeth: what a shaft's average holds besides mesh and smooth modulation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import gcd

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVEN, DRIVER
from gearsig.gap.gathered import ChannelSums, Gathered
from gearsig.gap.gear_lines import (
    NOMINAL_REVOLUTIONS,
    SIDES,
    Feature,
    average_lines,
    decibel,
    line_power,
    mesh_lines,
    visible_orders,
)
from gearsig.severity.shaft_lines import orders_from_mesh

SMOOTH_SIDEBANDS = 2
"""Mesh lines and as many sidebands on either side are left out: eccentricity makes those."""
SMOOTH_SHAFT_ORDERS = 3
FEWEST_APART = 3
"""Orders between two that both shafts share, for those to be left out."""

STEPS_PER_TOOTH = 4


def residual_lines(
    lines: NDArray[np.complex128], teeth: int, highest: int, other_teeth: int = 1
) -> NDArray[np.complex128]:
    """Return the lines without mesh harmonics, their first sidebands and the first shaft orders.

    Orders that the other shaft has, too, are left out unless those are most: which teeth meet depends on them.
    """
    orders = np.arange(len(lines))
    near = orders_from_mesh(orders, teeth) <= SMOOTH_SIDEBANDS
    out = near | (orders <= SMOOTH_SHAFT_ORDERS) | (orders > highest)
    apart = teeth // gcd(teeth, other_teeth)
    if apart >= FEWEST_APART:
        out |= orders % apart == 0
    return np.where(out, 0.0, lines)


def tooth_energy(lines: NDArray[np.complex128], teeth: int) -> FloatArray:
    """Return the mean square within one pitch, at `STEPS_PER_TOOTH` places per tooth round the revolution."""
    n = 2 * (len(lines) - 1)
    wave = np.fft.irfft(lines, n) * (n / 2.0)
    total = np.concatenate([[0.0], np.cumsum(np.tile(wave**2, 2))])
    starts = np.arange(teeth * STEPS_PER_TOOTH) / (teeth * STEPS_PER_TOOTH) * n
    first = starts.astype(np.intp)
    width = max(1, round(n / teeth))
    energy: FloatArray = (total[first + width] - total[first]) / width
    return energy


def tooth_features(gathered: Gathered, sums: Sequence[ChannelSums]) -> Iterator[Feature]:
    """Yield the tooth features of all channels together, since a tooth shows at one angle on all of them."""
    for side in (DRIVER, DRIVEN):
        teeth = gathered.frame.teeth[side]
        residuals, noises = [], []
        for channel in sums:
            lines, noise = average_lines(channel, side)
            scale = mesh_power(gathered, channel, side)
            highest = visible_orders(gathered, side, len(lines))
            residual = residual_lines(lines, teeth, highest, gathered.frame.teeth[1 - side])
            residuals.append(residual / np.sqrt(scale))
            noises.append(np.where(residuals[-1] != 0, noise, 0.0).sum() / 2.0 / scale)
        longer = max(1.0, float(sums[0].counts[side].sum()) / NOMINAL_REVOLUTIONS)
        yield from pattern_features(f"tooth.{SIDES[side]}", residuals, teeth, float(np.mean(noises)), longer)


def mesh_power(gathered: Gathered, channel: ChannelSums, side: int) -> float:
    """Return the power of the mesh harmonics in a shaft's average."""
    power = line_power(channel, side)
    teeth = gathered.frame.teeth[side]
    highest = visible_orders(gathered, side, len(power))
    return float(mesh_lines(power, teeth, highest).sum())


def pattern_features(
    name: str,
    residuals: Sequence[NDArray[np.complex128]],
    teeth: int,
    noise: float,
    longer: float,
    least: float = 1e-30,
) -> Iterator[Feature]:
    """Yield size, prominence, kurtosis, width, centroid of residuals relative to their mesh.

    `noise` is the energy that noise leaves in them; `longer` times it is put under what exceeds it. `least` is the
    energy that is told apart from nothing.
    """
    energy = np.mean([tooth_energy(lines, teeth) for lines in residuals], axis=0)
    energy = np.maximum(np.maximum(energy - noise, 0.0) + longer * noise, least)
    best = int(np.argmax(energy))
    share = energy / energy.max()
    width = float(np.count_nonzero(share > 0.5)) / STEPS_PER_TOOTH
    kurtosis = float(np.mean([_kurtosis(lines) for lines in residuals]))
    away = np.roll(energy, -best)[2 * STEPS_PER_TOOTH : -2 * STEPS_PER_TOOTH]
    yield f"{name}.level", decibel(float(energy.mean()))
    yield f"{name}.elsewhere", decibel(float(np.median(away)))
    yield f"{name}.peak", decibel(float(energy[best]))
    yield f"{name}.prominence", decibel(float(energy[best] / np.median(away)))
    yield f"{name}.second", decibel(float(energy[best] / away.max()))
    yield f"{name}.kurtosis", 10.0 * float(np.log10(max(kurtosis, 0.1)))
    yield f"{name}.width", 10.0 * float(np.log10(width))
    power = np.mean([np.abs(lines) ** 2 for lines in residuals], axis=0)
    orders = np.arange(len(power)) / teeth
    total = max(float(power.sum()), 1e-30)
    yield f"{name}.below_mesh", decibel(float(power[orders < 1.0].sum()) / total)
    yield f"{name}.centroid", 10.0 * float(np.log10(max(float((orders * power).sum()) / total, 0.01)))


def _kurtosis(lines: NDArray[np.complex128]) -> float:
    wave = np.fft.irfft(lines)
    square = float(np.mean(wave**2))
    return float(np.mean(wave**4)) / square**2 if square > 0 else 3.0
