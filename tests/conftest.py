"""Settings of all tests."""

import gc
import os

import pytest
from hypothesis import HealthCheck, settings

# Before numpy is loaded: workers share the processors, and threads of linear algebra that wait keep them busy.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# Compiled kernels are built on their first call: how long an example takes says nothing about the code.
settings.register_profile("gearsig", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# In continuous integration the examples are the same each time: a change fails by what it changes, not by chance.
settings.register_profile("ci", settings.get_profile("gearsig"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "gearsig")


def pytest_collection_finish() -> None:
    """Leave what was imported and collected to garbage collection no more: walking it took an eighth of pages' time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(scope="session", autouse=True)
def kept_results_of_their_own(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Keep results of tests apart from the user's, which may be of another state of the code."""
    own = tmp_path_factory.getbasetemp()
    # Workers of one run share what each would else make again, the forests above all.
    shared = own.parent if "PYTEST_XDIST_WORKER" in os.environ else own
    os.environ.setdefault("GEARSIG_CACHE", str(shared / "cache"))
