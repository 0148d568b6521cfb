"""How one shaft moves: stretches forwards, backwards and at rest; starts, stops, reversals."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError

STANDING_PART = 0.02
"""Of the ordinary highest speed: below it a shaft stands."""
STANDING_SCATTER = 5.0
"""Or below so many standard deviations of the speed's own scatter."""
SHORTEST_S = 0.03
"""A shorter rest is the turning point of a swing, a shorter motion a tremor."""
LEAST_TURN = 0.02
"""Of the longest stretch's angle: a standing machine that is knocked has not been started."""
AT_ONCE, FIRST_S = 0.15, 0.01
"""Of the top speed of the first stretch: slower on average in its first hundredth of a second, it begins from rest."""


@dataclass(frozen=True)
class Stretch:
    """A time in which a shaft turns one way, or stands.

    Parameters
    ----------
    direction : int
        1, −1, or 0 at rest.
    first, last : int
        Samples; the last is not in it.
    start_s, end_s : float
    turned_rad : float
    top_speed_rad_s : float
        Largest magnitude.
    """

    direction: int
    first: int
    last: int
    start_s: float
    end_s: float
    turned_rad: float
    top_speed_rad_s: float

    @property
    def duration_s(self) -> float:
        """From start to end."""
        return self.end_s - self.start_s


@dataclass(frozen=True)
class Course:
    """The stretches of a recording, and what they add up to.

    Parameters
    ----------
    stretches : tuple of Stretch
        One after the other, without gaps.
    threshold_rad_s : float
        Speed below which the shaft is taken to stand.
    starts_at_once : bool
        Whether the shaft stands at the first sample and moves from it on: a start without a rest ahead of it.
    """

    stretches: tuple[Stretch, ...]
    threshold_rad_s: float
    starts_at_once: bool = False

    @property
    def moving(self) -> tuple[Stretch, ...]:
        """Stretches in which the shaft turns."""
        return tuple(s for s in self.stretches if s.direction)

    @property
    def starts_s(self) -> tuple[float, ...]:
        """Times at which motion begins after a rest in the record, or from rest at its first sample."""
        at_once = (self.stretches[0].start_s,) if self.starts_at_once else ()
        return (*at_once, *(b.start_s for a, b in self._pairs() if not a.direction and b.direction))

    @property
    def stops_s(self) -> tuple[float, ...]:
        """Times at which motion ends in a rest."""
        return tuple(b.start_s for a, b in self._pairs() if a.direction and not b.direction)

    @property
    def summary(self) -> str:
        """Starts and stops in words; a record that begins or ends in motion holds one less of them."""
        said = f"{_counted(len(self.starts_s), 'start')} and {_counted(len(self.stops_s), 'stop')}"
        moves = {
            "begins": self.stretches[0].direction and not self.starts_at_once,
            "ends": self.stretches[-1].direction,
        }
        ends = [name for name, is_moving in moves.items() if is_moving]
        return f"{said} in a record that {' and '.join(ends)} in motion" if ends else said

    @property
    def n_reversals(self) -> int:
        """Changes from one direction to the other, with or without a rest between."""
        return sum(a.direction != b.direction for a, b in pairwise(self.moving))

    @property
    def standing_part(self) -> float:
        """Part of the time at rest."""
        total = sum(s.duration_s for s in self.stretches)
        return sum(s.duration_s for s in self.stretches if not s.direction) / total

    @property
    def backwards_rad(self) -> float:
        """Angle turned against the direction in which most is turned."""
        turned = [sum(abs(s.turned_rad) for s in self.stretches if s.direction == d) for d in (1, -1)]
        return float(min(turned))

    def _pairs(self) -> list[tuple[Stretch, Stretch]]:
        return list(pairwise(self.stretches))


def _counted(n: int, name: str) -> str:
    return f"{n} {name}" if n == 1 else f"{n} {name}s"


def find_course(angle_rad: FloatArray, speed_rad_s: FloatArray, sampling_rate_hz: float) -> Course:
    """Cut a motion into stretches forwards, backwards and at rest.

    At rest is a speed below 2 % of its 95 % quantile, or within five standard deviations of its scatter from sample to
    sample, for at least 30 ms.

    Raises
    ------
    InputError
        If the lengths differ, or there are fewer than 8 samples.
    """
    positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    if len(angle_rad) != len(speed_rad_s) or len(speed_rad_s) < 8:
        raise InputError(f"{len(angle_rad)} angles for {len(speed_rad_s)} speeds", allowed="as many, at least 8")
    scatter = 1.4826 * float(np.median(np.abs(np.diff(speed_rad_s, 2)))) / np.sqrt(6.0)
    threshold = max(STANDING_PART * float(np.quantile(np.abs(speed_rad_s), 0.95)), STANDING_SCATTER * scatter, 1e-12)
    directions = np.where(np.abs(speed_rad_s) < threshold, 0, np.sign(speed_rad_s)).astype(np.int64)
    shortest = max(2, round(SHORTEST_S * sampling_rate_hz))
    _absorb(directions, shortest)
    stretches = _cut(directions, angle_rad, speed_rad_s, sampling_rate_hz)
    least = LEAST_TURN * max(abs(s.turned_rad) for s in stretches)
    for stretch in stretches:
        if abs(stretch.turned_rad) < least:
            directions[stretch.first : stretch.last] = 0
    final = _cut(directions, angle_rad, speed_rad_s, sampling_rate_hz)
    return Course(final, threshold, _starts_at_once(final[0], angle_rad, sampling_rate_hz))


def is_start_stop(course: Course, *, least_standing: float = 0.05, least_back_rad: float = 0.1) -> bool:
    """Say whether a motion starts and stops, or reverses: no speed to count orders by.

    A run-up from rest does not: what follows can be counted in revolutions.
    """
    rests = bool(course.starts_s) and bool(course.stops_s) and course.standing_part >= least_standing
    return rests or course.backwards_rad >= least_back_rad


def _starts_at_once(first: Stretch, angle_rad: FloatArray, rate_hz: float) -> bool:
    """Say whether the first stretch moves, and began to with the record."""
    n = min(max(2, round(FIRST_S * rate_hz)), first.last - 1)
    speed = abs(float(angle_rad[n] - angle_rad[0])) * rate_hz / n
    return bool(first.direction) and speed < AT_ONCE * first.top_speed_rad_s


def _absorb(directions: np.ndarray, shortest: int) -> None:
    """Give runs that are too short the direction of the run before them, the shortest first; in place."""
    while True:
        edges = np.flatnonzero(np.diff(directions)) + 1
        bounds = np.concatenate([[0], edges, [len(directions)]])
        lengths = np.diff(bounds)
        if len(lengths) < 2 or lengths.min() >= shortest:
            return
        i = int(np.argmin(lengths))
        giver = bounds[i] - 1 if i else bounds[1]
        directions[bounds[i] : bounds[i + 1]] = directions[giver]


def _cut(directions: np.ndarray, angle_rad: FloatArray, speed_rad_s: FloatArray, rate_hz: float) -> tuple[Stretch, ...]:
    edges = np.flatnonzero(np.diff(directions)) + 1
    bounds = np.concatenate([[0], edges, [len(directions)]])
    return tuple(
        _stretch(int(directions[a]), int(a), int(b), angle_rad, speed_rad_s, rate_hz) for a, b in pairwise(bounds)
    )


def _stretch(
    direction: int, first: int, last: int, angle_rad: FloatArray, speed_rad_s: FloatArray, rate_hz: float
) -> Stretch:
    end = min(last, len(angle_rad) - 1)
    turned = float(angle_rad[end] - angle_rad[first])
    top = float(np.max(np.abs(speed_rad_s[first:last])))
    return Stretch(direction, first, last, first / rate_hz, last / rate_hz, turned, top)
