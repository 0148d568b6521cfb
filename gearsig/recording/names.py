"""What names and units of columns mean: sampling rates, quantities, units in brackets."""

from __future__ import annotations

import re

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
        *("dt", "dts", "ts", "deltat", "xinc", "wfincrement", "tsample"),
        *("sampleinterval", "samplinginterval", "samplingperiod"),
    )
)
"""Names of sampling intervals in seconds."""
SPEED_NAMES = frozenset(("rpm", "rate", "speed", "shaftspeed", "rotspeed", "speedrpm", "drehzahl", "shaftrate", "hz"))
"""Names of scalars that may be a shaft speed; told to the user, never used."""

_QUANTITY_OF_UNIT = {
    "m/s^2": "acceleration",
    "m/s2": "acceleration",
    "m/s²": "acceleration",
    "m/s**2": "acceleration",
    "ms-2": "acceleration",
    "mm/s^2": "acceleration",
    "mm/s²": "acceleration",
    "g": "acceleration",
    "gn": "acceleration",
    "g_n": "acceleration",
    "mg": "acceleration",
    "m/s": "velocity",
    "mm/s": "velocity",
    "in/s": "velocity",
    "ips": "velocity",
    "mm": "displacement",
    "µm": "displacement",
    "μm": "displacement",
    "um": "displacement",
    "mil": "displacement",
    "pa": "sound_pressure",
    "n": "force",
    "kn": "force",
    "nm": "torque",
    "n*m": "torque",
    "n·m": "torque",
    "rpm": "rotational_speed",
    "r/min": "rotational_speed",
    "tr/min": "rotational_speed",
    "u/min": "rotational_speed",
    "1/min": "rotational_speed",
    "min^-1": "rotational_speed",
    "rad/s": "rotational_speed",
    "rad": "angle",
    "rad/s^2": "angular_acceleration",
    "rad/s2": "angular_acceleration",
    "rad/s²": "angular_acceleration",
    "°c": "temperature",
    "degc": "temperature",
    "v": "voltage",
    "mv": "voltage",
}
RPM_UNITS = frozenset(("rpm", "r/min", "tr/min", "u/min", "1/min", "min^-1"))

_RATE_LINE = re.compile(
    r"[#%/;\s]*(?P<name>[^=:;,\t]+?)\s*[=:;,\t]+\s*"
    r"(?P<value>[-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(?P<unit>k?hz)?[\s;,]*$",
    re.IGNORECASE,
)
_UNIT_AT_END = re.compile(r"^(?P<name>.*?)\s*(?:\[(?P<square>[^\]\[]*)\]|\((?P<round>[^()]*)\))\s*$", re.DOTALL)


def plain_name(name: str) -> str:
    """Return a name folded for comparison with the sets above.

    Examples
    --------
    >>> plain_name("Sampling_Rate"), plain_name("Head_1.SampFreq")
    ('samplingrate', 'sampfreq')
    """
    return re.sub(r"[\s_\-]+", "", name.rpartition(".")[2].casefold())


def split_unit(header: str) -> tuple[str, str]:
    """Split "acc [m/s^2]" or "acc (g)" into name and unit; round brackets only where they hold a known unit.

    Examples
    --------
    >>> split_unit("acc [m/s^2]"), split_unit("Time (s)"), split_unit("bearing (left)")
    (('acc', 'm/s^2'), ('Time', 's'), ('bearing (left)', ''))
    """
    match = _UNIT_AT_END.match(header.strip())
    if match is None or not match["name"]:
        return header.strip(), ""
    if match["square"] is not None:
        return match["name"], match["square"].strip()
    if is_unit(match["round"]):
        return match["name"], match["round"].strip()
    return header.strip(), ""


def rate_in_line(line: str) -> float | None:
    """Return the sampling rate that a line of text states, in Hz.

    Examples
    --------
    >>> rate_in_line("# fs = 25600"), rate_in_line("Sampling rate [Hz];25.6e3"), rate_in_line("# run 5: good")
    (25600.0, 25600.0, None)
    """
    match = _RATE_LINE.match(line)
    if match is None or re.sub(r"[\[(]hz[\])]$", "", plain_name(match["name"])) not in RATE_NAMES:
        return None
    return float(match["value"]) * (1e3 if (match["unit"] or "").casefold() == "khz" else 1.0)


def is_unit(text: str) -> bool:
    """Whether the text is a unit of a quantity or of time that is known here."""
    from gearsig.recording.time_axis import SECONDS_PER_UNIT

    word = text.strip().casefold()
    return word in _QUANTITY_OF_UNIT or (word != "" and word in SECONDS_PER_UNIT)


def same_unit(one: str, other: str) -> bool:
    """Whether two units are one, however they are spelled.

    Examples
    --------
    >>> same_unit("m/s²", "m/s^2"), same_unit("m/s2", "m/s**2"), same_unit("g", "m/s^2")
    (True, True, False)
    """
    return _plain_unit(one) == _plain_unit(other)


def _plain_unit(unit: str) -> str:
    squares = unit.strip().casefold().replace("²", "2").replace("**", "").replace("^", "")
    return re.sub(r"[\s·*]+", "", squares).replace("/s/s", "/s2").replace("μ", "µ").replace("um", "µm")


def quantity_of(name: str, unit: str) -> str:
    """Return the quantity that a unit, or a telling name, stands for; "unknown" where neither tells.

    A pulse channel is known by its name, because its unit is that of a voltage.

    Examples
    --------
    >>> quantity_of("a1", "m/s^2"), quantity_of("Tacho", "V"), quantity_of("a1", "")
    ('acceleration', 'tachometer', 'unknown')
    """
    quantity = _QUANTITY_OF_UNIT.get(unit.strip().casefold(), "unknown")
    if quantity in ("unknown", "voltage") and re.match(r"tach|keyphas", name.strip().casefold()):
        return "tachometer"
    if quantity == "unknown" and plain_name(name) in ("rpm", "speedrpm"):
        return "rotational_speed"
    return quantity
