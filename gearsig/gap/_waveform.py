"""Identify a tooth fault and its severity from the waveform, not the energy, of the recorded change.

A crack, a spall and a chip of one tooth put about the same energy into the sidebands of the mesh harmonics, but their
profiles over the engagement differ. The profile is contained in the complex sidebands of the difference from the
healthy machine. Each sideband is divided by its mesh line, u_k[i] = D[k z + i]/Y[k z]. This cancels a path that is
smooth around a harmonic, and the origin of the shaft's angle except for a rotation, u → u exp(−jiφ).

The observation is modelled as the simulated change t, times a scale, times a gain of each harmonic, plus a remainder:

    u_k[i] = h e_k t_k[i] exp(−j(iφ + 2πkδ)) + r,  h = g √(1 − f),  e_k ~ CN(1, α²),  r ~ CN(0, n + f P_k),

with n the noise of the averages, P_k the power observed around harmonic k, and f the fraction of it whose profile the
twin does not reproduce. φ, δ and f are averaged over, so that a model gains nothing by its freedom. A twin that is
unlike the machine leaves f near 1, where all faults are equally likely. The reliability of the twin thus shows in the
fault itself, and before that in the healthy machine: α is the error of its mesh lines against the reference.

A pitch error affects one tooth, leading or lagging, or every tooth. If it affects all of them, the change is the sum of
single-tooth changes, each in proportion to that tooth's deviation: order i around all harmonics and on all channels has
one unknown factor, u_k[i] = h b_i t_k[i] + r, b_−i = b_i*. With independent single deviations f, Σ f = 0, the
cumulative ones have b_i ~ CN(0, z/(4 sin²(πi/z))).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, pi

import numpy as np
from scipy.ndimage import gaussian_filter1d

from gearsig.checks import FloatArray
from gearsig.gap._change import lines_of_shaft, turned_difference
from gearsig.gap._reduction import ComplexArray, ReducedRecording
from gearsig.gap._report import Interval
from gearsig.gap._simulator import AddedEffect, GapEffect
from gearsig.rig import SIDES

N_HARMONICS = 8
OFFSETS = np.array([*range(-12, -2), *range(3, 13)])
"""Orders relative to a mesh harmonic: closer ones hold modulation by the shafts, further ones belong to the next
harmonic."""

MIN_GAIN_SCATTER = 0.3
"""Minimum α: flanks that deviate from the drawing change each mesh line individually."""

COUNTED = 0.2
"""Exponent of a sensor's likelihood, divided by the number of sensors, with which sidebands count as independent: they
are smooth over order, and sensors share the engagement. For 0.1, 0.15, 0.2, 0.25 and 0.35 on 40 faults of 5 development
machines of the simulator itself, the log loss among the four is 0.66, 0.43, 0.20, 0.14 and 0.43; on 32 of the
independent rig 1.39, –, 1.37, 1.39 and 1.80, where no information gives 1.39."""

MISFITS = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Values of f, all equally likely."""

LOG_SCALES = np.linspace(-3.0, 3.0, 25)
"""Values of ln g."""

SCALE_SCATTER = 0.7
"""Standard deviation of ln g at the true severity: mesh lines of deviating flanks, cracks at other angles, wider
chips."""

PROFILE_SCATTER = 0.07
"""Standard deviation of ln s where the profile varies with the severity: flanks of another specimen come into contact,
and separate, some 0.03 pitches elsewhere. A chip's edge moves by one pitch per module of its height, of which up to 0.9
are plausible."""

MIN_CORRELATION = 0.6
"""Correlation from which a twin is considered to reproduce the profile of a fault."""

BETWEEN = 3
"""Settings inserted between two simulated ones: a spall's profiles at adjacent settings correlate by 0.95."""

_SHIFT_STEP_PITCHES = 0.01

_N_TURNS = 128
_SHIFT_PITCHES = 0.04
_N_SEVERITIES = 61
_EXTENSION = 0.5
"""Start of the range of severities, relative to the smallest plausible one."""
_AS_LIKELY = 0.26
"""exp(−1.645²/2) of the largest density: an end of the range that reaches this does not bound the severity."""


def mesh_sidebands(now: ReducedRecording, healthy: ReducedRecording, *, is_turned: bool) -> ComplexArray:
    """Return u, (n_channels, 2, N_HARMONICS, n_offsets); 0 where a harmonic is above the sampled range.

    Parameters
    ----------
    now, healthy : ReducedRecording
        Both with the same channels.
    is_turned : bool
        Whether the shafts' angles start elsewhere in the healthy recording; for two runs of a simulation they do not.
    """
    sidebands = np.zeros((len(now.channels), len(SIDES), N_HARMONICS, len(OFFSETS)), dtype=np.complex128)
    for side in range(len(SIDES)):
        after = lines_of_shaft(now, side)
        if is_turned:
            difference = turned_difference(now, healthy, side)[0].lines
        else:
            before = lines_of_shaft(healthy, side).lines
            n = min(after.lines.shape[1], before.shape[1])
            difference = after.lines[:, :n] - before[:, :n]
        for k, mesh in _harmonics(after.teeth, difference.shape[1]):
            carrier = after.lines[:, mesh] - difference[:, mesh]
            is_used = carrier != 0.0
            sidebands[is_used, side, k] = difference[is_used][:, mesh + OFFSETS] / carrier[is_used, None]
    return sidebands


def sideband_noise(now: ReducedRecording, healthy: ReducedRecording) -> FloatArray:
    """Return n, the noise power in u, (n_channels, 2, N_HARMONICS, n_offsets).

    Parameters
    ----------
    now, healthy : ReducedRecording
        As in `mesh_sidebands`.
    """
    noise = np.zeros((len(now.channels), len(SIDES), N_HARMONICS, len(OFFSETS)))
    for side in range(len(SIDES)):
        pairs = zip(now.averages(side), healthy.averages(side), strict=True)
        for channel, (after, before) in enumerate(pairs):
            n = min(len(after.noise), len(before.noise))
            for k, mesh in _harmonics(now.frame.teeth[side], n):
                carrier = max(float(np.abs(before.lines[mesh]) ** 2), 1e-300)
                noise[channel, side, k] = (after.noise[mesh + OFFSETS] + before.noise[mesh + OFFSETS]) / carrier
    return noise


def _harmonics(teeth: int, n_lines: int) -> Iterator[tuple[int, int]]:
    """Yield index and order of each mesh harmonic whose sidebands are within so many lines."""
    for k in range(N_HARMONICS):
        if (k + 1) * teeth + OFFSETS[-1] < n_lines:
            yield k, (k + 1) * teeth


def gain_scatter(healthy: ReducedRecording, simulated: ReducedRecording) -> float:
    """Return α from the healthy machine: the error of the twin's mesh lines relative to each other.

    α² = var_k ln|Y_k/Y'_k|, mean over channels; a gain common to all lines of a sensor does not count.

    Parameters
    ----------
    healthy, simulated : ReducedRecording
        The reference, and the healthy twin with the same channels.
    """
    ratios = []
    for recorded, twin in zip(healthy.averages(0), simulated.averages(0), strict=True):
        n = min(len(recorded.lines), len(twin.lines))
        orders = [mesh for _, mesh in _harmonics(healthy.frame.teeth[0], n)]
        magnitudes = np.abs(np.stack([recorded.lines[orders], twin.lines[orders]]))
        ratio = np.diff(np.log(np.maximum(magnitudes, 1e-300)), axis=0)[0]
        ratios.append(float(np.var(ratio)))
    return max(float(np.sqrt(np.mean(ratios))), MIN_GAIN_SCATTER)


@dataclass(frozen=True)
class SimulatedWaveform:
    """Agreement of one simulated setting with the observation.

    Parameters
    ----------
    added : AddedEffect
    levels : array, (n_scales,)
        ln L over `LOG_SCALES`, averaged over φ, δ and f; 0: no better than explaining nothing.
    correlation : float
        ρ, 0 to 1, at the most likely parameters.
    log_size : float
        ln of the simulated sidebands' RMS over that of the observed ones.
    """

    added: AddedEffect
    levels: FloatArray
    correlation: float
    log_size: float


def compare_waveform(
    added: AddedEffect,
    simulated: ComplexArray,
    observed: ComplexArray,
    noise: FloatArray,
    *,
    moves_pitches: float = 0.0,
    n_teeth: int = 0,
    gain_scatter: float = MIN_GAIN_SCATTER,
) -> SimulatedWaveform | None:
    """Compare one setting's sidebands with the observed ones; None where nothing was observed or simulated.

    Parameters
    ----------
    added : AddedEffect
    simulated, observed : arrays, (n_channels, n_harmonics, n_offsets)
    noise : array, as `observed`
        See `sideband_noise`.
    moves_pitches : float
        Largest |δ|.
    n_teeth : int
        Number of teeth if the effect is on all of them, each individually, although one is simulated; 0: it is on one.
    gain_scatter : float
        α, see `gain_scatter`.
    """
    power = np.mean(np.abs(observed) ** 2, axis=-1, keepdims=True)
    is_used = (power > 0.0) & (np.mean(np.abs(simulated) ** 2, axis=-1, keepdims=True) > 0.0)
    if not np.any(is_used):
        return None
    power = np.where(is_used, power, 1.0)
    o: ComplexArray = np.where(is_used, observed, 0.0)
    t: ComplexArray = np.where(is_used, simulated, 0.0)
    moved = _moved(moves_pitches, observed.shape[1])
    counted = COUNTED / len(observed)
    rows, correlations = [], []
    for misfit in MISFITS:
        # If everything is unexplained, no room is left for noise.
        variance = np.minimum(noise, (1.0 - misfit) * power) + misfit * power
        explained = float(np.sum(np.where(is_used, 1.0 + np.log(power / variance) - np.abs(o) ** 2 / variance, 0.0)))
        products: ComplexArray = counted * np.conj(t) * o / variance
        simulated_power: FloatArray = counted * np.abs(t) ** 2 / variance
        whole = counted * float(np.sum(np.abs(o) ** 2 / variance))
        scales = (1.0 - misfit) ** 0.5 * np.exp(LOG_SCALES)
        if n_teeth:
            level, product = _of_all_teeth(products, simulated_power, scales, n_teeth)
        else:
            level, product = _of_one_tooth(products, simulated_power, scales, moved, gain_scatter)
        rows.append(counted * explained + level)
        correlations.append(product / (whole * float(simulated_power.sum())) ** 0.5)
    levels = np.stack(rows, axis=1).reshape(len(LOG_SCALES), -1)
    best = int(np.argmax([row.max() for row in rows]))
    size = 0.5 * float(np.log(np.sum(np.abs(t) ** 2 / power) / np.sum(np.abs(o) ** 2 / power)))
    return SimulatedWaveform(added, _log_mean(levels, axis=1), float(correlations[best]), size)


def _moved(moves_pitches: float, n_harmonics: int) -> ComplexArray:
    """Return exp(2πjkδ) for each δ, (n_places, n_harmonics)."""
    n = round(moves_pitches / _SHIFT_PITCHES)
    places = np.arange(-n, n + 1) * _SHIFT_PITCHES
    return np.asarray(np.exp(2j * pi * np.outer(places, np.arange(1, n_harmonics + 1))))


def _of_one_tooth(
    products: ComplexArray, simulated_power: FloatArray, scales: FloatArray, moved: ComplexArray, gain_scatter: float
) -> tuple[FloatArray, float]:
    """Return ln L relative to no change, (n_scales, n_places × n_turns), and the largest Re Σ.

    With S = Σ t* u/σ² and T = Σ |t|²/σ² for a harmonic, and v = (h α)², integration over its gain gives
    2 h Re S − h² T + v |S − h T|²/(1 + v T) − ln(1 + v T).
    """
    turns = np.exp(1j * np.outer(OFFSETS, 2.0 * pi * np.arange(_N_TURNS) / _N_TURNS))
    sums = (products.sum(axis=0) @ turns)[None] * moved[:, :, None]  # (n_places, n_harmonics, n_turns)
    in_phase, square = np.real(sums), np.abs(sums) ** 2
    whole = simulated_power.sum(axis=(0, 2))
    rows = []
    for h in scales:
        v = (h * gain_scatter) ** 2
        share = v / (1.0 + v * whole)
        # |S − h T|² = |S|² − 2 h T Re S + h² T²: all three are sums over harmonics.
        linear = np.einsum("skp,k->sp", in_phase, 2.0 * h * (1.0 - share * whole))
        quadratic = np.einsum("skp,k->sp", square, share)
        constant = float(np.sum(share * (h * whole) ** 2 - h * h * whole - np.log1p(v * whole)))
        rows.append((linear + quadratic + constant).ravel())
    return np.array(rows), max(float(in_phase.sum(axis=1).max()), 0.0)


def _of_all_teeth(
    products: ComplexArray, simulated_power: FloatArray, scales: FloatArray, n_teeth: int
) -> tuple[FloatArray, float]:
    """Return ln L relative to no change, (n_scales, 1), and the largest Re Σ; each order has its own factor.

    Σ_i v |S_i|²/(1 + v T_i) − ln(1 + v T_i), v = h² E|b_i|²; S_i and T_i sum over harmonics, channels and both sides.
    """
    half = len(OFFSETS) // 2
    of_offsets, size = products.sum(axis=(0, 1)), simulated_power.sum(axis=(0, 1))
    sums, whole = of_offsets[half:] + np.conj(of_offsets[:half][::-1]), size[half:] + size[:half][::-1]
    v = scales[:, None] ** 2 * n_teeth / (4.0 * np.sin(pi * OFFSETS[half:] / n_teeth) ** 2)
    level = v * np.abs(sums) ** 2 / (1.0 + v * whole) - np.log1p(v * whole)
    reached = float(np.sum(np.abs(sums) ** 2 / np.maximum(whole, 1e-300)))
    return level.sum(axis=1, keepdims=True), (reached * float(simulated_power.sum())) ** 0.5


def _log_mean(values: FloatArray, axis: int | None = None) -> FloatArray:
    """Return ln of the mean of exp(values)."""
    top = values.max(axis=axis, keepdims=True)
    log_mean: FloatArray = np.squeeze(np.log(np.mean(np.exp(values - top), axis=axis, keepdims=True)) + top, axis)
    return log_mean


# --------------------
# Profiles between the simulated ones.
#
# The end of a spall, or the edge of a chip, determines at which orders its two steps add or cancel: at the seventh mesh
# harmonic, lengthening a spall by a fiftieth of a pitch changes the profile. Simulations are not spaced that closely.
# --------------------


def with_profiles_between(
    simulated: Sequence[tuple[AddedEffect, ComplexArray]], effect: GapEffect, n_teeth: int
) -> Iterator[tuple[AddedEffect, ComplexArray]]:
    """Yield the settings of one gear, and `BETWEEN` more between neighbours in the option that the profile varies with.

    At the fraction s of the interval, u = (1 − s) u₁ exp(2πj s δ o/z) + s u₂ exp(−2πj (1 − s) δ o/z) at order o. This
    is a mixture where the profile keeps its place; where the effect moves, the profile shifts by δ pitches between the
    two.

    Parameters
    ----------
    simulated : sequence of (Added, complex array), (n_channels, n_harmonics, n_offsets)
        Settings with their sidebands, see `mesh_sidebands`.
    effect : GapEffect
    n_teeth : int
        z of the gear.
    """
    yield from simulated
    option = effect.profile_varies_with
    if not option:
        return
    chains: dict[tuple[tuple[str, float | str], ...], list[tuple[float, ComplexArray]]] = {}
    for added, sidebands in simulated:
        setting = {**added.options, effect.severity_name: added.severity}
        if option in setting:
            value = float(setting.pop(option))
            chains.setdefault(tuple(sorted(setting.items())), []).append((value, sidebands))
    for others, chain in chains.items():
        for (low, before), (high, after) in pairwise(sorted(chain, key=lambda item: item[0])):
            turn_rad = _turn_between_rad(before, after, 2.0 * effect.moves_pitches, n_teeth)
            for share in np.arange(1, BETWEEN + 1) / (BETWEEN + 1.0):
                value = float(f"{low + share * (high - low):.4g}")
                turned = before * np.exp(1j * share * turn_rad), after * np.exp(1j * (share - 1.0) * turn_rad)
                mixed: ComplexArray = (1.0 - share) * turned[0] + share * turned[1]
                options = {**dict(others), option: value}
                severity = float(options.pop(effect.severity_name))
                yield AddedEffect(effect.name, severity, options), mixed


def _turn_between_rad(before: ComplexArray, after: ComplexArray, most_pitches: float, n_teeth: int) -> FloatArray:
    """Return 2π δ o/z, (n_harmonics, n_offsets), for the shift δ that best maps the first onto the second."""
    orders = np.arange(1, before.shape[-2] + 1)[:, None] + OFFSETS / n_teeth
    n = round(most_pitches / _SHIFT_STEP_PITCHES)
    turns_rad = 2.0 * pi * _SHIFT_STEP_PITCHES * np.arange(-n, n + 1)[:, None, None] * orders
    power = np.sqrt([np.mean(np.abs(u) ** 2, axis=-1, keepdims=True) for u in (before, after)]).prod(axis=0)
    products = np.sum(np.conj(before) * after / np.where(power > 0.0, power, np.inf), axis=0)
    alike = np.real(np.sum(products * np.exp(-1j * turns_rad), axis=(1, 2)))
    best: FloatArray = turns_rad[int(np.argmax(alike))]
    return best


# --------------------
# All settings of one effect together: its likelihood, severity and gear.
# --------------------


@dataclass(frozen=True)
class WaveformMatch:
    """How well the simulated profile of an effect matches the recorded one.

    Parameters
    ----------
    correlation : float
        ρ, 0 to 1, of the most likely setting.
    log_likelihood : float
        Mean over severities and other options, so that more freedom is no advantage. 0: nothing explained.
    added : AddedEffect
        The most likely setting, at the median severity.
    severity : Interval
        The median and the 90 % interval.
    """

    correlation: float
    log_likelihood: float
    added: AddedEffect
    severity: Interval

    @property
    def is_good(self) -> bool:
        """Whether the twin reproduces the profile well enough to identify the fault and its gear."""
        return self.correlation >= MIN_CORRELATION


def waveform_match(
    waveforms: Sequence[SimulatedWaveform], min_severity: float, max_severity: float, *, severity_scatter: float = 0.0
) -> WaveformMatch | None:
    """Return the joint result of all settings of an effect; None where there are none.

    p(u | s) is that of the settings simulated next to severity s, scaled to the sidebands' size there, with a standard
    deviation of `SCALE_SCATTER` for ln g; the prior of ln s is uniform over the plausible range. For a set of options
    with a single severity, the sidebands grow as in the set with the most severities, or in proportion.

    Parameters
    ----------
    waveforms : sequence of SimulatedWaveform
    min_severity, max_severity : float
        Range of plausible severities.
    severity_scatter : float
        Standard deviation of the ln s that a profile indicates.
    """
    groups: dict[tuple[tuple[str, float | str], ...], list[SimulatedWaveform]] = {}
    for waveform in sorted(waveforms, key=lambda waveform: waveform.added.severity):
        groups.setdefault(waveform.added.place, []).append(waveform)
    if not groups:
        return None
    log_severity = np.linspace(np.log(_EXTENSION * min_severity), np.log(max_severity), _N_SEVERITIES)
    fullest = max(groups.values(), key=len)
    rows = np.array([_over_severity(group, fullest, log_severity) for group in groups.values()])
    level = float(_log_mean(rows))
    density = np.exp(rows - rows.max()).sum(axis=0)
    if severity_scatter:
        step = float(log_severity[1] - log_severity[0])
        density = gaussian_filter1d(density, severity_scatter / step, mode="nearest")
    interval = _interval(np.exp(log_severity), density)
    best_group = list(groups.values())[int(np.argmax(_log_mean(rows, axis=1)))]
    best = max(best_group, key=lambda waveform: float(waveform.levels.max()))
    severity = float(f"{interval.value:.4g}")
    return WaveformMatch(
        max(waveform.correlation for waveform in best_group),
        level,
        AddedEffect(best.added.name, severity, dict(best.added.options)),
        interval,
    )


def _over_severity(
    group: Sequence[SimulatedWaveform], fullest: Sequence[SimulatedWaveform], log_severity: FloatArray
) -> FloatArray:
    """Return ln p(u | s) of one set of options."""
    at, sizes = _log_sizes(group)
    shape = group if len(group) > 1 else fullest
    size = _straight(log_severity, shape)
    if len(group) == 1:
        size = size - float(_straight(at, shape)[0]) + sizes[0]
    # ln g is that of the severity, except for its scatter.
    off = (LOG_SCALES[None, :] - (size[:, None, None] - sizes[None, :, None]).reshape(-1, 1)) / SCALE_SCATTER
    weights = np.exp(-0.5 * off**2) + 1e-300
    weights /= weights.sum(axis=1, keepdims=True)
    levels = np.array([waveform.levels for waveform in group])
    top = levels.max()
    likely = (weights.reshape(len(size), len(group), -1) * np.exp(levels - top)[None]).sum(axis=2)
    place = np.interp(log_severity, at, np.arange(len(at)))
    nearness = np.maximum(1.0 - np.abs(place[:, None] - np.arange(len(at))[None, :]), 0.0)
    log_likelihood: FloatArray = np.log(np.maximum((nearness * likely).sum(axis=1), 1e-300)) + top
    return log_likelihood


def _log_sizes(group: Sequence[SimulatedWaveform]) -> tuple[FloatArray, FloatArray]:
    """Return ln of the simulated severities, and ln of the sidebands' sizes there."""
    return np.log([c.added.severity for c in group]), np.array([c.log_size for c in group])


def _straight(log_severity: FloatArray, shape: Sequence[SimulatedWaveform]) -> FloatArray:
    """Return ln of the sidebands' size over ln s, interpolated linearly and extrapolated."""
    at, size = _log_sizes(shape)
    if len(at) == 1:
        return np.asarray(size[0] + (log_severity - at[0]))
    log_size: FloatArray = np.interp(log_severity, at, size)
    slopes = np.diff(size) / np.diff(at)
    log_size += slopes[0] * np.minimum(log_severity - at[0], 0.0) + slopes[-1] * np.maximum(log_severity - at[-1], 0.0)
    return log_size


def _interval(severities: FloatArray, density: FloatArray) -> Interval:
    """Return median and 5th to 95th percentile; unbounded where an end of the range is as likely as any."""
    below = np.cumsum(density) / density.sum()
    low, value, high = (float(severities[int(np.searchsorted(below[:-1], q))]) for q in (0.05, 0.5, 0.95))
    as_likely = density >= _AS_LIKELY * density.max()
    return Interval(value, 0.0 if as_likely[0] else low, inf if as_likely[-1] else high)


def joined_waveforms(conditions: Sequence[Sequence[SimulatedWaveform]]) -> list[SimulatedWaveform]:
    """Return the settings of several conditions of one machine with ln L averaged, as they are strongly dependent.

    Parameters
    ----------
    conditions : sequence of sequences of SimulatedWaveform
        Settings of each condition; those missing in any of them are omitted.
    """
    by_setting: dict[tuple[float, tuple[tuple[str, float | str], ...]], list[SimulatedWaveform]] = {}
    for waveforms in conditions:
        for waveform in waveforms:
            by_setting.setdefault((waveform.added.severity, waveform.added.place), []).append(waveform)
    whole = [same for same in by_setting.values() if len(same) == len(conditions)]
    return [
        SimulatedWaveform(
            same[0].added,
            np.mean([waveform.levels for waveform in same], axis=0),
            float(np.mean([waveform.correlation for waveform in same])),
            float(np.mean([waveform.log_size for waveform in same])),
        )
        for same in whole
    ]
