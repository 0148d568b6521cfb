"""What cracks add to the compliance of a reduced gear's tooth, from finite elements, kept over depth and width."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache, lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.cache import FRESH, OtherVersionError, cache_folder, read_arrays, write_whole
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from sims.mesh.crack import RootCrack, check_crack, deepest_crack_mm
from sims.reduced_fe.blank import GearBlank
from sims.reduced_fe.cracked_tooth import CRACK_SIZE, crack_meshes, front_widths_mm, open_crack
from sims.reduced_fe.flank_rows import Spread
from sims.reduced_fe.gear_key import code_digest
from sims.reduced_fe.mesh_size import MeshSize
from sims.reduced_fe.ready import FOLDER, READY, ready_gear
from sims.reduced_fe.reduced_gear import ReducedGear

DEPTH_PARTS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Of the deepest crack: depths that are solved. What lies between follows from added compliance over squared depth."""
COARSE_SIZE, COARSE_DOF = MeshSize(n_across=6, n_gap=1, n_up=6, n_rim=2, n_body=1, n_along=2), 4_000
"""For gears with fewer degrees of freedom per tooth, whose teeth are not known better either: adds 4 to 9 % less than
`CRACK_SIZE`."""
READY_ANGLE_DEG = 45.0
READY_FILE = FOLDER / "cracks.npz"
MOST_BYTES = 100_000_000
"""Of a kept crack's arrays; a usual one has less than one."""


def crack_added_m_per_n(gear: ReducedGear, crack: RootCrack) -> FloatArray:
    """What a crack adds to the compliance between the slices of flank 0, (n_heights, n_slices, n_slices), m/N.

    Between solved depths a < q < b, and likewise between widths (straight, 0 at no width):

        C(q) = q² [(b − q) C(a)/a² + (q − a) C(b)/b²]/(b − a)

    A shallow crack adds as its depth squared; every C stays symmetric and positive.

    Parameters
    ----------
    gear : ReducedGear
    crack : RootCrack
        Its tooth does not matter.

    Raises
    ------
    InputError
        If the crack goes past the tooth, its front is not straight, or the mesh cannot follow it.

    Notes
    -----
    Cracks of the ready-made gears at 45° come with the product. Others take seconds once and are kept on disk.
    """
    check_crack(gear.blank.geometry, crack)
    if crack.front != "straight":
        raise InputError("front of the crack is 'parabolic'", allowed="straight", remedy="give the mean depth")
    added = _at_depth(gear, crack)
    face_mm = gear.blank.geometry.face_width_mm
    if crack.width_mm is None or crack.width_mm >= face_mm:
        through: FloatArray = added[-1]
        return through
    widths = np.concatenate(([0.0], front_widths_mm(gear.blank, crack_size(gear))))
    k = int(np.searchsorted(widths, crack.width_mm))
    part = (crack.width_mm - widths[k - 1]) / (widths[k] - widths[k - 1])
    narrower = added[k - 2] if k > 1 else np.zeros_like(added[0])
    between: FloatArray = (1.0 - part) * narrower + part * added[k - 1]
    return between


@lru_cache(maxsize=64)
def deepest_followed_mm(blank: GearBlank, size: MeshSize, angle_deg: float) -> float:
    """Deepest crack for which a mesh along its line is found; 0 if there is none.

    Parameters
    ----------
    blank : GearBlank
    size : MeshSize
        `crack_size` of the gear.
    angle_deg : float
        ϑ between the crack and the tooth's centre line.
    """
    deepest = deepest_crack_mm(blank.geometry, angle_deg)
    for part in reversed(DEPTH_PARTS):
        try:
            crack_meshes(blank, RootCrack(part * deepest, angle_deg), size)
        except InputError:
            continue
        return part * deepest
    return 0.0


def crack_size(gear: ReducedGear) -> MeshSize:
    """Mesh on which a gear's cracks are solved."""
    return COARSE_SIZE if gear.n_dof < COARSE_DOF * gear.blank.n_teeth else CRACK_SIZE


def _at_depth(gear: ReducedGear, crack: RootCrack) -> FloatArray:
    """For all widths; below the least solved depth the compliance over squared depth stays."""
    depths = deepest_crack_mm(gear.blank.geometry, crack.angle_deg) * np.array(DEPTH_PARTS)
    k = int(np.searchsorted(depths, crack.depth_mm * (1.0 - 1e-12)))
    if k == 0:
        shallow: FloatArray = (crack.depth_mm / depths[0]) ** 2 * _solved(gear, crack.angle_deg, 0)
        return shallow
    deepest = deepest_followed_mm(gear.blank, crack_size(gear), crack.angle_deg)
    if crack.depth_mm > deepest * (1.0 + 1e-9):
        raise InputError(
            f"the mesh cannot follow a crack of {crack.depth_mm:g} mm at {crack.angle_deg:g}°",
            allowed=f"up to {deepest:.3g} mm, or a greater angle",
            remedy="take a shallower crack or one that runs less steeply into the body",
        )
    above = _solved(gear, crack.angle_deg, k) / depths[k] ** 2
    below = _solved(gear, crack.angle_deg, k - 1) / depths[k - 1] ** 2
    part = (crack.depth_mm - depths[k - 1]) / (depths[k] - depths[k - 1])
    between: FloatArray = crack.depth_mm**2 * ((1.0 - part) * below + part * above)
    return between


def _solved(gear: ReducedGear, angle_deg: float, place: int) -> FloatArray:
    """At a depth that is solved, (n_widths, n_heights, n_slices, n_slices): shipped, kept, or solved now."""
    shipped = _shipped(gear, angle_deg, place)
    if shipped is not None:
        return shipped
    made_of = [gear.blank.as_text(), gear.spread, angle_deg, DEPTH_PARTS[place], repr(crack_size(gear)), gear.n_dof]
    grid = np.concatenate((gear.grid.roll_rad, gear.grid.z_m)).tobytes()
    path = cache_folder("cracks") / f"{sha256(json.dumps(made_of).encode() + grid).hexdigest()[:32]}.npz"
    return _kept(path, lambda: solved_crack_m_per_n(gear, angle_deg, place), gear.grid.shape)


def solved_crack_m_per_n(gear: ReducedGear, angle_deg: float, place: int) -> FloatArray:
    """Solve a crack of depth `DEPTH_PARTS[place]`: (n_widths, n_heights, n_slices, n_slices), the whole face last.

    Of each width the blocks of flank 0 at equal heights: a tooth touches its mate at one height at a time.
    """
    spread: Spread = gear.spread  # type: ignore[assignment]  # checked by the gear
    depth = DEPTH_PARTS[place] * deepest_crack_mm(gear.blank.geometry, angle_deg)
    opened = open_crack(gear.blank, RootCrack(depth, angle_deg), gear.grid, spread, crack_size(gear))
    n_heights, n_slices = gear.grid.shape[1:]
    heights = np.arange(n_heights)
    found = [
        opened.added_m_per_n(layer).reshape(n_heights, n_slices, n_heights, n_slices)[heights, :, heights, :]
        for layer in range(2, opened.last_layer + 1, 2)
    ]
    return np.array(found)


@lru_cache(maxsize=1)
def _ready_cracks() -> dict[str, FloatArray]:
    with np.load(READY_FILE, allow_pickle=False) as data:
        return {name: data[name] for name in data.files}


def _shipped(gear: ReducedGear, angle_deg: float, place: int) -> FloatArray | None:
    """Return the crack of a ready-made gear, if that is what this is."""
    name = next((name for name, blank in READY.items() if blank == gear.blank), None)
    if name is None or angle_deg != READY_ANGLE_DEG or gear.spread != "section":
        return None
    cracks = _ready_cracks()
    same = all(
        np.array_equal(cracks[f"{name}_{axis}"], own)
        for axis, own in (("roll_rad", gear.grid.roll_rad), ("z_m", gear.grid.z_m))
    )
    return cracks[name][place] if same and place < len(cracks[name]) else None


def make_ready_cracks() -> None:
    """Solve the cracks of all ready-made gears and write their file; each gear's end where the mesh cannot follow."""
    arrays: dict[str, Any] = {}
    for name in READY:
        gear, solved = ready_gear(name), []
        for place in range(len(DEPTH_PARTS)):
            try:
                solved.append(solved_crack_m_per_n(gear, READY_ANGLE_DEG, place))
            except InputError:
                break
        arrays |= {name: np.array(solved), f"{name}_roll_rad": gear.grid.roll_rad, f"{name}_z_m": gear.grid.z_m}
    write_whole(READY_FILE, lambda file: np.savez_compressed(file, **arrays))


def forget_cracks_of_other_versions(folder: Path | None = None) -> tuple[Path, ...]:
    """Delete the kept cracks that another version of the code solved, and damaged ones; return their files."""
    where = cache_folder("cracks") if folder is None else folder
    gone = [path for path in sorted(where.glob("*.np[yz]")) if _read(path)[0] != _code()]
    for path in gone:
        path.unlink(missing_ok=True)
    return tuple(gone)


def _kept(path: Path, solve: Callable[[], FloatArray], grid: tuple[int, int, int]) -> FloatArray:
    """Return what a file keeps, or solve and keep it; a damaged one is made again."""
    code, added = _read(path)
    if added is not None and code != _code():
        raise OtherVersionError("this crack was solved by another version of gearsig", where=str(path), remedy=FRESH)
    if added is not None and added.shape[1:] == (grid[1], grid[2], grid[2]) and np.isfinite(added).all():
        return added
    found = solve()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot be made ({error.strerror})", where=str(path.parent), remedy="choose another folder"
        ) from None
    write_whole(path, lambda file: np.savez(file, code=np.array(_code()), added=found))
    return found


def _read(path: Path) -> tuple[str, FloatArray | None]:
    """Code that made a file, and what it keeps; None if it is not there or damaged."""
    data = read_arrays(path, MOST_BYTES)
    return (str(data["code"]), data["added"]) if data is not None and {"code", "added"} <= set(data) else ("", None)


@cache
def _code() -> str:
    """Digest of the code that meshes a gear, opens and solves a crack."""
    return f"{code_digest()}-{_own_digest()}"


@cache
def _own_digest() -> str:
    """Of the code that opens and solves a crack."""
    return sha256(Path(__file__).with_name("cracked_tooth.py").read_bytes()).hexdigest()[:16]


if __name__ == "__main__":
    make_ready_cracks()
