"""`gearsig papers`: the figures of three publications beside the model's own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from app.cli.console import progress_bar, typed_command


def _names(incomplete: str) -> list[str]:
    from app.papers import PAPERS

    return [name for name in PAPERS if name.startswith(incomplete)]


def papers(
    name: Annotated[str, typer.Argument(help="cracked, reduced-fe or forging.", autocompletion=_names)],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder for page and figures.")],
) -> None:
    """Draw the figures of a publication that the model can answer, and judge each statement of its text by numbers.

    Every statement comes with "agrees", "agrees in part" or "does not, because …". index.html shows all of it.

    Example: gearsig papers cracked -o cracked
    """
    from app.papers import paper, write_paper
    from gearsig.report import check_writable

    check_writable(output)
    with progress_bar("preparing") as show:
        publication = paper(name, lambda stage, done: show(done, stage))
        write_paper(publication, output, command=typed_command())
    for figure in publication.figures:
        typer.echo(f"{figure.answers}: {figure.title}")
        for claim in figure.claims:
            typer.echo(f"  {claim.verdict:<15} {claim.statement}: {claim.found}")
    typer.echo(f"{publication.summary} Open {output / 'index.html'} in a browser.")
