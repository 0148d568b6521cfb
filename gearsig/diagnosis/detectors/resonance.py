"""Resonances: frequencies at which several orders peak as the speed runs through."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from gearsig.diagnosis.confidence import from_p_value, p_text
from gearsig.diagnosis.types import Finding, Kind, OrderLevel, Strength, Where

PROMINENCE_DB = 6.0
"""A peak of a level over speed stands out by so much on both sides: twice the amplitude."""

NARROWEST = 0.01
"""Relative width within which peaks count as together: steps of speed and filters move them by as much."""

WIDEST = 0.05

LARGEST_P_VALUE = 0.1
PRIOR = 0.8
"""Every structure has resonances: who looks at one frequency in a run-up finds one more often than not."""

MOST_RESONANCES = 3


@dataclass(frozen=True)
class _Peak:
    level: OrderLevel
    i: int
    prominence_db: float

    @property
    def frequency_hz(self) -> float:
        return float(self.level.frequency_hz[self.i])

    @property
    def speed_rpm(self) -> float:
        return float(self.level.speed_rpm[self.i])


@dataclass(frozen=True)
class _Cluster:
    channel: str
    peaks: tuple[_Peak, ...]
    p_value: float

    @property
    def frequency_hz(self) -> float:
        """Mean of the peaks', more prominent ones counting more."""
        weights = [peak.prominence_db for peak in self.peaks]
        return float(np.average([peak.frequency_hz for peak in self.peaks], weights=weights))


def detect_resonances(levels: Mapping[str, Sequence[OrderLevel]]) -> list[Finding]:
    """Report frequencies at which several orders peak, each at its own speed: the structure answers there.

    An order's level may rise and fall with speed for other reasons. If it did so by chance, peaks of two orders would
    rarely lie at one frequency: the chance follows from the number of peaks and the range of frequencies they pass.
    """
    clusters = sorted((c for name in levels for c in _clusters(name, levels[name])), key=lambda c: c.p_value)
    kept: list[_Cluster] = []
    for cluster in clusters:
        if all(abs(cluster.frequency_hz / other.frequency_hz - 1) > WIDEST for other in kept):
            kept.append(cluster)
    significant = [c for c in kept if c.p_value * len(levels) <= LARGEST_P_VALUE]
    found = [replace(c, p_value=c.p_value * len(levels)) for c in significant]
    return [_finding(cluster, clusters) for cluster in found[:MOST_RESONANCES]]


def _clusters(channel: str, levels: Sequence[OrderLevel]) -> list[_Cluster]:
    peaks = [peak for level in levels for peak in _peaks(level)]
    found = [_around(channel, peak, peaks, levels) for peak in peaks]
    return [cluster for cluster in found if cluster is not None]


def _peaks(level: OrderLevel) -> list[_Peak]:
    """Return the peaks of a level that stand out on both sides; the ends of the run are none."""
    from scipy.signal import find_peaks

    decibels = 20 * np.log10(np.maximum(level.amplitude, 1e-300))
    at, properties = find_peaks(decibels, prominence=PROMINENCE_DB)
    return [_Peak(level, int(i), float(p)) for i, p in zip(at, properties["prominences"], strict=True)]


def _around(channel: str, centre: _Peak, peaks: Sequence[_Peak], levels: Sequence[OrderLevel]) -> _Cluster | None:
    """Return the peaks of other orders nearest to one, as many as make their coincidence least likely."""
    nearest: list[tuple[float, _Peak]] = []
    chances = []
    for level in levels:
        if level is centre.level or not level.frequency_hz[0] < centre.frequency_hz < level.frequency_hz[-1]:
            continue
        own = [p for p in peaks if p.level is level]
        chances.append((len(own), log(level.frequency_hz[-1] / max(level.frequency_hz[0], 1e-9))))
        if own:
            close = min(own, key=lambda p: abs(log(p.frequency_hz / centre.frequency_hz)))
            nearest.append((abs(log(close.frequency_hz / centre.frequency_hz)), close))
    best: _Cluster | None = None
    for n, (distance, _) in enumerate(sorted(nearest, key=lambda pair: pair[0]), start=1):
        width = max(distance, NARROWEST)
        if width > WIDEST:
            break
        # Every set of n + 1 peaks is looked at from each of them: so many fewer are the sets.
        n_sets = len(peaks) / (n + 1)
        p_value = min(1.0, n_sets * _at_least(n, [_chance(m, width, span) for m, span in chances]))
        members = tuple(p for d, p in nearest if d <= distance)
        if best is None or p_value < best.p_value:
            best = _Cluster(channel, (centre, *members), p_value)
    return best


def _chance(n_peaks: int, width: float, span: float) -> float:
    """Return the probability that any of an order's peaks lies within ± width by chance."""
    return 1.0 - max(0.0, 1.0 - 2.0 * width / span) ** n_peaks


def _at_least(n: int, chances: Sequence[float]) -> float:
    """Return the probability that at least n of independent events happen."""
    distribution = np.array([1.0])
    for chance in chances:
        distribution = np.convolve(distribution, [1.0 - chance, chance])
    return float(distribution[n:].sum())


def _finding(cluster: _Cluster, every: Sequence[_Cluster]) -> Finding:
    hertz = cluster.frequency_hz
    near = [c.channel for c in every if abs(c.frequency_hz / hertz - 1) <= WIDEST]
    peaks = sorted(cluster.peaks, key=lambda p: p.speed_rpm)
    strongest = max(peaks, key=lambda p: p.level.amplitude[p.i])
    largest = float(strongest.level.amplitude[strongest.i])
    beside = largest / 10 ** (strongest.prominence_db / 20)
    speeds = ", ".join(f"{p.level.name} at {p.speed_rpm:.0f} rpm" for p in peaks)
    return Finding(
        "resonance",
        Kind.NOTICE,
        f"A resonance at about {hertz:.4g} Hz: {speeds} peak there.",
        Where(tuple(dict.fromkeys([cluster.channel, *near])), frequency_hz=hertz),
        Strength(largest, strongest.level.unit, beside, "level beside the peak", strongest.prominence_db),
        confidence=from_p_value(cluster.p_value, prior=PRIOR, limit=0.95),
        confidence_basis=f"chance that peaks of {len(peaks)} orders meet at one frequency {p_text(cluster.p_value)}",
        evidence=("Levels measured there are the structure's as much as the gears': compare them at the same speed.",),
        surer="A slower run-up, or a run-down: a resonance stays at its frequency.",
    )
