"""Friction of a lubricated tooth contact: the regression of Xu and Kahraman, and the contact pressure it needs."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gearsig.checks import FloatArray, positive
from gearsig.compiled import njit
from gearsig.errors import InputError
from gearsig.results import Result
from sims.mesh._geometry import Material, flexibility_per_pa
from sims.mesh._mesh_stiffness import share_torque
from sims.mesh._stiffness import GearMesh

MAX_FRICTION = 0.3
"""Upper limit of the coefficient."""
COEFFICIENTS = (-8.916465, 1.03303, 1.036077, -0.354068, 2.812084, -0.100601, 0.752755, -0.390958, 0.620305)
"""b1 … b9 of the regression."""

# The roughness limit matters most, as exp(S) is in an exponent. The other limits are assumed: they cover contacts for
# which such a regression is commonly used, and are not stated by its authors.
_LIMITS = {
    "roughness_um": (0.0, 0.6, "um"),
    "slide_to_roll": (0.0, 2.0, ""),
    "pressure_gpa": (0.2, 3.0, "GPa"),
    "viscosity_cp": (1.0, 300.0, "cP"),
    "entrainment_mps": (0.2, 30.0, "m/s"),
    "radius_m": (0.002, 0.1, "m"),
}


@dataclass(frozen=True)
class FrictionResult:
    """Friction coefficient, with notes on the range of the regression.

    Parameters
    ----------
    coefficient : array
        From 0 to `MAX_FRICTION`, in the broadcast shape of the inputs.
    notes : tuple of str
        One per quantity outside the regression's range, with value and limit; empty inside.
    """

    coefficient: FloatArray
    notes: tuple[str, ...] = ()


def friction_coefficient(
    slide_to_roll: ArrayLike,
    pressure_gpa: ArrayLike,
    *,
    viscosity_cp: float,
    roughness_um: float,
    entrainment_mps: ArrayLike,
    radius_m: ArrayLike,
) -> FrictionResult:
    """Friction coefficient of a lubricated line contact between steel flanks.

    μ = exp(f) P^b2 |SR|^b3 V^b6 ν^b7 R^b8 with
    f = b1 + b4 |SR| P log₁₀ν + b5 exp(-|SR| P log₁₀ν) + b9 exp(S).

    Parameters
    ----------
    slide_to_roll : array
        SR, sliding speed over entrainment speed; its sign is ignored, and 0 gives 0.
    pressure_gpa : array
        Maximum Hertz pressure P, not below 0.
    viscosity_cp : float
        Dynamic viscosity ν of the oil at its inlet temperature, in cP = mPa·s, above 0.
    roughness_um : float
        Composite rms roughness S, √(Rq1² + Rq2²), not below 0. Smooth flanks (0) do not have μ = 0.
    entrainment_mps : array
        V, mean of the two surface speeds, above 0.
    radius_m : array
        R, ρ1 ρ2/(ρ1 + ρ2), above 0.

    Returns
    -------
    FrictionResult
        Outside the range (above all, roughness above 0.6 µm) the coefficient is still given, with a note.

    Raises
    ------
    InputError
        If a value has no physical meaning.

    Notes
    -----
    The regression applies to one oil (a 75W-90) and full or mixed film. It does not cover start and stop, where the
    film is lost: there, use a friction law with a stick phase.

    Source: H. Xu, *Development of a generalized mechanical efficiency prediction methodology for gear pairs*,
    dissertation, The Ohio State University, 2005.
    """
    inputs = {
        "slide_to_roll": np.abs(_checked(slide_to_roll, "slide_to_roll", signed=True)),
        "pressure_gpa": _checked(pressure_gpa, "pressure_gpa"),
        "viscosity_cp": np.asarray(positive(viscosity_cp, "viscosity_cp", "cP")),
        "roughness_um": _checked(roughness_um, "roughness_um"),
        "entrainment_mps": _checked(entrainment_mps, "entrainment_mps", above_zero=True),
        "radius_m": _checked(radius_m, "radius_m", above_zero=True),
    }
    raw = _regression(
        inputs["slide_to_roll"],
        inputs["pressure_gpa"],
        inputs["viscosity_cp"],
        inputs["roughness_um"],
        inputs["entrainment_mps"],
        inputs["radius_m"],
    )
    return FrictionResult(np.minimum(raw, MAX_FRICTION), _range_notes(inputs))


def line_contact_pressure_gpa(
    normal_force_n: ArrayLike, face_width_m: float, radius_m: ArrayLike, reduced_modulus_pa: float
) -> FloatArray:
    """Maximum Hertz pressure of a line contact, p = √(N E*/(π b R)), in GPa.

    Parameters
    ----------
    normal_force_n : array
        N; at or below 0 there is no contact and the pressure is 0.
    face_width_m : float
    radius_m : array
        R, ρ1 ρ2/(ρ1 + ρ2).
    reduced_modulus_pa : float
        E*, see `reduced_modulus_pa`.

    Source: K. L. Johnson, *Contact Mechanics*, 1985, ch. 4.
    """
    positive(face_width_m, "face_width_m", "m")
    positive(reduced_modulus_pa, "reduced_modulus_pa", "Pa")
    radius = _checked(radius_m, "radius_m", above_zero=True)
    force = np.maximum(_checked(normal_force_n, "normal_force_n", signed=True), 0.0)
    return 1e-9 * np.sqrt(force * reduced_modulus_pa / (np.pi * face_width_m * radius))


def reduced_modulus_pa(material_1: Material, material_2: Material) -> float:
    """Reduced modulus E* of two bodies: 1/E* = (1 - ν1²)/E1 + (1 - ν2²)/E2."""
    return 1.0 / flexibility_per_pa(material_1, material_2)


def _regression(
    SR: FloatArray, P: FloatArray, nu: FloatArray, S: FloatArray, V: FloatArray, R: FloatArray
) -> FloatArray:
    b1, b2, b3, b4, b5, b6, b7, b8, b9 = COEFFICIENTS
    s = SR * P * np.log10(nu)
    # A double overflows beyond an exponent of about 700; the upper limit is reached long before.
    f = np.minimum(b1 + b4 * s + b5 * np.exp(-s) + b9 * np.exp(np.minimum(S, 50.0)), 700.0)
    mu: FloatArray = np.exp(f) * P**b2 * SR**b3 * V**b6 * nu**b7 * R**b8
    return mu


def _range_notes(inputs: dict[str, FloatArray]) -> tuple[str, ...]:
    notes = []
    for name, (low, high, unit) in _LIMITS.items():
        smallest, largest = float(np.min(inputs[name])), float(np.max(inputs[name]))
        # No load and no sliding give exactly zero friction, which is not an extrapolation.
        if name == "pressure_gpa" and smallest == 0.0:
            smallest = low
        for value, outside in ((smallest, smallest < low), (largest, largest > high)):
            if outside:
                notes.append(
                    f"{name} reaches {value:.4g} {unit}; the friction regression holds for {low:g} to {high:g} {unit}"
                )
    return tuple(notes)


def _checked(value: ArrayLike, name: str, *, signed: bool = False, above_zero: bool = False) -> FloatArray:
    array: FloatArray = np.asarray(value, dtype=np.float64)
    wrong = ~np.isfinite(array)
    if not signed:
        wrong |= array <= 0.0 if above_zero else array < 0.0
    if wrong.any():
        allowed = "finite numbers" if signed else ("finite, > 0" if above_zero else "finite, >= 0")
        raise InputError(f"{name} holds {float(array[wrong].flat[0]):g}", allowed=allowed)
    return array


# Compiled friction of one line contact, for right-hand sides; `sims.mesh` states the formulas and units.

B1, B2, B3, B4, B5, B6, B7, B8, B9 = COEFFICIENTS


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def oil_terms(viscosity_cp, roughness_um):  # type: ignore[no-untyped-def]
    """(log₁₀ν₀, b1 + b9·exp(S) + b7·ln ν₀): the terms that are constant during a simulation."""
    return log(viscosity_cp) / log(10.0), B1 + B9 * exp(roughness_um) + B7 * log(viscosity_cp)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def hertz_pressure_gpa(normal_force_n, width_m, radius_m, reduced_modulus_pa):  # type: ignore[no-untyped-def]
    """Return p = √(N E*/(π b R)), in GPa; 0 without load."""
    if normal_force_n <= 0.0:
        return 0.0
    return 1e-9 * sqrt(normal_force_n * reduced_modulus_pa / (3.141592653589793 * width_m * radius_m))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def film_coefficient(slide_to_roll, pressure_gpa, entrainment_mps, radius_m, log10_oil, constant):  # type: ignore[no-untyped-def]
    """μ of the regression, from 0 to MAX_FRICTION.

    Powers are summed as logarithms: two exponentials and four logarithms in all. No sliding or no load gives 0; zero
    entrainment speed with sliding gives the upper limit, as V^b6 grows without bound.
    """
    if slide_to_roll <= 0.0 or pressure_gpa <= 0.0:
        return 0.0
    if entrainment_mps <= 0.0:
        return MAX_FRICTION
    s = slide_to_roll * pressure_gpa * log10_oil
    exponent = (
        constant
        + B4 * s
        + B5 * exp(-s)
        + B2 * log(pressure_gpa)
        + B3 * log(slide_to_roll)
        + B6 * log(entrainment_mps)
        + B8 * log(radius_m)
    )
    # exp(-1.204) = 0.3: avoids the exponential, and its overflow, at the upper limit.
    return exp(exponent) if exponent < -1.2039728043259361 else MAX_FRICTION


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def smooth_sign(sliding_mps, threshold_mps):  # type: ignore[no-untyped-def]
    """v/√(v² + v₀²): odd, between -1 and 1, 0 at rest."""
    return sliding_mps / sqrt(sliding_mps * sliding_mps + threshold_mps * threshold_mps)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def contact_friction_n(  # type: ignore[no-untyped-def]
    normal_force_n,
    surface_1_mps,
    surface_2_mps,
    vibration_mps,
    radius_m,
    width_m,
    reduced_modulus_pa,
    log10_oil,
    constant,
    threshold_mps,
    film_factor=1.0,
    dry_coefficient=0.0,
):
    """Friction of one tooth pair, μ N sgn(v_s), with v_s = u2 - u1 + vibration, u = ωρ; subtract it from body 1's x.

    μ is `film_factor` times the regression's coefficient, plus `dry_coefficient` at every sliding speed.
    Slide-to-roll ratio and entrainment use the rolling speeds u alone: the film does not respond to vibration within
    its own length, and near the pitch point an alternating sign would make the ratio chatter.
    """
    if normal_force_n <= 0.0:
        return 0.0
    entrainment = 0.5 * abs(surface_1_mps + surface_2_mps)
    sliding = surface_2_mps - surface_1_mps
    ratio = abs(sliding) / entrainment if entrainment > 0.0 else 0.0
    pressure = hertz_pressure_gpa(normal_force_n, width_m, radius_m, reduced_modulus_pa)
    mu = film_factor * film_coefficient(ratio, pressure, entrainment, radius_m, log10_oil, constant) + dry_coefficient
    return mu * normal_force_n * smooth_sign(sliding + vibration_mps, threshold_mps)


# Friction of each tooth pair over the mesh at a steady load and speed.

MIN_RADIUS = 1e-3
"""In modules: lower limit of the radius of curvature, which is 0 on the base circle."""

MIN_PART = 0.2
"""Fraction of the load above which a contact is checked against the regression's range."""


@dataclass(frozen=True)
class MeshFriction(Result):
    """Friction over mesh cycles; column j is pair ⌊c + ramp/2⌋ − j, 0 where a pair is not in contact.

    Parameters
    ----------
    mesh_cycles : array, (n,)
        c; pair k enters at c = k.
    coefficient : array, (n, n_slots)
        μ, not below 0.
    friction_n : array, (n, n_slots)
        μ N sgn(v_s): above 0 in approach, below 0 in recess. The driver receives −f across the line of action.
    normal_n : array, (n, n_slots)
        N.
    sliding_mps : array, (n, n_slots)
        v_s = ω2 ρ2 − ω1 ρ1.
    notes : tuple of str
        Where contacts that carry at least a fifth of the load are outside the range of the friction regression.
    """

    mesh_cycles: FloatArray
    coefficient: FloatArray
    friction_n: FloatArray
    normal_n: FloatArray
    sliding_mps: FloatArray
    notes: tuple[str, ...] = ()


def friction_over_mesh(
    mesh: GearMesh,
    torque_nm: float,
    speed_rpm: float,
    viscosity_cp: float,
    roughness_um: float,
    mesh_cycles: FloatArray | None = None,
) -> MeshFriction:
    """Friction coefficient and force of each pair, with the load it carries in static equilibrium.

    Parameters
    ----------
    mesh : GearMesh
    torque_nm, speed_rpm : float
        Of the driver, above 0.
    viscosity_cp, roughness_um : float
        As for `friction_coefficient`.
    mesh_cycles : array or None
        c; None: 200 points of one cycle.

    Notes
    -----
    The effect of friction on load sharing is neglected. The pressure is that of smooth flanks of full width. A pair of
    helical teeth counts as in contact where the middle of its face is.
    """
    shared = share_torque(mesh, torque_nm, mesh_cycles)
    u_1, u_2, radius_m = _speeds_and_radius(mesh, shared.mesh_cycles, positive(speed_rpm, "speed_rpm", "rpm"))
    normal = shared.pair_forces_n
    sliding, entrainment = u_2 - u_1, 0.5 * (u_1 + u_2)
    modulus_pa = reduced_modulus_pa(mesh.material_1, mesh.material_2)
    pressure = line_contact_pressure_gpa(normal, mesh.face_width_m, radius_m, modulus_pa)

    def friction_where(where: NDArray[np.bool_]) -> FrictionResult:
        return friction_coefficient(
            (sliding / entrainment)[where],
            pressure[where],
            viscosity_cp=viscosity_cp,
            roughness_um=roughness_um,
            entrainment_mps=entrainment[where],
            radius_m=radius_m[where],
        )

    coefficient = friction_where(np.ones(normal.shape, dtype=np.bool_)).coefficient.reshape(normal.shape)
    # A pair that is being loaded passes through every small pressure; no note on those.
    notes = friction_where(normal >= MIN_PART * normal.sum(axis=1, keepdims=True)).notes
    friction = coefficient * normal * np.sign(sliding)
    return MeshFriction(shared.mesh_cycles, coefficient, friction, normal, sliding, notes)


def _speeds_and_radius(
    mesh: GearMesh, mesh_cycles: FloatArray, speed_rpm: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rolling speeds of both flanks in m/s and the radius of relative curvature in m, (n, n_slots)."""
    pair, min_radius_mm = mesh.pair, MIN_RADIUS * mesh.pair.driver.module_mm
    newest = np.floor(mesh_cycles + mesh.ramp / 2.0)
    progress = (mesh_cycles - newest)[:, None] + np.arange(mesh.n_slots) - mesh.overlap_ratio / 2.0
    if mesh.overlap_ratio:
        progress = np.clip(progress, 0.0, pair.contact_ratio)
    rho_1, rho_2 = (np.maximum(rho, min_radius_mm) * 1e-3 for rho in pair.contact_radii_mm(progress))
    omega_1 = speed_rpm * pi / 30.0
    omega_2 = omega_1 * pair.driver.teeth / pair.driven.teeth
    return omega_1 * rho_1, omega_2 * rho_2, rho_1 * rho_2 / (rho_1 + rho_2)
