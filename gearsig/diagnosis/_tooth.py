"""Damage at one tooth: a local event of the difference signal that repeats every revolution of its shaft."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from math import log10

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis._lines import mesh_is_confirmed, teeth_are_contradicted
from gearsig.diagnosis._signals import AnalysisSignals, ShaftSignals
from gearsig.diagnosis._types import (
    WITH_ASSUMED_DATA,
    Finding,
    Kind,
    Strength,
    Where,
    cannot_tell,
    from_p_value,
    p_text,
)
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import enumerated, percent, unit_text
from gearsig.orders import SynchronousAverage, revolution_of_lines, separate, whole_revolutions
from gearsig.prepared import chance_of_any, sliding_mean, strongest_window
from gearsig.severity import TEETH_COUNT, ShaftLines, difference_lines, reversed_channels


@dataclass(frozen=True)
class Localisation:
    """The window of angle with the most energy.

    Parameters
    ----------
    angle_rev : float
        Onset of the event within the window, 0 to 1 revolution.
    start_rev : float
        Start of the window.
    width_rev : float
    ratio_db : float
        Energy in the window over the median window's, summed over channels, each scaled to unit energy.
    p_value : float
        The larger of two: the fraction of surrogates (same spectra, same relations between channels, random phases)
        with a ratio as high, and its probability among teeth that differ as those of a healthy gear may, or as the
        other teeth of this gear do.
    repeatability : float
        Correlation of odd and even revolutions within the window, -1 to 1; about 0 for noise, for impacts that are not
        locked to this shaft, and for a single event in one revolution.
    channel_shares : tuple of float
        For each channel, energy in the window over the median window's.
    """

    angle_rev: float
    start_rev: float
    width_rev: float
    ratio_db: float
    p_value: float
    repeatability: float
    channel_shares: tuple[float, ...]


def localise(
    signals: FloatArray, halves: FloatArray, width_rev: float, n_surrogates: int, rng: np.random.Generator
) -> Localisation:
    """Test whether the energy of a synchronous average's difference signal is concentrated at one tooth.

    Phase-randomised surrogates keep the spectrum: a residual of few lines, tooth-to-tooth scatter or coloured noise
    also gives windows of unequal energy, and only what exceeds these counts. All channels get the same random phases,
    which keeps their relations.

    Surrogates know nothing of teeth. On a healthy gear each tooth is a little stronger or weaker than its neighbours,
    over its whole engagement and in all harmonics at once. Energies per tooth then scatter like the square of one
    normal variate (chi-square with one degree of freedom), which is more than surrogates do: this is the second test.
    Where many harmonics and channels contribute to a tooth's energy, teeth scatter far less, and a tooth that passes
    the second test may still stand out from its actual neighbours: this is the third. The smaller p-value of the last
    two counts, doubled.

    Parameters
    ----------
    signals : array, (n_channels, n_angles)
        Over one revolution.
    halves : array, (n_channels, 2, n_angles)
        The same for odd and even revolutions separately.
    width_rev : float
        Width of the window in revolutions, e.g. one tooth pitch.
    n_surrogates : int
        Maximum number; drawing stops early once it is clear that nothing is there.
    rng : Generator

    Returns
    -------
    Localisation

    References
    ----------
    J. Theiler, S. Eubank, A. Longtin, B. Galdrikian, J. D. Farmer, "Testing for nonlinearity in time series: the
    method of surrogate data", 1992. J. Besag, P. Clifford, "Sequential Monte Carlo p-values", 1991. F. E. Grubbs,
    "Sample criteria for testing outlying observations", 1950.
    """
    from scipy.fft import irfft

    n = signals.shape[1]
    width = max(2, round(width_rev * n))
    scale = np.sqrt(np.mean(signals**2, axis=1, keepdims=True))
    used = scale[:, 0] > 0
    x = signals[used] / scale[used]
    energies = sliding_mean(x**2, width)
    together = energies.sum(axis=0)
    start, ratio = strongest_window(together)
    lines, drawn = np.fft.rfft(x, axis=1).astype(np.complex64), np.empty(0)
    # In portions that bound the memory: 256 × 4 channels × 4096 angles in single precision are 17 MB. With 30
    # surrogates as high the p-value is known to a fifth of itself, and is no small one. Six digits are enough for what
    # is drawn at random, and take half the time.
    while len(drawn) < n_surrogates and np.sum(drawn >= ratio) < 30:
        phases = rng.uniform(0, 2 * np.pi, (min(256, n_surrogates - len(drawn)), 1, lines.shape[1]))
        phases[..., 0] = 0.0
        turned, phases = np.empty(phases.shape, dtype=np.complex64), phases.astype(np.float32)
        turned.real, turned.imag = np.cos(phases), np.sin(phases)
        surrogates = irfft(lines * turned, n, axis=-1)
        joint = sliding_mean(np.sum(surrogates**2, axis=1, dtype=np.float64), width)
        drawn = np.append(drawn, joint.max(axis=1) / np.median(joint, axis=1))
    inside = (start + np.arange(width)) % n
    shares = np.zeros(len(signals))
    shares[used] = energies[:, start] / np.median(energies, axis=1)
    odd, even = np.moveaxis(halves[used][:, :, inside] / scale[used][:, None], 1, 0)
    size = float(np.sqrt(np.sum(odd**2) * np.sum(even**2)))
    return Localisation(
        angle_rev=_onset(x, start, width),
        start_rev=start / n,
        width_rev=width / n,
        ratio_db=10 * float(np.log10(ratio)),
        p_value=max(
            _p_among_surrogates(ratio, drawn),
            min(1.0, 2.0 * min(_p_among_teeth(ratio, n / width), _p_among_these(together, start, width))),
        ),
        repeatability=float(np.sum(odd * even)) / size if size > 0 else 0.0,
        channel_shares=tuple(shares.tolist()),
    )


def _p_among_surrogates(ratio: float, drawn: FloatArray) -> float:
    """Return the fraction of surrogates with as high a ratio; beyond the highest, the tail of a Gumbel distribution.

    Window energies of Gaussian signals have exponential tails, and the largest of many such is Gumbel distributed; the
    mean and standard deviation of the drawn ratios give its parameters (E. J. Gumbel, *Statistics of Extremes*, 1958).
    """
    share = (float(np.sum(drawn >= ratio)) + 1) / (len(drawn) + 1)
    scale = float(drawn.std()) * np.sqrt(6) / np.pi
    if ratio <= drawn.max() or scale == 0:
        return share
    location = float(drawn.mean()) - np.euler_gamma * scale
    return min(share, float(-np.expm1(-np.exp(-(ratio - location) / scale))))


def _p_among_teeth(ratio: float, n_teeth: float) -> float:
    """Return P(largest of n chi-square(1) numbers >= ratio · their median)."""
    from scipy.special import erfc

    median = 0.4549364  # of the chi-square distribution with one degree of freedom
    single = float(erfc(np.sqrt(ratio * median / 2)))
    return chance_of_any(single, n_teeth)


def _p_among_these(energies: FloatArray, start: int, width: int) -> float:
    """Return P(largest of the teeth's energies stands this far above the others), given the scatter of the others.

    Upwards, logarithms of energies scatter no more than normally; those of chi-square variates of any degree scatter
    less. With mean and deviation of the other teeth, except the two neighbours into which an impact rings, the largest
    follows Student's t.
    """
    from scipy.stats import t as student

    n_teeth = max(round(len(energies) / width), 1)
    starts = start + np.rint(np.arange(n_teeth) * len(energies) / n_teeth).astype(np.int64)
    teeth = np.log(np.maximum(energies[starts % len(energies)], 1e-12 * energies[start]))
    others = teeth[2:-1]
    scatter = float(others.std(ddof=1)) if len(others) > 2 else 0.0
    if scatter == 0.0:
        return 1.0
    distance = (teeth[0] - others.mean()) / (scatter * np.sqrt(1 + 1 / len(others)))
    single = float(student.sf(distance, len(others) - 1))
    return chance_of_any(single, n_teeth)


def _onset(x: FloatArray, start: int, width: int) -> float:
    """Return the angle within the window at which the energy has risen to half of its maximum.

    An impact rises at once and rings on, so its maximum energy comes a little later. Energy is averaged over an eighth
    of the window, and a short interval before the window is included.
    """
    n, short = x.shape[1], max(1, width // 8)
    inside = (start - short + np.arange(width + short)) % n
    energy = np.convolve((x[:, inside] ** 2).sum(axis=0), np.ones(short), "valid")
    rise = int(np.argmax(energy >= 0.5 * energy.max()))
    return float(((start - short + rise + short / 2) / n) % 1.0)


@dataclass(frozen=True)
class LocalEvent:
    """The largest local event in the difference signals of a shaft.

    Parameters
    ----------
    place : Localisation
    channel : str
        Where the event stands out most.
    rms, median_rms, average_rms, error_rms : float
        In that channel's unit: of the event's window, of the median window, of the whole average, and of the standard
        error of the average within the window.
    peaks_rev : tuple of float
        Starts of all windows that hold a similar energy, 0 to 1.
    share_of_revolutions : float
        Fraction of the revolutions that contain the event: 1 for all, 1/2 for every second one.
    single_revolution : int or None
        Number of the revolution that alone holds most of the energy, None if there is none.
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
        """Whether there are two or more events at equal spacing, which no tooth causes."""
        n = len(self.peaks_rev)
        if n < 2:
            return False
        offsets = (np.array(self.peaks_rev) - self.peaks_rev[0]) * n % 1.0
        return bool(np.all(np.minimum(offsets, 1 - offsets) < n * self.place.width_rev))


def largest_event(shaft: ShaftSignals, signals: AnalysisSignals) -> LocalEvent:
    """Return the largest local event of a shaft that has separated averages.

    Two tests are made and corrected for: on the full difference signals, and above 3.5 times the highest mesh order,
    where impacts ring and teeth that merely differ do not show. The window is one pitch of the coarsest gear, as events
    last about as long as the tooth is in mesh.
    """
    names = list(shaft.separated)
    full = np.stack([shaft.separated[name].difference.values for name in names])
    halves = np.stack([shaft.halves[name] for name in names])
    n = full.shape[1]
    lowest = round(3.5 * max(shaft.teeth))
    highest = int(min(shaft.averages[name].highest_order for name in names))
    tests = []
    for start in (0,) if highest < 1.5 * lowest else (0, lowest):
        rng, n_surrogates = np.random.default_rng(signals.settings.seed), signals.settings.n_surrogates
        place = localise(_above(full, start), _above(halves, start), 1.0 / min(shaft.teeth), n_surrogates, rng)
        tests.append((place, start))
    place, start = min(tests, key=lambda test: test[0].p_value)
    place = replace(place, p_value=min(1.0, place.p_value * len(tests)))

    differences = _above(full, start)
    width = round(place.width_rev * n)
    inside = (round(place.start_rev * n) + np.arange(width)) % n
    i = int(np.argmax(place.channel_shares))
    share, average = place.channel_shares[i], shaft.averages[names[i]]
    rms = float(np.sqrt(np.mean(differences[i, inside] ** 2)))
    energies = _energy_by_revolution(shaft, dict(zip(names, differences[:, inside], strict=True)), inside)
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


def _above(values: FloatArray, lowest_order: int) -> FloatArray:
    """Return periodic signals, (…, n_angles), without the orders below `lowest_order`."""
    return values if lowest_order == 0 else _within(values, lowest_order, values.shape[-1])


def _within(values: FloatArray, lowest_order: int, highest_order: int) -> FloatArray:
    """Return periodic signals, (…, n_angles), with only the orders from the lowest to the highest."""
    lines = np.fft.rfft(values, axis=-1)
    lines[..., :lowest_order] = 0
    lines[..., highest_order + 1 :] = 0
    return np.asarray(np.fft.irfft(lines, values.shape[-1], axis=-1))


def _peaks(differences: FloatArray, width: int) -> tuple[float, ...]:
    """Return the starts of the separate windows with at least a quarter of the largest one's energy, largest first."""
    n = differences.shape[1]
    scale = np.mean(differences**2, axis=1, keepdims=True)
    square = np.sum(differences**2 / np.where(scale > 0, scale, 1.0), axis=0)
    energy = sliding_mean(square, width)
    floor = float(np.median(energy))
    limit = floor + 0.25 * (float(energy.max()) - floor)
    starts: list[int] = []
    for start in np.argsort(-energy):
        if energy[start] < limit or len(starts) > 24:
            break
        # An impact rings on: what follows within two windows is the same event.
        if all(min((start - other_start) % n, (other_start - start) % n) > 2 * width for other_start in starts):
            starts.append(int(start))
    return tuple(other_start / n for other_start in starts)


def _energy_by_revolution(shaft: ShaftSignals, patterns: Mapping[str, FloatArray], inside: FloatArray) -> FloatArray:
    """Return, for each revolution, the projection of its window on the mean window, summed over channels.

    The projection is signed, so noise averages out, which it would not do in the energy.
    """
    total: FloatArray = np.zeros(0)
    for name, pattern in patterns.items():
        size = float(np.sum(pattern**2))
        if size == 0:
            continue
        # The pattern has no mesh lines; the rest of the raw revolution is nearly orthogonal to it.
        revolutions, mean = whole_revolutions(shaft.signal, name)[:, inside], shaft.averages[name].values[inside]
        projection = (revolutions - mean) @ pattern / size + 1.0
        total = projection if len(total) == 0 else total + projection
    return total


def _periods(signals: AnalysisSignals, shaft: ShaftSignals) -> set[int]:
    """Return after how many revolutions, up to 12, each other shaft is in the same position again; 2 is always tried.

    Two is for machines that work every second revolution, and for miscounted pulses.
    """
    ratio = signals.rig.ratio(shaft.shaft) or 1.0
    periods = {2}
    for order in signals.known_shaft_orders.values():
        fraction = Fraction(ratio / order).limit_denominator(48)
        if abs(float(fraction) - ratio / order) < 1e-9 and fraction.numerator <= 12:
            periods.add(fraction.numerator)
    return periods - {1}


CARRIES = 0.25
"""A class carries the event from this fraction of the strongest class's: the next tooth's mates respond unequally."""


def _share(energies: FloatArray, period: int) -> float:
    """Return the fraction of the revolutions of a period that carry the event, judging each class by its mean."""
    if len(energies) < 4 * period:
        return 1.0
    classes = np.array([energies[i::period].mean() for i in range(period)])
    # How far the means of classes scatter by noise alone; smaller differences do not count.
    scatter = max(float(energies[i::period].std(ddof=1)) / np.sqrt(len(energies[i::period])) for i in range(period))
    highest = float(classes.max())
    if highest - float(classes.min()) < 4 * scatter or highest <= 0:
        return 1.0
    return float(np.mean(classes >= CARRIES * highest))


def _single(energies: FloatArray) -> int | None:
    """Return the revolution that holds more than half of the event's total energy."""
    total = float(np.sum(energies))
    i = int(np.argmax(energies)) if len(energies) else 0
    return i if total > 0 and len(energies) >= 4 and float(energies[i]) > 0.5 * total else None


UNEQUAL_DB = 14.7
"""Of some forty teeth the largest exceeds the median by this much on one gear in a hundred, where they scatter as much
as teeth can: chi-square, one degree of freedom."""

ONE_ODD_TOOTH = 0.5
"""Factor on the confidence below that: a gear made with one odd tooth among equal ones shows as much."""

WORTH_SAYING, CLEAR = (0.01, 8.0), (0.001, UNEQUAL_DB)
"""Maximum p-value, and minimum level of the window over the median window in dB."""

DOUBTFUL = (0.05, 8.0)
"""The same for an event that rules out saying that no damage shows: the customary significance level."""

SMALLEST_SHARE, SMALLEST_SIGNIFICANCE = 0.05, 3.0
"""Rms in the window relative to the whole average's, and to the average's standard error there: below either, an event
is too small to matter, or is caused by the ends of the record."""

REPEATS = 0.7
"""Minimum correlation of odd and even revolutions for an event to count as the same in both."""

AGREES, RULES = 0.5, 1.5
"""Agreement of an average's tooth pattern with the healthy one's that makes a difference a change; otherwise, rms of
the event over what the healthy average has there that rules out a misplaced tooth of the healthy pattern."""

ODD_DB, SAME_SHAPE, PART = 6.0, 0.8, 0.5
"""A tooth that stood out at least as far on the healthy gear, in dB over the median, and has changed by at most this
fraction, in the same shape, was changed by another load, not by damage."""


@dataclass(frozen=True)
class _Examined:
    """A shaft with its largest local event, and the event's p-value corrected for all shafts that were tried.

    `since_reference` says whether the event is in the difference from the healthy average, not in the average itself.
    """

    signals: AnalysisSignals
    shaft: ShaftSignals
    event: LocalEvent
    p_value: float
    since_reference: bool = False

    @property
    def has_mark(self) -> bool:
        """Whether the angle of this shaft counts from a mark that is there once per revolution."""
        return self.signals.prepared.has_mark(self.shaft.shaft)

    @property
    def is_at_mark(self) -> bool:
        """Whether the event is at the tachometer's pulse, which couples into bad cables."""
        degrees = 360 * self.event.place.angle_rev
        return self.has_mark and min(degrees, 360 - degrees) < 6.0

    @property
    def is_steady(self) -> bool:
        """Whether the event is large enough and alike in odd and even revolutions; chance impacts do not correlate."""
        event = self.event
        # The standard error includes other shafts' lines, which averaging reduces and two averages share.
        error = 0.0 if self.since_reference else SMALLEST_SIGNIFICANCE * event.error_rms
        return event.rms >= max(SMALLEST_SHARE * event.average_rms, error) and event.place.repeatability >= REPEATS

    @property
    def is_withheld(self) -> bool:
        """Whether the event is not due to chance and large enough, yet no tooth's: it varies between revolutions."""
        is_large = self.event.rms >= SMALLEST_SHARE * self.event.average_rms
        return self.reaches((CLEAR[0], WORTH_SAYING[1])) and is_large and not self.is_steady

    @property
    def is_doubtful(self) -> bool:
        """Whether the event may be a tooth's, though chance explains it as well."""
        return self.is_steady and self.reaches(DOUBTFUL)

    @property
    def smallest_visible(self) -> float:
        """Rms in a window above which an event stands out from teeth that merely differ."""
        return self.event.median_rms * float(10 ** (UNEQUAL_DB / 20))

    @property
    def strength(self) -> Strength:
        """The event's rms relative to the median window's."""
        event = self.event
        ratio_db = 20 * log10(event.rms / event.median_rms) if event.rms > 0 and event.median_rms > 0 else None
        of_what = "what differs from the reference" if self.since_reference else "the difference signal"
        floor_is = f"median tooth of {of_what} in {event.channel}"
        return Strength(event.rms, self.shaft.averages[event.channel].unit, event.median_rms, floor_is, ratio_db)

    def reaches(self, level: tuple[float, float]) -> bool:
        """Whether the event is as improbable by chance, and as large, as a level requires."""
        return self.p_value <= level[0] and self.event.place.ratio_db >= level[1]


def detect_tooth_damage(signals: AnalysisSignals) -> list[Finding]:
    """Search each shaft's difference signals for a local event, and report which shafts could not be examined."""
    able = _able(signals)
    events = [(s, largest_event(s, signals)) for s in able]
    examined = [_Examined(signals, s, event, min(1.0, event.place.p_value * len(able))) for s, event in events]
    return _findings(signals, examined) + _not_examined(signals, {s.shaft for s in able})


def with_changed_teeth(
    findings: Sequence[Finding], signals: AnalysisSignals, healthy: AnalysisSignals
) -> tuple[list[Finding], ChangedAverages]:
    r"""Return the findings with the changes at the teeth since the reference, where both averages compare.

    Manufacturing differences cancel in the difference of two averages at one speed, turned so that the same teeth meet:

    .. math:: d[n] = x[n] - g_k r[n] e^{-2 \pi i n s}

    with the shift s and each mesh harmonic's gain g of `gearsig.severity.difference_lines`. A local event in d is
    tested like one in the average itself. It replaces what the recording alone says of teeth. If there is none, "no
    damage shows" replaces it on shafts where a change of a relevant size would have shown. The differences of all
    shafts that compare are returned by shaft and channel.
    """
    able = _able(signals)
    pairs = [(c, largest_event(c.since, signals)) for c in (_compared(signals, s, healthy) for s in able) if c]
    changes = {
        (c.since.shaft, name): replace(parts.difference, kind="change")
        for c, _ in pairs
        for name, parts in c.since.separated.items()
    }
    # The recording alone was tested before: two tests for each shaft.
    compared = [
        _Examined(signals, c.since, event, min(1.0, 2 * len(able) * event.place.p_value), since_reference=True)
        for c, event in pairs
        if not c.is_healthys(event)
    ]
    new = _findings(signals, compared)
    if any(f.is_claim for f in new):
        return [*(f for f in findings if f.code not in _OF_TEETH), *new], changes
    if len(compared) < len(able) or any(f.is_claim and f.code in _OF_TEETH for f in findings):
        return list(findings), changes
    new = [f for f in new if f.code in _STATEMENTS]
    return [*(f for f in findings if f.code not in _STATEMENTS), *new] if new else list(findings), changes


ChangedAverages = Mapping[tuple[str, str], SynchronousAverage]
"""Shaft and channel → difference of its average from the reference's."""

_STATEMENTS = ("no-tooth-local-damage", "tooth-damage-undecided")
_OF_TEETH = (*_STATEMENTS, "tooth-local-damage")


@dataclass(frozen=True)
class _Compared:
    """Difference of a shaft's signals from the healthy machine's, and how well the two tooth patterns agree."""

    since: ShaftSignals
    healthy: Mapping[str, FloatArray]
    """Channel → the healthy average's difference signal, turned to the same teeth."""
    agreement: float

    def is_healthys(self, event: LocalEvent) -> bool:
        """Whether a tooth of the healthy gear explains the difference: misplaced, or odd from the start."""
        n = len(self.healthy[event.channel])
        width = round(event.place.width_rev * n)
        inside = (round(event.place.start_rev * n) + np.arange(width)) % n
        if self.agreement < AGREES:
            was = float(np.sqrt(np.mean(self.healthy[event.channel][inside] ** 2)))
            return event.rms < RULES * was
        # Channels differ in unit: each is taken relative to the healthy average's energy.
        healthy = np.stack(list(self.healthy.values()))
        scale = np.sqrt(np.mean(healthy**2, axis=1, keepdims=True))
        before = np.divide(healthy, scale, out=np.zeros_like(healthy), where=scale > 0)
        now = np.stack([self.since.separated[name].difference.values for name in self.healthy])
        change = np.divide(now, scale, out=np.zeros_like(now), where=scale > 0)[:, inside].ravel()
        energy = sliding_mean(np.sum(before**2, axis=0), width)
        tooth = before[:, inside].ravel()
        sizes = float(np.linalg.norm(change)), float(np.linalg.norm(tooth))
        if min(sizes) == 0 or np.mean(tooth**2) * len(healthy) < 10 ** (ODD_DB / 10) * np.median(energy):
            return False
        shape = abs(float(change @ tooth)) / (sizes[0] * sizes[1])
        return shape >= SAME_SHAPE and sizes[0] <= PART * sizes[1]


def _compared(signals: AnalysisSignals, shaft: ShaftSignals, healthy: AnalysisSignals) -> _Compared | None:
    """Compare a shaft with the healthy machine's; None where the two do not compare."""
    before = next((s for s in healthy.shafts if s.shaft == shaft.shaft), None)
    if before is None:
        return None
    both = [n for n in shaft.separated if n in before.separated]
    names = [n for n in both if shaft.averages[n].unit == before.averages[n].unit]
    highest = min((s.averages[n].highest_line for s in (shaft, before) for n in names), default=0)
    visible = tuple(z for z in shaft.teeth if z <= highest)
    if not visible:
        return None
    now, then = (_lines_of(g, s, names, highest, visible[0]) for g, s in ((signals, shaft), (healthy, before)))
    on_either = {s for pair in signals.rig.pairs_on(shaft.shaft) for s in (pair.driver, pair.driven)}
    is_marked = any(signals.prepared.has_mark(s) and healthy.prepared.has_mark(s) for s in on_either)
    then = then.turned_about(reversed_channels(now, then, whole_teeth=is_marked))
    separated, halves, born = {}, {}, {}
    try:
        changed, agreement = difference_lines(now, then, whole_teeth=is_marked)
        for name, row, was in zip(names, changed.lines, now.lines - changed.lines, strict=True):
            average = shaft.averages[name]
            n = len(average.values)
            separated[name], healthy_parts = (
                separate(replace(average, values=revolution_of_lines(lines, n, "amplitude peak")), visible)
                for lines in (row, was)
            )
            born[name] = healthy_parts.difference.values
            # The same is subtracted from both halves: the whole healthy average.
            halves[name] = _within(shaft.halves[name], 0, highest) - born[name]
    except (RefusalError, InputError):  # different speeds, or no difference
        return None
    if not any(np.any(parts.difference.values) for parts in separated.values()):
        return None
    return _Compared(replace(shaft, separated=separated, halves=halves), born, agreement)


def _lines_of(
    signals: AnalysisSignals, shaft: ShaftSignals, names: Sequence[str], highest: int, teeth: int
) -> ShaftLines:
    """Return a shaft's averages in the form that the alignment needs, by the teeth of one of its gears."""
    averages = [shaft.averages[name] for name in names]
    lines = np.stack([average.lines()[: highest + 1].astype(np.complex128) for average in averages])
    order_hz, is_marked = shaft.angle.mean_speed_rpm / 60.0, signals.prepared.has_mark(shaft.shaft)
    return ShaftLines(
        shaft.shaft, teeth, teeth, lines, averages[0].n_revolutions, highest, order_hz, tuple(names), is_marked
    )


def _able(signals: AnalysisSignals) -> list[ShaftSignals]:
    return [s for s in signals.shafts if s.separated and _why_blind(signals, s) == ""]


def _findings(signals: AnalysisSignals, examined: list[_Examined]) -> list[Finding]:
    """Return what the shafts' largest events are, or that nothing shows at their teeth."""
    judged = [(e, _finding(e)) for e in _one_per_speed(examined)]
    findings = [f for _, f in judged if f is not None]
    codes = {f.code for f in findings}
    shocks = [f for f in findings if f.code == "single-shock"]
    findings = [f for f in findings if f not in shocks[1:]]  # every shaft's average shows the same shock
    if "tooth-local-damage" in codes:  # events of other shafts are its images
        findings = [f for f in findings if f.code in ("tooth-local-damage", "single-shock")]
    elif "event-in-some-revolutions" not in codes:  # then even the speed is uncertain
        findings += _nothing_shows(signals, [e for e, f in judged if f is None])
        findings += _undecided([e for e, f in judged if f is not None], "other local events would cover damage")
    return findings


def _one_per_speed(examined: list[_Examined]) -> list[_Examined]:
    """Keep one of two shafts of equal speed, as their averages hold the same events."""
    kept = list(examined)
    for one, other in combinations(examined, 2):
        ratio = one.signals.rig.ratio
        equal = abs((ratio(one.shaft.shaft) or 1) / (ratio(other.shaft.shaft) or 1) - 1) < 1e-9
        if equal and one in kept and other in kept:
            kept.remove(other)
    return kept


def _finding(examined: _Examined) -> Finding | None:
    """Return what an event is: damage, several events, one that is not in every revolution; None if it is nothing."""
    signals, shaft, event = examined.signals, examined.shaft, examined.event
    name, degrees = shaft.shaft, 360 * event.place.angle_rev
    if event.is_equally_spaced and examined.is_steady and event.place.ratio_db >= WORTH_SAYING[1]:
        return Finding(  # their energy raises the median, so the test does not apply
            "several-events-per-revolution",
            Kind.NOTICE,
            f"{len(event.peaks_rev)} equally spaced local events per revolution of shaft {name}: not a single tooth.",
            Where((event.channel,), shaft=name, angle_deg=degrees),
            examined.strength,
            confidence=0.9,
            confidence_basis="equal distances and similar energy",
            evidence=("Couplings, pumps, presses, pistons and faster shafts with a whole-number ratio do this.",),
            surer="A recording at another load, or one with a sensor nearer to the suspected cause.",
        )
    if not examined.reaches(WORTH_SAYING) or event.rms < SMALLEST_SHARE * event.average_rms:
        return None
    if event.single_revolution is not None:
        revolution = np.ceil(shaft.signal.start_revolution - 1e-9) + event.single_revolution + event.place.angle_rev
        time = float(np.interp(revolution, shaft.angle.revolutions, shaft.angle.time_s))
        return Finding(
            "single-shock",
            Kind.NOTICE,
            f"A single shock near {time:.3g} s, in one of {shaft.averages[event.channel].n_revolutions} revolutions.",
            Where((event.channel,), shaft=name, time_s=(time, time)),
            examined.strength,
            confidence=0.95,
            confidence_basis="more than half of what the average shows comes from that revolution",
            surer="Another recording: what the machine does recurs.",
        )
    if event.share_of_revolutions < 0.75:  # then it belongs to a slower shaft
        ratio = signals.rig.ratio(name) or 1.0
        slower = [n for n, order in signals.known_shaft_orders.items() if order < ratio * (1 - 1e-9)]
        share, low = percent(event.share_of_revolutions), "are stated too low"
        return Finding(
            "event-in-some-revolutions",
            Kind.CANNOT_TELL,
            f"A local event on shaft {name}, but only in {share} of its revolutions.",
            Where((event.channel,), shaft=name),
            examined.strength,
            confidence=0.95,
            confidence_basis="revolutions sorted by their number",
            evidence=(
                "A machine that works every second revolution does this.",
                f"So does a tachometer whose pulses per revolution {low}: then speed and teeth are wrong too.",
                *([f"It may belong to a slower shaft ({', '.join(slower)})."] if slower else []),
            ),
            surer="Check pulses_per_revolution and the teeth.",
        )
    return _damage(examined) if examined.is_steady else None


def _damage(examined: _Examined) -> Finding:
    signals, shaft, place = examined.signals, examined.shaft, examined.event.place
    assumed = ", ".join(signals.rig.assumed)
    # One in ten once-per-revolution events on a shaft with gears comes from a key, a coupling or a rub, not a tooth.
    confidence = from_p_value(examined.p_value) * 0.9
    confidence *= WITH_ASSUMED_DATA if assumed or examined.is_at_mark else 1.0
    is_odd = place.ratio_db < UNEQUAL_DB and not examined.since_reference  # both have manufacturing differences
    confidence *= ONE_ODD_TOOTH if is_odd else 1.0
    level = (CLEAR[0], WORTH_SAYING[1]) if examined.since_reference else CLEAR
    clear = examined.reaches(level) and not assumed and not examined.is_at_mark
    tooth = int(place.angle_rev * shaft.teeth[0]) + 1 if len(shaft.teeth) == 1 and examined.has_mark else None
    at = f"at {360 * place.angle_rev:.0f}°, tooth {tooth} of {shaft.teeth[0]}," if tooth else "at one place"
    ratio = signals.rig.ratio(shaft.shaft) or 1.0
    equal = [n for n, order in signals.known_shaft_orders.items() if abs(order / ratio - 1) < 1e-9 and n != shaft.shaft]
    what = "Local tooth damage" if clear else "A local event, perhaps tooth damage,"
    shares = zip(shaft.separated, place.channel_shares, strict=True)
    pairs = [pair.name for pair in signals.rig.pairs_on(shaft.shaft)]
    return Finding(
        "tooth-local-damage",
        Kind.FAULT if clear else Kind.SUSPICION,
        f"{what} {at} of shaft {' or '.join([shaft.shaft, *equal])}.",
        Where(
            tuple(name for name, share in shares if share >= 4.0) or (examined.event.channel,),
            shaft=shaft.shaft,
            gear=f"{pairs[0]}/{shaft.shaft}" if len(pairs) == 1 else "",
            angle_deg=360 * place.angle_rev,
            tooth=tooth,
        ),
        examined.strength,
        confidence,
        f"chance of it on a gear whose teeth merely differ: {p_text(examined.p_value)}; one in ten such events has "
        "another cause on the shaft (key, coupling, rub)"
        + (f"; halved because of assumed data ({assumed})" if assumed else ""),
        tuple(_evidence(examined)),
        _surer(signals),
    )


def _evidence(examined: _Examined) -> Iterator[str]:
    shaft, event = examined.shaft, examined.event
    of_what = " of what differs from the reference" if examined.since_reference else ""
    yield (
        f"Energy{of_what} in one tooth pitch is {event.place.ratio_db:.1f} dB over the median pitch, all channels "
        "together."
    )
    yield f"{shaft.averages[event.channel].n_revolutions} revolutions were averaged."
    yield f"It repeats: odd and even revolutions correlate there by {event.place.repeatability:.2f}."
    yield f"Its rms is {percent(event.rms / event.average_rms)} of the whole average's."
    if len(event.peaks_rev) > 1:
        yield f"It is the largest of {len(event.peaks_rev)} local events: several teeth, or another cause."
    if examined.since_reference:
        yield "The averages were turned so that the same teeth coincide: manufacturing differences cancel."
    elif event.place.ratio_db < UNEQUAL_DB:
        yield "It stands out from teeth that are alike: a gear made with one odd tooth shows as much."
    if examined.is_at_mark:
        yield "It is at the tachometer's mark: cross-talk from its cable would look the same."
    if not examined.has_mark:
        yield "No once-per-revolution mark is on this shaft: the angle holds for this record's average only."
    elif len(shaft.teeth) == 1:
        yield TEETH_COUNT
    if len(shaft.teeth) > 1:
        teeth = ", ".join(map(str, shaft.teeth))
        yield f"The shaft carries {len(shaft.teeth)} gears ({teeth} teeth); it may be on either."


def _surer(signals: AnalysisSignals) -> str:
    if signals.rig.assumed:
        return "Confirm what is assumed of the rig: " + ", ".join(signals.rig.assumed) + "."
    good = "" if signals.has_reference else ", or of the same gearbox when it was healthy"
    if signals.angle is not None and signals.angle.method in ("tachless", "constant", "speed channel"):
        return f"A recording with a tachometer, or at another load{good}."
    return f"A recording at another load or speed (damage stays at its tooth){good}."


def _nothing_shows(signals: AnalysisSignals, examined: list[_Examined]) -> list[Finding]:
    """Report that nothing shows, for the shafts where damage of a relevant size would have shown.

    Where an event as large as half of the average's rms would not have shown, nothing is said about the teeth.
    """
    if signals.rig.assumed:
        return _undecided(examined, f"on assumed data ({', '.join(signals.rig.assumed)}): damage may not show")
    withheld = [e for e in examined if e.is_withheld]
    doubtful = [e for e in examined if e.is_doubtful]
    examined = [e for e in examined if not (e.is_withheld or e.is_doubtful)]
    sharp = [e for e in examined if e.smallest_visible <= 0.5 * e.event.average_rms]
    # On the others, the median tooth's share of the difference signal may be mostly noise left in the average.
    noisy = [e for e in examined if e not in sharp and e.event.median_rms <= SMALLEST_SIGNIFICANCE * e.event.error_rms]
    uneven = [e for e in examined if e not in sharp and e not in noisy]
    findings = []
    if sharp:
        first = sharp[0].shaft
        findings.append(
            Finding(
                "no-tooth-local-damage",
                Kind.INFORMATION,
                f"No local tooth damage shows on {_shafts_text(_names(sharp))}.",
                Where(tuple(first.separated), shaft=first.shaft if len(sharp) == 1 else ""),
                confidence=0.8,
                confidence_basis="small damage may be hidden below the mesh's own variation",
                evidence=tuple(_visible_text(e) for e in sharp),
                surer=_surer(signals),
            )
        )
    findings += [_withheld(tooth) for tooth in withheld]
    findings += [_doubtful(tooth) for tooth in doubtful]
    findings += _undecided(noisy, "noise would hide an event of half the average's size")
    return findings + _undecided(uneven, "they differ so much from each other that damage may hide among them")


def _doubtful(examined: _Examined) -> Finding:
    by_chance = f"as one does by chance on {percent(examined.p_value)} of healthy gears"
    return _left_open(examined, by_chance, tuple(_evidence(examined)), _surer(examined.signals))


def _withheld(examined: _Examined) -> Finding:
    event, place = examined.event, examined.event.place
    significance = event.rms / max(event.error_rms, 1e-300)
    scatter = (
        f"correlate there by {place.repeatability:.2f}; its rms is {significance:.1f} standard errors of the average"
    )
    evidence = (f"Odd and even revolutions {scatter}.", _visible_text(examined))
    surer = "A longer recording, and a tachometer whose pulses the shaft's own torsion does not shift."
    how = "not alike" if place.repeatability < REPEATS else "too uneven"
    why = f"but {how} from turn to turn"
    return _left_open(examined, why, evidence, surer)


def _left_open(examined: _Examined, why: str, evidence: tuple[str, ...], surer: str) -> Finding:
    event, shaft = examined.event, examined.shaft.shaft
    stands_out = f"one stands out by {event.place.ratio_db:.1f} dB, {why}"
    title = f"Whether a tooth of shaft {shaft} is damaged cannot be told: {stands_out}."
    where = Where((event.channel,), shaft=shaft, angle_deg=360 * event.place.angle_rev)
    return cannot_tell("tooth-damage-undecided", title, where, evidence=evidence, surer=surer)


def _undecided(examined: list[_Examined], reason: str) -> list[Finding]:
    if not examined:
        return []
    more = "ore revolutions, a sensor nearer to the gears, a higher load"
    more += "; machine data that are not assumed." if examined[0].signals.rig.assumed else "."
    healthy = "A recording of the same gears when they were healthy, given with --reference: manufacturing differences"
    surer = f"M{more}" if examined[0].signals.has_reference else f"{healthy} cancel. Or m{more}"
    title = f"Nothing shows at the teeth of {_shafts_text(_names(examined))}, but {reason}."
    where, evidence = Where(tuple(examined[0].shaft.separated)), tuple(_visible_text(e) for e in examined)
    return [cannot_tell("tooth-damage-undecided", title, where, evidence=evidence, surer=surer)]


def _names(examined: list[_Examined]) -> list[str]:
    return [e.shaft.shaft for e in examined]


def _shafts_text(names: Sequence[str]) -> str:
    return f"shaft{'s' * (len(names) > 1)} {enumerated(names)}"


def _visible_text(examined: _Examined) -> str:
    event, smallest = examined.event, examined.smallest_visible
    share = 100 * smallest / event.average_rms if event.average_rms > 0 else 0.0
    unit = examined.signals.recording.channels[examined.signals.recording.index(event.channel)].unit
    return (
        f"Shaft {examined.shaft.shaft}: the largest {'change of a tooth' if examined.since_reference else 'tooth'} is "
        f"{event.place.ratio_db:.1f} dB over the median (chance if teeth merely differ: "
        f"{p_text(examined.p_value)}). An event of {smallest:.3g}"
        f"{f' {unit_text(unit)}' if unit else ''} rms in {event.channel}, "
        f"{share:.0f} % of the average, would have shown."
    )


def _why_blind(signals: AnalysisSignals, shaft: ShaftSignals) -> str:
    """Return why the teeth of a shaft cannot be examined although there is an average; empty if they can."""
    pairs = signals.rig.pairs_on(shaft.shaft)
    for pair in pairs:
        real = teeth_are_contradicted(signals, pair)
        if real is not None:
            return f"the mesh of {pair.name} is at order {real:.5g}, not where its teeth put it"
    if not any(mesh_is_confirmed(signals, pair) for pair in pairs):
        return "no mesh line stands where speed and teeth put it"
    return ""


def _not_examined(signals: AnalysisSignals, examined: set[str]) -> list[Finding]:
    """Report for each shaft with gears why its teeth were not examined."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for shaft in dict.fromkeys(s for pair in signals.rig.pairs for s in (pair.driver, pair.driven)):
        if shaft not in examined:
            reasons.setdefault(_reason(signals, shaft), []).append(shaft)
    return [
        cannot_tell("tooth-not-examined", f"Teeth on {_shafts_text(shafts)} cannot be examined: {why}.", surer=surer)
        for (why, surer), shafts in reasons.items()
    ]


def _reason(signals: AnalysisSignals, name: str) -> tuple[str, str]:
    """Return why a shaft's teeth are not examined, and what would help."""
    if signals.angle is None:
        return "the speed is not known", "A tachometer, or a stated speed."
    ratio = signals.rig.ratio(name)
    if ratio is None:
        sides = ("driver_teeth", "driven_teeth")
        missing = [f"{side} of {pair.name}" for pair in signals.rig.pairs for side in sides if not getattr(pair, side)]
        return "a tooth count on the way to it is missing", f"What the rig file lacks: {', '.join(missing)}."
    revolutions, needed = signals.angle.n_revolutions * ratio, signals.settings.minimum_revolutions
    if revolutions < needed:
        return f"the record holds {revolutions:.3g} of its revolutions and {needed} are needed", "A longer recording."
    for shaft in signals.shafts:
        if shaft.shaft == name and shaft.separated:
            return _why_blind(signals, shaft), "The correct teeth, speed and sampling rate; a higher load."
    why = "its gear has no known teeth, its mesh is above half the sampling rate, or the record is too short"
    return why, "The teeth of its gear, a higher sampling rate, or a longer recording."
