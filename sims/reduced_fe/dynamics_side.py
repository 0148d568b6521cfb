"""One side of the pair as modes: rotor, shaft, bearings, hub, the gear's body, and its elastic modes.

The elastic modes stay in the frame of the gear and the contact moves over them: no matrix is ever turned under a state
that stays. Modes of nodal diameter n ≥ 2 do not move the hub, so that they stand beside the shaft line's modes; those
of n = 0 twist it and are joined with them. Modes of n = 1 move the hub across the shaft, which turns against them; they
are left to the static compliance. What is not kept acts between hub and body as springs, see
`sims.reduced_fe.dynamics_hub`.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.machine import Machine
from sims.reduced_fe.contact_path import over_height, rolls_rad
from sims.reduced_fe.contact_table import FLANK, SIGNS, ContactTable
from sims.reduced_fe.dynamics_bearings import bearing_springs
from sims.reduced_fe.dynamics_hub import HubSprings
from sims.reduced_fe.reduced_gear import ReducedGear

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
"""Of a side: rad and m; "first" and "second" are its two bearings. Those of the gear are of its body as a whole,
the hub's of its bore."""
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
"""Generalised forces that act on a side besides the contact, those of bearings on the shaft in them; the last is minus
one of the whole side turning."""
LEAST_PART = 1e-3
"""Static part of a mode at the flank, of the greatest one: modes below it are left to the residual compliance."""
ABOUT_Z = 5
LEAST_HUB = 1e-4
"""Mass and inertia of a hub that has none of its own, of the body's: they let the bore move by itself."""
INERTIA_TOLERANCE = 0.02
"""Part by which a gear's total inertia may be below the finite-element body's before it is refused."""


@dataclass(frozen=True)
class Kept:
    """Elastic modes that take part in the dynamics.

    Parameters
    ----------
    single : int array
        Places of modes that stand alone (n = 0 or z/2).
    pairs : int array, (n_pairs, 2)
        Places of cosine and sine modes.
    """

    single: NDArray[np.int64]
    pairs: NDArray[np.int64]

    @property
    def all(self) -> NDArray[np.int64]:
        """Of every kept mode, ascending."""
        return np.sort(np.concatenate((self.single, self.pairs.ravel())))


@dataclass(frozen=True)
class Side:
    """Modal model of one side.

    Modes stand in the order: single ones that the contact moves, pairs (all cosine modes, then all sine modes), silent.

    Parameters
    ----------
    omega_rad_s, damping_ratio : arrays, (n_modes,)
    damping_rate : array, (n_modes,)
        2ζω; of a rigid mode too.
    shapes : array, (11, n_modes)
        `COORDINATES` in each mode.
    inputs : array, (9, n_modes)
        Modal forces of unit `INPUTS`.
    hub : array, (n_modes,)
        r_b times the hub's rotation, m.
    rows : array, (n, n_slices, n_single + 2 n_pairs)
        ∂D/∂η over ζ, seen from the tooth in contact.
    rigid : array, (n_modes,)
        ∂D/∂η of the rigid gear alone.
    diameters : array, (n_pairs,)
        n of the pairs, with the sign of the side.
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
        """Of the shaft line and the gear together."""
        return len(self.omega_rad_s)

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Modes that are the side's own, (n_modes,): not those added so that both sides have as many."""
        moves: NDArray[np.bool_] = np.any(self.shapes != 0.0, axis=0)
        moves[: self.rows.shape[2]] |= np.any(self.rows != 0.0, axis=(0, 1))
        return moves


def kept_modes(gear: ReducedGear, limit_hz: float, groups: FloatArray) -> Kept:
    """Choose the elastic modes up to a frequency that matter at the driving flank; a pair is kept or left as a whole.

    `groups`: see `sims.reduced_fe.contact_mirror`; modes that bend the face's halves against each other move no group.
    """
    flank = gear.flank_modes.reshape(gear.n_modes, *gear.grid.shape)[:, FLANK] @ (groups / groups.sum(axis=0))
    part = np.max(flank.reshape(gear.n_modes, -1) ** 2, axis=1) / gear.angular_frequencies_rad_s**2
    paired = (gear.nodal_diameters > 0) & (2 * gear.nodal_diameters < gear.blank.n_teeth)
    first = np.flatnonzero(paired)[::2]
    part[first] = part[first + 1] = np.maximum(part[first], part[first + 1])
    wanted = (gear.frequencies_hz <= limit_hz) & (part >= LEAST_PART * part.max()) & (gear.nodal_diameters != 1)
    pairs = first[wanted[first]]
    return Kept(np.flatnonzero(wanted & ~paired), np.column_stack((pairs, pairs + 1)))


def residual_compliance(gear: ReducedGear, teeth: list[int], kept: Kept) -> FloatArray:
    """Free compliance less that of the kept modes, C − Σ φφᵀ/ω²."""
    modes = np.hstack([gear.modes_at(t)[kept.all] for t in teeth]) / gear.angular_frequencies_rad_s[kept.all, None]
    rest: FloatArray = gear.compliance_m_per_n(teeth) - modes.T @ modes
    return rest


def build_side(
    machine: Machine,
    index: int,
    gear: ReducedGear,
    kept: Kept,
    table: ContactTable,
    groups: FloatArray,
    body_damping_ratio: float,
    loads_n: FloatArray,
) -> Side:
    """Return the modes of the driver's side (0) or the driven one (1); `loads_n` (4, 2) press the bearings.

    Raises
    ------
    InputError
        If the gear's total inertia or mass is below that of its finite elements.
    """
    base_m = (machine.mesh.pair.driver, machine.mesh.pair.driven)[index].base_radius_mm * 1e-3
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
    at_hub = springs.seen_from_the_line_of_action(gear, machine.mesh.pair, index, table.progress)
    up = 1.0 if index == 0 else -1.0
    rigid = up * (base_m * shapes[GEAR] + shapes[Y])
    stretched = shapes[HUB_X : HUB + 1] - shapes[[X, Y, GEAR]]
    stretched[2] -= twist[coupled] @ shapes[len(COORDINATES) :]
    rows = rigid + elastic[:, :, kept.single[coupled]] @ shapes[len(COORDINATES) :]
    rows = rows - np.einsum("nsc,sg,cj->ngj", at_hub, mean, stretched / springs.compliance[:, None])
    silent = np.max(np.abs(rows), axis=(0, 1)) < 1e-9 * np.max(np.abs(rows))
    line = [np.flatnonzero(~silent), np.flatnonzero(silent)]
    others = np.concatenate((kept.single[alone], kept.pairs[:, 0], kept.pairs[:, 1]))
    own = gear.angular_frequencies_rad_s[others]

    def joined(train: FloatArray, rest: FloatArray) -> FloatArray:
        """Modes that stand alone, pairs, silent ones; modes along the last axis."""
        return np.concatenate((train[..., line[0]], rest, train[..., line[1]]), axis=-1)

    zero = np.zeros(len(others))
    turning = np.zeros(mass.shape[0])
    turning[[ROTOR, GEAR, HUB]] = 1.0 if index == 0 else 1.0 / machine.ratio
    forces = _input_places(len(shapes), -(mass @ turning)) @ shapes
    return Side(
        omega_rad_s=joined(np.sqrt(squares), own),
        damping_rate=joined(rate, 2.0 * body_damping_ratio * own),
        shapes=joined(shapes[: len(COORDINATES)], np.zeros((len(COORDINATES), len(others)))),
        inputs=joined(forces, np.zeros((len(INPUTS), len(others)))),
        hub=joined(base_m * shapes[HUB], zero),
        rows=np.ascontiguousarray(np.concatenate((rows[:, :, line[0]], elastic[:, :, others]), axis=2)),
        rigid=joined(rigid, zero),
        diameters=SIGNS[index] * gear.nodal_diameters[kept.pairs[:, 0]].astype(np.float64),
        n_single=len(line[0]) + len(alone),
        n_pairs=len(kept.pairs),
    )


def _elastic_rows(machine: Machine, index: int, gear: ReducedGear, table: ContactTable, mean: FloatArray) -> FloatArray:
    """∂D/∂q of all elastic modes at tooth 0, (n, n_groups, n_modes): minus the push displacement."""
    roll = rolls_rad(machine.mesh.pair, table.progress)[index]
    flank = gear.flank_modes.reshape(gear.n_modes, *gear.grid.shape)[:, FLANK] @ mean
    return -over_height(gear.grid.roll_rad, np.moveaxis(flank, 0, -1), roll)


def hub_inertia(machine: Machine, index: int, gear: ReducedGear) -> tuple[float, float]:
    """Mass (kg) and moment of inertia (kg m²) that hub and shaft add to the finite-element body."""
    wheel = machine.wheels[index]
    found = []
    for what, unit, total, own in (
        ("mass", "kg", wheel.mass_kg, gear.mass_kg),
        ("inertia", "kg m^2", wheel.inertia_kg_m2, gear.polar_inertia_kg_m2),
    ):
        if total < own * (1.0 - INERTIA_TOLERANCE):
            raise InputError(
                f"{what} of the {('driver', 'driven gear')[index]} is {total:.4g} {unit}",
                allowed=f"at least {own:.4g} {unit}, that of the toothed body alone",
            )
        found.append(max(total - own, 0.0))
    return found[0], found[1]


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
    """M, K and C over `COORDINATES` and the modes that twist the hub."""
    n, n_own = len(COORDINATES) + len(modes), len(COORDINATES)
    shaft, bearings = machine.shafts[index], machine.bearings[2 * index : 2 * index + 2]
    hub_kg, hub_kg_m2 = hub_inertia(machine, index, gear)
    mass = np.eye(n)
    body = [gear.mass_kg, gear.mass_kg, gear.polar_inertia_kg_m2]
    hub = np.maximum([hub_kg, hub_kg, hub_kg_m2], LEAST_HUB * np.array(body))
    own = [shaft.rotor_inertia_kg_m2, body[2], *body[:2], *(b.mass_kg for b in bearings for _ in range(2)), *hub]
    mass[range(n_own), range(n_own)] = own
    stiffness, damping = np.zeros((n, n)), np.zeros((n, n))
    omega = gear.angular_frequencies_rad_s[modes]
    stiffness[range(n_own, n), range(n_own, n)] = omega**2
    damping[range(n_own, n), range(n_own, n)] = 2.0 * body_damping_ratio * omega
    twisted = np.zeros(n)
    twisted[[ROTOR, HUB]] = 1.0, -1.0
    lines: list[tuple[FloatArray, float, float]] = [
        (twisted, shaft.torsional_stiffness_nm_per_rad, shaft.torsional_damping_nm_s_per_rad)
    ]
    for c, place in enumerate((X, Y, GEAR)):
        inside = np.zeros(n)
        inside[[HUB_X + c, place]] = 1.0, -1.0
        if place == GEAR:
            inside[n_own:] = -twist
        own_k = float(1.0 / springs.compliance[c])
        own_c = 2.0 * body_damping_ratio * float(np.sqrt(own_k / (1.0 / hub[c] + 1.0 / body[c])))
        lines.append((inside, own_k, own_c))
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
    """Squared angular frequencies, rising, rigid ones exactly 0, and mass-normalised shapes."""
    from scipy.linalg import eigh

    squares, shapes = eigh(stiffness, mass)
    squares = np.where(squares < (2.0 * pi * 0.1) ** 2, 0.0, squares)
    return squares, shapes


def _input_places(n: int, even: FloatArray) -> FloatArray:
    """Generalised forces of unit `INPUTS`, (7, n)."""
    places = np.zeros((len(INPUTS), n))
    for row, coordinate in enumerate((ROTOR, GEAR, X, Y, 4, 5, 6, 7)):
        places[row, coordinate] = 1.0
    places[-1] = even
    return places
