"""Recordings of the forging manipulator that the tests share."""

from dataclasses import replace
from functools import cache

import numpy as np

from gearsig.recording import Recording
from sims import simulate

QUIET = {
    "encoder_counts": 0,
    "angle_noise_urad": 0,
    "speed_noise_mrad_per_s": 0,
    "acceleration_noise_rad_per_s2": 0,
    "torque_noise_nm": 0,
}
"""Sensors without noise."""


@cache
def start_stop(
    preset: str = "manipulator_formula", rate_hz: float = 1000.0, *, quiet: bool = False, **more: float
) -> Recording:
    parameters = {**(QUIET if quiet else {}), **more}
    return simulate("forging", preset=preset, parameters=parameters, duration_s=6.0, sampling_rate_hz=rate_hz)


@cache
def continuous(preset: str = "manipulator_formula", *, quiet: bool = False) -> Recording:
    parameters = {**(QUIET if quiet else {}), "mode": "continuous"}
    return simulate("forging", preset=preset, parameters=parameters, duration_s=3.0, sampling_rate_hz=1000.0)


def changed(recording: Recording, name: str, values: np.ndarray) -> Recording:
    samples = np.array(recording.samples)
    samples[recording.index(name)] = values
    return replace(recording, samples=samples)


def without(recording: Recording, *names: str) -> Recording:
    return recording.select([n for n in recording.channel_names if n not in names])
