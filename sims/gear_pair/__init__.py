"""What both models of a gear pair share: parameters, bearings, drive, measurement, and the twin of a rig."""

from sims.gear_pair._bearing import (
    BEARING_FIELDS,
    bearing_fields,
    bearing_loads_n,
    carried_part,
    foot,
    tilting_shares,
)
from sims.gear_pair._build import build_machine, build_rig, gear_geometry
from sims.gear_pair._drive import (
    FRICTION_FIELDS,
    MACHINE_FIELDS,
    draw_roughness,
    friction_fields,
    governor_nm_s_per_rad,
    machine_fields,
    total_inertia_kg_m2,
)
from sims.gear_pair._installed import Installed, completed_bearing
from sims.gear_pair._measurement import COORDINATES, MIN_MOTION_HZ, YIELDS, MeasuredRun, Measurement
from sims.gear_pair._parameters import PARAMETERS
from sims.gear_pair._rolling import (
    contact_n_per_m15,
    element_forces,
    element_loads_n,
    shaft_place_m,
    stiffness_under_load_n_per_m,
)
from sims.gear_pair._run import PairResponse, RunPlan, StepConvergence, profile_points
from sims.gear_pair._simulator import (
    BODY_KG,
    BODY_SHAPES,
    PairModel,
    PairTwin,
    ReadyPair,
    body_gain,
)

__all__ = [
    "BEARING_FIELDS",
    "BODY_KG",
    "BODY_SHAPES",
    "COORDINATES",
    "FRICTION_FIELDS",
    "MACHINE_FIELDS",
    "MIN_MOTION_HZ",
    "PARAMETERS",
    "YIELDS",
    "Installed",
    "MeasuredRun",
    "Measurement",
    "PairModel",
    "PairResponse",
    "PairTwin",
    "ReadyPair",
    "RunPlan",
    "StepConvergence",
    "bearing_fields",
    "bearing_loads_n",
    "body_gain",
    "build_machine",
    "build_rig",
    "carried_part",
    "completed_bearing",
    "contact_n_per_m15",
    "draw_roughness",
    "element_forces",
    "element_loads_n",
    "foot",
    "friction_fields",
    "gear_geometry",
    "governor_nm_s_per_rad",
    "machine_fields",
    "profile_points",
    "shaft_place_m",
    "stiffness_under_load_n_per_m",
    "tilting_shares",
    "total_inertia_kg_m2",
]
