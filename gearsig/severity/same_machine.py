"""Whether a recording and its reference belong together: gears, load, speed, gain; and which of both is damaged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.rig.types import Rig
from gearsig.severity.event import ToothEvent, event_windows, n_bands
from gearsig.severity.features import mesh_energies
from gearsig.severity.reference import check_same_speed
from gearsig.severity.shaft_lines import ShaftLines

LARGEST_TORQUE_CHANGE = 0.10
"""Relative, as in the calibration."""

LARGEST_LEVEL_CHANGE_DB = 2.5
"""Of the middling mesh harmonic. On 100 simulated machines it is 1.4 dB at most, with the deepest cracks; another
torque within its limit adds 0.8 dB."""

_REMEDY = "take a reference of the same gears, with the same sensors and gains, at the same speed and load"


def check_same_rig(now: Rig, sound: Rig) -> None:
    """Refuse a reference whose own rig has other teeth or another torque.

    Raises
    ------
    RefusalError
    """
    teeth, others = ([(p.driver_teeth, p.driven_teeth) for p in rig.pairs] for rig in (now, sound))
    if others and teeth != others:
        raise RefusalError(
            f"the reference is of another machine: its teeth are {_teeth_text(others)}, "
            f"the recording's {_teeth_text(teeth)}",
            remedy=_REMEDY,
        )
    torque, other = now.operating_point.torque_nm, sound.operating_point.torque_nm
    same_shaft = now.operating_point.shaft == sound.operating_point.shaft
    if torque and other and same_shaft and abs(abs(torque / other) - 1.0) > LARGEST_TORQUE_CHANGE:
        raise RefusalError(
            f"the reference was taken at {other:g} N m, the recording at {torque:g} N m",
            remedy=f"take it within {100 * LARGEST_TORQUE_CHANGE:.0f} % of the same torque",
        )


def check_same_level(now: Sequence[ShaftLines], sound: Sequence[ShaftLines]) -> None:
    """Refuse a reference at another speed, or whose mesh harmonics are much stronger or weaker.

    Raises
    ------
    RefusalError
    """
    check_same_speed(now[0], sound[0])
    for name, change_db in zip(now[0].channels, mesh_change_db(now[0], sound[0]), strict=True):
        if abs(change_db) > LARGEST_LEVEL_CHANGE_DB:
            side = "above" if change_db > 0 else "below"
            raise RefusalError(
                f"the mesh is {abs(change_db):.1f} dB {side} that of the reference in channel {name!r}: another gain, "
                "unit or load",
                remedy=_REMEDY,
            )


def mesh_change_db(now: ShaftLines, sound: ShaftLines) -> FloatArray:
    """Return for each channel by how much the middling mesh harmonic has risen since the reference, in dB."""
    n = min(n_bands(now), n_bands(sound))
    energies = (np.maximum(mesh_energies(shaft, n), np.finfo(float).tiny) for shaft in (now, sound))
    ratios: FloatArray = np.median(np.subtract(*(10.0 * np.log10(e) for e in energies)), axis=0)
    return ratios


def share_of_the_recording(now: ShaftLines, difference: ShaftLines, event: ToothEvent) -> tuple[float, float]:
    """Return (E_now − E_reference)/E_difference at the event: about 1 if it is the recording's, −1 the reference's.

    Energies are the mean over bands and channels, each over the difference's background there. Where the teeth differ
    much, the products of their pattern with the event blur it.

    Parameters
    ----------
    now : ShaftLines
    difference : ShaftLines
        What is left of it when the turned reference is taken off.
    event : ToothEvent
        Of the difference.

    Returns
    -------
    share : float
    standard_error : float
        From the scatter over bands and channels.
    """
    recorded = now.lines[:, : difference.highest_order + 1]
    (recording, usual), (reference, usual_then), (left, background) = (
        event_windows(replace(difference, lines=lines), event)
        for lines in (recorded, recorded - difference.lines, difference.lines)
    )
    gain = np.sqrt(usual / usual_then)  # of the other teeth: a deep crack pulls at the gain that was fitted before
    shares = (recording / gain - reference * gain) / background / np.mean(left / background)
    return float(shares.mean()), float(shares.std() / np.sqrt(shares.size))


def _teeth_text(teeth: Sequence[tuple[int | None, int | None]]) -> str:
    return ", ".join("/".join(str(z) if z is not None else "?" for z in pair) for pair in teeth)
