"""Modes of a long signal as one answer: found block by block, joined, with what the seams say."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, positive, within
from gearsig.decompose._types import ModeAxis, Modes, VmdSettings, mode_notes
from gearsig.decompose._vmd import variational_modes
from gearsig.errors import InputError
from gearsig.spectra import checked_signal

# --------------------
# Modes of long signals, block by block, with the seams told.
# --------------------


IndexArray = NDArray[np.intp]


@dataclass(frozen=True)
class ModeStretch:
    """A finished stretch of all modes.

    Parameters
    ----------
    start : int
        Index of its first sample in the signal.
    waveforms : array, (n_modes, n_samples)
        Mode k continues mode k of the stretch before.
    centres, bandwidths : arrays, (n_modes,)
        Of the block it comes from, in Hz or orders.
    n_fade : int
        Samples at its begin over which it was faded in from the block before: the seam.
    seam_mismatch : array, (n_modes,)
        Root mean square difference of both blocks' modes over the seam, over the modes' own there; 0 for the first
        stretch. Small: the mode goes on. Near 1 or above: it is another one from here on.
    converged : bool
    n_iterations : int
    """

    start: int
    waveforms: FloatArray
    centres: FloatArray
    bandwidths: FloatArray
    n_fade: int
    seam_mismatch: FloatArray
    converged: bool
    n_iterations: int = 0


def modes_by_block(
    values: FloatArray,
    sampling_rate: float,
    settings: VmdSettings,
    *,
    n_per_block: int = 2**18,
    overlap: float = 0.125,
    rng: np.random.Generator | None = None,
    axis: ModeAxis = "frequency",
) -> Iterator[ModeStretch]:
    """Yield the modes of a long signal stretch by stretch; memory is bounded by the block.

    Equal blocks cover the signal. Each starts from the centres of the one before, its modes are paired with that one's
    by least squares over the common samples, and a raised cosine in the middle of those fades one block into the next.
    Stretches join without gap; the residual is the signal less their sum.

    Parameters
    ----------
    values : array, (n_samples,)
        May be a memory map.
    sampling_rate, settings, rng, axis
        As in `variational_modes`.
    n_per_block : int
        A shorter signal is one block. A block's modes may follow slow changes of frequency.
    overlap : float
        Length of the seam over that of the block, above 0 to 1/3.

    Raises
    ------
    InputError
        As in `variational_modes`, of each block: a constant stretch as long as a block has no modes.

    Notes
    -----
    The blocks' modes differ from the whole signal's: each block has centres of its own.
    """
    x = checked_signal(values, minimum=8)
    fs = positive(sampling_rate, "sampling_rate")
    n_block = min(count(n_per_block, "n_per_block", minimum=64), len(x))
    n_fade = max(1, int(within(overlap, "overlap", 1e-3, 1 / 3) * n_block))
    starts = _starts(len(x), n_block, n_fade)
    return _stretches(x, fs, settings, starts, n_block, n_fade, rng, axis)


def joined(stretches: Iterable[ModeStretch]) -> FloatArray:
    """Return the waveforms of consecutive stretches in one array, (n_modes, n_samples)."""
    parts = [stretch.waveforms for stretch in stretches]
    if not parts:
        raise InputError("there are no stretches", where="stretches", remedy="give those of modes_by_block")
    return np.concatenate(parts, axis=1)


def _starts(n: int, n_block: int, n_fade: int) -> list[int]:
    """Return the blocks' first samples: equal steps, the last block ends with the signal."""
    n_blocks = 1 + -(-(n - n_block) // (n_block - n_fade))
    return [round(i * (n - n_block) / max(1, n_blocks - 1)) for i in range(n_blocks)]


def _stretches(
    x: FloatArray,
    fs: float,
    settings: VmdSettings,
    starts: list[int],
    n_block: int,
    n_fade: int,
    rng: np.random.Generator | None,
    axis: ModeAxis,
) -> Iterator[ModeStretch]:
    rising = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_fade) + 0.5) / n_fade)
    previous: FloatArray = np.zeros((settings.n_modes, 0))
    mismatch: FloatArray = np.zeros(settings.n_modes)
    done = 0
    for start, following in zip(starts, [*starts[1:], None], strict=True):
        modes = variational_modes(x[start : start + n_block], fs, settings, rng=rng, axis=axis)
        order = _continuation(previous, modes.waveforms, fixed_first=settings.zero_mode)
        waveforms, centres = modes.waveforms[order], modes.centres[order]
        if start:
            mismatch = _mismatch(previous, waveforms[:, : previous.shape[1]])
            seam = slice(done - start, done - start + n_fade)
            waveforms[:, seam] = rising * waveforms[:, seam] + (1.0 - rising) * previous[:, seam]
        stop = start + n_block
        # The seam lies in the middle of what two blocks share; from its begin on, the samples are the next block's.
        end = stop if following is None else (following + stop - n_fade) // 2
        yield ModeStretch(
            start=done,
            waveforms=waveforms[:, done - start : end - start],
            centres=centres,
            bandwidths=modes.bandwidths[order],
            n_fade=n_fade if start else 0,
            seam_mismatch=mismatch,
            converged=modes.converged,
            n_iterations=modes.n_iterations,
        )
        if following is not None:
            previous, done = waveforms[:, following - start :].copy(), end
            settings = replace(settings, start=tuple(centres.tolist()))


def _continuation(previous: FloatArray, waveforms: FloatArray, *, fixed_first: bool) -> IndexArray:
    """Return the order of modes in which they continue the previous block's over the common samples."""
    from scipy.optimize import linear_sum_assignment

    # The least sum of squared differences is the largest sum of products: the squares alone do not hang on the order.
    likeness = previous @ waveforms[:, : previous.shape[1]].T
    if fixed_first:
        likeness[0, 1:] = likeness[1:, 0] = -np.inf
    return np.asarray(linear_sum_assignment(likeness, maximize=True)[1])


def _mismatch(previous: FloatArray, following: FloatArray) -> FloatArray:
    difference = np.linalg.norm(previous - following, axis=1)
    own = np.sqrt(0.5 * (np.square(previous).sum(axis=1) + np.square(following).sum(axis=1)))
    return np.asarray(difference / np.where(own > 0.0, own, 1.0))


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
