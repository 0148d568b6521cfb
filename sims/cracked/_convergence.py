"""Is the step short enough? The same run at the step in use, half and a quarter of it."""

from __future__ import annotations

from dataclasses import dataclass
from math import log2

import numpy as np

from gearsig.checks import positive
from sims.cracked._respond import default_step_s, respond
from sims.machine import Machine, Operation

TOLERANCE = 1e-4
"""Relative error of the transmission error's rms that counts as converged."""


@dataclass(frozen=True)
class Convergence:
    """What a shorter step changes.

    Parameters
    ----------
    steps_s : tuple of float
        The step in use, half of it, a quarter of it.
    rms_m : tuple of float
        Rms of the transmission error about its mean, over the second half of the run.
    """

    steps_s: tuple[float, float, float]
    rms_m: tuple[float, float, float]

    @property
    def error(self) -> float:
        """Relative difference of the rms at the step in use from that at a quarter of it."""
        return abs(self.rms_m[0] / self.rms_m[2] - 1.0)

    @property
    def order(self) -> float:
        """Observed order, log₂ of the ratio of successive differences; NaN where both are rounding."""
        first, second = abs(self.rms_m[0] - self.rms_m[1]), abs(self.rms_m[1] - self.rms_m[2])
        return log2(first / second) if first > 0.0 and second > 0.0 else float("nan")

    @property
    def converged(self) -> bool:
        """Whether the error is at most `TOLERANCE`."""
        return self.error <= TOLERANCE

    @property
    def text(self) -> str:
        """Three lines for people."""
        lines = [
            f"step {1e6 * h:8.4f} us: rms transmission error {1e6 * r:.6f} um"
            for h, r in zip(self.steps_s, self.rms_m, strict=True)
        ]
        verdict = "converged" if self.converged else "NOT converged: take a shorter step"
        return "\n".join([*lines, f"relative error {self.error:.1e} (allowed {TOLERANCE:.0e}): {verdict}"])


def check_convergence(
    machine: Machine,
    operation: Operation,
    rng: np.random.Generator,
    *,
    duration_s: float = 0.5,
    step_s: float | None = None,
) -> Convergence:
    """Compare three steps on the same machine, with the same roughness.

    Parameters
    ----------
    machine : Machine
    operation : Operation
    rng : numpy.random.Generator
    duration_s : float
        Of each run; its second half is compared. In a chaotic motion (light load, rattle) no step converges, as two
        runs part however close they start.
    step_s : float or None
        None: the default.
    """
    positive(duration_s, "duration_s", "s")
    step = default_step_s(machine, operation) if step_s is None else positive(step_s, "step_s", "s")
    seed = int(rng.integers(2**63))
    steps, found = (step, step / 2, step / 4), []
    for i, h in enumerate(steps):
        response = respond(
            machine,
            operation,
            duration_s=duration_s,
            rng=np.random.default_rng(seed),
            signals=("transmission_error_m",),
            step_s=h,
            stride=2**i,
        )
        error = response["transmission_error_m"]
        found.append(float(np.std(error[len(error) // 2 :])))
    return Convergence(steps, (found[0], found[1], found[2]))
