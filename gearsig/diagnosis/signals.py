"""The signals and spectra of an analysis: what the detectors look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.diagnosis.comb import LineExcess, line_excess
from gearsig.diagnosis.settings import AnalysisSettings
from gearsig.errors import InputError, RefusalError
from gearsig.orders.revolutions import whole_revolutions
from gearsig.orders.separate import SeparatedAverage, highest_line, separate
from gearsig.orders.types import OrderMap, SynchronousAverage
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from gearsig.spectra.types import Spectrum

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
class Signals:
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
        Whether a recording of the sound machine was given: then none is asked for.
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


def compute_signals(recording: Recording, rig: Rig, angle: ShaftAngle | None, settings: AnalysisSettings) -> Signals:
    """Compute what the detectors need, as far as the speed and the rig allow."""
    from gearsig.spectra.amplitude import channel_spectrum

    names = recording.channel_names
    spectra = {name: channel_spectrum(recording, name) for name in names}
    excess: dict[str, LineExcess] = {}
    shafts: tuple[ShaftSignals, ...] = ()
    maps: dict[str, OrderMap] = {}
    if angle is not None and angle.n_revolutions >= settings.minimum_revolutions:
        try:
            signal = _resampled(recording, angle)
            excess = {name: _order_excess(signal, name) for name in names}
            shafts = _shaft_signals(recording, rig, angle, signal, settings)
        except RefusalError:  # too few samples per revolution or too short: the detectors say that nothing is known
            excess, shafts = {}, ()
    result = Signals(recording, rig, angle, settings, spectra, excess, shafts, maps)
    if excess and result.speed_varies:
        from gearsig.orders.map import order_map

        maps.update({name: order_map(signal, name) for name in names})
    return result


def floor_of(spectrum: Spectrum) -> LineExcess:
    """Return an amplitude spectrum's lines against its local noise floor."""
    from gearsig.spectra.floor import noise_floor

    return line_excess(spectrum, noise_floor(spectrum).values)


def _order_excess(signal: AngleSignal, name: str) -> LineExcess:
    from gearsig.orders.spectrum import order_spectrum

    return floor_of(order_spectrum(signal, name))


def _resampled(recording: Recording, angle: ShaftAngle) -> AngleSignal:
    from gearsig.angle.resample import resample_to_angle

    return resample_to_angle(recording, angle)


def _shaft_signals(
    recording: Recording, rig: Rig, angle: ShaftAngle, signal: AngleSignal, settings: AnalysisSettings
) -> tuple[ShaftSignals, ...]:
    """Average each shaft's revolutions, wherever its order is known and it turns often enough."""
    found = []
    for shaft in rig.shaft_names or (angle.shaft,):
        ratio = rig.ratio(shaft) if rig.shaft_names else 1.0
        if ratio is None or angle.n_revolutions * ratio < settings.minimum_revolutions:
            continue
        own = angle if ratio == 1.0 else angle.of_shaft(shaft, ratio)
        found.append(_one_shaft(shaft, rig, own, signal if ratio == 1.0 else _resampled(recording, own)))
    return tuple(found)


def _one_shaft(shaft: str, rig: Rig, angle: ShaftAngle, signal: AngleSignal) -> ShaftSignals:
    from gearsig.orders.average import synchronous_average

    averages = {name: synchronous_average(signal, name) for name in signal.channel_names}
    gears = [pair.teeth(shaft) for pair in rig.pairs if shaft in (pair.driver, pair.driven)]
    teeth = tuple(z for z in gears if z is not None)
    separated, halves = {}, {}
    for name, average in averages.items():
        visible = tuple(z for z in teeth if z <= highest_line(average))
        if visible and np.any(average.values):
            try:
                separated[name] = separate(average, visible)
            except (RefusalError, InputError):
                continue  # nothing is left beside the mesh lines: there is no residual to look at
            halves[name] = np.stack([separate(h, visible).difference.values for h in _halves(signal, average)])
    return ShaftSignals(shaft, teeth, angle, averages, separated, halves, signal)


def _halves(signal: AngleSignal, average: SynchronousAverage) -> tuple[SynchronousAverage, SynchronousAverage]:
    """Average the odd and the even revolutions by themselves: what the machine does is in both."""
    revolutions = whole_revolutions(signal, average.channel)
    odd, even = (
        replace(average, values=revolutions[start::2].mean(axis=0), n_revolutions=len(revolutions[start::2]))
        for start in (0, 1)
    )
    return odd, even
