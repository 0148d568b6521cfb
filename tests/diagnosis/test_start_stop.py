"""`analyze` recognises machines that start, stop and reverse, and does not pretend that they run steadily."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import CannotTell, Kind, Outcome, analyze, changes
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.report import analysis_text, analysis_to_json
from gearsig.rig import EncoderChannel, GearPair, Rig, Shaft, SpeedChannel
from sims import simulate
from tests.motion.recordings import continuous, start_stop, without


def codes(recording: Recording) -> list[str]:
    return [finding.code for finding in analyze(recording).findings]


def test_a_start_stop_recording_is_examined_as_one() -> None:
    result = analyze(start_stop())
    found = {finding.code: finding for finding in result.findings}
    assert {"start-stop", "stationary-methods-left-out", "backlash", "flank-impacts"} <= set(found)
    assert isinstance(result.shaft_angle, CannotTell)
    assert result.channels == ()
    assert result.outcome is Outcome.CANNOT_TELL
    assert "2 starts and 2 stops" in found["start-stop"].title
    assert found["flank-impacts"].where.tooth is not None
    assert {i.name for i in result.indicators} >= {"backlash", "restitution", "standing part"}
    assert "need a steady speed" in " ".join(analysis_text(result).split())
    assert '"start-stop"' in analysis_to_json(result)


def test_worn_teeth_are_a_suspicion() -> None:
    result = analyze(start_stop(wear_um=120.0))
    worn = next(f for f in result.findings if f.code == "backlash-grown")
    assert worn.kind is Kind.SUSPICION
    assert worn.strength is not None
    assert worn.strength.value == pytest.approx(420.0, rel=0.02)
    assert result.outcome is Outcome.SUSPICION


def test_a_reference_of_the_same_cycle_is_what_backlash_is_compared_with() -> None:
    """340 µm against 300 µm is no suspicion by a drawing, but it is by the machine's own earlier recording."""
    worn = start_stop(wear_um=40.0)
    alone = {f.code: f for f in analyze(worn).findings}
    assert "backlash-grown" not in alone
    beside = analyze(worn, reference=start_stop())
    found = next(f for f in beside.findings if f.code == "backlash-grown")
    assert "where the reference has 299" in found.title
    assert found.strength is not None
    assert found.strength.value / found.strength.floor == pytest.approx(340.0 / 300.0, rel=0.01)
    assert "The reference does not show it." in found.evidence
    assert beside.reference is not None
    then = {c.reference_value for c in changes(beside) if c is not None}
    assert any(value == pytest.approx(300.0, rel=0.01) for value in then)
    same = analyze(start_stop(), reference=start_stop(angle_noise_urad=2.0))
    assert "backlash-grown" not in [f.code for f in same.findings]


def test_a_reference_that_runs_on_is_said_not_to_be_compared() -> None:
    result = analyze(start_stop(), reference=continuous())
    assert "reference-not-compared" in [f.code for f in result.findings]
    assert result.reference is None


def test_teeth_are_compared_and_said_to_be_alike_from_which_loss_on() -> None:
    """Without torque they cannot be, and cracks are among what is left out."""
    found = {f.code: f for f in analyze(start_stop()).findings}
    assert "none yields more than the others" in found["teeth-alike"].title
    assert found["stationary-methods-left-out"].title.startswith("Bearings")
    found = {f.code: f for f in analyze(without(start_stop(), "torque")).findings}
    assert "teeth-alike" not in found
    assert found["stationary-methods-left-out"].title.startswith("Cracks")


def test_vibration_blows_are_told_where_the_rate_allows() -> None:
    assert "vibration-impacts" in codes(start_stop(rate_hz=10_000.0))
    assert "vibration-impacts" not in codes(start_stop())


def test_continuous_rotation_is_analysed_as_before() -> None:
    result = analyze(continuous())
    assert not isinstance(result.shaft_angle, CannotTell)
    assert "start-stop" not in [f.code for f in result.findings]
    assert result.channels


def test_an_encoder_that_wraps_unsaid_is_no_reversing_machine() -> None:
    recording = start_stop()
    samples = np.array(recording.samples)
    samples[recording.index("pinion angle")] %= 2.0 * np.pi
    with pytest.raises(InputError, match=r"starts again after each revolution.*wraps = true"):
        analyze(replace(recording, samples=samples))


@pytest.mark.slow
def test_a_contact_in_the_rig_is_no_hindrance_to_the_other_examinations() -> None:
    """Long enough for averages; the mesh's order is reckoned without the pair, and so without its contact."""
    long = simulate("forging", parameters={"mode": "continuous"}, duration_s=20.0, sampling_rate_hz=1000.0)
    found = [f.code for f in analyze(long).findings]
    assert "channel-clipped" not in found
    assert "start-stop" not in found


def swinging(rig: Rig | None = None) -> Recording:
    """An arm that swings to and fro, with an accelerometer and an encoder that wraps."""
    t = np.arange(10_000) / 1000.0
    angle = 200.0 * np.sin(2.0 * np.pi * 0.2 * t)
    noise = np.random.default_rng(0).standard_normal(len(t))
    source = EncoderChannel("enc", 360.0, wraps=True, shaft="in" if rig else "")
    channels = (Channel("a", "acceleration", "m/s^2"), Channel("enc", "encoder", "deg"))
    return Recording(np.stack([noise, angle % 360.0]), 1000.0, channels, speed=source, rig=rig)


def test_a_reversing_machine_without_contact_data_is_recognised_too() -> None:
    pair = GearPair("p", "in", "out", 20, 40)
    for rig in (None, Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(pair,))):
        found = {f.code: f for f in analyze(swinging(rig)).findings}
        assert {"start-stop", "stationary-methods-left-out", "contact-not-described"} <= set(found)
        assert "changes of direction" in found["start-stop"].title
        assert "0 changes" not in found["start-stop"].title


def test_a_speed_channel_tells_as_well() -> None:
    speed = np.concatenate([np.full(2000, 600.0), np.zeros(2000), np.full(2000, 600.0)])
    noise = np.random.default_rng(0).standard_normal(len(speed))
    channels = (Channel("a", "acceleration", "m/s^2"), Channel("n", "rotational_speed", "rpm"))
    recording = Recording(np.stack([noise, speed]), 1000.0, channels, speed=SpeedChannel("n"))
    assert "start-stop" in codes(recording)
    steady = replace(recording, samples=np.stack([noise, np.full(len(speed), 600.0)]))
    assert "start-stop" not in codes(steady)


def test_teeth_that_cannot_be_examined_are_said_so() -> None:
    recording = start_stop()
    samples = np.array(recording.samples)
    samples[recording.index("wheel angle"), 700:] += 0.5
    found = {f.code: f for f in analyze(replace(recording, samples=samples)).findings}
    assert "jumps" in found["teeth-not-examined"].evidence[0]
