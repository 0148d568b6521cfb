"""Methods that decompose a channel: variational modes, with the transform of one of them, and wavelet denoising."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from gearsig import plot
from gearsig.checks import FloatArray
from gearsig.decompose import DenoiseSettings, Modes, VmdEngine, VmdSettings, denoise, mode_spectra, suggest_modes, vmd
from gearsig.errors import InputError
from gearsig.formatting import axis_unit, position_text, readable, unit_text
from gearsig.indicators import kurtosis
from gearsig.methods._table import (
    LINES,
    OVER_ANGLE,
    SHAFT,
    Method,
    MethodAnswer,
    MethodOption,
    signal_of,
    top_hz,
    unit_of,
    verbatim,
    waveforms_of,
)
from gearsig.methods._timefreq import NAMES, levels_answer, levels_of
from gearsig.plot import ChartLine, Cursor, LinePanel, above_zero, series_colours, with_unit
from gearsig.prepared import PreparedRecording
from gearsig.spectra import band_envelope
from gearsig.timefreq import UniformSignal

PENALTIES = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 200_000)
"""A logarithmic scale that contains all suggested values."""


def _modes(
    prepared: PreparedRecording,
    channel: str,
    n_modes: int | None,
    penalty: float | None,
    mode: int | None,
    then: str,
    envelope_hz: tuple[float, float] | None,
    over_angle: bool,
    shaft: str,
    lowest: float | None,
    highest: float | None,
    start: Any,
    zero_mode: bool,
    iterations: int,
    dual_step: float,
    engine: Any,
) -> MethodAnswer:
    signal, offset = _decomposed(prepared, channel, envelope_hz, over_angle=over_angle, shaft=shaft)
    # The number of modes and the penalty: given, or found by trials on the signal, which are returned as a table.
    reasons: tuple[str, ...] = ()
    settings, trials = VmdSettings(n_modes or 4, penalty or 2000.0), dict[str, Any]()
    place = ("methods", "modes", channel, envelope_hz, over_angle, shaft)
    if n_modes is None:
        suggested = prepared.keep((*place, "suggested"), lambda: suggest_modes(signal))
        settings, reasons = suggested.settings, suggested.reasons
        settings = settings if penalty is None else replace(settings, penalty=penalty)
        trials = {"tried": _trials(suggested.trials)}
    settings = replace(
        settings,
        start=settings.start if start == "automatic" else start,
        zero_mode=zero_mode,
        max_iterations=499 if engine == "vmdpy" else iterations,  # vmdpy's fixed number
        dual_step=dual_step,
        engine=engine,
    )
    modes = prepared.keep((*place, settings), lambda: by_centre(vmd(signal, None, settings)))
    modes = replace(modes, offset=offset)
    # The mode of interest is the one with the most impulsive waveform: damage causes impacts, meshing hums.
    impulses = [kurtosis(waveform) for waveform in modes.waveforms]
    chosen = int(np.argmax(impulses)) if mode is None else mode - 1
    if not 0 <= chosen < modes.n_modes:
        raise InputError(f"mode is {mode}", allowed=f"1 to {modes.n_modes}, by ascending centre")
    numbers = {
        "centres": list(modes.centres),
        "bandwidths": list(modes.bandwidths),
        "kurtosis": impulses,
        "chosen_mode": chosen + 1,
        "penalty": modes.settings.penalty,
        "reasons": list(reasons),
        "warnings": list(modes.notes),
    }
    names = [f"mode {k}, {position_text(modes.axis, f, 5)}" for k, f in enumerate(modes.centres, start=1)]
    columns = dict(zip(names, modes.waveforms, strict=True)) | {"residual": modes.residual}
    step = f"{modes.n_modes} variational modes, penalty {settings.penalty:g}, of {modes.source} less {offset:g}"
    waveforms = waveforms_of(
        prepared, channel, signal, {"signal": signal.values, **columns}, step,
        residual="residual", shown_first=names[chosen],
    )  # fmt: skip
    unit = axis_unit(modes.axis)
    about = {
        "mode": np.arange(1, modes.n_modes + 1),
        f"centre ({unit})": modes.centres,
        f"bandwidth ({unit})": modes.bandwidths,
        with_unit("rms", modes.unit): modes.rms,
        "kurtosis": np.array(impulses),
    }
    table = {
        ("time (s)" if modes.axis == "frequency" else "angle (revolutions)"): signal.start + modes.positions,
        **{with_unit(name, modes.unit): values for name, values in columns.items()},
    }
    end = "Converged" if modes.converged else "Stopped"
    answer = MethodAnswer(
        channel,
        f"{modes.n_modes} variational modes and the residual",
        lambda: plot.modes_figure(modes),
        table,
        tables={"modes": about, **trials},
        numbers=numbers,
        panels=(_spectra_panel(modes, names),),
        facts=(
            (
                f"**{modes.n_modes} modes** at penalty **{settings.penalty:g}**, started from **{settings.start}**. "
                f"Mode **{chosen + 1}** is {'the most impulsive' if mode is None else 'chosen'}: kurtosis "
                f"{impulses[chosen]:.3g}, centre {position_text(modes.axis, modes.centres[chosen], 5)}."
            ),
        ),
        notes=(*reasons, f"{end} after {modes.n_iterations} iterations. Vertical lines: the modes' centres."),
        warnings=modes.notes,
        waveforms=waveforms,
    )
    if not then:
        return answer
    # The chosen mode alone, transformed two octaves on each side of its centre; the modes' panels stay below it.
    centre, top = float(modes.centres[chosen]), 0.45 * modes.sampling_rate
    low = centre / 4.0 if lowest is None else lowest
    levels = levels_of(
        modes.signal(chosen, start=signal.start), then, lowest=low,
        highest=min(4.0 * centre, top) if highest is None else highest,
    )  # fmt: skip
    on = levels_answer(channel, levels, numbers)
    return replace(
        on,
        caption=f"mode {chosen + 1} of {modes.n_modes}, centre {position_text(modes.axis, centre, 5)}: {on.caption}",
        tables=answer.tables,
        panels=(*on.panels, *answer.panels),
        facts=answer.facts,
        notes=(*on.notes, *answer.notes),
        warnings=answer.warnings,
        waveforms=waveforms,
    )


def _decomposed(
    prepared: PreparedRecording, channel: str, envelope_hz: tuple[float, float] | None, *, over_angle: bool, shaft: str
) -> tuple[UniformSignal, float]:
    """Return the signal to decompose, and the constant that was subtracted from it."""
    if envelope_hz is None:
        return signal_of(prepared, channel, over_angle=over_angle, shaft=shaft), 0.0
    if over_angle:
        raise InputError("an envelope over the shaft's angle was requested", allowed="one of the two")
    recording = prepared.recording
    unit = unit_of(prepared, channel)
    envelope = band_envelope(
        recording.values(channel), recording.sampling_rate_hz, envelope_hz, kind="magnitude", unit=unit, source=channel
    )
    # its mean would be a separate mode that outweighs the others
    mean = float(envelope.values.mean())
    rate = envelope.sampling_rate_hz
    return UniformSignal(envelope.values - mean, rate, unit=envelope.unit, source=envelope.source), mean


def by_centre(modes: Modes) -> Modes:
    """Return the modes by ascending centre, so that the first one shown is number 1."""
    order = list(modes.by_centre())
    return replace(
        modes,
        waveforms=modes.waveforms[order],
        centres=modes.centres[order],
        bandwidths=modes.bandwidths[order],
        centre_history=modes.centre_history[:, order],
    )


def _spectra_panel(modes: Modes, names: list[str]) -> LinePanel:
    """Return the panel of all modes' spectra, on one logarithmic axis for comparison."""
    spectra = mode_spectra(modes)
    colours: tuple[int | str, ...] = (*series_colours(modes.n_modes), -1)
    lines = [
        ChartLine(s.positions, above_zero(s.values), name, colour, peaks=True)
        for name, s, colour in zip((*names, "residual"), spectra, colours, strict=True)
    ]
    highest = max(float(line.y[1:].max()) for line in lines)
    cursors = [Cursor(float(c), "mode", str(k), k) for k, c in enumerate(modes.centres, start=1)]
    label = with_unit("amplitude peak", modes.unit)
    # the residual is drawn behind the modes
    return LinePanel(
        [lines[-1], *lines[:-1]], spectra[0].axis_label, label, (1e-3 * highest, 3.0 * highest), True, cursors
    )


def _trials(trials: Any) -> dict[str, Any]:
    columns: dict[str, list[Any]] = {
        "penalty": [int(trial.penalty) for trial in trials],
        "modes": [trial.n_modes for trial in trials],
        "start": [str(trial.settings.start) for trial in trials],
        "residual (% of rms)": [100.0 * trial.reconstruction_error for trial in trials],
        "separation": [trial.separation if trial.n_modes > 1 else np.nan for trial in trials],
        "widest": [trial.widest for trial in trials],
        "weakest (% of energy)": [100.0 * trial.smallest_share for trial in trials],
        "objection": [trial.objection or "none" for trial in trials],
    }
    texts = ("start", "objection")
    return {name: np.array(values, dtype=object if name in texts else None) for name, values in columns.items()}


# Denoising.


MOST_NOISE = 0.5
"""Maximum share of a signal's energy removed as noise without a warning."""


def _denoising(
    prepared: PreparedRecording,
    channel: str,
    threshold: Any,
    rule: Any,
    noise: Any,
    wavelet: str,
    shifts: int,
    levels: int | None,
) -> MethodAnswer:
    recording = prepared.recording
    settings = DenoiseSettings(threshold, rule, wavelet=wavelet, n_levels=levels, noise=noise, n_shifts=shifts)
    denoised = denoise(recording, channel, settings)
    columns: dict[str, FloatArray] = {
        "signal": recording.values(channel),
        "without noise": denoised.values,
        "removed": denoised.removed,
    }
    step = f"{threshold} {rule} thresholds, {wavelet}"
    waveforms = waveforms_of(prepared, channel, signal_of(prepared, channel), columns, step, residual="removed")
    at, unit = waveforms.at(), unit_of(prepared, channel)
    lines = [ChartLine(at, columns[name], name, k - 1) for k, name in enumerate(("signal", "without noise"))]
    panels = (
        LinePanel(lines, "time (s)", with_unit(channel, unit)),
        LinePanel([ChartLine(at, denoised.removed, "removed", 1)], "time (s)", with_unit("removed", unit)),
    )
    table = {
        "level": np.array([level.level for level in denoised.levels]),
        "from (Hz)": np.array([level.band_hz[0] for level in denoised.levels]),
        "to (Hz)": np.array([level.band_hz[1] for level in denoised.levels]),
        with_unit("noise", unit): np.array([level.noise for level in denoised.levels]),
        with_unit("threshold", unit): np.array([level.threshold for level in denoised.levels]),
        "kept (%)": np.array([100.0 * level.kept_share for level in denoised.levels]),
    }
    warnings = list[str]()
    if denoised.removed_share > MOST_NOISE:
        warnings.append(
            f"{100.0 * denoised.removed_share:.3g} % of the energy was removed as noise: lines or impacts may fill the "
            "levels on which the noise is estimated. Choose white noise of the quietest level; for steady lines, a "
            "spectrum or a synchronous average"
        )
    return MethodAnswer(
        channel,
        "signal without its noise, by wavelet thresholds",
        lambda: plot.panels_figure(panels, title=f"{channel}: {step}"),
        waveforms.table(),
        tables={"levels": table},
        numbers={"removed_share": denoised.removed_share, "noise_rms": denoised.noise_rms},
        facts=(
            (
                f"Removed: **{100.0 * denoised.removed_share:.3g} %** of the energy. Estimated noise: "
                f"**{readable(denoised.noise_rms)} {unit_text(unit)}** rms."
            ),
        ),
        notes=(
            (
                "Look at what was removed: a modulation in it is signal that should have been kept. Steady tones are "
                "better extracted by a spectrum or a synchronous average."
            ),
        ),
        warnings=warnings,
        waveforms=waveforms,
    )


def _bytes_per_sample_of_modes(options: Mapping[str, Any]) -> float:
    n_modes = options["n_modes"] or 8
    # vmdpy keeps the spectra of all modes of all iterations, for the signal mirrored at both ends.
    return 400.0 + 50.0 * n_modes if options["engine"] == "gearsig" else 32.0 * n_modes * options["iterations"]


def _samples_of_modes(options: Mapping[str, Any]) -> int:
    return 2**13 if options["engine"] == "vmdpy" else 2**21  # vmdpy keeps all iterations, 16 kB per sample and mode


PARTS = {
    "modes": Method(
        "Modes",
        "Decomposes the signal into a few narrow-band modes whose frequencies need not be known (VMD), and transforms "
        "one of them: useful for noisy recordings of cracks.",
        _modes,
        (
            MethodOption(
                "n_modes", "Modes K", "count", None, "", "as the signal suggests", verbatim(*range(1, 11)), maximum=40,
            ),
            MethodOption(
                "penalty", "Penalty α", "number", None,
                "Weight of the modes' bandwidth: large for narrow modes. 2000 is usual.", "as the signal suggests",
                verbatim(*PENALTIES), minimum=1e-9,
            ),
            MethodOption(
                "mode", "Chosen mode", "count", None, "From 1 by ascending centre.", "the most impulsive one",
                verbatim(*range(1, 11)),
            ),
            MethodOption(
                "then", "The chosen mode goes on to", "choice", "",
                "Squeezed wavelet: the instantaneous frequency of the mode, useful for noisy records of cracks.",
                choices={"": "nothing", **NAMES},
            ),
            MethodOption(
                "envelope_hz", "Envelope of the band (Hz)", "span", None,
                "The envelope of a band shows what modulates it.", "the signal itself", unit="Hz", known=top_hz,
            ),
            OVER_ANGLE,
            *(replace(line, more=True) for line in LINES),
            MethodOption(
                "start", "Start", "choice", "automatic",
                "First centre frequencies: evenly spread, at the peaks of the spectrum, or all at zero.",
                choices=verbatim("automatic", "uniform", "peaks", "zero"), more=True,
            ),
            MethodOption(
                "zero_mode", "Mode at zero", "switch", False,
                "Keep the first mode's centre at zero, so that it contains mean and drift.", more=True,
            ),
            MethodOption("iterations", "Iterations", "count", 499, "", "", verbatim(499, 1000, 2000, 5000), more=True),
            MethodOption(
                "dual_step", "Dual step τ", "number", 0.0,
                "Above 0 the modes must sum to the signal, noise included; 0 leaves noise in the residual.",
                minimum=0.0, more=True,
            ),
            MethodOption(
                "engine", "Engine", "choice", "gearsig",
                "vmdpy: the reference program, for comparison; slow, and short parts only.",
                choices=verbatim(*get_args(VmdEngine)), more=True,
            ),
            SHAFT,
        ),
        "Modes",
        2**16,
        2**21,
        _samples_of_modes,
        _bytes_per_sample_of_modes,
    ),
    "denoising": Method(
        "Denoising",
        "Removes noise by thresholds on wavelet coefficients, and shows what was removed.",
        _denoising,
        (
            MethodOption(
                "threshold", "Threshold", "choice", "universal",
                "universal: next to no noise remains; sure: minimum estimated risk of each level; bayes: keeps most",
                choices={"universal": "Universal", "sure": "SURE", "bayes": "Bayes"},
            ),
            MethodOption(
                "rule", "Rule", "choice", "soft",
                "What is above the threshold is shrunk by it (soft), kept as it is (hard), or in between (garrote).",
                choices=verbatim("soft", "hard", "garrote"),
            ),
            MethodOption(
                "noise", "Noise", "choice", "quietest level",
                "White: one noise estimate for all levels, from the quietest or the finest. Coloured: one for each.",
                choices={"quietest level": "White", "finest level": "White, finest level", "each level": "Coloured"},
            ),
            MethodOption(
                "wavelet", "Wavelet", "choice", "sym8", choices=verbatim("sym8", "sym4", "db4", "db8", "coif3", "haar"),
            ),
            MethodOption(
                "shifts", "Shifts", "count", 8,
                "Cycle spinning: the mean over shifts of the signal against the wavelet's grid. 1 is none.",
                choices=verbatim(1, 2, 4, 8, 16), maximum=64,
            ),
            MethodOption(
                "levels", "Levels", "count", None,
                "How often the signal is halved in frequency; anything below the coarsest level is kept unchanged.",
                "automatic", verbatim(*range(1, 15)),
            ),
        ),
        "Modes",
        n_max=4_000_000,
    ),
}  # fmt: skip
