"""Results of a comparison of a simulation with a recording: levels, agreement, and repeatability of each figure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray
from gearsig.orders import SynchronousAverage
from gearsig.results import Result, verdict_html
from gearsig.spectra import Spectrum

BEYOND = 2.0
"""A difference counts if it exceeds its repeatability by this factor."""

BETTER_TURNED = 0.1
"""Gain of correlation above which marks are questioned: a simulation's need not be where the rig's is."""

LineKind = Literal["mesh", "sideband", "shaft", "other"]
AlignmentMethod = Literal["marks", "correlation"]


@dataclass(frozen=True)
class RepeatableValue:
    """A figure and its repeatability.

    Parameters
    ----------
    value : float
    repeatability : float
        Standard error, estimated from the first half of each record against its second half.
    """

    value: float
    repeatability: float


@dataclass(frozen=True)
class LevelPair:
    """A level in both records, in dB re one unit (rms).

    Parameters
    ----------
    simulated_db, recorded_db : float
    repeatability_db : float
        Of the difference: the standard errors of both, from their halves, added as squares.
    """

    simulated_db: float
    recorded_db: float
    repeatability_db: float

    @property
    def difference_db(self) -> float:
        """Simulated minus recorded level; negative if the simulation is too weak."""
        return self.simulated_db - self.recorded_db

    @property
    def is_beyond(self) -> bool:
        """Whether the difference is larger than the records' scatter explains."""
        return abs(self.difference_db) > BEYOND * self.repeatability_db


@dataclass(frozen=True)
class LineLevel:
    """A line of the order spectrum in both records.

    Parameters
    ----------
    label : str
        E.g. "2× mesh stage 1".
    kind : str
        "mesh", "sideband" or "shaft"; "other": a line that belongs to no shaft and no mesh.
    order : float
        Of the reference shaft.
    shaft : str
        Shaft whose synchronous average it was read from; empty for other lines.
    level : LevelPair
        A line that is not seen has the level of the noise that would hide it.
    simulated_is_seen, recorded_is_seen : bool
        Whether it stands above that record's noise.
    """

    label: str
    kind: LineKind
    order: float
    shaft: str
    level: LevelPair
    simulated_is_seen: bool
    recorded_is_seen: bool

    @property
    def is_seen(self) -> bool:
        """Whether either record shows it."""
        return self.simulated_is_seen or self.recorded_is_seen


@dataclass(frozen=True)
class Agreement:
    """Similarity of two sets of order lines, for any gain.

    Parameters
    ----------
    complex_frac : RepeatableValue
        FRAC of the aligned complex lines, 0 to 1.
    magnitude_frac : RepeatableValue
        FRAC of their magnitudes; even unrelated spectra reach about 0.6.
    complex_by_chance : float
        Mean of the complex FRAC over all alignments: the value that a single dominant line gives without similarity.
    n_lines : int
    """

    complex_frac: RepeatableValue
    magnitude_frac: RepeatableValue
    complex_by_chance: float
    n_lines: int


@dataclass(frozen=True)
class BandLevel:
    """The level of a band in both records.

    Parameters
    ----------
    label : str
        E.g. "1.25 kHz", "around 2× mesh stage 1".
    low, high : float
        In Hz or orders of the reference shaft.
    axis : str
        "frequency" or "order".
    level : LevelPair
        Of everything in the band, including noise.
    agreement : Agreement or None
        Of the band's lines that are locked to the reference shaft; None for bands over frequency, or without lines.
    """

    label: str
    low: float
    high: float
    axis: Literal["frequency", "order"]
    level: LevelPair
    agreement: Agreement | None = None


@dataclass(frozen=True)
class Alignment:
    """How the simulation was turned so that the same angles coincide.

    Parameters
    ----------
    shaft : str
    method : str
        "marks": both count from a mark on this shaft; "correlation": the shift with the largest correlation.
    shift_deg : float
        Angle by which the simulation was turned forward, -180 to 180.
    repeatability_deg : float
        From the halves of the records; 0 for marks.
    tooth_is_certain : bool or None
        Whether the halves agree on the tooth, and differences between teeth are alike in both; None if the teeth are
        not known.
    best_shift_deg : float
        Shift in addition to `shift_deg` that would raise the correlation most.
    gain : float
        Increase of the correlation at that shift: the simulation's mark may be elsewhere than the rig's.
    """

    shaft: str
    method: AlignmentMethod
    shift_deg: float
    repeatability_deg: float
    tooth_is_certain: bool | None
    best_shift_deg: float = 0.0
    gain: float = 0.0

    @property
    def is_doubted(self) -> bool:
        """Whether the same angle may be different teeth in the two records."""
        return self.gain > BETTER_TURNED if self.method == "marks" else self.tooth_is_certain is False


@dataclass(frozen=True)
class ShaftComparison:
    """One channel's synchronous averages of one shaft, aligned.

    Parameters
    ----------
    shaft : str
    n_teeth : int or None
        Of the gear to which `tooth_levels` refer; the first one's, if there are several.
    simulated, recorded : SynchronousAverage
        At the same angles, both up to the same order, without their mean.
    correlation : RepeatableValue
        Of the two, -1 to 1.
    simulated_reliability, recorded_reliability : float
        How well each average repeats: 1 is exactly, 0 is noise. Their geometric mean is the highest correlation that
        two noisy averages of the same motion can reach.
    agreement : Agreement
        Over all lines.
    tooth_levels : tuple of LevelPair
        Of each tooth pitch, starting at shaft angle 0; empty if the teeth are not known.
    """

    shaft: str
    n_teeth: int | None
    simulated: SynchronousAverage
    recorded: SynchronousAverage
    correlation: RepeatableValue
    simulated_reliability: float
    recorded_reliability: float
    agreement: Agreement
    tooth_levels: tuple[LevelPair, ...]

    @property
    def best_correlation(self) -> float:
        """The highest correlation that two such averages of the same motion can reach."""
        return float(np.sqrt(self.simulated_reliability * self.recorded_reliability))


@dataclass(frozen=True)
class Locked:
    """Share of a record's energy that repeats with a shaft's turns, 0 to 1."""

    simulated: RepeatableValue
    recorded: RepeatableValue


@dataclass(frozen=True)
class ChannelComparison(Result, rows="lines"):
    """One channel of the simulation compared with one of the recording.

    Parameters
    ----------
    simulated_name, recorded_name : str
    quantity, unit : str
        Of both, in the recording's unit; empty if unknown.
    levels_compare : bool
        Whether both units are known, so that level differences are meaningful; shapes compare in any case.
    simulated_spectrum, recorded_spectrum : Spectrum
        Rms amplitudes over order, from blocks of equally many revolutions.
    lines : tuple of LineLevel
        Shaft orders, mesh harmonics and sidebands, in ascending order.
    other_lines : tuple of LineLevel
        The strongest ones that belong to no shaft, strongest first.
    order_bands, third_octaves : tuple of BandLevel
    shafts : tuple of ShaftComparison
    overall : LevelPair
        Of all orders that both records contain.
    locked : Locked
        To any of the shafts.
    """

    simulated_name: str
    recorded_name: str
    quantity: str
    unit: str
    levels_compare: bool
    simulated_spectrum: Spectrum
    recorded_spectrum: Spectrum
    lines: tuple[LineLevel, ...]
    other_lines: tuple[LineLevel, ...]
    order_bands: tuple[BandLevel, ...]
    third_octaves: tuple[BandLevel, ...]
    shafts: tuple[ShaftComparison, ...]
    overall: LevelPair
    locked: Locked

    @property
    def name(self) -> str:
        """Name of the channel, or of both where they differ."""
        same = self.simulated_name == self.recorded_name
        return self.recorded_name if same else f"{self.recorded_name} (simulated: {self.simulated_name})"


@dataclass(frozen=True)
class RecordFacts:
    """Source, speed and length of one side's record.

    Parameters
    ----------
    source, sha256 : str
    duration_s, sampling_rate_hz : float
    mean_speed_rpm : float
        Of the reference shaft.
    speed_range_rpm : (float, float)
    n_revolutions : float
    speed_method : str
        See `ShaftAngle.method`.
    notes : tuple of str
        From the reader and from the determination of the speed.
    """

    source: str
    sha256: str
    duration_s: float
    sampling_rate_hz: float
    mean_speed_rpm: float
    speed_range_rpm: tuple[float, float]
    n_revolutions: float
    speed_method: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Comparison(Result, rows="channels"):
    """A simulation compared with a recording.

    Parameters
    ----------
    simulated, recorded : RecordFacts
    machine : str
        Name of the rig; empty if unknown.
    reference_shaft : str
        Shaft to which orders refer.
    mesh_orders : tuple of float
        Of the reference shaft, one per pair whose teeth are known.
    highest_order : float
        Highest order that both records contain.
    alignments : tuple of Alignment
        One per shaft.
    channels : tuple of ChannelComparison
    notes : tuple of str
        What the reader should know before relying on a figure.
    verdict : str
        The largest differences beyond the records' scatter, per channel.
    findings : tuple of str
        On lines that only one side has, shapes of the averages, and energy locked to the shafts.
    """

    simulated: RecordFacts
    recorded: RecordFacts
    machine: str
    reference_shaft: str
    mesh_orders: tuple[float, ...]
    highest_order: float
    alignments: tuple[Alignment, ...]
    channels: tuple[ChannelComparison, ...]
    notes: tuple[str, ...]
    verdict: str
    findings: tuple[str, ...]

    def _repr_html_(self) -> str:
        """Return verdict and findings for notebooks."""
        return verdict_html([self.verdict], ("findings",), [(text,) for text in self.findings])


DEEPEST_DB = 160.0
"""Levels this far below a channel's strongest are rounding errors and not distinguished."""


def decibel(power: FloatArray, strongest: float) -> FloatArray:
    """Return 10 lg of mean squares, limited to `DEEPEST_DB` below the strongest."""
    smallest = max(strongest * 10.0 ** (-DEEPEST_DB / 10.0), 1e-300)
    levels: FloatArray = 10.0 * np.log10(np.maximum(power, smallest))
    return levels


def power_levels(simulated: FloatArray, recorded: FloatArray, *, smooth: int = 5) -> tuple[LevelPair, ...]:
    """Return levels of mean squares, each (2, n): of the first and of the second half.

    The level's standard error is half the difference between the halves, or its rms over `smooth` neighbours if that is
    larger, since two halves occasionally agree by chance.
    """
    levels_of_sides = []
    for power in (simulated, recorded):
        strongest = float(power.max(initial=0.0))
        a, b = decibel(power[0], strongest), decibel(power[1], strongest)
        levels_of_sides.append((decibel(power.mean(axis=0), strongest), _smoothed(np.abs(a - b) / 2.0, smooth)))
    (simulated_db, simulated_error), (recorded_db, recorded_error) = levels_of_sides
    errors = np.hypot(simulated_error, recorded_error)
    return tuple(
        LevelPair(float(s), float(r), float(e)) for s, r, e in zip(simulated_db, recorded_db, errors, strict=True)
    )


def _smoothed(errors: FloatArray, n: int) -> FloatArray:
    width = min(n, len(errors))
    width -= (width + 1) % 2  # odd: as many neighbours on either side
    if width < 2:
        return errors
    padded = np.pad(errors**2, width // 2, mode="reflect")
    result: FloatArray = np.maximum(errors, np.sqrt(np.convolve(padded, np.ones(width) / width, mode="valid")))
    return result


def amplitude_error_db(amplitude: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the standard error of a line's level: the part of its noise that is in phase with it."""
    ratio = np.divide(noise, np.sqrt(2.0) * amplitude, out=np.ones_like(noise), where=amplitude > noise / np.sqrt(2.0))
    result: FloatArray = 20.0 * np.log10(1.0 + ratio)
    return result
