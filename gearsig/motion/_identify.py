"""Fit stiffness, damping, backlash, friction and inertia to a measured motion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, known_name
from gearsig.errors import RefusalError
from gearsig.motion._backlash import MIN_SAMPLES, dependence, estimate_backlash
from gearsig.motion._force import find_datum, friction_share
from gearsig.motion._impacts import meeting_speeds
from gearsig.motion._measure import PairMotion, median_deviation
from gearsig.results import Result
from gearsig.rig import damping_ratio_s_per_m

N_BLOCKS = 8
"""Number of jackknife blocks."""


@dataclass(frozen=True)
class RobustFit:
    """Solution of a robust least-squares problem.

    Parameters
    ----------
    names : tuple of str
    values : array, (n,)
    covariance : array, (n, n)
        Of the values: residual power times (JᵀJ)⁻¹ times the factor for autocorrelation; wider if leaving out an
        eighth of the record moves a value by more than that.
    condition : float
        Ratio of the largest to the smallest singular value of the Jacobian with columns scaled to length 1.
    n_samples : int
        Samples that were kept.
    scatter : float
        Standard deviation of their residuals.
    """

    names: tuple[str, ...]
    values: FloatArray
    covariance: FloatArray
    condition: float
    n_samples: int
    scatter: float

    def value(self, name: str) -> float:
        """Return the value of a parameter."""
        return float(self.values[self.names.index(name)])

    def deviation(self, name: str) -> float:
        """Return its standard deviation."""
        i = self.names.index(name)
        return float(np.sqrt(max(self.covariance[i, i], 0.0)))

    def correlated_with(self, name: str) -> tuple[str, float]:
        """Return the parameter most correlated with this one and the correlation; an empty name if none is close."""
        i = self.names.index(name)
        deviations = np.sqrt(np.maximum(np.diag(self.covariance), 1e-300))
        if not np.isfinite(deviations[i]):
            return "", 0.0
        correlation = self.covariance[i] / (deviations[i] * deviations)
        correlation[i] = 0.0
        j = int(np.argmax(np.abs(correlation)))
        return (self.names[j], float(correlation[j])) if abs(correlation[j]) > 0.9 else ("", 0.0)


def robust_fit(
    residuals: Callable[[FloatArray], FloatArray],
    first: FloatArray,
    scale: FloatArray,
    usable: NDArray[np.bool_],
    names: tuple[str, ...],
    *,
    min_scatter: float = 0.0,
    with_jackknife: bool = True,
) -> RobustFit:
    """Minimise the sum of squares of the usable residuals, repeatedly leaving out outliers.

    Parameters
    ----------
    residuals : callable
        Values of the parameters, (n,) → (n_samples,).
    first, scale : array, (n,)
        Initial values, and the magnitudes of the parameters.
    usable : array of bool, (n_samples,)
    names : tuple of str
    min_scatter : float
        Model error of the equation: residuals below five times this are never outliers.
    with_jackknife : bool
        Whether to widen the covariance by a jackknife, at the cost of eight further solutions.

    Raises
    ------
    RefusalError
        If fewer samples are left than five times the number of parameters.
    """
    keep: NDArray[np.bool_] = usable
    x: FloatArray = first / scale
    for _ in range(8):
        _check_samples(keep, len(names))
        x, jacobian = _solve(residuals, x, scale, keep)
        residual = residuals(x * scale)
        scatter = median_deviation(residual[keep])
        # Leave out what is more than five standard deviations off: flanks about to part, slipped counts.
        again = usable & (np.abs(residual) <= 5.0 * max(scatter, min_scatter))
        if np.array_equal(again, keep):
            break
        keep = again
    _check_samples(keep, len(names))
    lengths = np.linalg.norm(jacobian, axis=0)
    singular = np.linalg.svd(jacobian / np.where(lengths > 0.0, lengths, 1.0), compute_uv=False)
    inverse = np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)
    inverse[lengths == 0.0, lengths == 0.0] = np.inf  # nothing depends on this parameter, so it is unknown
    power = float(np.mean(residual[keep] ** 2)) * dependence(residual[keep])
    covariance = np.where(inverse == 0.0, 0.0, inverse * power)
    widened: FloatArray = np.ones(len(x))
    if with_jackknife:
        widened = _widening(residuals, x, scale, keep, np.sqrt(np.diag(covariance)))
    return RobustFit(
        names,
        x * scale,
        covariance * np.outer(scale * widened, scale * widened),
        float(singular[0] / singular[-1]) if singular[-1] > 0.0 else float("inf"),
        int(np.sum(keep)),
        scatter,
    )


def _solve(
    residuals: Callable[[FloatArray], FloatArray], x: FloatArray, scale: FloatArray, keep: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Solution and Jacobian for the kept samples, with scaled parameters."""
    from scipy.optimize import least_squares

    def kept(values: FloatArray) -> FloatArray:
        residual: FloatArray = residuals(values * scale)[keep]
        return residual

    solution = least_squares(kept, x, method="lm", x_scale="jac")
    return np.asarray(solution.x), np.asarray(solution.jac)


def _widening(
    residuals: Callable[[FloatArray], FloatArray],
    x: FloatArray,
    scale: FloatArray,
    keep: NDArray[np.bool_],
    deviation: FloatArray,
) -> FloatArray:
    """Factors, 1 or more, by which values move more than expected when part of the record is left out.

    Delete-a-block jackknife: it reveals an equation that holds in only part of the record, which residuals alone hide.

    Source: H. R. Künsch, The jackknife and the bootstrap for general stationary observations, Annals of Statistics 17
    (1989).
    """
    blocks = np.array_split(np.flatnonzero(keep), N_BLOCKS)
    moved = []
    for block in blocks:
        rows = keep.copy()
        rows[block] = False
        moved.append(_solve(residuals, x, scale, rows)[0])
    spread = np.sqrt((N_BLOCKS - 1) / N_BLOCKS * np.sum((np.array(moved) - np.mean(moved, axis=0)) ** 2, axis=0))
    safe = np.where(np.isfinite(deviation) & (deviation > 0.0), deviation, np.inf)
    factors: FloatArray = np.maximum(1.0, spread / safe)
    return factors


def _check_samples(keep: NDArray[np.bool_], n_parameters: int) -> None:
    if np.sum(keep) < 5 * n_parameters:
        raise RefusalError(
            f"{np.sum(keep)} samples are left for {n_parameters} parameters", remedy="record longer, under load"
        )


EDGE = 0.09
"""Base pitches left out around the entry and exit of a pair, where it carries part of its load."""
PITCH_POINT, SLOW = 0.1, 0.15
"""Base pitches around the pitch point, and fraction of the typical speed, within which flank friction is not known:
bristle deflection."""
LOADED = 0.1
"""Minimum load of a sample, as a fraction of the typical load."""
LONG_CONTACT, MAX_LONG = 40, 8
"""Minimum samples of a contact of unknown impact speed to get a separate damping, and maximum number of these."""
NAMES = ("datum", "half_backlash", "log stiffness", "damping", "driver inertia", "friction")


@dataclass(frozen=True)
class ContactEquation:
    """q = q₀ + s a + s (N/(n k (1 + β ġ)))^{1/λ} with N = |τ − J1 α1|/(r_b1 (1 ∓ μ tan α_k)).

    Parameters
    ----------
    motion : PairMotion
    torque_nm, side, n_pairs, per_friction : array, (n,)
        Torque, s, the number of pairs in contact, and the slope of the friction share over μ.
    meeting_speed_mps : array, (n,)
    group : array of int, (n,)
        Index of the damping of each sample: 0 for c/v of contacts of known impact speed v.
    usable : array of bool, (n,)
    start : array
        Values of `NAMES`, then one β for each further group.
    free : tuple of int
        Indices of those that are fitted.
    """

    motion: PairMotion
    torque_nm: FloatArray
    side: FloatArray
    n_pairs: FloatArray
    per_friction: FloatArray
    meeting_speed_mps: FloatArray
    group: NDArray[np.int64]
    usable: NDArray[np.bool_]
    start: FloatArray
    free: tuple[int, ...]

    @property
    def has_both_flanks(self) -> bool:
        """Whether the backlash is fitted."""
        return NAMES.index("half_backlash") in self.free

    def residuals(self, values: FloatArray) -> FloatArray:
        """Unexplained compression in m."""
        p = self.start.copy()
        p[list(self.free)] = values
        zero, a, log_k, damping, inertia, friction = p[: len(NAMES)]
        m = self.motion
        share = np.maximum(1.0 + friction * self.per_friction, 0.2)
        normal = (self.torque_nm - inertia * m.driver_acceleration_rad_s2) / (m.path.base_radii_m[0] * share)
        betas = np.concatenate([[0.0], p[len(NAMES) :]])[self.group]
        beta = np.where(self.group == 0, damping / self.meeting_speed_mps, betas)
        growth = np.maximum(1.0 + beta * self.side * m.compression_rate_mps, 0.05)
        yielding = (np.abs(normal) / (self.n_pairs * np.exp(log_k) * growth)) ** (1.0 / m.contact.exponent)
        residual: FloatArray = m.compression_m - zero - self.side * (a + yielding)
        return residual

    def solve(self, *, with_jackknife: bool = True) -> RobustFit:
        """Fit the free parameters; skip the jackknife if their intervals are not needed."""
        names = (*NAMES, *(f"damping {i}" for i in range(1, len(self.start) - len(NAMES) + 1)))
        rows = list(self.free)
        inertia = max(self.motion.contact.driver_inertia_kg_m2, 1e-3)
        scale = np.array([1e-6, 1e-6, 1.0, 0.01, inertia, 0.05, *[1.0] * (len(self.start) - len(NAMES))])
        # The equation neglects about 20 nm: bristle deflection, damping that is held slightly early.
        return robust_fit(
            self.residuals,
            self.start[rows],
            scale[rows],
            self.usable,
            tuple(names[i] for i in rows),
            min_scatter=2e-8,
            with_jackknife=with_jackknife,
        )


def contact_equation(motion: PairMotion) -> ContactEquation:
    """Return the contact equation with the samples for which it holds.

    Raises
    ------
    RefusalError
        If too few samples carry a load.
    """
    torque, force = motion.torque_and_tooth_force()
    side = np.sign(force)
    usable = (np.abs(force) > LOADED * float(np.quantile(np.abs(force), 0.95))) & _clear(motion, side)
    if np.sum(usable) < 10 * MIN_SAMPLES:
        raise RefusalError(f"{np.sum(usable)} samples carry a load", remedy="record while the machine drives")
    has_both = min(np.sum(usable & (side > 0)), np.sum(usable & (side < 0))) >= MIN_SAMPLES
    start = _start(motion, both_flanks=bool(has_both))
    speed = meeting_speeds(motion, float(start[0]), float(start[1]))
    group, n_groups = _groups(speed, usable, side)
    betas = np.full(n_groups, start[NAMES.index("damping")] / 0.1)
    unit = replace(motion, contact=replace(motion.contact, friction_coefficient=1.0))
    return ContactEquation(
        motion,
        torque,
        side,
        motion.path.n_pairs(motion.driver_angle_rad, side),
        friction_share(unit, side) - 1.0,
        np.where(np.isnan(speed), 1.0, speed),
        group,
        usable & (group >= 0),
        np.concatenate([start, betas]),
        tuple(i for i in range(len(NAMES) + n_groups) if has_both or i != NAMES.index("half_backlash")),
    )


def _start(motion: PairMotion, *, both_flanks: bool) -> FloatArray:
    """Initial values from reversals, else from the rig."""
    c = motion.contact
    damping = max(damping_ratio_s_per_m(c.damping_law, c.restitution, 1.0), 1e-3)
    zero, a, k = 0.0, c.half_backlash_um * 1e-6, c.stiffness_n_per_m_lambda
    if both_flanks:
        play = estimate_backlash(motion)
        zero, a = play.datum_m, 0.5e-6 * play.backlash_um
        k = play.stiffness_n_per_m_lambda if np.isfinite(play.stiffness_n_per_m_lambda) else k
    else:
        zero = find_datum(motion).compression_m
    return np.array([zero, a, np.log(k), damping, c.driver_inertia_kg_m2, c.friction_coefficient])


def _groups(speed: FloatArray, usable: NDArray[np.bool_], side: FloatArray) -> tuple[NDArray[np.int64], int]:
    """Number the long contacts of unknown impact speed from 1; −1 for short ones, which are left out."""
    group = np.where(np.isnan(speed), -1, 0).astype(np.int64)
    unknown = np.flatnonzero(np.isnan(speed))
    if not len(unknown):
        return group, 0
    parts = np.split(unknown, np.flatnonzero((np.diff(unknown) > 1) | (np.diff(side[unknown]) != 0)) + 1)
    long = sorted((p for p in parts if np.sum(usable[p]) >= LONG_CONTACT), key=lambda p: -int(np.sum(usable[p])))
    for number, part in enumerate(long[:MAX_LONG], 1):
        group[part] = number
    return group, min(len(long), MAX_LONG)


def _clear(motion: PairMotion, side: FloatArray) -> NDArray[np.bool_]:
    """Samples with known pairs and friction: no pair enters, leaves or reverses its friction."""
    path = motion.path
    u = path.position(motion.driver_angle_rad, side)
    clear: NDArray[np.bool_] = (u > EDGE) & (u < 1.0 - EDGE) & (np.abs(u - (path.contact_ratio - 1.0)) > EDGE)
    n = path.n_pairs(motion.driver_angle_rad, side)
    for younger in (0.0, 1.0):
        turns = np.abs(u + younger - path.pitch_point) < PITCH_POINT
        clear &= ~(turns & ((younger == 0.0) | (n > 1.5)))
    speed = np.abs(motion.driver_speed_rad_s)
    clear &= speed > SLOW * float(np.quantile(speed, 0.95))
    return clear


@dataclass(frozen=True)
class FittedParameter:
    """One identified parameter.

    Parameters
    ----------
    name, unit : str
    value : float
    interval : (float, float)
        95 %, from the curvature at the best fit and the autocorrelation of the residuals.
    is_determined : bool
        Whether the record determines it: the half width of the interval is below half of the value.
    why_not : str
        Reason if it does not.
    rig_value : float or None
        Value in the rig file.
    correlated_with : str
        Parameter it may be confused with, and the correlation of both estimates.
    """

    name: str
    unit: str
    value: float
    interval: tuple[float, float]
    is_determined: bool
    why_not: str = ""
    rig_value: float | None = None
    correlated_with: str = ""


@dataclass(frozen=True)
class Identification(Result, rows="parameters"):
    """Identified parameters of contact and load.

    Parameters
    ----------
    parameters : tuple of FittedParameter
    equations : mapping
        Name of the equation → number of samples and scatter of the fit.
    condition : mapping
        Name of the equation → ratio of the largest to the smallest singular value of its scaled Jacobian.
    source : str
    """

    parameters: tuple[FittedParameter, ...]
    equations: Mapping[str, str]
    condition: Mapping[str, float]
    source: str = ""

    def parameter(self, name: str) -> FittedParameter:
        """Return a parameter by name."""
        parameters = {parameter.name: parameter for parameter in self.parameters}
        return parameters[known_name(name, parameters, f"there is no parameter {name!r}")]


MAX_RELATIVE_HALF_WIDTH = 0.5
"""Relative half width of the interval above which a parameter is not determined."""
NORMAL_95 = 1.96
ONE_FLANK = "only one flank was loaded: backlash and zero of the angles cannot be separated; record a stop with a brake"
ONE_ZERO = "only one flank was loaded: it can hardly be separated from the angles' zero; record a stop with a brake"
NAMES_OF_RESULT = {
    "datum": "the zero of the angles",
    "half_backlash": "half_backlash_um",
    "log stiffness": "stiffness_n_per_m_lambda",
    "damping": "restitution",
    "driver inertia": "driver_inertia_kg_m2",
    "friction": "friction_coefficient",
    "inverse inertia": "driven_inertia_kg_m2",
}
"""Term of an equation → name of the parameter."""
FALLING = ("damping", "inverse inertia")
"""Terms that decrease as their parameter grows."""
MOTOR = "it is ahead of the torque sensor and does not show in the torque"


def identify(motion: PairMotion) -> Identification:
    """Fit the parameters of contact and load, with 95 % intervals.

    Contact, on loaded samples away from the entry and exit of pairs: `ContactEquation`, for the zero of the angles,
    backlash, stiffness, damping c = β v (v: impact speed), inertia after the sensor, and friction. Load, while the
    driven gear turns: α2 = (r_b2 F − T_c sgn ω2 − c ω2)/J2, for J2, T_c and c.

    The noisy quantity (q, α2) is the response, so that its noise widens the intervals without biasing the values.
    Parameters that the record does not determine are marked, with those they may be confused with.

    Parameters
    ----------
    motion : PairMotion
        With torque. Exponent, damping law and geometry are the rig's.

    Raises
    ------
    RefusalError
        If there is no torque, or it never loads the flanks.

    Notes
    -----
    The intervals cover noise and its colour, not errors of the equations: eccentric gears, bending shafts, a wrong
    exponent. The motor's inertia is upstream of the torque sensor and cannot be identified.
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
    """Fit the load and widen its covariance by the uncertainty of the driver's inertia."""
    inertia, deviation = contact.value("driver inertia"), contact.deviation("driver inertia")
    fit = _fit_load(motion, inertia)
    if not np.isfinite(deviation):
        return fit
    moved = _fit_load(motion, inertia + deviation).values - fit.values
    return replace(fit, covariance=fit.covariance + np.outer(moved, moved))


def _fit_load(motion: PairMotion, inertia_kg_m2: float) -> RobustFit:
    """Fit α2 = (r_b2 F − T_c sgn ω2 − c ω2)/J2, with F the driver's tooth force corrected for flank friction."""
    r1, r2 = motion.path.base_radii_m
    (torque, _), w = motion.torque_and_tooth_force(), motion.driven_speed_rad_s
    force = (torque - inertia_kg_m2 * motion.driver_acceleration_rad_s2) / r1
    drive = r2 * force * friction_share(motion, force, 1) / friction_share(motion, force, 0)
    # Above a tenth of the typical speed the driven gear's friction is sliding.
    turning = np.abs(w) > 0.1 * float(np.quantile(np.abs(w), 0.95))
    if np.sum(turning) < 10 * MIN_SAMPLES:
        raise RefusalError("the driven gear barely turns", remedy="record a start or a stop")

    def residuals(values: FloatArray) -> FloatArray:
        inverse, level, viscous = values
        residual: FloatArray = motion.driven_acceleration_rad_s2 - inverse * (drive - level * np.sign(w) - viscous * w)
        return residual

    guess = motion.contact.driven_inertia_kg_m2 or 10.0
    ordinary = float(np.quantile(np.abs(drive), 0.9)) or 1.0
    # The load equation neglects about a thousandth of the typical acceleration.
    return robust_fit(
        residuals,
        np.array([1.0 / guess, 0.5 * ordinary, 0.05 * ordinary]),
        np.array([1.0 / guess, ordinary, ordinary]),
        turning,
        ("inverse inertia", "load_friction_nm", "load_viscous_nm_s_per_rad"),
        min_scatter=1e-3 * ordinary / guess,
    )


def _contact_parameters(motion: PairMotion, fit: RobustFit, *, has_both_flanks: bool) -> list[FittedParameter]:
    c = motion.contact
    play = FittedParameter(
        "half_backlash_um", "um", c.half_backlash_um, (0.0, float("inf")), False, ONE_FLANK, c.half_backlash_um
    )
    if has_both_flanks:
        play = _parameter(fit, "half_backlash", "half_backlash_um", "um", c.half_backlash_um, lambda a_m: 1e6 * a_m)
    return [
        play,
        # From one flank, a filter ahead of the torque sampling can simulate a stiffness twenty times too high.
        _parameter(
            fit,
            "log stiffness",
            "stiffness_n_per_m_lambda",
            "N/m^λ",
            c.stiffness_n_per_m_lambda,
            lambda log_k: float(np.exp(min(log_k, 700.0))),
            why_not="" if has_both_flanks else ONE_ZERO,
        ),
        _parameter(
            fit, "damping", "restitution", "", c.restitution, lambda factor: _restitution(c.damping_law, factor)
        ),
        _parameter(fit, "driver inertia", "driver_inertia_kg_m2", "kg m^2", c.driver_inertia_kg_m2),
        _parameter(fit, "friction", "friction_coefficient", "", c.friction_coefficient),
    ]


def _load_parameters(motion: PairMotion, fit: RobustFit) -> list[FittedParameter]:
    inertia = _parameter(
        fit,
        "inverse inertia",
        "driven_inertia_kg_m2",
        "kg m^2",
        motion.contact.driven_inertia_kg_m2,
        lambda inverse: 1.0 / inverse if inverse > 0.0 else float("inf"),
    )
    return [
        inertia if np.isfinite(inertia.value) else replace(inertia, value=float("nan")),
        _parameter(fit, "load_friction_nm", "load_friction_nm", "N m", None),
        _parameter(fit, "load_viscous_nm_s_per_rad", "load_viscous_nm_s_per_rad", "N m s/rad", None),
    ]


def _parameter(
    fit: RobustFit,
    term: str,
    name: str,
    unit: str,
    rig_value: float | None,
    turned: Callable[[float], float] = float,
    *,
    why_not: str = "",
) -> FittedParameter:
    """Return the parameter of an equation's term; `turned` converts the term's value to it.

    It is determined if the term is: a logarithm to within 0.5, other terms to within half of their value, and those
    that decrease as the parameter grows must be above zero.
    """
    value, half = fit.value(term), NORMAL_95 * fit.deviation(term)
    size = 1.0 if term == "log stiffness" else value if term in FALLING else abs(value)
    low, high = sorted((turned(value - half), turned(value + half)))
    is_determined = half < MAX_RELATIVE_HALF_WIDTH * size and not why_not
    alike = _alike(fit, term)
    why = "the record hardly depends on it" + (f", and it may be confused with {alike}" if alike else "")
    return FittedParameter(
        name, unit, turned(value), (low, high), is_determined, "" if is_determined else why_not or why, rig_value, alike
    )


def _restitution(law: str, factor: float) -> float:
    """Return the restitution at which a damping law has the factor c = β v."""
    grid = np.linspace(0.01, 1.0, 2_001)
    factors = np.array([damping_ratio_s_per_m(law, float(e), 1.0) for e in grid])
    return float(np.interp(factor, factors[::-1], grid[::-1]))


def _alike(fit: RobustFit, parameter: str) -> str:
    """Return the parameter that this one may be confused with, by its name in the result; empty if none."""
    like, correlation = fit.correlated_with(parameter)
    if not like:
        return ""
    sign = -1.0 if (parameter in FALLING) != (like in FALLING) else 1.0
    return f"{NAMES_OF_RESULT.get(like, like)} (correlation {sign * correlation:.2f})"


CERTAIN = 5.0
"""Standard deviations by which a tooth must differ from the others."""
N_PLACES = 12
"""Number of sections of single contact: teeth are compared at the same place of their contact."""
MIN_PART = 0.02
"""Minimum fraction of the mean deflection: healthy teeth differ by as much."""
MIN_SAMPLES_PER_TOOTH = 4


@dataclass(frozen=True)
class ToothYielding(Result, columns=("extra_um", "uncertainty_um", "n_samples")):
    """Additional deflection of each tooth of the driver, relative to the fitted contact, in single contact.

    Parameters
    ----------
    extra_um : array, (n_teeth,)
        Median over the samples of a tooth, minus the median of all teeth; nan if it has too few samples.
    uncertainty_um : array, (n_teeth,)
        One standard deviation, from the scatter of each tooth's samples.
    deflection_um : float
        Median deflection of a pair in those samples; by the rig's stiffness if only one flank was loaded.
    n_samples : array of int, (n_teeth,)
    weak_teeth : tuple of int
        Teeth that stand out, counted from 1, the weakest first.
    """

    extra_um: FloatArray
    uncertainty_um: FloatArray
    deflection_um: float
    n_samples: NDArray[np.int64]
    weak_teeth: tuple[int, ...]

    def stiffness_loss(self, tooth: int, exponent: float) -> float:
        """Relative stiffness loss of a pair that corresponds to the tooth's extra deflection: 1 − (1 + x/g)^−λ."""
        return self._loss(float(self.extra_um[tooth - 1]), exponent)

    def min_loss(self, exponent: float) -> float:
        """Relative stiffness loss at which a typical tooth would stand out."""
        ordinary = float(np.nanmedian(self.uncertainty_um))
        return self._loss(max(CERTAIN * ordinary, MIN_PART * self.deflection_um), exponent)

    def _loss(self, extra_um: float, exponent: float) -> float:
        return float(1.0 - (1.0 + extra_um / self.deflection_um) ** -exponent)


def tooth_compliance(motion: PairMotion) -> ToothYielding:
    """Return the extra deflection of each tooth of the driver on the drive flank.

    The contact equation is fitted to the whole record; the residual compression in single contact belongs to one
    tooth. A cracked tooth deflects more in each revolution.

    Raises
    ------
    RefusalError
        If there is no torque, or fewer than half of the teeth were seen in single contact.

    Notes
    -----
    The mating teeth of the driven gear change from revolution to revolution and widen the scatter. Run-out varies the
    compression as a wave over the revolution; it is included in the extra deflection, spread over many teeth.
    """
    equation = contact_equation(motion)
    fit = equation.solve(with_jackknife=False)
    single = _single_contact(equation)
    residual = _without_common_profile(equation, equation.residuals(fit.values), single)
    tooth = (motion.path.tooth(motion.driver_angle_rad) - 1.0).astype(np.int64)
    n_teeth = motion.path.teeth[0]
    counts = np.bincount(tooth[single], minlength=n_teeth)
    n_measured = int(np.sum(counts >= MIN_SAMPLES_PER_TOOTH))
    if n_measured < n_teeth // 2:
        raise RefusalError(
            f"{n_measured} of {n_teeth} teeth of the driver carried alone for {MIN_SAMPLES_PER_TOOTH} samples",
            remedy="record more revolutions, under load",
        )
    middle, spread = np.full(n_teeth, np.nan), np.full(n_teeth, np.nan)
    for j in np.flatnonzero(counts >= MIN_SAMPLES_PER_TOOTH):
        of_tooth = residual[single & (tooth == j)]
        middle[j] = np.median(of_tooth)
        spread[j] = median_deviation(of_tooth - middle[j])
    extra = middle - np.nanmedian(middle)
    # Neighbouring samples are correlated; the differences between teeth show the error of a median.
    alone = 1.25 * np.nanmedian(spread) / np.sqrt(np.maximum(counts, 1))
    among = median_deviation(extra[~np.isnan(extra)])
    uncertainty = np.where(np.isnan(extra), np.nan, np.maximum(alone, among))
    known = float(np.log(motion.contact.stiffness_n_per_m_lambda))  # one flank hardly separates it from the datum
    deflection = _deflection(equation, fit.value("log stiffness") if equation.has_both_flanks else known, single)
    return ToothYielding(
        1e6 * extra, 1e6 * uncertainty, 1e6 * deflection, counts, _weak_teeth(extra, uncertainty, deflection)
    )


def _single_contact(equation: ContactEquation) -> NDArray[np.bool_]:
    """Samples of single contact on the drive flank, steady enough for the equation."""
    _, force = equation.motion.torque_and_tooth_force()
    speed = np.abs(equation.motion.driver_speed_rad_s)
    loaded = force > LOADED * float(np.quantile(np.abs(force), 0.95))
    moving = speed > SLOW * float(np.quantile(speed, 0.95))
    alone: NDArray[np.bool_] = loaded & moving & (equation.n_pairs < 1.5) & (equation.group >= 0)
    return alone


def _without_common_profile(equation: ContactEquation, residual: FloatArray, single: NDArray[np.bool_]) -> FloatArray:
    """Subtract the profile common to all teeth: friction that reverses, pairs that enter and leave."""
    path = equation.motion.path
    edge = path.contact_ratio - 1.0
    u = path.position(equation.motion.driver_angle_rad)
    place = np.clip(((u - edge) / (1.0 - edge) * N_PLACES).astype(np.int64), 0, N_PLACES - 1)
    result = residual.copy()
    for p in range(N_PLACES):
        at_place = single & (place == p)
        if np.any(at_place):
            result[at_place] -= np.median(residual[at_place])
    return result


def _deflection(equation: ContactEquation, log_stiffness: float, single: NDArray[np.bool_]) -> float:
    _, force = equation.motion.torque_and_tooth_force()
    g = (np.abs(force[single]) / np.exp(log_stiffness)) ** (1.0 / equation.motion.contact.exponent)
    return float(np.median(g))


def _weak_teeth(extra: FloatArray, uncertainty: FloatArray, deflection: float) -> tuple[int, ...]:
    stands_out = np.nan_to_num(extra) > np.fmax(CERTAIN * np.nan_to_num(uncertainty, nan=np.inf), MIN_PART * deflection)
    order = np.argsort(-np.nan_to_num(extra, nan=-np.inf))
    return tuple(int(j) + 1 for j in order if stands_out[j])
