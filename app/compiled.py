"""The simulators' compiled code, made ahead of the first look: once an installation, beside the dashboard."""

from __future__ import annotations

import hashlib
from pathlib import Path
from threading import Thread

from gearsig.cache import cache_folder, keep

_going_on: list[Thread] = []


def begin() -> None:
    """Compile what is not compiled yet in a process of its own, then load it into this one; returns at once."""
    thread = Thread(target=_compile_and_load, daemon=True, name="gearsig compiled code")
    _going_on.append(thread)
    thread.start()


def is_being_made() -> bool:
    """Whether compiling goes on; who needs the code now had better wait than compile it a second time."""
    return any(thread.is_alive() for thread in _going_on)


def _compile_and_load() -> None:
    from concurrent.futures.process import BrokenProcessPool

    from gearsig.errors import GearsigError
    from gearsig.processes import process_pool

    mark = cache_folder("compiled") / _fingerprint()
    try:
        if not mark.exists():
            with process_pool(1) as pool:
                pool.submit(run_every_model).result()
            keep(mark, lambda file: file.write(b"compiled\n"))
        run_every_model()
    except (GearsigError, BrokenProcessPool):
        return  # the first simulation compiles it then, and says what stands against it


def run_every_model() -> None:
    """Run both models of a gear pair for a moment, healthy and cracked, which compiles all that they need."""
    from app.dashboard.laboratory.run import run_setup
    from app.dashboard.laboratory.setup import FIRST, MODELS, Setup
    from sims.effects import EffectSetting, completed
    from sims.presets import presets

    crack = completed((EffectSetting("root_crack", 1.0),))
    for model in MODELS:
        known = presets(model)
        name = FIRST if FIRST in known else next(iter(known))
        for effects in ((), crack):
            run_setup(Setup(name, known[name].speed_rpm, known[name].torque_nm, (), effects, 0.1, model=model))


def _fingerprint() -> str:
    """Changes with whatever makes numba compile anew: its own version, and the sources."""
    import numba

    import gearsig
    import sims

    files = [p for room in (gearsig, sims) for p in Path(room.__path__[0]).rglob("*.py")]
    stamps = sorted((str(path), path.stat().st_mtime_ns) for path in files)
    return hashlib.sha256(repr((numba.__version__, stamps)).encode()).hexdigest()[:16]
