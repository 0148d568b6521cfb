import numpy as np
import pytest

from gearsig.formatting import unit_text
from gearsig.plot import decibel_text, decibels, plain, with_unit


def test_decibels_of_amplitudes_and_powers():
    np.testing.assert_allclose(decibels(np.array([1.0, 10.0, 0.1]), "amplitude peak"), [0, 20, -20])
    np.testing.assert_allclose(decibels(np.array([1.0, 10.0]), "power density"), [0, 10])


def test_a_pascal_of_sound_is_94_decibels():
    assert decibels(np.array([1.0]), "amplitude rms", "Pa")[0] == pytest.approx(93.979, abs=1e-3)
    assert decibels(np.array([1.0]), "power density", "Pa^2/Hz")[0] == pytest.approx(93.979, abs=1e-3)
    assert decibels(np.array([1.0]), "amplitude rms", "mm/s")[0] == 0.0


def test_levels_of_sound_are_of_root_mean_squares_whatever_the_scaling():
    rms = decibels(np.array([1.0]), "amplitude rms", "Pa")
    np.testing.assert_allclose(decibels(np.array([np.sqrt(2.0)]), "amplitude peak", "Pa"), rms)


@pytest.mark.parametrize(
    ("unit", "text"),
    [("Pa", "dB re 20 µPa"), ("Pa^2/Hz", "dB re (20 µPa)²/Hz"), ("m/s^2", "dB re 1 m/s²"), ("", "dB re 1")],
)
def test_what_decibels_refer_to(unit, text):
    assert decibel_text(unit) == text


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
