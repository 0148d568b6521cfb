"""The views of the two machines, of which only the open one is computed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from html import escape
from io import BytesIO
from math import isfinite

import numpy as np
import streamlit as st
from scipy.io import wavfile

from app.dashboard import address
from app.dashboard.components import component_of
from app.dashboard.laboratory import run as runs
from app.dashboard.laboratory.bifurcation import show_bifurcation
from app.dashboard.laboratory.run import LaboratoryRun
from app.dashboard.laboratory.setup import Setup, effect_text, slider_values
from app.dashboard.theme import palette
from app.dashboard.widgets.charts import FAULT, MEASURED, SHAFT, encoded, padded_limits, show_lines
from app.dashboard.widgets.spectrum import show_spectrum
from app.dashboard.widgets.texts import as_typed, capitalised
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.formatting import with_minus
from gearsig.indicators import crest_factor, kurtosis, rms
from gearsig.plot import ChartLine, Cursor, LinePanel
from gearsig.recording import Recording
from gearsig.spectra import Spectrum, amplitude_spectrum, band_envelope, envelope_spectrum
from sims.effects import effect
from sims.mesh import mesh_stiffness

HEIGHT_PX = 300
MOTION = {
    "driver, along the line of action": ("driver y", 1e6, "displacement (µm)"),
    "driven gear, along the line of action": ("driven y", 1e6, "displacement (µm)"),
    "transmission error": ("transmission_error_m", 1e6, "transmission error (µm)"),
    "mesh force": ("mesh_force_n", 1e-3, "mesh force (kN)"),
}
SEGMENTS = {"1 revolution": 1.0, "3 revolutions": 3.0, "all": float("inf")}


def show_time(healthy: LaboratoryRun, faulty: LaboratoryRun | None) -> None:
    """Show a signal of both machines, and the difference."""
    row = st.container(horizontal=True, vertical_alignment="bottom")  # which wraps where it is narrow
    names = (*healthy.vibration_channels, *MOTION)
    looks = {"format_func": _shown, "width": 320}
    name = address.ask_one(row.selectbox, "Signal", names, name="signal", **looks)
    looks = {"first": "3 revolutions", "name": "shown"}
    shown = address.ask_one(row.segmented_control, "Range shown (input shaft)", list(SEGMENTS), **looks)
    end = _end_s(healthy, SEGMENTS[shown])
    healthy_line, label = signal_of(healthy, name, end)
    if faulty is None:
        _show_line(healthy_line, "healthy", label, end)
        return
    faulty_line, _ = signal_of(faulty, name, end)
    limits = padded_limits([healthy_line[1], faulty_line[1]])
    left, right = st.container(key="panels of both machines over time").columns(2)
    with left:
        _show_line(healthy_line, "healthy", label, end, limits, height_px=HEIGHT_PX)
    with right:
        _show_line(faulty_line, "faulty", label, end, limits, height_px=HEIGHT_PX)
    st.markdown("**What the effect adds**: faulty minus healthy")
    difference = faulty_line[1] - healthy_line[1]
    limits, line = padded_limits([difference]), (healthy_line[0], difference)
    _show_line(line, "difference", label, end, limits, cursors=runs.entries(faulty), height_px=HEIGHT_PX)


def _show_line(
    line: tuple[FloatArray, FloatArray],
    name: str,
    label: str,
    end_s: float,
    limits: tuple[float, float] | None = None,
    *,
    cursors: Sequence[Cursor] = (),
    height_px: int = 340,
) -> None:
    lines = [ChartLine(*line, name, MEASURED if name == "healthy" else FAULT)]
    panel = LinePanel(lines, "time (s)", label, limits, cursors=cursors, x_limits=(0.0, end_s))
    show_lines(panel, f"time of {name}", height_px=height_px)


def signal_of(run: LaboratoryRun, name: str, end_s: float) -> tuple[tuple[FloatArray, FloatArray], str]:
    """Return (time, values) of a channel or of the motion up to `end_s`, and the name of the value axis."""
    if name in MOTION:
        signal, factor, unit = MOTION[name]
        time, values = run.response.time_s, factor * run.response[signal]
    else:
        values, unit = run.recording.values(name), "acceleration (m/s²)"
        time = np.arange(len(values)) / run.recording.sampling_rate_hz
    inside = time <= end_s
    return (time[inside], values[inside]), unit


def _shown(name: str) -> str:
    return capitalised(name) if name in MOTION else f"Sensor {name}"


def _end_s(run: LaboratoryRun, revolutions: float) -> float:
    turns = run.setup.revolutions_per_s
    return min(revolutions / turns if turns > 0 else float("inf"), run.setup.duration_s)


def telling_band_hz(recording: Recording, channel: str, expected_hz: Sequence[float]) -> tuple[float, float]:
    """Return the band (Hz) whose envelope spectrum has the expected lines highest above the median of the others.

    Parameters
    ----------
    recording : Recording
    channel : str
    expected_hz : sequence of float
        Lines; those for which the recording is too short are ignored.

    Raises
    ------
    RefusalError
        If no line is expected, or the signal is too short to resolve them.
    """
    values, rate = recording.values(channel), recording.sampling_rate_hz
    lines = np.array([f for f in expected_hz if f * recording.duration_s >= 3.0])
    if not len(lines):
        raise RefusalError("the signal is too short for the lines of shafts", remedy="show a longer one")
    # 16 equal parts of the spectrum, and all runs of one, two and four of them; a band must be clearly wider than the
    # lowest expected line
    width = rate / 2.0 / 16
    bands = [
        (i * width, (i + n) * width) for n in (1, 2, 4) for i in range(16 - n + 1) if n * width > 4.0 * lines.min()
    ] or [(0.0, rate / 2.0)]
    heights = [_height(values, rate, band, lines) for band in bands]
    return bands[int(np.argmax(heights))]


def _height(values: FloatArray, rate_hz: float, band_hz: tuple[float, float], lines_hz: FloatArray) -> float:
    """Return the sum of the lines' amplitudes over the median amplitude, in the envelope spectrum of a band."""
    spectrum = envelope_spectrum(band_envelope(values, rate_hz, band_hz))
    inside = spectrum.values[: spectrum.index_of(1.2 * float(lines_hz.max())) + 1]
    floor = float(np.median(inside))
    if floor <= 0.0:
        return 0.0
    slack = 2.0 * spectrum.resolution
    heights = [spectrum.largest_near(f, slack)[1] for f in lines_hz if f < float(spectrum.positions[-1])]
    return sum(heights) / floor


def show_amplitude(healthy: LaboratoryRun, faulty: LaboratoryRun | None, channel: str) -> None:
    """Show the amplitude spectra of a channel."""
    both = [healthy] if faulty is None else [healthy, faulty]
    spectra = [amplitude_spectrum(run.recording, channel) for run in both]
    cursors = runs.spectrum_cursors(both[-1])
    mesh = max((c.position for c in cursors if c.kind == "mesh"), default=0.0)
    _show_spectra(spectra, cursors, "spectrum", "amplitude", "Logarithmic", 1.04 * mesh)


def show_envelope(healthy: LaboratoryRun, faulty: LaboratoryRun | None, channel: str) -> None:
    """Show the envelope spectra of the band in which the marked lines stand out most."""
    both = [healthy] if faulty is None else [healthy, faulty]
    cursors = runs.envelope_cursors(both[-1])
    marked = [c.position for c in cursors if c.kind == "bearing"]
    try:
        band = telling_band_hz(both[-1].recording, channel, marked or runs.shaft_lines_hz(both[-1]))
    except RefusalError as error:
        st.info(f"There is no envelope spectrum: {error}")
        return
    spectra = [_envelope_spectrum(run.recording, channel, band) for run in both]
    lines = "defect" if marked else "shaft"
    st.markdown(
        f"Squared envelope of {channel} in the band **{band[0]:.0f} to {band[1]:.0f} Hz**, "
        f"where the lines of the {lines} stand out most."
    )
    # at first 12 revolutions of the input shaft, or all marked bearing lines
    end = max([12.0 * healthy.setup.revolutions_per_s, *(1.08 * f for f in marked)])
    _show_spectra(spectra, cursors, "envelope", "squared envelope", "Linear", end)


def _envelope_spectrum(recording: Recording, channel: str, band_hz: tuple[float, float]) -> Spectrum:
    values, rate = recording.values(channel), recording.sampling_rate_hz
    return envelope_spectrum(band_envelope(values, rate, band_hz, unit="m/s^2", source=channel))


def _show_spectra(
    spectra: Sequence[Spectrum], cursors: Sequence[Cursor], name: str, quantity: str, scale: str, first_end: float
) -> None:
    """Show both spectra overlaid, at first up to what is marked; another machine or speed resets the view."""
    end = min(first_end, float(spectra[0].positions[-1])) or float(spectra[0].positions[-1])
    show_spectrum(
        "the laboratory",
        spectra,
        cursors,
        f"{name}, first {first_end:.4g}",
        names=("healthy", "faulty"),
        shown=(0.0, end),
        scale=scale,
        quantity=quantity,
    )


BEFORE, AFTER = 1.5, 5.5
POINTS_PER_CYCLE = 250


def show_mesh(healthy: LaboratoryRun, faulty: LaboratoryRun | None) -> None:
    """Show stiffness and dynamic force of both machines over the same mesh cycles."""
    both = [healthy] if faulty is None else [healthy, faulty]
    shown, marks = _segment(both[-1])
    cycles = np.linspace(*shown, round((shown[1] - shown[0]) * POINTS_PER_CYCLE) + 1)
    st.markdown("**Mesh stiffness** of the tooth pairs in contact")
    if both[0].setup.torque_nm > 0:
        curves = [stiffness(run, cycles) * 1e-8 for run in both]
        _show_over_cycles(cycles, curves, "mesh stiffness (10⁸ N/m)", marks, "stiffness of the laboratory")
        if len(curves) > 1 and np.allclose(curves[0], curves[1], rtol=1e-6):
            st.caption("The active effects do not change the stiffness.")
    else:
        st.info("Without a load the teeth are not pressed together: there is no stiffness to show.")
    st.markdown("**Dynamic mesh force** over the same teeth")
    forces = [_force_kn(run, cycles) for run in both]
    _show_over_cycles(cycles, forces, "mesh force (kN)", marks, "force of the laboratory")


def _show_over_cycles(cycles: FloatArray, curves: list[FloatArray], y: str, marks: Sequence[Cursor], key: str) -> None:
    x, shown = "mesh cycles (tooth k of the driver enters at k − 1)", (float(cycles[0]), float(cycles[-1]))
    limits = padded_limits(curves, flat=0.1)
    panel = LinePanel(_lines(cycles, curves), x, y, limits, cursors=marks, x_limits=shown)
    show_lines(panel, key, height_px=HEIGHT_PX)


def stiffness(run: LaboratoryRun, cycles: FloatArray) -> FloatArray:
    """Return the tangent stiffness at the static mesh force, in N/m."""
    if run.pair is not None:
        return run.pair.maps(np.array([run.setup.torque_nm]), cycles).tangent_stiffness_n_per_m[:, 0]
    mesh = run.machine.mesh
    force_n = run.setup.torque_nm / (mesh.pair.driver.base_radius_mm * 1e-3)
    return mesh_stiffness(mesh, cycles, force_n).total_n_per_m


def _segment(run: LaboratoryRun) -> tuple[tuple[float, float], list[Cursor]]:
    """Return the mesh cycles around the first faulty tooth that passes in the run; without one, the run's first."""
    teeth, cycles = runs.faulty_teeth(run.setup), run.mesh_cycles
    pair = run.machine.mesh.pair
    first = float(np.ceil(cycles[0])) + BEFORE
    if not teeth:
        return (first - BEFORE, first + AFTER), []
    side, tooth = teeth[0]
    n_teeth = pair.driver.teeth if side == "driver" else pair.driven.teeth
    enters = tooth - 1 + float(np.ceil((first - tooth + 1) / n_teeth)) * n_teeth
    return (enters - BEFORE, enters + AFTER), [Cursor(enters, "finding", f"{side} tooth {tooth} enters")]


def _force_kn(run: LaboratoryRun, cycles: FloatArray) -> FloatArray:
    force: FloatArray = np.interp(
        cycles, run.mesh_cycles, 1e-3 * run.response["mesh_force_n"], left=np.nan, right=np.nan
    )
    return force


def _lines(x: FloatArray, curves: list[FloatArray]) -> list[ChartLine]:
    """Return both lines, the faulty one in front: where they coincide, nothing changed."""
    lines = []
    for place, values in enumerate(curves):
        known = np.isfinite(values)
        if known.any():
            lines.append(ChartLine(x[known], values[known], ("healthy", "faulty")[place], place))
    return lines


MESH_PERIOD = "mesh period"
GEARS = {"Driver": "driver y", "Driven gear": "driven y"}
STROBES = {MESH_PERIOD: None, "revolution of the input shaft": 1.0}
MAX_POINTS = 10_000
"""Maximum number of points, which a browser without a graphics card can still draw at once."""
REVOLUTIONS = 1.3
"""Length of the line, so that every tooth is on it; the points cover the whole run."""
Portrait = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def show_phase(healthy: LaboratoryRun, faulty: LaboratoryRun | None) -> None:
    """Show the phase portraits of one gear along the line of action."""
    row = st.container(horizontal=True)  # which wraps where it is narrow
    gear = address.ask_one(row.segmented_control, "Gear", list(GEARS), name="gear")
    strobe = address.ask_one(row.segmented_control, "A point once per", list(STROBES), name="strobe")
    n = STROBES[strobe] or healthy.machine.mesh.pair.driver.teeth
    both = [healthy] if faulty is None else [healthy, faulty]
    portraits = [portrait(run, GEARS[gear], n) for run in both]
    limits = [padded_limits([p[axis] for p in portraits]) for axis in (0, 1)]
    places = st.container(key="panels of the phase portraits").columns(2)
    for column, (y, v, y_points, v_points), name in zip(places, portraits, ("healthy", "faulty"), strict=False):
        path = ChartLine(y, v, name, MEASURED if name == "healthy" else FAULT)
        dots = ChartLine(y_points, v_points, "Poincaré points", SHAFT, dots=True)
        with column:
            panel = LinePanel(
                [path, dots], "displacement (µm)", "velocity (mm/s)", limits[1], x_limits=limits[0], is_plane=True
            )
            show_lines(panel, f"phase of {name}", legend=True)
    st.caption(
        "Along the line of action. A closed curve repeats every mesh period, and its points coincide; "
        "scattered points mean a motion that does not repeat."
    )


def portrait(run: LaboratoryRun, signal: str, n_per_revolution: float) -> Portrait:
    """Return displacement (µm) and velocity (mm/s), and both at the strobes."""
    response = run.response
    y, v = 1e6 * response[signal], 1e3 * response[f"{signal} velocity"]
    index = runs.times_of(run, response.time_s, runs.lines_per_period(run, n_per_revolution))
    points = [np.interp(index, response.time_s, values) for values in (y, v)]
    turned = float(np.ptp(response["driver angle"])) / (2.0 * np.pi)
    n = len(y) if turned <= REVOLUTIONS else round(len(y) * REVOLUTIONS / turned)
    every = -(-n // MAX_POINTS)
    return y[-n::every], v[-n::every], points[0], points[1]


# The pair drawn and turning, in step with a cursor in its signal; the sound of both machines.

_gears = component_of("gears")
N_POINTS = 3000
LISTEN_HZ = 44100
"""Sampling rate of the sound: slow machines are heard at their own pace."""


def show_gears(healthy: LaboratoryRun, faulty: LaboratoryRun | None, channel: str) -> None:
    """Show both gears near the mesh with the force between them, and the channel below; offer both as sound."""
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
    values = [_over_cycles(run, channel, shown) for run in both]
    named = zip(("healthy", "faulty"), (colours.measured, colours.fault), values, forces, strict=False)
    lines = [
        {"name": name, "colour": colour, "x": encoded(shown), "y": encoded(y), "force": encoded(force)}
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
    st.caption("In slow motion. The arrow is the mesh force" + ("; the coloured tooth is faulty." if teeth else "."))
    largest = max(float(np.abs(run.recording.values(channel)).max()) for run in both) or 1.0
    for column, run, name in zip(st.columns(2), both, ("Healthy", "Faulty"), strict=False):
        with column:
            st.caption(f"{name}, as heard by the sensor")
            st.audio(_sound(run, channel, largest))


def _over_cycles(run: LaboratoryRun, channel: str, cycles: FloatArray) -> FloatArray:
    """Return the channel over mesh cycles."""
    time = np.interp(cycles, run.mesh_cycles, run.response.time_s)
    values = run.recording.values(channel)
    return np.interp(time, np.arange(len(values)) / run.recording.sampling_rate_hz, values)


def _sound(run: LaboratoryRun, channel: str, largest: float) -> bytes:
    """Return two seconds of the channel as WAV, on the same loudness scale for both machines, repeated if shorter.

    Streamlit would bring an array to full loudness, and the faulty machine would sound no louder than the healthy one.
    """
    values, rate_hz = run.recording.values(channel) / largest, run.recording.sampling_rate_hz
    n = round(LISTEN_HZ * min(2.0, len(values) / rate_hz))
    once = np.interp(np.arange(n) / LISTEN_HZ, np.arange(len(values)) / rate_hz, values)
    file = BytesIO()
    sound = np.tile(32767 * once, max(1, round(2.0 * LISTEN_HZ / n)))
    wavfile.write(file, LISTEN_HZ, sound.astype(np.int16))
    return file.getvalue()


View = Callable[[LaboratoryRun, LaboratoryRun | None, str], None]
VIEWS: dict[str, View] = {
    "Gears": show_gears,
    "Time": lambda healthy, faulty, _: show_time(healthy, faulty),
    "Spectrum": show_amplitude,
    "Envelope": show_envelope,
    "Phase portrait": lambda healthy, faulty, _: show_phase(healthy, faulty),
    "Bifurcation": lambda healthy, faulty, _: show_bifurcation(faulty or healthy),
    "Mesh": lambda healthy, faulty, _: show_mesh(healthy, faulty),
}
TAB = "tab of the laboratory"


def show_views(healthy: LaboratoryRun, faulty: LaboratoryRun | None, channel: str) -> None:
    """Show the views as tabs; what the user changes in one reruns only this."""
    for name, tab in zip(VIEWS, address.tabs(list(VIEWS), key=TAB), strict=True):
        if tab.open:
            with tab:
                st.fragment(VIEWS[name])(healthy, faulty, channel)


Number = Callable[[LaboratoryRun, str], float]


def _of_channel(function: Callable[[FloatArray], float]) -> Number:
    return lambda run, channel: function(run.recording.values(channel))


NUMBERS: dict[str, tuple[str, Number]] = {
    "Vibration, rms": ("m/s²", _of_channel(rms)),
    "Kurtosis": ("", _of_channel(kurtosis)),
    "Crest factor": ("", _of_channel(crest_factor)),
    "Mesh force, mean": ("N", lambda run, _: float(run.response["mesh_force_n"].mean())),
    "Transmission error, range": ("µm", lambda run, _: 1e6 * float(np.ptp(run.response["transmission_error_m"]))),
}


def mark_slider_values() -> None:
    """Record which slider values the results are for: the page's script fades them while a slider differs."""
    st.html(f'<i class="of-page of-sliders" data-values="{escape(json.dumps(slider_values()))}"></i>')


def show_title(setup: Setup, *, is_shown: bool) -> None:
    """Show what is switched on; `is_shown` if the faulty machine could be simulated."""
    title = " + ".join(effect_text(s) for s in setup.effects if s.severity > 0) if is_shown else ""
    otherwise = "Healthy: nothing is switched on" if setup.is_healthy else "The healthy machine alone"
    st.subheader(as_typed(capitalised(title) or otherwise), anchor=False)


def show_expectation(healthy: LaboratoryRun, faulty: LaboratoryRun | None) -> None:
    """Show where theory expects the active effects, and the recording's warnings."""
    on = [effect(setting.name) for setting in faulty.setup.effects if setting.severity > 0] if faulty else []
    if not on:
        st.markdown("Move the crack slider or choose an effect: the faulty machine then appears beside this one.")
    elif len(on) == 1:
        st.markdown(as_typed(on[0].signature))
    else:
        with st.expander("Where theory expects them", icon=":material/menu_book:"):
            for known in on:
                st.markdown(f"**{as_typed(capitalised(known.title))}.** {as_typed(known.signature)}")
    for note in (faulty or healthy).recording.warnings:
        st.caption(f":material/info: {as_typed(note)}")


def frequencies(run: LaboratoryRun) -> list[str]:
    """Return the operating point and the frequencies of mesh, shafts and defective bearings, as texts."""
    turns, rig = run.setup.revolutions_per_s, run.rig
    pair = rig.pairs[0]
    words = [f"{run.setup.speed_rpm:g} rpm, {run.setup.torque_nm:g} N·m"]
    words.append(f"mesh {(rig.mesh_order(pair) or 0.0) * turns:.5g} Hz")
    words += [f"{name} shaft {(rig.ratio(name) or 0.0) * turns:.4g} Hz" for name in rig.shaft_names]
    words += [f"{as_typed(name)} {frequency:.4g} Hz" for name, frequency in runs.bearing_lines_hz(run).items()]
    # A number and its unit stay on one line.
    return [word.replace(" Hz", "\u00a0Hz") for word in words]


def show_numbers(healthy: LaboratoryRun, faulty: LaboratoryRun | None, channel: str) -> None:
    """Show the numbers of the faulty machine, with the healthy one's below them."""
    show_metrics(
        {
            name: (unit, number(healthy, channel), None if faulty is None else number(faulty, channel))
            for name, (unit, number) in NUMBERS.items()
        }
    )


def show_metrics(numbers: Mapping[str, tuple[str, float, float | None]]) -> None:
    """Show numbers of the faulty machine, with the healthy one's below; name → unit, healthy, faulty."""
    with st.container(horizontal=True):
        for name, (unit, healthy, faulty) in numbers.items():
            if faulty is None:
                st.metric(capitalised(name), _with_unit(healthy, unit))
                continue
            below = f"healthy {_with_unit(healthy, unit)}{change(healthy, faulty)}"
            st.metric(capitalised(name), _with_unit(faulty, unit), below, delta_color="off", delta_arrow="off")


def show_legend() -> None:
    """Show the legend of colours, once for all charts."""
    colours = palette()
    swatch = '<span style="color:{}">━━</span> {}'
    words = (swatch.format(colours.measured, "healthy"), swatch.format(colours.fault, "faulty"))
    st.html("&emsp;".join(words) + "&emsp;<small>same random numbers: only the effect differs</small>", width="content")


def _with_unit(value: float, unit: str) -> str:
    return f"{value:.4g} {unit}".rstrip() if isfinite(value) else "not known"


def change(old: float, new: float) -> str:
    """Return a relative change as text, e.g. " (+12 %)"; empty if the old value is 0.

    Examples
    --------
    >>> change(2.0, 2.5), change(2.0, 2.0001), change(0.0, 1.0)
    (' (+25 %)', ' (±0 %)', '')
    """
    if not old or not np.isfinite(new / old):
        return ""
    percent = 100.0 * (new / old - 1.0)
    if abs(percent) < 0.05:
        return " (±0 %)"
    return with_minus(f" ({percent:+.2g} %)") if abs(percent) < 100 else f" ({new / old:.3g} ×)"
