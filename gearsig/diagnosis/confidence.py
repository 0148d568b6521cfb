"""From a p-value to how sure a statement is."""

from __future__ import annotations

from math import e, exp, log

WITHOUT_REFERENCE = 0.95
"""Upper limit for a fault claimed from one recording: what is there may have been there when the machine was new."""

WITH_ASSUMED_DATA = 0.5
"""Factor where the statement rests on data of the machine that are assumed."""

SMALLEST_SHOWN = 1e-6
"""Smaller p-values are not shown: no model of the noise is known so well in its tails."""


def from_p_value(p_value: float, *, prior: float = 0.1, limit: float = WITHOUT_REFERENCE) -> float:
    """Return an upper bound of the probability that the effect is real, given the p-value of its absence.

    The Bayes factor for "absent" is at least -e p ln p (p < 1/e), so that
    P(real) <= 1/(1 + (1 - prior)/prior · (-e p ln p)).

    Parameters
    ----------
    p_value : float
        0 to 1, after correction for everything that was tried.
    prior : float
        Probability of the effect before looking.
    limit : float
        The result is cut here, for what no p-value knows of.

    References
    ----------
    T. Sellke, M. J. Bayarri, J. O. Berger, "Calibration of p values for testing precise null hypotheses", 2001.

    Examples
    --------
    >>> round(from_p_value(0.01), 2)
    0.47
    """
    p = min(max(p_value, 1e-300), 1.0)
    bayes_factor = -e * p * log(p) if p < exp(-1) else 1.0
    return min(limit, 1.0 / (1.0 + (1.0 - prior) / prior * bayes_factor))


def p_text(p_value: float) -> str:
    """Write a p-value with one digit, none below 1e-6.

    Examples
    --------
    >>> p_text(3.2e-4), p_text(5e-141)
    ('3e-04', '< 1e-6')
    """
    return "< 1e-6" if p_value < SMALLEST_SHOWN else f"{p_value:.0e}" if p_value < 0.01 else f"{p_value:.1g}"
