"""Fittings of a pair beyond its parameters: names of shafts, bearings, sensors, housing, tachometer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, pi, sin
from typing import Any

from gearsig.checks import count, one_of, positive, within
from gearsig.errors import InputError
from gearsig.rig import Bearing, Rig, TachometerChannel, from_table, to_table

N_BEARINGS = 4
DIRECTIONS = ("vertical", "horizontal")
MAX_SENSORS, MAX_MODES = 8, 32


@dataclass(frozen=True)
class SensorSeat:
    """An accelerometer over one of the four bearings.

    Parameters
    ----------
    channel : str
    bearing : int
        1 to 4: two on the driver's shaft, then two on the driven shaft.
    direction : str
        "vertical" or "horizontal".
    position : str
        For the reader of the recording.
    """

    channel: str
    bearing: int
    direction: str = "vertical"
    position: str = ""

    def __post_init__(self) -> None:
        count(self.bearing, "bearing of a sensor", maximum=N_BEARINGS)
        one_of(self.direction, "direction of a sensor", DIRECTIONS)


@dataclass(frozen=True)
class HousingMode:
    """A mode of the housing between the bearings and the sensors.

    Parameters
    ----------
    frequency_hz, damping_ratio : float
        Of the vertical mode; the horizontal one has a lower frequency.
    gain : float
        Static gain at shape 1.
    shape : tuple of four floats
        At bearings 1 to 4.
    """

    frequency_hz: float
    damping_ratio: float
    gain: float
    shape: tuple[float, float, float, float]

    def __post_init__(self) -> None:
        within(self.frequency_hz, "frequency_hz of a housing mode", 1.0, 1e5, "Hz")
        within(self.damping_ratio, "damping_ratio of a housing mode", 1e-3, 1.0)
        if len(self.shape) != N_BEARINGS or not all(isfinite(v) for v in (self.gain, *self.shape)):
            raise InputError(
                f"gain {self.gain}, shape {self.shape}", where="housing mode", allowed="finite, 4 bearings"
            )


@dataclass(frozen=True)
class Pickup:
    """The tachometer: its channel, and the side whose shaft carries its disc (0: driver)."""

    channel: str = "tacho"
    side: int = 0
    pulses_per_revolution: int = 1

    def __post_init__(self) -> None:
        within(self.side, "side of the tachometer", 0, 1)
        count(self.pulses_per_revolution, "pulses_per_revolution", maximum=1024)


@dataclass(frozen=True)
class Installed:
    """The fittings of one machine.

    Parameters
    ----------
    shafts : (str, str)
        Names of the driver's and the driven shaft.
    bearings : tuple of four Bearing
        With geometry: the first two on the driver's shaft.
    sensors : tuple of SensorSeat
    modes : tuple of HousingMode
    pickup : Pickup
    """

    shafts: tuple[str, str]
    bearings: tuple[Bearing, Bearing, Bearing, Bearing]
    sensors: tuple[SensorSeat, ...]
    modes: tuple[HousingMode, ...] = ()
    pickup: Pickup = Pickup()

    def __post_init__(self) -> None:
        if len(set(self.shafts)) != 2 or not all(self.shafts):
            raise InputError(f"shafts {self.shafts}", allowed="two different names")
        if len(self.bearings) != N_BEARINGS or len({b.name for b in self.bearings}) != N_BEARINGS:
            raise InputError(f"bearings {', '.join(b.name for b in self.bearings)}", allowed="four different names")
        if len(self.modes) > MAX_MODES or not 1 <= len(self.sensors) <= MAX_SENSORS:
            raise InputError(
                f"{len(self.sensors)} sensors and {len(self.modes)} housing modes",
                allowed=f"1 to {MAX_SENSORS} sensors, at most {MAX_MODES} modes",
            )
        channels = [*(s.channel for s in self.sensors), self.pickup.channel]
        if len(set(channels)) != len(channels) or not all(channels):
            raise InputError(f"channels {', '.join(channels)}", allowed="names, each once")
        for number, bearing in enumerate(self.bearings):
            if bearing.shaft != self.shafts[number // 2]:
                raise InputError(
                    f"bearing {bearing.name!r} is on shaft {bearing.shaft!r}", allowed=f"{self.shafts[number // 2]!r}"
                )
            positive(bearing.n_rolling_elements or 0, f"n_rolling_elements of bearing {bearing.name!r}")


# A machine's fittings as a table of a preset file and back; files are not trusted.

_LISTS = {"bearings": Bearing, "sensors": SensorSeat, "modes": HousingMode}
_KEYS = ("shafts", "pickup", *_LISTS)
_PLACE = "[installed]"


def table_of(installed: Installed) -> dict[str, Any]:
    """Return the fittings as plain tables; `installed_of` reads them back."""
    lists = {name: [to_table(item) for item in getattr(installed, name)] for name in _LISTS}
    return {"shafts": list(installed.shafts), "pickup": to_table(installed.pickup), **lists}


def installed_of(table: Mapping[str, Any]) -> Installed:
    """Read fittings from plain tables.

    Raises
    ------
    InputError
        If a key is missing or unknown, or a value is not allowed.
    """
    if set(table) != set(_KEYS):
        raise InputError(f"has the keys {', '.join(map(str, table))}", where=_PLACE, allowed=", ".join(_KEYS))
    shafts = table["shafts"]
    if not isinstance(shafts, list) or len(shafts) != 2 or not all(isinstance(name, str) for name in shafts):
        raise InputError(f"shafts is {shafts!r}", where=_PLACE, allowed="two names")
    lists = {name: _items(kind, table[name], f"[[installed.{name}]]") for name, kind in _LISTS.items()}
    return Installed((shafts[0], shafts[1]), pickup=from_table(Pickup, table["pickup"], "[installed.pickup]"), **lists)


def _items(kind: type, rows: object, where: str) -> tuple[Any, ...]:
    if not isinstance(rows, list):
        raise InputError("is not a list of tables", where=where)
    return tuple(from_table(kind, row, f"{where} {i}") for i, row in enumerate(rows, 1))


# Assignment of a rig's bearings and sensors to the model's positions.

BALLS, BALL_MM, PITCH_MM = 9, 7.94, 39.04
"""A usual bearing of a machine of size 1."""
USUAL_SPLIT = 0.4
"""BPFO over the number of elements, where only one order is known."""
SEAT_ORDER = (1, 3, 2, 4)
"""Bearings assigned in turn to sensors without a stated position."""
MAX_RIG_SENSORS = 4
UNLISTED = "unlisted bearing"
MIN_PULSES = 4
"""Pulses per revolution if the rig has no tachometer: the speed is well known, but no pulse marks a tooth."""


def installed_of_rig(rig: Rig, size: float, modes: Sequence[HousingMode], used: Sequence[str] = ()) -> Installed:
    """Return the rig's shafts, bearings, sensors and tachometer, completed with those usual for the size.

    Parameters
    ----------
    rig : Rig
        With one gear pair.
    size : float
        See `sims.machine.Nominal.size`.
    modes : sequence of HousingMode
    used : sequence of str
        Bearings that must be included: a shaft of the model has only two.
    """
    pair = rig.pairs[0]
    shafts = (pair.driver, pair.driven)
    bearings: list[Bearing] = []
    for side in range(2):
        of_shaft = sorted((b for b in rig.bearings if b.shaft == shafts[side]), key=lambda b: b.name not in used)[:2]
        bearings += [completed_bearing(b, size) for b in of_shaft]
        bearings += [_spare(rig, shafts[side], 2 * side + n + 1, size) for n in range(len(of_shaft), 2)]
    pickup = _pickup(rig, shafts)
    return Installed(
        shafts,
        tuple(bearings),  # type: ignore[arg-type]  # four
        _sensors(rig, bearings, pickup.channel),
        tuple(modes),
        pickup,
    )


def completed_bearing(bearing: Bearing, size: float) -> Bearing:
    """Return a bearing with a geometry that gives its orders; a usual geometry if nothing is known.

    n = BPFO + BPFI and d/D = (BPFI − BPFO)/n, with contact angle 0.
    """
    if bearing.n_rolling_elements is not None:
        return bearing
    outer, inner = bearing.bpfo_order, bearing.bpfi_order
    n, share = BALLS, BALL_MM / PITCH_MM
    if outer is not None and inner is not None:
        n = max(round(outer + inner), 3)
        share = (inner - outer) / n
    elif outer is not None or inner is not None:
        n = max(round((outer or 0.0) / USUAL_SPLIT or (inner or 0.0) / (1.0 - USUAL_SPLIT)), 3)
        share = 1.0 - 2.0 * outer / n if outer is not None else 2.0 * (inner or 0.0) / n - 1.0
    pitch = PITCH_MM * size
    ball = min(max(share, 0.05), 0.9 * sin(pi / n)) * pitch  # at sin π/n the elements touch each other
    return replace(bearing, n_rolling_elements=n, rolling_element_diameter_mm=ball, pitch_diameter_mm=pitch)


def _spare(rig: Rig, shaft: str, number: int, size: float) -> Bearing:
    """A healthy bearing that the rig does not list."""
    name = f"{UNLISTED} {number}"
    while name in {b.name for b in rig.bearings}:
        name += "'"
    return Bearing(name, shaft, BALLS, BALL_MM * size, PITCH_MM * size)


def _pickup(rig: Rig, shafts: tuple[str, str]) -> Pickup:
    source = rig.speed
    shaft = (source.shaft if source is not None else "") or rig.reference_shaft
    side = shafts.index(shaft) if shaft in shafts else 0
    if isinstance(source, TachometerChannel):
        return Pickup(source.channel, side, min(source.pulses_per_revolution, 1024))
    name = "tacho"
    while name in {sensor.channel for sensor in rig.sensors}:
        name += "'"
    return Pickup(name, side, MIN_PULSES)


def _sensors(rig: Rig, bearings: Sequence[Bearing], tacho: str) -> tuple[SensorSeat, ...]:
    """Return a seat for each of the rig's accelerometers: by its position, or else one bearing after another."""
    rig_sensors = [s for s in rig.sensors if s.quantity == "acceleration" and s.channel != tacho][:MAX_RIG_SENSORS]
    if not rig_sensors:
        rig_channels = {s.channel for s in rig.sensors} | {tacho}
        names = [n for n in ("a1", "a2", "a3", "a4") if n not in rig_channels][:2]
        return tuple(SensorSeat(name, number) for name, number in zip(names, SEAT_ORDER, strict=False))
    places: list[tuple[int, str]] = []
    seats = []
    for sensor in rig_sensors:
        direction = "horizontal" if "horizontal" in sensor.position.lower() else "vertical"
        likely = [*_near(sensor.position.lower(), bearings), *SEAT_ORDER]
        number = next((n for n in likely if (n, direction) not in places), likely[0])
        places.append((number, direction))
        seats.append(SensorSeat(sensor.channel, number, direction, sensor.position))
    return tuple(seats)


def _near(position: str, bearings: Sequence[Bearing]) -> list[int]:
    """Numbers of the bearings that a sensor's position may refer to: by the bearing's name, or else the shaft's."""
    by_bearing = [n for n, b in enumerate(bearings, 1) if b.name.lower() in position]
    by_shaft = [n for n, b in enumerate(bearings, 1) if b.shaft.lower() in position]
    return by_bearing or by_shaft


def further_seats(installed: Installed) -> tuple[SensorSeat, ...]:
    """Return vertical sensors over the bearings that have none."""
    occupied = {seat.bearing for seat in installed.sensors}
    names = {seat.channel for seat in installed.sensors} | {installed.pickup.channel}
    seats = []
    for number, bearing in enumerate(installed.bearings, 1):
        if number not in occupied:
            name = f"further {number}"
            while name in names:
                name += "'"
            seats.append(SensorSeat(name, number, "vertical", f"{_bearing_description(bearing, number)}, vertical"))
    return tuple(seats[: MAX_SENSORS - len(installed.sensors)])


def _bearing_description(bearing: Bearing, number: int) -> str:
    shaft = bearing.shaft if "shaft" in bearing.shaft.lower() else f"the {bearing.shaft} shaft"
    if bearing.name.startswith(UNLISTED):
        return f"the {'free' if number % 2 == 0 else 'drive'} end of {shaft}"
    name = bearing.name if "bearing" in bearing.name.lower() else f"bearing {bearing.name}"
    return f"{name} on {shaft}"
