"""The picture of a crack: the gear's average over a revolution, beside that of the reference, and its change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis
from gearsig.orders.types import SynchronousAverage
from gearsig.plot.embed import Picture, embed
from gearsig.severity.types import CrackEstimate

MPS2 = {"m/s^2": 1.0, "m/s²": 1.0, "g": 9.80665}
N_TURNS = 3
"""The average is drawn so many times on end: the middle blow then has room on either side."""

ENGAGEMENT_PITCHES = 0.5
"""From the entry of a tooth to the middle of its own pitch."""


@dataclass(frozen=True)
class _Pair:
    """The average now and that of the reference on the same angles, in m/s²."""

    channel: str
    now: FloatArray
    then: FloatArray | None

    @property
    def change(self) -> float:
        """Rms of the change against that of the average."""
        size = float(np.std(self.now))
        return 0.0 if self.then is None or size == 0 else float(np.std(self.now - self.then)) / size


def crack_picture(analysis: Analysis) -> Picture | None:
    """Return the picture of a crack that was seen; None without one, or where no channel is an acceleration."""
    crack = analysis.crack
    if not isinstance(crack, CrackEstimate) or analysis.rig is None:
        return None
    pair = next((p for p in analysis.rig.pairs if crack.gear == f"{p.name}/{crack.shaft}"), None)
    teeth = pair.teeth(crack.shaft) if pair is not None else None
    found = _pairs(analysis, crack)
    if teeth is None or not found:
        return None
    return _drawn(max(found, key=lambda p: p.change), crack, teeth)


def _drawn(shown: _Pair, crack: CrackEstimate, teeth: int) -> Picture:
    from gearsig.plot.crack import crack_comparison_figure

    entry = (crack.angle_deg / 360.0 - ENGAGEMENT_PITCHES / teeth) % 1.0
    cases = {"reference": shown.then, "now": shown.now} if shown.then is not None else {"now": shown.now}
    figure = crack_comparison_figure(
        np.arange(N_TURNS * len(shown.now)) / len(shown.now),
        {name: np.tile(values, N_TURNS) for name, values in cases.items()},
        impacts_rev=[turn + entry for turn in range(N_TURNS)],
        n_teeth=teeth,
        change_mps2={"now": np.tile(shown.now - shown.then, N_TURNS)} if shown.then is not None else None,
        title=f"Average over a revolution of {crack.shaft}, {N_TURNS} times on end, {shown.channel}",
    )
    beside = " beside the reference" if shown.then is not None else ""
    caption = (
        "A crack changes the few mesh cycles after its tooth enters, and nothing else; a change all round is another "
        "load, speed or sensor."
        if shown.then is not None
        else "A crack swings the few mesh cycles after its tooth enters out of the pattern of the others."
    )
    return embed(figure, caption, f"Average of {shown.channel} over {crack.shaft}{beside}; marked: {crack.text}")


def _pairs(analysis: Analysis, crack: CrackEstimate) -> list[_Pair]:
    then = {} if analysis.reference is None else {c.channel: c for c in analysis.reference.channels}
    key = crack.shaft, "average"
    found = []
    for channel in analysis.channels:
        own = channel.averages.get(key)
        if own is None or own.unit not in MPS2:
            continue
        other = then[channel.channel].averages.get(key) if channel.channel in then else None
        found.append(_Pair(channel.channel, own.values * MPS2[own.unit], _turned(own, other, crack)))
    return found


def _turned(own: SynchronousAverage, other: SynchronousAverage | None, crack: CrackEstimate) -> FloatArray | None:
    """Return the reference's average on the other's angles; without a mark turned to where the two agree best."""
    if other is None or other.unit != own.unit:
        return None
    n = len(own.values)
    lines = np.fft.rfft(other.values)[: n // 2 + 1] * (n / len(other.values))
    values = np.fft.irfft(np.pad(lines, (0, n // 2 + 1 - len(lines))), n)
    if crack.tooth is None:
        agreement = np.fft.irfft(np.fft.rfft(own.values) * np.conj(np.fft.rfft(values)), n)
        values = np.roll(values, int(np.argmax(agreement)))
    return np.asarray(values) * MPS2[own.unit]
