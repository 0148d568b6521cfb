"""A fitted recogniser on disk, so that not every command fits it anew: plain arrays; a damaged file is no file."""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np

from gearsig.cache import cache_folder, modules_digest, read_arrays, write_whole
from gearsig.errors import InputError
from gearsig.gap.population import FILE
from gearsig.gap.trees import LinearRule, Trees

MOST_BYTES = 200_000_000
"""Of a file's arrays; a real one has a tenth."""

_MODULES = ("change", "contrasts", "features", "floors", "population", "recognise", "relative", "trees")
_TREES = ("columns", "thresholds", "left", "right", "roots", "shares")
_LINEAR = ("weights", "offsets")

Fitted = tuple[tuple[str, ...], Trees, LinearRule | None]
"""Causes, trees, and what is heard besides them."""


def read_fitted(name: str) -> Fitted | None:
    """Return what was kept under a name for this very code and population; None where nothing was, or it is damaged."""
    arrays = read_arrays(_path(name), MOST_BYTES)
    if arrays is None:
        return None
    try:
        trees = Trees(*(arrays[key] for key in _TREES))
        linear = LinearRule(*(arrays[key] for key in _LINEAR)) if _LINEAR[0] in arrays else None
        return tuple(map(str, arrays["causes"])), trees, linear
    except (KeyError, TypeError):
        return None


def keep_fitted(name: str, fitted: Fitted) -> None:
    """Keep it, in place of what other versions kept; where the folder cannot be written, the next process fits anew."""
    causes, trees, linear = fitted
    arrays = {key: getattr(trees, key) for key in _TREES}
    arrays |= {key: getattr(linear, key) for key in _LINEAR} if linear is not None else {}
    path = _path(name)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for old in path.parent.glob(f"{name}-*.npz"):
            old.unlink(missing_ok=True)
        write_whole(path, lambda file: np.savez(file, allow_pickle=False, causes=np.array(causes), **arrays))
    except (OSError, InputError):
        return


def _path(name: str) -> Path:
    return cache_folder("forests") / f"{name}-{_made_of()}.npz"


@cache
def _made_of() -> str:
    """Return a short hash of all that a fit depends on."""
    code = modules_digest(f"gearsig.gap.{module}" for module in _MODULES)
    return sha256(FILE.read_bytes() + f"{code} {version('scikit-learn')}".encode()).hexdigest()[:16]
