"""Time-varying mesh stiffness, load sharing and static transmission error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.errors import InputError
from sims.mesh.gear_mesh import GearMesh
from sims.mesh.table import MeshTable, mesh_table


@dataclass(frozen=True)
class MeshStiffness:
    """Stiffness along the line of action over the mesh.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        c; pair k enters at c = k.
    total_n_per_m : array, (n,)
        dF/dδ of all pairs together.
    pairs_n_per_m : array, (n, n_slots)
        Of each pair; column j is pair ⌊c + ramp/2⌋ − j, 0 where it does not touch.
    """

    mesh_cycles: FloatArray
    total_n_per_m: FloatArray
    pairs_n_per_m: FloatArray

    @property
    def mean_n_per_m(self) -> float:
        """Mean over the given points."""
        return float(np.mean(self.total_n_per_m))


@dataclass(frozen=True)
class LoadSharing:
    """Static equilibrium over the mesh.

    Parameters
    ----------
    mesh_cycles : array, (n,)
    transmission_error_m : array, (n,)
        δ = r_b1 θ1 − r_b2 θ2: how far the driver runs ahead along the line of action; 0 for unloaded ideal flanks.
    pair_forces_n : array, (n, n_slots)
        N_i ≥ 0, columns as in `MeshStiffness`.
    stiffness_n_per_m : array, (n,)
        dF/dδ at this load.
    """

    mesh_cycles: FloatArray
    transmission_error_m: FloatArray
    pair_forces_n: FloatArray
    stiffness_n_per_m: FloatArray


def one_mesh_cycle(n_points: int = 200) -> FloatArray:
    """Middles of `n_points` equal parts of the first mesh cycle: their mean is the mean over the cycle."""
    n = count(n_points, "n_points")
    return (np.arange(n) + 0.5) / n


def mesh_stiffness(
    mesh: GearMesh,
    mesh_cycles: FloatArray | None = None,
    force_n: float | None = None,
    *,
    table: MeshTable | None = None,
) -> MeshStiffness:
    """Stiffness of the mesh along the line of action.

    k = Σ k_i, 1/k_i = 1/k_h + Σ over both gears (1/k_b + 1/k_s + 1/k_a + 1/k_f)

    Parameters
    ----------
    mesh : GearMesh
    mesh_cycles : array or None
        c; None: 200 points of one cycle.
    force_n : float or None
        Mesh force, above 0. None: every pair on the path of contact touches (separations do not count, so that a chip
        or a spall over the whole face does not show), for the linear contact law only. Given: the tangent stiffness of
        the pairs that carry at that force.
    table : MeshTable or None
        Of this mesh, if it is at hand: making one takes longer than reading it.

    Returns
    -------
    MeshStiffness

    Raises
    ------
    InputError
        Without a force if the contact stiffens with the load.
    """
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    table = mesh_table(mesh) if table is None else table
    compliance, separation, weight = pair_states(table, cycles)
    if force_n is None:
        if table.load_dependent:
            raise InputError(
                "the contact stiffens with the load, and no load is given",
                where="force_n",
                allowed="a force above 0 N",
                remedy="give force_n or take contact_law='linear'",
            )
        pairs = weight / (compliance + table.contact_coefficient)
        return MeshStiffness(cycles, pairs.sum(axis=1), pairs)
    _, _, forces = _equilibrium(table, positive(force_n, "force_n", "N"), compliance, separation, weight)
    pairs = _tangents(table, compliance, weight, forces)
    return MeshStiffness(cycles, pairs.sum(axis=1), pairs)


def share_torque(
    mesh: GearMesh, torque_nm: float, mesh_cycles: FloatArray | None = None, *, table: MeshTable | None = None
) -> LoadSharing:
    """Which pair carries how much, and the static transmission error, at a torque on the driver.

    Σ N_i(δ − E_i) = T1/r_b1, without friction.

    Parameters
    ----------
    mesh : GearMesh
    torque_nm : float
        T1, above 0.
    mesh_cycles : array or None
        c; None: 200 points of one cycle. With faulty teeth, pitch deviations or roughness give a whole revolution or
        more.
    table : MeshTable or None
        Of this mesh, if it is at hand.
    """
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    force = positive(torque_nm, "torque_nm", "N m") / (mesh.pair.driver.base_radius_mm * 1e-3)
    table = mesh_table(mesh) if table is None else table
    delta, slope, forces = _equilibrium(table, force, *pair_states(table, cycles))
    return LoadSharing(cycles, delta, forces, slope)


def back_stiffness_n_per_m(mesh: GearMesh) -> float:
    """Mean stiffness of the mesh with the back flanks pressed, by the linear contact law, N/m.

    A symmetric tooth is as stiff on either flank, and back flanks touch along the mirrored path: the mean over a mesh
    cycle is that of sound drive flanks. A crack of the drive side closes and spalls are not touched. A piece broken off
    a tip would be missing on both flanks; a constant for the whole gear leaves it out, as it does roughness and wear.
    """
    from dataclasses import replace

    faults = {"cracks_1": (), "cracks_2": (), "spalls_1": (), "spalls_2": (), "chips_1": (), "chips_2": ()}
    sound = replace(mesh, contact_law="linear", **faults)  # type: ignore[arg-type]  # all of them are tuples of faults
    return mesh_stiffness(sound).mean_n_per_m


def pair_states(table: MeshTable, mesh_cycles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compliance without contact (m/N), separation (m) and engagement (0 to 1) of the pairs at each c, (n, n_slots)."""
    from sims.mesh.load_sharing_kernel import fill_pairs

    shape = (len(mesh_cycles), table.n_slots)
    compliance, separation, weight = np.empty(shape), np.empty(shape), np.empty(shape)
    fill_pairs(
        np.ascontiguousarray(mesh_cycles, dtype=np.float64),
        table.start,
        table.step,
        table.compliance_1,
        table.compliance_2,
        table.variant_1,
        table.variant_2,
        table.separation_1_m,
        table.separation_2_m,
        table.surface_1,
        table.surface_2,
        table.pitch_1_m,
        table.pitch_2_m,
        table.contact_ratio,
        table.ramp,
        compliance,
        separation,
        weight,
    )
    return compliance, separation, weight


def _equilibrium(
    table: MeshTable, force: float, compliance: FloatArray, separation: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    from sims.mesh.load_sharing_kernel import share_loads

    delta, slope, forces = np.empty(len(weight)), np.empty(len(weight)), np.empty(weight.shape)
    contact, law = table.contact_coefficient, table.load_dependent
    share_loads(force, compliance, separation, weight, contact, law, delta, slope, forces)
    return delta, slope, forces


def _tangents(table: MeshTable, compliance: FloatArray, weight: FloatArray, forces: FloatArray) -> FloatArray:
    """dN/dδ of each pair that carries a force."""
    carrying = forces > 0.0
    own = np.where(carrying, forces / np.where(weight > 0.0, weight, 1.0), 1.0)
    contact = table.contact_coefficient * (0.9 * own**-0.1 if table.load_dependent else 1.0)
    return np.where(carrying, weight / (compliance + contact), 0.0)
