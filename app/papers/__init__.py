"""Three publications: their figures as computed by the models, statements checked by numbers, and the page of both."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from gearsig.checks import one_of
from gearsig.formatting import with_minus
from gearsig.plot import embed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Verdict = Literal["agrees", "agrees in part", "does not"]
SIGNS: Mapping[Verdict, str] = {"agrees": "✓", "agrees in part": "≈", "does not": "✗"}
Progress = Callable[[str, float], object]

PAPERS: Mapping[str, str] = {
    "cracked": "Spur pair with root crack, friction and fractal backlash",
    "reduced-fe": "Flexible gear wheels of reduced finite elements",
    "forging": "Start–stop drive of a forging manipulator",
}
"""The publications by their names in the command."""


@dataclass(frozen=True)
class Claim:
    """A statement of the publication and the corresponding result of the model.

    Parameters
    ----------
    statement : str
        The statement with its number.
    number : str
        The number from the model.
    verdict : str
    because : str
        The reason, if it does not agree or agrees only in part.
    """

    statement: str
    number: str
    verdict: Verdict
    because: str = ""

    @property
    def judgement(self) -> str:
        """The verdict with its sign and its reason."""
        fails = self.verdict == "does not"
        text = f"{SIGNS[self.verdict]} {self.verdict}{' agree' if fails else ''}"
        joint = ", because " if fails else ": "
        return f"{text}{joint}{self.because}" if self.because and self.verdict != "agrees" else text


def judged(statement: str, number: str, *, agrees: bool, partly: bool = False, because: str = "") -> Claim:
    """Return a claim whose verdict follows from two comparisons of numbers."""
    return Claim(
        statement,
        with_minus(number),
        "agrees" if agrees else "agrees in part" if partly else "does not",
        with_minus(because),
    )


def within_part(statement: str, published: float, value: float, unit: str, *, part: float, because: str = "") -> Claim:
    """Return a claim that agrees within the fraction `part` of the published number, in part within three times it."""
    away = abs(value / published - 1.0)
    more_percent = 100.0 * (value / published - 1.0)
    text = f"{value:.4g} {unit} ({more_percent:{'+.2g' if abs(more_percent) < 99.5 else '+.0f'}} %)"
    return judged(statement, text, agrees=away <= part, partly=away <= 3.0 * part, because=because)


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the model that corresponds to one or more figures of the publication.

    Parameters
    ----------
    name : str
        File name.
    answers : str
        Figures of the publication, e.g. "Figures 10 and 11".
    title : str
    figure : Figure
    claims : tuple of Claim
    """

    name: str
    answers: str
    title: str
    figure: Figure
    claims: tuple[Claim, ...]


@dataclass(frozen=True)
class Paper:
    """A publication and the model's figures for it.

    Parameters
    ----------
    name, title, source : str
    machine : str
        The preset and its assumptions.
    figures : tuple of PaperFigure
    unanswered : mapping
        Figure of the publication → why the model has no figure for it.
    """

    name: str
    title: str
    source: str
    machine: str
    figures: tuple[PaperFigure, ...]
    unanswered: Mapping[str, str]

    @property
    def summary(self) -> str:
        """Number of statements that agree, as a sentence."""
        verdicts = [claim.verdict for figure in self.figures for claim in figure.claims]
        n = len(verdicts)
        agree, part = verdicts.count("agrees"), verdicts.count("agrees in part")
        return f"{agree} of {n} statements agree, {part} in part, {n - agree - part} do not."


def paper(name: str, on_progress: Progress = lambda _stage, _done: None) -> Paper:
    """Compute the figures of a publication.

    Parameters
    ----------
    name : str
        One of `PAPERS`.
    on_progress : callable
        Takes the current stage and the fraction completed, 0 to 1.
    """
    one_of(name, "paper", tuple(PAPERS))
    module = import_module(f"app.papers.{name.replace('-', '_')}")
    made: Paper = module.compute(on_progress)
    return made


def write_paper(publication: Paper, folder: Path, *, command: str = "") -> tuple[Path, ...]:
    """Write each figure as PNG and SVG, the claims as JSON, and the page that shows both side by side."""
    from gearsig.report import Section, benchmark_html, write_folder

    header = ("the publication says", "the model gives", "verdict")
    sections = [
        Section(
            f"{item.answers}: {item.title}",
            header=header,
            rows=tuple((claim.statement, claim.number, claim.judgement) for claim in item.claims),
            pictures=(embed(item.figure, "", f"{item.title}, computed by the model"),),
            is_prose=True,
        )
        for item in publication.figures
    ]
    rows = tuple(publication.unanswered.items())
    sections.append(Section("Figures without a counterpart", header=("figure", "reason"), rows=rows, is_prose=True))
    facts = [("publication", publication.source), ("machine", publication.machine)]
    facts += [("command", command)] if command else []
    page = benchmark_html(publication.title, publication.summary, sections, facts, datetime.now().astimezone())
    drawn = {f"{item.name}{end}": item.figure for item in publication.figures for end in (".png", ".svg")}
    return write_folder(folder, drawn, {"claims.json": _claims_json(publication), "index.html": page})


def _claims_json(paper: Paper) -> str:
    def rows() -> Iterator[dict[str, str]]:
        for item in paper.figures:
            for claim in item.claims:
                yield {"figure": item.name, "answers": item.answers, **vars(claim)}

    about = {"paper": paper.name, "source": paper.source, "machine": paper.machine, "summary": paper.summary}
    return json.dumps(
        {**about, "claims": list(rows()), "unanswered": dict(paper.unanswered)}, ensure_ascii=False, indent=2
    )
