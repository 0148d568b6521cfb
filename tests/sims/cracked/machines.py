"""Variants of the 55/75 pair that isolate one property."""

from dataclasses import replace
from typing import Any

import numpy as np

from sims.cracked import PairConstants
from sims.machine import Drive, Lubrication, Machine
from sims.mesh import RootCrack

FREE_DRIVE = Drive(governor_nm_s_per_rad=1e-12)


def conservative(machine: Machine, **wheel_changes: float) -> Machine:
    """Return the machine without damping, friction and governor; run-out or unbalance may be given."""
    return replace(
        machine,
        mesh_damping_ratio=0.0,
        lubrication=Lubrication(friction=False),
        shafts=tuple(
            replace(s, bending_damping_n_s_per_m=0.0, torsional_damping_nm_s_per_rad=0.0) for s in machine.shafts
        ),
        bearings=tuple(replace(b, damping_n_s_per_m=0.0) for b in machine.bearings),
        wheels=tuple(replace(w, **wheel_changes) for w in machine.wheels),
        drive=FREE_DRIVE,
    )


def frictionless(machine: Machine) -> Machine:
    return replace(machine, lubrication=Lubrication(friction=False))


def cracked(machine: Machine, depth_mm: float) -> Machine:
    return replace(machine, mesh=replace(machine.mesh, cracks_1=(RootCrack(depth_mm),)))


def one_lasting_pair(k: PairConstants) -> PairConstants:
    """Return constants in which one tooth pair of constant stiffness touches all the time."""
    k = with_record(k, n_slots=3, contact_ratio=1.0 - 1e-12, ramp=0.0, **FIXED_CENTRES)
    curves = k.curves.copy()
    for kind in range(2):
        curves[k.rows[kind]] = curves[k.rows[kind, 0]].mean()
    return PairConstants(k.record, curves, k.rows, k.pitch)


FIXED_CENTRES = {"late_x": 0.0, "late_y": 0.0, "turn_x": 0.0}
"""Tooth pairs enter as if the gears' centres stood still: the force that belongs to it is no part of the model."""


def with_record(k: PairConstants, **values: float) -> PairConstants:
    """Return constants with other numbers in their record."""
    record = np.array(k.record, dtype=k.record.dtype)
    for name, value in values.items():
        record[name] = value
    return PairConstants(record[()], k.curves, k.rows, k.pitch)


def moving_state(rng: np.random.Generator, *, delta_m: float = 2e-5, base_radii_m: Any = None) -> Any:
    """Return a random place near equilibrium with a given compression of the flanks (below 0: apart)."""
    q = rng.normal(0.0, 1e-6, 16)
    q[1] = rng.uniform(0.0, 40.0)
    q[2] = (base_radii_m[0] * q[1] - delta_m) / base_radii_m[1]
    q[0], q[3] = q[1] + rng.normal(0, 1e-4), q[2] + rng.normal(0, 1e-4)
    return q
