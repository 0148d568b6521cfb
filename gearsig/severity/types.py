"""What an estimate of crack severity says: a depth with its interval, or how deep a crack may be without showing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gearsig.errors import InputError
from gearsig.severity.kind import CRACKED

COVERAGE = 0.90
"""Part of the cases in which the interval is meant to hold the true depth."""

CRACKED_FROM, OTHER_UP_TO = 0.7, 0.1
"""Probabilities of a crack from which it is called cracked, and up to which chipped or spalled; between, it is left
open. Very even gears, as in the demonstrations, let deep cracks look like chips: the second needs more evidence."""


@dataclass(frozen=True)
class CrackEstimate:
    """A damaged tooth was seen; whether it is cracked, and how deep the crack is, if it is one.

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
    kind_probabilities : mapping
        "cracked", "chipped", "spalled" → probability, if cracks are as frequent as chips and spalls together.
    reach_cycles : float
        For how many mesh cycles after its middle the event has four times a middling other tooth's energy. It hangs on
        damping and resonances as much as on the depth; the estimate does not rest on it.
    squeezed_rise_db : float
        Synchrosqueezed energy at high orders near the tooth over that of a middling sound tooth; see
        `gearsig.severity.squeezed`. The estimate does not rest on it.
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
    kind_probabilities: Mapping[str, float] = field(default_factory=dict)
    reach_cycles: float = 0.0
    squeezed_rise_db: float = 0.0

    def __post_init__(self) -> None:
        low, high = self.interval_mm
        if not 0.0 <= low <= self.depth_mm <= high:
            raise InputError(f"the interval {low:g} to {high:g} mm does not hold the depth {self.depth_mm:g} mm")

    @property
    def kind(self) -> str:
        """What the event looks like: "cracked", "chipped or spalled", or "undecided"."""
        cracked = self.kind_probabilities.get(CRACKED, 1.0)
        if cracked >= CRACKED_FROM:
            return CRACKED
        return "chipped or spalled" if cracked <= OTHER_UP_TO else "undecided"

    @property
    def likelier_other(self) -> bool:
        """Whether it is likelier chipped or spalled than cracked."""
        return self.kind_probabilities.get(CRACKED, 1.0) < 0.5

    @property
    def text(self) -> str:
        """The statement in one sentence, or two."""
        where = f"tooth {self.tooth}" if self.tooth is not None else f"{self.angle_deg:.0f}°"
        doubt = "" if self.gear_is_certain else " (or its mate)"
        size = f"{self.depth_mm:.1f} mm ({self.interval_mm[0]:.1f} to {self.interval_mm[1]:.1f} mm)"
        place = f"{where} of {self.gear}{doubt}"
        other = 100.0 * (1.0 - self.kind_probabilities.get(CRACKED, 1.0))
        if self.kind == "chipped or spalled":
            return (
                f"Damage at {place}, chipped or spalled rather than cracked ({other:.0f} %); a crack would be {size}."
            )
        if self.likelier_other:
            return f"Damage at {place}: chipped or spalled ({other:.0f} %), or a crack of {size}."
        text = f"Crack of {size}, {self.depth_percent:.0f} % of the root, at {place}."
        return text if self.kind == CRACKED else f"{text} Or it is chipped or spalled ({other:.0f} %)."


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
