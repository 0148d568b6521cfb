"""Finds what is wrong with the samples themselves: dead, clipped, stuck, offset or coarsely quantised channels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording.clipping import CORNER_DROP, find_clipping
from gearsig.recording.levels import Levels, find_levels
from gearsig.recording.types import Channel, Recording

ProblemKind = Literal["dead", "clipped", "stuck", "offset", "quantised"]

MAX_DEAD_LEVELS = 4
"""An open input flickers by a step or two of the converter: so many levels at most."""
DEAD_SHARE = 1e-3
"""… and far below the channels beside it."""
MAX_QUANTISED_LEVELS = 64
"""6 bits: the noise of the rounding is then 37 dB below a full-scale sine, above many a sideband."""
MAX_OFFSET_RATIO = 3.0
MIN_STUCK_SAMPLES = 16
STUCK_RATIO = 10
CORNER_DISTANCE = 8
MIN_SAMPLES = 64
_OFFSET_QUANTITIES = frozenset(("acceleration", "velocity", "sound_pressure", "unknown"))


@dataclass(frozen=True)
class ChannelProblem:
    """Something that makes a channel worth less.

    Parameters
    ----------
    channel : str
    kind : str
        "dead", "clipped", "stuck", "offset" or "quantised".
    share : float
        Share of the samples that are touched, 0 to 1.
    evidence : str
        What was seen, with numbers.
    remedy : str
    """

    channel: str
    kind: ProblemKind
    share: float
    evidence: str
    remedy: str


def find_problems(recording: Recording) -> tuple[ChannelProblem, ...]:
    """Return the problems of the vibration channels; speed, tachometer and other channels are not looked at.

    - *dead*: constant, or so small that the standard deviation vanishes in double precision; or at most four
      neighbouring levels and a standard deviation below 1/1000 of the median of the other vibration channels in the
      same unit.
    - *clipped*: see `gearsig.recording.clipping`.
    - *stuck*: runs of equal samples away from the extremes, at least 16 long, ten times longer than 99 % of the
      runs in the channel, and with a corner at both ends (eight samples further the signal is more than eight of the
      converter's steps away, which it is not at a smooth turning point): a dropout of the measurement chain.
    - *offset*: the mean is more than three times the standard deviation, for quantities without a static part.
    - *quantised*: fewer than 64 equidistant levels in use, less than 6 bits.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of ChannelProblem
        In the order of the channels; empty if nothing was found. Fewer than 64 samples are judged for "dead" only.
    """
    found: list[ChannelProblem] = []
    spreads = {c.name: float(np.std(recording.values(c.name), dtype=np.float64)) for c in recording.channels}
    for channel in recording.channels:
        if channel.is_vibration:
            others = [spreads[c.name] for c in recording.channels if _is_comparable(c, channel)]
            found += _problems_of(channel, recording.values(channel.name), spreads[channel.name], others)
    return tuple(found)


def _is_comparable(other: Channel, channel: Channel) -> bool:
    same = (other.quantity, other.unit) == (channel.quantity, channel.unit)
    return same and other.name != channel.name


def _problems_of(channel: Channel, x: FloatArray, spread: float, others: list[float]) -> list[ChannelProblem]:
    levels = find_levels(x)
    dead = _dead(channel, x, levels, spread, others)
    if dead is not None:
        return [dead]
    if len(x) < MIN_SAMPLES:
        return []
    tests = (
        _clipped(channel, x, levels),
        _stuck(channel, x, levels),
        _offset(channel, x, spread),
        _quantised(channel, levels),
    )
    return [problem for problem in tests if problem is not None]


def _dead(channel: Channel, x: FloatArray, levels: Levels, spread: float, others: list[float]) -> ChannelProblem | None:
    remedy = "check sensor, cable and input of this channel, and leave it out"
    if levels.n_used == 1:
        return ChannelProblem(channel.name, "dead", 1.0, f"all {len(x)} samples are {x[0]:g}", remedy)
    if spread == 0:  # values so small that their squares vanish
        evidence = f"the samples differ, by {np.ptp(x):.2g} at most, too little for a standard deviation"
        return ChannelProblem(channel.name, "dead", 1.0, evidence, remedy)
    if not others or levels.n_spanned > MAX_DEAD_LEVELS or spread > DEAD_SHARE * float(np.median(others)):
        return None
    evidence = (
        f"only {levels.n_used} levels, standard deviation {spread:.3g}; "
        f"the other channels' is {float(np.median(others)):.3g}"
    )
    return ChannelProblem(channel.name, "dead", 1.0, evidence, remedy)


def _clipped(channel: Channel, x: FloatArray, levels: Levels) -> ChannelProblem | None:
    # Parts that come apart carry no force, tooth flanks in their play among them.
    clipping = find_clipping(x, levels, rest=0.0 if channel.quantity == "force" else None)
    if clipping is None:
        return None
    share = clipping.n_samples / len(x)
    evidence = f"{clipping.n_samples} samples ({100 * share:.2g} %) are held at {clipping.place}"
    remedy = "measure again with a larger input range; peak, crest factor and kurtosis are not to be trusted"
    return ChannelProblem(channel.name, "clipped", share, evidence, remedy)


def _stuck(channel: Channel, x: FloatArray, levels: Levels) -> ChannelProblem | None:
    ends = np.flatnonzero(np.diff(x) != 0)
    lengths = np.diff(np.concatenate(([-1], ends, [len(x) - 1])))
    starts = np.concatenate(([0], ends + 1))
    inside = (x[starts] != x.min()) & (x[starts] != x.max())
    usual = float(np.percentile(lengths, 99))
    long = inside & (lengths >= max(MIN_STUCK_SAMPLES, STUCK_RATIO * usual))
    step = levels.step or float(np.finfo(x.dtype).eps * np.abs(x).max())
    before, after = starts - CORNER_DISTANCE, starts + lengths - 1 + CORNER_DISTANCE
    long &= (before >= 0) & (after < len(x))
    held = x[starts[long]]
    away = np.minimum(np.abs(x[before[long]] - held), np.abs(x[after[long]] - held))
    long[long] = away > CORNER_DROP * step
    if not long.any():
        return None
    longest = int(np.argmax(np.where(long, lengths, 0)))
    share = float(lengths[long].sum() / len(x))
    evidence = (
        f"{int(long.sum())} run(s) of equal samples, the longest {lengths[longest]} samples "
        f"from sample {starts[longest]} at {x[starts[longest]]:g}; 99 % of the runs are no longer than {usual:.0f}"
    )
    remedy = "check for dropouts of the measurement chain or a machine at rest, and cut these parts out"
    return ChannelProblem(channel.name, "stuck", share, evidence, remedy)


def _offset(channel: Channel, x: FloatArray, spread: float) -> ChannelProblem | None:
    mean = float(np.mean(x, dtype=np.float64))
    if channel.quantity not in _OFFSET_QUANTITIES or abs(mean) <= MAX_OFFSET_RATIO * spread:
        return None
    evidence = f"the mean, {mean:.4g} {channel.unit}".rstrip() + f", is {abs(mean) / spread:.3g} times the rms about it"
    return ChannelProblem(
        channel.name, "offset", 1.0, evidence, "check bias and coupling; only the part about it counts"
    )


def _quantised(channel: Channel, levels: Levels) -> ChannelProblem | None:
    if levels.step is None or levels.n_spanned >= MAX_QUANTISED_LEVELS:
        return None
    evidence = f"only {levels.n_spanned} levels of {levels.step:.3g} are in use ({np.log2(levels.n_spanned):.1f} bits)"
    remedy = "measure again with a smaller input range: weak sidebands drown in the rounding"
    return ChannelProblem(channel.name, "quantised", 1.0, evidence, remedy)
