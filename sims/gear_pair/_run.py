"""A run of a gear pair: its signals on an even grid of time, integrated in parts that can be interrupted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil
from typing import Generic, TypeVar

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError, RefusalError
from gearsig.results import Result
from sims.machine import Profile

State = TypeVar("State")
March = Callable[[float, int, FloatArray, FloatArray], int]
"""(time_s, n_steps, rows, energies) → rows that were filled, fewer than there are where the solution bursts."""


@dataclass(frozen=True)
class PairResponse(Result, Generic[State], columns=("time_s", "signals")):
    """Signals of a run on an even grid of time.

    Parameters
    ----------
    start_s, interval_s : float
    signals : mapping
        Name → (n,), in m, rad, s, N.
    step_s : float
        Of the integrator.
    energy_j : array
        Potential, kinetic and gravitational energy, (n,), or empty where it was not asked for.
    last : state of the model or None
        At the end of the last step: one step after the last point where every step is kept.
    """

    start_s: float
    interval_s: float
    signals: Mapping[str, FloatArray]
    step_s: float
    energy_j: FloatArray
    last: State | None = None

    @property
    def time_s(self) -> FloatArray:
        """Times of the points."""
        return self.start_s + self.interval_s * np.arange(len(next(iter(self.signals.values()))))

    @property
    def ends_s(self) -> float:
        """When a run that goes on from `last` begins."""
        return self.start_s + self.interval_s * len(self.time_s)

    def __getitem__(self, name: str) -> FloatArray:
        """Return a signal by its name."""
        return self.signals[name]

    def followed_by(self, other: PairResponse[State]) -> PairResponse[State]:
        """Return this run and one that went on from its last state, of the same signals, as one."""
        signals = {name: np.concatenate((values, other[name])) for name, values in self.signals.items()}
        return replace(
            other, start_s=self.start_s, signals=signals, energy_j=np.concatenate((self.energy_j, other.energy_j))
        )


@dataclass(frozen=True)
class RunPlan:
    """Steps of a run, and which of them are kept.

    Parameters
    ----------
    start_s, duration_s, step_s : float
    stride : int
        Every how many steps a point is kept.
    steps_per_call : int
        After these many compiled code comes back for a look whether it is to stop.
    max_steps : int
        Ten minutes to half an hour of computing or so; more is taken for a mistake.
    """

    start_s: float
    duration_s: float
    step_s: float
    stride: int
    steps_per_call: int
    max_steps: int = 400_000_000

    def __post_init__(self) -> None:
        positive(self.duration_s, "duration_s", "s")
        positive(self.step_s, "step_s", "s")
        count(self.stride, "stride")
        if self.n_steps > self.max_steps:
            raise InputError(
                f"{self.n_steps:.3g} steps of {self.step_s:.3g} s",
                where="duration_s",
                allowed=f"at most {self.max_steps:.0e} steps",
                remedy="simulate a shorter time, or in parts",
            )

    @property
    def n_steps(self) -> int:
        """Steps that reach the end."""
        return ceil(self.duration_s / self.step_s - 1e-9)

    def run(
        self,
        march: March,
        signals: Sequence[str],
        *,
        with_energy: bool,
        remedy: str,
        on_progress: Callable[[float], None] | None,
    ) -> tuple[dict[str, FloatArray], FloatArray]:
        """Return the signals by name, and the energies where they are asked for.

        Raises
        ------
        RefusalError
            If the solution grows beyond all bounds.
        """
        every, n_steps = self.stride, self.n_steps
        rows = np.empty((-(-n_steps // every), len(signals)))
        energies = np.empty(len(rows) if with_energy else 0)
        per_call = every * max(self.steps_per_call // every, 1)
        for begun in range(0, n_steps, per_call):
            n = min(per_call, n_steps - begun)
            part = slice(begun // every, begun // every + -(-n // every))
            filled = march(
                self.start_s + begun * self.step_s, n, rows[part], energies[part] if with_energy else energies
            )
            if filled < len(rows[part]) or not np.isfinite(rows[part]).all():
                raise RefusalError(
                    f"the solution grows beyond all bounds after {(begun + filled * every) * self.step_s:.3g} s "
                    f"at a step of {self.step_s:.3g} s",
                    remedy=remedy,
                )
            if on_progress is not None:
                on_progress((begun + n) / n_steps)
        return dict(zip(signals, rows.T, strict=True)), energies


@dataclass(frozen=True)
class StepConvergence:
    """What a shorter step of the integrator changes.

    Parameters
    ----------
    steps_s : tuple of float
        The step in use first, the most exact run last.
    rms : mapping
        Name of a signal → rms about its mean at each step.
    allowed : float
        Relative error that counts as converged.
    """

    steps_s: tuple[float, ...]
    rms: Mapping[str, tuple[float, ...]]
    allowed: float

    @classmethod
    def of(cls, runs: Sequence[PairResponse[State]], allowed: float, *, first: float = 0.0) -> StepConvergence:
        """Compare runs with the same signals, from the part `first` of each on."""

        def rms(values: FloatArray) -> float:
            return float(np.std(values[int(first * len(values)) :]))

        return cls(tuple(r.step_s for r in runs), {n: tuple(rms(r[n]) for r in runs) for n in runs[0].signals}, allowed)

    @property
    def error(self) -> float:
        """Greatest relative difference of an rms at the step in use from that of the most exact run."""
        return max(abs(values[0] / values[-1] - 1.0) for values in self.rms.values())

    @property
    def converged(self) -> bool:
        """Whether the error is allowed."""
        return self.error <= self.allowed

    @property
    def text(self) -> str:
        """For people: a line for each step and signal, and the verdict."""
        lines = [
            f"step {1e6 * step:8.4f} us: rms of {name} {values[i]:.6g}"
            for name, values in self.rms.items()
            for i, step in enumerate(self.steps_s)
        ]
        verdict = "converged" if self.converged else "NOT converged: take a shorter step"
        return "\n".join([*lines, f"relative error {self.error:.1e} (allowed {self.allowed:.0e}): {verdict}"])


def profile_points(profile: Profile, factor: float) -> FloatArray:
    """Times and values as kernels take them, (2, n)."""
    return np.ascontiguousarray(np.vstack((profile.times_s, factor * np.asarray(profile.values))), dtype=np.float64)
