"""Recordings of machines, one a day."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.fleet.recordings import write_daily_recordings


@pytest.fixture
def make_recordings(tmp_path: Path) -> Callable[..., Path]:
    """Write a recording a day: `make(machine, levels)`; return the folder of all machines."""
    return partial(write_daily_recordings, tmp_path / "data")
