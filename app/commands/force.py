"""`gearsig force`: force between the teeth from the measured motion of both gears."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.options import RigOption, SamplingRateOption, open_recording, open_rig
from app.quantities import quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.motion.noise_study import NoiseStudy
    from gearsig.motion.types import ForceEstimate

DATA, TABLE, PICTURE, NOISE_PICTURE = "force.json", "force.csv", "force.png", "noise.png"
"""Files that -o makes."""

UseOption = Annotated[
    list[str] | None,
    typer.Option(
        "--use",
        metavar="ROLE=CHANNEL",
        help='Which channel is what, e.g. "driven angle=enc2"; "driver speed=" leaves it out. Roles: driver or driven, '
        "angle, speed or acceleration; torque; force. Default: by quantity, position and name. Repeatable.",
    ),
]
BandwidthOption = Annotated[
    str | None,
    typer.Option("--bandwidth", metavar="HZ", help="Smooth all motion to this, by a Savitzky–Golay filter."),
]
UnwrapOption = Annotated[bool, typer.Option("--unwrap", help="The angles start again after each revolution.")]
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
    from gearsig.motion.measure import measure_motion
    from gearsig.report.force_text import force_json, force_text

    machine = open_rig(rig, recording)
    roles = dict(read_use(text) for text in use or ())
    band = quantity(bandwidth, "Hz", "--bandwidth") if bandwidth else None
    zero = read_datum(datum)
    with Console(stderr=True).status("reading") as status:
        opened = open_recording(recording, machine, fs)
        motion = measure_motion(opened, machine, use=roles, bandwidth_hz=band, unwrap=unwrap)
        estimate = estimate_forces(motion, datum=zero)
        study = None
        if noise:
            import numpy as np

            from gearsig.motion.noise_study import noise_study

            status.update("adding noise")
            rng = np.random.default_rng(0)
            study = noise_study(opened, machine, rng=rng, use=roles, bandwidth_hz=band, unwrap=unwrap, datum=zero)
        if output is not None:
            status.update("drawing")
            write_force(estimate, study, output)
    typer.echo(force_json(estimate, study) if json else force_text(estimate, study))
    if output is not None and not json:
        typer.echo(f"\nIn {output}: {DATA}, {TABLE}, {PICTURE}{f', {NOISE_PICTURE}' if study else ''}.")


def read_use(text: str) -> tuple[str, str]:
    """Return role and channel of "driven angle=enc2"; the channel may hold "=" itself."""
    role, sign, channel = text.partition("=")
    if not sign:
        raise InputError(f"--use is {text!r}", allowed="ROLE=CHANNEL", remedy='write for example "driven angle=enc2"')
    return role.strip(), channel.strip()


def read_datum(text: str) -> str | float:
    """Return "auto", "zero" or a length in m."""
    return text if text in ("auto", "zero") else quantity(text, "um", "--datum") * 1e-6


def write_force(estimate: ForceEstimate, study: NoiseStudy | None, folder: Path) -> None:
    """Write data, table and pictures."""
    from gearsig.plot.force import force_figure, noise_figure
    from gearsig.report.files import write_text
    from gearsig.report.force_text import force_csv, force_json

    write_text(folder / DATA, force_json(estimate, study))
    write_text(folder / TABLE, force_csv(estimate))
    if estimate.references_n:
        force_figure(estimate).savefig(folder / PICTURE)
    if study is not None:
        noise_figure(study).savefig(folder / NOISE_PICTURE)
