"""An accelerometer: bandwidth, noise, bias, range."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, positive, within
from gearsig.errors import InputError
from sims.measure.hold import apply, high_pass, low_pass


@dataclass(frozen=True)
class Accelerometer:
    """value = clip(sensor's dynamics applied to the acceleration + noise + bias).

    The dynamics are ω²/(s² + 2ζωs + ω²) of the mounted sensor and s/(s + ω_c) of its coupling.

    Parameters
    ----------
    resonance_hz : float or None
        Of the mounted sensor; None: flat. The response is within 5 % up to about a fifth of it.
    damping_ratio : float
        Of that resonance.
    lower_limit_hz : float
        -3 dB point of the coupling; 0: measures down to a standing acceleration.
    range_mps2 : float or None
        Values are held at ± this; None: no limit.
    clip_percent : float
        A range that is too small for the signal: values are held at the level that the reading exceeds this part of the
        recording's time, 0 to 50 %. The level follows from each signal; `range_mps2` stays the same for all.
    noise_mps2_per_sqrt_hz : float
        One-sided density of white noise.
    bias_mps2 : float
        At the recording's start.
    drift_mps2_per_s : float
        Change of the bias with time, as from warming up.
    wander_mps2_per_sqrt_s : float
        Random walk of the bias: its standard deviation after 1 s.
    """

    resonance_hz: float | None = None
    damping_ratio: float = 0.02
    lower_limit_hz: float = 0.0
    range_mps2: float | None = None
    noise_mps2_per_sqrt_hz: float = 0.0
    bias_mps2: float = 0.0
    drift_mps2_per_s: float = 0.0
    wander_mps2_per_sqrt_s: float = 0.0
    clip_percent: float = 0.0

    def __post_init__(self) -> None:
        if self.resonance_hz is not None:
            positive(self.resonance_hz, "resonance_hz of the accelerometer", "Hz")
        within(self.damping_ratio, "damping_ratio of the accelerometer", 1e-4, 1.0)
        not_negative(self.lower_limit_hz, "lower_limit_hz of the accelerometer", "Hz")
        if self.range_mps2 is not None:
            positive(self.range_mps2, "range_mps2 of the accelerometer", "m/s^2")
        within(self.clip_percent, "clip_percent of the accelerometer", 0.0, 50.0, "%")
        not_negative(self.noise_mps2_per_sqrt_hz, "noise_mps2_per_sqrt_hz of the accelerometer")
        not_negative(self.wander_mps2_per_sqrt_s, "wander_mps2_per_sqrt_s of the accelerometer")
        for name in ("bias_mps2", "drift_mps2_per_s"):
            if not np.isfinite(getattr(self, name)):
                raise InputError(f"{name} of the accelerometer is {getattr(self, name)}", allowed="a finite number")

    @property
    def settling_s(self) -> float:
        """Time until a blow has rung down to 1e-4 in the mounted sensor; its coupling begins settled."""
        if self.resonance_hz is None:
            return 0.0
        return float(np.log(1e4) / (self.damping_ratio * 2 * np.pi * self.resonance_hz))

    def dynamics(self, acceleration_mps2: FloatArray, step_s: float) -> FloatArray:
        """Apply the resonance and the coupling, (n_steps,)."""
        x = acceleration_mps2
        if self.resonance_hz is not None:
            x = apply(low_pass(self.resonance_hz, self.damping_ratio, step_s), x)
        if self.lower_limit_hz > 0:
            # The coupling has long settled on the mean, not on a first value that may be the middle of a blow.
            x = apply(high_pass(self.lower_limit_hz, step_s), np.concatenate(([np.mean(x)], x)))[1:]
        return x

    def read(self, acceleration_mps2: FloatArray, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Reading over time on a fine even grid, (n_steps,); noise, then wander, are drawn from `rng`.

        The noise fills the band of the grid; the anti-alias filter that follows leaves its density in the band of the
        recording.
        """
        step_s = float(time_s[1] - time_s[0])
        reading = self.dynamics(acceleration_mps2, step_s) + self.bias_mps2 + self.drift_mps2_per_s * time_s
        if self.noise_mps2_per_sqrt_hz > 0:
            sigma = self.noise_mps2_per_sqrt_hz * np.sqrt(0.5 / step_s)
            reading += sigma * rng.standard_normal(len(time_s))
        if self.wander_mps2_per_sqrt_s > 0:
            walk = np.cumsum(rng.standard_normal(len(time_s)))
            # From 0 at the recording's start, so that bias_mps2 means what it says.
            start = walk[np.searchsorted(time_s, 0.0)] if time_s[-1] >= 0 else walk[-1]
            reading += self.wander_mps2_per_sqrt_s * np.sqrt(step_s) * (walk - start)
        limit = self._limit_mps2(reading[time_s >= 0.0] if time_s[-1] >= 0.0 else reading)
        return reading if limit is None else np.clip(reading, -limit, limit)

    def _limit_mps2(self, reading: FloatArray) -> float | None:
        """Where values are held; None for nowhere."""
        if self.clip_percent == 0.0:
            return self.range_mps2
        level = float(np.quantile(np.abs(reading), 1.0 - self.clip_percent / 100.0))
        return level if self.range_mps2 is None else min(level, self.range_mps2)


@dataclass(frozen=True)
class Converter:
    """An analogue-to-digital converter: 2^bits equal steps over ± its range.

    Parameters
    ----------
    range_mps2 : float
    n_bits : int
        8 to 32.
    """

    range_mps2: float
    n_bits: int = 24

    def __post_init__(self) -> None:
        positive(self.range_mps2, "range_mps2 of the converter", "m/s^2")
        within(self.n_bits, "n_bits of the converter", 8, 32)

    @property
    def step_mps2(self) -> float:
        """Value of one step."""
        return self.range_mps2 / 2.0 ** (self.n_bits - 1)

    def convert(self, values_mps2: FloatArray) -> FloatArray:
        """Round to steps and hold at the ends: -range … range - one step."""
        half = 2.0 ** (self.n_bits - 1)
        steps: FloatArray = np.clip(np.round(values_mps2 / self.step_mps2), -half, half - 1)
        return steps * self.step_mps2
