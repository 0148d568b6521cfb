"""Figures of a flexible pair: maps, sweeps, spectra, natural frequencies."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.text import Text

from gearsig.errors import InputError
from gearsig.plot import frequency_curves_figure, mesh_maps_figure, panels_of, speed_spectra_figure, speed_sweep_figure

CYCLES = np.linspace(0.0, 2.0, 81)
TORQUE = np.linspace(10.0, 500.0, 20)
HZ = np.linspace(750.0, 3400.0, 60)


def texts(figure):
    figure.savefig(BytesIO(), format="png", dpi=40)
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def test_maps_show_values_over_angle_and_torque():
    values = 2.5 + 0.3 * np.cos(2.0 * np.pi * CYCLES)[:, None] + 1e-3 * TORQUE
    figure = mesh_maps_figure(CYCLES, TORQUE, {"stiffness (10⁸ N/m)": values, "STE (µm)": 4.0 * values}, title="A pair")
    assert {"stiffness (10⁸ N/m)", "STE (µm)", "torque (N·m)", "A pair"} <= set(texts(figure))
    drawn = figure.axes[0].collections[0].get_array()
    np.testing.assert_allclose(np.asarray(drawn).reshape(len(TORQUE), len(CYCLES)), values.T)
    with pytest.raises(InputError, match="shape"):
        mesh_maps_figure(CYCLES, TORQUE, {"x": values.T})
    with pytest.raises(InputError, match="4 maps"):
        mesh_maps_figure(CYCLES, TORQUE, dict.fromkeys("abcd", values))


def test_an_even_map_is_drawn_without_lines():
    mesh_maps_figure(CYCLES, TORQUE, {"even": np.ones((len(CYCLES), len(TORQUE)))})


def test_sweeps_show_both_ways_and_mark_the_mode():
    up, down = np.linspace(1e-6, 2e-6, 60), np.linspace(2e-6, 3e-6, 60)
    figure = speed_sweep_figure([("170 N·m", HZ, up, down)], natural_hz=2650.0, jumps_hz={"jump up": 2500.0})
    axes = figure.axes[0]
    np.testing.assert_allclose(axes.lines[0].get_ydata(), up * 1e6)
    np.testing.assert_allclose(axes.lines[1].get_ydata(), down * 1e6)
    assert axes.lines[1].get_linestyle() != axes.lines[0].get_linestyle()
    assert {"ωₙ", "ωₙ/2", "ωₙ/3", "jump up", "dynamic transmission error, rms (µm)"} <= set(texts(figure))
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
    spectra = {f"{rpm} rpm": np.linspace(1e-6, 2e-6, len(HZ)) for rpm in (500, 1000)}
    rows = panels_of(speed_spectra_figure(HZ, spectra))
    assert [panel.title for ((panel,),) in rows] == list(spectra)
    assert all(len(panel.lines) == 1 for ((panel,),) in rows)


def test_sweeps_of_one_case_are_named_where_they_are_zoomed():
    up, down = np.linspace(1e-6, 2e-6, 60), np.linspace(2e-6, 3e-6, 60)
    (((panel,),),) = panels_of(speed_sweep_figure([("170 N·m", HZ, up, down)], natural_hz=2650.0))
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
    assert {"1000 rpm", "2000 rpm", "frequency (Hz)", "transmission error (µm)"} <= set(texts(figure))


def test_natural_frequencies_that_move_stand_out():
    curves = np.column_stack((np.full(81, 800.0), 2650.0 - 300.0 * (CYCLES > 1.5)))
    figure = frequency_curves_figure(CYCLES, curves, title="over the angle")
    still, moving = figure.axes[0].lines
    assert still.get_linewidth() < moving.get_linewidth()
    np.testing.assert_allclose(moving.get_ydata(), curves[:, 1] / 1e3)
    with pytest.raises(InputError):
        frequency_curves_figure(CYCLES, curves[:5])
