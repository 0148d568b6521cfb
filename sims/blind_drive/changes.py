"""What can be wrong with a drive: each a change of its numbers, in this rig's own way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from sims.blind_drive.machine import Machine

Applied = tuple[dict[str, float], dict[str, float]]
"""Numbers that change, and where it sits."""


@dataclass(frozen=True)
class Change:
    """One thing that can be wrong.

    Parameters
    ----------
    low, high : float
        Severity, from barely noticeable to strong.
    unit : str
    apply : callable
        Machine, severity, generator → numbers that change, place.
    needs_reference : bool
        Whether no drawing states the sound value.
    """

    low: float
    high: float
    unit: str
    apply: Callable[[Machine, float, np.random.Generator], Applied]
    needs_reference: bool = False


def _backlash(m: Machine, added_um: float, _: np.random.Generator) -> Applied:
    """Wheels that moved apart: both flanks give way, and pairs touch a little shorter."""
    apart = added_um * 1e-6 / (2.0 * np.sin(m.numbers["pressure_angle"]))
    shorter = 2.0 * apart * np.cos(m.numbers["pressure_angle"]) / m.numbers["base_pitch"] * 0.5
    return {"half_play": m.numbers["half_play"] + 0.5e-6 * added_um, "ratio": m.numbers["ratio"] - shorter}, {}


def _wear(_: Machine, depth_um: float, __: np.random.Generator) -> Applied:
    return {"wear": depth_um * 1e-6}, {}


def _flank_friction(m: Machine, percent: float, _: np.random.Generator) -> Applied:
    return {"mu": m.numbers["mu"] * (1.0 + 0.01 * percent)}, {}


def _load_friction(m: Machine, percent: float, _: np.random.Generator) -> Applied:
    factor = 1.0 + 0.01 * percent
    return {name: m.numbers[name] * factor for name in ("load_level", "load_viscous")}, {}


def _crack(m: Machine, depth_mm: float, rng: np.random.Generator) -> Applied:
    """A tooth's root as a cantilever: compliance with the third power of what is left of its thickness."""
    left = 1.0 - depth_mm / (2.2 * m.drawing.module_mm)
    tooth = int(rng.integers(m.drawing.z1))
    return {"crack": 0.12 * (left**-3 - 1.0), "cracked": float(tooth)}, {"tooth": tooth + 1}


def _inertia(m: Machine, percent: float, rng: np.random.Generator) -> Applied:
    """A heavier piece; in one case of three a lighter one."""
    whole = m.numbers["j_wheel"] + m.numbers["j_load"]
    part = -0.45 * percent if rng.random() < 1.0 / 3.0 else percent
    return {"j_load": max(m.numbers["j_load"] + 0.01 * part * whole, 0.1 * whole)}, {}


def _ripple(_: Machine, percent: float, rng: np.random.Generator) -> Applied:
    order = int(rng.choice([5, 6, 7, 9, 11, 13]))
    return {"ripple": 0.01 * percent, "ripple_order": float(order)}, {"order": order}


def _run_out(_: Machine, um: float, __: np.random.Generator) -> Applied:
    return {"run_out": um * 1e-6}, {}


def _off_centre(m: Machine, percent: float, _: np.random.Generator) -> Applied:
    """A piece that is not gripped in the middle."""
    return {"off_centre": 0.01 * percent * m.drawing.torque_nm * m.drawing.z2 / m.drawing.z1}, {}


def _torque_gain(_: Machine, percent: float, rng: np.random.Generator) -> Applied:
    return {"gain": 1.0 + 0.01 * percent * float(rng.choice([-1.0, 1.0]))}, {}


def _slip(_: Machine, um: float, __: np.random.Generator) -> Applied:
    """A wheel encoder whose coupling slips a little at each start."""
    return {"slip": um * 1e-6}, {}


CATALOGUE = {
    "backlash": Change(30.0, 250.0, "um", _backlash),
    "tooth_wear": Change(20.0, 120.0, "um", _wear),
    "sliding_friction": Change(60.0, 300.0, "%", _flank_friction),
    "load_friction": Change(12.0, 40.0, "%", _load_friction, needs_reference=True),
    "root_crack": Change(2.5, 7.5, "mm", _crack),
    "load_inertia": Change(20.0, 100.0, "%", _inertia),
    "torque_gain": Change(12.0, 40.0, "%", _torque_gain),
    "torque_ripple": Change(1.5, 10.0, "%", _ripple),
}
"""What a diagnosis may name."""
OUTSIDE = {
    "run_out": Change(30.0, 150.0, "um", _run_out),
    "off_centre": Change(8.0, 40.0, "%", _off_centre),
    "encoder_slip": Change(30.0, 200.0, "um", _slip),
}
"""What it must call unknown."""


def changed(machine: Machine, name: str, severity: float, rng: np.random.Generator) -> tuple[Machine, dict[str, float]]:
    """Return the machine with something wrong, and where it sits."""
    change = (CATALOGUE | OUTSIDE)[name]
    numbers, place = change.apply(machine, severity, rng)
    return replace(machine, numbers=machine.numbers | numbers), place
