"""What a gap diagnosis leaves in a folder: gap.json, gap.html and, where an effect is named, twin.toml; all or none."""

from __future__ import annotations

import json
import secrets
import shutil
from pathlib import Path

from gearsig.errors import InputError
from gearsig.gap.types import GapReport
from gearsig.report.files import check_writable

JSON, PAGE, TWIN = "gap.json", "gap.html", "twin.toml"
NAMES = (JSON, PAGE, TWIN)


def check_folder(folder: Path) -> None:
    """Check, before the long work, that results can be written; results of an earlier diagnosis are replaced.

    Raises
    ------
    InputError
        If it is no folder, cannot be written, or holds files that belong to no gap diagnosis.
    """
    check_writable(folder)
    if folder.is_dir():
        found = [path for path in folder.iterdir() if path.name not in NAMES]
        if found or (any(folder.iterdir()) and not _is_ours(folder / JSON)):
            raise InputError(
                "holds files that belong to no gap diagnosis", where=str(folder), remedy="choose another with -o"
            )


def write_results(report: GapReport, folder: Path, *, command: str = "") -> tuple[Path, ...]:
    """Write the results beside their folder and move them there when all are complete.

    Returns
    -------
    tuple of Path
        Page, JSON, and the twin's preset where there is one.
    """
    from gearsig.report.gap_json import write_gap_json
    from gearsig.report.gap_page import write_gap_page

    target = folder.absolute()
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        unfinished = target.parent / f".{target.name[:32]}-{secrets.token_hex(4)}"
        try:
            unfinished.mkdir()
            write_gap_page(report, unfinished / PAGE, command=command)
            write_gap_json(report, unfinished / JSON)
            if report.twin_toml:
                (unfinished / TWIN).write_text(report.twin_toml, encoding="utf-8")
            _move(unfinished, target)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    except OSError as error:
        raise InputError(
            f"cannot be written ({error.strerror or error})", where=str(folder), remedy="choose another with -o"
        ) from None
    return tuple(folder / name for name in (PAGE, JSON, TWIN) if (folder / name).exists())


def _move(unfinished: Path, target: Path) -> None:
    """Put the finished folder in its place; file by file into a folder that exists, which may be somebody's own."""
    if not target.exists():
        unfinished.rename(target)
        return
    for name in (PAGE, TWIN, JSON):  # gap.json last: where it is new, the others are
        if (unfinished / name).exists():
            (unfinished / name).replace(target / name)
        else:
            (target / name).unlink(missing_ok=True)


def _is_ours(path: Path) -> bool:
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and found.get("schema") == "gearsig.gap"
