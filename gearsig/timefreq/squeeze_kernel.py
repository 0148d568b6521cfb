"""Compiled reassignment of coefficients to their momentary frequency; no state, the interpreter is released."""

from __future__ import annotations

from numba import njit


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def squeeze(W, dW, weights, smallest, borders, lookup, T, first):  # type: ignore[no-untyped-def]
    """T[l, first + t] += weights[j] W[j, t], l being the line whose borders hold the momentary frequency.

    ω̂ = Im(W' / W), in the unit of `borders` (n_lines + 1, increasing). `lookup` gives the line at the left end of each
    of its equal cells between the outermost borders. Coefficients with |W|² <= `smallest` have no frequency.
    """
    n_lines = T.shape[0]
    bottom, top = borders[0], borders[n_lines]
    per_cell = lookup.shape[0] / (top - bottom)
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            a, b = W[j, t].real, W[j, t].imag
            power = a * a + b * b
            if power <= smallest:
                continue
            omega = (dW[j, t].imag * a - dW[j, t].real * b) / power
            if omega < bottom or omega >= top:
                continue
            line = lookup[int((omega - bottom) * per_cell)]
            while omega >= borders[line + 1]:
                line += 1
            T[line, first + t] += weights[j] * W[j, t]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def gather_near(W, dW, weight, smallest, low, high, out):  # type: ignore[no-untyped-def]
    """out[t] += weight · W[j, t] wherever low[t] <= ω̂ <= high[t]."""
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            a, b = W[j, t].real, W[j, t].imag
            power = a * a + b * b
            if power <= smallest:
                continue
            omega = (dW[j, t].imag * a - dW[j, t].real * b) / power
            if low[t] <= omega <= high[t]:
                out[t] += weight * W[j, t]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def gather_lines(W, omegas, weight, low, high, out):  # type: ignore[no-untyped-def]
    """out[t] += weight · W[j, t] wherever low[t] <= omegas[j] <= high[t]."""
    for j in range(W.shape[0]):
        for t in range(W.shape[1]):
            if low[t] <= omegas[j] <= high[t]:
                out[t] += weight * W[j, t]
