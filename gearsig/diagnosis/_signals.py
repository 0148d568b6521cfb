"""The signals and spectra of an analysis: what the detectors look at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.diagnosis._types import AnalysisSettings, ChannelAnalysis, Finding, Kind, OrderLevel
from gearsig.errors import InputError, RefusalError
from gearsig.orders import OrderMap, SeparatedAverage, SynchronousAverage, separate, whole_revolutions
from gearsig.prepared import Comb, LineExcess, PreparedRecording, best_comb, envelope_bands, floor_of
from gearsig.recording import Recording
from gearsig.rig import Rig
from gearsig.spectra import BandCandidate, Kurtogram, Spectrum

SPEED_CHANGE = 0.01
"""Relative range of speed above which a spectrum over frequency smears and a map along speed is made."""


@dataclass(frozen=True)
class ShaftSignals:
    """What belongs to one shaft.

    Parameters
    ----------
    shaft : str
    teeth : tuple of int
        Of the gears on it, as far as they are known.
    angle : ShaftAngle
    averages : mapping
        Channel → synchronous average.
    separated : mapping
        Channel → its parts; empty where no teeth are known or the mesh is beyond the sampling rate.
    halves : mapping
        Channel → difference signals, (2, n_angles), of the odd and of the even revolutions by themselves.
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
    """Everything that is computed once and looked at by several detectors.

    Parameters
    ----------
    recording : Recording
        Only the channels that are analysed.
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
        Whether a recording of the healthy machine was given: then none is asked for.
    """

    recording: Recording
    rig: Rig
    angle: ShaftAngle | None
    settings: AnalysisSettings
    spectra: Mapping[str, Spectrum]
    order_excess: Mapping[str, LineExcess]
    shafts: tuple[ShaftSignals, ...]
    order_maps: Mapping[str, OrderMap]
    has_reference: bool = False

    @property
    def known_shaft_orders(self) -> dict[str, float]:
        """Order of each shaft whose order is known; the reference shaft alone if there is no gear train."""
        if self.angle is None:
            return {}
        ratios = {name: self.rig.ratio(name) for name in self.rig.shaft_names}
        known = {name: ratio for name, ratio in ratios.items() if ratio is not None}
        return known or {self.angle.shaft: 1.0}

    @property
    def frequency_per_order_hz(self) -> float:
        """Mean rotational frequency of the reference shaft."""
        if self.angle is None:
            raise RefusalError("the speed is not known")
        return self.angle.mean_speed_rpm / 60

    @property
    def speed_varies(self) -> bool:
        """Whether the speed changes by more than `SPEED_CHANGE` over the record."""
        if self.angle is None:
            return False
        low, high = self.angle.speed_range_rpm
        return (high - low) > SPEED_CHANGE * self.angle.mean_speed_rpm


def compute_signals(
    prepared: PreparedRecording, names: Sequence[str], angle: ShaftAngle | None, settings: AnalysisSettings
) -> AnalysisSignals:
    """Compute what the detectors need of the named channels, as far as the speed and the rig allow."""
    spectra = {name: prepared.spectrum(name) for name in names}
    excess: dict[str, LineExcess] = {}
    shafts: tuple[ShaftSignals, ...] = ()
    maps: dict[str, OrderMap] = {}
    if angle is not None and angle.n_revolutions >= settings.minimum_revolutions:
        try:
            prepared.over_angle(channels=names)  # all channels at once
            excess = {name: prepared.order_lines(name) for name in names}
            shafts = _shaft_signals(prepared, names, angle, settings)
        except RefusalError:  # too few samples per revolution or too short: the detectors say that nothing is known
            excess, shafts = {}, ()
    recording = prepared.recording.select(names)
    result = AnalysisSignals(recording, prepared.rig, angle, settings, spectra, excess, shafts, maps)
    if excess and result.speed_varies:
        maps.update({name: prepared.order_map(name) for name in names})
    return result


def _shaft_signals(
    prepared: PreparedRecording, names: Sequence[str], angle: ShaftAngle, settings: AnalysisSettings
) -> tuple[ShaftSignals, ...]:
    """Average each shaft's revolutions, wherever its order is known and it turns often enough."""
    rig = prepared.rig
    ratios = {shaft: rig.ratio(shaft) for shaft in rig.shaft_names} or {angle.shaft: 1.0}
    return tuple(
        _one_shaft(prepared, shaft, names)
        for shaft, ratio in ratios.items()
        if ratio is not None and angle.n_revolutions * ratio >= settings.minimum_revolutions
    )


def _one_shaft(prepared: PreparedRecording, shaft: str, names: Sequence[str]) -> ShaftSignals:
    signal = prepared.over_angle(shaft, names)
    averages = {name: prepared.average(shaft, name) for name in names}
    gears = [pair.teeth(shaft) for pair in prepared.rig.pairs if shaft in (pair.driver, pair.driven)]
    teeth = tuple(z for z in gears if z is not None)
    separated, halves = {}, {}
    for name, average in averages.items():
        visible = tuple(z for z in teeth if z <= average.highest_line)
        if visible and np.any(average.values):
            try:
                separated[name] = separate(average, visible)
            except (RefusalError, InputError):
                continue  # nothing is left beside the mesh lines: there is no residual to look at
            halves[name] = np.stack([separate(h, visible).difference.values for h in _halves(signal, average)])
    return ShaftSignals(shaft, teeth, prepared.angle_of(shaft), averages, separated, halves, signal)


def _halves(signal: AngleSignal, average: SynchronousAverage) -> tuple[SynchronousAverage, SynchronousAverage]:
    """Average the odd and the even revolutions by themselves: what the machine does is in both."""
    revolutions = whole_revolutions(signal, average.channel)
    odd, even = (
        replace(average, values=revolutions[start::2].mean(axis=0), n_revolutions=len(revolutions[start::2]))
        for start in (0, 1)
    )
    return odd, even


# --------------------
# Envelope spectra of several bands, where impacts of bearings show.
# --------------------


@dataclass(frozen=True)
class BandEnvelope:
    """Envelope spectrum of one band of one channel, with its floor.

    Parameters
    ----------
    channel : str
    band_hz : (float, float)
    excess : LineExcess
        Over order where the speed is known, else over frequency.
    mean : float
        Mean of the envelope: lines over it are modulation depths.
    """

    channel: str
    band_hz: tuple[float, float]
    excess: LineExcess
    mean: float


def band_envelopes(signals: AnalysisSignals) -> Iterator[BandEnvelope]:
    """Yield the envelope spectra of all channels and bands."""
    for band in envelope_bands(signals.recording.sampling_rate_hz):
        yield from envelopes_in(signals, signals.recording, band)


def envelopes_in(signals: AnalysisSignals, recording: Recording, band: tuple[float, float]) -> Iterator[BandEnvelope]:
    """Yield the envelope spectra of a recording's channels in one band; none if it is too narrow or too short.

    Over order where the speed is known: then a speed that varies does not smear them.
    """
    from gearsig.angle import resample_to_angle
    from gearsig.orders import order_spectrum
    from gearsig.spectra import amplitude_spectrum, envelope_recording

    try:
        envelopes = envelope_recording(recording, band, kind="magnitude")
    except InputError:
        return  # the record is too short for so narrow a band
    over_angle = None
    if signals.angle is not None:
        fastest = max(signals.known_shaft_orders.values(), default=1.0)
        highest = min(
            signals.settings.highest_modulation_order * fastest,
            0.4 * envelopes.sampling_rate_hz / signals.frequency_per_order_hz,
        )
        try:
            over_angle = resample_to_angle(envelopes, signals.angle, highest_order=highest)
        except (InputError, RefusalError):
            return  # the band is narrower than the modulations sought
    for name in envelopes.channel_names:
        spectrum = amplitude_spectrum(envelopes, name) if over_angle is None else order_spectrum(over_angle, name)
        yield BandEnvelope(name, band, floor_of(spectrum), float(envelopes.values(name).mean()))


# --------------------
# The band that a channel's own kurtogram chooses: searched beside the fixed ones, and a witness for bearings.
# --------------------


N_HARMONICS = 6
"""Of the fastest race, which the band must be wide enough to carry."""

SAME_FAMILY = 3e-3
"""Relative: the same bearing slips alike in all bands."""

SHOWS = 0.01
"""p-value of a family at a given order in this one band, from which on it bears the other bands out."""

MIN_LINES = 3

ROUNDING = 1e-9
"""Of the signal: what is left without its tones and lies below is no vibration."""


@dataclass(frozen=True)
class KurtogramBand:
    """A channel's kurtogram, the band it chooses, and the envelope there.

    Parameters
    ----------
    kurtogram : Kurtogram
        Of the channel without its steady tones.
    band : BandCandidate
        The most impulsive one that is wide enough.
    envelope : BandEnvelope
    """

    kurtogram: Kurtogram
    band: BandCandidate
    envelope: BandEnvelope

    @property
    def text(self) -> str:
        """The band in words."""
        low, high = self.band.band_hz
        return (
            f"The kurtogram's own band, {low / 1000:.3g} to {high / 1000:.3g} kHz (kurtosis {self.band.kurtosis:.2g})"
        )


def kurtogram_bands(signals: AnalysisSignals) -> tuple[KurtogramBand, ...]:
    """Return each channel's own band; none where no bearing's speed is known or no band is wide enough."""
    races = [
        ratio * order
        for bearing in signals.rig.bearings
        if (ratio := signals.rig.ratio(bearing.shaft)) is not None
        for name, order in bearing.orders().items()
        if name == "BPFI"
    ]
    if signals.angle is None or not races:
        return ()
    narrowest_hz = N_HARMONICS * max(races) * signals.frequency_per_order_hz
    bands = (_kurtogram_band(signals, name, narrowest_hz) for name in signals.recording.channel_names)
    return tuple(band for band in bands if band is not None)


def witness(band: KurtogramBand, order: float) -> Comb | None:
    """Return the family at an order found elsewhere, if the own band shows it too."""
    comb = best_comb(band.envelope.excess, order * (1 - SAME_FAMILY), order * (1 + SAME_FAMILY))
    return comb if comb is not None and comb.p_value <= SHOWS and len(comb.positions) >= MIN_LINES else None


def witness_text(
    bands: Sequence[KurtogramBand], channel: str, band_hz: tuple[float, float], order: float
) -> tuple[str, ...]:
    """Say what a channel's own band shows of a family found at `order` in the band `band_hz`."""
    band = next((b for b in bands if b.envelope.channel == channel), None)
    if band is None:
        return ()
    comb = witness(band, order)
    if comb is None:
        return (f"{band.text}, does not show it.",)
    largest = f"{max(comb.ratios_db):.0f} dB over its floor"
    if band.envelope.band_hz == band_hz:
        return (f"{band.text}, shows it clearest of all bands, {largest}.",)
    return (f"{band.text}, shows the same family, {largest}.",)


def _kurtogram_band(signals: AnalysisSignals, channel: str, narrowest_hz: float) -> KurtogramBand | None:
    from gearsig.spectra import kurtogram, prepared_signal

    fs = signals.recording.sampling_rate_hz
    recorded = signals.recording.values(channel)
    x = prepared_signal(recorded, fs, "tones removed")
    if np.std(x) < ROUNDING * np.std(recorded):
        return None  # a model's tones are all there is: what is left of them are the rounding errors of their removal
    try:
        grid = kurtogram(x, fs, source=f"{channel}, tones removed")
        band = grid.best_band(narrowest_hz=narrowest_hz)
    except RefusalError:  # the record is too short, or the races too fast for the sampling rate
        return None
    without_tones = replace(signals.recording.select([channel]), samples=x[None, :])
    envelope = next(envelopes_in(signals, without_tones, band.band_hz), None)
    return None if envelope is None else KurtogramBand(grid, band, envelope)


# --------------------
# What an analysis keeps of each channel: the signals that were looked at, and the bands that told most.
# --------------------


@dataclass(frozen=True)
class ExaminedSignals:
    """Everything that the detectors look at.

    Parameters
    ----------
    signals : AnalysisSignals
    envelopes : list of BandEnvelope
        Of fixed bands.
    kurtogram_bands : tuple of KurtogramBand
        Bands that the kurtograms choose, at most one per channel.
    order_levels : mapping
        Channel → levels over speed, where the speed runs through a range.
    """

    signals: AnalysisSignals
    envelopes: list[BandEnvelope]
    kurtogram_bands: tuple[KurtogramBand, ...]
    order_levels: Mapping[str, tuple[OrderLevel, ...]]


def channel_analysis(material: ExaminedSignals, name: str, findings: Sequence[Finding]) -> ChannelAnalysis:
    """Return the signals and spectra of one channel."""
    from gearsig.spectra import power_density

    signals = material.signals
    envelope = _shown_envelope(material, name, findings)
    shown_band = _shown_kurtogram_band(material, name, findings)
    return ChannelAnalysis(
        channel=name,
        spectrum=signals.spectra[name],
        power_density=power_density(signals.recording, name),
        envelope_spectrum=envelope.excess.spectrum if envelope else None,
        envelope_band_hz=envelope.band_hz if envelope else None,
        order_spectrum=signals.order_excess[name].spectrum if name in signals.order_excess else None,
        order_map=signals.order_maps.get(name),
        averages=_averages(signals, name),
        kurtogram=shown_band.kurtogram if shown_band else None,
        kurtogram_band=shown_band.band if shown_band else None,
        order_levels=material.order_levels.get(name, ()),
    )


def _averages(signals: AnalysisSignals, name: str) -> dict[tuple[str, str], SynchronousAverage]:
    averages = {}
    for shaft in signals.shafts:
        averages[shaft.shaft, "average"] = shaft.averages[name]
        if name in shaft.separated:
            parts = shaft.separated[name]
            for part in (parts.residual, parts.difference, parts.regular):
                averages[shaft.shaft, part.kind] = part
    return averages


def _shown_envelope(material: ExaminedSignals, name: str, findings: Sequence[Finding]) -> BandEnvelope | None:
    """Return the envelope in which the surest family of impacts was found, else the one whose lines stand out most."""
    envelopes = [*material.envelopes, *(candidates.envelope for candidates in material.kurtogram_bands)]
    candidates = [e for e in envelopes if e.channel == name]
    if not candidates:
        return None
    for finding in findings:
        for envelope in candidates:
            if finding.where.band_hz == envelope.band_hz and name in finding.where.channels:
                return envelope
    return max(candidates, key=lambda e: float(e.excess.scores().sum()))


def _shown_kurtogram_band(material: ExaminedSignals, name: str, findings: Sequence[Finding]) -> KurtogramBand | None:
    """Return the channel's own band where it shows a damage that is claimed of a bearing, on this channel."""
    band = next((band for band in material.kurtogram_bands if band.envelope.channel == name), None)
    places = [f.where for f in findings if f.where.bearing and f.kind in (Kind.FAULT, Kind.SUSPICION)]
    if band is None:
        return None
    orders = [where.order for where in places if name in where.channels and where.order is not None]
    return band if any(witness(band, order) for order in orders) else None
