"""A method's form: which part of the recording, and its options as widgets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import streamlit as st

from app.dashboard import state
from app.dashboard.theme import capitalised, one_line
from app.dashboard.widgets import charts
from gearsig.angle import ShaftAngle
from gearsig.diagnosis import Analysis, ChannelAnalysis
from gearsig.errors import InputError
from gearsig.methods import Method, MethodOption
from gearsig.prepared import PreparedRecording

MIN_SAMPLES = 16
MOST_SIDE_BY_SIDE = 3
"""Choices that are shown side by side; more are a list."""


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
        """Return what a widget of Streamlit gives, e.g. `page.ask(column.slider, "Levels", 1, 8, 4)`.

        Parameters
        ----------
        widget : callable
        label : str
        *values, **looks
            As the widget takes them.
        key : str
            Within the page, where the label is not enough to know its state by.
        about : str
            Shown on demand.
        """
        return widget(label, *values, key=self.key(key or label), help=about or None, persist_state="session", **looks)

    def choose(
        self,
        place: Any,
        label: str,
        options: Sequence[str] | Mapping[str, Any],
        *,
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
            A mapping gives the value of what is chosen.
        default, key, about : str
            See `ask`.
        named : bool
            Whether the label is shown; screen readers get it in any case.
        as_written : bool
            Show the options as they are, without a capital first letter.
        """
        first = default or next(iter(options))
        chosen = self.ask(
            place.segmented_control,
            label,
            list(options),
            key=key,
            about=about,
            default=first,
            format_func=str if as_written else capitalised,
            label_visibility="visible" if named else "collapsed",
            required=True,
        )
        return options[chosen or first] if isinstance(options, Mapping) else str(chosen or first)

    def range(
        self, label: str, end: float, *, start: float = 0.0, shown: tuple[float, float] | None = None, name: str = ""
    ) -> tuple[float, float]:
        """Return a range of an axis that the user chooses; see `charts.choose_range`."""
        name = f"{self.name} {name}".strip()
        return charts.choose_range(label, self.analysis, end, start=start, shown=shown, name=name)

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
        low, high = self.range("Segment analysed (s)", recording.duration_s, shown=shown)
        start = min(round(low * rate), max(0, recording.n_samples - MIN_SAMPLES))
        return start, min(max(round(high * rate), start + MIN_SAMPLES), recording.n_samples)


def ask_options(page: MethodPage, method: Method, prepared: PreparedRecording) -> dict[str, Any]:
    """Return the options that the user chose, three widgets in a row and the seldom needed ones behind a click."""
    known_angle = isinstance(page.analysis.shaft_angle, ShaftAngle)
    shown = [o for o in method.options if known_angle or o.name not in ("over_angle", "over", "shaft", "pair")]
    values = {option.name: option.default for option in method.options}
    names = {o.name: o.known(prepared, page.channel.channel) if o.known is not None else () for o in shown}
    shown = [option for option in shown if option.kind != "name" or len(names[option.name]) > 1]
    few, more = ([option for option in shown if option.more is is_more] for is_more in (False, True))
    _ask_in_rows(page, few, names, values)
    if more:
        with st.expander("More settings", icon=":material/tune:"):
            _ask_in_rows(page, more, names, values)
    return values


def _ask_in_rows(
    page: MethodPage, options: Sequence[MethodOption], known: Mapping[str, Any], values: dict[str, Any]
) -> None:
    for first in range(0, len(options), 3):
        row = options[first : first + 3]
        for place, option in zip(st.columns(3, vertical_alignment="bottom"), row, strict=False):
            with place:
                values[option.name] = _asked(page, option, known[option.name])


def _asked(page: MethodPage, option: MethodOption, known: Any) -> Any:
    """Show the widget of an option and return its value."""
    if option.choices and (option.kind != "choice" or len(option.choices) > MOST_SIDE_BY_SIDE):
        return _asked_of_several(page, option)
    return _WIDGETS[option.kind](page, option, known)


def _asked_switch(page: MethodPage, option: MethodOption, known: Any) -> bool:
    del known
    if option.name == "over_angle":
        return bool(page.choose(st, option.label, {"Time": False, "Shaft angle": True}, about=option.about))
    return bool(page.ask(st.toggle, option.label, option.default, about=option.about))


def _asked_choice(page: MethodPage, option: MethodOption, known: Any) -> Any:
    del known
    by_text = {text: value for value, text in option.choices.items()}
    return page.choose(st, option.label, by_text, default=option.choices[option.default], about=option.about)


def _asked_name(page: MethodPage, option: MethodOption, known: Any) -> Any:
    return page.ask(
        st.selectbox, option.label, ["", *known], about=option.about, key=f"{option.name} {list(known)}",
        format_func=lambda name: one_line(name) or capitalised(option.empty),
    )  # fmt: skip


def _asked_of_several(page: MethodPage, option: MethodOption) -> Any:
    """Ask for one of many: of texts, or where none may be chosen, in a list; of numbers on a scale."""
    free = option.default is None
    choices = [None, *option.choices] if free else list(option.choices)

    def text(value: Any) -> str:
        return capitalised(option.empty or "automatic") if value is None else option.choices[value]

    if option.kind == "choice" or free:
        return page.ask(st.selectbox, option.label, choices, choices.index(option.default), text, about=option.about)
    return page.ask(st.select_slider, option.label, choices, option.default, text, about=option.about)


def _asked_number(page: MethodPage, option: MethodOption, known: Any) -> Any:
    number = int if option.kind == "count" else float
    low, high, first = (None if x is None else number(x) for x in (option.minimum, option.maximum, option.default))
    low = 1 if low is None and number is int else low
    placeholder = known if isinstance(known, str) else option.empty
    return page.ask(
        st.number_input, option.label, low, high, first, 1 if number is int else None, "%d" if number is int else "%g",
        about=option.about, placeholder=placeholder or None, key=f"{option.label} {placeholder}",
    )  # fmt: skip


def _asked_span(page: MethodPage, option: MethodOption, known: Any) -> tuple[float, float] | None:
    if not known:
        text = page.ask(st.text_input, option.label, placeholder=option.empty, about=option.about)
        return two_numbers(text, option.label)
    label = option.label if option.empty == "all" else f"{option.label}; all: {option.empty}"
    low, high = page.range(label, known[1], start=known[0])
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


def _asked_numbers(page: MethodPage, option: MethodOption, known: Any) -> tuple[float, ...]:
    by_text = {text: value for value, text in known.items()}
    chosen = page.ask(
        st.multiselect, option.label, list(by_text), about=option.about, accept_new_options=True, max_selections=16,
        placeholder=f"{option.empty}; choose, or type a number", key=f"{option.name} {list(by_text)}",
    )  # fmt: skip
    return tuple(by_text[text] if text in by_text else _number(text, option.label) for text in chosen)


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
