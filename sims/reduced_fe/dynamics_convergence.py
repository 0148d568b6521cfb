"""How far the integrator's step changes the result: the fast way against the reference at a quarter of the step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, positive
from sims.machine.operation import Operation
from sims.reduced_fe.dynamics_constants import FlexiblePair, constants
from sims.reduced_fe.dynamics_respond import TRANSMISSION_ERROR, respond
from sims.reduced_fe.dynamics_stability import followed_step_s

CHECK_S = 0.05
"""Time over which runs are compared."""
FINER = 4
SIGNALS = (TRANSMISSION_ERROR, "mesh_force_n", "driver angle acceleration")
ALLOWED = 0.01
"""Part by which rms values may differ."""


@dataclass(frozen=True)
class FlexConvergence:
    """Rms values of signals, without their means, at a step and by the reference.

    Parameters
    ----------
    step_s, fine_step_s : float
    rms, fine_rms : arrays, (n_signals,)
        Of `SIGNALS`, in their units.
    largest : array, (n_signals,)
        Greatest difference at any time over the reference's rms.
    """

    step_s: float
    fine_step_s: float
    rms: FloatArray
    fine_rms: FloatArray
    largest: FloatArray

    @property
    def rms_error(self) -> FloatArray:
        """Relative difference of the rms values."""
        result: FloatArray = np.abs(self.rms / self.fine_rms - 1.0)
        return result

    @property
    def is_enough(self) -> bool:
        """Whether no rms value is off by more than `ALLOWED`."""
        return bool(self.rms_error.max() <= ALLOWED)

    @property
    def text(self) -> str:
        """For people."""
        head = f"step {self.step_s * 1e6:.3g} µs against Newmark's method at {self.fine_step_s * 1e6:.3g} µs:"
        rows = [
            f"  {name}: rms off by {100.0 * off:.2g} %, single values by up to {100.0 * most:.2g} % of it"
            for name, off, most in zip(SIGNALS, self.rms_error, self.largest, strict=True)
        ]
        return "\n".join([head, *rows, "The step is short enough." if self.is_enough else "Take a shorter step_us."])


def check_convergence(
    pair: FlexiblePair, operation: Operation, step_s: float, time_s: float = CHECK_S
) -> FlexConvergence:
    """Run a pair both ways from the same static balance on and compare.

    Where teeth lose contact and the motion is chaotic, single values part after a while at any step; rms values do not.

    Parameters
    ----------
    pair : FlexiblePair
    operation : Operation
    step_s : float
        Longest of the fast way, see `followed_step_s`; the reference takes a quarter of it.
    time_s : float
    """
    own = constants(pair, operation)
    step = followed_step_s(pair, own, operation, positive(step_s, "step_s", "s"))
    fast = respond(pair, operation, duration_s=time_s, signals=SIGNALS, step_s=step, ready=own)
    fine = respond(
        pair,
        operation,
        duration_s=time_s,
        signals=SIGNALS,
        step_s=step / FINER,
        stride=FINER,
        method="newmark",
        ready=own,
    )
    n = min(len(fast[SIGNALS[0]]), len(fine[SIGNALS[0]]))
    rms, fine_rms = (np.array([np.std(r[name][:n]) for name in SIGNALS]) for r in (fast, fine))
    largest = np.array([np.max(np.abs(fast[name][:n] - fine[name][:n])) for name in SIGNALS]) / fine_rms
    return FlexConvergence(step, step / FINER, rms, fine_rms, largest)
