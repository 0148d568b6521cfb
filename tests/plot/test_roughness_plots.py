"""Figures of rough flanks: friction and backlash."""

from io import BytesIO

import numpy as np
import pytest
from matplotlib.text import Text

from gearsig.errors import InputError
from gearsig.plot import backlash_figure, friction_figure

CYCLES = np.linspace(0.0, 1.7, 341)
TIME = np.linspace(0.0, 0.5, 1001)
HZ = np.linspace(10.0, 2000.0, 1991)


def _texts(figure):
    figure.savefig(BytesIO(), format="png", dpi=40)
    return [text.get_text() for text in figure.findobj(Text) if text.get_text()]


def _line(axes, label):
    return next(line for line in axes.lines if line.get_label() == label)


def test_friction_is_drawn_as_given_and_names_approach_and_recess():
    curves = {"0 µm": 0.02 * (0.9 - CYCLES), "1.4 µm": 0.15 * (0.9 - CYCLES)}
    figure = friction_figure(CYCLES, curves, pitch_point=0.9, single_pair=(0.7, 1.0), heading="roughness", title="μ")
    for label, values in curves.items():
        np.testing.assert_array_equal(_line(figure.axes[0], label).get_ydata(), values)
    assert {"0 µm", "1.4 µm", "roughness", "pitch point", "approach", "recess", "μ"} <= set(_texts(figure))
    assert figure.axes[0].get_ylabel() == "friction coefficient × direction (–)"
    assert "tooth passages" in figure.axes[0].get_xlabel()


def test_friction_without_sign_starts_at_zero_and_may_have_gaps():
    values = np.abs(0.9 - CYCLES)
    values[300:] = np.nan
    figure = friction_figure(CYCLES, {"a": values})
    assert figure.axes[0].get_ylim()[0] == 0.0
    assert figure.axes[0].get_ylabel() == "friction coefficient (–)"
    assert _texts(figure)


@pytest.mark.parametrize(
    ("curves", "region", "message"),
    [
        ({"a": np.ones(5)}, None, "has 5 points"),
        ({"a": np.ones((341, 2))}, None, "shape"),
        ({"a": np.ones(341)}, (1.0, 0.7), "single_pair"),
        ({str(i): np.ones(341) for i in range(9)}, None, "holds 9 curves"),
        ({"a": np.full(341, np.nan)}, None, "no number"),
    ],
)
def test_friction_refuses_what_does_not_fit(curves, region, message):
    with pytest.raises(InputError, match=message):
        friction_figure(CYCLES, curves, single_pair=region)


def _backlash(**changes):
    given = {
        "time_s": TIME,
        "backlash_m": {"smooth": np.full(1001, 2e-5), "rough": 2e-5 + 1e-6 * np.cos(120 * TIME)},
        "frequency_hz": HZ,
        "amplitude_m": {"smooth": np.zeros(1991), "rough": 1e-6 / HZ},
    } | changes
    return backlash_figure(**given, lines_hz=(17.9, 26.9, 4321.0), mesh_frequency_hz=458.3)


def test_backlash_and_its_spectrum_are_drawn_in_um():
    figure = _backlash()
    upper, lower = figure.axes
    np.testing.assert_allclose(_line(upper, "rough").get_ydata(), 20 + np.cos(120 * TIME))
    spectra = [line for line in lower.lines if len(line.get_xdata()) == 1991]
    assert len(spectra) == 1  # a smooth flank has no lines
    np.testing.assert_allclose(spectra[0].get_ydata(), 1 / HZ)
    texts = _texts(figure)
    assert {"17.9", "26.9", "mesh", "time (s)", "frequency (Hz)"} <= set(texts)
    assert {"half backlash (µm)", "amplitude (µm peak)"} <= set(texts)
    assert "4321" not in texts


def test_backlash_of_smooth_flanks_alone_draws():
    assert _texts(_backlash(backlash_m={"a": np.full(1001, 2e-5)}, amplitude_m={"a": np.zeros(1991)}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frequency_hz": HZ - 10.0}, "logarithmic"),
        ({"amplitude_m": {"rough": 1e-6 / HZ}}, "same names"),
        ({"amplitude_m": {"smooth": np.zeros(3), "rough": np.zeros(3)}}, "has 3 points"),
        ({"time_s": TIME[:-1]}, "its axis 1000"),
    ],
)
def test_backlash_refuses_what_does_not_fit(changes, message):
    with pytest.raises(InputError, match=message):
        _backlash(**changes)
