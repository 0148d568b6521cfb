"""One blind case: a machine by its drawing, something wrong or nothing, recordings now and when it was sound."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gearsig.checks import one_of
from gearsig.recording.types import Recording
from sims.blind_drive.changes import CATALOGUE, OUTSIDE, changed
from sims.blind_drive.machine import Machine, build, draw_drawing
from sims.blind_drive.measure import Chain, draw_chain, run

KINDS = ("none", "single", "unknown")
DAILY = {"load_level": 0.05, "mu": 0.05, "torque": 0.02, "motor_level": 0.1, "brake": 0.05}
"""What a sound machine changes by from one day to another, relative."""


@dataclass(frozen=True)
class DriveCase:
    """A case as it was drawn.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    effect : str
        Empty: none.
    level, severity : float
        0 (barely noticeable) to 1 (strong), and in the effect's unit.
    place : mapping
        Tooth (from 1) or order, where it has one.
    machine, sound : Machine
        Now; and as the reference knew it.
    chain : Chain
    duration_s : float
    with_reference : bool
    seed : int
        Of the noise.
    """

    kind: str
    effect: str
    level: float
    severity: float
    place: dict[str, float]
    machine: Machine
    sound: Machine
    chain: Chain
    duration_s: float
    with_reference: bool
    seed: int


@dataclass(frozen=True)
class MadeCase:
    """Recordings: now, and of the sound machine where there is one."""

    recording: Recording
    reference: Recording | None


def draw_case(
    rng: np.random.Generator, role: str, *, kind: str, effect: str = "", level: float = 0.5, with_reference: bool = True
) -> DriveCase:
    """Draw a case.

    Parameters
    ----------
    rng : numpy.random.Generator
    role : str
        "development", "calibration" or "evaluation"; they share no gears.
    kind : str
        "none", "single" (of `CATALOGUE`) or "unknown" (of `OUTSIDE`).
    effect : str
        Empty for none.
    level : float
        0 to 1.
    with_reference : bool
    """
    one_of(kind, "kind", KINDS)
    drawing = draw_drawing(rng, role)
    sound = build(rng, drawing)
    chain = draw_chain(rng)
    now = _another_day(sound, rng)
    severity = 0.0
    place: dict[str, float] = {}
    if effect:
        change = (CATALOGUE | OUTSIDE)[effect]
        severity = float(change.low * (change.high / change.low) ** level)
        now, place = changed(now, effect, severity, rng)
    n_cycles = int(rng.integers(5, 8))
    duration = n_cycles * (drawing.on_s + drawing.off_s)
    return DriveCase(
        kind, effect, level, severity, place, now, sound, chain, duration, with_reference, int(rng.integers(2**31))
    )


def record_case(case: DriveCase) -> MadeCase:
    """Record a case."""
    rng, other = np.random.default_rng(case.seed).spawn(2)
    reference = run(case.sound, case.chain, case.duration_s, other) if case.with_reference else None
    return MadeCase(run(case.machine, case.chain, case.duration_s, rng), reference)


def label_of(case: DriveCase) -> dict[str, Any]:
    """Return what is true of a case, as plain values."""
    return {
        "kind": case.kind,
        "effect": case.effect,
        "level": case.level,
        "severity": case.severity,
        "unit": (CATALOGUE | OUTSIDE)[case.effect].unit if case.effect else "",
        "place": case.place,
        "with_reference": case.with_reference,
        "n_channels": case.chain.n_channels,
        "encoder_counts": case.chain.counts,
        "teeth": [case.machine.drawing.z1, case.machine.drawing.z2],
    }


def _another_day(machine: Machine, rng: np.random.Generator) -> Machine:
    """Return the machine as warm, as oiled and as valved as it is today."""
    today = {name: machine.numbers[name] * rng.uniform(1.0 - part, 1.0 + part) for name, part in DAILY.items()}
    return replace(machine, numbers=machine.numbers | today)
