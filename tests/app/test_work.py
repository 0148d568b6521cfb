"""Work beside a page: computed once for equal requests, cancelled where nobody waits for it."""

import gc
import os
import sys
from pathlib import Path
from threading import Event
from time import sleep

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import work as beside
from app.dashboard.work import Cancelled, Work, collect_garbage_later, kept
from gearsig.errors import InputError


def test_equal_requests_are_computed_once_and_the_oldest_give_way() -> None:
    asked = []
    doubled = kept(2, "…")(lambda x: asked.append(x) or 2 * x)
    assert [doubled(x) for x in (1, 1, 2, 1, 3, 1, 2)] == [2, 2, 4, 2, 6, 2, 4]
    assert asked == [1, 2, 3, 2]


def test_an_error_is_raised_to_who_asked_and_not_kept() -> None:
    @kept(2, "…")
    def fail(_: int) -> None:
        raise InputError("no")

    for _ in range(2):
        with pytest.raises(InputError, match="no"):
            fail(1)
    assert fail.is_answered(1)


def test_work_is_cancelled_at_its_next_step_and_begun_anew_when_asked_for() -> None:
    begun = Event()

    @kept(2, "…")
    def forever(_: int) -> int:
        begun.set()
        n = 0
        while True:
            n += 1

    work = forever.begin(1)
    assert begun.wait(60.0)
    work.cancel()
    assert work.wait(60.0)
    with pytest.raises(Cancelled):
        work.result()
    assert not forever.is_answered(1)
    again = forever.begin(1)
    assert again is not work
    again.cancel()
    assert again.wait(60.0)


def test_cancelling_what_is_complete_changes_nothing() -> None:
    work = Work(lambda: 3)
    assert work.wait(60.0)
    work.cancel()
    assert work.result() == 3


def _page() -> None:
    import streamlit as st

    from app.dashboard.work import _CANCELLED, kept

    tripled = kept(2, "Tripling …")(lambda x: 3 * x)
    if "begun" not in st.session_state:
        st.session_state["begun"] = True
        st.session_state[_CANCELLED] = f"{tripled.__qualname__} {hash(repr(((2,), {}))):x}"
    st.title(str(tripled(2)))


def _slow_page() -> None:
    from time import sleep

    from app.dashboard.work import kept

    slow = kept(1, "…")(lambda x: sleep(0.1) or f"slow answer {x}")
    for x in range(3):
        slow(x)


def test_a_button_that_cancels_keeps_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A session remembers what each of its buttons passes on."""
    monkeypatch.setattr(beside, "SPINNER_AFTER_S", 0.0)
    monkeypatch.setattr(beside, "CANCEL_AFTER_S", 0.0)
    page = AppTest.from_function(_slow_page).run()
    assert not page.exception
    gc.collect()
    results = [vars(work)["_result"] for work in gc.get_objects() if type(work) is Work and work.wait(0.0)]
    assert sum(isinstance(result, str) and result.startswith("slow answer") for result in results) <= 1


def test_what_was_cancelled_waits_until_it_is_started_again() -> None:
    page = AppTest.from_function(_page).run()
    assert page.info[0].value.startswith("Cancelled")
    assert not page.title
    page.button[0].click().run()
    assert page.title[0].value == "6"


def test_an_import_is_not_broken_off(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is cancelled while it imports a module imports it first: half a module, or its lock, would be left else."""
    slow = "import time\nfor _ in range(30):\n    time.sleep(0.01)\ncomplete = True\n"
    (tmp_path / "slow_to_import.py").write_text(slow)
    monkeypatch.syspath_prepend(tmp_path)
    reached = []

    def compute() -> None:
        import slow_to_import

        reached.append(slow_to_import.complete)
        for _ in range(1000):
            sleep(0.01)
        reached.append("the end")

    work = Work(compute)
    while "slow_to_import" not in sys.modules:
        sleep(0.001)
    work.cancel()
    assert work.wait(5.0)
    assert reached == [True]
    with pytest.raises(Cancelled):
        work.result()


def test_what_is_computed_ahead_is_kept_and_broken_off_with_what_is_shown_meanwhile() -> None:
    doubled = kept(4, "…", grace_s=0.0)(lambda x: 2 * x)
    with doubled.ahead(1, 2):
        pass
    assert [doubled.begin(x).wait(60.0) and doubled.is_answered(x) for x in (1, 2)] == [True, True]

    forever = kept(2, "…", grace_s=0.0)(lambda s: [sleep(s) for _ in iter(int, 1)])
    work = forever.begin(0.01)
    with pytest.raises(KeyError), forever.ahead(0.01):
        {}["as Streamlit ends the run of a page"]
    assert work.wait(60.0)
    assert work.is_cancelled


def test_garbage_is_collected_once_for_many_runs_of_a_page(monkeypatch: pytest.MonkeyPatch) -> None:
    waiting = []
    monkeypatch.setattr(beside, "_later", lambda _, function: waiting.append(function))
    beside._is_tidied_soon.clear()
    for _ in range(5):
        collect_garbage_later()
    assert len(waiting) == 1
    waiting[0]()
    collect_garbage_later()
    assert len(waiting) == 2
    beside._is_tidied_soon.clear()


@pytest.mark.skipif(beside._give_back is None, reason="no glibc")
def test_tidying_gives_memory_back() -> None:
    blocks = Work(lambda: [np.ones(5000) for _ in range(2500)])  # 100 MB in a heap of the thread's own
    blocks.wait()
    rows = blocks.result()
    del blocks, rows[:-1]  # the last holds the heap
    before_mb = _resident_mb()
    beside._tidy()
    assert _resident_mb() < before_mb - 60.0


def _resident_mb() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def _quick_page() -> None:
    from time import sleep

    import streamlit as st

    from app.dashboard.work import kept

    st.title(str(kept(2, "Tripling …")(lambda x: sleep(0.1) or 3 * x)(2)))


def test_what_is_there_at_once_has_no_spinner(monkeypatch: pytest.MonkeyPatch) -> None:
    """Put in and taken away, it moves all that stands below it, which the browser then builds anew."""
    import streamlit as st

    monkeypatch.setattr(beside, "SPINNER_AFTER_S", 60.0)
    monkeypatch.setattr(st, "spinner", lambda *_, **__: pytest.fail("a spinner"))
    page = AppTest.from_function(_quick_page).run()
    assert page.title[0].value == "6"
    assert not page.exception
