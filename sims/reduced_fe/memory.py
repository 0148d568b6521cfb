"""Memory that a computation will need, estimated before it starts."""

from __future__ import annotations

import os
from pathlib import Path

from gearsig.errors import InputError
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.mesh_size import MeshSize, n_dof_of

BASE_BYTES = 250e6
"""Interpreter and libraries."""

CGROUPS = Path("/sys/fs/cgroup")
"""Where Linux shows the limits of containers."""

MOST_PART = 0.9
"""Of the free memory that may be taken."""


def sector_bytes(blank: GearBlank, size: MeshSize) -> float:
    """Peak of a cyclic reduction: matrices and factors of one sector, which fill about as n^1.4.

    Measured, whole gear of 50 teeth: 0.29 GB at 300 000 and 0.36 GB at 510 000 degrees of freedom.
    """
    n = n_dof_of(blank, size) / blank.n_teeth
    return float(BASE_BYTES + 16.0 * (900.0 * n + 14.0 * n**1.4))


def craig_bampton_bytes(blank: GearBlank, size: MeshSize, n_compared: int) -> float:
    """Peak of a Craig–Bampton reduction, where the auxiliary nodes are chosen among all: about 13 fields of each mode.

    Measured: 0.89 GB at 300 000 degrees of freedom and 20 modes.
    """
    return sector_bytes(blank, size) + 13.0 * 8.0 * n_compared * n_dof_of(blank, size)


def full_bytes(n_dof: int) -> float:
    """Peak of a direct solution of the whole gear: matrices and factors, which fill about as n^1.25.

    Measured: 0.35 GB at 31 500 and 0.85 GB at 72 000 degrees of freedom.
    """
    return float(BASE_BYTES + 12.0 * (150.0 * n_dof + 38.0 * n_dof**1.25))


def check_memory(needed_bytes: float, free_bytes: float | None = None) -> None:
    """Refuse a computation that will not fit.

    Parameters
    ----------
    needed_bytes : float
    free_bytes : float or None
        None: what the system has free now; where it cannot tell, nothing is refused.

    Raises
    ------
    InputError
        With both numbers.
    """
    free = free_memory_bytes() if free_bytes is None else free_bytes
    if free is not None and needed_bytes > MOST_PART * free:
        raise InputError(
            f"about {needed_bytes / 1e9:.2g} GB of memory are needed, {free / 1e9:.2g} GB are free",
            allowed=f"at most {MOST_PART:.0%} of the free memory",
            remedy="take a coarser mesh, or close other programs",
        )


def free_memory_bytes() -> float | None:
    """Memory that programs can still take, of the system and of a container; None where neither tells."""
    found = [free for free in (_system_free_bytes(), container_free_bytes()) if free is not None]
    return min(found, default=None)


def container_free_bytes(own: Path = Path("/proc/self/cgroup"), mount: Path = CGROUPS) -> float | None:
    """What the control groups of this program, from its own up to the outermost, still allow; None without a limit.

    What is taken counts without cached files, which make way.

    Parameters
    ----------
    own : Path
        Lines "id:controllers:path": version 2 has none between its colons, version 1 has "memory".
    mount : Path
        Where the groups are shown; those of version 1 in a folder "memory".
    """
    found: list[float | None] = []
    try:
        lines = own.read_text(encoding="utf-8").splitlines()
    except OSError:
        return None
    for line in lines:
        _, _, rest = line.partition(":")
        controllers, _, path = rest.partition(":")
        if not controllers:
            root, names = mount, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            root, names = mount / "memory", ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        inner = root / path.strip("/")
        # A container may see its own group as the root, whatever its path is called outside.
        groups = (inner, *(parent for parent in inner.parents if parent == root or root in parent.parents))
        found += [_group_free_bytes(group, *names) for group in groups]
    return min((free for free in found if free is not None), default=None)


def _group_free_bytes(group: Path, limit_name: str, taken_name: str, cached_name: str) -> float | None:
    try:
        limit = float((group / limit_name).read_text(encoding="ascii").replace("max", "inf"))
        taken = float((group / taken_name).read_text(encoding="ascii"))
        stat = dict(line.split() for line in (group / "memory.stat").read_text(encoding="ascii").splitlines())
        return max(limit - taken + float(stat.get(cached_name, 0.0)), 0.0)
    except (OSError, ValueError):
        return None


def _system_free_bytes() -> float | None:
    try:
        with open("/proc/meminfo", encoding="ascii") as file:  # noqa: PTH123  # not a path of the user
            for line in file:
                if line.startswith("MemAvailable:"):
                    return float(line.split()[1]) * 1024.0
        return float(os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (OSError, ValueError, AttributeError):
        return None
