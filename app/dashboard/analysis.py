"""From a recording to a diagnosis, with views of the processing chain behind it; only the open one is computed."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from functools import partial
from io import BytesIO
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np
import streamlit as st

from app.dashboard import address, state
from app.dashboard.cached import analysis_of, channel_problems, command_of, report_page, safe_file_name
from app.dashboard.components import component_of
from app.dashboard.state import AnalysisRequest, Chosen, ChosenFile
from app.dashboard.theme import is_dark
from app.dashboard.widgets.charts import download, offer_page, show_figure, show_lines, show_map, show_panel
from app.dashboard.widgets.chooser import choose_recording
from app.dashboard.widgets.crack import show_crack
from app.dashboard.widgets.machine import machine_text, show_machine
from app.dashboard.widgets.method import MethodPage, cached, show_method
from app.dashboard.widgets.spectrum import show_average, show_spectrum
from app.dashboard.widgets.texts import (
    as_typed,
    in_page_text,
    show_error,
    show_facts,
    show_table,
    show_unknown_speed,
    show_warnings,
)
from app.dashboard.widgets.verdict import show_verdict
from gearsig import plot
from gearsig.angle import resample_to_angle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis, IndicatorChange, changes
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import csv_text, unit_text
from gearsig.indicators import Indicator
from gearsig.methods import METHODS
from gearsig.orders import OrderMap, frequency_map, order_map
from gearsig.plot import ChartLine, level_colours
from gearsig.report import (
    bearing_cursors,
    check_pdf,
    highest_order_of_interest,
    line_cursors,
    marked_positions,
    page_pdf,
    provenance_rows,
    speed_is_constant,
    verdict_picture,
)
from gearsig.spectra import Spectrum

if TYPE_CHECKING:
    from pandas import DataFrame


# --------------------
# The chain of one analysis as a strip of small pictures, drawn from the open recording.
# --------------------


_strip = component_of("strip")
WIDTH, HEIGHT, N = 100.0, 44.0, 120
N_LOOKED_AT = 1 << 16
"""Number of samples that suffice for a small picture."""
ICONS = {
    "Machine": "M10 13H90M10 31H90M38 6V20M48 6V20M38 6H48M38 20H48M38 20V42H48V20M70 9V17M74 9V17M20 27V35M24 27V35",
    "Indicators": "M8 8H92M8 18H70M8 28H84M8 38H52",
    "Report": "M34 3H58L68 13V41H34ZM58 3V13H68M40 20H62M40 27H62M40 34H54",
}
FIRST_OF = {"tooth": "Average", "bearing": "Envelope", "resonance": "Map", "motion": "Starts and stops"}
"""View that is opened first, by the subject of the verdict."""


def choose_view(analysis: Analysis, names: Sequence[str]) -> str:
    """Return the view that the user chose, which the address also names."""
    picture = verdict_picture(analysis)
    first = FIRST_OF.get(picture.about if picture is not None else "", "Order spectrum")
    if analysis.motion is not None:
        first = FIRST_OF["motion"]
    elif isinstance(analysis.shaft_angle, CannotTell):
        # The form asks for the speed, even where the machine is described.
        first = "Machine" if analysis.rig is None or not analysis.rig.shafts else "Spectrum"
    chosen = address.chosen(state.TAB, "view", names, first if first in names else names[0])
    angle = analysis.shaft_angle
    speed_rpm = None if isinstance(angle, CannotTell) else angle.mean_speed_rpm  # stated later, it adds pictures
    items = _tiles(
        state.view_key(f"tiles {is_dark()} {speed_rpm} {analysis.rig and analysis.rig.key()}", analysis),
        tuple(names),
        analysis,
    )
    _strip(
        key="strip",
        data={"items": items, "chosen": chosen},
        on_view_change=_take_view,
    )
    return chosen


def _take_view() -> None:
    st.session_state[state.TAB] = st.session_state["strip"]["view"]


@st.cache_data(max_entries=16, show_spinner=False)
def _tiles(key: str, names: tuple[str, ...], _analysis: Analysis) -> list[dict[str, object]]:
    del key  # it stands for the analysis
    channel = next(iter(_analysis.channels), None)
    return [{"name": name, **_tile(name, _analysis, channel)} for name in names]


def _tile(name: str, analysis: Analysis, channel: ChannelAnalysis | None) -> dict[str, object]:
    if name in ICONS or channel is None:
        return {"path": ICONS.get(name, "")}
    if name == "Speed":
        angle = analysis.shaft_angle
        return {"path": "" if isinstance(angle, CannotTell) else _line(angle.speed_rev_per_s, min_span=0.02)}
    if name in ("Spectrum", "Order spectrum", "Envelope"):
        return {"path": _spectrum(name, analysis, channel), "fill": True}
    values = np.asarray(analysis.recording.values(channel.channel)[:N_LOOKED_AT], dtype=np.float64)
    if name in ("Map", "Time–frequency"):
        short = name == "Time–frequency"
        return {"picture": _map(channel, values[: N_LOOKED_AT // 8] if short else values, over_orders=not short)}
    draw = {"Average": _ring(channel), "Modes": _modes(values[: 4 * N]), "Phase": _phase(values[:2048])}
    return {"path": draw[name]} if name in draw else {"path": _waveform(values), "fill": True}


def _points(x: FloatArray, y: FloatArray) -> str:
    return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _scaled(values: FloatArray, *, min_span: float = 0.0) -> FloatArray:
    """Return the values' heights in the picture; a span below `min_span` of their mean is not magnified."""
    low, high = float(np.min(values)), float(np.max(values))
    half = max((high - low) / 2, min_span * abs(low + high) / 2) or 1.0
    return HEIGHT / 2 - (values - (low + high) / 2) / half * (HEIGHT / 2 - 3)


def _line(values: FloatArray, *, min_span: float = 0.0) -> str:
    chosen = values[np.linspace(0, len(values) - 1, N).astype(int)]
    return _points(np.linspace(0, WIDTH, N), _scaled(chosen, min_span=min_span))


def _columns(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the lowest and the highest value of each column."""
    starts = np.linspace(0, len(values), min(N, len(values)) + 1).astype(int)[:-1]
    return np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


def _waveform(values: FloatArray) -> str:
    low, high = _columns(values)
    both = _scaled(np.concatenate([high, low[::-1]]))
    x = np.linspace(0, WIDTH, len(low))
    return _points(np.concatenate([x, x[::-1]]), both) + "Z"


def _spectrum(name: str, analysis: Analysis, channel: ChannelAnalysis) -> str:
    spectrum: Spectrum | None = {
        "Spectrum": channel.spectrum,
        "Order spectrum": channel.order_spectrum,
        "Envelope": channel.envelope_spectrum,
    }[name]
    if spectrum is None:
        return ""
    stop = len(spectrum.values)
    if name == "Order spectrum":
        stop = spectrum.index_of(highest_order_of_interest(analysis, spectrum)) + 1
    values = spectrum.values[min(3, stop - 1) : stop]
    _, high = _columns(values)
    if name != "Envelope":
        high = np.log(np.maximum(high, float(high.max()) * 1e-4 or 1.0))
    x = np.linspace(0, WIDTH, len(high))
    return f"M0 {HEIGHT}L" + _points(x, _scaled(high))[1:] + f"L{WIDTH} {HEIGHT}Z"


def _map(channel: ChannelAnalysis, values: FloatArray, *, over_orders: bool) -> str:
    from PIL import Image
    from scipy.signal import stft

    if over_orders and channel.order_map is not None:
        levels = channel.order_map.values[:, : channel.order_map.values.shape[1] // 3]
    else:
        n = 256 if not over_orders else 1024
        levels = np.abs(stft(values, nperseg=min(n, len(values)))[2]).T
        levels = levels[:, : levels.shape[1] // (2 if over_orders else 1)]
    if not over_orders:
        levels = levels.T  # time goes to the right
    for axis, n_max in ((0, 44), (1, 100)):
        starts = np.linspace(0, levels.shape[axis], min(n_max, levels.shape[axis]) + 1).astype(int)[:-1]
        levels = np.maximum.reduceat(levels, starts, axis=axis)
    decibels = 20 * np.log10(np.maximum(levels, float(levels.max()) * 1e-3 or 1.0))
    top = np.percentile(decibels, 99)
    shade = np.clip(255 * (decibels - top + 40) / 40, 0, 255).astype(np.uint8)
    buffer = BytesIO()
    Image.fromarray(level_colours(dark=is_dark())[shade[::-1]]).save(buffer, format="png")
    return "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")


def _ring(channel: ChannelAnalysis) -> str:
    averages = sorted(channel.averages.items(), key=lambda entry: entry[0][1] != "residual")
    if not averages:
        return ""
    low, high = _columns(averages[0][1].values)
    chosen = np.where(np.abs(low) > np.abs(high), low, high)
    radius = 14 + 8 * chosen / (float(np.abs(chosen).max()) or 1.0)
    turn = np.linspace(0, 2 * np.pi, len(chosen), endpoint=False)
    return _points(WIDTH / 2 + radius * np.sin(turn), HEIGHT / 2 - radius * np.cos(turn)) + "Z"


def _modes(values: FloatArray) -> str:
    """Return paths of three frequency bands of the signal, of equal energy, one below the other."""
    lines = np.fft.rfft(values - values.mean())
    shares = np.cumsum(np.abs(lines) ** 2)
    borders = [0, *np.searchsorted(shares, shares[-1] * np.array([1, 2]) / 3), len(lines)]
    parts = []
    for i in range(3):
        kept = np.zeros_like(lines)
        kept[borders[i] : borders[i + 1] or 1] = lines[borders[i] : borders[i + 1] or 1]
        part = np.fft.irfft(kept, len(values))[: 2 * N]
        y = 8 + 14 * i - 6 * part / (float(np.abs(part).max()) or 1.0)
        parts.append(_points(np.linspace(0, WIDTH, len(y)), y))
    return "".join(parts)


def _phase(values: FloatArray) -> str:
    """Return the path of velocity over displacement of the signal's low frequencies."""
    lines = np.fft.rfft(values - values.mean())
    lines[max(3, len(lines) // 12) :] = 0
    x = np.fft.irfft(lines, len(values))[:500]
    v = np.gradient(x)
    scale = float(np.abs(x).max()) or 1.0, float(np.abs(v).max()) or 1.0
    return _points(WIDTH / 2 + 40 * x / scale[0], HEIGHT / 2 - 18 * v / scale[1])


def show_speed(analysis: Analysis) -> None:
    """Show the speed of the reference shaft and how it was found, or why it is not known."""
    angle = analysis.shaft_angle
    if isinstance(angle, CannotTell):
        show_unknown_speed(angle)
        return
    (lowest, highest), uncertainty = angle.speed_range_rpm, angle.relative_speed_uncertainty
    numbers = {
        "Mean speed": f"{angle.mean_speed_rpm:.6g} rpm",
        "Lowest to highest": f"{lowest:.5g} – {highest:.5g} rpm",
        "Uncertainty of the mean": f"± {100 * uncertainty:.2g} %" if isfinite(uncertainty) else "not known",
        "Revolutions": f"{angle.n_revolutions:.5g}",
        "Quality": f"{angle.quality:.2f} of 1",
    }
    show_facts(st.columns(len(numbers)), numbers)
    st.caption(f"Shaft {as_typed(angle.shaft or 'of reference')}, {plot.METHODS[angle.method]}.")
    show_panel(plot.speed_panel(angle), state.view_key("speed chart", analysis), 60.0)
    show_warnings(angle.notes, quiet=True)


STARTS_AND_STOPS = (
    "The machine starts and stops: spectra, orders and averages need a sustained speed. Backlash, impacts and forces "
    "are shown under Starts and stops if the motion of both gears was recorded."
)


def show_of_channel(analysis: Analysis, view: Callable[[Analysis, ChannelAnalysis], None]) -> None:
    """Show a view of the channel that the user chooses; the default is the channel of the verdict's picture."""
    channels = {channel.channel: channel for channel in analysis.channels}
    if not channels:
        is_unsteady = any(finding.code == "start-stop" for finding in analysis.findings)
        st.info(STARTS_AND_STOPS if is_unsteady else "There is no vibration channel with a signal.")
        return
    picture = verdict_picture(analysis)
    name = picture.channel.channel if picture is not None else next(iter(channels))
    if len(channels) > 1:
        # Keyed by the default: another machine gives another verdict, which may rest on another channel.
        looks = {
            "key": state.view_key(f"{state.CHANNEL} {name}", analysis),
            "name": "channel",
        }
        name = address.ask_one(st.columns(3)[0].selectbox, "Channel", list(channels), first=name, **looks)
    view(analysis, channels[name])


def show_frequency_spectrum(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the amplitude spectrum over frequency."""
    spectrum = channel.spectrum
    cursors = line_cursors(analysis, spectrum) if speed_is_constant(analysis) else ()
    marked = marked_positions(analysis, spectrum, channel.channel)
    show_spectrum(analysis, spectrum, cursors, f"spectrum of {channel.channel}", marked=marked)
    if not cursors and not isinstance(analysis.shaft_angle, CannotTell):
        st.caption("The speed changes, so lines that follow it are smeared over frequency: see the order spectrum.")


def show_order_spectrum(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the spectrum over orders of the reference shaft."""
    spectrum = channel.order_spectrum
    if spectrum is None:
        if isinstance(analysis.shaft_angle, CannotTell):
            show_unknown_speed(analysis.shaft_angle)
        else:
            st.info("There are too few revolutions for an order spectrum.")
        return
    show_spectrum(
        analysis,
        spectrum,
        line_cursors(analysis, spectrum),
        f"orders of {channel.channel}",
        marked=marked_positions(analysis, spectrum, channel.channel),
        shown=(0.0, highest_order_of_interest(analysis, spectrum)),
    )


def show_envelope(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the envelope spectrum, where impacts of bearings and teeth show as lines."""
    spectrum = channel.envelope_spectrum
    if spectrum is None:
        st.info("There is no envelope spectrum: no frequency band carries enough of the signal.")
        return
    cursors = bearing_cursors(analysis, spectrum)
    bearings = [cursor.position for cursor in cursors if cursor.kind == "bearing"]
    end = float(spectrum.positions[-1])
    shown = (0.0, min(end, 1.08 * max(bearings))) if bearings and spectrum.resolution < max(bearings) else None
    if channel.envelope_band_hz is not None:
        low, high = channel.envelope_band_hz
        st.markdown(f"Envelope of {as_typed(channel.channel)} in the band **{low:.0f} to {high:.0f} Hz**")
    marked = marked_positions(analysis, spectrum, channel.channel, of_bearings=True)
    name = f"envelope of {channel.channel}"
    show_spectrum(analysis, spectrum, cursors, name, marked=marked, shown=shown, scale="Linear")


MOST_CHANNELS = 12
"""Maximum number of channels shown over time."""


def show_channels(analysis: Analysis) -> None:
    """Show chosen channels over a window of time, and the table of channels with their problems."""
    recording = analysis.recording
    for warning in recording.warnings:
        st.warning(as_typed(in_page_text(warning)), icon=":material/warning:")
    _show_quality(analysis)
    names = address.ask(
        st.multiselect,
        "Channels shown",
        recording.channel_names,
        key=state.view_key("channels shown", analysis),
        name="channels",
        first=list(recording.channel_names[:4]),
        read=address.some_of(recording.channel_names, maximum=MOST_CHANNELS),
        max_selections=MOST_CHANNELS,
    )
    time = np.arange(recording.n_samples) / recording.sampling_rate_hz
    for name in names:
        channel = recording.channels[recording.index(name)]
        quantity = channel.quantity.replace("_", " ") if channel.quantity != "unknown" else "value"
        st.markdown(f"**{as_typed(name)}** {as_typed(channel.position)}")
        lines, whole = [ChartLine(time, recording.values(name), name)], (0.0, recording.duration_s)
        panel = plot.LinePanel(lines, "time (s)", plot.with_unit(quantity, channel.unit), x_limits=whole)
        show_lines(panel, state.view_key(f"time of {name}", analysis), height_px=200)


def _show_quality(analysis: Analysis) -> None:
    recording = analysis.recording
    problems = channel_problems(state.view_key("problems", analysis), recording)
    table = {
        "channel": recording.channel_names,
        "data quality": [
            ", ".join(p.kind for p in problems if p.channel == c.name) or ("good" if c.is_vibration else "not examined")
            for c in recording.channels
        ],
        "quantity": [c.quantity.replace("_", " ") for c in recording.channels],
        "unit": [unit_text(c.unit) or "not known" for c in recording.channels],
        "smallest": [float(row.min()) for row in recording.samples],
        "mean": [float(row.mean(dtype=np.float64)) for row in recording.samples],
        "largest": [float(row.max()) for row in recording.samples],
        "position": [c.position for c in recording.channels],
    }
    config = {"channel": st.column_config.TextColumn(width="small")}
    show_table(table, number=".4g", column_config=config, width="stretch")
    for problem in problems:
        text = f"**{as_typed(problem.channel)}** is {problem.kind}: {as_typed(problem.evidence)}. "
        st.warning(f"{text}{as_typed(problem.remedy)}.", icon=":material/warning:")


def show_indicators(analysis: Analysis) -> None:
    """Show the indicators with filters, and offer them as CSV."""
    if not analysis.indicators:
        st.info("There are no indicators: no vibration channel could be analysed.")
        return
    table = indicator_frame(analysis.indicators, changes(analysis) if analysis.reference is not None else ())
    words, *choices = st.columns(3, vertical_alignment="bottom")
    key = state.view_key("indicator words", analysis)
    text = address.ask(words.text_input, "Name contains", key=key, name="contains", first="", read=address.words)
    kept = table[table["indicator"].str.contains(text, case=False, regex=False)] if text else table
    for column, (label, name) in zip(choices, (("Channels", "channel"), ("Gear, shaft or band", "of")), strict=True):
        known = [str(value) for value in table[name].unique() if value]
        key, read = state.view_key(f"indicator {name}", analysis), address.some_of(known)
        chosen = address.ask(column.multiselect, label, known, key=key, name=name, first=[], read=read)
        kept = kept[kept[name].isin(chosen)] if chosen else kept
    # at 800 pixels the columns up to the gear fit; those that repeat others or are empty take no room
    widths = {"indicator": 168, "value": 80, "unit": 56, "channel": 66, "of": 140, "band": 130}
    config: dict[str, Any] = {
        name: st.column_config.Column(width=px, pinned=name == "indicator") for name, px in widths.items()
    }
    config |= {str(name): None for name in table if (table[name] == "").all()}
    formats = {"change (dB)": "+.1f"} if "change (dB)" in kept else {}
    shown = kept.assign(band=kept["band"].where(kept["band"] != kept["of"], ""))
    show_table(shown, formats=formats, width="stretch", height=520, column_config=config, placeholder="–")
    below = st.container(horizontal=True, horizontal_alignment="distribute", vertical_alignment="center")
    below.caption(f"{len(kept)} of {len(table)} indicators", width="content")
    with below:
        download("Download CSV", csv_text(kept), "indicators.csv")


def indicator_frame(indicators: tuple[Indicator, ...], compared: tuple[IndicatorChange | None, ...] = ()) -> DataFrame:
    """Return a table of indicators, one per row; with changes, also the reference values and the changes in dB."""
    from pandas import DataFrame

    rows = [
        {
            "indicator": i.name,
            "value": i.value,
            "unit": unit_text(i.unit),
            "channel": i.channel,
            "of": i.gear or i.bearing or i.shaft or i.band,
            "computed on": i.computed_on,
            "band": i.band,
            "note": i.note,
        }
        for i in indicators
    ]
    table = DataFrame(rows)
    if compared:
        then = [nan if change is None else change.reference_value for change in compared]
        moved = [nan if change is None or change.change_db is None else change.change_db for change in compared]
        table.insert(2, "reference", then)
        table.insert(3, "change (dB)", moved)
    return table


order_map_of = cached(6, "Computing the map …")(order_map)
frequency_map_of = cached(6, "Computing the map …")(frequency_map)
RUN_SHARE = 0.05
"""A speed that changes by more than this share of its mean is offered as an axis."""


def show_map_over_time(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show levels over order or frequency, along time or speed: order map, waterfall and Campbell diagram."""
    angle = analysis.shaft_angle
    if isinstance(angle, CannotTell):
        show_unknown_speed(angle)
        return
    row = st.container(horizontal=True)
    axes, key = ("Order", "Frequency"), state.view_key("map lines", analysis)
    lines = address.ask_one(row.segmented_control, "Lines over", axes, key=key, name="lines", required=True)
    ways = ("Time",) if angle.is_steady(RUN_SHARE) else ("Time", "Speed")
    along = ways[0]
    if len(ways) > 1:
        key = state.view_key(f"map along {ways}", analysis)
        along = address.ask_one(row.segmented_control, "Along", ways, key=key, name="along", required=True)
    shown_map = _map_of(analysis, channel, over_order=lines == "Order")
    rows = np.argsort(shown_map.speed_rpm, kind="stable") if along == "Speed" else np.arange(len(shown_map.time_s))
    y, also = shown_map.time_s[rows], (shown_map.speed_rpm[rows], "rpm")
    if along == "Speed":
        y, also = also[0], (y, "s")
    highest = float(shown_map.positions[-1])
    if channel.order_spectrum is not None:
        of_interest = highest_order_of_interest(analysis, channel.order_spectrum)
        highest = min(highest, of_interest * (1.0 if lines == "Order" else angle.speed_range_rpm[1] / 60.0))
    cursors = [c for c in line_cursors(analysis, shown_map) if c.kind == "mesh"]
    # over frequency and speed an order is a ray
    rays = [] if lines == "Order" else [ChartLine(c / 60.0 * y, y, "mesh", 2) for c in _mesh_orders(analysis)]
    panel = plot.LevelPanel(
        plot.decibels(shown_map.values[rows], shown_map.scaling, shown_map.unit),
        shown_map.positions,
        y,
        shown_map.axis_label,
        "time (s)" if along == "Time" else "speed (rpm)",
        plot.decibel_text(shown_map.unit),
        lines=rays if along == "Speed" else (),
        cursors=cursors if lines == "Order" else (),
    )
    key = state.view_key(f"map of {channel.channel} {lines} {along}", analysis)
    show_map(panel, key, also=also, shown=(0.0, highest))
    st.caption(
        "Lines of the machine are vertical over order and slanted over frequency and speed (a Campbell diagram, with "
        "the mesh as rays); resonances stay at their frequency. The pointer shows level, speed and time."
    )


def _mesh_orders(analysis: Analysis) -> list[float]:
    orders = [
        c for channel in analysis.channels[:1] if (s := channel.order_spectrum) for c in line_cursors(analysis, s)
    ]
    return [cursor.position for cursor in orders if cursor.kind == "mesh"]


def _map_of(analysis: Analysis, channel: ChannelAnalysis, *, over_order: bool) -> OrderMap:
    angle, recording, name = analysis.shaft_angle, analysis.recording, channel.channel
    assert not isinstance(angle, CannotTell)  # noqa: S101 - checked before
    if over_order and channel.order_map is not None and channel.order_map.axis == "order":
        return channel.order_map
    if over_order:
        signal = resample_to_angle(recording, angle, channels=[name])
        return order_map_of(signal, name, revolutions_per_block=max(4, min(10, int(angle.n_revolutions) // 8)))
    unit = recording.channels[recording.index(name)].unit
    n = 1 << max(8, min(13, (recording.n_samples // 40).bit_length()))
    values = recording.values(name)
    return frequency_map_of(values, recording.sampling_rate_hz, angle, n_per_block=n, unit=unit, source=name)


def show_start_stop(analysis: Analysis) -> None:
    """Show the speed profile, planes of the teeth, impacts and force from motion, one below the other."""
    from gearsig.report import start_stop_figures

    if analysis.motion is None:
        return
    for number, drawn in enumerate(start_stop_figures(analysis.motion)):
        show_figure(drawn.figure, drawn.alternative, state.view_key(f"motion {number}", analysis))
        st.caption(as_typed(drawn.caption))


def show_report(analysis: Analysis, request: AnalysisRequest) -> None:
    """Offer the page that `gearsig report` writes, and the command that repeats the analysis."""
    st.markdown(
        "One page: verdict, findings, figures, indicators and provenance. The HTML is a single file that opens offline "
        "and contains no scripts; the PDF is for printing and omits the table of indicators."
    )
    stem = safe_file_name(request.name).split(".")[0] or "recording"
    key = state.view_key("report", analysis)
    pdf: Callable[[], bytes] | None = partial(page_pdf, analysis, command=command_of(request))
    try:
        check_pdf()
    except InputError as error:
        pdf = None
        st.caption(as_typed(f"{error.what}: {error.remedy}"))
    offer_page("Download the report", lambda: report_page(request, analysis), f"{stem}.html", key, pdf=pdf)
    st.markdown("The same diagnosis from the command line:")
    st.code(command_of(request), language="bash", wrap_lines=True)
    _show_provenance(analysis)


def _show_provenance(analysis: Analysis) -> None:
    rows = provenance_rows(analysis, "")
    st.markdown("Provenance:")
    # a list of facts with short names
    with st.container(key="provenance"):
        st.table({name: as_typed(text) for name, text in rows}, border="horizontal")


Of = Callable[[Analysis, ChannelAnalysis], None]
Whole = Callable[[Analysis], None]


def _methods(view: str) -> dict[str, Of]:
    """Return the methods of `METHODS` that belong to a view, by title."""
    return {method.title: partial(show_method, name) for name, method in METHODS.items() if method.view == view}


def _show_severity(analysis: Analysis, channel: ChannelAnalysis) -> None:
    try:
        show_crack(MethodPage(analysis, channel, "crack severity"))
    except GearsigError as error:
        show_error(error)


MOTION = "Starts and stops"
"""View of machines that start and stop, if the teeth could be examined."""
OF_RECORDING: dict[str, Whole] = {
    MOTION: show_start_stop,
    "Waveform": show_channels,
    "Speed": show_speed,
    "Indicators": show_indicators,
}
_BUILT_IN: dict[str, dict[str, Of]] = {
    "Spectrum": {"Spectrum": show_frequency_spectrum},
    "Order spectrum": {"Order spectrum": show_order_spectrum},
    "Map": {"Map": show_map_over_time},
    "Average": {"Synchronous average": show_average, "Crack severity": _show_severity},
    "Envelope": {"Envelope spectrum": show_envelope},
    "Time–frequency": {},
    "Modes": {},
    "Phase": {},
}
OF_CHANNEL = {view: built_in | _methods(view) for view, built_in in _BUILT_IN.items()}
MACHINE, REPORT = "Machine", "Report"
VIEWS = (MACHINE, "Waveform", "Speed", *OF_CHANNEL, "Indicators", REPORT)


def show_views(analysis: Analysis, file: ChosenFile, chosen: Chosen) -> None:
    """Show the chain as a strip of small pictures, and the chosen one in full."""
    names = (MOTION, *VIEWS) if analysis.motion is not None else VIEWS
    name = choose_view(analysis, names)
    with st.container(key="view"):
        _show(name, analysis, file, chosen.request)


@st.fragment
def _show(name: str, analysis: Analysis, file: ChosenFile, request: AnalysisRequest) -> None:
    """Show one view; changes within it rerun only this view."""
    with address.of_part("view"):
        if name == MACHINE:
            show_machine(file, analysis.recording.channel_names)
        elif name in OF_RECORDING:
            OF_RECORDING[name](analysis)
        elif name in OF_CHANNEL:
            show_of_channel(analysis, partial(_show_one_of, OF_CHANNEL[name], name))
        else:
            show_report(analysis, request)


def _show_one_of(methods: dict[str, Of], view: str, analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show one method of a view; the user chooses if there are several."""
    name = next(iter(methods))
    if len(methods) > 1:
        page = MethodPage(analysis, channel, "")
        key = f"method of {view}"
        name = page.choose(st, "Method", list(methods), name="show", key=key, named=False, as_written=True)
    methods[name](analysis, channel)


def show() -> None:
    """Choose, analyse, show."""
    chosen = choose_recording()
    state.remember(chosen[1] if chosen is not None else None)
    if chosen is None:
        st.info("Choose a recording on the left, or start with a sample.", icon=":material/upload_file:")
        st.page_link(state.pages()["start"], label="Open a recording, or one of the samples", icon=":material/home:")
        return
    analysis = analysed(*chosen)
    if analysis is not None:
        show_verdict(analysis)
        show_views(analysis, *chosen)


def analysed(file: ChosenFile, chosen: Chosen) -> Analysis | None:
    """Return the analysis; if the file or the machine prevents it, show why and offer to correct the machine."""
    try:
        return analysis_of(chosen.request, chosen.content, chosen.reference)
    except GearsigError as error:
        show_error(error)
        speaks_of_form = in_page_text(str(error)) != str(error)
        if machine_text(file) or chosen.request.pulses is not None or speaks_of_form:
            show_machine(file, is_reported=True)
        return None
