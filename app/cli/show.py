"""`gearsig show METHOD`: a command for each method, which gives figure, table, arrays and numbers."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from app.cli import options
from app.cli.quantities import quantity, span
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.methods import Method, MethodOption


def _common(
    recording: Annotated[Path, typer.Argument(help="Recording to analyse.")],
    channel: Annotated[str, typer.Option(metavar="NAME", help="Default: the first acceleration.")] = "",
    part_from: Annotated[
        str | None, typer.Option("--from", metavar="TIME", help="Start of the part to analyse.")
    ] = None,
    part_to: Annotated[str | None, typer.Option("--to", metavar="TIME", help="End of the part to analyse.")] = None,
    rig: options.RigOption = None,
    fs: options.SamplingRateOption = None,
    speed_rpm: options.SpeedOption = None,
    tach_times: options.TachometerTimesOption = None,
    pulses_per_revolution: options.PulsesOption = 1,
    memory: Annotated[
        float,
        typer.Option(
            "--memory",
            metavar="GB",
            min=0.25,
            help="Memory for one recording. For a longer one, density, maps, average and envelope are computed in "
            "blocks; the others need --from and --to.",
        ),
    ] = 2.0,
    json: options.JsonOption = False,
    output: Annotated[Path | None, options.output_option("Folder for METHOD.png, .svg, .csv, .h5 and .json.")] = None,
) -> None:
    """Hold the options that every method takes."""


class MethodGroup(TyperGroup):
    """The methods as commands, built on demand because the table of methods loads heavy libraries."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the methods."""
        del ctx
        from gearsig.methods import METHODS

        return list(METHODS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return the command of a method."""
        del ctx
        from gearsig.methods import METHODS

        return _command(cmd_name, METHODS[cmd_name]) if cmd_name in METHODS else None

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Find the method that the first argument names."""
        from gearsig.checks import known_name
        from gearsig.methods import METHODS

        known_name(args[0], METHODS, f"there is no method {args[0]!r}")
        return super().resolve_command(ctx, args)


show = typer.Typer(
    name="show",
    cls=MethodGroup,
    invoke_without_command=True,
    no_args_is_help=True,
    help="""Apply one method to one channel: figure as PNG and SVG, table as CSV, arrays as HDF5, numbers as JSON.

    Examples: gearsig show order-map run_up.h5 -o out; gearsig show envelope a.csv --band 2kHz..4kHz -o out;
    gearsig show modes --help""",
)


@show.callback()
def _list(
    list_all: Annotated[bool, typer.Option("--list", help="Print every method and its options.")] = False,
) -> None:
    if list_all:
        _print_methods()


def modes(context: typer.Context) -> None:
    """Decompose a channel into variational modes; --then transforms the chosen mode, as noisy crack records need.

    The same as gearsig show modes.

    Example: gearsig modes crack.h5 --penalty 2000 --then squeezed-cwt -o out
    """
    from gearsig.methods import METHODS

    command = _command("modes", METHODS["modes"])
    command.main(args=list(context.args), prog_name="gearsig modes", standalone_mode=False)


def flag(option: MethodOption) -> str:
    """Return the option's name on the command line, without its unit."""
    return "--" + option.name.removesuffix("_hz").removesuffix("_s").replace("_", "-")


def _command(name: str, method: Method) -> Any:
    """Return the command of a method, with the common options and its own."""

    def call(**given: Any) -> None:
        _answer(name, method, **given)

    parameters = [
        *inspect.signature(_common).parameters.values(),
        *(
            inspect.Parameter(
                option.name, inspect.Parameter.KEYWORD_ONLY, default=_default(option), annotation=_annotation(option)
            )
            for option in method.options
        ),
    ]
    hints = inspect.get_annotations(_common, eval_str=True)
    call.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [p.replace(annotation=hints.get(p.name, p.annotation), kind=inspect.Parameter.KEYWORD_ONLY) for p in parameters]
    )
    call.__annotations__ = {p.name: hints.get(p.name, p.annotation) for p in parameters}
    app = typer.Typer(pretty_exceptions_enable=False)
    app.command(name, help=method.about)(call)
    command = typer.main.get_command(app)
    command.name = name
    return command


def _default(option: MethodOption) -> Any:
    return ("" if option.kind == "text" or option.default == () else None) if not option.default else option.default


def _annotation(option: MethodOption) -> Any:
    kind: Any = {"switch": bool, "count": int}.get(option.kind, str)
    if option.kind == "number" and not option.unit:
        kind = float
    text = option.about
    if option.kind == "choice":
        text = f"{', '.join(filter(None, option.choices))}. {text}"
    if option.default is None or option.default == ():
        text = f"{text} Default: {option.empty}.".lstrip()
    metavar = {"span": "FROM..TO", "numbers": "N,N", "name": "NAME"}.get(option.kind)
    complete = _completion(option)
    shown = typer.Option(flag(option), help=f"{option.label}: {text}", metavar=metavar, autocompletion=complete)
    kind = kind if kind is bool else kind | None
    return Annotated[kind, shown]


def _completion(option: MethodOption) -> Callable[[str], list[str]] | None:
    if option.kind != "choice":
        return None
    return lambda incomplete: [name for name in option.choices if name and name.startswith(incomplete)]


def _value(option: MethodOption, given: Any) -> Any:
    """Convert a typed value to what the method takes."""
    if option.kind == "numbers":
        return _numbers(given or "", flag(option))
    if given is None:
        return option.default
    if option.kind == "span":
        return span(given, option.unit, flag(option))
    if option.kind == "number" and isinstance(given, str):
        return quantity(given, option.unit, flag(option))
    return given


def _answer(
    name: str,
    method: Method,
    /,  # lyapunov has an option of that name
    *,
    recording: Path,
    channel: str,
    part_from: str | None,
    part_to: str | None,
    rig: Path | None,
    fs: float | None,
    speed_rpm: float | None,
    tach_times: Path | None,
    pulses_per_revolution: int,
    memory: float,
    json: bool,
    output: Path | None,
    **given: Any,
) -> None:
    from rich.console import Console

    from gearsig.methods import apply_method_to_file
    from gearsig.report import answer_json, check_writable, write_answer

    settings = {option.name: _value(option, given[option.name]) for option in method.options}
    start_s = None if part_from is None else quantity(part_from, "s", "--from")
    end_s = None if part_to is None else quantity(part_to, "s", "--to")
    if output is not None:
        check_writable(output)
    speed = options.stated_speed(speed_rpm, tach_times, pulses_per_revolution)
    machine = options.open_rig(rig, recording)
    with Console(stderr=True).status(name):
        answer = apply_method_to_file(
            name, recording, machine, channel, start_s=start_s, end_s=end_s, memory_bytes=1e9 * memory,
            sampling_rate_hz=fs, speed=speed, **settings,
        )  # fmt: skip
        paths = () if output is None else write_answer(answer, output)
    if json or output is None:
        typer.echo(answer_json(answer))
        return
    typer.echo(f"{answer.channel}: {answer.caption}")
    for text in (*answer.facts, *answer.warnings):
        typer.echo(text.replace("**", ""))
    typer.echo(f"In {output}: {', '.join(path.name for path in paths)}.")


def _print_methods() -> None:
    from gearsig.methods import METHODS

    width = max(map(len, METHODS))
    for name, method in METHODS.items():
        typer.echo(f"{name:<{width}}  {method.about}")
        if method.options:
            typer.echo(f"{'':<{width}}  {', '.join(flag(option) for option in method.options)}")
    typer.echo("Each also takes --channel, --from and --to; see gearsig show METHOD --help.")


def _numbers(text: str, name: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise InputError(f"{name} is {text!r}", allowed="numbers, e.g. 55,110") from None
