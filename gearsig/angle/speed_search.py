"""What is searched where, when the speed is read from the vibration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.angle.comb_decision import CombDecision, decide
from gearsig.angle.comb_lines import CombLines, comb_of_rig
from gearsig.angle.line_evidence import line_evidence
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig

LOWEST_QUALITY = 0.5
"""Below it no speed is claimed: on simulated and measured recordings, hardly a wrong speed lies above."""

TOP = 0.45
"""Share of the sampling rate that is looked at; above it lie the anti-aliasing filters of recorders."""

_WIDEST_RPM = (30.0, 30_000.0)
_FEWEST_REVOLUTIONS = 20.0
_DIVISIONS = (1, 4, 16)  # of the recording's length: long segments for steady lines, short ones for wandering lines


@dataclass(frozen=True)
class SpeedSearch:
    """What is searched where."""

    recording: Recording
    channels: tuple[str, ...]
    samples: FloatArray
    comb: CombLines
    shaft: str
    low: float
    high: float


def search_of(
    recording: Recording,
    rig: Rig,
    channels: Sequence[str] | None,
    speed_range_rpm: tuple[float, float] | None,
) -> SpeedSearch:
    """Check what the search rests on: teeth, living channels, a range of speeds with enough revolutions."""
    comb = comb_of_rig(rig)
    if comb is None:
        raise RefusalError(
            "no mesh order is known: the speed cannot be read from mesh lines",
            remedy="give the teeth of at least one gear on a shaft whose ratio is known, or a speed source",
        )
    names = tuple(channels) if channels is not None else recording.vibration_names()
    rows = [recording.index(name) for name in names]
    alive = [i for i in rows if float(np.ptp(recording.samples[i])) > 0.0]
    if not alive:
        raise RefusalError("no vibration channel moves", remedy="check sensors and channel quantities")
    low, high = _range(recording, rig, comb, speed_range_rpm)
    return SpeedSearch(
        recording,
        tuple(recording.channel_names[i] for i in alive),
        np.asarray(recording.samples[alive], dtype=np.float64),
        comb,
        rig.reference_shaft,
        low,
        high,
    )


def _range(
    recording: Recording, rig: Rig, comb: CombLines, speed_range_rpm: tuple[float, float] | None
) -> tuple[float, float]:
    """Range of speeds in rev/s."""
    nominal = rig.nominal_speed_rpm()
    if speed_range_rpm is not None:
        low, high = (positive(v, "speed_range_rpm", "rpm") / 60.0 for v in speed_range_rpm)
        if not low < high:
            raise InputError(f"speed_range_rpm is {speed_range_rpm}", allowed="(low, high) with low < high")
    elif nominal is not None:
        if nominal == 0.0:
            raise RefusalError("the machine is at rest: its nominal speed is 0 rpm", remedy="record while it turns")
        share = rig.operating_point.speed_tolerance_percent / 100.0
        low, high = nominal * (1 - share) / 60.0, nominal * (1 + share) / 60.0
    else:
        low, high = (v / 60.0 for v in _WIDEST_RPM)
        low = max(low, _FEWEST_REVOLUTIONS / recording.duration_s)
    high = min(high, TOP * recording.sampling_rate_hz / comb.meshes[0])
    if high * recording.duration_s < _FEWEST_REVOLUTIONS or low >= high:
        raise RefusalError(
            f"within {recording.duration_s:.3g} s at {recording.sampling_rate_hz:.6g} Hz there are fewer than "
            f"{_FEWEST_REVOLUTIONS:.0f} revolutions with a mesh line below {TOP * recording.sampling_rate_hz:.4g} Hz "
            f"at {60 * low:.4g} to {60 * high:.4g} rpm",
            remedy="record longer or with a higher sampling rate, or check speed and teeth",
        )
    return low, high


@dataclass(frozen=True)
class SpeedCandidate:
    """An angle, and how its comb weighed."""

    angle: ShaftAngle
    decision: CombDecision


def best_decision(samples: FloatArray, rate: float, comb: CombLines, low: float, high: float) -> CombDecision | None:
    """Weigh the comb over spectra of several resolutions and return the best, None if the samples are too few.

    `rate` is in samples per second, or per revolution; `low` and `high` accordingly.
    """
    decisions = [
        decide(line_evidence(samples, rate, n, TOP * rate), comb, low, high)
        for n in (samples.shape[1] // d for d in _DIVISIONS)
        # Sidebands need four bins between them and the mesh line.
        if n >= 256 and high * n / rate > 4.0
    ]
    return max(decisions, key=lambda d: (d.quality >= LOWEST_QUALITY, d.score), default=None)
