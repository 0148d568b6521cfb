"""Where exactly within one place: the comparison that is searched, and what is found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gearsig.gap.frame import GearFrame
from gearsig.gap.gathered import Gathered
from gearsig.gap.types import PlaceKind


@dataclass(frozen=True)
class Comparison:
    """A recording and what it is compared with.

    Parameters
    ----------
    now, other : Gathered
    is_reference : bool
        Whether `other` is a sound recording of the same machine; otherwise a simulation.
    change_db : mapping
        Feature → change from what healthy machines change by.
    size : mapping
        Feature → the same over the floors, with its sign.
    """

    now: Gathered
    other: Gathered
    is_reference: bool
    change_db: Mapping[str, float]
    size: Mapping[str, float]

    def strongest(self, *beginnings: str) -> str:
        """Return the feature with the largest change over the floors among those whose names begin so."""
        return max((name for name in self.size if name.startswith(beginnings)), key=lambda name: abs(self.size[name]))


@dataclass(frozen=True)
class Spot:
    """What `GapPlace` says of where; its sizes are added later.

    `kind` is given where the place turns out to be of another kind than the features that led to it; `follows` where
    it only follows from what other places say.
    """

    title: str
    change_db: float
    orders: tuple[float, ...] = ()
    band_hz: tuple[float, float] | None = None
    angle_deg: float | None = None
    tooth: int | None = None
    channel: str = ""
    kind: PlaceKind | None = None
    follows: bool = False


def shaft_words(frame: GearFrame, side: int) -> str:
    """Return "the input shaft" or "shaft 2"."""
    name = frame.shafts[side]
    if "shaft" in name.lower():
        return name
    return f"the {name} shaft" if name.replace(" ", "").isalpha() else f"shaft {name}"


def by_decibels(change_db: float) -> str:
    """Return "up by 14 dB" or "down by 3 dB"."""
    return f"{'up' if change_db >= 0 else 'down'} by {abs(change_db):.2g} dB"


def hertz(frequency_hz: float) -> str:
    """Return "850 Hz" or "2.1 kHz"."""
    return f"{frequency_hz / 1e3:.2g} kHz" if frequency_hz >= 999.5 else f"{frequency_hz:.3g} Hz"


def band_words(band_hz: tuple[float, float]) -> str:
    """Return "300 Hz to 2.1 kHz"."""
    low, high = (hertz(edge) for edge in band_hz)
    if low[-3:] == high[-3:]:
        low = low.rpartition(" ")[0]
    return f"{low} to {high}"
