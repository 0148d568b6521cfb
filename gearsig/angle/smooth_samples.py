"""Value and slope of a noisy, densely sampled quantity at sparse knots, by local parabolas."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray


def noise_of(x: FloatArray) -> float:
    """Standard deviation of the noise in a smooth quantity, from its third differences.

    A third difference of independent errors has 1 + 9 + 9 + 1 = 20 times their variance; a smooth course has almost
    none.
    """
    if len(x) < 8:
        return 0.0
    third = np.diff(x, 3)
    # The root mean square as well: in a staircase most differences are zero, and the median says nothing.
    spread = max(float(np.median(np.abs(third))) / 0.6745, float(np.sqrt(np.mean(np.square(third)))))
    return float(spread / np.sqrt(20.0))


def local_parabolas(x: FloatArray, half_width: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit parabolas over 2·half_width + 1 samples around knots every half_width samples.

    Returns
    -------
    positions, values, slopes : arrays, (n_knots,)
        In samples, in x's unit, and in x's unit per sample. The first and the last knot are the first and the last
        sample, read from the parabola next to them.

    Notes
    -----
    Source: A. Savitzky, M. J. E. Golay, *Smoothing and differentiation of data by simplified least squares
    procedures*, Anal. Chem. 36 (1964).
    """
    n, m = len(x), min(half_width, (len(x) - 1) // 2)
    j = np.arange(-m, m + 1, dtype=np.float64)
    basis = np.linalg.pinv(np.stack([np.ones_like(j), j, j * j], axis=1))
    centres = np.append(np.arange(m, n - m - 1, m), n - m - 1)
    # Values relative to the centre: an angle of thousands of revolutions would lose digits otherwise.
    windows = np.lib.stride_tricks.sliding_window_view(x, 2 * m + 1)[centres - m] - x[centres][:, None]
    a, b, c = basis @ windows.T
    positions = np.concatenate([[0.0], centres, [n - 1.0]])
    first, last = -float(m), float(m)
    values = np.concatenate(
        [
            [x[centres[0]] + a[0] + b[0] * first + c[0] * first**2],
            x[centres] + a,
            [x[centres[-1]] + a[-1] + b[-1] * last + c[-1] * last**2],
        ]
    )
    slopes = np.concatenate([[b[0] + 2 * c[0] * first], b, [b[-1] + 2 * c[-1] * last]])
    return positions, values, slopes
