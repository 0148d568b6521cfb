"""Results of an analysis: findings with location, strength, floor and confidence, or why it cannot tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from math import e, exp, log

from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray, count, positive, within
from gearsig.formatting import power_of_ten, signed
from gearsig.indicators import Indicator
from gearsig.motion import StartStop
from gearsig.orders import OrderMap, SynchronousAverage
from gearsig.prepared import has_mark
from gearsig.recording import Recording
from gearsig.results import Result, verdict_html
from gearsig.rig import Rig
from gearsig.severity import CrackEstimate, NoCrackSeen
from gearsig.spectra import BandCandidate, Kurtogram, Spectrum


class Kind(Enum):
    """How much a finding matters; listed most important first."""

    FAULT = "fault"
    SUSPICION = "suspicion"
    DATA_PROBLEM = "data problem"
    CANNOT_TELL = "cannot tell"
    NOTICE = "notice"
    INFORMATION = "information"


class Outcome(Enum):
    """What an analysis comes to; listed most severe first."""

    FAULT = "fault"
    SUSPICION = "suspicion"
    CANNOT_TELL = "cannot tell"
    NO_FAULT = "no fault"


EXAMINED = ("no-tooth-local-damage", "no-crack-seen", "no-bearing-damage")
"""Codes of the findings that say that an examination found no fault where one would have shown."""

MIN_CHANGE_DB = 6.0
"""Twice the reference's level: two recordings of one machine in one state differ by less (R. B. Randall,
*Vibration-based Condition Monitoring*, 2nd ed., 2021, ch. 5: 6 to 8 dB are significant, 20 dB serious)."""

CHANGED, UNCHANGED = "changed-since-reference", "unchanged-since-reference"
"""Codes of the findings that say whether levels have changed since the reference."""

LEVELS_MATCH = "Levels match the reference"
"""Start of the title of an unchanged-since-reference finding."""

REFERENCE_UNFIT, REFERENCE_NOT_HEALTHY = "reference-unfit", "reference-not-healthy"
"""Codes of the findings that say why a given reference is not used, and that a reference itself shows a fault."""

VIBRATION_ZONE = "vibration-zone"
"""Code of the finding that gives a machine's vibration zone of ISO 20816-3; in zones C and D it is a notice."""

HINDERING = (
    *("channel-clipped", "channel-stuck", "channel-dead", "channel-wrapped", "channel-stepped", "channel-reversed"),
    *("channel-hum", "channel-faded", "speed-near-zero"),
)
"""Codes of data problems that may hide a fault."""


@dataclass(frozen=True)
class Where:
    """The location of a finding; fields that do not apply are None or empty."""

    channels: tuple[str, ...] = ()
    shaft: str = ""
    gear: str = ""
    bearing: str = ""
    order: float | None = None
    order_shaft: str = ""
    frequency_hz: float | None = None
    band_hz: tuple[float, float] | None = None
    angle_deg: float | None = None
    tooth: int | None = None
    time_s: tuple[float, float] | None = None


@dataclass(frozen=True)
class Strength:
    """The size of a finding against the floor it has to exceed.

    `ratio_db` is 20 lg(value/floor) for amplitudes; None where a ratio has no meaning. `against` words the comparison,
    since a drawing's value, for example, is not a floor.
    """

    value: float
    unit: str
    floor: float
    floor_is: str
    ratio_db: float | None = None
    against: str = "a floor of"


@dataclass(frozen=True)
class Finding(Result):
    """One statement about the machine or the recording.

    Parameters
    ----------
    code : str
        Stable identifier, e.g. "tooth-local-impact".
    kind : Kind
    title : str
        The statement in one sentence.
    where : Where
    strength : Strength or None
    confidence : float
        Confidence that the statement is true, 0 to 1.
    confidence_basis : str
        What the confidence rests on.
    evidence : tuple of str
        The numbers for and against the statement, one sentence each.
    surer : str
        What would make the statement more certain.
    """

    code: str
    kind: Kind
    title: str
    where: Where = field(default_factory=Where)
    strength: Strength | None = None
    confidence: float = 1.0
    confidence_basis: str = ""
    evidence: tuple[str, ...] = ()
    surer: str = ""

    @property
    def is_claim(self) -> bool:
        """Whether it claims damage to the machine, i.e. is a fault or a suspicion."""
        return self.kind in (Kind.FAULT, Kind.SUSPICION)


def cannot_tell(
    code: str, title: str, where: Where | None = None, *, evidence: tuple[str, ...] = (), surer: str = ""
) -> Finding:
    """Return the finding that a question cannot be answered, or that something could not be examined."""
    return Finding(code, Kind.CANNOT_TELL, title, where or Where(), evidence=evidence, surer=surer)


@dataclass(frozen=True)
class CannotTell:
    """A question that these data cannot answer, and what would answer it."""

    question: str
    reason: str
    remedy: str = ""


@dataclass(frozen=True)
class OrderLevel:
    """The level of one order over speed, extracted from a run-up or run-down by a Vold–Kalman filter.

    Parameters
    ----------
    name : str
        "mesh of stage 1" with its harmonic, or "order 2".
    order : float
        Of the reference shaft.
    speed_rpm : array, (n,)
        Speed of the reference shaft, ascending; centres of equal steps.
    amplitude : array, (n,)
        Peak amplitude, root mean square over the times at that speed.
    unit : str
    bandwidth_orders : float
        Of the filter.
    pair, harmonic
        Gear pair and harmonic of a mesh order; empty and 0 for other orders.
    """

    name: str
    order: float
    speed_rpm: FloatArray
    amplitude: FloatArray
    unit: str
    bandwidth_orders: float
    pair: str = ""
    harmonic: int = 0

    @property
    def frequency_hz(self) -> FloatArray:
        """Frequency of the order at each speed, in Hz."""
        frequency: FloatArray = self.speed_rpm / 60.0 * self.order
        return frequency

    @property
    def largest(self) -> tuple[float, float, float]:
        """Largest amplitude, its speed in rpm and its frequency in Hz."""
        i = int(self.amplitude.argmax())
        return float(self.amplitude[i]), float(self.speed_rpm[i]), float(self.frequency_hz[i])


@dataclass(frozen=True)
class ChannelAnalysis(Result):
    """The signals and spectra of one vibration channel.

    `order_spectrum`, `order_map` and `averages` are None or empty where the speed is not known.

    Parameters
    ----------
    channel : str
    spectrum : Spectrum
        Amplitude peak over frequency.
    power_density : Spectrum
        Welch power spectral density.
    envelope_spectrum : Spectrum or None
        Of the band `envelope_band_hz`; over order where the speed is known, else over frequency.
    order_spectrum : Spectrum or None
    order_map : OrderMap or None
        Only where the speed varies.
    averages : mapping
        (shaft, kind) → SynchronousAverage.
    kurtogram : Kurtogram or None
        Of the channel without its tones, where its band confirms impacts of a bearing.
    kurtogram_band : BandCandidate or None
        The band selected from the kurtogram.
    order_levels : tuple of OrderLevel
        Only where the speed sweeps a range.
    """

    channel: str
    spectrum: Spectrum
    power_density: Spectrum
    envelope_spectrum: Spectrum | None = None
    envelope_band_hz: tuple[float, float] | None = None
    order_spectrum: Spectrum | None = None
    order_map: OrderMap | None = None
    averages: Mapping[tuple[str, str], SynchronousAverage] = field(default_factory=dict)
    kurtogram: Kurtogram | None = None
    kurtogram_band: BandCandidate | None = None
    order_levels: tuple[OrderLevel, ...] = ()


@dataclass(frozen=True)
class LevelChange:
    """One level in this recording and in the reference.

    Parameters
    ----------
    label : str
        E.g. "1× rotor", "2× mesh stage 1", "outer race of front", "noise 300 to 700 Hz".
    kind : str
        "overall", "shaft", "subharmonic", "mains", "mesh", "sidebands", "bearing" or "noise".
    where : Where
    harmonic : float
        Of the shaft or of the mesh; 0 for the rest.
    unit : str
    level_db, reference_db : float
        Mean over segments of each record, in dB re one unit (rms).
    repeatability_db : float
        Difference between the halves of the less steady record.
    p_value : float
        Probability of a change this large between two records of the same state, given the scatter of their segments,
        corrected for the number of levels compared.
    is_change : bool
        Whether it changed by 6 dB or more, with a p-value as small as the settings require, and stands out from its
        neighbours in the louder record.
    stands_out : bool
        Whether it stands out from its neighbours in the louder record.
    """

    label: str
    kind: str
    where: Where
    harmonic: float
    unit: str
    level_db: float
    reference_db: float
    repeatability_db: float
    p_value: float
    is_change: bool
    stands_out: bool

    @property
    def change_db(self) -> float:
        """Level now minus the reference's level, in dB."""
        return self.level_db - self.reference_db

    @property
    def text(self) -> str:
        """What has changed by how much, as a sentence of evidence."""
        return f"{self.label} in {self.where.channels[0]}: {signed(self.change_db)} dB."


@dataclass(frozen=True)
class Analysis(Result, rows="findings"):
    """Everything that `analyze` found in one recording.

    Parameters
    ----------
    recording : Recording
    rig : Rig or None
    shaft_angle : ShaftAngle or CannotTell
        Of the reference shaft.
    channels : tuple of ChannelAnalysis
        Dead and non-vibration channels are left out; a finding says so.
    indicators : tuple of Indicator
    findings : tuple of Finding
        Most important first.
    verdict : str
        One sentence.
    settings : mapping
        The parameters used, for the report.
    crack : CrackEstimate, NoCrackSeen, CannotTell or None
        Depth of a root crack; None if nobody asked for it and no crack is clear.
    reference : Analysis or None
        Analysis of the recording of the healthy machine given for comparison.
    motion : StartStop or None
        For a machine that starts and stops, if its teeth could be examined.
    level_changes : tuple of LevelChange
        Changes since the reference; empty without one, or where speeds are unknown.
    """

    recording: Recording
    rig: Rig | None
    shaft_angle: ShaftAngle | CannotTell
    channels: tuple[ChannelAnalysis, ...]
    indicators: tuple[Indicator, ...]
    findings: tuple[Finding, ...]
    verdict: str
    settings: Mapping[str, str | float | int | None] = field(default_factory=dict)
    crack: CrackEstimate | NoCrackSeen | CannotTell | None = None
    reference: Analysis | None = None
    motion: StartStop | None = None
    level_changes: tuple[LevelChange, ...] = ()

    @property
    def outcome(self) -> Outcome:
        """The overall outcome of the findings."""
        return outcome_of(self.findings)

    @property
    def top_claim(self) -> Finding | None:
        """The finding that the verdict is about: the first fault, else the first suspicion, else None."""
        claims = (finding for finding in self.findings if finding.is_claim)
        return min(claims, key=lambda finding: finding.kind is not Kind.FAULT, default=None)

    def teeth_on(self, shaft: str) -> int | None:
        """Return the number of teeth of the gear on a shaft; of several gears, the one that a finding names."""
        gears = self.rig.gear_teeth(shaft) if self.rig is not None else {}
        pairs = (f.where.gear.rpartition("/")[0] for f in self.findings if f.where.gear.endswith(f"/{shaft}"))
        return gears.get(next((pair for pair in pairs if pair in gears), next(iter(gears), "")))

    def has_mark(self, shaft: str) -> bool:
        """Whether angle 0 of a shaft is a mark on that shaft; without one its teeth cannot be numbered."""
        return has_mark(self.recording, self.rig or Rig(), shaft)

    def _repr_html_(self) -> str:
        """Return verdict and findings for notebooks; texts may come from files."""
        rows = [(f.kind.value, f.title, f"{f.confidence:.2g}") for f in self.findings]
        return verdict_html([self.verdict], ("", "finding", "confidence"), rows)


def outcome_of(findings: Sequence[Finding]) -> Outcome:
    """Return the outcome of findings: "no fault" only where everything that the rig describes could be examined.

    A machine in zone C or D of ISO 20816-3 is suspicious whether or not a cause is found.
    """
    kinds = {finding.kind for finding in findings}
    if Kind.FAULT in kinds:
        return Outcome.FAULT
    if Kind.SUSPICION in kinds or any(f.code == VIBRATION_ZONE and f.kind is Kind.NOTICE for f in findings):
        return Outcome.SUSPICION
    examined = any(f.code in EXAMINED for f in findings)
    hindered = Kind.CANNOT_TELL in kinds or any(f.code in HINDERING for f in findings)
    return Outcome.NO_FAULT if examined and not hindered else Outcome.CANNOT_TELL


@dataclass(frozen=True)
class AnalysisSettings:
    """Settings of `analyze`.

    Parameters
    ----------
    false_alarm_probability : float
        Of one test as a whole, over everything it tries (all teeth, all fundamentals, all bands and channels).
    n_surrogates : int
        For the test of tooth-local energy.
    minimum_revolutions : int
        Fewer revolutions are not averaged: 16 lower the noise by 12 dB and give the jackknife its scatter.
    bearing_slip : float
        Relative: bearings turn 1 to 2 % off their kinematic orders.
    highest_modulation_order : float
        Of the envelope spectra, in cycles per revolution of the fastest shaft: six harmonics of an inner race with
        ten rolling elements.
    seed : int
        Of the surrogates: the same recording gives the same answer.
    """

    false_alarm_probability: float = 1e-3
    n_surrogates: int = 1000
    minimum_revolutions: int = 16
    bearing_slip: float = 0.02
    highest_modulation_order: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        within(self.false_alarm_probability, "false_alarm_probability", 1e-12, 0.1)
        count(self.n_surrogates, "n_surrogates", minimum=99)
        count(self.minimum_revolutions, "minimum_revolutions", minimum=2)
        within(self.bearing_slip, "bearing_slip", 0.0, 0.1)
        positive(self.highest_modulation_order, "highest_modulation_order")


WITHOUT_REFERENCE = 0.95
"""Upper limit of confidence in a fault claimed from one recording: it may be as old as the machine."""

WITH_ASSUMED_DATA = 0.5
"""Confidence factor for a statement that rests on assumed machine data."""


def from_p_value(p_value: float, *, prior: float = 0.1, limit: float = WITHOUT_REFERENCE) -> float:
    """Return an upper bound of the probability that the effect is real, given the p-value of its absence.

    The Bayes factor for "absent" is at least -e p ln p (p < 1/e), so that
    P(real) <= 1/(1 + (1 - prior)/prior · (-e p ln p)).

    Parameters
    ----------
    p_value : float
        0 to 1, corrected for everything that was tried.
    prior : float
        Probability of the effect before looking.
    limit : float
        The result is capped here, for causes that no p-value covers.

    References
    ----------
    T. Sellke, M. J. Bayarri, J. O. Berger, "Calibration of p values for testing precise null hypotheses", 2001.

    Examples
    --------
    >>> round(from_p_value(0.01), 2)
    0.47
    """
    p = min(max(p_value, 1e-300), 1.0)
    bayes_factor = -e * p * log(p) if p < exp(-1) else 1.0
    return min(limit, 1.0 / (1.0 + (1.0 - prior) / prior * bayes_factor))


def p_text(p_value: float) -> str:
    """Write a p-value with one digit, none below 1e-6: no noise model is known that well in its tails.

    Examples
    --------
    >>> p_text(3.2e-4), p_text(0.0098), p_text(5e-141)
    ('3 × 10⁻⁴', '0.01', '< 10⁻⁶')
    """
    if p_value < 1e-6:
        return "< 10⁻⁶"
    return power_of_ten(p_value) if p_value < 0.0095 else f"{p_value:.1g}"
