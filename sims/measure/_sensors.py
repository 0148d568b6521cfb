"""Sensors: accelerometers with path, noise and converter; tachometers and encoders."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from gearsig.checks import FloatArray, count, known_name, not_negative, positive, within
from gearsig.compiled import njit
from gearsig.errors import InputError

# Linear systems on a solver's grid, exact for an input that is linear between steps.

Section = tuple[tuple[float, float, float], tuple[float, float, float]]
"""b and a of a second-order filter."""

HIGHEST_FRACTION = 0.2
"""Maximum natural frequency as a fraction of the grid's rate: five steps per cycle."""


@lru_cache(maxsize=256)
def discrete(numerator: tuple[float, ...], denominator: tuple[float, ...], step_s: float) -> Section:
    """Ramp-invariant (first-order hold) equivalent of a transfer function in s, of second order at most.

    Poles, and the response to any input that is linear between steps, are exact. For a sine the gain is low by
    1 - sinc²(fΔ), about (πfΔ)²/3 or 0.02 % at 2 kHz and 4 µs; its phase is exact.

    Source: G. F. Franklin, J. D. Powell, M. L. Workman, *Digital Control of Dynamic Systems*, 3rd ed., 1998, ch. 6.

    Returns
    -------
    b, a : tuples of 3 floats
        Numerator and denominator in z⁻¹, a[0] = 1.
    """
    from scipy.signal import cont2discrete

    system = (np.array(numerator), np.array(denominator))
    b, a, _ = cont2discrete(system, step_s, method="foh")
    return _three(b), _three(a)


def low_pass(frequency_hz: float, damping_ratio: float, step_s: float) -> Section:
    """Discrete equivalent of ω²/(s² + 2ζωs + ω²); rejects a frequency that the grid does not resolve."""
    if frequency_hz * step_s > HIGHEST_FRACTION:
        n_steps = 1 / (frequency_hz * step_s)
        raise InputError(
            f"a natural frequency of {frequency_hz:g} Hz has {n_steps:.2g} steps of {step_s:g} s per cycle",
            allowed=f"at least {1 / HIGHEST_FRACTION:g} steps per cycle",
            remedy="leave it out, or give the motion at a finer step",
        )
    w = 2 * np.pi * frequency_hz
    return discrete((w * w,), (1.0, 2 * damping_ratio * w, w * w), step_s)


def apply_bank(sections: list[Section], gains: FloatArray, inputs: FloatArray, direct: FloatArray) -> FloatArray:
    """Sum of filtered inputs, each filter starting in the steady state for the first values.

    Parameters
    ----------
    sections : list
        One per row of `gains`.
    gains : array, (n_sections, n_inputs)
        Gain from each input to each filter.
    inputs : array, (n_steps, n_inputs)
    direct : array, (n_inputs,)
        Gain of each input past the filters.

    Returns
    -------
    array, (n_steps,)
    """
    x = np.ascontiguousarray(inputs, dtype=np.float64)
    out: FloatArray = x @ direct
    if sections:
        b = np.array([section[0] for section in sections])
        a = np.array([section[1][1:] for section in sections])
        filter_bank(x, np.asarray(gains, dtype=np.float64), b, a, out)
    return out


def apply(section: Section, signal: FloatArray) -> FloatArray:
    """Filter one signal, (n_steps,)."""
    return apply_bank([section], np.ones((1, 1)), signal[:, None], np.zeros(1))


def _three(values: FloatArray) -> tuple[float, float, float]:
    padded = [*np.ravel(values).tolist(), 0.0, 0.0][:3]
    return padded[0], padded[1], padded[2]


@dataclass(frozen=True)
class Accelerometer:
    """An accelerometer: value = clip(dynamics applied to the acceleration + noise + bias).

    The dynamics are ω²/(s² + 2ζωs + ω²) of the mounted sensor and s/(s + ω_c) of its AC coupling.

    Parameters
    ----------
    resonance_hz : float or None
        Of the mounted sensor; None: flat. The response is within 5 % up to about a fifth of it.
    damping_ratio : float
        Of that resonance.
    lower_limit_hz : float
        -3 dB frequency of the coupling; 0: measures down to a constant acceleration.
    range_mps2 : float or None
        Values are limited to ± this; None: no limit.
    clip_percent : float
        A range too small for the signal: values are limited to the level that the reading exceeds for this part of the
        recording, 0 to 50 %. The level follows from each signal; `range_mps2` is the same for all.
    noise_mps2_per_sqrt_hz : float
        One-sided density of white noise.
    bias_mps2 : float
        At the recording's start.
    drift_mps2_per_s : float
        Change of the bias with time, as from warming up.
    """

    resonance_hz: float | None = None
    damping_ratio: float = 0.02
    lower_limit_hz: float = 0.0
    range_mps2: float | None = None
    noise_mps2_per_sqrt_hz: float = 0.0
    bias_mps2: float = 0.0
    drift_mps2_per_s: float = 0.0
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
        for name in ("bias_mps2", "drift_mps2_per_s"):
            if not np.isfinite(getattr(self, name)):
                raise InputError(f"{name} of the accelerometer is {getattr(self, name)}", allowed="a finite number")

    @property
    def settling_s(self) -> float:
        """Time in which an impact decays to 1e-4 in the mounted sensor; its coupling starts settled."""
        if self.resonance_hz is None:
            return 0.0
        return float(np.log(1e4) / (self.damping_ratio * 2 * np.pi * self.resonance_hz))

    def dynamics(self, acceleration_mps2: FloatArray, step_s: float) -> FloatArray:
        """Apply the resonance and the coupling, (n_steps,)."""
        x = acceleration_mps2
        if self.resonance_hz is not None:
            x = apply(low_pass(self.resonance_hz, self.damping_ratio, step_s), x)
        if self.lower_limit_hz > 0:
            # The coupling has settled to the mean, not to a first value that may be the middle of an impact.
            coupling = discrete((1.0, 0.0), (1.0, 2 * np.pi * self.lower_limit_hz), step_s)
            x = apply(coupling, np.concatenate(([np.mean(x)], x)))[1:]
        return x

    def read(self, acceleration_mps2: FloatArray, time_s: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Reading over time on a fine even grid, (n_steps,); noise is drawn from `rng`.

        The noise fills the band of the grid; the anti-alias filter that follows keeps its density in the recording's
        band.
        """
        step_s = float(time_s[1] - time_s[0])
        reading = self.dynamics(acceleration_mps2, step_s) + self.bias_mps2 + self.drift_mps2_per_s * time_s
        if self.noise_mps2_per_sqrt_hz > 0:
            sigma = self.noise_mps2_per_sqrt_hz * np.sqrt(0.5 / step_s)
            reading += sigma * rng.standard_normal(len(time_s))
        limit = self._limit_mps2(reading[time_s >= 0.0] if time_s[-1] >= 0.0 else reading)
        return reading if limit is None else np.clip(reading, -limit, limit)

    def _limit_mps2(self, reading: FloatArray) -> float | None:
        """Level to which values are limited, None for no limit."""
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
        """Round to steps and limit to -range … range - one step."""
        half = 2.0 ** (self.n_bits - 1)
        steps: FloatArray = np.clip(np.round(values_mps2 / self.step_mps2), -half, half - 1)
        return steps * self.step_mps2


# Modal transfer path: from accelerations at bearings to the location of a sensor.


@dataclass(frozen=True)
class PathMode:
    """One mode of the housing as seen by a sensor.

    Parameters
    ----------
    frequency_hz : float
    damping_ratio : float
        ζ, 1e-4 to 1.
    gains : mapping
        Position → static gain g: well below its frequency the mode adds g times that position's acceleration; at its
        frequency, g/(2ζ) times, delayed by a quarter period.
    """

    frequency_hz: float
    damping_ratio: float
    gains: Mapping[str, float]

    def __post_init__(self) -> None:
        positive(self.frequency_hz, "frequency_hz of a path mode", "Hz")
        within(self.damping_ratio, "damping_ratio of a path mode", 1e-4, 1.0)
        object.__setattr__(self, "gains", _gains(self.gains))


@dataclass(frozen=True)
class ModalPath:
    """a(s) = Σ_p (d_p + Σ_m g_mp ω_m²/(s² + 2ζ_m ω_m s + ω_m²)) a_p(s), over positions p and modes m.

    Parameters
    ----------
    direct : mapping
        Position → d, gain of the unfiltered part. {"bearing 1": 1.0} alone is a sensor on that bearing.
    modes : tuple of PathMode
    """

    direct: Mapping[str, float] = field(default_factory=dict)
    modes: tuple[PathMode, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "direct", _gains(self.direct))
        object.__setattr__(self, "modes", tuple(self.modes))
        if not self.direct and not any(mode.gains for mode in self.modes):
            raise InputError("the path has no source", remedy='give direct={"position": 1.0} or a mode with gains')

    @property
    def settling_s(self) -> float:
        """Time in which the starting transient decays to 1e-4 in the slowest mode."""
        return max((np.log(1e4) / (m.damping_ratio * 2 * np.pi * m.frequency_hz) for m in self.modes), default=0.0)

    def apply(self, accelerations: FloatArray, positions: tuple[str, ...], step_s: float) -> FloatArray:
        """Acceleration at the sensor, (n_steps, n_positions) → (n_steps,).

        Exact for accelerations that are linear between steps; for a sine see `sims.measure.discrete`. Modes start
        settled to the mean: a first value may be the middle of an impact, from which a slow mode would ring for long.
        """
        settled = np.mean(accelerations, axis=0, keepdims=True)
        return apply_bank(
            [low_pass(mode.frequency_hz, mode.damping_ratio, step_s) for mode in self.modes],
            np.array([_weights(mode.gains, positions) for mode in self.modes]).reshape(-1, len(positions)),
            np.concatenate((settled, accelerations)),
            _weights(self.direct, positions),
        )[1:]

    def response(self, frequency_hz: FloatArray, position: str) -> FloatArray:
        """Analytic complex frequency response from a position."""
        f = np.asarray(frequency_hz, dtype=np.float64)
        total = np.full(f.shape, self.direct.get(position, 0.0), dtype=complex)
        for mode in self.modes:
            r = f / mode.frequency_hz
            total += mode.gains.get(position, 0.0) / (1 - r**2 + 2j * mode.damping_ratio * r)
        return total


def _weights(gains: Mapping[str, float], positions: tuple[str, ...]) -> FloatArray:
    for name in gains:
        known_name(name, positions, f"the path starts at {name!r}, which the simulation does not provide")
    return np.array([gains.get(name, 0.0) for name in positions])


def _gains(gains: Mapping[str, float]) -> dict[str, float]:
    for name, gain in gains.items():
        if not np.isfinite(gain):
            raise InputError(f"the gain from {name!r} is {gain}", allowed="a finite number")
    return dict(gains)


# Compiled bank of second-order filters, side by side.


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def filter_bank(inputs, gains, b, a, out):  # type: ignore[no-untyped-def]
    """out[t] += Σ_m H_m applied to Σ_p gains[m, p] inputs[t, p].

    Transposed direct form II, starting in the steady state for the first input. The filters of a bank are independent,
    so several run at the speed of one.

    `inputs` (n_steps, n_inputs), `gains` (n_filters, n_inputs), `b` (n_filters, 3), `a` (n_filters, 2) without the
    leading 1, `out` (n_steps,).
    """
    n_filters, n_inputs = gains.shape
    z1, z2 = np.zeros(n_filters), np.zeros(n_filters)
    for m in range(n_filters):
        x = 0.0
        for p in range(n_inputs):
            x += gains[m, p] * inputs[0, p]
        y = x * (b[m, 0] + b[m, 1] + b[m, 2]) / (1.0 + a[m, 0] + a[m, 1])
        z1[m] = y - b[m, 0] * x
        z2[m] = b[m, 2] * x - a[m, 1] * y
    for t in range(inputs.shape[0]):
        total = 0.0
        for m in range(n_filters):
            x = 0.0
            for p in range(n_inputs):
                x += gains[m, p] * inputs[t, p]
            y = b[m, 0] * x + z1[m]
            z1[m] = b[m, 1] * x - a[m, 0] * y + z2[m]
            z2[m] = b[m, 2] * x - a[m, 1] * y
            total += y
        out[t] += total


# Noise of a measurement chain: Gaussian, white or coloured.


@dataclass(frozen=True)
class ColouredNoise:
    """Gaussian noise with a power density proportional to 1/f^slope.

    Parameters
    ----------
    rms_mps2 : float
        Expected standard deviation over the whole band.
    slope : float
        0: white, 1: pink, 2: red. Below 10 Hz the density is constant.
    """

    rms_mps2: float = 0.0
    slope: float = 0.0

    def __post_init__(self) -> None:
        not_negative(self.rms_mps2, "rms_mps2 of the noise", "m/s^2")
        within(self.slope, "slope of the noise", -2.0, 3.0)

    def draw(self, n_samples: int, sampling_rate_hz: float, rng: np.random.Generator) -> FloatArray:
        """Return noise of `n_samples` samples, (n_samples,)."""
        from scipy import fft

        white: FloatArray = rng.standard_normal(n_samples)
        if self.slope == 0.0:
            return self.rms_mps2 * white
        frequency = fft.rfftfreq(n_samples, 1 / sampling_rate_hz)
        shape = np.maximum(frequency, 10.0) ** (-self.slope / 2)
        weight = np.full(len(shape), 2.0)
        weight[0] = 1.0
        if n_samples % 2 == 0:
            weight[-1] = 1.0
        # Scaled by the expected power of the filtered noise: rms_mps2 is a property of the model and is not imposed on
        # each realisation.
        scale = self.rms_mps2 / np.sqrt(np.sum(weight * shape**2) / n_samples)
        coloured: FloatArray = scale * fft.irfft(fft.rfft(white) * shape, n_samples)
        return coloured


# Mains hum: pick-up from the electric supply.


@dataclass(frozen=True)
class MainsHum:
    """Pick-up from the electric supply at a fixed frequency, independent of the shaft.

    Parameters
    ----------
    amplitudes_mps2 : tuple of float
        Peak amplitudes of harmonics 1, 2, … in the reading.
    frequency_hz : float
    phase_rad : float
    """

    amplitudes_mps2: tuple[float, ...] = ()
    frequency_hz: float = 50.0
    phase_rad: float = 0.0

    def __post_init__(self) -> None:
        positive(self.frequency_hz, "frequency_hz of the mains", "Hz")

    def values(self, time_s: FloatArray) -> FloatArray:
        """Σ_h A_h cos(h (2πft + φ)), (n_samples,)."""
        total = np.zeros(np.shape(time_s))
        for h, amplitude in enumerate(self.amplitudes_mps2, start=1):
            total += amplitude * np.cos(h * (2 * np.pi * self.frequency_hz * np.asarray(time_s) + self.phase_rad))
        return total


# --------------------
# A tachometer: voltage pulses at equal steps of a shaft's angle.
# --------------------


HIGH_V = 5.0
"""Height of a pulse above 0 V."""


@dataclass(frozen=True)
class Tachometer:
    """A pulse channel; the middle of each rising edge is at shaft angle (k + offset)/n, in revolutions.

    Parameters
    ----------
    shaft : str
        Empty: the reference shaft.
    pulses_per_revolution : int
    channel : str
    duty : float
        Pulse width over pulse period, in angle; 0.01 to 0.99.
    edge_s : float
        Duration of an edge, which is linear.
    jitter_s : float
        Standard deviation of each rising edge's time.
    first_pulse_rev : float
        Shaft angle of a rising edge, 0 to 1.
    noise_v : float
        Standard deviation of the voltage noise.
    """

    shaft: str = ""
    pulses_per_revolution: int = 1
    channel: str = "tacho"
    duty: float = 0.1
    edge_s: float = 2e-4
    jitter_s: float = 0.0
    first_pulse_rev: float = 0.0
    noise_v: float = 0.0

    def __post_init__(self) -> None:
        count(self.pulses_per_revolution, "pulses_per_revolution of the tachometer")
        within(self.duty, "duty of the tachometer", 0.01, 0.99)
        positive(self.edge_s, "edge_s of the tachometer", "s")
        not_negative(self.jitter_s, "jitter_s of the tachometer", "s")
        not_negative(self.noise_v, "noise_v of the tachometer", "V")
        within(self.first_pulse_rev, "first_pulse_rev of the tachometer", 0.0, 1.0, "rev")


def pulse_voltage(tacho: Tachometer, rising_s: FloatArray, falling_s: FloatArray, time_s: FloatArray) -> FloatArray:
    """Voltage at `time_s`: a trapezoid per pulse, at half height at its edge times."""
    up = np.zeros(np.shape(time_s))
    for edges, sign in ((rising_s, 1.0), (falling_s, -1.0)):
        if len(edges):
            if len(edges) > 1 and np.diff(np.sort(edges)).min() <= tacho.edge_s:
                raise InputError(
                    f"pulses follow each other faster than an edge takes, {tacho.edge_s:g} s",
                    where="tachometer",
                    remedy="lower edge_s or jitter_s",
                )
            knots = (np.sort(edges)[:, None] + np.array([-0.5, 0.5]) * tacho.edge_s).ravel()
            steps = (np.arange(len(edges))[:, None] + np.array([0.0, 1.0])).ravel()
            up += sign * np.interp(time_s, knots, steps)
    return HIGH_V * up


@dataclass(frozen=True)
class Encoder:
    """An angle channel in degrees, in whole counts from the zero mark.

    Parameters
    ----------
    channel : str
    shaft : str
        Empty: the reference shaft.
    counts_per_revolution : int
        The reading lags the angle by up to one count.
    wraps : bool
        Whether the reading restarts at each revolution.
    noise_deg : float
        Standard deviation of each reading's error before quantisation.
    """

    channel: str = "encoder"
    shaft: str = ""
    counts_per_revolution: int = 4096
    wraps: bool = True
    noise_deg: float = 0.0

    def __post_init__(self) -> None:
        count(self.counts_per_revolution, "counts_per_revolution of the encoder", minimum=4)
        not_negative(self.noise_deg, "noise_deg of the encoder", "deg")

    def read_deg(self, angle_rad: FloatArray, rng: np.random.Generator | None = None) -> FloatArray:
        """Reading in degrees at the given shaft angles; without `rng`, free of noise."""
        read_rev = angle_rad / (2 * np.pi)
        if rng is not None and self.noise_deg:
            read_rev = read_rev + self.noise_deg / 360.0 * rng.standard_normal(np.shape(angle_rad))
        counts = np.floor(read_rev * self.counts_per_revolution)
        if self.wraps:
            counts = np.mod(counts, self.counts_per_revolution)
        reading: FloatArray = counts * (360.0 / self.counts_per_revolution)
        return reading


# Times at which a simulated shaft passes the edges of a pulse disc.


def disc_edges(
    revolutions: FloatArray, time_s: FloatArray, pulses_per_revolution: int, duty: float, first_pulse_rev: float
) -> tuple[FloatArray, FloatArray, bool]:
    """Times at which the pulse rises and falls, and whether it is high at the start.

    A window opens at angles (k + offset) and closes `duty` of a pulse period later; in reverse rotation its end opens
    it. Times are interpolated between steps, with an error of at most (acceleration/speed)·Δ²/8.

    Parameters
    ----------
    revolutions, time_s : arrays, (n_steps,)
    pulses_per_revolution : int
    duty : float
    first_pulse_rev : float

    Raises
    ------
    InputError
        If the shaft turns by half the shorter part of a pulse period or more within a step.
    """
    periods = (revolutions - first_pulse_rev) * pulses_per_revolution
    if len(periods) > 1 and np.abs(np.diff(periods)).max() >= 0.5 * min(duty, 1 - duty):
        raise InputError(
            f"the shaft turns by {np.abs(np.diff(periods)).max():.2g} pulse periods within a step",
            where="tachometer",
            allowed=f"below {0.5 * min(duty, 1 - duty):g}: half the shorter part of a pulse",
            remedy="fewer pulses per revolution or a finer step",
        )
    opens, opens_back = _crossings(periods, time_s)
    closes, closes_back = _crossings(periods - duty, time_s)
    high = bool(periods[0] % 1.0 < duty)
    return np.sort(np.concatenate([opens, closes_back])), np.sort(np.concatenate([closes, opens_back])), high


def _crossings(periods: FloatArray, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times of passing integers, forwards and backwards."""
    whole = np.floor(periods)
    step = np.diff(whole)
    crossings = []
    for direction in (1.0, -1.0):
        i = np.flatnonzero(step == direction)
        target = whole[i + 1] if direction > 0 else whole[i]
        part = (target - periods[i]) / (periods[i + 1] - periods[i])
        crossings.append(time_s[i] + part * (time_s[i + 1] - time_s[i]))
    return crossings[0], crossings[1]
