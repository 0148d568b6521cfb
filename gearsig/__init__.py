"""gearsig: signal processing and diagnostics for gear vibration, simulated and measured.

The main job in three lines:

>>> import gearsig
>>> result = gearsig.analyze(gearsig.read_recording("gearbox.csv", rig=gearsig.read_rig("rig.toml")))  # doctest: +SKIP
>>> print(gearsig.analysis_text(result))  # doctest: +SKIP

Single methods take a recording and a channel's name, or a plain array and its sampling rate:

>>> recording = gearsig.read_recording("gearbox.csv")  # doctest: +SKIP
>>> gearsig.order_spectrum(recording, "a1"), gearsig.envelope_spectrum(recording, "a1")  # doctest: +SKIP
>>> import numpy as np
>>> tone = np.sin(2 * np.pi * 50.0 * np.arange(1000) / 1000.0)
>>> round(float(gearsig.amplitude_spectrum(tone, 1000.0).values[50]), 9)
1.0

Everything else is in a subpackage: `gearsig.orders.separate_shafts`, or `from gearsig.orders import separate_shafts`.
"""

import os
import sys
from pathlib import Path

import lazy_loader

# `__init__.pyi` is the single table of names, for type checkers and at run time: a subpackage is loaded when one of its
# names is first used, so that `import gearsig` stays light.
__getattr__, _names, __all__ = lazy_loader.attach_stub(__name__, __file__)
__version__ = "0.1.0"


def _compiled_code_folder() -> None:
    """Set a folder for Numba's compiled code if none of Numba's own choices is writable.

    Without a writable folder Numba refuses to compile: a system-wide installation run by a user without a home folder,
    or in a read-only container, would fail. The folder is temporary: a process compiles into it, shares it with its
    workers and removes it at the end. A permanent folder with a predictable name would let others run code here.
    """
    if sys.platform == "win32":
        return
    caches = "~/Library/Caches" if sys.platform == "darwin" else "~/.cache"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser(caches)  # noqa: PTH111 - Path's raises without one
    chosen = [os.environ.get("NUMBA_CACHE_DIR"), Path(__file__).parent, home]
    if any(_can_be_written(Path(folder)) for folder in chosen if folder):
        return
    import atexit
    import shutil
    import tempfile

    folder = tempfile.mkdtemp(prefix="gearsig-compiled-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ["NUMBA_CACHE_DIR"] = folder
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = folder


def _can_be_written(folder: Path) -> bool:
    """Whether files can be created in a folder, which may not exist yet."""
    existing = next(place for place in (folder, *folder.absolute().parents) if place.exists())
    return existing.is_dir() and os.access(existing, os.W_OK | os.X_OK)


_compiled_code_folder()


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
