"""The diagnosing process: ``python -m app.benchmark.diagnose_one DIAGNOSER…`` in a case's folder.

It is started fresh for each case. All it is given is the folder it stands in, which has a random name and holds
recordings and rig files; it leaves answers.json there. It imports nothing that makes cases.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from pathlib import Path

from app.benchmark.answer import Answer, answer_of, to_text
from app.benchmark.diagnosers import VisibleCase, diagnoser, read_visible
from gearsig.cache import write_text
from gearsig.errors import GearsigError

ANSWERS = "answers.json"


def answered(name: str, case: VisibleCase) -> Answer:
    """Return one diagnoser's answer; every error becomes a reason."""
    started, cpu = time.perf_counter(), _cpu_s()
    try:
        report = diagnoser(name)(case)
    except GearsigError as error:
        return Answer("", seconds=time.perf_counter() - started, cpu_seconds=_cpu_s() - cpu, error=str(error))
    except (Exception, SystemExit) as error:  # noqa: BLE001 - one case must not stop the others; the reason is passed on
        text = f"unexpected error: {type(error).__name__}: {' '.join(str(error).split())}"
        return Answer("", seconds=time.perf_counter() - started, cpu_seconds=_cpu_s() - cpu, error=text)
    return answer_of(report, time.perf_counter() - started, _cpu_s() - cpu)


def main(names: Sequence[str]) -> None:
    """Answer with each diagnoser in turn and write the answers, whole or not at all."""
    case = read_visible(Path.cwd())
    answers = {name: answered(name, case) for name in names}
    write_text(Path(ANSWERS), to_text(answers))


def _cpu_s() -> float:
    """Processor time of this process and of those it has waited for."""
    import os

    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


if __name__ == "__main__":
    main(sys.argv[1:])
