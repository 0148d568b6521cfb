"""The machine: shafts, gear pairs, bearings, sensors, operating point. Give only what is known."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from math import isclose, pi, radians
from os import PathLike

from gearsig.checks import (
    FloatArray,
    check_texts,
    closest_match_hint,
    count,
    frozen_array,
    instance_of,
    known_name,
    listed,
    not_negative,
    number,
    one_of,
    positive,
    within,
)
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted, named, readable
from gearsig.results import verdict_html
from gearsig.rig._bearing import Bearing
from gearsig.rig._contact import PathOfContact, ToothContact, standard_path

# --------------------
# Speed ratios of all shafts, from the teeth along the gear train.
# --------------------


def known_ratio(rig: Rig | None, shaft: str, to: str = "") -> float:
    """Return revolutions of `shaft` per revolution of `to` (default: the reference shaft); see `Rig.ratio`.

    Raises
    ------
    RefusalError
        If tooth counts between the two shafts, or the whole rig, are not known.
    """
    ratio = None if rig is None else rig.ratio(shaft, to=to)
    if ratio is None:
        raise RefusalError(f"the speed of shaft {shaft!r} does not follow from the teeth", remedy="complete the rig")
    return ratio


def shaft_ratios(rig: Rig) -> dict[str, float]:
    """Return revolutions of each shaft per revolution of the reference shaft.

    Shafts that cannot be reached because a tooth count is missing are left out. Ratios are exact fractions along the
    gear train, so closed loops of pairs are checked without rounding.

    Raises
    ------
    InputError
        If the pairs form groups that share no shaft, or a closed loop of pairs contradicts itself.
    """
    if not rig.shafts:
        return {}
    known: dict[str, Fraction] = {rig.reference_shaft: Fraction(1)}
    reached = {rig.reference_shaft}
    if rig.pairs and rig.reference_shaft not in {s for p in rig.pairs for s in (p.driver, p.driven)}:
        reached = set()
    waiting = list(rig.pairs)
    while waiting:
        touching = [p for p in waiting if not reached or p.driver in reached or p.driven in reached]
        if not touching:
            names = ", ".join(repr(p.name) for p in waiting)
            raise InputError(
                f"pairs that share no shaft with the rest of the gear train: {names}",
                where="rig",
                remedy="use the same shaft name where two gears sit on one shaft, or describe two rigs",
            )
        # Pairs with a known shaft come first: the train is followed outwards and a loop is closed last.
        pair = next((p for p in touching if p.driver in known or p.driven in known), touching[0])
        waiting.remove(pair)
        reached |= {pair.driver, pair.driven}
        _follow(pair, known)
    return {name: float(ratio) for name, ratio in known.items()}


def _follow(pair: GearPair, known: dict[str, Fraction]) -> None:
    """Add the shaft at the other end of one pair, or check it if both are known."""
    driver, driven, z1, z2 = pair.driver, pair.driven, pair.driver_teeth, pair.driven_teeth
    if z1 is None or z2 is None:
        return
    ratio = Fraction(z1, z2)
    if driver in known and driven in known:
        if known[driven] != known[driver] * ratio:
            raise InputError(
                f"pair {pair.name!r} ({z1}/{z2}) contradicts the ratio of its shafts by the other pairs",
                where="rig",
                allowed=f"a ratio of {known[driven] / known[driver]}",
                remedy="check the teeth",
            )
    elif driver in known:
        known[driven] = known[driver] * ratio
    elif driven in known:
        known[driver] = known[driven] / ratio


# --------------------
# Where shaft speed and angle come from.
# --------------------


@dataclass(frozen=True)
class ConstantSpeed:
    """The speed is stated and constant."""

    speed_rpm: float
    shaft: str = ""

    def __post_init__(self) -> None:
        not_negative(self.speed_rpm, "speed_rpm", "rpm")
        check_texts(self, "shaft")


@dataclass(frozen=True)
class PulseTimes:
    """Times of tachometer pulses, on the recording's own time axis.

    Parameters
    ----------
    times_s : array, (n_pulses,)
        Validated when they are converted to speed, so that errors can name the pulses at fault.
    pulses_per_revolution : int
    shaft : str
        The shaft they are measured on; empty: the reference shaft.
    """

    times_s: FloatArray
    pulses_per_revolution: int = 1
    shaft: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "times_s", frozen_array(self.times_s, "tachometer pulse times", ndim=1))
        count(self.pulses_per_revolution, "pulses_per_revolution")
        check_texts(self, "shaft")


@dataclass(frozen=True)
class TachometerChannel:
    """A channel with tachometer pulses.

    Parameters
    ----------
    channel : str
    pulses_per_revolution : int
    threshold : float or None
        In the channel's unit; None: halfway between the low and the high level.
    hysteresis : float or None
        Full width in the channel's unit; None: a quarter of the step from low to high.
    edge : str
        "rising" or "falling".
    shaft : str
        The shaft it measures; empty: the reference shaft.
    """

    channel: str
    pulses_per_revolution: int = 1
    threshold: float | None = None
    hysteresis: float | None = None
    edge: str = "rising"
    shaft: str = ""

    def __post_init__(self) -> None:
        count(self.pulses_per_revolution, "pulses_per_revolution")
        check_texts(self, "channel", "edge", "shaft")
        for label, value in (("threshold", self.threshold), ("hysteresis", self.hysteresis)):
            if value is not None:
                number(value, f"{label} of tachometer {self.channel!r}")


@dataclass(frozen=True)
class EncoderChannel:
    """A channel with the shaft angle, either wrapping or continuous.

    Parameters
    ----------
    channel : str
    units_per_revolution : float
        360 for degrees, 2π for radians, 1 for revolutions, the line count for counts.
    wraps : bool
        Whether the angle restarts after each revolution.
    shaft : str
        The shaft it measures; empty: the reference shaft.
    """

    channel: str
    units_per_revolution: float = 360.0
    wraps: bool = True
    shaft: str = ""

    def __post_init__(self) -> None:
        positive(self.units_per_revolution, "units_per_revolution")
        check_texts(self, "channel", "shaft")


@dataclass(frozen=True)
class SpeedChannel:
    """A channel with the speed, in rpm after multiplying by `rpm_per_unit`."""

    channel: str
    rpm_per_unit: float = 1.0
    shaft: str = ""

    def __post_init__(self) -> None:
        positive(self.rpm_per_unit, "rpm_per_unit")
        check_texts(self, "channel", "shaft")


SpeedSource = ConstantSpeed | PulseTimes | TachometerChannel | EncoderChannel | SpeedChannel
"""All kinds of speed source; None means that there is none."""


def check_speed_source(value: object, name: str = "speed") -> None:
    """Raise unless the value is a speed source or None; for a number, a name or times, suggest the source meant."""
    remedy = ""
    if isinstance(value, str):
        remedy = f"a channel is named by gearsig.TachometerChannel({value!r}), SpeedChannel or EncoderChannel"
    elif isinstance(value, PathLike):
        remedy = "read pulse times first: gearsig.recording.read_pulse_times(path)"
    elif isinstance(value, int | float):
        remedy = "a constant speed is gearsig.ConstantSpeed(speed_rpm)"
    elif not isinstance(value, SpeedSource | None):
        remedy = "pulse times are gearsig.PulseTimes(times_s), a speed over time gearsig.SpeedChannel(channel)"
    instance_of(value, SpeedSource | None, name, remedy=remedy)


MAX_TEETH = 5000
"""More than any slewing ring has."""

QUANTITIES = (
    "acceleration",
    "velocity",
    "displacement",
    "sound_pressure",
    "force",
    "torque",
    "transmission_error",
    "tachometer",
    "encoder",
    "angle",
    "rotational_speed",
    "angular_acceleration",
    "temperature",
    "voltage",
    "current",
    "unknown",
)
"""What a channel may measure."""


RPM_UNITS = frozenset(("rpm", "r/min", "tr/min", "u/min", "1/min", "min^-1"))
_G, _INCH = 9.80665, 0.0254
_LENGTHS = {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "mil": 1e-3 * _INCH}
_ANGLES = {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "°": pi / 180, "rev": 2 * pi}

SI_FACTORS: dict[str, dict[str, float]] = {
    "acceleration": {
        "m/s²": 1.0,
        "ms-2": 1.0,
        "mm/s²": 1e-3,
        "µm/s²": 1e-6,
        "g": _G,
        "gn": _G,
        "g_n": _G,
        "g-s": _G,
        "mg": 1e-3 * _G,
    },
    "velocity": {"m/s": 1.0, "mm/s": 1e-3, "µm/s": 1e-6, "in/s": _INCH, "ips": _INCH},
    "displacement": _LENGTHS,
    "transmission_error": _LENGTHS,
    "sound_pressure": {"Pa": 1.0},
    "force": {"N": 1.0, "kN": 1e3},
    "torque": {"N·m": 1.0, "kN·m": 1e3},
    "rotational_speed": {
        **dict.fromkeys(sorted(RPM_UNITS), 2 * pi / 60),
        **{f"{unit}/s": factor for unit, factor in _ANGLES.items()},
    },
    "angle": _ANGLES,
    "angular_acceleration": {f"{unit}/s²": factor for unit, factor in _ANGLES.items()},
    "temperature": {"°C": 1.0, "degC": 1.0},  # for differences only: its zero is not the kelvin's
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
}
"""Quantity → unit → factor to the SI unit, for every known unit.

Each unit is listed in one spelling; `si_factor` recognises the others ("m/s^2", "m/s**2", "Nm")."""


def si_factor(quantity: str, unit: str) -> float | None:
    """Return the factor from a unit of a quantity to its SI unit; None if it is not known.

    Parameters
    ----------
    quantity : str
        One of `QUANTITIES`.
    unit : str
        In any spelling.

    Examples
    --------
    >>> si_factor("velocity", "in/s"), si_factor("acceleration", "m/s**2"), si_factor("torque", "kN m")
    (0.0254, 1.0, 1000.0)
    >>> si_factor("velocity", "g") is None
    True
    """
    return _FACTORS.get(quantity, {}).get(_plain_unit(unit))


def quantity_of_unit(unit: str) -> str | None:
    """Return the quantity that a unit in any spelling belongs to; None if it is not known.

    Examples
    --------
    >>> quantity_of_unit("m/s^2"), quantity_of_unit("furlong")
    ('acceleration', None)
    """
    return _QUANTITY_OF_UNIT.get(_plain_unit(unit))


def same_unit(first: str, second: str) -> bool:
    """Whether two units are the same, however they are spelled.

    Examples
    --------
    >>> same_unit("m/s²", "m/s^2"), same_unit("m/s2", "m/s**2"), same_unit("g", "m/s^2")
    (True, True, False)
    """
    return _plain_unit(first) == _plain_unit(second)


def _plain_unit(unit: str) -> str:
    squares = unit.strip().casefold().replace("²", "2").replace("**", "").replace("^", "")
    return re.sub(r"[\s·*]+", "", squares).replace("/s/s", "/s2").replace("μ", "µ").replace("um", "µm")


_FACTORS = {
    quantity: {_plain_unit(unit): factor for unit, factor in units.items()} for quantity, units in SI_FACTORS.items()
}
# A length is a displacement, unless a channel is said to be a transmission error.
_QUANTITY_OF_UNIT = {
    unit: quantity for quantity, units in _FACTORS.items() if quantity != "transmission_error" for unit in units
}


@dataclass(frozen=True)
class Shaft:
    """A rotating shaft.

    Parameters
    ----------
    name : str
    direction : str
        "ccw" or "cw" seen from the drive end; empty if not known.
    """

    name: str
    direction: str = ""

    def __post_init__(self) -> None:
        check_texts(self, "name")
        if self.direction:
            one_of(self.direction, f"direction of shaft {self.name!r}", ("ccw", "cw"))


SIDES = ("driver", "driven")
"""The two gears of a pair; index 0 and 1."""


@dataclass(frozen=True)
class GearPair:
    """Two gears in mesh.

    Parameters
    ----------
    name : str
    driver, driven : str
        Names of the shafts that carry the gears.
    driver_teeth, driven_teeth : int or None
        At least 3. The mesh order needs one of them; the driven shaft's order needs both.
    module_mm, face_width_mm : float or None
        Above zero.
    pressure_angle_deg : float or None
        10 to 35.
    """

    name: str
    driver: str
    driven: str
    driver_teeth: int | None = None
    driven_teeth: int | None = None
    module_mm: float | None = None
    pressure_angle_deg: float | None = None
    face_width_mm: float | None = None

    def __post_init__(self) -> None:
        check_texts(self, "name", "driver", "driven")
        for label, teeth in (("driver", self.driver_teeth), ("driven", self.driven_teeth)):
            if teeth is not None:
                remedy = "leave it out if unknown"
                count(teeth, f"{label} teeth of pair {self.name!r}", minimum=3, maximum=MAX_TEETH, remedy=remedy)
        for label, value in (("module_mm", self.module_mm), ("face_width_mm", self.face_width_mm)):
            if value is not None:
                positive(value, f"{label} of pair {self.name!r}", "mm")
        if self.pressure_angle_deg is not None:
            within(self.pressure_angle_deg, f"pressure_angle_deg of pair {self.name!r}", 10, 35, "deg")
        if self.driver == self.driven:
            raise InputError(f"pair {self.name!r} meshes shaft {self.driver!r} with itself", remedy="name two shafts")

    def teeth(self, shaft: str) -> int | None:
        """Number of teeth of the gear on `shaft`; None if not known."""
        if shaft not in (self.driver, self.driven):
            raise InputError(
                f"pair {self.name!r} has no gear on shaft {shaft!r}", allowed=f"{self.driver}, {self.driven}"
            )
        return self.driver_teeth if shaft == self.driver else self.driven_teeth


@dataclass(frozen=True)
class Sensor:
    """What a channel of the recordings measures: value = number in the file × scale + offset.

    `wraps` means that an angle restarts after each revolution.
    """

    channel: str
    quantity: str = ""
    unit: str = ""
    position: str = ""
    scale: float = 1.0
    offset: float = 0.0
    wraps: bool = False

    def __post_init__(self) -> None:
        check_texts(self, "channel", "unit", "position")
        if self.quantity:
            one_of(self.quantity, f"quantity of sensor {self.channel!r}", QUANTITIES)
        if self.unit and self.quantity in SI_FACTORS and si_factor(self.quantity, self.unit) is None:
            raise InputError(
                f"unit of sensor {self.channel!r} is {self.unit!r}",
                allowed=f"for {self.quantity}: {', '.join(SI_FACTORS[self.quantity])}",
                remedy="give one of these; scale converts the numbers in the file to it",
            )
        for label, value in (("scale", self.scale), ("offset", self.offset)):
            label_text = f"{label} of sensor {self.channel!r}"
            if number(value, label_text) == 0.0 and label == "scale":
                raise InputError(f"{label_text} is 0", allowed="a finite number, scale not 0")


MOUNTINGS = ("rigid", "flexible")
"""Machine supports as ISO 20816-3 classifies them: rigid if the lowest natural frequency of machine and foundation
together, in the direction measured, exceeds the main excitation frequency (usually the speed) by at least 25 %."""


@dataclass(frozen=True)
class MachineSize:
    """The machine's size and support, by which ISO 20816-3 rates its overall vibration.

    Parameters
    ----------
    power_kw : float or None
        Rated power.
    shaft_height_mm : float or None
        Of an electrical machine: from its feet to its shaft centreline (225 for an IEC 225 frame).
    mounting : str
        "rigid" or "flexible"; empty: not known.
    """

    power_kw: float | None = None
    shaft_height_mm: float | None = None
    mounting: str = ""

    def __post_init__(self) -> None:
        for label, value in (("power_kw", self.power_kw), ("shaft_height_mm", self.shaft_height_mm)):
            if value is not None:
                positive(value, f"{label} of the machine")
        if self.mounting:
            one_of(self.mounting, "mounting of the machine", MOUNTINGS)

    @property
    def group(self) -> int | None:
        """ISO 20816-3 group: 1 above 300 kW or from 315 mm, 2 above 15 kW or from 160 mm, else None."""
        for group, power_kw, height_mm in ((1, 300.0, 315.0), (2, 15.0, 160.0)):
            if self.shaft_height_mm is not None and self.shaft_height_mm >= height_mm:
                return group
            if self.shaft_height_mm is None and self.power_kw is not None and self.power_kw > power_kw:
                return group
        return None


STATED_SPEED_TOLERANCE_PERCENT = 6.0
"""Maximum error of a stated speed from which the shaft's lines still give the true one: the slip of a small motor."""


@dataclass(frozen=True)
class OperatingPoint:
    """The nominal operating condition; its speed guides the search for the true speed and is not taken as measured.

    Without gears, whose mesh lines would give the speed, it counts as stated: see `Rig.speed_source`.
    """

    shaft: str = ""
    speed_rpm: float | None = None
    speed_tolerance_percent: float = 5.0
    torque_nm: float | None = None

    def __post_init__(self) -> None:
        if self.speed_rpm is not None:
            not_negative(self.speed_rpm, "operating_point.speed_rpm", "rpm")
        within(self.speed_tolerance_percent, "operating_point.speed_tolerance_percent", 0.01, 90, "%")
        if self.torque_nm is not None:  # a sign is a direction
            remedy = "give its size, or leave it out where it is not known"
            number(self.torque_nm, "operating_point.torque_nm", "N m", remedy=remedy)


@dataclass(frozen=True)
class Rig:
    """A machine, as far as it is known; validated when it is created.

    Parameters
    ----------
    name : str
    shafts, pairs, bearings, sensors : tuples
        Pairs and bearings name their shafts. Several pairs must form one connected train.
    operating_point : OperatingPoint
    speed : SpeedSource or None
        Where recordings of this rig get their speed from.
    sampling_rate_hz : float or None
        For files that do not state it.
    sources : tuple of str
        Where the data come from.
    assumed : tuple of str
        Names of facts that were inferred or guessed ("teeth", "sampling_rate_hz", …). A diagnosis that rests on them
        is less certain, and says so.
    contact : ToothContact or None
        Tooth contact and inertias of one pair, for forces from measured motion.
    machine : MachineSize or None
        For the zones of ISO 20816-3.
    """

    name: str = ""
    shafts: tuple[Shaft, ...] = ()
    pairs: tuple[GearPair, ...] = ()
    bearings: tuple[Bearing, ...] = ()
    sensors: tuple[Sensor, ...] = ()
    operating_point: OperatingPoint = OperatingPoint()
    speed: SpeedSource | None = None
    sampling_rate_hz: float | None = None
    sources: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    contact: ToothContact | None = None
    machine: MachineSize | None = None

    def __post_init__(self) -> None:
        self._check_kinds()
        for kind, items in (("shaft", self.shafts), ("pair", self.pairs), ("bearing", self.bearings)):
            names = [item.name for item in items]
            doubled = sorted({n for n in names if names.count(n) > 1})
            if doubled:
                raise InputError(
                    f"{kind} names occur more than once: {', '.join(doubled)}", remedy="give each its own name"
                )
        for pair in self.pairs:
            for shaft in (pair.driver, pair.driven):
                self._check_shaft(shaft, f"pair {pair.name!r}")
        for bearing in self.bearings:
            self._check_shaft(bearing.shaft, f"bearing {bearing.name!r}")
        if self.operating_point.shaft:
            self._check_shaft(self.operating_point.shaft, "operating_point")
        if self.speed is not None and self.speed.shaft:
            self._check_shaft(self.speed.shaft, "speed")
        if self.sampling_rate_hz is not None:
            positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")
        if self.contact is not None and self.contact.pair:
            self.pair(self.contact.pair)  # raises if there is no such pair
        shaft_ratios(self)  # raises if the pairs do not connect or contradict each other

    def __repr__(self) -> str:
        """Return a summary; it does not identify a rig, `key` does."""
        return "\n".join([f"Rig {self.name!r}", *(f"  {name}: {text}" for name, text in self._facts())])

    def key(self) -> str:
        """Return a text that identifies the rig, as a key for cached results; pulse times are abbreviated."""
        return repr(vars(self))

    def _repr_html_(self) -> str:
        """Return the same as an HTML table for notebooks; names are escaped, as they may come from files."""
        return verdict_html([f"Rig {self.name!r}"], ("known", "what"), self._facts())

    def _facts(self) -> tuple[tuple[str, str], ...]:
        sensors = ("sensors", ", ".join(sensor.channel for sensor in self.sensors))
        return tuple(row for row in (*self.rows(), sensors) if row[0] != "machine" and row[1])

    def rows(self) -> tuple[tuple[str, str], ...]:
        """Return what is known of the machine as (label, text) rows."""
        nominal, size = self.nominal_speed_rpm(), self.machine or MachineSize()
        facts = [
            f"{readable(size.power_kw)} kW" if size.power_kw is not None else "",
            f"shaft height {readable(size.shaft_height_mm)} mm" if size.shaft_height_mm is not None else "",
            f"{size.mounting} mounting" if size.mounting else "",
        ]
        rows = [
            ("machine", self.name),
            ("shafts", ", ".join(self.shaft_names)),
            *((named("gear pair", pair.name), _pair_text(pair)) for pair in self.pairs),
            *((named("bearing", bearing.name), _bearing_text(bearing)) for bearing in self.bearings),
            ("nominal speed", f"{readable(nominal, 6)} rpm of {self.reference_shaft}" if nominal is not None else ""),
            ("speed from", _source_text(self.speed)),
            ("size", ", ".join(filter(None, facts))),
            ("sources", "; ".join(self.sources)),
            ("assumed, not known", ", ".join(self.assumed)),
        ]
        return tuple((name, text) for name, text in rows if text)

    def _check_kinds(self) -> None:
        """Raise on parts of a wrong type; convert lists to tuples."""
        check_texts(self, "name")
        parts = (("shafts", Shaft), ("pairs", GearPair), ("bearings", Bearing), ("sensors", Sensor))
        for name, kind in (*parts, ("sources", str), ("assumed", str)):
            object.__setattr__(self, name, listed(getattr(self, name), f"rig.{name}", kind))
        instance_of(self.operating_point, OperatingPoint, "rig.operating_point")
        instance_of(self.contact, ToothContact | None, "rig.contact")
        instance_of(self.machine, MachineSize | None, "rig.machine")
        check_speed_source(self.speed, "rig.speed")

    def _check_shaft(self, name: str, user: str) -> None:
        if name not in self.shaft_names:
            raise InputError(
                f"{user} names shaft {name!r}, which is not described",
                allowed=", ".join(self.shaft_names) or "none: no [[shaft]] is given",
                remedy=closest_match_hint(name, self.shaft_names) or "add a [[shaft]] with that name",
            )

    @property
    def shaft_names(self) -> tuple[str, ...]:
        """Names in the order given."""
        return tuple(shaft.name for shaft in self.shafts)

    @property
    def reference_shaft(self) -> str:
        """The shaft that orders refer to: the speed source's, else the operating point's, else the first."""
        if self.speed is not None and self.speed.shaft:
            return self.speed.shaft
        if self.operating_point.shaft:
            return self.operating_point.shaft
        return self.shafts[0].name if self.shafts else ""

    def with_measurement_of(self, other: Rig) -> Rig:
        """Return this machine with sensors, speed source and sampling rate from another rig file of it, if given there.

        Raises
        ------
        InputError
            If its speed source is on a shaft that this rig does not describe.
        """
        return replace(
            self,
            sensors=other.sensors or self.sensors,
            speed=other.speed or self.speed,
            sampling_rate_hz=other.sampling_rate_hz or self.sampling_rate_hz,
        )

    def ratio(self, shaft: str, to: str = "") -> float | None:
        """Revolutions of `shaft` per revolution of `to` (default: the reference shaft); None if not known."""
        if shaft != self.reference_shaft:  # whose name is empty if no shaft is described
            self._check_shaft(shaft, "ratio")
        ratios = shaft_ratios(self)
        from_ratio, to_ratio = ratios.get(shaft), ratios.get(to or self.reference_shaft)
        if shaft == (to or self.reference_shaft):
            return 1.0
        return None if from_ratio is None or to_ratio is None else from_ratio / to_ratio

    @property
    def speed_source(self) -> SpeedSource | None:
        """The rig's speed source; without one and without gears, the nominal speed as a constant speed.

        The nominal speed counts only if its tolerance is at most `STATED_SPEED_TOLERANCE_PERCENT`.
        """
        nominal_rpm = self.nominal_speed_rpm()
        is_good = self.operating_point.speed_tolerance_percent <= STATED_SPEED_TOLERANCE_PERCENT
        if self.speed is not None or self.pairs or not nominal_rpm or not is_good:
            return self.speed
        return ConstantSpeed(nominal_rpm, self.reference_shaft)

    def nominal_speed_rpm(self, shaft: str = "") -> float | None:
        """Nominal speed of `shaft` (default: the reference shaft) in rpm; None if not known."""
        point = self.operating_point
        if point.speed_rpm is None:
            return None
        ratio = self.ratio(shaft or self.reference_shaft, to=point.shaft or self.reference_shaft)
        return None if ratio is None else point.speed_rpm * ratio

    def nominal_torque_nm(self, shaft: str = "") -> float | None:
        """Magnitude of the nominal torque at `shaft` (default: the reference shaft) in N m; None if not known.

        Power is the same at each shaft: torque is inversely proportional to speed.
        """
        point = self.operating_point
        if point.torque_nm is None:
            return None
        ratio = self.ratio(point.shaft or self.reference_shaft, to=shaft or self.reference_shaft)
        return None if ratio is None else abs(point.torque_nm) * ratio

    def pair(self, name: str) -> GearPair:
        """Return the pair called `name`."""
        pairs = {pair.name: pair for pair in self.pairs}
        return pairs[known_name(name, pairs, f"there is no pair {name!r}")]

    def pairs_on(self, shaft: str) -> tuple[GearPair, ...]:
        """Return the pairs that have a gear on a shaft."""
        return tuple(pair for pair in self.pairs if shaft in (pair.driver, pair.driven))

    def gear_teeth(self, shaft: str) -> dict[str, int]:
        """Return the known tooth counts of the gears on a shaft, by pair name."""
        return {pair.name: teeth for pair in self.pairs_on(shaft) if (teeth := pair.teeth(shaft)) is not None}

    def teeth_on(self, shaft: str) -> int | None:
        """Return the first known tooth count on a shaft; None if there is none."""
        return next(iter(self.gear_teeth(shaft).values()), None)

    def teeth_of(self, gear: str) -> int | None:
        """Return the tooth count of a gear, named "pair/shaft" as in findings; None if not known."""
        return {f"{p.name}/{shaft}": p.teeth(shaft) for p in self.pairs for shaft in (p.driver, p.driven)}.get(gear)

    @property
    def teeth_text(self) -> str:
        """Tooth counts of all pairs, driver first, e.g. "29/71, ?/40"; empty without pairs."""
        return ", ".join(f"{pair.driver_teeth or '?'}/{pair.driven_teeth or '?'}" for pair in self.pairs)

    def mesh_order(self, pair: GearPair, shaft: str = "") -> float | None:
        """Mesh cycles of `pair` per revolution of `shaft` (default: the reference shaft); None if not known.

        The tooth count of either gear times the ratio of its shaft; both gears must agree.
        """
        orders = [
            teeth * ratio
            for gear_shaft in (pair.driver, pair.driven)
            if (teeth := pair.teeth(gear_shaft)) is not None
            and (ratio := self.ratio(gear_shaft, to=shaft or self.reference_shaft)) is not None
        ]
        if len(orders) == 2 and not isclose(orders[0], orders[1], rel_tol=1e-9):
            raise InputError(
                f"pair {pair.name!r} gives two mesh orders, {orders[0]:g} and {orders[1]:g}", remedy="check the teeth"
            )
        return orders[0] if orders else None


def check_rig(value: object, name: str = "rig", *, needed: bool = False) -> None:
    """Raise unless the value is a rig, or None if none is needed; for a path, suggest reading it."""
    remedy = "describe the machine: gearsig.Rig(shafts=…, pairs=…), or read a rig file: gearsig.read_rig(path)"
    if isinstance(value, str | PathLike):
        remedy = f"read the rig file first: gearsig.read_rig({str(value)!r})"
    instance_of(value, Rig if needed else Rig | None, name, remedy=remedy)


def contact_pair(rig: Rig) -> GearPair:
    """Return the pair that the rig's contact belongs to."""
    name = rig.contact.pair if rig.contact is not None else ""
    if name:
        return rig.pair(name)
    if len(rig.pairs) != 1:
        raise InputError(
            f"the rig has {len(rig.pairs)} gear pairs and the contact names none",
            where="rig: [contact]",
            remedy="name the pair there",
        )
    return rig.pairs[0]


def path_of_contact(rig: Rig) -> PathOfContact:
    """Return the path of contact of the pair that the rig's contact names.

    Raises
    ------
    RefusalError
        If the rig has no contact, or teeth, module or pressure angle are missing.
    """
    pair = contact_pair(rig)
    contact = rig.contact
    if contact is None:
        raise RefusalError("the rig has no [contact] table", remedy="give the contact's stiffness and backlash there")
    known = (pair.driver_teeth, pair.driven_teeth, pair.module_mm, pair.pressure_angle_deg)
    if None in known:
        raise RefusalError(
            f"pair {pair.name!r} lacks teeth, module or pressure angle, which the path of contact follows from",
            remedy="add them to its [[pair]] table",
        )
    z1, z2, module_mm, angle_deg = known
    assert z1 is not None and z2 is not None and module_mm is not None and angle_deg is not None  # noqa: S101, PT018
    return standard_path(
        (z1, z2),
        module_mm * 1e-3,
        radians(angle_deg),
        phase=contact.mesh_phase,
        contact_ratio=contact.contact_ratio,
        ramp=contact.mesh_ramp,
    )


# --------------------
# A rig as text.
# --------------------


def _pair_text(pair: GearPair) -> str:
    driver, driven = (str(teeth) if teeth is not None else "?" for teeth in (pair.driver_teeth, pair.driven_teeth))
    text = f"{driver} teeth on {pair.driver} drive {driven} on {pair.driven}"
    extra = [
        f"module {readable(pair.module_mm)} mm" if pair.module_mm is not None else "",
        f"pressure angle {readable(pair.pressure_angle_deg)}°" if pair.pressure_angle_deg is not None else "",
        f"face width {readable(pair.face_width_mm)} mm" if pair.face_width_mm is not None else "",
    ]
    return ", ".join([text, *(item for item in extra if item)])


def _bearing_text(bearing: Bearing) -> str:
    orders = ", ".join(f"{name} {readable(order)}" for name, order in bearing.orders().items())
    name = f"{bearing.bearing} " if bearing.bearing else ""
    return f"{name}on {bearing.shaft}" + (f"; orders {orders}" if orders else "")


def _source_text(source: SpeedSource | None) -> str:
    if source is None:
        return ""
    of = f", of {source.shaft}" if source.shaft else ""
    if isinstance(source, ConstantSpeed):
        return f"{readable(source.speed_rpm, 6)} rpm, constant{of}"
    if isinstance(source, SpeedChannel):
        return f"channel {source.channel}{of}"
    if isinstance(source, EncoderChannel):
        return f"encoder, channel {source.channel}, {readable(source.units_per_revolution)} per revolution{of}"
    channel = f", channel {source.channel}" if isinstance(source, TachometerChannel) else ""
    return f"tachometer{channel}, {counted(source.pulses_per_revolution, 'pulse')} per revolution{of}"
