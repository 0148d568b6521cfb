"""What an estimate of crack severity says: a depth with its interval, or how deep a crack may be without showing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gearsig.errors import InputError

COVERAGE = 0.90
"""Part of the cases in which the interval is meant to hold the true depth."""


@dataclass(frozen=True)
class CrackEstimate:
    """A crack was seen; how deep it is.

    The statement supposes that what was seen is a crack: another fault of one tooth may look alike.

    Parameters
    ----------
    shaft : str
        Of the gear with the crack.
    gear : str
        "pair/shaft".
    tooth : int or None
        From 1 at the shaft's mark, as they engage; None where there is no mark on this shaft.
    angle_deg : float
        Of the shaft at the middle of the tooth's engagement; counted from the mark, or from an arbitrary start.
    gear_is_certain : bool
        False where both gears show it alike: gears of equal teeth meet the same mate every revolution.
    depth_mm, depth_percent : float
        Length of a straight crack at 45° through the face width, and the part of the root's thickness it takes away.
    interval_mm, interval_percent : tuples of two floats
        Holds the depth in `COVERAGE` of the cases, among machines like the calibration's.
    p_value : float
        Chance of as clear an event on a sound gear pair, among the calibration's sound ones.
    with_reference : bool
        Whether a recording of the sound gears was compared with.
    features : mapping
        Name → value of what the estimate rests on; see `gearsig.severity.features`.
    reasons : tuple of str
        What the reader should know, one sentence each.
    """

    shaft: str
    gear: str
    tooth: int | None
    angle_deg: float
    gear_is_certain: bool
    depth_mm: float
    depth_percent: float
    interval_mm: tuple[float, float]
    interval_percent: tuple[float, float]
    p_value: float
    with_reference: bool
    features: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        low, high = self.interval_mm
        if not 0.0 <= low <= self.depth_mm <= high:
            raise InputError(f"the interval {low:g} to {high:g} mm does not hold the depth {self.depth_mm:g} mm")

    @property
    def text(self) -> str:
        """The statement in one sentence."""
        where = f"tooth {self.tooth}" if self.tooth is not None else f"at {self.angle_deg:.0f}°"
        doubt = "" if self.gear_is_certain else " (or its mate)"
        return (
            f"Crack of {self.depth_mm:.1f} mm ({self.interval_mm[0]:.1f} to {self.interval_mm[1]:.1f} mm), "
            f"{self.depth_percent:.0f} % of the root, {where} of {self.gear}{doubt}."
        )


@dataclass(frozen=True)
class NoCrackSeen:
    """No crack was seen, and how deep one may be that would not have shown.

    Parameters
    ----------
    below_mm, below_percent : float
        A crack that is deeper would have been seen in 95 of 100 cases, on either gear.
    p_value : float
        Of the clearest event there is.
    with_reference : bool
    features : mapping
        Of the clearest event.
    reasons : tuple of str
    """

    below_mm: float
    below_percent: float
    p_value: float
    with_reference: bool
    features: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The statement in one sentence."""
        return f"No crack seen: below {self.below_mm:.1f} mm ({self.below_percent:.0f} % of the root)."
