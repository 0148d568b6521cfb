"""The diagnosing process and its output: ``python -m app.benchmark.answer DIAGNOSER…`` in a case's folder.

A new process is started for each case. Its only input is its working folder, which has a random name and holds
recordings and rig files; it writes answers.json there. It imports nothing that makes cases.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from app.benchmark.diagnosers import VisibleCase, diagnoser, read_visible
from gearsig.cache import write_text
from gearsig.errors import GearsigError, unexpected_text
from gearsig.gap import GapCause, GapPlace, GapReport, Shrinkage
from gearsig.report import from_plain


@dataclass(frozen=True)
class Answer:
    """One diagnoser's answer to one case.

    Parameters
    ----------
    outcome : str
        Value of `GapOutcome`; empty if the diagnosis failed.
    causes : tuple of GapCause
        In the order of the report: those that the outcome names first, then the others by probability.
    inseparable : tuple of str
    places : tuple of GapPlace
    size : float
        Size of the gap in structural floors.
    seconds, cpu_seconds : float
        Elapsed and processor time, without the start of the process.
    error : str
        Why there is no answer.
    """

    outcome: str
    causes: tuple[GapCause, ...] = ()
    inseparable: tuple[str, ...] = ()
    places: tuple[GapPlace, ...] = ()
    size: float = float("nan")
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    error: str = ""

    @property
    def ranked(self) -> tuple[GapCause, ...]:
        """The causes by decreasing probability, whatever the outcome puts first; ties keep their order."""
        return tuple(sorted(self.causes, key=lambda cause: -cause.probability))

    def probability(self, name: str) -> float:
        """Return the probability of a cause; 0 if it is not listed."""
        return next((c.probability for c in self.causes if c.name == name), 0.0)

    def options(self, name: str) -> Mapping[str, float | str]:
        """Return the location of a cause: the options of its fitted setting; empty without one."""
        return next((c.fitted.options for c in self.causes if c.name == name and c.fitted is not None), {})

    def shrinkage(self, name: str) -> Shrinkage | None:
        """Return how far adding a cause shrinks the gap; None if it was not tried."""
        return next((c.shrinkage for c in self.causes if c.name == name), None)


def answer_of(report: GapReport) -> Answer:
    """Reduce a report to the fields that are scored."""
    return Answer(report.outcome.value, report.causes, report.inseparable or (), report.places, report.size.value)


def to_text(answers: Mapping[str, Answer]) -> str:
    """Return the answers of several diagnosers as JSON, with all digits of their numbers."""
    plain = {name: asdict(answer) for name, answer in answers.items()}
    return json.dumps(plain, indent=1, default=lambda enumerated: enumerated.value) + "\n"


def from_text(text: str) -> dict[str, Answer]:
    """Return the answers from the JSON of `to_text`."""
    return {name: from_plain(Answer, data, name) for name, data in json.loads(text).items()}


ANSWERS = "answers.json"


def answered(name: str, case: VisibleCase) -> Answer:
    """Return one diagnoser's answer; an error becomes the reason for having none."""
    started, cpu = time.perf_counter(), _cpu_s()
    try:
        answer = answer_of(diagnoser(name)(case))
    except GearsigError as error:
        answer = Answer("", error=str(error))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - one case must not stop the others; the reason is passed on
        answer = Answer("", error=unexpected_text(error))
    return replace(answer, seconds=time.perf_counter() - started, cpu_seconds=_cpu_s() - cpu)


def main(names: Sequence[str]) -> None:
    """Answer with each diagnoser in turn and write the answers atomically."""
    case = read_visible(Path.cwd())
    answers = {name: answered(name, case) for name in names}
    write_text(Path(ANSWERS), to_text(answers))


def _cpu_s() -> float:
    """Return the processor time, in s, of this process and of the child processes it has waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


if __name__ == "__main__":
    main(sys.argv[1:])
