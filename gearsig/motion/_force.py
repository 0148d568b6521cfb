"""Force between the teeth from measured motion: the piecewise model, Hunt–Crossley, Kelvin–Voigt."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, count, freeze, frozen_array, number
from gearsig.errors import InputError, RefusalError
from gearsig.motion._measure import PairMotion, check_motion, find_roles, measure_motion, median_deviation, role_values
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.rig import Rig, ToothContact, contact_pair, path_of_contact

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class Datum:
    """Zero of the compression: its value with the teeth in the middle of the backlash.

    Parameters
    ----------
    compression_m : float
    uncertainty_m : float
        One standard deviation; nan if the datum was given.
    method : str
    """

    compression_m: float
    uncertainty_m: float
    method: str


@dataclass(frozen=True)
class ForceError:
    """Deviation of a model's force from the reference.

    Parameters
    ----------
    model, reference : str
    rms_n, bias_n, largest_n : float
        RMS, mean and maximum magnitude of model − reference.
    relative_rms : float
        RMS divided by that of the reference.
    correlation : float
    """

    model: str
    reference: str
    rms_n: float
    relative_rms: float
    bias_n: float
    largest_n: float
    correlation: float


@dataclass(frozen=True)
class ForceEstimate(Result):
    """Force between the teeth from their motion, by several models.

    Parameters
    ----------
    motion : PairMotion
    datum : Datum
    depth_m : array, (n,)
        g: contact depth with the sign of the flank, 0 in the backlash.
    n_pairs : array, (n,)
    forces_n : mapping
        Model → (n,).
    references_n : mapping
        "torque / base radius" or "tooth force" → (n,); empty where nothing was measured.
    errors : tuple of ForceError
        For each model and each reference it can be compared with.
    descriptions : mapping
        Model → formula with its numbers.
    """

    motion: PairMotion
    datum: Datum
    depth_m: FloatArray
    n_pairs: FloatArray
    forces_n: Mapping[str, FloatArray]
    references_n: Mapping[str, FloatArray]
    errors: tuple[ForceError, ...]
    descriptions: Mapping[str, str]

    def __post_init__(self) -> None:
        freeze(self, "depth_m", "n_pairs")

    def to_frame(self) -> DataFrame:
        """Return time, references, models, depth and pairs in contact as a pandas table, one row per sample."""
        from pandas import DataFrame

        forces = {f"{name} [N]": values for name, values in {**self.references_n, **self.forces_n}.items()}
        return DataFrame(
            {"time_s": self.motion.time_s, **forces, "depth [um]": 1e6 * self.depth_m, "pairs in contact": self.n_pairs}
        )

    def error(self, model: str, reference: str) -> ForceError:
        """Return the error of one model against one reference."""
        return next(e for e in self.errors if (e.model, e.reference) == (model, reference))


def depth(compression_m: FloatArray, half_backlash_m: float) -> FloatArray:
    """Depth g in m: compression beyond the half backlash, with the sign of the flank; 0 in the gap."""
    g: FloatArray = np.sign(compression_m) * np.maximum(np.abs(compression_m) - half_backlash_m, 0.0)
    return g


def latched_damping(motion: PairMotion, compression_m: FloatArray) -> FloatArray:
    """β in s/m at each sample, from the impact speed of its contact; 0 in the gap.

    The impact speed is √(v² + 2 a d) with speed v, acceleration a and distance d at the last sample in the gap: flanks
    that start from rest gain most of their speed between two samples. It is held for the whole contact and not less
    than the floor: with the instantaneous speed, b = f/v would grow without bound as the flanks come to rest.

    Parameters
    ----------
    motion : PairMotion
    compression_m : array, (n,)
        From the middle of the backlash.
    """
    contact, rate = motion.contact, motion.compression_rate_mps
    play = contact.half_backlash_um * 1e-6
    side = np.sign(depth(compression_m, play))
    begins = np.flatnonzero((side != 0.0) & (np.concatenate([[0.0], side[:-1]]) != side))
    if not len(begins):
        return np.zeros_like(side)
    last = np.maximum(begins - 1, 0)
    earlier = np.maximum(begins - 2, 0)
    # A derived acceleration would include part of the impact that follows; two samples in the gap do not.
    flown = (side[earlier] == 0.0) & (earlier < last)
    gained = np.where(
        flown,
        (rate[last] - rate[earlier]) / np.where(flown, motion.time_s[last] - motion.time_s[earlier], 1.0),
        motion.compression_acceleration_mps2[last],
    )
    gap_m = np.where(side[last] == 0.0, play - side[begins] * compression_m[last], 0.0)
    square = rate[last] ** 2 + 2.0 * side[begins] * gained * gap_m
    speed = np.maximum(np.sqrt(np.maximum(square, 0.0)), contact.impact_speed_floor_mps)
    latest = np.searchsorted(begins, np.arange(len(side)), side="right") - 1
    beta = contact.damping_ratio_at(1.0) * max(1.0, contact.impact_speed_floor_mps) / speed
    return np.where(side != 0.0, beta[np.maximum(latest, 0)], 0.0)


def pair_force(g: FloatArray, rate_mps: FloatArray, damping_s_per_m: FloatArray, contact: ToothContact) -> FloatArray:
    """Force of one tooth pair in N, k sgn(g)|g|^λ (1 + β ġ), never tensile; positive on the drive flank."""
    side = np.sign(g)
    growth = np.maximum(1.0 + damping_s_per_m * side * rate_mps, 0.0)
    force: FloatArray = side * contact.stiffness_n_per_m_lambda * np.abs(g) ** contact.exponent * growth
    return force


def friction_share(motion: PairMotion, g: FloatArray, gear: int = 0) -> FloatArray:
    """Mean of 1 − μ sgn(v_s) tan α_k over the pairs in contact: the share of the normal force in a gear's torque.

    tan α_k = ρ/r_b at the point of contact, for the driver (gear 0) or the driven gear (1). The sign changes at the
    pitch point, so that the share there is 1 ∓ 0.018 for μ = 0.05 and 20°.
    """
    path = motion.path
    flank = np.where(g < 0.0, -1.0, 1.0)
    positions, weights, _ = path.pairs(motion.driver_angle_rad, flank)
    rho_1 = path.driver_lever_m(positions)
    rho_2 = path.length_m - rho_1
    sliding = flank * (motion.driven_speed_rad_s * rho_2 - motion.driver_speed_rad_s * rho_1)
    # Below 2 mm/s the sign of friction changes smoothly: bristle deflection is not modelled.
    sign = np.clip(sliding / 2e-3, -1.0, 1.0)
    share = 1.0 - motion.contact.friction_coefficient * sign * (rho_1, rho_2)[gear] / path.base_radii_m[gear]
    result: FloatArray = np.sum(weights * share, axis=0) / np.sum(weights, axis=0)
    return result


def hand_over_force(motion: PairMotion, g: FloatArray) -> FloatArray:
    """Return ∂V/∂θ1 / r_b1 in N: the additional driver force due to energy of pairs that enter or leave contact.

    V = Σ w(p_i) k |g|^(λ+1)/(λ+1) changes with the driver's angle through the weights of the pairs that enter and
    leave; over a whole pitch at constant depth the sum is zero.
    """
    flank = np.where(g < 0.0, -1.0, 1.0)
    slopes = np.sum(motion.path.pairs(motion.driver_angle_rad, flank)[2], axis=0)
    exponent = motion.contact.exponent + 1.0
    energy = motion.contact.stiffness_n_per_m_lambda * np.abs(g) ** exponent / exponent
    per_rad = motion.path.teeth[0] / (2.0 * np.pi)
    result: FloatArray = flank * slopes * per_rad * energy / motion.path.base_radii_m[0]
    return result


MIN_SAMPLES = 20


def find_datum(motion: PairMotion, choice: str | float = "auto") -> Datum:
    """Find the compression at which the teeth are in the middle of the backlash.

    Parameters
    ----------
    motion : PairMotion
    choice : str or float
        "auto": from the torque if measured, else midway between the two flanks; "zero": the angles are zero at the
        middle of the backlash; a number: that compression in m.

    Raises
    ------
    RefusalError
        If there is no torque and the teeth did not touch both flanks.
    """
    check_motion(motion)
    if isinstance(choice, str):
        if choice == "zero":
            return Datum(0.0, float("nan"), "the angles' own zero")
        if choice != "auto":
            raise InputError(f"datum is {choice!r}", allowed="auto, zero, or a compression")
        return _from_torque(motion) if motion.torque_nm is not None else _between_flanks(motion)
    return Datum(number(choice, "datum", "m"), float("nan"), "given")


def elastic_depth(motion: PairMotion, force_n: FloatArray) -> FloatArray:
    """Signed depth in m at which the pairs in contact carry a static force."""
    contact, path = motion.contact, motion.path
    n = path.n_pairs(motion.driver_angle_rad, np.sign(force_n))
    yielding: FloatArray = np.sign(force_n) * (np.abs(force_n) / (n * contact.stiffness_n_per_m_lambda)) ** (
        1.0 / contact.exponent
    )
    return yielding


def _from_torque(motion: PairMotion) -> Datum:
    """Median of q − sgn(F) a − g(F) over loaded samples, so that the mean depth carries the measured torque."""
    _, force = motion.torque_and_tooth_force()
    # Loaded: above a fifth of the 95 % quantile, so that no single impact decides.
    loaded = np.abs(force) > 0.2 * np.quantile(np.abs(force), 0.95)
    if np.count_nonzero(loaded) < MIN_SAMPLES or not np.any(force):
        raise RefusalError(
            f"{np.count_nonzero(loaded)} samples carry a load: the zero of the compression cannot be found",
            remedy="record while the machine drives, or give gearsig force the zero with --datum",
        )
    a = motion.contact.half_backlash_um * 1e-6
    normal = force / friction_share(motion, force)
    zero = (motion.compression_m - np.sign(force) * a - elastic_depth(motion, normal))[loaded]
    middle = float(np.median(zero))
    spread = median_deviation(zero - middle)
    return Datum(middle, 1.25 * spread / np.sqrt(len(zero)), f"from the torque, {len(zero)} loaded samples")


def _between_flanks(motion: PairMotion) -> Datum:
    low, high = np.quantile(motion.compression_m, [0.01, 0.99])
    play = 2e-6 * motion.contact.half_backlash_um
    if not play or abs(high - low - play) > 0.35 * play:
        raise RefusalError(
            f"there is no torque, and the distance between the flanks spans {1e6 * (high - low):.4g} µm where the "
            f"backlash is {1e6 * play:.4g} µm: it is unclear which flank touches",
            remedy="record the torque, or a start and stop that touches both flanks, or give gearsig force the zero "
            "with --datum",
        )
    return Datum(
        float(low + high) / 2.0,
        float(high - low - play) / 2.0,
        "midway between both flanks; they may deflect differently",
    )


PIECEWISE = "piecewise"
AS_PRINTED = "piecewise, as printed"
HUNT_CROSSLEY = "Hunt–Crossley"
KELVIN_VOIGT = "Kelvin–Voigt"
TEETH = "piecewise, teeth alone"
FROM_TORQUE, TOOTH_FORCE = "torque / base radius", "tooth force"


def estimate_forces(motion: PairMotion, *, datum: str | float = "auto") -> ForceEstimate:
    """Estimate the force between the teeth at every sample.

    - piecewise: Σ over the pairs in contact of w k sgn(g)|g|^λ (1 + β ġ)(1 ∓ μ tan α_k), plus ∂V/∂θ1/r_b1 where their
      weights w change, plus J1 α1/r_b1 of the inertia between torque sensor and teeth: comparable with τ/r_b1. The
      driver's angle determines the pairs, forwards and backwards.
    - piecewise, teeth alone: the normal force, without inertia and friction.
    - piecewise, as printed: with J2/r_b2² · q̈ instead of J1 α1/r_b1. For two free bodies that is the force with the
      opposite sign; for a loaded gear it counts the load's inertia in the pinion's torque, an error of several times
      the force.
    - Hunt–Crossley: k δ^λ (1 + β δ̇) of one pair on the drive flank, with δ from first contact.
    - Kelvin–Voigt: k' δ + b' δ̇, likewise, with k' and b' that match Hunt–Crossley at the median load.

    Parameters
    ----------
    motion : PairMotion
    datum : str or float
        See `gearsig.motion.find_datum`.

    Returns
    -------
    ForceEstimate
        With errors against τ/r_b1 and against a measured or simulated tooth force, where available.

    Notes
    -----
    An error of 1 µm in the compression is an error of λF/g per µm: about 130 N of 2 kN for stiff teeth. An encoder of
    fewer than about 10⁶ counts cannot measure force in this way.

    Source: Z. Xu, H. Deng, Y. Zhang, Piecewise nonlinear dynamic modeling for gear transmissions with rotary inertia
    and backlash, modified: sgn(g)|g|^λ for g^λ, base radii for reference radii, μ tan α_k for μ cot β, one mass also
    in double contact, and the impact speed held during contact.
    """
    zero = find_datum(motion, datum)
    contact = motion.contact
    q = motion.compression_m - zero.compression_m
    g = depth(q, contact.half_backlash_um * 1e-6)
    rate = motion.compression_rate_mps
    beta = latched_damping(motion, q)
    n = np.where(g != 0.0, motion.path.n_pairs(motion.driver_angle_rad, np.sign(g)), 0.0)
    normal = n * pair_force(g, rate, beta, contact)
    at_shaft = normal * friction_share(motion, g) + hand_over_force(motion, g)
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
        zero,
        g,
        n,
        forces,
        references,
        _errors(forces, references),
        _descriptions(motion, stiffness, damping, set(forces)),
    )


def compare(model: str, force_n: FloatArray, reference: str, reference_n: FloatArray) -> ForceError:
    """Return the deviation of a force from a reference."""
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
    references: dict[str, FloatArray] = {}
    if motion.shaft_force_n is not None:
        references[FROM_TORQUE] = motion.shaft_force_n
    if motion.force_n is not None:
        references[TOOTH_FORCE] = motion.force_n
    return references


def _errors(forces: Mapping[str, FloatArray], references: Mapping[str, FloatArray]) -> tuple[ForceError, ...]:
    """Compare each model with each reference; the piecewise forms only with the quantity they represent."""
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
            "the drive flanks never touch with this datum, backlash and stiffness",
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


LEVELS_UM = (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@dataclass(frozen=True)
class NoiseStudy:
    """Errors of the force models over added noise.

    Parameters
    ----------
    levels_um : array, (n_levels,)
        Standard deviation of the white noise added to the compression.
    reference : str
    rms_n : mapping
        Model → (n_levels,), RMS error over all draws.
    crossover_um : float or None
        Noise at which the errors of the piecewise model and Hunt–Crossley are equal; None: the piecewise model is
        better at all levels, or at none.
    """

    levels_um: FloatArray
    reference: str
    rms_n: Mapping[str, FloatArray]
    crossover_um: float | None

    @property
    def text(self) -> str:
        """The result in a sentence."""
        ratio = self.rms_n[PIECEWISE] / self.rms_n[HUNT_CROSSLEY]
        if self.crossover_um is not None:
            return (
                f"The piecewise model is closer than Hunt–Crossley up to {self.crossover_um:.3g} µm of added noise in "
                f"the compression; without added noise its error is {100.0 * ratio[0]:.3g} % of Hunt–Crossley's."
            )
        if np.all(ratio < 1.0):
            return f"The piecewise model is closer than Hunt–Crossley at all levels, up to {self.levels_um[-1]:g} µm."
        return "The piecewise model is no closer than Hunt–Crossley, even without added noise."


def acceleration_limit_rad_s2(study: NoiseStudy, motion: PairMotion) -> float | None:
    """Return the white noise of the driver's acceleration up to which the piecewise model beats Hunt–Crossley.

    The noise adds J1 σ/r_b1 to the error of the piecewise model alone, as a sum of squares:
    σ = (r_b1/J1) √(rms_HC² − rms_piecewise²). None if there is no inertia between torque sensor and teeth, if the
    reference is the tooth force, or if the piecewise model is never better.
    """
    inertia, r1 = motion.contact.driver_inertia_kg_m2, motion.path.base_radii_m[0]
    piecewise_n, hunt_crossley_n = float(study.rms_n[PIECEWISE][0]), float(study.rms_n[HUNT_CROSSLEY][0])
    if inertia == 0.0 or study.reference != FROM_TORQUE or piecewise_n >= hunt_crossley_n:
        return None
    return r1 / inertia * float(np.sqrt(hunt_crossley_n**2 - piecewise_n**2))


def noise_study(
    recording: Recording,
    rig: Rig | None = None,
    *,
    rng: np.random.Generator,
    levels_um: Sequence[float] = LEVELS_UM,
    n_draws: int = 3,
    use: Mapping[str, str] | None = None,
    bandwidth_hz: float | None = None,
    unwrap: bool = False,
    datum: str | float = "auto",
) -> NoiseStudy:
    """Add white noise to the driver's angle and estimate the forces again, as if it had been measured that way.

    Parameters
    ----------
    recording : Recording
        With torque or tooth force as a reference.
    rig : Rig or None
    rng : numpy.random.Generator
    levels_um : sequence of float
        Along the line of action; ascending from 0.
    n_draws : int
        Per level.
    use, bandwidth_hz, unwrap, datum
        As in `measure_motion` and `estimate_forces`.

    Raises
    ------
    InputError
        If the levels do not ascend from 0.
    RefusalError
        If there is no reference, or no driver angle.
    """
    levels = frozen_array(levels_um, "levels_um", ndim=1)
    if len(levels) < 2 or levels[0] != 0.0 or np.any(np.diff(levels) <= 0.0):
        raise InputError(f"levels_um is {levels.tolist()}", allowed="ascending, from 0")
    count(n_draws, "n_draws")
    known = rig or recording.rig or Rig()
    path = path_of_contact(known)
    role = "driver angle"
    name = find_roles(recording, contact_pair(known), use).get(role)
    if name is None:
        raise RefusalError("the driver's angle was not measured: there is nothing to add noise to")
    unit = _unit_of(recording, known, role, name)
    squares: dict[str, list[list[float]]] = {}
    reference = ""
    for level in levels:
        draws: dict[str, list[float]] = {}
        for _ in range(n_draws if level else 1):
            noise = level * 1e-6 / path.base_radii_m[0] / unit * rng.standard_normal(recording.n_samples)
            noisy = _with_added(recording, name, noise)
            motion = measure_motion(noisy, known, use=use, bandwidth_hz=bandwidth_hz, unwrap=unwrap)
            estimate = estimate_forces(motion, datum=datum)
            if not estimate.references_n:
                raise RefusalError("neither torque nor tooth force was measured", remedy="record the driver's torque")
            reference = FROM_TORQUE if FROM_TORQUE in estimate.references_n else TOOTH_FORCE
            for model in (PIECEWISE, HUNT_CROSSLEY, KELVIN_VOIGT):
                compared = TEETH if model == PIECEWISE and reference == TOOTH_FORCE else model
                draws.setdefault(model, []).append(estimate.error(compared, reference).rms_n ** 2)
        for model, values in draws.items():
            squares.setdefault(model, []).append(values)
    rms = {model: np.array([np.sqrt(np.mean(v)) for v in values]) for model, values in squares.items()}
    return NoiseStudy(levels, reference, rms, _crossover(levels, rms[PIECEWISE] / rms[HUNT_CROSSLEY]))


def _crossover(levels_um: FloatArray, ratio: FloatArray) -> float | None:
    """Level at which a ratio below 1 first reaches 1, interpolated linearly."""
    above = np.flatnonzero(ratio >= 1.0)
    if not len(above) or above[0] == 0:
        return None
    i = int(above[0])
    share = (1.0 - ratio[i - 1]) / (ratio[i] - ratio[i - 1])
    return float(levels_um[i - 1] + share * (levels_um[i] - levels_um[i - 1]))


def _unit_of(recording: Recording, rig: Rig, role: str, name: str) -> float:
    """Radians per unit of the channel."""
    single_sample = replace(recording, samples=np.ones((len(recording.channels), 1)))
    return float(role_values(single_sample, rig, role, name)[0])


def _with_added(recording: Recording, name: str, noise: FloatArray) -> Recording:
    samples = np.array(recording.samples, dtype=np.float64)
    samples[recording.index(name)] += noise
    return replace(recording, samples=samples)
