"""`gearsig identify`: stiffness, damping, backlash, friction and inertia from a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.motion import BandwidthOption, UnwrapOption, UseOption, open_motion
from app.commands.options import RigOption, SamplingRateOption, open_rig
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.motion.identify_types import Identification
    from gearsig.rig.types import Rig

TAKEN = (
    "half_backlash_um",
    "stiffness_n_per_m_lambda",
    "restitution",
    "driver_inertia_kg_m2",
    "friction_coefficient",
    "driven_inertia_kg_m2",
)
"""Parameters that a rig file holds."""


def identify(
    recording: Annotated[Path, typer.Argument(help="Recording with the motion of both gears and the driver's torque.")],
    rig: RigOption = None,
    use: UseOption = None,
    bandwidth: BandwidthOption = None,
    unwrap: UnwrapOption = False,
    fs: SamplingRateOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, for other programs.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", help="Rig file (.toml) to write, with all that could be told."),
    ] = None,
) -> None:
    """Fit the contact of the teeth and the load to a recording, with 95 % intervals and what it cannot tell.

    The best record starts, runs and stops with a brake: both flanks are loaded, flanks meet at speed, inertias show.

    Example: gearsig identify drive.h5 --rig drive.toml -o fitted.toml
    """
    from gearsig.motion.identify import identify as fit
    from gearsig.report.identify_text import identify_json, identify_text
    from gearsig.rig.toml import write_rig

    machine = open_rig(rig, recording)
    if output is not None and (output.suffix.lower() != ".toml" or not output.parent.is_dir()):
        raise InputError(f"cannot write {str(output)!r}", allowed="a .toml file in a folder that exists")
    opened, motion = open_motion(recording, machine, fs, use, bandwidth, unwrap)
    found = fit(motion)
    known = machine or opened.rig
    if output is not None and known is not None:  # motion could not have been measured without a rig
        write_rig(with_fitted(known, found), output)
    typer.echo(identify_json(found) if json else identify_text(found))
    if output is not None and not json:
        typer.echo(f"\n{output.name}: the rig with what could be told.")


def with_fitted(rig: Rig, found: Identification) -> Rig:
    """Return the rig with the fitted values in its contact, as far as they could be told."""
    assert rig.contact is not None  # noqa: S101  motion could not have been measured without it
    told = {p.name: p.value for p in found.parameters if p.is_told and p.name in TAKEN}
    values = {name: max(value, 0.0) for name, value in told.items()}
    return replace(
        rig,
        contact=replace(rig.contact, **values),  # type: ignore[arg-type]  # all of them are numbers
        sources=(*rig.sources, f"contact fitted to {found.source or 'a recording'}: {', '.join(sorted(values))}"),
    )
