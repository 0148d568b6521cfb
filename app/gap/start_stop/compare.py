"""A start–stop recording against what it should be: changes of the whole, of either half, and without each cycle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from app.gap.start_stop.predict import curve_shape
from app.gap.start_stop.twin import DriveTwin
from gearsig.checks import FloatArray
from gearsig.gap.start_stop.cycles import halves
from gearsig.gap.start_stop.floors import DriveFloor, load_floor
from gearsig.gap.start_stop.told import NAMES, Examined, Spot, Told, change_of, spot_of

MOST_BLOCKS = 8
HALF = float(np.sqrt(2.0))
"""By which half of the cycles scatter more."""


@dataclass(frozen=True)
class Compared:
    """One recording beside its sound reference, or beside the simulated drive.

    Parameters
    ----------
    name : str
    now : Examined
    reference : Examined or None
    twin : DriveTwin
    """

    name: str
    now: Examined
    reference: Examined | None
    twin: DriveTwin

    @cached_property
    def other(self) -> Told:
        """What it is compared with."""
        return self.twin.sound if self.reference is None else self.reference.tell(self.reference.every)

    @cached_property
    def sound_run(self) -> Examined:
        """A run of the sound simulated drive."""
        return self.twin.examine(self.twin.parameters)

    @cached_property
    def told(self) -> Told:
        """What all cycles tell."""
        return self.now.tell(self.now.every)

    @cached_property
    def shape(self) -> FloatArray:
        """Of worn flanks."""
        return curve_shape(self.twin)

    @cached_property
    def spot(self) -> Spot:
        """Tooth and order that changed most."""
        return spot_of(self.told, self.other)

    @cached_property
    def change(self) -> FloatArray:
        """Of all cycles."""
        return change_of(self.told, self.other, self.shape)

    def change_in(self, cycles: tuple[int, ...], at: Spot | None = None) -> FloatArray:
        """Return the change of some cycles."""
        return change_of(self.now.tell(cycles), self.other, self.shape, at)

    @property
    def halves(self) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Every second cycle, and the others."""
        return halves(self.now.cycles)

    @cached_property
    def without(self) -> FloatArray:
        """Changes without each cycle (or each of eight blocks of them), (n_blocks, n): the tooth and order stay."""
        return np.array([self.change_in(kept, self.spot) for kept in _but_each(self.now.every)])

    @cached_property
    def scatter(self) -> FloatArray:
        """Standard errors of the change, from the cycles of the recording and of its reference (jackknife)."""
        spread: FloatArray = np.hypot(_jackknife(self.without), _jackknife(self._without_of_reference))
        return spread

    @property
    def _without_of_reference(self) -> FloatArray:
        """Changes against the reference without each of its cycles; a simulated drive has no noise."""
        if self.reference is None:
            return np.zeros((1, len(NAMES)))
        kept = _but_each(self.reference.every)
        return np.array([change_of(self.told, self.reference.tell(one), self.shape, self.spot) for one in kept])

    def floor(self, part: str = "whole") -> DriveFloor:
        """Return how far sound drives lie from what this is compared with, as far as it can be told of this one."""
        floor = load_floor(with_reference=self.reference is not None, part=part)
        return floor.widened(self.scatter * (1.0 if part == "whole" else HALF))


def _but_each(every: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Return all cycles but one, for each; or but one of eight blocks."""
    blocks = np.array_split(np.array(every), min(len(every), MOST_BLOCKS))
    return [tuple(c for c in every if c not in block) for block in blocks]


def _jackknife(rows: FloatArray) -> FloatArray:
    """Return the standard error by leaving out each block, (n,)."""
    n = len(rows)
    spread: FloatArray = np.sqrt((n - 1.0) * np.nanvar(np.nan_to_num(rows), axis=0))
    return spread
