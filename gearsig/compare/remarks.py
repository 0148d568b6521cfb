"""What the reader of a comparison should know before believing a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gearsig.compare.side import LEAST_REVOLUTIONS, Side
from gearsig.compare.types import Alignment, ChannelComparison
from gearsig.compare.verdict import LEAST_REPEATED

SAME_SPEED, OTHER_SPEED = 0.03, 0.10
"""Relative differences of speed: not worth a word; and so large that resonances meet other orders."""

STEADY = 0.03
"""Relative range of speed within one record up to which one average stands for all of it."""

WORTH_SAYING = 0.1
"""Correlation that a turned mark would gain."""


def remarks(
    own: Side,
    other: Side,
    alignments: Sequence[Alignment],
    channels: Sequence[ChannelComparison],
    ratios: Mapping[str, float],
) -> tuple[str, ...]:
    """Return remarks on speeds, shafts left out, alignment and units."""
    texts = _speed_texts(own, other)
    left_out = [shaft for shaft in ratios if shaft not in {a.shaft for a in alignments}]
    if left_out:
        texts.append(
            f"Shaft {', '.join(left_out)} makes fewer than {LEAST_REVOLUTIONS} revolutions in one of the records: its "
            "average and its lines are left out."
        )
    told = {s.shaft for channel in channels for s in channel.shafts if s.best_correlation >= LEAST_REPEATED}
    texts += _alignment_texts([one for one in alignments if one.shaft in told])
    unknown = [channel.name for channel in channels if not channel.levels_compare]
    if unknown:
        texts.append(
            f"The unit of {', '.join(unknown)} is not known on one side: compare shapes and differences of levels "
            "between lines, not levels."
        )
    return tuple(texts)


def _speed_texts(own: Side, other: Side) -> list[str]:
    """Return one text on both speeds: a run-up has no speed of its own that could be compared with another."""
    if not (_is_steady(own) and _is_steady(other)):
        unsteady = [name for side, name in ((own, "simulation"), (other, "recording")) if not _is_steady(side)]
        text = (
            f"{_speed_words(own, 'The simulation')}, {_speed_words(other, 'the recording')}: levels of the "
            f"{' and of the '.join(unsteady)} are means over all speeds. At each of them orders meet other resonances, "
            "and an average need not repeat: parts at one speed compare better."
        )
        return [text]
    simulated, recorded = own.angle.mean_speed_rpm, other.angle.mean_speed_rpm
    off = simulated / recorded - 1.0
    if abs(off) > OTHER_SPEED:
        text = (
            f"The simulation turns at {simulated:.5g} rpm, the recording at {recorded:.5g} rpm ({100 * off:+.0f} %): "
            "orders are compared all the same, but each meets other resonances, and forces change with the speed."
        )
        return [text]
    if abs(off) > SAME_SPEED:
        text = (
            f"The simulation turns {abs(100 * off):.1f} % {'faster' if off > 0 else 'slower'} than the recording: "
            "compared by order; levels near resonances differ for that alone."
        )
        return [text]
    return []


def _is_steady(side: Side) -> bool:
    low, high = side.angle.speed_range_rpm
    return high - low <= STEADY * side.angle.mean_speed_rpm


def _speed_words(side: Side, name: str) -> str:
    if _is_steady(side):
        return f"{name} turns at {side.angle.mean_speed_rpm:.5g} rpm"
    low, high = side.angle.speed_range_rpm
    return f"{name} runs between {low:.5g} and {high:.5g} rpm"


def _alignment_texts(alignments: Sequence[Alignment]) -> list[str]:
    texts = []
    for one in alignments:
        if one.method == "marks" and one.gain > WORTH_SAYING:
            turned = f"{one.best_shift_deg:+.4g}°".replace("-", "−")
            texts.append(
                f"The averages{_of([one])} are aligned by their marks; with the simulation turned by {turned} they "
                f"would correlate better by {one.gain:.2f}. A simulation's mark need not sit where the rig's does: "
                "align by correlation then."
            )
    loose = [one for one in alignments if one.method != "marks" and one.tooth_is_certain is False]
    if loose:
        texts.append(
            f"No tooth{_of(loose)} stands out enough to tell which is which: the simulation's average is aligned to a "
            "whole number of teeth, and differences from tooth to tooth mean nothing."
        )
    return texts


def _of(alignments: Sequence[Alignment]) -> str:
    names = [one.shaft for one in alignments if one.shaft]
    return f" of shaft {' or '.join(names)}" if names else ""
