"""One record made ready: its shafts' angles, its channels over them, and both halves of whole revolutions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.orders.revolutions import first_whole_sample
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

LEAST_REVOLUTIONS = 8
"""Of a shaft: four in each half. Fewer leave other shafts' orders in its average, and say nothing of scatter."""


@dataclass(frozen=True)
class Side:
    """One record.

    Parameters
    ----------
    recording : Recording
        Of the compared channels only, in the common unit.
    angle : ShaftAngle
        Of the reference shaft.
    signals : mapping
        Shaft (as in the recording's rig) → its signals of the first and of the second half.
    marked : frozenset of str
        Shafts whose angle counts from a mark of their own.
    """

    recording: Recording
    angle: ShaftAngle
    signals: Mapping[str, tuple[AngleSignal, AngleSignal]]
    marked: frozenset[str]


def make_side(
    recording: Recording,
    values: FloatArray,
    channels: Sequence[str],
    rig: Rig,
    names: Mapping[str, str],
    ratios: Mapping[str, float],
    which: str,
) -> Side:
    """Find the speed of a record and sample its channels over each shaft's angle.

    Parameters
    ----------
    recording : Recording
    values : array, (n_channels, n_samples)
        Of `channels`, in the unit of the comparison.
    channels : sequence of str
    rig : Rig
        Of this side.
    names : mapping
        Shaft as the result calls it → as this rig calls it.
    ratios : mapping
        Shaft as the result calls it → its revolutions per revolution of the first one.
    which : str
        "simulation" or "recording".

    Raises
    ------
    RefusalError
        If the speed cannot be known, or the reference shaft makes too few turns.
    """
    from gearsig.angle.resample import resample_to_angle
    from gearsig.severity.shaft_lines import has_mark

    reference = next(iter(ratios))
    angle = _angle(recording, rig, names.get(reference, reference), which)
    rows = [recording.index(name) for name in channels]
    own = replace(recording, samples=values, channels=tuple(recording.channels[i] for i in rows))
    signals: dict[str, tuple[AngleSignal, AngleSignal]] = {}
    for shaft, ratio in ratios.items():
        turned = replace(angle, shaft=shaft) if ratio == 1.0 else angle.of_shaft(shaft, ratio)
        if turned.n_revolutions < LEAST_REVOLUTIONS:
            if shaft != reference:
                continue
            raise RefusalError(
                f"the {which} holds {turned.n_revolutions:.3g} revolutions of shaft {shaft or 'of reference'}, "
                f"{LEAST_REVOLUTIONS} are needed",
                remedy="make it longer",
            )
        halved = halves(resample_to_angle(own, turned, channels=list(channels)))
        if halved is not None:
            signals[shaft] = halved
    if reference not in signals:
        raise RefusalError(f"the {which} holds too few whole revolutions", remedy="make it longer")
    marked = {shaft for shaft in signals if rig.shafts and has_mark(recording, rig, names.get(shaft, shaft))}
    return Side(own, angle, signals, frozenset(marked))


def halves(signal: AngleSignal) -> tuple[AngleSignal, AngleSignal] | None:
    """Cut a signal into two halves of equally many whole revolutions; None with fewer than four in each."""
    per_rev = signal.samples_per_revolution
    start, revolution = first_whole_sample(signal)
    n_rev = (signal.samples.shape[1] - start) // per_rev // 2
    if n_rev < LEAST_REVOLUTIONS // 2:
        return None
    middle, end = start + n_rev * per_rev, start + 2 * n_rev * per_rev
    first = replace(signal, samples=signal.samples[:, start:middle], start_revolution=float(revolution))
    second = replace(signal, samples=signal.samples[:, middle:end], start_revolution=float(revolution + n_rev))
    return first, second


def time_halves(recording: Recording, row: int) -> tuple[FloatArray, FloatArray]:
    """Return both halves of a channel's samples, each (n_samples // 2,), without the record's mean."""
    n = recording.n_samples // 2
    values = np.asarray(recording.samples[row], dtype=np.float64)
    values = values - values.mean()
    return values[:n], values[n : 2 * n]


def _angle(recording: Recording, rig: Rig, shaft: str, which: str) -> ShaftAngle:
    """Return the angle of a shaft of this side's rig, found and checked as `analyze` does."""
    from gearsig.diagnosis.speed import determine_angle, exact_angle
    from gearsig.diagnosis.types import CannotTell

    found = determine_angle(recording, rig)
    if isinstance(found, CannotTell):
        raise RefusalError(f"the speed of the {which} is not known: {found.reason}", remedy=found.remedy)
    angle = exact_angle(recording, rig, found).between(0.0, recording.duration_s)
    ratio = rig.ratio(shaft, to=angle.shaft) if shaft and angle.shaft else 1.0
    if ratio is None:
        raise RefusalError(
            f"the speed of shaft {shaft!r} does not follow from the teeth of the {which}'s rig",
            remedy="complete the tooth counts",
        )
    return angle if ratio == 1.0 else angle.of_shaft(shaft, ratio)
