"""How strong each effect may plausibly be on a machine: one source for what a diagnosis tries and for what is drawn.

Lower ends are barely noticeable on most machines, upper ends are strong damage that still runs. Where a unit does not
scale with the machine by itself, the range is a share of something that does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.rig.types import Bearing
from sims.effects import effect
from sims.effects.bearing_choice import element_spacing_mm
from sims.effects.effect import Effect, OptionValue
from sims.effects.unbalance import LARGEST_OFFSET
from sims.gear_pair.bearing import EDGES_MM
from sims.gear_pair.usual import (
    Nominal,
    log_uniform,
    pitch_tolerance_um,
    profile_tolerance_um,
    runout_tolerance_um,
    usual_mass_kg,
)
from sims.machine import BearingSupport
from sims.mesh import GearGeometry
from sims.mesh.crack import deepest_crack_mm

Options = dict[str, OptionValue]
GEARS = ("driver", "driven")
RIPPLE_ORDERS = (1.0, 2.0, 3.0, 4.0, 6.0)
PATH_HZ = (1200.0, 3500.0)
_JITTER = 0.01


@dataclass(frozen=True)
class Surroundings:
    """A machine as the ranges need it.

    Parameters
    ----------
    nominal : Nominal
    gears : (GearGeometry, GearGeometry)
    bearings : tuple of Bearing
        That the rig names, with geometry.
    vibration_mps2 : float
        Rms of the sound machine at its nominal point.
    """

    nominal: Nominal
    gears: tuple[GearGeometry, GearGeometry]
    bearings: tuple[Bearing, ...]
    vibration_mps2: float

    def diameter_mm(self, options: Mapping[str, OptionValue]) -> float:
        """Pitch diameter of the gear that the options choose."""
        return self.nominal.pitch_diameters_mm[_side(options)]

    def bearing(self, options: Mapping[str, OptionValue]) -> Bearing:
        """Bearing that the options choose."""
        return next(b for b in self.bearings if b.name == options["bearing"])


Scale = Callable[[Surroundings, Options], float]
Drawn = Callable[[Surroundings, np.random.Generator], Options]


@dataclass(frozen=True)
class Plausible:
    """One effect's range.

    Parameters
    ----------
    low, high : float
        Severity over `scale`.
    why : str
    scale : callable
        In the severity's unit.
    choices : callable
        Option sets worth a try; nothing where the machine lacks what the effect needs.
    drawn : callable
        Random options.
    most : callable
        Greatest severity that the machine allows.
    n : int
        How many severities are worth a try, at even ratios.
    """

    low: float
    high: float
    why: str
    scale: Scale = lambda _m, _o: 1.0
    choices: Callable[[Surroundings], Sequence[Options]] = lambda _m: ({},)
    drawn: Drawn = lambda _m, _rng: {}
    most: Scale = lambda _m, _o: float("inf")
    n: int = 3

    def reach(self, name: str, machine: Surroundings, options: Options) -> tuple[float, float]:
        """Least and greatest severity with these options; the range keeps its width where the machine cuts it off."""
        scale = self.scale(machine, options)
        top = min(self.high * scale, self.most(machine, options), effect(name).severity.high)
        return top * self.low / self.high, top


def _side(options: Mapping[str, OptionValue]) -> int:
    return GEARS.index(str(options["gear"]))


def _either_gear(_machine: Surroundings) -> Sequence[Options]:
    return [{"gear": gear} for gear in GEARS]


def _one_tooth(_machine: Surroundings) -> Sequence[Options]:
    return [{"gear": gear, "tooth": 1.0} for gear in GEARS]


def _any_gear(_machine: Surroundings, rng: np.random.Generator) -> Options:
    return {"gear": str(rng.choice(GEARS))}


def _any_tooth(machine: Surroundings, rng: np.random.Generator) -> Options:
    options = _any_gear(machine, rng)
    return {**options, "tooth": float(rng.integers(machine.nominal.teeth[_side(options)]) + 1)}


def _each_bearing(machine: Surroundings) -> Sequence[Options]:
    return [{"bearing": b.name} for b in machine.bearings]


def _any_bearing(machine: Surroundings, rng: np.random.Generator) -> Options:
    return {"bearing": str(rng.choice([b.name for b in machine.bearings]))}


def _any_race(machine: Surroundings, rng: np.random.Generator) -> Options:
    return {**_any_bearing(machine, rng), "slip_percent": float(rng.uniform(0.0, 1.5))}


def _ball_mm(machine: Surroundings, options: Options) -> float:
    return machine.bearing(options).rolling_element_diameter_mm or 1.0


def _longest_mm(race: str) -> Scale:
    """The longest defect that does not hold two elements at once, less a fifth."""

    def longest(machine: Surroundings, options: Options) -> float:
        spacing = element_spacing_mm(BearingSupport(machine.bearing(options), 1.0, 1.0, 0.0), race) or 1.0
        return 0.8 * (spacing * (1.0 - 6.0 * _JITTER) - 2.0 * EDGES_MM)

    return longest


def _deepest_mm(machine: Surroundings, options: Options) -> float:
    return deepest_crack_mm(machine.gears[_side(options)], float(options.get("angle_deg", 45.0)))


def _module_mm(machine: Surroundings, _options: Options) -> float:
    return machine.nominal.module_mm


def _force_share_g_mm(machine: Surroundings, options: Options) -> float:
    """Unbalance whose force at the nominal speed is the static mesh force."""
    omega = machine.nominal.speed_rpm * np.pi / 30.0
    if _side(options) == 1:
        omega *= machine.nominal.teeth[0] / machine.nominal.teeth[1]
    return float(machine.nominal.mesh_force_n / omega**2 * 1e6)


def _most_g_mm(machine: Surroundings, options: Options) -> float:
    radius = 0.5 * machine.diameter_mm(options)
    return 0.8 * LARGEST_OFFSET * radius * usual_mass_kg(machine.nominal, _side(options)) * 1e3


def _iso(tolerance: Callable[[float, float], float]) -> Scale:
    return lambda machine, options: tolerance(machine.nominal.module_mm, machine.diameter_mm(options))


PLAUSIBLE: dict[str, Plausible] = {
    "root_crack": Plausible(
        0.2,
        0.85,
        "of the deepest crack that the tooth bears; below a fifth the stiffness hardly changes",
        _deepest_mm,
        _one_tooth,
        lambda m, rng: {**_any_tooth(m, rng), "angle_deg": float(rng.uniform(35.0, 75.0))},
        lambda m, o: 0.95 * _deepest_mm(m, o),
    ),
    "tooth_spall": Plausible(
        15.0,
        85.0,
        "percent of the face; a pit of a tenth is lost in ordinary flanks, 90 is the model's limit",
        lambda _m, _o: 1.0,
        lambda m: [{**o, "length_mm": 0.45 * m.nominal.module_mm} for o in _one_tooth(m)],
        lambda m, rng: {**_any_tooth(m, rng), "length_mm": m.nominal.module_mm * log_uniform(rng, 0.2, 1.0)},
    ),
    "chipped_tooth": Plausible(
        0.2,
        0.9,
        "of the module: a broken corner to half of the tooth's height; smaller chips lie in double contact",
        _module_mm,
        lambda m: [{**o, "width_percent": 85.0} for o in _one_tooth(m)],
        lambda m, rng: {**_any_tooth(m, rng), "width_percent": float(rng.choice((30.0, 60.0, 85.0, 100.0)))},
    ),
    "tooth_wear": Plausible(
        1.0,
        10.0,
        "of the profile tolerance of class 5 of ISO 1328: to that of class 11 or 12",
        _iso(profile_tolerance_um),
        _either_gear,
        _any_gear,
    ),
    "pitch_error": Plausible(
        0.4,
        3.0,
        "standard deviation over the pitch tolerance of class 5, which is a limit: of classes 5 to 11",
        _iso(pitch_tolerance_um),
        _either_gear,
        _any_gear,
    ),
    "surface_roughness": Plausible(
        0.3, 2.5, "um: ground flanks have 0.4, hobbed or run-out ones 1 to 3; it does not grow with the gear"
    ),
    "sliding_friction": Plausible(0.03, 0.4, "mixed film with worn-out oil to dry, rough steel"),
    "eccentricity": Plausible(
        1.0,
        8.0,
        "half of the run-out over F_r of class 5: gears of class 7 to 13, or a bent shaft",
        _iso(runout_tolerance_um),
        _either_gear,
        _any_gear,
    ),
    "unbalance": Plausible(
        0.01,
        0.15,
        "its force at the nominal speed over the static mesh force; less is lost beside the mesh",
        _force_share_g_mm,
        _either_gear,
        _any_gear,
        _most_g_mm,
    ),
    "misalignment": Plausible(
        0.4,
        4.0,
        "degrees: elastic couplings bear 1, universal joints more; the model goes to 5",
        choices=lambda _m: [{"shaft": side} for side in GEARS],
        drawn=lambda _m, rng: {"shaft": str(rng.choice(GEARS))},
    ),
    "torque_ripple": Plausible(
        2.0,
        30.0,
        "percent: inverters give 1 to 5, piston engines and pumps tens",
        choices=lambda _m: [{"order": order} for order in RIPPLE_ORDERS],
        drawn=lambda _m, rng: {"order": _any_order(rng)},
    ),
    "speed_fluctuation": Plausible(
        0.2,
        5.0,
        "percent: a controlled drive holds 0.1, a hunting one swings by several",
        choices=lambda _m: [{"frequency_hz": 1.0}],
        drawn=lambda _m, rng: {"frequency_hz": log_uniform(rng, 0.3, 8.0)},
    ),
    "backlash": Plausible(25.0, 300.0, "um per mm of module; new gears have some 20 to 50", _module_mm),
    "bearing_outer_race": Plausible(
        0.01,
        0.15,
        "of the rolling element's diameter; beyond half a millimetre or so the knocks grow no more",
        _ball_mm,
        _each_bearing,
        _any_race,
        _longest_mm("outer"),
    ),
    "bearing_inner_race": Plausible(
        0.01, 0.15, "as on the outer race", _ball_mm, _each_bearing, _any_race, _longest_mm("inner")
    ),
    "bearing_clearance": Plausible(
        3.0,
        40.0,
        "um per mm of module: clearance classes C3 to C5 of a bearing of the machine's size, to a worn-out one",
        _module_mm,
        _each_bearing,
        _any_bearing,
    ),
    "transfer_path": Plausible(
        2.0,
        20.0,
        "amplification: a well damped to a sharp resonance",
        choices=lambda _m: [{"frequency_hz": f} for f in PATH_HZ],
        drawn=lambda _m, rng: {
            "frequency_hz": log_uniform(rng, 400.0, 7000.0),
            "damping_ratio": log_uniform(rng, 0.01, 0.08),
        },
    ),
    "mains_hum": Plausible(
        0.03,
        1.0,
        "of the sound machine's vibration",
        lambda m, _o: m.vibration_mps2,
        lambda _m: [{"frequency_hz": 50.0}],
        lambda _m, rng: {
            "frequency_hz": float(rng.choice((50.0, 60.0))),
            "harmonics_percent": float(rng.uniform(0.0, 80.0)),
        },
    ),
    "clipping": Plausible(0.3, 12.0, "percent of the time: rare peaks to a grossly wrong range"),
}
"""By the effect's name."""


def _any_order(rng: np.random.Generator) -> float:
    """Whole orders of motors and pumps twice as often as any order of something geared or belted to the drive."""
    if rng.uniform() < 2.0 / 3.0:
        return float(rng.choice((1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)))
    return float(rng.uniform(1.5, 16.0))


def plausible_of(own: Effect) -> Plausible:
    """Return the range of an effect that is not listed: a third to three times its typical severity.

    It is tried on each gear, shaft or bearing that it may be on, at the first tooth, with its other options as they
    are by default.
    """
    severity = own.severity

    def choices(machine: Surroundings) -> Sequence[Options]:
        found: list[Options] = [{}]
        for option in own.options:
            words = [b.name for b in machine.bearings] if option.name == "bearing" else option.choices
            if words:
                found = [{**options, option.name: word} for options in found for word in words]
            elif option.name == "tooth":
                found = [{**options, "tooth": 1.0} for options in found]
        return found

    def drawn(machine: Surroundings, rng: np.random.Generator) -> Options:
        every = choices(machine)
        return dict(every[int(rng.integers(len(every)))])

    return Plausible(
        max(severity.low, severity.typical / 3.0),
        min(severity.high, 3.0 * severity.typical),
        "about its typical severity",
        choices=choices,
        drawn=drawn,
    )
