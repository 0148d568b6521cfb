"""Watching a folder: half-copied files, restarts, two watches, failures that are mended."""

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli.main import app
from gearsig.fleet import WatchEvent, open_fleet, watch
from tests.fleet.recordings import PATTERN, write_recording_file


class Watching:
    """A watch in a thread, with its events."""

    def __init__(self, store: Path, folder: Path) -> None:
        self.events: list[WatchEvent] = []
        self.is_over = False
        self.thread = threading.Thread(target=self._run, args=(store, folder))
        self.thread.start()

    def _run(self, store: Path, folder: Path) -> None:
        with ThreadPoolExecutor(1) as executor:
            watch(
                open_fleet(store, create=True),
                [folder],
                on_event=self.events.append,
                interval_s=0.05,
                settle_s=0.4,
                executor=executor,
                n_processes=1,
                stop=lambda: self.is_over,
                pattern=PATTERN,
            )

    def wait_for(self, n_events: int) -> None:
        limit = time.monotonic() + 60
        while len(self.events) < n_events:
            assert self.thread.is_alive()
            assert time.monotonic() < limit
            time.sleep(0.02)

    def stop(self) -> None:
        self.is_over = True
        self.thread.join()


def test_a_file_that_grows_is_taken_once_it_stands_still(tmp_path):
    whole = tmp_path / "whole.csv"
    write_recording_file(whole, 1.0, np.random.default_rng(0))
    content = whole.read_bytes()
    target = tmp_path / "in" / "pump" / "DE_20260101.csv"
    watching = Watching(tmp_path / "store", tmp_path / "in")  # the folder is not there yet
    try:
        target.parent.mkdir(parents=True)
        for part in range(1, 9):
            target.write_bytes(content[: len(content) * part // 8])
            time.sleep(0.1)
        watching.wait_for(1)
    finally:
        watching.stop()
    assert [(event.kind, event.added.outcome) for event in watching.events] == [("added", "cannot tell")]
    assert open_fleet(tmp_path / "store").recordings()["duration_s"].tolist() == [pytest.approx(1.0)]


@pytest.mark.slow
def test_a_copy_that_stalled_fails_once_and_is_mended(tmp_path):
    target = tmp_path / "in" / "pump" / "DE_20260101.csv"
    target.parent.mkdir(parents=True)
    target.write_text("time (s),a1 (m/s^2)\n0,1\n")
    watching = Watching(tmp_path / "store", tmp_path / "in")
    try:
        watching.wait_for(1)
        time.sleep(0.5)
        assert len(watching.events) == 1
        write_recording_file(target, 1.0, np.random.default_rng(0))
        watching.wait_for(2)
    finally:
        watching.stop()
    assert [event.kind for event in watching.events] == ["failed", "added"]
    assert list(open_fleet(tmp_path / "store").recordings()["outcome"]) == ["cannot tell"]


@pytest.mark.slow
def test_two_watches_and_a_restart_take_each_recording_once(tmp_path):
    random = np.random.default_rng(0)
    for day in range(1, 9):
        write_recording_file(tmp_path / "in" / "pump" / f"DE_202601{day:02d}.csv", 1.0, random)
    both = [Watching(tmp_path / "store", tmp_path / "in") for _ in range(2)]
    try:
        limit = time.monotonic() + 60
        while sum(len(one.events) for one in both) < 8:
            assert time.monotonic() < limit
            time.sleep(0.05)
        time.sleep(0.5)
    finally:
        for one in both:
            one.stop()
    taken = [event.added.origin.path.name for one in both for event in one.events]
    assert len(taken) == len(set(taken)) == 8
    assert len(open_fleet(tmp_path / "store").recordings()) == 8
    third = Watching(tmp_path / "store", tmp_path / "in")
    time.sleep(1.0)
    third.stop()
    assert third.events == []


def test_files_that_the_pattern_leaves_out_are_said_once(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0])
    (data / "pump 1" / "DE_2026-02-01.csv").write_text("")
    watching = Watching(tmp_path / "store", data)
    try:
        watching.wait_for(2)
        (data / "pump 1" / "DE_20261301.csv").write_text("")
        watching.wait_for(3)
        time.sleep(0.2)
    finally:
        watching.stop()
    assert sorted(event.kind for event in watching.events) == ["added", "passed over", "passed over"]
    said = [event.as_dict() for event in watching.events if event.kind == "passed over"]
    assert "1 recording is passed over: pump 1/DE_2026-02-01.csv (does not match the pattern)" in said[0]["text"]
    assert [(Path(each["file"]).name, each["reason"]) for each in said[1]["excluded"]] == [
        ("DE_20261301.csv", "20261301 is no date in the form %Y%m%d")
    ]


def test_add_says_what_the_pattern_leaves_out(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0])
    (data / "pump 1" / "DE_2026-02-01.csv").write_text("")
    words = ["fleet", "add", str(data), "--store", str(tmp_path / "store"), "--pattern", PATTERN, "--jobs", "1"]
    for options in (["--dry-run"], ["--dry-run", "--json"], ["--json"], []):
        done = CliRunner().invoke(app, [*words, *options])
        assert "1 recording is passed over: pump 1/DE_2026-02-01.csv (does not match the pattern)" in done.stderr
        if "--json" in options:
            excluded = json.loads(done.stdout)["excluded"]
            assert [(Path(each["file"]).name, each["reason"]) for each in excluded] == [
                ("DE_2026-02-01.csv", "does not match the pattern")
            ]


@pytest.mark.slow
def test_commands_show_tables_and_json(make_recordings, tmp_path):
    data = make_recordings("pump 1", [1.0, 1.1])
    (data / "pump 1" / "DE_20260109.csv").write_text("no recording")
    run, store = CliRunner(), ["--store", str(tmp_path / "store")]
    shown = run.invoke(app, ["fleet", "add", str(data), *store, "--pattern", PATTERN, "--dry-run"])
    assert "2026-01-02 00:00 (pattern)" in shown.output
    assert not (tmp_path / "store").exists()
    added = run.invoke(app, ["fleet", "add", str(data), *store, "--pattern", PATTERN, "--jobs", "1", "--json"])
    assert added.exit_code == 1
    summary = json.loads(added.stdout)
    assert (summary["added"], len(summary["failures"])) == (2, 1)
    status = json.loads(run.invoke(app, ["fleet", "status", *store, "--json"]).stdout)
    assert [(row["machine"], row["n_recordings"], row["n_failed"]) for row in status] == [("pump 1", 2, 1)]
    trend = json.loads(run.invoke(app, ["fleet", "trend", "pump 1", "rms", *store, "--json"]).stdout)
    assert [row["date"][:10] for row in trend[0]["table"]] == ["2026-01-01", "2026-01-02"]
    assert "baseline not complete" in run.invoke(app, ["fleet", "status", *store]).stdout
    words = [
        "fleet",
        "watch",
        str(data),
        *store,
        "--pattern",
        PATTERN,
        "--once",
        "--settle",
        "0",
        "--json",
        "--jobs",
        "1",
    ]
    assert run.invoke(app, words).stdout == ""
    run.invoke(app, ["fleet", "add", str(data), *store, "--pattern", PATTERN, "--jobs", "1", "--torque", "40"])
    words = ["fleet", "trend", "pump 1", "rms", *store, "--over", "load"]
    over = json.loads(run.invoke(app, [*words, "--json"]).stdout)
    assert [(row["load_nm"], row["level"]) for row in over[0]["table"]] == [(40.0, "not judged")] * 2
    assert (over[0]["over"], over[0]["held"], over[0]["curve"]) == ("load", None, [])
    assert "No limits yet" in run.invoke(app, words).stdout
    assert run.invoke(app, [*words[:-1], "loud"]).exit_code != 0
