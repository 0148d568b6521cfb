"""One recording's page: a self-contained HTML file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np

from gearsig import plot
from gearsig.angle import ShaftAngle
from gearsig.cache import write_text
from gearsig.diagnosis import CHANGED, Analysis, ChannelAnalysis, Finding, Kind, Where, changes, with_known_angle
from gearsig.errors import RefusalError
from gearsig.formatting import readable, unit_text
from gearsig.motion import StartStop
from gearsig.orders import OrderMap, SynchronousAverage
from gearsig.plot import FAULT, QUIET, CaptionedFigure, ChartLine, Cursor, LinePanel, Picture, embed
from gearsig.report._files import compiled, render, write_pdf
from gearsig.report._methods import fitting_methods, method_pictures
from gearsig.report._sections import (
    change_rows,
    css_class,
    finding_cards,
    headline_of,
    indicator_tables,
    provenance_rows,
    reference_text,
    speed_rows,
    truth_rows,
)
from gearsig.rig import si_factor
from gearsig.severity import CrackEstimate
from gearsig.spectra import LARGEST_SLIP, Spectrum

CLAIMED = (Kind.FAULT, Kind.SUSPICION, Kind.DATA_PROBLEM)
"""Kinds of findings that are shown first; the others are folded."""


def speed_is_constant(analysis: Analysis) -> bool:
    """Whether the speed is known and so constant that its lines are sharp over frequency."""
    angle = analysis.shaft_angle
    return isinstance(angle, ShaftAngle) and angle.mean_speed_rpm != 0 and angle.is_steady()


def line_cursors(analysis: Analysis, spectrum: Spectrum | OrderMap, *, n_sidebands: int = 2) -> tuple[Cursor, ...]:
    """Return the lines that the rig implies on a spectrum's axis; without a rig, the shaft's first three."""
    if not isinstance(analysis.shaft_angle, ShaftAngle) or spectrum.axis == "quefrency":
        return ()
    return plot.rig_cursors(analysis.rig, analysis.shaft_angle, spectrum, n_sidebands=n_sidebands)


def bearing_cursors(analysis: Analysis, spectrum: Spectrum) -> tuple[Cursor, ...]:
    """Return shaft lines, and three harmonics of each bearing line and of each unexplained modulation."""
    cursors = list(line_cursors(analysis, spectrum, n_sidebands=0))
    for finding in analysis.findings:
        position = _position(analysis, spectrum, finding.where) if is_of_envelope(finding.where) else None
        if position is not None and not finding.where.bearing:
            cursors.append(Cursor(position, "bearing", "impacts", 1))
    return plot.modulation_cursors(cursors)


def is_of_envelope(where: Where) -> bool:
    """Whether a place is a modulation of a band's envelope: by a bearing, or by impacts of unknown origin."""
    return bool(where.bearing) or (where.band_hz is not None and (where.order or where.frequency_hz) is not None)


def highest_order_of_interest(analysis: Analysis, spectrum: Spectrum | OrderMap) -> float:
    """Return the upper limit for a spectrum: just past the third harmonic of the fastest mesh.

    Without a known mesh, it is 50 for an order spectrum and the end of a spectrum over frequency.
    """
    return plot.upper_axis_limit(spectrum, line_cursors(analysis, spectrum))


def mesh_windows(analysis: Analysis, spectrum: Spectrum) -> list[tuple[str, float, float]]:
    """Return (pair, low, high) around the mesh of each pair, wide enough for four sidebands of its faster shaft."""
    if analysis.rig is None or _per_order(analysis, spectrum) is None:
        return []
    result = []
    for pair in analysis.rig.pairs[:3]:
        mesh = analysis.rig.mesh_order(pair, spectrum.shaft)
        ratios = [analysis.rig.ratio(shaft, to=spectrum.shaft) for shaft in (pair.driver, pair.driven)]
        known = [ratio for ratio in ratios if ratio is not None]
        if mesh is None or not known or mesh + max(known) > float(spectrum.positions[-1]):
            continue
        half = 4.5 * max(known)
        result.append((pair.name, max(0.0, mesh - half), min(float(spectrum.positions[-1]), mesh + half)))
    return result


def marked_positions(
    analysis: Analysis, spectrum: Spectrum, channel: str, *, of_bearings: bool = False
) -> tuple[float, ...]:
    """Return the positions of a channel's faults and suspicions on a spectrum's axis, faults first.

    Impacts, by bearings or otherwise, are in the envelope spectrum, all other findings in the spectrum itself. A change
    at a part's kinematic order is marked at the order measured by a finding, if there is one.
    """
    positions: list[float] = []
    for finding in sorted(analysis.findings, key=_faults_first):
        if not finding.is_claim or is_of_envelope(finding.where) != of_bearings:
            continue
        if finding.where.channels and channel not in finding.where.channels:
            continue
        if is_of_sidebands(finding.where):
            positions += [at for at in sidebands_of(analysis, spectrum, finding.where) if at not in positions]
            continue
        position = _position(analysis, spectrum, finding.where)
        if position is not None and all(abs(position / known - 1.0) > LARGEST_SLIP for known in positions):
            positions.append(position)
    return tuple(positions)


def is_of_sidebands(where: Where) -> bool:
    """Whether the order of a place is a sideband spacing around a mesh, that is the order of a gear's shaft."""
    return "/" in where.gear and where.order is not None


def sidebands_of(analysis: Analysis, spectrum: Spectrum, where: Where) -> tuple[float, ...]:
    """Return the first sidebands at the mesh harmonic with the largest ones; none if the mesh is out of range."""
    distance, scale = _position(analysis, spectrum, where), _per_order(analysis, spectrum)
    pair = (
        next((p for p in analysis.rig.pairs if p.name == where.gear.rpartition("/")[0]), None) if analysis.rig else None
    )
    if distance is None or scale is None or pair is None or analysis.rig is None:
        return ()
    mesh = analysis.rig.mesh_order(pair, spectrum.shaft or _reference(analysis))
    if not mesh:
        return ()
    n = int((min(highest_order_of_interest(analysis, spectrum), spectrum.positions[-1]) - distance) / (mesh * scale))
    sides = [(k * mesh * scale - distance, k * mesh * scale + distance) for k in range(1, n + 1)]
    return max(sides, key=lambda both: sum(float(spectrum.values[spectrum.index_of(at)]) for at in both), default=())


def _faults_first(finding: Finding) -> tuple[bool, bool]:
    """Sort key that puts changes after the findings that explain them."""
    return finding.kind is not Kind.FAULT, finding.code == CHANGED


def _position(analysis: Analysis, spectrum: Spectrum, where: Where) -> float | None:
    if spectrum.axis == "frequency" and where.frequency_hz is not None:
        return where.frequency_hz
    scale = _per_order(analysis, spectrum)
    if where.order is None or scale is None or (spectrum.axis == "frequency" and not speed_is_constant(analysis)):
        return None
    base = spectrum.shaft or _reference(analysis)
    if where.order_shaft in ("", base):
        return where.order * scale
    if analysis.rig is None or not {where.order_shaft, base} <= set(analysis.rig.shaft_names):
        return None
    ratio = analysis.rig.ratio(where.order_shaft, to=base)
    return None if ratio is None else where.order * ratio * scale


def _per_order(analysis: Analysis, spectrum: Spectrum | OrderMap) -> float | None:
    """Return units of the spectrum's axis per order of the reference shaft; None if orders have no lines there."""
    angle = analysis.shaft_angle
    if not isinstance(angle, ShaftAngle) or spectrum.axis == "quefrency":
        return None
    return angle.mean_speed_rpm / 60 if spectrum.axis == "frequency" else 1.0


def _reference(analysis: Analysis) -> str:
    return analysis.shaft_angle.shaft if isinstance(analysis.shaft_angle, ShaftAngle) else ""


@dataclass(frozen=True)
class VerdictPicture:
    """Content of the picture beside the verdict.

    Parameters
    ----------
    about : str
        "tooth": the mean revolution of a gear; "bearing": the envelope spectrum with the impacts of a bearing, known to
        the rig or not; "resonance": levels over speed; "motion": starts and stops; "lines": the order spectrum, or the
        spectrum if the speed is not known.
    channel : ChannelAnalysis
    shaft : str
        Of a tooth.
    finding : Finding or None
        The finding shown.
    """

    about: Literal["tooth", "bearing", "resonance", "motion", "lines"]
    channel: ChannelAnalysis
    shaft: str = ""
    finding: Finding | None = None

    @property
    def average(self) -> SynchronousAverage:
        """For a tooth: the mean revolution in which a single tooth stands out most."""
        told = ("change", "residual", "difference", "average")
        kinds = [kind for kind in told if (self.shaft, kind) in self.channel.averages]
        return self.channel.averages[self.shaft, kinds[0]]


def verdict_picture(analysis: Analysis) -> VerdictPicture | None:
    """Return the picture that best shows the most important finding; None if no channel could be analysed."""
    channels = {channel.channel: channel for channel in analysis.channels}
    if not channels:
        return None
    if analysis.motion is not None:
        return VerdictPicture("motion", next(iter(channels.values())))
    claims = [f for f in analysis.findings if f.is_claim or f.code == "resonance"]
    for finding in sorted(claims, key=_faults_first):
        where = finding.where
        channel = next((channels[name] for name in where.channels if name in channels), next(iter(channels.values())))
        shaft = where.gear.rpartition("/")[2] or where.shaft
        if (where.tooth or where.angle_deg is not None) and any(of == shaft for of, _ in channel.averages):
            return VerdictPicture("tooth", _changed_most(analysis.channels, shaft) or channel, shaft, finding)
        if (about := _shown_by(finding, channel)) is not None:
            return VerdictPicture(about, channel, "", finding)
    # the finding of the text beside it
    named = [name for f in analysis.findings if f.kind is not Kind.INFORMATION for name in f.where.channels]
    return VerdictPicture("lines", channels[next((name for name in named if name in channels), next(iter(channels)))])


def _changed_most(channels: Sequence[ChannelAnalysis], shaft: str) -> ChannelAnalysis | None:
    """Return the channel whose average of a shaft changed most since the reference; None without a comparison."""
    kept = [channel for channel in channels if (shaft, "change") in channel.averages]

    def share(channel: ChannelAnalysis) -> float:
        change, average = (float(np.std(channel.averages[shaft, kind].values)) for kind in ("change", "average"))
        return change / average if average else 0.0

    return max(kept, key=share, default=None)


def _shown_by(finding: Finding, channel: ChannelAnalysis) -> Literal["bearing", "resonance", "lines"] | None:
    """Return which of a channel's spectra and levels shows a finding; None if none does."""
    where = finding.where
    if is_of_envelope(where) and channel.envelope_spectrum is not None:
        return "bearing"
    if finding.code == "resonance" and channel.order_levels:
        return "resonance"
    return "lines" if (where.order or where.frequency_hz) is not None else None


def crack_picture(analysis: Analysis) -> Picture | None:
    """Return the picture of a detected crack; None if there is none, or no channel is an acceleration."""
    crack = analysis.crack
    if not isinstance(crack, CrackEstimate) or analysis.rig is None:
        return None
    teeth, kind = analysis.rig.teeth_of(crack.gear), (crack.shaft, "average")
    seen = [c for c in analysis.channels if kind in c.averages and si_factor("acceleration", c.averages[kind].unit)]
    channel = _changed_most(seen, crack.shaft) or next(iter(seen), None)
    if teeth is None or channel is None:
        return None
    name, average, change = channel.channel, channel.averages[kind], channel.averages.get((crack.shaft, "change"))
    factor = float(si_factor("acceleration", average.unit) or 1.0)
    # A tooth enters half a pitch before its own middle; the impact is in the middle of the figure.
    entry = (crack.angle_deg / 360.0 - 0.5 / teeth) % 1.0
    turned = round((entry - 0.5) * len(average.values))
    angle = (np.arange(len(average.values)) + turned) * 360.0 / len(average.values)
    now = np.roll(factor * average.values, -turned)
    lines = [ChartLine(angle, now, "now")]
    if change is not None:
        # The change has no mesh lines, so the reference's teeth are shown with the present mesh.
        since = np.roll(factor * change.values, -turned)
        lines = [ChartLine(angle, now - since, "reference", QUIET), *lines, ChartLine(angle, since, "change", FAULT)]
    reach = min(0.5, 8.0 / teeth)  # of a revolution: the impact and a few healthy teeth on each side
    reference = " beside the reference" if change is not None else ""
    caption = (
        "A crack changes only the few mesh cycles after its tooth enters; a change all around means a different load, "
        "speed or sensor."
        if change is not None
        else "A crack makes the few mesh cycles after its tooth enters deviate from the pattern of the others."
    )
    panel = LinePanel(
        lines,
        f"angle of {crack.shaft} (deg)",
        f"{name} (m/s²)",
        cursors=[Cursor(entry * 360.0, "finding", "the tooth enters", 0)],
        x_limits=((entry - reach) * 360.0, (entry + reach) * 360.0),
    )
    return Picture.of_svg(
        plot.svg_panel(panel),
        caption,
        f"Average of {name} over {crack.shaft}{reference}; marked: {crack.text}",
        f"Average of {name} over {crack.shaft}{reference}",
    )


def start_stop_figures(examined: StartStop) -> Iterator[CaptionedFigure]:
    """Draw the figures for which the record has results."""
    from gearsig.motion import FROM_TORQUE, HUNT_CROSSLEY, PIECEWISE, estimate_forces

    motion, impacts = examined.motion, examined.impacts
    yield CaptionedFigure(
        plot.motion_profile_figure(examined, title="Speed, torque and compression in their phases"),
        "Shaded: run-up, running, run-down and, in grey, rest. "
        "Look at when the compression changes sides: between the dashed lines the flanks do not touch, beyond them "
        "they carry load. A run-down that gets shorter indicates friction.",
        f"Driver's speed, torque and compression over {motion.time_s[-1]:.4g} s, phases shaded.",
    )
    yield CaptionedFigure(
        plot.start_stop_figure(examined, title="Speed with the impacts"),
        "The walls of the phase plane are a backlash apart. Torque over twist at the driver: the flat middle is the "
        "backlash, the slopes are the teeth's stiffness, the area is the energy lost.",
        "Speed with impacts, phase plane of the teeth, torque over twist.",
    )
    if impacts:
        yield CaptionedFigure(
            plot.impacts_figure(impacts, motion.path.teeth[0], restitution=motion.contact.restitution),
            "Look for teeth that meet each time the machine starts or stops: they wear first. Energies are on a "
            "logarithmic scale; a restitution is missing if the flanks stayed in contact.",
            f"{len(impacts)} impacts: energy over time and tooth, restitution over speed.",
        )
    if motion.torque_nm is None:
        return
    try:
        estimate = estimate_forces(motion)
    except RefusalError:  # no sample carries a load
        return
    shares = [100.0 * estimate.error(model, FROM_TORQUE).relative_rms for model in (PIECEWISE, HUNT_CROSSLEY)]
    yield CaptionedFigure(
        plot.force_figure(estimate, title="Force from the motion, beside the torque's"),
        f"The piecewise model, with both flanks and one or two pairs, differs by {shares[0]:.3g} % rms from torque "
        f"over base radius; Hunt–Crossley, one pair on one flank, by {shares[1]:.3g} %. If the former is large, the "
        "rig's [contact] table does not fit, or the encoders are too coarse (gearsig force --noise).",
        "Force by two models and torque over base radius, and their errors; beside them the hardest backward impact.",
    )


@dataclass(frozen=True)
class PictureGroup:
    """A group of pictures.

    Parameters
    ----------
    title : str
    wide, small : tuple of Picture
        At full width, or side by side.
    is_folded : bool
        Whether the page folds them, as channels that no finding names look like the others.
    """

    title: str
    wide: tuple[Picture, ...]
    small: tuple[Picture, ...] = ()
    is_folded: bool = False


@dataclass(frozen=True)
class Gallery:
    """All pictures of a page, and a note on channels left out."""

    groups: tuple[PictureGroup, ...]
    left_out: str = ""


N_DETAILED, N_CHANNELS = 2, 8
"""Maximum number of channels with all figures, and with any figure: a page should take a minute to read."""


def gallery(analysis: Analysis, methods: Sequence[str] | None = None) -> Gallery:
    """Draw the pictures of a page: the recording, then each channel, those with findings first and in most detail.

    Parameters
    ----------
    analysis : Analysis
    methods : sequence of str or None
        Further methods, as `named_method` reads them; None: those that suit the recording.
    """
    groups = []
    if analysis.motion is not None:
        drawn = (embed(f.figure, f.caption, f.alternative) for f in start_stop_figures(analysis.motion))
        groups.append(PictureGroup("Starts and stops", tuple(drawn)))
    if (crack := crack_picture(analysis)) is not None:
        groups.append(PictureGroup("The damaged tooth", (crack,)))
    claims = [f for f in analysis.findings if f.is_claim]
    channels = {channel.channel: channel for channel in analysis.channels}
    named = dict.fromkeys(name for f in claims for name in f.where.channels if name in channels)
    detailed = list(named)[:N_DETAILED] or list(channels)[:1]  # the first channel if no finding names any
    ordered = sorted(channels, key=lambda channel: channel not in detailed)
    groups += [_channel_group(analysis, channels[name], detailed=name in detailed) for name in ordered[:N_CHANNELS]]
    further, reasons = _further_methods(analysis, claims, methods)
    groups.append(PictureGroup("Further methods", further))
    groups.append(PictureGroup("Recording", tuple(_recording_pictures(analysis))))
    left_out, others = ordered[N_CHANNELS:], ordered[len(detailed) : N_CHANNELS]
    notes = []
    if others:
        notes.append(f"{', '.join(others)}: spectrum only; {', '.join(detailed)} in detail.")
    if left_out:
        notes.append(f"There are no pictures of {', '.join(left_out)}; their numbers are in the table.")
    notes += [f"{reason}." for reason in reasons]
    return Gallery(tuple(group for group in groups if group.wide or group.small), " ".join(notes))


def _further_methods(
    analysis: Analysis, claims: Sequence[Finding], methods: Sequence[str] | None
) -> tuple[tuple[Picture, ...], tuple[str, ...]]:
    """Return the pictures of further methods for the channel named by a tooth's or race's finding, and refusals."""
    teeth = [finding for finding in claims if finding.where.tooth is not None or finding.where.angle_deg is not None]
    bearings = [finding for finding in claims if is_of_envelope(finding.where)]
    channel = next((name for finding in (*teeth, *bearings) for name in finding.where.channels), "")
    angle = analysis.shaft_angle if isinstance(analysis.shaft_angle, ShaftAngle) else None
    suspects = {"suspects_crack": bool(teeth), "suspects_bearing": bool(bearings)}
    chosen = fitting_methods(analysis.recording, angle, **suspects) if methods is None else methods
    recording = analysis.recording if analysis.rig is None else analysis.recording.with_rig(analysis.rig)
    pictures, reasons = method_pictures(chosen, with_known_angle(recording, analysis.shaft_angle), channel)
    if methods is None:  # not requested, so do not report refusals
        reasons = ()
    return pictures, reasons


def _recording_pictures(analysis: Analysis) -> Iterator[Picture]:
    recording = analysis.recording
    claimed = {name for f in analysis.findings if f.is_claim for name in f.where.channels}
    names = tuple(sorted(recording.channel_names, key=lambda name: name not in claimed))[:4]
    more = f" {len(names)} of {len(recording.channels)} channels." if len(names) < len(recording.channels) else ""
    time = np.arange(recording.n_samples) / recording.sampling_rate_hz
    for name in names:
        channel = recording.channels[recording.index(name)]
        panel = LinePanel(
            [ChartLine(time, recording.values(name))],
            "time (s)",
            plot.with_unit(name, channel.unit),
            x_limits=(0.0, max(recording.duration_s, 1.0 / recording.sampling_rate_hz)),
        )
        last = name == names[-1]
        caption = f"Steps and clipped peaks are faults of the recording; spikes may be impacts.{more}" if last else ""
        yield Picture.of_svg(
            plot.svg_panel(panel, height=100),
            caption,
            f"Signal of {name} over {recording.duration_s:.4g} s.",
            f"Waveform of {name}",
        )
    angle = analysis.shaft_angle
    if isinstance(angle, ShaftAngle):
        low, high = angle.speed_range_rpm
        svg = plot.svg_panel(plot.speed_panel(angle), height=70)
        caption = "Check whether the speed was constant: if it changes, lines are sharp over orders only."
        yield Picture.of_svg(svg, caption, f"Speed over time, {low:.6g} to {high:.6g} rpm.", "Speed")


def _channel_group(analysis: Analysis, channel: ChannelAnalysis, *, detailed: bool) -> PictureGroup:
    wide, small = [_spectrum(analysis, channel)], []
    if detailed:
        wide += _detailed_pictures(analysis, channel)
        shafts = dict.fromkeys(shaft for shaft, _ in channel.averages)
        small = [ring_picture(analysis, VerdictPicture("tooth", channel, shaft)) for shaft in shafts]
    return PictureGroup(f"Channel {channel.channel}", tuple(wide), tuple(small), is_folded=not detailed)


def _detailed_pictures(analysis: Analysis, channel: ChannelAnalysis) -> Iterator[Picture]:
    """Yield close views of each mesh, the envelope, levels over speed, the map, and the spectrum over frequency."""
    if channel.order_spectrum is not None:
        yield from _meshes(analysis, channel, channel.order_spectrum)
    if channel.envelope_spectrum is not None:
        yield envelope_picture(analysis, channel, channel.envelope_spectrum)
    if channel.order_levels:
        yield _order_levels(analysis, channel)
    if channel.order_map is not None:
        yield _map(analysis, channel, channel.order_map)
    if channel.order_spectrum is not None:  # otherwise it is already shown
        yield _frequency_picture(analysis, channel)


def spectrum_svg(
    spectrum: Spectrum,
    cursors: Sequence[Cursor],
    limits: tuple[float, float],
    marked: Sequence[float] = (),
    *,
    linear: bool = False,
    height: int = 170,
) -> str:
    """Return a spectrum as SVG; an offset or drift near zero does not compress the rest of the axis."""
    start = 3 if limits[0] <= spectrum.positions[0] and len(spectrum.values) > 9 else 0
    values = spectrum.values[start:]
    points = [(p, spectrum.largest_near(p, 2.0 * spectrum.resolution)[1]) for p in marked]
    panel = LinePanel(
        [ChartLine(spectrum.positions[start:], values if linear else plot.above_zero(values), peaks=True)],
        spectrum.axis_label,
        plot.with_unit("" if spectrum.scaling == "dimensionless" else spectrum.scaling, spectrum.unit),
        logarithmic=not linear and bool((values > 0).any()),
        cursors=cursors,
        x_limits=limits,
    )
    return plot.svg_panel(panel, marked=points, height=height)


def _spectrum(analysis: Analysis, channel: ChannelAnalysis) -> Picture:
    """Return the order spectrum if the speed is known, else the spectrum over frequency."""
    spectrum = channel.order_spectrum
    if spectrum is None:
        return _frequency_picture(analysis, channel)
    highest = highest_order_of_interest(analysis, spectrum)
    cursors = line_cursors(analysis, spectrum, n_sidebands=0)
    marked = marked_positions(analysis, spectrum, channel.channel)
    look = "Look which orders stand out: lines at a fixed order turn with the shaft."
    if any(cursor.kind == "mesh" for cursor in cursors):
        look = "Check whether mesh harmonics have sidebands, and whether any tall line is away from all marks."
    return Picture.of_svg(
        spectrum_svg(spectrum, cursors, (0.0, highest), marked),
        f"{look}{circle_legend(marked)}",
        f"Order spectrum of {channel.channel} up to order {highest:.4g}, with the orders that the rig implies.",
        f"Order spectrum of {channel.channel}",
    )


def _meshes(analysis: Analysis, channel: ChannelAnalysis, spectrum: Spectrum) -> Iterator[Picture]:
    for pair, low, high in mesh_windows(analysis, spectrum):
        cursors = line_cursors(analysis, spectrum, n_sidebands=4)
        marked = marked_positions(analysis, spectrum, channel.channel)
        yield Picture.of_svg(
            spectrum_svg(spectrum, cursors, (low, high), marked, height=130),
            "Look at the spacing of the sidebands: it identifies the shaft that modulates the mesh, hence the gear."
            f"{circle_legend([order for order in marked if low <= order <= high])}",
            f"Order spectrum of {channel.channel} from order {low:.4g} to {high:.4g}, around the mesh of {pair}.",
            f"Order spectrum of {channel.channel} around the mesh of {pair}",
        )


def _frequency_picture(analysis: Analysis, channel: ChannelAnalysis) -> Picture:
    cursors: tuple[Cursor, ...] = ()
    smeared = " The speed changes, so lines that follow it are smeared."
    if speed_is_constant(analysis):
        smeared = ""
        cursors = tuple(c for c in line_cursors(analysis, channel.spectrum) if c.kind == "mesh")
    marked = marked_positions(analysis, channel.spectrum, channel.channel)
    limits = (0.0, float(channel.spectrum.positions[-1]))
    return Picture.of_svg(
        spectrum_svg(channel.spectrum, cursors, limits, marked, height=120),
        f"Look for broad humps: resonances of the structure, where impacts ring.{smeared}{circle_legend(marked)}",
        f"Amplitude spectrum of {channel.channel} over frequency.",
        f"Spectrum of {channel.channel}",
    )


def envelope_picture(analysis: Analysis, channel: ChannelAnalysis, spectrum: Spectrum) -> Picture:
    """Return the envelope spectrum with shaft and bearing lines."""
    cursors = bearing_cursors(analysis, spectrum)
    bearings = [cursor.position for cursor in cursors if cursor.kind == "bearing"]
    end = float(spectrum.positions[-1])
    reaches = bearings and spectrum.resolution < max(bearings)
    limits = (0.0, min(end, 1.08 * max(bearings)) if reaches else end)
    band = channel.envelope_band_hz
    where = f" ({band[0]:.0f} to {band[1]:.0f} Hz)" if band is not None else ""
    marked = marked_positions(analysis, spectrum, channel.channel, of_bearings=True)
    return Picture.of_svg(
        spectrum_svg(spectrum, cursors, limits, marked, linear=True, height=130),
        "Equally spaced lines at a shaft's order mean one impact per turn; at a bearing's, a damaged race."
        f"{circle_legend(marked)}",
        f"Envelope spectrum of {channel.channel}{where} with shaft and bearing lines.",
        f"Envelope spectrum of {channel.channel}{where}",
    )


def circle_legend(marked: Sequence[float]) -> str:
    """Explain circles, if there are any."""
    return " Circled: positions named by findings." if len(marked) else ""


def level_panel(analysis: Analysis, channel: ChannelAnalysis) -> tuple[LinePanel, list[tuple[float, float]]]:
    """Return levels of orders over speed, and where they cross a named resonance; requires order levels."""
    levels = channel.order_levels
    low, high = float(levels[0].speed_rpm[0]), float(levels[0].speed_rpm[-1])
    colours = plot.series_colours(len(levels))
    lines = [ChartLine(x.speed_rpm, x.amplitude, x.name, colour) for x, colour in zip(levels, colours, strict=True)]
    unit = plot.with_unit("amplitude", levels[0].unit)
    # anything three and a half decades below the maximum is noise
    top = max(float(x.amplitude.max()) for x in levels) or 1.0
    floor = max(min(float(x.amplitude.min()) for x in levels), top * 10.0**-3.5)
    panel = LinePanel(lines, "speed (rpm)", unit, (floor / 1.3, 1.3 * top), logarithmic=True, x_limits=(low, high))
    named = [f.where for f in analysis.findings if f.code == "resonance" and channel.channel in f.where.channels]
    at = [(60.0 * where.frequency_hz / x.order, x) for where in named if where.frequency_hz for x in levels]
    return panel, [(rpm, float(np.interp(rpm, x.speed_rpm, x.amplitude))) for rpm, x in at if low <= rpm <= high]


def _order_levels(analysis: Analysis, channel: ChannelAnalysis) -> Picture:
    levels, largest = channel.order_levels, []
    for level in levels:
        amplitude, rpm, hertz = level.largest
        unit = f" {unit_text(level.unit)}" if level.unit else ""
        largest.append(f"{level.name} {readable(amplitude, 3)}{unit} at {rpm:.0f} rpm ({hertz:.4g} Hz)")
    panel, marked = level_panel(analysis, channel)
    return Picture.of_svg(
        plot.svg_panel(panel, marked=marked),
        "At a peak, that order excites something; orders that peak at one frequency show a resonance. "
        f"{'Circled: where an order crosses a resonance that a finding names. ' if marked else ''}"
        f"Largest: {'; '.join(largest)}.",
        f"Amplitudes of {len(levels)} orders of {channel.channel} over speed.",
        f"Orders of {channel.channel} over speed",
    )


def _map(analysis: Analysis, channel: ChannelAnalysis, order_map: OrderMap) -> Picture:
    highest = highest_order_of_interest(analysis, order_map) if order_map.axis == "order" else np.inf
    kept = order_map.positions <= highest
    panel = plot.LevelPanel(
        plot.decibels(order_map.values[:, kept], order_map.scaling, order_map.unit),
        order_map.positions[kept],
        order_map.time_s,
        order_map.axis_label,
        "time (s)",
        plot.decibel_text(order_map.unit),
        cursors=[c for c in line_cursors(analysis, order_map, n_sidebands=0) if c.position <= highest],
    )
    return Picture.of_svg(
        plot.svg_panel(panel),
        "Vertical lines turn with the shaft; curved bands are resonances of fixed frequency.",
        f"Levels of {channel.channel} over {order_map.axis} and time.",
        f"{order_map.axis.capitalize()} map of {channel.channel}",
    )


def zero_text(analysis: Analysis, shaft: str) -> str:
    """Say where angle 0 of a shaft's average is."""
    if analysis.has_mark(shaft):
        return "Angles run clockwise from the mark on the shaft, at the top."
    return "The shaft has no mark: 0°, at the top, is where this recording begins, and differs in others."


def ring_picture(analysis: Analysis, picture: VerdictPicture) -> Picture:
    """Return the ring of teeth of a shaft."""
    average, shaft = picture.average, picture.shaft
    teeth = analysis.teeth_on(shaft)
    marks = plot.marks_of(analysis.findings, shaft, teeth)
    seen = f"; marked: {', '.join(mark.label for mark in marks)}" if marks else ""
    look = "healthy teeth form an even ring, a damaged one stands out"
    if average.kind == "change":
        look = "what differs from the reference at the same teeth; a tooth that has changed stands out of the ring"
    elif not teeth:
        look = "deviations from the ring repeat at that angle in each revolution"
    return Picture.of_svg(
        plot.svg_ring(average, n_teeth=teeth, marks=marks, numbered=analysis.has_mark(shaft)),
        f"{shaft or 'The shaft'}: {look}. {zero_text(analysis, shaft)}",
        f"Polar picture of the {average.kind} of {average.channel} over one revolution of {shaft or 'the shaft'}"
        f"{seen}.",
    )


def picture_of_verdict(analysis: Analysis) -> Picture | None:
    """Return the picture beside the verdict; see `verdict_picture`."""
    shown = verdict_picture(analysis)
    if shown is None or shown.about == "motion":
        return None
    if shown.about == "tooth":
        return ring_picture(analysis, shown)
    spectrum = shown.channel.envelope_spectrum
    if shown.about == "bearing" and spectrum is not None:
        return envelope_picture(analysis, shown.channel, spectrum)
    return (_order_levels if shown.about == "resonance" else _spectrum)(analysis, shown.channel)


def write_page(
    analysis: Analysis,
    path: str | Path,
    *,
    command: str = "",
    index: str = "",
    methods: Sequence[str] | None = None,
    mark: str = "",
    pdf: bool = False,
) -> Path:
    """Write the report of one recording: verdict, findings, machine, figures, indicators, provenance.

    The page is one file without scripts or external resources. It appears only when it is complete.

    Parameters
    ----------
    analysis : Analysis
    path : str or Path
        Missing folders are created.
    command : str
        The command that reproduces the page.
    index : str
        Address of the index page, relative to this one; empty: no link.
    methods : sequence of str or None
        Further methods to show; None: those that suit the recording.
    mark : str
        Identifies the recording of a page in a folder, see `recording_mark`; empty: none.
    pdf : bool
        Also write it as PDF beside the page.

    Returns
    -------
    Path
        Of the page.
    """
    parts = page_parts(analysis, command=command, methods=methods)
    if pdf:
        write_pdf(Path(path).with_suffix(".pdf"), compiled("page.typ", parts))
    return write_text(Path(path), _html(analysis, parts, index=index, mark=mark))


def page_html(analysis: Analysis, *, command: str = "", index: str = "", date: datetime | None = None) -> str:
    """Return the HTML of the page that `write_page` writes, with the further methods that suit the recording."""
    return _html(analysis, page_parts(analysis, command=command, date=date), index=index)


def _html(analysis: Analysis, parts: dict[str, Any], *, index: str = "", mark: str = "") -> str:
    return render(
        "page.html.j2",
        **parts,
        recording=analysis.recording,
        tables=indicator_tables(analysis.indicators, changes(analysis)),
        truth=truth_rows(analysis.recording.truth),
        index=index,
        mark=mark,
    )


def page_parts(
    analysis: Analysis, *, command: str, date: datetime | None = None, methods: Sequence[str] | None = None
) -> dict[str, Any]:
    """Return the content of the page for HTML and PDF."""
    recording = analysis.recording
    ordered = sorted(analysis.findings, key=lambda finding: finding.kind not in CLAIMED)
    cards = list(zip(ordered, finding_cards(ordered), strict=True))
    headline, explanation = headline_of(analysis, with_remedy=True)
    return {
        "title": recording.provenance.source or "recording made in memory",
        "machine_name": analysis.rig.name if analysis.rig is not None else "",
        "headline": headline,
        "explanation": explanation,
        "verdict_picture": picture_of_verdict(analysis),
        "changes": change_rows(analysis),
        "outcome_class": css_class(analysis.outcome),
        "outcome": analysis.outcome.value,
        "findings": [card for finding, card in cards if finding.kind in CLAIMED],
        "further": [card for finding, card in cards if finding.kind not in CLAIMED],
        "machine": () if analysis.rig is None else analysis.rig.rows(),
        "warnings": [text for text in recording.warnings if text not in {f.title for f in analysis.findings}],
        "speed": speed_rows(analysis.shaft_angle),
        "gallery": gallery(analysis, methods),
        "reference": reference_text(analysis.reference),
        "provenance": provenance_rows(analysis, command, date),
    }


def page_pdf(analysis: Analysis, *, command: str = "", methods: Sequence[str] | None = None) -> bytes:
    """Return the page of one recording as PDF, with the content of `page_html` except the table of indicators.

    Parameters
    ----------
    analysis : Analysis
    command : str
        The command that reproduces the page.
    methods : sequence of str or None
        Further methods to show; None: those that suit the recording.

    Raises
    ------
    InputError
        If typst is not installed.
    """
    return compiled("page.typ", page_parts(analysis, command=command, methods=methods))
