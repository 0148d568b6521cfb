"""Friction of a lubricated tooth contact: the regression of Xu and Kahraman, and the pressure it needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError

MOST_FRICTION = 0.3
"""Cap of the coefficient."""
COEFFICIENTS = (-8.916465, 1.03303, 1.036077, -0.354068, 2.812084, -0.100601, 0.752755, -0.390958, 0.620305)
"""b1 … b9 of the regression."""

# The roughness limit is the one that matters, as exp(S) sits in an exponent. The other limits are assumed: those of
# contacts that such a regression is commonly used for, not a statement of its authors.
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
    """Friction coefficient and what to know about it.

    Parameters
    ----------
    coefficient : array
        From 0 to `MOST_FRICTION`, in the common shape of what was given.
    capped : array of bool
        Where the regression gave more than the cap.
    notes : tuple of str
        One per quantity that leaves the regression's range, with value and limit; empty inside.
    """

    coefficient: FloatArray
    capped: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]
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
        Greatest Hertz pressure P, not below 0.
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
        Outside the range (roughness above 0.6 µm above all) the coefficient is still given, with a note.

    Raises
    ------
    InputError
        On a value that has no meaning.

    Notes
    -----
    The regression stands for one oil (a 75W-90) and full or mixed film. It does not know start and stop, where the
    film is gone: there, use a friction law with a stick phase.

    Source: H. Xu, *Development of a generalized mechanical efficiency prediction methodology for gear pairs*,
    dissertation, The Ohio State University, 2005.
    """
    given = {
        "slide_to_roll": np.abs(_checked(slide_to_roll, "slide_to_roll", signed=True)),
        "pressure_gpa": _checked(pressure_gpa, "pressure_gpa"),
        "viscosity_cp": np.asarray(positive(viscosity_cp, "viscosity_cp", "cP")),
        "roughness_um": _checked(roughness_um, "roughness_um"),
        "entrainment_mps": _checked(entrainment_mps, "entrainment_mps", above_zero=True),
        "radius_m": _checked(radius_m, "radius_m", above_zero=True),
    }
    raw = _regression(
        given["slide_to_roll"],
        given["pressure_gpa"],
        given["viscosity_cp"],
        given["roughness_um"],
        given["entrainment_mps"],
        given["radius_m"],
    )
    return FrictionResult(np.minimum(raw, MOST_FRICTION), raw > MOST_FRICTION, _range_notes(given))


def line_contact_pressure_gpa(
    normal_force_n: ArrayLike, face_width_m: float, radius_m: ArrayLike, reduced_modulus_pa: float
) -> FloatArray:
    """Greatest Hertz pressure of a line contact, p = √(N E*/(π b R)), in GPa.

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
    pressure: FloatArray = 1e-9 * np.sqrt(force * reduced_modulus_pa / (np.pi * face_width_m * radius))
    return pressure


def reduced_modulus_pa(modulus_1_pa: float, poisson_1: float, modulus_2_pa: float, poisson_2: float) -> float:
    """Reduced modulus E* of two bodies: 1/E* = (1 - ν1²)/E1 + (1 - ν2²)/E2."""
    positive(modulus_1_pa, "modulus_1_pa", "Pa")
    positive(modulus_2_pa, "modulus_2_pa", "Pa")
    return 1.0 / ((1 - poisson_1**2) / modulus_1_pa + (1 - poisson_2**2) / modulus_2_pa)


def smooth_sign(sliding_mps: ArrayLike, threshold_mps: float) -> FloatArray:
    """Sign of the sliding speed, smoothed: v/√(v² + v₀²).

    At v = 10 v₀ it is 0.995. As it has the sign of v, a force -μN·sgn(v) never feeds energy in.
    """
    positive(threshold_mps, "threshold_mps", "m/s")
    v = _checked(sliding_mps, "sliding_mps", signed=True)
    result: FloatArray = v / np.hypot(v, threshold_mps)
    return result


def _regression(
    SR: FloatArray, P: FloatArray, nu: FloatArray, S: FloatArray, V: FloatArray, R: FloatArray
) -> FloatArray:
    b1, b2, b3, b4, b5, b6, b7, b8, b9 = COEFFICIENTS
    s = SR * P * np.log10(nu)
    # Beyond an exponent of 700 a double overflows; the cap has long been reached.
    f = np.minimum(b1 + b4 * s + b5 * np.exp(-s) + b9 * np.exp(np.minimum(S, 50.0)), 700.0)
    mu: FloatArray = np.exp(f) * P**b2 * SR**b3 * V**b6 * nu**b7 * R**b8
    return mu


def _range_notes(given: dict[str, FloatArray]) -> tuple[str, ...]:
    notes = []
    for name, (low, high, unit) in _LIMITS.items():
        least, most = float(np.min(given[name])), float(np.max(given[name]))
        # No load and no sliding give exactly zero friction: that is no extrapolation.
        if name == "pressure_gpa" and least == 0.0:
            least = low
        for value, outside in ((least, least < low), (most, most > high)):
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
