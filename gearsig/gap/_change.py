"""Features of a recording against a healthy reference of the same gears."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap._features import (
    Feature,
    Features,
    NamedValue,
    burst_features,
    clearness,
    feature_values,
    jackknife_variance,
    pattern_features,
    whole_and_parts,
    whole_record_variance,
)
from gearsig.gap._reduction import (
    DRIVEN,
    DRIVER,
    N_MESH_HARMONICS,
    ComplexArray,
    ReducedRecording,
    ShaftAverage,
    smooth_power,
)
from gearsig.rig import SIDES
from gearsig.severity import ShaftLines, difference_lines, reversed_channels

# --------------------
# The change of each mesh harmonic and of its surroundings: the harmonic itself, the part that either gear repeats, and
# the part that neither repeats.
#
# A changed path to a sensor alters all three equally. Evenly worn flanks change the harmonic alone. Friction also
# changes its surroundings. Rough flanks raise the repeated part and the noise, but not the harmonic. Teeth that
# separate raise the noise. Each segment, from half a tooth count below a harmonic to half above, is therefore compared
# with its level when the gears were healthy.
#
# Source of the separation into parts common to all teeth, to one gear, and to neither: R. B. Randall,
# *Vibration-based Condition Monitoring*, 2nd ed., 2021, chapter 5.
# --------------------


MESH, REPEATED, NOISE = range(3)
_PARTS = ("mesh", "repeated", "noise")
_PAIRS = ((MESH, REPEATED), (REPEATED, NOISE), (MESH, NOISE))

MIN_OVER_NOISE = (4.0, 0.5)
"""Minimum ratio to noise for a comparison: of a harmonic to the noise in its line; of all repeated lines to theirs."""

MAX_DB = 30.0
MIN_POWER = 1.0
"""dB²: changes of about a decibel agree by chance."""


def alike_features(now: ReducedRecording, healthy: ReducedRecording) -> Iterator[NamedValue]:
    """Yield medians, spreads and differences of the three parts' changes, in dB, over segments and channels.

    A feature is 0 where nothing that it compares exceeds the noise.
    """
    changes = segment_changes(now, healthy)
    for part, name in enumerate(_PARTS):
        level = changes[..., part]
        yield f"alike.{name}", _median(level)
        yield f"alike.{name}.spread", _rms(level - _median(level))
        yield f"alike.{name}.rise", _rise(level)
    for first, second in _PAIRS:
        name = f"alike.{_PARTS[first]}_{_PARTS[second]}"
        a, b = changes[..., first], changes[..., second]
        yield f"{name}.less", _median(a - b)
        yield f"{name}.apart", _rms(a - b)
        yield f"{name}.together", _agreement(a, b)


def segment_changes(now: ReducedRecording, healthy: ReducedRecording) -> FloatArray:
    """Return the changes of each mesh harmonic, of the repeated part around it and of the non-repeated part.

    Parameters
    ----------
    now, healthy : ReducedRecording
        Both with the same channels.

    Returns
    -------
    array, (n_channels, n_harmonics, 3)
        dB, within ± `MAX_DB`, in the order `MESH`, `REPEATED`, `NOISE`. nan where a part does not exceed the noise.
    """
    rows = []
    for name in now.channels:
        after, before = _segments(now, name), _segments(healthy, name)
        rows.append(np.clip(after - before, -MAX_DB, MAX_DB))
    changes: FloatArray = np.array(rows)
    return changes


def _segments(reduced: ReducedRecording, channel: str) -> FloatArray:
    """Return the levels of the three parts of each segment, (n_harmonics, 3), in dB."""
    power = np.zeros((N_MESH_HARMONICS, 3))
    floor = np.zeros((N_MESH_HARMONICS, 2))
    for side in (DRIVER, DRIVEN):
        average = reduced.average(channel, side)
        square, noise, teeth = np.abs(average.lines) ** 2, average.noise, average.teeth
        for k in range(1, N_MESH_HARMONICS + 1):
            low, high = round((k - 0.5) * teeth) + 1, round((k + 0.5) * teeth)
            if high > average.highest:
                power[k - 1] = np.nan
                continue
            is_own_sideband = np.arange(low, high) != k * teeth
            sideband_power, noise_power = square[low:high][is_own_sideband], noise[low:high][is_own_sideband]
            power[k - 1, REPEATED] += max(float(np.sum(sideband_power - noise_power)), 0.0)
            floor[k - 1, 1] += float(noise_power.sum())
            if side == DRIVER:
                power[k - 1, MESH], floor[k - 1, 0] = max(square[k * teeth] - noise[k * teeth], 0.0), noise[k * teeth]
                power[k - 1, NOISE] = float(noise_power.sum()) * average.n_revolutions
    is_clear = np.column_stack([power[:, :2] > np.array(MIN_OVER_NOISE) * floor, power[:, NOISE] > 0.0])
    levels: FloatArray = 10.0 * np.log10(np.where(is_clear, power, np.nan))
    return levels


def _finite(values: FloatArray) -> FloatArray:
    finite: FloatArray = values[np.isfinite(values)]
    return finite


def _median(values: FloatArray) -> float:
    finite = _finite(values)
    return float(np.median(finite)) if len(finite) else 0.0


def _rms(values: FloatArray) -> float:
    finite = _finite(values)
    return float(np.sqrt(np.mean(finite**2))) if len(finite) else 0.0


def _rise(values: FloatArray) -> float:
    """Return the mean step from one harmonic to the next, in dB."""
    steps = [values[:, b] - values[:, a] for a, b in pairwise(range(values.shape[1]))]
    finite = _finite(np.array(steps))
    return float(finite.mean()) if len(finite) else 0.0


def _agreement(a: FloatArray, b: FloatArray) -> float:
    """Return 10 (2 Σ ab)/(Σ a² + Σ b² + n): 10 for equal large changes, −10 for opposite ones."""
    is_known = np.isfinite(a) & np.isfinite(b)
    x, y = a[is_known], b[is_known]
    return float(20.0 * np.sum(x * y) / (np.sum(x**2 + y**2) + MIN_POWER * max(len(x), 1)))


# --------------------
# Whether all channels changed equally: a change of the excitation, or of one sensor's path.
# --------------------


def apart_features(now: ReducedRecording, healthy: ReducedRecording) -> Iterator[NamedValue]:
    """Yield the differences between the channels' changes, RMS in dB; 0 where there is one channel.

    A stronger excitation of the gears reaches every sensor through its own path. A remounted sensor, or a bearing that
    supports its shaft less, changes the paths, each differently.
    """
    after, before = _mesh_levels(now), _mesh_levels(healthy)
    n = min(after.shape[1], before.shape[1])  # the faster recording has fewer
    yield "apart.mesh", _scatter(after[:, :n] - before[:, :n])
    yield "apart.floor", _scatter(_floor_levels(now) - _floor_levels(healthy))


def _scatter(changes: FloatArray) -> float:
    """Return the RMS of all deviations from the channels' mean."""
    return float(np.sqrt(np.mean((changes - changes.mean(axis=0)) ** 2))) if len(changes) > 1 else 0.0


def _mesh_levels(reduced: ReducedRecording) -> FloatArray:
    """Return the mesh harmonics' levels, (n_channels, n_harmonics), in dB."""
    return _decibels(np.array([average.mesh_lines for average in reduced.averages(DRIVER)]))


def _floor_levels(reduced: ReducedRecording) -> FloatArray:
    """Return the residual's band levels, (n_channels, n_bands), in dB."""
    return _decibels(np.array([sums.moments.mean(axis=0)[:, 0] for sums in reduced.channels.values()]))


def _decibels(power: FloatArray) -> FloatArray:
    levels: FloatArray = 10.0 * np.log10(np.maximum(power, 1e-300))
    return levels


MIN_NOISE = 1e-8
"""Power of all lines together relative to the mesh: two gears of equal teeth leave nothing of their own in an
average."""

MIN_SURPRISE = 0.1
"""Energy below any that a healthy machine's own noise causes: with two gears of equal teeth, one has no average of its
own, and rounding errors in it are no evidence."""

REPEATS = 0.1
"""Relative variation of a healthy machine's pattern from day to day, see `normalised_differences`."""


def change_features(now: ReducedRecording, healthy: ReducedRecording) -> Features:
    """Return the differences of all features, and features of the difference of the averages.

    The reference's scatter is included: variances add, SE² = SE²_now + SE²_healthy, each from the jackknife over blocks
    of revolutions.

    Parameters
    ----------
    now : ReducedRecording
        The recording.
    healthy : ReducedRecording
        The reference, with the same channels and the same gears.

    Returns
    -------
    Features
        dB, or ten times the decadic logarithm; positive where the recording has more.
    """
    (names, after), before = whole_and_parts(now), whole_and_parts(healthy)[1]
    joined, values = _joined(names, after[0] - before[0], now, healthy)
    parts, healthy_parts = now.leaving_one_out(), healthy.leaving_one_out()
    return _with_scatter(
        joined,
        values,
        np.stack([_joined(names, v - before[0], part, healthy)[1] for v, part in zip(after[1:], parts, strict=True)]),
        np.stack(
            [_joined(names, after[0] - v, now, part)[1] for v, part in zip(before[1:], healthy_parts, strict=True)]
        ),
    )


def change_feature_values(now: ReducedRecording, healthy: ReducedRecording) -> tuple[tuple[str, ...], FloatArray]:
    """Return the change features without their scatter, for example of single simulations.

    Parameters
    ----------
    now, healthy : ReducedRecording
        As in `change_features`.

    Returns
    -------
    names : tuple of str, (n,)
    values : array, (n,)
        dB, or ten times the decadic logarithm.
    """
    (names, after), before = feature_values(now), feature_values(healthy)[1]
    return _joined(names, after - before, now, healthy)


def difference_features(
    now: ReducedRecording, simulated: ReducedRecording, credibility: FloatArray | float = 1.0
) -> Features:
    """Return the differences of all features only, as a simulation's flanks are not those of this machine.

    Parameters
    ----------
    now, simulated : ReducedRecording
    credibility : array, (n_features,), or float
        Fraction of each simulated feature that is subtracted, see `credibility_of`.
    """
    (names, measured), before = whole_and_parts(now), credibility * whole_and_parts(simulated)[1]
    return _with_scatter(names, measured[0] - before[0], measured[1:] - before[0], measured[0] - before[1:])


def _with_scatter(names: tuple[str, ...], values: FloatArray, *left_out: FloatArray) -> Features:
    variance = 2.0 * whole_record_variance(names)
    for rows in left_out:
        variance += jackknife_variance(rows)
    return Features(names, values, np.sqrt(variance), left_out)


def _joined(
    names: tuple[str, ...], differences: FloatArray, now: ReducedRecording, healthy: ReducedRecording
) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of the differences, followed by the features of the patterns."""
    patterns = dict(_patterns(now, healthy))
    return (*names, *patterns), np.concatenate([differences, list(patterns.values())])


def _patterns(now: ReducedRecording, healthy: ReducedRecording) -> Iterator[NamedValue]:
    """Yield the tooth features of the difference of the averages, rotated so that the same teeth coincide."""
    differences = [turned_difference(now, healthy, side) for side in (DRIVER, DRIVEN)]
    bursts = []
    for side, (turned, agreement) in enumerate(differences):
        residuals, n = difference_residuals(now, turned, side), turned.lines.shape[1]
        pairs = [(now.average(name, side), healthy.average(name, side)) for name in now.channels]
        noise = np.array([after.noise[:n] + before.noise[:n] for after, before in pairs])
        bursts.append((turned.lines, noise, turned.teeth))
        noises = [
            of_lines[lines[:n] != 0].sum() / 2.0 / after.mesh_power
            for lines, of_lines, (after, _) in zip(residuals, noise, pairs, strict=True)
        ]
        longer = min(average.longer for pair in pairs for average in pair)
        yield from pattern_features(f"change.{SIDES[side]}", residuals, turned.teeth, float(np.mean(noises)), longer)
        yield f"change.{SIDES[side]}.agreement", 10.0 * agreement
    for side, (turned, _) in enumerate(differences):
        yield from pattern_features(
            f"surprise.{SIDES[side]}",
            normalised_differences(now, healthy, turned, side),
            now.frame.teeth[side],
            noise=0.0,
            longer=0.0,
            minimum=MIN_SURPRISE,
        )
    yield from apart_features(now, healthy)
    yield from alike_features(now, healthy)
    yield from burst_features(*max(bursts, key=lambda burst: clearness(*burst)))


def turned_difference(now: ReducedRecording, healthy: ReducedRecording, side: int) -> tuple[ShaftLines, float]:
    """Return a shaft's lines less the healthy ones, rotated so that the same teeth coincide, and their agreement."""
    return difference_lines(
        lines_of_shaft(now, side), lines_of_shaft(healthy, side), whole_teeth=now.marks[DRIVER] or now.marks[DRIVEN]
    )


def as_mounted(now: ReducedRecording, healthy: ReducedRecording) -> tuple[ReducedRecording, tuple[str, ...]]:
    """Return a reference whose channels have the signs of the recording's, and the names of those inverted."""
    lines_now, lines_healthy = (lines_of_shaft(reduced, DRIVER) for reduced in (now, healthy))
    names = reversed_channels(lines_now, lines_healthy, whole_teeth=now.marks[DRIVER] or now.marks[DRIVEN])
    return healthy.turned_about(names) if names else healthy, names


def difference_residuals(now: ReducedRecording, turned: ShaftLines, side: int) -> list[ComplexArray]:
    """Return each channel's difference without its smooth lines, relative to the mesh amplitude."""
    return [
        average.residual(_filled(row, average)) / np.sqrt(average.mesh_power)
        for row, average in zip(turned.lines, now.averages(side), strict=True)
    ]


def _filled(row: ComplexArray, average: ShaftAverage) -> ComplexArray:
    """Return lines padded with zeros to the average's length."""
    return np.pad(row, (0, len(average.lines) - len(row)))


def normalised_differences(
    now: ReducedRecording, healthy: ReducedRecording, turned: ShaftLines, side: int
) -> list[ComplexArray]:
    """Return each channel's difference, line by line relative to its expected size from noise and remounting.

    w[n] = d[n] / √(σ²[n] + (s |r[n]|)²), with σ² the noise power in both averages, |r|² the healthy pattern's power
    around that order, s = `REPEATS`; scaled so that a healthy machine's energy is about 1 everywhere, whatever the
    machine. Changes thus count by their certainty, not by the level of vibration.
    """
    by_channel = []
    n = turned.lines.shape[1]
    healthy_lines = lines_of_shaft(healthy, side).lines
    for row, born, name in zip(turned.lines, healthy_lines, now.channels, strict=True):
        average = now.average(name, side)
        noise = average.noise[:n] + healthy.average(name, side).noise[:n] + MIN_NOISE * average.mesh_power / n
        expected = np.sqrt(noise + REPEATS**2 * smooth_power(np.abs(born[:n]) ** 2))
        kept = average.residual(_filled(row / expected, average))
        by_channel.append(kept * np.sqrt(2.0 / max(int(np.count_nonzero(kept)), 1)))
    return by_channel


def lines_of_shaft(reduced: ReducedRecording, side: int) -> ShaftLines:
    """Return the averages' lines in the form required for alignment."""
    averages, frame = reduced.averages(side), reduced.frame
    highest = averages[0].highest
    return ShaftLines(
        frame.shafts[side],
        frame.teeth[side],
        frame.teeth[1 - side],
        np.stack([average.lines[: highest + 1] for average in averages]),
        int(reduced.n_revolutions * frame.shaft_orders[side]),
        highest,
        reduced.speed_hz * frame.shaft_orders[side],
        tuple(reduced.channels),
        reduced.marks[side],
    )


# --------------------
# Levels relative to the mesh harmonics, and the part of their change that is their own.
# --------------------


def change_relative_to_mesh(names: Sequence[str], distances: FloatArray) -> FloatArray:
    """Return changes of levels as far as they hold both relative to the mesh harmonics and by themselves.

    If the mesh alone falls by 6 dB, all levels relative to it rise by as much although none of them has changed; if a
    sensor's gain rises, everything except the ratios does. The smaller of the two changes counts, or 0 where their
    signs differ.

    Parameters
    ----------
    names : sequence of str
    distances : array, (…, n)
        dB.
    """
    if "mesh.total" not in names:
        return distances
    mesh = distances[..., [list(names).index("mesh.total")]]
    sign = counted_from_the_mesh(names)
    another = distances + sign * mesh
    smaller = np.sign(distances) * np.minimum(np.abs(distances), np.abs(another))
    held: FloatArray = np.where(sign == 0.0, distances, np.where(distances * another > 0.0, smaller, 0.0))
    return held


def counted_from_the_mesh(names: Sequence[str]) -> FloatArray:
    """Return +1 for levels relative to the mesh, which plus the mesh give a level; −1 for levels; 0 for all else."""
    features = [Feature.of(name) for name in names]
    return np.array([1.0 if f.is_relative else -1.0 if f.is_shaft_level else 0.0 for f in features])


# --------------------
# Input of a forest from a change: sizes, directions, and which of two places changed more.
# --------------------


_OF_A_SHAFT = (
    ("shaft.{}.2", "shaft.{}.1"),
    ("shaft.{}.3", "shaft.{}.2"),
    ("shaft.{}.strongest.to_mesh", "shaft.{}.1"),
    ("shaft.{}.strongest.to_mesh", "shaft.{}.2"),
    ("shaft.{}.1", "sideband.{}.1"),
    ("shaft.{}.2", "sideband.{}.2"),
    ("sideband.{}.2", "sideband.{}.1"),
    ("sideband.{}.3to5", "sideband.{}.1"),
    ("sideband.{}.6to12", "sideband.{}.1"),
    ("tooth.{}.level", "sideband.{}.1"),
    ("tooth.{}.peak", "tooth.{}.level"),
    ("tooth.{}.prominence", "tooth.{}.level"),
)
_OF_A_DIFFERENCE = (
    ("surprise.{}.level", "sideband.{}.1"),
    ("surprise.{}.peak", "surprise.{}.level"),
    ("surprise.{}.kurtosis", "surprise.{}.level"),
    ("surprise.{}.second", "surprise.{}.prominence"),
)
_BETWEEN_SHAFTS = ("sideband.{}.1", "sideband.{}.6to12", "shaft.{}.1", "shaft.{}.2", "tooth.{}.level")
_OF_ALL = (
    ("envelope.outer", "envelope.inner"),
    ("envelope.outer", "envelope.ball"),
    ("envelope.inner", "envelope.ball"),
    ("envelope.inner", "envelope.strange"),
    ("envelope.outer", "envelope.strange"),
    ("line.outer", "envelope.outer"),
    ("floor.total", "mesh.total"),
    ("floor.band.4", "floor.band.1"),
    ("floor.kurtosis.4", "floor.band.4"),
    ("raw.near_the_extreme", "raw.kurtosis"),
)


def contrast_rows(names: Sequence[str], distances: FloatArray) -> FloatArray:
    """Return part of the rows to which a forest is fitted.

    Simulators and machines agree on which lines an effect changes and in which direction, but not on how much. Besides
    the compressed sizes, the rows therefore contain their ratios to the largest change, and differences that
    distinguish one effect from another.

    Parameters
    ----------
    names : sequence of str
        Names of changes, see `change_features` and `difference_features`.
    distances : array, (n_rows, n)
        Changes in units of those that healthy machines reach.

    Returns
    -------
    array, (n_rows, m)
    """
    size = np.sign(distances) * np.log1p(np.abs(distances))
    largest = np.maximum(np.abs(size).max(axis=1, keepdims=True), 1e-9)
    place = {name: i for i, name in enumerate(names)}
    apart = [size[:, place[a]] - size[:, place[b]] for a, b in _pairs(place)]
    mesh = np.stack(
        [size[:, place[f"mesh.share.{k}"]] + size[:, place["mesh.total"]] for k in range(1, N_MESH_HARMONICS + 1)]
    )
    rows: FloatArray = np.column_stack([size, size / largest, *apart, mesh.min(axis=0), mesh.max(axis=0)])
    return rows


def _pairs(place: dict[str, int]) -> list[tuple[str, str]]:
    of_a_shaft = _OF_A_SHAFT + _OF_A_DIFFERENCE
    pairs = [(a.format(side), b.format(side)) for side in SIDES for a, b in of_a_shaft]
    pairs += [(name.format(SIDES[0]), name.format(SIDES[1])) for name in _BETWEEN_SHAFTS]
    return [pair for pair in (*pairs, *_OF_ALL) if pair[0] in place and pair[1] in place]


def columns_with_shafts_swapped(names: Sequence[str]) -> np.ndarray:
    """Return the columns of the features with driver and driven gear exchanged.

    A fault of the driven gear changes that gear's features as the same fault of the driver changes the driver's.
    """
    place = {name: i for i, name in enumerate(names)}
    return np.array([place[str(Feature.of(name).mirrored)] for name in names])
