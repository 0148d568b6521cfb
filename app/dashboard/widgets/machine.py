"""The machine as a form: tables of shafts, gears, bearings and sensors, with the resulting orders and a drawing."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from hashlib import sha256
from html import escape
from typing import TYPE_CHECKING, Any

import streamlit as st
import tomli_w

from app.dashboard import state
from app.dashboard.state import ChosenFile, PulseFile
from app.dashboard.theme import palette
from app.dashboard.widgets.charts import download
from app.dashboard.widgets.texts import (
    FORM_LABELS,
    FORM_TABLES,
    as_typed,
    capitalised,
    one_line,
    show_error,
    show_table,
)
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import unit_text
from gearsig.rig import (
    MOUNTINGS,
    QUANTITIES,
    OperatingPoint,
    Rig,
    bearing_catalogue,
    order_lines,
    parse_toml,
    rig_from_dict,
)

if TYPE_CHECKING:
    from pandas import DataFrame
    from streamlit.delta_generator import DeltaGenerator

Table = dict[str, Any]
COLUMNS: dict[str, tuple[str, ...]] = {
    "shaft": ("name", "direction"),
    "pair": (
        "name",
        "driver",
        "driver_teeth",
        "driven",
        "driven_teeth",
        "module_mm",
        "face_width_mm",
        "pressure_angle_deg",
    ),
    "bearing": (
        "name",
        "shaft",
        "bearing",
        "n_rolling_elements",
        "rolling_element_diameter_mm",
        "pitch_diameter_mm",
        "contact_angle_deg",
        "bpfo_order",
        "bpfi_order",
        "bsf_order",
        "ftf_order",
    ),
    "sensor": ("channel", "quantity", "unit", "position", "scale", "offset"),
}
FACTS: dict[str, tuple[str, ...]] = {
    "operating_point": ("speed_rpm", "speed_tolerance_percent", "torque_nm", "shaft"),
    "machine": ("power_kw", "shaft_height_mm", "mounting"),
}
"""Tables of a rig file that are shown as one row of fields; an empty field is left out of the file."""
ABOUT = {
    "bearing": "A catalogue name; or number n, diameter d, pitch diameter D and contact angle α of the rolling "
    "elements; or the orders that its maker states, which take precedence over both.",
    "operating_point": "Guides the search for the true speed; used in its place, within ± 6 %, where neither a "
    "tachometer nor gears give the speed.",
    "machine": "For zones A to D of ISO 20816-3: rated power, or the shaft height of a motor or generator.",
}
SHORT_LABELS = {
    "driver_teeth": "teeth",
    "driven_teeth": "teeth",
    "module_mm": "m (mm)",
    "face_width_mm": "b (mm)",
    "pressure_angle_deg": "α (°)",
    "n_rolling_elements": "n",
    "rolling_element_diameter_mm": "d (mm)",
    "pitch_diameter_mm": "D (mm)",
    "contact_angle_deg": "α (°)",
    "bpfo_order": "BPFO",
    "bpfi_order": "BPFI",
    "bsf_order": "BSF",
    "ftf_order": "FTF",
}
"""Labels of narrow columns, which show their full names at the pointer."""
WIDEST_PX = 330
"""Maximum initial width of a column, however long its texts."""
SHAFT_KEYS = ("shaft", "driver", "driven")
EMPTY = {"speed_tolerance_percent": f"{OperatingPoint.speed_tolerance_percent:g}", "shaft": "reference shaft"}
"""What applies if a field is empty; for other fields the value is not known."""
SPEED_SOURCES: dict[str, tuple[str, ...]] = {
    "constant": ("speed_rpm",),
    "tachometer": ("channel", "pulses_per_revolution"),
    "encoder": ("channel", "units_per_revolution"),
    "speed channel": ("channel", "rpm_per_unit"),
}
PULSE_TIMES = "pulse times"
"""Speed source that belongs to one recording and therefore to no rig file: a file given with the recording."""
LARGEST_PULSE_FILE_MB = 50
DEFAULTS: Table = {"pulses_per_revolution": 1, "units_per_revolution": 360.0, "rpm_per_unit": 1.0}
LARGEST, MOST_ROWS = 2.0**53, 1000
NUMBER = "%.10g"
"""Format of a number in a field, as a user would type it."""
_CHANGED = "machine changed"


def machine_text(file: ChosenFile) -> str:
    """Return the rig file's text as it stands in this session: the form's, else the file's."""
    return str(st.session_state.get(_key(file), file.rig_text))


def stated(file: ChosenFile, name: str) -> float | None:
    """Return a number that the user stated for a file, "rate" (Hz) or "speed" (rpm); None without one."""
    value: float | None = st.session_state.get(state.source_key(f"stated {name}", file.sha256))
    return value


def stated_pulses(file: ChosenFile) -> PulseFile | None:
    """Return the times of tachometer pulses that the user gave with a file, None without any."""
    given: PulseFile | None = st.session_state.get(_pulses_key(file), file.pulses)
    return given


def text_as_stated(file: ChosenFile) -> str:
    """Return the machine's text with the values that the user stated for the file, for opening it again."""
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


def show_machine(file: ChosenFile, channels: Sequence[str] = (), *, is_reported: bool = False) -> None:
    """Show the form, what follows from it, and the rig file to edit, upload or download.

    Parameters
    ----------
    file : ChosenFile
    channels : sequence of str
        Of the recording, if it could be read.
    is_reported : bool
        Whether the page already says what is wrong with the machine as it stands.
    """
    if st.session_state.pop(_CHANGED, False):  # the verdict above depends on it, not only this part of the page
        st.rerun()
    text = machine_text(file)
    try:
        table = parse_toml(text, file.rig_name)
        problem = "" if _fits_form(table) else "The form cannot show this rig file"
    except GearsigError:
        problem = "The rig file is not valid TOML"
    if problem:
        st.info(f"{problem}: edit it as text.", icon=":material/edit:")
        _show_text(file, text, is_open=True)
        return
    with st.container(key="machine"):
        speed = st.container(key="machine-speed")  # by itself the most useful entry, and only one number
        first, follows = st.columns((5, 8), gap="medium")
        edited = _form(file, table, text, channels, first, speed)
        with follows:
            _show_consequences(edited, shown_already=_rig_of(table) if is_reported else None)
    described, changed = _rig_of(edited), text if edited == table else tomli_w.dumps(edited)
    if described != _rig_of(table) or (edited != table and isinstance(described, str)):
        with st.container(horizontal=True, key="take"):
            st.button(
                "Analyse with this machine",
                type="primary",
                icon=":material/check:",
                on_click=_take,
                args=(file, changed),
                disabled=isinstance(described, str),  # the error is shown beside the form
            )
            st.button("Discard", on_click=_take, args=(file, text))
    _show_text(file, changed)


def _rig_of(table: Table) -> Rig | str:
    """Return the rig of a table, or why there is none."""
    try:
        return rig_from_dict(table)
    except GearsigError as error:
        return str(error)


def _ask_stated(place: DeltaGenerator, file: ChosenFile, label: str, name: str, about: str) -> None:
    """Ask for a number that overrides what the file says; it takes effect as soon as it is typed."""
    place.number_input(
        label,
        value=stated(file, name),
        placeholder="from the file" if name == "rate" else "as found",
        format=NUMBER,
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


def _forget_speed(file: ChosenFile) -> None:
    """Discard a stated speed in favour of a measured one."""
    if stated(file, "speed") is not None:
        st.session_state[state.source_key("asked speed", file.sha256)] = None
        _state(file, "speed")
    if stated_pulses(file) is not None:
        _give_pulses(file, None)


def _pulses_key(file: ChosenFile) -> str:
    return state.source_key("stated pulses", file.sha256)


def _give_pulses(file: ChosenFile, pulses: PulseFile | None) -> None:
    st.session_state[_pulses_key(file)] = pulses
    st.session_state[_CHANGED] = True


def _ask_pulses(place: DeltaGenerator, file: ChosenFile) -> None:
    """Ask for the file of pulse times and, in `place`, the pulses per revolution; both take effect at once."""
    known = stated_pulses(file)
    keys = tuple(state.source_key(f"asked {name}", file.sha256) for name in ("pulse file", "pulses per revolution"))
    number = 1 if known is None else known.pulses_per_revolution
    label, number_key = FORM_LABELS["pulses_per_revolution"], keys[1]
    looks: dict[str, Any] = {"on_change": _count_pulses, "args": (file, number_key)}
    place.number_input(label, value=number, min_value=1, step=1, key=number_key, **looks)
    about = (
        "Text with one time per line, in seconds unless its heading states another unit, e.g. time [ms]; 0 is the "
        "start of the recording. The pulses are those of the reference shaft."
    )
    looks = {"on_change": _take_pulses, "args": (file, *keys), "max_upload_size": LARGEST_PULSE_FILE_MB}
    given = st.file_uploader("File of pulse times", key=keys[0], help=about, **looks)
    if given is None and known is not None:
        st.caption(f"Still in use: {as_typed(known.name)}")


def _count_pulses(file: ChosenFile, key: str) -> None:
    if (known := stated_pulses(file)) is not None:
        _give_pulses(file, replace(known, pulses_per_revolution=st.session_state[key]))


def _take_pulses(file: ChosenFile, key: str, number_key: str) -> None:
    given, number = st.session_state[key], st.session_state[number_key]
    if given is None:
        _give_pulses(file, None)
    else:
        content = given.getvalue()
        _give_pulses(file, PulseFile(given.name, sha256(content).hexdigest(), content, number))


def _key(file: ChosenFile) -> str:
    return state.source_key("machine", f"{file.sha256} {file.rig_name}")


def describe(file: ChosenFile, text: str, pulses: PulseFile | None = None) -> None:
    """Use the text of a rig file for a file's machine in this session, and times of pulses if they are given."""
    st.session_state[_key(file)] = text
    if pulses is not None:
        st.session_state[_pulses_key(file)] = pulses
    # the form's tables restart from the text
    version = state.source_key("machine version", file.sha256)
    st.session_state[version] = st.session_state.get(version, 0) + 1


def _take(file: ChosenFile, text: str) -> None:
    describe(file, text)
    st.session_state[_CHANGED] = True


def _is_number(name: str) -> bool:
    return name.endswith(("_teeth", "_mm", "_deg", "_order", "_rpm", "_percent", "_nm", "_kw", "elements")) or name in {
        "scale",
        "offset",
        *DEFAULTS,
    }


def _fits_form(table: Table) -> bool:
    """Whether the form's fields accept the texts and numbers that they would show; a file may hold anything."""
    single = ("speed", *FACTS)
    groups = {kind: table.get(kind, []) for kind in COLUMNS} | {kind: [table.get(kind, {})] for kind in single}
    names = (*COLUMNS.values(), *SPEED_SOURCES.values(), *FACTS.values())
    shown = {name for group in names for name in group} | {"source"}

    def fits(name: str, value: object) -> bool:
        is_number = isinstance(value, int | float) and abs(value) <= LARGEST
        return name not in shown or (is_number if _is_number(name) else isinstance(value, str))

    return isinstance(table.get("name", ""), str) and all(
        isinstance(rows, list)
        and len(rows) <= MOST_ROWS
        and all(isinstance(row, dict) and all(fits(*item) for item in row.items()) for row in rows)
        for rows in groups.values()
    )


def _form(
    file: ChosenFile,
    table: Table,
    text: str,
    channels: Sequence[str],
    first: DeltaGenerator,
    of_speed: DeltaGenerator,
) -> Table:
    """Return the rig's table as edited in the form; keys that the form does not show are kept.

    Sampling rate and speed go into the place `of_speed`, name and shafts into `first`, the wider tables below both.
    """
    version = st.session_state.get(state.source_key("machine version", file.sha256), 0)

    def key(name: str) -> str:
        return state.source_key(f"{name} {version}", f"{file.sha256} {len(text)}")

    edited: Table = dict(table)
    name = first.text_input("Machine", table.get("name", ""), key=key("machine name"))
    edited |= {"name": name} if name or "name" in table else {}
    for kind in COLUMNS:
        with first if kind == "shaft" else st.container():
            st.markdown(f"**{FORM_TABLES[kind]}**", help=ABOUT.get(kind))
            edited[kind] = _edit(kind, list(table.get(kind, [])), edited, key(kind), channels)
    shafts = _shafts(edited)
    with of_speed:
        speed = _edit_speed(file, dict(table.get("speed", {})), shafts, key, channels)
    with st.container(key="machine-facts"):
        for kind, choices in (("operating_point", shafts), ("machine", MOUNTINGS)):
            st.markdown(f"**{FORM_TABLES[kind]}** :small[:gray[{ABOUT[kind]}]]")
            edited[kind] = _edit_facts(kind, dict(table.get(kind, {})), choices, key)
    edited = {name: value for name, value in edited.items() if value not in ([], {}) or table.get(name) == value}
    edited.pop("speed", None)
    return edited | ({"speed": speed} if speed else {})


def _shafts(rig: Table) -> list[str]:
    """Return the shafts of a rig's table: those listed, or else those that pairs and bearings name."""
    listed = [row.get("name") for row in rig.get("shaft", [])]
    users = [row.get(key) for kind in ("pair", "bearing") for row in rig.get(kind, []) for key in SHAFT_KEYS]
    return list(dict.fromkeys(str(name) for name in listed or users if name))


def _edit_facts(kind: str, known: Table, choices: Sequence[str], key: Callable[[str], str]) -> Table:
    """Show a row of fields, and return their values together with the keys that they do not show."""
    edited = {name: value for name, value in known.items() if name not in FACTS[kind]}
    for place, name in zip(st.columns(len(FACTS[kind])), FACTS[kind], strict=True):
        label, value, own = capitalised(FORM_LABELS.get(name, name)), known.get(name), key(f"{kind} {name}")
        chosen: float | str | None
        if _is_number(name):
            before = None if value is None else float(value)
            empty = EMPTY.get(name, "not known")
            chosen = place.number_input(label, value=before, step=1.0, format=NUMBER, placeholder=empty, key=own)
        else:
            chosen = _choose(place, name, choices, value, own)
        if chosen is not None:
            edited[name] = value if chosen == value else chosen  # whole numbers stay as the file has them
    return edited


def _choose(place: DeltaGenerator, name: str, offered: Sequence[str], known: str | None, key: str) -> str | None:
    """Ask for one of some names, or none; the file's own value is among them, right or wrong."""
    names = list(dict.fromkeys([*offered, *([known] if known is not None else [])]))
    at = None if known is None else names.index(known)
    return place.selectbox(capitalised(name), names, at, placeholder=EMPTY.get(name, "not known"), key=key)


def _edit(kind: str, rows: list[Table], rig: Table, key: str, channels: Sequence[str]) -> list[Table]:
    from pandas import DataFrame

    columns = COLUMNS[kind]
    shown = [row | {"unit": unit_text(str(row["unit"]))} if "unit" in row else row for row in rows]
    frame = DataFrame([[row.get(name) for name in columns] for row in shown], columns=list(columns))
    frame = frame.astype({name: "float64" if _is_number(name) else "object" for name in columns})
    result = st.data_editor(
        frame,
        key=key,
        num_rows="dynamic",
        hide_index=True,
        width="stretch",
        placeholder="",
        column_config=_config(kind, shown, rig, channels),
    )
    return [row for row in _rows(result, rows) if row]


def _rows(frame: DataFrame, before: list[Table]) -> list[Table]:
    """Return the rows of an edited table as in a rig file: empty cells are left out, whole numbers are integers."""
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


def _config(kind: str, rows: Sequence[Table], rig: Table, channels: Sequence[str]) -> dict[str, Any]:
    column = st.column_config
    choices: dict[str, Sequence[str]] = {
        "direction": ("ccw", "cw"),
        **dict.fromkeys(SHAFT_KEYS, _shafts(rig)),
        "bearing": sorted(bearing_catalogue()),
        "quantity": QUANTITIES,
        **({"channel": channels} if channels else {}),
    }
    made: dict[str, Any] = {}
    for name in COLUMNS[kind]:
        whole = FORM_LABELS.get(name, name)
        label = SHORT_LABELS.get(name, whole)
        texts = [str(row[name]) for row in rows if name in row]
        looks: dict[str, Any] = {"label": label, "width": _width_px(label, texts)}
        looks |= {"help": whole} if name in SHORT_LABELS else {}
        if name == COLUMNS[kind][0] and kind != "shaft":  # a small window scrolls the wide tables
            looks["pinned"] = True
        if name in choices:  # plus unlisted values of the file, such as a bearing with its maker's name
            made[name] = column.SelectboxColumn(**looks, options=list(dict.fromkeys([*choices[name], *texts])))
        elif name.endswith(("_teeth", "elements")):
            made[name] = column.NumberColumn(**looks, step=1, format="%d")
        elif _is_number(name):
            made[name] = column.NumberColumn(**looks, format="%g")
        else:
            made[name] = column.Column(**looks)
    return made


def _width_px(label: str, texts: Sequence[str]) -> int:
    """Return the width in pixels at which neither a heading with its icon nor a text of the column is clipped."""
    longest = max(map(len, texts), default=12 if label == "name" else 0)
    return min(max(48 + 7 * len(label), 20 + 7 * longest), WIDEST_PX)


SPEED_NAMES = re.compile(r"tach|keyphas|trig|enc|speed|rpm", re.IGNORECASE)
"""Usual names of channels that measure a speed."""


def _edit_speed(
    file: ChosenFile, speed: Table, shafts: Sequence[str], key: Callable[[str], str], channels: Sequence[str]
) -> Table:
    """Ask for the sampling rate and the source of the speed, and return the table of the source.

    A constant speed typed here takes effect at once, as do times of pulses; one in the rig file, which may be of any
    shaft, is changed there.
    """
    row, known, source = st.columns(5), [*SPEED_SOURCES, PULSE_TIMES], str(speed.get("source", "none"))
    about = "For files that do not state it; overrides what the file says."
    _ask_stated(row[0], file, "Sampling rate (Hz)", "rate", about)
    is_stated = stated(file, "speed") is not None
    first = "constant" if is_stated or source not in known else source
    first = first if stated_pulses(file) is None else PULSE_TIMES
    looks: dict[str, Any] = {"key": key("speed"), "on_change": _forget_speed, "args": (file,)}
    chosen = row[1].selectbox("Speed from", known, known.index(first), **looks)
    if chosen == "constant" and (is_stated or source != chosen):
        about = (
            "Speed of the reference shaft, if it was constant; refined from the signal. It overrides what the file "
            "says; without it, the speed is taken from the file or found in the signal."
        )
        _ask_stated(row[2], file, "Constant speed (rpm)", "speed", about)
        return speed if is_stated or source not in known else {}
    if chosen == PULSE_TIMES:
        _ask_pulses(row[2], file)
        return speed if source in SPEED_SOURCES else {}
    edited = dict(speed) if chosen == source else {}
    edited["source"] = chosen
    for place, name in zip(row[2:], SPEED_SOURCES[chosen], strict=False):
        if name == "channel":
            likely = sorted(channels, key=lambda channel: not SPEED_NAMES.search(channel))
            offered = list(dict.fromkeys([*([speed["channel"]] if "channel" in speed else []), *likely])) or ["tacho"]
            edited[name] = place.selectbox("Channel", offered, key=key("speed channel"))
            continue
        step = 1 if name == "pulses_per_revolution" else 0.1
        before = edited.get(name, DEFAULTS.get(name))
        value = place.number_input(
            f"Constant {FORM_LABELS[name].lower()}" if chosen == "constant" else FORM_LABELS[name],
            value=None if before is None else type(step)(before),
            step=step,
            format=NUMBER if step != 1 else None,
            placeholder="not known",
            key=key(f"speed {name}"),
        )
        if value is None:
            edited.pop(name, None)
        elif value != before:
            edited[name] = value
    shaft = _choose(row[4], "shaft", shafts, speed.get("shaft"), key("speed shaft"))
    edited.pop("shaft", None)
    return edited | ({"shaft": shaft} if shaft is not None else {})


# --------------------
# What follows from the machine: a drawing of the gear train, and its orders.
# --------------------


def _show_consequences(table: Table, *, shown_already: Rig | str | None) -> None:
    """Show what follows from a machine, or what is wrong with it unless `shown_already` says so."""
    try:
        rig = rig_from_dict(table)
    except GearsigError as error:
        if str(error) != shown_already:
            show_error(error)
        return
    if not rig.shafts:
        st.caption(":material/account_tree: Name a shaft to see its orders; with teeth, those of the mesh follow.")
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
    """Return an SVG drawing of the shafts with their gears and bearings; names from files are escaped."""
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
        given = st.file_uploader("Upload a rig file", type=["toml"], max_upload_size=1, key=f"take {_key(file)}")
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
        If it is not text.
    """
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError("is not text in UTF-8", where=name, remedy="save the rig file as UTF-8") from None
