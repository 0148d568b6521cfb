"""Closed forms of the tooth root against the simulator's own geometry, which was written independently."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.severity.tooth_root import contact_ratio, percent_per_mm, root_thickness_mm
from sims.mesh import GearGeometry, PairGeometry
from sims.mesh.crack import crack_mouth_mm, crack_percent

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


@given(TEETH, TEETH)
def test_contact_ratio_is_the_pairs(first: int, second: int) -> None:
    expected = PairGeometry(GearGeometry(first, 1.0), GearGeometry(second, 1.0)).contact_ratio
    assert contact_ratio(first, second) == pytest.approx(expected, rel=1e-9)


def test_contact_ratio_of_the_published_symmetric_pair() -> None:
    assert contact_ratio(50, 50) == pytest.approx(1.755, abs=5e-4)
