"""A recording as named features, with the scatter estimated from its own blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap._reduction import (
    DRIVEN,
    DRIVER,
    N_MESH_HARMONICS,
    ChannelSums,
    ComplexArray,
    GearFrame,
    ReducedRecording,
)
from gearsig.rig import SIDES

# --------------------
# Features from the lines of the two synchronous averages: mesh harmonics, sidebands, shaft orders.
# --------------------


N_SIDEBAND_HARMONICS = 5
SIDEBANDS = {"1": (1, 1), "2": (2, 2), "3to5": (3, 5), "6to12": (6, 12)}
MAX_SHAFT_ORDERS = 30

NamedValue = tuple[str, float]


@dataclass(frozen=True)
class Feature:
    """The parts of a feature's name: the kind of lines or signal, the shaft, and the quantity.

    Parameters
    ----------
    family : str
        "mesh", "sideband", "shaft", "tooth", "change", "surprise", "envelope", "line", "floor", …
    side : str
        "driver" or "driven"; empty where it belongs to no shaft.
    detail : str
        E.g. "3to5", "1.to_mesh", "level".

    Examples
    --------
    >>> Feature.of("sideband.driven.3to5")
    Feature(family='sideband', side='driven', detail='3to5')
    """

    family: str
    side: str = ""
    detail: str = ""

    @staticmethod
    @cache
    def of(name: str) -> Feature:
        """Return the feature with a name in the form used in tables."""
        family, _, remainder = name.partition(".")
        side, _, detail = remainder.partition(".")
        return Feature(family, side, detail) if side in SIDES else Feature(family, "", remainder)

    def __str__(self) -> str:
        return ".".join(part for part in (self.family, self.side, self.detail) if part)

    @property
    def is_relative(self) -> bool:
        """Whether it is a level relative to the mesh harmonics."""
        if self.family == "sideband":
            return self.detail != "strongest"
        if self.family in ("tooth", "change"):
            return self.detail in ("level", "elsewhere", "peak")
        return self.family == "shaft" and self.detail.endswith(("to_mesh", "low"))

    @property
    def is_shaft_level(self) -> bool:
        """Whether it is the absolute level of one of a shaft's first orders."""
        return self.family == "shaft" and self.detail.isdigit()

    @property
    def is_of_the_body(self) -> bool:
        """Whether it concerns a shaft's first orders, at which a machine moves as a whole."""
        return self.family == "shaft" and self.detail[:1].isdigit()

    @property
    def mirrored(self) -> Feature:
        """The same feature of the other shaft."""
        if self.family == "envelope" and self.detail.endswith("_shaft"):  # shaft orders in the residual
            return replace(self, detail=f"{_OTHER_SIDE[self.detail.removesuffix('_shaft')]}_shaft")
        return replace(self, side=_OTHER_SIDE[self.side]) if self.side else self


_OTHER_SIDE = {"driver": "driven", "driven": "driver"}


def line_features(reduced: ReducedRecording, channel: str) -> Iterator[NamedValue]:
    """Yield name and value in dB of one channel's mesh, sideband and shaft-order features."""
    driver, driven = (reduced.average(channel, side) for side in (DRIVER, DRIVEN))
    total = driver.mesh_power
    yield from _mesh(driver.power, driver.teeth, driver.highest, total)
    for average, side in ((driver, SIDES[DRIVER]), (driven, SIDES[DRIVEN])):
        yield from _sidebands(average.power, average.teeth, average.highest, total, side)
        yield from _shaft_orders(average.power, average.teeth, average.highest, total, side)


def decibel(power: float) -> float:
    """Return 10 lg of a power."""
    return float(10.0 * np.log10(max(power, 1e-300)))


def _mesh(power: FloatArray, teeth: int, highest: int, total: float) -> Iterator[NamedValue]:
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


def _sidebands(power: FloatArray, teeth: int, highest: int, total: float, side: str) -> Iterator[NamedValue]:
    carriers = [k * teeth for k in range(1, N_SIDEBAND_HARMONICS + 1) if k * teeth + 12 <= highest]
    if not carriers:
        carriers = [teeth]
    for label, (first, last) in SIDEBANDS.items():
        orders = [c + sign * n for c in carriers for n in range(first, last + 1) for sign in (-1, 1)]
        orders = [o for o in orders if 0 < o <= highest and o % teeth]
        lines = float(np.mean(power[orders])) if orders else 1e-300
        yield f"sideband.{side}.{label}", decibel(lines / total)
    first_pairs = [decibel(float(power[c - 1] + power[c + 1]) / max(float(power[c]), 1e-300)) for c in carriers]
    yield f"sideband.{side}.own", float(np.median(first_pairs))
    far = [
        o for c in carriers for o in (*range(c - 12, c - 2), *range(c + 3, c + 13)) if 0 < o <= highest and o % teeth
    ]
    if far:
        values = power[far]
        yield f"sideband.{side}.strongest", decibel(float(values.max() / np.median(values)))
    else:
        yield f"sideband.{side}.strongest", 0.0


def _shaft_orders(power: FloatArray, teeth: int, highest: int, total: float, side: str) -> Iterator[NamedValue]:
    for n in (1, 2, 3):
        level = decibel(power[n])
        yield f"shaft.{side}.{n}", level
        yield f"shaft.{side}.{n}.to_mesh", level - decibel(total)
    last = min(MAX_SHAFT_ORDERS, teeth - 3, highest)
    further_orders = power[4 : last + 1]
    strongest = int(np.argmax(further_orders))
    yield f"shaft.{side}.strongest", decibel(float(further_orders[strongest] / np.median(further_orders)))
    yield f"shaft.{side}.strongest.to_mesh", decibel(float(further_orders[strongest]) / total)
    yield f"shaft.{side}.low", decibel(float(further_orders.mean()) / total)


# --------------------
# Features of single teeth: the content of a shaft's average besides mesh and smooth modulation.
# --------------------


STEPS_PER_TOOTH = 4


def tooth_energy(lines: NDArray[np.complex128], teeth: int) -> FloatArray:
    """Return the mean square within one pitch at `STEPS_PER_TOOTH` positions per tooth."""
    n = 2 * (len(lines) - 1)
    wave = np.fft.irfft(lines, n) * (n / 2.0)
    total = np.concatenate([[0.0], np.cumsum(np.tile(wave**2, 2))])
    starts = np.arange(teeth * STEPS_PER_TOOTH) / (teeth * STEPS_PER_TOOTH) * n
    first = starts.astype(np.intp)
    width = max(1, round(n / teeth))
    energy: FloatArray = (total[first + width] - total[first]) / width
    return energy


def tooth_features(reduced: ReducedRecording) -> Iterator[NamedValue]:
    """Yield the tooth features of all channels together, since a tooth appears at the same angle on all of them."""
    for side in (DRIVER, DRIVEN):
        averages = reduced.averages(side)
        noises = [np.where(a.pattern != 0, a.noise, 0.0).sum() / 2.0 / a.mesh_power for a in averages]
        yield from pattern_features(
            f"tooth.{SIDES[side]}",
            [average.pattern for average in averages],
            averages[0].teeth,
            float(np.mean(noises)),
            averages[0].longer,
        )


def pattern_features(
    name: str,
    residuals: Sequence[NDArray[np.complex128]],
    teeth: int,
    noise: float,
    longer: float,
    minimum: float = 1e-30,
) -> Iterator[NamedValue]:
    """Yield size, prominence, kurtosis, width and centroid of residuals relative to their mesh.

    `noise` is the energy that noise contributes to them; it is subtracted, and `longer` times it is added to the
    excess. `minimum` is the smallest energy that can be distinguished from zero.
    """
    energy = np.mean([tooth_energy(lines, teeth) for lines in residuals], axis=0)
    energy = np.maximum(np.maximum(energy - noise, 0.0) + longer * noise, minimum)
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


# --------------------
# Features of the residual: bearing lines in envelope and spectrum, unrelated lines.
# --------------------


SLIP = 0.015
"""Rolling elements slip: their orders are searched within this fraction of the kinematic ones."""
MAX_SLIPS = 201

Known = tuple[float, float]
"""An order, and its possible slip."""

N_FAMILY = 4
N_SHAFT_FAMILY = 6
USED_OF_BAND = 0.7
"""Fraction of a band's width up to which its envelope reproduces modulation well."""
FLOOR_WIDTH = 48
"""Number of lines whose median is the floor."""
LOWEST_STRANGE = 0.4
"""Order of the driver below which a line may be due to the window or the speed."""
BEARING_FAMILIES = ("outer", "inner", "ball", "cage")
"""See `BearingFrame.families`."""


def floor_ratio(power: FloatArray) -> FloatArray:
    """Return each line's power relative to the noise floor, from the median of its segment (exponential distribution).

    Medians of adjoining segments are interpolated linearly: a running median takes a hundred times as long.
    """
    n_segments = max(1, power.shape[-1] // FLOOR_WIDTH)
    width = power.shape[-1] // n_segments
    medians = np.median(power[:, : n_segments * width].reshape(len(power), n_segments, width), axis=2)
    middles = (np.arange(n_segments) + 0.5) * width
    logs = np.log(np.maximum(medians, 1e-300))
    floors = np.exp([np.interp(np.arange(power.shape[-1]), middles, row) for row in logs])
    ratio: FloatArray = power * np.log(2.0) / floors
    return ratio


def cyclic_features(reduced: ReducedRecording, channels: Sequence[ChannelSums]) -> Iterator[NamedValue]:
    """Yield excesses in dB of families of envelope and residual lines: the largest over channels and bands."""
    frame = reduced.frame
    envelopes = np.concatenate([envelope_ratios(reduced, c) for c in channels])
    step, levels = reduced.cycle_step, excesses(envelopes)
    known = gear_orders(frame)
    yield from _families(frame, levels, step, known, "envelope")
    for side, order in enumerate(frame.shaft_orders):
        yield f"envelope.{SIDES[side]}_shaft", _family(levels, order, N_SHAFT_FAMILY, step, (), 0.0)
    yield "envelope.mesh", _family(levels, float(frame.teeth[0]), 1, step, (), 0.0)
    yield "envelope.strange", _unexplained_excess(envelopes, step, known_modulation(frame))
    depth = max(float(c.envelope_power.mean(axis=0)[:, 2:].sum(axis=1).max()) for c in channels)
    yield "envelope.depth", decibel(depth)
    residuals = residual_ratios(reduced, channels)
    levels = excesses(residuals)
    yield from _families(frame, levels, reduced.order_step, known, "line")
    yield "line.half_mesh", _family(levels, frame.teeth[0] / 2.0, 1, reduced.order_step, (), 0.0)
    yield "line.strange", _unexplained_excess(residuals, reduced.order_step, known_lines(frame))


def envelope_ratios(reduced: ReducedRecording, sums: ChannelSums) -> FloatArray:
    """Return the lines of each band's envelope relative to their floor; 1 beyond its usable width."""
    ratios = floor_ratio(sums.envelope_power.mean(axis=0))
    cycles = np.arange(ratios.shape[1]) * reduced.cycle_step
    for row, (low, high) in zip(ratios, reduced.bands_hz, strict=True):
        row[cycles > USED_OF_BAND * (high - low) / reduced.speed_hz] = 1.0
    return ratios


def _families(
    frame: GearFrame, levels: FloatArray, step: float, known: Sequence[float], name: str
) -> Iterator[NamedValue]:
    for kind in BEARING_FAMILIES:
        orders = [bearing.families[kind] for bearing in frame.bearings]
        scores = [_family(levels, o, N_FAMILY, step, known, SLIP) for o in orders if np.isfinite(o)]
        yield f"{name}.{kind}", max(scores, default=0.0)


def _family(
    levels: FloatArray, order: float, n_harmonics: int, step: float, known: Sequence[float], slip: float
) -> float:
    """Return the mean excess in dB of a family's lines, for the spectrum and slip at which it is largest.

    `levels` are excesses in dB of at least 0; each is the maximum over a line and its neighbours.
    """
    harmonics = np.arange(1, n_harmonics + 1) * order
    if known:
        harmonics = harmonics[np.min(np.abs(np.asarray(known) - harmonics[:, None]), axis=1) >= 1.5 * step]
    harmonics = harmonics[harmonics * (1.0 + slip) / step < levels.shape[1] - 1]
    if not len(harmonics):
        return 0.0
    n_slips = min(MAX_SLIPS, 2 * int(np.ceil(slip * harmonics.max() / step)) + 1)  # one line per step at the highest
    places = np.rint(np.outer(1.0 + np.linspace(-slip, slip, n_slips), harmonics) / step).astype(np.intp)
    return float(levels[:, places].mean(axis=2).max())


def excesses(ratios: FloatArray) -> FloatArray:
    """Return excesses in dB, at least 0, each the maximum over a line and its two neighbours."""
    from scipy.ndimage import maximum_filter1d

    level: FloatArray = 10.0 * np.log10(np.maximum(maximum_filter1d(ratios, 3, axis=1), 1.0))
    return level


def _unexplained_excess(ratios: FloatArray, step: float, known: Sequence[Known]) -> float:
    """Return the excess in dB of the strongest line of unknown origin; 0 where there is none."""
    positions = np.arange(ratios.shape[1]) * step
    free = positions > LOWEST_STRANGE
    for order, slip in known:
        low = np.searchsorted(positions, order - slip - 2.0 * step)
        free[low : np.searchsorted(positions, order + slip + 2.0 * step)] = False
    return max(decibel(float(ratios[:, free].max())), 0.0) if free.any() else 0.0


def residual_ratios(reduced: ReducedRecording, channels: Sequence[ChannelSums]) -> FloatArray:
    """Return the residuals' lines relative to their floor, one row per channel."""
    ratios = floor_ratio(np.stack([c.residual_power.mean(axis=0) for c in channels]))
    return ratios[:, : int(reduced.highest_order / reduced.order_step)]


def gear_orders(frame: GearFrame) -> list[float]:
    """Return the first harmonics of both shafts' orders, and the mesh harmonics with their first sidebands."""
    shafts = [k * order for order in frame.shaft_orders for k in range(1, 13)]
    mesh = [k * frame.teeth[0] + j * order for k in range(1, 7) for order in frame.shaft_orders for j in range(-3, 4)]
    return shafts + mesh


def known_modulation(frame: GearFrame) -> list[Known]:
    """Return the orders that modulate the residual: those of gears, which are exact, and every bearing's families."""
    return [*((order, 0.0) for order in gear_orders(frame)), *_bearing_orders(frame)]


def known_lines(frame: GearFrame) -> list[Known]:
    """Return all expected orders of the residual: gears, bearings, and bearing sidebands of the mesh harmonics."""
    bearings = _bearing_orders(frame)
    mesh = [(k * frame.teeth[0] + s * o, slip) for k in range(1, 7) for o, slip in bearings[:24] for s in (-1, 1)]
    return [*known_modulation(frame), *mesh]


def _bearing_orders(frame: GearFrame) -> list[Known]:
    """Return the orders of every bearing's families with their sidebands, and their possible slip."""
    orders = []
    for bearing in frame.bearings:
        shaft = frame.shaft_orders[bearing.side]
        for order, side in (
            (bearing.outer, 0.0),
            (bearing.inner, shaft),
            (2.0 * bearing.spin, bearing.cage),
            (bearing.cage, 0.0),
        ):
            if np.isfinite(order):
                sidebands = (-1, 0, 1) if side else (0,)
                orders += [(k * order + j * side, SLIP * k * order) for k in range(1, N_FAMILY + 1) for j in sidebands]
    return orders


# --------------------
# Features of the noise floor and of the amplitude distribution.
# --------------------


MIN_NEAR_SHARE = 1e-6
"""Less than one sample of any record."""


def broadband_features(reduced: ReducedRecording, channels: Sequence[ChannelSums]) -> Iterator[NamedValue]:
    """Yield band levels and kurtosis of the residual and tail figures of the raw signal, in dB."""
    moments = np.stack([c.moments.mean(axis=0) for c in channels])  # (channel, band, moment)
    squares = np.log10(np.maximum(moments[:, :, 0], 1e-300)).mean(axis=0) * 10.0
    kurtosis = np.log10(np.maximum(moments[:, :, 1] / np.maximum(moments[:, :, 0], 1e-300) ** 2, 1e-3)) * 10.0
    for i in range(len(reduced.bands_hz) - 1):
        yield f"floor.band.{i + 1}", float(squares[i])
        yield f"floor.kurtosis.{i + 1}", float(kurtosis[:, i].max())
    yield "floor.total", float(squares[-1])
    raw = np.stack([c.tail.mean(axis=0) for c in channels])
    yield "floor.to_signal", float(squares[-1] - 10.0 * np.log10(raw[:, 0]).mean())
    yield "raw.level", float(10.0 * np.log10(raw[:, 0]).mean())
    yield "raw.kurtosis", float((10.0 * np.log10(raw[:, 1] / raw[:, 0] ** 2)).min())
    # Without the block that contains the extreme, the share may be 0.
    yield "raw.near_the_extreme", decibel(max(float(raw[:, 2].max()), MIN_NEAR_SHARE))


def speed_features(reduced: ReducedRecording) -> Iterator[NamedValue]:
    """Yield the features of the speed and of mains hum."""
    drift, swing, line, _ = reduced.speed
    yield "speed.drift", decibel(abs(drift) + 1e-5) * 2.0
    yield "speed.swing", decibel(swing + 1e-6) * 2.0
    yield "speed.swing_line", decibel(line)
    yield "hum", max(reduced.hum)


WHOLE_RECORD_DB = {"hum": 1.3, "speed.drift": 3.0, "speed.swing": 1.0, "speed.swing_line": 2.0}
"""Standard errors of features from which no block can be omitted, from repeated synthetic records."""


@dataclass(frozen=True)
class Features:
    """Named features of one recording.

    Parameters
    ----------
    names : tuple of str
    values : array, (n,)
        dB, or ten times the decadic logarithm.
    scatter : array, (n,)
        Standard error from leaving out blocks of revolutions, one at a time.
    left_out : tuple of arrays, (n_blocks, n)
        Values without each block of the recording, and without each block of its baseline.
    """

    names: tuple[str, ...]
    values: FloatArray
    scatter: FloatArray
    left_out: tuple[FloatArray, ...] = ()


def jackknife_variance(rows: FloatArray) -> FloatArray:
    """Return the jackknife variance (B − 1)/B Σ_b (f_(b) − mean)² over B blocks, f_(b): without block b, (B, …).

    It is 0 for a single block.
    """
    variance: FloatArray = (len(rows) - 1.0) * np.var(rows, axis=0)
    return variance


def features_of(reduced: ReducedRecording) -> Features:
    """Return a recording's features with their standard errors by the jackknife over blocks of revolutions.

    Parameters
    ----------
    reduced : ReducedRecording

    Returns
    -------
    Features
        In the order of the names; dB, or ten times the decadic logarithm.
    """
    names, values = whole_and_parts(reduced)
    variance = jackknife_variance(values[1:]) + whole_record_variance(names)
    return Features(names, values[0], np.sqrt(variance), (values[1:],))


def whole_and_parts(reduced: ReducedRecording) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values, (1 + n_blocks, n): for all blocks, and with each block left out; computed once."""
    if "features" not in reduced.kept:
        names, values = feature_values(reduced)
        parts = [feature_values(part)[1] for part in reduced.leaving_one_out()]
        reduced.kept["features"] = names, np.stack([values, *parts])
    rows: tuple[tuple[str, ...], FloatArray] = reduced.kept["features"]
    return rows


def whole_record_variance(names: Sequence[str]) -> FloatArray:
    """Return the variance of features computed from the whole record at once, and 0 for all others."""
    return np.array([WHOLE_RECORD_DB.get(name, 0.0) ** 2 for name in names])


def feature_values(reduced: ReducedRecording) -> tuple[tuple[str, ...], FloatArray]:
    """Return names and values of the features, without their scatter; computed once."""
    if "whole" not in reduced.kept:
        reduced.kept["whole"] = _read_once(reduced)
    features: tuple[tuple[str, ...], FloatArray] = reduced.kept["whole"]
    return features


def _read_once(reduced: ReducedRecording) -> tuple[tuple[str, ...], FloatArray]:
    channels = list(reduced.channels.values())
    per_channel = [dict(line_features(reduced, channel)) for channel in reduced.channels]
    features = {name: float(np.mean([of_channel[name] for of_channel in per_channel])) for name in per_channel[0]}
    features |= dict(tooth_features(reduced))
    features |= dict(cyclic_features(reduced, channels))
    features |= dict(broadband_features(reduced, channels))
    features |= dict(speed_features(reduced))
    return tuple(features), np.array(list(features.values()))


# --------------------
# The shape of one tooth's burst: how its energy is distributed over the pitches before and after.
#
# A crack changes the mesh while its tooth carries load, a spall in the middle of that, a chipped tooth where contact
# ends too early, a pitch error where it starts too early or too late. On its way to a sensor this excites the machine's
# resonances; the order in which energy arrives survives that better than its spectrum does.
# --------------------


STEPS_PER_PITCH = 64
HIGHEST_MESH_ORDER = 10
"""Above it, sensors respond with their own resonances; `STEPS_PER_PITCH` is three times what so many orders need."""

LOWEST_MESH_ORDER = 0.5
"""Orders up to this move the machine as a whole."""

PEAK_PITCHES = 0.25
"""Width in which the loudest part of a burst is searched, and step of its profile."""

PROFILE_PITCHES = (-1.5, 3.0)
"""Measured from the loudest part, as are the ranges below. A tooth carries load for one to two pitches, and what it
excites rings on."""

N_QUARTERS = round((PROFILE_PITCHES[1] - PROFILE_PITCHES[0]) / PEAK_PITCHES)

ECHO_LAGS_PITCHES = np.arange(0.3, 2.15, 0.15)
ECHO_PITCHES = (-2.2, 2.8)
"""Range of the autocorrelation, which is smoothed over `SMOOTH_STEPS`."""

SMOOTH_STEPS = 6
NEAR_PITCHES = (-2.0, 3.5)
"""Range beyond which energy counts as elsewhere."""

MIN_BURST_SHARE, MIN_ECHO = 1e-4, 1e-3
"""Added before taking the logarithm: smaller values are noise."""

WAYS = ("plain", "even")
"""Lines as they are, or with their magnitudes flattened over a mesh order, which reduces the weight of the path's
resonances."""


def burst_lines(highest: int, teeth: int) -> np.ndarray:
    """Return the orders of a shaft at which single teeth show: neither the mesh's own nor the lowest ones."""
    orders = np.arange(min(highest, HIGHEST_MESH_ORDER * teeth))
    kept: np.ndarray = orders[(orders > LOWEST_MESH_ORDER * teeth) & (orders % teeth != 0)]
    return kept


def clearness(lines: ComplexArray, noise: FloatArray, teeth: int) -> float:
    """Return the power of the lines at which single teeth show, relative to their noise."""
    kept = burst_lines(lines.shape[1], teeth)
    return float(np.sum(np.abs(lines[:, kept]) ** 2) / max(float(noise[:, kept].sum()), 1e-300))


def burst_features(lines: ComplexArray, noise: FloatArray, teeth: int) -> Iterator[NamedValue]:
    """Yield shares of a burst's energy, as ten times their decadic logarithm.

    The squared envelope is e(φ) = |Σ_n D_n exp(i n φ)|² over one revolution, scaled to a sum of 1 for each channel and
    averaged over channels. Measured from its loudest quarter of a pitch, the features are: the share of each quarter
    from 1.5 pitches before to 3 after; the autocorrelation of e at lags from 0.3 to 2.1 pitches; the share further
    away. They are computed twice: from D itself, and from D/√(mean of |D|² over a mesh order + noise).

    Parameters
    ----------
    lines : complex array, (n_channels, n)
        Difference of a shaft's averages, by orders of the shaft from 0 on.
    noise : array, (n_channels, n)
        Noise power in them.
    teeth : int
    """
    from scipy.ndimage import convolve1d, uniform_filter1d

    for way in WAYS:
        by_channel = [_energy(*channel, teeth, even=way == "even") for channel in zip(lines, noise, strict=True)]
        energy, width = np.mean(by_channel, axis=0), round(PEAK_PITCHES * STEPS_PER_PITCH)
        within = uniform_filter1d(energy, width, mode="wrap", origin=-(width // 2))  # from each step on
        energy = np.roll(energy, -int(np.argmax(within)))
        profile = _cut(energy, PROFILE_PITCHES).reshape(N_QUARTERS, width).sum(axis=1)
        shares = profile / max(float(profile.sum()), 1e-300)
        for i, share in enumerate(shares):
            yield f"burst.{way}.course.{i}", decibel(share + MIN_BURST_SHARE)
        smooth = convolve1d(_cut(energy, ECHO_PITCHES), _window(SMOOTH_STEPS), mode="reflect")
        whole = max(float(np.sum(smooth**2)), 1e-300)
        for i, lag in enumerate((ECHO_LAGS_PITCHES * STEPS_PER_PITCH).astype(int)):
            echo = float(np.sum(smooth[:-lag] * smooth[lag:])) / whole
            yield f"burst.{way}.echo.{i}", decibel(echo + MIN_ECHO)
        elsewhere = max(1.0 - float(_cut(energy, NEAR_PITCHES).sum()), 0.0)
        yield f"burst.{way}.elsewhere", decibel(elsewhere + MIN_ECHO)


def _energy(lines: ComplexArray, noise: FloatArray, teeth: int, *, even: bool) -> FloatArray:
    """Return the squared envelope over one revolution, `STEPS_PER_PITCH` steps per pitch; its sum is 1."""
    from scipy.fft import ifft
    from scipy.ndimage import convolve1d

    kept = burst_lines(len(lines), teeth)
    spectrum = np.zeros(STEPS_PER_PITCH * teeth, dtype=np.complex128)
    spectrum[kept] = lines[kept]
    if even:
        expected = convolve1d(np.abs(lines) ** 2, _window(teeth), mode="mirror") + noise
        spectrum[kept] /= np.sqrt(expected[kept] + 1e-300)
    energy: FloatArray = np.abs(ifft(spectrum)) ** 2
    energy /= max(float(energy.sum()), 1e-300)
    return energy


def _window(n_points: int) -> FloatArray:
    window: FloatArray = np.hanning(n_points + 2)[1:-1]
    window /= window.sum()
    return window


def _cut(energy: FloatArray, pitches: tuple[float, float]) -> FloatArray:
    """Return the part between two angles, counted cyclically from the first step."""
    first, end = (int(pitch * STEPS_PER_PITCH) for pitch in pitches)
    return energy[np.arange(first, end) % len(energy)]
