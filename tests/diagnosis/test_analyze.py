"""The main job on machines whose condition is known, and on recordings that allow no answer."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import Analysis, CannotTell, Kind, Outcome, analyze
from gearsig.errors import InputError
from gearsig.prepared import refined_angle
from gearsig.recording import Channel, Recording
from gearsig.report import analysis_text
from gearsig.rig import ConstantSpeed, GearPair, OperatingPoint, Shaft, TachometerChannel
from sims.measure import Tachometer
from tests.diagnosis.machines import GOOD, RIG, SAMPLING_RATE_HZ, codes, finding, good_analysis, record
from tests.kinematic.model import BearingFault, MeshModulation, ToothDamage
from tests.kinematic.speed import ConstantProfile, LinearRamp


@pytest.fixture(scope="module")
def knocking() -> Analysis:
    """Of a machine with a damaged tooth."""
    return analyze(record(replace(GOOD, tooth_damages=(ToothDamage("stage", "in", 0.4, impulse_mps2=10.0),))))


def test_a_good_machine_is_not_accused() -> None:
    analysis = good_analysis()
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)
    assert analysis.verdict.startswith("No fault shows.")
    assert analysis.outcome is Outcome.NO_FAULT
    assert "earlier recording" in analysis.verdict  # what one recording cannot show is said


def test_a_damaged_tooth_is_found_at_its_place() -> None:
    damage = ToothDamage("stage", "in", 0.4, impulse_mps2=10.0, resonance_hz=3000.0, mesh_dip_fraction=0.2)
    analysis = analyze(record(replace(GOOD, tooth_damages=(damage,))))
    found = analysis.findings[0]
    assert (found.code, found.kind) == ("tooth-local-damage", Kind.FAULT)
    assert found.where.shaft == "in"
    assert found.where.angle_deg == pytest.approx(144.0, abs=10.0)
    assert found.where.tooth in (11, 12)  # 0.4 of 27 teeth: the eleventh; an impact rings on into the next
    assert found.strength is not None
    assert found.strength.ratio_db is not None
    assert found.strength.ratio_db > 10
    assert 0.8 < found.confidence <= 0.95
    assert analysis.verdict.startswith("Fault: Local tooth damage")


@pytest.mark.parametrize(("race", "order"), [("outer", "BPFO"), ("inner", "BPFI")])
def test_a_damaged_race_is_named(race: str, order: str) -> None:
    fault = BearingFault("front", race, 6.0, resonance_hz=3200.0)
    analysis = analyze(record(replace(GOOD, bearing_faults=(fault,))))
    found = analysis.findings[0]
    assert (found.code, found.kind) == (f"bearing-{race}-race", Kind.FAULT)
    assert found.where.order == pytest.approx(RIG.bearings[0].orders()[order], rel=0.01)
    assert "tooth-local-damage" not in codes(analysis)


def test_a_bearing_that_is_not_described_is_not_named() -> None:
    model = replace(GOOD, bearing_faults=(BearingFault("front", "outer", 8.0, resonance_hz=3200.0),))
    recording = record(model)
    analysis = analyze(replace(recording, rig=replace(RIG, bearings=())))
    found = finding(analysis, "non-synchronous-impacts")
    assert found.where.order == pytest.approx(RIG.bearings[0].orders()["BPFO"], rel=0.01)
    assert not codes(analysis, Kind.FAULT)
    assert "rig file" in found.surer


def test_a_wheel_whose_teeth_are_not_given_shows_by_its_sidebands() -> None:
    model = replace(GOOD, modulations=(MeshModulation("stage", "out", 0.2),), tooth_variations=())
    unknown = replace(RIG, pairs=(GearPair("stage", "in", "out", 27),), bearings=())
    analysis = analyze(replace(record(model, seconds=8.0), rig=unknown))
    found = finding(analysis, "sidebands-of-unknown-shaft")
    assert found.where.order == pytest.approx(27 / 43, abs=0.002)
    assert any("43 teeth" in text for text in found.evidence)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("pinion", "wheel", "said"), [(26, 43, "27 teeth on shaft in"), (27, 45, "43 teeth on shaft out")]
)
def test_miscounted_teeth_of_a_speed_that_is_found_by_them_are_noticed(pinion: int, wheel: int, said: str) -> None:
    """The mesh is where speed and teeth put it, as the speed is wrong as well; the sidebands are not."""
    steady = record(replace(GOOD, speed=ConstantProfile(1320.0)), seconds=6.0).select(["a1"])
    miscounted = (GearPair("stage", "in", "out", pinion, wheel),)
    rig = replace(RIG, pairs=miscounted, operating_point=OperatingPoint("in", 1320.0))
    analysis = analyze(replace(steady, speed=None, rig=rig))
    assert said in finding(analysis, "teeth-disagree").title
    assert analysis.outcome is Outcome.CANNOT_TELL
    if pinion != 27:  # a stated speed goes before the one that these teeth ask for
        stated = analyze(replace(steady, speed=ConstantSpeed(1320.0, "in"), rig=rig))
        assert finding(stated, "teeth-disagree").where.order == pytest.approx(27.0, abs=0.02)


def test_strong_modulation_by_a_shaft_is_a_suspicion_where_the_reference_lacks_it() -> None:
    """How much is usual differs by machine: healthy two-stage gears are strongly modulated."""
    modulated = record(replace(GOOD, modulations=(MeshModulation("stage", "out", 0.6, 0.2),)))
    alone = analyze(modulated)
    assert finding(alone, "mesh-modulated").kind is Kind.NOTICE
    assert finding(alone, "mesh-modulated").where.shaft == "out"
    beside = analyze(modulated, reference=record(seed=1))
    assert codes(beside, Kind.SUSPICION)[0] == "changed-since-reference"
    assert finding(beside, "sidebands-risen").where.gear == "stage/out"


def test_a_run_up_is_analysed_over_angle() -> None:
    analysis = analyze(record(replace(GOOD, speed=LinearRamp(600.0, 2400.0, 8.0)), seconds=8.0))
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)
    assert finding(analysis, "mesh-found").where.order == pytest.approx(27, abs=0.02)
    assert analysis.channels[0].order_map is not None


def test_assumed_teeth_leave_the_teeth_undecided() -> None:
    analysis = analyze(replace(record(), rig=replace(RIG, bearings=(), assumed=("teeth",))))
    assert "tooth-damage-undecided" in codes(analysis, Kind.CANNOT_TELL)
    assert analysis.verdict.startswith("Cannot tell")


def test_assumed_teeth_allow_no_certain_fault() -> None:
    damage = ToothDamage("stage", "in", 0.4, impulse_mps2=12.0)
    recording = record(replace(GOOD, tooth_damages=(damage,)))
    analysis = analyze(replace(recording, rig=replace(RIG, assumed=("teeth",))))
    assert not codes(analysis, Kind.FAULT)
    assert finding(analysis, "tooth-local-damage").confidence <= 0.5


def test_too_few_revolutions() -> None:
    analysis = analyze(record(seconds=0.5))
    found = finding(analysis, "tooth-not-examined")
    assert "16 are needed" in found.title
    assert analysis.verdict.startswith("Cannot tell")


def test_a_missing_tooth_count_is_what_is_asked_for() -> None:
    pair = replace(RIG.pairs[0], driven_teeth=None)
    found = finding(analyze(record().with_rig(replace(RIG, pairs=(pair,)))), "tooth-not-examined")
    assert found.surer == "What the rig file lacks: driven_teeth of stage."


def test_a_rig_that_disagrees_with_the_sampling_rate() -> None:
    recording = record(replace(GOOD, speed=ConstantProfile(1320.0)))
    wrong = replace(
        recording,
        samples=recording.samples[:1],
        channels=recording.channels[:1],
        speed=ConstantSpeed(1320.0 * 0.6, "in"),
    )
    analysis = analyze(wrong)
    assert "mesh-elsewhere" in codes(analysis, Kind.DATA_PROBLEM)
    assert any("1.66" in text for text in finding(analysis, "mesh-elsewhere").evidence)
    assert "at 1.66" in analysis.verdict


def test_multiples_of_a_shaft_that_is_struck_once_a_turn_are_no_mesh_of_other_teeth() -> None:
    """The twelfth lies where one tooth more would put the second stage's mesh."""
    pairs = (GearPair("stage", "in", "out", 36, 90), GearPair("second", "out", "slow", 29, 100))
    rig = replace(RIG, shafts=(*RIG.shafts, Shaft("slow")), pairs=pairs)
    recording = record(rig=rig, seconds=8.0)
    turns = refined_angle(recording, rig).revolutions_at(np.arange(recording.n_samples) / SAMPLING_RATE_HZ)
    samples = np.array(recording.samples)
    samples[recording.channel_names.index("a1")] += 10.0 * np.exp(-60.0 * (turns % 1))
    found = codes(analyze(replace(recording, samples=samples)))
    assert "mesh-absent" in found
    assert "teeth-disagree" not in found


def test_a_mesh_above_half_the_sampling_rate() -> None:
    recording = record()
    fast = replace(RIG, pairs=(GearPair("stage", "in", "out", 270, 430),), bearings=())
    assert "mesh-above-sampling" in codes(analyze(replace(recording, rig=fast)), Kind.CANNOT_TELL)


def test_a_machine_at_rest() -> None:
    rng = np.random.default_rng(1)
    recording = Recording(
        rng.normal(size=(1, 20_000)), 10240.0, (Channel("a1", "acceleration"),), speed=ConstantSpeed(0.0), rig=RIG
    )
    analysis = analyze(recording)
    assert isinstance(analysis.shaft_angle, CannotTell)
    assert "rest" in analysis.shaft_angle.reason
    assert analysis.verdict.startswith("Cannot tell")


def test_noise_allows_no_speed_and_no_fault() -> None:
    rng = np.random.default_rng(2)
    recording = Recording(rng.normal(size=(2, 60_000)), 10240.0, (Channel("a1"), Channel("a2")), rig=RIG)
    analysis = analyze(recording)
    assert isinstance(analysis.shaft_angle, CannotTell)
    assert not codes(analysis, Kind.FAULT, Kind.SUSPICION)


def test_nothing_but_a_sampling_rate_gives_spectra() -> None:
    t = np.arange(20_000) / 2000.0
    values = np.cos(2 * np.pi * 123.0 * t) + 0.1 * np.random.default_rng(3).normal(size=len(t))
    analysis = analyze(Recording(values[None, :], 2000.0, (Channel("a1"),)))
    assert analysis.verdict.startswith("Cannot tell")
    assert finding(analysis, "strongest-line").where.frequency_hz == pytest.approx(123.0, abs=0.1)
    position, amplitude = analysis.channels[0].spectrum.largest_near(123.0, 1.0)
    assert (position, amplitude) == pytest.approx((123.0, 1.0), rel=0.01)


def test_dead_and_clipped_channels_are_reported_and_the_others_used() -> None:
    recording = record()
    samples = np.vstack([recording.samples, np.zeros(recording.n_samples), np.clip(recording.samples[0], -4, 4)])
    channels = (*recording.channels, Channel("dead", "acceleration"), Channel("cut", "acceleration"))
    analysis = analyze(replace(recording, samples=samples, channels=channels))
    problems = {f.code: f.where.channels for f in analysis.findings if f.kind is Kind.DATA_PROBLEM}
    assert problems == {"channel-dead": ("dead",), "channel-clipped": ("cut",)}
    assert {c.channel for c in analysis.channels} == {"a1", "cut"}


def test_only_dead_channels() -> None:
    analysis = analyze(
        Recording(np.zeros((1, 5000)), 1000.0, (Channel("a1", "acceleration"),), speed=ConstantSpeed(600))
    )
    assert "all-channels-dead" in codes(analysis)
    assert analysis.verdict.startswith("Cannot tell")


@pytest.mark.parametrize("n_samples", [2, 255])
def test_too_few_samples_are_an_error(n_samples: int) -> None:
    with pytest.raises(InputError, match="256 or more"):
        analyze(Recording(np.ones((1, n_samples)), 1000.0, (Channel("a1"),)))


def test_no_vibration_channel_is_an_error() -> None:
    recording = Recording(np.ones((1, 1000)), 1000.0, (Channel("t", "tachometer"),))
    with pytest.raises(InputError, match="no vibration channel"):
        analyze(recording)


def test_same_recording_same_answer(knocking: Analysis) -> None:
    assert analyze(knocking.recording).findings == knocking.findings


@pytest.mark.parametrize("gain", [1e-6, 1e6])
def test_the_unit_of_the_channel_does_not_matter(gain: float, knocking: Analysis) -> None:
    samples = np.array(knocking.recording.samples)
    samples[0] *= gain
    here, there = (  # but for overall velocity, which is noticed where it is large
        [f for f in analysis.findings if f.code != "overall-velocity"]
        for analysis in (knocking, analyze(replace(knocking.recording, samples=samples)))
    )
    assert [f.code for f in here] == [f.code for f in there]
    assert [f.confidence for f in here] == pytest.approx([f.confidence for f in there])


def test_the_text_tells_place_strength_and_remedy(knocking: Analysis) -> None:
    text = analysis_text(knocking, with_indicators=True)
    for part in ("gear stage/in; tooth 1", "how strong:", "how sure:", "more certain with:", "FM4", ", tooth 1"):
        assert part in text
    assert max(len(line) for line in text.splitlines()[:20]) <= 100


def test_tachometer_on_the_slow_shaft() -> None:
    damage = ToothDamage("stage", "in", 0.4, impulse_mps2=10.0)
    model = replace(GOOD, tooth_damages=(damage,), tachometer=Tachometer("out", pulses_per_revolution=1))
    recording = record(model, rig=replace(RIG, speed=TachometerChannel("tacho", shaft="out")))
    analysis = analyze(recording)
    assert analysis.findings[0].code == "tooth-local-damage"
    assert analysis.findings[0].where.shaft == "in"
