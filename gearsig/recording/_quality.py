"""Find defects of the samples themselves: dead, clipped, stuck, offset or coarsely quantised channels."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, read_only
from gearsig.compiled import njit
from gearsig.formatting import counted, percent, signed
from gearsig.peaks import parabola_vertex
from gearsig.recording._types import Channel, Recording


@dataclass(frozen=True)
class SampleLevels:
    """Distinct values of a channel.

    Parameters
    ----------
    n_used : int
        Distinct values.
    step : float or None
        Spacing of the converter's levels; None if the values lie on no grid.
    n_spanned : int
        Levels from lowest to highest, inclusive; `n_used` if they lie on no grid.
    """

    n_used: int
    step: float | None
    n_spanned: int


def find_levels(x: FloatArray) -> SampleLevels:
    """Return the distinct levels of a channel, (n_samples,).

    The step is the smallest distance between two distinct values, if all values are whole multiples of it apart. A
    signal that never takes neighbouring levels has no step here, nor has a long float signal.
    """
    values = np.unique(x).astype(np.float64)
    if len(values) < 2:
        return SampleLevels(1, None, 1)
    step = float(np.diff(values).min())
    span = float(values[-1] - values[0])
    if step < 1e-7 * span:  # finer than 23 bits: rounding of floats, not a converter
        return SampleLevels(len(values), None, len(values))
    numbers = (values - values[0]) / step
    # The smallest of many distances is slightly wrong; the span divided by its number of steps is not.
    step = span / round(span / step)
    numbers = (values - values[0]) / step
    # Scaling in float32 moves levels slightly off their grid.
    if np.abs(numbers - np.round(numbers)).max() > 0.02:
        return SampleLevels(len(values), None, len(values))
    return SampleLevels(len(values), step, round(span / step) + 1)


MIN_RUN = 3
CORNER_DROP = 8.0
"""Twice the drop of a parabola, see `find_clipping`."""


@dataclass(frozen=True)
class Clipping:
    """Number of samples held at a limit, and the limit."""

    n_samples: int
    place: str


def find_clipping(x: FloatArray, levels: SampleLevels, *, rest: float | None = None) -> Clipping | None:
    r"""Return where a channel is clipped, or None.

    A smooth peak is a parabola: a signal that stays within a width w of the top for ±h samples has fallen by about
    4 w after ±2 h. A run of at least three samples has *corners* if the signal has fallen by more than 8 w there, on
    both sides: it was cut, not rounded. Two tests at each end of the range look for such runs; either is sufficient.

    - *Held samples.* Runs of samples equal to the extreme; w is one step of the converter. They must hold three times
      as many samples as the next step below, which noise never does. Alternatively, the extreme holds a thousandth of
      the samples and ten times as many as any value between the extremes: a fast signal reaches it in single samples.
    - *Pile-up.* Runs in the last 0.5 % of the range, w. This band must hold 6 times as many samples as the 0.5 %
      before it. Near a parabolic maximum, time goes with the square root of the distance from it, so this ratio is at
      most

      .. math:: 1 / (\sqrt{2} - 1) = 2.41,

      which a sine reaches; noise stays below 1. This test finds limits with a little noise, e.g. those of an amplifier.

    Parameters
    ----------
    x : array, (n_samples,)
    levels : SampleLevels
        Those of `x`.
    rest : float or None
        Level at which the quantity itself rests at times, e.g. 0 for a force between parts that separate: an end of the
        range there is not a limit of the measurement.
    """
    low, high = float(x.min()), float(x.max())
    ends = {}
    for sign, extreme in ((1.0, high), (-1.0, low)):
        if extreme == rest:
            continue
        distance = sign * (extreme - x)  # 0 at the extreme, positive elsewhere
        n = max(_n_held(distance, levels), _n_piled(distance, high - low, levels.step))
        # A level that holds half of the samples is where the signal rests (the base of a pulse train, a level of a
        # square wave), not a limit.
        if n and n < 0.48 * len(x):
            ends[extreme] = n
    if not ends:
        return None
    place = " and ".join(f"{extreme:.4g}" for extreme in ends)
    return Clipping(sum(ends.values()), place)


def _n_held(distance: FloatArray, levels: SampleLevels) -> int:
    """Count the samples held exactly at the extreme; 0 if there are no more than noise would put there."""
    q = levels.step if levels.step is not None else float(np.finfo(distance.dtype).eps) * float(distance.max())
    held = distance == 0
    usual = len(held) / levels.n_used
    # Pairs count as runs if the extreme is twenty times as frequent as the average value: a tone whose period is a
    # whole number of samples has equal pairs too, but of all its values.
    min_run = MIN_RUN if np.count_nonzero(held) < 20.0 * usual else 2
    n = _n_in_cornered_runs(held, distance, q, min_run)
    n_next = int(np.count_nonzero((distance > 0) & (distance <= 1.5 * q)))
    n_held = int(np.count_nonzero(held))
    if n > 3.0 * n_next:
        return n_held
    # A fast signal reaches a limit in single samples, but no other value is nearly as frequent.
    if n_held < max(20.0, 1e-3 * len(held), 20.0 * usual):
        return 0
    places = np.rint(distance * (1e6 / float(distance.max())))  # values of a tone differ by rounding
    _, counts = np.unique(places[(places > 0) & (places < 1e6)], return_counts=True)
    return n_held if n_held > 10.0 * counts.max(initial=0) else 0


def _n_piled(distance: FloatArray, span: float, step: float | None) -> int:
    """Count the samples in the last band; 0 unless it holds far more than the one before."""
    width = 0.005 * span
    if step is not None and width < 2 * step:
        return 0  # the bands would hold one level or none
    in_last = distance < width
    n_last = _n_in_cornered_runs(in_last, distance, width, MIN_RUN)
    n_before = int(np.count_nonzero((distance >= width) & (distance < 2 * width)))
    return int(np.count_nonzero(in_last)) if n_last >= max(20, 6.0 * n_before) else 0


def _n_in_cornered_runs(at_limit: NDArray[np.bool_], distance: FloatArray, width: float, min_run: int) -> int:
    """Count the samples in runs of at least `min_run` samples with corners at both ends."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], at_limit, [False]))))
    starts, stops = edges[::2], edges[1::2]
    long = stops - starts >= min_run
    starts, stops = starts[long], stops[long]
    half = -(-(stops - starts) // 2)
    before, after = starts - half, stops - 1 + half
    inside = (before >= 0) & (after < len(distance))
    drop = np.minimum(distance[before[inside]], distance[after[inside]])
    return int((stops - starts)[inside][drop > CORNER_DROP * width].sum())


ProblemKind = Literal["dead", "clipped", "wrapped", "stuck", "stepped", "reversed", "hum", "offset", "quantised"]

CORNER_DISTANCE = 8
MIN_SAMPLES = 64
_OFFSET_QUANTITIES = frozenset(("acceleration", "velocity", "sound_pressure", "unknown"))


@dataclass(frozen=True)
class ChannelProblem:
    """A defect that makes a channel less useful.

    Parameters
    ----------
    channel : str
    kind : str
        One of `ProblemKind`.
    share : float
        Share of the samples affected, 0 to 1.
    evidence : str
        What was seen, with numbers.
    remedy : str
    frequency_hz : float or None
        For hum: frequency of the line.
    """

    channel: str
    kind: ProblemKind
    share: float
    evidence: str
    remedy: str
    frequency_hz: float | None = None

    @property
    def title(self) -> str:
        """The problem in one sentence."""
        return _TITLES.get(self.kind, "Channel {} is {}.").format(self.channel, self.kind)

    @property
    def text(self) -> str:
        """The title with its evidence, as the start of a sentence."""
        return f"{self.title.rstrip('.')} ({self.evidence})"

    @property
    def is_grave(self) -> bool:
        """Whether levels and lines may be wrong, which an offset or few levels hardly affect."""
        return self.kind not in ("offset", "quantised")


_TITLES = {
    "wrapped": "Channel {} has overflowed: its values wrap around.",
    "stepped": "The level of channel {} steps: gain, mounting or load changed.",
    "reversed": "Channel {} seems to run backwards in time.",
    "hum": "Mains hum dominates channel {}.",
}


def find_problems(recording: Recording) -> tuple[ChannelProblem, ...]:
    """Return the problems of the vibration channels; speed, tachometer and other channels are not checked.

    - *dead*: constant, or so small that the standard deviation vanishes in double precision; or at most four
      neighbouring levels and a standard deviation below 1/1000 of the median of the other channels with the same
      quantity and unit.
    - *clipped*: samples held at an end of the range, or piled up there, with corners that no smooth peak has.
    - *stuck*: runs of equal samples away from the extremes, at least 16 long, ten times longer than 99 % of the
      channel's runs, and with a corner at both ends (eight samples further the signal is more than eight converter
      steps away, unlike at a smooth turning point): a dropout of the measurement chain.
    - *wrapped*: five or more steps from one end of the range to the other that vanish when the range is added, or
      three or more samples that differ by the range from what their neighbours predict: an integer overflow.
    - *stepped*: the level changes suddenly by 4 dB or more and is steady before and after: gain, mounting or load.
    - *reversed*: impacts swell and end suddenly, whereas those of a machine begin suddenly and ring down.
    - *hum*: more than half of the power lies in one line within 0.1 % of a multiple of 50 or 60 Hz.
    - *offset*: the mean is more than three times the standard deviation, for quantities without a static part.
    - *quantised*: fewer than 64 equidistant levels from lowest to highest, i.e. less than 6 bits.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    tuple of ChannelProblem
        In the order of the channels; empty if nothing was found. Fewer than 64 samples are only checked for "dead".
    """
    problems: list[ChannelProblem] = []
    spreads = {c.name: float(_standard_deviation(read_only(recording.values(c.name)))) for c in recording.channels}
    for channel in recording.channels:
        if channel.is_vibration:
            other_spreads = [spreads[c.name] for c in recording.channels if _is_comparable(c, channel)]
            problems += _problems_of(channel, recording.values(channel.name), spreads[channel.name], other_spreads)
            if problems and problems[-1].channel == channel.name and problems[-1].kind == "dead":
                continue
            problems += _further_problems(channel, recording.values(channel.name), recording.sampling_rate_hz)
    return tuple(problems)


@njit(cache=True, nogil=True, fastmath={"contract", "reassoc", "nsz"})  # type: ignore[untyped-decorator,unused-ignore]
def _standard_deviation(x):  # type: ignore[no-untyped-def]
    """Return the standard deviation with divisor N, in double precision."""
    total, squares = 0.0, 0.0
    for i in range(x.shape[0]):
        total += x[i]
    mean = total / x.shape[0]
    for i in range(x.shape[0]):
        deviation = x[i] - mean
        squares += deviation * deviation
    return np.sqrt(squares / x.shape[0])


def _is_comparable(candidate: Channel, channel: Channel) -> bool:
    same = (candidate.quantity, candidate.unit) == (channel.quantity, channel.unit)
    return same and candidate.name != channel.name


def _problems_of(channel: Channel, x: FloatArray, spread: float, other_spreads: list[float]) -> list[ChannelProblem]:
    levels = find_levels(x)
    dead = _dead(channel, x, levels, spread, other_spreads)
    if dead is not None:
        return [dead]
    if len(x) < MIN_SAMPLES:
        return []
    tests = (
        _clipped(channel, x, levels),
        _stuck(channel, x, levels),
        _offset(channel, x, spread),
        _quantised(channel, levels),
    )
    return [problem for problem in tests if problem is not None]


def _dead(
    channel: Channel, x: FloatArray, levels: SampleLevels, spread: float, other_spreads: list[float]
) -> ChannelProblem | None:
    remedy = "check sensor, cable and input of this channel, and leave it out"
    if levels.n_used == 1:
        return ChannelProblem(channel.name, "dead", 1.0, f"all {len(x)} samples are {x[0]:g}", remedy)
    if spread == 0:  # values so small that their squares underflow
        evidence = f"the samples differ, by {np.ptp(x):.2g} at most, too little for a standard deviation"
        return ChannelProblem(channel.name, "dead", 1.0, evidence, remedy)
    # An open input flickers by a step or two of the converter, far below the other channels.
    if not other_spreads or levels.n_spanned > 4 or spread > 1e-3 * float(np.median(other_spreads)):
        return None
    evidence = (
        f"only {levels.n_used} levels, standard deviation {spread:.3g}; "
        f"the other channels' is {float(np.median(other_spreads)):.3g}"
    )
    return ChannelProblem(channel.name, "dead", 1.0, evidence, remedy)


def _clipped(channel: Channel, x: FloatArray, levels: SampleLevels) -> ChannelProblem | None:
    # Parts that separate carry no force, e.g. tooth flanks in their backlash.
    clipping = find_clipping(x, levels, rest=0.0 if channel.quantity == "force" else None)
    if clipping is None:
        return None
    share = clipping.n_samples / len(x)
    evidence = f"{clipping.n_samples} samples ({100 * share:.2g} %) are held at {clipping.place}"
    remedy = "measure again with a larger input range; peak, crest factor and kurtosis are not reliable"
    return ChannelProblem(channel.name, "clipped", share, evidence, remedy)


SHORTEST_STUCK = 16
"""Minimum number of equal samples in a row."""


def _stuck(channel: Channel, x: FloatArray, levels: SampleLevels) -> ChannelProblem | None:
    ends = np.flatnonzero(np.diff(x) != 0)
    lengths = np.diff(np.concatenate(([-1], ends, [len(x) - 1])))
    if lengths.max() < SHORTEST_STUCK:
        return None
    starts = np.concatenate(([0], ends + 1))
    inside = (x[starts] != x.min()) & (x[starts] != x.max())
    usual = float(np.percentile(lengths, 99))
    long = inside & (lengths >= max(SHORTEST_STUCK, 10 * usual))
    step = levels.step or float(np.finfo(x.dtype).eps * np.abs(x).max())
    before, after = starts - CORNER_DISTANCE, starts + lengths - 1 + CORNER_DISTANCE
    long &= (before >= 0) & (after < len(x))
    held = x[starts[long]]
    away = np.minimum(np.abs(x[before[long]] - held), np.abs(x[after[long]] - held))
    long[long] = away > CORNER_DROP * step
    if not long.any():
        return None
    longest = int(np.argmax(np.where(long, lengths, 0)))
    share = float(lengths[long].sum() / len(x))
    evidence = (
        f"{counted(int(long.sum()), 'run')} of equal samples, the longest {lengths[longest]} samples "
        f"from sample {starts[longest]} at {x[starts[longest]]:g}; 99 % of the runs are no longer than {usual:.0f}"
    )
    remedy = "check for dropouts of the measurement chain or a machine at standstill, and cut these parts out"
    return ChannelProblem(channel.name, "stuck", share, evidence, remedy)


def _offset(channel: Channel, x: FloatArray, spread: float) -> ChannelProblem | None:
    mean = float(np.mean(x, dtype=np.float64))
    if channel.quantity not in _OFFSET_QUANTITIES or abs(mean) <= 3.0 * spread:
        return None
    evidence = f"the mean, {mean:.4g} {channel.unit}".rstrip() + f", is {abs(mean) / spread:.3g} times the rms about it"
    return ChannelProblem(
        channel.name, "offset", 1.0, evidence, "check bias and coupling; only the part about the mean counts"
    )


def _quantised(channel: Channel, levels: SampleLevels) -> ChannelProblem | None:
    # 6 bits: rounding noise is then 37 dB below a full-scale sine, but above many sidebands.
    if levels.step is None or levels.n_spanned >= 64:
        return None
    evidence = (
        f"the values span only {levels.n_spanned} levels of {levels.step:.3g} ({np.log2(levels.n_spanned):.1f} bits)"
    )
    remedy = "measure again with a smaller input range: weak sidebands are lost in the rounding"
    return ChannelProblem(channel.name, "quantised", 1.0, evidence, remedy)


# --------------------
# Signs that a record was scaled, cut, reversed or disturbed.
# --------------------


N_BLOCKS = 64
STEP_DB = 4.0
MIN_SAMPLES_OF_TEST = 4096
MAINS_HZ = (50.0, 60.0)
"""Mains frequencies."""
MAINS_WANDER = 1e-3
"""Largest relative distance of hum from a multiple of the mains: half of `gearsig.prepared.MAINS_TOLERANCE`.

This tolerance is used to report a channel or name a line, and a motor with little slip turns close by; the other only
excludes lines from a search, where a missed one does harm."""
LONGEST_TURNED = 1 << 18
"""Maximum number of samples in which the direction of time is examined."""


def _further_problems(channel: Channel, x: FloatArray, rate_hz: float) -> Iterator[ChannelProblem]:
    if len(x) < MIN_SAMPLES_OF_TEST:
        return
    tests = (_wrapped(channel, x), _stepped(channel, x), _reversed(channel, x, rate_hz), _hum(channel, x, rate_hz))
    yield from (problem for problem in tests if problem is not None)


def _wrapped(channel: Channel, x: FloatArray) -> ChannelProblem | None:
    low, high = float(x.min()), float(x.max())
    n = _n_steps_that_go_on(x, low, high)
    if n:
        evidence = f"{n} steps from one end of the range, {low:.4g} to {high:.4g}, to the other, and the slope goes on"
    elif n := _n_off_by_the_range(x, low, high):
        evidence = f"{n} samples differ by the range, {low:.4g} to {high:.4g}, from what their neighbours predict"
    else:
        return None
    remedy = "export again in a wider number format; nothing can be read from this channel"
    return ChannelProblem(channel.name, "wrapped", n / len(x), evidence, remedy)


def _n_steps_that_go_on(x: FloatArray, low: float, high: float) -> int:
    """Count steps from end to end of the range if many samples overflowed; 0 if they may be the signal's own."""
    span = high - low
    jumps = np.abs(np.diff(x)) > 0.75 * span
    n = int(np.count_nonzero(jumps))
    # A square wave jumps too, but rests in between; noise hardly ever goes from end to end.
    if n < 5 or n > 0.2 * len(x):
        return 0
    starts = np.flatnonzero(jumps)[1:-1]
    starts = starts[(starts > 0) & (starts + 2 < len(x))]
    if not len(starts):
        return 0
    before, after = x[starts] - x[starts - 1], x[starts + 2] - x[starts + 1]
    turned = np.sign(x[starts + 1] - x[starts])
    goes_on = (np.sign(before) == -turned) & (np.sign(after) == -turned)
    neighbour_steps = np.maximum(np.abs(before), np.abs(after)) / span
    # Wrapped values fill the range up to both ends; those of a natural signal thin out towards them.
    place = (x - low) / span
    outer, next_to = (np.count_nonzero(np.abs(place - 0.5) > 0.5 - edge) for edge in (0.01, 0.05))
    held = np.count_nonzero((x == low) | (x == high))
    # With more of them at the ends, or at one value there, the signal was clipped.
    if not 0.08 * next_to <= outer <= 0.5 * next_to or outer < 20 or held > 0.5 * outer:
        return 0
    # Uniform noise fills the range evenly, and goes from end to end too.
    is_even = np.median(neighbour_steps) > 0.6 and np.count_nonzero(np.abs(place - 0.5) < 0.05) < 3 * next_to
    if np.mean(goes_on) < 0.6 or np.median(neighbour_steps) < 0.02 or is_even:
        return 0
    # Tones of about three samples per cycle go from end to end as well, but as linear prediction expects.
    part = np.asarray(x[:LONGEST_TURNED], dtype=np.float64)
    errors = np.convolve(part - part.mean(), _prediction_error_filter(part))[: len(part)]
    steps = np.flatnonzero(jumps[ORDER : len(part) - 1]) + ORDER
    # An overflowed sample lies further in the direction of the step than predicted, not nearer.
    further = errors[steps + 1] * np.sign(part[steps + 1] - part[steps])
    is_expected = len(steps) > 0 and np.median(further) < EXPECTED_STEP * span
    return 0 if is_expected else n


ORDER, LONGEST_RUN, MIN_OFF, MOST_OFF, MOST_NEAR_ENDS = 24, 4, 3, 1000, 50_000
"""Of linear prediction; overflowed samples in a row; overflowed samples; candidates; samples near the ends."""

EXPECTED_STEP = 0.07
"""Median prediction error of steps from end to end, in their direction and over the range, below which they are the
signal's own: 0.001 to 0.05 in simulated tones of three samples per cycle, −0.08 in finite-element gears whose lines lie
below half the sampling rate; 0.10 and more where 144 to 8000 of 64,000 samples overflowed, in 14 measured and simulated
channels."""


def _n_off_by_the_range(x: FloatArray, low: float, high: float) -> int:
    r"""Count overflowed samples if they are few; 0 if they may be the signal's own.

    Linear prediction from both sides estimates how far a run of L samples is off: :math:`g = \sum e t / \sum t^2` with
    the error :math:`e = a * x` of one-sided prediction and that of such a run, :math:`t = a * 1_L`. An overflowed run
    is off by the range, other runs of 43 measured and simulated channels by at most a third of it.
    """
    span = high - low
    # An integer's range is centred on zero; one-sided clicks of a bad contact give a range that is not.
    if abs(low + high) > 0.1 * span or np.count_nonzero(np.abs(np.diff(x)) > 0.5 * span) < MIN_OFF:
        return 0
    starts = np.flatnonzero(np.abs(x) > 0.35 * span)
    starts = starts[(starts >= ORDER) & (starts + ORDER + LONGEST_RUN <= len(x))]
    if len(starts) > MOST_NEAR_ENDS:
        return 0
    restored = np.asarray(x, dtype=np.float64).copy()
    around = starts[:, None] + np.arange(-ORDER, ORDER + LONGEST_RUN)
    for _ in range(20):
        error_filter = _prediction_error_filter(restored[:LONGEST_TURNED])
        runs = [np.convolve(error_filter, np.ones(length)) for length in range(1, LONGEST_RUN + 1)]
        weights = np.zeros((around.shape[1], LONGEST_RUN))
        for i, run in enumerate(runs):
            weights[: ORDER + len(run), i] = np.convolve(run, error_filter[::-1]) / (run @ run)
        off = restored[around] @ weights
        clear = np.abs(off) * [np.linalg.norm(run) for run in runs]
        clear[np.abs(np.abs(off) - span) > 0.4 * span] = 0.0
        found = np.flatnonzero(np.any(clear > 0, axis=1))
        if not len(found):
            break
        if len(found) > MOST_OFF:
            return 0
        # A run that is off also affects the estimates of its neighbours: the clearest within reach is corrected first.
        best = clear[found].max(axis=1)
        near = np.abs(starts[found, None] - starts[found]) <= ORDER
        for i in found[best == np.where(near, best, 0.0).max(axis=1)]:
            length = int(np.argmax(clear[i]))
            restored[starts[i] : starts[i] + length + 1] -= np.sign(off[i, length]) * span
    n = int(np.count_nonzero(restored != x))
    return n if n >= MIN_OFF and np.count_nonzero(np.abs(off[:, 0]) > 0.35 * span) <= 0.02 * n else 0


def _prediction_error_filter(x: FloatArray) -> FloatArray:
    """Return 1, -a₁, … of linear prediction by the autocorrelation method (J. Makhoul, Proc. IEEE 63, 561, 1975)."""
    from scipy.fft import irfft, next_fast_len, rfft
    from scipy.linalg import solve_toeplitz

    size = next_fast_len(len(x) + ORDER, real=True)
    correlation = irfft(np.abs(rfft(x - x.mean(), size)) ** 2, size)[: ORDER + 1]
    correlation[0] *= 1.0 + 1e-6  # noise of -60 dB: pure tones could be predicted without error
    return np.concatenate(([1.0], -solve_toeplitz(correlation[:-1], correlation[1:])))


def _stepped(channel: Channel, x: FloatArray) -> ChannelProblem | None:
    if channel.quantity not in _OFFSET_QUANTITIES:
        return None
    size = len(x) // N_BLOCKS
    blocks = np.asarray(x[: size * N_BLOCKS]).reshape(N_BLOCKS, size)
    power = np.var(blocks, axis=1, dtype=np.float64)
    if not np.all(power > 0):
        return None
    level_db = 10.0 * np.log10(power)
    cuts = range(8, N_BLOCKS - 7)
    # A block may hold the step itself; what remains on both sides is steady.
    sides = [(level_db[: k - 1], level_db[k + 1 :]) for k in cuts]
    steps = np.array([after.mean() - before.mean() for before, after in sides])
    best = int(np.argmax(np.abs(steps)))
    step = float(steps[best])
    scatter = float(np.hypot(*(np.std(side, ddof=1) for side in sides[best])))
    near = level_db[cuts[best] + 1 : cuts[best] + 4].mean() - level_db[cuts[best] - 4 : cuts[best] - 1].mean()
    if abs(step) < max(STEP_DB, 4.0 * scatter) or abs(near) < 0.8 * abs(step):
        return None
    place = 100 * cuts[best] / N_BLOCKS
    evidence = f"the level changes by {signed(step)} dB at {place:.0f} % of the record, and is steady"
    remedy = "check gain, mounting and load, and analyse the parts before and after separately"
    return ChannelProblem(channel.name, "stepped", 1.0, f"{evidence} before and after ({scatter:.1f} dB)", remedy)


LASTS_S, CLEAR_LOG_RATIO, CLEAR_ERRORS, MIN_IMPACTS = 4e-3, 0.25, 8.0, 30
"""For impacts: time in which they ring down; minimum ln(energy after / energy before), also in standard errors, that
shows the direction of time; minimum number of impacts. The lowest ratio of 26 measured channels is -0.03 (1 standard
error), of 290 random motors and gearboxes -0.17 (3); six measured beside damaged races exceed 0.3 (8 or more)."""


def _reversed(channel: Channel, x: FloatArray, rate_hz: float) -> ChannelProblem | None:
    """Look for impacts that swell and end suddenly, by the energy beside their peaks, then by the envelope's steps."""
    from scipy.fft import rfft

    top_hz = 0.45 * rate_hz
    if channel.quantity not in _OFFSET_QUANTITIES or top_hz < 1000.0:
        return None
    x = np.asarray(x[: 1 << int(np.log2(min(len(x), LONGEST_TURNED)))], dtype=np.float64)
    spectrum, frequency = rfft(x - x.mean()), np.fft.rfftfreq(len(x), 1.0 / rate_hz)
    ratio, errors = _energy_after_peaks(spectrum, frequency, top_hz, max(2, int(LASTS_S * rate_hz)))
    if ratio > CLEAR_LOG_RATIO and errors > CLEAR_ERRORS:
        return None
    bands, skews, scores = _skewness_of_steps(spectrum, frequency, rate_hz, top_hz)
    # Time runs the same way in all bands: one that rings down is evidence against reversal. Overlapping impacts beat
    # and may fall faster than they rise in one band: the lowest skewness of some 25 measured channels is -0.5 (11
    # standard errors), beside 0.5 in the next band; the highest of reversed ones whose energies show it is 0.6 (12).
    # Where teeth separate and strike again, the first strike comes before the peak, but both ring down: 3 (19).
    turned = np.flatnonzero((skews < -1.0) & (scores < -4.0))
    if ratio < -CLEAR_LOG_RATIO and errors < -CLEAR_ERRORS and not np.any((skews > 1.0) & (scores > 8.0)):
        evidence = (
            f"impacts swell and end suddenly: the {1e3 * LASTS_S:g} ms before their peaks hold {np.exp(-ratio):.3g} "
            f"times the energy of those after, {abs(errors):.0f} standard errors from even"
        )
    elif len(turned) and not np.any((skews > 0.2) & (scores > 3.0)):
        i = turned[np.argmin(scores[turned])]
        evidence = (
            f"impacts between {bands[i][0]:.0f} and {bands[i][1]:.0f} Hz swell and end suddenly: skewness of the "
            f"envelope's steps {skews[i]:.2f}, {abs(scores[i]):.0f} standard errors below zero"
        )
    else:
        return None
    remedy = "check the order of the samples: if it is reversed, teeth are counted backwards and rising speeds fall"
    return ChannelProblem(channel.name, "reversed", 1.0, evidence, remedy)


def _energy_after_peaks(
    spectrum: NDArray[np.complexfloating], frequency: FloatArray, top_hz: float, n_ring: int
) -> tuple[float, float]:
    """Return the mean ln(energy after / energy before) of the impacts' peaks, and its ratio to its standard error.

    A peak is the highest value within four times the ring-down time, and eight times the mean power; with too few, both
    are 0. A mode that is struck rises within a part of that time and decays through all of it; two beating modes may
    rise more slowly at first.
    """
    from scipy.ndimage import maximum_filter1d

    power = _power_within(spectrum, frequency, 300.0, top_hz)
    is_peak = (power > 8.0 * power.mean()) & (power == maximum_filter1d(power, 8 * n_ring + 1))
    peaks = np.flatnonzero(is_peak)
    peaks = peaks[(peaks > n_ring) & (peaks < len(power) - n_ring - 1)]
    if len(peaks) < MIN_IMPACTS:
        return 0.0, 0.0
    energy = np.concatenate([[0.0], np.cumsum(power)])
    after, before = energy[peaks + 1 + n_ring] - energy[peaks + 1], energy[peaks] - energy[peaks - n_ring]
    ratios = np.log(np.maximum(after, 1e-300) / np.maximum(before, 1e-300))
    mean = float(ratios.mean())
    return mean, mean / max(float(ratios.std(ddof=1)) / len(peaks) ** 0.5, 1e-12)


def _skewness_of_steps(
    spectrum: NDArray[np.complexfloating], frequency: FloatArray, rate_hz: float, top_hz: float
) -> tuple[list[tuple[float, float]], FloatArray, FloatArray]:
    r"""Return four bands above 300 Hz, the skewness of the envelope's steps in each, and over its standard error.

    :math:`E[d^3] / E[d^2]^{3/2}` changes sign with the direction of time; it is positive for struck resonances. Its
    standard error follows from 32 parts.
    """
    edges = [300.0 * (top_hz / 300.0) ** (i / 4) for i in range(5)]
    bands = list(pairwise(edges))
    total = float(np.mean(spectrum.real**2 + spectrum.imag**2)) / len(frequency)
    skews, scores = np.zeros(4), np.zeros(4)
    for i, (low, high) in enumerate(bands):
        power = _power_within(spectrum, frequency, low, high)
        steps = np.diff(np.sqrt(power[:: max(1, int(rate_hz / (high - low)))]))
        # Too few steps, or rounding errors of a tone elsewhere, as in a simulation.
        if len(steps) < 32 or float(power.mean()) <= 1e-10 * total:
            continue
        parts = steps[: len(steps) // 32 * 32].reshape(32, -1)
        scale = float(np.mean(parts**2)) ** 1.5
        cubes = np.mean(parts**3, axis=1) / scale if scale > 0 else np.zeros(32)
        skews[i] = cubes.mean()
        scores[i] = skews[i] / max(float(np.std(cubes, ddof=1)) / 32**0.5, 1e-12)
    return bands, skews, scores


def _power_within(
    spectrum: NDArray[np.complexfloating], frequency: FloatArray, low_hz: float, high_hz: float
) -> FloatArray:
    """Return |z|² of the band between two frequencies, from the `rfft` of an even number of samples."""
    from scipy.fft import ifft

    first, last = np.searchsorted(frequency, low_hz, side="right"), np.searchsorted(frequency, high_hz)
    lines = np.zeros(2 * (len(frequency) - 1), dtype=np.complex128)
    lines[first:last] = 2.0 * spectrum[first:last]
    z = ifft(lines, overwrite_x=True)
    power: FloatArray = z.real**2
    power += z.imag**2
    return power


def _hum(channel: Channel, x: FloatArray, rate_hz: float) -> ChannelProblem | None:
    from scipy.fft import rfft

    n = 1 << int(np.log2(min(len(x), 4 * LONGEST_TURNED)))
    window = np.hanning(n)
    lines = rfft((x[:n] - np.mean(x[:n], dtype=np.float64)) * window, overwrite_x=True)
    power = lines.real**2
    power += lines.imag**2
    i, step_hz = int(np.argmax(power[1:-1])) + 1, rate_hz / n
    line_hz = (i + float(parabola_vertex(*np.sqrt(power[i - 1 : i + 2]))[0])) * step_hz
    share = float(np.sum(power[max(i - 2, 0) : i + 3]) / max(float(np.sum(power)), 1e-300))
    for mains_hz in MAINS_HZ:
        multiple = round(line_hz / mains_hz)
        deviation = abs(line_hz / (max(multiple, 1) * mains_hz) - 1)
        if 1 <= multiple <= 6 and deviation < MAINS_WANDER and share > 0.5 and step_hz < 2.0:
            evidence = f"{percent(share)} of the power is at {line_hz:.5g} Hz, a multiple of {mains_hz:.0f} Hz"
            remedy = "check shielding and earthing, unless a shaft or mesh is there; the hum masks weaker components"
            return ChannelProblem(channel.name, "hum", share, evidence, remedy, line_hz)
    return None
