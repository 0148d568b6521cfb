"""The calibration that is kept with the product: its models, and the machines they were made from."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from gearsig.errors import InputError, RefusalError
from gearsig.severity.features import FEATURES
from gearsig.severity.kind import KindModel
from gearsig.severity.model import DepthModel
from gearsig.severity.shape import SHAPE

FILE = Path(__file__).with_name("calibration.json")
WITH_REFERENCE, ALONE = "with_reference", "alone"
RELIEF_KNOWN = "_relief_known"
"""Ending of the names of the models that know the tip relief."""


@dataclass(frozen=True)
class Calibration:
    """What `python -m app.calibration.crack_severity` made.

    Parameters
    ----------
    models : mapping
        "with_reference" and "alone", also with the ending "_relief_known" → DepthModel.
    kinds : mapping
        "with_reference" and "alone" → KindModel.
    reach : mapping
        Quantity → (lowest, highest) value among the calibration's machines.
    lag_pitches : float
        By how many pitches the event's middle follows the middle of the tooth's engagement.
    provenance : mapping
        Simulator, version, seeds, numbers of cases.
    """

    models: Mapping[str, DepthModel]
    kinds: Mapping[str, KindModel]
    reach: Mapping[str, tuple[float, float]]
    lag_pitches: float
    provenance: Mapping[str, Any]

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Calibration:
        """Build it from what a JSON file holds.

        Raises
        ------
        InputError
            If it belongs to other features than this version computes.
        """
        if (tuple(values["features"]), tuple(values.get("shape", ()))) != (FEATURES, SHAPE):
            raise InputError(
                "the calibration of crack severity belongs to other features than this version computes",
                where=str(FILE.name),
                remedy="make it again: python -m app.calibration.crack_severity",
            )
        return cls(
            {name: DepthModel.from_mapping(model) for name, model in values["models"].items()},
            {name: KindModel.from_mapping(model) for name, model in values["kinds"].items()},
            {name: (float(low), float(high)) for name, (low, high) in values["reach"].items()},
            float(values["lag_pitches"]),
            values["provenance"],
        )

    def check_reach(self, given: Mapping[str, float]) -> None:
        """Refuse a machine that is unlike the calibration's.

        Raises
        ------
        RefusalError
            With every quantity that is outside.
        """
        outside = [
            f"{name} is {value:.4g}, the calibration has {self.reach[name][0]:.4g} to {self.reach[name][1]:.4g}"
            for name, value in given.items()
            if not self.reach[name][0] * (1 - 1e-9) <= value <= self.reach[name][1] * (1 + 1e-9)
        ]
        if outside:
            raise RefusalError(
                "the calibration does not reach this machine or operating point: " + "; ".join(outside),
                remedy="record at another speed or load, or make a calibration for such machines",
            )


@cache
def load_calibration() -> Calibration:
    """Return the calibration that comes with this version."""
    return Calibration.from_mapping(json.loads(FILE.read_text(encoding="utf-8")))
