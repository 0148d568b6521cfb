"""Adding: once each, by any number of processes, whatever is killed or damaged."""

import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.fleet import (
    FilePattern,
    TrendSettings,
    date_in_name,
    excluded_text,
    find_recordings,
    open_fleet,
    origin_rows,
    origins,
)
from gearsig.rig import ConstantSpeed
from tests.fleet.recordings import PATTERN, write_recording_file


@pytest.mark.slow
def test_what_is_known_is_passed_over_by_content_and_place(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.1, 0.9])
    fleet = open_fleet(tmp_path / "store", create=True)
    assert len(fleet.add(data, pattern=PATTERN, n_processes=1).added) == 3
    again = fleet.add(data, pattern=PATTERN, n_processes=1)
    assert (len(again.added), again.n_known) == (0, 3)
    (data / "pump 1" / "DE_20260101.csv").touch()
    touched = fleet.add(data, pattern=PATTERN, n_processes=1)
    assert (len(touched.added), touched.n_known) == (0, 3)
    (data / "pump 1").rename(data / "pump 2")  # another machine, the same bytes
    moved = fleet.add(data, pattern=PATTERN, n_processes=1)
    assert len(moved.added) == 3
    assert sorted(set(fleet.recordings()["machine"])) == ["pump 1", "pump 2"]


def test_a_reference_is_a_file_that_is_there_or_a_run_in_it(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0])
    fleet = open_fleet(tmp_path / "store", create=True)
    for wrong in (data / "pump 1" / "no.csv", data):
        with pytest.raises(InputError, match=r"cannot be opened|is a folder"):
            fleet.add(data, reference=wrong, n_processes=1)
    runs = tmp_path / "runs.csv"
    table = np.column_stack([np.arange(2560) / 2560, np.random.default_rng(0).normal(size=(2560, 2))])
    np.savetxt(runs, table, delimiter=",", header="time (s),one (m/s^2),two (m/s^2)", comments="")
    for run in (1, 2, 2):
        added = fleet.add(data, pattern=PATTERN, reference=f"{runs}#{run}", n_processes=1)
        assert not added.failures
    assert (len(added.added), added.n_known) == (0, 1)
    assert len(set(fleet.recordings()["setup"])) == 1


def test_a_result_under_a_wrong_name_is_replaced(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.1])
    fleet = open_fleet(tmp_path / "store", create=True)
    wrong = fleet.add(data, machine="pmup", n_processes=1)
    right = fleet.add(data, pattern=PATTERN, n_processes=1)
    assert not any(added.replaced for added in wrong.added)
    assert all(added.replaced.startswith("pmup, ") for added in right.added)
    for _ in range(2):
        assert set(fleet.recordings()["machine"]) == {"pump 1"}
        assert set(fleet.indicators()["machine"]) == {"pump 1"}
        fleet.compact()


def test_tables_are_the_same_before_and_after_merging(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.1, 0.9])
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    before = [fleet.recordings(), fleet.indicators("pump 1", "DE", "rms")]
    fleet.compact()
    assert not list((tmp_path / "store" / "new").iterdir())
    after = [fleet.recordings(), fleet.indicators("pump 1", "DE", "rms")]
    assert all(a.equals(b) for a, b in zip(before, after, strict=True))
    make_recordings("pump 3", [1.0])
    fleet.add(data, pattern=PATTERN, n_processes=1)
    assert len(fleet.recordings()) == 4


@pytest.mark.slow
def test_indicators_are_those_of_the_analysis(make_recordings, tmp_path):
    from gearsig.diagnosis import analyze
    from gearsig.recording import read_recording

    data = make_recordings("pump 1", [1.0])
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    expected = {
        (i.name, i.computed_on): i.value
        for i in analyze(read_recording(data / "pump 1" / "DE_20260101.csv")).indicators
        if np.isfinite(i.value)
    }
    table = fleet.indicators()
    assert dict(zip(zip(table["name"], table["computed_on"], strict=True), table["value"], strict=True)) == expected


@pytest.mark.parametrize("merged", [False, True])
@pytest.mark.parametrize("damage", ["cut", "noise", "empty"])
def test_a_damaged_part_is_set_aside_and_analysed_again(make_recordings, tmp_path, merged, damage):
    data = make_recordings("pump 1", [1.0, 1.1, 0.9])
    messages: list[str] = []
    fleet = open_fleet(tmp_path / "store", create=True, on_message=messages.append)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    if merged:
        fleet.compact()
    victim = next((tmp_path / "store").glob("segments/*/indicators.parquet" if merged else "new/*.parquet"))
    content = victim.read_bytes()
    half = len(content) // 2
    victim.write_bytes({"cut": content[:half], "noise": b"\x5a" * len(content), "empty": b""}[damage])
    assert len(fleet.indicators(name="rms")) == (0 if merged else 2)
    assert len(messages) == 1
    assert "set aside" in messages[0]
    assert len(fleet.add(data, pattern=PATTERN, n_processes=1).added) == (3 if merged else 1)
    assert len(fleet.indicators(name="rms")) == 3
    assert len(messages) == 1


@pytest.mark.slow
def test_a_damaged_list_of_segments_loses_nothing(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.1])
    fleet = open_fleet(tmp_path / "store", create=True, on_message=[].append)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    fleet.compact()
    make_recordings("pump 3", [1.0])
    fleet.add(data, pattern=PATTERN, n_processes=1)
    fleet.compact()  # the first segment stays in the folder for those who still read it
    (tmp_path / "store" / "store.json").write_text("{")
    assert len(fleet.recordings()) == 3
    assert len(fleet.indicators(name="rms")) == 3


@pytest.mark.slow
def test_an_unreadable_recording_is_kept_as_a_failure_until_it_changes(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.0])
    victim = data / "pump 1" / "DE_20260102.csv"
    whole = victim.read_bytes()
    victim.write_bytes(b"time (s),a1\n0,1\n0.1,abc\n")
    fleet = open_fleet(tmp_path / "store", create=True)
    first = fleet.add(data, pattern=PATTERN, n_processes=1)
    assert [a.origin.path.name for a in first.failures] == ["DE_20260102.csv"]
    assert "abc" in first.failures[0].verdict
    assert victim.name not in first.failures[0].verdict  # whoever prints it names the file
    assert not fleet.add(data, pattern=PATTERN, n_processes=1).added
    assert list(fleet.status()["n_failed"]) == [1]
    victim.write_bytes(whole)
    assert not fleet.add(data, pattern=PATTERN, n_processes=1).failures
    assert list(fleet.status()["n_failed"]) == [0]


ADDING = """
import sys
from gearsig.fleet import open_fleet
from gearsig.rig import ConstantSpeed
from tests.fleet.recordings import PATTERN
if __name__ == "__main__":
    result = open_fleet(sys.argv[1], create=True).add(sys.argv[2], pattern=PATTERN, n_processes=int(sys.argv[3]))
    print(len(result.added))
"""


def _adding(store: Path, data: Path, n_processes: int = 1) -> "subprocess.Popen[str]":
    words = [sys.executable, "-c", ADDING, str(store), str(data), str(n_processes)]
    root = str(Path(__file__).parents[2])
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": root})


@pytest.mark.slow
def test_two_processes_share_a_folder_and_add_each_recording_once(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0 + 0.01 * i for i in range(16)])
    running = [_adding(tmp_path / "store", data) for _ in range(2)]
    counts = [int(process.communicate()[0]) for process in running]
    fleet = open_fleet(tmp_path / "store")
    assert len(fleet.recordings()) == 16
    assert len(fleet.indicators(name="rms")) == 16
    assert sum(counts) == 16


@pytest.mark.slow
def test_what_was_killed_goes_on_where_it_was(make_recordings, tmp_path):
    data, store = make_recordings("pump 1", [1.0 + 0.01 * i for i in range(24)]), tmp_path / "store"
    process = _adding(store, data)
    while len(list(store.glob("new/*.parquet"))) < 5 and process.poll() is None:
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    kept = len(open_fleet(store).recordings())
    assert kept >= 5
    result = open_fleet(store).add(data, pattern=PATTERN, n_processes=1)
    assert len(result.added) + kept == 24
    assert len(open_fleet(store).recordings()) == 24


def test_a_merge_that_is_killed_before_it_deletes_doubles_nothing(make_recordings, tmp_path):
    data, store = make_recordings("pump 1", [1.0, 1.1]), tmp_path / "store"
    fleet = open_fleet(store, create=True)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    parts = {path: path.read_bytes() for path in (store / "new").iterdir()}
    fleet.compact()
    for path, content in parts.items():
        path.write_bytes(content)
    assert len(fleet.recordings()) == 2
    assert len(fleet.indicators(name="rms")) == 2


@pytest.mark.slow
def test_a_store_that_many_make_at_once_is_made_for_each(tmp_path):
    for attempt in range(20):
        start = threading.Barrier(8)

        def make(store=tmp_path / str(attempt), start=start):
            start.wait()
            return open_fleet(store, create=True)

        with ThreadPoolExecutor(8) as pool:
            for made in [pool.submit(make) for _ in range(8)]:
                assert made.result().recordings().empty


def test_who_makes_a_store_forgets_nothing_that_another_added_meanwhile(make_recordings, tmp_path, monkeypatch):
    """The list of segments is written by another process between the look at the folder and the making of it."""
    data, store = make_recordings("pump 1", [1.0, 1.1]), tmp_path / "store"
    looked = Path.iterdir

    def look(folder):
        names = list(looked(folder))
        if folder == store and not names:
            monkeypatch.setattr(Path, "iterdir", looked)
            first = open_fleet(store, create=True)
            first.add(data, pattern=PATTERN, n_processes=1)
            first.compact()
        return names

    monkeypatch.setattr(Path, "iterdir", look)
    assert len(open_fleet(store, create=True).recordings()) == 2


def test_other_folders_are_not_taken_for_a_store(tmp_path):
    (tmp_path / "a.txt").write_text("mine")
    with pytest.raises(InputError, match="other files"):
        open_fleet(tmp_path, create=True)
    with pytest.raises(InputError, match="no fleet"):
        open_fleet(tmp_path / "absent")


@pytest.mark.parametrize(
    ("pattern", "path", "found"),
    [
        ("{machine}/{point}_{date:%Y%m%d}.csv", "/d/p 1/DE_20260131.csv", ("p 1", "DE", datetime(2026, 1, 31))),
        ("{machine}/**/{point}-{date:%d.%m.%y}*", "/d/m/x/y/NDE-03.02.26_a.h5", ("m", "NDE", datetime(2026, 2, 3))),
        ("{machine}_{}_{date:%Y%m%d}.csv", "/d/m_test_20260131.csv", ("m", None, datetime(2026, 1, 31))),
        (
            "{machine}/{date:%Y.%m.%d.%H.%M.%S}",
            "/d/m/2026.01.31.14.05.12",
            ("m", None, datetime(2026, 1, 31, 14, 5, 12)),
        ),
    ],
)
def test_patterns_name_machine_point_and_date(pattern, path, found):
    match = FilePattern(pattern).match(Path(path), Path("/d"))
    assert isinstance(match, dict)
    assert (match["machine"], match.get("point"), match["date"]) == found


def test_running_numbers_are_times_apart_and_names_that_are_dates_need_no_ending(tmp_path):
    for name in ("m/1.csv", "m/2.csv", "m/10.csv", "k/2026.01.31.14.05.12", "k/README", "k/2026.01.31.pdf"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1\n2\n")
    found = origins([tmp_path / "m"], pattern="{number:10min}.csv", date=datetime(2026, 1, 1))
    assert sorted((o.path.name, o.date) for o in found) == [
        ("1.csv", datetime(2026, 1, 1, 0, 10)),
        ("10.csv", datetime(2026, 1, 1, 1, 40)),
        ("2.csv", datetime(2026, 1, 1, 0, 20)),
    ]
    (named,) = origins([tmp_path / "k"])
    assert (named.date, named.date_from) == (datetime(2026, 1, 31, 14, 5, 12), "file name")


@pytest.mark.parametrize(
    "pattern",
    [
        *("{mashine}/x", "{date}.csv", "{date:%Q}", "{point}{point}", "{machine:%Y}", "{a"),
        *("{number}", "{number:0s}", "{number:10 apples}", "{number:1s}{date:%Y}"),
    ],
)
def test_what_is_no_pattern_is_refused(pattern):
    with pytest.raises(InputError):
        FilePattern(pattern)


def test_a_date_that_is_none_does_not_match():
    assert FilePattern("{date:%Y%m%d}.csv").match(Path("20260231.csv")).reason.startswith("20260231 is no date")
    assert date_in_name("x_20260231_y") is None


def test_what_a_pattern_leaves_out_is_said(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.1])
    for name in ("DE_2026-02-01.csv", "DE_20261301.csv"):
        (data / "pump 1" / name).write_text("")
    excluded = []
    assert len(origins([data], pattern=PATTERN, on_excluded=excluded.append)) == 2
    reasons = {each.path.name: each.reason for each in excluded}
    no_date = "20261301 is no date in the form %Y%m%d"
    assert reasons == {"DE_2026-02-01.csv": "does not match the pattern", "DE_20261301.csv": no_date}
    assert excluded_text(excluded * 2) == (
        "4 recordings are passed over: pump 1/DE_2026-02-01.csv (does not match the pattern); pump 1/DE_20261301.csv "
        f"({no_date}); pump 1/DE_2026-02-01.csv (does not match the pattern); and 1 more"
    )
    with pytest.raises(InputError, match=r"no recordings that match .*; 1 recording is passed over: pump 1/DE_2026"):
        origins([data / "pump 1" / "DE_20261301.csv"], pattern=PATTERN)
    added = open_fleet(tmp_path / "store", create=True).add(data, pattern=PATTERN, n_processes=1)
    assert (len(added.added), {each.path.name for each in added.excluded}) == (2, set(reasons))


def test_channels_that_bear_a_records_number_are_one_series(tmp_path):
    rng, folder = np.random.default_rng(0), tmp_path / "data" / "motor"
    for number, day in ((118, 1), (130, 2), (209, 3)):
        path = folder / f"DE_2026010{day}.csv"
        write_recording_file(path, 1.0, rng)
        path.write_text(path.read_text().replace("a1 (m/s^2)", f"X{number}_DE_time (m/s^2)", 1))
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(tmp_path / "data", pattern=PATTERN, n_processes=1)
    (trend,) = fleet.trend("motor", "rms", computed_on="raw")
    assert (trend.channel, len(trend.table)) == ("X_DE_time", 3)
    assert repr(trend) == "Trend 'rms' of motor DE X_DE_time: 3 recordings, no limits yet"


def test_what_is_counted_once_is_in_the_singular(make_recordings, tmp_path):
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(make_recordings("pump 1", [1.0]), pattern=PATTERN, n_processes=1)
    assert repr(fleet).endswith("store: 1 recording of 1 machine at 1 measuring point")
    assert "1 recording, no limits yet" in repr(fleet.trend("pump 1", "rms")[0])


@pytest.mark.parametrize("asked", ["RMS", "rsm"])
def test_a_misspelt_indicator_is_answered_with_the_closest(make_recordings, tmp_path, asked):
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(make_recordings("pump 1", [1.0]), pattern=PATTERN, n_processes=1)
    with pytest.raises(InputError, match=r"did you mean rms\?"):
        fleet.trend("pump 1", asked)
    with pytest.raises(InputError, match=r"no rms of channel 'a2' \(allowed: a1\)"):
        fleet.trend("pump 1", "rms", channel="a2")


def test_a_speed_in_the_name_is_shown_and_is_the_nominal_one(tmp_path):
    rng, folder = np.random.default_rng(0), tmp_path / "data" / "pump 1"
    for name in ("1500rpm_20260101.csv", "n1800_20260102.csv", "n900_20260103.csv", "20260104.csv"):
        write_recording_file(folder / name, 1.0, rng)
    (folder / "n900_20260103.toml").write_text('[speed]\nsource = "constant"\nspeed_rpm = 1200\n')
    found = [
        *origins([folder / "1500rpm_20260101.csv", folder / "20260104.csv"]),
        *origins([folder], pattern="n{speed}_{date:%Y%m%d}.csv"),
    ]
    expected = {"1500 rpm (file name)", "–", "1800 rpm (pattern)", "900 rpm (pattern)"}
    assert {row[4] for row in origin_rows(found)} == expected
    fleet = open_fleet(tmp_path / "store", create=True)
    assert not fleet.add(found, n_processes=1).failures
    table = fleet.recordings().sort_values("date")
    assert list(table["speed_rpm"].fillna(0)) == [1500, 1800, 900, 0]
    assert list(table["origin"].str.contains("speed: pattern")) == [False, True, True, False]
    assert fleet.add(found, n_processes=1).n_known == 4
    stated = [replace(each, speed_rpm=600.0, speed_from="stated") for each in found]
    fleet.add(stated, speed=ConstantSpeed(600.0), n_processes=1)
    assert set(fleet.recordings()["speed_rpm"]) == {600}


def test_without_a_pattern_folders_rigs_and_names_say_it(tmp_path):
    rng = np.random.default_rng(0)
    write_recording_file(tmp_path / "site" / "pump 7" / "gearbox" / "2026-03-01T0710.csv", 1.0, rng, 300)
    write_recording_file(tmp_path / "site" / "lone.csv", 1.0, rng, 300)
    (tmp_path / "site" / "lone.toml").write_text('name = "Mill"\n')
    os.utime(tmp_path / "site" / "lone.csv", (1_700_000_000, 1_700_000_000))
    found = {origin.path.name: origin for origin in origins([tmp_path / "site"])}
    deep, lone = found["2026-03-01T0710.csv"], found["lone.csv"]
    assert (deep.machine, deep.point, deep.date) == ("pump 7", "gearbox", datetime(2026, 3, 1, 7, 10))
    assert (deep.machine_from, deep.point_from, deep.date_from) == ("folder", "folder", "file name")
    assert (lone.machine, lone.machine_from, lone.date_from) == ("Mill", "rig file", "time of the file")
    assert lone.date == datetime(2023, 11, 14, 22, 13, 20)
    stated = origins([tmp_path / "site" / "lone.csv"], machine="A", date=datetime(2020, 1, 1))[0]
    assert (stated.machine, stated.date) == ("A", datetime(2020, 1, 1))


def test_settings_are_kept_and_checked(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0] * 3)
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    fleet.set(TrendSettings(n_baseline=9))
    fleet.set_baseline("pump 1", datetime(2026, 1, 1), datetime(2026, 1, 2))
    settings = fleet.settings
    assert (settings.n_baseline, settings.baselines[0].machine) == (9, "pump 1")
    with pytest.raises(InputError, match="pump 1"):
        fleet.set_baseline("pump 11", datetime(2026, 1, 1), datetime(2026, 1, 2))
    (tmp_path / "store" / "settings.toml").write_text("n_baseline = 2\n")
    with pytest.raises(InputError, match="n_baseline"):
        fleet.status()


def test_a_table_is_exported_in_each_form(make_recordings, tmp_path):
    import pandas as pd

    data, before = make_recordings("pump 1", [1.0, 1.2]), multiprocessing.active_children()
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(data, pattern=PATTERN, n_processes=1)
    n = fleet.export(tmp_path / "a.csv", name="rms")
    assert n == 2
    assert list(pd.read_csv(tmp_path / "a.csv")["name"]) == ["rms", "rms"]
    assert fleet.export(tmp_path / "r.parquet", "recordings", start=datetime(2026, 1, 2)) == 1
    assert list(pd.read_parquet(tmp_path / "r.parquet")["machine"]) == ["pump 1"]
    fleet.export(tmp_path / "s.jsonl", "status")
    assert json.loads((tmp_path / "s.jsonl").read_text())["machine"] == "pump 1"
    with pytest.raises(InputError, match="ending"):
        fleet.export(tmp_path / "a.xlsx")
    assert set(multiprocessing.active_children()) <= set(before)  # of other tests, some end late


def test_tables_of_reports_and_sweeps_are_no_recordings(tmp_path):
    for name in ("report/.results/a.json", "report/batch.csv", "grid/sweep.json", "grid/index.csv", "data/index.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    assert [path.relative_to(tmp_path).as_posix() for path, _ in find_recordings([tmp_path])] == ["data/index.csv"]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="timers that send signals are POSIX")
def test_a_query_that_is_interrupted_is_an_interruption(tmp_path):
    def query(connection):  # with one thread, DuckDB looks for signals; with more it may wait for the others first
        connection.execute("SET threads = 1")
        return connection.execute("SELECT sum(sqrt(range)) FROM range(5000000000)").fetchall()

    store = open_fleet(tmp_path, create=True)._store
    before = signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, 0.5, 2.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            store.read(query)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.slow
def test_a_store_that_cannot_be_written_is_read_all_the_same(make_recordings, tmp_path):
    data, store = make_recordings("pump 1", [1.0, 1.1]), tmp_path / "store"
    open_fleet(store, create=True).add(data, pattern=PATTERN, n_processes=1)
    expected = open_fleet(store).status(), open_fleet(store).series()
    (store / "trends.parquet").unlink()
    (store / "trends.parquet").mkdir()  # no file can take its place
    fleet = open_fleet(store)
    for _ in range(2):
        assert fleet.status().equals(expected[0])
        assert fleet.series().equals(expected[1])
    assert fleet.export(tmp_path / "x.csv", "trends") == len(expected[1])
    assert not list(store.glob(".*.part"))
    shutil.rmtree(store / "claims")
    (store / "claims").write_text("")
    make_recordings("pump 3", [1.0])
    with pytest.raises(InputError, match="cannot be written"):
        fleet.add(data, pattern=PATTERN, n_processes=1)


def test_small_files_that_cannot_be_merged_fail_no_addition(make_recordings, tmp_path, monkeypatch):
    messages: list[str] = []
    store = tmp_path / "store"
    fleet = open_fleet(store, create=True, on_message=messages.append)
    monkeypatch.setattr("gearsig.fleet._add.COMPACT_FROM", 1)
    (store / "segments").rmdir()
    (store / "segments").write_text("")
    assert len(fleet.add(make_recordings("pump 1", [1.0]), pattern=PATTERN, n_processes=1).added) == 1
    assert "not merged yet" in messages[0]
    assert len(fleet.recordings()) == 1


def test_a_doubled_small_file_that_cannot_be_deleted_counts_once(make_recordings, tmp_path, monkeypatch):
    store = tmp_path / "store"
    fleet = open_fleet(store, create=True)
    fleet.add(make_recordings("pump 1", [1.0, 1.1]), pattern=PATTERN, n_processes=1)
    shutil.copytree(store / "new", tmp_path / "new")
    fleet.compact()
    shutil.copytree(tmp_path / "new", store / "new", dirs_exist_ok=True)

    def refuse(path, **_):
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(Path, "unlink", refuse)
    for _ in range(2):
        assert len(fleet.recordings()) == 2


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no folder is known in which nobody can write")
@pytest.mark.parametrize("table", ["recordings", "indicators", "trends", "status"])
def test_a_table_is_not_exported_where_nothing_can_be_written(make_recordings, tmp_path, table):
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(make_recordings("pump 1", [1.0]), pattern=PATTERN, n_processes=1)
    with pytest.raises(InputError, match=r"x\.csv: cannot be written"):
        fleet.export("/proc/self/x.csv", table)


def test_a_full_disk_is_said_and_leaves_no_table(make_recordings, tmp_path):
    resource = pytest.importorskip("resource")
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(make_recordings("pump 1", [1.0]), pattern=PATTERN, n_processes=1)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60, before[1]))  # as if no more room were left
    try:
        with pytest.raises(InputError, match=r"x\.parquet: cannot be written \(\w[^\":]*\)"):
            fleet.export(tmp_path / "x.parquet", "recordings")
        assert len(fleet.status()) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not list(tmp_path.glob("*x.parquet*"))
