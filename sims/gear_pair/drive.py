"""Drive and inertias of a pair as plain numbers, which compiled code reads."""

from __future__ import annotations

from math import pi
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.machine import Machine
from sims.machine.parts import RECOVERY_S

MOST_LINES = 8
"""Torque ripples, or speed swings, at once."""
DRIVE_SCALARS = ("governor", "governor_spring", "total_inertia", "ratio")
DRIVE_FIELDS = [
    ("n_ripples", np.int64),
    ("ripples", np.float64, (MOST_LINES, 3)),
    ("n_swings", np.int64),
    ("swings", np.float64, (MOST_LINES, 3)),
]
"""Of a record, beside `DRIVE_SCALARS`."""


def drive_fields(machine: Machine) -> dict[str, Any]:
    """Values of `DRIVE_SCALARS` and `DRIVE_FIELDS`."""
    drive, governor, total = machine.drive, governor_nm_s_per_rad(machine), total_inertia_kg_m2(machine)
    swings = [(s.fraction, 2.0 * pi * s.frequency_hz, s.phase_rad) for s in drive.swings]
    return {
        "governor": governor,
        "governor_spring": governor**2 / (4.0 * total),
        "total_inertia": total,
        "ratio": machine.ratio,
        "n_ripples": len(drive.ripples),
        "n_swings": len(drive.swings),
        "ripples": _rows([(r.order, r.fraction, r.phase_rad) for r in drive.ripples], "torque ripples"),
        "swings": _rows(swings, "speed swings"),
    }


def total_inertia_kg_m2(machine: Machine) -> float:
    """Everything that turns, as the input shaft feels it."""
    (input_shaft, output_shaft), (driver, driven) = machine.shafts, machine.wheels
    far = driven.inertia_kg_m2 + output_shaft.rotor_inertia_kg_m2
    return input_shaft.rotor_inertia_kg_m2 + driver.inertia_kg_m2 + far / machine.ratio**2


def governor_nm_s_per_rad(machine: Machine) -> float:
    """G of the drive; an ordinary one suits what it turns."""
    given = machine.drive.governor_nm_s_per_rad
    return 2.0 * total_inertia_kg_m2(machine) / RECOVERY_S if given is None else given


def _rows(items: list[tuple[float, float, float]], what: str) -> FloatArray:
    if len(items) > MOST_LINES:
        raise InputError(f"{len(items)} {what}", allowed=f"at most {MOST_LINES}")
    rows = np.zeros((MOST_LINES, 3))
    rows[: len(items)] = np.array(items, dtype=np.float64).reshape(-1, 3)
    return rows
