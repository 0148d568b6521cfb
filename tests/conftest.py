"""Settings of all tests."""

import gc
import os
import time

import pytest
from hypothesis import HealthCheck, settings
from xdist.scheduler import LoadScopeScheduling

# Before numpy is loaded: workers share the processors, and threads of linear algebra that wait keep them busy.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# Compiled kernels are built on their first call: how long an example takes says nothing about the code.
settings.register_profile("gearsig", deadline=None, suppress_health_check=[HealthCheck.too_slow])
# In continuous integration the examples are the same each time: a change fails by what it changes, not by chance.
settings.register_profile("ci", settings.get_profile("gearsig"), derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "gearsig")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadScopeScheduling | None:
    """With `--dist loadfile`, let one worker run all that needs the browser: one dashboard serves all of it.

    Browser tests wait half of the time, for which the other workers have what computes.
    """
    return BrowserApart(config, log) if config.getvalue("dist") == "loadfile" else None


class BrowserApart(LoadScopeScheduling):
    """Gives each worker whole files, one of them the folder of the browser's tests."""

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.partition("::")[0]
        return "tests/browser" if file.startswith("tests/browser/") else file


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Begin no test after the time that `GEARSIG_TESTS_UNTIL` states, in s since 1970; the summary says how many."""
    if time.time() > float(os.environ.get("GEARSIG_TESTS_UNTIL", "inf")):
        pytest.skip("no time was left")


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
