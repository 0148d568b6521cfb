"""Corresponding lines of both records: those of a shaft's averages, those that kinematics give, and all others."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, floor, log10

import numpy as np
from scipy.ndimage import maximum_filter1d

from gearsig.angle import AngleSignal
from gearsig.checks import ComplexArray, FloatArray
from gearsig.comparison._types import (
    Agreement,
    Alignment,
    BandLevel,
    LevelPair,
    LineKind,
    LineLevel,
    RepeatableValue,
    amplitude_error_db,
    decibel,
    power_levels,
)
from gearsig.errors import InputError
from gearsig.orders import average_lines, revolution_of_lines
from gearsig.prepared import best_shift, lines_over_floor, shift_scores, turned_lines
from gearsig.rig import OrderLine, Rig, order_lines
from gearsig.spectra import Spectrum, noise_floor, power_density


@dataclass(frozen=True)
class HalvedLines:
    """Complex rms amplitudes of the whole orders of a shaft, from order 0.

    Parameters
    ----------
    first, second : complex array, (n_channels, n_orders)
        Of the two halves.
    n_revolutions : int
        Of both halves together.
    """

    first: ComplexArray
    second: ComplexArray
    n_revolutions: int

    @property
    def whole(self) -> ComplexArray:
        """Lines of the whole record: the mean of its halves."""
        return 0.5 * (self.first + self.second)

    def turned(self, shift_rev: float) -> HalvedLines:
        """Return the lines of the average turned forward by `shift_rev`."""
        return replace(self, first=turned_lines(self.first, shift_rev), second=turned_lines(self.second, shift_rev))

    def up_to(self, highest: int) -> HalvedLines:
        """Return the lines up to an order."""
        return replace(self, first=self.first[:, : highest + 1], second=self.second[:, : highest + 1])

    def noise(self) -> FloatArray:
        """Return the standard error of `whole`, rms over both quadratures, (n_channels, n_orders).

        |a - b|/2 of the halves' amplitudes, or its rms over neighbouring lines if that is larger.
        """
        square = 0.25 * np.abs(self.first - self.second) ** 2
        square[:, 0] = square[:, 1]  # a sensor's drift does not represent the noise around the shaft's lines
        reach = 4  # nine lines: the scatter of one line between two halves says little
        padded = np.pad(square, ((0, 0), (reach, reach)), mode="reflect" if square.shape[1] > reach else "edge")
        kernel = np.ones(9) / 9
        smooth = np.stack([np.convolve(row, kernel, mode="valid") for row in padded])
        result: FloatArray = np.sqrt(np.maximum(square, smooth))
        return result


def halved_lines(halves: Sequence[AngleSignal]) -> HalvedLines:
    """Return the lines of the averages of two halves, their revolutions weighted by a Hann window.

    The window reduces leakage from another shaft's order near a whole one, so that records of different lengths are
    compared by their lines, not by leakage.
    """
    first, second = (average_lines(half, weighting="hann", scaling="amplitude rms") for half in halves)
    return HalvedLines(first.whole, second.whole, int(first.n_revolutions.sum() + second.n_revolutions.sum()))


def waveform(lines: ComplexArray, n_angles: int) -> FloatArray:
    """Return one revolution, (n_angles,), of one channel's rms amplitudes, without its mean."""
    return revolution_of_lines(lines, n_angles, "amplitude rms")


def align(
    shaft: str, simulated: HalvedLines, recorded: HalvedLines, n_teeth: int | None, *, by_marks: bool
) -> Alignment:
    """Return the shift of the simulation's average with the largest correlation, or none if marks are trusted.

    ρ(s) = Σ_c Re Σ_n Y_c[n] X_c*[n] e^{2πi n s} / (|X_c| |Y_c|) / n_channels, with the lines X of the simulation and Y
    of the recording, all channels c together, since the same shaft turns under all sensors.

    Parameters
    ----------
    shaft : str
    simulated, recorded : HalvedLines
        Up to the same order.
    n_teeth : int or None
        For deciding whether the shift is certain to the tooth.
    by_marks : bool
        Whether to leave the simulation as it is, because both count from a mark.
    """
    x, y = simulated.whole, recorded.whole
    cross = _cross_spectrum(x, y)
    best = best_shift(cross)
    shifts = [
        best_shift(_cross_spectrum(a, b))
        for a, b in ((simulated.first, y), (simulated.second, y), (x, recorded.first), (x, recorded.second))
    ]
    spread = np.hypot(_angle_distance_rev(shifts[0], shifts[1]), _angle_distance_rev(shifts[2], shifts[3])) / 2.0
    certain = None if n_teeth is None else _is_certain(x, y, best, shifts, n_teeth)
    if by_marks:
        gain = float(shift_scores(cross, np.array([best]))[0] - shift_scores(cross, np.zeros(1))[0])
        return Alignment(shaft, "marks", 0.0, 0.0, certain, 360.0 * best, gain)
    return Alignment(shaft, "correlation", 360.0 * best, 360.0 * float(spread), certain)


def _cross_spectrum(x: ComplexArray, y: ComplexArray) -> ComplexArray:
    """Return the cross spectrum, each channel normalised, averaged over the channels, without the mean value."""
    product = y * np.conj(x)
    product[:, 0] = 0.0
    size = np.sqrt(np.sum(np.abs(x[:, 1:]) ** 2, axis=1) * np.sum(np.abs(y[:, 1:]) ** 2, axis=1))
    cross: ComplexArray = np.divide(product, size[:, None], out=np.zeros_like(product), where=size[:, None] > 0)
    mean: ComplexArray = cross.mean(axis=0)
    return mean


def _angle_distance_rev(a: float, b: float) -> float:
    """Return the distance of two angles, 0 to 0.5 revolutions."""
    return abs((a - b + 0.5) % 1.0 - 0.5)


def _is_certain(x: ComplexArray, y: ComplexArray, best: float, shifts: list[float], n_teeth: int) -> bool:
    """Return whether all halves give the same tooth, and differences between teeth are alike in both records.

    The mesh harmonics are left out of the second test, as they do not distinguish teeth.
    """
    if max(_angle_distance_rev(best, shift) for shift in shifts) >= 0.5 / n_teeth:
        return False
    is_beside_mesh = np.arange(x.shape[1]) % n_teeth != 0
    alike = shift_scores(
        _cross_spectrum(np.where(is_beside_mesh, x, 0.0), np.where(is_beside_mesh, y, 0.0)), np.array([best])
    )[0]
    return bool(alike > 0.5)  # patterns of different gears reach 0.3 to 0.4 at the best tooth


Figure = Callable[[ComplexArray, ComplexArray], float]


def frac(x: ComplexArray | FloatArray, y: ComplexArray | FloatArray) -> float:
    """Return the frequency response assurance criterion of two sets of lines, here of order lines.

    FRAC = |Σ x y*|² / (Σ|x|² Σ|y|²): 1 if one is a multiple of the other, for any (complex) factor.

    Two runs of a machine have no coherence in the usual sense: their noise is independent, and only what is locked to
    the shaft repeats. Over the lines of two synchronous averages aligned in angle, FRAC takes the place of coherence:
    it is the share of energy that one complex factor maps from one to the other. With magnitudes instead of complex
    lines, it needs no alignment, and ignores the phases of the path.

    Parameters
    ----------
    x, y : array, (n_lines,)

    Returns
    -------
    float
        0 to 1; 0 if one has no energy.

    Raises
    ------
    InputError
        If the lengths differ.

    References
    ----------
    W. Heylen, S. Lammens, "FRAC: a consistent way of comparing frequency response functions", 1996.

    Examples
    --------
    >>> frac(np.array([1.0, 2j]), np.array([3.0, 6j]))
    1.0
    """
    if np.shape(x) != np.shape(y):
        raise InputError(f"x has {np.shape(x)} lines, y {np.shape(y)}", allowed="equal lengths")
    size = float(np.sum(np.abs(x) ** 2)) * float(np.sum(np.abs(y) ** 2))
    return float(np.abs(np.vdot(y, x)) ** 2) / size if size > 0 else 0.0


def correlation(x: ComplexArray, y: ComplexArray) -> float:
    """Return the correlation coefficient of two averages from their lines (without order 0): Re Σ x y*/(|x| |y|)."""
    size = float(np.sqrt(np.sum(np.abs(x) ** 2) * np.sum(np.abs(y) ** 2)))
    return float(np.vdot(y, x).real) / size if size > 0 else 0.0


def repeated(
    figure: Figure, simulated: HalvedLines, recorded: HalvedLines, channel: int, part: slice
) -> RepeatableValue:
    """Return a figure of one channel's lines, with its scatter when either record is halved.

    Half of f(x₁, y) - f(x₂, y) and half of f(x, y₁) - f(x, y₂), added as squares.
    """
    x, y = simulated.whole[channel, part], recorded.whole[channel, part]
    by_simulation = figure(simulated.first[channel, part], y) - figure(simulated.second[channel, part], y)
    by_recording = figure(x, recorded.first[channel, part]) - figure(x, recorded.second[channel, part])
    return RepeatableValue(figure(x, y), float(np.hypot(by_simulation, by_recording)) / 2.0)


def agreement(simulated: HalvedLines, recorded: HalvedLines, channel: int, part: slice) -> Agreement:
    """Return FRAC of the lines in a part of the orders, complex and of magnitudes."""
    x, y = np.abs(simulated.whole[channel, part]) ** 2, np.abs(recorded.whole[channel, part]) ** 2
    size = float(x.sum() * y.sum())
    # The mean of |Σ x y* exp(2πi n s)|² over all shifts s is Σ |x|² |y|².
    chance = float(np.sum(x * y)) / size if size > 0 else 0.0
    return Agreement(
        repeated(frac, simulated, recorded, channel, part),
        repeated(lambda a, b: frac(np.abs(a), np.abs(b)), simulated, recorded, channel, part),
        chance,
        len(x),
    )


def reliability(lines: HalvedLines, channel: int) -> float:
    """Return how well an average repeats: r = 2ρ/(1 + ρ) with the correlation ρ of its halves, at least 0.

    References
    ----------
    C. Spearman, "Correlation calculated from faulty data", 1910. W. Brown, "Some experimental results in the
    correlation of mental abilities", 1910.
    """
    rho = max(correlation(lines.first[channel, 1:], lines.second[channel, 1:]), 0.0)
    return 2.0 * rho / (1.0 + rho)


def tooth_levels(
    simulated: HalvedLines, recorded: HalvedLines, channel: int, n_teeth: int, n_angles: int
) -> tuple[LevelPair, ...]:
    """Return the level of the averages in each tooth pitch, from shaft angle 0 on."""
    simulated_powers, recorded_powers = (
        np.stack([tooth_powers(waveform(half[channel], n_angles), n_teeth) for half in (lines.first, lines.second)])
        for lines in (simulated, recorded)
    )
    return power_levels(simulated_powers, recorded_powers, smooth=n_teeth)


def tooth_powers(values: FloatArray, n_teeth: int) -> FloatArray:
    """Return the mean square over each of `n_teeth` equal parts of a revolution; edges may fall between samples."""
    n = len(values)
    total = np.concatenate([[0.0], np.cumsum(values**2)])
    edges = np.interp(np.linspace(0, n, n_teeth + 1), np.arange(n + 1), total)
    powers: FloatArray = np.diff(edges) * n_teeth / n
    return powers


# --------------------
# Levels of the lines that the machine's kinematics give, and of those that belong to none of its parts.
# --------------------


OTHER_OVER_FLOOR_DB = 15.0
"""Height at which an unexplained line must stand out: noise does so in one line of 10¹³."""
_PRIORITY = {"mesh": 0, "shaft": 1, "sideband": 2}


def line_levels(
    rig: Rig, reference: str, lines: Mapping[str, tuple[HalvedLines, HalvedLines]], channel: int
) -> tuple[LineLevel, ...]:
    """Return mesh harmonics, sidebands and shaft orders of one channel, in ascending order; each order once."""
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
    """Return the lines locked to the shafts; only the reference shaft's harmonics if no gears are known."""
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
    is_seen = bool(amplitudes[n] > 3.0 * noise)  # noise alone is this high in one line of 8000
    # A line that is not seen is at most as high as the noise: its level is then a bound.
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
    """Return the strongest lines of either record that are not a whole order of any shaft, strongest first.

    Parameters
    ----------
    simulated, recorded : sequence of Spectrum
        Mean square over order, of the halves.
    ratios, mesh_orders : sequences of float
        Orders of the shafts and the meshes.
    highest : float
        Highest order examined.
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
    """Return the strongest local maxima, at most five, that both halves show outside the shafts' own lines."""
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
    # A peak within one order of a line 20 dB stronger is that line's foot, smeared by a varying speed.
    is_peak &= power > 0.01 * maximum_filter1d(power, 2 * round(1.0 / halves[0].resolution) + 1)
    lines = np.flatnonzero(is_peak)
    return [int(line) for line in lines[np.argsort(-power[lines])][:5]]


def other_label(order: float, mesh_orders: Sequence[float]) -> str:
    """Return a label with the line's order, and its distance from the mesh harmonic whose sideband it may be.

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
    """Return both records' level at one order; a slight difference in speed or slip may shift the line by one."""
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
    """Return third-octave levels of one channel, from the two halves of each record.

    Power densities of equally long blocks are summed over each band; lines on an edge count proportionally.
    """
    shortest_s = min(len(simulated[0]) / simulated_rate_hz, len(recorded[0]) / recorded_rate_hz)
    block_s = min(4.0, shortest_s / 2.0)
    # Four lines in the lowest band; above 45 % of the sampling rate anti-aliasing filters dominate.
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
    """Return the mean square in each band of a power density; a line covers half a step on either side."""
    edges = np.concatenate([[0.0], density.positions + density.resolution / 2.0])
    total = np.concatenate([[0.0], np.cumsum(density.values * density.resolution)])
    powers: FloatArray = np.array([float(np.diff(np.interp(band, edges, total))[0]) for band in limits])
    return powers


def order_band_limits(mesh_order: float | None, name: str, highest: float) -> tuple[tuple[str, float, float], ...]:
    """Return (label, low, high) of bands one mesh order wide around its harmonics; ten equal bands without a mesh."""
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
    """Return levels of bands over order, and the agreement of the reference shaft's lines in each.

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
