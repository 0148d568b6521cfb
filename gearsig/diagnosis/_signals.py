"""The signals and spectra of an analysis, which the detectors examine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import log10

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import AngleSignal, OffsetComb, ShaftAngle, find_offset_comb
from gearsig.checks import FloatArray
from gearsig.diagnosis._types import AnalysisSettings, ChannelAnalysis, Finding, OrderLevel, Strength, Where
from gearsig.errors import InputError, RefusalError
from gearsig.orders import OrderMap, SeparatedAverage, SynchronousAverage, separate, whole_revolutions
from gearsig.prepared import (
    Comb,
    LinesOverFloor,
    PreparedRecording,
    best_comb,
    envelope_bands,
    lines_over_noise_floor,
    over_floor_db,
)
from gearsig.recording import Recording
from gearsig.rig import Rig
from gearsig.spectra import BandCandidate, Kurtogram, Spectrum


@dataclass(frozen=True)
class ShaftSignals:
    """The signals of one shaft.

    Parameters
    ----------
    shaft : str
    teeth : tuple of int
        Of the gears on it, as far as known.
    angle : ShaftAngle
    averages : mapping
        Channel → synchronous average.
    separated : mapping
        Channel → its parts; empty where no teeth are known or the mesh is beyond half the sampling rate.
    halves : mapping
        Channel → difference signals, (2, n_angles), of the odd and of the even revolutions separately.
    signal : AngleSignal
        The channels over this shaft's angle.
    """

    shaft: str
    teeth: tuple[int, ...]
    angle: ShaftAngle
    averages: Mapping[str, SynchronousAverage]
    separated: Mapping[str, SeparatedAverage]
    halves: Mapping[str, FloatArray]
    signal: AngleSignal


@dataclass(frozen=True)
class AnalysisSignals:
    """Everything that is computed once and examined by several detectors.

    Parameters
    ----------
    prepared : PreparedRecording
        The recording they were computed from.
    recording : Recording
        With only the channels that are analysed.
    rig : Rig
        An empty one if nothing is known.
    angle : ShaftAngle or None
        Of the reference shaft.
    settings : AnalysisSettings
    spectra : mapping
        Channel → amplitude spectrum over frequency.
    order_excess : mapping
        Channel → order spectrum with its floor; empty where the speed is not known.
    shafts : tuple of ShaftSignals
        Shafts of known order with enough revolutions.
    order_maps : mapping
        Channel → map along speed, where the speed varies.
    has_reference : bool
        Whether a recording of the healthy machine was given, so that none is asked for.
    over_angle : AngleSignal or None
        The channels over the reference shaft's angle; None where `order_excess` is empty.
    without_tones : dict
        Channel and band → lines of its envelope without steady tones, once requested, see `is_of_tones`.
    """

    prepared: PreparedRecording
    recording: Recording
    rig: Rig
    angle: ShaftAngle | None
    settings: AnalysisSettings
    spectra: Mapping[str, Spectrum]
    order_excess: Mapping[str, LinesOverFloor]
    shafts: tuple[ShaftSignals, ...]
    order_maps: Mapping[str, OrderMap]
    has_reference: bool = False
    over_angle: AngleSignal | None = None
    without_tones: dict[tuple[str, tuple[float, float]], LinesOverFloor | None] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @property
    def known_shaft_orders(self) -> dict[str, float]:
        """Order of each shaft whose order is known; only the reference shaft if there is no gear train."""
        if self.angle is None:
            return {}
        ratios = {name: self.rig.ratio(name) for name in self.rig.shaft_names}
        known = {name: ratio for name, ratio in ratios.items() if ratio is not None}
        return known or {self.angle.shaft: 1.0}

    @property
    def known_mesh_orders(self) -> dict[str, float]:
        """Mesh order of each pair whose order is known."""
        orders = {pair.name: self.rig.mesh_order(pair) for pair in self.rig.pairs}
        return {name: order for name, order in orders.items() if order is not None}

    @property
    def frequency_per_order_hz(self) -> float:
        """Mean rotational frequency of the reference shaft, in Hz."""
        if self.angle is None:
            raise RefusalError("the speed is not known")
        return self.angle.mean_speed_rpm / 60

    @cached_property
    def offset_comb(self) -> OffsetComb | None:
        """The gears' comb at another multiple of the mean speed, if any; sought only once, as it takes long."""
        return find_offset_comb(self.recording, self.rig, 60.0 * self.frequency_per_order_hz)

    @property
    def speed_varies(self) -> bool:
        """Whether the speed changes by more than 1 %: spectra over frequency smear, and a map along speed is made."""
        return self.angle is not None and not self.angle.is_steady()

    def hertz_text(self, order: float, digits: int = 5) -> str:
        """Return the frequency of an order as text, or its range if the speed varies."""
        if self.angle is None or not self.speed_varies:
            return f"{order * self.frequency_per_order_hz:.{digits}g} Hz"
        low, high = (order * rpm / 60 for rpm in self.angle.speed_range_rpm)
        return f"{low:.4g} to {high:.4g} Hz"

    def where(self, order: float, channel: str = "", *, shaft: str = "", gear: str = "", bearing: str = "") -> Where:
        """Return the location of an order of the reference shaft; at a steady speed with its frequency."""
        hertz = order * self.frequency_per_order_hz if self.angle is not None and not self.speed_varies else None
        channels = (channel,) if channel else ()
        return Where(channels, shaft, gear, bearing, order, self.rig.reference_shaft, hertz)


@dataclass(frozen=True)
class PlacedLine:
    """The largest line near a place in a spectrum.

    Parameters
    ----------
    position, amplitude : float
    floor : float
        Noise floor there.
    unit : str
    is_highest : bool
        Whether nothing nearby is higher: then the line belongs to that place and is not the foot of another.
    """

    position: float
    amplitude: float
    floor: float
    unit: str
    is_highest: bool = True

    @classmethod
    def at(cls, excess: LinesOverFloor, i: int) -> PlacedLine:
        """Return line number i."""
        spectrum = excess.spectrum
        return cls(float(spectrum.positions[i]), float(spectrum.values[i]), float(excess.floor[i]), spectrum.unit)

    @property
    def level_db(self) -> float:
        """20 lg(amplitude), also for an amplitude of zero."""
        return 20 * log10(max(self.amplitude, 1e-300))

    @property
    def ratio_db(self) -> float:
        """20 lg(amplitude/floor)."""
        return over_floor_db(self.amplitude, self.floor)

    def strength(self, floor_is: str) -> Strength:
        """Return the line's amplitude relative to its floor."""
        return Strength(self.amplitude, self.unit, self.floor, floor_is, self.ratio_db)


def line_at(
    excess: LinesOverFloor, place: float, within: float | None = None, around: float | None = None
) -> PlacedLine | None:
    """Return the largest line within 1.5 lines of a place, and whether it is the highest within six lines.

    None beyond the end of the spectrum. `within` and `around`, in the axis' unit, replace these widths.
    """
    spectrum = excess.spectrum
    if place > spectrum.positions[-1]:
        return None
    position, amplitude = spectrum.largest_near(place, 1.5 * spectrum.resolution if within is None else within)
    highest = spectrum.largest_near(place, 6.0 * spectrum.resolution if around is None else around)[1]
    return replace(PlacedLine.at(excess, spectrum.index_of(position)), is_highest=amplitude >= highest)


def compute_signals(
    prepared: PreparedRecording,
    names: Sequence[str],
    angle: ShaftAngle | None,
    settings: AnalysisSettings,
    *,
    has_reference: bool,
) -> AnalysisSignals:
    """Compute what the detectors need from the named channels, as far as speed and rig allow."""
    spectra = {name: prepared.spectrum(name) for name in names}
    excess: dict[str, LinesOverFloor] = {}
    shafts: tuple[ShaftSignals, ...] = ()
    over_angle: AngleSignal | None = None
    if angle is not None and angle.n_revolutions >= settings.minimum_revolutions:
        try:
            over_angle = prepared.over_angle(channels=names)  # all channels at once
            excess = {name: prepared.order_lines(name) for name in names}
            ratios = {shaft: prepared.rig.ratio(shaft) for shaft in prepared.rig.shaft_names} or {angle.shaft: 1.0}
            shafts = tuple(
                _one_shaft(prepared, shaft, names)
                for shaft, ratio in ratios.items()
                if ratio is not None and angle.n_revolutions * ratio >= settings.minimum_revolutions
            )
        except RefusalError:  # too few samples per revolution or too short: the detectors report it
            excess, shafts, over_angle = {}, (), None
    recording = prepared.fast_part.select(names)
    signals = AnalysisSignals(
        prepared, recording, prepared.rig, angle, settings, spectra, excess, shafts, {}, has_reference, over_angle
    )
    if not (excess and signals.speed_varies):
        return signals
    return replace(signals, order_maps={name: prepared.order_map(name) for name in names})


def _one_shaft(prepared: PreparedRecording, shaft: str, names: Sequence[str]) -> ShaftSignals:
    signal = prepared.over_angle(shaft, names)
    averages = {name: prepared.average(shaft, name) for name in names}
    teeth = tuple(prepared.rig.gear_teeth(shaft).values())
    separated, halves = {}, {}
    for name, average in averages.items():
        visible = tuple(z for z in teeth if z <= average.highest_line)
        if visible and np.any(average.values):
            try:
                separated[name] = separate(average, visible)
            except (RefusalError, InputError):
                continue  # nothing is left beside the mesh lines: there is no residual to examine
            halves[name] = np.stack([separate(h, visible).difference.values for h in _halves(signal, average)])
    return ShaftSignals(shaft, teeth, prepared.angle_of(shaft), averages, separated, halves, signal)


def _halves(signal: AngleSignal, average: SynchronousAverage) -> tuple[SynchronousAverage, SynchronousAverage]:
    """Average the odd and the even revolutions separately; what the machine does is in both."""
    revolutions = whole_revolutions(signal, average.channel)
    odd, even = (
        replace(
            average,
            values=revolutions[start::2].mean(axis=0, dtype=np.float64),
            n_revolutions=len(revolutions[start::2]),
        )
        for start in (0, 1)
    )
    return odd, even


@dataclass(frozen=True)
class BandEnvelope:
    """Envelope spectrum of one band of one channel, with its floor.

    Parameters
    ----------
    channel : str
    band_hz : (float, float)
    excess : LinesOverFloor
        Over order where the speed is known, else over frequency.
    mean : float
        Mean of the envelope: lines divided by it are modulation depths.
    over_angle : AngleSignal or None
        The envelopes of this band, all channels; None where the speed is not known.
    """

    channel: str
    band_hz: tuple[float, float]
    excess: LinesOverFloor
    mean: float
    over_angle: AngleSignal | None = None


def band_envelopes(signals: AnalysisSignals) -> Iterator[BandEnvelope]:
    """Yield the envelope spectra of all channels and bands."""
    recording = signals.recording
    transforms = {name: signals.prepared.joined_transform(name) for name in recording.vibration_names()}
    for band in envelope_bands(recording.sampling_rate_hz):
        yield from envelopes_in(signals, recording, band, transforms)


def envelopes_in(
    signals: AnalysisSignals,
    recording: Recording,
    band: tuple[float, float],
    transforms: Mapping[str, NDArray[np.complexfloating]] | None = None,
) -> Iterator[BandEnvelope]:
    """Yield the envelope spectra of a recording's channels in one band; none if it is too narrow or too short.

    Over order where the speed is known, so that a varying speed does not smear them.
    """
    from gearsig.angle import resample_to_angle
    from gearsig.orders import order_spectrum
    from gearsig.spectra import amplitude_spectrum, envelope_recording

    highest_hz = None
    fastest = max(signals.known_shaft_orders.values(), default=1.0)
    if signals.angle is not None:
        highest_hz = signals.settings.highest_modulation_order * fastest * signals.angle.speed_range_rpm[1] / 60
    try:
        envelopes = envelope_recording(recording, band, kind="magnitude", transforms=transforms, highest_hz=highest_hz)
    except InputError:
        return  # the record is too short for so narrow a band
    over_angle = None
    if signals.angle is not None:
        highest = min(
            signals.settings.highest_modulation_order * fastest,
            0.4 * envelopes.sampling_rate_hz / signals.frequency_per_order_hz,
        )
        try:
            over_angle = resample_to_angle(envelopes, signals.angle, highest_order=highest)
        except (InputError, RefusalError):
            return  # the band is narrower than the modulations sought
    for name in envelopes.channel_names:
        try:
            spectrum = amplitude_spectrum(envelopes, name) if over_angle is None else order_spectrum(over_angle, name)
            excess = lines_over_noise_floor(spectrum)
        except RefusalError:
            return  # the record is too short for modulations so slow
        yield BandEnvelope(name, band, excess, float(envelopes.values(name).mean()), over_angle)


def in_common_bands(
    signals: AnalysisSignals,
    envelopes: Sequence[BandEnvelope],
    reference: AnalysisSignals,
    reference_envelopes: Sequence[BandEnvelope],
    healthy: PreparedRecording,
) -> tuple[list[BandEnvelope], list[BandEnvelope]]:
    """Return the envelopes of two recordings in the same bands: those of the recording with the lower sampling rate.

    The prepared reference keeps its envelopes, as it is compared with many recordings of the same rate.
    """
    now, then = list(envelopes), list(reference_envelopes)
    if signals.recording.sampling_rate_hz > reference.recording.sampling_rate_hz:
        now = [e for band in _bands(then) for e in envelopes_in(signals, signals.recording, band)]
    elif signals.recording.sampling_rate_hz < reference.recording.sampling_rate_hz:
        bands = _bands(now)
        then = healthy.keep(
            ("diagnosis", "envelopes", reference.settings, bands),
            lambda: [e for band in bands for e in envelopes_in(reference, reference.recording, band)],
        )
    return now, then


def _bands(envelopes: Sequence[BandEnvelope]) -> tuple[tuple[float, float], ...]:
    return tuple(dict.fromkeys(envelope.band_hz for envelope in envelopes))


@dataclass(frozen=True)
class KurtogramBand:
    """A channel's kurtogram, the band it selects, and the envelope there.

    Parameters
    ----------
    kurtogram : Kurtogram
        Of the channel without its steady tones.
    band : BandCandidate
        The most impulsive band that is wide enough.
    envelope : BandEnvelope
    """

    kurtogram: Kurtogram
    band: BandCandidate
    envelope: BandEnvelope


def kurtogram_bands(signals: AnalysisSignals) -> tuple[KurtogramBand, ...]:
    """Return each channel's kurtogram band; none if no bearing's speed is known or no band is wide enough."""
    races = [
        ratio * order
        for bearing in signals.rig.bearings
        if (ratio := signals.rig.ratio(bearing.shaft)) is not None
        for name, order in bearing.orders().items()
        if name == "BPFI"
    ]
    if signals.angle is None or not races:
        return ()
    narrowest_hz = 6 * max(races) * signals.frequency_per_order_hz  # carries six harmonics of the fastest race
    bands = (_kurtogram_band(signals, name, narrowest_hz) for name in signals.recording.channel_names)
    return tuple(band for band in bands if band is not None)


MINIMUM_LINES = 3
"""Lines over 6 dB that a family must have: two may coincide with harmonics of something else by chance."""

SEEN_THERE = 0.01
"""p-value of a family in another envelope below which it counts as seen there as well."""


def witness(band: KurtogramBand, order: float) -> Comb | None:
    """Return the family at an order found elsewhere, if the kurtogram's band shows it too."""
    return seen_in(band.envelope.excess, order)


def seen_in(excess: LinesOverFloor, order: float) -> Comb | None:
    """Return the family at an order found elsewhere, if another envelope shows it too."""
    comb = best_comb(excess, order * (1 - 3e-3), order * (1 + 3e-3))  # a bearing slips alike in all bands
    is_seen = comb is not None and comb.p_value <= SEEN_THERE and len(comb.positions) >= MINIMUM_LINES
    return comb if is_seen else None


def witness_text(
    bands: Sequence[KurtogramBand], channel: str, band_hz: tuple[float, float], order: float
) -> tuple[str, ...]:
    """Return what a channel's kurtogram band shows of a family found at `order` in the band `band_hz`."""
    band = next((b for b in bands if b.envelope.channel == channel), None)
    if band is None:
        return ()
    low, high = (f"{edge / 1000:.3g}" for edge in band.band.band_hz)
    what = "The kurtogram's own band" if band.band.level > 0 else "The kurtogram's best, the whole spectrum"
    text = f"{what}, {low} to {high} kHz (kurtosis {band.band.kurtosis:.2g} with steady tones removed), "
    comb = witness(band, order)
    if comb is None:
        return (f"{text}does not show it.",)
    shows = "shows it most clearly of all bands" if band.envelope.band_hz == band_hz else "shows the same family"
    return (f"{text}{shows}, {max(comb.ratios_db):.0f} dB over its floor.",)


def _kurtogram_band(signals: AnalysisSignals, channel: str, narrowest_hz: float) -> KurtogramBand | None:
    from gearsig.spectra import kurtogram

    recording = _without_tones(signals, channel)
    if recording is None:
        return None
    try:
        grid = kurtogram(
            recording.values(channel),
            recording.sampling_rate_hz,
            narrowest_hz=narrowest_hz,
            source=f"{channel}, tones removed",
        )
        band = grid.best_band(narrowest_hz=narrowest_hz)
    except RefusalError:  # the record is too short, or the races too fast for the sampling rate
        return None
    envelope = next(envelopes_in(signals, recording, band.band_hz), None)
    return None if envelope is None else KurtogramBand(grid, band, envelope)


def _without_tones(signals: AnalysisSignals, channel: str) -> Recording | None:
    """Return a channel without its steady tones; None if there is nothing else."""
    return signals.prepared.keep(("diagnosis", "without tones", channel), lambda: _tones_removed(signals, channel))


def _tones_removed(signals: AnalysisSignals, channel: str) -> Recording | None:
    from scipy.fft import irfft

    from gearsig.spectra import prepared_lines

    recorded = signals.recording.values(channel)
    lines = prepared_lines(signals.prepared.transform(channel), "tones removed")
    if np.linalg.norm(lines) < 1e-9 * np.linalg.norm(signals.prepared.transform(channel)[1:]):
        return None  # simulated: only rounding errors of removing the tones are left
    x = np.asarray(irfft(lines, len(recorded), overwrite_x=True))
    return replace(signals.recording.select([channel]), samples=x[None, :])


def is_of_tones(signals: AnalysisSignals, envelope: BandEnvelope, order: float) -> bool:
    """Whether a family of an envelope vanishes with the steady tones, whose beats modulate as impacts do.

    Tones of a supply and of slots are steady enough. The impacts of a slipping bearing ring in tones for no longer than
    some turns of its cage, or excite a whole band, so that they remain when single lines are removed.
    """
    excess = lines_without_tones(signals, envelope)
    return excess is not None and seen_in(excess, order) is None


def lines_without_tones(signals: AnalysisSignals, envelope: BandEnvelope) -> LinesOverFloor | None:
    """Return the lines of an envelope without the steady tones; None if nothing else or no envelope is left."""
    key = envelope.channel, envelope.band_hz
    if key not in signals.without_tones:
        signals.without_tones[key] = _lines_without_tones(signals, *key)
    return signals.without_tones[key]


def _lines_without_tones(signals: AnalysisSignals, channel: str, band_hz: tuple[float, float]) -> LinesOverFloor | None:
    """Return the lines of a band's envelope, except shafts', without the steady tones; None if nothing is left."""
    recording = _without_tones(signals, channel)
    if recording is None:
        return None
    envelope = next(envelopes_in(signals, recording, band_hz), None)
    return None if envelope is None else without_shafts(signals, envelope.excess)


def without_shafts(signals: AnalysisSignals, excess: LinesOverFloor) -> LinesOverFloor:
    """Return lines without multiples of the shafts' orders, which belong to gears and shafts, not to bearings."""
    for order in signals.known_shaft_orders.values():
        excess = excess.without_multiples(order)
    return excess


def channel_analysis(
    signals: AnalysisSignals,
    name: str,
    envelopes: Sequence[BandEnvelope],
    kurtogram_bands: Sequence[KurtogramBand],
    levels: Sequence[OrderLevel],
    findings: Sequence[Finding],
    changes: Mapping[tuple[str, str], SynchronousAverage],
) -> ChannelAnalysis:
    """Return the signals and spectra of one channel: those examined, and the most informative bands.

    The envelope shown is the one with the most certain family of impacts, else the one whose lines stand out most. The
    kurtogram's band is shown if it confirms damage claimed of a bearing. `changes` are differences from a reference's
    averages, by shaft and channel; those of shafts with a damaged tooth are shown.
    """
    kurtogram_band = next((band for band in kurtogram_bands if band.envelope.channel == name), None)
    candidates = [e for e in (*envelopes, *([kurtogram_band.envelope] if kurtogram_band else [])) if e.channel == name]
    named = (e for f in findings for e in candidates if f.where.band_hz == e.band_hz and name in f.where.channels)
    clearest = max(candidates, key=lambda e: float(e.excess.scores().sum()), default=None)
    envelope = next(named, clearest)
    orders = [f.where.order for f in findings if f.where.bearing and f.is_claim and name in f.where.channels]
    if kurtogram_band is not None and not any(witness(kurtogram_band, order) for order in orders if order is not None):
        kurtogram_band = None
    averages = {}
    damaged = {f.where.shaft for f in findings if f.is_claim and f.where.angle_deg is not None}
    for shaft in signals.shafts:
        averages[shaft.shaft, "average"] = shaft.averages[name]
        if name in shaft.separated:
            parts = shaft.separated[name]
            averages |= {(shaft.shaft, p.kind): p for p in (parts.residual, parts.difference, parts.regular)}
        if shaft.shaft in damaged and (change := changes.get((shaft.shaft, name))) is not None:
            averages[shaft.shaft, change.kind] = change
    return ChannelAnalysis(
        channel=name,
        spectrum=signals.spectra[name],
        power_density=signals.prepared.power_density(name),
        envelope_spectrum=envelope.excess.spectrum if envelope else None,
        envelope_band_hz=envelope.band_hz if envelope else None,
        order_spectrum=signals.order_excess[name].spectrum if name in signals.order_excess else None,
        order_map=signals.order_maps.get(name),
        averages=averages,
        kurtogram=kurtogram_band.kurtogram if kurtogram_band else None,
        kurtogram_band=kurtogram_band.band if kurtogram_band else None,
        order_levels=tuple(levels),
    )
