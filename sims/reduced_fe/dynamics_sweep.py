"""Slow sweeps over speed, up and down: rms of the dynamic transmission error, contact loss, jumps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, positive
from gearsig.errors import InputError
from sims.machine.operation import Course, Operation
from sims.reduced_fe.dynamics_constants import FlexiblePair, constants
from sims.reduced_fe.dynamics_respond import STEP_S, TRANSMISSION_ERROR, respond
from sims.reduced_fe.integrate_coefficients import Method

STRIDE = 10
"""Steps per kept point."""


@dataclass(frozen=True)
class SpeedSweep:
    """What a sweep gives in equal parts of its time.

    Parameters
    ----------
    speed_rpm : array, (n,)
        Mean of each part, in the order of time.
    mesh_hz : array, (n,)
    rms_m : array, (n,)
        Of the dynamic transmission error without its mean in the part.
    least_force_n : array, (n,)
        Least mesh force.
    lost_part : array, (n,)
        Part of the time without contact on the driving flanks.
    n_steps : int
    step_s : float
    """

    speed_rpm: FloatArray
    mesh_hz: FloatArray
    rms_m: FloatArray
    least_force_n: FloatArray
    lost_part: FloatArray
    n_steps: int
    step_s: float

    def peak_hz(self, low_hz: float, high_hz: float) -> float:
        """Mesh frequency of the greatest rms value between two others."""
        inside = (self.mesh_hz >= low_hz) & (self.mesh_hz <= high_hz)
        if not np.any(inside):
            raise InputError(f"no part of the sweep lies in {low_hz:g} to {high_hz:g} Hz", where="peak_hz")
        return float(self.mesh_hz[inside][np.argmax(self.rms_m[inside])])

    def jump_hz(self, low_hz: float, high_hz: float, ratio: float = 1.4) -> float | None:
        """Mesh frequency of the greatest jump of rms, over the part it happens in; None where none exceeds `ratio`."""
        inside = np.flatnonzero((self.mesh_hz >= low_hz) & (self.mesh_hz <= high_hz))
        level = np.log(self.rms_m[inside])
        change = np.abs(level[2:] - level[:-2])
        place = int(np.argmax(change))
        return float(self.mesh_hz[inside[place + 1]]) if change[place] >= np.log(ratio) else None


def speed_sweep(
    pair: FlexiblePair,
    torque_nm: float,
    first_rpm: float,
    last_rpm: float,
    duration_s: float,
    *,
    n_parts: int = 200,
    step_s: float = STEP_S,
    method: Method = "exponential",
    on_progress: Callable[[float], None] | None = None,
) -> SpeedSweep:
    """Run a pair through a range of speeds at constant torque.

    Parameters
    ----------
    pair : FlexiblePair
    torque_nm : float
        On the driver. The drive also gives what the rotors need to speed up.
    first_rpm, last_rpm : float
        Of the driver; up or down.
    duration_s : float
        Jumps move with the rate of a quick sweep: 100 to 400 rpm/s is slow for a pair of a few kHz.
    n_parts : int
    step_s : float
    method : str
    on_progress : callable or None
    """
    positive(duration_s, "duration_s", "s")
    operation = Operation(Course.of([0.0, duration_s], [first_rpm, last_rpm]), Course.constant(torque_nm))
    run = respond(
        pair,
        operation,
        duration_s=duration_s,
        signals=(TRANSMISSION_ERROR, "mesh_force_n"),
        step_s=step_s,
        stride=STRIDE,
        method=method,
        ready=constants(pair, operation),
        on_progress=on_progress,
    )
    n = len(run[TRANSMISSION_ERROR]) // count(n_parts, "n_parts")
    error, force = (run[name][: n * n_parts].reshape(n_parts, n) for name in (TRANSMISSION_ERROR, "mesh_force_n"))
    speed = np.asarray(operation.speed_rpm.at((np.arange(n_parts) + 0.5) * n * run.interval_s))
    return SpeedSweep(
        speed,
        speed / 60.0 * pair.machine.mesh.pair.driver.teeth,
        error.std(axis=1),
        force.min(axis=1),
        (force <= 0.0).mean(axis=1),
        round(duration_s / step_s),
        step_s,
    )
