"""Memory that programs can still take: of the system, and of the container they run in."""

from __future__ import annotations

import os
from math import inf, isfinite
from pathlib import Path

CGROUPS = Path("/sys/fs/cgroup")
"""Where Linux shows the limits of containers."""


def free_memory_bytes() -> float | None:
    """Memory that programs can still take, of the system and of a container; None where neither tells."""
    found = [free for free in (_system_free_bytes(), container_free_bytes()) if free is not None]
    least = min(found, default=inf)
    return least if isfinite(least) else None


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
        with Path("/proc/meminfo").open(encoding="ascii") as file:
            for line in file:
                if line.startswith("MemAvailable:"):
                    return float(line.split()[1]) * 1024.0
    except (OSError, ValueError, IndexError):
        pass
    try:  # where there is no such file, half of what is built in
        return 0.5 * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (OSError, ValueError, AttributeError):
        return None
