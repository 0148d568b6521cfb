"""The comparison page: choice of a recording and a simulation, their comparison, and its figures."""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass

import numpy as np
import streamlit as st

from app.dashboard import address, state
from app.dashboard.cached import recorded, stated_options
from app.dashboard.laboratory.setup import MODEL, Setup, shown_name
from app.dashboard.state import AnalysisRequest, ChosenFile, Content
from app.dashboard.widgets.charts import (
    download,
    offer_page,
    padded_limits,
    show_differences,
    show_lines,
    zoomed_range,
)
from app.dashboard.widgets.chooser import (
    FILE,
    SAMPLE,
    choose_file,
    choose_recording,
    choose_sample,
    simulated_file,
)
from app.dashboard.widgets.spectrum import show_revolutions, show_spectrum
from app.dashboard.widgets.texts import (
    as_typed,
    capitalised,
    show_checks,
    show_table,
    show_warnings,
    show_wrapping_table,
)
from app.dashboard.work import kept
from gearsig.comparison import (
    ALIGN,
    ChannelComparison,
    Comparison,
    compare,
    for_simulation,
    missing_line_text,
)
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import axis_label, unit_text
from gearsig.gap import OperatingCondition
from gearsig.plot import ChartLine, LinePanel, with_unit
from gearsig.prepared import refined_angle
from gearsig.recording import Recording
from gearsig.report import (
    alignment_texts,
    channel_rows,
    comparison_page,
    comparison_to_json,
    mesh_cursors,
    orders_csv,
    shown_orders,
    tooth_warning_text,
)
from gearsig.rig import Rig
from sims.cracked import CrackedPair
from sims.machine import nominal_of
from sims.presets import presets

WELCOME = """
Choose a **recording** and its rig file, and a **simulation** of the machine: a file from any simulator, or one run
here at the recording's speed. The page overlays the two by order, band and angle, and says for each difference whether
the records' own scatter explains it. For the cause of the differences, see the *Gap* page.
"""
TWIN = "Set to the rig"
"""Instead of a preset: the rig's own geometry, with the rest typical for its size."""


@dataclass(frozen=True)
class SimulationToCompare:
    """A simulation that is run for the comparison.

    Parameters
    ----------
    machine : str
        Name of a preset, or `TWIN`.
    speed_rpm, torque_nm : float or None
        Of the driver; None: the recording's speed, the rig's or the preset's torque.
    duration_s : float
    seed : int
    """

    machine: str
    speed_rpm: float | None = None
    torque_nm: float | None = None
    duration_s: float = 5.0
    seed: int = 0


Simulation = SimulationToCompare | AnalysisRequest
"""A request reads a simulation from a file."""
Pairs = tuple[tuple[str, str], ...]


def simulated_of(
    simulation: Simulation, request: AnalysisRequest, content: Content | None, recording: Recording
) -> Recording:
    """Return the simulation to compare with a recording, which `request` identifies.

    A file without its own rig takes the gears of the recording's rig.

    Raises
    ------
    GearsigError
        If the speed is not known, exceeds what the machine allows, or the rig describes too little for a twin.
    """
    if isinstance(simulation, SimulationToCompare):
        return _simulated(simulation, request, recording)
    assert content is not None  # noqa: S101 - a file has content; for the type checker
    rig = recording.rig
    return recorded(simulation, content, None if rig is None else for_simulation(rig))


@kept(3, "Simulating …", key=lambda *arguments: repr(arguments[:2]))
def _simulated(run: SimulationToCompare, request: AnalysisRequest, recording: Recording) -> Recording:
    """Simulate the recording's machine at its speed and sampling rate; `request` identifies the recording."""
    del request
    rig = recording.rig
    speed_rpm = run.speed_rpm if run.speed_rpm is not None else speed_of(recording)
    rate_hz = min(max(recording.sampling_rate_hz, 4096.0), 102400.0)
    if run.machine == TWIN:
        if rig is None:
            raise InputError("there is no rig to set the simulator to", remedy="give a rig file, or choose a preset")
        torque_nm = run.torque_nm if run.torque_nm is not None else nominal_of(rig).torque_nm
        point = OperatingCondition(speed_rpm, torque_nm)
        twin = CrackedPair().twin_of(rig)
        return twin.run(point, seed=run.seed, duration_s=run.duration_s, sampling_rate_hz=rate_hz)
    setup = Setup(
        run.machine,
        speed_rpm,
        presets(MODEL)[run.machine].torque_nm if run.torque_nm is None else run.torque_nm,
        tuple(teeth_of(rig).items()),
        duration_s=run.duration_s,
        sampling_rate_hz=rate_hz,
        seed=run.seed,
    )
    return setup.record()


@kept(4, "Comparing …", key=lambda *arguments: repr(arguments[:4]))
def compared(
    request: AnalysisRequest,
    simulation: Simulation,
    pairs: Pairs,
    align_by: str,
    recording: Recording,
    simulated: Recording,
) -> Comparison:
    """Return the comparison of two records, which `request` and `simulation` identify."""
    del request, simulation
    return compare(simulated, recording, channels=pairs, align_by=align_by)


def teeth_of(rig: Rig | None) -> dict[str, float]:
    """Return the preset parameters for the rig's tooth numbers, which must match because orders are compared."""
    if rig is None or len(rig.pairs) != 1:
        return {}
    pair = rig.pairs[0]
    known = {"teeth_driver": pair.driver_teeth, "teeth_driven": pair.driven_teeth}
    return {name: float(teeth) for name, teeth in known.items() if teeth is not None}


def speed_of(recorded: Recording) -> float:
    """Return the mean speed of the driver in the recording, in rpm.

    Raises
    ------
    InputError
        If it is not known.
    """
    rig = recorded.rig or Rig()
    try:
        angle = refined_angle(recorded, rig)
    except RefusalError as refusal:
        raise InputError(
            f"the speed of the recording is not known: {refusal.reason}", remedy=f"type a speed, or {refusal.remedy}"
        ) from None
    driver = rig.pairs[0].driver if rig.pairs else ""
    return angle.mean_speed_rpm * ((rig.ratio(driver, to=angle.shaft) or 1.0) if driver else 1.0)


def command_of(request: AnalysisRequest, simulation: Simulation, pairs: Pairs, align_by: str) -> str:
    """Return the command that gives the same comparison outside the dashboard; empty if the page simulated."""
    if isinstance(simulation, SimulationToCompare):
        return ""
    words = ["gearsig", "compare", simulation.name, request.name, *stated_options(request)]
    if simulation.rig_text.strip():
        words += ["--sim-rig", simulation.rig_name]
    words += [word for simulated, measured in pairs for word in ("--channel", f"{simulated}={measured}")]
    return shlex.join([*words, *(["--align", align_by] if align_by != "auto" else []), "-o", "comparison"])


NOW = "Simulate now"
ORIGIN, MACHINE = "simulation of compare", "machine of compare"
"""Keys of these choices."""


def choose_simulation() -> tuple[Simulation, Content | None] | None:
    """Return the simulation that the recording is compared with, None until one is chosen.

    Raises
    ------
    InputError
        If a rig file is not text.
    """
    with st.sidebar:
        st.divider()
        made = state.simulated()
        origins = (NOW, SAMPLE, FILE) if made is None else (NOW, SAMPLE, FILE, state.OF_LABORATORY)
        origin = address.ask_one(st.radio, "Simulation", origins, name="simulation", horizontal=True)
        if origin == NOW:
            return _choose_run(), None
        if origin == state.OF_LABORATORY and made is not None:
            file: ChosenFile | None = simulated_file(made)
        elif origin == SAMPLE:
            file = choose_sample("Simulated sample", "simulation sample", first="healthy", name="simulated")
        else:
            file = choose_file(
                "Simulated signals",
                "simulation file",
                rig="Its rig file (TOML), if it has one",
                about_rig="Without one, the file is read as it states, with the gears of the recording's rig.",
                name="simulation_file",
            )
        return None if file is None else (file.request(), file.content)


def choose_alignment(simulation: Simulation | None) -> str:
    """Return how averages are aligned, by default by correlation if the page simulates: its mark is arbitrary."""
    source = "made here" if isinstance(simulation, SimulationToCompare) else "of files"
    with st.sidebar:
        chosen = address.ask_one(
            st.selectbox,
            "Align by",
            ALIGN,
            first="correlation" if source == "made here" else "auto",
            name="align",
            key=state.source_key("comparison alignment", source),
            help="Marks: angle 0 is the same tooth in both. Correlation: the simulation is rotated to where the "
            "averages match best. Auto: marks for shafts that have one in both.",
        )
    return str(chosen)


def choose_pairs(simulated: Recording, recorded: Recording) -> Pairs:
    """Return the channels to compare: those with equal names, or two that the user chooses."""
    ours, measured = simulated.vibration_names(), recorded.vibration_names()
    common = [name for name in measured if name in ours]
    if common and len(measured) == len(common):
        return tuple((name, name) for name in common)
    if not ours or not measured:
        return ()  # the comparison says what is missing
    source = f"{recorded.provenance.sha256} {' '.join(ours)}"
    left, right = st.columns(2)
    chosen = address.ask_one(
        left.selectbox,
        "Channel of the recording",
        measured,
        first=common[0] if common else measured[0],
        name="recorded_channel",
        key=state.source_key("recorded channel", source),
    )
    mate = address.ask_one(
        right.selectbox,
        "Channel of the simulation",
        ours,
        first=chosen if chosen in ours else ours[0],
        name="simulated_channel",
        key=state.source_key(f"simulated channel for {chosen}", source),
    )
    return ((str(mate), str(chosen)),)


def _choose_run() -> SimulationToCompare:
    known = presets(MODEL)

    def title(name: str) -> str:
        return name if name == TWIN else f"Preset {shown_name(name)}"

    machine = address.ask_one(
        st.selectbox,
        "Machine",
        [TWIN, *known],
        format_func=title,
        name="machine",
        help="Set to the rig: its teeth, module and face width; the rest is typical for its size. A preset keeps its "
        "own geometry but takes the rig's tooth numbers.",
    )
    if machine != TWIN:
        st.caption(known[machine].title)
    ask, elsewhere = address.ask_number, "as in rig or preset"
    speed = ask(st, "Speed of the driver (rpm)", 1.0, name="speed", placeholder="as recorded")
    torque = ask(st, "Torque on the driver (N·m)", 0.0, name="torque", placeholder=elsewhere)
    looks = {"name": "length", "first": 5.0, "format_func": "{:g}".format}
    length = address.ask_one(st.segmented_control, "Length (s)", (2.0, 5.0, 10.0), **looks)
    seed = ask(st, "Seed", 0, name="seed", first=0, whole=True)
    return SimulationToCompare(str(machine), speed, torque, length, seed)


VIEWS = ("Orders", "Angle", "Bands", "Lines")
NAMES = ("recorded", "simulated")


def show_comparison(comparison: Comparison, rig: Rig | None) -> None:
    """Show verdict, common settings and findings, then one channel in figures that zoom together and in numbers."""
    headline, *more = re.split(r"(?<=[;.]) ", comparison.verdict, maxsplit=1)
    st.subheader(f"{as_typed(headline.rstrip(';.'))}.", anchor=False)
    if more:
        st.markdown(as_typed(capitalised(more[0])))
    show_alike(comparison, rig)
    if comparison.findings:
        st.markdown("\n".join(f"- {as_typed(text)}" for text in comparison.findings))
    channels = {channel.name: channel for channel in comparison.channels}
    name = next(iter(channels))
    if len(channels) > 1:
        looks = {"name": "channel", "label_visibility": "collapsed"}
        name = address.ask_one(st.segmented_control, "Channel", list(channels), **looks)
    channel = channels.get(name, comparison.channels[0])
    views = dict(zip(VIEWS, (_show_orders, _show_angle, _show_bands, _show_lines), strict=True))
    for tab, view in zip(address.tabs(VIEWS, key="comparison tab"), views.values(), strict=True):
        if tab.open:
            with tab:
                view(comparison, channel)
    with st.expander("Agreement in numbers", icon=":material/table:"):
        rows = channel_rows(channel)
        show_wrapping_table({"agreement": [name for name, _ in rows], "value": [text for _, text in rows]})
    show_warnings(comparison.notes, quiet=True)


def show_alike(comparison: Comparison, rig: Rig | None) -> None:
    """Say what both records have in common: teeth, speed, how their angles are aligned."""
    recorded, simulated = comparison.recorded, comparison.simulated
    ratio = simulated.mean_speed_rpm / recorded.mean_speed_rpm
    speeds = f"{recorded.mean_speed_rpm:.6g} rpm recorded, {simulated.mean_speed_rpm:.6g} rpm simulated"
    facts = [(abs(ratio - 1.0) < 0.01, f"Speed: {speeds}")]
    if rig is not None and rig.pairs:
        pairs = (f"{pair.driver_teeth}/{pair.driven_teeth}" for pair in rig.pairs)
        facts.insert(0, (True, f"Teeth: {', '.join(pairs)} in both"))
    aligned = zip(comparison.alignments, alignment_texts(comparison), strict=False)
    facts += [(not alignment.is_doubted, f"Aligned: {text}") for alignment, text in aligned]
    show_checks(facts)
    lengths = ", ".join(
        f"{name} {side.duration_s:.4g} s, {side.n_revolutions:.4g} revolutions"
        for name, side in (("recording", recorded), ("simulation", simulated))
    )
    st.caption(f"Compared: {lengths}.")


def _show_orders(comparison: Comparison, channel: ChannelComparison) -> None:
    """Show both order spectra, and below them the difference of each line over the same orders."""
    spectra = channel.recorded_spectrum, channel.simulated_spectrum
    shown = (0.0, shown_orders(comparison))
    source = f"comparison {channel.name}"
    shown = show_spectrum(source, spectra, mesh_cursors(comparison), "orders", names=NAMES, shown=shown)
    lines = [line for line in (*channel.lines, *channel.other_lines) if line.is_seen]
    at = np.array([line.order for line in lines])
    off = np.array([line.level.difference_db for line in lines])
    beyond = np.array([line.level.is_beyond for line in lines], dtype=bool)
    name = axis_label("order", comparison.reference_shaft)
    show_differences(at, off, beyond, name, f"lines of {source}", shown, "simulated − recorded")
    st.caption(
        "Simulated minus recorded, line by line; the floor is the records' own scatter. This figure zooms with the "
        "one above."
    )


def _show_angle(comparison: Comparison, channel: ChannelComparison) -> None:
    """Show the averages of each shaft over one revolution, and below them the level tooth by tooth."""
    for shaft in channel.shafts:
        name = shaft.shaft or "the shaft"
        st.markdown(
            as_typed(f"{name}: correlation {shaft.correlation.value:.3f} of {shaft.best_correlation:.3f} possible")
        )
        both = dict(zip(NAMES, (shaft.recorded.values, shaft.simulated.values), strict=True))
        unit = with_unit("acceleration" if channel.quantity == "acceleration" else "value", channel.unit)
        key, whole = f"average of {name} comparison {channel.name}", (0.0, 360.0)
        show_revolutions(both, name, unit, key)
        if not shaft.tooth_levels:
            continue
        middle = (np.arange(len(shaft.tooth_levels)) + 0.5) * 360.0 / len(shaft.tooth_levels)
        off = np.array([level.difference_db for level in shaft.tooth_levels])
        beyond = np.array([level.is_beyond for level in shaft.tooth_levels], dtype=bool)
        show_differences(
            middle,
            off,
            beyond,
            f"angle of {name} (deg)",
            f"teeth of {key}",
            zoomed_range(key, whole),
            "simulated − recorded",
        )
        st.caption(f"Tooth by tooth, at the middle of each.{tooth_warning_text(comparison, shaft.shaft)}")


def _show_bands(comparison: Comparison, channel: ChannelComparison) -> None:
    """Show levels of bands, noise included, over order and over frequency."""
    unit = f"level (dB re 1 {unit_text(channel.unit)}".rstrip() + ")"
    over_order = channel.order_bands, axis_label("order", comparison.reference_shaft), False
    for bands, name, log_x in (over_order, (channel.third_octaves, "frequency of third octaves (Hz)", True)):
        if not bands:
            continue
        edges = np.array([edge for band in bands for edge in (band.low, band.high)])
        sides = [np.repeat([getattr(band.level, f"{side}_db") for band in bands], 2) for side in NAMES]
        lines = [ChartLine(edges, levels, side, i) for i, (levels, side) in enumerate(zip(sides, NAMES, strict=True))]
        panel = LinePanel(lines, name, unit, padded_limits(sides), x_limits=(float(edges[0]), float(edges[-1])))
        key = f"bands over {name} comparison {channel.name}"
        show_lines(panel, key, height_px=240, legend=True, log_x=log_x)


def show_downloads(comparison: Comparison, command: str) -> None:
    """Offer the report, the data and the lines, each made on request."""
    offer_page(
        "Report (HTML)", lambda: comparison_page(comparison, command=command).encode(), "compare.html", "comparison"
    )
    with st.container(horizontal=True):
        download("JSON", lambda: comparison_to_json(comparison).encode(), "compare.json")
        download("Lines (CSV)", lambda: orders_csv(comparison).encode(), "orders.csv")
    if command:
        with st.expander("The same from the command line", icon=":material/terminal:"):
            st.code(command, language="bash", wrap_lines=True)


def _show_lines(comparison: Comparison, channel: ChannelComparison) -> None:
    del comparison
    shown = [line for line in (*channel.lines, *channel.other_lines) if line.is_seen]
    show_table(
        {
            "line": [line.label for line in shown],
            "difference (dB)": [line.level.difference_db for line in shown],
            "± (dB)": [2 * line.level.repeatability_db for line in shown],
            "note": [
                missing_line_text(line) or ("" if line.level.is_beyond else "within the scatter") for line in shown
            ],
            "recorded (dB)": [line.level.recorded_db for line in shown],
            "simulated (dB)": [line.level.simulated_db for line in shown],
            "order": [line.order for line in shown],
        },
        formats={"order": ".6g"},
        number=".1f",
        width="stretch",
    )
    reference = f", re 1 {unit_text(channel.unit)}" if channel.unit else ""
    st.caption(f"Levels are rms{reference}. ± is twice the standard error, estimated from the halves of both records.")


def show() -> None:
    """Choose, read or simulate, compare, show."""
    st.subheader("Comparison of a simulation with a recording", anchor=False)
    opened = choose_recording(with_reference=False)
    simulation = choose_simulation()
    align_by = choose_alignment(simulation[0] if simulation is not None else None)
    if opened is None or simulation is None:
        st.markdown(WELCOME)
        return
    _, chosen = opened
    what, content = simulation
    recording = recorded(chosen.request, chosen.content)
    simulated = simulated_of(what, chosen.request, content, recording)
    st.caption(as_typed(f"{simulated.provenance.source or 'simulation of this page'} beside {chosen.request.name}"))
    pairs = choose_pairs(simulated, recording)
    comparison = compared(chosen.request, what, pairs, align_by, recording, simulated)
    command = command_of(chosen.request, what, pairs, align_by)
    show_comparison(comparison, recording.rig)
    show_downloads(comparison, command)
