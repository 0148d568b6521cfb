"""Orders taken out of a channel by a Vold–Kalman filter, with their levels from resampling beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import MethodPage, SignalSegment, cached, show_table, signal_of, waveforms_of
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import Axes, ChartLine, show_lines
from app.dashboard.widgets.messages import show_unknown_speed, show_warnings
from gearsig import orders as order_methods
from gearsig.angle import resample_to_angle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, CannotTell
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import readable
from gearsig.plot import unit_text, with_unit
from gearsig.report import speed_is_constant
from gearsig.rig import order_lines

MIN_LENGTH, MAX_EFFORT = 2**16, 1_600_000
"""Coupled orders take time as their number squared: so many samples times orders squared, but not less than that."""
KINDS = ("mesh", "shaft", "bearing", "sideband")
HANN_BANDWIDTH = 1.5
"""Noise bandwidth of a Hann window in lines: blocks of 1.5/B revolutions collect over B orders."""
RESIDUAL = "residual without all chosen orders"
separated = cached(4, "Separating the orders …")(order_methods.track_vold_kalman)
angle_signal = cached(4, "Resampling over the shaft's angle …")(resample_to_angle)


def show_order_tracking(page: MethodPage) -> None:
    """Show levels and waveforms of chosen orders of one channel."""
    if isinstance(page.analysis.shaft_angle, CannotTell):
        show_unknown_speed(page.analysis.shaft_angle)
        return
    left, right = st.columns(2)
    with left:
        orders = _choose_orders(page)
    with right:
        n_max = max(MIN_LENGTH, MAX_EFFORT // max(2, len(orders)) ** 2)
        segment = page.segment(n_first=250_000, n_max=n_max)
    settings = _choose_settings(page)
    if segment.angle is None:
        st.info("The shaft's angle is not known in this segment.")
        return
    values = tuple(orders.values())
    separation = separated(segment.recording, segment.channel, values, shaft_angle=segment.angle, **settings)
    tracks, reason = _tracks(segment, values, settings)
    by_name = dict(zip(orders, separation.orders, strict=True))
    _show_levels(page, segment, by_name, separation, tracks)
    show_warnings(separation.notes, quiet=True)
    _show_rms(segment, by_name, separation)

    columns = {"signal": segment.values, **{name: order.waveform for name, order in by_name.items()}}
    columns[RESIDUAL] = separation.residual
    waveforms = waveforms_of(segment, signal_of(segment), columns, f"Vold-Kalman orders {', '.join(orders)}")
    chosen = st.selectbox("Waveform of", list(orders), key=page.key(f"waveform of {list(orders)}"))
    five_cycles_s = 5.0 / max(float(np.median(by_name[chosen].frequency_hz)), 1e-9)
    page.draw(waveforms, chosen, RESIDUAL, shown=five_cycles_s, in_middle=True)
    levels = {
        "time (s)": segment.start_s + separation.time_s(),
        "speed of the reference shaft (rpm)": _speed_rpm(separation.orders[0]),
        **{with_unit(f"{name}, amplitude peak", segment.unit): order.amplitude for name, order in by_name.items()},
    }
    page.offer(waveforms, {"Levels": levels})
    if reason:
        st.caption(f"No resampling-based track: {as_typed(reason)}")


def _choose_orders(page: MethodPage) -> dict[str, float]:
    """Return chosen orders of the reference shaft by name; the first two at first."""
    known = _known_orders(page.analysis)
    chosen = page.ask(
        st.multiselect,
        "Orders",
        list(known),
        default=list(known)[:2],
        max_selections=6,
        accept_new_options=True,
        placeholder="choose, or type a number",
        key=f"orders {list(known)}",
        about="Cycles per revolution of the reference shaft. Any number can be typed, such as 2 or 0.42.",
    )
    if not chosen:
        raise InputError("no orders are chosen", where="Orders", remedy="choose some from the list or type a number")
    return {name: known[name] if name in known else _number(name) for name in chosen}


def _known_orders(analysis: Analysis) -> dict[str, float]:
    """Return the orders that follow from the rig, the most telling kinds first."""
    if analysis.rig is None or not analysis.rig.shafts:
        return {f"{k}× shaft": float(k) for k in (1, 2, 3)}
    lines = [line for line in order_lines(analysis.rig, n_sidebands=1) if line.kind in KINDS]
    lines.sort(key=lambda line: KINDS.index(line.kind))
    return {f"{line.label} ({line.order:.5g})": line.order for line in lines}


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise InputError(
            f"{text!r} is no number", where="Orders", allowed="cycles per revolution, such as 29 or 0.42"
        ) from None


def _choose_settings(page: MethodPage) -> dict[str, Any]:
    """Return the settings of the filter as `track_vold_kalman` takes them."""
    one, two, three = st.columns(3)
    four, five, _ = st.columns(3)
    unit, first = page.choose(one, "Bandwidth in", {"Orders": ("orders", 0.5), "Hz": ("Hz", 5.0)})
    about = "Between the -3 dB points. Narrow bands tell close orders apart and smooth changes of level."
    label = f"Bandwidth ({unit})"
    width = float(page.ask(two.number_input, label, value=first, step=first / 5.0, format="%g", about=about))
    about = "More poles: steeper skirts, longer settling. The first generation has two."
    n_poles = page.choose(three, "Poles", {"1": 1, "2": 2, "3": 3}, default="2", about=about)
    about = "The second generation has 1 to 3 poles; the first has two and a fixed shape."
    generation = page.choose(four, "Generation", {"Second": "second", "First": "first"}, about=about)
    about = "Orders solved for together share the signal where they cross or lie close: automatic where it matters."
    coupled = page.choose(five, "Coupling", {"Automatic": "automatic", "All": True, "None": False}, about=about)
    return {f"bandwidth_{unit.lower()}": width, "n_poles": n_poles, "generation": generation, "coupled": coupled}


def _tracks(
    segment: SignalSegment, orders: tuple[float, ...], settings: Mapping[str, Any]
) -> tuple[Sequence[order_methods.TrackedOrder], str]:
    """Return resampling-based tracks, of the same bandwidth where the segment allows it, or why there are none."""
    angle = segment.angle
    assert angle is not None  # noqa: S101 - the caller's condition, said to the type checker
    bandwidth = settings.get("bandwidth_orders")
    if bandwidth is None:
        bandwidth = 60.0 * (settings["bandwidth_hz"] or 1.0) / max(angle.mean_speed_rpm, 1e-9)
    n_revolutions = min(max(HANN_BANDWIDTH / bandwidth, 1.0), 0.25 * angle.n_revolutions)
    try:
        signal = angle_signal(segment.recording, angle, channels=[segment.channel])
        return order_methods.track_orders(
            signal, segment.channel, orders, revolutions_per_block=round(n_revolutions, 6)
        ), ""
    except GearsigError as error:
        return (), str(error)


def _show_levels(
    page: MethodPage,
    segment: SignalSegment,
    orders: Mapping[str, order_methods.SeparatedOrder],
    separation: order_methods.OrderSeparation,
    tracks: Sequence[order_methods.TrackedOrder],
) -> None:
    first = "Time" if speed_is_constant(page.analysis) else "Speed"
    over_speed = page.choose(st, "Levels over", {"Time": False, "Speed": True}, default=first)
    step = max(1, len(separation.residual) // 2000)
    lines = []
    for i, (name, order) in enumerate(orders.items()):
        x = (_speed_rpm(order) if over_speed else segment.start_s + separation.time_s())[::step]
        # where the filter has settled; where it nowhere has, all of it
        y = np.where(order.settled, order.amplitude, np.nan) if order.settled.any() else order.amplitude
        lines.append(ChartLine(x, y[::step], name, i))
    for i, (name, track) in enumerate(zip(orders, tracks, strict=False)):
        x = track.speed_rpm if over_speed else segment.start_s + track.time_s
        lines.append(ChartLine(x, track.amplitude, f"{name}, resampled", i, dotted=True))
    shown = np.concatenate([line.x for line in lines])
    # An order that begins or ends in the segment is not known well there: the highest few of the points are left out.
    tops = [float(np.nanpercentile(line.y, 99.5)) for line in lines if np.isfinite(line.y).any()]
    label = "speed of the reference shaft (rpm)" if over_speed else "time (s)"
    limits = float(shown.min()), float(shown.max())
    axes = Axes(label, with_unit("amplitude peak", segment.unit), limits, (0.0, 1.15 * max(tops, default=0.0) or 1.0))
    show_lines(lines, axes, page.key("levels"), height_px=320, legend=True)
    st.caption("Levels end where the filter has not settled yet: at the ends, and where an order begins or ends.")
    if tracks:
        bandwidth = tracks[0].bandwidth_orders
        st.caption(
            "Solid: Vold–Kalman. Dotted: resampled over the shaft's angle, in blocks of "
            f"{HANN_BANDWIDTH / bandwidth:.3g} revolutions, about {bandwidth:.3g} orders wide."
        )


def _speed_rpm(order: order_methods.SeparatedOrder) -> FloatArray:
    speed: FloatArray = 60.0 * order.frequency_hz / order.order
    return speed


def _show_rms(
    segment: SignalSegment,
    orders: Mapping[str, order_methods.SeparatedOrder],
    separation: order_methods.OrderSeparation,
) -> None:
    power = float(np.var(segment.values.astype(np.float64))) or 1.0
    rms = [float(np.sqrt(np.mean(np.square(order.waveform)))) for order in orders.values()]
    unit = unit_text(segment.unit) or "1"
    show_table(
        {
            "order": list(orders),
            f"median amplitude ({unit})": [float(np.nanmedian(order.amplitude)) for order in orders.values()],
            f"rms ({unit})": rms,
            "share of the energy (%)": [100.0 * value**2 / power for value in rms],
        }
    )
    residual = float(np.std(separation.residual))
    st.caption(
        f"The residual has an rms of {readable(residual)} {unit}: {100.0 * residual**2 / power:.3g} % of the energy. "
        f"Expected error of the solution: {separation.expected_error:.1g} of the largest component."
    )
