"""From recordings to alarms: raised, cleared, by zones, against a stated baseline, reported since last time."""

import shutil
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.fleet import Fleet, TrendSettings, counts_text, fleet_changes, last_report, mark_reported, open_fleet
from gearsig.report import write_fleet_page
from gearsig.rig import Bearing, ConstantSpeed, MachineSize, OperatingPoint, Rig, Sensor, Shaft
from tests.fleet.recordings import PATTERN, write_daily_recordings, write_recording_file

SAMPLES = Path(__file__).parents[2] / "sample_data"


@pytest.fixture(scope="module")
def analysed(tmp_path_factory) -> Path:
    """Recordings and store of a machine that stays as it is, and of one that is louder on two days."""
    folder = tmp_path_factory.mktemp("analysed")
    write_daily_recordings(folder / "data", "calm", [1.0] * 12)
    write_daily_recordings(folder / "data", "loud", [1.0] * 8 + [4.0] * 2 + [1.0] * 4)
    opened = open_fleet(folder / "store", create=True)
    opened.set(TrendSettings(n_baseline=8))
    opened.add(folder / "data", pattern=PATTERN, n_processes=1)
    return folder


@pytest.fixture
def fleet(analysed, tmp_path) -> Fleet:
    """Of its own for each test."""
    shutil.copytree(analysed, tmp_path, dirs_exist_ok=True)
    return open_fleet(tmp_path / "store")


def test_a_fault_stays_until_a_recording_shows_that_it_is_gone(tmp_path):
    """What is recorded without a rig tells nothing; a sound machine on the third day does."""
    data, rng = tmp_path / "data" / "pump", np.random.default_rng(0)
    data.mkdir(parents=True)

    def record_sample(name: str, day: str) -> None:
        for file in SAMPLES.glob(f"{name}.*"):
            shutil.copy(file, data / f"DE_{day}{file.name.removeprefix(name)}")

    fleet = open_fleet(tmp_path / "store", create=True)
    record_sample("damaged_tooth", "20260101")
    fleet.add(data.parent, pattern=f"{PATTERN}.gz", n_processes=1)
    write_recording_file(data / "DE_20260102.csv", 1.0, rng)
    fleet.add(data.parent, pattern=PATTERN, n_processes=1)
    status = fleet.status()
    assert (status["outcome"][0], status["level"][0], status["n_recordings"][0]) == ("fault", "alarm", 2)
    assert [d.now for d in fleet_changes(fleet).diagnoses] == ["fault"]
    record_sample("no_tachometer", "20260103")
    fleet.add(data.parent, pattern=PATTERN, n_processes=1)
    assert fleet.status()["outcome"][0] == "no fault"


@pytest.mark.slow
def test_an_alarm_is_raised_and_cleared(fleet):
    trend = fleet.trend("loud", "rms")[0]
    levels = list(trend.table["level"])
    assert levels == ["ok"] * 8 + ["warning"] * 4 + ["ok"] * 2
    assert list(trend.table["in_baseline"]) == [True] * 8 + [False] * 6
    assert trend.changed == datetime(2026, 1, 9)
    assert trend.basis == "statistical"
    assert trend.table["expected"].iloc[-1] == pytest.approx(np.exp(np.log(trend.table["value"][:8]).mean()))
    assert set(fleet.trend("calm", "rms")[0].table["level"]) == {"ok"}


@pytest.mark.slow
def test_status_has_the_worst_first(fleet, make_recordings, tmp_path):
    data = make_recordings("broken", [1.0] * 8 + [30.0])
    fleet.add(data, pattern=PATTERN, n_processes=1)
    status = fleet.status()
    assert list(status["machine"]) == ["broken", "calm", "loud"]
    assert list(status["level"]) == ["alarm", "ok", "ok"]
    assert list(status["n_recordings"]) == [9, 12, 14]
    worst = fleet.series("broken").iloc[0]
    assert (status["worst"][0], status["worst_place"][0]) == (worst["name"], worst["place"])
    assert worst["change"] == pytest.approx(20 * np.log10(30), abs=1.0)
    again = open_fleet(tmp_path / "store").status()
    assert again.equals(status)
    (tmp_path / "store" / "trends.parquet").write_bytes(b"damaged")
    assert fleet.status().equals(status)


def test_a_point_of_which_nothing_can_be_said_is_not_ok(make_recordings, tmp_path):
    """Two recordings are no baseline, and without a rig nothing is found or ruled out in either."""
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(make_recordings("new", [1.0, 1.0]), pattern=PATTERN, n_processes=1)
    status = fleet.status()
    assert list(status["outcome"]) == ["cannot tell"]
    assert list(status["level"]) == ["unknown"]
    assert counts_text(status) == "1 measuring point: 1 unknown"


@pytest.mark.slow
def test_a_stated_baseline_replaces_the_first_recordings(fleet):
    fleet.set_baseline("loud", datetime(2026, 1, 9), datetime(2026, 1, 13))
    trend = fleet.trend("loud", "rms")[0]
    assert list(trend.table["in_baseline"]) == [False] * 8 + [True] * 5 + [False]
    assert "none" in {t.basis for t in fleet.trend("loud", "rms")}  # five recordings are too few for a limit
    with pytest.raises(InputError, match="rsm"):
        fleet.trend("loud", "rsm")


@pytest.mark.slow
def test_zones_of_the_standard_apply_where_the_rig_says_the_machines_size(make_recordings, tmp_path):
    """90 Hz of 1.4 m/s² rms is 2.5 mm/s: zone B of group 2 on a rigid foundation; more are C and D."""
    data = make_recordings("fan", [2.0, 3.0, 8.0, 2.0])
    rig = Rig(
        name="fan",
        shafts=(Shaft("shaft"),),
        operating_point=OperatingPoint("shaft", 1500.0),
        sensors=(Sensor("a1", "acceleration", "m/s^2"),),
        machine=MachineSize(55.0, None, "rigid"),
    )
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(data, pattern=PATTERN, rig=rig, n_processes=1)
    trend = fleet.trend("fan", "overall velocity")[0]
    assert trend.basis == "ISO 20816-3"
    assert list(trend.table["level"]) == ["ok", "warning", "alarm", "alarm"]
    assert (trend.table["high"].iloc[0], trend.table["alarm"].iloc[0]) == (2.8, 4.5)


@pytest.mark.slow
def test_changes_are_those_since_the_last_report(fleet, make_recordings, tmp_path):
    first = fleet_changes(fleet)
    assert (first.n_new, {c.machine for c in first.raised}) == (26, {"loud"})
    assert all(c.cleared == datetime(2026, 1, 13) for c in first.raised if c.name == "rms")
    assert last_report(fleet) is None
    mark_reported(fleet)
    since = last_report(fleet)
    assert fleet_changes(fleet, since).n_new == 0
    data = make_recordings("calm", [9.0], first=datetime(2026, 2, 1))
    (data / "calm" / "DE_20260202.csv").write_text("<b>nothing</b>")
    fleet.add(data, pattern=PATTERN, n_processes=1)
    changes = fleet_changes(fleet, since)
    assert (changes.n_new, changes.n_failed) == (2, 1)
    assert {c.machine for c in changes.raised} == {"calm"}
    page = write_fleet_page(fleet, tmp_path / "fleet.html", since).read_text(encoding="utf-8")
    assert "<b>nothing" not in page
    assert page.count('class="drawing"') == 1
    pytest.importorskip("typst", reason="the extra pdf is not installed")
    write_fleet_page(fleet, tmp_path / "fleet.html", since, pdf=True)
    assert (tmp_path / "fleet.pdf").read_bytes().startswith(b"%PDF")


def test_limits_are_closer_where_speed_is_accounted_for():
    """Of levels that follow the speed squared."""
    from gearsig.fleet import prediction_limits, regressors

    random = np.random.default_rng(0)
    speed = np.concatenate([random.uniform(1000, 1400, 20), [1390.0]])
    y = (40 * np.log10(speed) + 0.2 * random.normal(size=21))[:, None]
    baseline = np.arange(21) < 20
    x, _, _ = regressors(speed, np.full(21, np.nan), baseline)
    expected, reach = prediction_limits(y, x, baseline, 1e-3)
    _, without = prediction_limits(y, np.ones((21, 1)), baseline, 1e-3)
    assert abs(y[-1] - expected[-1]) < reach[-1] < 0.3 * without[-1]


def test_ratios_in_decibels_are_judged_as_they_are(make_recordings, tmp_path):
    bearing = Bearing("DE", "shaft", bpfo_order=3.58, bpfi_order=5.42, bsf_order=2.36, ftf_order=0.4)
    rig = Rig(shafts=(Shaft("shaft"),), bearings=(bearing,), speed=ConstantSpeed(2400.0, "shaft"))
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.set(TrendSettings(n_baseline=7))
    fleet.add(make_recordings("fan", [1.0] * 10), pattern=PATTERN, rig=rig, n_processes=1)
    ratios = fleet.series("fan").query("unit == 'dB'")
    assert len(ratios) > 5
    assert ratios["in_db"].all()
    assert (ratios["upper_limit"] - ratios["expected"]).between(6.0, 60.0).all()
    assert (ratios["change"] - (ratios["value"] - ratios["expected"])).abs().max() < 1e-9
    assert not ratios["level"].any()


def test_machines_are_named_in_quotes_as_names_may_hold_commas(fleet):
    with pytest.raises(InputError, match=r"allowed: 'calm', 'loud'"):
        fleet.point_trends("absent")


def loaded(fleet: Fleet, data, machine: str, loads: list[float], **more) -> None:
    for path, load in zip(sorted((data / machine).iterdir()), loads, strict=True):
        fleet.add(path, pattern=PATTERN, torque_nm=load, n_processes=1, **more)


@pytest.mark.slow
def test_over_load_the_limits_follow_the_baselines_dependence(make_recordings, tmp_path):
    """A level that grows with the load is no change; half as loud at full load as it was is none over time alone."""
    loads = [20.0, 40.0, 60.0, 80.0, 100.0, 30.0, 50.0, 70.0, 90.0, 25.0, 95.0, 100.0, 200.0]
    levels = [load / 50 for load in loads[:10]] + [0.5, 20.0, 4.0]
    levels[11] *= 2.0
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.set(TrendSettings(n_baseline=10))
    loaded(fleet, make_recordings("mill", levels), "mill", loads)
    shown = fleet.trend_over("load", "mill", "rms")[0]
    table, curve = shown.table, shown.curve
    assert list(table["load_nm"]) == sorted(loads)
    levels_by_date = list(table.sort_values("date")["level"])
    assert levels_by_date == ["baseline"] * 10 + ["warning", "alarm", "not judged"]
    assert shown.follows
    at = np.geomspace(20, 100, 9)
    rms = np.hypot(np.sqrt(0.5), 0.3) * at / 50  # of a sine with noise, as loud as the load
    assert np.interp(at, curve["load_nm"], curve["expected"]) == pytest.approx(rms, rel=0.05)
    assert (curve["load_nm"].iloc[0], curve["load_nm"].iloc[-1]) == pytest.approx((16.0, 125.0))
    judged = table[table["level"].isin(["warning", "alarm"])]
    over_time = fleet.trend("mill", "rms")[0].table.set_index("date").loc[judged["date"]]
    assert judged["high"].to_numpy() == pytest.approx(over_time["high"].to_numpy())
    assert f"one of {1 / shown.trend.false_alarm_rate:.0f} recordings" in shown.text
    assert shown.trend.text.startswith("Limits from the 10 recordings of the baseline.")
    assert f"one of {1 / shown.trend.false_alarm_rate:.0f} recordings" in shown.trend.text
    assert shown.trend.text.endswith("The expected value depends on load.")
    with pytest.raises(InputError, match="no recording states its speed"):
        fleet.trend_over("speed", "mill", "rms")


@pytest.mark.slow
def test_over_speed_values_are_moved_along_their_dependence_on_load(make_recordings, tmp_path):
    """Level = (speed/1500)² · load/50: at any load the same curve over speed."""
    rng = np.random.default_rng(7)
    speeds, loads = rng.uniform(900.0, 1800.0, 13), rng.uniform(30.0, 90.0, 13)
    data = make_recordings("mill", [(n / 1500) ** 2 * load / 50 for n, load in zip(speeds, loads, strict=True)])
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.set(TrendSettings(n_baseline=12))
    for path, speed, load in zip(sorted((data / "mill").iterdir()), speeds, loads, strict=True):
        fleet.add(path, pattern=PATTERN, torque_nm=load, speed=ConstantSpeed(float(speed)), n_processes=1)
    shown = fleet.trend_over("speed", "mill", "rms", computed_on="raw")[0]
    assert shown.held == pytest.approx(np.exp(np.log(loads[:12]).mean()))
    table = shown.table
    ratio = table["adjusted"] / (np.hypot(np.sqrt(0.5), 0.3) * (table["speed_rpm"] / 1500) ** 2 * shown.held / 50)
    assert ratio.to_numpy() == pytest.approx(1.0, rel=0.06)
    assert np.ptp(np.log(table["value"] / table["adjusted"])) > 0.5
    assert set(table["level"]) == {"baseline", "ok"}
