"""Synchronous averages of a shaft as complex lines: of both halves of a record, and of all of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle import AngleSignal
from gearsig.checks import FloatArray
from gearsig.comparison._types import Agreement, Alignment, LevelPair, Repeated, power_levels
from gearsig.errors import InputError
from gearsig.orders import average_lines
from gearsig.prepared import best_shift, shift_scores, turned_lines
from gearsig.spectra import ComplexArray


@dataclass(frozen=True)
class HalvedLines:
    """Complex rms amplitudes of the whole orders of a shaft, from order 0.

    Parameters
    ----------
    first, second : complex array, (n_channels, n_orders)
        Of the halves.
    n_revolutions : int
        In both together.
    """

    first: ComplexArray
    second: ComplexArray
    n_revolutions: int

    @property
    def whole(self) -> ComplexArray:
        """Of the whole record: the mean of its halves."""
        return 0.5 * (self.first + self.second)

    def turned(self, shift_rev: float) -> HalvedLines:
        """Return the lines of the average turned forward by `shift_rev`."""
        return replace(self, first=turned_lines(self.first, shift_rev), second=turned_lines(self.second, shift_rev))

    def up_to(self, highest: int) -> HalvedLines:
        """Return the lines up to an order."""
        return replace(self, first=self.first[:, : highest + 1], second=self.second[:, : highest + 1])

    def noise(self) -> FloatArray:
        """Return the standard error of `whole`, rms over both quadratures, (n_channels, n_orders).

        |a - b|/2 of the halves' amplitudes, or its rms over neighbouring lines where that is larger.
        """
        square = 0.25 * np.abs(self.first - self.second) ** 2
        square[:, 0] = square[:, 1]  # a sensor's drift is no measure of what surrounds the shaft's lines
        reach = 4  # nine lines: one line's own scatter of two halves says little
        padded = np.pad(square, ((0, 0), (reach, reach)), mode="reflect" if square.shape[1] > reach else "edge")
        kernel = np.ones(9) / 9
        smooth = np.stack([np.convolve(row, kernel, mode="valid") for row in padded])
        result: FloatArray = np.sqrt(np.maximum(square, smooth))
        return result


def halved_lines(halves: Sequence[AngleSignal]) -> HalvedLines:
    """Return the lines of the averages of two halves, their revolutions weighted by a Hann window.

    Another shaft's order that lies near a whole one leaks less by it: a comparison of records of different lengths
    compares lines, not leakage.
    """
    first, second = (average_lines(half, weighting="hann", scaling="amplitude rms") for half in halves)
    return HalvedLines(first.whole, second.whole, int(first.n_revolutions.sum() + second.n_revolutions.sum()))


def waveform(lines: ComplexArray, n_angles: int) -> FloatArray:
    """Return one revolution, (n_angles,), of one channel's rms amplitudes, without its mean."""
    full = np.zeros(n_angles // 2 + 1, dtype=np.complex128)
    full[1 : len(lines)] = lines[1:]
    values: FloatArray = np.fft.irfft(full, n_angles) * (n_angles / np.sqrt(2.0))
    return values


def align(
    shaft: str, simulated: HalvedLines, recorded: HalvedLines, n_teeth: int | None, *, by_marks: bool
) -> Alignment:
    """Return the shift of the simulation's average with the largest correlation, or none where marks are trusted.

    ρ(s) = Σ_c Re Σ_n Y_c[n] X_c*[n] e^{2πi n s} / (|X_c| |Y_c|) / n_channels, with the lines X of the simulation
    and Y of the recording, all channels c together: the same shaft turns under all sensors.

    Parameters
    ----------
    shaft : str
    simulated, recorded : HalvedLines
        Up to the same order.
    n_teeth : int or None
        To tell whether the shift is certain to the tooth.
    by_marks : bool
        Whether to leave the simulation as it is: both count from a mark.
    """
    x, y = simulated.whole, recorded.whole
    cross = _cross_spectrum(x, y)
    best = best_shift(cross)
    shifts = [
        best_shift(_cross_spectrum(a, b))
        for a, b in ((simulated.first, y), (simulated.second, y), (x, recorded.first), (x, recorded.second))
    ]
    spread = np.hypot(_angle_distance_rev(shifts[0], shifts[1]), _angle_distance_rev(shifts[2], shifts[3])) / 2.0
    certain = None if n_teeth is None else _is_certain(x, y, best, shifts, n_teeth)
    if by_marks:
        gain = float(shift_scores(cross, np.array([best]))[0] - shift_scores(cross, np.zeros(1))[0])
        return Alignment(shaft, "marks", 0.0, 0.0, certain, 360.0 * best, gain)
    return Alignment(shaft, "correlation", 360.0 * best, 360.0 * float(spread), certain)


def _cross_spectrum(x: ComplexArray, y: ComplexArray) -> ComplexArray:
    """Cross spectrum, each channel over its own size, mean over the channels; the mean value counts for nothing."""
    product = y * np.conj(x)
    product[:, 0] = 0.0
    size = np.sqrt(np.sum(np.abs(x[:, 1:]) ** 2, axis=1) * np.sum(np.abs(y[:, 1:]) ** 2, axis=1))
    cross: ComplexArray = np.divide(product, size[:, None], out=np.zeros_like(product), where=size[:, None] > 0)
    mean: ComplexArray = cross.mean(axis=0)
    return mean


def _angle_distance_rev(a: float, b: float) -> float:
    """Return the distance of two angles, 0 to 0.5 revolutions."""
    return abs((a - b + 0.5) % 1.0 - 0.5)


def _is_certain(x: ComplexArray, y: ComplexArray, best: float, shifts: list[float], n_teeth: int) -> bool:
    """Say whether all halves choose the same tooth, and what differs from tooth to tooth is alike in both records.

    The mesh harmonics are left out of the second test: they say nothing of which tooth is which.
    """
    if max(_angle_distance_rev(best, shift) for shift in shifts) >= 0.5 / n_teeth:
        return False
    telling = np.arange(x.shape[1]) % n_teeth != 0
    alike = shift_scores(_cross_spectrum(np.where(telling, x, 0.0), np.where(telling, y, 0.0)), np.array([best]))[0]
    return bool(alike > 0.5)  # patterns of different gears reach 0.3 to 0.4 at the best of all teeth


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
    simulated_powers, recorded_powers = (
        np.stack([tooth_powers(waveform(half[channel], n_angles), n_teeth) for half in (lines.first, lines.second)])
        for lines in (simulated, recorded)
    )
    return power_levels(simulated_powers, recorded_powers, smooth=n_teeth)


def tooth_powers(values: FloatArray, n_teeth: int) -> FloatArray:
    """Return the mean square over each of `n_teeth` equal parts of a revolution; edges may fall between samples."""
    n = len(values)
    total = np.concatenate([[0.0], np.cumsum(values**2)])
    edges = np.interp(np.linspace(0, n, n_teeth + 1), np.arange(n + 1), total)
    powers: FloatArray = np.diff(edges) * n_teeth / n
    return powers
