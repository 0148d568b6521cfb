"""Fresh processes from scripts as people write them, without a guard against being run again."""

import subprocess
import sys
from pathlib import Path

from gearsig.processes import can_be_sent

SCRIPT = """
from gearsig.processes import can_be_sent, process_pool

class Own:
    pass

print("begins")
with process_pool(2) as pool:
    print(sum(pool.map(abs, (-1, -2))), can_be_sent(Own()), can_be_sent([1.0]))
print(__file__.endswith("script.py"))
"""


def test_a_script_without_a_guard_runs_once(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.split("\n")[:-1] == ["begins", "3 False True", "True"]
    assert done.stderr == ""


def test_what_cannot_be_pickled_cannot_be_sent() -> None:
    assert not can_be_sent(lambda: None)
    assert not can_be_sent(sys.stdout)
    assert can_be_sent({"a": Path("b")})
