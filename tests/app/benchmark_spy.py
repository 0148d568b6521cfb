"""A diagnoser that tells what it finds around itself, as the reason why it has no answer."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from app.benchmark.diagnosers import VisibleCase
from gearsig.errors import RefusalError
from gearsig.gap import GapReport


def diagnose(seen: VisibleCase) -> GapReport:
    """Refuse, with all that a diagnosing process could learn from."""
    raise RefusalError(
        json.dumps(
            {
                "arguments": sys.argv[1:],
                "environment": dict(os.environ),
                "folder": str(Path.cwd()),
                "files": sorted(p.name for p in Path.cwd().rglob("*")),
                "modules": [m for m in sys.modules if m.startswith(("sims.blind", "app.benchmark"))],
                "recordings": [recording.name for recording in seen.recordings],
                "truths": [r.truth for r in (*seen.recordings, *seen.references)],
            }
        )
    )


def linger(seen: VisibleCase) -> GapReport:
    """Say who it is, start a process, and answer too late."""
    del seen
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(100)"])
    (Path(os.environ["HOME"]) / "lingering").write_text(f"{os.getpid()} {child.pid}")
    time.sleep(100.0)
    raise RefusalError("it is too late")
