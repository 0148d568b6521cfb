"""Which kind of damage: probabilities that add up, a closed form, and a fit that finds what separates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.studies.crack_severity import fit_kind
from gearsig.errors import InputError
from gearsig.severity import CHIPPED, CRACKED, KIND_FEATURES, KINDS, SPALLED, CrackEstimate, KindModel, load_calibration

N = len(KIND_FEATURES)


def model(weights: np.ndarray) -> KindModel:
    return KindModel(np.zeros(N), np.ones(N), weights)


def test_odds_are_the_exponential_of_the_weights() -> None:
    weights = np.zeros((3, N + 1))
    weights[1, 0], weights[2, 1] = np.log(2.0), np.log(3.0)
    vector = np.zeros(N)
    vector[0] = 1.0
    assert model(weights).probabilities(vector) == pytest.approx({CRACKED: 1 / 6, CHIPPED: 2 / 6, SPALLED: 3 / 6})


@pytest.mark.parametrize("name", ["with_reference", "alone"])
@given(st.integers(0, 2**31), st.floats(0.1, 1e6))
def test_probabilities_add_up_however_far(name: str, seed: int, size: float) -> None:
    vector = size * np.random.default_rng(seed).standard_normal(N)
    shares = load_calibration().kinds[name].probabilities(vector)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert min(shares.values()) >= 0.0


def test_a_fit_finds_what_separates() -> None:
    rng = np.random.default_rng(3)
    kinds = [KINDS[i] for i in rng.integers(0, 3, 600)]
    vectors = rng.standard_normal((600, N))
    vectors[:, 2] += [6.0 * (kind == CHIPPED) - 6.0 * (kind == SPALLED) for kind in kinds]
    fitted = fit_kind(vectors, kinds)
    right = 0
    for vector, kind in zip(vectors, kinds, strict=True):
        shares = fitted.probabilities(vector)
        right += max(shares, key=lambda name: shares[name]) == kind
    assert right > 590


def test_a_model_of_another_size_is_refused() -> None:
    with pytest.raises(InputError, match="weights"):
        model(np.zeros((3, N)))


@pytest.mark.parametrize(("cracked", "kind"), [(0.9, "cracked"), (0.5, "undecided"), (0.05, "chipped or spalled")])
def test_the_text_says_what_it_is(cracked: float, kind: str) -> None:
    estimate = CrackEstimate(
        shaft="input",
        gear="stage 1/input",
        tooth=12,
        angle_deg=140.0,
        gear_is_certain=True,
        depth_mm=2.0,
        depth_percent=30.0,
        interval_mm=(1.5, 2.5),
        interval_percent=(22.0, 38.0),
        p_value=0.01,
        with_reference=True,
        kind_probabilities={CRACKED: cracked, CHIPPED: 1 - cracked, SPALLED: 0.0},
    )
    assert estimate.kind == kind
    assert ("chipped" in estimate.text) == (kind != "cracked")
    assert "2.0 mm (1.5 to 2.5 mm)" in estimate.text
