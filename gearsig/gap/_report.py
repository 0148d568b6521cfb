"""The gap report: where the gap is, which effect causes it, how far it shrinks, what to record next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import exp, inf, isfinite, isinf, nan

import numpy as np

from gearsig.checks import FloatArray
from gearsig.formatting import enumerated, odds_text, percent, readable
from gearsig.gap._simulator import AddedEffect, GapEffect, OperatingCondition, same_load, same_speed
from gearsig.results import Result, verdict_html

_UNITS = {"um": "µm", "deg": "°", "g mm": "g·mm", "N m": "N·m", "m/s^2": "m/s²", "1": ""}


def severity_unit(unit: str) -> str:
    """Format the unit of a severity for display.

    Examples
    --------
    >>> severity_unit("um"), severity_unit("mm")
    ('µm', 'mm')
    """
    return _UNITS.get(unit, unit)


# --------------------
# The curves that a gap report draws: order spectra, energy over the angle, synchronous averages.
# --------------------


@dataclass(frozen=True)
class SpectrumCurves:
    """Order spectra of one shaft's average or of the residual, measured and simulated.

    Parameters
    ----------
    label, unit : str
    orders : array, (n,)
        In orders of the driver's shaft.
    measured, before, after : arrays, (n,)
        Peak amplitudes. `after` includes the most probable effect and is empty where there is none; `before` is empty
        where nothing was simulated.
    floor : array, (n,)
        Repeatability floor; where nothing was simulated, the noise level around the lines.
    structural_db : array, (n,)
        Deviation of healthy machines from the baseline compared with, line by line; empty if not known.
    reference, reference_floor, reference_structural_db : arrays, (n,)
        Peak amplitudes of the healthy reference, the repeatability floor of both recordings together, and how much
        healthy machines change from one recording to another; empty where there is no reference.
    """

    label: str
    unit: str
    orders: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    floor: FloatArray
    structural_db: FloatArray = field(default_factory=lambda: np.zeros(0))
    reference: FloatArray = field(default_factory=lambda: np.zeros(0))
    reference_floor: FloatArray = field(default_factory=lambda: np.zeros(0))
    reference_structural_db: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class AngleCurves:
    """Energy of one shaft's residual synchronous average over its angle, measured and simulated.

    Parameters
    ----------
    shaft, unit : str
    teeth : int
    has_mark : bool
        Whether angle 0 is a tachometer mark, so that teeth can be numbered.
    angle_deg : array, (n,)
    measured, before, after : arrays, (n,)
        Energy within one pitch relative to the median tooth; `after` may be empty.
    """

    shaft: str
    unit: str
    teeth: int
    has_mark: bool
    angle_deg: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray


@dataclass(frozen=True)
class AverageCurves:
    """The tooth-to-tooth part of a shaft's synchronous average, of the recording and of the healthy reference.

    Parameters
    ----------
    shaft, unit, channel : str
    teeth : int
    has_mark : bool
        Whether angle 0 is a tachometer mark, so that teeth can be numbered.
    angle_deg : array, (n,)
    measured, reference : arrays, (n,)
        Without the mesh harmonics, their close sidebands and the first shaft orders. The reference is rotated so that
        the same teeth coincide, and its gain is matched as far as a slightly different speed or load explains it.
    """

    shaft: str
    unit: str
    channel: str
    teeth: int
    has_mark: bool
    angle_deg: FloatArray
    measured: FloatArray
    reference: FloatArray


LIKELIER_THAN_NOT = 0.5
"""Probability from which a cause, or a kind of fault, is more probable than all others together. No effect is named
below it, nor are two whose sum is below it: the cause is then unknown, however certain it is that something is
wrong."""

NONE, UNKNOWN = "none", "unknown"
"""Names of the two causes that are not effects: no gap beyond the floor; a gap that nothing in the catalogue
explains."""


class GapOutcome(Enum):
    """The outcome of a diagnosis."""

    NO_GAP = "no gap"
    EFFECT = "effect"
    CANNOT_SEPARATE = "cannot separate"
    UNKNOWN = "unknown"
    UNDECIDED = "undecided"
    """Neither an effect, nor its absence, nor an unknown cause is probable enough to be stated."""


NAMING = (GapOutcome.EFFECT, GapOutcome.CANNOT_SEPARATE)
"""Outcomes that name an effect; with any other outcome nothing is added to the simulator."""


class PlaceKind(Enum):
    """The domain in which a place of the gap is located."""

    MESH = "mesh harmonics"
    SIDEBANDS = "sidebands"
    SHAFT = "shaft orders"
    TOOTH = "angle of rotation"
    ENVELOPE = "envelope orders"
    LINE = "line that belongs to no shaft"
    BAND = "frequency band"
    SPEED = "time and speed"
    TAIL = "amplitudes"


@dataclass(frozen=True)
class GapPlace(Result):
    """One place at which the recording differs from its baseline.

    Parameters
    ----------
    kind : PlaceKind
    title : str
        The finding in one phrase.
    change_db : float
        Level of the recording relative to the simulation (or the reference) at the strongest part; for lines found
        without a simulation and not shown by the reference, relative to the noise around them.
    repeatability, structural : float
        The change divided by each floor (1: as large as the floor); nan where nothing was simulated.
    share : float
        Fraction of the whole gap, 0 to 1; nan where it `follows` or was found without a simulation.
    shaft : str
    orders : tuple of float
        Orders of the driver's shaft at which the change is largest.
    band_hz : (float, float) or None
    angle_deg : float or None
        Angle of the shaft.
    tooth : int or None
        Counted from 1 at the mark; None where there is no mark.
    channel : str
        Channel on which it is strongest; empty: all channels.
    follows : bool
        Whether it only follows from other places, and so gives no hint of its own where to look.
    """

    kind: PlaceKind
    title: str
    change_db: float
    repeatability: float = nan
    structural: float = nan
    share: float = nan
    shaft: str = ""
    orders: tuple[float, ...] = ()
    band_hz: tuple[float, float] | None = None
    angle_deg: float | None = None
    tooth: int | None = None
    channel: str = ""
    follows: bool = False


@dataclass(frozen=True)
class Interval:
    """A value with its 90 % interval; `high` is infinite where there is no upper bound.

    Parameters
    ----------
    value : float
        In the unit of the quantity.
    low, high : float
        Ends of the interval; 0 and infinity mean that any size fits about as well.
    """

    value: float
    low: float
    high: float

    @classmethod
    def around(cls, value: float, half: float, low: float = -inf, high: float = inf) -> Interval:
        """Return value ± half, with its ends limited to `low` and `high`."""
        return cls(value, max(value - half, low), min(value + half, high))

    @property
    def is_unbounded(self) -> bool:
        """Whether any size fits about as well."""
        return self.low == 0.0 and isinf(self.high)

    @property
    def text(self) -> str:
        """The value, with as many digits as `words` gives the ends."""
        return self._written(self.value)

    def words(self) -> str:
        """Return the interval in words, with as many digits (at least two) as distinguish its ends.

        Examples
        --------
        >>> ends = ((1.5, 3.0), (1.98, 2.03), (1.5, float("inf")), (0.0, float("inf")))
        >>> [Interval(2.0, *both).words() for both in ends]
        ['1.5 to 3', '1.98 to 2.03', '1.5 or more', 'unbounded']
        """
        if self.is_unbounded:
            return "unbounded"
        low, high = self._written(self.low), self._written(self.high)
        return f"{low} or more" if isinf(self.high) else f"{low} to {high}"

    def _written(self, number: float) -> str:
        n = next((n for n in (2, 3) if readable(self.low, n) != readable(self.high, n)), 4)
        return readable(number, n if self.low < self.high else 2)


NOT_KNOWN = Interval(nan, nan, nan)
MIN_PREDICTED = 0.5
"""Floors: predicted changes smaller than this are no evidence, whether the gap shrinks or grows."""


@dataclass(frozen=True)
class Shrinkage:
    """How far the gap shrinks once an effect is added, on data that its severity was not fitted to.

    Parameters
    ----------
    before, after : Interval
        RMS of the gap over the effect's own features, in structural floors.
    shrink : Interval
        1 − after²/before², each less the floors; 1: fully explained.
    slope : float
        Slope of the observed change against the predicted one; 1: sign and size are right.
    placebo : float
        Largest shrink that the same effect reaches in a wrong place: another order, gear, shaft or bearing. 0 where
        there is no other place.
    held_out : str
        Data it was scored on: "another operating condition" or "other revolutions of the same recordings".
    n_placebos : int
        Number of wrong places tried.
    elsewhere : float or None
        Shrink at operating conditions of which only the level was fitted; severity and place come from the other
        conditions. None with a single condition.
    predicted : float or None
        Largest change that the simulator predicts for the fitted effect, in floors; None where not known.
    of_all : float or None
        Shrink over the features that any of the tried effects changes, which makes effects comparable; None where not
        known.
    """

    before: Interval
    after: Interval
    shrink: Interval
    slope: float
    placebo: float
    held_out: str
    n_placebos: int = 1
    elsewhere: float | None = None
    predicted: float | None = None
    of_all: float | None = None

    @property
    def is_predicted(self) -> bool:
        """Whether the simulated effect is large enough for its shrink to mean anything."""
        return self.predicted is None or self.predicted >= MIN_PREDICTED


@dataclass(frozen=True)
class Evidence:
    """One predicted change beside the observed one.

    Parameters
    ----------
    feature : str
        In words, e.g. "sidebands of the driver's shaft, 6 to 12 orders away".
    predicted_db, observed_db, floor_db : float
    speaks_for : bool
        Whether sign and size agree with the prediction.
    is_further : bool
        Whether the feature changed in the predicted direction, but by more than predicted. The effect does not explain
        the excess, which is no evidence against it; `speaks_for` is False then.
    """

    feature: str
    predicted_db: float
    observed_db: float
    floor_db: float
    speaks_for: bool
    is_further: bool = False


@dataclass(frozen=True)
class GapCause(Result):
    """A candidate cause with its probability.

    Parameters
    ----------
    name : str
        Name of an effect, or "none" or "unknown".
    group, title, unit : str
    probability : float
        Calibrated, over all causes; an upper limit where nothing was simulated.
    severity : Interval or None
        Severity at which the twin comes nearest, in the effect's unit. The interval is that of the fit; the machine's
        true severity may lie outside it.
    fitted : AddedEffect or None
        The best-fitting setting.
    place : str
        For example "tooth 7 of the driver", "bearing 2" or "order 6"; empty where the cause has no place.
    shrinkage : Shrinkage or None
    evidence : tuple of Evidence
        Strongest first, for and against.
    is_nuisance : bool
    notes : tuple of str
        Evidence for and against it in words, where no simulation makes a prediction.
    """

    name: str
    group: str
    title: str
    unit: str
    probability: float
    severity: Interval | None = None
    fitted: AddedEffect | None = None
    place: str = ""
    shrinkage: Shrinkage | None = None
    evidence: tuple[Evidence, ...] = ()
    is_nuisance: bool = False
    notes: tuple[str, ...] = ()

    @property
    def is_effect(self) -> bool:
        """Whether it is an effect, neither "none" nor "unknown"."""
        return self.name not in (NONE, UNKNOWN)


def group_probabilities(
    probabilities: Mapping[str, float], known: Mapping[str, GapEffect] | Mapping[str, GapCause]
) -> dict[str, float]:
    """Return group → total probability of its causes, P(g) = Σ_{c∈g} P(c), largest first.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    known : mapping
        Cause → object with its group; a cause that is missing here forms a group of its own.
    """
    by_group: dict[str, float] = {}
    for name, p in probabilities.items():
        group = known[name].group if name in known else name
        by_group[group] = by_group.get(group, 0.0) + p
    return likeliest_first(by_group)


def likeliest_first(probabilities: Mapping[str, float]) -> dict[str, float]:
    """Return the same probabilities, largest first."""
    return dict(sorted(probabilities.items(), key=lambda item: -item[1]))


TOGETHER, MAX_RIVALS = 0.9, 4
"""Effects that cannot be separated: the smallest set of most probable effects that holds this fraction of the
probability of all effects, limited to this many."""


def scaled(weights: Mapping[str, float]) -> dict[str, float]:
    """Return weights normalised to probabilities, largest first."""
    total = sum(weights.values())
    return likeliest_first({name: weight / total for name, weight in weights.items()})


def shares_of(levels: Mapping[str, float]) -> dict[str, float]:
    """Return probabilities p_c ∝ exp(level_c), largest first."""
    top = max(levels.values())
    return scaled({name: exp(level - top) for name, level in levels.items()})


def inseparable_effects(causes: Sequence[GapCause]) -> tuple[str, ...]:
    """Return the effects that cannot be separated: the two most probable, and more until they hold `TOGETHER` of all.

    Parameters
    ----------
    causes : sequence of GapCause
        "none" and "unknown" are skipped.

    Returns
    -------
    tuple of str
        Most probable first, at most `MAX_RIVALS`.
    """
    effects = sorted((c for c in causes if c.is_effect), key=lambda cause: -cause.probability)
    shares = np.cumsum([cause.probability for cause in effects])
    n = int(np.searchsorted(shares, TOGETHER * shares[-1])) + 1 if effects else 0
    return tuple(cause.name for cause in effects[: int(np.clip(n, 2, MAX_RIVALS))])


USER_LABELS = "your own labels"
"""Group of causes known only from the user's labelled recordings."""

KIND_TITLES = {
    "tooth-local": "a damaged tooth",
    "flank": "the flanks of the teeth",
    "shaft": "unbalance, run-out or misalignment of a shaft",
    "drive and load": "the drive or the load",
    "bearing": "a bearing",
    "measurement chain": "the measurement chain",
    USER_LABELS: "what you have labelled",
}
"""Group of effects → kind of fault in words; for any other group its name is used."""


@dataclass(frozen=True)
class GapKind:
    """The kind of fault, which is more certain than the particular effect.

    Parameters
    ----------
    group, title : str
    probability : float
        Sum over its effects.
    place : str
        Place of its most probable effect; empty where that has none.
    """

    group: str
    title: str
    probability: float
    place: str = ""


def kind_of(causes: Sequence[GapCause], groups: Mapping[str, float]) -> GapKind | None:
    """Return the most probable kind of fault, None where it is no more probable than all else together."""
    effects = {name: p for name, p in groups.items() if name not in (NONE, UNKNOWN, "")}
    group = max(effects, key=effects.__getitem__, default="")
    if not effects.get(group, 0.0) >= LIKELIER_THAN_NOT:
        return None
    place = next((cause.place for cause in causes if cause.group == group), "")
    return GapKind(group, KIND_TITLES.get(group, group), effects[group], place)


@dataclass(frozen=True)
class GapStep:
    """One bar of the waterfall chart: what remains of the whole gap once `label` is added, on held-out data."""

    label: str
    remaining: Interval


@dataclass(frozen=True)
class NextRecording:
    """A recording that would separate the two most probable causes.

    Parameters
    ----------
    point : OperatingCondition
    separates : (str, str)
    standard_deviations : float
        Distance between the two predictions at that point, in structural floors.
    now : float
        The same distance at the points recorded so far.
    text : str
    place : str
        Place of the additional sensor that alone shows this distance; empty: the existing sensors do.
    """

    point: OperatingCondition
    separates: tuple[str, str]
    standard_deviations: float
    now: float
    text: str
    place: str = ""


@dataclass(frozen=True)
class NextStep:
    """A next step that needs no simulation.

    Parameters
    ----------
    code : str
        "healthy", "encoders", "slow_loads", "run_up", "other_speed", "less_gain" or "label".
    text : str
    """

    code: str
    text: str


@dataclass(frozen=True)
class ConditionFacts:
    """One recording that was diagnosed.

    Parameters
    ----------
    name : str
    point : OperatingCondition
        Nominal torque and measured speed.
    n_revolutions : float
        Revolutions of the driver.
    duration_s, sampling_rate_hz : float
    reference : str
        Name of the healthy reference it is compared with; empty: none.
    """

    name: str
    point: OperatingCondition
    n_revolutions: float
    duration_s: float
    sampling_rate_hz: float
    reference: str = ""


@dataclass(frozen=True)
class LabelledFacts:
    """How labelled recordings of the rig, or of your own simulation of it, changed the result.

    Parameters
    ----------
    counts : mapping
        Label → number of recordings used.
    without : mapping
        Cause → probability without them, largest first.
    outcome_without : GapOutcome
        Outcome without them.
    """

    counts: Mapping[str, int]
    without: Mapping[str, float]
    outcome_without: GapOutcome

    @property
    def text(self) -> str:
        """Their number by label and the result without them, in a sentence or two."""
        n, first = sum(self.counts.values()), next(iter(self.without), NONE)
        kinds = ", ".join(f"{label.replace('_', ' ')} {count}" for label, count in self.counts.items())
        return (
            f"Labelled recordings of this rig, used in addition to what is known of other machines: {n} ({kinds}). "
            f"Without {'them' if n > 1 else 'it'} the likeliest would be {first.replace('_', ' ')}, "
            f"{odds_text(self.without.get(first, 0.0))} (outcome: {self.outcome_without.value})."
        )


@dataclass(frozen=True)
class PathFacts:
    """The path from the mesh to the sensors, as measured by a run-up of the healthy machine.

    Parameters
    ----------
    run_up : str
        Name of the recording.
    low_hz, high_hz : float
        Frequency range covered by mesh harmonics.
    credibility : mapping
        Channel → fraction of the measured response that harmonics of different number reproduce at the same
        frequencies, 0 to 1.
    """

    run_up: str
    low_hz: float
    high_hz: float
    credibility: Mapping[str, float]

    @property
    def text(self) -> str:
        """What was measured, and how far it is trusted, in a sentence or two."""
        believed = ", ".join(f"{channel} {value:.2f}" for channel, value in self.credibility.items())
        return (
            f"The path from the mesh to the sensors was measured by {self.run_up} from {self.low_hz:.0f} to "
            f"{self.high_hz:.0f} Hz; the waveforms of simulated tooth faults pass it before they are compared. It "
            f"counts as far as different mesh harmonics repeat it at the same frequencies: {believed} (1: fully)."
        )


def too_small_to_judge_text(shrinkage: Shrinkage) -> str:
    """Return the statement that the simulated effect is too small to judge."""
    return f"hardly shows in the simulation at these conditions (at most {shrinkage.predicted or 0.0:.2g} floors)"


def evidence_direction_text(evidence: Evidence) -> str:
    """Return "speaks for it", "further than predicted" or "speaks against it"."""
    if evidence.speaks_for:
        return "speaks for it"
    return "further than predicted" if evidence.is_further else "speaks against it"


def fitted_text(cause: GapCause, severity: float, recording: str) -> str:
    """Return the note on a fitted effect in a twin's file: severity, interval, recording and probability."""
    within = f"interval of the fit {cause.severity.words()}; " if cause.severity else ""
    size = f"{severity:.3g} {cause.unit}".rstrip()
    return f"{cause.title}: {size}, {within}fitted to {recording}, probability {cause.probability:.2f}"


# --------------------
# The report, and what it says in four sentences.
# --------------------


@dataclass(frozen=True)
class GapReport(Result, rows="causes"):
    """The result of a gap diagnosis.

    Parameters
    ----------
    rig, simulator : str
        Names; `simulator` is empty where none can model the rig.
    conditions : tuple of ConditionFacts
    references : tuple of str
        Names of the healthy recordings compared with; empty: the simulation itself is the baseline.
    outcome : GapOutcome
    size : Interval
        The whole gap in structural floors (1 is the level that healthy machines exceed once in twenty); nan where
        nothing was simulated.
    repeatability : float
        The same in repeatability floors.
    places : tuple of GapPlace
        In the order of `ranked_places`.
    causes : tuple of GapCause
        The cause that matches the outcome first, then the others by probability; the probabilities add up to 1.
    groups : mapping
        Group → probability; default: computed from the causes.
    inseparable : tuple of str or None
        Causes that these recordings cannot separate, most probable first; default: `inseparable_effects`, where the
        outcome is "cannot separate".
    steps : tuple of GapStep
        What remains before any effect is added, and with each effect.
    next_recordings : tuple of NextRecording
        Best first.
    spectra : tuple of SpectrumCurves
    angles : tuple of AngleCurves
    averages : tuple of AverageCurves
        Empty where there is no reference.
    notes : tuple of str
        Remarks on the result.
    warnings : tuple of str
        Strongly supported doubts that must be checked first: a wrong rig file, or recording and reference exchanged.
        The rest of the report assumes that all is in order.
    twin_toml : str
        The simulator with the fitted effect, as a preset; empty where no effect is named.
    labelled : LabelledFacts or None
        How labelled recordings of the rig changed the result; None: none were given.
    next_steps : tuple of NextStep
        Other steps that would help, best first.
    path : PathFacts or None
        What a healthy run-up measured of the path to the sensors; None: none was given.
    """

    rig: str
    simulator: str
    conditions: tuple[ConditionFacts, ...]
    references: tuple[str, ...]
    outcome: GapOutcome
    causes: tuple[GapCause, ...]
    size: Interval = NOT_KNOWN
    repeatability: float = nan
    places: tuple[GapPlace, ...] = ()
    groups: Mapping[str, float] = field(default_factory=dict)
    inseparable: tuple[str, ...] | None = None
    steps: tuple[GapStep, ...] = ()
    next_recordings: tuple[NextRecording, ...] = ()
    spectra: tuple[SpectrumCurves, ...] = ()
    angles: tuple[AngleCurves, ...] = ()
    averages: tuple[AverageCurves, ...] = ()
    notes: tuple[str, ...] = ()
    twin_toml: str = field(default="", repr=False)
    warnings: tuple[str, ...] = ()
    labelled: LabelledFacts | None = None
    next_steps: tuple[NextStep, ...] = ()
    path: PathFacts | None = None

    def __post_init__(self) -> None:
        if not self.groups:
            known = {cause.name: cause for cause in self.causes}
            groups = group_probabilities({name: cause.probability for name, cause in known.items()}, known)
            object.__setattr__(self, "groups", groups)
        if self.inseparable is None and self.outcome is GapOutcome.CANNOT_SEPARATE:
            object.__setattr__(self, "inseparable", inseparable_effects(self.causes))

    @property
    def kind(self) -> GapKind | None:
        """The kind of fault that is named; None where no effect is named, or no kind is more probable than all else."""
        return kind_of(self.causes, self.groups) if self.outcome in NAMING else None

    def _repr_html_(self) -> str:
        """Return the four lines of the verdict and the most probable causes, for notebooks."""
        probable = [cause for cause in self.causes if cause.probability >= 0.01][:5]
        rows = [(cause.title, odds_text(cause.probability), cause.place) for cause in probable]
        return verdict_html(self.verdict, ("cause", "probability", "place"), rows)

    @property
    def is_simulated(self) -> bool:
        """Whether a simulator can model the rig; without one there are no sizes in floors, no steps and no twin."""
        return bool(self.simulator)

    @property
    def is_beyond(self) -> bool:
        """Whether an effect is named, or the whole gap exceeds what healthy machines show.

        Single places and lines may still exceed their own floors by chance. Always true where nothing was simulated,
        because then there is no size of the whole gap.
        """
        return self.outcome in NAMING or not self.size.value <= 1.0

    @property
    def verdict(self) -> tuple[str, str, str, str]:
        """Where, which, how far, and what to record next: one line each."""
        if self.is_simulated:
            return _where(self), _which(self), _shrinkage_text(self), _next(self)
        return _where_seen(self), _which_seen(self), NO_SIMULATION, _next_seen(self)


NO_SIMULATION = "How far: not known; the simulators need a gear pair and this rig has none, so nothing was simulated."


def _where(report: GapReport) -> str:
    if report.outcome in (GapOutcome.NO_GAP, GapOutcome.UNDECIDED) and (report.size.value <= 1.0 or not report.places):
        return f"Where: nowhere beyond the floor; the gap is {report.size.value:.2g} structural floors."
    if not report.places:
        return f"Where: spread over all orders and bands, {report.size.value:.2g} structural floors."
    first, *further_places = report.places
    second_place = ""
    if not isfinite(first.structural) and further_places and isfinite(further_places[0].share):
        second_place = f"; beside it, {_with_size(further_places[0])}"
    return f"Where: {_with_size(first)}{second_place}."


def _with_size(place: GapPlace) -> str:
    """Return a place's title with its size and share, where it has them."""
    size = f", {place.structural:.2g} structural floors" if isfinite(place.structural) else ""
    return f"{place.title}{size}{f' ({percent(place.share)} of the gap)' if isfinite(place.share) else ''}"


def _which(report: GapReport) -> str:
    first = report.causes[0]
    odds = odds_text(first.probability)
    if report.outcome is GapOutcome.NO_GAP:
        return f"Which: none ({odds}); the difference is no larger than between healthy machines and the simulator."
    if report.outcome is GapOutcome.UNDECIDED:
        return _which_undecided(report)
    if report.outcome is GapOutcome.UNKNOWN:
        return _which_unknown(report)
    if report.outcome is GapOutcome.CANNOT_SEPARATE and report.inseparable is not None:
        return f"Which: {_kind_and_inseparable(report, report.inseparable)}; these recordings cannot tell them apart."
    size = f", {_severity(first, first.severity)}" if first.severity and not first.severity.is_unbounded else ""
    if report.kind is not None and report.kind.probability - first.probability >= MIN_SURER:
        return f"Which: {_kind(report.kind)}: {first.title}{size} (probability {odds})."
    place = f" at {first.place}" if first.place else ""
    return f"Which: {first.title}{place}{size} (probability {odds})."


MIN_SURER = 0.01
"""By how much the kind of fault must be more probable than the effect for the kind to be stated first."""


def _kind(kind: GapKind) -> str:
    """Return "a damaged tooth, tooth 21 of the gear on the input shaft (97 %)"."""
    place = f", {kind.place}" if kind.place else ""
    return f"{kind.title}{place} ({odds_text(kind.probability)})"


def _kind_and_inseparable(report: GapReport, rivals: Sequence[str]) -> str:
    """Return the kind of fault with its most probable effects, then the other rivals; without a kind, all rivals."""
    if report.kind is None:
        return _or_text(report, rivals)
    groups = {cause.name: cause.group for cause in report.causes}
    within = [name for name in rivals if groups.get(name) == report.kind.group]
    beyond = [name for name in rivals if name not in within]
    if not within:
        return _or_text(report, rivals)
    return (
        f"{_kind(report.kind)}: {_or_text(report, within)}{f'; otherwise {_or_text(report, beyond)}' if beyond else ''}"
    )


def _or_text(report: GapReport, names: Sequence[str]) -> str:
    titles = {cause.name: f"{cause.title} ({odds_text(cause.probability)})" for cause in report.causes}
    return enumerated([titles.get(name, name.replace("_", " ")) for name in names], "or")


def _which_unknown(report: GapReport) -> str:
    effects = [cause for cause in report.causes if cause.is_effect]
    best = max(effects, key=lambda cause: cause.probability, default=None)
    unknown = next((cause.probability for cause in report.causes if cause.name == UNKNOWN), 1.0)
    if best is None or best.probability <= unknown:
        return "Which: unknown; nothing in the catalogue explains it well enough."
    return f"Which: unknown; {best.title} comes nearest ({odds_text(best.probability)}), not enough to be named."


def named_cause(name: str, probability: float, effects: Mapping[str, GapEffect], place: str = "") -> GapCause:
    """Return a cause by its name: one of the effects, "none", "unknown" or a user's label."""
    if name in effects:
        e = effects[name]
        return GapCause(name, e.group, e.title, e.unit, probability, place=place, is_nuisance=e.is_nuisance)
    if name not in (NONE, UNKNOWN):
        return GapCause(name, USER_LABELS, f"“{name.replace('_', ' ')}”", "", probability)
    title = "nothing beyond the differences between healthy machines" if name == NONE else "nothing in the catalogue"
    return GapCause(name, name, title, "", probability)


def in_order(causes: Sequence[GapCause], outcome: GapOutcome) -> tuple[GapCause, ...]:
    """Put the cause that matches the outcome first; the rest by probability."""
    ranked = sorted(causes, key=lambda cause: -cause.probability)
    if outcome is GapOutcome.UNDECIDED:
        return tuple(ranked)
    name = {GapOutcome.NO_GAP: NONE, GapOutcome.UNKNOWN: UNKNOWN}.get(outcome)
    first = next(c for c in ranked if (c.name == name if name else c.is_effect))
    return (first, *(c for c in ranked if c is not first))


def most_probable_two(causes: Sequence[GapCause]) -> tuple[str, str] | None:
    """Return the names of the first two effects, None where there are fewer than two."""
    names = [c.name for c in causes if c.is_effect]
    return (names[0], names[1]) if len(names) > 1 else None


SETTLED = 0.01
"""If the second effect is less probable than this, no further recording is needed to separate it from the first."""


def names_single_effect(causes: Sequence[GapCause]) -> bool:
    """Whether only one of all effects is likely."""
    probabilities = sorted((c.probability for c in causes if c.is_effect), reverse=True)
    return len(probabilities) > 1 and probabilities[1] < SETTLED <= probabilities[0]


def named_effects(causes: Sequence[GapCause], outcome: GapOutcome) -> tuple[str, ...]:
    """Return the effects that a diagnosis names: the first, or those that cannot be separated."""
    if outcome is GapOutcome.CANNOT_SEPARATE:
        return inseparable_effects(causes)
    return (causes[0].name,) if outcome in NAMING else ()


def unbounded_fits(causes: Sequence[GapCause], outcome: GapOutcome) -> list[str]:
    """Return a message for each named effect whose size the fit does not bound."""
    named = named_effects(causes, outcome)
    return [
        f"{cause.title[0].upper()}{cause.title[1:]}: the fit to the twin bounds its severity neither above nor below. "
        "The evidence for it is how the recordings changed, hardly the simulation."
        for cause in causes
        if cause.name in named and cause.severity is not None and cause.severity.is_unbounded
    ]


def _which_undecided(report: GapReport) -> str:
    """Name the two most probable causes, and the group that is more probable than not."""
    named = {NONE: "no gap", UNKNOWN: "a gap of unknown cause"}
    most_probable = sorted(report.causes, key=lambda cause: -cause.probability)[:2]
    parts = [f"{named.get(cause.name, cause.title)} {odds_text(cause.probability)}" for cause in most_probable]
    if report.places and most_probable[0].name == NONE and most_probable[0].probability >= LIKELIER_THAN_NOT:  # a race
        return f"Which: undecided; {parts[0]} by the features compared, but there are {report.places[0].title}."
    kind = kind_of(report.causes, report.groups)
    if kind is not None:
        parts.append(f"effects of the group “{kind.group}” together {odds_text(kind.probability)}")
    return f"Which: undecided; nothing is likely enough to be named: {', '.join(parts)}."


def _severity(cause: GapCause, severity: Interval) -> str:
    """Format a severity with three digits, without an exponent, and its unit."""
    return f"{float(f'{severity.value:.3g}'):.12g} {severity_unit(cause.unit)}".rstrip()


def _shrinkage_text(report: GapReport) -> str:
    shrinkage = report.causes[0].shrinkage
    if report.outcome not in NAMING or shrinkage is None:
        return "How far: no effect was added."
    if not shrinkage.is_predicted:
        return f"How far: not known; {report.causes[0].title} {too_small_to_judge_text(shrinkage)}."
    s, sizes = shrinkage.shrink, f"from {shrinkage.before.value:.2g} to {shrinkage.after.value:.2g} structural floors"
    low, high = (f"{100 * end:.0f}" for end in (s.low, s.high))
    closed = percent(s.value) + (f" ({low} to {high} %)" if low != high else "")
    shrinks = f"shrinks {sizes}, by {closed} of its energy above one,"
    if s.value <= 0.0:
        shrinks = "does not shrink"
    elif shrinkage.after.high < 1.0:
        shrinks = f"shrinks {sizes}, within what healthy machines show,"
    far = f"How far: with the effect added, the gap on the features that it changes {shrinks} on {shrinkage.held_out}."
    for one, both in zip(report.steps[1:], report.steps[2:], strict=False):  # with two effects, where one leaves much
        left = f"from {one.remaining.value:.2g} to {both.remaining.value:.2g} structural floors"
        far += (
            f" It cannot explain all lines; adding {both.label} takes the whole gap {left}, so that may be present too."
        )
    return far


SLOW_RPM = 300.0
"""Speed up to which crack, chip and spall become distinguishable: of 121 at 120 to 240 rpm 62 in 100 were identified
correctly, of 227 at 600 to 3000 rpm 55."""

WIDE = 2.0
"""Ratio of speeds from which a resonance can be distinguished from an order."""

HEALTHY_MACHINE = "the same machine when it was healthy"
NEXT_STEPS = {
    "healthy": f"{HEALTHY_MACHINE}, at the same speed and load, so that only changes since then count",
    "encoders": "encoders on both shafts: no path distorts their transmission error, whose profile over one engagement "
    "distinguishes a damaged tooth from a displaced one",
    "slow_loads": f"two loads below {SLOW_RPM:.0f} rpm, at which the gears ring less over one engagement",
    "run_up": "a run-up of the healthy machine (--run-up), which measures the path from a tooth fault to the sensors",
    "other_speed": "the same machine at twice or half the speed: a resonance stays at its frequency, what belongs to a "
    "shaft at its order",
    "less_gain": "the same with less gain, or a wider range: clipped peaks and strong low orders both look like a sine",
    "label": "two labelled recordings of each likely cause on this rig (--learn): nothing else helps as much",
}


def _next(report: GapReport) -> str:
    best = report.next_recordings[0].text if report.next_recordings else ""
    steps = [step.text for step in report.next_steps] or ([] if report.references else [NEXT_STEPS["healthy"]])
    if steps:
        return f"Next: {steps[0]}. Or {best}" if best else f"Next: {steps[0]}."
    if best:
        return f"Next: {best}"
    if report.outcome in (GapOutcome.UNKNOWN, GapOutcome.UNDECIDED):
        purpose = {"speed": ", which distinguishes orders from resonances"}
        ways = "".join(f", or another {what}{purpose.get(what, '')}" for what in _unvaried_quantities(report)[:1])
        return f"Next: another sensor nearer to where it is loudest{ways}."
    if report.outcome is GapOutcome.NO_GAP:
        return "Next: nothing is needed; keep these recordings as references for later ones."
    if not names_single_effect(report.causes) and sum(cause.shrinkage is not None for cause in report.causes) < 2:
        ways = " or ".join(_unvaried_quantities(report)) or "sensor"
        return f"Next: another {ways}; no two effects are likely enough to compute which would help most."
    where_to_look = _common_place(report)
    look = f"look at {where_to_look}; " if where_to_look else ""
    why = "speed or load that was simulated would put the two likeliest effects further apart"
    if names_single_effect(report.causes):
        why = "effect is likely enough to be separated from this one by a further recording"
    return f"Next: {look}no other {why}."


def _unvaried_quantities(report: GapReport) -> list[str]:
    """Return which of speed and load are the same in all recordings."""
    points = [condition.point for condition in report.conditions]
    same = {"speed": same_speed, "load": same_load}
    return [what for what, is_same in same.items() if all(is_same(points[0], point) for point in points)]


def _common_place(report: GapReport) -> str:
    """Return the tooth that both most probable effects share, which can be inspected; empty where they share none."""
    first, second = [cause.place for cause in report.causes if cause.is_effect][:2]
    return first if first == second and first.startswith("tooth") else ""


def _where_seen(report: GapReport) -> str:
    if report.places:
        return f"Where: {report.places[0].title}."
    beyond = " beyond the healthy reference" if report.references else ""
    return f"Where: nothing stands out{beyond} that is not synchronous with a shaft."


def _which_seen(report: GapReport) -> str:
    first = report.causes[0]
    odds = f"at most {percent(first.probability)}"
    if report.outcome is GapOutcome.UNKNOWN:
        return f"Which: unknown; {first.title}."
    place = f" at {first.place}" if first.place else ""
    name = "none; " if report.outcome is GapOutcome.NO_GAP else ""
    return f"Which: {name}{first.title}{place} ({odds})."


def _next_seen(report: GapReport) -> str:
    if report.references:
        return "Next: another sensor nearer to the bearings, or a longer recording."
    return f"Next: {HEALTHY_MACHINE}, at the same speed, so that only changes since then are named."
