"""What of the torque turns with the driver: amplitudes by order, over the mean torque."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.start_stop.cycles import PHASES, CycledMotion

LOWEST_ORDER, N_ORDERS = 4, 40
"""Below, a start and a stop look like a ripple."""
FEWEST_SAMPLES, FAR = 50, 6.0
TREND_S = 0.25
"""Knots of the trend that is taken off each run."""


def orders_of(cycles: CycledMotion) -> NDArray[np.int64]:
    """Whole orders of the driver that are looked at: not those of the mesh and beside it."""
    z = cycles.motion.path.teeth[0]
    orders = np.arange(LOWEST_ORDER, LOWEST_ORDER + N_ORDERS)
    beside = np.abs((orders + z // 2) % z - z // 2)
    found: NDArray[np.int64] = orders[beside > 1]
    return found


def runs_of(cycles: CycledMotion) -> list[FloatArray]:
    """Return the driver's angle in each run that is long enough."""
    runs = cycles.phase == PHASES.index("run")
    found = [cycles.motion.driver_angle_rad[runs & (cycles.number == c)] for c in range(cycles.n_cycles)]
    return [angle for angle in found if len(angle) >= FEWEST_SAMPLES]


def ripple_part(cycles: CycledMotion, wanted: tuple[int, ...], orders: NDArray[np.int64]) -> FloatArray:
    """Return amplitude over mean torque at each order, (n,); nan without torque.

    A_n = |Σ w (τ − trend) e^{−i n θ1}|/(½ Σ w |τ|) over the runs of the cycles wanted, w a Hann window over each: the
    angle goes on from one cycle to the next, so that a ripple adds up and what a start excites does not.
    """
    m = cycles.motion
    nothing = np.full(len(orders), np.nan)
    if m.torque_nm is None:
        return nothing
    runs = cycles.phase == PHASES.index("run")
    total, level = np.zeros(len(orders), dtype=np.complex128), 0.0
    for c in wanted:
        rows = np.flatnonzero(runs & (cycles.number == c))
        if len(rows) < FEWEST_SAMPLES:
            continue
        torque, window = m.torque_nm[rows], np.hanning(len(rows))
        ripple = torque - _trend(torque, window, m.sampling_rate_hz)
        limit = FAR * 1.4826 * float(np.median(np.abs(ripple)))
        ripple = window * np.clip(ripple, -limit, limit)
        total += np.exp(-1j * orders[:, None] * m.driver_angle_rad[rows]) @ ripple
        level += 0.5 * float(np.sum(window * np.abs(torque)))
    return np.abs(total) / level if level > 0.0 else nothing


def _trend(torque: FloatArray, window: FloatArray, rate_hz: float) -> FloatArray:
    """Return a least-squares polynomial, a degree more for each quarter of a second, 3 to 6."""
    from numpy.polynomial import Legendre

    x = np.linspace(-1.0, 1.0, len(torque))
    degree = int(np.clip(len(torque) / rate_hz / TREND_S, 3, 6))
    found: FloatArray = Legendre.fit(x, torque, degree, w=np.sqrt(window))(x)
    return found
