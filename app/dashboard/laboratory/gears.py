"""The gear pair drawn and turning, in step with a cursor in its signal; healthy and faulty to listen to."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard.components import component_of
from app.dashboard.laboratory import run as runs
from app.dashboard.laboratory.run import LaboratoryRun
from app.dashboard.theme import palette
from app.dashboard.widgets.charts import packed
from gearsig.checks import FloatArray

_gears = component_of("gears")
N_POINTS = 3000
LISTEN_HZ = 44100
"""Rate of what is listened to: slow machines are heard at their own pace."""


def show_gears(healthy: LaboratoryRun, faulty: LaboratoryRun | None, channel: str) -> None:
    """Show both gears about the mesh with the force between them, and the channel below; offer both as sound."""
    both = [healthy] if faulty is None else [healthy, faulty]
    pair, cycles = both[-1].machine.mesh.pair, both[-1].mesh_cycles
    teeth = runs.faulty_teeth(both[-1].setup)
    n = pair.driver.teeth
    if teeth:
        side, tooth = teeth[0]
        n = pair.driver.teeth if side == "driver" else pair.driven.teeth
        enters = tooth - 1 + float(np.ceil((cycles[0] + 6 - tooth + 1) / n)) * n
    else:
        enters = float(np.ceil(cycles[0])) + 6
    shown = np.linspace(enters - 6, min(enters + 14, float(cycles[-1])), N_POINTS)
    colours = palette()
    forces = [np.interp(shown, run.mesh_cycles, run.response["mesh_force_n"]) for run in both]
    values = [_of_channel(run, channel, shown) for run in both]
    named = zip(("healthy", "faulty"), (colours.measured, colours.fault), values, forces, strict=False)
    lines = [
        {"name": name, "colour": colour, "x": packed(shown), "y": packed(y), "force": packed(force)}
        for name, colour, y, force in named
    ]
    cracked = dict.fromkeys(("driver", "driven"), 0) | dict(teeth)
    _gears(
        key="gears of the laboratory",
        data={
            "teeth": [pair.driver.teeth, pair.driven.teeth],
            "cracked": cracked,
            "lines": lines,
            "force": float(max(np.abs(force).max() for force in forces)) or 1.0,
            "start": enters,
            "label": f"sensor {channel} (m/s²)",
            "colours": {"measured": colours.measured, "fault": colours.fault},
        },
    )
    st.caption("Turned a few hundred times slower. The arrow is the mesh force; the coloured tooth is the faulty one.")
    largest = max(float(np.abs(run.recording.values(channel)).max()) for run in both) or 1.0
    for column, run, name in zip(st.columns(2), both, ("Healthy", "Faulty"), strict=False):
        with column:
            st.caption(f"{name}, as the sensor hears it")
            st.audio(_sound(run, channel, largest), sample_rate=LISTEN_HZ)


def _of_channel(run: LaboratoryRun, channel: str, cycles: FloatArray) -> FloatArray:
    """Return the channel over mesh cycles."""
    time = np.interp(cycles, run.mesh_cycles, run.response.time_s)
    values = run.recording.values(channel)
    return np.interp(time, np.arange(len(values)) / run.recording.sampling_rate_hz, values)


def _sound(run: LaboratoryRun, channel: str, largest: float) -> FloatArray:
    """Return two seconds of the channel, of the same loudness scale for both machines, repeated where it is shorter."""
    values, rate_hz = run.recording.values(channel) / largest, run.recording.sampling_rate_hz
    n = round(LISTEN_HZ * min(2.0, len(values) / rate_hz))
    once = np.interp(np.arange(n) / LISTEN_HZ, np.arange(len(values)) / rate_hz, values)
    return np.tile(once, max(1, round(2.0 * LISTEN_HZ / n)))
