"""Reduced gears kept on disk under the key of what made them."""

from __future__ import annotations

from pathlib import Path

from gearsig.cache import FRESH, OtherVersionError, cache_folder
from gearsig.errors import InputError
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.gear_file import read_gear, write_gear
from sims.reduced_fe.gear_key import gear_key, gear_name, is_of_this_code
from sims.reduced_fe.reduce import ReductionPlan, reduce_gear
from sims.reduced_fe.reduced_gear import ReducedGear


def cached_gear(blank: GearBlank, plan: ReductionPlan, folder: str | Path | None = None) -> ReducedGear:
    """Return a reduced gear from the cache, or reduce it and keep it there.

    A file that is damaged is made again: it holds nothing that cannot be. One that another version of the code made is
    left for the user to decide about.

    Parameters
    ----------
    blank : GearBlank
    plan : ReductionPlan
    folder : path or None
        None: `gearsig.cache.cache_folder("gears")`.

    Raises
    ------
    OtherVersionError
        If another version of the code kept this gear.
    InputError
        If the gear cannot be reduced, or the folder not written.
    """
    where = cache_folder("gears") if folder is None else Path(folder)
    path = where / f"{gear_name(blank, plan)}.npz"
    if path.is_file():
        kept = _undamaged(path)
        if kept is not None and kept.key == gear_key(blank, plan):
            return kept
        if kept is not None:
            raise OtherVersionError(
                "this reduced gear was made by another version of gearsig", where=str(path), remedy=FRESH
            )
    gear = reduce_gear(blank, plan)
    try:
        where.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot be made ({error.strerror})", where=str(where), remedy="choose another folder"
        ) from None
    write_gear(path, gear)
    return gear


def forget_gears_of_other_versions(folder: Path | None = None) -> tuple[Path, ...]:
    """Delete the kept gears that another version of the code made, and damaged ones; return their files."""
    where = cache_folder("gears") if folder is None else folder
    gone = []
    for path in sorted(where.glob("*.npz")):
        try:
            kept = _undamaged(path)
        except OtherVersionError:
            kept = None
        if kept is None or not is_of_this_code(kept.key):
            path.unlink(missing_ok=True)
            gone.append(path)
    return tuple(gone)


def _undamaged(path: Path) -> ReducedGear | None:
    """Read a gear; None if its file is damaged."""
    try:
        return read_gear(path)
    except OtherVersionError:
        raise
    except InputError:
        return None
