"""What a gap diagnosis answers: where the gap lies, which effect causes it, how far it shrinks; or why not."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import exp, inf, isinf, nan

import numpy as np

from gearsig.checks import FloatArray
from gearsig.formatting import odds_text
from gearsig.gap._simulator import Added, OperatingCondition
from gearsig.results import Result

# --------------------
# The curves that a gap report draws: order spectra, energy over the angle, synchronous averages.
# --------------------


@dataclass(frozen=True)
class SpectrumCurves:
    """Order spectra of one shaft's average or of the residual, measured against simulated.

    Parameters
    ----------
    label, unit : str
    orders : array, (n,)
        Of the driver's shaft.
    measured, before, after : arrays, (n,)
        Peak amplitudes; `after` is with the likeliest effect, empty where there is none; `before` is empty where
        nothing was simulated.
    floor : array, (n,)
        Repeatability; where nothing was simulated, the noise beside the lines.
    structural_db : array, (n,)
        How far healthy machines lie from what is compared with, line by line; empty: not known.
    reference, reference_floor, reference_structural_db : arrays, (n,)
        Peak amplitudes of the healthy reference, the repeatability floor of both recordings, and how far healthy
        machines change from one recording to another; empty where there is no reference.
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
    """The residual synchronous average of one shaft over its angle, measured against simulated.

    Parameters
    ----------
    shaft, unit : str
    teeth : int
    has_mark : bool
        Whether angle 0 is a mark, so that teeth have numbers.
    angle_deg : array, (n,)
    measured, before, after : arrays, (n,)
        Energy within one pitch, over the median tooth's; `after` may be empty.
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
    """What tells a shaft's teeth apart in its synchronous average, of the recording and of the healthy reference.

    Parameters
    ----------
    shaft, unit, channel : str
    teeth : int
    has_mark : bool
        Whether angle 0 is a mark, so that teeth have numbers.
    angle_deg : array, (n,)
    measured, reference : arrays, (n,)
        Without the mesh harmonics, what lies close to them and the first shaft orders; the reference turned so that
        the same teeth meet, and its gain matched as far as a slightly other speed or load explains it.
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
"""Probability from which a cause, or a kind of fault, is likelier than all others together. No effect is named below
it, nor are two that have less together: then what is wrong is unknown, however sure it is that something is."""

NONE, UNKNOWN = "none", "unknown"
"""Names of the two causes that are no effect: no gap beyond the floor; a gap that nothing in the catalogue explains."""


class GapOutcome(Enum):
    """What a diagnosis comes to."""

    NO_GAP = "no gap"
    EFFECT = "effect"
    CANNOT_SEPARATE = "cannot separate"
    UNKNOWN = "unknown"
    UNDECIDED = "undecided"
    """Neither an effect nor its absence is likely enough to be said, and no unknown cause is, either."""


NAMING = (GapOutcome.EFFECT, GapOutcome.CANNOT_SEPARATE)
"""Outcomes that name an effect; nothing is added to the simulator elsewhere."""


class PlaceKind(Enum):
    """In which way a place of the gap is meant."""

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
    """One place at which the recording differs from what it is compared with.

    Parameters
    ----------
    kind : PlaceKind
    title : str
        The statement in one sentence.
    change_db : float
        Recording over simulation (or over reference), of the strongest part; where nothing was simulated and no
        reference shows it, lines over the noise beside them.
    repeatability, structural : float
        The change over both floors, 1: as large as a floor; nan where nothing was simulated.
    share : float
        Of the whole gap, 0 to 1; nan where it `follows`, or was found without a simulation.
    shaft : str
    orders : tuple of float
        Of the driver's shaft, where it is largest.
    band_hz : (float, float) or None
    angle_deg : float or None
        Of the shaft.
    tooth : int or None
        From 1 at the mark; None where there is no mark.
    channel : str
        Where it is strongest; empty: on all.
    follows : bool
        Whether it only follows from what other places say, and tells nobody where to look.
    """

    kind: PlaceKind
    title: str
    change_db: float
    repeatability: float
    structural: float
    share: float
    shaft: str = ""
    orders: tuple[float, ...] = ()
    band_hz: tuple[float, float] | None = None
    angle_deg: float | None = None
    tooth: int | None = None
    channel: str = ""
    follows: bool = False


@dataclass(frozen=True)
class Interval:
    """A value with its 90 % interval; `high` is infinite where nothing bounds it.

    Parameters
    ----------
    value : float
        In the unit of what it is of.
    low, high : float
        Of the interval; low 0 and high infinite: any size fits about as well.
    """

    value: float
    low: float
    high: float

    @classmethod
    def around(cls, value: float, half: float, low: float = -inf, high: float = inf) -> Interval:
        """Return value ± half, its ends no further than `low` and `high`."""
        return cls(value, max(value - half, low), min(value + half, high))

    @property
    def is_unbounded(self) -> bool:
        """Whether any size fits about as well."""
        return self.low == 0.0 and isinf(self.high)

    def words(self, write: Callable[[float], str]) -> str:
        """Return the interval in words, its ends as `write` writes them.

        Examples
        --------
        >>> ends = ((1.5, 3.0), (1.5, float("inf")), (0.0, float("inf")))
        >>> [Interval(2.0, *both).words("{:g}".format) for both in ends]
        ['1.5 to 3', '1.5 or more', 'unbounded']
        """
        if self.is_unbounded:
            return "unbounded"
        return f"{write(self.low)} or more" if isinf(self.high) else f"{write(self.low)} to {write(self.high)}"


NOT_KNOWN = Interval(nan, nan, nan)
MIN_PREDICTED = 0.5
"""Floors: what a simulator changes by less tells nothing, whether the gap shrinks or grows."""


@dataclass(frozen=True)
class Shrinkage:
    """How far the gap shrinks once an effect is added, on data that its severity was not fitted to.

    Parameters
    ----------
    before, after : Interval
        Root mean square of the gap on the effect's own features, in structural floors.
    shrink : Interval
        1 − after²/before², what exceeds the floors; 1: all of it is explained.
    slope : float
        Of the observed change over the predicted one; 1: sign and size are right.
    placebo : float
        The largest shrink that the same effect gets in a wrong place: another order, gear, shaft or bearing. 0 where
        there is no other.
    held_out : str
        What it was scored on: "another operating condition" or "other revolutions of the same recordings".
    n_placebos : int
        Wrong places that were tried.
    elsewhere : float or None
        The shrink at operating conditions of which nothing but the level was fitted, severity and place being those of
        the others; None with one condition.
    predicted : float or None
        The largest change that the simulator predicts of the fitted effect, in floors; None where it is not known.
    of_all : float or None
        The shrink on the features that any of the tried effects changes, by which they can be compared; None where it
        is not known.
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
        """Whether the simulator shows enough of the effect for a shrink to mean anything."""
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
        Whether sign and size are those predicted.
    is_further : bool
        Whether it moved the predicted way, and further than predicted: the effect does not explain the rest, which is
        no evidence against it. `speaks_for` is False then.
    """

    feature: str
    predicted_db: float
    observed_db: float
    floor_db: float
    speaks_for: bool
    is_further: bool = False


@dataclass(frozen=True)
class GapCause(Result):
    """A candidate with its probability; the first is the likeliest.

    Parameters
    ----------
    name : str
        Of an effect, or "none" or "unknown".
    group, title, unit : str
    probability : float
        Calibrated, over all causes; an upper limit where nothing was simulated.
    severity : Interval or None
        With which the twin comes nearest, in the effect's unit; the interval is the fit's, and the machine's own may
        lie further off.
    fitted : Added or None
        The setting that fits best.
    place : str
        "tooth 7 of the driver", "bearing 2", "order 6"; empty where it has none.
    shrinkage : Shrinkage or None
    evidence : tuple of Evidence
        Strongest first, for and against.
    is_nuisance : bool
    notes : tuple of str
        What speaks for and against it in words, where no simulation predicts anything.
    """

    name: str
    group: str
    title: str
    unit: str
    probability: float
    severity: Interval | None = None
    fitted: Added | None = None
    place: str = ""
    shrinkage: Shrinkage | None = None
    evidence: tuple[Evidence, ...] = ()
    is_nuisance: bool = False
    notes: tuple[str, ...] = ()


def group_probabilities(causes: Sequence[GapCause]) -> dict[str, float]:
    """Return group → probability of its causes together, P(g) = Σ_{c∈g} P(c), largest first.

    Parameters
    ----------
    causes : sequence of GapCause
    """
    by_group: dict[str, float] = {}
    for cause in causes:
        by_group[cause.group] = by_group.get(cause.group, 0.0) + cause.probability
    return dict(sorted(by_group.items(), key=lambda item: -item[1]))


TOGETHER, MAX_RIVALS = 0.9, 4
"""What cannot be told apart: the fewest likeliest effects that have such a share of what all effects have, and not
more of them than anybody would look at."""


def shares_of(levels: Mapping[str, float]) -> dict[str, float]:
    """Return probabilities p_c ∝ exp(level_c), likeliest first."""
    top = max(levels.values())
    weights = {name: exp(level - top) for name, level in levels.items()}
    total = sum(weights.values())
    return {name: weight / total for name, weight in sorted(weights.items(), key=lambda item: -item[1])}


def rivals(causes: Sequence[GapCause]) -> tuple[str, ...]:
    """Return the effects that cannot be told apart: the two likeliest, and more until they have `TOGETHER` of all.

    Parameters
    ----------
    causes : sequence of GapCause
        Those of no effect and of an unknown one are passed over.

    Returns
    -------
    tuple of str
        Likeliest first, `MAX_RIVALS` at most.
    """
    effects = sorted((c for c in causes if c.name not in (NONE, UNKNOWN)), key=lambda cause: -cause.probability)
    shares = np.cumsum([cause.probability for cause in effects])
    n = int(np.searchsorted(shares, TOGETHER * shares[-1])) + 1 if effects else 0
    return tuple(cause.name for cause in effects[: int(np.clip(n, 2, MAX_RIVALS))])


OWN_LABELS = "your own labels"
"""Group of causes that only the user's labelled recordings know."""

KIND_TITLES = {
    "tooth-local": "a damaged tooth",
    "flank": "the flanks of the teeth",
    "shaft": "unbalance, run-out or misalignment of a shaft",
    "drive and load": "the drive or the load",
    "bearing": "a bearing",
    "measurement chain": "the measurement chain",
    OWN_LABELS: "what you have labelled",
}
"""Group of effects → the kind of fault, in words; of another group, its name."""


@dataclass(frozen=True)
class GapKind:
    """The kind of fault, which is surer than which effect of that kind it is.

    Parameters
    ----------
    group, title : str
    probability : float
        Of its effects together.
    place : str
        As of its likeliest effect; empty where that has none.
    """

    group: str
    title: str
    probability: float
    place: str = ""


def kind_of(causes: Sequence[GapCause], groups: Mapping[str, float]) -> GapKind | None:
    """Return the likeliest kind of fault, None where that is no likelier than all else together."""
    effects = {name: p for name, p in groups.items() if name not in (NONE, UNKNOWN, "")}
    group = max(effects, key=effects.__getitem__, default="")
    if not effects.get(group, 0.0) >= LIKELIER_THAN_NOT:
        return None
    place = next((cause.place for cause in causes if cause.group == group), "")
    return GapKind(group, KIND_TITLES.get(group, group), effects[group], place)


@dataclass(frozen=True)
class GapStep:
    """One bar of the waterfall: what is left of the whole gap once `label` is added, on held-out data."""

    label: str
    remaining: Interval


@dataclass(frozen=True)
class NextRecording:
    """A recording that would separate the two likeliest causes.

    Parameters
    ----------
    point : OperatingCondition
    separates : (str, str)
    standard_deviations : float
        Distance of both predictions there, in structural floors; `now` at the points there are.
    now : float
    text : str
    place : str
        Of a further sensor, which alone shows so much; empty: the sensors that there are.
    """

    point: OperatingCondition
    separates: tuple[str, str]
    standard_deviations: float
    now: float
    text: str
    place: str = ""


@dataclass(frozen=True)
class NextStep:
    """Something to do next that no simulation was needed for.

    Parameters
    ----------
    code : str
        "healthy", "encoders", "slow_loads", "run_up" or "label".
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
        Nominal torque; measured speed.
    n_revolutions : float
        Of the driver.
    duration_s, sampling_rate_hz : float
    reference : str
        Name of the healthy reference that it is compared with; empty: none.
    """

    name: str
    point: OperatingCondition
    n_revolutions: float
    duration_s: float
    sampling_rate_hz: float
    reference: str = ""


@dataclass(frozen=True)
class LabelledFacts:
    """What labelled recordings of the rig, or of somebody's own simulation of it, changed in the answer.

    Parameters
    ----------
    counts : mapping
        Label → recordings that were used.
    without : mapping
        Cause → probability that it would have had without them, likeliest first.
    outcome_without : GapOutcome
        What the diagnosis would have come to.
    """

    counts: Mapping[str, int]
    without: Mapping[str, float]
    outcome_without: GapOutcome

    @property
    def text(self) -> str:
        """What they are, and what the answer would be without them, in a sentence or two."""
        n, first = sum(self.counts.values()), next(iter(self.without), NONE)
        kinds = ", ".join(f"{label.replace('_', ' ')} {count}" for label, count in self.counts.items())
        return (
            f"Labelled recordings of this rig that joined what is known of other machines: {n} ({kinds}). "
            f"Without {'them' if n > 1 else 'it'} the likeliest would be {first.replace('_', ' ')}, "
            f"{odds_text(self.without.get(first, 0.0))} (outcome: {self.outcome_without.value})."
        )
