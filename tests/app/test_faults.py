"""Commands that are stopped, killed, doubled or out of disk: nothing half-written, no orphan, the same command goes on.

`GEARSIG_FAULTS=100 pytest -m slow tests/app/test_faults.py` interrupts each so often, at other moments with another
GEARSIG_FAULTS_SEED, and above one adds the diagnosis of a gap and the benchmark, of which one run takes half a minute.
Without that number nothing runs here: the least of it takes two minutes.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
import pytest

from gearsig.fleet import open_fleet
from tests.fleet.recordings import write_recording_file

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif("GEARSIG_FAULTS" not in os.environ, reason="on demand: GEARSIG_FAULTS=1"),
    pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="processes are looked for in Linux' /proc"),
]
N_FAULTS = int(os.environ.get("GEARSIG_FAULTS", "1"))
SEED = int(os.environ.get("GEARSIG_FAULTS_SEED", "1"))
ROOT = Path(__file__).parents[2]
N_RECORDINGS = 4
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
LONGEST_TIDYING_S = 30.0
COMMANDS = {
    "report": "report data -j 2 -o out",
    "fleet": "fleet add data --store out -j 2",
    "watch": "fleet watch data --once --interval 0.2 --settle 0 --store out -j 2",
    "sweep": "sweep cracked --vary speed=300..900rpm:4 --duration 0.3s -j 2 -o out",
    "bifurcation": "bifurcation cracked --preset symmetric_50_50 --torque 20Nm --vary speed=1600..2400rpm:2 "
    "--points 10 -j 2 -o out",
}
LONG = {
    "gap": f"gap {ROOT}/sample_data/root_crack_3mm.h5 --reference {ROOT}/sample_data/root_crack_0mm.h5 "
    "--cache kept -o out",
    "benchmark": "benchmark gap --cases 2 --diagnoser forest --longest 2 -o out",
}
if N_FAULTS > 1:
    COMMANDS |= LONG
RUN = """
import resource, signal, sys

signal.signal(signal.SIGINT, signal.default_int_handler)  # whoever runs the tests may ignore Ctrl-C
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), resource.RLIM_INFINITY))
from app.cli.main import main

main(sys.argv[2:])
"""
DEFINITIONS = {"sweep.json", "definition.json", "benchmark.json", "gap.json"}
"""Without them nobody knows what a folder's results are of: the command asks for another folder."""
OTHER_EACH_TIME = {".html", ".png", ".pdf"}
"""They name the folder, the day or the seconds that something took."""


@dataclass
class Place:
    """A folder with recordings in which a command runs, and the mark by which its processes are known."""

    folder: Path
    name: str

    def start(self, most_bytes: int = -1) -> "subprocess.Popen[str]":
        """Start the command; no file may become longer than so many bytes, as on a disk that is full."""
        words = [sys.executable, "-c", RUN, str(most_bytes), *COMMANDS[self.name].split()]
        environment = os.environ | {"PYTHONPATH": str(ROOT), "GEARSIG_FAULTS_PLACE": str(self.folder)}
        pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        return subprocess.Popen(words, cwd=self.folder, env=environment, text=True, start_new_session=True, **pipes)

    def processes(self) -> list[int]:
        """Return the processes of the command that run, also those whose parent is gone."""
        mark = f"GEARSIG_FAULTS_PLACE={self.folder}".encode()
        running = []
        for process in Path("/proc").iterdir():
            try:
                if process.name.isdigit() and mark in process.joinpath("environ").read_bytes().split(b"\0"):
                    running.append(int(process.name))
            except OSError:
                continue
        return running

    def finish(self) -> dict[str, object]:
        """Run the command to its end and return what it leaves."""
        process = self.start()
        said = process.communicate()[1]
        assert process.returncode == 0, said
        self.check_whole(tidied=True)
        return self.results()

    def interrupt(self, process: "subprocess.Popen[str]", after_s: float, what: signal.Signals) -> None:
        """Send a signal after a while: the command ends soon, with all its processes, and says so in a line."""
        try:
            said = process.communicate(timeout=after_s)[1]
        except subprocess.TimeoutExpired:
            process.send_signal(what)
            said = process.communicate(timeout=LONGEST_TIDYING_S)[1]
            if what == signal.SIGKILL:
                assert process.returncode == -what
            else:
                # Until the command's own handlers stand, Python's and the system's end it.
                assert process.returncode in (130, -what, 0, 1), said
                assert process.returncode != 1 or "KeyboardInterrupt" in said, said
        until = time.monotonic() + LONGEST_TIDYING_S
        while self.processes() and time.monotonic() < until:
            time.sleep(0.05)
        assert not self.processes()
        self.check_whole(tidied=what != signal.SIGKILL)

    def check_whole(self, *, tidied: bool) -> None:
        """Every file that stands under its own name can be read to its end."""
        for path in sorted(self.folder.joinpath("out").rglob("*")):
            if path.is_dir() or path.name == ".lock":
                continue
            if ".part" in path.suffixes or path.name.startswith("."):
                assert not tidied, path
                continue
            READERS.get(path.suffix, Path.read_bytes)(path)

    def results(self) -> dict[str, object]:
        out = self.folder / "out"
        if self.name in ("fleet", "watch"):
            table = open_fleet(out).indicators()
            columns = [name for name in ("machine", "point", "date", "name", "value") if name in table]
            ordered = table[columns].astype(str).sort_values(columns)
            return {"rows": ordered.to_numpy().tolist(), "recordings": len(open_fleet(out).recordings())}
        files = [path for path in sorted(out.rglob("*")) if path.is_file() and not path.name.startswith(".")]
        names = {str(path.relative_to(out)): b"" for path in files}
        same = {str(p.relative_to(out)): p.read_bytes() for p in files if self._is_the_same_each_time(p, out)}
        return names | same

    def _is_the_same_each_time(self, path: Path, out: Path) -> bool:
        hidden = any(part.startswith(".") for part in path.relative_to(out).parts)
        return self.name not in LONG and not hidden and path.suffix not in OTHER_EACH_TIME


def _read_html(path: Path) -> None:
    assert path.read_text(encoding="utf-8").rstrip().endswith("</html>"), path


def _read_hdf5(path: Path) -> None:
    with h5py.File(path) as file:
        file.visititems(lambda _, item: item[()] if isinstance(item, h5py.Dataset) else None)


def _read_arrays(path: Path) -> None:
    with np.load(path, allow_pickle=False) as data:
        assert [data[name] for name in data.files]


def _read_parquet(path: Path) -> None:
    import pyarrow.parquet

    pyarrow.parquet.read_table(path)


def _read_table(path: Path) -> None:
    assert path.read_bytes().endswith(b"\n"), path


READERS: dict[str, Callable[[Path], object]] = {
    ".html": _read_html,
    ".json": lambda path: json.loads(path.read_text(encoding="utf-8")),
    ".h5": _read_hdf5,
    ".npz": _read_arrays,
    ".parquet": _read_parquet,
    ".csv": _read_table,
}


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory) -> Callable[[str], tuple[dict[str, object], float]]:
    """Return what a command leaves that nothing disturbs, and the seconds that it took; each is run once."""
    known: dict[str, tuple[dict[str, object], float]] = {}

    def result(name: str) -> tuple[dict[str, object], float]:
        if name not in known:
            place = _place(tmp_path_factory.mktemp(name), name)
            start = time.monotonic()
            known[name] = place.finish(), time.monotonic() - start
        return known[name]

    return result


def _place(folder: Path, name: str) -> Place:
    for day in range(1, N_RECORDINGS + 1):
        write_recording_file(folder / "data/pump" / f"DE_2026010{day}.csv", 1.0 + 0.1 * day, np.random.default_rng(day))
    return Place(folder, name)


def _places(folder: Path, name: str) -> Iterator[Place]:
    """Yield a place for each ten interruptions asked for, and one at least."""
    for number in range((N_FAULTS + 9) // 10):
        yield _place(folder / str(number), name)


def _draw(name: str) -> np.random.Generator:
    return np.random.default_rng([SEED, list(COMMANDS).index(name)])


def some(*quick: str) -> Iterable[str]:
    """Return the commands of a test: all in a long run, and some that are started twice in seconds otherwise."""
    return COMMANDS if N_FAULTS > 1 else quick


@pytest.mark.parametrize("name", some("report", "sweep"))
def test_what_is_interrupted_goes_on(name, tmp_path, undisturbed):
    expected, duration_s = undisturbed(name)
    draw, n_left, n_round = _draw(name), N_FAULTS, 0
    while n_left > 0:
        place = _place(tmp_path / str(n_round), name)
        n_now = min(n_left, int(draw.integers(1, 5)))  # so often on end in one folder
        for _ in range(n_now):
            place.interrupt(place.start(), draw.uniform(0.1, 1.0) * duration_s, SIGNALS[draw.integers(3)])
        assert place.finish() == expected
        n_left, n_round = n_left - n_now, n_round + 1


@pytest.mark.parametrize("name", some("sweep"))
def test_two_share_a_folder_and_one_is_killed(name, tmp_path, undisturbed):
    expected, duration_s = undisturbed(name)
    draw = _draw(name)
    for place in _places(tmp_path, name):
        killed, other = place.start(), place.start()
        with suppress(subprocess.TimeoutExpired):
            said = killed.communicate(timeout=draw.uniform(0.3, 0.7) * duration_s)[1]
            assert "Traceback" not in said, said  # it may say that the other one runs, or be quicker than the first was
        killed.kill()
        killed.communicate()
        said = other.communicate()[1]
        assert "Traceback" not in said, said
        assert place.finish() == expected


@pytest.mark.parametrize("name", some("report"))
def test_a_full_disk_is_said_and_nothing_is_half_written(name, tmp_path, undisturbed):
    expected, _ = undisturbed(name)
    draw = _draw(name)
    for place in _places(tmp_path, name):
        process = place.start(most_bytes=int(10 ** draw.uniform(0.0, 5.3)))
        said = process.communicate()[1]
        assert process.returncode in (0, 1, 2), said
        assert "Traceback" not in said, said
        place.check_whole(tidied=True)
        assert place.finish() == expected


@pytest.mark.parametrize("name", some("bifurcation"))
def test_damaged_files_are_made_again(name, tmp_path, undisturbed):
    expected, _ = undisturbed(name)
    draw = _draw(name)
    for place in _places(tmp_path, name):
        place.finish()
        kept = [path for path in place.folder.rglob("*") if path.suffix in (".npz", ".parquet", ".json")]
        kept = [path for path in kept if path.name not in DEFINITIONS]
        for path in draw.permutation(sorted(kept))[:3]:
            content = bytearray(path.read_bytes())
            at = int(draw.integers(len(content)))
            content[at] ^= 0xFF
            path.write_bytes([content, content[:at], b""][draw.integers(3)])
        assert place.finish() == expected
