"""Levels of the lines that the machine's kinematics give, and of those that belong to nothing it does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.averages import SEEN, HalvedLines
from gearsig.compare.levels import amplitude_error_db, decibel
from gearsig.compare.types import LevelPair, LineKind, LineLevel
from gearsig.diagnosis.comb import line_excess
from gearsig.rig.orders import OrderLine, order_lines
from gearsig.rig.types import Rig
from gearsig.spectra.floor import noise_floor
from gearsig.spectra.types import Spectrum

MOST_MESH_HARMONICS, N_SHAFT_ORDERS, N_SIDEBANDS = 10, 4, 3
N_WITHOUT_GEARS = 12
"""Shaft orders where no gears are known."""
N_OTHER = 5
OTHER_OVER_FLOOR_DB = 15.0
"""A line that belongs to nothing must stand out so far: noise does so in one line of 10¹³."""
SKIRT_ORDERS, SKIRT_DB = 1.0, 20.0
"""A peak so near to a line so much stronger is that line's foot, smeared by a wandering speed."""
_PRIORITY = {"mesh": 0, "shaft": 1, "sideband": 2}


def line_levels(
    rig: Rig, reference: str, simulated: Mapping[str, HalvedLines], recorded: Mapping[str, HalvedLines], channel: int
) -> tuple[LineLevel, ...]:
    """Return mesh harmonics, sidebands and shaft orders of one channel, by rising order; each order once."""
    found: dict[float, LineLevel] = {}
    for line in sorted(expected_lines(rig, reference), key=lambda expected: _PRIORITY[expected.kind]):
        shaft = _shaft_of(line, rig, simulated)
        ratio = rig.ratio(shaft, to=reference) if rig.shafts else 1.0
        if shaft not in simulated or ratio is None:
            continue
        n = round(line.order / ratio)
        if abs(n * ratio - line.order) > 1e-6 * line.order or round(line.order, 6) in found:
            continue
        if 1 <= n < simulated[shaft].first.shape[1]:
            kind: LineKind = line.kind  # type: ignore[assignment]  # `expected_lines` has no others
            found[round(line.order, 6)] = _level(line.label, kind, line.order, shaft, n, simulated, recorded, channel)
    return tuple(found[order] for order in sorted(found))


def expected_lines(rig: Rig, reference: str) -> tuple[OrderLine, ...]:
    """Return the lines that turn with the shafts; the reference shaft's harmonics alone where no gears are known."""
    if not rig.shafts:
        name = reference or "shaft"
        return tuple(OrderLine(float(k), "shaft", f"{k}× {name}", name, k) for k in range(1, N_WITHOUT_GEARS + 1))
    lines = order_lines(
        rig,
        reference,
        n_mesh_harmonics=MOST_MESH_HARMONICS,
        n_shaft_harmonics=N_SHAFT_ORDERS if rig.pairs else N_WITHOUT_GEARS,
        n_sidebands=N_SIDEBANDS,
    )
    return tuple(line for line in lines if line.kind in _PRIORITY and line.order > 0)


def _shaft_of(line: OrderLine, rig: Rig, averages: Mapping[str, HalvedLines]) -> str:
    """Return the shaft in whose average a line is a whole order."""
    if not rig.shafts:
        return next(iter(averages))
    if line.kind == "shaft":
        return line.element
    if line.kind == "sideband":
        return line.modulating_shaft
    pair = rig.pair(line.element)
    return next((s for s in (pair.driver, pair.driven) if pair.teeth(s) is not None and s in averages), pair.driver)


def _level(
    label: str,
    kind: LineKind,
    order: float,
    shaft: str,
    n: int,
    simulated: Mapping[str, HalvedLines],
    recorded: Mapping[str, HalvedLines],
    channel: int,
) -> LineLevel:
    values = [_read(lines[shaft], channel, n) for lines in (simulated, recorded)]
    (own, own_error, own_seen), (other, other_error, other_seen) = values
    level = LevelPair(own, other, float(np.hypot(own_error, other_error)))
    return LineLevel(label, kind, order, shaft, level, own_seen, other_seen)


def _read(lines: HalvedLines, channel: int, n: int) -> tuple[float, float, bool]:
    """Return level, its standard error, and whether the line is seen."""
    amplitudes, noise = np.abs(lines.whole[channel]), lines.noise()[channel, n]
    strongest = float(np.max(amplitudes[1:] ** 2, initial=0.0))
    seen = bool(amplitudes[n] > SEEN * noise)
    # What is not seen is at most the noise: the level is a bound then.
    shown = amplitudes[n] if seen else max(amplitudes[n], noise)
    level = float(decibel(np.array([shown**2]), strongest)[0])
    return level, float(amplitude_error_db(np.array([shown]), np.array([noise]))[0]), seen


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
    found: dict[int, None] = {}
    for spectra in (recorded, simulated):
        found |= dict.fromkeys(_strongest(spectra, ratios, mesh_orders, highest))
    step = recorded[0].resolution
    levels: list[tuple[int, LineLevel]] = []
    for line in sorted(found):
        if any(abs(line - other) <= 3 for other, _ in levels):
            continue
        label = other_label(line * step, mesh_orders)
        levels.append((line, _other_level(label, line * step, line, simulated, recorded)))
    kept = sorted((level for _, level in levels), key=lambda one: -max(one.level.recorded_db, one.level.simulated_db))
    return tuple(kept[: 2 * N_OTHER])


def _strongest(
    halves: Sequence[Spectrum], ratios: Sequence[float], mesh_orders: Sequence[float], highest: float
) -> list[int]:
    """Return the strongest local maxima outside of the shafts' own lines that both halves show, at most `N_OTHER`."""
    ratios_db, masked = [], None
    for half in halves:
        excess = line_excess(half, noise_floor(half).values)
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
    is_peak &= power > _strongest_around(power, round(SKIRT_ORDERS / halves[0].resolution)) * 10 ** (-SKIRT_DB / 10)
    lines = np.flatnonzero(is_peak)
    return [int(line) for line in lines[np.argsort(-power[lines])][:N_OTHER]]


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


def _strongest_around(power: FloatArray, reach: int) -> FloatArray:
    from scipy.ndimage import maximum_filter1d

    strongest: FloatArray = maximum_filter1d(power, 2 * reach + 1)
    return strongest


def _other_level(
    label: str, order: float, line: int, simulated: Sequence[Spectrum], recorded: Sequence[Spectrum]
) -> LineLevel:
    """Read both records at one order; a slightly other speed or slip may move the line by one."""
    levels, errors, seen = [], [], []
    for halves in (simulated, recorded):
        power = np.stack([half.values for half in halves])
        near = slice(max(line - 1, 0), line + 2)
        peaks: FloatArray = power[:, near].max(axis=1)
        floor = np.mean([float(noise_floor(half).values[line]) for half in halves])
        a, b = decibel(peaks, float(power.max()))
        levels.append(float(decibel(np.array([peaks.mean()]), float(power.max()))[0]))
        errors.append(abs(float(a - b)) / 2.0)
        seen.append(bool(10.0 * np.log10(max(peaks.min(), 1e-300) / max(floor, 1e-300)) > OTHER_OVER_FLOOR_DB))
    level = LevelPair(levels[0], levels[1], float(np.hypot(errors[0], errors[1])))
    return LineLevel(label, "other", order, "", level, seen[0], seen[1])
