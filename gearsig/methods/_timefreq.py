"""Methods over time and frequency, or over angle and order: maps, ridges, wavelet packets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from gearsig import plot, timefreq
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.formatting import axis_label, axis_unit, position_text, unit_text
from gearsig.methods._spectra import cursors_of
from gearsig.methods._table import (
    LINES,
    OVER_ANGLE,
    SHAFT,
    Method,
    MethodAnswer,
    MethodOption,
    signal_of,
    verbatim,
    waveforms_of,
)
from gearsig.orders import order_spectrum
from gearsig.plot import ChartLine, LevelPanel, LinePanel, decibel_text, decibels, with_unit
from gearsig.prepared import PreparedRecording
from gearsig.timefreq import Morse, Ridge, TimeFrequencyMap, UniformSignal, WaveletPackets

TRANSFORMS = ("cwt", "squeezed-cwt", "stft", "squeezed-stft")
"""Transforms of the method time-frequency, and of a chosen mode."""
NAMES = {"stft": "Fourier", "cwt": "Wavelet", "squeezed-stft": "Squeezed Fourier", "squeezed-cwt": "Squeezed wavelet"}
OCTAVES = 8.0
"""Range of wavelet maps; lower lines are mostly effects of the ends."""
TRANSFORM = MethodOption(
    "transform", "Transform", "choice", "cwt",
    ("Fourier: the same window for all lines, for steady lines and sidebands. Wavelet: short in time at high and "
    "sharp at low frequencies, for impacts. Squeezed: each component is concentrated at its instantaneous frequency; "
    "sharp for a few clear components, not for noise or impacts."),
    choices=NAMES,
)  # fmt: skip
MAP_OPTIONS = (
    OVER_ANGLE,
    *LINES,
    MethodOption(
        "periods", "Periods in the wavelet", "number", None,
        "More separate close frequencies, fewer show impacts sharper in time.", "2.5", minimum=0.5, maximum=100.0,
        more=True,
    ),
    MethodOption(
        "window", "Window (s or revolutions)", "number", None,
        "Longer ones separate close lines, shorter ones show changes sooner.", "by the length of the part",
        minimum=0.0, more=True,
    ),
    MethodOption(
        "reduction", "Each column", "choice", "mean",
        "A column covers many samples: their mean power, or the maximum, which keeps the height of impacts.",
        choices={"mean": "Mean", "max": "Largest"}, more=True,
    ),
    MethodOption(
        "engine", "Engine of squeezed transforms", "choice", "gearsig",
        "ssqueezepy: another program, for comparison; single precision, and short parts only.", more=True,
        choices=verbatim(*get_args(timefreq.SqueezeEngine)),
    ),
    SHAFT,
)  # fmt: skip


def wavelet_of(periods: float | None) -> Morse:
    """Return the Morse wavelet of √(3β)/π periods."""
    return Morse() if periods is None else Morse(beta=float(round((np.pi * periods) ** 2 / 3.0)))


def levels_of(
    signal: UniformSignal,
    transform: str,
    *,
    lowest: float | None = None,
    highest: float | None = None,
    periods: float | None = None,
    window: float | None = None,
    reduction: Any = "mean",
    engine: Any = "gearsig",
) -> TimeFrequencyMap:
    """Return the levels of a signal by one of `TRANSFORMS`."""
    function: Callable[..., TimeFrequencyMap] = getattr(timefreq, f"{transform.replace('-', '_')}_map")
    more: dict[str, Any] = {"reduction": reduction}
    if transform.endswith("cwt"):
        more["wavelet"] = wavelet_of(periods)
        end = float(signal.highest_valid) if highest is None else highest
        lowest = max(lowest or end / 2**OCTAVES, timefreq.lowest_analysable(signal, more["wavelet"]))
    elif window is not None:
        more["window_length"] = window
    if transform.startswith("squeezed"):
        more["engine"] = engine
    return function(signal, lowest=lowest or None, highest=highest, **more)


def levels_answer(
    channel: str, levels: TimeFrequencyMap, numbers: Mapping[str, Any], ridges: Sequence[Ridge] = ()
) -> MethodAnswer:
    """Return a map as an answer."""
    caption = f"{levels.axis_label} over {levels.at_label}, {levels.method}"
    table: dict[str, Any] = {levels.at_label: levels.at}
    names = [with_unit(position_text(levels.axis, p), levels.unit) for p in levels.positions]
    table |= {name: levels.values[:, i] for i, name in enumerate(names)}
    lines = [ChartLine(ridge.at, ridge.positions, f"ridge {k}", 1) for k, ridge in enumerate(ridges, start=1)]
    panel = LevelPanel(
        decibels(levels.values.T, levels.scaling, levels.unit),
        levels.at,
        levels.positions,
        levels.at_label,
        levels.axis_label,
        decibel_text(levels.unit),
        levels.spacing == "logarithmic",
        [*_edges(levels), *lines],
    )
    return MethodAnswer(
        channel,
        caption,
        lambda: plot.time_frequency_figure(levels, ridges, numbered=bool(ridges)),
        table,
        matrices={"levels": levels.values},
        axes={levels.at_label: levels.at, levels.axis_label: levels.positions},
        numbers={"scaling": levels.scaling, "unit": levels.unit, "transform": levels.method, **numbers},
        panels=(panel,),
        notes=("Between the dotted lines and the ends, levels depend on the assumed continuation of the signal.",),
    )


def _edges(levels: TimeFrequencyMap) -> list[ChartLine]:
    """Return the lines up to which the assumed continuation of the signal affects the map, by ascending position."""
    inside = levels.edge < (levels.at[-1] - levels.at[0]) / 2
    reach, at = levels.edge[inside], levels.positions[inside]
    order = np.argsort(reach, kind="stable")
    ends = ((levels.at[0] + reach)[order], at[order]), ((levels.at[-1] - reach)[order][::-1], at[order][::-1])
    return [ChartLine(x, y, "ends", -1, dotted=True) for x, y in ends if len(x)]


def _signal(prepared: PreparedRecording, channel: str, options: dict[str, Any]) -> UniformSignal:
    """Return the channel over time or angle; orders end just past the meshes unless more are requested."""
    over_angle = bool(options.pop("over_angle"))
    signal = signal_of(prepared, channel, over_angle=over_angle, shaft=str(options.pop("shaft")))
    if over_angle and options["highest"] is None:
        spectrum = order_spectrum(prepared.over_angle("", [channel]), channel)
        meshes = [c.position for c in cursors_of(prepared, spectrum) if c.kind == "mesh"]
        if meshes:
            options["highest"] = min(1.12 * max(meshes), float(signal.highest_valid))
    return signal


def _time_frequency(prepared: PreparedRecording, channel: str, transform: str, **options: Any) -> MethodAnswer:
    signal = _signal(prepared, channel, options)
    return levels_answer(channel, levels_of(signal, transform, **options), {})


RESIDUAL = "residual without all of them"


def _ridges(
    prepared: PreparedRecording,
    channel: str,
    transform: str,
    n_ridges: int,
    bends: float,
    steepest: float,
    band_percent: float | None,
    assigned: str,
    **options: Any,
) -> MethodAnswer:
    options["periods"] = options["periods"] or 5.0
    key = ("methods", "ridges", channel, transform, *options.values())
    signal = _signal(prepared, channel, options)
    levels = prepared.keep(key, lambda: levels_of(signal, transform, **options))
    ridges = timefreq.ridges(levels, n_ridges, stiffness=bends, steepest=steepest)
    # Each component is extracted from the signal, not from the residual of earlier ones: their order must not matter.
    first, wavelet = ridges[0], wavelet_of(options["periods"])
    columns: dict[str, FloatArray] = {"signal": signal.values}
    residual = signal.values.astype(np.float64)
    half_width = None if band_percent is None else band_percent / 100.0
    for number, ridge in enumerate(ridges, start=1):
        part = timefreq.component(
            signal, ridge, half_width=half_width, squeezed=assigned == "frequency", wavelet=wavelet
        )
        columns[f"component {number}"] = part.values
        residual -= part.values
    columns[RESIDUAL] = residual
    # The map shows where the ridges run; two profiles below it show place and level of each.
    step = f"components along {len(ridges)} ridges, {wavelet.name}"
    answer = levels_answer(channel, levels, {"n_ridges": len(ridges)}, ridges)
    at, peak = timefreq.at_label(first.axis, first.shaft), with_unit("amplitude peak", first.unit)
    unit, table = axis_unit(first.axis), {at: first.at}
    for number, ridge in enumerate(ridges, start=1):
        table |= {f"ridge {number} ({unit})": ridge.positions, f"ridge {number} {peak}": ridge.amplitude}
    names = [f"ridge {number}" for number in range(1, len(ridges) + 1)]
    profiles = [
        LinePanel([ChartLine(first.at, y, n, k) for k, (n, y) in enumerate(zip(names, values, strict=True))], at, label)
        for label, values in (
            (axis_label(first.axis, first.shaft), [ridge.positions for ridge in ridges]),
            (peak, [ridge.amplitude for ridge in ridges]),
        )
    ]
    notes = [
        (
            "Ridge 1 has the largest rms of its amplitude. Each runs through the whole part, also where it fades. Only "
            "what stands out clearly on this map is looked for: the strongest line of the spectrum may lie above it, "
            "or be too unsteady."
        ),
        (
            "A component is the sum of the wavelet coefficients in the band around its ridge. Where bands of two "
            "ridges overlap, both components contain the overlap."
        ),
    ]
    if len(ridges) < n_ridges:
        notes.insert(0, f"The map shows only {len(ridges)} of {n_ridges} ridges.")
    return replace(
        answer,
        caption=f"{len(ridges)} ridges: {answer.caption}",
        table=table,
        panels=(*answer.panels, *profiles),
        notes=notes,
        waveforms=waveforms_of(prepared, channel, signal, columns, step, residual=RESIDUAL),
    )


def _limit(options: Mapping[str, Any]) -> int:
    if options["engine"] != "gearsig":
        return 100_000  # it keeps several copies of the whole matrix of lines and samples
    return {"stft": 20_000_000, "cwt": 10_000_000, "squeezed-stft": 4_000_000}.get(options["transform"], 2_000_000)


def _bytes_per_sample(options: Mapping[str, Any]) -> float:
    return {"stft": 500.0, "squeezed-stft": 900.0}.get(options["transform"], 400.0)


# Wavelet packets.

PACKET_WAVELETS = ("sym12", "sym8", "db4", "db10", "db20", "coif3", "dmey", "haar")


def _packets(
    prepared: PreparedRecording,
    channel: str,
    wavelet: str,
    level: int,
    nodes: Sequence[float],
    over_angle: bool,
    shaft: str,
) -> MethodAnswer:
    signal = signal_of(prepared, channel, over_angle=over_angle, shaft=shaft)
    packets = prepared.keep(
        ("methods", "packets", channel, wavelet, level, over_angle, shaft),
        lambda: timefreq.wavelet_packets(signal, wavelet=wavelet, level=level),
    )
    levels = timefreq.wavelet_packet_map(signal, wavelet=wavelet, level=level)
    chosen = sorted({int(node) for node in nodes}) or [int(np.argmax(packets.energies))]
    if not all(0 <= node < packets.n_bands for node in chosen):
        raise InputError(f"nodes are {chosen}", allowed=f"0 to {packets.n_bands - 1}, upwards in frequency")
    paths = " + ".join(timefreq.node_path(band, packets.level) for band in chosen)
    name = f"node{'s' if len(chosen) > 1 else ''} {paths}"
    values = timefreq.packet_inverse(packets, chosen)
    columns = {"signal": signal.values, name: values, "residual": signal.values - values}
    answer = levels_answer(channel, levels, {"nodes": chosen})
    table = _energies(packets)
    unit = axis_unit(packets.axis)
    low, shares = table[f"from ({unit})"], table["share of the energy (%)"]
    edges = np.append(low, packets.limits_of(packets.n_bands - 1)[1])
    steps = ChartLine(np.repeat(edges, 2)[1:-1], np.repeat(shares, 2), "share")
    panel = LinePanel([steps], levels.axis_label, "share of the energy (%)", (0.0, 1.06 * shares.max()))
    rms = f"{np.sqrt(packets.energies.sum() / packets.n_samples):.4g} {unit_text(packets.unit)}".strip()
    return replace(
        answer,
        caption=f"wavelet packets: {answer.caption}",
        table=table,
        panels=(panel, *answer.panels),
        facts=(
            (
                f"**{packets.n_bands} nodes**, each {packets.band_width:.5g} {unit} wide. Together they contain the "
                f"part's energy, rms {rms}; its mean is in the first."
            ),
        ),
        notes=(
            (
                "A path names the filters: a low-pass, d high-pass. Near the ends, within the wavelet's length, nodes "
                "mix both ends of the part: it is taken as periodic."
            ),
        ),
        waveforms=waveforms_of(
            prepared, channel, signal, columns, f"wavelet packets, {packets.wavelet}, {name}", residual="residual"
        ),
    )


def _energies(packets: WaveletPackets) -> dict[str, Any]:
    bands, unit = range(packets.n_bands), axis_unit(packets.axis)
    return {
        "node": np.array([timefreq.node_path(band, packets.level) for band in bands], dtype=object),
        f"from ({unit})": np.array([packets.limits_of(band)[0] for band in bands]),
        f"to ({unit})": np.array([packets.limits_of(band)[1] for band in bands]),
        "mean square": packets.energies / packets.n_samples,
        "share of the energy (%)": 100.0 * packets.energies / (float(packets.energies.sum()) or 1.0),
    }


MAPS = {
    "time-frequency": Method(
        "Time–frequency",
        "Levels over time and frequency, or over shaft angle and order: shows transient and sweeping components.",
        _time_frequency,
        (TRANSFORM, *MAP_OPTIONS),
        "Time–frequency",
        n_max=20_000_000,
        limit=_limit,
        bytes_per_sample=_bytes_per_sample,
    ),
    "ridges": Method(
        "Ridges",
        "Follows components along their instantaneous frequency or order, and gives the waveform of each.",
        _ridges,
        (
            MethodOption("transform", "Transform", "choice", "squeezed-cwt", choices=NAMES),
            MethodOption("n_ridges", "Ridges", "count", 2, choices=verbatim(*range(1, 7)), maximum=12),
            MethodOption(
                "bends", "Penalty on bends", "number", 1.0,
                "Cost of changes of slope: raise it for sweeps in noise, lower it for fast modulation.",
                choices={x: f"{x:g}" for x in (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)}, minimum=0.0,
                more=True,
            ),
            MethodOption(
                "steepest", "Steepest (lines per column)", "number", 2.0,
                "Number of lines by which a ridge may rise or fall from one of the map's thousand columns to the next.",
                choices={x: f"{x:g}" for x in (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)}, minimum=0.0, more=True,
            ),
            MethodOption(
                "band_percent", "Band around the ridge (± %)", "number", None,
                "How far from the ridge, in percent of its frequency or order, the component reaches.",
                "as the wavelet", minimum=0.0, maximum=90.0, more=True,
            ),
            MethodOption(
                "assigned", "Assigned", "choice", "frequency",
                "By its instantaneous frequency: rejects more noise, but also fast modulation. By its lines: smoother.",
                choices={"frequency": "By its instantaneous frequency", "lines": "By its lines"}, more=True,
            ),
            *MAP_OPTIONS,
        ),
        "Time–frequency",
        limit=_limit,
        bytes_per_sample=_bytes_per_sample,
    ),
    "wavelet-packets": Method(
        "Wavelet packets",
        "Splits the signal into bands of equal width, and gives the energy of each and the waveforms of any.",
        _packets,
        (
            MethodOption(
                "wavelet", "Wavelet", "choice", "sym12",
                "Long wavelets separate bands better; nearly symmetric ones (sym, dmey) show events at the right time.",
                choices=verbatim(*PACKET_WAVELETS),
            ),
            MethodOption(
                "level", "Level", "count", 4,
                "How often the signal is split into halves: 2 to the power of it nodes of equal width.",
                choices=verbatim(*range(1, 9)), maximum=12,
            ),
            MethodOption(
                "nodes", "Waveform of the nodes", "numbers", (),
                "From 0 upwards in frequency. Several are added; all of them together make up the signal.",
                "the strongest", known=lambda *_: {},
            ),
            OVER_ANGLE,
            SHAFT,
        ),
        "Time–frequency",
        n_max=4_000_000,
    ),
}  # fmt: skip
