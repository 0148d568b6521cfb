"""Methods along a run: order and frequency map, tracked and extracted orders, transmission error by encoders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gearsig import plot
from gearsig.diagnosis import RecordBlocks
from gearsig.errors import GearsigError
from gearsig.formatting import counted, position_text, power_of_ten, readable, unit_text
from gearsig.methods._spectra import cursors_of
from gearsig.methods._table import (
    HIGHEST,
    SHAFT,
    Method,
    MethodAnswer,
    MethodOption,
    signal_of,
    unit_of,
    verbatim,
    waveforms_of,
)
from gearsig.motion import transmission_error
from gearsig.orders import OrderMap, TrackedOrder, frequency_map, order_map, track_orders, track_vold_kalman
from gearsig.plot import ChartLine, LevelPanel, LinePanel, decibel_text, decibels, with_unit
from gearsig.prepared import PreparedRecording
from gearsig.rig import order_lines

KINDS = ("mesh", "shaft", "bearing", "sideband")
MIN_LENGTH, MAX_EFFORT = 2**16, 1_600_000
"""Coupled orders take time as their number squared: minimum samples, and maximum samples × orders²."""
HANN_BANDWIDTH = 1.5
"""Noise bandwidth of a Hann window in lines: blocks of 1.5/B revolutions have a bandwidth of B orders."""
RESIDUAL = "residual without all chosen orders"


def _map_answer(prepared: PreparedRecording, channel: str, levels: OrderMap, highest: float | None) -> MethodAnswer:
    over = "order" if levels.axis == "order" else "frequency"
    caption = f"{over} map: spectra of consecutive blocks"
    cursors = cursors_of(prepared, levels)
    if highest is None and over == "order":
        highest = plot.upper_axis_limit(levels, cursors)
    kept = levels.positions <= (np.inf if highest is None else highest)
    values, positions = levels.values[:, kept], levels.positions[kept]
    table = {"time (s)": levels.time_s, "speed (rpm)": levels.speed_rpm}
    lines = {with_unit(position_text(over, p), levels.unit): values[:, i] for i, p in enumerate(positions)}
    panel = LevelPanel(
        decibels(values, levels.scaling, levels.unit),
        positions,
        levels.time_s,
        levels.axis_label,
        "time (s)",
        decibel_text(levels.unit),
        cursors=[c for c in cursors if c.kind != "sideband"],
    )
    numbers = {"resolution": levels.resolution, "scaling": levels.scaling, "unit": levels.unit, "shaft": levels.shaft}
    return MethodAnswer(
        channel,
        caption,
        lambda: plot.order_map_figure(levels, cursors, highest=highest),
        table | lines,
        matrices={"levels": values},
        axes={**table, over: positions},
        numbers=numbers,
        panels=(panel,),
    )


def _order_map(prepared: PreparedRecording, channel: str, shaft: str, highest: float | None) -> MethodAnswer:
    signal = prepared.over_angle(shaft, [channel])
    levels = order_map(signal, channel, revolutions_per_block=max(1, min(10, int(signal.n_revolutions) // 8)))
    return _map_answer(prepared, channel, levels, highest)


def _frequency_map(prepared: PreparedRecording, channel: str, highest: float | None) -> MethodAnswer:
    recording = prepared.recording
    n = int(min(4096, 2 ** np.floor(np.log2(max(recording.n_samples / 8.0, 16.0)))))
    levels = frequency_map(
        recording.values(channel),
        recording.sampling_rate_hz,
        prepared.shaft_angle,
        n_per_block=n,
        unit=unit_of(prepared, channel),
        source=channel,
    )
    return _map_answer(prepared, channel, levels, highest)


def _order_map_in_blocks(
    blocks: RecordBlocks, prepared: PreparedRecording, channel: str, shaft: str, highest: float | None
) -> MethodAnswer:
    levels = blocks.order_map(channel, prepared.angle_of(shaft))
    return _map_answer(prepared, channel, levels, highest)


def _frequency_map_in_blocks(
    blocks: RecordBlocks, prepared: PreparedRecording, channel: str, highest: float | None
) -> MethodAnswer:
    levels = blocks.frequency_map(channel, n_per_block=4096, scaling="amplitude peak", shaft_angle=prepared.shaft_angle)
    return _map_answer(prepared, channel, levels, highest)


def known_orders(prepared: PreparedRecording, channel: str = "") -> dict[float, str]:
    """Return the orders that follow from the rig with their names, the most important kinds first."""
    del channel
    if not prepared.rig.shafts:
        return {float(k): f"{k}× shaft" for k in (1, 2, 3)}
    lines = [line for line in order_lines(prepared.rig, n_sidebands=1) if line.kind in KINDS]
    lines.sort(key=lambda line: KINDS.index(line.kind))
    return {line.order: f"{line.label} ({line.order:.5g})" for line in lines}


ORDERS = MethodOption(
    "orders", "Orders", "numbers", (),
    "Cycles per revolution of the reference shaft. Any number can be typed, such as 2 or 0.42.",
    "those of the meshes, else the shaft's first three", known=known_orders,
)  # fmt: skip


def _tracking(prepared: PreparedRecording, channel: str, orders: Sequence[float], shaft: str) -> MethodAnswer:
    rig = prepared.rig
    meshes = [order for pair in rig.pairs if (order := rig.mesh_order(pair)) is not None]
    chosen = tuple(orders) or tuple(float(k * m) for m in meshes for k in (1, 2))[:6] or (1.0, 2.0, 3.0)
    signal = prepared.over_angle(shaft, [channel])
    tracked = track_orders(
        signal, channel, chosen, revolutions_per_block=max(1.0, min(10.0, signal.n_revolutions / 8.0))
    )
    unit, time_s, speed = tracked[0].unit, tracked[0].time_s, tracked[0].speed_rpm
    panel = plot.tracked_panel(tracked)
    caption = f"levels of {counted(len(tracked), 'order')} over {panel.x.split()[0]}"
    table: dict[str, Any] = {"time (s)": time_s, "speed (rpm)": speed}
    for t in tracked:
        table[with_unit(f"order {t.order:.6g}, amplitude peak", unit)] = t.amplitude
        table[f"order {t.order:.6g}, phase (rad)"] = t.phase_rad
    return MethodAnswer(
        channel,
        caption,
        lambda: plot.panels_figure([panel], title=f"{channel}: {caption}"),
        table,
        numbers={"bandwidth_orders": tracked[0].bandwidth_orders, "shaft": tracked[0].shaft},
        panels=(panel,),
    )


# Vold–Kalman.


def _vold_kalman(
    prepared: PreparedRecording,
    channel: str,
    orders: Sequence[float],
    bandwidth: float,
    bandwidth_in: str,
    poles: int,
    generation: Any,
    coupling: str,
    over: str,
) -> MethodAnswer:
    # Without orders the machine's first two are taken; coupled or not decides whether they share what they overlap.
    recording, angle = prepared.recording, prepared.shaft_angle
    known = known_orders(prepared)
    values = tuple(orders) or tuple(known)[:2]
    names = [known.get(order, f"{order:g}") for order in values]
    coupled: Any = {"all": True, "none": False}.get(coupling, "automatic")
    filters: dict[str, Any] = {f"bandwidth_{bandwidth_in}": bandwidth, "n_poles": poles, "generation": generation}
    separation = prepared.keep(
        ("methods", "vold-kalman", channel, values, coupled, *filters.items()),
        lambda: track_vold_kalman(recording, channel, values, shaft_angle=angle, coupled=coupled, **filters),
    )
    # A resampling-based track of about the same width beside it: where both agree, neither filter made the level.
    unit, time_s = unit_of(prepared, channel), separation.time_s()
    over_speed = over == "speed" or (over == "automatic" and not angle.is_steady())
    width = bandwidth if bandwidth_in == "orders" else 60.0 * bandwidth / max(angle.mean_speed_rpm, 1e-9)
    tracks, reason = _tracks(prepared, channel, values, width)
    step, lines, table = max(1, len(time_s) // 2000), [], {"time (s)": time_s}
    table["speed of the reference shaft (rpm)"] = 60.0 * separation.orders[0].frequency_hz / values[0]
    for k, (name, order) in enumerate(zip(names, separation.orders, strict=True)):
        x = 60.0 * order.frequency_hz / order.order if over_speed else time_s
        # where the filter has settled, or all of it if it never has
        y = np.where(order.settled, order.amplitude, np.nan) if order.settled.any() else order.amplitude
        lines.append(ChartLine(x[::step], y[::step], name, k))
        table[with_unit(f"{name}, amplitude peak", unit)] = order.amplitude
    # An order that begins or ends within the part is uncertain there: the few highest points are left out.
    tops = [float(np.nanpercentile(line.y, 99.5)) for line in lines if np.isfinite(line.y).any()]
    for k, (name, track) in enumerate(zip(names, tracks, strict=False)):
        x = track.speed_rpm if over_speed else track.time_s
        lines.append(ChartLine(x, track.amplitude, f"{name}, resampled", k, dotted=True))
    label = "speed of the reference shaft (rpm)" if over_speed else "time (s)"
    limits = (0.0, 1.15 * max(tops, default=0.0) or 1.0)
    panel = LinePanel(lines, label, with_unit("amplitude peak", unit), limits)
    # The residual without all orders shows how much of the signal they explain.
    columns = {"signal": recording.values(channel)}
    columns |= {name: order.waveform for name, order in zip(names, separation.orders, strict=True)}
    columns[RESIDUAL] = separation.residual
    waveforms = waveforms_of(
        prepared,
        channel,
        signal_of(prepared, channel),
        columns,
        f"Vold-Kalman orders {', '.join(names)}",
        residual=RESIDUAL,
    )
    power, residual = float(np.var(columns["signal"].astype(np.float64))) or 1.0, float(np.std(separation.residual))
    rms = np.array([np.sqrt(np.mean(np.square(order.waveform))) for order in separation.orders])
    notes = ["Levels are left out where the filter has not settled: at the ends, and where an order begins or ends."]
    if tracks:
        b = tracks[0].bandwidth_orders
        notes.append(
            "Solid: Vold–Kalman. Dotted: resampled over the shaft's angle, in blocks of "
            f"{HANN_BANDWIDTH / b:.3g} revolutions, about {b:.3g} orders wide."
        )
    if reason:
        notes.append(f"No resampling-based track: {reason}")
    return MethodAnswer(
        channel,
        f"{len(values)} orders extracted by a Vold–Kalman filter",
        lambda: plot.panels_figure([panel], title=f"{channel}: orders by a Vold–Kalman filter"),
        table,
        tables={
            "orders": {
                "order": np.array(names, dtype=object),
                with_unit("median amplitude", unit): np.array([np.nanmedian(o.amplitude) for o in separation.orders]),
                with_unit("rms", unit): rms,
                "share of the energy (%)": 100.0 * rms**2 / power,
            }
        },
        numbers={"orders": list(values), "expected_error": separation.expected_error},
        panels=(panel,),
        facts=(
            (
                f"The residual has an rms of **{readable(residual)} {unit_text(unit)}**: "
                f"{100.0 * residual**2 / power:.3g} % of the energy. Expected error of the solution: "
                f"{power_of_ten(separation.expected_error)} of the largest component."
            ),
        ),
        notes=(*notes, *separation.notes),
        waveforms=waveforms,
    )


def _tracks(
    prepared: PreparedRecording, channel: str, orders: Sequence[float], width: float
) -> tuple[Sequence[TrackedOrder], str]:
    """Return resampling-based tracks, of the same bandwidth if the part is long enough, or why there are none."""
    n = min(max(HANN_BANDWIDTH / width, 1.0), 0.25 * prepared.shaft_angle.n_revolutions)
    try:
        signal = prepared.over_angle("", [channel])
        return track_orders(signal, channel, orders, revolutions_per_block=round(n, 6)), ""
    except GearsigError as error:
        return (), str(error)


def _samples_of_vold_kalman(options: Mapping[str, Any]) -> int:
    return max(MIN_LENGTH, MAX_EFFORT // max(2, len(options["orders"])) ** 2)


# --------------------
# Transmission error, from both shafts' encoders and not from the channel that is asked for.
# --------------------


def _transmission_error(prepared: PreparedRecording, channel: str, pair: str) -> MethodAnswer:
    del channel
    error = transmission_error(prepared.recording, prepared.rig, pair=pair)
    unit, pitches = "µm", (np.arange(error.n_steps) + 0.5) / error.n_steps
    mesh = ChartLine(pitches, error.mesh_um, "mesh")
    panels = [LinePanel([mesh], "tooth pitches", unit, title="mesh, what every tooth pair repeats")]
    tables = {"mesh": {"tooth pitches": pitches, with_unit("mesh", unit): error.mesh_um}}
    swings = {"mesh": float(np.ptp(error.mesh_um))}
    for side, gear in enumerate(("driver", "driven gear")):
        average = error.average(side)
        values, twice = average.values, 2.0 * average.standard_error
        angle_deg = 360.0 * (np.arange(len(values)) + 0.5) / len(values)
        line = ChartLine(angle_deg, values, gear, band=(values - twice, values + twice))
        title = f"{gear}, what it adds at each of its teeth, ± 2 standard errors"
        panels.append(LinePanel([line], f"angle of {average.shaft} (deg)", unit, x_limits=(0.0, 360.0), title=title))
        tables[gear] = {
            f"angle of {average.shaft} (deg)": angle_deg,
            with_unit(gear, unit): values,
            with_unit("standard error", unit): average.standard_error,
        }
        swings[gear] = float(np.ptp(values))
    signal, caption = error.signal(), f"transmission error of {error.teeth[0]}/{error.teeth[1]} teeth"
    name = signal.channel_names[0]
    shown = ", ".join(f"{part} **{readable(swing, 3)} {unit}**" for part, swing in swings.items())
    return MethodAnswer(
        name,
        caption,
        lambda: plot.panels_figure(panels, title=caption),
        {f"angle of {error.shafts[0]} (revolutions)": signal.revolutions, with_unit(name, unit): signal.samples[0]},
        tables=tables,
        numbers={"speed_rpm": error.speed_rpm, "mesh_hz": error.mesh_hz, "peak_to_peak_um": swings},
        panels=tuple(panels),
        facts=(f"Peak to peak: {shown}; {readable(error.mesh_hz)} tooth pairs meet per second.",),
        notes=(
            (
                "Positive where the driven gear lags. It is the static error under load where the mesh lies well below "
                "the first resonance in which teeth yield, else the dynamic one."
            ),
            *error.notes,
        ),
    )


ALONG = {
    "order-map": Method(
        "Order map", "Orders over time and speed.", _order_map, (HIGHEST, SHAFT), in_blocks=_order_map_in_blocks,
    ),
    "frequency-map": Method(
        "Frequency map", "Frequencies over time and speed.", _frequency_map, (HIGHEST,),
        in_blocks=_frequency_map_in_blocks,
    ),
    "transmission-error": Method(
        "Transmission error",
        "How far the driven gear lags, by encoders on both shafts; and what the mesh and either gear make of it.",
        _transmission_error,
        (
            MethodOption(
                "pair", "Gear pair", "name", "", empty="the only one",
                known=lambda prepared, _: [pair.name for pair in prepared.rig.pairs],
            ),
        ),
    ),
    "tracking": Method(
        "Tracked orders", "Level and phase of orders over speed.", _tracking, (ORDERS, SHAFT), "Map", 10_000_000, 10**7
    ),
    "vold-kalman": Method(
        "Orders (Vold–Kalman)",
        "Extracts single orders from the signal as waveforms, also where they cross or are close together.",
        _vold_kalman,
        (
            ORDERS,
            MethodOption(
                "bandwidth", "Bandwidth", "number", 0.5,
                "Between the -3 dB points. Narrow bands separate close orders and smooth changes of level.",
                minimum=0.0,
            ),
            MethodOption("bandwidth_in", "Bandwidth in", "choice", "orders", choices={"orders": "Orders", "hz": "Hz"}),
            MethodOption(
                "poles", "Poles", "count", 2,
                "More poles: steeper skirts, longer settling. The first generation has two.",
                choices=verbatim(1, 2, 3), more=True,
            ),
            MethodOption(
                "generation", "Generation", "choice", "second",
                "The second generation has 1 to 3 poles; the first has two and a fixed shape.",
                choices={"second": "Second", "first": "First"}, more=True,
            ),
            MethodOption(
                "coupling", "Coupling", "choice", "automatic",
                ("Orders solved for together share the signal where they cross or are close: automatic if it matters."),
                choices={"automatic": "Automatic", "all": "All", "none": "None"}, more=True,
            ),
            MethodOption(
                "over", "Levels over", "choice", "automatic",
                choices={"automatic": "Automatic", "time": "Time", "speed": "Speed"},
            ),
        ),
        "Map",
        250_000,
        limit=_samples_of_vold_kalman,
        bytes_per_sample=lambda options: 250.0 + 150.0 * max(2, len(options["orders"])),
    ),
}  # fmt: skip
