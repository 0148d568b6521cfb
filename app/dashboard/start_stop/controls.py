"""The sidebar of the start–stop drive: machine, cycle, teeth, load, effects, measurement."""

from __future__ import annotations

import streamlit as st

from app.dashboard.laboratory.number import choose_number, show_typed_toggle
from app.dashboard.laboratory.setup import shown_unit
from app.dashboard.start_stop.setup import DriveSetup
from gearsig.rig.contact import DAMPING_LAWS
from sims.effects import EffectSetting, effect
from sims.forging.parameters import PARAMETERS
from sims.forging.schedule import MODES
from sims.presets import Preset
from sims.simulator import ParameterValue
from sims.values import parameter

RATES_HZ = (1000.0, 4000.0, 10000.0)
CRACK = "root_crack"
HIGHEST = {CRACK: 2.0, "backlash": 500.0, "tooth_wear": 200.0, "sliding_friction": 0.2, "torque_ripple": 20.0}
"""Ends of the sliders; the crack's is in modules."""
WORDS = {
    CRACK: "Pairs of the cracked tooth lose stiffness, on the drive flank, where the load opens the crack.",
    "backlash": "Both flanks move apart: longer flights, harder impacts.",
    "tooth_wear": "Worn off the drive flanks where it is most: at their ends, by sliding; nothing at the pitch point.",
    "sliding_friction": "Coefficient of the flanks, beside the sound one.",
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
        st.markdown("**Faults** · *the sound drive has none*")
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
    found, high = effect(name), HIGHEST[name]
    s = found.severity
    if name == CRACK:
        high *= float(chosen.parameters.get("module_mm") or parameter(PARAMETERS, "module_mm").default or 1.0)
    unit = shown_unit(s.unit)
    label = f"{found.title[:1].upper()}{found.title[1:]}" + (f" ({unit})" if unit else "")
    severity = choose_number(label, f"severity of {name} of the drive", 0.0, high, about=WORDS[name])
    if name not in PLACES or severity == 0.0:
        return EffectSetting(name, severity)
    option, words, highest = PLACES[name]
    if name == CRACK:
        highest = int(float(chosen.parameters.get("teeth_driver") or highest))
    default = next(int(float(o.default or 1)) for o in found.options if o.name == option)
    place = st.number_input(
        words, 1, highest, min(default, highest), key=f"{option} of {name} of the drive", persist_state="session"
    )
    return EffectSetting(name, severity, {option: float(place)})


def _choose_measurement(chosen: Preset) -> tuple[Parameters, float, float]:
    duration = choose_number("Length (s)", "length of the drive", 6.0, 30.0, low=3.5)
    rate = st.selectbox("Sampling rate (Hz)", RATES_HZ, format_func="{:g}".format, key="rate of the drive")
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
