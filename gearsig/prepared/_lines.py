"""Families of equally spaced lines in a spectrum, and whether noise could have caused them; shared tools for averages.

The score of a fundamental is the sum, over its harmonics, of the logarithm of line power over local floor, each clipped
so that one huge line cannot make a family. Its null distribution is not assumed: the terms are drawn from the
spectrum's own lines, and the distribution of their sum is their convolution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from math import ceil, floor, log

import numpy as np
from numpy.typing import NDArray
from scipy.fft import ifft, next_fast_len
from scipy.optimize import minimize_scalar

from gearsig.checks import ComplexArray, FloatArray
from gearsig.compiled import njit
from gearsig.peaks import parabola_vertex
from gearsig.spectra import Spectrum, noise_floor

LOG_RATIO_LIMIT = 6.0
"""Natural log of power over floor at which a harmonic counts in full: 26 dB, far above what noise reaches."""

CLEAR_LINE_DB = 6.0
"""A line counts as seen above this; noise exceeds it in 2 % of the lines, so that only several together matter."""

FOOT_LINES = 3
"""Lines that one tone reaches on either side: two by the Hann window, and one by the widening of the log ratios."""

N_FITS = 4
"""Passes of fitting the fundamental to the peaks and searching for the peaks again."""

CHUNK = 1 << 17
"""Fundamentals tried at a time: long records with wide ranges have millions of them."""

_STEP = 0.05
"""Width of the cells in which the distribution of the terms is kept."""


@dataclass(frozen=True)
class LinesOverFloor:
    """The height of each line of a spectrum above its floor.

    Parameters
    ----------
    spectrum : Spectrum
        Amplitudes.
    floor : array, (n_lines,)
        Amplitude of the floor (root of the mean noise power) at each line.
    log_ratio : array, (n_lines,)
        ln(power/floor power) of the largest of the line and its two neighbours, 0 to `LOG_RATIO_LIMIT`.
    masked : array of bool, (n_lines,)
        Lines that are already explained; their `log_ratio` counts as 0.
    """

    spectrum: Spectrum
    floor: FloatArray
    log_ratio: FloatArray
    masked: NDArray[np.bool_]

    def without_multiples(
        self, fundamental: float, *, half_width: float = 0.0, start: float = 0.0, skirt: float = 0.0
    ) -> LinesOverFloor:
        """Return the same with the lines around start ± k·fundamental masked.

        At least a line's own foot is masked; `half_width` widens this, in the axis' unit, and `skirt` in proportion to
        the position, for lines that smear with a varying speed. If the multiples are so close that most lines would be
        masked, nothing is: they cannot be resolved.
        """
        reach = max(half_width, FOOT_LINES * self.spectrum.resolution)
        if fundamental < 4 * reach:
            return self
        masked = self.masked.copy()
        _mask_multiples(masked, self.spectrum.positions, self.spectrum.resolution, fundamental, start, reach, skirt)
        return replace(self, masked=masked)

    def line_numbers(self, places: FloatArray) -> NDArray[np.int64]:
        """Return the numbers of the lines nearest to some places of the axis, which may lie beyond its ends."""
        spectrum = self.spectrum
        index: NDArray[np.int64] = np.rint((places - spectrum.positions[0]) / spectrum.resolution).astype(np.int64)
        return index

    def lines_at(self, places: FloatArray) -> NDArray[np.int64]:
        """Return the numbers of the lines nearest to those places that lie on the axis."""
        index = self.line_numbers(places)
        return index[(index >= 0) & (index < len(self.log_ratio))]

    def free_lines_at(self, places: FloatArray) -> NDArray[np.int64]:
        """Return the numbers of the lines at some places that are not explained yet."""
        index = self.lines_at(places)
        return index[~self.masked[index]]

    def over_floor_db(self, lines: NDArray[np.int64]) -> FloatArray:
        """Return the unclipped height over the floor of the largest of each line and its two neighbours, in dB."""
        values, last = self.spectrum.values, len(self.spectrum.values) - 1
        near = np.clip(lines[:, None] + np.arange(-1, 2), 0, last)
        ratio = values[near].max(axis=1) / np.maximum(self.floor[np.clip(lines, 0, last)], 1e-300)
        heights: FloatArray = 20 * np.log10(np.maximum(ratio, 1e-300))
        return heights

    def scores(self) -> FloatArray:
        """Log ratios with the masked lines at 0."""
        return self._scores

    @cached_property
    def _scores(self) -> FloatArray:
        scores = np.where(self.masked, 0.0, self.log_ratio)
        scores.flags.writeable = False
        return scores

    @cached_property
    def _densities(self) -> list[FloatArray]:
        """Distributions of sums of 1, 2, … draws, kept because searches over many ranges need the same ones."""
        n_cells = int(np.ceil(LOG_RATIO_LIMIT / _STEP)) + 1
        cells = np.bincount((self.log_ratio[~self.masked] / _STEP).astype(np.intp), minlength=n_cells)
        return [(cells + 1e-9) / (cells.sum() + 1e-9 * n_cells)]

    def sum_density(self, n_terms: int) -> FloatArray:
        """Return the distribution of a sum of independent draws from the unmasked lines, in cells of `_STEP`."""
        while len(self._densities) < n_terms:
            self._densities.append(np.convolve(self._densities[-1], self._densities[0]))
        return self._densities[max(n_terms, 1) - 1]


@dataclass(frozen=True)
class Comb:
    """The best family of lines in a range of fundamentals.

    Parameters
    ----------
    fundamental : float
        In the axis' unit of the spectrum.
    score : float
    p_value : float
        Probability that the best of all fundamentals tried scores as high if there is no family.
    positions : tuple of float
        Harmonics whose line stands at least 6 dB above the floor.
    ratios_db : tuple of float
        Their power over the floor.
    amplitude, floor : float
        Of the strongest of them.
    """

    fundamental: float
    score: float
    p_value: float
    positions: tuple[float, ...]
    ratios_db: tuple[float, ...]
    amplitude: float
    floor: float


def over_floor_db(amplitude: float, floor: float) -> float:
    """Return 20 lg(amplitude/floor) in dB, also for amplitudes and floors of zero.

    Parameters
    ----------
    amplitude, floor : float
        In the same unit; values below 1e-300 count as 1e-300.
    """
    return 20 * float(np.log10(max(amplitude, 1e-300) / max(floor, 1e-300)))


def lines_over_floor(spectrum: Spectrum, floor: FloatArray) -> LinesOverFloor:
    """Return how far each line of an amplitude spectrum stands above its floor, ln(P/P₀) = 2 ln(A/A₀).

    The largest of a line and its two neighbours counts, as a tone between two lines is lower in each.

    Parameters
    ----------
    spectrum : Spectrum
        Amplitudes A.
    floor : array, (n_lines,)
        A₀, root of the mean noise power at each line, in the spectrum's unit.

    Returns
    -------
    LinesOverFloor
        With no line masked.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        log_ratio = spectrum.values / floor
        np.fmax(log_ratio, 1.0, out=log_ratio)  # zero over zero counts as 1
        log_ratio = np.minimum(2.0 * np.log(log_ratio, out=log_ratio), LOG_RATIO_LIMIT, out=log_ratio)
    widened = log_ratio.copy()
    np.maximum(widened[1:], log_ratio[:-1], out=widened[1:])
    np.maximum(widened[:-1], log_ratio[1:], out=widened[:-1])
    return LinesOverFloor(spectrum, np.asarray(floor), widened, np.zeros(len(widened), dtype=np.bool_))


def lines_over_noise_floor(spectrum: Spectrum, highest: float | None = None) -> LinesOverFloor:
    """Return an amplitude spectrum's lines against its local noise floor, see `gearsig.spectra.noise_floor`.

    Parameters
    ----------
    spectrum : Spectrum
        Amplitudes.
    highest : float or None
        Position up to which lines are examined, in the axis' unit; None: all.

    Returns
    -------
    LinesOverFloor
        With no line masked.
    """
    floor = noise_floor(spectrum, highest=highest).values
    return lines_over_floor(spectrum.head(len(floor)), floor)


def best_comb(
    excess: LinesOverFloor,
    low: float,
    high: float,
    offsets: NDArray[np.int_] | None = None,
    centres: FloatArray | None = None,
) -> Comb | None:
    """Find the fundamental between `low` and `high` whose family of lines stands out most.

    Parameters
    ----------
    excess : LinesOverFloor
    low, high : float
        Range of fundamentals, in the axis' unit.
    offsets : array of int or None
        Multiples of the fundamental that make the family; default 1 to 6.
    centres : array or None
        Positions that the multiples are counted from (mesh harmonics, for sidebands); default 0.

    Returns
    -------
    Comb or None
        None if the range contains no fundamental that the spectrum can resolve.
    """
    multiples = np.arange(1, 7) if offsets is None else np.asarray(offsets)
    starts = np.zeros(1) if centres is None else np.asarray(centres, dtype=np.float64)
    resolution = excess.spectrum.resolution
    low = max(low, 3 * resolution)
    high = min(high, _widest(excess.spectrum, starts, multiples))
    if high <= low or len(excess.log_ratio) < 16:
        return None
    # A step of a third of a line at the highest multiple: no family falls between two candidates.
    step = resolution / (3 * float(np.abs(multiples).max()))
    n_candidates = int((high - low) / step) + 2
    origins, factors = np.repeat(starts, len(multiples)), np.tile(multiples, len(starts))
    candidates, totals, n_terms = _highest(excess, origins, factors, low, step, n_candidates)
    if n_terms == 0:
        return None
    spectrum = excess.spectrum
    best = _sharpest(
        spectrum.values,
        excess.floor,
        excess.masked,
        candidates,
        origins,
        factors,
        spectrum.positions[0],
        spectrum.resolution,
    )
    score = float(totals[best])
    single = tail_probability(excess, n_terms, score)
    p_value = chance_of_any(single, independent_trials(n_candidates))
    return _described(excess, origins, factors, candidates[best], score, p_value)


def comb_at(excess: LinesOverFloor, fundamental: float, multiples: NDArray[np.int_], p_value: float) -> Comb:
    """Return the family of the given multiples of a fundamental that was found by other means.

    Parameters
    ----------
    excess : LinesOverFloor
    fundamental : float
        In the axis' unit; it is refined on the lines.
    multiples : array of int, (n,)
    p_value : float
        Of the method that found it.

    Returns
    -------
    Comb
        Its score is the sum of the lines' log ratios.
    """
    fitted = _described(excess, np.zeros(len(multiples)), multiples, fundamental, 0.0, p_value)
    lines = excess.lines_at(multiples * fitted.fundamental)
    return replace(fitted, score=float(excess.scores()[lines].sum()))


def independent_trials(n_candidates: int) -> int:
    """Return how many of the fundamentals tried are independent: three fall on one line of the highest multiple."""
    return max(1, n_candidates // 3)


def chance_of_any(p_value: float, n_trials: float) -> float:
    """Return the probability that any of n independent trials gives so small a p-value: 1 − (1 − p)ⁿ.

    Z. Šidák, "Rectangular confidence regions for the means of multivariate normal distributions", 1967.
    """
    return float(-np.expm1(n_trials * np.log1p(-min(p_value, 1 - 1e-12))))


def score_needed(excess: LinesOverFloor, n_terms: int, low: float, high: float, probability: float) -> float:
    """Return the score that the best family between `low` and `high` reaches by chance only with `probability`.

    Parameters
    ----------
    excess : LinesOverFloor
    n_terms : int
        Lines of a family.
    low, high : float
        Range of fundamentals, in the axis' unit.
    probability : float
        Of such a score or a higher one among all fundamentals.

    Returns
    -------
    float
        Sum of log ratios; infinite if even lines that all count in full would be more probable than that.
    """
    n_candidates = int((high - low) * 3 * n_terms / excess.spectrum.resolution) + 2
    tail = np.cumsum(excess.sum_density(n_terms)[::-1])[::-1]
    allowed = np.flatnonzero(tail <= probability / independent_trials(n_candidates))
    score = float(allowed[0]) * _STEP + n_terms * _STEP / 2 if len(allowed) else np.inf
    return score if score <= n_terms * LOG_RATIO_LIMIT else np.inf


def _widest(spectrum: Spectrum, starts: FloatArray, multiples: NDArray[np.int_]) -> float:
    """Return the largest fundamental with at least one multiple on the axis."""
    room = np.where(multiples > 0, spectrum.positions[-1] - starts[:, None], starts[:, None])
    return float(np.max(room / np.abs(multiples)))


def _highest(
    excess: LinesOverFloor, origins: FloatArray, factors: NDArray[np.int_], low: float, step: float, n_candidates: int
) -> tuple[FloatArray, FloatArray, int]:
    """Return the fundamentals with practically the highest score, their scores, and the number of lines summed.

    Scores are clipped and widened by a line, so that strong families score the same over several candidates.
    """
    scores, resolution = excess.scores(), excess.spectrum.resolution
    inside_once = np.zeros(len(factors), dtype=np.bool_)
    kept: list[FloatArray] = []
    highest = -np.inf
    for begin in range(0, n_candidates, CHUNK):
        candidates = low + step * np.arange(begin, min(begin + CHUNK, n_candidates))
        total = _comb_totals(
            scores, candidates, origins, factors, float(excess.spectrum.positions[0]), resolution, inside_once
        )
        highest = max(highest, float(total.max()))
        among = np.flatnonzero(total >= highest - 0.5)[:CHUNK]
        kept.append(np.stack([candidates[among], total[among]]))
    peaks = np.concatenate([part[:, part[1] >= highest - 0.5] for part in kept], axis=1)[:, :CHUNK]
    return peaks[0], peaks[1], int(inside_once.sum())


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _mask_multiples(
    masked: NDArray[np.bool_],
    positions: FloatArray,
    resolution: float,
    fundamental: float,
    start: float,
    reach: float,
    skirt: float,
) -> None:
    """Mask the lines within `reach`, or `skirt` times their position, of the nearest start ± k·fundamental."""
    n = len(positions)
    for k in range(round((positions[0] - start) / fundamental), round((positions[-1] - start) / fundamental) + 1):
        centre = start + k * fundamental
        low = max(min(centre - reach, centre / (1 + skirt)), centre - fundamental / 2)
        high = min(max(centre + reach, centre / (1 - skirt)), centre + fundamental / 2)
        first, last = floor((low - positions[0]) / resolution), ceil((high - positions[0]) / resolution)
        for i in range(max(0, first), min(n, last + 1)):
            offset = (positions[i] - start) / fundamental
            if abs(offset - round(offset)) * fundamental <= max(reach, skirt * positions[i]):
                masked[i] = True


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _comb_totals(scores, candidates, origins, factors, first, resolution, inside_once):  # type: ignore[no-untyped-def]
    """Sum the scores nearest to origin + factor · candidate, and note which terms were on the spectrum at all."""
    total, per_resolution = np.zeros(len(candidates)), 1.0 / resolution
    for i in range(len(factors)):
        for j in range(len(candidates)):
            index = int(np.rint((origins[i] + factors[i] * candidates[j] - first) * per_resolution))
            if 0 <= index < len(scores):
                inside_once[i] = True
                total[j] += scores[index]
    return total


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _sharpest(values, floor, masked, candidates, origins, factors, first, resolution):  # type: ignore[no-untyped-def]
    """Return the candidate whose harmonics fit the peaks best: the sum of ln(A/A₀), each unclipped."""
    sums = np.zeros(len(candidates))
    for i in range(len(factors)):
        for j in range(len(candidates)):
            line = int(np.rint((origins[i] + factors[i] * candidates[j] - first) / resolution))
            line = min(max(line, 0), len(values) - 1)
            if values[line] > 0.0 and not masked[line]:
                # Clipped where the floor is almost zero.
                sums[j] += min(log(values[line] / floor[line]), 40.0) if floor[line] > 0.0 else 40.0
    return np.argmax(sums)


def tail_probability(excess: LinesOverFloor, n_terms: int, score: float) -> float:
    """Return P(sum of n_terms independent draws from the unmasked lines >= score).

    Parameters
    ----------
    excess : LinesOverFloor
    n_terms : int
        Lines of a family.
    score : float
        Sum of their log ratios.
    """
    # Draws were rounded down to their cell, so the sum may be half a cell per term higher than its cell says.
    threshold = int(np.floor((score - n_terms * _STEP / 2) / _STEP))
    return min(max(float(excess.sum_density(n_terms)[max(threshold, 0) :].sum()), 0.0), 1.0)


def _described(
    excess: LinesOverFloor,
    origins: FloatArray,
    multiples: NDArray[np.int_],
    fundamental: float,
    score: float,
    p_value: float,
) -> Comb:
    """Fit the fundamental to the peaks, and collect the family's lines."""
    spectrum = excess.spectrum
    fitted, peaks, positions, ratios_db = _fit_to_peaks(
        spectrum.values,
        spectrum.positions,
        spectrum.resolution,
        excess.floor,
        excess.masked,
        np.asarray(origins, dtype=np.float64),
        np.asarray(multiples, dtype=np.int64),
        float(fundamental),
    )
    strongest = peaks[int(np.argmax(ratios_db))] if len(peaks) else None
    return Comb(
        fitted,
        score,
        p_value,
        tuple(positions.tolist()),
        tuple(ratios_db.tolist()),
        0.0 if strongest is None else float(spectrum.values[strongest]),
        0.0 if strongest is None else float(excess.floor[strongest]),
    )


_vertex = njit(cache=True, nogil=True)(parabola_vertex)
_over_floor_db = njit(cache=True, nogil=True)(over_floor_db)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def _fit_to_peaks(values, at, resolution, floor, masked, origins, multiples, fundamental):  # type: ignore[no-untyped-def]
    """Return the fitted fundamental, and number, position and height of its lines that stand clearly above the floor.

    Least squares of position - origin = multiple · fundamental. Clearer lines have less scatter in position, so they
    are weighted by power over floor, clipped at 30 dB.
    """
    last, n = len(values) - 1, 0
    peaks, positions, ratios_db = np.empty(len(multiples), np.int64), np.empty(len(multiples)), np.empty(len(multiples))
    for _ in range(N_FITS):
        n, weights, products = 0, 0.0, 0.0
        for k in range(len(multiples)):
            place = origins[k] + multiples[k] * fundamental
            if not 0.0 < place <= at[last]:
                continue
            # Two lines away is still the same peak.
            nearest = int(np.rint((place - at[0]) / resolution))
            low, high = max(nearest - 2, 0), min(nearest + 2, last)
            i = low + int(np.argmax(values[low : high + 1]))
            ratio_db = _over_floor_db(values[i], floor[i])
            if ratio_db < CLEAR_LINE_DB or masked[i]:
                continue
            peaks[n], positions[n], ratios_db[n] = i, parabola_peak(values, at, resolution, i), ratio_db
            clearness = 10.0 ** (min(ratio_db, 30.0) / 10.0)
            weights += clearness * multiples[k] ** 2
            products += clearness * multiples[k] * (positions[n] - origins[k])
            n += 1
        if weights == 0.0:
            break
        fundamental = products / weights
    return fundamental, peaks[:n], positions[:n], ratios_db[:n]


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def parabola_peak(values, at, resolution, i):  # type: ignore[no-untyped-def]
    if not 0 < i < len(values) - 1:
        return at[i]
    before, middle, after = np.log(np.maximum(values[i - 1 : i + 2], 1e-300))
    return at[i] + _vertex(before, middle, after)[0] * resolution


def peak_position(spectrum: Spectrum, i: int) -> float:
    """Return the vertex of the parabola through the logarithms of a line and its neighbours.

    Parameters
    ----------
    spectrum : Spectrum
    i : int
        Number of the line. The first and the last have only one neighbour, and keep their positions.
    """
    return float(parabola_peak(spectrum.values, spectrum.positions, spectrum.resolution, i))


# --------------------
# Whether a line stands out from its neighbours: the foot of a strong line is above the floor, but is not a line.
# --------------------


INNER_LINES = 3
"""Closer lines belong to the line itself: two by the Hann window, one because it may lie between two."""

OUTER_LINES = 12
MIN_LINES = 6
"""The median of fewer lines says too little."""

RUN_UP_FOOT_ORDERS = 0.1
"""Width of a line's foot over a run-up, where its level changes from resonance to resonance."""


def neighbour_level(spectrum: Spectrum, position: float, outer_lines: float = OUTER_LINES) -> float | None:
    """Return the amplitude (root of the mean power) of the lines beside a line, None if these are too few.

    The mean is derived from the median, P = median/ln 2 for lines of noise, so that a neighbouring line has no effect.

    Parameters
    ----------
    spectrum : Spectrum
        Amplitudes.
    position : float
    outer_lines : float
        Extent of the neighbourhood, in lines.
    """
    i, n = spectrum.index_of(position), len(spectrum.values)
    reach = int(min(outer_lines, OUTER_LINES))
    below = spectrum.values[max(i - reach, 0) : max(i - INNER_LINES + 1, 0)]
    above = spectrum.values[min(i + INNER_LINES, n) : min(i + reach + 1, n)]
    neighbours = np.concatenate([below, above])
    if len(neighbours) < MIN_LINES:
        return None
    return float(np.sqrt(np.sort(neighbours**2)[len(neighbours) // 2] / log(2)))


def neighbour_levels(spectrum: Spectrum, *, of_both_sides: bool = False) -> FloatArray:
    """Return `neighbour_level` at every line; the ends are mirrored.

    Parameters
    ----------
    spectrum : Spectrum
        Amplitudes.
    of_both_sides : bool
        Use the higher of the levels on the two sides, where the skirt of a line may fall steeply.

    Returns
    -------
    array, (n_lines,)
        In the spectrum's unit.
    """
    from scipy.ndimage import median_filter

    power = np.asarray(spectrum.values, dtype=np.float64) ** 2
    if of_both_sides:
        width, n = OUTER_LINES - INNER_LINES + 1, len(power)
        running = median_filter(np.pad(power, OUTER_LINES, mode="symmetric"), width)[width // 2 :]
        medians = np.maximum(running[:n], running[OUTER_LINES + INNER_LINES :][:n])
    else:
        beside = np.abs(np.arange(-OUTER_LINES, OUTER_LINES + 1)) >= INNER_LINES
        # As a single row: in one dimension SciPy's filter uses the whole width, including the hole in its middle.
        medians = median_filter(power[None, :], footprint=beside[None, :], mode="reflect")[0]
    return np.asarray(np.sqrt(medians / log(2)))


# --------------------
# One revolution: windows with the most energy, and turning one average onto another.
# --------------------


# Two searches for the tooth that stands out use the windows, and differ for a reason. `analyze` adds the energy of the
# whole difference signal, because its test against surrogates (same spectrum, random phases) needs a statistic of the
# signal as it is. `estimate_crack` first divides each band about a mesh harmonic by its own median, as its calibration
# did: a resonance multiplies all teeth alike.
#
# Two alignments use the scores, and differ as well. `estimate_crack` and the gap diagnosis compare the same gears: they
# try whole teeth, or none if marks say so, and a fraction of a tooth about them; slow orders do not count, as unbalance
# differs from day to day. `compare` turns a simulation of any gears onto a recording, by any angle and with all orders.


def sliding_mean(values: FloatArray, width: int) -> FloatArray:
    """Return the mean over the window that starts at each sample of a periodic signal.

    Parameters
    ----------
    values : array, (…, n)
        One period.
    width : int
        Of the window, in samples; at most n.

    Examples
    --------
    >>> sliding_mean(np.array([0.0, 2.0, 4.0, 6.0]), 2).tolist()
    [1.0, 3.0, 5.0, 3.0]
    """
    before = np.zeros((*values.shape[:-1], 1))
    sums = np.cumsum(np.concatenate([before, values, values[..., :width]], axis=-1), axis=-1)
    return np.asarray((sums[..., width : width + values.shape[-1]] - sums[..., : values.shape[-1]]) / width)


def strongest_window(energies: FloatArray) -> tuple[int, float]:
    """Return where the window with the most energy starts, and the ratio of its energy to the median window's.

    Parameters
    ----------
    energies : array, (n,)
        Of the window that starts at each sample.
    """
    start = int(np.argmax(energies))
    return start, float(energies[start] / np.median(energies))


def turned_lines(lines: ComplexArray, shift_rev: float) -> ComplexArray:
    """Return the lines of an average turned forward, x[n] e^{−2πi n s}.

    Parameters
    ----------
    lines : array, (..., n_orders)
        x, complex; order 0 first on the last axis.
    shift_rev : float
        s, delay of the average in revolutions.
    """
    turned: ComplexArray = lines * np.exp(-2j * np.pi * np.arange(lines.shape[-1]) * shift_rev)
    return turned


def shift_scores(cross: ComplexArray, shifts_rev: FloatArray) -> FloatArray:
    """Return Σ_n Re(c[n] e^{2πi n s}) for each shift s: how well averages agree when the second is turned by s.

    Parameters
    ----------
    cross : complex array, (n_orders,)
        Lines of the first times the conjugate lines of the second, weighted.
    shifts_rev : array, (n_shifts,)
    """
    scores: FloatArray = np.real(np.exp(2j * np.pi * np.outer(shifts_rev, np.arange(len(cross)))) @ cross)
    return scores


def best_shift(cross: ComplexArray, is_possible: Callable[[FloatArray], NDArray[np.bool_]] | None = None) -> float:
    """Return the shift of the largest score, −0.5 to 0.5 revolutions; 0 if there is nothing to compare.

    Parameters
    ----------
    cross : complex array, (n_orders,)
        As in `shift_scores`.
    is_possible : callable, optional
        Returns which of many shifts, in revolutions, are allowed; default: all.
    """
    if not np.any(cross):
        return 0.0
    n = next_fast_len(16 * len(cross))  # 16 to a turn of the highest order, before the best is refined
    shifts = np.fft.fftfreq(n)
    scores = np.real(ifft(cross, n))
    if is_possible is not None:
        scores[~is_possible(shifts)] = -np.inf
    start = float(shifts[int(np.argmax(scores))])
    refined = minimize_scalar(
        lambda shift: -float(shift_scores(cross, np.array([shift]))[0]),
        bounds=(start - 1.0 / n, start + 1.0 / n),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float((refined.x + 0.5) % 1.0 - 0.5)


def circular_correlation(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return Σ_i x[i + s] y[i] for each shift s in samples; at its maximum, `np.roll(y, s)` is aligned with x.

    Parameters
    ----------
    x, y : array, (n,)
        One period each.

    Returns
    -------
    array, (n,)
        In the product of both units, shift 0 first.
    """
    correlation: FloatArray = np.fft.irfft(np.fft.rfft(x) * np.conj(np.fft.rfft(y)), len(x))
    return correlation
