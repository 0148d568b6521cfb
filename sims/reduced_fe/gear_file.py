"""A reduced gear on disk: arrays without pickles, whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.cache import FRESH, OtherVersionError, read_arrays, write_whole
from gearsig.errors import InputError
from sims.reduced_fe.blank import blank_from_text
from sims.reduced_fe.gear_key import FORMAT
from sims.reduced_fe.reduced_gear import FlankGrid, ReducedGear

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
MOST_BYTES = 200_000_000
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
    data = read_arrays(source, MOST_BYTES)
    if data is None:
        raise _no_gear(source, f"no archive of at most {MOST_BYTES:.0e} bytes")
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
