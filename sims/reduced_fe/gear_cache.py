"""Reduced gears kept on disk under the key of what made them."""

from __future__ import annotations

from pathlib import Path

from gearsig.errors import InputError
from sims.cache import cache_folder
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.gear_file import read_gear, write_gear
from sims.reduced_fe.gear_key import gear_key
from sims.reduced_fe.reduce import ReductionPlan, reduce_gear
from sims.reduced_fe.reduced_gear import ReducedGear


def cached_gear(blank: GearBlank, plan: ReductionPlan, folder: str | Path | None = None) -> ReducedGear:
    """Return a reduced gear from the cache, or reduce it and keep it there.

    A file that is damaged, or was made by another state of the code, is made again: it holds nothing that cannot be.

    Parameters
    ----------
    blank : GearBlank
    plan : ReductionPlan
    folder : path or None
        None: `sims.cache.cache_folder("gears")`.

    Raises
    ------
    InputError
        If the gear cannot be reduced, or the folder not written.
    """
    where = cache_folder("gears") if folder is None else Path(folder)
    key = gear_key(blank, plan)
    path = where / f"{key}.npz"
    if path.is_file():
        try:
            kept = read_gear(path)
            if kept.key == key:
                return kept
        except InputError:
            pass  # damaged: made again below
    gear = reduce_gear(blank, plan)
    try:
        where.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot be made ({error.strerror})", where=str(where), remedy="choose another folder"
        ) from None
    write_gear(path, gear)
    return gear
