"""What every search over one revolution shares: windows with the most energy, and turning one average onto another.

Two searches for the tooth that stands out use the windows, and differ for a reason. `analyze` adds the energy of the
whole difference signal, because its test against surrogates (same spectrum, random phases) needs a statistic of the
signal as it is. `estimate_crack` divides each band about a mesh harmonic by its own median first, because its
calibration was made so: what a resonance multiplies, it multiplies at all teeth.

Two alignments use the scores, and differ as well. `estimate_crack` and the gap diagnosis compare the same gears: they
try whole teeth, where a mark fixes the phase of the mesh, and only lines that tell teeth apart count. `compare` turns a
simulation of any gears onto a recording, by any angle, and mesh lines count, too.
"""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.spectra import ComplexArray


def sliding_mean(values: FloatArray, width: int) -> FloatArray:
    """Return the mean over the window that starts at each sample of a periodic signal.

    Parameters
    ----------
    values : array, (…, n)
        One period.
    width : int
        Of the window, in samples; n at most.

    Examples
    --------
    >>> sliding_mean(np.array([0.0, 2.0, 4.0, 6.0]), 2).tolist()
    [1.0, 3.0, 5.0, 3.0]
    """
    padded = np.concatenate([np.zeros((*values.shape[:-1], 1)), values, values[..., :width]], axis=-1).cumsum(axis=-1)
    mean: FloatArray = (padded[..., width:-1] - padded[..., : values.shape[-1]]) / width
    return mean


def strongest_window(energies: FloatArray) -> tuple[int, float]:
    """Return where the window with the most energy starts, and its energy over the median window's.

    Parameters
    ----------
    energies : array, (n,)
        Of the window that starts at each sample.
    """
    start = int(np.argmax(energies))
    return start, float(energies[start] / np.median(energies))


def turned_lines(lines: ComplexArray, shift_rev: float) -> ComplexArray:
    """Return the lines of an average turned forward: x[n] e^{−2πi n s}, order 0 first on the last axis."""
    turned: ComplexArray = lines * np.exp(-2j * np.pi * np.arange(lines.shape[-1]) * shift_rev)
    return turned


def shift_scores(cross: ComplexArray, shifts_rev: FloatArray) -> FloatArray:
    """Return Σ_n Re(c[n] e^{2πi n s}) for each shift s: how well averages agree when the second is turned by s.

    Parameters
    ----------
    cross : complex array, (n_orders,)
        Lines of the first times the conjugate lines of the second, weighted.
    shifts_rev : array, (n_shifts,)
    """
    scores: FloatArray = np.real(np.exp(2j * np.pi * np.outer(shifts_rev, np.arange(len(cross)))) @ cross)
    return scores
