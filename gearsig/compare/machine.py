"""The machine that both records are of: the recording's rig, and the names its shafts have in the simulation's."""

from __future__ import annotations

from dataclasses import dataclass, replace

from gearsig.errors import InputError
from gearsig.recording.types import Recording
from gearsig.rig.speed import ConstantSpeed, PulseTimes, SpeedSource
from gearsig.rig.types import Rig


@dataclass(frozen=True)
class Machine:
    """Both sides' rigs.

    Parameters
    ----------
    simulated, recorded : Rig
        Empty where nothing is known. Orders are counted as in `recorded`.
    names : dict
        Of shafts: as in the recording's rig → as in the simulation's.
    notes : tuple of str
    """

    simulated: Rig
    recorded: Rig
    names: dict[str, str]
    notes: tuple[str, ...]


def common_machine(simulated: Recording, recorded: Recording, rig: Rig | None) -> Machine:
    """Return the rigs of both sides after checking that they have the same gears.

    A side without a rig takes the other's gears, but not its sensors and its tachometer: those belong to a measurement.
    A simulation that states no speed takes the rig's, where that is constant.

    Raises
    ------
    InputError
        If the teeth differ, or the shafts of two rigs cannot be told to be the same.
    """
    notes: list[str] = []
    own = simulated.rig if simulated.rig is not None and simulated.rig.shafts else None
    other = rig if rig is not None else recorded.rig
    if other is None or not other.shafts:
        if own is not None:
            notes.append("The recording has no rig: its gears are taken to be the simulation's.")
        other = gears_only(own, recorded.speed_source) if own is not None else (other or Rig())
    if own is None:
        own = for_simulation(other, simulated.speed_source)
    if isinstance(own.speed, ConstantSpeed) and own.speed == other.speed and simulated.speed is None:
        rpm = f"{own.speed.speed_rpm:g} rpm"
        notes.append(f"The simulation has no tachometer: it is taken to run at {rpm}, as the rig file says.")
    return Machine(own, other, _shaft_names(own, other), tuple(notes))


def gears_only(rig: Rig, speed: SpeedSource | None = None) -> Rig:
    """Return what a rig says of the machine, without its measurement; with another speed source."""
    if speed is not None and speed.shaft and speed.shaft not in rig.shaft_names:
        speed = None
    return replace(rig, sensors=(), speed=speed, sampling_rate_hz=None)


def for_simulation(rig: Rig, speed: SpeedSource | None = None) -> Rig:
    """Return what the recording's rig says of a simulation without a rig of its own."""
    stated = rig.speed if isinstance(rig.speed, ConstantSpeed) else None
    return gears_only(rig, speed if speed is not None else stated)


def usable_speed(rig: Rig, recording: Recording) -> SpeedSource | None:
    """Return a rig's speed source if the recording has what it names: a constant speed, or a channel."""
    source = rig.speed
    if source is None or isinstance(source, ConstantSpeed):
        return source
    if isinstance(source, PulseTimes):
        return None
    return source if source.channel in recording.channel_names else None


def teeth_on(rig: Rig, shaft: str) -> int | None:
    """Return the teeth of the first gear on a shaft whose teeth are known."""
    gears = (pair.teeth(shaft) for pair in rig.pairs if shaft in (pair.driver, pair.driven))
    return next((teeth for teeth in gears if teeth is not None), None)


def _shaft_names(own: Rig, other: Rig) -> dict[str, str]:
    if not own.pairs or not other.pairs:
        if set(own.shaft_names) == set(other.shaft_names):
            return {name: name for name in other.shaft_names}
        if len(own.shafts) == len(other.shafts) == 1:
            return {other.shafts[0].name: own.shafts[0].name}
    if len(own.pairs) != len(other.pairs) or not own.pairs:
        raise InputError(
            f"the simulation's rig has {_gears(own)}, the recording's {_gears(other)}",
            allowed="the same machine on both sides",
            remedy="give the simulation the recording's rig file",
        )
    names: dict[str, str] = {}
    for mine, theirs in zip(own.pairs, other.pairs, strict=True):
        for a, b in ((mine.driver_teeth, theirs.driver_teeth), (mine.driven_teeth, theirs.driven_teeth)):
            if a is not None and b is not None and a != b:
                raise InputError(
                    f"the simulation is of other gears: {_gears(own)}, the recording's rig has {_gears(other)}",
                    allowed="the same teeth, pair by pair",
                    remedy="simulate with the recording's teeth (--set teeth_driver=…), or correct the rig file",
                )
        names[theirs.driver], names[theirs.driven] = mine.driver, mine.driven
    return names


def _gears(rig: Rig) -> str:
    if not rig.pairs:
        return f"no gears, shafts {', '.join(rig.shaft_names) or 'none'}"
    return ", ".join(f"{p.driver_teeth or '?'}/{p.driven_teeth or '?'}" for p in rig.pairs) + " teeth"
