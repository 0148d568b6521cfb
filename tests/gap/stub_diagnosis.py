"""A diagnosis without arithmetic, in place of the real one in processes that a test starts."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from gearsig.errors import RefusalError
from tests.gap.example_report import all_reports, with_few_curves

ROOT = Path(__file__).parents[2]
OUTCOME, SECONDS, CHILD = "GAP_STUB_OUTCOME", "GAP_STUB_SECONDS", "GAP_STUB_CHILD"
ALL_CURVES = "GAP_STUB_ALL_CURVES"
N_STEPS = 20
SITE = """
import sys
from types import ModuleType

def diagnose_gap(*given, **more):
    from tests.gap.stub_diagnosis import diagnose_gap
    return diagnose_gap(*given, **more)

stub = ModuleType("gearsig.gap._diagnose")
stub.diagnose_gap = diagnose_gap
stub.effects_without_setting = None  # of the room's face, not of a diagnosis
sys.modules["gearsig.gap._diagnose"] = stub
"""


def diagnose_gap(recordings: Any, simulator: Any, *, on_stage: Any, **more: Any) -> Any:
    """Take some time, then answer as the environment says."""
    del recordings, simulator, more
    outcome, seconds = os.environ.get(OUTCOME, "effect"), float(os.environ.get(SECONDS, "0"))
    if CHILD in os.environ:
        child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(100)"])
        Path(os.environ[CHILD]).write_text(str(child.pid))
    for step in range(N_STEPS):
        on_stage(("preparing the simulator", "fitting effects")[2 * step // N_STEPS], step / N_STEPS)
        time.sleep(seconds / N_STEPS)
    if outcome == "refusal":
        raise RefusalError("the rig <file> has no teeth", remedy="give them in the rig file")
    if outcome == "crash":
        raise ZeroDivisionError("something nobody thought of")
    report = all_reports()[outcome]
    return report if ALL_CURVES in os.environ else with_few_curves(report)


def environment(folder: Path, **more: str) -> dict[str, str]:
    """Return the environment of a process that uses this diagnosis; `folder` gets the file that sees to it."""
    (folder / "sitecustomize.py").write_text(SITE)
    return {**os.environ, "PYTHONPATH": f"{folder}{os.pathsep}{ROOT}", **more}
