"""Neighbouring teeth through the gear body, against closed forms, the published polynomial and finite elements."""

import numpy as np
import pytest

from sims import simulate
from sims.fe_gear import compare_crack_laws, ready_gear
from sims.mesh import (
    GearMesh,
    PairGeometry,
    arc_compliance,
    body_compliance,
    foundation_compliance,
    mesh_stiffness,
    share_torque,
)
from sims.reduced_fe import mesh_maps

NAMES = ("z50_m3", "z55_m2", "z75_m2")


@pytest.mark.parametrize("radius_ratio", [1.5, 3.0, 6.0])
def test_a_rim_loaded_all_round_is_a_thick_ring(radius_ratio: float) -> None:
    """Evenly, an annulus held at its bore: Lamé's solution for the pressure, and torsion of a thick disc."""
    nu, b = 0.3, 1.0 / radius_ratio
    c = arc_compliance(radius_ratio, np.pi, 0.0, nu)
    stress = 1.0 / (2.0 * np.pi)
    lame = stress * (1.0 - nu**2) * (1.0 - b**2) / (1.0 + nu + (1.0 - nu) * b**2)
    assert c[0, 0] == pytest.approx(lame, rel=1e-9)
    assert c[1, 1] == pytest.approx(stress * (1.0 + nu) * (1.0 / b**2 - 1.0), rel=1e-9)


def test_what_a_tooth_does_to_another_it_does_to_it() -> None:
    one, other = (arc_compliance(3.0, 0.055, side * 2.0 * np.pi / 55, 0.3) for side in (1.0, -1.0))
    assert one == pytest.approx(other.T, rel=1e-9, abs=1e-12)
    assert np.all(np.linalg.eigvalsh(arc_compliance(3.0, 0.055, 0.0, 0.3)) > 0.0)


@pytest.mark.parametrize("name", NAMES)
def test_own_tooth_as_published_and_neighbours_as_finite_elements(name: str) -> None:
    gear = ready_gear(name)
    g, material = gear.blank.geometry, gear.blank.material
    angle = gear.grid.roll_rad - g.base_half_angle_rad
    own = body_compliance(g, material, angle, angle, 0)
    assert own == pytest.approx(foundation_compliance(g, material, angle), rel=0.11)
    _, n_heights, n_slices = gear.grid.shape
    shape = (-1, 2, n_heights, n_slices, 2, n_heights, n_slices)
    # An even force over the face at one height, the mean motion at another one.
    fe = gear.clamped_compliance_m_per_n.reshape(shape)[:, 0, :, :, 0].mean(axis=(2, 4)) * g.face_width_mm * 1e-3
    # Teeth that carry together never both carry at their tips.
    i, j = (k.ravel() for k in np.indices((n_heights - 1, n_heights - 1)))
    ahead, behind = (body_compliance(g, material, angle[i], angle[j], side) for side in (1, -1))
    assert ahead == pytest.approx(fe[-1][i, j], rel=0.16)
    assert behind == pytest.approx(fe[1][i, j], rel=0.16)
    both = (fe[1] + fe[-1])[i, j]
    assert np.mean(np.abs((ahead + behind) / both - 1.0)) < 0.06
    assert ahead + behind == pytest.approx(both, rel=0.14)


@pytest.mark.parametrize(("names", "torque_nm"), [(("z50_m3", "z50_m3"), 170.0), (("z55_m2", "z75_m2"), 110.0)])
def test_a_coupled_mesh_is_as_stiff_as_finite_elements(names: tuple[str, str], torque_nm: float) -> None:
    driver, driven = (ready_gear(n) for n in names)
    pair = PairGeometry(driver.blank.geometry, driven.blank.geometry)
    cycles = np.arange(40) / 40.0
    law = {"contact_law": "load-dependent"}
    fe = mesh_maps((driver, driven), GearMesh(pair, **law), np.array([torque_nm]), cycles, support="bore_clamped")
    error = fe.transmission_error_m[:, 0]
    found = {
        body: share_torque(GearMesh(pair, body=body, **law), torque_nm, cycles).transmission_error_m
        for body in ("separate", "coupled")
    }
    # The least transmission error is that of double contact; at its ends corners take part, which only elements know.
    assert np.min(found["coupled"]) == pytest.approx(np.min(error), rel=0.02)
    assert np.mean(found["coupled"]) == pytest.approx(np.mean(error), rel=0.07)
    assert np.min(error) / np.min(found["separate"]) > 1.3
    assert np.max(found["coupled"]) == pytest.approx(np.max(found["separate"]), rel=1e-3)  # one pair has no neighbour


def test_the_cracked_pair_runs_on_a_coupled_body() -> None:
    def mesh_frequency_level(body: str) -> float:
        recording = simulate("cracked", parameters={"gear_body": body}, duration_s=0.3, seed=1)
        return float(np.std(recording.values("a1")))

    levels = [mesh_frequency_level(body) for body in ("separate", "coupled")]
    assert 0.2 < levels[1] / levels[0] < 0.9  # the step between one and two pairs is smaller


def test_body_leaves_single_contact_and_softens_double_contact() -> None:
    gear = ready_gear("z50_m3").blank.geometry
    stiff, soft = (mesh_stiffness(GearMesh(PairGeometry(gear, gear), body=b)) for b in ("separate", "coupled"))
    assert np.min(soft.total_n_per_m) == pytest.approx(np.min(stiff.total_n_per_m), rel=1e-3)
    assert soft.mean_n_per_m / stiff.mean_n_per_m == pytest.approx(0.79, abs=0.03)


def test_lines_behind_a_crack_add_half_of_what_finite_elements_do_halfway_up_the_flank() -> None:
    """Cells taken out of a plane grid of 0.06 mm add 2.75, 6.91, 11.1 and 14.9e-10 m/N; a slot is longer and wider."""
    laws = compare_crack_laws(ready_gear("z55_m2"), np.array([1.0, 2.0, 3.0, 4.0]))
    middle = len(laws.roll_rad) // 2
    fe, grid = laws.added_m_per_n["finite elements"][:, middle], np.array([2.75, 6.91, 11.1, 14.9]) * 1e-10
    assert np.all((fe > 0.7 * grid) & (fe < grid))
    for law in ("two lines", "limiting line"):
        share = laws.added_m_per_n[law][:, middle] / fe
        assert np.all((share > 0.4) & (share < 0.62))
    assert np.all(np.diff(laws.added_m_per_n["parallel line"][:, middle]) > 0.0)
