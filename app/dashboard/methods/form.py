"""A method's form: which part of the recording, and its options as widgets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import streamlit as st

from app.dashboard import address, state
from app.dashboard.theme import capitalised, one_line
from app.dashboard.widgets import charts
from gearsig.angle import ShaftAngle
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import InputError
from gearsig.methods import Method, MethodOption
from gearsig.prepared import PreparedRecording

MIN_SAMPLES, MOST_NUMBERS = 16, 16
MOST_SIDE_BY_SIDE = 3
"""Choices that are shown side by side; more are a list."""
WIDTH_PX, MOST_WIDTH_PX = 210, 440


def width_px(label: str, *texts: str, buttons_px: int = 60) -> int:
    """Return the width of a field in which the longest of these texts can be read beside its buttons."""
    longest = max(map(len, texts), default=0)
    return min(max(WIDTH_PX, 7 * len(label) + 30, buttons_px + 7 * longest), MOST_WIDTH_PX)


@dataclass(frozen=True)
class MethodPage:
    """A method's page for one channel; `name` tells its widgets and files from those of other methods."""

    analysis: Analysis
    channel: ChannelAnalysis
    name: str

    def key(self, widget: str) -> str:
        """Key of a widget: its choice lasts while another method is shown, not when another recording is open."""
        return state.view_key(f"{self.name} {widget}", self.analysis)

    def ask(
        self, widget: Callable[..., Any], label: str, *values: Any, key: str = "", about: str = "", **looks: Any
    ) -> Any:
        """Return what a widget of Streamlit gives; see `address.ask`.

        Parameters
        ----------
        widget : callable
        label : str
        *values, **looks
            As `address.ask` takes them.
        key : str
            Within the page, where the label is not enough to know its state by.
        about : str
            Shown on demand.
        """
        looks |= {"key": self.key(key or label), "help": about or None, "persist_state": "session"}
        return address.ask(widget, label, *values, **looks)

    def choose(
        self,
        place: Any,
        label: str,
        options: Sequence[str] | Mapping[str, Any],
        *,
        name: str,
        default: str = "",
        key: str = "",
        about: str = "",
        named: bool = True,
        as_written: bool = False,
    ) -> Any:
        """Return the option chosen among few, `default` or else the first one at first.

        Parameters
        ----------
        place : container
        label : str
        options : sequence of str, or mapping
            A mapping gives the value of what is chosen, which the address names it by.
        name : str
            In the address.
        default, key, about : str
            See `ask`.
        named : bool
            Whether the label is shown; screen readers get it in any case.
        as_written : bool
            Show the options as they are, without a capital first letter.
        """
        values = options if isinstance(options, Mapping) else {option: option for option in options}
        first, key = default or next(iter(values)), self.key(key or label)
        address.begin(key, name, first, address.one_of({address.text_of(values[option]): option for option in values}))
        chosen = place.segmented_control(
            label,
            list(values),
            key=key,
            help=about or None,
            persist_state="session",
            format_func=str if as_written else capitalised,
            label_visibility="visible" if named else "collapsed",
            required=True,
        )
        value = values[chosen or first]
        address.keep(name, value, values[first])
        return value

    def range(
        self,
        label: str,
        end: float,
        *,
        start: float = 0.0,
        shown: tuple[float, float] | None = None,
        name: str,
        width: int | Literal["stretch"] = "stretch",
    ) -> tuple[float, float]:
        """Return a range of an axis that the user chooses, `name` in the address; see `charts.choose_range`."""
        return charts.choose_range(
            label, self.analysis, end, start=start, shown=shown, name=self.name, in_address=name, width=width
        )

    def segment(self, *, n_first: int) -> tuple[int, int]:
        """Let the user choose what is analysed; return its first sample and the one after its last.

        Parameters
        ----------
        n_first : int
            Samples from the start that are chosen at first.
        """
        recording = self.analysis.recording
        rate = recording.sampling_rate_hz
        shown = (0.0, min(recording.duration_s, n_first / rate))
        low, high = self.range("Segment analysed (s)", recording.duration_s, shown=shown, name="segment")
        start = min(round(low * rate), max(0, recording.n_samples - MIN_SAMPLES))
        return start, min(max(round(high * rate), start + MIN_SAMPLES), recording.n_samples)


def ask_options(page: MethodPage, method: Method, prepared: PreparedRecording, more_of: Any) -> dict[str, Any]:
    """Return the options that the user chose, a few widgets in a row; the seldom needed ones stand in `more_of`."""
    known_angle = isinstance(page.analysis.shaft_angle, ShaftAngle)
    shown = [o for o in method.options if known_angle or o.name not in ("over_angle", "over", "shaft", "pair")]
    values = {option.name: option.default for option in method.options}
    names = {o.name: o.known(prepared, page.channel.channel) if o.known is not None else () for o in shown}
    shown = [_as_suggested(option, page) for option in shown if option.kind != "name" or len(names[option.name]) > 1]
    few, more = ([option for option in shown if option.more is is_more] for is_more in (False, True))
    _ask_in_rows(page, few, names, values, key="settings")
    with more_of:
        _ask_in_rows(page, more, names, values, key="settings-more")
    return values


def _as_suggested(option: MethodOption, page: MethodPage) -> MethodOption:
    """Return an option whose default is what the analysis of the whole recording suggests, where it does."""
    value = None if option.suggested is None else option.suggested(page.analysis)
    return option if value is None else replace(option, default=float(f"{value:.5g}"))


def _ask_in_rows(
    page: MethodPage, options: Sequence[MethodOption], known: Mapping[str, Any], values: dict[str, Any], *, key: str
) -> None:
    """Ask in a row that wraps: each widget is as wide as it needs to be, so that no choice is cut off.

    In a narrow window a field takes at most half of the row, by the page's style.
    """
    if not options:
        return
    with st.container(horizontal=True, vertical_alignment="bottom", gap="small", key=key):
        for option in options:
            values[option.name] = _asked(page, option, known[option.name])


def _asked(page: MethodPage, option: MethodOption, known: Any) -> Any:
    """Show the widget of an option and return its value."""
    if option.choices and (option.kind != "choice" or len(option.choices) > MOST_SIDE_BY_SIDE):
        return _asked_of_several(page, option)
    return _WIDGETS[option.kind](page, option, known)


def _asked_switch(page: MethodPage, option: MethodOption, known: Any) -> bool:
    del known
    if option.name == "over_angle":
        ways = {"Time": False, "Shaft angle": True}
        return bool(page.choose(st, option.label, ways, name=option.name, about=option.about))
    first, either = bool(option.default), address.one_of((False, True))
    return bool(page.ask(st.toggle, option.label, name=option.name, first=first, read=either, about=option.about))


def _asked_choice(page: MethodPage, option: MethodOption, known: Any) -> Any:
    del known
    by_text = {text: value for value, text in option.choices.items()}
    first = option.choices[option.default]
    return page.choose(st, option.label, by_text, name=option.name, default=first, about=option.about)


def _asked_name(page: MethodPage, option: MethodOption, known: Any) -> Any:
    names = ["", *known]
    return page.ask(
        st.selectbox, option.label, names, name=option.name, first="", read=address.one_of(names), about=option.about,
        key=f"{option.name} {list(known)}", format_func=lambda name: one_line(name) or capitalised(option.empty),
        width=width_px(option.label, option.empty, *known),
    )  # fmt: skip


def _asked_of_several(page: MethodPage, option: MethodOption) -> Any:
    """Ask for one of many: of texts, or where none may be chosen, in a list; of numbers on a scale."""
    free = option.default is None  # of which an empty text stands in the list: Streamlit takes None for no choice
    choices = ["", *option.choices] if free else list(option.choices)
    widget: Any = st.selectbox if option.kind == "choice" or free else st.select_slider

    def text(value: Any) -> str:
        return capitalised(option.empty or "automatic") if free and value == "" else option.choices[value]

    chosen = page.ask(
        widget, option.label, choices, name=option.name, first="" if free else option.default,
        read=address.one_of(choices), format_func=text, about=option.about,
        width=width_px(option.label, *map(text, choices)),
    )  # fmt: skip
    return None if free and chosen == "" else chosen


def _asked_number(page: MethodPage, option: MethodOption, known: Any) -> Any:
    whole = option.kind == "count"
    number = int if whole else float
    low, high, first = (None if x is None else number(x) for x in (option.minimum, option.maximum, option.default))
    low = 1 if low is None and whole else low
    placeholder = (known if isinstance(known, str) else option.empty) or address.text_of(first)
    # None: a field that is emptied stays empty, and stands for the default
    return page.ask(
        st.number_input, option.label, low, high, None, 1 if whole else None, "%d" if whole else "%g",
        name=option.name, first=first, read=address.number(low or 0, high, whole=whole), about=option.about,
        placeholder=placeholder or None, key=f"{option.label} {placeholder}",
        width=width_px(option.label, placeholder, buttons_px=110),
    )  # fmt: skip


def _asked_span(page: MethodPage, option: MethodOption, known: Any) -> tuple[float, float] | None:
    if not known:
        text = page.ask(
            st.text_input, option.label, name=option.name, first="", read=_two_numbers_in_words,
            placeholder=option.empty, about=option.about, width=width_px(option.label, option.empty),
        )  # fmt: skip
        return two_numbers(text, option.label)
    label = option.label if option.empty == "all" else f"{option.label}; all: {option.empty}"
    low, high = page.range(label, known[1], start=known[0], name=option.name, width=width_px(label))
    return None if (low, high) == tuple(known) else (low, high)


def two_numbers(text: str | None, label: str) -> tuple[float, float] | None:
    """Return the numbers of "0.001, 0.004", None where the field is empty."""
    if not text or not text.strip():
        return None
    try:
        first, second = (float(part) for part in text.replace(";", ",").split(","))
    except ValueError:
        raise InputError(f"{label} is {text!r}", allowed="two numbers, for example 0.001, 0.004") from None
    return first, second


def _two_numbers_in_words(texts: list[str]) -> str:
    two_numbers(texts[0], "")
    return address.words(texts)


def _asked_numbers(page: MethodPage, option: MethodOption, known: Any) -> tuple[float, ...]:
    by_text = {text: value for value, text in known.items()}

    def value_of(text: str) -> float:
        return by_text[text] if text in by_text else _number(text, option.label)

    def read(texts: list[str]) -> list[str]:
        is_positive = address.number(0.0)
        return [text for text in dict.fromkeys(texts) if text in by_text or is_positive([text])][:MOST_NUMBERS]

    chosen = page.ask(
        st.multiselect, option.label, list(by_text), name=option.name, first=[], read=read,
        about=f"{option.about} Choose, or type a number.".lstrip(),
        accept_new_options=True, max_selections=MOST_NUMBERS, key=f"{option.name} {list(by_text)}",
        placeholder=option.empty, width=width_px(option.label, option.empty),
    )  # fmt: skip
    return tuple(value_of(text) for text in chosen)


def _number(text: str, label: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise InputError(f"{text!r} is no number", where=label, allowed="numbers, such as 29 or 0.42") from None


_WIDGETS: dict[str, Callable[[MethodPage, MethodOption, Any], Any]] = {
    "switch": _asked_switch,
    "choice": _asked_choice,
    "name": _asked_name,
    "number": _asked_number,
    "count": _asked_number,
    "span": _asked_span,
    "numbers": _asked_numbers,
}
