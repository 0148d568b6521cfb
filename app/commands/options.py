"""Options that several commands share, and how a recording is opened with them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.recording.types import Recording
    from gearsig.rig.speed import SpeedSource
    from gearsig.rig.types import Rig

RigOption = Annotated[
    Path | None,
    typer.Option(
        "--rig",
        help="Rig file (TOML): shafts, teeth, bearings, sensors, speed source. Default: NAME.toml beside it.",
    ),
]
SamplingRateOption = Annotated[
    float | None, typer.Option("--fs", metavar="HZ", help="Sampling rate in Hz, where the file does not state it.")
]
SpeedOption = Annotated[
    float | None,
    typer.Option("--speed-rpm", metavar="RPM", help="Constant speed of the reference shaft, if it is known well."),
]
TachometerTimesOption = Annotated[
    Path | None, typer.Option("--tach-times", metavar="FILE", help="File with the times of the tachometer pulses in s.")
]
PulsesOption = Annotated[int, typer.Option("--pulses-per-revolution", help="Pulses per revolution in --tach-times.")]
ReferenceOption = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        metavar="FILE",
        help="Recording of the same machine when it was sound: same sensors, speed and load.",
    ),
]
TorqueOption = Annotated[
    str | None,
    typer.Option(
        "--torque",
        help="E.g. 110Nm, instead of the rig's: of the shaft that its operating point names, else the reference shaft.",
    ),
]

ChannelsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        metavar="NAME",
        help="Use this channel only; may be given several times. Default: all accelerations.",
    ),
]


def open_rig(path: Path | None, recording: Path | None = None) -> Rig | None:
    """Read the rig file that is given, else the one of the same name beside the recording, and say so."""
    from gearsig.rig.toml import read_rig, rig_file_beside

    if path is None and recording is not None:
        path = rig_file_beside(recording)
        if path is not None:
            typer.echo(f"Using the rig file {path.name} beside {recording.name}.", err=True)
    return read_rig(path) if path is not None else None


def stated_speed(speed_rpm: float | None, tach_times: Path | None, pulses_per_revolution: int) -> SpeedSource | None:
    """Return the speed source that the options state, None if they state none."""
    if speed_rpm is not None and tach_times is not None:
        raise InputError("--speed-rpm and --tach-times are both given", remedy="give the one that is measured")
    if tach_times is not None:
        from gearsig.recording.pulse_file import read_pulse_times

        return read_pulse_times(tach_times, pulses_per_revolution)
    if speed_rpm is not None:
        from gearsig.rig.speed import ConstantSpeed

        return ConstantSpeed(speed_rpm)
    return None


def open_recording(
    path: Path, rig: Rig | None, sampling_rate_hz: float | None, speed: SpeedSource | None = None
) -> Recording:
    """Read one recording with what the options say of it."""
    from gearsig.recording.read import read_recording

    return read_recording(path, rig=rig, sampling_rate_hz=sampling_rate_hz, speed=speed)


def open_reference(
    path: Path | None, rig: Rig | None, sampling_rate_hz: float | None, speed_rpm: float | None
) -> Recording | None:
    """Read the recording of the sound machine, if one is given; pulse times belong to the other recording."""
    if path is None:
        return None
    from gearsig.diagnosis.comparison import rig_of_reference

    return open_recording(path, rig_of_reference(path, rig), sampling_rate_hz, stated_speed(speed_rpm, None, 1))


def torque_of(text: str | None) -> float | None:
    """Return the torque that the option states, in N m."""
    from app.quantities import quantity
    from gearsig.checks import positive

    return positive(quantity(text, "N m", "--torque"), "--torque", "N m") if text else None
