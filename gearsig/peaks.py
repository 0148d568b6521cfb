"""Interpolation of peaks between samples."""

from __future__ import annotations

from typing import Any

import numpy as np


def parabola_vertex(before: Any, middle: Any, after: Any) -> tuple[Any, Any]:
    """Return the vertex of the parabola through three equally spaced values a, b, c whose middle one is a peak.

    It lies p = ½ (a − c)/(a − 2b + c) steps from the middle and has the height b − ¼ (a − c) p. For logarithms of
    magnitudes it is exact with a Gaussian window, and off by a few per cent of a line with a Hann window.

    Parameters
    ----------
    before, middle, after : float or array
        Of equal shapes. For spectra, give logarithms of the lines.

    Returns
    -------
    offset, height : float or array
        The offset is limited to half a step, and zero where the parabola does not open downwards.

    References
    ----------
    J. O. Smith, X. Serra, "PARSHL: An analysis/synthesis program for non-harmonic sounds based on a sinusoidal
    representation", 1987, section "Peak detection".

    Examples
    --------
    >>> offset, height = parabola_vertex(3.0, 4.0, 4.0)
    >>> float(offset), float(height)
    (0.5, 4.125)
    """
    bend = before - 2 * middle + after
    bent = np.where(bend < 0, bend, -1.0)
    # Not np.clip, which Numba supports for arrays only: kernels use this function for single lines.
    offset = np.where(bend < 0, np.minimum(np.maximum(0.5 * (before - after) / bent, -0.5), 0.5), 0.0)
    return offset, middle - 0.25 * (before - after) * offset
