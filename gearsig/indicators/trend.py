"""Gear indicators that compare with earlier records of the same gear: NA4, NA4*, NB4, NB4*.

Each is a fourth moment of the present record over a variance that includes earlier records, so that it goes on rising
when damage grows, where a plain kurtosis would fall back. With no history NA4 is the kurtosis of the residual.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.indicators.moments import is_constant
from gearsig.orders.types import SynchronousAverage


def na4(residual: SynchronousAverage, history: Sequence[SynchronousAverage] = ()) -> float:
    """Fourth moment of the residual over the square of its variance averaged over all records so far.

    NA4 = (1/N) Σ_i (r_i - r̄)⁴ / ( (1/M) Σ_{j=1}^{M} v_j )², v_j the variance of record j's residual, M counting the
    present record.

    Parameters
    ----------
    residual : SynchronousAverage
        The present record's, of kind "residual".
    history : sequence of SynchronousAverage
        Residuals of earlier records, same gear, speed and load, in any order.

    Returns
    -------
    float
        3 for Gaussian noise at an unchanged level; nan for a constant residual without history.

    Raises
    ------
    InputError
        On averages of another kind, shaft or channel.

    Notes
    -----
    MATLAB's `gearConditionMetrics` takes the residual as well, and the records up to the present one as the history.
    Not for records at different load: the variance then follows the load.

    References
    ----------
    J. J. Zakrajsek, D. P. Townsend, H. J. Decker, "An analysis of gear fault detection methods as applied to pitting
    fatigue failure data", NASA TM-105950, 1993.
    """
    _check(residual, history, "residual")
    past = [_variance(h.values) for h in history]
    return _quasi_normalised_kurtosis(residual.values, [*past, _variance(residual.values)])


def na4_star(residual: SynchronousAverage, healthy_history: Sequence[SynchronousAverage]) -> float:
    """Fourth moment of the residual over the square of the variance that the gear had while it was healthy.

    NA4* = (1/N) Σ_i (r_i - r̄)⁴ / (v̄)², v̄ the mean variance of the healthy records only; `healthy_records` finds them.

    Parameters
    ----------
    residual : SynchronousAverage
        Of kind "residual".
    healthy_history : sequence of SynchronousAverage
        Residuals of records in good condition.

    Returns
    -------
    float
        nan without a healthy record.

    References
    ----------
    H. J. Decker, R. F. Handschuh, J. J. Zakrajsek, "An enhancement to the NA4 gear vibration diagnostic parameter",
    NASA TM-106553, 1994. Not in MATLAB's `gearConditionMetrics`.
    """
    _check(residual, healthy_history, "residual")
    return _quasi_normalised_kurtosis(residual.values, [_variance(h.values) for h in healthy_history])


def nb4(band_passed_mesh: SynchronousAverage, history: Sequence[SynchronousAverage] = ()) -> float:
    """NA4 of the envelope of the mesh band: fluctuating load on few teeth shows in the envelope.

    s(θ) = |b(θ) + i H[b](θ)|, b the average band-passed about a mesh harmonic and H the Hilbert transform.

    Parameters
    ----------
    band_passed_mesh : SynchronousAverage
        Of kind "band-passed mesh".
    history : sequence of SynchronousAverage
        The same of earlier records.

    Returns
    -------
    float
        nan for an unmodulated mesh without history.

    References
    ----------
    J. J. Zakrajsek, R. F. Handschuh, H. J. Decker, "Application of fault detection techniques to spiral bevel gear
    fatigue data", NASA TM-106467, 1994. Not in MATLAB's `gearConditionMetrics`.
    """
    _check(band_passed_mesh, history, "band-passed mesh")
    present = envelope(band_passed_mesh.values)
    past = [_variance(envelope(h.values)) for h in history]
    return _quasi_normalised_kurtosis(present, [*past, _variance(present)])


def nb4_star(band_passed_mesh: SynchronousAverage, healthy_history: Sequence[SynchronousAverage]) -> float:
    """NB4 over the variance of healthy records only, as NA4* is to NA4.

    Parameters
    ----------
    band_passed_mesh : SynchronousAverage
        Of kind "band-passed mesh".
    healthy_history : sequence of SynchronousAverage

    Returns
    -------
    float
        nan without a healthy record.
    """
    _check(band_passed_mesh, healthy_history, "band-passed mesh")
    present = envelope(band_passed_mesh.values)
    return _quasi_normalised_kurtosis(present, [_variance(envelope(h.values)) for h in healthy_history])


def healthy_records(variances: Sequence[float], *, z: float = 2.33, n_first: int = 5) -> tuple[bool, ...]:
    """Which records count as healthy for NA4* and NB4*: those before the variance leaves its own scatter.

    The first `n_first` records are taken as healthy. From then on, the first record whose variance exceeds mean + z s
    of those before it ends the healthy ones: later records never change the reference again.

    Parameters
    ----------
    variances : sequence of float
        Of the residuals (or envelopes), oldest first.
    z : float
        Standard deviations; 2.33 is exceeded by 1 % of normal records.
    n_first : int
        At least 2.

    Returns
    -------
    tuple of bool

    Notes
    -----
    The test is on the single record; Decker et al. (1994) fix the reference by a test of the same kind.
    """
    if n_first < 2:
        raise InputError(f"n_first is {n_first}", allowed="at least 2")
    v = np.asarray(variances, dtype=np.float64)
    for k in range(n_first, len(v)):
        if v[k] > v[:k].mean() + z * v[:k].std(ddof=1):
            return (True,) * k + (False,) * (len(v) - k)
    return (True,) * len(v)


def envelope(values: FloatArray) -> FloatArray:
    """|x + i H[x]| of a periodic signal, by its Fourier lines."""
    n = len(values)
    lines = np.fft.fft(values)
    lines[1 : (n + 1) // 2] *= 2
    lines[n // 2 + 1 :] = 0
    magnitude: FloatArray = np.abs(np.fft.ifft(lines))
    return magnitude


def _quasi_normalised_kurtosis(x: FloatArray, variances: Sequence[float]) -> float:
    reference = float(np.mean(variances)) if len(variances) else 0.0
    if reference <= 0.0:
        return float("nan")
    d = (x - x.mean()) / np.sqrt(reference)
    return float(np.mean(d**4))


def _variance(x: FloatArray) -> float:
    return 0.0 if is_constant(x) else float(np.var(x))


def _check(present: SynchronousAverage, history: Sequence[SynchronousAverage], kind: str) -> None:
    for a in (present, *history):
        if a.kind != kind:
            raise InputError(f"a signal of kind {a.kind!r} was given", allowed=kind, remedy="see gearsig.orders")
        if (a.shaft, a.channel, a.unit) != (present.shaft, present.channel, present.unit):
            raise InputError(
                f"history of shaft {a.shaft!r}, channel {a.channel!r} [{a.unit}] for a record of shaft"
                f" {present.shaft!r}, channel {present.channel!r} [{present.unit}]",
                remedy="give earlier records of the same gear, channel and unit",
            )
