"""Trees and the linear rule as plain arrays, against scikit-learn's own."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis
from sklearn.ensemble import ExtraTreesClassifier

from gearsig.gap import ForestNodes, LinearRule


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


def test_trees_say_what_the_forest_says(forest: ExtraTreesClassifier) -> None:
    new = np.random.default_rng(4).normal(size=(100, 12))
    found = np.array([ForestNodes.of(forest).probabilities(row) for row in new])
    assert found == pytest.approx(forest.predict_proba(new), abs=0.03)  # shares in 15ths, thresholds in half precision


def test_the_rule_says_what_the_discriminant_says(linear: LinearDiscriminantAnalysis, rows: np.ndarray) -> None:
    rule = LinearRule(linear.coef_, linear.intercept_)
    found = np.array([rule.probabilities(row) for row in rows])
    assert found == pytest.approx(linear.predict_proba(rows), abs=1e-4)
