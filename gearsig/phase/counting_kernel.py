"""Joint histograms of a signal and its delayed self."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def mutual_information(bins, n_bins, delays, out):  # type: ignore[no-untyped-def]
    """out[k] = Σ p(i, j) ln(p(i, j) / (p(i) p(j))) of bins[t], bins[t + delays[k]], less its bias.

    Counting alone makes the estimate too large by (filled cells - filled rows - filled columns + 1) / 2N.

    Source of the correction: M. S. Roulston, *Estimating the errors on measured entropy and mutual information*,
    Physica D 125 (1999).
    """
    joint = np.empty((n_bins, n_bins), dtype=np.int64)
    for k in range(delays.shape[0]):
        n = bins.shape[0] - delays[k]
        joint[:] = 0
        for t in range(n):
            joint[bins[t], bins[t + delays[k]]] += 1
        rows, columns = joint.sum(axis=1), joint.sum(axis=0)
        total, filled = 0.0, 0
        for i in range(n_bins):
            for j in range(n_bins):
                c = joint[i, j]
                if c > 0:
                    filled += 1
                    total += c * np.log(c * float(n) / (float(rows[i]) * float(columns[j])))
        bias = (filled - np.count_nonzero(rows) - np.count_nonzero(columns) + 1) / (2.0 * n)
        out[k] = max(total / n - bias, 0.0)
