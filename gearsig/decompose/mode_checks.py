"""What a signal must bring for a number of modes, and what to tell the reader of the modes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gearsig.checks import FloatArray
from gearsig.decompose.types import ModeAxis, VmdSettings
from gearsig.errors import InputError

SAMPLES_PER_MODE = 4
"""A signal of n samples has n lines; with fewer than four each, a mode has no bandwidth to speak of."""


def check_supported(x: FloatArray, n_modes: int) -> None:
    """Raise where `x` is constant or too short for `n_modes`."""
    if len(x) < SAMPLES_PER_MODE * n_modes:
        raise InputError(
            f"n_modes is {n_modes} for {len(x)} samples",
            allowed=f"1 to {len(x) // SAMPLES_PER_MODE}",
            remedy="ask for fewer modes or take a longer signal",
        )
    if float(x.min()) == float(x.max()):
        raise InputError(
            f"the signal is constant ({float(x[0]):g})",
            where="values",
            allowed="a signal that varies",
            remedy="check the channel: it may be dead or not connected",
        )


def half_gain_distance(penalty: float, sampling_rate: float) -> float:
    """Return the distance from its centre at which a mode's gain is one half: sampling rate / √penalty."""
    return float(sampling_rate / np.sqrt(penalty))


def mode_notes(
    centres: FloatArray, sampling_rate: float, settings: VmdSettings, *, converged: bool, axis: ModeAxis
) -> tuple[str, ...]:
    """Return what the reader must know: no convergence, modes that share the same lines."""
    notes = []
    if not converged:
        notes.append(
            f"Not converged in {settings.max_iterations} iterations: raise max_iterations, or choose fewer modes or a "
            "larger tolerance."
        )
    reach = half_gain_distance(settings.penalty, sampling_rate)
    order = np.argsort(centres, kind="stable")
    unit = "Hz" if axis == "frequency" else "orders"
    for i, j in pairwise(order):
        gap = float(centres[j] - centres[i])
        if gap < reach:
            notes.append(
                f"Modes {i + 1} and {j + 1} share the same lines: their centres are {gap:.3g} {unit} apart, and each "
                f"has half its gain at {reach:.3g} {unit}. Take fewer modes or a larger penalty."
            )
    return tuple(notes)
