"""What `gearsig growth` computes and writes: stress intensity of a root crack, its growth, the turns that are left."""

from __future__ import annotations

import json
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gearsig.cache import made_folder, write_text
from gearsig.checks import positive
from gearsig.errors import InputError
from gearsig.formatting import csv_rows
from gearsig.plot import CurvePanel, curves_figure
from sims.fe_gear import GearBlank, ReducedGear, crack_size, deepest_followed_mm
from sims.mesh import GearMesh
from sims.reduced_fe import CrackGrowth, GrowthLaw, StressIntensity, crack_growth, reduced_gear, stress_intensity

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOF_PER_TOOTH = 4_000
"""Of a gear that is made for this: so many that its cracks are solved on the fine mesh."""
N_DEPTHS = 40
ASSUMPTIONS = (
    "the crack goes through the whole face, straight at its angle",
    "a real crack turns to where most energy is released: K is held where that of the straight one would fall",
    "one load a turn, from nothing to its greatest: steady torque, no vibration but by the load factor",
    "no residual stress of a hardened case, no corrosion, no overloads, no closure",
    "the interval is that of the steel's specimens and of the depth that was given, not of these assumptions",
)


@dataclass(frozen=True)
class GrowthStudy:
    """What was found.

    Parameters
    ----------
    intensity : StressIntensity
    growth : CrackGrowth
    law : GrowthLaw
    torque_nm, load_factor, speed_rpm : float
        Torque and speed of the driver; the load is their product with the factor.
    side : int
        1: a tooth of the driver; 2: of the driven gear.
    turns_per_minute : float
        Of the cracked gear.
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
        """What is left, in a sentence."""
        low, middle, high = self.growth.remaining_turns
        end = "it breaks" if self.growth.ends == "toughness" else f"{self.growth.depth_mm[-1]:.2g} mm"
        if not isfinite(low):
            return f"The crack rests: ΔK stays below {self.law.threshold:g} MPa√m at this load."
        hours = [t / self.turns_per_minute / 60.0 for t in (low, middle, high)]
        text = f"About {_said(middle)} turns until {end}, {_said(low)} to {_said(high)} with 90 %"
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
    """Find stress intensity from the present depth on, and how many turns are left.

    Parameters
    ----------
    mesh : GearMesh
    side : int
    first_mm : (float, float)
        Present depth; twice the same if it is known.
    angle_deg : float
    torque_nm, speed_rpm : float
        Of the driver.
    law : GrowthLaw
    load_factor : float
        K_A K_v of ISO 6336: how much greater the load is than the torque's.
    seed : int
        Of the specimens.
    """
    gear = gear_of(mesh, side)
    positive(load_factor, "load_factor")
    positive(speed_rpm, "speed_rpm", "rpm")
    deepest = deepest_followed_mm(gear.blank, crack_size(gear), angle_deg)
    if not 0.0 < first_mm[0] <= first_mm[1] < 0.98 * deepest:
        raise InputError(
            f"depth is {first_mm[0]:g} to {first_mm[1]:g} mm",
            where="--depth",
            allowed=f"above 0, below {0.98 * deepest:.3g} mm: as far as the finite elements follow at {angle_deg:g}°",
        )
    depth = np.linspace(first_mm[0], deepest, N_DEPTHS)
    found = stress_intensity(gear, mesh, side, torque_nm * load_factor, depth, angle_deg)
    interval = None if first_mm[0] == first_mm[1] else first_mm
    # Cracks turn to where most energy is released: K does not fall as it does along the straight line.
    k = np.maximum.accumulate(found.k_mpa_sqrt_m)
    grown = crack_growth(depth, k, law, np.random.default_rng(seed), first_mm=interval)
    turns = speed_rpm * (1.0 if side == 1 else mesh.pair.driver.teeth / mesh.pair.driven.teeth)
    return GrowthStudy(found, grown, law, torque_nm, load_factor, speed_rpm, side, turns, first_mm)


def gear_of(mesh: GearMesh, side: int) -> ReducedGear:
    """Finite elements of a gear: ready-made, kept, or made now."""
    own = mesh.side(side)
    return reduced_gear(GearBlank(own.gear, material=own.material), DOF_PER_TOOTH * own.gear.teeth)


def growth_figure(study: GrowthStudy) -> Figure:
    """Stress intensity over depth, and depth over turns with its interval."""
    intensity, grown = study.intensity, study.growth
    ends = np.full(len(intensity.depth_mm), study.law.threshold)
    panels = [
        CurvePanel(
            intensity.depth_mm,
            {"of a straight crack": intensity.k_mpa_sqrt_m, "threshold": ends},
            "depth of the crack in mm",
            "MPa√m",
            "stress intensity over a turn",
        )
    ]
    if isfinite(grown.remaining_turns[0]):
        names = ("5 % of specimens", "half of them", "95 %")
        rows = zip(names, grown.turns, strict=True)
        curves = {name: np.where(row > 0.0, row, np.nan) for name, row in rows if np.isfinite(row).all()}
        panels.append(
            CurvePanel(grown.depth_mm, curves, "depth of the crack in mm", "turns", "turns until then", log_y=True)
        )
    return curves_figure(panels, n_columns=len(panels), title="growth of a root crack", height_in=2.8)


def write_growth(study: GrowthStudy, folder: Path) -> list[Path]:
    """Write growth.png and .svg, growth.csv, growth.json."""
    made_folder(folder)
    paths, figure = [folder / "growth.png", folder / "growth.svg"], growth_figure(study)
    for path in paths:
        figure.savefig(path, dpi=160)
    columns = ["depth_mm", "k_mpa_sqrt_m", "turns_5", "turns_50", "turns_95"]
    rows = zip(study.growth.depth_mm, study.growth.k_mpa_sqrt_m, *study.growth.turns, strict=True)
    table = csv_rows(columns, ([f"{value:.6g}" for value in row] for row in rows))
    found = {
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
    write_text(folder / "growth.csv", table)
    write_text(folder / "growth.json", json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    return [*paths, folder / "growth.csv", folder / "growth.json"]
