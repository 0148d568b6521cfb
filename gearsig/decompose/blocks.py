"""Modes of long signals, block by block, with the seams told."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, positive, within
from gearsig.decompose.types import ModeAxis, VmdSettings
from gearsig.decompose.vmd import variational_modes
from gearsig.errors import InputError
from gearsig.spectra.blocks import checked_signal

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
