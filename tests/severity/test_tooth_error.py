"""Faults of teeth by the transmission error: how its profile is described, and how likely each makes it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import RefusalError
from gearsig.motion import TransmissionError
from gearsig.prepared import prepare
from gearsig.recording import Recording
from gearsig.rig import Shaft
from gearsig.severity import (
    OTHER,
    SINGLE_TOOTH_FAULTS,
    TOOTH_FAULTS,
    CrackEstimate,
    KnownToothErrors,
    NoCrackSeen,
    ToothErrorChange,
    ToothErrorEvidence,
    UnlikeCracksError,
    combined_evidence,
    estimate_crack,
    tooth_error_changes,
    tooth_error_descriptors,
    tooth_error_evidence,
)
from sims.cracked import CrackedPair
from sims.effects import EffectSetting
from sims.machine import Operation
from sims.simulator import SimulationSetup
from tests.severity.gearbox import Record

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
    depth, reach = np.array([7.0, 0.9, -8.0, 0.3]), np.array([[15.0, 120.0], [18.0, 100.0], [10.0, 80.0]])
    return KnownToothErrors(rows, np.repeat([*TOOTH_FAULTS, OTHER], 60), depth, reach), centres


def test_a_known_profile_is_identified_and_a_strange_one_is_not() -> None:
    errors, centres = known()
    for name, centre in zip((*TOOTH_FAULTS, OTHER), centres, strict=True):
        said = errors.log_likelihoods(centre)
        assert max(said, key=said.__getitem__) == (name if name in SINGLE_TOOTH_FAULTS else "pitch_error")
        assert said["pitch_error"] == said[OTHER]
    far = [*errors.log_likelihoods(centres.mean(axis=0) + 100.0).values()]
    assert np.ptp(far) == pytest.approx(0.0, abs=1e-9)


def evidence(
    odds: float = 50.0,
    rms_um: float = 2.0,
    places_rev: dict[str, float] | None = None,
    pass_s: float = 0.3,
    **gained: float,
) -> ToothErrorEvidence:
    """Evidence of these odds, with the log-likelihoods of some faults raised by what they gained."""
    levels = {name: gained.get(name, 0.0) for name in SINGLE_TOOTH_FAULTS}
    mean = np.log(np.mean(np.exp([*levels.values()])))
    where = {"driver": 0.38} if places_rev is None else places_rev
    passes_s = dict.fromkeys(where, pass_s)
    others = dict.fromkeys(("pitch_error", OTHER), mean - np.log(odds))
    return ToothErrorEvidence(levels | others, 1.0, rms_um, where, passes_s)


@pytest.mark.parametrize("odds", [90.0, 1.0 / 12.0, 1.0])
def test_the_odds_of_a_tooth_are_those_of_a_mean_fault(odds: float) -> None:
    assert evidence(odds).odds_of_a_tooth == pytest.approx(odds)
    assert not evidence(odds).distinguishes_faults
    assert evidence(odds, root_crack=3.0).distinguishes_faults


def test_what_encoders_show_is_said_as_strongly_as_they_show_it() -> None:
    damaged, worn = evidence(50.0, root_crack=3.0).text, evidence(0.02, root_crack=3.0).text
    assert "50 times as likely with a damaged tooth" in damaged
    assert "cracked 91 %" in damaged
    assert "50 times as likely with wear" in worn
    assert "cracked" not in worn
    assert "no known fault" in evidence(1.0).text
    assert "few revolutions per second" in replace(evidence(1.0), weight=0.2).text


def test_conditions_count_by_their_speed_and_together_as_the_slowest() -> None:
    """A fast one, where the drive rings, must not dilute what a slow one shows."""
    slow, fast = evidence(50.0), replace(evidence(50.0**0.2), weight=0.2)
    both, twice = combined_evidence([slow, fast]), combined_evidence([slow, slow])
    assert both is not None
    assert twice is not None
    assert both.odds_of_a_tooth == pytest.approx(50.0)
    assert twice.odds_of_a_tooth == pytest.approx(50.0)
    assert combined_evidence([]) is None


@pytest.mark.parametrize(("load", "teeth", "percent"), [(8.0, 30, 30.0), (50.0, 12, 30.0), (50.0, 30, 95.0)])
def test_a_depth_is_not_told_beyond_known_cracks(load: float, teeth: int, percent: float) -> None:
    errors, _ = known()
    errors.check_reach(50.0, 30, 2.0)
    with pytest.raises(RefusalError, match="beyond the known cracks"):
        errors.check_reach(load, teeth, percent)


def test_a_larger_change_is_a_deeper_crack() -> None:
    errors, _ = known()
    shallow, deep = (errors.log_percent(rms_um, 100.0, 40) for rms_um in (0.5, 1.0))
    assert deep[0] - shallow[0] == pytest.approx(0.9 * np.log(2.0))
    assert shallow[1] == deep[1] == 0.3


def recorded(*settings: EffectSetting) -> Recording:
    setup = SimulationSetup("published_55_75", {"encoder_counts": 200_000}, settings, Operation.steady(90.0, 110.0))
    return CrackedPair().simulate(setup, np.random.default_rng(1), sampling_rate_hz=20480.0, duration_s=5.0)


def turned(recording: Recording, driver_pitches: float, driven_pitches: float) -> Recording:
    """The same, with encoders that start elsewhere."""
    samples = recording.samples.copy()
    assert recording.rig is not None
    teeth = recording.rig.pairs[0].driver_teeth, recording.rig.pairs[0].driven_teeth
    names = [channel.name for channel in recording.channels]
    for shaft, z, pitches in zip(("input", "output"), teeth, (driver_pitches, driven_pitches), strict=True):
        assert z is not None
        row = names.index(f"{shaft} encoder")
        whole = {"deg": 360.0, "rad": 2.0 * np.pi}[recording.channels[row].unit]
        samples[row] += whole * pitches / z
    return replace(recording, samples=samples)


@pytest.mark.slow
@pytest.mark.parametrize("pitches", [(17.0, 41.0), (17.3, 40.3)])
def test_encoders_may_start_anywhere(pitches: tuple[float, float]) -> None:
    healthy, cracked = recorded(), recorded(EffectSetting("root_crack", 3.0, {"gear": "driver", "tooth": 7.0}))
    for now, before in ((cracked, turned(healthy, 0.5, 0.5)), (turned(cracked, *pitches), turned(healthy, *pitches))):
        said = tooth_error_evidence(now, before)
        assert said is not None
        assert said.odds_of_a_tooth > 20.0
        estimate = estimate_crack(now, reference=before)
        assert isinstance(estimate, CrackEstimate)
        assert estimate.tooth == 7


@pytest.mark.slow
def test_encoders_identify_a_crack_at_low_speed() -> None:
    healthy, cracked = recorded(), recorded(EffectSetting("root_crack", 3.0, {"gear": "driver", "tooth": 7.0}))
    said = tooth_error_evidence(cracked, healthy)
    assert said is not None
    assert said.gear == "driver"
    assert int(55 * said.places_rev["driver"]) + 1 == 7
    assert next(iter(said.probabilities)) == "root_crack"
    assert said.probabilities["root_crack"] > 0.7
    assert said.odds_of_a_tooth > 20.0
    assert healthy.rig is not None
    real = healthy.rig.pairs[0]
    before = replace(real, name="before it", driver="motor", driven="input")
    two_pairs = replace(healthy.rig, shafts=(Shaft("motor"), *healthy.rig.shafts), pairs=(before, real))
    of_second = tooth_error_evidence(cracked, healthy, two_pairs, pair=real.name)
    assert of_second == said
    with pytest.raises(RefusalError, match="was not measured"):
        tooth_error_evidence(cracked, healthy, two_pairs)
    halves = healthy.between(0.0, 2.5), healthy.between(2.5, 5.0)
    unchanged = tooth_error_evidence(*halves)
    assert unchanged is not None
    assert not unchanged.is_seen
    assert unchanged.odds_of_a_tooth == 1.0
    with pytest.raises(RefusalError, match="in the reference"):
        tooth_error_evidence(healthy, cracked)
    with pytest.raises(RefusalError, match="in the reference"):
        estimate_crack(healthy, reference=cracked)
    estimate = estimate_crack(cracked, reference=healthy)
    assert isinstance(estimate, CrackEstimate)
    assert estimate.kind == "cracked"
    assert estimate.shaft == "input"
    assert estimate.interval_mm[0] < 3.0 < estimate.interval_mm[1]
    assert "encoders" in " ".join(estimate.reasons)


def transmission(teeth: tuple[int, int], *events: tuple[int, int], every: int = 1) -> TransmissionError:
    """Both gears' parts, least squares of minimum norm as `transmission_error` separates them, of events (side, tooth).

    An event of 1.5 pitches, 1 µm high on average, in every nth revolution. Angles start at tooth 3 of the driver and
    tooth 11 of the driven gear.
    """
    first, n_steps = (3, 11), STEPS
    n_rows = 3 * np.lcm(*teeth)
    number = np.arange(n_rows)
    errors = np.zeros((n_rows, n_steps))
    bump = np.sin(np.pi * (np.arange(48) + 0.5) / 48.0) ** 2
    for side, tooth in events:
        met = np.flatnonzero((first[side] + number) % teeth[side] == tooth)
        for row in met[met < n_rows - 2][::every]:
            errors.reshape(-1)[row * n_steps : row * n_steps + 48] += every * bump
    at = [(start + number) % z for start, z in zip(first, teeth, strict=True)]
    columns = np.hstack([np.eye(z)[k] for z, k in zip(teeth, at, strict=True)])
    parts = np.linalg.pinv(columns) @ (errors - errors.mean(axis=0))
    gears = parts[: teeth[0]], parts[teeth[0] :]
    shown = [gear - gear.mean(axis=0) for gear in gears]
    noise = [np.full(gear.shape, 1e-3) for gear in gears]
    return TransmissionError(
        errors, *first, np.cos(2.0 * np.pi * np.arange(n_steps) / n_steps), *shown, *noise, (0.05, 0.05),
        ("input", "output"), np.arange(n_rows) * 1e-2,
    )  # fmt: skip


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("teeth", [(20, 31), (20, 20), (15, 30), (30, 15), (20, 30)])
def test_the_whole_event_is_found_whatever_divisor_the_teeth_share(teeth: tuple[int, int], side: int) -> None:
    """Separated evenly, each of two equal gears shows half of it. Low orders take more from a gear of few teeth."""
    tooth = 8
    changes = tooth_error_changes(transmission(teeth, (side, tooth)), transmission(teeth))
    sides = [change.side for change in changes]
    assert sides == ([0, 1] if teeth[0] == teeth[1] else [side])
    alone = tooth_error_changes(transmission((21, 31), (side, tooth)), transmission((21, 31)))
    assert [change.rms_um for change in changes] == pytest.approx([alone[0].rms_um] * len(sides), rel=0.15)


def test_an_impact_that_does_not_turn_with_the_gear_is_no_event_of_it() -> None:
    """As of a bearing: averages of few revolutions show it at some tooth."""
    steady, passing = (
        tooth_error_changes(transmission((20, 21), (0, 8), every=n), transmission((20, 21)))[0] for n in (1, 30)
    )
    assert steady.is_repeated
    assert steady.size_error < 0.1
    assert not passing.is_repeated
    assert passing.is_clear


ESTIMATE = "gearsig.severity._estimate"


def estimated(
    monkeypatch: pytest.MonkeyPatch, evidence: ToothErrorEvidence, recording: Recording, healthy: Recording
) -> CrackEstimate | NoCrackSeen:
    """The crack estimate of recordings without encoders, as if they had shown this."""
    monkeypatch.setattr("gearsig.severity._encoders.tooth_error_evidence", lambda *_: evidence)
    return estimate_crack(recording, reference=healthy)


CRACKED = {"root_crack": 6.0}


def pass_s(recording: Recording, tooth: int) -> float:
    """When the middle of a tooth of the driver passes."""
    time_s = np.arange(0.2, 0.3, 1e-5)
    turned = prepare(recording).angle_of("input").revolutions_at(time_s) * 29.0 % 29.0
    return float(time_s[np.argmin(np.abs(turned - (tooth - 0.5)))])


def test_encoders_make_the_same_crack_more_certain(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording
) -> None:
    alone = estimate_crack(record(2.0), reference=healthy)
    assert isinstance(alone, CrackEstimate)
    assert alone.tooth is not None
    shown = evidence(5.0, 0.7, pass_s=pass_s(record(2.0), alone.tooth), **CRACKED)
    both = estimated(monkeypatch, shown, record(2.0), healthy)
    assert isinstance(both, CrackEstimate)
    assert both.tooth == alone.tooth
    assert np.ptp(np.log(both.interval_mm)) < np.ptp(np.log(alone.interval_mm))
    assert both.p_value == pytest.approx(alone.p_value / 5.0, rel=0.1)
    assert "finite-element teeth, which give way more" not in " ".join(both.reasons)
    assert "finite-element teeth, which give way more" in " ".join(alone.reasons)
    assert both.kind_probabilities["cracked"] > alone.kind_probabilities["cracked"]


@pytest.mark.parametrize("place", [{"driver": 0.9}, {"driven": 0.4}])
def test_encoders_that_name_another_tooth_are_said_and_not_counted(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording, place: dict[str, float]
) -> None:
    alone = estimate_crack(record(2.0), reference=healthy)
    other = estimated(monkeypatch, evidence(50.0, 1.0, place, **CRACKED), record(2.0), healthy)
    assert isinstance(other, CrackEstimate)
    assert replace(other, reasons=()) == replace(alone, reasons=())
    assert "The vibration says otherwise" in other.reasons[-1]


@pytest.mark.parametrize(("odds", "shaft"), [(50.0, "output"), (5.0, "input")])
def test_only_clear_encoders_tell_the_gear_that_the_vibration_leaves_open(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording, odds: float, shaft: str
) -> None:
    alone = estimate_crack(record(2.0), reference=healthy)
    assert isinstance(alone, CrackEstimate)
    monkeypatch.setattr(f"{ESTIMATE}._by_vibration", lambda *_: replace(alone, gear_is_certain=False))
    answer = estimated(monkeypatch, evidence(odds, 1.0, {"driven": 0.4}, **CRACKED), record(2.0), healthy)
    assert isinstance(answer, CrackEstimate)
    assert answer.shaft == shaft


def test_a_tooth_that_stands_out_unlike_cracks_is_not_ruled_out_by_encoders(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording
) -> None:
    def unlike(*_: object) -> None:
        raise UnlikeCracksError("one tooth stands out, but unlike cracks", remedy="look at the tooth")

    monkeypatch.setattr(f"{ESTIMATE}._by_vibration", unlike)
    with pytest.raises(UnlikeCracksError, match="look at the tooth"):
        estimated(monkeypatch, evidence(1.0, 0.05, {}), record(2.0), healthy)
    answer = estimated(monkeypatch, evidence(5.0, 1.0, **CRACKED), record(2.0), healthy)
    assert isinstance(answer, CrackEstimate)
    assert "unlike cracks" in answer.reasons[-1]


def test_a_crack_is_not_deeper_than_the_root() -> None:
    """A tooth out of its place moves by more than a crack could let it."""
    moderate, huge = (evidence(50.0, rms_um, **CRACKED).with_load(90.0, (29, 47)) for rms_um in (0.5, 5.0))
    assert moderate.odds_of_a_tooth == pytest.approx(50.0, rel=0.01)
    assert huge.odds_of_a_tooth < 2.0
    assert evidence(50.0, **CRACKED).with_load(np.nan, (29, 47)).odds_of_a_tooth == pytest.approx(50.0)


def test_encoders_stand_in_for_the_vibration_but_not_for_a_fitting_reference(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording
) -> None:
    clear = evidence(50.0, 0.5, {"driven": 0.4}, **CRACKED)
    short = record(2.0, duration_s=0.4)
    answer = estimated(monkeypatch, clear, short, healthy)
    assert isinstance(answer, CrackEstimate)
    assert answer.shaft == "output"
    assert answer.reach_cycles is None
    assert answer.p_value == pytest.approx(0.02, rel=0.1)
    assert "By the vibration there is no estimate" in " ".join(answer.reasons)
    with pytest.raises(RefusalError, match=r"revolutions.*needed"):
        estimated(monkeypatch, evidence(2.0), short, healthy)
    with pytest.raises(RefusalError, match="By the encoders"):
        estimated(monkeypatch, evidence(2.0), short, healthy)
    with pytest.raises(RefusalError, match="same samples"):
        estimated(monkeypatch, clear, healthy, healthy)
    with pytest.raises(RefusalError, match="at a speed"):
        estimated(monkeypatch, clear, record(2.0, speed_rpm=1400.0), healthy)


@pytest.mark.parametrize("smallest_um", [0.05, 0.15, 0.5])
def test_encoders_that_see_nothing_bound_the_depth_where_vibration_does_not(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording, smallest_um: float
) -> None:
    nothing = evidence(1.0, smallest_um, {})
    short = record(0.0, duration_s=0.4)
    if smallest_um > 0.3:  # half of the root would not show
        with pytest.raises(RefusalError, match="no tooth changed"):
            estimated(monkeypatch, nothing, short, healthy)
        return
    answer = estimated(monkeypatch, nothing, short, healthy)
    assert isinstance(answer, NoCrackSeen)
    assert answer.below_percent == pytest.approx({0.05: 15.1, 0.15: 34.2}[smallest_um], rel=0.01)
    assert "revolutions" in answer.reasons[-1]


def test_encoders_that_show_no_tooth_leave_the_answer_to_the_vibration(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording
) -> None:
    alone = estimate_crack(record(2.0), reference=healthy)
    answer = estimated(monkeypatch, evidence(0.02, **CRACKED), record(2.0), healthy)
    assert replace(answer, reasons=()) == replace(alone, reasons=())
    assert "as likely with wear" in answer.reasons[-1]


def test_a_depth_at_the_whole_root_can_be_combined(
    monkeypatch: pytest.MonkeyPatch, record: Record, healthy: Recording
) -> None:
    """Intervals end at 100 %, so that their width may be nothing."""
    whole = estimate_crack(record(2.0), reference=healthy)
    assert isinstance(whole, CrackEstimate)
    whole_mm = 100.0 * whole.depth_mm / whole.depth_percent
    fields = {"depth_percent": 100.0, "interval_percent": (100.0, 100.0), "depth_mm": whole_mm}
    whole = replace(whole, **fields, interval_mm=(whole_mm, whole_mm), kind_probabilities={})
    monkeypatch.setattr(f"{ESTIMATE}._by_vibration", lambda *_: whole)
    assert whole.tooth is not None
    shown = evidence(50.0, 1.1, pass_s=pass_s(record(2.0), whole.tooth), **CRACKED)
    answer = estimated(monkeypatch, shown, record(2.0), healthy)
    assert isinstance(answer, CrackEstimate)
    assert answer.interval_percent[0] < 100.0
    assert answer.kind == "cracked"
