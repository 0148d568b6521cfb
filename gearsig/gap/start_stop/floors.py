"""How far sound drives lie from what they are compared with: the structural floor of start–stop changes."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.start_stop.told import NAMES

FILE = Path(__file__).with_name("floors.json")
LEAST_DB, LEAST_SIGNED_DB = 0.15, 0.87
"""Of a scale: 2 % of a level; a fifth of the step of what is ordinarily near zero."""
LEVELS = ("play", "deflection", "inertia", "load_friction", "impact", "contact_scatter", "load_scatter")
FLOOR = 1.96
"""Scales of the middle of the distribution: 19 of 20 sound machines stay below."""
TAIL = 4.0
"""Degrees of freedom: a feature lies far off oftener than a normal one."""
SUM_POWER = 4.0
INNER, NORMAL_80 = 0.8, 1.2816
N_BISECTIONS = 40


@dataclass(frozen=True)
class DriveFloor:
    """Middle and scale of each change of sound drives.

    Parameters
    ----------
    centre, scale : array, (n,) by `NAMES`
        dB.
    whole : float
        Size of the whole change that one sound drive in twenty exceeds.
    """

    centre: FloatArray
    scale: FloatArray
    whole: float

    @classmethod
    def of_sound(cls, rows: FloatArray, scatters: FloatArray | None = None) -> DriveFloor:
        """Return the floor of a table of changes of sound drives, (n_drives, n); nan where a change could not be told.

        The scale is the half width of the middle 80 % over 1.28: what lies far off is the tail's, see `log_density`.
        What a recording's own cycles scatter by is taken out of it: coarse encoders are no property of other drives.

        Parameters
        ----------
        rows : array, (n_drives, n)
        scatters : array or None, (n_drives, n)
            Standard errors of the changes; None: none.
        """
        table = np.asarray(rows, dtype=np.float64)
        errors = np.zeros_like(table) if scatters is None else np.nan_to_num(scatters)
        known = np.isfinite(table)
        centre, scale = np.zeros(table.shape[1]), np.full(table.shape[1], 6.0)
        for i in range(table.shape[1]):
            values, own = table[known[:, i], i], errors[known[:, i], i]
            if len(values) >= 5:
                least = LEAST_DB if NAMES[i] in LEVELS else LEAST_SIGNED_DB
                centre[i], scale[i] = _centre(values, own), least
                scale[i] = max(_scale(values - centre[i], own), least)
        sizes = [_soft((r - centre) / (FLOOR * np.hypot(scale, e))) for r, e in zip(table, errors, strict=True)]
        return cls(centre, scale, float(np.quantile(sizes, 0.95)))

    def widened(self, scatter: FloatArray) -> DriveFloor:
        """Return the floor of a recording whose changes have standard errors of their own, (n,)."""
        return replace(self, scale=np.hypot(self.scale, np.nan_to_num(scatter)))

    def size(self, change: FloatArray) -> float:
        """Return the size of a whole change; 1: one sound drive in twenty is that far."""
        return _soft((change - self.centre) / (FLOOR * self.scale)) / self.whole

    def log_density(self, change: FloatArray, predicted: FloatArray, widen: FloatArray | float = 0.0) -> FloatArray:
        """Return the logarithm of Student's density of each change around centre + predicted, (n,); 0 where unknown.

        Parameters
        ----------
        change, predicted : array, (n,)
        widen : array or float
            dB that the scale is widened by: an error of the prediction.
        """
        scale = np.hypot(self.scale, widen)
        z = np.nan_to_num((change - self.centre - predicted) / scale)
        logs: FloatArray = np.where(
            np.isfinite(change), -0.5 * (TAIL + 1.0) * np.log1p(z * z / TAIL) - np.log(scale / self.scale), 0.0
        )
        return logs

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain values by name."""
        return {
            "centre_db": dict(zip(NAMES, (round(float(v), 4) for v in self.centre), strict=True)),
            "scale_db": dict(zip(NAMES, (round(float(v), 4) for v in self.scale), strict=True)),
            "whole": round(self.whole, 4),
        }

    @classmethod
    def from_dict(cls, found: Mapping[str, Any]) -> DriveFloor:
        """Return what `to_dict` made."""
        centre, scale = (np.array([float(found[key][name]) for name in NAMES]) for key in ("centre_db", "scale_db"))
        return cls(centre, scale, float(found["whole"]))


def _centre(values: FloatArray, errors: FloatArray) -> float:
    """Return the median, precise values counting more."""
    order = np.argsort(values)
    spread = 1.4826 * float(np.median(np.abs(values - np.median(values))))
    weights = np.cumsum(1.0 / (spread**2 + errors[order] ** 2 + 1e-6))
    return float(values[order][np.searchsorted(weights, 0.5 * weights[-1])])


def _scale(distances: FloatArray, errors: FloatArray) -> float:
    """Return the s at which four of five distances are below 1.28 √(s² + e²); 0 where the errors alone are enough."""
    low, high = 0.0, float(np.max(np.abs(distances))) + 1e-9
    for _ in range(N_BISECTIONS):
        middle = 0.5 * (low + high)
        inside = np.quantile(np.abs(distances) / np.hypot(middle, errors + 1e-12), INNER)
        low, high = (middle, high) if inside > NORMAL_80 else (low, middle)
    return high


def _soft(normalised: FloatArray) -> float:
    z = np.abs(normalised[np.isfinite(normalised)])
    return float(np.sum(z**SUM_POWER) ** (1.0 / SUM_POWER)) if len(z) else 0.0


@cache
def load_floors() -> Mapping[str, Any]:
    """Return the file that comes with this version."""
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def load_floor(*, with_reference: bool, part: str = "whole") -> DriveFloor:
    """Return the floor of whole recordings, or of the "half" of their cycles."""
    return DriveFloor.from_dict(load_floors()["with_reference" if with_reference else "without_reference"][part])
