"""A diagnosis in a process of its own: progress, result, refusal, crash, stop; nothing is left behind."""

import os
import time
from pathlib import Path

import pytest

from app.gap_job import Job, JobFailedError, private_folder
from app.samples import sample_folder
from gearsig.errors import RefusalError
from gearsig.gap import GapRequest
from tests.gap.example_report import effect_report
from tests.gap.stub_diagnosis import CHILD, OUTCOME, SECONDS, environment

ASKED = GapRequest((sample_folder() / "root_crack_3mm.h5",), (sample_folder() / "root_crack_0mm.h5",))
PATIENCE_S = 60


@pytest.fixture
def job(tmp_path, monkeypatch, request):
    """Start a stubbed job with the settings that the test names."""
    for name, value in environment(tmp_path, **getattr(request, "param", {})).items():
        monkeypatch.setenv(name, value.format(folder=tmp_path))
    found = Job(private_folder(), ASKED, "cracked", cache=None, command="gearsig gap")
    yield found
    found.close()
    assert not found.folder.exists()


def wait(until):
    for _ in range(10 * PATIENCE_S):
        if until():
            return
        time.sleep(0.1)
    pytest.fail("it takes too long")


def is_alive(pid):
    """Whether a process is at work; one that has ended and waits to be asked for is not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.slow
def test_the_result_is_the_report_and_its_files(job):
    wait(lambda: not job.is_running)
    assert job.report().verdict == effect_report().verdict
    assert job.result("gap.html").startswith(b"<!doctype html>")
    assert b"gearsig gap" in job.result("gap.html")
    assert job.result("twin.toml").startswith(b"[about]")
    assert job.progress[0] == "fitting effects"
    assert 0.5 < job.progress[1] <= 1.0


@pytest.mark.slow
def test_a_users_own_app_in_the_working_folder_breaks_nothing(tmp_path, monkeypatch):
    for name, value in environment(tmp_path).items():
        monkeypatch.setenv(name, value)
    (tmp_path / "work").mkdir()
    (tmp_path / "work" / "app.py").write_text("raise SystemExit(3)")
    monkeypatch.chdir(tmp_path / "work")
    job = Job(private_folder(), ASKED, "cracked", cache=None)
    try:
        wait(lambda: not job.is_running)
        assert job.report().verdict == effect_report().verdict
    finally:
        job.close()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks at processes where Linux shows them")
@pytest.mark.parametrize("job", [{SECONDS: "60", CHILD: "{folder}/child"}], indirect=True)
@pytest.mark.parametrize("way", ["stop", "parent gone"])
def test_it_and_what_it_started_end_together(job, tmp_path, way):
    child = tmp_path / "child"
    wait(lambda: child.exists() and child.read_text() and job.progress[1] > 0)
    pid = int(child.read_text())
    assert job.is_running
    assert is_alive(pid)
    if way == "stop":
        job.stop()
        assert job.was_stopped
    else:
        job._process.stdin.close()
    wait(lambda: not job.is_running and not is_alive(pid))
    with pytest.raises(JobFailedError):
        job.report()
    assert job.result("gap.html") is None


@pytest.mark.slow
@pytest.mark.parametrize("job", [{OUTCOME: "refusal"}], indirect=True)
def test_a_refusal_comes_over_as_it_is(job):
    wait(lambda: not job.is_running)
    with pytest.raises(RefusalError) as refused:
        job.report()
    assert (refused.value.reason, refused.value.remedy) == ("the rig <file> has no teeth", "give them in the rig file")


@pytest.mark.parametrize("job", [{OUTCOME: "crash"}], indirect=True)
def test_a_crash_is_said_with_its_last_words(job):
    wait(lambda: not job.is_running)
    with pytest.raises(JobFailedError, match="something nobody thought of"):
        job.report()


@pytest.mark.slow
@pytest.mark.parametrize("job", [{SECONDS: "60"}], indirect=True)
def test_a_killed_process_is_told(job):
    wait(lambda: job.progress[1] > 0)
    job._process.kill()
    wait(lambda: not job.is_running)
    with pytest.raises(JobFailedError, match="was killed"):
        job.report()


def test_the_folder_is_private():
    folder = private_folder()
    assert os.name != "posix" or folder.stat().st_mode & 0o077 == 0
    folder.rmdir()
