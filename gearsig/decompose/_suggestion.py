"""Suggested number of modes and penalty for a signal, with the trials behind the suggestion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.checks import FloatArray, count, listed_numbers, positive
from gearsig.decompose._vmd import (
    SAMPLES_PER_MODE,
    ModeAxis,
    Modes,
    VmdSettings,
    check_supported,
    half_gain_distance,
    modes_of_whole,
)
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import axis_unit, counted
from gearsig.results import Result
from gearsig.timefreq import Source, UniformSignal, uniform


@dataclass(frozen=True)
class ModeTrial:
    """A trial decomposition with one number of modes at one penalty.

    Parameters
    ----------
    settings : VmdSettings
        With the better start: "uniform", or "peaks" if only the latter met no objection.
    centres, bandwidths : tuple of float
        By ascending centre, in Hz or orders.
    reconstruction_error : float
        Root mean square of the residual over that of the signal.
    separation : float
        Smallest distance of two centres over the distance at which a mode's gain is one half; inf for one mode. Below
        1, two modes share their lines.
    widest : float
        Largest bandwidth relative to that of a mode of white noise; 1 is noise, a tone is near 0.
    smallest_share : float
        Energy of the weakest mode over the signal's.
    n_iterations : int
    converged : bool
    objection : str
        Why this trial is not suggested; empty if it could be.
    """

    settings: VmdSettings
    centres: tuple[float, ...]
    bandwidths: tuple[float, ...]
    reconstruction_error: float
    separation: float
    widest: float
    smallest_share: float
    n_iterations: int
    converged: bool
    objection: str

    @property
    def n_modes(self) -> int:
        """Number of modes in this trial."""
        return self.settings.n_modes

    @property
    def penalty(self) -> float:
        """Penalty in this trial."""
        return self.settings.penalty


@dataclass(frozen=True)
class ModeSuggestion(Result, rows="trials"):
    """Suggested settings for a signal, with the reasons and all trials.

    Parameters
    ----------
    chosen : ModeTrial
    trials : tuple of ModeTrial
        By penalty, then number of modes.
    reasons : tuple of str
        One sentence each.
    axis : str
        "frequency" or "order".
    source : str
    """

    chosen: ModeTrial
    trials: tuple[ModeTrial, ...]
    reasons: tuple[str, ...]
    axis: ModeAxis
    source: str

    @property
    def settings(self) -> VmdSettings:
        """Suggested number of modes, penalty and start."""
        return self.chosen.settings


PENALTIES = (500.0, 1000.0, 2000.0, 5000.0, 10_000.0, 20_000.0)
USUAL_PENALTY = 2000.0
NOISE_LIKE = 0.75
"""Modes wider than this share of white noise's width hold no component that stands out from the noise."""
NARROWEST_LIMIT = 0.3
"""Lower bound of that limit: with few lines within a mode's reach, the width of noise scatters."""
GIVE_UP_AFTER = 3
"""Consecutive rejected trials at one penalty after which no larger number of modes is tried."""
MIN_SHARE = 1e-4
"""Modes with a smaller share of the signal's energy hold only remnants of their neighbours."""


def suggest_modes(
    signal: Source,
    channel: str | float | None = None,
    *,
    max_modes: int = 8,
    penalties: Sequence[float] = PENALTIES,
    longest: int = 2**14,
) -> ModeSuggestion:
    """Return the number of modes and the penalty that separate a signal's components.

    Each number of modes up to `max_modes` is tried at each penalty until three in a row are rejected, from uniform
    starts and, if that fails, from the spectrum's peaks. A trial is rejected if two centres are closer than the
    distance at which a mode's gain is one half (the modes share lines), if a mode is as wide as white noise alone would
    make it, if a mode is almost empty, or if it does not converge. Of the others, the trial with the most modes wins;
    among equals, the one with the penalty nearest to 2000.

    Parameters
    ----------
    signal, channel
        As in `vmd`.
    max_modes : int
    penalties : sequence of float
    longest : int
        For a longer signal, only this many samples from its middle are used.

    Returns
    -------
    ModeSuggestion

    Raises
    ------
    InputError
        On NaN, a constant, or too few samples.
    RefusalError
        If no trial separates a component, as for noise or broad-band impulses.

    Notes
    -----
    White noise between the neighbours of a mode with gain g(x) = 1/(1 + x²), x in half-gain distances, |x| ≤ R, has an
    rms width of √[(atan R - R/(1+R²)) / (atan R + R/(1+R²))] half-gain distances; R is half the mean distance of the
    modes. A suggestion is a starting point, not a proof: inspect the modes.
    """
    x = uniform(signal, channel)
    count(max_modes, "max_modes")
    alphas = sorted({positive(p, "penalties") for p in listed_numbers(penalties, "penalties")})
    if not alphas:
        raise InputError("penalties is empty", allowed="one or more values above zero")
    part = replace(x, values=_middle(x.values, count(longest, "longest", minimum=64)))
    check_supported(part.values, 1)
    n_max = min(max_modes, part.n_samples // SAMPLES_PER_MODE)
    trials = tuple(trial for penalty in alphas for trial in _trials(part, n_max, penalty))
    good = [t for t in trials if not t.objection]
    if not good:
        raise RefusalError(
            f"none of {len(trials)} trials separates a component: {_commonest(trials)}",
            remedy="choose a frequency band first (its envelope for impulses), or set n_modes and penalty by hand",
        )
    chosen = max(good, key=lambda t: (t.n_modes, -abs(np.log(t.penalty / USUAL_PENALTY))))
    reasons = _reasons(chosen, trials, x.rate, x.axis)
    if part.n_samples < x.n_samples:
        reasons = (*reasons, f"Tried on {part.n_samples} of {x.n_samples} samples, from the middle.")
    return ModeSuggestion(chosen, trials, reasons, x.axis, x.source)


def noise_width(penalty: float, n_modes: int) -> float:
    """Return the rms width of a mode of white noise, in half-gain distances; see the notes of `suggest_modes`."""
    reach = 0.25 * np.sqrt(penalty) / n_modes
    angle, fall = np.arctan(reach), reach / (1.0 + reach * reach)
    return float(np.sqrt((angle - fall) / (angle + fall)))


def noise_limit(penalty: float, n_samples: int) -> float:
    """Return the share of white noise's width up to which a mode counts as a component.

    The width of noise over M = 2n/√penalty lines scatters by about 1/√M; a mode that started at the highest of many
    peaks is narrower than most by several times that.
    """
    n_lines = 2.0 * n_samples / np.sqrt(penalty)
    return float(np.clip(1.0 - 6.0 / np.sqrt(n_lines), NARROWEST_LIMIT, NOISE_LIKE))


def _middle(x: FloatArray, longest: int) -> FloatArray:
    start = max(0, (len(x) - longest) // 2)
    return x[start : start + longest]


def _trials(x: UniformSignal, max_modes: int, penalty: float) -> list[ModeTrial]:
    trials: list[ModeTrial] = []
    for n_modes in range(1, max_modes + 1):
        trials.append(_better_trial(x, n_modes, penalty))
        if len(trials) >= GIVE_UP_AFTER and all(t.objection for t in trials[-GIVE_UP_AFTER:]):
            break
    return trials


def _better_trial(x: UniformSignal, n_modes: int, penalty: float) -> ModeTrial:
    """Return the trial from a uniform start, or from the spectrum's peaks if only that meets no objection."""
    uniform = _trial(x, VmdSettings(n_modes, penalty))
    if not uniform.objection:
        return uniform
    peaks = _trial(x, VmdSettings(n_modes, penalty, start="peaks"))
    return uniform if peaks.objection else peaks


def _trial(x: UniformSignal, settings: VmdSettings) -> ModeTrial:
    modes = modes_of_whole(x, settings, None)
    order = np.array(modes.by_centre())
    centres, widths = modes.centres[order], modes.bandwidths[order]
    half_gain = half_gain_distance(settings.penalty, x.rate)
    gaps = np.diff(centres) / half_gain
    relative = widths / (half_gain * noise_width(settings.penalty, settings.n_modes))
    shares = modes.rms**2 / np.mean(np.square(x.values, dtype=np.float64))
    return ModeTrial(
        settings=settings,
        centres=tuple(centres.tolist()),
        bandwidths=tuple(widths.tolist()),
        reconstruction_error=modes.reconstruction_error,
        separation=float(gaps.min(initial=np.inf)),
        widest=float(relative.max()),
        smallest_share=float(shares.min()),
        n_iterations=modes.n_iterations,
        converged=modes.converged,
        objection=_objection(modes, gaps, relative, shares),
    )


def _objection(modes: Modes, gaps: FloatArray, relative_widths: FloatArray, shares: FloatArray) -> str:
    if len(gaps) and gaps.min() < 1.0:
        return "two modes share the same lines"
    if shares.min() < MIN_SHARE:
        return "a mode is almost empty"
    if relative_widths.max() > noise_limit(modes.settings.penalty, len(modes.residual)):
        return "a mode is as wide as noise"
    return "" if modes.converged else "not converged"


def _commonest(trials: Sequence[ModeTrial]) -> str:
    texts = [t.objection for t in trials]
    best = max(set(texts), key=texts.count)
    return f"in {texts.count(best)} of them {best}"


def _reasons(chosen: ModeTrial, trials: Sequence[ModeTrial], fs: float, axis: ModeAxis) -> tuple[str, ...]:
    unit = axis_unit(axis)
    same = {t.n_modes: t for t in trials if t.penalty == chosen.penalty}
    reasons = [
        f"{counted(chosen.n_modes, 'mode')} at penalty {chosen.penalty:g}: all narrower than noise, none shares lines.",
        f"The modes leave {100 * chosen.reconstruction_error:.2g} % of the signal's rms in the residual.",
    ]
    if chosen.n_modes > 1:
        reasons.append(
            f"The closest centres are {chosen.separation * half_gain_distance(chosen.penalty, fs):.4g} {unit} apart, "
            f"{chosen.separation:.3g} times the distance at which a mode's gain is one half."
        )
    following = same.get(chosen.n_modes + 1)
    if following is None:
        reasons.append("No larger number was tried: the signal may hold more modes.")
    else:
        reasons.append(f"With {following.n_modes} modes {following.objection}.")
    usual = [t for t in trials if t.penalty == USUAL_PENALTY and t.n_modes == chosen.n_modes]
    if chosen.penalty != USUAL_PENALTY and usual:
        reasons.append(f"At the usual penalty of {USUAL_PENALTY:g} {usual[0].objection}.")
    return tuple(reasons)
