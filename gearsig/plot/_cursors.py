"""Cursors at known orders or frequencies: mesh harmonics, sidebands, shaft and bearing lines."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gearsig.angle import ShaftAngle
from gearsig.diagnosis import Finding
from gearsig.orders import OrderMap
from gearsig.plot import _style as style
from gearsig.plot._style import plain
from gearsig.rig import OrderLine, Rig, order_lines
from gearsig.spectra import Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes


PRIORITY = ("mesh", "bearing", "shaft", "hunting", "sideband")
"""Kinds of cursors in order of priority when two collide."""

N_ROWS = 4
ROW_IN = 0.15
OVERHANG_IN = 0.4  # how far a label may extend beyond the panel
ASIDE = 0.85  # share of a label's half width by which it may be shifted and still stand over its line
LONGEST = 24
MIN_DISTANCE_IN = 0.03
CHARACTER_EM = 0.62  # mean character width of the font, on the safe side
LINE_LOOKS = {
    "mesh": ("-", 0.9, 0.55),
    "sideband": (":", 0.8, 0.6),
    "shaft": ("--", 0.8, 0.55),
    "bearing": ("-.", 0.9, 0.65),
    "hunting": (":", 0.8, 0.6),
}


@dataclass(frozen=True)
class LabelPlace:
    """A label's row above the panel and its extent, in inches from the panel's left edge."""

    row: int
    line_in: float
    low_in: float
    high_in: float

    def collides(self, other: LabelPlace) -> bool:
        """Whether the labels overlap, or the line to the higher one crosses the lower one."""
        if self.row == other.row:
            return self.low_in < other.high_in and other.low_in < self.high_in
        lower, higher = (self, other) if self.row < other.row else (other, self)
        return lower.low_in < higher.line_in < lower.high_in


@dataclass(frozen=True)
class Cursor:
    """A mark at one position of a spectrum's axis.

    Parameters
    ----------
    position : float
        In the spectrum's own axis: order or frequency (Hz).
    kind : str
        "mesh", "sideband", "shaft", "bearing", "hunting".
    label : str
    number : int
        Of the harmonic, or of the sideband, counted from its mesh line; in a collision the lower one keeps its label.
    """

    position: float
    kind: str
    label: str
    number: int = 1


def order_cursors(lines: Iterable[OrderLine], revolutions_per_s: float = 1.0) -> tuple[Cursor, ...]:
    """Convert a rig's order lines to cursors with short labels.

    Names of pairs and bearings are left out if there is only one, or if all have the same orders and cannot be
    distinguished. A sideband is labelled by its distance.

    Parameters
    ----------
    lines : iterable of OrderLine
    revolutions_per_s : float
        1 for an order axis; for a frequency axis (Hz) the speed of the shaft that the orders refer to.

    Returns
    -------
    tuple of Cursor
    """
    lines = tuple(lines)
    only = {}
    for kind in ("mesh", "bearing", "hunting"):
        orders: dict[str, set[float]] = {}
        for line in lines:
            if line.kind == kind:
                orders.setdefault(line.element, set()).add(round(line.order, 6))
        only[kind] = len({frozenset(of_one) for of_one in orders.values()}) == 1
    return tuple(_cursor(line, revolutions_per_s, is_only=only.get(line.kind, False)) for line in lines)


def rig_cursors(
    rig: Rig | None, angle: ShaftAngle, shown: Spectrum | OrderMap, *, n_sidebands: int
) -> tuple[Cursor, ...]:
    """Return the lines that a rig implies on a spectrum's axis; without known shafts, the shaft's first three.

    Parameters
    ----------
    rig : Rig or None
    angle : ShaftAngle
        Of the reference shaft; its mean speed places the lines on an axis in Hz.
    shown : Spectrum or OrderMap
        Over frequency or order.
    n_sidebands : int
        On each side of each mesh line.

    Returns
    -------
    tuple of Cursor
    """
    scale = angle.mean_speed_rpm / 60.0 if shown.axis == "frequency" else 1.0
    if rig is None or not rig.shafts:
        return tuple(Cursor(k * scale, "shaft", f"{k}× shaft", k) for k in (1, 2, 3))
    base = shown.shaft if shown.shaft in rig.shaft_names else angle.shaft
    return order_cursors(order_lines(rig, base, n_sidebands=n_sidebands), scale)


WITHOUT_MESH = 50.0  # maximum order shown if no mesh is known


def upper_axis_limit(shown: Spectrum | OrderMap, cursors: Iterable[Cursor]) -> float:
    """Return the upper limit for a spectrum or map: just past the third harmonic of the fastest mesh of its cursors.

    Without a mesh, it is 50 on an order axis and the end of the data on a frequency axis.
    """
    end = float(shown.positions[-1])
    meshes = [cursor.position for cursor in cursors if cursor.kind == "mesh"]
    without_mesh = WITHOUT_MESH if shown.axis == "order" else end
    highest = 1.12 * max(meshes) if meshes else without_mesh
    return min(end, highest) if shown.resolution < highest else end


def modulation_cursors(cursors: Iterable[Cursor]) -> tuple[Cursor, ...]:
    """Return the cursors for an envelope: shaft lines, and three harmonics of each bearing line."""
    result: list[Cursor] = []
    for cursor in cursors:
        if cursor.kind == "shaft":
            result.append(cursor)
        elif cursor.kind == "bearing":
            labels = (cursor.label, f"2× {cursor.label}", f"3× {cursor.label}")
            result += [Cursor(k * cursor.position, "bearing", label, k) for k, label in enumerate(labels, start=1)]
    return tuple(result)


def place(
    cursors: Iterable[Cursor], limits: tuple[float, float], width_in: float
) -> list[tuple[Cursor, LabelPlace | None]]:
    """Choose the cursors to draw and the places of their labels; None: a line without a label.

    A cursor nearly on top of a more important one is left out. Labels fill the rows from the lowest and move aside to
    leave room for those not yet placed. A label that would touch another, or the line to another, is left out; its
    line stays.

    Parameters
    ----------
    cursors : iterable of Cursor
    limits : (float, float)
        Of the axis.
    width_in : float
        Of the panel, in inches.

    Returns
    -------
    list of (Cursor, LabelPlace or None)
        Most important first.
    """
    scale = width_in / (limits[1] - limits[0])
    drawn: list[tuple[Cursor, float]] = []
    for cursor in sorted(cursors, key=importance):
        at = (cursor.position - limits[0]) * scale
        on_top = any(abs(at - drawn_at) < MIN_DISTANCE_IN for _, drawn_at in drawn)
        if limits[0] <= cursor.position <= limits[1] and not on_top:
            drawn.append((cursor, at))
    places: list[LabelPlace] = []
    result: list[tuple[Cursor, LabelPlace | None]] = []
    for number, (cursor, at) in enumerate(drawn, start=1):
        waiting = [drawn_at for later, drawn_at in drawn[number:] if later.label]
        label = _free_place(places, waiting, at, cursor.label, width_in) if cursor.label else None
        if label is not None:
            places.append(label)
        result.append((cursor, label))
    used = sorted({label.row for label in places})  # skip rows that stayed empty
    return [(cursor, label and replace(label, row=used.index(label.row))) for cursor, label in result]


def n_rows(placed: Iterable[tuple[Cursor, LabelPlace | None]]) -> int:
    """Return the number of label rows used."""
    return max((label.row + 1 for _, label in placed if label is not None), default=0)


def draw(axes: Axes, placed: Iterable[tuple[Cursor, LabelPlace | None]], *, through: bool = True) -> None:
    """Draw placed cursors with labels in rows above the panel; lines go `through` the panel or stay above it."""
    width, height = style.size_in(axes)
    for cursor, label in placed:
        colour = style.CURSOR_COLOURS.get(cursor.kind, style.QUIET)
        dashes, thickness, alpha = LINE_LOOKS.get(cursor.kind, LINE_LOOKS["sideband"])
        base = 0.05 + ROW_IN * (label.row if label else 0)
        ends = ([cursor.position] * 2, [0.0 if through else 1.0, 1.0 + (base if label else 0.05) / height])
        looks = {"color": colour, "linestyle": dashes, "linewidth": thickness, "alpha": alpha, "zorder": 1.5}
        axes.plot(*ends, **looks, transform=axes.get_xaxis_transform(), clip_on=False)  # type: ignore[arg-type]
        if label is not None:
            middle = (label.low_in + label.high_in) / 2 / width
            style.put_text(
                axes,
                middle,
                1.0 + base / height,
                cursor.label,
                colour=colour,
                n_max=LONGEST,
                transform=axes.transAxes,
                ha="center",
                va="bottom",
            )


def _cursor(line: OrderLine, scale: float, *, is_only: bool) -> Cursor:
    label, number = line.label, line.harmonic
    if line.kind == "sideband":
        label = label.partition(line.element)[2].strip().replace("+ ", "+").replace("− ", "−")
        digits = label.lstrip("+−").partition("×")[0]
        number = int(digits) if digits.isdecimal() else number
    elif is_only:
        label = label.removesuffix(line.element).strip()
    return Cursor(line.order * scale, line.kind, label, number)


def importance(cursor: Cursor) -> tuple[int, int, float]:
    """Return the sort key of cursors; the most important ones, whose labels are placed first, come first."""
    rank = PRIORITY.index(cursor.kind) if cursor.kind in PRIORITY else len(PRIORITY)
    if cursor.kind == "shaft" and cursor.number == 1:  # the shaft's own order; its harmonics come later
        rank = PRIORITY.index("mesh")
    return rank, cursor.number, cursor.position


def _free_place(
    places: Sequence[LabelPlace], waiting: Sequence[float], at_in: float, text: str, width_in: float
) -> LabelPlace | None:
    """Return the free place of a label, inside the figure, that blocks the fewest lines still to be labelled.

    Of several, take the one centred over its own line at `at_in`, and of these the lowest. A label blocks a line whose
    upward path it crosses.
    """
    half = (len(plain(text, LONGEST)) * CHARACTER_EM + 0.8) * style.SMALL_PT / 72 / 2
    best: LabelPlace | None = None
    fewest = len(waiting) + 1
    for shift in (0.0, ASIDE * half, -ASIDE * half):
        middle = min(max(at_in + shift, half - OVERHANG_IN), width_in + OVERHANG_IN / 2 - half)
        for row in range(N_ROWS):
            new = LabelPlace(row, at_in, middle - half, middle + half)
            n_barred = 0 if row == N_ROWS - 1 else sum(new.low_in < bar_at < new.high_in for bar_at in waiting)
            if n_barred < fewest and not any(new.collides(bar_at) for bar_at in places):
                best, fewest = new, n_barred
    return best


@dataclass(frozen=True)
class AngleMark:
    """A place on a gear.

    Parameters
    ----------
    angle_deg : float
        Of the shaft, from the start of the average.
    label : str
        E.g. "tooth 17".
    """

    angle_deg: float
    label: str


def marks_of(findings: Iterable[Finding], shaft: str, n_teeth: int | None = None) -> tuple[AngleMark, ...]:
    """Return the places on one shaft named by faults and suspicions.

    A tooth without angle is marked at its middle: tooth k spans (k - 1)/n to k/n of a revolution.

    Parameters
    ----------
    findings : iterable of Finding
    shaft : str
    n_teeth : int or None
        Of the gear on that shaft, if known.

    Returns
    -------
    tuple of AngleMark
    """
    marks = []
    for finding in findings:
        where = finding.where
        is_of_shaft = where.shaft == shaft or where.gear.rpartition("/")[2] == shaft
        if not finding.is_claim or not is_of_shaft:
            continue
        angle = where.angle_deg
        if angle is None and where.tooth is not None and n_teeth:
            angle = (where.tooth - 0.5) * 360.0 / n_teeth
        if angle is not None:
            tooth = f"tooth {where.tooth}, " if where.tooth is not None else ""
            marks.append(AngleMark(angle % 360.0, f"{tooth}{angle % 360.0:.0f}°"))
    return tuple(dict.fromkeys(marks))
