"""A drive that starts and stops, with impacts on both flanks: what it does, and what its recording shows."""

from __future__ import annotations

from dataclasses import dataclass

import streamlit as st

from app.dashboard import address
from app.dashboard.laboratory.run import faulty_of, show_saving
from app.dashboard.laboratory.setup import (
    DRIVE_MODEL,
    Setup,
    choose_number,
    choose_parameter,
    preset_number,
    show_typed_toggle,
    shown_name,
    shown_unit,
)
from app.dashboard.laboratory.views import mark_slider_values, show_metrics, show_title
from app.dashboard.widgets.charts import show_figure
from app.dashboard.widgets.texts import as_typed, capitalised, show_table
from app.dashboard.work import kept
from gearsig import motion as motions
from gearsig import plot
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap.start_stop import cut_cycles
from gearsig.rig import DAMPING_LAWS
from sims.effects import EffectSetting, effect
from sims.forging import MODES
from sims.presets import Preset
from sims.simulator import ParameterValue

CRACK = "root_crack"


@dataclass(frozen=True)
class DriveFault:
    """An effect of the drive: the end of its slider, what it does, and where it is if that can be chosen."""

    highest: float
    about: str
    option: str = ""
    label: str = ""
    last: int = 1


FAULTS = {
    CRACK: DriveFault(
        2.0,  # modules
        "Pairs with the cracked tooth lose stiffness on the drive flank, where the load opens the crack.",
        "tooth",
        "Cracked tooth of the pinion",
        20,
    ),
    "backlash": DriveFault(500.0, "Both flanks move apart: longer flights, harder impacts."),
    "tooth_wear": DriveFault(
        200.0,
        "Maximum depth worn off the drive flanks: at their ends, by sliding; none at the pitch point.",
    ),
    "sliding_friction": DriveFault(0.2, "Friction coefficient of the flanks, added to the healthy one."),
    "torque_ripple": DriveFault(
        20.0, "From the motor's pistons, as a share of its torque.", "order", "Ripples per revolution", 50
    ),
}


Parameters = list[tuple[str, ParameterValue]]
RATES_HZ = (1000.0, 4000.0, 10000.0)
COUNTS = [2**bits for bits in range(10, 25, 2)]
ABOUT_LAWS = "In turn they give a restitution of 0.470, 0.725 and 0.663 where 0.5 is set; 0.95 is met within 0.005."


def choose_drive(preset: Preset) -> Setup:
    """Return the setup chosen in the sidebar; what is not offered is the preset's.

    In order of how often they are changed: operation, teeth, load, faults, measurement.
    """
    with st.sidebar:
        mode, torque_nm, speed_rpm = _choose_running(preset)
        with st.expander("Teeth", icon=":material/settings:"):
            teeth = _choose_teeth(preset)
        with st.expander("Brake, press and load", icon=":material/weight:"):
            load = _choose_load(preset)
        st.markdown("**Faults** · *the healthy drive has none*")
        effects = [_choose_effect(name, preset) for name in FAULTS]
        with st.expander("Measurement", icon=":material/sensors:"):
            length_s, rate_hz, measured = _choose_measurement(preset)
        show_typed_toggle()
    return Setup(
        preset=preset.name,
        speed_rpm=speed_rpm,
        torque_nm=torque_nm,
        parameters=(*teeth, *load, *measured, ("mode", mode)),
        # an effect at zero changes nothing: without it the setup is that of the healthy drive, simulated once
        effects=tuple(setting for setting in effects if setting.severity > 0.0),
        duration_s=length_s,
        sampling_rate_hz=rate_hz,
        model=DRIVE_MODEL,
    )


def _choose_running(preset: Preset) -> tuple[str, float, float]:
    """Return the mode, the torque of the motor and the speed that the flow of oil allows."""
    mode = address.ask_one(st.segmented_control, "Mode", MODES, name="mode")
    torque_nm = choose_number("Torque of the motor (N·m)", "torque of the drive", preset.torque_nm, 300.0)
    label, key = "Speed that the oil flow allows (rpm)", "speed of the drive"
    return mode, torque_nm, choose_number(label, key, preset.speed_rpm, 300.0, low=10.0)


def _choose_teeth(preset: Preset) -> Parameters:
    """Return the flanks' damping law, restitution, half backlash and friction."""
    law = address.ask_one(
        st.selectbox,
        "Damping law",
        DAMPING_LAWS,
        first=str(preset.parameters.get("damping_law", DAMPING_LAWS[0])),
        key=f"law of {preset.name}",
        name="law",
        help=ABOUT_LAWS,
    )
    return [
        ("damping_law", law),
        choose_parameter(preset, "restitution", "Restitution", 1.0, low=0.1),
        choose_parameter(preset, "half_backlash_um", "Half backlash (µm)", 500.0),
        choose_parameter(preset, "friction_coefficient", "Friction of the flanks", 0.3),
    ]


def _choose_load(preset: Preset) -> Parameters:
    """Return brake, press, workpiece and friction of the gripper."""
    highest = {
        "brake_nm": ("Brake (N·m)", 300.0),
        "press_nm": ("Blow of the press (N·m)", 6000.0),
        "piece_mass_kg": ("Mass of the workpiece (kg)", 2000.0),
        "piece_offset_mm": ("Workpiece off centre (mm)", 200.0),
        "load_friction_nm": ("Friction of the gripper (N·m)", 600.0),
    }
    return [choose_parameter(preset, name, label, high) for name, (label, high) in highest.items()]


def _choose_measurement(preset: Preset) -> tuple[float, float, Parameters]:
    """Return length (s) and sampling rate (Hz) of the recording, and resolution and noise of its angles."""
    # a cycle lasts three seconds: a shorter recording shows none
    length_s = choose_number("Length (s)", "length of the drive", 6.0, 30.0, low=3.5)
    looks = {"format_func": "{:g}".format, "key": "rate of the drive", "name": "rate"}
    rate_hz = address.ask_one(st.selectbox, "Sampling rate (Hz)", RATES_HZ, **looks)
    looks = {"first": 2**20, "key": "counts of the drive", "name": "counts"}
    counts = address.ask_one(st.select_slider, "Counts of the encoders", COUNTS, **looks)
    noise = choose_parameter(preset, "angle_noise_urad", "Noise of the angles (µrad rms)", 200.0)
    return length_s, float(rate_hz), [("encoder_counts", float(counts)), noise]


def _choose_effect(name: str, chosen: Preset) -> EffectSetting:
    chosen_effect, fault = effect(name), FAULTS[name]
    high, last = fault.highest, fault.last
    if name == CRACK:
        high *= preset_number(chosen, "module_mm") or 1.0
        last = int(preset_number(chosen, "teeth_driver") or last)
    unit = shown_unit(chosen_effect.severity.unit)
    label = capitalised(chosen_effect.title) + (f" ({unit})" if unit else "")
    severity = choose_number(label, f"severity of {name} of the drive", 0.0, high, about=fault.about)
    if not fault.option or severity == 0.0:
        return EffectSetting(name, severity)
    default = next(int(float(o.default or 1)) for o in chosen_effect.options if o.name == fault.option)
    looks = {"name": f"{name}-{fault.option}", "key": f"{fault.option} of {name} of the drive"}
    place = address.ask_number(st, fault.label, 1, last, first=min(default, last), whole=True, **looks)
    return EffectSetting(name, severity, {fault.option: float(place)})


@dataclass(frozen=True)
class DriveRun:
    """The results of one setup.

    Parameters
    ----------
    setup : Setup
    examined : motions.StartStop
    force : motions.ForceEstimate or None
    refusal : str
        Why there is no force.
    curve_um : array or None
        Profile of the compression over the mesh cycle on the drive flank; None where nothing starts and stops.
    """

    setup: Setup
    examined: motions.StartStop
    force: motions.ForceEstimate | None
    refusal: str = ""
    curve_um: FloatArray | None = None

    def number(self, name: str) -> float:
        """Return an indicator by its name; nan where there is none."""
        return next((i.value for i in self.examined.indicators if i.name == name), float("nan"))


@kept(12, "Simulating …", grace_s=0.0)
def run_drive(setup: Setup) -> DriveRun:
    """Simulate, measure, examine.

    Raises
    ------
    InputError
        If a value is not allowed.
    """
    recording = setup.record()
    motion = motions.measure_motion(recording)
    try:
        force, refusal = motions.estimate_forces(motion), ""
    except RefusalError as error:
        force, refusal = None, str(error)
    try:
        curve_um = cut_cycles(motion).features().curve_um
    except RefusalError:
        curve_um = None
    return DriveRun(setup, motions.examine_start_stop(motion), force, refusal, curve_um)


NUMBERS = {
    "backlash": "µm",
    "impacts per cycle": "",
    "back impacts per cycle": "",
    "hardest impact": "m/s",
    "impact loss per cycle": "J",
}
"""Indicators at the top of the page, with the unit shown."""
TOGETHER = "Healthy beside faulty"
VIEWS = ("Motion", "Force between the teeth", "Impacts", "Indicators")


def show_views(healthy: DriveRun, faulty: DriveRun | None) -> None:
    """Show one of the views, for either drive."""
    with st.container(horizontal=True, horizontal_alignment="distribute", vertical_alignment="center"):
        view = address.ask_one(
            st.segmented_control,
            "View",
            VIEWS if faulty is None else (TOGETHER, *VIEWS),
            key=f"view of the {'healthy' if faulty is None else 'faulty'} drive",
            name="view",
            label_visibility="collapsed",
        )
        which = "Faulty"
        if faulty is not None and view != TOGETHER:
            looks = {"name": "side", "label_visibility": "collapsed"}
            which = address.ask_one(st.segmented_control, "Drive", ("Faulty", "Healthy"), **looks)
    run = healthy if faulty is None or which == "Healthy" else faulty
    if view == TOGETHER and faulty is not None:
        curves = None if healthy.curve_um is None or faulty.curve_um is None else (healthy.curve_um, faulty.curve_um)
        words = (
            "Healthy and faulty drive: speed, phase plane, torque over twist, drive flank over the mesh cycle, teeth"
        )
        show_figure(
            plot.start_stop_pair_figure(healthy.examined, faulty.examined, curves_um=curves), words, "both drives"
        )
    elif view == "Force between the teeth":
        _show_force(run)
    elif view == "Impacts":
        _show_impacts(run)
    elif view == "Indicators":
        rows = [{"indicator": i.name, "value": i.value, "unit": i.unit} for i in run.examined.indicators]
        show_table(rows)
    else:
        words = "Speed of the pinion with the impacts, phase plane of the teeth, torque over twist"
        show_figure(plot.start_stop_figure(run.examined, title=shown_name(run.setup.preset)), words, "drive")
    for text in (*(f"Cannot tell the {text}" for text in run.examined.refusals), *run.examined.notes):
        st.caption(f":material/info: {as_typed(text)}")


def _show_force(run: DriveRun) -> None:
    if run.force is None:
        st.info(as_typed(run.refusal))
        return
    words = "Force between the teeth: measured, piecewise model, Hunt–Crossley; below, the errors"
    show_figure(plot.force_figure(run.force, title=shown_name(run.setup.preset)), words, "force of the drive")
    rows = [
        {
            "model": e.model,
            "against": e.reference,
            "rms (N)": round(e.rms_n),
            "rms (%)": round(100.0 * e.relative_rms, 1),
        }
        for e in run.force.errors
    ]
    show_table(rows)


def _show_impacts(run: DriveRun) -> None:
    if not run.examined.impacts:
        st.info("No impacts were seen.")
        return
    motion = run.examined.motion
    figure = plot.impacts_figure(run.examined.impacts, motion.path.teeth[0], restitution=motion.contact.restitution)
    show_figure(figure, "Energy of the impacts over time and over the tooth, restitution over speed", "impacts")
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
    show_table(rows, placeholder="–")


def show_drive(preset: Preset) -> None:
    """Choose, simulate, show."""
    setup = choose_drive(preset)
    with st.container(key="results"):
        _show_drives(setup)


def _show_drives(setup: Setup) -> None:
    healthy, faulty = run_drive(setup.healthy), faulty_of(setup, run_drive)
    mark_slider_values()
    head, buttons = st.columns((3, 2), vertical_alignment="top")
    with head:
        show_title(setup, is_shown=faulty is not None)
        st.caption(
            "Forging manipulator: pinion and wheel with gripper and workpiece. Every number is computed from the "
            "recording, as for a measured one."
        )
    with buttons:
        show_saving(setup if faulty else setup.healthy)
    show_metrics(
        {
            name: (unit, healthy.number(name), None if faulty is None else faulty.number(name))
            for name, unit in NUMBERS.items()
        }
    )
    show_views(healthy, faulty)
