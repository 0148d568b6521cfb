"""Effect: more play between the flanks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sims.effects._effect import DriveEffect, DriveParameters, Effect, Options, PlausibleRange, Severity
from sims.effects._shared import module_mm
from sims.machine import Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with wider play; half of it lies on either side."""
    del options, rng
    return replace(machine, half_backlash_um=machine.half_backlash_um + severity / 2.0)


def on_drive(drive: DriveParameters, severity: float, options: Options) -> DriveEffect:
    """Widen the play by the severity."""
    del options
    return DriveEffect({"half_backlash_um": drive.number("half_backlash_um") + 0.5 * severity})


EFFECT = Effect(
    name="backlash",
    group="drive and load",
    title="more backlash",
    severity=Severity(
        "added_um", "um", 0.0, 1000.0, 100.0, "play that is added along the line of action, from flank to flank"
    ),
    changes="The flanks have that much more play. While the mesh force stays above zero nothing changes at all.",
    signature="Only where teeth separate: at light load, at a resonance, in reversals and start–stop. There: impacts "
    "on both flanks, a raised floor, subharmonics and chaotic motion, jumps of level over speed. At full steady load "
    "it cannot be seen, and no method will.",
    shows_in=("low_load", "broadband", "mesh_harmonics"),
    change=change,
    plausible=PlausibleRange(25.0, 300.0, "um per mm of module; new gears have some 20 to 50", module_mm),
    on_drive=on_drive,
)
