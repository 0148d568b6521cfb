"""Gearboxes drawn at random for the population of the gap diagnosis, and how they stand on another day."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from app.calibration.rigs import DrawnRig, HousingMode, draw_rig, log_uniform
from sims.effects import EffectSetting
from sims.gear_pair.usual import BODY_SHAPES, body_gain

LIGHT_SHARE, LIGHT_TORQUE = 0.4, (0.0005, 0.3)
"""Machines that run at light load, and their torque over that of the others: down to what idling takes."""

DURATION_S = (3.0, 7.0)
MOUNTED_ANEW_SHARE = 0.6
"""Recordings between which and their reference the sensors were taken off."""

COUPLING_BENDING_SHARES = (0.002, 0.05)
"""Bending stiffness of a coupling over its shaft's torsional one, by catalogues of steel discs to elastomers."""

RIGID_SHARE = 0.25
MOUNTS_HZ, MOUNTS_DAMPING, BODY_KG = (4.0, 40.0), (0.05, 0.3), (20.0, 120.0)
"""Machines on rigid ground; mounts or frames of the others, and their housings with what moves along, at module 2."""

SPEED_SCATTER, TORQUE_SCATTER = 0.006, 0.05
GAIN_SCATTER, MODE_SCATTER, MODE_GAIN_SCATTER = 0.10, 0.03, 0.20
"""Relative standard deviations of what a changed mounting changes; gains are those of each channel and mode."""

NOISE_SCATTER = 0.12
"""Of the natural logarithm of the sensors' noise."""

WANDER_PERCENT, WANDER_HZ, WANDER_SCATTER = (0.005, 0.3), (0.03, 1.0), 0.4
"""Of every drive's speed: amplitude and frequency, and by how much the amplitude's logarithm differs on another day."""


@dataclass(frozen=True)
class Day:
    """How a machine stands and runs on one day.

    Parameters
    ----------
    drawn : DrawnRig
        With that day's path and noise.
    speed_factor, torque_factor : float
    gains : tuple of float
        Of the channels.
    wander : EffectSetting
        Of the speed, as every drive's.
    """

    drawn: DrawnRig
    speed_factor: float
    torque_factor: float
    gains: tuple[float, float]
    wander: EffectSetting


def draw_machine(rng: np.random.Generator) -> DrawnRig:
    """Draw a sound gearbox, full or lightly loaded, with the length of its recordings.

    Gears lie side by side, above each other or aslant, and a housing's modes move each in a direction of their own:
    what pushes across the line of action is heard as well. Most housings stand on something that yields, so that the
    low orders of the shafts are heard, too.
    """
    drawn = draw_rig(rng, for_the_check=False, even=bool(rng.uniform() < 0.1))
    aslant = np.random.default_rng([drawn.seed, 6])
    bends = log_uniform(aslant, *COUPLING_BENDING_SHARES) * float(drawn.parameters["torsional_stiffness_nm_per_rad"])
    lies = {"line_of_action_deg": float(aslant.uniform(-180.0, 180.0)), "coupling_bending_nm_per_rad": bends}
    modes = (*drawn.modes, *_on_mounts(drawn, aslant))
    modes = tuple(replace(mode, direction_deg=float(aslant.uniform(0.0, 180.0))) for mode in modes)
    drawn = replace(drawn, parameters={**drawn.parameters, **lies}, modes=modes)
    if rng.uniform() < LIGHT_SHARE:
        drawn = replace(drawn, torque_nm=drawn.torque_nm * log_uniform(rng, *LIGHT_TORQUE))
    return replace(drawn, depth_mm=0.0, duration_s=float(np.clip(1.2 * drawn.duration_s, *DURATION_S)))


def _on_mounts(drawn: DrawnRig, rng: np.random.Generator) -> tuple[HousingMode, ...]:
    """Return heave and pitch of the housing as a rigid body, see `sims.gear_pair.usual.body_on_mounts`; rarely none."""
    size = float(drawn.parameters["module_mm"]) / 2.0
    frequency_hz, damping_ratio = log_uniform(rng, *MOUNTS_HZ), rng.uniform(*MOUNTS_DAMPING)
    mass_kg = log_uniform(rng, *BODY_KG) * size**2
    if rng.uniform() < RIGID_SHARE:
        return ()
    gain = body_gain(float(drawn.parameters["bearing_stiffness_n_per_m"]), mass_kg, frequency_hz)
    return tuple(HousingMode(frequency_hz, damping_ratio, gain, shape) for shape in BODY_SHAPES)


def first_day(drawn: DrawnRig, rng: np.random.Generator) -> Day:
    """Return the machine as it was drawn."""
    return Day(drawn, 1.0, 1.0, (1.0, 1.0), _wander(drawn, rng))


def another_day(drawn: DrawnRig, rng: np.random.Generator) -> Day:
    """Return the machine as it stands on another day: nearly the same point, perhaps with sensors mounted anew."""
    speed, torque = (1.0 + s * float(rng.standard_normal()) for s in (SPEED_SCATTER, TORQUE_SCATTER))
    noise = float(drawn.parameters["noise_mps2"]) * float(np.exp(NOISE_SCATTER * rng.standard_normal()))
    parameters, wander = {**drawn.parameters, "noise_mps2": noise}, _wander(drawn, rng)
    if rng.uniform() >= MOUNTED_ANEW_SHARE:
        return Day(replace(drawn, parameters=parameters), speed, torque, (1.0, 1.0), wander)
    first, second = np.exp(GAIN_SCATTER * rng.standard_normal(2))
    # Where the whole housing moves, it matters little how a sensor sits.
    modes = tuple(_mounted_anew(mode, rng) if mode.frequency_hz > MOUNTS_HZ[1] else mode for mode in drawn.modes)
    return Day(replace(drawn, parameters=parameters, modes=modes), speed, torque, (float(first), float(second)), wander)


def _wander(drawn: DrawnRig, rng: np.random.Generator) -> EffectSetting:
    """Return the drive's wander on one day: its kind belongs to the machine."""
    own = np.random.default_rng([drawn.seed, 5])
    percent, frequency_hz = (log_uniform(own, *span) for span in (WANDER_PERCENT, WANDER_HZ))
    today = float(np.exp(WANDER_SCATTER * rng.standard_normal()))
    return EffectSetting("speed_fluctuation", percent * today, {"frequency_hz": frequency_hz})


def _mounted_anew(mode: HousingMode, rng: np.random.Generator) -> HousingMode:
    return replace(
        mode,
        frequency_hz=mode.frequency_hz * float(np.exp(MODE_SCATTER * rng.standard_normal())),
        gain=mode.gain * float(np.exp(MODE_GAIN_SCATTER * rng.standard_normal())),
        damping_ratio=mode.damping_ratio * float(np.exp(MODE_GAIN_SCATTER * rng.standard_normal())),
    )
