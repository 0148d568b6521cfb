"""Gears of finite elements: one that is turned, a pair with maps and sweeps, three publications beside the models."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import streamlit as st

from app import flexible as pair_study
from app import gear_body
from app.dashboard import address
from app.dashboard.components import component_of
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import download, packed, show_figure, show_map
from app.dashboard.widgets.tables import show_words
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
"""Of the mesh that is turned: what a browser draws thirty times a second."""
SWING = 0.05
"""Greatest motion of a mode as it is drawn, over the tip radius."""


@dataclass(frozen=True)
class SolidView:
    """The surface of a whole gear.

    Parameters
    ----------
    nodes : array of int, (n,)
        Of a sector, that its surface shows.
    points_mm : array, (n_teeth · n, 3)
    quads : array of int, (n_quads, 4)
        Into the points.
    """

    nodes: np.ndarray
    points_mm: FloatArray
    quads: np.ndarray


def solid_view(study: GearBodyStudy) -> SolidView:
    """Return what is seen of the study's gear from all sides."""
    faces = fe_gear.outer_faces(study.mesh)
    nodes, inverse = np.unique(faces, return_inverse=True)
    n_teeth = study.mesh.blank.n_teeth
    one = np.broadcast_to(study.mesh.points_m[nodes] * 1e3, (n_teeth, len(nodes), 3))
    quads = inverse.reshape(1, -1, 4) + (len(nodes) * np.arange(n_teeth))[:, None, None]
    return SolidView(nodes, gear_body.in_the_whole_gear(study.mesh, one), quads.reshape(-1, 4))


@kept(3, "Meshing the gear, finding its modes …")
def studied(blank: GearBlank, held: fe_gear.Held, force_n: float) -> tuple[GearBodyStudy, SolidView]:
    """Mesh, modes and stress of one gear, done once for equal requests."""
    study = gear_body.study_gear(blank, DOF, n_modes=2 * gear_body.N_SHOWN, held=held, force_n=force_n)
    return study, solid_view(study)


def choose_blank() -> tuple[GearBlank, fe_gear.Held, float]:
    """Let the user set teeth, module, width, body, and how it is held."""
    first, second = st.columns(4), st.columns(4)
    teeth = int(first[0].number_input("Teeth", 12, 120, 50, key="gear teeth", persist_state="session"))
    module = first[1].number_input("Module (mm)", 0.5, 20.0, 3.0, 0.5, key="gear module", persist_state="session")
    face = first[2].number_input("Face width (mm)", 2.0, 200.0, 20.0, key="gear face", persist_state="session")
    bore = first[3].number_input("Bore radius (mm)", 1.0, 500.0, 20.0, key="gear bore", persist_state="session")
    web = second[0].number_input("Web (mm), 0: full disc", 0.0, 200.0, 0.0, key="gear web", persist_state="session")
    shift = second[1].number_input("Profile shift", -1.0, 1.0, 0.0, 0.1, key="gear shift", persist_state="session")
    force = second[2].number_input("Force on a tooth (N)", 1.0, 1e6, 1000.0, key="gear force", persist_state="session")
    bored = second[3].selectbox("Held", ("free", "bore"), key="gear held", persist_state="session") == "bore"
    gear = GearGeometry(teeth, module, profile_shift=shift, face_width_mm=face, bore_radius_mm=bore)
    return GearBlank(gear, web or None), "bore" if bored else "free", force


def show_gear() -> None:
    """One gear: its modes and the stress of a pushed tooth, to be turned."""
    study, view = studied(*choose_blank())
    names = [gear_body.label(study, k) for k in range(min(gear_body.N_SHOWN, len(study.modes.frequencies_hz)))]
    stress = "Stress of a pushed tooth"
    shown = st.selectbox("Show", [*names, *([stress] if study.mesh.size.order > 1 else [])], key="gear shown")
    if shown == stress:
        field = study.load.displacement_m[:, view.nodes]
        values = np.array([study.load.von_mises_pa(k) for k in range(study.mesh.blank.n_teeth)])[:, view.nodes].ravel()
        top = float(np.quantile(values, 0.9995))
        legend = (
            f"von Mises stress, 0 to {top * 1e-6:.3g} MPa, at {study.load.force_n:g} N · drag to turn, wheel to zoom"
        )
    else:
        field = fe_gear.mode_field(study.gear, study.modes, names.index(shown))[:, view.nodes]
        values = np.linalg.norm(field, axis=2).ravel()
        top = float(values.max())
        legend = "coloured by the motion · drag to turn, wheel to zoom, arrow keys turn too"
    motion = gear_body.in_the_whole_gear(study.mesh, field)
    largest = float(np.linalg.norm(motion, axis=1).max())
    _solid(
        key="gear that is turned",
        data={
            "points": packed(view.points_mm.ravel()),
            "quads": packed(view.quads.ravel().astype(np.float64)),
            "motion": packed((motion / largest).ravel()),
            "values": packed(np.clip(values / top, 0.0, 1.0)),
            "stretch": SWING * study.mesh.blank.geometry.tip_radius_mm * (shown != stress),
            "swings": shown != stress,
            "colours": level_colours()[30:240:26].tolist(),
            "legend": legend,
            "words": f"Gear of {study.mesh.blank.n_teeth} teeth: {shown}",
        },
    )
    with st.expander("Numbers", key="gear numbers"):
        st.markdown("  \n".join(as_typed(line) for line in gear_body.lines(study)))
    st.caption(
        f"A coarse mesh, so that it turns smoothly{': Numbers says how coarse' if study.discretisation else ''}. "
        f"{gear_body.PEAKS if shown == stress else 'The motion is drawn much too large.'}"
    )


@kept(4, "Running both sweeps …")
def pair_studied(preset: str, torque_nm: float, sweep_s: float) -> pair_study.Study:
    """Maps, sweeps and spectra of a pair, done once for equal requests."""
    ready = ReducedPair().prepare(SimulationSetup(preset, {}), np.random.default_rng(0))
    return pair_study.flexible_study(ready.pair, torque_nm, (torque_nm,), sweep_s=sweep_s, step_s=ready.step_s)


WORDS = {
    "sweeps": "Sweeps up and down: where they part, the motion jumps",
    "stiffness_map": "Mesh stiffness over angle and torque",
    "transmission_error_map": "Static transmission error over angle and torque",
    "pair_stiffness_map": "Contact stiffness of one pair",
    "load_sharing": "Which pair carries how much",
    "natural_frequencies": "Natural frequencies over the mesh angle",
    "spectra": "Spectra at five speeds",
    "run_up": "Orders over a run-up",
}


def show_pair() -> None:
    """A pair: what is looked at, of maps, sweeps with jumps, spectra."""
    names = sorted(presets("reduced-fe"), key=lambda name: "light" not in name)  # first the one whose teeth part
    left, middle, right = st.columns((2, 1, 1))
    preset = left.selectbox("Pair", names, format_func=lambda n: presets("reduced-fe")[n].title, key="pair preset")
    torque = middle.number_input("Torque (N·m)", 5.0, 1000.0, 85.0, key="pair torque", persist_state="session")
    sweep = right.select_slider("Length of a sweep (s)", (2.0, 5.0, 15.0), 15.0, key="pair sweep")
    study = pair_studied(preset, float(torque), float(sweep))
    drawn = pair_study.figures(study, preset)
    shown = st.segmented_control(
        "Show", list(WORDS), default="sweeps", format_func=WORDS.__getitem__, key="pair shown", persist_state="session"
    )
    name = shown or "sweeps"
    if name == "run_up":
        show_run_up(study.run_up)
    else:
        show_figure(drawn[name], WORDS[name], f"pair {name}")
    for row in pair_study.summary(study)["sweeps"]:  # type: ignore[attr-defined]  # a list of mappings
        said = {way: row[f"jump_{way}_hz"] for way in ("up", "down")}
        jumps = ", ".join(f"{way}: {'no jump' if hz is None else f'jump at {hz:.0f} Hz'}" for way, hz in said.items())
        st.caption(f"Torsional mode {row['torsional_mode_hz']:.0f} Hz. Sweep {jumps}. {row['n_steps']:,} steps.")
    st.caption("Short sweeps load the teeth by the rotors' inertia, more on the way up than on the way down.")
    download("Sweeps as CSV", pair_study.sweeps_csv(study).encode(), "sweeps.csv")


def show_run_up(run_up: OrderMap) -> None:
    """Show levels over order and time, with the speed under the pointer."""
    unit = decibel_text(run_up.unit)
    levels = decibels(run_up.values, run_up.scaling, run_up.unit)
    panel = LevelPanel(levels, run_up.positions, run_up.time_s, run_up.axis_label, "time (s)", unit)
    show_map(panel, "pair run_up", also=(run_up.speed_rpm, "rpm"))


# --------------------
# The figures of three publications beside the models' own, each statement judged by numbers.
# --------------------


@kept(3, "Computing every figure: one to two minutes …")
def computed(name: str) -> Paper:
    """Return the figures of a publication, done once."""
    return paper(name)


def show_publications() -> None:
    """Choose a publication; its figures are computed when asked for."""
    name = st.selectbox("Publication", list(PAPERS), format_func=PAPERS.__getitem__, key="publication")
    if not st.toggle("Compute its figures", key=f"publication {name} wanted"):
        st.caption("Takes one to two minutes, once.")
        return
    found = computed(name)
    st.markdown(f"**{found.summary}** {as_typed(found.source)}")
    for item in found.figures:
        st.subheader(f"{item.answers}: {item.title}")
        show_figure(item.figure, item.title, f"publication {name} {item.answers}")
        show_words(
            {
                "the publication says": [claim.statement for claim in item.claims],
                "the model gives": [claim.found for claim in item.claims],
                "verdict": [claim.judgement for claim in item.claims],
            }
        )
    if found.unanswered:
        st.subheader("Figures without an answer")
        show_words({"figure": list(found.unanswered), "why": list(found.unanswered.values())})


TABS = {"One gear": show_gear, "Pair": show_pair, "Publications": show_publications}


def show() -> None:
    """Choose one gear, a pair or a publication; show it."""
    st.subheader("Flexible gears", anchor=False)
    st.caption(
        "Gears of finite elements: modes and stress of one, jumps and maps of a pair, three publications recomputed."
    )
    looks = {"key": "flexible shown", "name": "view", "label_visibility": "collapsed"}
    TABS[address.ask_one(st.segmented_control, "What is shown", list(TABS), **looks)]()
