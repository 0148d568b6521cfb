"""Whether a simulated tooth fault changes the vibration as the recorded one did: as a waveform, not by its energy.

A crack, a spall and a chip of one tooth put as much energy beside the mesh harmonics as each other, with another course
over the engagement. That course is in the complex sidebands of the difference from the healthy machine. Each is taken
relative to the mesh line between them, u_k[i] = D[k z + i]/Y[k z]: that cancels a path that is smooth about a harmonic,
and where the shaft's angle begins, but for a turn by one angle, u → u exp(−jiφ).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap._change import lines_of_shaft, turned_difference
from gearsig.gap._features import SIDES
from gearsig.gap._reduction import ComplexArray, ReducedRecording

N_HARMONICS = 8
OFFSETS = np.array([*range(-12, -2), *range(3, 13)])
"""Orders beside a mesh harmonic: nearer lie the modulations of shafts, further what the next harmonic has."""

INDEPENDENT_LINES = 10
"""Of all sidebands: they are smooth over order, and harmonics share the engagement. Chosen by reasoning, not fitted."""

SCALE_SCATTER = 0.7
"""Of ln g: a twin that shows the course of a fault rightly may show it twice as strong or weak, as its mesh lines."""

GOOD = 0.6
"""Correlation from which a twin is believed to show the course of a fault; others reach 0.1 to 0.35."""

_N_TURNS = 1024
_SHIFT_PITCHES = 0.01


def mesh_sidebands(now: ReducedRecording, healthy: ReducedRecording, *, is_turned: bool) -> ComplexArray:
    """Return u, (n_channels, 2, N_HARMONICS, n_offsets); 0 where a harmonic lies above what was sampled.

    Parameters
    ----------
    now, healthy : ReducedRecording
        With the same channels.
    is_turned : bool
        Whether the shafts' angles begin elsewhere in the healthy recording; of two runs of a simulation they do not.
    """
    found = np.zeros((len(now.channels), len(SIDES), N_HARMONICS, len(OFFSETS)), dtype=np.complex128)
    for side in range(len(SIDES)):
        here = lines_of_shaft(now, side)
        if is_turned:
            difference = turned_difference(now, healthy, side)[0].lines
        else:
            before = lines_of_shaft(healthy, side).lines
            n = min(here.lines.shape[1], before.shape[1])
            difference = here.lines[:, :n] - before[:, :n]
        for k in range(1, N_HARMONICS + 1):
            mesh = k * here.teeth
            if mesh + OFFSETS[-1] >= difference.shape[1]:
                break
            carrier = here.lines[:, mesh] - difference[:, mesh]
            there = carrier != 0.0
            found[there, side, k - 1] = difference[there][:, mesh + OFFSETS] / carrier[there, None]
    return found


def sideband_weights(now: ReducedRecording, healthy: ReducedRecording, observed: ComplexArray) -> FloatArray:
    """Return what each harmonic counts, w = (E − n)₊/E², (n_channels, 2, N_HARMONICS), E = Σ_i |u|², n the noise in it.

    All that stand out of the noise count alike, whatever their level; what is noise counts nothing.

    Parameters
    ----------
    now, healthy : ReducedRecording
    observed : array, (n_channels, 2, N_HARMONICS, n_offsets)
        See `mesh_sidebands`.
    """
    energy = np.sum(np.abs(observed) ** 2, axis=-1)
    weights = np.zeros(energy.shape)
    for side in range(len(SIDES)):
        pairs = zip(now.averages(side), healthy.averages(side), strict=True)
        for channel, (here, before) in enumerate(pairs):
            for k in range(N_HARMONICS):
                mesh = (k + 1) * now.frame.teeth[side]
                if energy[channel, side, k] == 0.0:
                    continue
                noise = float(np.sum(here.noise[mesh + OFFSETS] + before.noise[mesh + OFFSETS]))
                noise /= float(np.abs(before.lines[mesh]) ** 2)
                weights[channel, side, k] = max(energy[channel, side, k] - noise, 0.0) / energy[channel, side, k] ** 2
    return weights


@dataclass(frozen=True)
class WaveformMatch:
    """How well the simulated course of a fault matches the recorded one.

    Parameters
    ----------
    correlation : float
        ρ, 0 to 1, at the likeliest severity and the turn at which it is largest.
    scale : float
        g, by which the simulation is to be multiplied there. Flanks that deviate from the drawing make the mesh lines
        larger or smaller, which the twin does not know: it says little of the severity.
    log_likelihood : float
        See `waveform_log_likelihood`; near 0 of a twin that resembles nothing.
    gear : str
        "driver" or "driven"; empty: not told.
    """

    correlation: float
    scale: float
    log_likelihood: float
    gear: str = ""

    @property
    def is_good(self) -> bool:
        """Whether the twin shows the course of the fault well enough to tell which it is, and on which gear."""
        return self.correlation >= GOOD


def waveform_log_likelihood(correlation: float, scale: float) -> float:
    """Return ln L = −(N/2) ln(1 − ρ²) − ρ² (ln g)²/(2 s²).

    Parameters
    ----------
    correlation, scale : float
        ρ and g, see `WaveformMatch`.
    """
    squared = min(correlation**2, 0.999)
    if squared == 0.0 or scale <= 0.0:
        return 0.0
    return -0.5 * INDEPENDENT_LINES * log(1.0 - squared) - 0.5 * squared * (log(scale) / SCALE_SCATTER) ** 2


def best_match(
    observed: ComplexArray, weights: FloatArray, simulated: Sequence[ComplexArray], *, moves_pitches: float = 0.0
) -> WaveformMatch | None:
    """Return the match of the likeliest simulation; None where nothing was observed or simulated.

    ρ = max_φ Re Σ w o* t_δ exp(−jiφ)/√(Σ w |o|² Σ w |t|²), t_δ[k, i] = t[k, i] exp(−2πjkδ) a fault that comes δ pitches
    later in the engagement. The likelihood is the mean over δ: a fault that may lie anywhere must not win by that.

    Parameters
    ----------
    observed : array, (n_channels, n_harmonics, n_offsets)
    weights : array, (n_channels, n_harmonics)
        See `sideband_weights`.
    simulated : sequence of arrays, as `observed`
        One per severity.
    moves_pitches : float
        The largest |δ|.
    """
    weights = weights[..., None]
    whole = float(np.sum(weights * np.abs(observed) ** 2))
    if whole == 0.0:
        return None
    turns = np.exp(-1j * np.outer(OFFSETS, 2.0 * np.pi * np.arange(_N_TURNS) / _N_TURNS))
    n = round(moves_pitches / _SHIFT_PITCHES)
    later = np.exp(-2j * np.pi * np.outer(np.arange(-n, n + 1) * _SHIFT_PITCHES, np.arange(1, observed.shape[1] + 1)))
    found = []
    for trial in simulated:
        own = float(np.sum(weights * np.abs(trial) ** 2))
        if own == 0.0:
            continue
        products = later @ np.sum(weights * np.conj(observed) * trial, axis=0)
        in_phase = np.maximum(np.max(np.real(products @ turns), axis=1), 0.0)
        levels = [waveform_log_likelihood(level / (whole * own) ** 0.5, level / own) for level in in_phase.tolist()]
        best = int(np.argmax(levels))
        mean = levels[best] + log(float(np.mean(np.exp(np.array(levels) - levels[best]))))
        found.append(WaveformMatch(float(in_phase[best] / (whole * own) ** 0.5), float(in_phase[best] / own), mean))
    return max(found, key=lambda match: match.log_likelihood, default=None)
