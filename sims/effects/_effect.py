"""An effect: a change to a machine or its measurement chain, with one severity in physical units.

An effect's file defines everything: physics, range and plausible severities, where it shows, what it means for models
other than a gear pair between bearings, and its signature in the literature. Every module of this package with an
`EFFECT` is an effect; so is a user's own file with one.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import iter_modules
from typing import Protocol
from zlib import crc32

import numpy as np

from gearsig.checks import known_name, one_of, within
from gearsig.errors import GearsigError, InputError
from gearsig.gap import GapEffect
from gearsig.rig import Bearing
from sims.effects.textbook import Textbook
from sims.machine import Machine, Nominal, WeakTooth
from sims.mesh import GearGeometry, PairGeometry

GROUPS = ("tooth-local", "flank", "shaft", "drive and load", "bearing", "measurement chain")

OptionValue = float | str
Options = Mapping[str, OptionValue]


@dataclass(frozen=True)
class Severity:
    """The single number that says how strong an effect is.

    Parameters
    ----------
    name, unit, meaning : str
    low, high : float
        Allowed range; a machine may allow less (a crack no deeper than its tooth).
    typical : float
        A moderate case.
    """

    name: str
    unit: str
    low: float
    high: float
    typical: float
    meaning: str


@dataclass(frozen=True)
class Option:
    """A further setting of an effect: which gear, tooth, bearing or order.

    Parameters
    ----------
    name : str
    default : float, str or None
        None: a number that the effect draws from its random stream if not given (an angle, a phase).
    meaning : str
    unit : str
    low, high : float or None
        Range of a number.
    choices : tuple of str
        Allowed words; empty for a number, or for a name defined by the machine (a bearing).
    whole : bool
        Whether the number must be an integer.
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
        """Return the value if it is allowed, numbers as float."""
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
"""Option of most tooth and gear effects."""
TOOTH_OPTION = Option("tooth", 1.0, "which tooth, from 1 at the mark", low=1.0, high=5000.0, whole=True)
"""Option of tooth-local effects."""

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
"""Kinds of features that an effect may state it shows in."""

Change = Callable[[Machine, float, Options, np.random.Generator], Machine]

# --------------------
# Plausible severities on a machine: the same source for the diagnosis's candidates and for random draws.
# --------------------


@dataclass(frozen=True)
class MachineFacts:
    """Quantities of a machine with which plausible severities scale.

    Parameters
    ----------
    nominal : Nominal
    gears : (GearGeometry, GearGeometry)
    bearings : tuple of Bearing
        Those named by the rig, with geometry.
    vibration_mps2 : float
        Rms of the healthy machine at its nominal operating point.
    play_um : float
        Backlash along the line of action.
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
        """Bearing selected by the options."""
        return next(b for b in self.bearings if b.name == options["bearing"])


Scale = Callable[[MachineFacts, Options], float]


@dataclass(frozen=True)
class PlausibleRange:
    """Range of severities, from barely noticeable on most machines to severe damage with which they still run.

    Parameters
    ----------
    low, high : float
        Severity relative to `scale`.
    why : str
    scale : callable
        A quantity of the machine in the severity's unit, where that unit does not itself scale with the machine.
    choices : callable
        Option sets to try; empty if the machine lacks what the effect needs.
    drawn : callable
        Random options.
    largest : callable
        Largest severity that the machine allows.
    n_severities : int
        Number of severities to try, with equal ratios.
    further_settings : callable
        Further option sets, for which a tooth fault has another profile over the engagement, each with the indices of
        the severities to try, counted from 0; 0.5 is halfway between the first two, in logarithms.
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
# Effects on a start–stop drive.
# --------------------


class DriveParameters(Protocol):
    """Access of effects to the complete parameters of a start–stop drive; see `sims.forging`."""

    def number(self, name: str) -> float:
        """Value of a parameter."""
        ...

    def highest(self, name: str) -> float:
        """Upper limit of a parameter."""
        ...

    def gear_pair(self) -> PairGeometry:
        """Geometry of the gear pair."""
        ...


@dataclass(frozen=True)
class DriveEffect:
    """Changes of a start–stop drive by an effect: new parameter values, and possibly a weak tooth."""

    values: Mapping[str, float] = field(default_factory=dict)
    weak_tooth: WeakTooth | None = None


@dataclass(frozen=True)
class Effect:
    """A physical effect that a simulator can switch on.

    Parameters
    ----------
    name : str
        Identifier, e.g. "root_crack".
    group : str
        One of `GROUPS`.
    title : str
        For readers, e.g. "crack in a tooth root".
    severity : Severity
    changes : str
        What it changes in the model or in the measurement chain, in one or two sentences.
    signature : str
        Where it is expected to show, from theory.
    shows_in : tuple of str
        The same for programs: members of `SHOWS_IN`.
    change : callable
        (machine, severity, options, rng) → machine, for a severity above 0. The change vanishes with the severity, and
        random draws do not depend on it, so that one seed with increasing severity shows one growing fault.
    options : tuple of Option
    plausible : PlausibleRange or None
        None: a third to three times the typical severity, on each possible gear, shaft or bearing, at the first tooth,
        with the defaults of other options.
    on_drive : callable or None
        (parameters, severity, options) → change of a start–stop drive; None: it has no meaning there.
    textbook : Textbook or None
        Its signature in the literature.
    moves_pitches : float
        Shift, in either direction, of its position within a tooth's engagement between tried severities, in pitches;
        0: it does not move.
    is_on_every_tooth : bool
        Whether it affects all teeth of a gear, each independently.
    profile_varies_with : str
        Name of the severity or option with which the profile of its change over a tooth's engagement varies
        continuously; empty: none.
    turns_with_shaft : bool
        Whether it is a force rotating with a shaft: in a linear machine it excites the first order and no multiples.
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
        if not self.name.isidentifier():  # it is used in --effect NAME=SEVERITY, in addresses and in tables
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
        """Check severity and options, and return the machine with the effect; at severity 0, the machine itself.

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
        """`plausible`, or a range about the typical severity if the effect states none."""
        return self.plausible or _about_typical(self)

    def plausible_severities(self, machine: MachineFacts, options: Options) -> tuple[float, float]:
        """Minimum and maximum severity with these options; a machine limit shifts the range but does not narrow it."""
        plausible = self.plausible_range
        scale = plausible.scale(machine, options)
        top = min(plausible.high * scale, plausible.largest(machine, options), self.severity.high)
        return top * plausible.low / plausible.high, top

    def complete(self, options: Options) -> dict[str, OptionValue]:
        """Return the checked options, with defaults for those not given; those to be drawn are omitted."""
        names = [option.name for option in self.options]
        for name in options:
            known_name(name, names, f"{self.name} has no option {name!r}")
        values = {o: options.get(o.name, o.default) for o in self.options}
        return {o.name: o.check(value, self.name) for o, value in values.items() if value is not None}


def _about_typical(effect: Effect) -> PlausibleRange:
    """A third to three times the typical severity, with the option sets described in `Effect`."""

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


# --------------------
# Users' effects: Python files outside this package, each with an `EFFECT`.
#
# Their paths are in the environment variable `GEARSIG_EFFECTS`, so that child processes find them too.
# --------------------


VARIABLE = "GEARSIG_EFFECTS"


def user_files() -> tuple[Path, ...]:
    """Return the files of the user's effects."""
    return tuple(Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text)


def loaded(path: Path) -> Effect:
    """Return the effect defined by a file.

    Raises
    ------
    InputError
        If there is no such file, it does not run, or it defines no effect.
    """
    spec = spec_from_file_location(f"own_effect_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError("is not a Python file", where=str(path), remedy="give a file NAME.py that defines EFFECT")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # anything: it is user code
        raise InputError(f"does not run ({type(error).__name__}: {error})", where=str(path)) from error
    effect_of_file = getattr(module, "EFFECT", None)
    if not isinstance(effect_of_file, Effect):
        raise InputError(
            "defines no effect",
            where=str(path),
            remedy="set EFFECT = Effect(…), as sims/effects/tooth_wear.py does",
        )
    return replace(effect_of_file, change=partial(_changed, path, effect_of_file))


def _changed(
    path: Path,
    user_effect: Effect,
    machine: Machine,
    severity: float,
    options: Options,
    rng: np.random.Generator,
) -> Machine:
    """Apply a user's effect to a machine.

    Raises
    ------
    InputError
        If it fails, or returns no machine.
    """
    try:
        changed = user_effect.change(machine, severity, options, rng)
    except GearsigError:
        raise
    except (Exception, SystemExit) as error:  # anything: it is user code
        raise InputError(
            f"the effect {user_effect.name!r} fails ({type(error).__name__}: {error})", where=str(path)
        ) from error
    if not isinstance(changed, Machine):
        raise InputError(
            f"the effect {user_effect.name!r} returns {type(changed).__name__} instead of a machine",
            where=str(path),
            remedy="let change return the machine, as sims/effects/tooth_wear.py does",
        )
    return changed


@cache
def effects() -> dict[str, Effect]:
    """Return all effects by name, in the order of the groups.

    Raises
    ------
    InputError
        If a user's effect file cannot be used.
    """
    by_name = dict(_listed())
    for path in user_files():
        further = loaded(path)
        if further.name in by_name:
            raise InputError(
                f"there is already an effect {further.name!r}", where=str(path), remedy="choose another name"
            )
        by_name[further.name] = further
    return dict(sorted(by_name.items(), key=lambda item: (GROUPS.index(item[1].group), item[0])))


def add_effect(path: str | Path) -> Effect:
    """Add an effect of your own from a Python file, in this process and its child processes.

    Parameters
    ----------
    path : str or Path
        File with `EFFECT = Effect(…)`.

    Raises
    ------
    InputError
        If it cannot be used, or an effect of that name already exists.
    """
    before = os.environ.get(VARIABLE)
    files = dict.fromkeys([*map(str, user_files()), str(Path(path).resolve())])
    os.environ[VARIABLE] = os.pathsep.join(files)
    effects.cache_clear()
    try:
        effects()
    except InputError:
        if before is None:
            del os.environ[VARIABLE]
        else:
            os.environ[VARIABLE] = before
        effects.cache_clear()
        raise
    return effect(loaded(Path(path)).name)


def is_user_effect(name: str) -> bool:
    """Whether an effect is a user's and not this package's."""
    return name in effects() and name not in _listed()


@cache
def _listed() -> dict[str, Effect]:
    """Return the effects of this package by name."""
    import sims.effects as package

    modules = [import_module(f"sims.effects.{m.name}") for m in iter_modules(package.__path__)]
    listed = [m.EFFECT for m in modules if hasattr(m, "EFFECT")]
    return {e.name: e for e in listed}


def effect(name: str) -> Effect:
    """Return the effect called `name`."""
    remedy = f"name the file of an effect of your own in {VARIABLE}"
    return effects()[known_name(name, effects(), f"there is no effect {name!r}", remedy=remedy)]


def as_gap_effect(shown: Effect) -> GapEffect:
    """Convert an effect to the gap diagnosis's type."""
    return GapEffect(
        shown.name,
        shown.group,
        shown.title,
        shown.severity.name,
        shown.severity.unit,
        shown.signature,
        shown.shows_in,
        shown.group == "measurement chain",
        shown.textbook.signs if shown.textbook else (),
        shown.moves_pitches,
        shown.is_on_every_tooth,
        shown.profile_varies_with,
        shown.turns_with_shaft,
    )


def completed(settings: Iterable[EffectSetting]) -> tuple[EffectSetting, ...]:
    """Return the settings with all their options, defaults included.

    Raises
    ------
    InputError
        If an effect or an option does not exist, or an option's value is not allowed.
    """
    return tuple(EffectSetting(s.name, s.severity, effect(s.name).complete(s.options)) for s in settings)


def with_effects(machine: Machine, settings: Iterable[EffectSetting], rng: np.random.Generator) -> Machine:
    """Return the machine with the effects switched on, mechanical ones first.

    Every effect draws from its own stream, seeded by one number from `rng` and the effect's name: adding an effect does
    not change the draws of the others, and exactly one number is taken from `rng`.
    """
    seed = int(rng.integers(2**63))
    chosen = sorted(settings, key=lambda s: GROUPS.index(effect(s.name).group))
    for place, setting in enumerate(chosen):
        same_before = sum(s.name == setting.name for s in chosen[:place])
        stream = np.random.default_rng([seed, crc32(setting.name.encode()), same_before])
        machine = effect(setting.name).apply(machine, setting.severity, setting.options, stream)
    return machine
