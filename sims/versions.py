"""Which state of the simulators' code made a result."""

from __future__ import annotations

from functools import cache
from hashlib import sha256
from pathlib import Path

_ROOMS = ("cracked", "effects", "forging", "gear_pair", "machine", "measure", "mesh", "reduced_fe")


def sources_digest() -> str:
    """Return a short hash of the code that simulates: kept results of another state are not taken for this one's."""
    from sims.effects.own import own_files

    own = sha256(b"".join(path.read_bytes() for path in own_files())).hexdigest()[:8] if own_files() else ""
    return _listed_sources() + own


@cache
def _listed_sources() -> str:
    here = Path(__file__).parent
    digest = sha256()
    for room in _ROOMS:
        for path in sorted((here / room).rglob("*.py")):
            digest.update(path.relative_to(here).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:16]
