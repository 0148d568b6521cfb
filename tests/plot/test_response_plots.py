"""Figures of a gear's response: four roughnesses, several crack depths."""

import gc
import weakref
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from matplotlib.text import Text

from gearsig.errors import InputError
from gearsig.plot import ResponseCase, crack_comparison_figure, response_figure

MESH_HZ = 100.0
TIME = np.arange(2000) / 5000.0
HZ = np.arange(2501.0)
REVOLUTIONS = np.arange(1500) / 375.0


def _case(name, size=1.0):
    y, v = 1e-6 * size * np.sin(2 * np.pi * MESH_HZ * TIME), 1e-3 * size * np.cos(2 * np.pi * MESH_HZ * TIME)
    return ResponseCase(name, TIME, y, v, HZ, size * 1e-6 / (1 + HZ), y[::50], v[::50])


def _texts(figure):
    figure.savefig(BytesIO(), format="png", dpi=40)
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def _longest(axes):
    return max(axes.lines, key=lambda line: len(line.get_xdata()))


def test_response_draws_what_it_is_given_in_um_and_mm_per_s():
    cases = [_case("smooth"), _case("rough", 3.0)]
    figure = response_figure(
        cases, mesh_frequency_hz=MESH_HZ, limits_hz=(0, 400), n_periods=10, lines_hz=(17.9,), title="T"
    )
    assert len(figure.axes) == 8
    for row, case in enumerate(cases):
        time, spectrum, phase, section = figure.axes[4 * row : 4 * row + 4]
        n = len(_longest(time).get_xdata())
        assert TIME[n - 1] == pytest.approx(10 / MESH_HZ, abs=2e-4)
        np.testing.assert_allclose(_longest(time).get_ydata(), case.displacement_m[:n] * 1e6)
        np.testing.assert_allclose(_longest(spectrum).get_ydata(), case.amplitude_m[1:401] * 1e6)
        np.testing.assert_allclose(_longest(phase).get_ydata(), case.velocity_mps * 1e3)
        dots = next(line for line in phase.lines if line.get_marker() == "o")
        np.testing.assert_allclose(dots.get_xdata(), case.poincare_displacement_m * 1e6)
        np.testing.assert_allclose(section.lines[0].get_ydata(), case.poincare_velocity_mps * 1e3)
    wanted = {"smooth", "rough", "T", "mesh", "2×", "3×", "time (s)", "frequency (Hz)", "displacement (µm)"}
    assert wanted | {"amplitude (µm)", "velocity (mm/s)"} <= set(_texts(figure))


def test_rows_of_a_response_share_their_scales():
    figure = response_figure([_case("a"), _case("b", 5.0)], mesh_frequency_hz=MESH_HZ)
    for column in range(4):
        one, two = figure.axes[column], figure.axes[4 + column]
        assert one.get_ylim() == two.get_ylim()
        assert one.get_xlim() == two.get_xlim()


def test_response_at_rest_draws():
    still = ResponseCase("still", TIME, 0 * TIME, 0 * TIME, HZ, 0 * HZ, np.zeros(0), np.zeros(0))
    assert _texts(response_figure([still], mesh_frequency_hz=MESH_HZ))


def test_response_refuses_what_does_not_fit():
    case = _case("a")
    with pytest.raises(InputError, match="velocity_mps 3"):
        replace(case, velocity_mps=np.ones(3))
    with pytest.raises(InputError, match="poincare_velocity_mps 0"):
        replace(case, poincare_velocity_mps=np.zeros(0))
    with pytest.raises(InputError, match="ascend"):
        replace(case, time_s=TIME[::-1])
    with pytest.raises(InputError, match="0 cases"):
        response_figure([], mesh_frequency_hz=MESH_HZ)
    with pytest.raises(InputError, match="mesh_frequency_hz"):
        response_figure([case], mesh_frequency_hz=0.0)
    with pytest.raises(InputError, match="no line of 'a'"):
        response_figure([case], mesh_frequency_hz=MESH_HZ, limits_hz=(9000.0, 9500.0))


def _accelerations():
    impact = np.where(REVOLUTIONS % 1.0 < 0.1, 20.0, 0.0)
    return {"healthy": np.sin(2000 * REVOLUTIONS), "3 mm": np.sin(2000 * REVOLUTIONS) + impact}


def test_crack_comparison_marks_impacts_and_enlarges_the_middle_one():
    cases = _accelerations()
    figure = crack_comparison_figure(
        REVOLUTIONS,
        cases,
        impacts_rev=(1.0, 2.0, 3.0, 9.0),
        n_teeth=50,
        change_mps2={"3 mm": cases["3 mm"] - cases["healthy"]},
        reach_cycles={"3 mm": 5.0},
        zoom_cycles=(-2.98, 11.98),
        title="T",
    )
    whole, close, _, close_3 = figure.axes
    np.testing.assert_array_equal(_longest(whole).get_ydata(), cases["healthy"])
    marks = {float(line.get_xdata()[0]) for line in whole.lines if len(line.get_xdata()) == 2}
    assert marks == {1.0, 2.0, 3.0}
    at = np.abs((REVOLUTIONS - 2.0) * 50 - 4.5) < 7.48
    # On a logarithmic axis a change of nothing is drawn at a tiny value.
    np.testing.assert_allclose(
        _longest(close_3).get_ydata(), np.abs(cases["3 mm"] - cases["healthy"])[at], rtol=1e-12, atol=2e-12
    )
    np.testing.assert_allclose(_longest(close_3).get_xdata(), (REVOLUTIONS[at] - 2.0) * 50)
    np.testing.assert_allclose(_longest(close).get_ydata(), np.abs(cases["healthy"][at]), atol=2e-12)
    assert close.get_ylim() == close_3.get_ylim()
    texts = set(_texts(figure))
    assert {
        "healthy",
        "3 mm",
        "T",
        "a (m/s²)",
        "|change| (m/s²)",
        "|a| (m/s²)",
        "felt for 5.0 cycles",
        "revolutions of the cracked gear",
    } <= texts
    assert "mesh cycles since the cracked tooth's entry" in texts


def test_crack_comparison_without_changes_enlarges_the_signals():
    cases = _accelerations()
    figure = crack_comparison_figure(REVOLUTIONS, cases, impacts_rev=(2.0,), n_teeth=50, zoom_cycles=(-2.98, 11.98))
    at = np.abs((REVOLUTIONS - 2.0) * 50 - 4.5) < 7.48
    np.testing.assert_array_equal(_longest(figure.axes[3]).get_ydata(), cases["3 mm"][at])
    assert figure.axes[3].get_yscale() == "linear"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"impacts_rev": (9.0,)}, "no impact lies on the axis"),
        ({"reach_cycles": {"7 mm": 2.0}}, "names '7 mm'"),
        ({"change_mps2": {"7 mm": np.ones(1500)}}, "change_mps2 names '7 mm'"),
        ({"change_mps2": {"3 mm": np.ones(4)}}, "has 4 points"),
        ({"zoom_cycles": (3.0, 1.0)}, "zoom_cycles"),
        ({"zoom_cycles": (300.0, 301.0)}, "fewer than two"),
        ({"n_teeth": 0}, "n_teeth"),
        ({"acceleration_mps2": {"a": np.ones(3)}}, "has 3 points"),
    ],
)
def test_crack_comparison_refuses_what_does_not_fit(changes, message):
    given = {"acceleration_mps2": _accelerations(), "impacts_rev": (2.0,), "n_teeth": 50} | changes
    with pytest.raises(InputError, match=message):
        crack_comparison_figure(REVOLUTIONS, **given)


@pytest.mark.slow
def test_figures_are_freed_with_their_last_reference():
    figure = response_figure([_case("a")], mesh_frequency_hz=MESH_HZ)
    _texts(figure)
    gone = weakref.ref(figure)
    del figure
    gc.collect()
    assert gone() is None
