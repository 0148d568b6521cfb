"""Roughness of a pair's flanks, drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sims.machine import Machine
from sims.mesh.roughness import FlankRoughness, FractalSurface, TimeLockedRoughness


def draw_roughness(machine: Machine, rng: np.random.Generator) -> tuple[Machine, TimeLockedRoughness]:
    """Give every tooth its profile, or the backlash its endless one; returns what the mesh and the kernel need.

    Composite roughness S is shared evenly by the two flanks of a pair: each has S/√2.
    """
    rough, pair = machine.roughness, machine.mesh.pair
    endless = FractalSurface.of_roughness(rough.rms_um if rough.locked_to == "time" else 0.0, rough.dimension)
    profile = TimeLockedRoughness.draw(endless, rng)
    if rough.locked_to == "flank" and rough.rms_um > 0.0:
        surface = FractalSurface.of_roughness(rough.rms_um / np.sqrt(2.0), rough.dimension)
        flanks = [FlankRoughness.draw(surface, gear.teeth, rng) for gear in (pair.driver, pair.driven)]
        machine = replace(machine, mesh=replace(machine.mesh, roughness_1=flanks[0], roughness_2=flanks[1]))
    return machine, profile
