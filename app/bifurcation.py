"""A bifurcation study in a folder: each branch in its own process, value by value, which can be stopped and resumed."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from itertools import groupby
from math import isfinite, pi
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gearsig import phase
from gearsig.cache import read_arrays, remove_parts, write_whole
from gearsig.checks import FloatArray, count, one_of, within
from gearsig.errors import GearsigError, RefusalError
from gearsig.formatting import csv_rows
from gearsig.processes import active_cluster, killed_text, n_processors, run_jobs
from gearsig.report import write_folder
from sims.continuation import DECAYS, TRANSMISSION_ERROR, Branch, End, SteadyRun
from sims.cracked import SIGNALS, PairState
from sims.gear_pair import COORDINATES
from sims.sweep import claimed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MIN_FOR_KIND = 400
"""Minimum number of cycles for the 0–1 test and the exponent."""
CYCLES = {"mesh": "mesh cycle", "shaft": "revolution of the input shaft"}
N_ROTATING = 4
UNITS = {"um": "µm", "N m": "N·m", "g mm": "g·mm", "deg": "°"}
"""Units of the catalogue that are displayed differently; all others are displayed as they are."""


@dataclass(frozen=True)
class Measured:
    """Results for one parameter value.

    Parameters
    ----------
    value : float
    section : PoincareSection
    period : int
        Cycles after which the section repeats; 0: not within 16 cycles.
    settled_s : float
        Length of the transient that was left out.
    separated_share : float
        Share of the time without a tooth in contact.
    motion : str
        Kind of motion; empty if not requested.
    exponent_per_s, k : float
        Largest Lyapunov exponent and K of the 0–1 test; nan if not available.
    """

    value: float
    section: phase.PoincareSection
    period: int
    settled_s: float
    separated_share: float
    motion: str = ""
    exponent_per_s: float = float("nan")
    k: float = float("nan")


def measured(run: SteadyRun, branch: Branch, *, phase_cycles: float = 0.0, with_kind: bool = False) -> Measured:
    """Compute the Poincaré points of a steady run and, which takes some seconds more, the kind of motion."""
    portrait, lock = portrait_of(run, branch), lock_of(run, branch)
    section = phase.poincare_section(portrait, lock, phase_cycles=phase_cycles)
    exponent, k, motion = float("nan"), float("nan"), ""
    if with_kind:
        # A run is noise-free if nothing random acts: no sensor noise, no roughness that never repeats.
        rough = run.machine.roughness
        noise_free = branch.signal in SIGNALS and not (rough.locked_to == "time" and rough.rms_um > 0.0)
        kind = phase.kind_of_motion(portrait, lock, noise_free=noise_free)
        motion = kind.kind
        exponent = kind.exponent.exponent_per_s if kind.exponent else exponent
        k = kind.chaos_test.k if kind.chaos_test else k
    period = phase.section_period(section)
    return Measured(run.value, section, period, run.settled_s, run.separated_share, motion, exponent, k)


def parameter_text(branch: Branch) -> tuple[str, str]:
    """Return the display name and unit of the varied parameter."""
    from sims.effects import effect
    from sims.effects import effects as known_effects
    from sims.registry import simulator
    from sims.simulator import parameter

    name = branch.sweep.axes[0].name
    if name in ("speed_rpm", "torque_nm"):
        return {"speed_rpm": ("speed", "rpm"), "torque_nm": ("torque", "N·m")}[name]
    if name in known_effects():
        severity = effect(name).severity
        return f"{name.replace('_', ' ')}: {severity.name.replace('_', ' ')}", UNITS.get(severity.unit, severity.unit)
    unit = parameter(simulator(branch.sweep.model).parameters, name).unit
    ending = "_" + unit.replace(" ", "_").replace("/", "_per_").replace("^", "").lower()
    return (name.removesuffix(ending) if unit else name).replace("_", " "), UNITS.get(unit, unit)


def portrait_of(run: SteadyRun, branch: Branch) -> phase.PhasePortrait:
    """Return the phase-space path of the branch's signal, with its rate if the model provides it."""
    response, signal = run.response, branch.signal
    if signal not in (TRANSMISSION_ERROR, *COORDINATES, *SIGNALS):
        recording = run.recording
        assert recording is not None  # noqa: S101 - said to the type checker: a channel's run always has one
        unit = recording.channels[recording.index(signal)].unit
        values: FloatArray = recording.values(signal)
        return phase.PhasePortrait(values[:, None], recording.sampling_rate_hz, (signal,), (unit,), "states", signal)
    coordinate = signal.rsplit(" ", 1)[0] if signal not in COORDINATES else signal
    length = "rad" if coordinate in COORDINATES[:N_ROTATING] else "m"
    names: tuple[str, ...] = (signal.replace("_", " "),)
    units: tuple[str, ...]
    if signal == TRANSMISSION_ERROR:
        columns = [response[signal], run.rate_of_transmission_error_mps]
        names, units = ("transmission error", "its rate"), ("m", "m/s")
    elif signal in COORDINATES:
        columns, names = [response[signal], response[f"{signal} velocity"]], (signal, f"{signal} velocity")
        units = (length, f"{length}/s")
    else:
        known = {"_m": "m", "_n": "N"}.get(signal[-2:])
        columns, units = [response[signal]], (known or f"{length}/s{'^2' if signal.endswith('acceleration') else ''}",)
    rate_hz = 1.0 / response.interval_s
    return phase.PhasePortrait(np.column_stack(columns), rate_hz, names, units, "states", signal, response.start_s)


def lock_of(run: SteadyRun, branch: Branch) -> phase.CycleLock:
    """Return the cycles of the driver's angle, which follow the teeth whatever the shaft does."""
    from gearsig.angle import ShaftAngle

    response, turn = run.response, 2.0 * pi
    angle = ShaftAngle(
        "input",
        response.time_s,
        np.maximum.accumulate(response["driver angle"]) / turn,
        np.maximum(response["driver angle velocity"], 0.0) / turn,
        "encoder",
    )
    per_revolution = float(run.machine.mesh.pair.driver.teeth) if branch.section == "mesh" else 1.0
    return phase.CycleLock(angle, per_revolution, CYCLES[branch.section])


NUMBERS = ("period", "settled_s", "separated_share", "exponent_per_s", "k")
MAX_BYTES = 1_000_000_000
"""Maximum size of the arrays of one value; usually they have some ten thousand bytes."""


@dataclass(frozen=True)
class KeptValue:
    """Outcome of one value: its points and final state, or the reason why there are none."""

    value: float
    measured: Measured | None
    end: End | None
    reason: str = ""


def save(kept: KeptValue, path: Path) -> None:
    """Write one value atomically."""
    fields: dict[str, np.ndarray] = {"value": np.array(kept.value), "reason": np.array(kept.reason)}
    if kept.measured is not None and kept.end is not None:
        points, section, end = kept.measured, kept.measured.section, kept.end
        fields |= {
            "points": section.points,
            "times_s": section.times_s,
            "extent": section.extent,
            "words": np.array([*section.axis_names, *section.units, section.section, section.source]),
            "numbers": np.array(
                [points.period, points.settled_s, points.separated_share, points.exponent_per_s, points.k]
            ),
            "motion": np.array(points.motion),
            "q": end.state.q,
            "v": end.state.v,
            "end": np.array([end.state.set_angle_rad, end.speed_rpm, end.torque_nm]),
        }
    write_whole(path, lambda file: np.savez(file, allow_pickle=False, **fields))


def load(path: Path) -> KeptValue | None:
    """Read one value; None if it is missing or damaged."""
    data = read_arrays(path, MAX_BYTES)
    if data is None:
        return None
    value = float(data["value"])
    if "points" not in data:
        return KeptValue(value, None, None, str(data["reason"]))
    d, words = data["points"].shape[1], tuple(str(w) for w in data["words"])
    names, units, (section_name, source) = words[:d], words[d : 2 * d], words[2 * d :]
    section = phase.PoincareSection(
        data["points"], data["times_s"], names, units, data["extent"], "locked", section_name, source
    )
    numbers: dict[str, Any] = {name: float(x) for name, x in zip(NUMBERS, data["numbers"], strict=True)}
    points = Measured(value, section, motion=str(data["motion"]), **numbers | {"period": int(numbers["period"])})
    angle, speed, torque = (float(x) for x in data["end"])
    return KeptValue(value, points, End(PairState(data["q"], data["v"], angle), speed, torque))


DEFINITION, VALUES = "definition.json", "values"
DIRECTIONS = ("both", "up", "down", "rest")


@dataclass(frozen=True)
class BifurcationRequest:
    """A requested bifurcation study.

    Parameters
    ----------
    branch : Branch
    direction : str
        "up", "down", "both": each value starts from the final state of the last one; "rest": each starts from static
        equilibrium, independently of the others.
    phase_cycles : float
        Position in the cycle at which the points are taken, 0 to 1.
    with_kind : bool
        Whether the kind of motion is determined, which takes some seconds per value.
    """

    branch: Branch
    direction: str = "both"
    phase_cycles: float = 0.0
    with_kind: bool = False

    def __post_init__(self) -> None:
        one_of(self.direction, "direction", DIRECTIONS)
        within(self.phase_cycles, "phase", 0.0, 1.0, remedy="give a fraction of a cycle")

    @property
    def branches(self) -> tuple[str, ...]:
        """Names of the branches in the results."""
        return ("up", "down") if self.direction == "both" else (self.direction,)

    @property
    def n_values(self) -> int:
        """Total number of runs."""
        return len(self.branches) * len(self.branch.values)

    def definition(self) -> dict[str, Any]:
        """Return the values that determine the results."""
        sweep = self.branch.sweep.definition()
        for unused in ("duration_s", "common_seed", "extension"):
            del sweep[unused]
        return {
            **sweep,
            "signal": self.branch.signal,
            "section": self.branch.section,
            "n_cycles": self.branch.n_cycles,
            "direction": self.direction,
            "phase_cycles": self.phase_cycles,
            "with_kind": self.with_kind,
        }


def run_folder(
    request: BifurcationRequest,
    folder: Path,
    *,
    n_processes: int | None = None,
    on_progress: Callable[[int], object] | None = None,
) -> dict[str, list[KeptValue]]:
    """Run all values that the folder does not hold yet; return all values by branch, ascending.

    The branches run in parallel. After Ctrl-C complete values are kept, and the same call continues from there.
    """
    workers = n_processors() if n_processes is None else count(n_processes, "n_processes")
    claimed(folder, request.definition(), DEFINITION, "bifurcation")
    (folder / VALUES).mkdir(exist_ok=True)
    # Along a branch each value needs the previous one; from rest they are independent.
    places = tuple(range(len(request.branch.values)))
    jobs = [(name, places[::-1] if name == "down" else places) for name in request.branches]
    if request.direction == "rest":
        jobs = [("rest", (place,)) for place in places]

    def show() -> None:
        if on_progress is not None:
            on_progress(n_complete(request, folder))

    try:
        if active_cluster() is None and (workers == 1 or len(jobs) == 1):
            for job in jobs:
                run_places(request, folder, *job, on_progress)
        else:
            running = run_jobs(
                _run_job,
                ((request, folder, *job) for job in jobs),
                n_workers=min(workers, len(jobs)),
                if_killed=_killed,
                on_wait=show,
            )
            with closing(running):
                for _ in running:
                    show()
    finally:
        remove_parts(folder / VALUES)
    return complete(request, folder)


BranchJob = tuple[BifurcationRequest, Path, str, Sequence[int]]


def _run_job(job: BranchJob) -> None:
    run_places(*job)


def _killed(job: BranchJob) -> None:
    raise RefusalError(
        killed_text(f"ran the branch {NAMES[job[2]]!r}"),
        remedy="the same command continues from what is complete",
    )


def complete(request: BifurcationRequest, folder: Path) -> dict[str, list[KeptValue]]:
    """Return the values that the folder holds, by branch, ascending."""
    n = len(request.branch.values)
    kept = {name: [load(value_path(folder, name, place)) for place in range(n)] for name in request.branches}
    return {name: [value for value in values if value is not None] for name, values in kept.items()}


def n_complete(request: BifurcationRequest, folder: Path) -> int:
    """Return the number of values that the folder holds."""
    n = len(request.branch.values)
    return sum(value_path(folder, name, place).exists() for name in request.branches for place in range(n))


def value_path(folder: Path, name: str, place: int) -> Path:
    """Return the path of one value's file; `place` counts ascending values."""
    return folder / VALUES / f"{name}_{place:05d}.npz"


def run_places(
    request: BifurcationRequest,
    folder: Path,
    name: str,
    places: Sequence[int],
    on_progress: Callable[[int], object] | None = None,
) -> None:
    """Run values in the given order, starting with the first that the folder does not hold."""
    before: End | None = None
    for place in places:
        path = value_path(folder, name, place)
        kept = load(path)
        if kept is None:
            kept = run_value(request, request.branch.values[place], before)
            save(kept, path)
        before = kept.end or before
        if on_progress is not None:
            on_progress(n_complete(request, folder))


def run_value(request: BifurcationRequest, value: float, before: End | None) -> KeptValue:
    """Run one value; an error becomes the reason for having no result."""
    try:
        run = request.branch.run(value, before)
        points = measured(run, request.branch, phase_cycles=request.phase_cycles, with_kind=request.with_kind)
    except GearsigError as error:
        return KeptValue(value, None, None, str(error))
    return KeptValue(value, points, run.end)


POINTS, SUMMARY, FIGURE = "points.csv", "bifurcation.json", "bifurcation.png"
NAMES = {"up": "rising", "down": "falling", "rest": "from rest"}
TRANSIENT = f"{DECAYS:g} time constants of the machine's slowest decay are left out at each value"
BOUNDED = "known only at the values tried; a range that begins or ends with the sweep may extend beyond it"

Values = Mapping[str, Sequence[KeptValue]]


def write_results(request: BifurcationRequest, values: Values, folder: Path) -> tuple[Path, ...]:
    """Write figure, table and summary; return their paths.

    Raises
    ------
    RefusalError
        If no value gave points.
    """
    figures = {FIGURE: figure_of(request.branch, values)}
    text = json.dumps(summary(request, values), indent=2, ensure_ascii=False) + "\n"
    return write_folder(folder, figures, {POINTS: points_csv(request.branch, values), SUMMARY: text})


def diagrams(branch: Branch, values: Values) -> dict[str, phase.BifurcationDiagram]:
    """Return the diagram of each branch that has points."""
    parameter, unit = parameter_text(branch)
    sections = {name: [(m.value, m.section) for m in measured_of(kept)] for name, kept in values.items()}
    return {
        name: phase.bifurcation_diagram(points, parameter=parameter, unit=unit)
        for name, points in sections.items()
        if points
    }


def measured_of(kept: Sequence[KeptValue]) -> list[Measured]:
    """Return the values that gave points."""
    return [value.measured for value in kept if value.measured is not None]


def figure_of(branch: Branch, values: Values) -> Figure:
    """Draw one branch or both."""
    from gearsig.plot import bifurcation_figure

    drawn = list(diagrams(branch, values).values())
    if not drawn:
        reasons = [value.reason for kept in values.values() for value in kept if value.reason]
        raise RefusalError(
            f"no value gave points: {reasons[0] if reasons else 'none was run'}", remedy="change the range or settings"
        )
    preset = branch.sweep.preset
    words = f"{drawn[0].axis_name} once per {drawn[0].section} over {drawn[0].parameter_name}, {preset}"
    return bifurcation_figure(*drawn[:2], title=words)


def points_csv(branch: Branch, values: Values) -> str:
    """Return every point as CSV: branch, parameter value, coordinates of the path in SI units."""
    first = next(value for kept in values.values() for value in measured_of(kept))
    axes = zip(first.section.axis_names, first.section.units, strict=True)
    rows = (
        [name, f"{value.value:.12g}", *(f"{x:.9g}" for x in point)]
        for name, kept in values.items()
        for value in measured_of(kept)
        for point in value.section.points
    )
    return csv_rows(["branch", branch.sweep.axes[0].name, *(f"{name} ({unit})" for name, unit in axes)], rows)


def summary(request: BifurcationRequest, values: Values) -> dict[str, Any]:
    """Return the values of each branch, and where the branches differ."""
    drawn = diagrams(request.branch, values)
    result: dict[str, Any] = {
        "definition": request.definition(),
        "transient": TRANSIENT,
        "branches": {name: [_row(value) for value in kept] for name, kept in values.items()},
    }
    if {"up", "down"} <= drawn.keys():
        up, down = drawn["up"], drawn["down"]
        result["coexisting_at"] = phase.coexistence_values(up, down).tolist()
        result["coexisting_ranges"] = [asdict(apart) for apart in phase.coexistence_ranges(up, down)]
        result["coexisting_step"] = phase.step_of(up, down)
        result["coexisting_note"] = BOUNDED
    return result


def coexistence_lines(result: Mapping[str, Any], unit: str) -> list[str]:
    """Return text about where two motions coexist, from a summary; empty if they do not."""
    ranges = result.get("coexisting_ranges", [])
    if not ranges:
        return []
    seen = ", ".join(_range_text(apart["first"], apart["last"]) for apart in ranges)
    step = f"{result['coexisting_step']:g} {unit}".strip()
    return [f"Two motions coexist at {seen} {unit}".rstrip() + f"; values tried are {step} apart.", f"  ({BOUNDED})"]


def motion_lines(kept: Sequence[KeptValue], unit: str) -> list[str]:
    """Return the kind of motion over ranges of neighbouring values; empty if it was not requested."""
    lines: list[str] = []
    moving = (value for value in measured_of(kept) if value.motion)
    for motion, group in groupby(moving, key=lambda value: value.motion):
        values = list(group)
        text = f"{_range_text(values[0].value, values[-1].value)} {unit}".rstrip() + f": {motion}"
        exponents = [value.exponent_per_s for value in values if isfinite(value.exponent_per_s)]
        tests = [value.k for value in values if isfinite(value.k)]
        more = [
            *([f"K {_range_text(min(tests), max(tests), '.2f')}"] if tests else []),
            *([f"exponent {_range_text(min(exponents), max(exponents), '.3g')} 1/s"] if exponents else []),
        ]
        lines.append(text + (f" ({', '.join(more)})" if more else ""))
    return lines


def _range_text(low: float, high: float, form: str = "g") -> str:
    first, last = format(low, form), format(high, form)
    return first if first == last else f"{first} to {last}"


def _row(kept: KeptValue) -> dict[str, Any]:
    measured = kept.measured
    if measured is None:
        return {"value": kept.value, "reason": kept.reason}
    row: dict[str, Any] = {
        "value": measured.value,
        "period_cycles": measured.period,
        "n_points": measured.section.n_points,
        "std": float(measured.section.extent[0]),
        "lowest": float(measured.section.points[:, 0].min()),
        "highest": float(measured.section.points[:, 0].max()),
        "separated_share": round(measured.separated_share, 4),
        "settled_s": measured.settled_s,
    }
    if measured.motion:
        row["motion"] = measured.motion
        row["lyapunov_exponent_per_s"] = measured.exponent_per_s if isfinite(measured.exponent_per_s) else None
        row["zero_one_k"] = measured.k if isfinite(measured.k) else None
    return row
