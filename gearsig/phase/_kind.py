"""The kind of a motion: periodic, subharmonic, quasi-periodic, chaotic, or undecided."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, count, freeze, not_negative
from gearsig.errors import InputError, answer_or_none
from gearsig.formatting import counted
from gearsig.phase._embedding import EmbeddingDimension, chosen_delay, delay_embedding, embedding_dimension
from gearsig.phase._lyapunov import LyapunovExponent, largest_lyapunov_exponent
from gearsig.phase._neighbours import GOLDEN
from gearsig.phase._plane import PhasePortrait, checked_series, mean_period_samples
from gearsig.phase._section import CycleLock, PoincareSection, check_lock, poincare_section, section_period
from gearsig.results import Result

ChaosVerdict = Literal["regular", "irregular", "undecided"]


@dataclass(frozen=True)
class ChaosTest(Result, columns=("c_rad", "k_of_c")):
    """Result of the 0–1 test.

    Parameters
    ----------
    k : float
        Median of `k_of_c`: near 0 for regular motion, near 1 for chaos (and for noise: the test presumes determinism).
    k_of_c, c_rad : arrays, (n_frequencies,)
    damping : float
        Weight of the term that keeps weak noise from being mistaken for chaos; 0: the plain modified test.
    n_values : int
    verdict : str
        "regular" (k < 0.2), "irregular" (k > 0.8), otherwise or if the values are oversampled "undecided".
    oversampled : bool
        Whether neighbouring values are so close that the test would mistake chaos for regular motion.
    source : str
    every : int
        Stride: every `every`-th value was used.
    reason : str
        Why it is undecided; empty otherwise.
    """

    k: float
    k_of_c: FloatArray
    c_rad: FloatArray
    damping: float
    n_values: int
    verdict: ChaosVerdict
    oversampled: bool
    source: str
    every: int = 1
    reason: str = ""

    def __post_init__(self) -> None:
        freeze(self, "k_of_c", "c_rad")


MIN_VALUES, MAX_VALUES = 200, 20_000
LOWEST_C, HIGHEST_C = np.pi / 5.0, 4.0 * np.pi / 5.0
REGULAR, IRREGULAR = 0.2, 0.8


def zero_one_test(
    values: FloatArray, *, damping: float = 0.0, n_frequencies: int = 100, every: int | None = None, source: str = ""
) -> ChaosTest:
    """Return the 0–1 test of a series: K near 0 for regular motion, near 1 for chaos.

    With z(n) = Σ_{j≤n} φ(j) e^{icj}: M(n) = mean over j ≤ N - n_cut of |z(j + n) - z(j)|², n = 1 … n_cut = N/10;
    D(n) = M(n) - ⟨φ⟩² (1 - cos nc)/(1 - cos c) (modified); D*(n) = D(n) + α σ² sin(√2 n) (damped);
    K(c) = correlation of D* with n; K = median over c in π/5 … 4π/5.

    Parameters
    ----------
    values : array, (n_values,)
        At least 200, preferably the points of a Poincaré section, or a map; only the first 20 000 are used.
    damping : float
        α, not negative. The term keeps a slowly growing M, due to measurement noise on regular motion, from being
        mistaken for chaos; weak chaos is then missed as well. About 1 to 2.5 for noise of a few percent.
    n_frequencies : int
        Number of values of c, spread by the golden ratio so that few of them resonate with the motion.
    every : int or None
        Stride: every `every`-th value is used. None: the first minimum of the mutual information, 1 for a map, less if
        fewer than 200 values would be left. If the values used are still too close to each other, the verdict is
        "undecided", and `ChaosTest.reason` says so.
    source : str

    Returns
    -------
    ChaosTest
        "irregular" means chaos only if the motion is known to be deterministic: noise gives K near 1 as well.

    Raises
    ------
    InputError, RefusalError
        On NaN, a constant, or too few values.

    Notes
    -----
    The damping term in the original has ⟨φ⟩², which vanishes for vibration; here it is replaced by the variance σ².

    Source: G. A. Gottwald, I. Melbourne, *On the implementation of the 0–1 test for chaos*, SIAM Journal on Applied
    Dynamical Systems 8 (2009); damping: J. H. P. Dawes, M. C. Freeland, *The '0–1 test for chaos' and strange
    nonchaotic attractors* (2008).
    """
    alpha = not_negative(damping, "damping")
    count(n_frequencies, "n_frequencies", minimum=10)
    x = checked_series(values, minimum=MIN_VALUES)
    step = min(chosen_delay(x, 1.0), len(x) // MIN_VALUES) if every is None else count(every, "every")
    phi = x[::step][:MAX_VALUES]
    if len(phi) < MIN_VALUES:
        raise InputError(
            f"{len(phi)} values are left when every {step}-th is taken",
            allowed=f"at least {MIN_VALUES}",
            remedy="record longer",
        )
    c = LOWEST_C + (HIGHEST_C - LOWEST_C) * ((np.arange(n_frequencies) + 0.5) * GOLDEN % 1.0)  # the golden ratio
    scale = float(phi.std())
    k_of_c = np.array([_k(phi / scale, float(frequency), alpha) for frequency in c])
    k = float(np.median(k_of_c))
    verdict, reason = _verdict(k, _oversampled(phi), step)
    return ChaosTest(
        k=k,
        k_of_c=k_of_c,
        c_rad=c,
        damping=alpha,
        n_values=len(phi),
        verdict=verdict,
        oversampled=_oversampled(phi),
        source=source,
        every=step,
        reason=reason,
    )


def zero_one_test_of_section(section: PoincareSection, *, axis: int = 0, damping: float = 0.0) -> ChaosTest:
    """Return the 0–1 test of one coordinate of a Poincaré section.

    Points that scatter by less than 1e-6 of the path's size count as one point, which is regular: K = 0.
    """
    values = section.points[:, axis]
    source = f"{section.source}, section {section.section}"
    if section.n_points >= 2 and float(np.std(values)) < 1e-6 * float(section.extent[axis]):
        return ChaosTest(0.0, np.zeros(1), np.array([LOWEST_C]), damping, section.n_points, "regular", False, source)
    every = None if _oversampled(values) else 1  # a section is a map already, unless it drifts slowly
    return zero_one_test(values, damping=damping, every=every, source=source)


def translation_walk(values: FloatArray, c_rad: float, *, every: int = 1) -> FloatArray:
    """Return the walk (p, q) of the 0–1 test, (n_values, 2), which is bounded for regular motion, Brownian for chaos.

    p(n) + i q(n) = Σ_{j≤n} (φ(j) - ⟨φ⟩) e^{icj} / σ.

    Parameters
    ----------
    values : array, (n_values,)
        As in `zero_one_test`.
    c_rad : float
        One of `ChaosTest.c_rad`.
    every : int
        Stride: every `every`-th value is used.

    Notes
    -----
    The mean is removed: it would add a rotation around a circle that says nothing about the motion.
    """
    x = checked_series(values, minimum=MIN_VALUES)
    phi = x[:: count(every, "every")][:MAX_VALUES]
    z = np.cumsum((phi - phi.mean()) / phi.std() * np.exp(1j * c_rad * np.arange(1, len(phi) + 1)))
    return np.column_stack([z.real, z.imag])


def _k(phi: FloatArray, c: float, alpha: float) -> float:
    n_cut = len(phi) // 10
    n = np.arange(1, n_cut + 1)
    d = mean_square_displacement(phi, c, n_cut) - phi.mean() ** 2 * (1.0 - np.cos(n * c)) / (1.0 - np.cos(c))
    d = d + alpha * np.sin(np.sqrt(2.0) * n)
    deviation = d.std()
    return float(np.mean((n - n.mean()) * (d - d.mean())) / (n.std() * deviation)) if deviation > 0.0 else 0.0


def mean_square_displacement(phi: FloatArray, c: float, n_cut: int) -> FloatArray:
    """Return M(n) for n = 1 … n_cut, (n_cut,), by one correlation instead of n_cut sums.

    Σ|z(j+n) - z(j)|² = Σ|z(j+n)|² + Σ|z(j)|² - 2 Re Σ z(j+n) z*(j), over the same N - n_cut values of j for all n.
    """
    from scipy import fft

    z = np.cumsum(phi * np.exp(1j * c * np.arange(1, len(phi) + 1)))
    z -= z.mean()
    n_base = len(phi) - n_cut
    length = fft.next_fast_len(len(z) + n_base)
    cross = fft.ifft(fft.fft(z, length) * np.conj(fft.fft(z[:n_base], length)))[1 : n_cut + 1].real
    power = np.concatenate([[0.0], np.cumsum(np.square(z.real) + np.square(z.imag))])
    shifted = power[n_base + 1 : n_base + n_cut + 1] - power[1 : n_cut + 1]
    result: FloatArray = (shifted + power[n_base] - 2.0 * cross) / n_base
    return result


def _oversampled(phi: FloatArray) -> bool:
    """Whether the range is more than ten times the mean step, the usual rule of thumb for this test.

    The range is that of the central 98 % of the values: impacts widen the full range at any spacing of the values.
    """
    low, high = np.quantile(phi, (0.01, 0.99))
    return float(high - low) > 10.0 * float(np.mean(np.abs(np.diff(phi))))


def _verdict(k: float, oversampled: bool, step: int) -> tuple[ChaosVerdict, str]:
    if oversampled:
        sampling = "each value" if step == 1 else f"every {step}-th value"
        return "undecided", (
            f"with {sampling} taken, neighbours lie too close: chaos would look regular, and noise on regular motion "
            "irregular; take fewer values, or record longer"
        )
    if k < REGULAR:
        return "regular", ""
    return ("irregular", "") if k > IRREGULAR else ("undecided", f"K lies between {REGULAR:g} and {IRREGULAR:g}")


Kind = Literal["periodic", "subharmonic", "quasi-periodic", "chaotic", "stochastic", "undecided"]


@dataclass(frozen=True)
class MotionKind(Result):
    """The kind of a motion with its evidence.

    Parameters
    ----------
    kind : str
        "periodic": repeats after each cycle of the lock; "subharmonic": after `period` cycles; "quasi-periodic",
        "chaotic", "stochastic"; "undecided" if the measures disagree or give no answer.
    period : int
        Number of cycles after which the motion repeats; 0 if it does not.
    evidence : tuple of str
        One sentence per measure.
    section : PoincareSection
    exponent : LyapunovExponent or None
    chaos_test : ChaosTest or None
    """

    kind: Kind
    period: int
    evidence: tuple[str, ...]
    section: PoincareSection
    exponent: LyapunovExponent | None = None
    chaos_test: ChaosTest | None = None


def kind_of_motion(
    portrait: PhasePortrait, lock: CycleLock, *, tolerance: float = 0.05, noise_free: bool = False
) -> MotionKind:
    """Return the kind of a motion from its Poincaré section, its Lyapunov exponent and the 0–1 test.

    A section that repeats decides alone. Otherwise: no dimension unfolds the first axis → stochastic; neighbours
    diverge and K > 0.8 → chaotic; they do not diverge and K < 0.2 → quasi-periodic; everything else is undecided.

    Parameters
    ----------
    portrait : PhasePortrait
    lock : CycleLock
    tolerance : float
        Of the section, in standard deviations of the path; above its scatter from noise.
    noise_free : bool
        Whether the path is known to be deterministic, e.g. from a model: the 0–1 test then needs no damping, and
        decides alone if it is regular and the exponent gives no answer.

    Raises
    ------
    RefusalError
        If there is no section (see `poincare_section`). Measures without an answer are named in the evidence.

    Notes
    -----
    Measured gear vibration is mostly periodic with noise and modulation; "undecided" is then the right answer.

    "stochastic" means that the motion does not unfold. Clean chaos recorded over fewer than about a hundred cycles may
    not unfold either: record longer, or for a model's motion set `noise_free`, which makes it "undecided".
    """
    check_lock(lock, needed=True)
    section = poincare_section(portrait, lock)
    period = section_period(section, tolerance=tolerance)
    if period:
        after = f"the section repeats after {counted(period, 'cycle')} of the {lock.name}"
        shown_by = f"{after}, within {tolerance:g} of the path's size"
        return MotionKind("periodic" if period == 1 else "subharmonic", period, (shown_by,), section)
    evidence = [f"the section of {section.n_points} points does not repeat within 16 cycles of the {lock.name}"]
    test = answer_or_none(
        lambda: zero_one_test_of_section(section, damping=0.0 if noise_free else 1.0), "0–1 test", evidence
    )
    if test is not None:
        why = f" ({test.reason})" if test.reason else ""
        evidence.append(f"0–1 test of the section: K = {test.k:.2f}, {test.verdict}{why}")
    exponent, stochastic = _exponent(portrait, evidence)
    return MotionKind(
        _decide(test, exponent, stochastic, noise_free=noise_free), 0, tuple(evidence), section, exponent, test
    )


def _exponent(portrait: PhasePortrait, evidence: list[str]) -> tuple[LyapunovExponent | None, bool]:
    """Return the exponent, and whether no dimension unfolds the path; both are added to the evidence."""
    x, rate = np.ascontiguousarray(portrait.points[:, 0]), portrait.sampling_rate_hz
    dimension = answer_or_none(lambda: _dimension(x, rate), "embedding dimension", evidence)
    if dimension is None:
        return None, False
    if dimension.dimension == 0:
        evidence.append(
            f"no dimension up to {dimension.dimensions[-1]} unfolds the {portrait.axis_names[0]}: noise does this; so "
            "does clean chaos of a few dozen cycles"
        )
        return None, True
    path = delay_embedding(x, rate, delay_samples=dimension.delay_samples, dimension=dimension.dimension)
    exponent = answer_or_none(lambda: largest_lyapunov_exponent(path), "Lyapunov exponent", evidence)
    if exponent is not None:
        size = f"{exponent.exponent_per_s:.3g} ± {exponent.uncertainty_per_s:.2g} 1/s"
        evidence.append(f"largest Lyapunov exponent {size} in {dimension.dimension} dimensions: {exponent.verdict}")
    return exponent, False


def _dimension(x: FloatArray, rate: float) -> EmbeddingDimension:
    """Return the embedding dimension; if the usual delay does not unfold the path, at a quarter of the mean period.

    The mutual information of chaos may fall for most of a cycle, during which neighbours diverge too far. At a quarter
    of the mean period, filtered noise still has at least 5 % false neighbours; at an eighth it would look
    deterministic.
    """
    usual = embedding_dimension(x, rate)
    shorter = round(mean_period_samples(x) / 4)
    if usual.dimension or not 1 <= shorter < usual.delay_samples:
        return usual
    return embedding_dimension(x, rate, delay_samples=shorter)


def _decide(test: ChaosTest | None, exponent: LyapunovExponent | None, stochastic: bool, *, noise_free: bool) -> Kind:
    silent = exponent is None or exponent.verdict == "undecided"
    if noise_free and silent and test is not None and test.verdict == "regular":
        return "quasi-periodic"
    # Irregular without diverging neighbours is not chaos: teeth that differ repeat only after the hunting-tooth period.
    if stochastic:
        return "undecided" if noise_free else "stochastic"
    if test is None or exponent is None:
        return "undecided"
    if exponent.verdict == "diverging" and test.verdict == "irregular":
        return "chaotic"
    if exponent.verdict == "not diverging" and test.verdict == "regular":
        return "quasi-periodic"
    return "undecided"
