"""Figures of start–stop motion: what they draw is what was found."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.motion import StartStop, examine_start_stop, measure_motion
from gearsig.plot import impacts_figure, motion_profile_figure
from tests.motion.recordings import start_stop, without


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
