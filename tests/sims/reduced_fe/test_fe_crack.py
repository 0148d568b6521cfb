"""A cracked tooth: the ring of sectors, what a crack adds, and the potential-energy method."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.mesh import RootCrack
from sims.mesh.stiffness_tooth import tooth_compliance
from sims.reduced_fe.cracked_tooth import (
    CRACK_SIZE,
    _chain,
    crack_compliance_m_per_n,
    crack_meshes,
    tooth_compliance_with,
)
from sims.reduced_fe.elements import sector_matrices
from sims.reduced_fe.flank_rows import flank_grid
from sims.reduced_fe.mesh_quality import mesh_quality
from sims.reduced_fe.mesh_size import MeshSize
from tests.sims.reduced_fe.fe_gears import PAPER, SMALL, small_cyclic, small_reduced

SIZE = MeshSize(4, 1, 4, 2, 1, 2)


def test_a_ring_of_sound_sectors_is_the_cyclic_gear() -> None:
    mesh, reduced = small_cyclic().mesh, small_reduced()
    chain = _chain(sector_matrices(mesh)[0], mesh, SMALL.n_teeth - 1)
    found = tooth_compliance_with(mesh, chain, reduced.grid, "section")
    expected = reduced.compliance_m_per_n([0], "bore_clamped")
    np.testing.assert_allclose(found, expected, atol=1e-9 * expected.max())


def test_an_open_crack_keeps_the_body_and_doubles_nodes() -> None:
    sound, cracked = crack_meshes(SMALL, RootCrack(1.5, 60.0), SIZE)
    assert mesh_quality(cracked).volume_m3 == pytest.approx(mesh_quality(sound).volume_m3, rel=1e-12)
    assert cracked.n_nodes > sound.n_nodes
    fewer = crack_meshes(SMALL, RootCrack(1.5, 60.0, width_mm=6.0), SIZE)[1]
    assert sound.n_nodes < fewer.n_nodes < cracked.n_nodes


@pytest.mark.parametrize("angle", [45.0, 60.0, 90.0])
def test_a_deeper_crack_adds_more(angle: float) -> None:
    grid = flank_grid(SMALL.geometry, 3, 2)
    added = [crack_compliance_m_per_n(SMALL, RootCrack(d, angle), grid, size=SIZE) for d in (0.5, 1.2, 2.0)]
    for less, more in pairwise(added):
        assert np.linalg.eigvalsh(more - less)[0] > -1e-3 * more.max()
    assert np.all(added[0][6:] == 0.0)
    assert np.linalg.eigvalsh(added[0])[0] > -1e-9 * added[0].max()
    assert np.diag(added[2])[4] > np.diag(added[2])[2]  # a force further out bends the crack open more


def test_part_of_the_width_adds_less_and_most_at_its_end() -> None:
    grid = flank_grid(SMALL.geometry, 2, 4)
    through = crack_compliance_m_per_n(SMALL, RootCrack(1.5, 60.0), grid, size=SIZE)
    part = crack_compliance_m_per_n(SMALL, RootCrack(1.5, 60.0, width_mm=6.0), grid, size=SIZE)
    assert np.linalg.eigvalsh(through - part)[0] > -1e-9 * through.max()
    tip = np.diag(part)[4:8]
    assert np.all(np.diff(tip) < 0.0)


def test_a_force_near_the_tip_agrees_with_potential_energy() -> None:
    """What 2 and 4 mm at 45° add for a force near the tip of the paper gear's tooth, within 8 %."""
    g, grid = PAPER.geometry, flank_grid(PAPER.geometry, 2, 1)
    sound = tooth_compliance(g, PAPER.material, grid.roll_rad[1:]).total
    for depth in (2.0, 4.0):
        added = crack_compliance_m_per_n(PAPER, RootCrack(depth, 45.0), grid, size=replace(CRACK_SIZE, n_along=1))
        beam = tooth_compliance(g, PAPER.material, grid.roll_rad[1:], (depth, 45.0)).total - sound
        assert added[1, 1] == pytest.approx(float(beam[0]) / 0.02, rel=0.08)


def test_cracks_that_cannot_be_are_refused() -> None:
    grid = flank_grid(SMALL.geometry, 2, 1)
    with pytest.raises(InputError, match="goes past the tooth"):
        crack_compliance_m_per_n(SMALL, RootCrack(12.0, 60.0), grid, size=SIZE)
    with pytest.raises(InputError, match="the mesh cannot follow a crack of"):
        crack_compliance_m_per_n(SMALL, RootCrack(3.0, 15.0), grid, size=SIZE)
    with pytest.raises(InputError, match="parabolic"):
        crack_compliance_m_per_n(SMALL, RootCrack(1.0, 60.0, width_mm=5.0, front="parabolic"), grid, size=SIZE)
