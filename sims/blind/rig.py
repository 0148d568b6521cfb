"""A drawn test rig: what its maker knows, and what nobody states."""

from __future__ import annotations

from dataclasses import dataclass
from math import log10, pi
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.rig.speed import TachometerChannel
from gearsig.rig.types import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft
from sims.blind.geometry import N_PATH, SpurPair
from sims.blind.structure import N_DOF, Parts

Role = Literal["development", "calibration", "evaluation"]
ROLES: tuple[Role, ...] = ("development", "calibration", "evaluation")
MODULES_MM: dict[str, tuple[float, ...]] = {
    "development": (1.5, 2.5, 4.0, 5.0),
    "calibration": (2.0, 3.5, 5.5),
    "evaluation": (1.75, 3.0, 4.5, 6.0),
}
LARGEST_CENTRE_M = 0.25
SHEAR_LIMIT_PA = 30e6
BEARING_SERIES = (
    (8, 7.938, 33.5),
    (9, 7.94, 39.04),
    (8, 9.525, 39.5),
    (9, 12.7, 52.0),
    (11, 10.3, 58.6),
    (10, 15.08, 70.1),
)
"""Elements, their diameter and the pitch diameter in mm, of usual deep-groove sizes."""


def teeth_of(role: str) -> tuple[int, ...]:
    """Tooth numbers of a role: no number from 17 to 70 serves two roles."""
    place = ROLES.index(one_of(role, "role", ROLES))
    return tuple(z for z in range(17, 71) if (z // 2) % 3 == place)


@dataclass(frozen=True)
class Resonance:
    """One mode of the way from a bearing to a sensor."""

    frequency_hz: float
    damping_ratio: float
    mass_kg: float


@dataclass(frozen=True)
class SensorChain:
    """One accelerometer: where it points, its path and its gain."""

    angle: float
    crosstalk: float
    path: tuple[Resonance, ...]
    gain: float
    noise_share: float
    noise_colour: float


@dataclass(frozen=True)
class Tolerances:
    """What manufacture left: metres on the line of action, tables (teeth, N_PATH), rows as the kernel takes them."""

    gap_m: tuple[FloatArray, FloatArray]
    runout: tuple[tuple[float, ...], ...]
    unbalance: tuple[tuple[float, float], tuple[float, float]]
    wedge_m: float
    wobble: tuple[tuple[float, ...], ...]
    torque_share: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class BlindRig:
    """A gear pair on a bed with motor, load, four bearings and one or two accelerometers."""

    role: str
    pair: SpurPair
    rated_nm: float
    parts: Parts
    stiffness_factor: float
    mesh_damping_ratio: float
    soft_m: float
    backlash_m: float
    clearance_m: tuple[float, float]
    bearings: tuple[tuple[int, float, float], tuple[int, float, float]]
    tolerances: Tolerances
    relief_m: tuple[float, float]
    relief_start: float
    viscosity_cp: float
    finish_um: float
    load_slope: float
    motor_time_s: float
    wander: tuple[tuple[float, float, float], ...]
    chains: tuple[SensorChain, ...]
    hum_share: float
    tach_jitter_s: float
    sampling_rate_hz: float

    def mesh_stiffness_n_per_m(self) -> float:
        """Mean mesh stiffness as this pair really has it."""
        return self.pair.mean_stiffness_n_per_m() * self.stiffness_factor

    def bearing(self, place: int) -> Bearing:
        """Bearing on shaft 0 or 1, as the catalogue has it."""
        n, ball, pitch = self.bearings[place]
        return Bearing(f"bearing {2 * place + 1}", SHAFTS[place], n, ball, pitch)

    def description(self, speed_rpm: float, torque_nm: float) -> Rig:
        """The rig file's content: what an engineer at the rig would write down."""
        pair = self.pair
        places = ("bearing 1, input shaft, radial", "bearing 3, output shaft, radial")
        sensors = [Sensor(f"a{i + 1}", "acceleration", "m/s^2", places[i]) for i in range(len(self.chains))]
        same = [(i, Bearing(f"bearing {2 * i + 2}", SHAFTS[i], *self.bearings[i])) for i in range(2)]
        return Rig(
            name="gear pair on a test bed",
            shafts=(Shaft("input", "ccw"), Shaft("output", "cw")),
            pairs=(
                GearPair(
                    "stage 1",
                    *SHAFTS,
                    pair.z1,
                    pair.z2,
                    pair.module_mm,
                    pair.pressure_angle_deg,
                    round(pair.face_mm, 1),
                ),
            ),
            bearings=tuple(b for i, second in same for b in (self.bearing(i), second)),
            sensors=(*sensors, Sensor("tacho", "tachometer", "V", "input shaft")),
            operating_point=OperatingPoint("input", round(speed_rpm, 1), torque_nm=round(torque_nm, 2)),
            speed=TachometerChannel("tacho", shaft="input"),
        )


SHAFTS = ("input", "output")


def draw_rig(rng: np.random.Generator, role: str) -> BlindRig:
    """Draw a rig whose tooth numbers and module belong to `role` alone."""
    pair = _draw_pair(rng, role)
    rated_nm = rng.uniform(40, 60) * pair.face_mm * pair.module_mm * pair.pitch_radii_m[0]
    force_n = rated_nm / pair.base_radii_m[0]
    deflection_m = force_n / pair.mean_stiffness_n_per_m()
    tolerances = _draw_tolerances(rng, pair, float(np.clip(deflection_m / 10e-6, 0.4, 1.2)))
    is_relieved = rng.random() < 0.6
    relief = rng.uniform(0.4, 1.2, 2) * deflection_m * is_relieved
    small = rng.integers(0, 3) if pair.module_mm < 3 else rng.integers(2, 5)
    parts = _draw_parts(rng, pair, rated_nm)
    n_chains = int(rng.integers(1, 3))
    chains = tuple(_draw_chain(rng, parts.casing_mass_kg) for _ in range(2))[:n_chains]
    return BlindRig(
        role=role,
        pair=pair,
        rated_nm=rated_nm,
        parts=parts,
        stiffness_factor=rng.uniform(0.85, 1.15),
        mesh_damping_ratio=rng.uniform(0.04, 0.1),
        soft_m=rng.uniform(0.03, 0.12) * deflection_m,
        backlash_m=rng.uniform(0.02, 0.05) * pair.module_mm / 1000,
        clearance_m=(rng.uniform(0.5e-6, 3e-6), rng.uniform(0.5e-6, 3e-6)),
        bearings=(BEARING_SERIES[small], BEARING_SERIES[small + 1]),
        tolerances=tolerances,
        relief_m=(float(relief[0]), float(relief[1])),
        relief_start=rng.uniform(0.15, 0.35),
        viscosity_cp=rng.uniform(8, 40),
        finish_um=rng.uniform(0.15, 0.4),
        load_slope=rng.uniform(0.3, 1.5),
        motor_time_s=rng.uniform(0.08, 0.2),
        wander=tuple((rng.uniform(0.03, 0.3), rng.uniform(2e-4, 1.5e-3), rng.uniform(0, 2 * pi)) for _ in range(3)),
        chains=chains,
        hum_share=10 ** rng.uniform(-3.5, -2.3),
        tach_jitter_s=rng.uniform(0.5e-6, 6e-6),
        sampling_rate_hz=float(rng.choice([20000.0, 20480.0, 25000.0, 25600.0])),
    )


def _draw_pair(rng: np.random.Generator, role: str) -> SpurPair:
    """Draw until the pair fits the bed and the ratio is between 1:2.5 up and 1:3 down."""
    teeth, modules = teeth_of(role), MODULES_MM[role]
    while True:
        z1, z2 = (int(z) for z in rng.choice(teeth, 2))
        module = float(rng.choice(modules))
        if (z1 + z2) * module / 2000 > LARGEST_CENTRE_M or not 0.4 < z2 / z1 < 3 or (z1 + z2) < 45:
            continue
        if (z1 + z2) * module / 2000 < 0.05:
            continue
        return SpurPair(z1, z2, module, module * rng.uniform(7, 12))


def _draw_parts(rng: np.random.Generator, pair: SpurPair, rated_nm: float) -> Parts:
    torques = rated_nm, rated_nm * pair.z2 / pair.z1
    shaft_d = [(16 * t / (pi * SHEAR_LIMIT_PA)) ** (1 / 3) for t in torques]
    length = [d * rng.uniform(8, 15) for d in shaft_d]
    mass = [pair.gear_mass_kg(i) * rng.uniform(0.7, 1) + 7850 * pi / 4 * shaft_d[i] ** 2 * length[i] for i in range(2)]
    inertia = [pair.gear_inertia_kgm2(i) * rng.uniform(0.7, 1) for i in range(2)]
    twist = [8e10 * pi * shaft_d[i] ** 4 / (32 * length[i]) for i in range(2)]
    force_n = rated_nm / pair.base_radii_m[0]
    support = [float(np.clip(force_n / rng.uniform(4e-6, 12e-6), 8e7, 8e8)) for _ in range(2)]
    bearing = [(k * rng.uniform(0.75, 1.25), k * rng.uniform(0.75, 1.25)) for k in support]
    casing = max(sum(mass) * rng.uniform(5, 12), rng.uniform(20, 45))
    a = pair.centre_distance_m
    rocking = casing * a**2 * rng.uniform(0.3, 0.8)
    stand = [casing * (2 * pi * rng.uniform(18, 70)) ** 2 for _ in range(2)]
    return Parts(
        inertia_kgm2=(inertia[0] * rng.uniform(3, 9), inertia[0], inertia[1], inertia[1] * rng.uniform(1, 5)),
        rotor_mass_kg=(mass[0], mass[1]),
        casing_mass_kg=casing,
        casing_inertia_kgm2=rocking,
        shaft_nm_per_rad=(twist[0], twist[1]),
        bearing_n_per_m=(bearing[0], bearing[1]),
        foundation_n_per_m=(stand[0], stand[1]),
        rocking_nm_per_rad=rocking * (2 * pi * rng.uniform(25, 90)) ** 2,
        base_radii_m=pair.base_radii_m,
        line_angle=rng.uniform(-pi, pi),
        seat_x_m=(-a * rng.uniform(0.4, 0.6), a * rng.uniform(0.4, 0.6)),
        height_m=a * rng.uniform(0.2, 0.6),
        damping_ratios=(0.0, 0.0, *rng.uniform(0.01, 0.05, N_DOF - 2)),
    )


def texture(
    rng: np.random.Generator, pair: SpurPair, n_teeth: int, rms_m: float, shortest_mm: float = 0.2
) -> FloatArray:
    """Random flank heights along the path, (n_teeth, N_PATH), smoothed over the width of the Hertzian contact."""
    from scipy.ndimage import gaussian_filter1d

    spacing_mm = float(pair.path[1] - pair.path[0]) * pair.base_pitch_m * 1000
    rough = gaussian_filter1d(rng.standard_normal((n_teeth, N_PATH)), max(shortest_mm / spacing_mm / 2.5, 0.4), axis=1)
    return np.asarray(rough * rms_m / rough.std())


def _draw_tolerances(rng: np.random.Generator, pair: SpurPair, fineness: float) -> Tolerances:
    """Draw errors of a quality that suits the load: `fineness` scales what stands on the flanks."""
    gaps, runout, wobble = [], [], []
    s = np.clip(pair.path / pair.contact_ratio, 0, 1) - 0.5
    for shaft, z in enumerate((pair.z1, pair.z2)):
        pitch = rng.normal(0, rng.uniform(0.2e-6, 0.9e-6), (z, 1))
        form = rng.normal(0, 1.5e-6) * s + rng.uniform(0, 3e-6) * 4 * s**2
        gaps.append(fineness * (pitch + form + texture(rng, pair, z, rng.uniform(0.03e-6, 0.12e-6))))
        for order, largest in ((1.0, 5e-6), (2.0, 1e-6), (3.0, 0.5e-6)):
            runout.append((float(shaft), order, fineness * rng.uniform(0.2, 1) * largest, rng.uniform(0, 2 * pi)))
        wobble.append((float(shaft), 1.0, rng.uniform(0, 1.5e-6), rng.uniform(0, 2 * pi)))
    masses = [pair.gear_mass_kg(i) * 1.5 for i in range(2)]
    unbalance = [(m * 10 ** rng.uniform(-5.7, -5), rng.uniform(0, 2 * pi)) for m in masses]
    torque = [
        (float(rng.integers(0, 2)), float(order), 10 ** rng.uniform(-3.0, -2.3), rng.uniform(0, 2 * pi))
        for order in (1, 2, int(rng.choice([3, 4, 5, 6])))
    ]
    # The brake pulls unevenly: without load the teeth may be thrown from flank to flank.
    torque.append((1.0, float(rng.integers(1, 3)), 10 ** rng.uniform(-2.1, -1.6), rng.uniform(0, 2 * pi)))
    return Tolerances(
        gap_m=(gaps[0], gaps[1]),
        runout=tuple(runout),
        unbalance=(unbalance[0], unbalance[1]),
        wedge_m=rng.uniform(0, 5e-6),
        wobble=tuple(wobble),
        torque_share=tuple(torque),
    )


def _draw_chain(rng: np.random.Generator, casing_kg: float) -> SensorChain:
    n_modes = int(rng.integers(2, 7))
    path = tuple(
        Resonance(
            10 ** rng.uniform(log10(500), log10(9000)), rng.uniform(0.015, 0.07), casing_kg * rng.uniform(0.25, 1.5)
        )
        for _ in range(n_modes)
    )
    return SensorChain(
        angle=rng.uniform(0, pi),
        crosstalk=rng.uniform(0.1, 0.5),
        path=path,
        gain=rng.uniform(0.85, 1.15),
        noise_share=10 ** rng.uniform(-2.3, -1.2),
        noise_colour=rng.uniform(0, 1.0),
    )
