"""A second forging drive that makes blind cases of start–stop motion, for the benchmark and the tests only.

It is built otherwise than `sims.forging` and shares no code with it: four masses (motor, pinion, wheel, gripper with
piece) on two elastic shafts; fixed steps of the classical Runge–Kutta method without events; linear pairs of teeth
whose stiffness follows a parabola over the path, each with its own separation, tip relief, pitch errors on both flanks;
Kelvin–Voigt damping that fades in with depth; Coulomb–Stribeck friction; valves of first order. Effects are its own.
"""

from sims.blind_drive._case import Chain, DriveCase, MadeCase, draw_case, label_of, record_case, run
from sims.blind_drive._machine import (
    CATALOGUE,
    GEARS,
    N_STATES,
    OUTSIDE,
    ROLES,
    BlindDrive,
    build,
    changed,
    draw_drawing,
    march,
)

__all__ = [
    "CATALOGUE",
    "GEARS",
    "N_STATES",
    "OUTSIDE",
    "ROLES",
    "BlindDrive",
    "Chain",
    "DriveCase",
    "MadeCase",
    "build",
    "changed",
    "draw_case",
    "draw_drawing",
    "label_of",
    "march",
    "record_case",
    "run",
]
