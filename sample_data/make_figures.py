"""Draw the figures of the cracked spur pair: `python sample_data/make_figures.py [NAME …]`.

They are those of `gearsig papers cracked` that the documentation shows.
"""

from __future__ import annotations

import sys
from io import BytesIO
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from PIL import Image

from app.papers import cracked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = Path(__file__).parent / "pictures"
FIGURES = {
    "mesh_stiffness_cracks": cracked.mesh_stiffness_cracks,
    "friction_roughness": cracked.friction_roughness,
    "backlash_roughness": cracked.backlash_roughness,
    "response_roughness": cracked.response_roughness,
    "crack_comparison": cracked.crack_comparison,
}


def bifurcation() -> None:
    """Run the README's command, and keep its figure."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "app.cli.main", "bifurcation", "cracked", "--preset", "symmetric_50_50"]
        settings = ["--torque", "20Nm", "--set", "roughness_um=0", "--set", "friction=off"]
        run([*command, *settings, "--vary", "speed=1400..2600rpm:49", "-o", folder], check=True)
        save_pixels(Path(folder) / "bifurcation.png", PICTURES / "bifurcation.png")


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG."""
    pixels = BytesIO()
    figure.savefig(pixels, format="png")
    save_pixels(pixels, path)


def save_pixels(pixels: BytesIO | Path, path: Path) -> None:
    """Write a PNG with a palette: a third of the size."""
    image = Image.open(pixels).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    # Counting colours shifts white by one step, which shows as a grey sheet on a white page.
    image.putpalette([255 if part > 251 else part for part in image.getpalette() or ()])
    image.save(path, format="png", optimize=True)


def main() -> None:
    """Write all figures, or those that are named."""
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or (*FIGURES, "bifurcation"):
        if name == "bifurcation":
            bifurcation()
        else:
            save(FIGURES[name](), PICTURES / f"{name}.png")


if __name__ == "__main__":
    main()
