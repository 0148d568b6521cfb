"""The fleet page: machines as a tree, indicators over time with limits and alarms, and their recordings."""

from __future__ import annotations

import atexit
import os
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any

import streamlit as st

from app.dashboard import address, state
from app.dashboard.state import ChosenFile
from app.dashboard.widgets.charts import show_lines
from app.dashboard.widgets.chooser import open_file
from app.dashboard.widgets.texts import as_typed, show_table
from app.dashboard.widgets.verdict import COLOURS
from app.dashboard.work import kept
from app.samples import EXAMPLE_PATTERN, write_example_fleet
from gearsig.diagnosis import Outcome
from gearsig.errors import InputError
from gearsig.fleet import (
    CONDITIONS,
    Fleet,
    OperatingTrend,
    Trend,
    TrendSettings,
    change_text,
    level_counts,
    open_fleet,
    series_level,
    trends_text,
)
from gearsig.formatting import moment_text, unit_text
from gearsig.plot import trend_panel
from gearsig.recording import sha256_of
from gearsig.rig import rig_file_beside

if TYPE_CHECKING:
    from pandas import DataFrame

STORE, EXAMPLE, MACHINE, POINT, SERIES = (
    "fleet store",
    "fleet example",
    "fleet machine",
    "fleet point",
    "fleet indicator",
)
EXAMPLE_NAME = "example"
"""Name in the address of the store made from the samples; a link never opens folders of this computer."""
N_MACHINES = 40
Row = dict[Any, Any]
"""Row of a table of the store."""
MARKS = {
    "alarm": ":red[:material/error:]",
    "warning": ":orange[:material/warning:]",
    "unknown": ":gray[:material/help:]",
    "ok": ":green[:material/check_circle:]",
}
"""Distinguished by shape as well as by colour."""
BADGES = {"alarm": "red", "warning": "orange", "unknown": "gray", "ok": "green"}
HOW_TO_FILL = """
There are no results in this folder yet. Add recordings from the command line, as often as you like; recordings
already in the store are skipped:
"""
COMMANDS = """
gearsig fleet add recordings --pattern '{machine}/{point}_{date:%Y%m%d}.csv' --dry-run
gearsig fleet add recordings --pattern '{machine}/{point}_{date:%Y%m%d}.csv'
gearsig fleet watch incoming --pattern '{machine}/{point}_{date:%Y%m%d-%H%M}.csv'
""".strip()
ABOUT_COMMANDS = (
    "`--dry-run` shows which machine, point and date each file is assigned to; `watch` adds new files as they appear."
)


def show() -> None:
    """Let the user choose a store, a machine and an indicator, and show it over time; worst first throughout."""
    address.begin(EXAMPLE, "store", "", address.one_of((EXAMPLE_NAME, "")))
    store = st.session_state[EXAMPLE]
    address.keep("store", store, "")
    with st.sidebar:
        folder = st.text_input(
            "Folder of the fleet",
            os.environ.get("GEARSIG_FLEET", "fleet"),
            key=STORE,
            persist_state="session",
            on_change=_see,
            args=("",),
            help="Where `gearsig fleet add` keeps its results; `GEARSIG_FLEET` sets another default.",
        )
        if store == EXAMPLE_NAME:
            st.caption("This is the example, made from the samples.")
            st.button("Close the example", icon=":material/close:", on_click=_see, args=("",))
    st.subheader("Fleet: machines over time", anchor=False)
    path = Path(example_store() if store == EXAMPLE_NAME else folder).expanduser()
    try:
        messages: list[str] = []
        fleet = open_fleet(path, on_message=messages.append)
        status = fleet.status()
    except InputError:
        if (path / "store.json").exists():
            raise
        _show_how_to_begin()
        st.caption(as_typed(f"Looked for in {path.absolute()}."))
        return
    if status.empty:
        _show_how_to_begin()
        return
    _show_counts(status)
    left, right = st.container(key="fleet").columns((3, 8), gap="medium")
    with left:
        machine, point = _choose_point(status)
    with right:
        _show_point(fleet, status[(status["machine"] == machine) & (status["point"] == point)].iloc[0].to_dict())
    for text in messages:
        st.caption(f":material/info: {as_typed(text)}")


@kept(1, "Analysing half a year of three gearboxes …")
def example_store() -> str:
    """Return the folder of a store made from the samples, which exists while the dashboard runs."""
    folder = Path(mkdtemp(prefix="gearsig-fleet-"))
    atexit.register(rmtree, folder, ignore_errors=True)
    write_example_fleet(folder / "recordings")
    fleet = open_fleet(folder / "store", create=True)
    fleet.set(TrendSettings(n_baseline=8))
    fleet.add([folder / "recordings"], pattern=EXAMPLE_PATTERN)
    return str(folder / "store")


def _show_how_to_begin() -> None:
    st.markdown(HOW_TO_FILL)
    st.code(COMMANDS, language="bash", wrap_lines=True)
    st.markdown(ABOUT_COMMANDS)
    about = "Three gearboxes made from the samples. Their recordings are analysed once, which takes about 20 s."
    look = ":material/play_arrow:"
    st.button("See an example", type="primary", icon=look, help=about, on_click=_see, args=(EXAMPLE_NAME,))


def _see(store: str) -> None:
    """Show the example, or with an empty name the folder that the user gives."""
    st.session_state[EXAMPLE] = store


def _show_counts(status: DataFrame) -> None:
    words = [f":{BADGES[name]}-badge[{text}]" for name, text in level_counts(status).items()]
    n_machines = status["machine"].nunique()
    st.markdown(f"{n_machines} machines, {len(status)} measuring points, {' '.join(words)}")


def _choose_point(status: DataFrame) -> tuple[str, str]:
    """Show machines with their measuring points, the worst first; return the selected machine and point."""
    looks: dict[str, Any] = {"placeholder": "Part of a name"}
    searched = address.ask(st.text_input, "Machine", name="search", first="", read=address.words, **looks)
    shown = status[status["machine"].str.contains(searched, case=False, regex=False)]
    of_machine = {str(name): rows.to_dict("records") for name, rows in shown.groupby("machine", sort=False)}
    known = [(row["machine"], row["point"]) for rows in of_machine.values() for row in rows]
    everywhere = list(zip(status["machine"], status["point"], strict=True))
    first = (known or everywhere)[0]
    machine = address.chosen(MACHINE, "machine", {name for name, _ in everywhere}, first[0])
    points = [point for name, point in everywhere if name == machine]
    chosen = (machine, address.chosen(POINT, "point", points, first[1] if machine == first[0] else points[0]))
    with st.container(height=620 if len(of_machine) > 6 else "content", border=False, gap="small", key="tree"):
        for name, rows in list(of_machine.items())[:N_MACHINES]:
            if len(rows) == 1:
                words = " · ".join(part for part in (name, rows[0]["point"]) if part)
                _point_button(rows[0], words, is_chosen=(name, rows[0]["point"]) == chosen)
                continue
            label, is_open = f"{MARKS[rows[0]['level']]} {as_typed(name)}", name == chosen[0]
            with st.expander(label, expanded=is_open or len(of_machine) <= 6):
                for row in rows:
                    is_chosen = (name, row["point"]) == chosen
                    _point_button(row, row["point"] or "all channels", is_chosen=is_chosen)
        if len(of_machine) > N_MACHINES:
            st.caption(f"{len(of_machine) - N_MACHINES} more: search by name.")
    return chosen


def _point_button(row: Row, words: str, *, is_chosen: bool) -> None:
    # never the primary colour, on which the mark's own colour would be invisible
    name = f"**{as_typed(words)}**" if is_chosen else as_typed(words)
    st.button(
        f"{MARKS[row['level']]} {name}",
        key=f"point {row['machine']!r} {row['point']!r}",
        type="secondary" if is_chosen else "tertiary",
        width="stretch",
        help=as_typed(trends_text(row) or str(row["outcome"] or "no diagnosis")),
        on_click=_look_at,
        args=(row["machine"], row["point"]),
    )


def _look_at(machine: str, point: str) -> None:
    st.session_state[MACHINE], st.session_state[POINT] = machine, point


def _show_point(fleet: Fleet, row: Row) -> None:
    """Show one measuring point: state, an indicator over time, all indicators, recordings."""
    machine, point = row["machine"], row["point"]
    name = " · ".join(part for part in (machine, point) if part)
    st.subheader(f"{as_typed(name)} :{BADGES[row['level']]}-badge[{row['level']}]", anchor=False)
    outcome = str(row["outcome"] or "")
    if outcome:
        colour = COLOURS[Outcome(outcome)]
        st.markdown(f":{colour}[{as_typed(row['verdict'] or outcome)}]")
    trends = trends_text(row)
    failed = f", {row['n_failed']} failed" if row["n_failed"] else ""
    span = f"{row['n_recordings']} recordings{failed}, {row['first']:%Y-%m-%d} to {row['last']:%Y-%m-%d}"
    st.caption(as_typed(f"{trends}; {span}" if trends else span))
    series = fleet.series(machine, point)
    if series.empty:
        st.info("None of its recordings could be analysed.", icon=":material/help:")
    else:
        row = _choose_series(series, machine, point)
        over = _choose_over(fleet.recordings(machine, point))
        _show_trend(fleet, row, over)
        with st.expander(f"All {len(series)} indicators, worst first", icon=":material/table:"):
            show_table(_series_table(series))
    _show_recordings(fleet.recordings(machine, point).iloc[::-1], f"{machine!r} {point!r}")


def _choose_series(series: DataFrame, machine: str, point: str) -> Row:
    rows = series.to_dict("records")
    key = state.source_key(SERIES, f"{machine!r} {point!r}")
    label = "Indicator, worst first"
    names = [_series_name(row) for row in rows]
    address.begin(key, "indicator", 0, address.one_of({name: i for i, name in enumerate(names)}))
    place = st.selectbox(label, range(len(rows)), format_func=lambda i: _series_text(rows[i]), key=key) or 0
    address.put("indicator", names[place])  # by name: tomorrow another one may be the worst
    return rows[place]


def _series_name(row: Row) -> str:
    of = ", ".join(part for part in (row["place"], row["channel"], row["computed_on"], row["band"]) if part)
    return f"{row['name']} ({of})"


def _series_text(row: Row) -> str:
    change = change_text(row["change"], in_db=bool(row["in_db"]))
    return f"{series_level(row)}{', ' + change if change else ''}: {_series_name(row)}"


def _series_table(series: DataFrame) -> dict[str, list[Any]]:
    rows = series.to_dict("records")
    return {
        "": [series_level(row) for row in rows],
        "indicator": [_series_name(row) for row in rows],
        "last": [row["value"] for row in rows],
        "expected": [row["expected"] for row in rows],
        "limit": [row["upper_limit"] for row in rows],
        "unit": [unit_text(row["unit"]) for row in rows],
        "since": [row["since"] for row in rows],
        "basis of limits": [row["basis"] for row in rows],
    }


def _choose_over(recordings: DataFrame) -> str:
    """Return the axis that the indicator is shown over: the date, or the load or speed that the recordings state."""
    known = [name for name, column in CONDITIONS.items() if recordings[column].max() > recordings[column].min()]
    if not known:
        return "date"
    looks = {"name": "over", "label_visibility": "collapsed", "required": True}
    names = {"date": "Over time", "load": "Over load", "speed": "Over speed"}
    return str(
        address.ask_one(st.segmented_control, "Over", ["date", *known], format_func=lambda over: names[over], **looks)
    )


def _show_trend(fleet: Fleet, row: Row, over: str) -> None:
    """Show one indicator over time, load or speed, with the band of its limits and the values beyond it marked."""
    only = {name: row[name] for name in ("point", "channel", "place", "computed_on")}
    if over == "date":
        trends = fleet.trend(row["machine"], row["name"], **only)
        dated = next((trend for trend in trends if trend.band == row["band"]), trends[0])
        changed = f" The level first changed on {moment_text(dated.changed)}." if dated.changed is not None else ""
        shown: Trend | OperatingTrend = dated
    else:
        related = fleet.trend_over(over, row["machine"], row["name"], **only)
        shown, changed = next((of for of in related if of.trend.band == row["band"]), related[0]), ""
    panel, marked = trend_panel(shown)
    key = f"{over} of {row['machine']} {row['point']} {_series_text(row)}"
    show_lines(panel, key, marked=marked, legend=True)
    st.caption(as_typed(shown.text + changed))


def _show_recordings(recordings: DataFrame, of: str) -> None:
    """Offer the recordings of a measuring point, latest first; open one on the analysis page."""
    rows = recordings.to_dict("records")
    dates = [f"{row['date']:%Y-%m-%dT%H:%M}" for row in rows]
    looks: dict[str, Any] = {"name": "recording", "first": 0, "key": state.source_key("fleet recording", of)}
    looks |= {"read": address.one_of({date: i for i, date in enumerate(dates)}), "written": dates.__getitem__}
    looks |= {"format_func": lambda i: _recording_text(rows[i])}
    with st.container(horizontal=True, vertical_alignment="bottom"):
        place = address.ask(st.selectbox, "Recording", range(len(rows)), **looks)
        is_asked = st.button("Open its analysis", icon=":material/troubleshoot:", type="primary")
    if is_asked:
        open_file(_file_of(Path(rows[place]["source"])))
        state.go_to("analysis")


def _recording_text(row: Row) -> str:
    date = f"{row['date']:%Y-%m-%d %H:%M}".removesuffix(" 00:00")
    return f"{date}: {row['reason'] or row['verdict'] or row['outcome']}"


def _file_of(path: Path) -> ChosenFile:
    """Return a recording of the store as a file for the analysis page, with the rig file next to it.

    Raises
    ------
    InputError
        If it no longer exists or cannot be read.
    """
    try:
        digest = sha256_of(path)
        beside = rig_file_beside(path)
        text = beside.read_text(encoding="utf-8") if beside is not None else ""
    except (OSError, ValueError):
        raise InputError(
            "cannot be read: the store keeps results, not the recordings",
            where=str(path),
            remedy="put the file back in its place",
        ) from None
    return ChosenFile(path.name, digest, path, beside.name if beside is not None else "rig.toml", text)
