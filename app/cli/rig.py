"""`gearsig rig`: check a rig file, print one to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

rig_app = typer.Typer(
    name="rig", no_args_is_help=True, help="Check a rig file, which describes the machine, or print one to start from."
)


@rig_app.command()
def check(file: Annotated[Path, typer.Argument(help="Rig file (TOML).")]) -> None:
    """Print the orders that a rig file implies: shafts, meshes, sidebands, hunting tooth, BPFO, BPFI, BSF, FTF."""
    from gearsig.rig import describe_rig, read_rig

    typer.echo(describe_rig(read_rig(file)))


@rig_app.command()
def example() -> None:
    """Print a commented rig file; delete what you do not know."""
    typer.echo((Path(__file__).parent / "example_rig.toml").read_text(encoding="utf-8"))
