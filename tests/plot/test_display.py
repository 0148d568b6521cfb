import numpy as np
import pytest

from gearsig.formatting import unit_text
from gearsig.plot import decibels, plain, with_unit


def test_decibels_of_amplitudes_and_powers():
    np.testing.assert_allclose(decibels(np.array([1.0, 10.0, 0.1]), "amplitude peak"), [0, 20, -20])
    np.testing.assert_allclose(decibels(np.array([1.0, 10.0]), "power density"), [0, 10])


def test_decibels_of_zeros_are_finite():
    assert np.isfinite(decibels(np.zeros(3), "amplitude peak")).all()
    np.testing.assert_allclose(decibels(np.array([0.0, 1.0]), "amplitude peak"), [-200, 0])


@pytest.mark.parametrize(
    ("unit", "text"), [("m/s^2", "m/s²"), ("(m/s^2)^2/Hz", "(m/s²)²/Hz"), ("s^-1", "s⁻¹"), ("a^b", "a^b"), ("", "")]
)
def test_units_get_superscripts(unit, text):
    assert unit_text(unit) == text


def test_unknown_unit_leaves_no_brackets():
    assert with_unit("amplitude", "") == "amplitude"


def test_plain_text_is_one_drawable_line_of_limited_length():
    assert plain("a\nb\tc\x00d") == "a b c d"
    assert plain("振動") == "??"
    long = plain("x" * 500, 20)
    assert len(long) == 20
    assert "…" in long
