"""Figures as data URIs, so that a page is one file."""

from __future__ import annotations

import re
from base64 import b64encode
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from typing import TYPE_CHECKING

from gearsig.plot import _style as style

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image


PNG_DOTS_PER_INCH = 160  # 1440 pixels for 900 on the page: sharp on dense screens and on paper
N_BLENDS = 12  # steps from each of the style's colours to white, for smoothed edges
N_LEVELS = 124  # steps of the colours of maps


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
    svg : str
        An <svg> element that stands in the page itself instead of an address.
    """

    uri: str
    width_px: int
    height_px: int
    caption: str
    alternative: str
    svg: str = ""

    @classmethod
    def of_svg(cls, svg: str, caption: str, alternative: str) -> Picture:
        """Return a picture of an <svg> element with a viewBox from 0 0."""
        width, height = re.findall(r'viewBox="0 0 (\d+)[\d.]* (\d+)', svg)[0]
        inline = svg.replace(' xmlns="http://www.w3.org/2000/svg"', "", 1)  # within HTML the namespace is known
        return cls("", int(width), int(height), caption, alternative, inline)


@dataclass(frozen=True)
class Captioned:
    """A figure with the words that belong to it; see `Picture`."""

    figure: Figure
    caption: str
    alternative: str


def embed(figure: Figure, caption: str, alternative: str, *, vector: bool = False) -> Picture:
    """Turn a figure into a picture: PNG, or SVG where `vector` says that it has few lines."""
    width, height = figure.get_size_inches()
    uri = _svg(figure) if vector else _png(figure)
    return Picture(uri, round(100 * width), round(100 * height), caption, alternative)


def _svg(figure: Figure) -> str:
    buffer = BytesIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return "data:image/svg+xml;base64," + b64encode(buffer.getvalue()).decode("ascii")


def _png(figure: Figure) -> str:
    from PIL import Image

    pixels, buffer = BytesIO(), BytesIO()
    figure.savefig(pixels, format="png", dpi=PNG_DOTS_PER_INCH, pil_kwargs={"compress_level": 0})
    image = Image.open(pixels).convert("RGB")
    # A palette is a third of the size; a fixed one keeps a small mark's colour, which a counted one would blend away.
    image.quantize(palette=_palette(), dither=Image.Dither.NONE).save(buffer, format="png", compress_level=6)
    return "data:image/png;base64," + b64encode(buffer.getvalue()).decode("ascii")


@cache
def _palette() -> Image.Image:
    """Return the colours that figures are made of."""
    from matplotlib.colors import to_rgb
    from PIL import Image

    named = {
        *style.CURSOR_COLOURS.values(),
        style.MEASURED,
        style.SIMULATED,
        style.FAULT,
        style.FLOOR,
        style.INK,
        style.QUIET,
        style.RULE,
    }
    blends = [
        [1 - share * (1 - part) for part in to_rgb(colour)]
        for colour in sorted(named)
        for share in (step / N_BLENDS for step in range(1, N_BLENDS + 1))
    ]
    levels = [style.colours()(step / (N_LEVELS - 1))[:3] for step in range(N_LEVELS)]
    # Pillow looks colours up in steps of 4 of 255: nothing else may lie so near to the white of the paper.
    tinted = [colour for colour in [*blends, *levels] if min(colour) < 0.965]
    numbers = [round(255 * part) for colour in [(1.0, 1.0, 1.0), *tinted] for part in colour]
    palette = Image.new("P", (1, 1))
    palette.putpalette(numbers)
    return palette
