"""Effects of one's own: Python files outside this package, each with an `EFFECT`.

Their files stand in the environment variable `GEARSIG_EFFECTS`, so that processes which are started know them, too.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np

from gearsig.errors import GearsigError, InputError
from sims.effects.effect import Effect, OptionValue
from sims.machine import Machine

VARIABLE = "GEARSIG_EFFECTS"


def own_files() -> tuple[Path, ...]:
    """Return the files of one's own effects."""
    return tuple(Path(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text)


def with_own_file(path: Path) -> str:
    """Return the variable's value with a further file."""
    files = dict.fromkeys([*map(str, own_files()), str(path.resolve())])
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
    except Exception as error:  # anything: it is somebody else's program
        raise InputError(f"does not run ({type(error).__name__}: {error})", where=str(path)) from error
    found = getattr(module, "EFFECT", None)
    if not isinstance(found, Effect):
        raise InputError(
            "defines no effect",
            where=str(path),
            remedy="set EFFECT = Effect(…), as sims/effects/tooth_wear.py does",
        )
    return replace(found, change=partial(_changed, path, found))


def _changed(
    path: Path,
    own: Effect,
    machine: Machine,
    severity: float,
    options: Mapping[str, OptionValue],
    rng: np.random.Generator,
) -> Machine:
    """Return what somebody's own effect makes of a machine.

    Raises
    ------
    InputError
        If it fails, or returns no machine.
    """
    try:
        changed = own.change(machine, severity, options, rng)
    except GearsigError:
        raise
    except Exception as error:  # anything: it is somebody else's program
        raise InputError(f"the effect {own.name!r} fails ({type(error).__name__}: {error})", where=str(path)) from error
    if not isinstance(changed, Machine):
        raise InputError(
            f"the effect {own.name!r} returns {type(changed).__name__} and no machine",
            where=str(path),
            remedy="let change return the machine, as sims/effects/tooth_wear.py does",
        )
    return changed
