"""The four bearings as arrays: springs, clearance, and the effects of passing rolling elements.

A rolling element over a spall carries less load, and the shaft sinks towards it. An element of radius R that follows
the edges is h = x²/2R deep at a distance x from the nearer edge. It cannot lose more than its own load: with its
present load Q and the bearing's stiffness k, the shaft sinks by s (1 − exp(−h/s)), s = Q/k. Impacts grow with the load,
and with the spall only up to about half a millimetre. Q decreases with the angle ψ from the load's direction as
cos^1.5 ψ (Stribeck's distribution for a bearing without clearance). The sinking is a displacement of the spring's foot,
(x_b − d).

With clearance, fewer elements share the load, and the shaft falls and rises as they pass: the difference from a bearing
without clearance follows from the static equilibrium of all elements (F = K δ^1.5) at 32 cage positions. A bearing of
law "hertzian" has no spring: each element carries through its own contact.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import cos, exp, floor, log1p, pi, radians, sin, sqrt
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.errors import InputError, RefusalError
from gearsig.rig import Bearing
from sims.machine import RACE_EDGE_MM, BearingSupport, Machine

# --------------------
# Individual rolling elements: Hertzian contacts with clearance, whose number changes as the elements pass.
#
# An element at the angle ψ is compressed by δ = x cos ψ + y sin ψ − c, c the radial clearance, and carries Q = K δ^1.5
# along the radius. The force on the shaft, −Σ Q (cos ψ, sin ψ), depends on the cage position: as the elements pass, the
# stiffness changes, and the shaft rises and falls with it (variable compliance).
#
# Sources: A. Palmgren, *Ball and Roller Bearing Engineering* (1959); T. A. Harris, M. N. Kotzalas, *Rolling Bearing
# Analysis*, 5th ed. (2006), ch. 7; C. S. Sunnersjö, Varying compliance vibrations of rolling bearings, Journal of Sound
# and Vibration 58 (1978).
# --------------------


LEFT_OVER = 1e-7
"""Allowed unbalanced part of the load, growing with clearance over contact approach; rounding of the energy leaves up
to 3e-8, and more for larger displacements."""
PALMGREN_MM = 4.36e-4
"""δ = 4.36e-4 (Q²/d)^⅓, mm, N: approach of both races to a steel ball in grooves of usual curvature."""


def contact_n_per_m15(bearing: Bearing) -> float:
    """Stiffness K of one ball between its races, in radial direction, Q_r = K δ_r^1.5, by Palmgren's formula.

    δ_r = 4.36e-4 Q^⅔/(d^⅓ cos α), Q = Q_r/cos α, in mm and N; here in N/m^1.5.

    Parameters
    ----------
    bearing : Bearing
        With geometry; steel balls.
    """
    alpha = radians(bearing.contact_angle_deg or 0.0)
    ball_mm = bearing.rolling_element_diameter_mm or 1.0
    per_mm15 = (cos(alpha) / PALMGREN_MM) ** 1.5 * sqrt(ball_mm) * cos(alpha)
    return float(per_mm15 * 1e3**1.5)


def element_angles_rad(n: int, cage_rad: float) -> FloatArray:
    """Angles ψ of the elements, counter-clockwise from +x, (n,)."""
    return cage_rad + 2.0 * pi * np.arange(n) / n


def shaft_place_m(support: BearingSupport, load_n: FloatArray, cage_rad: float = 0.0) -> FloatArray:
    """Static position of the shaft in the bearing under a load, x and y, (2,), with individual element contacts.

    Raises
    ------
    RefusalError
        If no equilibrium is found.
    """
    n, size, clearance = support.bearing.n_rolling_elements or 1, float(np.hypot(*load_n)), support.clearance_um * 1e-6
    if size == 0.0:
        return np.zeros(2)
    angles, contact = element_angles_rad(n, cage_rad), contact_n_per_m15(support.bearing)
    guess = load_n / size * (clearance + (5.0 * size / (n * contact)) ** (2.0 / 3.0))
    return balanced(np.column_stack((np.cos(angles), np.sin(angles))), contact, clearance, load_n, guess)


def element_loads_n(support: BearingSupport, load_n: FloatArray, cage_rad: float = 0.0) -> FloatArray:
    """Radial load of each element, (n,).

    Without clearance the maximum tends to 4.37 F/n as n grows (Stribeck); with usual clearance it is near 5 F/n.
    """
    angles = element_angles_rad(support.bearing.n_rolling_elements or 1, cage_rad)
    place = shaft_place_m(support, load_n, cage_rad)
    depth = place[0] * np.cos(angles) + place[1] * np.sin(angles) - support.clearance_um * 1e-6
    result: FloatArray = contact_n_per_m15(support.bearing) * np.maximum(depth, 0.0) ** 1.5
    return result


def stiffness_under_load_n_per_m(support: BearingSupport, load_n: FloatArray) -> float:
    """Stiffness in the load direction, ΣK 1.5 √δ cos², mean over 16 cage positions; for a spring, its own stiffness."""
    if support.law == "linear" or float(np.hypot(*load_n)) == 0.0:
        return support.stiffness_n_per_m
    n, toward = support.bearing.n_rolling_elements or 1, float(np.arctan2(load_n[1], load_n[0]))
    contact, stiffnesses = contact_n_per_m15(support.bearing), []
    for cage in 2.0 * pi / n * np.arange(16) / 16:
        loads = element_loads_n(support, load_n, float(cage))
        root_depth = (loads / contact) ** (1.0 / 3.0)
        along = np.cos(element_angles_rad(n, float(cage)) - toward) ** 2
        stiffnesses.append(float(np.sum(1.5 * contact * root_depth * along)))
    return float(np.mean(stiffnesses))


def balanced(
    radial: FloatArray, contact: float, clearance_m: float, load_n: FloatArray, guess: FloatArray
) -> FloatArray:
    """Position p that minimises the convex energy Σ K δ^2.5/2.5 − W·p, by Newton's method with step halving.

    radial : (n, 2), directions of the elements. Lengths are scaled so that the curvature is about 1.
    """
    load = float(np.hypot(*load_n))
    unit = (load / contact) ** (2.0 / 3.0)
    toward, gap, p = load_n / load, clearance_m / unit, guess / unit

    def energy(place: FloatArray) -> float:
        return float(np.sum(np.maximum(radial @ place - gap, 0.0) ** 2.5) / 2.5 - toward @ place)

    for _ in range(200):
        depth = np.maximum(radial @ p - gap, 0.0)
        slope = (depth**1.5) @ radial - toward
        if np.hypot(*slope) < LEFT_OVER * (1.0 + gap):
            place: FloatArray = p * unit
            return place
        curvature = (radial.T * (1.5 * np.sqrt(depth))) @ radial + 1e-9 * np.eye(2)
        step = np.linalg.solve(curvature, slope)
        step *= min(1.0, (1.0 + gap) / float(np.hypot(*step)))
        part, now = 1.0, energy(p)
        while energy(p - part * step) > now - 1e-4 * part * float(slope @ step) and part > 1e-12:
            part /= 2.0
        p = p - part * step
    raise RefusalError(
        f"the static equilibrium of a bearing's elements does not converge (imbalance {np.hypot(*slope):.1g})",
        remedy="take another clearance or load",
    )


@njit(cache=True, nogil=True, error_model="numpy")
def element_forces(k, row, theta, x, y):
    """(F_x, F_y) of the elements of a bearing on the shaft at (x, y); `theta`: shaft angle."""
    n = k.balls[row]
    # The driven shaft turns clockwise, and its cage with it.
    cage = k.pass_order[row] * theta / n * (1.0 if row < 2 else -1.0)
    step = 2.0 * pi / n
    c, s, turn_c, turn_s = cos(cage), sin(cage), cos(step), sin(step)
    fx, fy = 0.0, 0.0
    for _ in range(n):
        depth = x * c + y * s - k.clearance[row]
        if depth > 0.0:
            force = k.ball_contact[row] * depth * sqrt(depth)
            fx -= force * c
            fy -= force * s
        c, s = c * turn_c - s * turn_s, c * turn_s + s * turn_c
    return fx, fy


# --------------------
# The four bearings as arrays.
# --------------------


N_HARMONICS = 4
"""Harmonics of the element-passing motion."""
N_ANGLES = 32
"""Cage angles over one element spacing at which the shaft position is computed."""
N_PLACES = 1024
"""Element passages for which a position in the cage is drawn before they repeat (skidding varies the positions)."""


BEARING_FIELDS: list[tuple[str, type, tuple[int, ...]]] = [
    ("bearing_mass", np.float64, (4,)),
    ("per_bearing_mass", np.float64, (4,)),  # its reciprocal
    ("bearing_stiffness", np.float64, (4,)),
    ("bearing_damping", np.float64, (4,)),
    ("clearance", np.float64, (4,)),
    ("special", np.int64, (4,)),  # `BearingSupport.elements_pass`
    ("race", np.int64, (4,)),  # 0 none, 1 outer, 2 inner
    ("race_order", np.float64, (4,)),  # passings per revolution of the shaft
    ("race_length", np.float64, (4,)),  # in element spacings
    ("race_spacing", np.float64, (4,)),  # of the elements along the race, in m
    ("race_radius", np.float64, (4,)),  # of the elements, in m
    ("race_share", np.float64, (4,)),  # share of the heaviest loaded element in the load
    ("race_angle", np.float64, (4,)),
    ("load_angle", np.float64, (4,)),  # from +x counter-clockwise
    ("places", np.float64, (4, N_PLACES)),  # deviation of the elements from even spacing in the cage
    ("pass_order", np.float64, (4,)),  # of the elements past a stationary point
    ("balls", np.int64, (4,)),  # with individual contacts; 0 where one spring represents all
    ("ball_contact", np.float64, (4,)),  # K of Q = K δ^1.5, N/m^1.5
    ("sway", np.float64, (4, 2, N_HARMONICS, 2)),  # cosine and sine parts in m of the passing motion in x and y
]
"""Fields of the kernel's record, one entry per bearing; angles in rad."""


def bearing_fields(machine: Machine, mesh_force_n: float, rng: np.random.Generator) -> dict[str, Any]:
    """Values of `BEARING_FIELDS` at the set mesh force; draws the elements' positions in the cage."""
    supports = machine.bearings
    loads = bearing_loads_n(machine, mesh_force_n)
    defects = [_defect(b) for b in supports]
    places = np.zeros((4, N_PLACES))
    for row, (support, bearing_rng) in enumerate(zip(supports, rng.spawn(4), strict=True)):
        if support.defect is not None and support.defect.spacing_jitter > 0:
            places[row] = np.clip(bearing_rng.standard_normal(N_PLACES), -3, 3) * support.defect.spacing_jitter
    return {
        "bearing_mass": np.array([b.mass_kg for b in supports]),
        "per_bearing_mass": 1.0 / np.array([b.mass_kg for b in supports]),
        "bearing_stiffness": np.array(
            [stiffness_under_load_n_per_m(b, w) for b, w in zip(supports, loads, strict=True)]
        ),
        "bearing_damping": np.array([b.damping_n_s_per_m for b in supports]),
        "clearance": np.array([b.clearance_um * 1e-6 for b in supports]),
        "special": np.array([b.elements_pass for b in supports]),
        "balls": np.array([b.bearing.n_rolling_elements if b.law == "hertzian" else 0 for b in supports]),
        "ball_contact": np.array([contact_n_per_m15(b.bearing) if b.law == "hertzian" else 0.0 for b in supports]),
        "race": np.array([d[0] for d in defects], dtype=np.int64),
        "race_order": np.array([d[1] for d in defects]),
        "race_length": np.array([d[2] for d in defects]),
        "race_spacing": np.array([d[3] for d in defects]),
        "race_radius": np.array([5e-4 * (b.bearing.rolling_element_diameter_mm or 1.0) for b in supports]),
        "race_share": np.array([4.37 / (b.bearing.n_rolling_elements or 1) for b in supports]),
        "load_angle": np.arctan2(loads[:, 1], loads[:, 0]),
        "race_angle": np.array([np.radians(b.defect.angle_deg) if b.defect else 0.0 for b in supports]),
        "places": places,
        "pass_order": np.array([b.bearing.orders().get("BPFO", 0.0) for b in supports]),
        "sway": np.array([_sway(b, load) for b, load in zip(supports, loads, strict=True)]),
    }


def bearing_loads_n(machine: Machine, mesh_force_n: float) -> FloatArray:
    """Static force on each bearing, x and y in N, (4, 2): half of its gear's load and weight, plus its own weight."""
    beta = np.radians(machine.line_of_action_deg)
    down = -machine.gravity_mps2 * np.array([np.sin(beta), np.cos(beta)])
    loads = np.empty((4, 2))
    for row, support in enumerate(machine.bearings):
        side = row // 2
        mesh = np.array([0.0, -mesh_force_n if side == 0 else mesh_force_n])
        loads[row] = 0.5 * (mesh + machine.wheels[side].mass_kg * down) + support.mass_kg * down
    pair, tilt = machine.mesh.pair, tilting_shares(machine) * mesh_force_n
    centres = np.array([cos(pair.working_pressure_angle_rad), sin(pair.working_pressure_angle_rad)])
    loads += np.repeat(tilt, 2)[:, None] * np.array([1.0, -1.0, 1.0, -1.0])[:, None] * centres
    return loads


def tilting_shares(machine: Machine) -> FloatArray:
    """Force on the first bearing of each shaft along the line of centres, over the mesh force, (2,).

    F_a = N tan β_b acts on the driver along z, on the driven gear opposite to it, at the pitch radius r_w: its moment
    F_a r_w is supported by ±F_a r_w/L on the two bearings, L apart. The first bearing is at −z.
    """
    pair = machine.mesh.pair
    radii = np.array(pair.base_radii_m) / cos(pair.working_pressure_angle_rad)
    apart = np.array([shaft.bearing_distance_m for shaft in machine.shafts])
    result: FloatArray = machine.mesh.axial_share * radii / apart
    return result


def _defect(support: BearingSupport) -> tuple[int, float, float, float]:
    """(race, order, length in element spacings, spacing in m)."""
    defect, bearing = support.defect, support.bearing
    if defect is None:
        return 0, 0.0, 0.0, 1.0
    outer = defect.race == "outer"
    spacing = support.element_spacing_mm(defect.race) or 1.0
    share = (defect.length_mm + 2.0 * RACE_EDGE_MM) / spacing + 6.0 * defect.spacing_jitter
    if share > 1.0:
        longest = spacing * (1.0 - 6.0 * defect.spacing_jitter) - 2.0 * RACE_EDGE_MM
        raise InputError(
            f"length_mm of the defect in {bearing.name!r} is {defect.length_mm:g} mm: it holds two elements at once",
            allowed=f"at most {longest:.3g} mm with this scatter of the elements",
        )
    order = bearing.orders()["BPFO" if outer else "BPFI"]
    # A slipping cage lags: fewer passages on the outer race, more on the inner, as n = BPFO + BPFI.
    order += -defect.slip * order if outer else defect.slip * ((bearing.n_rolling_elements or 1) - order)
    return (1 if outer else 2), order, defect.length_mm / spacing, 1e-3 * spacing


def _sway(support: BearingSupport, load_n: FloatArray) -> FloatArray:
    """Fourier parts of the element-passing motion added by clearance, x and y, (2, N_HARMONICS, 2)."""
    if support.law == "hertzian" or support.clearance_um == 0 or np.hypot(*load_n) == 0:
        return np.zeros((2, N_HARMONICS, 2))
    motion = _carried_place(support, load_n, support.clearance_um * 1e-6) - _carried_place(support, load_n, 0.0)
    lines = np.fft.rfft(motion, axis=0)[1 : N_HARMONICS + 1] * 2.0 / len(motion)
    return np.stack([lines.real.T, -lines.imag.T], axis=-1)


def _carried_place(support: BearingSupport, load_n: FloatArray, clearance_m: float) -> FloatArray:
    """Shaft position less its mean, x and y in m, at even cage angles over one element spacing, (N_ANGLES, 2)."""
    n, load = support.bearing.n_rolling_elements or 1, float(np.hypot(*load_n))
    toward = np.array(load_n) / load
    deflection = load / support.stiffness_n_per_m
    # Mean over the cage of Σ cos^2.5 ψ for a load in the middle of its zone; K follows from the bearing's stiffness.
    psi = np.linspace(-pi / 2, pi / 2, 2001)
    contact = load / (deflection**1.5 * n * np.trapezoid(np.cos(psi) ** 2.5, psi) / (2 * pi))
    places = np.empty((N_ANGLES, 2))
    guess = toward * (deflection + clearance_m)
    for i in range(N_ANGLES):
        angles = 2 * pi * (np.arange(n) + i / N_ANGLES) / n
        radial = np.column_stack((np.cos(angles), np.sin(angles)))
        places[i] = guess = balanced(radial, contact, clearance_m, load_n, guess)
    swing: FloatArray = places - places.mean(axis=0)
    return swing


# Compiled: position of the foot of a bearing's spring, and the spring's force with clearance.

MIN_LOAD = 1e-12
EDGE_M = 5e-5
"""Length over which an edge is rounded: a contact is about 0.2 mm wide."""
FAR = 12.0
"""Distance outside a spall, in edge lengths, beyond which it has no effect."""


@njit(cache=True, nogil=True, error_model="numpy")
def foot(k, row, theta, x, y):
    """(d_x, d_y) in m: sinking over a race defect, and the element-passing motion of a bearing with clearance.

    `theta`: shaft angle. `x`, `y`: position of the shaft in the bearing, whose direction is that of the present load.
    """
    dx, dy = 0.0, 0.0
    if k.race[row] > 0:
        # At angle 0 the defect is halfway between two elements, so that no run starts with an impact.
        passed = k.race_order[row] * theta / (2.0 * pi) + 0.5
        element = floor(passed + 0.5)
        along = passed - element - k.places[row, int(element) % k.places.shape[1]]
        inside = (0.5 * k.race_length[row] - abs(along)) * k.race_spacing[row]
        if inside > -FAR * EDGE_M:
            # The rounding of the far edge is subtracted, so that a gap of zero length has no depth.
            across = k.race_length[row] * k.race_spacing[row]
            reach = EDGE_M * (_softplus(inside / EDGE_M) - _softplus((inside - across) / EDGE_M))
            depth = reach * reach / (2.0 * k.race_radius[row])
            direction = k.race_angle[row] + (k.load_angle[row] if k.race[row] == 1 else theta)
            # The driven shaft turns clockwise: its angle has the opposite sign in the frame.
            if k.race[row] == 2 and row >= 2:
                direction = -direction
            r = sqrt(x * x + y * y)
            carried = r - k.clearance[row]
            facing = (x * cos(direction) + y * sin(direction)) / r if carried > 0.0 else 0.0
            if facing > 0.0:
                share = k.race_share[row] * carried
                sink = share * (1.0 - exp(-depth / share)) * facing * sqrt(facing)
                dx += sink * cos(direction)
                dy += sink * sin(direction)
    if k.clearance[row] > 0.0 and k.balls[row] == 0:
        phase = k.pass_order[row] * theta
        for n in range(k.sway.shape[2]):
            c, s = cos((n + 1) * phase), sin((n + 1) * phase)
            dx += k.sway[row, 0, n, 0] * c + k.sway[row, 0, n, 1] * s
            dy += k.sway[row, 1, n, 0] * c + k.sway[row, 1, n, 1] * s
    return dx, dy


@njit(cache=True, nogil=True, error_model="numpy")
def carried_part(k, row, x, y):
    """(1 − c/r) beyond the clearance c, 0 within, smooth at the edge; the spring's force is this times k r."""
    clearance = k.clearance[row]
    if clearance <= 0.0:
        return 1.0
    r = sqrt(x * x + y * y)
    if r <= MIN_LOAD:
        return 0.0
    # The edge is smoothed over a tenth of the clearance: roughness and oil carry a little before the metal does.
    width = 0.1 * clearance
    over = (r - clearance) / width
    if over < -20.0:
        return 0.0
    depth = r - clearance if over > 20.0 else width * _softplus(over)
    return depth / r


@njit(cache=True, nogil=True, error_model="numpy")
def _softplus(x):

    return x + log1p(exp(-x)) if x > 0.0 else log1p(exp(x))
