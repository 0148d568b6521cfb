"""What a bifurcation of the laboratory varies, over which range, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app.dashboard.laboratory.effect_controls import WIDEST
from app.dashboard.laboratory.setup import MODEL, Setup, shown_unit
from gearsig.errors import InputError
from sims.cracked.continuation import DECAYS, RAMP_S, Branch
from sims.cracked.linear import slowest_decay_s
from sims.effects import effect
from sims.machine.operation import Course, Operation
from sims.registry import simulator
from sims.sweep import Axis, Sweep
from sims.values import parameter

if TYPE_CHECKING:
    from streamlit.delta_generator import DeltaGenerator

    from app.bifurcation.folder import Wanted
    from app.dashboard.laboratory.run import Run

N_CYCLES = {"mesh": 80, "shaft": 20}
SPEED, TORQUE = "speed_rpm", "torque_nm"
FIRST = ("half_backlash_um", "roughness_um", "mesh_damping_ratio", "crack_depth_mm", "friction_factor")
"""Parameters offered first; all other numbers follow."""
TEETH = ("teeth_driver", "teeth_driven")


@dataclass(frozen=True)
class Range:
    """Values of what is varied."""

    name: str
    title: str
    values: tuple[float, ...]


def parameters_of(setup: Setup) -> dict[str, str]:
    """Return what can be varied, with a title and a unit: operation, the effects that are on, parameters."""
    found = {SPEED: "Speed (rpm)", TORQUE: "Torque (N·m)"}
    for setting in setup.effects:
        severity = effect(setting.name).severity
        found[setting.name] = _titled(f"Fault: {effect(setting.name).title}", severity.unit)
    known = {p.name: p for p in simulator(MODEL).parameters}
    numbers = [p.name for p in known.values() if not p.choices and not p.whole and p.name not in TEETH]
    for name in (*FIRST, *(n for n in numbers if n not in FIRST)):
        meaning = known[name].meaning.split(";")[0]
        found[name] = _titled(meaning[:1].upper() + meaning[1:], known[name].unit)
    return found


def choose_range(run: Run, name: str, places: Sequence[DeltaGenerator], *, most: int, first: int) -> Range:
    """Let the user choose from, to, and how many."""
    low, high = _suggested(run, name)
    start, stop, number = places
    key = f"bifurcation {run.setup.preset} {name}"
    one = start.number_input("From", value=low, format="%g", key=f"{key} from", persist_state="session")
    other = stop.number_input("To", value=high, format="%g", key=f"{key} to", persist_state="session")
    n = number.number_input("Values", 3, most, first, step=1, key="bifurcation values", persist_state="session")
    if one is None or other is None or not one < other:
        raise InputError(f"the range goes from {one} to {other}", allowed="ascending")
    values = tuple(float(f"{v:.8g}") for v in np.linspace(float(one), float(other), int(n)))
    return Range(name, parameters_of(run.setup)[name], values)


def branch_of(run: Run, chosen: Range, *, signal: str, section: str) -> Branch:
    """Return what is run at each value: the machine as it is set, but for what is varied."""
    setup = run.setup
    options = next((s.options for s in setup.effects if s.name == chosen.name), {})
    sweep = Sweep(
        MODEL,
        (Axis(chosen.name, chosen.values, options),),
        preset=setup.preset,
        parameters=dict(setup.parameters),
        effects=tuple(s for s in setup.effects if s.name != chosen.name),
        speed_rpm=Course.constant(setup.speed_rpm),
        torque_nm=Course.constant(setup.torque_nm),
        sampling_rate_hz=setup.sampling_rate_hz,
        seed=setup.seed,
        common_seed=True,
    )
    return Branch(sweep, signal, section, N_CYCLES[section])


def motion_s(run: Run, wanted: Wanted) -> float:
    """Motion that is simulated in all, about."""
    branch, setup = wanted.branch, run.setup
    settle_s = RAMP_S + DECAYS * slowest_decay_s(run.machine, Operation.steady(setup.speed_rpm, setup.torque_nm))
    varied = branch.sweep.axes[0].name == SPEED
    speeds = np.array(branch.values if varied else [setup.speed_rpm] * len(branch.values))
    per_revolution = run.machine.mesh.pair.driver.teeth if branch.section == "mesh" else 1
    cycles_s = branch.n_cycles * 60.0 / (np.maximum(speeds, 1.0) * per_revolution)
    return float(len(wanted.branches) * np.sum(settle_s + cycles_s))


def _suggested(run: Run, name: str) -> tuple[float, float]:
    setup = run.setup
    if name in (SPEED, TORQUE):
        own = setup.speed_rpm if name == SPEED else setup.torque_nm
        return _rounded(0.5 * own), _rounded(1.5 * own) or 10.0
    for setting in setup.effects:
        if setting.name == name:
            severity = effect(name).severity
            return float(max(severity.low, 0.0)), _rounded(min(severity.high, WIDEST * severity.typical))
    wanted = parameter(simulator(MODEL).parameters, name)
    values = {**_preset_values(setup), **dict(setup.parameters)}
    own = float(values.get(name, wanted.default) or 0.0)
    low, high = wanted.low or 0.0, wanted.high or 1.0
    if own > 0.0:
        return max(low, _rounded(0.5 * own)), min(high, _rounded(2.0 * own))
    return low, min(high, max(_rounded(0.02 * high), low))


def _preset_values(setup: Setup) -> dict[str, float | str]:
    from sims.presets import preset

    return dict(preset(MODEL, setup.preset).parameters)


def _rounded(value: float) -> float:
    return float(f"{value:.2g}")


def _titled(title: str, unit: str) -> str:
    return f"{title} ({shown_unit(unit)})" if unit else title
