"""The diagnosing process and what it leaves: ``python -m app.benchmark.answer DIAGNOSER…`` in a case's folder.

It is started fresh for each case. All it is given is the folder it stands in, which has a random name and holds
recordings and rig files; it leaves answers.json there. It imports nothing that makes cases.
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
        Value of `GapOutcome`; empty where it failed.
    causes : tuple of GapCause
        As the report has them: what its outcome names first, the others by probability.
    inseparable : tuple of str
    places : tuple of GapPlace
    size : float
        Of the gap in structural floors.
    seconds, cpu_seconds : float
        What it took, start of the process left out.
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
        """The causes by probability, whatever the outcome puts first; of those alike, the first stays first."""
        return tuple(sorted(self.causes, key=lambda cause: -cause.probability))

    def probability(self, name: str) -> float:
        """Probability of a cause; 0 for one that is not listed."""
        return next((c.probability for c in self.causes if c.name == name), 0.0)

    def options(self, name: str) -> Mapping[str, float | str]:
        """Where a cause was put: options of its fitted setting; none where there is none."""
        return next((c.fitted.options for c in self.causes if c.name == name and c.fitted is not None), {})

    def shrinkage(self, name: str) -> Shrinkage | None:
        """How far adding a cause shrinks the gap; None where it was not tried."""
        return next((c.shrinkage for c in self.causes if c.name == name), None)


def answer_of(report: GapReport) -> Answer:
    """Reduce a report to what is scored."""
    return Answer(report.outcome.value, report.causes, report.inseparable or (), report.places, report.size.value)


def to_text(answers: Mapping[str, Answer]) -> str:
    """Write the answers of several diagnosers as JSON, every digit of their numbers."""
    plain = {name: asdict(answer) for name, answer in answers.items()}
    return json.dumps(plain, indent=1, default=lambda enumerated: enumerated.value) + "\n"


def from_text(text: str) -> dict[str, Answer]:
    """Read what `to_text` wrote."""
    return {name: from_plain(Answer, data, name) for name, data in json.loads(text).items()}


ANSWERS = "answers.json"


def answered(name: str, case: VisibleCase) -> Answer:
    """Return one diagnoser's answer; every error becomes a reason."""
    started, cpu = time.perf_counter(), _cpu_s()
    try:
        answer = answer_of(diagnoser(name)(case))
    except GearsigError as error:
        answer = Answer("", error=str(error))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - one case must not stop the others; the reason is passed on
        answer = Answer("", error=unexpected_text(error))
    return replace(answer, seconds=time.perf_counter() - started, cpu_seconds=_cpu_s() - cpu)


def main(names: Sequence[str]) -> None:
    """Answer with each diagnoser in turn and write the answers, whole or not at all."""
    case = read_visible(Path.cwd())
    answers = {name: answered(name, case) for name in names}
    write_text(Path(ANSWERS), to_text(answers))


def _cpu_s() -> float:
    """Processor time of this process and of those it has waited for."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


if __name__ == "__main__":
    main(sys.argv[1:])
