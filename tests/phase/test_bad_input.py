"""Bad input to every tool of the room: a clear error that names the remedy."""

import numpy as np
import pytest

from gearsig.errors import GearsigError, InputError, RefusalError
from gearsig.phase import (
    PhasePortrait,
    average_mutual_information,
    constant_period_lock,
    delay_embedding,
    embedding_dimension,
    find_lock,
    largest_lyapunov_exponent,
    phase_plane,
    poincare_section,
    recurrence_measures,
    recurrence_plot,
    translation_walk,
    zero_one_test,
)
from gearsig.recording import Channel, Recording

SERIES_TOOLS = {
    "mutual information": lambda x: average_mutual_information(x, 1000.0),
    "dimension": lambda x: embedding_dimension(x, 1000.0),
    "embedding": lambda x: delay_embedding(x, 1000.0),
    "embedding as told": lambda x: delay_embedding(x, 1000.0, delay_samples=5, dimension=3),
    "0–1 test": zero_one_test,
    "walk": lambda x: translation_walk(x, 1.0),
    "phase plane": lambda x: phase_plane(x, 1000.0, quantity="acceleration", low_cut_hz=10.0),
}
PATH_TOOLS = {
    "exponent": largest_lyapunov_exponent,
    "recurrence plot": recurrence_plot,
    "recurrence measures": recurrence_measures,
}


def portrait(points):
    return PhasePortrait(np.asarray(points, dtype=float), 1000.0, ("x", "y"), ("m", "m"), "states", "test")


@pytest.mark.parametrize("name", SERIES_TOOLS)
@pytest.mark.parametrize("value", [0.0, 3.7, -1e6])
def test_a_constant_has_nothing_to_embed(name, value):
    with pytest.raises(RefusalError, match=r"constant.*nothing moves.*(check the sensor|vibrates)"):
        SERIES_TOOLS[name](np.full(3000, value))


@pytest.mark.parametrize("name", SERIES_TOOLS)
@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_a_number_is_refused(name, bad):
    x = np.random.default_rng(0).normal(size=3000)
    x[1234] = bad
    with pytest.raises(InputError, match=r"values.*(NaN|infinit|finite)"):
        SERIES_TOOLS[name](x)


@pytest.mark.parametrize("name", SERIES_TOOLS)
def test_too_short_says_how_much_is_needed(name):
    with pytest.raises(GearsigError, match=r"at least \d+|needs [\d.]+ s|too few"):
        SERIES_TOOLS[name](np.random.default_rng(0).normal(size=12))


@pytest.mark.parametrize("name", PATH_TOOLS)
def test_a_path_that_stands_still_is_refused(name):
    with pytest.raises(RefusalError, match=r"constant|does not move"):
        PATH_TOOLS[name](portrait(np.ones((3000, 2))))


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_portrait_of_what_is_not_a_number_cannot_be_made(bad):
    with pytest.raises(InputError, match="points"):
        portrait([[0.0, 1.0], [bad, 1.0]])


def test_a_section_without_a_period_is_refused():
    """No speed, no lock: neither a period of zero nor a recording that does not tell its speed."""
    for period in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="period_s"):
            constant_period_lock(period, 1.0)
    noise = np.random.default_rng(0).normal(size=(1, 4000))
    silent = Recording(noise, 1000.0, (Channel("a1", "acceleration", "m/s^2"),))
    with pytest.raises(GearsigError, match=r"speed|angle|tacho"):
        find_lock(silent)
    with pytest.raises(InputError, match=r"no rig, so 'stage' is not known"):
        find_lock(silent, pair="stage")


def test_a_period_longer_than_the_path_or_faster_than_its_samples_is_refused():
    path = portrait(np.random.default_rng(0).normal(size=(3000, 2)))
    with pytest.raises(RefusalError, match=r"no whole cycle.*record longer"):
        poincare_section(path, constant_period_lock(10.0, 30.0))
    with pytest.raises(RefusalError, match=r"faster than two samples per cycle.*slower shaft or sample faster"):
        poincare_section(path, constant_period_lock(0.0015, 3.0))
