"""Contact of two gears: stiffness, damping, backlash and friction of the flanks, and the inertias behind them."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, isfinite, pi, sin, sqrt

import numpy as np

from gearsig.checks import FloatArray, not_negative, one_of, positive, within
from gearsig.errors import InputError

DAMPING_LAWS = ("flores", "lankarani", "hunt-crossley")
"""Laws for impact damping from the restitution; see `damping_ratio_s_per_m`."""


@dataclass(frozen=True)
class ToothContact:
    """The contact of one gear pair, on both flanks, and the inertias that turn with each gear.

    One tooth pair at depth g and approach speed ġ carries F = k g^λ (1 + β ġ) ≥ 0, with β from the restitution and the
    impact speed v (`damping_ratio_s_per_m`). g = |q| − a, with q = r_b1 θ1 − r_b2 θ2 − q₀ and half backlash a.

    Parameters
    ----------
    pair : str
        Name of the gear pair; empty: the rig's only one.
    stiffness_n_per_m_lambda : float
        k in N/m^λ, of one tooth pair; above 0.
    exponent : float
        λ, 1 to 2; 1.5 for a Hertzian point contact.
    half_backlash_um : float
        a, along the line of action: half the play from flank to flank.
    restitution : float
        e, above 0 to 1: speed after a free impact divided by the speed before.
    damping_law : str
        One of `DAMPING_LAWS`.
    impact_speed_floor_mps : float
        Minimum v: a slower impact is damped like one at this speed. Above 0.
    friction_coefficient : float
        μ of the flanks, 0 to 1.
    driver_inertia_kg_m2 : float
        Inertia between torque sensor and teeth. 0: nothing but the teeth.
    driven_inertia_kg_m2 : float or None
        The driven gear with its load; None: not known.
    motor_inertia_kg_m2 : float
        Upstream of the torque sensor and rigidly coupled, so that it takes part in impacts.
    mesh_phase : float
        Driver angle in tooth pitches at which a pair enters contact on the drive flank, 0 to 1.
    contact_ratio : float or None
        1 to 2; None: that of standard teeth (addendum of one module).
    mesh_ramp : float
        Base pitches over which a pair's stiffness builds up and decays, centred on the ideal entry and exit, 0 to 0.2:
        corner contact and tip relief spread the change between one and two pairs. 0: a step.

    Raises
    ------
    InputError
        If a value is out of range, such as a negative inertia or a restitution above 1.
    """

    stiffness_n_per_m_lambda: float
    pair: str = ""
    exponent: float = 1.5
    half_backlash_um: float = 0.0
    restitution: float = 0.95
    damping_law: str = "flores"
    impact_speed_floor_mps: float = 0.01
    friction_coefficient: float = 0.0
    driver_inertia_kg_m2: float = 0.0
    driven_inertia_kg_m2: float | None = None
    mesh_phase: float = 0.0
    contact_ratio: float | None = None
    motor_inertia_kg_m2: float = 0.0
    mesh_ramp: float = 0.05

    def __post_init__(self) -> None:
        positive(self.stiffness_n_per_m_lambda, "stiffness_n_per_m_lambda", "N/m^λ")
        within(self.exponent, "exponent", 1.0, 2.0)
        not_negative(self.half_backlash_um, "half_backlash_um", "um")
        within(self.restitution, "restitution", 0.01, 1.0, remedy="a flank cannot leave faster than it came")
        one_of(self.damping_law, "damping_law", DAMPING_LAWS)
        positive(self.impact_speed_floor_mps, "impact_speed_floor_mps", "m/s")
        within(self.friction_coefficient, "friction_coefficient", 0.0, 1.0)
        not_negative(self.driver_inertia_kg_m2, "driver_inertia_kg_m2", "kg m^2")
        not_negative(self.motor_inertia_kg_m2, "motor_inertia_kg_m2", "kg m^2")
        if self.driven_inertia_kg_m2 is not None:
            positive(self.driven_inertia_kg_m2, "driven_inertia_kg_m2", "kg m^2")
        within(self.mesh_phase, "mesh_phase", 0.0, 1.0)
        if self.contact_ratio is not None:
            within(self.contact_ratio, "contact_ratio", 1.0, 2.0)
        within(self.mesh_ramp, "mesh_ramp", 0.0, 0.2, "base pitches")

    def damping_ratio_at(self, impact_speed_mps: float) -> float:
        """β = b/k in s/m for an impact at that speed, or at `impact_speed_floor_mps` if that is higher."""
        speed = max(abs(impact_speed_mps), self.impact_speed_floor_mps)
        return damping_ratio_s_per_m(self.damping_law, self.restitution, speed)


def damping_ratio_s_per_m(law: str, restitution: float, impact_speed_mps: float) -> float:
    """Return β = b/k in s/m, which relates the damping force b g^λ ġ of a contact to its stiffness force k g^λ.

    flores: 8(1 − e)/(5 e v); lankarani: 3(1 − e²)/(4 v); hunt-crossley: 3(1 − e)/(2 v).

    None reproduces the given e exactly: βv − ln(1 + βv) = −βv' − ln(1 − βv') relates the speed v' after a free impact
    to v, for any stiffness, exponent and mass. For e = 0.5 the three laws result in 0.470, 0.725 and 0.663.

    Parameters
    ----------
    law : str
        One of `DAMPING_LAWS`.
    restitution : float
        e, above 0 to 1.
    impact_speed_mps : float
        v, above 0: the damping grows without bound as v → 0.

    Notes
    -----
    Sources: K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, Journal of
    Applied Mechanics 42 (1975); H. M. Lankarani, P. E. Nikravesh, A contact force model with hysteresis damping for
    impact analysis of multibody systems, Journal of Mechanical Design 112 (1990); P. Flores, M. Machado, M. T. Silva,
    J. M. Martins, On the continuous contact force models for soft materials in multibody dynamics, Multibody System
    Dynamics 25 (2011).
    """
    one_of(law, "damping_law", DAMPING_LAWS)
    e = within(restitution, "restitution", 0.01, 1.0, remedy="a flank cannot leave faster than it came")
    v = positive(impact_speed_mps, "impact_speed_mps", "m/s")
    factors = {
        "flores": 8.0 * (1.0 - e) / (5.0 * e),
        "lankarani": 0.75 * (1.0 - e * e),
        "hunt-crossley": 1.5 * (1.0 - e),
    }
    return factors[law] / v


def hertz_stiffness_n_per_m1p5(
    ratio: float,
    reference_radius_m: float,
    pressure_angle_rad: float,
    youngs_modulus_pa: float = 210e9,
    poisson_ratio: float = 0.3,
) -> float:
    """Return the stiffness of a Hertzian point contact at the pitch point, k = 4/3 √ρ E*, for gears of one material.

    ρ = u d1 sin α/(2(1 + u)) is the reduced radius of curvature at the pitch point, 1/E* = 2(1 − ν²)/E.

    Parameters
    ----------
    ratio : float
        u = z2/z1.
    reference_radius_m : float
        Driver's reference radius, d1/2.
    pressure_angle_rad : float
    youngs_modulus_pa, poisson_ratio : float

    Returns
    -------
    float
        In N/m^1.5.

    Examples
    --------
    >>> from math import radians
    >>> f"{hertz_stiffness_n_per_m1p5(5.0, 0.05, radians(20.0)):.4e}"
    '1.8366e+10'
    """
    u = positive(ratio, "ratio")
    radius = u * positive(reference_radius_m, "reference_radius_m", "m") * sin(pressure_angle_rad) / (1.0 + u)
    modulus = positive(youngs_modulus_pa, "youngs_modulus_pa", "Pa") / (2.0 * (1.0 - poisson_ratio**2))
    stiffness = 4.0 / 3.0 * sqrt(radius) * modulus
    if not isfinite(stiffness):  # an angle of 0 or a ratio of 0 has no contact
        positive(stiffness, "stiffness", "N/m^1.5")
    return stiffness


# --------------------
# Which tooth pairs are in contact at a driver angle, forwards, backwards and on the back flank.
# --------------------


@dataclass(frozen=True)
class PathOfContact:
    """The path of contact of a spur gear pair.

    Tooth pair j is p = z1 θ1/2π − phase − j base pitches past its entry and in contact for 0 ≤ p ≤ ε, at ρ1 = ρ1A +
    p·p_b from the driver's base tangent point. The position depends on the angle alone, forwards and backwards alike.
    On the back flank the path is mirrored, half a pitch from where the drive flank passes the pitch point:
    p' = −(z1 θ1/2π − phase) + 2 p_C + ½.

    Parameters
    ----------
    teeth : (int, int)
        Of driver and driven gear.
    base_radii_m : (float, float)
    contact_ratio : float
        ε, 1 to 2.
    base_pitch_m : float
    start_m : float
        ρ1A, where a pair enters contact.
    length_m : float
        a sin α = ρ1 + ρ2.
    phase : float
        Driver angle in pitches at which a pair enters contact on the drive flank.
    ramp : float
        Base pitches over which a pair's stiffness builds up and decays.
    """

    teeth: tuple[int, int]
    base_radii_m: tuple[float, float]
    contact_ratio: float
    base_pitch_m: float
    start_m: float
    length_m: float
    phase: float = 0.0
    ramp: float = 0.0

    @property
    def pitch_point(self) -> float:
        """p_C, where a pair passes the pitch point."""
        r1, r2 = self.base_radii_m
        return (self.length_m * r1 / (r1 + r2) - self.start_m) / self.base_pitch_m

    def position(self, driver_angle_rad: FloatArray, flank: FloatArray | float = 1.0) -> FloatArray:
        """Position of the newer pair past its entry, 0 to 1 base pitch; the older one is one pitch further.

        Parameters
        ----------
        driver_angle_rad : array
        flank : array or float
            Above 0: drive flank; below 0: back flank.
        """
        x = np.asarray(driver_angle_rad, dtype=np.float64) * self.teeth[0] / (2.0 * pi) - self.phase
        x = np.where(np.asarray(flank) < 0.0, 2.0 * self.pitch_point + 0.5 - x, x)
        return np.asarray(x - np.floor(x))

    def pairs(
        self, driver_angle_rad: FloatArray, flank: FloatArray | float = 1.0
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the pairs that may touch: positions past entry, weights, and dweight/dposition, each (4, ...).

        A pair's weight is the active fraction of its stiffness, s((p + r/2)/r) · s((ε − p + r/2)/r), with the ramp r
        and s(x) = x³(10 − 15x + 6x²), clamped to 0 below x = 0 and to 1 above x = 1.
        """
        u = self.position(driver_angle_rad, flank)
        p = u + np.arange(-1.0, 3.0).reshape(-1, *([1] * u.ndim))
        if self.ramp == 0.0:
            inside = ((p >= 0.0) & (p < self.contact_ratio)).astype(np.float64)
            return p, inside, np.zeros_like(p)
        (rise, up), (stay, down) = (_smooth_step(0.5 + x / self.ramp) for x in (p, self.contact_ratio - p))
        return p, rise * stay, (up * stay - rise * down) / self.ramp

    def n_pairs(self, driver_angle_rad: FloatArray, flank: FloatArray | float = 1.0) -> FloatArray:
        """Number of pairs in contact: 2 if u = frac(z1 θ1/2π − phase) < ε − 1, else 1; in between on the ramps."""
        return np.asarray(self.pairs(driver_angle_rad, flank)[1].sum(axis=0))

    def tooth(self, driver_angle_rad: FloatArray) -> FloatArray:
        """Driver tooth that last entered contact, counted from 1 as in diagnoses."""
        x = np.asarray(driver_angle_rad, dtype=np.float64) * self.teeth[0] / (2.0 * pi) - self.phase
        return np.asarray(np.mod(np.floor(x), self.teeth[0]) + 1.0)

    def driver_lever_m(self, position: FloatArray) -> FloatArray:
        """ρ1 in m of a pair at `position` base pitches past its entry."""
        return np.asarray(self.start_m + np.asarray(position, dtype=np.float64) * self.base_pitch_m)


def _smooth_step(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a step from 0 to 1 with two continuous derivatives, and its slope."""
    t = np.clip(x, 0.0, 1.0)
    return t**3 * (10.0 + t * (6.0 * t - 15.0)), 30.0 * (t * (1.0 - t)) ** 2


def standard_path(
    teeth: tuple[int, int],
    module_m: float,
    pressure_angle_rad: float,
    *,
    phase: float = 0.0,
    contact_ratio: float | None = None,
    ramp: float = 0.0,
) -> PathOfContact:
    """Return the path of contact of standard teeth: addendum of one module, no shift, reference centre distance.

    ε p_b = √(ra1² − rb1²) + √(ra2² − rb2²) − a sin α. A stated contact ratio moves both ends by the same amount.

    Raises
    ------
    InputError
        If the teeth interfere, or the contact ratio is not between 1 and 2.

    Examples
    --------
    >>> path = standard_path((20, 100), 5e-3, 0.3490658503988659)
    >>> round(path.contact_ratio, 3)
    1.705
    """
    r = [0.5 * module_m * z for z in teeth]
    rb1, rb2 = (radius * cos(pressure_angle_rad) for radius in r)
    base_pitch = pi * module_m * cos(pressure_angle_rad)
    length = (r[0] + r[1]) * sin(pressure_angle_rad)
    out_1, out_2 = (sqrt((radius + module_m) ** 2 - (radius * cos(pressure_angle_rad)) ** 2) for radius in r)
    if max(out_1, out_2) > length:
        raise InputError(
            f"standard teeth of {teeth[0]} and {teeth[1]} interfere: a tip reaches past the other's involute",
            where="teeth",
            remedy="give the smaller gear more teeth",
        )
    standard_ratio = (out_1 + out_2 - length) / base_pitch
    ratio = standard_ratio if contact_ratio is None else contact_ratio
    within(ratio, "contact_ratio", 1.0, 2.0, remedy="the model holds for one to two pairs in contact")
    start = length - out_2 - 0.5 * (ratio - standard_ratio) * base_pitch
    return PathOfContact(teeth, (rb1, rb2), ratio, base_pitch, max(start, 0.0), length, phase, ramp)
