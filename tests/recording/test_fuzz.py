"""Damaged files of every format: a result or an error of gearsig, within 5 s and bounded memory.

`GEARSIG_FUZZ_FILES=10000 pytest -m slow tests/recording/test_fuzz.py` reads so many of each.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

READER = Path(__file__).parent / "fuzz_reader.py"
KINDS = ("csv", "gzip", "mat", "hdf5", "parquet", "wav", "tdms", "uff", "mf4", "pulses", "toml")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="peak memory is read from Linux' /proc")
@pytest.mark.parametrize("kind", KINDS)
def test_mutated_files(kind, tmp_path):
    n_files = os.environ.get("GEARSIG_FUZZ_FILES", "250")
    run = subprocess.run(
        [sys.executable, READER, kind, n_files, "1", tmp_path], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-3000:]
    assert "WRONG" not in run.stdout, run.stdout[:5000]
    assert f"{kind}: {n_files} files" in run.stdout
