"""Longer computations: run in a thread beside the page, cached for equal requests, and cancelled on demand."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from functools import partial, update_wrapper
from threading import Event, Lock, Thread, Timer
from time import monotonic
from types import FrameType
from typing import Any, Generic, ParamSpec, TypeVar, cast
from weakref import ref

import streamlit as st
from streamlit.runtime.scriptrunner import get_script_run_ctx

from app.dashboard import address
from app.dashboard.compiled import is_being_made

P = ParamSpec("P")
R = TypeVar("R")
LOOK_EVERY_S = 0.05
"""Interval at which a waiting page checks for clicks and slider changes."""
SPINNER_AFTER_S, CANCEL_AFTER_S = 0.4, 2.0
"""Shorter work shows neither spinner nor Cancel: inserting and removing them also costs the browser time."""
GRACE_S = 2.0
"""How long work continues after the last page stopped waiting for it, in case somebody comes back."""
_CANCELLED = "cancelled work"


class Cancelled(BaseException):
    """Raised inside work that is no longer wanted; like `KeyboardInterrupt`, it is not an error."""


class Work(Generic[R]):
    """A computation in its own thread.

    Parameters
    ----------
    compute : callable
        Takes no arguments; may raise, and may be stopped wherever Ctrl-C could stop it.
    """

    def __init__(self, compute: Callable[[], R]) -> None:
        self.begun_s, self.n_waiting = monotonic(), 0
        self.is_cancelled, self._is_over, self._lock = False, False, Lock()
        self._result: R | None = None
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, args=(compute,), daemon=True, name="gearsig work")
        self._thread.start()

    def _run(self, compute: Callable[[], R]) -> None:
        try:
            try:
                self._result = compute()
            except Exception as error:  # noqa: BLE001 - it is raised on the page
                self._error = error
            with self._lock:
                self._is_over = True
        except Cancelled:
            self._result = None

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until it is complete, or for at most `seconds`; return whether it is complete."""
        self._thread.join(seconds)
        return not self._thread.is_alive()

    def cancel(self) -> None:
        """Stop it at its next step in Python: compiled kernels, imports and compilations finish first."""
        with self._lock:
            if self._is_over or self.is_cancelled:
                return
            self.is_cancelled = True
        self._stop()

    def _stop(self) -> None:
        with self._lock:
            if self._is_over or not self._thread.is_alive():
                return
            ident = self._thread.ident or 0
            if not _may_hold_a_lock(sys._current_frames().get(ident)):
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(ident), ctypes.py_object(Cancelled))
                return
        _later(LOOK_EVERY_S, self._stop)

    @property
    def has_failed(self) -> bool:
        """Whether it ended without a result."""
        return not self._thread.is_alive() and (self._error is not None or self.is_cancelled)

    def result(self) -> R:
        """Return the result once it is complete, or raise the error it raised."""
        if self._error is not None:
            raise self._error
        if self.is_cancelled:
            raise Cancelled
        return cast("R", self._result)


def _may_hold_a_lock(frame: FrameType | None) -> bool:
    """Whether a thread is importing, compiling, or taking a lock: interrupted there, it might never release a lock."""
    if frame is not None and frame.f_code.co_filename.endswith("threading.py"):
        return frame.f_code.co_name not in ("join", "_wait_for_tstate_lock")
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib") or f"numba{os.sep}core" in frame.f_code.co_filename:
            return True
        frame = frame.f_back
    return False


def _later(seconds: float, function: Callable[[], None]) -> None:
    timer = Timer(seconds, function)
    timer.daemon = True
    timer.start()


def let_user_act() -> None:
    """End this run of the page if the user has acted meanwhile: Streamlit does so whenever its state is accessed."""
    st.session_state.get(_CANCELLED)


COLLECT_AFTER_S = 3.0
_is_tidied_soon = Event()


def collect_garbage_later() -> None:
    """Schedule garbage collection: Streamlit would collect after each run of a page, delaying the next one by 0.1 s."""
    if not _is_tidied_soon.is_set():
        _is_tidied_soon.set()
        _later(COLLECT_AFTER_S, _tidy)


def _tidy() -> None:
    """Collect garbage, and return free memory to the operating system.

    Each computation has its own thread, each thread its own heap in glibc, and memory freed there stays with the
    process: of 1.1 GB after 200 uploads, only 0.4 GB were in use.
    """
    _is_tidied_soon.clear()
    gc.collect()
    if _give_back is not None:
        _give_back(0)


_give_back = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None


class CachedFunction(Generic[P, R]):
    """A function whose latest answers are cached and shared between sessions; each is computed beside the page.

    Parameters
    ----------
    function : callable
        Returns immutable answers and does not use Streamlit.
    n_kept : int
        Number of answers kept.
    words : str
        Shown while it computes.
    key : callable
        Arguments → a key that identifies them.
    grace_s : float
        See `GRACE_S`; 0 where a newer request makes the older one obsolete.
    """

    def __init__(
        self, function: Callable[P, R], n_kept: int, words: str, key: Callable[..., Hashable], grace_s: float
    ) -> None:
        self._function, self._n_kept, self._words, self._key, self._grace_s = function, n_kept, words, key, grace_s
        self._works: OrderedDict[Hashable, Work[R]] = OrderedDict()
        self._lock = Lock()

    def begin(self, *arguments: P.args, **named: P.kwargs) -> Work[R]:
        """Return the work for a request: cached, in progress, or started now."""
        return self._begin(self._key(*arguments, **named), lambda: self._function(*arguments, **named))

    def _begin(self, key: Hashable, compute: Callable[[], R]) -> Work[R]:
        with self._lock:
            work = self._works.get(key)
            if work is None or work.is_cancelled or work.has_failed:
                work = self._works[key] = Work(compute)
            self._works.move_to_end(key)
            while len(self._works) > self._n_kept:
                self._works.popitem(last=False)
        return work

    def __call__(self, *arguments: P.args, **named: P.kwargs) -> R:
        """Return the answer; until it is ready, the page says what is running and offers to cancel it."""
        key = self._key(*arguments, **named)
        name = f"{self._function.__qualname__} {hash(key):x}"
        is_page = get_script_run_ctx(suppress_warning=True) is not None
        if is_page and st.session_state.get(_CANCELLED) == name:
            _offer_again(name)
        while True:
            work = self._begin(key, lambda: self._function(*arguments, **named))
            work.n_waiting += 1
            try:
                self._wait(work, name, is_page=is_page)
            finally:
                work.n_waiting -= 1
                if not work.wait(0.0):
                    _cancel_unwatched(work, self._grace_s)
            if not work.is_cancelled:  # otherwise another page cancelled it, unaware of this one
                return work.result()

    @contextmanager
    def ahead(self, *requests: Any) -> Iterator[None]:
        """Compute answers while something else is shown; if that is interrupted, so are they.

        Parameters
        ----------
        *requests
            Each the argument of a function that takes one.
        """
        works = [self._begin(self._key(request), partial(cast("Any", self._function), request)) for request in requests]
        try:
            yield
        except BaseException:
            for work in works:
                _cancel_unwatched(work, self._grace_s)
            raise

    def is_answered(self, *arguments: P.args, **named: P.kwargs) -> bool:
        """Whether a request has already been computed, or has failed."""
        with self._lock:
            work = self._works.get(self._key(*arguments, **named))
        return work is not None and work.wait(0.0) and not work.is_cancelled

    def _wait(self, work: Work[R], name: str, *, is_page: bool) -> None:
        """Wait; any user action meanwhile ends this run of the page and, after the grace period, the work."""
        if not is_page:  # within other work
            while not work.wait(LOOK_EVERY_S):
                pass
            return
        shown_s = monotonic() + SPINNER_AFTER_S
        while not work.wait(LOOK_EVERY_S):
            let_user_act()
            if monotonic() > shown_s:
                break
        else:
            return
        words = self._words
        if is_being_made():
            words += " After an installation, the first answers wait until their code is compiled."
        with st.spinner(words, show_time=True):
            place, is_offered = st.empty(), False
            while not work.wait(LOOK_EVERY_S):
                let_user_act()
                if not is_offered and monotonic() - work.begun_s > CANCEL_AFTER_S:
                    address.write()
                    place.button(
                        "Cancel",
                        key=f"cancel {name}",
                        icon=":material/close:",
                        on_click=_cancel,
                        args=(name, ref(work)),
                    )
                    is_offered = True
        place.empty()


def _cancel(name: str, work: ref[Work[Any]]) -> None:
    """Cancel a button's work, referenced weakly: Streamlit keeps a button's arguments until the session ends."""
    st.session_state[_CANCELLED] = name
    if (known := work()) is not None:
        known.cancel()


def _cancel_unwatched(work: Work[Any], grace_s: float) -> None:
    def look() -> None:
        if work.n_waiting == 0:
            work.cancel()

    if grace_s <= 0.0:
        look()
        return
    _later(grace_s, look)


def _offer_again(name: str) -> None:
    """Say that the work was cancelled; the rest of the page waits for the user."""
    st.info("Cancelled. Change something, or start it again.", icon=":material/stop_circle:")
    st.button("Start again", key=f"again {name}", icon=":material/play_arrow:", on_click=_again)
    st.stop()


def _again() -> None:
    st.session_state.pop(_CANCELLED, None)


def kept(
    n_kept: int, words: str, *, key: Callable[..., Hashable] | None = None, grace_s: float = GRACE_S
) -> Callable[[Callable[P, R]], CachedFunction[P, R]]:
    """Decorate a function to compute beside the page, cancellable, and to cache its answers; see `CachedFunction`.

    Examples
    --------
    >>> doubled = kept(2, "Doubling …")(lambda x: 2 * x)
    >>> doubled.begin(4).wait(), doubled.is_answered(4), doubled.is_answered(5), doubled(4)
    (True, True, False, 8)
    """

    def decorate(function: Callable[P, R]) -> CachedFunction[P, R]:
        made: CachedFunction[P, R] = CachedFunction(function, n_kept, words, key or _described, grace_s)
        update_wrapper(made, function)
        return made

    return decorate


def _described(*arguments: object, **named: object) -> str:
    return repr((arguments, named))
