"""`gearsig show` and `gearsig modes`: one method on one channel, as figure, table, arrays and numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.cli import options
from app.cli.quantities import quantity, span
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.recording import Recording
    from gearsig.report import MethodOptions


def _method_names(incomplete: str) -> list[str]:
    from gearsig.report import METHODS

    return [name for name in METHODS if name.startswith(incomplete)]


def _transform_names(incomplete: str) -> list[str]:
    from gearsig.report import TRANSFORMS

    return [name for name in TRANSFORMS if name.startswith(incomplete)]


OutputOption = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="DIR", help="Folder for METHOD.png, .svg, .csv, .h5 and .json."),
]
ChannelOption = Annotated[str, typer.Option("--channel", metavar="NAME", help="Default: the first acceleration.")]
ShaftOption = Annotated[str, typer.Option("--shaft", metavar="NAME", help="Default: the reference shaft.")]
FromOption = Annotated[str | None, typer.Option("--from", metavar="TIME", help="Start of the part looked at.")]
ToOption = Annotated[str | None, typer.Option("--to", metavar="TIME", help="End of the part looked at.")]
LowestOption = Annotated[float | None, typer.Option("--lowest", help="Lowest line shown, in Hz or orders.")]
HighestOption = Annotated[float | None, typer.Option("--highest", help="Highest line shown, in Hz or orders.")]
OverAngleOption = Annotated[bool, typer.Option("--over-angle", help="Over shaft angle and order.")]
CountOption = Annotated[int | None, typer.Option("--n-modes", min=1, help="Default: as the signal suggests.")]
PenaltyOption = Annotated[float | None, typer.Option("--penalty", help="Of the modes' bandwidth; 2000 is usual.")]
ModeOption = Annotated[
    int | None, typer.Option("--mode", min=1, help="From 1 by rising frequency. Default: the most impulsive one.")
]
ThenOption = Annotated[
    str,
    typer.Option(
        "--then",
        metavar="TRANSFORM",
        help="What the chosen mode goes on to: cwt, squeezed-cwt, stft or squeezed-stft.",
        autocompletion=_transform_names,
    ),
]


def show(
    method: Annotated[
        str | None, typer.Argument(help="See --list, e.g. order-map.", autocompletion=_method_names)
    ] = None,
    recording: Annotated[Path | None, typer.Argument(help="Recording to look at.")] = None,
    list_all: Annotated[bool, typer.Option("--list", help="Print every method and what it takes.")] = False,
    channel: ChannelOption = "",
    shaft: ShaftOption = "",
    pair: Annotated[str, typer.Option("--pair", metavar="NAME", help="Pair whose mesh cycle gives a point.")] = "",
    start: FromOption = None,
    end: ToOption = None,
    band: Annotated[
        str | None, typer.Option("--band", metavar="HZ..HZ", help="Of the envelope or phase plane, e.g. 2kHz..4kHz.")
    ] = None,
    lowest: LowestOption = None,
    highest: HighestOption = None,
    orders: Annotated[
        str, typer.Option("--orders", metavar="N,N", help="To track. Default: the meshes' first two harmonics.")
    ] = "",
    transform: Annotated[
        str,
        typer.Option(
            "--transform",
            help="Of time-frequency: cwt, squeezed-cwt, stft, squeezed-stft.",
            autocompletion=_transform_names,
        ),
    ] = "cwt",
    over_angle: OverAngleOption = False,
    n_modes: CountOption = None,
    penalty: PenaltyOption = None,
    mode: ModeOption = None,
    then: ThenOption = "",
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    json: options.JsonOption = False,
    output: OutputOption = None,
) -> None:
    """Apply one method to one channel: figure as PNG and SVG, table as CSV, arrays as HDF5, numbers as JSON.

    Examples: gearsig show order-map run_up.h5 -o out; gearsig show envelope a.csv --band 2kHz..4kHz -o out
    """
    if list_all:
        _print_methods()
        return
    if method is None or recording is None:
        raise InputError("a method and a recording are needed", remedy="gearsig show --list prints the methods")
    from gearsig.report import MethodOptions

    settings = MethodOptions(
        channel=channel,
        shaft=shaft,
        pair=pair,
        band_hz=None if band is None else _range(band),
        lowest=lowest,
        highest=highest,
        orders=_numbers(orders),
        transform=transform,
        over_angle=over_angle,
        n_modes=n_modes,
        penalty=penalty,
        mode=mode,
        then=then,
    )
    speed = options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    machine = options.open_rig(rig, recording)
    opened = options.open_recording(recording, machine, fs, speed)
    _answer(method, opened, _in_part(settings, start, end), output, json=json)


def modes(
    recording: Annotated[Path, typer.Argument(help="Recording to take apart.")],
    channel: ChannelOption = "",
    start: FromOption = None,
    end: ToOption = None,
    n_modes: CountOption = None,
    penalty: PenaltyOption = None,
    mode: ModeOption = None,
    then: ThenOption = "",
    lowest: LowestOption = None,
    highest: HighestOption = None,
    over_angle: OverAngleOption = False,
    shaft: ShaftOption = "",
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    json: options.JsonOption = False,
    output: OutputOption = None,
) -> None:
    """Take a channel apart into variational modes; --then transforms the chosen one, as noisy records of cracks need.

    Example: gearsig modes crack.h5 --penalty 2000 --then squeezed-cwt -o out
    """
    from gearsig.report import MethodOptions

    settings = MethodOptions(
        channel=channel, shaft=shaft, lowest=lowest, highest=highest, over_angle=over_angle, n_modes=n_modes,
        penalty=penalty, mode=mode, then=then,
    )  # fmt: skip
    machine = options.open_rig(rig, recording)
    opened = options.open_recording(recording, machine, fs, options.stated_speed(speed_rpm, None, 1))
    _answer("modes", opened, _in_part(settings, start, end), output, json=json)


def _in_part(settings: MethodOptions, start: str | None, end: str | None) -> MethodOptions:
    first = None if start is None else quantity(start, "s", "--from")
    return replace(settings, start_s=first, end_s=None if end is None else quantity(end, "s", "--to"))


def _answer(method: str, opened: Recording, settings: MethodOptions, output: Path | None, *, json: bool) -> None:
    from rich.console import Console

    from gearsig.report import answer_json, apply_method, check_writable, write_answer

    if output is not None:
        check_writable(output)
    with Console(stderr=True).status(method):
        answer = apply_method(method, opened, settings)
        paths = () if output is None else write_answer(answer, output)
    if json or output is None:
        typer.echo(answer_json(answer))
        return
    typer.echo(f"{answer.channel}: {answer.picture.caption}")
    typer.echo(f"In {output}: {', '.join(path.name for path in paths)}.")


def _print_methods() -> None:
    from gearsig.report import METHODS

    width = max(map(len, METHODS))
    for name, method in METHODS.items():
        takes = ", ".join(f"--{o.removesuffix('_hz').replace('_', '-')}" for o in method.options)
        needs = "; needs the speed" if method.needs_angle else ""
        typer.echo(f"{name:<{width}}  {method.about}{needs}")
        if takes:
            typer.echo(f"{'':<{width}}  {takes}")
    typer.echo("Each takes --channel, --from and --to besides.")


def _range(text: str) -> tuple[float, float]:
    if ".." not in text:
        raise InputError(f"--band is {text!r}", allowed="FROM..TO", remedy="write for example 2kHz..4kHz")
    return span(text, "Hz", "--band")


def _numbers(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise InputError(f"--orders is {text!r}", allowed="numbers, e.g. 55,110") from None
