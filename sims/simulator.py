"""The interface of every simulator: parameters with units and ranges, presets, effects and recordings."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from gearsig.checks import closest_match_hint, one_of, within
from gearsig.errors import InputError
from gearsig.recording import Recording
from sims.effects import EffectSetting, completed, effect, user_files
from sims.machine import Operation, Profile
from sims.presets import Preset, preset, presets

if TYPE_CHECKING:
    from sims import ProfileLike

ParameterValue = float | str
Values = dict[str, ParameterValue | None]
"""All parameter values of a simulator by name; None where a value is derived from the others."""


@dataclass(frozen=True)
class Parameter:
    """A parameter of a model: a number or a word.

    Parameters
    ----------
    name : str
        Ends in its unit, if it has one.
    unit, meaning : str
    low, high : float or None
        Range of a number.
    default : float, str or None
        Used where neither preset nor user gives a value. None: derived from the others, as `meaning` says.
    choices : tuple of str
        Allowed words; empty for a number.
    whole : bool
    """

    name: str
    unit: str
    meaning: str
    low: float | None = None
    high: float | None = None
    default: ParameterValue | None = None
    choices: tuple[str, ...] = ()
    whole: bool = False

    @classmethod
    def choice(cls, name: str, meaning: str, choices: tuple[str, ...], default: str) -> Parameter:
        """Return a parameter whose value is one of the given words."""
        return cls(name, "", meaning, default=default, choices=choices)


@dataclass(frozen=True)
class SimulationSetup:
    """What to simulate: a preset and the changes to it.

    Parameters
    ----------
    preset : str or Preset
        The preset, its name or its file; empty: the simulator's first.
    parameters : mapping
        Name → value; the preset's value for each one not given.
    effects : sequence of EffectSetting
        In addition to the preset's.
    operation : Operation or None
        None: the preset's speed and torque.
    """

    preset: str | Preset = ""
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    effects: Sequence[EffectSetting] = ()
    operation: Operation | None = None

    def preset_of(self, model: str) -> Preset:
        """Return the preset, looked up for that model if it is given by name or file."""
        return self.preset if isinstance(self.preset, Preset) else preset(model, self.preset)


@dataclass(frozen=True)
class SimulationRequest:
    """A complete simulation request: a preset's values and effects, overlaid with those of a setup.

    Parameters
    ----------
    model, preset : str
    operation : Operation
    values : mapping
        Every parameter; None where it follows from the others.
    effects : tuple of EffectSetting
        Each with all its options.
    """

    model: str
    preset: str
    operation: Operation
    values: Values
    effects: tuple[EffectSetting, ...]

    @classmethod
    def of(cls, model: str, known: Sequence[Parameter], setup: SimulationSetup) -> SimulationRequest:
        """Overlay a preset's values and effects with those of the setup.

        Raises
        ------
        InputError
            If a name does not exist, or a value is outside its range.
        """
        chosen = setup.preset_of(model)
        return cls(
            model,
            chosen.name,
            setup.operation or chosen.operation,
            complete_values(known, chosen.parameters, setup.parameters),
            completed((*chosen.effects, *setup.effects)),
        )

    def truth(self) -> dict[str, Any]:
        """All inputs as plain values, for `Recording.truth`."""
        return {
            "model": self.model,
            "preset": self.preset,
            "parameters": dict(self.values),
            "effects": [
                {
                    "name": s.name,
                    "severity": s.severity,
                    "unit": effect(s.name).severity.unit,
                    "options": dict(s.options),
                }
                for s in self.effects
            ],
            "operation": {
                "speed_rpm": self.operation.speed_rpm.as_dict(),
                "torque_nm": self.operation.torque_nm.as_dict(),
            },
        }


class HasText(Protocol):
    """A result with a readable summary."""

    @property
    def text(self) -> str:
        """Readable summary."""
        ...


@dataclass(frozen=True)
class Simulator(ABC):
    """A model that makes recordings; each simulator sets these fields.

    Parameters
    ----------
    name : str
        Short, as on the command line.
    title : str
        One line for people.
    parameters : tuple of Parameter
        All parameters.
    effects : tuple of str
        Names of the effects that this model supports.
    meaningless : tuple of str
        Which aspects of these effects have no meaning here, and why, one sentence each.
    usual_sampling_rate_hz : float
        Default sampling rate.
    """

    name: str
    title: str
    parameters: tuple[Parameter, ...] = field(repr=False)
    effects: tuple[str, ...] = field(repr=False)
    meaningless: tuple[str, ...] = field(default=(), repr=False)
    usual_sampling_rate_hz: float = field(default=20480.0, repr=False)

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the published or demonstration machines."""
        return tuple(presets(self.name))

    def rig_name(self, preset_name: str) -> str:
        """Return the rig name for a recording simulated with this preset."""
        return f"simulated: {preset_name}"

    def rig_sources(self, preset_name: str) -> list[str]:
        """Return the sources that such a rig states."""
        return [f"simulated with the model {self.name!r}, preset {preset_name!r}; the truth is in the recording"]

    @abstractmethod
    def simulate(
        self, setup: SimulationSetup, rng: np.random.Generator, *, sampling_rate_hz: float, duration_s: float
    ) -> Recording:
        """Make a recording with rig and truth.

        Raises
        ------
        InputError
            If a name does not exist, a value is outside its range, the values are inconsistent, or an effect has no
            meaning here.
        """

    @abstractmethod
    def check_convergence(self, setup: SimulationSetup, rng: np.random.Generator) -> HasText:
        """Report how much a smaller integration step changes the result for the machine of this setup."""


# Checked parameter values, from defaults, preset and user.


def complete_values(parameters: Sequence[Parameter], *layers: Mapping[str, ParameterValue]) -> Values:
    """Return a value for every parameter: the defaults, overlaid with each layer in turn.

    Parameters
    ----------
    parameters : sequence of Parameter
    *layers : mappings
        Name → value; later layers win.

    Raises
    ------
    InputError
        If a name does not exist (with the closest that does) or a value is not allowed.
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
    """Suggest the closest name, or else the names that begin with the closest word."""
    from difflib import get_close_matches

    closest = closest_match_hint(name, names)
    words = get_close_matches(name.partition("_")[0], {n.partition("_")[0] for n in names}, n=1)
    if closest or not words:
        return closest or "`gearsig simulate MODEL --list` shows them all"
    return f"there are {', '.join(n for n in names if n.partition('_')[0] == words[0])}"


def checked_value(parameter: Parameter, value: object) -> ParameterValue | None:
    """Return the value if the parameter allows it, numbers as float; None or "none" where it may be derived."""
    if parameter.default is None and (value is None or value == "none"):
        return None
    if parameter.choices:
        return one_of(str(value), parameter.name, parameter.choices)
    if isinstance(value, bool):
        raise InputError(f"{parameter.name} is {value}", allowed="a number")
    low = -float("inf") if parameter.low is None else parameter.low
    high = float("inf") if parameter.high is None else parameter.high
    number = within(value, parameter.name, low, high, parameter.unit)  # type: ignore[arg-type]  # it says so itself
    if parameter.whole and number != round(number):
        raise InputError(f"{parameter.name} is {number:g}", allowed="a whole number")
    return number


# Typed access to complete parameter values.


@dataclass(frozen=True)
class ParameterValues:
    """Values as `sims.simulator.complete_values` returns them."""

    values: Values

    def number(self, name: str) -> float:
        """Value of a numeric parameter that must have one."""
        value = self.optional(name)
        if value is None:
            raise InputError(f"{name} has no value", remedy="complete the values first")
        return value

    def optional(self, name: str) -> float | None:
        """Value of a numeric parameter, None where it is derived from the others."""
        value = self.values[name]
        if isinstance(value, str):
            raise InputError(f"{name} is {value!r}", allowed="a number")
        return value

    def whole(self, name: str) -> int:
        """Value of an integer parameter."""
        return round(self.number(name))

    def word(self, name: str) -> str:
        """Value of a word parameter."""
        return str(self.values[name])

    def is_on(self, name: str) -> bool:
        """Whether a switch is on."""
        return self.word(name) == "on"


# Speed, torque and effects as users write them.


def effect_settings(effects: Mapping[str, float] | Sequence[EffectSetting] | None) -> tuple[EffectSetting, ...]:
    """Return effect settings, given as such or as name → severity."""
    if effects is None:
        return ()
    if isinstance(effects, (str, bytes)):  # type: ignore[unreachable]  # what a caller may give all the same
        raise InputError(f"effects is {effects!r}", allowed='name and severity, e.g. {"root_crack": 2.0}')
    if isinstance(effects, Mapping):
        return tuple(EffectSetting(name, severity) for name, severity in effects.items())
    return tuple(effects)


def as_profile(profile: ProfileLike | None, name: str) -> Profile | None:
    """Return a profile from a profile, a number or (time in s, value) points; None stays None."""
    if profile is None or isinstance(profile, Profile):
        return profile
    try:
        if isinstance(profile, Sequence):
            times, values = zip(*profile, strict=True)
            return Profile.of(times, values)
        return Profile.constant(profile)
    except (TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{name} is {profile!r}", allowed="a number, or (time in s, value) points") from None


# The version of the simulators' code that made a result.

_ROOMS = ("cracked", "effects", "forging", "gear_pair", "machine", "measure", "mesh", "reduced_fe")


def sources_digest() -> str:
    """Return a short hash of the simulators' code, so that cached results of another version are not used."""
    of_users = sha256(b"".join(path.read_bytes() for path in user_files())).hexdigest()[:8] if user_files() else ""
    return _listed_sources() + of_users


@cache
def _listed_sources() -> str:
    sims_folder = Path(__file__).parent
    digest = sha256()
    for room in _ROOMS:
        for path in sorted(sims_folder.glob(f"{room}.py")) or sorted((sims_folder / room).rglob("*.py")):
            digest.update(path.relative_to(sims_folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
