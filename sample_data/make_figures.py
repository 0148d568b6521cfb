"""Draw the figures of the cracked spur pair: `python sample_data/make_figures.py [NAME …]`.

Machine: preset "published_55_75". Every run draws the same random phases, so that cases differ in one thing only.
"""

from __future__ import annotations

import sys
from functools import cache
from io import BytesIO
from pathlib import Path
from subprocess import run
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image
from scipy.interpolate import CubicSpline

from gearsig.checks import FloatArray
from gearsig.plot import (
    ResponseCase,
    backlash_figure,
    crack_comparison_figure,
    friction_figure,
    mesh_stiffness_figure,
    response_figure,
)
from gearsig.spectra import amplitude_spectrum
from sims.cracked import Response, respond
from sims.gear_pair import PARAMETERS, build_machine
from sims.machine import Machine
from sims.mesh import FractalSurface, TimeLockedRoughness, friction_over_mesh, mesh_stiffness
from sims.presets import preset
from sims.simulator import ParameterValue, complete_values

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = Path(__file__).parent / "pictures"
PRESET = preset("cracked", "published_55_75")
RPM, TORQUE_NM = PRESET.speed_rpm, PRESET.torque_nm
ROUGHNESS_UM = (0.0, 0.45, 0.84, 1.40)
CRACKS_MM = (0, 1, 2, 3, 4)
CRACKED_TOOTH = 20  # from 0, as mesh cycles count; the parameter counts from 1
SEED = 1
SETTLING_S = 0.5
FELT = 0.01
"""The reach of a crack ends where the change stays below this part of the healthy gear's rms for a mesh cycle."""


def machine(**changed: ParameterValue) -> Machine:
    """Return the preset's machine with some values changed."""
    return build_machine(complete_values(PARAMETERS, PRESET.parameters, changed))


def rough(roughness_um: float) -> Machine:
    """Return it with a roughness; smooth flanks run without friction, as in the study."""
    return machine(roughness_um=roughness_um, friction="on" if roughness_um > 0 else "off")


def cracked(depth_mm: float) -> Machine:
    """Return it with a crack in one tooth of the pinion."""
    return machine(crack_depth_mm=depth_mm, crack_tooth=CRACKED_TOOTH + 1)


def named(depth_mm: float) -> str:
    """Name a crack."""
    return f"crack {depth_mm:g} mm" if depth_mm else "no crack"


def mesh_stiffness_cracks() -> Figure:
    """Stiffness while the cracked tooth passes; tooth 20 enters at 20 mesh cycles, drawn as 0."""
    mesh = machine().mesh
    cycles = np.linspace(-1.5, 3.0, 1801)
    curves = {named(d): mesh_stiffness(cracked(d).mesh, cycles + CRACKED_TOOTH).total_n_per_m for d in CRACKS_MM}
    alone = (mesh.pair.contact_ratio - 1.0 + mesh.ramp / 2.0, 1.0 - mesh.ramp / 2.0)
    title = "Mesh stiffness of 55/75 teeth while a cracked pinion tooth passes (it enters at 0)"
    return mesh_stiffness_figure(cycles, curves, single_pair=alone, title=title)


def friction_roughness() -> Figure:
    """Friction coefficient of one pair from entry to exit, signed by the direction of sliding."""
    mesh, viscosity = machine().mesh, machine().lubrication.viscosity_cp
    pair = mesh.pair
    cycles = np.linspace(0.0, pair.contact_ratio, 601)
    slot = np.floor(cycles + mesh.ramp / 2.0).astype(int)
    curves = {}
    for roughness in ROUGHNESS_UM:
        found = friction_over_mesh(mesh, TORQUE_NM, RPM, viscosity, roughness, cycles)
        signed = found.coefficient * np.sign(found.sliding_mps)
        curves[f"{roughness:.2f} µm"] = signed[np.arange(len(cycles)), np.minimum(slot, mesh.n_slots - 1)]
    return friction_figure(
        cycles,
        curves,
        pitch_point=(pair.pitch_point_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm,
        single_pair=(pair.contact_ratio - 1.0, 1.0),
        heading="roughness Rq",
        title=f"Friction coefficient of a tooth pair, {RPM:g} rpm, {TORQUE_NM:g} N m (shaded: it carries alone)",
    )


def backlash_roughness() -> Figure:
    """Backlash locked to time, and the lines that it consists of."""
    rate_hz, half_m = 8192.0, machine().half_backlash_um * 1e-6
    time = np.arange(round(4.0 * rate_hz)) / rate_hz
    curves, amplitudes = {}, {}
    for roughness in ROUGHNESS_UM:
        profile = TimeLockedRoughness.draw(FractalSurface.of_roughness(roughness), np.random.default_rng(SEED))
        change = profile.height_m(time)
        spectrum = amplitude_spectrum(change, rate_hz)
        shown = (spectrum.positions > 12.0) & (spectrum.positions < 2500.0)
        curves[f"{roughness:.2f} µm"] = half_m + change[time < 0.4]
        amplitudes[f"{roughness:.2f} µm"] = spectrum.values[shown]
    return backlash_figure(
        time[time < 0.4],
        curves,
        spectrum.positions[shown],
        amplitudes,
        lines_hz=profile.frequencies_hz.tolist(),
        mesh_frequency_hz=mesh_frequency_hz(),
        heading="roughness Rq",
        title="Half backlash b(t) = b₀ + Δb(t), and the spectrum of Δb with its lines (Hz)",
    )


def response_roughness() -> Figure:
    """Pinion's displacement at four roughnesses: time, spectrum, phase portrait."""
    lines = TimeLockedRoughness.draw(FractalSurface.of_roughness(1.0), np.random.default_rng(SEED)).frequencies_hz
    return response_figure(
        [response_case(roughness) for roughness in ROUGHNESS_UM],
        mesh_frequency_hz=mesh_frequency_hz(),
        lines_hz=lines.tolist(),
        title=f"Pinion along the line of action, {RPM:g} rpm, {TORQUE_NM:g} N m, by flank roughness (▾: its lines)",
    )


def crack_comparison() -> Figure:
    """Pinion's acceleration over three revolutions at five crack depths, at equal angles."""
    n_teeth = machine().mesh.pair.driver.teeth
    revolutions = np.arange(4.0, 7.0, 1.0 / (n_teeth * 100))
    values = {}
    for depth in CRACKS_MM:
        run = steady(cracked(depth), 1.1, "driver angle", "driver y acceleration")
        turned = run["driver angle"] / (2.0 * np.pi)
        values[named(depth)] = CubicSpline(turned, run["driver y acceleration"])(revolutions)
    healthy = values[named(0)]
    change = {name: a - healthy for name, a in values.items() if name != named(0)}
    entry = CRACKED_TOOTH / n_teeth
    cycles = (revolutions - 5.0 - entry) * n_teeth
    reach = {name: felt_until(cycles, a, FELT * float(np.std(healthy))) for name, a in change.items()}
    print({name: (round(value, 2), round(float(np.abs(change[name]).max()))) for name, value in reach.items()})  # noqa: T201
    return crack_comparison_figure(
        revolutions,
        values,
        impacts_rev=[4.0 + entry, 5.0 + entry, 6.0 + entry],
        n_teeth=n_teeth,
        change_mps2=change,
        reach_cycles=reach,
        zoom_cycles=(-2.0, 8.0),
        title=f"Acceleration of the pinion along the line of action, {RPM:g} rpm, {TORQUE_NM:g} N m, Rq 0.45 µm",
    )


def felt_until(cycles: FloatArray, change: FloatArray, least: float) -> float:
    """Mesh cycles from the cracked tooth's entry until the change stays below `least` for a whole mesh cycle."""
    last = 0.0
    while last < 30.0:
        above = cycles[(cycles > last) & (cycles <= last + 1.0) & (np.abs(change) > least)]
        if not len(above):
            break
        last = float(above.max())
    return last


def response_case(roughness_um: float) -> ResponseCase:
    """Run at a roughness; states once per mesh period of the mean rotation."""
    signals = ("driver angle", "driver y", "driver y velocity")
    rig = rough(roughness_um)
    run = steady(rig, SETTLING_S + 4.0, *signals)
    settled = run.time_s > SETTLING_S
    time = run.time_s[settled] - SETTLING_S
    angle, y, v = (run[name][settled] for name in signals)
    spectrum = amplitude_spectrum(y - y.mean(), 1.0 / run.interval_s, window="blackman-harris")
    # The mean rotation: the angle itself swings with the mesh, and a section on it would follow the swing.
    slope, start = np.polyfit(time, angle * rig.mesh.pair.driver.teeth / (2.0 * np.pi), 1)
    strobe = (np.arange(np.ceil(start), np.ceil(start) + 400.0) - start) / slope
    shown = time < 0.2
    return ResponseCase(
        f"Rq {roughness_um:.2f} µm" + ("" if roughness_um else ", no friction"),
        time[shown],
        y[shown],
        v[shown],
        spectrum.positions,
        spectrum.values,
        CubicSpline(time, y)(strobe),
        CubicSpline(time, v)(strobe),
    )


def steady(rig: Machine, duration_s: float, *signals: str) -> Response:
    """Run at the preset's speed and torque."""
    rng = np.random.default_rng(SEED)
    return respond(rig, PRESET.operation, duration_s=duration_s, rng=rng, signals=signals)


@cache
def mesh_frequency_hz() -> float:
    """Return the teeth that pass per second."""
    return RPM / 60.0 * machine().mesh.pair.driver.teeth


FIGURES = {
    "mesh_stiffness_cracks": mesh_stiffness_cracks,
    "friction_roughness": friction_roughness,
    "backlash_roughness": backlash_roughness,
    "response_roughness": response_roughness,
    "crack_comparison": crack_comparison,
}


def bifurcation() -> None:
    """Run the README's command, and keep its figure."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "app.cli.main", "bifurcation", "cracked", "--preset", "symmetric_50_50"]
        settings = ["--torque", "20Nm", "--set", "roughness_um=0", "--set", "friction=off"]
        run([*command, *settings, "--vary", "speed=1400..2600rpm:49", "-o", folder], check=True)
        save_pixels(Path(folder) / "bifurcation.png", PICTURES / "bifurcation.png")


def save(figure: Figure, path: Path) -> None:
    """Write a figure as a PNG."""
    pixels = BytesIO()
    figure.savefig(pixels, format="png")
    save_pixels(pixels, path)


def save_pixels(pixels: BytesIO | Path, path: Path) -> None:
    """Write a PNG with a palette: a third of the size."""
    image = Image.open(pixels).convert("RGB").quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
    # Counting colours shifts white by one step, which shows as a grey sheet on a white page.
    image.putpalette([255 if part > 251 else part for part in image.getpalette() or ()])
    image.save(path, format="png", optimize=True)


def main() -> None:
    """Write all figures, or those that are named."""
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or (*FIGURES, "bifurcation"):
        if name == "bifurcation":
            bifurcation()
        else:
            save(FIGURES[name](), PICTURES / f"{name}.png")


if __name__ == "__main__":
    main()
