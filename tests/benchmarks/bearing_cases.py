"""How often the bearing diagnosis names the right part: `python tests/benchmarks/bearing_cases.py [CASES] [SEED]`.

Draws motors on two rolling bearings as they stand on test benches: deep groove ball bearings of the catalogue, a load
that slows the motor down and presses them, shaft harmonics, mains, noise that the shaft modulates, resonances of their
own for each of up to three sensors, and a damage on one part of one bearing or none; of an outer race at one of three
positions about the load zone. Sound machines come with what is mistaken for a bearing: a smooth tone near a ball-pass
order, elements that pass through the load zone, impacts of another machine, looseness. Prints right, unsure, missed and
wrong by part and by the damage's strength, and what is named on sound machines: of the recording alone, beside one of
the same motor when it was sound, and of its halves against each other. The signal model is after Antoni and Randall
(2003), and independent of the product's simulators. With `hard` as a third argument motors are drawn that depart from
the textbook.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, Finding, Kind, analyze
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, Rig, Shaft, bearing_catalogue

PARTS = {"outer": "BPFO", "inner": "BPFI", "ball": "BSF"}
CODES = {"outer": "bearing-outer-race", "inner": "bearing-inner-race", "ball": "bearing-rolling-element"}
SOUND = ("quiet", "tone", "passage", "other machine", "loose", "hum")
STRENGTHS = {"weak": (0.5, 1.0), "clear": (1.0, 3.0), "strong": (3.0, 15.0)}
"""Rms of the damage's ringing over that of all else, at the bearing's own sensor, in the band where it rings."""

LIKELY = 0.5
SECONDS = 8.0


POSITIONS = {"6:00": (1.0, 0.2), "3:00": (0.6, 0.6), "12:00": (0.3, 1.0)}
"""Of a damaged outer race, the load zone being at 6:00: force of its shocks, and how much an unbalance modulates it."""


@dataclass(frozen=True)
class Case:
    """One drawn motor, what is the matter with it, and its recording when it was sound."""

    recording: Recording
    healthy: Recording
    part: str
    bearing: str
    strength: str


def drawn_bearings(rng: np.random.Generator) -> tuple[Bearing, Bearing]:
    """Return those of a motor, of light or medium series, the fan end's up to two sizes smaller."""
    sizes = [int(name[2:]) for name in bearing_catalogue() if len(name) == 4 and name.startswith("62")]
    series, size = str(rng.choice(["62", "63"])), int(rng.choice([s for s in sizes if 4 <= s <= 14]))
    drawn = []
    for end, step in (("drive end", 0), ("fan end", int(rng.integers(0, 3)))):
        number = f"{series}{max(size - step, 3):02d}"
        drawn.append(Bearing(end, "motor", bearing=number if number in bearing_catalogue() else f"62{size:02d}"))
    return drawn[0], drawn[1]


def draw_case(rng: np.random.Generator, fs_hz: float = 12_000.0) -> Case:
    """Draw a motor and its recordings: as long when it was sound as with what is wrong."""
    bearings = drawn_bearings(rng)
    load = float(rng.choice([0.0, 1.0, 2.0, 3.0])) / 3
    rpm = float(rng.choice([1797.0, 2980.0, 3560.0])) * (1 - 0.04 * load) * rng.uniform(0.99, 1.0)
    slip_of_stated = rng.choice([0.0, rng.uniform(-0.003, 0.003), rng.uniform(-0.012, 0.012)])
    n_channels = int(rng.choice([1, 2, 3], p=[0.25, 0.35, 0.4]))
    part = str(rng.choice([*PARTS, "sound"], p=[0.25, 0.25, 0.15, 0.35]))
    own = int(rng.integers(0, 2)) if n_channels > 1 else 0
    n = 2 * int(SECONDS * fs_hz)
    turns = rpm / 60 * np.arange(n) / fs_hz + rng.uniform()
    turns = turns + 1e-4 * np.cumsum(rng.standard_normal(n)) / np.sqrt(fs_hz) * rng.uniform(0, 3)  # wanders
    strength = "sound"
    hits: tuple[FloatArray, FloatArray] | None = None
    if part == "sound":
        strength = str(rng.choice(SOUND))
        if strength == "other machine":
            hits = _train(rng, turns, _strange_order(rng, bearings), jitter=0.002)
        if strength == "loose":
            hits = _train(rng, turns, float(rng.choice([0.5, 1.0, 2.0])), jitter=0.003)
    else:
        strength = str(rng.choice(list(STRENGTHS)))
        angles, heights = _strikes(rng, turns, bearings[own], part, load)
        is_new = angles > turns[n // 2]
        hits = angles[is_new], heights[is_new]
    samples = _sensors(rng, turns, fs_hz, n_channels, hits, own, strength, bearings[own])
    names = ("X1_DE_time", "X1_FE_time", "X1_BA_time")[:n_channels]
    rig = Rig(
        name="drawn motor",
        shafts=(Shaft("motor"),),
        bearings=bearings,
        speed=ConstantSpeed(rpm * (1 + slip_of_stated), "motor"),
    )
    channels = tuple(Channel(name, "acceleration", "g") for name in names)
    healthy, recording = (Recording(half, fs_hz, channels, rig=rig) for half in np.split(samples, 2, axis=1))
    return Case(recording, healthy, part, bearings[own].name, strength)


def draw_hard_case(rng: np.random.Generator, fs_hz: float = 12_000.0) -> Case:
    """Draw one motor as W. A. Smith and R. B. Randall (2015) describe what departs from the textbook.

    Bearings 6205 and 6203, two or three sensors. Impacts scatter by 0.5 to 2 % of their distance and smear the lines;
    they ring at 2 to 4 kHz; the shaft modulates an outer race as deeply as an inner one; elements strike both races
    unequally and come and go with the cage; parts of the motor are loose beside the damage; electrical clicks come at
    random or with the mains; the shaft's own line is weak; one in four damages is at a bearing without a sensor of its
    own.
    """
    bearings = (Bearing("drive end", "motor", bearing="6205"), Bearing("fan end", "motor", bearing="6203"))
    rpm = float(rng.choice([1797.0, 1772.0, 1750.0, 1730.0]))
    part = str(rng.choice([*PARTS, "sound"], p=[0.3, 0.25, 0.2, 0.25]))
    strength = "sound" if part == "sound" else str(rng.choice(["clear", "strong"]))
    n = 2 * int(SECONDS * fs_hz)
    time_s = np.arange(n) / fs_hz
    turns = rpm / 60 * (1 + rng.uniform(-0.001, 0.001)) * time_s + rng.uniform()
    turns += 1e-4 * np.cumsum(rng.standard_normal(n)) / np.sqrt(fs_hz) * rng.uniform(0, 3)
    own, n_channels = int(rng.integers(0, 2)), int(rng.choice([2, 3]))
    forces: list[tuple[FloatArray, FloatArray, float]] = []  # angles, heights, loudness over all else
    if part != "sound":
        orders = bearings[own].orders()
        order = orders[PARTS[part]] * (2 if part == "ball" else 1) * (1 + rng.normal(0, 0.004))
        angles, heights = _train(rng, turns, order, rng.uniform(0.005, 0.02), rng.uniform(0.1, 0.5))
        by = orders["FTF"] if part == "ball" else 1.0
        depth = {"outer": rng.uniform(0.0, 0.95), "inner": rng.uniform(0.6, 1.0), "ball": rng.uniform(0.6, 1.0)}[part]
        heights = heights * np.maximum(1 + depth * np.cos(2 * np.pi * (by * angles + rng.uniform())), 0)
        if part == "ball":
            heights[::2] *= rng.uniform(0.0, 1.0)
            heights *= np.maximum(1 + rng.uniform(0, 0.5) * np.cos(2 * np.pi * angles), 0)
        forces.append((angles, heights, rng.uniform(*STRENGTHS[strength])))
    if rng.uniform() < 0.3:
        forces.append((*_train(rng, turns, float(rng.choice([0.5, 1.0, 2.0])), 0.005), rng.uniform(0.3, 2.0)))
    is_heard_elsewhere = rng.uniform() < 0.25  # no sensor at the damaged bearing
    samples = np.empty((n_channels, n))
    mains_hz = float(rng.choice([50.0, 60.0]))
    clicks = str(rng.choice(["none", "random", "mains"], p=[0.5, 0.3, 0.2]))
    for i in range(n_channels):
        x = _ringing(rng.standard_normal(n), rng.uniform(0.05, 0.45, 3) * fs_hz, fs_hz, rng.uniform(0.05, 0.2))
        x = x / x.std() + 0.7 * rng.standard_normal(n)
        for k in (1, 2, 3, 4):
            x *= 1 + rng.uniform(0, 0.2) / k * np.cos(2 * np.pi * (k * turns + rng.uniform()))
        level = x.std()
        for k in range(1, 25):
            x += rng.uniform(0.0, 0.5) / k**0.7 * np.cos(2 * np.pi * (k * turns + rng.uniform()))
        modes = np.sort(rng.uniform(2000.0, 4000.0, 2))
        for j, (angles, heights, loudness) in enumerate(forces):
            impulses = np.zeros(n)
            kept = angles > turns[n // 2] if j == 0 and part != "sound" else angles > 0  # sound in the first half
            np.add.at(impulses, np.minimum(np.searchsorted(turns, angles[kept]), n - 1), heights[kept])
            ring = _ringing(impulses, modes * (1 + 0.03 * rng.standard_normal(2)), fs_hz, rng.uniform(0.02, 0.08))
            away = 1.0 if i == own and not is_heard_elsewhere else rng.uniform(0.15, 0.5)
            lasts = np.sqrt(np.mean(impulses != 0) / np.mean(impulses[n // 2 :] != 0))
            x += away * loudness * ring / ring.std() * lasts * level / 2
        if clicks != "none":
            rate = 5 / fs_hz if clicks == "random" else 2 * mains_hz / fs_hz
            at = (
                np.flatnonzero(rng.uniform(size=n) < rate)
                if clicks == "random"
                else np.arange(0, n, 1 / rate).astype(int)
            )
            x[at] += rng.uniform(2, 8) * level * rng.choice([-1.0, 1.0], len(at))
        samples[i] = x
    names = ("X1_DE_time", "X1_FE_time", "X1_BA_time")[:n_channels]
    if is_heard_elsewhere and n_channels == 3:
        samples, names = np.delete(samples, own, axis=0), tuple(np.delete(names, own))
    rig = Rig(name="drawn motor", shafts=(Shaft("motor"),), bearings=bearings, speed=ConstantSpeed(rpm, "motor"))
    channels = tuple(Channel(str(name), "acceleration", "g") for name in names)
    halves = np.split(samples * rng.uniform(0.02, 0.2), 2, axis=1)
    healthy, recording = (Recording(half, fs_hz, channels, rig=rig) for half in halves)
    return Case(recording, healthy, part, bearings[own].name, strength)


def _strange_order(rng: np.random.Generator, bearings: tuple[Bearing, ...]) -> float:
    """Return an order whose first multiples are no part's: nothing could tell it from one."""
    orders = [o * (2 if name == "BSF" else 1) for b in bearings for name, o in b.orders().items()]
    while True:
        order = rng.uniform(0.15, 9.0)
        if all(abs(k * order / other - 1) > 0.03 for other in orders for k in (0.5, 1, 2, 3)):
            return order


def _train(
    rng: np.random.Generator, turns: FloatArray, order: float, jitter: float, spread: float = 0.1
) -> tuple[FloatArray, FloatArray]:
    """Return the angles and heights of impacts, each a little beside its even place, the errors adding up."""
    n = int((turns[-1] - turns[0]) * order) + 2
    steps = (1 + jitter * rng.standard_normal(n)) / order
    angles = turns[0] + rng.uniform() / order + np.cumsum(steps)
    angles = angles[angles < turns[-1]]
    return angles, np.maximum(1 + spread * rng.standard_normal(len(angles)), 0.05)


def _strikes(
    rng: np.random.Generator, turns: FloatArray, bearing: Bearing, part: str, pressed: float
) -> tuple[FloatArray, FloatArray]:
    orders = bearing.orders()
    order = orders[PARTS[part]] * (2 if part == "ball" else 1) * (1 + rng.normal(0, 0.005))
    angles, heights = _train(rng, turns, order, rng.uniform(0.001, 0.01), rng.uniform(0.05, 0.4))
    load = rng.uniform(0.0, 1.0)
    cage = orders["FTF"] * (1 + rng.normal(0, 0.003))
    if part == "outer":
        force, turned = POSITIONS[str(rng.choice(list(POSITIONS)))]
        depth = rng.uniform(0.0, 1.0) * turned * (1 - 0.5 * pressed)  # unbalance and bow move the load zone
        heights = force * heights * (1 + depth * np.cos(2 * np.pi * (angles + load)))
        heights = heights * (1 + rng.uniform(0, 0.3) * np.cos(2 * np.pi * (cage * angles + load)))
    elif part == "inner":
        depth = rng.uniform(0.5, 1.0)
        heights = heights * np.maximum(1 + depth * np.cos(2 * np.pi * (angles + load)), 0) ** rng.uniform(1, 2)
    else:
        depth = rng.uniform(0.5, 1.0)
        heights = heights * np.maximum(1 + depth * np.cos(2 * np.pi * (cage * angles + load)), 0)
        heights[::2] *= rng.uniform(0.2, 1.0)  # one race is nearer to the sensor
    return angles, heights


def _sensors(
    rng: np.random.Generator,
    turns: FloatArray,
    fs_hz: float,
    n_channels: int,
    hits: tuple[FloatArray, FloatArray] | None,
    own: int,
    strength: str,
    bearing: Bearing,
) -> FloatArray:
    n = len(turns)
    mains_hz, time_s = float(rng.choice([50.0, 60.0])), np.arange(n) / fs_hz
    tone = float(rng.choice([bearing.orders()["BPFO"], bearing.orders()["BPFI"]])) * (1 + rng.normal(0, 0.004))
    passage = bearing.orders()["BPFO"] * (1 + rng.normal(0, 0.004))
    loudness = rng.uniform(*STRENGTHS[strength]) if strength in STRENGTHS else rng.uniform(0.5, 4.0)
    modes = np.sort(rng.uniform(0.1, 0.45, 3)) * fs_hz
    samples = np.empty((n_channels, n))
    for i in range(n_channels):
        x = _ringing(rng.standard_normal(n), rng.uniform(0.05, 0.45, 3) * fs_hz, fs_hz, rng.uniform(0.05, 0.2))
        x = x / x.std() + 0.7 * rng.standard_normal(n)
        for k in (1, 2, 3):  # the shaft modulates the noise
            x *= 1 + rng.uniform(0, 0.15) / k * np.cos(2 * np.pi * (k * turns + rng.uniform()))
        if strength == "passage":
            x *= 1 + rng.uniform(0.02, 0.06) * np.cos(2 * np.pi * (passage * turns + rng.uniform()))
        if strength == "hum":
            for k in (1, 2, 3):
                x *= 1 + 0.3 / k * np.cos(2 * np.pi * (2 * mains_hz * k * time_s + rng.uniform()))
        for k in range(1, 25):
            x += rng.uniform(0.0, 1.5) / k**0.7 * np.cos(2 * np.pi * (k * turns + rng.uniform()))
        for k in (1, 2, 6):
            x += rng.uniform(0, 0.2) * np.cos(2 * np.pi * (k * mains_hz * time_s + rng.uniform()))
        slots = int(rng.integers(25, 50))  # of the motor, with its slip's sidebands
        x += (
            0.4
            * np.cos(2 * np.pi * (slots * turns + 2 * mains_hz * time_s))
            * (1 + 0.3 * np.cos(2 * np.pi * 2 * (mains_hz * time_s - turns * (rng.choice([1, 2])))))
        )
        if strength == "tone":  # smooth, with a harmonic and little modulation
            for k, level in enumerate((2.0, 0.5, 0.1), 1):
                x += level * np.cos(2 * np.pi * k * (tone * turns + rng.uniform()))
        if hits is not None:
            away = 1.0 if i == own else rng.uniform(0.1, 0.5)
            angles, heights = hits
            at = np.searchsorted(turns, angles)
            impulses = np.zeros(n)
            np.add.at(impulses, np.minimum(at, n - 1), heights)
            ring = _ringing(impulses, modes * (1 + 0.03 * rng.standard_normal(3)), fs_hz, rng.uniform(0.02, 0.08))
            lasts = np.sqrt(np.mean(impulses != 0) / np.mean(impulses[n // 2 :] != 0))  # of both halves or the second
            x += away * loudness * ring / ring.std() * lasts * x.std() / 2
        samples[i] = x
    return samples * rng.uniform(0.02, 0.2)


def _ringing(force: FloatArray, modes_hz: FloatArray, fs_hz: float, damping: float) -> FloatArray:
    """Return a force's response through some modes."""
    from scipy.signal import lfilter

    out = np.zeros(len(force))
    for mode_hz in modes_hz:
        pole = np.exp((-damping + 1j * np.sqrt(1 - damping**2)) * 2 * np.pi * mode_hz / fs_hz)
        out += lfilter([0.0, pole.imag], [1.0, -2 * pole.real, abs(pole) ** 2], force)
    return out


def claims(analysis: Analysis) -> Iterator[Finding]:
    """Yield what is said of bearings, surest first."""
    named = (f for f in analysis.findings if f.code in {*CODES.values(), "bearing-cage"})
    yield from sorted((f for f in named if f.kind in (Kind.FAULT, Kind.SUSPICION)), key=lambda f: -f.confidence)


def outcome(case: Case, analysis: Analysis) -> str:
    """Return "right", "wrong" (another part, above 50 %), "unsure" (below, or the right part below) or "missed"."""
    found = list(claims(analysis))
    right = [f for f in found if f.code == CODES.get(case.part) and f.where.bearing == case.bearing]
    if any(f.confidence > LIKELY for f in found if f not in right):
        return "wrong"
    if right and right[0].confidence > LIKELY:
        return "right"
    return "unsure" if found else "nothing said" if case.part == "sound" else "missed"


def what_changed(case: Case, analysis: Analysis) -> str:
    """Return whether the headline beside the sound motor names the part: "first", "named" below it, or "silent"."""
    expected = f"{BEARING_PARTS[case.part]} of {case.bearing}"
    title = next((f.title for f in analysis.findings if f.code == "changed-since-reference"), "")
    if expected in title:
        return "first"
    return "named" if outcome(case, analysis) == "right" else "silent"


BEARING_PARTS = {"outer": "outer race", "inner": "inner race", "ball": "rolling element"}


def main(n_cases: int, seed: int, draw: Callable[[np.random.Generator], Case] = draw_case) -> None:
    """Draw, analyse, count and print."""
    counts: dict[str, dict[tuple[str, str], Counter[str]]] = defaultdict(lambda: defaultdict(Counter))
    for i in range(n_cases):
        case = draw(np.random.default_rng([seed, i]))
        key = case.part, case.strength
        analysis, beside = analyze(case.recording), analyze(case.recording, reference=case.healthy)
        middle_s = case.recording.duration_s / 2
        half, other = case.recording.between(0.0, middle_s), case.recording.between(middle_s, 2 * middle_s)
        null = analyze(other, reference=half)
        result = outcome(case, analysis)
        counts["alone"][key][result] += 1
        counts["beside it sound"][key][outcome(case, beside)] += 1
        if case.part != "sound":
            counts["what changed"][key][what_changed(case, beside)] += 1
        is_new = any(
            f.code in {"changed-since-reference", *CODES.values()} and f.kind is Kind.FAULT for f in null.findings
        )
        is_new |= any(c.is_change for c in null.level_changes)
        counts["its halves"][key]["new" if is_new else "nothing new"] += 1
        if result == "wrong" or (result != "right" and case.strength == "strong") or is_new:
            said = "; ".join(f"{f.code} {f.where.bearing} {f.confidence:.2f}" for f in claims(analysis))
            changed = [c.label for c in null.level_changes if c.is_change]
            what = f"{i}: {case.part} of {case.bearing}, {case.strength}: {result}"
            print(f"{what}: {said or analysis.verdict[:150]} {changed}")
    for table, rows in counts.items():
        print(table)
        for (part, strength), counter in sorted(rows.items()):
            print(f"  {part:6} {strength:14} {', '.join(f'{k} {v}' for k, v in sorted(counter.items()))}")


if __name__ == "__main__":
    numbers = [int(a) for a in sys.argv[1:] if a.isdigit()]
    main(*(numbers + [120, 29][len(numbers) :]), draw_hard_case if "hard" in sys.argv else draw_case)
