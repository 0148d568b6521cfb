"""What is said of measured bearings otherwise recorded: `python tests/benchmarks/measured_variants.py [WORD…]`.

Each recording of a bearing in `../shared/data` (those whose name has one of the words, or all) is cut short, thinned,
quantised, buried in noise, seen by one sensor alone, stated with another speed, mixed with the healthy motor, or given
with a rig in which another bearing is described. What is damaged stays the same. Prints a line for each variant that
is not right, then how many of each kind are right (more than 50 %), unsure, silent or wrong (another part at more than
50 %, or any on a healthy machine).
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy import signal

from gearsig.diagnosis import Analysis, Kind, analyze
from gearsig.recording import Recording
from tests.measured import BY_NAME, MOTOR, PARTS, at_speed

DAMAGED = {
    "bearing_cwru/OR007@6_0.mat": ("bearing-outer-race", "drive end"),
    "bearing_cwru/IR021_0.mat": ("bearing-inner-race", "drive end"),
    "bearing_cwru/B007_0.mat": ("bearing-rolling-element", "drive end"),
    "bearing_races/InnerRaceFault_vload_3.mat": ("bearing-inner-race", "test bearing"),
    "bearing_races/OuterRaceFault_vload_4.mat": ("bearing-outer-race", "test bearing"),
}
HEALTHY = ("bearing_cwru/normal_0.mat", "unbalance_rotor/unbalance.mat#1", "unbalance_rotor/unbalance.mat#3")
LIKELY = 0.5


def with_samples(recording: Recording, samples: np.ndarray, rate: float = 1.0) -> Recording:
    return replace(recording, samples=samples, sampling_rate_hz=rate * recording.sampling_rate_hz)


def variants(recording: Recording) -> Iterator[tuple[str, Recording]]:
    """Yield the kind of each variant, and the variant."""
    samples, length = np.asarray(recording.samples, dtype=np.float64), recording.duration_s
    deviation, rng = samples.std(axis=1, keepdims=True), np.random.default_rng(0)
    time_s = np.arange(samples.shape[1]) / recording.sampling_rate_hz
    for seconds in (1.0, 2.0, 4.0):
        for start_s in np.linspace(0.0, length - seconds, 3) if seconds < length else ():
            yield f"{seconds:g} s of it", recording.between(float(start_s), float(start_s + seconds))
    for q in (2, 3):
        yield "thinned", with_samples(recording, signal.resample_poly(samples, 1, q, axis=1), 1 / q)
    for up, down in ((2, 1), (5, 4)):
        yield "another rate", with_samples(recording, signal.resample_poly(samples, up, down, axis=1), up / down)
    if len(recording.channels) > 1:
        for channel in recording.vibration_names():
            yield "one sensor", recording.select([channel])
    largest = np.abs(samples).max()
    yield "8 bits", with_samples(recording, np.round(samples / largest * 127) * largest / 127)
    yield "turned round", with_samples(recording, -samples)
    yield "hum twice as strong", with_samples(recording, samples + 2 * deviation * np.sin(2 * np.pi * 60 * time_s))
    for share in (0.5, 1.0, 2.0):
        noisy = samples + share * deviation * rng.normal(size=samples.shape)
        yield f"noise {share:g} times as strong", with_samples(recording, noisy)
    for factor in (0.97, 0.99, 1.01, 1.03):
        yield "speed stated up to 3 % off", at_speed(recording, factor)
    for factor in (0.94, 0.95, 0.96, 1.04, 1.05, 1.06):
        yield "speed stated 4 to 6 % off", at_speed(recording, factor)
    yield "a faster machine", at_speed(with_samples(recording, samples, 1.37), 1.37)


def of_motor(name: str) -> Iterator[tuple[str, Recording, tuple[str, str] | None]]:
    """Yield variants of a motor with two bearings, and what is damaged of what is described."""
    recording, part = BY_NAME[name].read(), DAMAGED[name]
    drive_end, fan_end = MOTOR.bearings
    assert recording.rig is not None
    rig = recording.rig
    yield "the other bearing alone described", replace(recording, rig=replace(rig, bearings=(fan_end,))), None
    swapped = (replace(fan_end, name="drive end"), replace(drive_end, name="fan end"))
    ends = {"DE": "FE", "FE": "DE", "BA": "BA"}
    channels = tuple(replace(c, name=f"X_{ends[c.name.split('_')[1]]}_time") for c in recording.channels)
    yield (
        "ends changed over",
        replace(recording, channels=channels, rig=replace(rig, bearings=swapped)),
        (part[0], "fan end"),
    )
    healthy = signal.resample_poly(np.asarray(BY_NAME["bearing_cwru/normal_0.mat"].read().samples, float), 1, 4, axis=1)
    names = [next(n for n in recording.vibration_names() if end in n) for end in ("_DE_", "_FE_")]
    both = recording.select(names)
    for share in (1.0, 0.5, 0.25, 0.12, 0.06, 0.03):
        mixed = healthy + share * np.asarray(both.samples)[:, : healthy.shape[1]]
        yield "weaker, beside the healthy motor", with_samples(both, mixed), part


def outcome(analysis: Analysis, part: tuple[str, str] | None) -> str:
    """Return right, unsure, silent, wrong; of a healthy machine clean or wrong."""
    claims = [f for f in analysis.findings if f.kind in (Kind.FAULT, Kind.SUSPICION) and f.code in PARTS]
    right = [f for f in claims if part is not None and f.code == part[0] and f.where.bearing == part[1]]
    likely = [f for f in claims if f.confidence > LIKELY]
    if any(all(f is not other for other in right) for f in likely):
        return "wrong"
    if part is None:
        return "clean"
    return "right" if any(f.confidence > LIKELY for f in right) else "unsure" if right else "silent"


def cases(words: list[str]) -> Iterator[tuple[str, str, Recording, tuple[str, str] | None]]:
    for name in (*DAMAGED, *HEALTHY):
        if words and not any(word in name for word in words):
            continue
        for kind, recording in variants(BY_NAME[name].read()):
            yield name, kind, recording, DAMAGED.get(name)
        if name.startswith("bearing_cwru") and name in DAMAGED:
            for kind, recording, part in of_motor(name):
                yield name, kind, recording, part


def main() -> None:
    counts: Counter[tuple[str, str]] = Counter()
    for name, kind, recording, part in cases(sys.argv[1:]):
        analysis = analyze(recording)
        said = outcome(analysis, part)
        group = "ball" if "B007" in name else "race" if name in DAMAGED else "healthy"
        counts[f"{group}: {kind}", said] += 1
        if said not in ("right", "clean"):
            print(f"{name}, {kind}: {said}. {analysis.verdict[:120]}", flush=True)
    for kind in sorted({kind for kind, _ in counts}):
        print(kind, *(f"{n} {said}" for (k, said), n in sorted(counts.items()) if k == kind), sep="; ")


if __name__ == "__main__":
    main()
