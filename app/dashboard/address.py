"""The page's address: what is chosen on a page stands in it, so that a view can be sent. The one place that touches it.

A widget takes its first value from the address by `ask`, and stands in it while it differs from its default. Values
that an address cannot ask for are ignored.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any

import streamlit as st

ZOOM = "zoom"
_ASKED, _NAMES, _PAGE, _WHOLE = "asked by the address", "names in the address", "page of the address", "whole page"
_drawn: ContextVar[set[str] | None] = ContextVar("names in the address of what is being drawn", default=None)
Read = Callable[[list[str]], Any]
"""From texts of an address to a value; ValueError, KeyError or IndexError where they ask for nothing that there is."""

# --------------------
# What of the address belongs to what is shown.
# --------------------


@contextmanager
def of_page(page: str) -> Iterator[None]:
    """Draw a page: by its end, what stands in its address and is not of what it shows is taken out.

    What the address asks for is taken when the page is opened, and once: what is chosen later, another recording say,
    begins with its own defaults.
    """
    if st.session_state.get(_PAGE) != page:
        st.session_state[_PAGE] = page
        st.session_state[_ASKED] = _in_address()
    st.session_state[_NAMES] = {}
    with of_part(_WHOLE):
        yield


@contextmanager
def of_part(part: str) -> Iterator[None]:
    """Draw a part of a page that may run without the rest of it, as a fragment; see `of_page`."""
    names: set[str] = set()
    is_inner, token = _drawn.get() is not None, _drawn.set(names)
    known: dict[str, set[str]] = st.session_state.setdefault(_NAMES, {})
    try:
        yield
    finally:
        _drawn.reset(token)
        if is_inner:
            known[part] = names
    # Not reached where a run is broken off: what it did not come to is still asked for, and stays.
    known[part] = names
    if is_inner or _WHOLE not in known:
        return
    forget_asked()
    kept = set().union(*known.values())
    for name in [name for name in st.query_params if name not in kept]:
        del st.query_params[name]


def _in_address() -> dict[str, list[str]]:
    return {name: st.query_params.get_all(name) for name in st.query_params}


def _asked() -> dict[str, list[str]]:
    found: dict[str, list[str]] = st.session_state.setdefault(_ASKED, _in_address())
    return found


def asked(name: str) -> str:
    """Return what the address asked for when the page was opened, an empty text for nothing."""
    return next(iter(_asked().get(name, ())), "")


def forget_asked() -> None:
    """Take nothing more from the address that the page was opened with."""
    st.session_state[_ASKED] = {}


def now(name: str) -> str:
    """Return what stands in the address now, an empty text for nothing."""
    return str(st.query_params.get(name, ""))


def claim(name: str) -> None:
    """Say that what stands in the address under a name is of what is being drawn."""
    names = _drawn.get()
    if names is not None:
        names.add(name)


def put(name: str, *texts: str) -> None:
    """Keep texts in the address; none takes the name out."""
    if texts:
        claim(name)
    if list(texts) == st.query_params.get_all(name):
        return
    if texts:
        st.query_params[name] = list(texts)
    else:
        del st.query_params[name]


# --------------------
# Choices.
# --------------------


def chosen(key: str, name: str, options: Collection[str], first: str) -> str:
    """Return one of some options: the session's choice, else the address', which then always names it.

    Parameters
    ----------
    key : str
        Of the session.
    name : str
        In the address.
    options : collection of str
    first : str
        Where neither names one of them.
    """
    wanted = (st.session_state.get(key), *_asked().pop(name, ()))
    choice = next((text for text in wanted if text in options), first)
    st.session_state[key] = choice
    put(name, choice)
    return choice


def ask(
    widget: Callable[..., Any], label: str, *values: Any, key: str, name: str, first: Any, read: Read, **looks: Any
) -> Any:
    """Return what a widget of Streamlit gives; it stands in the address while it differs from its default.

    Parameters
    ----------
    widget : callable
    label : str
    *values, **looks
        As the widget takes them, without its default.
    key : str
        Of its state, see `state.view_key`.
    name : str
        In the address: short, and unique among what the page shows at a time.
    first : value
        The default; also where the widget is empty.
    read : callable
        From texts of the address to a value, e.g. `one_of(options)`.
    """
    begin(key, name, first, read)
    value = widget(label, *values, key=key, **looks)
    value = first if value is None else value
    keep(name, value, first)
    return value


def ask_one(
    widget: Callable[..., Any], label: str, options: Collection[Any], *, first: Any = None, **looks: Any
) -> Any:
    """Return one of some options as a widget gives it; without a default the first is chosen at first. See `ask`."""
    first = next(iter(options)) if first is None else first
    return ask(widget, label, options, first=first, read=one_of(options), **looks)


def tabs(names: Sequence[str], *, key: str) -> Sequence[Any]:
    """Return tabs of which only the open one is drawn; the address names it as `view`."""
    begin(key, "view", names[0], one_of(names))
    made = st.tabs(names, key=key, on_change="rerun")
    keep("view", next((name for name, tab in zip(names, made, strict=True) if tab.open), names[0]), names[0])
    return made


def begin(key: str, name: str, first: Any, read: Read) -> None:
    """Give a widget that has no state yet the value that the address asks for, else `first`; see `ask`."""
    texts = _asked().pop(name, [])
    if key in st.session_state:
        return
    st.session_state[key] = first
    if texts:
        with suppress(ValueError, KeyError, IndexError):
            st.session_state[key] = read(texts)


def keep(name: str, value: Any, first: Any) -> None:
    """Keep a choice in the address while it differs from what the page starts with; see `ask`."""
    put(name, *([] if value == first else _texts(value)))


def _texts(value: Any) -> list[str]:
    return [text_of(one) for one in value] or [""] if isinstance(value, list) else [text_of(value)]


def text_of(value: Any) -> str:
    """Return what an address says of a value.

    Examples
    --------
    >>> text_of(0.25), text_of(4.0), text_of(True), text_of((0.0, 1.5)), text_of(None)
    ('0.25', '4', '1', '0_1.5', '')
    """
    if isinstance(value, tuple):
        return "_".join(text_of(one) for one in value)
    if isinstance(value, bool | float):
        return f"{value:.12g}"
    return "" if value is None else str(value)


# --------------------
# What an address may ask for.
# --------------------

LARGEST = 2.0**53
"""Of a number: browsers count exactly up to it."""
LONGEST = 200
"""Of a text."""


def one_of(options: Iterable[Any]) -> Read:
    """Read one of some options; of a mapping its value, by the text that it stands under.

    Examples
    --------
    >>> one_of(["log", "dB"])(["dB"]), one_of([None, 2, 3])(["3"]), one_of({"dB": 7})(["dB"])
    ('dB', 3, 7)
    """
    by_text = options if isinstance(options, Mapping) else {text_of(option): option for option in options}
    return lambda texts: by_text[texts[0]]


def some_of(options: Iterable[str], *, most: int | None = None) -> Read:
    """Read several of some options; what is none of them is left out.

    Examples
    --------
    >>> some_of(["a", "b"])(["b", "x"]), some_of(["a", "b"])([""])
    (['b'], [])
    """
    known = set(options)

    def read(texts: list[str]) -> list[str]:
        found = [text for text in dict.fromkeys(texts) if text in known]
        if not found and texts != [""]:
            raise ValueError(texts)
        return found[:most]

    return read


def _number(text: str) -> float:
    if "_" in text or not text.isascii():  # which Python would take for digits, too
        raise ValueError(text)
    return float(text)


def number(low: float | None = None, high: float | None = None, *, whole: bool = False) -> Read:
    """Read a number within limits.

    Examples
    --------
    >>> number(1, 8, whole=True)(["4"]), number()(["0.5"])
    (4, 0.5)
    """

    def read(texts: list[str]) -> float:
        value = _number(texts[0])
        is_within = (low is None or value >= low) and (high is None or value <= high)
        if not is_within or not abs(value) < LARGEST or (whole and value != int(value)):
            raise ValueError(texts)
        return int(value) if whole else value

    return read


def span(start: float, end: float) -> Read:
    """Read two ascending numbers, as far as they lie between two others.

    Examples
    --------
    >>> span(0.0, 5.0)(["1_9"])
    (1.0, 5.0)
    """

    def read(texts: list[str]) -> tuple[float, float]:
        low, high = (min(max(_number(word), start), end) for word in texts[0].split("_"))
        if not low < high:
            raise ValueError(texts)
        return low, high

    return read


def words(texts: list[str]) -> str:
    """Read a text of the user's."""
    if len(texts[0]) > LONGEST:
        raise ValueError(texts[0][:LONGEST])
    return texts[0]
