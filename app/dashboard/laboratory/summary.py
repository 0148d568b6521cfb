"""The answer on top of the laboratory: what is switched on, where theory expects it, and what changed in numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import streamlit as st

from app.dashboard.as_typed import as_typed
from app.dashboard.laboratory.expected import bearing_lines_hz
from app.dashboard.laboratory.run import Run
from app.dashboard.laboratory.setup import effect_text
from app.dashboard.look import palette
from gearsig.checks import FloatArray
from gearsig.indicators.time import crest_factor, kurtosis, rms
from sims.effects import EffectSetting, effect

Number = Callable[[Run, str], float]


def _of_channel(function: Callable[[FloatArray], float]) -> Number:
    return lambda run, channel: function(run.recording.values(channel))


NUMBERS: dict[str, tuple[str, Number]] = {
    "Vibration, rms": ("m/s²", _of_channel(rms)),
    "Kurtosis": ("", _of_channel(kurtosis)),
    "Crest factor": ("", _of_channel(crest_factor)),
    "Mesh force, mean": ("N", lambda run, _: float(run.response["mesh_force_n"].mean())),
    "Transmission error, range": ("µm", lambda run, _: 1e6 * float(np.ptp(run.response["transmission_error_m"]))),
}


def show_title(healthy: Run, faulty: Run | None, *, impossible: bool) -> None:
    """Show what is on, and how the machine runs; `impossible` if the faulty machine cannot be."""
    title = " + ".join(effect_text(setting) for setting in _switched_on(faulty))
    otherwise = "The healthy machine alone" if impossible else "Healthy: nothing is switched on"
    st.subheader(as_typed(title[:1].upper() + title[1:] or otherwise), anchor=False)
    st.caption(" · ".join(frequencies(faulty or healthy)))


def show_expectation(healthy: Run, faulty: Run | None) -> None:
    """Show where theory expects what is on, and what to mind."""
    on = _switched_on(faulty)
    if not on:
        st.markdown("Pull the crack slider or choose an effect: the faulty machine appears beside this one.")
    elif len(on) == 1:
        st.markdown(as_typed(effect(on[0].name).signature))
    else:
        with st.expander("Where theory expects them", icon=":material/menu_book:"):
            for setting in on:
                found = effect(setting.name)
                st.markdown(f"**{as_typed(found.title[:1].upper() + found.title[1:])}.** {as_typed(found.signature)}")
    for note in (faulty or healthy).recording.warnings:
        st.caption(f":material/info: {as_typed(note)}")


def _switched_on(faulty: Run | None) -> list[EffectSetting]:
    return [setting for setting in faulty.setup.effects if setting.severity > 0] if faulty else []


def frequencies(run: Run) -> list[str]:
    """Return the frequencies of mesh, shafts and struck bearings, for people."""
    turns, rig = run.setup.revolutions_per_s, run.rig
    pair = rig.pairs[0]
    words = [f"{run.setup.speed_rpm:g} rpm, {run.setup.torque_nm:g} N·m"]
    words.append(f"mesh {(rig.mesh_order(pair) or 0.0) * turns:.5g} Hz")
    words += [f"{name} shaft {(rig.ratio(name) or 0.0) * turns:.4g} Hz" for name in rig.shaft_names]
    words += [f"{as_typed(name)} {frequency:.4g} Hz" for name, frequency in bearing_lines_hz(run).items()]
    # A number and its unit stay on one line.
    return [word.replace(" Hz", "\u00a0Hz") for word in words]


def show_numbers(healthy: Run, faulty: Run | None, channel: str) -> None:
    """Show the numbers of the faulty machine, with the healthy one's below them."""
    with st.container(horizontal=True):
        for name, (unit, number) in NUMBERS.items():
            own = number(healthy, channel)
            if faulty is None:
                st.metric(name, shown(own, unit))
                continue
            value = number(faulty, channel)
            below = f"healthy {shown(own, unit)}{change(own, value)}"
            st.metric(name, shown(value, unit), below, delta_color="off", delta_arrow="off")


def show_legend() -> None:
    """Say which colour is which, once for all charts."""
    colours = palette()
    swatch = '<span style="color:{}">━━</span> {}'
    words = (swatch.format(colours.measured, "healthy"), swatch.format(colours.fault, "faulty"))
    st.html(
        "&emsp;".join(words) + "&emsp;<small>same random numbers: what differs is the effect</small>", width="content"
    )


def shown(value: float, unit: str) -> str:
    """Write a number with its unit."""
    return f"{value:.4g} {unit}".rstrip()


def change(old: float, new: float) -> str:
    """Write a relative change, e.g. " (+12 %)"; nothing where the old value is 0.

    Examples
    --------
    >>> change(2.0, 2.5), change(2.0, 2.0001), change(0.0, 1.0)
    (' (+25 %)', ' (±0 %)', '')
    """
    if not old or not np.isfinite(new / old):
        return ""
    percent = 100.0 * (new / old - 1.0)
    return (
        " (±0 %)" if abs(percent) < 0.05 else f" ({percent:+.2g} %)" if abs(percent) < 100 else f" ({new / old:.3g} ×)"
    )
