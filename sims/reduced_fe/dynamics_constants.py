"""The flexible pair as plain numbers, which compiled code reads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from math import cos, pi, radians, sin
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, within
from sims.gear_pair.bearing import bearing_loads_n
from sims.gear_pair.drive import DRIVE_FIELDS, DRIVE_SCALARS, drive_fields
from sims.gear_pair.friction import FRICTION_SCALARS, friction_fields
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.reduced_fe.contact_mirror import folded, mirror_groups, mirrors
from sims.reduced_fe.contact_table import ContactTable, contact_table, static_table
from sims.reduced_fe.dynamics_bearings import ROLLING_FIELDS, rolling_fields
from sims.reduced_fe.dynamics_hub import HubSprings, without_hub
from sims.reduced_fe.dynamics_side import Kept, Side, build_side, kept_modes, residual_compliance
from sims.reduced_fe.maps_static import MeshMaps, mesh_maps, teeth_of
from sims.reduced_fe.reduced_gear import ReducedGear

MODE_LIMIT_HZ = 20000.0
"""Elastic modes up to here are kept; the others follow at once."""
SMALL_PART = 1e-3
"""Of the nominal force on a slice: below it the local contact is straight."""
LEAST_FORCE_N = 50.0
"""Mesh force for which stiffness and damping are taken where the torque is smaller."""

_SCALARS = (
    "start",
    "column_step",
    "small",
    "nominal_force",
    "cycles_per_rad",
    "damping_time",
    "backlash",
    "back_stiffness",
    "restitution",
    "gravity_x",
    "gravity_y",
    *DRIVE_SCALARS,
    "nominal_torque",
    "contact_ratio",
    *FRICTION_SCALARS,
)
_PER_SIDE = (
    "teeth",
    "mass",
    "unbalance",
    "mass_angle",
    "runout",
    "runout_angle",
    "torsional_stiffness",
    "torsional_damping",
    "hooke",
    "hooke_force",
    "coupling_bending",
)
RECORD = np.dtype(
    [(name, np.float64) for name in _SCALARS]
    + [(name, np.float64, (2,)) for name in _PER_SIDE]
    + [(name, np.bool_) for name in ("pushes", "rolls", "friction", "moving_force")]
    + [("n_single", np.int64), ("n_pairs", np.int64)]
    + DRIVE_FIELDS
    + ROLLING_FIELDS,
    align=True,
)
"""SI units; of a side in pairs (driver, driven)."""


@dataclass(frozen=True)
class FlexiblePair:
    """A machine whose gears are reduced finite elements.

    Parameters
    ----------
    machine : Machine
        Masses and inertias of its wheels are those of gear, hub and shaft together; its contact law and the gears'
        stiffness by potential energy are not used. `mesh_damping_ratio` is that of the torsional mode in all:
        the contact has the damping that shafts, bearings and bodies leave wanting.
    gears : (ReducedGear, ReducedGear)
    body_damping_ratio : float
        Of the elastic modes of the gears.
    restitution : float or None
        None: contact by its compliance alone. A number e: at first contact after a loss the closing speed of the gears
        becomes −e times itself, on top of the compliance. That counts an impact twice; it is here for comparison with
        models that do.
    lead_error_um : float
        Misalignment of the flanks over the face width.
    mode_limit_hz : float
    """

    machine: Machine
    gears: tuple[ReducedGear, ReducedGear]
    body_damping_ratio: float = 0.08
    restitution: float | None = None
    lead_error_um: float = 0.0
    mode_limit_hz: float = MODE_LIMIT_HZ

    def __post_init__(self) -> None:
        within(self.body_damping_ratio, "body_damping_ratio", 0.0, 1.0)
        if self.restitution is not None:
            within(self.restitution, "restitution", 0.0, 1.0)

    def maps(self, torque_nm: FloatArray | None = None, mesh_cycles: FloatArray | None = None) -> MeshMaps:
        """Return the static maps of this pair."""
        return mesh_maps(self.gears, self.machine.mesh, torque_nm, mesh_cycles, lead_um=self.lead_error_um)


@dataclass(frozen=True)
class Constants:
    """What compiled code reads; see `sims.reduced_fe.integrate_kernel.march`.

    Parameters
    ----------
    record : one `RECORD`
    table : ContactTable
        With the residual compliance.
    sides : (Side, Side)
        Padded to the same numbers of modes.
    mean_stiffness_n_per_m : float
        Tangent stiffness of the mesh at the nominal force, mean over a cycle.
    base_radius_m : array, (2,)
    """

    record: Any
    table: ContactTable
    sides: tuple[Side, Side]
    mean_stiffness_n_per_m: float
    base_radius_m: FloatArray

    @property
    def omega_rad_s(self) -> FloatArray:
        """Of all modes, (2, n_modes)."""
        return np.array([s.omega_rad_s for s in self.sides])

    def stacked(self, name: str) -> FloatArray:
        """A field of both sides, driver first, contiguous."""
        return np.ascontiguousarray(np.array([getattr(s, name) for s in self.sides]))

    def turn(self) -> FloatArray:
        """Cosine and sine of nψ for each tooth, (2, z, 2, n_pairs)."""
        teeth = self.record["teeth"]
        found = np.zeros((2, int(teeth.max()), 2, self.sides[0].n_pairs))
        for index, side in enumerate(self.sides):
            angle = 2.0 * pi / teeth[index] * np.outer(np.arange(int(teeth[index])), side.diameters)
            found[index, : len(angle), 0], found[index, : len(angle), 1] = np.cos(angle), np.sin(angle)
        return found


def constants(
    pair: FlexiblePair, operation: Operation, *, moving_force: bool = True, rng: np.random.Generator | None = None
) -> Constants:
    """Turn a flexible pair into plain numbers.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its greatest torque sets the scale of forces and the damping of the contact.
    moving_force : bool
        Off: leave out the torque by which stiffness moving past under load acts on the driver, for comparison.
    rng : numpy.random.Generator or None
        Draws the places of rolling elements in bearings with a defect; None: always the same ones.
    """
    from sims.reduced_fe.dynamics_linear import torsional_mode

    machine, mesh = pair.machine, pair.machine.mesh
    base = np.array([mesh.pair.driver.base_radius_mm, mesh.pair.driven.base_radius_mm]) * 1e-3
    force = max(operation.torque_nm.largest / base[0], LEAST_FORCE_N)
    stiffness = mean_stiffness_n_per_m(pair, force)
    table, kept, groups = _contact(pair)
    loads = bearing_loads_n(machine, force)
    make = partial(
        build_side, machine, table=table, groups=groups, body_damping_ratio=pair.body_damping_ratio, loads_n=loads
    )
    sides = _padded([make(i, gear=pair.gears[i], kept=kept[i]) for i in (0, 1)])
    beta = radians(machine.line_of_action_deg)
    wheels, shafts = machine.wheels, machine.shafts
    hooke = np.array([radians(s.coupling_angle_deg) for s in shafts])
    nominal = force / table.n_slices
    values: dict[str, Any] = {
        "start": table.start,
        "column_step": table.step,
        "small": SMALL_PART * nominal,
        "nominal_force": nominal,
        "cycles_per_rad": mesh.pair.driver.teeth / (2.0 * pi),
        "backlash": 2e-6 * machine.half_backlash_um,
        "back_stiffness": stiffness,
        "restitution": -1.0 if pair.restitution is None else pair.restitution,
        "gravity_x": -machine.gravity_mps2 * sin(beta),
        "gravity_y": -machine.gravity_mps2 * cos(beta),
        "teeth": teeth_of(mesh),
        "mass": [w.mass_kg for w in wheels],
        "unbalance": [w.unbalance_g_mm * 1e-6 for w in wheels],
        "mass_angle": np.radians([w.unbalance_angle_deg for w in wheels]),
        "runout": [w.runout_um * 1e-6 for w in wheels],
        "runout_angle": np.radians([w.runout_angle_deg for w in wheels]),
        "torsional_stiffness": [s.torsional_stiffness_nm_per_rad for s in shafts],
        "torsional_damping": [s.torsional_damping_nm_s_per_rad for s in shafts],
        "hooke": hooke**2 / 4.0,
        "hooke_force": hooke / np.array([2.0 * s.bearing_distance_m for s in shafts]),
        "coupling_bending": [s.coupling_bending_nm_per_rad for s in shafts],
        "pushes": machine.gravity_mps2 > 0.0 or bool(hooke.any()) or any(w.unbalance_g_mm > 0.0 for w in wheels),
        "rolls": any(b.defect is not None or b.clearance_um > 0.0 for b in machine.bearings),
        "moving_force": moving_force,
        "nominal_torque": force * base[0],
        "contact_ratio": mesh.pair.contact_ratio,
        "n_single": sides[0].n_single,
        "n_pairs": sides[0].n_pairs,
    }
    record = np.zeros((), RECORD)
    values |= drive_fields(machine) | friction_fields(machine, operation, force)
    values |= rolling_fields(machine, operation, force, loads, np.random.default_rng(0) if rng is None else rng)
    for name, value in values.items():
        record[name] = value
    made = Constants(record[()], table, sides, stiffness, base)
    made.record["damping_time"] = torsional_mode(pair, operation, ready=made).damping_time_s(machine.mesh_damping_ratio)
    return made


def _contact(pair: FlexiblePair) -> tuple[ContactTable, list[Kept], FloatArray]:
    """Residual contact, the modes that are kept beside it, and which slices stand together."""
    n_slices = len(pair.gears[0].grid.z_m)

    def made(groups: FloatArray) -> tuple[ContactTable, list[Kept]]:
        kept = [kept_modes(gear, pair.mode_limit_hz, groups) for gear in pair.gears]

        def rest(gear: ReducedGear, teeth: list[int]) -> FloatArray:
            return residual_compliance(gear, teeth, kept[0] if gear is pair.gears[0] else kept[1])

        table = contact_table(pair.gears, pair.machine.mesh, rest, lead_um=pair.lead_error_um)
        hubs = HubSprings.of(pair.gears[0], kept[0].all), HubSprings.of(pair.gears[1], kept[1].all)
        return without_hub(table, pair.machine.mesh.pair, pair.gears, hubs), kept

    groups = mirror_groups(n_slices)
    table, kept = made(groups)
    if mirrors(table):
        return folded(table), kept, groups
    groups = np.eye(n_slices)
    return *made(groups), groups


def back_rows(machine: Machine, sides: tuple[Side, Side]) -> FloatArray:
    """∂D/∂η of the flanks behind, (2, n_modes): along their own line of action, the bodies rigid."""
    alpha = machine.mesh.pair.working_pressure_angle_rad
    base = (machine.mesh.pair.driver.base_radius_mm * 1e-3, machine.mesh.pair.driven.base_radius_mm * 1e-3)
    rows = []
    for sign, radius, side in zip((1.0, -1.0), base, sides, strict=True):
        gear, x, y = side.shapes[1:4]
        rows.append(sign * (-radius * gear - cos(2.0 * alpha) * y + sin(2.0 * alpha) * x))
    return np.array(rows)


def mean_stiffness_n_per_m(pair: FlexiblePair, force_n: float) -> float:
    """Tangent stiffness of the sound mesh at a force, mean over a mesh cycle."""
    from dataclasses import replace

    faults: dict[str, Any] = {f"{kind}_{i}": () for kind in ("cracks", "spalls", "chips") for i in (1, 2)}
    sound = replace(pair.machine.mesh, **faults)
    torque = np.array([force_n * sound.pair.driver.base_radius_mm * 1e-3])
    table = static_table(pair.gears, sound)
    return float(mesh_maps(pair.gears, sound, torque, table=table).tangent_stiffness_n_per_m.mean())


def _padded(sides: list[Side]) -> tuple[Side, Side]:
    """Both sides with the same numbers of single, paired and silent modes; what is added never moves."""
    single, pairs = (max(getattr(s, name) for s in sides) for name in ("n_single", "n_pairs"))
    silent = max(s.n_modes - s.n_single - 2 * s.n_pairs for s in sides)
    first, second = (_pad(s, single, pairs, silent) for s in sides)
    return first, second


def _pad(side: Side, single: int, pairs: int, silent: int) -> Side:
    n = single + 2 * pairs + silent
    places = [*range(side.n_single)]
    for kind in range(2):
        places += range(single + kind * pairs, single + kind * pairs + side.n_pairs)
    n_silent = side.n_modes - side.n_single - 2 * side.n_pairs
    n_rows = len(places)
    places += range(single + 2 * pairs, single + 2 * pairs + n_silent)

    def wider(values: FloatArray, size: int, fill: float = 0.0) -> FloatArray:
        out = np.full((*values.shape[:-1], size), fill)
        out[..., places[: values.shape[-1]]] = values
        return out

    assert side.rows.shape[-1] == n_rows  # noqa: S101 - by construction
    return Side(
        wider(side.omega_rad_s, n, 1.0),
        wider(side.damping_rate, n, 1.0),
        wider(side.shapes, n),
        wider(side.inputs, n),
        wider(side.hub, n),
        wider(side.rows, single + 2 * pairs),
        wider(side.rigid, n),
        np.concatenate((side.diameters, np.zeros(pairs - side.n_pairs))),
        single,
        pairs,
    )
