"""Force between the teeth from measured motion: the piecewise model, Hunt–Crossley, Kelvin–Voigt."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.contact_force import depth, friction_share, latched_damping, pair_force
from gearsig.motion.datum import find_datum
from gearsig.motion.types import ForceError, ForceEstimate, PairMotion

PIECEWISE = "piecewise"
AS_PRINTED = "piecewise, as printed"
HUNT_CROSSLEY = "Hunt–Crossley"
KELVIN_VOIGT = "Kelvin–Voigt"
TEETH = "piecewise, teeth alone"
FROM_TORQUE, TOOTH_FORCE = "torque / rb1", "tooth force"


def estimate_forces(motion: PairMotion, *, datum: str | float = "auto") -> ForceEstimate:
    """Estimate the force between the teeth at every sample.

    - piecewise: Σ over the pairs in contact of k sgn(g)|g|^λ (1 + β ġ)(1 ∓ μ tan α_k), plus J1 α1/r_b1 of what turns
      between torque sensor and teeth: comparable with τ/r_b1. Pairs by the driver's angle, forwards and backwards.
    - piecewise, teeth alone: without the inertia and the friction's share, the normal force itself.
    - piecewise, as printed: with J2/r_b2² · q̈ instead of J1 α1/r_b1. For two free bodies that is the force with the
      opposite sign; in a driven gear it counts the load's inertia in the pinion's torque.
    - Hunt–Crossley: k δ^λ (1 + β δ̇) of one pair on the drive flank, δ from where the flanks touch.
    - Kelvin–Voigt: k' δ + b' δ̇, likewise, k' and b' such that both agree with Hunt–Crossley at the median load.

    Parameters
    ----------
    motion : PairMotion
    datum : str or float
        See `gearsig.motion.datum.find_datum`.

    Returns
    -------
    ForceEstimate
        With errors against τ/r_b1 and against a measured or simulated tooth force, where there are.

    Notes
    -----
    A micrometre of the compression is worth λF/g: some 130 N of 2 kN on stiff teeth. With an encoder of less than some
    10⁶ counts this is no measurement of force; see `gearsig.motion.noise_study`.

    Source: Z. Xu, H. Deng, Y. Zhang, Piecewise nonlinear dynamic modeling for gear transmissions with rotary inertia
    and backlash, with sgn(g)|g|^λ for g^λ, base radii for reference radii, μ tan α_k for μ cot β, one mass also in
    double contact, and the speed of impact latched.
    """
    found = find_datum(motion, datum)
    contact = motion.contact
    q = motion.compression_m - found.compression_m
    g = depth(q, contact.half_backlash_um * 1e-6)
    rate = motion.compression_rate_mps
    beta = latched_damping(g, rate, contact)
    n = np.where(g != 0.0, motion.path.n_pairs(motion.driver_angle_rad, np.sign(g)), 0.0)
    normal = n * pair_force(g, rate, beta, contact)
    at_shaft = normal * friction_share(motion, g)
    r1, r2 = motion.path.base_radii_m
    forces = {PIECEWISE: at_shaft + contact.driver_inertia_kg_m2 * motion.driver_acceleration_rad_s2 / r1}
    if motion.force_n is not None:
        forces[TEETH] = normal
    if contact.driven_inertia_kg_m2 is not None:
        forces[AS_PRINTED] = at_shaft + contact.driven_inertia_kg_m2 / r2**2 * motion.compression_acceleration_mps2
    drive = np.maximum(g, 0.0)
    drive_beta = np.where(g > 0.0, beta, 0.0)
    forces[HUNT_CROSSLEY] = pair_force(drive, rate, drive_beta, contact)
    stiffness, damping = _linear(forces[HUNT_CROSSLEY], drive, contact.damping_ratio_at(0.0))
    forces[KELVIN_VOIGT] = np.where(g > 0.0, stiffness * drive + damping * rate, 0.0)
    references = _references(motion)
    return ForceEstimate(
        motion,
        found,
        g,
        n,
        forces,
        references,
        _errors(forces, references),
        _descriptions(motion, stiffness, damping, set(forces)),
    )


def inverse_force_n(
    acceleration_mps2: FloatArray, contact_force_n: FloatArray, mass_kg: float, ratio: float
) -> FloatArray:
    """Return m2 q̈ + γ f, the source's inverse formula; for two free bodies with γ = m2/m1 it is −f.

    q̈ = −f/m1 − f/m2 of free bodies gives m2 q̈ + (m2/m1) f = −f: an identity of the motion, to recover the force from a
    measured acceleration. As a law of motion it would count the inertia twice.
    """
    result: FloatArray = mass_kg * acceleration_mps2 + ratio * contact_force_n
    return result


def compare(model: str, force_n: FloatArray, reference: str, reference_n: FloatArray) -> ForceError:
    """Return the error of a force against a reference."""
    error = force_n - reference_n
    size = float(np.sqrt(np.mean(reference_n**2)))
    moving = float(np.std(force_n)) > 0.0 and float(np.std(reference_n)) > 0.0
    rms = float(np.sqrt(np.mean(error**2)))
    return ForceError(
        model,
        reference,
        rms,
        rms / size if size > 0.0 else float("nan"),
        float(np.mean(error)),
        float(np.max(np.abs(error))),
        float(np.corrcoef(force_n, reference_n)[0, 1]) if moving else float("nan"),
    )


def _references(motion: PairMotion) -> dict[str, FloatArray]:
    found: dict[str, FloatArray] = {}
    if motion.shaft_force_n is not None:
        found[FROM_TORQUE] = motion.shaft_force_n
    if motion.force_n is not None:
        found[TOOTH_FORCE] = motion.force_n
    return found


def _errors(forces: Mapping[str, FloatArray], references: Mapping[str, FloatArray]) -> tuple[ForceError, ...]:
    """Compare each model with each reference; of the piecewise forms each with what it stands for."""
    unfit = {(TEETH, FROM_TORQUE), (PIECEWISE, TOOTH_FORCE), (AS_PRINTED, TOOTH_FORCE)}
    return tuple(
        compare(model, force, name, reference)
        for name, reference in references.items()
        for model, force in forces.items()
        if (model, name) not in unfit
    )


def _linear(force_n: FloatArray, depth_m: FloatArray, floor_beta: float) -> tuple[float, float]:
    """Secant stiffness and damping of Hunt–Crossley at the median loaded depth."""
    loaded = depth_m > 0.0
    if not np.any(loaded):
        raise RefusalError(
            "the drive flanks never touch by this datum, backlash and stiffness",
            remedy="check half_backlash_um in the rig's [contact] and --datum",
        )
    middle, force = float(np.median(depth_m[loaded])), float(np.median(force_n[loaded]))
    return force / middle, floor_beta * force


def _descriptions(motion: PairMotion, stiffness: float, damping: float, names: set[str]) -> dict[str, str]:
    c = motion.contact
    law = (
        f"k {c.stiffness_n_per_m_lambda:.4g} N/m^{c.exponent:g}, λ {c.exponent:g}, half backlash "
        f"{c.half_backlash_um:.4g} µm, restitution {c.restitution:g} ({c.damping_law})"
    )
    r2 = motion.path.base_radii_m[1]
    texts = {
        PIECEWISE: f"both flanks, ε {motion.path.contact_ratio:.4g}, μ {c.friction_coefficient:g}, {law}; plus J1 "
        f"α1/rb1, J1 {c.driver_inertia_kg_m2:.4g} kg m²",
        TEETH: f"the same, normal force of the teeth alone; {law}",
        AS_PRINTED: f"the same with J2/rb2² q̈ = {(c.driven_inertia_kg_m2 or 0.0) / r2**2:.4g} kg · q̈ for the inertia",
        HUNT_CROSSLEY: f"one pair, drive flank; {law}",
        KELVIN_VOIGT: f"one pair, drive flank; {stiffness:.4g} N/m and {damping:.4g} N s/m, at the median load",
    }
    return {name: text for name, text in texts.items() if name in names}
