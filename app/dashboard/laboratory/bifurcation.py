"""How the motion changes with one parameter: a bifurcation diagram of the machine as set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np
import streamlit as st
from streamlit.errors import StreamlitAPIException

from app.bifurcation import NAMES, BifurcationRequest, KeptValue, figure_of, measured_of, points_csv, run_value
from app.dashboard import address
from app.dashboard.laboratory.run import LaboratoryRun
from app.dashboard.laboratory.setup import MODEL, WIDEST, Setup, shown_unit
from app.dashboard.widgets.charts import download, show_figure
from app.dashboard.widgets.texts import as_typed, capitalised, show_error
from gearsig.errors import GearsigError, InputError
from sims.continuation import DECAYS, RAMP_S, SECTIONS, Branch
from sims.cracked import slowest_decay_s
from sims.effects import effect
from sims.machine import Operation, Profile
from sims.presets import preset
from sims.registry import simulator
from sims.simulator import parameter
from sims.sweep import Axis, Sweep

if TYPE_CHECKING:
    from streamlit.delta_generator import DeltaGenerator


N_CYCLES = {"mesh": 80, "shaft": 20}
SPEED, TORQUE = "speed_rpm", "torque_nm"
FIRST = ("half_backlash_um", "roughness_um", "mesh_damping_ratio", "crack_depth_mm", "friction_factor")
"""Parameters offered first; all other numbers follow."""
TEETH = ("teeth_driver", "teeth_driven")


@dataclass(frozen=True)
class Range:
    """The varied parameter and its values."""

    name: str
    title: str
    values: tuple[float, ...]


def parameters_of(setup: Setup) -> dict[str, str]:
    """Return what can be varied, name → title with unit: operation, active effects, parameters."""
    titles = {SPEED: "Speed (rpm)", TORQUE: "Torque (N·m)"}
    for setting in setup.effects:
        severity = effect(setting.name).severity
        titles[setting.name] = _titled(f"Fault: {effect(setting.name).title}", severity.unit)
    known = {p.name: p for p in simulator(MODEL).parameters}
    numbers = [p.name for p in known.values() if not p.choices and not p.whole and p.name not in TEETH]
    for name in (*FIRST, *(n for n in numbers if n not in FIRST)):
        meaning = known[name].meaning.split(";")[0]
        titles[name] = _titled(capitalised(meaning), known[name].unit)
    return titles


def choose_range(run: LaboratoryRun, name: str, places: Sequence[DeltaGenerator]) -> Range:
    """Let the user choose the first and last value and the number of values."""
    low, high = _suggested(run, name)
    start, stop, number = places
    key = f"bifurcation {run.setup.preset} {name}"
    first = address.ask_number(start, "From", name="from", first=low, key=f"{key} from")
    last = address.ask_number(stop, "To", name="to", first=high, key=f"{key} to")
    n = address.ask_number(number, "Values", 3, 80, name="values", first=25, whole=True)
    if not first < last:
        raise InputError(f"the range goes from {first:g} to {last:g}", allowed="ascending")
    values = tuple(float(f"{v:.8g}") for v in np.linspace(first, last, n))
    return Range(name, parameters_of(run.setup)[name], values)


def branch_of(run: LaboratoryRun, chosen: Range, *, signal: str, section: str) -> Branch:
    """Return what is run at each value: the machine as set, except for what is varied."""
    setup = run.setup
    options = next((s.options for s in setup.effects if s.name == chosen.name), {})
    sweep = Sweep(
        MODEL,
        (Axis(chosen.name, chosen.values, options),),
        preset=setup.preset,
        parameters=dict(setup.parameters),
        effects=tuple(s for s in setup.effects if s.name != chosen.name),
        speed_rpm=Profile.constant(setup.speed_rpm),
        torque_nm=Profile.constant(setup.torque_nm),
        sampling_rate_hz=setup.sampling_rate_hz,
        seed=setup.seed,
        common_seed=True,
    )
    return Branch(sweep, signal, section, N_CYCLES[section])


def motion_s(run: LaboratoryRun, request: BifurcationRequest) -> float:
    """Return the approximate length of all motion to be simulated, in s."""
    branch, setup = request.branch, run.setup
    settle_s = RAMP_S + DECAYS * slowest_decay_s(run.machine, Operation.steady(setup.speed_rpm, setup.torque_nm))
    varied = branch.sweep.axes[0].name == SPEED
    speeds = np.array(branch.values if varied else [setup.speed_rpm] * len(branch.values))
    per_revolution = run.machine.mesh.pair.driver.teeth if branch.section == "mesh" else 1
    cycles_s = branch.n_cycles * 60.0 / (np.maximum(speeds, 1.0) * per_revolution)
    return float(len(request.branches) * np.sum(settle_s + cycles_s))


def _suggested(run: LaboratoryRun, name: str) -> tuple[float, float]:
    setup = run.setup
    if name in (SPEED, TORQUE):
        usual = setup.speed_rpm if name == SPEED else setup.torque_nm
        return _rounded(0.5 * usual), _rounded(1.5 * usual) or 10.0
    for setting in setup.effects:
        if setting.name == name:
            severity = effect(name).severity
            return float(max(severity.low, 0.0)), _rounded(min(severity.high, WIDEST * severity.typical))
    known = parameter(simulator(MODEL).parameters, name)
    values = {**preset(MODEL, setup.preset).parameters, **dict(setup.parameters)}
    usual = float(values.get(name, known.default) or 0.0)
    low, high = known.low or 0.0, known.high or 1.0
    if usual > 0.0:
        return max(low, _rounded(0.5 * usual)), min(high, _rounded(2.0 * usual))
    return low, min(high, max(_rounded(0.02 * high), low))


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")


def _titled(title: str, unit: str) -> str:
    return f"{title} ({shown_unit(unit)})" if unit else title


MAX_MOTION_S = 240.0
"""Maximum length of motion that is simulated: a minute or two of waiting."""
DIRECTIONS = {"both": "up and down", "up": "up", "down": "down", "rest": "from rest"}
SECTION_WORDS = {"mesh": "mesh cycle", "shaft": "revolution"}
PASS_S = 2.5
"""A fragment notices a click only after a run: each run takes this long, shows what there is, and starts the next."""
ASKED, DONE = "bifurcation asked", "bifurcation done"
Branches = dict[str, list[KeptValue]]


def show_bifurcation(run: LaboratoryRun) -> None:
    """Choose what is varied, run it on demand, and show the figure and data, or what is wrong with the request."""
    try:
        _choose_and_show(run)
    except GearsigError as error:
        show_error(error)


def _choose_and_show(run: LaboratoryRun) -> None:
    if run.setup.model != MODEL:
        st.info("Only the model with rigid gears has a bifurcation diagram: choose one of its machines.")
        return
    names = parameters_of(run.setup)
    first, *numbers = st.columns((3, 2, 2, 2))
    looks: dict[str, Any] = {"name": "varied", "format_func": names.__getitem__}
    name = address.ask_one(first.selectbox, "Varied", list(names), **looks)
    chosen = choose_range(run, name, numbers)
    left, middle, right = st.columns((2, 3, 2))
    looks = {"name": "once", "first": "mesh", "format_func": SECTION_WORDS.__getitem__, "required": True}
    section = address.ask_one(left.segmented_control, "A point once per", SECTIONS, **looks)
    about = (
        "Up and down: each value continues from where the last one ended. Where the two differ, two motions are "
        "possible, and the history decides between them."
    )
    looks = {"name": "direction", "format_func": DIRECTIONS.__getitem__, "required": True, "help": about}
    direction = address.ask_one(middle.segmented_control, "Direction", list(DIRECTIONS), **looks)
    signals = ("transmission_error_m", "driver y", "driven y", "mesh_force_n", *run.vibration_channels)
    looks = {"name": "followed", "format_func": _signal_title}
    signal = address.ask_one(right.selectbox, "Signal", signals, **looks)
    request = BifurcationRequest(branch_of(run, chosen, signal=signal, section=section), direction)
    _run_and_show(run, request, chosen)


def _run_and_show(run: LaboratoryRun, request: BifurcationRequest, chosen: Range) -> None:
    """Run missing values on request, showing them as they come; complete ones stay after a stop."""
    question = repr(request.definition())
    known, branches = st.session_state.get(DONE, ("", {}))
    if known != question:
        branches = {name: [] for name in request.branches}
    is_running = st.session_state.get(ASKED) == question and _n_done(branches) < request.n_values
    with st.container(horizontal=True):
        st.button("Draw", type="primary", icon=":material/play_arrow:", on_click=_ask, args=(question,))
        st.button("Stop", icon=":material/stop:", disabled=not is_running, on_click=_ask, args=("",))
    if is_running:
        motion = motion_s(run, request)
        if motion > MAX_MOTION_S:
            raise InputError(
                f"this needs {motion:.0f} s of motion",
                allowed=f"up to {MAX_MOTION_S:.0f} s here",
                remedy="take fewer values, one direction, the mesh cycle, or `gearsig bifurcation` on the command line",
            )
        st.session_state[DONE] = (question, branches)
        _fill(request, branches)
    if any(measured_of(values) for values in branches.values()):
        _show(request, branches, chosen)
    else:
        st.caption("Nothing is drawn yet: each value takes about half a second per direction.")
    if is_running:
        _go_on()


def _go_on() -> None:
    """Run again: the view alone, or the whole page if that is what ran (after a change of tab)."""
    try:
        st.rerun(scope="fragment")
    except StreamlitAPIException:
        st.rerun()


def _fill(request: BifurcationRequest, branches: Branches) -> None:
    """Run values for up to about `PASS_S`."""
    n, bar, until = request.n_values, st.progress(0.0, "Simulating …"), monotonic() + PASS_S
    for name in request.branches:
        values = request.branch.values[:: -1 if name == "down" else 1]
        for value in values[len(branches[name]) :]:
            done = _n_done(branches)
            bar.progress(done / n, f"{NAMES[name]}: {value:.5g} ({done} of {n} values)")
            if monotonic() > until:
                return
            ends = [kept.end for kept in branches[name] if kept.end is not None]
            before = ends[-1] if ends and name != "rest" else None
            branches[name].append(run_value(request, value, before))
    bar.empty()


def _n_done(branches: Branches) -> int:
    return sum(len(kept) for kept in branches.values())


def _show(request: BifurcationRequest, branches: Branches, chosen: Range) -> None:
    n_done = _n_done(branches)
    show_figure(figure_of(request.branch, branches), f"Poincaré points over {chosen.title}", "bifurcation")
    st.caption(
        "Upper panel: one point per cycle; a single point is a motion that repeats each cycle, two points one that "
        "takes two cycles, a smear one that never repeats. Lower panel: how large the motion is. Shaded: two motions "
        "are possible, as far as the values tried show; a range that reaches an end of the sweep may extend further."
        + ("" if n_done == request.n_values else f" So far {n_done} of {request.n_values} values.")
    )
    reasons = [value for kept in branches.values() for value in kept if value.reason]
    if reasons:
        st.warning(f"{len(reasons)} values gave no result; at {reasons[0].value:.5g}: {as_typed(reasons[0].reason)}")
    sweep = request.branch.sweep
    points = points_csv(request.branch, branches)
    download("Points (CSV)", points, f"bifurcation_{sweep.preset}_{sweep.axes[0].name}.csv")


def _ask(question: str) -> None:
    st.session_state[ASKED] = question


def _signal_title(signal: str) -> str:
    titles = {"transmission_error_m": "transmission error", "mesh_force_n": "mesh force"}
    return titles.get(signal, signal if " " in signal else f"sensor {signal}")
