"""From simulated motion to a recording, as a measurement would have made it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, not_negative, positive
from gearsig.errors import InputError
from gearsig.recording.types import Channel, Provenance, Recording
from gearsig.rig.speed import EncoderChannel, PulseTimes, SpeedSource, TachometerChannel
from gearsig.rig.types import Rig
from sims.measure.accelerometer import Accelerometer, Converter
from sims.measure.counter import Encoder, PulseCounter
from sims.measure.edges import disc_edges
from sims.measure.hum import MainsHum
from sims.measure.motion import Motion
from sims.measure.noise import ColouredNoise
from sims.measure.path import ModalPath
from sims.measure.sampling import AntiAlias, covered
from sims.measure.tachometer import Tachometer, pulse_voltage
from sims.measure.truth import plain


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
        Vibration of the surroundings in the recording's band.
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
    tachometer : Tachometer, PulseCounter or None
        A voltage channel, or time stamps without a channel.
    encoders : tuple of Encoder
        The first is the speed source where there is no tachometer.

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
    tachometer: Tachometer | PulseCounter | None = None
    encoders: tuple[Encoder, ...] = ()

    def __post_init__(self) -> None:
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "encoders", tuple(self.encoders))
        if not self.channels:
            raise InputError("the measurement chain has no channel", remedy="give at least one MeasuredChannel")

    @property
    def lead_in_s(self) -> float:
        """Simulated time ahead of the recording: filters and modes have forgotten the start to 1e-4."""
        settling = max(channel.path.settling_s + channel.accelerometer.settling_s for channel in self.channels)
        return settling + self.anti_alias.reach_s(self.sampling_rate_hz)

    def simulated_s(self, duration_s: float, lead_in_s: float | None = None) -> float:
        """Time that a simulation must last for a recording of `duration_s`."""
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
            Gives sensors, background and tachometer a stream each: the background is the same at another motion rate.
        rig : Rig or None
            Goes with the recording; its reference shaft is that of angle sensors without a shaft of their own.
        duration_s : float or None
            None: as long as the motion covers.
        lead_in_s : float or None
            Motion ahead of the recording that is left out; None: `self.lead_in_s`. Give more where the machine itself
            needs time to settle, 0 to keep the start of a run from rest.
        truth : mapping or None
            What the simulator put in; "measurement" is added to it.
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
        sensor_rng, background_rng, tacho_rng = rng.spawn(3)
        rows = list(self._vibration(motion, first, time_s, sensor_rng, background_rng))
        channels = [Channel(c.name, "acceleration", "m/s^2", c.position) for c in self.channels]
        speed = self._speed(motion, rig, start_s, time_s, tacho_rng, rows, channels)
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
        most = high - first + 1
        wanted = most if duration_s is None else round(positive(duration_s, "duration_s", "s") * rate)
        if wanted < 1 or wanted > most:
            lasts_s = motion.n_steps * motion.step_s
            raise InputError(
                f"the motion lasts {lasts_s:g} s, of which {max(most, 0) / rate:g} s can be recorded",
                where="duration_s",
                allowed="at least one sample and no more than that",
                remedy="simulate longer: MeasurementChain.simulated_s tells how long",
            )
        return first, wanted

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
        rng: np.random.Generator,
        rows: list[FloatArray],
        channels: list[Channel],
    ) -> SpeedSource | None:
        """Append the angle channels to `rows` and `channels`; return the speed source."""
        fine_s = motion.time_s(start_s)
        speed: SpeedSource | None = None
        tacho = self.tachometer
        if tacho is not None:
            shaft = tacho.shaft or _default_shaft(motion, rig)
            revolutions = motion.angle_rad(shaft, "tachometer") / (2 * np.pi)
            duty = tacho.duty if isinstance(tacho, Tachometer) else 0.5
            edges = disc_edges(revolutions, fine_s, tacho.pulses_per_revolution, duty, tacho.first_pulse_rev)
            if isinstance(tacho, Tachometer):
                rows.append(_voltage(tacho, edges, time_s, rng))
                channels.append(Channel(tacho.channel, "tachometer", "V", shaft))
                speed = TachometerChannel(tacho.channel, tacho.pulses_per_revolution, shaft=shaft)
            else:
                stamps = tacho.stamp(edges[0], rng)
                inside = stamps[(stamps >= 0) & (stamps <= time_s[-1])]
                speed = PulseTimes(inside, tacho.pulses_per_revolution, shaft=shaft)
        for encoder in self.encoders:
            shaft = encoder.shaft or _default_shaft(motion, rig)
            angle = np.interp(time_s, fine_s, motion.angle_rad(shaft, "encoder"))
            rows.append(encoder.read_deg(angle))
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
    if high:  # the pulse that the motion starts in rose before it
        before = min(float(falling[0]) if len(falling) else 0.0, 0.0) - 1.0
        rising = np.append(before, rising)
    return pulse_voltage(tacho, rising, falling, time_s) + tacho.noise_v * rng.standard_normal(len(time_s))


def _default_shaft(motion: Motion, rig: Rig | None) -> str:
    if rig is not None and rig.reference_shaft:
        return rig.reference_shaft
    return next(iter(motion.shaft_angles_rad), "")
