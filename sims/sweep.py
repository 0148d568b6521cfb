"""What a sweep is: a grid of simulations over parameters, effects, speed and torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import product
from math import isfinite, prod
from typing import TYPE_CHECKING, Any

from gearsig.checks import count, one_of, positive, within
from gearsig.errors import InputError
from gearsig.recording.write import WRITERS
from sims.effects.effect import EffectSetting, OptionValue
from sims.machine.operation import Course, Operation
from sims.simulator import ParameterValue

if TYPE_CHECKING:
    from gearsig.recording.types import Recording

MOST_POINTS = 1_000_000
OPERATION_AXES = ("speed_rpm", "torque_nm")
"""Names of axes that are neither a parameter nor an effect."""


@dataclass(frozen=True)
class Axis:
    """What a sweep varies.

    Parameters
    ----------
    name : str
        "speed_rpm", "torque_nm", a parameter or an effect.
    values : tuple of float
        In the unit of the parameter or of the effect's severity.
    options : mapping
        Of an effect: which gear, which tooth.
    """

    name: str
    values: tuple[float, ...]
    options: Mapping[str, OptionValue] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(float(v) for v in self.values))
        if not self.values or not all(isfinite(v) for v in self.values):
            raise InputError(f"axis {self.name} has the values {self.values}", allowed="at least one finite number")
        if len(set(self.values)) < len(self.values):
            raise InputError(f"axis {self.name} has a value twice", allowed="different values")


@dataclass(frozen=True)
class Point:
    """One simulation of a sweep.

    Parameters
    ----------
    index : int
        Place in the grid; the last axis runs fastest.
    values : tuple of float
        One per axis.
    seed : int
        Of all that is drawn.
    """

    index: int
    values: tuple[float, ...]
    seed: int


@dataclass(frozen=True)
class Sweep:
    """A grid of simulations.

    Parameters
    ----------
    model, preset : str
    axes : tuple of Axis
    parameters, effects : mapping and tuple of EffectSetting
        The same at every point.
    speed_rpm, torque_nm : Course or None
        Where no axis varies them; None: the preset's.
    duration_s, sampling_rate_hz : float
    seed : int
    common_seed : bool
        False: every point draws its own noise, roughness and tolerances, from the seed and its place in the grid. Such
        points are independent: for statistics and for training. True: all draw the same (common random numbers), so
        that points differ by what was varied alone: for differences between neighbours.
    extension : str
        Format of the recordings.
    """

    model: str
    axes: tuple[Axis, ...]
    preset: str = ""
    parameters: Mapping[str, ParameterValue] = field(default_factory=dict)
    effects: tuple[EffectSetting, ...] = ()
    speed_rpm: Course | None = None
    torque_nm: Course | None = None
    duration_s: float = 5.0
    sampling_rate_hz: float = 20480.0
    seed: int = 0
    common_seed: bool = False
    extension: str = ".h5"

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", tuple(self.axes))
        object.__setattr__(self, "effects", tuple(self.effects))
        one_of(self.extension, "extension of the recordings", WRITERS)
        positive(self.duration_s, "duration_s", "s")
        count(self.seed, "seed", minimum=0)
        names = [axis.name for axis in self.axes]
        if not names or len(set(names)) < len(names):
            raise InputError(f"axes are {', '.join(names) or 'none'}", allowed="at least one, none twice")
        if self.n_points > MOST_POINTS:
            raise InputError(f"the grid has {self.n_points} points", allowed=f"up to {MOST_POINTS}")
        self._check_axes()

    @property
    def n_points(self) -> int:
        """Size of the grid."""
        return prod(len(axis.values) for axis in self.axes)

    def points(self) -> tuple[Point, ...]:
        """All points, the last axis running fastest."""
        grid = product(*(axis.values for axis in self.axes))
        return tuple(Point(i, values, self._seed(i)) for i, values in enumerate(grid))

    def simulate(self, point: Point) -> Recording:
        """Run one point."""
        import sims

        own = self.at(point)
        return sims.simulate(
            own.model,
            preset=own.preset,
            parameters=own.parameters,
            effects=own.effects,
            speed_rpm=own.speed_rpm,
            torque_nm=own.torque_nm,
            duration_s=own.duration_s,
            sampling_rate_hz=own.sampling_rate_hz,
            seed=point.seed,
        )

    def definition(self) -> dict[str, Any]:
        """What decides the results, as plain values."""
        return {
            "model": self.model,
            "preset": self.preset,
            "axes": [{"name": a.name, "values": list(a.values), "options": dict(a.options)} for a in self.axes],
            "parameters": dict(self.parameters),
            "effects": [{"name": s.name, "severity": s.severity, "options": dict(s.options)} for s in self.effects],
            "speed_rpm": _plain(self.speed_rpm),
            "torque_nm": _plain(self.torque_nm),
            "duration_s": self.duration_s,
            "sampling_rate_hz": self.sampling_rate_hz,
            "seed": self.seed,
            "common_seed": self.common_seed,
            "extension": self.extension,
        }

    def _seed(self, index: int) -> int:
        import numpy as np

        if self.common_seed:
            return self.seed
        return int(np.random.SeedSequence([self.seed, index]).generate_state(1, np.uint32)[0])

    def at(self, point: Point) -> Sweep:
        """Return the same with a point's values in place."""
        from sims.effects import effects as known_effects

        parameters, settings = dict(self.parameters), list(self.effects)
        speed, torque = self.speed_rpm, self.torque_nm
        for axis, value in zip(self.axes, point.values, strict=True):
            if axis.name == "speed_rpm":
                speed = Course.constant(value)
            elif axis.name == "torque_nm":
                torque = Course.constant(value)
            elif axis.name in known_effects():
                settings.append(EffectSetting(axis.name, value, axis.options))
            else:
                parameters[axis.name] = value
        return replace(self, parameters=parameters, effects=tuple(settings), speed_rpm=speed, torque_nm=torque)

    def _check_axes(self) -> None:
        """Refuse names that do not exist and values out of their ranges; what the machine allows, each point tells."""
        from sims.effects import effect
        from sims.registry import simulator
        from sims.values import checked_value, parameter

        model = simulator(self.model)
        for axis in self.axes:
            if axis.name in OPERATION_AXES:
                for value in axis.values:
                    Operation(Course.constant(value), Course.constant(value))
            elif axis.name in model.effects:
                s = effect(axis.name).severity
                effect(axis.name).complete(axis.options)
                for value in axis.values:
                    within(value, f"{s.name} of {axis.name}", s.low, s.high, s.unit)
            else:
                for value in axis.values:
                    checked_value(parameter(model.parameters, axis.name), value)


def _plain(course: Course | None) -> dict[str, list[float]] | None:
    return None if course is None else {"times_s": course.times_s.tolist(), "values": course.values.tolist()}
