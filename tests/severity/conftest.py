"""The simulated gearbox as fixtures."""

import pytest

from gearsig.recording import Recording
from tests.severity.gearbox import SPEED_RPM, Record, record_gearbox


@pytest.fixture(scope="session")
def record() -> Record:
    """Return the function that simulates the gearbox."""
    return record_gearbox


@pytest.fixture(scope="session")
def healthy() -> Recording:
    """Return the gearbox before it cracked, at a slightly other speed."""
    return record_gearbox(0.0, speed_rpm=1.004 * SPEED_RPM)
