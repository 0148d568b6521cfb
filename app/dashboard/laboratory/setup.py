"""The setup on the page: a machine, how it runs, its effects, and how it is measured."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import lru_cache
from math import floor, log10
from time import monotonic, sleep
from typing import TYPE_CHECKING, Any

import numpy as np
import streamlit as st

import sims
from app.dashboard import address
from app.dashboard.widgets.texts import as_typed, capitalised
from app.dashboard.work import let_user_act
from gearsig.errors import InputError
from gearsig.recording import Recording
from sims.effects import Effect, EffectSetting, Option, effect, effects, is_user_effect
from sims.presets import Preset, presets
from sims.registry import simulator
from sims.simulator import ParameterValue, SimulationSetup, parameter

if TYPE_CHECKING:
    from sims.fe_gear import ReducedGear
    from sims.machine import Machine


MODEL = "cracked"
"""The model whose motion the bifurcation diagram can follow."""
MODELS = (MODEL, "reduced-fe")
DRIVE_MODEL = "forging"
"""The drive that starts and stops, with its own controls and figures."""


@dataclass(frozen=True)
class Setup:
    """Everything that determines a simulation: equal setups give equal recordings.

    Parameters
    ----------
    preset : str
    speed_rpm, torque_nm : float
        Of the input shaft, constant.
    parameters : tuple of (name, value)
        Values that differ from the preset's, also in the healthy machine.
    effects : tuple of EffectSetting
    duration_s, sampling_rate_hz : float
    seed : int
        The same for the healthy twin, so that the two differ by the effects only.
    model : str
        One of `MODELS`, or `DRIVE_MODEL`.
    """

    preset: str
    speed_rpm: float
    torque_nm: float
    parameters: tuple[tuple[str, ParameterValue], ...] = ()
    effects: tuple[EffectSetting, ...] = ()
    duration_s: float = 1.0
    sampling_rate_hz: float = 20480.0
    seed: int = 0
    model: str = MODEL

    @property
    def healthy(self) -> Setup:
        """The same machine without effects."""
        return replace(self, effects=())

    @property
    def is_healthy(self) -> bool:
        """Whether no effect changes anything."""
        return all(setting.severity == 0 for setting in self.effects)

    @property
    def revolutions_per_s(self) -> float:
        """Of the input shaft."""
        return self.speed_rpm / 60.0

    def record(self) -> Recording:
        """Simulate the recording that the command line makes from the same settings."""
        return sims.simulate(
            self.model,
            preset=self.preset,
            parameters=dict(self.parameters),
            effects=self.effects,
            speed_rpm=self.speed_rpm,
            torque_nm=self.torque_nm,
            duration_s=self.duration_s,
            sampling_rate_hz=self.sampling_rate_hz,
            seed=self.seed,
        )

    @property
    def file_stem(self) -> str:
        """Name of its files, without a dot: preset and effects.

        Examples
        --------
        >>> Setup("small_30_25", 1800, 20, effects=(EffectSetting("root_crack", 1.5),)).file_stem
        'small_30_25_root_crack_1_5'
        """
        parts = [f"{s.name}_{s.severity:g}" for s in self.effects] or ["healthy"]
        return "_".join([self.preset, *parts]).replace(".", "_")[:100]


def effect_text(setting: EffectSetting) -> str:
    """Return an effect's title with its severity, e.g. "crack in a tooth root, 2 mm"."""
    known = effect(setting.name)
    return f"{known.title}, {setting.severity:.4g} {shown_unit(known.severity.unit)}".rstrip()


def shown_unit(unit: str) -> str:
    """Return a unit of the catalogue in readable form."""
    from gearsig.formatting import unit_text
    from gearsig.gap import severity_unit

    return unit_text(severity_unit(unit))


PREFIX, SUFFIX, TYPED = "lab ", " typed", "lab typed values"


def show_typed_toggle() -> None:
    """Let the user type numbers instead of moving sliders; the values carry over."""
    st.toggle(
        "Type the numbers",
        key=TYPED,
        on_change=_carry_over,
        persist_state="session",
        help="Exact values, also beyond the sliders' ends. The page says if a value is not possible.",
    )


def choose_number(label: str, name: str, default: float, high: float, *, low: float = 0.0, about: str = "") -> float:
    """Return a number that the user chooses.

    Parameters
    ----------
    label : str
        With the unit.
    name : str
        Of the number, unique on the page.
    default : float
    high, low : float
        Ends of the slider; a value that was typed beyond them widens it.
    about : str
        Help text shown on demand.
    """
    key, in_address = PREFIX + name, name.replace("severity of ", "").replace(" ", "-")
    step = slider_step(low, high)
    typed = bool(st.session_state.get(TYPED, False))
    if typed:
        key += SUFFIX
    address.begin(key, in_address, float(default), address.number(min(low, 0.0)))
    value = float(st.session_state[key])
    looks: dict[str, Any] = {"step": step, "format": "%g", "key": key, "help": about or None}
    if typed:
        number = float(st.number_input(label, persist_state="session", **looks))
    else:
        ends = min(low, value), max(high, value)
        number = float(st.slider(label, *ends, persist_state="session", **looks))
    address.keep(in_address, number, float(default))
    return number


def slider_values() -> dict[str, float]:
    """Return the values of the `choose_number` sliders in this run, by the CSS class that Streamlit gives each."""
    return {
        "st-key-" + re.sub(r"[^a-zA-Z0-9_-]", "-", str(key)): value
        for key, value in st.session_state.items()
        if str(key).startswith(PREFIX) and isinstance(value, float)
    }


_LAST_CHANGE = "last change of a slider"
HELD_S, REST_S = 0.4, 0.15


def wait_for_rest() -> None:
    """Wait until a slider that has just changed comes to rest; a key that is held changes it 30 times a second."""
    values, now_s = slider_values(), monotonic()
    past, changed_s = st.session_state.get(_LAST_CHANGE, (values, 0.0))
    if values == past:
        st.session_state[_LAST_CHANGE] = values, changed_s
        return
    st.session_state[_LAST_CHANGE] = values, now_s
    while now_s - changed_s < HELD_S and monotonic() - now_s < REST_S:
        sleep(0.03)
        let_user_act()


def choose_parameter(
    preset: Preset, name: str, label: str, high: float, *, low: float = 0.0
) -> tuple[str, ParameterValue]:
    """Return a parameter's name and the number that the user chooses, at first the preset's or the model's default."""
    return name, choose_number(label, f"{name} of {preset.name}", preset_number(preset, name), high, low=low)


def preset_number(preset: Preset, name: str) -> float:
    """Return a number of the preset, or else the model's default."""
    value = preset.parameters.get(name, parameter(simulator(preset.model).parameters, name).default)
    return float(value or 0.0)


def slider_step(low: float, high: float) -> float:
    """Return the step of a slider: about 150 steps from end to end."""
    return nice_step((high - low) / 150.0)


def nice_step(size: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is no larger than `size`.

    Examples
    --------
    >>> nice_step(0.07), nice_step(13.3), nice_step(3.0)
    (0.05, 10.0, 2.0)
    """
    exponent = floor(log10(size))
    digit = max(d for d in (1, 2, 5) if d <= size / 10.0**exponent * (1 + 1e-9))
    return float(f"{digit}e{exponent}")


def _carry_over() -> None:
    """Give every number its value on the other kind of widget."""
    typed = st.session_state[TYPED]
    for key in [str(k) for k in st.session_state]:
        value = st.session_state[key]
        if not key.startswith(PREFIX) or key == TYPED or isinstance(value, bool) or not isinstance(value, float):
            continue
        if key.endswith(SUFFIX) and not typed:
            st.session_state[key.removesuffix(SUFFIX)] = value
        elif typed and not key.endswith(SUFFIX):
            st.session_state[key + SUFFIX] = value


Options = tuple[tuple[str, float | str], ...]


def greatest_severity(chosen: Preset, name: str, high: float, options: Options = ()) -> float:
    """Return the maximum severity up to `high` that a machine allows, rounded down to the slider's step.

    Parameters
    ----------
    chosen : Preset
        The machine.
    name : str
        Of the effect.
    high : float
        Above 0: where the slider ends if the machine allows it.
    options : tuple of (name, value)
        Of the effect, e.g. on which gear it is. If they allow no severity at all, the end stays: the page says why.
    """
    greatest = _greatest(chosen.model, chosen.name, name, high, options)
    step = slider_step(0.0, greatest)
    return greatest if greatest == high else floor(greatest / step * (1.0 + 1e-9)) * step


@lru_cache(maxsize=256)
def _greatest(model: str, preset_name: str, name: str, high: float, options: Options) -> float:
    machine, gears = _machine(model, preset_name)

    def allowed(severity: float) -> bool:
        try:
            changed = effect(name).apply(machine, severity, dict(options), np.random.default_rng(0))
        except InputError:
            return False
        return _meshed(changed, gears)

    if allowed(high):
        return high
    low, end = 0.0, high
    for _ in range(20):
        middle = (low + end) / 2.0
        low, end = (middle, end) if allowed(middle) else (low, middle)
    return low or high


def _meshed(machine: Machine, gears: tuple[ReducedGear, ...]) -> bool:
    """Whether the finite elements of the gears, if there are any, can follow the cracks."""
    from sims.fe_gear import crack_size, deepest_followed_mm

    cracks = (machine.mesh.cracks_1, machine.mesh.cracks_2)
    return all(
        crack.depth_mm <= deepest_followed_mm(gear.blank, crack_size(gear), crack.angle_deg)
        for gear, cracks_of_gear in zip(gears, cracks, strict=False)
        for crack in cracks_of_gear
    )


@lru_cache(maxsize=16)
def _machine(model: str, preset_name: str) -> tuple[Machine, tuple[ReducedGear, ...]]:
    """Return the healthy machine of a preset, and its reduced gears."""
    from sims.cracked import CrackedPair
    from sims.reduced_fe import ReducedPair

    rng, setup = np.random.default_rng(0), SimulationSetup(preset_name)
    if model == MODEL:
        return CrackedPair().prepare(setup, rng).machine, ()
    pair = ReducedPair().prepare(setup, rng).pair
    return pair.machine, pair.gears


CRACK, EFFECTS = "root_crack", "effects of the laboratory"
WIDEST = 5.0
"""Sliders end at so many times the typical value, as the catalogue's ranges reach far beyond it, or earlier if the
machine allows less."""
GROUP_WORDS = {
    "tooth-local": "tooth",
    "flank": "flanks",
    "shaft": "shaft",
    "drive and load": "drive",
    "bearing": "bearing",
    "measurement chain": "measurement",
}


def choose_effects(preset: Preset, meaningful: Collection[str]) -> list[EffectSetting]:
    """Return the active effects, of those the model knows.

    The root crack's slider is always shown and starts at 0; others start at their typical value.
    """
    crack = _choose_severity(effect(CRACK), preset, start=0.0)
    further = {name: known for name, known in effects().items() if name in meaningful and name != CRACK}
    address.begin(EFFECTS, "effects", [], lambda texts: [name for name in further if name in texts[0].split(",")])
    names = st.multiselect(
        "More effects",
        list(further),
        format_func=lambda name: f"{GROUP_WORDS.get(further[name].group, further[name].group)}: {further[name].title}",
        key=EFFECTS,
        placeholder="Choose effects …",
        persist_state="session",
        help="Any number at once. Each gets its own slider.",
    )
    address.keep("effects", ",".join(names), "")
    chosen = [
        _choose_severity(more, preset, start=more.severity.typical) for more in further.values() if more.name in names
    ]
    return [crack, *chosen] if crack.severity != 0 else chosen


def _choose_severity(chosen: Effect, preset: Preset, *, start: float) -> EffectSetting:
    s = chosen.severity
    unit = _as_written(chosen, shown_unit(s.unit))
    high = greatest_severity(preset, chosen.name, min(s.high, WIDEST * s.typical), _options_so_far(chosen))
    title = _as_written(chosen, capitalised(chosen.title))
    severity = choose_number(
        f"{title} ({unit + ', ' if unit else ''}typical {s.typical:g})",
        f"severity of {chosen.name}",
        min(start, high),
        high,
        about=f"{_as_written(chosen, capitalised(s.meaning))}; {s.low:g} to {s.high:g} {unit}, as far as the machine "
        f"allows.\n\n{_as_written(chosen, chosen.changes)}",
    )
    options: dict[str, float | str] = {}
    if chosen.options and severity != 0:
        with st.expander("Where and how", icon=":material/tune:"):
            values = {option.name: _choose_option(chosen, option) for option in chosen.options}
        options = {name: value for name, value in values.items() if value is not None}
    return EffectSetting(chosen.name, severity, options)


def _as_written(of: Effect, text: str) -> str:
    """Return an effect's text as Markdown; the catalogue's needs no escapes, which screen readers would read out."""
    return as_typed(text) if is_user_effect(of.name) else text


def _options_so_far(of: Effect) -> tuple[tuple[str, float | str], ...]:
    """Return the options as of the page's last run: their widgets come below the slider."""
    values = {option.name: st.session_state.get(_option_key(of, option)) for option in of.options}
    return tuple((name, value) for name, value in values.items() if isinstance(value, float | int | str))


def _option_key(of: Effect, option: Option) -> str:
    return f"{option.name} of {of.name}"


def _choose_option(of: Effect, option: Option) -> float | str | None:
    """Return the value of an option; None if it is to be drawn at random."""
    unit = shown_unit(option.unit)
    words = option.name.removesuffix("_deg").removesuffix("_percent").removesuffix("_um").removesuffix("_hz")
    label = _as_written(of, words.replace("_", " ").capitalize() + (f" ({unit})" if unit else ""))
    looks: dict[str, Any] = {"key": _option_key(of, option), "help": _as_written(of, option.meaning)}
    looks["name"] = f"{of.name}-{option.name}"
    if isinstance(option.default, str):
        choices = option.choices or tuple(f"bearing {i + 1}" for i in range(4))
        first = option.default if option.default in choices else choices[0]
        return str(address.ask_one(st.selectbox, label, choices, first=first, **looks))
    low = (option.low or 0) if option.whole else None
    looks |= {"placeholder": "random" if option.default is None else address.text_of(option.default)}
    number = address.ask_number(st, label, low, first=option.default, whole=option.whole, **looks)
    return None if number is None else float(number)


Parameters = tuple[tuple[str, ParameterValue], ...]

FIRST = "published_55_75"
DURATIONS_S = (0.5, 1.0, 2.0, 4.0)
AUTOMATIC, MAX_AUTOMATIC_S = "auto", 1.0
MOST_SEEDS = 10**6


def choose_setup(preset: Preset) -> Setup:
    """Return the setup chosen in the sidebar; what the sliders do not offer is the preset's."""
    with st.sidebar:
        speed, torque = _choose_operation(preset)
        with st.expander("Flanks and oil", icon=":material/opacity:"):
            parameters = _choose_flanks(preset)
        st.markdown("**Faults** · *the healthy twin has none*")
        switched_on = tuple(choose_effects(preset, simulator(preset.model).effects))
        with st.expander("Measurement", icon=":material/sensors:"):
            measured, duration, rate, seed = _choose_measurement(preset, speed)
        show_typed_toggle()
    return Setup(preset.name, speed, torque, (*parameters, *measured), switched_on, duration, rate, seed, preset.model)


def shown_name(preset: str) -> str:
    """Return a preset's name in readable form.

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
    known = {name: preset for model in (*MODELS, DRIVE_MODEL) for name, preset in presets(model).items()}
    names = list(known)
    looks = {"name": "machine", "first": FIRST, "format_func": shown_name}
    with st.sidebar:
        name = address.ask_one(st.selectbox, "Machine", names, **looks)
        st.caption(known[name].title)
    return known[name]


def _choose_operation(preset: Preset) -> tuple[float, float]:
    usual, high = preset.torque_nm, max(3.0 * preset.speed_rpm, 3000.0)
    speed = choose_number("Speed of the input shaft (rpm)", f"speed of {preset.name}", preset.speed_rpm, high, low=60.0)
    torque = choose_number("Torque on the input shaft (N·m)", f"torque of {preset.name}", usual, 3.0 * usual)
    return speed, torque


def _choose_flanks(preset: Preset) -> Parameters:
    st.caption("For the healthy and the faulty machine alike.")
    rough = choose_parameter(preset, "roughness_um", "Flank roughness, rms (µm)", 2.0)
    if not any(p.name == "friction" for p in simulator(preset.model).parameters):
        return (rough,)
    oil = choose_parameter(preset, "viscosity_cp", "Oil viscosity at the inlet (cP)", 100.0, low=1.0)
    friction = address.ask(
        st.toggle,
        "Sliding friction",
        key=f"friction of {preset.name}",
        name="friction",
        first=preset.parameters.get("friction", "on") == "on",
        read=address.one_of((False, True)),
    )
    return rough, oil, ("friction", "on" if friction else "off")


def _choose_measurement(preset: Preset, speed: float) -> tuple[Parameters, float, float, int]:
    duration = address.ask_one(
        st.segmented_control,
        "Length shown (s)",
        (AUTOMATIC, *DURATIONS_S),
        name="length",
        help="A longer signal gives a finer spectrum but follows the sliders more slowly. Auto: eight revolutions of "
        "the slower shaft, at most a second.",
    )
    looks: dict[str, Any] = {"name": "rate", "first": 20480.0, "format_func": "{:g}".format}
    rate = address.ask_one(st.selectbox, "Sampling rate (Hz)", (10240.0, 20480.0, 40960.0), **looks)
    loudest = max(2.0, 4.0 * preset_number(preset, "noise_mps2"))
    noise = choose_parameter(preset, "noise_mps2", "Background noise, rms (m/s²)", loudest)
    about = "Another seed draws other roughness, noise and angles. Healthy and faulty machine always share it."
    seed = address.ask_number(st, "Seed", 0, MOST_SEEDS, name="seed", first=0, whole=True, help=about)
    limit = choose_parameter(preset, "sensor_range_mps2", "Range of the sensors (m/s²)", 5e3)
    length = float(duration) if isinstance(duration, float) else automatic_s(preset, speed)
    return (noise, limit), length, float(rate), seed


def automatic_s(preset: Preset, speed_rpm: float) -> float:
    """Return the shortest of `DURATIONS_S` that shows enough revolutions, or the longest that is still fast."""
    ratio = preset_number(preset, "teeth_driver") / preset_number(preset, "teeth_driven")
    eight_revolutions_s = 8.0 * 60.0 / max(speed_rpm * min(ratio, 1.0), 1e-6)
    return next((d for d in DURATIONS_S if eight_revolutions_s <= d < MAX_AUTOMATIC_S), MAX_AUTOMATIC_S)
