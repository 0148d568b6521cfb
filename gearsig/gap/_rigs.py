"""What a rig file must say for a gap diagnosis: which way it can be diagnosed, which pair, what is assumed of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import closest_match_hint
from gearsig.errors import InputError, RefusalError
from gearsig.rig import Bearing, Rig

EXAMPLE = "`gearsig rig example` prints a file to start from"


def is_gearless(rig: Rig) -> bool:
    """Return whether the rig has bearings only, so that there is nothing to set a simulator to.

    Raises
    ------
    RefusalError
        If the rig's data suffice neither for a simulation nor for a search for the bearings, with all that is missing.
    """
    if rig.pairs:
        _check_teeth(rig)
        return False
    if not rig.bearings:
        raise RefusalError(
            "the rig file describes neither a gear pair nor a bearing: there is nothing to set a simulator to, and "
            "nothing to look for",
            remedy=f"describe the gear pair (teeth, module) or the bearings (geometry or orders); {EXAMPLE}",
        )
    if not known_bearings(rig):
        names = ", ".join(repr(bearing.name) for bearing in rig.bearings)
        raise RefusalError(
            f"the rig has no gear pair, and of no bearing ({names}) the orders and the speed of its shaft are known",
            remedy="give the bearings' geometry or orders, on the shaft whose speed is known",
        )
    return True


def known_bearings(rig: Rig) -> tuple[Bearing, ...]:
    """Return the bearings whose orders per revolution of the reference shaft are known."""
    return tuple(b for b in rig.bearings if b.orders() and rig.ratio(b.shaft) is not None)


def _check_teeth(rig: Rig) -> None:
    pair = rig.pairs[0]
    gears = [name for name, teeth in (("driver", pair.driver_teeth), ("driven", pair.driven_teeth)) if teeth is None]
    if gears:
        both = "both gears" if len(gears) == 2 else f"the {gears[0]} gear"
        raise RefusalError(
            f"the rig data are missing that a simulation needs: teeth of {both} of pair {pair.name!r}",
            remedy="complete the rig file; `gearsig analyze` says what can be said without them",
        )


def with_stage(rig: Rig, stage: str = "") -> Rig:
    """Return a rig with the gear pair that is asked for as its first, which is under study; the others are background.

    Parameters
    ----------
    rig : Rig
    stage : str
        Name of a pair, or of a shaft that only one pair sits on; empty: the only one.

    Raises
    ------
    InputError
        If there is no such pair.
    RefusalError
        If there are several pairs and none is asked for.
    """
    names = [pair.name for pair in rig.pairs]
    chosen = [pair for pair in rig.pairs if pair.name == stage]
    chosen = chosen or [pair for pair in rig.pairs if stage in (pair.driver, pair.driven)]
    if not stage and len(names) > 1:
        raise RefusalError(
            f"the rig has {len(names)} gear pairs ({', '.join(names)}), and one is diagnosed at a time",
            remedy="say which with --stage NAME (stage=… from Python); the others are taken for background",
        )
    if stage and len(chosen) != 1:
        what = f"{len(chosen)} pairs sit on shaft {stage!r}" if chosen else f"there is no gear pair {stage!r}"
        raise InputError(what, where="stage", allowed=", ".join(names), remedy=closest_match_hint(stage, names))
    return replace(rig, pairs=(*chosen, *(pair for pair in rig.pairs if pair not in chosen))) if stage else rig


USUAL_MODULE_MM, MODULES_MM = 2.5, (0.5, 12.0)
WIDTH_MODULES = 10.0
LOAD_N_PER_MM2 = 50.0
"""Where a module is not known: of small gearboxes; between what can be cut and what sits on a bench; the face width
over it; force per face width and module, from which it follows where the torque is stated."""


def twin_rig(rig: Rig) -> tuple[Rig, list[str]]:
    """Return the rig of the first pair alone, as a simulator is set to it, and what was assumed of it.

    Without a module, T = F b m (m z/2) with F = 50 N/mm² and b = 10 m lets it follow from the torque; or it is 2.5 mm.
    """
    pair, remarks = rig.pairs[0], list[str]()
    torque_nm = rig.nominal_torque_nm(pair.driver)
    if pair.module_mm is None and pair.driver_teeth:
        module = USUAL_MODULE_MM
        if torque_nm:
            module = (1e3 * torque_nm / (0.5 * pair.driver_teeth * LOAD_N_PER_MM2 * WIDTH_MODULES)) ** (1.0 / 3.0)
        module = float(f"{np.clip(module, *MODULES_MM):.2g}")
        width = pair.face_width_mm or WIDTH_MODULES * module
        pair = replace(pair, module_mm=module, face_width_mm=width)
        why = f"that the torque of {torque_nm:.3g} N·m lets expect" if torque_nm else "as usual for small gearboxes"
        remarks.append(
            f"Of the gears only teeth are known: the twin has a module of {module:g} mm, {why}, and a face width of "
            f"{width:g} mm. A machine may have half or twice that: severities in mm and µm are orders of magnitude."
        )
    if len(rig.pairs) > 1:
        others = ", ".join(further.name for further in rig.pairs[1:])
        remarks.append(f"Diagnosed is {pair.name}; what {others} is heard at is background, and taken out.")
    elif not remarks:
        return rig, []
    point, on = rig.operating_point, (pair.driver, pair.driven)
    speed_rpm = rig.nominal_speed_rpm(pair.driver)
    alone = replace(
        rig,
        shafts=tuple(shaft for shaft in rig.shafts if shaft.name in on),
        pairs=(pair,),
        bearings=tuple(bearing for bearing in rig.bearings if bearing.shaft in on),
        operating_point=replace(point, shaft=pair.driver, speed_rpm=speed_rpm, torque_nm=torque_nm),
        speed=None,
        contact=None,
        assumed=(*rig.assumed, *(() if rig.pairs[0].module_mm else ("module_mm", "face_width_mm"))),
    )
    return alone, remarks
