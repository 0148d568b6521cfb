"""The same jobs on a Dask cluster: a real scheduler and two worker processes on loopback, one of them killed midway."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

pytest.importorskip("distributed", reason="the extra cluster is not installed")

from distributed import Client

from app.bifurcation import BifurcationRequest, run_folder
from app.cli.main import main
from gearsig.batch import report_many
from gearsig.errors import InputError
from gearsig.fleet import open_fleet
from gearsig.processes import cluster, run_jobs
from sims.continuation import Branch
from sims.sweep import Axis, Sweep, run_sweep
from tests.fleet.recordings import PATTERN, write_recording_file
from tests.marks import further

ROOT = Path(__file__).parents[1]
SETTINGS = {
    "PYTHONPATH": str(ROOT),
    "OMP_NUM_THREADS": "1",
    "NUMBA_NUM_THREADS": "1",
    "DASK_DISTRIBUTED__LOGGING": "{}",
}


def start(module: str, *words: str) -> "subprocess.Popen[bytes]":
    command = [sys.executable, "-m", f"distributed.cli.{module}", *words, "--no-dashboard"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=os.environ | SETTINGS)


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[tuple[str, "list[subprocess.Popen[bytes]]"]]:
    """Address of a scheduler, and its two workers."""
    file = tmp_path / "scheduler.json"
    with ExitStack() as stack:

        def running(process: "subprocess.Popen[bytes]") -> "subprocess.Popen[bytes]":
            stack.callback(process.wait)
            stack.callback(process.kill)
            return process

        running(start("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(file)))
        limit = time.monotonic() + 60
        while not file.exists():
            assert time.monotonic() < limit
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        worker = ("dask_worker", address, "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny")
        workers = [running(start(*worker, "--local-directory", str(tmp_path / f"w{i}"))) for i in range(2)]
        with Client(address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)
        yield address, workers


def process_of(job: int) -> tuple[int, int]:
    return job, os.getpid()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_killed_worker_loses_nothing_and_doubles_nothing(scheduler, tmp_path):
    address, workers = scheduler
    rng = np.random.default_rng(0)
    for day in range(1, 13):
        write_recording_file(tmp_path / "data" / "pump" / f"DE_202601{day:02d}.csv", 1.0, rng)
    fleet = open_fleet(tmp_path / "store", create=True)

    def kill_one(n_done: int, _total: int, _result: object) -> None:
        if n_done >= 3:
            workers[0].kill()

    with cluster(address) as opened:
        assert opened.n_workers == 2
        result = fleet.add(
            tmp_path / "data", pattern=PATTERN, executor=opened.executor, n_processes=2, on_progress=kill_one
        )
        limit = time.monotonic() + 30
        while not opened.lost() and time.monotonic() < limit:
            time.sleep(0.1)
        assert len(opened.lost()) == 1
        assert "1 more was lost, and what it ran was run again" in opened.text()
        assert len(result.added) == 12
        assert not result.failures
        assert len(fleet.recordings()) == 12
        assert len(fleet.indicators(name="rms")) == 12
        report = report_many([tmp_path / "data"], tmp_path / "report", n_processes=2)  # the block's cluster runs it
        assert len(report.entries) == 12


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_jobs_of_a_block_run_on_its_cluster(scheduler):
    address, workers = scheduler
    with cluster(address):
        found = [result for _, result in run_jobs(process_of, [3, 4, 5], n_workers=1, if_killed=lambda job: (job, 0))]
        assert sorted(job for job, _ in found) == [3, 4, 5]
        assert {process for _, process in found} <= {worker.pid for worker in workers}


SPEEDS_RPM = (600.0, 700.0, 800.0, 900.0, 1000.0, 1100.0)


def sweep() -> Sweep:
    return Sweep(
        axes=(Axis("speed_rpm", SPEEDS_RPM),),
        common_seed=True,
        extension=".h5",
        model="cracked",
        preset="symmetric_50_50",
        parameters={},
        effects=(),
        speed_rpm=None,
        torque_nm=None,
        duration_s=0.2,
        sampling_rate_hz=20480.0,
        seed=0,
    )


def report_on(folder: Path, on_progress: Callable[..., object]) -> list[str]:
    rng = np.random.default_rng(0)
    for day in range(1, 7):
        write_recording_file(folder / "data" / f"DE_202601{day:02d}.csv", 1.0, rng)
    made = report_many([folder / "data"], folder / "report", n_processes=2, on_progress=on_progress)
    assert len({entry.page for entry in made.entries}) == len(made.entries)
    return [failure.reason for failure in made.failures] + [""] * len(made.entries)


def sweep_over(folder: Path, on_progress: Callable[..., object]) -> list[str]:
    return [outcome.reason for outcome in run_sweep(sweep(), folder / "sweep", on_progress=on_progress).outcomes]


def branches_over(folder: Path, on_progress: Callable[..., object]) -> list[str]:
    request = BifurcationRequest(Branch(sweep(), "transmission_error_m", "mesh", 20), "rest", 0.0, False)
    return [value.reason for value in run_folder(request, folder / "jump", on_progress=on_progress)["rest"]]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("work", [report_on, further(sweep_over), further(branches_over)])
def test_reports_sweeps_and_bifurcations_lose_a_worker_and_nothing_else(scheduler, tmp_path, work):
    address, workers = scheduler

    def kill_one(n_done: int, *_: object) -> None:
        if n_done >= 1:  # two may end between two reports; a process that is dead already stays so
            workers[0].kill()

    with cluster(address) as opened:
        assert work(tmp_path, kill_one) == [""] * 6
        limit = time.monotonic() + 30
        while not opened.lost() and time.monotonic() < limit:
            time.sleep(0.1)
        assert len(opened.lost()) == 1


@pytest.mark.study
@pytest.mark.filterwarnings("ignore")
def test_a_gap_study_loses_a_worker_and_nothing_else(scheduler, tmp_path, capsys):
    """Its trials run on the cluster; one of two workers is killed as soon as it has simulated for a second."""
    address, workers = scheduler
    samples = ROOT / "sample_data"

    def busy_s(process: "subprocess.Popen[bytes]") -> float:
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    at_rest_s = busy_s(workers[0])
    killed = []

    def kill_one() -> None:
        while not killed and busy_s(workers[0]) < at_rest_s + 1.0:
            time.sleep(0.05)
        os.kill(workers[0].pid, signal.SIGKILL)
        killed.append(workers[0].pid)

    thread = Thread(target=kill_one, daemon=True)
    thread.start()
    words = ["gap", str(samples / "root_crack_3mm.h5"), "--reference", str(samples / "root_crack_0mm.h5")]
    words += ["--cache", str(tmp_path / "cache"), "--cluster", address, "-o", str(tmp_path / "out")]
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert not ended.value.code
    assert killed
    assert "1 more was lost, and what it ran was run again" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "gap.json").read_text(encoding="utf-8"))
    assert max(found["causes"], key=lambda cause: cause["probability"])["name"] == "root_crack"
    assert "was killed" not in json.dumps(found)


@pytest.mark.slow
def test_what_is_no_scheduler_is_said():
    with pytest.raises(InputError, match="no Dask scheduler"), cluster("tcp://127.0.0.1:9"):
        pass
