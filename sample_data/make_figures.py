"""Draw the documentation's figures: `python sample_data/make_figures.py [NAME …]`.

They are those of `gearsig papers cracked`, and of further commands, that the documentation shows.
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


COMMANDS = {
    "bifurcation": (
        1440,
        "bifurcation.png",
        (
            "bifurcation cracked --preset symmetric_50_50 --torque 20Nm --set roughness_um=0 --set friction=off "
            "--vary speed=1400..2600rpm:49 -o {folder}"
        ),
    ),
    "flexible_sweeps": (1000, "sweeps.png", "flexible --preset light_damping_50_50 -o {folder}"),
    "start_stop": (
        800,
        "start_stop.png",
        "simulate forging -o {folder}/drive.h5",
        "start-stop {folder}/drive.h5 -o {folder}",
    ),
}
"""The documentation's commands: width of the picture in pixels, the figure that is kept, how it is made."""


def run_command(name: str) -> None:
    """Run the documentation's commands, and keep their figure."""
    width_px, figure, *commands = COMMANDS[name]
    with TemporaryDirectory() as folder:
        for command in commands:
            run(
                [sys.executable, "-m", "app.cli.main", *command.format(folder=folder).split()],
                check=True,
            )
        save_pixels(Path(folder) / figure, PICTURES / f"{name}.png", width_px=width_px)


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG."""
    pixels = BytesIO()
    figure.savefig(pixels, format="png")
    save_pixels(pixels, path)


def save_pixels(pixels: BytesIO | Path, path: Path, *, width_px: int | None = None) -> None:
    """Write a PNG with a palette, a third of the size; at that width, where one is given."""
    image = Image.open(pixels).convert("RGB")
    if width_px is not None:
        image = image.resize((width_px, round(image.height * width_px / image.width)), Image.Resampling.LANCZOS)
    image = image.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    # Counting colours shifts white by one step, which shows as a grey sheet on a white page.
    image.putpalette([255 if part > 251 else part for part in image.getpalette() or ()])
    image.save(path, format="png", optimize=True)


def main() -> None:
    """Write all figures, or those that are named."""
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or (*FIGURES, *COMMANDS):
        if name in COMMANDS:
            run_command(name)
        else:
            save(FIGURES[name](), PICTURES / f"{name}.png")


if __name__ == "__main__":
    main()
