"""Stress intensity from released energy against handbook strips; Paris' law against its closed form."""

from dataclasses import replace
from functools import cache
from math import cos, pi, sin, sqrt, tan

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.fe_gear import (
    GearBlank,
    MeshSize,
    SectorMesh,
    cylindrical_turn,
    factorised,
    ready_gear,
    sector_matrices,
    sector_mesh,
)
from sims.mesh import GearGeometry, GearMesh, PairGeometry
from sims.reduced_fe import (
    STEEL_IN_AIR,
    GrowthLaw,
    GrowthStage,
    crack_growth,
    energy_release_m,
    stress_intensity,
)

WIDTH, HALF, THICK = 20e-3, 30e-3, 4e-3
N_ACROSS, N_UP = 16, 8


@cache
def strip_compliances() -> tuple[np.ndarray, np.ndarray]:
    """Compliance that edge cracks add to a strip, of the gears' own elements in plane strain: (n,) depths and (n, 2).

    Half of it is held on its line of symmetry beyond the crack; its end is pulled by a unit force, evenly, or bent by a
    unit moment.
    """
    own = sector_mesh(GearBlank(GearGeometry(30, 3.0)), MeshSize(2, 1, 3, 1, 1, 1))  # a frame for the strip's cells
    x = np.linspace(0.0, WIDTH, 2 * N_ACROSS + 1)
    y = HALF * np.linspace(0.0, 1.0, 2 * N_UP + 1) ** 2
    shape = (len(x), len(y), 3)
    points = np.array(np.meshgrid(x + 0.1, y, np.linspace(0.0, THICK, 3), indexing="ij")).reshape(3, -1).T
    number = np.arange(len(points)).reshape(shape)
    cells = [number[i : i + 3, j : j + 3] for i in range(0, len(x) - 2, 2) for j in range(0, len(y) - 2, 2)]
    strip = SectorMesh(
        own.blank, own.size, points, np.array(cells), *(np.zeros(0, int),) * 2, number[:1, 0], number[:1]
    )
    turn = cylindrical_turn(strip)
    stiffness = (turn.T @ sector_matrices(strip)[0] @ turn).tocsc()
    # Along the end's line Simpson's weights, over the thickness 1/6, 4/6, 1/6.
    line = np.ones(len(x))
    line[1::2], line[2:-1:2] = 4.0, 2.0
    pulls = line[:, None] / line.sum() * np.column_stack((np.ones(len(x)), (x - WIDTH / 2.0) * 12.0 / WIDTH**2))
    force = np.zeros((3 * len(points), 2))
    force[3 * number[:, -1] + 1] = pulls[:, None] * np.array([1.0, 4.0, 1.0])[:, None] / 6.0
    plane = 3 * np.arange(len(points)) + 2
    found, n_depths = [], 10
    for n_cells in range(n_depths + 1):
        held = np.concatenate((plane, 3 * number[2 * n_cells :, 0].ravel() + 1, [3 * number[-1, 0, 0]]))
        free = np.setdiff1d(np.arange(len(force)), held)
        moved = factorised(stiffness[free][:, free])(force[free])
        found.append(np.einsum("nl,nl->l", force[free], moved))
    return WIDTH / N_ACROSS * np.arange(1, n_depths + 1), 2.0 * (np.array(found[1:]) - found[0])  # both halves


@pytest.mark.parametrize("bending", [False, True])
def test_strips_have_the_stress_intensity_of_the_handbook(bending: bool) -> None:
    """Tada, Paris, Irwin: K = σ √(πa) F(a/W) for a strip pulled and one bent, 0.5 % formulas; here within 3 %."""
    depth, added = strip_compliances()
    at = np.linspace(0.15, 0.5, 8) * WIDTH
    modulus = 206e9 / (1.0 - 0.3**2)
    found = np.sqrt(modulus * energy_release_m(depth, added, at)[:, int(bending)] / (2.0 * THICK))
    stress = 6.0 / (THICK * WIDTH**2) if bending else 1.0 / (THICK * WIDTH)
    for k, a in zip(found, at / WIDTH, strict=True):
        head, angle = sqrt(2.0 / (pi * a) * tan(pi * a / 2.0)) / cos(pi * a / 2.0), sin(pi * a / 2.0)
        shape = head * (0.923 + 0.199 * (1.0 - angle) ** 4 if bending else 0.752 + 2.02 * a + 0.37 * (1.0 - angle) ** 3)
        assert k == pytest.approx(stress * sqrt(pi * a * WIDTH) * shape, rel=0.03)


def test_turns_are_the_closed_form_of_paris() -> None:
    """N = (a1^(1−m/2) − a0^(1−m/2))/((1 − m/2) C (Y σ √π)^m)."""
    law = GrowthLaw((GrowthStage(1e-8, 3.0),), threshold=0.0, toughness=1e3)
    depth = np.linspace(1.0, 4.0, 60)
    k = 200.0 * np.sqrt(pi * depth * 1e-3)
    found = crack_growth(depth, k, law, np.random.default_rng(0), n_specimens=20)
    closed = (4.0**-0.5 - 1.0) / (-0.5 * 1e-8 * (200.0 * sqrt(pi * 1e-3)) ** 3)
    assert found.remaining_turns == pytest.approx((closed,) * 3, rel=1e-3)
    assert found.ends == "depth"


def test_the_interval_is_that_of_the_scatter() -> None:
    """A factor on C alone divides the turns: 5 % and 95 % lie at 10^(±1.645 s)."""
    law = GrowthLaw((GrowthStage(1e-8, 3.0, scatter=0.2),), threshold=0.0)
    depth = np.linspace(1.0, 3.0, 20)
    low, middle, high = crack_growth(
        depth, 5.0 + depth, law, np.random.default_rng(1), n_specimens=20000
    ).remaining_turns
    assert np.log10(high / middle) == pytest.approx(1.645 * 0.2, rel=0.05)
    assert np.log10(middle / low) == pytest.approx(1.645 * 0.2, rel=0.05)
    wider = crack_growth(depth, 5.0 + depth, law, np.random.default_rng(1), first_mm=(0.8, 1.6)).remaining_turns
    assert wider[2] / wider[0] > high / low


def test_two_stages_meet_where_the_standard_says() -> None:
    """BS 7910: the mean stages cross at 363 N/mm^1.5."""
    a, b = STEEL_IN_AIR.stages
    crossing = np.array([363.0 / sqrt(1e3)])
    assert a.rate_mm(crossing) == pytest.approx(b.rate_mm(crossing), rel=0.01)
    assert b.rate_mm(crossing)[0] == pytest.approx(3.98e-13 * 363.0**2.88, rel=1e-9)
    assert STEEL_IN_AIR.rate_mm(np.array([1.9]))[0] == 0.0


def test_a_crack_below_the_threshold_rests_and_one_above_the_toughness_ends() -> None:
    depth = np.linspace(1.0, 3.0, 10)
    resting = crack_growth(depth, np.full(10, 1.5), STEEL_IN_AIR, np.random.default_rng(0), n_specimens=20)
    assert resting.resting_share == 1.0
    assert resting.remaining_turns == (np.inf,) * 3
    broken = crack_growth(depth, 40.0 * depth, STEEL_IN_AIR, np.random.default_rng(0), n_specimens=20)
    assert (broken.ends, broken.depth_mm[-1] < 2.0) == ("toughness", True)
    with pytest.raises(InputError):
        crack_growth(depth, 100.0 * depth, STEEL_IN_AIR, np.random.default_rng(0), n_specimens=20)


def test_stress_intensity_of_a_tooth_is_that_of_a_short_cantilever() -> None:
    """Proportional to the load; of the size of a strip bent by the same moment across the same section."""
    gear = ready_gear("z55_m2")
    g = gear.blank.geometry
    mesh = GearMesh(PairGeometry(g, ready_gear("z75_m2").blank.geometry))
    depth = np.array([0.6, 1.0])
    one, two = (stress_intensity(gear, mesh, 1, torque, depth) for torque in (110.0, 220.0))
    assert two.k_mpa_sqrt_m == pytest.approx(2.0 * one.k_mpa_sqrt_m, rel=1e-6)
    force, width = one.force_n[0], 20e-3
    arm, thickness = 2.2e-3, 4.4e-3  # from the root to the outermost point of single contact; at the fillets' middles
    a = 0.6 * sin(pi / 4.0) * 1e-3 / thickness
    head, angle = sqrt(2.0 / (pi * a) * tan(pi * a / 2.0)) / cos(pi * a / 2.0), sin(pi * a / 2.0)
    strip = 6.0 * force * arm / (width * thickness**2) * sqrt(pi * a * thickness) * head
    strip *= 0.923 + 0.199 * (1.0 - angle) ** 4
    assert one.k_mpa_sqrt_m[0] == pytest.approx(strip * 1e-6, rel=0.35)
    with pytest.raises(InputError, match="depth"):
        stress_intensity(gear, mesh, 1, 110.0, np.array([50.0]))
    with pytest.raises(InputError):
        stress_intensity(gear, replace(mesh, pair=PairGeometry(g, g)), 2, 110.0, np.array([9.0]))
