"""Draw the README's pictures from the samples: `python sample_data/make_pictures.py`."""

from __future__ import annotations

from pathlib import Path

import gearsig
from gearsig.diagnosis import Analysis
from gearsig.plot import average_figure, marks_of, order_cursors, polar_figure, spectrum_figure
from gearsig.rig import order_lines

HERE = Path(__file__).parent
PICTURES = HERE / "pictures"


def analysed(name: str) -> Analysis:
    """Analyse a sample with the rig file beside it."""
    rig = gearsig.read_rig(HERE / (name.split(".", maxsplit=1)[0] + ".toml"))
    return gearsig.analyze(gearsig.read_recording(HERE / name, rig=rig))


def main() -> None:
    """Write the pictures."""
    PICTURES.mkdir(exist_ok=True)
    damaged = analysed("damaged_tooth.csv.gz")
    averages = damaged.channels[0].averages
    marks = marks_of(damaged.findings, "input", 29)
    polar = polar_figure(averages["input", "difference"], n_teeth=29, marks=marks)
    polar.savefig(PICTURES / "damaged_tooth.png", dpi=90)
    shown = [averages["input", "average"], averages["input", "difference"]]
    average_figure(shown, n_teeth=29, marks=marks).savefig(PICTURES / "averages.png", dpi=90)
    eccentric = analysed("eccentric_wheel.wav")
    assert eccentric.rig is not None  # noqa: S101 - it was read with one
    lines = [x for x in order_lines(eccentric.rig) if x.harmonic == 3 and x.kind in ("mesh", "sideband")]
    spectrum = eccentric.channels[0].order_spectrum
    assert spectrum is not None  # noqa: S101 - it has a tachometer
    figure = spectrum_figure(spectrum, order_cursors(lines), limits=(83.5, 90.5), title="An eccentric wheel")
    figure.savefig(PICTURES / "sidebands.png", dpi=90)


if __name__ == "__main__":
    main()
