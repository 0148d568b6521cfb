"""The largest Lyapunov exponent: the slope of a divergence curve, where a stated rule says."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, count, one_of
from gearsig.errors import InputError, RefusalError
from gearsig.phase.checked_series import checked_series, mean_period_samples
from gearsig.phase.divergence import Divergence, kantz, rosenstein
from gearsig.phase.measures import LyapunovExponent
from gearsig.phase.types import PhasePortrait

Method = Literal["rosenstein", "transverse", "kantz"]

ROOM = 2.0
"""The fit ends where the mean logarithm of the distance comes this close to that of unrelated points: 14 % of it."""

FLAT, LEAST_MISSING = 0.3, 0.7
"""A curve is flat if it makes up for less than this share of what it lacks to saturation, where it lacks this much."""

PERIODS_FOLLOWED = 30.0
LEAST_STEPS = 4


def largest_lyapunov_exponent(
    portrait: PhasePortrait,
    *,
    method: Method = "rosenstein",
    theiler_samples: int | None = None,
    n_steps: int | None = None,
    fit_s: tuple[float, float] | None = None,
) -> LyapunovExponent:
    """Return the rate at which neighbouring stretches of a path part: λ = dS/dt of the divergence curve S.

    The fit goes from the embedding's length (d-1)τ, before which the stretches still share values, to where S first
    comes within 2 of its saturation, or to the last step. Saturation is the mean logarithm of the distance of unrelated
    points, or the end of the curve where that lies lower and the curve has risen by 3 or more (phase-coherent motion
    parts fully only much later). The uncertainty joins two parts: the jackknife over 12 stretches of the signal, and
    half the span of the slopes found in either half of the fit and with 1.5 and 2.5 in place of 2.

    Parameters
    ----------
    portrait : PhasePortrait
        Best a delay embedding, or states of a model. A phase plane of a driven machine is a projection: embed instead.
    method : str
        "rosenstein": nearest neighbour, whole distance; "transverse": the same across the path, better for coarsely
        sampled flows, meaningless for maps; "kantz": 10 neighbours, last coordinate, better for noisy data with many
        points.
    theiler_samples : int or None
        Neighbours nearer in time do not count; None: one mean period, at least the embedding's length.
    n_steps : int or None
        Steps followed; None: 30 mean periods, at most a quarter of the path.
    fit_s : (float, float) or None
        Stretch of the curve to be fitted instead of the one that the rule finds.

    Returns
    -------
    LyapunovExponent
        "diverging" only if λ is above twice its uncertainty and the distance grows by e or more within the fit; "not
        diverging" if the distance grows by less although there was room; "undecided" otherwise.

    Raises
    ------
    RefusalError
        If neighbours are as far apart as unrelated points at once (noise, or too few points), or the path does not
        come back.

    Notes
    -----
    The estimate presumes determinism: check the signal with `embedding_dimension` first. Noise lifts the start of the
    curve. With 1 % of the standard deviation the Lorenz system's exponent comes out 5 % low, with 2 % 12 % low; with
    5 % no stretch is left but across the path ("transverse", "undecided"); with 10 % there is no answer.

    Source: M. T. Rosenstein, J. J. Collins, C. J. De Luca, Physica D 65 (1993); H. Kantz, Physics Letters A 185 (1994).
    """
    one_of(method, "method", ("rosenstein", "transverse", "kantz"))
    x = checked_series(np.ascontiguousarray(portrait.points[:, 0]), minimum=100, name="the portrait's first axis")
    period = mean_period_samples(x)
    memory = (portrait.n_axes - 1) * portrait.delay_samples
    window = round(max(period, memory)) if theiler_samples is None else count(theiler_samples, "theiler_samples")
    steps = _steps(n_steps, period, memory, portrait.n_points, window)
    points = _comparable(portrait)
    curve = (
        kantz(points, window, steps)
        if method == "kantz"
        else rosenstein(points, window, steps, across=method == "transverse")
    )
    rate = portrait.sampling_rate_hz
    curve = replace(curve, saturation=_saturation(curve, memory))
    if fit_s is None:
        first, stop = fit_limits(curve, memory, max(LEAST_STEPS, round(0.25 * period)))
    else:
        first, stop = _asked_limits(fit_s, rate, len(curve.log_distance))
    slope, uncertainty = slope_of(curve, first, stop)
    return LyapunovExponent(
        exponent_per_s=slope * rate,
        uncertainty_per_s=uncertainty * rate,
        log_distance=curve.log_distance,
        step_s=1.0 / rate,
        fit_s=(first / rate, (stop - 1) / rate),
        saturation_log_distance=curve.saturation,
        verdict=_verdict(slope, uncertainty, stop - 1 - first, room_left=stop == len(curve.log_distance)),
        method=method,
        n_references=curve.n_references,
        theiler_samples=window,
        source=portrait.source,
    )


def fit_limits(curve: Divergence, memory: int, n_least: int, room: float = ROOM) -> tuple[int, int]:
    """Return the first step of the fit and the one after its last.

    A curve that starts within `room` of saturation but stays there is noise on a motion that does not diverge: it is
    fitted as a whole.
    """
    s = curve.log_distance
    missing = curve.saturation - float(s[memory])
    if missing > LEAST_MISSING and float(s[memory:].max()) < s[memory] + FLAT * missing:
        return memory, len(s)
    near = np.flatnonzero(s[memory:] >= curve.saturation - room)
    stop = memory + int(near[0]) if len(near) else len(s)
    if stop - memory >= n_least:
        return memory, stop
    raise RefusalError(
        f"{memory} steps on, neighbours are {np.exp(-missing):.0%} as far apart as unrelated points: no stretch of "
        "exponential growth can be seen",
        remedy="the signal looks stochastic or too noisy; filter it, record longer, or embed it with fewer dimensions",
    )


def _asked_limits(fit_s: tuple[float, float], rate: float, n_steps: int) -> tuple[int, int]:
    first, stop = round(fit_s[0] * rate), round(fit_s[1] * rate) + 1
    if first < 0 or not first + LEAST_STEPS <= stop <= n_steps:
        raise InputError(
            f"fit_s goes from {fit_s[0]:g} to {fit_s[1]:g} s",
            allowed=f"at least {LEAST_STEPS} steps of {1.0 / rate:.3g} s within 0 to {(n_steps - 1) / rate:.4g} s",
        )
    return first, stop


def _saturation(curve: Divergence, memory: int) -> float:
    """Mean logarithm of the distance that the curve ends at, if it has clearly risen, or that of unrelated points."""
    s = curve.log_distance
    end = float(np.median(s[-max(1, (len(s) - memory) // 4) :]))
    return min(end, curve.saturation) if end - s[memory] > ROOM + 1.0 else curve.saturation


def slope_of(curve: Divergence, first: int, stop: int) -> tuple[float, float]:
    """Return the slope per step and its standard deviation."""
    s, k = curve.log_distance, np.arange(len(curve.log_distance), dtype=np.float64)
    slope = _slope(k[first:stop], s[first:stop])
    blocks = curve.by_block[:, first:stop]
    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    n = len(blocks)
    rest = [(blocks.sum(axis=0) - b) / (n - 1) for b in blocks] if n > 2 else []
    without = np.array([_slope(k[first:stop], r) for r in rest] or [slope])
    scatter = float(np.sqrt(max(n - 1, 0) * np.var(without)))
    others = [_slope(k[a:b], s[a:b]) for a, b in _other_fits(curve, first, stop)]
    return slope, float(np.hypot(scatter, 0.5 * (max(others) - min(others))))


def _other_fits(curve: Divergence, first: int, stop: int) -> list[tuple[int, int]]:
    middle = (first + stop) // 2
    fits = [(first, middle + 1), (middle, stop)]
    if stop < len(curve.log_distance):
        for room in (ROOM - 0.5, ROOM + 0.5):
            beyond = first + int(np.argmax(curve.log_distance[first:] >= curve.saturation - room))
            if beyond - first >= 3:
                fits.append((first, beyond))
    return fits


def _verdict(
    slope: float, uncertainty: float, n_fitted: int, *, room_left: bool
) -> Literal["diverging", "not diverging", "undecided"]:
    if slope * n_fitted >= 1.0 and slope > 2.0 * uncertainty:
        return "diverging"
    return "not diverging" if room_left and slope * n_fitted < 1.0 else "undecided"


def _slope(k: FloatArray, s: FloatArray) -> float:
    centred = k - k.mean()
    return float(np.dot(centred, s) / np.dot(centred, centred))


def _steps(asked: int | None, period: float, memory: int, n_points: int, window: int) -> int:
    steps = int(min(PERIODS_FOLLOWED * period + memory, n_points // 4)) if asked is None else count(asked, "n_steps")
    if n_points - steps < 4 * window + 100 or steps < memory + LEAST_STEPS:
        raise RefusalError(
            f"{n_points} points are too few: {steps} steps are followed, and neighbours lie {window} samples apart",
            remedy=f"record at least {4 * (memory + window) + steps + 200} points or follow fewer steps",
        )
    return steps


def _comparable(portrait: PhasePortrait) -> FloatArray:
    """Points in standard deviations of their axes where these have different units."""
    if portrait.kind == "delay embedding":
        return portrait.points
    return np.ascontiguousarray(portrait.points / np.where(portrait.extent > 0.0, portrait.extent, 1.0))
