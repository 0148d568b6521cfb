"""A gear pair with everything that determines its mesh stiffness."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise, product
from math import cos, floor, log, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, frozen_array, one_of, within
from gearsig.errors import InputError
from sims.mesh._faults import (
    RootCrack,
    ToothChip,
    ToothSpall,
    check_chip,
    check_crack,
    check_spall,
    chip_share,
    crack_tip_mm,
    effective_flank_mm,
    spall_share,
)
from sims.mesh._flank import (
    IDEAL_FLANK,
    STRAIGHT,
    FlankDeviation,
    FlankRoughness,
    Lead,
    check_deviation,
    normal_roll_rad,
    normal_section,
)
from sims.mesh._geometry import (
    STEEL,
    WORKING_PRESSURE_PA,
    GearGeometry,
    Material,
    PairGeometry,
    contact_half_width_mm,
    fillet_outline,
    flexibility_per_pa,
    involute_outline,
    root_half_angle_rad,
    root_point_mm,
    smooth_step,
)

# --------------------
# The gear body below the teeth, through which neighbouring teeth move each other.
# --------------------


BODIES = ("separate", "coupled")
"""Whether teeth of one gear that carry load at the same time move each other."""
_RESOLVED = 40.0  # harmonics times the root's half angle: the rest adds less than 1e-3 of a tooth's own compliance


def body_compliance(
    gear: GearGeometry, material: Material, load_angle_rad: FloatArray, deflected_rad: FloatArray, offset: int
) -> FloatArray:
    """Deflection of a tooth along its force, through the body, per N on 1 m of face width of a tooth `offset` away.

    δ_i = a_iᵀ C(2π k/z) a_j,  a = (−sin α_m, cos α_m, u cos α_m)

    C holds the motions of a root arc (mean radial and tangential displacement, rotation) for unit loads of the same
    kinds on another root arc of an annulus in plane stress, fixed at the bore: a Fourier series whose terms are solved
    in closed form. u is the distance from the root circle to the intersection of the force and the tooth centre line.
    a converts the contact force into loads on the root.

    Parameters
    ----------
    gear : GearGeometry
    material : Material
    load_angle_rad, deflected_rad : array, (n,)
        α_m of the tooth that moves, and of the tooth that is loaded.
    offset : int
        k, teeth from the loaded one in the direction of its force. 0: the tooth itself, for which
        `foundation_compliance` gives a published polynomial.

    Returns
    -------
    array, (n,)
        m²/N; divide by the face width in m.

    Notes
    -----
    For gears of 50, 55 and 75 teeth the tooth itself is within 6 % of `foundation_compliance` (10 % at the tip); the
    effect of neighbours, the mean of both sides, within 6 % of three-dimensional finite elements (14 % near the tips).

    Source: P. Sainsot, P. Velex, O. Duverger, Contribution of gear body to tooth deflections – a new bidimensional
    analytical formula, Journal of Mechanical Design 126 (2004), for the annulus under root loads; the kinds of load and
    the coupling of neighbours are this package's own.
    """
    theta = root_half_angle_rad(gear)
    ratio = gear.root_radius_mm / gear.bore_mm
    arc = arc_compliance(ratio, theta, 2.0 * pi * offset / gear.teeth, material.poisson_ratio)
    moved, loaded = _root_loads(gear, load_angle_rad), _root_loads(gear, deflected_rad)
    result: FloatArray = np.einsum("in,ij,jn->n", moved, arc, loaded) / material.youngs_modulus_pa
    return result


def _root_loads(gear: GearGeometry, load_angle_rad: FloatArray) -> FloatArray:
    """Radial and tangential force and moment on the root for 1 N on the flank, (3, n); lengths in root radii."""
    alpha = np.atleast_1d(np.asarray(load_angle_rad, dtype=np.float64))
    arm = gear.base_radius_mm / np.cos(alpha) / gear.root_radius_mm - 1.0
    return np.array([-np.sin(alpha), np.cos(alpha), arm * np.cos(alpha)])


@lru_cache(maxsize=64)
def arc_compliance(radius_ratio: float, half_angle_rad: float, apart_rad: float, poisson_ratio: float) -> FloatArray:
    """Motions of one arc of an annulus's rim for loads on another, (3, 3), for E = 1, width 1, rim radius 1.

    Parameters
    ----------
    radius_ratio : float
        h, rim over bore; the bore is fixed.
    half_angle_rad : float
        θ of each arc.
    apart_rad : float
        From the middle of the loaded arc to that of the other, counter-clockwise.
    poisson_ratio : float

    Returns
    -------
    array, (3, 3)
        Rows: mean radial displacement, mean tangential displacement, rotation. Columns: unit radial force (uniform over
        the arc), tangential force (uniform), moment (linear radial stress).
    """
    theta = half_angle_rad
    total = np.zeros((3, 3))
    for n in range(int(_RESOLVED / theta)):
        rim = _rim_of_harmonic(n, radius_ratio, poisson_ratio)
        mean = sin(n * theta) / (n * theta) if n else 1.0
        tilt = -3.0 / theta**3 * (sin(n * theta) / n**2 - theta * cos(n * theta) / n) if n else 0.0
        share = 1.0 / pi if n else 0.5 / pi
        c, s = cos(n * apart_rad), sin(n * apart_rad)
        # Radial loads σ cos nθ cause u = U cos nθ, v = V sin nθ; tangential loads τ cos nθ and moments σ sin nθ the
        # same, shifted by a quarter wave: u = U sin nθ, v = −V cos nθ.
        u, v = share * mean * rim[:, 0]
        total[:, 0] += u * c * mean, v * s * mean, -tilt * s * u
        if n == 0:
            total[1, 1] += share * rim[1, 1]
            continue
        for column, (u, v) in ((1, -share * mean * rim[:, 1]), (2, tilt / pi * rim[:, 0])):
            total[:, column] += u * s * mean, -v * c * mean, tilt * c * u
    return frozen_array(total, "arc compliance", ndim=2)


@lru_cache(maxsize=8192)
def _rim_of_harmonic(n: int, radius_ratio: float, poisson_ratio: float) -> FloatArray:
    """(U, V) at the rim, rows, for σ_r = cos nθ and τ = sin nθ there, columns; E = 1, rim radius 1, bore fixed.

    The plane elastic equations are solved by r^p with p = ±(n + 1), ±(n − 1); at n = 1 two of these are replaced by a
    translation and a solution with ln r.
    """
    nu, bore = poisson_ratio, 1.0 / radius_ratio
    lam, mu = nu / (1.0 - nu**2), 0.5 / (1.0 + nu)  # of plane stress
    k = lam + 2.0 * mu
    if n == 0:
        radial = np.linalg.solve([[bore, 1.0 / bore], [k + lam, lam - k]], [0.0, 1.0]).sum()
        torsional = np.linalg.solve([[bore, 1.0 / bore], [0.0, -2.0 * mu]], [0.0, 1.0]).sum()
        return np.diag([radial, torsional])

    def powers(p: float) -> tuple[tuple[float, float], ...]:
        v = -(k * (p * p - 1.0) - mu * n * n) / (n * ((lam + mu) * p - (lam + 3.0 * mu)))
        at_rim, at_bore = (radius_ratio**p, 1.0) if p < 0.0 else (1.0, bore**p)
        return (at_bore, at_bore * v), (at_rim, at_rim * v), (at_rim * p, at_rim * p * v)

    solutions = [powers(float(p)) for p in ((2, -2) if n == 1 else (n + 1, n - 1, 1 - n, -n - 1))]
    if n == 1:
        extra = -(lam + mu) / (lam + 3.0 * mu)
        solutions.append(((1.0, -1.0), (1.0, -1.0), (0.0, 0.0)))
        solutions.append(((log(bore), -log(bore) + extra), (0.0, extra), (1.0, -1.0)))
    equations = np.array(
        [(ub, vb, k * du + lam * (u + n * v), mu * (dv - v - n * u)) for (ub, vb), (u, v), (du, dv) in solutions]
    ).T
    parts = np.linalg.solve(equations, [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return np.array([rim for _, rim, _ in solutions]).T @ parts


# --------------------
# A tooth, its foundation and the contact.
# --------------------


# Compliance of one tooth as a cantilever: bending, shear and axial compression along its exact outline.

SHEAR_FACTOR = 1.2
"""Shear correction factor of a rectangular section."""

N_NODES = 24
"""Gauss points on each part of the outline; 96 change the compliance by less than 1e-13."""


class ToothCompliance(NamedTuple):
    """Deflection along the force for 1 N on 1 m of face width, by cause; m²/N."""

    bending: FloatArray
    shear: FloatArray
    axial: FloatArray

    @property
    def total(self) -> FloatArray:
        """Sum of the three."""
        return self.bending + self.shear + self.axial


class _Sections(NamedTuple):
    """Sections between root and contact, one row per contact, in m; dx includes the Gauss weight."""

    x: FloatArray
    front: FloatArray
    back: FloatArray
    dx: FloatArray


def tooth_compliance(
    gear: GearGeometry,
    material: Material,
    roll_rad: FloatArray,
    crack: tuple[float, float] | None = None,
    law: str = "two lines",
) -> ToothCompliance:
    """Deflection of a tooth loaded on its flank, relative to its root, from the strain energy of a beam.

    1/k_b = ∫ M²/(E I) dx,  1/k_s = ∫ 1.2 cos²α_m/(G A) dx,  1/k_a = ∫ sin²α_m/(E A) dx

    over the sections from the root circle to the contact, for unit force. The moment about the tooth's centre line is
    exactly M = r_b − x cos α_m; behind a crack the section's centroid is offset by y₀, which adds y₀ sin α_m.

    Parameters
    ----------
    gear : GearGeometry
    material : Material
    roll_rad : array, (n,)
        τ = tan α at the contact, from the form roll to the tip roll.
    crack : (depth_mm, angle_deg) or None
        Constant over the whole width considered.
    law : str
        Which part of the tooth behind the crack carries no load; see `effective_flank_mm`.

    Returns
    -------
    ToothCompliance
        Arrays (n,), m²/N; divide by the face width in m.

    Source: X. Tian, *Dynamic simulation for system response of gearbox including localized gear faults*, University of
    Alberta (2004), for the energies; the outline with its trochoid fillet and the moment about r_b are derived.
    """
    tau = np.atleast_1d(np.asarray(roll_rad, dtype=np.float64))
    sections = _sections(gear, tau, crack, law)
    load_angle = (tau - gear.base_half_angle_rad)[:, None]
    sine, cosine = np.sin(load_angle), np.cos(load_angle)
    height = sections.front + sections.back
    moment = gear.base_radius_mm * 1e-3 - sections.x * cosine + sine * (sections.front - sections.back) / 2.0
    bending = np.sum(12.0 * moment**2 / height**3 * sections.dx, axis=1)
    length_over_height = np.sum(sections.dx / height, axis=1)
    shear = 2.0 * SHEAR_FACTOR * (1.0 + material.poisson_ratio) * cosine[:, 0] ** 2 * length_over_height
    axial = sine[:, 0] ** 2 * length_over_height
    e = material.youngs_modulus_pa
    return ToothCompliance(bending / e, shear / e, axial / e)


def friction_compliance(
    gear: GearGeometry, material: Material, roll_rad: FloatArray, *, along_itself: bool = False
) -> FloatArray:
    """Deflection of a tooth along the contact normal, for 1 N of friction towards its tip on 1 m of face width.

    c_nt = (1/E) Σ [12 M_n M_t/h³ + 2.4 (1 + ν) sin α_m cos α_m/h − sin α_m cos α_m/h] dx,
    M_n = r_b − x cos α_m,  M_t = (x_c − x) sin α_m + y_c cos α_m

    and along the friction force itself, c_tt, with M_t², sin² α_m and cos² α_m.

    Friction μN changes a contact's compliance to c_nn ± μ c_nt: towards the root in approach (stiffer), towards the tip
    in recess (softer). The common squaring of M_n ± μ M_t doubles this change, because it includes the work of the
    friction force, which is not part of the normal deflection: c_nn ± 2 μ c_nt + μ² c_tt.

    Parameters
    ----------
    gear, material, roll_rad
        As for `tooth_compliance`; the gear body is not included.
    along_itself : bool
        Return c_tt, the deflection along the friction force.

    Returns
    -------
    array, (n,)
        m²/N; divide by the face width in m.
    """
    tau = np.atleast_1d(np.asarray(roll_rad, dtype=np.float64))
    sections = _sections(gear, tau, None, "two lines")
    angle = (tau - gear.base_half_angle_rad)[:, None]
    sine, cosine = np.sin(angle), np.cos(angle)
    place = involute_outline(gear, tau[:, None])
    base, height = gear.base_radius_mm * 1e-3, sections.front + sections.back
    normal = base - sections.x * cosine
    along = (place.x_mm * 1e-3 - sections.x) * sine + place.y_mm * 1e-3 * cosine
    lever, shear, axial = (along, sine**2, cosine**2) if along_itself else (normal, sine * cosine, -sine * cosine)
    bending = np.sum(12.0 * lever * along / height**3 * sections.dx, axis=1)
    shear_and_axial = (2.0 * SHEAR_FACTOR * (1.0 + material.poisson_ratio) * shear + axial)[:, 0]
    result: FloatArray = (bending + shear_and_axial * np.sum(sections.dx / height, axis=1)) / material.youngs_modulus_pa
    return result


def cracked_tooth_compliance(
    gear: GearGeometry,
    material: Material,
    roll_rad: FloatArray,
    crack: RootCrack,
    face_width_m: float,
) -> FloatArray:
    """Compliance of a tooth with a crack over all or part of its width, as parallel slices: 1/k = 1/Σ k(w) dw.

    Parameters
    ----------
    gear, material, roll_rad
        As for `tooth_compliance`.
    crack : RootCrack
    face_width_m : float
        Loaded width; a wider crack counts as a through crack.

    Returns
    -------
    array
        m/N (not per width).

    Source: Z. Chen, Y. Shao, Dynamic simulation of spur gear with tooth root crack propagating along tooth width and
    crack depth, Engineering Failure Analysis 18 (2011), for the slices, which do not support each other.
    """
    check_crack(gear, crack)
    width = face_width_m if crack.width_mm is None else min(crack.width_mm * 1e-3, face_width_m)
    stiffness = width / tooth_compliance(gear, material, roll_rad, (crack.depth_mm, crack.angle_deg)).total
    if width < face_width_m:
        stiffness += (face_width_m - width) / tooth_compliance(gear, material, roll_rad).total
    return 1.0 / stiffness


def _sections(gear: GearGeometry, tau: FloatArray, crack: tuple[float, float] | None, law: str) -> _Sections:
    node, weight = _gauss(N_NODES)
    pieces: list[tuple[FloatArray, ...]] = []
    cuts = _fillet_cuts(gear, crack)
    for low, high in pairwise(cuts):
        fillet = fillet_outline(gear, low + (high - low) * node)  # below every contact, so the same for all
        rows = fillet.x_mm, fillet.y_mm, fillet.dx_mm * weight * (high - low)
        pieces.append(tuple(np.broadcast_to(row, (len(tau), N_NODES)) for row in rows))
    span = (tau - gear.form_roll_rad)[:, None]
    flank = involute_outline(gear, gear.form_roll_rad + span * node)
    pieces.append((flank.x_mm, flank.y_mm, flank.dx_mm * weight * span))
    x, y, dx = (np.concatenate(part, axis=1) for part in zip(*pieces, strict=True))
    front = y if crack is None else effective_flank_mm(gear, *crack, x, y, law)
    return _Sections(x * 1e-3, front * 1e-3, y * 1e-3, dx * 1e-3)


def _fillet_cuts(gear: GearGeometry, crack: tuple[float, float] | None) -> tuple[float, ...]:
    """γ from the root circle to the involute, split where the sections jump: at a crack's tip and mouth."""
    root, form = pi / 2.0, gear.pressure_angle_rad
    if crack is None:
        return root, form
    x_end, _ = crack_tip_mm(gear, *crack)
    middle = (root + form) / 2.0
    if x_end <= root_point_mm(gear)[0]:
        return root, middle, form
    from scipy.optimize import brentq

    def off(gamma: float) -> float:
        return float(fillet_outline(gear, np.array([gamma])).x_mm[0]) - x_end

    at_end = middle if off(middle) <= 0.0 else float(brentq(off, middle, root, xtol=1e-14))
    return (root, at_end, form) if at_end == middle else (root, at_end, middle, form)


@lru_cache(maxsize=8)
def _gauss(n: int) -> tuple[FloatArray, FloatArray]:
    """Gauss–Legendre nodes and weights on 0 to 1."""
    x, w = np.polynomial.legendre.leggauss(n)
    return (x + 1.0) / 2.0, w / 2.0


# Contact compliance.

CONTACT_LAWS = ("linear", "load-dependent")


def linear_contact_compliance(material_1: Material, material_2: Material, face_width_m: float) -> float:
    """1/k_h of two cylinders by the common linear form, 4 (1 − ν²)/(π E b), in m/N.

    It is independent of load and curvature, and stiffer than a real contact at working load.

    Source: D. C. H. Yang, J. Y. Lin, Hertzian damping, tooth friction and bending elasticity in gear impact dynamics,
    Journal of Mechanisms, Transmissions, and Automation in Design 109 (1987).
    """
    return 2.0 * flexibility_per_pa(material_1, material_2) / (pi * face_width_m)


def load_dependent_contact_coefficient(material_1: Material, material_2: Material, face_width_m: float) -> float:
    """B of the approach δ = B F^0.9 of a line contact, B = 1.275/(E^0.9 b^0.8), in m/N^0.9.

    E is the harmonic mean of the two moduli.

    Source: A. Palmgren, *Ball and Roller Bearing Engineering* (1959), for the exponents; 1.275 as used for steel gears.
    """
    e = 2.0 / (1.0 / material_1.youngs_modulus_pa + 1.0 / material_2.youngs_modulus_pa)
    return float(1.275 / (e**0.9 * face_width_m**0.8))


# Compliance of the gear body below a tooth: fillet foundation.

_COEFFICIENTS = np.array(
    [
        [-5.574e-5, -1.9986e-3, -2.3015e-4, 4.7702e-3, 0.0271, 6.8045],
        [60.111e-5, 28.100e-3, -83.431e-4, -9.9256e-3, 0.1624, 0.9086],
        [-50.952e-5, 185.50e-3, 0.0538e-4, 53.300e-3, 0.2895, 0.9236],
        [-6.2042e-5, 9.0889e-3, -4.0964e-4, 7.8297e-3, -0.1472, 0.6904],
    ]
)
"""Rows L*, M*, P*, Q*; columns A to F."""

RADIUS_RATIO_RANGE = (1.4, 7.0)
ROOT_ANGLE_RANGE_RAD = (0.01, 0.12)


def foundation_factors(radius_ratio: float, root_angle_rad: float) -> FloatArray:
    """L*, M*, P*, Q* from X = A/θ² + B h² + C h/θ + D/θ + E h + F.

    Parameters
    ----------
    radius_ratio : float
        h, root radius over bore radius; the polynomial was fitted for 1.4 to 7.
    root_angle_rad : float
        θ, half the angle of the tooth on the root circle; fitted for 0.01 to 0.12 rad.

    Source: P. Sainsot, P. Velex, O. Duverger, Contribution of gear body to tooth deflections – a new bidimensional
    analytical formula, Journal of Mechanical Design 126 (2004).
    """
    h, theta = radius_ratio, root_angle_rad
    terms = np.array([1.0 / theta**2, h**2, h / theta, 1.0 / theta, h, 1.0])
    factors: FloatArray = _COEFFICIENTS @ terms
    return factors


def foundation_compliance(gear: GearGeometry, material: Material, load_angle_rad: FloatArray) -> FloatArray:
    """Deflection of a tooth along its force by the body's compliance, for 1 N on 1 m of face width.

    δ b E/F = cos²α_m [L* (u/S)² + M* u/S + P* (1 + Q* tan²α_m)]

    u is the distance from the root circle to the intersection of the force and the tooth centre line, S the root
    thickness.

    Parameters
    ----------
    gear : GearGeometry
    material : Material
    load_angle_rad : array
        α_m, between the force and the normal of the tooth's centre line.

    Returns
    -------
    array
        m²/N; divide by the face width in m.

    Notes
    -----
    Teeth of one gear share the body, so neighbours in contact also move each other: see `body_compliance`. A crack does
    not change the body's compliance here.
    """
    l_star, m_star, p_star, q_star = foundation_factors(gear.root_radius_mm / gear.bore_mm, root_half_angle_rad(gear))
    cosine, tangent = np.cos(load_angle_rad), np.tan(load_angle_rad)
    root_thickness = 2.0 * gear.root_radius_mm * root_half_angle_rad(gear)
    ratio = (gear.base_radius_mm / cosine - gear.root_radius_mm) / root_thickness
    shape = l_star * ratio**2 + m_star * ratio + p_star * (1.0 + q_star * tangent**2)
    result: FloatArray = cosine**2 * shape / material.youngs_modulus_pa
    return result


def foundation_notes(gear: GearGeometry) -> tuple[str, ...]:
    """Return a note for each quantity outside the range for which the foundation's polynomial was fitted."""
    ratio, angle = gear.root_radius_mm / gear.bore_mm, root_half_angle_rad(gear)
    name = f"gear of {gear.teeth} teeth: foundation compliance is extrapolated,"
    notes = []
    if not RADIUS_RATIO_RANGE[0] <= ratio <= RADIUS_RATIO_RANGE[1]:
        notes.append(f"{name} root over bore radius is {ratio:.3g} (fitted for 1.4 to 7)")
    if not ROOT_ANGLE_RANGE_RAD[0] <= angle <= ROOT_ANGLE_RANGE_RAD[1]:
        notes.append(f"{name} root half angle is {angle:.3g} rad (fitted for 0.01 to 0.12)")
    return tuple(notes)


class MeshSide(NamedTuple):
    """One gear of a mesh, with its material, flank and faults."""

    gear: GearGeometry
    material: Material
    flank: FlankDeviation
    roughness: FlankRoughness | None
    cracks: tuple[RootCrack, ...]
    spalls: tuple[ToothSpall, ...]
    chips: tuple[ToothChip, ...]

    def faults_of(self, tooth: int) -> ToothFaults:
        """Faults of one tooth."""
        kinds = (self.cracks, self.spalls, self.chips)
        return ToothFaults(*(next((f for f in kind if f.tooth == tooth), None) for kind in kinds))  # type: ignore[arg-type]

    @property
    def faulty_teeth(self) -> tuple[int, ...]:
        """Teeth with a crack, a spall or a chip, in ascending order."""
        return tuple(sorted(_teeth(self.cracks) | _teeth(self.spalls) | _teeth(self.chips)))


class ToothFaults(NamedTuple):
    """Faults of one tooth; none by default."""

    crack: RootCrack | None = None
    spall: ToothSpall | None = None
    chip: ToothChip | None = None


HEALTHY = ToothFaults()
"""A tooth without a fault."""


@dataclass(frozen=True)
class GearMesh:
    """Geometry, material, contact law, faults and flanks of a pair; 1 is the driver, 2 the driven gear.

    Parameters
    ----------
    pair : PairGeometry
    material_1, material_2 : Material
    contact_law : str
        "linear": a constant contact stiffness. "load-dependent": approach proportional to the force to the power 0.9.
    cracks_1, cracks_2 : tuple of RootCrack
        At most one per tooth.
    flank_1, flank_2 : FlankDeviation
    ramp : float
        In base pitches, 0 to 0.1: the length, centred on the ideal point, over which a pair gains or loses its
        stiffness. 0 switches abruptly, which costs an integrator its order.
    roughness_1, roughness_2 : FlankRoughness or None
        A separate profile for each tooth, which repeats with that tooth.
    spalls_1, spalls_2 : tuple of ToothSpall
        At most one per tooth.
    chips_1, chips_2 : tuple of ToothChip
        At most one per tooth.
    body : str
        "separate": teeth do not move each other, as in published models; double contact then appears stiffer than it
        is. "coupled": teeth that carry load at the same time move each other through the body.
    lead : Lead
        Helix, crowning and misalignment along the face. With a helix the gears of the pair are transverse sections;
        teeth and body have the compliance of the normal section, on contact lines longer by 1/cos β_b.

    Notes
    -----
    Every pair has its own compliance and separation; pairs act in parallel. With a coupled body, the compliance of a
    pair includes the effect of its neighbours' forces at the load sharing of healthy teeth. Faults and roughness are
    the same in every slice of the face. Heating is neglected. Only the driving flanks are described.
    """

    pair: PairGeometry
    material_1: Material = STEEL
    material_2: Material = STEEL
    contact_law: str = "linear"
    cracks_1: tuple[RootCrack, ...] = ()
    cracks_2: tuple[RootCrack, ...] = ()
    flank_1: FlankDeviation = IDEAL_FLANK
    flank_2: FlankDeviation = IDEAL_FLANK
    ramp: float = 0.05
    roughness_1: FlankRoughness | None = None
    roughness_2: FlankRoughness | None = None
    spalls_1: tuple[ToothSpall, ...] = ()
    spalls_2: tuple[ToothSpall, ...] = ()
    chips_1: tuple[ToothChip, ...] = ()
    chips_2: tuple[ToothChip, ...] = ()
    body: str = "separate"
    lead: Lead = STRAIGHT

    def __post_init__(self) -> None:
        one_of(self.body, "body", BODIES)
        one_of(self.contact_law, "contact_law", CONTACT_LAWS)
        within(self.ramp, "ramp", 0.0, 0.1, "base pitches")
        for number in (1, 2):
            side = self.side(number)
            check_deviation(side.gear, side.flank)
            self._check_faults(number)
            _check_roughness(side)
        self._check_corner_contact()

    @property
    def face_width_m(self) -> float:
        """Loaded width."""
        return self.pair.face_width_mm * 1e-3

    @property
    def healthy(self) -> GearMesh:
        """The mesh without cracks, spalls and chips; flank deviations and roughness stay."""
        return replace(self, cracks_1=(), cracks_2=(), spalls_1=(), spalls_2=(), chips_1=(), chips_2=())

    @property
    def n_slots(self) -> int:
        """Maximum number of pairs that carry load at the same time, ramps included."""
        return floor(self.pair.contact_ratio + self.overlap_ratio + self.ramp) + 1

    @property
    def overlap_ratio(self) -> float:
        """Overlap ratio ε_β, 0 for a spur pair."""
        return self.lead.overlap_ratio(self.pair)

    @property
    def axial_share(self) -> float:
        """Axial force on the driver over the force along the line of action, tan β_b; along +z if above 0."""
        return self.lead.axial_share(self.pair)

    @cached_property
    def contact_coefficient(self) -> float:
        """Compliance of the contact in m/N (linear), or B in m/N^0.9 (load-dependent)."""
        linear = self.contact_law == "linear"
        law = linear_contact_compliance if linear else load_dependent_contact_coefficient
        # Normal force, approach and contact lines are all larger by 1/cos β_b.
        steep = cos(self.lead.base_helix_rad(self.pair)) ** (-1.0 if linear else -1.1)
        return float(law(self.material_1, self.material_2, self.face_width_m) * steep)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """Where the mesh is outside the range of its formulas; empty if nowhere."""
        return foundation_notes(self.pair.driver) + foundation_notes(self.pair.driven)

    @cached_property
    def contact_compliance(self) -> float:
        """Contact compliance in m/N at working pressure: the constant, or the secant B N^-0.1 at 1 GPa."""
        if self.contact_law == "linear":
            return self.contact_coefficient
        half_width_m = contact_half_width_mm(self.pair, self.material_1, self.material_2) * 1e-3
        force = pi / 2.0 * half_width_m * WORKING_PRESSURE_PA * self.face_width_m
        return float(self.contact_coefficient * force**-0.1)

    def side(self, number: int) -> MeshSide:
        """Return gear 1, the driver, or gear 2, the driven gear, with its material, flank and faults."""
        gear = (self.pair.driver, self.pair.driven)[number - 1]
        return MeshSide(gear, *(getattr(self, f"{name}_{number}") for name in MeshSide._fields[1:]))

    def roll_length_mm(self, side: int, progress: FloatArray) -> FloatArray:
        """ρ of gear 1 or 2 at ζ in mm, not below 0: a ramp may begin below the base circle, where there is no flank."""
        rho: FloatArray = self.pair.contact_radii_mm(np.atleast_1d(np.asarray(progress, dtype=np.float64)))[side - 1]
        return np.maximum(rho, 0.0)

    def gear_compliance(self, side: int, progress: FloatArray, faults: ToothFaults = HEALTHY) -> FloatArray:
        """Compliance of tooth and foundation of one gear, plus the increase by a spall or chip, in m/N.

        c = c_tooth/(1 − λ_chip) + c_foundation + Σ_j c_ij N_j/N_i + c_h [λ_spall/(1 − λ_spall) + λ_chip/(1 − λ_chip)]

        where λ is the fraction of the width lost to the fault, and j the neighbours if the body is coupled. The contact
        compliance of healthy flanks, c_h, is not included.

        Parameters
        ----------
        side : int
            1 for the driver, 2 for the driven gear.
        progress : array
            ζ = c − k, base pitches since the pair's ideal entry, 0 to the contact ratio.
        faults : ToothFaults
            Of the tooth.
        """
        material, rho = self.side(side).material, self.roll_length_mm(side, progress)
        gear, roll, width = self._yielding(side, rho)
        if faults.crack is None:
            tooth = tooth_compliance(gear, material, roll).total / width
        else:
            tooth = cracked_tooth_compliance(gear, material, roll, faults.crack, width)
        foundation = foundation_compliance(gear, material, roll - gear.base_half_angle_rad) / width
        result: FloatArray = tooth + foundation + self._lost_width_compliance(side, progress, faults, tooth)
        return result + self._neighbour_compliance(side, progress) if self.body == "coupled" else result

    def _yielding(self, side: int, rho: FloatArray) -> tuple[GearGeometry, FloatArray, float]:
        """Gear that determines the compliance, roll angles on it, and width in m; with a helix, of the normal section.

        Along the line of action a tooth of width b has the compliance c_n/(b cos β_b): contact lines are longer by
        1/cos β_b, and normal to the flank the force is larger, the approach smaller, by 1/cos β_b.
        """
        gear = self.side(side).gear
        virtual = normal_section(gear, self.lead.helix_angle_deg)
        width = self.face_width_m * cos(self.lead.base_helix_rad(self.pair))
        return virtual, normal_roll_rad(gear, virtual, rho / gear.base_radius_mm), width

    def _neighbour_compliance(self, side: int, progress: FloatArray) -> FloatArray:
        """Return Σ_j c_ij N_j/N_i over the neighbours of a healthy pair, in m/N.

        N_i = w_i (δ − Σ_j c_ij N_j)/c_i, with the compliances c_i of the pairs, the couplings c_ij of both gears, and
        the weights w_i of entry and exit; per weight, so that it holds for a pair that is just entering.
        """
        zeta = np.atleast_1d(np.asarray(progress, dtype=np.float64))
        middle = floor(self.pair.contact_ratio + self.ramp)
        places = np.arange(-middle, middle + 1)
        last = self.pair.contact_ratio
        at = np.clip(zeta[:, None] + places, -self.ramp / 2.0, last + self.ramp / 2.0)
        weight = smooth_step((zeta[:, None] + places) / self.ramp + 0.5) if self.ramp else 1.0 * (at >= 0.0)
        leaving = (last - zeta[:, None] - places) / self.ramp + 0.5 if self.ramp else 1.0 * (at <= last)
        weight = weight * (smooth_step(leaving) if self.ramp else leaving)
        alone = replace(self, body="separate")
        bodies = [alone.gear_compliance(number, at.ravel()).reshape(at.shape) for number in (1, 2)]
        direct = self.contact_compliance + bodies[0] + bodies[1]
        coupling = [self._coupling(number, at, places) for number in (1, 2)]
        mutual = weight[:, :, None] * (coupling[0] + coupling[1])
        forces = np.linalg.solve(mutual + direct[:, :, None] * np.eye(len(places)), weight[:, :, None])[:, :, 0]
        moved = [np.einsum("nj,nj->n", c[:, middle], forces) for c in coupling]  # by the neighbours, for δ = 1
        result: FloatArray = direct[:, middle] * moved[side - 1] / (1.0 - moved[0] - moved[1])
        return result

    def _coupling(self, side: int, at: FloatArray, places: NDArray[np.int64]) -> FloatArray:
        """Coupling c_ij of one gear through its body, (n, n_pairs, n_pairs), 0 on the diagonal, in m/N."""
        material = self.side(side).material
        gear, roll, width = self._yielding(side, self.roll_length_mm(side, at))
        angle = roll - gear.base_half_angle_rad
        result = np.zeros((*at.shape, at.shape[1]))
        for i, j in product(range(len(places)), repeat=2):
            if i != j:
                # A pair that entered earlier is ahead; its mate pushes the driver backwards, the driven gear forwards.
                ahead = int(places[i] - places[j]) * (1 if side == 2 else -1)
                result[:, i, j] = body_compliance(gear, material, angle[:, i], angle[:, j], ahead) / width
        return result

    def _lost_width_compliance(
        self, side: int, progress: FloatArray, faults: ToothFaults, tooth: FloatArray
    ) -> FloatArray:
        extra = np.zeros_like(tooth)
        if faults.spall is not None:
            materials = (self.material_1, self.material_2)
            lost = spall_share(self.pair, side, materials, faults.spall, self.roll_length_mm(side, progress))
            extra += self.contact_compliance * lost / (1.0 - lost)
        if faults.chip is not None:
            lost = chip_share(self.pair, side, faults.chip, progress)
            extra += (tooth + self.contact_compliance) * lost / (1.0 - lost)
        return extra

    def _check_faults(self, number: int) -> None:
        side = self.side(number)
        for crack in side.cracks:
            check_crack(side.gear, crack)
        for spall in side.spalls:
            check_spall(self.pair, number, spall)
        for chip in side.chips:
            check_chip(self.pair, number, chip)
        for name, faults in (("crack", side.cracks), ("spall", side.spalls), ("chip", side.chips)):
            if len(_teeth(faults)) < len(faults):
                raise InputError(f"two {name}s on one tooth", allowed=f"one {name} per tooth", remedy="give the larger")

    def _check_corner_contact(self) -> None:
        """Check that the tooth is not pointed within the ramps, where the flank is extended beyond the tip."""
        for gear in (self.pair.driver, self.pair.driven):
            roll = gear.tip_roll_rad + 0.5 * self.ramp * self.pair.base_pitch_mm / gear.base_radius_mm
            half_angle = gear.base_half_angle_rad - (roll - np.arctan(roll))
            if half_angle <= 0.0:
                raise InputError(
                    f"ramp is {self.ramp:g} base pitches: the tooth of the {gear.teeth}-tooth gear ends before that",
                    allowed="a shorter ramp, or 0",
                    remedy="shorten the ramp or lower the addendum",
                )


def _teeth(faults: tuple[RootCrack, ...] | tuple[ToothSpall, ...] | tuple[ToothChip, ...]) -> set[int]:
    return {fault.tooth for fault in faults}


def _check_roughness(side: MeshSide) -> None:
    if side.roughness is not None and side.roughness.n_teeth != side.gear.teeth:
        raise InputError(
            f"the roughness has profiles of {side.roughness.n_teeth} teeth", allowed=f"one per tooth, {side.gear.teeth}"
        )
