"""Which channel of the simulation belongs to which of the recording, and in what unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gearsig.errors import InputError, RefusalError
from gearsig.recording.quality import find_problems
from gearsig.recording.si_units import SI_FACTORS
from gearsig.recording.types import Channel, Recording


@dataclass(frozen=True)
class ChannelPair:
    """Two channels that measure the same.

    Parameters
    ----------
    simulated, recorded : str
    quantity : str
    unit : str
        The recording's; empty where either is not known.
    factor : float
        The simulation's values times this are in `unit`.
    levels_compare : bool
        Whether both units are known.
    """

    simulated: str
    recorded: str
    quantity: str
    unit: str
    factor: float
    levels_compare: bool


def pair_channels(
    simulated: Recording, recorded: Recording, channels: Sequence[tuple[str, str]] = ()
) -> tuple[ChannelPair, ...]:
    """Return the channels that are compared: those named, else those of equal names, else the only one of each.

    Raises
    ------
    InputError
        If it is not clear which belong together, or two measure different things.
    """
    names = dict.fromkeys(channels) if channels else _by_name(simulated, recorded)
    return tuple(
        _pair(simulated.channels[simulated.index(own)], recorded.channels[recorded.index(other)])
        for own, other in names
    )


def _by_name(simulated: Recording, recorded: Recording) -> list[tuple[str, str]]:
    own, other = simulated.vibration_names(), recorded.vibration_names()
    for side, names in (("simulation", own), ("recording", other)):
        if not names:
            raise InputError(
                f"the {side} has no vibration channel",
                allowed="a channel of acceleration, velocity, displacement, sound pressure, force or torque",
                remedy="state the quantity in the rig file's [[sensor]] tables",
            )
    common = [(name, name) for name in other if name in own]
    if common:
        return common
    if len(own) == len(other) == 1:
        return [(own[0], other[0])]
    raise InputError(
        f"no channel names agree: the simulation has {', '.join(own)}; the recording has {', '.join(other)}",
        remedy=f'say which belong together, e.g. --channel "{own[0]}={other[0]}"',
    )


def _pair(own: Channel, other: Channel) -> ChannelPair:
    names = f"channels {own.name!r} of the simulation and {other.name!r} of the recording"
    for channel in (own, other):
        if not channel.is_vibration:
            raise InputError(
                f"channel {channel.name!r} is a {channel.quantity.replace('_', ' ')}", allowed="a vibration channel"
            )
    if "unknown" not in (own.quantity, other.quantity) and own.quantity != other.quantity:
        raise InputError(
            f"{names} measure different things: {own.quantity.replace('_', ' ')} and "
            f"{other.quantity.replace('_', ' ')}",
            allowed="the same quantity",
            remedy="compare other channels with --channel, or integrate one of them first",
        )
    quantity = other.quantity if other.quantity != "unknown" else own.quantity
    known = bool(own.unit and other.unit)
    factor = _factor(own.unit, other.unit, quantity) if known else 1.0
    if factor is None:
        raise InputError(
            f"{names} are in {own.unit} and {other.unit}",
            allowed="the same unit, or two of one quantity",
            remedy="state unit and scale in the rig file's [[sensor]] tables",
        )
    return ChannelPair(own.name, other.name, quantity, other.unit if known else "", factor, known)


def _factor(own: str, other: str, quantity: str) -> float | None:
    if own == other:
        return 1.0
    for name in (quantity,) if quantity != "unknown" else tuple(SI_FACTORS):
        units = SI_FACTORS.get(name, {})
        if own in units and other in units:
            return units[own] / units[other]
    return None


def check_live(recording: Recording, channels: Sequence[str], which: str) -> None:
    """Refuse dead channels: their level is that of nothing.

    Raises
    ------
    RefusalError
    """
    for problem in find_problems(recording):
        if problem.kind == "dead" and problem.channel in channels:
            raise RefusalError(
                f"channel {problem.channel} of the {which} is dead ({problem.evidence})",
                remedy="check sensor, cable and input, or name other channels with --channel SIM=RECORDED",
            )
