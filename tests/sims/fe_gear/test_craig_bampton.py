"""Craig–Bampton reduction: against the whole gear's own matrices, and its accuracy."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.sparse import eye_array
from scipy.sparse.linalg import splu

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.fe_gear import (
    CraigBamptonGear,
    CraigBamptonPlan,
    CyclicGear,
    Masters,
    craig_bampton,
    matched,
    mesh_size_for,
    sector_mesh,
)
from tests.sims.fe_gear.fe_gears import PAPER, full_matrices, small_cyclic

PLAN = CraigBamptonPlan(n_dof=120, n_teeth=2, n_slices=3, n_auxiliary=2, n_shapes=20)


@cache
def small() -> CraigBamptonGear:
    return craig_bampton(small_cyclic().mesh, PLAN, 10)


def whole_rows(gear: CyclicGear, masters: Masters) -> FloatArray:
    """Masters as rows over the degrees of freedom of the whole gear."""
    z, n_own = gear.n_sectors, 3 * len(gear.own_nodes)
    rows = np.zeros((masters.n_masters, z, n_own))
    for k in range(z):
        c, s = np.cos(2 * np.pi * k / z), np.sin(2 * np.pi * k / z)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        rows[:6, k] = np.kron(np.eye(2), turn) @ gear.hub
    for a, (row, tooth) in enumerate(zip(masters.row_of, masters.tooth_of, strict=True)):
        rows[6 + a, tooth] = masters.rows[row]
    return rows.reshape(masters.n_masters, -1)


@pytest.mark.slow
def test_masters_carry_the_static_stiffness_and_mass_of_the_whole_gear() -> None:
    """Guyan's matrices: static answers to unit motions of the masters, from K and M of all sectors."""
    gear, reduced = small_cyclic(), small()
    stiffness, mass = full_matrices(gear)
    rows = whole_rows(gear, reduced.masters)
    hub = rows[:6]
    weight = 1e9 * np.diag([1.0, 1.0, 1.0, 1e-4, 1e-4, 1e-4])
    solve = _held_by_springs(stiffness, hub, weight)
    static = solve(rows.T) @ np.linalg.inv(rows @ solve(rows.T))
    m = reduced.masters.n_masters
    expected_k, expected_m = static.T @ (stiffness @ static), static.T @ (mass @ static)
    scale = np.sqrt(np.outer(np.diag(expected_k), np.diag(expected_k)))
    np.testing.assert_allclose(reduced.stiffness[:m, :m] / scale, expected_k / scale, atol=1e-6)
    scale = np.sqrt(np.outer(np.diag(expected_m), np.diag(expected_m)))
    np.testing.assert_allclose(reduced.mass[:m, :m] / scale, expected_m / scale, atol=1e-6)


def _held_by_springs(stiffness: Any, hub: FloatArray, weight: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Solve (K + HᵀWH) u = f without forming it: by a definite matrix close by, and iteration."""
    base = splu((stiffness + 1e4 * eye_array(stiffness.shape[0])).tocsc())
    small = np.linalg.inv(np.linalg.inv(weight) + hub @ base.solve(hub.T))

    def solve(loads: FloatArray) -> FloatArray:
        answer = np.zeros_like(loads)
        for _ in range(12):
            rest = loads - stiffness @ answer - hub.T @ (weight @ (hub @ answer))
            first = base.solve(rest)
            answer = answer + first - base.solve(hub.T @ (small @ (hub @ first)))
        return answer

    return solve


def test_a_reduced_gear_is_free_and_keeps_its_modes() -> None:
    accuracy = small().accuracy
    assert accuracy.rigid_hz.max() < 0.1
    assert accuracy.errors.min() > -1e-9  # a reduced model is never softer than the full one
    assert accuracy.worst_error < 2e-3
    assert accuracy.minimum_mac > 0.999
    assert small().stiffness.shape == (120, 120)
    assert len(accuracy.table().splitlines()) == 1 + len(accuracy.full_hz)


@pytest.mark.slow
def test_more_modes_come_closer() -> None:
    worst = [craig_bampton(small_cyclic().mesh, replace(PLAN, n_dof=n), 12).accuracy.worst_error for n in (50, 90, 140)]
    assert worst[0] > worst[1] > worst[2]


def test_the_subspace_mac_does_not_depend_on_the_vectors_of_a_pair() -> None:
    turn = np.linalg.qr(np.random.default_rng(2).standard_normal((2, 2)))[0]
    products = np.eye(4)
    products[1:3, 1:3] = turn
    found = matched(np.array([1.0, 2.0, 2.0, 5.0]), np.array([1.0, 2.0, 2.0, 5.0]), products, rigid_hz=np.zeros(6))
    np.testing.assert_allclose(found.subspace_mac, 1.0)
    tilted = products * np.array([1.0, 1.0, 1.0, 0.6])
    assert matched(found.full_hz, found.full_hz, tilted, rigid_hz=np.zeros(6)).minimum_mac == pytest.approx(0.36)


def test_too_few_degrees_of_freedom_are_refused() -> None:
    with pytest.raises(InputError, match="n_dof is 60"):
        CraigBamptonPlan(n_dof=60)


def test_more_slices_than_layers_of_nodes_are_refused() -> None:
    with pytest.raises(InputError, match="n_slices is 5"):
        craig_bampton(small_cyclic().mesh)


@pytest.mark.study
def test_the_paper_gear_to_229_degrees_of_freedom() -> None:
    """Below 0.05 % in the first 20 frequencies, subspace MAC above 0.999."""
    accuracy = craig_bampton(sector_mesh(PAPER, mesh_size_for(PAPER, 277_200))).accuracy
    assert len(accuracy.full_hz) == 20
    assert accuracy.worst_error < 5e-4
    assert accuracy.minimum_mac > 0.999
