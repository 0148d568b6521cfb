"""What README and docs show: their Python runs, their commands and options exist, their links lead somewhere."""

import json
import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
from packaging.requirements import Requirement

from app.cli.main import app
from gearsig.gap import GapReport
from gearsig.recording import FORMAT_OF_EXTENSION
from gearsig.report import gap_to_dict
from sims.effects import effects

ROOT = Path(__file__).parents[1]
GAP = ROOT / "docs" / "tutorials" / "gap.ipynb"
BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>[a-z]+) -->\n)?```(?P<language>\w*)\n(?P<code>.*?)^```$", re.DOTALL | re.MULTILINE
)


def text_of(page: Path) -> str:
    """Return a page, or a notebook as if it were one: its code in fences, marked by its tags."""
    text = page.read_text(encoding="utf-8")
    if page.suffix != ".ipynb":
        return text
    parts = []
    for cell in json.loads(text)["cells"]:
        source, tags = "".join(cell["source"]), cell["metadata"].get("tags", [])
        marks = "".join(f"<!-- {tag} -->\n" for tag in tags)
        parts.append(f"{marks}```python\n{source}\n```" if cell["cell_type"] == "code" else source)
    return "\n\n".join(parts) + "\n"


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "docs").rglob("*.ipynb"))]
RUN = [page for page in PAGES if "```python" in text_of(page) and page != ROOT / "docs" / "gap.md"]


def blocks(page: Path, language: str) -> Iterator[tuple[str, str]]:
    """Yield mark and code of a page's blocks of one language."""
    for block in BLOCK.finditer(text_of(page)):
        if block["language"] == language:
            yield block["mark"] or "", block["code"]


def name_of(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN, ids=name_of)
def test_python_of_the_pages_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "sample_data").symlink_to(ROOT / "sample_data")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for mark, code in blocks(page, "python"):
        if mark != "slow":
            exec(compile(code, name_of(page), "exec"), names)  # noqa: S102 - our own pages
    assert names


@pytest.mark.slow
def test_the_gap_tutorial_finds_tooth_effect_and_depth(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the sample's crack: 3 mm at tooth 21."""
    (tmp_path / "sample_data").symlink_to(ROOT / "sample_data")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for _, code in blocks(GAP, "python"):
        exec(compile(code, GAP.name, "exec"), names)  # noqa: S102 - our own page
    report: GapReport = names["report"]
    assert report.kind is not None
    assert report.kind.group == "tooth-local"
    assert report.kind.probability > 0.95
    assert "tooth 21 " in report.kind.place
    assert json.loads(json.dumps(gap_to_dict(report)))["kind"]["group"] == "tooth-local"
    crack = report.causes[0]
    assert crack.name == "root_crack"
    assert crack.probability > 0.9
    assert crack.severity is not None
    assert crack.severity.low <= 3.0 <= crack.severity.high
    assert crack.severity.value == pytest.approx(3.0, rel=0.2)
    assert crack.fitted is not None
    assert crack.fitted.severity == pytest.approx(crack.severity.value)


def test_notebooks_are_small_and_without_outputs() -> None:
    notebooks = [page for page in PAGES if page.suffix == ".ipynb"]
    assert len(notebooks) == 4
    for page in notebooks:
        cells = json.loads(page.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") for cell in cells), page.name
        assert len({cell["id"] for cell in cells}) == len(cells)


def commands() -> Iterator[tuple[str, list[str]]]:
    """Yield page and words of every line that calls gearsig."""
    for page in PAGES:
        for _, code in blocks(page, "sh"):
            for line in code.replace("\\\n", " ").splitlines():
                for part in line.split("&&"):
                    words = shlex.split(part, comments=True)
                    if words and words[0] in ("gearsig", ".venv/bin/gearsig"):
                        yield name_of(page), words[1:]


@pytest.mark.parametrize(
    ("page", "words"), list(commands()), ids=lambda value: value if isinstance(value, str) else " ".join(value)
)
def test_commands_of_the_pages_exist(page: str, words: list[str]) -> None:
    command: Any = typer.main.get_command(app)
    words = ["show", *words] if words[0] == "modes" else words  # which hands its options on
    while hasattr(command, "commands") and not words[0].startswith("-"):
        inner = command.get_command(typer.Context(command), words[0])
        assert inner is not None, (page, words)
        command, words = inner, words[1:]
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert {word for word in words if re.match(r"--?[a-z]", word)} <= known | {"--help"}, page


def test_links_lead_somewhere() -> None:
    lost = [
        (name_of(page), target)
        for page in PAGES
        for target in re.findall(r"\]\(([^)#:]*)(?:#[^)]*)?\)", text_of(page))
        if target and not (page.parent / target).exists()
    ]
    assert not lost


def test_the_glossary_is_short() -> None:
    rows = [
        line
        for line in (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").splitlines()
        if line.startswith("| ")
    ]
    assert len(rows) - 1 <= 80


def test_the_readme_is_a_readme() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 150


def test_pages_and_help_name_every_file_format() -> None:
    names = [file_format.name for file_format in dict.fromkeys(FORMAT_OF_EXTENSION.values())]
    for page in (ROOT / "README.md", ROOT / "docs" / "formats.md", ROOT / "app" / "cli" / "analyze.py"):
        text = page.read_text(encoding="utf-8")
        assert [name for name in names if name not in text] == [], page.name


def test_pages_name_and_count_the_effects() -> None:
    simulators = (ROOT / "docs" / "simulators.md").read_text(encoding="utf-8")
    assert [name for name in effects() if f"`{name}`" not in simulators] == []
    assert len(effects()) == 19, "README, docs/gap.md and docs/simulators.md say nineteen"


def test_constraints_pin_what_is_needed_and_name_no_place_to_get_it_from() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    needed = [
        *project["dependencies"],
        *project["optional-dependencies"]["pdf"],
    ]
    lines = (ROOT / "docs" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(line.lower().replace("_", "-").split("==") for line in lines if not line.startswith("#"))
    for line in needed:
        requirement = Requirement(line)
        assert requirement.specifier.contains(pins[requirement.name.lower().replace("_", "-")]), line
