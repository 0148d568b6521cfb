"""Orders taken out as waveforms by Vold–Kalman, their levels beside those of resampling-based tracking."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.methods.signals import (
    N_CYCLES,
    Curve,
    SignalSegment,
    Waveforms,
    choose_one,
    choose_stretch,
    choose_window,
    offer_downloads,
    show_curves,
    show_notes,
    show_waveforms,
    waveforms_of,
)
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import Axes
from app.dashboard.widgets.views import show_unknown_speed
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis
from gearsig.errors import GearsigError, InputError
from gearsig.formatting import readable
from gearsig.plot import unit_text, with_unit
from gearsig.report import speed_is_constant

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.orders import Generation, OrderSeparation, SeparatedOrder, TrackedOrder


# --------------------
# Separated orders: their levels over time or speed, their waveforms, what is left, and what to know of them.
# --------------------


N_POINTS = 2000
REST = "what is left without all chosen orders"


def show_separation(
    analysis: Analysis,
    stretch: SignalSegment,
    names: Sequence[str],
    separation: OrderSeparation,
    tracks: Sequence[TrackedOrder],
) -> None:
    """Show levels, waveforms, table and notes."""
    _show_levels(analysis, stretch, names, separation, tracks)
    show_notes(separation.notes, quiet=True)
    _show_table(stretch, names, separation)
    _show_waveforms(analysis, stretch, names, separation)


def _show_levels(
    analysis: Analysis,
    stretch: SignalSegment,
    names: Sequence[str],
    separation: OrderSeparation,
    tracks: Sequence[TrackedOrder],
) -> None:
    first = "Time" if speed_is_constant(analysis) else "Speed"
    over = choose_one("Levels over", ("Time", "Speed"), _key_order_results("over", analysis), default=first)
    step = max(1, len(separation.residual) // N_POINTS)
    curves = []
    for i, (name, order) in enumerate(zip(names, separation.orders, strict=True)):
        x = _speed_rpm(order)[::step] if over == "Speed" else stretch.start_s + separation.time_s()[::step]
        curves.append(Curve(x, _known_amplitude(order)[::step], name, i))
    for i, track in enumerate(tracks):
        x = track.speed_rpm if over == "Speed" else stretch.start_s + track.time_s
        curves.append(Curve(x, track.amplitude, f"{names[i]}, resampled", i, dotted=True))
    shown = np.concatenate([curve.x for curve in curves])
    label = "speed of the reference shaft (rpm)" if over == "Speed" else "time (s)"
    limits = float(shown.min()), float(shown.max())
    axes = Axes(label, with_unit("amplitude peak", stretch.unit), limits, _level_limits(curves))
    show_curves(curves, axes, _key_order_results("levels", analysis))
    st.caption("Levels end where the filter has not settled yet: at the ends, and where an order begins or ends.")
    if tracks:
        st.caption(
            "Solid: Vold–Kalman. Dotted: resampled over the shaft's angle, in blocks of "
            f"{_block_length(tracks[0]):.3g} revolutions, about {tracks[0].bandwidth_orders:.3g} orders wide."
        )


def _known_amplitude(order: SeparatedOrder) -> FloatArray:
    """Return the amplitude where the filter has settled; where it nowhere has, all of it."""
    shown: FloatArray = np.where(order.settled, order.amplitude, np.nan) if order.settled.any() else order.amplitude
    return shown


def _level_limits(curves: Sequence[Curve]) -> tuple[float, float]:
    """Leave out the highest few of the points: an order that begins or ends in the stretch is not known well there."""
    tops = [float(np.nanpercentile(curve.y, 99.5)) for curve in curves if np.isfinite(curve.y).any()]
    return 0.0, 1.15 * max(tops, default=0.0) or 1.0


def _block_length(track: TrackedOrder) -> float:
    """Return the block's length in revolutions, from a Hann window's noise bandwidth of 1.5 lines."""
    return 1.5 / track.bandwidth_orders


def _speed_rpm(order: SeparatedOrder) -> FloatArray:
    speed: FloatArray = 60.0 * order.frequency_hz / order.order
    return speed


def _show_table(stretch: SignalSegment, names: Sequence[str], separation: OrderSeparation) -> None:
    signal = stretch.recording.values(stretch.channel).astype(np.float64)
    power = float(np.mean(np.square(signal - signal.mean()))) or 1.0
    rows = [
        _row(name, order.waveform, float(np.nanmedian(order.amplitude))) for name, order in _pairs(names, separation)
    ]
    unit = unit_text(stretch.unit) or "1"
    columns = {
        "order": [name for name, _, _ in rows],
        f"median amplitude ({unit})": [median for _, _, median in rows],
        f"rms ({unit})": [rms for _, rms, _ in rows],
        "share of the energy (%)": [100.0 * rms**2 / power for _, rms, _ in rows],
    }
    number = st.column_config.NumberColumn(format="%.4g")
    st.dataframe(columns, hide_index=True, width="stretch", column_config=dict.fromkeys(list(columns)[1:], number))
    left = float(np.std(separation.residual))
    st.caption(
        f"What is left has an rms of {readable(left)} {unit}: {100.0 * left**2 / power:.3g} % of the energy. Expected "
        f"error of the solution: {separation.expected_error:.1g} of the largest component."
    )


def _pairs(names: Sequence[str], separation: OrderSeparation) -> list[tuple[str, SeparatedOrder]]:
    return list(zip(names, separation.orders, strict=True))


def _row(name: str, values: FloatArray, median: float) -> tuple[str, float, float]:
    return name, float(np.sqrt(np.mean(np.square(values)))), median


def _show_waveforms(
    analysis: Analysis, stretch: SignalSegment, names: Sequence[str], separation: OrderSeparation
) -> None:
    waveforms = order_waveforms(stretch, names, separation)
    chosen = st.selectbox("Waveform of", list(names), key=_key_order_results(f"waveform of {list(names)}", analysis))
    order = separation.orders[list(names).index(chosen)]
    shown = N_CYCLES / max(float(np.median(order.frequency_hz)), 1e-9)
    limits = choose_window(analysis, waveforms, "order tracking", shown=shown, in_middle=True)
    show_waveforms(analysis, waveforms, limits, {"signal": -1, chosen: 0}, "order signal", last=False)
    show_waveforms(analysis, waveforms, limits, {REST: 1}, "order rest", label="what is left", height_px=180)
    tables = {"Levels": lambda: level_columns(stretch, names, separation)}
    offer_downloads(analysis, "orders", waveforms, tables=tables)


def order_waveforms(stretch: SignalSegment, names: Sequence[str], separation: OrderSeparation) -> Waveforms:
    """Return the signal, each order, and what is left."""
    orders = {name: order.waveform for name, order in _pairs(names, separation)}
    columns = {"signal": stretch.recording.values(stretch.channel), **orders, REST: separation.residual}
    return waveforms_of(stretch, columns, f"Vold-Kalman orders {', '.join(names)}")


def level_columns(stretch: SignalSegment, names: Sequence[str], separation: OrderSeparation) -> Mapping[str, ArrayLike]:
    """Return time, speed, and the amplitude of each order, at every sample."""
    columns: dict[str, ArrayLike] = {
        "time (s)": stretch.start_s + separation.time_s(),
        "speed of the reference shaft (rpm)": _speed_rpm(separation.orders[0]),
    }
    for name, order in _pairs(names, separation):
        columns[with_unit(f"{name}, amplitude peak", stretch.unit)] = order.amplitude
    return columns


def _key_order_results(name: str, analysis: Analysis) -> str:
    return state.view_key(f"separated orders {name}", analysis)


N_FIRST = 250_000
N_FEWEST, N_EFFORT = 2**16, 1_600_000
"""Coupled orders take time as their number squared: so many samples times orders squared, but not less than that."""
MOST_ORDERS = 6
KINDS = ("mesh", "shaft", "bearing", "sideband")
COUPLINGS: dict[str, bool | Literal["automatic"]] = {"Automatic": "automatic", "All": True, "None": False}
N_KEPT = 4
"""Separations hold several arrays as long as the stretch for every order."""
HANN_BANDWIDTH = 1.5
"""Noise bandwidth of a Hann window in lines: blocks of 1.5/B revolutions collect over B orders."""
LONGEST_BLOCK = 0.25
"""Of the stretch, in revolutions."""


@dataclass(frozen=True)
class OrderSettings:
    """What the filter is told; one of both bandwidths is None."""

    orders: tuple[float, ...]
    bandwidth_hz: float | None
    bandwidth_orders: float | None
    n_poles: int
    generation: Generation
    coupled: bool | Literal["automatic"]


def show_order_tracking(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show levels and waveforms of chosen orders of one channel."""
    if isinstance(analysis.shaft_angle, CannotTell):
        show_unknown_speed(analysis.shaft_angle)
        return
    left, right = st.columns(2)
    with left:
        named = _choose_orders(analysis)
    n_most = max(N_FEWEST, N_EFFORT // max(2, len(named)) ** 2)
    with right:
        stretch = choose_stretch(analysis, channel, "order tracking", n_first=N_FIRST, n_most=n_most)
    settings = _choose_settings(analysis, tuple(named.values()))
    if stretch.angle is None:
        st.info("The shaft's angle is not known in this stretch.")
        return
    with st.spinner("Separating the orders …", show_time=True):
        separation = separated(stretch.key, settings, stretch)
        tracks, reason = _tracks(settings, stretch)
    show_separation(analysis, stretch, list(named), separation, tracks)
    if reason:
        st.caption(f"No resampling-based track: {as_typed(reason)}")


def _choose_orders(analysis: Analysis) -> dict[str, float]:
    """Return chosen orders of the reference shaft by name; the first two at first."""
    known = _known_orders(analysis)
    first = list(known)[:2]
    chosen = st.multiselect(
        "Orders",
        list(known),
        default=first,
        max_selections=MOST_ORDERS,
        accept_new_options=True,
        placeholder="choose, or type a number",
        help="Cycles per revolution of the reference shaft. Any number can be typed, such as 2 or 0.42.",
        key=_key(f"orders {list(known)}", analysis),
        persist_state="session",
    )
    if not chosen:
        raise InputError("no orders are chosen", where="Orders", remedy="choose some from the list or type a number")
    return {name: known[name] if name in known else _number(name) for name in chosen}


def _known_orders(analysis: Analysis) -> dict[str, float]:
    """Return the orders that follow from the rig, the most telling kinds first."""
    if analysis.rig is None or not analysis.rig.shafts:
        return {f"{k}× shaft": float(k) for k in (1, 2, 3)}
    from gearsig.rig import order_lines

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


def _choose_settings(analysis: Analysis, orders: tuple[float, ...]) -> OrderSettings:
    one, two, three = st.columns(3)
    four, five, _ = st.columns(3)
    with one:
        unit = choose_one("Bandwidth in", ("Orders", "Hz"), _key("unit", analysis))
    first = 0.5 if unit == "Orders" else 5.0
    about = "Between the -3 dB points. Narrow bands tell close orders apart and smooth changes of level."
    width = two.number_input(
        f"Bandwidth ({unit.lower() if unit == 'Orders' else unit})",
        value=first,
        step=first / 5.0,
        format="%g",
        key=_key(f"bandwidth {unit}", analysis),
        help=about,
        persist_state="session",
    )
    with four:
        about = "The second generation has 1 to 3 poles; the first has two and a fixed shape."
        generation = choose_one("Generation", ("Second", "First"), _key("generation", analysis), about=about)
    with three:
        about = "More poles: steeper skirts, longer settling. The first generation has two."
        poles = choose_one("Poles", ("1", "2", "3"), _key("poles", analysis), default="2", about=about)
    with five:
        about = "Orders solved for together share the signal where they cross or lie close: automatic where it matters."
        coupling = choose_one("Coupling", tuple(COUPLINGS), _key("coupling", analysis), about=about)
    in_hz = unit == "Hz"
    name: Generation = "second" if generation == "Second" else "first"
    return OrderSettings(
        orders, float(width) if in_hz else None, None if in_hz else float(width), int(poles), name, COUPLINGS[coupling]
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def separated(key: str, settings: OrderSettings, _stretch: SignalSegment) -> OrderSeparation:
    """Return the separated orders; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.orders import track_vold_kalman

    del key
    return track_vold_kalman(
        _stretch.recording,
        _stretch.channel,
        settings.orders,
        bandwidth_hz=settings.bandwidth_hz,
        bandwidth_orders=settings.bandwidth_orders,
        n_poles=settings.n_poles,
        generation=settings.generation,
        coupled=settings.coupled,
        shaft_angle=_stretch.angle,
    )


def _tracks(settings: OrderSettings, stretch: SignalSegment) -> tuple[tuple[TrackedOrder, ...], str]:
    """Return resampling-based tracks, of the same bandwidth where the stretch allows it, or why there are none."""
    if stretch.angle is None:
        return (), "the shaft's angle is not known"
    wanted = settings.bandwidth_orders
    if wanted is None:
        wanted = 60.0 * (settings.bandwidth_hz or 1.0) / max(stretch.angle.mean_speed_rpm, 1e-9)
    revolutions = min(max(HANN_BANDWIDTH / wanted, 1.0), LONGEST_BLOCK * stretch.angle.n_revolutions)
    try:
        return resampled(stretch.key, settings.orders, round(revolutions, 6), stretch), ""
    except GearsigError as error:
        return (), str(error)


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def resampled(
    key: str, orders: tuple[float, ...], revolutions_per_block: float, _stretch: SignalSegment
) -> tuple[TrackedOrder, ...]:
    """Return levels from blocks of revolutions; `key` stands for the stretch."""
    from gearsig.angle import resample_to_angle
    from gearsig.orders import track_orders

    del key
    if _stretch.angle is None:
        return ()
    signal = resample_to_angle(_stretch.recording, _stretch.angle, channels=[_stretch.channel])
    return track_orders(signal, _stretch.channel, orders, revolutions_per_block=revolutions_per_block)


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"order tracking {name}", analysis)
