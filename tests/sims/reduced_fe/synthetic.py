"""A reduced gear without finite elements: teeth by potential energy, a body of a ring's in-plane modes."""

from __future__ import annotations

import numpy as np

from sims.fe_gear import FlankGrid, GearBlank, ReducedGear
from sims.mesh import STEEL, GearGeometry, disc_inertia_kg_m2, disc_mass_kg, tooth_compliance

BODY_HZ = ((2, 3910.0), (3, 8915.0), (1, 12641.0), (4, 15000.0), (5, 21000.0))
"""Nodal diameters and frequencies; those up to the third are the disc's of the finite-element model."""
TWIST_HZ = 13000.0


def synthetic_gear(
    geometry: GearGeometry | None = None,
    n_heights: int = 9,
    n_slices: int = 5,
    n_offsets: int = 4,
    *,
    even_slices: bool = False,
) -> ReducedGear:
    """Return a gear of consistent parts: its free compliance is that of its modes and of teeth which bend alone."""
    gear = geometry or GearGeometry(50, 3.0, bore_radius_mm=20.0)
    blank = GearBlank(gear)
    roll = np.linspace(gear.form_roll_rad * 1.02, gear.tip_roll_rad, n_heights)
    width = gear.face_width_mm * 1e-3
    z = (np.arange(n_slices) + 0.5) / n_slices * width - width / 2.0
    grid = FlankGrid(roll, z)
    shape = grid.shape
    mass, inertia = disc_mass_kg(gear), disc_inertia_kg_m2(gear)
    diameters, frequencies, modes, hub = _body_modes(gear, mass, shape)
    own = _tooth_alone(gear, roll, width, shape, even_slices)
    pitch = 2.0 * np.pi / gear.teeth
    free = np.zeros((n_offsets, grid.n_points, grid.n_points))
    free[0] = own
    for offset in range(n_offsets):
        turned = _turned(modes, diameters, offset * pitch)
        free[offset] += (turned / (2.0 * np.pi * frequencies[:, None]) ** 2).T @ modes
    omega = 2.0 * np.pi * frequencies
    return ReducedGear(
        blank=blank,
        key="synthetic",
        n_dof=0,
        spread="section",
        mass_kg=mass,
        polar_inertia_kg_m2=inertia,
        diametral_inertia_kg_m2=inertia / 2.0,
        grid=grid,
        frequencies_hz=frequencies,
        nodal_diameters=diameters,
        flank_modes=modes,
        hub_modes=hub,
        free_compliance_m_per_n=free,
        clamped_compliance_m_per_n=free,
        hub_flank_compliance=(hub / omega[:, None] ** 2).T @ modes,
        hub_compliance=(hub / omega[:, None] ** 2).T @ hub + np.diag([5e-11, 5e-11, 1e-10, 1e-8, 1e-8, 4e-8]),
    )


def _body_modes(gear, mass, shape):
    """In-plane modes of a ring at the pitch circle, in pairs, and a twist of rim against hub (n = 0)."""
    half = np.radians(gear.pressure_angle_deg)
    rows, diameters, frequencies, hubs = [], [], [], []
    for n, hertz in BODY_HZ:
        # Radial u cos nφ, tangential −(u/n) sin nφ; push = −(tangential cos α + radial sin α) on flank 0.
        amplitude = np.sqrt(2.0 / mass)
        cosine, sine = -amplitude * np.sin(half), amplitude / n * np.cos(half)
        for signs in ((cosine, cosine), (-sine, sine)):
            both = np.empty(shape)
            both[0], both[1] = signs[0], signs[1]
            rows.append(both.ravel())
        # The sine partner of the tangential part: the pair turns as (c, s) by nφ.
        c, s = rows[-2].copy(), rows[-1].copy()
        rows[-2], rows[-1] = c, s
        diameters += [n, n]
        frequencies += [hertz, hertz]
        hubs += [np.zeros(6), np.zeros(6)]
    twist = np.empty(shape)
    lever = 0.5 / np.sqrt(mass) * np.cos(half)
    twist[0], twist[1] = -lever, lever
    rows.append(twist.ravel())
    diameters.append(0)
    frequencies.append(TWIST_HZ)
    hub = np.zeros(6)
    hub[5] = -1.2 / np.sqrt(mass) / (gear.pitch_radius_mm * 1e-3)
    hubs.append(hub)
    order = np.argsort(frequencies, kind="stable")
    return (
        np.array(diameters, dtype=np.int64)[order],
        np.array(frequencies)[order],
        np.array(rows)[order],
        np.array(hubs)[order],
    )


def _turned(modes, diameters, angle):
    turned = modes * np.cos(diameters * angle)[:, None]
    first = np.flatnonzero(diameters > 0)[::2]
    sine = np.sin(diameters[first] * angle)[:, None]
    turned[first] -= modes[first + 1] * sine
    turned[first + 1] += modes[first] * sine
    return turned


def _tooth_alone(gear, roll, width, shape, even_slices):
    """Compliance between the points of one tooth: of its beam, slices held together, the other flank pulls back."""
    n_flanks, _, n_slices = shape
    own = tooth_compliance(gear, STEEL, roll).total / width + 2.0e-9
    nearness = np.exp(-np.abs(roll[:, None] - roll[None, :]) / 0.6)
    heights = np.sqrt(np.outer(own, own)) * nearness
    place = np.arange(n_slices)
    slices = 0.6 + 1.4 * np.exp(-np.abs(place[:, None] - place[None, :]) / 1.2)
    if even_slices:
        slices = np.ones((n_slices, n_slices)) + 1e-6 * np.eye(n_slices)
    slices /= slices.sum() / n_slices**2  # even load gives the whole tooth's compliance
    flanks = np.array([[1.0, -0.6], [-0.6, 1.0]])[:n_flanks, :n_flanks]
    return np.einsum("ab,ij,st->aisbjt", flanks, heights, slices).reshape(own.size * n_slices * 2, -1)
