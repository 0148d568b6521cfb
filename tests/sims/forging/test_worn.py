"""Flanks that sliding has worn: where they touch, what they store, that no energy appears."""

from dataclasses import replace

import numpy as np
import pytest

from sims.forging import Cycle, FirstState, ForgingDrive, drive_numbers, reach, respond, schedule
from sims.machine import Profile
from tests.sims.forging.drives import AT_REST, drive, free_bodies, largest

DEPTH_UM = 80.0


def worn(**values: float) -> ForgingDrive:
    return drive(sliding_wear_driver_um=DEPTH_UM, **values)


def test_most_is_gone_at_the_ends_and_nothing_at_the_pitch_point() -> None:
    depths, path = np.array(worn().wear_um), worn().path
    positions = np.linspace(0.0, path.contact_ratio, len(depths))
    assert depths[0] == pytest.approx(DEPTH_UM)
    assert depths[-1] > 0.1 * DEPTH_UM
    assert positions[np.argmin(depths)] == pytest.approx(path.pitch_point, abs=0.03)
    assert depths.min() < 0.03 * DEPTH_UM
    assert np.all(np.diff(depths[positions < path.pitch_point]) < 0.0)
    both = np.array(drive(sliding_wear_driver_um=30.0, sliding_wear_driven_um=20.0).wear_um)
    other = np.array(drive(sliding_wear_driven_um=20.0).wear_um)
    assert both == pytest.approx(30.0 / DEPTH_UM * depths + other)


@pytest.mark.parametrize("cycles", [0.1, 0.35, 0.6, 0.8, 0.95])
def test_the_least_worn_pair_touches_first(cycles: float) -> None:
    """The gears meet at a place of the mesh cycle: at a + min h(p_i) of the pairs there."""
    made = free_bodies(sliding_wear_driver_um=DEPTH_UM)
    made = replace(made, path=replace(made.path, phase=0.0))
    angle = 2.0 * np.pi * (3.0 + cycles) / made.path.teeth[0]
    first = FirstState(angle, 0.0, 0.0, 0.05)
    found = respond(made, AT_REST, duration_s=6e-3, interval_s=1e-6, first=first)
    touched = found.contact("start_s")[0]
    touching = np.array([cycles + i for i in range(2) if cycles + i < made.path.contact_ratio])
    grid = np.linspace(0.0, made.path.contact_ratio, len(made.wear_um))
    expected = made.contact.half_backlash_um + np.interp(touching, grid, made.wear_um).min()
    assert 1e6 * np.interp(touched, found.time_s, found["compression"]) == pytest.approx(expected, abs=0.05)
    before = found.time_s < touched
    assert largest(found["interaction force"][before]) == 0.0
    assert found["interaction force"][~before][1:30].min() > 0.0


def test_back_flanks_are_as_they_were() -> None:
    k = drive_numbers(worn())
    assert [reach(k, angle, -1.0)[0] for angle in (0.1, 0.7, 2.0)] == [k.half_backlash] * 3


def test_energy_is_conserved_over_worn_flanks_without_losses() -> None:
    """Gears that turn and rattle, pairs coming and going; nothing is damped and nothing rubs."""
    made = free_bodies({"restitution": 1.0}, sliding_wear_driver_um=DEPTH_UM, sliding_wear_driven_um=30.0)
    first = FirstState(0.0, 5.0, 0.0, 0.02)
    found = respond(made, AT_REST, duration_s=0.4, interval_s=1e-4, first=first, tolerance=1e-9)
    assert len(found.contacts) > 2
    assert largest(found["energy"] - found["energy"][0]) < 1e-7 * found["energy"][0]


def test_energy_stays_balanced_at_work() -> None:
    made = worn()
    profiles = schedule(Cycle(brake_nm=60.0, press_nm=1500.0), Profile.constant(95.0), 3.0)
    found = respond(made, profiles, duration_s=3.0)
    balance = found["energy"] - found["work put in"] + found["lost in contact"] + found["lost in friction"]
    assert largest(balance) < 2e-4
    assert np.all(np.diff(found["lost in contact"]) >= -1e-9)
