"""Pages as PDF, set by typst: a program in a wheel, which loads nothing from the network."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gearsig import __version__
from gearsig.cache import write_whole
from gearsig.diagnosis import Analysis
from gearsig.errors import InputError
from gearsig.plot import Picture, font_folder
from gearsig.report._page import page_parts

SVG = '<svg xmlns="http://www.w3.org/2000/svg"'


def page_pdf(analysis: Analysis, *, command: str = "", methods: Sequence[str] | None = None) -> bytes:
    """Return the page of one recording as PDF, with the same content as `page_html` but the table of indicators.

    Parameters
    ----------
    analysis : Analysis
    command : str
        The command that makes the page again.
    methods : sequence of str or None
        Further methods that the page shows; None: those that the recording calls for.

    Raises
    ------
    InputError
        If typst is not installed.
    """
    parts = page_parts(analysis, command=command, methods=methods)
    pictures: dict[str, bytes] = {}
    verdict = parts["verdict_picture"]
    data = {
        "title": parts["title"],
        "machine": parts["machine_name"],
        "headline": parts["headline"],
        "explanation": parts["explanation"],
        "outcome": parts["outcome"],
        "css_class": parts["outcome_class"],
        "reference": parts["reference"],
        "date": dict(parts["provenance"]).get("date", ""),
        "made": f"gearsig {__version__}",
        "changes": [
            asdict(row) | {"change": row.change, "repeatability": f"± {row.repeatability_db:.1f}"}
            for row in parts["changes"]
        ],
        "verdict_picture": None if verdict is None else put_picture(verdict, pictures),
        "findings": [asdict(card) for card in parts["findings"]],
        "further": [asdict(card) for card in parts["further"]],
        "groups": [
            {
                "title": group.title,
                "wide": [put_picture(picture, pictures) for picture in group.wide],
                "small": [put_picture(picture, pictures) for picture in group.small],
            }
            for group in parts["gallery"].groups
        ],
        "facts": [*parts["machine"], *parts["speed"], *(("remark", text) for text in parts["warnings"])],
        "provenance": parts["provenance"],
    }
    return compiled("page.typ", data, pictures)


def write_pdf(path: str | Path, content: bytes) -> Path:
    """Write a PDF beside its place and move it there when it is complete.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    return write_whole(Path(path), lambda file: file.write(content))


def check_pdf() -> None:
    """Check, before long work, that PDFs can be made.

    Raises
    ------
    InputError
        If typst is not installed.
    """
    try:
        import typst  # noqa: F401
    except ImportError:
        raise InputError("PDF needs the package typst", remedy="pip install 'gearsig[pdf]'") from None


def compiled(template: str, data: Mapping[str, Any], pictures: Mapping[str, bytes]) -> bytes:
    """Return the PDF that a template makes of data; fonts are matplotlib's, so that every machine sets it alike."""
    check_pdf()
    import typst

    source = files("gearsig.report").joinpath("templates", template).read_bytes()
    content = json.dumps(data, ensure_ascii=False, default=str).encode()
    with TemporaryDirectory(prefix="gearsig-") as folder:
        for name, part in {"main.typ": source, "data.json": content, **pictures}.items():
            (Path(folder) / name).write_bytes(part)
        main, fonts = Path(folder) / "main.typ", [font_folder()]
        made = typst.compile(main, root=Path(folder), font_paths=fonts, ignore_system_fonts=True)
    return bytes(made)


def put_picture(picture: Picture, pictures: dict[str, bytes]) -> dict[str, object]:
    """Add a picture to the files, and return what the template says of it."""
    if picture.svg:
        name = f"picture{len(pictures)}.svg"
        pictures[name] = picture.svg.replace("<svg", SVG, 1).replace("system-ui, ", "").encode()
    else:
        kind, _, content = picture.uri.partition(";base64,")
        name = f"picture{len(pictures)}.{'svg' if 'svg' in kind else 'png'}"
        pictures[name] = b64decode(content)
    square = picture.width_px == picture.height_px
    return {"file": name, "caption": picture.caption, "alternative": picture.alternative, "square": square}
