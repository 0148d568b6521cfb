"""Shared gear physics: involute geometry and mesh stiffness of spur pairs."""

from sims.mesh.crack import RootCrack, crack_depth_mm, crack_percent, deepest_crack_mm
from sims.mesh.deviation import FlankDeviation
from sims.mesh.gear_mesh import GearMesh
from sims.mesh.geometry import GearGeometry, disc_inertia_kg_m2, disc_mass_kg
from sims.mesh.involute import inverse_involute, involute
from sims.mesh.material import STEEL, Material
from sims.mesh.pair import PairGeometry
from sims.mesh.profile import tooth_outline_mm
from sims.mesh.stiffness import LoadSharing, MeshStiffness, mesh_stiffness, one_mesh_cycle, share_torque
from sims.mesh.table import MeshTable, mesh_table

__all__ = [
    "STEEL",
    "FlankDeviation",
    "GearGeometry",
    "GearMesh",
    "LoadSharing",
    "Material",
    "MeshStiffness",
    "MeshTable",
    "PairGeometry",
    "RootCrack",
    "crack_depth_mm",
    "crack_percent",
    "deepest_crack_mm",
    "disc_inertia_kg_m2",
    "disc_mass_kg",
    "inverse_involute",
    "involute",
    "mesh_stiffness",
    "mesh_table",
    "one_mesh_cycle",
    "share_torque",
    "tooth_outline_mm",
]
