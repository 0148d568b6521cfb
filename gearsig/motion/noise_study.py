"""Noise of the motion at which the piecewise model is no better than Hunt–Crossley."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray, count, frozen_array
from gearsig.errors import InputError, RefusalError
from gearsig.motion.force import (
    FROM_TORQUE,
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    PIECEWISE,
    TEETH,
    TOOTH_FORCE,
    estimate_forces,
)
from gearsig.motion.measure import measure_motion
from gearsig.motion.roles import find_roles, role_values
from gearsig.motion.types import PairMotion
from gearsig.recording.types import Recording
from gearsig.rig.tooth_pairs import contact_pair, path_of_contact
from gearsig.rig.types import Rig

LEVELS_UM = (0.0, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)


@dataclass(frozen=True)
class NoiseStudy:
    """Errors of the models over added noise.

    Parameters
    ----------
    levels_um : array, (n_levels,)
        Standard deviation of white noise that was added to the compression, from sample to sample.
    reference : str
    rms_n : mapping
        Model → (n_levels,), root mean square error over all draws.
    crossover_um : float or None
        Noise at which the piecewise model is as far off as Hunt–Crossley; None: better at all levels, or at none.
    """

    levels_um: FloatArray
    reference: str
    rms_n: Mapping[str, FloatArray]
    crossover_um: float | None

    @property
    def text(self) -> str:
        """The answer in a sentence."""
        ratio = self.rms_n[PIECEWISE] / self.rms_n[HUNT_CROSSLEY]
        if self.crossover_um is not None:
            return (
                f"The piecewise model is nearer than Hunt–Crossley up to {self.crossover_um:.3g} µm of added noise in "
                f"the compression; without added noise its error is {100.0 * ratio[0]:.3g} % of Hunt–Crossley's."
            )
        if np.all(ratio < 1.0):
            return f"The piecewise model is nearer than Hunt–Crossley at all levels, up to {self.levels_um[-1]:g} µm."
        return "The piecewise model is not nearer than Hunt–Crossley, even without added noise."


def acceleration_limit_rad_s2(study: NoiseStudy, motion: PairMotion) -> float | None:
    """Return the white noise on the driver's acceleration up to which the piecewise model is nearer than Hunt–Crossley.

    It adds J1 σ/r_b1 to the piecewise model alone, in squares: σ = (r_b1/J1) √(rms_HC² − rms_piecewise²). None where
    nothing turns between torque sensor and teeth, where the reference is the tooth force, or where it is never nearer.
    """
    inertia, r1 = motion.contact.driver_inertia_kg_m2, motion.path.base_radii_m[0]
    own, other = float(study.rms_n[PIECEWISE][0]), float(study.rms_n[HUNT_CROSSLEY][0])
    if inertia == 0.0 or study.reference != FROM_TORQUE or own >= other:
        return None
    return r1 / inertia * float(np.sqrt(other**2 - own**2))


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
    """Add white noise to the driver's angle, and estimate the forces anew as if it had been measured so.

    Parameters
    ----------
    recording : Recording
        With torque or tooth force to compare with.
    rig : Rig or None
    rng : numpy.random.Generator
    levels_um : sequence of float
        Along the line of action; ascending, the first 0.
    n_draws : int
        Per level.
    use, bandwidth_hz, unwrap, datum
        As in `measure_motion` and `estimate_forces`.

    Raises
    ------
    InputError
        If the levels do not ascend from 0.
    RefusalError
        If there is nothing to compare with, or no angle of the driver.
    """
    levels = frozen_array(levels_um, "levels_um", ndim=1)
    if len(levels) < 2 or levels[0] != 0.0 or np.any(np.diff(levels) <= 0.0):
        raise InputError(f"levels_um is {levels.tolist()}", allowed="0 and more, ascending")
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
                wanted = TEETH if model == PIECEWISE and reference == TOOTH_FORCE else model
                draws.setdefault(model, []).append(estimate.error(wanted, reference).rms_n ** 2)
        for model, values in draws.items():
            squares.setdefault(model, []).append(values)
    rms = {model: np.array([np.sqrt(np.mean(v)) for v in values]) for model, values in squares.items()}
    return NoiseStudy(levels, reference, rms, _crossover(levels, rms[PIECEWISE] / rms[HUNT_CROSSLEY]))


def _crossover(levels_um: FloatArray, ratio: FloatArray) -> float | None:
    """Level at which a ratio below 1 first reaches 1, straight between levels."""
    above = np.flatnonzero(ratio >= 1.0)
    if not len(above) or above[0] == 0:
        return None
    i = int(above[0])
    share = (1.0 - ratio[i - 1]) / (ratio[i] - ratio[i - 1])
    return float(levels_um[i - 1] + share * (levels_um[i] - levels_um[i - 1]))


def _unit_of(recording: Recording, rig: Rig, role: str, name: str) -> float:
    """Radians that one unit of the channel is worth."""
    one = replace(recording, samples=np.ones((len(recording.channels), 1)))
    return float(role_values(one, rig, role, name)[0])


def _with_added(recording: Recording, name: str, noise: FloatArray) -> Recording:
    samples = np.array(recording.samples, dtype=np.float64)
    samples[recording.index(name)] += noise
    return replace(recording, samples=samples)
