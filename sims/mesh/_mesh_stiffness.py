"""Time-varying mesh stiffness, load sharing and static transmission error."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, frozen_array, positive
from gearsig.compiled import njit
from gearsig.errors import InputError
from gearsig.results import Result
from sims.mesh._faults import chip_separation_m, spall_separation_m
from sims.mesh._flank import FlankRoughness, flank_separation_m, pitch_separation_m, wear_profile
from sims.mesh._geometry import arc_length_mm, contact_ends_mm
from sims.mesh._stiffness import GearMesh


def separation_table(mesh: GearMesh, progress: FloatArray) -> tuple[ToothRows, FloatArray]:
    """Missing metal on each tooth's flank over ζ, along the line of action, and pitch deviations, (2, z), in m.

    Values are below 0 where metal protrudes. The first row of a gear is an ordinary tooth (tip relief, profile
    deviation, wear); each tooth with a damaged flank has its own row. With roughness, row i is tooth i.
    """
    rows = tooth_rows(_separation_rows(mesh, 1, progress), _separation_rows(mesh, 2, progress))
    pitch_m = np.zeros(rows.of.shape)
    for row, side in enumerate((mesh.side(1), mesh.side(2))):
        pitch_m[row, : side.gear.teeth] = pitch_separation_m(side.gear, side.flank)
    return rows, pitch_m


def _separation_rows(mesh: GearMesh, number: int, progress: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Rows of one gear, and the row index of each tooth."""
    side, rho = mesh.side(number), mesh.roll_length_mm(number, progress)
    ordinary = _ordinary(mesh, number, progress)
    n_teeth = side.gear.teeth
    if side.roughness is None:
        teeth = side.faulty_teeth
        rows = np.tile(ordinary, (1 + len(teeth), 1))
        surface = np.zeros(n_teeth, dtype=np.int64)
        surface[list(teeth)] = np.arange(1, 1 + len(teeth))
    else:
        rows = ordinary - roughness_heights_m(mesh, number, side.roughness, rho)
        surface = np.arange(n_teeth)
    for tooth in side.faulty_teeth:
        _, spall, chip = side.faults_of(tooth)
        if spall is not None:
            rows[surface[tooth]] += spall_separation_m(mesh.pair, number, spall, rho)
        if chip is not None:
            rows[surface[tooth]] += chip_separation_m(mesh.pair, number, chip, progress)
    return rows, surface


def roughness_heights_m(
    mesh: GearMesh, number: int, roughness: FlankRoughness, roll_length_mm: FloatArray
) -> FloatArray:
    """Roughness heights of all teeth of a gear, (z, n), in m, positive into the gap.

    The position on a flank is the arc length from the root end of its contact: a profile is fixed to the metal, over
    which the contact moves more slowly than along the line of action, and faster towards the tip.
    """
    gear = mesh.side(number).gear
    origin = arc_length_mm(gear, contact_ends_mm(mesh.pair, number)[0])
    place_m = (arc_length_mm(gear, roll_length_mm) - origin) * 1e-3
    return roughness.height_m(np.arange(gear.teeth)[:, None], place_m)


def _ordinary(mesh: GearMesh, number: int, progress: FloatArray) -> FloatArray:
    side, rho = mesh.side(number), mesh.pair.contact_radii_mm(progress)[number - 1]
    worn = side.flank.wear_um * 1e-6 * wear_profile(mesh.pair, number, rho)
    return flank_separation_m(side.gear, side.flank, rho) + worn


class ToothRows(NamedTuple):
    """Curves of single teeth over ζ, the driver's first, in the form that compiled code reads.

    Attributes
    ----------
    rows : array, (n_rows, n, ...)
    of : int array, (2, z)
        Row index of each tooth of the driver and of the driven gear; z is the larger number of teeth.
    n_driver : int
        Number of rows that belong to the driver.
    """

    rows: FloatArray
    of: NDArray[np.int64]
    n_driver: int

    def gear(self, number: int) -> FloatArray:
        """Rows of the driver (1) or the driven gear (2)."""
        return self.rows[: self.n_driver] if number == 1 else self.rows[self.n_driver :]


def tooth_rows(
    driver: tuple[FloatArray, NDArray[np.int64]],
    driven: tuple[FloatArray, NDArray[np.int64]],
    *,
    share_first: bool = False,
) -> ToothRows:
    """Combine both gears' rows and the row index of each tooth; `share_first`: row 0 is common to both."""
    (first, of_1), (second, of_2) = driver, driven
    of = np.zeros((2, max(len(of_1), len(of_2))), dtype=np.int64)
    of[0, : len(of_1)] = of_1
    if share_first:
        second, of_2 = second[1:], np.where(of_2 > 0, of_2 - 1, -len(first))
    of[1, : len(of_2)] = of_2 + len(first)
    return ToothRows(np.ascontiguousarray(np.concatenate((first, second))), of, len(first))


@dataclass(frozen=True)
class MeshTable(Result):
    """Compliance and separation of a tooth pair over ζ, in base pitches from its ideal entry.

    The compliance, separation and pitch deviation of a pair are the sums over its two teeth; the contact compliance is
    added to the first.

    Parameters
    ----------
    start, step : float
        ζ of the first column, and the spacing of columns; one column lies beyond either end, for cubic interpolation.
        All rows share the columns: n = `n_points` + 2.
    compliance : ToothRows
        Of tooth and foundation, m/N. The first row of a gear is a healthy tooth, each further row a faulty one.
    separation : ToothRows
        m; see `separation_table`.
    pitch_m : array, (2, z)
        Cumulative pitch deviation of each tooth; not included in `separation`.
    contact_coefficient : float
        m/N, or m/N^0.9 if `load_dependent`.
    load_dependent : bool
        Whether the approach grows with the force to the power 0.9.
    contact_ratio : float
        ε.
    ramp : float
        Base pitches over which a pair gains and loses its stiffness, centred on ζ = 0 and ζ = ε.
    n_slots : int
        Maximum number of pairs that carry load at the same time.
    teeth : (int, int)
    late, gap_m : array, (n_slices,)
        For each slice of the face: delay of its entry in base pitches, and its separation; see `Lead`. A slice has
        `n_slices` times the compliance of the whole face.
    """

    start: float
    step: float
    compliance: ToothRows
    separation: ToothRows
    pitch_m: FloatArray
    contact_coefficient: float
    load_dependent: bool
    contact_ratio: float
    ramp: float
    n_slots: int
    teeth: tuple[int, int]
    late: FloatArray
    gap_m: FloatArray

    @property
    def slice_contact(self) -> float:
        """Contact compliance of one slice, such that all slices, evenly loaded, deflect as the whole face does."""
        return float(self.contact_coefficient * len(self.late) ** (0.9 if self.load_dependent else 1.0))


def mesh_table(mesh: GearMesh, n_points: int = 512) -> MeshTable:
    """Tabulate the compliance and separation of a mesh.

    Parameters
    ----------
    mesh : GearMesh
    n_points : int
        Columns over the path of contact, ramps included. With 512 the interpolated compliance is accurate to 1e-9 and
        the roughness height to 1e-4 of its rms. At the edges of spalls and chips and at the pitch point of worn flanks
        the interpolation smooths over one or two columns.
    """
    return _tabulated(mesh, count(n_points, "n_points", minimum=16))


@lru_cache(maxsize=4)  # a run needs the table of one mesh several times, healthy and faulty
def _tabulated(mesh: GearMesh, n: int) -> MeshTable:
    low, high = -mesh.ramp / 2.0, mesh.pair.contact_ratio + mesh.ramp / 2.0
    step = (high - low) / (n - 1)
    progress = low + step * np.arange(-1, n + 1)
    separation, pitch_m = separation_table(mesh, progress)
    return MeshTable(
        start=low - step,
        step=step,
        compliance=tooth_rows(_compliance_rows(mesh, 1, progress), _compliance_rows(mesh, 2, progress)),
        separation=separation,
        pitch_m=pitch_m,
        contact_coefficient=mesh.contact_coefficient,
        load_dependent=mesh.contact_law == "load-dependent",
        contact_ratio=mesh.pair.contact_ratio,
        ramp=mesh.ramp,
        n_slots=mesh.n_slots,
        teeth=(mesh.pair.driver.teeth, mesh.pair.driven.teeth),
        late=mesh.lead.late(mesh.pair, mesh.lead.places),
        gap_m=mesh.lead.gap_m(mesh.lead.places),
    )


def _compliance_rows(mesh: GearMesh, number: int, progress: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Row 0 for healthy teeth, one row for each faulty tooth, and the row index of each tooth."""
    side = mesh.side(number)
    rows = [mesh.gear_compliance(number, progress)]
    variant = np.zeros(side.gear.teeth, dtype=np.int64)
    for row, tooth in enumerate(side.faulty_teeth, start=1):
        rows.append(mesh.gear_compliance(number, progress, side.faults_of(tooth)))
        variant[tooth] = row
    return np.array(rows), variant


@dataclass(frozen=True)
class MeshStiffness(Result):
    """Mesh stiffness along the line of action over mesh cycles.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        c; pair k enters at c = k.
    total_n_per_m : array, (n,)
        dF/dδ of all pairs together.
    pairs_n_per_m : array, (n, n_slots)
        dF/dδ of each pair; column j is pair ⌊c + ramp/2⌋ − j, 0 where it is not in contact.
    """

    mesh_cycles: FloatArray
    total_n_per_m: FloatArray
    pairs_n_per_m: FloatArray

    @property
    def mean_n_per_m(self) -> float:
        """Mean over the given points."""
        return float(np.mean(self.total_n_per_m))


@dataclass(frozen=True)
class LoadSharing(Result):
    """Load sharing and transmission error in static equilibrium over mesh cycles.

    Parameters
    ----------
    mesh_cycles : array, (n,)
    transmission_error_m : array, (n,)
        δ = r_b1 θ1 − r_b2 θ2, the driver's lead along the line of action; 0 for unloaded ideal flanks.
    pair_forces_n : array, (n, n_slots)
        N_i ≥ 0, columns as in `MeshStiffness`.
    stiffness_n_per_m : array, (n,)
        dF/dδ at this load.
    slice_forces_n : array, (n, n_slots, n_slices)
        Force on each slice of the face.
    """

    mesh_cycles: FloatArray
    transmission_error_m: FloatArray
    pair_forces_n: FloatArray
    stiffness_n_per_m: FloatArray
    slice_forces_n: FloatArray


def one_mesh_cycle(n_points: int = 200) -> FloatArray:
    """Midpoints of `n_points` equal parts of the first mesh cycle: their mean is the mean over the cycle."""
    n = count(n_points, "n_points")
    return (np.arange(n) + 0.5) / n


def mesh_stiffness(
    mesh: GearMesh, mesh_cycles: FloatArray | None = None, force_n: float | None = None
) -> MeshStiffness:
    """Stiffness of the mesh along the line of action.

    k = Σ k_i, 1/k_i = 1/k_h + Σ over both gears (1/k_b + 1/k_s + 1/k_a + 1/k_f)

    Parameters
    ----------
    mesh : GearMesh
    mesh_cycles : array or None
        c; None: 200 points of one cycle.
    force_n : float or None
        Mesh force, above 0. None: every pair on the path of contact is in contact (separations are ignored, so a chip
        or a spall over the whole face does not show); for the linear contact law only. Given: the tangent stiffness of
        the pairs that carry load at that force.

    Returns
    -------
    MeshStiffness

    Raises
    ------
    InputError
        If no force is given and the contact stiffens with the load.
    """
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    table = mesh_table(mesh)
    compliance, separation, weight = pair_states(table, cycles)
    if force_n is None:
        if table.load_dependent:
            raise InputError(
                "the contact stiffens with the load, and no load is given",
                where="force_n",
                allowed="a force above 0 N",
                remedy="give force_n or take contact_law='linear'",
            )
        pairs = _by_pair(table, weight / (compliance + table.slice_contact)).sum(axis=2)
        return MeshStiffness(cycles, pairs.sum(axis=1), pairs)
    _, _, forces = _equilibrium(table, positive(force_n, "force_n", "N"), compliance, separation, weight)
    pairs = _by_pair(table, _tangents(table, compliance, weight, forces)).sum(axis=2)
    return MeshStiffness(cycles, pairs.sum(axis=1), pairs)


def share_torque(
    mesh: GearMesh, torque_nm: float, mesh_cycles: FloatArray | None = None, *, table: MeshTable | None = None
) -> LoadSharing:
    """Static load sharing between pairs, and the transmission error, at a torque on the driver.

    Σ N_i(δ − E_i) = T1/r_b1, without friction.

    Parameters
    ----------
    mesh : GearMesh
    torque_nm : float
        T1, above 0.
    mesh_cycles : array or None
        c; None: 200 points of one cycle. With faulty teeth, pitch deviations or roughness, give a whole revolution or
        more.
    table : MeshTable or None
        The table of this mesh, if already made.
    """
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    force = positive(torque_nm, "torque_nm", "N m") / mesh.pair.base_radii_m[0]
    table = mesh_table(mesh) if table is None else table
    delta, slope, forces = _equilibrium(table, force, *pair_states(table, cycles))
    slices = _by_pair(table, forces)
    return LoadSharing(cycles, delta, slices.sum(axis=2), slope, slices)


def back_stiffness_n_per_m(mesh: GearMesh) -> float:
    """Mean mesh stiffness in back-flank contact, by the linear contact law, N/m.

    A symmetric tooth is equally stiff on both flanks, and back flanks meet along the mirrored path: the mean over a
    mesh cycle is that of healthy drive flanks. A crack on the drive side closes, and spalls are not touched. A chipped
    tip would be missing on both flanks; a constant for the whole gear neglects it, as it does roughness and wear.
    """
    smooth = replace(mesh.healthy, contact_law="linear", roughness_1=None, roughness_2=None)
    return mesh_stiffness(smooth).mean_n_per_m


def pair_states(table: MeshTable, mesh_cycles: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Compliance without contact (m/N), separation (m) and engagement (0 to 1) at each c, (n, n_slots × n_slices).

    The slices of a pair are adjacent columns.
    """
    shape = (len(mesh_cycles), table.n_slots * len(table.late))
    compliance, separation, weight = np.empty(shape), np.empty(shape), np.empty(shape)
    fill_pairs(
        np.array(mesh_cycles, dtype=np.float64),  # a copy: the kernel would be compiled again for a read-only array
        table.start,
        table.step,
        np.array(table.teeth),
        table.compliance.rows,
        table.compliance.of,
        table.separation.rows,
        table.separation.of,
        table.pitch_m,
        table.contact_ratio,
        table.ramp,
        np.array(table.late),
        np.array(table.gap_m),
        compliance,
        separation,
        weight,
    )
    return compliance, separation, weight


def _by_pair(table: MeshTable, values: FloatArray) -> FloatArray:
    """Reshape values per slice to (n, n_slots, n_slices)."""
    return values.reshape(len(values), table.n_slots, len(table.late))


def _equilibrium(
    table: MeshTable, force: float, compliance: FloatArray, separation: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:

    delta, slope, forces = np.empty(len(weight)), np.empty(len(weight)), np.empty(weight.shape)
    contact, law = table.slice_contact, table.load_dependent
    share_loads(force, compliance, separation, weight, contact, law, delta, slope, forces)
    return delta, slope, forces


def _tangents(table: MeshTable, compliance: FloatArray, weight: FloatArray, forces: FloatArray) -> FloatArray:
    """dN/dδ of each pair that carries load, 0 for the others."""
    carrying = forces > 0.0
    pair_forces = np.where(carrying, forces / np.where(weight > 0.0, weight, 1.0), 1.0)
    contact = table.slice_contact * (0.9 * pair_forces**-0.1 if table.load_dependent else 1.0)
    return np.where(carrying, weight / (compliance + contact), 0.0)


# Compiled: the load on each pair. Imported only where it is used, since it loads the compiler.


@njit(cache=True, nogil=True, error_model="numpy")
def engagement_and_slope(progress: float, late: float, contact_ratio: float, ramp: float) -> tuple[float, float]:
    """(w, ∂w/∂ζ): engaged fraction of a pair's stiffness and its slope; the pair enters `late` base pitches late.

    0 outside, 1 inside, with a quintic step of width `ramp` at each end.
    """
    if ramp <= 0.0:
        return (1.0 if late <= progress <= contact_ratio else 0.0), 0.0
    rise, rise_slope = _smooth((progress - late) / ramp + 0.5)
    fall, fall_slope = _smooth((contact_ratio - progress) / ramp + 0.5)
    return rise * fall, (rise_slope * fall - rise * fall_slope) / ramp


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth(t: float) -> tuple[float, float]:
    """6t⁵ − 15t⁴ + 10t³ between 0 and 1, with two continuous derivatives, and its slope."""
    if t <= 0.0:
        return 0.0, 0.0
    if t >= 1.0:
        return 1.0, 0.0
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0), 30.0 * t * t * (t - 1.0) * (t - 1.0)


MAX_CYCLES = 1e12
"""Mesh cycles beyond which a run has diverged; up to there, single cycles are resolved to 1e-4."""


@njit(cache=True, nogil=True, error_model="numpy")  # type: ignore[untyped-decorator,unused-ignore]
def out_of_place(cycles, middle, teeth, pitch):  # type: ignore[no-untyped-def]
    """Pitch deviation of the pair in mid-engagement, m, and its slope per base pitch; it applies to both flanks.

    As the drive flanks are further apart, the back flanks are nearer by the same amount; smooth between pairs.

    cycles : base pitches; middle : of a pair's engagement, from its entry.
    teeth : (z1, z2); pitch : (2, z), m, above 0 where a tooth is late.
    """
    if not abs(cycles) < MAX_CYCLES:  # a diverging solution, or NaN, must not be used as a tooth index
        return np.nan, np.nan
    past = np.floor(cycles - middle)
    z1, z2 = float(teeth[0]), float(teeth[1])
    coming = past + 1.0
    now = pitch[0, int(past - z1 * np.floor(past / z1))] + pitch[1, int(past - z2 * np.floor(past / z2))]
    later = pitch[0, int(coming - z1 * np.floor(coming / z1))] + pitch[1, int(coming - z2 * np.floor(coming / z2))]
    part, slope = _smooth(cycles - middle - past)
    return now + part * (later - now), slope * (later - now)


@njit(cache=True)
def cubic(row: FloatArray, start: float, step: float, progress: float) -> float:
    """Lagrange interpolation through the four nearest columns; the end cubics extrapolate beyond the table."""
    place = (progress - start) / step
    i = min(max(int(place), 1), row.size - 3)
    t = place - i
    a, b, c, d = row[i - 1], row[i], row[i + 1], row[i + 2]
    return float(
        -a * t * (t - 1.0) * (t - 2.0) / 6.0
        + b * (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0
        - c * (t + 1.0) * t * (t - 2.0) / 2.0
        + d * (t + 1.0) * t * (t - 1.0) / 6.0
    )


@njit(cache=True)
def pair_force(
    penetration: float, compliance: float, contact: float, load_dependent: bool, weight: float
) -> tuple[float, float]:
    """Force N ≥ 0 and its slope dN/dδ of one pair.

    Linear: δ = N (c + c_h).  Load-dependent: δ = c N + B N^0.9. Force and slope are times the engagement weight.

    With N = u¹⁰ the second is convex and increasing in u: Newton's method converges from above, or from below after
    one step. It starts from N^-0.1 = 1/2, the value at 1 kN. A step of 1e-8 u leaves an error of about 1e-15.
    """
    if penetration <= 0.0 or weight <= 0.0:
        return 0.0, 0.0
    if not load_dependent:
        slope = weight / (compliance + contact)
        return slope * penetration, slope
    u = (penetration / (compliance + 0.5 * contact)) ** 0.1
    for _ in range(50):
        u8 = u**8
        change = (u8 * u * (compliance * u + contact) - penetration) / (u8 * (10.0 * compliance * u + 9.0 * contact))
        u -= change
        if abs(change) <= 1e-8 * u:
            break
    return weight * u**10, weight / (compliance + 0.9 * contact / u)


@njit(cache=True)
def share_loads(
    force: float,
    compliance: FloatArray,
    separation: FloatArray,
    weight: FloatArray,
    contact: float,
    load_dependent: bool,
    approach: FloatArray,
    stiffness: FloatArray,
    pair_forces: FloatArray,
) -> None:
    """Approach δ at which the pairs' forces N_i(δ − E_i) sum to `force`, and dF/dδ, per row; fills the last three.

    The sum is convex in δ. The start, a single pair carrying the whole load, is too large, so Newton's method
    converges from above.
    """
    for row in range(approach.size):
        delta = 1e300
        for i in range(weight.shape[1]):
            if weight[row, i] > 0.0:
                n = force / weight[row, i]
                alone = compliance[row, i] * n + (contact * n**0.9 if load_dependent else contact * n)
                delta = min(delta, separation[row, i] + alone)
        slope = 0.0
        for _ in range(60):
            total, slope = -force, 0.0
            for i in range(weight.shape[1]):
                depth = delta - separation[row, i]
                n, k = pair_force(depth, compliance[row, i], contact, load_dependent, weight[row, i])
                pair_forces[row, i] = n
                total += n
                slope += k
            if abs(total) <= 1e-13 * force or slope <= 0.0:
                break
            delta -= total / slope
        approach[row], stiffness[row] = delta, slope


@njit(cache=True)
def fill_pairs(
    mesh_cycles: FloatArray,
    start: float,
    step: float,
    teeth: NDArray[np.int64],
    curves: FloatArray,
    of: NDArray[np.int64],
    flanks: FloatArray,
    flank_of: NDArray[np.int64],
    pitch: FloatArray,
    contact_ratio: float,
    ramp: float,
    late: FloatArray,
    gap: FloatArray,
    compliance: FloatArray,
    separation: FloatArray,
    weight: FloatArray,
) -> None:
    """Look up compliance, separation and weight of the slices of each pair ⌊c + ramp/2⌋ − j at each c; fills them."""
    n_slices = late.size
    for row in range(mesh_cycles.size):
        newest = int((mesh_cycles[row] + ramp / 2.0) // 1.0)
        for j in range(compliance.shape[1]):
            k, s = newest - j // n_slices, j % n_slices
            progress = mesh_cycles[row] - k - late[s]
            tooth_1, tooth_2 = k % teeth[0], k % teeth[1]
            weight[row, j] = engagement_and_slope(progress, 0.0, contact_ratio, ramp)[0]
            if weight[row, j] == 0.0 and n_slices > 1:  # possibly far beyond the table
                compliance[row, j], separation[row, j] = n_slices * curves[of[0, tooth_1], 1], 0.0
                continue
            compliance[row, j] = n_slices * (
                cubic(curves[of[0, tooth_1]], start, step, progress)
                + cubic(curves[of[1, tooth_2]], start, step, progress)
            )
            missing = cubic(flanks[flank_of[0, tooth_1]], start, step, progress) + cubic(
                flanks[flank_of[1, tooth_2]], start, step, progress
            )
            separation[row, j] = missing + pitch[0, tooth_1] + pitch[1, tooth_2] + gap[s]
