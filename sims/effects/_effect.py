"""An effect: a change to a machine or to its measurement chain, with one severity in physical units.

An effect's file holds all of it: physics, range and plausible severities, where it shows, what it means for the models
that are no pair of gears between bearings, and how the literature says that it shows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from gearsig.checks import known_name, one_of, within
from gearsig.errors import InputError
from gearsig.rig import Bearing
from sims.effects.textbook import Textbook
from sims.machine import Machine, Nominal, WeakTooth
from sims.mesh import GearGeometry, PairGeometry

GROUPS = ("tooth-local", "flank", "shaft", "drive and load", "bearing", "measurement chain")

OptionValue = float | str
Options = Mapping[str, OptionValue]


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

Change = Callable[[Machine, float, Options, np.random.Generator], Machine]

# --------------------
# How strong it may plausibly be on a machine: one source for what a diagnosis tries and for what is drawn.
# --------------------


@dataclass(frozen=True)
class MachineFacts:
    """What plausible severities scale with on a machine.

    Parameters
    ----------
    nominal : Nominal
    gears : (GearGeometry, GearGeometry)
    bearings : tuple of Bearing
        That the rig names, with geometry.
    vibration_mps2 : float
        Rms of the healthy machine at its nominal point.
    play_um : float
        Between the flanks, along the line of action.
    """

    nominal: Nominal
    gears: tuple[GearGeometry, GearGeometry]
    bearings: tuple[Bearing, ...]
    vibration_mps2: float
    play_um: float

    def diameter_mm(self, side: int) -> float:
        """Pitch diameter of the driver (0) or the driven gear (1)."""
        return self.nominal.pitch_diameters_mm[side]

    def bearing(self, options: Options) -> Bearing:
        """Bearing that the options choose."""
        return next(b for b in self.bearings if b.name == options["bearing"])


Scale = Callable[[MachineFacts, Options], float]


@dataclass(frozen=True)
class PlausibleRange:
    """From what is barely noticeable on most machines to strong damage that still runs.

    Parameters
    ----------
    low, high : float
        Severity over `scale`.
    why : str
    scale : callable
        Something of the machine, in the severity's unit, where that unit does not scale with the machine by itself.
    choices : callable
        Option sets worth a try; nothing where the machine lacks what the effect needs.
    drawn : callable
        Random options.
    largest : callable
        Largest severity that the machine allows.
    n_severities : int
        Worth a try, at even ratios.
    further_settings : callable
        Further option sets, with which the fault of a tooth takes another profile over the engagement, and with which
        of these severities each is worth a try, counted from 0; 0.5 lies halfway between the first two, in logarithms.
    """

    low: float
    high: float
    why: str
    scale: Scale = lambda _machine, _options: 1.0
    choices: Callable[[MachineFacts], Sequence[Options]] = lambda _machine: ({},)
    drawn: Callable[[MachineFacts, np.random.Generator], Options] = lambda _machine, _rng: {}
    largest: Scale = lambda _machine, _options: float("inf")
    n_severities: int = 3
    further_settings: Callable[[MachineFacts], Sequence[tuple[Options, Sequence[float]]]] = lambda _machine: ()


# --------------------
# What it means for a start–stop drive.
# --------------------


class DriveParameters(Protocol):
    """Complete parameters of a start–stop drive as effects read them; see `sims.forging`."""

    def number(self, name: str) -> float:
        """Value of a parameter."""
        ...

    def highest(self, name: str) -> float:
        """Largest value that the parameter may have."""
        ...

    def gear_pair(self) -> PairGeometry:
        """Teeth of both gears."""
        ...


@dataclass(frozen=True)
class DriveEffect:
    """What an effect makes of a start–stop drive: other values of parameters, and perhaps a weak tooth."""

    values: Mapping[str, float] = field(default_factory=dict)
    weak_tooth: WeakTooth | None = None


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
    plausible : PlausibleRange or None
        None: a third to three times the typical severity, on each gear, shaft or bearing that it may be on, at the
        first tooth, other options as by default.
    on_drive : callable or None
        (parameters, severity, options) → change of a start–stop drive; None: it has no meaning there.
    textbook : Textbook or None
        How the literature says that it shows.
    moves_pitches : float
        By how much, either way, its place within a tooth's engagement moves between severities that are tried; 0: it
        stays where it is.
    is_on_every_tooth : bool
        Whether it sits on all teeth of a gear, on each by itself.
    profile_varies_with : str
        Name of its severity or of an option with which the profile of its change over a tooth's engagement varies
        steadily; empty: it varies with nothing.
    turns_with_shaft : bool
        Whether it is a force that turns with a shaft: of a linear machine it makes the first order and no multiple.
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
    plausible: PlausibleRange | None = None
    on_drive: Callable[[DriveParameters, float, Options], DriveEffect] | None = None
    textbook: Textbook | None = None
    moves_pitches: float = 0.0
    is_on_every_tooth: bool = False
    profile_varies_with: str = ""
    turns_with_shaft: bool = False

    def __post_init__(self) -> None:
        if not self.name.isidentifier():  # it stands in --effect NAME=SEVERITY, in addresses and in tables
            raise InputError(f"an effect is called {self.name!r}", allowed="letters, digits and underscores")
        one_of(self.group, f"group of {self.name}", GROUPS)
        one_of(
            self.profile_varies_with,
            f"profile_varies_with of {self.name}",
            ("", self.severity.name, *(option.name for option in self.options)),
        )
        for shown in self.shows_in:
            one_of(shown, f"shows_in of {self.name}", SHOWS_IN)

    def apply(
        self,
        machine: Machine,
        severity: float,
        options: Options,
        rng: np.random.Generator,
    ) -> Machine:
        """Return the machine with the effect, after checking severity and options; at severity 0, the machine itself.

        Raises
        ------
        InputError
            If the severity or an option is outside its range, or the machine allows less.
        """
        self.check_severity(severity)
        complete = self.complete(options)
        return machine if severity == 0 else self.change(machine, float(severity), complete, rng)

    def check_severity(self, severity: float) -> float:
        """Return the severity if it is in its range."""
        s = self.severity
        return within(severity, f"{s.name} of {self.name}", s.low, s.high, s.unit)

    @property
    def plausible_range(self) -> PlausibleRange:
        """`plausible`, or about its typical severity where the effect states none."""
        return self.plausible or _about_typical(self)

    def plausible_severities(self, machine: MachineFacts, options: Options) -> tuple[float, float]:
        """Smallest and largest severity with these options; the range keeps its width where the machine cuts it off."""
        plausible = self.plausible_range
        scale = plausible.scale(machine, options)
        top = min(plausible.high * scale, plausible.largest(machine, options), self.severity.high)
        return top * plausible.low / plausible.high, top

    def complete(self, options: Options) -> dict[str, OptionValue]:
        """Return the options, checked, with defaults for those not given; those left to be drawn are not in it."""
        names = [option.name for option in self.options]
        for name in options:
            known_name(name, names, f"{self.name} has no option {name!r}")
        values = {o: options.get(o.name, o.default) for o in self.options}
        return {o.name: o.check(value, self.name) for o, value in values.items() if value is not None}


def _about_typical(effect: Effect) -> PlausibleRange:
    """A third to three times the typical severity, with the option sets that `Effect` tells."""

    def choices(machine: MachineFacts) -> Sequence[Options]:
        sets: list[Options] = [{}]
        for option in effect.options:
            words = [b.name for b in machine.bearings] if option.name == "bearing" else option.choices
            if words:
                sets = [{**options, option.name: word} for options in sets for word in words]
            elif option.name == "tooth":
                sets = [{**options, "tooth": 1.0} for options in sets]
        return sets

    def drawn(machine: MachineFacts, rng: np.random.Generator) -> Options:
        sets = choices(machine)
        return sets[int(rng.integers(len(sets)))]

    severity = effect.severity
    low, high = max(severity.low, severity.typical / 3.0), min(severity.high, 3.0 * severity.typical)
    return PlausibleRange(low, high, "about its typical severity", choices=choices, drawn=drawn)


@dataclass(frozen=True)
class EffectSetting:
    """An effect that is switched on."""

    name: str
    severity: float
    options: Options = field(default_factory=dict)
