"""What can be noticed of recordings that are not of the machine that they are said to be of."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gearsig.angle import find_shaft_angle
from gearsig.errors import RefusalError
from gearsig.gap import (
    DRIVER,
    AddedEffect,
    OperatingCondition,
    ReducedRecording,
    Twin,
    conditions_of,
    pattern_mismatch_text,
    reduce_recording,
    swapped_recordings_text,
    teeth_mismatch_text,
    tooth_count_mismatch_text,
    unexpected_findings,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording
from gearsig.rig import Rig
from sims import simulate
from sims.registry import gap_simulator

POINT = OperatingCondition(1500.0, 60.0)
CHIPPED = AddedEffect("chipped_tooth", 2.5, {"gear": "driver", "tooth": 3.0, "width_percent": 85.0})


@cache
def rig() -> Rig:
    found = simulate("cracked", preset="workshop_29_47", duration_s=0.2).rig
    assert found is not None
    return found


@cache
def twin() -> Twin:
    return gap_simulator("cracked").twin_of(rig())


@cache
def recording(seed: int, noise: int, *, chipped: bool = False, duration_s: float = 3.0) -> Recording:
    added = [CHIPPED] if chipped else []
    return twin().run(POINT, added, seed=seed, duration_s=duration_s, sampling_rate_hz=20480.0, noise=noise)


def prepared(*recordings: Recording) -> tuple[PreparedRecording, ...]:
    return tuple(PreparedRecording(recording) for recording in recordings)


@cache
def gathered(seed: int, noise: int, *, chipped: bool = False) -> ReducedRecording:
    return reduce_recording(recording(seed, noise, chipped=chipped), rig())


@cache
def with_wrong_teeth() -> ReducedRecording:
    """Reduce a healthy recording by a rig that has 37 and 53 teeth for 29 and 47."""
    pair = replace(rig().pairs[0], driver_teeth=37, driven_teeth=53)
    return reduce_recording(recording(0, 1), replace(rig(), pairs=(pair,)))


@pytest.mark.slow
def test_another_specimen_is_noticed_and_a_damaged_gear_is_not_another_machine() -> None:
    healthy = gathered(0, 0)
    assert pattern_mismatch_text(gathered(0, 1), healthy, "now") == []
    assert pattern_mismatch_text(gathered(0, 1, chipped=True), healthy, "now") == []
    (remark,) = pattern_mismatch_text(gathered(3, 1), healthy, "now")
    assert "another machine" in remark


@pytest.mark.slow
def test_gears_without_a_pattern_are_not_another_machine() -> None:
    assert (
        pattern_mismatch_text(reduce_recording(_flawless(1), rig()), reduce_recording(_flawless(2), rig()), "now") == []
    )


def _flawless(seed: int) -> Recording:
    """A mesh and noise, no tooth unlike the others."""
    bare = recording(0, 1)
    time_s = np.arange(bare.samples.shape[1]) / bare.sampling_rate_hz
    turns = find_shaft_angle(bare, rig()).revolutions_at(time_s)
    rng, samples = np.random.default_rng(seed), bare.samples.copy()
    for i, channel in enumerate(bare.channels):
        if channel.is_vibration:
            samples[i] = np.cos(2 * np.pi * 29 * turns) + 0.05 * rng.standard_normal(len(turns))
    return replace(bare, samples=samples)


@pytest.mark.slow
def test_the_teeth_of_another_rig_are_noticed_and_the_right_number_is_told() -> None:
    for right in (gathered(0, 1), gathered(0, 1, chipped=True)):
        assert teeth_mismatch_text(right, "now") == []
        assert tooth_count_mismatch_text(right, "now") == []
    (doubt,) = tooth_count_mismatch_text(with_wrong_teeth(), "now")
    assert "29 times per revolution" in doubt
    assert "37 teeth" in doubt


@pytest.mark.slow
def test_a_healthy_reference_that_fits_the_teeth_lifts_the_doubt_of_them() -> None:
    unlike = with_wrong_teeth()
    assert len(tooth_count_mismatch_text(unlike, "now", unlike)) == 1
    assert teeth_mismatch_text(unlike, "now") == []  # it is said once
    assert tooth_count_mismatch_text(unlike, "now", gathered(0, 1)) == []


@pytest.mark.slow
def test_without_a_mark_on_the_shaft_its_teeth_are_not_counted() -> None:
    """The average over a shaft whose angle was found by the teeth holds for those teeth only."""
    assert tooth_count_mismatch_text(replace(with_wrong_teeth(), marks=(False, False)), "now") == []


def test_teeth_that_explain_little_are_a_remark_where_no_other_number_explains_more() -> None:
    strange = replace(with_wrong_teeth(), marks=(False, False))
    (remark,) = teeth_mismatch_text(strange, "now")
    assert "37/53" in remark


@pytest.mark.slow
def test_recording_and_reference_exchanged_are_noticed_by_the_sign_of_the_change() -> None:
    healthy, chipped = gathered(0, 1), gathered(0, 2, chipped=True)
    (doubt,) = swapped_recordings_text(healthy, chipped, "now")
    assert "may have been exchanged" in doubt
    assert swapped_recordings_text(chipped, healthy, "now") == []
    assert swapped_recordings_text(healthy, gathered(0, 3), "now") == []
    assert swapped_recordings_text(gathered(3, 1), healthy, "now") == []  # another specimen is no exchange


@pytest.mark.slow
def test_a_reference_with_a_fault_is_told() -> None:
    damaged = recording(0, 1, chipped=True)
    _, _, warnings = unexpected_findings(*prepared(recording(0, 2)), prepared(recording(0, 3), damaged))
    assert not warnings  # at the same speed, the first is taken
    (doubt,) = unexpected_findings(*prepared(recording(0, 2).with_name("now")), prepared(damaged))[2]
    assert doubt.startswith("The reference of now does not look healthy")
    assert "they may have been exchanged" in doubt
    (doubt,) = unexpected_findings(*prepared(recording(0, 2, chipped=True)), prepared(damaged))[2]
    assert "exchanged" not in doubt


def test_a_refusal_names_the_recording_that_is_too_short() -> None:
    short = recording(0, 1, duration_s=0.1)
    with pytest.raises(RefusalError, match=r"^the old one: shaft .* turns"):
        conditions_of(prepared(short), prepared(short.with_name("the old one")), twin())
    with pytest.raises(RefusalError, match=r"^today: "):
        conditions_of(prepared(short.with_name("today")), (), twin())


@pytest.mark.slow
def test_one_of_several_references_that_cannot_be_read_is_left_out() -> None:
    whole = recording(0, 1)
    short = replace(whole, samples=whole.samples[:, :4000]).with_name("the short one")
    (condition,), notes = conditions_of(
        prepared(whole),
        prepared(short, whole),
        twin(),
    )
    assert condition.reference is not None
    assert any(n.startswith("the short one") and n.endswith("this reference is left out.") for n in notes)


@pytest.mark.slow
def test_one_of_several_recordings_that_is_too_short_is_left_out_and_told() -> None:
    whole = recording(0, 1).with_name("now")
    short = replace(whole, samples=whole.samples[:, :2000]).with_name("the short one")
    for given in ((short, whole), (whole, short)):
        (condition,), notes = conditions_of(prepared(*given), (), twin())
        assert condition.facts.name == "now"
        assert any(n.startswith("the short one: ") and n.endswith("this recording is left out.") for n in notes)


@pytest.mark.slow
def test_a_dead_channel_is_left_out_and_nothing_but_dead_ones_is_refused() -> None:
    whole = recording(0, 1).with_name("now")
    first, *_ = whole.vibration_names()
    samples = whole.samples.copy()
    samples[whole.channel_names.index(first)] = 0.0
    (condition,), notes = conditions_of(prepared(replace(whole, samples=samples)), (), twin())
    assert first not in condition.now.channels
    assert any(f"channel {first} is dead" in notice for notice in notes)
    samples[: len(whole.vibration_names())] = 0.0
    with pytest.raises(RefusalError, match="now: no vibration channel is live"):
        conditions_of(prepared(replace(whole, samples=samples)), (), twin())


@pytest.mark.slow
def test_a_channel_that_reads_the_other_way_round_or_steps_is_told() -> None:
    before, whole = recording(0, 2).with_name("before"), recording(0, 1).with_name("now")
    vibrations = [whole.channel_names.index(name) for name in whole.vibration_names()]
    samples = whole.samples.copy()
    samples[vibrations[0]] *= -1.0
    samples[vibrations[1], samples.shape[1] // 2 :] *= 2.0
    (as_it_was,), usual = conditions_of(prepared(whole), prepared(before), twin())
    (condition,), notes = conditions_of(prepared(replace(whole, samples=samples)), prepared(before), twin())
    first, second, *_ = whole.vibration_names()
    assert not any("other way round" in text or "steps" in text for text in usual)
    assert any(text.startswith(f"now: {first} reads the other way round") for text in notes)
    assert any(text.startswith(f"now: The level of channel {second} steps") for text in notes)
    (now, then), (usual_now, usual_then) = (
        (c.now.average(first, DRIVER).lines, c.reference.average(first, DRIVER).lines)  # type: ignore[union-attr]
        for c in (condition, as_it_was)
    )
    assert np.allclose(now - then, usual_then - usual_now)


@pytest.mark.slow
def test_what_was_not_given_of_the_operating_point_is_told() -> None:
    whole = recording(0, 1).with_name("now")
    _, notes = conditions_of(prepared(whole), (), twin())
    assert not any("not given" in notice or "tachometer" in notice for notice in notes)
    point = replace(rig().operating_point, torque_nm=None)
    _, notes = conditions_of(prepared(whole.with_rig(replace(rig(), operating_point=point))), (), twin())
    assert any(notice.startswith("now: the torque is not given; ") for notice in notes)
    idle = replace(rig(), operating_point=replace(rig().operating_point, torque_nm=0.0))
    with pytest.raises(RefusalError, match="now: the rig file states a torque of 0"):
        conditions_of(prepared(whole.with_rig(idle)), (), twin())
