"""The flexible pair as plain numbers for compiled code."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import cos, pi, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, positive, within
from gearsig.errors import InputError
from sims.fe_gear import ReducedGear, one_thread
from sims.gear_pair import (
    BEARING_FIELDS,
    FRICTION_FIELDS,
    MACHINE_FIELDS,
    bearing_fields,
    bearing_loads_n,
    friction_fields,
    machine_fields,
)
from sims.machine import BearingSupport, Machine, Operation
from sims.mesh import GearMesh, one_mesh_cycle
from sims.reduced_fe._contact import (
    FLANK,
    SIGNS,
    ContactTable,
    MeshMaps,
    contact_state,
    contact_table,
    folded,
    mesh_maps,
    mirror_groups,
    mirrors,
    over_height,
    rolls_rad,
    slice_progress,
    static_table,
    teeth_of,
)

# Rolling-element bearings as springs about their static load: softer across it, with moving feet.
#
# A bearing with clearance c, pressed to one side by its load by δ = Q/k, has its stiffness k along the load, but only
# k δ/(c + δ) across it, as the shaft may roll along the race. Passing rolling elements move the spring's foot: it sinks
# over a spall, and moves with element passage where there is clearance (see `sims.gear_pair`). Their load is that of
# the present torque, without vibration; a load that lets the shaft lift is rejected.

ROLLING_FIELDS: list[tuple[str, type, tuple[int, ...]]] = [
    *BEARING_FIELDS,
    ("bearing_yield", np.float64, (4, 2)),  # deflection at the nominal torque, m
    ("bearing_play", np.float64, (4, 2)),  # clearance towards the load, m
    ("bearing_spring", np.float64, (4, 2, 2)),
]
"""Fields of the kernel's record, one entry per bearing."""


class Spring(NamedTuple):
    """A stiffness in one direction."""

    direction: FloatArray
    n_per_m: float


def bearing_springs(support: BearingSupport, load_n: FloatArray) -> tuple[Spring, Spring]:
    """Return a bearing's springs: along x and y, or, with clearance, along and across its load."""
    k, clearance, load = support.stiffness_n_per_m, support.clearance_um * 1e-6, float(np.hypot(*load_n))
    if clearance == 0.0:
        return Spring(np.array([1.0, 0.0]), k), Spring(np.array([0.0, 1.0]), k)
    along = load_n / load
    yielded = load / k
    return Spring(along, k), Spring(np.array([-along[1], along[0]]), k * yielded / (clearance + yielded))


def rolling_fields(
    machine: Machine, operation: Operation, force_n: float, loads_n: FloatArray, rng: np.random.Generator
) -> dict[str, Any]:
    """Values of `ROLLING_FIELDS` at the set mesh force; draws the elements' positions in the cage.

    Raises
    ------
    InputError
        If a bearing with clearance is not always loaded.
    """
    _check_load(machine, operation)
    springs = np.zeros((4, 2, 2))
    yield_m, play = np.zeros((4, 2)), np.zeros((4, 2))
    for row, (support, load) in enumerate(zip(machine.bearings, loads_n, strict=True)):
        for spring in bearing_springs(support, load):
            springs[row] += spring.n_per_m * np.outer(spring.direction, spring.direction)
        yield_m[row] = load / support.stiffness_n_per_m
        if support.clearance_um > 0.0:
            play[row] = support.clearance_um * 1e-6 * load / np.hypot(*load)
    fields = {"bearing_yield": yield_m, "bearing_play": play, "bearing_spring": springs}
    return bearing_fields(machine, force_n, rng) | fields


def _check_load(machine: Machine, operation: Operation) -> None:
    smallest_nm = float(np.min(operation.torque_nm.values))
    if any(b.law == "hertzian" for b in machine.bearings):
        raise InputError(
            "bearings of flexible gears are springs about their load",
            where="bearing_law",
            allowed="linear",
            remedy="take the model 'cracked'",
        )
    loose = next((b for b in machine.bearings if b.clearance_um > 0.0), None)
    if loose is not None and smallest_nm <= 0.0:
        raise InputError(
            f"torque_nm falls to {smallest_nm:g} N m and {loose.bearing.name!r} has clearance: "
            "the shaft would lift in it",
            where="clearance_um",
            allowed="a torque always above 0, or no clearance",
            remedy="take the model 'cracked', whose bearings let the shaft lift",
        )


# The elastic connection between a gear's body and its hub, which carries shaft, bearings and hub inertia.

PLANE = (0, 1, 5)
"""Indices of the hub's motions in the gear's plane: along x, along y, about z."""


@dataclass(frozen=True)
class HubSprings:
    """Residual elastic motion between body, hub and flanks, besides the kept modes, in the frame of the gear.

    A force F on the hub and pushes N move the hub by H F + Sᵀ N relative to the body and its modes. If the hub's
    position is given instead, F = (u_hub − u_body − ψᵀq − SᵀN)/H: springs 1/H, through which the flanks move with S/H
    and are stiffer by S Sᵀ/H. By symmetry H is diagonal, and equal along x and y.

    Parameters
    ----------
    compliance : array, (3,)
        H along x, along y (m/N) and about z (rad/(N m)).
    flank : array, (3, n_points)
        S: motion of the hub for a unit push at tooth 0.
    """

    compliance: FloatArray
    flank: FloatArray

    @classmethod
    def of(cls, gear: ReducedGear, kept: NDArray[np.int64]) -> HubSprings:
        """Return those of a gear besides the kept modes, none of which may move the hub along x or y."""
        hub = gear.hub_modes[kept][:, PLANE]
        soft = hub / gear.angular_frequencies_rad_s[kept, None] ** 2
        compliance = np.diag(gear.hub_compliance)[list(PLANE)] - np.sum(soft * hub, axis=0)
        for value in compliance:
            positive(float(value), "compliance between hub and body", remedy="lower mode_limit_hz")
        return cls(compliance, gear.hub_flank_compliance[list(PLANE)] - soft.T @ gear.flank_modes[kept])

    def seen_from_the_line_of_action(
        self, gear: ReducedGear, mesh: GearMesh, index: int, progress: FloatArray
    ) -> FloatArray:
        """S over ζ in the frame of the shafts, (n, n_slices, 3): along x, along the line of action, and in rotation.

        The push is directed into the tooth: against y for the driver, along y for the driven gear.
        """
        tau = gear.grid.roll_rad
        load = tau - gear.blank.geometry.base_half_angle_rad
        up = float(SIGNS[index])
        y = np.array([-np.sin(load), -np.cos(load)]) * up
        x = np.array([y[1], -y[0]])
        at = self.flank.reshape(3, *gear.grid.shape)[:, FLANK]
        axes = [np.einsum("ch,chs->hs", axis, at[:2]) for axis in (x, y)]
        turned = np.stack([*axes, -up * at[2]], axis=-1)
        return over_height(tau, turned, slice_rolls_rad(gear, mesh, index, progress))


def slice_rolls_rad(gear: ReducedGear, mesh: GearMesh, index: int, progress: FloatArray) -> FloatArray:
    """Roll angles of the slices on one gear, (n, n_slices)."""
    return rolls_rad(mesh.pair, slice_progress(mesh.pair, mesh.lead, gear.grid.z_m, progress))[index]


def without_hub(
    table: ContactTable, mesh: GearMesh, gears: tuple[ReducedGear, ReducedGear], hubs: tuple[HubSprings, HubSprings]
) -> ContactTable:
    """Return the table for given hub positions: less the motion of the flanks through the hub springs."""
    direct, cross = table.direct.copy(), table.cross.copy()
    for index, (gear, hub) in enumerate(zip(gears, hubs, strict=True)):
        of_hub = hub.seen_from_the_line_of_action(gear, mesh, index, table.progress)
        direct -= np.einsum("nsc,ntc,c->nst", of_hub, of_hub, 1.0 / hub.compliance)
        for o in range(len(cross)):
            older = hub.seen_from_the_line_of_action(gear, mesh, index, table.progress + o + 1.0)
            cross[o] -= np.einsum("nsc,ntc,c->nst", of_hub, older, 1.0 / hub.compliance)
    return replace(table, direct=direct, cross=cross)


# One side of the pair as modes: rotor, shaft, bearings, hub, the gear's body, and its elastic modes.
#
# The elastic modes stay in the frame of the gear and the contact moves over them, so that no matrix is ever rotated
# under a constant state. Modes of nodal diameter n ≥ 2 do not move the hub and are independent of the shaft line's
# modes; those of n = 0 twist it and are coupled with them. Modes of n = 1 move the hub across the shaft, which rotates
# relative to them; they are left to the static compliance. What is not kept acts as springs between hub and body, see
# `HubSprings`.

COORDINATES = (
    "rotor angle",
    "gear angle",
    "gear x",
    "gear y",
    "first x",
    "first y",
    "second x",
    "second y",
    "hub x",
    "hub y",
    "hub angle",
)
"""Coordinates of a side in rad and m; "first" and "second" are its two bearings. Those of the gear are for its body as
a whole, those of the hub for its bore."""
ROTOR, GEAR, X, Y, HUB_X, HUB = 0, 1, 2, 3, 8, 10
INPUTS = (
    "rotor torque",
    "gear torque",
    "gear x force",
    "gear y force",
    "first x force",
    "first y force",
    "second x force",
    "second y force",
    "even acceleration",
)
"""Generalised forces on a side in addition to the contact, including those of bearings on the shaft; the last is minus
that of an even rotation of the whole side."""
MIN_PART = 1e-3
"""Static contribution of a mode at the flank, relative to the largest, below which it is left to the residual
compliance."""
ABOUT_Z = 5
MIN_HUB = 1e-4
"""Minimum mass and inertia of a hub relative to the body's, so that the bore can move by itself."""
INERTIA_TOLERANCE = 0.02
"""Fraction by which a gear's total inertia may be below that of the finite-element body."""


@dataclass(frozen=True)
class RetainedModes:
    """Elastic modes that take part in the dynamics.

    Parameters
    ----------
    single : int array
        Indices of single modes (n = 0 or z/2).
    pairs : int array, (n_pairs, 2)
        Indices of cosine and sine modes.
    """

    single: NDArray[np.int64]
    pairs: NDArray[np.int64]

    @property
    def all(self) -> NDArray[np.int64]:
        """Indices of all kept modes, ascending."""
        return np.sort(np.concatenate((self.single, self.pairs.ravel())))


@dataclass(frozen=True)
class FlexibleSide:
    """Modal model of one side.

    Order of the modes: single ones excited by the contact, pairs (all cosine modes, then all sine modes), silent ones.

    Parameters
    ----------
    omega_rad_s : array, (n_modes,)
    damping_rate : array, (n_modes,)
        2ζω; also given for rigid modes.
    shapes : array, (11, n_modes)
        `COORDINATES` in each mode.
    inputs : array, (9, n_modes)
        Modal forces of unit `INPUTS`.
    hub : array, (n_modes,)
        r_b times the hub's rotation, m.
    rows : array, (n, n_slices, n_single + 2 n_pairs)
        ∂D/∂η over ζ, seen from the tooth in contact.
    rigid : array, (n_modes,)
        ∂D/∂η of the rigid gear.
    diameters : array, (n_pairs,)
        Nodal diameters n of the pairs, with the sign of the side.
    n_single, n_pairs : int
    """

    omega_rad_s: FloatArray
    damping_rate: FloatArray
    shapes: FloatArray
    inputs: FloatArray
    hub: FloatArray
    rows: FloatArray
    rigid: FloatArray
    diameters: FloatArray
    n_single: int
    n_pairs: int

    @property
    def n_modes(self) -> int:
        """Number of modes of shaft line and gear."""
        return len(self.omega_rad_s)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Whether a mode belongs to the side, (n_modes,), and is not padding to equal numbers of modes."""
        moves: NDArray[np.bool_] = np.any(self.shapes != 0.0, axis=0)
        moves[: self.rows.shape[2]] |= np.any(self.rows != 0.0, axis=(0, 1))
        return moves


def kept_modes(gear: ReducedGear, limit_hz: float, groups: FloatArray) -> RetainedModes:
    """Select the elastic modes up to a frequency that matter at the driving flank; pairs are kept or dropped together.

    `groups`: see `mirror_groups`; modes that bend the halves of the face against each other move no group.
    """
    flank = gear.flank_modes.reshape(gear.n_modes, *gear.grid.shape)[:, FLANK] @ (groups / groups.sum(axis=0))
    part = np.max(flank.reshape(gear.n_modes, -1) ** 2, axis=1) / gear.angular_frequencies_rad_s**2
    paired = (gear.nodal_diameters > 0) & (2 * gear.nodal_diameters < gear.blank.n_teeth)
    first = np.flatnonzero(paired)[::2]
    part[first] = part[first + 1] = np.maximum(part[first], part[first + 1])
    matters = (gear.frequencies_hz <= limit_hz) & (part >= MIN_PART * part.max()) & (gear.nodal_diameters != 1)
    pairs = first[matters[first]]
    return RetainedModes(np.flatnonzero(matters & ~paired), np.column_stack((pairs, pairs + 1)))


def residual_compliance(gear: ReducedGear, teeth: list[int], kept: NDArray[np.int64]) -> FloatArray:
    """Free compliance less that of the kept modes, C − Σ φφᵀ/ω², (n, n); `kept` must hold both modes of a pair."""
    modes = np.hstack([gear.modes_at(t)[kept] for t in teeth]) / gear.angular_frequencies_rad_s[kept, None]
    return gear.compliance_m_per_n(teeth) - modes.T @ modes


def build_side(
    machine: Machine,
    index: int,
    gear: ReducedGear,
    kept: RetainedModes,
    table: ContactTable,
    groups: FloatArray,
    body_damping_ratio: float,
    loads_n: FloatArray,
) -> FlexibleSide:
    """Return the modes of the driver's side (0) or the driven side (1); `loads_n` (4, 2) are the bearing loads.

    Raises
    ------
    InputError
        If the gear's total inertia or mass is below that of its finite elements.
    """
    base_m = machine.mesh.pair.base_radii_m[index]
    twist = -SIGNS[index] * gear.hub_modes[kept.single, ABOUT_Z]
    coupled = np.flatnonzero(np.abs(twist) > 0.0)
    alone = np.setdiff1d(np.arange(len(kept.single)), coupled)
    springs = HubSprings.of(gear, kept.all)
    matrices = _matrices(
        machine, index, gear, kept.single[coupled], twist[coupled], springs, body_damping_ratio, loads_n
    )
    mass, stiffness, damping = matrices
    squares, shapes = _modes_of(stiffness, mass)
    rate = np.einsum("ij,ik,kj->j", shapes, damping, shapes)
    mean = groups / groups.sum(axis=0)
    elastic = _elastic_rows(machine, index, gear, table, mean)
    at_hub = springs.seen_from_the_line_of_action(gear, machine.mesh, index, table.progress)
    up = 1.0 if index == 0 else -1.0
    rigid = up * (base_m * shapes[GEAR] + shapes[Y])
    stretched = shapes[HUB_X : HUB + 1] - shapes[[X, Y, GEAR]]
    stretched[2] -= twist[coupled] @ shapes[len(COORDINATES) :]
    rows = rigid + elastic[:, :, kept.single[coupled]] @ shapes[len(COORDINATES) :]
    rows = rows - np.einsum("nsc,sg,cj->ngj", at_hub, mean, stretched / springs.compliance[:, None])
    silent = np.max(np.abs(rows), axis=(0, 1)) < 1e-9 * np.max(np.abs(rows))
    line = [np.flatnonzero(~silent), np.flatnonzero(silent)]
    elastic_modes = np.concatenate((kept.single[alone], kept.pairs[:, 0], kept.pairs[:, 1]))
    elastic_omega = gear.angular_frequencies_rad_s[elastic_modes]

    def joined(train: FloatArray, rest: FloatArray) -> FloatArray:
        """Join single modes, pairs and silent modes along the last axis."""
        return np.concatenate((train[..., line[0]], rest, train[..., line[1]]), axis=-1)

    zero = np.zeros(len(elastic_modes))
    turning = np.zeros(mass.shape[0])
    turning[[ROTOR, GEAR, HUB]] = 1.0 if index == 0 else 1.0 / machine.ratio
    forces = _input_places(len(shapes), -(mass @ turning)) @ shapes
    return FlexibleSide(
        omega_rad_s=joined(np.sqrt(squares), elastic_omega),
        damping_rate=joined(rate, 2.0 * body_damping_ratio * elastic_omega),
        shapes=joined(shapes[: len(COORDINATES)], np.zeros((len(COORDINATES), len(elastic_modes)))),
        inputs=joined(forces, np.zeros((len(INPUTS), len(elastic_modes)))),
        hub=joined(base_m * shapes[HUB], zero),
        rows=np.ascontiguousarray(np.concatenate((rows[:, :, line[0]], elastic[:, :, elastic_modes]), axis=2)),
        rigid=joined(rigid, zero),
        diameters=SIGNS[index] * gear.nodal_diameters[kept.pairs[:, 0]].astype(np.float64),
        n_single=len(line[0]) + len(alone),
        n_pairs=len(kept.pairs),
    )


def _elastic_rows(machine: Machine, index: int, gear: ReducedGear, table: ContactTable, mean: FloatArray) -> FloatArray:
    """∂D/∂q of all elastic modes at tooth 0, (n, n_groups, n_modes): minus the displacement along the push."""
    roll = slice_rolls_rad(gear, machine.mesh, index, table.progress)
    flank = gear.flank_modes.reshape(gear.n_modes, *gear.grid.shape)[:, FLANK]
    of_slices = over_height(gear.grid.roll_rad, np.moveaxis(flank, 0, -1), roll)
    result: FloatArray = -np.einsum("nsm,sg->ngm", of_slices, mean)
    return result


def hub_inertia(machine: Machine, index: int, gear: ReducedGear) -> tuple[float, float]:
    """Mass (kg) and moment of inertia (kg m²) that hub and shaft add to the finite-element body."""
    wheel = machine.wheels[index]
    added = []
    for quantity, unit, total, of_body in (
        ("mass", "kg", wheel.mass_kg, gear.mass_kg),
        ("inertia", "kg m^2", wheel.inertia_kg_m2, gear.polar_inertia_kg_m2),
    ):
        if total < of_body * (1.0 - INERTIA_TOLERANCE):
            raise InputError(
                f"{quantity} of the {('driver', 'driven gear')[index]} is {total:.4g} {unit}",
                allowed=f"at least {of_body:.4g} {unit}, that of the toothed body alone",
            )
        added.append(max(total - of_body, 0.0))
    return added[0], added[1]


def _matrices(
    machine: Machine,
    index: int,
    gear: ReducedGear,
    modes: NDArray[np.int64],
    twist: FloatArray,
    springs: HubSprings,
    body_damping_ratio: float,
    loads_n: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """M, K and C for `COORDINATES` and the modes that twist the hub."""
    n, n_coordinates = len(COORDINATES) + len(modes), len(COORDINATES)
    shaft, bearings = machine.shafts[index], machine.bearings[2 * index : 2 * index + 2]
    hub_kg, hub_kg_m2 = hub_inertia(machine, index, gear)
    mass = np.eye(n)
    body = [gear.mass_kg, gear.mass_kg, gear.polar_inertia_kg_m2]
    hub = np.maximum([hub_kg, hub_kg, hub_kg_m2], MIN_HUB * np.array(body))
    inertias = [shaft.rotor_inertia_kg_m2, body[2], *body[:2], *(b.mass_kg for b in bearings for _ in range(2)), *hub]
    mass[range(n_coordinates), range(n_coordinates)] = inertias
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    omega = gear.angular_frequencies_rad_s[modes]
    stiffness[range(n_coordinates, n), range(n_coordinates, n)] = omega**2
    damping[range(n_coordinates, n), range(n_coordinates, n)] = 2.0 * body_damping_ratio * omega
    twisted = np.zeros(n)
    twisted[[ROTOR, HUB]] = 1.0, -1.0
    lines: list[tuple[FloatArray, float, float]] = [
        (twisted, shaft.torsional_stiffness_nm_per_rad, shaft.torsional_damping_nm_s_per_rad)
    ]
    for c, place in enumerate((X, Y, GEAR)):
        inside = np.zeros(n)
        inside[[HUB_X + c, place]] = 1.0, -1.0
        if place == GEAR:
            inside[n_coordinates:] = -twist
        spring_k = float(1.0 / springs.compliance[c])
        spring_c = 2.0 * body_damping_ratio * float(np.sqrt(spring_k / (1.0 / hub[c] + 1.0 / body[c])))
        lines.append((inside, spring_k, spring_c))
    for axis in range(2):
        bent = np.zeros(n)
        bent[[HUB_X + axis, 4 + axis, 6 + axis]] = 1.0, -0.5, -0.5
        lines.append((bent, shaft.bending_stiffness_n_per_m, shaft.bending_damping_n_s_per_m))
        for row, bearing in enumerate(bearings):
            direction, spring = bearing_springs(bearing, loads_n[2 * index + row])[axis]
            moved = np.zeros(n)
            moved[4 + 2 * row : 6 + 2 * row] = direction
            lines.append((moved, spring, bearing.damping_n_s_per_m))
    for line, spring, damper in lines:
        stiffness += spring * np.outer(line, line)
        damping += damper * np.outer(line, line)
    return mass, stiffness, damping


def _modes_of(stiffness: FloatArray, mass: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Squared angular frequencies, ascending, rigid ones exactly 0, and mass-normalised shapes."""
    from scipy.linalg import eigh

    squares, shapes = eigh(stiffness, mass)
    squares = np.where(squares < (2.0 * pi * 0.1) ** 2, 0.0, squares)
    return squares, shapes


def _input_places(n: int, even: FloatArray) -> FloatArray:
    """Generalised forces of unit `INPUTS`, (9, n)."""
    places = np.zeros((len(INPUTS), n))
    for row, coordinate in enumerate((ROTOR, GEAR, X, Y, 4, 5, 6, 7)):
        places[row, coordinate] = 1.0
    places[-1] = even
    return places


MODE_LIMIT_HZ = 20000.0
"""Elastic modes up to here are kept; the others are quasi-static."""
SMALL_PART = 1e-3
"""Fraction of the nominal force on a slice below which the local contact is linear."""
MIN_FORCE_N = 50.0
"""Minimum mesh force for which stiffness and damping are determined."""

_SCALARS = (
    "start",
    "column_step",
    "small",
    "nominal_force",
    "damping_time",
    "back_stiffness",
    "cos_back",
    "sin_back",
    "restitution",
    "nominal_torque",
)
RECORD = np.dtype(
    [(name, np.float64) for name in _SCALARS]
    + [(name, np.float64, (2,)) for name in ("teeth", "unbalance")]
    + [(name, np.bool_) for name in ("pushes", "rolls")]
    + [("n_single", np.int64), ("n_pairs", np.int64)]
    + MACHINE_FIELDS
    + FRICTION_FIELDS
    + ROLLING_FIELDS,
    align=True,
)
"""Fields in SI units; those per side in pairs (driver, driven)."""


@dataclass(frozen=True)
class FlexiblePair:
    """A machine whose gears are reduced finite elements.

    Parameters
    ----------
    machine : Machine
        Masses and inertias of its wheels are those of gear, hub and shaft together; its contact law and the gears'
        stiffness by potential energy are not used. `mesh_damping_ratio` is the total for the torsional mode: the
        contact supplies the damping that shafts, bearings and bodies lack.
    gears : (ReducedGear, ReducedGear)
    body_damping_ratio : float
        Of the elastic modes of the gears.
    restitution : float or None
        None: contact through its compliance alone. A number e: at first contact after a loss the closing speed of the
        gears is also multiplied by −e. That counts an impact twice; it serves for comparison with models that do so.
    mode_limit_hz : float
    """

    machine: Machine
    gears: tuple[ReducedGear, ReducedGear]
    body_damping_ratio: float = 0.08
    restitution: float | None = None
    mode_limit_hz: float = MODE_LIMIT_HZ

    def __post_init__(self) -> None:
        within(self.body_damping_ratio, "body_damping_ratio", 0.0, 1.0)
        if self.restitution is not None:
            within(self.restitution, "restitution", 0.0, 1.0)
        if self.machine.mesh.overlap_ratio and self.machine.lubrication.friction:
            raise InputError(
                "a helical pair of finite-element gears has no friction",
                where="friction",
                allowed="friction = off, or no helix",
                remedy="take the model 'cracked'",
            )

    def maps(self, torque_nm: FloatArray | None = None, mesh_cycles: FloatArray | None = None) -> MeshMaps:
        """Return the static contact maps of this pair."""
        return mesh_maps(self.gears, self.machine.mesh, torque_nm, mesh_cycles)


@dataclass(frozen=True)
class FlexiblePairConstants:
    """Input of compiled code; see `march`.

    Parameters
    ----------
    record : one `RECORD`
    table : ContactTable
        With the residual compliance.
    sides : (FlexibleSide, FlexibleSide)
        Padded to the same numbers of modes.
    mean_stiffness_n_per_m : float
        Tangent stiffness of the mesh at the nominal force, mean over a cycle.
    base_radius_m : array, (2,)
    """

    record: Any
    table: ContactTable
    sides: tuple[FlexibleSide, FlexibleSide]
    mean_stiffness_n_per_m: float
    base_radius_m: FloatArray

    @property
    def omega_rad_s(self) -> FloatArray:
        """Angular frequencies of all modes, (2, n_modes)."""
        return np.array([s.omega_rad_s for s in self.sides])

    def stacked(self, name: str) -> FloatArray:
        """Stack a field of both sides, driver first, as a contiguous array."""
        return np.ascontiguousarray(np.array([getattr(s, name) for s in self.sides]))

    def turn(self) -> FloatArray:
        """Cosine and sine of nψ for each tooth, (2, z, 2, n_pairs)."""
        teeth = self.record["teeth"]
        angles = np.zeros((2, int(teeth.max()), 2, self.sides[0].n_pairs))
        for index, side in enumerate(self.sides):
            angle = 2.0 * pi / teeth[index] * np.outer(np.arange(int(teeth[index])), side.diameters)
            angles[index, : len(angle), 0], angles[index, : len(angle), 1] = np.cos(angle), np.sin(angle)
        return angles


@one_thread()
def constants(
    pair: FlexiblePair, operation: Operation, *, rng: np.random.Generator | None = None
) -> FlexiblePairConstants:
    """Convert a flexible pair to plain numbers.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its maximum torque sets the scale of forces and the damping of the contact.
    rng : numpy.random.Generator or None
        Draws the positions of rolling elements in bearings with a defect; None: always the same ones.
    """
    machine, mesh = pair.machine, pair.machine.mesh
    base = np.array(mesh.pair.base_radii_m)
    force = max(operation.torque_nm.largest / base[0], MIN_FORCE_N)
    stiffness = mean_stiffness_n_per_m(pair, force)
    table, kept, groups = _contact(pair)
    loads = bearing_loads_n(machine, force)
    make = partial(
        build_side, machine, table=table, groups=groups, body_damping_ratio=pair.body_damping_ratio, loads_n=loads
    )
    sides = _padded([make(i, gear=pair.gears[i], kept=kept[i]) for i in (0, 1)])
    wheels = machine.wheels
    nominal = force / table.n_slices
    values: dict[str, Any] = {
        "start": table.start,
        "column_step": table.step,
        "small": SMALL_PART * nominal,
        "nominal_force": nominal,
        "back_stiffness": stiffness,
        "cos_back": cos(2.0 * mesh.pair.working_pressure_angle_rad),
        "sin_back": sin(2.0 * mesh.pair.working_pressure_angle_rad),
        "restitution": -1.0 if pair.restitution is None else pair.restitution,
        "teeth": teeth_of(mesh),
        "unbalance": [w.unbalance_g_mm * 1e-6 for w in wheels],
        "pushes": machine.gravity_mps2 > 0.0
        or any(s.coupling_angle_deg != 0.0 for s in machine.shafts)
        or any(w.unbalance_g_mm > 0.0 for w in wheels),
        "rolls": any(b.defect is not None or b.clearance_um > 0.0 for b in machine.bearings),
        "nominal_torque": force * base[0],
        "n_single": sides[0].n_single,
        "n_pairs": sides[0].n_pairs,
    }
    record = np.zeros((), RECORD)
    values |= machine_fields(machine) | friction_fields(machine, operation, force)
    values |= rolling_fields(machine, operation, force, loads, np.random.default_rng(0) if rng is None else rng)
    for name, value in values.items():
        record[name] = value
    made = FlexiblePairConstants(record[()], table, sides, stiffness, base)
    made.record["damping_time"] = torsional_mode(pair, operation, ready=made).damping_time_s(machine.mesh_damping_ratio)
    return made


def _contact(pair: FlexiblePair) -> tuple[ContactTable, list[RetainedModes], FloatArray]:
    """Residual contact table, the kept modes of each gear, and the groups of slices."""
    n_slices = len(pair.gears[0].grid.z_m)

    def made(groups: FloatArray) -> tuple[ContactTable, list[RetainedModes]]:
        kept = [kept_modes(gear, pair.mode_limit_hz, groups) for gear in pair.gears]

        def rest(gear: ReducedGear, teeth: list[int]) -> FloatArray:
            return residual_compliance(gear, teeth, kept[0 if gear is pair.gears[0] else 1].all)

        table = contact_table(pair.gears, pair.machine.mesh, rest)
        hubs = HubSprings.of(pair.gears[0], kept[0].all), HubSprings.of(pair.gears[1], kept[1].all)
        return without_hub(table, pair.machine.mesh, pair.gears, hubs), kept

    groups = mirror_groups(n_slices)
    table, kept = made(groups)
    if mirrors(table):
        return folded(table), kept, groups
    groups = np.eye(n_slices)
    return *made(groups), groups


def back_rows(machine: Machine, sides: tuple[FlexibleSide, FlexibleSide]) -> FloatArray:
    """∂D/∂η of the back flanks, (2, n_modes), along their own line of action, with rigid bodies."""
    alpha = machine.mesh.pair.working_pressure_angle_rad
    rows = []
    for sign, radius, side in zip((1.0, -1.0), machine.mesh.pair.base_radii_m, sides, strict=True):
        gear, x, y = side.shapes[1:4]
        rows.append(sign * (-radius * gear - cos(2.0 * alpha) * y + sin(2.0 * alpha) * x))
    return np.array(rows)


def mean_stiffness_n_per_m(pair: FlexiblePair, force_n: float) -> float:
    """Tangent stiffness of the healthy mesh at a given force, mean over a mesh cycle."""
    healthy = pair.machine.mesh.healthy
    torque = np.array([force_n * healthy.pair.driver.base_radius_mm * 1e-3])
    table = static_table(pair.gears, healthy)
    return float(mesh_maps(pair.gears, healthy, torque, table=table).tangent_stiffness_n_per_m.mean())


def _padded(sides: list[FlexibleSide]) -> tuple[FlexibleSide, FlexibleSide]:
    """Pad both sides to equal numbers of single, paired and silent modes; the padding never moves."""
    single, pairs = (max(getattr(s, name) for s in sides) for name in ("n_single", "n_pairs"))
    silent = max(s.n_modes - s.n_single - 2 * s.n_pairs for s in sides)
    first, second = (_pad(s, single, pairs, silent) for s in sides)
    return first, second


def _pad(side: FlexibleSide, single: int, pairs: int, silent: int) -> FlexibleSide:
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
    return FlexibleSide(
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


# The pair linearised about its loaded state: its undamped modes, including the torsional one.

MIN_TORSIONAL_HZ = 200.0
"""Lower modes are those of rotors on their couplings."""


@dataclass(frozen=True)
class TorsionalMode:
    """The mode with the largest relative motion of the flanks, mean over a mesh cycle.

    Parameters
    ----------
    frequency_hz : float
    contact_part : float
        Fraction of its energy in the compliance of the contact.
    other_damping_ratio : float
        ζ due to shafts, bearings and gear bodies alone.
    """

    frequency_hz: float
    contact_part: float
    other_damping_ratio: float

    def damping_time_s(self, damping_ratio: float) -> float:
        """Time τ of the contact's damping for a total damping ratio of the mode; 0 if the others already exceed it.

        2ζω = 2ζ₀ω + τ ω² · contact part
        """
        omega = 2.0 * pi * self.frequency_hz
        return max(2.0 * (damping_ratio - self.other_damping_ratio) / (omega * self.contact_part), 0.0)


def torsional_mode(
    pair: FlexiblePair, operation: Operation, *, ready: FlexiblePairConstants | None = None
) -> TorsionalMode:
    """Return the torsional mode of the pair about its loaded state, mean over 20 mesh angles of a cycle.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
        Its maximum torque loads the contact.
    ready : FlexiblePairConstants or None
        If already made.
    """
    pair_constants = constants(pair, operation) if ready is None else ready
    modes = torsional_over_cycle(pair, pair_constants, operation, one_mesh_cycle(20))
    return TorsionalMode(*(float(mean) for mean in modes.mean(axis=0)))


def torsional_over_cycle(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, mesh_cycles: FloatArray
) -> FloatArray:
    """Fields of `TorsionalMode` at each mesh angle, (n_c, 3)."""
    rates = np.concatenate([side.damping_rate for side in pair_constants.sides])
    modes = []
    for c in mesh_cycles:
        squares, shapes, rows, stiff = undamped_modes(pair, pair_constants, operation, c)
        energy = np.einsum("ij,ik,kj->j", rows @ shapes, stiff, rows @ shapes)
        part = energy / np.maximum(squares, (2.0 * pi * MIN_TORSIONAL_HZ) ** 2)
        mode = int(np.argmax(part))
        omega = float(np.sqrt(squares[mode]))
        modes.append((omega / (2.0 * pi), part[mode], float(rates @ shapes[:, mode] ** 2) / (2.0 * omega)))
    return np.array(modes)


def undamped_modes(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, cycles: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Squared angular frequencies, shapes, and the results of `contact_rows`, at one mesh angle."""
    rows, stiff = contact_rows(pair, pair_constants, operation, cycles)
    k = np.diag(np.concatenate([side.omega_rad_s for side in pair_constants.sides]) ** 2) + rows.T @ stiff @ rows
    squares, shapes = np.linalg.eigh(k)
    return squares, shapes, rows, stiff


def contact_rows(
    pair: FlexiblePair, pair_constants: FlexiblePairConstants, operation: Operation, cycles: float
) -> tuple[FloatArray, FloatArray]:
    """Return ∂D/∂η of the points in contact at the set torque, (n, n_modes), and their stiffness, (n, n)."""
    force = max(operation.torque_nm.largest / pair_constants.base_radius_m[0], MIN_FORCE_N)
    at = contact_state(pair_constants.table, pair.machine.mesh, force, cycles)
    driver, driven = pair_constants.sides
    turn, n = pair_constants.turn(), driver.n_modes
    rows = np.zeros((len(at.force_n), 2 * n))
    for point, (number, column, part) in enumerate(zip(at.pair, at.column, at.part, strict=True)):
        for index, side in enumerate((driver, driven)):
            tooth = int(number % pair_constants.record["teeth"][index])
            s = point % pair_constants.table.n_slices
            in_sector = (1.0 - part) * side.rows[column, s] + part * side.rows[column + 1, s]
            cosine, sine = turn[index, tooth]
            c, d = np.split(in_sector[side.n_single :], 2)
            full = np.concatenate((in_sector[: side.n_single], cosine * c - sine * d, sine * c + cosine * d))
            rows[point, index * n : index * n + len(full)] = full
    touching = at.force_n > 0.0
    rows = rows[touching]
    stiff: FloatArray = np.linalg.inv(at.compliance[np.ix_(touching, touching)])
    return rows, stiff
