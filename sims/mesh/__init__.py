"""Shared gear physics: involute geometry and mesh stiffness of spur pairs."""

from sims.mesh.chip import ToothChip, highest_chip_mm
from sims.mesh.crack import RootCrack, crack_depth_mm, crack_percent, deepest_crack_mm
from sims.mesh.deviation import FlankDeviation
from sims.mesh.flank import arc_length_mm, flank_length_mm
from sims.mesh.gear_mesh import GearMesh, ToothFaults
from sims.mesh.geometry import GearGeometry, disc_inertia_kg_m2, disc_mass_kg
from sims.mesh.involute import inverse_involute, involute
from sims.mesh.material import STEEL, Material
from sims.mesh.mesh_friction import MeshFriction, friction_over_mesh
from sims.mesh.pair import PairGeometry
from sims.mesh.profile import tooth_outline_mm
from sims.mesh.roughness import FlankRoughness, FractalSurface, TimeLockedRoughness
from sims.mesh.spall import ToothSpall
from sims.mesh.stiffness import (
    LoadSharing,
    MeshStiffness,
    back_stiffness_n_per_m,
    mesh_stiffness,
    one_mesh_cycle,
    share_torque,
)
from sims.mesh.table import MeshTable, mesh_table
from sims.mesh.wear import wear_profile

__all__ = [
    "STEEL",
    "FlankDeviation",
    "FlankRoughness",
    "FractalSurface",
    "GearGeometry",
    "GearMesh",
    "LoadSharing",
    "Material",
    "MeshFriction",
    "MeshStiffness",
    "MeshTable",
    "PairGeometry",
    "RootCrack",
    "TimeLockedRoughness",
    "ToothChip",
    "ToothFaults",
    "ToothSpall",
    "arc_length_mm",
    "back_stiffness_n_per_m",
    "crack_depth_mm",
    "crack_percent",
    "deepest_crack_mm",
    "disc_inertia_kg_m2",
    "disc_mass_kg",
    "flank_length_mm",
    "friction_over_mesh",
    "highest_chip_mm",
    "inverse_involute",
    "involute",
    "mesh_stiffness",
    "mesh_table",
    "one_mesh_cycle",
    "share_torque",
    "tooth_outline_mm",
    "wear_profile",
]
