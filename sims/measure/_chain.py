"""From simulated motion to a recording as a measurement would give it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from fractions import Fraction
from math import ceil, floor
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, frozen_array, known_name, not_negative, positive, within
from gearsig.errors import InputError
from gearsig.recording import Channel, Provenance, Recording
from gearsig.rig import EncoderChannel, Rig, SpeedSource, TachometerChannel
from sims.measure._sensors import (
    Accelerometer,
    ColouredNoise,
    Converter,
    Encoder,
    MainsHum,
    ModalPath,
    Tachometer,
    disc_edges,
    pulse_voltage,
)

# A simulator's input to the measurement chain.


@dataclass(frozen=True)
class Motion:
    """Accelerations at positions and angles of shafts on an even time grid starting at 0.

    Parameters
    ----------
    step_s : float
        At least five steps per cycle of the fastest mode of path and sensor. Content of the simulation above half of
        1/step would alias: keep every step of the solver, or one in few.
    positions : tuple of str
        Names of the positions, each with its direction: "pinion bearing y".
    accelerations_mps2 : array, (n_steps, n_positions)
    shaft_angles_rad : mapping
        Shaft → (n_steps,), continuous over revolutions; positive in the shaft's own direction.
    """

    step_s: float
    positions: tuple[str, ...]
    accelerations_mps2: FloatArray
    shaft_angles_rad: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        positive(self.step_s, "step_s of the motion", "s")
        a = frozen_array(self.accelerations_mps2, "accelerations_mps2 (time, position)", ndim=2)
        object.__setattr__(self, "positions", tuple(self.positions))
        if a.shape[1] != len(self.positions) or len(set(self.positions)) != len(self.positions):
            raise InputError(
                f"{len(self.positions)} positions for {a.shape[1]} columns of accelerations_mps2",
                allowed="one name per column, none twice",
            )
        if a.shape[0] < 2:
            raise InputError(f"the motion has {a.shape[0]} steps", allowed="at least 2")
        angles = {name: frozen_array(v, f"angle of {name!r}", ndim=1) for name, v in self.shaft_angles_rad.items()}
        for name, values in angles.items():
            if len(values) != a.shape[0]:
                raise InputError(f"{len(values)} angles of {name!r} for {a.shape[0]} steps", where="motion")
        object.__setattr__(self, "accelerations_mps2", a)
        object.__setattr__(self, "shaft_angles_rad", angles)

    @property
    def n_steps(self) -> int:
        """Number of time steps."""
        return int(self.accelerations_mps2.shape[0])

    def angle_rad(self, shaft: str, user: str) -> FloatArray:
        """Angle of the shaft that a sensor (`user`) is fitted to, (n_steps,)."""
        complaint = f"the {user} is on shaft {shaft!r}, whose angle the simulation does not provide"
        return self.shaft_angles_rad[known_name(shaft, self.shaft_angles_rad, complaint)]

    def time_s(self, start_s: float = 0.0) -> FloatArray:
        """Time of each step, counted from `start_s`, (n_steps,)."""
        return np.arange(self.n_steps) * self.step_s - start_s


# A model's parameters as plain values, for `Recording.truth`.


def plain(part: Any) -> Any:
    """Convert dataclasses to dictionaries with the class name under "kind", tuples to lists; the rest is unchanged."""
    if is_dataclass(part) and not isinstance(part, type):
        return {"kind": type(part).__name__} | {f.name: plain(getattr(part, f.name)) for f in fields(part)}
    if isinstance(part, Mapping):
        return {key: plain(value) for key, value in part.items()}
    if isinstance(part, (tuple, list)):
        return [plain(item) for item in part]
    return part


# Anti-alias filter and sampling: from the solver's grid to the recording's rate.

_LARGEST_TERM = 4096  # of the ratio of rates; beyond it, the filter's table is larger than the signal


@dataclass(frozen=True)
class AntiAlias:
    """Linear-phase low-pass with its delay removed, as in converters with digital decimation.

    A sine below `passband_fraction` of the sampling rate keeps its amplitude within 10^(-A/20) and its phase; one
    above half the sampling rate is attenuated by at least A.

    Parameters
    ----------
    attenuation_db : float
        A, 40 to 140.
    passband_fraction : float
        Pass-band edge over sampling rate, 0.2 to 0.48. The closer to 0.5, the longer the filter: see `reach_s`.
    """

    attenuation_db: float = 90.0
    passband_fraction: float = 0.4

    def __post_init__(self) -> None:
        within(self.attenuation_db, "attenuation_db of the anti-alias filter", 40.0, 140.0, "dB")
        within(self.passband_fraction, "passband_fraction of the anti-alias filter", 0.2, 0.48)

    def reach_s(self, sampling_rate_hz: float) -> float:
        """Time on each side of a sample that affects it: half the filter's length, by Kaiser's formula."""
        width_rad = 2 * np.pi * (0.5 - self.passband_fraction)
        return float((self.attenuation_db - 7.95) / (2 * 2.285 * width_rad) / sampling_rate_hz)

    def sample(
        self, signals: FloatArray, step_s: float, sampling_rate_hz: float, first: int, n_samples: int
    ) -> FloatArray:
        """Filter and sample, (n, n_steps) → (n, n_samples), at times (first + j)/rate on the solver's time axis.

        Raises
        ------
        InputError
            If a sample would need signal beyond the ends, if the sampling rate is above the solver's, or if the ratio
            of the two is not one of integers up to 4096.
        """
        from scipy.signal import firwin, kaiser_beta, resample_poly

        up, down = ratio_of_rates(step_s, sampling_rate_hz)
        half = ceil(self.reach_s(sampling_rate_hz) / step_s * up)
        low, high = covered(signals.shape[1], step_s, sampling_rate_hz, half / up * step_s)
        if first < low or first + n_samples - 1 > high:
            raise InputError(
                f"samples {first} to {first + n_samples - 1} reach beyond the simulated time",
                where="anti-alias filter",
                allowed=f"{low} to {high}",
                remedy="simulate longer",
            )
        taps = firwin(
            2 * half + 1,
            0.5 * (self.passband_fraction + 0.5) * sampling_rate_hz,
            window=("kaiser", kaiser_beta(self.attenuation_db)),
            fs=up / step_s,
        )
        # Only the segment needed for these samples; it starts at a common point of both grids.
        start = max(0, floor((first * down / up - half / up) / down) * down)
        stop = min(signals.shape[1], ceil((first + n_samples) * down / up + half / up) + 1)
        skipped = start // down * up
        segment = signals[:, start:stop]
        # The type stubs list only named windows; an array of coefficients is documented.
        sampled: FloatArray = resample_poly(segment, up, down, axis=1, window=taps)  # type: ignore[call-overload]
        return sampled[:, first - skipped : first - skipped + n_samples]


def ratio_of_rates(step_s: float, sampling_rate_hz: float) -> tuple[int, int]:
    """(up, down) with sampling rate · step = up/down in lowest terms."""
    positive(step_s, "step_s", "s")
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    product = sampling_rate_hz * step_s
    if product > 1.0:
        raise InputError(
            f"sampling_rate_hz is {sampling_rate_hz:g} Hz", allowed=f"at most the solver's rate, {1 / step_s:g} Hz"
        )
    ratio = Fraction(product).limit_denominator(_LARGEST_TERM)
    if abs(float(ratio) / product - 1.0) > 1e-12:
        raise InputError(
            f"a step of {step_s!r} s does not fit a sampling rate of {sampling_rate_hz:g} Hz",
            allowed=f"rates in the ratio of whole numbers up to {_LARGEST_TERM}",
            remedy=f"take {1 / (sampling_rate_hz * ceil(1 / product))!r} s",
        )
    return ratio.numerator, ratio.denominator


def covered(n_steps: int, step_s: float, sampling_rate_hz: float, reach_s: float) -> tuple[int, int]:
    """First and last sample, counted from the solver's start, whose filter is within the signals."""
    tiny = 1e-9  # of a sample, against rounding of integer ratios
    first = ceil(reach_s * sampling_rate_hz - tiny)
    last = floor(((n_steps - 1) * step_s - reach_s) * sampling_rate_hz + tiny)
    return first, last


@dataclass(frozen=True)
class MeasuredChannel:
    """One acceleration channel: path → accelerometer → anti-alias filter → + hum + background noise → converter.

    Parameters
    ----------
    name : str
    path : ModalPath
    accelerometer : Accelerometer
    hum : MainsHum
    background : ColouredNoise
        Ambient vibration in the recording's band.
    converter : Converter or None
    position : str
        For the reader of the recording, e.g. "pinion bearing, vertical".
    """

    name: str
    path: ModalPath
    accelerometer: Accelerometer = field(default_factory=Accelerometer)
    hum: MainsHum = field(default_factory=MainsHum)
    background: ColouredNoise = field(default_factory=ColouredNoise)
    converter: Converter | None = None
    position: str = ""


@dataclass(frozen=True)
class MeasurementChain:
    """Sensors, filter, converter and angle channels of one measurement.

    Parameters
    ----------
    sampling_rate_hz : float
    channels : tuple of MeasuredChannel
    anti_alias : AntiAlias
    tachometer : Tachometer or None
    encoders : tuple of Encoder
        The first is the speed source if there is no tachometer.

    Examples
    --------
    >>> chain = MeasurementChain(1000.0, (MeasuredChannel("a1", ModalPath({"bearing": 1.0})),))
    >>> motion = Motion(1e-4, ("bearing",), np.zeros((5000, 1)))
    >>> recording = chain.record(motion, rng=np.random.default_rng(1), duration_s=0.4)
    >>> recording.channel_names, recording.n_samples
    (('a1',), 400)
    """

    sampling_rate_hz: float
    channels: tuple[MeasuredChannel, ...]
    anti_alias: AntiAlias = field(default_factory=AntiAlias)
    tachometer: Tachometer | None = None
    encoders: tuple[Encoder, ...] = ()

    def __post_init__(self) -> None:
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "encoders", tuple(self.encoders))
        if not self.channels:
            raise InputError("the measurement chain has no channel", remedy="give at least one MeasuredChannel")

    @property
    def lead_in_s(self) -> float:
        """Simulated time before the recording, in which transients of filters and modes decay to 1e-4."""
        settling = max(channel.path.settling_s + channel.accelerometer.settling_s for channel in self.channels)
        return settling + self.anti_alias.reach_s(self.sampling_rate_hz)

    def simulated_s(self, duration_s: float, lead_in_s: float | None = None) -> float:
        """Minimum duration of a simulation for a recording of `duration_s`."""
        lead = max(self.lead_in_s, lead_in_s or 0.0)
        return lead + duration_s + self.anti_alias.reach_s(self.sampling_rate_hz) + 2 / self.sampling_rate_hz

    def record(
        self,
        motion: Motion,
        *,
        rng: np.random.Generator,
        rig: Rig | None = None,
        duration_s: float | None = None,
        lead_in_s: float | None = None,
        truth: Mapping[str, Any] | None = None,
        source: str = "simulation",
        reader: str = "sims.measure",
    ) -> Recording:
        """Measure a simulated motion.

        Parameters
        ----------
        motion : Motion
        rng : numpy.random.Generator
            Sensors, background, tachometer and encoders each get their own stream: the background does not depend on
            the motion's rate.
        rig : Rig or None
            Stored in the recording; its reference shaft is the default for angle sensors.
        duration_s : float or None
            None: as long as the motion allows.
        lead_in_s : float or None
            Motion discarded before the recording; None: `self.lead_in_s`. Give more if the machine itself needs time
            to settle, 0 to keep the start of a run from rest.
        truth : mapping or None
            The simulator's inputs; "measurement" is added to it.
        source, reader : str
            For the provenance.

        Returns
        -------
        Recording
            Accelerations in m/s², tachometer in V, encoders in deg. Time 0 is the end of the lead-in.

        Raises
        ------
        InputError
            If the motion is too short, or lacks a position or shaft that a sensor needs.
        """
        lead = self.lead_in_s if lead_in_s is None else not_negative(lead_in_s, "lead_in_s", "s")
        first, n_samples = self._span(motion, lead, duration_s)
        start_s = first / self.sampling_rate_hz
        time_s = np.arange(n_samples) / self.sampling_rate_hz
        sensor_rng, background_rng, tacho_rng, encoder_rng = rng.spawn(4)
        rows = list(self._vibration(motion, first, time_s, sensor_rng, background_rng))
        channels = [Channel(c.name, "acceleration", "m/s^2", c.position) for c in self.channels]
        speed = self._speed(motion, rig, start_s, time_s, (tacho_rng, encoder_rng), rows, channels)
        return Recording(
            np.vstack(rows),
            self.sampling_rate_hz,
            tuple(channels),
            speed=speed,
            rig=rig,
            provenance=Provenance(source=source, reader=reader),
            truth={**(truth or {}), "measurement": self._truth(motion, start_s, n_samples)},
        )

    def _span(self, motion: Motion, lead_s: float, duration_s: float | None) -> tuple[int, int]:
        rate = self.sampling_rate_hz
        low, high = covered(motion.n_steps, motion.step_s, rate, self.anti_alias.reach_s(rate) + motion.step_s)
        first = max(low, ceil(lead_s * rate - 1e-9))
        n_max = high - first + 1
        n_samples = n_max if duration_s is None else round(positive(duration_s, "duration_s", "s") * rate)
        if n_samples < 1 or n_samples > n_max:
            lasts_s = motion.n_steps * motion.step_s
            raise InputError(
                f"the motion lasts {lasts_s:g} s, of which {max(n_max, 0) / rate:g} s can be recorded",
                where="duration_s",
                allowed="at least one sample and no more than that",
                remedy="simulate longer: MeasurementChain.simulated_s gives the duration",
            )
        return first, n_samples

    def _vibration(
        self,
        motion: Motion,
        first: int,
        time_s: FloatArray,
        sensor_rng: np.random.Generator,
        background_rng: np.random.Generator,
    ) -> tuple[FloatArray, ...]:
        fine_s = motion.time_s(first / self.sampling_rate_hz)
        readings = []
        for channel in self.channels:
            at_sensor = channel.path.apply(motion.accelerations_mps2, motion.positions, motion.step_s)
            readings.append(channel.accelerometer.read(at_sensor, fine_s, sensor_rng))
        sampled = self.anti_alias.sample(np.vstack(readings), motion.step_s, self.sampling_rate_hz, first, len(time_s))
        rows = []
        for channel, values in zip(self.channels, sampled, strict=True):
            noise = channel.background.draw(len(time_s), self.sampling_rate_hz, background_rng)
            total = values + channel.hum.values(time_s) + noise
            rows.append(total if channel.converter is None else channel.converter.convert(total))
        return tuple(rows)

    def _speed(
        self,
        motion: Motion,
        rig: Rig | None,
        start_s: float,
        time_s: FloatArray,
        rngs: tuple[np.random.Generator, np.random.Generator],
        rows: list[FloatArray],
        channels: list[Channel],
    ) -> SpeedSource | None:
        """Append the angle channels to `rows` and `channels`; return the speed source."""
        rng, encoder_rng = rngs
        fine_s = motion.time_s(start_s)
        speed: SpeedSource | None = None
        tacho = self.tachometer
        if tacho is not None:
            shaft = tacho.shaft or _default_shaft(motion, rig)
            revolutions = motion.angle_rad(shaft, "tachometer") / (2 * np.pi)
            edges = disc_edges(revolutions, fine_s, tacho.pulses_per_revolution, tacho.duty, tacho.first_pulse_rev)
            rows.append(_voltage(tacho, edges, time_s, rng))
            channels.append(Channel(tacho.channel, "tachometer", "V", shaft))
            speed = TachometerChannel(tacho.channel, tacho.pulses_per_revolution, shaft=shaft)
        for encoder in self.encoders:
            shaft = encoder.shaft or _default_shaft(motion, rig)
            angle = np.interp(time_s, fine_s, motion.angle_rad(shaft, "encoder"))
            rows.append(encoder.read_deg(angle, encoder_rng))
            channels.append(Channel(encoder.channel, "encoder", "deg", shaft))
            speed = speed or EncoderChannel(encoder.channel, 360.0, wraps=encoder.wraps, shaft=shaft)
        return speed

    def _truth(self, motion: Motion, start_s: float, n_samples: int) -> dict[str, Any]:
        ends_s = start_s + np.array([0.0, n_samples / self.sampling_rate_hz])
        turned = {
            name: float(np.diff(np.interp(ends_s, motion.time_s(), angle))[0] / (2 * np.pi))
            for name, angle in motion.shaft_angles_rad.items()
        }
        return {
            "chain": plain(self),
            "step_s": motion.step_s,
            "lead_in_s": start_s,
            "n_revolutions": turned,
        }


def _voltage(
    tacho: Tachometer, edges: tuple[FloatArray, FloatArray, bool], time_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    rising, falling, high = edges
    rising = rising + tacho.jitter_s * rng.standard_normal(len(rising))
    if high:  # the motion starts within a pulse, which rose before it
        before = min(float(falling[0]) if len(falling) else 0.0, 0.0) - 1.0
        rising = np.append(before, rising)
    return pulse_voltage(tacho, rising, falling, time_s) + tacho.noise_v * rng.standard_normal(len(time_s))


def _default_shaft(motion: Motion, rig: Rig | None) -> str:
    if rig is not None and rig.reference_shaft:
        return rig.reference_shaft
    return next(iter(motion.shaft_angles_rad), "")
