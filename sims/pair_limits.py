"""What a simulated gear pair can be asked for: speeds, loads, sampling rates, durations."""

from __future__ import annotations

from gearsig.checks import within
from sims.machine import Machine
from sims.machine.operation import Operation

SPEED_RANGE_RPM = (0.0, 30000.0)
BREAKING_STRESS_PA = 2e9
"""F/(b m) beyond which any steel tooth would break; rated gears stay below a quarter of it."""
SAMPLING_RATE_RANGE_HZ = (100.0, 250000.0)
DURATION_RANGE_S = (0.01, 120.0)
"""The motion is held in memory: some 30 MB a second."""


def check_run(operation: Operation, sampling_rate_hz: float) -> None:
    """Refuse speeds and sampling rates that no gear pair has."""
    for value in (operation.speed_rpm.values.min(), operation.speed_rpm.values.max()):
        within(value, "speed_rpm", *SPEED_RANGE_RPM, "rpm")
    within(sampling_rate_hz, "sampling_rate_hz", *SAMPLING_RATE_RANGE_HZ, "Hz")


def check_load(machine: Machine, operation: Operation) -> None:
    """Refuse a torque that would break the teeth: far beyond, the linear model means nothing."""
    pair = machine.mesh.pair
    section_m2 = pair.face_width_mm * pair.driver.module_mm * 1e-6
    most_nm = BREAKING_STRESS_PA * section_m2 * pair.driver.pitch_radius_mm * 1e-3
    within(operation.torque_nm.largest, "torque_nm", 0.0, float(f"{most_nm:.2g}"), "N m")
