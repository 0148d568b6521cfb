"""Teeth that yield more than the others: from the compression that the fitted contact does not explain."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.identify_contact import LOADED, SLOW, ContactEquation, contact_equation
from gearsig.motion.types import PairMotion

CERTAIN = 5.0
"""Standard deviations by which a tooth must stand out of the others."""
N_PLACES = 12
"""Parts of the stretch in which a pair carries alone: teeth are compared at equal places of their contact."""
LEAST_PART = 0.02
"""Of the mean deflection: teeth differ by that anyway."""
LEAST_SAMPLES = 4
"""Of a tooth."""


@dataclass(frozen=True)
class ToothCompliance:
    """How much more than the fitted contact each tooth of the driver yields, while it carries alone.

    Parameters
    ----------
    extra_um : array, (n_teeth,)
        Median over the samples of a tooth, less the median of all teeth; nan where it was hardly passed.
    uncertainty_um : array, (n_teeth,)
        One standard deviation, from the scatter of the teeth's own samples.
    deflection_um : float
        Median deflection of a pair in those samples; with the rig's stiffness where only one flank was loaded.
    n_samples : array of int, (n_teeth,)
    weak_teeth : tuple of int
        Those that stand out, from 1, the weakest first.
    """

    extra_um: FloatArray
    uncertainty_um: FloatArray
    deflection_um: float
    n_samples: NDArray[np.int64]
    weak_teeth: tuple[int, ...]

    def stiffness_loss(self, tooth: int, exponent: float) -> float:
        """Part of the stiffness of a pair that such an extra deflection stands for: 1 − (1 + x/g)^−λ."""
        return self._loss(float(self.extra_um[tooth - 1]), exponent)

    def least_loss(self, exponent: float) -> float:
        """Part of its stiffness that an ordinary tooth must have lost to stand out."""
        ordinary = float(np.nanmedian(self.uncertainty_um))
        return self._loss(max(CERTAIN * ordinary, LEAST_PART * self.deflection_um), exponent)

    def _loss(self, extra_um: float, exponent: float) -> float:
        return float(1.0 - (1.0 + extra_um / self.deflection_um) ** -exponent)


def tooth_compliance(motion: PairMotion) -> ToothCompliance:
    """Return the extra deflection of each tooth of the driver on the drive flank.

    The contact's equation is fitted to the whole record; what is left of the compression where one pair carries alone
    belongs to one tooth. A cracked tooth yields more each time it comes round.

    Raises
    ------
    RefusalError
        If there is no torque, or fewer than half of the teeth carried alone.

    Notes
    -----
    The teeth of the driven gear differ each time round and widen the scatter. Run-out moves the compression over a
    revolution in a wave: it is in the extra deflection as well, over many teeth.
    """
    if motion.torque_nm is None:
        raise RefusalError("no torque was measured", remedy="record the driver's torque")
    equation = contact_equation(motion)
    fit = equation.solve(with_jackknife=False)
    single = _alone(equation)
    left = _at_equal_places(equation, equation.residuals(fit.values), single)
    tooth = (motion.path.tooth(motion.driver_angle_rad) - 1.0).astype(np.int64)
    n_teeth = motion.path.teeth[0]
    counts = np.bincount(tooth[single], minlength=n_teeth)
    n_seen = int(np.sum(counts >= LEAST_SAMPLES))
    if n_seen < n_teeth // 2:
        raise RefusalError(
            f"{n_seen} of {n_teeth} teeth of the driver carried alone for {LEAST_SAMPLES} samples",
            remedy="record more revolutions, under load",
        )
    middle, spread = np.full(n_teeth, np.nan), np.full(n_teeth, np.nan)
    for j in np.flatnonzero(counts >= LEAST_SAMPLES):
        own = left[single & (tooth == j)]
        middle[j] = np.median(own)
        spread[j] = 1.4826 * np.median(np.abs(own - middle[j]))
    extra = middle - np.nanmedian(middle)
    # Neighbouring samples are alike; the teeth's own differences say by how much a median can be off.
    alone = 1.25 * np.nanmedian(spread) / np.sqrt(np.maximum(counts, 1))
    among = 1.4826 * float(np.nanmedian(np.abs(extra)))
    uncertainty = np.where(np.isnan(extra), np.nan, np.maximum(alone, among))
    known = float(np.log(motion.contact.stiffness_n_per_m_lambda))  # one flank hardly tells it from the angles' zero
    deflection = _deflection(equation, fit.value("log stiffness") if equation.has_both_flanks else known, single)
    return ToothCompliance(
        1e6 * extra, 1e6 * uncertainty, 1e6 * deflection, counts, _weak(extra, uncertainty, deflection)
    )


def _alone(equation: ContactEquation) -> NDArray[np.bool_]:
    """Samples in which one pair carries alone on the drive flank, calm enough for its equation."""
    force, speed = equation.motion.tooth_force_from_torque_n, np.abs(equation.motion.driver_speed_rad_s)
    assert force is not None  # noqa: S101  there is a torque
    loaded = force > LOADED * float(np.quantile(np.abs(force), 0.95))
    moving = speed > SLOW * float(np.quantile(speed, 0.95))
    alone: NDArray[np.bool_] = loaded & moving & (equation.n_pairs < 1.5) & (equation.group >= 0)
    return alone


def _at_equal_places(equation: ContactEquation, left: FloatArray, single: NDArray[np.bool_]) -> FloatArray:
    """Take off what all teeth have in common at a place: friction that turns, pairs that come and go."""
    path = equation.motion.path
    edge = path.contact_ratio - 1.0
    u = path.position(equation.motion.driver_angle_rad)
    place = np.clip(((u - edge) / (1.0 - edge) * N_PLACES).astype(np.int64), 0, N_PLACES - 1)
    result = left.copy()
    for p in range(N_PLACES):
        here = single & (place == p)
        if np.any(here):
            result[here] -= np.median(left[here])
    return result


def _deflection(equation: ContactEquation, log_stiffness: float, single: NDArray[np.bool_]) -> float:
    force = equation.motion.tooth_force_from_torque_n
    assert force is not None  # noqa: S101  there is a torque
    g = (np.abs(force[single]) / np.exp(log_stiffness)) ** (1.0 / equation.motion.contact.exponent)
    return float(np.median(g))


def _weak(extra: FloatArray, uncertainty: FloatArray, deflection: float) -> tuple[int, ...]:
    stands_out = np.nan_to_num(extra) > np.fmax(
        CERTAIN * np.nan_to_num(uncertainty, nan=np.inf), LEAST_PART * deflection
    )
    order = np.argsort(-np.nan_to_num(extra, nan=-np.inf))
    return tuple(int(j) + 1 for j in order if stands_out[j])
