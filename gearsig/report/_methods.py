"""Answers of methods as files and in reports: which methods suit a recording, and their figures."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import numpy as np

from gearsig.angle import ShaftAngle
from gearsig.cache import write_whole
from gearsig.checks import closest_match_hint, one_of
from gearsig.errors import InputError, RefusalError
from gearsig.methods import METHODS, TRANSFORMS, MethodAnswer, apply_method
from gearsig.plot import Picture, embed, svg_panel
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording
from gearsig.report._files import write_folder
from gearsig.report._json import plain


def write_answer(answer: MethodAnswer, folder: str | Path) -> tuple[Path, ...]:
    """Write figure (PNG and SVG), table (CSV), arrays (HDF5) and numbers (JSON), each atomically.

    Parameters
    ----------
    answer : MethodAnswer
    folder : path
        Created if missing.

    Returns
    -------
    tuple of Path
    """
    from pandas import DataFrame

    stem, figure = answer.method, answer.draw()
    table: str = DataFrame(dict(answer.table)).to_csv(index=False, float_format="%.9g")
    texts = {f"{stem}.csv": table, f"{stem}.json": answer_json(answer)}
    drawn = dict.fromkeys((f"{stem}.png", f"{stem}.svg"), figure)
    png, svg, csv, numbers = write_folder(folder, drawn, texts, dpi="figure")
    arrays = write_whole(csv.with_suffix(".h5"), lambda file: _write_arrays(answer, file))
    return png, svg, csv, arrays, numbers


def _write_arrays(answer: MethodAnswer, file: IO[bytes]) -> None:
    import h5py

    groups = {"table": answer.table, "matrices": answer.matrices, "axes": answer.axes}
    groups |= {f"tables/{what}": table for what, table in answer.tables.items()}
    content = BytesIO()  # HDF5 fails in several ways when the disk is full
    with h5py.File(content, "w") as arrays:
        arrays.attrs["method"], arrays.attrs["channel"] = answer.method, answer.channel
        for group, columns in groups.items():
            for title, values in columns.items():
                column = np.asarray(values)
                written = column.astype(h5py.string_dtype()) if column.dtype.kind in "OU" else column
                arrays.create_dataset(f"{group}/{title.replace('/', '∕')}", data=written, track_order=True)
    file.write(content.getbuffer())


N_NAMED_COLUMNS = 40
"""Maximum number of a table's columns that JSON names: maps have one column for each line."""


def answer_json(answer: MethodAnswer) -> str:
    """Return the answer of a method as JSON, with short tables but without arrays."""
    about: dict[str, Any] = {"method": answer.method, "channel": answer.channel, "shows": answer.caption}
    about |= answer.numbers
    if answer.warnings:
        about["warnings"] = list(answer.warnings)
    columns = list(answer.table)
    about |= {"n_columns": len(columns), "columns": columns[:N_NAMED_COLUMNS]}
    for what, table in {"table": answer.table, **answer.tables}.items():
        n_rows = max((len(column) for column in table.values()), default=0)
        if n_rows * len(table) <= 2000:
            about[what] = {title: np.asarray(column).tolist() for title, column in table.items()}
    return json.dumps(plain(about), ensure_ascii=False, indent=2, allow_nan=False)


_REVOLUTIONS_SHOWN = 12.0
"""Length of a map on a page, short enough to show single impacts of a damaged tooth."""


def named_method(text: str) -> tuple[str, dict[str, Any]]:
    """Return method and options from "order-map", "time-frequency+squeezed-cwt" or "modes+squeezed-cwt"."""
    name, plus, transform = text.partition("+")
    if name not in METHODS:
        hint = closest_match_hint(name, list(METHODS))
        raise InputError(f"there is no method {name!r}", allowed=", ".join(METHODS), remedy=hint)
    takes = {option.name for option in METHODS[name].options}
    option = "then" if "then" in takes else "transform"
    if plus and option not in takes:
        raise InputError(f"{name} cannot be followed by a transform", remedy="modes+squeezed-cwt can")
    return name, {option: one_of(transform, "transform", TRANSFORMS)} if plus else {}


def fitting_methods(
    recording: Recording, angle: ShaftAngle | None, *, suspects_crack: bool = False, suspects_bearing: bool = False
) -> tuple[str, ...]:
    """Return the methods that suit a recording, in addition to those on each page.

    For a run-up or coast-down: the frequency map, beside the page's order map and levels over speed. For a suspected
    crack or other tooth damage: the squeezed transform of the most impulsive mode. Else for a suspected bearing: the
    kurtogram. For a simulated motion at steady speed: its Poincaré section in the phase plane.
    """
    names: list[str] = []
    sweeps = angle is not None and not angle.is_steady(0.1)
    if sweeps:
        names.append("frequency-map")
    if suspects_crack:
        names.append("modes+squeezed-cwt")
    elif suspects_bearing:
        names.append("kurtogram")
    if recording.truth is not None and angle is not None and not sweeps:
        names.append("poincare")
    return tuple(names)


def method_pictures(
    names: Sequence[str], prepared: PreparedRecording, channel: str = ""
) -> tuple[tuple[Picture, ...], tuple[str, ...]]:
    """Return the pictures of several methods for one channel, and why others have none.

    Maps over time show the first twelve revolutions, or all of a shorter recording.
    """
    pictures: list[Picture] = []
    reasons: list[str] = []
    for text in names:
        name, options = named_method(text)
        end_s = None
        try:
            if options:
                turns = prepared.shaft_angle.mean_speed_rpm / 60.0
                end_s = min(prepared.recording.duration_s, _REVOLUTIONS_SHOWN / turns)
            answer = apply_method(name, prepared, channel, end_s=end_s, **options)
        except RefusalError as refusal:
            reasons.append(f"{text}: {refusal}")
            continue
        title = f"{answer.caption[0].upper()}{answer.caption[1:]} (channel {answer.channel})"
        if not answer.panels:
            pictures.append(replace(embed(answer.draw(), "", title), title=title))
        for panel in answer.panels:
            shows = f"{panel.y} over {panel.x}, {answer.channel}."
            pictures.append(Picture.of_svg(svg_panel(panel), "", shows, title if panel is answer.panels[0] else ""))
    return tuple(pictures), tuple(reasons)
