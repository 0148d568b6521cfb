"""Settled runs of the cracked pair, and their signals over the mesh's angle."""

import numpy as np
from numpy.typing import NDArray

from sims.cracked import Response, respond
from sims.machine import Machine, Operation


def run(
    machine: Machine, signals: tuple[str, ...], duration_s: float = 0.6, settle_s: float = 0.4, **more: float
) -> Response:
    """Return a settled run: the first `settle_s` lie before time 0 and are cut off."""
    operation = Operation.steady(more.get("speed_rpm", 500.0), more.get("torque_nm", 110.0))
    response = respond(
        machine,
        operation,
        duration_s=duration_s + settle_s,
        rng=np.random.default_rng(int(more.get("seed", 1))),
        signals=signals,
        start_s=-settle_s,
    )
    keep = response.time_s >= 0.0
    cut = {name: values[keep] for name, values in response.signals.items()}
    return Response(0.0, response.interval_s, cut, response.step_s, response.energy_j)


def by_angle(response: Response, name: str, per_cycle: int = 100) -> NDArray[np.float64]:
    """Return a signal at even mesh cycles from the first whole driver revolution on."""
    cycles = 55 * response["driver angle"] / (2 * np.pi)
    first = 55 * np.ceil(cycles[0] / 55)
    grid = np.arange(first, cycles[-1], 1 / per_cycle)
    return np.interp(grid, cycles, response[name])
