"""Faults of teeth by the transmission error: how its profile is described, and how likely each makes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import RefusalError
from gearsig.recording import Recording
from gearsig.severity import (
    OTHER,
    TOOTH_FAULTS,
    CrackEstimate,
    KnownToothErrors,
    ToothErrorChange,
    ToothErrorEvidence,
    estimate_crack,
    tooth_error_descriptors,
    tooth_error_evidence,
)
from sims.cracked import CrackedPair
from sims.effects import EffectSetting
from sims.machine import Operation
from sims.simulator import SimulationSetup

STEPS, TEETH = 32, 20


def change(seed: int = 0) -> ToothErrorChange:
    """A tooth that gives way for 1.2 pitches, more towards the end."""
    rng = np.random.default_rng(seed)
    wave = 0.02 * rng.standard_normal(TEETH * STEPS)
    place = np.arange(38) / 38.0
    wave[200:238] += np.sin(np.pi * place) ** 2 * (1.0 + place)
    mesh = np.cos(2.0 * np.pi * (np.arange(STEPS) / STEPS - 0.3))
    return ToothErrorChange(0, wave.reshape(TEETH, STEPS), mesh, 1.0, 0.01)


@settings(deadline=None, max_examples=20)
@given(st.integers(0, TEETH - 1), st.floats(0.1, 50.0))
def test_descriptors_know_neither_the_tooth_nor_the_size(teeth: int, factor: float) -> None:
    made = change()
    other = replace(made, pattern_um=factor * np.roll(made.pattern_um, teeth, axis=0))
    np.testing.assert_allclose(tooth_error_descriptors(other), tooth_error_descriptors(made), atol=1e-6)


def test_the_driven_gear_is_read_backwards() -> None:
    """Its contact runs from tip to root."""
    made = change()
    backwards = replace(
        made, side=1, pattern_um=made.pattern_um.ravel()[::-1].reshape(TEETH, STEPS), mesh_um=made.mesh_um[::-1]
    )
    here, there = tooth_error_descriptors(made), tooth_error_descriptors(backwards)
    np.testing.assert_allclose(there, here, atol=1e-6)


def test_a_crack_leans_to_the_tip_and_a_tooth_out_of_its_place_does_not() -> None:
    """The last quarter over the first, from begin to end."""
    place = (np.arange(54) + 0.5) / 54.0
    quarters = []
    for shape in (np.minimum(1.0, 0.2 + 1.2 * place), np.ones(54)):
        wave = np.zeros(TEETH * STEPS)
        wave[200:254] = shape
        quarters.append(tooth_error_descriptors(replace(change(), pattern_um=wave.reshape(TEETH, STEPS)))[-5:-1])
    assert quarters[0][3] - quarters[0][0] > 0.2
    assert quarters[1][3] == pytest.approx(quarters[1][0], abs=0.05)


def test_relief_beyond_the_deflection_turns_the_mesh_round() -> None:
    """A pair that gives way for a third of a pitch, as where one carries; and the same the other way round."""
    short = np.where(np.abs(np.arange(STEPS) - 12) < 5, 1.0, 0.0)
    there, back = (tooth_error_descriptors(replace(change(), mesh_um=sign * short))[-1] for sign in (1.0, -1.0))
    assert there > 0.2
    assert back == pytest.approx(-there)


def known() -> tuple[KnownToothErrors, np.ndarray]:
    rng = np.random.default_rng(1)
    centres = 3.0 * rng.standard_normal((5, 17))
    rows = np.concatenate([centre + rng.standard_normal((60, 17)) for centre in centres])
    return KnownToothErrors(rows, np.repeat([*TOOTH_FAULTS, OTHER], 60), np.array([7.0, 0.9, -8.0, 0.3])), centres


def test_a_known_profile_is_identified_and_a_strange_one_is_not() -> None:
    errors, centres = known()
    for name, centre in zip((*TOOTH_FAULTS, OTHER), centres, strict=True):
        said = errors.log_likelihoods(centre)
        assert max(said, key=said.__getitem__) == name
    far = [*errors.log_likelihoods(centres.mean(axis=0) + 100.0).values()]
    assert np.ptp(far) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("other", "expected"), [(-9.0, 90.0), (-2.0, 1.0 / 12.2), (-4.5, 1.0)])
def test_the_odds_of_a_tooth_are_those_of_a_mean_fault(other: float, expected: float) -> None:
    said = ToothErrorEvidence(dict.fromkeys(TOOTH_FAULTS, -4.5) | {OTHER: other}, 2.0, "driver")
    assert said.odds_of_a_tooth == pytest.approx(expected, rel=0.01)
    assert said.is_unlike_any


def test_a_larger_change_is_a_deeper_crack() -> None:
    errors, _ = known()
    shallow, deep = (errors.log_percent(rms_um, 100.0, 40) for rms_um in (0.5, 1.0))
    assert deep[0] - shallow[0] == pytest.approx(0.9 * np.log(2.0))
    assert shallow[1] == deep[1] == 0.3


def recorded(*settings: EffectSetting) -> Recording:
    setup = SimulationSetup("published_55_75", {"encoder_counts": 200_000}, settings, Operation.steady(90.0, 110.0))
    return CrackedPair().simulate(setup, np.random.default_rng(1), sampling_rate_hz=20480.0, duration_s=5.0)


@pytest.mark.slow
def test_encoders_identify_a_crack_at_low_speed() -> None:
    healthy, cracked = recorded(), recorded(EffectSetting("root_crack", 3.0, {"gear": "driver", "tooth": 7.0}))
    said = tooth_error_evidence(cracked, healthy)
    assert said is not None
    assert said.gear == "driver"
    assert int(55 * said.place_rev) + 1 == 7
    assert next(iter(said.probabilities)) == "root_crack"
    assert said.probabilities["root_crack"] > 0.7
    assert said.odds_of_a_tooth > 20.0
    with pytest.raises(RefusalError, match="did not change"):
        tooth_error_evidence(healthy.between(0.0, 2.5), healthy.between(2.5, 5.0))
    estimate = estimate_crack(cracked, reference=healthy)
    assert isinstance(estimate, CrackEstimate)
    assert estimate.kind == "cracked"
    assert estimate.shaft == "input"
    assert estimate.interval_mm[0] < 3.0 < estimate.interval_mm[1]
    assert "encoders" in " ".join(estimate.reasons)
