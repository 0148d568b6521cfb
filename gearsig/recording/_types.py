"""Recordings: channels over time with their units, speed source and provenance."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from types import MappingProxyType, UnionType
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig.checks import (
    FloatArray,
    frozen_array,
    instance_of,
    known_name,
    listed,
    number,
    one_of,
    positive,
    short,
    within,
)
from gearsig.errors import InputError
from gearsig.formatting import counted, unit_text
from gearsig.results import verdict_html
from gearsig.rig import (
    QUANTITIES,
    PulseTimes,
    Rig,
    SpeedSource,
    check_rig,
    check_speed_source,
    quantity_of_unit,
    same_unit,
    si_factor,
)

if TYPE_CHECKING:
    from pandas import DataFrame


RATE_NAMES = frozenset(
    (
        *("fs", "sr", "fshz", "fsamp", "fsample", "sfreq", "sampfreq", "samplefreq", "samplefrequency", "samplerate"),
        *("sampleratehz", "samplingfreq", "samplingfrequency", "samplingfrequencyhz", "samplingrate", "samplingratehz"),
        *("freqsampling", "abtastrate"),
    )
)
"""Names of sampling rates in Hz, lower case, without spaces and underscores."""
INTERVAL_NAMES = frozenset(
    (
        *("dt", "dts", "ts", "deltat", "deltax", "xinc", "xaxisdelta", "wfincrement", "tsample"),
        *("sampleinterval", "samplinginterval", "samplingperiod"),
    )
)
"""Names of sampling intervals in seconds."""
SPEED_NAMES = frozenset(("rpm", "rate", "speed", "shaftspeed", "rotspeed", "speedrpm", "drehzahl", "shaftrate", "hz"))
"""Names of scalars that may be a shaft speed: reported to the user, and used only if the name ends in "rpm"."""

SECONDS_PER_UNIT = {
    "": 1.0,
    "s": 1.0,
    "sec": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "sek": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "us": 1e-6,
    "µs": 1e-6,
    "μs": 1e-6,
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
}
# A file's text may be crafted to make matching slow: quantifiers are possessive, and the text is stripped first.
_SIGN = re.compile(r"[=:;,\t]")
_QUANTITY = re.compile(
    r"(?P<value>[-+]?(?:\d++[.,]?\d*+|[.,]\d++)(?:e[-+]?\d++)?)\s*+(?P<unit>[a-zµμ]++)?", re.IGNORECASE
)
_BRACKETS = {"]": "[", ")": "("}
_AXIS = re.compile(r"^[XYZ]:\s*(?=\S)", re.IGNORECASE)


def plain_name(name: str) -> str:
    """Return a name folded for comparison with the sets above.

    Examples
    --------
    >>> plain_name("Sampling_Rate"), plain_name("Head_1.SampFreq")
    ('samplingrate', 'sampfreq')
    """
    return re.sub(r"[\s_\-]+", "", name.rpartition(".")[2].casefold())


def stated_rate_hz(name: str, value: float) -> float | None:
    """Return the sampling rate in Hz that a named number states: its value, 1 over a positive interval, or None.

    Examples
    --------
    >>> stated_rate_hz("fs", 1000.0), stated_rate_hz("dt", 0.001), stated_rate_hz("gain", 10.0)
    (1000.0, 1000.0, None)
    """
    if plain_name(name) in RATE_NAMES:
        return value
    return 1.0 / value if plain_name(name) in INTERVAL_NAMES and value > 0 else None


def split_unit(header: str) -> tuple[str, str]:
    """Split "acc [m/s^2]" or "acc (g)" into name and unit; round brackets only where they hold a known unit.

    The axis letter that data collectors put first ("X:Time (Seconds)") is not part of the name.

    Examples
    --------
    >>> split_unit("acc [m/s^2]"), split_unit("Time (s)"), split_unit("bearing (left)")
    (('acc', 'm/s^2'), ('Time', 's'), ('bearing (left)', ''))
    >>> split_unit("X:Time (Seconds)"), split_unit("Y:(g)")
    (('Time', 'Seconds'), ('', 'g'))
    """
    header = _AXIS.sub("", header.strip())
    sign = _BRACKETS.get(header[-1:], "")
    at = header.rfind(sign) if sign else -1
    unit = header[at + 1 : -1]
    if at < 0 or header[-1] in unit or not (sign == "[" or is_unit(unit)):
        return header, ""
    return header[:at].rstrip(), unit.strip()


def rate_in_line(line: str) -> float | None:
    """Return the sampling rate in Hz that a line of text states, once or identically for each channel.

    Examples
    --------
    >>> rate_in_line("# fs = 25600"), rate_in_line("Sampling rate [Hz];25.6e3"), rate_in_line("# run 5: good")
    (25600.0, 25600.0, None)
    >>> rate_in_line("fs: 25,6 kHz"), rate_in_line("fs,1024,1024"), rate_in_line("fs: 25,600 Hz")
    (25600.0, 1024.0, None)
    """
    value, unit = _in_line(line, RATE_NAMES)
    return None if value is None or unit not in ("", "hz", "khz") else value * (1e3 if unit == "khz" else 1.0)


def interval_in_line(line: str) -> float | None:
    """Return the sampling interval in seconds that a line of text states.

    Examples
    --------
    >>> interval_in_line("Delta_X;1,0E-3;1,0E-3;"), interval_in_line("dt = 0.5 ms"), interval_in_line("dt = 1 Hz")
    (0.001, 0.0005, None)
    """
    value, unit = _in_line(line, INTERVAL_NAMES)
    return None if value is None or unit not in SECONDS_PER_UNIT else value * SECONDS_PER_UNIT[unit]


def _in_line(line: str, names: frozenset[str]) -> tuple[float | None, str]:
    """Return the number that a line states for one of the names, and its unit in lower case."""
    line = line.lstrip("#%/; \t\r\n\f\v").rstrip("; ,\t\r\n\f\v")
    sign = _SIGN.search(line)
    if sign is None:
        return None, ""
    label, _, unit = line[: sign.start()].rstrip().replace("(", "[").partition("[")
    if plain_name(label) not in names:
        return None, ""
    rest = line[sign.start() :].lstrip("=:;, \t")
    for separator in (",", "\t", ";"):  # between channels; a comma may be a decimal sign
        fields = {field.strip().removeprefix(label.strip()).lstrip("=: ") for field in rest.split(separator)} - {""}
        match = _QUANTITY.fullmatch(fields.pop()) if len(fields) == 1 else None
        if match is not None and not re.fullmatch(r"[1-9]\d{0,2},\d{3}", match["value"]):  # thousands or decimal sign?
            return float(match["value"].replace(",", ".")), (match["unit"] or unit.strip("]) ")).casefold()
    return None, ""


def is_unit(text: str) -> bool:
    """Whether the text is a known unit of a quantity or of time."""
    word = text.strip().casefold()
    return quantity_of_unit(text) is not None or (word != "" and word in SECONDS_PER_UNIT)


def quantity_of(name: str, unit: str) -> str:
    """Return the quantity that the unit or the name indicates; "unknown" if neither does.

    A pulse channel is recognised by its name, because its unit is that of a voltage.

    Examples
    --------
    >>> quantity_of("a1", "m/s^2"), quantity_of("Tacho", "V"), quantity_of("a1", ""), quantity_of("phase_current_1", "")
    ('acceleration', 'tachometer', 'unknown', 'current')
    """
    quantity = quantity_of_unit(unit) or "unknown"
    if quantity in ("unknown", "voltage") and re.match(r"tach|keyphas", name.strip().casefold()):
        return "tachometer"
    if quantity == "unknown" and plain_name(name) in ("rpm", "speedrpm"):
        return "rotational_speed"
    if quantity == "unknown" and (match := _TELLING_NAME.search(name.casefold())) is not None:
        return next(of_name for of_name, word in match.groupdict().items() if word)
    return quantity


_TELLING_NAME = re.compile(
    r"(?<![^\W\d_])(?:(?P<torque>torque|drehmoment)|(?P<temperature>temp(?:eratur|erature)?)|(?P<current>(?<!eddy.)current|strom))(?![^\W\d_])"
)


VIBRATION_QUANTITIES = frozenset(
    {"acceleration", "velocity", "displacement", "sound_pressure", "force", "torque", "transmission_error", "unknown"}
)
"""Quantities that the analysis chain treats as vibration; the others describe the motion or the surroundings."""


@dataclass(frozen=True)
class Channel:
    """One channel of a recording.

    Parameters
    ----------
    name : str
        Unique in its recording. Text from a file: never to be treated as markup.
    quantity : str
        One of `QUANTITIES`.
    unit : str
        As the file or the rig states it; empty if it is not known.
    position : str
        Where the sensor sits, e.g. "pinion bearing, vertical".
    """

    name: str
    quantity: str = "unknown"
    unit: str = ""
    position: str = ""

    def __post_init__(self) -> None:
        instance_of(self.name, str, "name of a Channel")
        one_of(self.quantity, f"quantity of channel {self.name!r}", QUANTITIES)
        for label in ("unit", "position"):
            instance_of(getattr(self, label), str, f"{label} of channel {self.name!r}")

    @property
    def is_vibration(self) -> bool:
        """Whether the analysis chain examines this channel for faults."""
        return self.quantity in VIBRATION_QUANTITIES


_RECORD_NUMBER = re.compile(r"^\d{3,}[-_. ]*|[-_. ]*\d{3,}$|\d{3,}")


def names_without_number(names: Iterable[str]) -> dict[str, str]:
    """Return channel names → names without the record number, so that a channel has the same name in every record.

    The number has three digits or more: fewer distinguish sensors, e.g. a1 and a2. If the shorter names would not be
    unique, or one would be empty, all names stay unchanged.

    Examples
    --------
    >>> names_without_number(["X118_DE_time", "X118_FE_time"])
    {'X118_DE_time': 'X_DE_time', 'X118_FE_time': 'X_FE_time'}
    >>> names_without_number(["sensor 1001", "sensor 1002"])
    {'sensor 1001': 'sensor 1001', 'sensor 1002': 'sensor 1002'}
    """
    shorter = {name: _RECORD_NUMBER.sub("", name) for name in names}
    stay_apart = all(shorter.values()) and len(set(shorter.values())) == len(shorter)
    return shorter if stay_apart else {name: name for name in shorter}


@dataclass(frozen=True)
class Provenance:
    """Where a recording came from, and what has been done to it since.

    Parameters
    ----------
    source : str
        File name or simulator; empty if made in memory.
    sha256 : str
        Hash of the file's bytes, empty if made in memory.
    reader : str
        The reader or simulator with its version.
    history : tuple of str
        Processing steps in order.
    """

    source: str = ""
    sha256: str = ""
    reader: str = ""
    history: tuple[str, ...] = ()


@dataclass(frozen=True)
class Recording:
    """Samples of one or more channels at a constant sampling rate.

    Parameters
    ----------
    samples : array, (n_channels, n_samples)
        In each channel's unit; finite. Kept as float32 or float64, read-only.
    sampling_rate_hz : float
        Above zero.
    channels : tuple of Channel
        One per row of `samples`, names unique.
    speed : SpeedSource or None
        Where shaft speed and angle come from; None if the recording does not say. The rig's `speed` is then used:
        see `speed_source`.
    rig : Rig or None
        The machine, as far as it is known.
    provenance : Provenance
    truth : mapping or None
        What a simulator put in (JSON-like values); None for measured data.
    warnings : tuple of str
        What the reader noticed and the user should know, e.g. that a duplicate variable was left out.

    Raises
    ------
    InputError
        If a shape, rate, name or value does not fit.

    Examples
    --------
    >>> r = Recording(np.zeros((1, 8)), 4.0, (Channel("a1", "acceleration", "m/s^2"),))
    >>> r.duration_s
    2.0
    """

    samples: FloatArray
    sampling_rate_hz: float
    channels: tuple[Channel, ...]
    speed: SpeedSource | None = None
    rig: Rig | None = None
    provenance: Provenance = field(default_factory=Provenance)
    truth: Mapping[str, Any] | None = None
    warnings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        instance_of(self.provenance, Provenance, "provenance of a Recording")
        where = self.name
        remedy = "give --fs or sampling_rate_hz in the rig file"
        positive(self.sampling_rate_hz, f"{where}: sampling rate", "Hz", remedy=remedy)
        within(self.sampling_rate_hz, f"{where}: sampling rate", 1e-3, 1e10, "Hz", remedy=remedy)
        try:
            samples = frozen_array(self.samples, "samples (channel, time)", ndim=2)
        except InputError as error:
            is_single = isinstance(self.samples, np.ndarray) and self.samples.ndim == 1
            hint = error.remedy or ("for one channel, give samples[None]" if is_single else "")
            raise InputError(error.what, where=where, allowed=error.allowed, remedy=hint) from None
        if samples.shape[1] == 0:
            raise InputError("there are no samples", where=where, remedy="check that the file was written completely")
        object.__setattr__(self, "samples", samples)
        remedy = 'e.g. gearsig.Channel("a1", "acceleration", "m/s^2")'
        object.__setattr__(self, "channels", listed(self.channels, f"{where}: channels", Channel, remedy=remedy))
        if len(self.channels) != samples.shape[0]:
            raise InputError(
                f"{counted(len(self.channels), 'channel')} for samples of shape {samples.shape}",
                where=where,
                allowed="one channel for each row: samples (channel, time)",
                remedy="transpose them: samples.T" if len(self.channels) == samples.shape[1] else "",
            )
        check_speed_source(self.speed, f"{where}: speed")
        check_rig(self.rig, f"{where}: rig")
        names = self.channel_names
        doubled = sorted({name for name in names if names.count(name) > 1})
        if doubled:
            raise InputError(
                f"channel names occur more than once: {', '.join(doubled)}", where=where, remedy="rename the columns"
            )
        instance_of(self.truth, Mapping | None, f"{where}: truth")
        if self.truth is not None:
            object.__setattr__(self, "truth", MappingProxyType(dict(self.truth)))

    def __repr__(self) -> str:
        machine = f", rig {self.rig.name!r}" if self.rig is not None else ""
        head = f"Recording {self.name!r}: {self.duration_s:.6g} s at {self.sampling_rate_hz:.9g} Hz{machine}"
        shown = [f"  {c.name}: {c.quantity}{f' ({c.unit})' if c.unit else ''}" for c in self.channels[:6]]
        more = len(self.channels) - len(shown)
        return "\n".join([head, *shown, *([f"  … and {more} more channels"] if more else [])])

    def _repr_html_(self) -> str:
        """Return the same as a table, for notebooks."""
        rows = [(c.name, c.quantity.replace("_", " "), unit_text(c.unit), c.position) for c in self.channels]
        return verdict_html([repr(self).splitlines()[0]], ("channel", "quantity", "unit", "position"), rows)

    @property
    def name(self) -> str:
        """Name of the source file or simulator; "recording" if made in memory."""
        return self.provenance.source or "recording"

    @property
    def n_samples(self) -> int:
        """Samples per channel."""
        return int(self.samples.shape[1])

    @property
    def duration_s(self) -> float:
        """Number of samples over sampling rate."""
        return self.n_samples / self.sampling_rate_hz

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Names in the order of the rows."""
        return tuple(channel.name for channel in self.channels)

    @property
    def speed_source(self) -> SpeedSource | None:
        """The recording's own speed source, or the rig's, see `Rig.speed_source`."""
        if self.speed is not None:
            return self.speed
        return self.rig.speed_source if self.rig is not None else None

    def time_s(self) -> FloatArray:
        """Sample times from zero, (n_samples,)."""
        return np.arange(self.n_samples) / self.sampling_rate_hz

    def index(self, name: str) -> int:
        """Row of the channel called `name`."""
        names = self.channel_names
        return names.index(known_name(name, names, f"there is no channel {name!r}", where=self.name))

    def values(self, name: str) -> FloatArray:
        """Samples of one channel, (n_samples,), read-only."""
        row: FloatArray = self.samples[self.index(name)]
        return row

    def to_frame(self) -> DataFrame:
        """Return the samples as a pandas table: one column per channel, the time in seconds as index."""
        from pandas import DataFrame, Index

        return DataFrame(self.samples.T, columns=list(self.channel_names), index=Index(self.time_s(), name="time_s"))

    def vibration_names(self) -> tuple[str, ...]:
        """Names of the channels that the analysis examines for faults."""
        return tuple(channel.name for channel in self.channels if channel.is_vibration)

    def select(self, names: Iterable[str]) -> Recording:
        """Return the recording with only the named channels, in that order."""
        rows = [self.index(name) for name in listed(names, "names", str)]
        return self._changed(
            "select " + ", ".join(self.channel_names[i] for i in rows),
            samples=self.samples[rows],
            channels=tuple(self.channels[i] for i in rows),
        )

    def with_rig(self, rig: Rig | None) -> Recording:
        """Return the recording with another rig, and apply its sensors' quantity, unit, scale and position.

        Sensors are applied once, to the values as read. If the sensors of the current rig have been applied, they are
        kept: the other rig must have the same sensors, or none. If the rig states another unit than the file but no
        scale, the rig's unit is used, with a warning.

        Raises
        ------
        InputError
            If sensors have been applied, and the other rig has different ones.
        """
        check_rig(rig)
        if rig is None or self.rig is rig:
            return replace(self, rig=rig)
        applied = () if self.rig is None else self.rig.sensors
        if applied and rig.sensors not in ((), applied):
            raise InputError(
                "the recording carries a rig with other sensors, and their scales were applied",
                where=self.name,
                remedy="read the file again with the other rig",
            )
        if applied or not rig.sensors:
            return replace(self, rig=replace(rig, sensors=applied))
        samples = np.array(self.samples)
        channels, warnings = list(self.channels), list(self.warnings)
        for sensor in rig.sensors:
            if sensor.channel not in self.channel_names:
                continue  # a rig may describe more sensors than this file holds
            i = self.index(sensor.channel)
            scaled, old = sensor.scale != 1.0 or sensor.offset != 0.0, channels[i]
            if scaled:
                samples[i] = samples[i] * sensor.scale + sensor.offset
            elif old.unit and sensor.unit and not same_unit(old.unit, sensor.unit):
                warnings.append(
                    f"channel {old.name!r}: the file says {old.unit}, the rig file {sensor.unit} without a scale; "
                    f"the values are taken as {sensor.unit}"
                )
            channels[i] = Channel(
                old.name, sensor.quantity or old.quantity, sensor.unit or old.unit, sensor.position or old.position
            )
        warnings += self._unmatched_sensors(rig)
        return replace(self, samples=samples, channels=tuple(channels), rig=rig, warnings=tuple(warnings))

    def _unmatched_sensors(self, rig: Rig) -> Iterator[str]:
        """Warn if the rig describes channels that are missing here while others here are not described."""
        described = [sensor.channel for sensor in rig.sensors]
        missing = [name for name in described if name not in self.channel_names]
        unknown = [name for name in self.channel_names if name not in (*described, getattr(rig.speed, "channel", ""))]
        if missing and unknown:
            here, there = (", ".join(map(short, names[:3])) + ", …" * (len(names) > 3) for names in (unknown, missing))
            are = "is" if len(missing) == 1 else "are"
            yield (
                f"the rig file describes {counted(len(missing), 'channel')} that {are} not in the recording ({there}) "
                f"and does not describe {here}: compare the names"
            )

    def between(self, start_s: float, end_s: float) -> Recording:
        """Return the part from `start_s` to `end_s`, whose time starts at 0 again; pulse times are cut and shifted too.

        Raises
        ------
        InputError
            If there is no sample in that range.
        """
        times_s = number(start_s, "start_s", "s"), number(end_s, "end_s", "s")
        first, last = (int(np.clip(round(t * self.sampling_rate_hz), 0, self.n_samples)) for t in times_s)
        if first >= last:
            raise InputError(
                f"there is no sample from {start_s:.6g} to {end_s:.6g} s",
                where=self.name,
                allowed=f"a part within 0 to {self.duration_s:.6g} s",
            )
        speed, start = self.speed_source, first / self.sampling_rate_hz
        if isinstance(speed, PulseTimes):
            kept = (speed.times_s >= start) & (speed.times_s <= last / self.sampling_rate_hz)
            speed = replace(speed, times_s=speed.times_s[kept] - start)
        step = f"from {start:.6g} to {last / self.sampling_rate_hz:.6g} s"
        return self._changed(step, samples=self.samples[:, first:last], speed=speed)

    def with_name(self, name: str) -> Recording:
        """Return the recording under another name."""
        return replace(self, provenance=replace(self.provenance, source=name))

    def _changed(self, step: str, **changes: Any) -> Recording:
        provenance = replace(self.provenance, history=(*self.provenance.history, step))
        return replace(self, provenance=provenance, **changes)


def check_recording(value: object, name: str = "recording", kinds: type | UnionType = Recording) -> None:
    """Raise unless the value is a recording or of another accepted kind; the remedy depends on what was given.

    Parameters
    ----------
    value : object
    name : str
        Of the parameter.
    kinds : type or union of types
    """
    remedy = "make one: gearsig.Recording(samples, sampling_rate_hz, channels)"
    if isinstance(value, str | PathLike):
        remedy = f"read the file first: gearsig.read_recording({str(value)!r})"
    elif isinstance(getattr(value, "recording", None), Recording):  # a PreparedRecording, an Analysis
        remedy = f"give {name}.recording"
    instance_of(value, kinds, name, remedy=remedy)


def metres_per_second_squared(channel: Channel) -> float | None:
    """Return the factor from a channel's unit to m/s²; None if it is not an acceleration in a known unit."""
    return si_factor("acceleration", channel.unit) if channel.quantity in ("acceleration", "unknown") else None
