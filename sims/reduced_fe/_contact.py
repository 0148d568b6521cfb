"""The contact of two reduced gears: table over the progress of a pair, compiled solution, and static maps."""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, floor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, frozen_array
from gearsig.compiled import UNCOUNTED, njit
from gearsig.errors import InputError, RefusalError
from sims.fe_gear import ReducedGear, crack_added_m_per_n
from sims.mesh import (
    HEALTHY,
    MAX_CYCLES,
    GearMesh,
    Lead,
    PairGeometry,
    ToothRows,
    corner_separation_m,
    load_dependent_contact_coefficient,
    one_mesh_cycle,
    separation_table,
    tooth_rows,
)

# Points of contact of a tooth pair over its progress.


def rolls_rad(pair: PairGeometry, progress: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Roll angles τ of driver and driven gear at ζ, held at the ends of the path of contact.

    Before its ideal entry a pair is in contact at the driven gear's tip, after its ideal end at the driver's; the exact
    position of the corner on the mate's flank is neglected.
    """
    inside = np.clip(progress, 0.0, pair.contact_ratio)
    rho_1, rho_2 = pair.contact_radii_mm(inside)
    return rho_1 / pair.driver.base_radius_mm, rho_2 / pair.driven.base_radius_mm


def slice_progress(pair: PairGeometry, lead: Lead, z_m: FloatArray, progress: FloatArray) -> FloatArray:
    """ζ of each slice of a pair, from ζ at its first end, (n, n_slices)."""
    return progress[:, None] - lead.late(pair, z_m * 1e3 / pair.face_width_mm)


def over_height(roll: FloatArray, values: FloatArray, heights: FloatArray) -> FloatArray:
    """Interpolate values given at the roll angles of a grid (first axis) by a cubic spline, constant beyond its ends.

    Where `heights` is (n, n_slices), each slice (second axis) has its own heights.
    """
    from scipy.interpolate import CubicSpline

    if heights.ndim == 2:
        slices = [over_height(roll, values[:, s], heights[:, s]) for s in range(heights.shape[1])]
        return np.stack(slices, axis=1)
    spline = CubicSpline(roll, values, axis=0)
    return spline(np.clip(heights, roll[0], roll[-1]))


# Compliance that faulty teeth add between the slices of a tooth pair.


def fault_compliance_rows(
    gear: ReducedGear, mesh: GearMesh, side: int, progress: FloatArray
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Added compliance over ζ, (n_variants, n, n_slices, n_slices) in m/N, and the row index of each tooth.

    Row 0 belongs to healthy teeth. A crack adds the extra compliance of the cracked tooth's finite elements over those
    of the healthy one, see `crack_added_m_per_n`. A spall or chip adds compliance as in `sims.mesh.GearMesh`, the same
    in every slice.

    Notes
    -----
    A crack does not change the gear's modes here: one tooth in fifty has little effect on them.
    """
    gear_side, n_slices = mesh.side(side), len(gear.grid.z_m)
    if gear_side.faulty_teeth and mesh.overlap_ratio:
        raise InputError(
            "a faulty tooth in a helical pair of finite-element gears",
            allowed="healthy teeth, or no helix",
            remedy="take the model 'cracked'",
        )
    variant = np.zeros(gear_side.gear.teeth, dtype=np.int64)
    rows = [np.zeros((len(progress), n_slices, n_slices))]
    healthy = mesh.gear_compliance(side, progress)
    roll = rolls_rad(mesh.pair, progress)[side - 1]
    for row, tooth in enumerate(gear_side.faulty_teeth, start=1):
        faults = gear_side.faults_of(tooth)
        lost = mesh.gear_compliance(side, progress, faults._replace(crack=HEALTHY.crack)) - healthy
        added = n_slices * lost[:, None, None] * np.eye(n_slices)
        if faults.crack is not None:
            added = added + over_height(gear.grid.roll_rad, crack_added_m_per_n(gear, faults.crack), roll)
        rows.append(added)
        variant[tooth] = row
    return np.array(rows), variant


POINTS_PER_PITCH = 64
"""Columns per base pitch; an integer, so that the columns of successive pairs coincide."""
MARGIN = 20 / POINTS_PER_PITCH
"""Base pitches before the ideal entry and after the ideal end within which a loaded pair may have corner contact."""
FLANK = 0
"""Index in a `FlankGrid` of the driving flank of both gears, each seen from its own side."""
SIGNS = (-1, 1)
"""The next tooth in contact is at a smaller angle of the driver (ccw) and at a larger one of the driven gear (cw)."""

ToothCompliance = Callable[[ReducedGear, list[int]], FloatArray]
"""Compliance between the points of some teeth, as `ReducedGear.compliance_m_per_n`."""


@dataclass(frozen=True)
class ContactTable:
    """Compliance, separation and local contact of tooth pairs and slices over ζ, in base pitches from ideal entry.

    Pair k is at ζ = c − k, c = z1 θ1/2π; it consists of tooth k mod z1 and tooth k mod z2. Slices are counted from the
    end face at −z.

    Parameters
    ----------
    start, step : float
        Minimum ζ, and spacing of the columns (1/`POINTS_PER_PITCH`). One column lies beyond either end, for cubics.
    contact_ratio : float
    direct : array, (n, n_slices, n_slices)
        Compliance between the slices of a pair, both gears together, m/N.
    cross : array, (n_offsets, n, n_slices, n_slices)
        Between a pair at ζ (first slice) and the pair that entered o + 1 pitches earlier (second), m/N.
    corner_m : array, (n, n_slices)
        Separation of unloaded perfect flanks, with crowning and misalignment.
    extra : ToothRows, (n_rows, n, n_slices, n_slices)
        Compliance added by faulty teeth between their slices; row 0, of healthy teeth of both gears, is 0.
    separation : ToothRows, (n_rows, n, n_slices)
    pitch_m : array, (2, z)
        See `sims.mesh.separation_table`.
    hertz : array, (n_slices,)
        B of a slice, h = B N^0.9, m/N^0.9.
    """

    start: float
    step: float
    contact_ratio: float
    direct: FloatArray
    cross: FloatArray
    corner_m: FloatArray
    extra: ToothRows
    separation: ToothRows
    pitch_m: FloatArray
    hertz: FloatArray

    @property
    def progress(self) -> FloatArray:
        """ζ of the columns, (n,)."""
        return self.start + self.step * np.arange(-1, len(self.direct) - 1)

    def column(self, progress: float) -> int:
        """Index of the column nearest to ζ."""
        return round((progress - self.start) / self.step) + 1

    @property
    def n_slices(self) -> int:
        """Number of slices of the face width."""
        return int(self.direct.shape[1])

    @property
    def n_slots(self) -> int:
        """Maximum number of pairs in contact at the same time, corners included."""
        return floor((len(self.direct) - 3) * self.step) + 1

    @property
    def arrays(self) -> tuple[FloatArray | NDArray[np.int64], ...]:
        """Arrays in the order of the kernels' arguments; one of each kind for both gears, the driver's rows first."""
        of = np.vstack((self.extra.of, self.separation.of))
        extra, separation = self.extra.rows, self.separation.rows
        return self.direct, self.cross, self.corner_m, extra, separation, of, self.pitch_m, self.hertz


def contact_table(gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh, compliance: ToothCompliance) -> ContactTable:
    """Tabulate the contact of two reduced gears.

    Parameters
    ----------
    gears : (ReducedGear, ReducedGear)
        Driver and driven gear, with the same slices.
    mesh : GearMesh
        Geometry of the pair, its faults and deviations. The compliance of healthy teeth is that of the gears. With a
        helix these are spur gears of the transverse section, whose slices come into contact one after another.
    compliance : callable
        Part of each gear's compliance to use: all of it for statics, the residual besides the modes for dynamics.

    Raises
    ------
    InputError
        If the gears are not those of the mesh, or their slices differ.
    """
    check_gears(gears, mesh)
    pair, z_m = mesh.pair, gears[0].grid.z_m
    n_before = round(MARGIN * POINTS_PER_PITCH)
    n = n_before + ceil((pair.contact_ratio + mesh.overlap_ratio + MARGIN) * POINTS_PER_PITCH) + 3
    step = 1.0 / POINTS_PER_PITCH
    progress = -MARGIN + step * np.arange(-1, n - 1)
    slices_progress = slice_progress(pair, mesh.lead, z_m, progress)
    inside = np.clip(slices_progress, 0.0, pair.contact_ratio)
    direct, cross = _compliances(gears, mesh, progress, compliance)
    faults = [fault_compliance_rows(gears[side - 1], mesh, side, inside[:, 0]) for side in (1, 2)]
    tables = [separation_table(mesh, inside[:, s]) for s in (range(len(z_m)) if mesh.overlap_ratio else (0,))]
    separation, pitch_m = tables[0]
    rows = np.stack([table.rows for table, _ in tables], axis=-1)
    whole = load_dependent_contact_coefficient(mesh.material_1, mesh.material_2, mesh.face_width_m)
    return ContactTable(
        start=-MARGIN,
        step=step,
        contact_ratio=pair.contact_ratio,
        direct=direct,
        cross=cross,
        corner_m=corner_separation_m(pair, slices_progress) + mesh.lead.gap_m(z_m * 1e3 / pair.face_width_mm),
        extra=tooth_rows(*faults, share_first=True),
        separation=separation._replace(rows=np.ascontiguousarray(np.broadcast_to(rows, (*rows.shape[:2], len(z_m))))),
        pitch_m=pitch_m,
        # An evenly loaded pair deflects as the whole width does: h(N_s) = B (n N_s)^0.9.
        hertz=np.full(len(z_m), whole * len(z_m) ** 0.9),
    )


def static_table(gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh, *, support: str = "hub_held") -> ContactTable:
    """Return the table for statics: the whole elastic compliance, relative to the hubs."""

    def whole(gear: ReducedGear, teeth: list[int]) -> FloatArray:
        return gear.compliance_m_per_n(teeth, support)  # type: ignore[arg-type]  # rejected there if not allowed

    return contact_table(gears, mesh, whole)


def check_gears(gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh) -> None:
    """Reject reduced gears that are not those of the mesh."""
    for name, gear, drawn in zip(("driver", "driven"), gears, (mesh.pair.driver, mesh.pair.driven), strict=True):
        reduced = gear.blank.geometry
        if (
            replace(reduced, bore_radius_mm=None) != replace(drawn, bore_radius_mm=None)
            or reduced.bore_mm != drawn.bore_mm
        ):
            raise InputError(f"the {name}'s reduced gear is of {reduced}", where="gears", allowed=f"{drawn}")
    if len(gears[0].grid.z_m) != len(gears[1].grid.z_m) or not np.allclose(gears[0].grid.z_m, gears[1].grid.z_m):
        raise InputError("the slices of the two reduced gears differ", remedy="reduce both with the same slices")


def _compliances(
    gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh, progress: FloatArray, compliance: ToothCompliance
) -> tuple[FloatArray, FloatArray]:
    """Direct and cross compliance of both gears together; see `ContactTable`."""
    n, n_slices = len(progress), len(gears[0].grid.z_m)
    n_offsets = floor((n - 1) / POINTS_PER_PITCH)
    direct = np.zeros((n, n_slices, n_slices))
    cross = np.zeros((n_offsets, n, n_slices, n_slices))
    slices_progress = slice_progress(mesh.pair, mesh.lead, gears[0].grid.z_m, progress)
    rolls = rolls_rad(mesh.pair, slices_progress)
    for gear, sign, roll, side in zip(gears, SIGNS, rolls, (0, 1), strict=True):
        block = _between(gear, [0], compliance)
        if mesh.overlap_ratio:
            block_direct = _compliance_between(gear.grid.roll_rad, block, roll, roll)
            itself = np.einsum("hshs->hs", block)  # a slice has a single height, whatever those of the others
            block_direct[:, range(block_direct.shape[1]), range(block_direct.shape[1])] = over_height(
                gear.grid.roll_rad, itself, roll
            )
            direct += block_direct
        else:
            heights = np.arange(len(gear.grid.roll_rad))
            direct += over_height(gear.grid.roll_rad, block[heights, :, heights, :], roll[:, 0])
        for o in range(min(n_offsets, gear.n_offsets - 1)):
            older = rolls_rad(mesh.pair, slices_progress + o + 1.0)[side]
            block = _between(gear, [0, -sign * (o + 1)], compliance)
            cross[o] += _compliance_between(gear.grid.roll_rad, block, roll, older)
    return direct, cross


def _between(gear: ReducedGear, teeth: list[int], compliance: ToothCompliance) -> FloatArray:
    """Compliance between the driving flanks of the first and the last of the teeth, (heights, slices) twice."""
    n, shape = gear.grid.n_points, gear.grid.shape
    block = compliance(gear, teeth)[:n, -n:]
    return block.reshape(*shape, *shape)[FLANK, :, :, FLANK]


def _compliance_between(roll: FloatArray, block: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Compliance between slices at two heights each, (n, n_slices, n_slices)."""
    from scipy.interpolate import RectBivariateSpline

    n_slices, order = block.shape[1], min(3, len(roll) - 1)
    x, y = (np.clip(place, roll[0], roll[-1]) for place in (first, second))
    between = np.empty((*first.shape, n_slices))
    for s in range(n_slices):
        for t in range(n_slices):
            between[:, s, t] = RectBivariateSpline(roll, roll, block[:, s, :, t], kx=order, ky=order).ev(
                x[:, s], y[:, t]
            )
    return between


# Mirrored slices carry equal load if the two ends of the face do not differ; one then represents both.

ALIKE = 1e-5
"""Relative difference up to which the two halves of the face count as equal: that of the finite-element solver."""


def mirror_groups(n_slices: int) -> FloatArray:
    """Membership of slices in groups of mirrored slices, from the ends inwards, (n_slices, n_groups) of 0 and 1.

    Examples
    --------
    >>> mirror_groups(3).tolist()
    [[1.0, 0.0], [0.0, 1.0], [1.0, 0.0]]
    """
    n_groups = (n_slices + 1) // 2
    groups = np.zeros((n_slices, n_groups))
    places = np.arange(n_slices)
    groups[places, np.minimum(places, n_slices - 1 - places)] = 1.0
    return groups


def mirrors(table: ContactTable) -> bool:
    """Whether both halves of the face are equal in compliance and faults, without helix and misalignment."""
    if not np.allclose(table.corner_m, table.corner_m[:, ::-1], rtol=1e-9, atol=1e-16) or table.n_slices < 2:
        return False
    return all(
        bool(np.max(np.abs(c - c[..., ::-1, ::-1])) <= ALIKE * np.max(np.abs(table.direct)))
        for c in (table.direct, table.cross, table.extra.rows)
    )


def folded(table: ContactTable) -> ContactTable:
    """Return the table for groups of slices: the force of a group is the sum over its slices.

    N_s = F_g/|g| gives D_g = Σ_h mean_gh(R) F_h + B |g|^-0.9 F_g^0.9, which is exact.
    """
    groups = mirror_groups(table.n_slices)
    size = groups.sum(axis=0)
    mean = groups / size

    def grouped(compliance: FloatArray) -> FloatArray:
        return np.ascontiguousarray(np.einsum("sg,...st,th->...gh", mean, compliance, mean))

    return replace(
        table,
        direct=grouped(table.direct),
        cross=grouped(table.cross),
        extra=table.extra._replace(rows=grouped(table.extra.rows)),
        corner_m=table.corner_m @ mean,
        separation=table.separation._replace(rows=np.ascontiguousarray(table.separation.rows @ mean)),
        hertz=table.hertz @ mean * size**-0.9,
    )


# Compiled contact of several points on elastic bodies: which carry load, and how much.
#
# Points i at the approach D_i carry N_i ≥ 0, with D = R N + h(N) where in contact; R is the compliance of the bodies
# and h(N) = B N^0.9 the local Hertzian approach. Below the force `small` the latter is linear, h = B small^-0.1 N, so
# that an incipient contact has a finite stiffness.

FAST = {"reassoc", "contract", "nsz"}
"""Sums may be reordered for vector instructions; infinities and NaN stay valid."""
MAX_ITERATIONS = 60


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def root(force, small, guess):
    """max(N, small)^-0.1, by Newton's method from a nearby guess."""
    n = max(force, small)
    w2 = guess * guess
    w4 = w2 * w2
    off = n * w4 * w4 * w2
    if off < 0.7 or off > 1.4:
        return n**-0.1
    w = guess * (1.1 - 0.1 * off)
    w2 = w * w
    w4 = w2 * w2
    return w * (1.1 - 0.1 * n * w4 * w4 * w2)


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def factorised(a, n):
    """Overwrite the lower triangle of a symmetric positive matrix by its Cholesky factor, with 1/diagonal on it."""
    for i in range(n):
        for j in range(i):
            total = a[i, j]
            for k in range(j):
                total -= a[i, k] * a[j, k]
            a[i, j] = total * a[j, j]
        total = a[i, i]
        for k in range(i):
            total -= a[i, k] * a[i, k]
        if not total > 0.0:
            return False
        a[i, i] = 1.0 / total**0.5
    return True


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def back_substituted(a, n, x):
    """Solve with the factor of `factorised`, in place."""
    for i in range(n):
        total = x[i]
        for k in range(i):
            total -= a[i, k] * x[k]
        x[i] = total * a[i, i]
    for i in range(n - 1, -1, -1):
        total = x[i]
        for k in range(i + 1, n):
            total -= a[k, i] * x[k]
        x[i] = total * a[i, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath=FAST, **UNCOUNTED)
def solve_contacts(r, n, approach, hertz, small, force, w, enough, order, a, x):
    """Fill `force` (start values on entry) with N ≥ 0; return the iterations, or −1 if it fails, and m.

    r : (≥ n, ≥ n) compliance, symmetric.
    approach : (≥ n,) D.
    hertz : (n_s,) B of the slices; point i is of slice i mod n_s.
    w : (≥ n,) N^-0.1, updated.
    enough : maximum change of a force in the last iteration. Newton's error decreases with the square of the change, as
        h is almost linear: a change of 5 % leaves 1e-4.
    order, a, x : scratch; on return order[:m] are the points in contact and `a` the factor of R + h'(N) over them.
    """
    n_s = hertz.shape[0]
    for iteration in range(1, MAX_ITERATIONS + 1):
        m = 0
        for i in range(n):
            free = approach[i]
            for j in range(n):
                free -= r[i, j] * force[j]
            if force[i] > 0.0 or free > 0.0:
                w[i] = root(force[i], small, w[i])
                order[m] = i
                x[m] = free - hertz[i % n_s] * w[i] * force[i]
                m += 1
        for p in range(m):
            i = order[p]
            for s in range(p):
                a[p, s] = r[i, order[s]]
            a[p, p] = r[i, i] + (0.9 if force[i] > small else 1.0) * hertz[i % n_s] * w[i]
        if not factorised(a, m):
            return -1, m
        back_substituted(a, m, x)
        largest, let_go = 0.0, False
        for p in range(m):
            i = order[p]
            change = x[p]
            if force[i] + change < 0.0:
                change, let_go = -force[i], let_go or force[i] > 0.0
            force[i] += change
            largest = max(largest, abs(change))
        if largest <= enough and not let_go:
            return iteration, m
        if not largest < 1e30:
            return -1, m
    return -1, 0


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def hertz_energy(force, hertz, small):
    """Energy of the local approach, ∫ N dh, in J."""
    if force <= small:
        return 0.5 * hertz * small**-0.1 * force * force
    upper = hertz * 0.9 / 1.9 * (force**1.9 - small**1.9)
    return 0.5 * hertz * small**1.9 + upper


# Compiled: which tooth pairs are near contact, how far apart their flanks are, how compliant their points.


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def place_of(pair, n):
    """Remainder of a pair's number by n, e.g. by the teeth of a gear; in floats it is much faster than in integers."""
    return int(pair - n * np.floor(pair / n))


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def near_pairs(cycles, start, step, corner, separation, rows, pitch, teeth, reach, pairs, columns, parts, apart, slope):
    """Find the pairs whose flanks are less than `reach` apart; return their number.

    corner, separation, rows, pitch : see `ContactTable.arrays`.
    teeth : (z1, z2), as floats.
    pairs : (n_slots,) filled with the pairs' numbers k, the newest first.
    start, step : see `ContactTable`.
    columns, parts : column i of the table and part t of a step beyond it.
    apart, slope : (n_slots, n_slices) separation of the slices in m, and its change per base pitch.
    """
    if not abs(cycles) < MAX_CYCLES:
        return -1
    n, last = 0, corner.shape[0] - 3
    newest = np.floor(cycles - start)
    for slot in range(pairs.shape[0]):
        pair = newest - slot
        place = (cycles - pair - start) / step
        i = int(place) + 1  # one column is before the start
        if i > last:
            break
        t = place - int(place)
        tooth_1, tooth_2 = place_of(pair, teeth[0]), place_of(pair, teeth[1])
        a, b = rows[2, tooth_1], rows[3, tooth_2]
        nearest = reach
        for s in range(corner.shape[1]):
            e0 = corner[i - 1, s] + separation[a, i - 1, s] + separation[b, i - 1, s]
            e1 = corner[i, s] + separation[a, i, s] + separation[b, i, s]
            e2 = corner[i + 1, s] + separation[a, i + 1, s] + separation[b, i + 1, s]
            e3 = corner[i + 2, s] + separation[a, i + 2, s] + separation[b, i + 2, s]
            # The cubic with slopes (e2 − e0)/2 and (e3 − e1)/2: continuous slopes, as needed for the contact's damping.
            c1, c2, c3 = 0.5 * (e2 - e0), e0 - 2.5 * e1 + 2.0 * e2 - 0.5 * e3, 1.5 * (e1 - e2) + 0.5 * (e3 - e0)
            separation_m = e1 + t * (c1 + t * (c2 + t * c3)) + pitch[0, tooth_1] + pitch[1, tooth_2]
            apart[n, s], slope[n, s] = separation_m, (c1 + t * (2.0 * c2 + t * 3.0 * c3)) / step
            nearest = min(nearest, separation_m)
        if nearest < reach:
            pairs[n], columns[n], parts[n] = pair, i, t
            n += 1
    return n


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def fill_compliance(n, pairs, columns, parts, teeth, direct, cross, extra, rows, r):
    """Fill r[p·n_s + s, q·n_s + t] with the compliance between slices of the near pairs; both triangles."""
    n_s = direct.shape[1]
    for p in range(n):
        i, t = columns[p], parts[p]
        pair = pairs[p]
        tooth_1, tooth_2 = place_of(pair, teeth[0]), place_of(pair, teeth[1])
        a, b = rows[0, tooth_1], rows[1, tooth_2]
        at = p * n_s
        for s in range(n_s):
            for u in range(n_s):
                r[at + s, at + u] = direct[i, s, u] + t * (direct[i + 1, s, u] - direct[i, s, u])
        for row in (a, b):
            if row > 0:  # a faulty tooth
                for s in range(n_s):
                    for u in range(n_s):
                        low, high = extra[row, i, s, u], extra[row, i + 1, s, u]
                        r[at + s, at + u] += low + t * (high - low)
        for q in range(p + 1, n):  # the older pairs
            o = int(pair - pairs[q]) - 1
            for s in range(n_s):
                for u in range(n_s):
                    value = 0.0
                    if o < cross.shape[0]:
                        value = cross[o, i, s, u] + t * (cross[o, i + 1, s, u] - cross[o, i, s, u])
                    r[at + s, q * n_s + u] = value
                    r[q * n_s + u, at + s] = value


@njit(cache=True, nogil=True, error_model="numpy", **UNCOUNTED)
def compliance_slope_energy(n, pairs, columns, teeth, direct, cross, extra, rows, step, force):
    """½ Nᵀ (∂R/∂ζ) N of the near pairs, in J per base pitch."""
    n_s, total = direct.shape[1], 0.0
    for p in range(n):
        i, pair, at = columns[p], pairs[p], p * direct.shape[1]
        tooth_1, tooth_2 = place_of(pair, teeth[0]), place_of(pair, teeth[1])
        a, b = rows[0, tooth_1], rows[1, tooth_2]
        for s in range(n_s):
            line = 0.0
            for u in range(n_s):
                line += (direct[i + 1, s, u] - direct[i, s, u]) * force[at + u]
            for row in (a, b):
                if row > 0:
                    for u in range(n_s):
                        line += (extra[row, i + 1, s, u] - extra[row, i, s, u]) * force[at + u]
            for q in range(p + 1, n):
                o = int(pair - pairs[q]) - 1
                if o < cross.shape[0]:
                    for u in range(n_s):
                        line += 2.0 * (cross[o, i + 1, s, u] - cross[o, i, s, u]) * force[q * n_s + u]
            total += 0.5 * line * force[at + s]
    return total / step


SMALL_PART = 1e-4
"""Fraction of the maximum load on a slice below which the local contact is linear."""
TORQUES_NM = tuple(float(t) for t in np.linspace(10.0, 500.0, 50))
"""Default torques of the maps."""


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
        dN/dδ of each slice as the hubs turn.
    separation_m : array, (n_c, n_slots)
        Of unloaded flanks, minimum along the face.

    Notes
    -----
    *Secant* stiffness is N/δ or N/(δ − E), that of a linear spring under this load; *tangent* stiffness is dN/dδ, that
    for a small vibration about this load. Contact stiffens with the load and corners contribute, so the tangent
    stiffness is the larger.
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
    def pair_numbers(self) -> FloatArray:
        """Number k of the pair in each slot, (n_c, n_slots): it entered at c = k."""
        newest = np.floor(self.mesh_cycles + MARGIN)
        numbers: FloatArray = newest[:, None] - np.arange(self.force_n.shape[2])
        return numbers

    @property
    def load_sharing(self) -> FloatArray:
        """Fraction of the load on each pair, (n_c, n_t, n_slots)."""
        pairs = self.pair_forces_n
        result: FloatArray = pairs / pairs.sum(axis=2, keepdims=True)
        return result

    @property
    def contact_tangent_n_per_m(self) -> FloatArray:
        """dN_k/dδ of each pair, (n_c, n_t, n_slots), including the effect of its neighbours through the common body."""
        total: FloatArray = self.tangent_n_per_m.sum(axis=3)
        return total

    @property
    def contact_secant_n_per_m(self) -> FloatArray:
        """N_k/(δ − E_k) of each pair, (n_c, n_t, n_slots), 0 where it is not in contact."""
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
    table: ContactTable | None = None,
) -> MeshMaps:
    """Solve the loaded contact over mesh angle and torque.

    Σ N = T1/r_b1,  δ − E_i = Σ_j C_ij N_j + B N_i^0.9 at points in contact, N_i = 0 elsewhere

    Parameters
    ----------
    gears : (ReducedGear, ReducedGear)
        Driver, driven gear.
    mesh : GearMesh
        Geometry, faults and deviations.
    torque_nm : array or None
        On the driver, above 0, ascending; None: 10 to 500 N m.
    mesh_cycles : array or None
        None: 200 points of one cycle. With faulty teeth or pitch deviations, give a whole revolution.
    support : str
        Support of the bodies, see `ReducedGear.compliance_m_per_n`.
    table : ContactTable or None
        If already made.

    Raises
    ------
    RefusalError
        If no equilibrium of the contact is found.

    Notes
    -----
    No friction; contact stays on the line of action, also at corners; the axes are rigid.
    """
    torques = frozen_array(TORQUES_NM if torque_nm is None else torque_nm, "torque_nm", ndim=1)
    if len(torques) == 0 or torques[0] <= 0.0 or np.any(np.diff(torques) <= 0.0):
        raise InputError("torques not ascending, or not above 0", where="torque_nm", allowed="ascending, above 0 N m")
    cycles = one_mesh_cycle() if mesh_cycles is None else frozen_array(mesh_cycles, "mesh_cycles", ndim=1)
    table = static_table(gears, mesh, support=support) if table is None else table
    loads = torques / mesh.pair.base_radii_m[0]
    delta, force, tangent = _solved(table, mesh, cycles, loads, by_force=True)
    return MeshMaps(cycles, torques, delta, force, tangent, _separations(table, mesh, cycles))


def force_map(
    table: ContactTable, mesh: GearMesh, approach_m: FloatArray, mesh_cycles: FloatArray | None = None
) -> ForceMap:
    """Tabulate the contact force F(z, δ) and dF/dδ.

    Parameters
    ----------
    table : ContactTable
        E.g. from `static_table`.
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
    converged = loaded_contact(
        np.array(cycles, dtype=np.float64),  # copies: the kernel would be compiled again for read-only arrays
        np.array(loads, dtype=np.float64),
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
    if not converged:
        raise RefusalError("no equilibrium of the tooth contact was found", remedy="check loads and separations")
    return delta, force, tangent


def teeth_of(mesh: GearMesh) -> FloatArray:
    """(z1, z2) as floats for kernels."""
    return np.array([mesh.pair.driver.teeth, mesh.pair.driven.teeth], dtype=np.float64)


def _separations(table: ContactTable, mesh: GearMesh, cycles: FloatArray) -> FloatArray:
    """Separation of the pair in each slot, (n_c, n_slots); infinite beyond the table."""
    newest = np.floor(cycles - table.start)
    apart = np.full((len(cycles), table.n_slots), np.inf)
    for slot in range(table.n_slots):
        pair = newest - slot
        progress = cycles - pair
        inside = progress <= table.progress[-1]
        tooth_1, tooth_2 = (np.mod(pair[inside], z).astype(int) for z in teeth_of(mesh))
        total = table.pitch_m[0, tooth_1] + table.pitch_m[1, tooth_2]
        for i, (a, b) in enumerate(zip(table.separation.of[0, tooth_1], table.separation.of[1, tooth_2], strict=True)):
            whole = (table.corner_m + table.separation.rows[a] + table.separation.rows[b]).min(axis=1)
            total[i] += np.interp(progress[inside][i], table.progress, whole)
        apart[inside, slot] = total
    return apart


class ContactState(NamedTuple):
    """Points of the pairs near contact, with the slices of a pair adjacent; see `contact_state`.

    Attributes
    ----------
    force_n : array, (n,)
    compliance : array, (n, n)
        R + h'(N), with h'(N) on the diagonal.
    pair, column, part : arrays, (n,)
        Number of the pair, and its position in the table.
    """

    force_n: FloatArray
    compliance: FloatArray
    pair: FloatArray
    column: NDArray[np.int64]
    part: FloatArray


def contact_state(table: ContactTable, mesh: GearMesh, force_n: float, mesh_cycles: float) -> ContactState:
    """Solve the contact at one mesh angle and return the data for a model linearised about it."""
    direct, cross, corner, extra, separation, rows, pitch, hertz = table.arrays
    slots, n_s = table.n_slots, table.n_slices
    pairs, parts = np.zeros(slots), np.zeros(slots)
    apart, slope = np.zeros((slots, n_s)), np.zeros((slots, n_s))
    columns = np.zeros(slots, dtype=np.int64)
    at, teeth = float(mesh_cycles), teeth_of(mesh)
    near = (at, table.start, table.step, corner, separation, rows, pitch, teeth, 1e9)
    n = near_pairs(*near, pairs, columns, parts, apart, slope)
    r = np.zeros((slots * n_s, slots * n_s))
    fill_compliance(n, pairs, columns, parts, teeth, direct, cross, extra, rows, r)
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


# Compiled: loaded contact at given mesh angles, for a given force or a given approach.

ENOUGH = 1e-10
"""Change of a force, relative to the load, at which the solution has converged."""


@njit(cache=True, nogil=True, error_model="numpy")
def loaded_contact(  # noqa: PLR0912  one search, with its cases side by side
    cycles, loads, by_force, start, step, teeth, small, n_slots, arrays, delta, force, tangent
):
    """Solve the contact at each c and load; return whether all converged.

    loads : (n_loads,) total force in N, or approach δ in m where `by_force` is false; ascending.
    delta : (n_c, n_loads) δ in m, or the total force.
    force, tangent : (n_c, n_loads, n_slots, n_slices) N, and dN/dδ; slot j is pair ⌊c − start⌋ − j.
    """
    direct, cross, corner, extra, separation, rows, pitch, hertz = arrays
    n_s = direct.shape[1]
    n_max = n_slots * n_s
    pairs, parts = np.empty(n_slots), np.empty(n_slots)
    apart, slope = np.empty((n_slots, n_s)), np.empty((n_slots, n_s))
    columns = np.empty(n_slots, dtype=np.int64)
    r, a = np.empty((n_max, n_max)), np.empty((n_max, n_max))
    approach, n_at, w, x, unit = np.empty(n_max), np.empty(n_max), np.empty(n_max), np.empty(n_max), np.empty(n_max)
    order = np.empty(n_max, dtype=np.int64)
    for row in range(cycles.shape[0]):
        # Pairs near contact at this mesh angle, and the compliance between their slices.
        n = near_pairs(
            cycles[row], start, step, corner, separation, rows, pitch, teeth, 1e9, pairs, columns, parts, apart, slope
        )
        if n <= 0:
            return False
        fill_compliance(n, pairs, columns, parts, teeth, direct, cross, extra, rows, r)
        # The first load starts from zero force at first touch, each further one from the one before.
        nearest = 1e9
        for p in range(n):
            nearest = min(nearest, apart[p].min())
        n_at[:] = 0.0
        w[:] = small**-0.1
        at = nearest
        newest = np.floor(cycles[row] - start)
        for load in range(loads.shape[0]):
            enough = ENOUGH * max(loads[load] if by_force else loads[load] * 1e8, small)
            at = at if by_force else loads[load]
            is_solved = False
            # Newton's method for the approach at which the forces sum to the load; one solution if approach is given.
            for _ in range(100):
                for p in range(n):
                    for s in range(n_s):
                        approach[p * n_s + s] = at - apart[p, s]
                done, m = solve_contacts(r, n * n_s, approach, hertz, small, n_at, w, enough, order, a, x)
                if done < 0:
                    return False
                total, stiffness = 0.0, 0.0
                for p in range(m):
                    unit[p] = 1.0
                    total += n_at[order[p]]
                # dN/dδ of the points in contact: (R + h')⁻¹ 1.
                back_substituted(a, m, unit)
                for p in range(m):
                    stiffness += unit[p]
                if not by_force:
                    is_solved = True
                    break
                missing = loads[load] - total
                if abs(missing) <= 1e-9 * loads[load]:
                    is_solved = True
                    break
                at += missing / stiffness if m > 0 and stiffness > 0.0 else max(r[0, 0] * missing, 1e-9)
            if not is_solved:
                return False
            # Results by slot, counted from the newest pair.
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
