"""`gearsig demo`: the main job on the sample recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.samples import samples
from gearsig.errors import InputError


def demo(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for the pages.")] = Path(
        "demo-report"
    ),
) -> None:
    """Diagnose the sample recordings, write their report, and say where to look."""
    from app.commands.options import open_recording, open_rig
    from app.commands.report import make_report
    from gearsig.diagnosis.analyze import analyze
    from gearsig.report.text import analysis_text

    if output.exists() and not output.is_dir():
        raise InputError("is a file, not a folder", where=str(output), remedy="choose another folder with -o")
    chosen = samples()
    first = next((s for s in chosen if "damaged" in s.recording.stem), chosen[0])
    typer.echo(f"$ gearsig analyze {first.recording}\n")
    typer.echo(analysis_text(analyze(open_recording(first.recording, open_rig(first.rig), None))))
    typer.echo(f"\nThe same for all {len(chosen)} samples (they are simulated; {first.recording.parent} says how):")
    make_report([s.recording for s in chosen], output, None, None, None, None, command=f"gearsig demo -o {output}")
    typer.echo("Next: `gearsig rig example` for a rig file of your own, `gearsig dashboard` to explore.")
