"""Figures of rows: a text, a horizontal bar, and figures beside it."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

from gearsig.plot import style
from gearsig.plot.display import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BAR = 0.56
"""Height of a bar, of its row."""
_LINE_IN = 0.155
_CHARACTERS_PER_IN, _BOLD_PER_IN = 15.5, 13.5


@dataclass(frozen=True)
class RowPanel:
    """Axes whose rows lie at y = 0, 1, … from the top.

    Parameters
    ----------
    figure : Figure
    axes : Axes
    n_rows : int
    left_in, right_in : float
        Room for texts.
    """

    figure: Figure
    axes: Axes
    n_rows: int
    left_in: float
    right_in: float

    def name(self, row: int, text: str, *, below: str = "", colour: str = style.INK, bold: bool = False) -> None:
        """Write left of a row, in two lines at most, and a quiet line below."""
        per_line = int((self.left_in - 0.25) * (_BOLD_PER_IN if bold else _CHARACTERS_PER_IN))
        lines = _broken(text, per_line, 1 if below else 2)
        top = (len(lines) + bool(below) - 1) / 2.0
        for i, line in enumerate([*lines, *([below] if below else [])]):
            quiet = below and i == len(lines)
            self._write(
                0.0,
                row,
                plain(line, int((self.left_in - 0.2) * _CHARACTERS_PER_IN) + 1),
                (-8.0, (top - i) * _LINE_IN * 72.0),
                "right",
                style.QUIET if quiet else colour,
                bold=bold and not quiet,
            )

    def say(self, row: int, text: str, *, below: str = "", colour: str = style.INK) -> None:
        """Write right of a row, beyond the panel."""
        texts = [text, *([below] if below else [])]
        for i, line in enumerate(texts):
            up = ((len(texts) - 1) / 2.0 - i) * _LINE_IN * 72.0
            n_max = int((self.right_in - 0.15) * _CHARACTERS_PER_IN) + 1
            self._write(1.0, row, plain(line, n_max), (8.0, up), "left", style.QUIET if i else colour, bold=not i)

    def _write(
        self, x: float, row: int, text: str, offset_pt: tuple[float, float], ha: str, colour: str, *, bold: bool = False
    ) -> None:
        self.axes.annotate(
            text,
            (x, row),
            xycoords=self.axes.get_yaxis_transform(),
            xytext=offset_pt,
            textcoords="offset points",
            ha=ha,
            va="center",
            fontsize=style.SMALL_PT,
            fontweight="bold" if bold else "normal",
            color=colour,
            parse_math=False,
            annotation_clip=False,
        )


def row_panel(
    n_rows: int,
    *,
    left_in: float,
    right_in: float,
    row_in: float = 0.46,
    top_in: float = 0.4,
    bottom_in: float = 0.55,
    width_in: float = style.WIDTH_IN,
) -> RowPanel:
    """Return an empty figure with `n_rows` rows."""
    figure = style.new_figure(top_in + bottom_in + row_in * n_rows, width_in)
    axes = style.panel(figure, left_in=left_in, right_in=right_in, bottom_in=bottom_in, top_in=top_in)
    axes.set_ylim(n_rows - 0.5, -0.5)
    axes.set_yticks([])
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x", which="major", color=style.RULE, linewidth=0.7)
    return RowPanel(figure, axes, n_rows, left_in, right_in)


def _broken(text: str, n_max: int, n_lines: int) -> list[str]:
    """Return the text in at most `n_lines` lines of `n_max` characters; a longer one is cut in its middle."""
    lines = wrap(plain(text, 400), n_max)
    return lines if len(lines) <= n_lines else wrap(plain(text, n_lines * n_max - 6), n_max)[:n_lines] or [""]
