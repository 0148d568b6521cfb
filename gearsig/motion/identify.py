"""Fit stiffness, damping, backlash, friction and inertia to a measured motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.backlash import LEAST_SAMPLES
from gearsig.motion.contact_force import friction_share
from gearsig.motion.identify_contact import contact_equation
from gearsig.motion.identify_types import FittedParameter, Identification
from gearsig.motion.robust_fit import RobustFit, robust_fit
from gearsig.motion.types import PairMotion
from gearsig.rig.contact import damping_ratio_s_per_m

TOLD = 0.5
"""Half width of the interval over the value beyond which a parameter cannot be told."""
NORMAL_95 = 1.96
TURNING = 0.1
"""Part of the ordinary speed of the driven gear from which on its friction slides."""
LEAST_SCATTER = 1e-3
"""Part of the ordinary acceleration that the load's equation leaves out."""
ONE_FLANK = "only one flank was loaded: play and zero of the angles cannot be told apart; record a stop with a brake"
ONE_ZERO = "only one flank was loaded: it is told from the zero of the angles by little; record a stop with a brake"
NAMES_OF_RESULT = {
    "datum": "the zero of the angles",
    "half_backlash": "half_backlash_um",
    "log stiffness": "stiffness_n_per_m_lambda",
    "damping": "restitution",
    "driver inertia": "driver_inertia_kg_m2",
    "friction": "friction_coefficient",
    "inverse inertia": "driven_inertia_kg_m2",
}
"""For the names of the equations' terms."""
FALLING = ("damping", "inverse inertia")
"""Terms that fall as what they stand for grows."""
MOTOR = "it lies ahead of the torque sensor and does not show in the torque"


def identify(motion: PairMotion) -> Identification:
    """Fit the parameters of contact and load, with 95 % intervals.

    Contact, on loaded samples away from the entry and exit of pairs: see `ContactEquation`; for the zero of the angles,
    play, stiffness, damping c = β v (v the speed at which the flanks met), inertia behind the sensor and friction.
    Load, while the driven gear turns: α2 = (r_b2 F − T_c sgn ω2 − c ω2)/J2, for J2, T_c and c.

    The noisy quantity (q, α2) is the response, so that its noise widens the intervals and does not bend the values.
    What the record cannot tell is marked, with what it is mistaken for.

    Parameters
    ----------
    motion : PairMotion
        With torque. Exponent, damping law and geometry are the rig's.

    Raises
    ------
    RefusalError
        If there is no torque, or it loads the flanks nowhere.

    Notes
    -----
    The intervals know the noise and its colour, not an error of the equations: eccentric gears, bending shafts, a wrong
    exponent. The motor's inertia lies ahead of the torque sensor and cannot be told at all.
    """
    if motion.torque_nm is None:
        raise RefusalError(
            "no torque was measured: motion alone gives ratios of stiffness, inertia and friction, not their values",
            remedy="record the driver's torque",
        )
    equation = contact_equation(motion)
    contact = equation.solve()
    parameters = _contact_parameters(motion, contact, has_both_flanks=equation.has_both_flanks)
    equations = {"contact": f"{contact.n_samples} samples, scatter {1e6 * contact.scatter:.3g} µm"}
    condition = {"contact": contact.condition}
    try:
        load = _load_with_inertia(motion, contact)
    except RefusalError as refusal:
        equations["load"] = str(refusal)
    else:
        parameters += _load_parameters(motion, load)
        equations["load"] = f"{load.n_samples} samples, scatter {load.scatter:.3g} rad/s²"
        condition["load"] = load.condition
    motor = motion.contact.motor_inertia_kg_m2
    parameters.append(
        FittedParameter("motor_inertia_kg_m2", "kg m^2", float("nan"), (0.0, float("inf")), False, MOTOR, motor)
    )
    return Identification(tuple(parameters), equations, condition, motion.source)


def _load_with_inertia(motion: PairMotion, contact: RobustFit) -> RobustFit:
    """Fit the load, and widen its covariance by what the driver's inertia is not known to."""
    inertia, deviation = contact.value("driver inertia"), contact.deviation("driver inertia")
    fit = _fit_load(motion, inertia)
    if not np.isfinite(deviation):
        return fit
    moved = _fit_load(motion, inertia + deviation).values - fit.values
    return replace(fit, covariance=fit.covariance + np.outer(moved, moved))


def _fit_load(motion: PairMotion, inertia_kg_m2: float) -> RobustFit:
    """Fit α2 = (r_b2 F − T_c sgn ω2 − c ω2)/J2, F the driver's tooth force turned by the friction of the flanks."""
    r1, r2 = motion.path.base_radii_m
    torque, w = motion.torque_nm, motion.driven_speed_rad_s
    assert torque is not None  # noqa: S101  the caller has looked
    force = (torque - inertia_kg_m2 * motion.driver_acceleration_rad_s2) / r1
    drive = r2 * force * friction_share(motion, force, 1) / friction_share(motion, force, 0)
    turning = np.abs(w) > TURNING * float(np.quantile(np.abs(w), 0.95))
    if np.sum(turning) < 10 * LEAST_SAMPLES:
        raise RefusalError("the driven gear hardly turns", remedy="record a start or a stop")

    def residuals(values: FloatArray) -> FloatArray:
        inverse, level, viscous = values
        left: FloatArray = motion.driven_acceleration_rad_s2 - inverse * (drive - level * np.sign(w) - viscous * w)
        return left

    guess = motion.contact.driven_inertia_kg_m2 or 10.0
    ordinary = float(np.quantile(np.abs(drive), 0.9)) or 1.0
    return robust_fit(
        residuals,
        np.array([1.0 / guess, 0.5 * ordinary, 0.05 * ordinary]),
        np.array([1.0 / guess, ordinary, ordinary]),
        turning,
        ("inverse inertia", "load_friction_nm", "load_viscous_nm_s_per_rad"),
        least_scatter=LEAST_SCATTER * ordinary / guess,
    )


def _contact_parameters(motion: PairMotion, fit: RobustFit, *, has_both_flanks: bool) -> list[FittedParameter]:
    c = motion.contact
    play = FittedParameter(
        "half_backlash_um", "um", c.half_backlash_um, (0.0, float("inf")), False, ONE_FLANK, c.half_backlash_um
    )
    if has_both_flanks:
        play = _plain(fit, "half_backlash", "half_backlash_um", "um", c.half_backlash_um, 1e6)
    return [
        play,
        _stiffness(fit, c.stiffness_n_per_m_lambda, has_both_flanks=has_both_flanks),
        _restitution(fit, c.damping_law, c.restitution),
        _plain(fit, "driver inertia", "driver_inertia_kg_m2", "kg m^2", c.driver_inertia_kg_m2),
        _plain(fit, "friction", "friction_coefficient", "", c.friction_coefficient),
    ]


def _load_parameters(motion: PairMotion, fit: RobustFit) -> list[FittedParameter]:
    inverse, half = fit.value("inverse inertia"), NORMAL_95 * fit.deviation("inverse inertia")
    told = inverse > 0.0 and half < TOLD * inverse
    highest = 1.0 / (inverse - half) if inverse > half else float("inf")
    lowest = 1.0 / (inverse + half) if inverse + half > 0.0 else float("inf")
    return [
        FittedParameter(
            "driven_inertia_kg_m2",
            "kg m^2",
            1.0 / inverse if inverse > 0.0 else float("nan"),
            (lowest, highest),
            told,
            "" if told else _why(fit, "inverse inertia"),
            motion.contact.driven_inertia_kg_m2,
            _alike(fit, "inverse inertia"),
        ),
        _plain(fit, "load_friction_nm", "load_friction_nm", "N m", None),
        _plain(fit, "load_viscous_nm_s_per_rad", "load_viscous_nm_s_per_rad", "N m s/rad", None),
    ]


def _plain(
    fit: RobustFit, own: str, name: str, unit: str, rig_value: float | None, factor: float = 1.0
) -> FittedParameter:
    value, half = factor * fit.value(own), factor * NORMAL_95 * fit.deviation(own)
    told = half < TOLD * abs(value)
    why = "" if told else _why(fit, own)
    return FittedParameter(name, unit, value, (value - half, value + half), told, why, rig_value, _alike(fit, own))


def _stiffness(fit: RobustFit, rig_value: float, *, has_both_flanks: bool) -> FittedParameter:
    """Return the stiffness; from one flank a filter ahead of the torque's samples feigns it, twenty times too high."""
    own = "log stiffness"
    log_k, half = fit.value(own), NORMAL_95 * fit.deviation(own)
    told = half < TOLD and has_both_flanks
    low, middle, high = (float(np.exp(min(v, 700.0))) for v in (log_k - half, log_k, log_k + half))
    why = "" if told else _why(fit, own) if has_both_flanks else ONE_ZERO
    return FittedParameter(
        "stiffness_n_per_m_lambda", "N/m^λ", middle, (low, high), told, why, rig_value, _alike(fit, own)
    )


def _restitution(fit: RobustFit, law: str, rig_value: float) -> FittedParameter:
    """Turn c = β v into the restitution of the rig's law; it is told where c is."""
    c, half = fit.value("damping"), NORMAL_95 * fit.deviation("damping")
    told = c > 0.0 and half < TOLD * c
    grid = np.linspace(0.01, 1.0, 2_001)
    factors = np.array([damping_ratio_s_per_m(law, float(e), 1.0) for e in grid])
    low, middle, high = (float(np.interp(v, factors[::-1], grid[::-1])) for v in (c + half, c, c - half))
    why = "" if told else _why(fit, "damping")
    return FittedParameter("restitution", "", middle, (low, high), told, why, rig_value, _alike(fit, "damping"))


def _alike(fit: RobustFit, own: str) -> str:
    """Return what could take a parameter's place, by the name that the result gives it; empty where nothing could."""
    like, correlation = fit.most_like(own)
    if not like:
        return ""
    sign = -1.0 if (own in FALLING) != (like in FALLING) else 1.0
    return f"{NAMES_OF_RESULT.get(like, like)} (correlation {sign * correlation:.2f})"


def _why(fit: RobustFit, own: str) -> str:
    like = _alike(fit, own)
    return "the record hardly depends on it" + (f", and it is mistaken for {like}" if like else "")
