"""`gearsig start-stop`: what the motion of a machine that starts, stops and reverses shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.motion import BandwidthOption, UnwrapOption, UseOption, open_motion
from app.commands.options import RigOption, SamplingRateOption, open_rig

if TYPE_CHECKING:
    from gearsig.motion.angle_profile import AngleProfile
    from gearsig.motion.start_stop import StartStop
    from gearsig.recording.types import Recording
    from gearsig.spectra.types import Spectrum

DATA, PICTURE = "start_stop.json", "start_stop.png"
"""Files that -o makes."""


def start_stop(
    recording: Annotated[Path, typer.Argument(help="Recording with the motion of both gears, better with torque.")],
    rig: RigOption = None,
    use: UseOption = None,
    bandwidth: BandwidthOption = None,
    unwrap: UnwrapOption = False,
    fs: SamplingRateOption = None,
    json: Annotated[bool, typer.Option("--json", help="Print the result as JSON, for other programs.")] = False,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="DIR", help=f"Folder for {DATA} and {PICTURE}.")
    ] = None,
) -> None:
    """Find starts and stops, the backlash, every impact of the flanks, and the loop of torque over twist.

    Nothing of it needs a steady speed. The picture shows the speed with the impacts, the phase plane of the teeth and
    torque over twist; the JSON has the level of a vibration (else of the torque) tooth by tooth, forwards and backwards
    apart, and its orders.

    Example: gearsig start-stop drive.h5 --rig drive.toml -o drive
    """
    from gearsig.motion.start_stop import examine_start_stop
    from gearsig.report.files import check_writable, write_text
    from gearsig.report.start_stop_text import start_stop_json, start_stop_text

    if output is not None:
        check_writable(output)
    opened, motion = open_motion(recording, open_rig(rig, recording), fs, use, bandwidth, unwrap)
    examined = examine_start_stop(motion)
    data = start_stop_json(examined, *tooth_levels(opened, examined))
    if output is not None:
        from gearsig.plot.start_stop import start_stop_figure

        write_text(output / DATA, data)
        start_stop_figure(examined).savefig(output / PICTURE)
    typer.echo(data if json else start_stop_text(examined))
    if output is not None and not json:
        typer.echo(f"\nIn {output}: {DATA}, {PICTURE}.")


def tooth_levels(recording: Recording, examined: StartStop) -> tuple[AngleProfile | None, str, str, Spectrum | None]:
    """Return of the first acceleration, else of the torque: level tooth by tooth, channel, unit, orders forwards."""
    from gearsig.errors import RefusalError
    from gearsig.motion.angle_profile import angle_profile
    from gearsig.motion.stretch_orders import stretch_order_spectrum

    fitting = [c for q in ("acceleration", "torque") for c in recording.channels if c.quantity == q]
    if not fitting:
        return None, "", "", None
    channel, motion = fitting[0], examined.motion
    values, angle = recording.values(channel.name), motion.driver_angle_rad
    found = angle_profile(values, angle, examined.course, motion.path.teeth[0])
    try:
        orders = stretch_order_spectrum(values, angle, examined.course, unit=channel.unit, source=channel.name)
    except RefusalError:  # no stretch holds a revolution
        return found, channel.name, channel.unit, None
    return found, channel.name, channel.unit, orders
