"""From parameter values to a flexible pair."""

from __future__ import annotations

from functools import lru_cache

from sims.gear_pair.build import build_machine, gear_geometry
from sims.gear_pair.installed import Installed
from sims.machine import Machine
from sims.mesh import Material
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.dynamics_constants import FlexiblePair
from sims.reduced_fe.gear_cache import cached_gear
from sims.reduced_fe.parameters import MEANINGLESS, OWN
from sims.reduced_fe.ready import READY, ready_gear
from sims.reduced_fe.reduce import plan_for
from sims.reduced_fe.reduced_gear import ReducedGear
from sims.values import Values
from sims.wanted import Wanted

SIDES = ("driver", "driven")
Gears = tuple[ReducedGear, ReducedGear]


def reduced_gears(values: Values) -> Gears:
    """Return both gears: ready-made where they fit, else from the cache, else reduced now, which takes a minute.

    Raises
    ------
    InputError
        If a gear cannot be made or meshed, or memory does not suffice.
    """
    wanted = Wanted(values)
    n_dof = wanted.whole("mesh_dof")
    return _gear(_blank(wanted, 0), n_dof), _gear(_blank(wanted, 1), n_dof)


def sound_machine(
    values: Values, gears: Gears, *, sampling_rate_hz: float = 20480.0, installed: Installed | None = None
) -> Machine:
    """Return the machine without effects: that of the 16-DOF pair, with masses and inertias of gears and hubs."""
    wanted = Wanted(values)
    shared: Values = {name: value for name, value in values.items() if name not in OWN}
    shared.update(MEANINGLESS)
    for side, gear in zip(SIDES, gears, strict=True):
        shared[f"mass_{side}_kg"] = gear.mass_kg + wanted.number(f"hub_mass_{side}_kg")
        hub = wanted.number(f"hub_inertia_{side}_kg_m2")
        shared[f"inertia_{side}_kg_m2"] = gear.polar_inertia_kg_m2 + hub
    return build_machine(shared, sampling_rate_hz=sampling_rate_hz, installed=installed)


def flexible_pair(values: Values, machine: Machine, gears: Gears) -> FlexiblePair:
    """Return the pair of a machine, effects included."""
    wanted = Wanted(values)
    return FlexiblePair(
        machine,
        gears,
        body_damping_ratio=wanted.number("body_damping_ratio"),
        restitution=wanted.optional("restitution"),
        lead_error_um=wanted.number("lead_error_um"),
        mode_limit_hz=wanted.number("mode_limit_hz"),
    )


def _blank(wanted: Wanted, side: int) -> GearBlank:
    name = SIDES[side]
    material = Material(
        wanted.number("youngs_modulus_gpa"), wanted.number("poisson_ratio"), wanted.number("density_kg_m3")
    )
    return GearBlank(
        gear_geometry(wanted, side),
        wanted.optional(f"web_thickness_{name}_mm"),
        wanted.optional(f"rim_thickness_{name}_mm"),
        wanted.optional(f"hub_thickness_{name}_mm"),
        material,
    )


@lru_cache(maxsize=8)
def _gear(blank: GearBlank, n_dof: int) -> ReducedGear:
    for name, ready in READY.items():
        if ready == blank:
            return ready_gear(name)
    return cached_gear(blank, plan_for(blank, n_dof))
