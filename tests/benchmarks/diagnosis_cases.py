"""How often the diagnosis is right: `python tests/benchmarks/diagnosis_cases.py [CASES] [SEED]`.

Draws gearboxes, speeds, noise and faults at random from the kinematic model, analyses each, and prints how often a
fault is claimed on a good machine, how often each fault is found and named by severity, and whether the stated
confidence is the share of statements that are true. The signal model is the product's own: real machines are less kind.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from gearsig.diagnosis import Analysis, Finding, Kind, analyze
from gearsig.recording import Recording
from gearsig.rig import Bearing, GearPair, Rig, Shaft
from sims.measure import ColouredNoise, MainsHum, Tachometer
from tests.kinematic.model import (
    BearingFault,
    KinematicModel,
    MeshHarmonics,
    MeshModulation,
    PathResonance,
    SensorChannel,
    ShaftOrder,
    ToothDamage,
    ToothVariation,
    TransferPath,
)
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import Wander

BEARINGS = {"in": "front", "out": "rear"}
FAULTS = ("none", "tooth", "outer", "inner", "eccentric")
LEVELS = {"weak": 0.1, "medium": 0.4, "strong": 1.5}
"""Peak of an impact against the rms of the good machine's vibration; depth of modulation for an eccentric gear / 2."""


@dataclass(frozen=True)
class Case:
    """One drawn machine and what is wrong with it."""

    recording: Recording
    fault: str
    level: str
    shaft: str
    angle_rev: float


def draw_case(rng: np.random.Generator) -> Case:
    """Draw a machine, its running condition and a fault."""
    z1, z2 = int(rng.integers(17, 45)), int(rng.integers(25, 90))
    n, ball = int(rng.integers(7, 16)), rng.uniform(5, 12)
    pitch = ball * rng.uniform(3.5, 5.5)
    rig = Rig(
        name="drawn",
        shafts=(Shaft("in"), Shaft("out")),
        pairs=(GearPair("stage", "in", "out", z1, z2),),
        bearings=(Bearing("front", "in", n, ball, pitch), Bearing("rear", "out", n + 2, ball, pitch * 1.2)),
    )
    fault, level = str(rng.choice(FAULTS)), str(rng.choice(list(LEVELS)))
    rpm = rng.uniform(600, 2400)
    if z1 * rpm / 60 > 2000:
        rpm = 2000 * 60 / z1
    shaft, angle = str(rng.choice(["in", "out"])), float(rng.uniform())
    model = _model(rng, rpm, fault, LEVELS[level], shaft, angle)
    duration = float(rng.uniform(5, 10))
    recording = simulate_kinematic(rig, model, sampling_rate_hz=12800.0, duration_s=duration, rng=rng)
    return Case(recording, fault, level, shaft, angle)


def _model(rng: np.random.Generator, rpm: float, fault: str, size: float, shaft: str, angle: float) -> KinematicModel:
    levels = rng.uniform(1, 6, 3) / np.array([1, 2, 3])
    rms = float(np.sqrt(np.sum(levels**2) / 2))
    noise = rms * rng.uniform(0.05, 0.6)
    path = TransferPath(
        1.0, (PathResonance(rng.uniform(600, 1500), 0.05, 1.5), PathResonance(rng.uniform(2000, 5000), 0.04, 2.0))
    )
    eccentric = {
        s: (size / 2 if fault == "eccentric" and s == shaft else rng.uniform(0.01, 0.1)) for s in ("in", "out")
    }
    impact = size * rms * 3
    return KinematicModel(
        speed=Wander(rpm, rng.uniform(0, 0.01), rng.uniform(0.1, 1.0)),
        meshes=(MeshHarmonics("stage", tuple(levels), tuple(rng.uniform(0, 6.28, 3))),),
        modulations=tuple(MeshModulation("stage", s, m, m / 2) for s, m in eccentric.items()),
        tooth_variations=tuple(ToothVariation("stage", s, rng.uniform(0.005, 0.05), 0.02) for s in ("in", "out")),
        tooth_damages=(
            ToothDamage("stage", shaft, angle, impact, rng.uniform(2000, 5000), 0.05, 0.2, 0.15 * size, 0.1 * size),
        )
        if fault == "tooth"
        else (),
        bearing_faults=(BearingFault(BEARINGS[shaft], fault, impact, rng.uniform(2500, 5000), 0.04, 0.01, 0.2),)
        if fault in ("outer", "inner")
        else (),
        shaft_orders=(ShaftOrder("in", rng.uniform(0, 0.5)), ShaftOrder("out", rng.uniform(0, 0.5))),
        channels=tuple(
            SensorChannel(f"a{i}", path, ColouredNoise(noise, rng.uniform(0, 1)), MainsHum((0.02 * rms,)))
            for i in range(int(rng.integers(1, 4)))
        ),
        tachometer=Tachometer("in", jitter_s=1e-5),
    )


def is_true(case: Case, finding: Finding) -> bool:
    """Whether a finding names what was put in, at the right place, or at one of two that it cannot tell apart."""
    at_shaft = finding.where.shaft == case.shaft or f"or {case.shaft}." in finding.title
    if finding.code == "tooth-local-damage":
        off = ((finding.where.angle_deg or 0) / 360 - case.angle_rev + 0.5) % 1 - 0.5
        # The tachometer is on the input shaft: the output shaft's angle is not known to it.
        placed = abs(off) < 0.06 or case.shaft == "out"
        return case.fault == "tooth" and at_shaft and placed
    if finding.code in ("bearing-outer-race", "bearing-inner-race"):
        at_shaft |= f"or {BEARINGS[case.shaft]} on" in finding.title
        return finding.code == f"bearing-{case.fault}-race" and at_shaft
    if finding.code == "mesh-modulated":
        return case.fault == "eccentric" and finding.where.shaft == case.shaft
    return False


def claims(analysis: Analysis) -> list[Finding]:
    """Return what the analysis claims to be wrong."""
    return [f for f in analysis.findings if f.kind in (Kind.FAULT, Kind.SUSPICION)]


def main() -> None:
    """Draw, analyse, count, print."""
    n_cases = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 0)
    found: dict[tuple[str, str], list[bool]] = defaultdict(list)
    noticed: dict[tuple[str, str], int] = defaultdict(int)
    false_faults, false_suspicions = [], []
    stated: list[tuple[float, bool]] = []
    for _ in range(n_cases):
        case = draw_case(rng)
        analysis = analyze(case.recording)
        made = claims(analysis)
        wrong = [f for f in made if not is_true(case, f)]
        key = case.fault, "-" if case.fault == "none" else case.level
        found[key].append(any(is_true(case, f) for f in made))
        noticed[key] += not found[key][-1] and any(is_true(case, f) for f in analysis.findings)
        false_faults.append(any(f.kind is Kind.FAULT for f in wrong))
        false_suspicions.append(bool(wrong))
        stated += [(f.confidence, is_true(case, f)) for f in made]
        for f in wrong:
            where = f"on {case.shaft} at {360 * case.angle_rev:.0f}°"
            print(f"  wrong: {case.fault}/{case.level} {where}: {f.kind.value}, {f.title}")
    print(f"{n_cases} cases")
    print(
        f"wrong fault claimed: {np.mean(false_faults):.3f}, wrong fault or suspicion: {np.mean(false_suspicions):.3f}"
    )
    for key in sorted(found):
        if key[0] != "none":
            also = f", {noticed[key]} more as a notice" if noticed[key] else ""
            print(f"  {key[0]:<10} {key[1]:<7} found and placed: {sum(found[key])} of {len(found[key])}{also}")
    for low, high in ((0.0, 0.6), (0.6, 0.85), (0.85, 1.0)):
        inside = [truth for confidence, truth in stated if low < confidence <= high]
        if inside:
            print(f"  stated confidence {low:.2f} to {high:.2f}: {np.mean(inside):.2f} true of {len(inside)}")


if __name__ == "__main__":
    main()
