"""All effects, found by their files: a module of this package with an `EFFECT` is one; so is a file of one's own."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from pkgutil import iter_modules
from zlib import crc32

import numpy as np

from gearsig.checks import known_name
from gearsig.errors import GearsigError, InputError
from gearsig.gap import GapEffect
from sims.effects._effect import GROUPS, Effect, EffectSetting, Options
from sims.machine import Machine

# --------------------
# Effects of one's own: Python files outside this package, each with an `EFFECT`.
#
# Their files stand in the environment variable `GEARSIG_EFFECTS`, so that processes which are started know them, too.
# --------------------


VARIABLE = "GEARSIG_EFFECTS"


def user_files() -> tuple[Path, ...]:
    """Return the files of one's own effects."""
    return tuple(Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text)


def with_user_file(path: Path) -> str:
    """Return the variable's value with a further file."""
    files = dict.fromkeys([*map(str, user_files()), str(path.resolve())])
    return os.pathsep.join(files)


def loaded(path: Path) -> Effect:
    """Return the effect of a file.

    Raises
    ------
    InputError
        If there is no such file, it does not run, or it defines no effect.
    """
    spec = spec_from_file_location(f"own_effect_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise InputError("is no Python file", where=str(path), remedy="give a file NAME.py that defines EFFECT")
    module = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # anything: it is somebody else's program
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
    """Return what somebody's own effect makes of a machine.

    Raises
    ------
    InputError
        If it fails, or returns no machine.
    """
    try:
        changed = user_effect.change(machine, severity, options, rng)
    except GearsigError:
        raise
    except (Exception, SystemExit) as error:  # anything: it is somebody else's program
        raise InputError(
            f"the effect {user_effect.name!r} fails ({type(error).__name__}: {error})", where=str(path)
        ) from error
    if not isinstance(changed, Machine):
        raise InputError(
            f"the effect {user_effect.name!r} returns {type(changed).__name__} and no machine",
            where=str(path),
            remedy="let change return the machine, as sims/effects/tooth_wear.py does",
        )
    return changed


@cache
def effects() -> dict[str, Effect]:
    """Return every effect by name, in the order of the groups.

    Raises
    ------
    InputError
        If a file of one's own effect cannot be used.
    """
    by_name = dict(_listed())
    for path in user_files():
        further = loaded(path)
        if further.name in by_name:
            raise InputError(
                f"there is an effect {further.name!r} already", where=str(path), remedy="choose another name"
            )
        by_name[further.name] = further
    return dict(sorted(by_name.items(), key=lambda item: (GROUPS.index(item[1].group), item[0])))


def add_effect(path: str | Path) -> Effect:
    """Take an effect of one's own from a Python file, in this process and in those that it starts.

    Parameters
    ----------
    path : str or Path
        Of a file with `EFFECT = Effect(…)`.

    Raises
    ------
    InputError
        If it cannot be used, or an effect of that name is there already.
    """
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = with_user_file(Path(path))
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
    """Whether an effect is none of this package's."""
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
    """Return an effect as the gap diagnosis sees it."""
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
    """Return settings with every option, defaults included.

    Raises
    ------
    InputError
        If an effect or an option does not exist, or an option's value is not allowed.
    """
    return tuple(EffectSetting(s.name, s.severity, effect(s.name).complete(s.options)) for s in settings)


def with_effects(machine: Machine, settings: Iterable[EffectSetting], rng: np.random.Generator) -> Machine:
    """Return the machine with the effects switched on, mechanical ones first.

    Every effect draws from a stream of its own, made of one number of `rng` and the effect's name: adding an effect
    leaves what the others draw unchanged, and exactly one number is taken from `rng`.
    """
    seed = int(rng.integers(2**63))
    chosen = sorted(settings, key=lambda s: GROUPS.index(effect(s.name).group))
    for place, setting in enumerate(chosen):
        same_before = sum(s.name == setting.name for s in chosen[:place])
        stream = np.random.default_rng([seed, crc32(setting.name.encode()), same_before])
        machine = effect(setting.name).apply(machine, setting.severity, setting.options, stream)
    return machine
