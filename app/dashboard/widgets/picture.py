"""A figure of `gearsig.plot` on the page, turned over on dark ground."""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Literal

import numpy as np
import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.look import is_dark
from app.dashboard.theme import DARK_PAPER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 180
DARK_GROUND = np.frombuffer(bytes.fromhex(DARK_PAPER.removeprefix("#")), np.uint8) / 255
BRIGHTEST = 0.93
# Turns the hue by half a circle and keeps the lightness: the matrix of hue-rotate(180deg) in the W3C's Filter Effects
# Module, with which the reports turn their figures over, too.
HALF_TURN = np.array([[-0.574, 1.430, 0.144], [0.426, 0.430, 0.144], [0.426, 1.430, -0.856]])


def show_picture(figure: Figure, words: str, width: int | Literal["stretch"] = "stretch") -> None:
    """Show a figure; `words` say what it shows, for those who do not see it."""
    st.image(picture_bytes(figure, dark=is_dark()), width=width, alt=as_typed(words))


def picture_bytes(figure: Figure, *, dark: bool) -> bytes:
    """Return the figure as PNG; `dark` turns light and dark over and keeps the hues."""
    from PIL import Image

    pixels, buffer = BytesIO(), BytesIO()
    figure.savefig(pixels, format="png", dpi=DOTS_PER_INCH, pil_kwargs={"compress_level": 0})
    image = Image.open(pixels).convert("RGB")
    if dark:
        turned = np.clip((1 - np.asarray(image, dtype=np.float32) / 255) @ HALF_TURN.T, 0, 1)
        image = Image.fromarray((255 * (DARK_GROUND + (BRIGHTEST - DARK_GROUND) * turned)).astype(np.uint8))
    image.save(buffer, format="png", compress_level=1)
    return buffer.getvalue()
