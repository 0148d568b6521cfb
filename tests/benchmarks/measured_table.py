"""What is said of each measured recording beside what is known: `python tests/benchmarks/measured_table.py`.

Prints the table of `docs/measured.md`. The recordings are used in place from `../shared/data`. Of each, the whole is
analysed (against its reference, where there is one), and its second half against its first, which is the same machine
in the same state.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

from gearsig.diagnosis import Analysis, analyze
from gearsig.errors import RefusalError
from gearsig.recording import Recording
from gearsig.severity import CrackEstimate, estimate_crack
from tests.measured import BY_NAME, PINION, RECORDINGS, Measured, halves, with_assumed_gears


def rows(names: list[str]) -> Iterator[str]:
    """Yield the table's rows, the recordings whose name has one of the given words, or all."""
    yield "| recording | known | said | its halves |"
    yield "|---|---|---|---|"
    for one in RECORDINGS:
        if names and not any(name in one.name for name in names):
            continue
        recording = one.read()
        yield f"| `{one.name}` | {one.known} | {said(one, recording)} | {null(recording)} |"


def said(one: Measured, recording: Recording) -> str:
    """Return the verdict, of the recording alone and against its reference."""
    alone = analyze(recording).verdict
    if not one.reference:
        return alone
    beside = analyze(recording, reference=BY_NAME[one.reference].read()).verdict
    return f"{alone} **Against `{one.reference}`:** {beside}"


def null(recording: Recording) -> str:
    """Say what the halves of a recording show against each other."""
    first, second = halves(recording)
    texts = [_changes(analyze(second, reference=first))]
    if recording.rig is not None and recording.rig.pairs:
        assumed = ""
        if recording.rig.pairs == PINION.pairs:
            first, second = with_assumed_gears(first), with_assumed_gears(second)
            assumed = " (wheel, module, width and torque assumed)"
        try:
            crack = estimate_crack(second, reference=first)
        except RefusalError as refusal:
            texts.append(f"crack: {refusal.reason}")
        else:
            texts.append(("a crack" if isinstance(crack, CrackEstimate) else "no crack") + assumed)
    return "; ".join(texts)


def _changes(analysis: Analysis) -> str:
    changed = [c for c in analysis.level_changes if c.is_change]
    if not analysis.level_changes:
        return "cannot be compared"
    if not changed:
        return f"no change in {len(analysis.level_changes)} levels"
    return ", ".join(f"{c.label} {c.change_db:+.0f} dB" for c in changed[:4])


if __name__ == "__main__":
    for row in rows(sys.argv[1:]):
        print(row, flush=True)
