"""Memory that is free: of the system, and what a container's control groups (versions 1 and 2) still allow."""

from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import check_memory, container_free_bytes
from sims import fe_gear
from sims.fe_gear import mesh_size_for
from tests.sims.fe_gear.fe_gears import PAPER

V1 = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
V2 = ("memory.max", "memory.current", "inactive_file")


def group(folder: Path, names: tuple[str, str, str], limit: float | str, taken: float, cached: float) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / names[0]).write_text(f"{limit}\n")
    (folder / names[1]).write_text(f"{taken:.0f}\n")
    (folder / "memory.stat").write_text(f"anon 5\n{names[2]} {cached:.0f}\n")


def own(folder: Path, text: str) -> Path:
    (folder / "own").write_text(text)
    return folder / "own"


def test_without_limits_only_the_system_counts(tmp_path: Path) -> None:
    assert container_free_bytes(tmp_path / "missing", tmp_path) is None
    group(tmp_path / "a", V2, "max", 1e9, 0.0)
    assert container_free_bytes(own(tmp_path, "0::/a\n"), tmp_path) == np.inf
    assert container_free_bytes(own(tmp_path, "3:cpu:/a\nnonsense\n"), tmp_path) is None


def test_a_limit_of_any_group_above_counts_and_cached_files_make_way(tmp_path: Path) -> None:
    group(tmp_path / "outer", V2, 3_000_000_000, 2.5e9, 0.4e9)
    group(tmp_path / "outer" / "inner", V2, "max", 1e9, 0.0)
    assert container_free_bytes(own(tmp_path, "0::/outer/inner\n"), tmp_path) == pytest.approx(0.9e9)


@pytest.mark.parametrize("path", ["/docker/0123abc", "/"])
def test_version_1_with_its_limit_at_the_root_of_what_is_seen(tmp_path: Path, path: str) -> None:
    group(tmp_path / "memory", V1, 2_000_000_000, 1.7e9, 0.2e9)
    lines = f"12:cpu,cpuacct:{path}\n4:memory:{path}\n"
    assert container_free_bytes(own(tmp_path, lines), tmp_path) == pytest.approx(0.5e9)


def test_a_reduction_that_the_container_cannot_hold_is_refused(tmp_path: Path) -> None:
    group(tmp_path, V2, 400_000_000, 0.3e9, 0.0)
    needed = fe_gear.sector_bytes(PAPER, mesh_size_for(PAPER, 947_000))
    with pytest.raises(InputError, match=r"mesh: takes about 0\.\d+ GB of memory \(allowed: up to 0\.09 GB"):
        fe_gear.check_memory(needed, container_free_bytes(own(tmp_path, "0::/\n"), tmp_path))


def test_a_file_that_the_container_cannot_hold_is_refused_before_it_is_decoded(tmp_path: Path) -> None:
    group(tmp_path, V2, 400_000_000, 0.3e9, 0.0)
    allowed = container_free_bytes(own(tmp_path, "0::/\n"), tmp_path)
    check_memory(40_000_000, "small.csv", allowed)
    with pytest.raises(InputError, match=r"takes about 0\.2 GB"):
        check_memory(200_000_000, "large.csv", allowed)
