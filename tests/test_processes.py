"""Fresh processes from scripts as people write them, without a guard against being run again."""

import os
import re
import signal
import subprocess
import sys
import time
from concurrent.futures.process import BrokenProcessPool
from importlib.util import find_spec
from multiprocessing import get_all_start_methods
from pathlib import Path

import numpy as np
import pytest

from gearsig.processes import begin, call_apart, can_be_sent, one_pool, process_pool, run_jobs

SCRIPT = """
from gearsig.processes import can_be_sent, process_pool

class Own:
    pass

print("begins")
with process_pool(2) as pool:
    print(sum(pool.map(abs, (-1, -2))), can_be_sent(Own()), can_be_sent([1.0]))
print(__file__.endswith("script.py"))
"""


def test_a_script_without_a_guard_runs_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.split("\n")[:-1] == ["begins", "3 False True", "True"]
    assert done.stderr == ""


APART_IN_A_WORKER = """
import signal, sys, time
from contextlib import suppress
from functools import partial
from gearsig.processes import call_apart, process_pool

signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may ignore Ctrl-C
with suppress(KeyboardInterrupt), process_pool(1) as pool:
    print(pool.submit(partial(call_apart, abs, -2, longest_s=30.0)).result(), flush=True)
    time.sleep(float(sys.argv[1]))
print("ended")
"""


def test_a_worker_that_called_a_function_apart_ends(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(APART_IN_A_WORKER)
    command = [sys.executable, str(script), "0"]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.split() == ["2", "ended"]


@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a group of processes")
def test_a_worker_that_called_a_function_apart_ends_silently_on_ctrl_c(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(APART_IN_A_WORKER)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, str(script), "600"], start_new_session=True, **pipes) as running:
        assert running.stdout.readline() == "2\n"
        os.killpg(running.pid, signal.SIGINT)
        assert running.communicate(timeout=60) == ("ended\n", "")


DAEMONIC = """
import sys
from multiprocessing import get_context
from gearsig.recording import read_recording

def work(paths):
    for path in paths:
        print(len(read_recording(path).channels), flush=True)

if __name__ == "__main__":
    start, *paths = sys.argv[1:]
    work(paths)
    process = get_context(start).Process(target=work, args=(paths,), daemon=True)
    process.start()
    process.join()
    print("ended", process.exitcode)
"""


@pytest.mark.parametrize("start", get_all_start_methods())
def test_files_are_read_in_a_daemonic_process(tmp_path: Path, start: str) -> None:
    paths = [Path(__file__).parents[1] / "sample_data" / "root_crack_0mm.h5"]
    if find_spec("asammdf") is not None:
        from asammdf import MDF, Signal

        with MDF() as file:
            time_s = np.arange(100) / 1000.0
            file.append([Signal(np.sin(time_s), time_s, name="a", unit="g")])
            paths.append(Path(file.save(tmp_path / "x.mf4")))
    script = tmp_path / "script.py"
    script.write_text(DAEMONIC)
    done = subprocess.run(
        [sys.executable, str(script), start, *map(str, paths)], capture_output=True, text=True, check=True, timeout=120
    )
    assert done.stdout.split()[-2:] == ["ended", "0"], done.stderr
    assert len(done.stdout.split()) == 2 * len(paths) + 2
    assert done.stderr == ""


def test_what_cannot_be_pickled_cannot_be_sent() -> None:
    assert not can_be_sent(lambda: None)
    assert not can_be_sent(sys.stdout)
    assert can_be_sent({"a": Path("b")})


ENDLESS = """
import os, re, sys
from multiprocessing import get_context
from gearsig.processes import process_pool

def work():
    with process_pool(2) as pool:
        ids = list(pool.map(hash, (1, 2)))
        running = [pool.submit(re.match, "(a*)*b", "a" * 64) for _ in range(2)]  # compiled code that lets nobody in
        print(*pool._processes, flush=True)
        running[0].result()

if __name__ == "__main__":
    if sys.argv[1:] == ["daemonic"]:
        process = get_context("spawn").Process(target=work, daemon=True)
        process.start()
        sys.stdin.readline()
    else:
        work()
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked for in Linux' /proc")
@pytest.mark.parametrize("end", ["killed", "daemonic"])
def test_workers_end_with_their_parent(tmp_path: Path, end: str) -> None:
    """A parent that is killed; a daemonic one, which is terminated by its own parent as that ends."""
    script = tmp_path / "script.py"
    script.write_text(ENDLESS)
    with subprocess.Popen(
        [sys.executable, str(script), end], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        assert parent.stdout is not None
        workers = [Path(f"/proc/{number}") for number in parent.stdout.readline().split()]
        assert len(workers) == 2
        assert all(worker.exists() for worker in workers)
        if end == "killed":
            parent.kill()
        else:
            parent.communicate("\n", timeout=60)
            assert parent.returncode == 0
    for _ in range(100):
        if not any(_runs(worker) for worker in workers):
            break
        time.sleep(0.1)
    assert not any(_runs(worker) for worker in workers)


def _runs(process: Path) -> bool:
    try:
        return process.joinpath("stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _leave_a_pool(error: type[BaseException]) -> None:
    with process_pool(1) as pool:
        pool.submit(time.sleep, 600)
        pool.submit(abs, -1)
        time.sleep(0.5)
        raise error


@pytest.mark.parametrize("error", [KeyboardInterrupt, GeneratorExit])
def test_a_pool_that_is_left_early_waits_for_no_job(error: type[BaseException]) -> None:
    start = time.monotonic()
    with pytest.raises(error):
        _leave_a_pool(error)
    assert time.monotonic() - start < 300.0  # a job takes twice that


def test_what_is_called_apart_may_die_or_never_end() -> None:
    assert call_apart(abs, -2, longest_s=30.0) == 2
    with pytest.raises(BrokenProcessPool):
        call_apart(os._exit, 1, longest_s=30.0)
    with pytest.raises(BrokenProcessPool, match="no answer"):
        call_apart(time.sleep, 60, longest_s=0.02)
    if hasattr(signal, "setitimer"):  # elsewhere the time that passes counts
        assert call_apart(time.sleep, 0.3, longest_s=0.1) is None  # as long as a busy machine lets one wait
        with pytest.raises(BrokenProcessPool):
            call_apart(re.match, "(a*)*b", "a" * 64, longest_s=0.1)
    assert call_apart(abs, -3, longest_s=30.0) == 3


@pytest.mark.skipif(
    not Path("/proc/self").is_symlink(), reason="the system does not tell a process its number as a link"
)
def test_jobs_of_a_block_share_processes_and_one_that_is_killed_is_replaced() -> None:
    def numbers() -> set[object]:
        jobs = run_jobs(os.readlink, ["/proc/self"] * 3, n_workers=2, if_killed=str)
        return {number for _, number in jobs}

    assert begin(os.getpid)() == os.getpid()  # there is no pool: here, when its result is wanted
    with one_pool(2):
        seen = numbers()  # of one worker alone where it was quick enough to take all jobs
        with one_pool(2):
            seen |= numbers()
        started = begin(os.getpid)()
        assert started != os.getpid()
        seen.add(str(started))
        assert len(seen) <= 2
        assert [*run_jobs(os._exit, [1], n_workers=2, if_killed=lambda _job: None)] == [(0, None)]
        assert not seen & numbers()
