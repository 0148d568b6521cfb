"""One tooth: a crack at its root, a spall on its flank, a tip that broke off."""

from __future__ import annotations

from math import radians, sin, sqrt

import numpy as np

from gearsig.checks import FloatArray
from sims.blind.changes.change import GEARS, Change, Place
from sims.blind.geometry import SpurPair
from sims.blind.rig import SHAFTS, BlindRig
from sims.blind.scene import Scene

YOUNG_PA = 2.06e11
ROOT_MODULES = 2.0
"""Root chord of a standard tooth in modules."""
CRACK_ANGLE = radians(60)
HERTZ_SHARE = 0.3
"""Part of a pair's compliance that is local to the contact."""


def _tooth(scene: Scene, choice: np.random.Generator) -> tuple[int, int, Place]:
    gear = int(choice.integers(2))
    n_teeth = (scene.rig.pair.z1, scene.rig.pair.z2)[gear]
    tooth = int(choice.integers(n_teeth))
    place: dict[str, str | int | float] = {"gear": GEARS[gear], "tooth": tooth, "shaft": SHAFTS[gear]}
    if gear == 0:  # only the input shaft has a tachometer to count from
        place["angle_deg"] = round(360 * (tooth + scene.rig.pair.contact_ratio / 2) / n_teeth % 360, 2)
    return gear, tooth, place


def crack_compliance(pair: SpurPair, gear: int, depth_mm: float) -> FloatArray:
    """Deflection per force along the line of action over the path, m/N, from a hinge at the root.

    c = 24 S(a/s) / (E b s²), S(x) = (x/(1 − x))² (5.93 − 19.69x + 37.14x² − 35.84x³ + 13.12x⁴), times the lever
    squared; within 1 % however little of the root is left.

    Source: H. Tada, P. C. Paris and G. R. Irwin, *The Stress Analysis of Cracks Handbook* (2000), single edge crack in
    bending.
    """
    chord_m = ROOT_MODULES * pair.module_mm / 1000
    x = depth_mm / 1000 * sin(CRACK_ANGLE) / chord_m
    opening = (x / (1 - x)) ** 2 * sum(c * x**n for n, c in enumerate((5.93, -19.69, 37.14, -35.84, 13.12)))
    hinge = 24 * opening / (YOUNG_PA * pair.face_mm / 1000 * chord_m**2)
    rho = pair.rho_m(np.clip(pair.path, 0, pair.contact_ratio))[gear]
    rb, rp = pair.base_radii_m[gear], pair.pitch_radii_m[gear]
    lever = np.sqrt(rb**2 + rho**2) - (rp - pair.module_mm / 1000)
    return np.asarray(hinge * (np.maximum(lever, 0) * np.cos(pair.alpha)) ** 2)


def _crack(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    gear, tooth, place = _tooth(scene, choice)
    scene.weak[gear][tooth] += scene.pair_stiffness * crack_compliance(scene.rig.pair, gear, severity)
    return place


def _spall(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Width lost to a band of the flank: the contact there is shorter, its edges as wide as the Hertzian band."""
    gear, tooth, place = _tooth(scene, choice)
    pair = scene.rig.pair
    centre, length = pair.pitch_point + choice.uniform(-0.2, 0.2), choice.uniform(0.15, 0.35)
    share = min(severity / pair.face_mm, 0.95)
    edge = 0.15 / (pair.base_pitch_m * 1000)
    band = 0.5 * (np.tanh((pair.path - centre + length / 2) / edge) - np.tanh((pair.path - centre - length / 2) / edge))
    scene.weak[gear][tooth] += HERTZ_SHARE * share / (1 - share) * band
    return place


def _chip(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Active profile that is gone: the pair's path ends earlier (pinion) or begins later (wheel)."""
    gear, tooth, place = _tooth(scene, choice)
    pair, loss_m = scene.rig.pair, severity / 1000
    ra, rb = pair.tip_radii_m[gear], pair.base_radii_m[gear]
    rho = sqrt(max((ra - loss_m) ** 2 - rb**2, 1e-12))
    if gear == 0:
        end = (rho - pair.rho_start_m) / pair.base_pitch_m
        beyond = pair.path - end
    else:
        end = (pair.centre_distance_m * sin(pair.alpha) - rho - pair.rho_start_m) / pair.base_pitch_m
        beyond = end - pair.path
    lost = beyond > 0
    gap = pair.corner_gap_m(1 - gear, beyond[lost] * pair.base_pitch_m, loss_m)
    scene.gap_m[gear][tooth][lost] += np.maximum(gap - scene.base_gap_m[lost], 0)
    return place


def _crack_span(rig: BlindRig) -> tuple[float, float]:
    chord_mm = ROOT_MODULES * rig.pair.module_mm / sin(CRACK_ANGLE)
    return 0.4 * chord_mm, 0.9 * chord_mm


CHANGES = (
    Change("root_crack", "tooth-local", "mm", _crack_span, _crack),
    Change("tooth_spall", "tooth-local", "mm", lambda rig: (0.4 * rig.pair.face_mm, 0.95 * rig.pair.face_mm), _spall),
    Change(
        "chipped_tooth", "tooth-local", "mm", lambda rig: (0.35 * rig.pair.module_mm, 1.5 * rig.pair.module_mm), _chip
    ),
)
