"""Growth of a root crack: stress intensity from finite elements, Paris' law, remaining revolutions."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, positive, within
from gearsig.errors import InputError
from gearsig.results import Result
from sims.fe_gear import DEPTH_PARTS, ReducedGear, crack_added_m_per_n, crack_size, deepest_followed_mm
from sims.mesh import GearMesh, RootCrack, deepest_crack_mm, share_torque
from sims.reduced_fe._contact import over_height, rolls_rad


def energy_release_m(depth_m: FloatArray, compliance_m_per_n: FloatArray, at_m: FloatArray) -> FloatArray:
    """dC/da of a crack's added compliance, from differences between solved depths.

    The energy release rate under a force F on the width b is G = F²/(2b) dC/da, and K = √(G E/(1 − ν²)) in plane
    strain, for all three modes together.

    Parameters
    ----------
    depth_m : array, (n,)
        Ascending, above 0; the added compliance at depth 0 is 0.
    compliance_m_per_n : array, (n, …)
    at_m : array, (n_at,)
        Up to the last depth.

    Returns
    -------
    array, (n_at, …)
        1/N.

    Source: G. R. Irwin, J. A. Kies, Critical energy rate analysis of fracture strength, Welding Journal 33 (1954).
    """
    from scipy.interpolate import PchipInterpolator

    depth = np.concatenate(([0.0], depth_m))
    compliance = np.concatenate((np.zeros((1, *compliance_m_per_n.shape[1:])), compliance_m_per_n))
    steps = np.diff(depth).reshape(-1, *(1,) * (compliance.ndim - 1))
    slope = np.diff(compliance, axis=0) / steps
    # A difference is the slope at the midpoint, to second order; the end is extrapolated linearly, the start is 0.
    middle = (depth[1:] + depth[:-1]) / 2.0
    beyond = slope[-1] + (slope[-1] - slope[-2]) * (depth[-1] - middle[-1]) / (middle[-1] - middle[-2])
    places = np.concatenate(([0.0], middle, depth[-1:]))
    values = np.concatenate((0.0 * slope[:1], slope, beyond[None]))
    return PchipInterpolator(places, values, axis=0)(at_m)


@dataclass(frozen=True)
class GrowthStage:
    """One stage of Paris' law, da/dN = C ΔK^m, in mm and MPa √m, with the scatter of specimens.

    Parameters
    ----------
    coefficient : float
        C.
    exponent : float
        m.
    scatter : float
        Standard deviation of log10 C.
    exponent_scatter : float
        Standard deviation of m, at a fixed rate at `pivot`: C and m of one material are correlated.
    pivot : float
        ΔK in MPa √m in the middle of the measured range.
    """

    coefficient: float
    exponent: float
    scatter: float = 0.0
    exponent_scatter: float = 0.0
    pivot: float = 20.0

    def __post_init__(self) -> None:
        positive(self.coefficient, "coefficient of Paris' law")
        within(self.exponent, "exponent of Paris' law", 1.0, 20.0)
        within(self.scatter, "scatter of log10 C", 0.0, 2.0)
        within(self.exponent_scatter, "scatter of the exponent", 0.0, 3.0)
        positive(self.pivot, "pivot", "MPa √m")

    def rate_mm(self, delta_k: FloatArray, c: FloatArray | float = 0.0, m: FloatArray | float = 0.0) -> FloatArray:
        """da/dN at ΔK in MPa √m; `c` and `m` are standard normal variates of the specimen."""
        middle = self.coefficient * 10.0 ** (self.scatter * np.asarray(c)) * delta_k**self.exponent
        return middle * (delta_k / self.pivot) ** (self.exponent_scatter * np.asarray(m))


@dataclass(frozen=True)
class GrowthLaw:
    """Crack growth per cycle: the slowest of several stages, none below a threshold, fracture at a toughness.

    Parameters
    ----------
    stages : tuple of GrowthStage
    threshold : float
        ΔK in MPa √m below which a crack does not grow.
    toughness : float
        K in MPa √m at which the tooth breaks at once.
    source : str
    """

    stages: tuple[GrowthStage, ...]
    threshold: float = 2.0
    toughness: float = 60.0
    source: str = ""

    def __post_init__(self) -> None:
        count(len(self.stages), "stages", minimum=1)
        not_negative(self.threshold, "threshold", "MPa √m")
        within(self.toughness, "toughness", max(self.threshold, 1e-3), 1e4, "MPa √m")

    def rate_mm(self, delta_k: FloatArray, c: FloatArray | float = 0.0, m: FloatArray | float = 0.0) -> FloatArray:
        """da/dN in mm; 0 below the threshold."""
        slowest = np.min([stage.rate_mm(delta_k, c, m) for stage in self.stages], axis=0)
        return np.where(delta_k > self.threshold, slowest, 0.0)


_PER_MPA_SQRT_M = 1e3**0.5
"""N/mm^1.5 in 1 MPa √m."""
STEEL_IN_AIR = GrowthLaw(
    (
        GrowthStage(1.21e-26 * _PER_MPA_SQRT_M**8.16, 8.16, float(np.log10(4.37 / 1.21)) / 2.0),
        GrowthStage(3.98e-13 * _PER_MPA_SQRT_M**2.88, 2.88, float(np.log10(6.77 / 3.98)) / 2.0),
    ),
    threshold=2.0,
    source="BS 7910, steels in air, R below 0.5: two stages, their mean and mean plus two standard deviations; "
    "threshold 63 N/mm^1.5",
)
"""Weldable structural steels; no law for case-hardened gear steels is available."""


@dataclass(frozen=True)
class StressIntensity(Result):
    """Stress intensity of a crack through the whole face, maximum over the tooth's passage through the mesh.

    Parameters
    ----------
    depth_mm : array, (n,)
    k_mpa_sqrt_m : array, (n,)
        In effect √(K_I² + K_II²).
    force_n : array, (n,)
        Force on the tooth at the maximum.
    mesh_cycles : array, (n,)
        Position of the maximum, from the tooth's entry.
    """

    depth_mm: FloatArray
    k_mpa_sqrt_m: FloatArray
    force_n: FloatArray
    mesh_cycles: FloatArray


def stress_intensity(
    gear: ReducedGear, mesh: GearMesh, side: int, torque_nm: float, depth_mm: FloatArray, angle_deg: float = 45.0
) -> StressIntensity:
    """Stress intensity of a root crack, from the energy released as the crack grows in a straight line.

    Parameters
    ----------
    gear : ReducedGear
        The gear with the crack; its finite elements are solved at up to eleven depths, unless cached.
    mesh : GearMesh
        Determines the load sharing between teeth, including the cracked one.
    side : int
        1: the driver's tooth; 2: the driven gear's.
    torque_nm : float
        On the driver, above 0.
    depth_mm : array, (n,)
        Above 0, up to the depth that the finite elements can follow.
    angle_deg : float

    Notes
    -----
    For edge-cracked strips of known K the same finite elements and derivative are accurate to 3 %. The crack runs
    straight at its angle; beyond the tooth's middle it leaves the bending zone, and less energy is released. A real
    crack turns towards the maximum release. The crack faces do not touch and the front is straight.
    """
    if mesh.overlap_ratio:
        raise InputError("a crack in a helical tooth has no straight front", allowed="spur pairs")
    if gear.blank.geometry != mesh.side(side).gear:
        raise InputError("the finite-element gear is not the one of the mesh", where="gear")
    deepest = deepest_followed_mm(gear.blank, crack_size(gear), angle_deg)
    depths = np.atleast_1d(np.asarray(depth_mm, dtype=np.float64))
    if deepest == 0.0 or depths.min() <= 0.0 or depths.max() > deepest * (1.0 + 1e-9):
        raise InputError(
            f"depths from {depths.min():g} to {depths.max():g} mm",
            where="depth_mm",
            allowed=f"above 0, up to {deepest:.3g} mm at {angle_deg:g}°, the limit of the finite elements",
        )
    solved = deepest_crack_mm(gear.blank.geometry, angle_deg) * np.array(DEPTH_PARTS)
    solved = solved[solved <= deepest * (1.0 + 1e-9)]
    added = np.array([crack_added_m_per_n(gear, RootCrack(float(q), angle_deg)).mean(axis=(1, 2)) for q in solved])
    per_force2 = energy_release_m(solved * 1e-3, added, depths * 1e-3)  # (n, n_heights)
    cycles = np.linspace(0.0, mesh.pair.contact_ratio, 120)[1:-1]
    roll = rolls_rad(mesh.pair, cycles)[side - 1]
    slot = np.floor(cycles + mesh.ramp / 2.0).astype(int)
    material = gear.blank.material
    stiffness = material.youngs_modulus_pa / (1.0 - material.poisson_ratio**2)
    rows = []
    for depth, release in zip(depths, per_force2, strict=True):
        cracked = replace(mesh, **{f"cracks_{side}": (RootCrack(float(depth), angle_deg),)})  # type: ignore[arg-type]
        force = share_torque(cracked, torque_nm, cycles).pair_forces_n[np.arange(len(cycles)), slot]
        slope = np.maximum(over_height(gear.grid.roll_rad, release, roll), 0.0)
        k = force * np.sqrt(stiffness * slope / (2.0 * mesh.face_width_m))
        worst = int(np.argmax(k))
        rows.append((float(k[worst]) * 1e-6, float(force[worst]), float(cycles[worst])))
    k_values, forces, at = np.array(rows).T
    return StressIntensity(depths, k_values, forces, at)


@dataclass(frozen=True)
class CrackGrowth(Result):
    """Revolutions in which a crack grows to each depth.

    Parameters
    ----------
    depth_mm : array, (n,)
        From the present depth to the end.
    k_mpa_sqrt_m : array, (n,)
        ΔK; the tooth is unloaded in between.
    turns : array, (3, n)
        Revolutions from now to each depth: 5 %, 50 % and 95 % quantiles of the specimens.
    ends : str
        Reason for the end: "toughness", or "depth", the limit of the finite elements.
    resting_share : float
        Fraction of the specimens whose crack does not grow, as ΔK is below the threshold.
    """

    depth_mm: FloatArray
    k_mpa_sqrt_m: FloatArray
    turns: FloatArray
    ends: str
    resting_share: float

    @property
    def remaining_turns(self) -> tuple[float, float, float]:
        """5 %, 50 % and 95 % quantiles at the end; infinite if the crack does not grow."""
        low, middle, high = (float(t) for t in self.turns[:, -1])
        return low, middle, high


def crack_growth(
    depth_mm: FloatArray,
    k_mpa_sqrt_m: FloatArray,
    law: GrowthLaw,
    rng: np.random.Generator,
    *,
    first_mm: tuple[float, float] | None = None,
    n_specimens: int = 2000,
) -> CrackGrowth:
    """Revolutions to each depth, N = ∫ da/(C ΔK^m), with one load cycle from 0 to its maximum per revolution.

    Parameters
    ----------
    depth_mm, k_mpa_sqrt_m : array, (n,)
        E.g. from `stress_intensity`; the first is the present depth.
    law : GrowthLaw
    rng : numpy.random.Generator
        Draws specimens of the steel.
    first_mm : (float, float) or None
        90 % interval of the present depth, which is then also drawn, from a normal distribution within the depths.
    n_specimens : int

    Notes
    -----
    Neglected: retardation by overloads, residual stress of a hardened case, corrosion, closure, a crack that turns.
    """
    depth, k = np.asarray(depth_mm, dtype=np.float64), np.asarray(k_mpa_sqrt_m, dtype=np.float64)
    count(len(depth), "depths", minimum=3)
    broken = np.flatnonzero(k >= law.toughness)
    last = int(broken[0]) + 1 if len(broken) else len(depth)
    if last < 2:
        raise InputError(f"K is {k[0]:.3g} MPa √m at the present depth", allowed=f"below {law.toughness:g}: it breaks")
    depth, k = depth[:last], k[:last]
    # Finer steps of depth, with log K interpolated: slow stages grow with the eighth power of K.
    fine = np.linspace(depth[0], depth[-1], max(400, 4 * len(depth)))
    delta_k = np.exp(np.interp(fine, depth, np.log(np.maximum(k, 1e-9))))
    c, m = rng.standard_normal((2, count(n_specimens, "n_specimens", minimum=20), 1))
    with np.errstate(divide="ignore", invalid="ignore"):
        slowness = 1.0 / law.rate_mm(delta_k, c, m)
    steps = 0.5 * (slowness[:, 1:] + slowness[:, :-1]) * np.diff(fine)
    turns = np.concatenate((np.zeros((len(c), 1)), np.cumsum(steps, axis=1)), axis=1)
    if first_mm is not None:
        middle, half = sum(first_mm) / 2.0, (first_mm[1] - first_mm[0]) / 2.0
        start = np.clip(middle + half / 1.645 * rng.standard_normal(len(c)), fine[0], fine[-1])
        done = np.array([np.interp(s, fine, row) for s, row in zip(start, turns, strict=True)])
        turns = np.where(np.isfinite(turns), np.maximum(turns - done[:, None], 0.0), inf)
    kept = np.searchsorted(fine, depth).clip(0, len(fine) - 1)
    quantiles = np.quantile(turns[:, kept], (0.05, 0.5, 0.95), axis=0, method="lower")
    resting = float(np.mean(~np.isfinite(turns[:, -1])))
    return CrackGrowth(depth, k, quantiles, "toughness" if len(broken) else "depth", resting)
