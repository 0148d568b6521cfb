"""The dashboard's page of finite-element gears, run without a browser."""

import numpy as np
import pytest

from app.gear_body import in_the_whole_gear
from sims.fe_gear import (
    GearBlank,
    MeshSize,
    mesh_quality,
    outer_faces,
    sector_mesh,
)
from sims.mesh import GearGeometry
from tests.app.pages import labelled, on


@pytest.mark.parametrize("web_mm", [None, 6.0])
@pytest.mark.parametrize("order", [1, 2])
def test_the_surface_that_is_turned_encloses_the_gear(web_mm: float | None, order: int) -> None:
    """∮ r·n dA = 3 V: closed, and every face looks outwards."""
    size = MeshSize(n_across=4, n_gap=2, n_up=6, n_rim=2, n_body=2, n_along=3, order=order)
    mesh = sector_mesh(GearBlank(GearGeometry(24, 3.0, face_width_mm=18.0), web_mm), size)
    faces = outer_faces(mesh)
    points = np.broadcast_to(mesh.points_m, (24, *mesh.points_m.shape))
    corners = in_the_whole_gear(mesh, points).reshape(24, -1, 3)[:, faces].reshape(-1, 4, 3)
    area = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2.0
    volume = np.einsum("ni,ni->n", corners.mean(axis=1), area).sum() / 3.0
    assert np.abs(area.sum(axis=0)).max() < 1e-12
    assert volume == pytest.approx(mesh_quality(mesh).volume_m3, rel=0.02)


def test_publications_are_said_in_the_pages_own_words() -> None:
    page = on("flexible", {"view": "Publications"})
    assert page.caption[-1].value == "Takes one to two minutes, once."
    assert not any("gearsig" in caption.value for caption in page.caption)


@pytest.mark.slow
def test_a_gear_is_shown_with_its_modes_and_stress() -> None:
    page = on("flexible")
    assert not page.exception
    assert "is given under Numbers" in page.caption[-1].value
    assert not any("gearsig" in caption.value for caption in page.caption)
    shown = labelled(page, "selectbox", "Show")
    assert len(shown.options) == 7
    assert "2 nodal diameters" in shown.options[0]
    shown.select_index(6).run()
    assert not page.exception
    page.number_input(key="teeth of flexible").set_value(13).run()
    assert page.query_params["teeth"] == "13"
    assert page.error  # undercut without profile shift
