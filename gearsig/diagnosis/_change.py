"""Changes since the reference in dB, tested against the scatter of each record's segments, and what they may mean."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot, inf, sqrt

import numpy as np

from gearsig.angle import AngleSignal
from gearsig.checks import FloatArray
from gearsig.diagnosis._bearing import CLEAR_MODULATION
from gearsig.diagnosis._bearing_families import (
    SAME_BEARING_ORDER,
    SAME_FAMILY,
    expected_parts,
    part_text,
    slip_of,
    speed_is_only_stated,
)
from gearsig.diagnosis._lines import SPREAD_OF_STATED
from gearsig.diagnosis._reference import changed_sensors
from gearsig.diagnosis._rotor import (
    CONFIRMS_WHIRL,
    OIL_WHIRL,
    UNSTEADY,
    WHIRL_ORDERS,
    derivatives_of_velocity,
    shafts_of_whirl,
)
from gearsig.diagnosis._signals import AnalysisSignals, BandEnvelope, is_of_tones, without_shafts
from gearsig.diagnosis._types import (
    CHANGED,
    LEVELS_MATCH,
    MIN_CHANGE_DB,
    UNCHANGED,
    WITH_ASSUMED_DATA,
    Finding,
    Kind,
    LevelChange,
    Strength,
    Where,
    cannot_tell,
)
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted, named, percent, signed
from gearsig.orders import order_map
from gearsig.prepared import best_comb, envelope_bands
from gearsig.recording import MAINS_HZ, MAINS_WANDER
from gearsig.rig import order_lines

N_SEGMENTS = 8
"""Of the shorter record: enough to know a level's scatter to a quarter, and long enough to resolve sidebands."""

MIN_SEGMENT_REV = 8
STATED_SPEED = 0.01
"""Relative error of a speed that is stated and not confirmed."""

STANDS_OUT = 4.0
"""Mean power of a line over segments, relative to the lower quartile of the lines around: noise does not reach it."""

STAYS = 0.75
"""Share of the segments in which a line exceeds its neighbours: a tone that drifts past is no shaft's."""

NOISE_QUANTILE = 0.25
"""Of lines: three in four of them may be tones, as between the harmonics of a loose shaft."""

N_HARMONICS, N_MESH_HARMONICS, N_SIDEBANDS = 10, 8, 3
OVERALL = "overall level"
SUBHARMONICS = (1 / 2, 3 / 2, 5 / 2, 7 / 2, 1 / 3, 2 / 3)
OTHER_SPEED = 0.03
"""Relative difference of speed that alone changes levels: forces grow with its square, and resonances meet other
orders."""


@dataclass(frozen=True)
class _Levels:
    """Mean squares of one quantity in each segment of one record, and whether it stands out from its neighbours."""

    power: FloatArray
    stands_out: bool = True


@dataclass(frozen=True)
class _Quantity:
    label: str
    kind: str
    where: Where
    harmonic: float
    unit: str
    now: _Levels
    then: _Levels

    @property
    def mean_power(self) -> float:
        """Mean power in the record where it is larger."""
        return max(float(self.now.power.mean()), float(self.then.power.mean()))


def level_changes(
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    reference: AnalysisSignals,
    reference_envelopes: Sequence[BandEnvelope],
) -> tuple[LevelChange, ...]:
    """Compare the levels of lines, sidebands, bearing parts and noise with those of the reference.

    Each record is cut into segments of equally many revolutions. A level is the mean over them, in dB. Its standard
    error comes from their scatter, or from that of means of 2, 4, … neighbours where this is larger, since slow drifts
    do not average out. The change is tested by Welch's t.

    Parameters
    ----------
    signals, envelopes
        Of the recording.
    reference, reference_envelopes
        Of the healthy machine, with the same channels.

    Returns
    -------
    tuple of LevelChange
        Overall levels only, if a speed is unknown or a record is shorter than 16 revolutions; empty if a run-up covers
        other speeds.

    References
    ----------
    B. L. Welch, "The generalization of 'Student's' problem when several different population variances are involved",
    1947. C. Alexopoulos, A. F. Seila, "Output data analysis", in *Handbook of Simulation*, 1998 (batch means).
    """
    is_run_up = any(s.angle is not None and not s.angle.is_steady(UNSTEADY) for s in (signals, reference))
    if is_run_up and abs(_speed_off(signals, reference)) > OTHER_SPEED:
        return ()
    try:
        block_rev = _segment_rev(signals, reference)
        quantities = [
            *_lines_and_noise(signals, reference, block_rev),
            *_bearing_parts(signals, envelopes, reference, reference_envelopes, block_rev),
        ]
    except RefusalError:
        quantities = [] if abs(_speed_off(signals, reference)) > OTHER_SPEED else list(_overall(signals, reference))
    probability = signals.settings.false_alarm_probability
    return tuple(_compared(q, len(quantities), probability) for q in quantities)


def family_change(
    where: Where,
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    reference: AnalysisSignals,
    reference_envelopes: Sequence[BandEnvelope],
) -> LevelChange | None:
    """Compare the level of a family of lines with that in the reference, in the same channel, band and order.

    Of the bands for which both have envelopes, the one that overlaps most with the family's is used. None if there is
    none, or an envelope is empty.
    """
    order, band = where.order, where.band_hz
    if order is None or band is None:
        return None
    pairs = [(a, b) for a in envelopes for b in reference_envelopes if (a.channel, a.band_hz) == (b.channel, b.band_hz)]
    pairs = [(a, b) for a, b in pairs if a.channel in where.channels and _in_common(a.band_hz, band) > 0]
    if not pairs:
        return None
    try:
        block_rev = _segment_rev(signals, reference)
    except RefusalError:
        return None
    best = max(pairs, key=lambda pair: _in_common(pair[0].band_hz, band))
    now, then = (None if d is None else _family(d, order, SAME_FAMILY) for d in (_depths(e, block_rev) for e in best))
    if now is None or then is None:
        return None
    quantity = _Quantity("", "bearing", where, 0.0, "", now, then)
    change = _compared(quantity, 1, signals.settings.false_alarm_probability)
    return replace(change, is_change=change.is_change or (change.change_db > 0 and _is_new(*best, order)))


def _is_new(now: BandEnvelope, then: BandEnvelope, order: float) -> bool:
    """Whether the log p-value of a family's lines in the reference is less than half of that in the recording.

    Segments have a coarser resolution than the whole record, so that weak lines drown in their noise.
    """
    combs = [best_comb(e.excess, order * (1 - SAME_FAMILY), order * (1 + SAME_FAMILY)) for e in (now, then)]
    chance, chance_then = (1.0 if comb is None else comb.p_value for comb in combs)
    return chance_then > sqrt(chance)


def with_clearest_band(
    findings: Sequence[Finding], signals: AnalysisSignals, reference: AnalysisSignals
) -> list[Finding]:
    """Return the findings, adding to each bearing family the band that shows it best, and the reference's best."""
    return [
        replace(f, evidence=(*f.evidence, text)) if (text := _clearest_text(f, signals, reference)) else f
        for f in findings
    ]


def _clearest_text(finding: Finding, signals: AnalysisSignals, reference: AnalysisSignals) -> str:
    from gearsig.spectra import compare_bands

    order, channel = finding.where.order, next(iter(finding.where.channels), "")
    is_claim = finding.where.bearing and finding.is_claim
    if not is_claim or order is None or signals.speed_varies or reference.speed_varies:
        return ""
    try:
        now, then = (
            compare_bands(s.recording, channel, order * s.frequency_per_order_hz)[0] for s in (signals, reference)
        )
    except (InputError, RefusalError):
        return ""
    low, high = (f"{edge / 1000:.3g}" for edge in now.band_hz)
    return (
        f"Clearest in the band {low} to {high} kHz ({now.method}): {now.clarity_db:.0f} dB over its floor; the "
        f"reference's clearest has {then.clarity_db:.0f} dB (noise alone reaches some 6)."
    )


def _speed_off(signals: AnalysisSignals, reference: AnalysisSignals) -> float:
    """Return the relative difference of the mean speeds; 0 where one is not known."""
    if signals.angle is None or reference.angle is None:
        return 0.0
    return signals.frequency_per_order_hz / reference.frequency_per_order_hz - 1.0


SPREAD_LINES = 8
"""Of a spectrum over frequency, in which a varying speed spreads a line."""

SPEED_QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Alike in two records that run through the same speeds; a jittering pulse affects neither quantile."""


def _speeds_apart(signals: AnalysisSignals, reference: AnalysisSignals) -> float:
    """Return the largest relative difference between the speed ranges of both records; 0 without speeds."""
    if signals.angle is None or reference.angle is None:
        return 0.0
    now, then = (np.quantile(one.angle.speed_rev_per_s, SPEED_QUANTILES) for one in (signals, reference))  # type: ignore[union-attr]
    return float(np.abs(now / then - 1.0).max())


LIGHTEST_DAMPING = 0.01
"""Damping ratio of the sharpest mode of an installed machine: bearings, joints and the ground dissipate more."""


def _by_speed_alone_db(apart: float) -> float:
    r"""Return by how much a different speed alone may raise a line, in dB: forces by its square, a mode by its flank.

    A mode's response near its resonance is proportional to 1/√(x² + ζ²), x the relative distance from it. Between two
    speeds that are δ apart it differs by a factor of at most (u + √(u² + 4))/2, u = δ/ζ.
    """
    u = abs(apart) / LIGHTEST_DAMPING
    return float(40 * np.log10(1 + abs(apart)) + 20 * np.log10((u + sqrt(u**2 + 4)) / 2))


def _in_common(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the overlap of two bands as a fraction of the range they cover together."""
    return float(max(min(a[1], b[1]) - max(a[0], b[0]), 0.0) / (max(a[1], b[1]) - min(a[0], b[0])))


def _segment_rev(signals: AnalysisSignals, reference: AnalysisSignals) -> int:
    """Return the number of revolutions of a segment, the same in both records.

    Raises
    ------
    RefusalError
        If a record has no speed, or fewer than two segments.
    """
    lengths = [s.over_angle.n_revolutions if s.over_angle is not None else 0.0 for s in (signals, reference)]
    revolutions = int(min(lengths)) - 1  # the first may be incomplete
    if revolutions < 2 * MIN_SEGMENT_REV:
        raise RefusalError(f"{revolutions} whole revolutions are too few to compare", remedy="record longer")
    return max(revolutions // N_SEGMENTS, MIN_SEGMENT_REV)


# --------------------
# Levels by segment.
# --------------------


@dataclass(frozen=True)
class _Segments:
    """Power spectra over order of consecutive segments, (n_segments, n_lines)."""

    power: FloatArray
    resolution: float

    @classmethod
    def of(cls, signal: AngleSignal, channel: str, block_rev: int) -> _Segments:
        """Return those of a channel, without overlap, so that the segments' noise is independent."""
        spectra = order_map(signal, channel, revolutions_per_block=block_rev, overlap=0.0, scaling="power")
        return cls(spectra.values, spectra.resolution)

    @cached_property
    def mean(self) -> FloatArray:
        """Mean over the segments, (n_lines,)."""
        mean: FloatArray = self.power.mean(axis=0)
        return mean

    @property
    def highest_order(self) -> float:
        """Highest order of the lines."""
        return float((self.power.shape[1] - 4) * self.resolution)

    def without_multiples(self, orders: Sequence[float]) -> _Segments:
        """Return the same with the lines at multiples of some orders, and two on either side, set to 0."""
        positions = np.arange(self.power.shape[1]) * self.resolution
        hidden = np.zeros(len(positions), dtype=bool)
        for order in orders:
            hidden |= np.abs(positions - np.rint(positions / order) * order) < 2.5 * self.resolution
        return _Segments(np.where(hidden, 0.0, self.power), self.resolution)

    def line(self, order: float, slip: float = 0.0) -> _Levels:
        """Return the largest line at an order, within `slip` (relative) or one line on either side."""
        reach = max(1, round(slip * order / self.resolution))
        low, high = max(round(order / self.resolution) - reach, 1), round(order / self.resolution) + reach + 1
        mean, top = self.mean, low + int(np.argmax(self.mean[low:high]))
        floor = np.quantile(mean[max(low - 32, 1) : high + 32], NOISE_QUANTILE)
        is_peak = mean[top] >= mean[max(top - 2, 1) : top + 3].max()  # not the foot of a line beyond
        largest = self.power[:, low:high].max(axis=1)
        stays = np.mean(largest >= self.power[:, max(low - 2, 1) : high + 2].max(axis=1)) >= STAYS
        return _Levels(largest, bool(is_peak and stays and mean[top] >= STANDS_OUT * floor))

    def band(self, low: float, high: float) -> _Levels:
        """Return the lower quartile of a band's lines, which tones do not reach."""
        a, b = (int(edge / self.resolution) for edge in (low, high))
        return _Levels(np.quantile(self.power[:, max(a, 1) : b + 1], NOISE_QUANTILE, axis=1))


def _overall(signals: AnalysisSignals, reference: AnalysisSignals) -> Iterator[_Quantity]:
    """Yield each channel's mean square about its mean, in segments of time."""
    for channel in signals.recording.channels:
        if channel.name in signals.spectra and channel.name in reference.spectra:
            values = (s.recording.values(channel.name) for s in (signals, reference))
            levels = (_Levels(np.array([part.var() for part in np.array_split(v, N_SEGMENTS)])) for v in values)
            yield _Quantity(OVERALL, "overall", Where((channel.name,)), 0.0, channel.unit, *levels)


def _sum(levels: Sequence[_Levels]) -> _Levels:
    """Add mean squares; the sum stands out if the lines that stand out hold half of it."""
    power = np.sum([one.power for one in levels], axis=0)
    power_of_standing = sum(float(one.power.sum()) for one in levels if one.stands_out)
    return _Levels(power, 2 * power_of_standing >= float(power.sum()))


def _lines_and_noise(signals: AnalysisSignals, reference: AnalysisSignals, block_rev: int) -> Iterator[_Quantity]:
    for channel in signals.recording.channels:
        name, unit = channel.name, channel.unit
        assert signals.over_angle is not None  # noqa: S101 - `_segment_rev` would have refused; narrows the type
        assert reference.over_angle is not None  # noqa: S101
        if name not in reference.over_angle.channel_names:
            continue  # dead in the reference
        now = _Segments.of(signals.over_angle, name, block_rev)
        then = _Segments.of(reference.over_angle, name, block_rev)
        highest = min(now.highest_order, then.highest_order)
        slip = STATED_SPEED if speed_is_only_stated(signals) or speed_is_only_stated(reference) else 0.0
        taken: list[float] = []
        for label, kind, harmonic, where, orders in _families(signals, name, now.resolution):
            free = [o for o in orders if o <= highest and all(abs(o - t) > 3 * now.resolution for t in taken)]
            if free:
                taken += free
                levels = [_sum([side.line(o, slip) for o in free]) for side in (now, then)]
                quantity = _Quantity(label, kind, where, harmonic, unit, *levels)
                if kind in ("shaft", "subharmonic"):
                    sides = ((signals, now), (reference, then))
                    quantity = _of_shaft_alone(quantity, sides, free[0], slip, highest)
                yield quantity
        for shaft, order in shafts_of_whirl(signals).items():
            low, high = (edge * order for edge in WHIRL_ORDERS)
            if high - low >= 2 * now.resolution:
                place, middle = signals.where((low + high) / 2, name, shaft=shaft), sum(WHIRL_ORDERS) / 2
                levels = [side.line((low + high) / 2, (high - low) / (high + low)) for side in (now, then)]
                levels = [
                    replace(level, stands_out=level.stands_out and _is_at(*side, name, (low + high) / 2, high - low))
                    for side, level in zip(((signals, now), (reference, then)), levels, strict=True)
                ]
                label = f"{WHIRL_ORDERS[0]:g} to {WHIRL_ORDERS[1]:g}× {shaft}"
                yield _Quantity(label, "subharmonic", place, middle, unit, *levels)
        n_fine = 6  # the narrowest of the envelope bands
        for low, high in envelope_bands(signals.recording.sampling_rate_hz)[-n_fine:]:
            hertz = signals.frequency_per_order_hz, reference.frequency_per_order_hz
            if high / min(hertz) > highest:
                continue
            edges = f"{low:.0f} to {high:.0f} Hz" if high < 1000 else f"{low / 1000:.2g} to {high / 1000:.2g} kHz"
            label, where = f"noise {edges}", Where((name,), band_hz=(low, high))
            levels = [s.band(low / f, high / f) for s, f in zip((now, then), hertz, strict=True)]
            yield _Quantity(label, "noise", where, 0.0, unit, *levels)


def _of_shaft_alone(
    quantity: _Quantity, sides: Sequence[tuple[AnalysisSignals, _Segments]], order: float, slip: float, highest: float
) -> _Quantity:
    """Return a shaft's line, not standing out where it lies elsewhere; or the mains line that hides it.

    The louder record decides: a mains line that hides a weaker line of the shaft there shows that it rose no less.
    """
    channel, levels = quantity.where.channels[0], (quantity.now, quantity.then)
    louder = int(levels[1].power.mean() > levels[0].power.mean())
    mains_hz = _mains_in_line(*sides[louder], levels[louder], channel, order, slip)
    orders = [mains_hz / signals.frequency_per_order_hz for signals, _ in sides]
    if mains_hz > 0 and max(orders) <= highest:
        lines = [segments.line(place) for (_, segments), place in zip(sides, orders, strict=True)]
        where = Where((channel,), frequency_hz=mains_hz)
        return _Quantity(f"{mains_hz:g} Hz of the mains", "mains", where, 0.0, quantity.unit, *lines)
    now, then = (
        replace(level, stands_out=level.stands_out and _is_at(*side, channel, order))
        for side, level in zip(sides, levels, strict=True)
    )
    return replace(quantity, now=now, then=then)


def _is_at(signals: AnalysisSignals, segments: _Segments, channel: str, order: float, wide: float = 0.0) -> bool:
    """Whether the line that segments show broadly is really at an order, or within a range about it.

    The whole record resolves neighbours: oil whirl beside one half, a race's lines beside a multiple.
    """
    spectrum = signals.order_excess[channel].spectrum
    place = spectrum.largest_near(order, max(segments.resolution, wide / 2 + spectrum.resolution))[0]
    is_stated = signals.angle is not None and signals.angle.method == "constant"
    return abs(place - order) <= max(2 * spectrum.resolution, wide / 2, SPREAD_OF_STATED * order * is_stated)


def _mains_in_line(
    signals: AnalysisSignals, segments: _Segments, level: _Levels, channel: str, order: float, slip: float
) -> float:
    """Return the multiple of the mains, in Hz, that makes up most of a shaft's line; 0 if none does.

    A segment is short, and its lines wide. The spectrum of the whole record separates the two if they are two of its
    lines apart, or if the speed varies so much that it spreads the shaft's line but not the mains'.
    """
    spectrum, hertz = signals.spectra[channel], order * signals.frequency_per_order_hz
    reach_hz = (slip * order + 2 * segments.resolution) * signals.frequency_per_order_hz
    spread_hz = _spread_hz(signals, order)
    # A shaft's line spread this widely leaves no line with half of the power; spread less, it may be any of them.
    own_hz = 0.0 if spread_hz > SPREAD_LINES * spectrum.resolution else spread_hz / 2 + 2 * spectrum.resolution
    for mains_hz in MAINS_HZ:
        place_hz = mains_hz * round(hertz / mains_hz)
        if place_hz > 0 and own_hz < abs(place_hz - hertz) <= reach_hz:
            within_hz = max(MAINS_WANDER * place_hz, spectrum.resolution / 2)
            amplitude = spectrum.largest_near(place_hz, within_hz)[1]
            if amplitude**2 >= float(level.power.mean()):  # its mean square is half of that
                return place_hz
    return 0.0


def _spread_hz(signals: AnalysisSignals, order: float) -> float:
    """Return the width in Hz over which a varying speed spreads the line of an order."""
    low_rpm, high_rpm = signals.angle.speed_range_rpm if signals.angle is not None else (0.0, 0.0)
    return order * (high_rpm - low_rpm) / 60


Family = tuple[str, str, float, Where, list[float]]


def _families(signals: AnalysisSignals, channel: str, resolution: float) -> Iterator[Family]:
    """Yield label, kind, harmonic, place and orders of the lines of teeth and shafts; the most certain first."""
    rig, closest = signals.rig, 4 * resolution  # nearer lines run into each other: the Hann window's main lobe
    reference = rig.reference_shaft
    lines = order_lines(rig, reference, n_mesh_harmonics=N_MESH_HARMONICS, n_shaft_harmonics=0, n_sidebands=N_SIDEBANDS)
    for line in lines:
        if line.kind == "mesh":
            where = signals.where(line.order, channel, gear=line.element)
            yield line.label, "mesh", line.harmonic, where, [line.order]
    for shaft, order in signals.known_shaft_orders.items():
        for k in range(1, N_HARMONICS + 1 if not rig.pairs else 5):
            if order >= closest:
                where = signals.where(k * order, channel, shaft=shaft)
                yield f"{k}× {shaft}".strip(), "shaft", k, where, [k * order]
    for pair in rig.pairs:
        for shaft in (pair.driver, pair.driven):
            sidebands = [
                x.order for x in lines if (x.kind, x.element, x.modulating_shaft) == ("sideband", pair.name, shaft)
            ]
            ratio = rig.ratio(shaft)
            if sidebands and ratio is not None and ratio >= closest:
                where = replace(signals.where(ratio, channel, gear=f"{pair.name}/{shaft}"), frequency_hz=None)
                yield f"sidebands of {pair.name} by {shaft}", "sidebands", 0.0, where, [o for o in sidebands if o > 0]
    fastest = max(signals.known_shaft_orders.items(), key=lambda item: item[1])
    for part in SUBHARMONICS if not rig.pairs else ():  # between the shafts of a gear train all ratios are taken
        where = signals.where(part * fastest[1], channel, shaft=fastest[0])
        yield f"{part:.3g}× {fastest[0]}".strip(), "subharmonic", part, where, [part * fastest[1]]


def _bearing_parts(
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    reference: AnalysisSignals,
    reference_envelopes: Sequence[BandEnvelope],
    block_rev: int,
) -> Iterator[_Quantity]:
    """Yield each known part's family of lines, in the band of each channel where either record shows most of it."""
    bands = {(e.channel, e.band_hz): e for e in reference_envelopes}
    shafts, slip, parts = tuple(signals.known_shaft_orders.values()), slip_of(signals), expected_parts(signals)
    loudest: dict[tuple[int, str], tuple[_Quantity, BandEnvelope, BandEnvelope]] = {}
    for envelope in envelopes:
        reference_envelope = bands.get((envelope.channel, envelope.band_hz))
        if reference_envelope is None:
            continue
        depths_now, depths_then = (_depths(e, block_rev, shafts) for e in (envelope, reference_envelope))
        if depths_now is None or depths_then is None:
            continue
        for number, (bearing, name, order) in enumerate(parts):
            now, then = (_family(depths, order, slip) for depths in (depths_now, depths_then))
            if now is None or then is None:
                continue
            place = signals.where(order, envelope.channel, shaft=bearing.shaft, bearing=bearing.name)
            where = replace(place, band_hz=envelope.band_hz)
            quantity = _Quantity(part_text(name, bearing.name), "bearing", where, 0.0, "", now, then)
            key = number, envelope.channel
            if key not in loudest or quantity.mean_power > loudest[key][0].mean_power:
                loudest[key] = quantity, envelope, reference_envelope
    channels = list(dict.fromkeys(e.channel for e in envelopes))
    for key in sorted(loudest, key=lambda key: (key[0], channels.index(key[1]))):
        quantity, envelope, reference_envelope = loudest[key]
        yield _without_beats(quantity, ((signals, envelope), (reference, reference_envelope)), parts[key[0]][2])


def _without_beats(
    quantity: _Quantity, sides: Sequence[tuple[AnalysisSignals, BandEnvelope]], order: float
) -> _Quantity:
    """Return a part's family, not standing out where the louder record's vanishes with the steady tones.

    Carriers and slots of a supply at another frequency beat elsewhere, and change no bearing.
    """
    levels = (quantity.now, quantity.then)
    power = [float(level.power.mean()) for level in levels]
    louder = int(power[1] > power[0])
    if not levels[louder].stands_out or max(power) < 10 ** (MIN_CHANGE_DB / 10) * min(power):
        return quantity  # no change is reported
    signals, envelope = sides[louder]
    slip = slip_of(signals)
    comb = best_comb(without_shafts(signals, envelope.excess), order * (1 - slip), order * (1 + slip))
    if comb is None or not is_of_tones(signals, envelope, comb.fundamental):
        return quantity
    now, then = (replace(level, stands_out=False) for level in levels)
    return replace(quantity, now=now, then=then)


def _depths(envelope: BandEnvelope, block_rev: int, shafts: Sequence[float] = ()) -> _Segments | None:
    """Return an envelope's segments relative to its mean, as depths of modulation, without multiples of the shafts.

    A louder carrier does not change it. None if the speed is unknown, or nothing was recorded.
    """
    if envelope.over_angle is None or envelope.mean <= 0:
        return None
    segments = _Segments.of(envelope.over_angle, envelope.channel, block_rev).without_multiples(shafts)
    return replace(segments, power=segments.power / envelope.mean**2)


def _family(depths: _Segments, order: float, slip: float) -> _Levels | None:
    """Return the sum of the first three multiples of an order.

    It stands out if each of them does and the depth is typical of damage.
    """
    lines = [depths.line(k * order, slip) for k in (1, 2, 3) if k * order * (1 + slip) <= depths.highest_order]
    if not lines or not all(line.power.any() for line in lines):
        return None
    depth = max(float(np.sqrt(2 * line.power.mean())) for line in lines)
    stands_out = len(lines) > 1 and all(line.stands_out for line in lines) and depth >= CLEAR_MODULATION
    return replace(_sum(lines), stands_out=stands_out)


# --------------------
# Whether they differ.
# --------------------


def _compared(quantity: _Quantity, n_compared: int, probability: float) -> LevelChange:
    from scipy.stats import t as student

    tiny = 1e-300
    now, then = (10 * np.log10(np.maximum(x.power, tiny)) for x in (quantity.now, quantity.then))
    change = float(now.mean() - then.mean())
    errors = [_standard_error(x) for x in (now, then)]
    error = hypot(*errors)
    freedom = error**4 / sum(e**4 / (len(x) - 1) for e, x in zip(errors, (now, then), strict=True)) if error else inf
    p_value = 2 * float(student.sf(abs(change) / error, freedom)) if error else float(change == 0.0)
    p_value = min(1.0, p_value * n_compared)
    louder = quantity.now if change > 0 else quantity.then
    is_change = abs(change) >= MIN_CHANGE_DB and p_value <= probability and louder.stands_out
    return LevelChange(
        quantity.label,
        quantity.kind,
        quantity.where,
        quantity.harmonic,
        quantity.unit,
        float(now.mean()),
        float(then.mean()),
        max(_between_halves(x) for x in (now, then)),
        p_value,
        is_change,
        louder.stands_out,
    )


def _standard_error(levels: FloatArray) -> float:
    """Return the standard error of the mean of a series with correlated neighbours: the largest of batch means'."""
    errors, batch = [], 1
    while len(levels) // batch >= 2:
        n = len(levels) // batch
        means = levels[: n * batch].reshape(n, batch).mean(axis=1)
        errors.append(float(means.std(ddof=1)) / sqrt(n))
        batch *= 2
    return max(errors)


def _between_halves(levels: FloatArray) -> float:
    half = len(levels) // 2
    return abs(float(levels[:half].mean() - levels[half:].mean()))


# --------------------
# What the changes mean.
# --------------------


def change_findings(
    changes: Sequence[LevelChange], signals: AnalysisSignals, reference: AnalysisSignals, named: Sequence[Finding]
) -> list[Finding]:
    """Return the changes since the reference as the first finding, and what they may mean.

    Parameters
    ----------
    changes : sequence of LevelChange
    signals, reference : AnalysisSignals
    named : sequence of Finding
        Findings of the recording alone: a bearing part identified there is not reported again.
    """
    unknown = []
    if all(c.kind == "overall" for c in changes):
        why = "one of the two is too short"
        if signals.angle is None or reference.angle is None:
            why = "the speed of one of the two is not known"
        elif abs(_speed_off(signals, reference)) > OTHER_SPEED:
            why = "the two run through different speeds, or one is too short"
        title = f"Changes since the reference cannot be told by order: {why}."
        surer = "Two recordings of at least 16 revolutions at the same known speed."
        unknown = [cannot_tell("change-not-examined", title, surer=surer)]
        if not any(c.is_change for c in changes):
            return unknown
    findings, rest = changed_sensors(changes)
    findings = [*unknown, *findings]
    changed = [c for c in rest if c.is_change and (c.change_db > 0 or c.kind != "bearing")]  # bearings do not heal
    if not changed:
        return [*findings, _unchanged(rest)] if rest else findings
    off = _speed_off(signals, reference)
    # Hum of a cable and a motor's field are no faults by themselves, but their change is reported.
    risen = _largest([c for c in changed if c.change_db > 0 and c.kind != "mains" and _matters(c, rest)])
    headline = _changed(_largest(changed), off)
    if (apart := _speeds_apart(signals, reference)) > OTHER_SPEED:
        beyond_db = MIN_CHANGE_DB + _by_speed_alone_db(apart)
        multiples = [c for c in risen if c.kind == "shaft" and c.harmonic >= 3 and c.change_db >= TOGETHER_DB]
        together = multiples if len(multiples) >= N_TOGETHER else []
        beyond_speed = [c for c in risen if c.change_db >= beyond_db or c in together]
        if not beyond_speed:
            return [*findings, replace(headline, kind=Kind.NOTICE), *([_left_open(apart)] if risen else [])]
        risen = beyond_speed
        text = f"Speeds up to {100 * apart:.1f} % apart explain no more than {beyond_db - MIN_CHANGE_DB:.0f} dB of it."
        headline = replace(headline, evidence=(*headline.evidence, text))
    claimed = {f.where.bearing for f in named if f.is_claim}
    meanings = _meanings(risen, rest, signals, claimed)
    if not meanings and risen:
        more = "It has no pattern of a known fault: load, temperature or a moved sensor would have the same effect."
        if any(c.kind == "bearing" and c.where.bearing in claimed for c in risen):
            more = "Damage to the bearing named explains it: its impacts raise the noise as well."
        headline = replace(headline, evidence=(*headline.evidence, more))
    is_speed_known = signals.angle is not None and reference.angle is not None
    is_reason = risen and is_speed_known  # a different speed changes every level
    return [*findings, headline if is_reason else replace(headline, kind=Kind.NOTICE), *meanings]


def _left_open(apart: float) -> Finding:
    title = (
        f"What the change means cannot be told: the speeds are up to {100 * apart:.1f} % apart, and a resonance that "
        f"one of them meets may explain {_by_speed_alone_db(apart):.0f} dB."
    )
    return cannot_tell("change-at-another-speed", title, surer="A recording at the reference's speed.")


TOGETHER_DB, N_TOGETHER = 10.0, 4
"""Rise of a shaft's higher multiples, and their number, that a different speed does not explain: it brings one or two
of them nearer to resonances, not all."""

DEEPEST_DB = 40.0
"""A line this far below a channel's strongest line in the reference is no concern yet when it rises."""


def _matters(change: LevelChange, changes: Sequence[LevelChange]) -> bool:
    if change.kind in ("bearing", "noise", "overall"):
        return True
    strongest_db = max(c.reference_db for c in changes if c.where.channels == change.where.channels)
    return change.level_db >= strongest_db - DEEPEST_DB


def _largest(changes: Sequence[LevelChange]) -> list[LevelChange]:
    """Return each label once, from the channel and band where it changed most, in the order compared."""
    best: dict[str, LevelChange] = {}
    for change in changes:
        if change.label not in best or abs(change.change_db) > abs(best[change.label].change_db):
            best[change.label] = change
    return list(best.values())


def _unchanged(changes: Sequence[LevelChange]) -> Finding:
    shown = [c for c in changes if c.stands_out]
    largest = max(shown, key=lambda c: abs(c.change_db), default=None)
    evidence = (f"The largest change is {signed(largest.change_db)} dB: {largest.label}.",) if largest else ()
    return Finding(
        UNCHANGED,
        Kind.INFORMATION,
        f"{LEVELS_MATCH}: none has changed by {MIN_CHANGE_DB:.0f} dB or more, beyond its scatter.",
        confidence=0.9,
        confidence_basis=f"{len(changes)} levels: shafts, meshes, sidebands, bearings, noise; segment against segment",
        evidence=evidence,
    )


def _changed(changes: Sequence[LevelChange], off: float) -> Finding:
    changes = sorted(changes, key=lambda c: c.kind == "noise")  # lines are more informative
    risen, fallen = ([c for c in changes if sign * c.change_db > 0] for sign in (1, -1))
    texts = [", ".join(f"{c.label} {signed(c.change_db)} dB" for c in (risen or fallen)[:4])]
    rest = len(risen or fallen) - 4
    texts += [f"{rest} more up" if risen else f"{rest} more down"] if rest > 0 else []
    texts += [f"{counted(len(fallen), 'level')} down"] if risen and fallen else []
    repeats = max(0.1, *(c.repeatability_db for c in (risen or fallen)[:4]))
    first = max(risen or fallen, key=lambda c: abs(c.change_db))
    value, floor = (10 ** (level / 20) for level in (first.level_db, first.reference_db))
    evidence = [
        f"{c.label} in {c.where.channels[0]}: {signed(c.change_db)} dB; the halves of a recording differ by "
        f"{c.repeatability_db:.1f} dB."
        for c in changes[:12]
    ]
    if abs(off) > OTHER_SPEED:
        evidence.insert(
            0,
            f"The speed differs by {signed(100 * off, 0)} %: an unbalance alone would change 1× by "
            f"{signed(40 * np.log10(1 + off))} dB, and resonances meet other orders.",
        )
    return Finding(
        CHANGED,
        Kind.SUSPICION,
        f"Changed since the reference: {', '.join(texts)}; halves of either recording agree within {repeats:.1f} dB.",
        first.where,
        Strength(value, first.unit, floor, f"{first.label}, rms", first.change_db, against="the reference's"),
        confidence=0.99,
        confidence_basis="that it has changed: by Welch's t over segments, after all levels compared",
        evidence=tuple(evidence),
        surer="The same comparison at the same speed and load on another day.",
    )


# The textbooks' signs: ISO 13373-3:2015, "Condition monitoring and diagnostics of machines – Vibration condition
# monitoring – Part 3: Guidelines for vibration diagnosis"; R. B. Randall, 2021, ch. 2.

_FIT = "how well the textbook's signs fit, one sensor's levels alone; not calibrated"
BENT_SHAFT, NOT_OF_UNBALANCE = 0.3, 0.3
"""Weight of a bent shaft relative to an unbalance where nothing distinguishes them; and factor on an unbalance for each
sign that an unbalance of a linear machine would not produce."""

DOUBLE_OF_SINGLE = 0.1
"""Amplitude ratio of 2× in the added vibration above which it counts as a sign: every rotor has some."""

AXIAL_OF_RADIAL = 0.5
"""Amplitude ratio to the vibration added radially at 1×, above which a shaft counts as vibrating axially: an unbalance
causes this as well, by the tilt of its supports, but less."""

OTHER_CAUSES = 0.3
"""Weight of all causes that no textbook pattern covers, relative to those covered."""


def _meanings(
    risen: Sequence[LevelChange], changes: Sequence[LevelChange], signals: AnalysisSignals, claimed: AbstractSet[str]
) -> list[Finding]:
    """Return what the changes may mean, most likely first; without bearings that are named already."""
    findings: list[Finding] = []
    for shaft in signals.known_shaft_orders:
        findings += _of_shaft(shaft, risen, changes, signals)
    for pair in signals.rig.pairs:
        findings += _of_pair(pair.name, risen, changes)
    of_parts = [c for c in risen if c.kind == "bearing"]
    named = [c.where.order for c in of_parts if c.where.bearing in claimed and c.where.order]  # bearings of one size
    parts = [
        c
        for c in of_parts
        if c.where.bearing not in claimed
        and not any(c.where.order and abs(c.where.order / order - 1.0) < SAME_BEARING_ORDER for order in named)
    ]
    if parts:
        findings.append(_of_bearing(max(parts, key=lambda c: c.change_db)))
    if risen and all(c.kind == "noise" for c in risen) and not any(claimed):
        findings.append(_of_noise(risen, has_bearings=bool(signals.rig.bearings)))
    if signals.rig.assumed:
        findings = [replace(f, confidence=f.confidence * WITH_ASSUMED_DATA) for f in findings]
    return findings


SHAFT_CAUSES: Mapping[str, tuple[str, str]] = {
    "unbalance": (
        "unbalance",
        "1× largest in radial direction, 90° apart between horizontal and vertical, growing with the speed's square.",
    ),
    "bent-shaft": (
        "a bent shaft",
        "1× large in axial direction, 180° apart between the shaft's ends; run-out when it is turned by hand.",
    ),
    "misalignment": (
        "misalignment",
        "2× large in axial direction, 180° apart across the coupling; a change with temperature or after aligning.",
    ),
    "looseness": (
        "looseness",
        "A wandering phase; levels that differ between foot and foundation, or change when bolts are tightened.",
    ),
    "rub": (
        "a rub",
        "Halves and thirds of the shaft's order come and go with speed and temperature; marks at seals.",
    ),
    OIL_WHIRL: ("oil whirl in the plain bearings", CONFIRMS_WHIRL),
}


def _of_shaft(
    shaft: str, risen: Sequence[LevelChange], changes: Sequence[LevelChange], signals: AnalysisSignals
) -> Iterator[Finding]:
    """Yield what a shaft's orders mean, by their share of the added vibration.

    Unbalance adds 1× alone; misalignment 2×, at half of 1× or more; a bent shaft both; looseness many harmonics and
    halves; a rub halves, thirds and noise. A force rotating with the shaft produces 2× only through a nonlinear
    stiffness, and causes little axial vibration, where a bent shaft causes most. Without an axial sensor unbalance and
    a bent shaft are one finding, as nothing distinguishes them; so are looseness and a rub if halves or thirds come
    without noise. Oil whirl adds a line a little below one half.
    """
    of_shaft = [c for c in risen if c.where.shaft == shaft and c.kind in ("shaft", "subharmonic")]
    added = {c.harmonic: _velocity(c, signals, since=True) for c in of_shaft}
    total = sum(added.values())
    if total <= 0:
        return
    first, second = added.get(1.0, 0.0) / total, added.get(2.0, 0.0) / total
    now = {
        c.harmonic: _velocity(c, signals)
        for c in changes
        if c.where.shaft == shaft and c.kind == "shaft" and c.where.channels == of_shaft[0].where.channels
    }
    doubled = sqrt(now.get(2.0, 0.0) / max(now.get(1.0, 0.0), 1e-300))
    many = sum(k >= 3 for k in added) / N_HARMONICS
    fractions = sum(c.kind == "subharmonic" and c.harmonic in SUBHARMONICS for c in of_shaft)
    whirl = added.get(sum(WHIRL_ORDERS) / 2, 0.0) / total
    noise = any(c.kind == "noise" for c in risen)
    loose = min(1.0, many + 0.25 * fractions)  # with many harmonics, the first two say nothing by themselves
    of_one_turn = [c for c in changes if c.where.shaft == shaft and c.kind == "shaft" and c.harmonic == 1.0]
    axial = [c for c in of_one_turn if _is_axial(c, signals)]
    radial = max((_velocity(c, signals, since=True) for c in of_one_turn if c not in axial), default=0.0)
    moved = max((_velocity(c, signals, since=True) for c in axial if c.is_change), default=0.0)
    shakes_axially = moved > AXIAL_OF_RADIAL**2 * radial
    bends = second >= DOUBLE_OF_SINGLE**2
    bend = BENT_SHAFT if not axial else 1.0 if shakes_axially else BENT_SHAFT**2
    weights = {
        "unbalance": first**2 * (1.0 - loose) * NOT_OF_UNBALANCE ** (shakes_axially + bends),
        "bent-shaft": bend * first * (1.0 + bends) * (1.0 - loose),
        "misalignment": min(1.0, second / 0.2) * min(1.0, doubled / 0.5) * (1.0 - loose),
        "looseness": loose,
        "rub": min(1.0, 0.2 * fractions * (1 + noise)),
        OIL_WHIRL: min(1.0, whirl / 0.2) * (1.0 - loose),
    }
    whole = sum(weights.values()) + OTHER_CAUSES
    place = max(of_shaft, key=lambda c: added[c.harmonic]).where
    name = f" of {place.shaft}" if place.shaft else ""
    text = "Of the vibration added, as velocity, " + ", ".join(
        f"{percent(power / total)} is at {c.label}" for c in of_shaft if (power := added[c.harmonic]) >= 0.01 * total
    )
    evidence = (f"{text}.", *_mains_at(max(of_shaft, key=lambda c: added[c.harmonic]), signals))
    alike: list[AbstractSet[str]] = [] if axial else [{"unbalance", "bent-shaft"}]
    alike += [{"looseness", "rub"}] if fractions and not noise else []
    for causes in _told_apart(weights, alike):
        share = sum(weights[cause] for cause in causes) / whole
        if share >= 0.1:
            titles, confirms = zip(*(SHAFT_CAUSES[cause] for cause in causes), strict=True)
            title, confirm = f"Perhaps {' or '.join(titles)}{name}.", " Or ".join(confirms)
            likely = Kind.SUSPICION if share >= 0.3 else Kind.NOTICE
            yield Finding(causes[0], likely, title, place, None, share, _FIT, evidence, confirm)


def _mains_at(change: LevelChange, signals: AnalysisSignals) -> Iterator[str]:
    """Report a multiple of the mains at a shaft's line, as far as the record and a varying speed can resolve them."""
    hertz = change.where.frequency_hz
    if hertz is None:
        return
    spread_hz = _spread_hz(signals, hertz / signals.frequency_per_order_hz)
    reach_hz = spread_hz / 2 + 2 * signals.spectra[change.where.channels[0]].resolution
    for mains_hz in MAINS_HZ:
        place_hz = mains_hz * round(hertz / mains_hz)
        if place_hz > 0 and abs(place_hz - hertz) <= reach_hz:
            yield f"{place_hz:g} Hz of the mains is there, too, as far as this record tells: hum stays at standstill."


def _told_apart(weights: Mapping[str, float], alike: Sequence[AbstractSet[str]]) -> list[list[str]]:
    """Return the causes, most likely first; those that nothing distinguishes form one group."""
    groups: dict[str, list[str]] = {}
    for cause in sorted(weights, key=lambda cause: -weights[cause]):
        first = next((first for first in groups if any({first, cause} <= causes for causes in alike)), cause)
        groups.setdefault(first, []).append(cause)
    return sorted(groups.values(), key=lambda group: -sum(weights[cause] for cause in group))


def _is_axial(change: LevelChange, signals: AnalysisSignals) -> bool:
    """Whether the name or position of a level's channel says that it measures along the shaft."""
    channel = signals.recording.channels[signals.recording.index(change.where.channels[0])]
    return "axial" in f"{channel.position} {channel.name}".lower()


def _velocity(change: LevelChange, signals: AnalysisSignals, *, since: bool = False) -> float:
    """Return a line's mean square as velocity, up to a factor; `since`: what was added since the reference.

    Acceleration is weighted by 1/order², displacement by order².
    """
    power = 10 ** (change.level_db / 10) - since * 10 ** (change.reference_db / 10)
    return float(power * change.harmonic ** (-2 * derivatives_of_velocity(signals, change.where.channels[0])))


def _of_pair(name: str, risen: Sequence[LevelChange], changes: Sequence[LevelChange]) -> Iterator[Finding]:
    mesh = [c for c in risen if c.kind == "mesh" and c.where.gear == name]
    fallen = _largest([c for c in changes if c.is_change and c.change_db < 0 and c.where.gear == name])
    fallen = [c for c in fallen if c.kind == "mesh"]
    sides = [c for c in risen if c.kind == "sidebands" and c.where.gear.startswith(f"{name}/")]
    if mesh:
        confirm = (
            "The same load as in the reference; second and third harmonic rise more than the first with wear; wear "
            "particles in the oil; contact pattern and backlash."
        )
        title = f"Perhaps wear, another load, or misaligned teeth at {named('gear pair', name)}."
        share = len(mesh) / (len(mesh) + len(fallen))
        likely = Kind.SUSPICION if share > 0.5 else Kind.NOTICE
        evidence = (*(c.text for c in mesh), *(f"Against it: {c.text}" for c in fallen))
        yield Finding("mesh-risen", likely, title, mesh[0].where, None, 0.5 * share, _FIT, evidence, confirm)
    for sideband in sides:
        confirm = "The average of that shaft: one tooth or all around; run-out, keys and couplings; another load."
        shaft = sideband.where.gear.partition("/")[2]
        title = f"Perhaps an eccentric, loose or damaged gear on shaft {shaft}."
        yield Finding(
            "sidebands-risen", Kind.SUSPICION, title, sideband.where, None, 0.5, _FIT, (sideband.text,), confirm
        )


def _of_bearing(change: LevelChange) -> Finding:
    confirm = "The same part in another band or sensor; its level over days; grease, temperature, noise when turned."
    title = f"Perhaps damage at the {change.label}."
    return Finding("bearing-risen", Kind.SUSPICION, title, change.where, None, 0.5, _FIT, (change.text,), confirm)


def _of_noise(risen: Sequence[LevelChange], *, has_bearings: bool) -> Finding:
    confirm = "Lubricant and temperature; flow, suction and leaks; the sensor's mounting; a look for rubbing parts."
    causes = "poor lubrication, a rub, turbulence or cavitation"
    if has_bearings:  # a rolling element that turns out of its track, and wear all around, repeat at no steady rate
        causes = "a worn bearing or a damaged rolling element, " + causes
    title = f"Perhaps {causes}: noise has risen, but no line."
    return Finding(
        "noise-risen", Kind.SUSPICION, title, risen[0].where, None, 0.4, _FIT, tuple(c.text for c in risen), confirm
    )
