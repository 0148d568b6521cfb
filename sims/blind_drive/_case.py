"""One blind case: a machine by its drawing, something wrong or nothing, recordings now and when it was healthy."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.recording import Channel, Provenance, Recording
from gearsig.rig import EncoderChannel, Sensor
from sims.blind_drive._machine import CATALOGUE, N_STATES, OUTSIDE, BlindDrive, build, changed, draw_drawing, march

# --------------------
# From a drive's motion to a recording: encoders that round, noise, sensors that are not there.
# --------------------


INTERVAL_S, STEP_S = 1e-3, 5e-5
ALL = (
    Channel("torque", "torque", "N m", "between motor and pinion"),
    Channel("pinion angle", "angle", "rad", "pinion"),
    Channel("wheel angle", "angle", "rad", "wheel"),
    Channel("pinion speed", "rotational_speed", "rad/s", "pinion"),
    Channel("wheel speed", "rotational_speed", "rad/s", "wheel"),
    Channel("pinion acceleration", "angular_acceleration", "rad/s^2", "pinion"),
    Channel("wheel acceleration", "angular_acceleration", "rad/s^2", "wheel"),
    Channel("interaction force", "force", "N", "tooth flanks"),
)


@dataclass(frozen=True)
class Chain:
    """What measures a machine.

    Parameters
    ----------
    counts : int
        Of both encoders per revolution.
    n_channels : int
        How many of `ALL`: 3 (torque and angles), 7 or 8.
    torque_noise, torque_offset : float
        Part of the motor's torque.
    speed_noise, acceleration_noise : float
        rad/s, rad/s².
    force_gain : float
    wheel_zero_rad : float
        Where the wheel's encoder begins to count.
    """

    counts: int
    n_channels: int
    torque_noise: float
    torque_offset: float
    speed_noise: float
    acceleration_noise: float
    force_gain: float
    wheel_zero_rad: float

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Those that are recorded."""
        return ALL[: self.n_channels]

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """For the rig file."""
        return tuple(Sensor(c.name, c.quantity, c.unit, c.position) for c in self.channels)


def draw_chain(rng: np.random.Generator) -> Chain:
    """Draw what measures a machine."""
    return Chain(
        2 ** int(rng.choice([16, 18, 20])),
        int(rng.choice([3, 7, 8])),
        rng.uniform(0.001, 0.005),
        rng.normal(0.0, 0.003),
        rng.uniform(0.5e-3, 2e-3),
        rng.uniform(0.2, 0.8),
        rng.normal(1.0, 0.01),
        rng.uniform(0.0, 2.0 * pi),
    )


def run(machine: BlindDrive, chain: Chain, duration_s: float, rng: np.random.Generator) -> Recording:
    """Run a machine from rest and measure it; the pinion stands anywhere at the beginning."""
    n = machine.numbers
    y = np.zeros(N_STATES)
    y[0] = y[2] = rng.uniform(0.0, 2.0 * pi)
    y[4] = y[6] = y[0] * n["rb1"] / n["rb2"]
    rows_of_run = march(machine.record(), y, *machine.errors, round(duration_s / INTERVAL_S), INTERVAL_S, STEP_S)
    rows = _readings(machine, chain, rows_of_run, rng)
    return Recording(
        np.vstack(rows[: chain.n_channels]),
        1.0 / INTERVAL_S,
        chain.channels,
        speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft="pinion"),
        rig=machine.drawing.rig(chain.sensors),
        provenance=Provenance(source="forging drive"),
    )


def _readings(machine: BlindDrive, chain: Chain, motion: FloatArray, rng: np.random.Generator) -> list[FloatArray]:
    def noise(level: float) -> FloatArray:
        return level * rng.standard_normal(len(motion))

    def read(angle: FloatArray) -> FloatArray:
        step = 2.0 * pi / chain.counts
        return np.asarray(np.round((angle + noise(0.3 * step)) / step) * step)

    full = machine.drawing.torque_nm
    torque = machine.numbers["gain"] * motion[:, 6] + chain.torque_offset * full
    wheel = motion[:, 3] + chain.wheel_zero_rad + _slips(machine, motion, rng)
    return [
        torque + noise(chain.torque_noise * full),
        read(motion[:, 0]),
        read(wheel),
        motion[:, 1] + noise(chain.speed_noise),
        motion[:, 4] + noise(chain.speed_noise),
        motion[:, 2] + noise(chain.acceleration_noise),
        motion[:, 5] + noise(chain.acceleration_noise),
        chain.force_gain * motion[:, 7] + noise(0.005 * machine.drawing.tooth_force_n),
    ]


def _slips(machine: BlindDrive, motion: FloatArray, rng: np.random.Generator) -> FloatArray:
    """The wheel's encoder stays behind by a random way in each start."""
    angle = np.zeros(len(motion))
    slip, n = machine.numbers["slip"], machine.numbers
    if slip == 0.0:
        return angle
    time = np.arange(len(motion)) * INTERVAL_S
    for start in np.arange(0.0, time[-1], n["period"]):
        way = slip * rng.uniform(0.3, 1.7) / n["rb2"]
        angle -= way * np.clip((time - start - 0.1) / (0.5 * n["on"]), 0.0, 1.0)
    return angle


KINDS = ("none", "single", "unknown")
DAILY = {"load_level": 0.05, "mu": 0.05, "torque": 0.02, "motor_level": 0.1, "brake": 0.05}
"""What a healthy machine changes by from one day to another, relative."""


@dataclass(frozen=True)
class DriveCase:
    """A case as it was drawn.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    effect : str
        Empty: none.
    level, severity : float
        0 (barely noticeable) to 1 (strong), and in the effect's unit.
    place : mapping
        Tooth (from 1) or order, where it has one.
    machine, healthy : Machine
        Now; and as the reference knew it.
    chain : Chain
    duration_s : float
    with_reference : bool
    seed : int
        Of the noise.
    """

    kind: str
    effect: str
    level: float
    severity: float
    place: dict[str, float]
    machine: BlindDrive
    healthy: BlindDrive
    chain: Chain
    duration_s: float
    with_reference: bool
    seed: int


@dataclass(frozen=True)
class MadeCase:
    """Recordings: now, and of the healthy machine where there is one."""

    recording: Recording
    reference: Recording | None


def draw_case(
    rng: np.random.Generator, role: str, *, kind: str, effect: str = "", level: float = 0.5, with_reference: bool = True
) -> DriveCase:
    """Draw a case.

    Parameters
    ----------
    rng : numpy.random.Generator
    role : str
        "development", "calibration" or "evaluation"; they share no gears.
    kind : str
        "none", "single" (of `CATALOGUE`) or "unknown" (of `OUTSIDE`).
    effect : str
        Empty for none.
    level : float
        0 to 1.
    with_reference : bool
    """
    one_of(kind, "kind", KINDS)
    drawing = draw_drawing(rng, role)
    healthy = build(rng, drawing)
    chain = draw_chain(rng)
    now = _another_day(healthy, rng)
    severity = 0.0
    place: dict[str, float] = {}
    if effect:
        change = (CATALOGUE | OUTSIDE)[effect]
        severity = float(change.low * (change.high / change.low) ** level)
        now, place = changed(now, effect, severity, rng)
    n_cycles = int(rng.integers(5, 8))
    duration = n_cycles * (drawing.on_s + drawing.off_s)
    return DriveCase(
        kind, effect, level, severity, place, now, healthy, chain, duration, with_reference, int(rng.integers(2**31))
    )


def record_case(case: DriveCase) -> MadeCase:
    """Record a case."""
    rng, reference_rng = np.random.default_rng(case.seed).spawn(2)
    reference = run(case.healthy, case.chain, case.duration_s, reference_rng) if case.with_reference else None
    return MadeCase(run(case.machine, case.chain, case.duration_s, rng), reference)


def label_of(case: DriveCase) -> dict[str, Any]:
    """Return what is true of a case, as plain values."""
    return {
        "kind": case.kind,
        "effect": case.effect,
        "level": case.level,
        "severity": case.severity,
        "unit": (CATALOGUE | OUTSIDE)[case.effect].unit if case.effect else "",
        "place": case.place,
        "with_reference": case.with_reference,
        "n_channels": case.chain.n_channels,
        "encoder_counts": case.chain.counts,
        "teeth": [case.machine.drawing.z1, case.machine.drawing.z2],
    }


def _another_day(machine: BlindDrive, rng: np.random.Generator) -> BlindDrive:
    """Return the machine as warm, as oiled and as valved as it is today."""
    today = {name: machine.numbers[name] * rng.uniform(1.0 - part, 1.0 + part) for name, part in DAILY.items()}
    return replace(machine, numbers=machine.numbers | today)
