"""Figures of forces from motion: what they draw is what was estimated."""

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.motion import estimate_forces, measure_motion, noise_study
from gearsig.plot import force_figure, noise_figure
from tests.motion.recordings import start_stop, without


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
