"""Flexible pairs for tests: of the ready-made gear or the synthetic one."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from sims.fe_gear import ready_gear
from sims.mesh import GearMesh, PairGeometry
from sims.reduced_fe import FlexiblePair, ReducedPair
from sims.simulator import SimulationSetup
from tests.sims.reduced_fe.synthetic import synthetic_gear


@cache
def pair_of(preset_name="flexible_50_50", **parameters) -> FlexiblePair:
    return ReducedPair().prepare(SimulationSetup(preset_name, parameters), np.random.default_rng(0)).pair


@cache
def synthetic_pair(**parameters) -> FlexiblePair:
    gear = synthetic_gear()
    return replace(pair_of(**parameters), gears=(gear, gear))


def ready_mesh(**fields) -> tuple[tuple, GearMesh]:
    gear = ready_gear("z50_m3")
    geometry = gear.blank.geometry
    return (gear, gear), GearMesh(PairGeometry(geometry, geometry), **fields)
