"""How far a machine lets an effect go: where its slider ends."""

from __future__ import annotations

from functools import lru_cache
from math import floor
from typing import TYPE_CHECKING

import numpy as np

from app.dashboard.laboratory.number import slider_step
from app.dashboard.laboratory.setup import MODEL
from gearsig.errors import InputError
from sims.effects import effect
from sims.presets import Preset, preset

if TYPE_CHECKING:
    from sims.machine import Machine
    from sims.reduced_fe.reduced_gear import ReducedGear

Options = tuple[tuple[str, float | str], ...]
HALVINGS = 20


def greatest_severity(chosen: Preset, name: str, high: float, options: Options = ()) -> float:
    """Return the greatest severity up to `high` that a machine takes, rounded down to the slider's step.

    Parameters
    ----------
    chosen : Preset
        The machine.
    name : str
        Of the effect.
    high : float
        Above 0: where the slider ends if the machine allows it.
    options : tuple of (name, value)
        Of the effect, e.g. on which gear it is. Where they fit no severity at all, the end stays: the page says why.
    """
    found = _greatest(chosen.model, chosen.name, name, high, options)
    step = slider_step(0.0, found)
    return found if found == high else floor(found / step * (1.0 + 1e-9)) * step


@lru_cache(maxsize=256)
def _greatest(model: str, preset_name: str, name: str, high: float, options: Options) -> float:
    machine, gears = _machine(model, preset_name)

    def allowed(severity: float) -> bool:
        try:
            changed = effect(name).apply(machine, severity, dict(options), np.random.default_rng(0))
        except InputError:
            return False
        return _meshed(changed, gears)

    if allowed(high):
        return high
    low, end = 0.0, high
    for _ in range(HALVINGS):
        middle = (low + end) / 2.0
        low, end = (middle, end) if allowed(middle) else (low, middle)
    return low or high


def _meshed(machine: Machine, gears: tuple[ReducedGear, ...]) -> bool:
    """Whether the finite elements of the gears, if there are any, can follow the cracks."""
    from sims.reduced_fe.crack_table import crack_size, deepest_followed_mm

    cracks = (machine.mesh.cracks_1, machine.mesh.cracks_2)
    return all(
        crack.depth_mm <= deepest_followed_mm(gear.blank, crack_size(gear), crack.angle_deg)
        for gear, own in zip(gears, cracks, strict=False)
        for crack in own
    )


@lru_cache(maxsize=16)
def _machine(model: str, preset_name: str) -> tuple[Machine, tuple[ReducedGear, ...]]:
    """Sound machine of a preset, and its reduced gears."""
    from sims.cracked.simulator import CrackedPair
    from sims.reduced_fe.simulator import ReducedPair

    rng, name = np.random.default_rng(0), preset(model, preset_name).name
    if model == MODEL:
        return CrackedPair().prepare({}, (), None, rng, preset_name=name).machine, ()
    pair = ReducedPair().prepare({}, (), None, rng, preset_name=name).pair
    return pair.machine, pair.gears
