"""The methods by name: each gives one channel's figure, its numbers and its tables, for command line and reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gearsig import plot
from gearsig.angle import ShaftAngle
from gearsig.cache import write_text
from gearsig.checks import FloatArray, closest_match_hint, count, one_of
from gearsig.errors import InputError, RefusalError
from gearsig.orders import OrderMap
from gearsig.plot import Captioned, Cursor, order_cursors, with_unit
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording
from gearsig.report._files import made_folder
from gearsig.report._json import plain
from gearsig.rig import order_lines
from gearsig.spectra import Spectrum

if TYPE_CHECKING:
    from gearsig.decompose import Modes
    from gearsig.timefreq import TimeFrequencyMap, UniformSignal

TRANSFORMS = ("cwt", "squeezed-cwt", "stft", "squeezed-stft")
"""Transforms of the method time-frequency, and of a chosen mode."""


@dataclass(frozen=True)
class MethodOptions:
    """What a method is asked for; each method takes some of it and refuses the rest.

    Parameters
    ----------
    channel : str
        Empty: the first acceleration, else the first channel that is not a tachometer's.
    shaft : str
        Empty: the reference shaft.
    pair : str
        Gear pair whose mesh cycle gives a Poincaré point; empty: the first one.
    start_s, end_s : float or None
        Part of the recording; None: all.
    band_hz : (float, float) or None
        Of the envelope, or of the phase plane.
    lowest, highest : float or None
        Lines shown, in Hz or orders.
    orders : tuple of float
        To track; empty: those of the meshes, else the shaft's first three.
    transform : str
        One of `TRANSFORMS`.
    over_angle : bool
        Over the shaft's angle and orders, not over time and frequency.
    n_modes, penalty : int, float or None
        Of the variational modes; None: as suggested.
    mode : int or None
        From 1 by rising centre; None: the one with the largest kurtosis.
    then : str
        What the chosen mode goes on to: one of `TRANSFORMS`, or empty.
    """

    channel: str = ""
    shaft: str = ""
    pair: str = ""
    start_s: float | None = None
    end_s: float | None = None
    band_hz: tuple[float, float] | None = None
    lowest: float | None = None
    highest: float | None = None
    orders: tuple[float, ...] = ()
    transform: str = "cwt"
    over_angle: bool = False
    n_modes: int | None = None
    penalty: float | None = None
    mode: int | None = None
    then: str = ""


@dataclass(frozen=True)
class MethodAnswer:
    """What a method found in one channel.

    Parameters
    ----------
    method, channel : str
    picture : Captioned
    table : mapping
        Title with unit → column; all of one length.
    matrices : mapping
        Name → array of two dimensions, for maps: their rows and columns are named by `axes`.
    axes : mapping
        Title with unit → positions of the rows or columns of the matrices.
    numbers : mapping
        What else is known: settings, counts, warnings.
    """

    method: str
    channel: str
    picture: Captioned
    table: Mapping[str, NDArray[Any]]
    matrices: Mapping[str, FloatArray] = field(default_factory=dict)
    axes: Mapping[str, FloatArray] = field(default_factory=dict)
    numbers: Mapping[str, Any] = field(default_factory=dict)


Request = tuple[PreparedRecording, MethodOptions]


@dataclass(frozen=True)
class Method:
    """One row of the table of methods.

    Parameters
    ----------
    about : str
        What it shows, in a sentence.
    answer : callable
    options : tuple of str
        Fields of `MethodOptions` that it takes besides channel, start and end.
    needs_angle : bool
        Whether it takes the shaft's angle.
    """

    about: str
    answer: Callable[[PreparedRecording, MethodOptions], MethodAnswer]
    options: tuple[str, ...] = ()
    needs_angle: bool = False


def apply_method(
    name: str, recording: Recording | PreparedRecording, options: MethodOptions | None = None
) -> MethodAnswer:
    """Apply a method to one channel of a recording.

    Parameters
    ----------
    name : str
        One of `METHODS`.
    recording : Recording or PreparedRecording
    options : MethodOptions or None

    Raises
    ------
    InputError
        If there is no such method or channel, or the method does not take an option.
    RefusalError
        If the recording does not allow it: no speed, too short.
    """
    if name not in METHODS:
        raise InputError(f"there is no method {name!r}", allowed=", ".join(METHODS), remedy=_hint(name))
    method, settings = METHODS[name], options or MethodOptions()
    taken = {"channel", "start_s", "end_s", *method.options}
    for key, value in vars(settings).items():
        if key not in taken and value != getattr(MethodOptions(), key):
            fitting = ", ".join(n for n, m in METHODS.items() if key in m.options)
            raise InputError(f"{name} takes no {key.replace('_', ' ')}", remedy=f"it is an option of {fitting}")
    prepared = prepare(recording)
    if settings.start_s is not None or settings.end_s is not None:
        whole = prepared.recording
        end = whole.duration_s if settings.end_s is None else settings.end_s
        prepared = prepare(whole.between(settings.start_s or 0.0, end))
    return method.answer(prepared, replace(settings, channel=_channel(prepared.recording, settings.channel)))


def _hint(name: str) -> str:
    return closest_match_hint(name, list(METHODS))


def _channel(recording: Recording, name: str) -> str:
    if name:
        return recording.channels[recording.index(name)].name
    order = ("acceleration", "velocity", "displacement", "transmission_error", "sound_pressure")
    for quantity in order:
        for channel in recording.channels:
            if channel.quantity == quantity:
                return channel.name
    others = [c.name for c in recording.channels if c.quantity != "tachometer"]
    return others[0] if others else recording.channels[0].name


def write_answer(answer: MethodAnswer, folder: str | Path, name: str = "") -> tuple[Path, ...]:
    """Write figure (PNG and SVG), table (CSV), arrays (HDF5) and numbers (JSON) into a folder.

    Parameters
    ----------
    answer : MethodAnswer
    folder : path
        Made where it is missing.
    name : str
        Of the files, without ending; empty: the method's.

    Returns
    -------
    tuple of Path
    """
    import h5py
    from pandas import DataFrame

    stem = made_folder(Path(folder)) / (name or answer.method)
    paths = tuple(stem.with_name(f"{stem.name}{ending}") for ending in (".png", ".svg", ".csv", ".h5", ".json"))
    for path in paths[:2]:
        answer.picture.figure.savefig(path)
    table = DataFrame(dict(answer.table))
    table.to_csv(paths[2], index=False, float_format="%.9g")
    with h5py.File(paths[3], "w") as file:
        file.attrs["method"], file.attrs["channel"] = answer.method, answer.channel
        for group, arrays in (("table", answer.table), ("matrices", answer.matrices), ("axes", answer.axes)):
            for title, values in arrays.items():
                column = np.asarray(values)
                written = column.astype(h5py.string_dtype()) if column.dtype.kind in "OU" else column
                file.create_dataset(f"{group}/{title.replace('/', '∕')}", data=written, track_order=True)
    write_text(paths[4], answer_json(answer))
    return paths


def answer_json(answer: MethodAnswer) -> str:
    """Return what a method found as JSON, without its arrays; short tables are in it."""
    import json

    about: dict[str, Any] = {"method": answer.method, "channel": answer.channel, "shows": answer.picture.caption}
    about |= answer.numbers
    n_rows = max((len(column) for column in answer.table.values()), default=0)
    columns = list(answer.table)
    about["columns"] = columns if len(columns) <= 40 else [*columns[:3], "…", columns[-1]]
    if n_rows * len(columns) <= 2000:
        about["table"] = {title: np.asarray(column).tolist() for title, column in answer.table.items()}
    return json.dumps(plain(about), ensure_ascii=False, indent=2, allow_nan=False)


# Spectra and maps over frequency and order.


def _cursors(prepared: PreparedRecording, shown: Spectrum | OrderMap) -> tuple[Cursor, ...]:
    """Lines that the rig implies, where the speed is known and they are sharp."""
    try:
        angle = prepared.shaft_angle
    except (InputError, RefusalError):
        return ()
    low, high = angle.speed_range_rpm
    if shown.axis == "frequency" and high - low > 0.01 * angle.mean_speed_rpm:
        return ()
    scale = angle.mean_speed_rpm / 60.0 if shown.axis == "frequency" else 1.0
    rig = prepared.rig
    if not rig.shafts:
        return tuple(Cursor(k * scale, "shaft", f"{k}× shaft", k) for k in (1, 2, 3))
    base = shown.shaft if shown.shaft in rig.shaft_names else angle.shaft
    return order_cursors(order_lines(rig, base, n_sidebands=1), scale)


def _spectrum_answer(
    name: str, prepared: PreparedRecording, options: MethodOptions, spectrum: Spectrum, caption: str
) -> MethodAnswer:
    low = options.lowest or 0.0
    high = float(spectrum.positions[-1]) if options.highest is None else options.highest
    limits = (low, min(high, float(spectrum.positions[-1])))
    cursors = () if spectrum.axis == "quefrency" else _cursors(prepared, spectrum)
    figure = plot.spectrum_figure(spectrum, cursors, limits=limits, title=f"{options.channel}: {caption}")
    inside = (spectrum.positions >= low) & (spectrum.positions <= high)
    axis = {"frequency": "frequency (Hz)", "order": f"order (of {spectrum.shaft or 'the shaft'})"}
    title = axis.get(spectrum.axis, "quefrency (s)")
    table = {title: spectrum.positions[inside], with_unit(spectrum.scaling, spectrum.unit): spectrum.values[inside]}
    numbers = {"resolution": spectrum.resolution, "scaling": spectrum.scaling, "unit": spectrum.unit}
    return MethodAnswer(name, options.channel, Captioned(figure, caption, caption), table, numbers=numbers)


def _spectrum(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    spectrum = prepared.spectrum(options.channel)
    return _spectrum_answer("spectrum", prepared, options, spectrum, "amplitude spectrum")


def _density(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    density = prepared.power_density(options.channel)
    return _spectrum_answer("density", prepared, options, density, "power spectral density")


def _cepstrum(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.spectra import cepstrum

    spectrum = cepstrum(prepared.recording, options.channel)
    return _spectrum_answer("cepstrum", prepared, options, spectrum, "real cepstrum: families of lines as one peak")


def _order_spectrum(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.orders import order_spectrum

    signal = prepared.over_angle(options.shaft, [options.channel])
    spectrum = order_spectrum(signal, options.channel)
    settings = options if options.highest is not None else replace(options, highest=_highest_order(prepared, spectrum))
    return _spectrum_answer("order-spectrum", prepared, settings, spectrum, "order spectrum")


def _highest_order(prepared: PreparedRecording, shown: Spectrum | OrderMap) -> float:
    """Past the third harmonic of the fastest mesh; 50 orders where none is known."""
    meshes = [cursor.position for cursor in _cursors(prepared, shown) if cursor.kind == "mesh"]
    return min(float(shown.positions[-1]), 1.12 * max(meshes) if meshes else 50.0)


def _map_answer(
    name: str, prepared: PreparedRecording, options: MethodOptions, levels: OrderMap, highest: float | None
) -> MethodAnswer:
    over = "order" if levels.axis == "order" else "frequency"
    caption = f"{over} map: spectra of consecutive blocks"
    figure = plot.order_map_figure(levels, _cursors(prepared, levels), highest=highest)
    unit = "Hz" if over == "frequency" else "order"
    top = np.inf if highest is None else highest
    kept = levels.positions <= top
    values, positions = levels.values[:, kept], levels.positions[kept]
    table = {"time (s)": levels.time_s, "speed (rpm)": levels.speed_rpm}
    lines = {f"{p:.7g} {unit}": values[:, i] for i, p in enumerate(positions)}
    numbers = {"resolution": levels.resolution, "scaling": levels.scaling, "unit": levels.unit, "shaft": levels.shaft}
    return MethodAnswer(
        name,
        options.channel,
        Captioned(figure, caption, f"{caption}, {options.channel}"),
        table | lines,
        {"levels": values},
        {**table, over: positions},
        numbers,
    )


def _order_map(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.orders import order_map

    signal = prepared.over_angle(options.shaft, [options.channel])
    n_revolutions = int(signal.n_revolutions)
    levels = order_map(signal, options.channel, revolutions_per_block=max(1, min(10, n_revolutions // 8)))
    highest = options.highest if options.highest is not None else _highest_order(prepared, levels)
    return _map_answer("order-map", prepared, options, levels, highest)


def _frequency_map(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.orders import frequency_map

    recording = prepared.recording
    n = int(min(4096, 2 ** np.floor(np.log2(max(recording.n_samples / 8.0, 16.0)))))
    unit = recording.channels[recording.index(options.channel)].unit
    levels = frequency_map(
        recording.values(options.channel),
        recording.sampling_rate_hz,
        prepared.shaft_angle,
        n_per_block=n,
        unit=unit,
        source=options.channel,
    )
    return _map_answer("frequency-map", prepared, options, levels, options.highest)


def _tracking(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.orders import track_orders

    rig = prepared.rig
    meshes = [order for pair in rig.pairs if (order := rig.mesh_order(pair)) is not None]
    orders = options.orders or tuple(float(k * m) for m in meshes for k in (1, 2))[:6] or (1.0, 2.0, 3.0)
    signal = prepared.over_angle(options.shaft, [options.channel])
    block = max(1.0, min(10.0, signal.n_revolutions / 8.0))
    tracked = track_orders(signal, options.channel, orders, revolutions_per_block=block)
    unit, time_s, speed = tracked[0].unit, tracked[0].time_s, tracked[0].speed_rpm
    curves = {f"order {t.order:.6g}": t.amplitude for t in tracked}
    sweeps = float(np.ptp(speed)) > 0.05 * float(np.mean(speed))
    x, label = (speed, "speed (rpm)") if sweeps else (time_s, "time (s)")
    rising = np.argsort(x, kind="stable")
    sorted_curves = {name: values[rising] for name, values in curves.items()}
    panel = plot.CurvePanel(x[rising], sorted_curves, label, with_unit("amplitude peak", unit))
    caption = f"levels of {len(tracked)} orders over {'speed' if sweeps else 'time'}"
    figure = plot.curves_figure([panel], title=f"{options.channel}: {caption}")
    table: dict[str, NDArray[Any]] = {"time (s)": time_s, "speed (rpm)": speed}
    for t in tracked:
        table[with_unit(f"order {t.order:.6g}, amplitude peak", unit)] = t.amplitude
        table[f"order {t.order:.6g}, phase (rad)"] = t.phase_rad
    numbers = {"bandwidth_orders": tracked[0].bandwidth_orders, "shaft": tracked[0].shaft}
    picture = Captioned(figure, caption, f"{caption}, {options.channel}")
    return MethodAnswer("tracking", options.channel, picture, table, numbers=numbers)


# Envelope and kurtogram.


def _envelope(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.spectra import kurtogram_envelope

    banded = kurtogram_envelope(prepared.recording, options.channel, band_hz=options.band_hz)
    low, high = banded.envelope.band_hz
    text = f"spectrum of the envelope of {low:.4g} to {high:.4g} Hz"
    top = (
        options.highest if options.highest is not None else min(float(banded.spectrum.positions[-1]), (high - low) / 2)
    )
    answer = _spectrum_answer("envelope", prepared, replace(options, highest=top), banded.spectrum, text)
    numbers = {"band_hz": [low, high], "reason": banded.reason, "warnings": list(banded.warnings)}
    return replace(answer, numbers={**answer.numbers, **numbers})


def _kurtogram(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.spectra import kurtogram

    kurtosis_map = kurtogram(prepared.recording, options.channel, source=options.channel)
    best = kurtosis_map.best_band()
    table = {
        "from (Hz)": kurtosis_map.low_hz,
        "to (Hz)": kurtosis_map.high_hz,
        "level": kurtosis_map.level,
        "kurtosis": kurtosis_map.kurtosis,
        "standard error": kurtosis_map.standard_error,
    }
    caption = "kurtogram: spectral kurtosis of bands; the outlined one is the most impulsive"
    picture = Captioned(plot.kurtogram_figure(kurtosis_map), caption, f"{caption}, {options.channel}")
    return MethodAnswer("kurtogram", options.channel, picture, table, numbers={"best_band": plain(best)})


# Time and frequency; modes, and what one of them goes on to.


def _signal(prepared: PreparedRecording, options: MethodOptions) -> UniformSignal:
    from gearsig.timefreq import uniform

    if options.over_angle:
        return uniform(prepared.over_angle(options.shaft, [options.channel]), options.channel)
    return uniform(prepared.recording, options.channel)


def _levels(signal: UniformSignal, options: MethodOptions, transform: str) -> TimeFrequencyMap:
    from gearsig import timefreq

    one_of(transform, "transform", TRANSFORMS)
    function: Callable[..., TimeFrequencyMap] = getattr(timefreq, f"{transform.replace('-', '_')}_map")
    levels: TimeFrequencyMap = function(signal, lowest=options.lowest, highest=options.highest)
    return levels


def _levels_answer(name: str, channel: str, levels: TimeFrequencyMap, numbers: Mapping[str, Any]) -> MethodAnswer:
    unit = "Hz" if levels.axis == "frequency" else "orders"
    caption = f"{levels.axis_label} over {levels.at_label}, {levels.method}"
    table: dict[str, NDArray[Any]] = {levels.at_label: levels.at}
    table |= {f"{p:.7g} {unit}": levels.values[:, i] for i, p in enumerate(levels.positions)}
    axes = {levels.at_label: levels.at, levels.axis_label: levels.positions}
    picture = Captioned(plot.time_frequency_figure(levels), caption, f"{caption}, {levels.source}")
    about = {"scaling": levels.scaling, "unit": levels.unit, "transform": levels.method, **numbers}
    return MethodAnswer(name, channel, picture, table, {"levels": levels.values}, axes, about)


def _time_frequency(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    levels = _levels(_signal(prepared, options), options, options.transform)
    return _levels_answer("time-frequency", options.channel, levels, {})


def _modes(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.decompose import VmdSettings, suggest_modes, vmd

    signal = _signal(prepared, options)
    reasons: tuple[str, ...] = ()
    settings = VmdSettings(count(options.n_modes or 4, "n_modes"), options.penalty or 2000.0)
    if options.n_modes is None:
        suggested = suggest_modes(signal)
        settings, reasons = suggested.settings, suggested.reasons
        settings = settings if options.penalty is None else replace(settings, penalty=options.penalty)
    modes = vmd(signal, None, settings)
    chosen = _chosen_mode(modes, options.mode)
    ranks = {k: rank for rank, k in enumerate(modes.by_centre(), start=1)}
    numbers = {
        "centres": [modes.centres[k] for k in modes.by_centre()],
        "bandwidths": [modes.bandwidths[k] for k in modes.by_centre()],
        "kurtosis": [_kurtosis(modes.waveforms[k]) for k in modes.by_centre()],
        "chosen_mode": ranks[chosen],
        "penalty": modes.settings.penalty,
        "reasons": list(reasons),
        "warnings": list(modes.notes),
    }
    unit = "Hz" if modes.axis == "frequency" else "orders"
    if options.then:
        near = _near_the_mode(modes, chosen, options)
        levels = _levels(modes.signal(chosen, start=signal.start), near, options.then)
        answer = _levels_answer("modes", options.channel, levels, numbers)
        centre = f"mode {ranks[chosen]} of {modes.n_modes}, centre {modes.centres[chosen]:.5g} {unit}"
        picture = replace(answer.picture, caption=f"{centre}: {answer.picture.caption}")
        return replace(answer, picture=picture)
    table: dict[str, NDArray[Any]] = {
        ("time (s)" if modes.axis == "frequency" else "angle (revolutions)"): signal.start + modes.positions
    }
    for k in modes.by_centre():
        table[with_unit(f"mode {ranks[k]}, {modes.centres[k]:.5g} {unit}", modes.unit)] = modes.waveforms[k]
    table[with_unit("residual", modes.unit)] = modes.residual
    caption = f"{modes.n_modes} variational modes and the residual"
    picture = Captioned(plot.modes_figure(modes), caption, f"{caption}, {options.channel}")
    return MethodAnswer("modes", options.channel, picture, table, numbers=numbers)


def _chosen_mode(modes: Modes, rank: int | None) -> int:
    """Return the mode that is asked for by its rank among the centres, or the most impulsive one."""
    if rank is None:
        return int(np.argmax([_kurtosis(waveform) for waveform in modes.waveforms]))
    if not 1 <= rank <= modes.n_modes:
        raise InputError(f"mode is {rank}", allowed=f"1 to {modes.n_modes}, by rising centre")
    return modes.by_centre()[rank - 1]


def _near_the_mode(modes: Modes, chosen: int, options: MethodOptions) -> MethodOptions:
    """Return the options with lines two octaves to either side of the mode's centre, where none are given."""
    centre, top = float(modes.centres[chosen]), 0.45 * modes.sampling_rate
    low = centre / 4.0 if options.lowest is None else options.lowest
    return replace(options, lowest=low, highest=min(4.0 * centre, top) if options.highest is None else options.highest)


def _kurtosis(values: FloatArray) -> float:
    from gearsig.indicators import kurtosis

    return kurtosis(values)


# Phase plane and Poincaré section.


def _phase(name: str, prepared: PreparedRecording, options: MethodOptions, *, with_section: bool) -> MethodAnswer:
    from gearsig import phase

    recording = prepared.recording
    low, high = options.band_hz or (None, None)
    quantity = recording.channels[recording.index(options.channel)].quantity
    if low is None and quantity in ("acceleration", "velocity"):
        low = max(_below_the_mesh_hz(prepared), 1.05 * phase.lowest_low_cut_hz(recording.duration_s))
    portrait = phase.phase_plane(recording, options.channel, low_cut_hz=low, high_cut_hz=high)
    lock = section = None
    try:
        pair = options.pair or (prepared.rig.pairs[0].name if prepared.rig.pairs else "")
        angle = prepared.shaft_angle
        lock = phase.find_lock(recording, pair=pair, shaft=options.shaft, rig=prepared.rig, angle=angle)
        section = phase.poincare_section(portrait, lock)
    except RefusalError:
        if with_section:
            raise
    caption = "velocity over displacement" + (", a point once per mesh cycle" if section is not None else "")
    numbers: dict[str, Any] = {"band_hz": list(portrait.band_hz)}
    names = [with_unit(n, u) for n, u in zip(portrait.axis_names, portrait.units, strict=True)]
    times = portrait.start_s + np.arange(len(portrait.points)) / portrait.sampling_rate_hz
    path = {name: portrait.points[:, i] for i, name in enumerate(names)}
    table: dict[str, NDArray[Any]] = {"time (s)": times, **path}
    if section is not None:
        numbers["scatter"] = [float(v) for v in section.points.std(axis=0) / section.extent]
        numbers["section"], numbers["points"] = section.section, len(section.points)
        if with_section:
            columns = {names[0]: section.points[:, 0], names[1]: section.points[:, 1]}
            table = {"time (s)": section.times_s, **columns}
    figure = plot.phase_portrait_figure(portrait, section)
    picture = Captioned(figure, caption, f"{caption}, {options.channel}")
    return MethodAnswer(name, options.channel, picture, table, numbers=numbers)


def _below_the_mesh_hz(prepared: PreparedRecording) -> float:
    """A third of the slowest mesh frequency: below, integrated noise outgrows the motion of the teeth."""
    try:
        slowest = prepared.shaft_angle.speed_range_rpm[0] / 60.0
    except (InputError, RefusalError):
        return 10.0
    meshes = [order for pair in prepared.rig.pairs if (order := prepared.rig.mesh_order(pair)) is not None]
    return min(meshes) * slowest / 3.0 if meshes else 0.5 * slowest


def _phase_plane(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    return _phase("phase-plane", prepared, options, with_section=False)


def _poincare(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    return _phase("poincare", prepared, options, with_section=True)


# Averages, indicators, waveform, speed.


def _average(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    shaft = options.shaft or prepared.shaft_angle.shaft
    average = prepared.average(shaft, options.channel)
    rig = prepared.rig
    sides = [side for p in rig.pairs for side in ((p.driver, p.driver_teeth), (p.driven, p.driven_teeth))]
    teeth = next((n for name, n in sides if name == shaft), None)
    caption = f"mean revolution of {shaft or 'the shaft'}, {average.n_revolutions} averaged"
    angle = 360.0 * np.arange(len(average.values)) / len(average.values)
    table = {
        "angle (°)": angle,
        with_unit("average", average.unit): average.values,
        with_unit("standard error", average.unit): average.standard_error,
    }
    picture = Captioned(plot.average_figure([average], n_teeth=teeth), caption, f"{caption}, {options.channel}")
    return MethodAnswer("average", options.channel, picture, table, numbers={"n_revolutions": average.n_revolutions})


def _indicators(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    from gearsig.diagnosis import analyze

    indicators = [i for i in analyze(prepared.recording).indicators if i.channel in ("", options.channel)]
    table = {
        name: np.array([getattr(i, name) for i in indicators], dtype=None if name == "value" else object)
        for name in ("name", "value", "unit", "computed_on", "shaft", "gear", "bearing", "band", "note")
    }
    rms = prepared.recording.values(options.channel)
    n = max(1, len(rms) // 200)
    level = np.sqrt(np.add.reduceat(np.square(rms, dtype=np.float64), np.arange(0, len(rms), n)) / n)[:-1]
    time_s = (np.arange(len(level)) + 0.5) * n / prepared.recording.sampling_rate_hz
    unit = prepared.recording.channels[prepared.recording.index(options.channel)].unit
    caption = f"{len(indicators)} condition indicators; drawn: rms over time"
    panel = plot.CurvePanel(time_s, {"rms": level}, "time (s)", with_unit("rms", unit))
    figure = plot.curves_figure([panel], title=f"{options.channel}: {caption}")
    return MethodAnswer("indicators", options.channel, Captioned(figure, caption, caption), table)


def _waveform(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    recording = prepared.recording
    unit = recording.channels[recording.index(options.channel)].unit
    time_s = np.arange(recording.n_samples) / recording.sampling_rate_hz
    caption = "signal over time"
    figure = plot.time_figure(recording, [options.channel])
    table = {"time (s)": time_s, with_unit(options.channel, unit): recording.values(options.channel)}
    return MethodAnswer("waveform", options.channel, Captioned(figure, caption, caption), table)


def _speed(prepared: PreparedRecording, options: MethodOptions) -> MethodAnswer:
    angle: ShaftAngle = prepared.shaft_angle
    caption = f"speed of {angle.shaft or 'the reference shaft'}"
    table = {"time (s)": angle.time_s, "speed (rpm)": 60.0 * angle.speed_rev_per_s}
    picture = Captioned(plot.speed_figure(angle), caption, caption)
    return MethodAnswer("speed", options.channel, picture, table, numbers={"mean_speed_rpm": angle.mean_speed_rpm})


_LINES = ("lowest", "highest")
_PLANE = ("band_hz", "pair", "shaft")
_OF_TRANSFORM = ("over_angle", "shaft", *_LINES)
METHODS: dict[str, Method] = {
    "waveform": Method("The signal over time.", _waveform),
    "speed": Method("The speed that everything over angle rests on.", _speed, (), needs_angle=True),
    "spectrum": Method("Tones and their amplitudes.", _spectrum, _LINES),
    "density": Method("Noise over frequency.", _density, _LINES),
    "cepstrum": Method("Families of equally spaced lines, as one peak each.", _cepstrum, _LINES),
    "order-spectrum": Method("Lines that turn with a shaft.", _order_spectrum, (*_LINES, "shaft"), needs_angle=True),
    "order-map": Method("Orders over time and speed.", _order_map, ("highest", "shaft"), needs_angle=True),
    "frequency-map": Method("Frequencies over time and speed.", _frequency_map, ("highest",), needs_angle=True),
    "tracking": Method("Level and phase of orders over speed.", _tracking, ("orders", "shaft"), needs_angle=True),
    "average": Method("The mean revolution of a shaft.", _average, ("shaft",), needs_angle=True),
    "envelope": Method("The rhythm of impacts in a band.", _envelope, ("band_hz", *_LINES)),
    "kurtogram": Method("Which band carries impacts.", _kurtogram),
    "time-frequency": Method("Levels over time and frequency.", _time_frequency, ("transform", *_OF_TRANSFORM)),
    "modes": Method(
        "Narrow-band parts (VMD), and the transform of one of them.",
        _modes,
        ("n_modes", "penalty", "mode", "then", *_OF_TRANSFORM),
    ),
    "phase-plane": Method("Velocity over displacement.", _phase_plane, _PLANE),
    "poincare": Method("The motion once per mesh cycle: does it repeat?", _poincare, _PLANE, needs_angle=True),
    "indicators": Method("Every condition indicator of the channel.", _indicators),
}
"""The methods by the names that command line and reports know them by."""


_REVOLUTIONS_SHOWN = 12.0
"""Of a map on a page: single impacts of a damaged tooth must show."""


def named_method(text: str) -> tuple[str, MethodOptions]:
    """Return method and options of "order-map", "time-frequency+squeezed-cwt" or "modes+squeezed-cwt"."""
    name, plus, transform = text.partition("+")
    if name not in METHODS:
        raise InputError(f"there is no method {name!r}", allowed=", ".join(METHODS), remedy=_hint(name))
    option = "then" if name == "modes" else "transform"
    if plus and option not in METHODS[name].options:
        raise InputError(f"{name} goes on to no transform", remedy="modes+squeezed-cwt does")
    if not plus:
        return name, MethodOptions()
    one_of(transform, "transform", TRANSFORMS)
    return name, MethodOptions(then=transform) if name == "modes" else MethodOptions(transform=transform)


def fitting_methods(
    recording: Recording,
    angle: ShaftAngle | None,
    *,
    suspects_crack: bool = False,
    suspects_bearing: bool = False,
) -> tuple[str, ...]:
    """Return the methods that a recording calls for, besides those that every page has.

    A run-up or coast-down: order map, frequency map and tracked orders. A suspected crack or other damage of a tooth:
    the squeezed transform of its most impulsive mode. Else a suspected bearing: the kurtogram. A simulated motion at a
    steady speed: its Poincaré section in the phase plane.
    """
    names: list[str] = []
    sweeps = angle is not None and bool(np.ptp(angle.speed_range_rpm) > 0.1 * angle.mean_speed_rpm)
    if sweeps:
        names += ["order-map", "frequency-map", "tracking"]
    if suspects_crack:
        names.append("modes+squeezed-cwt")
    elif suspects_bearing:
        names.append("kurtogram")
    if recording.truth is not None and angle is not None and not sweeps:
        names.append("poincare")
    return tuple(names)


def method_pictures(
    names: Sequence[str], prepared: PreparedRecording, channel: str = ""
) -> tuple[tuple[Captioned, ...], tuple[str, ...]]:
    """Return the figures of several methods of one channel, and why others have none.

    Maps over time show the first twelve revolutions, or what is there.
    """
    pictures: list[Captioned] = []
    reasons: list[str] = []
    for text in names:
        name, options = named_method(text)
        settings = replace(options, channel=channel)
        try:
            if "transform" in METHODS[name].options or options.then:
                turns = prepared.shaft_angle.mean_speed_rpm / 60.0
                settings = replace(settings, end_s=min(prepared.recording.duration_s, _REVOLUTIONS_SHOWN / turns))
            answer = apply_method(name, prepared, settings)
        except RefusalError as refusal:
            reasons.append(f"{text}: {refusal}")
            continue
        caption = answer.picture.caption
        pictures.append(replace(answer.picture, caption=f"{caption[0].upper()}{caption[1:]}, {answer.channel}."))
    return tuple(pictures), tuple(reasons)
