"""Maps of loaded contact over mesh angle and torque: stiffness, load sharing, static transmission error."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError, RefusalError
from sims.mesh import GearMesh, one_mesh_cycle
from sims.reduced_fe._contact import (
    ContactTable,
    back_substituted,
    fill_compliance,
    near_pairs,
    solve_contacts,
    static_table,
)
from sims.reduced_fe._reduced_gear import ReducedGear

SMALL_PART = 1e-4
"""Of the greatest load on a slice: below it the local contact is straight."""
TORQUES_NM = tuple(float(t) for t in np.linspace(10.0, 500.0, 50))
"""Of the maps where none are given."""


@dataclass(frozen=True)
class MeshMaps:
    """Loaded contact over mesh angle and torque on the driver.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
        c = z1 θ1/2π; pair k enters at c = k.
    torque_nm : array, (n_t,)
        Ascending.
    transmission_error_m : array, (n_c, n_t)
        Static transmission error δ = r_b1 θ1 − r_b2 θ2 of the hubs, 0 for unloaded perfect flanks.
    force_n : array, (n_c, n_t, n_slots, n_slices)
        N ≥ 0; slot j is the pair ⌊c − start⌋ − j, see `pair_forces_n`.
    tangent_n_per_m : array, (n_c, n_t, n_slots, n_slices)
        dN/dδ of each slice as the hubs turn on.
    separation_m : array, (n_c, n_slots)
        Of unloaded flanks, without the lead of the slices.

    Notes
    -----
    *Secant* stiffness is N/δ or N/(δ − E), what a linear spring under this load would have; *tangent* stiffness is
    dN/dδ, what a small vibration about this load meets. Contact stiffens with the load and corners take part, so that
    the tangent is the greater.
    """

    mesh_cycles: FloatArray
    torque_nm: FloatArray
    transmission_error_m: FloatArray
    force_n: FloatArray
    tangent_n_per_m: FloatArray
    separation_m: FloatArray

    @property
    def pair_forces_n(self) -> FloatArray:
        """Force of each pair, (n_c, n_t, n_slots)."""
        total: FloatArray = self.force_n.sum(axis=3)
        return total

    @property
    def load_sharing(self) -> FloatArray:
        """Part of the load that each pair carries, (n_c, n_t, n_slots)."""
        pairs = self.pair_forces_n
        result: FloatArray = pairs / pairs.sum(axis=2, keepdims=True)
        return result

    @property
    def contact_tangent_n_per_m(self) -> FloatArray:
        """dN_k/dδ of each pair, (n_c, n_t, n_slots): what its neighbours carry counts, as they bend the same body."""
        total: FloatArray = self.tangent_n_per_m.sum(axis=3)
        return total

    @property
    def contact_secant_n_per_m(self) -> FloatArray:
        """N_k/(δ − E_k) of each pair, (n_c, n_t, n_slots), 0 where it does not touch."""
        depth = self.transmission_error_m[:, :, None] - self.separation_m[:, None, :]
        pairs = self.pair_forces_n
        return np.divide(pairs, depth, out=np.zeros_like(pairs), where=pairs > 0.0)

    @property
    def tangent_stiffness_n_per_m(self) -> FloatArray:
        """Time-varying mesh stiffness dF/dδ, (n_c, n_t)."""
        total: FloatArray = self.contact_tangent_n_per_m.sum(axis=2)
        return total

    @property
    def secant_stiffness_n_per_m(self) -> FloatArray:
        """Time-varying mesh stiffness F/δ, (n_c, n_t)."""
        result: FloatArray = self.pair_forces_n.sum(axis=2) / self.transmission_error_m
        return result


@dataclass(frozen=True)
class ForceMap:
    """Force over mesh angle and approach, F(z, δ), and its derivative.

    Parameters
    ----------
    mesh_cycles : array, (n_c,)
    approach_m : array, (n_d,)
    force_n, tangent_n_per_m : arrays, (n_c, n_d)
        Of all pairs together.
    """

    mesh_cycles: FloatArray
    approach_m: FloatArray
    force_n: FloatArray
    tangent_n_per_m: FloatArray


def mesh_maps(
    gears: tuple[ReducedGear, ReducedGear],
    mesh: GearMesh,
    torque_nm: FloatArray | None = None,
    mesh_cycles: FloatArray | None = None,
    *,
    support: str = "hub_held",
    lead_um: float = 0.0,
    table: ContactTable | None = None,
) -> MeshMaps:
    """Solve the loaded contact over mesh angle and torque.

    Σ N = T1/r_b1,  δ − E_i = Σ_j C_ij N_j + B N_i^0.9 where points touch, N_i = 0 where they do not

    Parameters
    ----------
    gears : (ReducedGear, ReducedGear)
        Driver, driven gear.
    mesh : GearMesh
        Geometry, faults and deviations.
    torque_nm : array or None
        On the driver, above 0, ascending; None: 10 to 500 N m.
    mesh_cycles : array or None
        None: 200 points of one cycle. With faulty teeth or pitch deviations give a revolution.
    support : str
        How the bodies are held, see `ReducedGear.compliance_m_per_n`.
    lead_um : float
        Misalignment over the face.
    table : ContactTable or None
        Where it is at hand.

    Raises
    ------
    RefusalError
        If no contact is found: an approach beyond what corners can follow.

    Notes
    -----
    No friction; contact stays on the line of action, also where a corner touches; the axes do not yield.
    """
    torques = frozen_array(TORQUES_NM if torque_nm is None else torque_nm, "torque_nm", ndim=1)
    if len(torques) == 0 or torques[0] <= 0.0 or np.any(np.diff(torques) <= 0.0):
        raise InputError("torques that do not ascend from above 0", where="torque_nm", allowed="ascending, above 0 N m")
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    table = static_table(gears, mesh, lead_um=lead_um, support=support) if table is None else table
    loads = torques / (mesh.pair.driver.base_radius_mm * 1e-3)
    delta, force, tangent = _solved(table, mesh, cycles, loads, by_force=True)
    return MeshMaps(cycles, torques, delta, force, tangent, _separations(table, mesh, cycles))


def force_map(
    table: ContactTable, mesh: GearMesh, approach_m: FloatArray, mesh_cycles: FloatArray | None = None
) -> ForceMap:
    """Tabulate F(z, δ) and dF/dδ.

    Parameters
    ----------
    table : ContactTable
        E.g. of `static_table`.
    mesh : GearMesh
    approach_m : array
        δ, ascending.
    mesh_cycles : array or None
        None: 200 points of one cycle.
    """
    approach = frozen_array(approach_m, "approach_m", ndim=1)
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    total, _, tangent = _solved(table, mesh, cycles, approach, by_force=False)
    return ForceMap(cycles, approach, total, tangent.sum(axis=(2, 3)))


def _solved(
    table: ContactTable, mesh: GearMesh, cycles: FloatArray, loads: FloatArray, *, by_force: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:

    shape = (len(cycles), len(loads))
    delta = np.zeros(shape)
    force, tangent = (np.zeros((*shape, table.n_slots, table.n_slices)) for _ in range(2))
    greatest = float(loads[-1]) if by_force else max(float(loads[-1]), 1e-6) * 3e8
    found = loaded_contact(
        np.ascontiguousarray(cycles, dtype=np.float64),
        np.ascontiguousarray(loads, dtype=np.float64),
        by_force,
        table.start,
        table.step,
        teeth_of(mesh),
        SMALL_PART * greatest / table.n_slices,
        table.n_slots,
        table.arrays,
        delta,
        force,
        tangent,
    )
    if not found:
        raise RefusalError("no equilibrium of the tooth contact was found", remedy="look at loads and separations")
    return delta, force, tangent


def teeth_of(mesh: GearMesh) -> FloatArray:
    """(z1, z2) as kernels take them."""
    return np.array([mesh.pair.driver.teeth, mesh.pair.driven.teeth], dtype=np.float64)


def _separations(table: ContactTable, mesh: GearMesh, cycles: FloatArray) -> FloatArray:
    """Separation of the pair in each slot, (n_c, n_slots); infinite where it is beyond the table."""
    newest = np.floor(cycles - table.start)
    apart = np.full((len(cycles), table.n_slots), np.inf)
    for slot in range(table.n_slots):
        pair = newest - slot
        progress = cycles - pair
        inside = progress <= table.progress[-1]
        one, two = (np.mod(pair[inside], z).astype(int) for z in teeth_of(mesh))
        total = table.pitch_1_m[one] + table.pitch_2_m[two]
        for i, (a, b) in enumerate(zip(table.surface_1[one], table.surface_2[two], strict=True)):
            whole = table.corner_m + table.separation_1_m[a] + table.separation_2_m[b]
            total[i] += np.interp(progress[inside][i], table.progress, whole)
        apart[inside, slot] = total
    return apart


class ContactState(NamedTuple):
    """Points of the pairs near contact, slices of a pair one after the other; see `contact_state`.

    Attributes
    ----------
    force_n : array, (n,)
    compliance : array, (n, n)
        R, with h'(N) on the diagonal of the points that touch.
    pair, column, part : arrays, (n,)
        Number of the pair, and its place in the table.
    """

    force_n: FloatArray
    compliance: FloatArray
    pair: FloatArray
    column: NDArray[np.int64]
    part: FloatArray


def contact_state(table: ContactTable, mesh: GearMesh, force_n: float, mesh_cycles: float) -> ContactState:
    """Solve the contact at one mesh angle and return what a linear model about it needs."""
    from sims.reduced_fe._contact import fill_compliance, near_pairs

    own, cross, corner, extra, separation, rows, pitch, _, hertz = table.arrays
    slots, n_s = table.n_slots, table.n_slices
    pairs, parts, apart, slope = (np.zeros(slots) for _ in range(4))
    columns = np.zeros(slots, dtype=np.int64)
    at, teeth = float(mesh_cycles), teeth_of(mesh)
    near = (at, table.start, table.step, corner, separation, rows, pitch, teeth, 1e9)
    n = near_pairs(*near, pairs, columns, parts, apart, slope)
    r = np.zeros((slots * n_s, slots * n_s))
    fill_compliance(n, pairs, columns, parts, teeth, own, cross, extra, rows, r)
    _, force, _ = _solved(table, mesh, np.array([at]), np.array([force_n]), by_force=True)
    carried = force[0, 0, :n].ravel()
    small = SMALL_PART * force_n / n_s
    slope_h = np.tile(hertz, n) * np.where(carried > small, 0.9, 1.0) * np.maximum(carried, small) ** -0.1
    return ContactState(
        carried,
        r[: n * n_s, : n * n_s] + np.diag(slope_h),
        np.repeat(pairs[:n], n_s),
        np.repeat(columns[:n], n_s),
        np.repeat(parts[:n], n_s),
    )


# --------------------
# Compiled: loaded contact at given mesh angles, for a given force or a given approach.
# --------------------


ENOUGH = 1e-10
"""Of the load: change of a force at which the solution counts as found."""


@njit(cache=True, nogil=True, error_model="numpy")
def loaded_contact(  # noqa: PLR0912  one search, its cases beside each other
    cycles, loads, by_force, start, step, teeth, small, n_slots, arrays, delta, force, tangent
):
    """Solve at each c and load; returns whether all were found.

    loads : (n_loads,) total force in N, or approach δ in m where `by_force` is false; ascending.
    delta : (n_c, n_loads) δ in m, or the total force.
    force, tangent : (n_c, n_loads, n_slots, n_slices) N, and dN/dδ; slot j is pair ⌊c − start⌋ − j.
    """
    own, cross, corner, extra, separation, rows, pitch, lead, hertz = arrays
    n_s = own.shape[1]
    most = n_slots * n_s
    pairs, parts = np.empty(n_slots), np.empty(n_slots)
    apart, slope = np.empty(n_slots), np.empty(n_slots)
    columns = np.empty(n_slots, dtype=np.int64)
    r, a = np.empty((most, most)), np.empty((most, most))
    approach, n_at, w, x, unit = np.empty(most), np.empty(most), np.empty(most), np.empty(most), np.empty(most)
    order = np.empty(most, dtype=np.int64)
    for row in range(cycles.shape[0]):
        n = near_pairs(
            cycles[row], start, step, corner, separation, rows, pitch, teeth, 1e9, pairs, columns, parts, apart, slope
        )
        if n <= 0:
            return False
        fill_compliance(n, pairs, columns, parts, teeth, own, cross, extra, rows, r)
        nearest = 1e9
        for p in range(n):
            nearest = min(nearest, apart[p])
        n_at[:] = 0.0
        w[:] = small**-0.1
        at = nearest
        newest = np.floor(cycles[row] - start)
        for load in range(loads.shape[0]):
            enough = ENOUGH * max(loads[load] if by_force else loads[load] * 1e8, small)
            at = at if by_force else loads[load]
            found = False
            for _ in range(100):
                for p in range(n):
                    for s in range(n_s):
                        approach[p * n_s + s] = at - apart[p] - lead[s]
                done, m = solve_contacts(r, n * n_s, approach, hertz, small, n_at, w, enough, order, a, x)
                if done < 0:
                    return False
                total, stiffness = 0.0, 0.0
                for p in range(m):
                    unit[p] = 1.0
                    total += n_at[order[p]]
                back_substituted(a, m, unit)
                for p in range(m):
                    stiffness += unit[p]
                if not by_force:
                    found = True
                    break
                missing = loads[load] - total
                if abs(missing) <= 1e-9 * loads[load]:
                    found = True
                    break
                at += missing / stiffness if m > 0 and stiffness > 0.0 else max(r[0, 0] * missing, 1e-9)
            if not found:
                return False
            delta[row, load] = at if by_force else total
            for p in range(n):
                slot = int(newest - pairs[p])
                for s in range(n_s):
                    force[row, load, slot, s] = n_at[p * n_s + s]
            for p in range(m):
                i = order[p]
                if n_at[i] > 0.0:
                    tangent[row, load, int(newest - pairs[i // n_s]), i % n_s] = unit[p]
    return True
