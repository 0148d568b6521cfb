"""The stretch of one channel that a method works on, limited so that the answer comes at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from hashlib import blake2b

import numpy as np
import streamlit as st

from app.dashboard.widgets.range_slider import choose_range
from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording

N_FEWEST = 16


@dataclass(frozen=True)
class Stretch:
    """Part of one channel, on a time axis of its own.

    Parameters
    ----------
    recording : Recording
        That channel alone; its first sample lies at `start_s` of the whole recording.
    channel : str
    start_s : float
    angle : ShaftAngle or None
        Of the reference shaft, on the stretch's own time axis; None where the speed is not known there.
    key : str
        Stands for all of the above in caches.
    """

    recording: Recording
    channel: str
    start_s: float
    angle: ShaftAngle | None
    key: str

    @property
    def end_s(self) -> float:
        """End in the time of the whole recording."""
        return self.start_s + self.recording.duration_s

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return self.recording.channels[0].unit


def choose_stretch(
    analysis: Analysis, channel: ChannelAnalysis, name: str, *, n_first: int, n_most: int = 1_000_000
) -> Stretch:
    """Let the user choose what is analysed, and say what it is.

    Parameters
    ----------
    analysis : Analysis
    channel : ChannelAnalysis
    name : str
        Of the method, for the key.
    n_first : int
        Samples from the start that are chosen at first.
    n_most : int
        Samples that can be analysed in a few seconds: a longer choice is cut, which is said.
    """
    recording = analysis.recording
    rate = recording.sampling_rate_hz
    shown = (0.0, min(recording.duration_s, n_first / rate))
    low, high = choose_range("Stretch analysed (s)", analysis, recording.duration_s, shown=shown, name=name)
    start = min(round(low * rate), max(0, recording.n_samples - N_FEWEST))
    stop = min(max(round(high * rate), start + N_FEWEST), recording.n_samples)
    cut = stop - start > n_most
    found = stretch_of(analysis, channel.channel, start, min(stop, start + n_most))
    n = found.recording.n_samples
    said = f"Analysed: {found.start_s:.4g} to {found.end_s:.4g} s of {recording.duration_s:.4g} s, {n} samples"
    st.caption(said + ("; a longer one would take too long." if cut else "."))
    return found


def stretch_of(analysis: Analysis, channel: str, start: int, stop: int) -> Stretch:
    """Return the samples `start` to `stop` of a channel with the shaft angle of that time."""
    recording = analysis.recording
    row = recording.index(channel)
    part = replace(
        recording,
        samples=recording.samples[row : row + 1, start:stop],
        channels=(recording.channels[row],),
        speed=None,
        truth=None,
    )
    start_s = start / recording.sampling_rate_hz
    angle = _angle_of(analysis, start_s, stop / recording.sampling_rate_hz)
    return Stretch(part, channel, start_s, angle, _key(part, start_s, angle))


def _angle_of(analysis: Analysis, start_s: float, end_s: float) -> ShaftAngle | None:
    angle = analysis.shaft_angle
    if not isinstance(angle, ShaftAngle):
        return None
    try:
        inside = angle.between(start_s, end_s)
    except RefusalError:
        return None
    return replace(inside, time_s=inside.time_s - start_s)


def _key(part: Recording, start_s: float, angle: ShaftAngle | None) -> str:
    """Hash whatever an answer may rest on: rig, speed and rate may change while the file stays the same."""
    digest = blake2b(np.ascontiguousarray(part.samples).data, digest_size=16)
    digest.update(repr((part.sampling_rate_hz, part.channels, start_s, part.samples.dtype.str)).encode())
    if angle is not None:
        digest.update(angle.shaft.encode())
        for values in (angle.time_s, angle.revolutions, angle.speed_rev_per_s):
            digest.update(np.ascontiguousarray(values).data)
    return digest.hexdigest()
