"""The page's address, which holds what is chosen on a page so that a view can be shared. Only this module touches it.

By `ask`, a widget takes its first value from the address, and its value stays there while it differs from the default.
Values that an address cannot ask for are ignored. The browser's Back and Forward restore the page of their address.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from typing import Any

import streamlit as st
from streamlit.runtime.scriptrunner import get_script_run_ctx

ZOOM = "zoom"
_ASKED, _NAMES, _PAGE, _WHOLE = "asked by the address", "names in the address", "page of the address", "whole page"
_FOLLOWED, _BARE = "choices that follow the address", "pages with an empty address"
_drawn: ContextVar[set[str] | None] = ContextVar("names in the address of what is being drawn", default=None)
_draft: ContextVar[dict[str, list[str]] | None] = ContextVar("the address as it will be", default=None)
Read = Callable[[list[str]], Any]
"""From texts of an address to a value; ValueError, KeyError or IndexError if they ask for nothing that exists."""

# --------------------
# Which part of the address belongs to what is shown.
# --------------------


@contextmanager
def of_page(page: str) -> Iterator[None]:
    """Draw a page, and then remove from its address what does not belong to what it shows.

    What the address asks for is taken once, when the page is opened: what is chosen later, such as another recording,
    starts with its own defaults. Back and Forward open the page anew, and their address overrides the session's
    choices.
    """
    bare: set[str] = st.session_state.setdefault(_BARE, set())
    # An empty address that the page did not make comes from a link to the page, which asks for nothing.
    is_followed = is_history() and (bool(_in_address()) or page in bare)
    if st.session_state.get(_PAGE) != page or is_followed:
        st.session_state[_PAGE] = page
        st.session_state[_ASKED] = _in_address()
        st.session_state[_FOLLOWED] = set() if is_followed else None
    st.session_state[_NAMES] = {}
    with of_part(_WHOLE):
        yield
    if not _in_address():
        bare.add(page)


def is_history() -> bool:
    """Whether the browser's Back or Forward made the page run; the address is then already the one they ask for."""
    return bool(getattr(get_script_run_ctx(suppress_warning=True), "is_history_navigation", False))


@contextmanager
def of_part(part: str) -> Iterator[None]:
    """Draw a part of a page that may run without the rest, as a fragment; see `of_page`."""
    is_inner = _drawn.get() is not None
    if is_inner:
        with _names_of(part):
            yield
        return
    # Each change of the address is a step for Back: all changes of one run are written together.
    token = _draft.set(_in_address())
    try:
        with _names_of(part):
            yield
        known: dict[str, set[str]] = st.session_state[_NAMES]
        # Not reached if a run is interrupted: what it did not get to is still asked for, and stays.
        if _WHOLE in known:
            forget_asked()
            kept = set().union(*known.values())
            _draft.set({name: texts for name, texts in _as_it_will_be().items() if name in kept})
    finally:
        write()
        _draft.reset(token)


@contextmanager
def _names_of(part: str) -> Iterator[None]:
    names: set[str] = set()
    is_inner, token = _drawn.get() is not None, _drawn.set(names)
    known: dict[str, set[str]] = st.session_state.setdefault(_NAMES, {})
    try:
        yield
    finally:
        _drawn.reset(token)
        if is_inner:
            known[part] = names
    known[part] = names


def write() -> None:
    """Write the address as far as it is known, so that long work starts with an address that opens it again."""
    draft = _draft.get()
    if draft is not None and draft != _in_address():
        st.query_params.from_dict(draft)


def _as_it_will_be() -> dict[str, list[str]]:
    draft = _draft.get()
    return _in_address() if draft is None else draft


def _in_address() -> dict[str, list[str]]:
    return {name: st.query_params.get_all(name) for name in st.query_params}


def _asked() -> dict[str, list[str]]:
    kept: dict[str, list[str]] = st.session_state.setdefault(_ASKED, _in_address())
    return kept


def asked(name: str) -> str:
    """Return what the address asked for under a name when the page was opened, an empty text for nothing."""
    return next(iter(all_asked(name)), "")


def all_asked(name: str) -> list[str]:
    """Return all that the address asked for under a name when the page was opened."""
    return _asked().get(name, [])


def forget_asked() -> None:
    """Take nothing more from the address that the page was opened with."""
    st.session_state[_ASKED] = {}
    st.session_state[_FOLLOWED] = None


def follows(key: str) -> bool:
    """Whether the address overrides what the session holds under a key: once after Back or Forward."""
    followed: set[str] | None = st.session_state.get(_FOLLOWED)
    if followed is None or key in followed:
        return False
    followed.add(key)
    return True


def now(name: str) -> str:
    """Return what the address holds under a name now, an empty text for nothing."""
    return next(iter(_as_it_will_be().get(name, ())), "")


def claim(name: str) -> None:
    """Record that a name in the address belongs to what is being drawn."""
    names = _drawn.get()
    if names is not None:
        names.add(name)


def put(name: str, *texts: str) -> None:
    """Write texts to the address under a name; without texts, the name is removed."""
    if texts:
        claim(name)
    changed = _as_it_will_be()
    if list(texts) == changed.get(name, []):
        return
    if texts:
        changed[name] = list(texts)
    else:
        del changed[name]
    if _draft.get() is None:
        st.query_params.from_dict(changed)


# --------------------
# Choices.
# --------------------


def chosen(key: str, name: str, options: Collection[str], first: str) -> str:
    """Return one of the options: the session's choice, else the address's; then the address always names it.

    Parameters
    ----------
    key : str
        Of the session.
    name : str
        In the address.
    options : collection of str
    first : str
        If neither names one of them.
    """
    held, texts = st.session_state.get(key), _asked().pop(name, [])
    candidates: list[str | None] = [*texts] if follows(key) else [held, *texts]
    choice = next((text for text in candidates if text is not None and text in options), first)
    st.session_state[key] = choice
    put(name, choice)
    return choice


def ask(
    widget: Callable[..., Any],
    label: str,
    *values: Any,
    name: str,
    first: Any,
    read: Read,
    written: Callable[[Any], Any] | None = None,
    key: str = "",
    **looks: Any,
) -> Any:
    """Return the value of a Streamlit widget; the address holds it while it differs from its default.

    The session keeps the choice while other views and pages are shown.

    Parameters
    ----------
    widget : callable
    label : str
    *values, **looks
        As the widget takes them, without its default.
    name : str
        In the address: short, and unique among what the page shows at a time.
    first : value
        The default; also used if the widget is empty.
    read : callable
        From texts of the address to a value, e.g. `one_of(options)`.
    written : callable or None
        From a value to the one that the address holds for it, if they differ.
    key : str
        Of its state, see `state.view_key`; empty: one made from the name and the page.
    """
    key = key or f"{name} of {st.session_state.get(_PAGE)}"
    begin(key, name, first, read)
    value = widget(label, *values, key=key, **{"persist_state": "session"} | looks)
    value = first if value is None else value
    keep(name, *((value, first) if written is None else (written(value), written(first))))
    return value


def ask_one(
    widget: Callable[..., Any], label: str, options: Collection[Any], *, first: Any = None, **looks: Any
) -> Any:
    """Return the option chosen in a widget; the default is `first`, or else the first option. See `ask`."""
    first = next(iter(options)) if first is None else first
    return ask(widget, label, options, first=first, read=one_of(options), **looks)


def ask_number(
    place: Any,
    label: str,
    low: float | None = None,
    high: float | None = None,
    *,
    name: str,
    first: float | None = None,
    whole: bool = False,
    **looks: Any,
) -> Any:
    """Return a number that the user types; an empty field means its default. See `ask`.

    Parameters
    ----------
    place : container
        Of Streamlit.
    label : str
        With the unit.
    low, high : float or None
        Limits.
    name, **looks
        See `ask`.
    first : float or None
        The default; None: the value is known elsewhere, and the field is empty.
    whole : bool
    """
    kind: type = int if whole else float
    low, high, first = (None if limit is None else kind(limit) for limit in (low, high, first))
    looks = {
        "value": None if first is None else "min",
        "step": 1 if whole else None,
        "format": "%d" if whole else "%g",
        "read": number(low, high, whole=whole),
    } | looks
    return ask(place.number_input, label, low, high, name=name, first=first, **looks)


def tabs(names: Sequence[str], *, key: str) -> Sequence[Any]:
    """Return tabs of which only the open one is drawn; the address names it as `view`."""
    begin(key, "view", names[0], one_of(names))
    made = st.tabs(names, key=key, on_change="rerun")
    keep("view", next((name for name, tab in zip(names, made, strict=True) if tab.open), names[0]), names[0])
    return made


def begin(key: str, name: str, first: Any, read: Read) -> None:
    """Give a widget without state the value that the address asks for, or else `first`; see `ask`, `of_page`."""
    texts = _asked().pop(name, [])
    if not follows(key) and key in st.session_state:
        return
    st.session_state[key] = first
    if texts:
        with suppress(ValueError, KeyError, IndexError):
            st.session_state[key] = read(texts)


def keep(name: str, value: Any, first: Any) -> None:
    """Keep a choice in the address while it differs from what the page starts with; see `ask`."""
    put(name, *([] if value == first else _texts(value)))


def _texts(value: Any) -> list[str]:
    return [text_of(item) for item in value] or [""] if isinstance(value, list) else [text_of(value)]


def text_of(value: Any) -> str:
    """Return the text that an address holds for a value.

    Examples
    --------
    >>> text_of(0.25), text_of(4.0), text_of(True), text_of((0.0, 1.5)), text_of(None)
    ('0.25', '4', '1', '0_1.5', '')
    """
    if isinstance(value, tuple):
        return "_".join(text_of(item) for item in value)
    if isinstance(value, bool | float):
        return f"{value:.12g}"
    return "" if value is None else str(value)


# --------------------
# What an address may ask for.
# --------------------

LARGEST = 2.0**53
"""Limit of a number: browsers represent integers exactly up to it."""
LONGEST = 200
"""Maximum length of a text."""


def one_of(options: Iterable[Any]) -> Read:
    """Read one of some options; of a mapping, the value whose key the text is.

    Examples
    --------
    >>> one_of(["log", "dB"])(["dB"]), one_of([None, 2, 3])(["3"]), one_of({"dB": 7})(["dB"])
    ('dB', 3, 7)
    """
    by_text = options if isinstance(options, Mapping) else {text_of(option): option for option in options}
    return lambda texts: by_text[texts[0]]


def some_of(options: Iterable[str], *, maximum: int | None = None) -> Read:
    """Read several of some options; anything else is left out.

    Examples
    --------
    >>> some_of(["a", "b"])(["b", "x"]), some_of(["a", "b"])([""])
    (['b'], [])
    """
    known = set(options)

    def read(texts: list[str]) -> list[str]:
        chosen = [text for text in dict.fromkeys(texts) if text in known]
        if not chosen and texts != [""]:
            raise ValueError(texts)
        return chosen[:maximum]

    return read


def _number(text: str) -> float:
    if "_" in text or not text.isascii():  # Python would accept these as digits, too
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
    """Read two ascending numbers, clipped to a range.

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
    """Read a user's text, of limited length."""
    if len(texts[0]) > LONGEST:
        raise ValueError(texts[0][:LONGEST])
    return texts[0]
