"""The four bearings as arrays: springs, clearance, and what rolling elements do as they pass.

A rolling element over a spall carries less, and the shaft sinks towards it. The element can lose no more than its own
load: with Q its static load and k the bearing's stiffness, the shaft sinks by s (1 − exp(−h/s)), s = Q/k, h the depth
to which an element of that diameter sinks between the spall's edges. Q falls off with the angle ψ from the load's
direction as cos^1.5 ψ (Stribeck's distribution for a bearing without clearance). The sinking is a displacement of the
spring's foot, (x_b − d), with edges as long as a contact ellipse is wide.

With clearance, fewer elements share the load, and the shaft falls and rises as they pass: the difference from the
bearing without clearance is found from the static balance of all elements (F = K δ^1.5) at 32 places of the cage.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np

from gearsig.checks import FloatArray
from sims.machine import BearingSupport, Machine

EDGE_MM = 0.1
"""Half the length over which an element enters or leaves a spall; a usual contact is 0.1 to 0.3 mm wide."""
N_HARMONICS = 4
"""Of the motion at the rolling elements' passing."""
N_PLACES = 1024
"""Rolling elements whose place in the cage is drawn; then they repeat (the cage's own ones, spread by skidding)."""


BEARING_FIELDS: list[tuple[str, type, tuple[int, ...]]] = [
    ("bearing_mass", np.float64, (4,)),
    ("per_bearing_mass", np.float64, (4,)),  # its reciprocal
    ("bearing_stiffness", np.float64, (4,)),
    ("bearing_damping", np.float64, (4,)),
    ("clearance", np.float64, (4,)),
    ("special", np.int64, (4,)),  # has a defect or clearance
    ("race", np.int64, (4,)),  # 0 none, 1 outer, 2 inner
    ("race_order", np.float64, (4,)),  # passings per revolution of the shaft
    ("race_length", np.float64, (4,)),  # in element spacings
    ("race_edge", np.float64, (4,)),  # in element spacings
    ("race_sink", np.float64, (4,)),  # greatest sinking in m
    ("race_angle", np.float64, (4,)),
    ("load_angle", np.float64, (4,)),  # from +x counter-clockwise
    ("places", np.float64, (4, N_PLACES)),  # of the elements in the cage, off their even spacing
    ("pass_order", np.float64, (4,)),  # of the elements past a standing point
    ("sway", np.float64, (4, 2, N_HARMONICS, 2)),  # cosine and sine parts in m of x and y at the passing
]
"""Of the kernel's record, one entry per bearing; angles in rad."""


def bearing_fields(machine: Machine, mesh_force_n: float, rng: np.random.Generator) -> dict[str, Any]:
    """Values of `BEARING_FIELDS` at the set mesh force; draws the elements' places."""
    supports = machine.bearings
    loads = bearing_loads_n(machine, mesh_force_n)
    defects = [_defect(b, load) for b, load in zip(supports, loads, strict=True)]
    places = np.zeros((4, N_PLACES))
    for row, support in enumerate(supports):
        if support.defect is not None and support.defect.spacing_jitter > 0:
            places[row] = np.clip(rng.standard_normal(N_PLACES), -3, 3) * support.defect.spacing_jitter
    return {
        "bearing_mass": np.array([b.mass_kg for b in supports]),
        "per_bearing_mass": 1.0 / np.array([b.mass_kg for b in supports]),
        "bearing_stiffness": np.array([b.stiffness_n_per_m for b in supports]),
        "bearing_damping": np.array([b.damping_n_s_per_m for b in supports]),
        "clearance": np.array([b.clearance_um * 1e-6 for b in supports]),
        "special": np.array([b.clearance_um > 0 or b.defect is not None for b in supports]),
        "race": np.array([d[0] for d in defects], dtype=np.int64),
        "race_order": np.array([d[1] for d in defects]),
        "race_length": np.array([d[2] for d in defects]),
        "race_edge": np.array([d[3] for d in defects]),
        "race_sink": np.array([d[4] for d in defects]),
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
    return loads


def _defect(support: BearingSupport, load_n: FloatArray) -> tuple[int, float, float, float, float]:
    """(race, order, length and edge in element spacings, greatest sinking in m)."""
    defect, bearing = support.defect, support.bearing
    if defect is None:
        return 0, 0.0, 0.0, 1.0, 0.0
    ball, pitch = bearing.rolling_element_diameter_mm or 0.0, bearing.pitch_diameter_mm or 0.0
    n = bearing.n_rolling_elements or 1
    outer = defect.race == "outer"
    spacing = pi * (pitch + ball if outer else pitch - ball) / n
    reach = min(defect.length_mm, ball)
    depth = 1e-3 * (ball / 2 - sqrt(ball**2 / 4 - reach**2 / 4))
    share = 4.37 / n * float(np.hypot(*load_n)) / support.stiffness_n_per_m
    sink = share * (1.0 - np.exp(-depth / share)) if share > 0 else 0.0
    order = bearing.orders()["BPFO" if outer else "BPFI"]
    # A cage that slips falls behind: fewer passings outside, more inside, as n = BPFO + BPFI.
    order += -defect.slip * order if outer else defect.slip * (n - order)
    return (1 if outer else 2), order, defect.length_mm / spacing, EDGE_MM / spacing, float(sink)


def _sway(support: BearingSupport, load_n: FloatArray) -> FloatArray:
    """Fourier parts of the shaft's motion that clearance adds at the rolling elements' passing, (2, N_HARMONICS, 2)."""
    if support.clearance_um == 0 or np.hypot(*load_n) == 0:
        return np.zeros((2, N_HARMONICS, 2))
    motion = _carried_place(support, load_n, support.clearance_um * 1e-6) - _carried_place(support, load_n, 0.0)
    lines = np.fft.rfft(motion, axis=0)[1 : N_HARMONICS + 1] * 2.0 / len(motion)
    return np.stack([lines.real.T, -lines.imag.T], axis=-1)


def _carried_place(support: BearingSupport, load_n: FloatArray, clearance_m: float, n_angles: int = 32) -> FloatArray:
    """Where the shaft stands, x and y in m, at even places of the cage over one element spacing, (n_angles, 2)."""
    from scipy.optimize import root

    n, load = support.bearing.n_rolling_elements or 1, float(np.hypot(*load_n))
    toward = np.array(load_n) / load
    deflection = load / support.stiffness_n_per_m
    # Mean over the cage of Σ cos^2.5 ψ for a load in the middle of its zone: K follows from the bearing's stiffness.
    psi = np.linspace(-pi / 2, pi / 2, 2001)
    contact = load / (deflection**1.5 * n * np.trapezoid(np.cos(psi) ** 2.5, psi) / (2 * pi))
    places = np.empty((n_angles, 2))
    guess = toward * (deflection + clearance_m)
    for i in range(n_angles):
        angles = 2 * pi * (np.arange(n) + i / n_angles) / n
        radial = np.column_stack((np.cos(angles), np.sin(angles)))

        def out_of_balance(place: FloatArray, radial: FloatArray = radial) -> FloatArray:
            forces = contact * np.maximum(radial @ (place * 1e-6) - clearance_m, 0.0) ** 1.5
            result: FloatArray = (forces @ radial - load_n) / load
            return result

        solved = root(out_of_balance, guess * 1e6, method="hybr")
        guess = np.asarray(solved.x) * 1e-6
        places[i] = guess
    swing: FloatArray = places - places.mean(axis=0)
    return swing
