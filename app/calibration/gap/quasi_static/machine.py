"""A drawn machine of the quasi-static simulator, and what may be wrong with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import cos, radians

import numpy as np

from app.calibration.gap.machines import draw_machine
from app.calibration.gap.paths import PathChange
from app.calibration.gap.quasi_static.contact import N_PATH, Path
from app.calibration.gap.quasi_static.structure import Structure
from app.calibration.rigs import DrawnRig, log_uniform
from gearsig.checks import FloatArray
from gearsig.rig.types import Rig
from sims.cracked.simulator import CrackedPair
from sims.gear_pair.build import build_rig
from sims.gear_pair.usual import Nominal, nominal_of
from sims.machine.operation import Operation

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
class State:
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
    knocks : list of function
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
    knocks: list[Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]]
    play: float
    passing: float
    wander: list[tuple[float, float, float]]
    structure: Structure
    paths: Sequence[PathChange] = ()


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
        ready = CrackedPair().prepare(drawn.parameters, [], operation, rng, sampling_rate_hz=max(RATES_HZ))
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

    def sound(self) -> State:
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
        return State(
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
            knocks=[],
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
    shape: FloatArray = 1.0 - fall * np.abs(off) ** rng.uniform(1.5, 3.0) + lean * off
    return shape


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
    profile: FloatArray = beyond**2 / (2.0 * machine.end_radius_m) + relieved + bent
    return profile


def textures(teeth: int, size_m: float, rng: np.random.Generator) -> FloatArray:
    """Return rough flanks, (teeth, N_PATH): waves from a third of the path down to its points, each as large."""
    lines = rng.standard_normal((teeth, N_PATH // 2 + 1)) + 1j * rng.standard_normal((teeth, N_PATH // 2 + 1))
    lines[:, :3] = 0.0
    lines[:, int(rng.integers(8, N_PATH // 2)) :] = 0.0
    rough: FloatArray = np.fft.irfft(lines, N_PATH, axis=1)
    return rough * (size_m / max(float(rough.std()), 1e-300))
