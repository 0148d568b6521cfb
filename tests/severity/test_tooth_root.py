"""Closed forms of the tooth root against the simulator's own geometry, which was written independently."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.severity import percent_per_mm, root_thickness_mm
from sims.mesh import GearGeometry, crack_mouth_mm, crack_percent

TEETH = st.integers(18, 200)
MODULES = st.floats(0.5, 10.0)


@given(TEETH, MODULES)
def test_root_is_as_thick_as_the_rack_makes_it(teeth: int, module: float) -> None:
    expected = 2.0 * crack_mouth_mm(GearGeometry(teeth, module))[1]
    assert root_thickness_mm(teeth, module) == pytest.approx(expected, rel=1e-9)


@given(TEETH, MODULES, st.floats(0.1, 1.0))
def test_percent_per_millimetre_is_the_simulators(teeth: int, module: float, depth_mm: float) -> None:
    expected = crack_percent(GearGeometry(teeth, module), depth_mm, 45.0)
    assert depth_mm * percent_per_mm(teeth, module) == pytest.approx(expected, rel=1e-9)
