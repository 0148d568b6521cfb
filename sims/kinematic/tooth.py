"""A damaged tooth: a knock at each engagement and a local change of the mesh vibration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, not_negative, positive, within


@dataclass(frozen=True)
class ToothDamage:
    """One damaged tooth on one gear.

    Severity is in plain numbers: the first amplitude of the ring-down, and how far the mesh vibration dips and lags
    while the tooth is engaged. A crack mostly dips and lags (lower stiffness); a chip or a spall mostly knocks.

    Parameters
    ----------
    pair, shaft : str
        The gear.
    angle_rev : float
        Shaft angle at which the middle of the damaged tooth is engaged, 0 to 1. Teeth count from 1 at angle 0: this is
        tooth floor(angle_rev Z) + 1.
    impulse_mps2 : float
        Envelope of the ring-down at its start, before the transfer path.
    resonance_hz, damping_ratio : float
        The mode that rings.
    impulse_spread : float
        Standard deviation of the knocks over their mean; negative draws are set to 0.
    mesh_dip_fraction : float
        Part of the mesh amplitude that is missing at the middle of the engagement, 0 to 1.
    mesh_lag_rad : float
        Delay of the first mesh harmonic there.
    width_teeth : float
        Full width of the dip in tooth pitches; raised cosine.
    """

    pair: str
    shaft: str
    angle_rev: float
    impulse_mps2: float = 0.0
    resonance_hz: float = 3000.0
    damping_ratio: float = 0.05
    impulse_spread: float = 0.1
    mesh_dip_fraction: float = 0.0
    mesh_lag_rad: float = 0.0
    width_teeth: float = 2.0

    def __post_init__(self) -> None:
        gear = f"of the damaged tooth on {self.shaft!r}"
        within(self.angle_rev, f"angle_rev {gear}", 0.0, 1.0, "rev")
        not_negative(self.impulse_mps2, f"impulse_mps2 {gear}", "m/s^2")
        positive(self.resonance_hz, f"resonance_hz {gear}", "Hz")
        within(self.damping_ratio, f"damping_ratio {gear}", 1e-4, 0.9)
        not_negative(self.impulse_spread, f"impulse_spread {gear}")
        within(self.mesh_dip_fraction, f"mesh_dip_fraction {gear}", 0.0, 1.0)
        positive(self.width_teeth, f"width_teeth {gear}", "tooth pitches")


def engagement_window(shaft_rev: FloatArray, angle_rev: float, width_rev: float) -> FloatArray:
    """Raised cosine of full width `width_rev` about `angle_rev`, once per revolution: 1 in the middle, 0 outside."""
    distance = (np.asarray(shaft_rev) - angle_rev + 0.5) % 1.0 - 0.5
    window: FloatArray = np.where(np.abs(distance) < width_rev / 2, np.cos(np.pi * distance / width_rev) ** 2, 0.0)
    return window


def passages(angle_rev: float, first_rev: float, last_rev: float) -> FloatArray:
    """Angles k + angle_rev of the shaft between `first_rev` and `last_rev`."""
    return np.arange(np.ceil(first_rev - angle_rev), np.floor(last_rev - angle_rev) + 1) + angle_rev


def knocks(n: int, mean: float, spread: float, rng: np.random.Generator) -> FloatArray:
    """Strengths of `n` knocks: Gaussian about `mean`, not below 0."""
    strengths: FloatArray = np.maximum(mean * (1 + spread * rng.standard_normal(n)), 0.0)
    return strengths
