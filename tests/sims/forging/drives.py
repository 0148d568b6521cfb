"""Drives and runs that the tests share."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sims.forging import (
    PARAMETERS,
    Bristle,
    DriveResponse,
    FirstState,
    ForgingDrive,
    Schedule,
    build_drive,
    respond,
)
from sims.machine import Profile
from sims.simulator import ParameterValue, ParameterValues, complete_values

NOTHING = Profile.constant(0.0)
AT_REST = Schedule(NOTHING, NOTHING, NOTHING)


def drive(speed_limit_rpm: float = 100.0, **values: ParameterValue) -> ForgingDrive:
    return build_drive(ParameterValues(complete_values(PARAMETERS, values)), speed_limit_rpm)


def free_bodies(contact: Mapping[str, object] | None = None, **values: ParameterValue) -> ForgingDrive:
    """Two gears that nothing drives, holds or rubs; one tooth pair all the time in the angle they turn through."""
    made = drive(0.0, friction_coefficient=0.0, mesh_phase=0.2, **values)
    none = Bristle(0.0, 1.0, 1.0, 1.0)
    contact = replace(made.contact, **(contact or {}))  # type: ignore[arg-type]  # as named
    return replace(made, contact=contact, drag=none, load_friction=none)


def impact(made: ForgingDrive, speed_mps: float, **options: object) -> DriveResponse:
    """Run the gears into each other from the middle of the gap; the pinion turns, the wheel stands."""
    start = FirstState(0.0, speed_mps / made.path.base_radii_m[0], 0.0, speed_mps)
    lasts_s = 1.5 * made.contact.half_backlash_um * 1e-6 / speed_mps + 0.02
    return respond(made, AT_REST, duration_s=lasts_s, interval_s=1e-5, first=start, **options)  # type: ignore[arg-type]


def driven_by(torque_nm: float) -> Schedule:
    return Schedule(Profile.of([0.0, 0.02], [0.0, torque_nm]), NOTHING, NOTHING)


def largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))
