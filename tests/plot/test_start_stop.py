"""Figures of start–stop motion, of a healthy drive beside a faulty one, and of forces: they draw what is there."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.motion import StartStop, estimate_forces, examine_start_stop, measure_motion, noise_study
from gearsig.plot import (
    FAULTY,
    HEALTHY,
    force_figure,
    impacts_figure,
    motion_profile_figure,
    noise_figure,
    start_stop_pair_figure,
)
from tests.motion.recordings import continuous, start_stop, without


@pytest.fixture(scope="module")
def examined() -> StartStop:
    return examine_start_stop(measure_motion(start_stop()))


def test_course_has_speed_torque_and_compression_over_phases(examined: StartStop) -> None:
    speed, torque, compression = motion_profile_figure(examined).axes
    assert max(speed.lines[0].get_ydata()) == pytest.approx(examined.motion.driver_speed_rad_s.max() * 30.0 / np.pi)
    assert max(torque.lines[0].get_ydata()) == pytest.approx(examined.motion.torque_nm.max())  # type: ignore[union-attr]  # measured
    walls = [line.get_ydata()[0] for line in compression.lines[1:]]
    assert examined.backlash is not None
    assert walls == pytest.approx([-0.5 * examined.backlash.backlash_um, 0.5 * examined.backlash.backlash_um])
    assert len(speed.patches) == len(torque.patches) == 8  # two cycles of four phases


def test_course_without_torque_has_two_panels() -> None:
    examined = examine_start_stop(measure_motion(without(start_stop(), "torque")))
    assert [a.get_ylabel() for a in motion_profile_figure(examined).axes] == ["driver (rpm)", "compression (µm)"]


def test_every_impact_is_drawn_once_in_each_panel(examined: StartStop) -> None:
    over_time, by_tooth, bounce = impacts_figure(examined.impacts, 20, restitution=0.95).axes
    for axes in (over_time, by_tooth):
        assert sum(len(line.get_xdata()) for line in axes.lines) == len(examined.impacts)
    drawn = np.sort(np.concatenate([line.get_ydata() for line in over_time.lines]))
    assert drawn == pytest.approx(np.sort([i.energy_j for i in examined.impacts]))
    assert bounce.lines[-1].get_ydata()[0] == 0.95
    assert over_time.get_ylabel() == "energy (J)"


def test_speed_stands_for_energy_where_an_inertia_is_not_known(examined: StartStop) -> None:
    unknown = [replace(i, energy_j=float("nan")) for i in examined.impacts]
    assert impacts_figure(unknown, 20).axes[0].get_ylabel() == "speed (m/s)"
    with pytest.raises(InputError, match="no impacts"):
        impacts_figure([], 20)


# Healthy and faulty drive in one figure.


def test_every_panel_has_a_curve_of_either() -> None:
    healthy, worn = (examine_start_stop(measure_motion(start_stop(wear_um=w))) for w in (0.0, 60.0))
    figure = start_stop_pair_figure(healthy, worn, curves_um=(np.zeros(20), np.linspace(-3.0, 3.0, 20)))
    for axes in figure.axes:
        drawn = [line.get_color() for line in axes.lines] + [bar.get_facecolor() for bar in axes.patches]
        assert len(drawn) >= 2
    assert {HEALTHY, FAULTY} <= {line.get_color() for line in figure.axes[0].lines}
    note = " ".join(text.get_text() for text in figure.axes[1].texts)
    plays = [float(word) for word in note.split() if word[0].isdigit()]
    assert plays == pytest.approx([300.0, 360.0], rel=0.02)


def test_what_cannot_be_told_is_said_in_its_place() -> None:
    found = examine_start_stop(measure_motion(continuous()))
    figure = start_stop_pair_figure(found, found)
    assert any("no starts and stops" in text.get_text() for axes in figure.axes for text in axes.texts)


# Figures of forces from motion: what they draw is what was estimated.


def test_forces_above_errors_below_and_the_blow_beside() -> None:
    estimate = estimate_forces(measure_motion(start_stop()))
    figure = force_figure(estimate)
    upper, near, lower, near_errors = figure.axes
    assert [line.get_label() for line in upper.lines] == ["torque / base radius", "piecewise", "Hunt–Crossley"]
    measured = estimate.references_n["torque / base radius"]
    assert max(upper.lines[0].get_ydata()) == pytest.approx(measured.max() * 1e-3)
    worst = np.max(np.abs(estimate.forces_n["Hunt–Crossley"] - measured))
    assert np.max(np.abs(lower.lines[1].get_ydata())) == pytest.approx(worst * 1e-3)
    struck = np.argmin(measured) * 1e-3
    assert near.get_xlim()[0] < struck < near.get_xlim()[1]
    assert near_errors.get_xlim() == near.get_xlim()
    assert "kN" in upper.get_ylabel()


def test_noise_and_its_crossing() -> None:
    study = noise_study(start_stop(), rng=np.random.default_rng(1), levels_um=(0.0, 2.0, 20.0), n_draws=1)
    axes = noise_figure(study).axes[0]
    assert {line.get_label() for line in axes.lines[:3]} == {"piecewise", "Hunt–Crossley", "Kelvin–Voigt"}
    assert axes.lines[3].get_xdata()[0] == study.crossover_um


def test_without_a_reference_there_is_nothing_to_draw() -> None:
    estimate = estimate_forces(measure_motion(without(start_stop(), "torque", "interaction force")))
    with pytest.raises(InputError, match="reference"):
        force_figure(estimate)
