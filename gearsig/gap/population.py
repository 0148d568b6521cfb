"""What is known from the start: drawn machines, sound and with every effect; changes of features and causes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.floors import StructuralFloor
from gearsig.gap.types import NONE

FILE = Path(__file__).with_name("population.npz")


@dataclass(frozen=True)
class Population:
    """Recordings of machines drawn at random, of which the cause of every change is known.

    Parameters
    ----------
    rigs : array, (n,)
        Which machine a row is of.
    causes : array of str, (n,)
        Effect, "none" or "unknown".
    change_names, feature_names : tuple of str
        Of the columns; the first changes are the differences of the features.
    changes, change_scatter : arrays, (n, n_changes)
        Against a sound recording of the same machine on another day, and standard errors.
    gaps, gap_scatter : arrays, (n, n_features)
        Against the twin that knows the rig file only.
    loads_n_per_mm : array, (n,)
        Of the teeth.
    """

    rigs: NDArray[np.int64]
    causes: NDArray[np.str_]
    change_names: tuple[str, ...]
    feature_names: tuple[str, ...]
    changes: FloatArray
    change_scatter: FloatArray
    gaps: FloatArray
    gap_scatter: FloatArray
    loads_n_per_mm: FloatArray

    @cached_property
    def reference_floor(self) -> StructuralFloor:
        """By how much sound machines differ from themselves on another day."""
        sound = self.causes == NONE
        return StructuralFloor.of_healthy(self.change_names, self.changes[sound])

    @cached_property
    def simulation_floor(self) -> StructuralFloor:
        """By how much sound machines differ from a simulation that knows their rig file."""
        sound = self.causes == NONE
        return StructuralFloor.of_healthy(self.feature_names, self.gaps[sound])

    def floor(self, *, with_reference: bool) -> StructuralFloor:
        """Return the floor of one way of comparing."""
        return self.reference_floor if with_reference else self.simulation_floor


@cache
def load_population(path: Path = FILE) -> Population:
    """Read the population that comes with this version.

    Raises
    ------
    InputError
        If there is no such file or it belongs to other features.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
    except (OSError, ValueError) as error:
        raise InputError(
            f"the population cannot be read ({error})",
            where=path.name,
            remedy="make it again: python -m app.calibration.gap.population",
        ) from None
    tables = {
        name: np.asarray(arrays[name], dtype=np.float64)
        for name in ("changes", "change_scatter", "gaps", "gap_scatter", "loads_n_per_mm")
    }
    return Population(
        arrays["rigs"],
        arrays["causes"],
        tuple(map(str, arrays["change_names"])),
        tuple(map(str, arrays["feature_names"])),
        **tables,
    )
