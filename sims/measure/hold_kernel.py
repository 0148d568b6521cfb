"""Compiled bank of second-order filters, side by side."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def filter_bank(inputs, gains, b, a, out):  # type: ignore[no-untyped-def]
    """out[t] += Σ_m H_m applied to Σ_p gains[m, p] inputs[t, p].

    Transposed direct form II, from the steady state of the first input. The filters of a bank do not wait for each
    other, so that several run at the speed of one.

    `inputs` (n_steps, n_inputs), `gains` (n_filters, n_inputs), `b` (n_filters, 3), `a` (n_filters, 2) without the
    leading 1, `out` (n_steps,).
    """
    n_filters, n_inputs = gains.shape
    z1, z2 = np.zeros(n_filters), np.zeros(n_filters)
    for m in range(n_filters):
        x = 0.0
        for p in range(n_inputs):
            x += gains[m, p] * inputs[0, p]
        y = x * (b[m, 0] + b[m, 1] + b[m, 2]) / (1.0 + a[m, 0] + a[m, 1])
        z1[m] = y - b[m, 0] * x
        z2[m] = b[m, 2] * x - a[m, 1] * y
    for t in range(inputs.shape[0]):
        total = 0.0
        for m in range(n_filters):
            x = 0.0
            for p in range(n_inputs):
                x += gains[m, p] * inputs[t, p]
            y = b[m, 0] * x + z1[m]
            z1[m] = b[m, 1] * x - a[m, 0] * y + z2[m]
            z2[m] = b[m, 2] * x - a[m, 1] * y
            total += y
        out[t] += total
