"""Sliders of the effects: severity with unit and a typical value, options on demand."""

from __future__ import annotations

from collections.abc import Collection

import streamlit as st

from app.dashboard.laboratory.limits import greatest_severity
from app.dashboard.laboratory.number import choose_number
from app.dashboard.laboratory.setup import shown_unit
from sims.effects import Effect, EffectSetting, Option, effect, effects
from sims.presets import Preset

CRACK = "root_crack"
WIDEST = 5.0
"""Sliders end at so many times the typical value: the catalogue's ranges reach far beyond it. Where the machine ends
earlier, they do."""
GROUP_WORDS = {
    "tooth-local": "tooth",
    "flank": "flanks",
    "shaft": "shaft",
    "drive and load": "drive",
    "bearing": "bearing",
    "measurement chain": "measurement",
}
N_BEARINGS = 4


def choose_crack(preset: Preset) -> list[EffectSetting]:
    """Return the root crack, whose slider is always there; none while it stands at 0."""
    setting = _choose_severity(effect(CRACK), preset, start=0.0)
    return [setting] if setting.severity != 0 else []


def choose_effects(preset: Preset, meaningful: Collection[str]) -> list[EffectSetting]:
    """Return the other effects that the user switched on, of those the model knows; each at its typical value first."""
    found = {name: one for name, one in effects().items() if name in meaningful}
    names = st.multiselect(
        "More effects",
        [name for name in found if name != CRACK],
        format_func=_shown_name,
        key="effects of the laboratory",
        placeholder="Choose what is wrong …",
        persist_state="session",
        help="Any number at once. Each gets a slider of its own.",
    )
    ordered = [name for name in found if name in names]
    return [_choose_severity(found[n], preset, start=found[n].severity.typical) for n in ordered]


def _shown_name(name: str) -> str:
    found = effect(name)
    return f"{GROUP_WORDS.get(found.group, found.group)}: {found.title}"


def _choose_severity(found: Effect, preset: Preset, *, start: float) -> EffectSetting:
    s = found.severity
    unit = shown_unit(s.unit)
    high = greatest_severity(preset, found.name, min(s.high, WIDEST * s.typical), _options_so_far(found))
    title = found.title[:1].upper() + found.title[1:]
    severity = choose_number(
        f"{title} ({unit + ', ' if unit else ''}typical {s.typical:g})",
        f"severity of {found.name}",
        min(start, high),
        high,
        about=f"{s.meaning[:1].upper()}{s.meaning[1:]}; {s.low:g} to {s.high:g} {unit}, as far as the machine "
        f"allows.\n\n{found.changes}",
    )
    options: dict[str, float | str] = {}
    if found.options and severity != 0:
        with st.expander("Where and how", icon=":material/tune:"):
            options = _choose_options(found)
    return EffectSetting(found.name, severity, options)


def _options_so_far(found: Effect) -> tuple[tuple[str, float | str], ...]:
    """Options as they stood when the page ran last: their widgets come below the slider."""
    values = {option.name: st.session_state.get(_option_key(found, option)) for option in found.options}
    return tuple((name, value) for name, value in values.items() if isinstance(value, float | int | str))


def _option_key(found: Effect, option: Option) -> str:
    return f"{option.name} of {found.name}"


def _choose_options(found: Effect) -> dict[str, float | str]:
    """Return the options; one that is left to be drawn is not in it."""
    chosen = {option.name: _choose_option(option, _option_key(found, option)) for option in found.options}
    return {name: value for name, value in chosen.items() if value is not None}


def _choose_option(option: Option, key: str) -> float | str | None:
    unit = shown_unit(option.unit)
    words = option.name.removesuffix("_deg").removesuffix("_percent").removesuffix("_um").removesuffix("_hz")
    label = words.replace("_", " ").capitalize() + (f" ({unit})" if unit else "")
    if isinstance(option.default, str):
        choices = option.choices or tuple(f"bearing {i + 1}" for i in range(N_BEARINGS))
        index = choices.index(option.default) if option.default in choices else 0
        return st.selectbox(label, choices, index=index, key=key, help=option.meaning, persist_state="session")
    looks = {"key": key, "help": option.meaning, "persist_state": "session"}
    if option.whole:
        value = int(option.default or 0)
        return float(st.number_input(label, min_value=int(option.low or 0), value=value, step=1, **looks))  # type: ignore[call-overload]
    number = st.number_input(label, value=option.default, placeholder="drawn", format="%g", **looks)  # type: ignore[call-overload]
    return None if number is None else float(number)
