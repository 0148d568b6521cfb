"""Drive and load: torque ripple, speed fluctuation, backlash."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from sims.blind.changes.change import Change, Place, steady
from sims.blind.rig import SHAFTS
from sims.blind.scene import Scene, with_course


def _ripple(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft, order, phases = (
        int(choice.integers(2)),
        float(choice.choice([1, 2, 3, 4, 6, 8])),
        choice.uniform(0, 2 * pi, 2),
    )
    mean_nm = scene.condition.true_nm * (scene.rig.pair.z2 / scene.rig.pair.z1 if shaft else 1.0)
    for k, part in enumerate((1.0, 0.25)):
        scene.torque.append((float(shaft), order * (k + 1), severity / 100 * mean_nm * part, phases[k]))
    return {"shaft": SHAFTS[shaft], "order": order}


def _fluctuation(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    first, second, phase = choice.uniform(0.4, 3), choice.uniform(0.1, 0.5), choice.uniform(0, 2 * pi)
    later = scene.rng.uniform(0, 20)

    def factor(t: FloatArray) -> FloatArray:
        swing = np.sin(2 * pi * first * (t + later)) + 0.4 * np.sin(2 * pi * second * (t + later) + phase)
        return np.asarray(1 + severity / 100 * swing)

    with_course(scene, factor)
    return {"frequency_hz": round(float(first), 3)}


def _backlash(scene: Scene, severity: float, choice: np.random.Generator) -> Place:  # noqa: ARG001 - nothing to choose
    scene.backlash_m += severity * 1e-6
    return {"gear": "both"}


CHANGES = (
    Change("torque_ripple", "drive", "% of mean torque", steady(0.5, 50.0), _ripple),
    Change("speed_fluctuation", "drive", "%", steady(0.6, 12.0), _fluctuation),
    Change("backlash", "drive", "um", lambda rig: (8 * rig.pair.module_mm, 300 * rig.pair.module_mm), _backlash),
)
