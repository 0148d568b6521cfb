"""What kind of motion it is: periodic, subharmonic, quasi-periodic, chaotic, or not to be told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeVar

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.phase.chaos_test import zero_one_test_of_section
from gearsig.phase.checked_series import mean_period_samples
from gearsig.phase.dimension import embedding_dimension
from gearsig.phase.embedding import delay_embedding
from gearsig.phase.lock import CycleLock
from gearsig.phase.lyapunov import largest_lyapunov_exponent
from gearsig.phase.measures import ChaosTest, EmbeddingDimension, LyapunovExponent
from gearsig.phase.section import locked_section, section_period
from gearsig.phase.types import PhasePortrait, PoincareSection

T = TypeVar("T")
Kind = Literal["periodic", "subharmonic", "quasi-periodic", "chaotic", "stochastic", "undecided"]


@dataclass(frozen=True)
class MotionKind:
    """The kind of a motion with its evidence.

    Parameters
    ----------
    kind : str
        "periodic": repeats each cycle of the lock; "subharmonic": after `period` cycles; "quasi-periodic", "chaotic",
        "stochastic"; "undecided" where the measures disagree or cannot answer.
    period : int
        Cycles after which the motion repeats; 0 if it does not.
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
    """Return what kind of motion a path is, from its Poincaré section, its Lyapunov exponent and the 0–1 test.

    A section that repeats decides alone. Otherwise: no dimension unfolds the first axis → stochastic; neighbours part
    and K > 0.8 → chaotic; they do not part and K < 0.2 → quasi-periodic; all else is undecided.

    Parameters
    ----------
    portrait : PhasePortrait
    lock : CycleLock
    tolerance : float
        Of the section, in standard deviations of the path; above its scatter from noise.
    noise_free : bool
        Whether the path is known to be deterministic, as a model's: the 0–1 test then needs no damping, and a regular
        one decides alone where the exponent cannot answer.

    Raises
    ------
    RefusalError
        If there is no section (see `locked_section`). Measures that cannot answer are named in the evidence.

    Notes
    -----
    Measured gear vibration is periodic with noise and modulation in most cases; "undecided" is then the right answer.

    "stochastic" says that the motion does not unfold. Clean chaos recorded over fewer than about a hundred cycles may
    not unfold either: record longer, or state `noise_free` where it is a model's, which makes it "undecided".
    """
    section = locked_section(portrait, lock)
    period = section_period(section, tolerance=tolerance)
    if period:
        seen = (
            f"the section repeats after {period} cycle(s) of the {lock.name}, within {tolerance:g} of the path's size"
        )
        return MotionKind("periodic" if period == 1 else "subharmonic", period, (seen,), section)
    evidence = [f"the section of {section.n_points} points does not repeat within 16 cycles of the {lock.name}"]
    test = _answer(lambda: zero_one_test_of_section(section, damping=0.0 if noise_free else 1.0), "0–1 test", evidence)
    if test is not None:
        why = f" ({test.reason})" if test.reason else ""
        evidence.append(f"0–1 test of the section: K = {test.k:.2f}, {test.verdict}{why}")
    exponent, stochastic = _exponent(portrait, evidence)
    return MotionKind(
        _decide(test, exponent, stochastic, noise_free=noise_free), 0, tuple(evidence), section, exponent, test
    )


def _exponent(portrait: PhasePortrait, evidence: list[str]) -> tuple[LyapunovExponent | None, bool]:
    """Return the exponent, and whether no dimension unfolds the path; say either in the evidence."""
    x, rate = np.ascontiguousarray(portrait.points[:, 0]), portrait.sampling_rate_hz
    found = _answer(lambda: _dimension(x, rate), "embedding dimension", evidence)
    if found is None:
        return None, False
    if found.dimension == 0:
        evidence.append(
            f"no dimension up to {found.dimensions[-1]} unfolds the {portrait.axis_names[0]}: noise does this; so does "
            "clean chaos of a few dozen cycles"
        )
        return None, True
    path = delay_embedding(x, rate, delay_samples=found.delay_samples, dimension=found.dimension)
    exponent = _answer(lambda: largest_lyapunov_exponent(path), "Lyapunov exponent", evidence)
    if exponent is not None:
        size = f"{exponent.exponent_per_s:.3g} ± {exponent.uncertainty_per_s:.2g} 1/s"
        evidence.append(f"largest Lyapunov exponent {size} in {found.dimension} dimensions: {exponent.verdict}")
    return exponent, False


def _dimension(x: FloatArray, rate: float) -> EmbeddingDimension:
    """Return the embedding dimension; where the usual delay unfolds nothing, that at a quarter of the mean period.

    The mutual information of chaos may fall for most of a cycle, in which neighbours part too far. A quarter of the
    mean period leaves 5 % false neighbours or more of filtered noise; an eighth would make it look deterministic.
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
    # Irregular without neighbours that part is not chaos: teeth that differ repeat after the hunting period only.
    if stochastic:
        return "undecided" if noise_free else "stochastic"
    if test is None or exponent is None:
        return "undecided"
    if exponent.verdict == "diverging" and test.verdict == "irregular":
        return "chaotic"
    if exponent.verdict == "not diverging" and test.verdict == "regular":
        return "quasi-periodic"
    return "undecided"


def _answer(ask: Callable[[], T], name: str, evidence: list[str]) -> T | None:
    """Return the answer, or None with the refusal in the evidence."""
    try:
        return ask()
    except GearsigError as error:
        evidence.append(f"{name}: {error}")
        return None
