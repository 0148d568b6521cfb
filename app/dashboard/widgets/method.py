"""A method of `METHODS`: its form, its answer as zoomable figures, and its waveforms and tables for download."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import partial
from hashlib import blake2b
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal, ParamSpec, TypeVar

import numpy as np
import streamlit as st

from app.dashboard import address, state
from app.dashboard.cached import safe_file_name
from app.dashboard.theme import palette
from app.dashboard.widgets import charts
from app.dashboard.widgets.texts import (
    as_typed,
    capitalised,
    in_page_text,
    one_line,
    show_error,
    show_table,
    show_unknown_speed,
    show_warnings,
)
from app.dashboard.work import CachedFunction, kept
from gearsig.angle import ShaftAngle
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis, with_known_angle
from gearsig.errors import GearsigError, InputError, RefusalError
from gearsig.methods import METHODS, Method, MethodAnswer, MethodOption, Waveforms, angle_or_none, apply_method, part_of
from gearsig.plot import ChartLine, LevelPanel, LinePanel, figure_of_refusal, with_unit
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording, write_recording
from gearsig.timefreq import at_label

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

# --------------------
# The form: which part of the recording, and the method's options as widgets.
# --------------------


MIN_SAMPLES, MOST_NUMBERS = 16, 16
MOST_SIDE_BY_SIDE = 3
"""Maximum number of choices shown side by side; more become a list."""
WIDTH_PX, MOST_WIDTH_PX = 210, 440


def width_px(label: str, *texts: str, buttons_px: int = 60) -> int:
    """Return the width in pixels of a field that fits the longest of these texts beside its buttons."""
    longest = max(map(len, texts), default=0)
    return min(max(WIDTH_PX, 7 * len(label) + 30, buttons_px + 7 * longest), MOST_WIDTH_PX)


@dataclass(frozen=True)
class MethodPage:
    """A method's page for one channel; `name` distinguishes its widgets and files from those of other methods."""

    analysis: Analysis
    channel: ChannelAnalysis
    name: str

    def key(self, widget: str) -> str:
        """Key of a widget: its choice survives a change of method, but not of recording."""
        return state.view_key(f"{self.name} {widget}", self.analysis)

    def ask(
        self, widget: Callable[..., Any], label: str, *values: Any, key: str = "", about: str = "", **looks: Any
    ) -> Any:
        """Return the value of a Streamlit widget; see `address.ask`.

        Parameters
        ----------
        widget : callable
        label : str
        *values, **looks
            As `address.ask` takes them.
        key : str
            Within the page, if the label does not identify the widget's state.
        about : str
            Help text shown on demand.
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
        """Return the option chosen among a few; at first `default`, or else the first option.

        Parameters
        ----------
        place : container
        label : str
        options : sequence of str, or mapping
            A mapping gives each option's value, by which the address names it.
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
        read = address.one_of({address.text_of(value): option for option, value in values.items()})
        chosen = self.ask(
            place.segmented_control, label, list(values), key=key, name=name, first=default or next(iter(values)),
            read=read, written=values.__getitem__, about=about, format_func=str if as_written else capitalised,
            label_visibility="visible" if named else "collapsed", required=True,
        )  # fmt: skip
        return values[chosen]

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
        """Return the chosen segment between `start` and `end` of an axis, never an empty one.

        Parameters
        ----------
        label : str
            Not from a file.
        start, end : float
            Of the axis.
        shown : (float, float) or None
            Chosen at first; None: all of it.
        name : str
            In the address.
        width : int or "stretch"
            Pixels, or as much as there is.
        """
        step, (low, high) = (end - start) / 1000, shown or (start, end)
        looks: dict[str, Any] = {"step": step, "format": "%.5g", "width": width}
        low, high = self.ask(
            st.slider, label, start, end, key=f"{label} {start!r} to {end!r}", name=name,
            first=(max(start, low), min(end, high)), read=address.span(start, end), **looks,
        )  # fmt: skip
        return (low, high) if high > low else (max(start, high - step), min(end, high + step))

    def segment(self, *, n_first: int) -> tuple[int, int]:
        """Let the user choose the segment to analyse; return its first sample and the one after its last.

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
    """Return the options that the user chose in a row of widgets; rarely needed ones are shown in `more_of`."""
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
    """Return the option with the default that the analysis of the whole recording suggests, if any."""
    value = None if option.suggested is None else option.suggested(page.analysis)
    return option if value is None else replace(option, default=float(f"{value:.5g}"))


def _ask_in_rows(
    page: MethodPage, options: Sequence[MethodOption], known: Mapping[str, Any], values: dict[str, Any], *, key: str
) -> None:
    """Ask in a row that wraps: each widget is as wide as it needs to be, so that no choice is cut off.

    In a narrow window the page's style limits a field to half of the row.
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
    """Ask for one of many: a list for texts, or if none may be chosen; otherwise a slider for numbers."""
    free = option.default is None  # listed as an empty text: Streamlit takes None for no choice
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
    whole, low, first = option.kind == "count", option.minimum, option.default
    low = 1 if low is None and whole else low
    placeholder = (known if isinstance(known, str) else option.empty) or address.text_of(first)
    return address.ask_number(
        st, option.label, low, option.maximum, name=option.name, first=first, whole=whole, help=option.about or None,
        placeholder=placeholder or None, key=page.key(f"{option.label} {placeholder}"),
        value=None, read=address.number(low or 0, option.maximum, whole=whole),
        width=width_px(option.label, placeholder, buttons_px=110),
    )  # fmt: skip


def _asked_span(page: MethodPage, option: MethodOption, known: Any) -> tuple[float, float] | None:
    if not known:
        text = page.ask(
            st.text_input, option.label, name=option.name, first="", read=_two_numbers_text,
            placeholder=option.empty, about=option.about, width=width_px(option.label, option.empty),
        )  # fmt: skip
        return two_numbers(text, option.label)
    label = option.label if option.empty == "all" else f"{option.label}; all: {option.empty}"
    low, high = page.range(label, known[1], start=known[0], name=option.name, width=width_px(label))
    return None if (low, high) == tuple(known) else (low, high)


def two_numbers(text: str | None, label: str) -> tuple[float, float] | None:
    """Return the two numbers of a text such as "0.001, 0.004", None if the field is empty."""
    if not text or not text.strip():
        return None
    try:
        first, second = (float(part) for part in text.replace(";", ",").split(","))
    except ValueError:
        raise InputError(f"{label} is {text!r}", allowed="two numbers, for example 0.001, 0.004") from None
    return first, second


def _two_numbers_text(texts: list[str]) -> str:
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
        raise InputError(f"{text!r} is not a number", where=label, allowed="numbers, such as 29 or 0.42") from None


_WIDGETS: dict[str, Callable[[MethodPage, MethodOption, Any], Any]] = {
    "switch": _asked_switch,
    "choice": _asked_choice,
    "name": _asked_name,
    "number": _asked_number,
    "count": _asked_number,
    "span": _asked_span,
    "numbers": _asked_numbers,
}


# --------------------
# The answer.
# --------------------


P = ParamSpec("P")
R = TypeVar("R")
OVER_TIME, OVER_ANGLE = (".csv", ".h5", ".wav", ".parquet", ".mat"), (".csv",)
"""File formats of waveforms: those over time are recordings, those over angle plain columns."""
_SPOKEN = re.compile(r"(\*\*| )")
"""Splits a text, in which ** makes bold, into words."""
MEMORY_LIMIT_MB, N_PREPARED = 256.0, 4
"""Memory limit for what is kept of one segment, and the number of segments kept."""


def cached(n_kept: int, words: str) -> Callable[[Callable[P, R]], CachedFunction[P, R]]:
    """Compute a function beside the page and cache its latest answers by the content of its arguments.

    Answers are immutable, so sessions may share them. Streamlit's own hash samples large arrays, so two segments of one
    recording could be confused; here arguments are hashed whole, at about 1 GB/s.

    Parameters
    ----------
    n_kept : int
        Number of answers kept; most are several times as long as the segment.
    words : str
        Shown while it computes.

    Examples
    --------
    >>> separated = cached(4, "Separating the orders …")(track_vold_kalman)  # doctest: +SKIP
    """
    return kept(n_kept, words, key=lambda *arguments, **named: content_key((arguments, named)))


def content_key(value: object) -> str:
    """Return a hash of the content of settings, arrays and dataclasses of them."""
    digest = blake2b(digest_size=16)
    _feed(digest, value)
    return digest.hexdigest()


def _feed(digest: blake2b, value: object) -> None:
    if isinstance(value, np.ndarray):
        digest.update(repr((value.shape, value.dtype.str)).encode())
        digest.update(np.ascontiguousarray(value).data)
    elif is_dataclass(value) and not isinstance(value, type):
        digest.update(type(value).__name__.encode())
        for part in fields(value):
            _feed(digest, getattr(value, part.name))
    elif isinstance(value, tuple | list):
        digest.update(f"{len(value)} of".encode())
        for part in value:
            _feed(digest, part)
    elif isinstance(value, Mapping):
        _feed(digest, list(value.items()))
    else:
        digest.update(f"{value!r};".encode())


@cached(N_PREPARED, "Preparing …")
def _segment(part: Recording, angle: ShaftAngle | CannotTell) -> tuple[PreparedRecording, Lock]:
    """Return a segment that methods share, and the lock that lets one at a time use it."""
    return with_known_angle(part, angle, memory_limit_mb=MEMORY_LIMIT_MB), Lock()


@cached(8, "Computing …")
def answer_of(
    name: str, part: Recording, angle: ShaftAngle | CannotTell, channel: str, options: Mapping[str, Any]
) -> MethodAnswer:
    """Return a method's answer; its intermediate results for a segment are kept for other options."""
    prepared, lock = _segment(part, angle)
    with lock:
        return apply_method(name, prepared, channel, **options)


def show_method(name: str, analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show a method's form and its answer for one channel."""
    st.caption(METHODS[name].about)
    page = MethodPage(analysis, channel, name)
    try:
        _show(name, page)
    except RefusalError as error:
        angle = analysis.shaft_angle
        if isinstance(angle, CannotTell) and error.reason == angle.reason:
            show_unknown_speed(angle)
        else:
            _show_refusal(error)
            figure = figure_of_refusal(error)
            if figure is not None:
                st.caption("What was examined:")
                charts.show_figure(figure, "What was examined", page.key("looked at"))
    except GearsigError as error:
        show_error(error)


def _show_refusal(error: RefusalError) -> None:
    """Show that the recording allows no answer, which is a result like any other and not the user's mistake."""
    reason = capitalised(in_page_text(error.reason).rstrip("."))
    lines = [f"**This segment does not allow an answer.** {as_typed(reason)}."]
    if error.remedy:
        lines.append(f"What to do: {as_typed(in_page_text(error.remedy).rstrip('.'))}.")
    st.info("\n\n".join(lines), icon=":material/help:")


def _show(name: str, page: MethodPage) -> None:
    method, analysis = METHODS[name], page.analysis
    recording = analysis.recording if analysis.rig is None else analysis.recording.with_rig(analysis.rig)
    whole, rate = (
        with_known_angle(recording, analysis.shaft_angle, memory_limit_mb=MEMORY_LIMIT_MB),
        recording.sampling_rate_hz,
    )
    few = st.container()
    more = st.expander("Segment and further settings", icon=":material/tune:")
    with more:
        start, stop = page.segment(n_first=method.n_first)
    analysed = st.empty()
    with few:
        options = ask_options(page, method, part_of(whole, start / rate, stop / rate), more)
    # a segment that would take longer than a few seconds is shortened, and the page says so
    end = min(stop, start + (method.n_max if method.limit is None else min(method.n_max, method.limit(options))))
    text = f"Analysed: {start / rate:.4g} to {end / rate:.4g} s of {recording.duration_s:.4g} s, {end - start} samples"
    analysed.caption(f"{text}{'; a longer one would take too long.' if end < stop else '.'}")
    part = part_of(whole, start / rate, end / rate, page.channel.channel)
    angle = angle_or_none(part) or (
        analysis.shaft_angle
        if isinstance(analysis.shaft_angle, CannotTell)
        else CannotTell("speed", "the shaft's angle is not known in this segment", "choose another segment")
    )
    answer = answer_of(name, part.recording, angle, page.channel.channel, options)
    show_answer(page, answer, angle, more)


def show_answer(page: MethodPage, answer: MethodAnswer, angle: ShaftAngle | CannotTell, more: Any) -> None:
    """Show what was found: words, figures, waveforms, tables."""
    for fact in answer.facts:
        st.markdown("".join(part if part in (" ", "**") else as_typed(part) for part in _SPOKEN.split(fact)))
    show_warnings(answer.warnings)
    span = 60.0
    if any(isinstance(panel, LevelPanel) and panel.span is None for panel in answer.panels):
        slider, read = more.slider, address.number(20, 120, whole=True)
        span = float(page.ask(slider, "Colour range (dB)", 20, 120, step=5, name="colours", first=60, read=read))
    for number, panel in enumerate(answer.panels):
        charts.show_panel(panel, page.key(f"figure {number} {panel.x} {panel.y}"), span)
    if answer.path is not None:
        _show_space(page, answer.path)
    elif not answer.panels and answer.waveforms is None:
        charts.show_figure(answer.draw(), f"{answer.caption}, {answer.channel}", page.key("figure"))
    show_warnings(answer.notes, quiet=True)
    if answer.waveforms is not None and "signal" in answer.waveforms.columns:
        _show_waveforms(page, answer.waveforms, angle)
    for what, table in answer.tables.items():
        if len(next(iter(table.values()))) <= 200:
            with st.expander(f"{what.capitalize()} ({len(next(iter(table.values())))})"):
                show_table(table, number=".4g", width="stretch")
    _offer(page, answer)


def _show_space(page: MethodPage, path: np.ndarray) -> None:
    from plotly.graph_objects import Figure

    figure, (x, y, z) = Figure(), path.T
    line = {"width": 1.5, "color": palette().measured}
    figure.add_scatter3d(x=x, y=y, z=z, mode="lines", line=line, opacity=0.5, hoverinfo="skip")
    titles = {f"{axis}axis": {"title": {"text": f"x(t + {k}τ)"}} for k, axis in enumerate("xyz")}
    figure.update_layout(
        height=560, margin=dict.fromkeys("lrtb", 0), showlegend=False, scene={**titles, "aspectmode": "cube"}
    )
    st.plotly_chart(figure, width="stretch", key=page.key("space"), config={"displaylogo": False}, alt="Path in space")
    st.caption("The last points of the path. Drag to rotate it.")


# --------------------
# Waveforms.
# --------------------


def first_length(page: MethodPage, waveforms: Waveforms, angle: ShaftAngle | CannotTell) -> float:
    """Return the length of a waveform's first view in s or revolutions: five mesh cycles, so that their shape is seen.

    Three revolutions if no mesh is known, 3000 samples if the speed is not known; or what the method asks for.
    """
    if waveforms.first_length is not None:
        return waveforms.first_length
    if isinstance(angle, CannotTell):
        return 3000.0 / waveforms.rate
    rig = page.analysis.rig
    orders = [rig.mesh_order(pair, angle.shaft) for pair in rig.pairs] if rig is not None and rig.shafts else []
    revolutions = next((5.0 / order for order in orders if order), 3.0)
    return revolutions if waveforms.axis == "order" else revolutions * 60.0 / max(angle.mean_speed_rpm, 1e-9)


def _show_waveforms(page: MethodPage, waveforms: Waveforms, angle: ShaftAngle | CannotTell) -> None:
    """Draw one waveform over the signal, and what remains of the signal below."""
    names = [name for name in waveforms.columns if name not in ("signal", waveforms.residual)]
    left, right = st.columns((1, 2))
    chosen = waveforms.shown_first or names[0]
    if len(names) > 1:
        looks: dict[str, Any] = {"key": f"waveform of {names} {chosen}", "name": "waveform", "format_func": one_line}
        chosen = page.ask(left.selectbox, "Waveform of", names, first=chosen, read=address.one_of(names), **looks)
    start, end = waveforms.start, waveforms.end
    length = min(first_length(page, waveforms, angle), end - start)
    first = (start + end - length) / 2.0
    with right if len(names) > 1 else st.container():
        label = f"Waveforms shown ({'s' if waveforms.axis == 'frequency' else 'revolutions'})"
        limits = page.range(label, end, start=start, shown=(first, first + length), name="shown")
    low = min(max(0, int((limits[0] - start) * waveforms.rate)), max(0, waveforms.n_samples - 2))
    part = slice(low, low + max(2, int(np.ceil((limits[1] - limits[0]) * waveforms.rate)) + 1))
    at, axis = waveforms.at(part), at_label(waveforms.axis, waveforms.shaft)
    rows = [("signal", {"signal": charts.QUIET, chosen: charts.MEASURED}, 240)]
    if waveforms.residual:
        rows.append(("residual", {waveforms.residual: charts.FAULT}, 180))
    for label, colours, height_px in rows:
        lines = [ChartLine(at, waveforms.columns[c][part], c, colours[c]) for c in colours]
        below = axis if label == rows[-1][0] else ""
        panel = LinePanel(lines, below, with_unit(label, waveforms.unit), x_limits=limits)
        charts.show_lines(panel, page.key(f"waveforms {label}"), height_px=height_px, legend=True)


# --------------------
# Downloads: complete, not thinned as on the page.
# --------------------


def _offer(page: MethodPage, answer: MethodAnswer) -> None:
    """Offer waveforms in a choice of formats, and tables as CSV."""
    waveforms = answer.waveforms
    with (
        st.container(horizontal=True, horizontal_alignment="right"),
        st.popover("Download", icon=":material/download:"),
    ):
        if waveforms is not None:
            endings = OVER_TIME if waveforms.axis == "frequency" else OVER_ANGLE
            key = page.key(f"format {endings[-1]}")
            ending = st.selectbox("Format", endings, key=key, persist_state="session")
            n = len(waveforms.columns) * waveforms.n_samples
            label = f"Waveforms: {len(waveforms.columns)} × {waveforms.n_samples} samples"
            _offer_file(page, label, partial(waveforms_file, waveforms, ending), "waveforms", ending)
            if ending == ".csv" and n > 2_000_000:
                st.caption(f"About {20e-6 * n:.0f} MB as CSV, and less than half of that as .h5.")
        for what, table in {"table": answer.table, **answer.tables}.items():
            _offer_file(page, f"{what.capitalize()} (CSV)", partial(table_csv, table), what, ".csv")


def _offer_file(page: MethodPage, label: str, content: Callable[[], bytes], what: str, ending: str) -> None:
    source = safe_file_name(page.analysis.recording.provenance.source).split(".")[0]
    name = f"{source}-{safe_file_name(f'{page.name}-{what}')}{ending}"
    charts.download(label, content, name, key=page.key(f"download {what}"))


def waveforms_file(waveforms: Waveforms, ending: str) -> bytes:
    """Return a recording of the waveforms in a file's format, or columns over angle.

    Raises
    ------
    InputError
        If the format cannot hold them.
    """
    if waveforms.axis == "order":
        return table_csv(waveforms.table())
    with TemporaryDirectory(prefix="gearsig-") as folder:
        path = Path(folder) / f"waveforms{ending}"
        write_recording(waveforms.recording(), path)
        return path.read_bytes()


def table_csv(columns: Mapping[str, ArrayLike]) -> bytes:
    """Return columns of equal length as CSV, numbers with all their digits."""
    import pyarrow as pa
    from pyarrow import csv

    buffer = BytesIO()
    csv.write_csv(pa.table({name: pa.array(np.asarray(values)) for name, values in columns.items()}), buffer)
    return buffer.getvalue()
