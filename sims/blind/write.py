"""Cases on disk: what the diagnosing side may see in one folder, the answers in another."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from gearsig.errors import InputError
from gearsig.recording.types import Provenance, Recording
from gearsig.recording.write import write_recording
from gearsig.rig.toml import write_rig
from sims.blind.case import Case, CaseRecordings, record_case
from sims.blind.changes.catalogue import EVERY

LAYOUT = "gearsig blind labels 1"
LABELS_NAME = "labels.json"
FILE_TIME = 1_700_000_000
"""Every file is given the same time: when it was made says what it took to make it."""


def write_case(case: Case, folder: str | Path, labels_folder: str | Path) -> tuple[Path, Path]:
    """Run a case and write it.

    Parameters
    ----------
    case : Case
    folder : str or Path
        For the diagnosing side: condition_1.h5 (and _2), reference_1.h5 … if there are any, each with a rig file of the
        same name that states its operating point, and rig.toml, which is condition_1's.
    labels_folder : str or Path
        For the scoring side: labels.json, twin_1.h5 … unless nothing is wrong. Neither inside `folder` nor around it.

    Returns
    -------
    tuple of Path
        Both folders.

    Raises
    ------
    InputError
        If one folder holds the other or is not empty.
    """
    seen, hidden = Path(folder).resolve(), Path(labels_folder).resolve()
    if seen == hidden or seen in hidden.parents or hidden in seen.parents:
        raise InputError(
            "the labels would lie with the recordings", where=str(labels_folder), remedy="give a folder beside it"
        )
    for place in (seen, hidden):
        place.mkdir(parents=True, exist_ok=True)
        if any(place.iterdir()):
            raise InputError("the folder is not empty", where=str(place), remedy="give a new one for each case")
    made = record_case(case)
    write_seen(made, seen)
    if case.faults:
        for i, twin in enumerate(made.twins, 1):
            _write(twin, hidden / f"twin_{i}.h5")
    (hidden / LABELS_NAME).write_text(json.dumps(labels(case, made), indent=1), encoding="utf-8")
    return seen, hidden


def write_seen(made: CaseRecordings, folder: Path) -> None:
    """Write what the diagnosing side may see, and nothing else."""
    for stem, recordings in (("condition", made.conditions), ("reference", made.references)):
        for i, recording in enumerate(recordings, 1):
            _write(recording, folder / f"{stem}_{i}.h5")
    _write_description(made.conditions[0], folder / "rig.toml")


def labels(case: Case, made: CaseRecordings) -> dict[str, Any]:
    """Return the answers; the package's description explains the keys."""
    conditions = [
        {
            "file": f"condition_{i}.h5",
            "stated_rpm": c.stated_rpm,
            "stated_nm": c.stated_nm,
            "true_rpm": c.true_rpm,
            "true_nm": c.true_nm,
            "load_share": c.stated_nm / case.rig.rated_nm,
        }
        for i, c in enumerate(case.conditions, 1)
    ]
    effects = [
        {
            "name": fault.name,
            "group": EVERY[fault.name].group,
            "severity": fault.severity,
            "unit": EVERY[fault.name].unit,
            "level": fault.level,
            "resembles": EVERY[fault.name].resembles,
            "place": dict(place),
        }
        for fault, place in zip(case.faults, made.places, strict=True)
    ]
    return {
        "layout": LAYOUT,
        "role": case.role,
        "kind": case.kind,
        "effects": effects,
        "has_reference": bool(case.references),
        "conditions": conditions,
        "twins": [f"twin_{i}.h5" for i in range(1, len(made.twins) + 1)] if case.faults else [],
        "pair": {"z1": case.rig.pair.z1, "z2": case.rig.pair.z2, "module_mm": case.rig.pair.module_mm},
    }


def _write(recording: Recording, path: Path) -> None:
    bare = Recording(recording.samples, recording.sampling_rate_hz, recording.channels, provenance=Provenance())
    write_recording(bare, path)
    os.utime(path, (FILE_TIME, FILE_TIME))
    _write_description(recording, path.with_suffix(".toml"))


def _write_description(recording: Recording, path: Path) -> None:
    if recording.rig is None:
        raise InputError("the recording carries no rig", where=path.name)
    write_rig(recording.rig, path)
    os.utime(path, (FILE_TIME, FILE_TIME))
