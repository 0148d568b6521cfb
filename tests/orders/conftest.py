"""Angle signals from closed forms."""

import numpy as np
import pytest

from gearsig.angle import AngleSignal, ShaftAngle


@pytest.fixture
def angle_signal():
    """Return a factory: function of the shaft angle in revolutions → AngleSignal at constant speed."""

    def make(of_angle, n_revolutions, *, per_rev=256, start=0.0, speed_rev_per_s=10.0, unit="g"):
        n = round(n_revolutions * per_rev)
        revolutions = start + np.arange(n) / per_rev
        ends = np.array([start, start + n_revolutions])
        angle = ShaftAngle("pinion", ends / speed_rev_per_s, ends, np.full(2, speed_rev_per_s), "constant")
        return AngleSignal(of_angle(revolutions)[None, :], per_rev, angle, start, ("a",), (unit,), per_rev / 2)

    return make
