"""A model of a gear pair set to a rig, for the gap diagnosis: see `gearsig.gap`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from math import cos, pi, radians, sin, sqrt, tan
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from gearsig.checks import count
from gearsig.errors import InputError, RefusalError
from gearsig.gap import Added, GapEffect, OperatingCondition
from gearsig.recording import Recording
from gearsig.rig import Bearing, OperatingPoint, Rig, rig_to_dict
from sims.effects import GEARS, LARGEST_OFFSET, Effect, EffectSetting, OptionValue, effect, effects, element_spacing_mm
from sims.gear_pair._bearing import EDGES_MM
from sims.gear_pair._installed import HousingMode, SensorSeat, completed, further_seats, installed_of_rig, table_of
from sims.machine import BearingSupport
from sims.mesh import GearGeometry, PairGeometry, deepest_crack_mm
from sims.presets import Preset, preset_text
from sims.registry import sources_digest
from sims.simulator import ParameterValue

# --------------------
# Parameters of a pair of which only the rig's data are known: the rest is usual for its size.
#
# Middles of the ranges from which gearboxes for calibrations are drawn. They are plausible, not measured.
# --------------------


USUAL_LOAD_N_PER_MM2 = 50.0
"""Force per face width and module of a pair whose torque is not known; rated gears carry 20 to 120."""
LARGEST_LOAD_N_PER_MM2 = 500.0
"""Bends a tooth's root, with a form factor of 3, by 1500 N/mm²: more than hardened steel stands."""
USUAL_WIDTH_MODULES = 10.0
USUAL_MESH_HZ = 540.0
"""Mesh frequency of a pair whose speed is not known."""
STIFFNESS_N_PER_MM_UM = 14.0
"""Usual stiffness of a pair of steel gears per face width."""
RELIEF_SHARE, RELIEF_LENGTH_MODULES = 0.8, 1.1
"""Tip relief over the deflection under the nominal load; its length along the line of action."""
PITCH_RMS_SHARE, RUNOUT_SHARE = 0.1, 0.3
"""A ground gear's rms pitch deviation over f_pt, its eccentricity over F_r: tolerances of class 5 of ISO 1328."""
BODY_KG, MOUNTS_HZ, MOUNTS_DAMPING = 40.0, 6.0, 0.3
"""A housing with its bed, of a machine of size 1; below its mounts' frequency nothing that turns is slow enough."""
BODY_SHAPES = ((1.0, 1.0, 1.0, 1.0), (1.0, -1.0, 1.0, -1.0))
"""Heave and pitch of that housing at bearings 1 to 4, the first two at the ends of one shaft."""
UNBALANCE_UM = 30.0
"""Offset of the centre of mass; 40 um are balance grade G 6.3 at 1500 rpm."""
COUPLING_BENDING_SHARE = 0.01
"""A coupling's bending stiffness over the torsional one of shaft and coupling: catalogues have 0.002 (steel discs) to
0.05 (elastomer)."""


@dataclass(frozen=True)
class Nominal:
    """What a rig says of its pair, completed by what is usual.

    Parameters
    ----------
    teeth : (int, int)
    module_mm, face_width_mm, pressure_angle_deg : float
    speed_rpm, torque_nm : float
        Of the driver.
    assumed : tuple of str
        What the rig does not say.
    """

    teeth: tuple[int, int]
    module_mm: float
    face_width_mm: float
    pressure_angle_deg: float
    speed_rpm: float
    torque_nm: float
    assumed: tuple[str, ...] = ()

    @property
    def size(self) -> float:
        """Of the machine, 1 for module 2."""
        return self.module_mm / 2.0

    @property
    def pitch_diameters_mm(self) -> tuple[float, float]:
        """Of driver and driven gear."""
        return self.module_mm * self.teeth[0], self.module_mm * self.teeth[1]

    @property
    def mesh_force_n(self) -> float:
        """Static force between the teeth, tangential."""
        return 2e3 * self.torque_nm / self.pitch_diameters_mm[0]

    @property
    def deflection_um(self) -> float:
        """Of the teeth under the nominal load."""
        return self.mesh_force_n / self.face_width_mm / STIFFNESS_N_PER_MM_UM

    @property
    def mesh_hz(self) -> float:
        """Tooth passings per second."""
        return self.speed_rpm / 60.0 * self.teeth[0]


def nominal_of(rig: Rig) -> Nominal:
    """Return what a rig says of its only pair.

    Raises
    ------
    RefusalError
        If there is no pair or more than one, or if teeth or module are not known.
    """
    if len(rig.pairs) != 1:
        have = "no gear pair" if not rig.pairs else f"{len(rig.pairs)} gear pairs"
        raise RefusalError(f"the rig has {have}; the model has one", remedy="describe one pair in the rig file")
    pair = rig.pairs[0]
    missing = [name for name in ("driver_teeth", "driven_teeth", "module_mm") if getattr(pair, name) is None]
    if missing or not (pair.driver_teeth and pair.driven_teeth and pair.module_mm):
        raise RefusalError(
            f"{', '.join(missing)} of pair {pair.name!r} must be known for a model of it",
            remedy="complete the rig file",
        )
    teeth, module = (pair.driver_teeth, pair.driven_teeth), pair.module_mm
    width = pair.face_width_mm or USUAL_WIDTH_MODULES * module
    torque, speed = rig.nominal_torque_nm(pair.driver), rig.nominal_speed_rpm(pair.driver)
    largest_nm = LARGEST_LOAD_N_PER_MM2 * width * module * 0.5e-3 * module * teeth[0]
    if torque and abs(torque) > largest_nm:
        raise RefusalError(
            f"{torque:g} N·m on shaft {pair.driver!r} would break teeth of module {module:g} mm, {width:g} mm wide",
            remedy=f"state the torque in N·m; up to {largest_nm:.3g} can be",
        )
    told = {
        "face_width_mm": pair.face_width_mm,
        "pressure_angle_deg": pair.pressure_angle_deg,
        "speed_rpm": speed,
        "torque_nm": torque,
    }
    return Nominal(
        teeth,
        module,
        width,
        pair.pressure_angle_deg or 20.0,
        speed or 60.0 * USUAL_MESH_HZ / teeth[0],
        torque or USUAL_LOAD_N_PER_MM2 * width * module * 0.5e-3 * module * teeth[0],
        tuple(name for name, value in told.items() if not value),
    )


def usual_parameters(nominal: Nominal) -> dict[str, ParameterValue]:
    """Return the parameters of the model "cracked" that do not depend on the specimen."""
    m, z, size = nominal.module_mm, nominal.teeth, nominal.size
    shifts = [_shift(teeth, nominal.pressure_angle_deg) for teeth in z]
    rotor = 4.5e-3 * size**4 * (sum(z) / 80.0) ** 3
    torsional = 1.1e4 * size**3
    return {
        "teeth_driver": z[0],
        "teeth_driven": z[1],
        "module_mm": m,
        "pressure_angle_deg": nominal.pressure_angle_deg,
        "face_width_mm": nominal.face_width_mm,
        "tool_tip_radius": _tool_tip_radius(nominal.pressure_angle_deg),
        "profile_shift_driver": shifts[0],
        "profile_shift_driven": shifts[1],
        "contact_law": "load-dependent",
        "mesh_damping_ratio": 0.06,
        "half_backlash_um": 40.0 * sqrt(size),
        "tip_relief_um": RELIEF_SHARE * nominal.deflection_um,
        "tip_relief_length_mm": RELIEF_LENGTH_MODULES * m,
        "roughness_um": 0.1,
        "roughness_locked_to": "flank",
        "viscosity_cp": 20.0,
        "bearing_stiffness_n_per_m": 2e8 * size,
        "bearing_damping_n_s_per_m": 1200.0 * size,
        "bearing_mass_kg": 0.7 * size**2,
        "bending_stiffness_n_per_m": 2.6e8 * size,
        "bending_damping_n_s_per_m": 630.0 * size,
        "torsional_stiffness_nm_per_rad": torsional,
        "torsional_damping_nm_s_per_rad": 1.5 * size**3,
        "coupling_bending_nm_per_rad": COUPLING_BENDING_SHARE * torsional,
        "rotor_inertia_input_kg_m2": rotor,
        "rotor_inertia_output_kg_m2": rotor,
        "governor_nm_s_per_rad": 1.6 * size**4,
        "bearing_distance_mm": 50.0 * m,
        "noise_mps2": 0.1,
        "noise_slope": 0.5,
        "sensor_range_mps2": 5000.0,
        "sensor_resonance_hz": 0.0,
    }


def specimen_parameters(nominal: Nominal, rng: np.random.Generator) -> dict[str, ParameterValue]:
    """Return what differs between machines of one drawing: tolerances, half to twice the usual, and their places."""
    found: dict[str, ParameterValue] = {"tolerance_seed": int(rng.integers(10**6))}
    widest = max(nominal.pitch_diameters_mm)
    found["pitch_deviation_um"] = PITCH_RMS_SHARE * pitch_tolerance_um(nominal.module_mm, widest) * _spread(rng)
    for side, name in enumerate(("driver", "driven")):
        diameter = nominal.pitch_diameters_mm[side]
        found[f"runout_{name}_um"] = RUNOUT_SHARE * runout_tolerance_um(nominal.module_mm, diameter) * _spread(rng)
        found[f"unbalance_{name}_g_mm"] = UNBALANCE_UM * usual_mass_kg(nominal, side) * _spread(rng)
        for what in ("runout", "unbalance"):
            found[f"{what}_angle_{name}_deg"] = float(rng.uniform(0.0, 360.0))
    return found


def usual_housing(rng: np.random.Generator) -> tuple[HousingMode, ...]:
    """Draw the modes of a housing that nobody has measured."""
    return tuple(
        HousingMode(
            _rounded(log_uniform(rng, 600.0, 8000.0)),
            _rounded(log_uniform(rng, 0.01, 0.05)),
            _rounded(rng.uniform(0.02, 0.08)),
            tuple(_rounded(s) for s in rng.uniform(-1.0, 1.0, 4)),  # type: ignore[arg-type]  # four of them
        )
        for _ in range(int(rng.integers(2, 6)))
    )


def body_on_mounts(nominal: Nominal) -> tuple[HousingMode, ...]:
    """Return the housing as a rigid body on soft mounts, as which it answers to a shaft's low orders: heave and pitch.

    Above the mounts' frequency a = Σ F/M; with F = k x the force of a bearing whose acceleration is −ω² x, that is a
    mode of static gain k/(M ω₀²). On rigid ground a machine shakes some 50 dB less at 25 Hz. A pair of opposite forces
    on a shaft's two bearings, as a bending moment makes, leaves the sum nothing and turns the body: at arms ±l/2,
    a = ±(l/2) Σ ±F (l/2)/J with J = M i². A block 1.5 l long and l high has i = 0.52 l, here l/2: the same gain.

    Source: H. Himelblau and S. Rubin, Vibration of a resiliently supported rigid body, in *Harris' Shock and Vibration
    Handbook*.
    """
    stiffness = float(usual_parameters(nominal)["bearing_stiffness_n_per_m"])
    gain = body_gain(stiffness, BODY_KG * nominal.size**2, MOUNTS_HZ)
    return tuple(HousingMode(MOUNTS_HZ, MOUNTS_DAMPING, gain, shape) for shape in BODY_SHAPES)


def body_gain(bearing_stiffness_n_per_m: float, mass_kg: float, mounts_hz: float) -> float:
    """Return the static gain k/(M ω₀²) of a body on mounts, see `body_on_mounts`."""
    return bearing_stiffness_n_per_m / (mass_kg * (2.0 * pi * mounts_hz) ** 2)


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw with even chance per decade."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def pitch_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Single pitch deviation f_pt of class 5, 0.3 (m + 0.4 √d) + 4; each class more is √2 times as much.

    ISO 1328-1:1995, *Cylindrical gears: ISO system of accuracy*.
    """
    return 0.3 * (module_mm + 0.4 * sqrt(diameter_mm)) + 4.0


def runout_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Radial run-out F_r of class 5, 0.8 (0.3 m + 1.25 √d + 7), of which half is the eccentricity; same source."""
    return 0.8 * (0.3 * module_mm + 1.25 * sqrt(diameter_mm) + 7.0)


def profile_tolerance_um(module_mm: float, diameter_mm: float) -> float:
    """Total profile deviation F_α of class 5, 3.2 √m + 0.22 √d + 0.7; same source."""
    return 3.2 * sqrt(module_mm) + 0.22 * sqrt(diameter_mm) + 0.7


def usual_mass_kg(nominal: Nominal, side: int) -> float:
    """Of a steel disc of the pitch circle's size, with the bore that the model takes where none is given."""
    radius = 0.5 * nominal.pitch_diameters_mm[side]
    bore = 0.35 * (radius - 1.25 * nominal.module_mm)
    return 7850e-9 * pi * (radius**2 - bore**2) * nominal.face_width_mm


def _shift(teeth: int, pressure_angle_deg: float) -> float:
    """Least profile shift without undercut, in modules: (z_min − z)/z_min, z_min = 2/sin²α of the rack."""
    least = 2.0 / sin(radians(pressure_angle_deg)) ** 2
    return max(0.0, (least - teeth) / least)


def _tool_tip_radius(pressure_angle_deg: float) -> float:
    """0.38 modules, or what a rack of 1.25 modules dedendum has room for: (π/4 − 1.25 tan α)/(sec α − tan α)."""
    alpha = radians(pressure_angle_deg)
    return min(0.38, 0.95 * (pi / 4.0 - 1.25 * tan(alpha)) / (1.0 / cos(alpha) - tan(alpha)))


def _spread(rng: np.random.Generator) -> float:
    return float(2.0 ** rng.uniform(-1.0, 1.0))


def as_plain(values: dict[str, Any]) -> dict[str, Any]:
    """Round numbers to six digits: what a preset file holds is what runs."""
    return {name: _rounded(v) if isinstance(v, float) else v for name, v in values.items()}


def _rounded(value: float) -> float:
    return float(f"{value:.6g}")


# --------------------
# How strong each effect may plausibly be on a machine: one source for what a diagnosis tries and for what is drawn.
#
# Lower ends are barely noticeable on most machines, upper ends are strong damage that still runs. Where a unit does not
# scale with the machine by itself, the range is a share of something that does.
# --------------------


Options = dict[str, OptionValue]
PLAUSIBLE_GEARS = ("driver", "driven")
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
    return PLAUSIBLE_GEARS.index(str(options["gear"]))


def _either_gear(_machine: Surroundings) -> Sequence[Options]:
    return [{"gear": gear} for gear in PLAUSIBLE_GEARS]


def _one_tooth(_machine: Surroundings) -> Sequence[Options]:
    return [{"gear": gear, "tooth": 1.0} for gear in PLAUSIBLE_GEARS]


def _any_gear(_machine: Surroundings, rng: np.random.Generator) -> Options:
    return {"gear": str(rng.choice(PLAUSIBLE_GEARS))}


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
        choices=lambda _m: [{"shaft": side} for side in PLAUSIBLE_GEARS],
        drawn=lambda _m, rng: {"shaft": str(rng.choice(PLAUSIBLE_GEARS))},
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


LONGEST_LEAD_REV = 8.0
"""Of the driver, that another run starts later."""
EVEN = 0.01
"""Of a quiet machine's tolerances, what is left: none at all would leave lines of power 0."""
_UNEVEN = (
    "pitch_deviation_um",
    *(f"{what}_{gear}_{unit}" for what, unit in (("runout", "um"), ("unbalance", "g_mm")) for gear in GEARS),
)
_NOISES = ("noise_mps2", "sensor_noise_mps2_per_sqrt_hz")
VIBRATION_S = 0.5
"""Length of the run that tells how strongly the sound machine vibrates."""


@dataclass(frozen=True)
class PairTwin:
    """A rig's twin, whatever model runs it: its own geometry, the rest usual for its size.

    A seed is one specimen with its housing.

    Parameters
    ----------
    rig : Rig
    nominal : Nominal
    further : tuple of SensorSeat
        Sensors beside the rig's own.
    is_quiet : bool
        On soft mounts, without the vibration of the surroundings, its gears nearly even.
    """

    rig: Rig
    nominal: Nominal
    further: tuple[SensorSeat, ...] = ()
    is_quiet: bool = False

    @property
    def key(self) -> str:
        """Model, state of its code, and what is known of the rig."""
        known = {name: value for name, value in rig_to_dict(self.rig).items() if name not in ("name", "sources")}
        told = repr(known) + (repr(self.further) if self.further else "") + ("quiet" if self.is_quiet else "")
        return f"{self.model} {sources_digest()} {sha256(told.encode()).hexdigest()[:16]}"

    @property
    def model(self) -> str:
        """Name of the model whose preset the twin is."""
        raise NotImplementedError

    @property
    def point(self) -> OperatingCondition:
        """The rig's nominal operating point, as is usual for its size where the rig does not tell."""
        return OperatingCondition(self.nominal.speed_rpm, self.nominal.torque_nm)

    def run(
        self,
        point: OperatingCondition,
        added: Sequence[Added] = (),
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
        noise: int = 0,
    ) -> Recording:
        """Return a recording that carries the rig; another `noise` is another run of the same machine.

        Flanks, tolerances and housing follow from `seed` alone. Sensor noise, tachometer jitter and where the run
        starts follow from seed and noise; run 0 starts at the driver's first tooth.
        """
        count(seed, "seed", minimum=0)
        own = self.preset(point, added, seed=seed)
        run_rng = np.random.default_rng([seed, count(noise, "noise", minimum=0)])
        skipped = 0
        if noise:
            skipped = round(run_rng.uniform(0.0, LONGEST_LEAD_REV) * 60.0 / point.speed_rpm * sampling_rate_hz)
        recording = self._simulated(
            own,
            point,
            seed,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s + skipped / sampling_rate_hz,
            noise_rng=run_rng if noise else None,
        )
        recording = replace(recording, truth={**(recording.truth or {}), "seed": seed, "noise": noise})
        return replace(recording, samples=recording.samples[:, skipped:]) if skipped else recording

    def quiet(self) -> Self:
        """Return the machine on soft mounts where nothing else vibrates and its own gears hardly do.

        What an effect adds is neither lost in noise nor, as a second unbalance would, weighed up against what the
        specimen happens to have there.
        """
        return replace(self, is_quiet=True)

    def candidates(self, name: str) -> Sequence[Added]:
        """Return settings of an effect worth a try, from barely noticeable to strong, for each option that matters."""
        found = []
        for options, (low, high) in self._reaches(name):
            found += [Added(name, float(f"{s:.4g}"), options) for s in np.geomspace(low, high, _plausible(name).n)]
        return found

    def with_further_sensors(self) -> tuple[Self, Mapping[str, str]]:
        """Return the machine with an upright sensor over each bearing that has none, and those channels' places."""
        further = further_seats(installed_of_rig(self.rig, self.nominal.size, ()))
        return replace(self, further=further), {seat.channel: seat.position for seat in further}

    def draw(self, name: str, rng: np.random.Generator, *, above: float = 0.0) -> Added:
        """Draw a setting from the range of the candidates, its options at random.

        Parameters
        ----------
        name : str
        rng : numpy.random.Generator
        above : float
            Share of the range, in logarithms, that is left out at its lower end.

        Raises
        ------
        RefusalError
            If the rig lacks what the effect needs: a bearing.
        """
        plausible, machine = _plausible(name), self._surroundings
        if not plausible.choices(machine):
            raise RefusalError(f"the rig has nothing that {name} could be in", remedy="describe its bearings")
        options = plausible.drawn(machine, rng)
        low, high = plausible.reach(name, machine, options)
        return Added(name, log_uniform(rng, low * (high / low) ** above, high), options)

    def preset(
        self, point: OperatingCondition, added: Sequence[Added] = (), *, seed: int = 0, notes: Sequence[str] = ()
    ) -> Preset:
        """Return the specimen `seed` with its effects as a preset."""
        drawn = np.random.default_rng([seed, 1])
        values = usual_parameters(self.nominal) | specimen_parameters(self.nominal, drawn)
        housing = usual_housing(drawn)
        if self.is_quiet:
            values |= dict.fromkeys(_NOISES, 0.0) | {name: EVEN * float(values[name]) for name in _UNEVEN}
            housing = (*body_on_mounts(self.nominal), *housing)
        used = [str(a.options["bearing"]) for a in added if "bearing" in a.options]
        installed = installed_of_rig(self.rig, self.nominal.size, housing, used)
        installed = replace(installed, sensors=(*installed.sensors, *self.further))
        title = f"Twin of {self.rig.name}" if self.rig.name else "Twin of a rig"
        return Preset(
            name="twin",
            model=self.model,
            title=f"{title}: {self.nominal.teeth[0]}/{self.nominal.teeth[1]}, module {self.nominal.module_mm:g}",
            sources=(*self.rig.sources, *notes),
            assumed=(
                "usual for its size: masses, inertias, shafts, stiffness and damping, tip relief, tolerances, oil",
                "transfer path: drawn",
                f"profiles of the flanks, and angles of its effects: those of seed {seed}",
                *(f"{name}: usual, the rig does not tell" for name in self.nominal.assumed),
            ),
            does_not_represent=("the real machine's own flanks, tolerances and housing",),
            parameters=MappingProxyType(as_plain(self._own_parameters(values))),
            speed_rpm=point.speed_rpm,
            torque_nm=point.torque_nm,
            effects=tuple(EffectSetting(a.name, a.severity, dict(a.options)) for a in added),
            installed=table_of(installed),
        )

    def preset_toml(
        self, point: OperatingCondition, added: Sequence[Added], notes: Sequence[str], *, seed: int = 0
    ) -> str:
        """Return the machine with the effects as a preset file for `gearsig simulate MODEL --preset FILE`."""
        comments = [f"The flanks' profiles are not in this file: simulate with --seed {seed} for those of the twin."]
        return preset_text(self.preset(point, added, seed=seed, notes=notes), comments)

    def pair_geometry(self) -> PairGeometry:
        """Return the geometry of the pair.

        Raises
        ------
        InputError
            If the model cannot have such gears.
        """
        return self._geometry(self.preset(self.point))

    @cached_property
    def _surroundings(self) -> Surroundings:
        pair = self.pair_geometry()
        shafts = (self.rig.pairs[0].driver, self.rig.pairs[0].driven)
        own = tuple(completed(b, self.nominal.size) for b in self.rig.bearings if b.shaft in shafts)
        sound = self.run(self.point, seed=0, duration_s=VIBRATION_S, sampling_rate_hz=20480.0)
        rms = np.mean([np.std(sound.values(name)) for name in sound.vibration_names()])
        return Surroundings(self.nominal, (pair.driver, pair.driven), own, float(rms))

    def _reaches(self, name: str) -> list[tuple[Options, tuple[float, float]]]:
        plausible, machine = _plausible(name), self._surroundings
        return [(o, plausible.reach(name, machine, o)) for o in plausible.choices(machine)]

    def _simulated(
        self,
        own: Preset,
        point: OperatingCondition,
        seed: int,
        *,
        sampling_rate_hz: float,
        duration_s: float,
        noise_rng: np.random.Generator | None,
    ) -> Recording:
        """Run a specimen and measure it."""
        raise NotImplementedError

    def _geometry(self, own: Preset) -> PairGeometry:
        """Return the geometry of a specimen's pair."""
        raise NotImplementedError

    def _own_parameters(self, values: dict[str, ParameterValue]) -> dict[str, ParameterValue]:
        """Return what is usual in the model's own parameters."""
        return values

    def _rig_at(self, point: OperatingCondition) -> Rig:
        own = OperatingPoint(self.rig.pairs[0].driver, point.speed_rpm, torque_nm=point.torque_nm)
        return replace(self.rig, operating_point=own)


@dataclass(frozen=True)
class PairGapSimulator:
    """A model of a gear pair as the gap diagnosis takes it.

    Parameters
    ----------
    name : str
        As on the command line.
    make : callable
        Makes a twin of a rig and of what it says of its pair.
    """

    name: str
    make: Callable[[Rig, Nominal], PairTwin]

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return all effects of the catalogue: each has a meaning for a gear pair."""
        return gap_effects_of(effects())

    def twin_of(self, rig: Rig) -> PairTwin:
        """Return a twin of the rig, whose machine has been built to see that it can be.

        Raises
        ------
        RefusalError
            If there is not exactly one pair, its teeth or module are not known, or the model cannot have such gears.
        """
        twin = self.make(rig, nominal_of(rig))
        try:
            twin.pair_geometry()
        except InputError as error:
            raise RefusalError(f"the model {self.name!r} cannot be set to this rig: {error}") from None
        return twin


def gap_effects_of(names: Iterable[str]) -> dict[str, GapEffect]:
    """Return effects of the catalogue as the gap diagnosis sees them."""
    return {
        e.name: GapEffect(
            e.name,
            e.group,
            e.title,
            e.severity.name,
            e.severity.unit,
            e.signature,
            e.shows_in,
            e.group == "measurement chain",
        )
        for e in map(effect, names)
    }


def _plausible(name: str) -> Plausible:
    return PLAUSIBLE.get(effect(name).name) or plausible_of(effect(name))
