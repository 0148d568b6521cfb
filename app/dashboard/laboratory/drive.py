"""A drive that starts, stops and strikes back: what it does, and what a recording of it tells."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pandas as pd
import streamlit as st

from app.dashboard import state
from app.dashboard.laboratory.run import ANALYSIS_ENDING, ENDINGS, chosen_of_files, files_of, zip_of
from app.dashboard.laboratory.setup import DRIVE_MODEL, choose_number, effect_text, show_typed_toggle, shown_unit
from app.dashboard.laboratory.views import show_metrics
from app.dashboard.theme import as_typed, capitalised
from app.dashboard.widgets.charts import show_picture
from app.dashboard.widgets.messages import show_error
from gearsig.checks import FloatArray
from gearsig.errors import GearsigError, RefusalError
from gearsig.gap.start_stop import cut_cycles
from gearsig.motion import (
    ForceEstimate,
    PairMotion,
    StartStop,
    estimate_forces,
    examine_start_stop,
    measure_motion,
)
from gearsig.plot import force_figure, impacts_figure, start_stop_figure, start_stop_pair_figure
from gearsig.recording import Recording
from gearsig.rig import DAMPING_LAWS
from sims import simulate
from sims.effects import EffectSetting, effect
from sims.forging import MODES, PARAMETERS
from sims.presets import Preset
from sims.simulator import ParameterValue, parameter


@dataclass(frozen=True)
class DriveSetup:
    """Everything that decides a run: equal setups give equal recordings.

    Parameters
    ----------
    preset : str
    speed_rpm, torque_nm : float
        Of the pinion: what the flow allows, and the motor's.
    parameters : tuple of (name, value)
        What differs from the preset, in the healthy drive as well.
    effects : tuple of EffectSetting
    duration_s, sampling_rate_hz : float
    """

    preset: str
    speed_rpm: float
    torque_nm: float
    parameters: tuple[tuple[str, ParameterValue], ...] = ()
    effects: tuple[EffectSetting, ...] = ()
    duration_s: float = 6.0
    sampling_rate_hz: float = 1000.0

    @property
    def healthy(self) -> DriveSetup:
        """The same drive without effects."""
        return replace(self, effects=())

    @property
    def file_stem(self) -> str:
        """Name of its files, without a dot."""
        return "_".join([self.preset, *(setting.name for setting in self.effects)])

    def record(self) -> Recording:
        """Simulate the recording that the command line makes of the same settings."""
        return simulate(
            DRIVE_MODEL,
            preset=self.preset,
            parameters=dict(self.parameters),
            effects=self.effects,
            speed_rpm=self.speed_rpm,
            torque_nm=self.torque_nm,
            duration_s=self.duration_s,
            sampling_rate_hz=self.sampling_rate_hz,
        )


# --------------------
# The sidebar of the start–stop drive: machine, cycle, teeth, load, effects, measurement.
# --------------------


CRACK = "root_crack"
HIGHEST = {CRACK: 2.0, "backlash": 500.0, "tooth_wear": 200.0, "sliding_friction": 0.2, "torque_ripple": 20.0}
"""Ends of the sliders; the crack's is in modules."""
WORDS = {
    CRACK: "Pairs of the cracked tooth lose stiffness, on the drive flank, where the load opens the crack.",
    "backlash": "Both flanks move apart: longer flights, harder impacts.",
    "tooth_wear": "Worn off the drive flanks where it is most: at their ends, by sliding; nothing at the pitch point.",
    "sliding_friction": "Coefficient of the flanks, beside the healthy one.",
    "torque_ripple": "Pistons of the motor, part of its torque.",
}
PLACES = {
    CRACK: ("tooth", "Cracked tooth of the pinion", 20),
    "torque_ripple": ("order", "Ripples per revolution", 50),
}
"""Effects that sit somewhere: their option, its words, its highest value."""
Parameters = list[tuple[str, ParameterValue]]


def choose_drive(chosen: Preset) -> DriveSetup:
    """Return what the user set; what is not offered is the preset's."""
    with st.sidebar:
        mode = st.segmented_control("Mode", MODES, default=MODES[0], key="mode of the drive", persist_state="session")
        torque = choose_number("Torque of the motor (N·m)", "torque of the drive", chosen.torque_nm, 300.0)
        speed = choose_number(
            "Speed that the flow allows (rpm)", "speed of the drive", chosen.speed_rpm, 300.0, low=10.0
        )
        with st.expander("Teeth", icon=":material/settings:"):
            values = _choose_teeth(chosen)
        with st.expander("Brake, press and load", icon=":material/weight:"):
            values += _choose_load(chosen)
        st.markdown("**Faults** · *the healthy drive has none*")
        effects = _choose_effects(chosen)
        with st.expander("Measurement", icon=":material/sensors:"):
            measured, duration, rate = _choose_measurement(chosen)
        show_typed_toggle()
    values.append(("mode", mode or MODES[0]))
    return DriveSetup(chosen.name, speed, torque, tuple(values + measured), tuple(effects), duration, rate)


def _choose_teeth(chosen: Preset) -> Parameters:
    law = st.selectbox(
        "Damping law",
        DAMPING_LAWS,
        index=DAMPING_LAWS.index(str(chosen.parameters.get("damping_law", DAMPING_LAWS[0]))),
        key=f"law of {chosen.name}",
        persist_state="session",
        help="What they really give: 0.947, 0.954 and 0.952 for a restitution of 0.95; 0.470, 0.725 and 0.663 for 0.5.",
    )
    return [
        ("damping_law", law),
        _value(chosen, "restitution", "Restitution", 1.0, low=0.1),
        _value(chosen, "half_backlash_um", "Half backlash (µm)", 500.0),
        _value(chosen, "friction_coefficient", "Friction of the flanks", 0.3),
    ]


def _choose_load(chosen: Preset) -> Parameters:
    return [
        _value(chosen, "brake_nm", "Brake (N·m)", 300.0),
        _value(chosen, "press_nm", "Blow of the press (N·m)", 6000.0),
        _value(chosen, "piece_mass_kg", "Mass of the piece (kg)", 2000.0),
        _value(chosen, "piece_offset_mm", "Piece off centre (mm)", 200.0),
        _value(chosen, "load_friction_nm", "Friction of the gripper (N·m)", 600.0),
    ]


def _choose_effects(chosen: Preset) -> list[EffectSetting]:
    """Return the faults whose sliders do not stand at 0."""
    settings = [_choose_effect(name, chosen) for name in HIGHEST]
    return [setting for setting in settings if setting.severity > 0.0]


def _choose_effect(name: str, chosen: Preset) -> EffectSetting:
    chosen_effect, high = effect(name), HIGHEST[name]
    s = chosen_effect.severity
    if name == CRACK:
        high *= float(chosen.parameters.get("module_mm") or parameter(PARAMETERS, "module_mm").default or 1.0)
    unit = shown_unit(s.unit)
    label = capitalised(chosen_effect.title) + (f" ({unit})" if unit else "")
    severity = choose_number(label, f"severity of {name} of the drive", 0.0, high, about=WORDS[name])
    if name not in PLACES or severity == 0.0:
        return EffectSetting(name, severity)
    option, words, highest = PLACES[name]
    if name == CRACK:
        highest = int(float(chosen.parameters.get("teeth_driver") or highest))
    default = next(int(float(o.default or 1)) for o in chosen_effect.options if o.name == option)
    place = st.number_input(
        words, 1, highest, min(default, highest), key=f"{option} of {name} of the drive", persist_state="session"
    )
    return EffectSetting(name, severity, {option: float(place)})


def _choose_measurement(chosen: Preset) -> tuple[Parameters, float, float]:
    duration = choose_number("Length (s)", "length of the drive", 6.0, 30.0, low=3.5)
    rate = st.selectbox(
        "Sampling rate (Hz)", (1000.0, 4000.0, 10000.0), format_func="{:g}".format, key="rate of the drive"
    )
    counts = st.select_slider(
        "Counts of the encoders",
        [2**bits for bits in range(10, 25, 2)],
        value=2**20,
        key="counts of the drive",
        persist_state="session",
    )
    noise = _value(chosen, "angle_noise_urad", "Noise of the angles (µrad rms)", 200.0)
    return [("encoder_counts", float(counts)), noise], duration, float(rate)


def _value(chosen: Preset, name: str, label: str, high: float, *, low: float = 0.0) -> tuple[str, ParameterValue]:
    own = chosen.parameters.get(name, parameter(PARAMETERS, name).default)
    return name, choose_number(label, f"{name} of {chosen.name}", float(own or 0.0), high, low=low)


# --------------------
# A run of the start–stop drive, once for equal setups: recording, what its motion shows, the force from it.
# --------------------


@dataclass(frozen=True)
class DriveRun:
    """What one setup gives.

    Parameters
    ----------
    setup : DriveSetup
    recording : Recording
    examined : StartStop
    force : ForceEstimate or None
    refusal : str
        Why there is no force.
    curve_um : array or None
        Profile of the compression over the mesh cycle on the drive flank; None where nothing starts and stops.
    """

    setup: DriveSetup
    recording: Recording
    examined: StartStop
    force: ForceEstimate | None
    refusal: str = ""
    curve_um: FloatArray | None = None

    def number(self, name: str) -> float:
        """Return an indicator by its name; nan where there is none."""
        return next((i.value for i in self.examined.indicators if i.name == name), float("nan"))


@st.cache_resource(max_entries=12, show_spinner="Simulating …")
def run_drive(setup: DriveSetup) -> DriveRun:
    """Simulate, measure, examine.

    Raises
    ------
    InputError
        If a value does not fit.
    """
    recording = setup.record()
    motion = measure_motion(recording)
    try:
        force, refusal = estimate_forces(motion), ""
    except RefusalError as error:
        force, refusal = None, str(error)
    return DriveRun(setup, recording, examine_start_stop(motion), force, refusal, _curve_um(motion))


def _curve_um(motion: PairMotion) -> FloatArray | None:
    try:
        return cut_cycles(motion).features().curve_um
    except RefusalError:
        return None


# --------------------
# What the page of the start–stop drive shows: numbers beside the healthy drive's, pictures, impacts, files.
# --------------------


NUMBERS = {
    "backlash": "µm",
    "impacts per cycle": "",
    "back impacts per cycle": "",
    "hardest impact": "m/s",
    "impact loss per cycle": "J",
}
"""Indicators on top of the page, with the unit for people."""
TOGETHER = "Healthy beside faulty"
VIEWS = ("Motion", "Force between the teeth", "Impacts", "Indicators")


def show_numbers(healthy: DriveRun, faulty: DriveRun | None) -> None:
    """Show the indicators, of the faulty drive with the healthy one's below."""
    show_metrics(
        {
            name: (unit, healthy.number(name), None if faulty is None else faulty.number(name))
            for name, unit in NUMBERS.items()
        }
    )


def show_views(healthy: DriveRun, faulty: DriveRun | None) -> None:
    """Show one of the views, of either drive."""
    with st.container(horizontal=True, horizontal_alignment="distribute", vertical_alignment="center"):
        view = st.segmented_control(
            "View", VIEWS if faulty is None else (TOGETHER, *VIEWS), default=VIEWS[0] if faulty is None else TOGETHER,
            key=f"view of the {'healthy' if faulty is None else 'faulty'} drive", label_visibility="collapsed",
            persist_state="session",
        )  # fmt: skip
        which = "Faulty"
        if faulty is not None and view != TOGETHER:
            which = st.segmented_control(
                "Drive", ("Faulty", "Healthy"), default="Faulty", key="side of the drive", label_visibility="collapsed"
            ) or "Faulty"  # fmt: skip
    run = healthy if faulty is None or which == "Healthy" else faulty
    if view == TOGETHER and faulty is not None:
        _show_together(healthy, faulty)
    elif view == VIEWS[1]:
        _show_force(run)
    elif view == VIEWS[2]:
        _show_impacts(run)
    elif view == VIEWS[3]:
        st.dataframe(
            pd.DataFrame([{"indicator": i.name, "value": i.value, "unit": i.unit} for i in run.examined.indicators]),
            hide_index=True,
        )
    else:
        _show_motion(run)
    for text in run.examined.refusals:
        st.caption(f":material/info: {as_typed(f'Cannot tell the {text}')}")
    for text in run.examined.notes:
        st.caption(f":material/info: {as_typed(text)}")


def show_saving(run: DriveRun) -> None:
    """Offer the files, and the way to the analysis page."""
    with st.container(horizontal=True, horizontal_alignment="right"):
        with st.popover("Save as recording", icon=":material/save:"):
            ending = st.selectbox("Format", ENDINGS, key="ending of the drive", persist_state="session")
            st.download_button(
                "Download",
                data=lambda: zip_of(files_of(run.recording, run.setup.file_stem, ending)),
                file_name=f"{run.setup.file_stem}.zip",
                mime="application/zip",
                icon=":material/download:",
                on_click="ignore",
                type="primary",
            )
        if st.button("Open in the analysis page", icon=":material/troubleshoot:", key="analyse the drive"):
            state.open_simulated(chosen_of_files(files_of(run.recording, run.setup.file_stem, ANALYSIS_ENDING)))
            st.switch_page(state.ANALYSIS_PAGE)


def _show_motion(run: DriveRun) -> None:
    words = "Speed of the pinion with the impacts, phase plane of the teeth, torque over twist"
    show_picture(start_stop_figure(run.examined, title=run.setup.preset), words)


def _show_together(healthy: DriveRun, faulty: DriveRun) -> None:
    curves = None if healthy.curve_um is None or faulty.curve_um is None else (healthy.curve_um, faulty.curve_um)
    words = "Healthy and faulty drive: speed, phase plane, torque over twist, drive flank over the mesh cycle, teeth"
    show_picture(start_stop_pair_figure(healthy.examined, faulty.examined, curves_um=curves), words)


def _show_force(run: DriveRun) -> None:
    if run.force is None:
        st.info(as_typed(run.refusal))
        return
    words = "Force between the teeth: measured, piecewise model, Hunt–Crossley; below, the errors"
    show_picture(force_figure(run.force, title=run.setup.preset), words)
    rows = [
        {
            "model": e.model,
            "against": e.reference,
            "rms (N)": round(e.rms_n),
            "rms (%)": round(100.0 * e.relative_rms, 1),
        }
        for e in run.force.errors
    ]
    st.dataframe(pd.DataFrame(rows), hide_index=True)


def _show_impacts(run: DriveRun) -> None:
    if not run.examined.impacts:
        st.info("No impacts were seen.")
        return
    motion = run.examined.motion
    figure = impacts_figure(run.examined.impacts, motion.path.teeth[0], restitution=motion.contact.restitution)
    show_picture(figure, "Energy of the impacts over time and over the tooth, restitution over speed")
    rows = [
        {
            "time (s)": i.time_s,
            "flank": "drive" if i.flank > 0 else "back",
            "tooth": i.driver_tooth,
            "speed (m/s)": i.speed_mps,
            "energy (J)": i.energy_j,
            "restitution": i.restitution,
        }
        for i in run.examined.impacts
    ]
    st.dataframe(pd.DataFrame(rows), hide_index=True)


def show_drive(preset: Preset) -> None:
    """Choose, simulate, show."""
    setup = choose_drive(preset)
    healthy = run_drive(setup.healthy)
    faulty = faulty_run(setup)
    head, buttons = st.columns((3, 2), vertical_alignment="top")
    with head:
        titles = [effect_text(setting) for setting in setup.effects] if faulty else []
        title = " + ".join(titles)
        st.subheader(as_typed(capitalised(title) or "Healthy: nothing is switched on"), anchor=False)
        st.caption(
            "Forging manipulator: pinion and wheel with gripper and piece. Every number is read from the recording, as "
            "of a measured one."
        )
    with buttons:
        show_saving(faulty or healthy)
    show_numbers(healthy, faulty)
    show_views(healthy, faulty)


def faulty_run(setup: DriveSetup) -> DriveRun | None:
    """Return the run with effects; None, with the reason on the page, where there is none."""
    try:
        return run_drive(setup) if setup.effects else None
    except GearsigError as error:
        show_error(error)
        return None
