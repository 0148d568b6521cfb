"""The mean revolution of the gear with the crack, beside that of the sound gear where both count from a mark."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.errors import RefusalError
from gearsig.plot.crack import crack_comparison_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from gearsig.checks import FloatArray
    from gearsig.recording.types import Recording
    from gearsig.severity.types import CrackEstimate

TO_MPS2 = {"m/s^2": 1.0, "mm/s^2": 1e-3, "g": 9.80665}
HALF_CONTACT = 0.8
"""Pitches from a tooth's entry to the middle of its engagement, at a contact ratio of 1.6."""
N_TURNS = 3
"""The mean revolution is repeated, so that the tooth in the middle has a whole neighbourhood."""
SOUND, NOW = "reference", "recording"


def crack_figure(recording: Recording, reference: Recording | None, found: CrackEstimate, channel: str) -> Figure:
    """Return the figure of an estimate.

    Parameters
    ----------
    recording, reference : Recording
        The reference is shown where the estimate names a tooth: angles then count from a mark in both.
    found : CrackEstimate
    channel : str
        An acceleration.

    Raises
    ------
    RefusalError
        If the channel's unit is no acceleration, or the rig lacks what the average needs.
    """
    mean = mean_residual(recording, found, channel)
    cases, change = {NOW: mean}, {}
    if reference is not None and found.tooth is not None:
        sound = mean_residual(reference, found, channel, n_angles=len(mean))
        cases, change = {SOUND: sound, NOW: mean}, {NOW: mean - sound}
    n_teeth = _teeth(recording, found)
    entry = (found.angle_deg / 360.0 - HALF_CONTACT / n_teeth) % 1.0
    return crack_comparison_figure(
        np.arange(N_TURNS * len(mean)) / len(mean),
        {name: np.tile(values, N_TURNS) for name, values in cases.items()},
        impacts_rev=[turn + entry for turn in range(N_TURNS)],
        n_teeth=n_teeth,
        change_mps2={name: np.tile(values, N_TURNS) for name, values in change.items()} or None,
    )


def mean_residual(
    recording: Recording, found: CrackEstimate, channel: str, *, n_angles: int | None = None
) -> FloatArray:
    """Return one mean revolution of the gear's shaft without mesh harmonics, in m/s²."""
    from gearsig.angle.resample import resample_to_angle
    from gearsig.angle.shaft import find_shaft_angle
    from gearsig.orders.average import synchronous_average
    from gearsig.orders.separate import separate

    scale = TO_MPS2.get(recording.channels[recording.index(channel)].unit)
    rig = recording.rig
    ratio = rig.ratio(found.shaft) if rig is not None else None
    if scale is None or ratio is None:
        raise RefusalError(
            f"there is no figure: the unit of channel {channel!r} is no acceleration",
            remedy="state the unit in the rig's [[sensor]] table",
        )
    angle = find_shaft_angle(recording, rig).between(0.0, recording.duration_s)
    turned = angle if ratio == 1.0 else angle.of_shaft(found.shaft, ratio)
    signal = resample_to_angle(recording, turned, channels=[channel], samples_per_revolution=n_angles)
    parts = separate(synchronous_average(signal, channel), _teeth(recording, found))
    return parts.residual.values * scale


def _teeth(recording: Recording, found: CrackEstimate) -> int:
    name = found.gear.rpartition("/")[0]
    pairs = recording.rig.pairs if recording.rig is not None else ()
    teeth = next((pair.teeth(found.shaft) for pair in pairs if pair.name == name), None)
    if teeth is None:
        raise RefusalError("there is no figure: the teeth of the gear are not known", remedy="complete the rig file")
    return teeth
