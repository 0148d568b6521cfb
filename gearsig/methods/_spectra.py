"""Methods over frequency and order: spectra, envelope and kurtogram, coherence, deconvolution; waveform and speed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gearsig import plot, spectra
from gearsig.angle import ShaftAngle, resample_to_angle
from gearsig.diagnosis import CHANGED, Analysis, RecordBlocks, analyze
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import readable
from gearsig.indicators import kurtosis
from gearsig.methods._table import (
    IN_HZ,
    LINES,
    SHAFT,
    Method,
    MethodAnswer,
    MethodOption,
    angle_or_none,
    signal_of,
    top_hz,
    unit_of,
    verbatim,
    waveforms_of,
)
from gearsig.orders import OrderMap, SynchronousAverage, order_spectrum
from gearsig.plot import (
    ChartLine,
    Cursor,
    LevelPanel,
    LinePanel,
    modulation_cursors,
    order_cursors,
    rig_cursors,
    with_unit,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Channel, Recording
from gearsig.rig import order_lines
from gearsig.spectra import Spectrum

SLIP_SHARE = 0.01
"""Bearings slip by about one per cent."""


def cursors_of(prepared: PreparedRecording, shown: Spectrum | OrderMap) -> tuple[Cursor, ...]:
    """Return the lines that the rig implies, if the speed is known and they are sharp."""
    angle = angle_or_none(prepared)
    if angle is None or (shown.axis == "frequency" and not angle.is_steady()):
        return ()
    return rig_cursors(prepared.rig, angle, shown, n_sidebands=1)


def modulations_of(prepared: PreparedRecording, shown: Spectrum) -> tuple[Cursor, ...]:
    """Return the lines of shafts and bearings that an envelope spectrum or a coherence may show."""
    return modulation_cursors(cursors_of(prepared, shown))


def periods_of(prepared: PreparedRecording) -> tuple[Cursor, ...]:
    """Return the quefrencies of one turn of each shaft and of one mesh cycle; none if the speed changes."""
    angle = angle_or_none(prepared)
    if angle is None or not angle.is_steady() or not prepared.rig.shafts:
        return ()
    lines = order_lines(prepared.rig, angle.shaft, n_mesh_harmonics=1, n_shaft_harmonics=1, n_sidebands=0)
    return tuple(
        replace(cursor, position=1.0 / cursor.position, label=f"period of {cursor.label.removeprefix('1× ')}")
        for cursor in order_cursors(lines, angle.mean_speed_rpm / 60.0)
        if cursor.kind in ("shaft", "mesh") and cursor.number == 1
    )


LONGEST_ECHO_S = 0.005
"""Below this quefrency a cepstrum shows the transmission path and the shape of the floor, a hundred times as large as
any family."""


def columns_of(spectrum: Spectrum) -> dict[str, Any]:
    """Return a spectrum as a table."""
    return {spectrum.axis_label: spectrum.positions, with_unit(spectrum.scaling, spectrum.unit): spectrum.values}


def _panel(
    spectrum: Spectrum,
    cursors: Sequence[Cursor],
    *,
    linear: bool,
    name: str = "",
    shown: tuple[float, float] | None = None,
) -> LinePanel:
    values = spectrum.values if linear else plot.above_zero(spectrum.values)
    line = ChartLine(spectrum.positions, values, spectrum.source, peaks=True)
    inside = values[min(3, len(values) - 1) :]
    if shown is not None and shown[0] < shown[1]:  # values elsewhere may be a hundred times as large
        within = values[(spectrum.positions >= shown[0]) & (spectrum.positions <= shown[1])]
        inside = within[3 if shown[0] <= spectrum.positions[0] and len(within) > 9 else 0 :]
        inside = inside if len(inside) else values
    high, low = float(inside.max()), float(np.percentile(inside, 5))
    limits = (min(0.0, float(inside.min())), 1.06 * high or 1.0) if linear else (max(low, high * 1e-8) / 2, 2 * high)
    text = name or ("value" if spectrum.scaling == "dimensionless" else spectrum.scaling)
    return LinePanel((line,), spectrum.axis_label, with_unit(text, spectrum.unit), limits, not linear, cursors, shown)


def _spectrum_answer(
    prepared: PreparedRecording,
    channel: str,
    spectrum: Spectrum,
    caption: str,
    lowest: float | None,
    highest: float | None,
    *,
    of_envelope: bool = False,
) -> MethodAnswer:
    low = lowest or 0.0
    high = float(spectrum.positions[-1]) if highest is None else highest
    limits = (low, min(high, float(spectrum.positions[-1])))
    is_quefrency = spectrum.axis == "quefrency"
    cursors = periods_of(prepared) if is_quefrency else cursors_of(prepared, spectrum)
    cursors = modulation_cursors(cursors) if of_envelope else cursors
    inside = (spectrum.positions >= low) & (spectrum.positions <= high)
    numbers = {"resolution": spectrum.resolution, "scaling": spectrum.scaling, "unit": spectrum.unit}
    part = {name: column[inside] for name, column in columns_of(spectrum).items()}
    return MethodAnswer(
        channel,
        caption,
        lambda: plot.spectrum_figure(
            spectrum, cursors, scale="linear" if is_quefrency else "log", limits=limits, title=f"{channel}: {caption}"
        ),
        part,
        numbers=numbers,
        panels=(_panel(spectrum, cursors, linear=is_quefrency, name="cepstrum" if is_quefrency else "", shown=limits),),
    )


def _spectrum(prepared: PreparedRecording, channel: str, **lines: Any) -> MethodAnswer:
    return _spectrum_answer(prepared, channel, prepared.spectrum(channel), "amplitude spectrum", **lines)


def _density(prepared: PreparedRecording, channel: str, **lines: Any) -> MethodAnswer:
    return _spectrum_answer(prepared, channel, prepared.power_density(channel), "power spectral density", **lines)


def _density_in_blocks(blocks: RecordBlocks, prepared: PreparedRecording, channel: str, **lines: Any) -> MethodAnswer:
    return _spectrum_answer(prepared, channel, blocks.power_density(channel), "power spectral density", **lines)


def _cepstrum(prepared: PreparedRecording, channel: str, lowest: float | None, highest: float | None) -> MethodAnswer:
    spectrum = spectra.cepstrum(prepared.recording, channel)
    end = float(spectrum.positions[-1])
    longest = max((cursor.position for cursor in periods_of(prepared)), default=end)
    low = min(LONGEST_ECHO_S, (highest or end) / 8.0) if lowest is None else lowest
    high = max(min(3.5 * longest, end), 2.0 * low) if highest is None else highest
    return _spectrum_answer(prepared, channel, spectrum, "real cepstrum: families of lines as one peak", low, high)


def _order_spectrum(
    prepared: PreparedRecording, channel: str, shaft: str, lowest: float | None, highest: float | None
) -> MethodAnswer:
    spectrum = order_spectrum(prepared.over_angle(shaft, [channel]), channel)
    top = plot.upper_axis_limit(spectrum, cursors_of(prepared, spectrum)) if highest is None else highest
    return _spectrum_answer(prepared, channel, spectrum, "order spectrum", lowest, top)


# Modulations in noise: envelope, kurtogram, cyclic coherence.

BAND = MethodOption(
    "band_hz", "Band (Hz)", "span", None, "Band of the envelope.", "the most impulsive one", unit="Hz", known=top_hz,
)  # fmt: skip
PREPARATION = MethodOption(
    "preparation", "Signal", "choice", "none",
    ("Tones removed: steady lines, such as mesh harmonics, are reduced to the floor. Whitened: all lines are made "
    "equally strong, which also removes resonances."),
    choices={"none": "As recorded", "tones removed": "Tones removed", "whitened": "Whitened"},
)  # fmt: skip


def _usual_modulation_hz(prepared: PreparedRecording, channel: str = "") -> float:
    """Third harmonic of the fastest bearing line, plus slip, in Hz; 12 orders if no bearing is known."""
    del channel
    rate, rig, angle = prepared.recording.sampling_rate_hz, prepared.rig, angle_or_none(prepared)
    if angle is None:
        return float(f"{rate / 128.0:.3g}")
    lines = order_lines(rig, n_sidebands=0) if rig.shafts else ()
    order = max((3.3 * line.order for line in lines if line.kind == "bearing"), default=12.0)
    return float(f"{min(order * angle.mean_speed_rpm / 60.0, rate / 16.0):.3g}")


HIGHEST_MODULATION = MethodOption(
    "highest_modulation_hz", "Highest modulation (Hz)", "number", None,
    "The highest frequency of interest. Bands must be three times as wide, and the envelope's spectrum ends there.",
    unit="Hz", known=lambda prepared, channel: f"{_usual_modulation_hz(prepared, channel):.3g}",
)  # fmt: skip


def _over_orders(prepared: PreparedRecording, over: str) -> bool:
    """Whether lines are orders: as requested, or by default if the speed is known and changes."""
    angle = angle_or_none(prepared)
    return over == "order" or (over == "automatic" and angle is not None and not angle.is_steady())


_MODULATION_OVER = MethodOption(
    "over", "Modulation over", "choice", "automatic",
    "Over orders, a change of speed does not smear the lines that follow it.",
    choices={"automatic": "Automatic", "frequency": "Frequency", "order": "Order"},
)  # fmt: skip


def _envelope(
    prepared: PreparedRecording,
    channel: str,
    band_hz: tuple[float, float] | None,
    lowest: float | None,
    highest: float | None,
) -> MethodAnswer:
    usual_hz = _usual_modulation_hz(prepared)
    banded = spectra.kurtogram_envelope(  # three times as wide, as in the kurtogram: modulations must fit into the band
        prepared.recording, channel, narrowest_hz=3.0 * usual_hz, band_hz=band_hz
    )
    low, high = banded.envelope.band_hz
    text = f"spectrum of the squared envelope of {readable(low)} to {readable(high)} Hz"
    top = min(float(banded.spectrum.positions[-1]), (high - low) / 2, usual_hz) if highest is None else highest
    answer = _spectrum_answer(prepared, channel, banded.spectrum, text, lowest, top, of_envelope=True)
    numbers = {"band_hz": [low, high], "reason": banded.reason, "warnings": list(banded.warnings)}
    facts = (*answer.facts, *([f"Band: {banded.reason}"] if banded.reason else []))
    return replace(answer, numbers={**answer.numbers, **numbers}, facts=facts, warnings=banded.warnings)


def _envelope_in_blocks(
    blocks: RecordBlocks,
    prepared: PreparedRecording,
    channel: str,
    band_hz: tuple[float, float] | None,
    lowest: float | None,
    highest: float | None,
) -> MethodAnswer:
    if band_hz is None:
        raise InputError(
            "the record exceeds the memory, and no band is given",
            allowed="--band FROM..TO",
            remedy="gearsig show kurtogram finds one in a part: --from 0s --to 10s",
        )
    spectrum = blocks.envelope_density(channel, band_hz)
    text = f"power density of the squared envelope of {readable(band_hz[0])} to {readable(band_hz[1])} Hz"
    top = highest if highest is not None else min(float(spectrum.positions[-1]), (band_hz[1] - band_hz[0]) / 2)
    answer = _spectrum_answer(prepared, channel, spectrum, text, lowest, top, of_envelope=True)
    return replace(answer, numbers={**answer.numbers, "band_hz": list(band_hz)})


def _kurtogram(
    prepared: PreparedRecording,
    channel: str,
    preparation: Any,
    levels: int | None,
    highest_modulation_hz: float | None,
    band_hz: tuple[float, float] | None,
    over: str,
) -> MethodAnswer:
    # The band must be wide enough for the highest modulation of interest, and its envelope long enough for a kurtosis.
    recording = prepared.recording
    usual = highest_modulation_hz or _usual_modulation_hz(prepared)
    max_levels = max(1, int(np.log2(max(recording.n_samples / 512.0, 2.0))))
    n_levels = levels or min(7, max_levels)
    settings = (preparation, n_levels, usual, band_hz)
    chosen = prepared.keep(
        ("methods", "kurtogram", channel, settings),
        lambda: spectra.kurtogram_envelope(
            recording, channel, preparation=preparation, n_levels=n_levels, highest_modulation_hz=usual, band_hz=band_hz
        ),
    )
    grid, band, envelope, spectrum = chosen.kurtogram, chosen.band, chosen.envelope, chosen.spectrum
    # If the speed changes, a modulation's lines are sharp over orders only.
    if _over_orders(prepared, over):
        spectrum = _envelope_orders(prepared, chosen, usual)
    # All bands as a table, with the limit of the kurtosis of noise, without which a large number means little.
    bands = {
        "from (Hz)": grid.low_hz,
        "to (Hz)": grid.high_hz,
        "level": grid.level,
        "kurtosis": grid.kurtosis,
        "standard error": grid.standard_error,
        "noise's limit": grid.noise_limit,
    }
    prepared_text = {"none": "as recorded", "tones removed": "with steady tones removed"}.get(preparation, preparation)
    whose = "The kurtogram's" if band_hz is None else "Your"
    warnings = list(chosen.warnings)
    angle = angle_or_none(prepared)
    if angle is not None and not angle.is_steady():
        warnings.append(
            "the speed changes: mesh harmonics that pass resonances raise the kurtosis, too, without any impact. Trust "
            "a modulation of the envelope over order, or choose a part of constant speed"
        )
    # The envelope itself, at its lower sampling rate, for other methods.
    signal = replace(signal_of(prepared, channel), values=envelope.values, rate=envelope.sampling_rate_hz)
    columns = {envelope.source: envelope.values}
    return MethodAnswer(
        channel,
        "kurtogram: spectral kurtosis of bands; the most impulsive one that is wide enough is outlined",
        lambda: plot.kurtogram_figure(grid, band),
        bands,
        tables={"envelope spectrum": columns_of(spectrum)},
        numbers={"band_hz": [band.low_hz, band.high_hz], "kurtosis": band.kurtosis, "reason": chosen.reason},
        panels=(
            _kurtosis_panel(grid, band, recording.sampling_rate_hz),
            _panel(spectrum, modulations_of(prepared, spectrum), linear=True),
        ),
        facts=(
            (
                f"{whose} band: **{band.low_hz:.5g} to {band.high_hz:.5g} "
                f"Hz**, spectral kurtosis **{band.kurtosis:.3g}** of the signal {prepared_text} (of noise alone: 0 ± "
                f"{band.standard_error:.2g})"
            ),
            *([chosen.reason] if chosen.reason else []),
        ),
        warnings=warnings,
        waveforms=waveforms_of(
            prepared, channel, replace(signal, unit=envelope.unit, source=envelope.source), columns, envelope.source
        ),
    )


N_MAP_LINES = 144
"""Number of lines of a kurtogram's map, from its widest to its narrowest bands."""


def _kurtosis_panel(grid: spectra.Kurtogram, band: spectra.BandCandidate, rate_hz: float) -> LevelPanel:
    """Return the panel of spectral kurtosis: a row per bandwidth, the widest on top, and the chosen band outlined."""
    levels = -np.unique(grid.level)[::-1]  # ascending in bandwidth
    n = 3 * 2 ** int(np.ceil(-levels.min()))
    at = (np.arange(n) + 0.5) * rate_hz / 2.0 / n
    rows = np.zeros((len(levels), n))
    for low, high, level, value in zip(grid.low_hz, grid.high_hz, grid.level, grid.kurtosis, strict=True):
        rows[np.searchsorted(levels, -level), (at >= low) & (at < high)] = value
    # Levels are unequally spaced: the row of each reaches halfway to its neighbours, over many lines of the map.
    halves = np.diff(levels) / 2.0 if len(levels) > 1 else np.array([0.5])
    edges = np.concatenate([levels[:1] - halves[:1], levels[:-1] + np.diff(levels) / 2.0, levels[-1:] + halves[-1:]])
    middles = edges[0] + (np.arange(N_MAP_LINES) + 0.5) * (edges[-1] - edges[0]) / N_MAP_LINES
    values = rows[np.searchsorted(edges, middles) - 1]
    edges_hz = rate_hz / 2.0 * 2.0**edges
    positions = np.geomspace(edges_hz[0], edges_hz[-1], N_MAP_LINES)
    chosen = int(np.argmin(np.abs(levels + band.level)))
    below, above = edges_hz[chosen : chosen + 2]
    ends = np.clip([band.low_hz, band.high_hz], at[0], at[-1])
    outline = (
        ChartLine(np.repeat(ends, 2), np.array([below, above, above, below]), "the band chosen", 1),
        ChartLine(ends, np.array([below, below]), "the band chosen", 1),
    )
    return LevelPanel(
        values, at, positions, "frequency (Hz)", "bandwidth (Hz)", "spectral kurtosis", logarithmic=True,
        lines=outline, span=max(float(values.max()), 1e-3),  # colours begin at 0: below, nothing is impulsive
    )  # fmt: skip


def _envelope_orders(prepared: PreparedRecording, chosen: spectra.ChosenBand, highest_hz: float) -> Spectrum:
    """Return the spectrum of an envelope over orders, up to the highest modulation at the mean speed."""
    envelope, angle = chosen.envelope, prepared.shaft_angle
    values = envelope.values - envelope.values.mean()
    alone = Recording(values[None, :], envelope.sampling_rate_hz, (Channel(envelope.source, "unknown", envelope.unit),))
    # A narrow band's envelope has a low sampling rate, and resampling needs some room below half of it.
    highest_hz = min(highest_hz, 0.4 * envelope.sampling_rate_hz)
    highest = 60.0 * highest_hz / max(angle.mean_speed_rpm, 1e-9)
    signal = resample_to_angle(alone, angle, channels=[envelope.source], highest_order=highest)
    return order_spectrum(signal, envelope.source)


MAX_CELLS = 1 << 22
"""Maximum number of cells of a coherence: 100 MB."""


def _coherence(
    prepared: PreparedRecording,
    channel: str,
    over: str,
    preparation: Any,
    highest: float | None,
    n_bands: int,
    band_hz: tuple[float, float] | None,
    odds: int,
) -> MethodAnswer:
    # The size of the result follows from the highest modulation frequency: refuse before computing.
    recording = prepared.recording
    over_orders = _over_orders(prepared, over)
    usual_hz = _usual_modulation_hz(prepared)
    top = highest or (60.0 * usual_hz / max(prepared.shaft_angle.mean_speed_rpm, 1e-9) if over_orders else usual_hz)
    n = top * (prepared.shaft_angle.n_revolutions if over_orders else recording.duration_s) * n_bands
    if n > MAX_CELLS:
        raise InputError(
            f"highest is {top:g} at {n_bands} bands: {n:.3g} cells",
            allowed=f"at most {MAX_CELLS} cells",
            remedy="lower the highest modulation frequency, take fewer bands or a shorter part",
        )

    def compute() -> spectra.SpectralCoherence:
        if over_orders:
            return spectra.order_coherence(recording, channel, prepared.shaft_angle, highest_order=top, n_bands=n_bands)
        return spectra.spectral_coherence(
            recording, channel, highest_alpha_hz=top, n_bands=n_bands, preparation=preparation
        )

    coherence = prepared.keep(("methods", "coherence", channel, over_orders, preparation, top, n_bands), compute)
    # Only lines above the level of noise are marked on the map; its colours begin at the level of one cell in 1000.
    mean = spectra.enhanced_envelope(coherence, band_hz, probability=1.0 / odds)
    spectrum = mean.spectrum
    cursors = modulations_of(prepared, spectrum)
    peaks = _above_noise(mean, cursors)
    where = list(peaks)
    level = ChartLine(spectrum.positions[[0, -1]], np.full(2, mean.level), "noise", -1, dotted=True)
    enhanced = _panel(spectrum, where, linear=True, name="mean squared coherence")
    lines = (*(replace(line, name="mean over the carriers") for line in enhanced.lines), level)
    enhanced = replace(enhanced, lines=lines)
    floor = coherence.level(1e-3)
    decibels = 10.0 * np.log10(np.maximum(coherence.coherence_squared.T, floor))
    levels = LevelPanel(
        decibels, coherence.alpha, coherence.frequency_hz, coherence.alpha_label, "carrier (Hz)", "dB of γ²",
        cursors=where, span=max(float(decibels.max() - 10.0 * np.log10(floor)), 3.0),
    )  # fmt: skip
    return MethodAnswer(
        channel,
        "spectral coherence: which carriers are modulated at which frequency",
        lambda: plot.coherence_figure(coherence, mean, cursors=where),
        columns_of(spectrum),
        matrices={"squared coherence": coherence.coherence_squared},
        axes={coherence.alpha_label: coherence.alpha, "carrier (Hz)": coherence.frequency_hz},
        numbers={"noise_level": mean.level, "probability": mean.probability, "band_hz": list(mean.band_hz)},
        panels=(enhanced, levels),
        facts=(
            (
                f"Mean squared coherence over the carriers from {mean.band_hz[0]:.5g} to {mean.band_hz[1]:.5g} Hz. "
                f"Stationary noise exceeds **{mean.level:.3g}** in 1 line of {odds}."
            ),
        ),
        notes=_cursor_texts(peaks, cursors, spectrum.resolution),
    )


def _above_noise(mean: spectra.EnhancedEnvelope, cursors: Sequence[Cursor]) -> dict[Cursor, float]:
    """Return the lines of shafts and bearings above the level of noise, with the position of their peaks."""
    spectrum, peaks = mean.spectrum, dict[Cursor, float]()
    first, end = float(spectrum.positions[0]), float(spectrum.positions[-1])
    for cursor in cursors:
        if first <= cursor.position <= end:
            slip = SLIP_SHARE * cursor.position if cursor.kind == "bearing" else 0.0
            at, height = spectrum.largest_near(cursor.position, slip + spectrum.resolution)
            if height > mean.level:
                peaks[cursor] = at
    return peaks


def _cursor_texts(peaks: dict[Cursor, float], cursors: Sequence[Cursor], resolution: float) -> tuple[str, ...]:
    if not peaks:
        return ("No line of a shaft or bearing is above the level of noise.",)
    # A bearing line whose peak is at a multiple of a shaft's speed may be a mesh or its sidebands.
    speeds = [cursor.position / cursor.number for cursor in cursors if cursor.kind == "shaft"]

    def on_multiple(cursor: Cursor) -> bool:
        distances = (abs(peaks[cursor] - max(1, round(peaks[cursor] / f)) * f) for f in speeds)
        return cursor.kind == "bearing" and any(distance <= resolution for distance in distances)

    def names(chosen: Sequence[Cursor]) -> str:
        return ", ".join(dict.fromkeys(f"{cursor.label} ({cursor.position:.5g})" for cursor in chosen))

    apart = [cursor for cursor in peaks if on_multiple(cursor)]
    remaining = [cursor for cursor in peaks if cursor not in apart]
    text = ["A line above noise shows that there is modulation, not that there is damage: healthy gears modulate, too."]
    if remaining:
        text.append(f"Lines above the level of noise, those of bearings within 1 % for slip: {names(remaining)}.")
    if apart:
        text.append(
            "Bearing lines whose peak is at a multiple of a shaft's speed, which meshes and shafts also cause: "
            f"{names(apart)}."
        )
    return tuple(text)


def _deconvolution(
    prepared: PreparedRecording, channel: str, by: str, taps: int, rate_hz: float | None
) -> MethodAnswer:
    recording = prepared.recording
    x, fs = recording.values(channel), recording.sampling_rate_hz
    warnings, modulation = list[str](), ""
    notes: tuple[str, ...] = (
        "It makes any noise impulsive: other rates must give less likeness. Levels are not kept.",
    )
    if by == "multipoint":
        if rate_hz is None:
            analysis = prepared.keep(("methods", "analysis"), lambda: analyze(prepared))
            suggested_hz = suggested_rate_hz(analysis)
            rate_hz, modulation = suggested_hz or ASSUMED_RATE_HZ, "as found in the recording" if suggested_hz else ""
        if not rate_hz:
            raise RefusalError("no impact rate is given", remedy="give the impacts per second, above 0 Hz")
        modulation = modulation_at(prepared, rate_hz) or modulation
        if not modulation and rate_hz == ASSUMED_RATE_HZ:
            warnings.append(
                f"{rate_hz:g} impacts per second are assumed: nothing is suspected, and no bearing or shaft is "
                "described whose rate could be used. Give the rate of interest"
            )
        angle = angle_or_none(prepared)
        if angle is not None and not angle.is_steady():
            warnings.append("the speed changes, and the rate of impacts with it: choose a part of constant speed")
        result = spectra.multipoint_deconvolution(x, fs, 1.0 / rate_hz, n_taps=taps)
        facts: tuple[str, ...] = (_train_fact(f"{rate_hz:.5g} Hz", result.score, taps, len(x)),)
        if modulation:  # a shaft's name has no place in a fact
            notes = (f"{rate_hz:.5g} Hz: {modulation}.", *notes)
    else:
        result = spectra.minimum_entropy_deconvolution(x, fs, n_taps=taps)
        facts = (
            f"Sharpened, the kurtosis is **{result.score:.3g}**, of the signal {kurtosis(x):.3g} (Gaussian noise: 3).",
        )
    y = result.values * float(np.std(x) / np.std(result.values))
    columns = {"signal": x, "sharpened": np.concatenate([np.zeros(len(x) - len(y)), y])}
    first_s = N_IMPACTS_SHOWN / rate_hz if rate_hz and by == "multipoint" else None
    waveforms = waveforms_of(
        prepared, channel, signal_of(prepared, channel), columns, result.source, first_length=first_s
    )
    time_s = waveforms.at()
    panel = LinePanel(
        [ChartLine(time_s, columns[name], name, k) for k, name in enumerate(columns)],
        "time (s)",
        with_unit(channel, unit_of(prepared, channel)),
    )
    return MethodAnswer(
        channel,
        "impacts sharpened by a filter that inverts their path",
        lambda: plot.panels_figure([panel], title=f"{channel}: impacts sharpened"),
        waveforms.table(),
        numbers={"score": result.score},
        facts=facts,
        notes=notes,
        warnings=warnings,
        waveforms=waveforms,
    )


def _train_fact(train: str, score: float, taps: int, n_samples: int) -> str:
    """Say whether a signal contains a train of impacts more clearly than white noise.

    For white noise, the square of the norm is the share of a random direction in a subspace of `taps` of `n_samples`
    dimensions: a beta distribution with mean taps/n and relative deviation √(2/taps). Three deviations are more than
    chance.
    """
    chance = np.sqrt(taps / n_samples)
    if score <= chance * np.sqrt(1.0 + 3.0 * np.sqrt(2.0 / taps)):
        how = f"is **no clearer than in white noise**: likeness {score:.3g} of 1, white noise {chance:.2g}"
    else:
        how = f"is **{score / chance:.2g} times as clear as in white noise**: likeness {score:.3g} of 1"
    return f"A train of impacts at {train} {how}."


N_IMPACTS_SHOWN = 5
ASSUMED_RATE_HZ = 100.0
"""Impact rate if nothing suggests one."""


def suggested_rate_hz(analysis: Analysis) -> float | None:
    """Return the impact rate in Hz suggested by the findings, else by the machine's description; None without either.

    The first of: impacts named by a finding; turns of the shaft of a damaged tooth; elements passing the outer race of
    the first bearing, the race most often damaged; turns of the reference shaft.
    """
    # changes since a reference are at a part's kinematic rate, from which a bearing deviates by slip
    for finding in sorted(analysis.findings, key=lambda finding: finding.code == CHANGED):
        if finding.where.band_hz is not None and finding.where.frequency_hz:
            return finding.where.frequency_hz
    angle = analysis.shaft_angle
    if not isinstance(angle, ShaftAngle) or angle.mean_speed_rpm <= 0:
        return None
    turns_hz, rig = angle.mean_speed_rpm / 60.0, analysis.rig
    if rig is None or not rig.shafts:
        return turns_hz
    for finding in analysis.findings:
        shaft = finding.where.gear.rpartition("/")[2] or finding.where.shaft
        is_tooth = finding.where.tooth is not None or finding.where.angle_deg is not None
        if finding.is_claim and is_tooth and shaft in rig.shaft_names:
            return turns_hz * (rig.ratio(shaft) or 1.0)
    races = (
        ratio * bearing.orders()["BPFO"]
        for bearing in rig.bearings
        if (ratio := rig.ratio(bearing.shaft)) is not None and "BPFO" in bearing.orders()
    )
    return turns_hz * next(races, 1.0)


def modulation_at(prepared: PreparedRecording, rate_hz: float) -> str:
    """Return the name of the bearing line (within its slip) or shaft at a rate; empty if there is none."""
    angle = angle_or_none(prepared)
    if angle is None or angle.mean_speed_rpm <= 0:
        return ""
    if not prepared.rig.shafts:
        return "the shaft" if abs(60.0 * rate_hz / angle.mean_speed_rpm - 1.0) <= 0.1 * SLIP_SHARE else ""
    order = 60.0 * rate_hz / angle.mean_speed_rpm
    lines = order_lines(prepared.rig, angle.shaft, n_mesh_harmonics=1, n_shaft_harmonics=1, n_sidebands=0)
    slips = {"shaft": 0.1 * SLIP_SHARE, "bearing": 2.0 * SLIP_SHARE}
    near = [line for line in lines if line.kind in slips and abs(order / line.order - 1.0) <= slips[line.kind]]
    best = min(near, key=lambda line: abs(order / line.order - 1.0), default=None)
    return "" if best is None else best.label


# Averages, indicators, waveform, speed.


def _average(prepared: PreparedRecording, channel: str, shaft: str) -> MethodAnswer:
    return _average_answer(prepared, channel, prepared.average(shaft or prepared.shaft_angle.shaft, channel))


def _average_in_blocks(blocks: RecordBlocks, prepared: PreparedRecording, channel: str, shaft: str) -> MethodAnswer:
    return _average_answer(prepared, channel, blocks.average(channel, prepared.angle_of(shaft)))


def _average_answer(prepared: PreparedRecording, channel: str, average: SynchronousAverage) -> MethodAnswer:
    shaft = average.shaft
    teeth = prepared.rig.teeth_on(shaft)
    table = {
        "angle (°)": 360.0 * np.arange(len(average.values)) / len(average.values),
        with_unit("average", average.unit): average.values,
        with_unit("standard error", average.unit): average.standard_error,
    }
    return MethodAnswer(
        channel,
        f"mean revolution of {shaft or 'the shaft'}, {average.n_revolutions} averaged",
        lambda: plot.average_figure([average], n_teeth=teeth),
        table,
        numbers={"n_revolutions": average.n_revolutions},
    )


def _indicators(prepared: PreparedRecording, channel: str) -> MethodAnswer:
    indicators = [i for i in analyze(prepared.recording).indicators if i.channel in ("", channel)]
    table = {
        name: np.array([getattr(i, name) for i in indicators], dtype=None if name == "value" else object)
        for name in ("name", "value", "unit", "computed_on", "shaft", "gear", "bearing", "band", "note")
    }
    values = prepared.recording.values(channel)
    n = max(1, len(values) // 200)
    level = np.sqrt(np.add.reduceat(np.square(values, dtype=np.float64), np.arange(0, len(values), n)) / n)[:-1]
    time_s = (np.arange(len(level)) + 0.5) * n / prepared.recording.sampling_rate_hz
    caption = f"{len(indicators)} condition indicators; drawn: rms over time"
    panel = plot.curve_panel(time_s, {"rms": level}, "time (s)", with_unit("rms", unit_of(prepared, channel)))
    return MethodAnswer(channel, caption, lambda: plot.panels_figure([panel], title=f"{channel}: {caption}"), table)


def _waveform(prepared: PreparedRecording, channel: str) -> MethodAnswer:
    recording = prepared.recording
    time_s = np.arange(recording.n_samples) / recording.sampling_rate_hz
    table = {"time (s)": time_s, with_unit(channel, unit_of(prepared, channel)): recording.values(channel)}
    return MethodAnswer(channel, "signal over time", lambda: plot.time_figure(recording, [channel]), table)


def _speed(prepared: PreparedRecording, channel: str) -> MethodAnswer:
    angle = prepared.shaft_angle
    table = {"time (s)": angle.time_s, "speed (rpm)": 60.0 * angle.speed_rev_per_s}
    numbers = {"mean_speed_rpm": angle.mean_speed_rpm}
    caption = f"speed of {angle.shaft or 'the reference shaft'}"
    return MethodAnswer(channel, caption, lambda: plot.speed_figure(angle), table, numbers=numbers)


WHOLE = {
    "waveform": Method("Waveform", "The signal over time.", _waveform),
    "speed": Method("Speed", "The speed on which everything over angle is based.", _speed),
    "spectrum": Method("Spectrum", "Tones and their amplitudes.", _spectrum, IN_HZ),
    "density": Method(
        "Density", "Noise over frequency.", _density, IN_HZ, "Spectrum", 1_000_000, 20_000_000,
        in_blocks=_density_in_blocks,
    ),
    "cepstrum": Method(
        "Cepstrum",
        "Families of equally spaced lines, as one peak each.",
        _cepstrum,
        tuple(
            replace(line, label=f"{name} quefrency (s)", empty="automatic", unit="s")
            for line, name in zip(LINES, ("Lowest", "Highest"), strict=True)
        ),
        "Spectrum",
        1_000_000,
        20_000_000,
    ),
    "order-spectrum": Method("Order spectrum", "Lines that turn with a shaft.", _order_spectrum, (*LINES, SHAFT)),
    "average": Method(
        "Synchronous average", "The mean revolution of a shaft.", _average, (SHAFT,), in_blocks=_average_in_blocks,
    ),
    "indicators": Method("Indicators", "All condition indicators of the channel.", _indicators),
}  # fmt: skip
MODULATIONS = {
    "envelope": Method(
        "Envelope spectrum", "How often impacts repeat in a band.", _envelope, (BAND, *LINES),
        in_blocks=_envelope_in_blocks,
    ),
    "kurtogram": Method(
        "Kurtogram",
        "Finds the band that contains impacts, and their rate by the spectrum of its envelope.",
        _kurtogram,
        (
            PREPARATION,
            BAND,
            HIGHEST_MODULATION,
            MethodOption(
                "levels", "Levels", "count", None,
                "The spectrum is divided into up to 2 to the power of it bands, and into thirds of these.", "up to 7",
                more=True,
            ),
            _MODULATION_OVER,
        ),
        "Envelope",
        1_000_000,
        10_000_000,
    ),
    "coherence": Method(
        "Cyclic coherence",
        "Finds modulations in noise and their band, even if no band stands out: for bearings and wear.",
        _coherence,
        (
            _MODULATION_OVER,
            replace(
                PREPARATION,
                default="tones removed",
                about="Steady tones are coherent with each other: remove them, or mesh harmonics fill the picture.",
            ),
            MethodOption(
                "highest", "Highest modulation frequency (Hz or order)", "number", None,
                "The highest modulation frequency of interest. Carriers below half of it are left out.",
                "three harmonics of the fastest bearing line",
            ),
            MethodOption(
                "n_bands", "Carrier bands", "count", 64,
                "Fewer bands average more and find weaker modulation; more bands locate its carrier better.",
                choices=verbatim(8, 16, 32, 64, 128, 256),
            ),
            replace(BAND, label="Carriers averaged (Hz)", about="", empty="all"),
            MethodOption(
                "odds", "Noise exceeds the level in 1 line of", "count", 100,
                "How often noise alone exceeds the dashed line.",
                choices=verbatim(20, 100, 1000, 10_000), minimum=2, more=True,
            ),
        ),
        "Envelope",
        262_144,
        4_000_000,
    ),
    "deconvolution": Method(
        "Deconvolution",
        "Inverts the path between impacts and sensor, so that each impact is sharp again: for bearings that ring long. "
        "If there is such a train, the sharpened signal shows needles one period apart.",
        _deconvolution,
        (
            MethodOption(
                "by", "Filter", "choice", "multipoint",
                ("Multipoint: closest to a train of impacts of known rate. Minimum entropy: most impulsive, whatever "
                "the rate."),
                choices={"multipoint": "Multipoint", "minimum-entropy": "Minimum entropy"},
            ),
            MethodOption(
                "taps", "Filter length (samples)", "count", 100, "As long as an impact rings.", maximum=500,
                minimum=10,
            ),
            MethodOption(
                "rate_hz", "Impacts per second (Hz)", "number", None,
                "Rate of the impacts, e.g. of elements passing a race.",
                "as found, else as the machine's description says", unit="Hz", minimum=0.0,
                suggested=suggested_rate_hz,
            ),
        ),
        "Envelope",
        100_000,
    ),
}  # fmt: skip
