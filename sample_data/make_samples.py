"""Write the sample recordings and their rig files beside this script: `python sample_data/make_samples.py [FOLDER]`.

Most come from the cracked spur pair in 16 degrees of freedom (`sims.cracked`), two from the kinematic model
(kinematic_samples.py). What is in each is listed in README.md and, with all numbers, in truth.json. Same libraries,
same bytes: the generators are seeded and no file carries a date.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from kinematic_samples import kinematic_samples
from sample_files import Made, Writer, wav_writer, write_csv_gz, write_hdf5, write_mat

from gearsig.recording import Recording
from gearsig.rig import OperatingPoint, Rig, Sensor, TachometerChannel, write_rig
from sims.cracked import CrackedPair, simulate_with_motion
from sims.effects import EffectSetting
from sims.gear_pair import MeasuredRun, build_rig, draw_roughness
from sims.machine import Machine, Operation, Profile
from sims.simulator import ParameterValue, SimulationSetup

RATE_HZ = 12800.0
SOURCE = "simulated: sample_data/make_samples.py"
WORKSHOP, PUBLISHED = "workshop_29_47", "published_55_75"
MEASURED: dict[str, ParameterValue] = {"noise_mps2": 0.3, "noise_slope": 0.5, "hum_mps2": 0.03, "converter_bits": 16}
"""What every recording has from its surroundings and its converter."""
TOLERANCES: dict[str, ParameterValue] = {
    "pitch_deviation_um": 0.5,
    "tolerance_seed": 5575,
    "roughness_locked_to": "flank",
    "runout_driver_um": 4.0,
    "runout_driven_um": 6.0,
    "runout_angle_driver_deg": 40.0,
    "runout_angle_driven_deg": 130.0,
    "unbalance_driver_g_mm": 20.0,
    "unbalance_driven_g_mm": 50.0,
    "unbalance_angle_driver_deg": 200.0,
    "unbalance_angle_driven_deg": -70.0,
}
"""Of the published machine, whose gears are perfect; the workshop's has its own."""
CHANNELS = ("a1", "tacho")
"""Of those that are simulated; a2 would double the files."""
SPECIMEN_SEED = 11
"""Of the flanks' roughness: all recordings of a machine are of the same gears."""
CRACKS_MM = (0, 1, 2, 3, 4)
CRACKED_TOOTH = 21
DAMAGED_TOOTH = 12


def main(folder: Path) -> None:
    """Write every sample into `folder`."""
    truths = {}
    for made in [*workshop_samples(), *crack_samples(), *kinematic_samples()]:
        path, rig = folder / made.file, made.recording.rig
        made.write(path, made.recording)
        if rig is not None:
            write_rig(rig, folder / f"{made.file.split('.')[0]}.toml")
        known = {"sampling_rate_hz": made.recording.sampling_rate_hz, "duration_s": made.recording.duration_s}
        truths[made.file] = known | made.truth
        print(f"{path.name:24s} {path.stat().st_size / 1e3:7.0f} kB")  # noqa: T201  a script that reports its work
    (folder / "truth.json").write_text(json.dumps(_rounded(truths), separators=(",", ":")) + "\n", encoding="utf-8")


def workshop_samples() -> list[Made]:
    """The 29/47 gearbox: in good order, three faults, and a run-up."""
    spall = EffectSetting("tooth_spall", 80.0, {"tooth": DAMAGED_TOOTH, "length_mm": 3.0})
    eccentric = EffectSetting("eccentricity", 100.0, {"gear": "driven", "angle_deg": 60.0})
    race = EffectSetting("bearing_outer_race", 0.2)
    run_up = Operation(Profile.of([0.0, 8.0], [600.0, 3000.0]), Profile.constant(50.0))
    name = "Workshop gearbox"
    return [
        workshop("healthy.h5", f"{name} in good order", 101, (), 6.0, write_hdf5),
        workshop("damaged_tooth.csv.gz", f"{name}, damaged pinion tooth", 102, (spall,), 5.0, write_csv_gz),
        workshop("outer_race.mat", f"{name}, outer-race defect", 103, (race,), 6.0, write_mat),
        in_wav(workshop("eccentric_wheel.wav", f"{name}, eccentric wheel", 104, (eccentric,), 5.0, write_hdf5)),
        dynamic("run_up.h5", f"{name}, run-up", WORKSHOP, MEASURED, (), run_up, 105, 8.0, write_hdf5),
    ]


def workshop(
    file: str, name: str, seed: int, effects: tuple[EffectSetting, ...], duration_s: float, write: Writer
) -> Made:
    """Simulate the 29/47 gearbox at its speed."""
    operation = wandering(1496.0, 1500.0, 50.0, duration_s, seed)
    return dynamic(file, name, WORKSHOP, MEASURED, effects, operation, seed, duration_s, write, nominal_rpm=1500.0)


def crack_samples() -> list[Made]:
    """The published 55/75 pair without crack and with root cracks of 1 to 4 mm in the same tooth."""
    samples = []
    for depth in CRACKS_MM:
        effects = (EffectSetting("root_crack", float(depth), {"tooth": CRACKED_TOOTH}),) if depth else ()
        name = f"Published pair 55/75, root crack of {depth} mm" if depth else "Published pair 55/75, no crack"
        operation = wandering(499.0, 500.0, 110.0, 5.0, 110 + depth)
        file, values = f"root_crack_{depth}mm.h5", MEASURED | TOLERANCES
        samples.append(
            dynamic(file, name, PUBLISHED, values, effects, operation, 110 + depth, 5.0, write_hdf5, nominal_rpm=500.0)
        )
    return samples


def wandering(mean_rpm: float, nominal_rpm: float, torque_nm: float, duration_s: float, seed: int) -> Operation:
    """A speed that wanders by 0.2 % of the nominal one about its mean, drawn twice a second."""
    times = np.arange(-1.0, duration_s + 1.0, 0.5)
    drawn = np.random.default_rng([seed, 1]).standard_normal(len(times))
    values = mean_rpm + 0.002 * nominal_rpm * np.clip(drawn, -2.0, 2.0)
    return Operation(Profile(times, np.round(values, 2)), Profile.constant(torque_nm))


def dynamic(
    file: str,
    name: str,
    preset: str,
    parameters: dict[str, ParameterValue],
    effects: tuple[EffectSetting, ...],
    operation: Operation,
    seed: int,
    duration_s: float,
    write: Writer,
    *,
    nominal_rpm: float | None = None,
) -> Made:
    """Simulate a sample in 16 degrees of freedom; the rig states the nominal speed, not the true one."""
    rng = np.random.default_rng(seed)
    setup = SimulationSetup(preset, parameters, effects, operation)
    ready = CrackedPair().prepare(setup, rng, sampling_rate_hz=RATE_HZ)
    rig = build_rig(ready.machine, ready.operation, name=name, sources=[SOURCE])
    rig = replace(rig, operating_point=OperatingPoint("input", nominal_rpm, torque_nm=operation.torque_nm.largest))
    rig = replace(rig, sensors=tuple(s for s in rig.sensors if s.channel in CHANNELS))
    machine = same_flanks(ready.machine)
    recording, _ = simulate_with_motion(machine, operation, MeasuredRun(rng, RATE_HZ, duration_s, rig, ready.truth()))
    step_mps2 = machine.chain.channels[0].converter.step_mps2 if machine.chain.channels[0].converter else 0.0
    drawn = {"seed": seed, "specimen_seed": SPECIMEN_SEED, "converter_step_mps2": step_mps2}
    truth = {**dict(recording.truth or {}), **drawn}
    # The parameters say it all; the machine made of them is long.
    del truth["machine"], truth["measurement"]["chain"]
    return Made(file, recording.select(CHANNELS), truth, write)


def same_flanks(machine: Machine) -> Machine:
    """Draw the flanks' roughness by the machine and not by the run: noise differs from run to run, gears do not."""
    drawn, _ = draw_roughness(machine, np.random.default_rng(SPECIMEN_SEED))
    return replace(drawn, roughness=replace(drawn.roughness, locked_to="none"))


def in_wav(made: Made) -> Made:
    """Number the channels, as WAV has no names, and state in the rig what 1 stands for."""
    names = [f"ch{i}" for i in range(1, len(made.recording.channels) + 1)]
    scale = 1.25 * float(np.ceil(np.abs(made.recording.samples[:-1]).max() / 10.0)) * 10.0
    rig = made.recording.rig or Rig()
    sensors = tuple(
        Sensor(new, s.quantity, s.unit, s.position, scale=10.0 if s.quantity == "tachometer" else scale)
        for new, s in zip(names, rig.sensors, strict=True)
    )
    rig = replace(rig, sensors=sensors, speed=TachometerChannel(names[-1], 1, shaft="input"))
    channels = tuple(replace(c, name=new) for new, c in zip(names, made.recording.channels, strict=True))
    recording = Recording(
        made.recording.samples, made.recording.sampling_rate_hz, channels, speed=rig.speed, rig=rig, truth=made.truth
    )
    return Made(made.file, recording, made.truth, wav_writer(scale))


def _rounded(value: object) -> object:
    """Numbers to seven digits: what was drawn is documented, not to the last bit."""
    if isinstance(value, dict):
        return {key: _rounded(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return float(f"{value:.7g}") if isinstance(value, float) else value


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
