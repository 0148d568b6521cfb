"""One record prepared for comparison: its shafts' angles, its channels over them, and both halves of revolutions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray, listed, short
from gearsig.errors import InputError, RefusalError, options_named
from gearsig.orders import first_whole_sample
from gearsig.prepared import PreparedRecording
from gearsig.recording import Channel, Recording
from gearsig.rig import SI_FACTORS, ConstantSpeed, PulseTimes, Rig, SpeedSource, si_factor

MIN_REVOLUTIONS = 8
"""Of a shaft: four in each half. Fewer leave other shafts' orders in its average, and give no measure of scatter."""


SIMULATION_OPTIONS = {"--fs": "--sim-fs", "--speed-rpm": "--sim-speed-rpm", "--rig": "--sim-rig"}
"""Options of the command line → the corresponding options of the simulation."""


@dataclass(frozen=True)
class ComparedSide:
    """One record of a comparison.

    Parameters
    ----------
    recording : Recording
        Only the compared channels, in the common unit.
    angle : ShaftAngle
        Of the shaft to which the result's orders refer.
    signals : mapping
        Shaft (as in the recording's rig) → its signals of the first and of the second half.
    marked : frozenset of str
        Shafts whose angle counts from a mark of their own.
    """

    recording: Recording
    angle: ShaftAngle
    signals: Mapping[str, tuple[AngleSignal, AngleSignal]]
    marked: frozenset[str]


def make_side(
    prepared: PreparedRecording,
    channels: Mapping[str, float],
    names: Mapping[str, str],
    ratios: Mapping[str, float],
    side_name: str,
) -> ComparedSide:
    """Sample a record's channels over each shaft's angle, and cut them into halves.

    Parameters
    ----------
    prepared : PreparedRecording
        With the rig of this side.
    channels : mapping
        Name → factor that converts its values to the unit of the comparison.
    names : mapping
        Name of the shaft in the result → name in this side's rig.
    ratios : mapping
        Name of the shaft in the result → its revolutions per revolution of the first one.
    side_name : str
        "simulation" or "recording".

    Raises
    ------
    RefusalError
        If the speed cannot be determined, or the reference shaft makes too few revolutions.
    """
    recording, rig = prepared.recording, prepared.rig
    reference = next(iter(ratios))
    reference_ratio = _reference_ratio(prepared, names.get(reference, reference), side_name)
    signals: dict[str, tuple[AngleSignal, AngleSignal]] = {}
    for shaft, ratio in ratios.items():
        place = (names.get(shaft, shaft), ratio * reference_ratio)
        n_revolutions = prepared.angle_of(place[0], ratio=place[1], followed=True).n_revolutions
        if n_revolutions < MIN_REVOLUTIONS:
            if shaft != reference:
                continue
            raise RefusalError(
                f"the {side_name} holds {n_revolutions:.3g} revolutions of shaft {shaft or 'of reference'}, "
                f"{MIN_REVOLUTIONS} are needed",
                remedy="make it longer",
            )
        halved = halves(
            _scaled(prepared.over_angle(place[0], tuple(channels), ratio=place[1], followed=True), channels)
        )
        if halved is not None:
            signals[shaft] = halved
    if reference not in signals:
        raise RefusalError(f"the {side_name} holds too few whole revolutions", remedy="make it longer")
    rows = [recording.index(name) for name in channels]
    factors = np.array(list(channels.values()))[:, None]
    return ComparedSide(
        replace(
            recording, samples=recording.samples[rows] * factors, channels=tuple(recording.channels[i] for i in rows)
        ),
        prepared.angle_of(names.get(reference, reference), ratio=reference_ratio, followed=True),
        signals,
        frozenset(shaft for shaft in signals if rig.shafts and prepared.has_mark(names.get(shaft, shaft))),
    )


def _reference_ratio(prepared: PreparedRecording, shaft: str, side_name: str) -> float:
    """Return the revolutions of the shaft to which orders refer, per revolution of this side's reference shaft."""
    try:
        with options_named(SIMULATION_OPTIONS if side_name == "simulation" else {}):
            angle = prepared.followed_angle
    except RefusalError as refusal:
        raise RefusalError(
            f"the speed of the {side_name} is not known: {refusal.reason}", remedy=refusal.remedy
        ) from None
    ratio = prepared.rig.ratio(shaft, to=angle.shaft) if shaft and angle.shaft else 1.0
    if ratio is None:
        raise RefusalError(
            f"the speed of shaft {shaft!r} does not follow from the teeth of the {side_name}'s rig",
            remedy="complete the tooth counts",
        )
    return ratio


def _scaled(signal: AngleSignal, channels: Mapping[str, float]) -> AngleSignal:
    if all(factor == 1.0 for factor in channels.values()):
        return signal
    return replace(signal, samples=signal.samples * np.array(list(channels.values()))[:, None])


def halves(signal: AngleSignal) -> tuple[AngleSignal, AngleSignal] | None:
    """Cut a signal into two halves of equally many whole revolutions; None with fewer than four in each."""
    per_rev = signal.samples_per_revolution
    start, revolution = first_whole_sample(signal)
    n_rev = (signal.samples.shape[1] - start) // per_rev // 2
    if n_rev < MIN_REVOLUTIONS // 2:
        return None
    middle, end = start + n_rev * per_rev, start + 2 * n_rev * per_rev
    first = replace(signal, samples=signal.samples[:, start:middle], start_revolution=float(revolution))
    second = replace(signal, samples=signal.samples[:, middle:end], start_revolution=float(revolution + n_rev))
    return first, second


def time_halves(recording: Recording, row: int) -> tuple[FloatArray, FloatArray]:
    """Return both halves of a channel's samples, each (n_samples // 2,), without the record's mean."""
    n = recording.n_samples // 2
    values = np.asarray(recording.samples[row], dtype=np.float64)
    values = values - values.mean()
    return values[:n], values[n : 2 * n]


@dataclass(frozen=True)
class ChannelPair:
    """Two channels that measure the same quantity.

    Parameters
    ----------
    simulated, recorded : str
    quantity : str
    unit : str
        The recording's unit; empty if either is unknown.
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
    """Return the channels to compare: those named, else those with equal names, else the only one of each.

    Raises
    ------
    InputError
        If it is unclear which belong together, or two measure different quantities.
    """
    for place, pair in enumerate(listed(channels, "channels", tuple | list)):
        if len(listed(pair, f"channels[{place}]", str)) != 2:
            raise InputError(f"channels[{place}] is {short(pair)}", allowed="a pair: (simulated, recorded)")
    names = dict.fromkeys(map(tuple, channels)) if channels else _by_name(simulated, recorded)
    return tuple(
        _pair(simulated.channels[simulated.index(simulated_name)], recorded.channels[recorded.index(recorded_name)])
        for simulated_name, recorded_name in names
    )


def _by_name(simulated: Recording, recorded: Recording) -> list[tuple[str, str]]:
    simulated_names, recorded_names = simulated.vibration_names(), recorded.vibration_names()
    for side, names in (("simulation", simulated_names), ("recording", recorded_names)):
        if not names:
            raise InputError(
                f"the {side} has no vibration channel",
                allowed="a channel of acceleration, velocity, displacement, sound pressure, force or torque",
                remedy="state the quantity in the rig file's [[sensor]] tables",
            )
    common = [(name, name) for name in recorded_names if name in simulated_names]
    if common:
        return common
    if len(simulated_names) == len(recorded_names) == 1:
        return [(simulated_names[0], recorded_names[0])]
    raise InputError(
        f"no channel names agree: the simulation has {', '.join(simulated_names)}; the recording has "
        f"{', '.join(recorded_names)}",
        remedy=f'say which belong together, e.g. --channel "{simulated_names[0]}={recorded_names[0]}"',
    )


def _pair(simulated: Channel, recorded: Channel) -> ChannelPair:
    names = f"channels {simulated.name!r} of the simulation and {recorded.name!r} of the recording"
    for channel in (simulated, recorded):
        if not channel.is_vibration:
            raise InputError(
                f"channel {channel.name!r} is a {channel.quantity.replace('_', ' ')}", allowed="a vibration channel"
            )
    if "unknown" not in (simulated.quantity, recorded.quantity) and simulated.quantity != recorded.quantity:
        raise InputError(
            f"{names} measure different things: {simulated.quantity.replace('_', ' ')} and "
            f"{recorded.quantity.replace('_', ' ')}",
            allowed="the same quantity",
            remedy="compare other channels with --channel, or integrate one of them first",
        )
    quantity = recorded.quantity if recorded.quantity != "unknown" else simulated.quantity
    known = bool(simulated.unit and recorded.unit)
    factor = _factor(simulated.unit, recorded.unit, quantity) if known else 1.0
    if factor is None:
        raise InputError(
            f"{names} are in {simulated.unit} and {recorded.unit}",
            allowed="the same unit, or two of one quantity",
            remedy="state unit and scale in the rig file's [[sensor]] tables",
        )
    return ChannelPair(simulated.name, recorded.name, quantity, recorded.unit if known else "", factor, known)


def _factor(unit: str, target_unit: str, quantity: str) -> float | None:
    if unit == target_unit:
        return 1.0
    for name in (quantity,) if quantity != "unknown" else tuple(SI_FACTORS):
        given, target = si_factor(name, unit), si_factor(name, target_unit)
        if given is not None and target is not None:
            return given / target
    return None


def check_live(side: PreparedRecording, channels: Sequence[str], side_name: str) -> tuple[str, ...]:
    """Refuse dead channels, whose level means nothing; return the problems of the others as texts.

    Raises
    ------
    RefusalError
    """
    problems = side.grave_problems(channels)
    for problem in problems:
        if problem.kind == "dead":
            raise RefusalError(
                f"channel {problem.channel} of the {side_name} is dead ({problem.evidence})",
                remedy="check sensor, cable and input, or name other channels with --channel SIM=RECORDED",
            )
    return tuple(f"The {side_name}: {p.text}; what differs may be no more than that." for p in problems)


def common_machine(
    simulated: Recording, recorded: Recording, rig: Rig | None
) -> tuple[Rig, Rig, dict[str, str], list[str]]:
    """Return the rigs of both sides after checking that they have the same gears.

    A side without a rig takes the other's gears, but not its sensors and tachometer, which belong to a measurement. A
    simulation that states no speed takes the rig's, if that is constant.

    Returns
    -------
    (Rig, Rig, dict, list of str)
        The rigs of the simulation and of the recording, whose orders are used, empty if nothing is known; the shafts'
        names in the first by those in the second; notes for the reader.

    Raises
    ------
    InputError
        If the teeth differ, or it is unclear which shafts of the two rigs are the same.
    """
    notes: list[str] = []
    simulated_rig = simulated.rig if simulated.rig is not None and simulated.rig.shafts else None
    recorded_rig = rig if rig is not None else recorded.rig
    if recorded_rig is None or not recorded_rig.shafts:
        if simulated_rig is not None:
            notes.append("The recording has no rig: its gears are taken to be the simulation's.")
        recorded_rig = (
            gears_only(simulated_rig, recorded.speed_source) if simulated_rig is not None else (recorded_rig or Rig())
        )
    if simulated_rig is None:
        simulated_rig = for_simulation(recorded_rig, simulated.speed_source)
    if (
        isinstance(simulated_rig.speed, ConstantSpeed)
        and simulated_rig.speed == recorded_rig.speed
        and simulated.speed is None
    ):
        rpm = f"{simulated_rig.speed.speed_rpm:g} rpm"
        notes.append(f"The simulation has no tachometer: it is taken to run at {rpm}, as the rig file says.")
    return simulated_rig, recorded_rig, _shaft_names(simulated_rig, recorded_rig), notes


def gears_only(rig: Rig, speed: SpeedSource | None = None) -> Rig:
    """Return a rig's machine data, without its measurement; with another speed source."""
    if speed is not None and speed.shaft and speed.shaft not in rig.shaft_names:
        speed = None
    return replace(rig, sensors=(), speed=speed, sampling_rate_hz=None)


def for_simulation(rig: Rig, speed: SpeedSource | None = None) -> Rig:
    """Return the part of the recording's rig that applies to a simulation without a rig of its own.

    That includes its sampling rate, for a file that states none.
    """
    stated = rig.speed if isinstance(rig.speed, ConstantSpeed) else None
    machine = gears_only(rig, speed if speed is not None else stated)
    return replace(machine, sampling_rate_hz=rig.sampling_rate_hz)


def usable_speed(rig: Rig, recording: Recording) -> SpeedSource | None:
    """Return a rig's speed source if the recording has what it needs: nothing for a constant speed, or a channel."""
    source = rig.speed
    if source is None or isinstance(source, ConstantSpeed):
        return source
    if isinstance(source, PulseTimes):
        return None
    return source if source.channel in recording.channel_names else None


def _shaft_names(simulated: Rig, recorded: Rig) -> dict[str, str]:
    if not simulated.pairs or not recorded.pairs:
        if set(simulated.shaft_names) == set(recorded.shaft_names):
            return {name: name for name in recorded.shaft_names}
        if len(simulated.shafts) == len(recorded.shafts) == 1:
            return {recorded.shafts[0].name: simulated.shafts[0].name}
    if len(simulated.pairs) != len(recorded.pairs) or not simulated.pairs:
        raise InputError(
            f"the simulation's rig has {_gears(simulated)}, the recording's {_gears(recorded)}",
            allowed="the same machine on both sides",
            remedy="give the simulation the recording's rig file",
        )
    names: dict[str, str] = {}
    for mine, theirs in zip(simulated.pairs, recorded.pairs, strict=True):
        for a, b in ((mine.driver_teeth, theirs.driver_teeth), (mine.driven_teeth, theirs.driven_teeth)):
            if a is not None and b is not None and a != b:
                raise InputError(
                    f"the simulation is of other gears: {_gears(simulated)}, the recording's rig has "
                    f"{_gears(recorded)}",
                    allowed="the same teeth, pair by pair",
                    remedy="simulate with the recording's teeth (--set teeth_driver=…), or correct the rig file",
                )
        names[theirs.driver], names[theirs.driven] = mine.driver, mine.driven
    return names


def _gears(rig: Rig) -> str:
    if not rig.pairs:
        return f"no gears, shafts {', '.join(rig.shaft_names) or 'none'}"
    return f"{rig.teeth_text} teeth"
