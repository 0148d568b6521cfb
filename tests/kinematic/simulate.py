"""From a kinematic model to a recording."""

from __future__ import annotations

from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording import Channel, Provenance, Recording
from gearsig.rig import Rig, TachometerChannel
from sims.measure import Tachometer, plain, pulse_voltage
from tests.kinematic.model import (
    BearingFault,
    KinematicModel,
    MeshHarmonics,
    between_teeth,
    engagement_window,
    harmonic_sum,
    impacts,
    knock_angles,
    load_zone_weight,
    modulation_terms,
    passages,
    ratio_of,
    shaft_vibration,
    tooth_values,
)
from tests.kinematic.speed import SpeedProfile, time_at_revolutions

# --------------------
# Trains of decaying oscillations: what a structure answers to short impacts.
# --------------------


_LOWEST_RELATIVE_LEVEL = 1e-7  # where a decayed oscillation is cut off


def ring_down(
    n_samples: int,
    start_s: float,
    sampling_rate_hz: float,
    times_s: FloatArray,
    amplitudes: FloatArray,
    resonance_hz: float,
    damping_ratio: float,
) -> FloatArray:
    """Σ_k A_k exp(-ζ ω (t - t_k)) sin(ω_d (t - t_k)) for t ≥ t_k, evaluated exactly at the sampling instants.

    ω = 2π `resonance_hz`, ω_d = ω √(1 - ζ²): the impulse response of one mode, its envelope starting at A_k.

    Parameters
    ----------
    n_samples, start_s, sampling_rate_hz
        The sampling instants: start_s + i/sampling_rate_hz.
    times_s, amplitudes : arrays, (n_impulses,)
    resonance_hz : float
        ω/2π.
    damping_ratio : float
        ζ, between 0 and 1.

    Returns
    -------
    array, (n_samples,)
    """
    omega = 2 * np.pi * resonance_hz
    decay, omega_d = damping_ratio * omega, omega * np.sqrt(1 - damping_ratio**2)
    n_ring = min(n_samples, int(np.ceil(-np.log(_LOWEST_RELATIVE_LEVEL) / decay * sampling_rate_hz)) + 1)
    total = np.zeros(n_samples + n_ring)
    steps = np.arange(n_ring) / sampling_rate_hz
    for t_k, a_k in zip(times_s, amplitudes, strict=True):
        first = int(np.ceil((t_k - start_s) * sampling_rate_hz))
        if 0 <= first < n_samples:
            since = steps + (start_s + first / sampling_rate_hz - t_k)
            total[first : first + n_ring] += a_k * np.exp(-decay * since) * np.sin(omega_d * since)
    return total[:n_samples]


# --------------------
# When a tachometer's edges come on a speed profile whose angle is known in closed form.
# --------------------


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


_LEAD_IN_S = 0.25  # simulated ahead of the recording, so that the path's filters and ring-downs are settled at time 0


def simulate_kinematic(
    rig: Rig, model: KinematicModel, *, sampling_rate_hz: float, duration_s: float, rng: np.random.Generator
) -> Recording:
    """Evaluate a kinematic model at the sampling instants.

    Parameters
    ----------
    rig : Rig
        Teeth, ratios and bearing orders come from here.
    model : KinematicModel
    sampling_rate_hz, duration_s : float
    rng : numpy.random.Generator
        Tooth-to-tooth variation, impact strengths, slip, noise and tachometer jitter are drawn from it, in this order.

    Returns
    -------
    Recording
        Acceleration channels in m/s², then the tachometer in V. `truth` holds the model's parameters and what was
        drawn, with units in the names.

    Raises
    ------
    RefusalError
        Where the rig does not tell a shaft's speed.
    """
    run = _KinematicRun(rig, model, sampling_rate_hz, round(duration_s * sampling_rate_hz), rng)
    machine = run.machine()
    rows = [run.channel_values(machine, number) for number in range(len(model.channels))]
    channels = [Channel(c.name, "acceleration", "m/s^2", c.position) for c in model.channels]
    speed = None
    if model.tachometer is not None:
        tacho = model.tachometer
        rows.append(run.tachometer_values(tacho))
        shaft = tacho.shaft or rig.reference_shaft
        channels.append(Channel(tacho.channel, "tachometer", "V", shaft))
        speed = TachometerChannel(tacho.channel, tacho.pulses_per_revolution, shaft=shaft)
    return Recording(
        np.vstack(rows),
        sampling_rate_hz,
        tuple(channels),
        speed=speed,
        rig=rig,
        provenance=Provenance(source="kinematic model", reader="tests.kinematic"),
        truth=run.truth(),
    )


class _KinematicRun:
    """One evaluation: the time axis, the angle, and what was drawn on the way."""

    def __init__(
        self, rig: Rig, model: KinematicModel, sampling_rate_hz: float, n_samples: int, rng: np.random.Generator
    ) -> None:
        self.rig, self.model, self.rng, self.rate = rig, model, rng, sampling_rate_hz
        self.n_lead = round(_LEAD_IN_S * sampling_rate_hz)
        self.n_samples = n_samples
        self.time_s: FloatArray = (np.arange(self.n_lead + n_samples) - self.n_lead) / sampling_rate_hz
        self.reference_rev = model.speed.revolutions(self.time_s)
        self.drawn: dict[str, Any] = {}

    def revolutions(self, shaft: str) -> FloatArray:
        return ratio_of(self.rig, shaft) * self.reference_rev

    def teeth(self, pair: str, shaft: str) -> int:
        return self.rig.pair(pair).teeth(shaft) or 0

    def mesh_order(self, pair: str) -> float:
        return self.rig.mesh_order(self.rig.pair(pair)) or 0.0

    def machine(self) -> FloatArray:
        """Vibration before the paths, with the lead-in."""
        total = np.zeros(len(self.time_s))
        for mesh in self.model.meshes:
            total += self.mesh(mesh)
        for damage in self.model.tooth_damages:
            ratio = ratio_of(self.rig, damage.shaft)
            shaft_rev = self.reference_rev * ratio
            angles = passages(damage.angle_rev, shaft_rev[0], shaft_rev[-1])
            strengths = impacts(len(angles), damage.impulse_mps2, damage.impulse_spread, self.rng)
            total += self.ring(angles / ratio, strengths, damage.resonance_hz, damage.damping_ratio)
        for fault in self.model.bearing_faults:
            total += self.bearing(fault)
        for part in self.model.shaft_orders:
            speed = self.model.shaft_speed_rpm(self.rig, part.shaft, self.time_s)
            total += shaft_vibration(part, self.revolutions(part.shaft), speed)
        return total

    def mesh(self, mesh: MeshHarmonics) -> FloatArray:
        factor, phase = np.ones(len(self.time_s)), np.zeros(len(self.time_s))
        for modulation in self.model.modulations:
            if modulation.pair == mesh.pair:
                a, b = modulation_terms(modulation, self.revolutions(modulation.shaft))
                factor, phase = factor + a, phase + b
        for variation in self.model.tooth_variations:
            if variation.pair == mesh.pair:
                teeth = self.teeth(mesh.pair, variation.shaft)
                amplitudes = tooth_values(teeth, variation.amplitude_fraction_rms, self.rng)
                phases = tooth_values(teeth, variation.phase_rms_rad, self.rng)
                shaft_rev = self.revolutions(variation.shaft)
                factor, phase = factor + between_teeth(amplitudes, shaft_rev), phase + between_teeth(phases, shaft_rev)
                gear = f"{mesh.pair}/{variation.shaft}"
                self.drawn[f"{gear}: tooth amplitude fractions"] = amplitudes.tolist()
                self.drawn[f"{gear}: tooth phases_rad"] = phases.tolist()
        for damage in self.model.tooth_damages:
            if damage.pair == mesh.pair:
                teeth = self.teeth(mesh.pair, damage.shaft)
                window = engagement_window(
                    self.revolutions(damage.shaft), damage.angle_rev, min(damage.width_teeth / teeth, 1.0)
                )
                factor = factor - damage.mesh_dip_fraction * window
        return harmonic_sum(mesh, self.mesh_order(mesh.pair) * self.reference_rev, factor, phase)

    def bearing(self, fault: BearingFault) -> FloatArray:
        bearing = next(b for b in self.rig.bearings if b.name == fault.bearing)
        orders = bearing.orders()
        ratio = ratio_of(self.rig, bearing.shaft)
        shaft_rev = self.reference_rev * ratio
        angles = knock_angles(orders[fault.order_name], fault.slip_fraction, shaft_rev[0], shaft_rev[-1], self.rng)
        strengths = impacts(len(angles), fault.impulse_mps2, fault.impulse_spread, self.rng)
        strengths = strengths * load_zone_weight(fault.race, angles)
        self.drawn[f"{fault.bearing}: {fault.order_name} order"] = orders[fault.order_name]
        if len(angles) > 1:
            mean_order = float((len(angles) - 1) / (angles[-1] - angles[0]))
            self.drawn[f"{fault.bearing}: {fault.order_name} order with slip"] = mean_order
        return self.ring(angles / ratio, strengths, fault.resonance_hz, fault.damping_ratio)

    def ring(self, reference_rev: FloatArray, strengths: FloatArray, resonance_hz: float, damping: float) -> FloatArray:
        start, end = float(self.time_s[0]), float(self.time_s[-1])
        times = time_at_revolutions(self.model.speed, reference_rev, start, end)
        return ring_down(len(self.time_s), start, self.rate, times, strengths, resonance_hz, damping)

    def channel_values(self, machine: FloatArray, number: int) -> FloatArray:
        channel = self.model.channels[number]
        seen = channel.path.apply(machine, self.rate)[self.n_lead :]
        noise = channel.noise.draw(self.n_samples, self.rate, self.rng)
        return seen + channel.hum.values(self.time_s[self.n_lead :]) + noise

    def tachometer_values(self, tacho: Tachometer) -> FloatArray:
        ratio = ratio_of(self.rig, tacho.shaft)
        rising_s, falling_s = edge_times(tacho, self.model.speed, ratio, float(self.time_s[-1]), self.rng)
        self.drawn["tachometer: rising edges_s"] = rising_s.tolist()
        voltage = pulse_voltage(tacho, rising_s, falling_s, self.time_s[self.n_lead :])
        return voltage + tacho.noise_v * self.rng.standard_normal(self.n_samples)

    def truth(self) -> dict[str, Any]:
        rig, model = self.rig, self.model
        ends = np.array([0.0, self.n_samples / self.rate])
        return {
            "simulator": "kinematic",
            "sampling_rate_hz": self.rate,
            "duration_s": self.n_samples / self.rate,
            "reference_shaft": rig.reference_shaft,
            "model": plain(model),
            "shafts": {
                name: {
                    "speed_rpm_at_start_and_end": model.shaft_speed_rpm(rig, name, ends).tolist(),
                    "n_revolutions": float(model.shaft_revolutions(rig, name, ends)[1]),
                }
                for name in rig.shaft_names
                if rig.ratio(name) is not None
            },
            "mesh_orders": {m.pair: self.mesh_order(m.pair) for m in model.meshes},
            "damaged_teeth": [
                {
                    "pair": d.pair,
                    "shaft": d.shaft,
                    "angle_deg": 360 * d.angle_rev,
                    "tooth": int(d.angle_rev % 1.0 * self.teeth(d.pair, d.shaft)) + 1,
                }
                for d in model.tooth_damages
            ],
            "drawn": self.drawn,
        }
