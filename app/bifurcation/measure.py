"""One value of a bifurcation: from a steady run to its Poincaré points and what kind of motion they speak for."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.phase.types import BifurcationDiagram, PhasePortrait, PoincareSection
from sims.cracked.continuation import TRANSMISSION_ERROR, Branch, SteadyRun
from sims.cracked.layout import COORDINATES, SIGNALS

if TYPE_CHECKING:
    from gearsig.phase.lock import CycleLock

LEAST_FOR_KIND = 400
"""Cycles that the 0–1 test and the exponent need to say something."""
CYCLES = {"mesh": "mesh cycle", "shaft": "revolution of the input shaft"}
N_ROTATING = 4
UNITS = {"um": "µm", "N m": "N·m", "g mm": "g·mm", "deg": "°"}
"""Units of the catalogue as people read them; the others are read as they are."""


@dataclass(frozen=True)
class Measured:
    """What is kept of one value.

    Parameters
    ----------
    value : float
    section : PoincareSection
    period : int
        Cycles after which the section repeats; 0: it does not within 16.
    settled_s : float
        Time that was left out ahead.
    separated_share : float
        Share of the time without a tooth in contact.
    motion : str
        Kind of motion; empty where it was not asked for.
    exponent_per_s, k : float
        Largest Lyapunov exponent and the 0–1 test's K; nan where there is none.
    """

    value: float
    section: PoincareSection
    period: int
    settled_s: float
    separated_share: float
    motion: str = ""
    exponent_per_s: float = float("nan")
    k: float = float("nan")


def measured(run: SteadyRun, branch: Branch, *, phase_cycles: float = 0.0, with_kind: bool = False) -> Measured:
    """Take the Poincaré points of a steady run and, for some seconds more, the kind of motion."""
    from gearsig.phase.kind import kind_of_motion
    from gearsig.phase.section import locked_section, section_period

    portrait, lock = portrait_of(run, branch), lock_of(run, branch)
    section = locked_section(portrait, lock, phase_cycles=phase_cycles)
    kind = kind_of_motion(portrait, lock, noise_free=_is_noise_free(run, branch)) if with_kind else None
    return Measured(
        run.value,
        section,
        section_period(section),
        run.settled_s,
        run.separated_share,
        kind.kind if kind else "",
        kind.exponent.exponent_per_s if kind and kind.exponent else float("nan"),
        kind.chaos_test.k if kind and kind.chaos_test else float("nan"),
    )


def diagram_of(branch: Branch, found: list[Measured]) -> BifurcationDiagram:
    """Return the diagram of one branch."""
    from gearsig.phase.bifurcation import bifurcation_diagram

    name, unit = parameter_words(branch)
    return bifurcation_diagram(((m.value, m.section) for m in found), parameter=name, unit=unit)


def parameter_words(branch: Branch) -> tuple[str, str]:
    """Name and unit of what is varied, for people."""
    from sims.effects import effect
    from sims.effects import effects as known_effects
    from sims.registry import simulator
    from sims.values import parameter

    name = branch.sweep.axes[0].name
    if name in ("speed_rpm", "torque_nm"):
        return {"speed_rpm": ("speed", "rpm"), "torque_nm": ("torque", "N·m")}[name]
    if name in known_effects():
        severity = effect(name).severity
        return f"{name.replace('_', ' ')}: {severity.name.replace('_', ' ')}", UNITS.get(severity.unit, severity.unit)
    unit = parameter(simulator(branch.sweep.model).parameters, name).unit
    ending = "_" + unit.replace(" ", "_").replace("/", "_per_").replace("^", "").lower()
    return (name.removesuffix(ending) if unit else name).replace("_", " "), UNITS.get(unit, unit)


def portrait_of(run: SteadyRun, branch: Branch) -> PhasePortrait:
    """Return the path of the wanted signal, with its rate where the model knows it."""
    response, signal = run.response, branch.signal
    names: tuple[str, ...] = (signal.replace("_", " "),)
    units: tuple[str, ...]
    if signal == TRANSMISSION_ERROR:
        columns = [response[signal], run.rate_of_transmission_error_mps]
        names, units = ("transmission error", "its rate"), ("m", "m/s")
    elif signal in COORDINATES:
        columns, names = [response[signal], response[f"{signal} velocity"]], (signal, f"{signal} velocity")
        units = ("rad", "rad/s") if COORDINATES.index(signal) < N_ROTATING else ("m", "m/s")
    elif signal in SIGNALS:
        columns, units = [response[signal]], (_unit(signal),)
    else:
        return _measured_path(run, signal)
    rate_hz = 1.0 / response.interval_s
    return PhasePortrait(np.column_stack(columns), rate_hz, names, units, "states", signal, response.start_s)


def lock_of(run: SteadyRun, branch: Branch) -> CycleLock:
    """Return the cycles of the driver's own angle: they stay those of the teeth whatever the shaft does."""
    from gearsig.angle.types import ShaftAngle
    from gearsig.phase.lock import CycleLock

    response, turn = run.response, 2.0 * pi
    angle = ShaftAngle(
        "input",
        response.time_s,
        np.maximum.accumulate(response["driver angle"]) / turn,
        np.maximum(response["driver angle velocity"], 0.0) / turn,
        "encoder",
    )
    per_revolution = float(run.machine.mesh.pair.driver.teeth) if branch.section == "mesh" else 1.0
    return CycleLock(angle, per_revolution, CYCLES[branch.section])


def _measured_path(run: SteadyRun, channel: str) -> PhasePortrait:
    recording = run.recording
    assert recording is not None  # noqa: S101 - said to the type checker: a channel's run always has one
    values: FloatArray = recording.values(channel)
    unit = recording.channels[recording.index(channel)].unit
    return PhasePortrait(values[:, None], recording.sampling_rate_hz, (channel,), (unit,), "states", channel)


def _unit(signal: str) -> str:
    if signal.endswith("_m"):
        return "m"
    if signal.endswith("_n"):
        return "N"
    base = signal.rsplit(" ", 1)[0]
    length = "rad" if base in COORDINATES[:N_ROTATING] else "m"
    return f"{length}/s^2" if signal.endswith("acceleration") else f"{length}/s"


def _is_noise_free(run: SteadyRun, branch: Branch) -> bool:
    """Whether nothing random acts while the machine runs: no sensor noise, no roughness that never returns."""
    rough = run.machine.roughness
    return branch.signal in SIGNALS and not (rough.locked_to == "time" and rough.rms_um > 0.0)
