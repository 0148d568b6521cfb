"""How the motion changes over one parameter: a bifurcation diagram of the machine that is set."""

from __future__ import annotations

from time import monotonic

import streamlit as st
from streamlit.errors import StreamlitAPIException

from app.bifurcation.folder import Wanted, run_value
from app.bifurcation.kept import Kept
from app.bifurcation.results import NAMES, figure_of, measured_of, points_csv
from app.dashboard.as_typed import as_typed
from app.dashboard.laboratory.bifurcation_setup import Range, branch_of, choose_range, motion_s, parameters_of
from app.dashboard.laboratory.run import Run
from app.dashboard.laboratory.setup import MODEL
from app.dashboard.widgets.errors import show_error
from app.dashboard.widgets.picture import show_picture
from gearsig.errors import GearsigError, InputError
from sims.cracked.continuation import SECTIONS

MOST_VALUES, FIRST_VALUES = 80, 25
MOST_MOTION_S = 240.0
"""Motion that is simulated at most: a minute or two of waiting."""
DIRECTIONS = {"both": "up and down", "up": "up", "down": "down", "rest": "from rest"}
SECTION_WORDS = {"mesh": "mesh cycle", "shaft": "revolution"}
PASS_S = 2.5
"""A fragment hears of a click only when it has run: it runs for so long, shows what there is, and goes on."""
ASKED, FOUND = "bifurcation asked", "bifurcation found"
Found = dict[str, list[Kept]]


def show_bifurcation(healthy: Run, faulty: Run | None) -> None:
    """Choose what is varied; run it on demand; show picture and table."""
    run = faulty or healthy
    if run.setup.model != MODEL:
        st.info("Only the model with rigid gears has a bifurcation diagram: choose one of its machines.")
        return
    names = parameters_of(run.setup)
    first, *numbers = st.columns((3, 2, 2, 2))
    name = first.selectbox("Varied", list(names), format_func=names.__getitem__, key="bifurcation varied")
    chosen = choose_range(run, name, numbers, most=MOST_VALUES, first=FIRST_VALUES)
    left, middle, right = st.columns((2, 3, 2))
    section = left.segmented_control(
        "A point once per",
        SECTIONS,
        default="mesh",
        format_func=SECTION_WORDS.__getitem__,
        key="bifurcation section",
        required=True,
    )
    direction = middle.segmented_control(
        "Direction",
        list(DIRECTIONS),
        default="both",
        format_func=DIRECTIONS.__getitem__,
        key="bifurcation direction",
        required=True,
        help="Up and down: each value goes on from where the last one ended. Where both differ, two motions are "
        "possible, and it is the past that decides.",
    )
    signals = ("transmission_error_m", "driver y", "driven y", "mesh_force_n", *run.vibration_channels)
    signal = right.selectbox("Signal", signals, format_func=_signal_words, key="bifurcation signal")
    wanted = Wanted(branch_of(run, chosen, signal=signal, section=section or "mesh"), direction or "both")
    _run_and_show(run, wanted, chosen)


def _run_and_show(run: Run, wanted: Wanted, chosen: Range) -> None:
    """Run what is missing if that was asked for, showing it as it comes; what is complete stays when it is stopped."""
    question = repr(wanted.definition())
    with st.container(horizontal=True):
        st.button("Draw", type="primary", icon=":material/play_arrow:", on_click=_ask, args=(question,))
        st.button("Stop", icon=":material/stop:", on_click=_ask, args=("",))
    known, found = st.session_state.get(FOUND, ("", {}))
    if known != question:
        found = {name: [] for name in wanted.branches}
    more = False
    if st.session_state.get(ASKED) == question:
        _check(run, wanted)
        st.session_state[FOUND] = (question, found)
        more = _fill(wanted, found)
    if any(measured_of(values) for values in found.values()):
        _show(wanted, found, chosen)
    else:
        st.caption("Nothing is drawn yet: a value takes about half a second, in either direction.")
    if more:
        _go_on()


def _go_on() -> None:
    """Run again: the view alone, or the page where the page is what ran (after a change of tab)."""
    try:
        st.rerun(scope="fragment")
    except StreamlitAPIException:
        st.rerun()


def _fill(wanted: Wanted, found: Found) -> bool:
    """Run values for a while; return whether some are left."""
    n, bar, until = wanted.n_values, st.progress(0.0, "Simulating …"), monotonic() + PASS_S
    for name in wanted.branches:
        values = wanted.branch.values[:: -1 if name == "down" else 1]
        for value in values[len(found[name]) :]:
            done = sum(len(kept) for kept in found.values())
            bar.progress(done / n, f"{NAMES[name]}: {value:.5g} ({done} of {n} values)")
            if monotonic() > until:
                return True
            ends = [one.end for one in found[name] if one.end is not None]
            before = ends[-1] if ends and name != "rest" else None
            found[name].append(run_value(wanted, value, before))
    bar.empty()
    return False


def _show(wanted: Wanted, found: Found, chosen: Range) -> None:
    n_done = sum(len(kept) for kept in found.values())
    show_picture(figure_of(wanted.branch, found), f"Poincaré points over {chosen.title}")
    st.caption(
        "Upper panel: one point per cycle; a single point is a motion that repeats each cycle, two a motion that takes "
        "two cycles, a smear one that never repeats. Lower panel: how large the motion is. Shaded: two motions are "
        "possible, as far as the values tried tell: a range that begins or ends where the sweep does may go on."
        + ("" if n_done == wanted.n_values else f" So far {n_done} of {wanted.n_values} values.")
    )
    reasons = [one for kept in found.values() for one in kept if one.reason]
    if reasons:
        st.warning(f"{len(reasons)} values gave nothing; at {reasons[0].value:.5g}: {as_typed(reasons[0].reason)}")
    st.download_button(
        "Points (CSV)",
        data=points_csv(wanted.branch, found),
        file_name=f"bifurcation_{wanted.branch.sweep.preset}_{wanted.branch.sweep.axes[0].name}.csv",
        mime="text/csv",
        on_click="ignore",
        icon=":material/download:",
    )


def _check(run: Run, wanted: Wanted) -> None:
    motion = motion_s(run, wanted)
    if motion > MOST_MOTION_S:
        raise InputError(
            f"this needs {motion:.0f} s of motion",
            allowed=f"up to {MOST_MOTION_S:.0f} s here",
            remedy="take fewer values, one direction, the mesh cycle, or `gearsig bifurcation` on the command line",
        )


def _ask(question: str) -> None:
    st.session_state[ASKED] = question


def _signal_words(signal: str) -> str:
    words = {"transmission_error_m": "transmission error", "mesh_force_n": "mesh force"}
    return words.get(signal, signal if " " in signal else f"sensor {signal}")


def show_safely(healthy: Run, faulty: Run | None) -> None:
    """Show the view, or what is wrong with what was asked for."""
    try:
        show_bifurcation(healthy, faulty)
    except GearsigError as error:
        show_error(error)
