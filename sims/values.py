"""Values of a simulator's parameters: from defaults, preset and user, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from gearsig.checks import closest_match_hint, one_of, within
from gearsig.errors import InputError
from sims.simulator import Parameter, ParameterValue

Values = dict[str, ParameterValue | None]
"""Every parameter of a simulator by name; None where it is derived from the others."""


def complete_values(parameters: Sequence[Parameter], *layers: Mapping[str, ParameterValue]) -> Values:
    """Return a value for every parameter: the defaults, overlaid by each layer in turn.

    Parameters
    ----------
    parameters : sequence of Parameter
    *layers : mappings
        Name → value; the last one wins.

    Raises
    ------
    InputError
        If a name does not exist (with the closest that does) or a value does not fit.
    """
    values: Values = {p.name: p.default for p in parameters}
    for layer in layers:
        for name, value in layer.items():
            values[name] = checked_value(parameter(parameters, name), value)
    return values


def parameter(parameters: Sequence[Parameter], name: str) -> Parameter:
    """Return the parameter called `name`."""
    for candidate in parameters:
        if candidate.name == name:
            return candidate
    names = [p.name for p in parameters]
    raise InputError(f"there is no parameter {name!r}", remedy=_hint(name, names))


def _hint(name: str, names: Sequence[str]) -> str:
    """The closest name, else the names that begin with the closest word."""
    from difflib import get_close_matches

    closest = closest_match_hint(name, names)
    words = get_close_matches(name.partition("_")[0], {n.partition("_")[0] for n in names}, n=1)
    if closest or not words:
        return closest or "`gearsig simulate --list` shows them all"
    return f"there are {', '.join(n for n in names if n.partition('_')[0] == words[0])}"


def checked_value(wanted: Parameter, value: object) -> ParameterValue | None:
    """Return a value that the parameter may have; a number as float; None or "none" where it may follow from others."""
    if wanted.default is None and (value is None or value == "none"):
        return None
    if wanted.choices:
        return one_of(str(value), wanted.name, wanted.choices)
    if isinstance(value, bool):
        raise InputError(f"{wanted.name} is {value}", allowed="a number")
    low = -float("inf") if wanted.low is None else wanted.low
    high = float("inf") if wanted.high is None else wanted.high
    number = within(value, wanted.name, low, high, wanted.unit)  # type: ignore[arg-type]  # it says so itself
    if wanted.whole and number != round(number):
        raise InputError(f"{wanted.name} is {number:g}", allowed="a whole number")
    return number
