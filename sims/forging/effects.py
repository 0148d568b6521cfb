"""Effects of the catalogue that have a meaning for the drive, as changes of its parameters and of one tooth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearsig.checks import closest_match_hint, within
from gearsig.errors import InputError
from sims.effects import EffectSetting, effect
from sims.forging.drive import WeakTooth
from sims.forging.parameters import MOST_FRICTION
from sims.forging.worn import SIDES, gear_pair
from sims.mesh import GearMesh, RootCrack, mesh_stiffness
from sims.values import Values
from sims.wanted import Wanted

WITH_MEANING = ("root_crack", "tooth_wear", "sliding_friction", "backlash", "torque_ripple")
"""What the drive can do. A wrong load inertia is `piece_mass_kg` or `wheel_inertia_kg_m2`."""


def with_effects(values: Values, settings: Sequence[EffectSetting]) -> tuple[Values, WeakTooth | None]:
    """Return the parameters with the effects in them, and the tooth that a crack makes weak.

    - backlash: the play grows by the severity.
    - tooth_wear: the drive flanks of one gear lose material by sliding, most at their ends and nothing at the pitch
      point (`sims.mesh.wear_profile`); pairs touch the later the more they lost.
    - sliding_friction: the coefficient grows by the severity; the bristles' deflection stays.
    - torque_ripple: amplitude and order of the motor's ripple.
    - root_crack: the tooth's pairs lose stiffness in the ratio of their mean stiffness with and without the crack, by
      the potential energy of the tooth (`sims.mesh`); on the drive flank, where the load opens the crack.

    Raises
    ------
    InputError
        If an effect has no meaning here, is given twice, or its severity or options do not fit.
    """
    changed = dict(values)
    weak: WeakTooth | None = None
    _check_names(settings)
    for setting in settings:
        wanted, found = Wanted(changed), effect(setting.name)
        s = found.severity
        severity = within(setting.severity, f"{s.name} of {setting.name}", s.low, s.high, s.unit)
        options = found.complete(setting.options)
        if setting.name == "backlash":
            changed["half_backlash_um"] = wanted.number("half_backlash_um") + 0.5 * severity
        elif setting.name == "tooth_wear":
            worn = f"sliding_wear_{options['gear']}_um"
            changed[worn] = wanted.number(worn) + severity
        elif setting.name == "sliding_friction":
            now = wanted.number("friction_coefficient")
            within(severity, f"{s.name} of {setting.name}, beside the {now:g} there are,", 0.0, MOST_FRICTION - now)
            changed["friction_coefficient"] = now + severity
        elif setting.name == "torque_ripple":
            changed["torque_ripple"], changed["torque_ripple_order"] = severity / 100.0, float(options["order"])
        elif severity > 0.0:
            weak = _weak_tooth(wanted, severity, options)
    return changed, weak


def _check_names(settings: Sequence[EffectSetting]) -> None:
    names = [setting.name for setting in settings]
    for name in names:
        if name not in WITH_MEANING:
            raise InputError(
                f"effect {name!r} has no meaning for the model forging",
                allowed=", ".join(WITH_MEANING),
                remedy=closest_match_hint(name, WITH_MEANING),
            )
        if names.count(name) > 1:
            raise InputError(f"effect {name!r} is given {names.count(name)} times", allowed="once")


def _weak_tooth(wanted: Wanted, depth_mm: float, options: Mapping[str, float | str]) -> WeakTooth:
    gear = SIDES.index(str(options["gear"]))
    pair = gear_pair(wanted)
    n_teeth = (pair.driver, pair.driven)[gear].teeth
    tooth = int(within(float(options["tooth"]), f"tooth of the {SIDES[gear]} gear", 1, n_teeth)) - 1
    percent = float(options["width_percent"])
    width = None if percent == 100.0 else percent / 100.0 * pair.face_width_mm
    crack = RootCrack(depth_mm, float(options["angle_deg"]), tooth, width)
    cracked = GearMesh(pair, cracks_1=(crack,) if gear == 0 else (), cracks_2=(crack,) if gear == 1 else ())
    # Pair `tooth` alone, while it touches from its entry on: its column moves as the next pair enters.
    cycles = tooth + np.linspace(0.05, 0.95, 40)
    sound_n_per_m, weak_n_per_m = (
        mesh_stiffness(mesh, cycles).pairs_n_per_m[:, 0] for mesh in (GearMesh(pair), cracked)
    )
    return WeakTooth(gear, tooth, 1.0 - float(np.mean(weak_n_per_m / sound_n_per_m)))
