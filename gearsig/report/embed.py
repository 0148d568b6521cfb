"""Figures as data URIs, so that a page is one file."""

from __future__ import annotations

from base64 import b64encode
from dataclasses import dataclass
from io import BytesIO
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PNG_DOTS_PER_INCH = 160  # 1440 pixels for 900 on the page: sharp on dense screens and on paper
N_COLOURS = 192  # figures have few colours and their blends; a third of the size


@dataclass(frozen=True)
class Picture:
    """A figure ready for a page.

    Parameters
    ----------
    uri : str
    width_px, height_px : int
        On the page.
    caption : str
        One sentence on what to look at.
    alternative : str
        What the picture shows, for those who do not see it.
    """

    uri: str
    width_px: int
    height_px: int
    caption: str
    alternative: str


def embed(
    figure: Figure, caption: str, alternative: str, *, vector: bool = False, n_colours: int = N_COLOURS
) -> Picture:
    """Turn a figure into a picture: PNG, or SVG where `vector` says that it has few lines."""
    width, height = figure.get_size_inches()
    uri = _svg(figure) if vector else _png(figure, n_colours)
    return Picture(uri, round(100 * width), round(100 * height), caption, alternative)


def _svg(figure: Figure) -> str:
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + b64encode(buffer.getvalue()).decode("ascii")


def _png(figure: Figure, n_colours: int) -> str:
    from PIL import Image

    pixels, buffer = BytesIO(), BytesIO()
    figure.savefig(pixels, format="png", dpi=PNG_DOTS_PER_INCH, pil_kwargs={"compress_level": 0})
    image = Image.open(pixels).convert("RGB")
    image.quantize(n_colours, dither=Image.Dither.NONE).save(buffer, format="png", compress_level=6)
    return "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")
