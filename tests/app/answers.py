"""Causes of an answer, built by hand."""

from gearsig.gap import AddedEffect, GapCause, Interval, Shrinkage


def cause(name, probability, options=None, shrink=None, **of_shrinkage):
    """Return a cause, with a held-out shrink where one is given."""
    fitted = None if options is None else AddedEffect(name, 1.0, options)
    shrinkage = None if shrink is None else shrinkage_of(shrink, **of_shrinkage)
    return GapCause(name, "", name, "", probability, fitted=fitted, shrinkage=shrinkage)


def shrinkage_of(shrink, *, placebo=0.0, n_placebos=1, of_all=None):
    """Return a shrinkage that is known exactly."""
    one = Interval(1.0, 1.0, 1.0)
    held_out = "other revolutions of the same recordings"
    return Shrinkage(one, one, Interval(shrink, shrink, shrink), 1.0, placebo, held_out, n_placebos, of_all=of_all)
