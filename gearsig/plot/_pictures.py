"""Figures embedded in a single-file page: small SVG without matplotlib, and matplotlib's figures as data URIs.

Text and axes of the small SVG inherit the colour of the surrounding text, so that they suit light and dark pages.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from io import BytesIO
from itertools import pairwise
from math import ceil, floor, log10
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.fleet import OperatingTrend, Trend
from gearsig.formatting import unit_text
from gearsig.orders import SynchronousAverage
from gearsig.plot import _style as style
from gearsig.plot._cursors import AngleMark, Cursor
from gearsig.plot._panels import ChartLine, LevelPanel, LinePanel, cell_limits, line_colour, pooled_levels

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image

PNG_DOTS_PER_INCH = 128  # 1152 pixels for 900 on the page: sharp, and eight figures stay below 250 kB
N_BLENDS = 12  # steps from each of the style's colours to white, for anti-aliased edges
N_LEVELS = 124  # steps of the colours of maps


@dataclass(frozen=True)
class Picture:
    """A figure ready for a page.

    Parameters
    ----------
    uri : str
    width_px, height_px : int
        On the page.
    caption : str
        One sentence on what to look for.
    alternative : str
        Text alternative for readers who cannot see the picture.
    svg : str
        An inline <svg> element instead of an address.
    title : str
        What is drawn; empty if the figure itself says so.
    """

    uri: str
    width_px: int
    height_px: int
    caption: str
    alternative: str
    svg: str = ""
    title: str = ""

    @classmethod
    def of_svg(cls, svg: str, caption: str, alternative: str, title: str = "") -> Picture:
        """Return a picture of an <svg> element with a viewBox from 0 0."""
        width, height = re.findall(r'viewBox="0 0 (\d+)[\d.]* (\d+)', svg)[0]
        inline = svg.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)  # HTML implies the namespace
        return cls("", int(width), int(height), caption, alternative, inline, title)


@dataclass(frozen=True)
class CaptionedFigure:
    """A figure with caption and text alternative; see `Picture`."""

    figure: Figure
    caption: str
    alternative: str


def embed(figure: Figure, caption: str, alternative: str, *, vector: bool = False) -> Picture:
    """Convert a figure to a picture: PNG, or SVG with `vector`, for figures of few lines."""
    width, height = figure.get_size_inches()
    uri = "data:image/svg+xml;base64," + b64encode(figure_svg(figure).encode()).decode() if vector else _png(figure)
    return Picture(uri, round(100 * width), round(100 * height), caption, alternative)


def figure_svg(figure: Figure, *, transparent: bool = False) -> str:
    """Return a figure as SVG in the font of the surrounding page.

    Parameters
    ----------
    figure : Figure
    transparent : bool
        Whether to leave out the background.
    """
    from matplotlib import rc_context

    buffer = BytesIO()
    with rc_context({"svg.fonttype": "none"}):
        metadata = {"Date": None, "Creator": None}
        figure.savefig(buffer, format="svg", metadata=metadata, transparent=transparent)
    return buffer.getvalue().decode().replace("'DejaVu Sans'", "system-ui, 'DejaVu Sans'")


def _png(figure: Figure) -> str:
    from PIL import Image

    pixels, buffer = BytesIO(), BytesIO()
    figure.savefig(pixels, format="png", dpi=PNG_DOTS_PER_INCH, pil_kwargs={"compress_level": 0})
    image = Image.open(pixels).convert("RGB")
    # A palette needs a third of the size; a fixed one keeps the colours of small marks, unlike an adaptive one.
    image.quantize(palette=_palette(), dither=Image.Dither.NONE).save(buffer, format="png", optimize=True)
    return "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")


@cache
def _palette() -> Image.Image:
    """Return the palette of all colours in figures."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    named = {
        *style.CURSOR_COLOURS.values(),
        style.MEASURED,
        style.SIMULATED,
        style.FAULT,
        style.FLOOR,
        style.INK,
        style.QUIET,
        style.RULE,
    }
    blends = [
        [1 - share * (1 - part) for part in to_rgb(colour)]
        for colour in sorted(named)
        for share in (step / N_BLENDS for step in range(1, N_BLENDS + 1))
    ]
    levels = [style.colours()(step / (N_LEVELS - 1))[:3] for step in range(N_LEVELS)]
    # Pillow looks colours up in steps of 4 of 255: no other colour may be so close to the white of the paper.
    tinted = [colour for colour in [*blends, *levels] if min(colour) < 0.965]
    numbers = [round(255 * part) for colour in [(1.0, 1.0, 1.0), *tinted] for part in colour]
    palette = Image.new("P", (1, 1))
    palette.putpalette(numbers)
    return palette


# --------------------
# Panels and rings as small SVG, for pages of many recordings and for the dashboard.
# --------------------


LEFT, RIGHT, BOTTOM, ROW, BAR = 62, 12, 38, 14, 46
N_COLUMNS, N_ROWS = 420, 160
N_SHADES = 48
MAX_IMAGE_BYTES = 24_000
"""Levels of gears compress to half of it; pure noise does not, but then a quarter of the pixels shows as much."""
MAX_ROWS = 4
LETTER = 6.2
"""Width of a character in units of the drawing, to keep labels apart."""


def svg_panel(
    panel: LinePanel | LevelPanel,
    *,
    marked: Sequence[tuple[float, float]] = (),
    width: int = 760,
    height: int | None = None,
) -> str:
    """Draw a panel of lines, or of levels as the maximum in each pixel with a colour bar.

    Cursor labels without room are left out, but families keep their first. Several lines are named above the panel.

    Parameters
    ----------
    panel : LinePanel or LevelPanel
    marked : sequence of (x, y)
        Points on lines, named by findings.
    width, height : int
        Width of the drawing and height of its panel; None: 170 for lines, 230 for levels.

    Returns
    -------
    str
        An <svg> element.
    """
    if isinstance(panel, LevelPanel):
        return _svg_levels(panel, width, height or 230)
    ends = [end for line in panel.lines for end in (float(line.x[0]), float(line.x[-1]))]
    limits = panel.x_limits or (min(ends), max(ends))
    shown = [_columns(line, limits) for line in panel.lines]
    low, high = panel.limits or _padded_range([y for _, y in shown], logarithmic=panel.logarithmic)
    labels, n_rows = _placed(panel.cursors, limits, width)
    names, names_height = _names(panel.lines, width) if len(panel.lines) > 1 else ([], 0)
    top, height = 8 + ROW * n_rows + names_height, height or 170
    frame = _Panel(LEFT, top, width - LEFT - RIGHT, height, limits, (low, high), panel.logarithmic)
    parts = [frame.span(*span) for span in panel.spans]
    parts += [frame.axes(panel.x, panel.y, dates=panel.dates), frame.cursors(panel.cursors, labels)]
    parts += [frame.band(line, limits) for line in panel.lines if line.band is not None]
    parts += [frame.line(line, *places) for line, places in zip(panel.lines, shown, strict=True)]
    parts += [
        f'<circle cx="{frame.across(at):.1f}" cy="{frame.up(value):.1f}" r="6" fill="none" stroke="{style.FAULT}" '
        'stroke-width="1.8"/>'
        for at, value in marked
        if limits[0] <= at <= limits[1]
    ]
    return _svg(width, top + height + BOTTOM, [*parts, *names])


def _image_of_levels(panel: LevelPanel, n_columns: int, n_rows: int) -> bytes:
    """Return the levels as PNG, with the maximum of each pixel."""
    from PIL import Image

    levels, _ = pooled_levels(panel.levels, panel.positions, n_columns, n_rows, logarithmic=panel.logarithmic)
    high, span = _range_of(panel)
    shade = np.clip(255 * (levels - high + span) / span, 0, 255).astype(np.uint8)
    colours, buffer = style.level_colours(), BytesIO()
    image = Image.fromarray(colours[shade[::-1]]).quantize(N_SHADES, dither=Image.Dither.NONE)
    image.save(buffer, format="png", optimize=True)
    return buffer.getvalue()


def _range_of(panel: LevelPanel) -> tuple[float, float]:
    """Return the maximum level, and the span of the colours below it."""
    return float(panel.levels.max()), 60.0 if panel.span is None else panel.span


def _svg_levels(panel: LevelPanel, width: int, height: int) -> str:
    image = _image_of_levels(panel, N_COLUMNS, N_ROWS)
    if len(image) > MAX_IMAGE_BYTES:
        image = _image_of_levels(panel, N_COLUMNS // 2, N_ROWS // 2)
    uri, colours = b64encode(image).decode("ascii"), style.level_colours()
    high, span = _range_of(panel)
    x_limits = (float(panel.at[0]), float(panel.at[-1]))
    y_limits = cell_limits(panel.positions, logarithmic=panel.logarithmic)
    labels, n_rows = _placed(panel.cursors, x_limits, width - BAR)
    top = 10 + ROW * n_rows
    frame = _Panel(LEFT, top, width - LEFT - RIGHT - BAR, height, x_limits, y_limits, panel.logarithmic)
    picture = (
        f'<image href="data:image/png;base64,{uri}" x="{LEFT}" y="{top}" width="{frame.width}" height="{height}" '
        'preserveAspectRatio="none"/>'
    )
    parts = [picture, frame.axes(panel.x, panel.y, grid=False), frame.cursors(panel.cursors, labels, through=False)]
    parts += [frame.line(line, *_columns(line, x_limits)) for line in panel.lines]
    left, n = width - RIGHT - BAR + 12, 32
    for k in range(n):
        red, green, blue = colours[255 - 255 * k // (n - 1)]
        tint = f"#{red:02x}{green:02x}{blue:02x}"
        parts.append(f'<path d="M{left} {top + height * k / n:g}h9v{height / n:g}h-9z" fill="{tint}" stroke="{tint}"/>')
    ends = ((top + 9, high), (top + height, high - span))
    parts += [f'<text x="{left + 13}" y="{y}">{_number(float(f"{level:.3g}"))}</text>' for y, level in ends]
    middle = f"translate({left + 24} {top + height / 2}) rotate(-90)"
    parts.append(f'<text transform="{middle}" text-anchor="middle">{escape(style.cut(panel.unit, 40))}</text>')
    return _svg(width, top + height + BOTTOM, parts)


def svg_ring(
    average: SynchronousAverage,
    *,
    n_teeth: int | None = None,
    marks: Sequence[AngleMark] = (),
    numbered: bool = True,
    ink: str = "",
    line: str = style.MEASURED,
) -> str:
    """Draw one mean revolution around the circle with the gear's teeth, marked ones in the fault colour.

    The angle runs clockwise from the top, where the average and tooth 1 start; without tooth numbers, quarters are
    marked. Outwards is positive.

    Parameters
    ----------
    average : SynchronousAverage
    n_teeth : int or None
        Of the gear.
    marks : sequence of AngleMark
    numbered : bool
        Whether to number the teeth; a shaft without a reference mark has no tooth numbers.
    ink : str
        Colour of text and axes; empty: that of the surrounding text.
    line : str
        Colour of the average.
    """
    size, zero, swing, rim = 400, 84.0, 48.0, 141.0
    full = float(np.max(np.abs(average.values), initial=0.0)) or 1.0
    n = len(average.values)
    turn = np.arange(n + 1) * (2 * np.pi / n)
    at, values = _columns(
        ChartLine(turn, np.append(average.values, average.values[0])), (0.0, 2 * np.pi), n_columns=480
    )
    round_value = 10 ** floor(log10(full)) * next(m for m in (5, 2, 1) if m * 10 ** floor(log10(full)) <= full)
    parts = [
        f'<circle r="{zero + swing * k * round_value / full:.1f}" fill="none" stroke="currentColor" '
        f'stroke-opacity="{0.45 if k == 0 else 0.18}"/>'
        for k in (-1, 0, 1)
    ]
    step = 2 * np.pi / n_teeth if n_teeth else 0.0
    hurt = {int(mark.angle_deg / 360 * (n_teeth or 1)) for mark in marks}
    for tooth in range(n_teeth or 0):
        middle, fault = (tooth + 0.5) * step, tooth in hurt
        shape = [(rim, 0.36), (rim + 5, 0.34), (rim + 13, 0.17), (rim + 13, -0.17), (rim + 5, -0.34), (rim, -0.36)]
        points = "L".join("{:.1f} {:.1f}".format(*_round(r, middle + w * step)) for r, w in shape)
        looks = f'fill="{style.FAULT}"' if fault else 'fill="currentColor" fill-opacity="0.28"'
        parts.append(f'<path d="M{points}Z" {looks}/>')
        if numbered and (fault or tooth % ceil((n_teeth or 1) / 40) == 0):
            x, y = _round(rim + 24, middle)
            bold = f'fill="{style.FAULT}" font-weight="700" font-size="15"' if fault else 'font-size="12" opacity="0.7"'
            parts.append(f'<text x="{x:.1f}" y="{y + 4.3:.1f}" text-anchor="middle" {bold}>{tooth + 1}</text>')
    for quarter in range(0 if n_teeth and numbered else 4):
        x, y = _round(rim + 24, quarter * np.pi / 2)
        looks = 'text-anchor="middle" font-size="12" opacity="0.7"'
        parts.append(f'<text x="{x:.1f}" y="{y + 4.3:.1f}" {looks}>{90 * quarter}°</text>')
    parts.append(f'<circle r="{rim}" fill="none" stroke="currentColor" stroke-opacity="0.45"/>')
    for mark in marks:
        half = step / 2 or 0.05
        points = "L".join("{:.1f} {:.1f}".format(*_round(rim, np.radians(mark.angle_deg) + w)) for w in (-half, half))
        parts.append(f'<path d="M0 0L{points}Z" fill="{style.FAULT}" fill-opacity="0.16"/>')
    radius = zero + swing * values / full
    d = _path(radius * np.sin(at), -radius * np.cos(at))
    parts.append(f'<path d="{d}" fill="none" stroke="{line}" stroke-width="1.3" stroke-linejoin="round"/>')
    of = average.shaft or "the shaft"
    note = f"{average.kind} of {of}, {average.channel}, {average.n_revolutions} revolutions"
    scale = f"rings: ± {round_value:g} {unit_text(average.unit)}".rstrip()
    parts += [
        f'<text x="-198" y="-185" font-size="14" opacity="0.8">{escape(style.plain(note, 50))}</text>',
        f'<text x="-198" y="195" font-size="14" opacity="0.8">{escape(scale)}</text>',
    ]
    for i, mark in enumerate(marks):
        looks = f'font-size="15" font-weight="700" fill="{style.FAULT}"'
        parts.append(
            f'<text x="198" y="{195 - 17 * i}" text-anchor="end" {looks}>{escape(style.cut(mark.label, 50))}</text>'
        )
    moved = f'<g transform="translate({size / 2} {size / 2})">{"".join(parts)}</g>'
    return _svg(size, size, [moved], ink=ink)


@dataclass(frozen=True)
class _Panel:
    """A rectangle with its two axes."""

    left: float
    top: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]
    logarithmic: bool

    def across(self, values: float | FloatArray) -> FloatArray:
        return np.asarray(self.left + (values - self.x[0]) / (self.x[1] - self.x[0]) * self.width)

    def up(self, values: float | FloatArray) -> FloatArray:
        low, high = self.y
        if self.logarithmic:
            share = np.log(np.maximum(values, low * 1e-3) / low) / np.log(high / low)
        else:
            share = (np.asarray(values) - low) / (high - low)
        return np.asarray(self.top + (1 - np.clip(share, -0.02, 1.02)) * self.height)

    def path(self, x: FloatArray, y: FloatArray) -> str:
        known = np.isfinite(y)
        starts = np.flatnonzero(np.diff(known, prepend=False) & known)
        stops = np.flatnonzero(np.diff(known, append=False) & known) + 1
        return "".join(_path(self.across(x[a:b]), self.up(y[a:b])) for a, b in zip(starts, stops, strict=True))

    def line(self, line: ChartLine, x: FloatArray, y: FloatArray) -> str:
        """Draw the visible points of a line."""
        stroke, dash = line_colour(line.colour), ' stroke-dasharray="2 4"' if line.dotted else ""
        return f'<path d="{self.path(x, y)}" fill="none" stroke="{stroke}" stroke-width="1.1"{dash}/>'

    def band(self, line: ChartLine, limits: tuple[float, float]) -> str:
        """Draw the pale band behind a line."""
        low, high = (_columns(ChartLine(line.x, edge), limits) for edge in line.band or ())
        x, y = np.concatenate([low[0], high[0][::-1]]), np.concatenate([low[1], high[1][::-1]])
        return f'<path d="{self.path(x, y)}Z" fill="{line_colour(line.colour)}" fill-opacity="0.2"/>'

    def span(self, low: float, high: float, colour: str) -> str:
        """Shade a part of the x axis."""
        left, right = (float(self.across(end)) for end in (low, high))
        place = f'x="{left:.1f}" y="{self.top}" width="{max(right - left, 2.0):.1f}" height="{self.height}"'
        return f'<rect {place} fill="{colour}" fill-opacity="0.5"/>'

    def axes(self, x: str, y: str, *, grid: bool = True, dates: bool = False) -> str:
        bottom, right = self.top + self.height, self.left + self.width
        n = max(3, round(self.height / 45))
        values = _decades(*self.y, self.height / 16) if self.logarithmic else _ticks(*self.y, n)
        parts = []
        for value in values:
            at = float(self.up(value))
            line = (
                f'<path d="M{self.left} {at:.1f}H{right}" stroke="currentColor" stroke-opacity="0.13"/>' if grid else ""
            )
            parts.append(
                f'{line}<text x="{self.left - 6}" y="{at + 3.5:.1f}" text-anchor="end">{_number(value)}</text>'
            )
        for value in _days(*self.x) if dates else _ticks(*self.x, 8):
            at, text = float(self.across(value)), str(np.datetime64(int(value), "D")) if dates else _number(value)
            parts.append(
                f'<path d="M{at:.1f} {bottom}v4" stroke="currentColor" stroke-opacity="0.5"/>'
                f'<text x="{at:.1f}" y="{bottom + 15}" text-anchor="middle">{text}</text>'
            )
        middle, x, y = self.top + self.height / 2, escape(style.cut(x, 90)), escape(style.cut(y, 40))
        return (
            f'<path d="M{self.left} {bottom}H{right}" stroke="currentColor" stroke-opacity="0.5"/>{"".join(parts)}'
            f'<text x="{(self.left + right) / 2}" y="{bottom + 32}" text-anchor="middle">{x}</text>'
            f'<text transform="translate(11 {middle}) rotate(-90)" text-anchor="middle">{y}</text>'
        )

    def cursors(self, cursors: Sequence[Cursor], labels: Sequence[tuple[Cursor, int]], *, through: bool = True) -> str:
        parts = []
        for kind in dict.fromkeys(cursor.kind for cursor in cursors):
            at = [
                float(self.across(c.position))
                for c in cursors
                if c.kind == kind and self.x[0] <= c.position <= self.x[1]
            ]
            d = "".join(f"M{value:.1f} {self.top}v{self.height if through else -5}" for value in at)
            colour = style.CURSOR_COLOURS.get(kind, style.FAULT)
            dash = "" if kind == "mesh" else ' stroke-dasharray="4 3"'
            parts.append(f'<path d="{d}" stroke="{colour}" stroke-opacity="0.55"{dash}/>')
        for cursor, row in labels:
            colour = style.CURSOR_COLOURS.get(cursor.kind, style.FAULT)
            x, y = float(self.across(cursor.position)), self.top - 4 - ROW * row
            parts.append(
                f'<text x="{x:.1f}" y="{y}" text-anchor="middle" fill="{colour}">{escape(cursor.label[:28])}</text>'
            )
        return "".join(parts)


def _path(x: FloatArray, y: FloatArray) -> str:
    """Return a path of relative steps, rounded to a tenth of a unit: half the characters of absolute positions.

    Examples
    --------
    >>> _path(np.array([1.0, 1.3, 11.0]), np.array([2.0, 1.5, 1.5]))
    'M1 2l.3-.5 9.7 0'
    """
    places = np.rint(10 * np.column_stack([x, y])).astype(int)
    steps = " ".join(f"{across / 10:g} {up / 10:g}" for across, up in np.diff(places, axis=0))
    steps = re.sub(r"\b0\.", ".", steps).replace(" -", "-")  # redundant: a fifth of the characters
    return f"M{places[0, 0] / 10:g} {places[0, 1] / 10:g}" + (f"l{steps}" if steps else "")


def _placed(cursors: Sequence[Cursor], limits: tuple[float, float], width: int) -> tuple[list[tuple[Cursor, int]], int]:
    """Return cursors with the rows of their labels, and the number of rows."""
    rows: list[list[tuple[float, float]]] = [[] for _ in range(MAX_ROWS)]
    placed = []
    for cursor in sorted(cursors, key=lambda c: c.number):
        x = LEFT + (cursor.position - limits[0]) / (limits[1] - limits[0]) * (width - LEFT - RIGHT)
        half = LETTER * len(cursor.label[:28]) / 2 + 3
        if not LEFT <= x <= width - RIGHT or x + half > width or x - half < 0:
            continue
        row = next((i for i, spans in enumerate(rows) if all(x + half < a or x - half > b for a, b in spans)), None)
        if row is not None:
            rows[row].append((x - half, x + half))
            placed.append((cursor, row))
    return placed, sum(bool(row) for row in rows)


def _names(lines: Sequence[ChartLine], width: int) -> tuple[list[str], int]:
    """Return the names of lines arranged in rows, and the total height."""
    parts, x, y = [], float(LEFT), 10
    for line in lines:
        if name := style.cut(line.name, 40):
            reach = 21 + LETTER * len(name)
            if x > LEFT and x + reach > width - RIGHT:
                x, y = float(LEFT), y + 16
            parts.append(
                f'<path d="M{x} {y}h16" stroke="{line_colour(line.colour)}" stroke-width="3"/>'
                f'<text x="{x + 21}" y="{y + 4}">{escape(name)}</text>'
            )
            x += reach + 18
    return parts, y + 6


def _columns(line: ChartLine, limits: tuple[float, float], n_columns: int = N_COLUMNS) -> tuple[FloatArray, FloatArray]:
    """Return the points of a line to draw: the extremes of each column, at their own positions."""
    start = max(int(np.searchsorted(line.x, limits[0])), 0)
    stop = max(int(np.searchsorted(line.x, limits[1], side="right")), start + 1)
    x, y = np.asarray(line.x[start:stop]), np.asarray(line.y[start:stop])
    if len(x) <= 2 * n_columns:
        return x, y
    borders = list(pairwise(np.linspace(0, len(x), n_columns + 1).astype(int)))
    chosen = [a + int(np.argmax(y[a:b])) for a, b in borders]  # the first gap, if any: argmax treats nan as the maximum
    if not line.peaks:
        chosen += [a + int(np.argmin(y[a:b])) for a, b in borders]
    at = np.unique(chosen)
    return x[at], y[at]


def _padded_range(curves: Sequence[FloatArray], *, logarithmic: bool) -> tuple[float, float]:
    values = np.concatenate([curve[np.isfinite(curve)] for curve in curves] or [np.zeros(1)])
    if logarithmic and (values > 0).any():
        high = float(values.max())
        return max(float(np.percentile(values[values > 0], 5)), high * 1e-6) / 2, 2 * high
    return style.padded(values)


def _ticks(low: float, high: float, n: int) -> list[float]:
    rough = (high - low) / n
    power = 10.0 ** floor(log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= 0.999 * rough)
    return [k * step for k in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def _days(low: float, high: float) -> list[float]:
    """Return up to six equally spaced whole days."""
    first, last = ceil(low), floor(high)
    return [float(day) for day in range(first, last + 1, max(ceil((last - first) / 5), 1))]


def _decades(low: float, high: float, n_max: float = 8) -> list[float]:
    """Return ticks of a logarithmic axis: powers of ten, and two between each if there is room."""
    steps = [m * 10.0**k for k in range(floor(log10(low)), ceil(log10(high)) + 1) for m in (1, 2, 5)]
    inside = [step for step in steps if low * (1 - 1e-9) <= step <= high * (1 + 1e-9)]
    if len(inside) <= n_max:
        return inside
    powers = range(ceil(log10(low) - 1e-9), floor(log10(high) + 1e-9) + 1)
    return [10.0**k for k in powers[:: max(1, len(powers) // 6)]]


def _number(value: float) -> str:
    text = f"{value:.6g}" if value == 0 or 1e-3 <= abs(value) < 1e6 else f"{value:.0e}".replace("e-0", "e-")
    return text.replace("-", "−")


def _round(radius: float, angle: float) -> tuple[float, float]:
    return float(radius * np.sin(angle)), float(-radius * np.cos(angle))


def _svg(width: float, height: float, parts: Sequence[str], *, ink: str = "") -> str:
    colour = f' color="{ink}"' if ink else ""
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-size="11" '
        f'font-family="system-ui, DejaVu Sans, sans-serif" fill="currentColor"{colour}>{"".join(parts)}</svg>'
    )


# --------------------
# An indicator over months, load or speed with its limits: a fleet's report has many.
# --------------------


N_SHOWN = 1500
"""Number of latest recordings drawn over time: more than there are columns."""


def trend_panel(trend: Trend | OperatingTrend) -> tuple[LinePanel, list[tuple[float, float]]]:
    """Return a panel of an indicator with its limits, over dates, load or speed, and the points that exceed them.

    The axis is logarithmic if all values are positive, so that equal ratios look equal.

    Parameters
    ----------
    trend : Trend or OperatingTrend
    """
    if isinstance(trend, Trend):
        table = limits = trend.table.tail(N_SHOWN)
        at = along = table["date"].to_numpy("datetime64[s]").astype(np.float64) / 86400.0
        series, value, x, margin = trend, table["value"].to_numpy(np.float64), "date", 0.5
        lines = [ChartLine(at, value, series.name)]
    else:
        series, table, limits = trend.trend, trend.table, trend.curve
        at, along = table.iloc[:, 0].to_numpy(np.float64), limits.iloc[:, 0].to_numpy(np.float64)
        value, margin = table["adjusted"].to_numpy(np.float64), 1e-3 * float(at.max())
        x = "load (N·m)" if trend.over == "load" else "speed (rpm)"
        is_baseline = (table["level"] == "baseline").to_numpy()
        lines = [
            ChartLine(at[chosen], value[chosen], words, colour, dots=True)
            for chosen, words, colour in ((is_baseline, "baseline", 2), (~is_baseline, series.name, 0))
            if chosen.any()
        ]
    expected, low, high, alarm = (limits[name].to_numpy(np.float64) for name in ("expected", "low", "high", "alarm"))
    known = np.isfinite(high)
    shown = np.concatenate([value[np.isfinite(value)], expected[known], high[known]])
    is_log = bool((shown > 0.0).all())
    ends = _trend_range(shown, is_log=is_log)
    if known.any():
        band = np.where(np.isfinite(low), np.maximum(low, ends[0]), ends[0])[known], high[known]
        lines = [ChartLine(along[known], expected[known], "expected, within its limits", -1, band=band), *lines]
    if np.isfinite(alarm).any():
        lines = [*lines, ChartLine(along, alarm, "alarm", 1, dotted=True)]
    beyond = table["level"].isin(["warning", "alarm"]).to_numpy() & np.isfinite(value)
    first, last = float(min(at.min(), along.min())), float(max(at.max(), along.max()))
    margin = max(0.02 * (last - first), margin)
    baseline, cursors = at[:0], []
    if isinstance(trend, Trend):
        baseline = at[table["in_baseline"].to_numpy(np.bool_)]
        changed = np.nan if trend.changed is None else np.datetime64(trend.changed, "s").astype(np.float64) / 86400.0
        cursors = [Cursor(float(changed), "finding", "changed", 0)] if first <= changed <= last else []
    panel = LinePanel(
        lines,
        x,
        style.with_unit(series.name, series.unit),
        ends,
        is_log,
        cursors,
        x_limits=(first - margin, last + margin),
        spans=[(float(baseline[0]), float(baseline[-1]), style.RULE)] if len(baseline) else (),
        dates=isinstance(trend, Trend),
    )
    return panel, list(zip(at[beyond].tolist(), value[beyond].tolist(), strict=True))


def _trend_range(shown: FloatArray, *, is_log: bool) -> tuple[float, float]:
    low, high = float(shown.min()), float(shown.max())
    if is_log:
        return low / 1.15, high * 1.15
    margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin
