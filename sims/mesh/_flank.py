"""Flank deviations, positive where metal is missing: relief, wear, helix, crowning and roughness."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, cos, pi, radians, tan

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearsig.checks import FloatArray, count, frozen_array, not_negative, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError
from sims.mesh._geometry import GearGeometry, PairGeometry, contact_ends_mm


@dataclass(frozen=True)
class FlankDeviation:
    """Deviation shared by all teeth of a gear, along the line of action, plus one value per tooth.

    Parameters
    ----------
    tip_relief_um : float
        Metal removed at the tip, 0 for none.
    tip_relief_length_mm : float
        Length of the linear relief along the line of action, from the tip down.
    pitch_um : tuple of float
        Cumulative pitch deviation of each tooth, one value per tooth. Empty: none.
    wear_um : float
        Maximum depth of wear by sliding, 0 for none; see `wear_profile` for its shape over the flank.
    """

    tip_relief_um: float = 0.0
    tip_relief_length_mm: float = 1.0
    pitch_um: tuple[float, ...] = ()
    wear_um: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.tip_relief_um, "tip_relief_um", "µm")
        positive(self.tip_relief_length_mm, "tip_relief_length_mm", "mm")
        not_negative(self.wear_um, "wear_um", "µm")
        frozen_array(self.pitch_um, "pitch_um", ndim=1)


IDEAL_FLANK = FlankDeviation()
"""An involute without deviation."""


def check_deviation(gear: GearGeometry, deviation: FlankDeviation) -> None:
    """Reject a relief longer than the flank, or a number of pitch deviations that is not the number of teeth."""
    flank = (gear.tip_roll_rad - gear.form_roll_rad) * gear.base_radius_mm
    if deviation.tip_relief_um > 0.0 and deviation.tip_relief_length_mm > flank:
        raise InputError(
            f"tip_relief_length_mm is {deviation.tip_relief_length_mm:g} mm on a flank of {flank:.3g} mm",
            allowed=f"at most {flank:.3g} mm along the line of action",
        )
    if deviation.pitch_um and len(deviation.pitch_um) != gear.teeth:
        raise InputError(f"pitch_um holds {len(deviation.pitch_um)} values", allowed=f"one per tooth, {gear.teeth}")


def flank_separation_m(gear: GearGeometry, deviation: FlankDeviation, roll_length_mm: FloatArray) -> FloatArray:
    """Missing metal at the given positions on the flank, in m; without wear, which depends on the mate.

    Parameters
    ----------
    roll_length_mm : array
        ρ of the gear, distance from its base tangent point. Beyond the tip the relief continues to grow.
    """
    rho = np.asarray(roll_length_mm, dtype=np.float64)
    tip = gear.tip_roll_rad * gear.base_radius_mm
    into = np.maximum(rho - (tip - deviation.tip_relief_length_mm), 0.0) / deviation.tip_relief_length_mm
    return deviation.tip_relief_um * into * 1e-6


def pitch_separation_m(gear: GearGeometry, deviation: FlankDeviation) -> FloatArray:
    """Cumulative pitch deviation of each tooth, (z,), in m."""
    if not deviation.pitch_um:
        return np.zeros(gear.teeth)
    return np.asarray(deviation.pitch_um, dtype=np.float64) * 1e-6


# Wear of all flanks of a gear by sliding.

MIN_RADIUS = 0.1
"""In modules: below this radius of curvature specific sliding is held constant, as the contact zone is wider."""


def wear_profile(pair: PairGeometry, side: int, roll_length_mm: FloatArray) -> FloatArray:
    """Depth of wear over the flank relative to its maximum: 1 at the maximum, 0 at the pitch point.

    h ∝ p · s = |1 − u_mate/u_own|,  u = ω ρ

    By Archard's law the wear at a point is proportional to pressure times the distance slid past it. A contact zone of
    width 2a rolls over the point at its own surface's speed u_own, while the surfaces slide at |u_own − u_mate|:
    s = 2a |1 − u_mate/u_own|. Mean pressure times width is the load per width, F/b, assumed constant along the path of
    contact. This leaves the specific sliding: 0 in pure rolling at the pitch point, increasing towards both ends, more
    so towards the root, where a flank is slow. The law's constant is part of the given depth.

    Parameters
    ----------
    pair : PairGeometry
    side : int
        1 for the driver's flanks, 2 for the driven gear's.
    roll_length_mm : array
        ρ of that gear. Beyond the path of contact the depth stays that of its end.

    Notes
    -----
    Load sharing, and the change of pressure as the flank wears, are neglected: in reality double contact halves the
    wear at the ends.

    Source: J. F. Archard, Contact and rubbing of flat surfaces, Journal of Applied Physics 24 (1953), for the law.
    """
    ends = contact_ends_mm(pair, side)
    largest = float(np.max(_specific_sliding(pair, side, np.array(ends))))
    return _specific_sliding(pair, side, np.clip(roll_length_mm, *ends)) / largest


def _specific_sliding(pair: PairGeometry, side: int, roll_length_mm: FloatArray) -> FloatArray:
    gear, mate = (pair.driver, pair.driven) if side == 1 else (pair.driven, pair.driver)
    rho = np.maximum(np.asarray(roll_length_mm, dtype=np.float64), MIN_RADIUS * gear.module_mm)
    return np.abs(1.0 - gear.teeth / mate.teeth * (pair.action_length_mm - rho) / rho)


# --------------------
# Along the face width: helix, crowning and misalignment; each slice of the face has its own phase and gap.
# --------------------


MAX_SLICES = 64
"""Maximum number of slices of the face width, for which compiled code reserves space."""


@dataclass(frozen=True)
class Lead:
    """Flank lines of a pair along the face width, both gears combined.

    Parameters
    ----------
    helix_angle_deg : float
        β on the reference circle, −45 to 45; above 0: the driver is right-handed. The gears of the pair are those of
        the transverse section, see `transverse_section`.
    crowning_um : float
        Metal removed at both ends of the face, a parabola from its middle; along the line of action.
    error_um : float
        Misalignment: gap at the far end of the face (+z) minus that at the near end, in the plane of action (F_β of
        ISO 6336-1).
    n_slices : int
        Number of slices of equal width; 1 for a spur pair without crowning and misalignment.

    Notes
    -----
    Slices deflect independently, as in ISO 6336-1: a loaded slice does not bend its neighbours.
    """

    helix_angle_deg: float = 0.0
    crowning_um: float = 0.0
    error_um: float = 0.0
    n_slices: int = 1

    def __post_init__(self) -> None:
        within(self.helix_angle_deg, "helix_angle_deg", -45.0, 45.0, "°")
        not_negative(self.crowning_um, "crowning_um", "µm")
        within(self.crowning_um, "crowning_um", 0.0, 500.0, "µm")
        within(self.error_um, "lead_error_um", -500.0, 500.0, "µm")
        count(self.n_slices, "face_slices", maximum=MAX_SLICES)

    @property
    def even(self) -> bool:
        """Whether the load is uniform along the face: no helix, crowning or misalignment."""
        return self.helix_angle_deg == 0.0 and self.crowning_um == 0.0 and self.error_um == 0.0

    @property
    def places(self) -> FloatArray:
        """Middles of the slices from one end of the face to the other, −½ to ½, (n_slices,)."""
        return (np.arange(self.n_slices) + 0.5) / self.n_slices - 0.5

    def gap_m(self, places: FloatArray) -> FloatArray:
        """Missing metal from crowning and misalignment at places −½ to ½ of the face, in m; 0 in its middle."""
        return 1e-6 * (self.crowning_um * (2.0 * places) ** 2 + self.error_um * places)

    def late(self, pair: PairGeometry, places: FloatArray) -> FloatArray:
        """Delay in base pitches with which places −½ to ½ of the face enter after the first end, 0 to ε_β.

        The driver turns counter-clockwise, seen from +z: the far end of a right-handed tooth leads.
        """
        hand = 1.0 if self.helix_angle_deg >= 0.0 else -1.0
        return self.overlap_ratio(pair) * (0.5 - hand * places)

    def overlap_ratio(self, pair: PairGeometry) -> float:
        """Overlap ratio ε_β = b tan β/(π m_t): pitches by which one end of the face lags the other."""
        turn = pair.face_width_mm * tan(radians(abs(self.helix_angle_deg)))
        return turn / (pi * pair.driver.module_mm)

    def base_helix_rad(self, pair: PairGeometry) -> float:
        """Base helix angle β_b, with tan β_b = tan β cos α_t."""
        return atan(tan(radians(self.helix_angle_deg)) * cos(pair.driver.pressure_angle_rad))

    def axial_share(self, pair: PairGeometry) -> float:
        """Axial force over the force along the line of action, tan β_b: F_a = F_bt tan β_b = F_t tan β."""
        return tan(self.base_helix_rad(pair))


STRAIGHT = Lead()
"""A spur pair whose flanks are in contact over the whole face."""


def transverse_section(
    teeth: int,
    normal_module_mm: float,
    normal_pressure_angle_deg: float,
    helix_angle_deg: float,
    **normal: float | None,
) -> GearGeometry:
    """Return the transverse section of a helical gear cut by a rack of the given normal dimensions.

    m_t = m_n/cos β,  tan α_t = tan α_n/cos β; profile shift, addendum, dedendum and tip rounding keep their lengths.

    Parameters
    ----------
    teeth, normal_module_mm, normal_pressure_angle_deg, helix_angle_deg
        z, m_n, α_n, β.
    **normal
        Other fields of `GearGeometry`, in normal modules or mm.

    Notes
    -----
    In the transverse section the rack's rounded tip is an ellipse; it is approximated by a circle of the same radius.

    Source: ISO 21771, *Gears – Cylindrical involute gears and gear pairs* (2007).
    """
    c = cos(radians(within(helix_angle_deg, "helix_angle_deg", -45.0, 45.0, "°")))
    if helix_angle_deg == 0.0:  # exactly the spur gear's
        angle_deg = normal_pressure_angle_deg
    else:
        angle_deg = float(np.degrees(atan(tan(radians(normal_pressure_angle_deg)) / c)))
    sizes = {"profile_shift": 0.0, "addendum": 1.0, "dedendum": 1.25, "tool_tip_radius": 0.38} | normal
    for name in ("profile_shift", "addendum", "dedendum", "tool_tip_radius"):
        sizes[name] = c * float(sizes[name] or 0.0)
    return GearGeometry(teeth, normal_module_mm / c, angle_deg, **sizes)  # type: ignore[arg-type]  # fields by name


@dataclass(frozen=True)
class NormalSection(GearGeometry):
    """Spur gear with the teeth of a helical gear's normal section; see `normal_section`.

    Its number of teeth is not an integer. Nothing is checked, as the gear it represents has been.
    """

    teeth: float  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Skip the checks."""


def normal_section(gear: GearGeometry, helix_angle_deg: float) -> GearGeometry:
    """Return the virtual spur gear of a helical one: z_n = z/(cos²β_b cos β), m_n = m_t cos β, tan α_n = tan α_t cos β.

    Parameters
    ----------
    gear : GearGeometry
        The transverse section.
    helix_angle_deg : float

    Notes
    -----
    The ratio of bore to root circle is that of the gear itself, so the body below a tooth keeps its shape.

    Source: ISO 6336-3, *Calculation of tooth bending strength* (2019), for the virtual spur gear.
    """
    if helix_angle_deg == 0.0:
        return gear
    beta = radians(helix_angle_deg)
    c, base = cos(beta), atan(tan(beta) * cos(gear.pressure_angle_rad))
    virtual = NormalSection(
        gear.teeth / (cos(base) ** 2 * c),
        gear.module_mm * c,
        float(np.degrees(atan(tan(gear.pressure_angle_rad) * c))),
        gear.profile_shift / c,
        gear.face_width_mm,
        gear.addendum / c,
        gear.dedendum / c,
        gear.tool_tip_radius / c,
    )
    object.__setattr__(virtual, "bore_radius_mm", gear.bore_mm / gear.root_radius_mm * virtual.root_radius_mm)
    return virtual


def normal_roll_rad(gear: GearGeometry, virtual: GearGeometry, roll_rad: FloatArray) -> FloatArray:
    """Roll angle on the virtual gear at the height where the roll angle of the transverse section is `roll_rad`."""
    if virtual is gear:
        return roll_rad
    height = gear.base_radius_mm * np.hypot(1.0, roll_rad) - gear.pitch_radius_mm
    ratio = (virtual.pitch_radius_mm + height) / virtual.base_radius_mm
    return np.sqrt(np.maximum(ratio**2 - 1.0, 0.0))


# --------------------
# Roughness: a Weierstrass–Mandelbrot profile, fixed to time or to the flank. Source: A. Majumdar, B. Bhushan, *Role of
# fractal geometry in roughness characterization and contact mechanics of surfaces*, Journal of Tribology 112 (1990).
# --------------------


CYCLES_PER_METRE = 1.5 ** np.arange(7.0, 19.0)
"""γⁿ of the profile's lines, (n_lines,)."""

LISTED_TRAVEL_MPS = 1.0312
"""Speed along the profile at which lines 7 … 18 are at 17.6 … 1524 Hz: γⁿ cycles per metre times this.

Derived from a published list of lines, the lowest at 17.9 Hz. It is close to the entrainment speed of a 55/75 pair of
module 2 at 500 rpm, 0.95 to 1.02 m/s.
"""


@dataclass(frozen=True)
class FractalSurface:
    """z(h) = G^(D-1) Σ γ^(-(2-D)n) cos(2πγⁿh + κ_n), γ = 1.5, n = 7 … 18: wavelengths of 59 mm … 0.68 mm.

    Parameters
    ----------
    scale_m : float
        G, not below 0; 0 for a smooth flank.
    dimension : float
        D, above 1 and below 2: low for wavy, high for jagged profiles.
    """

    scale_m: float
    dimension: float = 1.5

    def __post_init__(self) -> None:
        not_negative(self.scale_m, "scale_m of the roughness", "m")
        within(self.dimension, "dimension of the roughness", 1.001, 1.999)

    @classmethod
    def of_roughness(cls, rms_um: float, dimension: float = 1.5) -> FractalSurface:
        """Return the surface whose rms height is `rms_um` (Rq); solves the rms formula for G.

        G = (Rq √2/√Σγ^(-2(2-D)n))^(1/(D-1)).

        Examples
        --------
        >>> f"{FractalSurface.of_roughness(0.45).scale_m:.3g}"
        '2.32e-12'
        """
        unit = cls(1.0, dimension)
        rms_m = 1e-6 * not_negative(rms_um, "rms_um of the roughness", "um")
        return cls((rms_m / unit.rms_m) ** (1.0 / (dimension - 1.0)), dimension)

    @property
    def amplitudes_m(self) -> FloatArray:
        """Peak amplitude of each line, (n_lines,)."""
        amplitudes: FloatArray = self.scale_m ** (self.dimension - 1) * CYCLES_PER_METRE ** -(2 - self.dimension)
        return amplitudes

    @property
    def rms_m(self) -> float:
        """Root mean square height, √(G^(2(D-1))/2 · Σγ^(-2(2-D)n)), of a long profile or over random phases."""
        return float(np.sqrt(0.5 * np.sum(self.amplitudes_m**2)))

    def draw_phases(self, rng: np.random.Generator, n_profiles: int = 1) -> FloatArray:
        """Uniform phases κ, (n_profiles, n_lines)."""
        return rng.uniform(0.0, 2 * np.pi, (n_profiles, len(CYCLES_PER_METRE)))


@dataclass(frozen=True)
class TimeLockedRoughness:
    """Δb(t) = z(vt): successive flanks spliced into one endless profile.

    Its lines are at fixed frequencies γⁿv, independent of the shaft, and it never repeats with a tooth: it represents
    the strength of the roughness, not its location. Where a line must follow a gear, use `FlankRoughness`.

    Parameters
    ----------
    surface : FractalSurface
    phases_rad : array, (n_lines,)
    """

    surface: FractalSurface
    phases_rad: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "phases_rad", _phases(self.phases_rad, 1, len(self.surface.amplitudes_m)))

    @classmethod
    def draw(cls, surface: FractalSurface, rng: np.random.Generator) -> TimeLockedRoughness:
        """Draw the phases of one profile."""
        return cls(surface, surface.draw_phases(rng)[0])

    @property
    def frequencies_hz(self) -> FloatArray:
        """Frequency of each line, γⁿ v, (n_lines,)."""
        return CYCLES_PER_METRE * LISTED_TRAVEL_MPS

    def height_m(self, time_s: ArrayLike) -> FloatArray:
        """Height Δb at the given times."""
        t = np.asarray(time_s, dtype=np.float64)
        total = np.zeros(t.shape)
        lines = zip(self.surface.amplitudes_m, 2 * np.pi * self.frequencies_hz, self.phases_rad, strict=True)
        for a, w, phase in lines:  # line by line: no (time × line) matrix
            total += a * np.cos(w * t + phase)
        return total

    def phasors(self, step_s: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Phasors at time 0 for `height_now` and `advance`.

        Returns
        -------
        real, imaginary, omega_rad_s, step_cos, step_sin : arrays, (n_lines,)
            For steps of `step_s`, half the solver's step for a fourth-order Runge–Kutta method.
        """
        positive(step_s, "step_s", "s")
        omega, a = 2 * np.pi * self.frequencies_hz, self.surface.amplitudes_m
        return (
            a * np.cos(self.phases_rad),
            a * np.sin(self.phases_rad),
            omega,
            np.cos(omega * step_s),
            np.sin(omega * step_s),
        )


@dataclass(frozen=True, eq=False)  # two drawn profiles are never the same, and arrays compare element by element
class FlankRoughness:
    """Roughness profile of every tooth of one gear over the position on its flank; it repeats with the tooth.

    The lines of a whole gear are orders of its shaft. Wavelengths longer than the flank act as pitch errors.

    Parameters
    ----------
    surface : FractalSurface
    phases_rad : array, (n_teeth, n_lines)
    """

    surface: FractalSurface
    phases_rad: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "phases_rad", _phases(self.phases_rad, 2, len(self.surface.amplitudes_m)))

    @classmethod
    def draw(cls, surface: FractalSurface, n_teeth: int, rng: np.random.Generator) -> FlankRoughness:
        """Draw the phases of every tooth."""
        return cls(surface, surface.draw_phases(rng, count(n_teeth, "n_teeth")))

    @property
    def n_teeth(self) -> int:
        """Number of teeth of the gear."""
        return int(self.phases_rad.shape[0])

    def height_m(self, tooth: NDArray[np.integer] | int, position_m: ArrayLike) -> FloatArray:
        """Height of a tooth's flank in m, positive into the gap; tooth numbers continue over revolutions.

        Parameters
        ----------
        tooth : int or array
            Any integer; taken modulo the number of teeth.
        position_m : array
            Arc length along the flank from the root end of the contact, in a shape that broadcasts with `tooth`.
        """
        s = np.asarray(position_m, dtype=np.float64)
        row = np.mod(tooth, self.n_teeth)
        total = np.zeros(np.broadcast_shapes(np.shape(row), s.shape))
        # cos(ks + φ) by the addition theorem: the cosines and sines of positions serve all teeth.
        for n, cycles in enumerate(CYCLES_PER_METRE):
            place, phase = 2 * np.pi * cycles * s, self.phases_rad[row, n]
            a = self.surface.amplitudes_m[n]
            total += a * np.cos(phase) * np.cos(place)
            total -= a * np.sin(phase) * np.sin(place)
        return total


def _phases(phases_rad: FloatArray, ndim: int, n_lines: int) -> FloatArray:
    phases = frozen_array(phases_rad, "phases_rad of the roughness", ndim=ndim)
    if phases.shape[-1] != n_lines:
        raise InputError(
            f"{phases.shape[-1]} phases", where="phases_rad of the roughness", allowed=f"{n_lines}, one per line"
        )
    return phases


# Compiled roughness for right-hand sides: phasors stepped in time.


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def height_now(real, imaginary, omega_rad_s):  # type: ignore[no-untyped-def]
    """(Σ Re p_n, -Σ ω_n Im p_n): height and its rate from the phasors p_n = a_n exp(i(ω_n t + κ_n))."""
    height, rate = 0.0, 0.0
    for n in range(real.shape[0]):
        height += real[n]
        rate -= omega_rad_s[n] * imaginary[n]
    return height, rate


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def advance(real, imaginary, step_cos, step_sin):  # type: ignore[no-untyped-def]
    """Rotate the phasors by one step, in place; exact up to rounding, about 1e-16 per step."""
    for n in range(real.shape[0]):
        re = real[n] * step_cos[n] - imaginary[n] * step_sin[n]
        imaginary[n] = real[n] * step_sin[n] + imaginary[n] * step_cos[n]
        real[n] = re
