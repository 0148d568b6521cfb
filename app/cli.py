"""The `gearsig` command."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import typer

from app.commands.analyze import analyze
from app.commands.crack import crack
from app.commands.dashboard import dashboard
from app.commands.demo import demo
from app.commands.report import report
from app.commands.rig import rig_app
from app.commands.simulate import simulate
from app.commands.sweep import sweep
from gearsig import __version__
from gearsig.errors import InputError, RefusalError

EXIT_INPUT_ERROR = 2
EXIT_INTERRUPTED = 130

app = typer.Typer(
    name="gearsig",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    help="""Signal processing and diagnostics for gear vibration.

    Start with **gearsig demo**; then **gearsig analyze RECORDING --rig RIG** on a recording of your own.
    A rig file says what is known of the machine: **gearsig rig example** prints one to start from.""",
)
app.command()(analyze)
app.command()(crack)
app.command()(report)
app.add_typer(rig_app, name="rig")
app.command()(simulate)
app.command()(sweep)
app.command()(demo)
app.command()(dashboard)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gearsig {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Print the version."),
) -> None:
    """Hold the options that belong to no single command."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; an error of the user's input is one line on standard error and exit code 2."""
    try:
        app(args=list(arguments) if arguments is not None else None)
    except (InputError, RefusalError) as error:
        typer.echo(f"gearsig: {error}", err=True)
        sys.exit(EXIT_INPUT_ERROR)
    except KeyboardInterrupt:
        typer.echo("gearsig: stopped", err=True)
        sys.exit(EXIT_INTERRUPTED)
    except BrokenPipeError:  # the reader of our output has gone, e.g. `| head`
        sys.stderr.close()
        sys.exit(0)


if __name__ == "__main__":
    main()
