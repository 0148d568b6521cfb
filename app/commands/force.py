"""`gearsig force`: force between the teeth from the measured motion of both gears."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.motion import BandwidthOption, UnwrapOption, UseOption, open_motion, read_bandwidth, read_uses
from app.commands.options import RigOption, SamplingRateOption, open_rig
from app.quantities import quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.motion.noise_study import NoiseStudy
    from gearsig.motion.types import ForceEstimate

DATA, TABLE, PICTURE, NOISE_PICTURE = "force.json", "force.csv", "force.png", "noise.png"
"""Files that -o makes."""

DatumOption = Annotated[
    str,
    typer.Option(
        "--datum",
        metavar="auto|zero|LENGTH",
        help="Compression at which the teeth stand in the middle of the play: found, zero, or e.g. 12um.",
    ),
]


def force(
    recording: Annotated[Path, typer.Argument(help="Recording with the motion of both gears, better with torque.")],
    rig: RigOption = None,
    use: UseOption = None,
    bandwidth: BandwidthOption = None,
    unwrap: UnwrapOption = False,
    datum: DatumOption = "auto",
    noise: Annotated[
        bool, typer.Option("--noise", help="Also: how much noise until the piecewise model is no longer nearer.")
    ] = False,
    fs: SamplingRateOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, for other programs.")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help=f"Folder for {DATA}, {TABLE}, {PICTURE}.")
    ] = None,
) -> None:
    """Estimate the force between the teeth by the piecewise model, by Hunt–Crossley and by Kelvin–Voigt.

    The rig's [contact] table gives stiffness, backlash, restitution, friction and inertias. Where torque was measured,
    each model is compared with torque over base radius. A speed or acceleration that was not measured is derived, and
    said how.

    Example: gearsig force drive.h5 --rig drive.toml --noise -o force
    """
    from rich.console import Console

    from gearsig.motion.force import estimate_forces
    from gearsig.report.files import check_writable
    from gearsig.report.force_text import force_json, force_text

    if output is not None:
        check_writable(output)
    machine = open_rig(rig, recording)
    zero = read_datum(datum)
    with Console(stderr=True).status("reading") as status:
        opened, motion = open_motion(recording, machine, fs, use, bandwidth, unwrap)
        estimate = estimate_forces(motion, datum=zero)
        study = None
        if noise:
            import numpy as np

            from gearsig.motion.noise_study import noise_study

            status.update("adding noise")
            rng = np.random.default_rng(0)
            roles, band = read_uses(use), read_bandwidth(bandwidth)
            study = noise_study(opened, machine, rng=rng, use=roles, bandwidth_hz=band, unwrap=unwrap, datum=zero)
        written: tuple[str, ...] = ()
        if output is not None:
            status.update("drawing")
            written = write_force(estimate, study, output)
    typer.echo(force_json(estimate, study) if json else force_text(estimate, study))
    if written and not json:
        typer.echo(f"\nIn {output}: {', '.join(written)}.")


def read_datum(text: str) -> str | float:
    """Return "auto", "zero" or a length in m."""
    if text in ("auto", "zero"):
        return text
    try:
        return quantity(text, "um", "--datum") * 1e-6
    except InputError as error:
        raise InputError(error.what, allowed="auto, zero, or a length, e.g. 12um") from None


def write_force(estimate: ForceEstimate, study: NoiseStudy | None, folder: Path) -> tuple[str, ...]:
    """Write data, table and pictures; return the files' names. Without a reference there is no picture."""
    from gearsig.plot.force import force_figure, noise_figure
    from gearsig.report.files import write_text
    from gearsig.report.force_text import force_csv, force_json

    write_text(folder / DATA, force_json(estimate, study))
    write_text(folder / TABLE, force_csv(estimate))
    pictures = {}
    if estimate.references_n:
        pictures[PICTURE] = force_figure(estimate)
    if study is not None:
        pictures[NOISE_PICTURE] = noise_figure(study)
    for name, figure in pictures.items():
        figure.savefig(folder / name)
    return (DATA, TABLE, *pictures)
