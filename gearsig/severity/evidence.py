"""From a recording to what it says of each gear of its pair: the most conspicuous tooth and its features."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import GearPair, Rig
from gearsig.severity.event import ToothEvent, find_event, n_bands, without_regular_lines
from gearsig.severity.features import Conditions, feature_vector, mesh_energies
from gearsig.severity.reference import difference_lines
from gearsig.severity.shaft_lines import ShaftLines, shaft_lines
from gearsig.severity.shape import event_shape

LEAST_HARMONICS = 4
"""Mesh harmonics below the highest order: with fewer, one resonance decides."""

SMALLEST_DIFFERENCE = 1e-9
"""Of the largest line: two measurements never agree so well."""


@dataclass(frozen=True)
class GearEvidence:
    """What stands out on one gear.

    Parameters
    ----------
    shaft : ShaftLines
    event : ToothEvent
    features : array
        See `gearsig.severity.features.FEATURES`.
    searched : ShaftLines
        What the event was found in: the average, or its difference from the sound gear's.
    sound : ShaftLines
        The sound gear's average, or the average itself where there is no reference.
    shape : array
        See `gearsig.severity.shape.SHAPE`.
    agreement : float or None
        Of the teeth's pattern with the reference's; None without one.
    """

    shaft: ShaftLines
    event: ToothEvent
    features: FloatArray
    searched: ShaftLines
    sound: ShaftLines
    shape: FloatArray
    agreement: float | None = None


def pair_lines(recording: Recording, rig: Rig, pair: GearPair, channels: Sequence[str]) -> tuple[ShaftLines, ...]:
    """Return the lines of both shafts, the driver's first."""
    from gearsig.angle.shaft import find_shaft_angle

    angle = find_shaft_angle(recording, rig).between(0.0, recording.duration_s)
    return tuple(shaft_lines(recording, rig, pair, shaft, angle, channels) for shaft in (pair.driver, pair.driven))


def gear_evidence(
    now: Sequence[ShaftLines],
    sound: Sequence[ShaftLines] | None,
    module_mm: float,
    load_mpa: float,
    tip_relief_um: float | None = None,
) -> tuple[GearEvidence, ...]:
    """Return the most conspicuous tooth of either gear, in what differs from the sound gear where there is one.

    Mesh energies that the event is compared with are the geometric mean of both recordings'.
    """
    return tuple(
        _one_gear(now, sound, i, Conditions(module_mm, load_mpa, shaft.order_hz * shaft.teeth, tip_relief_um))
        for i, shaft in enumerate(now)
    )


def _one_gear(
    now: Sequence[ShaftLines], sound: Sequence[ShaftLines] | None, i: int, conditions: Conditions
) -> GearEvidence:
    shaft = now[i]
    _check_harmonics(shaft)
    if sound is None:
        event = find_event(shaft)
        mesh = mesh_energies(shaft, n_bands(shaft))
        shape = event_shape(shaft, event)
        return GearEvidence(shaft, event, feature_vector(shaft, shaft, mesh, event, conditions), shaft, shaft, shape)
    marked = any(a.has_mark and b.has_mark for a, b in zip(now, sound, strict=True))
    _check_harmonics(sound[i], "the reference's")
    difference, agreement = difference_lines(shaft, sound[i], whole_teeth=marked)
    _check_differs(difference, shaft)
    n = n_bands(difference)
    mesh = np.sqrt(mesh_energies(shaft, n) * mesh_energies(sound[i], n))
    event = find_event(difference)
    features = feature_vector(difference, sound[i], mesh, event, conditions)
    shape = event_shape(difference, event)
    return GearEvidence(shaft, event, features, difference, sound[i], shape, agreement)


def _check_differs(difference: ShaftLines, shaft: ShaftLines) -> None:
    largest = np.max(np.abs(shaft.lines), axis=1)
    if not np.all(np.max(np.abs(without_regular_lines(difference)), axis=1) > SMALLEST_DIFFERENCE * largest):
        raise RefusalError(
            "the reference holds the same samples as the recording",
            remedy="give a recording that was taken before the crack",
        )


def _check_harmonics(shaft: ShaftLines, whose: str = "the recording's") -> None:
    if n_bands(shaft) < LEAST_HARMONICS:
        raise RefusalError(
            f"{n_bands(shaft)} mesh harmonics of the {shaft.teeth} teeth lie in {whose} band, "
            f"{LEAST_HARMONICS} are needed",
            remedy="a higher sampling rate or a lower speed",
        )
    if not np.all(mesh_energies(shaft, LEAST_HARMONICS) > 0):
        raise RefusalError("a channel holds no mesh vibration at all", remedy="leave the dead channel out")
