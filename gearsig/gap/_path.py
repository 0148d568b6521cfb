"""The path from the mesh to the sensors, measured by a run-up of the healthy machine and compared with the twin's.

A run-up takes each mesh harmonic k through a range of frequencies. With Y_k its reading on a sensor, relative to the
shaft's angle, and X_k that on the twin's sensor during a run-up of its own,

    ln Y_k(f)/X_k(f) = a_k + h(f),

where a_k is the difference in excitation of the harmonic by load and flanks, including the origin of the angle, and h
the path, recorded over simulated, which is common to all harmonics that pass a frequency. Both follow from weighted
least squares, with h piecewise linear between frequencies `KNOT` apart. A change caused by a fault beside mesh harmonic
k reaches the sensor h(f) − h(f_k) louder and later, relative to that harmonic, than on the twin. Housings change this
by some decibels within a dozen orders.

Its credibility: even harmonics are compared with the prediction from odd ones, and vice versa. The fraction λ that is
predicted, times the fraction of points above the noise, multiplies h: 0 to 1. Effects of noise or of a bad tachometer
do not repeat.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap._reduction import DRIVER, ComplexArray, GearFrame, ReducedRecording, gear_frame, smooth_power
from gearsig.gap._report import PathFacts
from gearsig.gap._simulator import CanRunUp, Twin
from gearsig.gap._waveform import MIN_GAIN_SCATTER, N_HARMONICS, OFFSETS
from gearsig.orders import track_orders
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording
from gearsig.rig import SIDES, EncoderChannel, PulseTimes, TachometerChannel

MIN_SPEED_RATIO = 1.5
"""Ratio of highest to lowest speed: with less, hardly two harmonics pass the same frequency."""

N_TRACKED = 12
BLOCK_REVOLUTIONS, BLOCK_OVERLAP = 4.0, 0.75
BESIDE = 1.5
"""Distance in orders from a mesh harmonic at which only noise remains: the window's zeros cancel whole orders."""

MAX_CHANGE = 0.25
"""Maximum relative change of speed within a block: a larger one, as at the start of a run-up, belongs to no
frequency."""

USED_BAND = 0.4
"""Fraction of the sampling rate above which anti-aliasing filters cut off."""

KNOT = 0.015
"""Spacing in ln f of the knots of h: half the width of a housing's resonance."""

OWN_SCATTER = 0.1
"""Scatter of ln Y_k/X_k without noise: loads and the teeth in mesh vary along a run-up."""

MAX_NOISE = 0.1
"""Power of noise relative to that of a harmonic. Hidden harmonics read the noise level at all frequencies, whatever
their number; compared with the twin's, that would repeat and be taken for a path."""

STIFFNESS, MEAN_STIFFNESS = 1.0, 1e-3
"""Weights of the squared steps of h, and of h itself, relative to residuals over `OWN_SCATTER`²."""

N_PASSES, DEGREES = 6, 4.0
"""Passes over all points; degrees of freedom of Student's t."""

ANGLE_SOURCES = (PulseTimes, TachometerChannel, EncoderChannel)
MAX_BLOCKS = 100.0
"""Maximum number of blocks of a run-up: longer ones have longer blocks and less noise."""

TWIN_CHANGE, TWIN_MARGIN, LONGEST_S = 0.15, 1.1, 20.0
"""Relative change of the twin's speed within its slowest block; margin beyond the recorded speeds; longest
simulation."""

MAX_SPEED_RATIO = 8.0
"""Maximum ratio of highest to lowest speed used: at lower speeds the mesh is almost inaudible."""

MIN_POINTS = 8
"""Minimum number of points of a harmonic, at frequencies that others pass, for it to be compared with them."""


@dataclass(frozen=True)
class MeasuredPath:
    """The path between mesh and sensors of a machine, relative to that of the twin.

    Parameters
    ----------
    name : str
        Name of the run-up.
    frequency_hz : array, (n_knots,)
    responses : mapping
        Channel → h at these frequencies, (n_knots,), complex: nepers and radians.
    credibility : mapping
        Channel → λ, 0 to 1.
    excitation : mapping
        Channel → a_k, (n_harmonics,), complex.
    speed_hz : array, (n_blocks,)
        Of the driver, along the run-up.
    levels : mapping
        Channel → ln |Y_k|, (n_harmonics, n_blocks); nan where it is hidden by noise.
    """

    name: str
    frequency_hz: FloatArray
    responses: Mapping[str, ComplexArray]
    credibility: Mapping[str, float]
    excitation: Mapping[str, ComplexArray]
    speed_hz: FloatArray
    levels: Mapping[str, FloatArray]

    def of_sidebands(self, channels: Sequence[str], frame: GearFrame, speed_hz: float) -> ComplexArray:
        """Return exp λ(h(f) − h(f_k)) for the orders beside each mesh harmonic; 1 where nothing was measured.

        Parameters
        ----------
        channels : sequence of str
        frame : GearFrame
        speed_hz : float
            Of the driver.

        Returns
        -------
        complex array, (n_channels, 2, N_HARMONICS, n_offsets)
            As in `mesh_sidebands`.
        """
        factors = np.ones((len(channels), len(SIDES), N_HARMONICS, len(OFFSETS)), dtype=np.complex128)
        harmonics = np.arange(1, N_HARMONICS + 1)[:, None]
        for channel, name in enumerate(channels):
            for side in range(len(SIDES)):
                shaft_hz = speed_hz * frame.shaft_orders[side]
                mesh_hz = shaft_hz * frame.teeth[side] * harmonics
                if name in self.responses:
                    beside = self._at(name, mesh_hz + shaft_hz * OFFSETS) - self._at(name, mesh_hz)
                    factors[channel, side] = np.exp(self.credibility[name] * beside)
        return factors

    def _at(self, channel: str, frequency_hz: FloatArray) -> ComplexArray:
        """Return h; beyond the measured range it keeps the values at the ends."""
        log_hz = np.log(np.maximum(frequency_hz, 1e-9))
        return _interpolated(log_hz, np.log(self.frequency_hz), self.responses[channel])

    def gain_scatter(self, unknown: float) -> float:
        """Return α, the difference in excitation between harmonics and the twin's; `unknown` is α₀, without a path.

        α² = λ var_k Re a_k + (1 − λ) α₀², mean over channels, and at most α₀², since weak harmonics scatter. See
        `gearsig.gap._waveform.gain_scatter` for α₀.
        """
        variances = [
            value * float(np.var(self.excitation[name][:N_HARMONICS].real)) + (1.0 - value) * unknown**2
            for name, value in self.credibility.items()
        ]
        return max(min(float(np.sqrt(np.mean(variances))), unknown), MIN_GAIN_SCATTER)

    def missed_db(self, reference: ReducedRecording) -> float:
        """Return the error in dB of the mesh harmonics, relative to each other, against a healthy recording.

        The run-up is read at the speed of that recording. RMS over harmonics and channels, with each channel's mean
        removed; nan where fewer than two harmonics of a channel can be compared, because the run-up does not pass
        through that speed.
        """
        variances = []
        for name in set(self.levels) & set(reference.channels):
            average = reference.average(name, DRIVER)
            n = min(len(self.levels[name]), average.highest // average.teeth)
            mesh = average.teeth * np.arange(1, n + 1)
            heard = np.abs(average.lines[mesh]) ** 2
            along = np.argsort(self.speed_hz)
            levels = [
                np.interp(reference.speed_hz, self.speed_hz[along], row[along], np.nan, np.nan)
                for row in self.levels[name][:n]
            ]
            difference = np.where(MAX_NOISE * heard > average.noise[mesh], levels - 0.5 * np.log(heard), np.nan)
            if np.count_nonzero(np.isfinite(difference)) > 1:
                variances.append(float(np.nanvar(difference)))
        return float(20.0 / np.log(10.0) * np.sqrt(np.mean(variances))) if variances else float("nan")

    @property
    def facts(self) -> PathFacts:
        """Summary for the report."""
        return PathFacts(self.name, float(self.frequency_hz[0]), float(self.frequency_hz[-1]), self.credibility)


def measured_path(run_up: PreparedRecording, twin: Twin, *, seed: int) -> MeasuredPath:
    """Return the path that a healthy run-up, or run-down, measures relative to the twin's own.

    Parameters
    ----------
    run_up : PreparedRecording
        With a rig whose first pair is the twin's; its speed may vary in any way.
    twin : Twin
    seed : int
        Twin and its specimen, as in trials: a quiet one, if available.

    Raises
    ------
    InputError
        If the speed hardly varies.
    RefusalError
        If no pulses or encoder give the shaft's angle, or the simulator cannot run up.
    """
    recording, frame = run_up.recording, gear_frame(run_up.rig)
    if not isinstance(twin, CanRunUp):
        raise RefusalError("the simulator cannot run up, so a run-up measures no path", remedy="leave it out")
    if not isinstance(recording.speed_source, ANGLE_SOURCES):
        raise RefusalError(
            f"{recording.name}: no shaft's angle is known, against which phases could be measured",
            remedy="record the run-up with a tachometer or an encoder",
        )
    n_revolutions = run_up.angle_of(frame.shafts[DRIVER]).n_revolutions
    recorded = _tracked(run_up, frame, max(BLOCK_REVOLUTIONS, n_revolutions / MAX_BLOCKS))
    low_hz, high_hz = float(recorded.speed_hz.min()), float(recorded.speed_hz.max())
    if high_hz < MIN_SPEED_RATIO * low_hz:
        raise InputError(
            f"the speed goes from {60.0 * low_hz:.4g} to {60.0 * high_hz:.4g} rpm only",
            where=f"run-up {recording.name}",
            allowed=f"highest over lowest speed from {MIN_SPEED_RATIO:g}",
            remedy="give a run-up or run-down through the recordings' speeds; one at steady speed is a reference",
        )
    simulated = _tracked(PreparedRecording(_run_up_of(twin, run_up, low_hz, high_hz, seed)), frame, BLOCK_REVOLUTIONS)
    n = min(recorded.n_harmonics, simulated.n_harmonics)
    mesh_hz = frame.teeth[DRIVER] * recorded.speed_hz * np.arange(1, n + 1)[:, None]
    is_sampled = mesh_hz <= USED_BAND * recording.sampling_rate_hz
    log_hz = np.log(mesh_hz)
    knots = np.arange(log_hz[is_sampled].min(), log_hz[is_sampled].max() + KNOT, KNOT)
    responses, credibility, excitation, levels = {}, {}, {}, {}
    for i, (name, lines) in enumerate(recorded.lines.items()):
        of_twin = simulated.lines.get(name, list(simulated.lines.values())[i % len(simulated.lines)])
        log_ratio = _logarithm(lines[:n]) - _at_speeds(of_twin[:n], simulated.speed_hz, recorded.speed_hz)
        noise = recorded.noise[name][:n] / np.maximum(np.abs(lines[:n]) ** 2, 1e-300)
        is_clear = is_sampled & (noise <= MAX_NOISE)
        weights = is_clear / (OWN_SCATTER**2 + noise)
        levels[name] = np.where(noise <= MAX_NOISE, _logarithm(lines[:n]).real, np.nan)
        excitation[name], responses[name] = _fitted(log_ratio, log_hz, weights, knots)
        heard = np.count_nonzero(is_clear) / np.count_nonzero(is_sampled)
        credibility[name] = heard * _credibility(log_ratio, log_hz, weights, knots)
    return MeasuredPath(recording.name, np.exp(knots), responses, credibility, excitation, recorded.speed_hz, levels)


# --------------------
# Mesh harmonics along a run-up.
# --------------------


@dataclass(frozen=True)
class _Track:
    """Mesh harmonics over the blocks of a run-up.

    Parameters
    ----------
    speed_hz : array, (n_blocks,)
        Of the driver.
    lines, noise : mapping
        Channel → complex amplitude and power of noise, (n_harmonics, n_blocks).
    """

    speed_hz: FloatArray
    lines: Mapping[str, ComplexArray]
    noise: Mapping[str, FloatArray]

    @property
    def n_harmonics(self) -> int:
        return len(next(iter(self.lines.values())))


def _tracked(prepared: PreparedRecording, frame: GearFrame, revolutions: float) -> _Track:
    """Return mesh harmonics over blocks of so many revolutions, without blocks in which the speed changes too fast."""
    signal = prepared.over_angle(frame.shafts[DRIVER])
    teeth = frame.teeth[DRIVER]
    n = min(N_TRACKED, int((signal.highest_order - BESIDE) / teeth))
    if n < 2:
        raise RefusalError(
            f"{prepared.recording.name}: its sampling rate shows fewer than two mesh harmonics",
            remedy="record the run-up at a higher rate",
        )
    mesh_orders = teeth * np.arange(1, n + 1)
    orders = np.concatenate([mesh_orders, mesh_orders - BESIDE, mesh_orders + BESIDE])
    lines: dict[str, ComplexArray] = {}
    noise: dict[str, FloatArray] = {}
    for name in signal.channel_names:
        tracks = track_orders(signal, name, orders.tolist(), revolutions_per_block=revolutions, overlap=BLOCK_OVERLAP)
        speed_hz = tracks[0].speed_rpm / 60.0
        # Change of speed between the start and the end of a block.
        change = np.abs(np.gradient(np.log(np.maximum(speed_hz, 1e-9)))) / (1.0 - BLOCK_OVERLAP)
        is_used = (change <= MAX_CHANGE) & (speed_hz >= speed_hz.max() / MAX_SPEED_RATIO)
        amplitudes = np.array([track.amplitude * np.exp(1j * track.phase_rad) for track in tracks])[:, is_used]
        lines[name] = amplitudes[:n]
        beside = np.mean(np.abs(amplitudes[n:].reshape(2, n, -1)) ** 2, axis=0)
        noise[name] = np.array([smooth_power(row) for row in beside])
    if np.count_nonzero(is_used) < MIN_POINTS:
        raise RefusalError(
            f"{prepared.recording.name}: the speed changes too fast to follow mesh harmonics",
            remedy="run up slowly: in half a minute or more",
        )
    return _Track(speed_hz[is_used], lines, noise)


def _run_up_of(twin: CanRunUp, run_up: PreparedRecording, low_hz: float, high_hz: float, seed: int) -> Recording:
    """Return the twin's run-up through the same speeds, slow enough for a nearly constant speed in each block."""
    slowest_block_s = BLOCK_REVOLUTIONS / low_hz
    recording, (pair, *_) = run_up.recording, run_up.rig.pairs
    torque_nm = run_up.rig.nominal_torque_nm(pair.driver)
    return twin.run_up(
        60.0 * low_hz / TWIN_MARGIN,
        60.0 * high_hz * TWIN_MARGIN,
        torque_nm or twin.point.torque_nm,
        seed=seed,
        duration_s=min(slowest_block_s * np.log(high_hz / low_hz * TWIN_MARGIN**2) / TWIN_CHANGE, LONGEST_S),
        sampling_rate_hz=recording.sampling_rate_hz,
    )


def _logarithm(lines: ComplexArray) -> ComplexArray:
    """Return ln of amplitudes over the blocks, (n_harmonics, n_blocks), with unwrapped phases."""
    log: ComplexArray = np.log(np.maximum(np.abs(lines), 1e-300)) + 1j * np.unwrap(np.angle(lines), axis=1)
    return log


def _at_speeds(lines: ComplexArray, speed_hz: FloatArray, at_hz: FloatArray) -> ComplexArray:
    """Return ln of the amplitudes of a run-up at other speeds, interpolated linearly over ln of the speed."""
    log_amplitudes, log_speed = _logarithm(lines), np.log(speed_hz)
    return np.array([_interpolated(np.log(at_hz), log_speed, row) for row in log_amplitudes])


# --------------------
# The part that harmonics have in common at one frequency.
# --------------------


def _fitted(
    log_ratio: ComplexArray, log_hz: FloatArray, weights: FloatArray, knots: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return a and h of ln Y_k/X_k = a_k + h(f) that minimise the sum over points of w |residual|².

    Phases are known except for whole turns: those of residuals are taken within half a turn. Outliers count less, as
    under Student's t.

    Parameters
    ----------
    log_ratio : complex array, (n_harmonics, n_blocks)
    log_hz, weights : arrays of the same shape
        A weight of 0 omits a point.
    knots : array, (n_knots,)
        Values of ln f.
    """
    n_harmonics, n_points = log_ratio.shape
    columns = np.zeros((log_ratio.size, n_harmonics + len(knots)))
    columns[np.arange(log_ratio.size), np.repeat(np.arange(n_harmonics), n_points)] = 1.0
    columns[:, n_harmonics:] = _between(log_hz.ravel(), knots)
    held = np.zeros((columns.shape[1], columns.shape[1]))
    step = np.diff(np.eye(len(knots)), axis=0)
    held[n_harmonics:, n_harmonics:] = STIFFNESS * step.T @ step + MEAN_STIFFNESS * np.eye(len(knots))
    held[:n_harmonics, :n_harmonics] = 1e-9 * np.eye(n_harmonics)  # for omitted harmonics
    observed: ComplexArray = log_ratio.ravel()
    robust: FloatArray = np.ones(log_ratio.size)
    for _ in range(N_PASSES):
        weighted = columns * (weights.ravel() * robust)[:, None]
        unknowns = np.asarray(np.linalg.solve(weighted.T @ columns + held, weighted.T @ observed), dtype=np.complex128)
        residual = _within_half_a_turn(observed - columns @ unknowns)
        observed = np.asarray(columns @ unknowns + residual, dtype=np.complex128)
        robust = 1.0 / (1.0 + np.abs(residual) ** 2 * weights.ravel() / DEGREES)
    return unknowns[:n_harmonics], unknowns[n_harmonics:]


def _between(log_hz: FloatArray, knots: FloatArray) -> FloatArray:
    """Return the linear interpolation weight of each knot at each frequency, (n_points, n_knots)."""
    place = np.interp(log_hz, knots, np.arange(len(knots)))
    return np.maximum(1.0 - np.abs(place[:, None] - np.arange(len(knots))[None, :]), 0.0)


def _within_half_a_turn(values: ComplexArray) -> ComplexArray:
    return np.asarray(values.real + 1j * np.angle(np.exp(1j * values.imag)))


def _credibility(log_ratio: ComplexArray, log_hz: FloatArray, weights: FloatArray, knots: FloatArray) -> float:
    """Return λ, the fraction of the harmonics' response that those of the other parity predict at the same frequencies.

    λ = 1 − Σ ρ(e − h)/Σ ρ(e), at least 0, with a line over ln f removed for each harmonic, as it hardly varies within a
    dozen orders. ρ(e) = ln(1 + w |e|²/ν), as in the fit.
    """
    left = whole = 0.0
    for parity in (0, 1):
        is_asked = np.arange(len(log_ratio)) % 2 == parity
        others = np.where(is_asked[:, None], 0.0, weights)
        _, response = _fitted(log_ratio, log_hz, others, knots)
        is_known = (others.ravel() @ _between(log_hz.ravel(), knots) > 0.0).astype(float)
        for values, at, weight in zip(log_ratio[is_asked], log_hz[is_asked], weights[is_asked], strict=True):
            used = (weight > 0.0) & (np.interp(at, knots, is_known) == 1.0)
            if np.count_nonzero(used) >= MIN_POINTS:
                predicted = _interpolated(at[used], knots, response)
                left += _bent(values[used] - predicted, at[used], weight[used])
                whole += _bent(values[used], at[used], weight[used])
    return float(np.clip(1.0 - left / whole, 0.0, 1.0)) if whole > 0.0 else 0.0


def _bent(values: ComplexArray, log_hz: FloatArray, weights: FloatArray) -> float:
    """Return Σ ρ(e) of the residuals from a line over ln f; phases about their mean, within half a turn."""
    mean_rad = np.angle(np.sum(weights * np.exp(1j * values.imag)))
    values = _within_half_a_turn(values - 1j * mean_rad)
    root = np.sqrt(weights)
    basis = root[:, None] * np.stack([np.ones(len(root)), log_hz - log_hz.mean()], axis=1)
    fitted = basis @ np.linalg.lstsq(basis, root * values)[0]
    return float(np.sum(np.log1p(np.abs(root * values - fitted) ** 2 / DEGREES)))


def _interpolated(log_hz: FloatArray, knots: FloatArray, response: ComplexArray) -> ComplexArray:
    return np.asarray(np.interp(log_hz, knots, response.real) + 1j * np.interp(log_hz, knots, response.imag))
