"""When a tachometer's edges come on a speed profile whose angle is known in closed form."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from sims.kinematic.speed import SpeedProfile, time_at_revolutions
from sims.measure.tachometer import Tachometer


def edge_times(
    tacho: Tachometer, profile: SpeedProfile, ratio: float, end_s: float, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Times of the rising and falling edges from 0 to `end_s`, rising ones with jitter.

    `ratio`: revolutions of the tachometer's shaft per revolution of the profile's shaft.
    """
    pulses, offset = tacho.pulses_per_revolution, tacho.first_pulse_rev
    last_rev = ratio * float(profile.revolutions(np.array([end_s]))[0])
    k = np.arange(np.ceil(-offset * pulses), np.floor((last_rev - offset) * pulses) + 1)
    rising = (k / pulses + offset) / ratio
    falling = rising + tacho.duty / pulses / ratio
    falling = falling[falling * ratio <= last_rev]
    rising_s = time_at_revolutions(profile, rising, 0.0, end_s)
    falling_s = time_at_revolutions(profile, falling, 0.0, end_s)
    return rising_s + tacho.jitter_s * rng.standard_normal(len(rising_s)), falling_s
