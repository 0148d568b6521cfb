"""Propagation of the study's geared rotors against scipy, and, where ROSS_PYTHON is set, against ROSS."""

import os

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from app.studies.gap.ross_rotors import (
    RossFault,
    RossMachine,
    RossMesh,
    Rub,
    apart_from_ross,
    linear_modes,
    march,
    record,
    with_ross,
)
from gearsig.gap import reduce_recording

RATIO, TEETH, SPEED, STIFF, MEAN_N = 1.6, (3, 4), 400.0, 5e6, 300.0
"""Contact ratio, teeth, rad/s of the driving gear, mean stiffness of the mesh in N/m, force between the flanks."""
needs_ross = pytest.mark.skipif("ROSS_PYTHON" not in os.environ, reason="ROSS_PYTHON is not set")


def test_teeth_that_soften_and_part_move_as_by_scipy() -> None:
    rng, n_path = np.random.default_rng(3), 33
    mesh = np.array([1.0, -1.0, 0.3])  # flanks approach by the first body, part by the second, turn with the third
    mass, ground = np.diag([0.5, 0.8, 0.3]), np.diag([2e5, 4e5, 3e5])
    damping = np.array([[60.0, 40.0, 0.0], [-40.0, 80.0, 0.0], [0.0, 0.0, 30.0]])  # with a gyroscopic part
    place = np.linspace(0.0, 1.0, n_path)
    pair = 1.0 / (3.5e6 * (1.0 - 0.3 * (2.0 * place - 1.0) ** 2))
    gaps, softer = ([size * rng.uniform(0.0, 1.0, (z, n_path)) for z in TEETH] for size in (3e-5, 1e-7))
    modes = linear_modes(mass, damping, ground + STIFF * np.outer(mesh, mesh))
    none = np.zeros((2, len(modes.poles)), dtype=np.complex128)
    teeth = RossMesh(
        mesh @ modes.shapes, -(modes.into @ mesh), none[0], none[0], STIFF, RATIO, 0.5, pair, (gaps[0], gaps[1]),
        (softer[0], softer[1]), 0.0, 0.05,
    )  # fmt: skip
    step, n = 5e-6, 12_001
    time = step * np.arange(n)

    def pushed(t: float) -> float:
        return MEAN_N * (1.0 + 1.3 * float(np.sin(900.0 * t)))

    def force(t: float, delta: float) -> float:
        cycle, total = SPEED * t * TEETH[0] / (2.0 * np.pi), 0.0
        for pair_number in range(int(cycle), int(cycle) - 3, -1):
            share = (cycle - pair_number) / RATIO
            if share < 1.0:
                low = [
                    sum(np.interp(share, place, table[side][pair_number % z]) for side, z in enumerate(TEETH))
                    for table in (gaps, softer)
                ]
                stiffness = min(1.0, share / 0.05, (1.0 - share) / 0.05) / (np.interp(share, place, pair) + low[1])
                total += stiffness * max(delta - low[0], 0.0)
        return float(total)

    def change(t: float, y: np.ndarray) -> np.ndarray:
        outside = mesh * (pushed(t) - force(t, float(mesh @ y[:3])))
        return np.concatenate([y[3:], np.linalg.solve(mass, outside - damping @ y[3:] - ground @ y[:3])])

    found = solve_ivp(change, (0.0, time[-1]), np.zeros(6), t_eval=time, max_step=2e-5, rtol=1e-8, atol=1e-12)
    courses = np.array([pushed(t) for t in time])[:, None]
    out = march(
        step, modes.poles, none[0].copy(), (modes.into @ mesh)[:, None], courses, SPEED * time, np.zeros(n), teeth,
        Rub(none, none, 1.0, 0.0, 0.0, 0.0, 0.0), np.ascontiguousarray(modes.shapes[:1]),
    )  # fmt: skip
    expected = mesh @ found.y[:3]
    parted = np.mean([force(t, float(d)) == 0.0 for t, d in zip(time, expected, strict=True)])
    assert 0.05 < parted < 0.9
    assert np.std(out[:, -1] - expected) < 2e-3 * np.std(expected)
    accelerations = np.array([change(t, y)[3] for t, y in zip(time, found.y.T, strict=True)])
    assert np.std(out[1:, 0] - accelerations[1:]) < 1e-2 * np.std(accelerations)


@needs_ross
@pytest.mark.slow
def test_it_moves_as_ross_moves() -> None:
    assert apart_from_ross(800, 2.5e-6) < 0.02


@needs_ross
@pytest.mark.slow
def test_a_healthy_one_is_heard_at_its_mesh() -> None:
    machine = with_ross([RossMachine.draw(np.random.default_rng(5))])[0]
    recording = record(machine, 0, RossFault(), np.random.default_rng(6), None)
    run = reduce_recording(recording)
    assert 60.0 * run.speed_hz == pytest.approx(machine.points[0][0], rel=0.02)
    lines = np.abs(np.fft.rfft(recording.samples[0] * np.hanning(recording.samples.shape[1])))
    loudest_hz = float(np.argmax(lines)) * recording.sampling_rate_hz / recording.samples.shape[1]
    harmonic = loudest_hz / (run.speed_hz * machine.asked["teeth"][0])
    assert harmonic == pytest.approx(round(harmonic), abs=0.05)
