"""The `gearsig` command."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from errno import ENOSPC
from functools import cache

import typer

from app.cli.analyze import analyze, crack, demo, report, rig_app
from app.cli.benchmark import benchmark_app, papers
from app.cli.compare import compare
from app.cli.console import EXIT_INPUT_ERROR, EXIT_INTERRUPTED
from app.cli.dashboard import dashboard
from app.cli.fleet import fleet_app
from app.cli.flexible import flexible, gear_body, growth
from app.cli.gap import gap
from app.cli.motion import force, identify, start_stop
from app.cli.show import modes, show
from app.cli.simulate import bifurcation, simulate, sweep
from gearsig import __version__
from gearsig.errors import InputError, RefusalError

app = typer.Typer(
    name="gearsig",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""Signal processing and diagnostics for gear vibration.

    Start with **gearsig demo**; then **gearsig analyze RECORDING --rig RIG** on a recording of your own.
    A rig file describes the machine: **gearsig rig example** prints one to start from.

    Every command executes the Python files of your own effects that the variable GEARSIG_EFFECTS names.""",
)
COMMANDS: tuple[Callable[..., None] | typer.Typer, ...] = (
    *(analyze, show, modes, crack, force, start_stop, identify, compare, report, fleet_app, rig_app),
    *(simulate, sweep, bifurcation, flexible, gear_body, growth, papers, gap, benchmark_app, demo, dashboard),
)
for command in COMMANDS:
    if isinstance(command, typer.Typer):
        app.add_typer(command)
    elif command is modes:  # it takes the options of the method
        app.command(
            context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}
        )(command)
    else:
        app.command()(command)

USAGE_ERROR: type[Exception] = typer.BadParameter.__bases__[0]
"""Base class of the errors of Typer's parser, which Typer does not export; since version 0.20 it is not Click's."""


def _show_version(is_requested: bool) -> None:
    if is_requested:
        typer.echo(f"gearsig {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Print the version."),
) -> None:
    """Take the options that belong to no single command."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; an input error gives one line on standard error and exit code 2."""
    _end_on_sigterm()
    try:
        sys.exit(_parser()(args=list(arguments) if arguments is not None else None, standalone_mode=False))
    except USAGE_ERROR as error:  # a wrong option or argument, which Typer would print in a frame of several lines
        typer.echo(_usage_text(error), err=True, nl=bool(_usage_text(error)))
        sys.exit(EXIT_INPUT_ERROR)
    except (InputError, RefusalError) as error:
        typer.echo(f"gearsig: {error}", err=True)
        sys.exit(EXIT_INPUT_ERROR)
    except (KeyboardInterrupt, typer.Abort):
        typer.echo("gearsig: stopped", err=True)
        sys.exit(EXIT_INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone, e.g. `| head`
        sys.stderr.close()
        sys.exit(0)
    except OSError as error:  # standard output goes to a disk that is full; files say so themselves
        if error.errno != ENOSPC:
            raise
        typer.echo(f"gearsig: output cannot be written ({error.strerror}); make room on its disk", err=True)
        with suppress(OSError):
            sys.stdout.close()
        sys.exit(EXIT_INPUT_ERROR)


@cache
def _parser() -> Callable[..., int | None]:
    """Build the parser from the signatures of all commands, once: it takes a tenth of a second."""
    return typer.main.get_command(app)


def _end_on_sigterm() -> None:
    """Let SIGTERM end a command as Ctrl-C does, so that it cleans up."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, signal.default_int_handler)


def _usage_text(error: Exception) -> str:
    """Return a parser error as one line; empty if the parser printed the help instead."""
    problem = " ".join(str(getattr(error, "format_message", error.__str__)()).rstrip(".").split())
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "gearsig"
    return f"gearsig: {problem}{' See' if problem.endswith('?') else '; see'} {command} --help" if problem else ""


if __name__ == "__main__":
    main()
