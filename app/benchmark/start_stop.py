"""`gearsig benchmark gap --model forging`: blind start–stop cases from an independent drive, diagnosed one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.benchmark.answer import Answer
from app.benchmark.blind_run import BlindRun, state_of_code
from app.benchmark.diagnosers import START_STOP
from app.benchmark.start_stop_seen import planned
from gearsig import __version__
from gearsig.checks import count, one_of
from sims.blind_drive import CATALOGUE, OUTSIDE, ROLES, draw_case, label_of, record_case

REFERENCES = ("both", "with", "without")


@dataclass(frozen=True)
class DrivePlan:
    """What decides the cases.

    Parameters
    ----------
    n_cases, seed : int
    role : str
        "development", "calibration" or "evaluation"; they share no gears.
    reference : str
        "with" or "without" healthy references, or "both" in turn.
    """

    n_cases: int = 140
    seed: int = 1
    role: str = "evaluation"
    reference: str = "both"

    def __post_init__(self) -> None:
        count(self.n_cases, "cases")
        one_of(self.role, "role", ROLES)
        one_of(self.reference, "reference", REFERENCES)

    def definition(self) -> dict[str, Any]:
        """What decides the answers, as plain values."""
        return {
            "model": "forging",
            "n_cases": self.n_cases,
            "seed": self.seed,
            "role": self.role,
            "reference": self.reference,
            "version": __version__,
            "code": state_of_code(),
        }

    def with_reference(self, number: int, effect: str) -> bool:
        """Whether a case has a healthy reference: an effect without a sound value in the drawing always has."""
        if effect and (CATALOGUE | OUTSIDE)[effect].needs_reference:
            return True
        return number % 2 == 0 if self.reference == "both" else self.reference == "with"


@dataclass(frozen=True)
class DriveDone:
    """A case, made and answered: what was true of it, and the answer."""

    number: int
    label: dict[str, Any]
    answer: Answer


def make_drive_case(plan: DrivePlan, number: int, folder: Path | None) -> dict[str, Any]:
    """Make a case; write what may be seen into `folder` (None: nowhere); return the label."""
    kind, effect, level = planned(plan.n_cases, plan.seed)[number]
    rng = np.random.default_rng([plan.seed, 1, number])
    reference = plan.with_reference(number, effect)
    case = draw_case(rng, plan.role, kind=kind, effect=effect, level=level, with_reference=reference)
    if folder is not None:
        from gearsig.recording.write import write_recording
        from gearsig.rig.toml import write_rig

        made = record_case(case)
        for stem, recording in (("condition_1", made.recording), ("reference_1", made.reference)):
            if recording is not None and recording.rig is not None:
                write_recording(recording, folder / f"{stem}.h5")
                write_rig(recording.rig, folder / f"{stem}.toml")
    return label_of(case)


def run_drive_benchmark(
    plan: DrivePlan, folder: Path, *, n_processes: int = 2, on_progress: Callable[[int], object] | None = None
) -> list[DriveDone]:
    """Make and diagnose all cases, see `app.benchmark.blind_run`."""
    numbers = range(len(planned(plan.n_cases, plan.seed)))
    run = BlindRun(numbers, partial(make_drive_case, plan), (START_STOP,), plan.definition())
    answered = run.answered(folder, n_processes=n_processes, on_progress=on_progress)
    return [DriveDone(number, label, answers[START_STOP]) for number, label, answers in answered]
