"""Orders taken out of a channel by a Vold–Kalman filter, with their levels from resampling beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import streamlit as st

from app.dashboard.methods.frame import (
    N_CYCLES,
    Curve,
    MethodPage,
    SignalSegment,
    cached,
    show_curves,
    show_table,
    signal_of,
    waveforms_of,
)
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import Axes
from app.dashboard.widgets.messages import show_warnings
from app.dashboard.widgets.views import show_unknown_speed
from gearsig.angle import resample_to_angle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, CannotTell
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import readable
from gearsig.orders import Generation, OrderSeparation, SeparatedOrder, TrackedOrder, track_orders, track_vold_kalman
from gearsig.plot import unit_text, with_unit
from gearsig.report import speed_is_constant
from gearsig.rig import order_lines

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

MIN_LENGTH, MAX_EFFORT = 2**16, 1_600_000
"""Coupled orders take time as their number squared: so many samples times orders squared, but not less than that."""
KINDS = ("mesh", "shaft", "bearing", "sideband")
COUPLINGS: dict[str, bool | Literal["automatic"]] = {"Automatic": "automatic", "All": True, "None": False}
HANN_BANDWIDTH = 1.5
"""Noise bandwidth of a Hann window in lines: blocks of 1.5/B revolutions collect over B orders."""
RESIDUAL = "residual without all chosen orders"


@dataclass(frozen=True)
class OrderSettings:
    """Settings of the filter; one of both bandwidths is None."""

    orders: tuple[float, ...]
    bandwidth_hz: float | None
    bandwidth_orders: float | None
    n_poles: int
    generation: Generation
    coupled: bool | Literal["automatic"]


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
    settings = _choose_settings(page, tuple(orders.values()))
    if segment.angle is None:
        st.info("The shaft's angle is not known in this segment.")
        return
    separation = separated(segment, settings)
    tracks, reason = _tracks(settings, segment)
    separated_orders = dict(zip(orders, separation.orders, strict=True))
    _show_levels(page, segment, separated_orders, separation, tracks)
    show_warnings(separation.notes, quiet=True)
    _show_rms(segment, separated_orders, separation)
    _show_waveforms(page, segment, separated_orders, separation)
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


def _choose_settings(page: MethodPage, orders: tuple[float, ...]) -> OrderSettings:
    one, two, three = st.columns(3)
    four, five, _ = st.columns(3)
    in_hz = page.choose(one, "Bandwidth in", ("Orders", "Hz")) == "Hz"
    first = 5.0 if in_hz else 0.5
    about = "Between the -3 dB points. Narrow bands tell close orders apart and smooth changes of level."
    label = f"Bandwidth ({'Hz' if in_hz else 'orders'})"
    width = float(page.ask(two.number_input, label, value=first, step=first / 5.0, format="%g", about=about))
    about = "More poles: steeper skirts, longer settling. The first generation has two."
    poles = page.choose(three, "Poles", ("1", "2", "3"), default="2", about=about)
    about = "The second generation has 1 to 3 poles; the first has two and a fixed shape."
    generation = page.choose(four, "Generation", ("Second", "First"), about=about)
    about = "Orders solved for together share the signal where they cross or lie close: automatic where it matters."
    coupling = page.choose(five, "Coupling", tuple(COUPLINGS), about=about)
    return OrderSettings(
        orders,
        width if in_hz else None,
        None if in_hz else width,
        int(poles),
        "second" if generation == "Second" else "first",
        COUPLINGS[coupling],
    )


@cached(4, "Separating the orders …")
def separated(segment: SignalSegment, settings: OrderSettings) -> OrderSeparation:
    """Return the separated orders."""
    return track_vold_kalman(
        segment.recording,
        segment.channel,
        settings.orders,
        bandwidth_hz=settings.bandwidth_hz,
        bandwidth_orders=settings.bandwidth_orders,
        n_poles=settings.n_poles,
        generation=settings.generation,
        coupled=settings.coupled,
        shaft_angle=segment.angle,
    )


def _tracks(settings: OrderSettings, segment: SignalSegment) -> tuple[tuple[TrackedOrder, ...], str]:
    """Return resampling-based tracks, of the same bandwidth where the segment allows it, or why there are none."""
    if segment.angle is None:
        return (), "the shaft's angle is not known"
    bandwidth_orders = settings.bandwidth_orders
    if bandwidth_orders is None:
        bandwidth_orders = 60.0 * (settings.bandwidth_hz or 1.0) / max(segment.angle.mean_speed_rpm, 1e-9)
    revolutions = min(max(HANN_BANDWIDTH / bandwidth_orders, 1.0), 0.25 * segment.angle.n_revolutions)
    try:
        return resampled(segment, settings.orders, round(revolutions, 6)), ""
    except GearsigError as error:
        return (), str(error)


@cached(4, "Resampling over the shaft's angle …")
def resampled(
    segment: SignalSegment, orders: tuple[float, ...], revolutions_per_block: float
) -> tuple[TrackedOrder, ...]:
    """Return levels from blocks of revolutions."""
    assert segment.angle is not None  # noqa: S101 - the caller's condition, said to the type checker
    signal = resample_to_angle(segment.recording, segment.angle, channels=[segment.channel])
    return track_orders(signal, segment.channel, orders, revolutions_per_block=revolutions_per_block)


def _show_levels(
    page: MethodPage,
    segment: SignalSegment,
    orders: Mapping[str, SeparatedOrder],
    separation: OrderSeparation,
    tracks: Sequence[TrackedOrder],
) -> None:
    first = "Time" if speed_is_constant(page.analysis) else "Speed"
    over_speed = page.choose(st, "Levels over", ("Time", "Speed"), default=first) == "Speed"
    step = max(1, len(separation.residual) // 2000)
    curves = []
    for i, (name, order) in enumerate(orders.items()):
        x = (_speed_rpm(order) if over_speed else segment.start_s + separation.time_s())[::step]
        # where the filter has settled; where it nowhere has, all of it
        y = np.where(order.settled, order.amplitude, np.nan) if order.settled.any() else order.amplitude
        curves.append(Curve(x, y[::step], name, i))
    for i, (name, track) in enumerate(zip(orders, tracks, strict=False)):
        x = track.speed_rpm if over_speed else segment.start_s + track.time_s
        curves.append(Curve(x, track.amplitude, f"{name}, resampled", i, dotted=True))
    shown = np.concatenate([curve.x for curve in curves])
    label = "speed of the reference shaft (rpm)" if over_speed else "time (s)"
    limits = float(shown.min()), float(shown.max())
    axes = Axes(label, with_unit("amplitude peak", segment.unit), limits, _level_limits(curves))
    show_curves(curves, axes, page.key("levels"))
    st.caption("Levels end where the filter has not settled yet: at the ends, and where an order begins or ends.")
    if tracks:
        bandwidth = tracks[0].bandwidth_orders
        st.caption(
            "Solid: Vold–Kalman. Dotted: resampled over the shaft's angle, in blocks of "
            f"{HANN_BANDWIDTH / bandwidth:.3g} revolutions, about {bandwidth:.3g} orders wide."
        )


def _level_limits(curves: Sequence[Curve]) -> tuple[float, float]:
    """Leave out the highest few of the points: an order that begins or ends in the segment is not known well there."""
    tops = [float(np.nanpercentile(curve.y, 99.5)) for curve in curves if np.isfinite(curve.y).any()]
    return 0.0, 1.15 * max(tops, default=0.0) or 1.0


def _speed_rpm(order: SeparatedOrder) -> FloatArray:
    speed: FloatArray = 60.0 * order.frequency_hz / order.order
    return speed


def _show_rms(segment: SignalSegment, orders: Mapping[str, SeparatedOrder], separation: OrderSeparation) -> None:
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


def _show_waveforms(
    page: MethodPage, segment: SignalSegment, orders: Mapping[str, SeparatedOrder], separation: OrderSeparation
) -> None:
    signal = signal_of(segment)
    columns = {"signal": signal.values, **{name: order.waveform for name, order in orders.items()}}
    columns[RESIDUAL] = separation.residual
    waveforms = waveforms_of(segment, signal, columns, f"Vold-Kalman orders {', '.join(orders)}")
    chosen = st.selectbox("Waveform of", list(orders), key=page.key(f"waveform of {list(orders)}"))
    shown = N_CYCLES / max(float(np.median(orders[chosen].frequency_hz)), 1e-9)
    limits = page.window(waveforms, shown=shown, in_middle=True)
    page.draw(waveforms, limits, {"signal": -1, chosen: 0}, last=False)
    page.draw(waveforms, limits, {RESIDUAL: 1}, label="residual", height_px=180)
    page.offer(waveforms, {"Levels": lambda: _level_columns(segment, orders, separation)})


def _level_columns(
    segment: SignalSegment, orders: Mapping[str, SeparatedOrder], separation: OrderSeparation
) -> Mapping[str, ArrayLike]:
    """Return time, speed, and the amplitude of each order, at every sample."""
    columns: dict[str, ArrayLike] = {
        "time (s)": segment.start_s + separation.time_s(),
        "speed of the reference shaft (rpm)": _speed_rpm(separation.orders[0]),
    }
    for name, order in orders.items():
        columns[with_unit(f"{name}, amplitude peak", segment.unit)] = order.amplitude
    return columns
