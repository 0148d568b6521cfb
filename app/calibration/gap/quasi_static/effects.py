"""The catalogue's effects on the quasi-static machine, in shapes that are drawn anew for each."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from app.calibration.gap.chance import draw_side, partly, sign
from app.calibration.gap.quasi_static.machine import State, StaticMachine, textures
from app.calibration.rigs import log_uniform
from gearsig.checks import FloatArray
from gearsig.rig.types import Bearing

Knock = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]


def _tooth(machine: StaticMachine, rng: np.random.Generator) -> tuple[int, int]:
    side = draw_side(rng)
    return side, int(rng.integers(machine.drawn.teeth[side]))


def _bearing(machine: StaticMachine, rng: np.random.Generator) -> tuple[Bearing, float]:
    """Draw a bearing; return it with the revolutions of its shaft per revolution of the driver."""
    bearing = machine.rig.bearings[int(rng.integers(len(machine.rig.bearings)))]
    return bearing, machine.shaft_orders[0 if bearing.shaft == machine.rig.pairs[0].driver else 1]


def _towards_tip(machine: StaticMachine, side: int) -> FloatArray:
    """Return 0 where the path begins or ends at a gear's root, 1 at its tip: the driver's path ends there."""
    at: FloatArray = np.clip(machine.path.places / machine.path.ratio, 0.0, 1.0)
    return at if side == 0 else 1.0 - at


def _band(machine: StaticMachine, centre: float, width: float, edge: float) -> FloatArray:
    place = machine.path.places
    band: FloatArray = 0.5 * (
        np.tanh((place - centre + width / 2) / edge) - np.tanh((place - centre - width / 2) / edge)
    )
    return band


def _root_crack(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A tooth that gives way, the more the nearer to its tip the force is; a deep one stays bent."""
    side, tooth = _tooth(machine, rng)
    least, power, softer = rng.uniform(0.0, 0.5), rng.uniform(0.5, 3.0), log_uniform(rng, 0.05, 5.0)
    state.weak[side][tooth] += softer * (least + (1.0 - least) * _towards_tip(machine, side) ** power)
    if rng.uniform() < 0.3:
        state.gaps_m[side][tooth] += log_uniform(rng, 0.02, 0.5) * machine.rated_m * sign(rng)


def _tooth_spall(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A pit near the pitch line: over part of the width less stiffness, over all of it a hole."""
    side, tooth = _tooth(machine, rng)
    centre, width = machine.path.pitch_point + rng.uniform(-0.3, 0.3), rng.uniform(0.1, 0.45)
    band = _band(machine, centre, width, rng.uniform(0.01, 0.06))
    if rng.uniform() < 0.5:
        state.weak[side][tooth] += log_uniform(rng, 0.05, 6.0) * band
    else:
        state.gaps_m[side][tooth] += log_uniform(rng, 0.1, 8.0) * machine.rated_m * band


def _chipped_tooth(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A tip that is gone, over all of the width or part of it: its pair loses hold early, or takes it late."""
    side, tooth = _tooth(machine, rng)
    lost = np.clip((_towards_tip(machine, side) - 1.0 + rng.uniform(0.08, 0.55)) / 0.1, 0.0, None)
    if rng.uniform() < 0.7:
        state.gaps_m[side][tooth] += log_uniform(rng, 0.3, 20.0) * machine.rated_m * lost**2
    else:
        state.weak[side][tooth] += log_uniform(rng, 0.2, 6.0) * np.minimum(lost, 1.0)


def _tooth_wear(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """Flanks that lost most where they slide most, not alike on both gears, nor quite on all teeth."""
    off = machine.path.places - machine.path.pitch_point
    depth, power, uneven = (
        log_uniform(rng, 0.08, 6.0) * machine.rated_m,
        rng.uniform(0.5, 2.0),
        log_uniform(rng, 0.01, 0.3),
    )
    for side in (0, 1):
        towards = np.where((off > 0) == (side == 0), rng.uniform(0.2, 1.0), rng.uniform(0.2, 1.0))
        shape = towards * np.abs(off / np.abs(off).max()) ** power + rng.uniform(0.0, 0.3)
        scatter = 1.0 + uneven * rng.standard_normal((machine.drawn.teeth[side], 1))
        state.gaps_m[side] = state.gaps_m[side] + depth * rng.uniform(0.2, 1.0) * shape * scatter
    state.restless_m *= 1.0 + partly(rng)


def _pitch_error(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """Teeth off their places: each by itself, adding up, or in a wave."""
    side = draw_side(rng)
    teeth = machine.drawn.teeth[side]
    kind = rng.uniform()
    if kind < 0.5:
        error = rng.standard_normal(teeth)
    elif kind < 0.75:
        error = np.cumsum(rng.standard_normal(teeth))
        error -= np.linspace(0.0, error[-1], teeth)
    else:
        error = np.roll(np.linspace(-1.0, 1.0, teeth), int(rng.integers(teeth))) + 0.1 * rng.standard_normal(teeth)
    size = log_uniform(rng, 0.05, 4.0) * machine.rated_m / max(float(np.diff(error).std()), 1e-9)
    state.gaps_m[side] = state.gaps_m[side] + size * (error - error.mean())[:, None]


def _surface_roughness(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """Rough flanks, that the gears repeat, and what they never do."""
    size = log_uniform(rng, 0.02, 1.5) * machine.rated_m
    for side in (0, 1):
        state.gaps_m[side] = state.gaps_m[side] + textures(machine.drawn.teeth[side], size * rng.uniform(0.3, 1.0), rng)
    state.restless_m += 0.3 * size * partly(rng)
    state.friction *= rng.uniform(1.0, 1.8)


def _sliding_friction(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:  # noqa: ARG001 - form
    """Flanks that rub: a force that turns round at the pitch point."""
    state.friction = log_uniform(rng, 0.1, 0.6)
    state.reversal = rng.uniform(0.005, 0.3)


def _eccentricity(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A gear off its axis: separation and depth of the teeth once per turn, and its mass off the axis."""
    side, phase, size = draw_side(rng), rng.uniform(0, 2 * np.pi), log_uniform(rng, 2.0, 60.0)
    state.runout_m.append((side, 1.0, size * machine.rated_m, phase))
    state.stiffness.append((side, 1.0, min(size * rng.uniform(5e-4, 1e-2), 0.5), phase + rng.uniform(-1.5, 1.5)))
    state.load.append((side, 1.0, min(size * rng.uniform(0.0, 5e-3), 0.5), phase + rng.uniform(-1.5, 1.5)))
    state.force_n.append((side, 1.0, size * machine.force_unit_n * log_uniform(rng, 1e-4, 1e-2), phase))


def _unbalance(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A mass off the axis."""
    size = log_uniform(rng, 0.1, 3.0) * machine.force_unit_n
    state.force_n.append((draw_side(rng), 1.0, size, rng.uniform(0, 2 * np.pi)))


def _misalignment(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """Contact on part of the width, some of it turning with a shaft; a coupling that is forced twice a turn."""
    side, size = draw_side(rng), log_uniform(rng, 0.1, 0.8)
    state.soft_spots = size * rng.uniform(0.3, 0.8)
    for order, share in ((1.0, rng.uniform(0.0, 0.6)), (2.0, rng.uniform(0.0, 0.4))):
        state.stiffness.append((side, order, size * share, rng.uniform(0, 2 * np.pi)))
    force = size * log_uniform(rng, 0.02, 2.0) * machine.force_unit_n
    for order, share in ((1.0, rng.uniform(0.0, 0.6)), (2.0, 1.0), (3.0, rng.uniform(0.0, 0.4))):
        state.force_n.append((side, order, force * share, rng.uniform(0, 2 * np.pi)))
    state.load.append((side, 2.0, size * log_uniform(rng, 1e-3, 0.1), rng.uniform(0, 2 * np.pi)))


def _torque_ripple(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A torque that pulls n times per turn, and a little 2n times; the shaft twists, the frame takes it up."""
    pulls = log_uniform(rng, 1.0, 12.0)
    order, side, size = (
        float(round(pulls)) if rng.uniform() < 0.75 else pulls,
        draw_side(rng),
        log_uniform(rng, 0.02, 0.6),
    )
    for n, share in ((1.0, 1.0), (2.0, rng.uniform(0.0, 0.4))):
        phase = rng.uniform(0, 2 * np.pi)
        state.load.append((side, n * order, share * size, phase))
        state.force_n.append((side, n * order, share * size * machine.load_n * partly(rng), phase))


def _speed_fluctuation(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:  # noqa: ARG001 - form
    for share in (1.0, rng.uniform(0.0, 0.6)):
        size = share * log_uniform(rng, 0.004, 0.12) / 2.0
        state.wander.append((size, log_uniform(rng, 0.2, 4.0), rng.uniform(0, 2 * np.pi)))


def _race(machine: StaticMachine, state: State, rng: np.random.Generator, name: str) -> None:
    """Elements that drop into a defect and leave it with a blow; on the inner race the load zone passes it."""
    bearing, shaft = _bearing(machine, rng)
    order = bearing.orders()[name] * shaft * (1.0 - rng.uniform(0.0, 0.015))
    size = log_uniform(rng, 0.02, 3.0) * (machine.load_n + 0.1 * machine.force_unit_n)
    jitter, uneven, width = log_uniform(rng, 1e-3, 2e-2), rng.uniform(0.05, 0.4), log_uniform(rng, 1e-4, 5e-4)
    falls, across, sharp = partly(rng), rng.uniform(0.02, 0.3), rng.uniform(0.5, 3.0)

    def knock(turns: FloatArray, time: FloatArray, chance: np.random.Generator) -> FloatArray:
        passed = turns * order + chance.uniform()
        numbers = np.arange(np.ceil(passed[0]), np.floor(passed[-1]))
        at = np.interp(numbers, passed, time) + np.cumsum(jitter * 0.1 * chance.standard_normal(len(numbers))) / 1e3
        sizes = size * np.maximum(1.0 + uneven * chance.standard_normal(len(at)), 0.1)
        if name == "BPFI":
            angle = 2 * np.pi * np.interp(at, time, turns) * shaft
            sizes *= np.maximum(np.cos(angle + chance.uniform(0, 2 * np.pi)), 0.0) ** sharp
        step = time[1] - time[0]
        force = np.zeros(len(time))
        period = float(np.median(np.diff(at))) if len(at) > 1 else 1.0
        for shift, weight in ((0.0, 1.0), (-across * period, -0.4 * falls)):
            np.add.at(force, np.clip(((at + shift) / step).astype(np.intp), 0, len(time) - 1), weight * sizes)
        pulse = np.hanning(max(3, round(width / step)) + 2)
        found: FloatArray = np.convolve(force, pulse, mode="same")
        return found

    state.knocks.append(knock)


def _outer_race(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    _race(machine, state, rng, "BPFO")


def _inner_race(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    _race(machine, state, rng, "BPFI")


def _bearing_clearance(machine: StaticMachine, state: State, rng: np.random.Generator) -> None:
    """A bearing that is loose: forces reach the housing bent, its support is softer."""
    bearing, shaft = _bearing(machine, rng)
    play = log_uniform(rng, 0.3, 30.0)
    state.play += play
    state.passing = bearing.orders()["BPFO"] * shaft * (1.0 - rng.uniform(0.0, 0.01))
    softer = min(0.08 * play, 0.5) * partly(rng)
    state.structure = state.structure.softer(softer, log_uniform(rng, 500.0, 6000.0))
    state.restless_m *= 1.0 + min(play, 5.0) * partly(rng)


EFFECTS: dict[str, Callable[[StaticMachine, State, np.random.Generator], None]] = {
    "root_crack": _root_crack,
    "tooth_spall": _tooth_spall,
    "chipped_tooth": _chipped_tooth,
    "tooth_wear": _tooth_wear,
    "pitch_error": _pitch_error,
    "surface_roughness": _surface_roughness,
    "sliding_friction": _sliding_friction,
    "eccentricity": _eccentricity,
    "unbalance": _unbalance,
    "misalignment": _misalignment,
    "torque_ripple": _torque_ripple,
    "speed_fluctuation": _speed_fluctuation,
    "bearing_outer_race": _outer_race,
    "bearing_inner_race": _inner_race,
    "bearing_clearance": _bearing_clearance,
}
