"""Changes of transmission errors that one simulator teaches hold for the other's."""

from __future__ import annotations

import numpy as np
import pytest

from app.studies.gap.tooth_errors import SIMULATORS, known_tooth_errors_of, named
from gearsig.gap import KnownToothErrors


@pytest.fixture(scope="module")
def known() -> dict[str, KnownToothErrors]:
    return {name: known_tooth_errors_of(name, 100) for name in SIMULATORS}


@pytest.mark.study
@pytest.mark.parametrize("left_out", [*SIMULATORS])
def test_faults_of_a_simulator_left_out_are_named(known: dict[str, KnownToothErrors], left_out: str) -> None:
    """By chance one in four; 0.84 and 0.80 with 600 of each, a third of the pitch errors of one tooth."""
    (fitted_to,) = (errors for name, errors in known.items() if name != left_out)
    unseen = known[left_out]
    likeliest, probability = named(fitted_to, unseen.descriptors)
    right = likeliest == unseen.faults
    assert right.mean() > 0.7
    assert right[probability >= 0.9].mean() > 0.85
    assert np.mean(right[unseen.faults == "pitch_error"]) > 0.6
