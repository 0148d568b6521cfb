"""The parameters of an analysis, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.checks import count, positive, within


@dataclass(frozen=True)
class AnalysisSettings:
    """What `analyze` may be told.

    Parameters
    ----------
    false_alarm_probability : float
        Of one test over everything it tries (all teeth, all fundamentals, all bands and channels).
    n_surrogates : int
        For the test of tooth-local energy.
    minimum_revolutions : int
        Fewer revolutions than this are not averaged: 16 lower the noise by 12 dB, and give the jackknife its scatter.
    bearing_slip : float
        Relative: bearings turn 1 to 2 % off their kinematic orders.
    highest_modulation_order : float
        Of the envelope spectra, in cycles per revolution of the fastest shaft: six harmonics of an inner race with
        ten rolling elements.
    seed : int
        Of the surrogates: the same recording gives the same answer.
    """

    false_alarm_probability: float = 1e-3
    n_surrogates: int = 1000
    minimum_revolutions: int = 16
    bearing_slip: float = 0.02
    highest_modulation_order: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        within(self.false_alarm_probability, "false_alarm_probability", 1e-12, 0.1)
        count(self.n_surrogates, "n_surrogates", minimum=99)
        count(self.minimum_revolutions, "minimum_revolutions", minimum=2)
        within(self.bearing_slip, "bearing_slip", 0.0, 0.1)
        positive(self.highest_modulation_order, "highest_modulation_order")
