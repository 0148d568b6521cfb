"""Where a peak lies between samples."""

from __future__ import annotations

from typing import Any

import numpy as np


def parabola_vertex(before: Any, middle: Any, after: Any) -> tuple[Any, Any]:
    """Return the vertex of the parabola through three equally spaced values a, b, c, of which the middle is a peak.

    Its place is p = ½ (a − c)/(a − 2b + c) steps from the middle, its height b − ¼ (a − c) p. Through logarithms of
    magnitudes it is exact for a Gaussian window, and off by some per cent of a line for a Hann window.

    Parameters
    ----------
    before, middle, after : float or array
        Of equal shapes. Give logarithms of spectral lines.

    Returns
    -------
    offset, height : float or array
        The offset is cut to half a step; zero where the three do not bend down.

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
    # Not np.clip, which Numba has for arrays alone: kernels take this function for single lines.
    offset = np.where(bend < 0, np.minimum(np.maximum(0.5 * (before - after) / bent, -0.5), 0.5), 0.0)
    return offset, middle - 0.25 * (before - after) * offset
