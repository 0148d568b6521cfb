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

_OUTLINE = ("geometry", "involute", "profile")
"""Files of `sims.mesh` that make the outline."""


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
    digest = sha256()
    here = Path(__file__).parent
    for path in (*(here / f"{name}.py" for name in _SOURCES), *(here.parent / "mesh" / f"{m}.py" for m in _OUTLINE)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
