"""A comparison as text: for the terminal, and its order lines as a table for other programs."""

from __future__ import annotations

import csv
from io import StringIO
from textwrap import fill

from gearsig.compare.remarks import STEADY
from gearsig.compare.types import ChannelComparison, Comparison, LevelPair, LineLevel, RecordFacts
from gearsig.compare.verdict import LEAST_REPEATED, mesh_lines, missing_words
from gearsig.formatting import rounded
from gearsig.plot.display import unit_text

WIDTH = 100
MOST_LINES = 12
ORDER_COLUMNS = (
    "channel",
    "kind",
    "label",
    "order",
    "shaft",
    "simulated_db",
    "recorded_db",
    "difference_db",
    "repeatability_db",
    "simulated_is_seen",
    "recorded_is_seen",
)


def comparison_text(comparison: Comparison) -> str:
    """Return both records, the mesh harmonics of each channel and the verdict, in plain text."""
    lines = [
        f"simulation {_record(comparison.simulated)}",
        f"recording  {_record(comparison.recorded)}",
        *(f"aligned    {text}" for text in alignment_texts(comparison)),
    ]
    for channel in comparison.channels:
        lines += ["", *_channel_table(channel)]
    lines += ["", fill(comparison.verdict, WIDTH)]
    lines += [fill(text, WIDTH) for text in comparison.findings]
    for note in comparison.notes:
        lines.append(fill(f"Note: {note}", WIDTH, subsequent_indent="      "))
    return "\n".join(lines)


def alignment_texts(comparison: Comparison) -> list[str]:
    """Return one text per shaft on how the records were aligned."""
    texts = []
    for one in comparison.alignments:
        name = f"shaft {one.shaft}: " if one.shaft else ""
        if one.method == "marks":
            texts.append(f"{name}by the marks of both records")
            continue
        sure = {None: "", True: ", the same tooth in both", False: ", good to whole teeth only"}[one.tooth_is_certain]
        within = "" if one.tooth_is_certain is False else f" ± {one.repeatability_deg:.2g}°"
        turned = f"{one.shift_deg:+.4g}°".replace("-", "−")
        texts.append(f"{name}by correlation, simulation turned by {turned}{within}{sure}")
    return texts


def orders_csv(comparison: Comparison) -> str:
    """Return all order lines of all channels as CSV with a heading."""
    buffer = StringIO()
    table = csv.writer(buffer, lineterminator="\n")
    table.writerow(ORDER_COLUMNS)
    for channel in comparison.channels:
        for line in (*channel.lines, *channel.other_lines):
            table.writerow([_harmless(channel.name), *_row(line)])
    return buffer.getvalue()


def _row(line: LineLevel) -> list[object]:
    numbers = [line.level.simulated_db, line.level.recorded_db, line.level.difference_db, line.level.repeatability_db]
    return [
        line.kind,
        _harmless(line.label),
        rounded(line.order),
        _harmless(line.shaft),
        *(round(number, 3) for number in numbers),
        str(line.simulated_is_seen).lower(),
        str(line.recorded_is_seen).lower(),
    ]


def _harmless(text: str) -> str:
    """Return a name from a file so that no spreadsheet takes it for a formula."""
    return f"'{text}" if text[:1] in ("=", "+", "-", "@", "\t", "\r") else text


def _record(facts: RecordFacts) -> str:
    low, high = facts.speed_range_rpm
    run = f", between {low:.5g} and {high:.5g}" if high - low > STEADY * facts.mean_speed_rpm else ""
    return (
        f"{facts.source}: {facts.duration_s:.6g} s at {facts.sampling_rate_hz:.6g} Hz, {facts.mean_speed_rpm:.6g} rpm"
        f"{' on average' if run else ''}{run} ({facts.speed_method}), {facts.n_revolutions:.4g} revolutions"
    )


def _channel_table(channel: ChannelComparison) -> list[str]:
    unit = f" re 1 {unit_text(channel.unit)}" if channel.unit else ""
    rows = [f"{channel.name:<30} {'recorded':>10} {'simulated':>10} {'difference':>11}   (dB{unit}, rms)"]
    rows.append(_level_row("overall", channel.overall))
    rows += [_level_row(line.label, line.level, line) for line in mesh_lines(channel)[:MOST_LINES]]
    for shaft in channel.shafts:
        best = shaft.best_correlation
        possible = f"at most {best:.3f}" if best >= LEAST_REPEATED else "its halves do not repeat"
        frac = shaft.agreement
        rows.append(
            f"average of {shaft.shaft or 'the shaft'}: correlation {shaft.correlation.value:.3f} "
            f"± {shaft.correlation.repeatability:.2g} ({possible}); FRAC {frac.complex_frac.value:.3f} complex "
            f"({frac.complex_by_chance:.3f} by chance), {frac.magnitude_frac.value:.3f} of magnitudes"
        )
    return rows


def _level_row(label: str, level: LevelPair, line: LineLevel | None = None) -> str:
    words = "" if line is None else missing_words(line)
    missing = f"  {words}" if words else ""
    return (
        f"{label[:30]:<30} {level.recorded_db:>10.1f} {level.simulated_db:>10.1f} {level.difference_db:>+11.1f} "
        f"± {2 * level.repeatability_db:.1f}{missing}"
    )
