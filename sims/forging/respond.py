"""Run the drive and return what it does: angles, torque, interaction force, every contact."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, closest_match_hint, one_of, positive, within
from gearsig.errors import InputError, RefusalError
from sims.forging.drive import ForgingDrive
from sims.forging.numbers import CONTACT_COLUMNS, N_STATES, SIGNALS, drive_numbers
from sims.forging.schedule import Schedule

TOLERANCE = 1e-6
"""Relative error of a step; absolute errors of the states go with it."""
ABSOLUTE = np.array([1e-8, 1e-6, 1e-10, 1e-7, 1e-4, 1e-4, 1e-4, 1e-4])
"""At `TOLERANCE`, in rad, rad/s, m, m/s, and bristles in their sliding friction; a loaded flank yields 2e-5 m."""
CONTACTS_PER_SECOND = 2000
"""More than any rattle makes; beyond, the run is stopped."""
MOST_POINTS = 60_000_000


@dataclass(frozen=True)
class FirstState:
    """Where a run begins: angle and speed of the pinion, compression between the flanks and its rate."""

    pinion_angle_rad: float = 0.0
    pinion_speed_rad_s: float = 0.0
    compression_m: float = 0.0
    compression_rate_mps: float = 0.0


@dataclass(frozen=True)
class DriveResponse:
    """A run of the drive on an even grid of time from 0, and its contacts.

    Parameters
    ----------
    interval_s : float
    signals : mapping
        Name (see `sims.forging.numbers.SIGNALS`) → (n,).
    contacts : array, (n_contacts, 10)
        See `sims.forging.numbers.CONTACT_COLUMNS`: exact to the events' accuracy, not to the grid's.
    n_steps, n_refused : int
        Of the integrator.
    """

    interval_s: float
    signals: Mapping[str, FloatArray]
    contacts: FloatArray
    n_steps: int
    n_refused: int = 0

    @property
    def time_s(self) -> FloatArray:
        """Times of the points."""
        return self.interval_s * np.arange(len(next(iter(self.signals.values()))))

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        if name not in self.signals:
            hint = closest_match_hint(name, self.signals)
            raise InputError(f"there is no signal {name!r}", allowed=", ".join(self.signals), remedy=hint)
        return self.signals[name]

    def contact(self, column: str) -> FloatArray:
        """Return a column of the contacts by its name."""
        values: FloatArray = self.contacts[:, CONTACT_COLUMNS.index(column)]
        return values


def respond(
    drive: ForgingDrive,
    courses: Schedule,
    *,
    duration_s: float,
    interval_s: float = 1e-3,
    first: FirstState | None = None,
    tolerance: float = TOLERANCE,
    signals: Sequence[str] = SIGNALS,
) -> DriveResponse:
    """Integrate the drive from rest, or from a given state.

    Dormand–Prince 5(4) with error control; a step ends where flanks meet or part, so that the speed at which they meet
    is latched exactly, and where a course bends.

    Parameters
    ----------
    drive : ForgingDrive
    courses : Schedule
    duration_s, interval_s : float
        The grid is 0, interval, … below the duration.
    first : FirstState or None
        None: at rest, the teeth in the middle of the backlash.
    tolerance : float
        1e-12 to 1e-3.
    signals : sequence of str
        What is kept, of `sims.forging.numbers.SIGNALS`. The steps, and so the motion, do not depend on it.

    Raises
    ------
    RefusalError
        If flanks touch and part without end, or the state grows without bound.
    """
    positive(duration_s, "duration_s", "s")
    positive(interval_s, "interval_s", "s")
    within(tolerance, "tolerance", 1e-12, 1e-3)
    run = _Run.begin(drive, first or FirstState(), signals, duration_s, interval_s)
    for begin, end in pairwise(courses.stretches(duration_s)):
        run.advance(begin, end, courses.straight(begin, end), tolerance)
    return run.response(signals)


@dataclass
class _Run:
    """A run on its way: states, contact, and what has been kept; arrays that the kernel fills in place."""

    k: Any
    y: FloatArray
    mode: FloatArray
    counts: NDArray[np.int64]
    select: NDArray[np.int64]
    found: FloatArray
    contacts: FloatArray
    interval_s: float
    step_s: float = 1e-6

    @classmethod
    def begin(
        cls, drive: ForgingDrive, start: FirstState, signals: Sequence[str], duration_s: float, interval_s: float
    ) -> _Run:
        """Make room for the signals, and put the drive into its first state."""
        from sims.forging.contact_kernel import reach
        from sims.forging.integrate_kernel import open_contact

        n = ceil(duration_s / interval_s - 1e-9)
        if n > MOST_POINTS:
            raise InputError(f"{n} points are wanted", allowed=f"up to {MOST_POINTS}", remedy="shorten the run")
        select = np.array([SIGNALS.index(one_of(name, "signals", SIGNALS)) for name in signals], dtype=np.int64)
        contacts = np.zeros((1000 + int(CONTACTS_PER_SECOND * duration_s), len(CONTACT_COLUMNS)))
        y, mode, counts = np.zeros(N_STATES), np.zeros(3), np.zeros(4, dtype=np.int64)
        y[:4] = start.pinion_angle_rad, start.pinion_speed_rad_s, start.compression_m, start.compression_rate_mps
        k = drive_numbers(drive)
        flank = float(np.sign(y[2]))
        if flank * y[2] > reach(k, y[0], flank)[0]:
            open_contact(k, y, 0.0, flank, mode, contacts[0])
            counts[1] = 1
        return cls(k, y, mode, counts, select, np.full((n, len(select)), np.nan), contacts, interval_s)

    def advance(self, begin_s: float, end_s: float, course: FloatArray, tolerance: float) -> None:
        """Integrate over one stretch of straight courses."""
        from sims.forging.integrate_kernel import DONE, integrate

        absolute = ABSOLUTE * (tolerance / TOLERANCE)
        self.step_s, status = integrate(
            self.k, self.y, self.mode, begin_s, end_s, min(self.step_s, 1e-5), course, absolute, tolerance,
            self.interval_s, self.select, self.counts, self.found, self.contacts,
        )  # fmt: skip
        if status != DONE or not np.isfinite(self.y).all():
            raise _failure(status, end_s)

    def response(self, signals: Sequence[str]) -> DriveResponse:
        """Return what was kept."""
        filled = int(self.counts[0])
        self.found[filled:] = self.found[filled - 1]  # rounding may leave the last point just beyond the end
        kept = {name: np.ascontiguousarray(self.found[:, i]) for i, name in enumerate(signals)}
        contacts = self.contacts[: self.counts[1]].copy()
        return DriveResponse(self.interval_s, kept, contacts, int(self.counts[2]), int(self.counts[3]))


def _failure(status: int, before_s: float) -> RefusalError:
    from sims.forging.integrate_kernel import STUCK, TOO_MANY_CONTACTS

    reasons = {
        TOO_MANY_CONTACTS: "flanks touch and part more often than any rattle",
        STUCK: "no step is short enough for the motion",
    }
    return RefusalError(
        f"the simulation stops before {before_s:g} s: {reasons.get(status, 'the motion grows without bound')}",
        remedy="check inertias, stiffness and backlash",
    )
