"""A local defect in a rolling bearing: knocks at the ball-pass order, with slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, one_of, positive, within

_ORDER_OF = {"outer": "BPFO", "inner": "BPFI"}


@dataclass(frozen=True)
class BearingFault:
    """A local defect on one race.

    The angle between two knocks is that of the kinematics times 1 + s ε, ε standard normal and independent: the train
    is not periodic but drifts, as slipping rolling elements make it. An inner-race defect turns through the load zone:
    its knocks are weighted with (1 + cos 2πθ)/2 of its shaft's angle θ.

    Parameters
    ----------
    bearing : str
        A bearing of the rig, with known geometry or orders.
    race : str
        "outer" or "inner".
    impulse_mps2 : float
        Envelope of the ring-down at its start.
    resonance_hz, damping_ratio : float
        The mode that rings.
    slip_fraction : float
        s, 0 to 0.2; 0.01 is usual.
    impulse_spread : float
        Standard deviation of the knocks over their mean.

    Notes
    -----
    Source: J. Antoni, R. B. Randall, "A stochastic model for simulation and diagnostics of rolling element bearings
    with localized faults", J. Vib. Acoust. 125 (2003).
    """

    bearing: str
    race: str
    impulse_mps2: float
    resonance_hz: float = 3500.0
    damping_ratio: float = 0.05
    slip_fraction: float = 0.01
    impulse_spread: float = 0.1

    def __post_init__(self) -> None:
        where = f"of the fault in bearing {self.bearing!r}"
        one_of(self.race, f"race {where}", _ORDER_OF)
        positive(self.impulse_mps2, f"impulse_mps2 {where}", "m/s^2")
        positive(self.resonance_hz, f"resonance_hz {where}", "Hz")
        within(self.damping_ratio, f"damping_ratio {where}", 1e-4, 0.9)
        within(self.slip_fraction, f"slip_fraction {where}", 0.0, 0.2)
        within(self.impulse_spread, f"impulse_spread {where}", 0.0, 1.0)

    @property
    def order_name(self) -> str:
        """BPFO or BPFI."""
        return _ORDER_OF[self.race]


def knock_angles(
    order: float, slip_fraction: float, first_rev: float, last_rev: float, rng: np.random.Generator
) -> FloatArray:
    """Shaft angles of the knocks in revolutions: a random first one, then steps of (1 + s ε)/order, never negative."""
    n = int(np.ceil((last_rev - first_rev) * order * 1.2)) + 20
    steps = np.maximum(1 + slip_fraction * rng.standard_normal(n), 0.0) / order
    angles = first_rev + rng.uniform() / order + np.concatenate([[0.0], np.cumsum(steps)])
    inside: FloatArray = angles[angles < last_rev]
    return inside


def load_zone_weight(race: str, shaft_rev: FloatArray) -> FloatArray:
    """1 for a defect that stands in the load zone (outer race), (1 + cos 2πθ)/2 for one that turns through it."""
    if race == "outer":
        return np.ones(np.shape(shaft_rev))
    turning: FloatArray = 0.5 * (1 + np.cos(2 * np.pi * np.asarray(shaft_rev)))
    return turning
