"""Options that `simulate` and `sweep` share, and what they ask for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import typer

from app.quantities import quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from sims.effects import Effect, EffectSetting
    from sims.machine.operation import Course
    from sims.simulator import ParameterValue, Simulator

PresetOption = Annotated[
    str,
    typer.Option(
        "--preset",
        metavar="NAME",
        help="Machine to start from, or a preset file, NAME.toml; default: the model's first.",
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
SpeedOption = Annotated[
    str | None,
    typer.Option(
        "--speed",
        metavar="SPEED",
        help="500rpm, 300..1500rpm (over the duration), or a CSV file with time_s,speed_rpm. Default: the preset's.",
    ),
]
TorqueOption = Annotated[
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
        help="Model reduced-fe: make reduced gears anew that another version of gearsig kept.",
    ),
]


@dataclass(frozen=True)
class Request:
    """What is to be simulated."""

    model: str
    preset: str
    parameters: dict[str, ParameterValue]
    effects: tuple[EffectSetting, ...]
    speed_rpm: Course | None
    torque_nm: Course | None
    duration_s: float
    sampling_rate_hz: float
    seed: int


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
) -> Request:
    """Return what the options ask for; names and units are checked here, ranges by the simulator."""
    from app.profile import course
    from sims.presets import is_file
    from sims.presets import preset as preset_named
    from sims.registry import simulator, simulators, usual_sampling_rate_hz

    if model is None:
        raise InputError("no model is named", allowed=", ".join(simulators()), remedy="gearsig simulate --list")
    chosen = simulator(model)
    duration_s = quantity(duration, "s", "--duration")
    return Request(
        model,
        preset if is_file(preset) else preset_named(model, preset).name,
        dict(read_parameter(chosen, text) for text in settings or ()),
        tuple(read_effect(text) for text in effects or ()),
        None if speed is None else course(speed, "speed_rpm", "rpm", duration_s),
        None if torque is None else course(torque, "torque_nm", "N m", duration_s),
        duration_s,
        quantity(fs, "Hz", "--fs") if fs else usual_sampling_rate_hz(chosen),
        seed,
    )


def clear_other_versions(model: str | None) -> None:
    """Delete what other versions kept of finite-element gears, and say so.

    Raises
    ------
    InputError
        If the model keeps nothing.
    """
    from sims.reduced_fe.fresh import forget_other_versions
    from sims.reduced_fe.simulator import NAME

    if model != NAME:
        raise InputError(f"--fresh is given, but the model {model} keeps nothing", remedy="leave out --fresh")
    gone = forget_other_versions()
    if gone:
        typer.echo(f"{len(gone)} file{'s' if len(gone) > 1 else ''} of another version cleared away", err=True)


def read_parameter(chosen: Simulator, text: str) -> tuple[str, ParameterValue]:
    """Return name and value of "crack_depth_mm=2mm"."""
    from sims.values import parameter

    name, value = _split(text, "--set", "crack_depth_mm=2mm")
    wanted = parameter(chosen.parameters, name)
    by_word = wanted.choices or (wanted.default is None and value == "none")
    return name, (value if by_word else quantity(value, wanted.unit, name))


def read_effect(text: str) -> EffectSetting:
    """Return the setting of "root_crack=2mm,gear=driven,tooth=5"."""
    from sims.effects import EffectSetting, effect

    first, *rest = text.split(",")
    name = first.partition("=")[0].strip()
    wanted = effect(name)
    s = wanted.severity
    if "=" not in first:
        raise InputError(
            f"effect {name} has no severity",
            allowed=f"{s.low:g} to {s.high:g} {s.unit}".strip(),
            remedy=f"write for example {name}={s.typical:g}{s.unit.replace(' ', '')}",
        )
    severity = quantity(first.partition("=")[2], s.unit, f"{s.name} of {name}")
    return EffectSetting(name, severity, read_effect_options(wanted, rest))


def read_effect_options(wanted: Effect, texts: Sequence[str]) -> dict[str, float | str]:
    """Return the options of ["gear=driven", "tooth=5"]."""
    from gearsig.checks import closest_match_hint

    known = {option.name: option for option in wanted.options}
    found: dict[str, float | str] = {}
    for text in texts:
        name, value = _split(text, f"effect {wanted.name}", "gear=driven")
        if name not in known:
            raise InputError(
                f"{wanted.name} has no option {name!r}",
                allowed=", ".join(known) or "none",
                remedy=closest_match_hint(name, known),
            )
        option = known[name]
        is_text = isinstance(option.default, str)
        found[name] = value if is_text else quantity(value, option.unit, f"{name} of {wanted.name}")
    return found


def _split(text: str, where: str, example: str) -> tuple[str, str]:
    name, sign, value = text.partition("=")
    if not sign or not name.strip() or not value.strip():
        raise InputError(f"{text!r} is not NAME=VALUE", where=where, remedy=f"write for example {example}")
    return name.strip(), value.strip()
