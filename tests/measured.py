"""The measured recordings in `../shared/data`, with the rig of each and what is known of it."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray
from gearsig.recording import Channel, Recording, read_recording
from gearsig.rig import Bearing, ConstantSpeed, GearPair, OperatingPoint, Rig, Shaft

DATA = Path(__file__).parents[2] / "shared" / "data"
needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")

PINION = Rig(
    name="one gear pair, wheel not described",
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage", "input", "output", 23),),
    operating_point=OperatingPoint("input", 2000.0),
)
BEARING = Rig(
    name="bearing test rig",
    shafts=(Shaft("shaft"),),
    # The set's own figures: 8 balls of 0.235 in on a pitch diameter of 1.245 in (BPFO 81.125 Hz at 25 Hz).
    bearings=(Bearing("test bearing", "shaft", 8, 5.969, 31.623),),
    speed=ConstantSpeed(1500.0, "shaft"),
)
MOTOR = Rig(
    name="motor test bench",
    shafts=(Shaft("motor"),),
    bearings=(Bearing("drive end", "motor", 9, 7.94, 39.04), Bearing("fan end", "motor", 8, 6.746, 28.5)),
)
TWO_STAGES = Rig(
    name="fault simulator",
    shafts=(Shaft("input"), Shaft("middle"), Shaft("output")),
    pairs=(GearPair("first", "input", "middle", 32, 96), GearPair("second", "middle", "output", 32, 80)),
    operating_point=OperatingPoint("input", 1800.0),
    sampling_rate_hz=4266.7,
    assumed=("sampling rate", "teeth"),
)
ROTOR = Rig(
    name="rotor bench",
    shafts=(Shaft("rotor"),),
    bearings=(Bearing("bearing", "rotor", bpfo_order=3.053, bpfi_order=4.947),),
    speed=ConstantSpeed(3600.0, "rotor"),
)
PARTS = ("bearing-outer-race", "bearing-inner-race", "bearing-rolling-element", "bearing-cage")
"""Codes of what is said of a bearing's parts."""

CWRU_RATES_HZ = {"OR007@6_0.mat": 12e3, "IR021_0.mat": 12e3, "B007_0.mat": 12e3, "normal_0.mat": 48e3}


@dataclass(frozen=True)
class Measured:
    """One recording, or one condition of a file.

    Parameters
    ----------
    name : str
        Its file, below the folder.
    known : str
        What is known of it.
    rig : Rig or None
    reference : str
        Name of the recording of the same machine before the change, empty where there is none.
    """

    name: str
    known: str
    rig: Rig | None
    reference: str = ""

    def read(self) -> Recording:
        """Return the recording with its rig."""
        return read_recording(DATA / self.name, rig=self.rig)


def _motor(file: str, known: str, reference: str = "bearing_cwru/normal_0.mat") -> Measured:
    return Measured(f"bearing_cwru/{file}", known, replace(MOTOR, sampling_rate_hz=CWRU_RATES_HZ[file]), reference)


RECORDINGS = (
    _motor("OR007@6_0.mat", "outer race, drive end"),
    _motor("IR021_0.mat", "inner race, drive end"),
    _motor("B007_0.mat", "ball, drive end; not diagnosable by its envelope (Smith and Randall 2015)"),
    _motor("normal_0.mat", "healthy", ""),
    Measured("bearing_races/InnerRaceFault_vload_3.mat", "inner race, 118.875 Hz", BEARING),
    Measured("bearing_races/OuterRaceFault_vload_4.mat", "outer race, 81.125 Hz", BEARING),
    Measured("unbalance_rotor/unbalance.mat#1", "next to no unbalance added", ROTOR),
    Measured("unbalance_rotor/unbalance.mat#2", "3.6 g at 44.4 mm: 1× up", ROTOR, "unbalance_rotor/unbalance.mat#1"),
    Measured("unbalance_rotor/unbalance.mat#3", "5.6 g at 44.4 mm: 1× up", ROTOR, "unbalance_rotor/unbalance.mat#1"),
    Measured("gear_pair_23_46/3027_217_Data_Chan12.mat", "no known fault; 23 teeth, about 2000 rpm", PINION),
    Measured("gear_pair_23_46/3027_217_Data_Chan14.mat", "no known fault; 23 teeth, about 2000 rpm", PINION),
    Measured("two_stage_gearbox/h30hz50.csv.gz", "healthy; rate and teeth inferred", TWO_STAGES),
    Measured(
        "two_stage_gearbox/b30hz50.csv.gz",
        "a broken tooth that standard indicators do not show; rate and teeth inferred",
        TWO_STAGES,
        "two_stage_gearbox/h30hz50.csv.gz",
    ),
    Measured("car_run_up/accel_with_rpm.wav", "run-up from 974 to 4821 rpm; orders 2, 4, 4.5, 5.5, 6", None),
)
BY_NAME = {one.name: one for one in RECORDINGS}


def with_assumed_gears(recording: Recording) -> Recording:
    """Return a recording of the gear pair with what a crack's depth asks for and nobody has written down.

    Wheel, module, width, torque, and that its channel is an acceleration: whether two parts of one recording differ
    hangs on none of them.
    """
    assert recording.rig is not None
    pair = GearPair("stage", "input", "output", 23, 46, module_mm=3.0, face_width_mm=25.0)
    rig = replace(recording.rig, pairs=(pair,), operating_point=OperatingPoint("input", 2000.0, torque_nm=40.0))
    channels = tuple(replace(c, quantity="acceleration", unit="g") for c in recording.channels)
    return replace(recording, rig=rig, channels=channels)


def at_speed(recording: Recording, factor: float) -> Recording:
    """Return a recording whose speed is stated so many times too high."""
    source = recording.speed_source
    assert isinstance(source, ConstantSpeed)
    return replace(recording, speed=replace(source, speed_rpm=factor * source.speed_rpm))


def halves(recording: Recording) -> tuple[Recording, Recording]:
    """Return the two halves of a recording."""
    middle = recording.duration_s / 2
    return recording.between(0.0, middle), recording.between(middle, recording.duration_s)


@cache
def car_run_up() -> tuple[Recording, ShaftAngle, FloatArray]:
    """Return the sound "p" of a car's run-up, its crankshaft's angle, and another vendor's table of its order levels.

    The table has rows of speed in rpm, and of orders 2 and 4 the level in dB.
    """
    whole = read_recording(DATA / "car_run_up" / "accel_with_rpm.wav")
    rpm, rate_hz = whole.samples[1].astype(np.float64), whole.sampling_rate_hz
    revolutions = np.concatenate([[0.0], np.cumsum(rpm[1:] + rpm[:-1]) / 120 / rate_hz])
    angle = ShaftAngle("crankshaft", whole.time_s(), revolutions, rpm / 60, "speed channel")
    sound = Recording(whole.samples[:1].astype(np.float64), rate_hz, (Channel("p", "sound_pressure", "Pa"),))
    return sound, angle, np.loadtxt(DATA / "car_run_up" / "reference_order_levels.txt", skiprows=1)
