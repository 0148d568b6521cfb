"""Shafts: eccentric gears, unbalance, misalignment."""

from __future__ import annotations

from math import pi

import numpy as np

from sims.blind.changes.change import GEARS, Change, Place, deflection_um, steady
from sims.blind.rig import SHAFTS
from sims.blind.scene import Scene


def _add_unbalance(scene: Scene, shaft: int, amount_kgm: float, angle: float) -> None:
    old, phase = scene.unbalance[shaft]
    total = old * np.exp(1j * phase) + amount_kgm * np.exp(1j * angle)
    scene.unbalance[shaft] = float(abs(total)), float(np.angle(total))


def _eccentricity(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft, angle = int(choice.integers(2)), choice.uniform(0, 2 * pi)
    scene.runout.append((float(shaft), 1.0, severity * 1e-6, angle))
    _add_unbalance(scene, shaft, scene.rig.pair.gear_mass_kg(shaft) * severity * 1e-6, angle)
    return {"gear": GEARS[shaft], "shaft": SHAFTS[shaft]}


def _unbalance(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft, angle = int(choice.integers(2)), choice.uniform(0, 2 * pi)
    _add_unbalance(scene, shaft, severity * 1e-6, angle)
    return {"shaft": SHAFTS[shaft]}


def _misalignment(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A wedge between the flanks, part of it turning with a shaft, and a coupling that is forced twice a turn."""
    shaft = int(choice.integers(2))
    standing, turning = choice.uniform(0.4, 0.7), choice.uniform(0.2, 0.4)
    coupling_n_per_m, phases = choice.uniform(0.5e6, 3e6), choice.uniform(0, 2 * pi, 5)
    offset_m = severity * 1e-6
    scene.wedge_m += standing * offset_m
    scene.wobble.append((float(shaft), 1.0, turning * offset_m, phases[0]))
    for order, part, phase in ((1.0, 0.3, phases[1]), (2.0, 1.0, phases[2])):
        scene.sway.append((float(shaft), order, part * coupling_n_per_m * offset_m, phase, phases[3]))
    torque_nm = 0.02 * severity / (4 * deflection_um(scene.rig)) * scene.condition.true_nm
    scene.torque.append((float(shaft), 2.0, torque_nm, phases[4]))
    return {"shaft": SHAFTS[shaft]}


CHANGES = (
    Change(
        "eccentricity", "shaft", "um", lambda rig: (30 * rig.pair.module_mm, 150 * rig.pair.module_mm), _eccentricity
    ),
    Change(
        "unbalance",
        "shaft",
        "g mm",
        lambda rig: (80 * min(rig.parts.rotor_mass_kg), 2400 * min(rig.parts.rotor_mass_kg)),
        _unbalance,
    ),
    Change("misalignment", "shaft", "um", steady(4.0, 300.0), _misalignment),
)
