"""The sidebar of the laboratory: machine and operating point, flanks and oil, faults, measurement."""

from __future__ import annotations

import streamlit as st

from app.dashboard.laboratory.effect_controls import choose_crack, choose_effects
from app.dashboard.laboratory.number import choose_number, show_typed_toggle
from app.dashboard.laboratory.setup import MODELS, Setup
from app.dashboard.start_stop.setup import MODEL as DRIVE
from sims.presets import Preset, presets
from sims.registry import simulator
from sims.simulator import ParameterValue
from sims.values import parameter

Parameters = tuple[tuple[str, ParameterValue], ...]

FIRST = "published_55_75"
DURATIONS_S = (0.5, 1.0, 2.0, 4.0)
AUTOMATIC, LONGEST_AUTOMATIC_S, WANTED_REVOLUTIONS = "auto", 1.0, 8.0
RATES_HZ = (10240.0, 20480.0, 40960.0)


def choose_setup(preset: Preset) -> Setup:
    """Return what the user set in the sidebar; what the sliders do not offer is the preset's."""
    with st.sidebar:
        speed, torque = _choose_operation(preset)
        with st.expander("Flanks and oil", icon=":material/opacity:"):
            parameters = _choose_flanks(preset)
        st.markdown("**Faults** · *the healthy twin has none*")
        found = [*choose_crack(preset), *choose_effects(preset, simulator(preset.model).effects)]
        with st.expander("Measurement", icon=":material/sensors:"):
            measured, duration, rate, seed = _choose_measurement(preset, speed)
        show_typed_toggle()
    return Setup(preset.name, speed, torque, (*parameters, *measured), tuple(found), duration, rate, seed, preset.model)


def shown_name(preset: str) -> str:
    """Write a preset's name for people.

    Examples
    --------
    >>> shown_name("published_55_75"), shown_name("manipulator_formula")
    ('Published 55/75', 'Manipulator formula')
    """
    words = preset.split("_")
    if not words[-1].isdigit():
        return " ".join(words).capitalize()
    return f"{' '.join(words[:-2]).capitalize()} {'/'.join(words[-2:])}"


def choose_preset() -> Preset:
    """Return the machine: pairs that run at a steady speed, and the drive that starts and stops."""
    found = {name: preset for model in (*MODELS, DRIVE) for name, preset in presets(model).items()}
    names = list(found)
    with st.sidebar:
        name = st.selectbox(
            "Machine",
            names,
            index=names.index(FIRST) if FIRST in names else 0,
            format_func=shown_name,
            key="machine of the laboratory",
            persist_state="session",
        )
        st.caption(found[name].title)
    return found[name]


def _choose_operation(preset: Preset) -> tuple[float, float]:
    own, high = preset.torque_nm, max(3.0 * preset.speed_rpm, 3000.0)
    speed = choose_number("Speed of the input shaft (rpm)", f"speed of {preset.name}", preset.speed_rpm, high, low=60.0)
    torque = choose_number("Torque on the input shaft (N·m)", f"torque of {preset.name}", own, 3.0 * own)
    return speed, torque


def _choose_flanks(preset: Preset) -> Parameters:
    st.caption("Of the healthy and the faulty machine alike.")
    rough = choose_number("Flank roughness, rms (µm)", f"roughness of {preset.name}", _own(preset, "roughness_um"), 2.0)
    if not _has(preset, "friction"):
        return (("roughness_um", rough),)
    oil = choose_number(
        "Oil viscosity at the inlet (cP)", f"oil of {preset.name}", _own(preset, "viscosity_cp"), 100.0, low=1.0
    )
    friction = st.toggle(
        "Sliding friction",
        value=preset.parameters.get("friction", "on") == "on",
        key=f"friction of {preset.name}",
        persist_state="session",
    )
    return ("roughness_um", rough), ("viscosity_cp", oil), ("friction", "on" if friction else "off")


def _choose_measurement(preset: Preset, speed: float) -> tuple[Parameters, float, float, int]:
    duration = st.segmented_control(
        "Length shown (s)",
        (AUTOMATIC, *DURATIONS_S),
        default=AUTOMATIC,
        key="length of the laboratory",
        persist_state="session",
        help="A longer signal has a finer spectrum and takes longer to follow the sliders. Auto: eight revolutions of "
        "the slower shaft, at most a second.",
    )
    rate = st.selectbox(
        "Sampling rate (Hz)", RATES_HZ, index=1, format_func="{:g}".format, key="rate of the laboratory"
    )
    own = _own(preset, "noise_mps2")
    noise = choose_number("Background noise, rms (m/s²)", f"noise of {preset.name}", own, max(2.0, 4.0 * own))
    seed = st.number_input(
        "Seed",
        min_value=0,
        max_value=10**6,
        value=0,
        key="seed of the laboratory",
        persist_state="session",
        help="Another one draws other roughness, other noise, other angles. Healthy and faulty always share it.",
    )
    limit = choose_number(
        "Range of the sensors (m/s²)", f"range of {preset.name}", _own(preset, "sensor_range_mps2"), 5e3
    )
    measured: Parameters = (("noise_mps2", noise), ("sensor_range_mps2", limit))
    length = float(duration) if isinstance(duration, float) else automatic_s(preset, speed)
    return measured, length, float(rate), int(seed)


def automatic_s(preset: Preset, speed_rpm: float) -> float:
    """Return the shortest of `DURATIONS_S` that shows enough revolutions, or the longest that is still quick."""
    ratio = _own(preset, "teeth_driver") / _own(preset, "teeth_driven")
    wanted = WANTED_REVOLUTIONS * 60.0 / max(speed_rpm * min(ratio, 1.0), 1e-6)
    return next((d for d in DURATIONS_S if wanted <= d < LONGEST_AUTOMATIC_S), LONGEST_AUTOMATIC_S)


def _own(preset: Preset, name: str) -> float:
    """Return a number of the preset, or else the model's default."""
    value = preset.parameters.get(name, parameter(simulator(preset.model).parameters, name).default)
    return float(value or 0.0)


def _has(preset: Preset, name: str) -> bool:
    return any(p.name == name for p in simulator(preset.model).parameters)
