"""What a change to a scene is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from sims.blind.rig import BlindRig
from sims.blind.scene import Scene

Place = Mapping[str, str | int | float]
Span = Callable[[BlindRig], tuple[float, float]]
Apply = Callable[[Scene, float, np.random.Generator], Place]


@dataclass(frozen=True)
class Change:
    """One thing that may be wrong.

    Parameters
    ----------
    name, group, unit : str
        Group "outside" for what the catalogue does not hold.
    span : function
        Of the rig: severities from barely noticeable to strong.
    apply : function
        Changes the scene and says where. All choices come from the generator given, in a fixed order, so that every
        recording of a case has the same fault; what differs from turn to turn comes from the scene's own.
    resembles : str
        For a change outside the catalogue: the effect it is easily taken for, or empty.
    """

    name: str
    group: str
    unit: str
    span: Span
    apply: Apply
    resembles: str = ""

    def severity(self, rig: BlindRig, level: float) -> float:
        """Severity at a level from 0 (weak end of the span) to 1 (strong end), geometric between."""
        low, high = self.span(rig)
        return float(low * (high / low) ** level)


GEARS = ("pinion", "wheel")
"""Names of the gears on the input and the output shaft, whichever is larger."""


def steady(low: float, high: float) -> Span:
    """Give the same span for every rig."""
    return lambda _rig: (low, high)


def deflection_um(rig: BlindRig) -> float:
    """Mesh deflection at rated load."""
    return 1e6 * rig.rated_nm / rig.pair.base_radii_m[0] / rig.mesh_stiffness_n_per_m()
