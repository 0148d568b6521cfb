"""Rows of the population from random machines of the lumped rig, at two operating points each.

At both points each machine is recorded healthy, with every effect as its author understands it, and with vibration from
outside the catalogue, and compared with a healthy reference of another day. One machine in four is hardly loaded, so
that flanks separate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from math import pi

import numpy as np

from app.studies.gap.gearboxes import SEED, Made, PopulationSample, Recorded, put_in_by_hand, reduced_twin, samples_of
from app.studies.gap.lumped_rig import (
    N_PATH,
    LumpedDay,
    LumpedFault,
    LumpedGeometry,
    LumpedRig,
    record,
)
from gearsig.checks import FloatArray
from gearsig.gap import NONE, UNKNOWN
from sims.effects import ONE_TOOTH_SHARE
from sims.machine import log_uniform

LUMPED = "lumped"

# --------------------
# The effects as the author of this rig understands them; severities from hardly visible to strong.
# --------------------


Draw = np.random.Generator
LumpedEffect = Callable[[LumpedRig, LumpedGeometry, Draw], LumpedFault]
Foreign = Callable[[FloatArray, FloatArray, float, Draw], tuple[FloatArray, FloatArray]]
"""Times of steps and of slow steps, typical mesh force, generator → housing forces (2, n), N; share of torque."""


def _side_and_tooth(rig: LumpedRig, rng: Draw) -> tuple[int, int]:
    side = int(rng.integers(2))
    return side, int(rng.integers(rig.teeth[side]))


def _root_crack(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """A root chord of 2.05 modules, partly cut; compliance grows with the lever. Neighbouring teeth yield slightly."""
    side, tooth = _side_and_tooth(rig, rng)
    softer = (1.0 - log_uniform(rng, 0.15, 0.75)) ** -2.2 - 1.0
    lever = np.clip(0.35 + 0.65 * shape.heights[side], 0.1, 1.1)
    at_pitch = sum(float(np.interp(0.0, shape.path, teeth)) for teeth in shape.teeth_m_per_n) / 0.7
    at_tooth = 0.35 * shape.pair_m_per_n**2 / at_pitch * softer * lever**2
    at_neighbours = np.full(N_PATH, 0.006 * shape.pair_m_per_n * softer)
    return LumpedFault(
        compliances=[(side, tooth, at_tooth), (side, tooth - 1, at_neighbours), (side, tooth + 1, at_neighbours)]
    )


def _tooth_spall(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """Reduced carrying width near the pitch line; only a spall over the whole width makes a step."""
    side, tooth = _side_and_tooth(rig, rng)
    whole = shape.before + shape.after
    length, width = log_uniform(rng, 0.25, 0.9) * rig.module_mm * 1e-3, min(0.98, log_uniform(rng, 0.3, 1.0))
    at = float(np.clip((shape.before, shape.after)[side] / whole - rng.uniform(0, 0.15), 0.25, 0.7)) * whole
    inside = np.clip(6.0 * (1.0 - np.abs(shape.heights[side] * whole - at) / (length / 2.0)), 0.0, 1.0)
    carrying = shape.hertz_m_per_n + 0.25 * sum(shape.teeth_m_per_n)
    return LumpedFault(
        compliances=[(side, tooth, 0.9 * inside * carrying * (1.0 / (1.0 - width) - 1.0))],
        gaps_m=[(side, tooth, 0.35 * inside * log_uniform(rng, 30e-6, 200e-6) * width**4)],
    )


def _chipped_tooth(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """A missing corner of the tip, wider towards the tip; if nearly the whole width is missing, it leaves a gap."""
    side, tooth = _side_and_tooth(rig, rng)
    width, height = min(1.0, log_uniform(rng, 0.3, 1.1)), rng.uniform(0.4, 0.65)
    above = np.clip((shape.heights[side] - (1.0 - height)) / height, 0.0, None)
    missing = np.clip(width * above**0.35, 0.0, 0.985)
    soft = (shape.hertz_m_per_n + 0.5 * sum(shape.teeth_m_per_n)) * (1.0 / (1.0 - missing) - 1.0)
    gap = 60e-6 * np.clip(2.0 * above, 0.0, 1.0) * max(0.0, width - 0.6) / 0.4
    return LumpedFault(compliances=[(side, tooth, soft)], gaps_m=[(side, tooth, gap)])


def _tooth_wear(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """Wear by Archard's law, proportional to sliding and zero at the pitch point, on both gears."""
    depth = log_uniform(rng, 8e-6, 90e-6) * (rig.module_mm / 2.0) ** 0.5
    sliding = np.abs(shape.path) / max(shape.before, shape.after)
    uneven = 1.0 + 0.25 * np.sign(shape.path) * rng.choice([-1.0, 1.0])
    gaps: list[tuple[int, int | None, FloatArray]] = [
        (side, None, depth * part * (1.0 + 0.12 * rng.standard_normal((rig.teeth[side], 1))) * sliding * uneven)
        for side, part in enumerate((0.6, 0.4))
    ]
    return LumpedFault(gaps_m=gaps, further_backlash_m=0.5 * depth)


def _pitch_error(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """One tooth ahead or behind, or all teeth displaced by poor cutting."""
    side, tooth = _side_and_tooth(rig, rng)
    error = log_uniform(rng, 6e-6, 45e-6) * rng.choice([-1.0, 1.0])
    if rng.uniform() < ONE_TOOTH_SHARE:
        return LumpedFault(gaps_m=[(side, tooth, np.full(len(shape.path), error))])
    single = rng.standard_normal(rig.teeth[side])
    adding = np.cumsum(single - single.mean())
    pattern = rng.uniform(0.3, 1.0) * single + rng.uniform(0.0, 0.6) * (adding - adding.mean())
    spread = 0.5 * abs(error) * pattern / np.diff(pattern).std()
    return LumpedFault(gaps_m=[(side, None, np.tile(spread[:, None], (1, len(shape.path))))])


def _surface_roughness(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    rms_um = log_uniform(rng, 0.6, 4.5)
    smooth = np.hanning(7) / np.sqrt(np.sum(np.hanning(7) ** 2))
    gaps: list[tuple[int, int | None, FloatArray]] = []
    for side in range(2):
        rows = rng.standard_normal((rig.teeth[side], len(shape.path)))
        rough = np.array([np.convolve(row, smooth, "same") for row in rows])
        gaps.append((side, None, rough * rms_um * 1e-6 / 2**0.5))
    return LumpedFault(gaps_m=gaps, friction=float(rig.numbers["friction"]) * (1.0 + 0.04 * rms_um))


def _eccentricity(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """An eccentric gear, whose mass is also off the axis, by less."""
    del shape
    side = int(rng.integers(2))
    runout = log_uniform(rng, 30e-6, 160e-6) * np.exp(2j * pi * rng.uniform())
    return LumpedFault(
        runout_m={side: complex(runout)}, unbalance_kg_m={side: complex(0.4 * rig.numbers["mass_kg"][side] * runout)}
    )


def _unbalance(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    del shape
    side = int(rng.integers(2))
    turning = rig.speeds_rpm[0] * pi / 30.0 * (1.0, rig.teeth[0] / rig.teeth[1])[side]
    amount = rig.numbers["mass_kg"][side] * log_uniform(rng, 0.04, 0.9) / turning * np.exp(2j * pi * rng.uniform())
    return LumpedFault(unbalance_kg_m={side: complex(amount)})


def _misalignment(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """Only part of the face carries, and a coupling pushes one, two and three times per revolution."""
    angle = log_uniform(rng, 0.5e-3, 4e-3)
    force = rig.loads_nm[0] / shape.base_radii[1]
    opened = angle * rig.face_mm * 1e-3 / (2.0 * force * shape.pair_m_per_n)
    remaining = 1.0 / (1.0 + 0.3 * opened) if opened < 1.0 else max(0.77 * opened**-0.5, 0.15)
    strength = (1e3 * angle) ** 1.3
    return LumpedFault(
        softened=min(remaining, 0.9999),
        wobble=min(0.12, 30.0 * angle),
        phase=rng.uniform(0, 2 * pi),
        drive={"coupling_n": strength * rig.module_mm / 2.0, "coupling_nm": 4e-4 * strength},
    )


def _torque_ripple(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:  # noqa: ARG001 - form
    order = float(rng.choice([2.0, 3.0, 4.0, 6.0, 12.0]))
    return LumpedFault(ripple=(log_uniform(rng, 0.06, 0.5), order, rng.uniform(0, 2 * pi)))


def _race(kind: float, narrow_mm: float, wide_mm: float) -> LumpedEffect:
    """Balls drop into a pit as deep as its shape allows; on the outer race near the load, on the inner one anywhere."""

    def race(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
        del shape
        side, width = int(rng.integers(2)), log_uniform(rng, narrow_mm, wide_mm)
        _, ball, pitch = rig.balls[side]
        depth = min(ball / 2.0 - ((ball / 2.0) ** 2 - (width / 2.0) ** 2) ** 0.5, 0.06)
        line = float(rig.numbers["centre_line_rad"]) - np.radians(20.0)
        loaded = line + pi / 2.0 + (pi if side == 0 else 0.0) + rng.uniform(-0.7, 0.7)
        angle = loaded if kind == 1.0 else rng.uniform(0, 2 * pi)
        radius = (pitch + ball) / 2.0 if kind == 1.0 else (pitch - ball) / 2.0
        return LumpedFault(defect=(kind, side + 1.0, float(angle), width / 2.0 / radius, 1e-3 * depth))

    return race


def _transfer_path(rig: LumpedRig, shape: LumpedGeometry, rng: Draw) -> LumpedFault:
    """A loose sensor, or a housing that has become softer in some modes and stiffer in others."""
    del shape
    if rng.uniform() < 0.6:
        resonance_hz, damping = log_uniform(rng, 1900.0, 6500.0), rng.uniform(0.04, 0.12)
        return LumpedFault(loose_sensor=(int(rng.integers(3)), resonance_hz, damping))
    n, size = len(rig.numbers["mode_hz"]), log_uniform(rng, 0.05, 0.3)
    signs = rng.choice([-1.0, -1.0, 0.6], size=n) * rng.uniform(0.4, 1.2, n)
    return LumpedFault(moved_modes=1.0 + size * signs, damped_modes=1.0 + 4.0 * size)


EFFECTS: dict[str, LumpedEffect] = {
    "root_crack": _root_crack,
    "tooth_spall": _tooth_spall,
    "chipped_tooth": _chipped_tooth,
    "tooth_wear": _tooth_wear,
    "pitch_error": _pitch_error,
    "surface_roughness": _surface_roughness,
    "sliding_friction": lambda _rig, _shape, rng: LumpedFault(friction=log_uniform(rng, 0.075, 0.2)),
    "eccentricity": _eccentricity,
    "unbalance": _unbalance,
    "misalignment": _misalignment,
    "torque_ripple": _torque_ripple,
    "speed_fluctuation": lambda _rig, _shape, rng: LumpedFault(
        wander=(log_uniform(rng, 0.005, 0.04), rng.uniform(0.6, 3.0))
    ),
    "backlash": lambda _rig, _shape, rng: LumpedFault(backlash=log_uniform(rng, 1.7, 9.0)),
    "bearing_outer_race": _race(1.0, 0.5, 2.4),
    "bearing_inner_race": _race(2.0, 0.6, 3.2),
    "bearing_clearance": lambda _rig, _shape, rng: LumpedFault(
        clearance_m={int(rng.integers(2)): log_uniform(rng, 20e-6, 150e-6)}
    ),
    "transfer_path": _transfer_path,
    "mains_hum": lambda _rig, _shape, rng: LumpedFault(hum=log_uniform(rng, 0.04, 0.6)),
    "clipping": lambda _rig, _shape, rng: LumpedFault(clipped=(int(rng.integers(3)), rng.uniform(0.35, 0.9))),
}

# --------------------
# Vibration from outside the catalogue: external forces on the housing, with an independent clock.
# --------------------


def _clock(time: FloatArray, rng: Draw) -> FloatArray:
    """Return the time of a slightly wandering clock, in s."""
    coarse = np.linspace(0.0, time[-1], 2000)
    wander = 1.0 + 0.002 * np.cumsum(rng.standard_normal(2000)) / 2000**0.5
    return np.asarray(np.interp(time, coarse, np.cumsum(wander) / 2000 * time[-1]))


def _pump(size: float, turn_hz: float, n_blades: float) -> Foreign:
    def forces(time: FloatArray, slow: FloatArray, force: float, rng: Draw) -> tuple[FloatArray, FloatArray]:
        t = 2 * pi * turn_hz * _clock(time, rng)
        blades = sum(a * np.cos(k * n_blades * t + k) for k, a in ((1, 1.0), (2, 0.5), (3, 0.3)))
        y = 0.04 * size * force * (1.0 + 0.5 * np.cos(t)) * blades
        return np.array([0.03 * size * force * np.cos(t), y]), np.zeros(len(slow))

    return forces


def _bursts(size: float, rate_hz: float, *, regular: bool) -> Foreign:
    """Slaps of a belt, nearly regular; or collapsing bubbles, random and numerous."""

    def forces(time: FloatArray, slow: FloatArray, force: float, rng: Draw) -> tuple[FloatArray, FloatArray]:
        rate = 1.0 / (time[1] - time[0])
        gaps = 1.0 + 0.01 * rng.standard_normal(round(rate_hz * time[-1])) if regular else None
        n = round(rate_hz * time[-1])
        at = np.cumsum(gaps) / rate_hz if gaps is not None else np.sort(rng.uniform(0, time[-1], n))
        strength = 0.5 * (1.0 + 0.2 * rng.standard_normal(n)) if regular else 0.04 * rng.exponential(1.0, n)
        blows = np.zeros(len(time))
        np.add.at(blows, np.minimum((at * rate).astype(int), len(time) - 1), size * force * strength)
        tones = ((700.0, 0.003),) if regular else ((3100.0, 4e-4), (4700.0, 4e-4), (6800.0, 4e-4))
        y = np.zeros(len(time))
        for f, tau in tones:
            t = np.arange(round(8 * tau * rate)) / rate
            y += np.convolve(blows, np.exp(-t / tau) * np.sin(2 * pi * f * t))[: len(time)] / len(tones) ** 0.5
        return np.array([0.3 * y, y]), np.zeros(len(slow))

    return forces


def _lines(size: float, lines: tuple[tuple[float, float], ...], beat_hz: float, torque: float) -> Foreign:
    """Beating lines (Hz, strength), as of an induction motor's field or an inverter, with the corresponding torque."""

    def forces(time: FloatArray, slow: FloatArray, force: float, rng: Draw) -> tuple[FloatArray, FloatArray]:
        phase = rng.uniform(0, 2 * pi)
        beat = 1.0 + 0.7 * np.cos(2 * pi * beat_hz * time + phase)
        y = size * force * beat * sum(a * np.cos(2 * pi * f * time) for f, a in lines)
        return np.array([0.5 * y, y]), torque * size * np.cos(2 * pi * beat_hz * slow + phase)

    return forces


def outside(rig: LumpedRig, rng: Draw) -> tuple[str, LumpedFault]:
    """Draw vibration from outside the catalogue, clear or strong."""
    size, line, slip = log_uniform(rng, 0.7, 2.0), rig.line_hz, rng.uniform(0.01, 0.04)
    turn_hz, carrier = rng.uniform(6, 23), float(rng.choice([2000.0, 4000.0])) + rng.uniform(-3, 3)
    name = str(rng.choice(["pump", "foreign gear", "belt", "cavitation", "motor field", "inverter", "foot", "whirl"]))
    made: dict[str, Foreign] = {
        "pump": _pump(size, turn_hz, float(rng.integers(4, 8))),
        "foreign gear": _pump(size, turn_hz, 13.7),
        "belt": _bursts(size, turn_hz, regular=True),
        "cavitation": _bursts(size, 260.0, regular=False),
        "motor field": _lines(size, ((2.0 * line, 0.012), (4.0 * line, 0.003)), 2.0 * slip * line, 0.03),
        "inverter": _lines(size, ((carrier, 0.012), (2.0 * carrier, 0.005)), rng.uniform(20, 48), 0.0),
    }
    if name == "foot":
        return name, LumpedFault(drive={"loose": min(0.95, 0.7 + 0.15 * size), "whirl_n": 0.008 * size})
    if name == "whirl":
        return name, LumpedFault(drive={"whirl_order": rng.uniform(0.43, 0.48), "whirl_n": 0.12 * size})
    return name, LumpedFault(foreign=made[name])


# --------------------
# Rows of the population.
# --------------------


FIRST_RIG = 300_000
"""Number of the first machine's first point; its second point has the next number."""
POINTS = (0, 1)
N_HEALTHY, N_OUTSIDE, N_FOREIGN, N_BY_HAND = 2, 3, 1, 2
TOUCHED = 1.8
"""Disturbance of the sensors between healthy recordings, relative to the usual one."""
LIGHT = 4
"""One machine in this many is hardly loaded."""


def lumped_samples(index: int) -> list[PopulationSample]:
    """Return the samples of one random machine, with the same faults at both of its points."""
    rng = np.random.default_rng([SEED, 4, index])
    rig = LumpedRig.drawn(rng, light=index % LIGHT == LIGHT - 1)
    levels = record(rig, 0, LumpedDay.drawn(rig, rng), LumpedFault(), rng).samples[:-1].std(axis=1).astype(np.float64)
    faults = list(_faults(rig, rng))
    return [
        sample
        for point in POINTS
        for sample in samples_of(LUMPED, FIRST_RIG + 2 * index + point, partial(_at, rig, point, levels, faults, index))
    ]


def _faults(rig: LumpedRig, rng: Draw) -> Iterator[tuple[str, str, LumpedFault]]:
    """Yield cause, description and changes of each fault."""
    for _ in range(N_HEALTHY):
        yield NONE, NONE, LumpedFault()
    for name, effect in EFFECTS.items():
        yield name, "", effect(rig, LumpedGeometry.of(rig), rng)
    for _ in range(N_OUTSIDE):
        yield UNKNOWN, *outside(rig, rng)


def _at(rig: LumpedRig, point: int, levels: FloatArray, faults: list[tuple[str, str, LumpedFault]], index: int) -> Made:
    """Return the reference at a point, the twin there, and the recordings to compare."""
    number, torque_nm = FIRST_RIG + 2 * index + point, rig.torque_nm(point)
    rng = np.random.default_rng([SEED, 4, index, point])
    reference = record(rig, point, LumpedDay.drawn(rig, rng), LumpedFault(), rng, healthy_levels=levels)

    def compared() -> Iterator[Recorded]:
        healthy = reference
        for cause, words, fault in faults:
            day = LumpedDay.drawn(rig, rng, TOUCHED if cause == NONE else 1.0)
            recording = record(rig, point, day, fault, rng, healthy_levels=levels)
            healthy = recording if cause == NONE else healthy
            yield cause, words, 0.0, recording, torque_nm
        yield from put_in_by_hand([healthy], N_FOREIGN, N_BY_HAND, torque_nm, rng)

    return reference, reduced_twin(reference, number, torque_nm), compared()
