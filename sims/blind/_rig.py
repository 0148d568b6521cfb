"""A random test rig: the data that its maker knows, and those that nobody states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import cos, log10, pi, radians, sin, sqrt, tan
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, expm

from gearsig.checks import FloatArray, count, one_of, positive, within
from gearsig.errors import InputError
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft, TachometerChannel

# --------------------
# The structure without its mesh: drive line, two rotors on orthotropic bearings, a casing on its foundation.
# --------------------


Matrix = NDArray[np.float64]
MOTOR, GEAR_1, GEAR_2, LOAD, X1, Y1, X2, Y2, XC, YC, ROCK = range(11)
N_DOF = 11
N_OUTPUTS = 9
"""Rows of `ModalForm.outputs`: line-of-action compression, θ1, θ2, bearing 1 x y, bearing 2 x y, motor, load."""


@dataclass(frozen=True)
class Parts:
    """Masses, springs and positions of one rig, SI units.

    `seat_x_m` are the bearings' horizontal positions from the casing's centre, `height_m` their height above its
    rocking axis, and `line_angle` the angle of the line of action to the horizontal.
    """

    inertia_kgm2: tuple[float, float, float, float]
    rotor_mass_kg: tuple[float, float]
    casing_mass_kg: float
    casing_inertia_kgm2: float
    shaft_nm_per_rad: tuple[float, float]
    bearing_n_per_m: tuple[tuple[float, float], tuple[float, float]]
    foundation_n_per_m: tuple[float, float]
    rocking_nm_per_rad: float
    base_radii_m: tuple[float, float]
    line_angle: float
    seat_x_m: tuple[float, float]
    height_m: float
    damping_ratios: tuple[float, ...]


@dataclass(frozen=True)
class ModalForm:
    """Modal form: u = shapes @ q, q'' + 2 ζ ω q' + ω² q = shapesᵀ F."""

    omega: Matrix
    zeta: Matrix
    shapes: Matrix
    outputs: Matrix
    mass: Matrix
    stiffness: Matrix


def mass_matrix(parts: Parts) -> Matrix:
    """Diagonal mass matrix, (N_DOF, N_DOF)."""
    m1, m2 = parts.rotor_mass_kg
    casing = (parts.casing_mass_kg, parts.casing_mass_kg, parts.casing_inertia_kgm2)
    return np.diag([*parts.inertia_kgm2, m1, m1, m2, m2, *casing])


def output_rows(parts: Parts) -> Matrix:
    """Matrix from displacements to the quantities on which forces depend, (N_OUTPUTS, N_DOF)."""
    rows = np.zeros((N_OUTPUTS, N_DOF))
    n_x, n_y = np.cos(parts.line_angle), np.sin(parts.line_angle)
    rows[0, [GEAR_1, GEAR_2]] = parts.base_radii_m[0], -parts.base_radii_m[1]
    rows[0, [X1, Y1, X2, Y2]] = n_x, n_y, -n_x, -n_y
    rows[1, GEAR_1] = rows[2, GEAR_2] = rows[7, MOTOR] = rows[8, LOAD] = 1.0
    for i, (x, y) in enumerate(((X1, Y1), (X2, Y2))):
        rows[3 + 2 * i, [x, XC, ROCK]] = 1.0, -1.0, parts.height_m
        rows[4 + 2 * i, [y, YC, ROCK]] = 1.0, -1.0, -parts.seat_x_m[i]
    return rows


def stiffness_matrix(parts: Parts) -> Matrix:
    """Stiffness matrix of shafts, bearings and foundation, without the mesh, (N_DOF, N_DOF)."""
    outputs = output_rows(parts)
    k = np.zeros((N_DOF, N_DOF))
    for (a, b), value in zip(((MOTOR, GEAR_1), (GEAR_2, LOAD)), parts.shaft_nm_per_rad, strict=True):
        twist = np.zeros(N_DOF)
        twist[[a, b]] = 1.0, -1.0
        k += value * np.outer(twist, twist)
    for i in range(2):
        for j in range(2):
            row = outputs[3 + 2 * i + j]
            k += parts.bearing_n_per_m[i][j] * np.outer(row, row)
    k[XC, XC] += parts.foundation_n_per_m[0]
    k[YC, YC] += parts.foundation_n_per_m[1]
    k[ROCK, ROCK] += parts.rocking_nm_per_rad
    return k


def modes_of(parts: Parts) -> ModalForm:
    """Modes without the mesh; the two lowest are the undamped free rotations of the two drive lines."""
    m, k = mass_matrix(parts), stiffness_matrix(parts)
    squares, shapes = eigh(k, m)
    omega = np.sqrt(np.maximum(squares, 0.0))
    zeta = np.array(parts.damping_ratios, dtype=float)
    omega[:2] = zeta[:2] = 0.0
    return ModalForm(omega, zeta, np.ascontiguousarray(shapes), output_rows(parts) @ shapes, m, k)


def step_coefficients(modes: ModalForm, step_s: float) -> Matrix:
    """Exact step of each mode under a force that is linear in time, (8, N_DOF).

    q⁺ = c0 q + c1 p + c4 f + c5 f⁺ and p⁺ = c2 q + c3 p + c6 f + c7 f⁺, from the exponential of the mode's matrix
    with force and force rate as states.

    Source: M. Hochbruck and A. Ostermann, Exponential integrators, *Acta Numerica* 19 (2010).
    """
    coefficients = np.empty((8, N_DOF))
    for i, (w, z) in enumerate(zip(modes.omega, modes.zeta, strict=True)):
        a = np.zeros((4, 4))
        a[0, 1] = a[2, 3] = a[1, 2] = 1.0
        a[1, 0], a[1, 1] = -(w**2), -2 * z * w
        e: Any = expm(a * step_s)
        rate = e[:2, 3] / step_s
        coefficients[:, i] = *e[0, :2], *e[1, :2], e[0, 2] - rate[0], rate[0], e[1, 2] - rate[1], rate[1]
    return coefficients


def static_shape(modes: ModalForm, mesh_n_per_m: float, forces: Matrix) -> Matrix:
    """Displacements under constant forces in equilibrium through the mesh, (N_DOF,); gear 1 is kept from rotating."""
    mesh = np.linalg.lstsq(modes.shapes.T, modes.outputs[0], rcond=None)[0]
    k = modes.stiffness + mesh_n_per_m * np.outer(mesh, mesh)
    k[GEAR_1, GEAR_1] += 1e-3 * mesh_n_per_m * mesh[GEAR_1] ** 2
    return np.asarray(np.linalg.solve(k, forces))


# --------------------
# Exact involute kinematics of a standard spur pair, and its stiffness after ISO 6336 and Cai–Hayashi.
# --------------------


STEEL_DENSITY = 7850.0
REACH = 0.35
"""Base pitches beyond either end of the path of contact up to which a loaded pair may be in contact."""
N_PATH = 384
"""Points of the tables over the path of contact."""


@dataclass(frozen=True)
class SpurPair:
    """A standard spur pair (addendum one module, no profile shift); gear 1 drives.

    Positions on the path of contact are in base pitches from its start A (tip of the driven gear):
    0 at A, the contact ratio at E.
    """

    z1: int
    z2: int
    module_mm: float
    face_mm: float
    pressure_angle_deg: float = 20.0

    def __post_init__(self) -> None:
        for name, teeth in (("z1", self.z1), ("z2", self.z2)):
            count(teeth, name, minimum=17, remedy="fewer teeth are undercut")
        positive(self.module_mm, "module_mm", "mm")
        positive(self.face_mm, "face_mm", "mm")
        within(self.pressure_angle_deg, "pressure_angle_deg", 14.5, 30, "deg")
        if self.rho_start_m <= 0:
            raise InputError(f"{self.z1}/{self.z2} teeth interfere at the root of gear 1", remedy="take more teeth")

    @cached_property
    def alpha(self) -> float:
        """Pressure angle, rad."""
        return radians(self.pressure_angle_deg)

    @cached_property
    def pitch_radii_m(self) -> tuple[float, float]:
        """Pitch radii, half of module times teeth."""
        return self.module_mm * self.z1 / 2000, self.module_mm * self.z2 / 2000

    @cached_property
    def base_radii_m(self) -> tuple[float, float]:
        """Base radii, pitch radius times cos(pressure angle)."""
        r1, r2 = self.pitch_radii_m
        return r1 * cos(self.alpha), r2 * cos(self.alpha)

    @cached_property
    def tip_radii_m(self) -> tuple[float, float]:
        """Tip radii, pitch radius plus module."""
        r1, r2 = self.pitch_radii_m
        return r1 + self.module_mm / 1000, r2 + self.module_mm / 1000

    @property
    def base_pitch_m(self) -> float:
        """Base pitch, the distance of like flanks along the line of action."""
        return pi * self.module_mm / 1000 * cos(self.alpha)

    @property
    def centre_distance_m(self) -> float:
        """Centre distance, the sum of the pitch radii."""
        return sum(self.pitch_radii_m)

    @property
    def rho_start_m(self) -> float:
        """Radius of curvature of gear 1 at A."""
        rb2, ra2 = self.base_radii_m[1], self.tip_radii_m[1]
        return self.centre_distance_m * sin(self.alpha) - sqrt(ra2**2 - rb2**2)

    @cached_property
    def contact_ratio(self) -> float:
        """Contact ratio, the length of the path of contact over the base pitch."""
        rb1, ra1 = self.base_radii_m[0], self.tip_radii_m[0]
        return (sqrt(ra1**2 - rb1**2) - self.rho_start_m) / self.base_pitch_m

    @property
    def pitch_point(self) -> float:
        """Position of the pitch point on the path."""
        return (self.base_radii_m[0] * tan(self.alpha) - self.rho_start_m) / self.base_pitch_m

    @cached_property
    def path(self) -> FloatArray:
        """Positions of the table points, (N_PATH,)."""
        return np.linspace(-REACH, self.contact_ratio + REACH, N_PATH)

    def rho_m(self, place: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Radii of curvature of both flanks at positions on the path."""
        rho1 = self.rho_start_m + place * self.base_pitch_m
        return rho1, self.centre_distance_m * sin(self.alpha) - rho1

    def mean_stiffness_n_per_m(self) -> float:
        """Mean mesh stiffness of the whole face width, c_γ b.

        c' = 0.8 C_B / q', q' = 0.04723 + 0.15551/z1 + 0.25791/z2, c_γ = c'(0.75 ε + 0.25), per mm and µm.

        Source: ISO 6336-1, *Calculation of load capacity of spur and helical gears*, method B, no profile shift.
        """
        q = 0.04723 + 0.15551 / self.z1 + 0.25791 / self.z2
        c_pair = 0.8 * 0.975 / q
        return c_pair * (0.75 * self.contact_ratio + 0.25) * self.face_mm * 1e6

    def pair_stiffness_n_per_m(self) -> FloatArray:
        """Stiffness of one tooth pair over the path, (N_PATH,); its sum over pairs has the mean of ISO 6336.

        A parabola from 0.55 at the ends to 1 in the middle; constant at 0.55 beyond.

        Source: Y. Cai and T. Hayashi, The linear approximated equation of vibration of a pair of spur gears,
        *ASME J. Mech. Des.* 116 (1994).
        """
        s = np.clip(self.path / self.contact_ratio, 0.0, 1.0)
        shape = -1.8 * s**2 + 1.8 * s + 0.55
        return np.asarray(self.mean_stiffness_n_per_m() / (0.85 * self.contact_ratio) * shape)

    def end_gap_m(self) -> FloatArray:
        """Separation of an unloaded pair beyond the path's ends, (N_PATH,): tip corner against flank."""
        pb, place = self.base_pitch_m, self.path
        gap = np.zeros(N_PATH)
        early, late = place < 0, place > self.contact_ratio
        gap[early] = self.corner_gap_m(0, -place[early] * pb)
        gap[late] = self.corner_gap_m(1, (place[late] - self.contact_ratio) * pb)
        return gap

    def end_shift_per_m(self) -> tuple[float, float]:
        """Base pitches by which the path's ends A and E move per metre of increase in centre distance.

        ρ1 grows by 1/sin α at A and not at E; the line of action rotates by cot α / a, which gear 1 follows.
        """
        turn = self.base_radii_m[0] / tan(self.alpha) / self.centre_distance_m
        return (1 / sin(self.alpha) - turn) / self.base_pitch_m, -turn / self.base_pitch_m

    def corner_gap_m(self, flank: int, distance_m: FloatArray, tip_loss_m: float = 0.0) -> FloatArray:
        """Gap along the base circle of gear `flank` to the mate's tip corner, at a distance from the path's end.

        A tip that has lost `tip_loss_m` of its height ends the path earlier.

        The flank's gear centre is at 0, the mate's at (a, 0). The flank's involute starts at the polar angle
        β = α − ρ/r_b; the corner at polar angle ψ and radius r touches an involute with β = ψ − inv(r). The gap is r_b
        times the difference from the flank's position in conjugate motion.
        """
        mate = 1 - flank
        rb, rb_mate, ra_mate = self.base_radii_m[flank], self.base_radii_m[mate], self.tip_radii_m[mate]
        ra_mate -= tip_loss_m
        a, alpha = self.centre_distance_m, self.alpha
        rho_mate = sqrt(ra_mate**2 - rb_mate**2)
        rho = a * sin(alpha) - rho_mate
        contact = np.array([rb * cos(alpha) + rho * sin(alpha), rb * sin(alpha) - rho * cos(alpha)])
        chi = np.arctan2(contact[1], contact[0] - a) - distance_m / rb_mate
        x, y = a + ra_mate * np.cos(chi), ra_mate * np.sin(chi)
        roll = np.sqrt(np.maximum((x**2 + y**2) / rb**2 - 1, 0.0))
        needed = np.arctan2(y, x) - (roll - np.arctan(roll))
        return np.asarray(np.maximum(rb * (alpha - (rho - distance_m) / rb - needed), 0.0))

    def gear_mass_kg(self, gear: int) -> float:
        """Mass of a solid disc of pitch radius."""
        return STEEL_DENSITY * pi * self.pitch_radii_m[gear] ** 2 * self.face_mm / 1000

    def gear_inertia_kgm2(self, gear: int) -> float:
        """Polar inertia of the same disc."""
        return 0.5 * self.gear_mass_kg(gear) * self.pitch_radii_m[gear] ** 2


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
"""Number of elements, their diameter and the pitch diameter in mm, of usual deep-groove bearings."""


def teeth_of(role: str) -> tuple[int, ...]:
    """Tooth numbers of a role, from 17 to 70; no number is used in two roles."""
    place = ROLES.index(one_of(role, "role", ROLES))
    return tuple(z for z in range(17, 71) if (z // 2) % 3 == place)


@dataclass(frozen=True)
class SensorResonance:
    """One mode of the path from a bearing to a sensor."""

    frequency_hz: float
    damping_ratio: float
    mass_kg: float


@dataclass(frozen=True)
class SensorChain:
    """One accelerometer: its direction, path and gain."""

    angle: float
    crosstalk: float
    path: tuple[SensorResonance, ...]
    gain: float
    noise_share: float
    noise_colour: float


@dataclass(frozen=True)
class Tolerances:
    """Manufacturing errors: in m on the line of action, tables (teeth, N_PATH), rows as in the kernel."""

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
        """Actual mean mesh stiffness of this pair."""
        return self.pair.mean_stiffness_n_per_m() * self.stiffness_factor

    def bearing(self, place: int) -> Bearing:
        """Bearing on shaft 0 or 1, with catalogue geometry."""
        n, ball, pitch = self.bearings[place]
        return Bearing(f"bearing {2 * place + 1}", SHAFTS[place], n, ball, pitch)

    def description(self, speed_rpm: float, torque_nm: float) -> Rig:
        """Content of the rig file: what an engineer at the rig would state."""
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
    """Draw a rig whose tooth numbers and module belong to `role` only."""
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
    """Draw until the pair fits the bed and z2/z1 is between 0.4 and 3."""
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


def texture(rng: np.random.Generator, pair: SpurPair, n_teeth: int, rms_m: float) -> FloatArray:
    """Random flank heights along the path, (n_teeth, N_PATH), smoothed over the width of the Hertzian contact."""
    from scipy.ndimage import gaussian_filter1d

    spacing_mm = float(pair.path[1] - pair.path[0]) * pair.base_pitch_m * 1000
    rough = gaussian_filter1d(rng.standard_normal((n_teeth, N_PATH)), max(0.2 / spacing_mm / 2.5, 0.4), axis=1)
    return np.asarray(rough * rms_m / rough.std())


def _draw_tolerances(rng: np.random.Generator, pair: SpurPair, fineness: float) -> Tolerances:
    """Draw errors of a quality that suits the load: `fineness` scales the flank errors."""
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
    # The brake torque is uneven: without load the teeth may rattle between flanks.
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
        SensorResonance(
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
