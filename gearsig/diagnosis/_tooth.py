"""Damage at one tooth: a local event of the difference signal that comes back every revolution of its shaft."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import combinations
from math import log10

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis._mesh import teeth_are_contradicted
from gearsig.diagnosis._signals import AnalysisSignals, ShaftSignals
from gearsig.diagnosis._speed import mesh_is_confirmed
from gearsig.diagnosis._types import WITH_ASSUMED_DATA, Finding, Kind, Strength, Where, from_p_value, p_text
from gearsig.orders import whole_revolutions
from gearsig.prepared import has_mark, sliding_mean, strongest_window

# --------------------
# Whether the energy of a periodic signal is gathered at one angle, more than its spectrum alone would make it.
# --------------------


_SURROGATES_AT_ONCE = 256
"""Bounds the memory: 256 × 4 channels × 4096 angles in double precision are 34 MB."""

_ENOUGH_HIGHER = 30
"""Surrogates with as high a ratio after which the p-value is known to a fifth of itself, and is no small one."""


@dataclass(frozen=True)
class Localisation:
    """The window of angle with the most energy.

    Parameters
    ----------
    angle_rev : float
        Where in the window the event sets in, 0 to 1 revolution.
    start_rev : float
        Where the window begins.
    width_rev : float
    ratio_db : float
        Energy in it over the median window's, summed over channels that are each scaled to unit energy.
    p_value : float
        The larger of two: the share of surrogates (same spectra, same relations between the channels, random phases)
        with as high a ratio, and the chance of it among teeth that differ as the teeth of a good gear do.
    repeatability : float
        Correlation of odd and even revolutions within the window, -1 to 1; about 0 for noise, for impacts that are
        not tied to this shaft, and for a single event in one revolution.
    channel_shares : tuple of float
        Energy in the window over the median window's for each channel.
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
    """Test whether the energy of a synchronous average's difference signal sits at one tooth.

    Phase-randomised surrogates keep the spectrum: a residual of few lines, tooth-to-tooth scatter or coloured noise
    gives windows of unequal energy too, and only what goes beyond them counts. The same random phases are used for all
    channels, which keeps their relations.

    Surrogates know nothing of teeth. On a good gear each tooth is a little stronger or weaker than its neighbours, over
    its whole engagement and in all harmonics at once, so that energies per tooth scatter like the square of one normal
    number (chi-square with one degree of freedom), which is more than surrogates do: that is the second test.

    Parameters
    ----------
    signals : array, (n_channels, n_angles)
        Over one revolution.
    halves : array, (n_channels, 2, n_angles)
        The same of odd and even revolutions by themselves.
    width_rev : float
        Width of the window in revolutions, e.g. one tooth pitch.
    n_surrogates : int
        At most; the drawing stops early once it is plain that nothing is there.
    rng : Generator

    Returns
    -------
    Localisation

    References
    ----------
    J. Theiler, S. Eubank, A. Longtin, B. Galdrikian, J. D. Farmer, "Testing for nonlinearity in time series: the
    method of surrogate data", 1992. J. Besag, P. Clifford, "Sequential Monte Carlo p-values", 1991.
    """
    n = signals.shape[1]
    width = max(2, round(width_rev * n))
    scale = np.sqrt(np.mean(signals**2, axis=1, keepdims=True))
    used = scale[:, 0] > 0
    x = signals[used] / scale[used]
    energies = sliding_mean(x**2, width)
    start, ratio = strongest_window(energies.sum(axis=0))
    drawn = np.empty(0)
    for surrogates in _surrogates(x, n_surrogates, rng):
        drawn = np.append(drawn, _ratios(surrogates, width))
        if np.sum(drawn >= ratio) >= _ENOUGH_HIGHER:
            break
    inside = (start + np.arange(width)) % n
    medians = np.median(energies, axis=1)
    shares = np.zeros(len(signals))
    shares[used] = energies[:, start] / medians
    return Localisation(
        angle_rev=_onset(x, start, width),
        start_rev=start / n,
        width_rev=width / n,
        ratio_db=10 * float(np.log10(ratio)),
        p_value=max(_p_among_surrogates(ratio, drawn), _p_among_teeth(ratio, n / width)),
        repeatability=_agreement(halves[used][:, :, inside] / scale[used][:, None]),
        channel_shares=tuple(float(s) for s in shares),
    )


def _p_among_surrogates(ratio: float, drawn: FloatArray) -> float:
    """Return the share of surrogates with as high a ratio; beyond the highest, the tail of a Gumbel distribution.

    Window energies of Gaussian signals have exponential tails, and the largest of many such is Gumbel distributed; mean
    and standard deviation of the drawn ratios give its parameters (E. J. Gumbel, *Statistics of Extremes*, 1958).
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
    return float(-np.expm1(n_teeth * np.log1p(-min(single, 1 - 1e-12))))


def _agreement(halves: FloatArray) -> float:
    """Return the correlation between odd and even revolutions, (n_channels, 2, n_angles), over all channels."""
    odd, even = halves[:, 0], halves[:, 1]
    size = float(np.sqrt(np.sum(odd**2) * np.sum(even**2)))
    return float(np.sum(odd * even)) / size if size > 0 else 0.0


def _onset(x: FloatArray, start: int, width: int) -> float:
    """Return the angle within the window at which the energy has risen to half of its highest value.

    A knock rises at once and rings on: its highest energy comes a little after it. Energy is taken over an eighth of
    the window, and a little of what lies before the window is looked at too.
    """
    n, short = x.shape[1], max(1, width // 8)
    inside = (start - short + np.arange(width + short)) % n
    energy = np.convolve((x[:, inside] ** 2).sum(axis=0), np.ones(short), "valid")
    rise = int(np.argmax(energy >= 0.5 * energy.max()))
    return float(((start - short + rise + short / 2) / n) % 1.0)


def _surrogates(x: FloatArray, n_surrogates: int, rng: np.random.Generator) -> Iterator[FloatArray]:
    """Yield surrogates of all channels, (n, n_channels, n_angles), in bounded portions."""
    n = x.shape[1]
    lines = np.fft.rfft(x, axis=1)
    done = 0
    while done < n_surrogates:
        m = min(_SURROGATES_AT_ONCE, n_surrogates - done)
        phases = rng.uniform(0, 2 * np.pi, (m, 1, lines.shape[1]))
        phases[..., 0] = 0.0
        yield np.fft.irfft(lines * np.exp(1j * phases), n, axis=-1)
        done += m


def _ratios(surrogates: FloatArray, width: int) -> FloatArray:
    joint = sliding_mean(np.sum(surrogates**2, axis=1), width)
    ratios: FloatArray = joint.max(axis=1) / np.median(joint, axis=1)
    return ratios


# --------------------
# Local events on a shaft: where, how large, how many per revolution, and in which revolutions.
# --------------------


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


def largest_event(shaft: ShaftSignals, signals: AnalysisSignals) -> LocalEvent:
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
    shaft: ShaftSignals, signals: AnalysisSignals, place: Localisation, differences: FloatArray, lowest_order: int
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
    energy = sliding_mean(square, width)
    floor = float(np.median(energy))
    limit = floor + PEAK_SHARE * (float(energy.max()) - floor)
    starts: list[int] = []
    for start in np.argsort(-energy):
        if energy[start] < limit or len(starts) > 24:
            break
        # A knock rings on: what follows within two windows is the same event.
        if all(min((start - other_start) % n, (other_start - start) % n) > 2 * width for other_start in starts):
            starts.append(int(start))
    return tuple(other_start / n for other_start in starts)


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


def _periods(signals: AnalysisSignals, shaft: ShaftSignals) -> set[int]:
    """Return after how many revolutions each other shaft stands as before; 2 is always tried.

    Two for a machine that works every second revolution, and for pulses that are counted wrongly.
    """
    ratio = signals.rig.ratio(shaft.shaft) or 1.0
    periods = {2}
    for order in signals.known_shaft_orders.values():
        fraction = Fraction(ratio / order).limit_denominator(LARGEST_PERIOD * 4)
        if abs(float(fraction) - ratio / order) < 1e-9 and fraction.numerator <= LARGEST_PERIOD:
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


# --------------------
# Local events that are no tooth: single shocks, several per revolution, or not in every revolution.
# --------------------


def event_strength(shaft: ShaftSignals, event: LocalEvent) -> Strength:
    """Return the event's rms against the median window's."""
    unit = shaft.averages[event.channel].unit
    ratio_db = 20 * log10(event.rms / event.median_rms) if event.rms > 0 and event.median_rms > 0 else None
    return Strength(
        event.rms, unit, event.median_rms, f"median tooth of the difference signal in {event.channel}", ratio_db
    )


def single_shock(shaft: ShaftSignals, event: LocalEvent) -> Finding:
    """Report an event that one revolution alone has."""
    first_whole = np.ceil(shaft.signal.start_revolution - 1e-9)
    revolution = first_whole + (event.single_revolution or 0) + event.place.angle_rev
    time = float(np.interp(revolution, shaft.angle.revolutions, shaft.angle.time_s))
    return Finding(
        "single-shock",
        Kind.NOTICE,
        f"A single shock near {time:.3g} s, in one of {shaft.averages[event.channel].n_revolutions} revolutions.",
        Where((event.channel,), shaft=shaft.shaft, time_s=(time, time)),
        event_strength(shaft, event),
        confidence=0.95,
        confidence_basis="more than half of what the average shows comes from that revolution",
        surer="Another recording: what the machine does comes back.",
    )


def event_in_some_revolutions(signals: AnalysisSignals, shaft: ShaftSignals, event: LocalEvent) -> Finding:
    """Report an event that only every second, third, … revolution has."""
    ratio = signals.rig.ratio(shaft.shaft) or 1.0
    share = 100 * event.share_of_revolutions
    slower = [n for n, order in signals.known_shaft_orders.items() if order < ratio * (1 - 1e-9)]
    return Finding(
        "event-in-some-revolutions",
        Kind.CANNOT_TELL,
        f"A local event on shaft {shaft.shaft}, but only in {share:.0f} % of its revolutions.",
        Where((event.channel,), shaft=shaft.shaft),
        event_strength(shaft, event),
        confidence=0.95,
        confidence_basis="revolutions sorted by their number",
        evidence=(
            "A machine that works every second revolution does this.",
            "So does a tachometer whose pulses per revolution are stated too low: then speed and teeth are wrong too.",
            *(f"It may belong to a slower shaft ({', '.join(slower)})." for _ in slower[:1]),
        ),
        surer="Check pulses_per_revolution and the teeth.",
    )


def several_events(shaft: ShaftSignals, event: LocalEvent) -> Finding:
    """Report equally spaced events."""
    n = len(event.peaks_rev)
    return Finding(
        "several-events-per-revolution",
        Kind.NOTICE,
        f"{n} equally spaced local events per revolution of shaft {shaft.shaft}: not a single tooth.",
        Where((event.channel,), shaft=shaft.shaft, angle_deg=360 * event.place.angle_rev),
        event_strength(shaft, event),
        confidence=0.9,
        confidence_basis="equal distances and similar energy",
        evidence=("Couplings, pumps, presses, pistons and faster shafts of a whole ratio do this.",),
        surer="A recording at another load, or one with a sensor nearer to the suspected cause.",
    )


WORTH_SAYING = (0.01, 8.0)
CLEAR = (0.001, 10.0)
"""p-value at most, and dB of the window over the median window at least."""

REPEATABLE = 0.7
"""Correlation of odd and even revolutions in the window; chance impacts give about 0."""

SMALLEST_SHARE = 0.05
SMALLEST_SIGNIFICANCE = 3.0
"""Rms in the window against that of the whole average, and against the average's standard error there: below, an event
is too small to matter, or is made by the ends of the record."""

EVERY_REVOLUTION = 0.75
"""Part of the revolutions that must carry an event for it to be this shaft's, and not a slower one's."""

TEETH_THAT_DIFFER_DB = 14.7
"""Largest of some forty teeth over the median one that one gear in a hundred reaches: chi-square, one degree."""

LARGEST_BLIND_SHARE = 0.5
"""If an event as large as half of the average's rms would not have shown, nothing is said about the teeth."""

CAUSE = 0.9
"""Share of once-per-revolution events on a shaft with gears that are damage to a tooth, not a key, coupling or rub."""

NEAR_MARK_DEG = 6.0

ASK_FOR_REFERENCE = (
    "A recording of the same gears when they were healthy, given with --reference: what teeth are made with cancels."
)
MORE_SURER = "More revolutions, a sensor nearer to the gears, a higher load; certain data of the machine."


@dataclass(frozen=True)
class _Examined:
    shaft: ShaftSignals
    event: LocalEvent
    p_value: float


def detect_tooth_damage(signals: AnalysisSignals) -> list[Finding]:
    """Look at each shaft's difference signals for a local event, and say which shafts could not be examined."""
    able = [s for s in signals.shafts if s.separated and _why_blind(signals, s) == ""]
    tested = [(s, largest_event(s, signals)) for s in able]
    examined = [_Examined(s, event, min(1.0, event.place.p_value * len(tested))) for s, event in tested]
    judged = [(e, _finding(signals, e)) for e in _one_per_pair_of_twins(signals, examined)]
    findings = [f for _, f in judged if f is not None]
    codes = {f.code for f in findings}
    shocks = [f for f in findings if f.code == "single-shock"]
    findings = [f for f in findings if f not in shocks[1:]]  # every shaft's average shows the same one
    if "tooth-local-damage" in codes:  # events of other shafts are its images
        findings = [f for f in findings if f.code in ("tooth-local-damage", "single-shock")]
    elif "event-in-some-revolutions" not in codes:  # with it, even the speed is in doubt
        findings += _nothing_found(signals, [e for e, f in judged if f is None])
        covered = [e for e, f in judged if f is not None]
        reason, given = "other local events would cover damage", signals.has_reference
        findings += [_undecided(covered, reason, has_reference=given)] if covered else []
    return findings + _not_examined(signals, {s.shaft for s in able})


def _finding(signals: AnalysisSignals, examined: _Examined) -> Finding | None:
    """Return what an event is: damage, several events, one that is not in every revolution; None if it is nothing."""
    event = examined.event
    if event.is_equally_spaced and _is_steady(event) and event.place.ratio_db >= WORTH_SAYING[1]:
        return several_events(examined.shaft, event)  # their own energy raises the median: the test is not for them
    if not _reaches(WORTH_SAYING, examined) or event.rms < SMALLEST_SHARE * event.average_rms:
        return None
    if event.single_revolution is not None:
        return single_shock(examined.shaft, event)
    if event.share_of_revolutions < EVERY_REVOLUTION:
        return event_in_some_revolutions(signals, examined.shaft, event)
    return _damage(signals, examined) if _is_steady(event) else None


def _is_steady(event: LocalEvent) -> bool:
    """Whether an event is of some size, and in odd and even revolutions alike."""
    large = event.rms >= max(SMALLEST_SHARE * event.average_rms, SMALLEST_SIGNIFICANCE * event.error_rms)
    return large and event.place.repeatability >= REPEATABLE


def _damage(signals: AnalysisSignals, examined: _Examined) -> Finding:
    shaft, event = examined.shaft, examined.event
    assumed = ", ".join(signals.rig.assumed)
    at_mark = _at_mark(signals, examined)
    confidence = from_p_value(examined.p_value) * CAUSE * (WITH_ASSUMED_DATA if assumed or at_mark else 1.0)
    clear = _reaches(CLEAR, examined) and not assumed and not at_mark
    place = event.place
    tooth = int(place.angle_rev * shaft.teeth[0]) + 1 if len(shaft.teeth) == 1 and _has_mark(signals, shaft) else None
    at = f"at {360 * place.angle_rev:.0f}°, tooth {tooth} of {shaft.teeth[0]}," if tooth else "at one place"
    basis = f"chance of it on a gear whose teeth merely differ: {p_text(examined.p_value)}; one in ten such events has "
    basis += "another cause on the shaft (key, coupling, rub)"
    what = "Local tooth damage" if clear else "A local event, perhaps tooth damage,"
    return Finding(
        "tooth-local-damage",
        Kind.FAULT if clear else Kind.SUSPICION,
        f"{what} {at} of shaft {_names(signals, shaft)}.",
        Where(
            _channels(shaft, event),
            shaft=shaft.shaft,
            gear=_gear_name(signals, shaft),
            angle_deg=360 * place.angle_rev,
            tooth=tooth,
        ),
        event_strength(examined.shaft, event),
        confidence=confidence,
        confidence_basis=basis + (f"; halved because {assumed} are assumed" if assumed else ""),
        evidence=_evidence(signals, examined),
        surer=_surer(signals),
    )


def _one_per_pair_of_twins(signals: AnalysisSignals, examined: list[_Examined]) -> list[_Examined]:
    """Keep one of two shafts of equal speed: their averages hold the same events."""
    kept = list(examined)
    for one, other in combinations(examined, 2):
        equal = abs((signals.rig.ratio(one.shaft.shaft) or 1) / (signals.rig.ratio(other.shaft.shaft) or 1) - 1) < 1e-9
        if equal and one in kept and other in kept:
            kept.remove(other)
    return kept


def _names(signals: AnalysisSignals, shaft: ShaftSignals) -> str:
    own = signals.rig.ratio(shaft.shaft) or 1.0
    twins = [n for n, order in signals.known_shaft_orders.items() if abs(order / own - 1) < 1e-9 and n != shaft.shaft]
    return " or ".join([shaft.shaft, *twins])


def _reaches(level: tuple[float, float], examined: _Examined) -> bool:
    return examined.p_value <= level[0] and examined.event.place.ratio_db >= level[1]


def _has_mark(signals: AnalysisSignals, shaft: ShaftSignals) -> bool:
    """Whether the angle of this very shaft counts from a mark that is there once per revolution."""
    return has_mark(signals.recording, signals.rig, shaft.shaft)


def _at_mark(signals: AnalysisSignals, examined: _Examined) -> bool:
    """Whether the event is where the tachometer's pulse is, which crosses over into bad cables."""
    degrees = 360 * examined.event.place.angle_rev
    return _has_mark(signals, examined.shaft) and min(degrees, 360 - degrees) < NEAR_MARK_DEG


def _channels(shaft: ShaftSignals, event: LocalEvent) -> tuple[str, ...]:
    strong = [n for n, s in zip(shaft.separated, event.place.channel_shares, strict=True) if s >= 4.0]
    return tuple(strong) or (event.channel,)


def _evidence(signals: AnalysisSignals, examined: _Examined) -> tuple[str, ...]:
    shaft, event = examined.shaft, examined.event
    texts = [
        f"Energy in one tooth pitch is {event.place.ratio_db:.1f} dB over the median pitch, all channels together.",
        f"{shaft.averages[event.channel].n_revolutions} revolutions were averaged.",
        f"It comes back: odd and even revolutions correlate there by {event.place.repeatability:.2f}.",
        f"Its rms is {100 * event.rms / event.average_rms:.0f} % of the whole average's.",
    ]
    if len(event.peaks_rev) > 1:
        texts.append(f"It is the largest of {len(event.peaks_rev)} local events: several teeth, or another cause.")
    if _at_mark(signals, examined):
        texts.append("It is at the tachometer's mark: cross-talk from its cable would look the same.")
    if not _has_mark(signals, shaft):
        texts.append("No once-per-revolution mark is on this shaft: the angle holds for this record's average only.")
    elif len(shaft.teeth) == 1:
        texts.append("Teeth count from 1 at the mark, as they engage; the place is good to about one tooth.")
    if len(shaft.teeth) > 1:
        teeth = ", ".join(map(str, shaft.teeth))
        texts.append(f"The shaft carries {len(shaft.teeth)} gears ({teeth} teeth); it may be on either.")
    return tuple(texts)


def _surer(signals: AnalysisSignals) -> str:
    if signals.rig.assumed:
        return "Confirm what is assumed of the rig: " + ", ".join(signals.rig.assumed) + "."
    good = "" if signals.has_reference else ", or of the same gearbox when it was good"
    if signals.angle is not None and signals.angle.method in ("tachless", "constant", "speed channel"):
        return f"A recording with a tachometer, or at another load{good}."
    return f"A recording at another load or speed (damage stays at its tooth){good}."


def _nothing_found(signals: AnalysisSignals, examined: list[_Examined]) -> list[Finding]:
    """State that nothing shows, of those shafts where damage of a useful size would have shown."""
    given = signals.has_reference
    if examined and signals.rig.assumed:
        assumed = ", ".join(signals.rig.assumed)
        return [_undecided(examined, f"{assumed} are assumed: damage may not show", has_reference=given)]
    sharp = [e for e in examined if _smallest_visible(e.event) <= LARGEST_BLIND_SHARE * e.event.average_rms]
    blunt = [e for e in examined if e not in sharp]
    findings = []
    if sharp:
        shafts = ", ".join(e.shaft.shaft for e in sharp)
        findings.append(
            Finding(
                "no-tooth-local-damage",
                Kind.INFORMATION,
                f"No local tooth damage shows on shaft(s) {shafts}.",
                Where(channels=tuple(sharp[0].shaft.separated), shaft=sharp[0].shaft.shaft if len(sharp) == 1 else ""),
                confidence=0.8,
                confidence_basis="small damage may be hidden below the mesh's own variation",
                evidence=tuple(_visible_text(e) for e in sharp),
                surer=_surer(signals),
            )
        )
    noisy = [e for e in blunt if _is_noise(e.event)]
    uneven = [e for e in blunt if e not in noisy]
    if noisy:
        reason = "noise would hide an event of half the average's size"
        findings.append(_undecided(noisy, reason, has_reference=given))
    if uneven:
        reason = "they differ so much from each other that damage may hide among them"
        findings.append(_undecided(uneven, reason, has_reference=given))
    return findings


def _undecided(examined: list[_Examined], reason: str, *, has_reference: bool) -> Finding:
    shafts = ", ".join(e.shaft.shaft for e in examined)
    return Finding(
        "tooth-damage-undecided",
        Kind.CANNOT_TELL,
        f"Nothing shows at the teeth of shaft(s) {shafts}, but {reason}.",
        Where(channels=tuple(examined[0].shaft.separated)),
        evidence=tuple(_visible_text(e) for e in examined),
        surer=MORE_SURER if has_reference else f"{ASK_FOR_REFERENCE} Or {MORE_SURER[0].lower()}{MORE_SURER[1:]}",
    )


def _is_noise(event: LocalEvent) -> bool:
    """Whether the median tooth's part of the difference signal is mostly noise that the average has left."""
    return event.median_rms <= SMALLEST_SIGNIFICANCE * event.error_rms


def _smallest_visible(event: LocalEvent) -> float:
    """Return the rms in a window from which an event stands out from teeth that merely differ."""
    return event.median_rms * float(10 ** (TEETH_THAT_DIFFER_DB / 20))


def _visible_text(examined: _Examined) -> str:
    event = examined.event
    smallest = _smallest_visible(event)
    share = 100 * smallest / event.average_rms if event.average_rms > 0 else 0.0
    return (
        f"Shaft {examined.shaft.shaft}: the largest tooth is {event.place.ratio_db:.1f} dB over the median (chance if "
        f"teeth merely differ: {p_text(examined.p_value)}). An event of {smallest:.3g} rms in {event.channel}, "
        f"{share:.0f} % of the average, would have shown."
    )


def _why_blind(signals: AnalysisSignals, shaft: ShaftSignals) -> str:
    """Return why the teeth of a shaft cannot be looked at although there is an average; empty if they can."""
    pairs = [p for p in signals.rig.pairs if shaft.shaft in (p.driver, p.driven)]
    for pair in pairs:
        real = teeth_are_contradicted(signals, pair)
        if real is not None:
            return f"the mesh of {pair.name} is at order {real:.5g}, not where its teeth put it"
    if not any(mesh_is_confirmed(signals, pair) for pair in pairs):
        return "no mesh line stands where speed and teeth put it"
    return ""


def _not_examined(signals: AnalysisSignals, examined: set[str]) -> list[Finding]:
    """Say of each shaft with gears why its teeth were not looked at."""
    reasons: dict[str, list[str]] = {}
    for shaft in dict.fromkeys(s for pair in signals.rig.pairs for s in (pair.driver, pair.driven)):
        if shaft not in examined:
            reasons.setdefault(_reason(signals, shaft), []).append(shaft)
    return [
        Finding(
            "tooth-not-examined",
            Kind.CANNOT_TELL,
            f"Teeth on shaft(s) {', '.join(shafts)} cannot be examined: {reason}.",
            surer="A longer recording with a tachometer, the right teeth of all gears, a higher sampling rate.",
        )
        for reason, shafts in reasons.items()
    ]


def _reason(signals: AnalysisSignals, name: str) -> str:
    if signals.angle is None:
        return "the speed is not known"
    ratio = signals.rig.ratio(name)
    if ratio is None:
        return "a tooth count on the way to it is missing"
    revolutions, needed = signals.angle.n_revolutions * ratio, signals.settings.minimum_revolutions
    if revolutions < needed:
        return f"the record holds {revolutions:.3g} of its revolutions and {needed} are needed"
    for shaft in signals.shafts:
        if shaft.shaft == name and shaft.separated:
            return _why_blind(signals, shaft)
    return "its gear has no known teeth, its mesh is above half the sampling rate, or the record is too short"


def _gear_name(signals: AnalysisSignals, shaft: ShaftSignals) -> str:
    pairs = [p.name for p in signals.rig.pairs if shaft.shaft in (p.driver, p.driven)]
    return f"{pairs[0]}/{shaft.shaft}" if len(pairs) == 1 else ""
