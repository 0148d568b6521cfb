"""Parameters of a drive from data, with intervals and what cannot be told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gearsig.errors import InputError


@dataclass(frozen=True)
class FittedParameter:
    """One parameter.

    Parameters
    ----------
    name, unit : str
    value : float
    interval : (float, float)
        95 %, from the curvature at the best fit and the residuals' dependence on each other.
    is_told : bool
        Whether the record tells it: the interval's half width is below half of the value.
    why_not : str
        Else, why.
    rig_value : float or None
        What the rig file says.
    most_like : str
        Parameter that could take its place, with the correlation of both estimates.
    """

    name: str
    unit: str
    value: float
    interval: tuple[float, float]
    is_told: bool
    why_not: str = ""
    rig_value: float | None = None
    most_like: str = ""


@dataclass(frozen=True)
class Identification:
    """Parameters of contact and load.

    Parameters
    ----------
    parameters : tuple of FittedParameter
    equations : mapping
        Name of an equation → what was fitted, on how many samples, with what scatter.
    condition : mapping
        Name of an equation → ratio of the largest to the smallest singular value of its scaled Jacobian.
    source : str
    """

    parameters: tuple[FittedParameter, ...]
    equations: Mapping[str, str]
    condition: Mapping[str, float]
    source: str = ""

    def parameter(self, name: str) -> FittedParameter:
        """Return one parameter by its name."""
        for found in self.parameters:
            if found.name == name:
                return found
        raise InputError(f"there is no parameter {name!r}", allowed=", ".join(p.name for p in self.parameters))
