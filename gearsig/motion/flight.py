"""The flight of the flanks through the play: a parabola, and the speed at which it meets a flank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray

LONGEST_S = 3e-3
"""Next to the flank: further away, a valve that moves or a friction that turns has changed the acceleration."""
MOST_SAMPLES = 60


@dataclass(frozen=True)
class FlightFit:
    """q(t) = c0 + c1 t + c2 t² near one end of a flight, t from `origin_s`."""

    origin_s: float
    coefficients: tuple[float, float, float]

    def rate(self, time_s: float) -> float:
        """Compression rate."""
        _, c1, c2 = self.coefficients
        return c1 + 2.0 * c2 * (time_s - self.origin_s)

    def crossing(self, level_m: float, low_s: float, high_s: float) -> float:
        """Time at which the parabola reaches a level within two times; their nearer end where it does not."""
        c0, c1, c2 = self.coefficients
        roots = np.roots([c2, c1, c0 - level_m]) if c2 else np.array([(level_m - c0) / c1 if c1 else np.nan])
        times = roots[np.isreal(roots)].real + self.origin_s
        inside = times[(times >= low_s) & (times <= high_s)]
        if len(inside):
            return float(inside[0])
        ends = np.array([low_s, high_s])
        t = ends - self.origin_s
        return float(ends[np.argmin(np.abs(c0 + c1 * t + c2 * t**2 - level_m))])


def fit_flight(
    compression_m: FloatArray,
    rate_mps: FloatArray | None,
    first: int,
    last: int,
    sampling_rate_hz: float,
    scatter: tuple[float, float],
    *,
    at_end: bool,
) -> FlightFit:
    """Fit a parabola to the samples of a flight next to its end, or its beginning.

    Motor, brake and friction are constant over so few milliseconds, so that the flanks move towards each other at a
    constant acceleration.

    Parameters
    ----------
    compression_m : array
    rate_mps : array or None
        Measured by itself; None: derived from the compression, and of no use of its own so near to a blow.
    first, last : int
        Samples of the flight; the last is not in it.
    sampling_rate_hz : float
    scatter : (float, float)
        Standard deviations of compression and rate.
    at_end : bool
    """
    most = int(np.clip(round(LONGEST_S * sampling_rate_hz), 3, MOST_SAMPLES))
    chosen = np.arange(max(first, last - most), last) if at_end else np.arange(first, min(last, first + most))
    t = (chosen - chosen[0]) / sampling_rate_hz
    rows = [np.stack([np.ones_like(t), t, t**2], axis=1) / max(scatter[0], 1e-12)]
    values = [compression_m[chosen] / max(scatter[0], 1e-12)]
    if rate_mps is not None:
        rows.append(np.stack([np.zeros_like(t), np.ones_like(t), 2.0 * t], axis=1) / max(scatter[1], 1e-9))
        values.append(rate_mps[chosen] / max(scatter[1], 1e-9))
    design = np.vstack(rows)
    n_terms = min(3, len(design))
    x, *_ = np.linalg.lstsq(design[:, :n_terms], np.concatenate(values), rcond=None)
    c0, c1, c2 = np.concatenate([x, np.zeros(3 - n_terms)])
    return FlightFit(float(chosen[0]) / sampling_rate_hz, (float(c0), float(c1), float(c2)))
