"""What is known from the start: drawn machines, sound and with every effect; changes of features and causes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gearsig.cache import read_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap.floors import StructuralFloor
from gearsig.gap.types import NONE

FILE = Path(__file__).with_name("population.npz")
MOST_BYTES = 1_000_000_000
"""Of its arrays; they have nineteen million."""
INDEPENDENT = "independent"
"""Simulator of the rig that makes blind cases; only its development gears are in the population."""
BY_HAND = "by hand"
"""Source of effects that are put into a sound machine's recordings as the literature describes them."""

LEFT_OUT: ContextVar[str] = ContextVar("LEFT_OUT", default="")
"""Simulator whose machines nothing may be learned from, see `without_machines_of`."""


@dataclass(frozen=True)
class Population:
    """Recordings of machines drawn at random, of which the cause of every change is known.

    Parameters
    ----------
    rigs : array, (n,)
        Which machine a row is of.
    simulators : array of str, (n,)
        That the machine is of.
    causes : array of str, (n,)
        Effect, "none" or "unknown".
    by_hand : bool array, (n,)
        Effects that no simulator made, see `BY_HAND`.
    change_names, feature_names : tuple of str
        Of the columns; the first changes are the differences of the features.
    changes, change_scatter : arrays, (n, n_changes)
        Against a sound recording of the same machine on another day, and standard errors.
    features, feature_scatter : arrays, (n, n_features)
        Of the recording itself, and standard errors.
    simulated, simulated_scatter : arrays, (n, n_features)
        Of the twin that knows the rig file only.
    loads_n_per_mm : array, (n,)
        Of the teeth.
    """

    rigs: NDArray[np.int64]
    simulators: NDArray[np.str_]
    causes: NDArray[np.str_]
    by_hand: NDArray[np.bool_]
    change_names: tuple[str, ...]
    feature_names: tuple[str, ...]
    changes: FloatArray
    change_scatter: FloatArray
    features: FloatArray
    feature_scatter: FloatArray
    simulated: FloatArray
    simulated_scatter: FloatArray
    loads_n_per_mm: FloatArray

    @cached_property
    def sources(self) -> NDArray[np.str_]:
        """Return what made each effect: a simulator, or `BY_HAND`."""
        return np.where(self.by_hand, BY_HAND, self.simulators)

    def of_rows(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Population:
        """Return some of the recordings."""
        by_row = {field.name for field in fields(self)} - {"change_names", "feature_names"}
        return replace(self, **{name: getattr(self, name)[rows] for name in by_row})

    @cached_property
    def reference_floor(self) -> StructuralFloor:
        """By how much sound machines differ from themselves on another day."""
        sound = self.causes == NONE
        return StructuralFloor.of_healthy(self.change_names, self.changes[sound])

    @cached_property
    def credibility(self) -> FloatArray:
        """How much of what the simulation says of each feature holds for sound machines, 0 to 1, (n_features,)."""
        sound = self.causes == NONE
        return credibility_of(self.features[sound], self.simulated[sound])

    @cached_property
    def gaps(self) -> FloatArray:
        """What the simulation, as far as it is credible, leaves of the features, (n, n_features)."""
        gaps: FloatArray = self.features - self.credibility * self.simulated
        return gaps

    @cached_property
    def gap_scatter(self) -> FloatArray:
        """Standard errors of the gaps."""
        scatter: FloatArray = np.hypot(self.feature_scatter, self.credibility * self.simulated_scatter)
        return scatter

    @cached_property
    def simulation_floor(self) -> StructuralFloor:
        """By how much sound machines differ from what a simulation that knows their rig file lets expect."""
        sound = self.causes == NONE
        return StructuralFloor.of_healthy(self.feature_names, self.gaps[sound])

    def floor(self, *, with_reference: bool) -> StructuralFloor:
        """Return the floor of one way of comparing."""
        return self.reference_floor if with_reference else self.simulation_floor


def credibility_of(features: FloatArray, simulated: FloatArray) -> FloatArray:
    """Return the slope of sound machines' features over those of their simulations, cut to 0 … 1.

    A simulation knows how a figure goes with geometry, speed and load, and little of how impulsive or how uneven a
    machine is: subtracting all of what it says adds its own scatter there. The slope is what leaves least.

    Source: the credibility factor of H. Bühlmann, "Experience rating and credibility", ASTIN Bulletin 4 (1967).

    Parameters
    ----------
    features, simulated : arrays, (n, n_features)
    """
    own, twin = features - features.mean(axis=0), simulated - simulated.mean(axis=0)
    slope: FloatArray = (own * twin).sum(axis=0) / np.maximum((twin**2).sum(axis=0), 1e-9)
    return np.clip(slope, 0.0, 1.0)


@contextmanager
def without_machines_of(simulator: str) -> Iterator[None]:
    """Let nothing be known of a simulator's machines: how well others prepare for it is seen then."""
    token = LEFT_OUT.set(simulator)
    try:
        yield
    finally:
        LEFT_OUT.reset(token)


def load_population(path: Path = FILE) -> Population:
    """Return the population that comes with this version, but for what `without_machines_of` leaves out.

    Raises
    ------
    InputError
        If there is no such file or it belongs to other features.
    """
    return _read(path, LEFT_OUT.get())


@cache
def _read(path: Path, left_out: str) -> Population:
    if left_out:
        whole = _read(path, "")
        return whole.of_rows(whole.simulators != left_out)
    arrays = read_arrays(path, MOST_BYTES)
    if arrays is None:
        raise InputError(
            "the population is not there, or damaged",
            where=path.name,
            remedy="make it again: python -m app.calibration.gap.population",
        )
    of_rigs = np.searchsorted(arrays["simulated_rigs"], arrays["rigs"])
    tables = {
        name: np.asarray(arrays[name], dtype=np.float64)
        for name in ("changes", "change_scatter", "features", "feature_scatter", "loads_n_per_mm")
    } | {name: np.asarray(arrays[name], dtype=np.float64)[of_rigs] for name in ("simulated", "simulated_scatter")}
    return Population(
        arrays["rigs"],
        arrays["simulators"],
        arrays["causes"],
        arrays["by_hand"],
        tuple(map(str, arrays["change_names"])),
        tuple(map(str, arrays["feature_names"])),
        **tables,
    )
