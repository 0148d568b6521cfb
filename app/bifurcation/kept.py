"""Values of a bifurcation on disk, one small file each, so that a run can be stopped and goes on from there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.bifurcation.measure import Measured
from gearsig.cache import read_arrays
from gearsig.phase.types import PoincareSection
from sims.cracked.continuation import End
from sims.cracked.respond import State

MOST_BYTES = 1_000_000_000
"""Of one value's arrays; a usual one has some ten thousand."""


@dataclass(frozen=True)
class Kept:
    """What became of one value: its points and where the run ended, or the reason why there are none."""

    value: float
    found: Measured | None
    end: End | None
    reason: str = ""


def save(kept: Kept, path: Path) -> None:
    """Write one value, whole or not at all."""
    fields: dict[str, np.ndarray] = {"value": np.array(kept.value), "reason": np.array(kept.reason)}
    if kept.found is not None and kept.end is not None:
        found, section, end = kept.found, kept.found.section, kept.end
        fields |= {
            "points": section.points,
            "times_s": section.times_s,
            "extent": section.extent,
            "words": np.array([*section.axis_names, *section.units, section.section, section.source]),
            "numbers": np.array([found.period, found.settled_s, found.separated_share, found.exponent_per_s, found.k]),
            "motion": np.array(found.motion),
            "q": end.state.q,
            "v": end.state.v,
            "end": np.array([end.state.set_angle_rad, end.speed_rpm, end.torque_nm]),
        }
    part = path.with_name(f".{path.name}.part")
    with part.open("wb") as file:
        np.savez(file, **fields)  # type: ignore[arg-type]  # its stubs take names of options for keys
    part.replace(path)


def load(path: Path) -> Kept | None:
    """Read one value; None where it is not there, or damaged."""
    data = read_arrays(path, MOST_BYTES)
    if data is None:
        return None
    value = float(data["value"])
    if "points" not in data:
        return Kept(value, None, None, str(data["reason"]))
    d, words = data["points"].shape[1], tuple(str(w) for w in data["words"])
    names, units, (section_name, source) = words[:d], words[d : 2 * d], words[2 * d :]
    section = PoincareSection(
        data["points"], data["times_s"], names, units, data["extent"], "locked", section_name, source
    )
    period, settled, separated, exponent, k = (float(x) for x in data["numbers"])
    found = Measured(value, section, int(period), settled, separated, str(data["motion"]), exponent, k)
    angle, speed, torque = (float(x) for x in data["end"])
    return Kept(value, found, End(State(data["q"], data["v"], angle), speed, torque))
