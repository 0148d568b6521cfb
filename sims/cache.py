"""Where a user's machine keeps what can be computed again."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder(room: str) -> Path:
    """Return this user's folder for one kind of kept results; the variable GEARSIG_CACHE names another place.

    Parameters
    ----------
    room : str
        Name of the kind, e.g. "gap" or "gears".
    """
    if os.environ.get("GEARSIG_CACHE"):
        return Path(os.environ["GEARSIG_CACHE"]) / room
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "gearsig" / room
