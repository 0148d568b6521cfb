"""From the drive's motion to a recording: encoders, torque sensor, and an accelerometer where the rate allows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, pi
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.recording import Channel, Provenance, Recording
from gearsig.rig import EncoderChannel, Rig, Sensor
from sims.forging._drive import CONTINUOUS, SAMPLINGS, ForgingDrive, Schedule
from sims.forging._respond import CONTACT_COLUMNS, DriveResponse, respond
from sims.measure import (
    Accelerometer,
    AntiAlias,
    ColouredNoise,
    MeasuredChannel,
    MeasurementChain,
    ModalPath,
    Motion,
    apply,
    discrete,
)
from sims.simulator import ParameterValues

# Slow channels as a data logger stores them: through an anti-alias filter, not at instants.

SLOW_FINE_POINTS = 8
"""Points of the motion per sample: what the teeth do above seven times the sampling rate is below a millinewton."""
MAX_VALUES = 40_000_000
"""Of the fine motion at a time: a third of a gigabyte."""


def filtered_signals(
    drive: ForgingDrive, profiles: Schedule, names: Sequence[str], *, sampling_rate_hz: float, n_samples: int
) -> dict[str, FloatArray]:
    """Return signals of the drive, low-pass filtered and sampled, each (n_samples,).

    The filter has no delay: a sine up to 0.4 of the sampling rate keeps amplitude and phase, one above half of it is
    down by 90 dB. Ahead of the run everything stands as it does at its begin. The profiles must last 30 samples longer.

    Parameters
    ----------
    drive : ForgingDrive
    profiles : Schedule
    names : sequence of str
        Of `sims.forging.SIGNALS`.
    sampling_rate_hz : float
    n_samples : int
    """
    chain = AntiAlias()
    step_s = 1.0 / (SLOW_FINE_POINTS * sampling_rate_hz)
    reach = ceil(chain.reach_s(sampling_rate_hz) * sampling_rate_hz) + 1
    lasts_s = (n_samples + reach) / sampling_rate_hz
    together = max(1, MAX_VALUES // ((n_samples + 2 * reach) * SLOW_FINE_POINTS))
    signals: dict[str, FloatArray] = {}
    for first in range(0, len(names), together):
        chosen = names[first : first + together]
        run = respond(drive, profiles, duration_s=lasts_s, interval_s=step_s, signals=chosen)
        fine = np.pad(np.stack([run[name] for name in chosen]), ((0, 0), (reach * SLOW_FINE_POINTS, 0)), mode="edge")
        signals |= zip(chosen, chain.sample(fine, step_s, sampling_rate_hz, reach, n_samples), strict=True)
    return signals


MIN_VIBRATION_HZ = 5000.0
"""Sampling rate from which on vibration is recorded: flanks in contact ring at some 400 Hz, housings above."""
FINE_POINTS = 4
"""Points of the motion per sample of the accelerometer."""
PLACE = "pinion bearing"
FOLDS = (
    "torque, force, speeds and accelerations are samples of instants: what happens above {:g} Hz folds back, so lines "
    "of their spectra may be none of the machine (slow_channels=filtered keeps them out)"
)

CHANNELS = (
    Channel("torque", "torque", "N m", "between motor and pinion"),
    Channel("pinion angle", "angle", "rad", "pinion"),
    Channel("wheel angle", "angle", "rad", "wheel"),
    Channel("pinion speed", "rotational_speed", "rad/s", "pinion"),
    Channel("wheel speed", "rotational_speed", "rad/s", "wheel"),
    Channel("pinion acceleration", "angular_acceleration", "rad/s^2", "pinion"),
    Channel("wheel acceleration", "angular_acceleration", "rad/s^2", "wheel"),
    Channel("interaction force", "force", "N", "tooth flanks, of the model: no sensor measures it"),
)
"""What a recording of the motion holds."""
FILTERED = SAMPLINGS[1]
VIBRATION = Channel("vibration", "acceleration", "m/s^2", "pinion bearing, along the line of action")


def sensors(sampling_rate_hz: float) -> tuple[Sensor, ...]:
    """Return the sensors of a recording at that rate, for its rig file."""
    channels = (*CHANNELS, VIBRATION) if sampling_rate_hz >= MIN_VIBRATION_HZ else CHANNELS
    return tuple(Sensor(c.name, c.quantity, c.unit, c.position) for c in channels)


def record(
    drive: ForgingDrive,
    profiles: Schedule,
    values: ParameterValues,
    *,
    rig: Rig,
    rng: np.random.Generator,
    sampling_rate_hz: float,
    duration_s: float,
    truth: Mapping[str, Any],
) -> Recording:
    """Run the drive and measure it.

    Angles are rounded down to their encoder's counts after noise was added: counters store instants. Speeds and
    accelerations have noise of their own, as from sensors of their own. With torque and force they are instants as
    well, or filtered (`slow_channels`). Instants of a machine that runs on carry a warning at slow rates: their spectra
    hold lines from above half the sampling rate.
    """
    motion_rng, vibration_rng = rng.spawn(2)
    motion = respond(drive, profiles, duration_s=duration_s, interval_s=1.0 / sampling_rate_hz)
    is_filtered = values.word("slow_channels") == FILTERED
    folds = not is_filtered and values.word("mode") == CONTINUOUS and sampling_rate_hz < MIN_VIBRATION_HZ
    true = {c.name: motion[c.name] for c in CHANNELS}
    if is_filtered:
        slow = [c.name for c in CHANNELS if c.quantity != "angle"]
        n = len(true[slow[0]])
        true |= filtered_signals(drive, profiles, slow, sampling_rate_hz=sampling_rate_hz, n_samples=n)
    rows = list(_readings(true, values, motion_rng))
    channels = list(CHANNELS)
    if sampling_rate_hz >= MIN_VIBRATION_HZ:
        rows.append(_vibration(drive, profiles, values, vibration_rng, sampling_rate_hz, len(rows[0])))
        channels.append(VIBRATION)
    return Recording(
        np.vstack(rows),
        sampling_rate_hz,
        tuple(channels),
        speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft="pinion"),
        rig=rig,
        provenance=Provenance(
            source="simulation: forging manipulator drive",
            reader="sims.forging",
            history=(_sampling_text(sampling_rate_hz, is_filtered=is_filtered),),
        ),
        truth={**truth, **_truth(motion)},
        warnings=(FOLDS.format(0.5 * sampling_rate_hz),) if folds else (),
    )


def _sampling_text(rate_hz: float, *, is_filtered: bool) -> str:
    if is_filtered:
        return f"torque, force, speeds and accelerations filtered below {0.5 * rate_hz:g} Hz before they were sampled"
    return "torque, force, speeds and accelerations sampled at instants, without a filter"


def _readings(
    true: Mapping[str, FloatArray], parameters: ParameterValues, rng: np.random.Generator
) -> list[FloatArray]:
    noise = {
        "torque": parameters.number("torque_noise_nm"),
        "angle": parameters.number("angle_noise_urad") * 1e-6,
        "rotational_speed": parameters.number("speed_noise_mrad_per_s") * 1e-3,
        "angular_acceleration": parameters.number("acceleration_noise_rad_per_s2"),
        "force": 0.0,
    }
    counts = parameters.whole("encoder_counts")
    rows = []
    for channel in CHANNELS:
        values = true[channel.name]
        gain = parameters.number("torque_gain") if channel.quantity == "torque" else 1.0
        reading: FloatArray = gain * values + noise[channel.quantity] * rng.standard_normal(len(values))
        if channel.quantity == "angle" and counts:
            step = 2.0 * pi / counts
            reading = np.floor(reading / step) * step
        rows.append(reading)
    return rows


def _vibration(
    drive: ForgingDrive,
    profiles: Schedule,
    values: ParameterValues,
    rng: np.random.Generator,
    rate_hz: float,
    n_samples: int,
) -> FloatArray:
    """Acceleration of the housing's mass, which the force of the teeth shakes; the drive does not feel it."""
    fine_s = 1.0 / (FINE_POINTS * rate_hz)
    chain = MeasurementChain(rate_hz, (_channel(values),), AntiAlias())
    lead = ceil(chain.lead_in_s * rate_hz) * FINE_POINTS
    lasts_s = n_samples / rate_hz + chain.anti_alias.reach_s(rate_hz) + 4.0 / rate_hz
    force = respond(drive, profiles, duration_s=lasts_s, interval_s=fine_s, signals=("interaction force",))
    shaken = _housing(np.concatenate([np.zeros(lead), force["interaction force"]]), values, fine_s)
    motion = Motion(fine_s, (PLACE,), shaken[:, None])
    measured = chain.record(motion, rng=rng, duration_s=n_samples / rate_hz, lead_in_s=lead * fine_s)
    return measured.values(VIBRATION.name)


def _housing(force_n: FloatArray, values: ParameterValues, step_s: float) -> FloatArray:
    """Apply s²/(s² + 2ζωs + ω²)/m, exact for a force that runs straight between steps."""
    w, zeta = 2.0 * pi * values.number("housing_frequency_hz"), values.number("housing_damping_ratio")
    section = discrete((1.0, 0.0, 0.0), (1.0, 2.0 * zeta * w, w * w), step_s)
    return apply(section, force_n / values.number("housing_mass_kg"))


def _channel(values: ParameterValues) -> MeasuredChannel:
    return MeasuredChannel(
        VIBRATION.name,
        ModalPath({PLACE: 1.0}),
        Accelerometer(lower_limit_hz=0.5),
        background=ColouredNoise(values.number("vibration_noise_mps2")),
        position=VIBRATION.position,
    )


def _truth(motion: DriveResponse) -> dict[str, Any]:
    rows = [[None if np.isnan(value) else float(value) for value in row] for row in motion.contacts]
    return {"contacts": {"columns": list(CONTACT_COLUMNS), "rows": rows}, "solver": {"n_steps": motion.n_steps}}
