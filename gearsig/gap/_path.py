"""The path from the mesh to the sensors, as a run-up of the healthy machine measures it beside the twin's.

A run-up takes each mesh harmonic k over a range of frequencies. With Y_k what a sensor reads of it, against the shaft's
angle, and X_k what the twin's sensor reads on a run-up of its own,

    ln Y_k(f)/X_k(f) = a_k + h(f),

a_k by how much load and flanks excite the harmonic otherwise, and where the angle begins; h the path, recorded over
simulated, which harmonics that pass one frequency have in common. Both follow from weighted least squares, h straight
between frequencies `KNOT` apart. What a fault changes beside mesh harmonic k reaches the sensor h(f) − h(f_k) louder
and later, relative to that harmonic, than on the twin. Housings bend that by some decibels within a dozen orders.

How far to believe it: even harmonics are held against what odd ones say and the other way round. The share λ of what
they do that is told so, times that of points which are heard over noise, multiplies h: 0 to 1. What noise or a bad
tachometer makes does not repeat.
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
"""Highest over lowest speed: with less hardly two harmonics pass one frequency."""

N_TRACKED = 12
BLOCK_REVOLUTIONS, BLOCK_OVERLAP = 4.0, 0.75
BESIDE = 1.5
"""Orders from a mesh harmonic to where only noise is: the window's zeros take out whole orders."""

MAX_CHANGE = 0.25
"""Of the speed within a block, relative: one at which a run-up begins says nothing of any frequency."""

USED_BAND = 0.4
"""Of the sampling rate, above which filters against aliasing cut."""

KNOT = 0.015
"""Of ln f, between the frequencies that h is straight between: half of a housing's resonance."""

OWN_SCATTER = 0.1
"""Of ln Y_k/X_k without noise: loads and teeth that meet differ along a run-up."""

MAX_NOISE = 0.1
"""Power of noise over that of a harmonic. What is hardly heard is as loud as the noise at all frequencies, whatever the
harmonic: beside the twin's that would repeat, and pass for a path."""

STIFFNESS, MEAN_STIFFNESS = 1.0, 1e-3
"""Weights of the squared steps of h, and of h itself, beside residuals over `OWN_SCATTER`²."""

N_PASSES, DEGREES = 6, 4.0
"""Over all points; degrees of freedom of Student's t."""

ANGLE_SOURCES = (PulseTimes, TachometerChannel, EncoderChannel)
MAX_BLOCKS = 100.0
"""Of a run-up, beside each other: longer ones have longer blocks and less noise."""

TWIN_CHANGE, TWIN_MARGIN, LONGEST_S = 0.15, 1.1, 20.0
"""Relative change of the twin's speed within its slowest block; by how much it goes beyond the recorded speeds; of the
simulation."""

MAX_SPEED_RATIO = 8.0
"""Highest over lowest speed that is looked at: slower, next to nothing is heard of the mesh."""

MIN_POINTS = 8
"""Of a harmonic at frequencies that others pass, for it to be held against them."""


@dataclass(frozen=True)
class MeasuredPath:
    """What lies between mesh and sensors of a machine, over what the twin has there.

    Parameters
    ----------
    name : str
        Of the run-up.
    frequency_hz : array, (n_knots,)
    responses : mapping
        Channel → h at these frequencies, (n_knots,), complex: nepers and radians.
    credibility : mapping
        Channel → λ, 0 to 1.
    excitation : mapping
        Channel → a_k, (n_harmonics,), complex.
    speed_hz : array, (n_blocks,)
        Of the driver along the run-up.
    levels : mapping
        Channel → ln |Y_k|, (n_harmonics, n_blocks); nan where noise hides it.
    """

    name: str
    frequency_hz: FloatArray
    responses: Mapping[str, ComplexArray]
    credibility: Mapping[str, float]
    excitation: Mapping[str, ComplexArray]
    speed_hz: FloatArray
    levels: Mapping[str, FloatArray]

    def of_sidebands(self, channels: Sequence[str], frame: GearFrame, speed_hz: float) -> ComplexArray:
        """Return exp λ(h(f) − h(f_k)) of the orders beside each mesh harmonic; 1 where nothing was measured.

        Parameters
        ----------
        channels : sequence of str
        frame : GearFrame
        speed_hz : float
            Of the driver.

        Returns
        -------
        complex array, (n_channels, 2, N_HARMONICS, n_offsets)
            As `mesh_sidebands`.
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
        """Return h; beyond what was measured it stays as it is at the ends."""
        log_hz = np.log(np.maximum(frequency_hz, 1e-9))
        return _interpolated(log_hz, np.log(self.frequency_hz), self.responses[channel])

    def gain_scatter(self, unknown: float) -> float:
        """Return α, by how much harmonics are excited otherwise than the twin's; `unknown` is α₀, without a path.

        α² = λ var_k Re a_k + (1 − λ) α₀², mean over channels, and α₀² at most: harmonics that are hardly heard scatter.
        See `gearsig.gap._waveform.gain_scatter` for α₀.
        """
        variances = [
            value * float(np.var(self.excitation[name][:N_HARMONICS].real)) + (1.0 - value) * unknown**2
            for name, value in self.credibility.items()
        ]
        return max(min(float(np.sqrt(np.mean(variances))), unknown), MIN_GAIN_SCATTER)

    def missed_db(self, reference: ReducedRecording) -> float:
        """Return by how much mesh harmonics, beside each other, miss those of a healthy recording at its speed.

        Root of the mean square over harmonics and channels, each channel's mean taken out; nan where fewer than two
        harmonics of a channel can be compared, as the run-up does not come through that speed.
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
        """For the report."""
        return PathFacts(self.name, float(self.frequency_hz[0]), float(self.frequency_hz[-1]), self.credibility)


def measured_path(run_up: PreparedRecording, twin: Twin, *, seed: int) -> MeasuredPath:
    """Return the path that a healthy run-up, or run-down, measures beside the twin's own.

    Parameters
    ----------
    run_up : PreparedRecording
        With a rig whose first pair is the twin's; its speed may vary in any way.
    twin : Twin
    seed : int
        Twin and its specimen, as trials run: a quiet one, if there is.

    Raises
    ------
    InputError
        If the speed hardly varies.
    RefusalError
        If no pulses or encoder tell the shaft's angle, or the simulator cannot run up.
    """
    recording, frame = run_up.recording, gear_frame(run_up.rig)
    if not isinstance(twin, CanRunUp):
        raise RefusalError("the simulator cannot run up, so that a run-up measures no path", remedy="leave it out")
    if not isinstance(recording.speed_source, ANGLE_SOURCES):
        raise RefusalError(
            f"{recording.name}: nothing tells the angle of a shaft against which phases could be measured",
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
    """Return mesh harmonics over blocks of so many revolutions, without those in which the speed leaps."""
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
        # What the speed does between the begin and the end of a block.
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
    """Return the twin's run-up through the same speeds, slow enough for blocks to see one speed each."""
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
    """Return ln of amplitudes over the blocks, (n_harmonics, n_blocks), phases without leaps."""
    log: ComplexArray = np.log(np.maximum(np.abs(lines), 1e-300)) + 1j * np.unwrap(np.angle(lines), axis=1)
    return log


def _at_speeds(lines: ComplexArray, speed_hz: FloatArray, at_hz: FloatArray) -> ComplexArray:
    """Return ln of the amplitudes of a run-up at other speeds, straight over ln of the speed."""
    log_amplitudes, log_speed = _logarithm(lines), np.log(speed_hz)
    return np.array([_interpolated(np.log(at_hz), log_speed, row) for row in log_amplitudes])


# --------------------
# What harmonics have in common at one frequency.
# --------------------


def _fitted(
    log_ratio: ComplexArray, log_hz: FloatArray, weights: FloatArray, knots: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Return a and h of ln Y_k/X_k = a_k + h(f), the sum over points of w |residual|² as small as may be.

    Phases are known but for whole turns: residuals' lie within half a turn. What lies far off counts less, as under
    Student's t.

    Parameters
    ----------
    log_ratio : complex array, (n_harmonics, n_blocks)
    log_hz, weights : arrays of the same shape
        Weights of 0 leave points out.
    knots : array, (n_knots,)
        Of ln f.
    """
    n_harmonics, n_points = log_ratio.shape
    columns = np.zeros((log_ratio.size, n_harmonics + len(knots)))
    columns[np.arange(log_ratio.size), np.repeat(np.arange(n_harmonics), n_points)] = 1.0
    columns[:, n_harmonics:] = _between(log_hz.ravel(), knots)
    held = np.zeros((columns.shape[1], columns.shape[1]))
    step = np.diff(np.eye(len(knots)), axis=0)
    held[n_harmonics:, n_harmonics:] = STIFFNESS * step.T @ step + MEAN_STIFFNESS * np.eye(len(knots))
    held[:n_harmonics, :n_harmonics] = 1e-9 * np.eye(n_harmonics)  # of harmonics that are left out
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
    """Return how much each knot counts at each frequency, straight between two, (n_points, n_knots)."""
    place = np.interp(log_hz, knots, np.arange(len(knots)))
    return np.maximum(1.0 - np.abs(place[:, None] - np.arange(len(knots))[None, :]), 0.0)


def _within_half_a_turn(values: ComplexArray) -> ComplexArray:
    return np.asarray(values.real + 1j * np.angle(np.exp(1j * values.imag)))


def _credibility(log_ratio: ComplexArray, log_hz: FloatArray, weights: FloatArray, knots: FloatArray) -> float:
    """Return λ, the share of what harmonics do that those of the other parity say at the same frequencies.

    λ = 1 − Σ ρ(e − h)/Σ ρ(e), 0 at least, with a line over ln f taken out, harmonic by harmonic: it bends nothing
    within a dozen orders. ρ(e) = ln(1 + w |e|²/ν), as in the fit.
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
    """Return Σ ρ(e) of what a line over ln f leaves; phases about their mean, within half a turn of it."""
    mean_rad = np.angle(np.sum(weights * np.exp(1j * values.imag)))
    values = _within_half_a_turn(values - 1j * mean_rad)
    root = np.sqrt(weights)
    basis = root[:, None] * np.stack([np.ones(len(root)), log_hz - log_hz.mean()], axis=1)
    fitted = basis @ np.linalg.lstsq(basis, root * values)[0]
    return float(np.sum(np.log1p(np.abs(root * values - fitted) ** 2 / DEGREES)))


def _interpolated(log_hz: FloatArray, knots: FloatArray, response: ComplexArray) -> ComplexArray:
    return np.asarray(np.interp(log_hz, knots, response.real) + 1j * np.interp(log_hz, knots, response.imag))
