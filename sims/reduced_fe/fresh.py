"""Clearing away what other versions of the code keep of finite-element gears."""

from __future__ import annotations

from pathlib import Path

from sims.reduced_fe.crack_table import forget_cracks_of_other_versions
from sims.reduced_fe.gear_cache import forget_gears_of_other_versions


def forget_other_versions() -> tuple[Path, ...]:
    """Delete reduced gears and cracks that another version kept, and damaged ones, from this user's cache.

    Returns
    -------
    tuple of Path
        The files that are gone. What is needed of them is made again when it is next asked for.
    """
    return (*forget_gears_of_other_versions(), *forget_cracks_of_other_versions())
