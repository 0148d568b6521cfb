"""What a simulator hands to the measurement chain."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint, frozen_array, positive
from gearsig.errors import InputError


@dataclass(frozen=True)
class Motion:
    """Accelerations of places and angles of shafts on an even grid of time that starts at 0.

    Parameters
    ----------
    step_s : float
        Five steps or more per cycle of the fastest mode of path and sensor. What the simulation holds above half of
        1/step would fold back: keep every step of the solver, or one in few.
    positions : tuple of str
        Names of the places, each with its direction: "pinion bearing y".
    accelerations_mps2 : array, (n_steps, n_positions)
    shaft_angles_rad : mapping
        Shaft → (n_steps,), running on through revolutions; above 0 in the shaft's own direction.
    """

    step_s: float
    positions: tuple[str, ...]
    accelerations_mps2: FloatArray
    shaft_angles_rad: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        positive(self.step_s, "step_s of the motion", "s")
        a = frozen_array(self.accelerations_mps2, "accelerations_mps2 (time, position)", ndim=2)
        object.__setattr__(self, "positions", tuple(self.positions))
        if a.shape[1] != len(self.positions) or len(set(self.positions)) != len(self.positions):
            raise InputError(
                f"{len(self.positions)} positions for {a.shape[1]} columns of accelerations_mps2",
                allowed="one name per column, none twice",
            )
        if a.shape[0] < 2:
            raise InputError(f"the motion has {a.shape[0]} steps", allowed="at least 2")
        angles = {name: frozen_array(v, f"angle of {name!r}", ndim=1) for name, v in self.shaft_angles_rad.items()}
        for name, values in angles.items():
            if len(values) != a.shape[0]:
                raise InputError(f"{len(values)} angles of {name!r} for {a.shape[0]} steps", where="motion")
        object.__setattr__(self, "accelerations_mps2", a)
        object.__setattr__(self, "shaft_angles_rad", angles)

    @property
    def n_steps(self) -> int:
        """Points of time."""
        return int(self.accelerations_mps2.shape[0])

    def angle_rad(self, shaft: str, user: str) -> FloatArray:
        """Angle of a shaft that a sensor is fitted to, (n_steps,)."""
        if shaft not in self.shaft_angles_rad:
            raise InputError(
                f"the {user} sits on shaft {shaft!r}, whose angle the simulation does not give",
                allowed=", ".join(self.shaft_angles_rad) or "none",
                remedy=closest_match_hint(shaft, self.shaft_angles_rad),
            )
        return self.shaft_angles_rad[shaft]

    def time_s(self, start_s: float = 0.0) -> FloatArray:
        """Time of each step, counted from `start_s`, (n_steps,)."""
        return np.arange(self.n_steps) * self.step_s - start_s
