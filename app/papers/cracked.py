"""The cracked spur pair: friction, backlash, stiffness with friction and cracks, responses, time and frequency.

Machine: preset "published_55_75". Every run draws the same random phases, so that cases differ in only one respect.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import resample_poly

from app.papers import Paper, PaperFigure, Progress, judged, within_part
from gearsig import indicators, plot
from gearsig.checks import FloatArray
from gearsig.decompose import VmdSettings, vmd
from gearsig.plot import ResponseCase, curve_panel, panels_figure
from gearsig.spectra import amplitude_spectrum
from gearsig.timefreq import UniformSignal, squeezed_cwt_map
from sims.cracked import Response, eigenfrequencies_hz, respond
from sims.fe_gear import compare_crack_laws, crack_added_m_per_n, ready_gear
from sims.gear_pair import PARAMETERS, build_machine
from sims.machine import Machine, Operation
from sims.mesh import (
    FractalSurface,
    RootCrack,
    TimeLockedRoughness,
    friction_compliance,
    friction_over_mesh,
    mesh_stiffness,
)
from sims.presets import preset
from sims.simulator import ParameterValue, complete_values

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRESET = preset("cracked", "published_55_75")
RPM, TORQUE_NM = PRESET.speed_rpm, PRESET.torque_nm
ROUGHNESS_UM = (0.0, 0.45, 0.84, 1.40)
CRACKS_MM = (0, 1, 2, 3, 4)
CRACKED_TOOTH = 20  # from 0, as mesh cycles count; the parameter counts from 1
SEED = 1
SETTLING_S = 0.5
REACH_THRESHOLD = 0.01
"""The effect of a crack ends once the change stays below this fraction of the healthy rms for a mesh cycle."""
PUBLISHED_LINES_HZ = (17.9, 26.9, 39.4, 59.1, 89.6, 133.4, 200.5, 300.8, 451.2, 667.7, 1016.0, 1524.0)
SOURCE = (
    "Vibration characteristics of a spur gear system with a root crack, time-varying friction and dynamic backlash: 16 "
    "degrees of freedom, experiment on 55/75 teeth (its tables of parameters are not at hand)"
)


def machine(**changed: ParameterValue) -> Machine:
    """Return the machine of the preset with some values changed."""
    return build_machine(complete_values(PARAMETERS, PRESET.parameters, changed))


SOFT_SUPPORTS: Mapping[str, ParameterValue] = {"bending_stiffness_n_per_m": 2e7, "bearing_stiffness_n_per_m": 2e7}
"""A tenth of the shaft and bearing stiffness assumed by the preset."""


def rough(roughness_um: float, **changed: ParameterValue) -> Machine:
    """Return the machine with a roughness; smooth flanks run without friction, as in the study."""
    return machine(roughness_um=roughness_um, friction="on" if roughness_um > 0 else "off", **changed)


def cracked(depth_mm: float) -> Machine:
    """Return the machine with a crack in one tooth of the pinion."""
    return machine(crack_depth_mm=depth_mm, crack_tooth=CRACKED_TOOTH + 1)


def crack_name(depth_mm: float) -> str:
    """Return the name of a crack depth for legends."""
    return f"crack {depth_mm:g} mm" if depth_mm else "no crack"


def rq_name(roughness_um: float) -> str:
    """Return the name of a roughness for legends."""
    return f"{roughness_um:.2f} µm"


def steady(rig: Machine, duration_s: float, *signals: str, rpm: float = RPM) -> Response:
    """Run at the torque of the preset, and at its speed unless another one is given."""
    rng = np.random.default_rng(SEED)
    operation = PRESET.operation if rpm == RPM else Operation.steady(rpm, TORQUE_NM)
    return respond(rig, operation, duration_s=duration_s, rng=rng, signals=signals)


@cache
def mesh_frequency_hz() -> float:
    """Return the mesh frequency in Hz."""
    return RPM / 60.0 * machine().mesh.pair.driver.teeth


# Friction and backlash: figures 7, 8 and 12.


def friction_curves() -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the friction coefficient of one pair from entry to exit, signed by the direction of sliding."""
    mesh, viscosity = machine().mesh, machine().lubrication.viscosity_cp
    cycles = np.linspace(0.0, mesh.pair.contact_ratio, 601)
    slot = np.floor(cycles + mesh.ramp / 2.0).astype(int)
    curves = {}
    for roughness in ROUGHNESS_UM:
        friction = friction_over_mesh(mesh, TORQUE_NM, RPM, viscosity, roughness, cycles)
        signed = friction.coefficient * np.sign(friction.sliding_mps)
        curves[rq_name(roughness)] = signed[np.arange(len(cycles)), np.minimum(slot, mesh.n_slots - 1)]
    return cycles, curves


def friction_roughness() -> Figure:
    """Draw the friction coefficient at four roughnesses."""
    pair = machine().mesh.pair
    cycles, curves = friction_curves()
    return plot.friction_figure(
        cycles,
        curves,
        pitch_point=(pair.pitch_point_radius_mm - pair.start_radius_mm) / pair.base_pitch_mm,
        single_pair=(pair.contact_ratio - 1.0, 1.0),
        heading="roughness Rq",
        title=f"Friction coefficient of a tooth pair, {RPM:g} rpm, {TORQUE_NM:g} N·m (shaded: single contact)",
    )


def _friction() -> PaperFigure:
    largest = [float(np.abs(values).max()) for values in friction_curves()[1].values()]
    rise, surge = largest[2] / largest[1], largest[3] / largest[2]
    values = ", ".join(f"{mu:.3f}" for mu in largest)
    claim = judged(
        "the coefficient varies little for Rq of 0 to 0.84 µm and is large above",
        f"at most {values} at 0, 0.45, 0.84 and 1.40 µm: × {rise:.2f} up to 0.84 µm, "
        f"× {surge:.2f} from there to 1.40 µm",
        agrees=surge > 1.5 * rise,
        because="the regression's exp(S) does not surge for this oil",
    )
    zero = judged(
        "at a roughness of 0 the coefficient is set to 0",
        f"the regression gives {largest[0]:.3f}",
        agrees=largest[0] < 1e-3,
        partly=not rough(0.0).lubrication.friction,
        because="the study sets it to 0 contrary to its equation, in which the roughness occurs only in exp(b₉ e^S): "
        f"from 0.45 µm to 0 that is a factor of {largest[0] / largest[1]:.2f}, not 0, as smooth flanks also shear a "
        "film. Runs at Rq 0 are made without friction, as in the study",
    )
    return PaperFigure(
        "friction", "Figure 7", "friction coefficient at four roughnesses", friction_roughness(), (claim, zero)
    )


def backlash_lines() -> tuple[FloatArray, dict[str, FloatArray], FloatArray, dict[str, FloatArray], list[float]]:
    """Return time, half backlash as a function of time, frequencies, spectra, and the lines of the profile."""
    rate_hz, half_m = 8192.0, machine().half_backlash_um * 1e-6
    time = np.arange(round(4.0 * rate_hz)) / rate_hz
    curves: dict[str, FloatArray] = {}
    amplitudes: dict[str, FloatArray] = {}
    positions: FloatArray = time
    lines: list[float] = []
    for roughness in ROUGHNESS_UM:
        profile = TimeLockedRoughness.draw(FractalSurface.of_roughness(roughness), np.random.default_rng(SEED))
        change = profile.height_m(time)
        spectrum = amplitude_spectrum(change, rate_hz)
        shown = (spectrum.positions > 12.0) & (spectrum.positions < 2500.0)
        curves[rq_name(roughness)] = half_m + change[time < 0.4]
        amplitudes[rq_name(roughness)] = spectrum.values[shown]
        positions, lines = spectrum.positions[shown], profile.frequencies_hz.tolist()
    return time[time < 0.4], curves, positions, amplitudes, lines


def backlash_roughness() -> Figure:
    """Draw the backlash as a function of time, and the lines that it consists of."""
    time, curves, positions, amplitudes, lines = backlash_lines()
    return plot.backlash_figure(
        time,
        curves,
        positions,
        amplitudes,
        lines_hz=lines,
        mesh_frequency_hz=mesh_frequency_hz(),
        heading="roughness Rq",
        title="Half backlash b(t) = b₀ + Δb(t), and the spectrum of Δb with its lines (Hz)",
    )


def _backlash() -> PaperFigure:
    _, _, _, amplitudes, lines = backlash_lines()
    worst = max(abs(line / published - 1.0) for line, published in zip(lines, PUBLISHED_LINES_HZ, strict=True))
    claim = judged(
        "lines at 17.9, 26.9, 39.4, 59.1, 89.6, 133.4, 200.5, 300.8, 451.2, 667.7, 1016 and 1524 Hz",
        f"twelve lines, within {100 * worst:.1f} % of them",
        agrees=worst < 0.02,
        because="the frequencies of the fractal differ",
    )
    levels = [float(np.sqrt(np.sum(values**2) / 2.0)) for values in amplitudes.values()]
    grows = judged(
        "the backlash varies more with the roughness",
        f"rms of the lines {', '.join(f'{1e6 * v:.2g}' for v in levels)} µm at {', '.join(map(rq_name, ROUGHNESS_UM))}",
        agrees=bool(np.all(np.diff(levels) > 0.0)),
    )
    return PaperFigure(
        "backlash", "Figures 8 and 12", "dynamic backlash and its spectrum", backlash_roughness(), (claim, grows)
    )


# Stiffness: figures 9, 14 and 15.


def pairs_with_friction(roughness_um: float, cycles: FloatArray, *, squared: bool = False) -> FloatArray:
    """Return the stiffness of each pair with friction inside it, (n, n_slots), the newest pair first.

    1/k_i = c_nn ∓ μ c_nt in approach and recess; `squared`: as printed, with the square of (M_n ∓ μ M_t), c_nn ∓ 2 μ
    c_nt + μ² c_tt.
    """
    rig = machine()
    mesh, pair = rig.mesh, rig.mesh.pair
    pairs = mesh_stiffness(mesh, cycles).pairs_n_per_m
    friction = friction_over_mesh(mesh, TORQUE_NM, RPM, rig.lubrication.viscosity_cp, roughness_um, cycles)
    newest = np.floor(cycles + mesh.ramp / 2.0)
    progress = np.clip((cycles - newest)[:, None] + np.arange(pairs.shape[1]), 0.0, pair.contact_ratio)
    mu = friction.coefficient * np.sign(friction.sliding_mps)  # positive in approach: stiffer
    added = np.zeros(pairs.shape)
    for slot in range(pairs.shape[1]):
        rho = pair.contact_radii_mm(progress[:, slot])
        for gear, material, r in zip((pair.driver, pair.driven), (mesh.material_1, mesh.material_2), rho, strict=True):
            normal, itself = (
                friction_compliance(gear, material, r / gear.base_radius_mm, along_itself=so) / mesh.face_width_m
                for so in (False, True)
            )
            m = mu[:, slot]
            added[:, slot] += -2.0 * m * normal + m**2 * itself if squared else -m * normal
    carries = pairs > 0.0
    return np.where(carries, 1.0 / (1.0 / np.where(carries, pairs, 1.0) + added), 0.0)


def stiffness_with_friction(roughness_um: float, cycles: FloatArray, *, squared: bool = False) -> FloatArray:
    """Return the mesh stiffness with friction inside it, (n,), in N/m."""
    total: FloatArray = pairs_with_friction(roughness_um, cycles, squared=squared).sum(axis=1)
    return total


def _friction_inside() -> PaperFigure:
    mesh = machine().mesh
    ratio, cycles = mesh.pair.contact_ratio, np.linspace(0.0, 2.0, 1201)
    shown = {
        rq_name(r): (stiffness_with_friction(r, cycles) if r else mesh_stiffness(mesh, cycles).total_n_per_m) / 1e8
        for r in ROUGHNESS_UM
    }
    smooth = shown.pop(rq_name(0.0))
    changes = {name: values / smooth - 1.0 for name, values in shown.items()}
    squared = {r: stiffness_with_friction(r, cycles, squared=True) / 1e8 / smooth - 1.0 for r in ROUGHNESS_UM[1:]}
    printed, change = squared[1.40], changes[rq_name(1.40)]
    figure = panels_figure(
        [
            curve_panel(cycles, {rq_name(0.0): smooth} | shown, "mesh cycles", "stiffness (10⁸ N/m)"),
            curve_panel(
                cycles,
                {name: 100.0 * values for name, values in (changes | {"1.40 µm as printed": printed}).items()},
                "mesh cycles",
                "change (%)",
            ),
        ],
        title="Friction inside the stiffness",
        heading="",
    )
    # Well inside single and double contact: at engagement and disengagement the load ramp hides the friction.
    single = (cycles % 1.0 > ratio - 1.0 + 0.05) & (cycles % 1.0 < 0.95)
    double = ~single & (cycles % 1.0 > 0.05) & (cycles % 1.0 < ratio - 1.0 - 0.05)
    # First and last position of a single contact: the sliding direction reverses in between.
    of_single = np.flatnonzero(single & (cycles < 1.0))
    first, last = float(change[of_single[0]]), float(change[of_single[-1]])
    means = [100.0 * float(np.mean(values[double])) for values in changes.values()]
    # Change of each pair of a double contact by itself: the changes nearly cancel in the sum.
    pairs = pairs_with_friction(1.40, cycles[double]) / mesh_stiffness(mesh, cycles[double]).pairs_n_per_m
    entering, leaving = (100.0 * float(np.mean(pairs[:, slot]) - 1.0) for slot in (0, 1))
    claims = (
        judged(
            "in single contact the stiffness rises, then falls, as friction reverses at the pitch point",
            f"at Rq 1.40 µm by {100 * first:+.2f} % in approach and {100 * last:+.2f} % in recess",
            agrees=first > 0.0 > last,
        ),
        judged(
            "in double contact it decreases with roughness, most at 1.40 µm",
            f"by {', '.join(f'{m:+.2f}' for m in means)} % at 0.45, 0.84 and 1.40 µm",
            agrees=means[2] < means[1] < means[0] < 0.0,
            partly=means[2] < 0.0,
            because="the entering pair is in approach and stiffer, the leaving one in recess and softer, at 1.40 µm "
            f"by {entering:+.2f} % and {leaving:+.2f} %, which nearly cancel. With the square as printed the "
            f"sum changes by {', '.join(f'{100 * float(np.mean(v[double])):+.2f}' for v in squared.values())} %: this "
            "decrease comes from its term μ² c_tt, the work of the friction",
        ),
        judged(
            "friction is inside the strain energy, squared",
            f"printed at 1.40 µm: {100 * float(np.abs(printed).max()):.1f} % at most, "
            f"c_nn ± μ c_nt: {100 * float(np.abs(change).max()):.1f} %",
            agrees=False,
            because="the square doubles the effect, and friction does no work on a deflection along the normal; the "
            "simulator includes it in the forces instead",
        ),
    )
    return PaperFigure("friction_stiffness", "Figure 9", "stiffness with friction at four roughnesses", figure, claims)


def mesh_stiffness_cracks() -> Figure:
    """Draw the stiffness while the cracked tooth passes; tooth 20 enters at 20 mesh cycles, drawn as 0."""
    mesh = machine().mesh
    cycles = np.linspace(-1.5, 3.0, 1801)
    curves = {crack_name(d): mesh_stiffness(cracked(d).mesh, cycles + CRACKED_TOOTH).total_n_per_m for d in CRACKS_MM}
    alone = (mesh.pair.contact_ratio - 1.0 + mesh.ramp / 2.0, 1.0 - mesh.ramp / 2.0)
    title = "Mesh stiffness of 55/75 teeth while a cracked pinion tooth passes (it enters at 0)"
    return plot.mesh_stiffness_figure(cycles, curves, single_pair=alone, title=title)


def _crack_stiffness() -> PaperFigure:
    alone = np.linspace(0.82, 0.95, 40) + CRACKED_TOOTH
    lowest = [float(mesh_stiffness(cracked(d).mesh, alone).total_n_per_m.mean()) for d in CRACKS_MM]
    by_elements = _stiffness_by_elements()
    drops = [100.0 * (1.0 - v / lowest[0]) for v in lowest[1:]]
    fe = [100.0 * (1.0 - v / by_elements[0]) for v in by_elements[1:]]
    claims = (
        judged(
            "the stiffness in single contact falls with the length of the crack",
            f"by {', '.join(f'{d:.1f}' for d in drops)} % at 1 to 4 mm",
            agrees=bool(np.all(np.diff(lowest) < 0.0)),
        ),
        judged(
            "finite elements verify the stiffness of cracked teeth",
            f"finite elements: by {', '.join(f'{d:.1f}' for d in fe)} %",
            agrees=bool(np.all(np.abs(np.array(fe) / drops - 1.0) < 0.1)),
            partly=bool(np.all(np.diff(by_elements) < 0.0)),
            because="both fall alike, but the limiting lines behind a crack omit half of its added compliance",
        ),
    )
    return PaperFigure(
        "crack_stiffness", "Figure 14", "stiffness at crack lengths of 1 to 4 mm", mesh_stiffness_cracks(), claims
    )


def _stiffness_by_elements() -> list[float]:
    """Return the mean stiffness in single contact of the cracked pair: healthy pair plus crack by finite elements."""
    rig, gear = machine(), ready_gear("z55_m2")
    pair = rig.mesh.pair
    at = np.linspace(0.82, 0.95, 40)
    tooth_by_tooth = mesh_stiffness(rig.mesh, at + CRACKED_TOOTH).total_n_per_m
    roll = pair.contact_radii_mm(at)[0] / pair.driver.base_radius_mm
    means = [float(tooth_by_tooth.mean())]
    for depth in CRACKS_MM[1:]:
        added = crack_added_m_per_n(gear, RootCrack(float(depth), 45.0)).mean(axis=(1, 2))
        means.append(float(np.mean(1.0 / (1.0 / tooth_by_tooth + np.interp(roll, gear.grid.roll_rad, added)))))
    return means


def _crack_laws() -> PaperFigure:
    depths = np.linspace(0.5, 4.5, 17)
    laws = compare_crack_laws(ready_gear("z55_m2"), depths)
    n = len(laws.roll_rad)
    panels = [
        curve_panel(
            depths,
            {law: 1e10 * values[:, place] for law, values in laws.added_m_per_n.items()},
            "crack length (mm)",
            "added compliance (10⁻¹⁰ m/N)",
            title,
        )
        for place, title in ((n // 4, "low on the flank"), (n // 2, "halfway"), (3 * n // 4, "high on the flank"))
    ]
    figure = panels_figure(
        panels, n_columns=3, title="Compliance of a crack, by law (55 teeth, module 2 mm, width 20 mm)", height_in=2.6
    )
    whole = compare_crack_laws(ready_gear("z55_m2"), np.array([1.0, 2.0, 3.0, 4.0]))
    fe, line = (whole.added_m_per_n[name][:, n // 2] for name in ("finite elements", "limiting line"))
    claim = judged(
        "the line behind the crack bounds the part that carries no load",
        f"halfway up the flank it adds {', '.join(f'{v:.2f}' for v in line / fe)} of the compliance by finite elements "
        "at 1 to 4 mm",
        agrees=bool(np.all(np.abs(line / fe - 1.0) < 0.15)),
        partly=bool(np.all(np.diff(line) > 0.0)),
        because="the deformation below the crack also opens its mouth; near the tip of the tooth the laws agree",
    )
    return PaperFigure(
        "crack_laws", "Figures 14 and 15", "laws of a crack: lines, and finite elements", figure, (claim,)
    )


# Responses at four roughnesses: figures 10, 11 and 13.


def response_case(roughness_um: float, **changed: ParameterValue) -> ResponseCase:
    """Run at a roughness, with Poincaré points once per mesh period of the mean rotation."""
    signals = ("driver angle", "driver y", "driver y velocity")
    rig = rough(roughness_um, **changed)
    run = steady(rig, SETTLING_S + 4.0, *signals)
    settled = run.time_s > SETTLING_S
    time = run.time_s[settled] - SETTLING_S
    angle, y, v = (run[name][settled] for name in signals)
    spectrum = amplitude_spectrum(y - y.mean(), 1.0 / run.interval_s, window="blackman-harris")
    # The mean rotation, because the angle oscillates with the mesh and a section based on it would follow.
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


def response_roughness(cases: list[ResponseCase] | None = None) -> Figure:
    """Draw the pinion's displacement at four roughnesses: time, spectrum, phase portrait."""
    lines = TimeLockedRoughness.draw(FractalSurface.of_roughness(1.0), np.random.default_rng(SEED)).frequencies_hz
    return plot.response_figure(
        cases or [response_case(roughness) for roughness in ROUGHNESS_UM],
        mesh_frequency_hz=mesh_frequency_hz(),
        lines_hz=lines.tolist(),
        title=f"Pinion along the line of action, {RPM:g} rpm, {TORQUE_NM:g} N·m, by flank roughness (▾: its lines)",
    )


def _at(case: ResponseCase, hz: float) -> float:
    near = np.abs(case.frequency_hz - hz) < 0.01 * hz + 0.5
    return float(case.amplitude_m[near].max())


def _scatter(case: ResponseCase) -> float:
    """Return the scatter of the Poincaré points relative to the whole motion, over both phase-plane coordinates."""
    return float(
        np.hypot(
            np.std(case.poincare_displacement_m) / np.std(case.displacement_m),
            np.std(case.poincare_velocity_mps) / np.std(case.velocity_mps),
        )
    )


def _responses() -> PaperFigure:
    cases = [response_case(roughness) for roughness in ROUGHNESS_UM]
    mesh = mesh_frequency_hz()
    # The same on softer shafts distinguishes the resonance of a bending mode from the effect of the mesh.
    harmonics = [_at(cases[0], k * mesh) for k in (1, 2, 3, 4)]
    softer = [_at(response_case(0.0, **SOFT_SUPPORTS), k * mesh) for k in (1, 2, 3, 4)]
    natural = eigenfrequencies_hz(machine(), TORQUE_NM / (1e-3 * machine().mesh.pair.driver.base_radius_mm))
    mode = float(natural[np.argmin(np.abs(natural - 3.0 * mesh))])
    # The lines of the roughness, except the one hidden by the mesh frequency.
    lines = [[_at(case, hz) for hz in PUBLISHED_LINES_HZ if abs(hz - mesh) > 20.0] for case in cases]
    grown = [float(np.sqrt(np.sum(np.square(values)))) for values in lines]
    scatter = [_scatter(case) for case in cases]
    claims = (
        within_part("the mesh frequency is 458.3 Hz", 458.3, mesh, "Hz", part=0.001),
        judged(
            "the mesh frequency dominates, and its harmonics decrease regularly",
            f"harmonics 1 to 4: {', '.join(f'{1e6 * h:.2g}' for h in harmonics)} µm",
            agrees=bool(np.all(np.diff(harmonics) < 0.0)),
            partly=bool(np.all(np.diff(softer) < 0.0)),
            because=f"with the assumed shaft and bearing stiffness, a bending mode at {mode:.0f} Hz coincides with "
            f"the third mesh harmonic, {3 * mesh:.0f} Hz; with a tenth of that stiffness they fall: "
            f"{', '.join(f'{1e6 * h:.2g}' for h in softer)} µm",
        ),
        judged(
            "twelve further lines, whose amplitudes grow with the roughness",
            f"together {', '.join(f'{1e9 * g:.3g}' for g in grown)} nm at {', '.join(map(rq_name, ROUGHNESS_UM))}",
            agrees=bool(np.all(np.diff(grown) > 0.0)),
        ),
        judged(
            "without roughness a closed curve: periodic motion",
            f"the Poincaré points scatter by {scatter[0]:.2g} of the motion",
            agrees=scatter[0] < 0.02,
        ),
        judged(
            "the points diverge with the roughness, from many periods to chaos",
            f"scatter {', '.join(f'{s:.2g}' for s in scatter)} of the motion",
            agrees=False,
            partly=bool(np.all(np.diff(scatter) > 0.0)),
            because="the scatter increases, but the points form a ring: a motion of many periods, not chaos",
        ),
    )
    return PaperFigure(
        "responses",
        "Figures 10 and 11",
        "displacement, spectrum and phase portrait at four roughnesses",
        response_roughness(cases),
        claims,
    )


def _friction_force() -> PaperFigure:
    run = steady(rough(1.40), SETTLING_S + 2.0, "friction_n")
    force = run["friction_n"][run.time_s > SETTLING_S]
    spectrum = amplitude_spectrum(force - force.mean(), 1.0 / run.interval_s, unit="N", source="friction force")
    mesh = mesh_frequency_hz()
    figure = plot.spectrum_figure(
        spectrum,
        limits=(0.0, 2000.0),
        marked=[k * mesh for k in (1, 2, 3, 4)],
        title="Spectrum of the friction force at Rq 1.40 µm (marked: mesh harmonics)",
    )
    near = (np.abs(spectrum.positions - mesh) > 5.0) & (np.abs(spectrum.positions - mesh) < 60.0)
    floor = float(np.median(spectrum.values[spectrum.positions < 2000.0]))
    side = float(spectrum.values[near].max())
    claim = judged(
        "friction causes sidebands near the mesh frequency and its harmonics",
        f"the strongest within 60 Hz of the mesh frequency is {20 * np.log10(side / floor):.0f} dB above the floor",
        agrees=side > 10.0 * floor,
    )
    return PaperFigure(
        "friction_spectrum", "Figure 13", "spectrum of the friction force at Rq 1.40 µm", figure, (claim,)
    )


# Cracks in time and over time and frequency: figures 16, 18 and 20.


def cycles_until_below(cycles: FloatArray, change: FloatArray, threshold: float) -> float:
    """Return the mesh cycles from the cracked tooth's entry until |change| stays below `threshold` for one cycle."""
    last = 0.0
    while last < 30.0:
        above = cycles[(cycles > last) & (cycles <= last + 1.0) & (np.abs(change) > threshold)]
        if not len(above):
            break
        last = float(above.max())
    return last


def crack_reach(signal: str = "driver y acceleration") -> tuple[FloatArray, dict[str, FloatArray], dict[str, float]]:
    """Return revolutions, the signal at each crack depth, and the mesh cycles for which each crack has an effect."""
    n_teeth = machine().mesh.pair.driver.teeth
    revolutions: FloatArray = np.arange(4.0, 7.0, 1.0 / (n_teeth * 100))
    values: dict[str, FloatArray] = {}
    for depth in CRACKS_MM:
        run = steady(cracked(depth), 1.1, "driver angle", signal)
        turned = run["driver angle"] / (2.0 * np.pi)
        values[crack_name(depth)] = CubicSpline(turned, run[signal])(revolutions)
    healthy = values[crack_name(0)]
    cycles = (revolutions - 5.0 - CRACKED_TOOTH / n_teeth) * n_teeth
    # The threshold is relative to the rms of an acceleration, to the oscillation of a transmission error.
    size = np.std(healthy) if "acceleration" in signal else np.ptp(healthy)
    threshold = REACH_THRESHOLD * float(size)
    reach = {
        name: cycles_until_below(cycles, a - healthy, threshold) for name, a in values.items() if name != crack_name(0)
    }
    return revolutions, values, reach


def crack_comparison() -> Figure:
    """Draw the pinion's acceleration over three revolutions at five crack depths, sampled at equal angles."""
    revolutions, values, reach = crack_reach()
    n_teeth = machine().mesh.pair.driver.teeth
    entry = CRACKED_TOOTH / n_teeth
    return plot.crack_comparison_figure(
        revolutions,
        values,
        impacts_rev=[4.0 + entry, 5.0 + entry, 6.0 + entry],
        n_teeth=n_teeth,
        change_mps2={name: a - values[crack_name(0)] for name, a in values.items() if name != crack_name(0)},
        reach_cycles=reach,
        zoom_cycles=(-2.0, 8.0),
        title=f"Acceleration of the pinion along the line of action, {RPM:g} rpm, {TORQUE_NM:g} N·m, Rq 0.45 µm",
    )


def _cracks() -> PaperFigure:
    _, values, _ = crack_reach()
    _, _, reach = crack_reach("transmission_error_m")
    strength = [float(np.abs(values[crack_name(d)] - values[crack_name(0)]).max()) for d in CRACKS_MM[1:]]
    cycles = [reach[crack_name(d)] for d in CRACKS_MM[1:]]
    claims = (
        judged(
            "one impact per revolution, which grows with the crack",
            f"{', '.join(f'{s:.3g}' for s in strength)} m/s² at 1 to 4 mm",
            agrees=bool(np.all(np.diff(strength) > 0.0)),
        ),
        judged(
            "a crack of 1 or 2 mm has an effect for three mesh cycles",
            f"{cycles[0]:.1f} and {cycles[1]:.1f} cycles in the transmission error",
            agrees=max(abs(c - 3.0) for c in cycles[:2]) < 1.5,
        ),
        judged(
            "a crack of 3 or 4 mm for nine",
            f"{cycles[2]:.1f} and {cycles[3]:.1f} cycles",
            agrees=min(cycles[2:]) > 8.0,
            partly=min(cycles[2:]) > max(cycles[:2]),
            because="the duration grows with the crack, but the ringing decays sooner: the torsional damping is not "
            "published",
        ),
    )
    return PaperFigure(
        "cracks",
        "Figure 16, time signals",
        "acceleration over three revolutions at five crack lengths",
        crack_comparison(),
        claims,
    )


def _crack_maps() -> tuple[PaperFigure, PaperFigure]:
    rate_hz = 8192.0
    panels, levels, maps = [], [], {}
    period_s = 60.0 / 1000.0
    for depth in (0, 1, 4):
        run = steady(cracked(depth), 1.0, "driver y acceleration", rpm=1000.0)
        # Resample to the recorder's rate through its anti-aliasing filter.
        step = round(1.0 / run.interval_s / rate_hz)
        kept = resample_poly(run["driver y acceleration"], 1, step)
        rate = 1.0 / run.interval_s / step
        x = kept[round(0.4 * rate) :][: round(0.5 * rate)]
        time = np.arange(len(x)) / rate
        panels.append(curve_panel(time, {crack_name(depth): x}, "time (s)", "acceleration (m/s²)", crack_name(depth)))
        maps[depth] = squeezed_cwt_map(UniformSignal(x, rate, unit="m/s^2", source=crack_name(depth)), lowest=100.0)
        levels.append(x)
    figure = panels_figure(panels, title="Acceleration of the pinion, 1000 rpm", height_in=1.5)
    spread = [float(np.std(x - levels[0])) / float(np.std(levels[0])) for x in levels[1:]]
    times = UniformSignal(levels[2], rate)
    high = maps[4].positions > 2000.0
    # The contribution of the crack only, as the mesh repeats with every tooth: its impacts come once a revolution.
    shocks = np.abs(levels[2] - levels[0])
    lag = _repeats_after(shocks - shocks.mean(), 1.0 / rate, period_s)
    time_claims = (
        within_part("the period of the impacts is 60/n, 60 ms at 1000 rpm", 1e3 * period_s, 1e3 * lag, "ms", part=0.03),
        judged(
            "the impact grows with the crack",
            f"the change is {spread[0]:.2g} of the healthy signal's rms at 1 mm and {spread[1]:.2g} at 4 mm",
            agrees=spread[1] > 2.0 * spread[0],
        ),
    )
    time_figure = PaperFigure("crack_times", "Figure 18", "time signals at 1000 rpm", figure, time_claims)
    # The most impulsive mode of the signal contains the impacts, separated from the mesh harmonics.
    modes = vmd(times, None, VmdSettings(5, penalty=2000.0))
    kurtosis, whole = [indicators.kurtosis(m) for m in modes.waveforms], indicators.kurtosis(levels[2])
    chosen = int(np.argmax(kurtosis))
    squeezed = squeezed_cwt_map(modes.signal(chosen), lowest=float(modes.centres[chosen]) / 4.0)
    drawn = plot.time_frequency_figure(squeezed)
    # Maximum over time of the power above 2 kHz, and its fluctuation over time below 1 kHz.
    peaks = [float(np.sum(maps[d].values[:, high] ** 2, axis=1).max()) for d in (0, 1, 4)]
    share = [peak / peaks[0] for peak in peaks[1:]]
    low = maps[4].positions < 1000.0
    swing = [float(np.std(np.sum(maps[d].values[:, low] ** 2, axis=1))) for d in (0, 1, 4)]
    map_claims = (
        judged(
            "the high frequencies (above 2 kHz) surge with the crack",
            f"their maximum power is {share[0]:.3g} times the healthy gear's at 1 mm, {share[1]:.3g} times at 4 mm",
            agrees=share[1] > 2.0,
            partly=share[1] > 1.05 and share[1] > share[0],
            because="they grow, but the impact of the stiffness change is small compared with the mesh harmonics there",
        ),
        judged(
            "the fluctuation of the low frequencies grows with the crack",
            f"{swing[1] / swing[0]:.3g} times at 1 mm, {swing[2] / swing[0]:.3g} times at 4 mm",
            agrees=swing[2] > swing[1] > swing[0],
        ),
        judged(
            "modes of the signal (VMD, penalty 2000) show the fault clearly",
            f"of {modes.n_modes} modes the most impulsive has a kurtosis of {kurtosis[chosen]:.1f}, the signal "
            f"{whole:.1f}",
            agrees=kurtosis[chosen] > whole,
        ),
    )
    title = f"squeezed wavelet transform of the mode at {modes.centres[chosen]:.0f} Hz, crack of 4 mm, 1000 rpm"
    return time_figure, PaperFigure("crack_maps", "Figures 16 and 20", title, drawn, map_claims)


def _repeats_after(x: FloatArray, step_s: float, near_s: float) -> float:
    """Return the lag (s) of the maximum autocorrelation within 30 % of the expected lag."""
    correlation = np.correlate(x, x, "full")[len(x) - 1 :]
    lags = np.arange(len(correlation)) * step_s
    inside = np.flatnonzero(np.abs(lags / near_s - 1.0) < 0.3)
    return float(lags[inside[np.argmax(correlation[inside])]])


UNANSWERED = {
    "1 to 6": "sketches of the model",
    "17": "a photograph of the test rig",
    "19 and 21": "measured signals of the test rig, which are not available",
}


def compute(on_progress: Progress) -> Paper:
    """Compute all figures."""
    steps = (
        ("friction", _friction),
        ("backlash", _backlash),
        ("friction inside the stiffness", _friction_inside),
        ("responses", _responses),
        ("friction force", _friction_force),
        ("stiffness with cracks", _crack_stiffness),
        ("crack laws", _crack_laws),
        ("cracks in time", _cracks),
    )
    figures = []
    for k, (stage, make) in enumerate(steps):
        on_progress(stage, k / (len(steps) + 1))
        figures.append(make())
    on_progress("cracks over time and frequency", len(steps) / (len(steps) + 1))
    figures += _crack_maps()
    on_progress("done", 1.0)
    return Paper(
        "cracked",
        "The cracked spur pair",
        SOURCE,
        "preset published_55_75; module, bore, stiffness and damping are assumed",
        tuple(figures),
        UNANSWERED,
    )
