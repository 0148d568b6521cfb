"""Healthy and faulty drive in one figure."""

import numpy as np
import pytest

from gearsig.motion import examine_start_stop, measure_motion
from gearsig.plot import FAULTY, HEALTHY, start_stop_pair_figure
from tests.motion.recordings import continuous, start_stop


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
