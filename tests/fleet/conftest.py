"""Recordings of machines, one a day."""

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from tests.fleet.recordings import write_recording_file


@pytest.fixture
def make_recordings(tmp_path: Path) -> Callable[..., Path]:
    """Write a recording a day: `make(machine, levels)`; return the folder of all machines."""

    def make(machine: str, levels: list[float], *, point: str = "DE", first: datetime = datetime(2026, 1, 1)) -> Path:
        rng = np.random.default_rng(len(machine) + len(levels))
        for day, level in enumerate(levels):
            date = first + timedelta(days=day)
            write_recording_file(tmp_path / "data" / machine / f"{point}_{date:%Y%m%d}.csv", level, rng)
        return tmp_path / "data"

    return make
