"""Figures of a gap: what is drawn is what was given, and every text lies inside."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.gap import AngleCurves, GapStep, Interval, SpectrumCurves, against_reference
from gearsig.plot import (
    INNER,
    OUTER,
    AngleMark,
    gap_averages_figure,
    gap_evidence_panel,
    gap_lines_figure,
    gap_orders_figure,
    gap_teeth_figure,
    gap_waterfall_panel,
    rows_figure,
)
from tests.gap.example_report import effect_report, gearless_report

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REPORT = effect_report()
STANCES = ("for", "further", "against")


def texts(figure: "Figure") -> list[str]:
    from matplotlib.text import Text

    return [t.get_text() for t in figure.findobj(Text) if isinstance(t, Text) and t.get_visible() and t.get_text()]


def assert_inside(figure: "Figure") -> None:
    """Every text lies within the figure, and no two texts beside the rows overlap."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    canvas = FigureCanvasAgg(figure)
    canvas.draw()  # type: ignore[no-untyped-call]  # matplotlib has no type for it
    width, height = canvas.get_width_height()
    for text in figure.findobj(Text):
        if not (isinstance(text, Text) and text.get_visible() and text.get_text()):
            continue
        box = text.get_window_extent()
        assert box.x0 >= -1, text.get_text()
        assert box.y0 >= -1, text.get_text()
        assert box.x1 <= width + 1, text.get_text()
        assert box.y1 <= height + 1, text.get_text()


def bars(figure: "Figure") -> list[float]:
    from matplotlib.patches import Rectangle

    return [float(bar.get_width()) for bar in figure.axes[0].patches if isinstance(bar, Rectangle)]


MADE: dict[str, Callable[[], Any]] = {
    "waterfall": lambda: rows_figure(gap_waterfall_panel(REPORT.steps, held_out="another operating condition")),
    "evidence": lambda: rows_figure(gap_evidence_panel(REPORT.causes[0].evidence)),
    "averages": lambda: gap_averages_figure(REPORT.averages[0], mark=AngleMark(134.2, "tooth 21")),
    "orders": lambda: gap_orders_figure(REPORT.spectra[0]),
    "lines": lambda: gap_lines_figure(gearless_report().spectra[0], 3.21),
    "teeth": lambda: gap_teeth_figure(REPORT.angles[0], mark=AngleMark(134.2, "tooth 21, 134°")),
}


@pytest.mark.parametrize("name", list(MADE))
def test_nothing_is_cut(name: str) -> None:
    assert_inside(MADE[name]())


def test_the_waterfall_goes_from_before_to_what_is_left() -> None:
    figure = rows_figure(gap_waterfall_panel(REPORT.steps))
    lengths = bars(figure)[-4:]  # the floor's shading comes first
    assert lengths == pytest.approx([7.9, 4.0, 2.3, 1.6])
    assert {"what is left", "−4", "−51 % of the gap", "1.2 to 2.1"} <= set(texts(figure))
    grown = rows_figure(gap_waterfall_panel((GapStep("a", Interval(1, 1, 1)), GapStep("b", Interval(1.5, 1, 2)))))
    assert "+0.5" in texts(grown)
    assert "+50 % of the gap" in texts(grown)


def test_panels_say_what_the_figures_draw() -> None:
    rows = gap_evidence_panel(REPORT.causes[0].evidence).rows
    assert [(row.end, row.mark, row.band) for row in rows] == [
        (one.observed_db, one.predicted_db, one.floor_db) for one in REPORT.causes[0].evidence
    ]
    assert [row.beside for row in rows] == ["for", "for", "for", "further", "against"]
    steps = gap_waterfall_panel(REPORT.steps).rows
    assert [abs(row.end - row.start) for row in steps] == pytest.approx([7.9, 4.0, 2.3, 1.6])
    assert [row.is_total for row in steps] == [True, False, False, True]
    assert [row.interval[0] for row in steps[:-1]] == [step.remaining.low for step in REPORT.steps]


def test_evidence_stands_beside_its_prediction() -> None:
    figure = rows_figure(gap_evidence_panel(REPORT.causes[0].evidence))
    axes = figure.axes[0]
    (diamonds,) = (list(np.asarray(line.get_xdata())) for line in axes.lines if line.get_marker() == "D")
    assert diamonds == pytest.approx([one.predicted_db for one in REPORT.causes[0].evidence])
    assert [t for t in texts(figure) if t in STANCES] == ["for", "for", "for", "further", "against"]


def test_lines_beyond_the_structural_floor_are_orange() -> None:
    from matplotlib.collections import LineCollection

    orders = np.arange(10.0)
    before = np.ones(10)
    measured = np.where(orders == 4, 10.0, np.where(orders == 7, 1.2, 1.0))
    curves = SpectrumCurves(
        "a", "m/s^2", orders, measured, before, np.zeros(0), np.full(10, 0.1), structural_db=np.full(10, 6.0)
    )
    figure = gap_orders_figure(curves)
    quiet, strong = (c for c in figure.axes[1].collections if isinstance(c, LineCollection))
    assert [segment[0][0] for segment in strong.get_segments()] == [4.0]
    assert strong.get_segments()[0][1][1] == pytest.approx(20.0)
    assert len(quiet.get_segments()) == 9
    quiet, strong = (
        c for c in gap_orders_figure(curves, marked=False).axes[1].collections if isinstance(c, LineCollection)
    )
    assert len(quiet.get_segments()) == 10
    assert not strong.get_segments()


def test_what_is_compared_with_has_its_name() -> None:
    view = against_reference(REPORT.spectra[0])
    assert {"measured", "reference", "repeatability floor"} <= set(
        texts(gap_orders_figure(view, compared_with="reference"))
    )
    assert "simulated" in texts(gap_orders_figure(replace(REPORT.spectra[0], after=np.zeros(0))))
    assert "simulated before" in texts(gap_orders_figure(REPORT.spectra[0]))


def test_averages_and_their_difference_are_on_one_scale() -> None:
    curves = REPORT.averages[0]
    above, below = gap_averages_figure(curves).axes
    assert above.get_ylim() == below.get_ylim()
    drawn = {str(line.get_label()): np.asarray(line.get_ydata()) for line in (*above.lines, *below.lines)}
    change = curves.measured - curves.reference
    assert drawn["measured less reference"].max() == pytest.approx(change.max())
    assert drawn["reference"].max() == pytest.approx(curves.reference.max())
    with pytest.raises(InputError, match="points"):
        gap_averages_figure(replace(curves, reference=np.ones(3)))


def test_multiples_of_the_found_order_are_marked_without_a_simulation() -> None:
    curves = gearless_report().spectra[0]
    lines = {line.get_label(): line for line in gap_lines_figure(curves, 3.21).axes[0].get_lines()}
    np.testing.assert_allclose(lines["multiples of order 3.21"].get_xdata(), 3.21 * np.arange(1, 7))
    np.testing.assert_array_equal(lines["measured"].get_ydata(), curves.measured)
    unmarked = [line.get_label() for line in gap_lines_figure(curves).axes[0].get_lines()]
    assert not any("multiples" in str(label) for label in unmarked)


def test_the_polar_picture_is_in_decibels_from_the_median_tooth() -> None:
    angle = np.arange(0.0, 360.0, 5.0)
    measured = np.where(angle == 90.0, 100.0, 1.0)
    curves = AngleCurves("in", "m/s^2", 18, False, angle, measured, np.ones(72), np.zeros(0))
    axes = gap_teeth_figure(curves).axes[0]
    drawn = [np.asarray(one.get_xydata()) for one in axes.lines if len(np.asarray(one.get_xdata())) == 73]
    line = max(drawn, key=lambda points: float(points[:, 1].max()))
    at = int(np.argmax(line[:, 1]))
    assert line[at] == pytest.approx([np.pi / 2, OUTER])
    assert np.median(line[:, 1]) == pytest.approx(INNER + (OUTER - INNER) * 9.0 / 29.0)
    assert not [t for t in texts(gap_teeth_figure(curves)) if t.isdigit()]  # no mark, no numbers
    assert "17" in texts(gap_teeth_figure(replace(curves, has_mark=True)))


def test_nothing_to_draw_is_an_error() -> None:
    for draw in (gap_waterfall_panel, gap_evidence_panel):
        with pytest.raises(InputError):
            draw([])
    with pytest.raises(InputError, match="points"):
        gap_orders_figure(replace(REPORT.spectra[0], floor=np.ones(3)))
