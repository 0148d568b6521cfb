"""A number that says something about the condition, with everything needed to read it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Indicator:
    """One condition indicator.

    Parameters
    ----------
    name : str
        As in the literature: "FM4", "sideband index", …
    value : float
        nan where it is undefined (e.g. the kurtosis of a constant); `note` says why.
    unit : str
        Empty for a dimensionless one.
    channel : str
    computed_on : str
        "raw", "synchronous average", "residual", "difference", "regular", "band-passed mesh", "envelope", …
    shaft, gear, bearing : str
        What it belongs to: a shaft's name, a gear as "pair/shaft", a bearing's name; all empty where it belongs to the
        channel.
    band : str
        Frequency or order band, with unit.
    note : str
    """

    name: str
    value: float
    unit: str = ""
    channel: str = ""
    computed_on: str = "raw"
    shaft: str = ""
    gear: str = ""
    band: str = ""
    note: str = ""
    bearing: str = ""
