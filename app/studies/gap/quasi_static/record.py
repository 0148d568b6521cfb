"""From a machine's state on a day to a recording."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import typer

from app.studies.gap.by_hand import made_by_hand, with_foreign_vibration, with_signature
from app.studies.gap.quasi_static.machine import (
    BEARINGS,
    EFFECTS,
    FRICTION,
    INSIDE,
    MESH,
    N_CHANNELS,
    SHAFTS,
    QuasiStaticState,
    StaticMachine,
    Structure,
    Wave,
    at_places,
    is_in_reach,
    meeting,
    static_contact,
)
from app.studies.gap.rows import SEED, PopulationBaseline, PopulationSample, reduced
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap import BY_HAND, NONE, UNKNOWN, OperatingCondition
from gearsig.recording import Channel, Recording
from sims.cracked import CrackedTwin
from sims.effects import textbook
from sims.measure import Tachometer, pulse_voltage

FINER = 2
"""Times the recording's rate at which the contact is solved: its corners reach beyond half of that."""
LEAD_S = 0.3
"""Before the recording, in which modes settle."""
OUT_OF_REACH_M = 1.0
TURNS_BEFORE = 40
"""Whole turns of the driver, at most, by which the teeth that meet differ from day to day."""
MIN_NOISE_HZ = 20.0
RIPPLE = 0.3
"""By which play opens and shuts as elements pass."""
SPEED_SCATTER, TORQUE_SCATTER, GAIN_SCATTER, NOISE_SCATTER, ANEW_SHARE = 0.005, 0.04, 0.1, 0.12, 0.6


@dataclass(frozen=True)
class QuasiStaticDay:
    """How a machine runs on a day, and how its sensors sit."""

    speed_factor: float
    torque_factor: float
    gains: tuple[float, ...]
    noise_factor: float
    turns_before: int
    seed: int
    anew: bool

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> QuasiStaticDay:
        """Draw one."""
        speed, torque = (1.0 + s * float(rng.standard_normal()) for s in (SPEED_SCATTER, TORQUE_SCATTER))
        anew = bool(rng.uniform() < ANEW_SHARE)
        gains = np.exp(GAIN_SCATTER * rng.standard_normal(N_CHANNELS) * anew)
        noise = float(np.exp(NOISE_SCATTER * rng.standard_normal()))
        turns = int(rng.integers(TURNS_BEFORE))
        return cls(speed, torque, tuple(gains.tolist()), noise, turns, int(rng.integers(2**31)), anew)


def record(
    machine: StaticMachine, state: QuasiStaticState, day: QuasiStaticDay, levels: FloatArray | None
) -> Recording:
    """Return a recording.

    Parameters
    ----------
    machine : StaticMachine
    state : State
    day : Day
    levels : array, (n_channels,), or None
        Standard deviation of each channel by which noise is measured; None: no noise.
    """
    rng = np.random.default_rng([day.seed, 1])
    rate = FINER * machine.rate_hz
    time = np.arange(int((machine.drawn.duration_s + LEAD_S) * rate)) / rate
    turns = _turns(machine, state, day, time, rng)
    motions = _motions(machine, state, day, turns, time, rng)
    structure = state.structure.mounted_anew(np.random.default_rng([day.seed, 2])) if day.anew else state.structure
    first, rows = round(LEAD_S * machine.rate_hz), []
    for channel in range(N_CHANNELS):
        row = _heard(structure, channel, motions, rate)[first:]
        if levels is not None:
            inside = _heard(structure, channel, {INSIDE: rng.standard_normal(len(time))}, rate)[first:]
            row = row + inside * (machine.inside_share[channel] * levels[channel] / inside.std())
        if state.paths:
            row = state.paths[channel].of(row, machine.rate_hz)
        if levels is not None:
            row = row + _noise(len(row), machine, channel, rng) * levels[channel] * day.noise_factor
        rows.append(row * day.gains[channel])
    later = time[::FINER][first:]
    tacho = _tachometer(turns, time, later, rng)
    n = min(len(later), len(rows[0]))
    samples = np.stack([row[:n] for row in (*rows, tacho)])
    point = machine.rig.operating_point
    channels = tuple(Channel(s.channel, s.quantity, s.unit, s.position) for s in machine.rig.sensors)
    return Recording(samples, machine.rate_hz, channels, rig=replace(machine.rig, operating_point=point))


def _turns(
    machine: StaticMachine, state: QuasiStaticState, day: QuasiStaticDay, time: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return the driver's angle in revolutions."""
    speed_hz = machine.drawn.speed_rpm * day.speed_factor / 60.0
    wander = np.zeros(len(time))
    for share, hz, phase in state.wander:
        wander += share / (2 * np.pi * hz) * np.sin(2 * np.pi * hz * time + phase + rng.uniform(0, 2 * np.pi))
    turns: FloatArray = day.turns_before + rng.uniform() + speed_hz * (time + wander)
    return turns


def _motions(
    machine: StaticMachine,
    state: QuasiStaticState,
    day: QuasiStaticDay,
    turns: FloatArray,
    time: FloatArray,
    rng: np.random.Generator,
) -> dict[int, FloatArray]:
    """Return the motion that enters the structure on each way, m."""
    path, cycle = machine.path, turns * machine.drawn.teeth[0]

    def waves(found: Sequence[Wave]) -> FloatArray:
        angles = [2 * np.pi * turns * order for order in machine.shaft_orders]
        return sum((size * np.cos(n * angles[side] + phase) for side, n, size, phase in found), np.zeros(len(turns)))

    first = (0, 0)
    gaps = meeting(cycle, path, (state.gaps_m[0], state.gaps_m[1]), first)
    weak = meeting(cycle, path, (state.weak[0], state.weak[1]), first)
    inside = is_in_reach(cycle, path)
    own = at_places(cycle, path, machine.stiffness_n_per_m) * (1.0 - state.soft_spots)
    stiffness = np.where(inside, own * np.maximum(1.0 + waves(state.stiffness), 0.05) / (1.0 + weak), 1e-3)
    load = machine.load_n * day.torque_factor * np.maximum(1.0 + waves(state.load), 0.02)
    error, carried = static_contact(stiffness, np.where(inside, gaps, OUT_OF_REACH_M), load)
    mean = float(machine.stiffness_n_per_m.mean()) * path.ratio
    shafts = waves(state.force_n) * day.speed_factor**2 / mean
    off = at_places(cycle, path, path.places - path.pitch_point)
    turning = np.sum(carried * np.tanh(off / state.reversal), axis=0)
    rubbing = state.friction * machine.directness * turning / mean
    mesh = error + waves(state.runout_m) + state.restless_m * rng.standard_normal(len(turns))
    pressed = load / mean
    mesh = _through_play(pressed, mesh - mesh.mean() + shafts, state, turns) - shafts
    knocked = sum((knock(turns, time, rng) for knock in state.knocks), np.zeros(len(turns))) / mean
    return {MESH: mesh, SHAFTS: shafts, FRICTION: rubbing, BEARINGS: knocked}


def _through_play(pressed: FloatArray, moving: FloatArray, state: QuasiStaticState, turns: FloatArray) -> FloatArray:
    """Return what a bearing with play hands on of a motion about what its load presses out: √(r² + c²) − c."""
    total = pressed + moving
    play = state.play * pressed * (1.0 + RIPPLE * np.cos(2 * np.pi * state.passing * turns))
    found: FloatArray = np.sign(total) * (np.hypot(total, play) - play)
    return found


def _heard(structure: Structure, channel: int, motions: dict[int, FloatArray], rate: float) -> FloatArray:
    """Return a channel's acceleration at the recording's rate."""
    from scipy.fft import irfft, rfft, rfftfreq

    n = len(next(iter(motions.values())))
    frequency = rfftfreq(n, 1.0 / rate)
    kept = frequency < 0.48 * rate / FINER
    lines = np.zeros(len(frequency), dtype=np.complex128)
    for way, motion in motions.items():
        lines[kept] += rfft(motion - motion.mean())[kept] * structure.accelerations(channel, frequency[kept], way)
    m = n // FINER
    vibration: FloatArray = irfft(lines[: m // 2 + 1], m) * (m / n)
    return vibration


def _noise(n: int, machine: StaticMachine, channel: int, rng: np.random.Generator) -> FloatArray:
    """Return a sensor's noise over its level, falling with frequency as the machine's seed has it."""
    from scipy.fft import irfft, rfft, rfftfreq

    slope = np.random.default_rng([machine.seed, 3, channel]).uniform(0.0, 1.0)
    frequency = np.maximum(rfftfreq(n, 1.0 / machine.rate_hz), MIN_NOISE_HZ)
    noise = irfft(rfft(rng.standard_normal(n)) * frequency ** (-slope / 2.0), n)
    coloured: FloatArray = noise * (machine.noise_share[channel] / noise.std())
    return coloured


def _tachometer(turns: FloatArray, time: FloatArray, at: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the voltage of a pulse per turn."""
    tacho = Tachometer(jitter_s=2e-6, noise_v=0.01)
    whole = np.arange(np.ceil(turns[0]), np.floor(turns[-1]) + 1.0)
    rising = np.interp(whole, turns, time) + tacho.jitter_s * rng.standard_normal(len(whole))
    falling = np.interp(whole + tacho.duty, turns, time)
    volts = pulse_voltage(tacho, rising, falling, at) + tacho.noise_v * rng.standard_normal(len(at))
    found: FloatArray = volts
    return found


# --------------------
# Rows of the population from drawn machines of the quasi-static simulator.
# --------------------


QUASI_STATIC = "quasi-static"
FIRST_RIG = 200_000
N_HEALTHY, N_EACH, N_FOREIGN, N_BY_HAND, N_PATHS = 2, 1, 2, 3, 2


def one_static(index: int) -> list[PopulationSample]:
    """Return the samples of one drawn machine."""
    rng, rig = np.random.default_rng([SEED, 3, index]), FIRST_RIG + index
    machine = StaticMachine.of(rng)
    torque_nm = machine.drawn.torque_nm
    levels = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), None).samples[:-1].std(axis=1)
    try:
        reference = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), levels)
        twin = CrackedTwin(machine.rig, machine.nominal).run(
            OperatingCondition(machine.drawn.speed_rpm, torque_nm),
            seed=rig,
            duration_s=machine.drawn.duration_s,
            sampling_rate_hz=machine.rate_hz,
            noise=1,
        )
        compared = PopulationBaseline(QUASI_STATIC, rig, reduced(reference, rig), reduced(twin, rig))
    except (InputError, RefusalError) as error:
        typer.echo(f"machine {rig}: {error}")
        return []
    recordings = (*_recordings(machine, levels, rng), *_changed_paths(machine, levels))
    return list(compared.samples((label, detail, 0.0, recording, torque_nm) for label, detail, recording in recordings))


def _recordings(
    machine: StaticMachine, levels: np.ndarray, rng: np.random.Generator
) -> Iterator[tuple[str, str, Recording]]:
    """Yield label, detail and recording."""
    healthy = [record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), levels) for _ in range(N_HEALTHY)]
    for recording in healthy:
        yield NONE, "", recording
    for name, effect in EFFECTS.items():
        for _ in range(N_EACH):
            state = machine.healthy()
            effect(machine, state, rng)
            yield name, "", record(machine, state, QuasiStaticDay.drawn(rng), levels)
    for i in range(N_FOREIGN):
        recording, name = with_foreign_vibration(healthy[i % N_HEALTHY], rng)
        yield UNKNOWN, name, recording
    for i, name in enumerate(rng.choice(made_by_hand(healthy[0], machine.drawn.torque_nm), N_BY_HAND, replace=False)):
        yield str(name), BY_HAND, with_signature(healthy[i % N_HEALTHY], str(name), rng)[0]


def _changed_paths(machine: StaticMachine, levels: np.ndarray) -> Iterator[tuple[str, str, Recording]]:
    """Yield recordings that come through other paths, from a seed of their own."""
    rng = np.random.default_rng([machine.seed, 5])
    for _ in range(N_PATHS):
        state = machine.healthy()
        state.paths = textbook.draw_path_changes(N_CHANNELS, textbook.path_size(rng.uniform()), machine.rate_hz, rng)
        yield "transfer_path", "", record(machine, state, QuasiStaticDay.drawn(rng), levels)
