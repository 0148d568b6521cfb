"""At which angle and tooth a shaft's average changed: energy tooth by tooth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap.change import difference_residuals, lines_of_shaft, turned_difference
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import SIDES, average_lines, is_synchronous, visible_orders
from gearsig.gap.spots import Comparison, Spot, by_decibels, shaft_words
from gearsig.gap.tooth import mesh_power, residual_lines, tooth_energy
from gearsig.severity.calibration import load_calibration
from gearsig.severity.event import find_event
from gearsig.severity.shaft_lines import ShaftLines

STANDS_OUT = 6.0
"""Energy within one pitch over the middling pitch's from which on one tooth is named: of teeth that all
differ by chance, the largest has some 5."""

ALL_ROUND = (".level", ".elsewhere", ".peak")
"""Ends of the names of features that say how large a pattern is, and not what shape it has."""

OWN_SHARE = 0.3
"""Of a pattern's power in the shaft's own lines, below which it is no pattern of teeth."""


@dataclass(frozen=True)
class ToothPattern:
    """Energy over a shaft's angle, of what tells its teeth apart.

    Parameters
    ----------
    energy : array, (n_channels, n)
        Mean square within one pitch over the mesh harmonics' power.
    lines : ShaftLines
        What it was made of.
    own_share : float
        Of its power, in lines that keep their phase from block to block.
    """

    energy: FloatArray
    lines: ShaftLines
    own_share: float

    @property
    def prominence(self) -> float:
        """Largest energy over the median, of all channels together."""
        mean = self.energy.mean(axis=0)
        return float(mean.max() / max(float(np.median(mean)), 1e-300))

    @property
    def place_rev(self) -> float:
        """Where the tooth engages that stands out, 0 to 1: the answer follows a little later."""
        centre = find_event(self.lines).centre_rev
        return (centre - load_calibration().lag_pitches / self.lines.teeth) % 1.0


def own_pattern(gathered: Gathered, side: int) -> ToothPattern:
    """Return the pattern of a recording by itself."""
    teeth = gathered.frame.teeth[side]
    residuals = []
    for sums in gathered.channels.values():
        lines = average_lines(sums, side)[0]
        residual = residual_lines(
            lines, teeth, visible_orders(gathered, side, len(lines)), gathered.frame.teeth[1 - side]
        )
        residuals.append(residual / np.sqrt(mesh_power(gathered, sums, side)))
    return _pattern(gathered, side, residuals, lines_of_shaft(gathered, side))


def changed_pattern(now: Gathered, sound: Gathered, side: int) -> ToothPattern:
    """Return the pattern of the difference from a sound recording, turned so that the same teeth meet."""
    turned, _ = turned_difference(now, sound, side)
    return _pattern(now, side, difference_residuals(now, turned, side), turned)


def _pattern(
    gathered: Gathered, side: int, residuals: Sequence[NDArray[np.complex128]], lines: ShaftLines
) -> ToothPattern:
    powers = [np.abs(residual) ** 2 for residual in residuals]
    held = [is_synchronous(sums, side) for sums in gathered.channels.values()]
    own = sum(float(power[own].sum()) for power, own in zip(powers, held, strict=True))
    whole = sum(float(power.sum()) for power in powers)
    energy = np.stack([tooth_energy(residual, lines.teeth) for residual in residuals])
    return ToothPattern(energy, lines, own / max(whole, 1e-300))


def tooth_spot(comparison: Comparison, side: int) -> Spot | None:
    """Return the angle and tooth that stands out, or that the teeth's pattern changed all round.

    None where most of the pattern is noise, or leaks into the average.
    """
    frame, now = comparison.now.frame, comparison.now
    pattern = changed_pattern(now, comparison.other, side) if comparison.is_reference else own_pattern(now, side)
    shaft, name = shaft_words(frame, side), list(now.channels)[int(np.argmax(pattern.energy.max(axis=1)))]
    if pattern.own_share < OWN_SHARE:
        return None
    if pattern.prominence < STANDS_OUT:
        return _all_round(comparison, side, shaft, name)
    place, teeth = pattern.place_rev, frame.teeth[side]
    above, angle = 10.0 * float(np.log10(pattern.prominence)), 360.0 * place
    tooth = int(place * teeth) % teeth + 1 if now.marks[side] else None
    at = f"tooth {tooth} ({angle:.0f}°)" if tooth else f"one tooth (at {angle:.0f}°; no mark)"
    title = f"burst once per revolution at {at} of {shaft}, {above:.2g} dB above the other teeth"
    return Spot(title, above, angle_deg=angle, tooth=tooth, channel=name)


def _all_round(comparison: Comparison, side: int, shaft: str, channel: str) -> Spot:
    """Return that no tooth in particular stands out, with the figure of the feature that was scored."""
    scored = comparison.strongest(*(f"{kind}.{SIDES[side]}." for kind in ("tooth", "change", "surprise")))
    level = f"tooth.{SIDES[side]}.level"
    if not scored.endswith(ALL_ROUND) and abs(comparison.size[level]) > 1.0:
        scored = level
    change = comparison.change_db[scored]
    if not scored.endswith(ALL_ROUND):
        title = f"shape of the teeth's pattern of {shaft}, no tooth in particular"
        return Spot(title, change, channel=channel, follows=True)
    of_difference = not scored.startswith("tooth.")
    by = f"{by_decibels(change)} against what sound machines change by" if of_difference else by_decibels(change)
    what = "what has changed of the pattern of the teeth" if of_difference else "pattern of the teeth"
    return Spot(f"{what} of {shaft} all round, {by}", change, channel=channel)
