"""The machine as a form: tables of shafts, gears, bearings and sensors, with the orders that follow and a drawing."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import streamlit as st
import tomli_w

from app.dashboard import state
from app.dashboard.state import ChosenFile
from app.dashboard.theme import palette
from app.dashboard.widgets.charts import download
from app.dashboard.widgets.texts import FORM_LABELS, FORM_TABLES, one_line, show_error, show_table
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import unit_text
from gearsig.rig import QUANTITIES, Rig, bearing_catalogue, order_lines, parse_toml, rig_from_dict

if TYPE_CHECKING:
    from pandas import DataFrame
    from streamlit.delta_generator import DeltaGenerator

Table = dict[str, Any]
COLUMNS: dict[str, dict[str, int]] = {
    "shaft": {"name": 120, "direction": 90},
    "pair": {
        "name": 64,
        "driver": 80,
        "driver_teeth": 70,
        "driven": 80,
        "driven_teeth": 70,
        "module_mm": 54,
        "face_width_mm": 60,
    },
    "bearing": {
        "name": 80,
        "shaft": 82,
        "bearing": 88,
        "n_rolling_elements": 84,
        "rolling_element_diameter_mm": 68,
        "pitch_diameter_mm": 76,
    },
    "sensor": {"channel": 84, "quantity": 96, "unit": 64, "position": 166, "scale": 70},
}
"""Least width of each column, in pixels: together they fit a window of 800, beside the sidebar; with more room they
grow."""
SHORT_LABELS = {
    "driver_teeth": "teeth",
    "driven_teeth": "teeth",
    "module_mm": "m",
    "face_width_mm": "b",
    "rolling_element_diameter_mm": "d",
    "pitch_diameter_mm": "D",
}
"""Of narrow columns, which tell their whole names under the pointer and the unit of a length in the cell."""
SPEED_SOURCES: dict[str, tuple[str, ...]] = {
    "none": (),
    "constant": ("speed_rpm",),
    "tachometer": ("channel", "pulses_per_revolution"),
    "encoder": ("channel", "units_per_revolution"),
    "speed channel": ("channel", "rpm_per_unit"),
}
FIRST: Table = {"pulses_per_revolution": 1, "units_per_revolution": 360.0, "rpm_per_unit": 1.0, "speed_rpm": 1500.0}
LARGEST, MOST_ROWS = 2.0**53, 1000
_CHANGED = "machine changed"


def machine_text(file: ChosenFile) -> str:
    """Return the rig file's text as it stands in this session: the form's, else the file's."""
    return str(st.session_state.get(_key(file), file.rig_text))


def stated(file: ChosenFile, name: str) -> float | None:
    """Return a number that the user stated of a file, "rate" (Hz) or "speed" (rpm); None without one."""
    value: float | None = st.session_state.get(state.source_key(f"stated {name}", file.sha256))
    return value


def text_as_stated(file: ChosenFile) -> str:
    """Return the machine's text with what the user stated of the file, for whoever opens it again."""
    rate_hz, speed_rpm = stated(file, "rate"), stated(file, "speed")
    if rate_hz is None and speed_rpm is None:
        return machine_text(file)
    try:
        table: Table = parse_toml(machine_text(file), file.rig_name)
    except GearsigError:
        return machine_text(file)
    if rate_hz is not None:
        table["sampling_rate_hz"] = rate_hz
    if speed_rpm is not None:
        table["speed"] = {"source": "constant", "speed_rpm": speed_rpm}
    return tomli_w.dumps(table)


def show_machine(file: ChosenFile, channels: Sequence[str] = (), *, is_told: bool = False) -> None:
    """Show the form, what follows from it, and TOML to give and take.

    Parameters
    ----------
    file : ChosenFile
    channels : sequence of str
        Of the recording, where it could be read.
    is_told : bool
        Whether the page already says what is wrong with the machine as it stands.
    """
    if st.session_state.pop(_CHANGED, False):  # the verdict above rests on it, not this part of the page alone
        st.rerun()
    text = machine_text(file)
    try:
        table = parse_toml(text, file.rig_name)
        problem = "" if _fits_form(table) else "The form cannot show this rig file"
    except GearsigError:
        problem = "The rig file is no TOML yet"
    if problem:
        st.info(f"{problem}: mend it as text.", icon=":material/edit:")
        _show_text(file, text, is_open=True)
        return
    is_unknown = not table.get("shaft")
    if is_unknown:  # the speed alone says most, and takes one number
        show_stated(file)
    with st.container(key="machine"):
        first, follows = st.columns((5, 8), gap="medium")
        edited = _form(file, table, text, channels, first)
        with follows:
            _show_consequences(edited, shown_already=_rig_of(table) if is_told else None)
    described, changed = _rig_of(edited), text if edited == table else tomli_w.dumps(edited)
    if described != _rig_of(table) or (edited != table and isinstance(described, str)):
        with st.container(horizontal=True):
            st.button(
                "Analyse with this machine",
                type="primary",
                icon=":material/check:",
                on_click=_take,
                args=(file, changed),
                disabled=isinstance(described, str),  # what is wrong stands beside the form
            )
            st.button("Discard", on_click=_take, args=(file, text))
    if not is_unknown:
        show_stated(file)
    _show_text(file, changed)


def _rig_of(table: Table) -> Rig | str:
    """Return the rig of a table, or why there is none."""
    try:
        return rig_from_dict(table)
    except GearsigError as error:
        return str(error)


def show_stated(file: ChosenFile) -> None:
    """Ask for what the file does not state: sampling rate and a constant speed."""
    left, right = st.columns(2)
    for place, label, name, about in (
        (left, "Sampling rate (Hz)", "rate", "Of files that do not state it; it overrides what the file says."),
        (right, "Constant speed (rpm)", "speed", "Of the reference shaft, if it held still; refined by the signal."),
    ):
        place.number_input(
            label,
            value=stated(file, name),
            placeholder="from the file or the machine",
            help=about,
            key=state.source_key(f"asked {name}", file.sha256),
            on_change=_state,
            args=(file, name),
        )


def _state(file: ChosenFile, name: str) -> None:
    st.session_state[state.source_key(f"stated {name}", file.sha256)] = st.session_state[
        state.source_key(f"asked {name}", file.sha256)
    ]
    st.session_state[_CHANGED] = True


def _key(file: ChosenFile) -> str:
    return state.source_key("machine", f"{file.sha256} {file.rig_name}")


def describe(file: ChosenFile, text: str) -> None:
    """Take the text of a rig file for a file's machine in this session."""
    st.session_state[_key(file)] = text
    # tables of the form begin anew from the text
    version = state.source_key("machine version", file.sha256)
    st.session_state[version] = st.session_state.get(version, 0) + 1


def _take(file: ChosenFile, text: str) -> None:
    describe(file, text)
    st.session_state[_CHANGED] = True


def _fits_form(table: Table) -> bool:
    """Whether what the form shows are tables of texts and numbers as its fields take them; a file may hold anything."""
    groups = {kind: table.get(kind, []) for kind in COLUMNS} | {"speed": [table.get("speed", {})]}
    numbers = {*FIRST, *(name for kind in COLUMNS for name in _numbers(kind))}
    shown = {name for names in (*COLUMNS.values(), *SPEED_SOURCES.values()) for name in names} | {"source"}

    def fits(name: str, value: object) -> bool:
        is_number = isinstance(value, int | float) and abs(value) <= LARGEST
        return name not in shown or (is_number if name in numbers else isinstance(value, str))

    return isinstance(table.get("name", ""), str) and all(
        isinstance(rows, list)
        and len(rows) <= MOST_ROWS
        and all(isinstance(row, dict) and all(fits(*item) for item in row.items()) for row in rows)
        for rows in groups.values()
    )


def _form(file: ChosenFile, table: Table, text: str, channels: Sequence[str], first: DeltaGenerator) -> Table:
    """Return the rig's table with what the form says; keys that the form does not show stay.

    Name and shafts go into the place `first`, the wider tables below it.
    """
    version = st.session_state.get(state.source_key("machine version", file.sha256), 0)

    def key(name: str) -> str:
        return state.source_key(f"{name} {version}", f"{file.sha256} {len(text)}")

    edited: Table = dict(table)
    name = first.text_input("Machine", table.get("name", ""), key=key("machine name"))
    edited |= {"name": name} if name else {}
    for kind in COLUMNS:
        with first if kind == "shaft" else st.container():
            st.markdown(f"**{FORM_TABLES[kind]}**")
            edited[kind] = _edit(kind, list(table.get(kind, [])), edited, key(kind), channels)
    speed = _edit_speed(dict(table.get("speed", {})), edited, key, channels)
    edited = {name: value for name, value in edited.items() if value not in ([], {})}
    edited.pop("speed", None)
    return edited | ({"speed": speed} if speed else {})


def _edit(kind: str, rows: list[Table], rig: Table, key: str, channels: Sequence[str]) -> list[Table]:
    from pandas import DataFrame

    columns = COLUMNS[kind]
    shown = [row | {"unit": unit_text(str(row["unit"]))} if "unit" in row else row for row in rows]
    frame = DataFrame([[row.get(name) for name in columns] for row in shown], columns=list(columns))
    numbers = _numbers(kind)
    frame = frame.astype(dict.fromkeys(numbers, "float64") | {c: "object" for c in columns if c not in numbers})
    result = st.data_editor(
        frame,
        key=key,
        num_rows="dynamic",
        hide_index=True,
        width="stretch",
        placeholder="",
        column_config=_config(kind, rig, channels),
    )
    return [row for row in _rows(result, rows) if row]


def _numbers(kind: str) -> list[str]:
    return [name for name in COLUMNS[kind] if name.endswith(("_teeth", "_mm", "elements")) or name == "scale"]


def _rows(frame: DataFrame, before: list[Table]) -> list[Table]:
    """Return the rows of an edited table as a rig file has them: what is empty is left out, whole numbers are whole."""
    from pandas import isna

    rows = []
    for index, values in frame.iterrows():
        known = before[index] if isinstance(index, int) and index < len(before) else {}
        row = {name: value for name, value in known.items() if name not in frame.columns}
        for name, value in values.items():
            if value == "" or isna(value):
                continue
            whole = isinstance(value, float) and value == int(value) and str(name).endswith(("_teeth", "elements"))
            row[str(name)] = int(value) if whole else value
        if "unit" in row and row["unit"] == unit_text(str(known.get("unit", ""))):  # it was not changed
            row["unit"] = known["unit"]
        rows.append(row)
    return rows


def _config(kind: str, rig: Table, channels: Sequence[str]) -> dict[str, Any]:
    column = st.column_config
    shafts = [str(row["name"]) for row in rig.get("shaft", []) if row.get("name")]
    choices: dict[str, dict[str, Sequence[str]]] = {
        "shaft": {"direction": ("ccw", "cw")},
        "pair": {"driver": shafts, "driven": shafts},
        "bearing": {"shaft": shafts, "bearing": sorted(bearing_catalogue())},
        "sensor": {"quantity": QUANTITIES} | ({"channel": channels} if channels else {}),
    }
    made: dict[str, Any] = {}
    for name, width in COLUMNS[kind].items():
        whole = FORM_LABELS.get(name, name)
        looks: dict[str, Any] = {"label": SHORT_LABELS.get(name, whole), "width": width}
        looks |= {"help": whole} if name in SHORT_LABELS else {}
        if name in choices[kind]:
            made[name] = column.SelectboxColumn(**looks, options=list(choices[kind][name]))
        elif name.endswith(("_teeth", "elements")):
            made[name] = column.NumberColumn(**looks, step=1, format="%d")
        elif name in _numbers(kind):
            made[name] = column.NumberColumn(**looks, format="%g mm" if name.endswith("_mm") else None)
        else:
            made[name] = column.Column(**looks)
    return made


SPEED_NAMES = re.compile(r"tach|keyphas|trig|enc|speed|rpm", re.IGNORECASE)
"""What channels that tell a speed are usually called."""


def _edit_speed(speed: Table, rig: Table, key: Callable[[str], str], channels: Sequence[str]) -> Table:
    source = str(speed.get("source", "none"))
    columns = st.columns(4)
    known = list(SPEED_SOURCES)
    chosen = columns[0].selectbox("Speed from", known, known.index(source) if source in known else 0, key=key("speed"))
    edited = dict(speed) if chosen == source else {}
    edited["source"] = chosen
    for place, name in zip(columns[1:], SPEED_SOURCES[chosen], strict=False):
        if name == "channel":
            likely = sorted(channels, key=lambda channel: not SPEED_NAMES.search(channel))
            offered = list(dict.fromkeys([*([speed["channel"]] if "channel" in speed else []), *likely])) or ["tacho"]
            edited[name] = place.selectbox("Channel", offered, key=key("speed channel"))
        else:
            step = 1 if name == "pulses_per_revolution" else 0.1
            value = type(step)(float(speed.get(name) or FIRST[name]))
            edited[name] = place.number_input(FORM_LABELS[name], value=value, step=step, key=key(f"speed {name}"))
    shafts = [str(row["name"]) for row in rig.get("shaft", []) if row.get("name")]
    if chosen != "none" and shafts:
        at = shafts.index(speed["shaft"]) if speed.get("shaft") in shafts else 0
        edited["shaft"] = columns[3].selectbox("Of shaft", shafts, at, key=key("speed shaft"))
    return {} if chosen == "none" and "source" not in speed else edited


# --------------------
# What follows: a drawing of the train, and its orders.
# --------------------


def _show_consequences(table: Table, *, shown_already: Rig | str | None) -> None:
    """Show what follows from a machine, or what is wrong with it where `shown_already` is not that already."""
    try:
        rig = rig_from_dict(table)
    except GearsigError as error:
        if str(error) != shown_already:
            show_error(error)
        return
    if not rig.shafts:
        st.caption(":material/account_tree: Name a shaft: its orders follow, and with teeth those of the mesh.")
        return
    place = st.container(key="panels of the train")
    drawing, orders = place.columns((3, 4), vertical_alignment="center")
    drawing.image(train_svg(rig, palette().quiet), width="stretch", alt="Drawing of the gear train")
    lines = [line for line in order_lines(rig, rig.reference_shaft, n_sidebands=0) if line.kind != "sideband"]
    turns = (rig.nominal_speed_rpm() or 0.0) / 60.0
    of = f"order of {rig.reference_shaft}"
    table = {"line": [line.label for line in lines], of: [line.order for line in lines]}
    if turns:
        table["Hz"] = [line.order * turns for line in lines]
    with orders:
        show_table(table, width="stretch", height=300, column_config={of: st.column_config.Column("order", help=of)})


def train_svg(rig: Rig, ink: str) -> str:
    """Return a drawing of the shafts with their gears and bearings; names from files are escaped."""
    width, gap, left = 330, 74, 100
    radii = {
        (pair.name, shaft): gap
        * abs(order[pair.driven] - order[pair.driver])
        * (teeth or 30)
        / ((teeth or 30) + (mate_teeth or 30))
        for order in [{name: i for i, name in enumerate(rig.shaft_names)}]
        for pair in rig.pairs
        for shaft, teeth, mate_teeth in (
            (pair.driver, pair.driver_teeth, pair.driven_teeth),
            (pair.driven, pair.driven_teeth, pair.driver_teeth),
        )
    }
    margin = 12 + max(radii.values(), default=10.0)
    rows = {name: margin + gap * i for i, name in enumerate(rig.shaft_names)}
    height = 2 * margin + gap * max(len(rows) - 1, 0)
    parts = [
        f'<line x1="{left}" x2="{width - 20}" y1="{y}" y2="{y}" stroke="{ink}" stroke-width="4"/>'
        f'<text x="{left - 8}" y="{y + 4}" text-anchor="end">{escape(one_line(name)[:12])}</text>'
        for name, y in rows.items()
    ]
    for i, pair in enumerate(rig.pairs):
        x = left + 60 + (width - left - 120) * (i + 0.5) / max(len(rig.pairs), 1)
        teeth = {pair.driver: pair.driver_teeth, pair.driven: pair.driven_teeth}
        for shaft, number in teeth.items():
            radius = radii[pair.name, shaft]
            parts.append(
                f'<rect x="{x - 9:.1f}" y="{rows[shaft] - radius:.1f}" width="18" height="{2 * radius:.1f}" rx="2" '
                f'fill="#0072B2" fill-opacity="0.25" stroke="#0072B2" stroke-width="1.5"/>'
                f'<text x="{x + 14:.1f}" y="{rows[shaft] - 7:.1f}">{number or "?"}</text>'
            )
    for shaft, y in rows.items():
        of_shaft = [bearing for bearing in rig.bearings if bearing.shaft == shaft]
        for i in range(len(of_shaft)):
            x = left + 14 + (width - left - 48) * i / max(len(of_shaft) - 1, 1)
            parts += [
                f'<rect x="{x - 6:.1f}" y="{y + side:.1f}" width="12" height="8" rx="1.5" fill="none" stroke="#A8447E" '
                f'stroke-width="1.5"></rect>'
                for side in (-11, 3)
            ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height:.0f}" font-size="15" '
        f'font-family="sans-serif" fill="{ink}">{"".join(parts)}</svg>'
    )


def _show_text(file: ChosenFile, text: str, *, is_open: bool = False) -> None:
    with st.expander("As a rig file (TOML)", icon=":material/code:", expanded=is_open):
        given = st.file_uploader("Take over a rig file", type=["toml"], max_upload_size=1, key=f"take {_key(file)}")
        if given is not None and st.button("Use this rig file"):
            _take(file, text_of(given.name, given.getvalue()))
            st.rerun()
        key = f"text {_key(file)} {hash(text)}"
        edited = st.text_area("Text", text, height=320, key=key, label_visibility="collapsed")
        with st.container(horizontal=True):
            st.button("Use this text", on_click=_take, args=(file, edited), disabled=edited == text)
            download("Rig file", text.encode(), file.rig_name)


def text_of(name: str, content: bytes) -> str:
    """Return the text of a rig file.

    Raises
    ------
    InputError
        If it is no text.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not text in UTF-8", where=name, remedy="save the rig file as UTF-8") from None
