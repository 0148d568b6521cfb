"""Features of a recording against a healthy reference of the same gears."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.alike import alike_features
from gearsig.gap.channels import apart_features
from gearsig.gap.features import Features, once, whole_and_parts, whole_record_variance
from gearsig.gap.frame import DRIVEN, DRIVER
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import (
    NOMINAL_REVOLUTIONS,
    SIDES,
    Feature,
    average_lines,
    smooth_power,
    visible_orders,
)
from gearsig.gap.tooth import mesh_power, pattern_features, residual_lines
from gearsig.severity.reference import difference_lines
from gearsig.severity.shaft_lines import ShaftLines

SURPRISE = "surprise."
"""Of features that are measured in the two recordings' own noise."""

LEAST_NOISE = 1e-8
"""Of all lines together over the mesh's power: two gears of equal teeth leave nothing of their own in one average."""

LEAST_SURPRISE = 0.1
"""Energy below any that a sound machine's own noise makes: of two gears of equal teeth one has no average of its own,
and what rounding leaves in it says nothing."""

REPEATS = 0.1
"""Share by which a sound machine's pattern differs on another day, see `surprises`."""


def change_features(now: Gathered, sound: Gathered) -> Features:
    """Return the differences of all features, and features of the difference of the averages.

    The reference's scatter counts as well: variances of both add.
    """
    (names, here), before = whole_and_parts(now), whole_and_parts(sound)[1]
    joined, values = _joined(names, here[0] - before[0], now, sound)
    return _with_scatter(
        joined,
        values,
        np.stack(
            [_joined(names, v - before[0], part, sound)[1] for v, part in zip(here[1:], _parts(now), strict=True)]
        ),
        np.stack(
            [_joined(names, here[0] - v, now, part)[1] for v, part in zip(before[1:], _parts(sound), strict=True)]
        ),
    )


def change_once(now: Gathered, sound: Gathered) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of the change features, without their scatter."""
    (names, here), before = once(now), once(sound)[1]
    return _joined(names, here - before, now, sound)


def difference_features(now: Gathered, simulated: Gathered, credibility: FloatArray | float = 1.0) -> Features:
    """Return the differences of all features alone: a simulation's flanks are not this machine's.

    Parameters
    ----------
    now, simulated : Gathered
    credibility : array, (n_features,), or float
        How much of what the simulation says of each feature is subtracted, see `gearsig.gap.population`.
    """
    (names, here), before = whole_and_parts(now), credibility * whole_and_parts(simulated)[1]
    return _with_scatter(names, here[0] - before[0], here[1:] - before[0], here[0] - before[1:])


def _with_scatter(names: tuple[str, ...], values: FloatArray, *left_out: FloatArray) -> Features:
    variance = 2.0 * whole_record_variance(names)
    for rows in left_out:
        variance += (len(rows) - 1.0) * np.var(rows, axis=0)
    return Features(names, values, np.sqrt(variance), left_out)


def _parts(gathered: Gathered) -> Iterator[Gathered]:
    return (gathered.without(block) for block in range(gathered.n_blocks))


def _joined(
    names: tuple[str, ...], differences: FloatArray, now: Gathered, sound: Gathered
) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of the differences and of the patterns' features behind them."""
    patterns = dict(_patterns(now, sound))
    return (*names, *patterns), np.concatenate([differences, list(patterns.values())])


def _patterns(now: Gathered, sound: Gathered) -> Iterator[Feature]:
    """Yield the tooth features of the difference of the averages, turned so that the same teeth meet."""
    differences = [turned_difference(now, sound, side) for side in (DRIVER, DRIVEN)]
    for side, (turned, agreement) in enumerate(differences):
        teeth = now.frame.teeth[side]
        residuals = difference_residuals(now, turned, side)
        noises = []
        for lines, name in zip(residuals, now.channels, strict=True):
            n = turned.lines.shape[1]
            both = average_lines(now.channels[name], side)[1][:n] + average_lines(sound.channels[name], side)[1][:n]
            noises.append(both[lines[:n] != 0].sum() / 2.0 / mesh_power(now, now.channels[name], side))
        shorter = min(float(g.channels[n].counts[side].sum()) for g in (now, sound) for n in now.channels)
        longer = max(1.0, shorter / NOMINAL_REVOLUTIONS)
        yield from pattern_features(f"change.{SIDES[side]}", residuals, teeth, float(np.mean(noises)), longer)
        yield f"change.{SIDES[side]}.agreement", 10.0 * agreement
    for side, (turned, _) in enumerate(differences):
        yield from pattern_features(
            f"{SURPRISE}{SIDES[side]}",
            surprises(now, sound, turned, side),
            now.frame.teeth[side],
            noise=0.0,
            longer=0.0,
            least=LEAST_SURPRISE,
        )
    yield from apart_features(now, sound)
    yield from alike_features(now, sound)


def turned_difference(now: Gathered, sound: Gathered, side: int) -> tuple[ShaftLines, float]:
    """Return a shaft's lines less the sound ones, turned so that the same teeth meet, and how well they agreed."""
    return difference_lines(
        lines_of_shaft(now, side), lines_of_shaft(sound, side), whole_teeth=now.marks[DRIVER] or now.marks[DRIVEN]
    )


def difference_residuals(now: Gathered, turned: ShaftLines, side: int) -> list[NDArray[np.complex128]]:
    """Return each channel's difference without its smooth lines, over the mesh's amplitude."""
    residuals = []
    for row, sums in zip(turned.lines, now.channels.values(), strict=True):
        full = np.zeros(sums.lines[side].shape[1], dtype=np.complex128)
        full[: len(row)] = row
        scale = mesh_power(now, sums, side)
        residuals.append(residual_lines(full, turned.teeth, turned.highest_order, turned.other_teeth) / np.sqrt(scale))
    return residuals


def surprises(now: Gathered, sound: Gathered, turned: ShaftLines, side: int) -> list[NDArray[np.complex128]]:
    """Return each channel's difference, line by line over what noise and a mounting of its own would make of it.

    w[n] = d[n] / √(σ²[n] + (s |r[n]|)²), with σ² the power that noise leaves in both averages, |r|² the sound
    pattern's power about that order, s = `REPEATS`; scaled so that a sound machine's energy is about 1 all round,
    whatever the machine. A change counts where it is sure, and not where the vibration is loud.
    """
    found = []
    n = turned.lines.shape[1]
    own = lines_of_shaft(sound, side).lines
    for row, born, name in zip(turned.lines, own, now.channels, strict=True):
        noise = average_lines(now.channels[name], side)[1][:n] + average_lines(sound.channels[name], side)[1][:n]
        noise += LEAST_NOISE * mesh_power(now, now.channels[name], side) / n
        full = np.zeros(now.channels[name].lines[side].shape[1], dtype=np.complex128)
        full[:n] = row / np.sqrt(noise + REPEATS**2 * smooth_power(np.abs(born[:n]) ** 2))
        kept = residual_lines(full, turned.teeth, turned.highest_order, turned.other_teeth)
        found.append(kept * np.sqrt(2.0 / max(int(np.count_nonzero(kept)), 1)))
    return found


def lines_of_shaft(gathered: Gathered, side: int) -> ShaftLines:
    """Return the averages' lines in the form that the alignment takes."""
    lines = [average_lines(sums, side)[0] for sums in gathered.channels.values()]
    highest = visible_orders(gathered, side, min(len(row) for row in lines))
    frame = gathered.frame
    return ShaftLines(
        frame.shafts[side],
        frame.teeth[side],
        frame.teeth[1 - side],
        np.stack([row[: highest + 1] for row in lines]),
        int(gathered.n_revolutions * frame.shaft_orders[side]),
        highest,
        gathered.speed_hz * frame.shaft_orders[side],
        tuple(gathered.channels),
        gathered.marks[side],
    )
