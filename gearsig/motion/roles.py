"""Which channel measures which motion of which gear."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint
from gearsig.errors import InputError
from gearsig.recording.types import Channel, Recording
from gearsig.rig.speed import EncoderChannel
from gearsig.rig.types import GearPair, Rig

QUANTITY_OF = {
    "angle": ("angle", "encoder"),
    "speed": ("rotational_speed",),
    "acceleration": ("angular_acceleration",),
}
SIDES = ("driver", "driven")
ROLES = (*(f"{side} {what}" for what in QUANTITY_OF for side in SIDES), "torque", "force")
"""What a channel can be: angle, speed and acceleration of either gear, torque of the driver's shaft, tooth force."""

_UNITS = {
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180.0, "°": pi / 180.0, "rev": 2.0 * pi},
    "speed": {"rad/s": 1.0, "deg/s": pi / 180.0, "°/s": pi / 180.0, "rpm": pi / 30.0, "1/min": pi / 30.0,
              "r/min": pi / 30.0, "rev/s": 2.0 * pi},
    "acceleration": {"rad/s^2": 1.0, "rad/s2": 1.0, "rad/s²": 1.0, "deg/s^2": pi / 180.0, "deg/s²": pi / 180.0},
    "torque": {"nm": 1.0, "n m": 1.0, "n·m": 1.0, "n*m": 1.0, "knm": 1e3, "kn m": 1e3},
    "force": {"n": 1.0, "kn": 1e3},
}  # fmt: skip


def find_roles(recording: Recording, pair: GearPair, given: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the channel of each role that the recording has.

    A channel belongs to a gear if its position is the name of that gear's shaft, or its own name holds it (or "driver",
    "driven").

    Parameters
    ----------
    recording : Recording
    pair : GearPair
    given : mapping or None
        Role → channel, taken as they stand; an empty channel leaves the role out.

    Raises
    ------
    InputError
        If a role or channel does not exist, or several channels fit one role.
    """
    chosen = dict(given or {})
    for role, name in chosen.items():
        if role not in ROLES:
            raise InputError(
                f"there is no role {role!r}", allowed=", ".join(ROLES), remedy=closest_match_hint(role, ROLES)
            )
        if name:
            recording.index(name)
    for role in ROLES:
        fitting = [c.name for c in recording.channels if _fits(c, role, pair)]
        if role not in chosen and len(fitting) > 1:
            raise InputError(
                f"channels {', '.join(map(repr, fitting))} may all be the {role}",
                where=recording.provenance.source or "recording",
                remedy=f'say which, e.g. --use "{role}={fitting[0]}", or give positions in their [[sensor]] tables',
            )
        if role not in chosen and fitting:
            chosen[role] = fitting[0]
    return {role: chosen[role] for role in ROLES if chosen.get(role)}


def role_values(recording: Recording, rig: Rig, role: str, name: str) -> FloatArray:
    """Return a channel's values in rad, rad/s, rad/s², N m or N.

    Raises
    ------
    InputError
        If the unit is not known or measures something else.
    """
    channel = recording.channels[recording.index(name)]
    return np.asarray(recording.values(name), dtype=np.float64) * _worth(channel, rig, role.rpartition(" ")[2])


def _worth(channel: Channel, rig: Rig, what: str) -> float:
    source = rig.speed
    if what == "angle" and isinstance(source, EncoderChannel) and source.channel == channel.name:
        return 2.0 * pi / source.units_per_revolution
    known = _UNITS[what]
    unit = " ".join(channel.unit.split())
    for spelt in (unit, unit.casefold()):
        if spelt in known:
            return known[spelt]
    raise InputError(
        f"the unit of channel {channel.name!r} is {channel.unit!r}",
        allowed=", ".join(known),
        remedy="give unit (and scale) in a [[sensor]] table of the rig file",
    )


def _fits(channel: Channel, role: str, pair: GearPair) -> bool:
    side, _, what = role.rpartition(" ")
    if not side:
        return channel.quantity == what
    if channel.quantity not in QUANTITY_OF[what]:
        return False
    return side == _side_of(channel, pair)


def _side_of(channel: Channel, pair: GearPair) -> str:
    """Return "driver", "driven" or nothing; the longer name decides where one shaft's name holds the other's."""
    names = sorted(((pair.driver, "driver"), (pair.driven, "driven")), key=lambda entry: -len(entry[0]))
    for shaft, side in names:
        if channel.position == shaft:
            return side
    text = channel.name.casefold()
    for word, side in (*names, ("driven", "driven"), ("driver", "driver")):
        if word and word.casefold() in text:
            return side
    return ""
