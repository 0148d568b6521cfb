"""Trees and the linear rule as plain arrays, against scikit-learn's own; and what is kept of a fit on disk."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import ExtraTreesClassifier

from gearsig.gap import Fitted, LinearRule, Trees, keep_fitted, read_fitted


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    return np.random.default_rng(3).normal(size=(400, 12)).astype(np.float32)


@pytest.fixture(scope="module")
def causes(rows: np.ndarray) -> np.ndarray:
    return np.where(rows[:, 0] > 0.0, "crack", np.where(rows[:, 1] > 0.7, "wear", "none"))


@pytest.fixture(scope="module")
def forest(rows: np.ndarray, causes: np.ndarray) -> ExtraTreesClassifier:
    return ExtraTreesClassifier(30, min_samples_leaf=3, class_weight="balanced", random_state=0).fit(rows, causes)


@pytest.fixture(scope="module")
def linear(rows: np.ndarray, causes: np.ndarray) -> LinearDiscriminantAnalysis:
    return LinearDiscriminantAnalysis(solver="lsqr", shrinkage=0.2).fit(rows, causes)


@pytest.fixture
def fitted(forest: ExtraTreesClassifier, linear: LinearDiscriminantAnalysis) -> Fitted:
    return tuple(map(str, forest.classes_)), Trees.of(forest), LinearRule(linear.coef_, linear.intercept_)


@pytest.fixture(autouse=True)
def own_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path))


def test_trees_say_what_the_forest_says(forest: ExtraTreesClassifier) -> None:
    new = np.random.default_rng(4).normal(size=(100, 12))
    found = np.array([Trees.of(forest).probabilities(row) for row in new])
    assert found == pytest.approx(forest.predict_proba(new), abs=5e-4)


def test_the_rule_says_what_the_discriminant_says(linear: LinearDiscriminantAnalysis, rows: np.ndarray) -> None:
    rule = LinearRule(linear.coef_, linear.intercept_)
    found = np.array([rule.probabilities(row) for row in rows])
    assert found == pytest.approx(linear.predict_proba(rows), abs=1e-4)


def test_what_is_kept_says_the_same(fitted: Fitted, rows: np.ndarray) -> None:
    assert read_fitted("any") is None
    keep_fitted("any", fitted)
    again = read_fitted("any")
    assert again is not None
    assert again[2] is not None
    assert fitted[2] is not None
    assert again[0] == fitted[0]
    for row in rows[:20]:
        assert np.array_equal(again[1].probabilities(row), fitted[1].probabilities(row))
        assert np.array_equal(again[2].probabilities(row), fitted[2].probabilities(row))


def test_trees_alone_are_kept(fitted: Fitted) -> None:
    keep_fitted("any", (*fitted[:2], None))
    again = read_fitted("any")
    assert again is not None
    assert again[2] is None


def test_a_damaged_file_counts_for_nothing(fitted: Fitted, tmp_path: Path) -> None:
    keep_fitted("any", fitted)
    (path,) = (tmp_path / "forests").glob("any-*.npz")
    path.write_bytes(path.read_bytes()[:-300])
    assert read_fitted("any") is None


def test_what_another_state_of_the_code_left_is_not_read_and_goes(fitted: Fitted, tmp_path: Path) -> None:
    keep_fitted("any", fitted)
    (path,) = (tmp_path / "forests").iterdir()
    path.rename(path.with_name("any-0123456789abcdef.npz"))
    assert read_fitted("any") is None
    keep_fitted("any", fitted)
    assert list((tmp_path / "forests").iterdir()) == [path]


def test_a_folder_that_cannot_be_written_stops_nothing(
    fitted: Fitted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path / "file"))
    keep_fitted("any", fitted)
    assert read_fitted("any") is None
