"""Many recordings: broken ones, killed workers, interruptions, other executors."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig import batch
from gearsig.batch import report_many
from gearsig.cache import part_beside
from gearsig.diagnosis import Outcome
from gearsig.errors import InputError
from gearsig.fleet import AnalysisOptions
from gearsig.report import Entry, Failure
from gearsig.rig import Rig, Shaft

RATE_HZ = 2048.0


@pytest.fixture
def recordings(tmp_path) -> list[Path]:
    rng = np.random.default_rng(3)
    paths = []
    for name in ("one", "two"):
        time_s = np.arange(2048) / RATE_HZ
        table = np.column_stack([time_s, np.sin(2 * np.pi * 200 * time_s) + 0.1 * rng.normal(size=2048)])
        paths.append(tmp_path / f"{name}.csv")
        np.savetxt(paths[-1], table, delimiter=",", header="time (s),a1 (m/s^2)", comments="", fmt="%.9f")
    return paths


@pytest.fixture
def broken(tmp_path) -> Path:
    path = tmp_path / "broken.csv"
    path.write_text("time (s),a1\n0,1\n0.1,<b>abc</b>\n")
    return path


def _page_for(job):
    """Stand in for the analysis: a page without figures."""
    job.page.write_text("page")
    return Entry(job.name, job.page.name, Outcome.NO_FAULT, "verdict")


def test_one_broken_file_does_not_stop_the_rest(recordings, broken, tmp_path):
    steps = []
    empty = tmp_path / "empty.csv"
    empty.touch()
    result = report_many(
        [recordings[0], broken, recordings[1], empty],
        tmp_path / "out",
        n_processes=1,
        on_progress=lambda *step: steps.append(step),
        command="gearsig report",
    )
    assert [entry.name for entry in result.entries] == ["one.csv", "two.csv"]
    assert [failure.name for failure in result.failures] == ["broken.csv", "empty.csv"]
    assert "abc" in result.failures[0].reason
    assert "\n" not in result.failures[0].reason
    assert [(done, total) for done, total, _ in steps] == [(1, 4), (2, 4), (3, 4), (4, 4)]
    html = result.index_path.read_text(encoding="utf-8")
    assert "empty.csv" in html
    assert "<b>abc" not in html
    made = {"one.html", "two.html", "index.html", "batch.csv", "batch.json", ".results"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == made


@pytest.mark.parametrize("wrong", ["absent", "absent.csv", "absent.mat#2", "no_recordings"])
def test_a_mistyped_path_is_refused_before_anything_is_written(recordings, tmp_path, wrong):
    (tmp_path / "no_recordings").mkdir()
    files = [tmp_path / wrong] if wrong == "no_recordings" else [recordings[0], tmp_path / wrong]
    message = (
        r"there are no recordings \(allowed: .*\.csv.*\.wav"
        if wrong == "no_recordings"
        else "cannot be read .*it was looked for in"
    )
    with pytest.raises(InputError, match=message):
        report_many(files, tmp_path / "out", n_processes=1)
    assert not (tmp_path / "out").exists()


def test_a_mistyped_reference_or_method_is_refused_before_anything_is_written(recordings, tmp_path):
    for wrong, message in (
        ({"reference": tmp_path / "on.csv"}, r"on\.csv: cannot be opened"),
        ({"reference": tmp_path}, "is a folder"),
        ({"methods": ["x"]}, "there is no method 'x'"),
    ):
        with pytest.raises(InputError, match=message):
            report_many(recordings, tmp_path / "out", n_processes=1, **wrong)
        assert not (tmp_path / "out").exists()


def test_a_condition_of_a_file_that_is_there_is_no_mistyped_path(recordings, tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "_report_one", _page_for)
    result = report_many([f"{recordings[0]}#2"], tmp_path / "out", n_processes=1)
    assert [entry.name for entry in result.entries] == ["one.csv#2"]


@pytest.mark.slow
def test_local_processes_give_the_same_as_one(recordings, broken, tmp_path):
    files = [*recordings, broken]
    alone = report_many(files, tmp_path / "a", n_processes=1)
    before = dict(os.environ)
    together = report_many(files, tmp_path / "b", n_processes=2)
    assert dict(os.environ) == before
    assert [e.verdict for e in together.entries] == [e.verdict for e in alone.entries]
    assert [repr(e.indicators) for e in together.entries] == [repr(e.indicators) for e in alone.entries]
    assert together.failures == alone.failures


def test_any_executor_does(recordings, tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "_report_one", _page_for)
    with ThreadPoolExecutor(2) as executor:
        result = report_many(recordings, tmp_path / "out", executor=executor)
    assert [entry.page for entry in result.entries] == ["one.html", "two.html"]


def test_each_machine_is_compared_with_its_own_reference(recordings, tmp_path, monkeypatch):
    one, two = recordings
    third = tmp_path / "three.csv"
    third.write_bytes(one.read_bytes())
    jobs = {}

    def seen(job):
        jobs[job.name] = job.options.reference, job.is_reference
        return _page_for(job)

    monkeypatch.setattr(batch, "_report_one", seen)
    report_many([*recordings, third], tmp_path / "a", n_processes=1, reference={two: one})
    assert jobs == {"one.csv": (None, True), "two.csv": (one, False), "three.csv": (None, False)}
    report_many([*recordings, third], tmp_path / "b", n_processes=1, reference=one)
    assert jobs == {"one.csv": (None, True), "two.csv": (one, False), "three.csv": (one, False)}


def test_the_reference_has_its_own_rate_on_its_page_and_beside_the_others(recordings, tmp_path, monkeypatch):
    rates = {}

    def page(job):
        rates[job.name] = job.options.sampling_rate_hz, job.options.reference_rate_hz
        return _page_for(job)

    monkeypatch.setattr(batch, "_report_one", page)
    one, _ = recordings
    stated = {"sampling_rate_hz": 12e3, "n_processes": 1}
    report_many(recordings, tmp_path / "a", reference=one, reference_rate_hz=48e3, **stated)
    assert rates == {"one.csv": (12e3, 48e3), "two.csv": (12e3, 48e3)}


def test_what_the_file_beside_a_recording_states_goes_before_options_for_many(tmp_path):
    """On the reference's own page as beside the others; a rate stated for the reference goes before both."""
    for seed, name in enumerate(("one", "two")):
        np.savetxt(tmp_path / f"{name}.csv", np.random.default_rng(seed).normal(size=2048), header="a1", comments="")
    one, two = tmp_path / "one.csv", tmp_path / "two.csv"
    one.with_suffix(".toml").write_text('sampling_rate_hz = 48e3\n[[sensor]]\nchannel = "a1"\nunit = "g"\n')
    options = AnalysisOptions(Rig(shafts=(Shaft("motor"),)), 12e3, reference=one)
    healthy = options.analyze(one).recording
    assert (healthy.sampling_rate_hz, healthy.channels[0].unit) == (48e3, "g")
    assert healthy.rig.shaft_names == ("motor",)
    compared = options.analyze(two)
    assert compared.recording.sampling_rate_hz == 12e3
    assert compared.reference.recording.sampling_rate_hz == 48e3
    assert replace(options, reference=None, reference_rate_hz=24e3).analyze(one).recording.sampling_rate_hz == 24e3


def test_unexpected_errors_ask_for_a_report(recordings, tmp_path, monkeypatch):
    def fail(*_, **__):
        raise ZeroDivisionError("by\nnothing")

    monkeypatch.setattr("gearsig.diagnosis.analyze_file", fail)
    result = report_many(recordings, tmp_path / "out", n_processes=1)
    assert result.failures[0] == Failure("one.csv", "unexpected error, please report: ZeroDivisionError: by nothing")


def test_files_of_one_name_are_told_apart(tmp_path, monkeypatch):
    monkeypatch.setattr(batch, "_report_one", _page_for)
    monkeypatch.chdir(tmp_path)
    for folder in (Path("a"), Path("b")):
        folder.mkdir()
        (folder / "run.csv").touch()
    result = report_many(["a/run.csv", "b/run.csv"], tmp_path / "out", n_processes=1)
    assert [entry.name for entry in result.entries] == [str(Path("a/run.csv")), str(Path("b/run.csv"))]
    assert [entry.page for entry in result.entries] == ["run.html", "run-2.html"]


def test_a_later_report_overwrites_no_page_of_another_recording(recordings, tmp_path):
    out, other = tmp_path / "out", tmp_path / "other" / "one.csv"
    other.parent.mkdir()
    other.write_bytes(recordings[1].read_bytes())
    report_many([recordings[0]], out, n_processes=1)
    first = (out / "one.html").read_bytes()
    assert [entry.page for entry in report_many([other], out, n_processes=1).entries] == ["one-2.html"]
    assert (out / "one.html").read_bytes() == first
    again = report_many([other, recordings[0]], out, n_processes=1)
    assert [entry.page for entry in again.entries] == ["one-2.html", "one.html"]


def test_runs_of_one_file_have_pages_of_their_own(tmp_path):
    from scipy.io import savemat

    rng, out = np.random.default_rng(3), tmp_path / "out"
    savemat(tmp_path / "runs.mat", {"runs": rng.normal(size=(4096, 3)), "fs": RATE_HZ})
    for run in (2, 3):
        made = report_many([tmp_path / f"runs.mat#{run}"], out, n_processes=1, sampling_rate_hz=RATE_HZ)
        assert [entry.page for entry in made.entries] == [f"runs_{run}.html"]
    both = [tmp_path / "runs.mat#3", tmp_path / "runs.mat#2"]
    assert report_many(both, out, n_processes=1, sampling_rate_hz=RATE_HZ).n_found == 2
    assert {path.name for path in out.glob("runs*.html")} == {"runs_2.html", "runs_3.html"}


def test_an_interruption_leaves_whole_pages_only(recordings, tmp_path, monkeypatch):
    def interrupted(job):
        if job.path.name == "two.csv":
            part_beside(job.page).write_text("half a pa")
            raise KeyboardInterrupt
        return _page_for(job)

    monkeypatch.setattr(batch, "_report_one", interrupted)
    with pytest.raises(KeyboardInterrupt):
        report_many(recordings, tmp_path / "out", n_processes=1)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"one.html", "index.html"}


WORK = """
import os, signal, time
from gearsig.cache import part_beside
from gearsig.diagnosis import Outcome
from gearsig.report import Entry

def work(job):
    if job.name == "killer.csv":
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGKILL)
    if job.name == "slow.csv":
        part_beside(job.page).write_text("half")
        time.sleep(60)
    job.page.write_text("page")
    return Entry(job.name, job.page.name, Outcome.NO_FAULT, "fine")
"""

SCRIPT = """
import pathlib, signal, sys
from gearsig import batch
from work_of_a_test import work

batch._report_one = work
signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may ignore Ctrl-C
counted = pathlib.Path(sys.argv[1] + ".counted")
result = batch.report_many(sys.argv[2:], sys.argv[1], n_processes=2, on_progress=lambda *_: counted.touch())
print([e.name for e in result.entries], [(f.name, f.reason) for f in result.failures])
"""


@pytest.fixture
def script(tmp_path) -> Path:
    path = tmp_path / "script.py"
    path.write_text(SCRIPT)
    (tmp_path / "work_of_a_test.py").write_text(WORK)  # processes know modules, not scripts
    for name in ("a", "b", "killer", "slow"):
        (tmp_path / f"{name}.csv").touch()
    return path


@pytest.mark.slow
def test_a_killed_worker_costs_only_its_own_file(script, tmp_path):
    command = [sys.executable, script, tmp_path / "out", *(tmp_path / f"{name}.csv" for name in ("a", "killer", "b"))]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    assert done.stdout.startswith("['a.csv', 'b.csv'] [('killer.csv', 'the process that analysed it was killed")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of process groups are POSIX")
def test_ctrl_c_ends_the_workers_and_tidies_up(script, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, script, out, tmp_path / "a.csv", tmp_path / "slow.csv"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as running:
        limit = time.monotonic() + 30
        while not (list(out.glob(".slow.html.*.part")) and (tmp_path / "out.counted").exists()):
            assert time.monotonic() < limit
            time.sleep(0.05)
        os.killpg(running.pid, signal.SIGINT)
        errors = running.communicate(timeout=20)[1]
    assert running.returncode != 0
    assert "KeyboardInterrupt" in errors
    assert {path.name for path in out.iterdir()} == {"a.html", "index.html"}
    assert "This report is not complete: 1 recording" in (out / "index.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("broken")
def test_pages_are_kept_until_recording_rig_or_options_change(recordings, tmp_path):
    folder = recordings[0].parent
    first = report_many([folder], tmp_path / "out", n_processes=1)
    page = tmp_path / "out" / "one.html"
    made = page.stat().st_mtime_ns
    again = report_many([folder / "*.csv"], tmp_path / "out", n_processes=1)
    assert (first.n_found, again.n_found, len(again.failures)) == (0, 2, 1)
    assert [(e.name, e.page, e.verdict) for e in again.entries] == [(e.name, e.page, e.verdict) for e in first.entries]
    assert page.stat().st_mtime_ns == made
    (folder / "two.toml").write_text('name = "Mill"\n')
    assert report_many([folder], tmp_path / "out", n_processes=1).n_found == 1
    assert report_many([folder], tmp_path / "out", n_processes=1, torque_nm=5.0).n_found == 0
    (tmp_path / "out" / ".results" / "one.json").write_text("{")
    page.unlink()
    assert report_many([folder], tmp_path / "out", n_processes=1, torque_nm=5.0).n_found == 1
    assert page.exists()


def test_the_index_of_an_earlier_report_does_not_outlive_the_start_of_another(recordings, tmp_path, monkeypatch):
    report_many(recordings[:1], tmp_path / "out", n_processes=1)

    def killed(_job):
        raise SystemExit  # as a process that is killed: nothing tidies up after it

    monkeypatch.setattr(batch, "_report_one", killed)
    monkeypatch.setattr("gearsig.report.write_index", _Once())
    with pytest.raises(SystemExit):
        report_many(recordings, tmp_path / "out", n_processes=1)
    text = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "1 recording is still to be analysed" in text
    assert "one.csv" in text


class _Once:
    """Write an index the first time only."""

    def __init__(self):
        from gearsig.report import write_index

        self.write, self.is_done = write_index, False

    def __call__(self, entries, path, **others):
        if not self.is_done:
            self.is_done = True
            return self.write(entries, path, **others)
        return path


@pytest.mark.parametrize(
    ("keywords", "message"),
    [({"paths": []}, "no recordings"), ({"n_processes": 0}, "n_processes is 0"), ({"output_folder": None}, "folder")],
)
def test_what_cannot_work_is_said_before_anything_runs(recordings, tmp_path, keywords, message):
    blocked = tmp_path / "file"
    blocked.write_text("")
    arguments = {"paths": recordings, "output_folder": tmp_path / "out"} | keywords
    if arguments["output_folder"] is None:
        arguments["output_folder"] = blocked / "out"
    with pytest.raises(InputError, match=message):
        report_many(**arguments)
    assert not (tmp_path / "out" / "one.html").exists()


def test_importing_the_batch_is_light():
    code = (
        "import sys, gearsig.batch; print([m for m in ('numpy', 'matplotlib', 'scipy', 'jinja2') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.slow
def test_drawing_never_loads_pyplot():
    code = (
        "import sys, io, numpy as np\n"
        "from gearsig.plot import time_figure\n"
        "from gearsig.recording import Channel, Recording\n"
        "time_figure(Recording(np.zeros((1, 9)), 1.0, (Channel('a'),))).savefig(io.BytesIO())\n"
        "print('matplotlib.pyplot' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
