"""Modes of signals of any length: of the whole, or block by block, joined, with what the seams say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count, within
from gearsig.decompose._types import ModeAxis, Modes, VmdEngine, VmdSettings, mode_notes
from gearsig.decompose._vmd import modes_of_whole
from gearsig.formatting import percent
from gearsig.timefreq import Source, UniformSignal, uniform

IndexArray = NDArray[np.intp]

N_PER_BLOCK = 2**18
_LARGE_MISMATCH = 0.5
"""Of a mode over a seam, from which on the reader is told."""


def vmd(
    signal: Source,
    channel: str | float | None,
    settings: VmdSettings | int,
    *,
    engine: VmdEngine | None = None,
    n_per_block: int = N_PER_BLOCK,
    rng: np.random.Generator | None = None,
) -> Modes:
    """Return the variational modes of a signal: each most compact around a centre frequency, together they fit it.

    min Σ_k α ‖∂_t [(δ + j/πt) * u_k] e^(-jω_k t)‖² + ‖f - Σ_k u_k‖², solved by alternating Wiener filters
    û_k = (f̂ - Σ_{i≠k} û_i - λ̂/2) / (1 + α (ω - ω_k)²) and centroids ω_k of |û_k|².

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        Not constant; at least 4 samples per mode. Over angle, centres and bandwidths are orders: at variable speed an
        order stays one narrow mode, where over time it would be smeared.
    channel : str, float or None
        None: the only channel there is. Of an array its sampling rate in Hz.
    settings : VmdSettings or int
        An int is the number of modes, with everything else as usual; `suggest_modes` finds it.
    engine : str or None
        "gearsig" or "vmdpy", in place of that of the settings.
    n_per_block : int
        A longer signal is taken block by block, see `modes_by_block`.
    rng : numpy.random.Generator or None
        Needed for `start="random"` only.

    Returns
    -------
    Modes
        In the signal's unit; computed in double precision whatever the input's. Of several blocks: centres are
        c = Σ E_i c_i / Σ E_i, E_i a mode's energy in block i, and bandwidths √(Σ E_i (b_i² + (c_i - c)²) / Σ E_i), so
        that how far a mode wanders counts as width; `n_iterations` is the sum, `last_change` is nan, and
        `centre_history` has one row per block, then the centres. The notes say where a mode does not go on over a seam.

    Raises
    ------
    InputError
        On NaN, a constant, too few samples for the number of modes, start frequencies outside the spectrum.
    RefusalError
        If a mode stays empty: the signal does not hold that many.

    Notes
    -----
    The signal is mirrored at both ends, by half its length in the reference programs; that length does not matter, as
    mirroring makes the signal periodic. For even lengths the result is that of vmdpy 0.2 within rounding, with two of
    its habits: it returns the modes before the last iteration, and it fills the line at half the sampling rate, where a
    mirrored signal has nothing, with its neighbour's value (an alternating ±|û|/2n, mostly invisible). vmdpy drops
    the last sample of an odd length; here all samples are kept, and the line at half the sampling rate is empty.

    Memory is 8 bytes per sample and mode, and about four times that of one block.

    When not to use it: for broad-band impulses, whose spectrum is no narrow band (take their envelope, or a band);
    for speeds that vary by more than a mode's width (resample over angle first).

    References
    ----------
    K. Dragomiretskiy and D. Zosso, "Variational mode decomposition", 2014.

    Examples
    --------
    >>> t = np.arange(2000) / 1000.0
    >>> x = np.cos(2 * np.pi * 50 * t) + 0.5 * np.cos(2 * np.pi * 200 * t)
    >>> vmd(x, 1000.0, 2, engine="vmdpy").centres.round(1)
    array([ 50., 200.])
    """
    x = uniform(signal, channel)
    chosen = settings if isinstance(settings, VmdSettings) else VmdSettings(settings)
    if engine is not None:
        chosen = replace(chosen, engine=engine)
    if x.n_samples <= n_per_block:
        return modes_of_whole(x, chosen, rng)
    waveforms: FloatArray = np.empty((chosen.n_modes, x.n_samples))
    segments: list[ModeSegment] = []
    energies = []
    for segment in modes_by_block(x, None, chosen, n_per_block=n_per_block, rng=rng):
        waveforms[:, segment.start : segment.start + segment.waveforms.shape[1]] = segment.waveforms
        energies.append(np.square(segment.waveforms).sum(axis=1))
        segments.append(replace(segment, waveforms=segment.waveforms[:, :0].copy()))
    centres, bandwidths = _together(segments, np.array(energies))
    converged = all(segment.converged for segment in segments)
    notes = mode_notes(centres, x.rate, chosen, converged=converged, axis=x.axis)
    return Modes(
        waveforms=waveforms,
        residual=np.asarray(x.values - waveforms.sum(axis=0)),
        centres=centres,
        bandwidths=bandwidths,
        axis=x.axis,
        sampling_rate=float(x.rate),
        n_iterations=sum(segment.n_iterations for segment in segments),
        converged=converged,
        last_change=float("nan"),
        centre_history=np.array([segment.centres for segment in segments] + [centres]),
        settings=chosen,
        unit=x.unit,
        source=f"{x.source} over angle" if x.axis == "order" else x.source,
        shaft=x.shaft,
        notes=(*notes, *_seam_notes(segments, x.rate, x.axis)),
    )


@dataclass(frozen=True)
class ModeSegment:
    """A finished segment of all modes.

    Parameters
    ----------
    start : int
        Index of its first sample in the signal.
    waveforms : array, (n_modes, n_samples)
        Mode k continues mode k of the segment before.
    centres, bandwidths : arrays, (n_modes,)
        Of the block it comes from, in Hz or orders.
    n_fade : int
        Samples at its begin over which it was faded in from the block before: the seam.
    seam_mismatch : array, (n_modes,)
        Root mean square difference of both blocks' modes over the seam, over the modes' own there; 0 for the first
        segment. Small: the mode goes on. Near 1 or above: it is another one from here on.
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
    signal: Source,
    channel: str | float | None,
    settings: VmdSettings,
    *,
    n_per_block: int = N_PER_BLOCK,
    overlap: float = 0.125,
    rng: np.random.Generator | None = None,
) -> Iterator[ModeSegment]:
    """Yield the modes of a long signal segment by segment; memory is bounded by the block.

    Equal blocks cover the signal. Each starts from the centres of the one before, its modes are paired with that one's
    by least squares over the common samples, and a raised cosine in the middle of those fades one block into the next.
    Segments join without gap; the residual is the signal less their sum.

    Parameters
    ----------
    signal, channel, settings, rng
        As in `vmd`; an array may be a memory map.
    n_per_block : int
        A shorter signal is one block. A block's modes may follow slow changes of frequency.
    overlap : float
        Length of the seam over that of the block, above 0 to 1/3.

    Raises
    ------
    InputError
        As in `vmd`, of each block: a constant segment as long as a block has no modes.

    Notes
    -----
    The blocks' modes differ from the whole signal's: each block has centres of its own.
    """
    x = uniform(signal, channel)
    n_block = min(count(n_per_block, "n_per_block", minimum=64), x.n_samples)
    n_fade = max(1, int(within(overlap, "overlap", 1e-3, 1 / 3) * n_block))
    starts = _starts(x.n_samples, n_block, n_fade)
    return _segments(x, settings, starts, n_block, n_fade, rng)


def _starts(n: int, n_block: int, n_fade: int) -> list[int]:
    """Return the blocks' first samples: equal steps, the last block ends with the signal."""
    n_blocks = 1 + -(-(n - n_block) // (n_block - n_fade))
    return [round(i * (n - n_block) / max(1, n_blocks - 1)) for i in range(n_blocks)]


def _segments(
    x: UniformSignal,
    settings: VmdSettings,
    starts: list[int],
    n_block: int,
    n_fade: int,
    rng: np.random.Generator | None,
) -> Iterator[ModeSegment]:
    rising = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_fade) + 0.5) / n_fade)
    previous: FloatArray = np.zeros((settings.n_modes, 0))
    mismatch: FloatArray = np.zeros(settings.n_modes)
    done = 0
    for start, following in zip(starts, [*starts[1:], None], strict=True):
        modes = modes_of_whole(replace(x, values=x.values[start : start + n_block]), settings, rng)
        order = _continuation(previous, modes.waveforms, fixed_first=settings.zero_mode)
        waveforms, centres = modes.waveforms[order], modes.centres[order]
        if start:
            mismatch = _mismatch(previous, waveforms[:, : previous.shape[1]])
            seam = slice(done - start, done - start + n_fade)
            waveforms[:, seam] = rising * waveforms[:, seam] + (1.0 - rising) * previous[:, seam]
        stop = start + n_block
        # The seam lies in the middle of what two blocks share; from its begin on, the samples are the next block's.
        end = stop if following is None else (following + stop - n_fade) // 2
        yield ModeSegment(
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
    level = np.sqrt(0.5 * (np.square(previous).sum(axis=1) + np.square(following).sum(axis=1)))
    return np.asarray(difference / np.where(level > 0.0, level, 1.0))


def _together(segments: list[ModeSegment], energies: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return centres and bandwidths of all blocks, weighted by each mode's energy there."""
    share = energies / np.maximum(energies.sum(axis=0), np.finfo(np.float64).tiny)
    centres_of = np.array([segment.centres for segment in segments])
    widths = np.array([segment.bandwidths for segment in segments])
    centres: FloatArray = (share * centres_of).sum(axis=0)
    return centres, np.sqrt((share * (widths**2 + (centres_of - centres) ** 2)).sum(axis=0))


def _seam_notes(segments: list[ModeSegment], sampling_rate: float, axis: ModeAxis) -> tuple[str, ...]:
    mismatch = np.array([segment.seam_mismatch for segment in segments])
    unit = "s" if axis == "frequency" else "revolutions"
    notes = []
    for k in np.flatnonzero(mismatch.max(axis=0) > _LARGE_MISMATCH):
        i = int(np.argmax(mismatch[:, k]))
        notes.append(
            f"Mode {k + 1} does not go on over the seam at {segments[i].start / sampling_rate:.4g} {unit}: both "
            f"blocks' modes differ there by {percent(mismatch[i, k])} of their own."
        )
    return tuple(notes)
