"""What a diagnosing process sees of a case: one folder with recordings and rig files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from gearsig.gap.gather import gather
from gearsig.gap.gathered import Gathered
from gearsig.recording.read import read_recording
from gearsig.recording.types import Recording
from gearsig.rig.toml import read_rig
from gearsig.rig.types import Rig


@dataclass(frozen=True)
class Seen:
    """The recordings of a case.

    Parameters
    ----------
    recordings, references : tuple of Recording
        Reference i was recorded where recording i was; none: no reference at all.
    rigs, reference_rigs : tuple of Rig
    names : tuple of str
        Of the recordings.
    """

    recordings: tuple[Recording, ...]
    rigs: tuple[Rig, ...]
    names: tuple[str, ...]
    references: tuple[Recording, ...]
    reference_rigs: tuple[Rig, ...]

    @cached_property
    def gathered(self) -> tuple[Gathered, ...]:
        """The recordings, reduced."""
        return tuple(gather(r, rig) for r, rig in zip(self.recordings, self.rigs, strict=True))

    @cached_property
    def gathered_references(self) -> tuple[Gathered, ...]:
        """The references, reduced."""
        return tuple(gather(r, rig) for r, rig in zip(self.references, self.reference_rigs, strict=True))


def read_seen(folder: Path) -> Seen:
    """Read condition_1.h5, reference_1.h5 … with the rig files beside them."""
    conditions, references = (sorted(folder.glob(f"{stem}_*.h5")) for stem in ("condition", "reference"))
    rigs, reference_rigs = (
        tuple(read_rig(p.with_suffix(".toml")) for p in paths) for paths in (conditions, references)
    )
    return Seen(
        tuple(read_recording(p, rig=rig) for p, rig in zip(conditions, rigs, strict=True)),
        rigs,
        tuple(p.name for p in conditions),
        tuple(read_recording(p, rig=rig) for p, rig in zip(references, reference_rigs, strict=True)),
        reference_rigs,
    )
