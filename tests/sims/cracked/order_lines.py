"""Runs of the 55/75 pair over whole hunting periods, and the lines that a signal has over the driver's angle."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np

from gearsig.checks import FloatArray
from sims.cracked import respond
from sims.effects import EffectSetting, with_effects
from sims.machine import Machine, Operation
from tests.sims.machines import TEETH, spur_pair_machine

OUTPUT_ORDER = TEETH[0] / TEETH[1]
"""Revolutions of the output shaft per revolution of the input shaft."""
HUNTING = 15
"""Revolutions of the driver after which the same teeth meet again: 15 · 55 = 11 · 75."""
POINTS_PER_MESH = 64
SIGNALS = (
    "driver angle",
    "driver angle velocity",
    "transmission_error_m",
    "mesh_force_n",
    "driver x",
    *(f"bearing {b} {axis} acceleration" for b in (1, 3) for axis in "xy"),
)


@dataclass(frozen=True)
class Run:
    """Signals at the integrator's steps over whole hunting periods; tooth 0 of both gears enters at their start.

    Parameters
    ----------
    revolutions : array
        Of the driver, since that start.
    signals : mapping
    """

    revolutions: FloatArray
    signals: dict[str, FloatArray]

    def line(self, signal: str, order: float) -> float:
        """Amplitude at any order of the driver, by a Hann window over the angle.

        Taken from the integrator's own steps: coarser ones would fold mesh harmonics onto low orders. Over n hunting
        periods, lines 2/(15 n) of an order away do not count.
        """
        x, u = self.signals[signal], self.revolutions
        # Even in time: weights by angle would turn the mesh's own wiggle of the speed into lines at low orders.
        weight = 1.0 - np.cos(2 * np.pi * u / np.round(u[-1]))
        weight /= weight.sum()
        return float(2 * abs(np.sum((x - np.sum(x * weight)) * weight * np.exp(-2j * np.pi * order * u))))

    def lines(self, signal: str, orders: Iterable[float]) -> FloatArray:
        """Amplitudes at several orders."""
        return np.array([self.line(signal, order) for order in orders])

    def residual_over_teeth(self, signal: str, teeth: int) -> FloatArray:
        """Synchronous average of a gear with `teeth`, less what all teeth share: (teeth, POINTS_PER_MESH).

        Row k holds the mesh cycle that begins when tooth k enters. For smooth signals.
        """
        n = round(self.revolutions[-1]) * TEETH[0]
        mesh_cycles = np.arange(n * POINTS_PER_MESH) / POINTS_PER_MESH
        x = np.interp(mesh_cycles / TEETH[0], self.revolutions, self.signals[signal])
        over_teeth = x.reshape(-1, teeth, POINTS_PER_MESH).mean(axis=0)
        residual: FloatArray = over_teeth - over_teeth.mean(axis=0)
        return residual


def run(
    *settings: EffectSetting, speed_rpm: float = 1000.0, torque_nm: float = 110.0, n_hunting: int = 1, seed: int = 0
) -> Run:
    """Run the machine with effects; the start has died out."""
    machine = with_effects(spur_pair_machine(), settings, np.random.default_rng(seed))
    return run_machine(machine, speed_rpm, torque_nm, n_hunting)


def run_machine(machine: Machine, speed_rpm: float, torque_nm: float, n_hunting: int = 1) -> Run:
    """Run a machine from a whole hunting period on."""
    period_s = HUNTING * 60.0 / speed_rpm
    response = respond(
        machine,
        Operation.steady(speed_rpm, torque_nm),
        duration_s=(n_hunting + 1.1) * period_s + 0.05,
        rng=np.random.default_rng(1),
        signals=SIGNALS,
    )
    revolutions = response["driver angle"] / (2 * np.pi) - HUNTING
    inside = (revolutions >= 0.0) & (revolutions < n_hunting * HUNTING)
    assert revolutions[-1] > n_hunting * HUNTING
    return Run(revolutions[inside], {name: response[name][inside] for name in SIGNALS})


@cache
def healthy(speed_rpm: float = 1000.0, torque_nm: float = 110.0, n_hunting: int = 1) -> Run:
    """Run the machine without any effect."""
    return run(speed_rpm=speed_rpm, torque_nm=torque_nm, n_hunting=n_hunting)
