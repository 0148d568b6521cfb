"""Publications beside the model: verdicts come from numbers, and the page holds them all."""

import json

import numpy as np
import pytest

from app.papers import Paper, PaperFigure, judged, paper, within_part, write_paper
from gearsig.errors import InputError
from gearsig.plot import curve_panel, panels_figure
from sims.fe_gear import (
    CyclicGear,
    GearBlank,
    MeshSize,
    cyclic_modes,
    load_tooth,
    modal_load,
    polar_stress_pa,
    sector_mesh,
    stress_pa,
    von_mises_pa,
)
from sims.mesh import GearGeometry, GearMesh, PairGeometry, friction_compliance, tooth_compliance

SMALL = GearBlank(GearGeometry(18, 3.0, face_width_mm=20.0, bore_radius_mm=6.0))
SIZE = MeshSize(n_across=2, n_gap=1, n_up=3, n_rim=1, n_body=1, n_along=1)


@pytest.mark.parametrize(("found", "verdict"), [(100.4, "agrees"), (102.0, "agrees in part"), (110.0, "does not")])
def test_a_number_is_judged_by_how_far_it_lies_from_the_published_one(found: float, verdict: str) -> None:
    claim = within_part("a hundred", 100.0, found, "Hz", part=0.01, because="it is another machine")
    assert claim.verdict == verdict
    assert ("because" in claim.judgement) == (verdict == "does not")


def test_the_page_and_the_table_hold_every_statement(tmp_path) -> None:
    panel = curve_panel(np.arange(5.0), {"one": np.arange(5.0), "two": np.arange(5.0) ** 2}, "x", "y", "title")
    figure = panels_figure([panel, panel], n_columns=2, title="two panels")
    claims = (
        judged("<b>it grows</b>", "by 2", agrees=True),
        judged("it falls", "no", agrees=False, because="it grows"),
    )
    made = Paper(
        "test", "A paper", "somebody", "a preset", (PaperFigure("one", "Figure 1", "growth", figure, claims),), {}
    )
    assert made.summary.startswith("1 of 2")
    names = {path.name for path in write_paper(made, tmp_path)}
    assert names == {"one.png", "one.svg", "claims.json", "index.html"}
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<b>it grows" not in page  # escaped
    assert "does not agree, because it grows" in page
    rows = json.loads((tmp_path / "claims.json").read_text(encoding="utf-8"))["claims"]
    assert [row["verdict"] for row in rows] == ["agrees", "does not"]


def test_curves_of_unlike_lengths_and_unknown_papers_are_refused() -> None:
    with pytest.raises(InputError, match="points"):
        panels_figure([curve_panel(np.arange(5.0), {"one": np.arange(4.0)})])
    with pytest.raises(InputError, match="forging"):
        paper("forgin")


def test_the_forging_drive_answers_its_publication() -> None:
    found = paper("forging")
    verdicts = {claim.statement: claim.verdict for figure in found.figures for claim in figure.claims}
    assert verdicts["its errors are smaller than those of Hunt–Crossley"] == "agrees"
    assert verdicts["the formula as printed, with m₀q̈ of the impacted body, fits"] == "does not"
    assert {figure.name for figure in found.figures} >= {"force_start_stop", "force_continuous", "start_stop"}


def test_stress_of_a_uniform_strain_is_hookes_law() -> None:
    mesh = sector_mesh(SMALL, SIZE)
    strain = np.array([[1e-4, 2e-5, 0.0], [2e-5, -3e-5, 0.0], [0.0, 0.0, 5e-5]])
    material = SMALL.material
    e, nu = material.youngs_modulus_pa, material.poisson_ratio
    mu, lam = e / (2.0 * (1.0 + nu)), e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
    expected = 2.0 * mu * strain + lam * np.trace(strain) * np.eye(3)
    field = mesh.points_m @ strain.T
    stress = stress_pa(mesh, field)
    assert stress == pytest.approx(np.broadcast_to(expected, stress.shape), rel=1e-6, abs=1.0)
    polar = polar_stress_pa(mesh, field)
    assert polar["radial"] + polar["tangential"] == pytest.approx(expected[0, 0] + expected[1, 1], rel=1e-6)
    deviator = expected - np.trace(expected) * np.eye(3) / 3.0
    assert von_mises_pa(mesh, field) == pytest.approx(np.sqrt(1.5 * np.sum(deviator**2)), rel=1e-6)


@pytest.mark.slow
def test_modes_alone_approach_the_static_answer_from_below() -> None:
    mesh = sector_mesh(SMALL, SIZE)
    gear = CyclicGear(mesh)
    load = load_tooth(mesh, 1000.0)
    work = []
    for n in (12, 60, 240):
        field = modal_load(gear, cyclic_modes(gear, n, "bore"), load)
        off = np.linalg.norm(field - load.displacement_m) / np.linalg.norm(load.displacement_m)
        work.append(float(off))
    assert work[0] > work[1] > work[2]
    assert work[2] < 0.3


def test_friction_towards_the_tip_softens_and_doubles_when_squared() -> None:
    """c_nt > 0, and (M_n + μ M_t)² − M_n² = 2 μ M_n M_t to first order."""
    gear = GearGeometry(55, 2.0, face_width_mm=20.0)
    mesh = GearMesh(PairGeometry(gear, GearGeometry(75, 2.0, face_width_mm=20.0)))
    roll = np.linspace(gear.form_roll_rad * 1.2, gear.tip_roll_rad, 5)
    coupling = friction_compliance(gear, mesh.material_1, roll)
    own = tooth_compliance(gear, mesh.material_1, roll).total
    assert np.all(coupling > 0.0)
    assert np.all(np.diff(coupling) > 0.0)
    assert np.all(coupling < own)
