"""Finite-element gears: one gear to rotate, a pair with maps and sweeps, three publications beside the models."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import streamlit as st

from app import flexible as pair_study
from app import gear_body
from app.dashboard import address
from app.dashboard.components import component_of
from app.dashboard.theme import is_dark
from app.dashboard.widgets.charts import download, encoded, show_figure, show_map
from app.dashboard.widgets.texts import as_typed, capitalised, show_wrapping_table
from app.dashboard.work import kept
from app.gear_body import GearBodyStudy
from app.papers import PAPERS, Paper, paper
from gearsig.checks import FloatArray
from gearsig.orders import OrderMap
from gearsig.plot import LevelPanel, decibel_text, decibels, level_colours
from sims import fe_gear
from sims.fe_gear import GearBlank
from sims.mesh import GearGeometry
from sims.presets import presets
from sims.reduced_fe import ReducedPair
from sims.simulator import SimulationSetup

_solid = component_of("solid")
DOF = 30_000
"""Degrees of freedom of the mesh to rotate: as many as a browser draws thirty times a second."""
STRESS = "stress"
"""Shown instead of a mode."""
SWING = 0.05
"""Maximum motion of a mode as drawn, relative to the tip radius."""


@dataclass(frozen=True)
class SolidView:
    """The surface of a whole gear.

    Parameters
    ----------
    nodes : array of int, (n,)
        Of a sector, those on its visible surface.
    points_mm : array, (n_teeth · n, 3)
    quads : array of int, (n_quads, 4)
        Indices into the points.
    """

    nodes: np.ndarray
    points_mm: FloatArray
    quads: np.ndarray


def solid_view(study: GearBodyStudy) -> SolidView:
    """Return the outer surface of the study's whole gear."""
    faces = fe_gear.outer_faces(study.mesh)
    nodes, inverse = np.unique(faces, return_inverse=True)
    n_teeth = study.mesh.blank.n_teeth
    tooth_mm = np.broadcast_to(study.mesh.points_m[nodes] * 1e3, (n_teeth, len(nodes), 3))
    quads = inverse.reshape(1, -1, 4) + (len(nodes) * np.arange(n_teeth))[:, None, None]
    return SolidView(nodes, gear_body.in_the_whole_gear(study.mesh, tooth_mm), quads.reshape(-1, 4))


@kept(3, "Meshing the gear, finding its modes …")
def studied(blank: GearBlank, held: fe_gear.Held, force_n: float) -> tuple[GearBodyStudy, SolidView]:
    """Return mesh, modes and stress of one gear, computed once for equal requests."""
    study = gear_body.study_gear(blank, DOF, n_modes=2 * gear_body.N_SHOWN, held=held, force_n=force_n)
    return study, solid_view(study)


def choose_blank() -> tuple[GearBlank, fe_gear.Held, float]:
    """Let the user set teeth, module, width, body, and how it is held."""
    ask, first, second = address.ask_number, st.columns(4), st.columns(4)
    teeth = ask(first[0], "Teeth", 12, 120, name="teeth", first=50, whole=True)
    module = ask(first[1], "Module (mm)", 0.5, 20.0, name="module", first=3.0, step=0.5)
    face = ask(first[2], "Face width (mm)", 2.0, 200.0, name="width", first=20.0, step=1.0)
    bore = ask(first[3], "Bore radius (mm)", 1.0, 500.0, name="bore", first=20.0, step=1.0)
    web = ask(second[0], "Web thickness (mm), 0: solid", 0.0, 200.0, name="web", first=0.0, step=1.0)
    shift = ask(second[1], "Profile shift", -1.0, 1.0, name="shift", first=0.0, step=0.1)
    force = ask(second[2], "Force on a tooth (N)", 1.0, 1e6, name="force", first=1000.0, step=100.0)
    looks = {"name": "held", "format_func": {"free": "Free", "bore": "Fixed at the bore"}.__getitem__}
    held = address.ask_one(second[3].selectbox, "Boundary", ("free", "bore"), **looks)
    gear = GearGeometry(teeth, module, profile_shift=shift, face_width_mm=face, bore_radius_mm=bore)
    return GearBlank(gear, web or None), held, force


def show_gear() -> None:
    """Show one gear to rotate, with its modes and the stress of a loaded tooth."""
    study, view = studied(*choose_blank())
    names = [gear_body.label(study, k) for k in range(min(gear_body.N_SHOWN, len(study.modes.frequencies_hz)))]
    labels = {str(k): f"Mode {k + 1}: {name}" for k, name in enumerate(names)}
    labels |= {STRESS: "Stress of a loaded tooth"} if study.mesh.size.order > 1 else {}
    key = f"shown of a gear {list(labels.values())}"  # else the browser keeps the previous gear's labels
    so_far = address.now("shown")
    st.session_state.setdefault(key, so_far if so_far in labels else "0")
    looks = {"name": "shown", "format_func": labels.__getitem__, "key": key}
    shown = address.ask_one(st.selectbox, "Show", list(labels), **looks)
    if shown == STRESS:
        field = study.load.displacement_m[:, view.nodes]
        values = np.array([study.load.von_mises_pa(k) for k in range(study.mesh.blank.n_teeth)])[:, view.nodes].ravel()
        top = float(np.quantile(values, 0.9995))
        legend = ("0", f"{top * 1e-6:.3g} MPa von Mises, at {study.load.force_n:g} N")
    else:
        field = fe_gear.mode_field(study.gear, study.modes, int(shown))[:, view.nodes]
        values = np.linalg.norm(field, axis=2).ravel()
        top = float(values.max())
        legend = ("at rest", "largest motion")
    motion = gear_body.in_the_whole_gear(study.mesh, field)
    largest = float(np.linalg.norm(motion, axis=1).max())
    _solid(
        key="gear that is turned",
        data={
            "points": encoded(view.points_mm.ravel()),
            "quads": encoded(view.quads.ravel().astype(np.float64)),
            "motion": encoded((motion / largest).ravel()),
            "values": encoded(np.clip(values / top, 0.0, 1.0)),
            "stretch": SWING * study.mesh.blank.geometry.tip_radius_mm * (shown != STRESS),
            "swings": shown != STRESS,
            "colours": level_colours(dark=is_dark())[50:240:24].tolist(),
            "legend": legend,
            "help": "Drag or use the arrow keys to rotate, + and − or the wheel to zoom.",
            "words": f"Gear of {study.mesh.blank.n_teeth} teeth: {labels[shown]}",
        },
    )
    with st.expander("Numbers", key="gear numbers"):
        st.markdown("  \n".join(as_typed(line) for line in gear_body.lines(study)))
    coarse = "The mesh is coarse so that the picture rotates smoothly"
    coarse += "; the resulting error is given under Numbers." if study.discretisation else "."
    st.caption(f"{coarse} {gear_body.PEAKS if shown == STRESS else 'The motion is greatly exaggerated.'}")


@kept(4, "Running both sweeps …")
def pair_studied(preset: str, torque_nm: float, sweep_s: float) -> pair_study.Study:
    """Return maps, sweeps and spectra of a pair, computed once for equal requests."""
    ready = ReducedPair().prepare(SimulationSetup(preset, {}), np.random.default_rng(0))
    return pair_study.flexible_study(ready.pair, torque_nm, (torque_nm,), sweep_s=sweep_s, step_s=ready.step_s)


VIEWS = {
    "sweeps": ("Sweeps", "Speed swept up and down: where the two differ, the motion jumps"),
    "stiffness_map": ("Mesh stiffness", "Mesh stiffness over angle and torque"),
    "transmission_error_map": ("Transmission error", "Static transmission error over angle and torque"),
    "pair_stiffness_map": ("Contact stiffness", "Contact stiffness of one pair of teeth"),
    "load_sharing": ("Load sharing", "How much of the load each pair of teeth carries"),
    "natural_frequencies": ("Natural frequencies", "Natural frequencies over the mesh angle"),
    "spectra": ("Spectra", "Spectra at five speeds"),
    "run_up": ("Run-up", "Orders over a run-up"),
}


def show_pair() -> None:
    """Show a chosen view of a pair: maps, sweeps with jumps, or spectra."""
    names = sorted(presets("reduced-fe"), key=lambda name: "light" not in name)  # first the one whose teeth separate
    left, middle, right = st.columns((2, 1, 1))
    looks: dict[str, Any] = {"name": "pair", "format_func": lambda name: presets("reduced-fe")[name].title}
    preset = address.ask_one(left.selectbox, "Pair", names, **looks)
    torque = address.ask_number(middle, "Torque (N·m)", 5.0, 1000.0, name="torque", first=85.0, step=5.0)
    looks = {"name": "sweep", "first": 15.0, "format_func": "{:g}".format}
    sweep = address.ask_one(right.select_slider, "Length of a sweep (s)", (2.0, 5.0, 15.0), **looks)
    study = pair_studied(preset, torque, sweep)
    drawn = pair_study.figures(study, preset)
    looks = {"name": "shown", "format_func": lambda view: VIEWS[view][0], "key": "shown of a pair"}
    name = address.ask_one(st.segmented_control, "Show", list(VIEWS), **looks)
    st.caption(VIEWS[name][1])
    if name == "run_up":
        show_run_up(study.run_up)
    else:
        show_figure(drawn[name], VIEWS[name][1], f"pair {name}")
    for row in pair_study.summary(study)["sweeps"]:  # type: ignore[attr-defined]  # a list of mappings
        jumps_hz = {way: row[f"jump_{way}_hz"] for way in ("up", "down")}
        jumps = ", ".join(f"{way}: {f'jump at {hz:.0f} Hz' if hz else 'no jump'}" for way, hz in jumps_hz.items())
        st.caption(f"Torsional mode {row['torsional_mode_hz']:.0f} Hz. Sweep {jumps}. {row['n_steps']:,} steps.")
    st.caption("In short sweeps the rotors' inertia loads the teeth, more on the way up than on the way down.")
    download("Sweeps as CSV", pair_study.sweeps_csv(study).encode(), "sweeps.csv")


def show_run_up(run_up: OrderMap) -> None:
    """Show levels over order and time, with the speed at the pointer."""
    unit = decibel_text(run_up.unit)
    levels = decibels(run_up.values, run_up.scaling, run_up.unit)
    panel = LevelPanel(levels, run_up.positions, run_up.time_s, run_up.axis_label, "time (s)", unit)
    show_map(panel, "pair run_up", also=(run_up.speed_rpm, "rpm"))


# --------------------
# The figures of three publications beside the models' own, each statement judged by numbers.
# --------------------


@kept(3, "Computing every figure: one to two minutes …")
def computed(name: str) -> Paper:
    """Return the figures of a publication, computed once."""
    return paper(name)


def show_publications() -> None:
    """Let the user choose a publication; its figures are computed on request."""
    looks: dict[str, Any] = {"name": "publication", "format_func": PAPERS.__getitem__}
    name = address.ask_one(st.selectbox, "Publication", list(PAPERS), **looks)
    looks = {"name": "computed", "first": False, "read": address.one_of((False, True)), "key": f"{name} is computed"}
    if not address.ask(st.toggle, "Compute its figures", **looks):
        st.caption("Takes one to two minutes, once.")
        return
    publication = computed(name)
    st.markdown(f"**{publication.summary}** {as_typed(publication.source)}")
    for item in publication.figures:
        st.subheader(as_typed(capitalised(f"{item.answers}: {item.title}")), anchor=False)
        show_figure(item.figure, item.title, f"publication {name} {item.answers}")
        show_wrapping_table(
            {
                "the publication says": [claim.statement for claim in item.claims],
                "the model gives": [claim.number for claim in item.claims],
                "verdict": [claim.judgement for claim in item.claims],
            }
        )
    if publication.unanswered:
        st.subheader("Figures without an answer", anchor=False)
        show_wrapping_table({"figure": list(publication.unanswered), "why": list(publication.unanswered.values())})


TABS = {"One gear": show_gear, "Pair": show_pair, "Publications": show_publications}


def show() -> None:
    """Choose one gear, a pair or a publication; show it."""
    st.subheader("Flexible gears", anchor=False)
    st.caption(
        "Finite-element gears: modes and stress of one gear, jumps and maps of a pair, three publications recomputed."
    )
    looks = {"name": "view", "label_visibility": "collapsed"}
    TABS[address.ask_one(st.segmented_control, "What is shown", list(TABS), **looks)]()
