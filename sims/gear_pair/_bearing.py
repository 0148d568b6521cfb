"""The four bearings as arrays: springs, clearance, and what rolling elements do as they pass.

A rolling element over a spall carries less, and the shaft sinks towards it. Between the edges an element of radius R
that follows them is h = x²/2R deep, x its distance from the nearer edge. It can lose no more than its own load: with Q
its load at this time and k the bearing's stiffness, the shaft sinks by s (1 − exp(−h/s)), s = Q/k. Knocks grow with the
load, and with the spall only up to half a millimetre or so. Q falls off with the angle ψ from the load's direction as
cos^1.5 ψ (Stribeck's distribution for a bearing without clearance). The sinking is a displacement of the spring's foot,
(x_b − d).

With clearance, fewer elements share the load, and the shaft falls and rises as they pass: the difference from the
bearing without clearance is found from the static balance of all elements (F = K δ^1.5) at 32 places of the cage. A
bearing of law "hertzian" has no spring at all: the contacts of its elements carry one by one, see `_rolling`.
"""

# mypy: allow-untyped-defs, allow-untyped-calls

from __future__ import annotations

from math import cos, exp, floor, log1p, pi, sin, sqrt
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.errors import InputError
from sims.gear_pair._rolling import balanced, contact_n_per_m15, stiffness_under_load_n_per_m
from sims.machine import RACE_EDGE_MM, BearingSupport, Machine

N_HARMONICS = 4
"""Of the motion at the rolling elements' passing."""
N_ANGLES = 32
"""Of the cage over one element spacing, at which the shaft's place is found."""
N_PLACES = 1024
"""Rolling elements whose place in the cage is drawn; then they repeat (the cage's own ones, spread by skidding)."""


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
    ("places", np.float64, (4, N_PLACES)),  # of the elements in the cage, off their even spacing
    ("pass_order", np.float64, (4,)),  # of the elements past a standing point
    ("balls", np.int64, (4,)),  # whose contacts carry one by one; 0 where a spring stands for all
    ("ball_contact", np.float64, (4,)),  # K of Q = K δ^1.5, N/m^1.5
    ("sway", np.float64, (4, 2, N_HARMONICS, 2)),  # cosine and sine parts in m of x and y at the passing
]
"""Of the kernel's record, one entry per bearing; angles in rad."""


def bearing_fields(machine: Machine, mesh_force_n: float, rng: np.random.Generator) -> dict[str, Any]:
    """Values of `BEARING_FIELDS` at the set mesh force; draws the elements' places."""
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
    """Static force on each bearing, x and y in N, (4, 2): half of its gear's load and weight, and its own weight."""
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

    F_a = N tan β_b acts on the driver along z and on the driven gear against it, at the pitch radius r_w on either side
    of the mesh: its moment F_a r_w is taken by ±F_a r_w/L on the two bearings, L apart. The first bearing stands at −z.
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
    # A cage that slips falls behind: fewer passings outside, more inside, as n = BPFO + BPFI.
    order += -defect.slip * order if outer else defect.slip * ((bearing.n_rolling_elements or 1) - order)
    return (1 if outer else 2), order, defect.length_mm / spacing, 1e-3 * spacing


def _sway(support: BearingSupport, load_n: FloatArray) -> FloatArray:
    """Fourier parts of the shaft's motion that clearance adds at the rolling elements' passing, (2, N_HARMONICS, 2)."""
    if support.law == "hertzian" or support.clearance_um == 0 or np.hypot(*load_n) == 0:
        return np.zeros((2, N_HARMONICS, 2))
    motion = _carried_place(support, load_n, support.clearance_um * 1e-6) - _carried_place(support, load_n, 0.0)
    lines = np.fft.rfft(motion, axis=0)[1 : N_HARMONICS + 1] * 2.0 / len(motion)
    return np.stack([lines.real.T, -lines.imag.T], axis=-1)


def _carried_place(support: BearingSupport, load_n: FloatArray, clearance_m: float) -> FloatArray:
    """Where the shaft stands, x and y in m, at even places of the cage over one element spacing, (N_ANGLES, 2)."""
    n, load = support.bearing.n_rolling_elements or 1, float(np.hypot(*load_n))
    toward = np.array(load_n) / load
    deflection = load / support.stiffness_n_per_m
    # Mean over the cage of Σ cos^2.5 ψ for a load in the middle of its zone: K follows from the bearing's stiffness.
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


# Compiled: where the foot of a bearing's spring stands, and the spring's force with clearance.

MIN_LOAD = 1e-12
EDGE_M = 5e-5
"""Length over which an edge is rounded: a contact is some 0.2 mm wide."""
FAR = 12.0
"""Edge lengths outside a spall beyond which nothing is felt."""


@njit(cache=True, nogil=True, error_model="numpy")
def foot(k, row, theta, x, y):
    """(d_x, d_y) in m: sinking over a race defect, and the sway of a bearing with clearance.

    `theta`: shaft angle. `x`, `y`: place of the shaft in the bearing, whose direction is that of the load now.
    """
    dx, dy = 0.0, 0.0
    if k.race[row] > 0:
        # At angle 0 the defect lies half way between two elements: nothing starts with a blow.
        passed = k.race_order[row] * theta / (2.0 * pi) + 0.5
        element = floor(passed + 0.5)
        along = passed - element - k.places[row, int(element) % k.places.shape[1]]
        inside = (0.5 * k.race_length[row] - abs(along)) * k.race_spacing[row]
        if inside > -FAR * EDGE_M:
            # The rounded corner of the far edge is taken off: a gap of no length is none.
            across = k.race_length[row] * k.race_spacing[row]
            reach = EDGE_M * (_softplus(inside / EDGE_M) - _softplus((inside - across) / EDGE_M))
            depth = reach * reach / (2.0 * k.race_radius[row])
            direction = k.race_angle[row] + (k.load_angle[row] if k.race[row] == 1 else theta)
            # The driven shaft turns clockwise: its angle counts the other way in the frame.
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
    """(1 − c/r) beyond the clearance c, 0 within: the spring's force is that times k r. Smooth at the edge."""
    clearance = k.clearance[row]
    if clearance <= 0.0:
        return 1.0
    r = sqrt(x * x + y * y)
    if r <= MIN_LOAD:
        return 0.0
    # A soft edge of a tenth of the clearance: roughness and oil carry a little before the metal does.
    width = 0.1 * clearance
    over = (r - clearance) / width
    if over < -20.0:
        return 0.0
    depth = r - clearance if over > 20.0 else width * _softplus(over)
    return depth / r


@njit(cache=True, nogil=True, error_model="numpy")
def _softplus(x):

    return x + log1p(exp(-x)) if x > 0.0 else log1p(exp(x))
