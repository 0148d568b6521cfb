"""Impact of two free gears: energy, restitution, the moment of touching."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from gearsig.errors import InputError
from gearsig.rig import DAMPING_LAWS, ToothContact, damping_ratio_s_per_m
from tests.sims.forging.drives import drive, free_bodies, impact, largest

PUBLISHED = {
    "lankarani": {0.95: 0.954, 0.8: 0.847, 0.5: 0.725, 0.2: 0.672},
    "hunt-crossley": {0.95: 0.952, 0.8: 0.833, 0.5: 0.663, 0.2: 0.547},
    "flores": {0.95: 0.947, 0.8: 0.789, 0.5: 0.470, 0.2: 0.156},
}
"""Restitution that each law really gives, for the one it was made for."""


def closed_form(law: str, restitution: float) -> float:
    """βv − ln(1 + βv) = −βv' − ln(1 − βv'), from ∫ ġ dġ/(1 + β ġ) = −(k/m) ∫ g^λ dg over a whole contact."""
    bv = damping_ratio_s_per_m(law, restitution, 1.0)
    top = min(1.0, (1.0 - 1e-12) / bv)
    return brentq(lambda x: bv - np.log1p(bv) + bv * x + np.log1p(-bv * x), 1e-9, top)


@pytest.mark.parametrize("law", DAMPING_LAWS)
@pytest.mark.parametrize("restitution", [0.95, 0.8, 0.5, 0.2])
def test_restitution(law: str, restitution: float) -> None:
    made = free_bodies({"restitution": restitution, "damping_law": law, "impact_speed_floor_mps": 1e-3})
    run = impact(made, 0.2)
    before, after = run.contact("start_speed_mps")[0], run.contact("end_speed_mps")[0]
    assert before == pytest.approx(0.2, rel=1e-9)
    assert after / before == pytest.approx(closed_form(law, restitution), abs=2e-5)
    assert after / before == pytest.approx(PUBLISHED[law][restitution], abs=6e-4)
    if law == "flores" and restitution >= 0.5:
        assert after / before == pytest.approx(restitution, abs=0.01 if restitution == 0.95 else 0.03)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_restitution_depends_neither_on_exponent_nor_on_speed(exponent: float) -> None:
    made = free_bodies({"restitution": 0.5, "exponent": exponent, "impact_speed_floor_mps": 1e-3})
    ratios = [run.contact("end_speed_mps")[0] / run.contact("start_speed_mps")[0] for run in (
        impact(made, 0.05), impact(made, 0.5))]  # fmt: skip
    assert ratios == pytest.approx([closed_form("flores", 0.5)] * 2, abs=5e-5)


def test_below_the_floor_the_damping_is_that_of_the_floor() -> None:
    """A contact that closes at a tenth of the floor is damped by a tenth of what its own speed would ask for."""
    made = free_bodies({"restitution": 0.5, "impact_speed_floor_mps": 0.1, "half_backlash_um": 20.0})
    run = impact(made, 0.01)
    bv = damping_ratio_s_per_m("flores", 0.5, 0.1) * 0.01
    expected = brentq(lambda x: bv - np.log1p(bv) + bv * x + np.log1p(-bv * x), 1e-6, 1.0)
    assert run.contact("end_speed_mps")[0] / 0.01 == pytest.approx(expected, abs=1e-3)
    assert run.contact("is_latched_at_floor")[0] == 1.0


def test_energy_is_conserved_without_damping_and_friction() -> None:
    """Several impacts to and fro across the backlash: nothing lost, nothing gained."""
    made = free_bodies({"restitution": 1.0, "half_backlash_um": 50.0})
    run = impact(made, 0.3, tolerance=1e-10)
    assert len(run.contacts) >= 5
    assert {-1.0, 1.0} == set(run.contact("flank"))
    assert largest(run["energy"] / run["energy"][0] - 1.0) < 1e-7


def test_energy_is_conserved_while_pairs_come_and_go() -> None:
    """Turning loaded by their own spin: the changing number of pairs works on the rotation, not on the balance."""
    made = free_bodies({"restitution": 1.0, "half_backlash_um": 5.0})
    made = replace(made, contact=replace(made.contact, driven_inertia_kg_m2=0.5))
    from sims.forging import FirstState, respond
    from tests.sims.forging.drives import AT_REST

    start = FirstState(0.0, 20.0, 3e-5, 0.0)
    run = respond(made, AT_REST, duration_s=0.2, interval_s=1e-4, first=start, tolerance=1e-10)
    pairs = run["pairs in contact"]
    assert pairs.max() == pytest.approx(2.0)
    assert largest(run["energy"] / run["energy"][0] - 1.0) < 1e-7


def test_the_energy_error_falls_with_the_tolerance() -> None:
    made = free_bodies({"restitution": 1.0, "half_backlash_um": 50.0})
    drifts = [largest(np.diff(impact(made, 0.3, tolerance=t)["energy"])) for t in (1e-4, 1e-6, 1e-8)]
    assert drifts[0] > 5.0 * drifts[1] > 25.0 * drifts[2]


def test_the_moment_of_touching_is_exact() -> None:
    """Free flight at constant speed meets the flank at a/v; the force just begins, so that time is all there is."""
    made = free_bodies()
    run = impact(made, 0.2)
    assert run.contact("start_s")[0] == pytest.approx(150e-6 / 0.2, rel=1e-9)


def test_an_event_costs_less_than_a_hundredth_of_its_step() -> None:
    """Energy that the run loses against one of a thousandth of the tolerance, over the energy that a step moves."""
    made = free_bodies({"restitution": 0.8})
    ours, exact = impact(made, 0.2), impact(made, 0.2, tolerance=1e-9)
    lost = [run["energy"][0] - run["energy"][-1] for run in (ours, exact)]
    moved_in_a_step = np.max(np.abs(np.diff(exact["energy"])))  # in 10 µs, shorter than a step of the solver
    assert abs(lost[0] - lost[1]) < 0.01 * moved_in_a_step
    assert abs(ours.contact("end_s")[0] - exact.contact("end_s")[0]) < 1e-8


def test_inverse_formula_recovers_the_force_of_free_bodies() -> None:
    """m2 q̈ + γ f = −f with γ = m2/m1: what the source prints as a force model is the third law for two free bodies."""
    made = free_bodies({"restitution": 0.8})
    run = impact(made, 0.2)
    r1, r2 = made.path.base_radii_m
    m1 = made.pinion_side_inertia_kg_m2 / r1**2
    m2 = (made.contact.driven_inertia_kg_m2 or 0.0) / r2**2
    force = run["interaction force"]
    q_2dot = r1 * run["pinion acceleration"] - r2 * run["wheel acceleration"]
    assert force.max() > 1000.0
    assert largest(m2 * q_2dot + m2 / m1 * force + force) < 1e-6 * m2 / m1 * force.max()


@pytest.mark.parametrize(
    "changes",
    [
        {"restitution": 1.2},
        {"driver_inertia_kg_m2": -1.0},
        {"driven_inertia_kg_m2": -5.0},
        {"damping_law": "newton"},
        {"exponent": 3.0},
        {"half_backlash_um": -1.0},
    ],
)
def test_bad_contacts_are_named(changes: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(changes))):
        ToothContact(**({"stiffness_n_per_m_lambda": 1e10} | changes))  # type: ignore[arg-type]  # wrong on purpose


def test_a_drive_without_inertia_is_refused() -> None:
    with pytest.raises(InputError, match="wheel_inertia"):
        drive(wheel_inertia_kg_m2=-3.0)


def test_flores_is_the_damping_unless_another_is_chosen() -> None:
    assert ToothContact(1e10).damping_law == "flores"
    assert drive().contact.damping_law == "flores"
    assert drive(damping_law="lankarani").contact.damping_law == "lankarani"
