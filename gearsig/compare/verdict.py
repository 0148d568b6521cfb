"""What a comparison comes to, in a few sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.compare.types import ChannelComparison, LineLevel

WITHIN_DB = 3.0
"""Levels this close are called agreement: a factor of √2."""

LARGE_GAIN_DB = 3.0
"""A common gain beyond it is named on its own: it is the path's or the sensor's, not the gears'."""

WORTH_NAMING_DB = 40.0
"""A line that one record lacks is named if it is so close to the other's strongest, or closer."""

LACKING_DB = 6.0
"""And if the other record's noise would let a line half as large be seen."""


def verdict_of(channels: Sequence[ChannelComparison]) -> str:
    """Return sentences on mesh harmonics, missing lines, the average's shape and what is locked, channel by channel."""
    return " ".join(text for channel in channels for text in _channel(channel, named=len(channels) > 1))


def mesh_lines(channel: ChannelComparison) -> tuple[LineLevel, ...]:
    """Return the mesh harmonics that the recording shows; the shaft orders where it shows none."""
    for kind in ("mesh", "shaft"):
        found = tuple(line for line in channel.lines if line.kind == kind and line.recorded_is_seen)
        if found:
            return found
    return ()


def _channel(channel: ChannelComparison, *, named: bool) -> list[str]:
    head = f"{channel.name}: " if named else ""
    lines = mesh_lines(channel)
    if not lines:
        return [f"{head}No line of the recording stands above its own noise: only the floors can be compared."]
    where = "mesh harmonics" if lines[0].kind == "mesh" else "shaft orders"
    texts = [head + _lines_text(lines, where, levels_compare=channel.levels_compare)]
    texts += _missing_text(channel)
    return [*texts, _shape_text(channel)]


def _lines_text(lines: Sequence[LineLevel], where: str, *, levels_compare: bool) -> str:
    differences = np.array([line.level.difference_db for line in lines])
    gain = float(np.median(differences))
    n = f"{len(lines)} {where}" if len(lines) > 1 else f"one {where[:-1]}"
    worst = lines[int(np.argmax(np.abs(differences - (gain if not levels_compare else 0.0))))]
    if not levels_compare:
        spread = float(np.max(np.abs(differences - gain)))
        return (
            f"The unit of one side is not known; after a common gain of {-gain:+.1f} dB, simulation and recording "
            f"agree within {spread:.1f} dB at {n}{_worst(worst, gain) if spread > WITHIN_DB else ''}."
        )
    largest = float(np.max(np.abs(differences)))
    if not any(line.level.is_beyond for line in lines):
        return f"At {n}, simulation and recording do not differ by more than the records' own scatter."
    if largest <= WITHIN_DB:
        return f"Simulation and recording agree within {largest:.1f} dB at {n}."
    spread = float(np.max(np.abs(differences - gain)))
    text = f"Simulation and recording differ by up to {largest:.1f} dB at {n}{_worst(worst, 0.0)}"
    if len(lines) > 1 and abs(gain) > LARGE_GAIN_DB and spread < largest:
        text += f"; a common gain of {-gain:+.1f} dB would bring them within {spread:.1f} dB"
    return f"{text}."


def _worst(line: LineLevel, gain: float) -> str:
    off = line.level.difference_db - gain
    return f", the most at {line.label}: {abs(off):.1f} dB too {'weak' if off < 0 else 'strong'}"


def _missing_text(channel: ChannelComparison) -> list[str]:
    """Name the strongest lines that only one of the two shows."""
    texts = []
    for seen, other, words in (
        ("recorded_is_seen", "simulated_is_seen", "The simulation lacks"),
        ("simulated_is_seen", "recorded_is_seen", "Only the simulation has"),
    ):
        found = [
            line
            for line in (*channel.lines, *channel.other_lines)
            if getattr(line, seen) and not getattr(line, other) and abs(line.level.difference_db) > LACKING_DB
        ]
        side = "recorded_db" if seen.startswith("recorded") else "simulated_db"
        strongest = max(getattr(line.level, side) for line in (*channel.lines, *channel.other_lines))
        found = [line for line in found if getattr(line.level, side) > strongest - WORTH_NAMING_DB]
        found.sort(key=lambda line: -float(getattr(line.level, side)))
        if found:
            texts.append(f"{words} {', '.join(line.label for line in found[:3])}{_more(len(found) - 3)}.")
    return texts


def _more(n: int) -> str:
    return f" and {n} more lines" if n > 1 else " and one more line" if n == 1 else ""


def _shape_text(channel: ChannelComparison) -> str:
    texts = []
    for shaft in channel.shafts:
        best = float(np.sqrt(shaft.simulated_reliability * shaft.recorded_reliability))
        texts.append(f"{shaft.correlation.value:.2f}{f' ({shaft.shaft})' if shaft.shaft else ''} of {best:.2f}")
    locked = channel.locked
    return (
        f"The synchronous averages correlate by {', '.join(texts)} possible; "
        f"{_percent(locked.recorded.value)} of the recording's energy turns with the shafts, "
        f"{_percent(locked.simulated.value)} of the simulation's."
    )


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %"
