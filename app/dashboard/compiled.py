"""Code compiled ahead of its first use: once per installation, in the background of the dashboard."""

from __future__ import annotations

import hashlib
import os
import signal
import sys
from contextlib import suppress
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path
from threading import Thread
from time import sleep

from gearsig.cache import cache_folder, keep
from gearsig.errors import GearsigError, unexpected_text

SERVER_FIRST_S = 5.0
"""Delay before compiled code is loaded, which would otherwise hold up the server and its first page."""
_compiling: list[Thread] = []


def begin() -> None:
    """Compile what is not yet compiled in a separate process, then load it into this one; returns at once."""
    mark = cache_folder("compiled") / _fingerprint()
    thread = Thread(target=_load if mark.exists() else _compile_and_load, args=(mark,), daemon=True)
    if not mark.exists():
        _compiling.append(thread)
    thread.start()


def is_being_made() -> bool:
    """Whether compilation is in progress; callers that need the code should wait rather than compile it again."""
    return any(thread.is_alive() for thread in _compiling)


def _compile_and_load(mark: Path) -> None:
    # not a pool: the server would wait for it on exit
    process = get_context("spawn").Process(target=_compile_or_say, daemon=True)
    process.start()
    process.join()
    if process.exitcode == 0:
        keep(mark, lambda file: file.write(b"compiled\n"))
        run_every_model()
    # otherwise the first answers compile the code and report what is wrong


def _compile_or_say() -> None:
    """Compile all, or end with one line; Ctrl-C, which the terminal sends to this process too, ends it silently."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if hasattr(os, "nice"):
        os.nice(10)  # whoever opens a recording meanwhile goes first
    try:
        compile_all()
    except Exception as error:  # noqa: BLE001 - whatever it is, the server serves
        sys.exit(f"Code could not be compiled ahead, so the first answers take longer: {unexpected_text(error)}")


def compile_all() -> None:
    """Run the analysis that the start page offers first, then the simulators, which take longer to compile."""
    from app.samples import samples
    from gearsig.diagnosis import analyze_file
    from gearsig.recording import read_recording
    from gearsig.rig import read_rig

    first = samples()[0]
    rig = read_rig(first.rig)
    reference = None if first.reference is None else read_recording(first.reference, rig=rig)
    analyze_file(first.recording, rig, reference=reference)
    run_every_model()


def _load(_: Path) -> None:
    sleep(SERVER_FIRST_S)
    with suppress(GearsigError):
        run_every_model()


def run_every_model() -> None:
    """Run both models of a gear pair briefly, healthy and cracked, to compile everything they need."""
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
    """Return a text that changes with whatever makes numba recompile: its version, its cache folder, the sources."""
    import gearsig
    import sims

    files = [p for room in (gearsig, sims) for p in Path(room.__path__[0]).rglob("*.py")]
    stamps = sorted((str(path), path.stat().st_mtime_ns) for path in files)
    return hashlib.sha256(repr((version("numba"), os.environ.get("NUMBA_CACHE_DIR"), stamps)).encode()).hexdigest()[:16]
