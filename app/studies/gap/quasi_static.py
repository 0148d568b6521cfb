"""A gear pair without equations of motion: static contact of all pairs of teeth, heard through a linear structure.

The transmission error under load is solved at each instant from the tooth pairs' stiffness and separations, then drives
drawn modes, as do forces of shafts, friction and bearings beside it. It has its own shapes of stiffness, deviations and
effects, many of them drawn anew for each machine, so that whoever learns from it learns what they have in common.

Not represented: what a dynamic mesh force does back to the contact – parametric resonance, teeth that part (backlash).

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
# What lies between forces and sensors: modes of the machine, shared by all channels, and each channel's own part.
# --------------------


MESH, SHAFTS, BEARINGS, FRICTION, INSIDE = range(5)
"""Where a force or motion begins; the last is the machine's own noise."""
N_WAYS = 5

MODES = (4, 11)
MODE_HZ, MODE_DAMPING = (120.0, 9000.0), (0.008, 0.1)
BY_BODY = 0.3
"""Part of the machine that follows without a mode of its own, beside modes whose parts are of the size of 1."""
MOVED, LOUDER = 0.02, 0.15
"""By how much a changed mounting moves and changes a mode: standard deviations of logarithms."""
MOUNTING_FROM_HZ = 1200.0
"""Lower modes are the machine's own and do not depend on the mounting of a sensor."""


@dataclass(frozen=True)
class Structure:
    """Modes, with each way's part in what each channel sees.

    Parameters
    ----------
    frequency_hz, damping_ratio : arrays, (n_modes,)
    parts : array, (n_channels, N_WAYS, n_modes + 1)
        The last: what follows without a mode.
    """

    frequency_hz: FloatArray
    damping_ratio: FloatArray
    parts: FloatArray

    @classmethod
    def drawn(cls, n_channels: int, rng: np.random.Generator) -> Structure:
        """Draw one."""
        n = int(rng.integers(*MODES))
        frequency = np.sort([log_uniform(rng, *MODE_HZ) for _ in range(n)])
        damping = np.array([log_uniform(rng, *MODE_DAMPING) for _ in range(n)])
        parts = rng.standard_normal((n_channels, N_WAYS, n + 1))
        parts[..., -1] *= BY_BODY
        return cls(frequency, damping, parts)

    def mounted_anew(self, rng: np.random.Generator) -> Structure:
        """Return it as sensors see it that were taken off and put on again."""
        touched = self.frequency_hz > MOUNTING_FROM_HZ
        moved = np.exp(MOVED * rng.standard_normal(len(touched)) * touched)
        louder = np.exp(LOUDER * rng.standard_normal((len(self.parts), 1, len(touched))) * touched)
        parts = self.parts.copy()
        parts[..., :-1] *= louder
        return replace(self, frequency_hz=self.frequency_hz * moved, parts=parts)

    def softer(self, share: float, below_hz: float) -> Structure:
        """Return it with modes below a frequency at lower ones, by `share` at most."""
        lower = self.frequency_hz < below_hz
        return replace(self, frequency_hz=self.frequency_hz * np.where(lower, 1.0 - share, 1.0))

    def accelerations(self, channel: int, frequency_hz: FloatArray, way: int) -> np.ndarray:
        """Return what a unit motion becomes, Σ aᵣ ω²/(1 − (f/fᵣ)² + 2iζ f/fᵣ), for each frequency."""
        total = np.full(len(frequency_hz), self.parts[channel, way, -1], dtype=np.complex128)
        for f, zeta, part in zip(self.frequency_hz, self.damping_ratio, self.parts[channel, way], strict=False):
            ratio = frequency_hz / f
            total += part / (1.0 - ratio**2 + 2j * zeta * ratio)
        return np.asarray(total * -((2.0 * np.pi * frequency_hz) ** 2))


# --------------------
# Static contact of all tooth pairs at once: transmission error under load, and what each pair carries.
# --------------------


REACH = 0.35
"""Base pitches off either end of the path of contact at which a loaded pair may still touch."""
N_PATH = 96
"""Points of a table over the path."""
N_PAIRS = 4
"""Of teeth that may touch at an instant: contact ratios reach 2."""


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
        """Return that of standard teeth, whose addendum is one module."""
        alpha, module = radians(pressure_angle_deg), 1e-3 * module_mm
        pitch_m = pi * module * cos(alpha)
        base = [0.5 * z * module * cos(alpha) for z in teeth]
        beyond = [
            sqrt((0.5 * z * module + module) ** 2 - b**2) - b * tan(alpha) for z, b in zip(teeth, base, strict=True)
        ]
        # An undercut mate ends the path where its involute begins.
        beyond = [
            min(reach, base_length * tan(alpha)) for reach, base_length in zip(beyond, reversed(base), strict=True)
        ]
        return cls(sum(beyond) / pitch_m, beyond[1] / pitch_m, pitch_m)

    @property
    def places(self) -> FloatArray:
        """Of a table's points."""
        return np.linspace(-REACH, self.ratio + REACH, N_PATH)


def meeting(cycle: FloatArray, path: Path, tables: tuple[FloatArray, FloatArray], first: tuple[int, int]) -> FloatArray:
    """Return the sum of both gears' tables where each pair meets, (N_PAIRS, n).

    Parameters
    ----------
    cycle : array, (n,)
        Mesh cycles since the teeth `first` began to meet.
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
    """Return a table over the path where each pair is, (N_PAIRS, n)."""
    _, spot = _pairs(cycle, path)
    return np.asarray(np.interp(spot, np.arange(N_PATH), table))


def _pairs(cycle: FloatArray, path: Path) -> tuple[np.ndarray, FloatArray]:
    """Return the numbers of the pairs that may touch and where they are, in points of a table."""
    newest = np.floor(cycle + REACH).astype(np.intp)
    number = newest[None] - np.arange(N_PAIRS)[:, None]
    spot = (cycle[None] - number + REACH) * ((N_PATH - 1) / (path.ratio + 2.0 * REACH))
    return number, spot


def is_in_reach(cycle: FloatArray, path: Path) -> np.ndarray:
    """Return which pairs are between the table's ends."""
    _, spot = _pairs(cycle, path)
    return np.asarray((spot >= 0.0) & (spot <= N_PATH - 1))


def static_contact(stiffness: FloatArray, gaps: FloatArray, load: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the transmission error x with Σ kᵢ max(x − gᵢ, 0) = F, and what each pair carries.

    Of the pairs with the m smallest gaps alone, x_m = (F + Σ kᵢ gᵢ)/Σ kᵢ; the left side is convex, so x is the
    smallest of them.

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
"""Of a mesh of steel gears, per width."""
N_CHANNELS = 2
DIRECTNESS = (1.0, 10.0)
"""Of friction: (resonance of the mesh over its frequency)² where the mesh is slower, 1 where it is not."""
END_RADII_M = (4e-3, 40e-3)
"""Of the flank that a corner meets off the path's ends: a gap of d²/2R."""

Wave = tuple[int, float, float, float]
"""Side of the shaft, order, size, phase in radians."""


@dataclass
class QuasiStaticState:
    """What a recording is made from; effects change it.

    Parameters
    ----------
    gaps_m, weak : [array, array]
        (teeth, N_PATH) of either gear: separation; compliance that a pair has beside its own, over its own.
    runout_m, load, stiffness : list of Wave
        Sums of cosines: separation of all teeth; torque, over the mean; mesh stiffness, over the mean.
    force_n : list of Wave
        On a shaft, from outside or by a mass that turns with it.
    soft_spots : float
        Share of the mesh stiffness that is lost all round.
    friction, reversal : float
        Coefficient; width over which it turns round at the pitch point, in base pitches.
    restless_m : float
        Standard deviation of a separation that never repeats.
    impacts : list of function
        Of the driver's angle (revolutions), time (s), and generator: forces (n,) on a bearing.
    play : float
        Of the bearings, over what their static load presses out.
    passing : float
        Order at which the play opens and shuts, of the driver.
    wander : list of (float, float, float)
        Of the speed: share, Hz, phase.
    structure : Structure
    paths : sequence of PathChange
        Of each channel, behind all that the machine does; none: they are as ever.
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
    """A machine as it was made.

    Parameters
    ----------
    drawn : DrawnRig
        Teeth, speed, torque and length.
    rig : Rig
        What its maker knows.
    nominal : Nominal
        Of its pair.
    path : Path
    stiffness_n_per_m : array, (N_PATH,)
        Of one pair over the path.
    rate_hz : float
    noise_share, inside_share : (float, float)
        Of the vibration: noise of either sensor, noise of the machine itself.
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
        """Draw one."""
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
        """Mesh force."""
        pitch_radius_m = 0.5e-3 * self.nominal.module_mm * self.drawn.teeth[0]
        return self.drawn.torque_nm / (pitch_radius_m * cos(radians(self.nominal.pressure_angle_deg)))

    @property
    def rated_m(self) -> float:
        """Deflection under a usual load: what errors are measured by, whatever the load is now."""
        return 50e6 * 1e-3 * self.nominal.module_mm / STIFFNESS_N_PER_M2

    @property
    def directness(self) -> float:
        """By how much more a force across the teeth is heard than the same deflection along them.

        Below the resonance of the mesh gears turn out of the way of a transmission error; friction they cannot avoid.
        """
        return log_uniform(np.random.default_rng([self.seed, 4]), *DIRECTNESS)

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of either shaft per revolution of the driver."""
        return 1.0, self.drawn.teeth[0] / self.drawn.teeth[1]

    def healthy(self) -> QuasiStaticState:
        """Return it with what manufacture left."""
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
        """What a force on a shaft is measured by: that of a usual load."""
        return 50.0 * self.nominal.module_mm * self.nominal.face_width_mm


def _shape(path: Path, rng: np.random.Generator) -> FloatArray:
    """Return the stiffness of a pair over the path, about 1: least at the ends, not quite alike on both."""
    off = 2.0 * np.clip(path.places / path.ratio, 0.0, 1.0) - 1.0
    fall, lean = rng.uniform(0.15, 0.5), rng.uniform(-0.1, 0.1)
    return np.asarray(1.0 - fall * np.abs(off) ** rng.uniform(1.5, 3.0) + lean * off)


def _profile(machine: StaticMachine, rng: np.random.Generator) -> FloatArray:
    """Return the separation that all pairs have: corners beyond the ends, relief, a shape of the profile."""
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
    """Return rough flanks, (teeth, N_PATH): waves from a third of the path down to its points, each as large."""
    lines = rng.standard_normal((teeth, N_PATH // 2 + 1)) + 1j * rng.standard_normal((teeth, N_PATH // 2 + 1))
    lines[:, :3] = 0.0
    lines[:, int(rng.integers(8, N_PATH // 2)) :] = 0.0
    rough: FloatArray = np.fft.irfft(lines, N_PATH, axis=1)
    return rough * (size_m / max(float(rough.std()), 1e-300))


# --------------------
# The catalogue's effects on the quasi-static machine, in shapes that are drawn anew for each.
# --------------------


def _tooth(machine: StaticMachine, rng: np.random.Generator) -> tuple[int, int]:
    side = textbook.draw_side(rng)
    return side, int(rng.integers(machine.drawn.teeth[side]))


def _bearing(machine: StaticMachine, rng: np.random.Generator) -> tuple[Bearing, float]:
    """Draw a bearing; return it with the revolutions of its shaft per revolution of the driver."""
    bearing = machine.rig.bearings[int(rng.integers(len(machine.rig.bearings)))]
    return bearing, machine.shaft_orders[0 if bearing.shaft == machine.rig.pairs[0].driver else 1]


def _towards_tip(machine: StaticMachine, side: int) -> FloatArray:
    """Return 0 where the path begins or ends at a gear's root, 1 at its tip: the driver's path ends there."""
    at: FloatArray = np.clip(machine.path.places / machine.path.ratio, 0.0, 1.0)
    return at if side == 0 else 1.0 - at


def _curvature_m(machine: StaticMachine) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the radii of curvature of both flanks over the path, and both base radii.

    Of standard teeth; held at the path's ends.
    """
    nominal, path = machine.nominal, machine.path
    alpha = radians(nominal.pressure_angle_deg)
    base = np.array([0.5e-3 * z * nominal.module_mm * cos(alpha) for z in machine.drawn.teeth])
    off = (np.clip(path.places, 0.0, path.ratio) - path.pitch_point) * path.base_pitch_m
    return base[0] * tan(alpha) + off, base[1] * tan(alpha) - off, base


def crack_lever(machine: StaticMachine, side: int, hinge_modules: float) -> FloatArray:
    """Return how far along the tooth the force is from a hinge below the pitch circle, over the path, 1 at the tip."""
    *radii, base = _curvature_m(machine)
    hinge = 1e-3 * machine.nominal.module_mm * (0.5 * machine.drawn.teeth[side] - hinge_modules)
    lever = np.maximum(np.hypot(base[side], radii[side]) - hinge, 0.0)
    return np.asarray(lever / lever.max())


def sinking_m(machine: StaticMachine, side: int, inside: FloatArray) -> FloatArray:
    """Return how far a mate sinks past an edge on a flank over the path, s²/(2R), base pitches beyond it given.

    s = ρ/r_b times the way along the path: a contact moves slower over the flank.
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
    """A tooth that gives way at a hinge in its root, as the square of the lever; a deep one stays bent, away from load.

    A force that bends with a lever turns the hinge in proportion to it, and is moved by the turn in proportion, too.
    """
    side, tooth = _tooth(machine, rng)
    lever, softer = crack_lever(machine, side, rng.uniform(0.9, 1.5)), log_uniform(rng, 0.05, 5.0)
    state.weak[side][tooth] += softer * lever**2
    if rng.uniform() < 0.3:
        state.gaps_m[side][tooth] += log_uniform(rng, 0.02, 0.5) * machine.rated_m


PIT_M = (30e-6, 500e-6)
"""Depths of pits."""
ROUNDED = (0.5, 1.5)
"""Of a chip's edge: what the mate sinks past it, over what it would past a sharp one."""


def _tooth_spall(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A pit near the pitch line: over part of the width less contact, over all of it the mate sinks in, or bridges it.

    The contact holds up to some third of a pair's compliance, and grows as the width that is left shrinks.
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
    """A tip that is gone, over all of the width or part of it: its pair loses hold early, or takes it late.

    Over all of the width, its mate sinks past the edge that is left as past the corner of a whole tooth.
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
    state.restless_m *= 1.0 + textbook.partly(rng)


def _pitch_error(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """Teeth off their places: one alone, or each by itself, adding up, or in a wave."""
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
    """Rough flanks, that the gears repeat, and what they never do."""
    size = log_uniform(rng, 0.02, 1.5) * machine.rated_m
    for side in (0, 1):
        state.gaps_m[side] = state.gaps_m[side] + textures(machine.drawn.teeth[side], size * rng.uniform(0.3, 1.0), rng)
    state.restless_m += 0.3 * size * textbook.partly(rng)
    state.friction *= rng.uniform(1.0, 1.8)


def _sliding_friction(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:  # noqa: ARG001 - form
    """Flanks that rub: a force that turns round at the pitch point."""
    state.friction = log_uniform(rng, 0.1, 0.6)
    state.reversal = rng.uniform(0.005, 0.3)


def _eccentricity(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A gear off its axis: separation and depth of the teeth once per turn, and its mass off the axis."""
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
    """Contact on part of the width, some of it turning with a shaft; a coupling that is forced twice a turn."""
    side, size = textbook.draw_side(rng), log_uniform(rng, 0.1, 0.8)
    state.soft_spots = size * rng.uniform(0.3, 0.8)
    for order, share in ((1.0, rng.uniform(0.0, 0.6)), (2.0, rng.uniform(0.0, 0.4))):
        state.stiffness.append((side, order, size * share, rng.uniform(0, 2 * np.pi)))
    force = size * log_uniform(rng, 0.02, 2.0) * machine.force_unit_n
    for order, share in ((1.0, rng.uniform(0.0, 0.6)), (2.0, 1.0), (3.0, rng.uniform(0.0, 0.4))):
        state.force_n.append((side, order, force * share, rng.uniform(0, 2 * np.pi)))
    state.load.append((side, 2.0, size * log_uniform(rng, 1e-3, 0.1), rng.uniform(0, 2 * np.pi)))


def _torque_ripple(machine: StaticMachine, state: QuasiStaticState, rng: np.random.Generator) -> None:
    """A torque that pulls n times per turn, and a little 2n times; the shaft twists, the frame takes it up."""
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
    """Elements that drop into a defect and leave it with a blow; on the inner race the load zone passes it."""
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
    """A bearing that is loose: forces reach the housing bent, its support is softer."""
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
# From a machine's state on a day to a recording.
# --------------------


FINER = 2
"""Times the recording's rate at which the contact is solved: its corners reach beyond half of that."""
LEAD_S = 0.3
"""Before and after the recording, in which modes settle."""
SETTLING_S = 0.15
"""At either end of that, in which motions begin and end."""
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
    state : QuasiStaticState
    day : QuasiStaticDay
    levels : array, (n_channels,), or None
        Standard deviation of each channel by which noise is measured; None: no noise.
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
    tacho = _tachometer(turns, time, later, rng)
    samples = np.stack([*rows, tacho])
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
    return np.asarray(day.turns_before + rng.uniform() + speed_hz * (time + wander))


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
    """Return what a bearing with play hands on of a motion about what its load presses out: √(r² + c²) − c."""
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
    # A step from the last sample to the first would be the loudest blow of the whole recording.
    window = tukey(n, 2.0 * SETTLING_S * rate / n)
    for way, motion in motions.items():
        settled = window * (motion - motion.mean())
        lines[kept] += rfft(settled)[kept] * structure.accelerations(channel, frequency[kept], way)
    m = n // FINER
    return np.asarray(irfft(lines[: m // 2 + 1], m) * (m / n))


def _noise(n: int, machine: StaticMachine, channel: int, rng: np.random.Generator) -> FloatArray:
    """Return a sensor's noise over its level, falling with frequency as the machine's seed has it."""
    from scipy.fft import irfft, rfft, rfftfreq

    slope = np.random.default_rng([machine.seed, 3, channel]).uniform(0.0, 1.0)
    frequency = np.maximum(rfftfreq(n, 1.0 / machine.rate_hz), MIN_NOISE_HZ)
    noise = irfft(rfft(rng.standard_normal(n)) * frequency ** (-slope / 2.0), n)
    return np.asarray(noise * (machine.noise_share[channel] / noise.std()))


def _tachometer(turns: FloatArray, time: FloatArray, at: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the voltage of a pulse per turn."""
    tacho = Tachometer(jitter_s=2e-6, noise_v=0.01)
    whole = np.arange(np.ceil(turns[0]), np.floor(turns[-1]) + 1.0)
    rising = np.interp(whole, turns, time) + tacho.jitter_s * rng.standard_normal(len(whole))
    falling = np.interp(whole + tacho.duty, turns, time)
    volts = pulse_voltage(tacho, rising, falling, at) + tacho.noise_v * rng.standard_normal(len(at))
    return np.asarray(volts)


# --------------------
# Rows of the population from drawn machines of the quasi-static simulator.
# --------------------


QUASI_STATIC = "quasi-static"
FIRST_RIG = 200_000
N_HEALTHY, N_FOREIGN, N_BY_HAND, N_PATHS = 2, 2, 3, 2


def static_samples(index: int) -> list[PopulationSample]:
    """Return the samples of one drawn machine."""
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
    """Yield everything that is recorded of one machine."""
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
