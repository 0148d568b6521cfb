"""Report files: names, checks before writing, rendering of HTML and PDF; pages made of sections."""

from __future__ import annotations

import hashlib
import json
import re
from base64 import b64decode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from datetime import datetime
from enum import Enum
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile
from typing import TYPE_CHECKING, Any, Literal

from gearsig import __version__
from gearsig.cache import made_folder, write_text, write_whole
from gearsig.errors import InputError, not_written
from gearsig.plot import Picture, font_folder
from gearsig.recording import without_condition
from gearsig.rig import recording_stem

if TYPE_CHECKING:
    from jinja2 import Environment


LONGEST_NAME = 50  # a character may take four bytes, and file systems allow 255
_RESERVED = {"index", "con", "prn", "aux", "nul"} | {f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10)}


_MARK = re.compile(rb'<meta name="gearsig-recording" content="(\w+)">')
_HEAD_BYTES = 1024
"""Bytes at the start of a page that contain its mark."""


def page_names(sources: Iterable[str | Path], folder: Path | None = None) -> tuple[str, ...]:
    """Return a safe and unique file name, without extension, for each source, in order.

    Letters, digits, "-", "_" and "." are kept; characters that could affect a path or a link become "-". Sources whose
    names would be equal, even apart from case, get a number. In a folder that already has pages, a recording keeps the
    name of its own page, which has its `recording_mark`, and gets no name of another page.

    Examples
    --------
    >>> page_names(["a/run 1.csv", "b/run 1.csv", "../../etc/passwd", "index.mat", "…"])
    ('run-1', 'run-1-2', 'passwd', 'index-2', 'recording')
    >>> page_names(["runs.mat#2", "runs.mat#3", "runs.mat"])
    ('runs_2', 'runs_3', 'runs')
    """
    pages = () if folder is None else folder.glob("*.html")
    present = {page.stem.lower(): (page.stem, _mark_of(page)) for page in pages}
    taken = set(_RESERVED)
    return tuple(_unique(_safe(str(source)), taken, present, recording_mark(source)) for source in sources)


def recording_mark(source: str | Path) -> str:
    """Return a hash of a recording's full path, to distinguish its page from those of others with its name."""
    return hashlib.sha256(str(Path(source).absolute()).encode("utf-8", "surrogatepass")).hexdigest()[:16]


def check_writable(folder: Path, option: str = "-o") -> None:
    """Check before long work that files can be written to a folder, which need not exist yet.

    Parameters
    ----------
    folder : Path
    option : str
        The option that gave it, for the error.

    Raises
    ------
    InputError
        If it is a file, is not writable, or its disk is full.
    """
    try:
        if folder.exists() and not folder.is_dir():
            raise InputError("is a file", where=str(folder), remedy=f"choose a folder with {option}")
        existing = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
        # Permissions alone do not show whether anything can be created: the disk may be full.
        with TemporaryFile(dir=existing) as probe:
            probe.write(bytes(1 << 16))
            probe.flush()
    except OSError as error:
        raise _unwritable(folder, error, option) from None


def _unwritable(path: Path, error: OSError, option: str = "-o") -> InputError:
    return not_written(error, path, f"choose another folder with {option}")


def _safe(source: str) -> str:
    file, run = without_condition(Path(source.replace("\\", "/")))
    ending = "" if run is None else f"_{run}"[:LONGEST_NAME]
    name = re.sub(r"[^\w.-]+", "-", recording_stem(file.name)).strip(".-_")
    return (name[: LONGEST_NAME - len(ending)].strip(".-_") or "recording") + ending


def _unique(name: str, taken: set[str], present: Mapping[str, tuple[str, str]], mark: str) -> str:
    """Return the first free name, or that of the page with this mark; adds it in lower case to `taken`."""
    of_this_name = re.compile(rf"{re.escape(name)}(-\d+)?", re.IGNORECASE)
    pages = [page for page, of in present.values() if of == mark and of_this_name.fullmatch(page)]
    choice = next((page for page in pages if page.lower() not in taken), name)
    number = 1
    while choice.lower() in taken or (choice not in pages and choice.lower() in present):
        number += 1
        choice = f"{name}-{number}"
    taken.add(choice.lower())
    return choice


def _mark_of(page: Path) -> str:
    """Return the mark of a page; empty if it has none, as pages from other programs."""
    try:
        with page.open("rb") as file:
            match = _MARK.search(file.read(_HEAD_BYTES))
    except OSError:
        return ""
    return match[1].decode() if match is not None else ""


def render(template: str, **values: Any) -> str:
    """Render a template with `values` and return the page."""
    return _environment().get_template(template).render(**values)


@cache
def _environment() -> Environment:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    from gearsig.formatting import unit_text

    environment = Environment(
        loader=PackageLoader("gearsig.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["unit"] = unit_text
    return environment


def write_folder(
    folder: str | Path,
    figures: Mapping[str, Any] | None = None,  # only gearsig.plot knows the drawing library's type
    texts: Mapping[str, str] | None = None,
    *,
    dpi: float | Literal["figure"] = 160,
) -> tuple[Path, ...]:
    """Write figures and texts by name to a folder, which is created if missing, each atomically; return the paths.

    Parameters
    ----------
    folder : str or Path
    figures, texts : mapping, optional
        Name with extension, such as "map.png" or "map.svg" → figure; likewise for texts.
    dpi : float or "figure"
        Dots per inch of the figures; "figure": that of each figure.

    Raises
    ------
    InputError
        If something cannot be written.
    """
    place = made_folder(Path(folder))
    paths = []
    for name, figure in (figures or {}).items():
        draw = partial(figure.savefig, format=name.rpartition(".")[2], dpi=dpi)
        paths.append(write_whole(place / name, draw, remedy="choose another folder with -o"))
    return *paths, *(write_text(place / name, text) for name, text in (texts or {}).items())


def date_text(date: datetime | None = None) -> str:
    """Return the date of a page as text; None: now."""
    return (date or datetime.now().astimezone()).strftime("%Y-%m-%d %H:%M %Z").strip()


# --------------------
# PDF, typeset by typst: a program in a wheel, which loads nothing from the network.
# --------------------


SVG = '<svg xmlns="http://www.w3.org/2000/svg"'


def write_pdf(path: str | Path, content: bytes) -> Path:
    """Write a PDF atomically: it appears only when it is complete.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    return write_whole(Path(path), lambda file: file.write(content))


def check_pdf() -> None:
    """Check before long work that PDFs can be made.

    Raises
    ------
    InputError
        If typst is not installed.
    """
    try:
        import typst  # noqa: F401
    except ImportError:
        raise InputError("PDF needs the package typst", remedy="pip install 'gearsig[pdf]'") from None


def compiled(template: str, values: Mapping[str, Any]) -> bytes:
    """Render a template to PDF from the same values as the HTML page.

    Pictures are passed as files. Fonts are matplotlib's, so that the result is the same on all machines.
    """
    check_pdf()
    import typst

    pictures: dict[str, bytes] = {}

    def described(value: Any) -> object:
        if isinstance(value, Picture):
            return _put_picture(value, pictures)
        return vars(value) if is_dataclass(value) else value.value if isinstance(value, Enum) else str(value)

    content = json.dumps({**values, "version": __version__}, ensure_ascii=False, default=described).encode()
    with TemporaryDirectory(prefix="gearsig-") as folder:
        main = Path(folder) / template
        for name in (template, "print.typ"):
            (Path(folder) / name).write_bytes(files("gearsig.report").joinpath("templates", name).read_bytes())
        for name, part in {"data.json": content, **pictures}.items():
            (Path(folder) / name).write_bytes(part)
        made = typst.compile(main, root=Path(folder), font_paths=[font_folder()], ignore_system_fonts=True)
    return bytes(made)


def _put_picture(picture: Picture, pictures: dict[str, bytes]) -> dict[str, object]:
    """Add a picture to the files, and return its template values."""
    if picture.svg:
        name = f"picture{len(pictures)}.svg"
        pictures[name] = picture.svg.replace("<svg", SVG, 1).replace("system-ui, ", "").encode()
    else:
        kind, _, content = picture.uri.partition(";base64,")
        name = f"picture{len(pictures)}.{'svg' if 'svg' in kind else 'png'}"
        pictures[name] = b64decode(content)
    square = picture.width_px == picture.height_px
    words = {"title": picture.title, "caption": picture.caption, "alternative": picture.alternative}
    return {"file": name, "square": square, **words}


# --------------------
# The page of a benchmark: tables and figures, one section each.
# --------------------


@dataclass(frozen=True)
class Section:
    """A heading with a table, with pictures, or with both.

    Parameters
    ----------
    title, note : str
    header : tuple of str
    rows : tuple of tuple of str
        The first cell of a row is its heading.
    pictures : tuple of Picture
    is_prose : bool
        Whether the cells are sentences, which wrap in columns of equal width, or numbers, which do not wrap.
    """

    title: str
    note: str = ""
    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    pictures: tuple[Picture, ...] = ()
    is_prose: bool = False


def benchmark_html(
    title: str, summary: str, sections: Sequence[Section], provenance: Sequence[tuple[str, str]], date: datetime
) -> str:
    """Return the page as one file without scripts or external resources."""
    return render(
        "benchmark.html.j2",
        title=title,
        summary=summary,
        sections=sections,
        provenance=provenance,
        date=date_text(date),
        version=__version__,
    )
