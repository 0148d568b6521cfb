"""Geared rotors made by ROSS, a package written by others, for studies only: never learned from.

ROSS 2.3 (ross-rotordynamics) makes shafts, couplings, ball bearings, gears with the stiffness of their teeth over the
mesh cycle, the compliance of damaged teeth, and the forces of a misaligned coupling and of a cracked shaft. Its own
integration takes minutes for a second; here the same matrices are propagated exactly, see `march`. Flanks separate, and
each tooth has its own gap and compliance. The housing in which the bearings stand, tolerances and sensors are drawn
here; a rub is ROSS's formula, written anew.

ROSS asks for other versions of libraries than gearsig (`plotly<6`, `pandas<3`), so it runs in an environment of its
own, whose interpreter is given as ROSS_PYTHON; nothing imports it.

It does not represent backlash, bearings with clearance, light load, tilting of gears in mesh, or dynamics of tooth
bodies.
"""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi, radians, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, signal

from app.studies.gap.quasi_static import tachometer
from gearsig.checks import ComplexArray, FloatArray
from gearsig.compiled import njit
from gearsig.errors import RefusalError
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft, TachometerChannel
from sims.machine import log_uniform

# --------------------
# What ROSS makes, by its own interpreter.
# --------------------


IN_ROSS = r"""
import json, sys, warnings
warnings.filterwarnings("ignore")
import numpy as np
import ross as rs
from ross.faults import Crack, MisalignmentFlex
from ross.gear_element import GearElementTVMS, Mesh

asked = json.load(sys.stdin)
Mesh.get_stiffness_for_mesh_period.__defaults__ = (1, asked["n_mesh"])
steel = rs.Material(name="steel206", rho=7850, E=206e9, Poisson=0.3)


class Damaged(GearElementTVMS):
    # Sections of a tooth, y above the centre of the gear and x half as thick, with less height or less width.

    deep, share = 2.0, staticmethod(lambda y: 1.0)

    def _left(self, y, x, area, inertia):
        height, width = x + min(x, max(self.deep, -0.85 * x)), self.width * self.share(y)
        return y, x, height * width, height**3 * width / 12.0

    def _compute_involute_curve(self, tau):
        return self._left(*super()._compute_involute_curve(tau))

    def _compute_transition_curve(self, gamma):
        return self._left(*super()._compute_transition_curve(gamma))


def damaged(gear, kind, size, width):
    y_of = lambda angle: GearElementTVMS._compute_involute_curve(gear, gear._to_tau(angle))
    low, pitch, tip = (y_of(gear.pr_angles_dict[name])[0] for name in ("start_point", "pitch", "addendum"))
    if kind == "root_crack":
        gear.deep = (1.0 - 2.0 * size) * GearElementTVMS._compute_transition_curve(gear, np.pi / 2)[1]
    elif kind == "tooth_spall":
        middle, length = pitch - 0.05 * (tip - low), size * (tip - low)
        gear.share = lambda y: 1.0 - width * np.clip(5.0 - 10.0 * abs(y - middle) / length, 0.0, 1.0)
    else:
        height = size * (tip - low)
        gear.share = lambda y: 1.0 - width * np.clip(2.0 * (y - tip + height) / height, 0.0, 1.0)
    return gear


def rotor_of(shaft, gear, flip):
    def tube(length, diameter):
        return rs.ShaftElement(length, 0.0, diameter, material=steel, beta=shaft["beta"])

    ball, c = shaft["balls"], shaft["coupling"]
    coupling = rs.CouplingElement(
        c["kg"], c["kg"], c["kg_m2"], c["kg_m2"], kt_x=c["radial"], kt_y=c["radial"], kt_z=c["axial"],
        kr_x=c["bending"], kr_y=c["bending"], kr_z=c["torsion"], cr_z=c["damping"], o_d=c["diameter"], L=c["length"],
    )
    end = tube(shaft["end_length"], shaft["end_diameter"])
    parts = [end, coupling, *(tube(x, shaft["diameter"]) for x in shaft["lengths"])]
    places = [0, 1, 2, 4, 6]
    if flip:
        parts, places = parts[::-1], [6 - p for p in places]
    for n, part in enumerate(parts):
        part.n = n
        part.n_l, part.n_r = n, n + 1
    m1, m2, b1, at, b2 = places
    gear.n = at
    gear.n_l = gear.n_r = at
    e = shaft["end"]
    k, c = e["stiffness"], e["damping"]
    bearings = [rs.BearingElement(n=n, kxx=k, kyy=k, kzz=0.1 * k, cxx=c, czz=c) for n in (m1, m2)]
    bearings += [rs.BallBearingElement(n, ball["n"], ball["d"], ball["force"], 0.0) for n in (b1, b2)]
    ends = [rs.DiskElement(n=n, m=0.5 * e["kg"], Id=0.25 * e["kg_m2"], Ip=0.5 * e["kg_m2"]) for n in (m1, m2)]
    return rs.Rotor(parts, [*ends, gear], bearings)


out = {}
for i, machine in enumerate(asked["machines"]):
    size = {"material": steel, "width": machine["width"], "module": machine["module"], "pr_angle": np.radians(20.0)}
    bores = [shaft["diameter"] for shaft in machine["shafts"]]
    kinds = [{**size, "n_teeth": z, "bore_diameter": bore} for z, bore in zip(machine["teeth"], bores)]
    gears = [GearElementTVMS(n=0, **kind) for kind in kinds]
    both = rs.MultiRotor(
        *[rotor_of(s, g, flip) for s, g, flip in zip(machine["shafts"], gears, (False, True))],
        coupled_nodes=(gears[0].n, gears[1].n), update_mesh_stiffness=True, orientation_angle=machine["orientation"],
    )
    mesh, rate = both.mesh, machine["rad_per_s"]
    gear_dofs = [*mesh.driving_gear.dof_global_index.values(), *mesh.driven_gear.dof_global_index.values()]
    values, vectors = np.linalg.eigh(both.coupling_matrix())
    assert abs(values[:-1]).max() < 1e-9 * values[-1]
    along = vectors[:, -1] * np.sqrt(values[-1]) * np.sign(vectors[5, -1])
    g = np.zeros(both.ndof)
    g[gear_dofs] = along
    mesh.stiffness = 0.0
    balls = [b for b in both.bearing_elements if isinstance(b, rs.BallBearingElement)]
    ends = mesh.driving_gear.pr_angles_dict
    alpha = np.linspace(0.0, ends["addendum"] - ends["start_point"], asked["n_path"])
    last = mesh.driven_gear.pr_angles_dict["addendum"]
    angles = ends["start_point"] + alpha, last - mesh.gear_ratio * alpha
    pair = np.array([mesh._angular_equivalent_stiffness(a) for a in alpha])
    softer = []
    for kind, side, tooth_size, width in machine["teeth_faults"]:
        bad = damaged(Damaged(n=0, **kinds[side]), kind, tooth_size, width)
        teeth = [np.array([1.0 / tooth._compute_stiffness(a) for a in angles[side]]) for tooth in (gears[side], bad)]
        shares = np.array([bad.share(bad._compute_involute_curve(bad._to_tau(a))[0]) for a in angles[side]])
        softer.append(teeth[1] - teeth[0] + (1.0 / shares - 1.0) / mesh.hertzian_stiffness)
    turn = np.linspace(0.0, 2.0 * np.pi, asked["n_turn"], endpoint=False)
    pushed = []
    for side, dx, dy, angle in machine["misalignments"]:
        c, n = machine["shafts"][side]["coupling"], (1, 11)[side]
        fault = MisalignmentFlex(both, n, "combined", dx, dy, angle, c["radial"], c["bending"])
        pushed.append(fault.compute_reaction_force(turn))
    cracked = []
    for side, depth in machine["shaft_cracks"]:
        fault = Crack(both, (3, 9)[side], depth, "Mayes")
        across = [k for k in range(12) if k % 6 not in (2, 5)]
        less = np.zeros((asked["n_turn"], both.ndof, both.ndof))
        dofs = np.array(fault.dofs)[across]
        for j, a in enumerate(turn):
            less[np.ix_([j], dofs, dofs)] = (fault.K_elem - fault.mayes(a))[np.ix_(across, across)]
        cracked.append(less)
    made = {
        "M": both.M(), "K": both.K(rate), "C": both.C(rate), "G": both.G(), "weight": both.gravitational_force(),
        "mesh": g, "gears": gear_dofs, "pair": pair, "ratio": mesh.contact_ratio,
        "balls": [list(b.dof_global_index.values())[:2] for b in balls],
        "ball_n_per_m": [np.diag(b.K(rate))[:2] for b in balls],
        "ball_damping": [np.diag(b.C(rate))[:2] for b in balls],
        "softer": softer, "pushed": pushed, "cracked": cracked,
    }
    if "run" in machine:
        steps, step, newtons = machine["run"]
        ramp = np.sin(0.5 * np.pi * np.minimum(2.0 * np.arange(steps) / steps, 1.0)) ** 2
        forces, time = newtons * np.outer(ramp, g), step * np.arange(steps)
        made["ran"] = both.run_time_response(rate, forces, time, method="newmark").yout @ g
    out |= {f"{i}/{name}": np.asarray(value) for name, value in made.items()}
np.savez(asked["to"], **out)
"""

# --------------------
# The rotors' exact propagation: complex modes, with the teeth's force solved at every step.
# --------------------


class LinearModes(NamedTuple):
    """Complex modes z of M q̈ + C q̇ + K q = f: ż = λ z + `into` f, q = Re(`shapes` z).

    Parameters
    ----------
    poles : array, (n_modes,)
        λ in 1/s, one of each conjugate pair.
    into : array, (n_modes, n_dof)
    shapes : array, (n_dof, n_modes)
        Both parts of a conjugate pair together.
    """

    poles: ComplexArray
    into: ComplexArray
    shapes: ComplexArray


def linear_modes(mass: FloatArray, damping: FloatArray, stiffness: FloatArray) -> LinearModes:
    """Return the modes of a system with symmetric positive mass and stiffness and any damping, (n_dof, n_dof) each."""
    squares, real = linalg.eigh(stiffness, mass)
    rates = np.sqrt(np.maximum(squares, 1e-6))
    n = len(rates)
    # States ω η and η̇ have the same unit, so that a step of scales from shafts to teeth does no harm.
    system = np.block([[np.zeros((n, n)), np.diag(rates)], [-np.diag(rates), -real.T @ damping @ real]])
    poles, vectors = linalg.eig(system)
    into = linalg.inv(vectors)[:, n:] @ real.T
    shapes = (real / rates) @ vectors[:n]
    kept = poles.imag >= 0.0
    return LinearModes(poles[kept], into[kept], shapes[:, kept] * np.where(poles[kept].imag > 0.0, 2.0, 1.0))


class RossMesh(NamedTuple):
    """The teeth: what they feel and where they push; see `march`.

    Parameters
    ----------
    reads, into : array, (n_modes,)
        Approach of the flanks δ from the modes; modes' input by a force that drives them apart.
    turns : array, (n_modes,)
        Angle of the driving gear in addition to the given one.
    friction_into : array, (n_modes,)
    stiffness_n_per_m : float
        Constant stiffness of the mesh among the modes.
    ratio, pitch_point : float
        Contact ratio; pitch point as a share of the path.
    pair_m_per_n : array, (n_path,)
        Compliance of a pair of sound teeth along the path.
    gaps_m, softer_m_per_n : two arrays, (teeth, n_path)
        Of each gear's teeth.
    friction : float
    entry : float
        Share of the path over which the stiffness of a pair rises and falls at its ends.
    """

    reads: ComplexArray
    into: ComplexArray
    turns: ComplexArray
    friction_into: ComplexArray
    stiffness_n_per_m: float
    ratio: float
    pitch_point: float
    pair_m_per_n: FloatArray
    gaps_m: tuple[FloatArray, FloatArray]
    softer_m_per_n: tuple[FloatArray, FloatArray]
    friction: float
    entry: float


class Rub(NamedTuple):
    """Contact of a shaft with a ring after ROSS's `Rubbing`; without stiffness none.

    Parameters
    ----------
    reads, into : array, (2, n_modes)
        Both lateral displacements, and forces.
    clearance_m, stiffness_n_per_m, damping, friction, surface_mps : float
    """

    reads: ComplexArray
    into: ComplexArray
    clearance_m: float
    stiffness_n_per_m: float
    damping: float
    friction: float
    surface_mps: float


@njit(cache=True, nogil=True, fastmath=True)
def march(step, poles, z, into, forces, angle, runout, mesh, rub, reads):  # type: ignore[no-untyped-def]  # noqa: PLR0912, PLR0915
    """Return the second derivatives of `reads` of the modes, the driving gear's angle and the approach of the flanks.

    Over a step, forces change linearly, for which z → e^{λh} z + a u₀ + b u₁ is exact. The teeth's force at its end,
    Σ kᵢ max(δ − gᵢ, 0), depends on δ there, δ = δ_free + ρ f: a scalar, piecewise linear equation, solved by Newton's
    method. Friction and a rub's force come one step late.

    Parameters
    ----------
    step : float
        h in s.
    poles, z : arrays, (n_modes,)
        Poles and first state, which changes.
    into : array, (n_modes, n_forces)
    forces : array, (n_steps, n_forces)
    angle, runout : array, (n_steps,)
        Angle of the driving gear, rad; gap of all teeth, m.
    mesh : RossMesh
    rub : Rub
    reads : array, (n_reads, n_modes)

    Returns
    -------
    array, (n_steps, n_reads + 2)
    """
    n_steps, n_forces = forces.shape
    n_modes, n_reads = len(poles), len(reads)
    x = poles * step
    decay = np.exp(x)
    # Near zero, where shafts turn freely, the differences would cancel.
    small = np.abs(x) < 1e-3
    first = step * np.where(small, 0.5 + x / 3.0 + x**2 / 8.0, (decay * (x - 1.0) + 1.0) / x**2)
    last = step * np.where(small, 0.5 + x / 6.0 + x**2 / 24.0, (decay - 1.0 - x) / x**2)
    pushed = last * mesh.into
    yields = np.sum((mesh.reads * pushed).real)
    z1, z2, n_path = len(mesh.gaps_m[0]), len(mesh.gaps_m[1]), len(mesh.pair_m_per_n)
    k, g = np.zeros(4), np.zeros(4)
    u, out = np.zeros(n_modes, dtype=np.complex128), np.zeros((n_steps, n_reads + 2))
    for j in range(n_modes):
        for f in range(n_forces):
            u[j] += into[j, f] * forces[0, f]
    turned, rubbing, rub_x, rub_y = 0.0, 0.0, 0.0, 0.0
    for j in range(n_modes):
        turned += (mesh.turns[j] * z[j]).real
    for i in range(1, n_steps):
        free = 0.0
        for j in range(n_modes):
            now = mesh.friction_into[j] * rubbing + rub.into[0, j] * rub_x + rub.into[1, j] * rub_y
            for f in range(n_forces):
                now += into[j, f] * forces[i, f]
            z[j] = decay[j] * z[j] + first[j] * u[j] + last[j] * now
            u[j] = now
            free += (mesh.reads[j] * z[j]).real
        # pairs that may touch
        cycle = (angle[i] + turned) * z1 / (2.0 * np.pi)
        newest, n_pairs = int(np.floor(cycle)), 0
        for d in range(3):
            share = (cycle - newest + d) / mesh.ratio
            if share >= 1.0:
                break
            place = share * (n_path - 1)
            at = int(place)
            t = place - at
            t1, t2 = (newest - d) % z1, (newest - d) % z2
            g1, g2 = mesh.gaps_m[0][t1], mesh.gaps_m[1][t2]
            c1, c2 = mesh.softer_m_per_n[0][t1], mesh.softer_m_per_n[1][t2]
            low = mesh.pair_m_per_n[at] + c1[at] + c2[at]
            high = mesh.pair_m_per_n[at + 1] + c1[at + 1] + c2[at + 1]
            k[d] = min(1.0, min(share, 1.0 - share) / mesh.entry) / (low + t * (high - low))
            g[d] = g1[at] + g2[at] + t * (g1[at + 1] + g2[at + 1] - g1[at] - g2[at]) + runout[i]
            n_pairs += 1
        delta = free
        for _ in range(6):
            force, slope = -mesh.stiffness_n_per_m * delta, -mesh.stiffness_n_per_m
            for d in range(n_pairs):
                if delta > g[d]:
                    force += k[d] * (delta - g[d])
                    slope += k[d]
            change = (free + yields * force - delta) / (1.0 - yields * slope)
            delta += change
            if abs(change) < 1e-15:
                break
        rubbing, force = 0.0, -mesh.stiffness_n_per_m * delta
        for d in range(n_pairs):
            carried = k[d] * max(delta - g[d], 0.0)
            force += carried
            off = (cycle - newest + d) / mesh.ratio - mesh.pitch_point
            rubbing += mesh.friction * carried * off / np.sqrt(off * off + 1e-3)
        turned = 0.0
        for j in range(n_modes):
            u[j] += mesh.into[j] * force
            z[j] += pushed[j] * force
            turned += (mesh.turns[j] * z[j]).real
            speed = poles[j] * z[j]
            slow = poles[j] * (speed + u[j])
            for r in range(n_reads):
                out[i, r] += (reads[r, j] * slow).real
        out[i, n_reads], out[i, n_reads + 1] = angle[i] + turned, delta
        if rub.stiffness_n_per_m > 0.0:
            rx, ry, vx, vy = 0.0, 0.0, 0.0, 0.0
            for j in range(n_modes):
                speed = poles[j] * z[j] + u[j]
                rx += (rub.reads[0, j] * z[j]).real
                ry += (rub.reads[1, j] * z[j]).real
                vx += (rub.reads[0, j] * speed).real
                vy += (rub.reads[1, j] * speed).real
            off = np.sqrt(rx * rx + ry * ry)
            rub_x, rub_y = 0.0, 0.0
            if off >= rub.clearance_m:
                normal = rub.stiffness_n_per_m * (off - rub.clearance_m) / off
                px, py = -normal * rx - rub.damping * vx, -normal * ry - rub.damping * vy
                rubs = rub.friction * np.sign((vx * rx - vy * ry) / off + rub.surface_mps)
                rub_x, rub_y = px - rubs * abs(px), py + rubs * abs(py)
    return out


# --------------------
# A random machine: rotors, gears, bearings and couplings by ROSS; housing, tolerances and sensors are drawn here.
# --------------------


RATE_HZ, FINER, SETTLING_S = 20_480.0, 4, 0.4
MIN_DURATION_S, MIN_TURNS = 3.0, 10.0
"""Of a recording; revolutions of the slower shaft."""
N_PATH, N_TURN = 64, 128
STIFFNESS_N_PER_M2 = 14e9
"""Mesh stiffness per face width by which relief is chosen."""
N_SEVERITIES = 2
DRIVE_HZ, FOLLOWING_S, SLIP = 0.5, 0.15, 0.03
"""Drive: its weak spring with the motor's inertia; time in which it follows; slip under load."""
ENTRY = 0.02
"""Share of the path over which pairs meet and part: at once, in ROSS; steps would round the instant, which is heard."""
TOOTH_FAULTS = ("root_crack", "tooth_spall", "chipped_tooth")
PRESSURE_ANGLE = radians(20.0)
MOTOR, LOAD = 5, 83
"""Rotation of motor and load among ROSS's degrees of freedom: seven nodes on each shaft, six at each node."""


def severity(rng: np.random.Generator, i: int, low: float, high: float) -> float:
    """Return a value from the i-th of `N_SEVERITIES` parts of a range, log-uniform."""
    step = (high / low) ** (1.0 / N_SEVERITIES)
    return log_uniform(rng, low * step**i, low * step ** (i + 1))


@dataclass(frozen=True)
class RossMachine:
    """A random machine with ROSS's matrices.

    Parameters
    ----------
    asked : mapping
        What ROSS is asked for, in SI units; see `IN_ROSS`.
    points : two pairs of float
        Input speed in rpm and tooth load in N/mm at two operating points.
    drawn : mapping
        Housing, tolerances and sensors, by short names that `draw` explains.
    ross : mapping
        Matrices, stiffness and faults by ROSS.
    """

    asked: dict[str, Any]
    points: tuple[tuple[float, float], ...]
    drawn: dict[str, FloatArray]
    ross: Mapping[str, FloatArray]

    @classmethod
    def draw(cls, rng: np.random.Generator) -> RossMachine:
        """Draw a machine, which has not been to ROSS yet."""
        u = rng.uniform

        def log(low: float, high: float, n: int) -> FloatArray:
            return np.array([log_uniform(rng, low, high) for _ in range(n)])

        # gears, and the speeds and loads of both points
        z1 = int(rng.integers(18, 37))
        teeth = z1, int(z1 * u(1.0, 2.2)) + 1
        module = 1e-3 * float(rng.choice([2.0, 2.5, 3.0, 4.0]))
        width = float(np.round(module * u(7, 11), 3))
        speed, line_load = log_uniform(rng, 450.0, 2400.0), log_uniform(rng, 40.0, 300.0)
        points = (
            (speed, line_load),
            (speed * rng.choice([u(0.55, 0.8), u(1.25, 1.5)]), line_load * rng.choice([u(0.5, 0.75), u(1.3, 1.6)])),
        )
        radii = 0.5 * module * np.array(teeth)
        force = 1e3 * width * line_load
        mass = 7850.0 * pi * radii**2 * width
        inertia = 0.5 * mass * radii**2
        ratio = teeth[0] / teeth[1]
        # shafts that fit into the smaller gear, on balls that fit onto them; a coupling twists at 30 to 120 Hz
        thin = u(0.42, 0.58) * (2.0 * radii[0] - 2.5 * module)
        shafts, balls = [], []
        for side in range(2):
            diameter = thin * (1.0, u(1.0, 1.4))[side]
            others = inertia[0] + inertia[1] * ratio**2 if side == 0 else inertia[1] + inertia[0] / ratio**2
            end = u(3, 9) * others + 2e-3
            soft = (2 * pi * log_uniform(rng, 30.0, 120.0)) ** 2 * end * others / (end + others)
            n, ball = int(rng.integers(8, 13)), u(0.25, 0.4) * diameter
            pitch = max(diameter + 1.8 * ball, n * ball / pi * 1.25)
            balls.append((n, round(1e3 * ball, 2), round(1e3 * pitch, 2)))
            coupling = {
                "kg": 0.5 * (diameter / 0.03) ** 3,
                "kg_m2": 0.5 * (diameter / 0.03) ** 3 * diameter**2 / 2.0,
                "radial": log_uniform(rng, 1e5, 2e6),
                "axial": 1e5,
                "bending": log_uniform(rng, 30.0, 600.0),
                "torsion": soft,
                "damping": 2.0 * u(0.02, 0.08) * (soft * others) ** 0.5,
                "diameter": 2.0 * diameter,
                "length": 1.5 * diameter,
            }
            shafts.append(
                {
                    "diameter": diameter,
                    "lengths": [float(x) for x in np.repeat(width * u(1.0, 2.2, 2), 2)],
                    "beta": log_uniform(rng, 1e-7, 5e-7),
                    "balls": {"n": n, "d": ball, "force": 0.5 * force},
                    "coupling": coupling,
                    "end_diameter": 1.2 * diameter,
                    "end_length": 5.0 * diameter,
                    "end": {"kg": u(8, 30), "kg_m2": end, "stiffness": log_uniform(rng, 3e7, 2e8), "damping": 500.0},
                }
            )

        def of_teeth(kind: str) -> list[tuple[str, int, float, float]]:
            """Crack over the root's thickness; length or height over the tooth's, missing share of the width."""
            size = {"root_crack": (0.3, 0.65), "tooth_spall": (0.15, 0.4), "chipped_tooth": (0.3, 0.7)}[kind]
            return [
                (kind, int(rng.integers(2)), severity(rng, i, *size), severity(rng, i, 0.5, 0.99))
                for i in range(N_SEVERITIES)
            ]

        asked = {
            "teeth": teeth,
            "module": module,
            "width": width,
            "orientation": u(-pi, pi),
            "rad_per_s": speed * pi / 30.0,
            "shafts": shafts,
            "teeth_faults": [fault for kind in TOOTH_FAULTS for fault in of_teeth(kind)],
            "misalignments": [
                (int(rng.integers(2)), *(severity(rng, i, *of) for of in ((1e-4, 2e-3), (1e-4, 2e-3), (2e-3, 4e-2))))
                for i in range(N_SEVERITIES)
            ],
            "shaft_cracks": [(int(rng.integers(2)), u(0.3, 0.45))],
        }
        # a housing of some modes, tolerances and sensors, which ROSS does not have
        housing = u(4, 9) * mass.sum() + 5.0
        n_modes, n_sensors = int(rng.integers(8, 14)), int(rng.integers(1, 4))
        hz = np.concatenate([log(20.0, 200.0, 3), log(300.0, 9000.0, n_modes - 3)])
        kg = housing * u(1, 4, n_modes)
        drawn = {
            "force_n": force,
            "mass_kg": mass,
            "inertia": inertia,
            "mesh_damping_ratio": u(0.03, 0.08),
            "friction": u(0.03, 0.06),
            "relief_m": u(0.0, 1.2) * force / (width * STIFFNESS_N_PER_M2),
            "pitch_1_m": u(0.8, 2.5) * 1e-6 * rng.standard_normal(teeth[0]),
            "pitch_2_m": u(0.8, 2.5) * 1e-6 * rng.standard_normal(teeth[1]),
            "profile_m": u(0.3, 1.2) * 1e-6 * rng.standard_normal((2, 4)),
            "runout_m": u(4, 15, 2) * 1e-6 * np.exp(2j * pi * u(0, 1, 2)),
            "balance_mps": u(1, 5, 2) * 1e-3 * np.exp(2j * pi * u(0, 1, 2)),
            "mode_hz": np.sort(hz),
            "mode_damping_ratio": u(0.01, 0.05, n_modes),
            "at_bearings": rng.standard_normal((8, n_modes)) / kg**0.5,
            "at_sensors": 0.6 * rng.standard_normal((n_sensors, n_modes)) / kg**0.5,
            "noise": log(0.003, 0.03, n_sensors),
            "hum": log(0.001, 0.008, n_sensors),
            "line_hz": float(rng.choice([50.0, 60.0])),
            "balls": np.array(balls),
        }
        return cls(asked, points, {name: np.asarray(value) for name, value in drawn.items()}, {})

    def rig(self, point: int) -> Rig:
        """Return the rig as the operator knows it, at one of the two operating points."""
        names, teeth = ("input", "output"), self.asked["teeth"]
        module_mm, face_mm = 1e3 * self.asked["module"], 1e3 * self.asked["width"]
        return Rig(
            "rotors of ROSS",
            tuple(Shaft(name) for name in names),
            (GearPair("stage 1", *names, teeth[0], teeth[1], module_mm, 20.0, face_mm),),
            tuple(
                Bearing(f"{name}, {end}", name, int(n), float(ball), float(pitch))
                for name, (n, ball, pitch) in zip(names, self.drawn["balls"], strict=True)
                for end in ("drive end", "far end")
            ),
            tuple(
                Sensor(f"a{i + 1}", "acceleration", "m/s^2", "gearbox housing")
                for i in range(len(self.drawn["at_sensors"]))
            ),
            OperatingPoint("input", self.points[point][0], torque_nm=self.torque_nm(point)),
            TachometerChannel("tach", shaft="input"),
            RATE_HZ,
        )

    def torque_nm(self, point: int) -> float:
        """Return the input torque in N m."""
        lever = float(self.ross["mesh"][self.ross["gears"][5]])
        return 1e3 * float(self.asked["width"]) * self.points[point][1] * lever


def with_ross(machines: Sequence[RossMachine], run: tuple[int, float, float] | None = None) -> list[RossMachine]:
    """Return the machines with what ROSS makes of them, in the interpreter given as ROSS_PYTHON.

    Parameters
    ----------
    machines : sequence of RossMachine
    run : (int, float, float) or None
        Number of steps, step in s and final force between the flanks in N of a run by ROSS itself, of the rotors
        without housing; the force rises smoothly during its first half.

    Raises
    ------
    RefusalError
        If ROSS_PYTHON is not set.
    """
    if "ROSS_PYTHON" not in os.environ:
        raise RefusalError("ROSS_PYTHON is not set", remedy="set it to an interpreter that has ross-rotordynamics 2.3")
    more = {} if run is None else {"run": run}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "ross.npz"
        asked = {
            "machines": [machine.asked | more for machine in machines],
            "n_path": N_PATH,
            "n_turn": N_TURN,
            "n_mesh": 1000 if run is not None else 2,
            "to": str(path),
        }
        command = [os.environ["ROSS_PYTHON"], "-c", IN_ROSS]
        subprocess.run(command, input=json.dumps(asked), text=True, check=True, stdout=subprocess.DEVNULL)
        table = dict(np.load(path))
    return [
        replace(machine, ross={name.split("/")[1]: table[name] for name in table if name.startswith(f"{i}/")})
        for i, machine in enumerate(machines)
    ]


@dataclass
class RossFault:
    """Changes made by an effect; by default none.

    Parameters
    ----------
    softer, gaps : list of (gear, tooth or None, array (n_path,) or (teeth, n_path))
        Added compliance (m/N) and gap (m).
    friction : float
        Factor on the coefficient of the teeth.
    runout_m, unbalance_mps : dict
        Gear → added complex value; an unbalance as eccentricity of the gear's mass times its angular speed.
    turning : (gear, array (n_turn, n_dof)) or None
        Forces by angle of a shaft.
    shaft_crack : int or None
        Number among ROSS's cracked shafts, whose forces follow from the static deflection.
    race : (bearing, order, depth, length, modulation) or None
        Passages per revolution of the driving gear; depth in m; length as a share of the distance between balls.
    ripple, wander : (share, order), (share, Hz)
    rub : (gear, share of the static deflection, stiffness, friction) or None
    moved, damped : factors on frequencies and damping of the housing
    hum : float
        Share of the healthy level.
    clipped : (sensor, share of the peak) or None
    """

    softer: list[tuple[int, int | None, FloatArray]] = field(default_factory=list)
    gaps: list[tuple[int, int | None, FloatArray]] = field(default_factory=list)
    friction: float = 1.0
    runout_m: dict[int, complex] = field(default_factory=dict)
    unbalance_mps: dict[int, complex] = field(default_factory=dict)
    turning: tuple[int, FloatArray] | None = None
    shaft_crack: int | None = None
    race: tuple[int, float, float, float, bool] | None = None
    ripple: tuple[float, float] | None = None
    wander: tuple[float, float] | None = None
    rub: tuple[int, float, float, float] | None = None
    moved: FloatArray | float = 1.0
    damped: float = 1.0
    hum: float = 0.0
    clipped: tuple[int, float] | None = None


# --------------------
# A recording.
# --------------------


def record(
    machine: RossMachine, point: int, fault: RossFault, rng: np.random.Generator, levels: FloatArray | None
) -> Recording:
    """Return a recording of a machine with a fault on another day; noise and hum are relative to `levels`, rms."""
    drawn, ross, normal = machine.drawn, machine.ross, rng.standard_normal
    rpm, line_load = machine.points[point]
    speed = rpm * pi / 30.0 * (1.0 + 0.004 * normal())
    force = 1e3 * machine.asked["width"] * line_load * (1.0 + 0.05 * normal())
    n_sensors, n_modes = drawn["at_sensors"].shape
    hz = drawn["mode_hz"] * (1.0 + 0.003 * normal()) * (1.0 + 0.002 * normal(n_modes)) * fault.moved
    zeta = drawn["mode_damping_ratio"] * np.exp(0.08 * normal(n_modes)) * fault.damped
    at_sensors = drawn["at_sensors"] * (1.0 + 0.03 * normal((n_sensors, n_modes)))
    system, columns = _system(machine, hz, zeta, speed)
    duration_s = max(MIN_DURATION_S, MIN_TURNS * 60.0 / rpm * machine.asked["teeth"][1] / machine.asked["teeth"][0])
    n = round((SETTLING_S + duration_s) * RATE_HZ * FINER)
    rate = RATE_HZ * FINER
    time = np.arange(n) / rate
    wander = _slow(n, rate, 4e-4, 1.0, rng)
    if fault.wander is not None:
        share, wander_hz = fault.wander
        wander = wander + share * np.sin(2 * pi * (wander_hz * time + rng.uniform()))
    turning = speed * (1.0 + wander)
    angle = 2 * pi * rng.integers(machine.asked["teeth"][1]) + rng.uniform(0, 2 * pi) + np.cumsum(turning) / rate
    vectors, forces, runout = _forces(machine, fault, columns, system, (time, angle, turning, force), rng)
    modes = linear_modes(*system)
    mesh, rub = _teeth_and_rub(machine, fault, modes, columns["mesh"], columns["friction"], force, speed)
    into = np.ascontiguousarray(modes.into @ vectors)
    z = -(into @ forces.mean(axis=0)) / modes.poles
    shapes = np.ascontiguousarray(at_sensors @ modes.shapes[len(ross["M"]) :])
    out = march(1.0 / rate, modes.poles, z, into, forces, angle, runout, mesh, rub, shapes)
    lead, n_out = round(SETTLING_S * RATE_HZ), round(duration_s * RATE_HZ)
    kept = slice(lead, lead + n_out)
    values = signal.resample_poly(out[:, :-2], 1, FINER, axis=0, window=("kaiser", 9.0))[kept].T
    values = values * (1.0 + 0.05 * rng.uniform(-1, 1, (n_sensors, 1)))
    scale = values.std(axis=1) if levels is None else levels
    later = time[::FINER][kept]
    for i in range(n_sensors):
        turns = 2 * pi * drawn["line_hz"] * later * (1.0 + 1e-4 * normal()) + rng.uniform(0, 2 * pi)
        hum = np.cos(turns) + 0.4 * np.cos(2.0 * turns + 1.0) + 0.3 * np.cos(3.0 * turns)
        values[i] += scale[i] * (drawn["noise"][i] * normal(n_out) + (drawn["hum"][i] + fault.hum) * hum)
    if fault.clipped is not None:
        i, share = fault.clipped
        peak = share * float(np.quantile(np.abs(values[i % n_sensors]), 0.9999))
        values[i % n_sensors] = np.clip(values[i % n_sensors], -peak, peak)
    volts = tachometer(out[1:, -2] / (2 * pi), time[1:], later, rng)
    rig = machine.rig(point)
    channels = [Channel(s.channel, s.quantity, s.unit) for s in rig.sensors]
    samples = np.vstack([values, volts]).astype(np.float32)
    return Recording(samples, RATE_HZ, (*channels, Channel("tach", "tachometer", "V")), rig.speed, rig)


def _slow(n: int, rate: float, size: float, corner_hz: float, rng: np.random.Generator) -> FloatArray:
    """Return a random walk about zero with standard deviation `size` and little above a corner frequency."""
    coarse = np.cumsum(rng.standard_normal(round(4.0 * corner_hz * n / rate) + 4))
    values = np.interp(np.linspace(0, len(coarse) - 1, n), np.arange(len(coarse)), signal.detrend(coarse))
    return np.asarray(size * values / values.std())


def _system(
    machine: RossMachine, hz: FloatArray, zeta: FloatArray, speed: float
) -> tuple[tuple[FloatArray, FloatArray, FloatArray], dict[str, FloatArray]]:
    """Return mass, damping and stiffness of rotors in their housing, with the mean mesh; and columns of forces."""
    ross, drawn = machine.ross, machine.drawn
    n, n_modes = len(ross["M"]), len(hz)
    n_all = n + n_modes
    mass, damping, stiffness = (np.zeros((n_all, n_all)) for _ in range(3))
    mass[:n, :n], mass[n:, n:] = ross["M"], np.eye(n_modes)
    damping[:n, :n] = ross["C"] + speed * ross["G"]
    stiffness[:n, :n] = ross["K"]
    damping[n:, n:], stiffness[n:, n:] = np.diag(4 * pi * zeta * hz), np.diag((2 * pi * hz) ** 2)
    # The bearings, which ROSS fixes to the ground, stand in the housing.
    places = ross["balls"].ravel()
    for whole, of_balls in ((stiffness, ross["ball_n_per_m"]), (damping, ross["ball_damping"])):
        reach = of_balls.ravel()[:, None] * drawn["at_bearings"]
        whole[places, n:] -= reach
        whole[n:, places] -= reach.T
        whole[n:, n:] += drawn["at_bearings"].T @ reach
    mesh = np.concatenate([ross["mesh"], np.zeros(n_modes)])
    gears = ross["gears"]
    across = np.zeros(n_all)
    x, y = mesh[gears[0]], mesh[gears[1]]
    across[gears[[0, 1, 6, 7]]] = -y, x, y, -x
    across[gears[[5, 11]]] = -mesh[gears[5]] * np.tan(PRESSURE_ANGLE), mesh[gears[11]] * np.tan(PRESSURE_ANGLE)
    stiff = mean_stiffness(ross)
    moved = 1.0 / np.sum(mesh[gears[[5, 11]]] ** 2 / drawn["inertia"])
    stiffness += stiff * np.outer(mesh, mesh)
    damping += 2.0 * float(drawn["mesh_damping_ratio"]) * (stiff * moved) ** 0.5 * np.outer(mesh, mesh)
    # A motor with a few per cent of slip under load, and a weak spring, so that the shafts do not turn away.
    inertia = 2.0 * float(ross["M"][MOTOR, MOTOR])
    stiffness[MOTOR, MOTOR] += inertia * (2 * pi * DRIVE_HZ) ** 2
    damping[MOTOR, MOTOR] += max(inertia / FOLLOWING_S, mesh[gears[5]] * float(drawn["force_n"]) / (SLIP * speed))
    return (mass, damping, stiffness), {"mesh": mesh, "friction": across}


def mean_stiffness(ross: Mapping[str, FloatArray]) -> float:
    """Return the mean stiffness of the mesh, N/m."""
    return float(ross["pair"].mean() * ross["ratio"])


def _forces(
    machine: RossMachine,
    fault: RossFault,
    columns: dict[str, FloatArray],
    system: tuple[FloatArray, FloatArray, FloatArray],
    course: tuple[FloatArray, FloatArray, FloatArray, float],
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where forces act, (n_dof, n_forces), their courses, (n_steps, n_forces), and the gears' run-out."""
    time, angle, turning, force = course
    drawn, gears, ratio = machine.drawn, machine.ross["gears"], machine.asked["teeth"][0] / machine.asked["teeth"][1]
    n_all, rate = len(columns["mesh"]), 1.0 / time[1]
    angles = angle, -ratio * angle
    acting: list[tuple[FloatArray, FloatArray]] = []

    def at(dof: int, course: FloatArray) -> None:
        acting.append((np.eye(n_all)[dof], course))

    torque = force * (1.0 + _slow(len(time), rate, 3e-3, 20.0, rng))
    braking = force * (1.0 + _slow(len(time), rate, 4e-3, 10.0, rng))
    if fault.ripple is not None:
        share, order = fault.ripple
        torque = torque + force * share * np.cos(order * angle + rng.uniform(0, 2 * pi))
    at(MOTOR, columns["mesh"][gears[5]] * torque)
    at(LOAD, columns["mesh"][gears[11]] * braking)
    runout = np.zeros(len(time))
    nominal = machine.points[0][0] * pi / 30.0
    for side in range(2):
        out = drawn["runout_m"][side] + fault.runout_m.get(side, 0.0)
        runout += (out * np.exp(1j * angles[side])).real
        mps = drawn["balance_mps"][side] + fault.unbalance_mps.get(side, 0.0)
        own = turning * (1.0, ratio)[side]
        whirl = drawn["mass_kg"][side] * mps / (nominal * (1.0, ratio)[side]) * own**2 * np.exp(1j * angles[side])
        at(int(gears[6 * side]), whirl.real)
        at(int(gears[6 * side + 1]), whirl.imag)
    by_turn = fault.turning
    if fault.shaft_crack is not None:
        side = machine.asked["shaft_cracks"][fault.shaft_crack][0]
        load = sum(vector * course.mean() for vector, course in acting)
        load[: len(machine.ross["weight"])] += machine.ross["weight"]
        bent = linalg.solve(system[2], load)[: len(machine.ross["M"])]
        by_turn = side, machine.ross["cracked"][fault.shaft_crack] @ bent
    if by_turn is not None:
        side, table = by_turn
        table = np.vstack([table, table[:1]])
        place = (angles[side] / (2 * pi) % 1.0) * N_TURN
        for dof in np.flatnonzero(np.ptp(table, axis=0)):
            at(int(dof), np.interp(place, np.arange(N_TURN + 1), table[:, dof]))
    if fault.race is not None:
        acting.append(_race(machine, fault.race, columns["mesh"], angles, force, rng))
    vectors, courses = zip(*acting, strict=True)
    return np.array(vectors).T, np.ascontiguousarray(np.array(courses).T), runout


def _race(
    machine: RossMachine,
    race: tuple[int, float, float, float, bool],
    mesh: FloatArray,
    angles: tuple[FloatArray, FloatArray],
    force: float,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray]:
    """Return where a damaged race pushes shaft and housing apart, in N, and when: one ball after the other sinks.

    A ball loses at most what the most heavily loaded one carries, 5 F/n after Stribeck.
    """
    bearing, order, depth, turn, modulated = race
    side, at_bearings = bearing // 2, machine.drawn["at_bearings"]
    passed = order * (angles[0] + 2e-5 * np.cumsum(rng.standard_normal(len(angles[0])))) / (2 * pi)
    pulse = np.clip(3.0 - 6.0 * np.abs(passed - np.round(passed)) / turn, 0.0, 1.0)
    if modulated:
        pulse = pulse * np.maximum(np.cos(angles[side]), 0.0) ** 1.5
    load = mesh[machine.ross["gears"][[6 * side, 6 * side + 1]]]
    along = load / np.hypot(*load)
    stiffness, n_balls = float(along**2 @ machine.ross["ball_n_per_m"][bearing]), machine.drawn["balls"][side, 0]
    push = along * min(2.5 * stiffness * depth, 2.5 * force) / n_balls
    column = np.zeros(len(mesh))
    column[machine.ross["balls"][bearing]] = push
    column[-at_bearings.shape[1] :] = -push @ at_bearings[2 * bearing : 2 * bearing + 2]
    return column, pulse


def _teeth_and_rub(
    machine: RossMachine,
    fault: RossFault,
    modes: LinearModes,
    mesh: FloatArray,
    across: FloatArray,
    force: float,
    speed: float,
) -> tuple[RossMesh, Rub]:
    drawn, ross, teeth = machine.drawn, machine.ross, machine.asked["teeth"]
    height = np.linspace(0.0, 1.0, N_PATH)
    waves = np.array([2.0 * height - 1.0, *(np.cos(pi * k * height) for k in (2, 3, 5))])
    relief = float(drawn["relief_m"])
    gaps, softer = [], []
    for side in range(2):
        above = height if side == 0 else 1.0 - height
        tip = relief * np.clip((above - 0.7) / 0.3, 0.0, None) ** 1.5 + drawn["profile_m"][side] @ waves
        gaps.append(tip + drawn[f"pitch_{side + 1}_m"][:, None])
        softer.append(np.zeros((teeth[side], N_PATH)))
    for tables, added in ((gaps, fault.gaps), (softer, fault.softer)):
        for side, tooth, values in added:
            tables[side][slice(None) if tooth is None else tooth] += values
    theta = ross["gears"][5]
    z1, z2 = teeth
    beyond = sqrt((z2 / 2 + 1) ** 2 - (z2 / 2 * np.cos(PRESSURE_ANGLE)) ** 2) - z2 / 2 * np.sin(PRESSURE_ANGLE)
    whole = float(ross["ratio"]) * pi * np.cos(PRESSURE_ANGLE)
    of_teeth = RossMesh(
        np.ascontiguousarray(mesh @ modes.shapes),
        np.ascontiguousarray(-(modes.into @ mesh)),
        np.ascontiguousarray(modes.shapes[theta]),
        np.ascontiguousarray(modes.into @ across),
        mean_stiffness(ross),
        float(ross["ratio"]),
        float(beyond / whole),
        1.0 / ross["pair"],
        (gaps[0], gaps[1]),
        (softer[0], softer[1]),
        float(drawn["friction"]) * fault.friction,
        ENTRY,
    )
    side, share, stiffness, friction = fault.rub or (0, 1.0, 0.0, 0.0)
    dofs = ross["gears"][[6 * side, 6 * side + 1]]
    shapes, into = np.ascontiguousarray(modes.shapes[dofs]), np.ascontiguousarray(modes.into[:, dofs].T)
    torques = np.zeros(len(mesh))
    torques[[MOTOR, LOAD]] = mesh[ross["gears"][[5, 11]]] * force
    bent = (shapes @ (-(modes.into @ torques) / modes.poles)).real
    radius = 0.5 * machine.asked["shafts"][side]["diameter"]
    own = speed * (1.0, -z1 / z2)[side]
    clearance = share * float(np.hypot(*bent))
    return of_teeth, Rub(shapes, into, clearance, stiffness, 3e-5 * stiffness, friction, own * radius)


# --------------------
# The same rotors by ROSS itself.
# --------------------


SEED = 28_011
FINER_THAN_ROSS, NEWTONS = 8, 1000.0


def apart_from_ross(steps: int, step_s: float) -> float:
    """Return the rms difference of the flanks' approach between `march` at a finer step and ROSS, over its rms."""
    machine = with_ross([RossMachine.draw(np.random.default_rng([SEED, 1]))], (steps, step_s, NEWTONS))[0]
    ross, speed, mesh = machine.ross, machine.asked["rad_per_s"], machine.ross["mesh"]
    stiffness = ross["K"] + mean_stiffness(ross) * np.outer(mesh, mesh)
    modes = linear_modes(ross["M"], ross["C"] + speed * ross["G"], stiffness)
    still = np.zeros((2, len(modes.poles)), dtype=np.complex128)
    sound = tuple(np.zeros((z, N_PATH)) for z in machine.asked["teeth"])
    teeth = RossMesh(
        mesh @ modes.shapes, -(modes.into @ mesh), still[0], still[0], mean_stiffness(ross), float(ross["ratio"]), 0.5,
        1.0 / ross["pair"], (sound[0], sound[1]), (sound[0], sound[1]), 0.0, 1e-9,
    )  # fmt: skip
    n = (steps - 1) * FINER_THAN_ROSS + 1
    turned = np.arange(n) / FINER_THAN_ROSS
    ramp = np.sin(0.5 * pi * np.minimum(2.0 * turned / steps, 1.0)) ** 2
    into = (modes.into @ mesh)[:, None]
    out = march(
        step_s / FINER_THAN_ROSS, modes.poles, still[0].copy(), into, NEWTONS * ramp[:, None],
        speed * step_s * turned, np.zeros(n), teeth, Rub(still, still, 1.0, 0.0, 0.0, 0.0, 0.0), still[:0],
    )  # fmt: skip
    return float(np.std(out[::FINER_THAN_ROSS, -1] - ross["ran"]) / np.std(ross["ran"]))
