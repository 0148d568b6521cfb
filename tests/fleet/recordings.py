"""Small recordings, as files."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np

RATE_HZ = 2560.0
PATTERN = "{machine}/{point}_{date:%Y%m%d}.csv"


def write_recording_file(path: Path, level: float, rng: np.random.Generator, n: int = 2560) -> None:
    time_s = np.arange(n) / RATE_HZ
    values = level * np.sin(2 * np.pi * 90 * time_s) + 0.3 * level * rng.normal(size=n)
    path.parent.mkdir(parents=True, exist_ok=True)
    table = np.column_stack([time_s, values])
    np.savetxt(path, table, delimiter=",", header="time (s),a1 (m/s^2)", comments="", fmt="%.7g")


def write_daily_recordings(
    folder: Path,
    machine: str,
    levels: Sequence[float],
    *,
    point: str = "DE",
    first: datetime = datetime(2026, 1, 1),
) -> Path:
    """Write a recording of each level, one a day; return the folder of all machines."""
    rng = np.random.default_rng(len(machine) + len(levels))
    for day, level in enumerate(levels):
        date = first + timedelta(days=day)
        write_recording_file(folder / machine / f"{point}_{date:%Y%m%d}.csv", level, rng)
    return folder
