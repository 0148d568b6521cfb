"""Local events on a shaft: where, how large, how many per revolution, and in which revolutions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis.localisation import Localisation, localise
from gearsig.diagnosis.signals import ShaftSignals, Signals
from gearsig.orders.revolutions import whole_revolutions

ABOVE_MESH = 3.5
"""Multiple of the highest mesh order above which knocks ring and teeth that merely differ do not show."""

PEAK_SHARE = 0.25
"""Energy, against the largest window's, from which another place of the revolution counts as an event of its own."""

LARGEST_PERIOD = 12
"""Revolutions over which shafts come back to the same position, up to which events are sorted by revolution."""


@dataclass(frozen=True)
class LocalEvent:
    """The largest local event in the difference signals of a shaft.

    Parameters
    ----------
    place : Localisation
    channel : str
        Where it stands out most.
    rms, median_rms, average_rms, error_rms : float
        In that channel's unit: of the event's window, of the median window, of the whole average, and of the standard
        error of the average within the window.
    peaks_rev : tuple of float
        Starts of all windows that hold a similar energy, 0 to 1.
    share_of_revolutions : float
        Part of the revolutions that carry it: 1 where it is in all, 1/2 where in every second one.
    single_revolution : int or None
        Number of the revolution that holds most of the energy by itself, None if there is no such one.
    """

    place: Localisation
    channel: str
    rms: float
    median_rms: float
    average_rms: float
    error_rms: float
    peaks_rev: tuple[float, ...]
    share_of_revolutions: float
    single_revolution: int | None

    @property
    def is_equally_spaced(self) -> bool:
        """Whether there are two or more events at equal distances: no tooth does that."""
        n = len(self.peaks_rev)
        if n < 2:
            return False
        offsets = (np.array(self.peaks_rev) - self.peaks_rev[0]) * n % 1.0
        return bool(np.all(np.minimum(offsets, 1 - offsets) < n * self.place.width_rev))


def largest_event(shaft: ShaftSignals, signals: Signals) -> LocalEvent:
    """Return the largest local event of a shaft that has separated averages.

    Two tests are made and paid for: on the difference signals in full, and above the mesh harmonics, where knocks ring.
    The window is one pitch of the coarsest gear: events last about as long as the tooth is in mesh.
    """
    names = list(shaft.separated)
    full = np.stack([shaft.separated[name].difference.values for name in names])
    halves = np.stack([shaft.halves[name] for name in names])
    width = 1.0 / min(shaft.teeth)
    starts = _lowest_orders(shaft, names)
    results = []
    for start in starts:
        rng = np.random.default_rng(signals.settings.seed)
        n_surrogates = signals.settings.n_surrogates
        results.append(localise(above(full, start), above(halves, start), width, n_surrogates, rng))
    best = int(np.argmin([r.p_value for r in results]))
    place = replace(results[best], p_value=min(1.0, results[best].p_value * len(results)))
    return _described(shaft, signals, place, above(full, starts[best]), starts[best])


def above(values: FloatArray, lowest_order: int) -> FloatArray:
    """Return periodic signals, (…, n_angles), without the orders below `lowest_order`."""
    if lowest_order == 0:
        return values
    lines = np.fft.rfft(values, axis=-1)
    lines[..., :lowest_order] = 0
    return np.asarray(np.fft.irfft(lines, values.shape[-1], axis=-1))


def _lowest_orders(shaft: ShaftSignals, names: Iterable[str]) -> tuple[int, ...]:
    lowest = round(ABOVE_MESH * max(shaft.teeth))
    highest = int(min(shaft.averages[name].highest_order for name in names))
    return (0,) if highest < 1.5 * lowest else (0, lowest)


def _described(
    shaft: ShaftSignals, signals: Signals, place: Localisation, differences: FloatArray, lowest_order: int
) -> LocalEvent:
    names = list(shaft.separated)
    i = int(np.argmax(place.channel_shares))
    average = shaft.averages[names[i]]
    n = differences.shape[1]
    width = round(place.width_rev * n)
    inside = (round(place.start_rev * n) + np.arange(width)) % n
    rms = float(np.sqrt(np.mean(differences[i, inside] ** 2)))
    share = place.channel_shares[i]
    energies = _energy_by_revolution(shaft, names, inside, lowest_order)
    return LocalEvent(
        place=place,
        channel=names[i],
        rms=rms,
        median_rms=rms / float(np.sqrt(share)) if share > 0 else 0.0,
        average_rms=float(np.std(average.values)),
        error_rms=float(np.sqrt(np.mean(average.standard_error[inside] ** 2))),
        peaks_rev=_peaks(differences, width),
        share_of_revolutions=min((_share(energies, p) for p in _periods(signals, shaft)), default=1.0),
        single_revolution=_single(energies),
    )


def _peaks(differences: FloatArray, width: int) -> tuple[float, ...]:
    """Return the starts of the separate windows whose energy is a good part of the largest one's, largest first."""
    n = differences.shape[1]
    scale = np.mean(differences**2, axis=1, keepdims=True)
    square = np.sum(differences**2 / np.where(scale > 0, scale, 1.0), axis=0)
    total = np.concatenate([[0.0], np.cumsum(np.concatenate([square, square[:width]]))])
    energy = total[width : width + n] - total[:n]
    floor = float(np.median(energy))
    limit = floor + PEAK_SHARE * (float(energy.max()) - floor)
    found: list[int] = []
    for start in np.argsort(-energy):
        if energy[start] < limit or len(found) > 24:
            break
        # A knock rings on: what follows within two windows is the same event.
        if all(min((start - f) % n, (f - start) % n) > 2 * width for f in found):
            found.append(int(start))
    return tuple(f / n for f in found)


def _energy_by_revolution(shaft: ShaftSignals, names: list[str], inside: FloatArray, lowest_order: int) -> FloatArray:
    """Return, for each revolution, the projection of its window on the mean window, summed over channels.

    The projection is signed: noise averages out of it, which energy would not.
    """
    total: FloatArray = np.zeros(0)
    for name in names:
        revolutions = whole_revolutions(shaft.signal, name)
        pattern = above(shaft.separated[name].difference.values, lowest_order)[inside]
        size = float(np.sum(pattern**2))
        if size == 0:
            continue
        # The pattern has no mesh lines; what the raw revolution holds besides it is nearly orthogonal to it.
        projection = (revolutions[:, inside] - shaft.averages[name].values[inside]) @ pattern / size + 1.0
        total = projection if len(total) == 0 else total + projection
    return total


def _periods(signals: Signals, shaft: ShaftSignals) -> set[int]:
    """Return after how many revolutions each other shaft stands as before; 2 is always tried.

    Two for a machine that works every second revolution, and for pulses that are counted wrongly.
    """
    own = signals.rig.ratio(shaft.shaft) or 1.0
    periods = {2}
    for order in signals.known_shaft_orders.values():
        fraction = Fraction(own / order).limit_denominator(LARGEST_PERIOD * 4)
        if abs(float(fraction) - own / order) < 1e-9 and fraction.numerator <= LARGEST_PERIOD:
            periods.add(fraction.numerator)
    return periods - {1}


def _share(energies: FloatArray, period: int) -> float:
    """Return the part of the revolutions of a period that carry the event: mean over maximum of the classes' means."""
    if len(energies) < 4 * period:
        return 1.0
    classes = np.array([energies[i::period].mean() for i in range(period)])
    # How far the classes' means scatter by noise alone; what is within it is no difference.
    scatter = max(float(energies[i::period].std(ddof=1)) / np.sqrt(len(energies[i::period])) for i in range(period))
    highest = float(classes.max())
    if highest - float(classes.min()) < 4 * scatter or highest <= 0:
        return 1.0
    return max(float(classes.mean()), 0.0) / highest


def _single(energies: FloatArray) -> int | None:
    """Return the revolution that holds more than half of all the event there is."""
    total = float(np.sum(energies))
    i = int(np.argmax(energies)) if len(energies) else 0
    return i if total > 0 and len(energies) >= 4 and float(energies[i]) > 0.5 * total else None
