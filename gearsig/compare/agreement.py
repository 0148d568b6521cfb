"""How alike two aligned averages are: correlation and FRAC, whole or by band, and each tooth's energy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compare.averages import ComplexArray, HalvedLines, waveform
from gearsig.compare.levels import power_levels
from gearsig.compare.types import Agreement, LevelPair, Repeated
from gearsig.errors import InputError

Figure = Callable[[ComplexArray, ComplexArray], float]


def frac(x: ComplexArray | FloatArray, y: ComplexArray | FloatArray) -> float:
    """Return the frequency response assurance criterion of two sets of lines, here of order lines.

    FRAC = |Σ x y*|² / (Σ|x|² Σ|y|²): 1 where one is a multiple of the other, whatever the (complex) factor.

    Two runs of a machine have no coherence in its usual sense: their noise has nothing in common, and only what turns
    with the shaft repeats from one to the other. Taken over the lines of two synchronous averages that were aligned in
    angle, FRAC is what coherence would be: the share of energy that one complex factor carries from one to the other.
    Of magnitudes instead of complex lines, it does without the alignment, and without the phases of the path.

    Parameters
    ----------
    x, y : array, (n_lines,)

    Returns
    -------
    float
        0 to 1; 0 where one has no energy.

    Raises
    ------
    InputError
        If the lengths differ.

    References
    ----------
    W. Heylen, S. Lammens, "FRAC: a consistent way of comparing frequency response functions", 1996.

    Examples
    --------
    >>> frac(np.array([1.0, 2j]), np.array([3.0, 6j]))
    1.0
    """
    if np.shape(x) != np.shape(y):
        raise InputError(f"x has {np.shape(x)} lines, y {np.shape(y)}", allowed="equal lengths")
    size = float(np.sum(np.abs(x) ** 2)) * float(np.sum(np.abs(y) ** 2))
    return float(np.abs(np.vdot(y, x)) ** 2) / size if size > 0 else 0.0


def correlation(x: ComplexArray, y: ComplexArray) -> float:
    """Return the correlation coefficient of two averages from their lines (without order 0): Re Σ x y*/(|x| |y|)."""
    size = float(np.sqrt(np.sum(np.abs(x) ** 2) * np.sum(np.abs(y) ** 2)))
    return float(np.vdot(y, x).real) / size if size > 0 else 0.0


def repeated(figure: Figure, simulated: HalvedLines, recorded: HalvedLines, channel: int, part: slice) -> Repeated:
    """Return a figure of one channel's lines, with its scatter when either record is halved.

    Half of f(x₁, y) - f(x₂, y) and half of f(x, y₁) - f(x, y₂), added as squares.
    """
    x, y = simulated.whole[channel, part], recorded.whole[channel, part]
    by_simulation = figure(simulated.first[channel, part], y) - figure(simulated.second[channel, part], y)
    by_recording = figure(x, recorded.first[channel, part]) - figure(x, recorded.second[channel, part])
    return Repeated(figure(x, y), float(np.hypot(by_simulation, by_recording)) / 2.0)


def agreement(simulated: HalvedLines, recorded: HalvedLines, channel: int, part: slice) -> Agreement:
    """Return FRAC of the lines in a part of the orders, complex and of magnitudes."""
    x, y = np.abs(simulated.whole[channel, part]) ** 2, np.abs(recorded.whole[channel, part]) ** 2
    size = float(x.sum() * y.sum())
    # The mean of |Σ x y* exp(2πi n s)|² over all shifts s is Σ |x|² |y|².
    chance = float(np.sum(x * y)) / size if size > 0 else 0.0
    return Agreement(
        repeated(frac, simulated, recorded, channel, part),
        repeated(lambda a, b: frac(np.abs(a), np.abs(b)), simulated, recorded, channel, part),
        chance,
        len(x),
    )


def reliability(lines: HalvedLines, channel: int) -> float:
    """Return how well an average repeats itself: r = 2ρ/(1 + ρ) with the correlation ρ of its halves, at least 0.

    References
    ----------
    C. Spearman, "Correlation calculated from faulty data", 1910. W. Brown, "Some experimental results in the
    correlation of mental abilities", 1910.
    """
    rho = max(correlation(lines.first[channel, 1:], lines.second[channel, 1:]), 0.0)
    return 2.0 * rho / (1.0 + rho)


def tooth_levels(
    simulated: HalvedLines, recorded: HalvedLines, channel: int, n_teeth: int, n_angles: int
) -> tuple[LevelPair, ...]:
    """Return the level of the averages in each tooth pitch, from shaft angle 0 on."""
    own, other = (
        np.stack([tooth_powers(waveform(half[channel], n_angles), n_teeth) for half in (lines.first, lines.second)])
        for lines in (simulated, recorded)
    )
    return power_levels(own, other, smooth=n_teeth)


def tooth_powers(values: FloatArray, n_teeth: int) -> FloatArray:
    """Return the mean square over each of `n_teeth` equal parts of a revolution; edges may fall between samples."""
    n = len(values)
    total = np.concatenate([[0.0], np.cumsum(values**2)])
    edges = np.interp(np.linspace(0, n, n_teeth + 1), np.arange(n + 1), total)
    powers: FloatArray = np.diff(edges) * n_teeth / n
    return powers
