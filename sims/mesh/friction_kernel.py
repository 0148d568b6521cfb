"""Compiled friction of one line contact, for right-hand sides; `sims.mesh.friction` states the formulas and units."""

from __future__ import annotations

from math import exp, log, sqrt

from numba import njit

B1, B2, B3, B4, B5 = -8.916465, 1.03303, 1.036077, -0.354068, 2.812084
B6, B7, B8, B9 = -0.100601, 0.752755, -0.390958, 0.620305
MOST_FRICTION = 0.3
"""Friction never exceeds this: the regression knows no boundary lubrication."""


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def oil_terms(viscosity_cp, roughness_um):  # type: ignore[no-untyped-def]
    """(log₁₀ν₀, b1 + b9·exp(S) + b7·ln ν₀): the terms that stay the same during a simulation."""
    return log(viscosity_cp) / log(10.0), B1 + B9 * exp(roughness_um) + B7 * log(viscosity_cp)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def hertz_pressure_gpa(normal_force_n, width_m, radius_m, reduced_modulus_pa):  # type: ignore[no-untyped-def]
    """Return p = √(N E*/(π b R)), in GPa; 0 without load."""
    if normal_force_n <= 0.0:
        return 0.0
    return 1e-9 * sqrt(normal_force_n * reduced_modulus_pa / (3.141592653589793 * width_m * radius_m))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def friction_coefficient(slide_to_roll, pressure_gpa, entrainment_mps, radius_m, log10_oil, constant):  # type: ignore[no-untyped-def]
    """μ of the regression, from 0 to MOST_FRICTION.

    Powers are added as logarithms: two exponentials and four logarithms in all. No sliding and no load give 0; an
    entrainment speed of zero with sliding gives the cap, as V^b6 grows without bound.
    """
    if slide_to_roll <= 0.0 or pressure_gpa <= 0.0:
        return 0.0
    if entrainment_mps <= 0.0:
        return MOST_FRICTION
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
    # exp(-1.204) = 0.3: saves the exponential, and its overflow, where the cap holds.
    return exp(exponent) if exponent < -1.2039728043259361 else MOST_FRICTION


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
    Slide-to-roll ratio and entrainment use the rolling speeds u alone: the film takes no notice of the vibration
    within its own length, and near the pitch point a vibrating sign would make the ratio chatter.
    """
    if normal_force_n <= 0.0:
        return 0.0
    entrainment = 0.5 * abs(surface_1_mps + surface_2_mps)
    sliding = surface_2_mps - surface_1_mps
    ratio = abs(sliding) / entrainment if entrainment > 0.0 else 0.0
    pressure = hertz_pressure_gpa(normal_force_n, width_m, radius_m, reduced_modulus_pa)
    mu = (
        film_factor * friction_coefficient(ratio, pressure, entrainment, radius_m, log10_oil, constant)
        + dry_coefficient
    )
    return mu * normal_force_n * smooth_sign(sliding + vibration_mps, threshold_mps)
