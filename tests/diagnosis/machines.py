"""A test gearbox whose condition is known, and short words for what an analysis says of it."""

from dataclasses import replace
from functools import cache

import numpy as np

from gearsig.diagnosis import Analysis, Finding, Kind, analyze
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, GearPair, Rig, Shaft
from sims.measure import ColouredNoise, Tachometer
from tests.kinematic.model import KinematicModel, MeshHarmonics, MeshModulation, SensorChannel, ToothVariation
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import Wander

RIG = Rig(
    name="test gearbox",
    shafts=(Shaft("in"), Shaft("out")),
    pairs=(GearPair("stage", "in", "out", 27, 43),),
    bearings=(Bearing("front", "in", 9, 7.94, 39.04),),
)
GOOD = KinematicModel(
    speed=Wander(1320.0, 0.004, 0.4),
    meshes=(MeshHarmonics("stage", (4.0, 2.0, 1.0)),),
    modulations=(MeshModulation("stage", "in", 0.05), MeshModulation("stage", "out", 0.05)),
    tooth_variations=(ToothVariation("stage", "in", 0.02), ToothVariation("stage", "out", 0.02)),
    channels=(SensorChannel("a1", noise=ColouredNoise(0.8)),),
    tachometer=Tachometer("in"),
)
SAMPLING_RATE_HZ = 10240.0


def record(model: KinematicModel = GOOD, *, seconds: float = 5.0, seed: int = 0, rig: Rig = RIG) -> Recording:
    """Simulate the gearbox."""
    rng = np.random.default_rng(seed)
    return simulate_kinematic(rig, model, sampling_rate_hz=SAMPLING_RATE_HZ, duration_s=seconds, rng=rng)


@cache
def good_analysis() -> Analysis:
    """Return what is said of the good gearbox."""
    return analyze(record())


def teeth(driver: int, driven: int) -> Rig:
    """Return the gearbox with other teeth and without bearings."""
    return replace(RIG, pairs=(GearPair("stage", "in", "out", driver, driven),), bearings=())


def codes(analysis: Analysis, *kinds: Kind) -> list[str]:
    """Return the codes of the findings of some kinds, or of all."""
    return [f.code for f in analysis.findings if not kinds or f.kind in kinds]


def finding(analysis: Analysis, code: str) -> Finding:
    """Return the first finding of that code."""
    return next(f for f in analysis.findings if f.code == code)


MOTOR_RATE_HZ, MOTOR_HZ = 12_000.0, 29.95
MOTOR = Rig(
    shafts=(Shaft("motor"),),
    bearings=(Bearing("drive end", "motor", 9, 7.94, 39.04),),
    speed=ConstantSpeed(60 * MOTOR_HZ, "motor"),
)


@cache
def motor(race: str, seed: int, multiples: tuple[int, ...] = (1, 2, 3, 4, 5, 6)) -> Recording:
    """A motor with its shaft's lines in noise, and a damaged race or element whose impacts ring at 2.8 kHz."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(6.0 * MOTOR_RATE_HZ)) / MOTOR_RATE_HZ
    x = rng.standard_normal(len(t))
    for k in multiples:
        x += rng.uniform(0.1, 0.5) * np.cos(2 * np.pi * k * MOTOR_HZ * t + rng.uniform(0, 6))
    if race:
        rate_hz = {"BPFO": 3.585, "BPFI": 5.415, "BSF": 2 * 2.357}[race] * 0.997 * MOTOR_HZ
        hits = np.arange(0.01, t[-1], 1 / rate_hz)
        impacts = np.zeros_like(t)
        modulation_hz = {"BPFO": 0.0, "BPFI": MOTOR_HZ, "BSF": 0.3983 * MOTOR_HZ}[race]
        load = 1 + 0.8 * np.cos(2 * np.pi * modulation_hz * hits) if modulation_hz else 1.0
        impacts[np.round(hits * MOTOR_RATE_HZ).astype(int)] = 8.0 * load
        x += np.convolve(impacts, np.exp(-900 * t[:400]) * np.sin(2 * np.pi * 2800 * t[:400]))[: len(t)]
    return Recording(x[None, :], MOTOR_RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),), rig=MOTOR)
