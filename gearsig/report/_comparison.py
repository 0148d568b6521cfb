"""A comparison's page: one self-contained HTML file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from textwrap import fill

from gearsig import __version__
from gearsig.comparison import (
    BEYOND,
    MIN_REPEATED,
    STEADY,
    BandLevel,
    ChannelComparison,
    Comparison,
    LevelPair,
    LineLevel,
    RecordFacts,
    RepeatableValue,
    ShaftComparison,
    differing_lines,
    differing_tooth,
    mesh_lines,
    missing_line_text,
)
from gearsig.formatting import (
    csv_rows,
    decimals_for,
    plus_minus,
    readable,
    rounded,
    scatter_text,
    signed,
    spreadsheet_cell,
    unit_text,
    with_minus,
)
from gearsig.plot import CaptionedFigure, Cursor, Picture, embed
from gearsig.report._files import date_text, render
from gearsig.report._json import Layout, document, plain
from gearsig.report._sections import Rows

# --------------------
# The pictures of a comparison, with hints on what to look for.
# --------------------


WITHOUT_MESH = 50.0
"""Maximum order drawn, in mesh orders, and without a mesh."""
MAX_CURSORS = 10

LOOK_AT_ORDERS = (
    "Below: the difference of each line of the simulation. Shaded: twice its repeatability. A triangle marks a line "
    "that only one of the two shows: its difference is at least that large."
)
LOOK_AT_TEETH = "At the bottom, the level of each tooth: pale bars are within the records' own scatter."
LOOK_AT_BANDS = (
    "FRAC: agreement of the lines in a band, regardless of gain; 1 is the same shape. A dash is the complex FRAC by "
    "chance, because one line outweighs all others; the dotted line is the FRAC of unrelated magnitudes."
)
LOOK_AT_OCTAVES = "The whole signal in each band, including noise. At a different speed, other orders fall into a band."


def channel_pictures(comparison: Comparison, channel: ChannelComparison) -> Iterator[Picture]:
    """Yield the pictures of one channel: orders, averages of each shaft, bands."""
    for figures in FIGURES.values():
        for picture in figures(comparison, channel):
            yield embed(picture.figure, picture.caption, picture.alternative)


def order_figures(comparison: Comparison, channel: ChannelComparison) -> Iterator[CaptionedFigure]:
    """Yield both order spectra with the differences of their lines."""
    from gearsig.plot import order_overlay_figure

    figure = order_overlay_figure(
        channel.recorded_spectrum,
        channel.simulated_spectrum,
        (*channel.lines, *channel.other_lines),
        mesh_cursors(comparison),
        limits=(0.0, shown_orders(comparison)),
        title=f"Order spectra, {channel.name}",
    )
    shows = f"Order spectra of {channel.name}, recorded and simulated, and the difference of their lines."
    yield CaptionedFigure(figure, LOOK_AT_ORDERS, shows)


def angle_figures(comparison: Comparison, channel: ChannelComparison) -> Iterator[CaptionedFigure]:
    """Yield the synchronous averages of each shaft."""
    for shaft in channel.shafts:
        yield _average(comparison, channel, shaft)


def band_figures(comparison: Comparison, channel: ChannelComparison) -> Iterator[CaptionedFigure]:
    """Yield the bands over order, and the third octaves."""
    from gearsig.plot import band_levels_figure

    del comparison  # part of the common signature, not needed here
    figure = band_levels_figure(channel.order_bands, channel.unit, title=f"Bands over order, {channel.name}")
    shows = f"Levels of bands over order of {channel.name}, recorded and simulated, and their agreement."
    yield CaptionedFigure(figure, LOOK_AT_BANDS, shows)
    if channel.third_octaves:
        figure = band_levels_figure(channel.third_octaves, channel.unit, title=f"Third octaves, {channel.name}")
        shows = f"Third-octave levels of {channel.name}, recorded and simulated."
        yield CaptionedFigure(figure, LOOK_AT_OCTAVES, shows)


FIGURES: dict[str, Callable[[Comparison, ChannelComparison], Iterator[CaptionedFigure]]] = {
    "Orders": order_figures,
    "Angle": angle_figures,
    "Bands": band_figures,
}
"""Functions that draw a channel's figures, by title."""


def _average(comparison: Comparison, channel: ChannelComparison, shaft: ShaftComparison) -> CaptionedFigure:
    from gearsig.plot import average_overlay_figure

    name = shaft.shaft or "the shaft"
    correlation = with_minus(f"{shaft.correlation.value:.3f}")
    figure = average_overlay_figure(
        shaft.recorded,
        shaft.simulated,
        shaft.tooth_levels,
        n_teeth=shaft.n_teeth,
        title=f"Synchronous averages of {name}, {channel.name}: correlation {correlation}",
    )
    look = f"One mean revolution of {name}, aligned; below it, a part enlarged.{_teeth_text(comparison, shaft)}"
    shows = f"Synchronous averages of {name}, recorded and simulated, over one revolution."
    return CaptionedFigure(figure, look, shows)


def _teeth_text(comparison: Comparison, shaft: ShaftComparison) -> str:
    """Say what the panel of teeth shows, and when it is not meaningful."""
    if not shaft.tooth_levels:
        return ""
    return f" {LOOK_AT_TEETH}{tooth_warning_text(comparison, shaft.shaft)}"


def tooth_warning_text(comparison: Comparison, shaft: str) -> str:
    """Warn if teeth at the same angle may differ between the records; empty otherwise."""
    is_doubted = any(alignment.is_doubted for alignment in comparison.alignments if alignment.shaft == shaft)
    return " The teeth of simulation and recording cannot be matched here." if is_doubted else ""


def mesh_cursors(comparison: Comparison) -> tuple[Cursor, ...]:
    """Return the mesh harmonics, with the pair's number if there are several pairs."""
    single_pair = len(comparison.mesh_orders) == 1
    return tuple(
        Cursor(k * mesh, "mesh", f"{k}× mesh" if single_pair else f"{k}× mesh {i}", k)
        for i, mesh in enumerate(comparison.mesh_orders, 1)
        for k in range(1, MAX_CURSORS + 1)
    )


def shown_orders(comparison: Comparison) -> float:
    """Return the maximum order drawn in spectra."""
    meshes = [mesh for mesh in comparison.mesh_orders if mesh <= comparison.highest_order]
    return min(comparison.highest_order, 5.6 * max(meshes) if meshes else WITHOUT_MESH)


# --------------------
# A comparison as text: for the terminal, and its order lines as a table for other programs.
# --------------------


WIDTH = 100
SCATTER = "± is twice the standard error"
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
        lines += ["", *_channel_table(comparison, channel)]
    lines += ["", fill(comparison.verdict, WIDTH)]
    lines += [fill(text, WIDTH) for text in comparison.findings]
    for note in comparison.notes:
        lines.append(fill(f"Note: {note}", WIDTH, subsequent_indent="      "))
    return "\n".join(lines)


def alignment_texts(comparison: Comparison) -> list[str]:
    """Return how the records were aligned, one text per shaft."""
    texts = []
    for alignment in comparison.alignments:
        name = f"shaft {alignment.shaft}: " if alignment.shaft else ""
        if alignment.method == "marks":
            texts.append(f"{name}by the marks of both records")
            continue
        certain = alignment.tooth_is_certain
        sure = {None: "", True: ", the same tooth in both", False: ", to a whole number of teeth only"}[certain]
        scatter_deg = BEYOND * alignment.repeatability_deg
        turned = signed(alignment.shift_deg) if certain is False else plus_minus(alignment.shift_deg, scatter_deg)
        texts.append(f"{name}by correlation, simulation turned by {turned}°{sure}")
    return texts


def orders_csv(comparison: Comparison) -> str:
    """Return all order lines of all channels as CSV with a heading."""
    return csv_rows(
        ORDER_COLUMNS,
        (
            [spreadsheet_cell(channel.name), *_row(line)]
            for channel in comparison.channels
            for line in (*channel.lines, *channel.other_lines)
        ),
    )


def _row(line: LineLevel) -> list[object]:
    numbers = [line.level.simulated_db, line.level.recorded_db, line.level.difference_db, line.level.repeatability_db]
    return [
        line.kind,
        spreadsheet_cell(line.label),
        rounded(line.order),
        spreadsheet_cell(line.shaft),
        *(round(number, 3) for number in numbers),
        str(line.simulated_is_seen).lower(),
        str(line.recorded_is_seen).lower(),
    ]


def _record(facts: RecordFacts) -> str:
    low, high = facts.speed_range_rpm
    run = f", between {low:.5g} and {high:.5g}" if high - low > STEADY * facts.mean_speed_rpm else ""
    return (
        f"{facts.source}: {facts.duration_s:.6g} s at {facts.sampling_rate_hz:.6g} Hz, {facts.mean_speed_rpm:.6g} rpm"
        f"{' on average' if run else ''}{run} ({facts.speed_method}), {facts.n_revolutions:.4g} revolutions"
    )


def _channel_table(comparison: Comparison, channel: ChannelComparison) -> list[str]:
    unit = f" re 1 {unit_text(channel.unit)}" if channel.unit else ""
    rows = [f"{channel.name:<30} {'recorded':>10} {'simulated':>10} {'difference':>11}   (dB{unit}, rms; {SCATTER})"]
    rows.append(_level_row("overall", channel.overall))
    lines = (*mesh_lines(channel)[:12], *differing_lines(channel)[:6])
    rows += [_level_row(line.label, line.level, missing_line_text(line)) for line in lines]
    tooth = differing_tooth(channel, comparison.alignments)
    if tooth is not None:
        beside = f"the other teeth {signed(tooth.level.difference_db - tooth.off_db)}" if tooth.is_beside_others else ""
        rows.append(_level_row(tooth.place, tooth.level, beside))
    for shaft in channel.shafts:
        frac = shaft.agreement
        rows.append(
            f"average of {shaft.shaft or 'the shaft'}: correlation {_repeated(shaft.correlation)}; {_possible(shaft)}; "
            f"FRAC {frac.complex_frac.value:.3f} complex ({frac.complex_by_chance:.3f} by chance), "
            f"{frac.magnitude_frac.value:.3f} of magnitudes"
        )
    return rows


def _level_row(label: str, level: LevelPair, note: str = "") -> str:
    recorded, simulated, difference, scatter = _level_texts(level)
    row = f"{label[:30]:<30} {recorded:>10} {simulated:>10} {difference:>11} ± {scatter}"
    return f"{row}  {note}" if note else row


def _level_texts(level: LevelPair) -> tuple[str, str, str, str]:
    """Return recorded, simulated, difference and scatter, with equal numbers of decimals."""
    scatter = BEYOND * level.repeatability_db
    n = decimals_for(scatter)
    recorded, simulated = (with_minus(f"{round(x, n) + 0.0:.{n}f}") for x in (level.recorded_db, level.simulated_db))
    return recorded, simulated, signed(level.difference_db, n), scatter_text(scatter)


def comparison_page(comparison: Comparison, *, command: str = "") -> str:
    """Return the page of a comparison: verdict, what was compared, and each channel with figures and tables.

    It is one file without scripts or external resources.

    Parameters
    ----------
    comparison : Comparison
    command : str
        The command that reproduces it.
    """
    return render(
        "compare.html.j2",
        title=f"{comparison.simulated.source} beside {comparison.recorded.source}",
        machine_name=comparison.machine,
        verdict=comparison.verdict,
        findings=comparison.findings,
        notes=comparison.notes,
        simulated=_record_rows(comparison.simulated),
        recorded=_record_rows(comparison.recorded),
        alignment=tuple(alignment_texts(comparison)),
        channels=[_section(comparison, channel, i) for i, channel in enumerate(comparison.channels)],
        provenance=_provenance(comparison, command),
    )


def _section(comparison: Comparison, channel: ChannelComparison, i: int) -> dict[str, object]:
    """Return the template values of one channel."""
    main = [line for line in (*channel.lines, *channel.other_lines) if line.kind != "sideband" and line.is_seen]
    sidebands = [line for line in channel.lines if line.kind == "sideband" and line.is_seen]
    sidebands.sort(key=lambda line: -abs(line.level.difference_db))
    return {
        "title": channel.name,
        "unit": f"dB re 1 {unit_text(channel.unit)}, rms" if channel.unit else "dB, unit not known",
        "figures": channel_rows(channel),
        # Pictures of four channels at most: a larger page is too large to send.
        "pictures": tuple(channel_pictures(comparison, channel)) if i < 4 else (),
        "main": [_line_row(line) for line in main],
        "sidebands": [_line_row(line) for line in sidebands[:40]],
    }


def channel_rows(channel: ChannelComparison) -> Rows:
    """Return the agreement figures of a channel as (name, text) rows."""
    rows = [("overall level, simulated minus recorded", _difference(channel.overall))]
    for shaft in channel.shafts:
        name = f" of {shaft.shaft}" if shaft.shaft else ""
        frac = (
            f"complex {_repeated(shaft.agreement.complex_frac)} ({shaft.agreement.complex_by_chance:.3f} by chance), "
            f"magnitudes {_repeated(shaft.agreement.magnitude_frac)}; {shaft.agreement.n_lines} orders"
        )
        rows += [
            (f"correlation, average{name}", f"{_repeated(shaft.correlation)}; {_possible(shaft)}"),
            (f"FRAC, average{name}", frac),
        ]
    locked = channel.locked
    rows.append(
        (
            "energy that repeats with the shafts",
            f"recording {_percent(locked.recorded)}, simulation {_percent(locked.simulated)}",
        )
    )
    return tuple(rows)


def _possible(shaft: ShaftComparison) -> str:
    """Return the correlation of two such averages of one motion, or say that it is not meaningful."""
    if shaft.best_correlation < MIN_REPEATED:
        return "not meaningful, as the halves of one record do not repeat"
    return f"two such averages reach {shaft.best_correlation:.3f}"


def _line_row(line: LineLevel) -> dict[str, object]:
    """Return the template values of a level."""
    texts = dict(zip(("recorded", "simulated", "difference", "scatter"), _level_texts(line.level), strict=True))
    about = {"label": line.label, "order": readable(line.order, 6), "note": missing_line_text(line)}
    return {**about, **texts, "is_beyond": line.level.is_beyond}


def _record_rows(facts: RecordFacts) -> Rows:
    low, high = (readable(rpm, 6) for rpm in facts.speed_range_rpm)
    return (
        ("file", facts.source),
        ("length", f"{readable(facts.duration_s, 5)} s at {readable(facts.sampling_rate_hz, 7)} Hz"),
        ("speed", f"{readable(facts.mean_speed_rpm, 6)} rpm, {low} to {high} ({facts.speed_method})"),
        ("revolutions", readable(facts.n_revolutions, 4)),
        *(("note", note) for note in facts.notes),
    )


def _provenance(comparison: Comparison, command: str) -> Rows:
    rows = (
        ("SHA-256, simulation", comparison.simulated.sha256),
        ("SHA-256, recording", comparison.recorded.sha256),
        ("version", f"gearsig {__version__}"),
        ("date", date_text()),
        ("command", command),
    )
    return tuple((name, text) for name, text in rows if text)


def _difference(level: LevelPair) -> str:
    return f"{plus_minus(level.difference_db, BEYOND * level.repeatability_db, with_sign=True)} dB"


def _repeated(figure: RepeatableValue) -> str:
    return plus_minus(figure.value, BEYOND * figure.repeatability, 3)


def _percent(figure: RepeatableValue) -> str:
    return f"{plus_minus(100 * figure.value, 100 * BEYOND * figure.repeatability)} %"


# A comparison as JSON, in a stable schema.
#
# The object has these members; names end in their unit, numbers have nine significant digits, and unknown or undefined
# values are null. Members may be added within a version, never renamed or removed. Levels are in dB re one unit, rms;
# each ``difference_db`` is simulated minus recorded; each ``repeatability`` is a standard error from the halves of the
# records.
#
# - ``schema``: "gearsig.comparison", ``schema_version``: 1, ``gearsig_version``
# - ``verdict``: the largest differences per channel; ``findings``: further ones; ``notes``: limitations of the figures
# - ``simulated``, ``recorded``: ``source``, ``sha256``, ``duration_s``, ``sampling_rate_hz``, ``mean_speed_rpm``,
#   ``speed_range_rpm``, ``n_revolutions``, ``speed_method``, ``notes``
# - ``machine``, ``reference_shaft``, ``mesh_orders``, ``highest_order``
# - ``alignments``: per shaft ``shaft``, ``method`` ("marks" or "correlation"), ``shift_deg``, ``repeatability_deg``,
#   ``tooth_is_certain``, ``best_shift_deg``, ``gain``
# - ``channels``: each with ``simulated_name``, ``recorded_name``, ``quantity``, ``unit``, ``levels_compare``;
#   ``overall``, a level; ``locked``: shares of energy that turn with the shafts, ``simulated`` and ``recorded``;
#   ``lines`` and ``other_lines``: ``label``, ``kind``, ``order``, ``shaft``, ``simulated_is_seen``,
#   ``recorded_is_seen`` and a level; ``order_bands`` and ``third_octaves``: ``label``, ``low``, ``high``, ``axis``, a
#   level, ``agreement`` (or null); ``shafts``: ``shaft``, ``n_teeth``, ``correlation``, ``simulated_reliability``,
#   ``recorded_reliability``, ``agreement``, ``tooth_levels``
# - a level: ``simulated_db``, ``recorded_db``, ``difference_db``, ``repeatability_db``, ``is_beyond``
# - an agreement: ``complex_frac`` and ``magnitude_frac`` with ``value`` and ``repeatability``, ``complex_by_chance``,
#   ``n_lines``
LAYOUTS = {
    ChannelComparison: Layout(left_out=("simulated_spectrum", "recorded_spectrum")),
    ShaftComparison: Layout(left_out=("simulated", "recorded")),
    LineLevel: Layout(inline=("level",)),
    BandLevel: Layout(inline=("level",)),
    LevelPair: Layout(properties=("difference_db", "is_beyond")),
}


def comparison_to_json(comparison: Comparison) -> str:
    """Return a comparison as JSON text, without waveforms and spectra."""
    return document("gearsig.comparison", plain(comparison, layouts=LAYOUTS))
