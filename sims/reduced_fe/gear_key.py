"""Which blank, plan and state of the code made a reduced gear."""

from __future__ import annotations

import json
from dataclasses import asdict
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

from sims.reduced_fe.blank import GearBlank

if TYPE_CHECKING:
    from sims.reduced_fe.reduce import ReductionPlan

FORMAT = 1
"""Of the file and of what its numbers mean; raised when either changes."""

_SOURCES = (
    "blank",
    "mesh_size",
    "tooth_side",
    "sector_plane",
    "sector_mesh",
    "elements",
    "cyclic",
    "cyclic_modes",
    "flank_rows",
    "hub",
    "line_weights",
    "mirror",
    "reduce",
)
"""Files of this folder whose code changes a reduced gear."""


def gear_key(blank: GearBlank, plan: ReductionPlan) -> str:
    """Return a digest of all that makes a reduced gear."""
    made_of = json.dumps({"blank": asdict(blank), "plan": asdict(plan), "format": FORMAT}, sort_keys=True)
    return sha256((made_of + code_digest()).encode()).hexdigest()[:32]


@cache
def code_digest() -> str:
    """Return a digest of the code that meshes and reduces."""
    digest = sha256()
    for name in _SOURCES:
        digest.update((Path(__file__).parent / f"{name}.py").read_bytes())
    return digest.hexdigest()[:16]
