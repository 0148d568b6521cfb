"""The gap of a rig with bearings and no gears: a race is named or nothing is, never a gear effect; no simulation."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from app.cli.main import main
from gearsig.errors import RefusalError
from gearsig.gap import GapOutcome, GapReport, GapRequest, PlaceKind, diagnose_gap, read_gap_inputs
from gearsig.recording import Channel, Recording, read_recording
from gearsig.report import gap_page_html, gap_schema, gap_to_dict
from gearsig.rig import Bearing, ConstantSpeed, GearPair, Rig, Shaft, write_rig
from sims.registry import gap_simulator

DATA = Path(__file__).parents[3] / "shared" / "data"
RATE_HZ, SPEED_HZ, LENGTH_S = 20_000.0, 25.0, 4.0
RIG = Rig(
    name="bearing test rig",
    shafts=(Shaft("shaft"),),
    bearings=(Bearing("test bearing", "shaft", 8, 5.969, 31.623),),  # 0.235 in and 1.245 in: BPFO 3.245, BPFI 4.755
    speed=ConstantSpeed(60.0 * SPEED_HZ, "shaft"),
)
ORDERS = RIG.bearings[0].orders()
ANSWERS = {"bearing_outer_race", "bearing_inner_race", "unknown", "none"}


@cache
def recording(order: float = 0.0, seed: int = 0) -> Recording:
    """Return noise with impacts at an order, each 1 % early or late, that ring at 4 kHz; order 0: noise alone."""
    rng = np.random.default_rng(seed)
    n = int(LENGTH_S * RATE_HZ)
    strikes = np.zeros(n)
    if order:
        gaps = rng.normal(1.0, 0.01, int(LENGTH_S * SPEED_HZ * order)) / (order * SPEED_HZ)
        at = np.cumsum(gaps) * RATE_HZ
        strikes[at[at < n].astype(int)] = 3.0 * rng.normal(1.0, 0.1, int(np.sum(at < n)))
    time_s = np.arange(200) / RATE_HZ
    ring = np.exp(-900.0 * time_s) * np.sin(2 * np.pi * 4000.0 * time_s)
    samples = np.convolve(strikes, ring)[:n] + 0.3 * rng.standard_normal(n)
    return Recording(samples[None], RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),))


def diagnosed(now: Recording, *references: Recording, rig: Rig = RIG, effects: Sequence[str] = ()) -> GapReport:
    report = diagnose_gap(
        [now.with_rig(rig).with_name("now")],
        gap_simulator("cracked"),
        references=[reference.with_rig(rig) for reference in references],
        effects=effects,
    )
    assert {cause.name for cause in report.causes} <= ANSWERS
    assert sum(cause.probability for cause in report.causes) == pytest.approx(1.0)
    assert sum(report.groups.values()) == pytest.approx(1.0)
    assert not report.is_simulated
    assert (report.steps, report.angles, report.twin_toml) == ((), (), "")
    assert any("nothing was simulated" in notice for notice in report.notes)
    jsonschema.Draft202012Validator(gap_schema()).validate(gap_to_dict(report))
    page = gap_page_html(report)
    assert "structural floor" not in page
    assert ">nan" not in page
    return report


@pytest.mark.slow
@pytest.mark.parametrize(("order", "name"), [("BPFO", "bearing_outer_race"), ("BPFI", "bearing_inner_race")])
def test_a_damaged_race_is_named_with_its_place(order: str, name: str) -> None:
    report = diagnosed(recording(ORDERS[order]))
    cause, place = report.causes[0], report.places[0]
    assert (report.outcome, cause.name, cause.place) == (GapOutcome.EFFECT, name, "test bearing")
    assert 0.5 < cause.probability <= 0.95
    assert (place.kind, place.shaft, place.channel) == (PlaceKind.ENVELOPE, "shaft", "a1")
    assert place.orders[0] == pytest.approx(ORDERS[order], rel=0.01)
    assert place.band_hz is not None
    assert place.band_hz[0] < 4500.0
    assert place.band_hz[1] > 3500.0
    assert cause.severity is None
    assert any("harmonics of" in text for text in cause.notes)
    assert "at most" in report.verdict[1]
    assert report.verdict[2].startswith("How far: not known")
    assert len(report.spectra[0].before) == 0


def test_noise_names_nothing_and_proves_nothing() -> None:
    report = diagnosed(recording())
    assert (report.outcome, report.places) == (GapOutcome.UNKNOWN, ())
    assert "might not have" in report.verdict[1]
    assert any("cannot be told" in notice and "now:" in notice for notice in report.notes)


def test_against_a_healthy_reference_that_is_alike_there_is_no_gap() -> None:
    report = diagnosed(recording(), recording(seed=1))
    assert (report.outcome, report.causes[0].name) == (GapOutcome.NO_GAP, "none")
    assert report.references
    assert "healthy reference" in report.verdict[0]


@pytest.mark.slow
def test_a_race_that_the_healthy_reference_does_not_show_is_named() -> None:
    report = diagnosed(recording(ORDERS["BPFO"]), recording(seed=1))
    assert report.causes[0].name == "bearing_outer_race"
    assert report.references


def test_a_reference_that_is_damaged_itself_is_not_used() -> None:
    report = diagnosed(recording(ORDERS["BPFO"]), recording(ORDERS["BPFO"], seed=1))
    assert report.causes[0].name == "bearing_outer_race"
    assert report.references == ()
    assert any("not healthy" in notice for notice in report.notes)


@pytest.mark.slow
def named(record: Recording, number: int, *more: str) -> Recording:
    """Return the recording with the names that a data logger gives by the record's number, and as many channels."""
    places = ("DE", *more)
    noise = np.random.default_rng(7).standard_normal((len(more), record.n_samples))
    channels = tuple(replace(record.channels[0], name=f"X{number}_{place}_time") for place in places)
    return replace(record, samples=np.concatenate([record.samples, noise]), channels=channels)


@pytest.mark.slow
def test_channels_that_differ_by_a_records_number_are_compared_and_one_that_is_not_there_is_told() -> None:
    report = diagnosed(named(recording(ORDERS["BPFO"]), 130, "FE"), named(recording(seed=1), 118))
    assert report.causes[0].name == "bearing_outer_race"
    assert report.references
    assert "now: the reference has no channel X130_FE_time; what stands out there may not be new." in report.notes


def test_a_reference_at_another_rate_is_read_at_its_own(tmp_path: Path) -> None:
    """Its rig file or the request tells it; what is stated for the recordings is not the reference's then."""
    write_rig(RIG, tmp_path / "rig.toml")
    for name in ("now", "then"):
        np.savetxt(tmp_path / f"{name}.csv", np.random.default_rng(0).standard_normal(4000), header="a1", comments="")
    request = GapRequest(
        (tmp_path / "now.csv",), (tmp_path / "then.csv",), tmp_path / "rig.toml", sampling_rate_hz=12e3
    )

    def rates(request: GapRequest) -> list[float]:
        inputs = read_gap_inputs(request)
        return [r.sampling_rate_hz for r in (*inputs.recordings, *inputs.references)]

    assert rates(request) == [12e3, 12e3]
    assert rates(replace(request, reference_rate_hz=48e3)) == [12e3, 48e3]
    write_rig(replace(RIG, sampling_rate_hz=24e3), tmp_path / "then.toml")
    assert rates(request) == [12e3, 24e3]


@pytest.mark.slow
def test_impacts_of_no_known_part_stay_unknown() -> None:
    strange = diagnosed(recording(5.9))
    assert strange.outcome is GapOutcome.UNKNOWN
    assert strange.places[0].orders[0] == pytest.approx(5.9, rel=0.01)
    assert "impacts" in strange.verdict[1]
    same = diagnosed(recording(5.9), recording(5.9, seed=1))
    assert same.outcome is GapOutcome.NO_GAP  # as strong when the machine was healthy
    louder = replace(recording(5.9), samples=3.0 * recording(5.9).samples)
    grown = diagnosed(louder, recording(5.9, seed=1))
    assert grown.outcome is GapOutcome.UNKNOWN
    assert grown.places[0].change_db == pytest.approx(9.5, abs=2.0)
    assert "over the reference" in grown.places[0].title


def test_a_rolling_element_is_not_in_the_catalogue() -> None:
    report = diagnosed(recording(2.0 * ORDERS["BSF"]))
    assert report.outcome is GapOutcome.UNKNOWN
    assert "rolling element" in report.verdict[1]


def test_an_effect_that_was_not_asked_for_is_not_named() -> None:
    report = diagnosed(recording(ORDERS["BPFO"]), effects=["root_crack", "bearing_inner_race"])
    assert (report.outcome, report.causes[0].name) == (GapOutcome.UNKNOWN, "unknown")
    assert "bearing_outer_race" not in [cause.name for cause in report.causes]


def test_bearings_of_equal_orders_are_named_together() -> None:
    twin = replace(RIG.bearings[0], name="other bearing")
    report = diagnosed(recording(ORDERS["BPFO"]), rig=replace(RIG, bearings=(*RIG.bearings, twin)))
    assert report.causes[0].place == "test bearing or other bearing"


def test_several_recordings_say_which_shows_it() -> None:
    report = diagnose_gap(
        [
            recording().with_rig(RIG).with_name("quiet"),
            recording(ORDERS["BPFO"]).with_rig(RIG).with_name("loud"),
        ],
        gap_simulator("cracked"),
    )
    assert report.causes[0].name == "bearing_outer_race"
    assert report.places[0].title.endswith(", in loud")
    assert any(notice.startswith("quiet: no lines of the outer race") for notice in report.notes)


def test_one_of_several_that_is_too_short_is_left_out() -> None:
    whole = recording(ORDERS["BPFO"]).with_rig(RIG).with_name("whole")
    short = replace(whole, samples=whole.samples[:, :500]).with_name("short")
    report = diagnose_gap([short, whole], gap_simulator("cracked"))
    assert report.causes[0].name == "bearing_outer_race"
    assert [one.name for one in report.conditions] == ["whole"]
    assert any(n.startswith("short: ") and n.endswith("this recording is left out.") for n in report.notes)


@pytest.mark.parametrize(
    ("rig", "said"),
    [
        (Rig("bare", (Shaft("shaft"),), speed=RIG.speed), "neither a gear pair nor a bearing"),
        (replace(RIG, bearings=(Bearing("b", "shaft"),)), "for no bearing"),
        (replace(RIG, speed=None), "speed"),
        (
            replace(RIG, shafts=(Shaft("shaft"), Shaft("output")), pairs=(GearPair("stage", "shaft", "output", 23),)),
            "teeth of the driven gear of pair 'stage'",
        ),
    ],
)
def test_what_is_missing_is_said(rig: Rig, said: str) -> None:
    with pytest.raises(RefusalError, match=said):
        diagnose_gap([recording().with_rig(rig)], gap_simulator("cracked"))


@pytest.mark.slow
@pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")
@pytest.mark.parametrize(
    ("file", "name", "hertz"),
    [
        ("InnerRaceFault_vload_3.mat", "bearing_inner_race", 118.875),
        ("OuterRaceFault_vload_4.mat", "bearing_outer_race", 81.125),
    ],
)
def test_measured_bearings_end_in_their_race(file: str, name: str, hertz: float) -> None:
    report = diagnosed(read_recording(DATA / "bearing_races" / file, rig=RIG))
    assert (report.outcome, report.causes[0].name) == (GapOutcome.EFFECT, name)
    speed_hz = report.conditions[0].point.speed_rpm / 60.0
    assert report.places[0].orders[0] * speed_hz == pytest.approx(hertz, rel=0.02)


@pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")
def test_two_stages_without_teeth_lack_rig_data(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    shafts = tuple(Shaft(name) for name in ("input", "middle", "output"))
    pairs = (GearPair("first", "input", "middle"), GearPair("second", "middle", "output"))
    write_rig(Rig("two stages", shafts, pairs, sampling_rate_hz=4266.7), tmp_path / "rig.toml")
    file = DATA / "two_stage_gearbox" / "b30hz50.csv.gz"
    with pytest.raises(SystemExit) as stopped:
        main(["gap", str(file), "--rig", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "gap")])
    out, err = capsys.readouterr()
    assert (stopped.value.code, out) == (2, "")
    assert "2 gear pairs (first, second)" in err
    assert "--stage" in err
    assert not (tmp_path / "gap").exists()


def test_a_shaft_of_unknown_speed_may_be_what_knocks() -> None:
    """Without the gear pair the output shaft's order cannot be known: it is no impact that no shaft explains."""
    loose = replace(RIG, shafts=(*RIG.shafts, Shaft("output")))
    report = diagnosed(recording(0.617 * 4), rig=loose)
    assert report.outcome is GapOutcome.UNKNOWN
    assert "no shaft and no bearing of known speed explains, perhaps shaft output (" in report.places[0].title
    assert "it may turn with shaft output" in report.verdict[1]
    assert any("speed of shaft output" in notice for notice in report.notes)
    known = diagnosed(recording(0.617 * 4))
    assert "no shaft and no bearing explains (" in known.places[0].title
    assert "output" not in " ".join((*known.verdict, *known.notes))
