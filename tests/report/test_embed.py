from base64 import b64decode
from io import BytesIO

import numpy as np
from PIL import Image

from gearsig.plot import FAULT, embed, new_figure


def _pixels(figure):
    picture = embed(figure, "caption", "alternative")
    data = b64decode(picture.uri.removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(BytesIO(data)).convert("RGB")).reshape(-1, 3)


def test_paper_stays_white_and_a_small_mark_keeps_its_colour():
    figure = new_figure(2.0)
    axes = figure.add_subplot()
    axes.plot([0, 1], [0, 1], color="#0072B2")
    axes.plot([0.5], [0.2], "o", color=FAULT, markersize=5)
    pixels = _pixels(figure)
    assert (pixels == 255).all(axis=1).mean() > 0.8
    fault = np.array([int(FAULT[i : i + 2], 16) for i in (1, 3, 5)])
    assert (np.abs(pixels - fault).max(axis=1) <= 2).any()


def test_size_on_the_page_is_the_figures():
    picture = embed(new_figure(2.5, 4.0), "c", "a", vector=True)
    assert (picture.width_px, picture.height_px) == (400, 250)
    assert picture.uri.startswith("data:image/svg+xml;base64,")
