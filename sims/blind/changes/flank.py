"""All flanks: wear, pitch, roughness, friction."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from sims.blind.changes.change import GEARS, Change, Place, deflection_um, steady
from sims.blind.geometry import SpurPair
from sims.blind.rig import texture
from sims.blind.scene import Scene

SMOOTHED = 0.12
"""Part of a rough flank's height that is left after averaging over the contact."""


def wear_shape(pair: SpurPair) -> tuple[FloatArray, FloatArray]:
    """Depth of wear over the path on both gears, the deepest place 1: pressure times sliding distance, times meshes.

    Source: J. F. Archard, Contact and rubbing of flat surfaces, *J. Appl. Phys.* 24 (1953).
    """
    place = np.clip(pair.path, 0, pair.contact_ratio)
    rho1, rho2 = pair.rho_m(place)
    rolling_1, rolling_2 = rho1, rho2 * pair.z1 / pair.z2
    sliding = np.abs(rolling_1 - rolling_2)
    alone = 0.25 * (1 + np.tanh((place - pair.contact_ratio + 1) / 0.06)) * (1 + np.tanh((1 - place) / 0.06))
    load = 0.5 + 0.5 * alone
    floor = 0.1 * rolling_1.max()
    depth = [
        load * sliding / np.maximum(rolling_1, floor) * pair.z2 / pair.z1,
        load * sliding / np.maximum(rolling_2, floor),
    ]
    deepest = max(d.max() for d in depth)
    return depth[0] / deepest, depth[1] / deepest


def _wear(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    for gear, shape in enumerate(wear_shape(scene.rig.pair)):
        scatter = 1 + choice.normal(0, 0.08, (len(scene.gap_m[gear]), 1))
        scene.gap_m[gear] = scene.gap_m[gear] + severity * 1e-6 * shape * scatter
    return {"gear": "both"}


def _pitch(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Deviations of one gear's teeth, the largest step from tooth to tooth being the severity."""
    gear = int(choice.integers(2))
    n_teeth = len(scene.gap_m[gear])
    if choice.random() < 0.6:
        error = choice.standard_normal(n_teeth)
    else:  # an indexing error that adds up and is paid back at once
        error = np.roll(np.linspace(0, 1, n_teeth), int(choice.integers(n_teeth))) + 0.1 * choice.standard_normal(
            n_teeth
        )
    steps = np.abs(np.diff(error, append=error[0]))
    error = (error - error.mean()) / steps.max()
    scene.gap_m[gear] = scene.gap_m[gear] + severity * 1e-6 * error[:, None]
    return {"gear": GEARS[gear], "shaft": ("input", "output")[gear]}


def _roughness(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    pair = scene.rig.pair
    for gear in range(2):
        rough = texture(choice, pair, len(scene.gap_m[gear]), severity * 1e-6 * SMOOTHED / np.sqrt(2))
        scene.gap_m[gear] = scene.gap_m[gear] + rough
    healthy, rough_um = scene.rig.finish_um, min(severity, 0.5)
    scene.slip = scene.slip * max((1.13 - healthy) / (1.13 - rough_um), 1.0)
    return {"gear": "both"}


def _friction(scene: Scene, severity: float, choice: np.random.Generator) -> Place:  # noqa: ARG001 - nothing to choose
    inside = (scene.rig.pair.path >= 0) & (scene.rig.pair.path <= scene.rig.pair.contact_ratio)
    scene.slip = scene.slip * severity / float(np.abs(scene.slip[inside]).mean())
    return {"gear": "both"}


CHANGES = (
    Change("tooth_wear", "flank", "um", lambda rig: (0.3 * deflection_um(rig), 12 * deflection_um(rig)), _wear),
    Change("pitch_error", "flank", "um", lambda rig: (0.2 * deflection_um(rig), 8 * deflection_um(rig)), _pitch),
    Change("surface_roughness", "flank", "um", steady(1.0, 20.0), _roughness),
    Change("sliding_friction", "flank", "1", steady(0.09, 0.5), _friction),
)
