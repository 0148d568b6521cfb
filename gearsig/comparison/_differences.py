"""What differs between both records beyond their scatter, the largest first: lines, teeth of an average.

Lines and teeth are ranked by one measure, the part of the vibration's mean square by which they differ: that of a
revolution is the sum over its lines as it is over its teeth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.comparison._types import BEYOND, Alignment, ChannelComparison, LevelPair, LineLevel, ShaftComparison

MIN_REPEATED = 0.3
"""Correlation that two averages could reach, below which they say nothing of each other: their halves differ."""

WITHIN_DB = 3.0
"""Levels this close are called agreement: a factor of √2."""

BETTER_TURNED = 0.1
"""Gain of correlation from which marks are doubted: a simulation's need not sit where the rig's does."""

CHANCE = 0.05
"""That of all lines, or of all teeth, which are looked at any one exceeds its scatter by accident."""

FREEDOM = 16
"""Degrees of freedom of a scatter: of two halves over nine lines, in two quadratures that are not quite independent."""

WORTH_DB = 0.5
"""Smaller differences are not worth a word: one record of a machine against another at 6 % more load."""

WORTH_CORRELATION = 0.01


@dataclass(frozen=True)
class ToothDifference:
    """The tooth at which two averages differ most.

    Parameters
    ----------
    shaft : str
    tooth : int
        From 1 at angle 0.
    angle_deg : float
        Of its middle.
    level : LevelPair
    off_db : float
        Its difference; less the median of all teeth where that is worth a word.
    is_beside_others : bool
        Whether the median is taken off.
    is_marked : bool
        Whether angle 0 is a mark of both records.
    power : float
        By which the averages' mean squares over the revolution differ there.
    """

    shaft: str
    tooth: int
    angle_deg: float
    level: LevelPair
    off_db: float
    is_beside_others: bool
    is_marked: bool
    power: float

    @property
    def place(self) -> str:
        """Name it by shaft, angle and, where it counts from a mark, number."""
        of = f" of {self.shaft}" if self.shaft else ""
        return f"tooth {self.tooth}{of} ({self.angle_deg:.0f}°)" if self.is_marked else f"{self.angle_deg:.0f}°{of}"


def times_scatter(n: int) -> float:
    """Return by how many standard errors one of `n` figures must differ to be no accident.

    Quantile of Student's t at `CHANCE` / n (Bonferroni), and never less than `BEYOND`.

    Examples
    --------
    >>> round(times_scatter(10), 1), round(times_scatter(140), 1)
    (3.3, 4.5)
    """
    from scipy.stats import t

    return max(BEYOND, float(t.isf(CHANCE / 2 / max(n, 1), FREEDOM)))


def is_hidden(line: LineLevel) -> bool:
    """Whether the record that does not show a line would not show it either if it were there."""
    difference_db = line.level.difference_db
    # 6 dB: a line half as large would be seen above the other record's noise.
    return (difference_db if line.simulated_is_seen else -difference_db) <= 6.0


def mesh_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the mesh harmonics that the recording shows; the shaft orders where it shows none."""
    for kind in ("mesh", "shaft"):
        lines = tuple(line for line in channel.lines if line.kind == kind and line.recorded_is_seen)
        if lines:
            return lines
    return ()


def further_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the lines beside the mesh harmonics that can be compared: one of both shows them, and none hides them."""
    mesh = mesh_lines(channel)
    lines = (line for line in (*channel.lines, *channel.other_lines) if line.is_seen and line not in mesh)
    return tuple(line for line in lines if (line.simulated_is_seen and line.recorded_is_seen) or not is_hidden(line))


def differing_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the further lines whose difference is no accident and not the mesh harmonics' own, largest first."""
    lines, gain_db = further_lines(channel), common_gain_db(channel)
    needed = times_scatter(len(lines))
    found = [
        line
        for line in lines
        if abs(line.level.difference_db - gain_db) > max(WORTH_DB, needed * line.level.repeatability_db)
    ]
    return tuple(sorted(found, key=lambda line: -power_difference(line.level, gain_db)))


def common_gain_db(channel: ChannelComparison) -> float:
    """Return the mesh harmonics' median difference where it is no agreement, or the levels do not compare; else 0."""
    gain_db = float(np.median([line.level.difference_db for line in mesh_lines(channel)] or [0.0]))
    return gain_db if abs(gain_db) > WITHIN_DB or not channel.levels_compare else 0.0


def power_difference(level: LevelPair, gain_db: float = 0.0) -> float:
    """Return by how much the mean squares differ, the simulation's after a gain."""
    return float(abs(10.0 ** ((level.simulated_db - gain_db) / 10.0) - 10.0 ** (level.recorded_db / 10.0)))


def differing_tooth(channel: ChannelComparison, alignments: Sequence[Alignment]) -> ToothDifference | None:
    """Return the tooth at which an average differs most from its others beyond scatter; None where none does."""
    aligned = {alignment.shaft: alignment for alignment in alignments}
    teeth = [
        tooth
        for shaft in comparable_averages(channel, alignments)
        if shaft.tooth_levels and (tooth := _tooth(shaft, is_marked=aligned[shaft.shaft].method == "marks")) is not None
    ]
    return max(teeth, key=lambda tooth: tooth.power, default=None)


def _tooth(shaft: ShaftComparison, *, is_marked: bool) -> ToothDifference | None:
    levels, n = shaft.tooth_levels, len(shaft.tooth_levels)
    differences = np.array([level.difference_db for level in levels])
    median_db = float(np.median(differences))
    gain_db = median_db if abs(median_db) > WORTH_DB else 0.0
    apart = differences - gain_db
    errors = np.array([level.repeatability_db for level in levels])
    clear = np.flatnonzero(np.abs(apart) > np.maximum(WORTH_DB, times_scatter(n) * errors))
    if not len(clear):
        return None
    i = int(max(clear, key=lambda tooth: power_difference(levels[tooth], gain_db)))
    power = power_difference(levels[i], gain_db) / n
    angle_deg, is_beside_others = 360.0 * (i + 0.5) / n, gain_db != 0.0
    return ToothDifference(
        shaft.shaft, i + 1, angle_deg, levels[i], float(apart[i]), is_beside_others, is_marked, power
    )


def comparable_averages(channel: ChannelComparison, alignments: Sequence[Alignment]) -> tuple[ShaftComparison, ...]:
    """Return the averages whose halves repeat and that are aligned to the tooth."""
    uncertain = {
        alignment.shaft
        for alignment in alignments
        if (alignment.gain > BETTER_TURNED if alignment.method == "marks" else alignment.tooth_is_certain is False)
    }
    return tuple(
        shaft for shaft in channel.shafts if shaft.best_correlation >= MIN_REPEATED and shaft.shaft not in uncertain
    )


def differing_average(channel: ChannelComparison) -> ShaftComparison | None:
    """Return the average whose correlation is furthest below what is possible, beyond scatter; None where none is."""

    def lack(shaft: ShaftComparison) -> float:
        return shaft.best_correlation - shaft.correlation.value

    shafts = [shaft for shaft in channel.shafts if shaft.best_correlation >= MIN_REPEATED]
    needed = times_scatter(len(shafts))
    found = [s for s in shafts if lack(s) > max(WORTH_CORRELATION, needed * s.correlation.repeatability)]
    return max(found, key=lack, default=None)
