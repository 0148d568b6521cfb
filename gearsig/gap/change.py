"""Features of a recording against a healthy reference of the same gears."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.features import Features, once, whole_record_variance
from gearsig.gap.frame import DRIVEN, DRIVER
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import NOMINAL_REVOLUTIONS, SIDES, Feature, average_lines, visible_orders
from gearsig.gap.tooth import mesh_power, pattern_features, residual_lines
from gearsig.severity.reference import difference_lines
from gearsig.severity.shaft_lines import ShaftLines


def change_features(now: Gathered, sound: Gathered) -> Features:
    """Return the differences of all features, and features of the difference of the averages.

    The reference's scatter counts as well: variances of both add.
    """
    (names, here), before = once(now), once(sound)[1]
    joined, values = _joined(names, here - before, now, sound)
    return _with_scatter(
        joined,
        values,
        np.stack([_joined(names, once(part)[1] - before, part, sound)[1] for part in _parts(now)]),
        np.stack([_joined(names, here - once(part)[1], now, part)[1] for part in _parts(sound)]),
    )


def change_once(now: Gathered, sound: Gathered) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of the change features, without their scatter."""
    (names, here), before = once(now), once(sound)[1]
    return _joined(names, here - before, now, sound)


def difference_features(now: Gathered, simulated: Gathered) -> Features:
    """Return the differences of all features alone: a simulation's flanks are not this machine's."""
    (names, here), before = once(now), once(simulated)[1]
    return _with_scatter(
        names,
        here - before,
        np.stack([once(part)[1] - before for part in _parts(now)]),
        np.stack([here - once(part)[1] for part in _parts(simulated)]),
    )


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
    for side in (DRIVER, DRIVEN):
        turned, agreement = turned_difference(now, sound, side)
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
        residuals.append(residual_lines(full, turned.teeth, turned.highest_order) / np.sqrt(scale))
    return residuals


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
