"""The gap page: from recordings and a simulator to the effect it lacks; where, which, how far, what next."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, partial
from hashlib import sha256
from math import isfinite
from pathlib import Path
from time import monotonic
from typing import IO
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np
import streamlit as st

import gearsig.gap
from app.dashboard import address, state
from app.dashboard.gap.choice import Choice, choose, files_of, set_alike, simulator_title
from app.dashboard.widgets.charts import (
    QUIET,
    Ring,
    download,
    offer_page,
    show_differences,
    show_lines,
    show_picture,
    show_rows,
    zoomed_range,
)
from app.dashboard.widgets.spectrum import show_revolutions
from app.dashboard.widgets.texts import as_typed, capitalised, show_checks, show_warnings, show_wrapping_table
from app.dashboard.widgets.verdict import Colour
from app.gap_job import JSON, PAGE, TWIN, Job, private_folder
from gearsig.cache import cache_folder, keep
from gearsig.errors import GearsigError
from gearsig.formatting import odds_text, percent
from gearsig.gap import (
    AngleCurves,
    AverageCurves,
    GapOutcome,
    GapReport,
    SpectrumCurves,
    against_reference,
    gap_by_order,
    is_beyond,
)
from gearsig.plot import ChartLine, ChartRow, LinePanel, RowPanel, figure_svg, with_unit
from gearsig.report import (
    CHECK_FIRST,
    CauseRow,
    GapFigure,
    Question,
    cause_rows,
    condition_advice,
    condition_rows,
    floors_text,
    gap_figures,
    gap_from_dict,
    group_texts,
    inseparable_text,
    next_rows,
    others_text,
    place_rows,
    references_text,
    size_text,
    step_rows,
    verdict_rows,
)
from sims.simulator import sources_digest

WELCOME = """
This page says **where** recordings differ from the simulation of their rig, **which** effect missing from the simulator
causes the gap, **how far** the gap shrinks when it is added, and what to record next. Sizes are in *structural floors*:
one floor is how far even healthy machines differ, so a gap below one means nothing.

The answer is most certain with recordings at several speeds and loads, and with one of the same rig when it was
healthy. The first answer for a rig takes about a minute on two free cores; its simulations are kept, and the next
answer at the same speed and load takes a quarter of that.
"""

# --------------------
# Run a diagnosis beside the page, with progress and a Stop button; keep its result for equal requests.
# --------------------


_JOB, _FINISHED, _STOPPED, _REFUSED = "gap job", "gap result", "gap stopped", "gap refused"
EVERY_S = 0.5
N_KEPT, MAX_KEPT_BYTES = 24, 200_000_000
"""Number of results kept, and the maximum unpacked size of one."""


@dataclass(frozen=True)
class Finished:
    """The result for one choice: its report, figures and files."""

    key: str
    report: GapReport
    figures: tuple[GapFigure, ...]
    page: bytes
    json: bytes
    twin: bytes | None
    _drawn: dict[int, str] = field(default_factory=dict, repr=False, compare=False)

    def picture(self, number: int) -> str:
        """Return one of the figures as SVG, drawn once."""
        if number not in self._drawn:
            self._drawn[number] = figure_svg(self.figures[number].figure, transparent=True)
        return self._drawn[number]


@dataclass
class _Running:
    """A job, and the choice that it diagnoses."""

    choice: Choice
    job: Job
    begun_s: float = field(default_factory=monotonic)


def show_running(choice: Choice) -> Finished | None:
    """Show the buttons and progress; return the kept result of the choice, else the last one of this session.

    Raises
    ------
    GearsigError
        If the job that has just ended has no result, or if none could be started.
    """
    if state.take_start_of_gap() and choice.recordings and kept_result(choice) is None:
        _start(choice)
    running: _Running | None = st.session_state.get(_JOB)
    failed: GearsigError | None = st.session_state.pop(_REFUSED, None)
    if running is not None and not running.job.is_running:
        try:
            _take(running)
        except GearsigError as error:
            failed = error
        running = None
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Diagnose",
            type="primary",
            icon=":material/play_arrow:",
            disabled=running is not None or not choice.recordings,
            on_click=_start,
            args=(choice,),
        )
        st.button("Stop", icon=":material/stop:", disabled=running is None, on_click=_stop)
    if failed is not None:
        raise failed
    if running is not None:
        _show_progress(running)
    elif st.session_state.pop(_STOPPED, False):
        st.info("Stopped. Only what had been prepared for this rig was kept.", icon=":material/stop_circle:")
    finished: Finished | None = st.session_state.get(_FINISHED)
    if running is None and choice.recordings and (finished is None or finished.key != choice.key):
        finished = kept_result(choice) or finished
        st.session_state[_FINISHED] = finished
    return finished


def forget() -> None:
    """Stop a running job and forget the result."""
    _stop()
    for key in (_FINISHED, _STOPPED):
        st.session_state.pop(key, None)


def _start(choice: Choice) -> None:
    """Start a job; an error that prevents it is kept for the page, which runs only afterwards."""
    forget()
    folder = private_folder()
    try:
        request = files_of(choice, folder)
        job = Job(folder, request, choice.model, cache=cache_folder("gap"), command=choice.command)
    except BaseException as error:
        shutil.rmtree(folder, ignore_errors=True)
        if not isinstance(error, GearsigError):
            raise
        st.session_state[_REFUSED] = error
        return
    st.session_state[_JOB] = _Running(choice, job)


def _stop() -> None:
    running: _Running | None = st.session_state.pop(_JOB, None)
    if running is not None:
        running.job.close()
        st.session_state[_STOPPED] = True


@st.fragment(run_every=EVERY_S)
def _show_progress(running: _Running) -> None:
    """Show how far the job is; the whole page runs again when it has ended."""
    if not running.job.is_running:
        st.rerun()
    stage, done = running.job.progress
    st.progress(done, f"{as_typed(capitalised(stage))} … {monotonic() - running.begun_s:.0f}\u00a0s")


def _take(running: _Running) -> None:
    """Take over the result of a job that has ended."""
    job = running.job
    del st.session_state[_JOB]
    try:
        report = job.report()
        files = {name: content for name in (PAGE, JSON, TWIN) if (content := job.result(name)) is not None}
        st.session_state[_FINISHED] = _finished(running.choice, report, files)
        _keep_result(running.choice, files)
    finally:
        job.close()


def _finished(choice: Choice, report: GapReport, files: Mapping[str, bytes]) -> Finished:
    figures = tuple(gap_figures(report, curves=False))
    return Finished(choice.key, report, figures, files.get(PAGE, b""), files.get(JSON, b""), files.get(TWIN))


def _place_of(choice: Choice) -> Path:
    """Return the path where the result of a choice is kept, which depends on its files, its settings and the code.

    Only a user who has the files can ask for it: the name depends on their hashes.
    """
    rigs = [file.rig_text for file in choice.recorded]
    code = f"{gearsig.__version__} {_code()} {sources_digest()}"
    name = sha256(f"{code} {choice.key} {rigs!r}".encode()).hexdigest()
    return cache_folder("gap-results") / f"{name}.zip"


@cache
def _code() -> str:
    """Return a hash of the diagnosis code."""
    sources = sorted(Path(gearsig.gap.__path__[0]).rglob("*.py"))
    return sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()


def _keep_result(choice: Choice, files: Mapping[str, bytes]) -> None:
    """Keep the files of a result, and delete the oldest results beyond `N_KEPT`."""
    path = _place_of(choice)

    def write(file: IO[bytes]) -> None:
        with ZipFile(file, "w", ZIP_DEFLATED) as archive:
            for name, content in files.items():
                archive.writestr(name, content)

    keep(path, write)
    with suppress(OSError):
        for old in sorted(path.parent.glob("*.zip"), key=lambda earlier: earlier.stat().st_mtime)[:-N_KEPT]:
            old.unlink(missing_ok=True)


def kept_result(choice: Choice) -> Finished | None:
    """Return the kept result of a choice, None if there is none or it cannot be read."""
    try:
        with ZipFile(_place_of(choice)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > MAX_KEPT_BYTES:
                return None
            files = {name: archive.read(name) for name in (PAGE, JSON, TWIN) if name in archive.namelist()}
        return _finished(choice, gap_from_dict(json.loads(files[JSON])), files)
    except Exception:  # noqa: BLE001 - there is none, or damaged bytes, which make their readers raise anything
        return None


LOOKS: dict[GapOutcome, tuple[str, Colour, str]] = {
    GapOutcome.NO_GAP: ("no gap", "green", ":material/check_circle:"),
    GapOutcome.EFFECT: ("cause named", "red", ":material/error:"),
    GapOutcome.CANNOT_SEPARATE: ("causes not separable", "orange", ":material/call_split:"),
    GapOutcome.UNKNOWN: ("cause unknown", "gray", ":material/help:"),
    GapOutcome.UNDECIDED: ("undecided", "gray", ":material/balance:"),
}
WITHOUT_FLOORS = (
    "Nothing was simulated, so the gap has no size and no shares. Levels are those of the strongest line above the "
    "noise around it, or above the reference where that shows the line as well."
)
NOT_SIMULATED = (
    "No simulator could be set up for this rig: no effect was added, no severity was fitted, and there is no twin."
)


def show_finished(finished: Finished) -> None:
    """Show a result."""
    report = finished.report
    _show_verdict(report)
    _show_panels(report)
    _show_notes(report)
    _show_downloads(finished)
    views = (_show_where, _show_which, _show_how_far, _show_next)
    for tab, view in zip(address.tabs(TABS, key=TAB), views, strict=True):
        if tab.open:
            with tab:
                view(finished)


def _show_verdict(report: GapReport) -> None:
    """Show the kind of fault first, which is more certain, then the possible effects of that kind."""
    words, colour, icon = LOOKS[report.outcome]
    st.badge(words, icon=icon, color=colour)
    kind = report.kind
    if kind is None:
        return
    place = f", {kind.place}" if kind.place else ""
    title = as_typed(f"{capitalised(kind.title)}{place}")
    st.subheader(f"{title} :gray[{odds_text(kind.probability)}]", anchor=False)
    likely = [c for c in report.causes if c.group == kind.group and c.probability >= LIKELY]
    badges = (f":{colour}-badge[{as_typed(c.title)} {odds_text(c.probability)}]" for c in likely)
    st.markdown(f"{'Cause' if len(likely) == 1 else 'Possible causes'}: {' '.join(badges)}")


LIKELY = 0.05
"""Minimum probability of the effects that are named with their kind."""
N_BARS, MIN_PROBABILITY = 5, 0.01
TABS = ("Where", "Which", "How far", "Next and facts")
TAB = "gap tab"


def _show_panels(report: GapReport) -> None:
    """Show where, which and how far side by side, each as bars with its sentence and a button to its tab."""
    sentences = dict(verdict_rows(report))
    places = [
        ChartRow(place.title, 0.0, 100.0 * place.share, beside=percent(place.share))
        for place in report.places
        if isfinite(place.share)
    ]
    causes = [
        ChartRow(cause.title, 0.0, 100.0 * cause.probability, beside=odds_text(cause.probability))
        for cause in report.causes
        if cause.probability >= MIN_PROBABILITY
    ]
    steps = [
        ChartRow(
            f"+ {step.label}" if i else step.label, 0.0, step.remaining.value,
            beside=step.remaining.text, interval=(step.remaining.low, step.remaining.high),
        )
        for i, step in enumerate(report.steps)
    ]  # fmt: skip
    share = (0.0, 105.0)
    panels = {
        "Where": RowPanel(places[:N_BARS], "share of the gap (%)", "share", limits=share),
        "Which": RowPanel(causes[:N_BARS], "probability (%)", "probability", limits=share),
        "How far": RowPanel(
            steps[:N_BARS], "remaining gap (structural floors)", "remaining gap", limits=_reach(steps), span=(0.0, 1.0)
        ),
    }
    about = {"How far": "The gap over all features. Shaded: one floor, as far as healthy machines differ."}
    columns = st.container(key="gap-panels").columns(3)
    for column, (title, panel) in zip(columns, panels.items(), strict=True):
        with column.container(border=True, height="stretch"):
            st.button(
                title, key=f"gap panel {title}", type="tertiary", icon=":material/zoom_in:",
                on_click=_open_tab, args=(title,),
            )  # fmt: skip
            if panel.rows:
                words = "; ".join(f"{row.name}: {row.beside}" for row in panel.rows)
                show_rows(panel, f"gap {title.lower()} panel", words, has_names_above=True)
            if panel.rows and title in about:
                st.caption(about[title])
            st.markdown(as_typed(sentences.get(title, "")))
    if sentences.get("Next"):
        st.markdown(f"**Next.** {as_typed(sentences['Next'])}")


def _open_tab(title: str) -> None:
    st.session_state[TAB] = title


def _reach(steps: Sequence[ChartRow]) -> tuple[float, float]:
    ends = [end for row in steps for end in (row.end, *(row.interval or ())) if isfinite(end)]
    return 0.0, 1.06 * max([1.2, *ends])


def _show_notes(report: GapReport) -> None:
    for warning in report.warnings:
        st.warning(f"**{CHECK_FIRST}.** {as_typed(warning)}", icon=":material/report:")
    advice = condition_advice(report)
    if advice:
        st.caption(as_typed(advice))
    show_warnings(report.notes, quiet=True)


def _show_downloads(finished: Finished) -> None:
    offer_page("Report (HTML)", lambda: finished.page, PAGE, "gap")
    with st.container(horizontal=True):
        download("JSON", finished.json, JSON)
        if finished.twin is not None:
            download("Twin (preset)", finished.twin, TWIN)


def _show_where(finished: Finished) -> None:
    report = finished.report
    rows = place_rows(report)
    both = tuple(zip(rows, report.places, strict=True))
    if report.is_simulated:
        st.markdown(f"The whole gap: {as_typed(size_text(report))}.")
        floors = floors_text(report, of_pictures=False)
        st.caption(as_typed(f"{floors} Changes are given as multiples of both, the structural one first."))
    else:
        st.caption(WITHOUT_FLOORS)
    if rows and not report.is_simulated:
        sensors = [place.channel for place in report.places]
        show_wrapping_table(
            {"place": [row.title for row in rows], "level": [row.change for row in rows], "sensor": sensors}
        )
    elif rows:
        show_wrapping_table(
            {
                "share": [percent(place.share) for _, place in both],
                "place": [row.title for row in rows],
                "change": [row.change for row in rows],
                "× both floors": [f"{row.structural}, {row.repeatability}" for row in rows],
                "at": [", ".join(row.where[1:]) for row in rows],  # the title says the kind
            }
        )
    else:
        st.markdown("No place stands out of the floor.")
    _show_pictures_of_places(finished)


def _show_pictures_of_places(finished: Finished) -> None:
    """Show the picture that shows the first place best, then offer the others by kind."""
    report = finished.report
    first = report.places[0] if report.places else None
    beside_reference = [curves for curves in report.spectra if len(curves.orders) and len(curves.reference)]
    others = [c for c in report.spectra if len(c.orders) and (len(c.before) or not len(c.reference))]
    shown = [average for average in report.averages if len(average.angle_deg)]
    averages = [(average, partial(_show_average, average)) for average in shown]
    pictures: dict[str, list[Callable[[], None]]] = {
        "Mean revolutions": [draw for _, draw in averages],
        "Spectra beside the healthy reference": [
            partial(_show_spectra, against_reference(curves), "reference", scored=report.is_beyond)
            for curves in beside_reference
        ],
        "Spectra beside the simulation" if report.is_simulated else "Spectra": [
            partial(
                _show_spectra,
                curves,
                "simulated" if len(curves.before) else "",
                scored=bool(len(curves.before)) and report.is_beyond and not len(curves.reference),
            )
            for curves in others
        ],
    }
    if first is not None and (first.tooth is not None or first.angle_deg is not None):
        best: list[Callable[[], None]] = [draw for average, draw in averages if average.shaft == first.shaft]
    else:
        best = next((draws[:1] for name, draws in pictures.items() if draws and name.startswith("Spectra")), [])
    _show_figures(finished, "where")
    for draw in best:
        draw()
    for name, draws in pictures.items():
        rest = [draw for draw in draws if draw not in best]
        if rest:
            title = name if len(rest) == len(draws) else f"Further {name.lower()}"
            with st.expander(f"{title} ({len(rest)})"):
                for draw in rest:
                    draw()


def _show_spectra(curves: SpectrumCurves, beside: str, *, scored: bool) -> None:
    """Show the spectra of a recording and of what it is compared with, and below them the gap over the same orders."""
    x = curves.orders
    named = (
        (curves.measured, "measured", 0),
        (curves.before, beside, 1),
        (curves.after, f"{beside}, with the effect", 2),
    )
    known = [(values, name, colour) for values, name, colour in named if len(values)]
    top = max(float(values.max()) for values, *_ in known) or 1.0
    bottom = max(top / 10.0**4.5, 0.3 * float(np.median(curves.floor)))
    lines = [ChartLine(x, np.maximum(curves.floor, bottom), "repeatability floor", QUIET, dotted=True)]
    lines += [ChartLine(x, np.maximum(values, bottom), name, colour) for values, name, colour in known]
    st.markdown(
        f"**{as_typed(capitalised(curves.label))}**: {as_typed(' beside '.join(filter(None, ('measured', beside))))}"
    )
    whole = (float(x[0]), float(x[-1]))
    key = f"gap spectrum {curves.label} {beside}"
    order = "order of the driver's shaft"
    unit = with_unit("peak amplitude", curves.unit)
    panel = LinePanel(lines, order, unit, (bottom, 2.0 * top), logarithmic=True, x_limits=whole)
    show_lines(panel, key, legend=True, height_px=280)
    if not len(curves.before):
        return
    gap = gap_by_order(curves, curves.before)
    seen = np.isfinite(gap)
    beyond = is_beyond(curves, gap) if scored else np.zeros(len(gap), dtype=bool)
    show_differences(
        x[seen], gap[seen], beyond[seen], order, f"{key} gap", zoomed_range(key, whole), f"measured − {beside}"
    )


def _show_average(average: AverageCurves) -> None:
    """Show one mean revolution of a recording and of its healthy reference, without what all teeth have in common."""
    st.markdown(
        as_typed(f"Mean revolution of shaft {average.shaft} at {average.channel}, without what all teeth share")
    )
    both = {name: values for name in ("measured", "reference") if len(values := getattr(average, name))}
    key = f"gap average {average.shaft} {average.channel}"
    show_revolutions(both, average.shaft, with_unit("amplitude", average.unit), key)


def _show_which(finished: Finished) -> None:
    report = finished.report
    text = inseparable_text(report)
    if text:
        st.warning(as_typed(text), icon=":material/call_split:")
    rows = cause_rows(report)
    severities = {"severity (interval of the fit)": [row.severity for row in rows]} if report.is_simulated else {}
    show_wrapping_table(
        {
            "probability": [row.percent for row in rows],
            "cause": [row.title for row in rows],
            "group": [row.group for row in rows],
            "place": [row.place for row in rows],
            **severities,
        }
    )
    groups = ", ".join(group_texts(report))
    st.caption(as_typed(f"{others_text(report)} {f'By group: {groups}.' if groups else ''}"))
    for place, row in enumerate(row for row in rows if row.statements):
        with st.expander(as_typed(f"{row.title}, {row.percent}"), expanded=place == 0):
            _show_evidence(row, finished)
    _show_figures(finished, "which")


def _show_evidence(row: CauseRow, finished: Finished) -> None:
    st.markdown("\n".join(f"- {as_typed(sentence)}" for sentence in row.statements))
    for figure in finished.figures:
        if figure.of == row.name:
            _show_figure(finished, figure)
    if row.evidence:
        show_wrapping_table(
            {
                "feature": [item.feature for item in row.evidence],
                "predicted (dB)": [item.predicted for item in row.evidence],
                "observed (dB)": [item.observed for item in row.evidence],
                "floor (dB)": [item.floor for item in row.evidence],
                "evidence": [f"{item.sign} {item.stance.removeprefix('speaks ')}" for item in row.evidence],
            }
        )


def _show_how_far(finished: Finished) -> None:
    report = finished.report
    rows = step_rows(report)
    if not report.is_simulated:
        st.markdown(NOT_SIMULATED)
    elif len(rows) > 1:
        st.caption(
            "What remains of the whole gap as effects are added to the simulator, in structural floors, on data that "
            "no severity was fitted to. The gap in the verdict shrinks more: it covers only the features that the "
            "effect changes."
        )
        labels, left, intervals, taken = zip(*rows, strict=True)
        simulators = [label if i == 0 else f"+ {label}" for i, label in enumerate(labels)]
        show_wrapping_table(
            {"simulator": simulators, "remaining gap": left, "90 % interval": intervals, "change": taken}
        )
    else:
        st.markdown("No effect was added to the simulator, so the gap is unchanged.")
    _show_figures(finished, "how far")


def _show_next(finished: Finished) -> None:
    report = finished.report
    rows = next_rows(report)
    for step in report.next_steps:
        st.markdown(as_typed(f"- {step.text[:1].upper()}{step.text[1:]}."))
    if not report.next_steps and not rows:
        st.markdown(as_typed(dict(verdict_rows(report)).get("Next", "")))
    if rows:
        st.markdown("What to record next to distinguish the likeliest causes. Distances are in structural floors.")
        columns = zip(("at", "tells apart", "distance there", "now"), zip(*rows, strict=True), strict=True)
        show_wrapping_table({name: list(values) for name, values in columns})
    names = ("recording", "speed (rpm)", "torque (N·m)", "revolutions", "length (s)", "sampling rate (Hz)")
    facts = condition_rows(report)
    show_wrapping_table({name: [row[i] for row in facts] for i, name in enumerate(names)})
    simulator = simulator_title(report.simulator) if report.simulator else "none"
    st.caption(as_typed(f"Rig: {report.rig}. Simulator: {simulator}. Healthy references: {references_text(report)}."))


def _show_figures(finished: Finished, question: Question) -> None:
    chosen = [figure for figure in finished.figures if figure.question == question and not figure.of]
    for figure in chosen:
        if not figure.is_small:
            _show_figure(finished, figure)
    small = [figure for figure in chosen if figure.is_small]
    if small:
        columns = st.container(key=f"panels of {question}").columns(max(2, len(small)))
        for figure, column in zip(small, columns, strict=False):
            with column:
                _show_figure(finished, figure)


def _show_figure(finished: Finished, figure: GapFigure) -> None:
    number = finished.figures.index(figure)
    key = f"gap-{number} of {finished.key}"
    if isinstance(figure.data, RowPanel):
        show_rows(figure.data, key, figure.shows)
    else:
        ring = None if figure.data is None else ring_of(figure.data)
        show_picture(finished.picture(number), figure.figure, figure.shows, key, ring=ring)
    st.caption(as_typed(figure.look))


def ring_of(curves: AngleCurves) -> Ring:
    """Return tooth levels around the circle, in dB relative to the measured median tooth."""
    named = {"measured": curves.measured, "simulated": curves.before, "with the effect": curves.after}
    levels = {name: 10.0 * np.log10(np.maximum(energy, 1e-6)) for name, energy in named.items() if len(energy)}
    return Ring(levels, curves.teeth if curves.has_mark else 0, "dB")


def show() -> None:
    """Choose, run, show."""
    choice = choose()
    names, references = (", ".join(file.name for file in files) for files in (choice.recordings, choice.references))
    st.subheader("Gap between simulation and recording", anchor=False)
    if choice.recordings:
        against = f", against {references}" if references else ""
        st.caption(as_typed(f"{names}{against}; simulator of {simulator_title(choice.model)}"))
    finished = show_running(choice)
    if finished is None:
        st.markdown(WELCOME)
        with suppress(GearsigError):  # shown when the diagnosis is started
            show_checks((True, text) for text in (set_alike(choice) if choice.recordings else ()))
        return
    if finished.key != choice.key:
        now = "Diagnose again for the current choice" if choice.recordings else "Choose recordings on the left"
        st.info(f"This is the answer for the previous choice. {now}.")
    show_finished(finished)
