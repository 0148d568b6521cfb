"""Bearings with rolling elements as springs about their static load: softness across it, feet that move.

A bearing with clearance c that its load presses to one side by δ = Q/k is as stiff as it is along the load, and only
k δ/(c + δ) across it, as the shaft may roll along the race. Rolling elements that pass move the spring's foot: over a
spall it sinks, with clearance it sways (see `sims.gear_pair.bearing`). Their load is that of the torque at this moment,
without the vibration; a load that lets the shaft lift is refused.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.gear_pair.bearing import BEARING_FIELDS, bearing_fields
from sims.machine import BearingSupport, Machine
from sims.machine.operation import Operation

ROLLING_FIELDS: list[tuple[str, type, tuple[int, ...]]] = [
    *BEARING_FIELDS,
    ("bearing_yield", np.float64, (4, 2)),  # by the load of the nominal torque, m
    ("bearing_play", np.float64, (4, 2)),  # clearance towards the load, m
    ("bearing_spring", np.float64, (4, 2, 2)),
]
"""Of the kernel's record, one entry per bearing."""


class Spring(NamedTuple):
    """Stiffness in one direction."""

    direction: FloatArray
    n_per_m: float


def bearing_springs(support: BearingSupport, load_n: FloatArray) -> tuple[Spring, Spring]:
    """Return a bearing's springs: along x and y, or with clearance along its load and across it."""
    k, clearance, load = support.stiffness_n_per_m, support.clearance_um * 1e-6, float(np.hypot(*load_n))
    if clearance == 0.0:
        return Spring(np.array([1.0, 0.0]), k), Spring(np.array([0.0, 1.0]), k)
    along = load_n / load
    yielded = load / k
    return Spring(along, k), Spring(np.array([-along[1], along[0]]), k * yielded / (clearance + yielded))


def rolling_fields(
    machine: Machine, operation: Operation, force_n: float, loads_n: FloatArray, rng: np.random.Generator
) -> dict[str, Any]:
    """Values of `ROLLING_FIELDS` at the set mesh force; draws the elements' places.

    Raises
    ------
    InputError
        If a bearing with clearance is not loaded all the time.
    """
    _check_load(machine, operation)
    springs = np.zeros((4, 2, 2))
    given, play = np.zeros((4, 2)), np.zeros((4, 2))
    for row, (support, load) in enumerate(zip(machine.bearings, loads_n, strict=True)):
        for spring in bearing_springs(support, load):
            springs[row] += spring.n_per_m * np.outer(spring.direction, spring.direction)
        given[row] = load / support.stiffness_n_per_m
        if support.clearance_um > 0.0:
            play[row] = support.clearance_um * 1e-6 * load / np.hypot(*load)
    own = {"bearing_yield": given, "bearing_play": play, "bearing_spring": springs}
    return bearing_fields(machine, force_n, rng) | own


def _check_load(machine: Machine, operation: Operation) -> None:
    least = float(np.min(operation.torque_nm.values))
    loose = next((b for b in machine.bearings if b.clearance_um > 0.0), None)
    if loose is not None and least <= 0.0:
        raise InputError(
            f"torque_nm falls to {least:g} N m and {loose.bearing.name!r} has clearance: the shaft would lift in it",
            where="clearance_um",
            allowed="a torque above 0 all the time, or no clearance",
            remedy="take the model 'cracked', whose bearings let the shaft lift",
        )
