"""Modes of a long signal as one answer: found block by block, joined, with what the seams say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.decompose.blocks import ModeStretch, modes_by_block
from gearsig.decompose.mode_checks import mode_notes
from gearsig.decompose.types import ModeAxis, Modes, VmdSettings
from gearsig.decompose.vmd import variational_modes

N_PER_BLOCK = 2**18
LARGE_MISMATCH = 0.5
"""Of a mode over a seam, from which on the reader is told."""


def long_modes(
    values: FloatArray,
    sampling_rate: float,
    settings: VmdSettings,
    *,
    n_per_block: int = N_PER_BLOCK,
    rng: np.random.Generator | None = None,
    axis: ModeAxis = "frequency",
    unit: str = "",
    source: str = "",
    shaft: str = "",
) -> Modes:
    """Return the modes of a signal of any length: of the whole, or block by block where it is longer than a block.

    Centres are c = Σ E_i c_i / Σ E_i over the blocks, E_i a mode's energy there, bandwidths
    √(Σ E_i (b_i² + (c_i - c)²) / Σ E_i): of a mode that wanders, how far it does counts as width.

    Parameters
    ----------
    values, sampling_rate, settings, rng, axis, unit, source, shaft
        As in `variational_modes`.
    n_per_block : int

    Returns
    -------
    Modes
        Of several blocks: `n_iterations` is their sum, `last_change` is nan, and `centre_history` has one row per
        block, then the centres. The notes say where a mode does not go on over a seam.

    Raises
    ------
    InputError, RefusalError
        As in `variational_modes` and `modes_by_block`.

    Notes
    -----
    Memory is that of the modes, 8 bytes per sample and mode, and of one block's solution.
    """
    if len(values) <= n_per_block:
        return variational_modes(
            values, sampling_rate, settings, rng=rng, axis=axis, unit=unit, source=source, shaft=shaft
        )
    waveforms: FloatArray = np.empty((settings.n_modes, len(values)))
    stretches: list[ModeStretch] = []
    energies = []
    for stretch in modes_by_block(values, sampling_rate, settings, n_per_block=n_per_block, rng=rng, axis=axis):
        waveforms[:, stretch.start : stretch.start + stretch.waveforms.shape[1]] = stretch.waveforms
        energies.append(np.square(stretch.waveforms).sum(axis=1))
        stretches.append(replace(stretch, waveforms=stretch.waveforms[:, :0].copy()))
    centres, bandwidths = _together(stretches, np.array(energies))
    history = np.array([stretch.centres for stretch in stretches] + [centres])
    converged = all(stretch.converged for stretch in stretches)
    notes = mode_notes(centres, sampling_rate, settings, converged=converged, axis=axis)
    return Modes(
        waveforms=waveforms,
        residual=np.asarray(values - waveforms.sum(axis=0)),
        centres=centres,
        bandwidths=bandwidths,
        axis=axis,
        sampling_rate=float(sampling_rate),
        n_iterations=sum(stretch.n_iterations for stretch in stretches),
        converged=converged,
        last_change=float("nan"),
        centre_history=history,
        settings=settings,
        unit=unit,
        source=source,
        shaft=shaft,
        notes=(*notes, *_seam_notes(stretches, sampling_rate, axis)),
    )


def _together(stretches: list[ModeStretch], energies: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return centres and bandwidths of all blocks, weighted by each mode's energy there."""
    share = energies / np.maximum(energies.sum(axis=0), np.finfo(np.float64).tiny)
    own = np.array([stretch.centres for stretch in stretches])
    widths = np.array([stretch.bandwidths for stretch in stretches])
    centres: FloatArray = (share * own).sum(axis=0)
    return centres, np.sqrt((share * (widths**2 + (own - centres) ** 2)).sum(axis=0))


def _seam_notes(stretches: list[ModeStretch], sampling_rate: float, axis: ModeAxis) -> tuple[str, ...]:
    mismatch = np.array([stretch.seam_mismatch for stretch in stretches])
    unit = "s" if axis == "frequency" else "revolutions"
    notes = []
    for k in np.flatnonzero(mismatch.max(axis=0) > LARGE_MISMATCH):
        i = int(np.argmax(mismatch[:, k]))
        notes.append(
            f"Mode {k + 1} does not go on over the seam at {stretches[i].start / sampling_rate:.4g} {unit}: both "
            f"blocks' modes differ there by {100 * mismatch[i, k]:.0f} % of their own."
        )
    return tuple(notes)
