"""What an effect is: a change to a machine or to its measurement chain, with one severity in physical units."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import closest_match_hint, one_of, within
from gearsig.errors import InputError
from sims.machine import Machine

GROUPS = ("tooth-local", "flank", "shaft", "drive and load", "bearing", "measurement chain")

OptionValue = float | str


@dataclass(frozen=True)
class Severity:
    """The one number that says how strong an effect is.

    Parameters
    ----------
    name, unit, meaning : str
    low, high : float
        What may be given; a machine may allow less (a crack no deeper than its tooth).
    typical : float
        A medium case.
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    meaning: str


@dataclass(frozen=True)
class Option:
    """A further choice of an effect: which gear, tooth, bearing, order.

    Parameters
    ----------
    name : str
    default : float, str or None
        None: a number that the effect draws from its random stream where it is not given (an angle, a phase).
    meaning : str
    unit : str
    low, high : float or None
        Range of a number.
    choices : tuple of str
        Allowed words; empty for a number, or for a name that only the machine knows (a bearing).
    whole : bool
        A whole number is wanted.
    """

    name: str
    default: OptionValue | None
    meaning: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    choices: tuple[str, ...] = ()
    whole: bool = False

    def check(self, value: OptionValue, effect: str) -> OptionValue:
        """Return the value if it is allowed, a number as float."""
        where = f"{self.name} of {effect}"
        if isinstance(self.default, str):
            text = str(value)
            return one_of(text, where, self.choices) if self.choices else text
        low = -np.inf if self.low is None else self.low
        number = within(value, where, low, np.inf if self.high is None else self.high, self.unit)  # type: ignore[arg-type]  # says so itself
        if self.whole and number != round(number):
            raise InputError(f"{where} is {number:g}", allowed="a whole number")
        return number


GEAR_OPTION = Option("gear", "driver", "which gear", choices=("driver", "driven"))
"""Most tooth and wheel effects have it."""
TOOTH_OPTION = Option("tooth", 1.0, "which tooth, from 1 at the mark", low=1.0, high=5000.0, whole=True)
"""Tooth-local effects have it."""

SHOWS_IN = (
    "mesh_harmonics",
    "mesh_sidebands",
    "shaft_orders",
    "tooth_window",
    "envelope_orders",
    "broadband",
    "mains_lines",
    "amplitude_tail",
    "resonances",
    "speed",
    "low_load",
)
"""Kinds of places that an effect may say it shows in."""

Change = Callable[[Machine, float, Mapping[str, OptionValue], np.random.Generator], Machine]


@dataclass(frozen=True)
class Effect:
    """A physical effect that a simulator can switch on.

    Parameters
    ----------
    name : str
        Canonical, e.g. "root_crack".
    group : str
        One of `GROUPS`.
    title : str
        For people, e.g. "crack in a tooth root".
    severity : Severity
    changes : str
        What it changes in the model or in the chain, in one or two sentences.
    signature : str
        Where it is expected to show, from theory.
    shows_in : tuple of str
        The same for programs: of `SHOWS_IN`.
    change : callable
        (machine, severity, options, rng) → machine, for a severity above 0. Its change vanishes with the severity, and
        what it draws does not depend on it, so that one seed at rising severities shows one fault that grows.
    options : tuple of Option
    """

    name: str
    group: str
    title: str
    severity: Severity
    changes: str
    signature: str
    shows_in: tuple[str, ...]
    change: Change
    options: tuple[Option, ...] = ()

    def __post_init__(self) -> None:
        one_of(self.group, f"group of {self.name}", GROUPS)
        for shown in self.shows_in:
            one_of(shown, f"shows_in of {self.name}", SHOWS_IN)

    def apply(
        self,
        machine: Machine,
        severity: float,
        options: Mapping[str, OptionValue],
        rng: np.random.Generator,
    ) -> Machine:
        """Return the machine with the effect, after checking severity and options; at severity 0, the machine itself.

        Raises
        ------
        InputError
            If the severity or an option is outside its range, or the machine allows less.
        """
        s = self.severity
        within(severity, f"{s.name} of {self.name}", s.low, s.high, s.unit)
        complete = self.complete(options)
        return machine if severity == 0 else self.change(machine, float(severity), complete, rng)

    def complete(self, options: Mapping[str, OptionValue]) -> dict[str, OptionValue]:
        """Return the options, checked, with defaults for those not given; those left to be drawn are not in it."""
        names = [option.name for option in self.options]
        for name in options:
            if name not in names:
                raise InputError(
                    f"{self.name} has no option {name!r}",
                    allowed=", ".join(names) or "none",
                    remedy=closest_match_hint(name, names),
                )
        given = {o: options.get(o.name, o.default) for o in self.options}
        return {o.name: o.check(value, self.name) for o, value in given.items() if value is not None}


@dataclass(frozen=True)
class EffectSetting:
    """An effect that is switched on."""

    name: str
    severity: float
    options: Mapping[str, OptionValue] = field(default_factory=dict)
