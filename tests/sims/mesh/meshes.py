"""The spur pair of the mesh tests: 55 and 75 teeth, module 2."""

import numpy as np

from sims.mesh import GearGeometry, GearMesh, MeshTable, PairGeometry, fillet_outline, involute_outline, pair_states

PAIR = PairGeometry(*(GearGeometry(z, 2.0, face_width_mm=20.0, bore_radius_mm=17.5) for z in (55, 75)))
MESH = GearMesh(PAIR)
PITCH_POINT = (PAIR.pitch_point_radius_mm - PAIR.start_radius_mm) / PAIR.base_pitch_mm
"""ζ at the pitch point, 0.909: in single contact."""
SINGLE = np.linspace(0.83, 0.97, 29)
"""Only pair 0 touches."""


def tooth_outline_mm(gear: GearGeometry, n_points: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Half a tooth from root circle to tip; mirror y for the other flank."""
    fillet = fillet_outline(gear, np.linspace(np.pi / 2.0, gear.pressure_angle_rad, n_points // 2))
    flank = involute_outline(gear, np.linspace(gear.form_roll_rad, gear.tip_roll_rad, n_points // 2 + 1)[1:])
    return np.concatenate((fillet.x_mm, flank.x_mm)), np.concatenate((fillet.y_mm, flank.y_mm))


def own_separation(table: MeshTable, progress: np.ndarray, pair: int = 0) -> np.ndarray:
    """Separation of one pair over ζ, as the solver reads it."""
    cycles = progress + pair
    _, separation, _ = pair_states(table, cycles)
    column = np.floor(cycles + table.ramp / 2).astype(int) - pair
    return separation[np.arange(len(cycles)), column]


def own_compliance(table: MeshTable, progress: np.ndarray, pair: int = 0) -> np.ndarray:
    """Compliance of one pair over ζ, contact included."""
    cycles = progress + pair
    compliance, _, _ = pair_states(table, cycles)
    column = np.floor(cycles + table.ramp / 2).astype(int) - pair
    return compliance[np.arange(len(cycles)), column] + table.contact_coefficient


def own_stretch(mesh: GearMesh, n_points: int = 400) -> np.ndarray:
    """ζ from a pair's entry to its exit."""
    return np.linspace(0.0, mesh.pair.contact_ratio, n_points)
