"""From weak to strong: the distance of each recording from its twin grows with the level."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.recording import Recording
from sims.blind import CATALOGUE, OUTSIDE_CATALOGUE, draw_case, record_case
from tests.sims.blind.order_domain import distance_db

pytestmark = pytest.mark.study

SEED = {"backlash": 6}
"""Backlash shows where the brake's pull turns the torque round: not on every rig."""
MIN_DB = {"unbalance": 0.5, "mains_hum": 0.5, "clipping": 0.5, "speed_fluctuation": 0.5, "eccentricity": 0.5}
"""Some touch only a few lines of the whole spectrum."""


def twins(name: str, level: float) -> tuple[Recording, Recording]:
    rng = np.random.default_rng(SEED.get(name, 12))
    case = draw_case(rng, "development", effect=name, level=level, n_conditions=1, with_reference=False)
    case = replace(case, conditions=(replace(case.conditions[0], duration_s=1.2),))
    made = record_case(case)
    return made.conditions[0], made.twins[0]


@pytest.mark.parametrize("name", [*CATALOGUE, *OUTSIDE_CATALOGUE])
def test_the_change_grows_with_the_level(name: str) -> None:
    weak, strong = (distance_db(*twins(name, level)) for level in (0.15, 1.0))
    assert strong > weak
    assert strong > MIN_DB.get(name, 1.0)
