"""Where flanks touch and how far corners are apart, against the geometry done another way."""

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from sims.mesh import GearGeometry, PairGeometry, corner_separation_m

PAIRS = (
    PairGeometry(GearGeometry(50, 3.0, bore_radius_mm=20.0), GearGeometry(50, 3.0, bore_radius_mm=20.0)),
    PairGeometry(GearGeometry(30, 2.0), GearGeometry(75, 2.0)),
)


@pytest.mark.parametrize("pair", PAIRS)
def test_flanks_touch_all_along_the_path_of_contact(pair):
    inside = np.linspace(0.0, pair.contact_ratio, 50)
    assert np.all(corner_separation_m(pair, inside) == 0.0)
    assert np.all(corner_separation_m(pair, np.array([-0.01, pair.contact_ratio + 0.01])) > 0.0)


def test_equal_gears_enter_as_they_leave():
    pair = PAIRS[0]
    early = np.linspace(-0.3, 0.0, 31)
    late = pair.contact_ratio - early
    assert corner_separation_m(pair, early) == pytest.approx(corner_separation_m(pair, late), abs=1e-15)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("progress", [-0.05, -0.12, -0.25])
def test_entry_separation_is_the_turn_until_the_corner_meets_the_flank(pair, progress):
    """Turn the driver on until a polyline of its involute runs through the driven gear's tip corner."""
    rb1, rb2, length = pair.driver.base_radius_mm, pair.driven.base_radius_mm, pair.action_length_mm
    before = -progress * pair.base_pitch_mm
    back = before / rb2  # the driven gear, turned back against its cw motion
    start = np.array([-rb2, pair.start_radius_mm - length])
    rotation = np.array([[np.cos(back), -np.sin(back)], [np.sin(back), np.cos(back)]])
    corner = np.array([rb2, length]) + rotation @ start
    base = (pair.start_radius_mm - before) / rb1  # where the flank starts on the base circle

    def distance(turn):
        def off(u):
            angle = base + turn - u  # of the tangent point, from which the string of length rb1·u runs ahead
            x = rb1 * np.cos(angle) - rb1 * u * np.sin(angle) - rb1
            y = rb1 * np.sin(angle) + rb1 * u * np.cos(angle)
            return (x - corner[0]) ** 2 + (y - corner[1]) ** 2

        return minimize_scalar(off, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-13}).fun

    def side(turn):  # the derivative of the squared distance changes its sign where it is 0
        return distance(turn + 1e-7) - distance(turn - 1e-7)

    turn = brentq(side, -1e-4, 5e-2, xtol=1e-12)
    assert distance(turn) < 1e-10
    expected_mm = rb1 * turn
    assert 1e3 * corner_separation_m(pair, np.array([progress]))[0] == pytest.approx(expected_mm, rel=1e-3)


@pytest.mark.parametrize("lost", [(0.5, 0.0), (0.0, 0.5)])
def test_what_a_chip_leaves_is_the_corner_of_a_shorter_tooth(lost):
    """The entry of a driven gear whose teeth are shorter is later, by what the driver's contact then has behind it."""
    pair = PAIRS[1]
    shorter = PairGeometry(*(GearGeometry(z, 2.0, addendum=1.0 - h / 2.0) for z, h in zip((30, 75), lost, strict=True)))
    late = (shorter.start_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm
    progress = np.linspace(-0.3, pair.contact_ratio + 0.3, 41)
    chipped = corner_separation_m(pair, progress, lost)
    assert chipped == pytest.approx(corner_separation_m(shorter, progress - late), abs=1e-15)
    assert np.all(chipped >= corner_separation_m(pair, progress))
