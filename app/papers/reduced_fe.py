"""Flexible gear wheels: stiffness and transmission-error maps, frequencies over the mesh angle, sweeps, stress maps.

Machine: preset "flexible_50_50" at the study's 8 % damping; the hub inertia is assumed, as the study states none.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import CubicSpline

from app.flexible import RANGE, Study, figures, flexible_study
from app.papers import Claim, Paper, PaperFigure, Progress, judged, within_part
from gearsig import plot
from gearsig.checks import FloatArray
from gearsig.formatting import percent
from gearsig.plot import curve_panel, panels_figure
from sims import fe_gear, reduced_fe
from sims.machine import Operation
from sims.reduced_fe import FlexiblePair, ReducedPair
from sims.simulator import ParameterValue, SimulationSetup

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TORQUES_NM = (85.0, 170.0, 340.0)
SWEEP_S = 4.0
"""Up and down at three torques: some five million steps. `gearsig flexible --duration` sweeps more slowly."""
MESH_DOF = 90_000
"""Degrees of freedom of the gear whose stress is drawn: 270,000 give the same fields in four times the time."""
N_MODES = 120
NEIGHBOURS = (-2, -1, 0, 1, 2)
SOURCE = (
    "Development for a flexible gear wheel dynamics simulation algorithm: 50/50 teeth, module 3 mm (its tables are not "
    "at hand)"
)


def _pair(changed: Mapping[str, ParameterValue] | None = None) -> tuple[FlexiblePair, float, float]:
    ready = ReducedPair().prepare(SimulationSetup("flexible_50_50", changed or {}), np.random.default_rng(0))
    return ready.pair, float(ready.operation.torque_nm.values[0]), ready.step_s


def _maps(study: Study, drawn: dict[str, Figure]) -> list[PaperFigure]:
    maps = study.maps
    stiffness, error = maps.secant_stiffness_n_per_m, maps.transmission_error_m
    at = len(maps.torque_nm) // 2
    # Both are periodic in the mesh cycle: the shorter distance counts.
    lowest, highest = int(np.argmin(stiffness[:, at])), int(np.argmax(error[:, at]))
    apart = abs((lowest - highest + len(stiffness) // 2) % len(stiffness) - len(stiffness) // 2) / len(stiffness)
    peaks = error.max(axis=0)
    forces = maps.pair_forces_n
    claims = (
        judged(
            "the stiffness falls in single contact, but never to zero",
            f"from {1e-8 * stiffness[:, at].max():.3g} to {1e-8 * stiffness[:, at].min():.3g} × 10⁸ N/m at "
            f"{maps.torque_nm[at]:g} N·m",
            agrees=0.5 < stiffness[:, at].min() / stiffness[:, at].max() < 0.95,
        ),
        judged(
            "it grows with the torque",
            f"mean {1e-8 * stiffness[:, 0].mean():.3g} × 10⁸ N/m at {maps.torque_nm[0]:g}, "
            f"{1e-8 * stiffness[:, -1].mean():.3g} × 10⁸ N/m at {maps.torque_nm[-1]:g} N·m",
            agrees=float(stiffness[:, -1].mean()) > float(stiffness[:, 0].mean()),
        ),
    )
    share = (
        judged(
            "the load of the leaving pair falls to zero while the entering one takes it over",
            f"the maximum force of one pair is {forces[:, at].max():.4g} N, the minimum {forces[:, at].min():.3g} N",
            agrees=float(forces[:, at].min()) < 0.01 * float(forces[:, at].max()),
        ),
    )
    errors = (
        judged(
            "the static transmission error peaks where the stiffness has its minimum",
            f"{100 * apart:.1f} % of a mesh cycle apart",
            agrees=apart < 0.1,
        ),
        judged(
            "it grows with the torque",
            f"{1e6 * peaks[0]:.3g} µm at {maps.torque_nm[0]:g}, {1e6 * peaks[-1]:.3g} µm at {maps.torque_nm[-1]:g} N·m",
            agrees=bool(np.all(np.diff(peaks) > 0.0)),
        ),
    )
    return [
        PaperFigure(
            "stiffness_map", "Figures 2 and 3", "mesh stiffness over angle and torque", drawn["stiffness_map"], claims
        ),
        PaperFigure(
            "pair_stiffness", "Figure 3, single contacts", "stiffness of each pair", drawn["pair_stiffness_map"], share
        ),
        PaperFigure("static_error", "Figure 4", "static transmission error", drawn["transmission_error_map"], errors),
        PaperFigure(
            "load_sharing",
            "zero-contact-force regions",
            "load of each pair over the mesh",
            drawn["load_sharing"],
            share,
        ),
    ]


def _drop(study: Study) -> Claim:
    """Judge the frequency drop of the flank mode in single contact, with the hubs and without."""
    bare = _pair({"hub_inertia_driver_kg_m2": 0.0, "hub_inertia_driven_kg_m2": 0.0})[0]
    at_load = Operation.steady(4100.0, study.torque_nm)
    curves = study.angle_hz, reduced_fe.eigenfrequencies_hz(bare, at_load, study.angle_cycles)
    gear_texts, depths = [], []
    for hz, gears in zip(curves, ("with the hubs", "without"), strict=True):
        above = hz[:, hz[0] > 1000.0]
        curve = above[:, int(np.argmax(np.ptp(above, axis=0) / above.mean(axis=0)))]
        low = study.angle_cycles[curve < 0.95 * curve.max()] * 360.0 / study.n_teeth
        depths.append(float(1.0 - curve.min() / curve.max()))
        gear_texts.append(
            f"{gears} from {curve.max():.0f} to {curve.min():.0f} Hz, at {low.min():.1f} to {low.max():.1f}°"
        )
    return judged(
        "a drop of some curves near 3500 to 4000 Hz at 5 to 10 degrees",
        f"the flank mode drops in single contact: {'; '.join(gear_texts)}",
        agrees=False,
        partly=min(depths) > 0.05,
        because="the drop and its angle agree; its frequency depends on the inertia of the gears, which is not stated",
    )


def _frequencies(study: Study, drawn: dict[str, Figure]) -> PaperFigure:
    low = study.angle_hz[:, (study.angle_hz[0] > 1000.0) & (study.angle_hz[0] < 12000.0)]
    swing = np.ptp(low, axis=0) / low.mean(axis=0)
    natural = [study.natural_hz[t] for t in TORQUES_NM]
    claims: tuple[Claim, ...] = (
        within_part(
            "a torsional resonance of about 2650 Hz", 2650.0, study.natural_hz[170.0], "Hz at 170 N·m", part=0.02
        ),
        judged(
            "2650 to 2700 Hz",
            f"{', '.join(f'{f:.0f}' for f in natural)} Hz at {', '.join(f'{t:g}' for t in TORQUES_NM)} N·m",
            agrees=all(2640.0 < f < 2710.0 for f in natural),
            partly=any(2640.0 < f < 2710.0 for f in natural),
            because="contact is softer at lower load; the hub inertia was chosen to give these frequencies",
        ),
        judged(
            "frequencies oscillate little over the mesh angle, individual modes more",
            f"modes of 1 to 12 kHz by {100 * np.median(swing):.2g} % (median), {100 * swing.max():.2g} % at most",
            agrees=float(np.median(swing)) < 0.02 < float(swing.max()) or float(swing.max()) < 0.1,
        ),
        _drop(study),
    )
    return PaperFigure(
        "frequencies",
        "Figures 12 and 13",
        "natural frequencies over the mesh angle, coupled and uncoupled",
        drawn["natural_frequencies"],
        claims,
    )


RELIEF_UM, RELIEF_MM = 20.0, 2.0


def _relieved_jumps(study: Study) -> tuple[str, bool]:
    """Return the jump frequencies of sweeps with tip relief at the study's damping, as text, and whether any jumps."""
    relief = {"tip_relief_um": RELIEF_UM, "tip_relief_length_mm": RELIEF_MM}
    pair, _, step_s = _pair(relief)
    low, high = (part * study.natural_hz[study.torque_nm] for part in RANGE)
    jumps = [
        reduced_fe.speed_sweep(pair, study.torque_nm, *ends, SWEEP_S, step_s=step_s).jump_hz(low, high)
        for ends in ((900.0, 4100.0), (4100.0, 900.0))
    ]
    jump_text = " and ".join("no jump" if jump is None else f"{jump:.0f} Hz" for jump in jumps)
    return f"{jump_text} at {study.torque_nm:g} N·m ({RELIEF_UM:g} µm over {RELIEF_MM:g} mm)", any(
        jump is not None for jump in jumps
    )


def _sweeps(study: Study, drawn: dict[str, Figure]) -> PaperFigure:
    claims = []
    relieved, jumps_relieved = _relieved_jumps(study)
    for torque, (up, down) in study.sweeps.items():
        low, high = (part * study.natural_hz[torque] for part in RANGE)
        peak = (up.peak_hz(low, high) + down.peak_hz(low, high)) / 2.0
        jumps = [sweep.jump_hz(low, high) for sweep in (up, down)]
        jump_text = ", ".join("no jump" if jump is None else f"a jump at {jump:.0f} Hz" for jump in jumps)
        claims += [
            within_part(
                "the primary resonance is at 2700 Hz",
                2700.0,
                peak,
                f"Hz at {torque:g} N·m",
                part=0.04,
                because="contact is softer at lower load",
            ),
            judged(
                "hysteretic jumps in sweeps up and down",
                f"{torque:g} N·m, up and down: {jump_text}",
                agrees=any(jump is not None for jump in jumps),
                partly=jumps_relieved,
                because=f"perfect flanks hardly separate at 8 % damping; with tip relief, up and down: {relieved}",
            ),
        ]
    return PaperFigure("sweeps", "Figure 22 and the sweeps", "sweeps up and down", drawn["sweeps"], tuple(claims))


def _spectra(study: Study, drawn: dict[str, Figure]) -> PaperFigure:
    natural = study.natural_hz[study.torque_nm]
    levels = []
    for speed, values in study.spectra_m.items():
        mesh = speed / 60.0 * study.n_teeth
        lines = [
            float(values[np.abs(study.spectra_hz - k * mesh) < 10.0].max()) for k in range(1, int(12000.0 / mesh) + 1)
        ]
        levels.append((speed, 1 + int(np.argmax(lines)), mesh))
    nearest = [abs(k * mesh / natural - 1.0) for _, k, mesh in levels]
    claim = judged(
        "peaks at distinct frequencies near the natural ones, and at a half and a third of them",
        "; ".join(f"{speed:g} rpm: harmonic {k} at {k * mesh:.0f} Hz" for speed, k, mesh in levels),
        agrees=sum(near < 0.3 for near in nearest) >= 3,
        partly=any(near < 0.3 for near in nearest),
        because="a mesh harmonic is near the torsional mode at only some of these speeds",
    )
    return PaperFigure("spectra", "Figures 19 and 20", "spectra at 1000 to 5000 rpm", drawn["spectra"], (claim,))


def _kinematics(pair: FlexiblePair, torque_nm: float, step_s: float) -> PaperFigure:
    operation = Operation.steady(2000.0, torque_nm)
    run = reduced_fe.respond(
        pair, operation, duration_s=0.4, signals=(reduced_fe.TRANSMISSION_ERROR,), step_s=step_s, stride=1,
        ready=reduced_fe.constants(pair, operation),
    )  # fmt: skip
    x = run[reduced_fe.TRANSMISSION_ERROR]
    speed = np.gradient(x, run.interval_s)
    acceleration = np.gradient(speed, run.interval_s)
    shown = slice(-round(0.006 / run.interval_s), None)
    time = run.time_s[shown]
    panels = [
        curve_panel(time, {"displacement": 1e6 * x[shown]}, "time (s)", "displacement (µm)"),
        curve_panel(time, {"velocity": 1e3 * speed[shown]}, "time (s)", "velocity (mm/s)"),
        curve_panel(time, {"acceleration": acceleration[shown]}, "time (s)", "acceleration (m/s²)"),
    ]
    figure = panels_figure(
        panels, title=f"Transmission error and its derivatives, 2000 rpm, {torque_nm:g} N·m", height_in=1.4
    )
    n = round(60.0 / 2000.0 / 50 / run.interval_s)
    last, before = x[-n:] - x[-n:].mean(), x[-2 * n : -n] - x[-2 * n : -n].mean()
    repeat = float(np.corrcoef(last, before)[0, 1])
    claim = judged(
        "after a transient the motion is stable and periodic",
        f"one mesh cycle correlates with the one before by {repeat:.4f}",
        agrees=repeat > 0.98,
    )
    return PaperFigure(
        "kinematics", "Figures 16, 17, 18 and 21", "displacement, velocity and acceleration", figure, (claim,)
    )


def _between_heights(
    pair: FlexiblePair, mesh: fe_gear.SectorMesh, force_n: float, stress: Callable[[FloatArray], FloatArray]
) -> tuple[float, float, int]:
    """Return the relative rms stress error of the reduced gear halfway between its stored heights.

    The errors are those of the whole face drawn and of the part with stress below half the maximum; the third value is
    the number of heights. Between heights, the reduction interpolates with a cubic spline.
    """
    heights = pair.gears[0].grid.roll_rad
    middle = slice(max(len(heights) // 2 - 3, 0), len(heights) // 2 + 3)
    kept = np.array([fe_gear.load_tooth(mesh, force_n, roll).displacement_m for roll in heights[middle]])
    halfway = float(heights[len(heights) // 2 - 1 : len(heights) // 2 + 1].mean())
    reduced = stress(CubicSpline(heights[middle], kept, axis=0)(halfway))
    full = stress(fe_gear.load_tooth(mesh, force_n, halfway).displacement_m)
    body = full < 0.5 * full.max()
    errors = (
        np.sqrt(np.mean((full - reduced)[where] ** 2) / np.mean(full[where] ** 2)) for where in (full > -1.0, body)
    )
    return *map(float, errors), len(heights)  # type: ignore[return-value]


def _stress(pair: FlexiblePair, torque_nm: float) -> list[PaperFigure]:
    """Return figures of the full static stress, the modal stress, their difference, and the moving contacts."""
    blank = pair.gears[0].blank
    mesh = fe_gear.sector_mesh(blank, fe_gear.mesh_size_for(blank, MESH_DOF))
    gear = fe_gear.CyclicGear(mesh)
    view = fe_gear.face_view(mesh, NEIGHBOURS)
    g = blank.geometry
    near = (g.root_radius_mm - 4.0 * g.module_mm, g.tip_radius_mm + 0.5 * g.module_mm, -12.0, 15.0)

    def shown(field: FloatArray) -> dict[str, FloatArray]:
        by_sector = [fe_gear.polar_stress_pa(mesh, field[k]) for k in NEIGHBOURS]
        return {name: view.values(np.array([part[name] for part in by_sector])) for name in by_sector[0]}

    maps = pair.maps(torque_nm=np.array([torque_nm]), mesh_cycles=np.linspace(0.0, 1.0, 9)[:-1])
    pair_geometry = pair.machine.mesh.pair

    def contacts(row: int) -> tuple[FloatArray, list[float]]:
        """Superpose the contacts of the driver at one mesh angle; tooth 0 belongs to the older pair."""
        field = np.zeros((g.teeth, mesh.n_nodes, 3))
        forces = []
        slots = [float(force) for force in maps.pair_forces_n[row, 0]]
        for slot, force in enumerate(slots):
            if force <= 0.0:
                continue
            number = int(maps.pair_numbers[row, slot])
            zeta = float(maps.mesh_cycles[row]) - number
            roll = (
                float(pair_geometry.contact_radii_mm(np.clip(zeta, 0.0, pair_geometry.contact_ratio))[0])
                / g.base_radius_mm
            )
            load = fe_gear.load_tooth(mesh, force, min(max(roll, g.form_roll_rad), g.tip_roll_rad))
            field += np.roll(load.displacement_m, -1 - number, axis=0)  # the tooth ahead entered earlier
            forces.append(force)
        return field, forces

    # All of the torque on one tooth: only there can the modal solution be compared with that of the whole mesh.
    force = torque_nm / (g.base_radius_mm * 1e-3)
    load = fe_gear.load_tooth(mesh, force)
    full = shown(load.displacement_m)
    with fe_gear.one_thread():
        modes = fe_gear.cyclic_modes(gear, N_MODES, "bore")
    modal = shown(fe_gear.modal_load(gear, modes, load))
    # Error of the modes alone, and error of the reduction between the heights whose static solution it stores.
    error = {f"{name}, full less modal": full[name] - modal[name] for name in full}
    between, body, n_heights = _between_heights(pair, mesh, force, lambda field: shown(field)["von Mises"])
    residual_share = float(np.sqrt(np.mean(error["von Mises, full less modal"] ** 2) / np.mean(full["von Mises"] ** 2)))
    title = f"{force:.0f} N on one tooth, bore held, {mesh.n_dof} degrees of freedom"
    drawn = partial(plot.stress_maps_figure, view.points_mm, view.triangles, near_mm=near)
    static, by_modes = drawn(full, title=f"Static: {title}"), drawn(modal, title=f"{N_MODES} modes alone: {title}")
    error_maps = drawn(error, title=f"Full less {N_MODES} modes: {title}")
    # Four angles of a mesh cycle: two with two pairs in contact, two with one, as the contact ratio is below two.
    moving, n_contacts = {}, []
    for row in (0, 2, 5, 7):
        field, forces = contacts(row)
        n_contacts.append(len(forces))
        words = " and ".join(f"{f:.0f} N" for f in forces)
        moving[f"mesh cycle {maps.mesh_cycles[row]:.2f}: {words}"] = shown(field)["von Mises"]
    track = drawn(moving, title=f"Von Mises stress of the driver as its contacts move, {torque_nm:g} N·m")
    # The study's statements, each checked by one of these numbers.
    far = view.values(np.array([np.full(mesh.n_nodes, float(abs(k) == 2)) for k in NEIGHBOURS])) > 0.5
    quiet = float(np.median(full["von Mises"][far]) / full["von Mises"].max())
    no_contact = judged(
        "stress near zero where teeth do not touch",
        f"two teeth away, {100 * quiet:.1f} % of the maximum (median)",
        agrees=quiet < 0.05,
        partly=quiet < 0.1,
        because="the body below those teeth also carries torque",
    )
    patterns = judged(
        "static and modal maps show the same contact patterns",
        f"the von Mises stress differs by {percent(residual_share)} rms",
        agrees=residual_share < 0.1,
        partly=residual_share < 1.0,
        because="a local contact needs the static residual in addition to the modes; the reduction keeps it",
    )
    small = judged(
        "the error of the reduced model stays small",
        f"{100 * between:.1f} % rms halfway between two of the {n_heights} heights whose static solution the reduction "
        f"stores, {100 * body:.1f} % where stress is below half the maximum; none at those heights; {N_MODES} modes "
        f"alone: {percent(residual_share)}",
        agrees=between < 0.1,
        partly=body < 0.1,
        because="the patch under the contact lies between the stored heights",
    )
    peaks = judged(
        "two peaks where two pairs share the load, one in single contact",
        f"{', '.join(map(str, n_contacts))} contacts at the four angles",
        agrees=set(n_contacts) == {1, 2},
        partly=2 in n_contacts,
        because="none of the angles lies in single contact",
    )
    words = "radial, tangential, shear and von Mises stress"
    return [
        PaperFigure("stress_static", "Figures 8 to 14, static maps", words, static, (no_contact,)),
        PaperFigure(
            "stress_modal", "Figures 8 to 14 and 18 to 110, modal maps", f"{words} by modes", by_modes, (patterns,)
        ),
        PaperFigure("stress_error", "Figures 6, 7 and 11, errors", "error of the modes alone", error_maps, (small,)),
        PaperFigure("stress_moving", "Figure 7, contacts that move", "stress over a mesh cycle", track, (peaks,)),
    ]


UNANSWERED = {
    "1, 5, 6, 7, 14 and 15": "pictures of the mesh and sketches of the contact; gearsig gear-body draws mesh and modes",
    "comparison with measured DTE": "the measured amplitudes of the reference experiment are not available",
    "20 hours on one processor": "a sweep of six million steps takes seconds to minutes here; see docs/how_good.md",
}


def compute(on_progress: Progress) -> Paper:
    """Compute all figures."""
    pair, torque_nm, step_s = _pair()
    study = flexible_study(
        pair, torque_nm, TORQUES_NM, sweep_s=SWEEP_S, step_s=step_s,
        on_progress=lambda stage, done: on_progress(stage, 0.6 * done),
    )  # fmt: skip
    drawn = dict(figures(study, "50/50 teeth"))
    on_progress("kinematics", 0.6)
    paper_figures = [*_maps(study, drawn), _frequencies(study, drawn), _sweeps(study, drawn), _spectra(study, drawn)]
    paper_figures.append(_kinematics(pair, torque_nm, step_s))
    on_progress("stress", 0.7)
    paper_figures += _stress(pair, torque_nm)
    on_progress("done", 1.0)
    machine = "preset flexible_50_50; bore, torques and hub inertia are assumed, as the study states none"
    return Paper("reduced-fe", "Flexible gear wheels", SOURCE, machine, tuple(paper_figures), UNANSWERED)
