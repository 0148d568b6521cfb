"""Which figures a page shows, and what to look at in each."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from gearsig.angle.types import ShaftAngle
from gearsig.diagnosis.types import Analysis, ChannelAnalysis, Kind, OrderLevel
from gearsig.formatting import readable
from gearsig.orders.types import SynchronousAverage
from gearsig.plot.cursors import Cursor
from gearsig.plot.display import unit_text
from gearsig.plot.embed import Picture, embed
from gearsig.report.crack_picture import crack_picture
from gearsig.report.lines import (
    bearing_cursors,
    highest_order_of_interest,
    line_cursors,
    marked_positions,
    mesh_windows,
    speed_is_constant,
)
from gearsig.report.start_stop_figures import start_stop_figures

MOST_BYTES = 2_500_000
"""Of all pictures of a page, as text: the page stays below 3 MB."""
MOST_DETAILED = 3
MOST_TIME_PANELS = 6


@dataclass(frozen=True)
class Group:
    """Pictures that belong together.

    Parameters
    ----------
    title : str
    wide, small : tuple of Picture
        One per line, or side by side.
    is_folded : bool
        Whether the page shows them only when asked: channels that no finding names look like the others.
    """

    title: str
    wide: tuple[Picture, ...]
    small: tuple[Picture, ...] = ()
    is_folded: bool = False


@dataclass(frozen=True)
class Gallery:
    """All pictures of a page, and a remark on those left out."""

    groups: tuple[Group, ...]
    left_out: str = ""


def gallery(analysis: Analysis) -> Gallery:
    """Make the pictures of a page: the recording, then each channel, those with findings first and in most detail."""
    groups = [Group("Recording", tuple(_recording_pictures(analysis)))]
    crack = crack_picture(analysis)
    if crack is not None:
        groups.insert(0, Group("The damaged tooth", (crack,)))
    if analysis.motion is not None:
        drawn = (embed(f.figure, f.caption, f.alternative) for f in start_stop_figures(analysis.motion))
        groups.insert(0, Group("Starts and stops", tuple(drawn)))
    left_out: list[str] = []
    n_bytes = sum(_size(group) for group in groups)
    detailed = _detailed_channels(analysis)
    for channel in sorted(analysis.channels, key=lambda c: c.channel not in detailed):
        if n_bytes > MOST_BYTES:
            left_out.append(channel.channel)
            continue
        group = _channel_group(analysis, channel, detailed=channel.channel in detailed)
        n_bytes += _size(group)
        groups.append(group)
    return Gallery(tuple(group for group in groups if group.wide or group.small), _remark(left_out, detailed, analysis))


def _size(group: Group) -> int:
    return sum(len(picture.uri) for picture in (*group.wide, *group.small))


def _detailed_channels(analysis: Analysis) -> tuple[str, ...]:
    """Return the channels of faults and suspicions; the first one if there are none."""
    present = [channel.channel for channel in analysis.channels]
    named = [
        name
        for finding in analysis.findings
        if finding.kind in (Kind.FAULT, Kind.SUSPICION)
        for name in finding.where.channels
    ]
    return tuple(dict.fromkeys(name for name in named if name in present))[:MOST_DETAILED] or tuple(present[:1])


def _remark(left_out: list[str], detailed: tuple[str, ...], analysis: Analysis) -> str:
    others = [c.channel for c in analysis.channels if c.channel not in detailed]
    if left_out:
        return f"To keep the page small there are no pictures of {', '.join(left_out)}; their numbers are in the table."
    if others:
        return f"{', '.join(others)}: main pictures only; {', '.join(detailed)} in detail."
    return ""


def _recording_pictures(analysis: Analysis) -> Iterator[Picture]:
    from gearsig.plot.speed import speed_figure
    from gearsig.plot.time import time_figure

    recording = analysis.recording
    names = recording.channel_names[:MOST_TIME_PANELS]
    more = (
        f" The first {len(names)} of {len(recording.channels)} channels."
        if len(names) < len(recording.channels)
        else ""
    )
    yield embed(
        time_figure(recording, names),
        f"Look for steps, spikes, flat stretches and clipped tops: they are the recording's, not the machine's.{more}",
        f"Signals over {recording.duration_s:.4g} s: {', '.join(names)}.",
    )
    angle = analysis.shaft_angle
    if isinstance(angle, ShaftAngle):
        low, high = angle.speed_range_rpm
        yield embed(
            speed_figure(angle),
            "Look whether the speed held still: where it changes, only orders keep their lines sharp.",
            f"Speed over time, {low:.6g} to {high:.6g} rpm.",
            vector=True,
        )


def _channel_group(analysis: Analysis, channel: ChannelAnalysis, *, detailed: bool) -> Group:
    makers: list[Callable[[Analysis, ChannelAnalysis], Iterator[Picture]]] = [_order_or_frequency]
    if detailed:
        makers += [_order_levels, _whole_spectrum, _mesh_zooms, _envelope, _kurtogram, _map, _averages]
    wide = tuple(picture for maker in makers for picture in maker(analysis, channel))
    return Group(f"Channel {channel.channel}", wide, tuple(_polar(analysis, channel)), is_folded=not detailed)


def _order_or_frequency(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    """The order spectrum where the speed is known, else the spectrum over frequency."""
    from gearsig.plot.spectrum import spectrum_figure

    spectrum = channel.order_spectrum
    if spectrum is None:
        yield _frequency_picture(analysis, channel)
        return
    highest = highest_order_of_interest(analysis, spectrum)
    cursors = line_cursors(analysis, spectrum)
    yield embed(
        spectrum_figure(
            spectrum,
            cursors,
            limits=(0.0, highest),
            marked=marked_positions(analysis, spectrum, channel.channel),
            title=f"Order spectrum of {channel.channel}",
        ),
        "Look whether the mesh harmonics stand alone or carry sidebands, and whether a tall line lies off every mark."
        if any(cursor.kind == "mesh" for cursor in cursors)
        else "Look which orders stand out: what keeps its order turns with the shaft.",
        f"Order spectrum of {channel.channel} up to order {highest:.4g}, with the orders that the rig implies.",
    )


def _whole_spectrum(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    if channel.order_spectrum is not None:
        yield _frequency_picture(analysis, channel)


def _frequency_picture(analysis: Analysis, channel: ChannelAnalysis) -> Picture:
    from gearsig.plot.spectrum import spectrum_figure

    cursors: tuple[Cursor, ...] = ()
    smeared = " The speed changes, so lines that follow it are smeared here."
    if speed_is_constant(analysis):
        smeared = ""
        cursors = tuple(c for c in line_cursors(analysis, channel.spectrum) if c.kind == "mesh")
    marked = marked_positions(analysis, channel.spectrum, channel.channel)
    return embed(
        spectrum_figure(channel.spectrum, cursors, marked=marked, title=f"Spectrum of {channel.channel}"),
        f"Look for broad humps: resonances of the structure, where impacts ring.{smeared}",
        f"Amplitude spectrum of {channel.channel} over frequency.",
    )


def _mesh_zooms(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.spectrum import spectrum_figure

    spectrum = channel.order_spectrum
    if spectrum is None:
        return
    for pair, low, high in mesh_windows(analysis, spectrum):
        yield embed(
            spectrum_figure(
                spectrum,
                line_cursors(analysis, spectrum, n_sidebands=4),
                limits=(low, high),
                marked=marked_positions(analysis, spectrum, channel.channel),
                title=f"Around the mesh of {pair}, {channel.channel}",
            ),
            "Look at the spacing of the sidebands: it names the shaft that modulates the mesh, hence the gear.",
            f"Order spectrum of {channel.channel} from order {low:.4g} to {high:.4g}, around the mesh of {pair}.",
        )


def _envelope(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.spectrum import spectrum_figure

    spectrum = channel.envelope_spectrum
    if spectrum is None:
        return
    cursors = bearing_cursors(analysis, spectrum)
    bearings = [cursor.position for cursor in cursors if cursor.kind == "bearing"]
    end = float(spectrum.positions[-1])
    limits = (0.0, min(end, 1.08 * max(bearings))) if bearings and spectrum.resolution < max(bearings) else None
    band = channel.envelope_band_hz
    where = f" ({band[0]:.0f} to {band[1]:.0f} Hz)" if band is not None else ""
    yield embed(
        spectrum_figure(
            spectrum,
            cursors,
            scale="linear",
            limits=limits,
            marked=marked_positions(analysis, spectrum, channel.channel, of_bearings=True),
            title=f"Envelope spectrum of {channel.channel}{where}",
        ),
        "Equally spaced lines at a shaft's order mean one impact per turn; at a bearing's, a damaged race.",
        f"Envelope spectrum of {channel.channel}{where} with shaft and bearing lines.",
    )


def _kurtogram(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.kurtogram import kurtogram_figure

    del analysis  # a maker of pictures is given it, and this one needs none of it
    if channel.kurtogram is None or channel.kurtogram_band is None:
        return
    low, high = channel.kurtogram_band.band_hz
    yield embed(
        kurtogram_figure(channel.kurtogram, channel.kurtogram_band),
        f"How impulsive each band is. The outlined one, {low:.0f} to {high:.0f} Hz, is the most impulsive that is wide "
        "enough for the bearing's harmonics; its envelope bears the finding out.",
        f"Kurtogram of {channel.channel} with its best band.",
    )


def _order_levels(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.order_levels import order_levels_figure

    if not channel.order_levels:
        return
    found = [f.where for f in analysis.findings if f.code == "resonance" and channel.channel in f.where.channels]
    resonances = [where.frequency_hz for where in found if where.frequency_hz is not None]
    largest = "; ".join(_largest_text(level) for level in channel.order_levels)
    look = (
        "A peak is a speed at which that order excites something; orders that peak at one frequency show a resonance."
    )
    yield embed(
        order_levels_figure(
            channel.order_levels, resonances_hz=resonances, title=f"Levels over speed, {channel.channel}"
        ),
        f"{look} Largest: {largest}.",
        f"Amplitudes of {len(channel.order_levels)} orders of {channel.channel} over speed.",
        vector=True,
    )


def _largest_text(level: OrderLevel) -> str:
    amplitude, rpm, hertz = level.largest
    unit = f" {unit_text(level.unit)}" if level.unit else ""
    return f"{level.name} {readable(amplitude, 3)}{unit} at {rpm:.0f} rpm ({hertz:.4g} Hz)"


def _map(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.order_map import order_map_figure

    order_map = channel.order_map
    if order_map is None:
        return
    cursors: tuple[Cursor, ...] = ()
    highest = None
    if order_map.axis == "order":
        cursors = tuple(c for c in line_cursors(analysis, order_map) if c.kind == "mesh")
        highest = highest_order_of_interest(analysis, order_map)
    yield embed(
        order_map_figure(order_map, cursors, highest=highest),
        "Upright lines turn with the shaft; bent bands are resonances that stay at their frequency.",
        f"Levels of {channel.channel} over {order_map.axis} and time.",
    )


def _averages(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.average import average_figure
    from gearsig.plot.marks import marks_of

    for shaft in dict.fromkeys(shaft for shaft, _ in channel.averages):
        chosen = [
            channel.averages[shaft, kind] for kind in ("average", "residual") if (shaft, kind) in channel.averages
        ]
        if not chosen:
            continue
        teeth = _teeth(analysis, shaft)
        yield embed(
            average_figure(chosen, n_teeth=teeth, marks=marks_of(analysis.findings, shaft, teeth)),
            "Grey: ± 2 standard errors. Where it stays clear of zero, something comes back at that angle every turn.",
            f"Synchronous {' and '.join(a.kind for a in chosen)} of {channel.channel} over one revolution of {shaft}.",
        )


def _polar(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    from gearsig.plot.marks import marks_of
    from gearsig.plot.polar import polar_figure

    for shaft in dict.fromkeys(shaft for shaft, _ in channel.averages):
        average = _best_for_teeth(channel, shaft)
        if average is None:
            continue
        teeth = _teeth(analysis, shaft)
        marks = marks_of(analysis.findings, shaft, teeth)
        seen = f"; marked: {', '.join(mark.label for mark in marks)}" if marks else ""
        yield embed(
            polar_figure(average, n_teeth=teeth, marks=marks),
            f"{shaft}: sound teeth draw an even ring, a damaged one swings out. Grey is ± 2 standard errors."
            if teeth
            else f"{shaft}: what leaves the ring comes back at that angle every turn. Grey is ± 2 standard errors.",
            f"Polar picture of the {average.kind} of {channel.channel} over one revolution of {shaft}{seen}.",
        )


def _best_for_teeth(channel: ChannelAnalysis, shaft: str) -> SynchronousAverage | None:
    for kind in ("residual", "difference", "average"):
        if (shaft, kind) in channel.averages:
            return channel.averages[shaft, kind]
    return None


def _teeth(analysis: Analysis, shaft: str) -> int | None:
    """Return the teeth of the gear on a shaft; of the gear that a finding names, where there are several."""
    if analysis.rig is None:
        return None
    gears = {pair.name: pair.teeth(shaft) for pair in analysis.rig.pairs if shaft in (pair.driver, pair.driven)}
    for finding in analysis.findings:
        pair, _, on = finding.where.gear.rpartition("/")
        if on == shaft and gears.get(pair):
            return gears[pair]
    return next((teeth for teeth in gears.values() if teeth), None)
