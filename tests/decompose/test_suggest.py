"""The suggested number of modes on signals whose components are known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from gearsig.decompose import noise_width, peak_centres, suggest_modes
from gearsig.errors import GearsigError, InputError, RefusalError

N = 6000
SAMPLES = np.arange(N)


def _tones(*cycles: float) -> np.ndarray:
    return sum((np.cos(2 * np.pi * f * SAMPLES + 40 * f) for f in cycles), start=np.zeros(N))


@pytest.mark.slow
@settings(max_examples=6)
@given(
    places=st.sets(st.integers(1, 9), min_size=1, max_size=5),
    seed=st.integers(0, 99),
    level=st.sampled_from([0.05, 0.4]),
)
def test_tones_in_noise_are_counted_and_placed(places, seed, level):
    cycles = np.array(sorted(places)) * 0.048
    x = _tones(*cycles) + level * np.random.default_rng(seed).normal(size=N)
    suggestion = suggest_modes(x, 10.0, penalties=(1000.0, 2000.0))
    assert suggestion.settings.n_modes == len(places)
    assert suggestion.chosen.centres == pytest.approx(10.0 * cycles, abs=0.02)


def test_the_usual_penalty_stays_where_it_does():
    suggestion = suggest_modes(_tones(0.05, 0.2, 0.35) + 0.1 * np.random.default_rng(0).normal(size=N), 1.0)
    assert suggestion.settings.penalty == 2000.0
    assert suggestion.settings.start == "uniform"


def test_close_tones_ask_for_a_larger_penalty_and_the_text_says_why():
    suggestion = suggest_modes(_tones(0.1, 0.12) + 0.1 * np.random.default_rng(0).normal(size=N), 1.0)
    assert (suggestion.settings.n_modes, suggestion.settings.penalty) == (2, 5000.0)
    assert "At the usual penalty of 2000 two modes share the same lines." in suggestion.reasons


def test_the_table_holds_every_trial():
    x = _tones(0.05, 0.2) + 0.1 * np.random.default_rng(0).normal(size=N)
    suggestion = suggest_modes(x, 1.0, max_modes=4, penalties=(2000.0, 500.0))
    assert [(t.penalty, t.n_modes) for t in suggestion.trials] == [
        (p, k) for p in (500.0, 2000.0) for k in (1, 2, 3, 4)
    ]
    table = suggestion.to_frame()
    assert list(table["settings.n_modes"]) == [t.n_modes for t in suggestion.trials]
    assert suggestion.chosen in suggestion.trials
    assert any(t.objection == "a mode is as wide as noise" for t in suggestion.trials)


def test_the_largest_number_tried_says_so():
    suggestion = suggest_modes(_tones(0.05, 0.2, 0.35), 1.0, max_modes=2)
    assert any("No larger number was tried" in reason for reason in suggestion.reasons)


def test_a_long_signal_is_tried_on_its_middle():
    suggestion = suggest_modes(_tones(0.05, 0.2), 1.0, longest=2000, penalties=(2000.0,))
    assert suggestion.reasons[-1] == "Tried on 2000 of 6000 samples, from the middle."


def test_noise_alone_is_refused():
    with pytest.raises(RefusalError, match="as wide as noise"):
        suggest_modes(np.random.default_rng(3).normal(size=N), 1.0, penalties=(500.0, 2000.0))


@pytest.mark.parametrize("n_modes", [1, 4, 12])
def test_width_of_noise_in_a_mode(n_modes):
    reach = 0.25 * np.sqrt(2000.0) / n_modes
    second = quad(lambda x: x**2 / (1 + x**2) ** 2, -reach, reach)[0]
    total = quad(lambda x: 1 / (1 + x**2) ** 2, -reach, reach)[0]
    assert noise_width(2000.0, n_modes) == pytest.approx(np.sqrt(second / total), rel=1e-9)


@pytest.mark.parametrize("n_lines", [50, 5000])
@pytest.mark.parametrize("penalty", [1.0, 2000.0, 1e8])
def test_starts_at_peaks_find_lines(n_lines, penalty):
    power = np.zeros(n_lines)
    power[[n_lines // 5, n_lines // 2]] = 4.0, 1.0
    centres = peak_centres(power, penalty, 2)
    assert np.all((centres >= 0) & (centres <= 0.5))
    if penalty == 2000.0:
        assert centres == pytest.approx([0.1, 0.25], abs=0.002)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"max_modes": 0}, "max_modes"),
        ({"penalties": ()}, "penalties is empty"),
        ({"penalties": (-1.0,)}, "penalties"),
        ({"longest": 5}, "longest"),
    ],
)
def test_settings_that_do_not_do(wrong, message):
    with pytest.raises(InputError, match=message):
        suggest_modes(_tones(0.1), 1.0, **wrong)


@pytest.mark.parametrize("values", [np.zeros(100), np.r_[np.inf, np.ones(99)], np.arange(5.0)])
def test_signals_that_do_not_do(values):
    with pytest.raises(GearsigError):
        suggest_modes(values, 1.0)
