"""Zoomable figures with readouts and named cursors; pictures; ranges."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from colorsys import hls_to_rgb, rgb_to_hls
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from itertools import pairwise
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
import streamlit as st
from numpy.typing import NDArray

from app.dashboard import address, state
from app.dashboard.components import component_of, element_key
from app.dashboard.theme import DARK_PAPER, DASHES, Palette, is_dark, palette
from app.dashboard.widgets.texts import as_typed, one_line
from gearsig.checks import FloatArray
from gearsig.formatting import axis_unit, csv_text
from gearsig.plot import (
    LONGEST,
    ChartLine,
    Cursor,
    LevelPanel,
    LinePanel,
    RowPanel,
    cell_limits,
    figure_svg,
    figure_table,
    importance,
    panels_of,
    plain,
    pooled_levels,
)
from gearsig.spectra import LARGEST_SLIP

if TYPE_CHECKING:
    from matplotlib.figure import Figure as PictureFigure

MEASURED, FAULT, SHAFT, QUIET = 0, 1, 4, -1
"""Colours of lines by meaning; further numbers are further colours."""


def show_differences(
    at: FloatArray,
    off: FloatArray,
    beyond: NDArray[np.bool_],
    name: str,
    key: str,
    shown: tuple[float, float],
    words: str,
) -> None:
    """Show differences in dB, grey where they are explained, over the range that another figure shows.

    Parameters
    ----------
    at, off : array, (n,)
        Positions, and differences in dB.
    beyond : array of bool, (n,)
        Whether a difference is not explained by scatter or floor.
    name, words : str
        Of the axes: what the positions are, and what is subtracted from what.
    key : str
    shown : (float, float)
    """
    if not len(at):
        return
    lines = [
        stems(at[chosen], off[chosen], label, colour)
        for chosen, label, colour in ((~beyond, "within the floor", QUIET), (beyond, "beyond the floor", FAULT))
        if chosen.any()
    ]
    panel = LinePanel(lines, name, f"{words} (dB)", padded_limits([off, np.zeros(1)]), x_limits=shown)
    # its own zoom yields to that of the figure above
    show_lines(panel, f"{key} {shown[0]:.4g} {shown[1]:.4g}", height_px=180, legend=True)


def stems(x: FloatArray, y: FloatArray, name: str, colour: int) -> ChartLine:
    """Return a line that rises from zero to each value, in ascending order of x."""
    order = np.argsort(x)
    bottom_top_gap = np.stack([np.zeros(len(x)), y[order], np.full(len(x), np.nan)], axis=1)
    return ChartLine(np.repeat(x[order], 3), bottom_top_gap.ravel(), name, colour)


def padded_limits(curves: Sequence[FloatArray], *, flat: float = 1.0) -> tuple[float, float]:
    """Return limits around all finite values of several curves; if they are constant, `flat` to either side."""
    known = [curve for curve in curves if np.isfinite(curve).any()]
    low = min((float(np.nanmin(curve)) for curve in known), default=0.0)
    high = max((float(np.nanmax(curve)) for curve in known), default=1.0)
    margin = 0.06 * (high - low) or flat
    return low - margin, high + margin


def show_panel(panel: LinePanel | LevelPanel, key: str, span_db: float) -> None:
    """Show a method's panel, zoomable; in a map, levels down to `span_db` below the largest have colours."""
    if panel.title:
        st.caption(as_typed(panel.title))
    if isinstance(panel, LevelPanel):
        show_map(panel, key, dynamic_range_db=span_db)
    else:
        show_lines(panel, key, legend=len({line.name for line in panel.lines if line.name}) > 1)


def show_figure(figure: PictureFigure, words: str, key: str) -> None:
    """Show a figure as zoomable panels, or else as a picture; `words` describe it for those who cannot see it.

    Parameters
    ----------
    figure : Figure
        Of matplotlib.
    words : str
    key : str
        Of its widgets, unique on the page.
    """
    rows = panels_of(figure)
    if not rows:
        show_picture(figure_svg(figure, transparent=True), figure, words, key)
    place = st.container(key=f"panels {key}")
    for i, row in enumerate(rows):
        columns = place.columns(len(row)) if len(row) > 1 else [place.container()]
        for k, (column, panels) in enumerate(zip(columns, row, strict=True)):
            for n, panel in enumerate(panels):
                with column:
                    show_panel(panel, f"{key} {i}{k}{n}", 60.0)


_figure = component_of("figure")
N_COLUMNS = 1600
"""Columns of a long line sent to the browser: more than a page has pixel columns."""
MAP_COLUMNS, MAP_ROWS = 900, 360


def zoomed_range(key: str, whole: tuple[float, float], first: tuple[float, float] | None = None) -> tuple[float, float]:
    """Return the axis range that the figure with this key was zoomed to, `first` until then.

    The page's address keeps the latest one, so that a view can be shared.
    """
    ends = _zoomed(key)
    is_whole = len(ends) == 2 and ends[0] <= whole[0] and ends[1] >= whole[1]
    if ends and not is_whole:
        address.put(address.ZOOM, "_".join([_name(key), *(f"{end:.7g}" for end in ends)]))
    elif is_whole and address.now(address.ZOOM).startswith(f"{_name(key)}_"):
        address.put(address.ZOOM)
    low, high = ends[:2] or first or whole
    low, high = max(low, whole[0]), min(high, whole[1])
    return (low, high) if low < high else whole


def _zoomed(key: str) -> list[float]:
    """Return what a figure was zoomed to: low and high, for a plane also those of y; empty if it was not zoomed.

    The session keeps it: Streamlit forgets the state of a figure that is not shown.
    """
    if address.follows(key) or key not in state.zooms():
        state.zooms()[key] = _asked_zoom(key)
    return state.zooms()[key]


def _asked_zoom(key: str) -> list[float]:
    named, *words = address.now(address.ZOOM).split("_")
    return _ends(words) if named == _name(key) else []


def _ends(values: object) -> list[float]:
    """Return the ends of a range that an address or a browser gives; empty if they are not valid."""
    with suppress(TypeError, ValueError):
        ends = [float(value) for value in values]  # type: ignore[attr-defined]
        if len(ends) in (2, 4) and np.all(np.isfinite(ends)) and ends[-2] < ends[-1] and ends[0] < ends[1]:
            return ends
    return []


def _take_zoom(key: str) -> None:
    """Keep the range that the user zoomed a figure to."""
    ends = _ends(st.session_state[element_key(key)]["range"])
    if ends:
        state.zooms()[key] = ends


def _name(key: str) -> str:
    """Return what the address calls a figure."""
    return f"{crc32(key.encode()):x}"


def show_lines(
    panel: LinePanel,
    key: str,
    *,
    marked: Sequence[tuple[float, float]] = (),
    height_px: int = 340,
    legend: bool = False,
    whole: tuple[float, float] | None = None,
    per_unit: tuple[float, str] | None = None,
    step: float | None = None,
    front_first: bool = False,
    log_x: bool = False,
) -> None:
    """Show lines with cursors and marked points; long lines are reduced to the extremes of each pixel column shown.

    Parameters
    ----------
    panel : LinePanel
        Its lines at full length: zooming sends their detail. Those of a plane are sent whole.
    key : str
        Of the widget, unique on the page.
    marked : sequence of (x, y)
        Points that findings name.
    height_px : int
        Without labels and legend.
    legend : bool
        Name several lines above the chart.
    whole : (float, float) or None
        Limits of zooming out; None: the axis limits, which otherwise are the range shown at first.
    per_unit : (float, str) or None
        One unit of the x axis in another unit, for the readout of cursors.
    step : float or None
        Sideband spacing that is offered first.
    front_first : bool
        Name the line in front, which is the last, first.
    log_x : bool
        Whether the x axis is logarithmic, as for third octaves.
    """
    lines, is_plane = panel.lines, panel.is_plane
    limits = panel.x_limits or (min(float(line.x.min()) for line in lines), max(float(line.x.max()) for line in lines))
    ends = whole or limits
    shown = zoomed_range(key, ends, limits)
    data = _described(panel.x, panel.y, key, shown, ends, height_px) | {
        "has_tools": height_px >= 200 and not is_plane,
        "log": panel.logarithmic,
        "lines": [_sent(line, None if is_plane else shown, alone=len(lines) == 1) for line in lines],
        "cursors": _cursor_rows(panel.cursors, palette(), lines[-1] if lines and not is_plane else None, shown),
        "dates": panel.dates,
        "marked": [[float(x), float(y)] for x, y in marked],
        "legend": legend,
        "front_first": front_first,
        "log_x": log_x,
        "limits": panel.limits,
        "per_unit": per_unit,
        "step": step,
        "spans": list(panel.spans),
        "plane": is_plane,
        "across": _zoomed(key)[2:] or None if is_plane else None,
    }
    _figure(key=key, data=data, on_range_change=partial(_take_zoom, key), default={"range": None})


def show_map(
    panel: LevelPanel,
    key: str,
    *,
    dynamic_range_db: float = 60.0,
    also: tuple[FloatArray, str] | None = None,
    height_px: int = 420,
    shown: tuple[float, float] | None = None,
) -> None:
    """Show levels over two axes, the largest within each pixel; zooming sends their detail.

    Parameters
    ----------
    panel : LevelPanel
    key : str
        Of the widget, unique on the page.
    dynamic_range_db : float
        Range shown below the largest level, if the panel does not state one.
    also : (array of (n_y,), str) or None
        A second value of each row with its unit, e.g. the speed.
    height_px : int
    shown : (float, float) or None
        At first.
    """
    from gearsig.plot import level_colours

    values, x, y = panel.levels, panel.at, panel.positions
    half = (x[-1] - x[0]) / max(len(x) - 1, 1) / 2
    ends = (float(x[0] - half), float(x[-1] + half))
    span = zoomed_range(key, ends, shown)
    start = max(int(np.searchsorted(x, span[0] - half)), 0)
    stop = max(int(np.searchsorted(x, span[1] + half)), start + 2)
    part = values[:, start:stop]
    # rows of the picture lie at equal steps of y, those of the map need not
    pooled, at = pooled_levels(part, y, MAP_COLUMNS, MAP_ROWS, logarithmic=panel.logarithmic)
    high = float(np.nanmax(values))
    low = high - (dynamic_range_db if panel.span is None else panel.span)
    is_blank = np.isnan(pooled)  # sent as 0 if there are any
    shades = np.clip(255 * (pooled - low) / (high - low), float(is_blank.any()), 255)
    levels = np.where(is_blank, 0, shades).astype(np.uint8)
    first, last = float(x[start] - half), float(x[min(stop, len(x)) - 1] + half)
    data = _described(panel.x, panel.y, key, span, ends, height_px) | {
        "log": panel.logarithmic,
        "lines": [_sent(line, span) for line in panel.lines],
        "cursors": _cursor_rows(panel.cursors, palette()),
        "marked": [],
        "square": panel.square,
        "map": {
            "levels": b64encode(levels.tobytes()).decode("ascii"),
            "columns": levels.shape[1],
            "rows": levels.shape[0],
            "span": [first, last],
            "limits": list(cell_limits(y, logarithmic=panel.logarithmic)),
            "low": low,
            "high": high,
            "blank": bool(is_blank.any()),
            "unit": panel.unit,
            "colours": b64encode(level_colours(dark=is_dark()).tobytes()).decode("ascii"),
            "also": None if also is None else [float(also[0][i]) for i in at],
            "also_unit": "" if also is None else also[1],
        },
    }
    _figure(key=key, data=data, on_range_change=partial(_take_zoom, key), default={"range": None})


def show_rows(panel: RowPanel, key: str, words: str, *, has_names_above: bool = False) -> None:
    """Show bars one below the other, zoomable along their axis and with a readout.

    Parameters
    ----------
    panel : RowPanel
    key : str
        Of the widget, unique on the page.
    words : str
        What it shows, for those who cannot see it.
    has_names_above : bool
        Whether names are above their bars instead of left of them, for little room.
    """
    ends = [
        end
        for row in panel.rows
        for end in (row.start, row.end, *(row.interval or ()), *((row.mark,) if row.mark is not None else ()))
        if np.isfinite(end)
    ]
    whole = panel.limits or padded_limits([np.array(ends)])
    shown = zoomed_range(key, whole)
    rows = [
        {
            "name": one_line(row.name),
            "start": row.start,
            "end": row.end,
            "colour": _shown_colour(row.colour),
            "beside": row.beside,
            "below": row.below,
            "verdict": None if row.verdict is None else _shown_colour(row.verdict),
            "interval": None if row.interval is None else [min(max(end, -1e300), 1e300) for end in row.interval],
            "mark": row.mark,
            "band": row.band,
            "strong": row.is_total,
        }
        for row in panel.rows
    ]
    data = _described(panel.x, "", key, shown, whole) | {
        "x_unit": re.split("[,;]", _unit_of(panel.x))[0],
        "alternative": one_line(words),
        "rows": rows,
        "above": has_names_above,
        "span": panel.span,
        "bar": panel.bar,
        "mark": panel.mark,
        "band": panel.band,
        "mark_colour": _shown_colour(2),
        "quiet": palette().quiet,
        "lines": [],
        "cursors": [],
        "marked": [],
    }
    _figure(key=key, data=data, on_range_change=partial(_take_zoom, key), default={"range": None})


def _described(
    x: str, y: str, key: str, shown: tuple[float, float], whole: tuple[float, float], height_px: int = 0
) -> dict[str, object]:
    """Return the data that the component gets for every figure; one that is tall enough has tools."""
    return {
        "x": one_line(x),
        "y": one_line(y),
        "x_unit": _unit_of(x),
        "y_unit": _unit_of(y),
        "shown": list(shown),
        "whole": list(whole),
        "height": height_px,
        "fault": palette().fault,
        "alternative": one_line(f"{y} over {x}"),
        "name": file_stem(key),
        "has_tools": height_px >= 200,
    }


def _unit_of(label: str) -> str:
    if label.startswith("order of "):  # the shaft's name may contain brackets
        return axis_unit("order")
    _, bracket, unit = label.rpartition(" (")
    return one_line(unit.removesuffix(")") if bracket else "")


def _sent(line: ChartLine, shown: tuple[float, float] | None, *, alone: bool = True) -> dict[str, object]:
    """Return a line as the component takes it, whole if `shown` is None; pale bands would hide other spectra."""
    x, y, *band = (line.x, line.y) if shown is None else _columns(line, shown)
    band = band if alone or line.band is not None else []
    curves = {name: encoded(values) for name, values in zip(("x", "y", "low", "high"), (x, y, *band), strict=False)}
    colour = _shown_colour(line.colour)
    return {"name": one_line(line.name), "colour": colour, "dotted": line.dotted, "dots": line.dots, **curves}


def _shown_colour(colour: int | str) -> str:
    """Return a line's colour, see `ChartLine`, on the user's page."""
    colours = palette()
    cycle = (colours.measured, colours.fault, *(colours.cursors[kind] for kind in ("mesh", "bearing", "shaft")))
    if isinstance(colour, int):
        return colours.quiet if colour == QUIET else cycle[colour % len(cycle)]
    if not is_dark():
        return colour
    on_paper = np.frombuffer(bytes.fromhex(colour.removeprefix("#")), np.uint8) / 255
    hue, lightness, saturation = rgb_to_hls(*on_paper)
    # Inverting a colour scale would give pale, indistinguishable colours: they are lightened by different amounts.
    shown = (
        on_dark_ground(on_paper) if saturation < 0.2 else np.array(hls_to_rgb(hue, 0.55 + 0.25 * lightness, saturation))
    )
    return "#" + (255 * shown).astype(np.uint8).tobytes().hex()


def encoded(values: FloatArray) -> str:
    """Return numbers as a component takes them: Base64 of little-endian float64."""
    return b64encode(np.ascontiguousarray(values, dtype="<f8").tobytes()).decode("ascii")


def _columns(line: ChartLine, shown: tuple[float, float]) -> tuple[FloatArray, ...]:
    """Return (x, y) or (x, y, low, high) of what is shown: all points, or the extremes of each column at their places.

    One point beyond each end is included, so that the line reaches the edge.
    """
    start = max(int(np.searchsorted(line.x, shown[0])) - 1, 0)
    stop = min(int(np.searchsorted(line.x, shown[1], side="right")) + 1, len(line.x))
    x, y = line.x[start:stop], line.y[start:stop]
    band = () if line.band is None else tuple(edge[start:stop] for edge in line.band)
    if len(x) <= 2 * N_COLUMNS:
        return x, y, *band
    borders = np.linspace(0, len(x), N_COLUMNS + 1).astype(int)
    if line.peaks:  # the highest of each column, at its own place, over the lowest
        highest = np.array([a + int(np.argmax(y[a:b])) for a, b in pairwise(borders)])
        return x[highest], y[highest], np.minimum.reduceat(y, borders[:-1]), y[highest]
    chosen = np.unique([(a + int(np.argmin(y[a:b])), a + int(np.argmax(y[a:b]))) for a, b in pairwise(borders)])
    return x[chosen], y[chosen], *(edge[chosen] for edge in band)


N_NAMED = 6
"""Number of bearing lines with labels above them: more would hide each other and the finding's."""


def _cursor_rows(
    cursors: Sequence[Cursor],
    colours: Palette,
    line: ChartLine | None = None,
    shown: tuple[float, float] = (-np.inf, np.inf),
) -> list[dict[str, object]]:
    """Return cursors as the component takes them, the most important first.

    Of the bearing cursors within the range shown, those of a finding are labelled first, then those where `line` is
    highest; the others are named at the pointer.
    """
    bearings = [c for c in cursors if c.kind == "bearing" and shown[0] <= c.position <= shown[1]]
    if line is not None:
        bearings.sort(key=lambda cursor: (cursor.number > 0, -_height_near(line, cursor.position)))
    quiet = set() if line is None else {id(cursor) for cursor in bearings[N_NAMED:]}
    dashes = {"solid": None, "dot": "2 3", "dash": "6 4", "dashdot": "7 3 2 3"}
    return [
        {
            "at": float(cursor.position),
            "label": plain(cursor.label, LONGEST),
            "is_sideband": cursor.kind == "sideband",
            "is_quiet": id(cursor) in quiet,
            "colour": colours.cursors.get(cursor.kind, colours.quiet),
            "dash": dashes[DASHES.get(cursor.kind, "dot")],
        }
        for cursor in sorted(cursors, key=importance)
    ]


def _height_near(line: ChartLine, position: float) -> float:
    """Return a line's highest value within a bearing's slip around a position."""
    low, high = np.searchsorted(line.x, [(1 - LARGEST_SLIP) * position, (1 + LARGEST_SLIP) * position])
    return float(line.y[low : high + 1].max()) if low < len(line.y) else 0.0


DOTS_PER_INCH = 180
DARK_GROUND = np.frombuffer(bytes.fromhex(DARK_PAPER.removeprefix("#")), np.uint8) / 255
BRIGHTEST = 0.93
# Rotates the hue by half a circle and keeps the lightness: the matrix of hue-rotate(180deg) in the W3C's Filter Effects
# Module, with which the reports also invert their figures.
HALF_TURN = np.array([[-0.574, 1.430, 0.144], [0.426, 0.430, 0.144], [0.426, 1.430, -0.856]])


def show_picture(svg: str, figure: PictureFigure, words: str, key: str, *, ring: Ring | None = None) -> None:
    """Show a figure that panels cannot show as a zoomable picture, and offer it as files.

    Parameters
    ----------
    svg : str
        See `gearsig.plot.figure_svg`.
    figure : Figure
        Of matplotlib.
    words : str
        What it shows, for those who cannot see it.
    key : str
        Unique on the page.
    ring : Ring or None
        See `show_svg`.
    """
    show_svg(svg, words, key, turned=is_dark(), ring=ring)
    offer_picture(svg, lambda: figure, key)


_picture = component_of("picture")


def show_svg(svg: str, words: str, key: str, *, turned: bool = False, ring: Ring | None = None) -> None:
    """Show a vector picture that can be zoomed by dragging.

    Parameters
    ----------
    svg : str
        With a viewBox; shown as an image, in which no script runs.
    words : str
        What it shows, for those who cannot see it.
    key : str
        Of the widget, unique on the page.
    turned : bool
        Whether dark and light are swapped.
    ring : Ring or None
        Curves that can be read off around the picture's middle.
    """
    left, _, width, _ = (float(number) for number in _VIEW_BOX.findall(svg)[0].split())
    zoomed_range(key, (left, left + width))  # which keeps it in the address
    ends = _zoomed(key)
    data = {
        "svg": svg,
        "words": one_line(words),
        "turned": turned,
        "shown": ends if len(ends) == 4 else None,
        "ring": ring
        and {
            "curves": [{"name": name, "values": encoded(values)} for name, values in ring.curves.items()],
            "teeth": ring.teeth,
            "unit": ring.unit,
        },
    }
    _picture(key=key, data=data, on_range_change=partial(_take_zoom, key), default={"range": None})


_VIEW_BOX = re.compile(r'viewBox="([^"]*)"')


@dataclass(frozen=True)
class Ring:
    """Name → values over one revolution, clockwise from the top; `teeth` is 0 if they have no numbers."""

    curves: Mapping[str, FloatArray]
    teeth: int
    unit: str


def offer_picture(svg: str, drawn: Callable[[], PictureFigure], key: str) -> None:
    """Offer a picture as files: its SVG, and what `drawn` draws as PNG and CSV; `key` is unique on the page."""
    dark = is_dark()  # files are made in another thread, which knows no page
    files: dict[str, str | Callable[[], bytes]] = {
        "png": lambda: picture_bytes(drawn(), dark=dark),
        "svg": svg,
        "csv": lambda: csv_text(figure_table(drawn())).encode(),
    }
    with st.container(horizontal=True, horizontal_alignment="right"):
        for ending, data in files.items():
            name, looks = f"{file_stem(key)}.{ending}", {"type": "tertiary", "key": f"{ending} of {key}"}
            download(ending.upper(), data, name, icon=None, **looks)


def file_stem(key: str) -> str:
    """Return the stem of a figure's file names, from the key of its widget."""
    return re.sub(r"[^\w-]+", "-", key.split(" of ", maxsplit=1)[0]).strip("-") or "figure"


def on_dark_ground(colours: FloatArray) -> FloatArray:
    """Return a light page's colours, (…, 3) from 0 to 1, for a dark page: light and dark swap, hues stay."""
    turned: FloatArray = np.clip((1 - colours) @ HALF_TURN.T, 0, 1)
    return DARK_GROUND + (BRIGHTEST - DARK_GROUND) * turned


def picture_bytes(figure: PictureFigure, *, dark: bool) -> bytes:
    """Return the figure as PNG; `dark` swaps light and dark and keeps the hues."""
    from PIL import Image

    pixels, buffer = BytesIO(), BytesIO()
    figure.savefig(pixels, format="png", dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": 0})
    image = Image.open(pixels).convert("RGB")
    if dark:
        image = Image.fromarray((255 * on_dark_ground(np.asarray(image, dtype=np.float32) / 255)).astype(np.uint8))
    image.save(buffer, format="png", compress_level=1)
    return buffer.getvalue()


def download(label: str, data: Any, name: str, **looks: Any) -> None:
    """Show a download button, which does not rerun the page.

    Parameters
    ----------
    label : str
    data : bytes, or callable that returns them
        A callable is called at the click.
    name : str
        Of the file.
    **looks
        As `streamlit.download_button` takes them.
    """
    looks = {"icon": ":material/download:"} | looks
    st.download_button(label, data, file_name=name, on_click="ignore", **looks)


_document = component_of("document")


def offer_page(
    label: str, page: Callable[[], bytes], name: str, key: str, *, pdf: Callable[[], bytes] | None = None
) -> None:
    """Offer an HTML page as a file and for preview; it is made on request.

    Parameters
    ----------
    label : str
        Of the download.
    page : callable
        Returns the page, self-contained.
    name : str
        Of the file.
    key : str
        Unique on the page.
    pdf : callable or None
        Returns the same page for printing.
    """
    with st.container(horizontal=True, vertical_alignment="center"):
        download(label, page, name, type="primary")
        if pdf is not None:
            download("As PDF", pdf, name.removesuffix(".html") + ".pdf")
        is_shown = st.toggle("Preview", key=f"preview of {key}")
    if is_shown:
        with st.spinner("Making the page …"):
            html = page().decode("utf-8")
        _document(key=f"document of {key}", data={"html": html, "title": f"Preview of {name}"})
