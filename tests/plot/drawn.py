"""What is written on a figure."""

from io import BytesIO

from matplotlib.figure import Figure
from matplotlib.text import Text


def texts_of(figure: Figure) -> list[str]:
    """Draw, which raises where matplotlib warns; return all texts."""
    figure.savefig(BytesIO(), format="png", dpi=40)
    return [text.get_text().strip() for text in figure.findobj(Text) if isinstance(text, Text) and text.get_text()]
