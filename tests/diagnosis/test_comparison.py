"""A recording beside a reference: what belongs together, and by how much it has changed."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig.diagnosis import (
    Analysis,
    Finding,
    Kind,
    Strength,
    Where,
    analyze,
    beside_reference,
    changes,
    read_reference,
    rig_and_rate_of_reference,
)
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.report import marked_positions, reference_text
from gearsig.rig import Sensor, TachometerChannel, write_rig
from tests.diagnosis.machines import GOOD, RIG, codes, finding, good_analysis, motor, record, teeth
from tests.kinematic.model import BearingFault


@pytest.fixture(scope="module")
def louder() -> Analysis:
    """Analyse a recording that is the reference twice as loud."""
    recording = record()
    return analyze(replace(recording, samples=2.0 * recording.samples), reference=recording)


def test_twice_as_loud_is_6_db_in_levels_and_nothing_in_shapes(louder: Analysis) -> None:
    by_name = {
        (i.name, i.computed_on): c for i, c in zip(louder.indicators, changes(louder), strict=True) if c is not None
    }
    assert by_name["rms", "raw"].change_db == pytest.approx(20 * math.log10(2), abs=1e-6)
    assert by_name["kurtosis", "raw"].change_db == pytest.approx(0.0, abs=1e-6)
    assert by_name["rms", "raw"].reference_value == pytest.approx(
        next(i.value for i in louder.indicators if (i.name, i.computed_on) == ("rms", "raw")) / 2
    )


def test_levels_in_db_change_by_their_difference(louder: Analysis) -> None:
    pairs = [(i, c) for i, c in zip(louder.indicators, changes(louder), strict=True) if i.unit == "dB" and c]
    assert pairs
    assert all(c.change_db == pytest.approx(i.value - c.reference_value) for i, c in pairs)


def test_the_reference_is_the_earlier_record_of_trend_indicators(louder: Analysis) -> None:
    """Twice the residual r: m₄ is 16 times r's, the mean variance of both records 5/2 of it, that of the healthy 1."""
    assert louder.reference is not None
    for name in ("NA4", "NB4"):
        alone = {(i.channel, i.gear): i.value for i in louder.reference.indicators if i.name == name}
        now = {(i.name, i.channel, i.gear): i.value for i in louder.indicators}
        assert alone
        for key, kurtosis in alone.items():
            assert now[name, *key] == pytest.approx(16.0 / 2.5**2 * kurtosis)
            assert now[f"{name}*", *key] == pytest.approx(16.0 * kurtosis)


def test_of_bearings_of_one_size_the_damage_is_said_and_marked_once() -> None:
    """It may be in either, which the fault says; its order has changed since the reference in both."""
    front = next(bearing for bearing in RIG.bearings if bearing.name == "front")
    rig = replace(RIG, bearings=(*RIG.bearings, replace(front, name="rear")))
    damaged = replace(GOOD, bearing_faults=(BearingFault("front", "outer", 12.0, 3000.0, 0.04, 0.01, 0.2),))
    analysis = analyze(replace(record(damaged), rig=rig), reference=replace(record(seed=1), rig=rig))
    fault = finding(analysis, "bearing-outer-race")
    assert "front" in fault.title
    assert "rear" in fault.title
    assert "bearing-risen" not in codes(analysis, Kind.SUSPICION)
    channel = next(c for c in analysis.channels if c.channel in fault.where.channels)
    assert channel.envelope_spectrum is not None
    marked = marked_positions(analysis, channel.envelope_spectrum, channel.channel, of_bearings=True)
    assert marked == pytest.approx([fault.where.order])


def test_a_reference_that_cannot_be_analysed_is_not_compared_and_the_verdict_says_why() -> None:
    """A record at rest says nothing of a bearing: "the reference does not show it" would be no evidence."""
    damaged = replace(GOOD, bearing_faults=(BearingFault("front", "outer", 12.0, 3000.0, 0.04, 0.01, 0.2),))
    healthy = record(seed=1)
    dead = replace(
        healthy,
        samples=np.where(np.isin(healthy.channel_names, healthy.vibration_names())[:, None], 0.0, healthy.samples),
    )
    analysis = analyze(record(damaged), reference=dead)
    assert finding(analysis, "bearing-outer-race").kind is Kind.FAULT
    assert not any("reference" in text for text in finding(analysis, "bearing-outer-race").evidence)
    assert finding(analysis, "reference-unfit").title in analysis.verdict
    assert analysis.reference is None
    assert set(changes(analysis)) == {None}


def test_the_rate_of_a_rig_file_beside_the_reference_holds_for_it(tmp_path: Path) -> None:
    path = tmp_path / "healthy.csv"
    assert rig_and_rate_of_reference(path, None, 12000.0)[1] == 12000.0
    write_rig(replace(RIG, sampling_rate_hz=48000.0), tmp_path / "healthy.toml")
    rig, rate_hz = rig_and_rate_of_reference(path, None, 12000.0)
    assert (rig.sampling_rate_hz, rate_hz) == (48000.0, None)
    assert rig_and_rate_of_reference(path, None, 12000.0, 25600.0)[1] == 25600.0


def test_the_rig_file_beside_the_reference_says_how_it_was_measured(tmp_path: Path) -> None:
    """The machine is the recording's; sensors and speed source are those of the reference's own measurement."""
    measured = replace(RIG, sensors=(Sensor("ch1", scale=62.5),), speed=TachometerChannel("ch2", shaft="in"))
    then = replace(RIG, bearings=(), sensors=(Sensor("a1"),), speed=TachometerChannel("tacho", shaft="in"))
    write_rig(then, tmp_path / "then.toml")
    rig = rig_and_rate_of_reference(tmp_path / "then.csv", measured, None)[0]
    assert (rig.sensors, rig.speed, rig.bearings) == (then.sensors, then.speed, RIG.bearings)
    write_rig(replace(then, speed=TachometerChannel("tacho", shaft="out")), tmp_path / "then.toml")
    with pytest.raises(InputError, match=r"then.csv: .* speed of shaft 'out', the recording's that of 'in'"):
        rig_and_rate_of_reference(tmp_path / "then.csv", measured, None)
    assert rig_and_rate_of_reference(tmp_path / "then.csv", RIG, None)[0].speed is None


def test_a_reference_without_a_rate_asks_for_its_own_option(tmp_path: Path) -> None:
    path = tmp_path / "then.csv"
    np.savetxt(path, record().samples[:1].T, header="a1", comments="", fmt="%.6g")
    with pytest.raises(InputError, match=r"then.csv: states no sampling rate .*; give --reference-fs or"):
        read_reference(path, RIG)
    assert read_reference(path, RIG, reference_rate_hz=5120.0).recording.sampling_rate_hz == 5120.0


def test_a_reference_that_is_suspected_is_not_called_faulty() -> None:
    then = replace(good_analysis(), findings=(Finding("bearing-outer-race", Kind.SUSPICION, "D."),), verdict="D.")
    assert reference_text(then).endswith(", which gives a suspicion itself: D.")


@pytest.mark.slow
def test_a_reference_that_is_damaged_itself_is_said_to_be_so() -> None:
    sound, outer, inner = (motor(race, 1) for race in ("", "BPFO", "BPFI"))
    beside = analyze(inner, reference=outer)
    said = finding(beside, "reference-not-healthy")
    assert (said.where.bearing, said.title in beside.verdict) == ("drive end", True)
    assert "exchanged" not in said.title
    assert "exchanged" in finding(analyze(sound, reference=outer), "reference-not-healthy").title
    assert "reference-not-healthy" not in codes(analyze(outer, reference=sound))


def test_without_a_reference_nothing_is_compared() -> None:
    analysis = good_analysis()
    assert set(changes(analysis)) == {None}
    assert analysis.crack is None


@pytest.mark.slow
def test_a_fault_says_whether_the_reference_shows_it() -> None:
    damaged = replace(GOOD, bearing_faults=(BearingFault("front", "outer", 12.0, 3000.0, 0.04, 0.01, 0.2),))
    new = analyze(record(damaged), reference=record(seed=1))
    assert codes(new, Kind.FAULT) == ["bearing-outer-race"]
    assert "The reference does not show it." in finding(new, "bearing-outer-race").evidence
    old = analyze(record(damaged), reference=record(damaged, seed=1))
    assert any(t.startswith("The reference shows it as well") for t in finding(old, "bearing-outer-race").evidence)


def test_a_reference_whose_own_rig_file_has_other_teeth_is_of_another_machine(tmp_path: Path) -> None:
    recording = tmp_path / "then.csv"
    recording.touch()
    assert rig_and_rate_of_reference(recording, RIG, None)[0] is RIG
    write_rig(teeth(20, 40), tmp_path / "then.toml")
    with pytest.raises(InputError, match="another machine: its rig file says teeth 20/40, the recording's 27/43"):
        rig_and_rate_of_reference(recording, RIG, None)
    write_rig(replace(RIG, operating_point=replace(RIG.operating_point, torque_nm=70.0)), tmp_path / "then.toml")
    rig = rig_and_rate_of_reference(recording, RIG, None)[0]
    assert rig is not None
    assert rig.operating_point.torque_nm == 70.0


TEETH = replace(RIG, bearings=())
TOOTH = Finding(
    "tooth-local-damage",
    Kind.FAULT,
    "Damage.",
    Where(("a1",), shaft="in", gear="stage/in", angle_deg=6.7, tooth=1),
    Strength(2.0, "m/s^2", 0.1, "floor"),
)
RACE = Finding(
    "bearing-outer-race",
    Kind.FAULT,
    "Damage.",
    Where(("a1",), shaft="in", bearing="front", order=3.6, band_hz=(1000.0, 2000.0)),
    Strength(0.2, "", 0.01, "floor"),
)
IMPACTS = replace(RACE, code="non-synchronous-impacts", where=replace(RACE.where, shaft="", bearing=""))
SIDEBANDS = Finding(
    "mesh-modulated",
    Kind.SUSPICION,
    "Modulated.",
    Where(("a1",), shaft="in", gear="stage/in", order=1.0),
    Strength(0.4, "sideband/carrier", 0.1, "common"),
)
NOT_THERE = "The reference does not show it."
AS_WELL = "The reference shows it as well; since then it has changed by +6.0 dB."


def told(then: Finding, now: Finding) -> str:
    """Return what is said of a finding beside a reference with another, half as strong."""
    assert then.strength is not None
    half = replace(then, strength=replace(then.strength, value=0.5 * then.strength.value))
    reference = replace(analyze(record(seconds=1.0)), rig=TEETH, findings=(half,))
    return beside_reference([now], reference)[0].evidence[-1]


def moved(finding: Finding, **where: object) -> Finding:
    return replace(finding, where=replace(finding.where, **where))  # type: ignore[arg-type]


@pytest.mark.parametrize("finding", [TOOTH, RACE, IMPACTS, SIDEBANDS])
def test_the_same_finding_is_recognised_with_its_change(finding: Finding) -> None:
    assert told(finding, finding) == AS_WELL


@pytest.mark.parametrize(("then", "now"), [(1, 27), (27, 1), (5, 6), (6, 5)])
def test_neighbouring_teeth_are_the_same_also_across_the_mark(then: int, now: int) -> None:
    assert told(moved(TOOTH, tooth=then), moved(TOOTH, tooth=now)) == AS_WELL


@pytest.mark.parametrize("tooth", [3, 14, 26])
def test_another_tooth_is_another_damage(tooth: int) -> None:
    assert told(moved(TOOTH, tooth=tooth), TOOTH) == NOT_THERE


def test_without_a_mark_nobody_knows_whether_it_is_the_same_tooth() -> None:
    turned = moved(TOOTH, tooth=None, angle_deg=200.0)
    assert told(turned, moved(TOOTH, tooth=None)).startswith("The reference shows such an event on that shaft, +6.0 dB")


@pytest.mark.parametrize("band", [(3000.0, 5000.0), (2000.0, 3000.0)])
def test_levels_of_another_band_are_not_compared(band: tuple[float, float]) -> None:
    text = told(moved(RACE, band_hz=band), RACE)
    assert text == (
        f"The reference shows it as well, but in a1, {band[0]:.0f} to {band[1]:.0f} Hz: the levels do not compare."
    )
    assert told(moved(RACE, band_hz=(1500.0, 3000.0)), RACE) == AS_WELL


@pytest.mark.parametrize("where", [{"channels": ("a2",)}, {"band_hz": (3000.0, 5000.0)}])
def test_impacts_of_no_known_part_are_known_by_channel_and_band(where: dict[str, object]) -> None:
    assert told(moved(IMPACTS, **where), IMPACTS) == NOT_THERE


def test_a_tooth_seen_by_another_sensor_has_no_change_in_db() -> None:
    assert "but in a2: the levels do not compare" in told(moved(TOOTH, channels=("a2",)), TOOTH)


def test_sidebands_are_a_ratio_of_all_channels() -> None:
    assert told(moved(SIDEBANDS, channels=("a2",)), SIDEBANDS) == AS_WELL
    assert told(moved(SIDEBANDS, shaft="out"), SIDEBANDS) == NOT_THERE
    assert told(moved(SIDEBANDS, gear="other/in"), SIDEBANDS) == NOT_THERE


def test_another_part_or_order_is_another_finding() -> None:
    for other in ({"bearing": "rear"}, {"shaft": "out"}, {"order": 3.8}, {"order": None}):
        assert told(moved(RACE, **other), RACE) == NOT_THERE


@pytest.mark.slow
def test_channels_of_another_record_number_are_the_same_sensors() -> None:
    """X097_DE_time is X130_DE_time of another record; a channel that the reference lacks is not compared."""

    def named(recording: Recording, *names: str) -> Recording:
        channels = tuple(Channel(name, "acceleration", "m/s^2") for name in names)
        samples = np.vstack([recording.samples * (1 + i) for i in range(len(names))])
        return replace(recording, samples=samples, channels=channels)

    recording = named(motor("", 1), "X130_DE_time", "X130_BA_time")
    analysis = analyze(recording, reference=named(motor("", 2), "X097_DE_time"))
    assert {c.where.channels for c in analysis.level_changes} == {("X130_DE_time",)}
    with pytest.raises(InputError, match="no channel"):
        analyze(named(motor("", 1), "a1"), reference=named(motor("", 2), "a2"))
