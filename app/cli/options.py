"""Options that several commands share, and functions that open recordings with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.quantities import quantity
from gearsig.errors import InputError, options_named
from gearsig.formatting import counted

if TYPE_CHECKING:
    from gearsig.motion import PairMotion
    from gearsig.processes import Cluster
    from gearsig.recording import Recording
    from gearsig.rig import Rig, SpeedSource
    from sims.effects import Effect, EffectSetting
    from sims.registry import Simulation
    from sims.simulator import ParameterValue, Simulator


RigOption = Annotated[
    Path | None,
    typer.Option(
        "--rig",
        help="Rig file (TOML): shafts, teeth, bearings, sensors, speed. Default: NAME.toml next to the recording.",
    ),
]


def output_option(about: str, metavar: str = "DIR") -> Any:
    """Return the option for the folder or file that a command writes."""
    return typer.Option("--output", "-o", metavar=metavar, help=about)


def quantity_option(name: str, unit: str, metavar: str, about: str) -> Any:
    """Return an option for a number in `unit`, or with its own unit."""

    def parsed(text: str | float) -> float:
        try:
            return quantity(str(text), unit, name)
        except InputError as error:  # the parser handles only its own errors
            raise typer.BadParameter(str(error)) from None

    return typer.Option(name, metavar=metavar, parser=parsed, help=about)


def rate_option(name: str, about: str) -> Any:
    """Return an option for a sampling rate, in Hz or with its unit."""
    return quantity_option(name, "Hz", "RATE", about)


SamplingRateOption = Annotated[
    float | None, rate_option("--fs", "Sampling rate, in Hz or kHz, if the file does not state it.")
]
SpeedOption = Annotated[
    float | None,
    quantity_option(
        "--speed-rpm",
        "rpm",
        "RPM",
        "Constant speed of the reference shaft, if known accurately; checks a speed that is measured.",
    ),
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
        help="Recording of the same machine when it was healthy, with the same sensors, speed and load. --fs applies "
        "to it as well, unless --reference-fs or a rig file next to it (NAME.toml) states its sampling rate; that "
        "file also gives its sensors and speed source.",
    ),
]
ReferenceRateOption = Annotated[
    float | None, rate_option("--reference-fs", "Sampling rate of the reference, like --fs.")
]
TorqueOption = Annotated[
    str | None,
    typer.Option(
        "--torque",
        help="E.g. 110Nm; replaces the rig's torque. Refers to the shaft of the rig's operating point, else the "
        "reference shaft.",
    ),
]

ChannelsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--channel",
        metavar="NAME",
        help="Use only this channel; repeatable. Default: all accelerations.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print the result as JSON, for other programs.")]
JobsOption = Annotated[int | None, typer.Option("--jobs", "-j", help="Processes; default: one per processor.")]
MemoryOption = Annotated[
    float,
    typer.Option(
        "--memory",
        metavar="GB",
        min=0.25,
        help="Memory for the analysis of one recording. A longer recording is read in blocks: levels and spectra "
        "cover all of it, the detectors its most informative parts.",
    ),
]
ClusterOption = Annotated[
    str,
    typer.Option(
        "--cluster",
        metavar="ADDRESS",
        help="Run on the workers of a Dask scheduler, e.g. tcp://10.0.0.5:8786; they must see the same files. "
        "Code is sent both ways: use only a scheduler that you trust.",
    ),
]


@contextmanager
def open_cluster(address: str) -> Iterator[Cluster | None]:
    """Open the cluster at an address; yield None if the address is empty."""
    if not address:
        yield None
        return
    from gearsig.processes import cluster

    with cluster(address) as opened:
        yield opened


def open_rig(path: Path | None, recording: Path | None = None) -> Rig | None:
    """Read the given rig file, else the one next to the recording with the same name; announce what becomes of it."""
    from gearsig.rig import read_rig, rig_file_beside

    beside = rig_file_beside(recording) if recording is not None else None
    if recording is not None and beside is not None and (path is None or path.resolve() != beside.resolve()):
        using = "Using the rig file" if path is None else f"Using {path.name}, not the rig file"
        typer.echo(f"{using} {beside.name} next to {recording.name}.", err=True)
    chosen = beside if path is None else path
    return read_rig(chosen) if chosen is not None else None


def stated_speed(speed_rpm: float | None, tach_times: Path | None, pulses_per_revolution: int) -> SpeedSource | None:
    """Return the speed source given by the options, or None."""
    if speed_rpm is not None and tach_times is not None:
        raise InputError("--speed-rpm and --tach-times are both given", remedy="give only the measured one")
    if tach_times is not None:
        from gearsig.recording import read_pulse_times

        return read_pulse_times(tach_times, pulses_per_revolution)
    if speed_rpm is not None:
        from gearsig.rig import ConstantSpeed

        return ConstantSpeed(speed_rpm)
    return None


def open_recording(
    path: Path, rig: Rig | None, sampling_rate_hz: float | None, speed: SpeedSource | None = None
) -> Recording:
    """Read one recording with the rig, sampling rate and speed that the options give."""
    from gearsig.diagnosis import read_whole

    return read_whole(path, rig, sampling_rate_hz=sampling_rate_hz, speed=speed)


def open_reference(
    path: Path | None,
    rig: Rig | None,
    sampling_rate_hz: float | None,
    speed_rpm: float | None,
    reference_rate_hz: float | None,
) -> Recording | None:
    """Read the healthy reference, if one is given; it gets no pulse times, which belong to the other recording."""
    if path is None:
        return None
    from gearsig.diagnosis import REFERENCE_OPTIONS, rig_and_rate_of_reference

    its_rig, rate_hz = rig_and_rate_of_reference(path, rig, sampling_rate_hz, reference_rate_hz)
    with options_named(REFERENCE_OPTIONS):
        return open_recording(path, its_rig, rate_hz, stated_speed(speed_rpm, None, 1))


def torque_of(text: str | None) -> float | None:
    """Parse the option --torque; the result is in N m."""
    from gearsig.checks import positive

    return positive(quantity(text, "N m", "--torque"), "--torque", "N m") if text is not None else None


ModelArgument = Annotated[str, typer.Argument(help="Model, e.g. cracked; `gearsig simulate --list` shows them.")]
PresetOption = Annotated[
    str,
    typer.Option(
        "--preset",
        metavar="NAME",
        help="Machine to start from: a name or a preset file, NAME.toml. Default: the model's first preset.",
    ),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="Change a parameter, e.g. crack_depth_mm=2mm; repeatable."),
]
EffectOption = Annotated[
    list[str] | None,
    typer.Option(
        "--effect",
        metavar="NAME=SEVERITY",
        help="Switch an effect on, e.g. root_crack=2mm or root_crack=2mm,gear=driven,tooth=5; repeatable.",
    ),
]
SimulatedSpeedOption = Annotated[
    str | None,
    typer.Option(
        "--speed",
        metavar="SPEED",
        help="500rpm, 300..1500rpm (over the duration), or a CSV file with time_s,speed_rpm. Default: the preset's.",
    ),
]
SimulatedTorqueOption = Annotated[
    str | None,
    typer.Option("--torque", metavar="TORQUE", help="110Nm, 20..110Nm, or a CSV file with time_s,torque_nm."),
]
DurationOption = Annotated[str, typer.Option("--duration", metavar="TIME", help="Length of the recording.")]
RateOption = Annotated[
    str,
    typer.Option(
        "--fs", metavar="RATE", help="Sampling rate, in Hz or kHz. Default: 20480 Hz; 1 kHz for the model forging."
    ),
]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="The same seed gives the same recording.")]
FreshOption = Annotated[
    bool,
    typer.Option(
        "--fresh",
        help="Model reduced-fe: delete reduced gears that another version of gearsig kept, and make them again.",
    ),
]


def read_request(
    model: str | None,
    preset: str,
    settings: Sequence[str] | None,
    effects: Sequence[str] | None,
    speed: str | None,
    torque: str | None,
    duration: str,
    fs: str,
    seed: int,
) -> Simulation:
    """Return the simulation that the options describe; names and units are checked here, ranges by the simulator."""
    from app.cli.quantities import read_profile
    from sims.presets import is_file
    from sims.presets import preset as preset_named
    from sims.registry import Simulation, simulator, simulators

    if model is None:
        raise InputError("no model is given", allowed=", ".join(simulators()), remedy="gearsig simulate --list")
    chosen = simulator(model)
    duration_s = quantity(duration, "s", "--duration")
    return Simulation(
        model,
        preset=preset if is_file(preset) else preset_named(model, preset).name,
        parameters=dict(read_parameter(chosen, text) for text in settings or ()),
        effects=tuple(read_effect(text) for text in effects or ()),
        speed_rpm=None if speed is None else read_profile(speed, "speed_rpm", "rpm", duration_s),
        torque_nm=None if torque is None else read_profile(torque, "torque_nm", "N m", duration_s),
        duration_s=duration_s,
        sampling_rate_hz=quantity(fs, "Hz", "--fs") if fs else chosen.usual_sampling_rate_hz,
        seed=seed,
    )


def clear_other_versions(model: str | None) -> None:
    """Delete the finite-element gears that other versions cached, and report how many.

    Raises
    ------
    InputError
        If the model has no cache.
    """
    from sims.fe_gear import forget_other_versions
    from sims.reduced_fe import NAME

    if model != NAME:
        raise InputError(f"--fresh is given, but the model {model} has no cache", remedy="leave out --fresh")
    gone = forget_other_versions()
    if gone:
        typer.echo(f"{counted(len(gone), 'file')} of another version deleted", err=True)


def read_parameter(chosen: Simulator, text: str) -> tuple[str, ParameterValue]:
    """Parse name and value of a parameter such as "crack_depth_mm=2mm"."""
    from sims.simulator import parameter

    name, value = _split(text, "--set", "crack_depth_mm=2mm")
    definition = parameter(chosen.parameters, name)
    by_word = definition.choices or (definition.default is None and value == "none")
    return name, (value if by_word else quantity(value, definition.unit, name))


def read_effect(text: str) -> EffectSetting:
    """Parse an effect such as "root_crack=2mm,gear=driven,tooth=5"."""
    from sims.effects import EffectSetting, effect

    first, *assignments = text.split(",")
    name = first.partition("=")[0].strip()
    definition = effect(name)
    s = definition.severity
    if "=" not in first:
        raise InputError(
            f"effect {name} has no severity",
            allowed=f"{s.low:g} to {s.high:g} {s.unit}".strip(),
            remedy=f"write for example {name}={s.typical:g}{s.unit.replace(' ', '')}",
        )
    severity = quantity(first.partition("=")[2], s.unit, f"{s.name} of {name}")
    return EffectSetting(name, severity, read_effect_options(definition, assignments))


def read_effect_options(effect: Effect, texts: Sequence[str]) -> dict[str, float | str]:
    """Parse the options of an effect such as ["gear=driven", "tooth=5"]."""
    from gearsig.checks import known_name

    options = {option.name: option for option in effect.options}
    values: dict[str, float | str] = {}
    for text in texts:
        name, value = _split(text, f"effect {effect.name}", "gear=driven")
        option = options[known_name(name, options, f"{effect.name} has no option {name!r}")]
        is_text = isinstance(option.default, str)
        values[name] = value if is_text else quantity(value, option.unit, f"{name} of {effect.name}")
    return values


def _split(text: str, where: str, example: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign or not name.strip() or not value.strip():
        raise InputError(f"{text!r} is not NAME=VALUE", where=where, remedy=f"write for example {example}")
    return name.strip(), value.strip()


MotionArgument = Annotated[
    Path, typer.Argument(help="Recording with the motion of both gears, preferably also torque.")
]
UseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--use",
        metavar="ROLE=CHANNEL",
        help='Role of a channel, e.g. "driven angle=enc2"; "driver speed=" leaves it out. Roles: driver or driven with '
        "angle, speed or acceleration; torque; force. Default: by quantity, position and name. Repeatable.",
    ),
]
BandwidthOption = Annotated[
    str | None,
    typer.Option("--bandwidth", metavar="HZ", help="Smooth all motion to this bandwidth by a Savitzky–Golay filter."),
]
UnwrapOption = Annotated[bool, typer.Option("--unwrap", help="The angles start again from zero after each revolution.")]


def open_motion(
    recording: Path,
    machine: Rig | None,
    fs: float | None,
    use: Sequence[str] | None,
    bandwidth: str | None,
    unwrap: bool,
) -> tuple[Recording, PairMotion]:
    """Read a recording and the motion of its pair as the options say; refuse a machine that does not turn."""
    from gearsig.motion import check_turns, measure_motion

    roles, band = read_uses(use), read_bandwidth(bandwidth)
    opened = open_recording(recording, machine, fs)
    motion = measure_motion(opened, machine, use=roles, bandwidth_hz=band, unwrap=unwrap)
    check_turns(motion)
    return opened, motion


def read_uses(texts: Sequence[str] | None) -> dict[str, str]:
    """Return a mapping from role to channel, parsed from "driven angle=enc2"; the channel may contain "="."""
    values = {}
    for text in texts or ():
        role, sign, channel = text.partition("=")
        if not sign:
            raise InputError(
                f"--use is {text!r}", allowed="ROLE=CHANNEL", remedy='write for example "driven angle=enc2"'
            )
        values[role.strip()] = channel.strip()
    return values


def read_bandwidth(text: str | None) -> float | None:
    """Parse the option --bandwidth; the result is in Hz."""
    return quantity(text, "Hz", "--bandwidth") if text is not None else None
