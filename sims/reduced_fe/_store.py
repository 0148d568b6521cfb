"""Reduced gears kept on disk under the key of what made them."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from gearsig.cache import FRESH, OtherVersionError, cache_folder, modules_digest, read_arrays, write_whole
from gearsig.checks import one_of
from gearsig.errors import InputError
from sims.mesh import GearGeometry
from sims.reduced_fe._blank import GearBlank, MeshSize, blank_from_text
from sims.reduced_fe._reduced_gear import FlankGrid, ReducedGear
from sims.reduced_fe._reduction import ReductionPlan, reduce_gear

# --------------------
# Which blank, plan and state of the code made a reduced gear.
# --------------------


FORMAT = 1
"""Of the file and of what its numbers mean; raised when either changes."""

_SOURCES = (
    *(f"sims.reduced_fe.{name}" for name in ("_blank", "_mesh", "_elements", "_cyclic", "_reduced_gear", "_reduction")),
    "sims.mesh._geometry",
)
"""Modules whose code changes a reduced gear; the last makes the outline."""


def gear_name(blank: GearBlank, plan: ReductionPlan) -> str:
    """Return a digest of what is asked of a reduced gear, the same for every state of the code."""
    made_of = json.dumps({"blank": asdict(blank), "plan": asdict(plan)}, sort_keys=True)
    return sha256(made_of.encode()).hexdigest()[:32]


def gear_key(blank: GearBlank, plan: ReductionPlan) -> str:
    """Return what tells reduced gears apart: digests of what is asked for and of the code that makes it."""
    return f"{gear_name(blank, plan)}-{code_digest()}"


def is_of_this_code(key: str) -> bool:
    """Whether a key of `gear_key` names the present state of the code."""
    return key.endswith(f"-{code_digest()}")


@cache
def code_digest() -> str:
    """Return a digest of the code that meshes and reduces."""
    return modules_digest(_SOURCES)


# --------------------
# A reduced gear on disk: arrays without pickles, whole or not at all.
# --------------------


_NUMBERS = ("mass_kg", "polar_inertia_kg_m2", "diametral_inertia_kg_m2")
_ARRAYS = (
    "frequencies_hz",
    "nodal_diameters",
    "flank_modes",
    "hub_modes",
    "free_compliance_m_per_n",
    "clamped_compliance_m_per_n",
    "hub_flank_compliance",
    "hub_compliance",
)
MAX_BYTES = 200_000_000
"""Of a file's arrays; a usual one has half a million."""


def write_gear(path: str | Path, gear: ReducedGear) -> None:
    """Write a reduced gear beside its place and move it there.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """
    about = {"format": FORMAT, "key": gear.key, "blank": gear.blank.as_text(), "spread": gear.spread}
    about |= {"n_dof": gear.n_dof, **{name: getattr(gear, name) for name in _NUMBERS}}
    arrays: dict[str, Any] = {name: getattr(gear, name) for name in _ARRAYS}
    arrays |= {"roll_rad": gear.grid.roll_rad, "z_m": gear.grid.z_m}
    write_whole(Path(path), lambda file: np.savez_compressed(file, about=np.array(json.dumps(about)), **arrays))


def read_gear(path: str | Path) -> ReducedGear:
    """Read a reduced gear.

    Raises
    ------
    InputError
        If the file is missing, damaged, not a reduced gear, or (`OtherVersionError`) of another version of this format.
    """
    source = Path(path)
    if not source.exists():
        raise InputError("no such file", where=str(source))
    data = read_arrays(source, MAX_BYTES)
    if data is None:
        raise _no_gear(source, f"no archive of at most {MAX_BYTES:.0e} bytes")
    try:
        about = json.loads(str(data["about"]))
        _check_format(about, source)
        return _gear(about, {name: data[name] for name in (*_ARRAYS, "roll_rad", "z_m")})
    except InputError:
        raise
    except (ValueError, KeyError, TypeError) as error:
        raise _no_gear(source, str(error)) from error


def _no_gear(source: Path, why: str) -> InputError:
    return InputError(f"is not a reduced gear, or is damaged ({why})", where=str(source), remedy="make it again")


def _check_format(about: dict[str, Any], source: Path) -> None:
    found = about.get("format") if isinstance(about, dict) else None
    if found != FORMAT:
        raise OtherVersionError(
            f"is of format {found!r}: another version of gearsig wrote it",
            where=str(source),
            allowed=f"format {FORMAT}",
            remedy=FRESH,
        )


def _gear(about: dict[str, Any], arrays: dict[str, np.ndarray[Any, Any]]) -> ReducedGear:
    fields: dict[str, Any] = arrays | {name: float(about[name]) for name in _NUMBERS}
    grid = FlankGrid(fields.pop("roll_rad"), fields.pop("z_m"))
    return ReducedGear(
        blank=blank_from_text(about["blank"]),
        key=str(about["key"]),
        n_dof=int(about["n_dof"]),
        spread=str(about["spread"]),
        grid=grid,
        **fields,
    )


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


# --------------------
# Reduced gears that come with the product: `python -m sims.reduced_fe._store` makes their files again.
#
# Their cracks are in a file of their own, see `sims.reduced_fe`.
# --------------------


FOLDER = Path(__file__).parent / "gears"

PLAN = ReductionPlan(MeshSize(n_across=3, n_gap=1, n_up=8, n_rim=2, n_body=3, n_along=4))
"""300 000 degrees of freedom for 50 teeth, about as many as the published pair; teeth as fine for the others."""

READY = MappingProxyType(
    {
        "z50_m3": GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0)),
        "z55_m2": GearBlank(GearGeometry(55, 2.0, bore_radius_mm=17.5)),
        "z75_m2": GearBlank(GearGeometry(75, 2.0, bore_radius_mm=17.5)),
    }
)
"""Steel, 20°, face width 20 mm, full discs: the 50-tooth gear of the flexible pair, and the two of the 16-DOF pair."""


def ready_gear(name: str) -> ReducedGear:
    """Return a ready-made reduced gear.

    Parameters
    ----------
    name : str
        One of `READY`.
    """
    return read_gear(FOLDER / f"{one_of(name, 'name', READY)}.npz")


def make_ready_gears() -> None:
    """Reduce all ready-made gears and write their files."""
    FOLDER.mkdir(exist_ok=True)
    for name, blank in READY.items():
        write_gear(FOLDER / f"{name}.npz", reduce_gear(blank, PLAN))


if __name__ == "__main__":
    make_ready_gears()
