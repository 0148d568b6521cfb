"""One finite-element gear: mesh, modes, tooth stiffness, reduction; growth of a crack at its tooth root."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError
from gearsig.formatting import counted, csv_rows, signed
from gearsig.plot import curve_panel, gear_mesh_figure, gear_modes_figure, gear_stress_figure, panels_figure
from gearsig.report import write_folder
from sims import fe_gear
from sims.fe_gear import (
    CraigBamptonGear,
    CyclicGear,
    CyclicModes,
    DiscretisationError,
    FaceView,
    GearBlank,
    Held,
    MeshQuality,
    ReducedGear,
    SectorMesh,
    ToothLoad,
    crack_size,
    deepest_followed_mm,
)
from sims.mesh import GearMesh
from sims.reduced_fe import CrackGrowth, GrowthLaw, StressIntensity, crack_growth, reduced_gear, stress_intensity

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class GearBodyStudy:
    """Results for one gear.

    Parameters
    ----------
    mesh : SectorMesh
    quality : MeshQuality
    gear : CyclicGear
        With the support used for its modes.
    held : str
        "free", "bore" or "springs".
    modes : CyclicModes
        Elastic modes; for a gear on springs also rigid-body modes.
    load : ToothLoad
        A tooth loaded in the middle of its flank, bore held.
    discretisation : DiscretisationError or None
        Error of a coarse mesh, by comparison with a much finer one.
    reduced : ReducedGear or None
    craig_bampton : CraigBamptonGear or None
    """

    mesh: SectorMesh
    quality: MeshQuality
    gear: CyclicGear
    held: str
    modes: CyclicModes
    load: ToothLoad
    discretisation: DiscretisationError | None
    reduced: ReducedGear | None
    craig_bampton: CraigBamptonGear | None


def study_gear(
    blank: GearBlank,
    n_dof: int,
    *,
    n_modes: int = 20,
    held: Held = "free",
    springs: FloatArray | None = None,
    force_n: float = 1000.0,
    reduce: bool = False,
    on_progress: Callable[[str, float], None] = lambda _what, _done: None,
) -> GearBodyStudy:
    """Study one gear.

    Parameters
    ----------
    blank : GearBlank
    n_dof : int
        Approximate degrees of freedom of the whole gear.
    n_modes : int
        Minimum number of elastic modes; up to 300.
    held : str
        "free" or "bore".
    springs : array (6,) or None
        Springs that hold the hub for the modes, see `CyclicGear`; only with "free".
    force_n : float
        Force on the tooth.
    reduce : bool
        Also reduce the gear both ways. The free-interface reduction is kept in the cache of the model `reduced-fe`.
    on_progress : callable
        Takes the current stage and the fraction completed, 0 to 1.
    """
    # beyond 300 modes, the search takes many minutes, and only teeth move
    count(n_modes, "n_modes", maximum=300)
    on_progress("mesh", 0.0)
    size = fe_gear.mesh_size_for(blank, n_dof)
    if reduce:
        fe_gear.check_reducible(blank, size)
    fe_gear.check_memory(
        fe_gear.craig_bampton_bytes(blank, size, fe_gear.N_COMPARED) if reduce else fe_gear.sector_bytes(blank, size)
    )
    mesh = fe_gear.sector_mesh(blank, size)
    gear = CyclicGear(mesh, springs)
    on_progress("modes", 0.05)
    elastic = held == "free" and springs is None
    with fe_gear.one_thread():
        modes = fe_gear.cyclic_modes(gear, n_modes, held, elastic=elastic)
    on_progress("stress", 0.25 if reduce else 0.6)
    load = fe_gear.load_tooth(mesh, force_n)
    error = None
    if mesh.n_dof < fe_gear.FINER_DOF / 2:
        on_progress("finer mesh", 0.3)
        error = fe_gear.discretisation_error(gear, modes, load, held, elastic=elastic)
    reduced = both = None
    if reduce:
        on_progress("free-interface reduction", 0.35)
        reduced = fe_gear.cached_gear(blank, fe_gear.ReductionPlan(size))
        on_progress("Craig–Bampton reduction", 0.7)
        # contact patches along the face, if the mesh has enough layers
        plan = fe_gear.CraigBamptonPlan(n_slices=min(5, mesh.tooth.shape[2]))
        both = fe_gear.craig_bampton(mesh, plan)
    on_progress("done", 1.0)
    return GearBodyStudy(
        mesh,
        fe_gear.mesh_quality(mesh),
        gear,
        held if springs is None else "springs",
        modes,
        load,
        error,
        reduced,
        both,
    )


N_SHOWN = 6
NEIGHBOURS = (-1, 0, 1)
PEAKS = "Peaks at the force and in sharp corners grow with mesh refinement."
"""The stress at a line load and in sharp corners is singular."""
HELD = {"free": "free", "bore": "bore held", "springs": "hub on springs"}


def write_gear_body(study: GearBodyStudy, folder: Path, *, vtk: bool = False) -> tuple[Path, ...]:
    """Write the figures as PNG and, if available, VTK file, reduced gear and Craig–Bampton table."""
    paths = [*write_folder(folder, {f"{name}.png": figure for name, figure in figures(study).items()})]
    if vtk:
        paths.append(fe_gear.write_vtk(folder / "gear.vtu", study.mesh, _fields(study)))
    if study.reduced is not None:
        paths.append(folder / "reduced.npz")
        fe_gear.write_gear(paths[-1], study.reduced)
    if study.craig_bampton is not None:
        paths.append(folder / "craig_bampton.txt")
        paths[-1].write_text(study.craig_bampton.accuracy.table() + "\n", encoding="utf-8")
    return tuple(paths)


def figures(study: GearBodyStudy) -> dict[str, Figure]:
    """Return figures of mesh, modes and stress by file name; stress of a first-order mesh is too coarse to show."""
    mesh, view = study.mesh, fe_gear.face_view(study.mesh)
    g = mesh.blank.geometry
    name = f"{g.teeth} teeth, module {g.module_mm:g} mm"
    near = (g.root_radius_mm - 3.0 * g.module_mm, g.tip_radius_mm + 0.5 * g.module_mm)
    across = 0.95 * np.pi * g.module_mm
    quality = study.quality.scaled_jacobian[view.cells]
    shapes = {label(study, k): _motion(study, view, k) for k in range(min(N_SHOWN, len(study.modes.frequencies_hz)))}
    figures = {
        "mesh": gear_mesh_figure(
            view.outlines_mm,
            quality,
            near_mm=(*near, -across, across),
            title=f"{name}: {mesh.n_dof} degrees of freedom",
        ),
        "modes": gear_modes_figure(
            view.points_mm, view.triangles, shapes, title=f"{name}: first modes, {HELD[study.held]}"
        ),
    }
    if mesh.size.order > 1:
        figures["stress"] = _stress(study, (*near, -across, across), name)
    return figures


def lines(study: GearBodyStudy) -> list[str]:
    """Return the results as lines of text."""
    q = study.quality
    text = [
        f"{study.mesh.n_dof} degrees of freedom; {_cells(study)}",
        f"mass {q.mass_kg:.4g} kg ({signed(1e6 * (q.volume_m3 / q.true_volume_m3 - 1.0), 0)} ppm of the outline's)",
        f"polar inertia {q.polar_inertia_kg_m2:.4g} kg m², minimum scaled Jacobian {q.scaled_jacobian.min():.2f}",
        f"tooth compliance in mid-flank {study.load.push_m / study.load.force_n:.3g} m/N, bore held",
        f"modes, {HELD[study.held]}:",
        *(label(study, k) for k in range(len(study.modes.frequencies_hz))),
    ]
    if study.discretisation is not None:
        d, size = study.discretisation, study.mesh.size
        worst = d.frequency[np.argmax(np.abs(d.frequency))]
        text.append(
            f"coarse: against {d.finer_dof} degrees of freedom the first frequency is {signed(100.0 * d.frequency[0])} "
            f"%, the worst of {len(d.frequency)} {signed(100.0 * worst)} %, the tooth "
            f"compliance {signed(100.0 * d.compliance, 0)} %"
        )
        if size.order == 1:
            text.append(f"edges straight, up to {q.outline_error_mm:.2g} mm off the outline: no stress is shown")
    if study.reduced is not None:
        text.append(f"free-interface reduction: {study.reduced.n_modes} elastic modes and the static residual")
    if study.craig_bampton is not None:
        a = study.craig_bampton.accuracy
        text.append(
            f"Craig–Bampton: {len(study.craig_bampton.mass)} degrees of freedom, worst of {len(a.full_hz)} frequencies "
            f"{100.0 * a.worst_error:.4f} %, lowest subspace MAC {a.minimum_mac:.6f}"
        )
    return text


def _cells(study: GearBodyStudy) -> str:
    size = study.mesh.size
    kind = "27-node hexahedra" if size.order == 2 else "8-node hexahedra with incompatible modes"
    return f"{kind}: {size.n_across} over the tooth thickness, {size.n_up} up the flank, {size.n_along} along the face"


def label(study: GearBodyStudy, k: int) -> str:
    """Return frequency and kind of mode k as text."""
    n = int(study.modes.nodal_diameters[k])
    whole = fe_gear.rigid_part(study.gear, study.modes, k)
    kind = whole or f"{counted(n, 'nodal diameter')}"
    return f"{study.modes.frequencies_hz[k]:.1f} Hz, {kind}"


def in_the_whole_gear(mesh: SectorMesh, vectors: FloatArray) -> FloatArray:
    """Transform vectors from the axes of their sectors, (n_teeth, n, 3), to those of the gear, (n_teeth · n, 3)."""
    angle = mesh.blank.pitch_angle_rad * np.arange(len(vectors))[:, None]
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = np.moveaxis(vectors, 2, 0)
    return np.column_stack(((c * x - s * y).ravel(), (s * x + c * y).ravel(), z.ravel()))


def _motion(study: GearBodyStudy, view: FaceView, k: int) -> FloatArray:
    """Return the motion of the view's points in the axes of the whole gear."""
    return in_the_whole_gear(study.mesh, fe_gear.mode_field(study.gear, study.modes, k)[:, view.nodes])


def _stress(study: GearBodyStudy, near: tuple[float, float, float, float], name: str) -> Figure:
    load, view = study.load, fe_gear.face_view(study.mesh, NEIGHBOURS)
    point, push = fe_gear.point_and_push(study.mesh.blank.geometry, load.roll_rad, 1.0)
    return gear_stress_figure(
        view.points_mm,
        view.triangles,
        view.values(np.array([load.von_mises_pa(k) for k in NEIGHBOURS])),
        near_mm=near,
        force=(point * 1e3, push, f"{load.force_n:g} N"),
        note=PEAKS,
        title=f"{name}: stress, bore held",
    )


def _fields(study: GearBodyStudy) -> dict[str, FloatArray]:
    """Return the nodal fields for the VTK file."""
    z = study.mesh.blank.n_teeth
    fields = {
        "displacement_m": study.load.displacement_m,
        "von_mises_pa": np.array([study.load.von_mises_pa(k) for k in range(z)]),
    }
    for k in range(min(N_SHOWN, len(study.modes.frequencies_hz))):
        fields[f"mode_{k + 1}_{study.modes.frequencies_hz[k]:.0f}_hz"] = fe_gear.mode_field(study.gear, study.modes, k)
    return fields


# --------------------
# What `gearsig growth` computes and writes: stress intensity and growth of a root crack, remaining revolutions.
# --------------------


DOF_PER_TOOTH = 4_000
"""For a gear made for this study; enough that its cracks are solved on the fine mesh."""
N_DEPTHS = 40
ASSUMPTIONS = (
    "the crack goes through the whole face, straight at its angle",
    "a real crack turns towards maximum energy release: K is held constant where that of a straight crack would fall",
    "one load per revolution, from zero to its maximum: steady torque, vibration only through the load factor",
    "no residual stress from case hardening, no corrosion, no overloads, no closure",
    "the interval covers the scatter of the steel specimens and the given depth, not these assumptions",
)


@dataclass(frozen=True)
class GrowthStudy:
    """Results of a growth study.

    Parameters
    ----------
    intensity : StressIntensity
    growth : CrackGrowth
    law : GrowthLaw
    torque_nm, load_factor, speed_rpm : float
        Torque and speed of the driver; the load factor multiplies the load of the torque.
    side : int
        1: a tooth of the driver; 2: of the driven gear.
    turns_per_minute : float
        Speed of the cracked gear.
    first_mm : (float, float)
        Present depth: from, to.
    """

    intensity: StressIntensity
    growth: CrackGrowth
    law: GrowthLaw
    torque_nm: float
    load_factor: float
    speed_rpm: float
    side: int
    turns_per_minute: float
    first_mm: tuple[float, float]

    @property
    def verdict(self) -> str:
        """Remaining life, as a sentence."""
        low, middle, high = self.growth.remaining_turns
        end = "it breaks" if self.growth.ends == "toughness" else f"{self.growth.depth_mm[-1]:.2g} mm"
        if not isfinite(low):
            return f"The crack does not grow: ΔK stays below {self.law.threshold:g} MPa√m at this load."
        hours = [t / self.turns_per_minute / 60.0 for t in (low, middle, high)]
        text = f"About {_said(middle)} revolutions until {end}, {_said(low)} to {_said(high)} with 90 %"
        return f"{text}: {_said(hours[1])} hours, {_said(hours[0])} to {_said(hours[2])}."


def _said(value: float) -> str:
    return f"{value:.2g}" if isfinite(value) else "no end"


def growth_study(
    mesh: GearMesh,
    side: int,
    *,
    first_mm: tuple[float, float],
    angle_deg: float,
    torque_nm: float,
    speed_rpm: float,
    law: GrowthLaw,
    load_factor: float = 1.0,
    seed: int = 0,
) -> GrowthStudy:
    """Compute the stress intensity from the present depth onwards, and the remaining revolutions.

    Parameters
    ----------
    mesh : GearMesh
    side : int
    first_mm : (float, float)
        Present depth, from and to; equal if it is known.
    angle_deg : float
    torque_nm, speed_rpm : float
        Torque and speed of the driver.
    law : GrowthLaw
    load_factor : float
        K_A K_v of ISO 6336: ratio of the load to that of the torque alone.
    seed : int
        Seed of the random specimens.
    """
    gear = gear_of(mesh, side)
    positive(load_factor, "load_factor")
    positive(speed_rpm, "speed_rpm", "rpm")
    deepest = deepest_followed_mm(gear.blank, crack_size(gear), angle_deg)
    if not 0.0 < first_mm[0] <= first_mm[1] < 0.98 * deepest:
        raise InputError(
            f"depth is {first_mm[0]:g} to {first_mm[1]:g} mm",
            where="--depth",
            allowed=f"above 0, below {0.98 * deepest:.3g} mm, the limit of the finite-element mesh at {angle_deg:g}°",
        )
    depth = np.linspace(first_mm[0], deepest, N_DEPTHS)
    intensity = stress_intensity(gear, mesh, side, torque_nm * load_factor, depth, angle_deg)
    interval = None if first_mm[0] == first_mm[1] else first_mm
    # Cracks turn towards maximum energy release: K does not fall as it does along the straight line.
    k = np.maximum.accumulate(intensity.k_mpa_sqrt_m)
    grown = crack_growth(depth, k, law, np.random.default_rng(seed), first_mm=interval)
    turns = speed_rpm * (1.0 if side == 1 else mesh.pair.driver.teeth / mesh.pair.driven.teeth)
    return GrowthStudy(intensity, grown, law, torque_nm, load_factor, speed_rpm, side, turns, first_mm)


def gear_of(mesh: GearMesh, side: int) -> ReducedGear:
    """Return the finite-element gear: supplied, cached, or made now."""
    toothed = mesh.side(side)
    return reduced_gear(GearBlank(toothed.gear, material=toothed.material), DOF_PER_TOOTH * toothed.gear.teeth)


def growth_figure(study: GrowthStudy) -> Figure:
    """Draw stress intensity over depth, and the revolutions to reach a depth with their interval."""
    intensity, grown = study.intensity, study.growth
    ends = np.full(len(intensity.depth_mm), study.law.threshold)
    panels = [
        curve_panel(
            intensity.depth_mm,
            {"straight crack": intensity.k_mpa_sqrt_m, "threshold": ends},
            "depth of the crack in mm",
            "MPa√m",
            "stress intensity range per revolution",
        )
    ]
    if isfinite(grown.remaining_turns[0]):
        names = ("5 % of specimens", "50 %", "95 %")
        rows = zip(names, grown.turns, strict=True)
        curves = {name: np.where(row > 0.0, row, np.nan) for name, row in rows if np.isfinite(row).all()}
        panels.append(
            curve_panel(
                grown.depth_mm,
                curves,
                "depth of the crack in mm",
                "revolutions",
                "revolutions to this depth",
                log_y=True,
            )
        )
    return panels_figure(panels, n_columns=len(panels), title="growth of a root crack", height_in=2.8)


def write_growth(study: GrowthStudy, folder: Path) -> tuple[Path, ...]:
    """Write growth.png and .svg, growth.csv, growth.json."""
    columns = ["depth_mm", "k_mpa_sqrt_m", "turns_5", "turns_50", "turns_95"]
    rows = zip(study.growth.depth_mm, study.growth.k_mpa_sqrt_m, *study.growth.turns, strict=True)
    table = csv_rows(columns, ([f"{value:.6g}" for value in row] for row in rows))
    content = {
        "verdict": study.verdict,
        "remaining_turns": [t if isfinite(t) else None for t in study.growth.remaining_turns],
        "probabilities": [0.05, 0.5, 0.95],
        "ends": study.growth.ends,
        "depth_mm": list(study.first_mm),
        "last_depth_mm": float(study.growth.depth_mm[-1]),
        "torque_nm": study.torque_nm,
        "load_factor": study.load_factor,
        "speed_rpm": study.speed_rpm,
        "law": study.law.source,
        "assumptions": list(ASSUMPTIONS),
    }
    text = json.dumps(content, indent=1, ensure_ascii=False) + "\n"
    figures = dict.fromkeys(("growth.png", "growth.svg"), growth_figure(study))
    return write_folder(folder, figures, {"growth.csv": table, "growth.json": text})
