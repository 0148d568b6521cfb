"""What stands out of a recording of gears and belongs to no gear, shaft or known bearing, found by the analysis."""

from __future__ import annotations

from collections.abc import Sequence

from app.gap.standing_out import IMPACTS, LINE, examined
from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.analyze import analyze
from gearsig.diagnosis.types import Analysis, CannotTell
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig


def unexplained(
    recording: Recording, rig: Rig, references: Sequence[Recording], reference_rigs: Sequence[Rig], name: str
) -> tuple[str, ...]:
    """Say which families of impacts and lines, beyond the reference's, neither the gear model nor an effect has.

    The catalogue's effects are compared by features of known places; a strange family is one feature among a hundred
    there and easily lost. The analysis looks for it by itself.
    """
    now = _analysed(recording, rig)
    if now is None:
        return ()
    healthy = [_analysed(one, own) for one, own in zip(references, reference_rigs, strict=True)]
    found = examined(name, now, [one for one in healthy if one is not None])
    return tuple(
        f"Not explained by the gear model, in {name}: {standing.finding.title.rstrip('.')}."
        for standing in found.standing
        if standing.finding.code in (*IMPACTS, LINE)
    )


def _analysed(recording: Recording, rig: Rig) -> tuple[Analysis, ShaftAngle] | None:
    """Return a recording's analysis with its angle; None where it has no speed."""
    analysis = analyze(recording.with_rig(rig))
    return None if isinstance(analysis.shaft_angle, CannotTell) else (analysis, analysis.shaft_angle)
