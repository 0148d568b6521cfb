"""Faults of teeth by the transmission error: what its course is described by, and how likely each makes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import RefusalError
from gearsig.gap import TOOTH_FAULTS, KnownToothErrors, ToothErrorChange, tooth_error_descriptors, tooth_error_evidence
from gearsig.recording import Recording
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


def test_a_known_course_is_told_and_a_strange_one_is_not() -> None:
    rng = np.random.default_rng(1)
    centres = 3.0 * rng.standard_normal((4, 17))
    rows = np.concatenate([centre + rng.standard_normal((60, 17)) for centre in centres])
    known = KnownToothErrors(rows, np.repeat(TOOTH_FAULTS, 60))
    for name, centre in zip(TOOTH_FAULTS, centres, strict=True):
        said = known.log_likelihoods(centre)
        assert max(said, key=said.__getitem__) == name
    far = [*known.log_likelihoods(centres.mean(axis=0) + 100.0).values()]
    assert np.ptp(far) == pytest.approx(0.0, abs=1e-9)


def recorded(*settings: EffectSetting) -> Recording:
    setup = SimulationSetup("published_55_75", {"encoder_counts": 200_000}, settings, Operation.steady(90.0, 110.0))
    return CrackedPair().simulate(setup, np.random.default_rng(1), sampling_rate_hz=20480.0, duration_s=5.0)


@pytest.mark.slow
def test_encoders_name_a_crack_at_low_speed() -> None:
    healthy = recorded()
    said = tooth_error_evidence(recorded(EffectSetting("root_crack", 3.0, {"gear": "driver", "tooth": 7.0})), healthy)
    assert said is not None
    assert said.gear == "driver"
    assert max(said.probabilities, key=said.probabilities.__getitem__) == "root_crack"
    assert said.probabilities["root_crack"] > 0.7
    with pytest.raises(RefusalError, match="did not change"):
        tooth_error_evidence(healthy.between(0.0, 2.5), healthy.between(2.5, 5.0))
