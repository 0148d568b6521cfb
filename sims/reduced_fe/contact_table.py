"""The contact of two reduced gears as arrays over the progress of a tooth pair, which compiled code reads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, within
from gearsig.errors import InputError
from sims.mesh.deviation import pitch_separation_m
from sims.mesh.gear_mesh import GearMesh
from sims.mesh.separation import separation_rows
from sims.mesh.stiffness_hertz import load_dependent_contact_coefficient
from sims.reduced_fe.contact_faults import fault_compliance_rows
from sims.reduced_fe.contact_path import corner_separation_m, over_height, rolls_rad
from sims.reduced_fe.reduced_gear import ReducedGear

POINTS_PER_PITCH = 64
"""Columns per base pitch; a whole number, so that the columns of the next pair lie on those of this one."""
MARGIN = 20 / POINTS_PER_PITCH
"""Base pitches before the ideal entry and after the ideal end within which a loaded pair may touch by a corner."""
LARGEST_LEAD_UM = 500.0
FLANK = 0
"""Of a `FlankGrid`: the flank that both gears drive with, each seen from its own side."""
SIGNS = (-1, 1)
"""The next tooth to touch lies at a smaller angle of the driver (ccw) and at a greater one of the driven gear (cw)."""

ToothCompliance = Callable[[ReducedGear, list[int]], FloatArray]
"""Compliance between the points of some teeth, as `ReducedGear.compliance_m_per_n`."""


@dataclass(frozen=True)
class ContactTable:
    """Compliance, separation and local contact of tooth pairs and slices over ζ, base pitches since ideal entry.

    Pair k touches at ζ = c − k, c = z1 θ1/2π; it is made of tooth k mod z1 and tooth k mod z2. Slices are counted from
    the end face at −z.

    Parameters
    ----------
    start, step : float
        Least ζ, and distance of the columns (1/`POINTS_PER_PITCH`). One column lies beyond either end, for cubics.
    contact_ratio : float
    own : array, (n, n_slices, n_slices)
        Compliance between the slices of a pair, both gears together, m/N.
    cross : array, (n_offsets, n, n_slices, n_slices)
        Between a pair at ζ (first slice) and the pair that entered o + 1 pitches earlier (second), m/N.
    corner_m : array, (n,)
        Separation of unloaded perfect flanks.
    extra_1, extra_2 : arrays, (n_variants, n, n_slices, n_slices)
        What faulty teeth add to the compliance between their slices; row 0, of sound teeth, is 0.
    variant_1, variant_2 : int arrays, (z,)
    separation_1_m, separation_2_m : arrays, (n_surfaces, n)
        Metal missing on the flanks, see `sims.mesh.MeshTable`.
    surface_1, surface_2 : int arrays, (z,)
    pitch_1_m, pitch_2_m : arrays, (z,)
    lead_m : array, (n_slices,)
        Separation of each slice by misaligned axes, its least being 0.
    hertz : array, (n_slices,)
        B of a slice, h = B N^0.9, m/N^0.9.
    """

    start: float
    step: float
    contact_ratio: float
    own: FloatArray
    cross: FloatArray
    corner_m: FloatArray
    extra_1: FloatArray
    extra_2: FloatArray
    variant_1: NDArray[np.int64]
    variant_2: NDArray[np.int64]
    separation_1_m: FloatArray
    separation_2_m: FloatArray
    surface_1: NDArray[np.int64]
    surface_2: NDArray[np.int64]
    pitch_1_m: FloatArray
    pitch_2_m: FloatArray
    lead_m: FloatArray
    hertz: FloatArray

    @property
    def progress(self) -> FloatArray:
        """ζ of the columns."""
        result: FloatArray = self.start + self.step * np.arange(-1, len(self.own) - 1)
        return result

    def column(self, progress: float) -> int:
        """Column nearest to ζ."""
        return round((progress - self.start) / self.step) + 1

    @property
    def n_slices(self) -> int:
        """Slices of the face width."""
        return int(self.own.shape[1])

    @property
    def n_slots(self) -> int:
        """Most pairs that may touch at once, corners included."""
        return floor((len(self.own) - 3) * self.step) + 1

    @property
    def arrays(self) -> tuple[FloatArray | NDArray[np.int64], ...]:
        """In the order in which kernels take them; one of each kind for both gears, the driver's rows first."""
        n1 = len(self.extra_1) - 1, len(self.separation_1_m)  # sound teeth of both gears share row 0
        rows = np.zeros((4, max(len(self.variant_1), len(self.variant_2))), dtype=np.int64)
        pitch = np.zeros((2, rows.shape[1]))
        for i, values in enumerate(
            (
                self.variant_1,
                np.where(self.variant_2 > 0, self.variant_2 + n1[0], 0),
                self.surface_1,
                self.surface_2 + n1[1],
            )
        ):
            rows[i, : len(values)] = values
        for i, places in enumerate((self.pitch_1_m, self.pitch_2_m)):
            pitch[i, : len(places)] = places
        extra = np.ascontiguousarray(np.concatenate((self.extra_1, self.extra_2[1:])))
        separation = np.ascontiguousarray(np.vstack((self.separation_1_m, self.separation_2_m)))
        return self.own, self.cross, self.corner_m, extra, separation, rows, pitch, self.lead_m, self.hertz


def contact_table(
    gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh, compliance: ToothCompliance, *, lead_um: float = 0.0
) -> ContactTable:
    """Tabulate the contact of two reduced gears.

    Parameters
    ----------
    gears : (ReducedGear, ReducedGear)
        Driver and driven gear, with the same slices.
    mesh : GearMesh
        Geometry of the pair, its faults and deviations. The compliance of sound teeth is the gears'.
    compliance : callable
        Which part of each gear's compliance: all of it for statics, the rest beside the modes for dynamics.
    lead_um : float
        How much further apart the flanks are at one end of the face than at the other; above 0: open towards +z.

    Raises
    ------
    InputError
        If the gears are not those of the mesh, or their slices differ.
    """
    check_gears(gears, mesh)
    within(lead_um, "lead_error_um", -LARGEST_LEAD_UM, LARGEST_LEAD_UM, "um")
    n_before = round(MARGIN * POINTS_PER_PITCH)
    n = n_before + ceil((mesh.pair.contact_ratio + MARGIN) * POINTS_PER_PITCH) + 3
    step = 1.0 / POINTS_PER_PITCH
    progress = -MARGIN + step * np.arange(-1, n - 1)
    inside = np.clip(progress, 0.0, mesh.pair.contact_ratio)
    own, cross = _compliances(gears, mesh, progress, compliance)
    places = np.linspace(0.0, 1.0, len(gears[0].grid.z_m))
    lead = 1e-6 * abs(lead_um) * (places if lead_um >= 0.0 else 1.0 - places)
    faults = [fault_compliance_rows(gears[side - 1], mesh, side, inside) for side in (1, 2)]
    flanks = [separation_rows(mesh, side, inside) for side in (1, 2)]
    whole = load_dependent_contact_coefficient(mesh.material_1, mesh.material_2, mesh.face_width_m)
    return ContactTable(
        start=-MARGIN,
        step=step,
        contact_ratio=mesh.pair.contact_ratio,
        own=own,
        cross=cross,
        corner_m=corner_separation_m(mesh.pair, progress),
        extra_1=faults[0][0],
        extra_2=faults[1][0],
        variant_1=faults[0][1],
        variant_2=faults[1][1],
        separation_1_m=flanks[0][0],
        separation_2_m=flanks[1][0],
        surface_1=flanks[0][1],
        surface_2=flanks[1][1],
        pitch_1_m=pitch_separation_m(mesh.pair.driver, mesh.flank_1),
        pitch_2_m=pitch_separation_m(mesh.pair.driven, mesh.flank_2),
        lead_m=lead,
        # An evenly loaded pair yields as the whole width does: h(N_s) = B (n N_s)^0.9.
        hertz=np.full(len(lead), whole * len(lead) ** 0.9),
    )


def static_table(
    gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh, *, lead_um: float = 0.0, support: str = "hub_held"
) -> ContactTable:
    """Return the table for statics: all of the elastic compliance, held at the hubs whose motion is measured."""

    def whole(gear: ReducedGear, teeth: list[int]) -> FloatArray:
        return gear.compliance_m_per_n(teeth, support)  # type: ignore[arg-type]  # refused there if not one of its words

    return contact_table(gears, mesh, whole, lead_um=lead_um)


def check_gears(gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh) -> None:
    """Refuse reduced gears that are not those of the mesh."""
    for name, gear, wanted in zip(("driver", "driven"), gears, (mesh.pair.driver, mesh.pair.driven), strict=True):
        own = gear.blank.geometry
        if replace(own, bore_radius_mm=None) != replace(wanted, bore_radius_mm=None) or own.bore_mm != wanted.bore_mm:
            raise InputError(f"the {name}'s reduced gear is of {own}", where="gears", allowed=f"{wanted}")
    if len(gears[0].grid.z_m) != len(gears[1].grid.z_m) or not np.allclose(gears[0].grid.z_m, gears[1].grid.z_m):
        raise InputError("the slices of the two reduced gears differ", remedy="reduce both with the same slices")


def _compliances(
    gears: tuple[ReducedGear, ReducedGear], mesh: GearMesh, progress: FloatArray, compliance: ToothCompliance
) -> tuple[FloatArray, FloatArray]:
    """Own and cross compliance of both gears together; see `ContactTable`."""
    n, n_slices = len(progress), len(gears[0].grid.z_m)
    n_offsets = floor((n - 1) / POINTS_PER_PITCH)
    own = np.zeros((n, n_slices, n_slices))
    cross = np.zeros((n_offsets, n, n_slices, n_slices))
    here = rolls_rad(mesh.pair, progress)
    for gear, sign, roll, side in zip(gears, SIGNS, here, (0, 1), strict=True):
        block = _between(gear, [0], compliance)
        own += _along_diagonal(gear.grid.roll_rad, block, roll)
        for o in range(min(n_offsets, gear.n_offsets - 1)):
            older = rolls_rad(mesh.pair, progress + o + 1.0)[side]
            block = _between(gear, [0, -sign * (o + 1)], compliance)
            cross[o] += _over_both(gear.grid.roll_rad, block, roll, older)
    return own, cross


def _between(gear: ReducedGear, teeth: list[int], compliance: ToothCompliance) -> FloatArray:
    """Compliance between the driving flanks of the first and the last of the teeth, (heights, slices) twice."""
    n, shape = gear.grid.n_points, gear.grid.shape
    block = compliance(gear, teeth)[:n, -n:]
    result: FloatArray = block.reshape(*shape, *shape)[FLANK, :, :, FLANK]
    return result


def _along_diagonal(roll: FloatArray, block: FloatArray, wanted: FloatArray) -> FloatArray:
    """Compliance between slices at one height, (n, n_slices, n_slices)."""
    heights = np.arange(len(roll))
    return over_height(roll, block[heights, :, heights, :], wanted)


def _over_both(roll: FloatArray, block: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Compliance between slices at two heights, (n, n_slices, n_slices)."""
    from scipy.interpolate import RectBivariateSpline

    n_slices, order = block.shape[1], min(3, len(roll) - 1)
    x, y = (np.clip(place, roll[0], roll[-1]) for place in (first, second))
    found = np.empty((len(first), n_slices, n_slices))
    for s in range(n_slices):
        for t in range(n_slices):
            found[:, s, t] = RectBivariateSpline(roll, roll, block[:, s, :, t], kx=order, ky=order).ev(x, y)
    return found
