"""A gear pair without equations of motion: static contact of all tooth pairs, measured through a linear structure.

The transmission error under load is solved at each instant from the stiffness and separation of the tooth pairs. It
drives random modes, together with forces of shafts, friction and bearings. The model has its own forms of stiffness,
deviations and effects, many drawn for each machine, so that learning from it finds what they have in common.

Not represented: feedback of the dynamic mesh force on the contact – parametric resonance, tooth separation (backlash).

Source: H. N. Özgüven, D. R. Houser, "Dynamic analysis of high speed gears by using loaded static transmission error",
J. Sound Vib. 125 (1988); W. D. Mark, "Analysis of the vibratory excitation of gear systems: basic theory", J. Acoust.
Soc. Am. 63 (1978).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import cos, pi, radians, sqrt, tan

import numpy as np

from app.studies.drawn_rigs import DrawnRig
from app.studies.gap.gearboxes import (
    SEED,
    Made,
    PopulationSample,
    Recorded,
    draw_machine,
    put_in_by_hand,
    reduced,
    samples_of,
)
from gearsig.checks import FloatArray
from gearsig.gap import NONE, OperatingCondition
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, Rig
from sims.cracked import CrackedPair, CrackedTwin
from sims.effects import ONE_TOOTH_SHARE, textbook
from sims.gear_pair import build_rig
from sims.machine import Nominal, Operation, log_uniform, nominal_of
from sims.measure import Tachometer, pulse_voltage
from sims.simulator import SimulationSetup

# --------------------
# The path from forces to sensors: modes of the machine, shared by all channels, and the part of each channel.
# --------------------


MESH, SHAFTS, BEARINGS, FRICTION, INSIDE = range(5)
"""Sources of force or motion; the last is the noise of the machine itself."""
N_WAYS = 5

MODES = (4, 11)
MODE_HZ, MODE_DAMPING = (120.0, 9000.0), (0.008, 0.1)
BY_BODY = 0.3
"""Participation of the direct path without a mode, relative to modes with participations of the order of 1."""
MOVED, LOUDER = 0.02, 0.15
"""Effect of remounting on the frequency and strength of a mode: standard deviations of logarithms."""
MOUNTING_FROM_HZ = 1200.0
"""Modes below this frequency belong to the machine and do not depend on the mounting of a sensor."""


@dataclass(frozen=True)
class Structure:
    """Modes, with the participation of each source in each channel.

    Parameters
    ----------
    frequency_hz, damping_ratio : arrays, (n_modes,)
    parts : array, (n_channels, N_WAYS, n_modes + 1)
        Participations; the last is the direct path without a mode.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    parts: FloatArray

    @classmethod
    def drawn(cls, n_channels: int, rng: np.random.Generator) -> Structure:
        """Draw a structure."""
        n = int(rng.integers(*MODES))
        frequency = np.sort([log_uniform(rng, *MODE_HZ) for _ in range(n)])
        damping = np.array([log_uniform(rng, *MODE_DAMPING) for _ in range(n)])
        parts = rng.standard_normal((n_channels, N_WAYS, n + 1))
        parts[..., -1] *= BY_BODY
        return cls(frequency, damping, parts)

    def mounted_anew(self, rng: np.random.Generator) -> Structure:
        """Return the structure as measured by remounted sensors."""
        touched = self.frequency_hz > MOUNTING_FROM_HZ
        moved = np.exp(MOVED * rng.standard_normal(len(touched)) * touched)
        louder = np.exp(LOUDER * rng.standard_normal((len(self.parts), 1, len(touched))) * touched)
        parts = self.parts.copy()
        parts[..., :-1] *= louder
        return replace(self, frequency_hz=self.frequency_hz * moved, parts=parts)

    def softer(self, share: float, below_hz: float) -> Structure:
        """Return the structure with modes below a frequency lowered by at most `share`."""
        lower = self.frequency_hz < below_hz
        return replace(self, frequency_hz=self.frequency_hz * np.where(lower, 1.0 - share, 1.0))

    def accelerations(self, channel: int, frequency_hz: FloatArray, way: int) -> np.ndarray:
        """Return the acceleration per unit motion, Σ aᵣ ω²/(1 − (f/fᵣ)² + 2iζ f/fᵣ), at each frequency."""
        total = np.full(len(frequency_hz), self.parts[channel, way, -1], dtype=np.complex128)
        for f, zeta, part in zip(self.frequency_hz, self.damping_ratio, self.parts[channel, way], strict=False):
            ratio = frequency_hz / f
            total += part / (1.0 - ratio**2 + 2j * zeta * ratio)
        return np.asarray(total * -((2.0 * np.pi * frequency_hz) ** 2))


# --------------------
# Static contact of all tooth pairs at once: transmission error under load, and the load of each pair.
# --------------------


REACH = 0.35
"""Distance beyond either end of the path of contact, in base pitches, at which a loaded pair may still touch."""
N_PATH = 96
"""Number of points of a table over the path."""
N_PAIRS = 4
"""Maximum number of tooth pairs in contact at an instant: contact ratios reach 2."""


@dataclass(frozen=True)
class Path:
    """The path of contact of a pair without profile shift, in base pitches from its start.

    Parameters
    ----------
    ratio : float
        Contact ratio: where the path ends.
    pitch_point : float
    base_pitch_m : float
    """

    ratio: float
    pitch_point: float
    base_pitch_m: float

    @classmethod
    def of(cls, teeth: tuple[int, int], module_mm: float, pressure_angle_deg: float) -> Path:
        """Return the path of standard teeth, whose addendum is one module."""
        alpha, module = radians(pressure_angle_deg), 1e-3 * module_mm
        pitch_m = pi * module * cos(alpha)
        base = [0.5 * z * module * cos(alpha) for z in teeth]
        beyond = [
            sqrt((0.5 * z * module + module) ** 2 - b**2) - b * tan(alpha) for z, b in zip(teeth, base, strict=True)
        ]
        # With an undercut mate, the path ends where its involute begins.
        beyond = [
            min(reach, base_length * tan(alpha)) for reach, base_length in zip(beyond, reversed(base), strict=True)
        ]
        return cls(sum(beyond) / pitch_m, beyond[1] / pitch_m, pitch_m)

    @property
    def places(self) -> FloatArray:
        """Positions of the points of a table, in base pitches."""
        return np.linspace(-REACH, self.ratio + REACH, N_PATH)


def meeting(cycle: FloatArray, path: Path, tables: tuple[FloatArray, FloatArray], first: tuple[int, int]) -> FloatArray:
    """Return the sum of both gears' tables at the contact of each pair, (N_PAIRS, n).

    Parameters
    ----------
    cycle : array, (n,)
        Mesh cycles since the teeth `first` came into contact.
    path : Path
    tables : (array, array)
        (teeth, N_PATH) of either gear.
    first : (int, int)
    """
    number, spot = _pairs(cycle, path)
    low = np.clip(spot.astype(np.intp), 0, N_PATH - 2)
    part = np.clip(spot - low, 0.0, 1.0)
    total = np.zeros(spot.shape)
    for table, offset in zip(tables, first, strict=True):
        flat, row = table.ravel(), (number + offset) % len(table) * N_PATH + low
        total += (1.0 - part) * flat[row] + part * flat[row + 1]
    return total


def at_places(cycle: FloatArray, path: Path, table: FloatArray) -> FloatArray:
    """Return the values of a table at the position of each pair, (N_PAIRS, n)."""
    _, spot = _pairs(cycle, path)
    return np.asarray(np.interp(spot, np.arange(N_PATH), table))


def _pairs(cycle: FloatArray, path: Path) -> tuple[np.ndarray, FloatArray]:
    """Return the numbers of the pairs that may touch and their positions, in points of a table."""
    newest = np.floor(cycle + REACH).astype(np.intp)
    number = newest[None] - np.arange(N_PAIRS)[:, None]
    spot = (cycle[None] - number + REACH) * ((N_PATH - 1) / (path.ratio + 2.0 * REACH))
    return number, spot


def is_in_reach(cycle: FloatArray, path: Path) -> np.ndarray:
    """Return which pairs are within the ends of the table."""
    _, spot = _pairs(cycle, path)
    return np.asarray((spot >= 0.0) & (spot <= N_PATH - 1))


def static_contact(stiffness: FloatArray, gaps: FloatArray, load: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the transmission error x with Σ kᵢ max(x − gᵢ, 0) = F, and the load of each pair.

    For only the pairs with the m smallest gaps, x_m = (F + Σ kᵢ gᵢ)/Σ kᵢ; the left side is convex, so x is the minimum
    of all x_m.

    Parameters
    ----------
    stiffness, gaps : arrays, (N_PAIRS, n)
        N/m, m.
    load : array, (n,)
        N, above 0.

    Returns
    -------
    array, (n,), m
    array, (N_PAIRS, n), N
    """
    order = np.argsort(gaps, axis=0)
    k, g = np.take_along_axis(stiffness, order, axis=0), np.take_along_axis(gaps, order, axis=0)
    error = ((load + np.cumsum(k * g, axis=0)) / np.cumsum(k, axis=0)).min(axis=0)
    return error, stiffness * np.maximum(error - gaps, 0.0)


RATES_HZ = (12_800.0, 20_000.0, 20_480.0, 25_600.0)
STIFFNESS_N_PER_M2 = 14e9
"""Mesh stiffness of steel gears per face width."""
N_CHANNELS = 2
DIRECTNESS = (1.0, 10.0)
"""Range for friction: (mesh resonance over mesh frequency)² if the mesh frequency is lower, else 1."""
END_RADII_M = (4e-3, 40e-3)
"""Radius R of the flank that a corner touches beyond the ends of the path: a gap of d²/2R."""

Wave = tuple[int, float, float, float]
"""Side of the shaft, order, size, phase in radians."""


@dataclass
class QuasiStaticState:
    """The state from which a recording is made; effects change it.

    Parameters
    ----------
    gaps_m, weak : [array, array]
        (teeth, N_PATH) of either gear: separation; additional compliance of a pair relative to its own.
    runout_m, load, stiffness : list of Wave
        Sums of cosines: separation of all teeth; torque, over the mean; mesh stiffness, over the mean.
    force_n : list of Wave
        Force on a shaft, external or by a mass that turns with it.
    soft_spots : float
        Share of the mesh stiffness lost over the whole revolution.
    friction, reversal : float
        Coefficient; width over which it reverses at the pitch point, in base pitches.
    restless_m : float
        Standard deviation of a separation that never repeats.
    impacts : list of function
        (driver angle in revolutions, time in s, generator) → forces (n,) on a bearing.
    play : float
        Play of the bearings, relative to their static deflection.
    passing : float
        Order of the driver at which the play opens and closes.
    wander : list of (float, float, float)
        Speed variation: share, Hz, phase.
    structure : Structure
    paths : sequence of PathChange
        Change of the path of each channel, after everything in the machine; empty: unchanged.
    """

    gaps_m: list[FloatArray]
    weak: list[FloatArray]
    runout_m: list[Wave]
    load: list[Wave]
    stiffness: list[Wave]
    force_n: list[Wave]
    soft_spots: float
    friction: float
    reversal: float
    restless_m: float
    impacts: list[Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]]
    play: float
    passing: float
    wander: list[tuple[float, float, float]]
    structure: Structure
    paths: Sequence[textbook.PathChange] = ()


@dataclass(frozen=True)
class StaticMachine:
    """A machine as manufactured.

    Parameters
    ----------
    drawn : DrawnRig
        Tooth counts, speed, torque and length of the recording.
    rig : Rig
        The rig as its maker knows it.
    nominal : Nominal
        Nominal values of the gear pair.
    path : Path
    stiffness_n_per_m : array, (N_PATH,)
        Stiffness of one tooth pair over the path.
    rate_hz : float
    noise_share, inside_share : (float, float)
        Noise of each sensor, and noise of the machine itself, relative to the vibration.
    seed : int
    """

    drawn: DrawnRig
    rig: Rig
    nominal: Nominal
    path: Path
    stiffness_n_per_m: FloatArray
    rate_hz: float
    noise_share: tuple[float, float]
    inside_share: tuple[float, float]
    seed: int
    end_radius_m: float = field(default=END_RADII_M[0])

    @classmethod
    def of(cls, rng: np.random.Generator) -> StaticMachine:
        """Draw a machine."""
        drawn = draw_machine(rng)
        operation = Operation.steady(drawn.speed_rpm, drawn.torque_nm)
        ready = CrackedPair().prepare(
            SimulationSetup("", drawn.parameters, (), operation), rng, sampling_rate_hz=max(RATES_HZ)
        )
        rig = build_rig(ready.machine, operation, name="drawn")
        nominal = nominal_of(rig)
        path = Path.of(drawn.teeth, nominal.module_mm, nominal.pressure_angle_deg)
        mesh = STIFFNESS_N_PER_M2 * 1e-3 * nominal.face_width_mm * rng.uniform(0.8, 1.2)
        noise, inside = ((log_uniform(rng, *span), log_uniform(rng, *span)) for span in ((0.003, 0.1), (0.003, 0.15)))
        return cls(
            drawn,
            rig,
            nominal,
            path,
            mesh / path.ratio * _shape(path, rng),
            float(rng.choice(RATES_HZ)),
            noise,
            inside,
            int(rng.integers(2**31)),
            log_uniform(rng, *END_RADII_M),
        )

    @property
    def load_n(self) -> float:
        """Mesh force in N."""
        pitch_radius_m = 0.5e-3 * self.nominal.module_mm * self.drawn.teeth[0]
        return self.drawn.torque_nm / (pitch_radius_m * cos(radians(self.nominal.pressure_angle_deg)))

    @property
    def rated_m(self) -> float:
        """Deflection (m) under a typical load: the scale of errors, whatever the present load."""
        return 50e6 * 1e-3 * self.nominal.module_mm / STIFFNESS_N_PER_M2

    @property
    def directness(self) -> float:
        """Ratio of the response to friction across the teeth to that of the same deflection along the line of action.

        Below the mesh resonance, the gears can rotate to follow a transmission error, but cannot evade friction.
        """
        return log_uniform(np.random.default_rng([self.seed, 4]), *DIRECTNESS)

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of each shaft per revolution of the driver."""
        return 1.0, self.drawn.teeth[0] / self.drawn.teeth[1]

    def healthy(self) -> QuasiStaticState:
        """Return the healthy state, with manufacturing deviations."""
        rng = np.random.default_rng([self.seed, 1])
        unit = self.rated_m
        profile = _profile(self, rng)
        gaps: list[FloatArray] = []
        for teeth in self.drawn.teeth:
            pitch = log_uniform(rng, 0.01, 0.12) * unit * rng.standard_normal((teeth, 1))
            gaps.append(profile / 2.0 + pitch + textures(teeth, log_uniform(rng, 0.002, 0.04) * unit, rng))
        runouts, waves = (log_uniform(rng, 0.02, 0.6) * unit for _ in range(2)), rng.uniform(0, 2 * np.pi, 8)
        pulls = float(rng.choice((1.0, 2.0, 3.0, 4.0, 6.0)))
        return QuasiStaticState(
            gaps_m=gaps,
            weak=[np.zeros((teeth, N_PATH)) for teeth in self.drawn.teeth],
            runout_m=[(side, 1.0, size, waves[side]) for side, size in enumerate(runouts)],
            load=[(0, pulls, log_uniform(rng, 1e-4, 5e-3), waves[2])],
            stiffness=[
                (0, 1.0, log_uniform(rng, 1e-4, 5e-3), waves[3]),
                (1, 1.0, log_uniform(rng, 1e-4, 5e-3), waves[4]),
            ],
            force_n=[
                (side, order, share * self.force_unit_n * log_uniform(rng, 3e-3, 0.1), waves[5 + side])
                for side in (0, 1)
                for order, share in ((1.0, 1.0), (2.0, 0.2))
            ],
            soft_spots=0.0,
            friction=rng.uniform(0.02, 0.07),
            reversal=rng.uniform(0.02, 0.3),
            restless_m=log_uniform(rng, 1e-3, 2e-2) * unit,
            impacts=[],
            play=log_uniform(rng, 0.01, 0.3),
            passing=self.rig.bearings[0].orders()["BPFO"],
            wander=[
                (log_uniform(rng, 3e-5, 2e-3), rng.uniform(0.05, 1.0), rng.uniform(0, 2 * np.pi)) for _ in range(2)
            ],
            structure=Structure.drawn(N_CHANNELS, rng),
        )

    @property
    def force_unit_n(self) -> float:
        """Scale of a force on a shaft: the force of a typical load, in N."""
        return 50.0 * self.nominal.module_mm * self.nominal.face_width_mm


def _shape(path: Path, rng: np.random.Generator) -> FloatArray:
    """Return the relative stiffness of a pair over the path, about 1: minimum at the ends, slightly asymmetric."""
    off = 2.0 * np.clip(path.places / path.ratio, 0.0, 1.0) - 1.0
    fall, lean = rng.uniform(0.15, 0.5), rng.uniform(-0.1, 0.1)
    return np.asarray(1.0 - fall * np.abs(off) ** rng.uniform(1.5, 3.0) + lean * off)


def _profile(machine: StaticMachine, rng: np.random.Generator) -> FloatArray:
    """Return the separation common to all pairs: corners beyond the ends, relief, profile shape."""
    path, unit = machine.path, machine.rated_m
    beyond = np.maximum(np.maximum(-path.places, path.places - path.ratio), 0.0) * path.base_pitch_m
    at = np.clip(path.places / path.ratio, 0.0, 1.0)
    relieved = np.zeros(N_PATH)
    if rng.uniform() < 0.7:
        reach, power = rng.uniform(0.12, 0.4), rng.uniform(1.0, 2.0)
        for end in (at, 1.0 - at):
            relieved += rng.uniform(0.3, 1.4) * unit * np.maximum(1.0 - end / reach, 0.0) ** power
    bent = sum(
        log_uniform(rng, 0.01, 0.15) * unit / k * np.cos(np.pi * k * at + rng.uniform(0, 2 * np.pi)) for k in (1, 2, 3)
    )
    return np.asarray(beyond**2 / (2.0 * machine.end_radius_m) + relieved + bent)


def textures(teeth: int, size_m: float, rng: np.random.Generator) -> FloatArray:
    """Return rough flanks, (teeth, N_PATH): waves from a third of the path to its point spacing, of equal amplitude."""
    lines = rng.standard_normal((teeth, N_PATH // 2 + 1)) + 1j * rng.standard_normal((teeth, N_PATH // 2 + 1))
    lines[:, :3] = 0.0
    lines[:, int(rng.integers(8, N_PATH // 2)) :] = 0.0
    rough: FloatArray = np.fft.irfft(lines, N_PATH, axis=1)
    return rough * (size_m / max(float(rough.std()), 1e-300))


# --------------------
# The catalogue's effects on the quasi-static machine, with forms drawn for each machine.
# --------------------


def _tooth(machine: StaticMachine, rng: np.random.Generator) -> tuple[int, int]:
    side = textbook.draw_side(rng)
    return side, int(rng.integers(machine.drawn.teeth[side]))


def _bearing(machine: StaticMachine, rng: np.random.Generator) -> tuple[Bearing, float]:
    """Draw a bearing; return it with the revolutions of its shaft per driver revolution."""
    bearing = machine.rig.bearings[int(rng.integers(len(machine.rig.bearings)))]
    return bearing, machine.shaft_orders[0 if bearing.shaft == machine.rig.pairs[0].driver else 1]


def _towards_tip(machine: StaticMachine, side: int) -> FloatArray:
    """Return 0 at the end of the path near a gear's root, 1 near its tip; the driver's tip is where the path ends."""
    at: FloatArray = np.clip(machine.path.places / machine.path.ratio, 0.0, 1.0)
    return at if side == 0 else 1.0 - at


def _curvature_m(machine: StaticMachine) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the radii of curvature of both flanks over the path, and both base radii, in m.

    They are those of standard teeth, held constant beyond the ends of the path.
    """
    nominal, path = machine.nominal, machine.path
    alpha = radians(nominal.pressure_angle_deg)
    base = np.array([0.5e-3 * z * nominal.module_mm * cos(alpha) for z in machine.drawn.teeth])
    off = (np.clip(path.places, 0.0, path.ratio) - path.pitch_point) * path.base_pitch_m
    return base[0] * tan(alpha) + off, base[1] * tan(alpha) - off, base


def crack_lever(machine: StaticMachine, side: int, hinge_modules: float) -> FloatArray:
    """Return the lever of the force about a hinge below the pitch circle, over the path, relative to the maximum."""
    *radii, base = _curvature_m(machine)
    hinge = 1e-3 * machine.nominal.module_mm * (0.5 * machine.drawn.teeth[side] - hinge_modules)
    lever = np.maximum(np.hypot(base[side], radii[side]) - hinge, 0.0)
    return np.asarray(lever / lever.max())


def sinking_m(machine: StaticMachine, side: int, inside: FloatArray) -> FloatArray:
    """Return how far a mate sinks beyond an edge on a flank, s²/(2R), for distances beyond it in base pitches.

    s = ρ/r_b times the distance along the path, because a contact moves more slowly over the flank.
    """
    first, second, base = _curvature_m(machine)
    along = inside * machine.path.base_pitch_m * (first, second)[side] / base[side]
    return np.asarray(along**2 * (first + second) / (2.0 * first * second))


def _band(machine: StaticMachine, centre: float, width: float, edge: float) -> FloatArray:
    place = machine.path.places
    band: FloatArray = 0.5 * (
        np.tanh((place - centre + width / 2) / edge) - np.tanh((place - centre - width / 2) / edge)
    )
    return band


def _root_crack(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A tooth with a hinge in its root, compliant as the lever squared; a deep crack stays bent, away from the load.

    The force turns the hinge in proportion to the lever, and the displacement by that turn is again proportional to it.
    """
    side, tooth = _tooth(machine, rng)
    lever, softer = crack_lever(machine, side, rng.uniform(0.9, 1.5)), log_uniform(rng, 0.05, 5.0)
    state.weak[side][tooth] += softer * lever**2
    if rng.uniform() < 0.3:
        state.gaps_m[side][tooth] += log_uniform(rng, 0.02, 0.5) * machine.rated_m


PIT_M = (30e-6, 500e-6)
"""Depths of pits."""
ROUNDED = (0.5, 1.5)
"""Roundness of a chip's edge: sinking of the mate beyond it, relative to a sharp edge."""


def _tooth_spall(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A pit near the pitch line: over part of the width it reduces contact; over all of it the mate sinks or bridges.

    The contact has up to about a third of the compliance of a pair, which grows as the remaining width shrinks.
    """
    side, tooth = _tooth(machine, rng)
    centre, width = machine.path.pitch_point + rng.uniform(-0.3, 0.3), rng.uniform(0.1, 0.7)
    if rng.uniform() < 0.5:
        band = _band(machine, centre, width, rng.uniform(0.01, 0.06))
        state.weak[side][tooth] += log_uniform(rng, 0.03, 2.0) * band
    else:
        inside = np.clip(0.5 * width - np.abs(machine.path.places - centre), 0.0, None)
        state.gaps_m[side][tooth] += np.minimum(sinking_m(machine, side, inside), log_uniform(rng, *PIT_M))


def _chipped_tooth(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A missing tip, over all or part of the width: its pair disengages early or engages late.

    Over all of the width, its mate sinks beyond the remaining edge as beyond the corner of a healthy tooth.
    """
    side, tooth = _tooth(machine, rng)
    lost_ratio = rng.uniform(0.08, 0.55)
    if rng.uniform() < 0.7:
        at = machine.path.places
        beyond = at - machine.path.ratio if side == 0 else -at
        beyond = np.clip(beyond + lost_ratio * machine.path.ratio, 0.0, None)
        state.gaps_m[side][tooth] += log_uniform(rng, *ROUNDED) * sinking_m(machine, side, beyond)
    else:
        lost = np.clip((_towards_tip(machine, side) - 1.0 + lost_ratio) / 0.1, 0.0, 1.0)
        state.weak[side][tooth] += log_uniform(rng, 0.2, 6.0) * lost


def _tooth_wear(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """Flanks worn most where they slide most, differently on the two gears and slightly differently on each tooth."""
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
    state.restless_m *= 1.0 + textbook.partly(rng)


def _pitch_error(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """Displaced teeth: a single one, or all independently, cumulatively, or in a wave."""
    side = textbook.draw_side(rng)
    teeth = machine.drawn.teeth[side]
    if rng.uniform() < ONE_TOOTH_SHARE:
        out = log_uniform(rng, 0.1, 6.0) * machine.rated_m * textbook.sign(rng)
        state.gaps_m[side][int(rng.integers(teeth))] += out
        return
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


def _surface_roughness(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """Rough flanks: a part that repeats with the gears and a part that never repeats."""
    size = log_uniform(rng, 0.02, 1.5) * machine.rated_m
    for side in (0, 1):
        state.gaps_m[side] = state.gaps_m[side] + textures(machine.drawn.teeth[side], size * rng.uniform(0.3, 1.0), rng)
    state.restless_m += 0.3 * size * textbook.partly(rng)
    state.friction *= rng.uniform(1.0, 1.8)


def _sliding_friction(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:  # noqa: ARG001 - form
    """Friction of the flanks: a force that reverses at the pitch point."""
    state.friction = log_uniform(rng, 0.1, 0.6)
    state.reversal = rng.uniform(0.005, 0.3)


def _eccentricity(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """An eccentric gear: separation and depth of the teeth vary once per revolution, and its mass is off the axis."""
    side, phase, size = textbook.draw_side(rng), rng.uniform(0, 2 * np.pi), log_uniform(rng, 2.0, 60.0)
    state.runout_m.append((side, 1.0, size * machine.rated_m, phase))
    state.stiffness.append((side, 1.0, min(size * rng.uniform(5e-4, 1e-2), 0.5), phase + rng.uniform(-1.5, 1.5)))
    state.load.append((side, 1.0, min(size * rng.uniform(0.0, 5e-3), 0.5), phase + rng.uniform(-1.5, 1.5)))
    state.force_n.append((side, 1.0, size * machine.force_unit_n * log_uniform(rng, 1e-4, 1e-2), phase))


def _unbalance(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A mass off the axis."""
    size = log_uniform(rng, 0.1, 3.0) * machine.force_unit_n
    state.force_n.append((textbook.draw_side(rng), 1.0, size, rng.uniform(0, 2 * np.pi)))


def _misalignment(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """Contact on part of the width, partly turning with a shaft; coupling forces twice per revolution."""
    side, size = textbook.draw_side(rng), log_uniform(rng, 0.1, 0.8)
    state.soft_spots = size * rng.uniform(0.3, 0.8)
    for order, share in ((1.0, rng.uniform(0.0, 0.6)), (2.0, rng.uniform(0.0, 0.4))):
        state.stiffness.append((side, order, size * share, rng.uniform(0, 2 * np.pi)))
    force = size * log_uniform(rng, 0.02, 2.0) * machine.force_unit_n
    for order, share in ((1.0, rng.uniform(0.0, 0.6)), (2.0, 1.0), (3.0, rng.uniform(0.0, 0.4))):
        state.force_n.append((side, order, force * share, rng.uniform(0, 2 * np.pi)))
    state.load.append((side, 2.0, size * log_uniform(rng, 1e-3, 0.1), rng.uniform(0, 2 * np.pi)))


def _torque_ripple(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A torque that varies n times per revolution, and slightly 2n times; it twists the shaft and acts on the frame."""
    pulls = log_uniform(rng, 1.0, 12.0)
    order, side, size = (
        float(round(pulls)) if rng.uniform() < 0.75 else pulls,
        textbook.draw_side(rng),
        log_uniform(rng, 0.02, 0.6),
    )
    for n, share in ((1.0, 1.0), (2.0, rng.uniform(0.0, 0.4))):
        phase = rng.uniform(0, 2 * np.pi)
        state.load.append((side, n * order, share * size, phase))
        state.force_n.append((side, n * order, share * size * machine.load_n * textbook.partly(rng), phase))


def _speed_fluctuation(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:  # noqa: ARG001 - form
    for share in (1.0, rng.uniform(0.0, 0.6)):
        size = share * log_uniform(rng, 0.004, 0.12) / 2.0
        state.wander.append((size, log_uniform(rng, 0.2, 4.0), rng.uniform(0, 2 * np.pi)))


def _race(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator, name: str) -> None:
    """Rolling elements enter a defect and leave it with an impact; an inner-race defect turns through the load zone."""
    bearing, shaft = _bearing(machine, rng)
    order = bearing.orders()[name] * shaft * (1.0 - rng.uniform(0.0, 0.015))
    size = log_uniform(rng, 0.02, 3.0) * (machine.load_n + 0.1 * machine.force_unit_n)
    jitter, uneven, width = log_uniform(rng, 1e-3, 2e-2), rng.uniform(0.05, 0.4), log_uniform(rng, 1e-4, 5e-4)
    falls, across, sharp = textbook.partly(rng), rng.uniform(0.02, 0.3), rng.uniform(0.5, 3.0)

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
        return np.asarray(np.convolve(force, pulse, mode="same"))

    state.impacts.append(knock)


def _bearing_clearance(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A loose bearing: it transmits forces nonlinearly, and its support is softer."""
    bearing, shaft = _bearing(machine, rng)
    play = log_uniform(rng, 0.3, 30.0)
    state.play += play
    state.passing = bearing.orders()["BPFO"] * shaft * (1.0 - rng.uniform(0.0, 0.01))
    softer = min(0.08 * play, 0.5) * textbook.partly(rng)
    state.structure = state.structure.softer(softer, log_uniform(rng, 500.0, 6000.0))
    state.restless_m *= 1.0 + min(play, 5.0) * textbook.partly(rng)


EFFECTS: dict[str, Callable[[StaticMachine, QuasiStaticState, np.random.Generator], None]] = {
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
    "bearing_outer_race": partial(_race, name="BPFO"),
    "bearing_inner_race": partial(_race, name="BPFI"),
    "bearing_clearance": _bearing_clearance,
}


# --------------------
# From the state of a machine on a day to a recording.
# --------------------


FINER = 2
"""Oversampling of the contact relative to the recording: its kinks extend beyond the recording's Nyquist frequency."""
LEAD_S = 0.3
"""Time before and after the recording in which modes settle."""
SETTLING_S = 0.15
"""Time at either end of it in which motions fade in and out."""
OUT_OF_REACH_M = 1.0
TURNS_BEFORE = 40
"""Maximum number of whole driver revolutions by which the meeting teeth differ from day to day."""
MIN_NOISE_HZ = 20.0
RIPPLE = 0.3
"""Relative variation of the play as rolling elements pass."""
SPEED_SCATTER, TORQUE_SCATTER, GAIN_SCATTER, NOISE_SCATTER, ANEW_SHARE = 0.005, 0.04, 0.1, 0.12, 0.6


@dataclass(frozen=True)
class QuasiStaticDay:
    """Operation of a machine on a day, and mounting of its sensors."""

    speed_factor: float
    torque_factor: float
    gains: tuple[float, ...]
    noise_factor: float
    turns_before: int
    seed: int
    anew: bool

    @classmethod
    def drawn(cls, rng: np.random.Generator) -> QuasiStaticDay:
        """Draw a day."""
        speed, torque = (1.0 + s * float(rng.standard_normal()) for s in (SPEED_SCATTER, TORQUE_SCATTER))
        anew = bool(rng.uniform() < ANEW_SHARE)
        gains = np.exp(GAIN_SCATTER * rng.standard_normal(N_CHANNELS) * anew)
        noise = float(np.exp(NOISE_SCATTER * rng.standard_normal()))
        turns = int(rng.integers(TURNS_BEFORE))
        return cls(speed, torque, tuple(gains.tolist()), noise, turns, int(rng.integers(2**31)), anew)


def record(
    machine: StaticMachine, state: QuasiStaticState, day: QuasiStaticDay, levels: FloatArray | None
) -> Recording:
    """Return a recording of a machine in a given state on a given day.

    Parameters
    ----------
    machine : StaticMachine
    state : QuasiStaticState
    day : QuasiStaticDay
    levels : array, (n_channels,), or None
        Standard deviation of each channel to which noise is relative; None: no noise.
    """
    rng = np.random.default_rng([day.seed, 1])
    rate = FINER * machine.rate_hz
    time = np.arange(int((machine.drawn.duration_s + 2.0 * LEAD_S) * rate)) / rate
    turns = _turns(machine, state, day, time, rng)
    motions = _motions(machine, state, day, turns, time, rng)
    structure = state.structure.mounted_anew(np.random.default_rng([day.seed, 2])) if day.anew else state.structure
    first, rows = round(LEAD_S * machine.rate_hz), []
    lasting = slice(first, first + int(machine.drawn.duration_s * machine.rate_hz))
    for channel in range(N_CHANNELS):
        row = _sensed_motion(structure, channel, motions, rate)[lasting]
        if levels is not None:
            inside = _sensed_motion(structure, channel, {INSIDE: rng.standard_normal(len(time))}, rate)[lasting]
            row = row + inside * (machine.inside_share[channel] * levels[channel] / inside.std())
        if state.paths:
            row = state.paths[channel].of(row, machine.rate_hz)
        if levels is not None:
            row = row + _noise(len(row), machine, channel, rng) * levels[channel] * day.noise_factor
        rows.append(row * day.gains[channel])
    later = time[::FINER][lasting]
    tacho = tachometer(turns, time, later, rng)
    samples = np.stack([*rows, tacho])
    point = machine.rig.operating_point
    channels = tuple(Channel(s.channel, s.quantity, s.unit, s.position) for s in machine.rig.sensors)
    return Recording(samples, machine.rate_hz, channels, rig=replace(machine.rig, operating_point=point))


def _turns(
    machine: StaticMachine, state: QuasiStaticState, day: QuasiStaticDay, time: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return the driver angle in revolutions."""
    speed_hz = machine.drawn.speed_rpm * day.speed_factor / 60.0
    wander = np.zeros(len(time))
    for share, hz, phase in state.wander:
        wander += share / (2 * np.pi * hz) * np.sin(2 * np.pi * hz * time + phase + rng.uniform(0, 2 * np.pi))
    return np.asarray(day.turns_before + rng.uniform() + speed_hz * (time + wander))


def _motions(
    machine: StaticMachine,
    state: QuasiStaticState,
    day: QuasiStaticDay,
    turns: FloatArray,
    time: FloatArray,
    rng: np.random.Generator,
) -> dict[int, FloatArray]:
    """Return the motion that enters the structure from each source, in m."""
    path, cycle = machine.path, turns * machine.drawn.teeth[0]

    def waves(waves_of: Sequence[Wave]) -> FloatArray:
        angles = [2 * np.pi * turns * order for order in machine.shaft_orders]
        return sum((size * np.cos(n * angles[side] + phase) for side, n, size, phase in waves_of), np.zeros(len(turns)))

    first = (0, 0)
    gaps = meeting(cycle, path, (state.gaps_m[0], state.gaps_m[1]), first)
    weak = meeting(cycle, path, (state.weak[0], state.weak[1]), first)
    inside = is_in_reach(cycle, path)
    pair_stiffness = at_places(cycle, path, machine.stiffness_n_per_m) * (1.0 - state.soft_spots)
    stiffness = np.where(inside, pair_stiffness * np.maximum(1.0 + waves(state.stiffness), 0.05) / (1.0 + weak), 1e-3)
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
    impact_motion = sum((knock(turns, time, rng) for knock in state.impacts), np.zeros(len(turns))) / mean
    return {MESH: mesh, SHAFTS: shafts, FRICTION: rubbing, BEARINGS: impact_motion}


def _through_play(pressed: FloatArray, moving: FloatArray, state: QuasiStaticState, turns: FloatArray) -> FloatArray:
    """Return the motion that a bearing with play transmits about its static deflection: √(r² + c²) − c."""
    total = pressed + moving
    play = state.play * pressed * (1.0 + RIPPLE * np.cos(2 * np.pi * state.passing * turns))
    return np.asarray(np.sign(total) * (np.hypot(total, play) - play))


def _sensed_motion(structure: Structure, channel: int, motions: dict[int, FloatArray], rate: float) -> FloatArray:
    """Return a channel's acceleration at the recording's rate."""
    from scipy.fft import irfft, rfft, rfftfreq
    from scipy.signal.windows import tukey

    n = len(next(iter(motions.values())))
    frequency = rfftfreq(n, 1.0 / rate)
    kept = frequency < 0.48 * rate / FINER
    lines = np.zeros(len(frequency), dtype=np.complex128)
    # A step from the last sample to the first would be the strongest impact of the whole recording.
    window = tukey(n, 2.0 * SETTLING_S * rate / n)
    for way, motion in motions.items():
        settled = window * (motion - motion.mean())
        lines[kept] += rfft(settled)[kept] * structure.accelerations(channel, frequency[kept], way)
    m = n // FINER
    return np.asarray(irfft(lines[: m // 2 + 1], m) * (m / n))


def _noise(n: int, machine: StaticMachine, channel: int, rng: np.random.Generator) -> FloatArray:
    """Return a sensor's noise relative to its level, falling with frequency as determined by the machine's seed."""
    from scipy.fft import irfft, rfft, rfftfreq

    slope = np.random.default_rng([machine.seed, 3, channel]).uniform(0.0, 1.0)
    frequency = np.maximum(rfftfreq(n, 1.0 / machine.rate_hz), MIN_NOISE_HZ)
    noise = irfft(rfft(rng.standard_normal(n)) * frequency ** (-slope / 2.0), n)
    return np.asarray(noise * (machine.noise_share[channel] / noise.std()))


def tachometer(turns: FloatArray, time: FloatArray, at: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the voltage of a tachometer with one pulse per revolution."""
    tacho = Tachometer(jitter_s=2e-6, noise_v=0.01)
    whole = np.arange(np.ceil(turns[0]), np.floor(turns[-1]) + 1.0)
    rising = np.interp(whole, turns, time) + tacho.jitter_s * rng.standard_normal(len(whole))
    falling = np.interp(whole + tacho.duty, turns, time)
    volts = pulse_voltage(tacho, rising, falling, at) + tacho.noise_v * rng.standard_normal(len(at))
    return np.asarray(volts)


# --------------------
# Rows of the population from random machines of the quasi-static simulator.
# --------------------


QUASI_STATIC = "quasi-static"
FIRST_RIG = 200_000
N_HEALTHY, N_FOREIGN, N_BY_HAND, N_PATHS = 2, 2, 3, 2


def static_samples(index: int) -> list[PopulationSample]:
    """Return the samples of one random machine."""
    rig = FIRST_RIG + index

    def made() -> Made:
        rng = np.random.default_rng([SEED, 3, index])
        machine = StaticMachine.of(rng)
        levels = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), None).samples[:-1].std(axis=1)
        reference = record(machine, machine.healthy(), QuasiStaticDay.drawn(rng), levels)
        run = CrackedTwin(machine.rig, machine.nominal).run(
            OperatingCondition(machine.drawn.speed_rpm, machine.drawn.torque_nm),
            seed=rig,
            duration_s=machine.drawn.duration_s,
            sampling_rate_hz=machine.rate_hz,
            noise=1,
        )
        return reference, reduced(run, rig), _recordings(machine, levels, rng)

    return samples_of(QUASI_STATIC, rig, made)


def _recordings(machine: StaticMachine, levels: FloatArray, rng: np.random.Generator) -> Iterator[Recorded]:
    """Yield all recordings of one machine."""
    torque_nm = machine.drawn.torque_nm

    def recorded(state: QuasiStaticState, rng: np.random.Generator) -> Recording:
        return record(machine, state, QuasiStaticDay.drawn(rng), levels)

    healthy = [recorded(machine.healthy(), rng) for _ in range(N_HEALTHY)]
    for recording in healthy:
        yield NONE, "", 0.0, recording, torque_nm
    for name, effect in EFFECTS.items():
        state = machine.healthy()
        effect(machine, state, rng)
        yield name, "", 0.0, recorded(state, rng), torque_nm
    yield from put_in_by_hand(healthy, N_FOREIGN, N_BY_HAND, torque_nm, rng)
    path_rng = np.random.default_rng([machine.seed, 5])
    for _ in range(N_PATHS):
        state = machine.healthy()
        size = textbook.path_size(path_rng.uniform())
        state.paths = textbook.draw_path_changes(N_CHANNELS, size, machine.rate_hz, path_rng)
        yield "transfer_path", "", 0.0, recorded(state, path_rng), torque_nm
