"""`gearsig rig`: check a rig file, print one to start from, list the bearings that are known by name."""

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


@rig_app.command()
def bearings(names: Annotated[list[str] | None, typer.Argument(help="E.g. 6205-2RS; default: all.")] = None) -> None:
    """List bearings that a rig file may call by name, with their orders and the source of their geometry."""
    from gearsig.rig import Bearing, bearing_catalogue, catalogue_bearing

    typer.echo(f"{'bearing':<16} {'n':>3} {'ball mm':>8} {'pitch mm':>8}  BPFO    BPFI    BSF     FTF     source")
    for known in [catalogue_bearing(name) for name in names] if names else bearing_catalogue().values():
        orders = " ".join(
            f"{order:<7.4f}" for order in Bearing(known.name, "shaft", bearing=known.name).orders().values()
        )
        size = f"{known.rolling_element_diameter_mm:>8g} {known.pitch_diameter_mm:>8g}"
        typer.echo(f"{known.name:<16} {known.n_rolling_elements:>3} {size}  {orders} {known.source}")
