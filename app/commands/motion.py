"""What the commands share that read the motion of both gears: options, and reading it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from app.commands.options import open_recording
from app.quantities import quantity
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.motion.types import PairMotion
    from gearsig.recording.types import Recording
    from gearsig.rig.types import Rig

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


def open_motion(
    recording: Path,
    machine: Rig | None,
    fs: float | None,
    use: Sequence[str] | None,
    bandwidth: str | None,
    unwrap: bool,
) -> tuple[Recording, PairMotion]:
    """Read a recording and the motion of its pair, as the options say; a machine that only stands is refused."""
    from gearsig.motion.measure import measure_motion
    from gearsig.motion.standing import check_turns

    roles, band = read_uses(use), read_bandwidth(bandwidth)
    opened = open_recording(recording, machine, fs)
    motion = measure_motion(opened, machine, use=roles, bandwidth_hz=band, unwrap=unwrap)
    check_turns(motion)
    return opened, motion


def read_uses(texts: Sequence[str] | None) -> dict[str, str]:
    """Return role → channel of "driven angle=enc2"; the channel may hold "=" itself."""
    found = {}
    for text in texts or ():
        role, sign, channel = text.partition("=")
        if not sign:
            raise InputError(
                f"--use is {text!r}", allowed="ROLE=CHANNEL", remedy='write for example "driven angle=enc2"'
            )
        found[role.strip()] = channel.strip()
    return found


def read_bandwidth(text: str | None) -> float | None:
    """Return it in Hz."""
    return quantity(text, "Hz", "--bandwidth") if text else None
