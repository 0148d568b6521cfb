"""Write the sample recordings and their rig files beside this script: `python sample_data/make_samples.py [FOLDER]`.

The signals come from the kinematic model in `sims.kinematic`; what is in each is listed in README.md and, with all
numbers, in truth.json. Same libraries, same bytes: the generators are seeded and no file carries a date.
"""

from __future__ import annotations

import gzip
import io
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.recording.types import Recording
from gearsig.rig.speed import TachometerChannel
from gearsig.rig.toml import write_rig
from gearsig.rig.types import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft
from sims.kinematic import (
    BearingFault,
    ColouredNoise,
    KinematicModel,
    LinearRamp,
    MainsHum,
    MeshHarmonics,
    Modulation,
    Resonance,
    SensorChannel,
    ShaftOrder,
    Tachometer,
    ToothDamage,
    ToothVariation,
    TransferPath,
    Wander,
    simulate_kinematic,
)

STEP_MPS2 = 2.0**-8  # one step of the 16-bit converter that the samples pretend to come from (±128 m/s²)
STEP_V = 2.0**-8
WAV_FULL_SCALE_MPS2 = 50.0
SOURCE = "simulated: sample_data/make_samples.py"
PATH = TransferPath(1.0, (Resonance(1150.0, 0.04, 1.5), Resonance(2900.0, 0.05, 2.0)))
NOISE = ColouredNoise(1.2, slope=0.5)
HUM = MainsHum((0.03, 0.05))


@dataclass(frozen=True)
class Sample:
    """One sample: its file, what makes it, and how it is written."""

    file: str
    rig: Rig
    model: KinematicModel
    sampling_rate_hz: float
    duration_s: float
    seed: int
    write: Callable[[Path, Recording], None]


def main(folder: Path) -> None:
    """Write every sample into `folder`."""
    truths = {}
    for sample in (
        healthy(),
        damaged_tooth(),
        outer_race(),
        eccentric_wheel(),
        run_up(),
        no_tachometer(),
        two_stage(),
    ):
        recording = simulate_kinematic(
            sample.rig,
            sample.model,
            sampling_rate_hz=sample.sampling_rate_hz,
            duration_s=sample.duration_s,
            rng=np.random.default_rng(sample.seed),
        )
        path = folder / sample.file
        sample.write(path, recording)
        write_rig(sample.rig, folder / f"{sample.file.split('.')[0]}.toml")
        truths[sample.file] = dict(recording.truth or {})
        truths[sample.file]["drawn"].pop("tachometer: rising edges_s", None)
        print(f"{path.name:24s} {path.stat().st_size / 1e3:7.0f} kB")  # noqa: T201  a script that reports its work
    (folder / "truth.json").write_text(json.dumps(_rounded(truths), indent=1) + "\n", encoding="utf-8")


# --- the machines -----------------------------------------------------------------------------------------------------


def one_stage_rig(
    name: str, *, teeth: tuple[int, int] = (29, 47), speed_rpm: float = 1500.0, tachometer: bool = True
) -> Rig:
    """Two shafts, one spur pair, a ball bearing on each shaft."""
    return Rig(
        name=name,
        shafts=(Shaft("input"), Shaft("output")),
        pairs=(
            GearPair("stage 1", "input", "output", *teeth, module_mm=2.0, pressure_angle_deg=20.0, face_width_mm=20.0),
        ),
        bearings=(
            ball_bearing("input drive end", "input"),
            ball_bearing("output drive end", "output"),
        ),
        sensors=_sensors("a1", tachometer=tachometer),
        operating_point=OperatingPoint("input", speed_rpm, torque_nm=50.0),
        speed=TachometerChannel("tacho", 1, shaft="input") if tachometer else None,
        sources=(SOURCE,),
    )


def ball_bearing(name: str, shaft: str) -> Bearing:
    """A deep-groove ball bearing of type 6205: BPFO 3.58, BPFI 5.42 per revolution."""
    return Bearing(name, shaft, n_rolling_elements=9, rolling_element_diameter_mm=7.94, pitch_diameter_mm=39.04)


def two_stage_rig() -> Rig:
    """Three shafts, two pairs, three sensors."""
    return Rig(
        name="Two-stage demonstration gearbox",
        shafts=(Shaft("input"), Shaft("intermediate"), Shaft("output")),
        pairs=(
            GearPair("stage 1", "input", "intermediate", 23, 61, 2.0, 20.0, 20.0),
            GearPair("stage 2", "intermediate", "output", 19, 68, 2.5, 20.0, 30.0),
        ),
        bearings=(
            ball_bearing("input drive end", "input"),
            Bearing(
                "intermediate drive end",
                "intermediate",
                n_rolling_elements=8,
                rolling_element_diameter_mm=9.0,
                pitch_diameter_mm=40.0,
            ),
        ),
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


def ordinary_gears(pair: str, driver: str, driven: str, amplitudes_mps2: tuple[float, ...]) -> dict[str, Any]:
    """Mesh of a pair in good order: a little eccentricity and tooth-to-tooth variation on both gears."""
    return {
        "meshes": (MeshHarmonics(pair, amplitudes_mps2, (0.3, 1.1, 2.0, 0.7)[: len(amplitudes_mps2)]),),
        "modulations": (Modulation(pair, driver, 0.06, 0.03), Modulation(pair, driven, 0.08, 0.04, angle_rad=1.0)),
        "tooth_variations": (ToothVariation(pair, driver, 0.02, 0.015), ToothVariation(pair, driven, 0.02, 0.015)),
        "shaft_orders": (
            ShaftOrder(driver, 0.25, at_rpm=1500.0, phase_rad=0.4),
            ShaftOrder(driver, 0.08, order=2.0, at_rpm=1500.0),
            ShaftOrder(driven, 0.15, at_rpm=925.0, phase_rad=1.9),
        ),
    }


TACHO = Tachometer(jitter_s=2e-6, noise_v=0.02)
A1 = SensorChannel("a1", PATH, NOISE, HUM, "input bearing, vertical")
WANDER = Wander(1496.0, 0.004, 0.35)


# --- the samples ------------------------------------------------------------------------------------------------------


def healthy() -> Sample:
    """A pair in good order, with a tachometer."""
    rig = one_stage_rig("Demonstration gearbox in good order")
    model = KinematicModel(
        WANDER, **ordinary_gears("stage 1", "input", "output", (6.0, 3.0, 1.5)), channels=(A1,), tachometer=TACHO
    )
    return Sample("healthy.h5", rig, model, 12800.0, 6.0, 101, write_hdf5)


def damaged_tooth() -> Sample:
    """One damaged tooth on the pinion: number 12, at 11.5/29 of a revolution after the tachometer pulse."""
    rig = one_stage_rig("Demonstration gearbox, damaged pinion tooth")
    damage = ToothDamage(
        "stage 1",
        "input",
        angle_rev=11.5 / 29,
        impulse_mps2=14.0,
        resonance_hz=2900.0,
        damping_ratio=0.05,
        mesh_dip_fraction=0.3,
        mesh_lag_rad=0.25,
    )
    model = KinematicModel(
        WANDER,
        **ordinary_gears("stage 1", "input", "output", (6.0, 3.0, 1.5)),
        tooth_damages=(damage,),
        channels=(A1,),
        tachometer=TACHO,
    )
    return Sample("damaged_tooth.csv.gz", rig, model, 12800.0, 5.0, 102, write_csv_gz)


def outer_race() -> Sample:
    """A defect on the outer race of the input bearing; the gears are in good order."""
    rig = one_stage_rig("Demonstration gearbox, outer-race defect")
    fault = BearingFault("input drive end", "outer", impulse_mps2=7.0, resonance_hz=4200.0, damping_ratio=0.06)
    model = KinematicModel(
        WANDER,
        **ordinary_gears("stage 1", "input", "output", (5.0, 2.5, 1.2)),
        bearing_faults=(fault,),
        channels=(A1,),
        tachometer=TACHO,
    )
    return Sample("outer_race.mat", rig, model, 12800.0, 6.0, 103, write_mat)


def eccentric_wheel() -> Sample:
    """A wheel (on the output shaft) that runs out: strong sidebands at the output shaft's order."""
    rig = one_stage_rig("Demonstration gearbox, eccentric wheel")
    sensors = (
        Sensor("ch1", "acceleration", "m/s^2", "input bearing, vertical", scale=WAV_FULL_SCALE_MPS2),
        Sensor("ch2", "tachometer", "V", "input shaft", scale=10.0),
    )
    rig = Rig(
        **{f: getattr(rig, f) for f in ("name", "shafts", "pairs", "bearings", "operating_point", "sources")},
        sensors=sensors,
        speed=TachometerChannel("ch2", 1, shaft="input"),
    )
    parts = ordinary_gears("stage 1", "input", "output", (6.0, 3.0, 1.5))
    parts["modulations"] = (
        Modulation("stage 1", "input", 0.06, 0.03),
        Modulation("stage 1", "output", 0.35, 0.25, angle_rad=1.0),
    )
    tacho = Tachometer(channel="ch2", jitter_s=2e-6, noise_v=0.02)
    channel = SensorChannel("ch1", PATH, NOISE, HUM, "input bearing, vertical")
    model = KinematicModel(WANDER, **parts, channels=(channel,), tachometer=tacho)
    return Sample("eccentric_wheel.wav", rig, model, 12800.0, 5.0, 104, write_wav)


def run_up() -> Sample:
    """A run-up from 600 to 3000 rpm past two resonances; everything in good order."""
    rig = one_stage_rig("Demonstration gearbox, run-up")
    rig = Rig(
        **{f: getattr(rig, f) for f in ("name", "shafts", "pairs", "bearings", "sensors", "speed", "sources")},
        operating_point=OperatingPoint("input", torque_nm=50.0),
    )
    model = KinematicModel(
        LinearRamp(600.0, 3000.0, 8.0),
        **ordinary_gears("stage 1", "input", "output", (6.0, 3.0, 1.5)),
        channels=(A1,),
        tachometer=TACHO,
    )
    return Sample("run_up.h5", rig, model, 12800.0, 8.0, 105, write_hdf5)


def no_tachometer() -> Sample:
    """No speed signal: 31/53 teeth at 1471.3 rpm, nominally 1500 rpm; the pinion is somewhat eccentric."""
    rig = one_stage_rig("Demonstration gearbox without tachometer", teeth=(31, 53), tachometer=False)
    parts = ordinary_gears("stage 1", "input", "output", (6.0, 3.0, 1.5))
    parts["modulations"] = (
        Modulation("stage 1", "input", 0.25, 0.1),
        Modulation("stage 1", "output", 0.08, 0.04, angle_rad=1.0),
    )
    model = KinematicModel(Wander(1471.3, 0.002, 0.25), **parts, channels=(A1,))
    return Sample("no_tachometer.csv", rig, model, 12800.0, 4.0, 106, write_csv)


def two_stage() -> Sample:
    """Two stages and three sensors; an inner-race defect in the intermediate bearing."""
    rig = two_stage_rig()
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
        tachometer=TACHO,
    )
    return Sample("two_stage.mat", rig, model, 20480.0, 4.0, 107, write_mat)


# --- the files: plain ones, as measuring systems leave them -----------------------------------------------------------


def write_hdf5(path: Path, recording: Recording) -> None:
    """One dataset per channel with a unit, the rate as an attribute."""
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["sampling_rate_hz"] = recording.sampling_rate_hz
        for channel, values in zip(recording.channels, quantised(recording), strict=True):
            dataset = file.create_dataset(channel.name, data=values, compression="gzip", shuffle=True)
            dataset.attrs["unit"] = channel.unit


def write_csv_gz(path: Path, recording: Recording) -> None:
    """Time column and header with units."""
    text = csv_text(recording, with_time=True)
    path.write_bytes(gzip.compress(text.encode(), compresslevel=9, mtime=0))


def write_csv(path: Path, recording: Recording) -> None:
    """No time column; the sampling rate stands in a line above the header."""
    path.write_text(csv_text(recording, with_time=False), encoding="utf-8", newline="\n")


def csv_text(recording: Recording, *, with_time: bool) -> str:
    """Return header and rows."""
    columns = [*quantised(recording)]
    formats, names = ["%.3f"] * len(columns), [f"{c.name} [{c.unit}]" for c in recording.channels]
    if with_time:
        columns, formats, names = [recording.time_s(), *columns], ["%.9f", *formats], ["time [s]", *names]
    buffer = io.StringIO()
    if not with_time:
        buffer.write(f"# sampling rate: {recording.sampling_rate_hz:g}\n")
    buffer.write(",".join(names) + "\n")
    np.savetxt(buffer, np.column_stack(columns), fmt=formats, delimiter=",")
    return buffer.getvalue()


def write_mat(path: Path, recording: Recording) -> None:
    """MAT v5 with one column vector per channel and `fs`."""
    from scipy.io import savemat

    variables: dict[str, Any] = {"fs": recording.sampling_rate_hz}
    variables |= dict(zip(recording.channel_names, quantised(recording), strict=True))
    buffer = io.BytesIO()
    savemat(buffer, variables, do_compression=True, oned_as="column", format="5")  # type: ignore[arg-type]  # takes files
    # The first 116 bytes are free text, where scipy puts the date.
    path.write_bytes(b"MATLAB 5.0 MAT-file, gearsig sample".ljust(116) + buffer.getvalue()[116:])


def write_wav(path: Path, recording: Recording) -> None:
    """Float WAV: acceleration over its full scale, tachometer over 10 V; the rig file scales them back."""
    from scipy.io import wavfile

    scales = np.array([WAV_FULL_SCALE_MPS2 if c.quantity == "acceleration" else 10.0 for c in recording.channels])
    frames = (np.asarray(quantised(recording)) / scales[:, None]).T.astype(np.float32)
    wavfile.write(path, round(recording.sampling_rate_hz), frames)


def quantised(recording: Recording) -> list[np.ndarray]:
    """Channels as a converter leaves them, in float32."""
    steps = [STEP_MPS2 if c.quantity == "acceleration" else STEP_V for c in recording.channels]
    return [(np.round(row / s) * s).astype(np.float32) for row, s in zip(recording.samples, steps, strict=True)]


def _sensors(name: str, *, tachometer: bool) -> tuple[Sensor, ...]:
    acceleration = Sensor(name, "acceleration", "m/s^2", "input bearing, vertical")
    return (acceleration, Sensor("tacho", "tachometer", "V", "input shaft")) if tachometer else (acceleration,)


def _rounded(value: object) -> object:
    """Numbers to seven digits: what was drawn is documented, not to the last bit."""
    if isinstance(value, dict):
        return {key: _rounded(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return float(f"{value:.7g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
