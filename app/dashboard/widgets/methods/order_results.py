"""Separated orders: their levels over time or speed, their waveforms, what is left, and what to know of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.widgets.line_chart import Axes
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.curves import Curve, show_curves
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.mesh_cycles import N_CYCLES
from app.dashboard.widgets.methods.notes import show_notes
from app.dashboard.widgets.methods.stretch import Stretch
from app.dashboard.widgets.methods.waveforms import Waveforms, choose_window, show_waveforms, waveforms_of
from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis
from gearsig.formatting import readable
from gearsig.plot.display import unit_text, with_unit
from gearsig.report.lines import speed_is_constant

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from gearsig.orders.types import TrackedOrder
    from gearsig.orders.vold_kalman_types import OrderSeparation, SeparatedOrder

N_POINTS = 2000
REST = "what is left without all chosen orders"


def show_separation(
    analysis: Analysis,
    stretch: Stretch,
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
    stretch: Stretch,
    names: Sequence[str],
    separation: OrderSeparation,
    tracks: Sequence[TrackedOrder],
) -> None:
    first = "Time" if speed_is_constant(analysis) else "Speed"
    over = choose_one("Levels over", ("Time", "Speed"), _key("over", analysis), default=first)
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
    show_curves(curves, axes, _key("levels", analysis))
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


def _show_table(stretch: Stretch, names: Sequence[str], separation: OrderSeparation) -> None:
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


def _show_waveforms(analysis: Analysis, stretch: Stretch, names: Sequence[str], separation: OrderSeparation) -> None:
    waveforms = order_waveforms(stretch, names, separation)
    chosen = st.selectbox("Waveform of", list(names), key=_key(f"waveform of {list(names)}", analysis))
    order = separation.orders[list(names).index(chosen)]
    shown = N_CYCLES / max(float(np.median(order.frequency_hz)), 1e-9)
    limits = choose_window(analysis, waveforms, "order tracking", shown=shown, in_middle=True)
    show_waveforms(analysis, waveforms, limits, {"signal": -1, chosen: 0}, "order signal", last=False)
    show_waveforms(analysis, waveforms, limits, {REST: 1}, "order rest", label="what is left", height_px=180)
    tables = {"Levels": lambda: level_columns(stretch, names, separation)}
    offer_downloads(analysis, "orders", waveforms, tables=tables)


def order_waveforms(stretch: Stretch, names: Sequence[str], separation: OrderSeparation) -> Waveforms:
    """Return the signal, each order, and what is left."""
    orders = {name: order.waveform for name, order in _pairs(names, separation)}
    columns = {"signal": stretch.recording.values(stretch.channel), **orders, REST: separation.residual}
    return waveforms_of(stretch, columns, f"Vold-Kalman orders {', '.join(names)}")


def level_columns(stretch: Stretch, names: Sequence[str], separation: OrderSeparation) -> Mapping[str, ArrayLike]:
    """Return time, speed, and the amplitude of each order, at every sample."""
    columns: dict[str, ArrayLike] = {
        "time (s)": stretch.start_s + separation.time_s(),
        "speed of the reference shaft (rpm)": _speed_rpm(separation.orders[0]),
    }
    for name, order in _pairs(names, separation):
        columns[with_unit(f"{name}, amplitude peak", stretch.unit)] = order.amplitude
    return columns


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"separated orders {name}", analysis)
