"""The fit of the gap's probabilities, on drawn cases whose true probabilities are known."""

from __future__ import annotations

import numpy as np
import pytest

from app.studies.gap.calibrate import FALSE_ON_NONE, AttributedCase, fit_calibration
from gearsig.gap import NONE, UNKNOWN, GapCalibration

CAUSES = ("root_crack", "eccentricity", "unbalance", NONE, UNKNOWN)


def drawn(n: int, truth: GapCalibration, seed: int = 3) -> list[AttributedCase]:
    """Cases whose causes are drawn from the probabilities that `truth` gives."""
    rng = np.random.default_rng(seed)
    cases = []
    for _ in range(n):
        forest = dict(zip(CAUSES, rng.dirichlet(np.full(len(CAUSES), 0.7)).tolist(), strict=True))
        scores = {name: float(rng.uniform(-1.0, 1.0)) for name in CAUSES[:3]}
        size = float(np.exp(rng.uniform(-1.0, 1.5)))
        p = truth.probabilities(forest, scores, size)
        cases.append(AttributedCase((str(rng.choice(list(p), p=list(p.values()))),), forest, scores, size))
    return cases


@pytest.mark.study
@pytest.mark.parametrize(("sharpness", "weight"), [(0.6, 2.0), (1.3, 0.5)])
def test_the_drawn_calibration_is_found(sharpness: float, weight: float) -> None:
    truth = GapCalibration(sharpness, weight, 0.2, 0.7, -0.5, 0.5, 0.65, sharper=0.4, none_slope=-1.0)
    fitted = fit_calibration(drawn(3000, truth))
    assert fitted.sharpness == pytest.approx(sharpness, rel=0.2)
    assert fitted.shrink_weight == pytest.approx(weight, abs=0.3)
    assert fitted.none_bias == pytest.approx(0.7, abs=0.3)
    assert fitted.unknown_bias == pytest.approx(-0.5, abs=0.3)
    assert fitted.sharper == pytest.approx(0.4, abs=0.15)
    assert fitted.none_slope == pytest.approx(-1.0, abs=0.4)


@pytest.mark.slow
def test_few_healthy_cases_get_an_effect() -> None:
    cases = drawn(1500, GapCalibration(1.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.65))
    fitted = fit_calibration(cases)
    found = [fitted.probabilities(c.forest, c.scores, c.size) for c in cases if c.truths == (NONE,)]
    named = [1.0 - p[NONE] - p[UNKNOWN] >= fitted.named_from for p in found]
    assert 0.0 < np.mean(named) <= FALSE_ON_NONE + 1.5 / len(found)
