"""Figures of simulated gear pairs: mesh, friction and backlash, responses, flexible pairs."""

import gc
import weakref
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.plot import (
    ResponseCase,
    backlash_figure,
    crack_comparison_figure,
    frequency_curves_figure,
    friction_figure,
    load_sharing_figure,
    mesh_maps_figure,
    mesh_stiffness_figure,
    panels_of,
    response_figure,
    speed_spectra_figure,
    speed_sweep_figure,
)
from tests.plot.drawn import texts_of

CYCLES = np.linspace(0.0, 2.0, 401)
STIFFNESS = {
    "none": 3e8 + 1e8 * np.sign(np.sin(2 * np.pi * CYCLES)),
    "2 mm": 2.9e8 + 1e8 * np.sign(np.sin(2 * np.pi * CYCLES)),
}


def _line(axes, label):
    return next(line for line in axes.lines if line.get_label() == label)


def test_stiffness_is_drawn_as_given_with_units_and_names():
    figure = mesh_stiffness_figure(CYCLES, STIFFNESS, single_pair=(0.5, 1.0), heading="crack depth", title="A pair")
    whole, zoom = figure.axes
    for label, values in STIFFNESS.items():
        np.testing.assert_array_equal(_line(whole, label).get_xdata(), CYCLES)
        np.testing.assert_allclose(_line(whole, label).get_ydata(), values / 1e8)
        inside = (CYCLES >= 0.5) & (CYCLES <= 1.0)
        np.testing.assert_allclose(_line(zoom, label).get_ydata(), values[inside] / 1e8)
    assert zoom.get_xlim() == (0.5, 1.0)
    texts = texts_of(figure)
    assert {"none", "2 mm", "crack depth", "A pair", "mesh cycles (tooth passages)"} <= set(texts)
    assert texts.count("mesh stiffness (10⁸ N/m)") == 2


def test_stiffness_without_a_region_has_one_panel():
    assert len(mesh_stiffness_figure(CYCLES, STIFFNESS).axes) == 1


def test_colours_of_ordered_cases_grow_lighter():
    figure = mesh_stiffness_figure(CYCLES, {f"{i} mm": np.full(401, 1e8 * i) for i in range(5)})
    from matplotlib.colors import to_rgb

    light = [np.dot(to_rgb(line.get_color()), (0.2126, 0.7152, 0.0722)) for line in figure.axes[0].lines]
    assert all(a < b for a, b in pairwise(light))


@pytest.mark.parametrize(
    ("cycles", "curves", "region", "message"),
    [
        (CYCLES, {"a": np.ones(3)}, None, r"stiffness_n_per_m\['a'\] has 3 points, its axis 401"),
        (CYCLES, {}, None, "holds 0 curves"),
        (CYCLES, {"a": np.full(401, np.nan)}, None, "NaN"),
        (CYCLES[::-1], {"a": np.ones(401)}, None, "mesh_cycles"),
        (np.ones((2, 2)), {"a": np.ones(2)}, None, "shape"),
        (CYCLES, STIFFNESS, (1.0, 0.5), "single_pair"),
        (CYCLES, STIFFNESS, (5.0, 6.0), "0 point"),
    ],
)
def test_stiffness_refuses_what_does_not_fit(cycles, curves, region, message):
    with pytest.raises(InputError, match=message):
        mesh_stiffness_figure(cycles, curves, single_pair=region)


def test_load_sharing_draws_forces_where_pairs_touch_and_errors_in_um():
    one = np.where(CYCLES < 1.0, 2000.0, 0.0)
    error = 1e-6 * (8 + np.cos(CYCLES))
    figure = load_sharing_figure(CYCLES, {"pair 0": one, "pair 1": 2000.0 - one}, {"healthy": error})
    upper, lower = figure.axes
    drawn = _line(upper, "pair 0").get_ydata()
    np.testing.assert_array_equal(drawn[CYCLES < 1.0], 2000.0)
    assert drawn[200] == 0.0  # the fall to zero is shown
    assert np.isnan(drawn[201:]).all()
    np.testing.assert_allclose(_line(lower, "healthy").get_ydata(), error * 1e6)
    assert {"force of a pair (N)", "transmission error (µm)", "mesh cycles (tooth passages)"} <= set(texts_of(figure))


def test_pairs_keep_their_names_beside_cases_of_the_same_colours():
    """The legend of the errors below names lines by colours that the pairs above have as well."""
    ones = np.ones(len(CYCLES))
    figure = load_sharing_figure(CYCLES, {"pair 0": ones, "pair 1": 2 * ones}, {"10 N·m": ones, "500 N·m": 2 * ones})
    ((upper,),), ((lower,),) = panels_of(figure)
    assert [line.name for line in upper.lines] == ["pair 0", "pair 1"]
    assert [line.name for line in lower.lines] == ["10 N·m", "500 N·m"]
    assert not upper.title


def test_load_sharing_refuses_wrong_lengths():
    with pytest.raises(InputError, match="transmission_error_m"):
        load_sharing_figure(CYCLES, {"pair 0": np.ones(401)}, {"healthy": np.ones(400)})


# Figures of rough flanks: friction and backlash.

ENGAGEMENT = np.linspace(0.0, 1.7, 341)
TIME = np.linspace(0.0, 0.5, 1001)
HZ = np.linspace(10.0, 2000.0, 1991)


def test_friction_is_drawn_as_given_and_names_approach_and_recess():
    curves = {"0 µm": 0.02 * (0.9 - ENGAGEMENT), "1.4 µm": 0.15 * (0.9 - ENGAGEMENT)}
    figure = friction_figure(
        ENGAGEMENT, curves, pitch_point=0.9, single_pair=(0.7, 1.0), heading="roughness", title="μ"
    )
    for label, values in curves.items():
        np.testing.assert_array_equal(_line(figure.axes[0], label).get_ydata(), values)
    assert {"0 µm", "1.4 µm", "roughness", "pitch point", "approach", "recess", "μ"} <= set(texts_of(figure))
    assert figure.axes[0].get_ylabel() == "friction coefficient × direction (–)"
    assert "tooth passages" in figure.axes[0].get_xlabel()


def test_friction_without_sign_starts_at_zero_and_may_have_gaps():
    values = np.abs(0.9 - ENGAGEMENT)
    values[300:] = np.nan
    figure = friction_figure(ENGAGEMENT, {"a": values})
    assert figure.axes[0].get_ylim()[0] == 0.0
    assert figure.axes[0].get_ylabel() == "friction coefficient (–)"
    assert texts_of(figure)


@pytest.mark.parametrize(
    ("curves", "region", "message"),
    [
        ({"a": np.ones(5)}, None, "has 5 points"),
        ({"a": np.ones((341, 2))}, None, "shape"),
        ({"a": np.ones(341)}, (1.0, 0.7), "single_pair"),
        ({str(i): np.ones(341) for i in range(9)}, None, "holds 9 curves"),
        ({"a": np.full(341, np.nan)}, None, "no number"),
    ],
)
def test_friction_refuses_what_does_not_fit(curves, region, message):
    with pytest.raises(InputError, match=message):
        friction_figure(ENGAGEMENT, curves, single_pair=region)


def _backlash(**changes):
    given = {
        "time_s": TIME,
        "backlash_m": {"smooth": np.full(1001, 2e-5), "rough": 2e-5 + 1e-6 * np.cos(120 * TIME)},
        "frequency_hz": HZ,
        "amplitude_m": {"smooth": np.zeros(1991), "rough": 1e-6 / HZ},
    } | changes
    return backlash_figure(**given, lines_hz=(17.9, 26.9, 4321.0), mesh_frequency_hz=458.3)


def test_backlash_and_its_spectrum_are_drawn_in_um():
    figure = _backlash()
    upper, lower = figure.axes
    np.testing.assert_allclose(_line(upper, "rough").get_ydata(), 20 + np.cos(120 * TIME))
    spectra = [line for line in lower.lines if len(line.get_xdata()) == 1991]
    assert len(spectra) == 1  # a smooth flank has no lines
    np.testing.assert_allclose(spectra[0].get_ydata(), 1 / HZ)
    texts = texts_of(figure)
    assert {"17.9", "26.9", "mesh", "time (s)", "frequency (Hz)"} <= set(texts)
    assert {"half backlash (µm)", "amplitude (µm peak)"} <= set(texts)
    assert "4321" not in texts


def test_backlash_of_smooth_flanks_alone_draws():
    assert texts_of(_backlash(backlash_m={"a": np.full(1001, 2e-5)}, amplitude_m={"a": np.zeros(1991)}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frequency_hz": HZ - 10.0}, "logarithmic"),
        ({"amplitude_m": {"rough": 1e-6 / HZ}}, "same names"),
        ({"amplitude_m": {"smooth": np.zeros(3), "rough": np.zeros(3)}}, "has 3 points"),
        ({"time_s": TIME[:-1]}, "its axis 1000"),
    ],
)
def test_backlash_refuses_what_does_not_fit(changes, message):
    with pytest.raises(InputError, match=message):
        _backlash(**changes)


# Figures of a gear's response: four roughnesses, several crack depths.

MESH_HZ = 100.0
STEADY_S = np.arange(2000) / 5000.0
LINES_HZ = np.arange(2501.0)
REVOLUTIONS = np.arange(1500) / 375.0


def _case(name, size=1.0):
    y, v = 1e-6 * size * np.sin(2 * np.pi * MESH_HZ * STEADY_S), 1e-3 * size * np.cos(2 * np.pi * MESH_HZ * STEADY_S)
    return ResponseCase(name, STEADY_S, y, v, LINES_HZ, size * 1e-6 / (1 + LINES_HZ), y[::50], v[::50])


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
        assert STEADY_S[n - 1] == pytest.approx(10 / MESH_HZ, abs=2e-4)
        np.testing.assert_allclose(_longest(time).get_ydata(), case.displacement_m[:n] * 1e6)
        np.testing.assert_allclose(_longest(spectrum).get_ydata(), case.amplitude_m[1:401] * 1e6)
        np.testing.assert_allclose(_longest(phase).get_ydata(), case.velocity_mps * 1e3)
        dots = next(line for line in phase.lines if line.get_marker() == "o")
        np.testing.assert_allclose(dots.get_xdata(), case.poincare_displacement_m * 1e6)
        np.testing.assert_allclose(section.lines[0].get_ydata(), case.poincare_velocity_mps * 1e3)
    wanted = {"smooth", "rough", "T", "mesh", "2×", "3×", "time (s)", "frequency (Hz)", "displacement (µm)"}
    assert wanted | {"amplitude (µm)", "velocity (mm/s)"} <= set(texts_of(figure))


def test_rows_of_a_response_share_their_scales():
    figure = response_figure([_case("a"), _case("b", 5.0)], mesh_frequency_hz=MESH_HZ)
    for column in range(4):
        one, two = figure.axes[column], figure.axes[4 + column]
        assert one.get_ylim() == two.get_ylim()
        assert one.get_xlim() == two.get_xlim()


def test_response_at_rest_draws():
    still = ResponseCase(
        "still", STEADY_S, 0 * STEADY_S, 0 * STEADY_S, LINES_HZ, 0 * LINES_HZ, np.zeros(0), np.zeros(0)
    )
    assert texts_of(response_figure([still], mesh_frequency_hz=MESH_HZ))


def test_response_refuses_what_does_not_fit():
    case = _case("a")
    with pytest.raises(InputError, match="velocity_mps 3"):
        replace(case, velocity_mps=np.ones(3))
    with pytest.raises(InputError, match="poincare_velocity_mps 0"):
        replace(case, poincare_velocity_mps=np.zeros(0))
    with pytest.raises(InputError, match="ascend"):
        replace(case, time_s=STEADY_S[::-1])
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
    texts = set(texts_of(figure))
    assert {
        "healthy",
        "3 mm",
        "T",
        "a (m/s²)",
        "|change| (m/s²)",
        "|a| (m/s²)",
        "noticeable for 5.0 cycles",
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
    texts_of(figure)
    gone = weakref.ref(figure)
    del figure
    gc.collect()
    assert gone() is None


# Figures of a flexible pair: maps, sweeps, spectra, natural frequencies.

MAP_CYCLES = np.linspace(0.0, 2.0, 81)
TORQUE = np.linspace(10.0, 500.0, 20)
SWEEP_HZ = np.linspace(750.0, 3400.0, 60)


def test_maps_show_values_over_angle_and_torque():
    values = 2.5 + 0.3 * np.cos(2.0 * np.pi * MAP_CYCLES)[:, None] + 1e-3 * TORQUE
    figure = mesh_maps_figure(
        MAP_CYCLES, TORQUE, {"stiffness (10⁸ N/m)": values, "STE (µm)": 4.0 * values}, title="A pair"
    )
    assert {"stiffness (10⁸ N/m)", "STE (µm)", "torque (N·m)", "A pair"} <= set(texts_of(figure))
    drawn = figure.axes[0].collections[0].get_array()
    np.testing.assert_allclose(np.asarray(drawn).reshape(len(TORQUE), len(MAP_CYCLES)), values.T)
    with pytest.raises(InputError, match="shape"):
        mesh_maps_figure(MAP_CYCLES, TORQUE, {"x": values.T})
    with pytest.raises(InputError, match="4 maps"):
        mesh_maps_figure(MAP_CYCLES, TORQUE, dict.fromkeys("abcd", values))


def test_an_even_map_is_drawn_without_lines():
    mesh_maps_figure(MAP_CYCLES, TORQUE, {"even": np.ones((len(MAP_CYCLES), len(TORQUE)))})


def test_sweeps_show_both_ways_and_mark_the_mode():
    up, down = np.linspace(1e-6, 2e-6, 60), np.linspace(2e-6, 3e-6, 60)
    figure = speed_sweep_figure([("170 N·m", SWEEP_HZ, up, down)], natural_hz=2650.0, jumps_hz={"jump up": 2500.0})
    axes = figure.axes[0]
    np.testing.assert_allclose(axes.lines[0].get_ydata(), up * 1e6)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), down * 1e6)
    assert axes.lines[1].get_linestyle() != axes.lines[0].get_linestyle()
    assert {"ωₙ", "ωₙ/2", "ωₙ/3", "jump up", "dynamic transmission error, rms (µm)"} <= set(texts_of(figure))
    with pytest.raises(InputError):
        speed_sweep_figure([])


def test_maps_of_equal_steps_are_zoomed() -> None:
    cycles = np.linspace(0.0, 1.0, 41)
    values = np.sin(6.0 * cycles)[:, None] * TORQUE
    ((columns),) = panels_of(mesh_maps_figure(cycles, TORQUE, {"stiffness (N/m)": values, "error (µm)": -values}))
    ((first,), (second,)) = columns
    np.testing.assert_array_equal(first.levels, values.T)
    np.testing.assert_allclose(first.at, cycles)
    np.testing.assert_allclose(first.positions, TORQUE)
    assert (first.title, second.title) == ("stiffness (N/m)", "error (µm)")
    assert first.y == second.y == "torque (N·m)"
    assert first.span == pytest.approx(np.ptp(values))
    uneven = np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 41))
    assert panels_of(mesh_maps_figure(uneven, TORQUE, {"stiffness (N/m)": values})) == []


def test_spectra_at_several_speeds_are_zoomed() -> None:
    spectra = {f"{rpm} rpm": np.linspace(1e-6, 2e-6, len(SWEEP_HZ)) for rpm in (500, 1000)}
    rows = panels_of(speed_spectra_figure(SWEEP_HZ, spectra))
    assert [panel.title for ((panel,),) in rows] == list(spectra)
    assert all(len(panel.lines) == 1 for ((panel,),) in rows)


def test_sweeps_of_one_case_are_named_where_they_are_zoomed():
    up, down = np.linspace(1e-6, 2e-6, 60), np.linspace(2e-6, 3e-6, 60)
    (((panel,),),) = panels_of(speed_sweep_figure([("170 N·m", SWEEP_HZ, up, down)], natural_hz=2650.0))
    assert [(c.position, c.label) for c in panel.cursors] == [(2650.0, "ωₙ"), (1325.0, "ωₙ/2"), (2650.0 / 3, "ωₙ/3")]
    assert not panel.title
    assert [(line.name, line.dotted) for line in panel.lines] == [("sweep up", False), ("sweep down", True)]


def test_spectra_share_one_scale():
    frequency = np.linspace(0.0, 5000.0, 500)
    spectra = {f"{n} rpm": n * 1e-9 * (1.0 + (frequency // 100 % 7 == 0)) for n in (1000, 2000)}
    figure = speed_spectra_figure(frequency, spectra, mesh_hz=(833.0, 1667.0), natural_hz=2650.0, title="DTE")
    limits = {axes.get_ylim() for axes in figure.axes}
    assert len(figure.axes) == 2
    assert len(limits) == 1
    assert {"1000 rpm", "2000 rpm", "frequency (Hz)", "transmission error (µm)"} <= set(texts_of(figure))


def test_natural_frequencies_that_move_stand_out():
    curves = np.column_stack((np.full(81, 800.0), 2650.0 - 300.0 * (MAP_CYCLES > 1.5)))
    figure = frequency_curves_figure(MAP_CYCLES, curves, title="over the angle")
    still, moving = figure.axes[0].lines
    assert still.get_linewidth() < moving.get_linewidth()
    np.testing.assert_allclose(moving.get_ydata(), curves[:, 1] / 1e3)
    with pytest.raises(InputError):
        frequency_curves_figure(MAP_CYCLES, curves[:5])
