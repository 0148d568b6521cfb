"""Curves of a gap for its figures: order spectra and energy over the angle, measured, simulated before and after."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap._change import turned_difference
from gearsig.gap._features import MAX_SHAFT_ORDERS, SIDEBANDS, STEPS_PER_TOOTH, floor_ratio
from gearsig.gap._floors import StructuralFloor
from gearsig.gap._places import changed_pattern, pattern_of_recording
from gearsig.gap._reduction import DRIVEN, DRIVER, N_MESH_HARMONICS, ReducedRecording, shaft_text
from gearsig.gap._report import AngleCurves, AverageCurves, SpectrumCurves
from gearsig.prepared import circular_correlation
from gearsig.rig import SIDES
from gearsig.severity import load_calibration

BEYOND = 0.5
"""Fraction of a mesh order beyond the last harmonic shown."""

_RARE = 3.0
"""Threshold relative to the noise power: one line of noise in twenty is stronger (exp(−3) = 0.05)."""

CLOSER_THAN_A_SHAFTS = 0.1
"""Spacing of a residual's lines in orders of the driver; slower driven shafts are not built in a single stage."""

NOTHING: FloatArray = np.zeros(0)


def spectrum_curves(
    now: ReducedRecording,
    before: ReducedRecording,
    after: ReducedRecording | None = None,
    *,
    structural: StructuralFloor | None = None,
    reference: ReducedRecording | None = None,
    reference_structural: StructuralFloor | None = None,
    unit: str = "m/s^2",
) -> tuple[SpectrumCurves, ...]:
    """Return the order spectra of both shafts' averages and of the residual, RMS over all channels.

    Parameters
    ----------
    now, before : ReducedRecording
        The recording, and its baseline.
    after : ReducedRecording or None
        The simulation with the most probable effect.
    structural : StructuralFloor or None
        Floor of the same comparison; each line gets the floor of the feature that it belongs to.
    reference : ReducedRecording or None
        The healthy recording, with the same channels.
    reference_structural : StructuralFloor or None
        Floor of the comparison with the reference.
    unit : str
        Unit of the channels.
    """
    runs = {"before": before, "after": after, "reference": reference}
    beside = {name: run for name, run in runs.items() if run is not None}
    averages = (_of_average(side, now, beside, unit) for side in (DRIVER, DRIVEN))
    spectra = (*averages, _of_residual(now, beside, unit))
    features = [average_features(side, now.frame.teeth[side], len(spectra[side].orders)) for side in (DRIVER, DRIVEN)]
    features.append(residual_features(now, spectra[2].orders))
    return tuple(
        replace(
            curves,
            structural_db=NOTHING if structural is None else structural.of(belonging),
            reference_structural_db=NOTHING if reference_structural is None else reference_structural.of(belonging),
        )
        for curves, belonging in zip(spectra, features, strict=True)
    )


def average_features(side: int, teeth: int, n: int) -> list[str]:
    """Return for each order of a shaft the feature that it belongs to."""
    name = SIDES[side]
    features = []
    for order in range(n):
        harmonic, offset = round(order / teeth), abs((order + teeth // 2) % teeth - teeth // 2)
        if order <= MAX_SHAFT_ORDERS and 2 * order < teeth:
            features.append(f"shaft.{name}.{max(order, 1)}" if order <= 3 else f"shaft.{name}.low")
        elif offset == 0 and harmonic <= N_MESH_HARMONICS:
            features.append(f"mesh.share.{harmonic}")
        else:
            near = (label for label, (first, last) in SIDEBANDS.items() if first <= offset <= last)
            label = next(near, "")
            features.append(f"sideband.{name}.{label}" if label else f"tooth.{name}.level")
    return features


def residual_features(now: ReducedRecording, orders: FloatArray) -> list[str]:
    """Return for each order of the residual the feature of its band."""
    edges = [low for low, _ in now.bands_hz[:-1]]
    bands = np.searchsorted(edges, orders * now.speed_hz, side="right")
    return [f"floor.band.{max(int(band), 1)}" for band in bands]


def _of_average(side: int, now: ReducedRecording, beside: Mapping[str, ReducedRecording], unit: str) -> SpectrumCurves:
    """Return a shaft's average of a recording, and of the runs drawn beside it, keyed by the name of their curve."""
    power, noise = _average_power(now, side, now.channels)
    levels = {name: _average_power(run, side, now.channels) for name, run in beside.items()}
    last = int((N_MESH_HARMONICS + BEYOND) * now.frame.teeth[side])
    n = min(last + 1, len(power), *(len(level) for level, _ in levels.values()))
    floors = {name: np.sqrt(_RARE * (noise[:n] + level[:n])) for name, (_, level) in levels.items()}
    amplitudes = {name: np.sqrt(level[:n]) for name, (level, _) in levels.items()}
    return SpectrumCurves(
        f"average over {shaft_text(now.frame, side)}",
        unit,
        np.arange(n) * now.frame.shaft_orders[side],
        np.sqrt(power[:n]),
        **{"after": NOTHING, **amplitudes},
        floor=floors["before"],
        reference_floor=floors.get("reference", NOTHING),
    )


def _average_power(reduced: ReducedRecording, side: int, names: Iterable[str]) -> tuple[FloatArray, FloatArray]:
    """Return the lines' power, as squared peaks, and that of their noise: means over channels."""
    averages = [reduced.average(name, side) for name in names]
    n = averages[0].highest + 1
    power: FloatArray = np.mean([np.abs(average.lines[:n]) ** 2 for average in averages], axis=0)
    noise: FloatArray = np.mean([average.noise[:n] for average in averages], axis=0)
    return power, noise


def _of_residual(now: ReducedRecording, beside: Mapping[str, ReducedRecording], unit: str) -> SpectrumCurves:
    power = _residual_power(now, now.channels)
    highest = (run.highest_order for name, run in beside.items() if name != "after")
    top = min((N_MESH_HARMONICS + BEYOND) * now.frame.teeth[DRIVER], now.highest_order, *highest)
    orders = np.arange(min(len(power), int(top / now.order_step) + 1)) * now.order_step
    measured = power[: len(orders)]
    residuals = {name: (run.order_step, _residual_power(run, now.channels)) for name, run in beside.items()}
    # The factor 2 turns mean squares into squared peaks.
    amplitudes = {
        name: np.sqrt(2.0 * np.interp(orders, np.arange(len(values)) * step, values))
        for name, (step, values) in residuals.items()
    }
    floor = np.sqrt(2.0 * _RARE * measured / floor_ratio(measured[None])[0])
    return SpectrumCurves(
        "what neither shaft repeats",
        unit,
        orders,
        np.sqrt(2.0 * measured),
        **{"after": NOTHING, **amplitudes},
        floor=floor,
        reference_floor=floor if "reference" in beside else NOTHING,
    )


def _residual_power(reduced: ReducedRecording, names: Iterable[str]) -> FloatArray:
    power: FloatArray = np.mean([reduced.channels[name].residual_power.mean(axis=0) for name in names], axis=0)
    return power


def against_reference(curves: SpectrumCurves) -> SpectrumCurves:
    """Return the curves with the healthy reference and its floors in place of the simulation."""
    return replace(
        curves,
        before=curves.reference,
        after=NOTHING,
        floor=curves.reference_floor,
        structural_db=curves.reference_structural_db,
    )


def lines_beyond(curves: SpectrumCurves) -> tuple[int, int]:
    """Count the lines whose gap exceeds their structural floor, and those that exceed the repeatability floor."""
    gap = gap_by_order(curves, curves.before)
    return int(np.count_nonzero(is_beyond(curves, gap))), int(np.count_nonzero(np.isfinite(gap)))


def is_beyond(curves: SpectrumCurves, gap: FloatArray) -> NDArray[np.bool_]:
    """Return which lines' gaps, in dB, exceed their structural floor; where that is not known, all lines with a gap."""
    structural = curves.structural_db if len(curves.structural_db) else np.zeros(len(gap))
    beyond: NDArray[np.bool_] = np.abs(np.nan_to_num(gap)) > structural
    return beyond


def gap_by_order(curves: SpectrumCurves, simulated: FloatArray) -> FloatArray:
    """Return 20 lg of measured over simulated amplitudes, each at least at the floor; nan where neither exceeds it.

    In the residual, whose lines are closer than a shaft's, a line that moved to the neighbouring bin counts as the
    same.
    """
    floor = np.maximum(curves.floor, 1e-300)
    a, b = (20.0 * np.log10(np.maximum(values, floor)) for values in (curves.measured, simulated))
    up, down = a - b, a - b
    if curves.orders[1] - curves.orders[0] < CLOSER_THAN_A_SHAFTS:
        from scipy.ndimage import maximum_filter1d

        up, down = a - maximum_filter1d(b, 3), maximum_filter1d(a, 3) - b
    gap = np.maximum(up, 0.0) + np.minimum(down, 0.0)
    return np.where((curves.measured > floor) | (simulated > floor), gap, np.nan)


def angle_curves(
    now: ReducedRecording,
    before: ReducedRecording,
    after: ReducedRecording | None = None,
    *,
    healthy: ReducedRecording | None = None,
) -> tuple[AngleCurves, ...]:
    """Return, for both shafts, the energy within one pitch relative to the measured median tooth.

    The angle is that at which a tooth engages: the typical lag of the response is subtracted. Simulated curves are
    rotated for best agreement, unless both have a mark on that shaft.

    Parameters
    ----------
    now, before, after : ReducedRecording
        Measured, and simulated without and with the most probable effect.
    healthy : ReducedRecording or None
        If given, the curves are those of the differences: of the recording from it, and of the simulations from
        `before`, whose own curve is 0.
    """
    simulated_healthy = None if healthy is None else before
    curves_of_shafts = []
    for side in (DRIVER, DRIVEN):
        measured = _energy(now, healthy, side)
        median = max(float(np.median(measured)), 1e-300)
        simulated = [
            _turned(_energy(run, simulated_healthy, side), measured, run.marks[side], now.marks[side])
            for run in (before, after)
            if run is not None
        ]
        curves = [values / median for values in (measured, *simulated)]
        angle, shift = _angles(now.frame.teeth[side])
        first, second, third = ([np.roll(values, -shift) for values in curves] + [NOTHING])[:3]
        frame = now.frame
        curves_of_shafts.append(
            AngleCurves(frame.shafts[side], "", frame.teeth[side], now.marks[side], angle, first, second, third)
        )
    return tuple(curves_of_shafts)


def _energy(run: ReducedRecording, healthy: ReducedRecording | None, side: int) -> FloatArray:
    """Return the energy at each start of a pitch, mean over channels; 0 for a run compared with itself."""
    if healthy is run:
        return np.zeros(run.frame.teeth[side] * STEPS_PER_TOOTH)
    pattern = pattern_of_recording(run, side) if healthy is None else changed_pattern(run, healthy, side)
    energy: FloatArray = pattern.energy.mean(axis=0)
    return energy


def _turned(simulated: FloatArray, measured: FloatArray, *marks: bool) -> FloatArray:
    """Return the curve rotated for best agreement, unless marks fix it."""
    if all(marks):
        return simulated
    turned: FloatArray = np.roll(simulated, int(np.argmax(circular_correlation(measured, simulated))))
    return turned


def _angles(teeth: int) -> tuple[FloatArray, int]:
    """Return ascending angles in degrees from 0 to 360, and the index of the first.

    A window that starts at θ has its centre half a pitch later; the tooth engaged `lag_pitches` before that.
    """
    n = teeth * STEPS_PER_TOOTH
    middle = (np.arange(n) / STEPS_PER_TOOTH + 0.5 - load_calibration().lag_pitches) / teeth
    first = int(np.argmin(middle % 1.0))
    angle: FloatArray = 360.0 * np.roll(middle % 1.0, -first)
    return angle, first


# --------------------
# Tooth patterns of a recording and of the healthy reference, for plotting both.
# --------------------


POINTS_PER_PERIOD = 4
"""Points per period of the highest order, for smooth curves."""


def average_curves(now: ReducedRecording, reference: ReducedRecording, *, unit: str = "") -> tuple[AverageCurves, ...]:
    """Return the tooth-to-tooth part of both shafts' averages, of a recording and of its reference.

    It is taken from the channel with the largest change relative to its mesh harmonics. The angle is that at which a
    tooth engages: the typical lag of the response is subtracted, as in `gearsig.gap.angle_curves`.

    Parameters
    ----------
    now, reference : ReducedRecording
        Both with the same channels.
    unit : str
        Unit of the channels.

    Raises
    ------
    RefusalError
        If the reference was taken at a different speed.
    """
    return tuple(_of_side(now, reference, side, unit) for side in (DRIVER, DRIVEN))


def _of_side(now: ReducedRecording, reference: ReducedRecording, side: int, unit: str) -> AverageCurves:
    difference, _ = turned_difference(now, reference, side)
    n, averages = difference.lines.shape[1], now.averages(side)
    changed = [
        np.sum(np.abs(average.residual(lines)) ** 2) / average.mesh_power
        for lines, average in zip(difference.lines, averages, strict=True)
    ]
    row = int(np.argmax(changed))
    average = averages[row]
    measured = average.residual(average.lines[:n])
    lag = load_calibration().lag_pitches / difference.teeth
    waves = [_wave(lines, lag) for lines in (measured, measured - average.residual(difference.lines[row]))]
    return AverageCurves(
        now.frame.shafts[side],
        unit,
        list(now.channels)[row],
        now.frame.teeth[side],
        now.marks[side],
        np.arange(len(waves[0])) * 360.0 / len(waves[0]),
        *waves,
    )


def _wave(lines: NDArray[np.complex128], lag_rev: float) -> FloatArray:
    """Return one revolution of peak amplitudes, shifted back by the lag of the response."""
    n = POINTS_PER_PERIOD * (len(lines) - 1)
    turned = lines * np.exp(2j * np.pi * np.arange(len(lines)) * lag_rev)
    wave: FloatArray = np.fft.irfft(turned, n) * (n / 2.0)
    return wave
