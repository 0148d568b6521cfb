"""The forging manipulator's rotary drive: starts and stops, backlash, impacts, stick–slip."""

from sims.forging._drive import (
    MODES,
    PARAMETERS,
    Bristle,
    Cycle,
    ForgingDrive,
    GrippedLoad,
    HydraulicMotor,
    Schedule,
    build_drive,
    build_rig,
    schedule,
)
from sims.forging._kernels import bristle, position, reach, weight, younger_pair
from sims.forging._respond import DriveResponse, FirstState, check_convergence, drive_numbers, respond
from sims.forging._simulator import (
    NAME,
    WITH_MEANING,
    ForgingManipulator,
    ForgingTwin,
    PreparedDrive,
    record,
    sensors,
    with_effects,
)

__all__ = [
    "MODES",
    "NAME",
    "PARAMETERS",
    "WITH_MEANING",
    "Bristle",
    "Cycle",
    "DriveResponse",
    "FirstState",
    "ForgingDrive",
    "ForgingManipulator",
    "ForgingTwin",
    "GrippedLoad",
    "HydraulicMotor",
    "PreparedDrive",
    "Schedule",
    "bristle",
    "build_drive",
    "build_rig",
    "check_convergence",
    "drive_numbers",
    "position",
    "reach",
    "record",
    "respond",
    "schedule",
    "sensors",
    "weight",
    "with_effects",
    "younger_pair",
]
