"""What the forest sees: bounded shares, differences of the right sign, and shafts that can be exchanged."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.gap import contrast_rows, load_learned, mirrored

NAMES = load_learned().change_names
FEATURES = load_learned().feature_names


@pytest.mark.parametrize("names", [NAMES, FEATURES])
def test_exchanging_the_shafts_twice_changes_nothing(names: tuple[str, ...]) -> None:
    exchanged = mirrored(names)
    np.testing.assert_array_equal(exchanged[exchanged], np.arange(len(names)))
    assert names[exchanged[names.index("sideband.driver.1")]] == "sideband.driven.1"
    assert names[exchanged[names.index("mesh.total")]] == "mesh.total"


@pytest.mark.parametrize("names", [NAMES, FEATURES])
def test_shares_do_not_depend_on_the_size_of_the_whole_change_much(names: tuple[str, ...]) -> None:
    n = len(names)
    rows = np.zeros((2, n))
    rows[:, names.index("sideband.driver.1")] = 10.0, 40.0
    rows[:, names.index("shaft.driver.1")] = -5.0, -20.0
    seen = contrast_rows(names, rows)
    shares = seen[:, n : 2 * n]
    assert np.abs(shares).max() == 1.0
    assert shares[0] == pytest.approx(shares[1], abs=0.1)


def test_what_did_not_change_is_zero() -> None:
    assert not contrast_rows(NAMES, np.zeros((1, len(NAMES)))).any()
