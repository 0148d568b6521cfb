"""Bearings: damaged races with slipping cages, clearance."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.blind.changes.change import Change, Place, steady
from sims.blind.rig import SHAFTS
from sims.blind.scene import Scene, Train

EXIT_S = 0.15e-3
"""Duration of the blow at the far edge of a defect."""


def slipping_angles(scene: Scene, shaft: int, order: float, slip: float) -> FloatArray:
    """Shaft angles of blows at an order, with the mean slip of the cage and a jitter that adds up."""
    n = int(scene.turns[shaft] * order) + 2
    spacing = 2 * pi / (order * (1 - slip)) * (1 + scene.rng.normal(0, 0.008, n))
    return np.asarray(np.cumsum(spacing) - spacing[0] * scene.rng.random())


def load_direction(scene: Scene, body: int) -> float:
    """Direction of the mesh force on a rotor."""
    return scene.rig.parts.line_angle + (pi if body == 0 else 0.0)


def blow_n(scene: Scene, severity_mm: float) -> float:
    """Force of a blow: grows with the defect and with the bearing's load, which the weight keeps above nothing."""
    load_n = scene.mesh_force_n / 2 + 9.81 * max(scene.rig.parts.rotor_mass_kg)
    return float(0.3 * severity_mm**0.8 * load_n)


def add_blows(
    scene: Scene, shaft: int, angle: FloatArray, force: FloatArray, turn: FloatArray, *, width_mm: float, race_mm: float
) -> None:
    """Unload as an element drops in, then a short blow at the far edge."""
    omega = scene.omega[shaft]
    across = width_mm / race_mm / 2  # rad of cage travel over the defect, in shaft angle about twice that
    scene.trains.append(Train(shaft, shaft, angle, -0.3 * force, turn, max(4 * across / omega, 2 * EXIT_S)))
    scene.trains.append(Train(shaft, shaft, angle + 4 * across, force, turn, EXIT_S))


def _race(scene: Scene, severity: float, choice: np.random.Generator, *, is_inner: bool) -> Place:
    shaft, slip, spot = int(choice.integers(2)), choice.uniform(0.002, 0.015), choice.uniform(-0.6, 0.6)
    at = choice.uniform(0, 2 * pi)
    bearing = scene.rig.bearing(shaft)
    order = bearing.orders()["BPFI" if is_inner else "BPFO"]
    angle = slipping_angles(scene, shaft, order, slip)
    force = blow_n(scene, severity) * np.clip(scene.rng.normal(1, 0.2, len(angle)), 0.2, 2)
    sense = 1.0 if shaft == 0 else -1.0
    mid = load_direction(scene, shaft)
    turn = sense * angle + at if is_inner else np.full(len(angle), mid + spot)
    zone = np.maximum(np.cos(turn - mid), 0.0) ** 1.5
    add_blows(
        scene, shaft, angle, force * zone, turn, width_mm=severity, race_mm=(bearing.pitch_diameter_mm or 40.0) / 2
    )
    return {"shaft": SHAFTS[shaft], "bearing": bearing.name, "order": round(order, 4)}


def _outer(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    return _race(scene, severity, choice, is_inner=False)


def _inner(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    return _race(scene, severity, choice, is_inner=True)


def _clearance(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft = int(choice.integers(2))
    scene.clearance_m[shaft] += severity * 1e-6
    return {"shaft": SHAFTS[shaft], "bearing": scene.rig.bearing(shaft).name}


CHANGES = (
    Change("bearing_outer_race", "bearing", "mm", steady(0.06, 6.0), _outer),
    Change("bearing_inner_race", "bearing", "mm", steady(0.08, 6.0), _inner),
    Change("bearing_clearance", "bearing", "um", steady(3.0, 60.0), _clearance),
)
