"""Levels of the lines that the machine's kinematics give, and of those that belong to nothing it does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import ceil, floor, log10

import numpy as np
from scipy.ndimage import maximum_filter1d

from gearsig.checks import FloatArray
from gearsig.comparison._averages import HalvedLines, agreement
from gearsig.comparison._types import (
    BandLevel,
    LevelPair,
    LineKind,
    LineLevel,
    amplitude_error_db,
    decibel,
    power_levels,
)
from gearsig.prepared import lines_over_floor
from gearsig.rig import OrderLine, Rig, order_lines
from gearsig.spectra import Spectrum, noise_floor, power_density

OTHER_OVER_FLOOR_DB = 15.0
"""A line that belongs to nothing must stand out so far: noise does so in one line of 10¹³."""
_PRIORITY = {"mesh": 0, "shaft": 1, "sideband": 2}


def line_levels(
    rig: Rig, reference: str, lines: Mapping[str, tuple[HalvedLines, HalvedLines]], channel: int
) -> tuple[LineLevel, ...]:
    """Return mesh harmonics, sidebands and shaft orders of one channel, by rising order; each order once."""
    levels: dict[float, LineLevel] = {}
    for line in sorted(expected_lines(rig, reference), key=lambda expected: _PRIORITY[expected.kind]):
        shaft, order = _shaft_of(line, rig, lines), round(line.order, 6)
        ratio = rig.ratio(shaft, to=reference) if rig.shafts else 1.0
        if shaft not in lines or ratio is None:
            continue
        n = round(line.order / ratio)
        if abs(n * ratio - line.order) > 1e-6 * line.order or order in levels:
            continue
        if 1 <= n < lines[shaft][0].first.shape[1]:
            kind: LineKind = line.kind  # type: ignore[assignment]  # `expected_lines` has no others
            (simulated_db, simulated_error, simulated_is_seen), (recorded_db, recorded_error, recorded_is_seen) = (
                _read(side, channel, n) for side in lines[shaft]
            )
            level = LevelPair(simulated_db, recorded_db, float(np.hypot(simulated_error, recorded_error)))
            levels[order] = LineLevel(line.label, kind, line.order, shaft, level, simulated_is_seen, recorded_is_seen)
    return tuple(levels[order] for order in sorted(levels))


def expected_lines(rig: Rig, reference: str) -> tuple[OrderLine, ...]:
    """Return the lines that turn with the shafts; the reference shaft's harmonics alone where no gears are known."""
    if not rig.shafts:
        name = reference or "shaft"
        return tuple(OrderLine(float(k), "shaft", f"{k}× {name}", name, k) for k in range(1, 13))
    lines = order_lines(rig, reference, n_mesh_harmonics=10, n_shaft_harmonics=4 if rig.pairs else 12, n_sidebands=3)
    return tuple(line for line in lines if line.kind in _PRIORITY and line.order > 0)


def _shaft_of(line: OrderLine, rig: Rig, averages: Mapping[str, object]) -> str:
    """Return the shaft in whose average a line is a whole order."""
    if not rig.shafts:
        return next(iter(averages))
    if line.kind == "shaft":
        return line.element
    if line.kind == "sideband":
        return line.modulating_shaft
    pair = rig.pair(line.element)
    return next((s for s in (pair.driver, pair.driven) if pair.teeth(s) is not None and s in averages), pair.driver)


def _read(lines: HalvedLines, channel: int, n: int) -> tuple[float, float, bool]:
    """Return level, its standard error, and whether the line is seen."""
    amplitudes, noise = np.abs(lines.whole[channel]), lines.noise()[channel, n]
    strongest = float(np.max(amplitudes[1:] ** 2, initial=0.0))
    is_seen = bool(amplitudes[n] > 3.0 * noise)  # noise alone is so high in one line of 8000
    # What is not seen is at most the noise: the level is a bound then.
    level_or_noise = amplitudes[n] if is_seen else max(amplitudes[n], noise)
    level = float(decibel(np.array([level_or_noise**2]), strongest)[0])
    return level, float(amplitude_error_db(np.array([level_or_noise]), np.array([noise]))[0]), is_seen


def other_lines(
    simulated: Sequence[Spectrum],
    recorded: Sequence[Spectrum],
    ratios: Sequence[float],
    mesh_orders: Sequence[float],
    highest: float,
) -> tuple[LineLevel, ...]:
    """Return the strongest lines of either record that are no whole order of any shaft, strongest first.

    Parameters
    ----------
    simulated, recorded : sequence of Spectrum
        Mean square over order, of the halves.
    ratios, mesh_orders : sequences of float
        Orders of the shafts and the meshes.
    highest : float
        Order up to which they are looked for.
    """
    places: dict[int, None] = {}
    for spectra in (recorded, simulated):
        places |= dict.fromkeys(_strongest(spectra, ratios, mesh_orders, highest))
    step = recorded[0].resolution
    levels: list[tuple[int, LineLevel]] = []
    for line in sorted(places):
        if any(abs(line - near) <= 3 for near, _ in levels):
            continue
        label = other_label(line * step, mesh_orders)
        levels.append((line, _other_level(label, line * step, line, simulated, recorded)))
    kept = sorted(
        (level for _, level in levels), key=lambda level: -max(level.level.recorded_db, level.level.simulated_db)
    )
    return tuple(kept[:10])


def _strongest(
    halves: Sequence[Spectrum], ratios: Sequence[float], mesh_orders: Sequence[float], highest: float
) -> list[int]:
    """Return the strongest local maxima outside of the shafts' own lines that both halves show, at most five."""
    ratios_db, masked = [], None
    for half in halves:
        excess = lines_over_floor(half, noise_floor(half).values)
        for fundamental in (*ratios, *mesh_orders):
            excess = excess.without_multiples(fundamental)
        floor = np.maximum(excess.floor, 1e-300)
        ratios_db.append(10.0 * np.log10(np.maximum(half.values, 1e-300) / floor))
        masked = excess.masked
    power = np.mean([half.values for half in halves], axis=0)
    inner = power[1:-1]
    is_peak = np.r_[False, (inner >= power[:-2]) & (inner > power[2:]), False] & ~np.asarray(masked)
    is_peak &= np.min(ratios_db, axis=0) > OTHER_OVER_FLOOR_DB
    is_peak &= np.arange(len(power)) * halves[0].resolution <= highest
    # A peak within one order of a line 20 dB stronger is that line's foot, smeared by a wandering speed.
    is_peak &= power > 0.01 * maximum_filter1d(power, 2 * round(1.0 / halves[0].resolution) + 1)
    lines = np.flatnonzero(is_peak)
    return [int(line) for line in lines[np.argsort(-power[lines])][:5]]


def other_label(order: float, mesh_orders: Sequence[float]) -> str:
    """Name a line by its order, and by its distance from the mesh harmonic that it may be a sideband of.

    Examples
    --------
    >>> other_label(17.86, [23.0]), other_label(5.15, [23.0])
    ('order 17.86 (1× mesh − 5.14)', 'order 5.15')
    """
    near = [(abs(order - k * m), k, m) for m in mesh_orders if (k := round(order / m)) >= 1]
    if not near:
        return f"order {order:.5g}"
    _, k, mesh = min(near)
    off = order - k * mesh
    return f"order {order:.5g} ({k}× mesh {'+' if off > 0 else '−'} {abs(off):.4g})"


def _other_level(
    label: str, order: float, line: int, simulated: Sequence[Spectrum], recorded: Sequence[Spectrum]
) -> LineLevel:
    """Read both records at one order; a slightly other speed or slip may move the line by one."""
    levels, errors, are_seen = [], [], []
    for halves in (simulated, recorded):
        power = np.stack([half.values for half in halves])
        near = slice(max(line - 1, 0), line + 2)
        peaks: FloatArray = power[:, near].max(axis=1)
        floor = np.mean([float(noise_floor(half).values[line]) for half in halves])
        a, b = decibel(peaks, float(power.max()))
        levels.append(float(decibel(np.array([peaks.mean()]), float(power.max()))[0]))
        errors.append(abs(float(a - b)) / 2.0)
        are_seen.append(bool(10.0 * np.log10(max(peaks.min(), 1e-300) / max(floor, 1e-300)) > OTHER_OVER_FLOOR_DB))
    level = LevelPair(levels[0], levels[1], float(np.hypot(errors[0], errors[1])))
    return LineLevel(label, "other", order, "", level, are_seen[0], are_seen[1])


OCTAVE_RATIO = 10.0**0.3
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
    block_s = min(4.0, shortest_s / 2.0)
    # Four lines in the lowest band; above 45 % of the sampling rate anti-aliasing filters have taken over.
    lowest = 4 / block_s / (OCTAVE_RATIO ** (1 / 6) - OCTAVE_RATIO ** (-1 / 6))
    limits = third_octave_limits(lowest, 0.45 * min(simulated_rate_hz, recorded_rate_hz))
    if not limits:
        return ()
    powers = []
    for halves, rate in ((simulated, simulated_rate_hz), (recorded, recorded_rate_hz)):
        densities = [power_density(half, rate, n_per_block=max(2, round(block_s * rate))) for half in halves]
        powers.append(np.stack([band_powers(d, [(low, high) for _, low, high in limits]) for d in densities]))
    levels = power_levels(*powers)
    return tuple(
        BandLevel(f"{nominal / 1000:g} kHz" if nominal >= 1000 else f"{nominal:.4g} Hz", low, high, "frequency", level)
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
        n = min(int(highest / mesh_order - 0.5), 10)
        around = [(f"around {k}× mesh {name}".rstrip(), (k - 0.5) * mesh_order) for k in range(1, n + 1)]
        return (("below the mesh", 0.5, 0.5 * mesh_order), *((label, low, low + mesh_order) for label, low in around))
    edges = np.linspace(0.5, highest, 11)
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
    simulated_powers, recorded_powers = (
        np.stack([band_powers(half, edges) for half in halves]) for halves in (simulated, recorded)
    )
    bands = []
    for (label, low, high), level in zip(limits, power_levels(simulated_powers, recorded_powers), strict=True):
        inside = slice(max(1, ceil(low)), min(ceil(high), lines[0].first.shape[1]))
        alike = agreement(*lines, channel, inside) if inside.stop > inside.start + 1 else None
        bands.append(BandLevel(label, low, high, "order", level, alike))
    return tuple(bands)
