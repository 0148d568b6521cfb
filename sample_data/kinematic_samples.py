"""The samples that the dynamic model cannot make: two stages, and a drive without tachometer that hunts for its speed.

Their signals come from the kinematic model in `tests.kinematic`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sample_files import Made, Writer, write_csv, write_mat

from gearsig.recording import Recording
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft, TachometerChannel
from sims.measure import ColouredNoise, MainsHum, Tachometer
from tests.kinematic.model import (
    BearingFault,
    KinematicModel,
    MeshHarmonics,
    MeshModulation,
    PathResonance,
    SensorChannel,
    ShaftOrder,
    ToothVariation,
    TransferPath,
)
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import Wander

STEP_MPS2 = 2.0**-8  # one step of the 16-bit converter that the samples pretend to come from (±128 m/s²)
SOURCE = "simulated: sample_data/make_samples.py"
PATH = TransferPath(1.0, (PathResonance(1150.0, 0.04, 1.5), PathResonance(2900.0, 0.05, 2.0)))
NOISE = ColouredNoise(1.2, slope=0.5)
HUM = MainsHum((0.03, 0.05))


def kinematic_samples() -> list[Made]:
    """Return the samples, made."""
    return [no_tachometer(), two_stage()]


def no_tachometer() -> Made:
    """No speed signal: 31/53 teeth at 1471.3 rpm, nominally 1500 rpm; the pinion is somewhat eccentric."""
    rig = Rig(
        name="Demonstration gearbox without tachometer",
        shafts=(Shaft("input"), Shaft("output")),
        pairs=(GearPair("stage 1", "input", "output", 31, 53, 2.0, 20.0, 20.0),),
        bearings=(ball_bearing("input drive end", "input"), ball_bearing("output drive end", "output")),
        sensors=(Sensor("a1", "acceleration", "m/s^2", "input bearing, vertical"),),
        operating_point=OperatingPoint("input", 1500.0, torque_nm=50.0),
        sources=(SOURCE,),
    )
    parts = ordinary_gears("stage 1", "input", "output", (6.0, 3.0, 1.5))
    parts["modulations"] = (
        MeshModulation("stage 1", "input", 0.25, 0.1),
        MeshModulation("stage 1", "output", 0.08, 0.04, angle_rad=1.0),
    )
    channel = SensorChannel("a1", PATH, NOISE, HUM, "input bearing, vertical")
    model = KinematicModel(Wander(1471.3, 0.002, 0.25), **parts, channels=(channel,))
    return made("no_tachometer.csv", rig, model, 12800.0, 4.0, 106, write_csv)


def two_stage() -> Made:
    """Two stages and three sensors; an inner-race defect in the intermediate bearing."""
    first = ordinary_gears("stage 1", "input", "intermediate", (5.0, 2.0, 1.0))
    second = ordinary_gears("stage 2", "intermediate", "output", (4.0, 2.5, 1.5, 0.8))
    parts: dict[str, Any] = {key: first[key] + second[key] for key in first if key != "shaft_orders"}
    fault = BearingFault("intermediate drive end", "inner", impulse_mps2=16.0, resonance_hz=5200.0, damping_ratio=0.05)
    channels = tuple(
        SensorChannel(name, TransferPath(gain, PATH.resonances), NOISE, HUM, place)
        for name, gain, place in (
            ("a1", 0.6, "input bearing, vertical"),
            ("a2", 1.0, "intermediate bearing, vertical"),
            ("a3", 0.4, "output bearing, vertical"),
        )
    )
    model = KinematicModel(
        Wander(2392.0, 0.003, 0.4),
        **parts,
        shaft_orders=(ShaftOrder("input", 0.3, at_rpm=2400.0),),
        bearing_faults=(fault,),
        channels=channels,
        tachometer=Tachometer(jitter_s=2e-6, noise_v=0.02),
    )
    return made("two_stage.mat", two_stage_rig(), model, 20480.0, 4.0, 107, write_mat)


def two_stage_rig() -> Rig:
    """Three shafts, two pairs, three sensors."""
    intermediate = Bearing(
        "intermediate drive end",
        "intermediate",
        n_rolling_elements=8,
        rolling_element_diameter_mm=9.0,
        pitch_diameter_mm=40.0,
    )
    return Rig(
        name="Two-stage demonstration gearbox",
        shafts=(Shaft("input"), Shaft("intermediate"), Shaft("output")),
        pairs=(
            GearPair("stage 1", "input", "intermediate", 23, 61, 2.0, 20.0, 20.0),
            GearPair("stage 2", "intermediate", "output", 19, 68, 2.5, 20.0, 30.0),
        ),
        bearings=(ball_bearing("input drive end", "input"), intermediate),
        sensors=(
            Sensor("a1", "acceleration", "m/s^2", "input bearing, vertical"),
            Sensor("a2", "acceleration", "m/s^2", "intermediate bearing, vertical"),
            Sensor("a3", "acceleration", "m/s^2", "output bearing, vertical"),
            Sensor("tacho", "tachometer", "V", "input shaft"),
        ),
        operating_point=OperatingPoint("input", 2400.0, torque_nm=30.0),
        speed=TachometerChannel("tacho", 1, shaft="input"),
        sources=(SOURCE,),
    )


def ball_bearing(name: str, shaft: str) -> Bearing:
    """A deep-groove ball bearing of type 6205: BPFO 3.58, BPFI 5.42 per revolution."""
    return Bearing(name, shaft, n_rolling_elements=9, rolling_element_diameter_mm=7.94, pitch_diameter_mm=39.04)


def ordinary_gears(pair: str, driver: str, driven: str, amplitudes_mps2: tuple[float, ...]) -> dict[str, Any]:
    """Mesh of a pair in good order: a little eccentricity and tooth-to-tooth variation on both gears."""
    return {
        "meshes": (MeshHarmonics(pair, amplitudes_mps2, (0.3, 1.1, 2.0, 0.7)[: len(amplitudes_mps2)]),),
        "modulations": (
            MeshModulation(pair, driver, 0.06, 0.03),
            MeshModulation(pair, driven, 0.08, 0.04, angle_rad=1.0),
        ),
        "tooth_variations": (ToothVariation(pair, driver, 0.02, 0.015), ToothVariation(pair, driven, 0.02, 0.015)),
        "shaft_orders": (
            ShaftOrder(driver, 0.25, at_rpm=1500.0, phase_rad=0.4),
            ShaftOrder(driver, 0.08, order=2.0, at_rpm=1500.0),
            ShaftOrder(driven, 0.15, at_rpm=925.0, phase_rad=1.9),
        ),
    }


def made(
    file: str, rig: Rig, model: KinematicModel, rate_hz: float, duration_s: float, seed: int, write: Writer
) -> Made:
    """Simulate a sample; accelerations in steps of the converter."""
    rng = np.random.default_rng(seed)
    recording = simulate_kinematic(rig, model, sampling_rate_hz=rate_hz, duration_s=duration_s, rng=rng)
    truth = {**dict(recording.truth or {}), "seed": seed, "converter_step_mps2": STEP_MPS2}
    truth["drawn"].pop("tachometer: rising edges_s", None)
    return Made(file, replace(recording, samples=_converted(recording)), truth, write)


def _converted(recording: Recording) -> np.ndarray:
    rows = zip(recording.channels, recording.samples, strict=True)
    return np.array([np.round(x / STEP_MPS2) * STEP_MPS2 if c.quantity == "acceleration" else x for c, x in rows])
