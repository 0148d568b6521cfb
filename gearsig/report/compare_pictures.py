"""The pictures of a comparison, and what to look at in each."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from gearsig.compare.types import ChannelComparison, Comparison, ShaftComparison
from gearsig.plot.cursors import Cursor
from gearsig.plot.embed import Captioned, Picture, embed

MESH_HARMONICS_SHOWN = 5.6
WITHOUT_MESH = 50.0
"""Highest order drawn, in mesh orders, and where there is no mesh."""
MOST_CURSORS = 10

LOOK_AT_ORDERS = (
    "Below: how far each line of the simulation is off. Shaded: twice its repeatability. A triangle marks a line that "
    "one of the two does not show: there the difference is at least so large."
)
LOOK_AT_TEETH = "At the bottom the level tooth by tooth: pale bars are within the records' own scatter."
LOOK_AT_BANDS = (
    "FRAC: how alike the lines in a band are, whatever their gain; 1 is the same shape. A dash is what the complex "
    "one gives by chance, because one line outweighs all others; the dotted line what unrelated magnitudes give."
)
LOOK_AT_OCTAVES = "Everything in each band, noise included. At another speed, other orders fall into a band."


def channel_pictures(comparison: Comparison, channel: ChannelComparison) -> Iterator[Picture]:
    """Yield the pictures of one channel: orders, averages of each shaft, bands."""
    for figures in FIGURES.values():
        for one in figures(comparison, channel):
            yield embed(one.figure, one.caption, one.alternative)


def order_figures(comparison: Comparison, channel: ChannelComparison) -> Iterator[Captioned]:
    """Yield both order spectra with the differences of their lines."""
    from gearsig.plot.compare import order_overlay_figure

    figure = order_overlay_figure(
        channel.recorded_spectrum,
        channel.simulated_spectrum,
        (*channel.lines, *channel.other_lines),
        mesh_cursors(comparison),
        limits=(0.0, shown_orders(comparison)),
        title=f"Order spectra, {channel.name}",
    )
    shows = f"Order spectra of {channel.name}, recorded and simulated, and the difference of their lines."
    yield Captioned(figure, LOOK_AT_ORDERS, shows)


def angle_figures(comparison: Comparison, channel: ChannelComparison) -> Iterator[Captioned]:
    """Yield the synchronous averages of each shaft."""
    for shaft in channel.shafts:
        yield _average(comparison, channel, shaft)


def band_figures(comparison: Comparison, channel: ChannelComparison) -> Iterator[Captioned]:
    """Yield the bands over order, and the third octaves."""
    from gearsig.plot.compare_bands import band_levels_figure

    del comparison  # a maker of figures is given it, and this one needs none of it
    figure = band_levels_figure(channel.order_bands, channel.unit, title=f"Bands over order, {channel.name}")
    shows = f"Levels of bands over order of {channel.name}, recorded and simulated, and their agreement."
    yield Captioned(figure, LOOK_AT_BANDS, shows)
    if channel.third_octaves:
        figure = band_levels_figure(channel.third_octaves, channel.unit, title=f"Third octaves, {channel.name}")
        shows = f"Third-octave levels of {channel.name}, recorded and simulated."
        yield Captioned(figure, LOOK_AT_OCTAVES, shows)


FIGURES: dict[str, Callable[[Comparison, ChannelComparison], Iterator[Captioned]]] = {
    "Orders": order_figures,
    "Angle": angle_figures,
    "Bands": band_figures,
}
"""Makers of a channel's figures, by what they are over."""


def _average(comparison: Comparison, channel: ChannelComparison, shaft: ShaftComparison) -> Captioned:
    from gearsig.plot.compare_average import average_overlay_figure

    name = shaft.shaft or "the shaft"
    correlation = f"{shaft.correlation.value:.3f}".replace("-", "−")
    figure = average_overlay_figure(
        shaft.recorded,
        shaft.simulated,
        shaft.tooth_levels,
        n_teeth=shaft.n_teeth,
        title=f"Synchronous averages of {name}, {channel.name}: correlation {correlation}",
    )
    look = f"One mean revolution of {name}, aligned; below it a piece of it enlarged.{_teeth_text(comparison, shaft)}"
    shows = f"Synchronous averages of {name}, recorded and simulated, over one revolution."
    return Captioned(figure, look, shows)


def _teeth_text(comparison: Comparison, shaft: ShaftComparison) -> str:
    """Say what the panel of teeth shows, and when it shows nothing."""
    if not shaft.tooth_levels:
        return ""
    certain = next(one.tooth_is_certain for one in comparison.alignments if one.shaft == shaft.shaft)
    unknown = " Which tooth of one is which of the other is not known here." if certain is False else ""
    return f" {LOOK_AT_TEETH}{unknown}"


def mesh_cursors(comparison: Comparison) -> tuple[Cursor, ...]:
    """Return the mesh harmonics; numbered alone where there is one pair."""
    one = len(comparison.mesh_orders) == 1
    return tuple(
        Cursor(k * mesh, "mesh", f"{k}× mesh" if one else f"{k}× mesh {i}", k)
        for i, mesh in enumerate(comparison.mesh_orders, 1)
        for k in range(1, MOST_CURSORS + 1)
    )


def shown_orders(comparison: Comparison) -> float:
    """Return the order up to which spectra are drawn."""
    meshes = [mesh for mesh in comparison.mesh_orders if mesh <= comparison.highest_order]
    return min(comparison.highest_order, MESH_HARMONICS_SHOWN * max(meshes) if meshes else WITHOUT_MESH)
