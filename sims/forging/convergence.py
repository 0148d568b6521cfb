"""Are the steps short enough? A cycle at the tolerance in use, beside one at a hundred-thousandth of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.errors import RefusalError
from sims.forging.drive import ForgingDrive
from sims.forging.respond import TOLERANCE, DriveResponse, respond
from sims.forging.schedule import CONTINUOUS, Cycle, schedule
from sims.machine.operation import Course

EXACT = 1e-5
"""Of the tolerance in use."""
ALLOWED_S, ALLOWED = 1e-6, 1e-3
"""Of the impact's time, and relative of its energy, the force's rms and the balance of energy."""
CONTINUOUS_S = 3.0


@dataclass(frozen=True)
class ForgingConvergence:
    """What a far smaller tolerance changes.

    Parameters
    ----------
    impact : str
        Which one is looked at.
    time_s, exact_time_s : float
        Of that impact.
    energy_error : float
        Relative difference of its energy.
    force_error : float
        Relative difference of the interaction force's rms.
    balance_error : float
        Largest energy that appears or is lost, over the work put in.
    n_steps, n_exact_steps : int
    """

    impact: str
    time_s: float
    exact_time_s: float
    energy_error: float
    force_error: float
    balance_error: float
    n_steps: int
    n_exact_steps: int

    @property
    def converged(self) -> bool:
        """Whether all differences are allowed ones."""
        errors = (self.energy_error, self.force_error, self.balance_error)
        return abs(self.time_s - self.exact_time_s) <= ALLOWED_S and max(errors) <= ALLOWED

    @property
    def text(self) -> str:
        """For people."""
        late_s = abs(self.time_s - self.exact_time_s)
        limits = f"(allowed {ALLOWED_S:.0e} s)", f"(allowed {ALLOWED:g})"
        lines = [
            f"{self.n_steps} steps beside {self.n_exact_steps} at a tolerance {1 / EXACT:.0e} times as small:",
            f"  {self.impact} at {self.exact_time_s:.6g} s: off by {late_s:.1e} s {limits[0]}",
            f"  its energy: off by {self.energy_error:.1e} {limits[1]}",
            f"  rms of the interaction force: off by {self.force_error:.1e} {limits[1]}",
            f"  energy that appears or is lost: {self.balance_error:.1e} of the work put in {limits[1]}",
        ]
        return "\n".join([*lines, "converged" if self.converged else "NOT converged: flanks may rattle chaotically"])


def check_convergence(drive: ForgingDrive, cycle: Cycle, torque_nm: Course) -> ForgingConvergence:
    """Run one cycle twice.

    The impact is the first one backwards after the torque has gone, in continuous rotation the first of all. What
    rattles afterwards may part however close two runs start: it is compared by the force's rms alone.

    Raises
    ------
    RefusalError
        If flanks never meet.
    """
    runs_on = cycle.mode == CONTINUOUS
    lasts_s = CONTINUOUS_S if runs_on else cycle.on_s + cycle.off_s
    courses = schedule(cycle, torque_nm, lasts_s)
    ours, exact = (respond(drive, courses, duration_s=lasts_s, tolerance=t) for t in (TOLERANCE, EXACT * TOLERANCE))
    flank, after_s = (0.0, 0.0) if runs_on else (-1.0, cycle.on_s)
    (time_s, speed), (exact_s, exact_speed) = (_first(run, flank, after_s) for run in (ours, exact))
    rms = [float(np.sqrt(np.mean(run["interaction force"] ** 2))) for run in (ours, exact)]
    balance = ours["energy"] - ours["work put in"] + ours["lost in contact"] + ours["lost in friction"]
    return ForgingConvergence(
        "first impact" if runs_on else "back-impact after the torque has gone",
        time_s,
        exact_s,
        abs((speed / exact_speed) ** 2 - 1.0),
        abs(rms[0] / rms[1] - 1.0),
        float(np.max(np.abs(balance)) / np.max(np.abs(ours["work put in"]))),
        ours.n_steps,
        exact.n_steps,
    )


def _first(run: DriveResponse, flank: float, after_s: float) -> tuple[float, float]:
    """Time and speed of the first contact on a flank (0: either) after a time."""
    fitting = (run.contact("start_s") > after_s) & ((run.contact("flank") == flank) | (flank == 0.0))
    if not np.any(fitting):
        raise RefusalError("the flanks never meet there: there is nothing to compare", remedy="give torque, or a brake")
    row = int(np.argmax(fitting))
    return float(run.contact("start_s")[row]), float(run.contact("start_speed_mps")[row])
