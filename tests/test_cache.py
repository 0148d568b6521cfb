"""Kept files: what comes back is what was written, or nothing, whatever became of the bytes."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from gearsig.cache import keep, part_beside, read_arrays, remove_parts
from gearsig.compiled import njit

ARRAYS = {"about": np.array('{"key": 1}'), "values": np.random.default_rng(0).normal(size=(12, 9))}
ENOUGH = 1_000_000


@pytest.mark.slow
@pytest.mark.parametrize("save", [np.savez_compressed, np.savez])
def test_no_damaged_byte_gets_through(tmp_path: Path, save: Callable[..., None]) -> None:
    path = tmp_path / "kept.npz"
    save(path, **ARRAYS)
    whole = path.read_bytes()
    for place in range(len(whole) - 1):
        path.write_bytes(whole[:place] + bytes(255 - byte for byte in whole[place : place + 2]) + whole[place + 2 :])
        found = read_arrays(path, ENOUGH)
        for name, values in (found or {}).items():  # dates and the like may be wrong
            np.testing.assert_array_equal(values, ARRAYS[name])


@pytest.mark.parametrize(
    "error", [MemoryError(), NotImplementedError("zip file version 8.8"), RuntimeError("encrypted")]
)
def test_whatever_its_reader_raises_is_damage(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    np.savez(tmp_path / "kept.npz", **ARRAYS)
    monkeypatch.setattr("gearsig.cache.np.load", fail)
    assert read_arrays(tmp_path / "kept.npz", ENOUGH) is None


def test_what_is_missing_or_too_large_is_not_read(tmp_path: Path) -> None:
    assert read_arrays(tmp_path / "kept.npz", ENOUGH) is None
    np.savez(tmp_path / "kept.npz", **ARRAYS)
    assert read_arrays(tmp_path / "kept.npz", 100) is None


def test_a_place_that_cannot_be_written_costs_no_result(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert not keep(tmp_path / "file" / "kept.npz", lambda file: file.write(b"x"))
    assert keep(tmp_path / "kept.npz", lambda file: file.write(b"x"))


def seven() -> int:
    return 7


def test_damaged_code_is_compiled_anew_and_a_full_disk_keeps_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("numba.config.CACHE_DIR", str(tmp_path / "kept"))

    def n_kept() -> int:
        compiled = njit(cache=True)(seven)
        assert compiled() == 7
        return sum(compiled.stats.cache_hits.values())

    assert (n_kept(), n_kept()) == (0, 1)
    index, code = sorted((tmp_path / "kept").rglob("*.nb[ci]"), reverse=True)
    for path in (index, code):
        whole = path.read_bytes()
        for damaged in (whole[:-9], bytes(len(whole)), b""):
            path.write_bytes(damaged)
            assert (n_kept(), n_kept()) == (0, 1)
    compiled = njit(cache=True)(seven)
    shutil.rmtree(index.parent)
    index.parent.touch()  # so that no folder can be made there any more
    assert compiled() == 7


def test_only_what_a_dead_process_left_is_removed(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    part_beside(tmp_path / ("🜨" * 60)).touch()  # 240 bytes; this process' own
    own = part_beside(tmp_path / "a[1].html")
    left, running = (own.with_name(own.name.replace(f"-{os.getpid()}-", f"-{n}-")) for n in (ended.pid, os.getppid()))
    elsewhere = own.with_name(f".a.h5.00000000-{ended.pid}-0f.part")
    for path in (own, running, elsewhere, tmp_path / "a[1].html"):
        path.touch()
    left.mkdir()
    (left / "a.h5").touch()
    remove_parts(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {running.name, elsewhere.name, "a[1].html"}


@pytest.mark.skipif(sys.platform == "win32", reason="every user of Windows has such a folder")
def test_where_nothing_can_be_kept_compiled_code_has_a_folder_until_the_end() -> None:
    words = "import os; os.access = lambda *_: False; import gearsig; x = os.environ['NUMBA_CACHE_DIR']; "
    code = f"{words}print(x if os.path.isdir(x) else '')"
    environment = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment)
    assert "gearsig-compiled-" in done.stdout
    assert not Path(done.stdout.strip()).exists()
